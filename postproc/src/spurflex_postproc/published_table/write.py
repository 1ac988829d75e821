"""Writes the table as Markdown and JSON."""

from collections.abc import Sequence
from typing import Any

from spurflex_postproc.markdown import table
from spurflex_postproc.published_table.row import Row, written

PREAMBLE = """\
# Published against computed

Every number and every statement on figures 2 to 10 of L. Zhang, C. Chen, J. Liu, S. Zhao,
J. Vibroengineering 20(3), 2018, paper 2872, against the result files of `scripts/reproduce`.
Speeds in rev/min, deviations relative to the published number. Peaks and the first jump of the
rigid curve agree within 1 %, other jumps and borders of ranges of motion within 3 %. Curves are
those of the start '{start}' (the article lets the speed increase); an explanation names the start,
the time step or the parameter with which a number is met, or says that none was found.
"""


def verdict(row: Row) -> str:
    """Return 'yes', 'no' or 'open'."""
    return {True: "yes", False: "no", None: "open"}[row.agrees]


def counts(rows: Sequence[Row]) -> dict[str, int]:
    """Count the rows by verdict."""
    found = {"yes": 0, "no": 0, "open": 0}
    for row in rows:
        found[verdict(row)] += 1
    return found


def markdown(
    rows: Sequence[Row],
    conclusions: Sequence[Row],
    start: str,
    settings: Sequence[tuple[str, str, Sequence[Row]]] = (),
) -> str:
    """Write the table for people.

    Args:
        rows: Rows on figures 2 to 10.
        conclusions: Rows on the conclusions.
        start: Start of the curves that are compared.
        settings: Label, kind and rows on figures 2 to 8 of each other run of figure 2.

    Returns:
        Markdown text.
    """
    parts = [PREAMBLE.format(start=start), summary(rows, conclusions), "## Figures\n"]
    parts.append(table(_HEAD, [_cells(row) for row in rows]))
    parts.append("## Conclusions as claims\n")
    parts.append(
        table(
            ["claim", "computed", "supported", "beside it"],
            [[row.feature, written(row.computed), verdict(row), row.note] for row in conclusions],
        )
    )
    if settings:
        parts.append("## The same with other settings\n")
        parts.append(_settings(settings))
    lacking = [row for row in rows if row.agrees is False]
    if lacking:
        parts.append("## Disagreements\n")
        parts.append(
            "\n".join(
                f"- figure {row.figure}, {row.feature} {written(row.published)}: computed"
                f" {written(row.computed)}{_off(row)}. {row.explanation or 'No evidence yet.'}"
                for row in lacking
            )
            + "\n"
        )
    return "\n".join(parts)


def as_json(
    rows: Sequence[Row],
    conclusions: Sequence[Row],
    start: str,
    settings: Sequence[tuple[str, str, Sequence[Row]]] = (),
) -> dict[str, Any]:
    """Return the same content for scripts; arguments as of `markdown`."""
    return {
        "start": start,
        "settings": [
            {"label": label, "kind": kind, "rows": [row.as_dict() for row in some]}
            for label, kind, some in settings
        ],
        "counts": counts(rows),
        "rows": [row.as_dict() for row in rows],
        "conclusions": [row.as_dict() for row in conclusions],
    }


_HEAD = ("figure", "feature", "published", "computed", "deviation", "agrees", "note")


def _cells(row: Row) -> list[str]:
    """Write one row."""
    return [
        row.figure,
        row.feature,
        written(row.published),
        written(row.computed),
        _off(row).strip(" ()") or "-",
        verdict(row),
        row.note,
    ]


def _settings(settings: Sequence[tuple[str, str, Sequence[Row]]]) -> str:
    """Count what agrees on figures 2 to 8 with other starts, steps and parameters."""
    lines = []
    for label, kind, rows in settings:
        cells = []
        for figures in ("2", "3", "45678"):
            found = counts([row for row in rows if row.figure in figures])
            told = found["yes"] + found["no"]
            cells.append(f"{found['yes']} of {told}" if told else "-")
        order = {row.key: str(row.computed) for row in rows}
        sequences = [order.get(f"figure 3 {one} order", "") for one in ("rigid", "flexible")]
        lines.append([label, kind, *cells, *sequences])
    head = ["setting", "changes", "figure 2", "figure 3", "4 to 8", "rigid", "flexible"]
    return table(head, lines)


def _off(row: Row) -> str:
    """Write a deviation in parentheses."""
    return "" if row.deviation is None else f" ({100 * row.deviation:+z.1f} %)"


def summary(rows: Sequence[Row], conclusions: Sequence[Row]) -> str:
    """Count the verdicts by figure.

    Args:
        rows: Rows on figures 2 to 10.
        conclusions: Rows on the conclusions.

    Returns:
        A Markdown table.
    """
    lines = []
    for figure in dict.fromkeys(row.figure for row in rows):
        found = counts([row for row in rows if row.figure == figure])
        lines.append([figure, *(str(found[name]) for name in ("yes", "no", "open"))])
    for name, some in (("all figures", rows), ("conclusions", conclusions)):
        found = counts(some)
        lines.append([name, *(str(found[key]) for key in ("yes", "no", "open"))])
    return table(["figure", "agrees", "disagrees", "open"], lines)
