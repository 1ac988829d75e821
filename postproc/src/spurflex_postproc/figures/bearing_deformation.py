"""Figure 10: bearing deformation of the driving gear and its change by the flexible support."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure, SubFigure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import AutoMinorLocator, FixedLocator, FuncFormatter, NullLocator
from numpy.typing import NDArray

from spurflex_postproc import style
from spurflex_postproc.features import find_branches, lettered, signed_areas, stiff_border
from spurflex_postproc.features.areas import Area
from spurflex_postproc.figures.common import (
    SPEED_LABEL,
    STIFFNESS_LABEL,
    Drawing,
    Options,
    require_values,
)
from spurflex_postproc.figures.scale import amplitude_norm, edges, label_colours
from spurflex_postproc.flags import is_regular
from spurflex_postproc.layout import SPEED, STIFFNESS, ResultError
from spurflex_postproc.published import published_areas

NEEDS = (
    *("bearing1_deformation_max", "eta1", "status", "motion"),
    *("rigid_bearing1_deformation_max", "rigid_status", "rigid_motion"),
)

DEFORMATION_LABEL = "bearing deformation, gear 1 (µm)"
ETA_LABEL = r"$\eta_1$ (%)"
DIVERGING = "RdBu_r"
"""Colour map of eta: red above, blue below zero, told apart with any colour vision."""
LINEAR = 1.0
"""Magnitude of eta up to which its colours are linear [percent]."""
LARGEST = 100.0
"""Magnitude of eta at which its colours end [percent]."""
NEAR_ZERO = 1.0
"""Magnitude of eta that counts as near zero in area A [percent]."""
OUTLINE = withStroke(linewidth=2.0, foreground="white")

Reals = NDArray[np.float64]


def draw(result: xr.Dataset, options: Options) -> list[Drawing]:
    """Draw the rigid curve, the map of the deformation, and the map of eta with its areas.

    Args:
        result: A dataset from `open_result` with the variables `NEEDS`, at least two speeds
            and two support stiffnesses.
        options: Not used.

    Returns:
        One drawing, with a table of the areas.

    Raises:
        ResultError: If the grid is a line or no point has been computed.
    """
    speed, stiffness = result[SPEED].values, result[STIFFNESS].values
    if min(len(speed), len(stiffness)) < 2:
        raise ResultError(
            f"{result.attrs['path']}: a map needs at least 2 x 2 points,"
            f" there are {len(stiffness)} stiffnesses x {len(speed)} speeds"
        )
    deformation = style.MICROMETRE * result["bearing1_deformation_max"].values
    rigid = style.MICROMETRE * result["rigid_bearing1_deformation_max"].values
    eta = result["eta1"].values
    require_values(result, "bearing1_deformation_max", deformation)
    require_values(result, "eta1", eta)
    regular = is_regular(result["rigid_status"].values, result["rigid_motion"].values)
    signs, _ = published_areas()
    areas = lettered(signed_areas(stiffness, speed, eta), signs)
    border = stiff_border(stiffness, eta, near_zero=NEAR_ZERO)

    figure = Figure(figsize=style.size(style.DOUBLE, 150), layout="constrained")
    halves: Any = figure.subfigures(2, 1, height_ratios=[0.8, 1.0])
    upper, lower = halves
    left, right = upper.subplots(1, 2)
    _curve(left, speed, rigid, regular)
    _deformation(upper, right, speed, stiffness, deformation)
    _eta(lower, lower.subplots(), speed, stiffness, eta, areas, border)
    return [Drawing("figure10", figure, _table(areas, border))]


def _curve(axes: Axes, speed: Reals, rigid: Reals, regular: NDArray[np.bool_]) -> None:
    """Draw the curve of the rigid support, open at jumps, with markers where irregular."""
    branches = find_branches(speed, rigid, regular)
    line = np.where(regular, rigid, np.nan)
    at = [int(np.searchsorted(speed, jump.last)) for jump in branches.jumps]
    axes.plot(
        np.insert(speed, at, [jump.speed for jump in branches.jumps]),
        np.insert(line, at, np.nan),
        color=style.RIGID,
        gid="rigid line",
    )
    axes.plot(
        speed[~regular],
        rigid[~regular],
        "o",
        ms=1.8,
        mew=0,
        color=style.RIGID,
        gid="rigid irregular",
        label="quasi-periodic or chaotic",
    )
    if not regular.all():
        axes.legend(loc="lower right")
    axes.set_xlim(speed[0], speed[-1])
    axes.set_ylim(bottom=0)
    axes.minorticks_on()
    axes.set_xlabel(SPEED_LABEL)
    axes.set_ylabel(DEFORMATION_LABEL)
    axes.set_title("a  rigid support", loc="left", fontweight="bold")


def _deformation(
    figure: SubFigure, axes: Axes, speed: Reals, stiffness: Reals, deformation: Reals
) -> None:
    """Draw the map of the deformation."""
    mesh = axes.pcolormesh(
        edges(speed),
        edges(stiffness, logarithmic=True),
        np.ma.masked_invalid(deformation),
        norm=amplitude_norm(deformation),
        cmap=style.SEQUENTIAL,
        rasterized=True,
        gid="deformation",
    )
    bar = figure.colorbar(mesh, ax=axes, extend="both", extendfrac=0.02, pad=0.02)
    label_colours(bar)
    bar.set_label(DEFORMATION_LABEL)
    _dress(axes)
    axes.set_title("b  flexible support", loc="left", fontweight="bold")


def _eta(
    figure: SubFigure,
    axes: Axes,
    speed: Reals,
    stiffness: Reals,
    eta: Reals,
    areas: dict[str, Area],
    border: float,
) -> None:
    """Draw the map of eta with the borders and letters of its areas."""
    mesh = axes.pcolormesh(
        edges(speed),
        edges(stiffness, logarithmic=True),
        np.ma.masked_invalid(eta),
        norm=SymLogNorm(LINEAR, vmin=-LARGEST, vmax=LARGEST),
        cmap=DIVERGING,
        rasterized=True,
        gid="eta",
    )
    bar = figure.colorbar(mesh, ax=axes, pad=0.01, aspect=30, extend="both", extendfrac=0.02)
    bar.set_label(ETA_LABEL)
    bar.ax.yaxis.set_major_locator(FixedLocator([-100, -10, -1, 0, 1, 10, 100]))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.yaxis.set_major_formatter(
        FuncFormatter(lambda value, _: f"{value:+g}" if value else "0")
    )
    for letter, area in areas.items():
        inside = np.zeros(eta.shape)
        inside[area.cells[0], area.cells[1]] = 1.0
        axes.contour(speed, stiffness, inside, levels=[0.5], colors=style.BLACK, linewidths=0.5)
        _letter(axes, letter, *_place(area, speed, stiffness))
    if np.isfinite(border):
        axes.axhline(border, color=style.BLACK, lw=0.5, ls=(0, (4, 3)), gid="A")
        _letter(axes, "A", 3000.0, float(np.sqrt(border * stiffness[-1])))
    _dress(axes)
    axes.set_title(
        "c  change by the flexible support, areas lettered as published",
        loc="left",
        fontweight="bold",
    )


def _letter(axes: Axes, letter: str, speed: float, stiffness: float) -> None:
    """Write the letter of an area."""
    axes.text(
        speed,
        stiffness,
        letter,
        ha="center",
        va="center",
        fontsize=9,
        fontweight="bold",
        path_effects=[OUTLINE],
        gid=f"area {letter}",
    )


def _place(area: Area, speed: Reals, stiffness: Reals) -> tuple[float, float]:
    """Choose a place for a letter: the cell with most room to its sides, above and below.

    Room is the product of the distances to the nearest border of the area along both axes.
    """
    inside = np.zeros((len(stiffness), len(speed)), dtype=bool)
    inside[area.cells[0], area.cells[1]] = True
    room = np.ones(inside.shape)
    for axis in (0, 1):
        behind = np.flip(_run(np.flip(inside, axis), axis), axis)
        room *= np.minimum(_run(inside, axis), behind)
    row, column = np.unravel_index(int(np.argmax(room)), room.shape)
    return float(speed[column]), float(stiffness[row])


def _run(inside: NDArray[np.bool_], axis: int) -> NDArray[np.int64]:
    """Count the cells inside without a gap up to each cell along an axis."""
    count = np.zeros(inside.shape, dtype=np.int64)
    length = np.zeros(inside.shape[1 - axis], dtype=np.int64)
    for at in range(inside.shape[axis]):
        where = (at, slice(None)) if axis == 0 else (slice(None), at)
        length = np.where(inside[where], length + 1, 0)
        count[where] = length
    return count


def _dress(axes: Axes) -> None:
    """Add scales and labels of a map."""
    axes.set_yscale("log")
    axes.set_facecolor(style.PALE)
    axes.set_xlabel(SPEED_LABEL)
    axes.set_ylabel(STIFFNESS_LABEL)
    axes.xaxis.set_minor_locator(AutoMinorLocator())
    axes.yaxis.set_minor_locator(NullLocator())


def _table(areas: dict[str, Area], border: float) -> str:
    """List the areas."""
    lines = ["areas of eta", "  area  sign    around  share of map      mean   extreme"]
    if np.isfinite(border):
        lines.append(
            f"  A        0  within {NEAR_ZERO:g} % at 95 % of the speeds from {border:.1e} N/m"
        )
    lines += [
        f"  {letter}        {'+' if area.sign > 0 else '-'}  {area.speed:>8.0f}"
        f"  {100 * area.share:>10.1f} %  {area.mean:>+6.1f} %  {area.extreme:>+6.0f} %"
        for letter, area in areas.items()
    ]
    return "\n".join(lines)
