"""Fits one hypothesis to the published features, with the program itself."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from spurflex_postproc.identify.hypotheses import Hypothesis
from spurflex_postproc.identify.linear import MeanSystem
from spurflex_postproc.identify.misfit import Feature, curve_misfit, misfit
from spurflex_postproc.identify.program import Program
from spurflex_postproc.identify.search import compass
from spurflex_postproc.identify.support import SupportFit, fit_stiffness, nearest_agreeing
from spurflex_postproc.identify.unknowns import Unknowns
from spurflex_postproc.published import published_curve

Reals = NDArray[np.float64]

STARTS = ("up", "down", "static", "rest")
FITTED_START = "up"
"""The start that is fitted: the article speaks of the speed as it increases."""

COARSE = {
    "speed_first": "1000.0",
    "speed_last": "6000.0",
    "speed_count": "251",
    "tolerance": "1.0e-4",
    "max_periods": "1000",
    "measured_periods": "100",
}
"""Deck of the search in the rigid features."""
FINE = {**COARSE, "speed_first": "300.0", "speed_count": "571", "max_periods": "4000"}
"""Deck of the figures that are reported."""

SHORTLIST = 8
"""First points that the linear system leaves for the program, for each number of teeth."""
LIKELY = 3
"""Numbers of teeth that the linear system leaves for the program."""


@dataclass(frozen=True)
class Fit:
    """One hypothesis, fitted.

    Attributes:
        hypothesis: What was fitted.
        unknowns: The parameters.
        features: Features of the reported runs with the fitted start.
        by_start: Misfit of the same parameters by start.
        runs: Runs of the program that it took.
        supports: The flexible support with every k_M that was tried; empty if it was not fitted.
    """

    hypothesis: Hypothesis
    unknowns: Unknowns
    features: list[Feature]
    by_start: dict[str, float]
    runs: int
    supports: list[SupportFit] = field(default_factory=list)

    @property
    def misfit(self) -> float:
        """Root mean square of the deviations in units of the allowed ones."""
        return misfit(self.features)


def fit(hypothesis: Hypothesis, program: Program, mean: MeanSystem) -> Fit:
    """Fit one hypothesis.

    First the coordinates that the rigid support knows, by a search with the program from the
    points that the linear system likes best; then l_o and l_x, with each k_M that the hypothesis
    allows, by Gauss-Newton steps on the peaks of the flexible support.

    Args:
        hypothesis: What to fit.
        program: The program with the deck of the printed values.
        mean: The linear system of the same deck.

    Returns:
        The fit, with features from runs on the grid of figure 2.

    Raises:
        ProgramError: If the program fails.
    """
    before = program.runs
    best: tuple[float, Unknowns] | None = None
    for teeth in _likely_teeth(hypothesis, mean):

        def values(points: list[Reals], teeth: int = teeth) -> list[float]:
            chosen = [hypothesis.make(point, teeth) for point in points]
            return rigid_misfits(program, chosen)

        starts = _shortlist(hypothesis, mean, teeth)
        found = compass(values, starts, np.array(hypothesis.steps), halvings=2, most=60)
        if best is None or found.value < best[0]:
            best = found.value, hypothesis.make(found.point, teeth)
    assert best is not None
    unknowns = best[1]
    supports: list[SupportFit] = []
    if hypothesis.support_free:
        factors = hypothesis.stiffness_factors or (unknowns.stiffness_factor,)
        supports = fit_stiffness(
            unknowns, factors, program, mean, offset_free=hypothesis.offset_free
        )
        unknowns = nearest_agreeing(supports, unknowns.stiffness_factor).unknowns
    features, by_start = reported(program, unknowns)
    return Fit(hypothesis, unknowns, features, by_start, program.runs - before, supports)


def rigid_misfits(program: Program, several: Sequence[Unknowns]) -> list[float]:
    """Run the rigid support for several choices of the parameters; return their misfits."""
    decks = [
        {**COARSE, **one.deck_values(), "support": "'rigid'", "start": f"'{FITTED_START}'"}
        for one in several
    ]
    return [misfit(curve_misfit(result, "rigid")) for result in program.run_all(decks)]


def reported(
    program: Program, unknowns: Unknowns, starts: Sequence[str] = STARTS
) -> tuple[list[Feature], dict[str, float]]:
    """Run the grid of figure 2 with several starts.

    Returns:
        The features with the first start, and the misfit by start.
    """
    decks = [
        {**FINE, **unknowns.deck_values(), "support": "'both'", "start": f"'{start}'"}
        for start in starts
    ]
    several = [
        curve_misfit(result, "rigid") + curve_misfit(result, "flexible")
        for result in program.run_all(decks)
    ]
    by_start = dict(zip(starts, map(misfit, several), strict=True))
    return several[0], by_start


def _likely_teeth(hypothesis: Hypothesis, mean: MeanSystem) -> list[int]:
    """Return the numbers of teeth that the linear system likes best."""
    told = published_curve("rigid").peaks
    best = {
        teeth: min(
            float(np.sum(mean.deviations(hypothesis.make(np.array(point), teeth), told, ()) ** 2))
            for point in hypothesis.starts
        )
        for teeth in hypothesis.teeth
    }
    return sorted(best, key=lambda teeth: best[teeth])[:LIKELY]


def _shortlist(hypothesis: Hypothesis, mean: MeanSystem, teeth: int) -> list[Reals]:
    """Return the first points that the linear system likes best."""
    told = published_curve("rigid").peaks
    points = [np.array(point) for point in hypothesis.starts]
    off = [
        float(np.sum(mean.deviations(hypothesis.make(point, teeth), told, ()) ** 2))
        for point in points
    ]
    return [points[at] for at in np.argsort(off, kind="stable")[:SHORTLIST]]
