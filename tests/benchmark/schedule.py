"""The program's rule of scheduling, replayed: which rank gets which chunk, and when it is done.

Mirrors src/sweep/plan.f90 (how chunks are cut), src/sweep/forecast.f90 (in which order they are handed
out) and src/sweep/schedule.f90 (how).
"""

import heapq
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
PLAN = ROOT / "src" / "sweep" / "plan.f90"
FORECAST = ROOT / "src" / "sweep" / "forecast.f90"
FORECAST_PARAMETERS = (
    "pilot_share",
    "pilot_skew",
    "speed_step",
    "row_step",
    "classes_per_octave",
    "revision_share",
)
ATTENDANCE = ROOT / "src" / "sweep" / "attendance.f90"

BOUND_TOLERANCE = 1e-5  # of a time that is bisected, far below what costs scatter by


@dataclass(frozen=True)
class Constants:
    """The constants of the plan."""

    largest_chunk: int
    chunks_per_rank: int
    smallest_chunk: int = 8
    fewest_chunks: int = 2

    def length(self, missing, ranks):
        """Points that a chunk is meant to have."""
        wanted = min(self.largest_chunk, missing // (ranks * self.chunks_per_rank))
        least = min(self.smallest_chunk, missing // (ranks * self.fewest_chunks))
        return max(1, least, wanted)


@dataclass(frozen=True)
class Machine:
    """What a message and a written chunk cost, in seconds."""

    latency: float = 5e-6  # one way
    service: float = 1e-6  # of rank 0, to receive a request and to answer it
    attendance: float = 0.5e-3  # rank 0 looks at the messages so often while it works
    write: float = 2e-4  # to write a chunk, whatever its size


def parameter(path, name):
    """Value of a Fortran parameter of a source file."""
    number = r"([-+.\d]+(?:e[-+]?\d+)?)"
    found = re.search(rf"parameter\s*::(?:.*,)?\s*{name}\s*=\s*{number}", path.read_text(), flags=re.I)
    if not found:
        raise RuntimeError(f"{path}: no parameter {name}")
    return float(found[1])


def constants_of_plan(path=PLAN):
    """The constants as they stand in the plan."""
    return Constants(*(int(parameter(path, field)) for field in Constants.__dataclass_fields__))


def tile(length, shape):
    """Rows and speeds of a chunk that is meant to have so many points, on a grid (row, speed).

    Mirrors cut_rows in src/sweep/plan.f90 for points that do not continue each other: some `aspect` times
    as wide as high and a power of two, wider where the grid has few rows, as the one row of the rigid
    support.
    """
    rows, speeds = shape
    aspect = int(parameter(PLAN, "aspect"))
    width = 1
    while 2 * width**2 <= aspect * length and 2 * width <= length and width < speeds:
        width *= 2
    width = min(width, speeds)
    height = max(1, min(length // width, rows))
    return height, max(1, min(length // height, speeds)) if height == rows else width


def cut(costs, length):
    """Costs of the chunks, in the order in which they are handed out; `costs` of the points is (row, speed).

    Mirrors cut_rows for a grid of which every point is missing: tiles of a fixed size, row of tiles by row
    of tiles, softest support first; at the ends of the grid what is left of them.
    """
    return over_tiles(np.add, costs, tile(length, costs.shape)).reshape(-1)


def over_tiles(function, values, size):
    """A ufunc such as `np.add` over each tile of a size (rows, speeds), from the first row and speed on."""
    rows, speeds = (np.arange(0, n, step) for n, step in zip(values.shape, size, strict=True))
    return function.reduceat(function.reduceat(values, rows, axis=0), speeds, axis=1)


class InOrder:
    """Chunks in the order of the list."""

    def __init__(self, chunks):
        self.order = iter(range(chunks))

    def next(self):
        """The next chunk to hand out."""
        return next(self.order)

    def note(self, chunk, seconds):
        """Learns nothing."""


class Forecast:
    """A pilot, then dearest first. Mirrors src/sweep/forecast.f90 for a grid of tiles."""

    def __init__(self, shape, points):
        """`shape`: tiles in both directions (row, speed); `points` of each tile, flat."""
        value = {name: int(parameter(FORECAST, name)) for name in FORECAST_PARAMETERS}
        share, skew, self.per_octave = (value[n] for n in ("pilot_share", "pilot_skew", "classes_per_octave"))
        self.speed_step, self.row_step = value["speed_step"], value["row_step"]
        self.revision_share = value["revision_share"]
        row, speed = np.indices(shape)
        in_pilot = ((speed + skew * row) % share == 0).reshape(-1)
        numbers = np.arange(in_pilot.size)
        self.order = np.concatenate([numbers[in_pilot], numbers[~in_pilot]])
        self.pilot = int(in_pilot.sum())
        self.shape, self.points = shape, np.asarray(points, float)
        self.seconds = np.full(in_pilot.size, np.nan)
        self.handed_out = self.known = 0
        self.ordered = False
        self.next_revision = 1

    def next(self):
        """The next chunk to hand out."""
        if self.handed_out >= self.pilot and not self.ordered:
            self.revise()
        self.handed_out += 1
        return int(self.order[self.handed_out - 1])

    def note(self, chunk, seconds):
        """A chunk has taken its time."""
        self.seconds[chunk] = seconds
        self.known += 1
        if self.known >= self.next_revision:
            self.revise()

    def revise(self):
        """Put the chunks that are neither handed out nor in the pilot in order."""
        # Before the pilot is handed out, the program changes only its estimate of the time.
        self.ordered = self.handed_out >= self.pilot
        step = self.known // self.revision_share if self.ordered else self.known
        self.next_revision = self.known + step + 1
        if not self.ordered or self.known == 0:
            return
        expected = self.points * self.rates()
        rest = self.order[self.handed_out :]
        self.order[self.handed_out :] = rest[dearest_first(expected[rest], self.per_octave)]

    def rates(self):
        """What a point of each tile costs: the mean over what is known nearest to it and its neighbours."""
        here = (self.seconds / self.points)[self.nearest()].reshape(self.shape)
        for axis in (1, 0):
            last = self.shape[axis] - 1
            at = np.arange(last + 1)
            below, above = (here.take(np.clip(at + step, 0, last), axis) for step in (-1, 1))
            here = (below + here + above) / 3.0
        return here.reshape(-1)

    def nearest(self):
        """For each tile the nearest one of which the time is known."""
        tiles = self.seconds.size
        far = tiles * (self.shape[1] * self.speed_step + self.shape[0] * self.row_step)
        key = (np.where(np.isfinite(self.seconds), 0, far) + np.arange(tiles)).reshape(self.shape)
        for axis, step in ((1, self.speed_step), (0, self.row_step)):
            way = tiles * step * np.arange(self.shape[axis])
            way = way[None, :] if axis == 1 else way[:, None]
            forward = np.minimum.accumulate(key - way, axis=axis) + way
            backward = np.flip(np.minimum.accumulate(np.flip(key + way, axis), axis=axis), axis) - way
            key = np.minimum(forward, backward)
        return (key % tiles).reshape(-1)


def dearest_first(costs, per_octave):
    """Order by cost to within a class, equal ones as they are."""
    if not costs.size:
        return np.arange(0)
    least = np.finfo(float).tiny
    octaves = -np.log2(np.maximum(costs, least) / max(costs.max(), least))
    last = 24 * per_octave - 1
    return np.argsort(np.minimum(last, (per_octave * octaves).astype(int)), kind="stable")


def forecast(length, shape):
    """The forecast of tiles that are meant to have so many points, on a grid (row, speed)."""
    tiles = tuple(-(-n // step) for n, step in zip(shape, tile(length, shape), strict=True))
    return Forecast(tiles, cut(np.ones(shape), length))


def replay(costs, ranks, machine, order=None):
    """Time [s] until all ranks have done chunks of these costs, handed out in an order: that of the list.

    Mirrors src/sweep/schedule.f90. A rank that has done a chunk tells its time and asks for the next one.
    Rank 0 works too; it answers the requests that have come when it takes a chunk itself and every
    `attendance` seconds in between, and at once when no chunk is left.
    """
    costs = [float(c) + machine.write for c in costs]
    order = InOrder(len(costs)) if order is None else order
    chunks = len(costs)
    if ranks == 1:
        return sum(costs)
    free = [0.0] * ranks
    requests = [(machine.latency, r) for r in range(1, ranks)]  # sorted, so a heap
    in_hand = [None] * ranks
    given = 0
    clock = 0.0
    left = 0.0  # work that rank 0 still has on its chunk
    step = machine.attendance

    while True:
        # Rank 0 looks at its messages.
        while requests and requests[0][0] <= clock:
            rank = requests[0][1]
            clock += machine.service
            if in_hand[rank] is not None:
                order.note(in_hand[rank], costs[in_hand[rank]])
            free[rank] = clock + machine.latency
            if given < chunks:
                in_hand[rank] = order.next()
                free[rank] += costs[in_hand[rank]]
                given += 1
                heapq.heapreplace(requests, (free[rank] + machine.latency, rank))
            else:
                heapq.heappop(requests)
        # It goes on with its chunk, or takes one.
        if left <= 0.0:
            if given == chunks:
                if not requests:
                    break
                clock = max(clock, requests[0][0])
                continue
            if in_hand[0] is not None:
                order.note(in_hand[0], costs[in_hand[0]])
            in_hand[0] = order.next()
            left = costs[in_hand[0]]
            given += 1
        # It works until it looks and finds something, or until its chunk is done.
        look = clock + left
        if requests:
            wait = max(0.0, requests[0][0] - clock)
            look = clock + step * max(1.0, -(-wait // step)) if step > 0.0 else clock + wait
        if look < clock + left:
            left -= look - clock
            clock = look
        else:
            clock += left
            left = 0.0
    # The ranks say that they have ended.
    return max(clock, *free) + machine.latency


def lower_bound(costs, ranks):
    """No schedule of these pieces can be done earlier [s]."""
    return max(float(np.sum(costs)) / ranks, float(np.max(costs, initial=0.0)))


def tile_bound(parts, ranks):
    """No schedule of tiles can be done earlier [s], not even one that knew all costs before.

    `parts`: what is shared at once, of each part its `pieces_of`. A long time lets tiles be large, in which
    a point costs less, but none must take longer than all: the least time in which the ranks, sharing
    evenly, can do what the best cuts cost.
    """
    too_short, long_enough = 0.0, sum(cost_of_best_cuts(pieces, np.inf) for pieces in parts)
    while long_enough - too_short > BOUND_TOLERANCE * long_enough:
        seconds = 0.5 * (too_short + long_enough)
        if sum(cost_of_best_cuts(pieces, seconds) for pieces in parts) <= ranks * seconds:
            long_enough = seconds
        else:
            too_short = seconds
    return long_enough


def pieces_of(tables, write):
    """Size (rows, speeds) and costs (row, column) of the tiles of each length, the smallest first.

    `tables`: costs of the points, (row, speed), by the length of their tiles; each tile takes `write`
    seconds more. ValueError where tiles of a length cannot be cut into those of the one before.
    """
    pieces = []
    for length, costs in sorted(tables.items()):
        size = tile(length, costs.shape)
        if pieces and any(large % small for large, small in zip(size, pieces[-1][0], strict=True)):
            raise ValueError(f"tiles of {length} points cannot be cut into tiles of {pieces[-1][0]}")
        pieces.append((size, over_tiles(np.add, costs, size) + write))
    return pieces


def cost_of_best_cuts(pieces, seconds):
    """Least cost [s] of all tiles, each whole or cut, its parts again; none takes longer than `seconds`.

    Infinite where one of the smallest does.
    """
    below, best = None, None
    for size, costs in pieces:
        whole = np.where(costs <= seconds, costs, np.inf)
        if best is not None:
            inside = tuple(large // small for large, small in zip(size, below, strict=True))
            whole = np.minimum(whole, over_tiles(np.add, best, inside))
        below, best = size, whole
    return float(best.sum())
