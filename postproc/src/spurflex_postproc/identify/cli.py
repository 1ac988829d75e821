"""The command `spurflex-identify`."""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from spurflex_postproc import style
from spurflex_postproc.identify.determined import determined
from spurflex_postproc.identify.drawing import draw
from spurflex_postproc.identify.fit import fit
from spurflex_postproc.identify.hypotheses import hypotheses
from spurflex_postproc.identify.landscape import landscape
from spurflex_postproc.identify.linear import MeanSystem
from spurflex_postproc.identify.program import Program, ProgramError
from spurflex_postproc.identify.report import as_json, markdown
from spurflex_postproc.output import save, write_text

COMPLETE, FAILED, UNUSABLE = 0, 1, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit the hypotheses, write `identification.md`, `.json` and the misfit landscape.

    Args:
        arguments: Command line without the program's name; `sys.argv` if absent.

    Returns:
        0 if all was written, 1 if it could not be written, 2 if deck or program cannot be used.
    """
    chosen = _parser().parse_args(arguments)
    begin = time.monotonic()
    try:
        deck = chosen.deck.read_text("utf-8")
        mean = MeanSystem(deck)
        program = Program(
            chosen.program.resolve(), deck, chosen.output.resolve() / "runs", chosen.processes
        )
        wanted = [one for one in hypotheses() if not chosen.only or one.key in chosen.only]
        if not wanted:
            raise KeyError("no hypothesis of that name")
        fits = []
        for one in wanted:
            fits.append(fit(one, program, mean))
            print(f"{one.key}: misfit {fits[-1].misfit:.2f}", flush=True)
        best = min(fits, key=lambda found: found.misfit)
        print(f"landscape and sensitivities around '{best.hypothesis.key}'", flush=True)
        found = determined(program, best.unknowns)
        maps = landscape(program, best.unknowns)
    except (ProgramError, KeyError, OSError) as error:
        print(f"spurflex-identify: {error}", file=sys.stderr)
        return UNUSABLE
    seconds = time.monotonic() - begin
    text = markdown(fits, best, found, seconds)
    style.apply()
    try:
        written = [
            write_text(chosen.output / "identification.md", text),
            write_text(
                chosen.output / "identification.json",
                json.dumps(as_json(fits, best, found, seconds), indent=1) + "\n",
            ),
            *save(draw(maps, fits, best), chosen.output, "landscape"),
        ]
    except OSError as error:
        print(f"spurflex-identify: cannot write: {error}", file=sys.stderr)
        return FAILED
    print(f"least misfit: '{best.hypothesis.key}', {best.hypothesis.statement}")
    for path in written:
        print(f"wrote {path}")
    return COMPLETE


def _parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(
        prog="spurflex-identify",
        description="Fit the parameters that the article does not print to its features.",
    )
    parser.add_argument("--program", type=Path, required=True, help="the program spurflex")
    parser.add_argument(
        "--deck", type=Path, required=True, help="deck with the printed values (as printed)"
    )
    parser.add_argument(
        "--output", type=Path, default=Path(), metavar="FOLDER", help="where to (default: here)"
    )
    parser.add_argument(
        "--processes", type=int, default=2, metavar="N", help="runs at a time (default: 2)"
    )
    parser.add_argument(
        "--only", action="append", metavar="NAME", help="this hypothesis only; may be repeated"
    )
    return parser
