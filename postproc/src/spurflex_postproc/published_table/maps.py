"""Rows on figure 9: crests and the effect of the support stiffness on the amplitude."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from spurflex_postproc.features import CrestLine, compare, crest_line, find_peaks
from spurflex_postproc.flags import is_regular
from spurflex_postproc.layout import SPEED, STIFFNESS
from spurflex_postproc.published import PAPER_STIFFNESS, PublishedMap, published_map, tolerance
from spurflex_postproc.published_table.row import Row, number, statement

Reals = NDArray[np.float64]

WITHIN = 0.06
"""Largest distance of a crest from its published partner, as a fraction."""
LITTLE = 0.05
"""Spread over the stiffness that counts as little effect, as a fraction."""
EVIDENT = 0.20
"""Spread over the stiffness that counts as an evident effect, as a fraction."""
FALLING = 0.8
"""Share of the steps along the crest line in which the crest has to fall."""
IRREGULAR_SHARE = 0.10
"""Share of the speeds at which the spread has to be evident for an irregular effect."""


@dataclass(frozen=True)
class StiffnessMap:
    """A map of the result file.

    Attributes:
        stiffness: Support stiffnesses [N/m], shape (m,).
        speed: Rotating speeds [rev/min], shape (n,).
        values: The map, NaN where there is none, shape (m, n).
        rigid: The same on the rigid support, shape (n,); NaN if it is not in the file.
        regular: True where the motion is periodic, shape (m, n).
    """

    stiffness: Reals
    speed: Reals
    values: Reals
    rigid: Reals
    regular: NDArray[np.bool_]

    def row(self, stiffness: float) -> int:
        """Return the row nearest to a stiffness [N/m], by ratio."""
        return int(np.argmin(np.abs(np.log(self.stiffness / stiffness))))

    def between(self, first: float, last: float) -> NDArray[np.bool_]:
        """Mark the speeds of a range [rev/min], shape (n,)."""
        return (self.speed >= first) & (self.speed <= last)

    def spread(self) -> Reals:
        """Return how much the values vary with the stiffness at each speed, shape (n,).

        It is the range from the 5th to the 95th percentile relative to the median.
        """
        known = np.isfinite(self.values).any(axis=0)
        spread = np.full(self.speed.shape, np.nan)
        low, middle, high = np.nanpercentile(self.values[:, known], (5, 50, 95), axis=0)
        spread[known] = (high - low) / middle
        return spread


def stiffness_map(result: xr.Dataset, name: str) -> StiffnessMap:
    """Take a variable out of a result.

    Args:
        result: A dataset from `open_result`.
        name: A variable on (support_stiffness, speed).

    Returns:
        The map.
    """
    values = np.asarray(result[name].values, dtype=float)
    rigid = result.get(f"rigid_{name}")
    return StiffnessMap(
        np.asarray(result[STIFFNESS].values, dtype=float),
        np.asarray(result[SPEED].values, dtype=float),
        values,
        np.full(values.shape[1], np.nan) if rigid is None else np.asarray(rigid.values),
        is_regular(result["status"].values, result["motion"].values),
    )


def follow_crest(map_: StiffnessMap, told: PublishedMap) -> CrestLine:
    """Follow the crest of the soft support from where the article first meets it."""
    return crest_line(
        map_.stiffness,
        map_.speed,
        map_.values,
        map_.regular,
        start=(PAPER_STIFFNESS, told.crest),
        highest=told.flat[0],
    )


def map_rows(result: xr.Dataset) -> list[Row]:
    """Compare the map of the amplitude with figure 9.

    Args:
        result: A dataset from `open_result` with both supports over speed and stiffness.

    Returns:
        A row for every crest and statement.
    """
    map_ = stiffness_map(result, "y1_amplitude")
    told = published_map()
    line = follow_crest(map_, told)
    return [*_crests(map_, line, told), *_line(map_, line), *_effects(map_, told), _limit(map_)]


def _crests(map_: StiffnessMap, line: CrestLine, told: PublishedMap) -> list[Row]:
    """Compare the crests at the published stiffness and with a stiff support."""
    row = map_.row(PAPER_STIFFNESS)
    start = line.between(PAPER_STIFFNESS)
    at = f"{map_.stiffness[row]:.3g} N/m"
    rows = [
        number(
            "figure 9 crest",
            "9",
            "crest of the soft support where it is first seen",
            told.crest,
            start if np.isfinite(start) else None,
            tolerance("peak"),
            note=f"at {PAPER_STIFFNESS:.3g} N/m, between the rows of the map",
        )
    ]
    for side, speeds, here, where in (
        ("below", told.crests_below, row, at),
        ("above", told.crests_above, len(map_.stiffness) - 1, f"{map_.stiffness[-1]:.2g} N/m"),
    ):
        found = [_near(map_, here, speed) for speed in speeds]
        limit = [_near(map_, 0, speed) for speed in speeds] if side == "below" else []
        for place, (speed, there) in enumerate(zip(speeds, found, strict=True)):
            softest = limit[place] if limit else None
            rows.append(
                number(
                    f"figure 9 crest {side} {speed:.0f}",
                    "9",
                    f"crest {side} the line",
                    speed,
                    there,
                    tolerance("peak"),
                    note=f"at {where}"
                    + (f"; {softest:.0f} with the softest support" if softest else ""),
                )
            )
    return rows


def _near(map_: StiffnessMap, row: int, wanted: float) -> float | None:
    """Return the peak of a row nearest to a speed [rev/min]."""
    low = map_.speed < published_map().flat[0]
    peaks = find_peaks(map_.speed[low], map_.values[row, low], map_.regular[row, low])
    return compare([wanted], [peak.speed for peak in peaks], within=WITHIN).pairs[0][1]


def _line(map_: StiffnessMap, line: CrestLine) -> list[Row]:
    """Check that the crest rises in speed and falls in height as the support stiffens."""
    known = np.flatnonzero(np.isfinite(line.speed))
    if known.size < 3:
        return [
            statement(f"figure 9 line {name}", "9", f"crest line: {words}", "yes", "no line", False)
            for name, words in (("moves", "moves to higher speed"), ("falls", "falls"))
        ]
    speed, height = line.speed[known], 1e6 * line.height[known]
    ends = line.stiffness[known[0]], line.stiffness[known[-1]]
    falls = float(np.mean(np.diff(height) < 0))
    ratio = height / (1e6 * np.interp(speed, map_.speed, map_.rigid))
    return [
        statement(
            "figure 9 line moves",
            "9",
            "crest line: the crest moves to higher speed as the support stiffens",
            "yes",
            f"{speed[0]:.0f} to {speed[-1]:.0f} rev/min",
            bool(np.all(np.diff(speed) > 0)),
            f"from {ends[0]:.2g} to {ends[1]:.2g} N/m",
        ),
        statement(
            "figure 9 line falls",
            "9",
            "crest line: the crest falls as the support stiffens",
            "yes",
            f"{height[0]:.2f} to {height[-1]:.2f} um",
            falls >= FALLING and height[-1] < height[0],
            f"falls in {100 * falls:.0f} % of the steps; over the rigid curve"
            f" {ratio[0]:.1f} to {ratio[-1]:.1f} times",
        ),
    ]


def _effects(map_: StiffnessMap, told: PublishedMap) -> list[Row]:
    """Check where the stiffness matters."""
    spread = map_.spread()
    rows = []
    for key, words, first, last in (
        ("evident", "evident", float(map_.speed[0]), told.flat[0]),
        ("little", "little", *told.flat),
        ("irregular", "irregular", told.irregular_above, float(map_.speed[-1])),
    ):
        inside = spread[map_.between(first, last) & np.isfinite(spread)]
        if not inside.size:
            continue
        typical, largest = float(np.median(inside)), float(inside.max())
        share = float(np.mean(inside > EVIDENT))
        agrees = {
            "evident": typical > EVIDENT,
            "little": largest < LITTLE,
            "irregular": typical < EVIDENT and share > IRREGULAR_SHARE,
        }[key]
        rows.append(
            statement(
                f"figure 9 {key}",
                "9",
                f"effect of the support stiffness from {first:.0f} to {last:.0f} rev/min",
                words,
                f"{100 * typical:.0f} % typically, {100 * largest:.0f} % at most",
                agrees,
                f"more than {100 * EVIDENT:.0f} % at {100 * share:.0f} % of the speeds",
            )
        )
    return rows


def _limit(map_: StiffnessMap) -> Row:
    """Check that a stiff support gives the rigid curve."""
    off = np.abs(map_.values[[0, -1]] / map_.rigid - 1)
    soft, stiff = np.nanmedian(off, axis=1) if np.isfinite(off).any() else (np.nan, np.nan)
    return statement(
        "figure 9 limit",
        "9",
        "with a stiff support the response resembles that on the rigid support",
        "yes",
        f"median difference {100 * stiff:.2g} %",
        bool(stiff < LITTLE),
        f"{100 * soft:.2g} % with the softest support",
    )
