"""Signed areas of a map, transition from soft to rigid, lines of a spectrum."""

import numpy as np
import pytest

from spurflex_postproc.features.areas import connected, lettered, signed_areas, stiff_border
from spurflex_postproc.features.orders import find_lines, second_frequency
from spurflex_postproc.features.stiffness import transition
from spurflex_postproc.published import published_points

SPEED = np.arange(300.0, 6001.0, 30.0)
STIFFNESS = np.logspace(3, 12, 46)
SIGNS = {"A": "0", "B": "+", "C": "-", "D": "+"}


def striped(*borders: float) -> np.ndarray:
    """A map whose sign changes at the given speeds, positive first, zero with a stiff support."""
    sign = np.ones(SPEED.shape)
    for border in borders:
        sign[border < SPEED] *= -1
    soft = (STIFFNESS < 1e10)[:, np.newaxis]
    return np.where(soft, 10.0 * sign, 0.0)


def test_connected_parts() -> None:
    mask = [[1, 1, 0, 1], [0, 0, 0, 1], [1, 0, 1, 0]]
    np.testing.assert_array_equal(connected(mask), [[1, 1, 0, 2], [0, 0, 0, 2], [3, 0, 4, 0]])


def test_areas_of_stripes() -> None:
    values = striped(1000, 2000)
    areas = signed_areas(STIFFNESS, SPEED, values)
    assert [area.sign for area in areas] == [1, -1, 1]
    assert sum(area.share for area in areas) == pytest.approx(np.mean(values != 0))
    assert areas[1].extreme == areas[1].mean == -10
    assert 1000 < areas[1].speed < 2000


def test_line_of_one_speed_does_not_part_an_area() -> None:
    values = striped()
    values[:, 60] = -5
    assert len(signed_areas(STIFFNESS, SPEED, values)) == 1


def test_small_and_faint_areas_do_not_count() -> None:
    values = 0.1 * striped(3000)
    values[3:5, 10:13] = 9
    assert [area.share for area in signed_areas(STIFFNESS, SPEED, 0.4 * values)] == []


def test_missing_values_are_no_area() -> None:
    values = striped()
    values[:, 80:90] = np.nan
    assert len(signed_areas(STIFFNESS, SPEED, values)) == 2


def test_letters_go_to_the_largest_areas_in_order() -> None:
    values = striped(1000, 2000, 5000)
    values[:10, 5:8] = -20
    found = lettered(signed_areas(STIFFNESS, SPEED, values), SIGNS)
    assert list(found) == ["B", "C", "D"]
    assert found["C"].speed > 1000
    assert [area.sign for area in found.values()] == [1, -1, 1]


def test_letters_that_have_no_area_are_dropped() -> None:
    assert list(lettered(signed_areas(STIFFNESS, SPEED, striped(1000)), SIGNS)) == ["B", "C"]
    assert lettered([], SIGNS) == {}


def test_stiff_border() -> None:
    assert stiff_border(STIFFNESS, striped(2000)) == pytest.approx(1e10)
    assert np.isnan(stiff_border(STIFFNESS, np.ones((46, 3))))
    assert stiff_border(STIFFNESS, np.zeros((46, 3))) == STIFFNESS[0]


def test_areas_need_a_map() -> None:
    with pytest.raises(ValueError, match="fit"):
        signed_areas(STIFFNESS, SPEED, np.ones((3, 3)))


def test_transition_lies_where_the_response_is_half_way() -> None:
    rigid = np.full(SPEED.shape, 4.0)
    way = 1 / (1 + (STIFFNESS / 1e9) ** 2)
    response = rigid * np.exp(0.6 * way)[:, np.newaxis]
    found = transition(STIFFNESS, response, rigid)
    assert found.middle == pytest.approx(1e9, rel=0.05)
    assert found.difference[0] == pytest.approx(np.exp(0.6) - 1, rel=1e-6)
    border = 1e9 * np.sqrt(0.6 / np.log(1.05) - 1)
    assert border <= found.rigid_from < 1.6 * border


def test_no_transition() -> None:
    rigid = np.ones(SPEED.shape)
    found = transition(STIFFNESS, np.full((46, SPEED.size), 2.0), rigid)
    assert np.isnan(found.rigid_from)
    assert np.isnan(found.middle)
    with pytest.raises(ValueError, match="no speed"):
        transition(STIFFNESS, np.full((46, SPEED.size), np.nan), rigid)
    with pytest.raises(ValueError, match="fit"):
        transition(STIFFNESS, np.ones((46, 2)), rigid)


def test_lines_of_a_spectrum() -> None:
    order = np.arange(0, 601) / 200
    amplitude = np.full(order.shape, 1e-6)
    for at, height in ((1 / 3, 0.2), (2 / 3, 1.0), (1.0, 0.5), (0.0, 9.0)):
        amplitude += height * np.exp(-(((order - at) / 0.004) ** 2))
    lines = find_lines(order, amplitude)
    assert [line.order for line in lines] == pytest.approx([2 / 3, 1.0, 1 / 3], abs=1e-3)
    assert [line.amplitude for line in lines] == pytest.approx([1.0, 0.5, 0.2], rel=0.25)


def test_side_lobes_are_no_lines() -> None:
    time = np.arange(840 * 16) / 16
    value = np.sin(2 * np.pi * 0.3705 * time) + 0.1 * np.sin(2 * np.pi * time)
    taper = 1 - np.cos(2 * np.pi * time / 840)
    amplitude = 2 * np.abs(np.fft.rfft(value * taper)) / time.size
    lines = find_lines(np.arange(amplitude.size) / 840, amplitude)
    assert [line.order for line in lines] == pytest.approx([0.3705, 1.0], abs=1e-4)


def test_spectrum_of_whole_orders() -> None:
    assert find_lines([0, 0.5, 1.0, 1.5], [3.0, 0.0, 2.0, 0.0]) == [(1.0, 2.0)]
    assert find_lines([0.5, 1.0], [1.0, 2.0])[0].order == 1.0
    assert find_lines([0.0], [1.0]) == []
    with pytest.raises(ValueError, match="shape"):
        find_lines([0.0], [1.0, 2.0])


def test_second_frequency() -> None:
    (told,) = [point for point in published_points() if point.motion == "chaotic"]
    assert second_frequency([told.dominant, *told.orders]) == pytest.approx(0.37)
    assert second_frequency([1.0, 2 / 3, 1 / 3, 2.0]) is None
    assert second_frequency([1.0, 0.1234, 0.3117, 0.4444]) is None
