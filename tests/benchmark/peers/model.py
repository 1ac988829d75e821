"""The equations that every peer integrates, from the numbers of a deck.

They are the eight equations of deviations from the static equilibrium that spurflex integrates itself
(src/model/equations.f90), built here anew from Lagrange's equations. So that absolute and relative
tolerances mean the same, lengths are in units of half the backlash and time is the phase of the mesh, tau =
w_m t; one mesh period lasts 2 pi at every speed. With z the scaled coordinates d_x1, d_y1, d_x2, d_y2, xM,
yM, thM, p, and d the mesh deflection,

    z'' = -A z - B z' - h (c d' + k kappa(tau) f(d) - F),    d = d_s + g.z + e(tau),

f(d) = d - b, 0, d + b. The start is the static equilibrium, z = z' = 0.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "regression"))
from solutions import deck as decks

N = 8
PERIOD = 2 * np.pi


@dataclass(frozen=True)
class Equations:
    """The scaled equations of one operating point; everything without unit but `length` and `period`."""

    length: float  # unit of length [m]
    period: float  # mesh period [s]
    inverse_mass: np.ndarray  # scaled inverse of the mass matrix, shape (8, 8) [1/kg]
    stiffness: np.ndarray  # diagonal of K over w_m squared, shape (8,) [kg]
    damping: np.ndarray  # diagonal of C over w_m, shape (8,) [kg]
    drive: np.ndarray  # h, shape (8,) [1/kg]
    direction: np.ndarray  # g, shape (8,)
    observation: np.ndarray  # y1 is this times z, shape (8,)
    mesh_stiffness: float  # k [kg]
    mesh_damping: float  # c [kg]
    mean_force: float  # F [kg]
    static_deflection: float  # d_s
    half_backlash: float  # b
    stiffness_harmonics: np.ndarray  # complex amplitudes, shape (harmonics,)
    error_harmonics: np.ndarray  # complex amplitudes, shape (harmonics,)

    @property
    def position_matrix(self):
        """A, shape (8, 8)."""
        return self.inverse_mass * self.stiffness

    @property
    def velocity_matrix(self):
        """B, shape (8, 8)."""
        return self.inverse_mass * self.damping

    def excitation(self, tau):
        """kappa, e and e' at phases tau."""
        wave = np.exp(1j * tau)
        kappa = 1 + sum((c * wave**n).imag for n, c in enumerate(self.stiffness_harmonics, 1))
        error = sum((c * wave**n).imag for n, c in enumerate(self.error_harmonics, 1))
        rate = sum((n * c * wave**n).real for n, c in enumerate(self.error_harmonics, 1))
        return kappa, error, rate


class Model:
    """The equations of a deck at any point."""

    def __init__(self, path):
        """Read the deck; a missing group or key is an AttributeError, a wrong number a ValueError."""
        deck = decks.read_deck(path)
        self.deck = deck
        gears, box, mesh = deck.gears, deck.gearbox, deck.mesh
        angle = np.radians(gears.pressure_angle)
        sine, cosine = np.sin(angle), np.cos(angle)
        mass_p, self.force = decks.transmission(deck)

        # Rows: x1, y1, x2, y2, xM, yM as functions of the coordinates.
        moves = np.zeros((6, N))
        moves[0, [0, 4]] = moves[1, [1, 5]] = moves[2, [2, 4]] = moves[3, [3, 5]] = 1
        moves[1, 6], moves[3, 6] = -box.gear_offset, box.gear_offset
        moves[4, 4] = moves[5, 5] = 1
        body = np.array([gears.mass_1] * 2 + [gears.mass_2] * 2 + [box.mass] * 2)
        mass = moves.T @ (body[:, None] * moves)
        mass[6, 6] += box.inertia
        mass[7, 7] = mass_p
        direction = np.array([sine, -cosine, -sine, cosine, 0, 0, 2 * box.gear_offset * cosine, 1])

        self.length = mesh.half_backlash or self.force / mesh.mean_stiffness
        self.unit = np.full(N, self.length)
        self.unit[6] = self.length / (box.gear_offset or box.support_offset)
        self.inverse_mass = np.linalg.inv(mass) * self.unit / self.unit[:, None]
        self.inverse_mass[np.abs(self.inverse_mass) < 1e-14 * np.abs(self.inverse_mass).max()] = 0
        self.direction = direction * self.unit / self.length
        self.drive = np.linalg.solve(mass, direction) * self.length / self.unit
        self.observation = moves[1] * self.unit / self.length
        self.stiffness_harmonics = decks.harmonics(mesh, "stiffness_coefficients", "stiffness_phases")
        self.error_harmonics = decks.harmonics(mesh, "error_amplitudes", "error_phases") / self.length

    def at(self, speed, stiffness):
        """Equations at a speed [rev/min] on supports of that stiffness [N/m]."""
        deck = self.deck
        w = 2 * np.pi * deck.gears.teeth_1 * speed / 60
        k1, k2 = deck.bearings.stiffness_1, deck.bearings.stiffness_2
        c1, c2 = deck.bearings.damping_1, deck.bearings.damping_2
        c = 2 * deck.gearbox.damping_ratio * np.sqrt(deck.gearbox.mass * stiffness)
        support = np.array([1, 1, deck.gearbox.support_offset**2])
        return Equations(
            length=self.length,
            period=PERIOD / w,
            inverse_mass=self.inverse_mass,
            stiffness=np.array([k1, k1, k2, k2, *(support * stiffness), 0]) / w**2,
            damping=np.array([c1, c1, c2, c2, *(support * c), 0]) / w,
            drive=self.drive,
            direction=self.direction,
            observation=self.observation,
            mesh_stiffness=deck.mesh.mean_stiffness / w**2,
            mesh_damping=deck.mesh.damping / w,
            mean_force=self.force / (self.length * w**2),
            static_deflection=(self.force / deck.mesh.mean_stiffness + deck.mesh.half_backlash) / self.length,
            half_backlash=deck.mesh.half_backlash / self.length,
            stiffness_harmonics=self.stiffness_harmonics,
            error_harmonics=self.error_harmonics,
        )


def amplitude(function, first, last, samples=256):
    """Half the peak-to-peak of a motion between two times.

    `function(times)` gives values and rates at sorted times, shapes (times,). Extremes are located between
    the samples by bisection of the rate, so that the samples need only be near enough to tell the zeros of
    the rate apart: `samples` is their number a mesh period.
    """
    times = np.linspace(first, last, 1 + max(samples, round((last - first) / PERIOD * samples)))
    values, rates = function(times)
    left = np.flatnonzero(rates[:-1] * rates[1:] < 0)
    low, high, sign = times[left], times[left + 1], np.sign(rates[left])
    for _ in range(40):
        middle = (low + high) / 2
        same = np.sign(function(middle)[1]) == sign if len(middle) else np.zeros(0, bool)
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    turns = function((low + high) / 2)[0] if len(left) else []
    every = np.concatenate([values, turns])
    return float(every.max() - every.min()) / 2
