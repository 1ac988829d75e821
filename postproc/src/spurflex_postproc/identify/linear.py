"""Eigenfrequencies of the mean system: a first guess before the program is run.

With the mean mesh stiffness and without backlash the peaks of the amplitude-frequency curve lie
near the eigenfrequencies of the modes that the mesh excites and that move the driving gear in y.
"""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spurflex_postproc.identify.unknowns import Unknowns

Reals = NDArray[np.float64]

FAR = 1.0
"""Deviation that stands for a peak without eigenfrequency, as a fraction."""
FAINT = 1e-3
"""Smallest response of a mode in y to a force on the mesh at rest that makes a peak, as a fraction
of the largest."""


class MeanSystem:
    """Mass and stiffness of both models from the printed values of a deck.

    Args:
        deck: Text of a deck with the printed values.

    Raises:
        KeyError: If a value is missing.
    """

    def __init__(self, deck: str) -> None:
        value = {key: _number(deck, key) for key in _KEYS}
        self._mass = value["mass_1"], value["mass_2"], value["mass"], value["inertia"]
        self._bearing = value["stiffness_1"], value["stiffness_2"]
        self._mesh = value["mean_stiffness"]
        self._angle = np.radians(value["pressure_angle"])

    def peaks(self, unknowns: Unknowns, *, flexible: bool) -> Reals:
        """Return the speeds at which the mesh excites a mode that moves gear 1 in y.

        Args:
            unknowns: The parameters.
            flexible: Whether on the flexible support.

        Returns:
            Speeds [rev/min], ascending, shape (n,).
        """
        one, two, box, box_inertia = self._mass
        sine, cosine = np.sin(self._angle), np.cos(self._angle)
        first, second = unknowns.radius_1, unknowns.radius_2
        mesh = np.array([sine, -cosine, first, -sine, cosine, -second, 0, 0, 0])
        turn = unknowns.inertias
        mass = np.array([one, one, turn[0], two, two, turn[1], box, box, box_inertia])
        bearings = np.zeros((4, 9))
        bearings[[0, 1, 2, 3], [0, 1, 3, 4]] = 1
        bearings[[0, 2], 6] = bearings[[1, 3], 7] = -1
        bearings[1, 8], bearings[3, 8] = unknowns.gear_offset, -unknowns.gear_offset
        springs = np.repeat(self._bearing, 2)
        stiffness = bearings.T @ (springs[:, None] * bearings) + self._mesh * np.outer(mesh, mesh)
        support = float(unknowns.deck_values()["stiffness_first"])
        stiffness[[6, 7, 8], [6, 7, 8]] += support * np.array([1, 1, unknowns.support_offset**2])
        count = 9 if flexible else 6
        scale = 1 / np.sqrt(mass[:count])
        squares, modes = np.linalg.eigh(stiffness[:count, :count] * np.outer(scale, scale))
        strength = np.abs((modes.T @ (scale * mesh[:count])) * (scale[1] * modes[1]))
        moving = squares > 1e-6 * squares.max()
        strength = np.divide(strength, squares, out=np.zeros(count), where=moving)
        seen = strength > FAINT * strength.max()
        return np.asarray(np.sqrt(squares[seen]) * 60 / (2 * np.pi * unknowns.teeth))

    def deviations(
        self, unknowns: Unknowns, rigid: Sequence[float], flexible: Sequence[float]
    ) -> Reals:
        """Compare published peaks with the nearest eigenfrequencies.

        Args:
            unknowns: The parameters.
            rigid: Published peaks on the rigid support [rev/min].
            flexible: The same on the flexible support.

        Returns:
            Deviations as fractions, rigid first, shape (n,).
        """
        found = []
        for wanted, soft in ((rigid, False), (flexible, True)):
            peaks = self.peaks(unknowns, flexible=soft)
            for speed in wanted:
                off = peaks / speed - 1
                found.append(float(off[np.argmin(np.abs(off))]) if off.size else FAR)
        return np.array(found)


_KEYS = (
    *("mass_1", "mass_2", "mass", "inertia", "stiffness_1", "stiffness_2"),
    *("mean_stiffness", "pressure_angle"),
)


def _number(deck: str, key: str) -> float:
    """Read one number of a deck."""
    found = re.search(rf"^\s*{key}\s*=\s*([-+.\deEdD]+)", deck, re.MULTILINE)
    if found is None:
        raise KeyError(f"'{key}' does not stand in the deck")
    return float(found[1].lower().replace("d", "e"))
