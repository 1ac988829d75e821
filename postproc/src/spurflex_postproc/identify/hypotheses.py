"""What could have been meant: the hypotheses that are fitted."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spurflex_postproc.identify.unknowns import Unknowns, balanced, standard_gears

Reals = NDArray[np.float64]

ISO_MODULES = (2e-3, 2.5e-3, 3e-3)
"""Standard modules from which gears of 55 and 75 teeth are about as heavy as printed [m]."""

STEPS = 16
"""A coarse step: the article used Newmark's method with a step that it does not print."""
INERTIA = "inertia"
TENTH = "tenth"
DECKS = "decks"
"""What the decks of the figures carry."""

STIFFNESS_FACTORS = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0, 900.0, 1e3, 1.2e3)
"""Factors on the printed k_M that are tried where it is free; 1000 reads it as N/mm."""

TEN = 10.0
"""Step of the phase that is worth a step of the other coordinates [deg]."""


@dataclass(frozen=True)
class Hypothesis:
    """A reading of the printed values, and what it leaves free.

    Attributes:
        key: Short name.
        statement: What it supposes.
        free: Names of the coordinates that the rigid features have to determine.
        starts: First points of the search in those coordinates.
        steps: First steps.
        make: Turns coordinates and teeth into parameters.
        teeth: Teeth of gear 1 that are tried.
        offset_free: Whether l_o is free as well; else it follows from the gears.
        support_free: Whether l_x is free as well.
        stiffness_factors: Factors on k_M that are tried; empty if `make` says which one.
    """

    key: str
    statement: str
    free: tuple[str, ...]
    starts: tuple[tuple[float, ...], ...]
    steps: tuple[float, ...]
    make: Callable[[Reals, int], Unknowns]
    teeth: tuple[int, ...]
    offset_free: bool = True
    support_free: bool = True
    stiffness_factors: tuple[float, ...] = ()


def _table_1(_: Reals, teeth: int) -> Unknowns:
    """Free: nothing."""
    return Unknowns(0.05168, 0.07048, teeth, 0.08, 0.11, 1.0, 1.0)


def _radius(inertia: float, stiffness: float) -> Callable[[Reals, int], Unknowns]:
    """Free: logarithm of r1; torques balance."""

    def make(point: Reals, teeth: int) -> Unknowns:
        radius = float(np.exp(point[0]))
        return Unknowns(radius, balanced(radius), teeth, 0.08, 0.11, inertia, stiffness)

    return make


def _inertia(stiffness: float, steps: int = 0) -> Callable[[Reals, int], Unknowns]:
    """Free: logarithms of r1 and of the factor on J, and the phase if there is a third."""

    def make(point: Reals, teeth: int) -> Unknowns:
        radius, factor = (float(value) for value in np.exp(point[:2]))
        phase = TEN * float(point[2]) if point.size > 2 else 0.0
        return Unknowns(
            radius, balanced(radius), teeth, 0.08, 0.11, factor, stiffness, phase, steps
        )

    return make


def _unbalanced(point: Reals, teeth: int) -> Unknowns:
    """Free: logarithms of both radii; J a tenth of what is printed."""
    one, two = (float(value) for value in np.exp(point))
    return Unknowns(one, two, teeth, 0.08, 0.11, 0.1, 1e3)


def _decks(_: Reals, teeth: int) -> Unknowns:
    """Free: nothing but the support."""
    gears = standard_gears(ISO_MODULES[0], teeth)
    return Unknowns(gears["radius_1"], gears["radius_2"], teeth, 0.08, 0.11, 0.1, 1e3)


def _standard(module: float) -> Callable[[Reals, int], Unknowns]:
    """Free: logarithm of the factor on J, and the phase."""

    def make(point: Reals, teeth: int) -> Unknowns:
        gears = standard_gears(module, teeth)
        return Unknowns(
            gears["radius_1"],
            gears["radius_2"],
            teeth,
            gears["gear_offset"],
            0.11,
            float(np.exp(point[0])),
            1e3,
            TEN * float(point[1]),
        )

    return make


def hypotheses() -> list[Hypothesis]:
    """Return the hypotheses, from the printed values to ever more freedom."""
    near = (54, 55, 56)
    log = np.log
    grid = [
        (float(log(110.0 / force)), float(log(_factor(force, mass))))
        for force, mass in ((1700, 0.76), (1900, 0.76), (2100, 0.78), (2300, 0.78), (2250, 0.87))
    ]
    return [
        Hypothesis(
            "table 1",
            "every printed value as it stands, with r1, r2, z1, l_o and l_x of the deck; none free",
            (),
            ((),),
            (),
            _table_1,
            (55,),
            offset_free=False,
            support_free=False,
        ),
        Hypothesis(
            "printed",
            "every printed value as it stands; r1, z1, l_o and l_x free, the torques balance",
            ("r1",),
            tuple((float(log(radius)),) for radius in (0.05, 0.08, 0.12, 0.16)),
            (0.05,),
            _radius(1.0, 1.0),
            (24, 30, 40, 55),
        ),
        Hypothesis(
            TENTH,
            "J a tenth of what is printed, k_M in N/mm; r1, z1, l_o, l_x free, the torques balance",
            ("r1",),
            tuple((float(log(radius)),) for radius in (0.046, 0.05, 0.054)),
            (0.02,),
            _radius(0.1, 1e3),
            near,
        ),
        Hypothesis(
            DECKS,
            "base radii of standard gears of module 2 mm with 55 and 75 teeth, J a tenth of what"
            " is printed; l_o and l_x free, and k_M by any factor: that nearest to N/mm with which"
            " most of the peaks on the flexible support agree",
            (),
            ((),),
            (),
            _decks,
            (55,),
            stiffness_factors=STIFFNESS_FACTORS,
        ),
        Hypothesis(
            "unbalanced",
            f"as '{TENTH}', but r2 free: the torques need not balance",
            ("r1", "r2"),
            tuple((float(log(a)), float(log(b))) for a, b in ((0.052, 0.07), (0.06, 0.055))),
            (0.04, 0.04),
            _unbalanced,
            near,
        ),
        Hypothesis(
            INERTIA,
            "J by any factor, k_M in N/mm; r1 and z1 free, the torques balance",
            ("r1", "J"),
            tuple(grid),
            (0.04, 0.04),
            _inertia(1e3),
            near,
        ),
        Hypothesis(
            "phase",
            f"as '{INERTIA}', and the transmission error shifted in phase against the stiffness",
            ("r1", "J", "phase"),
            tuple((*point, turn) for point in grid for turn in (-6.0, -3.0, 0.0, 3.0, 6.0)),
            (0.04, 0.04, 1.5),
            _inertia(1e3),
            near,
        ),
        Hypothesis(
            "coarse step",
            f"as '{INERTIA}', and {STEPS} Newmark steps a mesh period in place of fine ones",
            ("r1", "J"),
            tuple(grid),
            (0.04, 0.04),
            _inertia(1e3, STEPS),
            near,
        ),
        *(
            Hypothesis(
                f"module {1e3 * module:g} mm",
                f"standard gears of module {1e3 * module:g} mm with 55 and 75 teeth, l_o half the"
                " centre distance, J by any factor, the phase free",
                ("J", "phase"),
                tuple(
                    (float(log(_factor_of(module, 0.76))), turn)
                    for turn in (-6.0, -3.0, 0.0, 3.0, 6.0)
                ),
                (0.04, 1.5),
                _standard(module),
                (55,),
                offset_free=False,
            )
            for module in ISO_MODULES
        ),
    ]


def _factor(force: float, mass: float) -> float:
    """Return the factor on J that gives a mesh mass [kg] with a mesh force [N]."""
    radius = 110.0 / force
    one = Unknowns(radius, balanced(radius), 55, 0.08, 0.11, 1.0, 1.0)
    return mass / one.mesh_mass


def _factor_of(module: float, mass: float) -> float:
    """Return the factor on J that gives a mesh mass [kg] with gears of a module [m]."""
    return _factor(110.0 / standard_gears(module, 55)["radius_1"], mass)
