"""The flags of a result file, and what they say about a point."""

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

NO_VALUE = -1
"""Stands in a masked integer variable where the point has no value."""

LARGEST_PERIOD = 8
"""Largest multiple of the mesh period that is its own flag of `motion`."""

LONG_PERIOD = 100
"""Added to the multiple in the flag of a motion that takes longer to repeat."""


class Status(IntEnum):
    """Values of `status` and `rigid_status`."""

    MISSING = 0
    SETTLED = 1
    NOT_SETTLED = 2
    DIVERGED = 3
    INACCURATE = 4


class Motion(IntEnum):
    """Values of `motion` and `rigid_motion` that are not a multiple of the mesh period."""

    UNRESOLVED = 0
    QUASI_PERIODIC = 20
    CHAOTIC = 30


def has_value(status: ArrayLike) -> NDArray[np.bool_]:
    """Tell the points that were measured, settled or not.

    Args:
        status: Status flags, any shape.

    Returns:
        True where the point holds values, same shape.
    """
    return np.isin(np.asarray(status), (Status.SETTLED, Status.NOT_SETTLED, Status.INACCURATE))


def is_regular(status: ArrayLike, motion: ArrayLike) -> NDArray[np.bool_]:
    """Tell the points on a branch of periodic motion.

    A point that did not settle counts when its period could be told all the same; one whose
    period is unresolved counts when it settled.

    Args:
        status: Status flags, any shape.
        motion: Motion flags, same shape.

    Returns:
        True where the motion is periodic, same shape.
    """
    status, motion = np.asarray(status), np.asarray(motion)
    periodic = ((motion >= 1) & (motion <= LARGEST_PERIOD)) | (motion > LONG_PERIOD)
    settled_unknown = (motion == Motion.UNRESOLVED) & (status == Status.SETTLED)
    return np.asarray(has_value(status) & (periodic | settled_unknown))


def period_of(flag: int) -> int | None:
    """Return the mesh periods after which a motion repeats; None if it does not.

    Args:
        flag: A flag of `motion`.

    Returns:
        The multiple of the mesh period.
    """
    if 1 <= flag <= LARGEST_PERIOD:
        return flag
    return flag - LONG_PERIOD if flag > LONG_PERIOD else None
