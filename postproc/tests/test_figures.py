"""Figures: what is drawn is what the file holds."""

from io import BytesIO
from pathlib import Path

import h5py
import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm, PowerNorm
from matplotlib.figure import Figure

from spurflex_postproc import ResultError, open_result
from spurflex_postproc.figures import FIGURES, Options
from spurflex_postproc.figures.motion_strip import CLASSES, motion_class
from spurflex_postproc.figures.scale import amplitude_norm, edges

BAND = (4650.0, 4990.0)


def line(figure: Figure, gid: str) -> tuple[np.ndarray, np.ndarray]:
    """Points of the line with an id in the first axes, without gaps."""
    (found,) = [line for line in figure.axes[0].lines if line.get_gid() == gid]
    x, y = np.asarray(found.get_xdata()), np.asarray(found.get_ydata())
    return x[np.isfinite(y)], y[np.isfinite(y)]


@pytest.mark.parametrize(
    ("support", "name"), [("rigid", "rigid_y1_amplitude"), ("flexible", "y1_amplitude")]
)
def test_curves_hold_the_data(curve_file: Path, support: str, name: str) -> None:
    with h5py.File(curve_file) as file:
        speed, amplitude = file["speed"][:], 1e6 * np.ravel(file[name][:])
    (drawing,) = FIGURES["2"].draw(open_result(curve_file), Options())
    inside = (speed >= BAND[0]) & (speed <= BAND[1])
    for gid, mask in ((f"{support} line", ~inside), (f"{support} not settled", inside)):
        x, y = line(drawing.figure, gid)
        np.testing.assert_array_equal(x, speed[mask])
        np.testing.assert_allclose(y, amplitude[mask], rtol=1e-14)


def test_curve_is_interrupted_at_a_jump(curve_file: Path) -> None:
    (drawing,) = FIGURES["2"].draw(open_result(curve_file), Options())
    (curve,) = [c for c in drawing.figure.axes[0].lines if c.get_gid() == "rigid line"]
    x, y = np.asarray(curve.get_xdata()), np.asarray(curve.get_ydata())
    assert np.isnan(y[x == 3145.0]).all()


def test_published_marks(curve_file: Path) -> None:
    (drawing,) = FIGURES["2"].draw(open_result(curve_file), Options())
    marks = [
        np.asarray(mark.get_xdata()).tolist()
        for mark in drawing.figure.axes[2].lines
        if mark.get_gid() == "flexible, published"
    ]
    assert marks == [[480, 1290, 1900], [4670, 4810, 4880, 5310]]
    assert "1290" in drawing.report


@pytest.mark.parametrize("mesh_axis", [False, True])
def test_legend_is_where_no_curve_can_be(curve_file: Path, mesh_axis: bool) -> None:
    (drawing,) = FIGURES["2"].draw(open_result(curve_file), Options(mesh_axis=mesh_axis))
    drawing.figure.savefig(BytesIO(), format="png")
    axes = drawing.figure.axes[0]
    below = [axes.bbox] + [child.get_tightbbox() for child in axes.child_axes]
    legend = axes.get_legend().get_window_extent()
    assert legend.y0 >= max(box.y1 for box in below)
    assert legend.y1 <= drawing.figure.bbox.y1
    assert legend.x1 <= drawing.figure.bbox.x1


def test_motion_strip_holds_the_classes(curve_file: Path, tmp_path: Path) -> None:
    path = tmp_path / "classes.h5"
    path.write_bytes(curve_file.read_bytes())
    flags = [1, 2, 3, 4, 8, 20, 30, 0]
    with h5py.File(path, "r+") as file:
        file["rigid_motion"][:8] = flags
        file["status"][0, 9] = 3
    (drawing,) = FIGURES["2"].draw(open_result(path), Options())
    axes = drawing.figure.axes[1]
    rows = {item.get_gid(): np.ravel(item.get_array()) for item in axes.collections}
    names = [name for name, _, _ in CLASSES]
    assert [names[at] for at in rows["rigid, motion"][:8]] == [
        *("1T", "2T", "3T", "4T and more", "4T and more", "quasi-periodic", "chaotic", "unresolved")
    ]
    assert names[rows["flexible, motion"][9]] == "no value"
    assert [text.get_text() for text in axes.get_legend().get_texts()][:-1] == names
    np.testing.assert_array_equal(motion_class([-7, 9, 99]), names.index("unresolved"))
    drawing.figure.savefig(BytesIO(), format="png")
    assert axes.get_legend().get_window_extent().x1 <= axes.bbox.x1


def test_motion_legend_names_only_what_occurs(curve_file: Path) -> None:
    (drawing,) = FIGURES["2"].draw(open_result(curve_file), Options())
    legend = drawing.figure.axes[1].get_legend()
    assert [text.get_text() for text in legend.get_texts()][:-1] == ["1T", "chaotic"]


def test_curve_takes_the_nearest_row(map_file: Path) -> None:
    with h5py.File(map_file) as file:
        row = int(np.argmin(np.abs(np.log10(file["support_stiffness"][:]) - 9)))
        low = file["speed"][:] < BAND[0]
        amplitude = 1e6 * file["y1_amplitude"][row, :]
    (drawing,) = FIGURES["2"].draw(open_result(map_file), Options(stiffness=1.02e9))
    _, y = line(drawing.figure, "flexible line")
    np.testing.assert_allclose(y[: low.sum()], amplitude[low], rtol=1e-14)
    assert "nearest" in drawing.report


def test_mesh_axis_needs_teeth(curve_file: Path) -> None:
    result = open_result(curve_file)
    (drawing,) = FIGURES["2"].draw(result, Options(mesh_axis=True))
    assert drawing.figure.axes[0].child_axes[0].get_xlabel() == "mesh frequency (kHz)"
    del result.attrs["teeth_1"]
    with pytest.raises(ResultError, match="teeth_1"):
        FIGURES["2"].draw(result, Options(mesh_axis=True))


def test_map_holds_the_data(map_file: Path) -> None:
    with h5py.File(map_file) as file:
        speed, stiffness = file["speed"][:], file["support_stiffness"][:]
        amplitude, status = 1e6 * file["y1_amplitude"][:], file["status"][:]
    drawing, _ = FIGURES["9"].draw(open_result(map_file), Options())
    axes = drawing.figure.axes[0]
    (mesh,) = [item for item in axes.collections if isinstance(item, QuadMesh)]
    np.testing.assert_allclose(np.ravel(mesh.get_array()), amplitude.ravel(), rtol=1e-14)
    corners = mesh.get_coordinates()
    assert corners.shape == (len(stiffness) + 1, len(speed) + 1, 2)
    assert np.all((corners[0, :-1, 0] < speed) & (speed < corners[0, 1:, 0]))
    assert np.all((corners[:-1, 0, 1] < stiffness) & (stiffness < corners[1:, 0, 1]))
    dots = [item for item in axes.lines if item.get_gid() == "not settled"]
    assert sum(np.size(item.get_xdata()) for item in dots) == np.count_nonzero(status == 2)
    assert mesh.get_rasterized()


def test_surface_holds_the_data(map_file: Path) -> None:
    with h5py.File(map_file) as file:
        amplitude = 1e6 * file["y1_amplitude"][:]
    map_, drawing = FIGURES["9"].draw(open_result(map_file), Options())
    drawing.figure.draw_without_rendering()
    (surface,) = drawing.figure.axes[0].collections
    m, n = amplitude.shape
    corners = [amplitude[i : m - 1 + i, j : n - 1 + j] for i in (0, 1) for j in (0, 1)]
    colours = mpl.colormaps["viridis"](amplitude_norm(amplitude)(sum(corners) / 4)).reshape(-1, 4)
    drawn = np.asarray(surface.get_facecolor())
    assert drawn.shape == colours.shape
    # Sorted, for the perspective draws the farthest cells first.
    np.testing.assert_allclose(np.sort(drawn, axis=0), np.sort(colours, axis=0), atol=1e-12)
    assert surface.get_rasterized()
    assert drawing.figure.axes[0].get_zlim()[1] >= amplitude.max()
    (crest,) = [one for one in drawing.figure.axes[0].lines if one.get_gid() == "crest"]
    (flat,) = [one for one in map_.figure.axes[0].lines if one.get_gid() == "crest"]
    x, y, z = crest.get_data_3d()
    there = np.isfinite(flat.get_xdata())
    np.testing.assert_allclose(x, flat.get_xdata()[there])
    np.testing.assert_allclose(10**y, flat.get_ydata()[there])
    assert np.all((z > 0) & (z < 1.02 * amplitude.max()))


def test_map_report(map_file: Path) -> None:
    drawing, _ = FIGURES["9"].draw(open_result(map_file), Options())
    for speed in (480, 1290, 1900, 1180, 1730):
        (row,) = [row for row in drawing.report.splitlines() if f" {speed} " in row and "%" in row]
        assert abs(float(row.split()[-2])) < 2.5


def test_missing_points_stay_open(map_file: Path, tmp_path: Path) -> None:
    path = tmp_path / "holes.h5"
    path.write_bytes(map_file.read_bytes())
    with h5py.File(path, "r+") as file:
        file["status"][3:5, 10:20] = 0
        file["status"][7, 7] = 3
    drawing, surface = FIGURES["9"].draw(open_result(path), Options())
    (mesh,) = [c for c in drawing.figure.axes[0].collections if isinstance(c, QuadMesh)]
    assert np.ma.getmaskarray(mesh.get_array()).sum() == 21
    surface.figure.draw_without_rendering()
    colours = np.array(surface.figure.axes[0].collections[0].get_facecolor())
    assert np.count_nonzero(colours[:, 3] == 0) == 37


def test_line_of_points_is_no_map(curve_file: Path) -> None:
    with pytest.raises(ResultError, match="at least 2 x 2"):
        FIGURES["9"].draw(open_result(curve_file), Options())


@pytest.mark.parametrize("number", ["2", "9"])
def test_nothing_computed_yet(map_file: Path, tmp_path: Path, number: str) -> None:
    path = tmp_path / "fresh.h5"
    path.write_bytes(map_file.read_bytes())
    with h5py.File(path, "r+") as file:
        file["status"][...] = 0
    with pytest.raises(ResultError, match="no point of 'y1_amplitude' holds a value yet"):
        FIGURES[number].draw(open_result(path), Options())


def test_cell_borders() -> None:
    np.testing.assert_allclose(edges([1, 2, 4]), [0.5, 1.5, 3, 5])
    np.testing.assert_allclose(edges([1, 100], logarithmic=True), [0.1, 10, 1000])


def test_colour_scale() -> None:
    assert isinstance(amplitude_norm(np.geomspace(1, 100, 50)), LogNorm)
    assert isinstance(amplitude_norm(np.linspace(5, 9, 50)), PowerNorm)
    assert isinstance(amplitude_norm(np.zeros(5)), PowerNorm)
