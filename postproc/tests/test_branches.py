"""Jumps: found where the response breaks, not where it is steep."""

import numpy as np
import pytest
from result_files import crest, rigid_amplitude

from spurflex_postproc.features import find_branches

SPEED = np.arange(300.0, 6001.0, 10.0)


def jumps(amplitude: np.ndarray, regular: np.ndarray | None = None) -> list[float]:
    return [jump.speed for jump in find_branches(SPEED, amplitude, regular).jumps]


def test_jump_between_two_branches() -> None:
    (jump,) = find_branches(SPEED, rigid_amplitude(SPEED)).jumps
    assert (jump.first, jump.last, jump.kind) == (3140.0, 3150.0, "branch")
    assert jump.before < jump.after


@pytest.mark.parametrize("width", [10.0, 14.0, 20.0, 40.0, 100.0])
@pytest.mark.parametrize("offset", [0.0, 2.5, 5.0, 7.5])
def test_steep_resonance_is_no_jump(width: float, offset: float) -> None:
    assert jumps(1.0 + crest(SPEED, 1500.0 + offset, width, 40.0)) == []


def test_period_doubling_is_no_jump() -> None:
    amplitude = 5 + 0.2 * np.sqrt(np.maximum(SPEED - 5463, 0))
    assert jumps(amplitude) == []


def test_fold_with_vertical_tangent_is_a_jump() -> None:
    lower = 8 - 0.1 * np.sqrt(np.maximum(3143 - SPEED, 0))
    assert jumps(np.where(SPEED < 3143, lower, 11.0)) == [3145.0]


def test_jumps_downwards_and_close_together() -> None:
    amplitude = np.select([SPEED < 2000, SPEED < 2055], [9.0, 6.0], 3.0) + SPEED / 1e4
    assert jumps(amplitude) == [1995.0, 2055.0]


def test_small_noise_gives_no_jump() -> None:
    noise = np.random.default_rng(1).normal(0, 0.01, SPEED.shape)
    assert jumps(rigid_amplitude(SPEED) * 1e6 * (1 + noise)) == [3145.0]


def test_single_misfit_is_left_out() -> None:
    amplitude = rigid_amplitude(SPEED)
    amplitude[100] *= 3
    found = find_branches(SPEED, amplitude)
    assert [jump.speed for jump in found.jumps] == [3145.0]
    assert all(100 not in segment for segment in found.segments)


def test_misfit_within_a_jump_does_not_hide_it() -> None:
    amplitude = np.where(SPEED <= 3140, 4.0, 14.0)
    amplitude[SPEED == 3150] = 20.0
    (jump,) = find_branches(SPEED, amplitude).jumps
    assert (jump.first, jump.last) == (3140.0, 3160.0)


def test_irregular_band_is_ignored_inside_but_its_border_is_judged() -> None:
    band = (SPEED >= 4650) & (SPEED <= 4990)
    amplitude = 10 + 0 * SPEED
    amplitude[band] = np.random.default_rng(2).uniform(15, 25, band.sum())
    found = find_branches(SPEED, amplitude, ~band)
    assert found.bands == [(4650.0, 4990.0)]
    assert [(jump.speed, jump.kind) for jump in found.jumps] == [(4645.0, "edge"), (4995.0, "edge")]


def test_jump_at_a_band_is_where_its_level_is_reached() -> None:
    band = (SPEED >= 4870) & (SPEED <= 4950)
    amplitude = np.where(band, 9.0, 4.0 - (SPEED - 4800) / 400)
    ends = np.isin(SPEED, (4870, 4950))
    amplitude[ends] = 4.0 - (SPEED[ends] - 4800) / 400
    found = find_branches(SPEED, amplitude, ~band)
    assert found.bands == [(4870.0, 4950.0)]
    assert [(jump.first, jump.last) for jump in found.jumps] == [(4870, 4880), (4940, 4950)]
    assert [jump.after > jump.before for jump in found.jumps] == [True, False]


def test_missing_points_are_no_jump() -> None:
    amplitude = rigid_amplitude(SPEED)
    amplitude[[50, 51, 88, 200]] = np.nan
    assert jumps(amplitude) == [3145.0]


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4])
def test_few_points(count: int) -> None:
    assert find_branches(SPEED[:count], SPEED[:count]).jumps == []


def test_all_irregular_or_all_missing() -> None:
    nothing = np.zeros(SPEED.shape, dtype=bool)
    assert find_branches(SPEED, SPEED, nothing).segments == []
    assert find_branches(SPEED, np.full(SPEED.shape, np.nan)).segments == []


def test_wrong_arguments() -> None:
    with pytest.raises(ValueError, match="shape"):
        find_branches(SPEED, SPEED[1:])
    with pytest.raises(ValueError, match="ascend"):
        find_branches(SPEED[::-1], SPEED)
