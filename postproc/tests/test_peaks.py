"""Peaks, the crest line of a map, and the comparison with published features."""

import numpy as np
import pytest
from result_files import (
    crest,
    flexible_amplitude,
    rigid_amplitude,
    veering_amplitude,
    veering_crests,
)

from spurflex_postproc.features import (
    CrestLine,
    compare,
    comparison_table,
    crest_line,
    find_peaks,
)
from spurflex_postproc.figures.stiffness_table import map_table
from spurflex_postproc.published import PAPER_STIFFNESS, published_curve, published_map

SPEED = np.arange(300.0, 6001.0, 10.0)


@pytest.mark.parametrize("centre", [1500.0, 1502.5, 1504.0, 1507.5])
def test_peak_between_grid_points(centre: float) -> None:
    (peak,) = find_peaks(SPEED, 1 + crest(SPEED, centre, 40, 10))
    assert peak.speed == pytest.approx(centre, abs=0.5)
    assert peak.height == pytest.approx(11, rel=2e-3)


def test_parabola_is_exact_on_uneven_grids() -> None:
    speed = np.array([0.0, 1.0, 3.0, 4.0, 7.0, 9.0])
    (peak,) = find_peaks(speed, 20 - (speed - 3.7) ** 2)
    assert (peak.speed, peak.height) == (pytest.approx(3.7), pytest.approx(20))


def test_brink_of_a_jump_is_no_peak() -> None:
    peaks = find_peaks(SPEED, rigid_amplitude(SPEED))
    assert [peak.speed for peak in peaks] == pytest.approx([1180, 1730], abs=2)


def test_peak_of_equal_neighbours_is_in_the_middle() -> None:
    (peak,) = find_peaks([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [0.0, 1.0, 2.0, 2.0, 1.0, 0.0])
    assert peak.speed == 3.5


def test_ripples_are_too_low() -> None:
    amplitude = 10 + 0.05 * np.sin(SPEED / 20)
    assert find_peaks(SPEED, amplitude) == []
    assert len(find_peaks(SPEED, amplitude, smallest=0.001)) > 10


def test_prominence_is_measured_from_the_higher_valley() -> None:
    amplitude = 1 + crest(SPEED, 1500, 50, 10) + crest(SPEED, 1750, 50, 6)
    (high, low) = find_peaks(SPEED, amplitude)
    valley = amplitude[(SPEED > 1500) & (SPEED < 1750)].min()
    assert low.prominence == pytest.approx(amplitude[SPEED == 1750][0] - valley)
    assert high.prominence == pytest.approx(amplitude[SPEED == 1500][0] - amplitude[0])


def test_crest_line_follows_the_square_root_of_the_stiffness() -> None:
    stiffness = np.logspace(6, 12, 61)
    amplitude = flexible_amplitude(SPEED, stiffness)
    line = crest_line(
        stiffness,
        SPEED,
        amplitude,
        np.ones(amplitude.shape, dtype=bool),
        start=(PAPER_STIFFNESS, 480),
        highest=3100,
    )
    known = np.isfinite(line.speed)
    assert known.sum() > 12
    expected = 480 * np.sqrt(stiffness[known] / PAPER_STIFFNESS)
    assert line.speed[known] == pytest.approx(expected, rel=0.05)
    there = 480 * np.sqrt(1e9 / PAPER_STIFFNESS)
    assert line.speed_at(1e9) == pytest.approx(there, rel=0.03)
    assert line.stiffness_at(float(line.speed_at(1e9))) == pytest.approx(1e9)
    heights = line.height[known]
    assert heights[-1] < heights[0]


def test_crest_between_rows() -> None:
    stiffness = np.array([1e8, 2e8, 4e8, 8e8])
    speed = np.array([300.0, 300.0 * np.sqrt(2), 600.0, np.nan])
    line = CrestLine(stiffness, speed, np.ones(4))
    # A power law is met exactly, on the rows and between them.
    for wanted in (1e8, 1.75e8, 2e8, 3e8, 4e8):
        assert line.between(wanted) == pytest.approx(300 * np.sqrt(wanted / 1e8))
    assert line.stiffness_at(450) == pytest.approx(2.25e8)
    # Beyond the line, and beside a row that lacks the crest.
    for wanted in (5e7, 5e8, 1e9):
        assert np.isnan(line.between(wanted))
    assert np.isnan(CrestLine(stiffness, np.full(4, np.nan), np.ones(4)).stiffness_at(450))


@pytest.mark.parametrize("count", [46, 61, 91])
def test_crest_line_ends_where_it_merges(count: int) -> None:
    stiffness = np.logspace(3, 12, count)
    amplitude = veering_amplitude(SPEED, stiffness)
    regular = np.ones(amplitude.shape, dtype=bool)
    line = crest_line(stiffness, SPEED, amplitude, regular, start=(2.5e8, 480), highest=3100)
    known = np.flatnonzero(np.isfinite(line.speed))
    assert known.size >= 4
    lowest = veering_crests(stiffness)[0][:, 0]
    assert line.speed[known] == pytest.approx(lowest[known], rel=0.02)
    assert 850 < line.speed[known[-1]] < 1120
    assert stiffness[known[-1]] < 4e9
    assert np.isnan(line.height[known[-1] + 1 :]).all()


@pytest.mark.parametrize("count", [46, 61, 91])
def test_crests_on_both_sides_of_the_line_are_found(count: int) -> None:
    stiffness = np.logspace(3, 12, count)
    amplitude = veering_amplitude(SPEED, stiffness)
    regular = np.ones(amplitude.shape, dtype=bool)
    line = crest_line(stiffness, SPEED, amplitude, regular, start=(2.5e8, 480), highest=3100)
    table = map_table(stiffness, SPEED, amplitude, regular, line, published_map()).splitlines()
    for name, speeds in (("below", (1290, 1900)), ("above", (1180, 1730))):
        rows = [row.split() for row in table if row.startswith(f"  crest {name} the line")]
        assert [float(row[4]) for row in rows] == list(speeds)
        centres = veering_crests(stiffness[[0, -1]])[0]
        truth = centres[0, 1:] if name == "below" else centres[1, :2]
        assert [float(row[5]) for row in rows] == pytest.approx(list(truth), rel=0.015)
        assert all(abs(float(row[6])) < 4 for row in rows)


def test_no_crest_line_in_a_plain() -> None:
    line = crest_line(
        [1e8, 1e9], SPEED, np.ones((2, 571)), np.ones((2, 571)), start=(1e8, 480), highest=3100
    )
    assert np.isnan(line.speed).all()
    assert np.isnan(line.speed_at(1e8))


def test_compare_uses_each_feature_once() -> None:
    found = compare([4650, 4730], [4690, 4735, 5400], within=0.03)
    assert found.pairs == [(4650, 4690), (4730, 4735)]
    assert found.others == [5400]


def test_compare_reaches_no_farther_than_the_next_published_feature() -> None:
    found = compare([4650, 4730, 4930], [4865, 4955], within=0.03)
    assert found.pairs == [(4650, None), (4730, None), (4930, 4955)]
    assert found.others == [4865]


def test_compare_leaves_what_is_far() -> None:
    found = compare([1000], [1200])
    assert found.pairs == [(1000, None)]


def test_table_tells_deviations() -> None:
    table = comparison_table("title", [("peak", compare([1000, 3000], [1010, 5000]))])
    assert table.splitlines()[2].split() == ["peak", "1000", "1010", "+1.0", "%"]
    assert table.splitlines()[3].split() == ["peak", "3000", "none", "-"]
    assert table.splitlines()[4].split() == ["peak", "-", "5000", "-"]


def test_published_features() -> None:
    assert published_curve("rigid").jumps == (3140, 4650, 4730, 4930, 5290)
    assert published_curve("flexible").peaks == (480, 1290, 1900)
    assert published_map().crests_above == (1180, 1730)
    with pytest.raises(KeyError):
        published_curve("soft")


def test_peak_close_behind_a_jump_is_a_peak() -> None:
    amplitude = 1 + crest(SPEED, 1163, 60, 10)
    amplitude[SPEED < 1145] *= 0.7
    assert [round(peak.speed) for peak in find_peaks(SPEED, amplitude)] == [1163]
