"""Time to answer: a sample of the map of figure 9, every solver tuned to the same true error at every point.

At a point a solver runs with the cheapest of its settings that is right there: no setting is right by
promise, all are right by the independent reference. Writes answer.json, answer.md and the figure answer.
"""

import json
import math
import os
import statistics
import sys
from dataclasses import dataclass

import harness
import numpy as np
import points
from harness import style
from solvers import START, Spurflex, peers_available, time_peer, versions

COUNT, QUICK_COUNT = 240, 12
CAP = 0.25  # s of one run; longer ones are extrapolated
TRIAL = 40  # mesh periods from the steady motion in which a setting is tried
TRIES = 3  # settings that are run in full before a solver counts as wrong at a point
HARD = 1e6  # N/m; stiffer supports are judged on their own

# Wanted errors, and the families of solvers that are asked for them.
WANTED = {1e-3: ("heyoka", "CVODE"), 1e-6: ("heyoka",), 1e-9: ("heyoka",)}
# Tolerances that are tried.
SETTINGS = {
    "heyoka": (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12),
    "CVODE": (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8),
    "spurflex, collocation": (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12),
    "spurflex, newmark": (1e-2, 1e-3, 1e-4),
}

# Family, wanted error, points that are judged, least ratio of the times.
TARGETS = (
    ("heyoka", 1e-3, "k_M >= 1e6", 100.0),
    ("heyoka", 1e-6, "k_M >= 1e6", 50.0),
    ("heyoka", 1e-9, "k_M >= 1e6", 20.0),
    ("CVODE", 1e-3, "k_M >= 1e6", 1000.0),
    ("heyoka", 1e-3, "whole map", 1000.0),
)
REGIONS = ("k_M >= 1e6", "whole map")
# Modes that are judged by themselves too: heyoka's as its tutorials have them, without located events in
# lanes, and CVODE with the dense analytic Jacobian, without fixed-point iteration.
USUAL = {
    "heyoka": ("heyoka, batch or events", lambda name: name in ("heyoka, batch", "heyoka, events")),
    "CVODE": ("CVODE, Newton", lambda name: name.startswith("CVODE") and "fixed" not in name),
}


@dataclass
class Setting:
    """A solver with a tolerance, and what a trial says of it."""

    solver: object
    tolerance: float
    seconds: float  # of a mesh period for peers, of the answer for spurflex
    error: float


def family_of(solver):
    """First word of a solver's name."""
    return solver.name.split(",")[0]


def try_peers(point, equations, peers):
    """Every setting of the peers, from the steady motion."""
    tried = []
    for peer in peers:
        for tolerance in SETTINGS[family_of(peer)]:
            runs = [
                peer.run(equations, tolerance, np.array(point.section), TRIAL, point.motion) for _ in range(2)
            ]
            seconds = min(r.seconds for r in runs) / (TRIAL + point.motion)
            error = abs(runs[-1].amplitude / point.amplitude - 1)
            tried.append(Setting(peer, tolerance, seconds, error if math.isfinite(error) else 1.0))
    return tried


def try_spurflex(chosen, spurflex, repeats):
    """Every setting of spurflex at every point, and the time of the whole list a point."""
    tried, lists = [[] for _ in chosen], {}
    for solver in spurflex:
        for tolerance in SETTINGS[solver.name]:
            answers = solver.solve(chosen, tolerance, repeats)
            lists[solver.name, tolerance] = answers[0]["list_seconds"]
            for point, answer, settings in zip(chosen, answers, tried, strict=True):
                amplitude = math.nan if answer["amplitude"] is None else answer["amplitude"]
                error = abs(amplitude / point.amplitude - 1)
                error = error if math.isfinite(error) else 1.0
                settings.append(Setting(solver, tolerance, answer["seconds"], error))
    return tried, lists


def run_setting(setting, point, equations, wanted):
    """One full run."""
    if family_of(setting.solver) == "spurflex":
        return setting.solver.time(point, setting.tolerance)
    periods = point.periods(wanted)
    return time_peer(setting.solver, equations, setting.tolerance, point, periods, CAP)


def choose(tried, point, equations, wanted):
    """The cheapest setting of a solver whose full run is right; None where there is none."""
    right = sorted((s for s in tried if s.error <= wanted), key=lambda s: s.seconds)
    for setting in right[:TRIES]:
        if run_setting(setting, point, equations, wanted).error(point.amplitude) <= wanted:
            return setting
    return None


def measure(point, equations, peers, of_spurflex, repeats):
    """Times of the chosen settings of all solvers at a point, by wanted error."""
    tried = try_peers(point, equations, peers) + of_spurflex
    entries = []
    for wanted, families in WANTED.items():
        settings = {}
        for setting in tried:
            family = family_of(setting.solver)
            if family in ("spurflex", *families):
                # Each mode of a peer is a solver of its own; spurflex takes the better integrator.
                name = family if family == "spurflex" else setting.solver.name
                settings.setdefault(name, []).append(setting)
        chosen = {name: choose(mine, point, equations, wanted) for name, mine in settings.items()}
        timings = {name: [] for name in chosen}
        for round_ in range(repeats):
            # Both orders in turn, so that a drift of the machine hits all alike.
            for name in sorted(chosen)[:: 1 if round_ % 2 == 0 else -1]:
                if chosen[name]:
                    timings[name].append(run_setting(chosen[name], point, equations, wanted))
        for name, setting in chosen.items():
            entry = {"wanted": wanted, "solver": name, "right": setting is not None}
            if setting:
                runs = timings[name]
                seconds = statistics.median(t.seconds for t in runs)
                entry |= {
                    "setting": f"{setting.solver.name}, {setting.tolerance:g}",
                    "seconds": seconds,
                    "seconds_fewest": seconds,
                    "error": runs[-1].error(point.amplitude),
                    "periods": runs[-1].periods,
                    "extrapolated": any(t.extrapolated for t in runs),
                }
                if name != "spurflex":
                    fewest = point.fewest[f"{wanted:g}"] + point.motion
                    entry["seconds_fewest"] *= fewest / (runs[-1].periods + point.motion)
            entries.append(entry)
    return entries


def ratios(reports, wanted, member, region, clock="seconds"):
    """How much longer a peer takes than spurflex over a region of the map.

    `member(name)` says which modes count; the fastest right one is taken at each point. Points stand for
    as many of the map as their stratum has.
    """
    rows, wrong, extrapolated = [], 0, 0
    for report in reports:
        point = report["point"]
        if region == REGIONS[0] and point["stiffness"] < HARD * (1 - 1e-9):
            continue
        entries = [e for e in report["answers"] if e["wanted"] == wanted]
        mine = [e for e in entries if e["solver"] != "spurflex" and member(e["solver"]) and e["right"]]
        ours = [e for e in entries if e["solver"] == "spurflex" and e["right"]]
        if not mine or not ours:
            wrong += 1
            continue
        best = min(mine, key=lambda e: e[clock])
        extrapolated += best["extrapolated"]
        rows.append((best[clock], ours[0][clock], point["weight"]))
    if not rows:
        return {"points": 0, "wrong": wrong}
    peer, ours, weight = np.array(rows).T
    return {
        "points": len(rows),
        "wrong": wrong,
        "extrapolated": int(extrapolated),
        "geometric_mean": float(np.exp(np.average(np.log(peer / ours), weights=weight))),
        "total": float(np.sum(weight * peer) / np.sum(weight * ours)),
        "smallest": float(np.min(peer / ours)),
        "largest": float(np.max(peer / ours)),
        "seconds_per_point": {
            "peer": float(np.average(peer, weights=weight)),
            "spurflex": float(np.average(ours, weights=weight)),
        },
    }


def compare(reports):
    """Every mode and every family, by wanted error and region."""
    comparisons = []
    for wanted, families in WANTED.items():
        names = sorted({e["solver"] for r in reports for e in r["answers"] if e["wanted"] == wanted})
        groups = {family: lambda name, f=family: name.startswith(f) for family in families}
        groups |= dict(USUAL[family] for family in families)
        groups |= {n: lambda name, n=n: name == n for n in names if n != "spurflex"}
        for title, member in groups.items():
            for region in REGIONS:
                for clock in ("seconds", "seconds_fewest"):
                    comparison = ratios(reports, wanted, member, region, clock)
                    comparisons.append(
                        {"peer": title, "wanted": wanted, "region": region, "clock": clock} | comparison
                    )
    return comparisons


def judge(comparisons):
    """The targets, by geometric mean and by total, with the transient that the multiplier asks for."""
    verdicts = {}
    judged = [(peer, *rest) for family, *rest in TARGETS for peer in (family, USUAL[family][0])]
    for peer, wanted, region, least in judged:
        of = [
            c
            for c in comparisons
            if (c["peer"], c["wanted"], c["region"], c["clock"]) == (peer, wanted, region, "seconds")
        ]
        for kind in ("geometric_mean", "total"):
            value = of[0].get(kind) if of else None
            title = f"{peer} over spurflex at {wanted:g}, {region}, {kind.replace('_', ' ')}"
            verdicts[title] = harness.judge(value, least, at_most=False)
    return verdicts


def describe(report):
    """The report as Markdown."""
    lines = [
        "# Time to answer",
        "",
        f"{len(report['points'])} points of figure 9; {report['provenance']['processor']}, one core.",
        "Ratios are time of the peer over time of spurflex; points stand for the size of their stratum.",
        "A family takes its fastest right mode at every point; 'batch or events' leaves out located events",
        "in lanes, which heyoka's tutorials do not have, 'Newton' leaves out CVODE's fixed-point iteration.",
        "'wrong' counts points at which no setting of the peer, or of spurflex, meets the error.",
        "'fewest' charges the peer only for the periods that an oracle would let it run.",
        "",
        "| target | ratio | asked | met |",
        "|---|---|---|---|",
    ]
    for title, v in report["targets"].items():
        value = "-" if v["value"] is None else f"{v['value']:.3g}"
        lines.append(f"| {title} | {value} | {v['target']} | {'yes' if v['met'] else 'no'} |")
    lines += [
        "",
        "| error | region | peer | geometric mean | total | fewest: mean | fewest: total | points | wrong | "
        "extrapolated |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for c in report["comparisons"]:
        if c["clock"] != "seconds":
            continue
        key = [c[k] for k in ("peer", "wanted", "region")]
        same = (o for o in report["comparisons"] if [o[k] for k in ("peer", "wanted", "region")] == key)
        other = next(o for o in same if o["clock"] == "seconds_fewest")
        numbers = [f"{d[k]:.3g}" if k in d else "-" for d in (c, other) for k in ("geometric_mean", "total")]
        cells = [f"{c['wanted']:g}", c["region"], c["peer"], *numbers]
        cells += [c["points"], c["wrong"], c.get("extrapolated", "-")]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    lines += ["", "| spurflex as a list | tolerance | time per point [s] |", "|---|---|---|"]
    for entry in report["spurflex_lists"]:
        lines.append(f"| {entry['solver']} | {entry['tolerance']:g} | {entry['seconds_per_point']:.3g} |")
    return "\n".join([*lines, ""])


def plot(reports, options):
    """Times over the stiffness of the support, one diagram a wanted error."""
    drawn, axes = harness.figure(columns=len(WANTED), width=style.DOUBLE, height=70.0)
    looks = {
        "spurflex": (style.BLUE, "o"),
        "heyoka": (style.VERMILION, "^"),
        "CVODE": (style.GREEN, "s"),
    }
    for ax, (wanted, families) in zip(axes, WANTED.items(), strict=True):
        for family in ("spurflex", *families):
            x, y, hollow = [], [], []
            for report in reports:
                mine = [
                    e
                    for e in report["answers"]
                    if e["wanted"] == wanted and e["solver"].startswith(family) and e["right"]
                ]
                if mine:
                    best = min(mine, key=lambda e: e["seconds"])
                    x.append(report["point"]["stiffness"])
                    y.append(best["seconds"])
                    hollow.append(best["extrapolated"])
            colour, marker = looks[family]
            x, y, hollow = np.array(x), np.array(y), np.array(hollow, bool)
            ax.loglog(x[~hollow], y[~hollow], marker, ms=2.2, mew=0.4, color=colour, label=family)
            ax.loglog(x[hollow], y[hollow], marker, ms=2.2, mew=0.4, color=colour, mfc="white")
        ax.set(title=f"true error at most {wanted:g}", xlabel="support stiffness [N/m]")
        ax.sharey(axes[0])
    axes[0].set_ylabel("time of a point [s]")
    axes[0].legend()
    harness.save(drawn, options, "answer")


def main(argv=None):
    """Measure, judge, write, draw."""
    parser = harness.option_parser(__doc__, repeats=3)
    parser.add_argument("--again", action="store_true", help="judge the measurements of answer.json again")
    options = harness.prepare(parser.parse_args(argv))
    if options.again:
        kept = options.out / "answer.json"
        if not kept.is_file():
            raise SystemExit(f"{kept}: there is none to judge again")
        report = json.loads(kept.read_text())
        finish(report, options)
        return 0
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    model, peers, missing = peers_available(harness.DECK, options.build)
    peers = [p for p in peers if family_of(p) in SETTINGS]
    exact = [p for p in peers if p.name == "heyoka, events"]
    if not exact:
        raise SystemExit("; ".join(missing))
    count = QUICK_COUNT if options.quick else COUNT
    chosen = points.sample(points.read_map(points.map_file(options)), count)
    if options.quick:
        chosen = chosen[:: max(1, len(chosen) // count)]
    good, bad = points.Truths(options.build, options.out, model, exact[0]).complete(chosen)
    print(f"{len(good)} points, {len(bad)} left out", flush=True)
    spurflex = [Spurflex(options.build, options.out / "runs", name) for name in ("collocation", "newmark")]
    # Compilation first, so that it falls into no time.
    for peer in peers:
        for tolerance in SETTINGS[family_of(peer)]:
            peer.run(model.at(good[0].speed, good[0].stiffness), tolerance, START, 1, 0)
    tried, lists = try_spurflex(good, spurflex, options.repeats)
    reports = []
    for number, (point, settings) in enumerate(zip(good, tried, strict=True)):
        equations = model.at(point.speed, point.stiffness)
        answers = measure(point, equations, peers, settings, options.repeats)
        reports.append({"point": points.describe([point])[0], "answers": answers})
        if number % 10 == 9:
            print(f"{number + 1} of {len(good)} points", flush=True)
    report = {
        "part": "answer",
        "quick": options.quick,
        "provenance": harness.provenance(harness.Program(options.build, options.out / "runs"))
        | versions(options.build),
        "missing": missing,
        "conventions": [
            "a solver runs with the cheapest setting that is right there, at every point",
            "peers: integration only, without compilation, set-up and the search for extremes",
            "spurflex: 64 copies of the point that share modes, tables and lanes, over 64 (slow ones: 8), "
            "with set-up, class of motion, extremes and error estimate; median of up to nine solutions",
            "seconds: peers drop max(rule, fewest) mesh periods, rule = ln(2/error) over the decay rate of "
            "the slowest Floquet multiplier; seconds_fewest: fewest, the periods until the rest of the "
            "transient is seen to stay below half of the error",
            "heyoka batch: eight lanes with the same point, time divided by eight",
            f"extrapolated: runs longer than {CAP} s were cut, began on the steady motion, were scaled up",
            "lists: spurflex solves the whole sample at once; time over the number of points, not weighted",
        ],
        "spurflex_lists": [
            {"solver": name, "tolerance": tolerance, "seconds_per_point": seconds}
            for (name, tolerance), seconds in lists.items()
        ],
        "left_out": points.describe(bad),
        "points": reports,
    }
    finish(report, options)
    return 0


def finish(report, options):
    """Compare and judge what was measured, write it, draw it."""
    report["comparisons"] = compare(report["points"])
    report["targets"] = {} if report["quick"] else judge(report["comparisons"])
    harness.write(options, "answer", report)
    (options.out / "answer.md").write_text(describe(report))
    plot(report["points"], options)


if __name__ == "__main__":
    sys.exit(main())
