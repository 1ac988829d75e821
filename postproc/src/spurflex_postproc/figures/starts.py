"""Which steady motion each start leads to, in the band where several coexist."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from spurflex_postproc import style
from spurflex_postproc.decks import start_of
from spurflex_postproc.features import attractors, coexistence
from spurflex_postproc.figures.common import (
    AMPLITUDE_LABEL,
    SPEED_LABEL,
    Drawing,
    Options,
    legend_below,
    nearest_row,
    require_values,
)
from spurflex_postproc.figures.motion_strip import (
    CLASSES,
    draw_motion,
    motion_class,
    published_motion,
)
from spurflex_postproc.layout import SPEED, STIFFNESS, ResultError

NEEDS = (
    *("y1_amplitude", "status", "motion"),
    *("rigid_y1_amplitude", "rigid_status", "rigid_motion"),
)

ORDER = ("up", "down", "static", "rest")
BAND = (4500.0, 5750.0)
"""Speeds that are drawn [rev/min]."""
LOOKS = {
    "up": (style.BLUE, "^", 3.4),
    "down": (style.VERMILION, "v", 3.4),
    "static": (style.GREEN, "s", 2.4),
    "rest": (style.BLACK, "o", 1.6),
}
"""Colour, marker and size [points] by start."""

Reals = NDArray[np.float64]


def draw(results: Sequence[xr.Dataset], options: Options) -> list[Drawing]:
    """Draw amplitude and motion of each start, side by side for both supports.

    Args:
        results: Datasets from `open_result` on one grid, one for each start.
        options: Choice of the support stiffness.

    Returns:
        One drawing, with a list of the ranges in which motions coexist.

    Raises:
        ResultError: If two files have one start or different speeds, or no point lies in the
            band.
    """
    by_start = _by_start(results)
    speed = np.asarray(results[0][SPEED].values, dtype=float)
    inside = (speed >= BAND[0]) & (speed <= BAND[1])
    if inside.sum() < 2:
        raise ResultError(
            f"{results[0].attrs['path']}: holds fewer than two speeds from {BAND[0]:.0f} to"
            f" {BAND[1]:.0f} rev/min"
        )
    figure = Figure(figsize=style.size(style.DOUBLE, 112), layout="constrained")
    grid = figure.subplots(2, 2, sharex="col", sharey="row", height_ratios=[1.5, 1.0])
    reports = []
    for column, support in enumerate(("rigid", "flexible")):
        amplitude, motion = {}, {}
        for start, result in by_start.items():
            heights, flags = _curve(result, support, options.stiffness)
            require_values(result, f"{support} amplitude", heights)
            amplitude[start], motion[start] = heights[inside], flags[inside]
        upper, lower = grid[0, column], grid[1, column]
        _amplitudes(upper, speed[inside], amplitude)
        upper.set_title(f"{'ab'[column]}  {support} support", loc="left", fontweight="bold")
        rows = {
            "published": published_motion(support, speed[inside]),
            **{f"start '{start}'": flags for start, flags in motion.items()},
        }
        draw_motion(lower, speed[inside], rows)
        legend = lower.get_legend()
        if legend is not None:
            legend.remove()
        lower.tick_params(axis="x", length=2.5, labelbottom=True)
        lower.set_xlabel(SPEED_LABEL)
        reports.append(_report(support, speed[inside], amplitude, motion))
    lower_left = grid[1, 0]
    grid[0, 0].set_ylabel(AMPLITUDE_LABEL)
    grid[0, 0].legend(loc="upper right")
    grid[0, 0].set_ylim(bottom=0)
    lower_left.set_xlim(*BAND)
    grid[1, 1].set_xlim(*BAND)
    _motion_legend(figure, [np.concatenate(list(_flags(by_start, inside, options)))])
    return [Drawing("starts", figure, "\n".join(reports))]


def _by_start(results: Sequence[xr.Dataset]) -> dict[str, xr.Dataset]:
    """Sort the results by their start."""
    found: dict[str, xr.Dataset] = {}
    for result in results:
        path = result.attrs["path"]
        start = start_of(path)
        if start in found:
            raise ResultError(f"{path}: a second file with start '{start}'")
        if not np.array_equal(result[SPEED].values, results[0][SPEED].values):
            raise ResultError(f"{path}: has other speeds than {results[0].attrs['path']}")
        found[start] = result
    known = [start for start in ORDER if start in found]
    return {start: found[start] for start in [*known, *(set(found) - set(known))]}


def _curve(result: xr.Dataset, support: str, stiffness: float) -> tuple[Reals, NDArray[np.int64]]:
    """Take amplitude [um] and motion of one support, shape (n,)."""
    if support == "rigid":
        data, prefix = result, "rigid_"
    else:
        data, prefix = result.isel({STIFFNESS: nearest_row(result, stiffness)}), ""
    heights = style.MICROMETRE * np.asarray(data[f"{prefix}y1_amplitude"].values, dtype=float)
    return heights, data[f"{prefix}motion"].values


def _amplitudes(axes: Axes, speed: Reals, amplitude: dict[str, Reals]) -> None:
    """Draw a marker for every point, larger ones below smaller ones."""
    for start, heights in amplitude.items():
        colour, marker, size = LOOKS.get(start, (style.GREY, "x", 2.0))
        axes.plot(
            speed,
            heights,
            marker,
            ms=size,
            mew=0.5,
            mec=colour,
            mfc="none" if start in ("up", "down") else colour,
            label=f"start '{start}'",
            gid=start,
        )
    axes.minorticks_on()
    axes.tick_params(labelbottom=True)


def _flags(
    by_start: dict[str, xr.Dataset], inside: NDArray[np.bool_], options: Options
) -> list[NDArray[np.int64]]:
    """Return all motion flags that are drawn, the published ones as well."""
    speed = next(iter(by_start.values()))[SPEED].values[inside]
    found = [published_motion(support, speed) for support in ("rigid", "flexible")]
    for result in by_start.values():
        found += [
            _curve(result, support, options.stiffness)[1][inside]
            for support in ("rigid", "flexible")
        ]
    return found


def _motion_legend(figure: Figure, flags: Sequence[NDArray[np.int64]]) -> None:
    """Add one legend of the classes that occur in either panel."""
    seen = np.unique(motion_class(np.concatenate(list(flags))))
    handles = [
        Patch(facecolor=CLASSES[at][1], edgecolor=style.GREY, linewidth=0.3, label=CLASSES[at][0])
        for at in seen
    ]
    legend_below(figure, handles, "motion (T: mesh period)")


def _report(
    support: str,
    speed: Reals,
    amplitude: dict[str, Reals],
    motion: dict[str, NDArray[np.int64]],
) -> str:
    """List the ranges in which the starts lead to different motions."""
    ranges = coexistence(speed, attractors(amplitude, motion))
    lines = [f"{support} support, coexisting motions from {BAND[0]:.0f} to {BAND[1]:.0f} rev/min"]
    lines += [
        f"  {one.first:>5.0f} to {one.last:<5.0f}  {', '.join(one.motions)}"
        f" ({one.most} at most at one speed)"
        for one in ranges
    ]
    return "\n".join(lines) if ranges else lines[0] + ": none seen"
