"""Reading: values and axes as stored, doubtful points masked, faults told in one line."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from result_files import flexible_amplitude, rigid_amplitude, write_result

from spurflex_postproc import ResultError, coverage, open_result

SPEED = np.linspace(300.0, 340.0, 5)
STIFFNESS = np.logspace(3, 5, 3)


def test_axes_are_not_transposed(small_file: Path) -> None:
    result = open_result(small_file)
    assert result["y1_amplitude"].dims == ("support_stiffness", "speed")
    assert result["y1_amplitude"].shape == (3, 5)
    np.testing.assert_array_equal(result["speed"], np.linspace(300, 6000, 571)[:5])
    np.testing.assert_array_equal(
        result["y1_amplitude"],
        flexible_amplitude(result.speed.values, result["support_stiffness"].values),
    )
    np.testing.assert_array_equal(
        result["rigid_y1_amplitude"], rigid_amplitude(result.speed.values)
    )
    assert set(result.coords) == {"speed", "support_stiffness"}


def test_attributes_are_text(small_file: Path) -> None:
    result = open_result(small_file)
    assert result["y1_amplitude"].attrs["units"] == "m"
    assert result["speed"].attrs["units"] == "rpm"
    assert result.attrs["teeth_1"] == 55


def test_opens_in_plain_xarray(small_file: Path) -> None:
    with xr.open_dataset(small_file, engine="h5netcdf") as result:
        assert result["y1_amplitude"].dims == ("support_stiffness", "speed")


def test_points_without_value_are_masked(small_file: Path) -> None:
    with h5py.File(small_file, "r+") as file:
        file["status"][0, 1], file["status"][2, 3], file["status"][1, 1] = 0, 3, 2
        file["rigid_status"][4] = 3
    result = open_result(small_file)
    blank = np.zeros((3, 5), dtype=bool)
    blank[0, 1] = blank[2, 3] = True
    np.testing.assert_array_equal(np.isnan(result["y1_amplitude"]), blank)
    np.testing.assert_array_equal(result["motion"] == -1, blank)
    blank[:, 4] = True
    np.testing.assert_array_equal(np.isnan(result["eta1"]), blank)
    assert np.flatnonzero(np.isnan(result["rigid_y1_amplitude"])).tolist() == [4]
    counts = coverage(result, "flexible")
    assert (counts.missing, counts.not_settled, counts.diverged) == (1, 1, 1)
    assert counts.settled_fraction == pytest.approx(12 / 15)
    assert coverage(result, "rigid").settled_fraction == pytest.approx(4 / 5)


@pytest.mark.parametrize(("support", "absent"), [("rigid", "flexible"), ("flexible", "rigid")])
def test_one_support_only(tmp_path: Path, support: str, absent: str) -> None:
    result = open_result(write_result(tmp_path / "r.h5", SPEED, STIFFNESS, support=support))
    assert coverage(result, support).settled_fraction == 1
    with pytest.raises(ResultError, match=rf"lacks .*status.*'both' or '{absent}'"):
        coverage(result, absent)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ResultError, match="no such file"):
        open_result(tmp_path / "none.h5")
    with pytest.raises(ResultError, match="is a folder"):
        open_result(tmp_path)


@pytest.mark.parametrize("content", [b"", b"speed,amplitude\n300,1\n"])
def test_not_hdf5(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "result.h5"
    path.write_bytes(content)
    with pytest.raises(ResultError, match=r"is empty|is not an HDF5 file"):
        open_result(path)


@pytest.mark.parametrize("kept", [0.3, 0.6, 0.95])
def test_truncated_file(small_file: Path, kept: float) -> None:
    content = small_file.read_bytes()
    small_file.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(ResultError, match="is truncated"):
        open_result(small_file)


def test_damaged_file(small_file: Path) -> None:
    content = bytearray(small_file.read_bytes())
    content[100:2500] = bytes(2400)
    small_file.write_bytes(content)
    with pytest.raises(ResultError) as caught:
        open_result(small_file)
    assert "\n" not in str(caught.value)


def test_foreign_file(tmp_path: Path) -> None:
    path = tmp_path / "foreign.h5"
    with h5py.File(path, "w") as file:
        file["temperature"] = np.zeros(3)
    with pytest.raises(ResultError, match="not a spurflex result file"):
        open_result(path)


@pytest.mark.parametrize("name", ["status", "motion", "y1_amplitude", "rigid_status"])
def test_incomplete_file(small_file: Path, name: str) -> None:
    with h5py.File(small_file, "r+") as file:
        del file[name]
    with pytest.raises(ResultError, match=f"is incomplete: lacks '{name}'"):
        open_result(small_file)


def test_swapped_scales(tmp_path: Path) -> None:
    axis = np.linspace(300.0, 400.0, 4)
    path = write_result(tmp_path / "square.h5", axis, axis)
    with h5py.File(path, "r+") as file:
        item = file["y1_amplitude"]
        for at, name in enumerate(("support_stiffness", "speed")):
            item.dims[at].detach_scale(file[name])
            item.dims[1 - at].attach_scale(file[name])
        for at, name in enumerate(("speed", "support_stiffness")):
            assert item.dims[at][0].name == f"/{name}" or len(item.dims[at]) > 1
    with pytest.raises(ResultError, match=r"expected \(support_stiffness, speed\)"):
        open_result(path)


def test_scale_absent(small_file: Path) -> None:
    with h5py.File(small_file, "r+") as file:
        file["bare"] = np.zeros((3, 5))
    with pytest.raises(ResultError, match="'bare' has a dimension without scale"):
        open_result(small_file)


def test_wrong_unit(small_file: Path) -> None:
    with h5py.File(small_file, "r+") as file:
        file["y1_amplitude"].attrs["units"] = "mm"
    with pytest.raises(ResultError, match="is in 'mm', expected 'm'"):
        open_result(small_file)


def test_speeds_out_of_order(small_file: Path) -> None:
    with h5py.File(small_file, "r+") as file:
        file["speed"][2] = 1.0
    with pytest.raises(ResultError, match="not positive and ascending"):
        open_result(small_file)


def test_infinite_estimate_is_no_damage(small_file: Path) -> None:
    with h5py.File(small_file, "r+") as file:
        file["error_estimate"][0, 1] = np.inf
    assert np.isposinf(open_result(small_file)["error_estimate"].values[0, 1])
    with h5py.File(small_file, "r+") as file:
        file["y1_amplitude"][0, 1] = np.inf
    with pytest.raises(ResultError, match="'y1_amplitude' holds impossible numbers"):
        open_result(small_file)
