"""The replay of the scheduler, where its answer is known in closed form; and what is read from the log."""

import re

import numpy as np
import pytest
from costs import Costs, fits, least_missing, sets_of, sets_of_every_other, tiles_of
from harness import paths_in
from replay import refined
from schedule import (
    FORECAST,
    PLAN,
    Constants,
    Forecast,
    Machine,
    constants_of_plan,
    cost_of_best_cuts,
    cut,
    dearest_first,
    forecast,
    lower_bound,
    pieces_of,
    replay,
    tile,
    tile_bound,
)

FREE = Machine(latency=0.0, service=0.0, attendance=0.0, write=0.0)
SHORT = 1e-9  # a latency that only says who asks first
NEAR = Machine(latency=SHORT, service=0.0, attendance=0.0, write=0.0)


def test_one_rank_does_everything():
    costs = [3.0, 1.0, 2.0]
    assert replay(costs, 1, FREE) == pytest.approx(6.0)
    assert replay(costs, 1, Machine(write=0.5)) == pytest.approx(7.5)


@pytest.mark.parametrize("ranks", [2, 3, 8, 64])
@pytest.mark.parametrize("rounds", [1, 2, 7])
def test_equal_costs_that_divide_evenly(ranks, rounds):
    assert replay([2.0] * (ranks * rounds), ranks, NEAR) == pytest.approx(2.0 * rounds, rel=1e-6)


def test_equal_costs_with_one_chunk_more():
    ranks, rounds = 8, 5
    assert replay([1.0] * (ranks * rounds + 1), ranks, NEAR) == pytest.approx(rounds + 1.0, rel=1e-6)


def test_giant_chunk_at_the_end():
    # Rank 0 and rank 1 share 100 small chunks, then one of them has the giant one alone.
    assert replay([1.0] * 100 + [50.0], 2, NEAR) == pytest.approx(50.0 + 50.0, rel=1e-6)


def test_giant_chunk_keeps_no_other_waiting():
    # Rank 1 has the giant chunk and asks for no other before it is done.
    assert replay([1.0, 50.0, 1.0] + [1.0] * 20, 2, NEAR) == pytest.approx(50.0, rel=1e-6)


def test_giant_chunk_of_rank_0():
    # While rank 0 works on it, it serves the others: they do the rest.
    assert replay([50.0] + [1.0] * 20, 2, NEAR) == pytest.approx(50.0, rel=1e-6)


def test_more_ranks_than_chunks():
    assert replay([4.0, 4.0, 4.0], 100, NEAR) == pytest.approx(4.0, rel=1e-6)


def test_nothing_to_do():
    assert replay([], 4, NEAR) == pytest.approx(0.0, abs=1e-6)


def test_a_round_trip_before_every_chunk():
    machine = Machine(latency=0.1, service=0.0, attendance=0.0, write=0.0)
    # Rank 1 does 10 chunks in 12 s, rank 0 does 11 in 11 s and takes the last one too.
    assert replay([1.0] * 22, 2, machine) == pytest.approx(12.0 + 3 * machine.latency, abs=0.1 + 1e-6)


def test_chunks_shorter_than_a_round_trip_wait_for_it():
    machine = Machine(latency=1.0, service=0.0, attendance=0.0, write=0.0)
    # Rank 0 does a chunk every 0.1 s, rank 1 one every 2.1 s: 220 in 21 s. At the end a request, its
    # answer and the message that rank 1 has ended may still have to travel.
    time = replay([0.1] * 220, 2, machine)
    assert 21.0 - 0.1 <= time <= 21.0 + 0.1 + 3 * machine.latency


def test_rank_0_answers_only_when_it_looks():
    often = Machine(latency=SHORT, service=0.0, attendance=0.01, write=0.0)
    seldom = Machine(latency=SHORT, service=0.0, attendance=10.0, write=0.0)
    costs = [10.0] + [0.5] * 8
    # Seldom: rank 1 gets its first chunk when rank 0 is done; rank 0 then helps.
    assert replay(costs, 2, often) == pytest.approx(10.0, rel=1e-6)
    assert replay(costs, 2, seldom) == pytest.approx(12.0, abs=0.51)


def test_service_bounds_the_rate():
    machine = Machine(latency=SHORT, service=1.0, attendance=0.0, write=0.0)
    # Nothing but requests to answer: one a second, and one more a rank for the end.
    assert replay([1e-6] * 50, 1000, machine) >= 50.0


def test_a_replay_is_never_below_the_bound():
    random = np.random.default_rng(7)
    for ranks in (1, 2, 5, 32):
        costs = random.lognormal(0.0, 1.5, size=300)
        assert replay(costs, ranks, NEAR) >= lower_bound(costs, ranks) * (1 - 1e-9)


def test_chunks_are_tiles():
    costs = np.arange(55.0).reshape(5, 11)
    # Tiles of 2 rows and 8 speeds; what is left at the ends of the grid is cut off.
    assert tile(16, costs.shape) == (2, 8)
    assert cut(costs, 16).tolist() == [
        costs[:2, :8].sum(),
        costs[:2, 8:].sum(),
        costs[2:4, :8].sum(),
        costs[2:4, 8:].sum(),
        costs[4:, :8].sum(),
        costs[4:, 8:].sum(),
    ]
    assert cut(costs, 1).tolist() == costs.reshape(-1).tolist()


def test_one_row_is_cut_along_the_speeds():
    costs = np.arange(7.0).reshape(1, 7)
    assert cut(costs, 3).tolist() == [3.0, 12.0, 6.0]
    assert cut(costs, 100).tolist() == [21.0]


@pytest.mark.parametrize(
    ("length", "shape", "expected"),
    [
        (8, (91, 571), (1, 8)),
        (16, (91, 571), (2, 8)),
        (30, (91, 571), (3, 8)),
        (64, (91, 571), (4, 16)),
        (128, (91, 571), (4, 32)),
        (128, (1, 571), (1, 128)),
        (128, (3, 571), (3, 42)),
        (128, (571, 3), (42, 3)),
        (1, (91, 571), (1, 1)),
        (100, (2, 2), (2, 2)),
    ],
)
def test_shape_of_tiles(length, shape, expected):
    assert tile(length, shape) == expected


def test_length_of_chunks():
    constants = Constants(largest_chunk=128, chunks_per_rank=24, smallest_chunk=8, fewest_chunks=2)
    assert constants.length(51961, 2) == 128
    assert constants.length(51961, 256) == 8
    assert constants.length(10**6, 1024) == 40
    assert constants.length(2500, 1024) == 1
    assert constants.length(2500, 256) == 4
    assert constants.length(571, 1024) == 1


def test_the_plan_still_has_the_rule_that_is_mirrored():
    text = re.sub(r"\s+", "", PLAN.read_text())
    for line in (
        "length=max(1,min(smallest_chunk,missing/(ranks*fewest_chunks)),"
        "min(largest_chunk,missing/(ranks*chunks_per_rank)))",
        "dowhile(2*width**2<=aspect*length.and.2*width<=length.and.width<size(status,1))width=2*width",
        "width=max(1,min(width,size(status,1)))",
        "height=max(1,min(length/width,size(status,2)))",
        "if(height==size(status,2))width=max(1,min(length/height,size(status,1)))",
        "dofirst=1,size(status,2),height",
        "dospeed=1,size(status,1),width",
    ):
        assert line in text, (
            f"no {line} in src/sweep/plan.f90: change Constants.length, tile and cut in schedule.py too"
        )
    constants = constants_of_plan()
    assert constants.largest_chunk >= constants.smallest_chunk >= 1
    assert constants.chunks_per_rank >= 1


def handed_out(order, costs):
    """All chunks in the order of a forecast that hears of each at once."""
    chunks = []
    for _ in costs:
        chunks.append(order.next())
        order.note(chunks[-1], costs[chunks[-1]])
    return chunks


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (6, 36), (25, 40)])
def test_every_chunk_is_handed_out_once_and_the_pilot_first(shape):
    costs = np.random.default_rng(5).lognormal(0.0, 1.5, size=shape[0] * shape[1])
    order = Forecast(shape, np.full(costs.size, 16))
    chunks = handed_out(order, costs)
    assert sorted(chunks) == list(range(costs.size))
    row, speed = np.divmod(chunks[: order.pilot], shape[1])
    assert not ((speed + 3 * row) % 8).any()
    assert chunks[: order.pilot] == sorted(chunks[: order.pilot])


def test_a_dear_band_comes_after_the_pilot():
    shape = (16, 40)
    costs = np.ones(shape)
    costs[:, 20:24] = 50.0
    costs = costs.reshape(-1)
    order = Forecast(shape, np.full(costs.size, 16))
    rest = costs[handed_out(order, costs)[order.pilot :]]
    dear = int((rest > 1.0).sum())
    assert (rest[: dear // 2] > 1.0).all()
    assert (rest[2 * dear :] == 1.0).all()


def test_a_forecast_beats_the_list():
    shape, ranks = (64, 64), 8
    costs = np.ones(shape)
    costs[63:, 55:] = 40.0
    costs = costs.reshape(-1)
    first = replay(costs, ranks, NEAR, Forecast(shape, np.full(costs.size, 16)))
    assert first < 0.95 * replay(costs, ranks, NEAR)
    assert lower_bound(costs, ranks) * (1 - 1e-9) <= first < 1.02 * lower_bound(costs, ranks)


def test_equal_costs_keep_the_order_of_the_list():
    for cost in (0.0, 2.0):
        order = Forecast((8, 16), np.full(128, 4))
        chunks = handed_out(order, np.full(128, cost))
        assert chunks[order.pilot :] == sorted(chunks[order.pilot :])


def test_dearest_first_by_classes():
    assert dearest_first(np.array([1.0, 8.0, 0.99, 0.0, 2.0]), 8).tolist() == [1, 4, 0, 2, 3]
    assert dearest_first(np.zeros(3), 8).tolist() == [0, 1, 2]
    assert dearest_first(np.zeros(0), 8).tolist() == []


def test_forecast_of_a_grid():
    order = forecast(16, (5, 11))
    assert order.shape == (3, 2)
    assert order.points.tolist() == [16, 6, 16, 6, 8, 3]


def test_the_forecast_still_has_the_rule_that_is_mirrored():
    text = re.sub(r"\s+", "", FORECAST.read_text())
    for line in (
        "modulo(i-1+pilot_skew*(j-1),pilot_share)==0",
        "classes=24*classes_per_octave",
        "self%next_revision=self%known+merge(self%known/revision_share,self%known,self%is_ordered)+1",
        "here=(here([1,(i,i=1,columns-1)],:)+here+here([(i,i=2,columns),columns],:))/3.0_wp",
    ):
        assert line in text, f"no {line} in src/sweep/forecast.f90: change Forecast in schedule.py too"


@pytest.mark.parametrize("length", [8, 16, 32, 64, 128])
@pytest.mark.parametrize("shape", [(91, 571), (19, 115), (1, 571)])
def test_missing_points_that_make_tiles_of_a_size(length, shape):
    now = constants_of_plan()
    if not fits(length, shape):
        assert least_missing(length) > np.prod(shape)
        return
    tiles = tiles_of(length, shape)
    assert np.bincount(tiles).max() == np.prod(tile(length, shape))
    assert np.bincount(tiles, np.arange(tiles.size)) == pytest.approx(
        cut(np.arange(tiles.size, dtype=float).reshape(shape), length)
    )
    seen = np.zeros(tiles.size, bool)
    for blank in sets_of(length, tiles.size, tiles, np.random.default_rng(1)):
        assert now.length(int(blank.sum()), 1) == length
        whole = np.bincount(tiles, blank) == np.bincount(tiles)
        seen |= whole[tiles]
    assert seen.all()


def test_every_other_point():
    odd, even = sets_of_every_other((3, 5))
    assert (odd ^ even).all()
    assert odd.reshape(3, 5)[0].tolist() == [False, True, False, True, False]
    assert odd.reshape(3, 5)[1].tolist() == [True, False, True, False, True]


def test_paths_in_the_log():
    points = "points by path: {} linear (kept, one monodromy), {} shooting, {} transient (class), {} alone"
    log = f"""deck: transient.nml
start: from rest; at most 4000 mesh periods of transient a point
{points.format(31000, 200, 30, 9)}
time by path, all ranks: search 3.02 s, measurement 0.50 s, alone 1.25 s
{points.format(571, 0, 0, 0)}
time by path, all ranks: search 0.01 s, measurement 0.02 s, alone 0.00 s"""
    found = paths_in(log)
    assert found["points"] == {"linear": 31571, "shooting": 200, "transient": 30, "alone": 9}
    assert found["seconds"] == pytest.approx({"search": 3.03, "measurement": 0.52, "alone": 1.25})


def test_other_lines_of_the_log_are_no_paths():
    log = "steps: at most 4000 mesh periods of transient a point\nrigid support: 58 points on 1 ranks"
    assert paths_in(log) == {"points": {}, "seconds": {}, "lines": []}


def test_costs_between_the_measured_lengths():
    tables = np.array([[[4.0, 8.0]], [[2.0, 2.0]]])  # (length, row, speed)
    costs = Costs({"flexible": (1, 16), "rigid": (1, 16)}, flexible=tables, rigid=tables)
    assert costs.at("flexible", 1).tolist() == [[4.0, 8.0]]
    assert costs.at("flexible", 4) == pytest.approx(np.array([[3.0, 5.0]]))
    assert costs.at("rigid", 1000).tolist() == [[2.0, 2.0]]
    assert costs.least("flexible").tolist() == [[2.0, 2.0]]


def test_a_finer_grid_has_the_measured_costs():
    random = np.random.default_rng(3)
    tables = random.lognormal(size=(2, 5, 9))
    assert refined(tables, (5, 9), random) == pytest.approx(tables)
    fine = refined(tables, (41, 81), random)
    assert set(fine[0].ravel()) == set(tables[0].ravel())
    assert fine.mean() == pytest.approx(tables.mean(), rel=0.1)
    assert refined(tables[:, :1], (1, 20), random).shape == (2, 1, 20)


def test_bound_of_tiles_of_equal_points_shares_them_evenly():
    # Large tiles are cheapest, and none is too dear.
    tables = {8: np.full((8, 64), 2.0), 256: np.full((8, 64), 1.0)}
    assert tile_bound([pieces_of(tables, 0.0)], 2) == pytest.approx(256.0, rel=1e-5)


def test_bound_of_tiles_cuts_the_dear_one():
    # One of two tiles is too dear for a rank: 32 pieces at twice the cost, 2 * 2560 + 256 shared by 8.
    costs = np.ones((8, 64))
    costs[:, :32] = 10.0
    tables = {8: 2.0 * costs, 256: costs}
    assert tile_bound([pieces_of(tables, 0.0)], 8) == pytest.approx(5376.0 / 8, rel=1e-5)
    # On two ranks nothing is won by cutting: the dear tile takes longer than half of everything.
    assert tile_bound([pieces_of(tables, 0.0)], 2) == pytest.approx(2560.0, rel=1e-5)


def test_bound_of_tiles_is_the_dearest_piece_where_there_are_ranks_enough():
    tables = {8: np.full((8, 64), 2.0), 256: np.full((8, 64), 1.0)}
    assert tile_bound([pieces_of(tables, 0.5)], 1000) == pytest.approx(16.5, rel=1e-5)


def test_bound_of_parts_that_are_shared_at_once_is_below_one_after_the_other():
    rigid = pieces_of({1: np.full((1, 64), 4.0), 8: np.full((1, 64), 3.0)}, 0.0)
    flexible = pieces_of({8: np.full((8, 64), 2.0), 256: np.full((8, 64), 1.0)}, 0.0)
    at_once = tile_bound([rigid, flexible], 1000)
    assert at_once == pytest.approx(16.0, rel=1e-5)
    assert at_once < tile_bound([rigid], 1000) + tile_bound([flexible], 1000)


def test_bound_of_tiles_cuts_no_more_of_a_tile_than_is_dear():
    # A corner of 8 points is dear. At most 320 s a piece: the half without it stays whole, and three of the
    # four quarters of the other half; the last one is cut into 8 dear and 24 cheap points.
    costs = np.ones((8, 32))
    costs[0, :8] = 20.0
    tables = {8: 2.0 * costs, 32: 1.9 * costs, 128: 1.2 * costs, 256: costs}
    cost = cost_of_best_cuts(pieces_of(tables, 0.0), 320.0)
    assert cost == pytest.approx(128 * 1.2 + 96 * 1.9 + 8 * 40.0 + 24 * 2.0)
    assert cost_of_best_cuts(pieces_of(tables, 0.0), 319.0) == np.inf


def test_tiles_that_do_not_nest_are_refused():
    with pytest.raises(ValueError, match="cannot be cut"):
        pieces_of({64: np.ones((12, 64)), 96: np.ones((12, 64))}, 0.0)
