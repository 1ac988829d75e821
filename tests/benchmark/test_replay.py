"""The replay of the scheduler, where its answer is known in closed form; and what is read from the log."""

import re

import numpy as np
import pytest
from costs import Costs
from harness import paths_in
from replay import refined
from schedule import PLAN, Constants, Machine, constants_of_plan, cut, lower_bound, replay

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


def test_giant_chunk_keeps_the_next_one_waiting():
    # Rank 1 begins the giant chunk and has asked for the next one already, which nobody else can do.
    assert replay([1.0, 50.0, 1.0] + [1.0] * 20, 2, NEAR) == pytest.approx(51.0, rel=1e-6)


def test_giant_chunk_of_rank_0():
    # While rank 0 works on it, it serves the others: they do the rest.
    assert replay([50.0] + [1.0] * 20, 2, NEAR) == pytest.approx(50.0, rel=1e-6)


def test_more_ranks_than_chunks():
    assert replay([4.0, 4.0, 4.0], 100, NEAR) == pytest.approx(4.0, rel=1e-6)


def test_nothing_to_do():
    assert replay([], 4, NEAR) == pytest.approx(0.0, abs=1e-6)


def test_latency_is_hidden_behind_a_longer_chunk():
    machine = Machine(latency=0.1, service=0.0, attendance=0.0, write=0.0)
    # Rank 1 starts a round trip late; its last answer, that there is nothing left, takes another one.
    time = replay([1.0] * 20, 2, machine)
    assert 10.0 <= time <= 10.0 + 4 * machine.latency


def test_chunks_shorter_than_a_round_trip_wait_for_it():
    machine = Machine(latency=1.0, service=0.0, attendance=0.0, write=0.0)
    # Rank 0 does a chunk every 0.1 s, rank 1 gets one every 2 s: 210 in 20 s. At the end a request, its
    # answer and the message that rank 1 has ended may still have to travel.
    time = replay([0.1] * 210, 2, machine)
    assert 20.0 - 0.1 <= time <= 20.0 + 0.1 + 3 * machine.latency


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


def test_chunks_do_not_cross_rows():
    costs = np.arange(14.0).reshape(2, 7)
    assert cut(costs, 3).tolist() == [3.0, 12.0, 6.0, 24.0, 33.0, 13.0]
    assert cut(costs, 100).tolist() == [21.0, 70.0]
    assert cut(costs, 1).tolist() == costs.reshape(-1).tolist()


def test_length_of_chunks():
    constants = Constants(largest_chunk=32, chunks_per_rank=16)
    assert constants.length(51961, 2) == 32
    assert constants.length(51961, 1024) == 3
    assert constants.length(571, 1024) == 1


def test_the_plan_still_has_the_rule_that_is_mirrored():
    text = re.sub(r"\s+", "", PLAN.read_text())
    assert re.search(r"length=max\(1,min\(largest_chunk,[^!]*?/\(ranks\*chunks_per_rank\)\)\)", text), (
        "the rule of src/sweep/plan.f90 has changed: change Constants.length and cut in schedule.py too"
    )
    constants = constants_of_plan()
    assert constants.largest_chunk >= 1
    assert constants.chunks_per_rank >= 1


@pytest.mark.parametrize(
    "log",
    [
        "points by path: 31000 linear, 200 shooting, 30 transient, 9 chaotic\ntime: linear 0.5 s, chaos 2 s",
        "by path: linear 31,000 (0.50 s), shooting 200, transient 30, chaos 9 (2.0 s)",
        "  linear: 31000 points, 0.5 s\n  shooting: 200 points\n  transient 30\n  chaos  9  2.0 s",
    ],
)
def test_paths_in_the_log(log):
    found = paths_in("deck: chaos.nml 3\nsteps: at most 4000 periods of transient\n" + log)
    assert found["points"] == {"linear": 31000, "shooting": 200, "transient": 30, "chaos": 9}
    assert found["seconds"] == {"linear": 0.5, "chaos": 2.0}


def test_other_lines_of_the_log_are_no_paths():
    log = "steps: at most 4000 mesh periods of transient a point\nrigid support: 58 points on 1 ranks"
    assert paths_in(log) == {"points": {}, "seconds": {}, "lines": []}


def test_costs_between_the_measured_lengths():
    tables = np.array([[[4.0, 8.0]], [[2.0, 2.0]]])  # (length, row, speed)
    costs = Costs((1, 16), flexible=tables, rigid=tables)
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
