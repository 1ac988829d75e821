"""The price of surviving: what checkpoints, checksums, locks and looks at files add to the time of the map.

Two measures, both with tolerance 1e-3, against a sweep that guards nothing and writes its results once, at
the end (bare_sweep.f90). Pairs of runs: the program's clock leaves out the start of MPI, which both need; it
covers everything else, from the deck to the closed file. And within a run: what the program says that its
file cost, less what the bare sweep says that its own cost, beside all other work of the run. That is told to
a tenth of a per cent where pairs of runs scatter by several. Writes overhead.json.
"""

import math
import re
import statistics
import sys

import harness

TOLERANCE = 1e-3
RANKS = (1, 2)
QUICK_GRID = {"speed_count": 58, "stiffness_count": 10}

LIMIT = 1.02
"""Largest ratio of the two times."""
CONFIDENCE = 0.95

CLOCKS = {"program_seconds": "time by its own clock", "cpu_seconds": "processor time"}


def interval_of_median(values):
    """Interval that holds the median of what the values are drawn from, whatever its distribution.

    None where there are too few values for one.
    """
    values = sorted(values)
    n = len(values)
    below = [sum(math.comb(n, k) for k in range(i + 1)) / 2**n for i in range(n)]
    outside = [i for i in range(n // 2) if 2.0 * below[i] <= 1.0 - CONFIDENCE]
    return [values[outside[-1] + 1], values[n - 2 - outside[-1]]] if outside else None


def file_seconds(run, ranks):
    """What the log of a run says that its file cost, as time of the run."""
    line = next(line for line in run.log.splitlines() if line.startswith("result file:"))
    # What is written while points are solved adds up over the ranks.
    return sum(
        float(seconds) / (ranks if what == "points written" else 1)
        for what, seconds in re.findall(r"(opened|points written|written|closed) in (\S+) s", line)
    )


def outcome_in(log):
    """Points by status, as the log says it."""
    line = next(line for line in log.splitlines() if line.startswith("done in"))
    return line.split(":", 1)[1].split(";")[0].strip()


def measure(guarded, bare, options, ranks):
    """Pairs of runs on some ranks."""
    grid = QUICK_GRID if options.quick else {}
    runs = {"guarded": [], "bare": []}
    for pair in range(options.repeats):
        # Both orders in turn, so that a drift of the machine hits both alike.
        for name in ("guarded", "bare") if pair % 2 == 0 else ("bare", "guarded"):
            deck, _ = guarded.prepare("overhead", tolerance=TOLERANCE, products="map", **grid)
            runs[name].append((guarded if name == "guarded" else bare).run(deck, ranks))
        one, other = runs["guarded"][-1], runs["bare"][-1]
        if outcome_in(one.log) != outcome_in(other.log):
            raise RuntimeError(f"different points: {outcome_in(one.log)}, {outcome_in(other.log)}")
        print(f"{ranks} ranks: {one.program_seconds:.2f} s, bare {other.program_seconds:.2f} s", flush=True)
    report = {"ranks": ranks, "outcome": outcome_in(runs["bare"][-1].log)}
    for clock in CLOCKS:
        times = {name: [getattr(run, clock) for run in some] for name, some in runs.items()}
        ratios = [a / b for a, b in zip(times["guarded"], times["bare"], strict=True)]
        report[clock] = {name: harness.spread(values) for name, values in times.items()}
        report[clock]["ratio_of_pairs"] = harness.spread(ratios) | {
            "quartiles": statistics.quantiles(ratios, n=4) if len(ratios) > 1 else None,
            "interval_of_median": interval_of_median(ratios),
        }
    report["file_seconds"] = {
        name: harness.spread([file_seconds(run, ranks) for run in some]) for name, some in runs.items()
    }
    plain = report["file_seconds"]["bare"]["median"]
    report["within_a_run"] = harness.spread(
        1.0 + (cost - plain) / (run.program_seconds - cost)
        for run in runs["guarded"]
        for cost in [file_seconds(run, ranks)]
    )
    report["disturbed_runs"] = {name: harness.disturbed(some) for name, some in runs.items()}
    report["runs"] = {name: [run.summary() for run in some] for name, some in runs.items()}
    return report


def main(argv=None):
    """Measure and judge."""
    options = harness.prepare(harness.option_parser(__doc__, repeats=15).parse_args(argv))
    if options.quick:
        options.repeats = min(options.repeats, 2)
    guarded = harness.Program(options.build, options.out / "runs")
    bare = harness.Program(options.build, options.out / "runs")
    bare.path = options.build / "tests" / "bare_sweep"
    for program in (guarded, bare):
        # Both come into the cache of the system before anything is timed.
        deck, result = guarded.prepare("overhead-warm", speed_count=10, stiffness_count=2)
        program.run(deck, max(RANKS))
    reports = [measure(guarded, bare, options, ranks) for ranks in RANKS]
    targets = {}
    for report in [] if options.quick else reports:  # they are for the whole map
        for clock, words in CLOCKS.items():
            ratio = report[clock]["ratio_of_pairs"]["median"]
            title = f"{report['ranks']} ranks: {words} over that of a bare sweep"
            targets[title] = harness.judge(ratio, LIMIT)
        title = f"{report['ranks']} ranks: time over that with a plain file, within a run"
        targets[title] = harness.judge(report["within_a_run"]["median"], LIMIT)
    deck, result = guarded.prepare("overhead", tolerance=TOLERANCE, products="map", speed_count=10)
    guarded.run(deck, 1)
    report = {
        "part": "overhead",
        "quick": options.quick,
        "tolerance": TOLERANCE,
        "provenance": harness.provenance(guarded, result),
        "targets": targets,
        "by_ranks": reports,
    }
    harness.write(options, "overhead", report)
    return 0


if __name__ == "__main__":
    sys.exit(main())
