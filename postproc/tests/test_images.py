"""A few pictures are compared with stored ones: they catch what no list of numbers shows."""

from pathlib import Path

import numpy as np
import pytest
from image_cases import CASES, FOLDER, STRICT, comparison, difference, pixels, write

LARGEST = 60_000
"""Largest stored picture [bytes]."""


@pytest.mark.parametrize("name", CASES)
def test_layout_is_as_stored(name: str, tmp_path: Path) -> None:
    drawn = pixels(write(name, tmp_path / f"{name}.png"))
    stored = FOLDER / f"{name}.png"
    assert stored.stat().st_size < LARGEST
    rule = comparison()
    assert difference(drawn, pixels(stored), rule.block) < rule.tolerance


@pytest.mark.parametrize("name", CASES)
def test_faults_of_layout_are_seen(name: str) -> None:
    stored = pixels(FOLDER / f"{name}.png")
    rows, columns = stored.shape[:2]
    without_panel, without_title = stored.copy(), stored.copy()
    without_panel[rows // 2 :, columns // 2 :] = 1.0
    without_title[: rows // 8] = 1.0
    for fault in (without_panel, without_title, np.roll(stored, 3, axis=1)):
        assert difference(fault, stored, STRICT.block) > STRICT.tolerance
    assert difference(stored[:, :-1], stored, STRICT.block) == float("inf")


@pytest.mark.parametrize("name", CASES)
def test_soft_edges_are_not_seen(name: str) -> None:
    stored = pixels(FOLDER / f"{name}.png")
    soft = (stored + np.roll(stored, 1, axis=0) + np.roll(stored, 1, axis=1)) / 3
    assert difference(soft, stored, STRICT.block) < STRICT.tolerance
