"""The result file, through a test program that writes made-up numbers: labelled axes, identity at
any number of ranks, refusal of files that do not fit, and what is left after a kill."""

import os
import shutil
import subprocess
import time
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray

SPEEDS, STIFFNESSES = 5, 3
COLUMN = 32
"""Speeds of a column in which a file with more of them stores the variables on the grid."""
TITLE = "Prüfung"
DECK_ERROR, MISMATCH = 2, 3
REALS = {
    "y1_amplitude": "m",
    "y1_rms": "m",
    "y1_max": "m",
    "y1_min": "m",
    "bearing1_deformation_max": "m",
    "bearing2_deformation_max": "m",
    "error_estimate": "1",
}
FLAGS = ("motion", "status", "contact", "reason")
COMMON = {*REALS, *FLAGS, "periods_integrated", "checksum"}
ETA = {"eta1", "eta2", "eta_error"}
# What a checksum covers, in its order.
COVERED = (
    "y1_amplitude",
    "y1_rms",
    "y1_max",
    "y1_min",
    "bearing1_deformation_max",
    "bearing2_deformation_max",
    "eta1",
    "eta2",
    "eta_error",
    "error_estimate",
    "motion",
    "periods_integrated",
    "contact",
    "reason",
    "status",
)
RIGID = {f"rigid_{name}" for name in COMMON}
PROVENANCE = {
    "resolved_deck",
    "version",
    "commit",
    "compiler",
    "flags",
    "mpi",
    "hdf5",
    "date",
}


@pytest.fixture(scope="session")
def driver():
    """The test program."""
    path = Path(os.environ.get("SPURFLEX_RESULTS_DRIVER", "results_driver"))
    assert path.is_file(), f"{path} is not built"
    return path


@pytest.fixture
def command(driver, mpiexec):
    """Words of a run: command(mode, ranks=1, support='both', ...)."""

    def words(
        mode, *, ranks=1, support="both", speeds=SPEEDS, stiffnesses=STIFFNESSES, title=TITLE, file="map.h5"
    ):
        grid = [support, str(speeds), str(stiffnesses)]
        return [*mpiexec, str(ranks), str(driver), mode, file, *grid, title]

    return words


@pytest.fixture
def drive(command, tmp_path):
    """Run the test program in an empty folder; expects exit code 0, or the one given."""

    def run_driver(mode, *, code=0, environment=None, **options):
        done = subprocess.run(
            command(mode, **options),
            cwd=tmp_path,
            env={**os.environ, "SOURCE_DATE_EPOCH": "1700000000", **(environment or {})},
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        if code is not None:
            assert done.returncode == code, done.stdout + done.stderr
        return done

    return run_driver


@pytest.mark.parametrize("engine", [None, "h5netcdf"])
def test_axes_are_labelled_and_not_transposed(drive, tmp_path, engine):
    drive("write", ranks=2)
    with xarray.open_dataset(tmp_path / "map.h5", engine=engine) as data:
        assert dict(data.sizes) == {"support_stiffness": STIFFNESSES, "speed": SPEEDS}
        np.testing.assert_array_equal(data.speed, [1000.0, 2000.0, 3000.0, 4000.0, 5000.0])
        np.testing.assert_array_equal(data.support_stiffness, [1e3, 1e5, 1e7])
        assert data.speed.attrs["units"] == "rpm"
        assert data.support_stiffness.attrs["units"] == "N/m"
        assert set(data.data_vars) == COMMON | ETA | RIGID
        for name in COMMON | ETA:
            assert data[name].dims == ("support_stiffness", "speed")
        for name in RIGID:
            assert data[name].dims == ("speed",)

        speed = np.arange(1, SPEEDS + 1)
        place = speed + 1000.0 * np.arange(1, STIFFNESSES + 1)[:, None]
        for prefix, where in (("", place), ("rigid_", 1.0 * speed)):
            np.testing.assert_array_equal(data[f"{prefix}y1_amplitude"], where)
            np.testing.assert_array_equal(data[f"{prefix}y1_rms"], where + 0.125)
            np.testing.assert_array_equal(data[f"{prefix}y1_max"], where + 0.25)
            np.testing.assert_array_equal(data[f"{prefix}y1_min"], -where)
            np.testing.assert_array_equal(data[f"{prefix}bearing1_deformation_max"], where + 0.5)
            np.testing.assert_array_equal(data[f"{prefix}bearing2_deformation_max"], where + 0.625)
            np.testing.assert_array_equal(data[f"{prefix}error_estimate"], 1.0 / where)
            np.testing.assert_array_equal(data[f"{prefix}periods_integrated"], where)
            np.testing.assert_array_equal(data[f"{prefix}motion"], 1 + speed % 8 + 0 * where)
            assert (data[f"{prefix}status"] == 1).all()
            assert (data[f"{prefix}contact"] == 1).all()
            np.testing.assert_array_equal(data[f"{prefix}reason"], 5 * (speed % 2 == 0) + 0 * where)
        np.testing.assert_array_equal(data.eta1, speed + 0 * place)
        np.testing.assert_array_equal(data.eta2, place // 1000)


def test_units_and_flags(drive, tmp_path):
    drive("create")
    with xarray.open_dataset(tmp_path / "map.h5", engine="h5netcdf") as data:
        assert data.attrs["title"] == TITLE
        assert data.attrs["Conventions"] == "CF-1.10"
        assert data.attrs["spurflex_version"]
        for name in data.variables:
            assert data[name].attrs["units"], name
            assert data[name].attrs["long_name"], name
        for prefix in ("", "rigid_"):
            for name, unit in REALS.items():
                assert data[prefix + name].attrs["units"] == unit
                assert data[prefix + name].dtype == np.float64
            for name in FLAGS:
                attributes = data[prefix + name].attrs
                assert data[prefix + name].dtype == np.int32
                assert attributes["flag_values"].dtype == np.int32
                assert len(attributes["flag_values"]) == len(attributes["flag_meanings"].split())
        for name in ETA:
            assert data[name].attrs["units"] == "percent"
        assert list(data.motion.attrs["flag_values"]) == [*range(9), *range(109, 165), 20, 30]


def test_new_file_is_empty(drive, tmp_path):
    drive("create")
    assert [path.name for path in tmp_path.iterdir()] == ["map.h5"]
    with xarray.open_dataset(tmp_path / "map.h5", engine="h5netcdf") as data:
        for name in data.data_vars:
            if data[name].dtype == np.float64:
                assert np.isnan(data[name]).all(), name
            else:
                assert (data[name] == 0).all(), name


@pytest.mark.parametrize(
    ("support", "variables", "axes"),
    [
        ("rigid", RIGID, {"speed"}),
        ("flexible", COMMON, {"speed", "support_stiffness"}),
    ],
)
def test_one_support(drive, tmp_path, support, variables, axes):
    drive("write", ranks=2, support=support)
    with xarray.open_dataset(tmp_path / "map.h5", engine="h5netcdf") as data:
        assert set(data.data_vars) == variables
        assert set(data.sizes) == axes
    drive("verify", ranks=2, support=support)


def test_provenance(drive, tmp_path):
    drive("create")
    with h5py.File(tmp_path / "map.h5") as file:
        provenance = {name: text[()].decode() for name, text in file["provenance"].items()}
    assert set(provenance) == PROVENANCE
    assert all(provenance.values())
    assert provenance["date"] == "2023-11-14T22:13:20Z"
    assert f"  title = '{TITLE}'\n" in provenance["resolved_deck"]
    assert drive("create", environment={"SOURCE_DATE_EPOCH": "now"}, code=DECK_ERROR).stderr


@pytest.mark.parametrize("speeds", [COLUMN, COLUMN + 1, 2 * COLUMN])
def test_layout_survives_a_kill(drive, tmp_path, speeds):
    """In one piece or in columns, unpacked, and all of it on the disk from the start."""
    drive("create", speeds=speeds)
    with h5py.File(tmp_path / "map.h5") as file:
        for dataset in file.values():
            if isinstance(dataset, h5py.Dataset):
                in_columns = dataset.ndim == 2 and speeds > COLUMN
                assert dataset.chunks == ((STIFFNESSES, COLUMN) if in_columns else None)
                properties = dataset.id.get_create_plist()
                assert properties.get_nfilters() == 0
                assert properties.get_alloc_time() == h5py.h5d.ALLOC_TIME_EARLY
                assert dataset.id.get_space_status() == h5py.h5d.SPACE_STATUS_ALLOCATED


def stored_in_one_piece(path):
    """A copy of a result file whose variables are all contiguous takes its place."""
    other = path.with_suffix(".other")
    with h5py.File(path) as file, h5py.File(other, "w") as copy:
        copy.attrs.update(file.attrs)
        file.copy("provenance", copy)
        for name, dataset in file.items():
            if isinstance(dataset, h5py.Dataset):
                copy[name] = dataset[()]
    other.replace(path)


def test_file_without_columns_is_continued(drive, tmp_path):
    """How the numbers are stored is up to the file."""
    size = {"speeds": 70, "stiffnesses": 7}
    assert drive("die", ranks=2, code=None, **size).returncode != 0
    stored_in_one_piece(tmp_path / "map.h5")
    drive("resume", ranks=2, **size)
    drive("verify", ranks=2, **size)
    with h5py.File(tmp_path / "map.h5") as file:
        assert file["status"].chunks is None


def test_flipped_byte_in_a_column_is_found(drive, tmp_path):
    """Wherever it is: each point of a file in columns has its checksum compared."""
    size = {"speeds": 70, "stiffnesses": 7}
    drive("write", **size)
    good = (tmp_path / "map.h5").read_bytes()
    with h5py.File(tmp_path / "map.h5") as file:
        data = file["y1_rms"]
        stored = [data.id.get_chunk_info(i) for i in range(data.id.get_num_chunks())]
    assert [chunk.size for chunk in stored] == [7 * COLUMN * 8] * 3
    for chunk, column, row in zip(stored, (0, COLUMN - 1, 5), (0, 3, 6), strict=True):
        bad = bytearray(good)
        bad[chunk.byte_offset + 8 * (row * COLUMN + column)] ^= 1
        (tmp_path / "map.h5").write_bytes(bad)
        assert "flexible: 1 point was damaged" in drive("resume", ranks=2, **size).stdout
        assert (tmp_path / "map.h5").read_bytes() == good


def test_same_bytes_at_any_number_of_ranks(drive, tmp_path):
    contents = set()
    for ranks in (1, 2, 3):
        # glibc fills fresh memory with this: nothing unset may reach the file.
        drive("write", ranks=ranks, speeds=70, environment={"MALLOC_PERTURB_": str(85 * ranks)})
        contents.add((tmp_path / "map.h5").read_bytes())
        (tmp_path / "map.h5").unlink()
    assert len(contents) == 1


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_kill_between_writes_and_resume(drive, tmp_path, ranks):
    size = {"speeds": 70, "stiffnesses": 7}
    drive("write", **size)
    uninterrupted = (tmp_path / "map.h5").read_bytes()
    (tmp_path / "map.h5").unlink()

    assert drive("die", ranks=ranks, code=None, **size).returncode != 0
    with xarray.open_dataset(tmp_path / "map.h5", engine="h5netcdf") as data:
        done = data.status == 1
        assert done.any()
        assert not done.all()
        assert not np.isnan(data.y1_amplitude.values[done]).any()
        assert np.isnan(data.y1_amplitude.values[~done]).all()
    drive("verify", code=1, **size)
    drive("resume", ranks=ranks, **size)
    drive("verify", ranks=ranks, **size)
    assert (tmp_path / "map.h5").read_bytes() == uninterrupted
    assert [path.name for path in tmp_path.iterdir()] == ["map.h5"]


@pytest.mark.parametrize("support", ["both", "flexible", "rigid"])
def test_checksum_is_the_crc_of_the_other_values(drive, tmp_path, support):
    drive("write", ranks=2, support=support)
    with h5py.File(tmp_path / "map.h5") as file:
        for prefix in ("", "rigid_"):
            if f"{prefix}checksum" not in file:
                continue
            names = [prefix + name for name in COVERED if prefix + name in file]
            checksums = file[f"{prefix}checksum"]
            for point in np.ndindex(checksums.shape):
                values = b"".join(file[name][point].tobytes() for name in names)
                assert np.uint32(checksums[point].view(np.uint32)) == zlib.crc32(values)


@pytest.mark.parametrize("ranks", [1, 3])
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("y1_rms", np.nextafter(3.125, 4.0)),
        ("rigid_y1_max", np.nan),
        ("eta_error", 1.0),
        ("rigid_motion", 77),
        ("status", 3),
        ("status", 77),
        ("reason", 1),
        ("checksum", 0),
    ],
)
def test_damaged_point_is_written_again(drive, tmp_path, name, value, ranks):
    drive("write")
    written = (tmp_path / "map.h5").read_bytes()
    with h5py.File(tmp_path / "map.h5", "r+") as file:
        place = (2,) if name.startswith("rigid") else (1, 2)
        file[name][place] = value
    damaged, sound = ("rigid", "flexible") if name.startswith("rigid") else ("flexible", "rigid")
    done = drive("resume", ranks=ranks)
    assert f"{damaged}: 1 point was damaged (checksum) and is computed again" in done.stdout
    assert f"{sound}: \n" in done.stdout
    assert (tmp_path / "map.h5").read_bytes() == written
    assert "damaged" not in drive("verify", ranks=ranks).stdout


def test_damaged_points_are_missing_at_once(drive, tmp_path):
    """Opening the file is enough: whoever reads it next does not see damaged values."""
    size = {"speeds": 70, "stiffnesses": 7}
    drive("write", **size)
    with h5py.File(tmp_path / "map.h5", "r+") as file:
        file["y1_amplitude"][2:5, 10:20] *= 1.5
        file["rigid_contact"][:] = 2
    done = drive("verify", ranks=3, code=1, **size)
    assert "flexible: 30 points were damaged (checksum) and are computed again" in done.stdout
    assert "rigid: 70 points were damaged" in done.stdout
    with xarray.open_dataset(tmp_path / "map.h5", engine="h5netcdf") as data:
        missing = data.status == 0
        assert missing.sum() == 30
        assert (data.rigid_status == 0).all()
        for name in (*REALS, *ETA):
            assert data[name].isnull().equals(missing), name
        for name in ("checksum", "motion", "contact", "reason", "periods_integrated"):
            assert (data[name].values[missing.values] == 0).all(), name
    drive("resume", ranks=2, **size)
    drive("verify", **size)


def test_another_deck_is_refused(drive, tmp_path):
    drive("write")
    before = (tmp_path / "map.h5").read_bytes()
    done = drive("resume", ranks=2, stiffnesses=STIFFNESSES + 1, title="other", code=MISMATCH)
    for line in (
        f"  file: &case title = '{TITLE}'",
        "  deck: &case title = 'other'",
        f"  file: &sweep stiffness_count = {STIFFNESSES}",
        f"  deck: &sweep stiffness_count = {STIFFNESSES + 1}",
    ):
        assert line in done.stderr.splitlines()
    assert "speed_count" not in done.stderr
    assert (tmp_path / "map.h5").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["map.h5"]


def test_another_version_is_refused(drive, tmp_path):
    drive("create")
    with h5py.File(tmp_path / "map.h5", "r+") as file:
        version = file["provenance/version"][()].decode()
        del file["provenance/version"]
        file["provenance/version"] = np.bytes_("0.0.0")
    done = drive("resume", code=MISMATCH)
    assert "0.0.0" in done.stderr
    assert version in done.stderr


def no_file(path):
    path.unlink()


def no_hdf5(path):
    path.write_text("speed,amplitude\n")


def empty(path):
    path.write_bytes(b"")


def truncated(path):
    path.write_bytes(path.read_bytes()[:-1000])


def half(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def foreign(path):
    with h5py.File(path, "w") as file:
        file["y1_amplitude"] = np.zeros((STIFFNESSES, SPEEDS))


def foreign_provenance(path):
    """The names are there, but hold something else."""
    with h5py.File(path, "w") as file:
        file["provenance/version"] = np.arange(1000.0)
        file["provenance/resolved_deck"] = "a text of variable length"


def lacks_variable(path):
    with h5py.File(path, "r+") as file:
        del file["y1_rms"]


def wrong_extents(path):
    with h5py.File(path, "r+") as file:
        del file["rigid_y1_rms"]
        file["rigid_y1_rms"] = np.zeros(SPEEDS + 1)


@pytest.mark.parametrize(
    ("damage", "word"),
    [
        (no_file, "does not exist"),
        (no_hdf5, "not an HDF5 file"),
        (empty, "not an HDF5 file"),
        (truncated, "truncated"),
        (half, "truncated"),
        (foreign, "not a result file of spurflex"),
        (foreign_provenance, "not a result file of spurflex"),
        (lacks_variable, "y1_rms"),
        (wrong_extents, "rigid_y1_rms"),
    ],
)
def test_unfit_files_are_refused(drive, tmp_path, damage, word):
    path = tmp_path / "map.h5"
    drive("write")
    damage(path)
    before = path.read_bytes() if path.exists() else None
    done = drive("resume", ranks=2, code=MISMATCH)
    assert word in done.stderr
    assert "map.h5" in done.stderr
    assert (path.read_bytes() if path.exists() else None) == before
    assert not (tmp_path / "map.h5.lock").exists()


def test_existing_file_is_not_replaced(drive, tmp_path):
    drive("write")
    before = (tmp_path / "map.h5").read_bytes()
    assert "exists already" in drive("create", code=MISMATCH).stderr
    assert (tmp_path / "map.h5").read_bytes() == before


def test_left_over_part_is_replaced(drive, tmp_path):
    (tmp_path / "map.h5.part").write_bytes(b"\x89HDF\r\n\x1a\nhalf a file")
    drive("write")
    drive("verify")
    assert [path.name for path in tmp_path.iterdir()] == ["map.h5"]


def test_missing_folder(drive):
    done = drive("create", ranks=2, file="nowhere/map.h5", code=1)
    assert "No such file or directory" in done.stderr


def test_two_runs_on_one_file(drive, command, tmp_path):
    drive("create")
    shutil.move(tmp_path / "map.h5", tmp_path / "spare.h5")
    with subprocess.Popen(command("hold", ranks=2), cwd=tmp_path) as holder:
        try:
            deadline = time.monotonic() + 60
            while not (tmp_path / "map.h5").exists():
                assert time.monotonic() < deadline
                assert holder.poll() is None
                time.sleep(0.05)
            for mode in ("resume", "create"):
                done = drive(mode, ranks=2, code=MISMATCH)
                assert "another run (process " in done.stderr
        finally:
            (tmp_path / "map.h5.go").touch()
            assert holder.wait(60) == 0
    drive("resume")
    assert not (tmp_path / "map.h5.lock").exists()


def test_lock_of_a_killed_run_is_free(drive, tmp_path):
    size = {"speeds": 70, "stiffnesses": 7}
    drive("die", code=None, **size)
    assert (tmp_path / "map.h5.lock").exists()
    drive("resume", **size)
    assert not (tmp_path / "map.h5.lock").exists()
