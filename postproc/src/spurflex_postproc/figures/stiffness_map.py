"""Figure 9: amplitude of the driving gear over rotating speed and support stiffness."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import AutoMinorLocator, NullLocator
from numpy.typing import NDArray

from spurflex_postproc import style
from spurflex_postproc.features import CrestLine, crest_line
from spurflex_postproc.figures.common import (
    SPEED_LABEL,
    STIFFNESS_LABEL,
    Drawing,
    Options,
    require_values,
)
from spurflex_postproc.figures.scale import amplitude_norm, edges, label_colours
from spurflex_postproc.figures.stiffness_surface import draw_surface
from spurflex_postproc.figures.stiffness_table import map_table
from spurflex_postproc.flags import Status, is_regular
from spurflex_postproc.layout import SPEED, STIFFNESS, ResultError
from spurflex_postproc.published import PAPER_STIFFNESS, PublishedMap, published_map

NEEDS = ("y1_amplitude", "status", "motion")

Reals = NDArray[np.float64]

SIZE = (style.DOUBLE, 108.0)
"""Width and height of the map figure [mm]."""
DOTS = (0.2, 0.45)
"""Smallest and largest dot on a point that did not settle [points]."""
LIGHT = 0.45
"""Place in the colour map from which dots are black instead of white."""
MAP = (0.075, 0.155, 0.825, 0.795)
BAR = (0.915, 0.155, 0.013, 0.795)
LEGEND = 0.06
"""Places of the map and of its colour bar: left, bottom, width, height in the figure; top of
the legend."""
MARK = 0.07
"""Length of the mark of a published crest, as a fraction of the height of the map."""
OUTLINE = withStroke(linewidth=1.4, foreground="white", alpha=0.7)
"""Keeps thin dark marks readable on dark colours."""


def draw(result: xr.Dataset, options: Options) -> list[Drawing]:
    """Draw the map and the surface.

    Args:
        result: A dataset from `open_result` with the variables `NEEDS`, at least two speeds
            and two support stiffnesses.
        options: Not used.

    Returns:
        The map with a table of crests, and the surface.

    Raises:
        ResultError: If the grid is a line or no point has been computed.
    """
    speed, stiffness = result[SPEED].values, result[STIFFNESS].values
    if min(len(speed), len(stiffness)) < 2:
        raise ResultError(
            f"{result.attrs['path']}: a map needs at least 2 x 2 points,"
            f" there are {len(stiffness)} stiffnesses x {len(speed)} speeds"
        )
    amplitude = style.MICROMETRE * result["y1_amplitude"].values
    require_values(result, "y1_amplitude", amplitude)
    status = result["status"].values
    regular = is_regular(status, result["motion"].values)
    told = published_map()
    crest = crest_line(
        stiffness,
        speed,
        amplitude,
        regular,
        start=(PAPER_STIFFNESS, told.crest),
        highest=told.flat[0],
    )
    report = map_table(stiffness, speed, amplitude, regular, crest, told)
    return [
        Drawing("figure9_map", _map(speed, stiffness, amplitude, status, crest, told), report),
        Drawing("figure9_surface", draw_surface(speed, stiffness, amplitude, crest)),
    ]


def _map(
    speed: Reals,
    stiffness: Reals,
    amplitude: Reals,
    status: NDArray[np.int64],
    crest: CrestLine,
    told: PublishedMap,
) -> Figure:
    """Draw the map; amplitude in micrometres, shape (stiffness, speed)."""
    figure = Figure(figsize=style.size(*SIZE))
    axes = figure.add_axes(MAP)
    axes.set_yscale("log")
    axes.set_facecolor(style.PALE)
    norm = amplitude_norm(amplitude)
    mesh = axes.pcolormesh(
        edges(speed),
        edges(stiffness, logarithmic=True),
        np.ma.masked_invalid(amplitude),
        norm=norm,
        cmap=style.SEQUENTIAL,
        rasterized=True,
        gid="amplitude",
    )
    bar = figure.colorbar(mesh, cax=figure.add_axes(BAR), extend="both", extendfrac=0.02)
    label_colours(bar)
    notes = _overlay(axes, speed, stiffness, amplitude, status, norm)
    notes += _annotate(axes, crest, told)
    axes.set_xlabel(SPEED_LABEL)
    axes.set_ylabel(STIFFNESS_LABEL)
    axes.xaxis.set_minor_locator(AutoMinorLocator())
    axes.yaxis.set_minor_locator(NullLocator())
    figure.legend(
        handles=notes,
        loc="upper left",
        bbox_to_anchor=(MAP[0], LEGEND),
        ncol=4 if len(notes) <= 4 else 3,
        borderpad=0,
        borderaxespad=0,
    )
    return figure


def _overlay(
    axes: Axes,
    speed: Reals,
    stiffness: Reals,
    amplitude: Reals,
    status: NDArray[np.int64],
    norm: Normalize,
) -> list[Artist]:
    """Dot the points that did not settle; return the legend's entries on doubtful points."""
    notes: list[Artist] = []
    shared: dict[str, Any] = {"ls": "none", "marker": "o", "mew": 0}
    unsettled = status == Status.NOT_SETTLED
    light = norm(np.nan_to_num(amplitude, nan=1.0)) > LIGHT
    for mask, colour in ((unsettled & light, "black"), (unsettled & ~light, "white")):
        rows, columns = np.nonzero(mask)
        if rows.size:
            axes.plot(
                speed[columns],
                stiffness[rows],
                color=colour,
                ms=_dot(status.shape),
                rasterized=True,
                gid="not settled",
                **shared,
            )
    if unsettled.any():
        label = "not settled (black or white dots)"
        notes.append(Line2D([], [], ms=1.2, color="black", label=label, **shared))
    if not np.isfinite(amplitude).all():
        notes.append(Patch(facecolor=style.PALE, label="no value (missing or diverged)"))
    return notes


def _dot(shape: tuple[int, ...]) -> float:
    """Return a size of dots [points] that leaves the cells of a grid visible."""
    cells = MAP[2] * SIZE[0] / shape[1], MAP[3] * SIZE[1] / shape[0]
    return float(np.clip(0.3 * 72 * style.MILLIMETRE * min(cells), *DOTS))


def _annotate(axes: Axes, crest: CrestLine, told: PublishedMap) -> list[Artist]:
    """Mark the published crests and ranges and the computed crest line; return the legend."""
    notes: list[Artist] = []
    if np.isfinite(crest.speed).any():
        notes += axes.plot(
            crest.speed,
            crest.stiffness,
            color=style.BLACK,
            lw=0.6,
            ls=(0, (4, 3)),
            path_effects=[OUTLINE],
            label="soft-support crest, computed",
            gid="crest",
        )
    low, high = axes.get_ylim()
    for speeds, ends in ((told.crests_below, (0.0, MARK)), (told.crests_above, (1.0 - MARK, 1.0))):
        for speed in speeds:
            axes.axvline(speed, *ends, color=style.BLACK, lw=0.8, path_effects=[OUTLINE])
            _write(axes, speed, ends[0], f"{speed:.0f}")
    ring: dict[str, Any] = {
        "ls": "none",
        "marker": "o",
        "ms": 4.0,
        "mew": 0.8,
        "mfc": "none",
        "mec": "black",
    }
    axes.plot([told.crest], [PAPER_STIFFNESS], path_effects=[OUTLINE], **ring)
    axes.set_ylim(low, high)
    _name_ranges(axes, told)
    notes.append(Line2D([], [], label="soft-support crest, published", **ring))
    shared: dict[str, Any] = {
        "ls": "none",
        "marker": "|",
        "ms": 6,
        "mew": 0.8,
        "color": style.BLACK,
    }
    notes.append(Line2D([], [], label="other crests, published", **shared))
    return notes


def _name_ranges(axes: Axes, told: PublishedMap) -> None:
    """Name the published ranges of speed above the map and part them by thin lines."""
    first, last = axes.get_xlim()
    for border in {*told.flat, told.irregular_above}:
        if first < border < last:
            axes.axvline(border, color="white", lw=0.5)
    ranges = (
        (first, told.flat[0], "effect of the stiffness, as published: evident"),
        (*told.flat, "little"),
        (told.irregular_above, last, "irregular"),
    )
    for low, high, name in ranges:
        low, high = max(low, first), min(high, last)
        if high > low:
            axes.annotate(
                name,
                ((low + high) / 2, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0, 3),
                textcoords="offset points",
                ha="center",
                fontsize=6,
                color=style.GREY,
            )


def _write(axes: Axes, speed: float, height: float, text: str) -> None:
    """Write a published speed beside its mark; height in fractions of the axes."""
    axes.annotate(
        text,
        (speed, height + MARK / 2),
        xycoords=("data", "axes fraction"),
        xytext=(2.5, 0),
        textcoords="offset points",
        va="center",
        fontsize=5.5,
        path_effects=[OUTLINE],
    )
