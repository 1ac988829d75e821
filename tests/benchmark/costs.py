"""Costs of the points of a map, measured in pieces of several sizes.

A piece is a tile of neighbouring speeds and support stiffnesses, or half of one, or half of that. The
statuses of one such piece of every tile of a complete result file are set back to `missing`: the program,
run again on one rank, finds each as a piece of its own. It writes each as soon as it is done, its statuses
last. Meanwhile the statuses, mapped into memory, are watched: which points have appeared, and how long the
program has run by then, without the time it waited for a processor. Then comes the next piece of every
tile, until all have been measured.

A point costs less among others, with which it shares the lanes of the vectors. What a piece takes is shared
out to its points as they cost in pieces of one, which are every other point of the grid.
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

ALONE = 1  # points of a piece of which no tile is made
PARTS = ("flexible", "rigid")
LATE = 2e-4  # s between two looks, after which the watcher was held up
NANOSECOND = 1e-9  # s
TINY = 1e-7  # s, less than any point takes
QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99, 0.999, 1.0)


@dataclass
class Costs:
    """Seconds a point, with writing it, by the points of the pieces: (row, speed); rigid: one row."""

    flexible: dict
    rigid: dict

    def least(self, part):
        """Seconds a point of `flexible` or `rigid` in pieces of the size with the least sum."""
        return min(getattr(self, part).values(), key=np.sum)


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
    tables, facts = {}, {}
    for number, (part, status) in enumerate(zip(PARTS, find_statuses(result), strict=True)):
        run = Watched(command, result, number, status)
        tables[part], facts[part] = measure_part(run, repeats, part)
    costs = Costs(**tables)
    point = np.concatenate([costs.least(part).ravel() for part in PARTS])
    dearest = np.sort(point)[-max(1, point.size // 100) :]
    report = {
        "points": int(point.size),
        "processor_seconds_in_pieces_of_the_program": at_once.cpu_seconds,
        "by_length": facts,
        "point_seconds_quantiles": {f"{q:g}": float(np.quantile(point, q)) for q in QUANTILES},
        "share_of_the_dearest_percent_of_points": float(dearest.sum() / point.sum()),
    }
    return costs, report


def measure_part(run, repeats, part):
    """Seconds a point in pieces of each size, and what was seen."""
    now = schedule.constants_now()
    # On the rigid support the smallest only: it has too few points for whole runs of large ones.
    sizes = schedule.sizes_of(run.shape, now) if part == PARTS[0] else {now.smallest_piece: None}
    tables, facts = {}, {}
    for length in (ALONE, *sorted(sizes)):
        pieces = every_point(run.shape) if length == ALONE else pieces_of_tiles(length, run.shape, now)
        weight = tables[ALONE].ravel() + TINY if tables else np.ones(run.size)
        each = np.full((repeats, run.size), np.nan)
        runs = 0
        for number in range(repeats):
            sets = sets_of_every_other(run.shape) if length == ALONE else sets_of(length, run.shape, now)
            for blank in sets:
                runs += 1
                points, seconds = shared_out(run.watch(blank), weight)
                # A piece may appear row by row; one of which a row was not seen counts for nothing.
                covered = np.bincount(points, minlength=run.size)
                whole = (np.bincount(pieces, covered) == np.bincount(pieces))[pieces]
                spent = np.bincount(pieces[points], seconds, minlength=pieces.max() + 1)[pieces]
                each[number, whole] = (spent * weight / np.bincount(pieces, weight)[pieces])[whole]
        table = median_of(each)
        known = np.isfinite(table)
        # Those that came first in their runs have the start in them: as alone, by what the others save.
        if tables:
            alone = tables[ALONE].ravel()
            table[~known] = alone[~known] * table[known].sum() / alone[known].sum()
        else:
            table[~known] = np.median(table[known])
        tables[length] = table.reshape(run.shape)
        facts[length] = {
            "size": sizes.get(length),
            "runs": runs,
            "measured_share": float(known.mean()),
            "sum_seconds": float(table.sum()),
        }
        print(f"{part}, pieces of {length}: {table.sum():.3f} s, {runs} runs", flush=True)
    return tables, facts


def every_point(shape):
    """Pieces of one point."""
    return np.arange(int(np.prod(shape)))


def cuts_of(length, shape, now):
    """Each tile of a grid, and how often it is halved for pieces of so many points; at the end less often."""
    halvings = round(np.log2(np.prod(schedule.tile_size(shape, now)) / length))
    for tile in schedule.tiles_of(shape, now):
        yield tile, min(halvings, schedule.most_halvings(tile, min(length, now.smallest_piece), now.aspect))


def pieces_of_tiles(length, shape, now):
    """Number of the piece that each point is in, flat."""
    numbers, next_one = np.zeros(shape, int), 0
    for tile, halvings in cuts_of(length, shape, now):
        for number in range(2**halvings):
            numbers[schedule.part_of(tile, halvings, number, now.aspect).region] = next_one
            next_one += 1
    return numbers.ravel()


def sets_of_every_other(shape):
    """Every other point, in both directions; the rest."""
    odd = (np.indices(shape).sum(axis=0) % 2 == 1).reshape(-1)
    return odd, ~odd


def sets_of(length, shape, now):
    """Sets of points, one piece of every tile in each: the first, the second, and so on."""
    cuts = list(cuts_of(length, shape, now))
    for number in range(2 ** max(halvings for _, halvings in cuts)):
        blank = np.zeros(shape, bool)
        for tile, halvings in cuts:
            if number < 2**halvings:
                blank[schedule.part_of(tile, halvings, number, now.aspect).region] = True
        yield blank.ravel()


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
