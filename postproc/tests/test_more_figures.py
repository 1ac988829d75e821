"""Figure 10 and the figure of the starts: what is drawn is what the files hold."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from result_files import write_result

from spurflex_postproc import ResultError, open_result
from spurflex_postproc.cli import main
from spurflex_postproc.figures import FIGURES, Options
from spurflex_postproc.published import PAPER_STIFFNESS

SPEED = np.linspace(300.0, 6000.0, 571)


@pytest.fixture
def eta_file(tmp_path: Path) -> Path:
    """A map whose eta changes its sign six times below a stiff range."""
    path = write_result(tmp_path / "figure9.h5", SPEED[::3], np.logspace(3, 12, 31))
    with h5py.File(path, "r+") as file:
        stripe = (file["speed"][:] // 900).astype(int)
        soft = (file["support_stiffness"][:] < 1e11)[:, np.newaxis]
        file["eta1"][...] = np.where(soft, 10.0 * (-1.0) ** stripe, 0.0)
    return path


@pytest.fixture
def start_files(tmp_path: Path) -> list[Path]:
    """Two starts that differ in the band of coexisting motions."""
    paths = []
    for start, band in (("up", None), ("rest", (4900.0, 5000.0))):
        path = write_result(
            tmp_path / f"figure2-{start}.h5", SPEED, np.array([PAPER_STIFFNESS]), irregular=band
        )
        with h5py.File(path, "r+") as file:
            file["provenance"]["resolved_deck"] = f"&sweep\n  start = '{start}'\n/\n"
        paths.append(path)
    return paths


def test_figure_10_holds_the_data(eta_file: Path) -> None:
    (drawing,) = FIGURES["10"].draw(open_result(eta_file), Options())
    with h5py.File(eta_file) as file:
        deformation, eta = 1e6 * file["bearing1_deformation_max"][:], file["eta1"][:]
        rigid = 1e6 * file["rigid_bearing1_deformation_max"][:]
    meshes = {
        item.get_gid(): np.ravel(item.get_array())
        for axes in drawing.figure.axes
        for item in axes.collections
        if isinstance(item, QuadMesh) and item.get_gid()
    }
    np.testing.assert_allclose(meshes["deformation"], deformation.ravel(), rtol=1e-14)
    np.testing.assert_array_equal(meshes["eta"], eta.ravel())
    (line,) = [one for one in drawing.figure.axes[0].lines if one.get_gid() == "rigid line"]
    y = np.asarray(line.get_ydata())
    np.testing.assert_allclose(y[np.isfinite(y)], rigid, rtol=1e-14)


def test_figure_10_letters_the_areas(eta_file: Path) -> None:
    (drawing,) = FIGURES["10"].draw(open_result(eta_file), Options())
    texts = {
        text.get_text(): text.get_position()
        for axes in drawing.figure.axes
        for text in axes.texts
        if (text.get_gid() or "").startswith("area")
    }
    assert sorted(texts) == list("ABCDEFGH")
    speeds = [texts[letter][0] for letter in "BCDEFGH"]
    assert speeds == sorted(speeds)
    assert texts["A"][1] > 1e11
    assert "  H        +" in drawing.report


def test_figure_10_needs_a_map(start_files: list[Path]) -> None:
    with pytest.raises(ResultError, match="at least 2 x 2"):
        FIGURES["10"].draw(open_result(start_files[0]), Options())


def test_starts_hold_the_data(start_files: list[Path]) -> None:
    results = [open_result(path) for path in start_files]
    (drawing,) = FIGURES["starts"].draw(results, Options())
    inside = (SPEED >= 4500) & (SPEED <= 5750)
    for start, result in zip(("up", "rest"), results, strict=True):
        for axes, values in (
            (drawing.figure.axes[0], result["rigid_y1_amplitude"].values),
            (drawing.figure.axes[1], result["y1_amplitude"].values[0]),
        ):
            (line,) = [one for one in axes.lines if one.get_gid() == start]
            np.testing.assert_allclose(line.get_ydata(), 1e6 * values[inside], rtol=1e-14)
    rows = {
        item.get_gid(): np.ravel(item.get_array()) for item in drawing.figure.axes[2].collections
    }
    assert list(rows) == ["published", "start 'up'", "start 'rest'"]
    assert "4900 to 5000" in drawing.report


def test_starts_have_to_differ(start_files: list[Path], tmp_path: Path) -> None:
    result = open_result(start_files[0])
    with pytest.raises(ResultError, match="a second file with start 'up'"):
        FIGURES["starts"].draw([result, result], Options())


def test_command_takes_several_files(start_files: list[Path], tmp_path: Path) -> None:
    names = [str(path) for path in start_files]
    assert main(["starts", *names, "--output", str(tmp_path / "out")]) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        *("starts.pdf", "starts.png")
    ]
    with pytest.raises(SystemExit):
        main(["2", *names])
