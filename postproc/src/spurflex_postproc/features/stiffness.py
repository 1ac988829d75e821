"""From which support stiffness on a response is that of the rigid support."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Reals = NDArray[np.float64]

RIGID_LIKE = 0.05
"""Median difference from the rigid response below which a support counts as rigid."""


@dataclass(frozen=True)
class Transition:
    """How the response changes from that of a soft to that of a rigid support.

    Attributes:
        stiffness: Support stiffnesses [N/m], shape (m,).
        difference: Median over the speeds of the difference from the rigid response, as a
            fraction of it, shape (m,).
        middle: Where the response lies half way from soft to rigid in logarithms [N/m].
        rigid_from: Lowest stiffness from which on the difference stays small [N/m].
    """

    stiffness: Reals
    difference: Reals
    middle: float
    rigid_from: float


def transition(
    stiffness: ArrayLike, response: ArrayLike, rigid: ArrayLike, *, small: float = RIGID_LIKE
) -> Transition:
    """Follow the difference between flexible and rigid support over the stiffness.

    The way from soft to rigid is a number between 0 and 1 at each stiffness: the distance of the
    logarithm of the response from that of the softest row, over the sum of its distances from the
    softest row and from the rigid response, with distances as medians over the speeds.

    Args:
        stiffness: Support stiffnesses [N/m], ascending, shape (m,).
        response: Positive responses, NaN where there is none, shape (m, n).
        rigid: The response on the rigid support, shape (n,).
        small: Difference below which a support counts as rigid, as a fraction.

    Returns:
        The transition; `middle` and `rigid_from` are NaN where there is none.

    Raises:
        ValueError: If the shapes do not fit or no speed is known in every row.
    """
    rows = np.asarray(stiffness, dtype=float)
    flexible, stiff = np.asarray(response, dtype=float), np.asarray(rigid, dtype=float)
    if flexible.shape != (len(rows), len(stiff)):
        raise ValueError("response does not fit stiffness and rigid")
    known = np.isfinite(flexible).all(axis=0) & np.isfinite(stiff)
    if not known.any():
        raise ValueError("no speed is known in every row")
    flexible, stiff = flexible[:, known], stiff[known]
    difference = np.median(np.abs(flexible / stiff - 1), axis=1)
    from_soft = np.median(np.abs(np.log(flexible / flexible[0])), axis=1)
    to_rigid = np.median(np.abs(np.log(flexible / stiff)), axis=1)
    total = from_soft + to_rigid
    way = np.divide(from_soft, total, out=np.zeros_like(total), where=total > 0)
    away = np.flatnonzero(difference > small)
    first = int(away[-1]) + 1 if away.size else 0
    return Transition(
        stiffness=rows,
        difference=difference,
        middle=_crossing(np.log(rows), way, 0.5),
        rigid_from=float(rows[first]) if first < len(rows) else float("nan"),
    )


def _crossing(x: Reals, y: Reals, level: float) -> float:
    """Return exp(x) where y last rises through a level, by linear interpolation; NaN if nowhere."""
    rising = np.flatnonzero((y[:-1] < level) & (y[1:] >= level))
    if not rising.size:
        return float("nan")
    at = int(rising[-1])
    part = (level - y[at]) / (y[at + 1] - y[at])
    return float(np.exp(x[at] + part * (x[at + 1] - x[at])))
