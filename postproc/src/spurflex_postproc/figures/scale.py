"""Colours and cell borders of maps."""

import numpy as np
from matplotlib.colorbar import Colorbar
from matplotlib.colors import LogNorm, Normalize, PowerNorm
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike, NDArray

from spurflex_postproc.figures.common import AMPLITUDE_LABEL

Reals = NDArray[np.float64]

SHARE = (1.0, 99.8)
"""Percentiles of the amplitudes at which the colours end."""
WIDE = 8.0
"""Ratio of the largest to the smallest colour from which the scale is logarithmic."""


def edges(centres: ArrayLike, *, logarithmic: bool = False) -> Reals:
    """Return the borders of the cells around points.

    Args:
        centres: The points, ascending, at least two, shape (n,).
        logarithmic: Whether borders are half way by ratio instead of by difference.

    Returns:
        The borders, shape (n + 1,).
    """
    points = np.asarray(centres, dtype=float)
    points = np.log(points) if logarithmic else points
    middle = (points[:-1] + points[1:]) / 2
    first, last = 2 * points[0] - middle[0], 2 * points[-1] - middle[-1]
    borders = np.concatenate([[first], middle, [last]])
    return np.exp(borders) if logarithmic else borders


def amplitude_norm(amplitude: ArrayLike) -> Normalize:
    """Choose a colour scale on which small crests and large irregular motion both show.

    Args:
        amplitude: Amplitudes, NaN where there is none, any shape, at least one value.

    Returns:
        A logarithmic scale if the amplitudes span a wide range, else a square root.
    """
    values = np.asarray(amplitude, dtype=float)
    values = values[np.isfinite(values)]
    low, high = (float(value) for value in np.percentile(values, SHARE))
    if low > 0 and high / low >= WIDE:
        return LogNorm(low, high)
    return PowerNorm(0.5, min(low, high), high if high > low else low + 1.0)


def label_colours(bar: Colorbar) -> None:
    """Give a colour bar its label, and plain numbers where it is logarithmic."""
    bar.set_label(AMPLITUDE_LABEL)
    if isinstance(bar.norm, LogNorm):
        bar.set_ticks(LogLocator(subs=(1, 2, 5)))
        bar.ax.yaxis.set_major_formatter(FormatStrFormatter("%g"))
        bar.ax.yaxis.set_minor_formatter(NullFormatter())
