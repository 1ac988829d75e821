"""What the figures share."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from spurflex_postproc.layout import STIFFNESS, ResultError

PAPER_STIFFNESS = 2.5e8
"""Support stiffness of the published flexible curve [N/m]."""

SPEED_LABEL = "rotating speed $n$ (rev/min)"
AMPLITUDE_LABEL = "amplitude of $y_1$ (µm)"
STIFFNESS_LABEL = r"support stiffness $k_\mathrm{M}$ (N/m)"


@dataclass(frozen=True)
class Options:
    """What the user may choose.

    Attributes:
        stiffness: Support stiffness whose nearest row a curve shows [N/m].
        mesh_axis: Whether curves get a second axis with the mesh frequency.
    """

    stiffness: float = PAPER_STIFFNESS
    mesh_axis: bool = False


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
