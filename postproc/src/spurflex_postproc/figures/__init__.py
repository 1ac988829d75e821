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
    bifurcation,
    motion_over_speed,
    one_motion,
    starts,
    stiffness_map,
    waterfall,
)
from spurflex_postproc.figures.common import Drawing, Options
from spurflex_postproc.published import published_points


@dataclass(frozen=True)
class Entry:
    """One figure of the table.

    Attributes:
        title: What it shows, in one line.
        needs: Variables that the result file must hold; what was recorded is looked for when
            it is drawn.
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
    "3": Entry(
        "waterfalls and bifurcation diagrams of the driving gear, flexible and rigid support",
        motion_over_speed.NEEDS,
        motion_over_speed.draw,
    ),
    **{
        point.figure: Entry(
            f"time history, spectrum, phase plane, Poincare map at {point.speed:.0f} rev/min",
            (),
            one_motion.published_figure(point.figure),
        )
        for point in published_points()
    },
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
    "waterfall": Entry("spectra over the speed, as a stack and as a map", (), waterfall.draw),
    "bifurcation": Entry("Poincare sections over the speed", (), bifurcation.draw),
    "point": Entry(
        "time history, spectrum, phase plane, Poincare map of any point (--speed)",
        (),
        one_motion.draw,
    ),
}

__all__ = ["FIGURES", "Drawing", "Entry", "Options"]
