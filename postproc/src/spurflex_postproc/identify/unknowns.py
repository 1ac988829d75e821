"""The parameters that are sought, and what the rigid model knows of them."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import cos, radians

PRINTED_INERTIA = (0.041, 0.079)
"""Moments of inertia in Table 1 [kg m2]."""
PRINTED_STIFFNESS = 2.5e5
"""Support stiffness in section 3.1 [N/m]."""
TORQUES = (110.0, 150.0)
"""Driving and load torque in Table 1 [N m]."""
PRESSURE_ANGLE = 20.0
"""Table 1 [deg]."""


@dataclass(frozen=True)
class Unknowns:
    """One choice of the parameters.

    Attributes:
        radius_1: Base radius of gear 1 [m].
        radius_2: Base radius of gear 2 [m].
        teeth: Teeth of gear 1.
        gear_offset: l_o [m].
        support_offset: l_x [m].
        inertia_factor: On the printed moments of inertia of both gears.
        stiffness_factor: On the printed support stiffness.
        error_phase: Phase of the transmission error against the mesh stiffness [deg].
        steps: Steps a mesh period of Newmark's method; 0 for steps as small as need be.
    """

    radius_1: float
    radius_2: float
    teeth: int
    gear_offset: float
    support_offset: float
    inertia_factor: float
    stiffness_factor: float
    error_phase: float = 0.0
    steps: int = 0

    @property
    def inertias(self) -> tuple[float, float]:
        """Moments of inertia of both gears [kg m2]."""
        return (
            self.inertia_factor * PRINTED_INERTIA[0],
            self.inertia_factor * PRINTED_INERTIA[1],
        )

    @property
    def support_stiffness(self) -> float:
        """Support stiffness k_M [N/m]."""
        return self.stiffness_factor * PRINTED_STIFFNESS

    @property
    def turning_stiffness(self) -> float:
        """Stiffness of the support against turning, k_M l_x^2 [N m]."""
        return self.support_stiffness * self.support_offset**2

    @property
    def mesh_mass(self) -> float:
        """Equivalent mass along the line of action, 1 / (r1^2/J1 + r2^2/J2) [kg]."""
        one, two = self.inertias
        return 1.0 / (self.radius_1**2 / one + self.radius_2**2 / two)

    @property
    def mesh_force(self) -> float:
        """Mean mesh force [N]; with balanced torques T_d / r1."""
        one, two = self.inertias
        return self.mesh_mass * (
            self.radius_1 * TORQUES[0] / one + self.radius_2 * TORQUES[1] / two
        )

    def with_values(self, **values: float) -> "Unknowns":
        """Return a copy with some parameters replaced."""
        return replace(self, **values)  # type: ignore[arg-type]

    def deck_values(self) -> dict[str, str]:
        """Return keys of a deck and their values as text."""
        one, two = self.inertias
        stiffness = self.support_stiffness
        coarse = {"integrator": "'newmark'", "steps_per_period": str(self.steps)}
        return {
            **(coarse if self.steps else {}),
            "teeth_1": str(self.teeth),
            "base_radius_1": f"{self.radius_1:.12e}",
            "base_radius_2": f"{self.radius_2:.12e}",
            "inertia_1": f"{one:.12e}",
            "inertia_2": f"{two:.12e}",
            "gear_offset": f"{self.gear_offset:.12e}",
            "support_offset": f"{self.support_offset:.12e}",
            "stiffness_first": f"{stiffness:.12e}",
            "stiffness_last": f"{stiffness:.12e}",
            "error_phases": f"{(self.error_phase + 180.0) % 360.0 - 180.0:.6f}",
        }

    def as_dict(self) -> dict[str, float]:
        """Return the parameters and what follows from them, for a report."""
        return {**asdict(self), "mesh_mass": self.mesh_mass, "mesh_force": self.mesh_force}


def balanced(radius_1: float) -> float:
    """Return the base radius of gear 2 with which the torques balance [m]."""
    return radius_1 * TORQUES[1] / TORQUES[0]


def standard_gears(module: float, teeth: int) -> Mapping[str, float]:
    """Return what follows from a pair of standard gears with balanced torques.

    Args:
        module: Module [m].
        teeth: Teeth of gear 1.

    Returns:
        `radius_1`, `radius_2` and `gear_offset` [m]; the latter is half the centre distance.
    """
    pitch = module * teeth / 2
    base = pitch * cos(radians(PRESSURE_ANGLE))
    return {
        "radius_1": base,
        "radius_2": balanced(base),
        "gear_offset": (pitch + balanced(pitch)) / 2,
    }
