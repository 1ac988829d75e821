"""The program's rule of scheduling, replayed: which rank gets which piece, and when it is done.

Mirrors src/sweep/chunk.f90 and src/sweep/plan.f90 (where the grid is cut), src/sweep/forecast.f90 (what is
handed out next, and how large) and src/sweep/schedule.f90 (how).
"""

import heapq
import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
SWEEP = ROOT / "src" / "sweep"
CHUNK, PLAN, FORECAST = (SWEEP / f"{name}.f90" for name in ("chunk", "plan", "forecast"))
ATTENDANCE = SWEEP / "attendance.f90"

BOUND_TOLERANCE = 1e-5  # of a time that is bisected, far below what costs scatter by


@dataclass(frozen=True)
class Constants:
    """The constants of the plan and of the forecast."""

    aspect: int
    tile_rows: int
    tile_speeds: int
    smallest_piece: int
    fewest_pieces: int
    pilot_share: int
    pilot_skew: int
    largest_part: int
    dearest_part: int
    longest_piece: float
    shortest_point: float
    speed_step: int
    row_step: int
    revision_share: int
    classes_per_octave: int

    def fewest(self, missing, ranks):
        """Points that no piece is smaller than."""
        return max(1, min(self.smallest_piece, missing // (ranks * self.fewest_pieces)))


@dataclass(frozen=True)
class Machine:
    """What a message and a written piece cost, in seconds."""

    latency: float = 5e-6  # one way
    service: float = 1e-6  # of rank 0, to receive a request and to answer it
    attendance: float = 0.5e-3  # rank 0 looks at the messages so often while it works
    write: float = 2e-4  # to write a piece, whatever its size


def parameter(path, name):
    """Value of a Fortran parameter of a source file."""
    number = r"([-+.\d]+(?:e[-+]?\d+)?)"
    found = re.search(rf"parameter\s*::(?:.*,)?\s*{name}\s*=\s*{number}", path.read_text(), flags=re.I)
    if not found:
        raise RuntimeError(f"{path}: no parameter {name}")
    return float(found[1])


def constants_now():
    """The constants as they stand in the sources."""
    where = dict.fromkeys(("tile_rows", "tile_speeds", "smallest_piece", "fewest_pieces"), PLAN)
    where["aspect"] = CHUNK
    fields = Constants.__dataclass_fields__
    return Constants(**{n: f.type(parameter(where.get(n, FORECAST), n)) for n, f in fields.items()})


# Where the grid is cut ---------------------------------------------------------------------------


class Chunk(NamedTuple):
    """Neighbouring speeds of some neighbouring rows, counted from 0."""

    row: int
    rows: int
    first: int
    count: int

    @property
    def points(self):
        """How many it has."""
        return self.rows * self.count

    @property
    def region(self):
        """Where they are on a grid (row, speed)."""
        return np.s_[self.row : self.row + self.rows, self.first : self.first + self.count]

    def halves(self, aspect):
        """Its halves, the first one never smaller."""
        if self.rows > 1 and self.count <= aspect * self.rows:
            near = -(-self.rows // 2)
            return self._replace(rows=near), self._replace(row=self.row + near, rows=self.rows - near)
        near = -(-self.count // 2)
        return self._replace(count=near), self._replace(first=self.first + near, count=self.count - near)


def part_of(chunk, halvings, number, aspect):
    """Piece of a chunk that is halved so often."""
    for k in reversed(range(halvings)):
        chunk = chunk.halves(aspect)[number >> k & 1]
    return chunk


def most_halvings(chunk, fewest, aspect):
    """How often a chunk can be halved until a piece has fewer points than wanted."""
    pieces, halvings = [chunk], 0
    while True:
        pieces = [half for piece in pieces for half in piece.halves(aspect)]
        if min(piece.points for piece in pieces) < fewest:
            return halvings
        halvings += 1


def tile_size(shape, constants):
    """Rows and speeds of a tile of a grid (row, speed); wider where there are few rows."""
    height = min(constants.tile_rows, shape[0])
    few = height == shape[0]
    wide = constants.tile_rows * constants.tile_speeds // height
    return height, max(constants.tile_speeds, wide) if few else constants.tile_speeds


def tiles_of(shape, constants):
    """The tiles of a grid (row, speed) of which every point is missing."""
    height, width = tile_size(shape, constants)
    return [
        Chunk(row, min(height, shape[0] - row), first, min(width, shape[1] - first))
        for row in range(0, shape[0], height)
        for first in range(0, shape[1], width)
    ]


def sizes_of(shape, constants):
    """Points of a whole tile, its halves and so on: rows and speeds of each, by their points."""
    height, width = tile_size(shape, constants)
    tile = Chunk(0, height, 0, width)
    sizes = {}
    while tile.points >= constants.smallest_piece:
        sizes[tile.points] = (tile.rows, tile.count)
        tile = tile.halves(constants.aspect)[0]
    return sizes


def over_tiles(function, values, size):
    """A ufunc such as `np.add` over each tile of a size (rows, speeds), from the first row and speed on."""
    rows, speeds = (np.arange(0, n, step) for n, step in zip(values.shape, size, strict=True))
    return function.reduceat(function.reduceat(values, rows, axis=0), speeds, axis=1)


# What is handed out ------------------------------------------------------------------------------


class InOrder:
    """Work of known costs [s], in the order of a list."""

    def __init__(self, costs):
        self.costs = [float(c) for c in costs]
        self.given = 0

    def next(self):
        """The next piece to hand out; None if none is left."""
        if self.given == len(self.costs):
            return None
        self.given += 1
        return self.given - 1

    def cost(self, piece):
        """Seconds that it takes."""
        return self.costs[piece]

    def note(self, piece, seconds):
        """Learns nothing."""


class Work:
    """A map: tiles on the flexible support, those on the rigid one ahead, and what pieces of them cost.

    `flexible` and `rigid`: costs of the points, (row, speed), by the points of the pieces that they are in;
    between those a point costs what lies between, by the logarithm of the points.
    """

    def __init__(self, flexible, rigid, constants):
        self.constants = constants
        self.grids = [shape_of(rigid), shape_of(flexible)]
        self.tables = [summed(rigid), summed(flexible)]
        ahead, rest = (tiles_of(grid, constants) for grid in self.grids)
        self.chunks = ahead + rest
        self.ahead = len(ahead)
        self.points = np.array([c.points for c in self.chunks])

    def cost(self, chunk, part):
        """Seconds that a piece of a chunk takes, without writing it."""
        lengths, sums = self.tables[int(chunk >= self.ahead)]
        place = np.interp(np.log(part.points), np.log(lengths), np.arange(len(lengths)))
        below = min(int(place), max(len(lengths) - 2, 0))
        above = min(below + 1, len(lengths) - 1)
        rows, speeds = (part.row, part.row + part.rows), (part.first, part.first + part.count)
        low, high = (
            s[rows[1], speeds[1]] - s[rows[0], speeds[1]] - s[rows[1], speeds[0]] + s[rows[0], speeds[0]]
            for s in (sums[below], sums[above])
        )
        return float(low + (place - below) * (high - low))

    def on(self, ranks):
        """The forecast on so many ranks, from the beginning."""
        return Forecast(self, ranks)


def shape_of(tables):
    """Rows and speeds of tables of costs."""
    return next(iter(tables.values())).shape


def summed(tables):
    """Lengths, and the sums of the costs over all rows and speeds before each, for costs of any region."""
    lengths = sorted(tables)
    return lengths, [np.pad(tables[n], ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1) for n in lengths]


class Piece(NamedTuple):
    """A piece of a chunk that is handed out."""

    chunk: int
    part: Chunk


class Forecast:
    """The rigid support, a pilot, then dearest first, in pieces. Mirrors src/sweep/forecast.f90."""

    def __init__(self, work, ranks):
        self.work, self.ranks, self.now = work, ranks, work.constants
        now, chunks = self.now, work.chunks
        height, width = tile_size(work.grids[1], now)
        self.shape = tuple(-(-n // step) for n, step in zip(work.grids[1], (height, width), strict=True))
        row, speed = np.indices(self.shape)
        in_pilot = ((speed + now.pilot_skew * row) % now.pilot_share == 0).reshape(-1)
        self.order = [*range(work.ahead), *(work.ahead + np.flatnonzero(in_pilot)).tolist()]
        self.passed = self.known = self.pieces = 0
        self.ordered = False
        fewest = now.fewest(int(work.points.sum()), ranks)
        seen = {}
        for c in chunks:
            if c[1::2] not in seen:
                seen[c[1::2]] = most_halvings(c, fewest, now.aspect)
        self.halvings = [seen[c[1::2]] for c in chunks]
        self.given = [0] * len(chunks)
        self.left = work.points.copy()
        self.out = np.zeros(len(chunks), int)
        self.expected = np.zeros(len(chunks))
        tiles = len(chunks) - work.ahead
        self.seconds, self.counted = np.zeros(tiles), np.zeros(tiles)
        self.next_revision = 1
        self.timed, self.spent = 0, 0.0
        self.at_work = self.waiting = 0.0

    def next(self):
        """The next piece to hand out; None if none is left."""
        if self.passed == len(self.order) and not self.ordered:
            self.revise()
        if self.passed == len(self.order):
            return None
        chunk = self.order[self.passed]
        part = self.cut(chunk)
        self.pieces += 1
        self.left[chunk] -= part.points
        self.out[chunk] += part.points
        self.at_work += part.points * self.expected[chunk]
        self.waiting -= part.points * self.expected[chunk]
        if self.left[chunk] == 0 or not (self.ordered or chunk < self.work.ahead):
            self.passed += 1
        return Piece(chunk, part)

    def cut(self, chunk):
        """The largest piece that is not too dear and begins where the last one ended."""
        now, points = self.now, self.work.chunks[chunk].points
        each = self.expected[chunk] if self.known else self.spent / max(self.timed, 1)
        each = max(each, now.shortest_point)
        most = now.longest_piece / each if self.timed else 1.0
        if self.ranks > 1:
            most = min(most, int(self.work.points.sum()) / (self.ranks * now.largest_part))
            if self.ordered and self.known:
                most = min(most, (self.at_work + self.waiting) / (self.ranks * now.dearest_part * each))
        halvings, given = 0, self.given[chunk]
        while halvings < self.halvings[chunk]:
            if points <= most * 2**halvings and given % 2 ** (self.halvings[chunk] - halvings) == 0:
                break
            halvings += 1
        smallest = 2 ** (self.halvings[chunk] - halvings)
        self.given[chunk] += smallest
        return part_of(self.work.chunks[chunk], halvings, given // smallest, now.aspect)

    def cost(self, piece):
        """Seconds that it takes."""
        return self.work.cost(*piece)

    def note(self, piece, seconds):
        """A piece has taken its time."""
        chunk, points = piece.chunk, piece.part.points
        self.out[chunk] -= points
        self.at_work -= points * self.expected[chunk]
        self.timed += points
        self.spent += seconds
        if chunk < self.work.ahead:
            return
        self.known += points
        self.seconds[chunk - self.work.ahead] += seconds
        self.counted[chunk - self.work.ahead] += points
        if self.known >= self.next_revision:
            self.revise()

    def revise(self):
        """Expect other times; once the pilot is handed out, put in order what is left."""
        self.ordered = self.ordered or self.passed == len(self.order)
        step = self.known // self.now.revision_share if self.ordered else self.known
        self.next_revision = self.known + step + 1
        if self.known:
            self.expected[self.work.ahead :] = self.rates()
            self.at_work = float(self.out @ self.expected)
            self.waiting = float(self.left @ self.expected)
        if self.ordered:
            rest = np.flatnonzero(self.left)
            self.order = rest[dearest_first(self.expected[rest], self.now.classes_per_octave)].tolist()
            self.passed = 0

    def rates(self):
        """What a point of each tile costs: the mean over what is known nearest to it and its neighbours."""
        nearest = self.nearest()
        here = (self.seconds[nearest] / self.counted[nearest]).reshape(self.shape)
        for axis in (1, 0):
            last = self.shape[axis] - 1
            at = np.arange(last + 1)
            below, above = (here.take(np.clip(at + step, 0, last), axis) for step in (-1, 1))
            here = (below + here + above) / 3.0
        return here.reshape(-1)

    def nearest(self):
        """For each tile the nearest one of which a time is known."""
        tiles, now = self.counted.size, self.now
        far = tiles * (self.shape[1] * now.speed_step + self.shape[0] * now.row_step)
        key = (np.where(self.counted > 0.0, 0, far) + np.arange(tiles)).reshape(self.shape)
        for axis, step in ((1, now.speed_step), (0, now.row_step)):
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


def replay(work, ranks, machine):
    """Time [s] until all ranks have done the pieces of some work (`InOrder` or `Forecast`).

    Mirrors src/sweep/schedule.f90. A rank that has done a piece tells its time and asks for the next one.
    Rank 0 works too; it answers the requests that have come when it takes a piece itself and every
    `attendance` seconds in between, and at once when no piece is left.
    """
    free = [0.0] * ranks
    requests = [(machine.latency, r) for r in range(1, ranks)]  # sorted, so a heap
    in_hand, seconds = [None] * ranks, [0.0] * ranks
    exhausted = False
    clock = 0.0
    left = 0.0  # work that rank 0 still has on its piece
    step = machine.attendance

    def take(rank):
        """Tell of the piece that is done, take another; whether there is one."""
        nonlocal exhausted
        if in_hand[rank] is not None:
            work.note(in_hand[rank], seconds[rank])
        in_hand[rank] = None if exhausted else work.next()
        exhausted = in_hand[rank] is None
        if not exhausted:
            seconds[rank] = work.cost(in_hand[rank]) + machine.write
        return not exhausted

    while True:
        # Rank 0 looks at its messages.
        while requests and requests[0][0] <= clock:
            rank = requests[0][1]
            clock += machine.service
            free[rank] = clock + machine.latency
            if take(rank):
                free[rank] += seconds[rank]
                heapq.heapreplace(requests, (free[rank] + machine.latency, rank))
            else:
                heapq.heappop(requests)
        # It goes on with its piece, or takes one.
        if left <= 0.0:
            if not take(0):
                if not requests:
                    break
                clock = max(clock, requests[0][0])
                continue
            left = seconds[0]
        # It works until it looks and finds something, or until its piece is done.
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
    return max(clock, *free) + machine.latency if ranks > 1 else clock


# Bounds ------------------------------------------------------------------------------------------


def lower_bound(costs, ranks):
    """No schedule of these pieces can be done earlier [s]."""
    return max(float(np.sum(costs)) / ranks, float(np.max(costs, initial=0.0)))


def tile_bound(parts, ranks):
    """No schedule of tiles can be done earlier [s], not even one that knew all costs before.

    `parts`: what is shared, of each part its `pieces_of`. A long time lets tiles be large, in which a point
    costs less, but none must take longer than all: the least time in which the ranks, sharing evenly, can
    do what the best cuts cost.
    """
    too_short, long_enough = 0.0, sum(cost_of_best_cuts(pieces, np.inf) for pieces in parts)
    while long_enough - too_short > BOUND_TOLERANCE * long_enough:
        seconds = 0.5 * (too_short + long_enough)
        if sum(cost_of_best_cuts(pieces, seconds) for pieces in parts) <= ranks * seconds:
            long_enough = seconds
        else:
            too_short = seconds
    return long_enough


def pieces_of(tables, sizes, write):
    """Size (rows, speeds) and costs (row, column) of the tiles of each length, the smallest first.

    `tables`: costs of the points, (row, speed), by the points of their tiles; `sizes`: rows and speeds of
    these. Each tile takes `write` seconds more. ValueError where tiles of a length cannot be cut into those
    of the one before.
    """
    pieces = []
    for length, costs in sorted(tables.items()):
        size = sizes[length]
        if pieces and any(large % small for large, small in zip(size, pieces[-1][0], strict=True)):
            raise ValueError(f"tiles of {size} points cannot be cut into tiles of {pieces[-1][0]}")
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
