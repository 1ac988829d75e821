"""Runs that end early: drained by SIGUSR1 or killed; what was computed stays and the file ends the same."""

import os
import re
import signal
import subprocess
import time

import pytest
import xarray

EXIT_COMPLETE, EXIT_MISMATCH, EXIT_STOPPED = 0, 3, 75
EPOCH = {"SOURCE_DATE_EPOCH": "1500000000"}
STIFFNESSES = 6


@pytest.fixture
def deck(root, tmp_path):
    """Six rows of the map of figure 9: a few seconds of work."""
    text = (root / "input" / "paper" / "figure9.nml").read_text()
    text = text.replace("results/figure9.h5", "map.h5")
    text = re.sub(r"stiffness_count = \d+", f"stiffness_count = {STIFFNESSES}", text)
    text = re.sub(r"max_periods\s*= \d+", "max_periods = 1000", text)
    path = tmp_path / "map.nml"
    path.write_text(text)
    return path


@pytest.fixture
def whole(run, deck, tmp_path):
    """The file of a run that nothing disturbs."""
    folder = tmp_path / "whole"
    folder.mkdir()
    assert run(deck, ranks=2, folder=folder, environment=EPOCH).returncode == EXIT_COMPLETE
    return folder / "map.h5"


def interrupt(program, mpiexec, deck, folder, number, after):
    """Start the deck on two ranks, send a signal once the file is there, return the exit code."""
    folder.mkdir(exist_ok=True)
    command = [*mpiexec, "2", str(program), str(deck)]
    with subprocess.Popen(
        command,
        cwd=folder,
        env={**os.environ, **EPOCH},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as job:
        deadline = time.monotonic() + 60
        while not (folder / "map.h5").exists():
            assert time.monotonic() < deadline, "no result file"
            time.sleep(0.01)
        time.sleep(after)
        job.send_signal(number)
        return job.wait(timeout=120)


def done_points(path):
    """How many points of the flexible support are there."""
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        return int((data.status != 0).sum())


def test_drain_and_go_on(run, program, mpiexec, deck, whole, tmp_path):
    folder = tmp_path / "drained"
    code = interrupt(program, mpiexec, deck, folder, signal.SIGUSR1, after=0.7)
    assert code in (EXIT_STOPPED, EXIT_COMPLETE)
    before = done_points(folder / "map.h5")
    if code == EXIT_STOPPED:
        assert before < done_points(whole)
    done = run(deck, ranks=3, folder=folder, environment=EPOCH)
    assert done.returncode == EXIT_COMPLETE
    assert (folder / "map.h5").read_bytes() == whole.read_bytes()
    assert not (folder / "map.h5.lock").exists()


@pytest.mark.parametrize("after", [0.05, 0.5, 1.0])
def test_kill_and_go_on(run, program, mpiexec, deck, whole, tmp_path, after):
    folder = tmp_path / "killed"
    interrupt(program, mpiexec, deck, folder, signal.SIGKILL, after=after)
    # The ranks notice that mpirun is gone a moment later.
    deadline = time.monotonic() + 60
    while True:
        done = run(deck, ranks=1, folder=folder, environment=EPOCH)
        if done.returncode != EXIT_MISMATCH or time.monotonic() > deadline:
            break
        time.sleep(0.5)
    assert done.returncode == EXIT_COMPLETE, done.stderr
    assert (folder / "map.h5").read_bytes() == whole.read_bytes()


def test_other_deck_is_refused(run, deck, whole):
    deck.write_text(deck.read_text().replace("damping_ratio  = 0.15", "damping_ratio  = 0.16"))
    before = whole.read_bytes()
    done = run(deck, folder=whole.parent)
    assert done.returncode == EXIT_MISMATCH
    assert "damping_ratio" in done.stderr
    assert whole.read_bytes() == before


def test_finished_run_is_recognised(run, deck, whole):
    before = whole.read_bytes()
    done = run(deck, ranks=2, folder=whole.parent)
    assert done.returncode == EXIT_COMPLETE
    assert "nothing to do" in done.stdout
    assert whole.read_bytes() == before


def test_fresh_starts_over(run, deck, whole):
    before = whole.read_bytes()
    done = run("--fresh", deck, ranks=2, folder=whole.parent, environment=EPOCH)
    assert done.returncode == EXIT_COMPLETE
    assert "nothing to do" not in done.stdout
    assert whole.read_bytes() == before
