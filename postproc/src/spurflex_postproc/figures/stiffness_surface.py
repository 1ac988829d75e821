"""The map of figure 9 as a surface in perspective."""

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spurflex_postproc import style
from spurflex_postproc.features import CrestLine
from spurflex_postproc.figures.common import AMPLITUDE_LABEL, SPEED_LABEL, STIFFNESS_LABEL
from spurflex_postproc.figures.scale import amplitude_norm

Reals = NDArray[np.float64]

VIEW = {"elev": 42.0, "azim": -112.0}
"""Direction from which the surface is seen [deg]: the crest line is hidden from most others."""
LIFT = 0.01
"""Height of the crest line above the surface, as a fraction of the largest amplitude."""


def draw_surface(speed: Reals, stiffness: Reals, amplitude: Reals, crest: CrestLine) -> Figure:
    """Draw amplitude over speed and the logarithm of the stiffness, and the crest line on top.

    Colours follow those of the map. The surface itself is a bitmap in vector files, which keeps
    them small.

    Args:
        speed: Rotating speeds [rev/min], shape (n,).
        stiffness: Support stiffnesses [N/m], shape (m,).
        amplitude: Amplitudes [um], NaN where there is none, shape (m, n).
        crest: Crest of the soft support; drawn as the black line of the article.

    Returns:
        The figure; cells with a corner without value are left open.
    """
    figure = Figure(figsize=style.size(style.DOUBLE, 112))
    axes: Any = figure.add_axes((0.0, 0.02, 1.0, 1.08), projection="3d", computed_zorder=False)
    x, y = np.meshgrid(speed, np.log10(stiffness))
    norm = amplitude_norm(amplitude)
    cells = (amplitude[:-1, :-1] + amplitude[:-1, 1:] + amplitude[1:, :-1] + amplitude[1:, 1:]) / 4
    colours = mpl.colormaps[style.SEQUENTIAL](norm(np.nan_to_num(cells, nan=1.0)))
    colours[~np.isfinite(cells), 3] = 0.0
    surface = axes.plot_surface(
        x,
        y,
        np.nan_to_num(amplitude),
        facecolors=colours,
        rstride=1,
        cstride=1,
        linewidth=0,
        antialiased=False,
        shade=False,
        rasterized=True,
    )
    surface.set_clip_on(False)
    _draw_crest(axes, amplitude, crest)
    axes.view_init(**VIEW)
    axes.set_box_aspect((1.5, 1.2, 0.62), zoom=1.12)
    axes.set_xlim(speed[0], speed[-1])
    axes.set_ylim(y.min(), y.max())
    axes.set_zlim(bottom=0)
    decades = np.arange(np.ceil(y.min()), np.floor(y.max()) + 1, 1 if np.ptp(y) < 6 else 3)
    axes.set_yticks(decades, [f"$10^{{{decade:.0f}}}$" for decade in decades])
    axes.set_xlabel(SPEED_LABEL)
    axes.set_ylabel(STIFFNESS_LABEL)
    axes.set_zlabel(AMPLITUDE_LABEL)
    axes.tick_params(pad=0)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((1, 1, 1, 0))
        axis.pane.set_edgecolor(style.PALE)
    axes.grid(visible=False)
    return figure


def _draw_crest(axes: Any, amplitude: Reals, crest: CrestLine) -> None:
    """Draw the line along which the crest of the soft support moves, just above the surface."""
    there = np.isfinite(crest.speed)
    if there.any():
        axes.plot(
            crest.speed[there],
            np.log10(crest.stiffness[there]),
            crest.height[there] + LIFT * np.nanmax(amplitude),
            color=style.BLACK,
            lw=1.0,
            zorder=5,
            gid="crest",
        )
