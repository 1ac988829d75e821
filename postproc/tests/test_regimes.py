"""Regimes of motion, their borders, and coexisting motions."""

import numpy as np
import pytest

from spurflex_postproc.features.attractors import attractors, coexistence
from spurflex_postproc.features.regimes import (
    IRREGULAR,
    Regime,
    find_regimes,
    flag_name,
    match_borders,
    motion_name,
    sequence,
)

SPEED = np.arange(4000.0, 6001.0, 10.0)
PUBLISHED = (
    ("1T", 4000.0, 4640.0),
    ("chaotic", 4640.0, 4980.0),
    ("3T", 4980.0, 5400.0),
    ("1T", 5400.0, 5460.0),
    ("2T", 5460.0, 6000.0),
)


def flags(*borders: tuple[float, int]) -> np.ndarray:
    """Motion flags that change above the given speeds, 1T at first."""
    motion = np.ones(SPEED.shape, dtype=int)
    for speed, flag in borders:
        motion[speed < SPEED] = flag
    return motion


def borders(motion: np.ndarray) -> list[float | None]:
    return [one.computed for one in match_borders(find_regimes(SPEED, motion), PUBLISHED)]


def test_regimes_are_runs_of_one_class() -> None:
    found = find_regimes(SPEED, flags((4640, 30), (4980, 3), (5400, 1), (5460, 2)))
    assert sequence(found) == ("1T to 4640, irregular to 4980, 3T to 5400, 1T to 5460, 2T to 6000")
    assert found[1] == Regime(IRREGULAR, 4650.0, 4980.0, (30,))


def test_quasi_periodic_chaotic_and_long_periods_are_one_regime() -> None:
    found = find_regimes(SPEED, flags((4640, 20), (4700, 30), (4800, 121), (4810, 0), (4900, 1)))
    assert sequence(found) == "1T to 4640, irregular to 4900, 1T to 6000"
    assert set(found[1].flags) == {0, 20, 30, 121}


def test_single_points_belong_to_their_neighbours() -> None:
    motion = flags((4640, 20), (4980, 2))
    motion[[20, 80]] = 2, 5
    assert sequence(find_regimes(SPEED, motion)) == "1T to 4640, irregular to 4980, 2T to 6000"


def test_short_run_between_two_periods_stays() -> None:
    assert sequence(find_regimes(SPEED, flags((4640, 3), (4660, 2)))) == (
        "1T to 4640, 3T to 4660, 2T to 6000"
    )


def test_points_without_value_are_left_out() -> None:
    motion = flags((5000, 2))
    motion[50:60] = -1
    assert sequence(find_regimes(SPEED, motion)) == "1T to 5000, 2T to 6000"
    assert find_regimes(SPEED[:0], motion[:0]) == []


def test_names_of_flags() -> None:
    assert [flag_name(flag) for flag in (3, 20, 30, 112, 0)] == [
        *("3T", "quasi-periodic", "chaotic", "12T", "unresolved")
    ]
    assert [motion_name(flag) for flag in (8, 9, 20, 0)] == ["8T", *3 * [IRREGULAR]]


def test_borders_of_the_same_sequence() -> None:
    motion = flags((4650, 20), (4970, 3), (5390, 1), (5470, 2))
    assert borders(motion) == [4655.0, 4975.0, 5395.0, 5475.0]
    assert all(one.complete for one in match_borders(find_regimes(SPEED, motion), PUBLISHED))


def test_border_without_one_of_its_regimes_is_the_end_of_the_other() -> None:
    found = match_borders(find_regimes(SPEED, flags((4700, 20), (5000, 3), (5400, 2))), PUBLISHED)
    assert [one.computed for one in found] == [4705.0, 5005.0, 5405.0, 5405.0]
    assert [one.complete for one in found] == [True, True, False, False]
    assert [one.side for one in found] == ["both", "both", "lower", "upper"]


def test_one_regime_for_two_published_ones_counts_where_its_border_is_whole() -> None:
    found = match_borders(find_regimes(SPEED, flags((5440, 2))), PUBLISHED)
    assert [one.computed for one in found] == [None, None, None, 5445.0]
    assert [one.complete for one in found] == [False, False, False, True]


def test_border_with_another_motion_between_is_the_nearer_end() -> None:
    motion = flags((4640, 20), (4900, 1), (5100, 3), (5400, 1), (5460, 2))
    found = match_borders(find_regimes(SPEED, motion), PUBLISHED)
    assert found[1].computed == 4905.0
    assert found[1].side == "lower"


def test_nothing_of_the_sequence() -> None:
    found = match_borders(find_regimes(SPEED, np.full(SPEED.shape, 5)), PUBLISHED)
    assert [one.computed for one in found] == 4 * [None]


def test_wrong_shapes() -> None:
    with pytest.raises(ValueError, match="shape"):
        find_regimes(SPEED, [1, 2])


def test_starts_are_grouped_by_their_motion() -> None:
    amplitude = {"up": [1.0, 1.0, 2.0], "down": [1.001, 2.0, 2.0], "rest": [1.0, np.nan, 2.3]}
    motion = {"up": [1, 1, 20], "down": [1, 1, 20], "rest": [1, -1, 30]}
    one, two, three = attractors(amplitude, motion)
    assert [group.starts for group in one] == [("up", "rest", "down")]
    assert [group.amplitude for group in two] == [1.0, 2.0]
    assert [group.motion for group in three] == [IRREGULAR]


def test_same_amplitude_of_another_period_is_another_motion() -> None:
    ((first, second),) = attractors({"a": [1.0], "b": [1.0]}, {"a": [1], "b": [2]})
    assert {first.motion, second.motion} == {"1T", "2T"}


def test_ranges_of_coexistence() -> None:
    speed = np.arange(0.0, 60.0, 10.0)
    amplitude = {"up": np.ones(6), "down": np.array([1, 1, 3, 3, 1, 5.0])}
    motion = {"up": np.ones(6, dtype=int), "down": np.array([1, 1, 3, 3, 1, 1])}
    found = coexistence(speed, attractors(amplitude, motion))
    assert [(one.first, one.last, one.motions, one.most) for one in found] == [
        (20.0, 30.0, ("1T", "3T"), 2),
        (50.0, 50.0, ("1T",), 2),
    ]


def test_starts_have_to_fit() -> None:
    with pytest.raises(ValueError, match="different starts"):
        attractors({"a": [1.0]}, {"b": [1]})
    with pytest.raises(ValueError, match="shape"):
        attractors({"a": [1.0], "b": [1.0, 2.0]}, {"a": [1], "b": [1, 1]})
