"""Opens a result file and masks the points without values."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import xarray as xr

from spurflex_postproc.flags import NO_VALUE, Status, has_value
from spurflex_postproc.guard import rehearse
from spurflex_postproc.layout import (
    GRID,
    ON_GRID,
    SPEED,
    ResultError,
    check_file,
    plain_text,
    reading,
)

LARGEST = 1e30
"""Beyond anything that a result can hold, in any of its units."""


@dataclass(frozen=True)
class Coverage:
    """How many points of a grid are in which state."""

    missing: int
    settled: int
    not_settled: int
    diverged: int
    inaccurate: int

    @property
    def total(self) -> int:
        """Number of points of the grid."""
        return self.missing + self.settled + self.not_settled + self.diverged + self.inaccurate

    @property
    def settled_fraction(self) -> float:
        """Settled points as a fraction of all points; 0 for an empty grid."""
        return self.settled / self.total if self.total else 0.0

    def __str__(self) -> str:
        return (
            f"{100 * self.settled_fraction:.1f} % of {self.total} points settled"
            f" ({self.not_settled} not settled, {self.missing} missing,"
            f" {self.diverged} diverged, {self.inaccurate} less accurate than asked for)"
        )


def open_result(path: str | Path) -> xr.Dataset:
    """Read a result file into memory.

    Args:
        path: The HDF5 file that a run wrote.

    Returns:
        The variables at the root of the file on the dimensions `speed` [rev/min] and
        `support_stiffness` [N/m]; what has more dimensions stays in the file, for
        `spurflex_postproc.recordings` or xarray itself. Where a point is missing or diverged,
        reals are NaN and integers are `NO_VALUE`; `status` and `rigid_status` stay as they are.
        The attribute `path` names the file, `teeth_1` the teeth of the driving gear if the file
        tells.

    Raises:
        ResultError: If the file is missing, damaged, foreign or lacks required parts.
    """
    path = Path(path)
    rehearse(path, _read_all)
    return _read(path)


def _read_all(path: Path) -> None:
    """Read what any figure may ask of a file, but not the recorded values themselves."""
    _read(path)
    with h5py.File(path, "r") as file:
        file.visititems(_touch)


def _touch(name: str, item: h5py.Dataset | h5py.Group) -> None:
    """Read attributes and dimension scales."""
    dict(item.attrs)
    if isinstance(item, h5py.Dataset):
        for dimension in item.dims:
            for scale in dimension.values():
                scale.shape  # noqa: B018


def _read(path: Path) -> xr.Dataset:
    """Read a result file; as `open_result`."""
    teeth = check_file(path)
    with reading(path):
        with xr.open_dataset(path, engine="h5netcdf", decode_cf=False) as lazy:
            further = [name for name in lazy.variables if not set(lazy[name].dims) <= set(GRID)]
            result = lazy.drop_vars(further).load()
        # Without decoding, dimension scales are plain variables on some versions of xarray.
        result = result.set_coords([name for name in result.dims if name in result.variables])
        for variable in result.variables.values():
            variable.attrs = {key: plain_text(value) for key, value in variable.attrs.items()}
        _check_flags(path, result)
        result = _masked(result)
        _check_numbers(path, result)
    result.attrs["path"] = str(path)
    if teeth is not None:
        result.attrs["teeth_1"] = teeth
    return result


def coverage(result: xr.Dataset, support: str) -> Coverage:
    """Count the points of one support by status.

    Args:
        result: A dataset from `open_result`.
        support: 'rigid' or 'flexible'.

    Returns:
        The counts.

    Raises:
        ResultError: If the file holds nothing on that support.
    """
    name = "rigid_status" if support == "rigid" else "status"
    require(result, [name])
    status = result[name].values
    return Coverage(*(int(np.count_nonzero(status == flag)) for flag in Status))


def require(result: xr.Dataset, names: Iterable[str]) -> None:
    """Check that a dataset holds some variables.

    Args:
        result: A dataset from `open_result`.
        names: The variables wanted.

    Raises:
        ResultError: Naming those that are absent and the run that would provide them.
    """
    absent = [name for name in names if name not in result]
    if not absent:
        return
    hint = ""
    if all(name.startswith("rigid_") for name in absent):
        hint = " (run with support = 'both' or 'rigid')"
    elif not any(name in result for name in ("status", "y1_amplitude")):
        hint = " (run with support = 'both' or 'flexible')"
    raise ResultError(f"{result.attrs.get('path', 'result')}: lacks {', '.join(absent)}{hint}")


def _check_flags(path: Path, result: xr.Dataset) -> None:
    """Refuse variables that hold no numbers, and flags that do not exist."""
    for name, data in result.data_vars.items():
        if ON_GRID.fullmatch(str(name).removeprefix("rigid_")) and data.dtype.kind not in "fiu":
            raise ResultError(f"{path}: '{name}' does not hold numbers")
        if name in ("status", "rigid_status") and not np.isin(data, list(Status)).all():
            raise ResultError(f"{path}: damaged: '{name}' holds a flag that does not exist")


def _check_numbers(path: Path, result: xr.Dataset) -> None:
    """Refuse numbers that no computation leaves behind where a point has values.

    An estimate of an error may be infinite: nothing is known then.
    """
    for name, data in result.data_vars.items():
        estimate = str(name).endswith(("_error", "error_estimate"))
        if data.dtype.kind == "f" and np.any(
            (np.abs(data) > LARGEST) & ~(estimate & np.isposinf(data))
        ):
            raise ResultError(f"{path}: damaged: '{name}' holds impossible numbers")


def _masked(result: xr.Dataset) -> xr.Dataset:
    """Hide the values of points that are missing or diverged."""
    for name in result.data_vars:
        name = str(name)
        if name in ("status", "rigid_status") or SPEED not in result[name].dims:
            continue
        flags = ["rigid_status"] if name.startswith("rigid_") else ["status"]
        if name.startswith("eta"):
            flags = ["status", "rigid_status"]
        data = result[name]
        if data.dtype.kind in "iub":
            data = data.astype(np.int64)
        blank = np.nan if data.dtype.kind == "f" else NO_VALUE
        for flag in flags:
            if flag in result:
                shown = result[flag].copy(data=has_value(result[flag].values))
                data = data.where(shown, blank).transpose(*result[name].dims)
        result[name] = data.assign_attrs(result[name].attrs)
    return result
