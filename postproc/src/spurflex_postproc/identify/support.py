"""Fits the flexible support: l_o and l_x to its peaks, for one or several stiffnesses k_M."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from spurflex_postproc.identify.linear import MeanSystem
from spurflex_postproc.identify.misfit import Feature, curve_misfit, misfit
from spurflex_postproc.identify.program import Program
from spurflex_postproc.identify.unknowns import Unknowns
from spurflex_postproc.published import published_curve

LOW = {
    "speed_first": "300.0",
    "speed_last": "2200.0",
    "speed_count": "191",
    "tolerance": "1.0e-4",
    "max_periods": "1000",
    "measured_periods": "100",
}
"""Deck of the search in the peaks on the flexible support."""

GAUSS_STEPS = 3
"""Corrections of l_o and l_x."""
NUDGE = 0.02
"""Relative change of l_o and l_x from which their effect is measured."""
AROUND = (0.85, 0.9, 0.95, 1.0, 1.05)
"""Factors on the l_x of the linear system with which the program is tried first."""


@dataclass(frozen=True)
class SupportFit:
    """The support, fitted with one stiffness.

    Attributes:
        unknowns: The parameters.
        features: The peaks on the flexible support.
    """

    unknowns: Unknowns
    features: list[Feature]

    @property
    def agreeing(self) -> int:
        """How many peaks agree."""
        return sum(feature.agrees for feature in self.features)


def flexible_peaks(program: Program, several: Sequence[Unknowns]) -> list[list[Feature]]:
    """Run the flexible support up to the peaks for several choices of the parameters."""
    decks = [
        {**LOW, **one.deck_values(), "support": "'flexible'", "start": "'static'"}
        for one in several
    ]
    return [curve_misfit(result, "flexible", peaks_only=True) for result in program.run_all(decks)]


def fit_support(
    unknowns: Unknowns, program: Program, mean: MeanSystem, *, offset_free: bool
) -> SupportFit:
    """Fit l_x, and l_o where it is free, to the peaks on the flexible support.

    Args:
        unknowns: All other parameters, k_M among them.
        program: The program with the deck of the printed values.
        mean: The linear system of the same deck; gives the first guess.
        offset_free: Whether l_o is free; else it is kept.

    Returns:
        The parameters after Gauss-Newton steps as long as they help.

    Raises:
        ProgramError: If the program fails.
    """
    names = ["support_offset"] + ["gear_offset"] * offset_free
    guess = _linear_support(unknowns, names, mean)
    tries = [_scaled(guess, "support_offset", factor) for factor in AROUND]
    found = flexible_peaks(program, tries)
    best = int(np.argmin([misfit(run) for run in found]))
    current, base = tries[best], found[best]
    for _ in range(GAUSS_STEPS):
        nudged = [_scaled(current, name, 1 + NUDGE) for name in names]
        there = flexible_peaks(program, nudged)
        if any(feature.computed is None for run in (base, *there) for feature in run):
            break
        rest = np.array([feature.deviation for feature in base], dtype=float)
        slopes = np.array([[feature.deviation for feature in run] for run in there], dtype=float)
        jacobian = (slopes - rest).T / np.log1p(NUDGE)
        change = np.clip(-np.linalg.lstsq(jacobian, rest, rcond=None)[0], -0.2, 0.2)
        trial = current
        for name, step in zip(names, change, strict=True):
            trial = _scaled(trial, name, float(np.exp(step)))
        after = flexible_peaks(program, [trial])[0]
        if misfit(after) >= misfit(base):
            break
        current, base = trial, after
    return SupportFit(current, base)


def fit_stiffness(
    unknowns: Unknowns,
    factors: Sequence[float],
    program: Program,
    mean: MeanSystem,
    *,
    offset_free: bool,
) -> list[SupportFit]:
    """Fit the support with several stiffnesses k_M.

    Args:
        unknowns: All other parameters; its k_M is not used.
        factors: Factors on the printed k_M.
        program: As of `fit_support`, like the others.
        mean: As of `fit_support`.
        offset_free: As of `fit_support`.

    Returns:
        One fit a factor, in their order.
    """
    return [
        fit_support(
            replace(unknowns, stiffness_factor=factor), program, mean, offset_free=offset_free
        )
        for factor in factors
    ]


def nearest_agreeing(supports: Sequence[SupportFit], wanted: float) -> SupportFit:
    """Choose the stiffness nearest to a wanted one with which as many peaks agree as with any.

    The peaks alone leave k_M open within wide limits, for a softer support with its springs
    farther apart turns as easily; so the reading that departs least is taken, not the least misfit.

    Args:
        supports: Fits with several stiffnesses.
        wanted: Factor on the printed k_M from which the choice should depart least.

    Returns:
        One of the fits.
    """
    most = max(one.agreeing for one in supports)
    return min(
        (one for one in supports if one.agreeing == most),
        key=lambda one: abs(np.log(one.unknowns.stiffness_factor / wanted)),
    )


def _linear_support(unknowns: Unknowns, names: Sequence[str], mean: MeanSystem) -> Unknowns:
    """Choose l_x, and l_o where it is free, by the eigenfrequencies, on a grid."""
    told = published_curve("flexible").peaks
    offsets = np.geomspace(0.03, 5.0, 90)
    gears = np.linspace(0.03, 0.16, 40) if "gear_offset" in names else [unknowns.gear_offset]
    choices = [
        replace(unknowns, support_offset=float(x), gear_offset=float(o))
        for x in offsets
        for o in gears
    ]
    off = [np.sum(mean.deviations(choice, (), told) ** 2) for choice in choices]
    return choices[int(np.argmin(off))]


def _scaled(unknowns: Unknowns, name: str, factor: float) -> Unknowns:
    """Multiply one parameter."""
    return unknowns.with_values(**{name: getattr(unknowns, name) * factor})
