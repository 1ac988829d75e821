"""Growth with the grid: run time and memory of 10^3 to 10^6 points over the ranges of figure 9.

Writes growth.json and the figure growth.
"""

import math
import sys

import h5py
import harness
import numpy as np
from harness import style

# Speeds and support stiffnesses; the rigid twins, one a speed, come on top.
GRIDS = ((100, 10), (250, 40), (800, 125), (2500, 400))
QUICK_GRIDS = GRIDS[:2]


def measure(program, options, speeds, stiffnesses):
    """Run one grid."""
    name = f"growth-{speeds}x{stiffnesses}"
    grid = {"speed_count": speeds, "stiffness_count": stiffnesses, "tolerance": options.tolerance}
    runs = []
    for _ in range(options.repeats):
        deck, result = program.prepare(name, **grid)
        runs.append(program.run(deck, options.ranks, memory=True))
    wall = harness.spread(r.wall_seconds for r in runs)
    computed = [r.program_seconds for r in runs if r.program_seconds is not None]
    points = speeds * stiffnesses + speeds
    bytes_of_arrays = array_bytes(result)
    report = {
        "speeds": speeds,
        "stiffnesses": stiffnesses,
        "points": points,
        "wall_seconds": wall,
        "program_seconds": harness.spread(computed) if computed else None,
        "seconds_per_point": wall["median"] / points,
        "processor_seconds_per_point": wall["median"] * options.ranks / points,
        "largest_memory_megabytes": harness.spread(max(r.memory_megabytes) for r in runs),
        "array_megabytes": bytes_of_arrays / harness.MEGABYTE,
        "array_bytes_per_point": bytes_of_arrays / points,
        "file_megabytes": result.stat().st_size / harness.MEGABYTE,
        "disturbed_runs": harness.disturbed(runs),
    }
    print(f"{points} points: {wall['median']:.2f} s", flush=True)
    return report, result


def array_bytes(result):
    """Bytes of the arrays that live on the grid: all variables of the file."""
    with h5py.File(result, locking=False) as file:
        return sum(v.size * v.dtype.itemsize for v in file.values() if isinstance(v, h5py.Dataset))


def slope(x, y):
    """Exponent of a power law through the points, last two."""
    return math.log(y[-1] / y[-2]) / math.log(x[-1] / x[-2])


def summarise(grids):
    """What the grids say together."""
    points = [g["points"] for g in grids]
    memory = [g["largest_memory_megabytes"]["median"] for g in grids]
    arrays = [g["array_megabytes"] for g in grids]
    wall = [g["wall_seconds"]["median"] for g in grids]
    return {
        "time_exponent_of_the_last_two": slope(points, wall),
        "memory_bytes_per_point": (memory[-1] - memory[0]) * harness.MEGABYTE / (points[-1] - points[0]),
        "memory_growth_over_array_growth": (memory[-1] - memory[0]) / (arrays[-1] - arrays[0]),
        "memory_of_the_smallest_grid_megabytes": memory[0],
    }


def plot(grids, options):
    """Time and memory over the number of points."""
    drawn, (time, memory) = harness.figure(columns=2, width=style.DOUBLE)
    points = np.array([g["points"] for g in grids])
    wall = np.array([g["wall_seconds"]["median"] for g in grids])
    time.loglog(points, wall, "o-", color=style.BLUE, label=f"whole program, {options.ranks} ranks")
    line = wall[-1] * points / points[-1]
    time.loglog(points, line, "--", color=style.GREY, label="proportional to the points")
    time.set(xlabel="points of the grid [1]", ylabel="wall time [s]")
    time.legend()
    largest = [g["largest_memory_megabytes"]["median"] for g in grids]
    memory.loglog(points, largest, "s-", color=style.VERMILION, label="largest rank, peak")
    arrays = [g["array_megabytes"] for g in grids]
    memory.loglog(points, arrays, "^--", color=style.GREEN, label="the grid's arrays")
    memory.set(xlabel="points of the grid [1]", ylabel="memory [MB]")
    memory.legend()
    harness.save(drawn, options, "growth")


def main(argv=None):
    """Measure and draw."""
    parser = harness.option_parser(__doc__, repeats=3)
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--tolerance", type=float, default=1e-6)
    options = harness.prepare(parser.parse_args(argv))
    if options.quick:
        options.repeats = min(options.repeats, 1)
    program = harness.Program(options.build, options.out / "runs")
    grids, last = [], None
    for speeds, stiffnesses in QUICK_GRIDS if options.quick else GRIDS:
        if last:
            harness.clear(last)
        report, last = measure(program, options, speeds, stiffnesses)
        grids.append(report)
    report = {
        "part": "growth",
        "quick": options.quick,
        "ranks": options.ranks,
        "tolerance": options.tolerance,
        "provenance": harness.provenance(program, last),
        "summary": summarise(grids),
        "grids": grids,
    }
    harness.clear(last)
    harness.write(options, "growth", report)
    plot(grids, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
