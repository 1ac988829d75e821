"""Spectra over the rotating speed, as a stack of lines in perspective and as a map."""

from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import offset_copy
from numpy.typing import NDArray

from spurflex_postproc import style
from spurflex_postproc.figures.common import (
    SPEED_LABEL,
    Drawing,
    Options,
    legend_below,
    nearest_row,
    require_values,
    support_label,
)
from spurflex_postproc.figures.motion_strip import line_colour, line_legend
from spurflex_postproc.figures.spectrum_map import draw_maps
from spurflex_postproc.layout import SPEED
from spurflex_postproc.quantities import QUANTITIES
from spurflex_postproc.recordings import SPECTRUM, read_spectra, supports_with

Reals = NDArray[np.float64]

MOST_LINES = 58
"""Spectra in a stack; of more speeds every second, third, ... is drawn."""
DEPTH = 1.7
"""Height of the floor in the picture, as a multiple of the strongest line."""
SHEAR = 0.32
"""Shift from the first to the last speed, as a fraction of the axis of orders."""
FLOOR = 5e-4
"""Smallest amplitude that is drawn, as a fraction of the strongest line of the stack."""
SPEED_TICKS = 7
"""Most ticks on the axis of speeds."""


@dataclass(frozen=True)
class Stack:
    """The spectra of one support over the speed, without the mean at order zero.

    Attributes:
        support: 'rigid' or 'flexible'.
        title: What it is, for people.
        speed: Rotating speeds [rev/min], shape (n,).
        motion: Motion flags, shape (n,).
        order: Multiples of the mesh frequency, above zero, shape (o,).
        amplitude: Lines in the unit of figures, NaN where there is none, shape (n, o).
    """

    support: str
    title: str
    speed: Reals
    motion: NDArray[np.int64]
    order: Reals
    amplitude: Reals


def draw(result: xr.Dataset, options: Options) -> list[Drawing]:
    """Draw the waterfall of every support in the file, and the same as maps.

    Args:
        result: A dataset from `open_result` whose file holds spectra of at least two speeds.
        options: Choice of quantity and support stiffness.

    Returns:
        The waterfall and the map.

    Raises:
        ResultError: If there is no spectrum of the quantity.
    """
    stacks = read_stacks(result, options)
    quantity = QUANTITIES[options.quantity]
    figure = Figure(
        figsize=style.size(style.DOUBLE if len(stacks) > 1 else 120, 84), layout="constrained"
    )
    panels = np.ravel(figure.subplots(1, len(stacks), squeeze=False))
    report = []
    for panel, stack in zip(panels, stacks, strict=True):
        every = draw_stack(panel, stack, quantity.amplitude_label)
        panel.set_title(stack.title, loc="left")
        many = f"every {ordinal(every)} of {len(stack.speed)} speeds"
        report.append(f"{stack.support} support: {many}")
    legend_below(figure, line_legend(np.concatenate([stack.motion for stack in stacks])))
    name = "waterfall" if quantity.name == "y1" else f"waterfall_{quantity.name}"
    return [
        Drawing(name, figure, "\n".join(report)),
        Drawing(f"{name}_map", draw_maps(stacks, quantity)),
    ]


def read_stacks(result: xr.Dataset, options: Options) -> list[Stack]:
    """Read the spectra of every support in the file, at the nearest support stiffness.

    Raises:
        ResultError: If there is no spectrum of the quantity, or no value in it.
    """
    quantity = QUANTITIES[options.quantity]
    stacks = []
    for support in supports_with(result, SPECTRUM, quantity.name):
        row = 0 if support == "rigid" else nearest_row(result, options.stiffness)
        found = read_spectra(result, quantity.name, support, row)
        amplitude = quantity.factor * found.amplitude
        require_values(result, f"{support} spectrum", amplitude)
        motion = result["rigid_motion"] if support == "rigid" else result["motion"][row]
        above = found.order > 0
        stacks.append(
            Stack(
                support,
                support_label(result, support, options.stiffness),
                np.asarray(result[SPEED].values, dtype=float),
                motion.values,
                found.order[above],
                amplitude[:, above],
            )
        )
    return stacks


def draw_stack(axes: Axes, stack: Stack, label: str) -> int:
    """Draw the stack of one support: the first speed in front, the last behind.

    Args:
        axes: Where to.
        stack: The spectra.
        label: Label of the amplitude.

    Returns:
        Of how many speeds one is drawn.
    """
    every = max(1, ceil(len(stack.speed) / MOST_LINES))
    strongest = float(np.nanmax(stack.amplitude))
    strongest = strongest if strongest > 0 else 1.0
    width = SHEAR * float(stack.order[-1])
    height = DEPTH * strongest
    span = stack.speed[-1] - stack.speed[0]

    def shift(speed: Any) -> Any:
        return (np.asarray(speed, dtype=float) - stack.speed[0]) / (span if span > 0 else 1.0)

    _floor(axes, stack, width, height, shift)
    for at in range(0, len(stack.speed), every):
        back = float(shift(stack.speed[at]))
        x, y = thinned(stack.order, stack.amplitude[at], FLOOR * strongest)
        shared: dict[str, Any] = {"zorder": 3 + (1 - back), "lw": 0.45}
        axes.fill_between(
            x + back * width, back * height, y + back * height, color="white", **shared
        )
        axes.plot(
            [back * width, stack.order[-1] + back * width],
            [back * height, back * height],
            color=style.PALE,
            **{**shared, "lw": 0.3},
        )
        x, y = without_floor(x, y)
        axes.plot(
            x + back * width,
            y + back * height,
            color=line_colour(int(stack.motion[at])),
            solid_joinstyle="round",
            gid=f"{stack.support} {stack.speed[at]:g}",
            **shared,
        )
    _dress(axes, stack, label, strongest, height, width)
    return every


def thinned(order: Reals, amplitude: Reals, floor: float) -> tuple[Reals, Reals]:
    """Leave out the inside of stretches that are as good as zero.

    Args:
        order: Orders, shape (o,).
        amplitude: Amplitudes, NaN where there is none, shape (o,).
        floor: Largest amplitude that is drawn as zero.

    Returns:
        Orders and amplitudes that draw the same line; none if there is no value.
    """
    if not np.isfinite(amplitude).any():
        return order[:0], amplitude[:0]
    values = np.where(np.nan_to_num(amplitude) > floor, amplitude, 0.0)
    low = values == 0
    inside = np.zeros(low.shape, dtype=bool)
    inside[1:-1] = low[1:-1] & low[:-2] & low[2:]
    return order[~inside], values[~inside]


def without_floor(order: Reals, amplitude: Reals) -> tuple[Reals, Reals]:
    """Open a line wherever it runs along zero, by a NaN between two zeros."""
    at = 1 + np.flatnonzero((amplitude[:-1] == 0) & (amplitude[1:] == 0))
    return np.insert(order, at, np.nan), np.insert(amplitude, at, np.nan)


def ordinal(number: int) -> str:
    """Write a whole number above zero as 1st, 2nd, 3rd, 4th, ..."""
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{'th' if 10 <= number % 100 <= 20 else ending}"


def _floor(axes: Axes, stack: Stack, width: float, height: float, shift: Any) -> None:
    """Draw the floor with a line at each whole order, and the axis of speeds on its right."""
    last = float(stack.order[-1])
    shared: dict[str, Any] = {"color": style.PALE, "lw": 0.4, "zorder": 1}
    for order in range(0, int(last) + 1):
        axes.plot([order, order + width], [0, height], **shared)
    axes.plot([0, last], [0, 0], color="black", lw=0.5, zorder=5)
    axes.plot([last, last + width], [0, height], color="black", lw=0.5, zorder=1)
    ticks = np.asarray(
        MaxNLocator(SPEED_TICKS, steps=[1, 2, 5, 10]).tick_values(stack.speed[0], stack.speed[-1])
    )
    for speed in ticks[(ticks >= stack.speed[0]) & (ticks <= stack.speed[-1])]:
        back = float(shift(speed))
        axes.annotate(
            f"{speed:.0f}",
            (last + back * width, back * height),
            xytext=(5, 0),
            textcoords="offset points",
            va="center",
            fontsize=6,
            arrowprops={"arrowstyle": "-", "lw": 0.5, "shrinkA": 0, "shrinkB": 0},
            annotation_clip=False,
        )
    whole: Any = axes.figure
    axes.text(
        last + width / 2,
        height / 2,
        SPEED_LABEL,
        transform=offset_copy(axes.transData, whole, x=33, y=-6, units="points"),
        rotation=float(np.degrees(np.arctan2(height, width))),
        rotation_mode="anchor",
        transform_rotates_text=True,
        ha="center",
        va="top",
        fontsize=7,
    )


def _dress(
    axes: Axes, stack: Stack, label: str, strongest: float, height: float, width: float
) -> None:
    """Set limits, and axes of order and amplitude that end where the stack does."""
    last = float(stack.order[-1])
    axes.set_xlim(0, last + width)
    tops = (
        stack.amplitude
        + height * ((stack.speed - stack.speed[0]) / (np.ptp(stack.speed) or 1.0))[:, np.newaxis]
    )
    axes.set_ylim(0, 1.02 * float(np.nanmax(tops)))
    axes.set_xticks(range(0, int(last) + 1))
    axes.set_xlabel("order (multiples of the mesh frequency)", x=last / (last + width) / 2)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines["bottom"].set_bounds(0, last)
    ticks = np.asarray(MaxNLocator(3, steps=[1, 2, 2.5, 5, 10]).tick_values(0, strongest))
    ticks = ticks[(ticks >= 0) & (ticks <= strongest)]
    axes.set_yticks(ticks)
    axes.spines["left"].set_bounds(0, float(ticks[-1]))
    axes.set_ylabel(label, y=0, ha="left")
