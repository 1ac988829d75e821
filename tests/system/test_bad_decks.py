"""Faulty decks: every fault is named at once, with its line, and nothing is written.

The decks are data: bad_decks/faults.toml patches bad_decks/good.nml.
"""

import tomllib
from pathlib import Path

import pytest

EXIT_COMPLETE, EXIT_DECK = 0, 2
MOST_SHOWN = 50
MOST_BYTES = 1048576

FOLDER = Path(__file__).parent / "bad_decks"
GOOD = (FOLDER / "good.nml").read_text()
DECKS = tomllib.loads((FOLDER / "faults.toml").read_text())["deck"]


def patched(deck):
    """The bytes of a faulty deck."""
    text = GOOD
    for search, replacement in deck.get("replace", []):
        assert text.count(search) == 1, f"{search!r} must stand once in good.nml"
        text = text.replace(search, replacement)
    return (text + deck.get("append", "")).encode(deck.get("encoding", "utf-8"))


def fault_lines(output):
    """The lines of a message that name a fault of deck.nml."""
    return [line for line in output.splitlines() if "deck.nml:" in line]


@pytest.fixture
def check_deck(run, tmp_path):
    """Check a faulty deck: exit code 2, no new file; return the lines of the message."""

    def check(content):
        (tmp_path / "deck.nml").write_bytes(content)
        done = run("deck.nml", "--check")
        assert done.returncode == EXIT_DECK, done.stdout + done.stderr
        assert [path.name for path in tmp_path.iterdir()] == ["deck.nml"]
        assert (tmp_path / "deck.nml").read_bytes() == content
        return fault_lines(done.stderr)

    return check


def test_good_deck_passes(run, tmp_path):
    (tmp_path / "deck.nml").write_text(GOOD)
    done = run("deck.nml", "--check")
    assert done.returncode == EXIT_COMPLETE, done.stderr
    assert "deck.nml:" not in done.stderr


@pytest.mark.parametrize("deck", DECKS, ids=[deck["name"] for deck in DECKS])
def test_faulty_deck(check_deck, deck):
    lines = check_deck(patched(deck))
    for fragments in deck["faults"]:
        assert any(all(fragment in line for fragment in fragments) for line in lines), lines
    assert len(lines) == len(deck["faults"]), lines


def test_names_are_unique():
    names = [deck["name"] for deck in DECKS]
    assert len(names) == len(set(names))


@pytest.mark.parametrize(
    ("content", "fragment"),
    [
        (b"", "empty"),
        (b"\xef\xbb\xbf \t\r\n", "empty"),
        (GOOD.encode("utf-16"), "not plain text"),
        (GOOD.encode() + b"!" * MOST_BYTES, f"at most {MOST_BYTES}"),
    ],
    ids=["empty", "blank", "utf-16", "too large"],
)
def test_unusable_file(check_deck, content, fragment):
    lines = check_deck(content)
    assert len(lines) == 1
    assert fragment in lines[0]


def test_many_faults_are_cut_short(check_deck):
    unknown = "".join(f"  zzzz_{i} = {i}\n" for i in range(200))
    lines = check_deck(GOOD.replace("&case\n", "&case\n" + unknown).encode())
    assert len(lines) == MOST_SHOWN + 1
    assert "and 150 more" in lines[-1]


def test_absent_deck(run, tmp_path):
    done = run("deck.nml", "--check")
    assert done.returncode == EXIT_DECK
    assert "deck.nml: no such deck" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_folder_for_a_deck(run, tmp_path):
    (tmp_path / "deck.nml").mkdir()
    done = run("deck.nml", "--check")
    assert done.returncode == EXIT_DECK
    assert len(fault_lines(done.stderr)) == 1
