"""What a deck asks to be recorded of each point: spectra, Poincare sections, histories; checksums of
all of it, and the reasons of points that fail."""

import os
import re
import subprocess
import time
import zlib

import h5py
import numpy as np
import pytest
import xarray

EXIT_COMPLETE, EXIT_FAILED_POINTS = 0, 4
EPOCH = {"SOURCE_DATE_EPOCH": "1500000000"}
QUANTITIES = ("mesh_force", "y1", "xm")
RIGID_QUANTITIES = ("mesh_force", "y1")
UNITS = {"y1": "m", "xm": "m", "mesh_force": "N"}
LINES, SECTIONS, SAMPLES = 49, 6, 2 * 32 + 1
# What a checksum covers behind the records, in its order.
POINT = (
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


def write_deck(root, folder, products, **changes):
    """A deck of a few points with products."""
    text = (root / "input" / "quick.nml").read_text()
    changes = {"speed_count": 7, "stiffness_count": 2, "file": "'map.h5'", **changes}
    for key, value in changes.items():
        text, found = re.subn(rf"^(\s*{key}\s*=).*$", rf"\1 {value}", text, flags=re.MULTILINE)
        assert found == 1, key
    text = re.sub(r"(file = .*)", rf"\1\n{products}", text)
    folder.mkdir(exist_ok=True)
    path = folder / "map.nml"
    path.write_text(text)
    return path


@pytest.fixture
def deck(root, tmp_path):
    """Three products of three quantities, on both supports."""
    return write_deck(
        root,
        tmp_path,
        """   products = 'spectrum', 'poincare', 'history'
   quantities = 'mesh_force', 'y1', 'xm'
   highest_order = 2.0, spectrum_periods = 24, sections = 6, history_periods = 2, history_samples = 32""",
    )


def run_deck(run, deck, folder, *, code=EXIT_COMPLETE, **options):
    """Run a deck in a folder; return the result file and what was said."""
    folder.mkdir(exist_ok=True)
    done = run(deck, folder=folder, environment=EPOCH, **options)
    assert done.returncode == code, done.stdout + done.stderr
    return folder / "map.h5", done.stdout


def covered(file, prefix):
    """Names of the datasets that the checksums of one support cover, in their order."""
    quantities = RIGID_QUANTITIES if prefix else QUANTITIES
    names = []
    for kind in ("spectrum", "poincare"):
        for quantity in quantities:
            name = prefix + (kind if quantity == "y1" else f"{kind}_{quantity}")
            names += [name, f"{name}_rate"] if kind == "poincare" else [name]
    for quantity in quantities:
        names += [f"history/{prefix}{quantity}", f"history/{prefix}{quantity}_rate"]
    return names + [prefix + name for name in POINT if prefix + name in file]


def test_records_are_labelled(run, deck, tmp_path):
    path, said = run_deck(run, deck, tmp_path / "a", ranks=2)
    assert "recorded of each point: mesh_force y1 xm" in said
    assert "which no product asks for" in said
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert dict(data.sizes) == {
            "support_stiffness": 2,
            "speed": 7,
            "order": LINES,
            "section": SECTIONS,
        }
        np.testing.assert_allclose(data.order, np.arange(LINES) / 24, rtol=1e-15)
        np.testing.assert_array_equal(data.section, np.arange(1, SECTIONS + 1))
        for prefix, grid in (("", ("support_stiffness", "speed")), ("rigid_", ("speed",))):
            for quantity in RIGID_QUANTITIES if prefix else QUANTITIES:
                ending = "" if quantity == "y1" else f"_{quantity}"
                unit = UNITS[quantity]
                for name, axis, units in (
                    (f"spectrum{ending}", "order", unit),
                    (f"poincare{ending}", "section", unit),
                    (f"poincare{ending}_rate", "section", f"{unit}/s"),
                ):
                    variable = data[prefix + name]
                    assert variable.dims == (*grid, axis)
                    assert variable.attrs["units"] == units
                    assert variable.attrs["long_name"]
                    assert not variable.isnull().any(), name
        assert "rigid_spectrum_xm" not in data
        assert data.spectrum.attrs["resolution"] == pytest.approx(1 / 24, rel=1e-15)
        assert "Hann" in data.rigid_spectrum.attrs["window"]


def test_histories_are_a_group_with_coordinates(run, deck, tmp_path):
    path, _ = run_deck(run, deck, tmp_path / "a")
    with xarray.open_dataset(path, group="history", engine="h5netcdf") as data:
        assert dict(data.sizes) == {"support_stiffness": 2, "speed": 7, "mesh_time": SAMPLES}
        np.testing.assert_allclose(data.mesh_time, np.arange(SAMPLES) / 32, rtol=1e-15)
        with xarray.open_dataset(path, engine="h5netcdf") as root:
            assert data.speed.equals(root.speed)
            assert data.support_stiffness.equals(root.support_stiffness)
        names = {f"{q}{rate}" for q in QUANTITIES for rate in ("", "_rate")}
        names |= {f"rigid_{q}{rate}" for q in RIGID_QUANTITIES for rate in ("", "_rate")}
        assert set(data.data_vars) == names
        for name in names:
            grid = ("speed",) if name.startswith("rigid") else ("support_stiffness", "speed")
            assert data[name].dims == (*grid, "mesh_time")
            assert not data[name].isnull().any(), name
        assert data.mesh_force_rate.attrs["units"] == "N/s"


def test_records_agree_with_the_map(run, deck, tmp_path):
    """Total displacements that begin at the first section, within what 32 samples show of extremes."""
    path, _ = run_deck(run, deck, tmp_path / "a")
    with (
        xarray.open_dataset(path, engine="h5netcdf") as data,
        xarray.open_dataset(path, group="history", engine="h5netcdf") as history,
    ):
        for prefix in ("", "rigid_"):
            short = (data[f"{prefix}motion"] == 1).values
            assert short.any()
            y1 = history[f"{prefix}y1"].values[short]
            largest, smallest, amplitude = (
                data[prefix + name].values[short] for name in ("y1_max", "y1_min", "y1_amplitude")
            )
            assert (np.abs(y1.max(-1) - largest) < 0.05 * amplitude).all()
            assert (np.abs(y1.min(-1) - smallest) < 0.05 * amplitude).all()
            sections = data[f"{prefix}poincare"].values[short]
            size = amplitude[:, None]
            assert (np.abs(sections - y1[:, :1]) < 1e-6 * size).all()
            rates = data[f"{prefix}poincare_rate"].values[short]
            first_rates = history[f"{prefix}y1_rate"].values[short][:, :1]
            np.testing.assert_allclose(rates, first_rates + 0 * rates, rtol=1e-6, atol=1e-9)
            # One period repeats: only whole orders, the mean first.
            spectrum = data[f"{prefix}spectrum"].values[short]
            others = np.arange(LINES) % 24 != 0
            assert (np.abs(spectrum[:, others]) < 1e-6 * size).all()
            assert (np.abs(spectrum[:, 0] - np.abs(y1[:, :-1].mean(-1))) < 0.01 * amplitude).all()


@pytest.mark.parametrize("start", ["'static'", "'down'"])
def test_same_bytes_at_any_number_of_ranks(run, root, tmp_path, start):
    deck = write_deck(
        root,
        tmp_path,
        "   products = 'spectrum' 'poincare' 'history', sections = 9, history_samples = 16",
        start=start,
        stiffness_count=5,
    )
    contents = {run_deck(run, deck, tmp_path / str(n), ranks=n)[0].read_bytes() for n in (1, 2, 3)}
    assert len(contents) == 1


def test_checksum_covers_the_records(run, deck, tmp_path):
    path, _ = run_deck(run, deck, tmp_path / "a")
    with h5py.File(path) as file:
        for prefix in ("", "rigid_"):
            checksums = file[f"{prefix}checksum"]
            for point in np.ndindex(checksums.shape):
                values = b"".join(file[name][point].tobytes() for name in covered(file, prefix))
                assert checksums[point].view(np.uint32) == zlib.crc32(values)


@pytest.mark.parametrize("ranks", [1, 3])
def test_damaged_points_are_computed_again(run, deck, tmp_path, ranks):
    path, _ = run_deck(run, deck, tmp_path / "a")
    whole = path.read_bytes()
    with h5py.File(path, "r+") as file:
        line = file["spectrum_xm"][0, 1, 24]
        assert line > 0.0
        file["spectrum_xm"][0, 1, 24] = np.nextafter(line, 0.0)
        file["history/y1_rate"][1, 3, -1] = np.nan
        file["eta1"][1, 4] += 1.0
        # A twin whose deformation many points are compared with.
        file["rigid_bearing1_deformation_max"][6] *= 0.5
    assert path.read_bytes() != whole
    path, said = run_deck(run, deck, tmp_path / "a", ranks=ranks)
    assert "3 points were damaged (checksum) and are computed again" in said
    assert "1 point was damaged (checksum) and is computed again" in said
    assert path.read_bytes() == whole
    assert "(checksum)" not in run_deck(run, deck, tmp_path / "a", ranks=ranks)[1]


def test_products_not_asked_for_leave_nothing(run, root, tmp_path):
    deck = write_deck(root, tmp_path, "   products = 'map', quantities = 'x1', 'xm'")
    path, said = run_deck(run, deck, tmp_path / "a")
    assert "skipped: spectrum, Poincare section, history, which no product asks for" in said
    with h5py.File(path) as file:
        assert not {"order", "section", "history"} & set(file)
        assert not [name for name in file if "spectrum" in name or "poincare" in name]
    path, _ = run_deck(run, write_deck(root, tmp_path, "   products = 'poincare'"), tmp_path / "b")
    with h5py.File(path) as file:
        assert not {"order", "history"} & set(file)
        assert {"section", "poincare", "poincare_rate", "rigid_poincare"} <= set(file)


def test_failed_points_have_a_reason(run, root, tmp_path):
    """Without damping and backlash the mesh stiffness drives parametric resonances without bound."""
    deck = write_deck(
        root,
        tmp_path,
        "   products = 'spectrum', 'history', spectrum_periods = 8, history_samples = 8",
        damping_1="0.0",
        damping_2="0.0",
        damping="0.0",
        half_backlash="0.0",
        stiffness_coefficients="0.9",
        speed_first=4200.0,
        speed_last=4900.0,
        speed_count=8,
        stiffness_count=2,
        max_periods=500,
    )
    sound = write_deck(root, tmp_path / "a", "")
    with h5py.File(run_deck(run, sound, tmp_path / "a")[0]) as file:
        if b"-ffpe-trap" in file["provenance/flags"][()]:
            pytest.skip("this build stops at the first infinity")
    path, said = run_deck(run, deck, tmp_path / "b", code=EXIT_FAILED_POINTS)
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        words = dict(
            zip(data.reason.attrs["flag_values"], data.reason.attrs["flag_meanings"].split(), strict=True)
        )
        failed = 0
        for prefix in ("", "rigid_"):
            diverged = data[f"{prefix}status"].values == 3
            failed += diverged.sum()
            assert diverged.any()
            reasons = data[f"{prefix}reason"].values
            assert {words[reason] for reason in reasons[diverged]} == {"non_finite"}
            assert (reasons[data[f"{prefix}status"].values == 1] == 0).all()
            assert (reasons[data[f"{prefix}status"].values != 1] != 0).all()
            assert np.isnan(data[f"{prefix}spectrum"].values[diverged]).all()
        speed = float(data.speed[np.flatnonzero(data.rigid_status == 3)[0]])
    lines = said.splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith(f"{failed} points failed"))
    assert lines[at + 1] == (f"  rigid support, {speed} rev/min: the state became infinite or not a number")
    # Nothing is computed again, and the failures are told again.
    again = run_deck(run, deck, tmp_path / "b", code=EXIT_FAILED_POINTS)[1]
    assert f"{failed} points failed" in again


@pytest.mark.parametrize("after", [0.0, 0.4])
def test_kill_while_recording_and_go_on(run, program, mpiexec, root, tmp_path, after):
    """Records come before their point: a kill leaves points that are there as a whole, or missing."""
    deck = write_deck(
        root,
        tmp_path,
        "   products = 'spectrum' 'poincare' 'history', quantities = 'y1' 'x1' 'mesh_force'",
        speed_count=31,
        stiffness_count=12,
    )
    whole, _ = run_deck(run, deck, tmp_path / "whole", ranks=2)
    folder = tmp_path / "killed"
    folder.mkdir()
    with subprocess.Popen(
        [*mpiexec, "2", str(program), str(deck)],
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
        job.kill()
    # The ranks notice that mpirun is gone a moment later.
    deadline = time.monotonic() + 60
    while True:
        done = run(deck, ranks=3, folder=folder, environment=EPOCH)
        if done.returncode == EXIT_COMPLETE or time.monotonic() > deadline:
            break
        time.sleep(0.5)
    assert done.returncode == EXIT_COMPLETE, done.stderr
    assert "(checksum)" not in done.stdout
    assert (folder / "map.h5").read_bytes() == whole.read_bytes()


@pytest.mark.parametrize(
    ("changes", "added", "status", "word", "sentence"),
    [
        (
            {"integrator": "'newmark'", "tolerance": "1.0e-9"},
            "   steps_per_period = 32\n",
            4,
            "given_steps",
            "steps_per_period misses the tolerance",
        ),
        (
            {"damping": "1.0", "damping_1": "1.0", "damping_2": "1.0", "max_periods": "16"},
            "",
            2,
            "max_periods",
            "no class of motion could be told within max_periods",
        ),
    ],
)
def test_points_less_than_settled_have_a_reason(run, root, tmp_path, changes, added, status, word, sentence):
    deck = write_deck(root, tmp_path, "", support="'rigid'", **changes)
    deck.write_text(deck.read_text().replace("&solver\n", f"&solver\n{added}"))
    path, said = run_deck(run, deck, tmp_path / "a")
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        flags = data.rigid_reason.attrs["flag_meanings"].split()
        those = (data.rigid_status == status).values
        assert those.any()
        assert {flags[reason] for reason in data.rigid_reason.values[those]} == {word}
        assert f"{those.sum()} not settled or less accurate than asked for: {sentence}" in said
