"""The program's rule of scheduling, replayed: which rank gets which chunk, and when it is done.

Mirrors src/sweep/plan.f90 (how chunks are cut) and src/sweep/schedule.f90 (how they are handed out).
"""

import heapq
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
PLAN = ROOT / "src" / "sweep" / "plan.f90"
ATTENDANCE = ROOT / "src" / "sweep" / "attendance.f90"


@dataclass(frozen=True)
class Constants:
    """The constants of the plan."""

    largest_chunk: int
    chunks_per_rank: int
    smallest_chunk: int = 8

    def length(self, missing, ranks):
        """Points that a chunk is meant to have."""
        wanted = min(self.largest_chunk, missing // (ranks * self.chunks_per_rank))
        return max(1, min(self.smallest_chunk, missing // ranks), wanted)


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

    Mirrors cut_rows in src/sweep/plan.f90 for points that do not continue each other: as square as it can
    be, wider than high where the grid has few rows, as the one row of the rigid support.
    """
    rows, speeds = shape
    width = max(1, min(math.floor(math.sqrt(length) + 0.5), speeds))
    height = max(1, min(length // width, rows))
    return height, max(1, min(length // height, speeds))


def cut(costs, length):
    """Costs of the chunks, in the order in which they are handed out; `costs` of the points is (row, speed).

    Mirrors cut_rows for a grid of which every point is missing: tiles of a fixed size, row of tiles by row
    of tiles, softest support first; at the ends of the grid what is left of them.
    """
    height, width = tile(length, costs.shape)
    rows, speeds = (np.arange(0, n, step) for n, step in zip(costs.shape, (height, width), strict=True))
    return np.add.reduceat(np.add.reduceat(costs, rows, axis=0), speeds, axis=1).reshape(-1)


def replay(costs, ranks, machine):
    """Time [s] until all ranks have done chunks of these costs.

    Mirrors src/sweep/schedule.f90. Every rank but rank 0 has one request on its way: when it begins a
    chunk it asks for the next one. Rank 0 works too; it answers the requests that have come when it
    takes a chunk itself and every `attendance` seconds in between, and at once when no chunk is left.
    """
    costs = [float(c) + machine.write for c in costs]
    chunks = len(costs)
    if ranks == 1:
        return sum(costs)
    free = [0.0] * ranks
    requests = [(machine.latency, r) for r in range(1, ranks)]  # sorted, so a heap
    given = 0
    clock = 0.0
    left = 0.0  # work that rank 0 still has on its chunk
    step = machine.attendance

    while True:
        # Rank 0 looks at its messages.
        while requests and requests[0][0] <= clock:
            rank = requests[0][1]
            clock += machine.service
            if given < chunks:
                begin = max(free[rank], clock + machine.latency)
                free[rank] = begin + costs[given]
                given += 1
                heapq.heapreplace(requests, (begin + machine.latency, rank))
            else:
                free[rank] = max(free[rank], clock + machine.latency)
                heapq.heappop(requests)
        # It goes on with its chunk, or takes one.
        if left <= 0.0:
            if given == chunks:
                if not requests:
                    break
                clock = max(clock, requests[0][0])
                continue
            left = costs[given]
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
