"""The misfit around a fit, computed with the program on grids."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spurflex_postproc.identify.fit import rigid_misfits
from spurflex_postproc.identify.misfit import misfit
from spurflex_postproc.identify.program import Program
from spurflex_postproc.identify.support import flexible_peaks
from spurflex_postproc.identify.unknowns import PRINTED_STIFFNESS, TORQUES, Unknowns, balanced

Reals = NDArray[np.float64]

FORCES = np.linspace(1400.0, 2600.0, 9)
"""Mean mesh forces [N]."""
MASSES = np.linspace(0.66, 0.90, 7)
"""Mesh masses [kg]."""
PHASES = np.arange(-90.0, 91.0, 15.0)
"""Phases of the transmission error [deg]."""
PHASE_FORCES = np.linspace(1400.0, 2600.0, 7)
"""Mean mesh forces of the map over the phase [N]."""
OFFSETS = np.linspace(0.06, 0.105, 10)
"""Distances l_o [m]."""
SUPPORTS = np.linspace(0.104, 0.120, 9)
"""Distances l_x [m]."""
STIFFNESSES = np.array([0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0]) * 1e8
"""Support stiffnesses k_M [N/m]."""
TURNING = np.linspace(2.7e6, 3.5e6, 9)
"""Stiffnesses of the support against turning, k_M l_x^2 [N m]."""


@dataclass(frozen=True)
class Map:
    """Misfit over two parameters.

    Attributes:
        x: Values of the first parameter, shape (n,).
        y: Values of the second, shape (m,).
        misfit: In units of the allowed deviations, shape (m, n).
        at: Where the fit lies.
    """

    x: Reals
    y: Reals
    misfit: Reals
    at: tuple[float, float]


@dataclass(frozen=True)
class Landscape:
    """Four maps of the misfit.

    Attributes:
        mass: Over mesh force [N] and mesh mass [kg], rigid features.
        phase: Over mesh force [N] and phase [deg], rigid features.
        support: Over l_o and l_x [m], peaks on the flexible support.
        stiffness: Over k_M [N/m] and k_M l_x^2 [N m], the same peaks.
    """

    mass: Map
    phase: Map
    support: Map
    stiffness: Map


def landscape(program: Program, unknowns: Unknowns) -> Landscape:
    """Compute the maps around a fit.

    Args:
        program: The program with the deck of the printed values.
        unknowns: The fit.

    Returns:
        The maps.

    Raises:
        ProgramError: If the program fails.
    """
    force, mass = unknowns.mesh_force, unknowns.mesh_mass
    masses = [[_gears(unknowns, f, m) for f in FORCES] for m in MASSES]
    phases = [
        [replace(_gears(unknowns, f, mass), error_phase=float(p)) for f in PHASE_FORCES]
        for p in PHASES
    ]
    supports = [
        [replace(unknowns, gear_offset=float(o), support_offset=float(x)) for o in OFFSETS]
        for x in SUPPORTS
    ]
    stiffnesses = [[_turning(unknowns, k, turn) for k in STIFFNESSES] for turn in TURNING]
    stiffness = unknowns.support_stiffness
    return Landscape(
        mass=Map(FORCES, MASSES, _rigid(program, masses), (force, mass)),
        phase=Map(
            PHASE_FORCES,
            PHASES,
            _rigid(program, phases),
            (force, (unknowns.error_phase + 180.0) % 360.0 - 180.0),
        ),
        support=Map(
            OFFSETS,
            SUPPORTS,
            _flexible(program, supports),
            (unknowns.gear_offset, unknowns.support_offset),
        ),
        stiffness=Map(
            STIFFNESSES,
            TURNING,
            _flexible(program, stiffnesses),
            (stiffness, unknowns.turning_stiffness),
        ),
    )


def _gears(unknowns: Unknowns, force: float, mass: float) -> Unknowns:
    """Choose r1, r2 and the factor on J that give a mesh force and a mesh mass."""
    radius = TORQUES[0] / float(force)
    trial = replace(unknowns, radius_1=radius, radius_2=balanced(radius), inertia_factor=1.0)
    return replace(trial, inertia_factor=float(mass) / trial.mesh_mass)


def _turning(unknowns: Unknowns, stiffness: float, turning: float) -> Unknowns:
    """Choose the factor on k_M and l_x that give a stiffness and one against turning."""
    return replace(
        unknowns,
        stiffness_factor=float(stiffness) / PRINTED_STIFFNESS,
        support_offset=float(np.sqrt(turning / stiffness)),
    )


def _rigid(program: Program, grid: list[list[Unknowns]]) -> Reals:
    """Return the misfit of the rigid features on a grid."""
    values = rigid_misfits(program, [one for row in grid for one in row])
    return np.reshape(values, (len(grid), -1))


def _flexible(program: Program, grid: list[list[Unknowns]]) -> Reals:
    """Return the misfit of the peaks on the flexible support on a grid."""
    values = [
        misfit(features)
        for features in flexible_peaks(program, [one for row in grid for one in row])
    ]
    return np.reshape(values, (len(grid), -1))
