"""Reads what a run recorded of its steady motions: spectra, Poincare sections, time histories.

These can be large, so only the part that is asked for is read from the file.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import h5py
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from spurflex_postproc.flags import has_value
from spurflex_postproc.layout import ResultError, plain_text, reading
from spurflex_postproc.quantities import QUANTITIES

Reals = NDArray[np.float64]

SPECTRUM, SECTION, HISTORY = "spectrum", "poincare", "history"
"""Words of `products` in a deck."""


@dataclass(frozen=True)
class Spectra:
    """Amplitude spectra of one row of points.

    Attributes:
        order: Multiples of the mesh frequency, ascending, shape (o,).
        amplitude: Lines in the unit of the file, NaN without value, shape (speeds, o).
        window: What was transformed, in words; empty if the file does not tell.
    """

    order: Reals
    amplitude: Reals
    window: str = ""


@dataclass(frozen=True)
class Sections:
    """Poincare sections of one row of points, one point a mesh period.

    Attributes:
        value: The quantity in the unit of the file, NaN without value, shape (speeds, points).
        rate: Its rate, same shape.
    """

    value: Reals
    rate: Reals


@dataclass(frozen=True)
class History:
    """Time history of one point.

    Attributes:
        time: Mesh periods since the first point of the Poincare section, shape (t,).
        value: The quantity in the unit of the file, shape (t,).
        rate: Its rate, same shape.
    """

    time: Reals
    value: Reals
    rate: Reals


def variable_name(product: str, quantity: str, support: str, *, rate: bool = False) -> str:
    """Return the name of a recorded variable, with its group.

    Args:
        product: `SPECTRUM`, `SECTION` or `HISTORY`.
        quantity: One of `QUANTITIES`.
        support: 'rigid' or 'flexible'.
        rate: Whether the rate is meant.

    Returns:
        The name, as 'rigid_poincare_x1_rate' or 'history/y1'.
    """
    prefix = "rigid_" if support == "rigid" else ""
    ending = "_rate" if rate else ""
    if product == HISTORY:
        return f"{HISTORY}/{prefix}{quantity}{ending}"
    return prefix + product + ("" if quantity == "y1" else f"_{quantity}") + ending


def has_recording(result: xr.Dataset, product: str, quantity: str, support: str) -> bool:
    """Tell whether the file of a dataset holds a product of a quantity."""
    with _open(result) as file:
        return variable_name(product, quantity, support) in file


def supports_with(result: xr.Dataset, product: str, quantity: str) -> list[str]:
    """Return the supports for which the file holds a product of a quantity.

    Raises:
        ResultError: If there is none.
    """
    found = [
        support
        for support in ("flexible", "rigid")
        if has_recording(result, product, quantity, support)
    ]
    if not found:
        raise _absent(result, product, quantity, "flexible")
    return found


def read_spectra(
    result: xr.Dataset, quantity: str, support: str, row: int, column: int | None = None
) -> Spectra:
    """Read the spectra of all speeds at one support stiffness, or of one point.

    Args:
        result: A dataset from `open_result`.
        quantity: One of `QUANTITIES`.
        support: 'rigid' or 'flexible'.
        row: Position of the support stiffness; not used on the rigid support.
        column: Position of the speed; all speeds if absent.

    Returns:
        The spectra, masked where a point holds no values.

    Raises:
        ResultError: If the file does not hold them.
    """
    with _open(result) as file:
        data = _dataset(file, result, SPECTRUM, quantity, support)
        order = _scale(data)
        amplitude = _rows(data, result, support, row, column)
        window = str(plain_text(data.attrs.get("window", "")))
    return Spectra(order, amplitude, window)


def read_sections(
    result: xr.Dataset, quantity: str, support: str, row: int, column: int | None = None
) -> Sections:
    """Read Poincare sections; arguments and errors as of `read_spectra`."""
    with _open(result) as file:
        value, rate = (
            _rows(
                _dataset(file, result, SECTION, quantity, support, rate=rate),
                result,
                support,
                row,
                column,
            )
            for rate in (False, True)
        )
    return Sections(value, rate)


def read_history(result: xr.Dataset, quantity: str, support: str, row: int, column: int) -> History:
    """Read the time history of one point; arguments and errors as of `read_spectra`."""
    with _open(result) as file:
        data = _dataset(file, result, HISTORY, quantity, support)
        rates = _dataset(file, result, HISTORY, quantity, support, rate=True)
        time = _scale(data)
        value, rate = (_rows(one, result, support, row, column)[0] for one in (data, rates))
    return History(time, value, rate)


@contextmanager
def _open(result: xr.Dataset) -> Iterator[h5py.File]:
    """Open the file of a dataset; what goes wrong becomes one line for the user."""
    path = result.attrs["path"]
    with reading(path), h5py.File(path, "r") as file:
        yield file


def _dataset(
    file: h5py.File,
    result: xr.Dataset,
    product: str,
    quantity: str,
    support: str,
    *,
    rate: bool = False,
) -> h5py.Dataset:
    """Find a recorded variable and check its unit and its shape."""
    path = result.attrs["path"]
    name = variable_name(product, quantity, support, rate=rate)
    if name not in file:
        raise _absent(result, product, quantity, support)
    data = file[name]
    unit = QUANTITIES[quantity].unit + ("/s" if rate else "")
    if plain_text(data.attrs.get("units", "")) != unit:
        raise ResultError(f"{path}: '{name}' is not in '{unit}'")
    grid = result["rigid_status" if support == "rigid" else "status"].shape
    if data.shape[:-1] != grid:
        raise ResultError(f"{path}: '{name}' has shape {data.shape} on a grid of {grid}")
    return data


def _scale(data: h5py.Dataset) -> Reals:
    """Read the dimension scale of the last dimension."""
    last = data.dims[data.ndim - 1]
    if not len(last) or last[0].shape != data.shape[-1:]:
        raise ResultError(f"{data.file.filename}: '{data.name}' has a dimension without scale")
    return np.asarray(last[0][:], dtype=float)


def _rows(
    data: h5py.Dataset, result: xr.Dataset, support: str, row: int, column: int | None
) -> Reals:
    """Read the points of one row, or one of them, as (speeds, values), masked by status."""
    status = result["rigid_status" if support == "rigid" else "status"].values
    columns = slice(None) if column is None else slice(column, column + 1)
    where = (columns,) if support == "rigid" else (row, columns)
    values = np.asarray(data[where], dtype=float)
    values[~has_value(status[where])] = np.nan
    return values


def _absent(result: xr.Dataset, product: str, quantity: str, support: str) -> ResultError:
    """Say which keys of the deck would have recorded something."""
    name = variable_name(product, quantity, support)
    return ResultError(
        f"{result.attrs['path']}: lacks {name} (run with '{product}' among the products,"
        f" '{quantity}' among the quantities, support = 'both' or '{support}')"
    )
