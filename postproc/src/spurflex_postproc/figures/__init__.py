"""The figures that can be drawn, and the one table that lists them.

To add a figure: write a function in a module of this package that takes a dataset from
`open_result` (or a list of them) and `Options` and returns drawings, and add a line to `FIGURES`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from spurflex_postproc.figures import (
    amplitude_curves,
    bearing_deformation,
    starts,
    stiffness_map,
)
from spurflex_postproc.figures.common import Drawing, Options


@dataclass(frozen=True)
class Entry:
    """One figure of the table.

    Attributes:
        title: What it shows, in one line.
        needs: Variables that the result file must hold.
        draw: Makes the drawings from one dataset, or from a list of them if `several`; raises
            `ResultError` if the data do not allow it.
        several: Whether it is drawn from several result files.
    """

    title: str
    needs: tuple[str, ...]
    draw: Callable[[Any, Options], list[Drawing]]
    several: bool = False


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
    "10": Entry(
        "bearing deformation and its change by the flexible support (from the file of figure 9)",
        bearing_deformation.NEEDS,
        bearing_deformation.draw,
    ),
    "starts": Entry(
        "the motions that different starts lead to (from the files of figure 2, one a start)",
        starts.NEEDS,
        starts.draw,
        several=True,
    ),
}

__all__ = ["FIGURES", "Drawing", "Entry", "Options"]
