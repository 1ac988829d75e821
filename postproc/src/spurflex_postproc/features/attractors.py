"""Coexisting steady motions, told by comparing what different starts lead to."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spurflex_postproc.features.regimes import IRREGULAR, motion_name

SAME = 0.01
"""Largest difference of the amplitudes of one periodic motion, as a fraction."""
SAME_IRREGULAR = 0.35
"""The same for motions that do not repeat, whose largest amplitude depends on the window."""


@dataclass(frozen=True)
class Attractor:
    """One of the motions at a speed.

    Attributes:
        motion: Class of motion, as of `motion_name`.
        amplitude: Smallest amplitude among its starts, in the unit of the curves.
        starts: The starts that lead to it.
    """

    motion: str
    amplitude: float
    starts: tuple[str, ...]


@dataclass(frozen=True)
class Coexistence:
    """A range of speed in which starts lead to different motions.

    Attributes:
        first: First speed [rev/min].
        last: Last speed [rev/min].
        motions: Classes of motion that occur, by name.
        most: Largest number of motions at one speed.
    """

    first: float
    last: float
    motions: tuple[str, ...]
    most: int


def attractors(
    amplitude: Mapping[str, ArrayLike], motion: Mapping[str, ArrayLike], *, same: float = SAME
) -> list[list[Attractor]]:
    """Group the starts at each speed by the motion that they lead to.

    Args:
        amplitude: Amplitudes by start, NaN where there is none, shape (n,) each.
        motion: Motion flags by start, shape (n,) each.
        same: Largest difference of the amplitudes of one periodic motion, as a fraction.

    Returns:
        For every speed the different motions, in order of amplitude.

    Raises:
        ValueError: If the starts of both mappings differ or their shapes do.
    """
    if list(amplitude) != list(motion):
        raise ValueError("amplitude and motion hold different starts")
    heights = {start: np.asarray(values, dtype=float) for start, values in amplitude.items()}
    flags = {start: np.asarray(values) for start, values in motion.items()}
    shapes = {values.shape for values in (*heights.values(), *flags.values())}
    if len(shapes) != 1:
        raise ValueError("the starts differ in shape")
    (count,) = shapes.pop()
    found = []
    for at in range(count):
        groups: list[Attractor] = []
        points = [
            (heights[start][at], motion_name(int(flags[start][at])), start)
            for start in heights
            if np.isfinite(heights[start][at])
        ]
        for height, name, start in sorted(points, key=lambda point: point[0]):
            limit = SAME_IRREGULAR if name == IRREGULAR else same
            for where, group in enumerate(groups):
                if group.motion == name and height <= group.amplitude * (1 + limit):
                    groups[where] = Attractor(name, group.amplitude, (*group.starts, start))
                    break
            else:
                groups.append(Attractor(name, float(height), (start,)))
        found.append(groups)
    return found


def coexistence(speed: ArrayLike, found: list[list[Attractor]]) -> list[Coexistence]:
    """Return the ranges of speed with more than one motion.

    Args:
        speed: Rotating speeds [rev/min], shape (n,).
        found: The motions at each speed, as `attractors` returns them.

    Returns:
        The ranges in order of speed.
    """
    x = np.asarray(speed, dtype=float)
    several = np.array([len(groups) > 1 for groups in found], dtype=bool)
    return [
        Coexistence(
            first=float(x[first]),
            last=float(x[last]),
            motions=tuple(
                sorted({group.motion for groups in found[first : last + 1] for group in groups})
            ),
            most=max(len(groups) for groups in found[first : last + 1]),
        )
        for first, last in _true_runs(several)
    ]


def _true_runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and last position of each run of True."""
    cuts = [0, *(int(at) + 1 for at in np.flatnonzero(np.diff(mask))), len(mask)]
    return [(a, b - 1) for a, b in pairwise(cuts) if b > a and mask[a]]
