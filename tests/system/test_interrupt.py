"""Runs that end early: drained by SIGUSR1 or killed; what was computed stays and the file ends the same."""

import os
import shutil
import signal
import subprocess
import time

import pytest
import xarray
from jobs import EPOCH, EXIT_COMPLETE, EXIT_MISMATCH, EXIT_STOPPED, Job, map_deck, needs_open_mpi


@pytest.fixture
def deck(root, tmp_path):
    """Six rows of the map of figure 9: a few seconds of work."""
    return map_deck(root, tmp_path)


@pytest.fixture(scope="module")
def whole(root, program, mpiexec, tmp_path_factory):
    """The file of a run that nothing disturbs."""
    folder = tmp_path_factory.mktemp("whole")
    with Job(program, mpiexec, map_deck(root, folder), ranks=2, folder=folder) as job:
        assert job.wait() == EXIT_COMPLETE, job.output
    return folder / "map.h5"


@pytest.fixture
def copy(whole, tmp_path):
    """A copy of it, to run on."""
    folder = tmp_path / "copy"
    folder.mkdir()
    return shutil.copy(whole, folder / "map.h5")


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


def test_other_deck_is_refused(run, deck, copy):
    deck.write_text(deck.read_text().replace("damping_ratio  = 0.15", "damping_ratio  = 0.16"))
    before = copy.read_bytes()
    done = run(deck, folder=copy.parent)
    assert done.returncode == EXIT_MISMATCH
    assert "damping_ratio" in done.stderr
    assert copy.read_bytes() == before


def test_finished_run_is_recognised(run, deck, copy):
    before = copy.read_bytes()
    done = run(deck, ranks=2, folder=copy.parent)
    assert done.returncode == EXIT_COMPLETE
    assert "nothing to do" in done.stdout
    assert copy.read_bytes() == before


def test_settings_of_the_mpi_library_stay(run, mpiexec, deck, copy):
    """The program chooses how Open MPI starts only where the user has not."""
    needs_open_mpi(mpiexec)
    done = run(deck, folder=copy.parent, environment={"OMPI_MCA_pml": "none_of_this_name"})
    assert done.returncode not in (EXIT_COMPLETE, EXIT_MISMATCH, EXIT_STOPPED)


def test_fresh_starts_over(run, deck, copy):
    before = copy.read_bytes()
    done = run("--fresh", deck, ranks=2, folder=copy.parent, environment=EPOCH)
    assert done.returncode == EXIT_COMPLETE
    assert "nothing to do" not in done.stdout
    assert copy.read_bytes() == before
