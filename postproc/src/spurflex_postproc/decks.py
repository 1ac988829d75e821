"""Reads the resolved deck that a result file carries."""

import re
from pathlib import Path

import h5py

from spurflex_postproc.layout import ResultError, plain_text


def deck_values(path: str | Path) -> dict[str, str]:
    """Read the keys of the resolved deck in a result file.

    Args:
        path: The result file.

    Returns:
        Key and value as text, words with their quotes; empty if the file holds no deck.

    Raises:
        ResultError: If the file cannot be read.
    """
    try:
        with h5py.File(path, "r") as file:
            group = file.get("provenance", {})
            text = str(plain_text(group["resolved_deck"][()])) if "resolved_deck" in group else ""
    except OSError as cause:
        raise ResultError(f"{path}: cannot be read") from cause
    pairs = re.findall(r"^\s*(\w+)\s*=\s*(.*?)\s*$", text, re.MULTILINE)
    return dict(pairs)


def start_of(path: str | Path) -> str:
    """Return the word of `start` in the resolved deck of a result file; '' if it has none."""
    return deck_values(path).get("start", "").strip("'")
