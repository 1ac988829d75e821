"""The table of published against computed features."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from result_files import write_result

from spurflex_postproc import open_result
from spurflex_postproc.markdown import table
from spurflex_postproc.published import (
    published_areas,
    published_points,
    published_regimes,
    tolerance,
)
from spurflex_postproc.published_table.bearing import rank_correlation
from spurflex_postproc.published_table.cli import main
from spurflex_postproc.published_table.curves import curve_rows
from spurflex_postproc.published_table.explain import explained
from spurflex_postproc.published_table.regimes import point_rows, regime_rows
from spurflex_postproc.published_table.row import number, statement
from spurflex_postproc.published_table.sources import Trial, difference, kind, load

SPEED = np.linspace(300.0, 6000.0, 571)
BAND = (4650.0, 4990.0)


def curves(path: Path, start: str, **deck: object) -> Path:
    """Write a result of figure 2 with a resolved deck."""
    write_result(path, SPEED, np.array([2.5e8]), irregular=BAND)
    lines = [f"  start = '{start}'", *(f"  {key} = {value}" for key, value in deck.items())]
    with h5py.File(path, "r+") as file:
        file["provenance"]["resolved_deck"] = "&sweep\n" + "\n".join(lines) + "\n/\n"
        file.attrs["title"] = f"title of {path.stem}"
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Result files as scripts/reproduce makes them, with data made up."""
    curves(tmp_path / "figure2.h5", "static")
    curves(tmp_path / "figure2-up.h5", "up")
    curves(tmp_path / "figure2-newmark.h5", "up", steps_per_period=16)
    path = write_result(tmp_path / "figure9.h5", SPEED[::3], np.logspace(6, 12, 41))
    with h5py.File(path, "r+") as file:
        file["eta1"][...] = np.where(file["speed"][:] > 1500, 5.0, -5.0)
    return tmp_path


def test_rows_of_curves(folder: Path) -> None:
    rows = {row.key: row for row in curve_rows(open_result(folder / "figure2-up.h5"))}
    assert rows["figure 2 rigid peak 1180"].agrees
    assert rows["figure 2 rigid jump 3140"].computed == 3145.0
    assert rows["figure 2 rigid jump 5290"].agrees is False
    assert rows["figure 2 flexible extra peak"].agrees
    assert rows["figure 2 shift"].agrees
    assert "contact kept" in rows["figure 2 rigid jump 3140"].note


def test_rows_of_regimes(folder: Path) -> None:
    rows = {row.key: row for row in regime_rows(open_result(folder / "figure2-up.h5"))}
    border = rows["figure 3 rigid 1T to chaotic 4640"]
    assert (border.computed, border.agrees) == (4645.0, True)
    assert rows["figure 3 rigid 1T to 2T 5460"].agrees is False
    assert rows["figure 3 rigid chaos"].agrees
    assert rows["figure 3 flexible order"].agrees is False


def test_rows_of_points(folder: Path) -> None:
    result = open_result(folder / "figure2-up.h5")
    rows = {row.key: row for row in point_rows(result, [])}
    assert rows["figure 4 motion"].agrees
    assert rows["figure 5 motion"].agrees
    assert rows["figure 8 motion"].agrees is False
    assert rows["figure 6 orders"].agrees is None


def test_rows_of_spectra(folder: Path) -> None:
    path = folder / "figure6.h5"
    write_result(path, np.array([5290.0, 5300.0]), np.array([2.5e8]))
    order = np.arange(0, 10) / 3
    lines = np.array([0, 0.2, 1, 0.5, 0.3, 0.2, 0.3, 0, 0.2, 0])
    with h5py.File(path, "r+") as file:
        scale = file.create_dataset("order", data=order)
        scale.make_scale("order")
        data = file.create_dataset("spectrum", data=np.array([[np.zeros(10), lines]]) * 1e-6)
        for at, name in enumerate(("support_stiffness", "speed", "order")):
            data.dims[at].attach_scale(file[name])
    sources = load(folder)
    rows = {row.key: row for row in point_rows(sources.reference, sources.spectra)}
    assert rows["figure 6 dominant"].agrees
    assert rows["figure 6 orders"].agrees
    assert rows["figure 7 orders"].agrees is None


def test_command(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "table"
    assert main([str(folder), "--output", str(out)]) == 0
    content = json.loads((out / "published.json").read_text())
    figures = {row["figure"] for row in content["rows"]}
    assert figures == {*"23456789", "10a", "10b", "10c"}
    assert len(content["conclusions"]) == 4
    assert sum(content["counts"].values()) == len(content["rows"])
    assert all(row["explanation"] for row in content["rows"] if row["agrees"] is False) is False
    text = (out / "published.md").read_text()
    assert "## Disagreements" in text
    assert "steps_per_period = 16" in text
    shown = capsys.readouterr().out
    assert "| all figures |" in shown and "| all figures |" in text


def test_command_without_map(folder: Path) -> None:
    (folder / "figure9.h5").unlink()
    assert main([str(folder)]) == 0
    assert json.loads((folder / "published.json").read_text())["conclusions"] == []


def test_command_without_reference(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path)]) == 2
    assert "figure2-up.h5: no such file" in capsys.readouterr().err


def test_differences_of_decks() -> None:
    assert difference({}) == "the same deck"
    assert difference({"damping_1": "9", "start": "'up'"}) == "start = 'up', damping_1 = 9"
    assert difference(dict.fromkeys("abcd", "1"), "title") == "title"
    assert kind({"start": "x"}) == "start"
    assert kind({"start": "x", "integrator": "y"}) == "step"
    assert kind({"start": "x", "damping": "y"}) == "parameter"


def test_explanations(folder: Path) -> None:
    result = open_result(folder / "figure2-up.h5")

    def rows(value: float | None) -> list:
        return [
            number("n", "2", "f", 1000.0, value, 0.01),
            statement("s", "2", "f", "yes", "no", value == 1000.0),
        ]

    trials = [
        (Trial("damping = 1", "parameter", result), rows(1000.0)),
        (Trial("start = 'rest'", "start", result), rows(1005.0)),
    ]
    first, second = explained(rows(1100.0), trials, {"s": "known"})
    assert first.explanation == "the start decides: start = 'rest' gives 1005 (+0.5 %)"
    assert second.explanation == "a parameter decides: damping = 1 gives no; known"
    (alone, _) = explained(rows(None), [(trials[0][0], rows(1050.0))], {})
    assert "nearest of 1 other settings" in alone.explanation
    (far, _) = explained(rows(1020.0), [(trials[0][0], rows(1050.0))], {})
    assert far.explanation == "no nearer with any of 1 other settings"


def test_rank_correlation() -> None:
    one = np.array([1.0, 2.0, np.nan, 4.0])
    assert rank_correlation(one, np.exp(one)) == pytest.approx(1)
    assert rank_correlation(one, -one) == pytest.approx(-1)


def test_published_statements() -> None:
    for support in ("rigid", "flexible"):
        regimes = published_regimes(support)
        assert [one[2] for one in regimes[:-1]] == [one[1] for one in regimes[1:]]
    assert [point.speed for point in published_points()] == [1500, 4900, 5300, 5500, 5900]
    assert published_areas()[0]["D"] == "+"
    assert tolerance("peak") == 0.01


def test_markdown_table() -> None:
    assert table(["a"], [["b|c"]]) == "| a |\n| --- |\n| b\\|c |\n"
    with pytest.raises(ValueError, match="cells"):
        table(["a"], [["b", "c"]])
