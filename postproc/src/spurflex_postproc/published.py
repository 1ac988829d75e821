"""What the literature reports for the figures drawn here."""

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

PAPER_STIFFNESS = 1.75e8
"""Support stiffness with which the published flexible curve is computed [N/m]. The article prints
2.5e5; this one fits its peaks (`spurflex-identify`)."""


@dataclass(frozen=True)
class PublishedCurve:
    """Features of one published amplitude-frequency curve.

    Attributes:
        peaks: Speeds of the peaks [rev/min], ascending.
        jumps: Speeds of the jumps [rev/min], ascending.
    """

    peaks: tuple[float, ...]
    jumps: tuple[float, ...]


@dataclass(frozen=True)
class PublishedMap:
    """Features of the published map of amplitude over speed and support stiffness.

    Attributes:
        crest: Speed of the crest of the soft support [rev/min].
        crests_below: Speeds of the crests on the soft side of the crest line [rev/min].
        crests_above: Speeds of the crests on its stiff side [rev/min].
        flat: First and last speed where the stiffness hardly matters [rev/min].
        irregular_above: Speed above which its effect is irregular [rev/min].
    """

    crest: float
    crests_below: tuple[float, ...]
    crests_above: tuple[float, ...]
    flat: tuple[float, float]
    irregular_above: float


@cache
def _table() -> dict[str, Any]:
    """Parse the data file of the package."""
    return tomllib.loads(files(__package__).joinpath("published.toml").read_text("utf-8"))


def _speeds(values: list[float]) -> tuple[float, ...]:
    """Turn a list of the data file into ascending floats."""
    return tuple(sorted(float(value) for value in values))


def published_curve(support: str) -> PublishedCurve:
    """Return the published features of the amplitude-frequency curve.

    Args:
        support: 'rigid' or 'flexible'.

    Returns:
        Peaks and jumps.

    Raises:
        KeyError: For any other support.
    """
    curve = _table()["figure_2"][support]
    return PublishedCurve(_speeds(curve["peaks"]), _speeds(curve["jumps"]))


def published_map() -> PublishedMap:
    """Return the published features of the map over speed and support stiffness."""
    values = _table()["figure_9"]
    return PublishedMap(
        crest=float(values["crest"]),
        crests_below=_speeds(values["crests_below"]),
        crests_above=_speeds(values["crests_above"]),
        flat=(float(values["flat"][0]), float(values["flat"][1])),
        irregular_above=float(values["irregular_above"]),
    )


@dataclass(frozen=True)
class PublishedPoint:
    """The motion at one speed, and the lines of its spectrum.

    Attributes:
        figure: Number of the figure.
        speed: Rotating speed [rev/min].
        motion: Class of motion: '1T', '2T', '3T' or 'chaotic'.
        dominant: Strongest order, in multiples of the mesh frequency.
        orders: The other orders that are named.
    """

    figure: str
    speed: float
    motion: str
    dominant: float
    orders: tuple[float, ...]


def published_regimes(support: str) -> tuple[tuple[str, float, float], ...]:
    """Return the published motions: class, first and last speed [rev/min], in order.

    Raises:
        KeyError: If `support` is neither 'rigid' nor 'flexible'.
    """
    regimes = _table()["figure_3"][support]["regimes"]
    return tuple((str(name), float(first), float(last)) for name, first, last in regimes)


def published_points() -> tuple[PublishedPoint, ...]:
    """Return the five speeds of figures 4 to 8."""
    points = []
    for figure in ("4", "5", "6", "7", "8"):
        values = _table()[f"figure_{figure}"]
        points.append(
            PublishedPoint(
                figure=figure,
                speed=float(values["speed"]),
                motion=str(values["motion"]),
                dominant=float(values["dominant"]),
                orders=tuple(float(order) for order in values["orders"]),
            )
        )
    return tuple(points)


def published_areas() -> tuple[dict[str, str], str]:
    """Return the signs of eta by the letter of the area, and the letter with the largest eta."""
    values = _table()["figure_10"]
    return dict(values["areas"]), str(values["largest"])


def tolerance(feature: str) -> float:
    """Return the largest deviation that counts as agreement, as a fraction.

    Args:
        feature: 'peak', 'first_jump', 'jump', 'boundary' or 'order'.

    Raises:
        KeyError: For any other feature.
    """
    return float(_table()["tolerance"][feature])


def standing_explanations() -> dict[str, str]:
    """Return explanations of disagreements by the key of the row."""
    return {str(key): str(text) for key, text in _table().get("explanations", {}).items()}
