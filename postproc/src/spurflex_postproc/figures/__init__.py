"""The figures that can be drawn, and the one table that lists them.

To add a figure: write a function in a module of this package that takes a dataset from
`open_result` and `Options` and returns drawings, and add a line to `FIGURES`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import xarray as xr

from spurflex_postproc.figures import amplitude_curves, stiffness_map
from spurflex_postproc.figures.common import Drawing, Options


@dataclass(frozen=True)
class Entry:
    """One figure of the table.

    Attributes:
        title: What it shows, in one line.
        needs: Variables that the result file must hold.
        draw: Makes the drawings; raises `ResultError` if the data do not allow it.
    """

    title: str
    needs: tuple[str, ...]
    draw: Callable[[xr.Dataset, Options], list[Drawing]]


FIGURES: dict[str, Entry] = {
    "2": Entry(
        "amplitude-frequency curves of the driving gear, rigid and flexible support",
        amplitude_curves.NEEDS,
        amplitude_curves.draw,
    ),
    "9": Entry(
        "amplitude over rotating speed and support stiffness, as a map and as a surface",
        stiffness_map.NEEDS,
        stiffness_map.draw,
    ),
}

__all__ = ["FIGURES", "Drawing", "Entry", "Options"]
