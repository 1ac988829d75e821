"""Work and precision: time of one point against the true relative error of the amplitude, in six regimes.

Every solver is asked for errors of 1e-2 to 1e-10: its tolerance is that number, and a peer drops a transient
that is long enough for it. The true error is that of the half peak-to-peak of y1 beside the
independent reference. Writes precision.json and the figure precision.
"""

import os
import statistics
import sys

import harness
import points
from harness import style
from solvers import Spurflex, peers_available, time_peer, versions

CAP, CAP_PYTHON = 0.5, 2.0  # s of one run; longer ones are extrapolated
QUICK_LEVELS = points.LEVELS[1::4]
QUICK_REGIMES = (0, 1)

# Solvers that are drawn: colour and marker. The report has all.
DRAWN = {
    "spurflex, collocation": (style.BLUE, "o"),
    "spurflex, newmark": (style.SKY_BLUE, "s"),
    "heyoka, batch events": (style.VERMILION, "D"),
    "heyoka, events": (style.VERMILION, "^"),
    "heyoka, batch": (style.ORANGE, "v"),
    "CVODE, bdf, located": (style.GREEN, "P"),
    "CVODE, adams-fixed, located": (style.GREEN, "X"),
    "SciPy, DOP853": (style.PURPLE, "<"),
    "SciPy, LSODA": (style.BLACK, ">"),
    "SciPy, Radau": (style.GREY, "h"),
}


def measure(point, equations, spurflex, peers, levels, repeats):
    """Times and errors of every solver at a point."""
    found = {}
    for round_ in range(repeats):
        # Both orders in turn, so that a drift of the machine hits all alike.
        for solver in (spurflex + peers)[:: 1 if round_ % 2 == 0 else -1]:
            is_python = solver.name.startswith("SciPy")
            if is_python and round_ > 0:
                continue
            for level in levels:
                if solver in spurflex:
                    timing = solver.time(point, level)
                else:
                    cap = CAP_PYTHON if is_python else CAP
                    timing = time_peer(solver, equations, level, point, point.periods(level), cap)
                found.setdefault((solver.name, level), []).append(timing)
    entries = []
    for (name, level), timings in found.items():
        seconds = [t.seconds for t in timings]
        entries.append(
            {
                "solver": name,
                "asked": level,
                "error": timings[-1].error(point.amplitude),
                "seconds": statistics.median(seconds),
                "values": seconds,
                "periods": timings[-1].periods,
                "extrapolated": any(t.extrapolated for t in timings),
            }
        )
    return entries


def plot(reports, options):
    """One diagram a regime; hollow markers are extrapolated times."""
    columns = min(3, len(reports))
    rows = -(-len(reports) // columns)
    style.apply()
    import matplotlib.pyplot as plt

    size = style.size(style.DOUBLE, 62.0 * rows + 12.0)
    drawn, axes = plt.subplots(rows, columns, figsize=size, layout="constrained", sharey=True, squeeze=False)
    for ax, report in zip(axes.flat, reports, strict=False):
        for name, (colour, marker) in DRAWN.items():
            line = [e for e in report["solvers"] if e["solver"] == name]
            if not line:
                continue
            x, y = ([max(e[k], 1e-13) for e in line] for k in ("error", "seconds"))
            ax.loglog(x, y, color=colour, lw=0.5, alpha=0.6)
            for extrapolated in (False, True):
                part = [i for i, e in enumerate(line) if e["extrapolated"] == extrapolated]
                face = "white" if extrapolated else colour
                places = [x[i] for i in part], [y[i] for i in part]
                ax.loglog(*places, marker, color=colour, mfc=face, mew=0.6)
            ax.plot([], [], color=colour, marker=marker, label=name)
        ax.set_title(report["point"]["stratum"])
        ax.set_xlim(3e-14, 3.0)
        ax.invert_xaxis()
    for ax in axes[-1]:
        ax.set_xlabel("true relative error of the amplitude")
    for ax in axes[:, 0]:
        ax.set_ylabel("time of a point [s]")
    handles, labels = axes.flat[0].get_legend_handles_labels()
    drawn.legend(handles, labels, loc="outside lower center", ncols=4)
    harness.save(drawn, options, "precision")
    plt.close(drawn)


def main(argv=None):
    """Measure, write, draw."""
    options = harness.prepare(harness.option_parser(__doc__).parse_args(argv))
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    model, peers, missing = peers_available(harness.DECK, options.build)
    exact = [p for p in peers if p.name == "heyoka, events"]
    if not exact:
        raise SystemExit("; ".join(missing))
    chosen = points.regimes(points.read_map(points.map_file(options)))
    levels = points.LEVELS
    if options.quick:
        chosen, levels = [chosen[i] for i in QUICK_REGIMES], QUICK_LEVELS
        options.repeats = min(options.repeats, 2)
    good, bad = points.Truths(options.build, options.out, model, exact[0]).complete(chosen)
    for point in bad:
        print(f"left out: {point.stratum}: map, reference and heyoka do not find the same motion")
    spurflex = [Spurflex(options.build, options.out / "runs", name) for name in ("collocation", "newmark")]
    reports = []
    for point in good:
        print(f"{point.stratum}: {point.speed:g} rev/min, {point.stiffness:.3g} N/m", flush=True)
        equations = model.at(point.speed, point.stiffness)
        entries = measure(point, equations, spurflex, peers, levels, options.repeats)
        reports.append({"point": points.describe([point])[0], "solvers": entries})
    report = {
        "part": "precision",
        "quick": options.quick,
        "provenance": harness.provenance(harness.Program(options.build, options.out / "runs"))
        | versions(options.build),
        "missing": missing,
        "conventions": [
            "times are of one point on one core, medians over the repeats; SciPy runs once",
            "peers: integration only, without compilation, set-up and the search for extremes",
            "spurflex: 64 copies of the point that share modes, tables and lanes, over 64 (slow ones: 8), "
            "with set-up, class of motion, extremes and error estimate; median of up to nine solutions",
            "peers drop max(rule, fewest) mesh periods: rule = ln(2/level) over the decay rate of the "
            "slowest Floquet multiplier, fewest = until the rest is seen to stay below level/2",
            "heyoka batch: eight lanes with the same point, time divided by eight",
            "extrapolated: fewer periods were run, from the steady motion, and their time was scaled up",
        ],
        "regimes": reports,
    }
    harness.write(options, "precision", report)
    plot(reports, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
