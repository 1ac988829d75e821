"""Areas of one sign in a map, as of the change of the bearing deformation by the support."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Reals = NDArray[np.float64]

NEAR_ZERO = 0.5
"""Magnitude below which a value has no sign, in the unit of the map (percent for eta)."""
SMALLEST = 0.002
"""Smallest area that counts, as a fraction of the cells of the map."""
STIFF = 0.05
"""Largest share of cells away from zero in a row that counts as near zero throughout."""


@dataclass(frozen=True)
class Area:
    """A connected part of the map with one sign.

    Attributes:
        sign: +1 or -1.
        cells: Rows and columns of its cells, shape (2, n).
        share: Cells as a fraction of the map.
        speed: Median of the speeds of its cells, weighted by the magnitude [rev/min].
        stiffness: Median of the stiffnesses of its cells [N/m].
        extreme: Value of largest magnitude, in the unit of the map.
        mean: Mean value, in the unit of the map.
    """

    sign: int
    cells: NDArray[np.intp]
    share: float
    speed: float
    stiffness: float
    extreme: float
    mean: float


def signed_areas(
    stiffness: ArrayLike,
    speed: ArrayLike,
    values: ArrayLike,
    *,
    near_zero: float = NEAR_ZERO,
    smallest: float = SMALLEST,
) -> list[Area]:
    """Find the connected areas of one sign.

    Args:
        stiffness: Support stiffnesses [N/m], shape (m,).
        speed: Rotating speeds [rev/min], shape (n,).
        values: The map, NaN where there is no value, shape (m, n).
        near_zero: Magnitude below which a value has no sign.
        smallest: Smallest area, as a fraction of the cells.

    Returns:
        The areas in order of their speed. Cells that touch along a side are connected; a line
        one speed wide, as a jump that moves by a grid step leaves it, does not part an area.

    Raises:
        ValueError: If the shapes do not fit.
    """
    rows, x = np.asarray(stiffness, dtype=float), np.asarray(speed, dtype=float)
    map_ = np.asarray(values, dtype=float)
    if map_.shape != (len(rows), len(x)):
        raise ValueError("values do not fit stiffness and speed")
    smooth = _without_lines(np.nan_to_num(map_))
    areas = []
    for sign in (1, -1):
        label = connected(sign * smooth > near_zero)
        counts = np.bincount(label.ravel())
        for name in np.flatnonzero(counts >= smallest * map_.size):
            if name == 0:
                continue
            cells = np.asarray(np.nonzero(label == name))
            inside = smooth[cells[0], cells[1]]
            areas.append(
                Area(
                    sign=sign,
                    cells=cells,
                    share=inside.size / map_.size,
                    speed=_weighted_median(x[cells[1]], np.abs(inside)),
                    stiffness=float(np.exp(np.median(np.log(rows[cells[0]])))),
                    extreme=float(inside[np.argmax(np.abs(inside))]),
                    mean=float(inside.mean()),
                )
            )
    return sorted(areas, key=lambda area: area.speed)


def connected(mask: ArrayLike) -> NDArray[np.int64]:
    """Number the connected parts of a mask.

    Args:
        mask: True inside, shape (m, n).

    Returns:
        0 outside, 1, 2, ... inside, shape (m, n). Cells that touch along a side are connected.
    """
    inside = np.asarray(mask, dtype=bool)
    label = np.zeros(inside.shape, dtype=np.int64)
    count = 0
    for start in zip(*np.nonzero(inside), strict=True):
        if label[start]:
            continue
        count += 1
        label[start] = count
        waiting = [start]
        while waiting:
            row, column = waiting.pop()
            for there in (
                (row - 1, column),
                (row + 1, column),
                (row, column - 1),
                (row, column + 1),
            ):
                within = 0 <= there[0] < inside.shape[0] and 0 <= there[1] < inside.shape[1]
                if within and inside[there] and not label[there]:
                    label[there] = count
                    waiting.append(there)
    return label


def lettered(areas: list[Area], signs: dict[str, str]) -> dict[str, Area]:
    """Give areas the letters of a published sequence of signs.

    Of all choices of areas in order of speed whose signs are those of the letters, the one that
    covers most of the map is taken. Where no such choice exists, letters are dropped from the
    end.

    Args:
        areas: The areas in order of speed.
        signs: Letter and sign ('+' or '-'), in order of speed; others are left out.

    Returns:
        Letter and area.
    """
    wanted = [(letter, 1 if sign == "+" else -1) for letter, sign in signs.items() if sign in "+-"]
    for count in range(len(wanted), 0, -1):
        found = _largest_choice(areas, wanted[:count])
        if found:
            return found
    return {}


def _largest_choice(areas: list[Area], wanted: list[tuple[str, int]]) -> dict[str, Area]:
    """Choose an area for every letter, in order, with the largest sum of shares."""
    best: list[tuple[float, list[int]] | None] = [(0.0, [])] + [None] * len(wanted)
    for at, area in enumerate(areas):
        for count in range(len(wanted), 0, -1):
            before = best[count - 1]
            if before is None or area.sign != wanted[count - 1][1]:
                continue
            total = before[0] + area.share
            known = best[count]
            if known is None or total > known[0]:
                best[count] = (total, [*before[1], at])
    last = best[-1]
    if last is None:
        return {}
    return {letter: areas[at] for (letter, _), at in zip(wanted, last[1], strict=True)}


def stiff_border(
    stiffness: ArrayLike, values: ArrayLike, *, near_zero: float = NEAR_ZERO, share: float = STIFF
) -> float:
    """Return the stiffness from which on the map is near zero.

    Args:
        stiffness: Support stiffnesses [N/m], ascending, shape (m,).
        values: The map, NaN where there is no value, shape (m, n).
        near_zero: Magnitude below which a value is near zero.
        share: Largest share of other cells in a row.

    Returns:
        The lowest stiffness from which every row is near zero [N/m]; NaN if not even the
        stiffest row is.
    """
    rows, map_ = np.asarray(stiffness, dtype=float), np.asarray(values, dtype=float)
    known = np.maximum(np.isfinite(map_).sum(axis=1), 1)
    away = (np.abs(np.nan_to_num(map_)) > near_zero).sum(axis=1) / known > share
    first = int(np.flatnonzero(away)[-1]) + 1 if away.any() else 0
    return float(rows[first]) if first < len(rows) else float("nan")


def _without_lines(values: Reals) -> Reals:
    """Replace each value by the median of itself and its neighbours in speed; shape (m, n)."""
    if values.shape[1] < 3:
        return values
    inner = np.median([values[:, :-2], values[:, 1:-1], values[:, 2:]], axis=0)
    return np.concatenate([values[:, :1], inner, values[:, -1:]], axis=1)


def _weighted_median(values: Reals, weights: Reals) -> float:
    """Return the value at which half of the weight is reached."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])
