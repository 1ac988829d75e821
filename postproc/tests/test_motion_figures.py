"""Figures 3 to 8 and their general forms: what is drawn is what the files hold."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.figure import Figure
from result_files import SECOND

from spurflex_postproc import ResultError, open_result
from spurflex_postproc.cli import main
from spurflex_postproc.figures import FIGURES, Options
from spurflex_postproc.figures.motion_strip import CLASSES, line_colour
from spurflex_postproc.figures.one_motion import fraction, read_motion
from spurflex_postproc.figures.spectrum_map import CELL, pooled
from spurflex_postproc.figures.waterfall import DEPTH, SHEAR, ordinal, thinned, without_floor

SPEED = np.arange(300.0, 6001.0, 300.0)


def points(axes: Axes, gid: str) -> tuple[np.ndarray, np.ndarray]:
    """Points of the one line of an axes with an id."""
    (found,) = [line for line in axes.lines if line.get_gid() == gid]
    return np.asarray(found.get_xdata()), np.asarray(found.get_ydata())


def panel(figure: Figure, title: str) -> Axes:
    """The axes whose title begins so."""
    (found,) = [axes for axes in figure.axes if axes.get_title(loc="left").startswith(title)]
    return found


def recorded(path: Path, name: str) -> np.ndarray:
    """A variable of a file, without the one support stiffness."""
    with h5py.File(path) as file:
        data = file[name][:]
    return data if "rigid" in name else data[0]


def test_figure_3_has_the_panels_of_the_article(motions_file: Path) -> None:
    drawing, map_ = FIGURES["3"].draw(open_result(motions_file), Options())
    titles = [axes.get_title(loc="left") for axes in drawing.figure.axes[:4]]
    assert titles == [
        *("a  flexible support", "b  rigid support"),
        *("c  flexible support", "d  rigid support"),
    ]
    assert (drawing.name, map_.name) == ("figure3", "figure3_map")
    assert "computed   1T to 4500" in drawing.report


@pytest.mark.parametrize(
    ("title", "support", "name"),
    [("a", "flexible", "spectrum"), ("b", "rigid", "rigid_spectrum")],
)
def test_waterfall_holds_the_spectra(
    motions_file: Path, title: str, support: str, name: str
) -> None:
    drawing, _ = FIGURES["3"].draw(open_result(motions_file), Options())
    axes = panel(drawing.figure, title)
    spectra = 1e6 * recorded(motions_file, name)[:, 1:]
    order = recorded(motions_file, "rigid_spectrum").shape[1] - 1
    order = np.arange(1, order + 1) / 840
    strongest = spectra.max()
    for at, speed in enumerate(SPEED):
        x, y = points(axes, f"{support} {speed:g}")
        back = (speed - 300) / 5700
        x, y = x - back * SHEAR * order[-1], y - back * DEPTH * strongest
        drawn = np.isfinite(y)
        # What is not drawn is as good as zero, what is drawn is the spectrum.
        places = np.rint(840 * x[drawn]).astype(int) - 1
        shown = spectra[at] > 5e-4 * strongest
        assert set(np.flatnonzero(shown)) <= set(places)
        expected = np.where(shown, spectra[at], 0.0)[places]
        np.testing.assert_allclose(y[drawn], expected, atol=1e-9 * strongest)


def test_waterfall_draws_every_kth_speed(
    motions_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spurflex_postproc.figures.waterfall.MOST_LINES", 7)
    drawing, _ = FIGURES["waterfall"].draw(open_result(motions_file), Options(quantity="x2"))
    names = [line.get_gid() for line in drawing.figure.axes[0].lines if line.get_gid()]
    assert names == [f"flexible {speed:g}" for speed in SPEED[::3]]
    assert "every 3rd of 20 speeds" in drawing.report
    assert drawing.name == "waterfall_x2"
    assert [ordinal(one) for one in (1, 2, 11, 12, 22)] == ["1st", "2nd", "11th", "12th", "22nd"]


def test_map_of_spectra_loses_no_line(motions_file: Path) -> None:
    _, drawing = FIGURES["3"].draw(open_result(motions_file), Options())
    for name in ("spectrum", "rigid_spectrum"):
        support = "rigid" if name.startswith("rigid") else "flexible"
        (mesh,) = [
            item
            for axes in drawing.figure.axes
            for item in axes.collections
            if isinstance(item, QuadMesh) and item.get_gid() == f"{support} spectrum"
        ]
        shown = np.asarray(mesh.get_array()).reshape(-1, SPEED.size)
        spectra = 1e6 * recorded(motions_file, name)[:, 1:]
        np.testing.assert_allclose(shown.max(axis=0), spectra.max(axis=1), rtol=1e-12)
        corners = mesh.get_coordinates()
        for at, speed in enumerate(SPEED):
            cell = int(np.argmax(shown[:, at]))
            low, high = corners[cell, at, 1], corners[cell + 1, at, 1]
            assert low < (np.argmax(spectra[at]) + 1) / 840 < high
            assert corners[0, at, 0] < speed < corners[0, at + 1, 0]


def test_pooling() -> None:
    order = np.arange(1, 13) / 120
    amplitude = np.arange(12.0)[np.newaxis]
    middles, strongest = pooled(order, amplitude, 1 / 30)
    np.testing.assert_allclose(middles, [0, 1 / 30, 2 / 30, 0.1])
    np.testing.assert_array_equal(strongest, [[0, 4, 8, 11]])
    coarse, same = pooled(np.array([0.5, 1.0, 1.5]), np.ones((2, 3)), CELL)
    np.testing.assert_allclose(coarse, [0.5, 1.0, 1.5])
    assert same.shape == (2, 3)


def test_thin_lines() -> None:
    order, values = np.arange(6.0), np.array([0, 0, 0.1, 0, 0, 0])
    x, y = thinned(order, values, 0.01)
    np.testing.assert_array_equal(x, [0, 1, 2, 3, 5])
    x, y = without_floor(x, y)
    np.testing.assert_array_equal(x, [0, np.nan, 1, 2, 3, np.nan, 5])
    np.testing.assert_array_equal(y, [0, np.nan, 0, 0.1, 0, np.nan, 0])
    assert thinned(order, np.full(6, np.nan), 0.0)[0].size == 0


@pytest.mark.parametrize(
    ("title", "support", "name"),
    [("c", "flexible", "poincare"), ("d", "rigid", "rigid_poincare")],
)
def test_bifurcation_diagram_holds_the_sections(
    motions_file: Path, title: str, support: str, name: str
) -> None:
    drawing, _ = FIGURES["3"].draw(open_result(motions_file), Options())
    axes = panel(drawing.figure, title)
    sections = 1e6 * recorded(motions_file, name)
    motion = recorded(motions_file, name.replace("poincare", "motion"))
    assert {line.get_gid() for line in axes.lines} == {f"{support} {flag}" for flag in set(motion)}
    for flag, count in ((1, 1), (2, 2), (3, 3), (20, 24), (109, 9)):
        if flag not in motion:
            continue
        x, y = points(axes, f"{support} {flag}")
        np.testing.assert_array_equal(x, np.repeat(SPEED[motion == flag], count))
        np.testing.assert_allclose(y, sections[motion == flag, :count].ravel(), rtol=1e-14)


def test_bifurcation_of_another_quantity(motions_file: Path) -> None:
    (drawing,) = FIGURES["bifurcation"].draw(open_result(motions_file), Options(quantity="x2"))
    assert drawing.name == "bifurcation_x2"
    assert "x_2" in drawing.figure.axes[0].get_ylabel()
    with pytest.raises(ResultError, match="lacks poincare_ym"):
        FIGURES["bifurcation"].draw(open_result(motions_file), Options(quantity="ym"))


def test_strips_of_figure_3(motions_file: Path) -> None:
    drawing, _ = FIGURES["3"].draw(open_result(motions_file), Options())
    rows = {
        item.get_gid(): np.ravel(item.get_array()) for item in drawing.figure.axes[4].collections
    }
    names = [name for name, _, _ in CLASSES]
    told = [names[int(at)] for at in rows["published"]]
    assert told[-5:] == ["chaotic", "3T", "1T", "2T", "2T"]
    found = [names[int(at)] for at in rows["computed"]]
    assert found[-6:] == ["1T", "quasi-periodic", "3T", "1T", "2T", "2T"]
    assert line_colour(20) != line_colour(30)


@pytest.mark.parametrize(
    ("number", "flag", "loops"), [("4", 1, 1), ("6", 3, 3), ("7", 1, 1), ("8", 2, 2)]
)
def test_figures_of_one_motion(motions_file: Path, number: str, flag: int, loops: int) -> None:
    result = open_result(motions_file)
    speed = {"4": 1500, "6": 5100, "7": 5400, "8": 6000}[number]
    (drawing,) = FIGURES[number].draw(result, Options(speed=speed))
    at = int(np.argmin(np.abs(SPEED - speed)))
    figure = drawing.figure
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        *("a  time history", "b  spectrum", "c  phase plane", "d  Poincaré map")
    ]
    values = 1e6 * recorded(motions_file, "history/y1")[at]
    rates = 1e3 * recorded(motions_file, "history/y1_rate")[at]
    x, y = points(figure.axes[0], "history")
    np.testing.assert_allclose(x, np.arange(512) / 64)
    np.testing.assert_allclose(y, values, rtol=1e-14)

    x, y = points(figure.axes[2], "phase")
    np.testing.assert_allclose(x, np.append(values[: 64 * loops], values[0]), rtol=1e-14)
    np.testing.assert_allclose(y, np.append(rates[: 64 * loops], rates[0]), rtol=1e-14)

    section = 1e6 * recorded(motions_file, "poincare")[at, :loops]
    rate = 1e3 * recorded(motions_file, "poincare_rate")[at, :loops]
    for axes, gid in ((figure.axes[2], "section on top"), (figure.axes[3], "section")):
        x, y = points(axes, gid)
        np.testing.assert_allclose(x, section, rtol=1e-14)
        np.testing.assert_allclose(y, rate, rtol=1e-14)
    assert figure.axes[3].get_xlim() == figure.axes[2].get_xlim()

    (lines,) = [c for c in figure.axes[1].collections if isinstance(c, LineCollection)]
    ends = np.array(lines.get_segments())
    spectrum = 1e6 * recorded(motions_file, "spectrum")[at]
    there = 1 + np.flatnonzero(spectrum[1:] > 1e-5 * spectrum[1:].max())
    np.testing.assert_allclose(ends[:, 1, 0], there / 840)
    np.testing.assert_allclose(ends[:, 1, 1], spectrum[there], rtol=1e-14)
    assert (ends[:, 0, 1] == 0).all()
    assert f"computed: {flag}T; published" in figure.texts[0].get_text()


def test_figure_of_an_irregular_motion(motions_file: Path) -> None:
    (drawing,) = FIGURES["5"].draw(open_result(motions_file), Options(speed=4800))
    at = int(np.argmin(np.abs(SPEED - 4800)))
    history, spectrum, phase, section = drawing.figure.axes
    x, y = points(spectrum, "spectrum")
    np.testing.assert_allclose(x, np.arange(1, 3361) / 840)
    np.testing.assert_allclose(y, 1e6 * recorded(motions_file, "spectrum")[at, 1:], rtol=1e-14)
    x, _ = points(phase, "phase")
    np.testing.assert_allclose(x, 1e6 * recorded(motions_file, "history/y1")[at], rtol=1e-14)
    assert points(section, "section")[0].size == 24
    assert section.get_xlim() != phase.get_xlim()
    names = {text.get_text() for text in spectrum.texts}
    assert {"1.00", "2.00", f"{SECOND:.2f}", f"{1 - SECOND:.2f}"} <= names
    assert "computed: quasi-periodic; published: chaotic" in drawing.figure.texts[0].get_text()
    assert history.get_xlabel() == "time (mesh periods of 0.2273 ms)"


def test_names_of_lines(motions_file: Path) -> None:
    (drawing,) = FIGURES["6"].draw(open_result(motions_file), Options(speed=5100))
    names = {text.get_text() for text in drawing.figure.axes[1].texts}
    assert {"1/3", "2/3", "1", "4/3", "5/3", "2"} == names
    assert fraction(0.5, 4) == "1/2"
    assert fraction(1.0 / 9, 9) == "0.11"


def test_longer_periods_than_the_history(motions_file: Path) -> None:
    column = int(np.argmax(recorded(motions_file, "rigid_motion") == 109))
    options = Options(speed=float(SPEED[column]), rigid=True)
    motion = read_motion(open_result(motions_file), options, SPEED[column])
    assert motion.loops()[0].size == motion.value.size
    assert motion.section_points()[0].size == 9


def test_logarithmic_spectrum(motions_file: Path) -> None:
    (drawing,) = FIGURES["point"].draw(open_result(motions_file), Options(speed=5100, log=True))
    axes = drawing.figure.axes[1]
    assert axes.get_yscale() == "log"
    (lines,) = [c for c in axes.collections if isinstance(c, LineCollection)]
    assert (np.array(lines.get_segments())[:, 0, 1] > 0).all()


def test_variants_are_named_after_their_file(motions_file: Path, tmp_path: Path) -> None:
    path = tmp_path / "figure6-coarse.h5"
    path.write_bytes(motions_file.read_bytes())
    with h5py.File(path, "r+") as file:
        file.attrs["title"] = np.bytes_("twelve steps")
    (drawing,) = FIGURES["6"].draw(open_result(path), Options(speed=5100))
    assert drawing.name == "figure6-coarse"
    assert "twelve steps" in drawing.figure.texts[0].get_text()
    (other,) = FIGURES["8"].draw(open_result(path), Options())
    assert other.name == "figure8"


def test_a_point_has_to_be_chosen(motions_file: Path) -> None:
    result = open_result(motions_file)
    with pytest.raises(ResultError, match="choose by --speed"):
        FIGURES["point"].draw(result, Options())
    (drawing,) = FIGURES["point"].draw(result.isel(speed=slice(None)), Options(speed=5080))
    assert drawing.name == "point_5100_y1"


def test_commands(motions_file: Path, tmp_path: Path) -> None:
    out, path = str(tmp_path), str(motions_file)
    assert main(["3", path, "--output", out]) == 0
    assert main(["waterfall", path, "--output", out, "--quantity", "x2"]) == 0
    assert main(["bifurcation", path, "--output", out]) == 0
    assert main(["point", path, "--output", out, "--speed", "4800", "--rigid", "--log"]) == 0
    assert {file.name for file in tmp_path.glob("*.pdf")} == {
        *("figure3.pdf", "figure3_map.pdf", "waterfall_x2.pdf", "waterfall_x2_map.pdf"),
        *("bifurcation.pdf", "point_4800_y1_rigid.pdf"),
    }
    assert all(file.stat().st_size < 1e6 for file in tmp_path.glob("*.pdf"))


@pytest.mark.parametrize("name", ["3", "5", "waterfall", "bifurcation"])
def test_files_without_recordings(
    curve_file: Path, tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([name, str(curve_file), "--output", str(tmp_path / "out")]) == 2
    assert "among the products" in capsys.readouterr().err
