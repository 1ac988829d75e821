#!/usr/bin/env python3
"""Run a regression case and compare its result file with the reference.

A case is a folder with
  deck.nml         what the program runs, in an empty folder;
  tolerances.toml  the quantities compared, the tolerance of each and its reason;
  reference.json   the values expected; written by --update;
  reference.nml    if it is there, the deck that --update runs instead: the same points, more accurate;
  reference.py     if it is there, the program that computes the reference without spurflex
                   (tests/regression/regenerate runs it).

The program and mpirun are those of SPURFLEX_PROGRAM and SPURFLEX_MPIEXEC; build/spurflex and
"mpirun -n" where these are not set.
"""

import argparse
import json
import math
import os
import shlex
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
MOST_FAULTS = 10


class CaseError(Exception):
    """The case cannot be run or compared."""


def read_tolerances(path):
    """Tolerance of each quantity: {name: {"relative", "absolute", "reason"}}, {} for exact ones."""
    tolerances = tomllib.loads(path.read_text(encoding="utf-8"))
    for name, entry in tolerances.items():
        known = {"exact", "reason"} if entry.get("exact") else {"relative", "absolute", "reason"}
        if set(entry) != known:
            raise CaseError(f"{path}: [{name}] must have exactly {', '.join(sorted(known))}")
        if not str(entry["reason"]).strip():
            raise CaseError(f"{path}: [{name}]: the reason is empty")
    if not tolerances:
        raise CaseError(f"{path}: no quantity")
    return tolerances


def run_program(deck, folder, ranks):
    """Run the deck in a folder; return the exit code and the result file."""
    program = os.environ.get("SPURFLEX_PROGRAM", str(ROOT / "build" / "spurflex"))
    mpiexec = shlex.split(os.environ.get("SPURFLEX_MPIEXEC", "mpirun -n"))
    done = subprocess.run(
        [*mpiexec, str(ranks), program, str(deck)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    files = sorted(folder.rglob("*.h5"))
    if len(files) != 1:
        raise CaseError(
            f"{deck}: exit code {done.returncode}, {len(files)} result files\n{done.stdout}{done.stderr}"
        )
    return done.returncode, files[0]


def read_result(path, names):
    """The named root datasets of a result file, as {name: array}."""
    with h5py.File(path, "r") as file:
        missing = [name for name in names if name not in file]
        if missing:
            raise CaseError(f"{path.name}: no {', '.join(missing)}")
        return {name: np.asarray(file[name][()]) for name in names}


def to_json(array):
    """Nested lists of an array; NaN becomes null, infinities become text."""
    if array.ndim:
        return [to_json(part) for part in array]
    value = array.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value


def from_json(values, like):
    """The array that to_json wrote, in the type of another."""
    if like.dtype.kind != "f":
        return np.asarray(values, dtype=like.dtype)
    flat = np.asarray(values, dtype=object)
    return np.vectorize(lambda value: math.nan if value is None else float(value), otypes=[float])(flat)


def compare(name, actual, expected, tolerance):
    """Faults of one quantity, as lines."""
    if actual.shape != expected.shape:
        return [f"{name}: shape {actual.shape}, reference {expected.shape}"]
    actual, expected = np.atleast_1d(actual), np.atleast_1d(expected)
    if tolerance.get("exact"):
        wrong = actual != expected
        allowed = "exactly"
    elif actual.dtype.kind != "f":
        return [f"{name}: integers are compared exactly (exact = true)"]
    else:
        relative, absolute = tolerance["relative"], tolerance["absolute"]
        with np.errstate(invalid="ignore"):
            near = np.abs(actual - expected) <= np.maximum(relative * np.abs(expected), absolute)
        wrong = ~(near | (actual == expected) | (np.isnan(actual) & np.isnan(expected)))
        allowed = f"within {relative:g} relative or {absolute:g} absolute"
    faults = [
        f"{name}{list(map(int, index))}: {actual[tuple(index)]} is not {expected[tuple(index)]} {allowed}"
        for index in np.argwhere(wrong)
    ]
    if len(faults) > MOST_FAULTS:
        faults = [*faults[:MOST_FAULTS], f"{name}: {len(faults) - MOST_FAULTS} more of {actual.size}"]
    return faults


def check(case, code, result):
    """Compare a result with the reference of its case; return the faults."""
    path = case / "reference.json"
    if not path.is_file():
        raise CaseError(f"{path} is missing; tests/regression/regenerate writes it")
    reference = json.loads(path.read_text(encoding="utf-8"))
    tolerances = read_tolerances(case / "tolerances.toml")
    unmatched = set(tolerances) ^ set(reference["values"])
    if unmatched:
        return [f"{name}: not in both tolerances.toml and reference.json" for name in sorted(unmatched)]
    faults = []
    if code is not None and code != reference["exit_code"]:
        faults.append(f"exit code {code}, reference {reference['exit_code']}")
    for name, actual in read_result(result, tolerances).items():
        expected = from_json(reference["values"][name], actual)
        faults += compare(name, actual, expected, tolerances[name])
    return faults


def update(case, code, result):
    """Write the reference of a case."""
    names = read_tolerances(case / "tolerances.toml")
    values = {name: to_json(array) for name, array in read_result(result, names).items()}
    lines = [f'    "{name}": {json.dumps(value)}' for name, value in values.items()]
    text = f'{{\n  "exit_code": {json.dumps(code)},\n  "values": {{\n' + ",\n".join(lines) + "\n  }\n}\n"
    (case / "reference.json").write_text(text, encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("case", type=Path, help="folder of the case")
    parser.add_argument("--ranks", type=int, default=1, help="number of ranks (default: 1)")
    parser.add_argument("--result", type=Path, help="compare this result file instead of running the deck")
    parser.add_argument("--update", action="store_true", help="write the reference instead of comparing")
    options = parser.parse_args()
    case = options.case.resolve()
    try:
        with tempfile.TemporaryDirectory(prefix="spurflex-") as folder:
            if options.result:
                code, result = (0 if options.update else None), options.result
            else:
                deck = case / "reference.nml"
                if not (options.update and deck.is_file()):
                    deck = case / "deck.nml"
                code, result = run_program(deck, Path(folder), options.ranks)
            faults = [] if options.update else check(case, code, result)
            if options.update:
                update(case, code, result)
    except (CaseError, OSError, tomllib.TOMLDecodeError) as error:
        print(f"{case.name}: {error}")
        return 1
    outcome = "updated" if options.update else "as the reference"
    print("\n".join(faults) if faults else f"{case.name}: {outcome}")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
