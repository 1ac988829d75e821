"""Explains disagreements by what other starts, steps and parameters give."""

from collections.abc import Sequence

from spurflex_postproc.published_table.row import Row, written
from spurflex_postproc.published_table.sources import Trial

CAUSES = {
    "start": "with another start",
    "step": "with another time step",
    "parameter": "with another parameter",
    "both": "with another time step and parameter",
}
"""What a trial shows by its kind."""
SIMPLEST = tuple(CAUSES)
"""Kinds in the order in which they are preferred."""


def explained(
    rows: Sequence[Row],
    trials: Sequence[tuple[Trial, Sequence[Row]]],
    standing: dict[str, str],
) -> list[Row]:
    """Give every row that disagrees an explanation.

    Args:
        rows: Rows of the reference.
        trials: Results with other settings, and the same rows from each.
        standing: Explanations by key of what no trial can tell, from `published.toml`.

    Returns:
        The rows. The explanation names the trial in which the row agrees, a start before a time
        step before a parameter; if there is none, that whose value is nearest, and the standing
        explanation if there is one.
    """
    several = [(trial, {row.key: row for row in found}) for trial, found in trials]
    done = []
    for row in rows:
        if row.agrees is not False:
            done.append(row)
            continue
        there = [(trial, found[row.key]) for trial, found in several if row.key in found]
        parts = [_evidence(row, there), standing.get(row.key, "")]
        done.append(row.explained("; ".join(part for part in parts if part)))
    return done


def _evidence(row: Row, there: Sequence[tuple[Trial, Row]]) -> str:
    """Say what the trials give for one row."""
    if not there:
        return ""
    agreeing = [(trial, other) for trial, other in there if other.agrees]
    if agreeing:
        trial, other = min(
            agreeing, key=lambda one: (SIMPLEST.index(one[0].kind), _distance(one[1]))
        )
        return f"{CAUSES[trial.kind]}: {trial.label} gives {shown(other)}"
    known = [one for one in there if one[1].deviation is not None]
    if row.deviation is None and not known:
        none = f"none of {len(there)} other settings gives it either"
        trial, other = max(there, key=lambda one: one[1].met or 0.0)
        if (other.met or 0.0) <= (row.met or 0.0):
            return none
        return f"{none}; nearest: {trial.label} gives {shown(other)}" + (
            f" ({other.note})" if other.note else ""
        )
    best = min(known, key=lambda one: _distance(one[1]), default=None)
    if best is None or (row.deviation is not None and _distance(best[1]) >= _distance(row)):
        return f"no nearer with any of {len(there)} other settings"
    return f"nearest of {len(there)} other settings: {best[0].label} gives {shown(best[1])}" + (
        f" ({best[1].note})" if best[1].note else ""
    )


def _distance(row: Row) -> float:
    """Return the size of the deviation; statements count as exact."""
    return abs(row.deviation) if row.deviation is not None else 0.0


def shown(row: Row) -> str:
    """Write the computed value of a row, with its deviation if it is a number."""
    if row.computed is None:
        return "nothing"
    if row.deviation is None:
        return written(row.computed)
    return f"{written(row.computed)} ({100 * row.deviation:+z.1f} %)"
