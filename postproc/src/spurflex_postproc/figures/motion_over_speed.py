"""Figure 3: waterfalls and bifurcation diagrams of the driving gear."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from spurflex_postproc import style
from spurflex_postproc.decks import start_of
from spurflex_postproc.features import find_regimes, sequence
from spurflex_postproc.figures.bifurcation import draw_branches, read_branches
from spurflex_postproc.figures.common import (
    SPEED_LABEL,
    Drawing,
    Options,
    legend_below,
    named_after,
    support_label,
    variant_of,
)
from spurflex_postproc.figures.motion_strip import draw_motion, line_legend, published_motion
from spurflex_postproc.figures.spectrum_map import draw_maps
from spurflex_postproc.figures.waterfall import draw_stack, ordinal, read_stacks
from spurflex_postproc.published import published_regimes
from spurflex_postproc.quantities import QUANTITIES

NEEDS = ("status", "motion", "rigid_status", "rigid_motion")


def draw(result: xr.Dataset, options: Options) -> list[Drawing]:
    """Draw the waterfalls above and the bifurcation diagrams below, flexible support left.

    Args:
        result: A dataset from `open_result` with the variables `NEEDS`, whose file holds spectra
            and Poincare sections.
        options: Choice of quantity and support stiffness.

    Returns:
        The four panels of the article with strips of the motion, and the spectra as maps.

    Raises:
        ResultError: If spectra or sections are missing.
    """
    quantity = QUANTITIES[options.quantity]
    stacks, diagrams = read_stacks(result, options), read_branches(result, options)
    figure = Figure(figsize=style.size(style.DOUBLE, 158), layout="constrained")
    panels = figure.subplots(3, len(stacks), squeeze=False, height_ratios=[1.25, 1.0, 0.13])
    reports = []
    for column, (stack, branches) in enumerate(zip(stacks, diagrams, strict=True)):
        above, below, strip = panels[:, column]
        every = draw_stack(above, stack, quantity.amplitude_label)
        above.set_title(f"{'ab'[column]}  {stack.support} support", loc="left", fontweight="bold")
        draw_branches(below, branches, quantity)
        below.set_title(
            f"{'cd'[column]}  {branches.support} support", loc="left", fontweight="bold"
        )
        below.set_xlabel("")
        told = published_motion(stack.support, branches.speed)
        draw_motion(strip, branches.speed, {"published": told, "computed": branches.motion})
        strip.get_legend().remove()
        strip.set_xlim(below.get_xlim())
        strip.tick_params(axis="x", which="both", length=0)
        strip.set_xlabel(SPEED_LABEL)
        reports += _report(stack.support, branches.speed, branches.motion, every)
    figure.suptitle(_heading(result, options), fontsize=7, x=0.01, ha="left")
    flags = [branches.motion for branches in diagrams]
    flags += [published_motion(one.support, one.speed) for one in diagrams]
    legend_below(figure, line_legend(np.concatenate(flags)))
    name = named_after(result, "figure3")
    return [
        Drawing(name, figure, "\n".join(reports)),
        Drawing(f"{name}_map", draw_maps(stacks, quantity)),
    ]


def _heading(result: xr.Dataset, options: Options) -> str:
    """Say which support and which start are drawn."""
    start = start_of(result.attrs["path"])
    heading = support_label(result, "flexible", options.stiffness)
    if start:
        heading += f"; start '{start}'"
    return heading + variant_of(result, "figure3")


def _report(support: str, speed: np.ndarray, motion: np.ndarray, every: int) -> list[str]:
    """List the ranges of motion beside the published ones."""
    told = ", ".join(f"{name} to {last:.0f}" for name, _, last in published_regimes(support))
    return [
        f"{support} support; the waterfall shows every {ordinal(every)} speed",
        f"  published  {told}",
        f"  computed   {sequence(find_regimes(speed, motion))}",
    ]
