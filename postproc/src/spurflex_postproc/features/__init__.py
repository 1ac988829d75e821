"""Peaks, jumps and crest lines found in response curves by rule, not by eye."""

from spurflex_postproc.features.branches import Branches, Jump, find_branches
from spurflex_postproc.features.compare import Comparison, compare, comparison_table
from spurflex_postproc.features.crest import CrestLine, crest_line
from spurflex_postproc.features.peaks import Peak, find_peaks

__all__ = [
    "Branches",
    "Comparison",
    "CrestLine",
    "Jump",
    "Peak",
    "compare",
    "comparison_table",
    "crest_line",
    "find_branches",
    "find_peaks",
]
