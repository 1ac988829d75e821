"""Figures and response features from spurflex result files."""

from spurflex_postproc.layout import ResultError
from spurflex_postproc.reading import Coverage, coverage, open_result

__version__ = "0.1.0"

__all__ = ["Coverage", "ResultError", "__version__", "coverage", "open_result"]
