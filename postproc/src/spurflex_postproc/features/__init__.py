"""Peaks, jumps, regimes, crest lines and areas, found in results by rule, not by eye."""

from spurflex_postproc.features.areas import Area, lettered, signed_areas, stiff_border
from spurflex_postproc.features.attractors import (
    Attractor,
    Coexistence,
    attractors,
    coexistence,
)
from spurflex_postproc.features.branches import Branches, Jump, find_branches
from spurflex_postproc.features.compare import Comparison, compare, comparison_table
from spurflex_postproc.features.crest import CrestLine, crest_line
from spurflex_postproc.features.curve import CurveFeatures, curve_features
from spurflex_postproc.features.peaks import Peak, find_peaks
from spurflex_postproc.features.regimes import (
    Border,
    Regime,
    find_regimes,
    match_borders,
    sequence,
)
from spurflex_postproc.features.stiffness import Transition, transition

__all__ = [
    "Area",
    "Attractor",
    "Border",
    "Branches",
    "Coexistence",
    "Comparison",
    "CrestLine",
    "CurveFeatures",
    "Jump",
    "Peak",
    "Regime",
    "Transition",
    "attractors",
    "coexistence",
    "compare",
    "comparison_table",
    "crest_line",
    "curve_features",
    "find_branches",
    "find_peaks",
    "find_regimes",
    "lettered",
    "match_borders",
    "sequence",
    "signed_areas",
    "stiff_border",
    "transition",
]
