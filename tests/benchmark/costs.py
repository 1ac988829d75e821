"""Costs of the points of a map, measured in chunks of several sizes.

A chunk is a tile of neighbouring speeds and support stiffnesses, and the fewer points are missing, the
smaller the tiles of the program: the statuses of some tiles of a complete result file are set back to
`missing`, just so many that the program, run again on one rank, cuts them out as tiles of the size that is
wanted. It writes each as soon as it is done, its statuses last. Meanwhile the statuses, mapped into memory,
are watched: which points have appeared, and how long the program has run by then, without the time it
waited for a processor. Then come the next tiles, until all have been measured.

A point costs less among others, with which it shares the lanes of the vectors. What a chunk takes is shared
out to its points as they cost in chunks of one, which are every other point of the grid.
"""

import os
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import h5py
import harness
import numpy as np
import schedule

ALONE = 1  # points of a chunk of which the tiles of the program are not made
LENGTHS = (8, 16, 32, 64, 128, 256)  # points that a tile is meant to have
PARTS = ("flexible", "rigid")
LATE = 2e-4  # s between two looks, after which the watcher was held up
NANOSECOND = 1e-9  # s
TINY = 1e-7  # s, less than any point takes
QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99, 0.999, 1.0)


@dataclass
class Costs:
    """Seconds a point in chunks of some sizes, with writing them: (size, row, speed); rigid: one row."""

    lengths: dict  # points of a chunk: of `flexible` and of `rigid`
    flexible: np.ndarray
    rigid: np.ndarray

    def at(self, part, length):
        """Seconds a point of `flexible` or `rigid` in chunks of a size, (row, speed)."""
        tables, lengths = getattr(self, part), self.lengths[part]
        place = np.interp(np.log(length), np.log(lengths), np.arange(len(lengths)))
        below = max(0, min(int(place), len(lengths) - 2))
        above = min(below + 1, len(lengths) - 1)
        return tables[below] + (place - below) * (tables[above] - tables[below])

    def least(self, part):
        """Seconds a point in chunks of the size with the least sum."""
        tables = getattr(self, part)
        return tables[int(np.argmin(tables.sum(axis=(1, 2))))]


@dataclass
class Statuses:
    """Where a variable of statuses lies in the file: in columns of some speeds, or in one of all."""

    name: str
    shape: tuple
    dtype: np.dtype
    columns: list  # of (byte offset, shape in the file)

    @classmethod
    def of(cls, variable):
        """Those of an open variable."""
        identifier = variable.id
        if variable.chunks is None:
            columns = [(identifier.get_offset(), np.atleast_2d(np.empty(variable.shape, bool)).shape)]
        else:
            found = [identifier.get_chunk_info(i) for i in range(identifier.get_num_chunks())]
            found.sort(key=lambda chunk: chunk.chunk_offset[-1])
            columns = [(chunk.byte_offset, variable.chunks) for chunk in found]
        return cls(variable.name, variable.shape, variable.dtype, columns)

    def map(self, path):
        """The columns, as the program changes them."""
        return [np.memmap(path, self.dtype, "r", offset, shape) for offset, shape in self.columns]

    def known(self, columns):
        """Which points are there, flat; the last column may be wider than the grid."""
        return (np.concatenate(columns, axis=1)[:, : self.shape[-1]] != 0).reshape(-1)


def measure(program, name, repeats, **values):
    """Costs of the points of a deck, of each the median over the repeats; and how they were had."""
    deck, result = program.prepare(name, **values)
    command = [str(program.path), str(deck)]
    at_once = harness.measured(command, 1)
    tables, lengths, facts = {}, {}, {}
    for number, (part, status) in enumerate(zip(PARTS, find_statuses(result), strict=True)):
        run = Watched(command, result, number, status)
        tables[part], lengths[part], facts[part] = measure_part(run, repeats, part)
    point = np.concatenate([tables[p][int(np.argmin([t.sum() for t in tables[p]]))] for p in PARTS])
    dearest = np.sort(point)[-max(1, point.size // 100) :]
    report = {
        "points": int(point.size),
        "processor_seconds_in_chunks_of_the_program": at_once.cpu_seconds,
        "by_length": facts,
        "point_seconds_quantiles": {f"{q:g}": float(np.quantile(point, q)) for q in QUANTILES},
        "share_of_the_dearest_percent_of_points": float(dearest.sum() / point.sum()),
    }
    shapes = dict(zip(PARTS, shapes_of(result), strict=True))
    return Costs(lengths, *(np.array(tables[p]).reshape(-1, *shapes[p]) for p in PARTS)), report


def measure_part(run, repeats, part):
    """Seconds a point in chunks of each size that this grid is large enough for, and what was seen."""
    random = np.random.default_rng(run.size)
    tables, facts = [], {}
    for length in (ALONE, *(n for n in LENGTHS if fits(n, run.shape))):
        tiles = every_point(run.shape) if length == ALONE else tiles_of(length, run.shape)
        weight = tables[0] + TINY if tables else np.ones(run.size)
        each = np.full((repeats, run.size), np.nan)
        runs = 0
        for number in range(repeats):
            singles = sets_of_every_other(run.shape)
            for blank in singles if length == ALONE else sets_of(length, run.size, tiles, random):
                runs += 1
                points, seconds = shared_out(run.watch(blank), weight)
                # A tile may appear row by row; one of which a row was not seen counts for nothing.
                covered = np.bincount(points, minlength=run.size)
                whole = (np.bincount(tiles, covered) == np.bincount(tiles))[tiles]
                spent = np.bincount(tiles[points], seconds, minlength=tiles.max() + 1)[tiles]
                each[number, whole] = (spent * weight / np.bincount(tiles, weight)[tiles])[whole]
        table = median_of(each)
        known = np.isfinite(table)
        # Those that came first in their runs have the start in them: as alone, by what the others save.
        if tables:
            table[~known] = tables[0][~known] * table[known].sum() / tables[0][known].sum()
        else:
            table[~known] = np.median(table[known])
        tables.append(table)
        facts[length] = {
            "tile": (1, 1) if length == ALONE else schedule.tile(length, run.shape),
            "runs": runs,
            "measured_share": float(known.mean()),
            "sum_seconds": float(table.sum()),
        }
        print(f"{part}, chunks of {length}: {table.sum():.3f} s, {runs} runs", flush=True)
    return tables, tuple(facts), facts


def fits(length, shape):
    """There are enough points for tiles of this size on one rank."""
    return least_missing(length) <= int(np.prod(shape))


def least_missing(length):
    """Fewest missing points of which the program on one rank makes tiles of this size."""
    now = schedule.constants_of_plan()
    each = now.fewest_chunks if length <= now.smallest_chunk else now.chunks_per_rank
    return length * each


def every_point(shape):
    """Tiles of one point."""
    return np.arange(int(np.prod(shape)))


def tiles_of(length, shape):
    """Number of the tile that each point is in, flat."""
    height, width = schedule.tile(length, shape)
    row, speed = np.indices(shape).reshape(2, -1)
    return row // height * -(-shape[1] // width) + speed // width


def sets_of_every_other(shape):
    """Every other point, in both directions; the rest."""
    odd = (np.indices(shape).sum(axis=0) % 2 == 1).reshape(-1)
    return odd, ~odd


def sets_of(length, size, tiles, random):
    """Sets of tiles, at random, each with so many points that the program cuts it into tiles of this size."""
    now = schedule.constants_of_plan()
    sizes = np.bincount(tiles)
    if length == now.largest_chunk:
        yield np.full(size, True)
        return
    waiting = list(random.permutation(sizes.size))
    while waiting:
        # The first point of all, which has the start of the program in it, and whole tiles.
        chosen, count = [], 1
        for number in list(waiting):
            if now.length(count + sizes[number], 1) <= length:
                chosen.append(number)
                count += sizes[number]
                waiting.remove(number)
            if count >= least_missing(length) and count + sizes.max() > now.chunks_per_rank * (length + 1):
                break
        blank = np.isin(tiles, chosen)
        blank[0] = True
        # What is still missing to make the tiles as large: points that are measured already, one by one.
        others = random.permutation(np.flatnonzero(~blank))
        blank[others[: max(0, least_missing(length) - count)]] = True
        yield blank


def shared_out(groups, weight):
    """Points, and the seconds of each of a group by their weights."""
    points = [np.zeros(0, int)] + [p for p, _ in groups]
    seconds = [np.zeros(0)] + [spent * weight[p] / weight[p].sum() for p, spent in groups]
    return np.concatenate(points), np.concatenate(seconds)


def median_of(values):
    """Median over the repeats of what is known; not a number where nothing is."""
    known = np.isfinite(values).any(axis=0)
    median = np.full(values.shape[1], np.nan)
    median[known] = np.nanmedian(values[:, known], axis=0)
    return median


def find_statuses(result):
    """The statuses of the flexible and of the rigid support."""
    with h5py.File(result, locking=False) as file:
        variables = [file[name] for name in ("status", "rigid_status")]
        return [Statuses.of(v) for v in variables]


def shapes_of(result):
    """Rows and speeds of both."""
    return [np.atleast_2d(np.empty(s.shape, bool)).shape for s in find_statuses(result)]


class Watched:
    """Runs on one rank that compute missing points of one part of the map."""

    def __init__(self, command, result, number, status):
        self.command, self.result, self.number, self.status = command, result, number, status
        self.shape = shapes_of(result)[number]
        self.size = int(np.prod(self.shape))

    def watch(self, blank):
        """Set these points back to missing; groups of points with the seconds that they took.

        Where the watcher was held up, it does not know when a point came: it then knows only the seconds of
        all points up to the next one that it saw in time.
        """
        with h5py.File(self.result, "r+", locking=False) as file:
            values = file[self.status.name][...].reshape(-1)
            values[blank] = 0
            file[self.status.name][...] = values.reshape(self.status.shape)
        columns = self.status.map(self.result)
        seen = self.status.known(columns)
        left = int(self.size - seen.sum())
        groups, group, last = [], [], 0.0
        looked = time.perf_counter()
        process = subprocess.Popen(self.command, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT)
        while left and os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
            there = self.status.known(columns)
            new = np.flatnonzero(there != seen)
            before, looked = looked, time.perf_counter()
            if not new.size:
                continue
            seen = there
            left -= new.size
            group.append(new)
            if looked - before < LATE:
                now = looked - waited(process.pid)
                groups.append((np.concatenate(group), max(TINY, now - last)))
                group, last = [], now
        _, status, _ = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode not in (harness.COMPLETE, harness.FAILED_POINTS):
            raise RuntimeError(f"{' '.join(self.command)}: exit code {process.returncode}")
        return groups[1:]  # the first has the start of the program in it


def waited(process):
    """Seconds that a process has been ready to run but had no processor; 0 where the system does not say."""
    try:
        return int(Path(f"/proc/{process}/schedstat").read_text().split()[1]) * NANOSECOND
    except OSError:
        return 0.0
