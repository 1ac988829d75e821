"""Peaks of an amplitude-frequency curve."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spurflex_postproc.features.branches import Branches, find_branches

Reals = NDArray[np.float64]

SMALLEST_PROMINENCE = 0.03
"""Smallest prominence of a peak, as a fraction of its height."""


@dataclass(frozen=True)
class Peak:
    """A local maximum inside a smooth branch.

    Attributes:
        speed: Position [rev/min], between grid points.
        height: Amplitude there, in the unit of the curve.
        prominence: Height above the higher of the two valleys beside it; a branch that breaks off
            in a jump falls as deep as the jump.
    """

    speed: float
    height: float
    prominence: float


def find_peaks(
    speed: ArrayLike,
    amplitude: ArrayLike,
    regular: ArrayLike | None = None,
    *,
    smallest: float = SMALLEST_PROMINENCE,
    branches: Branches | None = None,
) -> list[Peak]:
    """Find the peaks of a curve.

    The brink of a jump and the border of an irregular band are no peaks.

    Args:
        speed: Rotating speeds [rev/min], ascending, shape (n,).
        amplitude: Amplitudes, NaN where there is none, shape (n,).
        regular: True where the motion is periodic, shape (n,); everywhere if absent.
        smallest: Smallest prominence, as a fraction of the height.
        branches: The branches of the same curve, if they are known already.

    Returns:
        The peaks in order of speed.

    Raises:
        ValueError: If the shapes differ or the speeds do not ascend.
    """
    if branches is None:
        branches = find_branches(speed, amplitude, regular)
    x, y = np.asarray(speed, dtype=float), np.asarray(amplitude, dtype=float)
    peaks = []
    for segment in branches.segments:
        for first, last in _maxima(y[segment]):
            prominence = _prominence(y, segment, first, last)
            at, height = _vertex(x[segment], y[segment], first, last)
            if prominence >= smallest * abs(height):
                peaks.append(Peak(at, height, prominence))
    return peaks


def _maxima(y: Reals) -> list[tuple[int, int]]:
    """Return first and last position of each flat or pointed top inside a branch."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(y)) + 1])
    level = y[starts]
    inner = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:])) + 1
    return [(int(starts[at]), int(starts[at + 1]) - 1) for at in inner]


def _prominence(y: Reals, segment: NDArray[np.intp], first: int, last: int) -> float:
    """Return the height of a top above the higher of the valleys beside it."""
    valleys = []
    inside = y[segment]
    for side, beyond in (
        (inside[first::-1], y[: segment[0]][::-1]),
        (inside[last:], y[segment[-1] + 1 :]),
    ):
        higher = np.flatnonzero(side > inside[first])
        valley = float(side[: higher[0] if higher.size else None].min())
        known = beyond[np.isfinite(beyond)]
        if not higher.size and known.size:
            valley = min(valley, float(known[0]))
        valleys.append(valley)
    return float(inside[first] - max(valleys))


def _vertex(x: Reals, y: Reals, first: int, last: int) -> tuple[float, float]:
    """Return speed and height of a top, from the parabola through it and its neighbours."""
    if last > first:
        return float(x[first] + x[last]) / 2, float(y[first])
    left, right = x[first - 1] - x[first], x[first + 1] - x[first]
    down_left, down_right = y[first - 1] - y[first], y[first + 1] - y[first]
    bend = (down_right / right - down_left / left) / (right - left)
    slope = down_left / left - bend * left
    shift = -slope / (2 * bend)
    return float(x[first] + shift), float(y[first] + slope * shift / 2)
