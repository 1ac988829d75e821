"""Costs of the points of a map, measured in chunks of several lengths.

The statuses of a complete result file are set back to `missing` in every other block of so many speeds,
so that the program, run again on one rank, finds chunks of that length. It writes each as soon as it is
done, its status last. Meanwhile the statuses, mapped into memory, are watched: which points have
appeared, and how long the program has run by then, without the time it waited for a processor. The
other blocks are done in the same way.

A point can cost less in a longer chunk, where several are solved at once and written together. What a
chunk takes is shared out to its points as they cost in chunks of one.
"""

import os
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import h5py
import harness
import numpy as np

LENGTHS = (1, 4, 16, 64, 256)  # points of a chunk
LATE = 2e-4  # s between two looks, after which the watcher was held up
NANOSECOND = 1e-9  # s
TINY = 1e-7  # s, less than any point takes
QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99, 0.999, 1.0)


@dataclass
class Costs:
    """Seconds a point in chunks of each length, with writing them: (length, row, speed); rigid: one row."""

    lengths: tuple
    flexible: np.ndarray
    rigid: np.ndarray

    def at(self, part, length):
        """Seconds a point of `flexible` or `rigid` in chunks of a length, (row, speed)."""
        tables = getattr(self, part)
        place = np.interp(np.log(length), np.log(self.lengths), np.arange(len(self.lengths)))
        below = min(int(place), len(self.lengths) - 2)
        return tables[below] + (place - below) * (tables[below + 1] - tables[below])

    def least(self, part):
        """Seconds a point in chunks of the length with the least sum."""
        tables = getattr(self, part)
        return tables[int(np.argmin(tables.sum(axis=(1, 2))))]


@dataclass
class Statuses:
    """Where a variable of statuses lies in the file."""

    name: str
    offset: int
    shape: tuple
    dtype: np.dtype

    def map(self, path):
        """The statuses, flat, as the program changes them."""
        return np.memmap(path, self.dtype, "r", self.offset, self.shape).reshape(-1)


def measure(program, name, repeats, **values):
    """Costs of the points of a deck, of each the median over the repeats; and how they were had."""
    deck, result = program.prepare(name, **values)
    command = [str(program.path), str(deck)]
    at_once = harness.measured(command, 1)
    statuses = find_statuses(result)
    sizes = [int(np.prod(s.shape)) for s in statuses]
    tables, seconds, exact = [], {}, {}
    for length in LENGTHS:
        each = np.full((repeats, sum(sizes)), np.nan)
        used = []
        count = 0
        for number in range(repeats):
            used.append(0.0)
            for parity in (0, 1):
                blank(result, statuses, length, parity)
                groups, processor = watch(command, result, statuses)
                used[-1] += processor
                count += len(groups)
                for points, spent in groups:
                    share = np.full(points.size, 1.0) if not tables else tables[0][points] + TINY
                    each[number, points] = spent * share / share.sum()
        table = median_of(each)
        known = np.isfinite(table)
        # The first of a run, which have its start in them.
        table[~known] = tables[0][~known] if tables else np.median(table[known])
        tables.append(table)
        seconds[length], exact[length] = harness.spread(used), count / repeats
        print(f"chunks of {length}: {seconds[length]['median']:.2f} s", flush=True)
    sums = [float(t.sum()) for t in tables]
    point = tables[int(np.argmin(sums))]
    dearest = np.sort(point)[-max(1, point.size // 100) :]
    report = {
        "points": int(point.size),
        "processor_seconds_in_chunks_of_the_program": at_once.cpu_seconds,
        "processor_seconds_by_length": seconds,
        "pieces_seen_by_length": exact,
        "sum_of_costs_seconds_by_length": dict(zip(LENGTHS, sums, strict=True)),
        "point_seconds_quantiles": {f"{q:g}": float(np.quantile(point, q)) for q in QUANTILES},
        "share_of_the_dearest_percent_of_points": float(dearest.sum() / point.sum()),
    }
    flexible = np.array([t[: sizes[0]] for t in tables]).reshape(-1, *statuses[0].shape)
    rigid = np.array([t[sizes[0] :] for t in tables]).reshape(-1, 1, sizes[1])
    return Costs(LENGTHS, flexible, rigid), report


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
        return [Statuses(v.name, v.id.get_offset(), v.shape, v.dtype) for v in variables]


def blank(result, statuses, length, parity):
    """Every other block of so many speeds is missing again."""
    with h5py.File(result, "r+", locking=False) as file:
        for status in statuses:
            values = file[status.name][...]
            block = np.arange(status.shape[-1]) // length
            values[..., block % 2 == parity] = 0
            file[status.name][...] = values


def watch(command, result, statuses):
    """Groups of points with the seconds that they took, of a run on one rank; its processor seconds.

    Where the watcher was held up, it does not know when a point came: it then knows only the seconds of
    all points up to the next one that it saw in time.
    """
    arrays = [status.map(result) for status in statuses]
    firsts = np.cumsum([0, *(a.size for a in arrays)])
    seen = [a != 0 for a in arrays]
    left = [int(s.size - s.sum()) for s in seen]
    groups, group, last = [], [], 0.0
    looked = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT)
    while any(left) and os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        # Rigid points come first, and all of them before any flexible one.
        number = 1 if left[1] else 0
        there = arrays[number] != 0
        new = np.flatnonzero(there != seen[number])
        before, looked = looked, time.perf_counter()
        if not new.size:
            continue
        seen[number] = there
        left[number] -= new.size
        group.append(new + firsts[number])
        if looked - before < LATE:
            now = looked - waited(process.pid)
            groups.append((np.concatenate(group), max(0.0, now - last)))
            group, last = [], now
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (harness.COMPLETE, harness.FAILED_POINTS):
        raise RuntimeError(f"{' '.join(command)}: exit code {process.returncode}")
    return groups[1:], usage.ru_utime + usage.ru_stime  # the first has the start of the program in it


def waited(process):
    """Seconds that a process has been ready to run but had no processor; 0 where the system does not say."""
    try:
        return int(Path(f"/proc/{process}/schedstat").read_text().split()[1]) * NANOSECOND
    except OSError:
        return 0.0
