#!/usr/bin/env python3
"""Run the fuzz program on every deck there is, the faulty ones of tests/system/bad_decks included.

usage: tests/fuzz/run.py FUZZ_DECKS [options of fuzz_decks]
"""

import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BAD = ROOT / "tests" / "system" / "bad_decks"


def faulty_decks():
    """The bytes of the decks that bad_decks/faults.toml describes."""
    good = (BAD / "good.nml").read_text(encoding="utf-8")
    for deck in tomllib.loads((BAD / "faults.toml").read_text(encoding="utf-8"))["deck"]:
        text = good
        for search, replacement in deck.get("replace", []):
            text = text.replace(search, replacement)
        yield (text + deck.get("append", "")).encode(deck.get("encoding", "utf-8"))


def main():
    """Write the faulty decks to a folder, run the program, say how it ended."""
    program, *options = sys.argv[1:]
    decks = [*ROOT.glob("input/**/*.nml"), BAD / "good.nml"]
    with tempfile.TemporaryDirectory() as folder:
        for number, content in enumerate(faulty_decks()):
            path = Path(folder) / f"faulty{number:03}.nml"
            path.write_bytes(content)
            decks.append(path)
        # Bytes in the order of their names, so that a number means the same deck everywhere.
        decks = [str(deck) for deck in sorted(decks, key=lambda deck: deck.name)]
        done = subprocess.run([program, *options, *decks], check=False)
    if done.returncode < 0:
        print(f"ended by signal {-done.returncode}; the deck is in ...-running.nml", file=sys.stderr)
    return 1 if done.returncode else 0


if __name__ == "__main__":
    sys.exit(main())
