"""Writes what the identification found, as Markdown and JSON."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from spurflex_postproc.identify.determined import LOOSE, Determined
from spurflex_postproc.identify.fit import Fit
from spurflex_postproc.identify.hypotheses import DECKS
from spurflex_postproc.identify.misfit import Feature, misfit
from spurflex_postproc.markdown import table

PARAMETER_TEXT = {
    "radius_1": "r1",
    "radius_2": "r2",
    "inertia_factor": "J",
    "gear_offset": "l_o",
    "support_offset": "l_x",
    "stiffness_factor": "k_M",
    "error_phase": "phase",
    "teeth": "z1",
}
"""Parameters as they stand in tables."""

PREAMBLE = """\
# Parameters that the article does not print

These are values that fit the published features, not the authors' own. Deviations are relative to
the published speed. The misfit is the root mean square of the deviations in units of what is
allowed (1 % for peaks and the first jump, 3 % for borders of regimes), each at most 10 %; a feature
that is absent counts 10 %. Every figure below comes from runs of the program.
"""

RIGID_TEXT = """\
The rigid curve knows four of the parameters (r1, r2, J1, J2) only through two combinations, the
mesh mass m_t = 1/(r1^2/J1 + r2^2/J2) and the mean mesh force F = m_t (r1 T_d/J1 + r2 T_l/J2);
beside them it depends on z1 and on the phase of the transmission error against the mesh stiffness.
"""


def markdown(fits: Sequence[Fit], best: Fit, found: Determined, seconds: float) -> str:
    """Write the report for people.

    Args:
        fits: All hypotheses, fitted.
        best: The one with the least misfit.
        found: What is determined around it.
        seconds: Time that it all took.

    Returns:
        Markdown text.
    """
    parts = [PREAMBLE, "## Hypotheses\n", _hypotheses(fits), "## Misfit per feature\n"]
    parts += [
        _features(fits),
        *_stiffnesses(fits),
        "## What is determined\n",
        _determined(best, found),
    ]
    runs = sum(fit.runs for fit in fits)
    parts.append(f"{runs} runs of the program for the fits; {seconds:.0f} s in all.\n")
    return "\n".join(parts)


def as_json(fits: Sequence[Fit], best: Fit, found: Determined, seconds: float) -> dict[str, Any]:
    """Return the same content for scripts; arguments as of `markdown`."""
    return {
        "note": "values that fit the published features, not the authors' own",
        "best": best.hypothesis.key,
        "seconds": round(seconds, 1),
        "fits": [
            {
                "hypothesis": fit.hypothesis.key,
                "statement": fit.hypothesis.statement,
                "parameters": fit.unknowns.as_dict(),
                "misfit": fit.misfit,
                "misfit_rigid": misfit(_rigid(fit)),
                "misfit_by_start": fit.by_start,
                "features": [
                    {**asdict(feature), "deviation": feature.deviation, "agrees": feature.agrees}
                    for feature in fit.features
                ],
                "stiffnesses": [
                    {
                        "stiffness_factor": one.unknowns.stiffness_factor,
                        "gear_offset": one.unknowns.gear_offset,
                        "support_offset": one.unknowns.support_offset,
                        "deviations": [feature.deviation for feature in one.features],
                    }
                    for one in fit.supports
                ],
                "runs": fit.runs,
            }
            for fit in fits
        ],
        "determined": {
            "around": best.hypothesis.key,
            "features": list(found.features),
            "parameters": list(found.parameters),
            "jacobian": found.jacobian.tolist(),
            "singular_values": found.singular.tolist(),
            "directions": found.directions.tolist(),
            "condition": found.condition,
            "rank": found.rank,
        },
    }


def _rigid(fit: Fit) -> list[Feature]:
    """Return the features of the rigid support."""
    return [feature for feature in fit.features if feature.name.startswith("rigid")]


def _hypotheses(fits: Sequence[Fit]) -> str:
    """Say what was supposed and what came out."""
    lines = [f"- **{fit.hypothesis.key}**: {fit.hypothesis.statement}." for fit in fits]
    head = [
        *("hypothesis", "z1", "r1 mm", "r2 mm", "J1, J2 kg m2 (factor)", "k_M N/m"),
        *("l_o mm", "l_x mm", "phase deg", "m_t kg", "F N"),
        *("misfit rigid", "misfit all", "agree", "regular agree"),
    ]
    rows = []
    for fit in fits:
        one = fit.unknowns
        inertia = ", ".join(f"{value:.5f}" for value in one.inertias)
        rows.append(
            [
                fit.hypothesis.key,
                str(one.teeth),
                f"{1e3 * one.radius_1:.1f}",
                f"{1e3 * one.radius_2:.1f}",
                f"{inertia} ({one.inertia_factor:.3g})",
                f"{one.support_stiffness:.2e}",
                f"{1e3 * one.gear_offset:.1f}",
                f"{1e3 * one.support_offset:.1f}",
                f"{one.error_phase:.0f}",
                f"{one.mesh_mass:.3f}",
                f"{one.mesh_force:.0f}",
                f"{misfit(_rigid(fit)):.2f}",
                f"{fit.misfit:.2f}",
                _agreeing(fit.features),
                _agreeing([feature for feature in fit.features if feature.regular]),
            ]
        )
    starts = list(fits[0].by_start)
    by_start = [
        [fit.hypothesis.key, *(f"{fit.by_start[start]:.2f}" for start in starts)] for fit in fits
    ]
    return "\n".join(
        [
            *lines,
            "",
            table(head, rows),
            "Regular: the peaks, the first jump and the borders from 1T to 2T motion; the borders"
            " of irregular and 3T motion depend on the start and on the step as well. The decks of"
            f" the figures carry '{DECKS}', with the phase as it is printed.\n",
            "The start decides among coexisting motions; misfit of all features by start:\n",
            table(["hypothesis", *starts], by_start),
        ]
    )


def _agreeing(features: Sequence[Feature]) -> str:
    """Count the features that agree."""
    return f"{sum(feature.agrees for feature in features)} of {len(features)}"


def _features(fits: Sequence[Fit]) -> str:
    """Set each published feature beside the computed ones; bold where they agree."""
    rows = []
    for at, feature in enumerate(fits[0].features):
        row = [feature.name, f"{feature.published:.0f}"]
        for fit in fits:
            here = fit.features[at]
            if here.deviation is None:
                row.append("none")
                continue
            text = f"{here.computed:.0f} ({100 * here.deviation:+z.1f} %)"
            row.append(f"**{text}**" if here.agrees else text + (" *" if here.partial else ""))
        rows.append(row)
    keys = [fit.hypothesis.key for fit in fits]
    note = "Bold: agrees. *: only one of the two regimes of the border was found.\n"
    return "\n".join([table(["feature", "published", *keys], rows), note])


def _stiffnesses(fits: Sequence[Fit]) -> list[str]:
    """Show what the peaks on the flexible support say about k_M; nothing where it was not free."""
    parts = []
    for fit in fits:
        if len(fit.supports) < 2:
            continue
        peaks = [f"peak {feature.published:.0f}" for feature in fit.supports[0].features]
        head = ["factor", "k_M N/m", "l_o mm", "l_x mm", "k_M l_x^2 N m", *peaks, "agree"]
        rows = []
        for support in fit.supports:
            one = support.unknowns
            taken = " (taken)" if one == fit.unknowns else ""
            off = [
                "none" if feature.deviation is None else f"{100 * feature.deviation:+z.2f} %"
                for feature in support.features
            ]
            rows.append(
                [
                    f"{one.stiffness_factor:g}{taken}",
                    f"{one.support_stiffness:.2e}",
                    f"{1e3 * one.gear_offset:.1f}",
                    f"{1e3 * one.support_offset:.1f}",
                    f"{one.turning_stiffness:.2e}",
                    *off,
                    _agreeing(support.features),
                ]
            )
        parts += [
            f"## Support stiffness with '{fit.hypothesis.key}'\n",
            "The peaks on the flexible support with l_o and l_x fitted anew for each k_M. They know"
            " k_M l_x^2 well and k_M itself hardly: it moves the highest peak only.\n",
            table(head, rows),
        ]
    return parts


def _determined(best: Fit, found: Determined) -> str:
    """Say what the features determine."""
    names = [PARAMETER_TEXT[name] for name in found.parameters]
    effect = [
        [feature, *(f"{value:+z.2f}" for value in row)]
        for feature, row in zip(found.features, found.jacobian, strict=True)
    ]
    rows = []
    for value, change, direction in zip(
        found.singular, found.uncertainty, found.directions, strict=True
    ):
        known = f"{change:.1f} %" if np.isfinite(change) and change < 1e3 else "not at all"
        verdict = "determined" if change < LOOSE else "open"
        rows.append([f"{value:.3f}", known, verdict, _combination(names, direction)])
    return "\n".join(
        [
            RIGID_TEXT,
            f"Around '{best.hypothesis.key}': relative change of a feature for a relative change of"
            " a parameter (of the phase: for a radian).\n",
            table(["feature", *names], effect),
            "Singular values of this matrix, each row divided by what is allowed, for changes of"
            " 1 % (of the phase: 0.6 degrees). The uncertainty is the change of the combination"
            " that moves the features by what is allowed.\n",
            table(["singular value", "uncertainty", "", "combination"], rows),
            f"{found.rank} of {len(names)} combinations are determined to better than"
            f" {LOOSE:.0f} %; condition {found.condition:.3g}.\n",
        ]
    )


def _combination(names: Sequence[str], direction: np.ndarray[Any, Any]) -> str:
    """Write a direction as its largest parts."""
    order = np.argsort(-np.abs(direction))
    parts = [f"{direction[at]:+z.2f} {names[at]}" for at in order if abs(direction[at]) > 0.2]
    return " ".join(parts)
