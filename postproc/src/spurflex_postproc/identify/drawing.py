"""Draws the misfit landscape and the deviations of every hypothesis."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from spurflex_postproc import style
from spurflex_postproc.figures.scale import edges
from spurflex_postproc.identify.fit import Fit
from spurflex_postproc.identify.landscape import Landscape, Map

LEVELS = (1.0, 1.5, 2.0, 3.0)
"""Contours of the misfit."""
LARGEST = 4.0
"""Misfit at which the colours end."""
WIDEST = 10.0
"""Deviation at which the axis ends [percent]; larger ones stand there."""
LOOKS = (
    (style.GREY, "x"),
    (style.BLACK, "X"),
    (style.SKY_BLUE, "s"),
    (style.GREEN, "v"),
    (style.ORANGE, "D"),
    (style.BLUE, "o"),
    (style.NAVY, "*"),
    (style.PURPLE, "<"),
    (style.VERMILION, "P"),
    (style.YELLOW, "^"),
    (style.NAVY, "h"),
)
"""Colour and marker of each hypothesis."""
SLICE_PHASE, SLICE_MASS, SLICE_STIFFNESS, SLICE_OFFSET = 8.0, 0.04, 0.02, 0.1
"""Largest distance of a fit from a map on which it is marked: phase [deg]; mesh mass, k_M and l_o
(fractions)."""
OUTLINE = withStroke(linewidth=1.6, foreground="white", alpha=0.8)


def draw(maps: Landscape, fits: Sequence[Fit], best: Fit) -> Figure:
    """Draw four maps of the misfit and the deviations by feature.

    Args:
        maps: The maps around the best fit.
        fits: All hypotheses, fitted.
        best: The fit around which the maps are.

    Returns:
        The figure.
    """
    figure = Figure(figsize=style.size(style.DOUBLE, 190), layout="constrained")
    halves: Any = figure.subfigures(2, 1, height_ratios=[1.5, 1.15])
    upper, lower = halves
    axes = list(upper.subplots(2, 2).flat)
    rigid = "mean mesh force $F$ (N)"
    turning = r"$k_\mathrm{M} l_\mathrm{x}^2$ (MN m)"
    panels: tuple[tuple[Map, str, str, tuple[float, float]], ...] = (
        (maps.mass, rigid, r"mesh mass $m_\mathrm{t}$ (kg)", (1.0, 1.0)),
        (maps.phase, rigid, "phase of the error (deg)", (1.0, 1.0)),
        (maps.support, r"$l_\mathrm{o}$ (mm)", r"$l_\mathrm{x}$ (mm)", (1e3, 1e3)),
        (maps.stiffness, r"$k_\mathrm{M}$ ($10^8$ N/m)", turning, (1e-8, 1e-6)),
    )
    phase = (best.unknowns.error_phase + 180) % 360 - 180
    titles = (
        f"a  rigid, phase {phase:.0f} deg",
        rf"b  rigid, $m_\mathrm{{t}}$ = {best.unknowns.mesh_mass:.2f} kg",
        rf"c  flexible, peaks, $k_\mathrm{{M}}$ = {1e-8 * best.unknowns.support_stiffness:.3g}"
        r"$\times 10^8$ N/m",
        rf"d  flexible, peaks, $l_\mathrm{{o}}$ = {1e3 * best.unknowns.gear_offset:.0f} mm",
    )
    mesh = None
    for panel, (values, x, y, unit), title in zip(axes, panels, titles, strict=True):
        mesh = _map(panel, values, unit)
        panel.set_xlabel(x)
        panel.set_ylabel(y)
        panel.set_title(title, loc="left", fontweight="bold")
    for fit, look in zip(fits, LOOKS, strict=False):
        one = fit.unknowns
        turn = (one.error_phase + 180) % 360 - 180
        if abs(turn - phase) < SLICE_PHASE:
            _mark(axes[0], one.mesh_force, one.mesh_mass, look)
        if abs(one.mesh_mass / best.unknowns.mesh_mass - 1) < SLICE_MASS:
            _mark(axes[1], one.mesh_force, turn, look)
        if abs(one.stiffness_factor / best.unknowns.stiffness_factor - 1) < SLICE_STIFFNESS:
            _mark(axes[2], 1e3 * one.gear_offset, 1e3 * one.support_offset, look)
        if abs(one.gear_offset / best.unknowns.gear_offset - 1) < SLICE_OFFSET:
            _mark(axes[3], 1e-8 * one.support_stiffness, 1e-6 * one.turning_stiffness, look)
    bar = upper.colorbar(mesh, ax=axes, extend="max", pad=0.01, aspect=30)
    bar.set_label("misfit (allowed deviations)")
    _deviations(lower.subplots(), fits)
    return figure


def _map(axes: Axes, values: Map, unit: tuple[float, float]) -> Any:
    """Draw one map with its contours; limits stay those of the map."""
    x, y = unit[0] * values.x, unit[1] * values.y
    mesh = axes.pcolormesh(
        edges(x),
        edges(y),
        values.misfit,
        vmin=0.5,
        vmax=LARGEST,
        cmap=style.SEQUENTIAL + "_r",
        rasterized=True,
        gid="misfit",
    )
    lines = axes.contour(x, y, values.misfit, levels=LEVELS, colors=style.BLACK, linewidths=0.5)
    labels = axes.clabel(lines, fontsize=5, fmt="%g")
    for label in labels or ():
        label.set_path_effects([OUTLINE])
    axes.set_xlim(edges(x)[0], edges(x)[-1])
    axes.set_ylim(edges(y)[0], edges(y)[-1])
    return mesh


def _mark(axes: Axes, x: float, y: float, look: tuple[str, str]) -> None:
    """Mark a fit if it lies inside of a map."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    if left <= x <= right and bottom <= y <= top:
        colour, marker = look
        axes.plot(x, y, marker, color=colour, ms=5.5, mec="white", mew=0.7, gid="fit")


def _deviations(axes: Axes, fits: Sequence[Fit]) -> None:
    """Draw the deviation of every feature for every hypothesis."""
    features = fits[0].features
    rows = np.arange(len(features))
    for row, feature in zip(rows, features, strict=True):
        allowed = 100 * feature.allowed
        axes.barh(row, 2 * allowed, left=-allowed, height=0.8, color=style.SILVER, lw=0)
    for at, (fit, look) in enumerate(zip(fits, LOOKS, strict=False)):
        shift = 0.7 * (at / max(len(fits) - 1, 1) - 0.5)
        for row, feature in zip(rows, fit.features, strict=True):
            if feature.deviation is None:
                continue
            value = 100 * float(np.clip(feature.deviation, -0.01 * WIDEST, 0.01 * WIDEST))
            face = "none" if feature.partial else look[0]
            axes.plot(
                value,
                row + shift,
                look[1],
                ms=3.2,
                mfc=face,
                mec=look[0],
                mew=0.6,
                clip_on=False,
                gid=fit.hypothesis.key,
            )
    axes.axvline(0, color=style.GREY, lw=0.5)
    axes.set_yticks(rows, [f"{feature.name}, {feature.published:.0f}" for feature in features])
    axes.set_ylim(len(features) - 0.4, -0.6)
    axes.set_xlim(-WIDEST, WIDEST)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("deviation from the published speed (%); larger ones stand at the border")
    axes.set_title("e  every feature", loc="left", fontweight="bold")
    handles = [
        Line2D([], [], ls="none", marker=look[1], ms=4, color=look[0], label=fit.hypothesis.key)
        for fit, look in zip(fits, LOOKS, strict=False)
    ]
    handles += [
        Line2D([], [], ls="none", marker="s", ms=5, color=style.SILVER, label="allowed"),
        Line2D(
            *([], []),
            ls="none",
            marker="o",
            ms=4,
            mfc="none",
            color=style.GREY,
            label="only one side\nof the border found",
        ),
    ]
    axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5))
