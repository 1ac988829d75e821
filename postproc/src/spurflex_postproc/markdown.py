"""Tables in Markdown."""

from collections.abc import Sequence


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Lay out a table; vertical bars inside cells are escaped.

    Args:
        head: Titles of the columns.
        rows: Cells, as many in each row as there are columns.

    Returns:
        Lines of Markdown with an empty line behind.

    Raises:
        ValueError: If a row has another number of cells.
    """
    if any(len(row) != len(head) for row in rows):
        raise ValueError("a row has another number of cells than the head")
    lines = [head, ["---"] * len(head), *rows]
    return (
        "\n".join(
            "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines
        )
        + "\n"
    )
