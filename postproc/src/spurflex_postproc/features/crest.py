"""The crest of the soft support in the map over speed and support stiffness.

As the support stiffens, the crest rises along a straight line in logarithms until it comes near
a crest of the gear pair. The two do not cross: the crest that was followed bends and goes on as
a crest whose speed hardly depends on the stiffness any more. The line ends where it bends.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spurflex_postproc.features.branches import find_branches
from spurflex_postproc.features.peaks import Peak, find_peaks

Reals = NDArray[np.float64]

START_WITHIN = 0.25
"""Largest distance of the first crest from where it is looked for, as a fraction of it."""
FOLLOW_WITHIN = 0.06
"""Largest distance of a crest from where the rows before foretell it, as a fraction."""
REMEMBER = 4
"""Crests that foretell the next one."""
LOOSE = 2
"""Rows in a row that may lack the crest before it counts as gone."""
START_SLOPE = 0.5
"""Power of the stiffness with which the speed grows at first: a mass on a spring."""
BENT = 0.5
"""Slope below which the line has merged with another crest, as a fraction of that power."""


@dataclass(frozen=True)
class CrestLine:
    """Where the crest lies in each row of the map.

    Attributes:
        stiffness: Support stiffnesses [N/m], shape (m,).
        speed: Speed of the crest [rev/min], shape (m,); NaN in rows without it and where it has
            merged with another crest.
        height: Amplitude there, in the unit of the map, shape (m,).
    """

    stiffness: Reals
    speed: Reals
    height: Reals

    def speed_at(self, stiffness: ArrayLike) -> Reals:
        """Extend the line by a straight fit in logarithms.

        Args:
            stiffness: Support stiffnesses [N/m], any shape.

        Returns:
            Speeds [rev/min], same shape; NaN if fewer than two crests are known.
        """
        wanted = np.asarray(stiffness, dtype=float)
        slope, level = self._straight()
        return np.asarray(np.exp(level + slope * np.log(wanted)))

    def stiffness_at(self, speed: float) -> float:
        """Extend the line in the same way to a speed.

        Args:
            speed: [rev/min].

        Returns:
            Support stiffness [N/m]; NaN if fewer than two crests are known.
        """
        slope, level = self._straight()
        return float(np.exp((np.log(speed) - level) / slope))

    def between(self, stiffness: float) -> float:
        """Interpolate between the rows next to a stiffness, in logarithms.

        Args:
            stiffness: Support stiffness [N/m].

        Returns:
            Speed of the crest [rev/min]; NaN where a row next to it lacks the crest.
        """
        x = np.log(self.stiffness)
        above = min(max(int(np.searchsorted(x, np.log(stiffness))), 1), len(x) - 1)
        near = slice(above - 1, above + 1)
        if not x[near][0] <= np.log(stiffness) <= x[near][1]:
            return float("nan")
        return float(np.exp(np.interp(np.log(stiffness), x[near], np.log(self.speed[near]))))

    def _straight(self) -> tuple[float, float]:
        """Fit a straight line in logarithms: slope and level, NaN without two crests."""
        known = np.isfinite(self.speed)
        if np.count_nonzero(known) < 2:
            return float("nan"), float("nan")
        slope, level = np.polyfit(np.log(self.stiffness[known]), np.log(self.speed[known]), 1)
        return float(slope), float(level)


def crest_line(
    stiffness: ArrayLike,
    speed: ArrayLike,
    amplitude: ArrayLike,
    regular: ArrayLike,
    *,
    start: tuple[float, float],
    highest: float,
) -> CrestLine:
    """Follow the crest from row to row.

    Args:
        stiffness: Support stiffnesses [N/m], ascending, shape (m,).
        speed: Rotating speeds [rev/min], ascending, shape (n,).
        amplitude: Amplitudes, NaN where there is none, shape (m, n).
        regular: True where the motion is periodic, shape (m, n).
        start: Stiffness [N/m] and speed [rev/min] near which the crest is looked for first.
        highest: Speed [rev/min] beyond which it is not followed.

    Returns:
        The crest in every row, NaN throughout if there is none near the start.
    """
    rows, x = np.asarray(stiffness, dtype=float), np.asarray(speed, dtype=float)
    y, mask = np.asarray(amplitude, dtype=float), np.asarray(regular, dtype=bool)
    low = x <= highest
    line = CrestLine(rows, np.full(rows.shape, np.nan), np.full(rows.shape, np.nan))

    def peaks(row: int) -> list[Peak]:
        branches = find_branches(x[low], y[row, low], mask[row, low])
        return find_peaks(x[low], y[row, low], branches=branches)

    first = int(np.argmin(np.abs(np.log(rows / start[0]))))
    seed = _nearest(peaks(first), start[1], START_WITHIN)
    if seed is None:
        return line
    line.speed[first], line.height[first] = seed.speed, seed.height
    for order in (range(first + 1, len(rows)), range(first - 1, -1, -1)):
        known = [(np.log(rows[first]), np.log(seed.speed))]
        followed = [first]
        lost = 0
        for row in order:
            foretold = float(np.exp(_foretell(known, float(np.log(rows[row])))))
            crests = peaks(row) if foretold < highest else []
            found = _nearest(crests, foretold, FOLLOW_WITHIN) or _between(
                crests, float(np.exp(known[-1][1])), foretold
            )
            if found is None:
                lost += 1
                if lost > LOOSE:
                    break
                continue
            lost = 0
            line.speed[row], line.height[row] = found.speed, found.height
            known.append((np.log(rows[row]), np.log(found.speed)))
            followed.append(row)
        merged = followed[_straight(known) :]
        line.speed[merged], line.height[merged] = np.nan, np.nan
    return line


def _foretell(known: list[tuple[float, float]], at: float) -> float:
    """Extend the last crests by a straight line."""
    if len(known) < REMEMBER:
        return known[-1][1] + START_SLOPE * (at - known[-1][0])
    x, y = np.transpose(known[-REMEMBER:])
    level = np.polyfit(x - at, y, 1)[1]
    return float(level)


def _between(peaks: list[Peak], last: float, foretold: float) -> Peak | None:
    """Return the peak nearest to the foretold speed that lags behind it: the line may bend."""
    low, high = min(last, foretold), max(last, foretold)
    lagging = [peak for peak in peaks if low <= peak.speed <= high]
    return min(lagging, key=lambda peak: abs(peak.speed - foretold)) if lagging else None


def _straight(known: list[tuple[float, float]]) -> int:
    """Count the crests before the line bends for good: slopes too small twice in a row."""
    if len(known) < REMEMBER:
        return len(known)
    x, y = np.transpose(known)
    flat = np.gradient(y, x) < BENT * START_SLOPE
    bends = np.flatnonzero(flat[1:-1] & flat[2:]) + 1
    return int(bends[0]) if bends.size else len(known)


def _nearest(peaks: list[Peak], speed: float, within: float) -> Peak | None:
    """Return the peak nearest to a speed, if it is near enough."""
    near = [peak for peak in peaks if abs(peak.speed / speed - 1) <= within]
    return min(near, key=lambda peak: abs(peak.speed - speed)) if near else None
