"""The regression runner accepts what is within its tolerances and names what is not."""

import json
import os
import subprocess
import sys

import h5py
import numpy as np
import pytest

TOLERANCES = """
[y1_amplitude]
relative = 1e-6
absolute = 1e-12
reason = "test"

[status]
exact = true
reason = "test"
"""

PROGRAM = """#!{python}
import shutil, sys
shutil.copy({result!r}, "result.h5")
sys.exit({code})
"""


def write_result(path, amplitude=((1e-6, 2e-6, np.nan), (0.0, 5e-6, 6e-6)), status=(1, 1, 3)):
    with h5py.File(path, "w") as file:
        file["y1_amplitude"] = np.array(amplitude)
        file["status"] = np.array(status, dtype="i4")
    return path


@pytest.fixture
def case(tmp_path, runner):
    folder = tmp_path / "case"
    folder.mkdir()
    (folder / "deck.nml").write_text("&case /\n")
    (folder / "tolerances.toml").write_text(TOLERANCES)
    done = runner(folder, "--update", "--result", write_result(tmp_path / "first.h5"))
    assert done.returncode == 0, done.stdout
    return folder


@pytest.fixture
def runner(root):
    def run(*arguments, environment=None):
        return subprocess.run(
            [sys.executable, str(root / "tests/regression/run.py"), *map(str, arguments)],
            env={**os.environ, **(environment or {})},
            capture_output=True,
            text=True,
            check=False,
        )

    return run


def test_reference_keeps_nan_as_null(case):
    reference = json.loads((case / "reference.json").read_text())
    assert reference["exit_code"] == 0
    assert reference["values"]["y1_amplitude"] == [[1e-6, 2e-6, None], [0.0, 5e-6, 6e-6]]
    assert reference["values"]["status"] == [1, 1, 3]


def test_same_values(case, runner, tmp_path):
    done = runner(case, "--result", write_result(tmp_path / "a.h5"))
    assert done.returncode == 0, done.stdout


def test_within_tolerances(case, runner, tmp_path):
    near = ((1e-6 + 9e-13, 2e-6 * (1 + 4e-7), np.nan), (-9e-13, 5e-6, 6e-6))
    done = runner(case, "--result", write_result(tmp_path / "a.h5", amplitude=near))
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"amplitude": ((1e-6, 2e-6, np.nan), (2e-12, 5e-6, 6e-6))}, "y1_amplitude[1, 0]"),
        ({"amplitude": ((1e-6, 2e-6, np.nan), (0.0, np.nan, 6e-6))}, "y1_amplitude[1, 1]"),
        ({"amplitude": ((1e-6, 2e-6, 3e-6), (0.0, 5e-6, 6e-6))}, "y1_amplitude[0, 2]"),
        ({"amplitude": ((1e-6, 2e-6, np.nan), (0.0, 5e-6, np.inf))}, "y1_amplitude[1, 2]"),
        ({"amplitude": ((1e-6, 0.0), (2e-6, 5e-6), (np.nan, 6e-6))}, "y1_amplitude: shape"),
        ({"status": (1, 2, 3)}, "status[1]"),
    ],
)
def test_differences_are_named(case, runner, tmp_path, changes, named):
    done = runner(case, "--result", write_result(tmp_path / "a.h5", **changes))
    assert done.returncode == 1
    assert named in done.stdout
    assert done.stdout.count("\n") == 1


def test_missing_quantity(case, runner, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["status"] = [1, 1, 3]
    done = runner(case, "--result", tmp_path / "a.h5")
    assert done.returncode == 1
    assert "no y1_amplitude" in done.stdout


def test_tolerance_without_reason(case, runner, tmp_path):
    (case / "tolerances.toml").write_text(TOLERANCES.replace('reason = "test"', "", 1))
    done = runner(case, "--result", write_result(tmp_path / "a.h5"))
    assert done.returncode == 1
    assert "reason" in done.stdout


def test_missing_reference(case, runner, tmp_path):
    (case / "reference.json").unlink()
    done = runner(case, "--result", write_result(tmp_path / "a.h5"))
    assert done.returncode == 1
    assert "regenerate" in done.stdout


@pytest.mark.parametrize(("code", "expected"), [(0, 0), (4, 1)])
def test_program_is_run(case, runner, tmp_path, code, expected):
    result = write_result(tmp_path / "a.h5")
    program = tmp_path / "program"
    program.write_text(PROGRAM.format(python=sys.executable, result=str(result), code=code))
    program.chmod(0o755)
    environment = {"SPURFLEX_PROGRAM": str(program), "SPURFLEX_MPIEXEC": "env -u"}
    done = runner(case, "--ranks", 2, environment=environment)
    assert done.returncode == expected, done.stdout
    assert ("exit code 4, reference 0" in done.stdout) == (code == 4)


def test_program_without_result(case, runner):
    environment = {"SPURFLEX_PROGRAM": "false", "SPURFLEX_MPIEXEC": "env -u"}
    done = runner(case, environment=environment)
    assert done.returncode == 1
    assert "0 result files" in done.stdout
