"""Lines of a spectrum over the order, in multiples of the mesh frequency."""

import numpy as np
from numpy.typing import ArrayLike

FAINT = 0.005
"""Smallest line that counts, as a fraction of the strongest."""
FINE = 0.05
"""Step of the orders below which a line is broader than a step; else every order is a line."""


def dominant_order(order: ArrayLike, amplitude: ArrayLike) -> float:
    """Return the order of the strongest line, order zero left out.

    Args:
        order: Orders, ascending, shape (n,).
        amplitude: Amplitudes, shape (n,).

    Returns:
        The order, between grid points where these are close.

    Raises:
        ValueError: If there is no positive order.
    """
    lines = _lines(order, amplitude)
    if not lines:
        raise ValueError("no positive order")
    return max(lines, key=lambda line: line[1])[0]


def find_orders(order: ArrayLike, amplitude: ArrayLike, *, faint: float = FAINT) -> list[float]:
    """Return the orders of all lines, the strongest first.

    Args:
        order: Orders, ascending, shape (n,).
        amplitude: Amplitudes, shape (n,).
        faint: Smallest line, as a fraction of the strongest.

    Returns:
        Orders, between grid points where these are close.
    """
    lines = sorted(_lines(order, amplitude), key=lambda line: -line[1])
    return [at for at, height in lines if height >= faint * lines[0][1] and height > 0]


def _lines(order: ArrayLike, amplitude: ArrayLike) -> list[tuple[float, float]]:
    """Return order and height of each line, on a fine grid by a parabola through its top."""
    x, y = np.asarray(order, dtype=float), np.asarray(amplitude, dtype=float)
    if x.shape != y.shape or x.ndim != 1:
        raise ValueError("order and amplitude differ in shape")
    y = np.nan_to_num(y)
    if len(x) > 1 and np.diff(x).min() >= FINE:
        return [(float(at), float(height)) for at, height in zip(x, y, strict=True) if at > 0]
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
        lines.append((float(place), float(y[at])))
    return lines
