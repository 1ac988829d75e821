"""The table of published against computed features."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from result_files import add_recordings, write_result

from spurflex_postproc import open_result
from spurflex_postproc.markdown import table
from spurflex_postproc.published import (
    PAPER_STIFFNESS,
    published_areas,
    published_points,
    published_regimes,
    tolerance,
)
from spurflex_postproc.published_table.bearing import rank_correlation
from spurflex_postproc.published_table.cli import build, main
from spurflex_postproc.published_table.curves import curve_rows
from spurflex_postproc.published_table.explain import explained
from spurflex_postproc.published_table.regimes import point_rows, regime_rows
from spurflex_postproc.published_table.row import number, statement
from spurflex_postproc.published_table.sources import Trial, difference, kind, load

SPEED = np.linspace(300.0, 6000.0, 571)
BAND = (4650.0, 4990.0)


def curves(path: Path, start: str, **deck: object) -> Path:
    """Write a result of figure 2 with a resolved deck."""
    write_result(path, SPEED, np.array([PAPER_STIFFNESS]), irregular=BAND)
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
    rows = {row.key: row for row in point_rows([result])}
    assert rows["figure 4 motion"].agrees
    assert rows["figure 5 motion"].agrees
    assert rows["figure 8 motion"].agrees is False
    assert rows["figure 6 orders"].agrees is None
    assert [row.key for row in point_rows([result], complete=False)] == [
        f"figure {number} motion" for number in "45678"
    ]
    assert all(row.agrees is None for row in point_rows([]))


def point(path: Path, start: str, speed: float, flag: int) -> Path:
    """Write a result of one of the figures 4 to 8 with a spectrum."""
    write_result(path, np.array([speed]), np.array([PAPER_STIFFNESS]), support="flexible")
    with h5py.File(path, "r+") as file:
        file["motion"][...] = flag
        file["provenance"]["resolved_deck"] = f"&sweep\n  start = '{start}'\n/\n"
    return add_recordings(path)


def test_rows_of_spectra(folder: Path) -> None:
    point(folder / "figure6.h5", "up", 5300.0, 3)
    sources = load(folder)
    rows = {row.key: row for row in point_rows([*sources.points, sources.reference])}
    assert rows["figure 6 motion"].agrees
    dominant = rows["figure 6 dominant"]
    assert dominant.computed == pytest.approx(1.0)
    assert dominant.agrees is False
    assert dominant.note == "0.6667: 25.0 %"
    # The made-up motion has no line at 8/3.
    orders = rows["figure 6 orders"]
    assert orders.agrees is False
    assert orders.met == pytest.approx(5 / 6)
    assert orders.note.startswith("lacking 2.667; 0.3333: 50.0 %; 1: 100.0 %")
    assert rows["figure 7 orders"].agrees is None


def test_note_says_where_the_published_order_is_the_strongest(folder: Path) -> None:
    point(folder / "figure8.h5", "up", 5900.0, 2)
    sweep = write_result(
        folder / "sweep.h5", np.array([5500.0, 5600.0, 5700.0]), np.array([PAPER_STIFFNESS])
    )
    with h5py.File(sweep, "r+") as file:
        file["motion"][...] = [[1, 2, 2]]
    add_recordings(sweep)
    for path, height in ((folder / "figure8.h5", 9.0), (sweep, 0.0)):
        with h5py.File(path, "r+") as file:
            half = int(np.argmin(np.abs(file["order"][:] - 0.5)))
            file["spectrum"][..., half] = height
            if path == sweep:
                file["spectrum"][0, 2, half] = 9.0
    results = load(folder).points
    rows = {row.key: row for row in point_rows(results, sweeps=[open_result(sweep)])}
    # Only at 5600 rev/min is the motion 2T and its strongest order 1.
    assert rows["figure 8 dominant"].note.endswith(
        "strongest from 5600 to 5600 of the 2T motions from 5600 to 5700"
    )
    assert "strongest" not in {r.key: r for r in point_rows(results)}["figure 8 dominant"].note


def test_combinations_of_two_frequencies_are_told(folder: Path) -> None:
    point(folder / "figure5.h5", "up", 4900.0, 20)
    rows = {row.key: row for row in point_rows(load(folder).points, complete=False)}
    assert rows["figure 5 motion"].computed == "quasi-periodic"
    assert rows["figure 5 motion"].met == 0.5
    assert "combinations of 1 and 0.370" in rows["figure 5 orders"].note
    assert set(rows) == {f"figure 5 {name}" for name in ("motion", "dominant", "orders")}


def test_points_with_other_settings_are_evidence(folder: Path) -> None:
    point(folder / "figure8.h5", "up", 5900.0, 1)
    point(folder / "figure8-rest.h5", "rest", 5900.0, 2)
    point(folder / "figure8-static.h5", "static", 5900.0, 2)
    sources = load(folder)
    # The start 'static' is among the curves already.
    assert [trial.label for trial in sources.point_trials] == ["start = 'rest'"]
    rows, _, settings = build(sources)
    found = {row.key: row for row in rows}
    assert found["figure 8 motion"].explanation == ("with another start: start = 'rest' gives 2T")
    assert "nearest: start = 'rest' gives" in found["figure 8 orders"].explanation
    assert "lacking 3" in found["figure 8 orders"].explanation
    label, kind_, some = settings[-1]
    assert (label, kind_, len(some)) == ("start = 'rest'", "start", 3)


def test_figure_3_stands_for_figure_2_with_the_same_settings(folder: Path) -> None:
    curves(folder / "figure3.h5", "static")
    sources = load(folder)
    assert [trial.label for trial in sources.trials].count("start = 'static'") == 1
    assert sources.curves["static"].attrs["path"].endswith("figure3.h5")


def test_command(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "table"
    assert main([str(folder), "--output", str(out)]) == 0
    content = json.loads((out / "published.json").read_text())
    figures = {row["figure"] for row in content["rows"]}
    assert figures == {*"23456789", "10a", "10b", "10c"}
    assert len(content["conclusions"]) == 4
    assert sum(content["counts"].values()) == len(content["rows"])
    assert all(
        row["explanation"]
        for row in content["rows"]
        if row["figure"] in "235678" and row["agrees"] is False
    )
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
    assert kind({"start": "x", "damping": "y", "integrator": "z"}) == "both"


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
    assert first.explanation == "with another start: start = 'rest' gives 1005 (+0.5 %)"
    assert second.explanation == "with another parameter: damping = 1 gives no; known"
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
