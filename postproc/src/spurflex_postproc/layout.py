"""Checks the layout of a result file before anything is read from it."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

SPEED = "speed"
STIFFNESS = "support_stiffness"
GRID = (STIFFNESS, SPEED)
UNITS = {"speed": ("rpm", "rev/min"), "support_stiffness": ("N/m",)}
MOST_VALUES = 1_000_000
"""Most values of an axis that a deck allows."""
METRES = re.compile(r"(rigid_)?(y1_(amplitude|rms|max|min)|bearing[12]_deformation_max)")
ON_GRID = re.compile(
    r"y1_(amplitude|rms|max|min)|bearing[12]_deformation_max|eta[12]|motion|status|contact"
    r"|periods_integrated|error_estimate|floquet_magnitude|lyapunov_exponent"
)
RECORDED = re.compile(r"(?P<rigid>rigid_)?(?P<product>spectrum|poincare)(_\w+)?")
RECORDED_ON = {"spectrum": "order", "poincare": "section"}
"""Dimension of each recorded product behind the grid."""


class ResultError(Exception):
    """A result file cannot be used; the message is one line for the user."""


def check_file(path: Path) -> int | None:
    """Check that a file is a result file of the expected layout.

    Args:
        path: The file.

    Returns:
        Teeth of the driving gear, if the deck stored in the file tells.

    Raises:
        ResultError: Saying in one line what is wrong.
    """
    if not path.exists():
        raise ResultError(f"{path}: no such file")
    if path.is_dir():
        raise ResultError(f"{path}: is a folder, not a result file")
    if not path.is_file():
        raise ResultError(f"{path}: is not a regular file")
    with reading(path):
        with path.open("rb") as stream:
            empty = not stream.read(1)
        if empty:
            raise ResultError(f"{path}: is empty")
        if not h5py.is_hdf5(path):
            raise ResultError(f"{path}: is not an HDF5 file")
        with h5py.File(path, "r") as file:
            _check_axes(path, file)
            for name, item in file.items():
                if isinstance(item, h5py.Dataset) and name not in UNITS and not item.is_scale:
                    _check_variable(path, name, item)
            _check_supports(path, file)
            return _teeth(file)


@contextmanager
def reading(path: str | Path) -> Iterator[None]:
    """Turn whatever reading a damaged file raises into one line for the user.

    Args:
        path: The file.

    Raises:
        ResultError: Saying what is wrong with it.
    """
    try:
        yield
    except ResultError:
        raise
    except PermissionError as cause:
        raise ResultError(f"{path}: permission denied") from cause
    # Damage shows as anything: types that do not exist, text that is none, impossible sizes.
    except Exception as cause:
        raise ResultError(f"{path}: {_diagnosis(str(cause) or type(cause).__name__)}") from cause


def _check_axes(path: Path, file: h5py.File) -> None:
    """Check the dimension scales: present, one-dimensional, ascending, in the right unit."""
    for name, units in UNITS.items():
        axis = file.get(name)
        if axis is None and name == STIFFNESS:
            continue
        if not isinstance(axis, h5py.Dataset):
            raise ResultError(f"{path}: is not a spurflex result file (no '{name}' axis)")
        if axis.ndim != 1 or axis.dtype.kind not in "fi":
            raise ResultError(f"{path}: '{name}' is not a list of numbers")
        if axis.size > MOST_VALUES:
            raise ResultError(f"{path}: damaged: '{name}' has {axis.size} values")
        values = axis[:]
        if not values.size and name == STIFFNESS:
            continue
        positive = values.size and np.all(np.isfinite(values)) and values[0] > 0
        if not positive or np.any(np.diff(values) <= 0):
            raise ResultError(f"{path}: '{name}' is not positive and ascending")
        _check_unit(path, axis, name, units)


def _check_variable(path: Path, name: str, item: h5py.Dataset) -> None:
    """Check the dimension scales of one variable, their order, lengths and the unit."""
    if not all(len(dimension) for dimension in item.dims):
        raise ResultError(f"{path}: '{name}' has a dimension without scale")
    scales = [dimension[0] for dimension in item.dims]
    # A scale that a group shares goes by either of its names.
    names = tuple(scale.name.rpartition("/")[2] for scale in scales)
    if names == (name,):
        return
    expected: tuple[str, ...] | None = None
    if ON_GRID.fullmatch(name):
        expected = GRID
    elif ON_GRID.fullmatch(name.removeprefix("rigid_")):
        expected = (SPEED,)
    elif found := RECORDED.fullmatch(name):
        grid = (SPEED,) if found["rigid"] else GRID
        expected = (*grid, RECORDED_ON[found["product"]])
    if expected and names != expected:
        raise ResultError(
            f"{path}: '{name}' is on ({', '.join(names)}), expected ({', '.join(expected)})"
        )
    lengths = tuple(scale.size for scale in scales)
    if item.shape != lengths:
        raise ResultError(f"{path}: '{name}' has shape {item.shape}, its scales {lengths}")
    if METRES.fullmatch(name):
        _check_unit(path, item, name, ("m",))


def _check_unit(path: Path, item: h5py.Dataset, name: str, units: tuple[str, ...]) -> None:
    """Check the attribute `units`."""
    unit = plain_text(item.attrs.get("units", ""))
    if unit not in units:
        raise ResultError(f"{path}: '{name}' is in '{unit}', expected '{units[0]}'")


def _check_supports(path: Path, file: h5py.File) -> None:
    """Check that each support comes with its flags, and that there is at least one."""
    found = False
    for prefix in ("", "rigid_"):
        if f"{prefix}y1_amplitude" not in file and f"{prefix}status" not in file:
            continue
        found = True
        for name in ("y1_amplitude", "status", "motion"):
            if prefix + name not in file:
                raise ResultError(f"{path}: is incomplete: lacks '{prefix}{name}'")
    if not found:
        raise ResultError(f"{path}: is not a spurflex result file (no 'y1_amplitude')")


def _teeth(file: h5py.File) -> int | None:
    """Look for `teeth_1` in the resolved deck that the file carries."""
    group = file.get("provenance")
    if not isinstance(group, h5py.Group):
        return None
    texts = list(group.attrs.values())
    texts += [item[()] for item in group.values() if isinstance(item, h5py.Dataset)]
    for text in texts:
        lines = np.atleast_1d(np.asarray(text, dtype=object)).ravel()
        joined = "\n".join(str(plain_text(line)) for line in lines)
        if found := re.search(r"\bteeth_1\s*=\s*(\d+)", joined, re.IGNORECASE):
            return int(found[1])
    return None


def plain_text(value: object) -> object:
    """Turn a string of the file, bytes or padded, into a plain one; leave the rest."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return value.strip().rstrip("\0") if isinstance(value, str) else value


def _diagnosis(message: str) -> str:
    """Say in the user's words why HDF5 could not open or read a file."""
    if "truncated" in message:
        return "is truncated (an interrupted copy, or a full disk)"
    if "unable to lock" in message:
        return "is locked by a run that is still writing it"
    return f"damaged: {one_line(message)}"


def one_line(cause: object) -> str:
    """Fold a message of another library into one line."""
    return " ".join(str(cause).split())
