"""Runs that are killed at random moments, with changing numbers of ranks.

What is promised: the file opens, every point that is called done holds the right bits and stays
done, and in the end the file is that of an undisturbed run.
"""

import os
import random
import time

import pytest
from jobs import (
    EPOCH,
    EXIT_COMPLETE,
    Job,
    assert_done_points_are_right,
    done_masks,
    map_deck,
    needs_open_mpi,
    snapshot,
)

RANKS = (1, 2, 3, 5)
VICTIMS = ("a rank", "mpirun", "everything")
LATEST = 0.4
"""Seconds after a run has taken its lock within which it is killed."""


def victims(generator, job, numbers):
    """Whom to kill: process numbers."""
    kind = generator.choice(VICTIMS)
    if kind == "a rank":
        return [generator.choice(list(numbers.values()))]
    return [job.process.pid] if kind == "mpirun" else [job.process.pid, *numbers.values()]


def kill_once(generator, program, mpiexec, deck, folder):
    """Start a run and kill it; whether it was still there to be killed."""
    ranks = generator.choice(RANKS)
    lock = folder / "map.h5.lock"
    lock.unlink(missing_ok=True)
    with Job(program, mpiexec, deck, ranks=ranks, folder=folder) as job:
        if not job.wait_until(lambda: lock.exists(), "no lock file"):
            assert job.wait() == EXIT_COMPLETE, job.output
            return False
        numbers = job.ranks()
        time.sleep(generator.uniform(0.0, LATEST))
        if job.process.poll() is not None:
            assert job.wait() == EXIT_COMPLETE, job.output
            return False
        job.kill(victims(generator, job, numbers))
        job.wait_for_nobody(numbers.values())
        # It may have come to its end in the very moment.
        return job.wait() != EXIT_COMPLETE


def kill_many(kills, seed, program, mpiexec, deck, folder, reference_path):
    """Kill runs of sweep after sweep until so many are killed, looking at the file each time."""
    generator = random.Random(seed)
    reference = snapshot(reference_path)
    result = folder / "map.h5"
    killed, sweeps, done, seen = 0, 0, {}, 0
    while True:
        if killed < kills:
            finished = not kill_once(generator, program, mpiexec, deck, folder)
            killed += not finished
        else:
            with Job(program, mpiexec, deck, ranks=generator.choice(RANKS), folder=folder) as job:
                assert job.wait() == EXIT_COMPLETE, job.output
            finished = True
        if not result.exists():
            assert not done, "the file is gone"
            continue
        values = snapshot(result)
        assert_done_points_are_right(values, reference)
        for prefix, before in done.items():
            assert values[f"{prefix}status"][before].all(), "a point that was done is not any more"
        done = done_masks(values)
        seen = max(seen, sum(int(mask.sum()) for mask in done.values()))
        if finished:
            assert result.read_bytes() == reference_path.read_bytes()
            result.unlink()
            sweeps, done = sweeps + 1, {}
            if killed >= kills:
                break
    assert seen > 0
    print(f"{killed} kills in {sweeps} sweeps")


def prepare(root, run, tmp_path, **options):
    """A deck, the file of an undisturbed run, and a folder for the others."""
    whole = tmp_path / "whole"
    deck = map_deck(root, whole, **options)
    done = run(deck, ranks=2, folder=whole, environment=EPOCH)
    assert done.returncode == EXIT_COMPLETE, done.stderr
    folder = tmp_path / "killed"
    folder.mkdir()
    return deck, whole / "map.h5", folder


@pytest.mark.parametrize(("start", "kills", "speeds"), [("static", 6, 200), ("up", 3, 60)])
def test_random_kills(root, run, program, mpiexec, tmp_path, start, kills, speeds):
    needs_open_mpi(mpiexec)
    deck, reference, folder = prepare(root, run, tmp_path, rows=5, speeds=speeds, start=start)
    kill_many(kills, 1, program, mpiexec, deck, folder, reference)


@pytest.mark.slow
def test_two_hundred_random_kills(root, run, program, mpiexec, tmp_path):
    needs_open_mpi(mpiexec)
    deck, reference, folder = prepare(root, run, tmp_path, rows=25)
    seed = int(os.environ.get("SPURFLEX_SEED", "200"))
    kill_many(200, seed, program, mpiexec, deck, folder, reference)
