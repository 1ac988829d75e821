"""Ranges of speed with one class of motion, and their borders."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spurflex_postproc.flags import LARGEST_PERIOD, LONG_PERIOD, Motion

IRREGULAR = "irregular"
"""Class of what does not repeat within `LARGEST_PERIOD` mesh periods, or could not be told."""
SHORTEST = 3
"""Points that a regime needs; fewer between two of the same kind are taken in by them."""


@dataclass(frozen=True)
class Regime:
    """A range of speed with one class of motion.

    Attributes:
        motion: '1T' to '8T', or `IRREGULAR`: longer periods, quasi-periodic, chaotic, unresolved.
        first: Its first speed of the grid [rev/min].
        last: Its last speed of the grid [rev/min].
        flags: The different flags of `motion` inside, by how often they occur.
    """

    motion: str
    first: float
    last: float
    flags: tuple[int, ...]


_Choice = tuple[int, int, float, dict[int, int]]
"""Pairs, borders with both regimes, negative deviation, computed by published regime."""


@dataclass(frozen=True)
class Border:
    """A published border between two regimes and the computed one.

    Attributes:
        before: Class below it.
        after: Class above it.
        published: Speed [rev/min].
        computed: Speed half way between two grid points [rev/min]; None if there is none.
        side: Where it was seen: 'both' if the two regimes touch, else the end of the 'lower' or
            of the 'upper' one; 'none' if neither was found.
        found: Whether the lower and the upper regime were found.
    """

    before: str
    after: str
    published: float
    computed: float | None
    side: str
    found: tuple[bool, bool]

    @property
    def complete(self) -> bool:
        """Whether both regimes were found."""
        return all(self.found)


def motion_name(flag: int) -> str:
    """Return the class of one flag of `motion`."""
    return f"{flag}T" if 1 <= flag <= LARGEST_PERIOD else IRREGULAR


def flag_name(flag: int) -> str:
    """Return a flag of `motion` in words."""
    names = {Motion.QUASI_PERIODIC: "quasi-periodic", Motion.CHAOTIC: "chaotic"}
    if flag in names:
        return names[Motion(flag)]
    if flag > LONG_PERIOD:
        return f"{flag - LONG_PERIOD}T"
    return motion_name(flag) if flag > 0 else "unresolved"


def find_regimes(speed: ArrayLike, motion: ArrayLike, *, shortest: int = SHORTEST) -> list[Regime]:
    """Cut a row of motion flags into regimes.

    A run shorter than `shortest` between two runs of one class belongs to them; one between two
    different classes belongs to the irregular one if there is one, else it stays.

    Args:
        speed: Rotating speeds [rev/min], ascending, shape (n,).
        motion: Motion flags, shape (n,); negative where there is no value, which is left out.
        shortest: Points that a regime needs.

    Returns:
        The regimes in order of speed.

    Raises:
        ValueError: If the shapes differ.
    """
    x, flags = np.asarray(speed, dtype=float), np.asarray(motion)
    if x.shape != flags.shape or x.ndim != 1:
        raise ValueError("speed and motion differ in shape")
    x, flags = x[flags >= 0], flags[flags >= 0]
    names = [motion_name(int(flag)) for flag in flags]
    while absorbed := _absorb(names, shortest):
        names = absorbed
    return [_regime(x, flags, names, first, last) for first, last in _runs(names)]


def _runs(names: Sequence[str]) -> list[tuple[int, int]]:
    """Return first and last position of each run of equal names."""
    cuts = [0, *(i for i in range(1, len(names)) if names[i] != names[i - 1]), len(names)]
    return [(a, b - 1) for a, b in pairwise(cuts) if b > a]


def _absorb(names: list[str], shortest: int) -> list[str] | None:
    """Give the shortest run that is too short to its neighbours; None if there is none."""
    runs = _runs(names)
    for at in sorted(range(1, len(runs) - 1), key=lambda i: runs[i][1] - runs[i][0]):
        first, last = runs[at]
        if last - first + 1 >= shortest:
            return None
        below, above = names[first - 1], names[last + 1]
        if below == above or IRREGULAR in (below, above):
            into = below if below == above else IRREGULAR
            return [*names[:first], *[into] * (last - first + 1), *names[last + 1 :]]
    return None


def _regime(
    x: NDArray[np.float64], flags: NDArray[np.int64], names: list[str], first: int, last: int
) -> Regime:
    """Describe one run."""
    found, counts = np.unique(flags[first : last + 1], return_counts=True)
    order = np.argsort(-counts, kind="stable")
    return Regime(
        names[first], float(x[first]), float(x[last]), tuple(int(found[at]) for at in order)
    )


def sequence(regimes: Sequence[Regime]) -> str:
    """Write regimes in a line, as '1T to 4640, irregular to 4980, ...' [rev/min]."""
    return ", ".join(f"{regime.motion} to {regime.last:.0f}" for regime in regimes)


def match_borders(
    regimes: Sequence[Regime], published: Sequence[tuple[str, float, float]]
) -> list[Border]:
    """Find the borders of a published sequence of regimes among the computed ones.

    The longest part of the published sequence that the computed one holds in the same order is
    taken; of equally long ones that with most borders of which both regimes were found, then
    that whose regimes deviate least. Where both
    regimes of a border were found, it is where they touch; if something else lies between them,
    it is the end of either that is nearer to the published speed. Where one was found, it is the
    end of that one.

    Args:
        regimes: Computed regimes in order of speed.
        published: Class ('chaotic' counts as `IRREGULAR`), first and last speed [rev/min].

    Returns:
        Every published border, with the computed one where there is one.
    """
    wanted = [(IRREGULAR if name == "chaotic" else name, a, b) for name, a, b in published]
    chosen = _align(list(regimes), wanted)
    borders = []
    for at, (_, _, last) in enumerate(wanted[:-1]):
        ends: dict[str, float] = {}
        low, high = chosen.get(at), chosen.get(at + 1)
        if low is not None and low + 1 < len(regimes):
            ends["lower"] = (regimes[low].last + regimes[low + 1].first) / 2
        if high is not None and high > 0:
            ends["upper"] = (regimes[high - 1].last + regimes[high].first) / 2
        side, computed = min(
            ends.items(), key=lambda end: abs(end[1] - last), default=("none", None)
        )
        if len(set(ends.values())) == 1 and len(ends) == 2:
            side = "both"
        names = published[at][0], published[at + 1][0]
        found = low is not None, high is not None
        borders.append(Border(*names, last, computed, side, found))
    return borders


def _align(regimes: list[Regime], wanted: Sequence[tuple[str, float, float]]) -> dict[int, int]:
    """Pair published with computed regimes in order: as many as possible, connected, near."""
    table: dict[tuple[int, int, bool], _Choice] = {}

    def best(i: int, j: int, joined: bool) -> _Choice:
        # joined: whether the published regime before i is in a pair
        if i == len(wanted) or j == len(regimes):
            return 0, 0, 0.0, {}
        if (i, j, joined) not in table:
            options = [best(i + 1, j, False), best(i, j + 1, joined)]
            name, first, last = wanted[i]
            if regimes[j].motion == name:
                count, borders, near, rest = best(i + 1, j + 1, True)
                off = abs(regimes[j].first - first) + abs(regimes[j].last - last)
                options.append((count + 1, borders + joined, near - off, {i: j, **rest}))
            table[i, j, joined] = max(options, key=lambda option: option[:3])
        return table[i, j, joined]

    return best(0, 0, False)[3]
