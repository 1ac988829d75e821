"""All features of one amplitude-frequency curve of a result file."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from spurflex_postproc.features.branches import Branches, Jump, find_branches
from spurflex_postproc.features.peaks import Peak, find_peaks
from spurflex_postproc.features.regimes import Regime, find_regimes, flag_name
from spurflex_postproc.flags import is_regular
from spurflex_postproc.layout import SPEED, STIFFNESS

Reals = NDArray[np.float64]

CONTACT = {0: "contact kept", 1: "contact lost", 2: "both flanks"}
"""Values of `contact` in words."""


@dataclass(frozen=True)
class CurveFeatures:
    """What was found in one curve.

    Attributes:
        speed: Rotating speeds [rev/min], shape (n,).
        amplitude: Amplitudes of y1 [m], NaN where there is none, shape (n,).
        motion: Motion flags, shape (n,).
        contact: Contact flags, shape (n,).
        branches: Smooth branches, jumps and irregular bands.
        peaks: Peaks.
        regimes: Ranges of one class of motion.
    """

    speed: Reals
    amplitude: Reals
    motion: NDArray[np.int64]
    contact: NDArray[np.int64]
    branches: Branches
    peaks: list[Peak]
    regimes: list[Regime]

    def at(self, speed: float) -> int:
        """Return the position of the grid point nearest to a speed [rev/min]."""
        return int(np.argmin(np.abs(self.speed - speed)))

    def jump_identity(self, jump: Jump) -> str:
        """Say what changes at a jump besides the amplitude: motion, contact, or neither.

        A jump without either is one between two branches of the same class.
        """
        before, after = self.at(jump.first), self.at(jump.last)
        sides = []
        for at in (before, after):
            parts = [flag_name(int(self.motion[at])), CONTACT.get(int(self.contact[at]), "")]
            sides.append(", ".join(part for part in parts if part))
        return sides[0] if sides[0] == sides[1] else f"{sides[0]} to {sides[1]}"


def curve_features(result: xr.Dataset, support: str, row: int = 0) -> CurveFeatures:
    """Find the features of one curve.

    Args:
        result: A dataset from `open_result`.
        support: 'rigid' or 'flexible'.
        row: Position on the dimension `support_stiffness`; not used on the rigid support.

    Returns:
        The features.

    Raises:
        KeyError: If the result does not hold that support.
    """
    prefix = "rigid_" if support == "rigid" else ""
    data = result if prefix else result.isel({STIFFNESS: row})
    speed = np.asarray(data[SPEED].values, dtype=float)
    amplitude = np.asarray(data[f"{prefix}y1_amplitude"].values, dtype=float)
    motion = data[f"{prefix}motion"].values
    name = f"{prefix}contact"
    contact = data[name].values if name in data else np.full(motion.shape, -1)
    branches = find_branches(speed, amplitude, is_regular(data[f"{prefix}status"].values, motion))
    return CurveFeatures(
        speed=speed,
        amplitude=amplitude,
        motion=motion,
        contact=contact,
        branches=branches,
        peaks=find_peaks(speed, amplitude, branches=branches),
        regimes=find_regimes(speed, motion),
    )
