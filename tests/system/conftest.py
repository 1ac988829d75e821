"""What the system tests share: the built program and how to run it on some ranks."""

import os
import shlex
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def pytest_configure(config):
    config.addinivalue_line("markers", "slow: minutes rather than seconds")


@pytest.fixture(scope="session")
def root():
    """Top folder of the sources."""
    return ROOT


@pytest.fixture(scope="session")
def program():
    """The built program."""
    path = Path(os.environ.get("SPURFLEX_PROGRAM", ROOT / "build" / "spurflex"))
    assert path.is_file(), f"{path} is not built"
    return path


@pytest.fixture(scope="session")
def mpiexec():
    """Words before the number of ranks, e.g. mpirun -n."""
    return shlex.split(os.environ.get("SPURFLEX_MPIEXEC", "mpirun -n"))


@pytest.fixture
def run(program, mpiexec, tmp_path):
    """Run the program in an empty folder: run(arguments..., ranks=None, environment={})."""

    def run_program(*arguments, ranks=None, environment=None, folder=tmp_path, timeout=300):
        command = [str(program), *map(str, arguments)]
        if ranks is not None:
            command = [*mpiexec, str(ranks), *command]
        return subprocess.run(
            command,
            cwd=folder,
            env={**os.environ, **(environment or {})},
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )

    return run_program
