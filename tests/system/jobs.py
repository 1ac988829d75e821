"""Decks of a chosen amount of work, runs on several ranks that tests disturb, and what their files hold."""

import contextlib
import os
import re
import signal
import subprocess
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

EXIT_COMPLETE, EXIT_INTERNAL, EXIT_DECK, EXIT_MISMATCH, EXIT_STOPPED = 0, 1, 2, 3, 75
EPOCH = {"SOURCE_DATE_EPOCH": "1500000000"}
PATIENCE = 120.0
"""Seconds after which something that should happen counts as not happening."""


def map_deck(root, folder, *, file="map.h5", rows=6, speeds=571, limit=None, start="static"):
    """Write a deck with some rows of the map of figure 9; its path.

    Six rows of 571 speeds are about two seconds of one core.
    """
    text = (root / "input" / "paper" / "figure9.nml").read_text()
    changes = {
        r"file\s*=\s*'.*?'": f"file = '{file}'",
        r"speed_count\s*=\s*\d+": f"speed_count = {speeds}",
        r"stiffness_count\s*=\s*\d+": f"stiffness_count = {rows}",
        r"start\s*=\s*'\w+'": f"start = '{start}'",
        r"max_periods\s*=\s*\d+": "max_periods = 1000",
    }
    if limit is not None:
        changes[r"&sweep"] = f"&sweep\n   wall_clock_limit = {limit}"
    for pattern, new in changes.items():
        text, found = re.subn(pattern, new, text)
        assert found == 1, pattern
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "map.nml"
    path.write_text(text)
    return path


class Job:
    """A run in the background, with all its ranks.

    Attributes:
        folder: Working folder.
        code: Exit code once it has ended.
    """

    def __init__(self, program, mpiexec, deck, *, ranks, folder, environment=None, options=()):
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.program = Path(program).resolve()
        self.output_path = folder.parent / f"{folder.name}.output"
        with self.output_path.open("wb") as output:
            self.process = subprocess.Popen(
                [*mpiexec, str(ranks), str(program), *options, str(deck)],
                cwd=folder,
                env={**os.environ, **EPOCH, **(environment or {})},
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    @property
    def output(self):
        """What it has said so far."""
        return self.output_path.read_text(errors="replace")

    def ranks(self):
        """Process numbers of the ranks that run, by rank; empty before they do."""
        found = {}
        for folder in Path("/proc").iterdir():
            if not folder.name.isdigit():
                continue
            with contextlib.suppress(OSError, IndexError, ValueError):
                if parent(folder) != self.process.pid or (folder / "exe").resolve() != self.program:
                    continue
                environment = (folder / "environ").read_bytes().decode(errors="replace").split("\0")
                names = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK")
                rank = next(w.split("=")[1] for w in environment if w.split("=")[0] in names)
                found[int(rank)] = int(folder.name)
        return dict(sorted(found.items()))

    def wait_until(self, happened, what, pause=0.002):
        """Wait for something; False if the run has ended before."""
        deadline = time.monotonic() + PATIENCE
        while not happened():
            if self.process.poll() is not None:
                return bool(happened())
            assert time.monotonic() < deadline, f"{what}; it said:\n{self.output}"
            time.sleep(pause)
        return True

    def wait_for_points(self, path, count):
        """Wait until that many points are in the file; False if the run has ended before."""

        def there():
            return path.exists() and done_count(path) >= count

        return self.wait_until(there, f"no {count} points", pause=0.02)

    def wait(self):
        """Wait for the end; the exit code."""
        return self.process.wait(PATIENCE)

    def kill(self, numbers):
        """Kill some processes of it."""
        for number in numbers:
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)

    def signal(self, number):
        """Send a signal to every rank."""
        for process in self.ranks().values():
            os.kill(process, number)

    def wait_for_nobody(self, numbers):
        """Wait until the run and these processes of it are gone."""
        self.process.wait(PATIENCE)
        deadline = time.monotonic() + PATIENCE
        while any(runs(number) for number in numbers):
            assert time.monotonic() < deadline, "a rank outlives its run"
            time.sleep(0.005)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.kill([*self.ranks().values(), self.process.pid])
            self.process.wait(PATIENCE)


def parent(folder):
    """Parent of a process, by its folder under /proc."""
    return int((folder / "stat").read_text().rsplit(")", 1)[1].split()[1])


def runs(number):
    """Whether a process is there and no zombie."""
    try:
        return (Path("/proc") / str(number) / "stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def snapshot(path):
    """All numbers of a result file that may be in use, by variable."""
    with h5py.File(path, "r", locking=False) as file:
        return {name: data[()] for name, data in file.items() if isinstance(data, h5py.Dataset)}


def done_masks(values):
    """Which points a snapshot calls done, by prefix of their variables."""
    return {
        prefix: values[f"{prefix}status"] != 0 for prefix in ("", "rigid_") if f"{prefix}status" in values
    }


def done_count(path):
    """How many points of a file are done; 0 if it cannot be read at this moment."""
    try:
        return int(sum(mask.sum() for mask in done_masks(snapshot(path)).values()))
    except (OSError, KeyError):
        return 0


def assert_done_points_are_right(values, reference):
    """Every point that a snapshot calls done holds the bits of the reference."""
    for prefix, done in done_masks(values).items():
        for name, data in values.items():
            if name.startswith("rigid_") != (prefix == "rigid_") or data.shape != done.shape:
                continue
            assert data[done].tobytes() == reference[name][done].tobytes(), name


def needs_open_mpi(mpiexec):
    """Skip a test that needs to know how the MPI library starts its ranks."""
    done = subprocess.run([mpiexec[0], "--version"], capture_output=True, text=True, check=False)
    # Its `mpiexec` calls itself by the name of its run-time system.
    if not any(name in done.stdout + done.stderr for name in ("Open MPI", "OpenRTE")):
        pytest.skip("only Open MPI is known well enough here")


def same_values(one, other):
    """Whether two snapshots hold the same bits."""
    return one.keys() == other.keys() and all(
        np.asarray(one[name]).tobytes() == np.asarray(other[name]).tobytes() for name in one
    )
