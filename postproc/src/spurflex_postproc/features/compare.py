"""Sets published features against computed ones."""

from collections.abc import Sequence
from dataclasses import dataclass

WITHIN = 0.10
"""Largest distance of a computed feature from its published partner, as a fraction."""


@dataclass(frozen=True)
class Comparison:
    """Published and computed speeds of one kind of feature.

    Attributes:
        pairs: Published speed and its computed partner or None [rev/min].
        others: Computed speeds without a published partner [rev/min].
    """

    pairs: list[tuple[float, float | None]]
    others: list[float]


def compare(
    published: Sequence[float], computed: Sequence[float], *, within: float = WITHIN
) -> Comparison:
    """Pair published with computed features, the closest first, each used once.

    A pair may lie no farther apart than the published feature and the next published one.

    Args:
        published: Published speeds [rev/min].
        computed: Computed speeds [rev/min].
        within: Largest distance of a pair, as a fraction of the published speed.

    Returns:
        A pair for every published speed, and the computed speeds left over.
    """
    partner: dict[int, int] = {}
    room = [
        min((abs(other / here - 1) for j, other in enumerate(published) if j != i), default=within)
        for i, here in enumerate(published)
    ]
    distances = sorted(
        (abs(there / here - 1), i, j)
        for i, here in enumerate(published)
        for j, there in enumerate(computed)
    )
    for distance, i, j in distances:
        if distance <= min(within, room[i]) and i not in partner and j not in partner.values():
            partner[i] = j
    pairs = [
        (here, computed[partner[i]] if i in partner else None) for i, here in enumerate(published)
    ]
    others = [there for j, there in enumerate(computed) if j not in partner.values()]
    return Comparison(pairs, others)


def comparison_table(title: str, rows: Sequence[tuple[str, Comparison]]) -> str:
    """Lay out published against computed speeds.

    Args:
        title: Heading of the table.
        rows: Name of each kind of feature and its comparison.

    Returns:
        Lines of text, speeds in rev/min, deviations in percent of the published speed.
    """
    lines = [title, f"  {'feature':<26}{'published':>10}{'computed':>10}{'deviation':>11}"]
    for name, comparison in rows:
        for here, there in comparison.pairs:
            found = "none" if there is None else f"{there:.0f}"
            off = "-" if there is None else f"{100 * (there / here - 1):+z.1f} %"
            lines.append(f"  {name:<26}{here:>10.0f}{found:>10}{off:>11}")
        lines += [f"  {name:<26}{'-':>10}{there:>10.0f}{'-':>11}" for there in comparison.others]
    return "\n".join(lines)
