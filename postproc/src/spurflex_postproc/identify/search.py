"""Searches for the least value of a function that is rough on a small scale."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes:
        point: Where the value is least, shape (n,).
        value: The value there.
        evaluations: How many points were evaluated.
    """

    point: Reals
    value: float
    evaluations: int


def compass(
    values: Callable[[list[Reals]], Sequence[float]],
    starts: Sequence[Reals],
    steps: Reals,
    *,
    halvings: int = 3,
    most: int = 200,
) -> Found:
    """Go from the best of some points to its best neighbour until no neighbour is better.

    Neighbours differ in one coordinate by one step; when none is better the steps are halved.
    All neighbours of a point are evaluated at once, so that they can run side by side.

    Args:
        values: Function of a list of points that returns their values.
        starts: Points of shape (n,), at least one.
        steps: First steps, shape (n,).
        halvings: How often the steps are halved.
        most: No further step after so many evaluations.

    Returns:
        The best point.
    """
    known: dict[bytes, float] = {}

    def evaluate(points: Sequence[Reals]) -> list[float]:
        fresh = [point for point in points if point.round(9).tobytes() not in known]
        for point, value in zip(fresh, values(fresh) if fresh else [], strict=True):
            known[point.round(9).tobytes()] = float(value)
        return [known[point.round(9).tobytes()] for point in points]

    first = [np.asarray(start, dtype=float) for start in starts]
    found = evaluate(first)
    best, value = first[int(np.argmin(found))], min(found)
    step = np.asarray(steps, dtype=float)
    halved = 0
    while halved <= halvings and len(known) < most and best.size:
        around = [best + sign * step * unit for unit in np.eye(best.size) for sign in (1.0, -1.0)]
        found = evaluate(around)
        if min(found) < value:
            best, value = around[int(np.argmin(found))], min(found)
        else:
            step = step / 2
            halved += 1
    return Found(best, value, len(known))
