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
POINT_FIGURES = ("4", "5", "6", "7", "8")
MAP_FILE = "figure9.h5"
LEFT_OUT = (
    *("title", "file", "products", "max_periods", "measured_periods"),
    *("support", "speed_first", "speed_last", "speed_count"),
    *("quantities", "highest_order", "spectrum_periods", "sections"),
    *("history_periods", "history_samples"),
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
        kind: What it changes: 'start', 'step', 'parameter', or 'both' of the latter.
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
        trials: Results of figures 2 and 3 with other settings, the other starts among them.
        map: Result of figure 9; None if there is no such file.
        points: Results of figures 4 to 8 with the settings of the paper's deck.
        point_trials: Results of figures 4 to 8 with settings that no trial has.
    """

    curves: dict[str, xr.Dataset]
    trials: list[Trial]
    map: xr.Dataset | None
    points: list[xr.Dataset]
    point_trials: list[Trial]

    @property
    def reference(self) -> xr.Dataset:
        """The curves that are compared."""
        return self.curves[REFERENCE]


def load(folder: Path) -> Sources:
    """Read the result files of a folder.

    Args:
        folder: Holds `figure2-up.h5` with both supports, and perhaps `figure9.h5`, `figure4.h5`
            to `figure8.h5` and further `figure2*.h5`, `figure3*.h5`, `figure4-*.h5`, ...

    Returns:
        The sources.

    Raises:
        ResultError: If the reference is missing or a file cannot be read.
    """
    path = folder / REFERENCE_FILE
    reference, base = open_result(path), _settings(path)
    curves = {REFERENCE: reference}
    trials = []
    seen: list[dict[str, str]] = [{}]
    # Figure 3 first: it holds spectra beside the curves.
    for other in [*sorted(folder.glob("figure3*.h5")), *sorted(folder.glob("figure2*.h5"))]:
        changed = _changed(base, other)
        if other == path or changed in seen:
            continue
        seen.append(changed)
        trials.append(_trial(other, changed))
        if set(changed) == {"start"}:
            curves[changed["start"].strip("'")] = trials[-1].result
    points = [
        open_result(folder / f"figure{number}.h5")
        for number in POINT_FIGURES
        if (folder / f"figure{number}.h5").exists()
    ]
    point_trials = []
    for number in POINT_FIGURES:
        for other in sorted(folder.glob(f"figure{number}-*.h5")):
            changed = _changed(base, other)
            if changed not in seen:
                point_trials.append(_trial(other, changed))
    ordered = {start: curves[start] for start in STARTS if start in curves}
    map_ = folder / MAP_FILE
    return Sources(
        ordered, trials, open_result(map_) if map_.exists() else None, points, point_trials
    )


def _changed(base: dict[str, str], path: Path) -> dict[str, str]:
    """Return the keys that differ from those of the reference, with their values."""
    return {key: value for key, value in _settings(path).items() if base.get(key) != value}


def _trial(path: Path, changed: dict[str, str]) -> Trial:
    """Open a result and name its settings."""
    result = open_result(path)
    title = str(result.attrs.get("title", ""))
    return Trial(difference(changed, title), kind(changed), result)


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
    """Return what changed keys of a deck change: 'start', 'step', 'parameter' or 'both'."""
    step = set(changed) & set(STEP_KEYS)
    if set(changed) - {"start"} - step:
        return "both" if step else "parameter"
    return "step" if step else "start"
