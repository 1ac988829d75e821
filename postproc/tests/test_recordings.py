"""Spectra, Poincare sections and histories: what is read is what the file holds."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from result_files import SECOND, WINDOW

from spurflex_postproc import ResultError, open_result
from spurflex_postproc.recordings import (
    HISTORY,
    SECTION,
    SPECTRUM,
    has_recording,
    read_history,
    read_sections,
    read_spectra,
    supports_with,
    variable_name,
)


@pytest.fixture
def file_to_damage(motions_file: Path, tmp_path: Path) -> Path:
    """A copy that a test may change."""
    path = tmp_path / "copy.h5"
    path.write_bytes(motions_file.read_bytes())
    return path


def test_names() -> None:
    assert variable_name(SPECTRUM, "y1", "flexible") == "spectrum"
    assert variable_name(SECTION, "x2", "rigid", rate=True) == "rigid_poincare_x2_rate"
    assert variable_name(HISTORY, "y1", "rigid") == "history/rigid_y1"


def test_large_variables_stay_in_the_file(motions_file: Path) -> None:
    result = open_result(motions_file)
    assert set(result.dims) == {"support_stiffness", "speed"}
    assert "spectrum" not in result and "order" not in result.variables
    assert result["motion"].shape == (1, 20)


@pytest.mark.parametrize("support", ["flexible", "rigid"])
@pytest.mark.parametrize("quantity", ["y1", "x2"])
def test_rows_hold_the_data(motions_file: Path, support: str, quantity: str) -> None:
    result = open_result(motions_file)
    spectra = read_spectra(result, quantity, support, 0)
    sections = read_sections(result, quantity, support, 0)
    with h5py.File(motions_file) as file:
        for values, product, rate in (
            (spectra.amplitude, SPECTRUM, False),
            (sections.value, SECTION, False),
            (sections.rate, SECTION, True),
        ):
            there = file[variable_name(product, quantity, support, rate=rate)][:]
            np.testing.assert_array_equal(values, there.reshape(20, -1))
        np.testing.assert_array_equal(spectra.order, file["order"][:])
    assert "Hann" in spectra.window


def test_one_point(motions_file: Path) -> None:
    result = open_result(motions_file)
    column = int(np.argmin(np.abs(result["speed"].values - 4800)))
    spectrum = read_spectra(result, "y1", "flexible", 0, column)
    assert spectrum.amplitude.shape == (1, 4 * WINDOW + 1)
    low = (spectrum.order > 0) & (spectrum.order < 0.5)
    strongest = spectrum.order[low][np.argmax(spectrum.amplitude[0, low])]
    assert strongest == pytest.approx(SECOND, abs=1 / WINDOW)
    history = read_history(result, "y1", "flexible", 0, column)
    assert history.time[0] == 0 and history.time[-1] == pytest.approx(8, abs=0.1)
    assert history.value.shape == history.rate.shape == history.time.shape


def test_points_without_values_are_masked(file_to_damage: Path) -> None:
    with h5py.File(file_to_damage, "r+") as file:
        file["status"][0, 3], file["rigid_status"][5] = 0, 3
    result = open_result(file_to_damage)
    for support, column in (("flexible", 3), ("rigid", 5)):
        spectra = read_spectra(result, "y1", support, 0)
        assert np.flatnonzero(np.isnan(spectra.amplitude).all(axis=1)).tolist() == [column]
        assert np.isnan(read_history(result, "y1", support, 0, column).value).all()


def test_what_is_absent_is_named(curve_file: Path, file_to_damage: Path) -> None:
    result = open_result(curve_file)
    assert not has_recording(result, SPECTRUM, "y1", "flexible")
    with pytest.raises(ResultError, match=r"lacks spectrum .*'spectrum' among the products"):
        supports_with(result, SPECTRUM, "y1")
    with pytest.raises(ResultError, match=r"lacks history/rigid_xm .*'xm' among the quantities"):
        read_history(open_result(file_to_damage), "xm", "rigid", 0, 0)


def test_wrong_unit_and_shape(file_to_damage: Path) -> None:
    with h5py.File(file_to_damage, "r+") as file:
        file["spectrum"].attrs["units"] = np.bytes_("mm")
        file["history/y1"].attrs["units"] = np.bytes_("m/s")
    result = open_result(file_to_damage)
    with pytest.raises(ResultError, match="'spectrum' is not in 'm'"):
        read_spectra(result, "y1", "flexible", 0)
    with pytest.raises(ResultError, match="'history/y1' is not in 'm'"):
        read_history(result, "y1", "flexible", 0, 0)


def test_transposed_spectrum(file_to_damage: Path) -> None:
    with h5py.File(file_to_damage, "r+") as file:
        data = file["rigid_spectrum"][:].T
        del file["rigid_spectrum"]
        item = file.create_dataset("rigid_spectrum", data=data)
        item.dims[0].attach_scale(file["order"])
        item.dims[1].attach_scale(file["speed"])
        item.attrs["units"] = np.bytes_("m")
    with pytest.raises(ResultError, match=r"is on \(order, speed\), expected \(speed, order\)"):
        open_result(file_to_damage)
