"""One line of the table of published against computed features."""

from dataclasses import asdict, dataclass, replace
from typing import Any

Value = float | str | None

SMALLEST_SPEED = 20.0
"""Values from here on are speeds [rev/min], smaller ones orders."""


@dataclass(frozen=True)
class Row:
    """One published number or statement and what was computed for it.

    Attributes:
        key: Unique name.
        figure: Number of the figure, or 'conclusions'.
        feature: What is published.
        published: Its value: a speed [rev/min], an order, or words.
        computed: The computed value, in the same form; None if there is none.
        allowed: Largest deviation that counts as agreement, as a fraction; None for statements.
        agrees: Whether it agrees; None if the results do not tell.
        note: What else was seen, in one line.
        explanation: Why it does not agree, in one line, with the evidence.
        met: How much of a statement is met, from 0 to 1; None if that has no parts.
    """

    key: str
    figure: str
    feature: str
    published: Value
    computed: Value
    allowed: float | None = None
    agrees: bool | None = None
    note: str = ""
    explanation: str = ""
    met: float | None = None

    @property
    def deviation(self) -> float | None:
        """Deviation as a fraction of the published number; None for statements."""
        if isinstance(self.published, float) and isinstance(self.computed, float):
            return self.computed / self.published - 1
        return None

    def explained(self, explanation: str) -> "Row":
        """Return a copy with an explanation."""
        return replace(self, explanation=explanation)

    def as_dict(self) -> dict[str, Any]:
        """Return all of it for JSON."""
        return {**asdict(self), "deviation": self.deviation}


def number(
    key: str,
    figure: str,
    feature: str,
    published: float,
    computed: float | None,
    allowed: float,
    *,
    whole: bool = True,
    note: str = "",
) -> Row:
    """Make the row of a number; it agrees if it deviates no more than allowed.

    Args:
        key: Unique name.
        figure: Number of the figure.
        feature: What is published.
        published: Its value.
        computed: The computed value; None if there is no such feature.
        allowed: Largest deviation, as a fraction.
        whole: Whether all of the feature was found; if not, it does not agree.
        note: What else was seen.

    Returns:
        The row.
    """
    near = computed is not None and abs(computed / published - 1) <= allowed
    value = None if computed is None else float(computed)
    return Row(key, figure, feature, float(published), value, allowed, near and whole, note)


def statement(
    key: str,
    figure: str,
    feature: str,
    published: str,
    computed: str | None,
    agrees: bool | None,
    note: str = "",
    *,
    met: float | None = None,
) -> Row:
    """Make the row of a statement in words; arguments as of `Row`."""
    verdict = None if agrees is None else bool(agrees)
    return Row(key, figure, feature, published, computed, None, verdict, note, met=met)


def written(value: Value) -> str:
    """Write a value; speeds without decimals, orders with two."""
    if value is None:
        return "none"
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= SMALLEST_SPEED else f"{value:.2f}"
    return value
