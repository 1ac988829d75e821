"""Figures 4 to 8: time history, spectrum, phase plane and Poincare map of one motion."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from spurflex_postproc import style
from spurflex_postproc.features.orders import Line, find_lines
from spurflex_postproc.features.regimes import flag_name
from spurflex_postproc.figures.common import (
    Drawing,
    Options,
    named_after,
    nearest_row,
    require_values,
    support_label,
    variant_of,
)
from spurflex_postproc.flags import LARGEST_PERIOD, period_of
from spurflex_postproc.layout import SPEED, ResultError
from spurflex_postproc.published import published_points
from spurflex_postproc.quantities import QUANTITIES, Quantity
from spurflex_postproc.recordings import read_history, read_sections, read_spectra

Reals = NDArray[np.float64]

SHOWN_PERIODS, SHOWN_IRREGULAR = 8, 24
"""Mesh periods of the time history that are drawn, of a motion that repeats and of another."""
NAMED = 9
"""Most lines of a spectrum whose order is written beside them."""
NAMED_FROM = 0.02
"""Smallest line that is named, as a fraction of the strongest."""
NAMES_APART = 0.12
"""Smallest distance in orders of two lines that are both named."""
LOWEST = 1e-5
"""Smallest line that is drawn, as a fraction of the strongest."""


@dataclass(frozen=True)
class Recorded:
    """All that is drawn of one motion, in the units of figures.

    Attributes:
        quantity: What was recorded.
        speed: Rotating speed [rev/min].
        support: Name of the support, for people.
        colour: Of its lines.
        flag: Motion flag.
        time: Mesh periods, shape (t,).
        value: Time history, shape (t,).
        rate: Its rate, shape (t,).
        order: Orders above zero, shape (o,).
        amplitude: Lines of the spectrum, shape (o,).
        section: Values at the section, shape (s,).
        section_rate: Rates at the section, shape (s,).
        mesh_frequency: [kHz]; None if the file does not tell the number of teeth.
    """

    quantity: Quantity
    speed: float
    support: str
    colour: str
    flag: int
    time: Reals
    value: Reals
    rate: Reals
    order: Reals
    amplitude: Reals
    section: Reals
    section_rate: Reals
    mesh_frequency: float | None

    @property
    def period(self) -> int | None:
        """Mesh periods after which the motion repeats; None if it does not."""
        return period_of(self.flag)

    def section_points(self) -> tuple[Reals, Reals]:
        """Return the different points of the section: n of a motion that repeats after n."""
        count = min(self.period or len(self.section), len(self.section))
        return self.section[:count], self.section_rate[:count]

    def loops(self) -> tuple[Reals, Reals]:
        """Return the phase curve: once around of a motion that repeats, closed, else all."""
        samples = len(self.time) + 1
        if self.period is not None:
            samples = round(self.period / float(self.time[1] - self.time[0]))
        if samples > len(self.time):
            return self.value, self.rate
        return (
            np.append(self.value[:samples], self.value[0]),
            np.append(self.rate[:samples], self.rate[0]),
        )


def published_figure(number: str) -> Callable[[xr.Dataset, Options], list[Drawing]]:
    """Return the drawing function of one of the figures 4 to 8."""
    (told,) = [point for point in published_points() if point.figure == number]

    def draw_figure(result: xr.Dataset, options: Options) -> list[Drawing]:
        motion = read_motion(result, options, options.speed or told.speed)
        name = f"figure{number}"
        found = f"{_heading(motion)}; published: {told.motion}{variant_of(result, name)}"
        return [Drawing(named_after(result, name), draw_motion_panels(motion, found, options))]

    return draw_figure


def draw(result: xr.Dataset, options: Options) -> list[Drawing]:
    """Draw the same four panels of any point of a file.

    Args:
        result: A dataset from `open_result` whose file holds spectrum, section and history.
        options: Choice of speed, stiffness, support and quantity. Without a speed the file has
            to hold only one.

    Returns:
        One drawing.

    Raises:
        ResultError: If the speed is not clear or something was not recorded.
    """
    speed = options.speed
    if speed is None:
        if result.sizes[SPEED] != 1:
            raise ResultError(f"{result.attrs['path']}: holds several speeds; choose by --speed")
        speed = float(result[SPEED].values[0])
    motion = read_motion(result, options, speed)
    name = f"point_{motion.speed:g}_{motion.quantity.name}" + ("_rigid" if options.rigid else "")
    return [Drawing(name, draw_motion_panels(motion, _heading(motion), options))]


def read_motion(result: xr.Dataset, options: Options, speed: float) -> Recorded:
    """Read what was recorded at the nearest point.

    Args:
        result: A dataset from `open_result`.
        options: Choice of stiffness, support and quantity.
        speed: Rotating speed wanted [rev/min].

    Returns:
        The recorded motion.

    Raises:
        ResultError: If something was not recorded or the point has no value.
    """
    quantity = QUANTITIES[options.quantity]
    support = "rigid" if options.rigid else "flexible"
    name = "rigid_motion" if options.rigid else "motion"
    if name not in result:
        raise ResultError(f"{result.attrs['path']}: holds nothing on the {support} support")
    speeds = np.asarray(result[SPEED].values, dtype=float)
    row = 0 if options.rigid else nearest_row(result, options.stiffness)
    column = int(np.argmin(np.abs(speeds - speed)))
    motion = result[name].values
    spectrum = read_spectra(result, quantity.name, support, row, column)
    section = read_sections(result, quantity.name, support, row, column)
    history = read_history(result, quantity.name, support, row, column)
    require_values(result, f"{quantity.name} at {speeds[column]:g} rev/min", history.value)
    teeth = result.attrs.get("teeth_1")
    above = spectrum.order > 0
    return Recorded(
        quantity=quantity,
        speed=float(speeds[column]),
        support=support_label(result, support, options.stiffness),
        colour=style.RIGID if options.rigid else style.FLEXIBLE,
        flag=int(motion[column] if options.rigid else motion[row, column]),
        time=history.time,
        value=quantity.factor * history.value,
        rate=quantity.rate_factor * history.rate,
        order=spectrum.order[above],
        amplitude=quantity.factor * spectrum.amplitude[0, above],
        section=quantity.factor * section.value[0],
        section_rate=quantity.rate_factor * section.rate[0],
        mesh_frequency=None if teeth is None else teeth * float(speeds[column]) / 60e3,
    )


def draw_motion_panels(motion: Recorded, heading: str, options: Options) -> Figure:
    """Draw the four panels.

    Args:
        motion: The recorded motion.
        heading: What it is, above all panels.
        options: Whether the axis of the spectrum is logarithmic.

    Returns:
        The figure.
    """
    figure = Figure(figsize=style.size(style.DOUBLE, 118), layout="constrained")
    (history, spectrum), (phase, section) = figure.subplots(2, 2)
    _history(history, motion)
    _spectrum(spectrum, motion, log=options.log)
    _phase_plane(phase, motion)
    _section(section, motion, phase)
    for letter, axes, what in (
        ("a", history, "time history"),
        ("b", spectrum, "spectrum"),
        ("c", phase, "phase plane"),
        ("d", section, "Poincaré map"),
    ):
        axes.set_title(f"{letter}  {what}", loc="left", fontweight="bold")
    figure.suptitle(heading, fontsize=7, x=0.01, ha="left")
    return figure


def fraction(order: float, period: int | None) -> str:
    """Write an order: as a fraction of whole numbers if the motion repeats, else as decimals.

    Args:
        order: Multiple of the mesh frequency.
        period: Mesh periods after which the motion repeats; None if it does not.

    Returns:
        As '2/3' or '0.37'.
    """
    if period is None or period > LARGEST_PERIOD:
        return f"{order:.2f}"
    return str(Fraction(round(order * period), period))


def named_lines(lines: list[Line]) -> list[Line]:
    """Choose the lines whose order is written: the strongest, not too close to each other.

    Args:
        lines: Lines of a spectrum, the strongest first.

    Returns:
        Some of them, the strongest first.
    """
    chosen: list[Line] = []
    for line in lines:
        if line.amplitude < NAMED_FROM * lines[0].amplitude or len(chosen) == NAMED:
            break
        if all(abs(line.order - other.order) >= NAMES_APART for other in chosen):
            chosen.append(line)
    return chosen


def _heading(motion: Recorded) -> str:
    """Say which motion is drawn."""
    return f"{motion.speed:g} rev/min, {motion.support}; computed: {flag_name(motion.flag)}"


def _history(axes: Axes, motion: Recorded) -> None:
    """Draw the value over time."""
    most = SHOWN_IRREGULAR if motion.period is None else max(SHOWN_PERIODS, 2 * motion.period)
    shown = motion.time <= motion.time[0] + most + 1e-9
    axes.plot(motion.time[shown], motion.value[shown], color=motion.colour, lw=0.7, gid="history")
    axes.set_xlim(motion.time[0], motion.time[shown][-1])
    period = f" of {1 / motion.mesh_frequency:.4g} ms" if motion.mesh_frequency else ""
    axes.set_xlabel(f"time (mesh periods{period})")
    axes.set_ylabel(motion.quantity.label)
    axes.minorticks_on()


def _spectrum(axes: Axes, motion: Recorded, *, log: bool) -> None:
    """Draw the amplitude over the order: single lines of a motion that repeats, else a curve."""
    strongest = float(np.nanmax(motion.amplitude))
    strongest = strongest if strongest > 0 else 1.0
    floor = LOWEST * strongest if log else 0.0
    if motion.period is not None and motion.period <= LARGEST_PERIOD:
        there = motion.amplitude > max(floor, LOWEST * strongest)
        axes.vlines(
            motion.order[there],
            floor,
            motion.amplitude[there],
            color=motion.colour,
            lw=1.1,
            gid="spectrum",
        )
        axes.axhline(floor, color="black", lw=0.5)
    else:
        axes.plot(
            motion.order,
            np.maximum(motion.amplitude, floor),
            color=motion.colour,
            lw=0.6,
            gid="spectrum",
        )
    if log:
        axes.set_yscale("log")
    axes.set_ylim(floor, strongest * (4 if log else 1.12))
    axes.set_xlim(0, motion.order[-1])
    axes.xaxis.set_major_locator(MultipleLocator(0.5 if motion.order[-1] <= 5 else 1))
    axes.set_xlabel(
        "order (multiples of the mesh frequency"
        + (f", {motion.mesh_frequency:.4g} kHz)" if motion.mesh_frequency else ")")
    )
    axes.set_ylabel(motion.quantity.amplitude_label)
    for line in named_lines(find_lines(motion.order, motion.amplitude)):
        axes.annotate(
            fraction(line.order, motion.period),
            (line.order, line.amplitude),
            xytext=(0, 2),
            textcoords="offset points",
            ha="center",
            fontsize=6,
            gid="order",
        )


def _phase_plane(axes: Axes, motion: Recorded) -> None:
    """Draw the rate over the value, the points of the section on top."""
    axes.plot(*motion.loops(), color=motion.colour, lw=0.6, gid="phase")
    size = 3.0 if motion.period is not None else 1.1
    axes.plot(
        *motion.section_points(), "o", color=style.BLACK, ms=size, mew=0, gid="section on top"
    )
    _label_plane(axes, motion)


def _section(axes: Axes, motion: Recorded, phase: Axes) -> None:
    """Draw the points of the section; of a motion that repeats on the scale of the phase plane."""
    marks: dict[str, Any] = {"color": style.BLACK, "mew": 0, "ls": "none", "marker": "o"}
    axes.plot(
        *motion.section_points(),
        ms=3.0 if motion.period is not None else 1.4,
        gid="section",
        **marks,
    )
    if motion.period is not None:
        axes.set_xlim(phase.get_xlim())
        axes.set_ylim(phase.get_ylim())
    _label_plane(axes, motion)


def _label_plane(axes: Axes, motion: Recorded) -> None:
    """Label value and rate."""
    axes.minorticks_on()
    axes.set_xlabel(motion.quantity.label)
    axes.set_ylabel(motion.quantity.rate_label)
