"""Reads the resolved deck that a result file carries."""

import re
from pathlib import Path

import h5py

from spurflex_postproc.guard import rehearse
from spurflex_postproc.layout import plain_text, reading


def deck_values(path: str | Path) -> dict[str, str]:
    """Read the keys of the resolved deck in a result file.

    Args:
        path: The result file.

    Returns:
        Key and value as text, words with their quotes; empty if the file holds no deck.

    Raises:
        ResultError: If the file cannot be read.
    """
    path = Path(path)
    rehearse(path, _resolved_deck)
    pairs = re.findall(r"^\s*(\w+)\s*=\s*(.*?)\s*$", _resolved_deck(path), re.MULTILINE)
    return dict(pairs)


def _resolved_deck(path: Path) -> str:
    """Read the text of the resolved deck; '' if the file holds none."""
    with reading(path), h5py.File(path, "r") as file:
        group = file.get("provenance", {})
        return str(plain_text(group["resolved_deck"][()])) if "resolved_deck" in group else ""


def start_of(path: str | Path) -> str:
    """Return the word of `start` in the resolved deck of a result file; '' if it has none."""
    return deck_values(path).get("start", "").strip("'")
