"""Splits an amplitude-frequency curve into smooth branches, at jumps and irregular bands.

A step between two neighbouring speeds is a jump when neither side foresees it. Each side
predicts the step by running a line and a parabola through its own last points; on a smooth
curve, however steep, the step lies among these predictions or close to them. What lies beyond
them is the unforeseen part of the step. It must be most of the step, visible against the
amplitude, and far above the error of the forecasts nearby.
"""

import warnings
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Reals = NDArray[np.float64]
Flags = NDArray[np.bool_]

SHORTEST_BAND = 3
"""Irregular points in a row that make a band; fewer are left out as single misfits."""
SHORTEST_BRANCH = 3
"""Points that a branch needs; fewer between two jumps are left out as misfits."""
WIDEST_GAP = 4.5
"""Widest step across which a jump is judged, in typical steps of the curve."""
VISIBLE = 0.05
"""Smallest unforeseen part of a jump, as a fraction of the larger amplitude beside it."""
MOST = 0.5
"""Smallest unforeseen part of a jump, as a fraction of the step."""
ABOVE_NOISE = 4.0
"""Smallest unforeseen part of a jump, in typical errors of neighbouring forecasts."""
NEIGHBOURS = 7
"""Neighbouring steps on each side that set what is typical."""


@dataclass(frozen=True)
class Jump:
    """A step of the response between two neighbouring speeds.

    Attributes:
        speed: Middle of the interval of the step [rev/min].
        first: Last speed before the step [rev/min].
        last: First speed behind it [rev/min].
        before: Amplitude at `first`, in the unit of the curve.
        after: Amplitude at `last`.
        kind: 'branch' between two smooth branches, 'edge' at the border of an irregular band.
    """

    speed: float
    first: float
    last: float
    before: float
    after: float
    kind: Literal["branch", "edge"]


@dataclass(frozen=True)
class Branches:
    """A curve split into smooth branches.

    Attributes:
        segments: Positions in the curve of the points of each branch, in order of speed.
        jumps: The jumps, in order of speed.
        bands: First and last speed of each irregular band [rev/min].
    """

    segments: list[NDArray[np.intp]] = field(default_factory=list)
    jumps: list[Jump] = field(default_factory=list)
    bands: list[tuple[float, float]] = field(default_factory=list)


def find_branches(
    speed: ArrayLike, amplitude: ArrayLike, regular: ArrayLike | None = None
) -> Branches:
    """Split a curve into smooth branches.

    Args:
        speed: Rotating speeds [rev/min], ascending, shape (n,).
        amplitude: Amplitudes, any unit, NaN where there is none, shape (n,).
        regular: True where the motion is periodic, shape (n,); everywhere if absent. Single
            points that are not are left out, several in a row make an irregular band.

    Returns:
        Branches, jumps and bands.

    Raises:
        ValueError: If the shapes differ or the speeds do not ascend.
    """
    x, y = np.asarray(speed, dtype=float), np.asarray(amplitude, dtype=float)
    mask = np.ones(x.shape, dtype=bool) if regular is None else np.asarray(regular, dtype=bool)
    if x.ndim != 1 or not x.shape == y.shape == mask.shape:
        raise ValueError("speed, amplitude and regular differ in shape")
    if np.any(np.diff(x) <= 0):
        raise ValueError("speed does not ascend")
    index = np.flatnonzero(np.isfinite(y))
    runs = [run for run in _runs(index, mask[index]) if not mask[run[0]]]
    band = np.zeros(x.shape, dtype=bool)
    for run in runs:
        band[run] = len(run) >= SHORTEST_BAND
    index = index[mask[index] | band[index]]
    while True:
        broken = _breaks(x[index], y[index], band[index])
        short = _short(broken, band[index])
        if not short.any():
            break
        index = index[~short]
    return Branches(
        segments=_segments(index, broken, band[index]),
        jumps=[_jump(x, y, band, index, int(at)) for at in np.flatnonzero(broken)],
        bands=[(float(x[run[0]]), float(x[run[-1]])) for run in runs if band[run[0]]],
    )


def _runs(index: NDArray[np.intp], label: Flags) -> list[NDArray[np.intp]]:
    """Cut positions into runs of equal label."""
    return [run for run in np.split(index, np.flatnonzero(np.diff(label)) + 1) if len(run)]


def _breaks(x: Reals, y: Reals, band: Flags) -> Flags:
    """Mark the steps that are jumps, the clearest first, since each hides its neighbours."""
    broken = np.zeros(max(len(x) - 1, 0), dtype=bool)
    if len(x) < 4:
        return broken
    while True:
        score = _score(x, y, band, broken)
        best = int(np.argmax(score))
        if score[best] <= 0.0:
            return broken
        broken[best] = True


def _score(x: Reals, y: Reals, band: Flags, broken: Flags) -> Reals:
    """Rate each step: its unforeseen part where it is a jump, 0 elsewhere; shape (n-1,)."""
    near = np.diff(x) <= WIDEST_GAP * np.median(np.diff(x))
    linked = near & ~broken & ~band[:-1] & ~band[1:]
    open_ = near & ~broken & ~(band[:-1] & band[1:])
    step = _steps(y, band)
    forecasts = np.vstack(
        [_forecasts(x, y, linked), -_forecasts(-x[::-1], y[::-1], linked[::-1])[:, ::-1]]
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # steps without any forecast
        low, high = np.nanmin(forecasts, axis=0), np.nanmax(forecasts, axis=0)
    unforeseen = np.fmax(np.fmax(low - step, step - high), 0.0)
    unforeseen[np.isnan(low)] = 0.0
    largest = np.maximum(np.abs(y[:-1]), np.abs(y[1:]))
    jumps = open_ & (unforeseen > VISIBLE * largest) & (unforeseen > MOST * np.abs(step))
    error = np.abs(step - forecasts[1])
    for at in map(int, np.flatnonzero(jumps)):
        jumps[at] = unforeseen[at] > ABOVE_NOISE * _typical(error, linked, at)
    return np.where(jumps, unforeseen, 0.0)


def _steps(y: Reals, band: Flags) -> Reals:
    """Return the steps of the curve; at the border of a band, to the level of the band."""
    step = np.diff(y)
    for at in np.flatnonzero(band[1:] & ~band[:-1]):
        inside = y[at + 1 : at + 1 + SHORTEST_BAND]
        step[at] = np.median(inside) - y[at]
    for at in np.flatnonzero(band[:-1] & ~band[1:]):
        inside = y[max(at + 1 - SHORTEST_BAND, 0) : at + 1]
        step[at] = y[at + 1] - np.median(inside)
    return step


def _forecasts(x: Reals, y: Reals, linked: Flags) -> Reals:
    """Predict each step from the points before it: by a line, by a parabola; shape (2, n-1)."""
    forecasts = np.full((2, len(x) - 1), np.nan)
    slope = np.diff(y) / np.diff(x)
    line = slope[:-1] * np.diff(x)[1:]
    known = linked[:-1]
    forecasts[0, 1:][known] = line[known]
    curvature = np.diff(slope) / (x[2:] - x[:-2])
    bend = curvature[:-1] * (x[3:] - x[2:-1]) * (x[3:] - x[1:-2])
    known = linked[:-2] & linked[1:-1]
    forecasts[1, 2:][known] = (line[1:] + bend)[known]
    return forecasts


def _typical(error: Reals, linked: Flags, at: int) -> float:
    """Return the median error of the forecasts of the smooth steps around one step."""
    around = np.arange(max(at - NEIGHBOURS, 0), min(at + NEIGHBOURS + 1, len(linked)))
    known = error[around[(around != at) & linked[around]]]
    known = known[np.isfinite(known)]
    return float(np.median(known)) if known.size else 0.0


def _short(broken: Flags, band: Flags) -> Flags:
    """Mark the points of branches too short to be one, next to a jump."""
    short = np.zeros(band.shape, dtype=bool)
    for run in _segments(np.arange(len(band)), broken, band):
        before, after = run[0] - 1, run[-1]
        beside_jump = (before >= 0 and broken[before]) or (after < len(broken) and broken[after])
        short[run] = len(run) < SHORTEST_BRANCH and beside_jump
    return short


def _segments(index: NDArray[np.intp], broken: Flags, band: Flags) -> list[NDArray[np.intp]]:
    """Cut positions at jumps and at the borders of bands; keep what is outside of bands."""
    if not len(index):
        return []
    cuts = np.flatnonzero(broken | (band[1:] != band[:-1])) + 1
    parts = zip(np.split(index, cuts), np.split(band, cuts), strict=True)
    return [part for part, inside in parts if not inside[0]]


def _jump(x: Reals, y: Reals, band: Flags, index: NDArray[np.intp], at: int) -> Jump:
    """Describe the jump at one step; at the border of a band, where its level is reached.

    The outermost points of a band may still lie on the branch beside it.
    """
    before, after = index[at], index[at + 1]
    if band[after] and not band[before]:
        first = index[at + 1 : at + 1 + SHORTEST_BAND]
        inside = _reached(y[first], y[before])
        before, after = index[at + inside], index[at + 1 + inside]
    elif band[before] and not band[after]:
        last = index[max(at + 1 - SHORTEST_BAND, 0) : at + 1][::-1]
        inside = _reached(y[last], y[after])
        before, after = index[at - inside], index[at + 1 - inside]
    return Jump(
        speed=float(x[before] + x[after]) / 2,
        first=float(x[before]),
        last=float(x[after]),
        before=float(y[before]),
        after=float(y[after]),
        kind="edge" if band[before] or band[after] else "branch",
    )


def _reached(y: Reals, outside: float) -> int:
    """Return the first of the outermost points of a band that lies nearer to its level."""
    level = float(np.median(y))
    return int(np.flatnonzero(np.abs(y - level) <= np.abs(y - outside))[0])
