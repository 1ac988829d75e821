"""Runs the program on small decks."""

import os
import re
import subprocess
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path

import xarray as xr

from spurflex_postproc.layout import ResultError
from spurflex_postproc.reading import open_result

COMPLETE, FAILED_POINTS = 0, 4
"""Exit codes of the program with a usable result file."""


class ProgramError(Exception):
    """The program could not be run; the message is one line for the user."""


def rewritten(deck: str, values: Mapping[str, str]) -> str:
    """Replace values of a deck.

    Args:
        deck: Text of the deck, each key on a line of its own.
        values: Key and new value, as it is to stand in the deck.

    Returns:
        The new text.

    Raises:
        KeyError: If a key does not stand in the deck exactly once.
    """
    for key, value in values.items():
        deck, count = re.subn(
            rf"^([ \t]*{key}[ \t]*=[ \t]*)[^!\n]*?([ \t]*(?:!.*)?)$",
            lambda found, value=value: f"{found[1]}{value}{found[2]}",  # type: ignore[misc]
            deck,
            flags=re.MULTILINE | re.IGNORECASE,
        )
        if count != 1:
            raise KeyError(f"'{key}' stands {count} times in the deck")
    return deck


@dataclass
class Program:
    """The program with a deck whose values can be changed.

    Attributes:
        executable: The program.
        deck: Text of the deck.
        folder: Where decks and result files go; the same values are not run twice with the same
            program.
        processes: How many runs at a time.
        runs: How many runs there have been.
    """

    executable: Path
    deck: str
    folder: Path
    processes: int = 2
    runs: int = field(default=0, compare=False)
    _known: str = field(default="", compare=False, repr=False)

    def run(self, values: Mapping[str, str]) -> xr.Dataset:
        """Run the deck with some values replaced.

        Args:
            values: Key and value, as it is to stand in the deck.

        Returns:
            The result, as of `open_result`.

        Raises:
            ProgramError: If the program fails or is not there.
            KeyError: If a key does not stand in the deck exactly once.
        """
        content = repr((self._digest(), self.deck, sorted(values.items())))
        name = sha256(content.encode()).hexdigest()[:16]
        result = self.folder / f"{name}.h5"
        if not result.exists():
            self.folder.mkdir(parents=True, exist_ok=True)
            deck = self.folder / f"{name}.nml"
            deck.write_text(rewritten(self.deck, {**values, "file": f"'{result}'"}), "utf-8")
            self._start(deck)
        try:
            return open_result(result)
        except ResultError as cause:
            raise ProgramError(str(cause)) from cause

    def run_all(self, several: Sequence[Mapping[str, str]]) -> list[xr.Dataset]:
        """Run several decks, `processes` at a time; arguments and errors as of `run`."""
        with ThreadPoolExecutor(self.processes) as pool:
            return list(pool.map(self.run, several))

    def _digest(self) -> str:
        """Return what tells one build of the program from another."""
        if not self._known:
            try:
                self._known = sha256(self.executable.read_bytes()).hexdigest()
            except OSError as cause:
                message = f"cannot read {self.executable}: {cause.strerror}"
                raise ProgramError(message) from cause
        return self._known

    def _start(self, deck: Path) -> None:
        """Run one deck to its end."""
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        try:
            ended = subprocess.run(
                [self.executable, deck],
                capture_output=True,
                text=True,
                env=environment,
                check=False,
            )
        except OSError as cause:
            raise ProgramError(f"cannot run {self.executable}: {cause.strerror}") from cause
        self.runs += 1
        if ended.returncode not in (COMPLETE, FAILED_POINTS):
            last = (ended.stderr.strip() or ended.stdout.strip() or "no message").splitlines()[-1]
            raise ProgramError(f"{deck}: exit code {ended.returncode}: {last}")
