"""Poincare sections over the rotating speed: bifurcation diagrams."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spurflex_postproc import style
from spurflex_postproc.figures.common import (
    SPEED_LABEL,
    Drawing,
    Options,
    legend_below,
    nearest_row,
    require_values,
    support_label,
)
from spurflex_postproc.figures.motion_strip import line_colour, line_legend
from spurflex_postproc.flags import period_of
from spurflex_postproc.layout import SPEED
from spurflex_postproc.quantities import QUANTITIES, Quantity
from spurflex_postproc.recordings import SECTION, read_sections, supports_with

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class Branches:
    """The section points of one support over the speed.

    Attributes:
        support: 'rigid' or 'flexible'.
        title: What it is, for people.
        speed: Rotating speeds [rev/min], shape (n,).
        motion: Motion flags, shape (n,).
        value: Points in the unit of figures, NaN where there is none, shape (n, points).
    """

    support: str
    title: str
    speed: Reals
    motion: NDArray[np.int64]
    value: Reals


def draw(result: xr.Dataset, options: Options) -> list[Drawing]:
    """Draw the bifurcation diagram of every support in the file.

    Args:
        result: A dataset from `open_result` whose file holds Poincare sections.
        options: Choice of quantity and support stiffness.

    Returns:
        One drawing.

    Raises:
        ResultError: If there is no section of the quantity.
    """
    quantity = QUANTITIES[options.quantity]
    found = read_branches(result, options)
    figure = Figure(
        figsize=style.size(style.DOUBLE if len(found) > 1 else 120, 72), layout="constrained"
    )
    panels = np.ravel(figure.subplots(1, len(found), squeeze=False))
    for panel, branches in zip(panels, found, strict=True):
        draw_branches(panel, branches, quantity)
        panel.set_title(branches.title, loc="left")
    legend_below(figure, line_legend(np.concatenate([branches.motion for branches in found])))
    name = "bifurcation" if quantity.name == "y1" else f"bifurcation_{quantity.name}"
    return [Drawing(name, figure)]


def read_branches(result: xr.Dataset, options: Options) -> list[Branches]:
    """Read the sections of every support in the file, at the nearest support stiffness.

    Raises:
        ResultError: If there is no section of the quantity, or no value in it.
    """
    quantity = QUANTITIES[options.quantity]
    found = []
    for support in supports_with(result, SECTION, quantity.name):
        row = 0 if support == "rigid" else nearest_row(result, options.stiffness)
        value = quantity.factor * read_sections(result, quantity.name, support, row).value
        require_values(result, f"{support} poincare", value)
        motion = result["rigid_motion"] if support == "rigid" else result["motion"][row]
        found.append(
            Branches(
                support,
                support_label(result, support, options.stiffness),
                np.asarray(result[SPEED].values, dtype=float),
                motion.values,
                value,
            )
        )
    return found


def draw_branches(axes: Axes, branches: Branches, quantity: Quantity) -> None:
    """Draw a dot for each point; of a motion that repeats, for those of one period.

    Args:
        axes: Where to.
        branches: The points.
        quantity: What they are values of.
    """
    points = branches.value.shape[1]
    for flag in np.unique(branches.motion):
        here = np.flatnonzero(branches.motion == flag)
        shown = min(period_of(int(flag)) or points, points)
        values = branches.value[here, :shown]
        axes.plot(
            np.repeat(branches.speed[here], shown),
            values.ravel(),
            ls="none",
            marker="o",
            ms=0.9 if period_of(int(flag)) else 0.5,
            mew=0,
            color=line_colour(int(flag)),
            rasterized=True,
            gid=f"{branches.support} {flag}",
        )
    if len(branches.speed) > 1:
        axes.set_xlim(branches.speed[0], branches.speed[-1])
    axes.minorticks_on()
    axes.set_xlabel(SPEED_LABEL)
    axes.set_ylabel(f"{quantity.label} once a mesh period")
