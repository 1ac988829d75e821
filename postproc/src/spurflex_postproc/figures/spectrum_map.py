"""Spectra over rotating speed and order as a map of colours."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import AutoMinorLocator
from numpy.typing import NDArray

from spurflex_postproc import style
from spurflex_postproc.figures.common import SPEED_LABEL
from spurflex_postproc.figures.scale import edges
from spurflex_postproc.quantities import Quantity

if TYPE_CHECKING:
    from spurflex_postproc.figures.waterfall import Stack

Reals = NDArray[np.float64]

CELL = 1 / 60
"""Height of a cell in orders. A line that is narrower fills its cell."""
FAINTEST = 1e-3
"""Where the colours end, as a fraction of the strongest line."""


def draw_maps(stacks: Sequence["Stack"], quantity: Quantity) -> Figure:
    """Draw a map for each support on one scale of colours.

    Args:
        stacks: The spectra by support, at least two speeds.
        quantity: What they are spectra of.

    Returns:
        The figure.
    """
    figure = Figure(
        figsize=style.size(style.DOUBLE if len(stacks) > 1 else 120, 78), layout="constrained"
    )
    panels = np.ravel(figure.subplots(1, len(stacks), squeeze=False, sharey=True))
    strongest = max(float(np.nanmax(stack.amplitude)) for stack in stacks)
    strongest = strongest if strongest > 0 else 1.0
    faintest = FAINTEST * strongest
    norm = LogNorm(faintest, strongest)
    for panel, stack in zip(panels, stacks, strict=True):
        order, amplitude = pooled(stack.order, stack.amplitude, CELL)
        mesh = panel.pcolormesh(
            edges(stack.speed),
            edges(order),
            np.maximum(amplitude, faintest).T,
            norm=norm,
            cmap=style.SEQUENTIAL,
            rasterized=True,
            gid=f"{stack.support} spectrum",
        )
        panel.set_facecolor(style.PALE)
        panel.set_title(stack.title, loc="left")
        panel.set_xlabel(SPEED_LABEL)
        panel.set_yticks(range(0, int(stack.order[-1]) + 1))
        panel.set_ylim(0, float(stack.order[-1]))
        panel.xaxis.set_minor_locator(AutoMinorLocator())
    panels[0].set_ylabel("order (multiples of the mesh frequency)")
    bar = figure.colorbar(mesh, ax=panels, pad=0.015, aspect=35, extend="min", extendfrac=0.02)
    bar.set_label(quantity.amplitude_label)
    return figure


def pooled(order: Reals, amplitude: Reals, cell: float) -> tuple[Reals, Reals]:
    """Take the strongest line in each cell of orders, so that no thin line is lost.

    Args:
        order: Orders in even steps, ascending, shape (o,).
        amplitude: Amplitudes, NaN where there is none, shape (n, o).
        cell: Width of a cell; finer lines are put together, coarser ones stay.

    Returns:
        Middles of the cells and the strongest amplitude in each, shape (n, cells).
    """
    step = max(cell, float(order[1] - order[0]))
    bins = np.floor(order / step + 0.5 + 1e-9).astype(int)
    first = np.flatnonzero(np.diff(bins, prepend=bins[0] - 1))
    return bins[first] * step, np.maximum.reduceat(amplitude, first, axis=1)
