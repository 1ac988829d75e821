"""Figure 2: amplitude-frequency curves of the driving gear."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import offset_copy
from numpy.typing import NDArray

from spurflex_postproc import style
from spurflex_postproc.features import (
    Branches,
    Peak,
    compare,
    comparison_table,
    find_branches,
    find_peaks,
)
from spurflex_postproc.figures.common import (
    AMPLITUDE_LABEL,
    SPEED_LABEL,
    Drawing,
    Options,
    add_mesh_axis,
    nearest_row,
    require_values,
)
from spurflex_postproc.figures.motion_strip import draw_motion
from spurflex_postproc.flags import Motion, Status, is_regular
from spurflex_postproc.layout import SPEED, STIFFNESS
from spurflex_postproc.published import PublishedCurve, published_curve

NEEDS = (
    "y1_amplitude",
    "status",
    "motion",
    "rigid_y1_amplitude",
    "rigid_status",
    "rigid_motion",
)

ABOVE, ABOVE_MESH_AXIS = 2.0, 27.0
"""Distance of the legend from the curves, without and with a second axis [points]."""

JUMPS_WITHIN = 0.03
"""Largest distance of a computed jump from its published partner, as a fraction."""

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """One curve of the figure.

    Attributes:
        support: 'rigid' or 'flexible'.
        label: For the legend.
        colour: Of the line.
        speed: Rotating speeds [rev/min], shape (n,).
        amplitude: Amplitudes [um], NaN where there is none, shape (n,).
        status: Status flags, shape (n,).
        motion: Motion flags, shape (n,).
        branches: Smooth branches and jumps.
        peaks: Peaks of the smooth branches.
        published: What the literature reports.
    """

    support: str
    label: str
    colour: str
    speed: Reals
    amplitude: Reals
    status: NDArray[np.int64]
    motion: NDArray[np.int64]
    branches: Branches
    peaks: list[Peak]
    published: PublishedCurve


def draw(result: xr.Dataset, options: Options) -> list[Drawing]:
    """Draw both curves in one axes, with strips of motion classes and of features below.

    Args:
        result: A dataset from `open_result` with the variables `NEEDS`.
        options: Choice of the support stiffness and of the second axis.

    Returns:
        One drawing, with a table of published against computed features.

    Raises:
        ResultError: If no point has been computed, or the mesh frequency is unknown.
    """
    row = nearest_row(result, options.stiffness)
    stiffness = float(result[STIFFNESS].values[row])
    curves = [
        _curve(result, "rigid", "rigid support", None),
        _curve(
            result,
            "flexible",
            rf"flexible support, $k_\mathrm{{M}}$ = {style.power_of_ten(stiffness)} N/m",
            row,
        ),
    ]
    figure = Figure(figsize=style.size(style.DOUBLE, 108), layout="constrained")
    axes, classes, strip = figure.subplots(
        3, 1, sharex=True, gridspec_kw={"height_ratios": [5, 0.4, 1]}
    )
    for curve in curves:
        _draw_curve(axes, curve)
    _dress(figure, axes, curves, above=ABOVE_MESH_AXIS if options.mesh_axis else ABOVE)
    draw_motion(
        classes, curves[0].speed, {f"{curve.support}, motion": curve.motion for curve in curves}
    )
    _draw_strip(strip, curves)
    if options.mesh_axis:
        add_mesh_axis(axes, result)
    tables = [_table(curve) for curve in curves]
    head = f"flexible support drawn at {stiffness:.3g} N/m"
    if abs(stiffness / options.stiffness - 1) > 0.01:
        head += f", the nearest in the file to {options.stiffness:.3g} N/m"
    return [Drawing("figure2", figure, "\n".join([head, *tables]))]


def _curve(result: xr.Dataset, support: str, label: str, row: int | None) -> Curve:
    """Take one curve out of the file and find its features."""
    prefix = "" if support == "flexible" else "rigid_"
    data = result if row is None else result.isel({STIFFNESS: row})
    speed = np.asarray(data[SPEED].values, dtype=float)
    amplitude = style.MICROMETRE * np.asarray(data[f"{prefix}y1_amplitude"].values, dtype=float)
    status, motion = data[f"{prefix}status"].values, data[f"{prefix}motion"].values
    require_values(result, f"{prefix}y1_amplitude", amplitude)
    branches = find_branches(speed, amplitude, is_regular(status, motion))
    return Curve(
        support=support,
        label=label,
        colour=style.FLEXIBLE if support == "flexible" else style.RIGID,
        speed=speed,
        amplitude=amplitude,
        status=status,
        motion=motion,
        branches=branches,
        peaks=find_peaks(speed, amplitude, branches=branches),
        published=published_curve(support),
    )


def _draw_curve(axes: Axes, curve: Curve) -> None:
    """Draw a line where the motion is periodic, markers where it is not or did not settle."""
    unsettled = curve.status == Status.NOT_SETTLED
    irregular = np.isin(curve.motion, (Motion.QUASI_PERIODIC, Motion.CHAOTIC)) & ~unsettled
    line = np.where(unsettled | irregular, np.nan, curve.amplitude)
    at = [int(np.searchsorted(curve.speed, jump.last)) for jump in curve.branches.jumps]
    axes.plot(
        np.insert(curve.speed, at, [jump.speed for jump in curve.branches.jumps]),
        np.insert(line, at, np.nan),
        color=curve.colour,
        label=curve.label,
        gid=f"{curve.support} line",
    )
    for jump in curve.branches.jumps:
        if jump.kind == "branch":
            ends = [jump.first, jump.last], [jump.before, jump.after]
            axes.plot(*ends, color=curve.colour, lw=0.4, ls=(0, (2, 2)), gid="jump")
    for name, mask, face in (
        ("irregular", irregular, curve.colour),
        ("not settled", unsettled, "none"),
    ):
        axes.plot(
            curve.speed[mask],
            curve.amplitude[mask],
            ls="none",
            marker="o",
            ms=1.8,
            mew=0.4,
            mec=curve.colour,
            mfc=face,
            gid=f"{curve.support} {name}",
        )


def _dress(figure: Figure, axes: Axes, curves: list[Curve], *, above: float) -> None:
    """Add labels, limits and, above the axes where no curve can be, the legend."""
    axes.set_ylabel(AMPLITUDE_LABEL)
    axes.set_xlim(curves[0].speed[0], curves[0].speed[-1])
    axes.set_ylim(bottom=0)
    axes.minorticks_on()
    for name, face in (("irregular", style.GREY), ("not settled", "none")):
        lines = {line.get_gid(): line for line in axes.lines}
        if any(np.size(lines[f"{curve.support} {name}"].get_xdata()) for curve in curves):
            label = "quasi-periodic or chaotic" if name == "irregular" else "not settled"
            axes.plot([], [], "o", ms=1.8, mew=0.4, mec=style.GREY, mfc=face, label=label)
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        bbox_transform=offset_copy(axes.transAxes, figure, y=above, units="points"),
        ncol=4,
        borderaxespad=0.2,
        borderpad=0,
    )


def _draw_strip(strip: Axes, curves: list[Curve]) -> None:
    """Draw the speeds of peaks and jumps as marks: published above, computed below."""
    names: list[str] = []
    for curve in curves:
        found = [peak.speed for peak in curve.peaks], [jump.speed for jump in curve.branches.jumps]
        told = curve.published.peaks, curve.published.jumps
        for source, (peaks, jumps), colour in (
            ("published", told, style.GREY),
            ("computed", found, curve.colour),
        ):
            level = -len(names)
            names.append(f"{curve.support}, {source}")
            shared: dict[str, Any] = {
                "ls": "none",
                "color": colour,
                "gid": names[-1],
                "clip_on": False,
            }
            strip.plot(peaks, np.full(len(peaks), level), marker="^", ms=3, mew=0, **shared)
            strip.plot(jumps, np.full(len(jumps), level), marker="|", ms=5, mew=0.9, **shared)
    strip.set_yticks(-np.arange(len(names)), names)
    strip.set_ylim(0.3 - len(names), 0.55)
    strip.tick_params(axis="y", length=0)
    strip.spines[["top", "right", "left"]].set_visible(False)
    strip.set_xlabel(SPEED_LABEL)
    strip.plot([], [], "^", ms=3, mew=0, color=style.GREY, label="peak")
    strip.plot([], [], "|", ms=5, mew=0.9, color=style.GREY, label="jump")
    strip.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncol=2,
        borderaxespad=0.2,
        borderpad=0,
        handlelength=1.2,
    )


def _table(curve: Curve) -> str:
    """Set the published features of one curve against the computed ones."""
    peaks = compare(curve.published.peaks, [peak.speed for peak in curve.peaks])
    jumps = compare(
        curve.published.jumps,
        [jump.speed for jump in curve.branches.jumps],
        within=JUMPS_WITHIN,
    )
    table = comparison_table(f"{curve.support} support", [("peak", peaks), ("jump", jumps)])
    bands = ", ".join(f"{first:.0f} to {last:.0f}" for first, last in curve.branches.bands)
    if bands:
        table += f"\n  no settled periodic motion (no features sought inside): {bands}"
    return table
