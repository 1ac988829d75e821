"""The result files behind the table, and how they differ from each other."""

from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from spurflex_postproc.decks import deck_values
from spurflex_postproc.reading import open_result

STARTS = ("up", "down", "static", "rest")
"""Starts in the order in which they stand in the table."""
REFERENCE = "up"
"""The start whose curves are compared: the article lets the speed increase."""
REFERENCE_FILE = f"figure2-{REFERENCE}.h5"
PLAIN_FILE = "figure2.h5"
MAP_FILE = "figure9.h5"
LEFT_OUT = (
    *("title", "file", "products", "max_periods", "measured_periods"),
    *("speed_first", "speed_last", "speed_count"),
)
"""Keys of a deck that do not change what is compared."""
STEP_KEYS = ("integrator", "steps_per_period", "newmark_beta", "newmark_gamma", "tolerance")
"""Keys of a deck that change how, not what is computed."""
MANY = 3
"""Changed keys beyond which the title of the deck stands for them."""


@dataclass(frozen=True)
class Trial:
    """A result file with other settings than the reference.

    Attributes:
        label: How its deck differs from the reference, in words.
        kind: What it changes: 'start', 'step' or 'parameter'.
        result: The dataset.
    """

    label: str
    kind: str
    result: xr.Dataset


@dataclass(frozen=True)
class Sources:
    """All that the table is made from.

    Attributes:
        curves: Results of figure 2 by start; the reference is among them.
        trials: Results of figure 2 with other settings, the other starts among them.
        map: Result of figure 9; None if there is no such file.
        spectra: Results with the variable `spectrum`, in any order.
    """

    curves: dict[str, xr.Dataset]
    trials: list[Trial]
    map: xr.Dataset | None
    spectra: list[xr.Dataset]

    @property
    def reference(self) -> xr.Dataset:
        """The curves that are compared."""
        return self.curves[REFERENCE]


def load(folder: Path) -> Sources:
    """Read the result files of a folder.

    Args:
        folder: Holds `figure2.h5` or `figure2-*.h5` with both supports, and perhaps `figure9.h5`
            and further `figure*.h5`.

    Returns:
        The sources.

    Raises:
        ResultError: If the reference is missing or a file cannot be read.
    """
    path = folder / REFERENCE_FILE
    reference, base = open_result(path), _settings(path)
    curves = {REFERENCE: reference}
    trials = []
    for other in sorted(folder.glob("figure2*.h5")):
        if other == path:
            continue
        values, result = _settings(other), open_result(other)
        changed = {key: value for key, value in values.items() if base.get(key) != value}
        start = values.get("start", "").strip("'")
        if set(changed) == {"start"}:
            curves[start] = result
        title = str(result.attrs.get("title", ""))
        trials.append(Trial(difference(changed, title), kind(changed), result))
    spectra = [
        found
        for other in sorted(folder.glob("figure*.h5"))
        if other != path and "spectrum" in (found := open_result(other))
    ]
    ordered = {start: curves[start] for start in STARTS if start in curves}
    map_ = folder / MAP_FILE
    return Sources(ordered, trials, open_result(map_) if map_.exists() else None, spectra)


def _settings(path: Path) -> dict[str, str]:
    """Return the keys of the resolved deck that change what is compared."""
    return {key: value for key, value in deck_values(path).items() if key not in LEFT_OUT}


def difference(changed: dict[str, str], title: str = "") -> str:
    """Write changed keys of a deck in one line, the start first; a title if they are many."""
    if not changed:
        return "the same deck"
    if len(changed) > MANY and title:
        return title
    order = sorted(changed, key=lambda key: (key != "start", key))
    return ", ".join(f"{key} = {changed[key]}" for key in order)


def kind(changed: dict[str, str]) -> str:
    """Return what changed keys of a deck change: 'start', 'step' or 'parameter'."""
    if set(changed) <= {"start"}:
        return "start"
    return "step" if set(changed) <= {"start", *STEP_KEYS} else "parameter"
