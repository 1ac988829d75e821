"""Lines of a spectrum over the order, in multiples of the mesh frequency."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spurflex_postproc.flags import LARGEST_PERIOD

FAINT = 0.005
"""Smallest line that counts, as a fraction of the strongest."""
FINE = 0.05
"""Step of the orders below which a line is broader than a step; else every order is a line."""
APART = 0.01
"""Distance in orders within which only the strongest line counts: a window has side lobes."""
EXACT = 0.002
"""Largest distance in orders of a line from the combination that it is taken for."""
MOST_MULTIPLES = 10
"""Highest multiple of a second frequency in such a combination."""


class Line(NamedTuple):
    """One line of a spectrum.

    Attributes:
        order: Multiple of the mesh frequency, between grid points where these are close.
        amplitude: Its height, in the unit of the spectrum.
    """

    order: float
    amplitude: float


def find_lines(order: ArrayLike, amplitude: ArrayLike, *, faint: float = FAINT) -> list[Line]:
    """Return all lines at positive orders, the strongest first.

    Args:
        order: Orders, ascending, shape (n,).
        amplitude: Amplitudes, shape (n,).
        faint: Smallest line, as a fraction of the strongest.

    Returns:
        The lines.
    """
    chosen: list[Line] = []
    for line in sorted(_lines(order, amplitude), key=lambda line: -line.amplitude):
        if line.amplitude <= 0 or (chosen and line.amplitude < faint * chosen[0].amplitude):
            break
        if all(abs(line.order - other.order) > APART for other in chosen):
            chosen.append(line)
    return chosen


def second_frequency(orders: Sequence[float]) -> float | None:
    """Find the frequency that together with the mesh frequency makes up a spectrum.

    Args:
        orders: Orders of the lines, the strongest first.

    Returns:
        The order nu below 1/2 for which all lines are whole multiples of 1 plus or minus whole
        multiples of nu, the one with the smallest multiples; None if whole multiples of a
        fraction of the mesh frequency do it, or nothing does.
    """
    for period in range(1, LARGEST_PERIOD + 1):
        if all(abs(order - round(order * period) / period) <= EXACT for order in orders):
            return None
    # Each line is itself a candidate, up to its distance from whole multiples.
    candidates = {abs(order - round(order)) for order in orders}
    best: tuple[int, float] | None = None
    for nu in sorted(one for one in candidates if one > EXACT):
        multiples = [_multiple(order, nu) for order in orders]
        if all(one is not None for one in multiples):
            total = sum(one for one in multiples if one is not None)
            if best is None or total < best[0]:
                best = total, nu
    return None if best is None else best[1]


def _multiple(order: float, nu: float) -> int | None:
    """Return the smallest m for which an order is k + m nu or k - m nu with a whole k."""
    for multiple in range(MOST_MULTIPLES + 1):
        for part in (order - multiple * nu, order + multiple * nu):
            if abs(part - round(part)) <= EXACT:
                return multiple
    return None


def _lines(order: ArrayLike, amplitude: ArrayLike) -> list[Line]:
    """Return order and height of each line, on a fine grid by a parabola through its top."""
    x, y = np.asarray(order, dtype=float), np.asarray(amplitude, dtype=float)
    if x.shape != y.shape or x.ndim != 1:
        raise ValueError("order and amplitude differ in shape")
    y = np.nan_to_num(y)
    if len(x) > 1 and np.diff(x).min() >= FINE:
        return [Line(float(at), float(height)) for at, height in zip(x, y, strict=True) if at > 0]
    padded = np.concatenate([[-np.inf], y, [-np.inf]])
    tops = np.flatnonzero((padded[1:-1] > padded[:-2]) & (padded[1:-1] >= padded[2:]) & (x > 0))
    lines = []
    for at in map(int, tops):
        place = x[at]
        if 0 < at < len(x) - 1:
            bend = y[at - 1] - 2 * y[at] + y[at + 1]
            if bend < 0:
                shift = 0.5 * (y[at - 1] - y[at + 1]) / bend
                place += float(np.clip(shift, -0.5, 0.5)) * (x[at + 1] - x[at])
        lines.append(Line(float(place), float(y[at])))
    return lines
