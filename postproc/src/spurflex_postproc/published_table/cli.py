"""The command `spurflex-published`."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from spurflex_postproc.layout import ResultError
from spurflex_postproc.output import write_text
from spurflex_postproc.published import standing_explanations
from spurflex_postproc.published_table.bearing import bearing_rows
from spurflex_postproc.published_table.conclusions import conclusion_rows
from spurflex_postproc.published_table.curves import curve_rows
from spurflex_postproc.published_table.explain import explained
from spurflex_postproc.published_table.maps import map_rows
from spurflex_postproc.published_table.regimes import point_rows, regime_rows
from spurflex_postproc.published_table.row import Row
from spurflex_postproc.published_table.sources import REFERENCE, Sources, load
from spurflex_postproc.published_table.write import as_json, counts, markdown, summary
from spurflex_postproc.recordings import SPECTRUM, has_recording

COMPLETE, FAILED, UNUSABLE = 0, 1, 2

Setting = tuple[str, str, list[Row]]
"""Label, kind and rows of one run of figure 2."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Write `published.md` and `published.json` from the result files of a folder; count.

    Args:
        arguments: Command line without the program's name; `sys.argv` if absent.

    Returns:
        0 if the table was written, 1 if it could not be written, 2 if the result files cannot
        be used. Disagreements do not change the exit code.
    """
    chosen = _parser().parse_args(arguments)
    try:
        rows, conclusions, settings = build(load(chosen.results))
    except ResultError as error:
        print(f"spurflex-published: {error}", file=sys.stderr)
        return UNUSABLE
    folder = chosen.output or chosen.results
    text = markdown(rows, conclusions, REFERENCE, settings)
    content = json.dumps(as_json(rows, conclusions, REFERENCE, settings), indent=1) + "\n"
    try:
        written = [
            write_text(folder / "published.md", text),
            write_text(folder / "published.json", content),
        ]
    except OSError as error:
        print(f"spurflex-published: cannot write: {error}", file=sys.stderr)
        return FAILED
    print(summary(rows, conclusions))
    for path in written:
        print(f"wrote {path}")
    found = counts(rows)
    print(f"{found['yes']} agree, {found['no']} disagree, {found['open']} open")
    return COMPLETE


def build(sources: Sources) -> tuple[list[Row], list[Row], list[Setting]]:
    """Make all rows.

    Args:
        sources: The result files.

    Returns:
        Rows on the figures, with explanations of what disagrees; rows on the conclusions; label,
        kind and rows of every other run of figure 2, the reference first. Without a map there
        are none on figures 9 and 10 nor on the conclusions.
    """
    standing = standing_explanations()

    def from_curves(result: xr.Dataset) -> list[Row]:
        return [*curve_rows(result), *regime_rows(result)]

    rows = from_curves(sources.reference)
    sweeps = [
        trial.result
        for trial in sources.trials
        if trial.kind == "start" and has_recording(trial.result, SPECTRUM, "y1", "flexible")
    ]
    rows += point_rows([*sources.points, sources.reference], sweeps=sweeps)
    settings: list[Setting] = [(f"start = '{REFERENCE}'", "reference", rows)]
    tried = [
        (trial, [*from_curves(trial.result), *point_rows([trial.result], complete=False)])
        for trial in sources.trials
    ]
    tried += [(trial, point_rows([trial.result], complete=False)) for trial in sources.point_trials]
    settings += [(trial.label, trial.kind, some) for trial, some in tried]
    rows = explained(rows, tried, standing)
    if sources.map is None:
        return rows, [], settings
    more = [*map_rows(sources.map), *bearing_rows(sources.map)]
    rows += explained(more, [], standing)
    return rows, explained(conclusion_rows(sources.map), [], standing), settings


def _parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(
        prog="spurflex-published",
        description="Set the numbers and statements of the article against the computed ones.",
    )
    parser.add_argument("results", type=Path, help="folder with the result files")
    parser.add_argument(
        "--output", type=Path, metavar="FOLDER", help="where to (default: with the results)"
    )
    return parser
