"""What the published features determine, and what they leave open."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spurflex_postproc.identify.fit import COARSE
from spurflex_postproc.identify.misfit import Feature, curve_misfit
from spurflex_postproc.identify.program import Program
from spurflex_postproc.identify.support import LOW
from spurflex_postproc.identify.unknowns import Unknowns

Reals = NDArray[np.float64]

PARAMETERS = (
    *("radius_1", "radius_2", "inertia_factor", "gear_offset"),
    *("support_offset", "stiffness_factor"),
)
"""Parameters whose effect is measured; the teeth enter as a factor on every speed."""
CHANGE = 0.03
"""Relative change to both sides from which the effect is measured."""
PHASE_CHANGE = 5.0
"""The same for the phase [deg]."""
LOOSE = 10.0
"""Uncertainty from which on a combination counts as not determined [percent]."""


@dataclass(frozen=True)
class Determined:
    """The effect of the parameters on the features, around one choice.

    Attributes:
        features: Names of the features, in order of the rows.
        parameters: Names of the parameters, in order of the columns.
        jacobian: Relative change of a feature for a relative change of a parameter; for the
            phase, for a radian; shape (n, m).
        singular: Singular values of the Jacobian with each row divided by the allowed deviation
            and with a change of one percent (of a hundredth radian) as the unit, shape (k,).
        directions: The combinations of parameters that belong to them, shape (k, m).
    """

    features: tuple[str, ...]
    parameters: tuple[str, ...]
    jacobian: Reals
    singular: Reals
    directions: Reals

    @property
    def uncertainty(self) -> Reals:
        """Change of each combination that moves the features by their allowance [percent]."""
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / self.singular)

    @property
    def rank(self) -> int:
        """How many combinations are known to better than `LOOSE`."""
        return int(np.count_nonzero(self.uncertainty < LOOSE))

    @property
    def condition(self) -> float:
        """Largest over smallest singular value."""
        return float(self.singular[0] / self.singular[-1]) if self.singular[-1] else float("inf")


def determined(program: Program, unknowns: Unknowns) -> Determined:
    """Measure the effect of each parameter on each feature with the program.

    Args:
        program: The program with the deck of the printed values.
        unknowns: The choice around which it is measured.

    Returns:
        Jacobian and singular values. A feature that is absent on either side of a change, or
        that jumps by more than a quarter, counts as not moved by it.

    Raises:
        ProgramError: If the program fails.
    """
    names = [*PARAMETERS, "error_phase", "teeth"]
    sides: list[Unknowns] = []
    for name in names:
        for sign in (1.0, -1.0):
            sides.append(_changed(unknowns, name, sign))
    runs = _features(program, sides)
    allowed = np.array([feature.allowed for feature in runs[0]])
    columns = []
    for at, name in enumerate(names):
        above, below = _speeds(runs[2 * at]), _speeds(runs[2 * at + 1])
        effect = np.log(above / below) / _width(unknowns, name)
        columns.append(np.where(np.abs(effect * _width(unknowns, name)) < 0.25, effect, 0.0))
    jacobian = np.nan_to_num(np.transpose(columns))
    scaled = 0.01 * jacobian / allowed[:, None]
    _, singular, directions = np.linalg.svd(scaled, full_matrices=False)
    return Determined(
        tuple(f"{feature.name} {feature.published:.0f}" for feature in runs[0]),
        tuple(names),
        jacobian,
        singular,
        directions,
    )


def _changed(unknowns: Unknowns, name: str, sign: float) -> Unknowns:
    """Change one parameter to one side."""
    if name == "error_phase":
        return replace(unknowns, error_phase=unknowns.error_phase + sign * PHASE_CHANGE)
    if name == "teeth":
        return replace(unknowns, teeth=unknowns.teeth + int(sign))
    return unknowns.with_values(**{name: getattr(unknowns, name) * (1 + sign * CHANGE)})


def _width(unknowns: Unknowns, name: str) -> float:
    """Return the distance of both sides in the unit of the Jacobian."""
    if name == "error_phase":
        return float(np.radians(2 * PHASE_CHANGE))
    if name == "teeth":
        return float(np.log((unknowns.teeth + 1) / (unknowns.teeth - 1)))
    return float(np.log((1 + CHANGE) / (1 - CHANGE)))


def _features(program: Program, several: Sequence[Unknowns]) -> list[list[Feature]]:
    """Run the grid of the search and the low speeds for several choices."""
    shared = [one.deck_values() for one in several]
    high = program.run_all(
        [{**COARSE, **one, "support": "'rigid'", "start": "'up'"} for one in shared]
    )
    low = program.run_all(
        [{**LOW, **one, "support": "'flexible'", "start": "'static'"} for one in shared]
    )
    return [
        curve_misfit(up, "rigid") + curve_misfit(down, "flexible", peaks_only=True)
        for up, down in zip(high, low, strict=True)
    ]


def _speeds(features: Sequence[Feature]) -> Reals:
    """Return the computed speeds [rev/min], NaN where a feature is absent or only half there."""
    return np.array(
        [
            np.nan if feature.computed is None or feature.partial else feature.computed
            for feature in features
        ]
    )
