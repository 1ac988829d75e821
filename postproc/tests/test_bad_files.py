"""Files that are no result, or no longer one: a line and exit code 2, or what is there is drawn.

Commands run in a child process, as damaged files can make the HDF5 library crash or hang.
"""

import os
import random
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
import pytest
import xarray as xr
from result_files import write_result

from spurflex_postproc import ResultError, cli, guard
from spurflex_postproc.published_table import cli as published

SECONDS = 120
SEED = 5
COMMANDS = ("2", "9", "10", "starts", "published")
FLIPS = 30
LENGTHS = 40
SPEED = np.linspace(300.0, 6000.0, 39)


class Outcome(NamedTuple):
    """How a command ended: exit code (negative: a signal), what it printed, where it wrote."""

    code: int
    out: str
    err: str
    folder: Path


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A small result file with what every command asks for."""
    path = tmp_path_factory.mktemp("good") / "good.h5"
    write_result(path, SPEED, np.logspace(7, 11, 5), irregular=(4650.0, 4990.0))
    with h5py.File(path, "r+") as file:
        for prefix in ("", "rigid_"):
            name = f"{prefix}bearing1_deformation_max"
            file.copy(name, name.replace("1", "2"))
        file.copy("eta1", "eta2")
        file["provenance"]["resolved_deck"] = "&sweep\n  start = 'up'\n/\n"
    return path.read_bytes()


@pytest.fixture
def path(tmp_path: Path, good: bytes) -> Path:
    """A good file to be damaged, under the name that spurflex-published looks for."""
    made = tmp_path / "results" / "figure2-up.h5"
    made.parent.mkdir()
    made.write_bytes(good)
    # Of the same length, so that nothing else changes.
    made.with_name("other.h5").write_bytes(good.replace(b"start = 'up'", b"start = 'no'"))
    return made


def arguments(command: str, path: Path, folder: Path) -> tuple[Callable[..., int], list[str]]:
    """Return the entry point of a command and its command line."""
    if command == "published":
        return published.main, [str(path.parent), "--output", str(folder)]
    files = [str(path), str(path.with_name("other.h5"))]
    return cli.main, [command, *files[: 1 + (command == "starts")], "--output", str(folder)]


def run(command: str, path: Path, *, draw_only: bool = False) -> Outcome:
    """Run a command on a file in a child process."""
    folder = path.parents[1] / "output"
    main, line = arguments(command, path, folder)
    shutil.rmtree(folder, ignore_errors=True)
    streams = [path.parents[1] / name for name in ("out", "err")]
    child = os.fork()
    if child == 0:
        code = 70
        try:
            signal.alarm(SECONDS)
            for number, stream in enumerate(streams, start=1):
                opened = os.open(stream, os.O_CREAT | os.O_TRUNC | os.O_WRONLY)
                os.dup2(opened, number)
            sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
            if draw_only:
                cli.save = lambda figure, folder, name: []
            code = main(line)
        except SystemExit as left:
            code = int(left.code or 0)
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return Outcome(code, *(stream.read_text("utf-8", "replace") for stream in streams), folder)


def check(outcome: Outcome, codes: tuple[int, ...] = (0, 2)) -> None:
    """Check what holds of every command on every file."""
    assert outcome.code in codes, f"{outcome.code}: {outcome.err}"
    files = [] if not outcome.folder.exists() else sorted(outcome.folder.iterdir())
    for file in files:
        content = file.read_bytes()
        if file.suffix == ".pdf":
            assert content.rstrip().endswith(b"%%EOF"), file
        elif file.suffix == ".png":
            assert content.endswith(b"IEND\xaeB`\x82"), file
        else:
            assert file.suffix in (".md", ".json"), file
    if outcome.code == 0:
        assert outcome.err == ""
    else:
        assert files == []
        assert outcome.err.startswith("spurflex-")
        assert outcome.err.count("\n") == 1, outcome.err
        assert len(outcome.err) < 1000
        assert all(letter.isprintable() for letter in outcome.err.rstrip("\n")), outcome.err


def no_file(path: Path) -> None:
    """Nothing at all."""


def folder(path: Path) -> None:
    """A folder."""
    path.mkdir()


def pipe(path: Path) -> None:
    """A pipe that nobody writes to."""
    os.mkfifo(path)


def dangling(path: Path) -> None:
    """A link to nowhere."""
    path.symlink_to(path.parent / "gone")


def netcdf(path: Path) -> None:
    """Somebody else's NetCDF file with an axis of the same name."""
    data = xr.Dataset({"temperature": ("speed", np.arange(3.0))}, {"speed": np.arange(1.0, 4.0)})
    data.to_netcdf(path, engine="h5netcdf")


def foreign(path: Path) -> None:
    """An HDF5 file whose names mean something else."""
    with h5py.File(path, "w") as file:
        file.create_group("speed")
        file["status"] = h5py.ExternalLink("absent.h5", "/x")
        file["y1_amplitude"] = h5py.SoftLink("/nowhere")


def binary(content: bytes) -> Callable[[Path], None]:
    """A file with some content."""

    def make(path: Path) -> None:
        path.write_bytes(content)

    return make


FOREIGN = {
    "absent": no_file,
    "folder": folder,
    "pipe": pipe,
    "dangling": dangling,
    "netcdf": netcdf,
    "foreign": foreign,
    "empty": binary(b""),
    "one byte": binary(b"\x89"),
    "signature": binary(b"\x89HDF\r\n\x1a\n"),
    "signature and zeros": binary(b"\x89HDF\r\n\x1a\n" + bytes(4000)),
    "csv": binary(b"speed,amplitude\n300,1e-6\n"),
    "png": binary(b"\x89PNG\r\n\x1a\n" + bytes(200)),
    "netcdf 3": binary(b"CDF\x01" + bytes(200)),
    "zip": binary(b"PK\x03\x04" + bytes(200)),
    "random": binary(random.Random(SEED).randbytes(5000)),
}


@pytest.mark.parametrize("make", FOREIGN.values(), ids=FOREIGN)
def test_foreign_file(path: Path, make: Callable[[Path], None]) -> None:
    path.unlink()
    make(path)
    for command in COMMANDS:
        outcome = run(command, path)
        check(outcome, (2,))
        assert str(path) in outcome.err


def test_good_file(path: Path) -> None:
    for command in COMMANDS:
        check(run(command, path, draw_only=True), (0,))


def test_truncated_file(path: Path, good: bytes) -> None:
    """Cut anywhere: in the superblock, between objects, at the last byte."""
    at = random.Random(SEED)
    ends = [*range(1, 12), len(good) - 1, *(at.randrange(len(good)) for _ in range(LENGTHS))]
    for number, end in enumerate(ends):
        path.write_bytes(good[:end])
        check(run(COMMANDS[number % len(COMMANDS)], path), (2,))


def test_flipped_bytes(path: Path, good: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes changed anywhere: refused, or drawn where the damage does not show."""
    monkeypatch.setattr(guard, "SECONDS", 10.0)
    at = random.Random(SEED)
    codes = set()
    for number in range(FLIPS):
        content = bytearray(good)
        for _ in range(at.choice((1, 1, 4, 32))):
            place = at.randrange(len(content))
            content[place] = at.choice((0, 255, content[place] ^ (1 << at.randrange(8))))
        path.write_bytes(content)
        outcome = run(COMMANDS[number % len(COMMANDS)], path, draw_only=True)
        check(outcome)
        codes.add(outcome.code)
    assert codes == {0, 2}


def replace(file: h5py.File, name: str, data: np.ndarray) -> None:
    """Replace a variable; unit and dimension scales stay as far as they fit."""
    old = file[name]
    scales = [dimension[0] for dimension in old.dims]
    unit = old.attrs["units"]
    del file[name]
    new = file.create_dataset(name, data=data)
    new.attrs["units"] = unit
    for dimension, scale in zip(new.dims, scales, strict=False):
        dimension.attach_scale(scale)


def wrong_values(old: np.ndarray) -> dict[str, np.ndarray]:
    """What may stand in the place of a variable."""
    return {
        "NaN": np.full(old.shape, np.nan),
        "infinite": np.full(old.shape, np.inf),
        "huge": np.full(old.shape, 1e300),
        "zero": np.zeros(old.shape),
        "negative": np.full(old.shape, -1e-3),
        "text": np.full(old.shape, b"abc", dtype="S3"),
        "complex": old.astype(complex),
        "records": np.zeros(old.shape, dtype=[("a", "f8"), ("b", "i4")]),
        "transposed": old.T,
        "shorter": old[..., :-1],
        "a number": np.float64(1.0),
        "empty": np.zeros((0,) * old.ndim),
        "one dimension more": old[..., np.newaxis],
        "other flags": np.full(old.shape, 77, dtype=np.int32),
    }


@pytest.mark.parametrize(
    "name", ["speed", "support_stiffness", "y1_amplitude", "status", "motion", "rigid_status"]
)
def test_wrong_variable(path: Path, good: bytes, name: str) -> None:
    with h5py.File(path, "r") as file:
        kinds = wrong_values(file[name][...])
    for number, (kind, data) in enumerate(kinds.items()):
        path.write_bytes(good)
        with h5py.File(path, "r+") as file:
            if name in ("speed", "support_stiffness"):
                if data.shape != file[name].shape or data.dtype.kind not in "fi":
                    continue
                file[name][...] = data
            else:
                replace(file, name, data)
        outcome = run(COMMANDS[number % len(COMMANDS)], path, draw_only=True)
        assert outcome.code in (0, 2), f"{kind}: {outcome.err}"
        check(outcome)


@pytest.mark.parametrize("flag", [0, 3])
def test_no_point_holds_a_value(path: Path, flag: int) -> None:
    """A file that was made but not filled, and one whose points all diverged."""
    with h5py.File(path, "r+") as file:
        for prefix in ("", "rigid_"):
            file[f"{prefix}status"][...] = flag
            for name in ("y1_amplitude", "bearing1_deformation_max"):
                file[prefix + name][...] = np.nan
    for command in COMMANDS:
        outcome = run(command, path)
        check(outcome)


def test_missing_variables(path: Path, good: bytes) -> None:
    with h5py.File(path, "r") as file:
        names = [name for name in file if name not in ("provenance", "history")]
    for number, name in enumerate(names):
        path.write_bytes(good)
        with h5py.File(path, "r+") as file:
            del file[name]
        outcome = run(COMMANDS[number % len(COMMANDS)], path, draw_only=True)
        check(outcome)


def crash(path: Path) -> None:
    """End as the library may on a damaged file."""
    os.kill(os.getpid(), signal.SIGKILL)


def hang(path: Path) -> None:
    """Come to no end."""
    time.sleep(SECONDS)


def swallow(path: Path) -> None:
    """Ask for an impossible amount of memory."""
    np.ones(2**40)


@pytest.mark.parametrize(
    ("read", "message"),
    [(crash, "cannot read it"), (hang, "comes to no end"), (swallow, "impossible size")],
)
def test_library_that_fails(
    path: Path,
    monkeypatch: pytest.MonkeyPatch,
    read: Callable[[Path], None],
    message: str,
) -> None:
    monkeypatch.setattr(guard, "SECONDS", 0.5 if read is hang else 60.0)
    with pytest.raises(ResultError, match=message):
        guard.rehearse(path, read)
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


def test_what_the_reader_raises_is_left_to_the_reader(path: Path) -> None:
    def refuse(path: Path) -> None:
        raise ResultError("wrong")

    guard.rehearse(path, refuse)
