"""The map of figure 9, whole program: wall time, efficiency of two ranks, memory, start of a finished deck.

Twice with what figures 9 and 10 need, products = 'map', and once with the products of the deck itself,
which are multipliers and exponents too. The time is judged where the target is set: at 1e-3.

What the machine leaves to two is measured beside it: two runs of one rank at once, not bound to cores, which
share nothing else. Their speed beside that of one alone compares with the efficiency of two ranks.
Writes map.json and the figure map.
"""

import statistics
import sys
from concurrent.futures import ThreadPoolExecutor

import harness
import numpy as np
from harness import style

# Tolerance, and products: none given are those of the deck.
CASES = ((1e-3, {"products": "map"}), (1e-6, {"products": "map"}), (1e-6, {}))
RANKS = (1, 2)
QUICK_GRID = {"speed_count": 58, "stiffness_count": 10}

WALL_LIMIT, WALL_TOLERANCE = 2.0, 1e-3  # s on two ranks
EFFICIENCY_LIMIT = 0.95
MEMORY_LIMIT = 150.0  # MB a rank
RERUN_LIMIT = 0.3  # s


def measure(program, options, tolerance, products):
    """Everything about the map with one tolerance and some products."""
    label = f"tolerance {tolerance:g}" + (", map" if products else ", all")
    name = f"map-{tolerance:.0e}" + ("" if products else "-all")
    values = {"tolerance": tolerance, **products, **(QUICK_GRID if options.quick else {})}
    runs = {ranks: [] for ranks in RANKS}
    reruns = {ranks: [] for ranks in RANKS}
    at_once = []
    for pair in range(options.repeats):
        # Both orders in turn, so that a drift of the machine hits both alike.
        for ranks in RANKS if pair % 2 == 0 else reversed(RANKS):
            deck, result = program.prepare(name, **values)
            runs[ranks].append(program.run(deck, ranks))
            reruns[ranks].append(program.run(deck, ranks))
            wall = runs[ranks][-1].wall_seconds
            print(f"{label}, {ranks} ranks: {wall:.2f} s", flush=True)
        at_once.append(two_at_once(program, name, **values))
        print(f"{label}, two runs at once: {at_once[-1]:.2f} s", flush=True)
    memory = {}
    for ranks in RANKS:
        deck, result = program.prepare(name, **values)
        memory[ranks] = program.run(deck, ranks, memory=True).memory_megabytes
    one, two = runs[1], runs[2]
    report = {
        "label": label,
        "tolerance": tolerance,
        "wall_seconds": {n: harness.spread(r.wall_seconds for r in runs[n]) for n in RANKS},
        "program_seconds": {n: spread_known(r.program_seconds for r in runs[n]) for n in RANKS},
        "efficiency_of_two_ranks": efficiency(one, two, "wall_seconds"),
        "efficiency_without_start": efficiency(one, two, "program_seconds"),
        "two_runs_at_once_seconds": harness.spread(at_once),
        "efficiency_of_two_runs_at_once": harness.spread(
            alone.wall_seconds / both for alone, both in zip(one, at_once, strict=True)
        ),
        "rerun_seconds": {n: harness.spread(r.wall_seconds for r in reruns[n]) for n in RANKS},
        "memory_megabytes_by_rank": memory,
        "disturbed_runs": {n: harness.disturbed(runs[n]) for n in RANKS},
        "paths": harness.paths_in(two[-1].log),
        "outcome": harness.outcome_of(result),
        "runs": [r.summary() for n in RANKS for r in runs[n]],
    }
    return report, result


def two_at_once(program, name, **values):
    """Mean wall time of two runs of one rank that go on at the same time."""
    decks = [program.prepare(f"{name}-{which}", **values)[0] for which in ("left", "right")]
    with ThreadPoolExecutor(len(decks)) as pool:
        runs = list(pool.map(lambda deck: program.run(deck, 1, beside=True), decks))
    return statistics.mean(run.wall_seconds for run in runs)


def spread_known(values):
    """Spread of the values that are known; none if none is."""
    known = [v for v in values if v is not None]
    return harness.spread(known) if known else None


def efficiency(one, two, clock):
    """Efficiency t1/(2 t2) by one of the clocks: of the medians, and of each pair of runs."""
    one, two = [getattr(r, clock) for r in one], [getattr(r, clock) for r in two]
    if None in one or None in two or 0.0 in two:
        return None
    pairs = [a / (2.0 * b) for a, b in zip(one, two, strict=True)]
    of_medians = statistics.median(one) / (2.0 * statistics.median(two))
    return {"of_medians": of_medians, "pairs": harness.spread(pairs)}


def targets_of(report):
    """The targets, for one of the cases."""
    wall, again = (report[k][2]["median"] for k in ("wall_seconds", "rerun_seconds"))
    efficient = report["efficiency_of_two_ranks"]["pairs"]["median"]
    largest = max(max(peaks) for peaks in report["memory_megabytes_by_rank"].values())
    targets = {}
    if report["tolerance"] == WALL_TOLERANCE:
        targets["wall time on 2 ranks [s]"] = harness.judge(wall, WALL_LIMIT)
    targets |= {
        "efficiency of 2 ranks": harness.judge(efficient, EFFICIENCY_LIMIT, at_most=False),
        "memory of the largest rank [MB]": harness.judge(largest, MEMORY_LIMIT),
        "finished deck again on 2 ranks [s]": harness.judge(again, RERUN_LIMIT),
    }
    return {f"{report['label']}: {name}": verdict for name, verdict in targets.items()}


def plot(reports, options):
    """Wall times of the runs with their medians, and what came out."""
    drawn, (times, outcome) = harness.figure(columns=2, width=style.DOUBLE)
    colours = {1: style.BLUE, 2: style.VERMILION}
    for number, report in enumerate(reports):
        for ranks in RANKS:
            wall = report["wall_seconds"][ranks]
            place = number + (ranks - 1.5) * 0.36
            label = f"{ranks} rank{'s' * (ranks > 1)}" if number == 0 else None
            times.bar(place, wall["median"], 0.32, color=colours[ranks], label=label)
            times.plot(np.full(len(wall["values"]), place), wall["values"], "o", color="black", mfc="white")
    times.axhline(WALL_LIMIT, color=style.GREY, ls="--", label="target for 2 ranks")
    times.set_xticks(range(len(reports)), [r["label"].replace(", ", "\n") for r in reports])
    times.set_ylabel("wall time of the whole program [s]")
    times.set_ylim(0.0, 1.35 * max(r["wall_seconds"][n]["max"] for r in reports for n in RANKS))
    times.legend(loc="upper center", ncols=3)

    looks = (("o", style.GREEN), ("s", style.ORANGE), ("^", style.BLUE))
    names = list(dict.fromkeys(k for r in reports for k in r["outcome"]["flexible"]["motion"]))
    for number, report in enumerate(reports):
        counts = [report["outcome"]["flexible"]["motion"].get(k, np.nan) for k in names]
        places = np.arange(len(names)) + (number - 1) * 0.2
        marker, colour = looks[number]
        outcome.plot(places, counts, marker, color=colour, label=report["label"])
    outcome.set_xticks(range(len(names)), [n.replace("_", " ") for n in names], rotation=60, ha="right")
    outcome.set(ylabel="points of the flexible support [1]", yscale="log")
    outcome.legend()
    harness.save(drawn, options, "map")


def main(argv=None):
    """Measure, judge, draw."""
    options = harness.prepare(harness.option_parser(__doc__).parse_args(argv))
    if options.quick:
        options.repeats = min(options.repeats, 2)
    program = harness.Program(options.build, options.out / "runs")
    # The program and its libraries come into the cache of the system before anything is timed.
    deck, _ = program.prepare("map-warm", speed_count=10, stiffness_count=2)
    program.run(deck, max(RANKS))
    measured = [measure(program, options, *case) for case in CASES]
    reports = [report for report, _ in measured]
    targets = {}
    for report in [] if options.quick else reports:  # they are for the whole map
        targets |= targets_of(report)
    launch = harness.measured([*program.mpiexec, "2", str(program.path), "--version"], 2)
    report = {
        "part": "map",
        "quick": options.quick,
        "provenance": harness.provenance(program, measured[-1][1]),
        "launch_seconds": launch.wall_seconds,
        "targets": targets,
        "maps": reports,
    }
    harness.write(options, "map", report)
    plot(reports, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
