"""The identification: deck, linear system, search, misfit, and the command as a whole."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from result_files import write_result

from spurflex_postproc import open_result
from spurflex_postproc.identify import cli, determined, landscape
from spurflex_postproc.identify import hypotheses as hypotheses_of
from spurflex_postproc.identify.hypotheses import hypotheses
from spurflex_postproc.identify.linear import MeanSystem
from spurflex_postproc.identify.misfit import Feature, curve_misfit, misfit
from spurflex_postproc.identify.program import Program, ProgramError, rewritten
from spurflex_postproc.identify.search import compass
from spurflex_postproc.identify.support import SupportFit, nearest_agreeing
from spurflex_postproc.identify.unknowns import Unknowns, balanced, standard_gears

DECK = """\
&gears
   teeth_1        = 55            ! not printed
   pressure_angle = 20.0
   base_radius_1  = 0.05
   base_radius_2  = 0.07
   mass_1         = 1.53
   mass_2         = 3.01
   inertia_1      = 0.041         ! as printed
   inertia_2      = 0.079
/
&bearings
   stiffness_1 = 2.0e8
   stiffness_2 = 2.0e8
/
&mesh
   mean_stiffness = 3.2e8
   error_phases   = 0.0
/
&gearbox
   mass           = 19.87
   inertia        = 0.35
   gear_offset    = 0.08
   support_offset = 0.11
/
&sweep
   support         = 'both'
   speed_first     = 300.0
   speed_last      = 6000.0
   speed_count     = 571
   stiffness_first = 2.5e5
   stiffness_last  = 2.5e5
   start           = 'static'
/
&solver
   tolerance        = 1.0e-6
   max_periods      = 8000
   measured_periods = 400
/
&output
   file = 'x.h5'
/
"""
TENTH = Unknowns(0.05168, balanced(0.05168), 55, 0.08, 0.11, 0.1, 1e3)


def test_values_of_a_deck_are_replaced_and_remarks_stay() -> None:
    text = rewritten(DECK, {"teeth_1": "54", "inertia_1": "0.1", "file": "'y.h5'"})
    assert "teeth_1        = 54            ! not printed" in text
    assert "inertia_1      = 0.1         ! as printed" in text
    assert "file = 'y.h5'" in text
    assert text.count("\n") == DECK.count("\n")


@pytest.mark.parametrize("key", ["mass", "nothing"])
def test_key_has_to_stand_once(key: str) -> None:
    text = DECK + DECK if key == "mass" else DECK
    with pytest.raises(KeyError, match=key):
        rewritten(text, {key: "1"})


def test_mesh_mass_and_force() -> None:
    assert TENTH.mesh_mass == pytest.approx(0.781, abs=0.001)
    assert TENTH.mesh_force == pytest.approx(110 / 0.05168, rel=1e-9)
    assert TENTH.deck_values()["stiffness_first"] == "2.500000000000e+08"
    turned = TENTH.with_values(error_phase=300.0)
    assert float(turned.deck_values()["error_phases"]) == -60.0


def test_standard_gears() -> None:
    gears = standard_gears(2e-3, 55)
    assert gears["radius_1"] == pytest.approx(0.05168, abs=1e-5)
    assert gears["radius_2"] == pytest.approx(0.07048, abs=1e-5)
    assert gears["gear_offset"] == pytest.approx(0.065)


def test_eigenfrequencies_lie_near_the_published_peaks() -> None:
    mean = MeanSystem(DECK)
    off = mean.deviations(TENTH, (1180, 1730), (480, 1290, 1900))
    assert np.abs(off).max() < 0.02


def test_eigenfrequencies_of_one_mass() -> None:
    soft = TENTH.with_values(inertia_factor=1e9, stiffness_factor=1e12)
    peaks = MeanSystem(DECK).peaks(soft, flexible=False)
    angular = peaks * 2 * np.pi * 55 / 60
    # Gears that cannot turn: each mass on its bearings and, along one line, on the mesh.
    matrix = np.diag([2e8 / 1.53, 2e8 / 3.01]) + 3.2e8 * np.array(
        [[1 / 1.53, -1 / np.sqrt(1.53 * 3.01)], [-1 / np.sqrt(1.53 * 3.01), 1 / 3.01]]
    )
    for square in np.linalg.eigvalsh(matrix):
        assert np.abs(angular**2 / square - 1).min() < 1e-3


def test_deck_without_a_mass() -> None:
    with pytest.raises(KeyError, match="mean_stiffness"):
        MeanSystem(DECK.replace("mean_stiffness", "other"))


def test_compass_finds_the_least_value() -> None:
    count = 0

    def values(points: list[np.ndarray]) -> list[float]:
        nonlocal count
        count += len(points)
        return [float(np.sum((point - [1.0, -2.0]) ** 2)) for point in points]

    found = compass(values, [np.zeros(2), np.array([3.0, 3.0])], np.array([0.5, 0.5]), halvings=6)
    assert found.point == pytest.approx([1, -2], abs=0.01)
    assert found.evaluations == count


def test_compass_without_coordinates() -> None:
    found = compass(lambda points: [3.0] * len(points), [np.empty(0)], np.empty(0))
    assert (found.value, found.point.size) == (3.0, 0)


def test_penalties() -> None:
    assert Feature("", 1000.0, 1010.0, 0.01).penalty == pytest.approx(1)
    assert Feature("", 1000.0, None, 0.01).penalty == pytest.approx(10)
    assert Feature("", 1000.0, 2000.0, 0.03).penalty == pytest.approx(10 / 3)
    half = Feature("", 1000.0, 1000.0, 0.03, partial=True)
    assert half.penalty == pytest.approx(5 / 3)
    assert not half.agrees
    assert misfit([Feature("", 1.0, 1.03, 0.01), Feature("", 1.0, 1.0, 0.01)]) == pytest.approx(
        3 / np.sqrt(2)
    )


def test_misfit_of_a_curve(curve_file: Path) -> None:
    result = open_result(curve_file)
    found = {one.published: one for one in curve_misfit(result, "rigid")}
    assert found[1180].agrees
    assert found[3140].computed == 3145.0
    assert found[4640].computed == 4645.0
    assert not found[5460].agrees
    assert len(curve_misfit(result, "flexible", peaks_only=True)) == 3


def test_stiffness_that_departs_least_is_taken() -> None:
    def support(factor: float, *deviations: float) -> SupportFit:
        features = [Feature("", 1.0, 1.0 + one, 0.01) for one in deviations]
        return SupportFit(TENTH.with_values(stiffness_factor=factor), features)

    fits = [support(500, 0, 0, 0), support(700, 0.009, 0, 0), support(900, 0.012, 0, 0)]
    assert nearest_agreeing(fits, 1e3) is fits[1]
    assert nearest_agreeing(fits, 100) is fits[0]
    assert nearest_agreeing(fits[2:], 1e3) is fits[2]
    assert [one.agreeing for one in fits] == [3, 3, 2]


def test_turning_stiffness() -> None:
    assert TENTH.support_stiffness == pytest.approx(2.5e8)
    assert TENTH.turning_stiffness == pytest.approx(2.5e8 * 0.11**2)


def test_every_hypothesis_makes_parameters() -> None:
    several = hypotheses()
    assert len({one.key for one in several}) == len(several)
    for one in several:
        for point in one.starts:
            assert len(point) == len(one.steps) == len(one.free)
            made = one.make(np.array(point), one.teeth[0])
            assert made.teeth == one.teeth[0]
            assert 0.3 < made.mesh_mass / TENTH.mesh_mass < 30


class FakeProgram(Program):
    """Writes the same made-up curves whatever the deck says, on the grid that it asks for."""

    def _digest(self) -> str:
        return "fake"

    def _start(self, deck: Path) -> None:
        self.runs += 1
        text = deck.read_text()
        value = dict(re.findall(r"^\s*(\w+)\s*=\s*([^!\n]*?)\s*(?:!.*)?$", text, re.MULTILINE))
        speed = np.linspace(
            float(value["speed_first"]), float(value["speed_last"]), int(value["speed_count"])
        )
        write_result(
            Path(value["file"].strip("'")),
            speed,
            np.array([2.5e8]),
            support=value["support"].strip("'"),
            irregular=(4650.0, 4990.0),
        )


def test_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli, "Program", FakeProgram)
    monkeypatch.setattr(determined, "PARAMETERS", ("radius_1",))
    monkeypatch.setattr(hypotheses_of, "STIFFNESS_FACTORS", (1e3, 500.0))
    grids = ("FORCES", "MASSES", "PHASES", "PHASE_FORCES", "OFFSETS", "SUPPORTS")
    for name in (*grids, "STIFFNESSES", "TURNING"):
        monkeypatch.setattr(landscape, name, getattr(landscape, name)[:2])
    deck = tmp_path / "deck.nml"
    deck.write_text(DECK)
    out = tmp_path / "out"
    arguments = ["--program", "none", "--deck", str(deck), "--output", str(out)]
    chosen = ("table 1", "tenth", "decks")
    assert cli.main([*arguments, *(f"--only={name}" for name in chosen)]) == 0
    content = json.loads((out / "identification.json").read_text())
    assert [fit["hypothesis"] for fit in content["fits"]] == list(chosen)
    assert content["fits"][0]["parameters"]["inertia_factor"] == 1.0
    text = (out / "identification.md").read_text()
    assert "not the authors' own" in text
    assert "| rigid peak | 1180 |" in text
    # The made-up peaks are the same with every k_M: that which departs least is taken.
    tried = [one["stiffness_factor"] for one in content["fits"][2]["stiffnesses"]]
    assert tried == [1e3, 500.0]
    assert content["fits"][2]["parameters"]["stiffness_factor"] == 1e3
    assert "## Support stiffness with 'decks'" in text
    assert "| 1000 (taken) | 2.50e+08 |" in text
    assert "with 'tenth'" not in text
    assert (out / "landscape.pdf").read_bytes().startswith(b"%PDF")
    assert "wrote" in capsys.readouterr().out


def test_command_without_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    deck = tmp_path / "deck.nml"
    deck.write_text(DECK)
    arguments = ["--program", str(tmp_path / "none"), "--deck", str(deck)]
    assert cli.main([*arguments, "--output", str(tmp_path), "--only", "table 1"]) == 2
    assert "cannot read" in capsys.readouterr().err
    assert cli.main([*arguments, "--only", "nothing"]) == 2
    assert cli.main(["--program", "x", "--deck", str(tmp_path / "gone.nml")]) == 2


def test_program_that_fails(tmp_path: Path) -> None:
    script = tmp_path / "program"
    script.write_text("#!/bin/sh\necho 'deck: fault' >&2\nexit 2\n")
    script.chmod(0o755)
    program = Program(script, DECK, tmp_path / "runs")
    with pytest.raises(ProgramError, match="exit code 2: deck: fault"):
        program.run(TENTH.deck_values())
