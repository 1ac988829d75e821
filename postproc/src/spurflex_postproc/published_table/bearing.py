"""Rows on figure 10: bearing deformation of the driving gear and its change eta."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from spurflex_postproc.features import (
    compare,
    curve_features,
    find_branches,
    find_peaks,
    lettered,
    signed_areas,
    stiff_border,
)
from spurflex_postproc.flags import is_regular
from spurflex_postproc.published import published_areas, published_map
from spurflex_postproc.published_table.maps import StiffnessMap, follow_crest, stiffness_map
from spurflex_postproc.published_table.row import Row, statement

Reals = NDArray[np.float64]

ALIKE = 0.8
"""Rank correlation from which two curves or maps count as similar."""
NEAR_ZERO = 1.0
"""Magnitude of eta that counts as near zero [percent]."""
STIFF = 1.0e11
"""Support stiffness from which on eta is looked at in area A [N/m]."""


def bearing_rows(result: xr.Dataset) -> list[Row]:
    """Compare bearing deformation and eta with figure 10.

    Args:
        result: A dataset from `open_result` with both supports over speed and stiffness.

    Returns:
        A row for every statement and every area.
    """
    deformation = stiffness_map(result, "bearing1_deformation_max")
    amplitude = stiffness_map(result, "y1_amplitude")
    return [
        _curve(result, deformation),
        _map(deformation, amplitude),
        _crest(deformation, amplitude),
        *_areas(result),
    ]


def _curve(result: xr.Dataset, deformation: StiffnessMap) -> Row:
    """Check that the rigid curve has the shape of that of figure 2."""
    found = curve_features(result, "rigid")
    regular = is_regular(result["rigid_status"].values, result["rigid_motion"].values)
    branches = find_branches(deformation.speed, deformation.rigid, regular)
    peaks = find_peaks(deformation.speed, deformation.rigid, branches=branches)
    told = [peak.speed for peak in found.peaks if peak.prominence > 0.2 * peak.height]
    pairs = compare(told, [peak.speed for peak in peaks], within=0.02).pairs
    shared = sum(there is not None for _, there in pairs)
    likeness = rank_correlation(found.amplitude, deformation.rigid)
    return statement(
        "figure 10 a",
        "10a",
        "rigid support: the curve of the bearing deformation resembles that of the amplitude",
        "yes",
        f"rank correlation {likeness:.2f}",
        likeness >= ALIKE,
        f"{shared} of {len(told)} prominent peaks within 2 %",
    )


def _map(deformation: StiffnessMap, amplitude: StiffnessMap) -> Row:
    """Check that the map has the shape of that of figure 9."""
    likeness = rank_correlation(amplitude.values, deformation.values)
    return statement(
        "figure 10 b map",
        "10b",
        "flexible support: the map of the bearing deformation resembles that of the amplitude",
        "yes",
        f"rank correlation {likeness:.2f}",
        likeness >= ALIKE,
    )


def _crest(deformation: StiffnessMap, amplitude: StiffnessMap) -> Row:
    """Check that the crest along the line hardly shows in the bearing deformation."""
    line = follow_crest(amplitude, published_map())
    rows = np.flatnonzero(np.isfinite(line.speed))
    heights = []
    for map_ in (amplitude, deformation):
        found = []
        for row in rows:
            peaks = find_peaks(map_.speed, map_.values[row], map_.regular[row], smallest=1e-4)
            near = [peak for peak in peaks if abs(peak.speed / line.speed[row] - 1) < 0.04]
            best = max(near, key=lambda peak: peak.prominence, default=None)
            found.append(best.prominence / best.height if best else 0.0)
        heights.append(float(np.median(found)) if found else float("nan"))
    return statement(
        "figure 10 b crest",
        "10b",
        "the crest along the line is inconspicuous in the bearing deformation",
        "yes",
        f"prominence {100 * heights[1]:.1f} % of its height",
        bool(heights[1] < 0.5 * heights[0]),
        f"{100 * heights[0]:.0f} % in the amplitude; medians along the line",
    )


def _areas(result: xr.Dataset) -> list[Row]:
    """Check the signs of eta by area, and which area holds the largest."""
    map_ = stiffness_map(result, "eta1")
    signs, largest = published_areas()
    found = lettered(signed_areas(map_.stiffness, map_.speed, map_.values), signs)
    stiff = map_.values[map_.stiffness >= STIFF]
    share = float(np.mean(np.abs(stiff[np.isfinite(stiff)]) < NEAR_ZERO)) if stiff.size else 0.0
    border = stiff_border(map_.stiffness, map_.values, near_zero=NEAR_ZERO)
    rows = [
        statement(
            "figure 10 c A",
            "10c",
            "area A (stiff support): eta near zero",
            "0",
            f"below {NEAR_ZERO:g} % at {100 * share:.0f} % of the points from {STIFF:.0e} N/m",
            share > 0.9,
            f"at 95 % of the speeds from {border:.1e} N/m" if np.isfinite(border) else "",
        )
    ]
    for letter, sign in signs.items():
        if sign not in "+-":
            continue
        area = found.get(letter)
        words = "above zero" if sign == "+" else "below zero"
        rows.append(
            statement(
                f"figure 10 c {letter}",
                "10c",
                f"area {letter}: eta {words}",
                sign,
                None if area is None else f"{area.mean:+z.1f} % on average, {area.extreme:+z.0f} %",
                area is not None,
                "no area with this sign in its place"
                if area is None
                else f"around {area.speed:.0f} rev/min, {100 * area.share:.1f} % of the map",
            )
        )
    best = max(found, key=lambda letter: found[letter].extreme, default="none")
    rows.append(
        statement(
            "figure 10 c largest",
            "10c",
            "area in which eta is largest",
            largest,
            best,
            best == largest,
            f"{found[best].extreme:+z.0f} %" if best in found else "",
        )
    )
    return [*rows, general(map_)]


def general(map_: StiffnessMap) -> Row:
    """Check that eta is generally above zero."""
    values = map_.values[np.isfinite(map_.values)]
    above, below = float(np.mean(values > 0)), float(np.mean(values < 0))
    return statement(
        "figure 10 c general",
        "10c",
        "eta is generally above zero",
        "yes",
        f"above zero at {100 * above:.0f} % of the points, below at {100 * below:.0f} %",
        above > 0.5 and float(values.mean()) > 0,
        f"mean {values.mean():+z.1f} %, median {np.median(values):+z.2f} %",
    )


def rank_correlation(one: Reals, other: Reals) -> float:
    """Return Spearman's rank correlation of two arrays of one shape, without NaN pairs."""
    known = np.isfinite(one) & np.isfinite(other)
    ranks = [np.argsort(np.argsort(values[known])) for values in (one, other)]
    return float(np.asarray(np.corrcoef(ranks))[0, 1])
