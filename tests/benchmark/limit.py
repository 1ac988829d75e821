"""How near the map is to what its arithmetic needs, and what that means for the targets.

The program counts the steps that it does in lanes. At the best rate of the innermost loops, alone on a core,
they take a time that no other part of the program can save: the limit of this method on this processor.
Writes limit.json and limit.md. Reads answer.json where that part has run.
"""

import json
import sys

import h5py
import harness
import kernel

TOLERANCES = (1e-3, 1e-6)
QUICK_GRID = {"speed_count": 58, "stiffness_count": 10}
SHORTEST = 16  # steps a mesh period at least
RANKS = 2
# Loops that the kinds of steps run in, with few modes and with all; a recorded step is at least a step.
LOOPS = {
    "motions": ("collocation, rigid", "collocation, flexible"),
    "tangents": ("collocation, tangents, rigid", "collocation, tangents"),
    "recorded": ("collocation, rigid", "collocation, flexible"),
}


def at_best(loops, kind, modes):
    """Seconds and operations of a step at the best rate of its loop: linear in the modes."""
    few, all_modes = (loops[name] for name in LOOPS[kind])
    share = (modes - few["modes"]) / (all_modes["modes"] - few["modes"])
    both = [(1.0 / loop["best_per_second"], loop["operations"]) for loop in (few, all_modes)]
    return tuple(low + share * (high - low) for low, high in zip(*both, strict=True))


def limits_of(program, options, tolerance, loops, launch):
    """Counted steps of the map, the time that they take at least, and what the program takes."""
    grid = QUICK_GRID if options.quick else {}
    best = None
    for _ in range(options.repeats):
        deck, result = program.prepare(f"limit-{tolerance:.0e}", tolerance=tolerance, products="map", **grid)
        run = program.run(deck, 1)
        if best is None or run.program_seconds < best.program_seconds:
            best = run
    steps, modes = harness.steps_in(best.log)
    with h5py.File(result, locking=False) as file:
        periods = sum(int(file[name][:].sum()) for name in file if name.endswith("periods_integrated"))
        points = sum(file[name].size for name in file if name.endswith("periods_integrated"))
    cost = {kind: at_best(loops, kind, modes[kind]) for kind in steps}
    seconds = {kind: count * cost[kind][0] for kind, count in steps.items()}
    operations = sum(count * cost[kind][1] for kind, count in steps.items())
    return {
        "tolerance": tolerance,
        "points": points,
        "steps": steps,
        "modes": modes,
        "seconds_at_best_rate": seconds,
        "operations": operations,
        "program_seconds": best.program_seconds,
        "share": sum(seconds.values()) / best.program_seconds,
        "mesh_periods": periods,
        "least_wall_seconds": launch + sum(seconds.values()) / RANKS,
    }


def demands_of(options, loops):
    """The targets of `answer` in total, and the cost of bare loops; none without answer.json."""
    path = options.out / "answer.json"
    if not path.is_file():
        return []
    demands = []
    modes = loops[LOOPS["tangents"][1]]["modes"]
    period = SHORTEST * at_best(loops, "motions", modes)[0]
    monodromy = SHORTEST * 2 * modes * at_best(loops, "tangents", modes)[0]
    for title, verdict in json.loads(path.read_text())["targets"].items():
        if not title.endswith("total") or verdict["value"] is None:
            continue
        asked = float(verdict["target"].split()[-1])
        demands.append({"target": title, "asked": asked, "found": verdict["value"]})
        demands[-1] |= {"period_seconds": period, "monodromy_seconds": monodromy}
    return demands


def describe(limits, demands, peak, launch):
    """The report as Markdown."""
    lines = [
        "# Limits of the method on this processor",
        "",
        f"Peak {peak / 1e9:.1f}e9 operations/s and core; starting MPI on {RANKS} ranks takes {launch:.2f} s.",
        "Least: the counted steps at the best rate of their loops, everything else for nothing.",
        "",
        "| tolerance | points | kind | steps | modes | least seconds of one core |",
        "|---|---|---|---|---|---|",
    ]
    for limit in limits:
        lines += [
            f"| {limit['tolerance']:g} | {limit['points']} | {kind} | {count:.3g} "
            f"| {limit['modes'][kind]:.1f} | {limit['seconds_at_best_rate'][kind]:.2f} |"
            for kind, count in limit["steps"].items()
        ]
    lines += [
        "",
        "| tolerance | program on 1 rank [s] | share of the loops at their best "
        f"| least wall time on {RANKS} ranks [s] | at the peak [s] | mesh periods a point |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {limit['tolerance']:g} | {limit['program_seconds']:.2f} | {100 * limit['share']:.0f} % "
        f"| {limit['least_wall_seconds']:.2f} | {launch + limit['operations'] / peak / RANKS:.2f} "
        f"| {limit['mesh_periods'] / limit['points']:.1f} |"
        for limit in limits
    ]
    if demands:
        first = demands[0]
        lines += [
            "",
            f"A bare mesh period of {SHORTEST} steps takes {1e6 * first['period_seconds']:.2f} us a point in "
            f"full lanes, a monodromy {1e6 * first['monodromy_seconds']:.2f} us.",
            "",
            "| target of `answer` | asked | found | if only the loops took time |",
            "|---|---|---|---|",
        ]
        share = limits[0]["share"]
        lines += [
            f"| {d['target']} | {d['asked']:g} | {d['found']:.3g} | {d['found'] / share:.3g} |"
            for d in demands
        ]
    return "\n".join(lines) + "\n"


def main(argv=None):
    """Count, measure the loops, compare."""
    options = harness.prepare(harness.option_parser(__doc__).parse_args(argv))
    program = harness.Program(options.build, options.out / "runs")
    launch = min(
        harness.measured([*program.mpiexec, str(RANKS), str(program.path), "--version"], RANKS).wall_seconds
        for _ in range(options.repeats)
    )
    measured = kernel.measure(options.build, options)
    loops = {k["kernel"]: k for k in measured["kernels"]}
    peak = measured["peak_operations_per_second"]
    limits = [limits_of(program, options, tolerance, loops, launch) for tolerance in TOLERANCES]
    demands = demands_of(options, loops)
    report = {
        "part": "limit",
        "quick": options.quick,
        "provenance": harness.provenance(program),
        "launch_seconds": launch,
        "peak_operations_per_second": peak,
        "limits": limits,
        "answer": demands,
    }
    harness.write(options, "limit", report)
    text = describe(limits, demands, peak, launch)
    (options.out / "limit.md").write_text(text)
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
