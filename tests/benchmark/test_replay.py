"""The replay of the scheduler, where its answer is known in closed form; and what is read from the log."""

import re

import numpy as np
import pytest
from costs import ALONE, Costs, every_point, pieces_of_tiles, sets_of, sets_of_every_other
from harness import paths_in
from replay import refined
from schedule import (
    CHUNK,
    FORECAST,
    PLAN,
    Chunk,
    InOrder,
    Machine,
    Work,
    constants_now,
    cost_of_best_cuts,
    dearest_first,
    lower_bound,
    most_halvings,
    part_of,
    pieces_of,
    replay,
    sizes_of,
    tile_bound,
    tiles_of,
)

NOW = constants_now()
FREE = Machine(latency=0.0, service=0.0, attendance=0.0, write=0.0)
SHORT = 1e-9  # a latency that only says who asks first
SIZES = {1: (1, 1), 8: (1, 8), 32: (2, 16), 64: (4, 16), 96: (4, 24), 128: (4, 32), 256: (8, 32)}
NEAR = Machine(latency=SHORT, service=0.0, attendance=0.0, write=0.0)


def replayed(costs, ranks, machine):
    """Time [s] of a list of pieces, handed out in its order."""
    return replay(InOrder(costs), ranks, machine)


def test_one_rank_does_everything():
    costs = [3.0, 1.0, 2.0]
    assert replayed(costs, 1, FREE) == pytest.approx(6.0)
    assert replayed(costs, 1, Machine(write=0.5)) == pytest.approx(7.5)


@pytest.mark.parametrize("ranks", [2, 3, 8, 64])
@pytest.mark.parametrize("rounds", [1, 2, 7])
def test_equal_costs_that_divide_evenly(ranks, rounds):
    assert replayed([2.0] * (ranks * rounds), ranks, NEAR) == pytest.approx(2.0 * rounds, rel=1e-6)


def test_equal_costs_with_one_piece_more():
    ranks, rounds = 8, 5
    assert replayed([1.0] * (ranks * rounds + 1), ranks, NEAR) == pytest.approx(rounds + 1.0, rel=1e-6)


def test_giant_piece_at_the_end():
    # Rank 0 and rank 1 share 100 small pieces, then one of them has the giant one alone.
    assert replayed([1.0] * 100 + [50.0], 2, NEAR) == pytest.approx(50.0 + 50.0, rel=1e-6)


def test_giant_piece_keeps_no_other_waiting():
    # Rank 1 has the giant piece and asks for no other before it is done.
    assert replayed([1.0, 50.0, 1.0] + [1.0] * 20, 2, NEAR) == pytest.approx(50.0, rel=1e-6)


def test_giant_piece_of_rank_0():
    # While rank 0 works on it, it serves the others: they do the rest.
    assert replayed([50.0] + [1.0] * 20, 2, NEAR) == pytest.approx(50.0, rel=1e-6)


def test_more_ranks_than_pieces():
    assert replayed([4.0, 4.0, 4.0], 100, NEAR) == pytest.approx(4.0, rel=1e-6)


def test_nothing_to_do():
    assert replayed([], 4, NEAR) == pytest.approx(0.0, abs=1e-6)


def test_a_round_trip_before_every_piece():
    machine = Machine(latency=0.1, service=0.0, attendance=0.0, write=0.0)
    # Rank 1 does 10 pieces in 12 s, rank 0 does 11 in 11 s and takes the last one too.
    assert replayed([1.0] * 22, 2, machine) == pytest.approx(12.0 + 3 * machine.latency, abs=0.1 + 1e-6)


def test_pieces_shorter_than_a_round_trip_wait_for_it():
    machine = Machine(latency=1.0, service=0.0, attendance=0.0, write=0.0)
    # Rank 0 does a piece every 0.1 s, rank 1 one every 2.1 s: 220 in 21 s. At the end a request, its
    # answer and the message that rank 1 has ended may still have to travel.
    time = replayed([0.1] * 220, 2, machine)
    assert 21.0 - 0.1 <= time <= 21.0 + 0.1 + 3 * machine.latency


def test_rank_0_answers_only_when_it_looks():
    often = Machine(latency=SHORT, service=0.0, attendance=0.01, write=0.0)
    seldom = Machine(latency=SHORT, service=0.0, attendance=10.0, write=0.0)
    costs = [10.0] + [0.5] * 8
    # Seldom: rank 1 gets its first piece when rank 0 is done; rank 0 then helps.
    assert replayed(costs, 2, often) == pytest.approx(10.0, rel=1e-6)
    assert replayed(costs, 2, seldom) == pytest.approx(12.0, abs=0.51)


def test_service_bounds_the_rate():
    machine = Machine(latency=SHORT, service=1.0, attendance=0.0, write=0.0)
    # Nothing but requests to answer: one a second, and one more a rank for the end.
    assert replayed([1e-6] * 50, 1000, machine) >= 50.0


def test_a_replay_is_never_below_the_bound():
    random = np.random.default_rng(7)
    for ranks in (1, 2, 5, 32):
        costs = random.lognormal(0.0, 1.5, size=300)
        assert replayed(costs, ranks, NEAR) >= lower_bound(costs, ranks) * (1 - 1e-9)


def work_of(costs, rigid=0):
    """A map whose points cost the same in pieces of every size; a row of rigid ones, that cost nothing."""
    return Work({16: costs, 256: costs}, {16: np.zeros((1, rigid))}, NOW)


def test_tiles_of_a_grid():
    tiles = tiles_of((11, 40), NOW)
    assert tiles == [Chunk(0, 8, 0, 32), Chunk(0, 8, 32, 8), Chunk(8, 3, 0, 32), Chunk(8, 3, 32, 8)]
    assert tiles_of((1, 571), NOW) == [Chunk(0, 1, 0, 256), Chunk(0, 1, 256, 256), Chunk(0, 1, 512, 59)]
    assert tiles_of((3, 100), NOW) == [Chunk(0, 3, 0, 85), Chunk(0, 3, 85, 15)]


def test_sizes_of_pieces():
    assert sizes_of((91, 571), NOW) == {256: (8, 32), 128: (4, 32), 64: (4, 16), 32: (2, 16), 16: (2, 8)}
    assert sizes_of((1, 571), NOW) == {256: (1, 256), 128: (1, 128), 64: (1, 64), 32: (1, 32), 16: (1, 16)}


@pytest.mark.parametrize("size", [(8, 32), (3, 27), (1, 59), (8, 1), (5, 5)])
def test_pieces_cover_a_chunk_once(size):
    chunk = Chunk(2, size[0], 7, size[1])
    fewest = 3
    halvings = most_halvings(chunk, fewest, NOW.aspect)
    times = np.zeros((20, 80), int)
    for number in range(2**halvings):
        part = part_of(chunk, halvings, number, NOW.aspect)
        assert part.points >= fewest
        times[part.region] += 1
    assert times.sum() == chunk.points
    assert (times[chunk.region] == 1).all()


def test_points_of_the_smallest_pieces():
    assert NOW.fewest(51961, 2) == 16
    assert NOW.fewest(2500, 1024) == 1
    assert NOW.fewest(2500, 256) == 4
    assert NOW.fewest(571, 1024) == 1


@pytest.mark.parametrize(
    ("path", "lines"),
    [
        (
            CHUNK,
            (
                "if(chunk%rows>1.and.chunk%count<=aspect*chunk%rows)then",
                "halves(1)%rows=(chunk%rows+1)/2",
                "halves(1)%count=(chunk%count+1)/2",
                "dowhile(fewest_points(chunk,halvings+1)>=fewest)",
            ),
        ),
        (
            PLAN,
            (
                "fewest=max(1,min(smallest_piece,(count(rigid_status==status_missing)"
                "+count(status==status_missing))&/(ranks*fewest_pieces)))",
                "height=max(1,min(tile_rows,size(status,2)))",
                "if(height==size(status,2))width=max(width,tile_rows*tile_speeds/height)",
            ),
        ),
        (
            FORECAST,
            (
                "modulo(i-1+pilot_skew*(j-1),pilot_share)==0",
                "classes=24*classes_per_octave",
                "self%next_revision=self%known+merge(self%known/revision_share,self%known,self%is_ordered)+1",
                "here=(here([1,(i,i=1,columns-1)],:)+here+here([(i,i=2,columns),columns],:))/3.0_wp",
                "if(self%left(chunk)==0.or..not.(self%is_ordered.or.self%is_ahead(chunk)))self%passed=self%passed+1",
                "each=max(self%expected(chunk),shortest_point)",
                "if(self%known==0)each=max(self%spent/max(self%timed,1),shortest_point)",
                "most=longest_piece/each",
                "if(self%timed==0)most=1.0_wp",
                "most=min(most,real(self%points,wp)/(self%ranks*largest_part))",
                "most=min(most,(self%at_work+self%waiting)&/(self%ranks*dearest_part*each))",
                "if(points<=most*2.0_wp**piece%halvings.and.mod(given,smallest)==0)exit",
                "dearest_first(self%order,self%expected(self%order))",
            ),
        ),
    ],
)
def test_the_sources_still_have_the_rules_that_are_mirrored(path, lines):
    text = re.sub(r"\s+", "", path.read_text())
    for line in lines:
        assert line in text, f"no {line} in {path}: change schedule.py too"


def handed_out(work, ranks):
    """All pieces in the order of a forecast that hears of each at once."""
    forecast, pieces = work.on(ranks), []
    while (piece := forecast.next()) is not None:
        pieces.append(piece)
        forecast.note(piece, forecast.cost(piece))
    return pieces


@pytest.mark.parametrize("ranks", [1, 3, 64])
@pytest.mark.parametrize("shape", [(1, 1), (1, 900), (90, 1), (41, 130), (91, 571)])
def test_every_point_is_handed_out_once_and_the_rigid_ones_first(shape, ranks):
    costs = np.random.default_rng(5).lognormal(-9.0, 1.5, size=shape)
    work = work_of(costs, rigid=shape[1])
    pieces = handed_out(work, ranks)
    rigid = [p.part for p in pieces if p.chunk < work.ahead]
    assert all(p.chunk < work.ahead for p in pieces[: len(rigid)])
    times = np.zeros(shape, int)
    for piece in pieces[len(rigid) :]:
        times[piece.part.region] += 1
    assert (times == 1).all()
    assert sum(part.points for part in rigid) == shape[1]
    assert sum(work.cost(*p) for p in pieces) == pytest.approx(costs.sum())


def test_one_rank_gets_whole_tiles():
    work = work_of(np.full((91, 571), 1e-4), rigid=571)
    first, *rest = work.chunks
    pieces = [p.part for p in handed_out(work, 1)]
    # The first one tells, in small pieces, how long points take.
    assert pieces[0] == Chunk(0, 1, 0, 16)
    assert sum(piece.points for piece in pieces if piece not in rest) == first.points
    assert set(rest) <= set(pieces)


def test_a_dear_band_comes_after_the_pilot_and_is_cut():
    costs = np.full((128, 1280), 1e-5)
    costs[:, 640:704] = 5e-4
    pieces = handed_out(work_of(costs), 32)
    cost = np.array([costs[p.part.region].sum() for p in pieces])
    dear = np.array([costs[p.part.region].max() > 1e-5 for p in pieces])
    pilot = 80
    assert dear[pilot : pilot + dear.sum() // 2].mean() > 0.8
    assert cost[pilot:].max() <= costs.sum() / 32 / NOW.dearest_part
    cheap = np.array([p.part.points for p in pieces])[~dear]
    assert cheap[cheap == 256].sum() > 0.5 * cheap.sum()


def test_a_forecast_beats_the_list():
    ranks = 8
    costs = np.full((512, 2048), 1e-6)
    costs[504:, 1760:] = 4e-5
    work = work_of(costs)
    first = replay(work.on(ranks), ranks, NEAR)
    tiles = [work.cost(c, chunk) for c, chunk in enumerate(work.chunks)]
    assert first < 0.95 * replayed(tiles, ranks, NEAR)
    assert lower_bound(costs, ranks) * (1 - 1e-9) <= first < 1.02 * lower_bound(costs, ranks)


def test_costs_of_pieces_between_the_measured_sizes():
    costs = np.random.default_rng(3).lognormal(size=(16, 64))
    work = Work({16: 3.0 * costs, 64: costs}, {16: np.zeros((1, 0))}, NOW)
    part = Chunk(3, 4, 20, 8)
    assert work.cost(0, part) == pytest.approx(2.0 * costs[part.region].sum())
    assert work.cost(0, part._replace(count=16)) == pytest.approx(costs[3:7, 20:36].sum())
    assert work.cost(0, part._replace(rows=1)) == pytest.approx(3.0 * costs[3:4, 20:28].sum())


def test_dearest_first_by_classes():
    assert dearest_first(np.array([1.0, 8.0, 0.99, 0.0, 2.0]), 8).tolist() == [1, 4, 0, 2, 3]
    assert dearest_first(np.zeros(3), 8).tolist() == [0, 1, 2]
    assert dearest_first(np.zeros(0), 8).tolist() == []


@pytest.mark.parametrize("shape", [(91, 571), (19, 115)])
def test_pieces_that_are_measured_cover_the_grid(shape):
    for length in sizes_of(shape, NOW):
        pieces = pieces_of_tiles(length, shape, NOW)
        # At the ends of the grid they are between this size and twice that.
        assert length <= np.bincount(pieces).max() < 2 * length
        times = np.zeros(pieces.size, int)
        for blank in sets_of(length, shape, NOW):
            times += blank
            # Whole pieces, of every tile one at most.
            assert set(np.unique(pieces[blank])).isdisjoint(pieces[~blank])
            for tile in tiles_of(shape, NOW):
                assert blank.reshape(shape)[tile.region].sum() < 2 * length
        assert (times == 1).all()


def test_every_other_point():
    odd, even = sets_of_every_other((3, 5))
    assert (odd ^ even).all()
    assert odd.reshape(3, 5)[0].tolist() == [False, True, False, True, False]
    assert odd.reshape(3, 5)[1].tolist() == [True, False, True, False, True]
    assert every_point((3, 5)).tolist() == list(range(15))


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
    log = "steps: at most 4000 mesh periods of transient a point\n58 points on 1 ranks"
    assert paths_in(log) == {"points": {}, "seconds": {}, "lines": []}


def test_least_costs():
    flexible = {ALONE: np.array([[4.0, 8.0]]), 16: np.array([[2.0, 3.0]])}
    costs = Costs(flexible, rigid={ALONE: np.ones((1, 2))})
    assert costs.least("flexible").tolist() == [[2.0, 3.0]]
    assert costs.least("rigid").tolist() == [[1.0, 1.0]]


def test_a_finer_grid_has_the_measured_costs():
    random = np.random.default_rng(3)
    tables = {n: random.lognormal(size=(5, 9)) for n in (1, 16)}
    same = refined(tables, (5, 9), random)
    assert all(same[n] == pytest.approx(tables[n]) for n in tables)
    fine = refined(tables, (41, 81), random)
    assert set(fine[16].ravel()) == set(tables[16].ravel())
    assert fine[16].mean() == pytest.approx(tables[16].mean(), rel=0.1)
    assert refined({1: tables[1][:1]}, (1, 20), random)[1].shape == (1, 20)


def test_bound_of_tiles_of_equal_points_shares_them_evenly():
    # Large tiles are cheapest, and none is too dear.
    tables = {8: np.full((8, 64), 2.0), 256: np.full((8, 64), 1.0)}
    assert tile_bound([pieces_of(tables, SIZES, 0.0)], 2) == pytest.approx(256.0, rel=1e-5)


def test_bound_of_tiles_cuts_the_dear_one():
    # One of two tiles is too dear for a rank: 32 pieces at twice the cost, 2 * 2560 + 256 shared by 8.
    costs = np.ones((8, 64))
    costs[:, :32] = 10.0
    tables = {8: 2.0 * costs, 256: costs}
    assert tile_bound([pieces_of(tables, SIZES, 0.0)], 8) == pytest.approx(5376.0 / 8, rel=1e-5)
    # On two ranks nothing is won by cutting: the dear tile takes longer than half of everything.
    assert tile_bound([pieces_of(tables, SIZES, 0.0)], 2) == pytest.approx(2560.0, rel=1e-5)


def test_bound_of_tiles_is_the_dearest_piece_where_there_are_ranks_enough():
    tables = {8: np.full((8, 64), 2.0), 256: np.full((8, 64), 1.0)}
    assert tile_bound([pieces_of(tables, SIZES, 0.5)], 1000) == pytest.approx(16.5, rel=1e-5)


def test_bound_of_parts_that_are_shared_at_once_is_below_one_after_the_other():
    rigid = pieces_of({1: np.full((1, 64), 4.0), 8: np.full((1, 64), 3.0)}, SIZES, 0.0)
    flexible = pieces_of({8: np.full((8, 64), 2.0), 256: np.full((8, 64), 1.0)}, SIZES, 0.0)
    at_once = tile_bound([rigid, flexible], 1000)
    assert at_once == pytest.approx(16.0, rel=1e-5)
    assert at_once < tile_bound([rigid], 1000) + tile_bound([flexible], 1000)


def test_bound_of_tiles_cuts_no_more_of_a_tile_than_is_dear():
    # A corner of 8 points is dear. At most 320 s a piece: the half without it stays whole, and three of the
    # four quarters of the other half; the last one is cut into 8 dear and 24 cheap points.
    costs = np.ones((8, 32))
    costs[0, :8] = 20.0
    tables = {8: 2.0 * costs, 32: 1.9 * costs, 128: 1.2 * costs, 256: costs}
    cost = cost_of_best_cuts(pieces_of(tables, SIZES, 0.0), 320.0)
    assert cost == pytest.approx(128 * 1.2 + 96 * 1.9 + 8 * 40.0 + 24 * 2.0)
    assert cost_of_best_cuts(pieces_of(tables, SIZES, 0.0), 319.0) == np.inf


def test_tiles_that_do_not_nest_are_refused():
    with pytest.raises(ValueError, match="cannot be cut"):
        pieces_of({64: np.ones((12, 64)), 96: np.ones((12, 64))}, SIZES, 0.0)
