"""Writes figures and texts: complete or not at all, and the same bytes every time."""

import os
from contextlib import suppress
from pathlib import Path

from matplotlib.figure import Figure

FORMATS: dict[str, dict[str, None]] = {
    "pdf": {"CreationDate": None, "ModDate": None},
    "png": {"Software": None},
}
"""File formats, and the entries that would differ from one run to the next."""


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure in every format.

    Each file is written under a temporary name and renamed when all are complete.

    Args:
        figure: The figure.
        folder: Where to; made if absent.
        name: File name without ending.

    Returns:
        The files, in the order of `FORMATS`.

    Raises:
        OSError: If a file cannot be written; no new file is left then.
    """
    folder.mkdir(parents=True, exist_ok=True)
    final = {kind: folder / f"{name}.{kind}" for kind in FORMATS}
    partial = {kind: folder / f".{name}.{kind}.{os.getpid()}.part" for kind in FORMATS}
    try:
        for kind, metadata in FORMATS.items():
            figure.savefig(partial[kind], format=kind, metadata=metadata)
        for kind in FORMATS:
            partial[kind].replace(final[kind])
    finally:
        for path in partial.values():
            with suppress(FileNotFoundError):
                path.unlink()
    return list(final.values())


def write_text(path: Path, text: str) -> Path:
    """Write a text file, complete or not at all.

    Args:
        path: The file; its folder is made if absent.
        text: Content.

    Returns:
        The file.

    Raises:
        OSError: If it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        partial.write_text(text, "utf-8")
        partial.replace(path)
    finally:
        with suppress(FileNotFoundError):
            partial.unlink()
    return path
