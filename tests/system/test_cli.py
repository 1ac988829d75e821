"""The program as users call it: options, exit codes, decks, ranks."""

import re

import numpy as np
import pytest
import xarray

EXIT_COMPLETE, EXIT_DECK = 0, 2


@pytest.fixture(scope="session")
def quick_deck(root):
    """The smallest deck that comes with spurflex."""
    return root / "input" / "quick.nml"


def run_quick(run, deck, folder, ranks):
    """Run the deck in a new folder; return the result file."""
    named = re.search(r"^\s*file\s*=\s*['\"](.+?)['\"]", deck.read_text(), re.MULTILINE)
    (folder / (named[1] if named else "")).parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir(exist_ok=True)
    done = run(deck, ranks=ranks, folder=folder, environment={"SOURCE_DATE_EPOCH": "1500000000"})
    assert done.returncode == EXIT_COMPLETE, done.stdout + done.stderr
    files = list(folder.rglob("*.h5"))
    assert len(files) == 1
    return files[0]


def test_version(run):
    done = run("--version")
    assert done.returncode == EXIT_COMPLETE
    assert re.search(r"\bspurflex\b.*\b\d+\.\d+\.\d+\b", done.stdout)


def test_help(run):
    done = run("--help")
    assert done.returncode == EXIT_COMPLETE
    for option in ["--check", "--version", "--help"]:
        assert option in done.stdout


def test_key_reference_is_current(run, root):
    done = run("--keys")
    assert done.returncode == EXIT_COMPLETE
    assert done.stdout.strip() == (root / "input" / "README.md").read_text().strip()


@pytest.mark.parametrize("ranks", [None, 2])
def test_unknown_option(run, ranks):
    done = run("--frobnicate", ranks=ranks)
    assert done.returncode == EXIT_DECK
    assert "--frobnicate" in done.stderr + done.stdout


def test_no_deck(run):
    assert run().returncode == EXIT_DECK


def test_absent_deck(run):
    done = run("absent.nml")
    assert done.returncode == EXIT_DECK
    assert "absent.nml" in done.stderr + done.stdout


@pytest.mark.parametrize("ranks", [None, 2])
def test_wrong_key(run, quick_deck, tmp_path, ranks):
    deck = tmp_path / "wrong.nml"
    deck.write_text(quick_deck.read_text().replace("speed_first", "sped_first"))
    done = run(deck, ranks=ranks)
    assert done.returncode == EXIT_DECK
    output = done.stderr + done.stdout
    assert output.count("unknown key 'sped_first'") == 1
    assert "speed_first" in output
    assert list(tmp_path.iterdir()) == [deck]


@pytest.mark.parametrize("ranks", [None, 2])
def test_check_prints_and_writes_nothing(run, quick_deck, tmp_path, ranks):
    done = run("--check", quick_deck, ranks=ranks)
    assert done.returncode == EXIT_COMPLETE, done.stdout + done.stderr
    assert done.stdout.count("&sweep") == 1
    assert list(tmp_path.iterdir()) == []


def test_resolved_deck_is_a_deck(run, quick_deck, tmp_path):
    """The deck that --check prints is accepted and resolves to itself."""
    groups = re.compile(r"^&\w+$.*?^/$", re.MULTILINE | re.DOTALL)
    first = "\n".join(groups.findall(run("--check", quick_deck).stdout))
    assert "&sweep" in first
    deck = tmp_path / "resolved.nml"
    deck.write_text(first + "\n")
    done = run("--check", deck)
    assert done.returncode == EXIT_COMPLETE, done.stdout + done.stderr
    assert "\n".join(groups.findall(done.stdout)) == first


def test_ranks_give_identical_files(run, quick_deck, tmp_path):
    files = [run_quick(run, quick_deck, tmp_path / str(ranks), ranks) for ranks in (1, 2, 5)]
    first = files[0].read_bytes()
    assert len(first) > 0
    for file in files[1:]:
        assert file.read_bytes() == first, f"{file.parent.name} ranks"


def test_runs_without_mpirun(run, quick_deck, tmp_path):
    file = run_quick(run, quick_deck, tmp_path / "alone", None)
    assert file.is_file()


def test_missing_folder_is_a_fault_of_the_deck(run, quick_deck, tmp_path):
    deck = tmp_path / "deck.nml"
    deck.write_text(re.sub(r"file *= *'[^']*'", "file = 'absent/map.h5'", quick_deck.read_text()))
    done = run(deck)
    assert done.returncode == 2
    assert "'absent/map.h5'" in done.stderr
    assert "make its folder first, or change file in &output" in done.stderr
    assert not (tmp_path / "absent").exists()


def test_second_run_recognises_complete_file(run, quick_deck, tmp_path):
    file = run_quick(run, quick_deck, tmp_path / "twice", 2)
    before = file.read_bytes()
    done = run(quick_deck, ranks=2, folder=tmp_path / "twice")
    assert done.returncode == EXIT_COMPLETE, done.stdout + done.stderr
    assert file.read_bytes() == before


def test_xarray_opens_with_labelled_axes(run, quick_deck, tmp_path):
    file = run_quick(run, quick_deck, tmp_path / "open", 2)
    with xarray.open_dataset(file, engine="h5netcdf") as data:
        amplitude = data["y1_amplitude"]
        assert amplitude.dims == ("support_stiffness", "speed")
        assert amplitude.attrs["units"] == "m"
        assert amplitude.attrs["long_name"]
        assert data["speed"].attrs["units"] == "rpm"
        assert data["support_stiffness"].attrs["units"] == "N/m"
        assert np.all(np.diff(data["speed"]) > 0)
        assert np.all(np.diff(data["support_stiffness"]) > 0)
        assert np.all(np.isfinite(amplitude) & (amplitude > 0))
