"""Runs that end early because they are asked to: a limit of time, a stop file, SIGUSR1.

What is promised: exit code 75, a line that says how to go on, and in the end the same file.
"""

import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
from jobs import (
    EPOCH,
    EXIT_COMPLETE,
    EXIT_STOPPED,
    Job,
    assert_done_points_are_right,
    done_count,
    map_deck,
    needs_open_mpi,
    snapshot,
)

ROWS = 6
LIMIT_SECONDS = 2.5
"""Leaves a second and a half after the second that the program keeps to close its file."""


@pytest.fixture(scope="module")
def whole(root, program, mpiexec, tmp_path_factory):
    """The file of a run that nothing disturbs."""
    folder = tmp_path_factory.mktemp("whole")
    deck = map_deck(root, folder, rows=ROWS)
    with Job(program, mpiexec, deck, ranks=2, folder=folder) as job:
        assert job.wait() == EXIT_COMPLETE, job.output
    return folder / "map.h5"


def go_on(run, deck, folder, whole):
    """Run on to the end; the file is that of the undisturbed run, and nothing else is left."""
    for _ in range(50):
        done = run(deck, ranks=2, folder=folder, environment=EPOCH)
        if done.returncode != EXIT_STOPPED:
            break
    assert done.returncode == EXIT_COMPLETE, done.stderr
    assert (folder / "map.h5").read_bytes() == whole.read_bytes()
    assert {path.suffix for path in folder.iterdir()} <= {".h5", ".nml"}


def test_wall_clock_limit(root, run, program, mpiexec, whole, tmp_path):
    folder = tmp_path / "limited"
    # More work than fits.
    deck = map_deck(root, folder, rows=91, limit=LIMIT_SECONDS / 60)
    with Job(program, mpiexec, deck, ranks=2, folder=folder) as job:
        assert job.wait() == EXIT_STOPPED, job.output
    elapsed = float(re.search(r"done in ([\d.]+) s", job.output)[1])
    assert elapsed < LIMIT_SECONDS
    assert "stopped by the wall-clock limit" in job.output
    assert "run the same command again to go on" in job.output
    assert done_count(folder / "map.h5") > 0


def test_limit_too_short_for_the_start(root, run, whole, tmp_path):
    """However short the limit, every start computes something: repeated often enough the sweep ends."""
    deck = map_deck(root, tmp_path, rows=ROWS, limit=1e-3 / 60)
    counts = [0]
    for _ in range(3):
        done = run(deck, ranks=2, environment=EPOCH)
        assert done.returncode == EXIT_STOPPED, done.stderr
        counts.append(done_count(tmp_path / "map.h5"))
        assert counts[-1] > counts[-2]
        # Those of both supports are left, even if the run ends among the rigid ones.
        left = int(re.search(r"with (\d+) points left", done.stdout)[1])
        assert left == (ROWS + 1) * 571 - counts[-1]
    assert_done_points_are_right(snapshot(tmp_path / "map.h5"), snapshot(whole))


def test_changed_limit_is_the_same_deck(root, run, whole, tmp_path):
    """A run with a limit and one without make the file of a run without."""
    deck = map_deck(root, tmp_path, rows=ROWS, limit=1.3 / 60)
    before = run(deck, ranks=2, environment=EPOCH)
    assert before.returncode in (EXIT_STOPPED, EXIT_COMPLETE)
    deck = map_deck(root, tmp_path, rows=ROWS)
    go_on(run, deck, tmp_path, whole)


@pytest.mark.parametrize("limit", ["-1.0", "1.0e9", "'10:00'"])
def test_wrong_limit_is_refused(root, run, tmp_path, limit):
    done = run("--check", map_deck(root, tmp_path, limit=limit))
    assert done.returncode == 2
    assert "wall_clock_limit" in done.stderr


def test_limit_is_told_by_check(root, run, tmp_path):
    done = run("--check", map_deck(root, tmp_path, limit=240.0))
    assert done.returncode == EXIT_COMPLETE
    assert "before 240.0 min" in done.stdout
    assert "'map.h5.stop'" in done.stdout


def test_stop_file(root, run, program, mpiexec, whole, tmp_path):
    folder = tmp_path / "stopped"
    deck = map_deck(root, folder, rows=ROWS, file="map.h5")
    stop = folder / "map.h5.stop"
    with Job(program, mpiexec, deck, ranks=1, folder=folder) as job:
        assert job.wait_for_points(folder / "map.h5", 100)
        stop.touch()
        code = job.wait()
    assert code == EXIT_STOPPED, job.output
    assert "stopped by the stop file 'map.h5.stop'" in job.output
    assert "remove 'map.h5.stop' and run the same command again" in job.output
    assert_done_points_are_right(snapshot(folder / "map.h5"), snapshot(whole))
    # As long as it is there, a run does nothing, and says so.
    before = (folder / "map.h5").read_bytes()
    done = run(deck, ranks=2, folder=folder)
    assert done.returncode == EXIT_STOPPED
    assert "remove it" in done.stderr
    assert (folder / "map.h5").read_bytes() == before
    stop.unlink()
    go_on(run, deck, folder, whole)


def test_stop_file_is_beside_the_result_file(root, run, tmp_path):
    """It carries the path of the result file, folder and all; one elsewhere means nothing."""
    (tmp_path / "out").mkdir()
    (tmp_path / "map.h5.stop").touch()
    deck = map_deck(root, tmp_path, rows=2, speeds=5, file="out/map.h5")
    done = run(deck)
    assert done.returncode == EXIT_COMPLETE, done.stdout + done.stderr
    (tmp_path / "out" / "map.h5.stop").touch()
    assert run(deck).returncode == EXIT_STOPPED


def test_signal(root, run, program, mpiexec, whole, tmp_path):
    needs_open_mpi(mpiexec)
    folder = tmp_path / "drained"
    deck = map_deck(root, folder, rows=ROWS)
    with Job(program, mpiexec, deck, ranks=3, folder=folder) as job:
        assert job.wait_for_points(folder / "map.h5", 100)
        job.process.send_signal(signal.SIGUSR1)
        asked = time.monotonic()
        code = job.wait()
    assert code == EXIT_STOPPED, job.output
    assert time.monotonic() - asked < 10.0
    assert "stopped by SIGUSR1" in job.output
    assert "run the same command again to go on" in job.output
    go_on(run, deck, folder, whole)


@pytest.mark.parametrize("start", ["static", "up"])
def test_signal_to_one_rank(root, run, program, mpiexec, tmp_path, start):
    """The others hear of it, even while one of them has all of the rigid row; the file is the same."""
    needs_open_mpi(mpiexec)
    grid = {"rows": 48, "speeds": 120, "start": start}
    undisturbed = map_deck(root, tmp_path / "whole", **grid)
    done = run(undisturbed, ranks=2, folder=undisturbed.parent, environment=EPOCH)
    assert done.returncode == EXIT_COMPLETE, done.stderr
    folder = tmp_path / "drained"
    deck = map_deck(root, folder, **grid)
    with Job(program, mpiexec, deck, ranks=3, folder=folder) as job:
        assert job.wait_until(lambda: "points on 3 ranks" in job.output, "no sweep")
        os.kill(job.ranks()[2], signal.SIGUSR1)
        asked = time.monotonic()
        code = job.wait()
    assert code == EXIT_STOPPED, job.output
    assert time.monotonic() - asked < 10.0
    assert "run the same command again to go on" in job.output
    go_on(run, deck, folder, undisturbed.parent / "map.h5")


SCONTROL = """#!/bin/sh
echo "$@" >> "{log}"
"""


@pytest.fixture
def batch(root, program, mpiexec, tmp_path):
    """Run the template of the batch job with a pretended scheduler; what it asked of it."""
    needs_open_mpi(mpiexec)
    tools = tmp_path / "tools"
    tools.mkdir()
    log = tmp_path / "scontrol.log"
    (tools / "scontrol").write_text(SCONTROL.format(log=log))
    (tools / "scontrol").chmod(0o755)
    (tools / "mpirun").write_text(f'#!/bin/sh\nexec {shutil.which(mpiexec[0])} -n 2 "$@"\n')
    (tools / "mpirun").chmod(0o755)

    def start(deck, folder):
        environment = {
            **os.environ,
            **EPOCH,
            "PATH": f"{tools}:{os.environ['PATH']}",
            "DECK": str(deck),
            "SPURFLEX": str(program),
            "SLURM_JOB_ID": "4711",
        }
        return subprocess.Popen(
            ["bash", str(root / "scripts" / "spurflex.slurm")],
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def requeued():
        return log.read_text() if log.exists() else ""

    start.requeued = requeued
    return start


def test_batch_job_resubmits_itself(root, batch, whole, tmp_path):
    """A job out of time goes back into the queue, one that completes the sweep does not."""
    folder = tmp_path / "job"
    deck = map_deck(root, folder, rows=ROWS, limit=1.3 / 60)
    job = batch(deck, folder)
    output = job.communicate(timeout=120)[0]
    assert job.returncode == EXIT_STOPPED, output
    assert batch.requeued() == "requeue 4711\n"
    job = batch(map_deck(root, folder, rows=ROWS), folder)
    output = job.communicate(timeout=120)[0]
    assert job.returncode == EXIT_COMPLETE, output
    assert batch.requeued() == "requeue 4711\n"
    assert (folder / "map.h5").read_bytes() == whole.read_bytes()


def test_batch_job_passes_the_signal_on(root, batch, tmp_path):
    folder = tmp_path / "job"
    deck = map_deck(root, folder, rows=91)
    job = batch(deck, folder)
    deadline = time.monotonic() + 60
    while not ((folder / "map.h5").exists() and done_count(folder / "map.h5") > 0):
        assert time.monotonic() < deadline
        assert job.poll() is None
        time.sleep(0.05)
    job.send_signal(signal.SIGUSR1)
    job.communicate(timeout=120)
    assert job.returncode == EXIT_STOPPED
    assert batch.requeued() == "requeue 4711\n"


def catches_usr1(number):
    """Whether a process has a handler of SIGUSR1."""
    status = (Path("/proc") / str(number) / "status").read_text()
    return bool(int(re.search(r"SigCgt:\s*(\w+)", status)[1], 16) >> (signal.SIGUSR1 - 1) & 1)


@pytest.mark.parametrize("pause", [0.0, 0.15, 0.3, 0.45, 0.6])
def test_batch_job_is_asked_to_stop_before_it_has_begun(root, batch, tmp_path, pause):
    """The signal is not lost, and no failure, whatever of the job has started."""
    folder = tmp_path / "job"
    deck = map_deck(root, folder, rows=91)
    job = batch(deck, folder)
    deadline = time.monotonic() + 60
    while not catches_usr1(job.pid):
        assert time.monotonic() < deadline
        time.sleep(0.001)
    time.sleep(pause)
    job.send_signal(signal.SIGUSR1)
    output = job.communicate(timeout=120)[0]
    assert job.returncode == EXIT_STOPPED, output
    assert batch.requeued() == "requeue 4711\n"


def test_batch_job_with_a_stop_file_stays_away(root, batch, tmp_path):
    folder = tmp_path / "job"
    deck = map_deck(root, folder, rows=2, speeds=5)
    (folder / "map.h5.stop").touch()
    job = batch(deck, folder)
    output = job.communicate(timeout=120)[0]
    assert job.returncode == EXIT_STOPPED
    assert "not put back" in output
    assert batch.requeued() == ""
