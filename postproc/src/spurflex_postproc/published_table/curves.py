"""Rows on figure 2: peaks and jumps of the amplitude-frequency curves."""

import xarray as xr

from spurflex_postproc.features import compare
from spurflex_postproc.features.curve import CurveFeatures, curve_features
from spurflex_postproc.published import published_curve, tolerance
from spurflex_postproc.published_table.row import Row, number, statement

PEAKS_WITHIN = 0.06
"""Largest distance of a computed peak from its published partner, as a fraction."""
JUMPS_WITHIN = 0.06
"""The same for jumps."""
SIMILAR = 0.20
"""Smallest height of a peak that counts as significant, as a fraction of the highest one below
the first jump on the rigid support."""


def curve_rows(result: xr.Dataset) -> list[Row]:
    """Compare the curves of one result with figure 2.

    Args:
        result: A dataset from `open_result` with both supports and one stiffness.

    Returns:
        A row for every published peak and jump, and for the statements on their number.
    """
    rows = []
    for support in ("rigid", "flexible"):
        found = curve_features(result, support)
        rows += _peaks(found, support) + _jumps(found, support)
    return rows + _statements(result)


def _peaks(found: CurveFeatures, support: str) -> list[Row]:
    """Compare the peaks."""
    told = published_curve(support).peaks
    pairs = compare(told, [peak.speed for peak in found.peaks], within=PEAKS_WITHIN).pairs
    return [
        number(
            f"figure 2 {support} peak {speed:.0f}",
            "2",
            f"{support} support: peak",
            speed,
            there,
            tolerance("peak"),
        )
        for speed, there in pairs
    ]


def _jumps(found: CurveFeatures, support: str) -> list[Row]:
    """Compare the jumps; a note says what changes at each besides the amplitude."""
    told = published_curve(support).jumps
    jumps = {jump.speed: jump for jump in found.branches.jumps}
    pairs = compare(told, list(jumps), within=JUMPS_WITHIN).pairs
    rows = []
    for speed, there in pairs:
        first = support == "rigid" and speed == told[0]
        rows.append(
            number(
                f"figure 2 {support} jump {speed:.0f}",
                "2",
                f"{support} support: jump",
                speed,
                there,
                tolerance("first_jump" if first else "jump"),
                note="" if there is None else found.jump_identity(jumps[there]),
            )
        )
    return rows


def _statements(result: xr.Dataset) -> list[Row]:
    """Check the statements on the number of peaks and on the shift by the support."""
    rigid, flexible = (curve_features(result, support) for support in ("rigid", "flexible"))
    limit = published_curve("rigid").jumps[0] * 0.97
    low = [peak for peak in rigid.peaks if peak.speed < limit]
    highest = max((peak.height for peak in low), default=0.0)
    large = [peak for peak in low if peak.height > SIMILAR * highest]
    soft = [peak for peak in flexible.peaks if peak.speed < limit]
    first, *others = published_curve("flexible").peaks
    extra = compare([first], [peak.speed for peak in soft], within=PEAKS_WITHIN).pairs[0][1]
    pairs = [
        compare([speed], [peak.speed for peak in peaks], within=PEAKS_WITHIN).pairs[0][1]
        for told, peaks in ((published_curve("rigid").peaks, low), (others, soft))
        for speed in told
    ]
    here, there = pairs[: len(pairs) // 2], pairs[len(pairs) // 2 :]
    shifts = [
        b / a - 1 for a, b in zip(here, there, strict=True) if a is not None and b is not None
    ]
    return [
        statement(
            "figure 2 rigid two peaks",
            "2",
            "rigid support: significant peaks below the first jump",
            "two",
            ", ".join(f"{peak.speed:.0f}" for peak in large) or "none",
            len(large) == 2,
            f"significant: above {100 * SIMILAR:.0f} % of the highest",
        ),
        statement(
            "figure 2 flexible extra peak",
            "2",
            "flexible support: one more peak at low speed",
            "yes",
            "none" if extra is None else f"{extra:.0f} rev/min",
            extra is not None,
        ),
        statement(
            "figure 2 shift",
            "2",
            "flexible support: the other two peaks lie slightly higher than the rigid ones",
            "yes",
            ", ".join(f"{100 * shift:+z.1f} %" for shift in shifts) or "no pair of peaks",
            len(shifts) == len(others) and all(0 < shift < 0.2 for shift in shifts),
        ),
    ]
