"""The conclusions of the article as claims that numbers can support or contradict."""

import numpy as np
import xarray as xr

from spurflex_postproc.features import transition
from spurflex_postproc.published import published_map
from spurflex_postproc.published_table.bearing import general
from spurflex_postproc.published_table.maps import StiffnessMap, follow_crest, stiffness_map
from spurflex_postproc.published_table.row import Row, statement

BEARING_STIFFNESS = 2.0e8
"""Bearing stiffness in Table 1 [N/m]."""
SMALL = 0.05
"""Median difference below which two responses count as the same, as a fraction."""
LARGE = 0.20
"""Median difference from which on a response counts as changed significantly, as a fraction."""


def conclusion_rows(result: xr.Dataset) -> list[Row]:
    """State the four conclusions as claims and test them.

    Args:
        result: A dataset from `open_result` with both supports over speed and stiffness.

    Returns:
        Four rows.
    """
    map_ = stiffness_map(result, "y1_amplitude")
    last = general(stiffness_map(result, "eta1"))
    return [
        _low_speed(map_),
        *_bearings(map_),
        statement(
            "conclusion 4",
            "conclusions",
            "the largest bearing deformation of the driving gear is generally greater on the"
            " flexible support: eta is above zero at more than half of the points and on average",
            "yes",
            str(last.computed),
            last.agrees,
            last.note,
        ),
    ]


def _low_speed(map_: StiffnessMap) -> Row:
    """The flexible support changes the curve at low speed."""
    first, last = published_map().flat
    soft = map_.stiffness <= BEARING_STIFFNESS
    off = np.abs(map_.values[soft] / map_.rigid - 1)
    low = float(np.nanmedian(off[:, map_.speed < first]))
    middle = float(np.nanmedian(off[:, map_.between(first, last)]))
    return statement(
        "conclusion 1",
        "conclusions",
        "a flexible support changes the amplitude-frequency curve significantly at low speed:"
        f" median difference from the rigid curve above {100 * LARGE:.0f} % below {first:.0f}"
        " rev/min",
        "yes",
        f"{100 * low:.0f} %",
        low > LARGE,
        f"{100 * middle:.1f} % from {first:.0f} to {last:.0f} rev/min; supports up to the stiffness"
        " of the bearings",
    )


def _bearings(map_: StiffnessMap) -> list[Row]:
    """The stiffness of the bearings parts flexible from rigid response."""
    low = map_.speed < published_map().flat[0]
    values, rigid = map_.values[:, low], map_.rigid[low]
    found = transition(map_.stiffness, values, rigid)
    soft = map_.stiffness < BEARING_STIFFNESS
    change = np.nanmedian(np.abs(values[soft] / values[0] - 1), axis=1)
    same = map_.stiffness[soft][change < SMALL]
    until = float(same[-1]) if same.size else float("nan")
    smallest = float(found.difference[soft].min())
    stiff = map_.stiffness > BEARING_STIFFNESS
    rigid_share = float(np.mean(found.difference[stiff] < SMALL))
    ratio = found.rigid_from / BEARING_STIFFNESS
    told = published_map()
    reaches = follow_crest(map_, told).stiffness_at(told.flat[0])
    line = (
        f"; the crest line of figure 9, extended, reaches {told.flat[0]:.0f} rev/min at"
        f" {reaches:.1e} N/m"
        if np.isfinite(reaches)
        else ""
    )
    return [
        statement(
            "conclusion 2",
            "conclusions",
            "with a support softer than the bearings (2e8 N/m) the response is that of a flexible"
            f" support: median difference from the rigid curve above {100 * LARGE:.0f} % below"
            " 3100 rev/min",
            "yes",
            f"at least {100 * smallest:.0f} %",
            smallest > LARGE,
            f"within {100 * SMALL:.0f} % of the softest support up to {until:.1e} N/m; half way"
            f" from soft to rigid at {found.middle:.1e} N/m",
        ),
        statement(
            "conclusion 3",
            "conclusions",
            "with a support stiffer than the bearings (2e8 N/m) the response is that of a rigid"
            f" support: median difference below {100 * SMALL:.0f} % below 3100 rev/min",
            "yes",
            f"at {100 * rigid_share:.0f} % of the stiffnesses above, from"
            f" {found.rigid_from:.1e} N/m",
            bool(ratio <= 1.5),
            f"that is {ratio:.0f} times the stiffness of the bearings; a tendency, not a"
            f" threshold{line}",
        ),
    ]
