"""Result files shared by the tests."""

from pathlib import Path

import numpy as np
import pytest
from result_files import write_motions, write_result

from spurflex_postproc import style
from spurflex_postproc.published import PAPER_STIFFNESS

SPEED = np.linspace(300.0, 6000.0, 571)
STIFFNESS = np.logspace(3, 12, 10)
BAND = (4650.0, 4990.0)


@pytest.fixture(autouse=True)
def _style() -> None:
    style.apply()


@pytest.fixture(scope="session")
def curve_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Both supports, one stiffness, with an irregular band."""
    path = tmp_path_factory.mktemp("curve") / "figure2.h5"
    return write_result(path, SPEED, np.array([PAPER_STIFFNESS]), irregular=BAND)


@pytest.fixture(scope="session")
def map_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Both supports, 41 stiffnesses x 191 speeds, with an irregular band."""
    path = tmp_path_factory.mktemp("map") / "figure9.h5"
    speed = np.linspace(300.0, 6000.0, 191)
    return write_result(path, speed, np.logspace(6, 12, 41), irregular=BAND)


@pytest.fixture
def small_file(tmp_path: Path) -> Path:
    """Both supports, 3 stiffnesses x 5 speeds, to be damaged by a test."""
    return write_result(tmp_path / "small.h5", SPEED[:5], STIFFNESS[:3])


@pytest.fixture(scope="session")
def motions_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Both supports, the published sequence of motions, all products of y1 and x2."""
    return write_motions(tmp_path_factory.mktemp("motions") / "figure3.h5")
