"""How far computed features are from the published ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from spurflex_postproc.features.curve import CurveFeatures, curve_features
from spurflex_postproc.features.regimes import match_borders
from spurflex_postproc.published import published_curve, published_regimes, tolerance

ABSENT = 0.10
"""Deviation that stands for a feature that is absent, and the largest that counts."""
PEAK_WITHIN = 0.10
"""Largest distance of a peak from the published one, as a fraction."""
JUMP_WITHIN = 0.20
"""The same for the first jump."""


@dataclass(frozen=True)
class Feature:
    """One published feature and what was computed for it.

    Attributes:
        name: For the report.
        published: Speed [rev/min].
        computed: Speed [rev/min]; None if there is no such feature.
        allowed: Deviation that counts as agreement, as a fraction.
        partial: Whether it is a border of which only one side was found.
    """

    name: str
    published: float
    computed: float | None
    allowed: float
    partial: bool = False

    @property
    def deviation(self) -> float | None:
        """Deviation as a fraction of the published speed; None if the feature is absent."""
        return None if self.computed is None else self.computed / self.published - 1

    @property
    def agrees(self) -> bool:
        """Whether the feature is there and deviates little enough."""
        if self.deviation is None or self.partial:
            return False
        return abs(self.deviation) <= self.allowed

    @property
    def regular(self) -> bool:
        """Whether it is a peak, the first jump, or the border from 1T to 2T motion.

        The other borders are those of irregular and of 3T motion, which depend on the start and
        on the step as much as on the parameters.
        """
        return "chaotic" not in self.name and "3T" not in self.name

    @property
    def penalty(self) -> float:
        """The size of the deviation in units of the allowed one.

        It is at most that of `ABSENT`, and at least half of it where one side is missing.
        """
        if self.deviation is None:
            return ABSENT / self.allowed
        least = ABSENT / 2 if self.partial else 0.0
        return min(max(abs(self.deviation), least), ABSENT) / self.allowed


def curve_misfit(result: xr.Dataset, support: str, *, peaks_only: bool = False) -> list[Feature]:
    """Compare one curve with the published one.

    Args:
        result: A dataset from `open_result` with one support stiffness.
        support: 'rigid' or 'flexible'.
        peaks_only: Whether the speeds end below the jump.

    Returns:
        Peaks, and unless `peaks_only` the first jump (rigid) and the borders of the regimes.
    """
    found = curve_features(result, support)
    told = published_curve(support)
    features = [
        Feature(
            f"{support} peak",
            speed,
            _nearest([peak.speed for peak in found.peaks], speed, PEAK_WITHIN),
            tolerance("peak"),
        )
        for speed in told.peaks
    ]
    if peaks_only:
        return features
    if support == "rigid":
        features.append(first_jump(found))
    features += [
        Feature(
            f"{support} {border.before} | {border.after}",
            border.published,
            border.computed,
            tolerance("boundary"),
            partial=not border.complete,
        )
        for border in match_borders(found.regimes, published_regimes(support))
    ]
    return features


def first_jump(found: CurveFeatures) -> Feature:
    """Compare the first jump above the peaks of the rigid curve with the published one."""
    wanted = published_curve("rigid").jumps[0]
    speeds = [jump.speed for jump in found.branches.jumps]
    return Feature(
        "rigid first jump", wanted, _nearest(speeds, wanted, JUMP_WITHIN), tolerance("first_jump")
    )


def misfit(features: Sequence[Feature]) -> float:
    """Return the root mean square of the penalties; 1 is an average deviation just allowed."""
    return float(np.sqrt(np.mean([feature.penalty**2 for feature in features])))


def _nearest(speeds: Sequence[float], wanted: float, within: float) -> float | None:
    """Return the speed nearest to one wanted; None if none is near enough."""
    near = [speed for speed in speeds if abs(speed / wanted - 1) <= within]
    return min(near, key=lambda speed: abs(speed - wanted)) if near else None
