"""Wrong command lines: a message and exit code 2 whatever is written, nothing written, nothing hangs."""

import random

import pytest

EXIT_COMPLETE, EXIT_DECK = 0, 2
LONGEST_OUTPUT = 20000
SEED = 20

REFUSED = {
    "nothing": [],
    "empty": [""],
    "blank": [" "],
    "dash": ["-"],
    "two dashes": ["--"],
    "dashes": ["---"],
    "no deck to check": ["--check"],
    "no deck to run": ["--fresh"],
    "a value": ["--check=1", "quick.nml"],
    "one letter more": ["--checks", "quick.nml"],
    "capitals": ["--CHECK", "quick.nml"],
    "one dash": ["-check", "quick.nml"],
    "unknown behind the deck": ["quick.nml", "--chek"],
    "two decks": ["--check", "quick.nml", "quick.nml"],
    "absent": ["--check", "absent.nml"],
    "folder": ["--check", "."],
    "root": ["--check", "/"],
    "no file": ["--check", "/dev/null"],
    "file as a folder": ["--check", "quick.nml/"],
    "in a file": ["--check", "quick.nml/quick.nml"],
    "the program itself": ["--check", "/proc/self/exe"],
    "options in one word": ["--check quick.nml"],
    "blank behind": ["--check", "quick.nml "],
    "newline": ["--check", "quick\nnml"],
    "terminal codes": ["--\x1b[2J\x1b]0;x\x07"],
    "control characters of Unicode": ["--check", "a\u009b31mb.nml"],
    "not UTF-8": ["--\udcff\udcfe\udcc3"],
    "deck that is not UTF-8": ["--check", "\udcff\udcc0\udcaf.nml"],
    "long option": ["--" + "x" * 100_000],
    "long deck": ["--check", "x" * 100_000],
    "long path": ["--check", "a/" * 3000 + "x.nml"],
    "shell": ["--check", "$(touch made);`touch made`|touch made"],
    "many": ["--check"] * 2000 + ["--x"],
}
WORDS = [
    "--check",
    "--fresh",
    "--help",
    "-h",
    "--version",
    "--keys",
    "",
    "-",
    "--",
    "-x",
    "--n=3",
    "absent.nml",
    ".",
]


def is_printable(text):
    """Whether a text holds nothing that a terminal would obey but line ends."""
    return all(letter == "\n" or letter.isprintable() for letter in text)


@pytest.fixture
def refused(run, root, tmp_path):
    """Run the program in a folder with a good deck; return it after the promises that always hold."""
    deck = tmp_path / "quick.nml"
    deck.write_bytes((root / "input" / "quick.nml").read_bytes())

    def call(arguments, codes):
        done = run(*arguments, timeout=60)
        assert done.returncode in codes, done.stdout + done.stderr
        assert len(done.stdout + done.stderr) < LONGEST_OUTPUT
        assert is_printable(done.stderr), repr(done.stderr)
        assert "runtime error" not in done.stderr
        assert [path.name for path in tmp_path.iterdir()] == ["quick.nml"]
        return done

    return call


@pytest.mark.parametrize("arguments", REFUSED.values(), ids=REFUSED)
def test_refused(refused, arguments):
    done = refused(arguments, [EXIT_DECK])
    assert done.stdout == ""
    assert done.stderr.strip()


@pytest.mark.parametrize("number", range(12))
def test_any_words(refused, number):
    """Options in any order and number, without a deck that exists."""
    words = random.Random(SEED + number)
    arguments = words.choices(WORDS, k=words.randint(1, 8))
    done = refused(arguments, [EXIT_COMPLETE, EXIT_DECK])
    assert (done.returncode == EXIT_DECK) == (done.stderr != "")
