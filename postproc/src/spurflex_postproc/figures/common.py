"""What the figures share."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from spurflex_postproc import style
from spurflex_postproc.layout import STIFFNESS, ResultError
from spurflex_postproc.published import PAPER_STIFFNESS

SPEED_LABEL = "rotating speed $n$ (rev/min)"
AMPLITUDE_LABEL = "amplitude of $y_1$ (µm)"
STIFFNESS_LABEL = r"support stiffness $k_\mathrm{M}$ (N/m)"

LEGEND_HEIGHT = 4.5
"""Height of a row of a legend below a figure [mm]."""


@dataclass(frozen=True)
class Options:
    """What the user may choose.

    Attributes:
        stiffness: Support stiffness whose nearest row a curve shows [N/m].
        mesh_axis: Whether curves get a second axis with the mesh frequency.
        speed: Speed whose nearest point figures of one motion show [rev/min]; that of the figure
            or of the file if absent.
        quantity: Recorded quantity that spectra, sections and histories show.
        rigid: Whether a figure of one motion shows the rigid support.
        log: Whether the amplitude axis of a spectrum is logarithmic.
    """

    stiffness: float = PAPER_STIFFNESS
    mesh_axis: bool = False
    speed: float | None = None
    quantity: str = "y1"
    rigid: bool = False
    log: bool = False


@dataclass(frozen=True)
class Drawing:
    """One finished figure.

    Attributes:
        name: File name without ending.
        figure: The figure.
        report: Text for the terminal, possibly empty.
    """

    name: str
    figure: Figure
    report: str = ""


def nearest_row(result: xr.Dataset, stiffness: float) -> int:
    """Return the position of the support stiffness nearest to one wanted, by ratio.

    Args:
        result: A dataset from `open_result`.
        stiffness: The stiffness wanted [N/m].

    Returns:
        Position on the dimension `support_stiffness`.
    """
    return int(np.argmin(np.abs(np.log(result[STIFFNESS].values / stiffness))))


def support_label(result: xr.Dataset, support: str, stiffness: float) -> str:
    """Name a support, the flexible one with the stiffness of the row that is drawn.

    Args:
        result: A dataset from `open_result`.
        support: 'rigid' or 'flexible'.
        stiffness: The stiffness wanted [N/m].

    Returns:
        Text with matplotlib's mathematics.
    """
    if support == "rigid":
        return "rigid support"
    there = float(result[STIFFNESS].values[nearest_row(result, stiffness)])
    return rf"flexible support, $k_\mathrm{{M}}$ = {style.power_of_ten(there)} N/m"


def named_after(result: xr.Dataset, name: str) -> str:
    """Return the file name of a figure of the paper: that of its result, if it is a variant.

    Args:
        result: A dataset from `open_result`.
        name: The usual name, as 'figure5'.

    Returns:
        As 'figure5-newmark' for 'figure5-newmark.h5', else the usual name.
    """
    stem = Path(result.attrs["path"]).stem
    return stem if stem.startswith(f"{name}-") else name


def variant_of(result: xr.Dataset, name: str) -> str:
    """Return what a variant of a figure is, for its heading; empty if it is none."""
    title = str(result.attrs.get("title", ""))
    return f"\n{title}" if title and named_after(result, name) != name else ""


def legend_below(figure: Figure, handles: Sequence[Artist], title: str | None = None) -> None:
    """Add a legend in one row below everything else of a figure with constrained layout.

    Args:
        figure: The figure.
        handles: Entries of the legend.
        title: Its heading.
    """
    height = (LEGEND_HEIGHT * (1 if title is None else 2)) * style.MILLIMETRE
    share = height / float(figure.get_size_inches()[1])
    figure.set_layout_engine("constrained", rect=(0, share, 1, 1 - share))
    figure.legend(
        handles=list(handles),
        loc="lower center",
        ncol=max(len(handles), 1),
        handlelength=1.4,
        borderaxespad=0.2,
        title=title,
        title_fontsize=6,
    )


def require_values(result: xr.Dataset, name: str, values: NDArray[np.float64]) -> None:
    """Refuse to draw a variable of which no point has been computed yet.

    Raises:
        ResultError: If every value is NaN.
    """
    if not np.isfinite(values).any():
        raise ResultError(f"{result.attrs['path']}: no point of '{name}' holds a value yet")


def add_mesh_axis(axes: Axes, result: xr.Dataset) -> None:
    """Add the mesh frequency in kHz on top of an axes over rotating speed.

    Raises:
        ResultError: If the file does not tell the number of teeth.
    """
    teeth = result.attrs.get("teeth_1")
    if teeth is None:
        raise ResultError(f"{result.attrs['path']}: does not tell teeth_1 for the mesh frequency")
    factor = teeth / 60 / 1000

    def to_frequency(speed: ArrayLike) -> NDArray[np.float64]:
        return np.asarray(np.asarray(speed, dtype=float) * factor)

    def to_speed(frequency: ArrayLike) -> NDArray[np.float64]:
        return np.asarray(np.asarray(frequency, dtype=float) / factor)

    top = axes.secondary_xaxis("top", functions=(to_frequency, to_speed))
    top.set_xlabel("mesh frequency (kHz)")
