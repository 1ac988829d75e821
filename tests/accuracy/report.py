"""Judge the numbers of result files by brute force.

usage: report.py --program SPURFLEX --reference REFERENCE_MOTION [--mpiexec "mpirun -n"]
                 [--output FOLDER] [--small] [--map FILE]

Runs spurflex and the reference on the same points of input/paper/figure9.nml, compares, and writes
report.md, report.json and plots into FOLDER; exit code 1 if a criterion fails. A result file given with
--map is judged too, at the points that it shares. Reference motions are kept in FOLDER/reference.csv
and not computed again while the deck stays the same; --small computes all of its few anew.
"""

import argparse
import csv
import hashlib
import json
import re
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
DECK = ROOT / "input" / "paper" / "figure9.nml"

FLOOR = 1e-9  # errors of the reference itself stay below: it agrees with its own finer runs to this
FACTOR = 10.0  # how near an estimate must be to the error
NEAR_ENOUGH = 0.95  # share of the points at which it must be
MOST_UNRESOLVED = 0.01  # share of points
ORDER, ORDER_MARGIN = 2.0, 0.05  # of Newmark's method without contact loss
FINER = 1e-13  # local error of finer runs of the reference
ORDER_FLOOR = 2e-11  # errors above this are those of the method, beside a finer run
PERIODS, SOFT_PERIODS, SOFT = 20000, 100000, 1.001e5  # mesh periods; support stiffness [N/m]
FAILED_POINTS = 4  # exit code of spurflex: complete, but some points failed

RIGID = 0.0
UNRESOLVED, QUASI_PERIODIC, CHAOTIC = 0, -1, -2
CLASS_NAMES = {UNRESOLVED: "unresolved", QUASI_PERIODIC: "quasi-periodic", CHAOTIC: "chaotic"}


@dataclass
class Grid:
    """A part of the grid of figure 9: evenly spaced speeds, stiffnesses so many to a decade."""

    name: str
    speeds: tuple  # first, last, count
    stiffnesses: tuple


TWO_A_DECADE = (1e3, 1e12, 19)
SEVEN_ROWS = (1e3, 1e12, 7)
GRIDS = [
    Grid("whole range", (300, 6000, 20), TWO_A_DECADE),
    Grid("resonance 1150-1350", (1150, 1350, 5), SEVEN_ROWS),
    Grid("resonance 1700-2000", (1700, 2000, 7), SEVEN_ROWS),
    Grid("jump 3070-3140", (3070, 3140, 8), SEVEN_ROWS),
    Grid("irregular 4600-5500", (4600, 5500, 16), SEVEN_ROWS),
    Grid("onset 5380-5450", (5380, 5450, 8), SEVEN_ROWS),
]
SMALL_GRIDS = [Grid("small", (1290, 5490, 4), (1e4, 1e12, 5))]
SETTINGS = [
    ("collocation", 1e-3),
    ("collocation", 1e-6),
    ("newmark", 1e-3),
    ("newmark", 1e-6),
]

# Name, speed, stiffness, contact is kept.
REGIMES = [
    ("1T without loss", 600.0, 1e8, True),
    ("1T with loss", 3500.0, 1e9, False),
    ("resonance", 1290.0, 2.5118864315095822e8, False),
    ("2T", 5500.0, 1e9, False),
    ("soft support", 2000.0, 1e4, True),
    ("stiff support", 3600.0, 1e12, False),
]
STEPS = {"newmark": (128, 256, 512, 1024, 2048, 4096), "collocation": (8, 12, 16, 24, 32, 48)}


def key_of(speed, stiffness):
    """Points are the same if they agree to ten digits."""
    return f"{speed:.9e}", f"{stiffness:.9e}"


def name_of(speed, stiffness, periods):
    """Name of a reference motion."""
    return (*key_of(speed, stiffness), periods)


def keep_in(rows, row):
    """Take a line of the reference."""
    point = {k: (v if k in ("start", "stamp") else float(v)) for k, v in row.items()}
    point["motion"] = int(point["motion"])
    rows[name_of(point["speed"], point["support_stiffness"], int(point["periods_asked"]))] = point


class Reference:
    """Reference motions: computed once, kept in a file."""

    def __init__(self, program, folder, workers):
        self.program = program
        self.file = folder / "reference.csv"
        self.folder = folder
        self.workers = workers
        problem = re.sub(r"&(sweep|solver|output)\b.*?^/", "", DECK.read_text(), flags=re.S | re.M)
        self.stamp = hashlib.sha256(problem.encode()).hexdigest()[:16]
        self.rows = {}
        if self.file.is_file():
            with self.file.open() as lines:
                for row in csv.DictReader(lines):
                    if row["stamp"] == self.stamp:
                        keep_in(self.rows, row)

    def solve(self, points, periods_of, tolerance=None):
        """Motions of points (speed, stiffness), in their order; a finer tolerance is never kept."""
        wanted = [(speed, k, periods_of(k)) for speed, k in points]
        missing = [w for w in wanted if tolerance or name_of(*w) not in self.rows]
        missing = sorted(set(missing), key=lambda w: (w[1] == RIGID, w[1], w[0]))
        batch = 4
        batches = [missing[i : i + batch] for i in range(0, len(missing), batch)]
        fresh = {}  # of a finer tolerance
        with ThreadPoolExecutor(self.workers) as pool:
            tasks = [pool.submit(self.run, number, part, tolerance) for number, part in enumerate(batches)]
            for number, task in enumerate(tasks):
                for row in task.result():
                    keep_in(fresh if tolerance else self.rows, row)
                    if not tolerance:
                        self.append(row)
                if number % 10 == 9:
                    done = min((number + 1) * batch, len(missing))
                    print(f"reference: {done} of {len(missing)} points", flush=True)
        source = fresh if tolerance else self.rows
        return [source[name_of(*w)] for w in wanted]

    def run(self, number, part, tolerance):
        points, output = self.folder / f"points-{number}.csv", self.folder / f"reference-{number}.csv"
        lines = [f"{speed!r},{stiffness!r},static,{periods}" for speed, stiffness, periods in part]
        points.write_text("\n".join(["speed,support_stiffness,start,periods", *lines, ""]))
        command = [self.program, DECK, points, output, *([repr(tolerance)] if tolerance else [])]
        subprocess.run([str(c) for c in command], check=True)
        with output.open() as text:
            rows = [{k: v.strip() for k, v in row.items()} for row in csv.DictReader(text)]
        if len(rows) != len(part):
            raise RuntimeError(f"{output}: {len(rows)} lines for {len(part)} points")
        points.unlink()
        output.unlink()
        return [row | {"stamp": self.stamp} for row in rows]

    def append(self, row):
        is_new = not self.file.is_file()
        with self.file.open("a", newline="") as text:
            writer = csv.DictWriter(text, list(row))
            if is_new:
                writer.writeheader()
            writer.writerow(row)


def patched(**values):
    """The deck of figure 9 with some keys changed."""
    text = DECK.read_text()
    for key, value in values.items():
        text, count = re.subn(rf"^(\s*{key}\s*=\s*)[^!\n]*", rf"\g<1>{value} ", text, flags=re.M)
        if count != 1:
            raise RuntimeError(f"{DECK}: {count} lines with {key}")
    return text


class Spurflex:
    """Runs of the program under test."""

    def __init__(self, program, mpiexec, ranks, folder):
        self.program, self.mpiexec, self.ranks, self.folder = program, mpiexec, ranks, folder

    def run(self, name, speeds, stiffnesses, integrator, tolerance, steps=0, support="both"):
        """Points of a grid, as dictionaries by (speed, stiffness)."""
        deck, result = self.folder / f"{name}.nml", self.folder / f"{name}.h5"
        result.unlink(missing_ok=True)
        deck.write_text(
            patched(
                integrator=f"'{integrator}'",
                steps_per_period=steps,
                tolerance=repr(tolerance),
                max_periods=PERIODS,
                support=f"'{support}'",
                speed_first=float(speeds[0]),
                speed_last=float(speeds[1]),
                speed_count=speeds[2],
                stiffness_first=repr(stiffnesses[0]),
                stiffness_last=repr(stiffnesses[1]),
                stiffness_count=stiffnesses[2],
                file=f"'{result}'",
                products="'map', 'floquet', 'lyapunov'",
            )
        )
        with (self.folder / f"{name}.log").open("w") as log:
            command = [*self.mpiexec, str(self.ranks), str(self.program), str(deck)]
            code = subprocess.run(command, stdout=log, stderr=log, check=False).returncode
        if code not in (0, FAILED_POINTS):
            raise RuntimeError(f"spurflex {deck}: exit code {code}")
        return read_result(result)


QUANTITIES = [
    "y1_amplitude",
    "y1_rms",
    "y1_max",
    "y1_min",
    "bearing1_deformation_max",
    "bearing2_deformation_max",
    "error_estimate",
    "floquet_magnitude",
    "motion",
    "contact",
]


def read_result(path):
    """Points of a result file by key."""
    points = {}
    with h5py.File(path) as file:
        attributes = file["motion"].attrs
        flags = dict(
            zip(
                map(int, attributes["flag_values"]), attributes["flag_meanings"].decode().split(), strict=True
            )
        )

        def add(speed, stiffness, prefix, place):
            point = {q: file[prefix + q][place].item() for q in QUANTITIES if prefix + q in file}
            point["class"] = class_of(flags, point["motion"])
            point["speed"], point["stiffness"] = float(speed), float(stiffness)
            for eta in ("eta1", "eta2"):
                point[eta] = file[eta][place].item() if stiffness and eta in file else np.nan
            points[key_of(speed, stiffness)] = point

        for i, speed in enumerate(file["speed"][:]):
            if "rigid_motion" in file:
                add(speed, RIGID, "rigid_", (i,))
            for j, stiffness in enumerate(file["support_stiffness"][:]):
                add(speed, stiffness, "", (j, i))
    return points


def class_of(flags, motion):
    """Mesh periods after which a motion repeats, or one of the other classes."""
    name = flags.get(motion, f"period_{motion - 100}")
    if name.startswith("period_"):
        return int(name.removeprefix("period_"))
    return {"unresolved": UNRESOLVED, "quasi_periodic": QUASI_PERIODIC, "chaotic": CHAOTIC}[name]


def class_name(motion):
    return CLASS_NAMES.get(motion, f"{motion}T")


def relative(value, truth):
    return abs(value - truth) / abs(truth) if truth else abs(value)


def error_of(point, truth):
    """The larger relative error of amplitude and bearing deformations."""
    names = ("y1_amplitude", "bearing1_deformation_max", "bearing2_deformation_max")
    return max(relative(point[n], truth[n]) for n in names)


def other_errors(point, truth, rigid, half_backlash):
    """Errors of the other numbers of a periodic motion."""
    amplitude = truth["y1_amplitude"]
    errors = {
        "y1_rms": relative(point["y1_rms"], truth["y1_rms"]),
        "y1_max": abs(point["y1_max"] - truth["y1_max"]) / amplitude,
        "y1_min": abs(point["y1_min"] - truth["y1_min"]) / amplitude,
        "floquet_magnitude": abs(point["floquet_magnitude"] - truth["floquet_magnitude"]),
    }
    if rigid and rigid["motion"] > 0:
        for i in (1, 2):
            name = f"bearing{i}_deformation_max"
            eta = 100 * (truth[name] / rigid[name] - 1)
            errors[f"eta{i}"] = abs(point[f"eta{i}"] - eta) / 100
    smallest, largest = truth["smallest_deflection"] - half_backlash, truth["largest_deflection"]
    contact = 0 if smallest >= 0 or largest <= -half_backlash else 1
    if contact and largest >= half_backlash and truth["smallest_deflection"] <= -half_backlash:
        contact = 2
    # A motion that grazes a border to this share of the backlash may count either way.
    grazes = min(abs(smallest), abs(smallest + 2 * half_backlash)) < 1e-3 * half_backlash
    errors["contact"] = 0.0 if grazes or contact == point["contact"] else 1.0
    return errors


@dataclass
class Verdict:
    """Comparison of one setting."""

    name: str
    tolerance: float
    errors: list = field(default_factory=list)  # (speed, stiffness, error, estimate, status)
    others: dict = field(default_factory=dict)
    confusion: dict = field(default_factory=dict)
    defects: list = field(default_factory=list)
    points: int = 0
    unresolved: int = 0
    reference_unresolved: int = 0

    def add_points(self, found, truths):
        """Compare the points that both have."""
        half_backlash = deck_number("half_backlash")
        for key, truth in truths.items():
            if key in found:
                self.add(found[key], truth, truths[key_of(truth["speed"], RIGID)], half_backlash)

    def add(self, point, truth, rigid, half_backlash):
        self.points += 1
        self.unresolved += point["class"] == UNRESOLVED
        self.reference_unresolved += truth["motion"] == UNRESOLVED
        classes = class_name(truth["motion"]), class_name(point["class"])
        self.confusion[classes] = self.confusion.get(classes, 0) + 1
        where = {"speed": point["speed"], "stiffness": point["stiffness"], "setting": self.name}
        numbers = {
            "class": classes[1],
            "true_class": classes[0],
            "amplitude": point["y1_amplitude"],
            "true_amplitude": truth["y1_amplitude"],
            "estimate": point["error_estimate"],
            "true_exponent": truth["lyapunov_exponent"],
            "true_exponent_error": truth["lyapunov_error"],
        }
        if classes[0] != classes[1]:
            if UNRESOLVED not in (truth["motion"], point["class"]):
                self.defects.append(where | {"kind": "class"} | numbers)
            return
        if truth["motion"] <= 0:
            return
        error, estimate = error_of(point, truth), point["error_estimate"]
        self.errors.append((point["speed"], point["stiffness"], error, estimate))
        numbers["error"] = error
        if error > max(self.tolerance, FLOOR):
            kind = "another motion" if error > max(100 * estimate, 1e-3) else "error above the tolerance"
            self.defects.append(where | {"kind": kind} | numbers)
        elif error > FLOOR and not estimate >= error / FACTOR:
            self.defects.append(where | {"kind": "estimate too small"} | numbers)
        for name, value in other_errors(point, truth, rigid, half_backlash).items():
            if not value <= self.others.get(name, (-1.0,))[0]:
                self.others[name] = (value, point["speed"], point["stiffness"])

    def summary(self):
        e = np.array(self.errors).reshape(-1, 4)
        error, estimate = e[:, 2], e[:, 3]
        judged = error > FLOOR
        ratio = estimate[judged] / error[judged]
        near = (ratio <= FACTOR) & (ratio >= 1 / FACTOR)
        told = {k: n for k, n in self.confusion.items() if CLASS_NAMES[UNRESOLVED] not in k}
        agree = sum(n for (a, b), n in told.items() if a == b)
        known = sum(told.values())
        return {
            "setting": self.name,
            "points": self.points,
            "periodic": len(e),
            "below_tolerance": int(np.sum(error <= max(self.tolerance, FLOOR))),
            "largest_error": float(error.max(initial=0.0)),
            "median_error": float(np.median(error)) if len(e) else None,
            "judged_estimates": int(judged.sum()),
            "estimates_near": int(near.sum()),
            "estimates_too_small": int(np.sum(ratio < 1 / FACTOR)),
            "estimates_too_large": int(np.sum(ratio > FACTOR)),
            "classes_agree": agree,
            "classes_known": known,
            "unresolved": self.unresolved,
            "reference_unresolved": self.reference_unresolved,
            "other_errors": {k: {"value": v[0], "at": v[1:]} for k, v in self.others.items()},
            "confusion": {f"{a} -> {b}": n for (a, b), n in sorted(self.confusion.items())},
        }


def criteria_of(summary):
    """Name and outcome of each criterion of one setting."""
    near, judged = summary["estimates_near"], summary["judged_estimates"]
    return {
        "every error below the tolerance": summary["below_tolerance"] == summary["periodic"],
        "estimates within a factor 10 at 95 %": near >= NEAR_ENOUGH * judged,
        "classes agree": summary["classes_agree"] >= summary["classes_known"],
        "unresolved at most 1 %": summary["unresolved"] <= MOST_UNRESOLVED * summary["points"],
        "contact agrees": summary["other_errors"].get("contact", {"value": 0.0})["value"] == 0.0,
    }


def tolerance_of(path):
    """Tolerance that a result file promises."""
    with h5py.File(path) as file:
        deck = file["provenance/resolved_deck"][()].decode()
    return float(re.search(r"^\s*tolerance = (\S+)", deck, flags=re.M).group(1))


def step_study(spurflex, reference, regimes):
    """Errors by steps a period, method and regime."""
    study = []
    for name, speed, stiffness, kept in regimes:
        truth = reference.solve([(speed, stiffness)], lambda _: PERIODS, FINER)[0]
        for method, counts in STEPS.items():
            errors = []
            for steps in counts:
                grid = (speed, speed, 1), (stiffness, stiffness, 1)
                points = spurflex.run("steps", *grid, method, 1e-3, steps, "flexible")
                errors.append(error_of(next(iter(points.values())), truth))
            study.append(
                {
                    "regime": name,
                    "speed": speed,
                    "stiffness": stiffness,
                    "contact_kept": kept,
                    "method": method,
                    "motion": class_name(int(truth["motion"])),
                    "steps": counts,
                    "errors": errors,
                    "order": order_of(counts, errors),
                }
            )
    return study


def order_of(steps, errors):
    """Slope of the errors over the finest four steps whose errors are above the reference's own."""
    steps, errors = np.array(steps), np.array(errors)
    seen = errors > ORDER_FLOOR
    if seen.sum() < 3:
        return None
    s, e = steps[seen][-4:], errors[seen][-4:]
    return float(-np.polyfit(np.log(s), np.log(e), 1)[0])


def own_error(reference, points, truths):
    """How much finer runs of the reference differ from it, at some periodic points."""
    both = zip(points, truths, strict=True)
    chosen = [(p, t) for p, t in both if t["motion"] > 0 and t["periods"] < PERIODS]
    chosen = chosen[:: max(1, len(chosen) // 24)]
    finer = reference.solve([p for p, _ in chosen], periods_of, FINER)
    return max((error_of(f, t) for f, (_, t) in zip(finer, chosen, strict=True)), default=0.0), len(chosen)


def periods_of(stiffness):
    return SOFT_PERIODS if RIGID < stiffness <= SOFT else PERIODS


def unique_points(grids):
    """Points of the grids, each once, the rigid twins too."""
    points = {}
    for grid in grids:
        for speed in np.linspace(*grid.speeds):
            speed = round(float(speed), 9)
            points[key_of(speed, RIGID)] = (speed, RIGID)
            for k in np.geomspace(*grid.stiffnesses):
                points.setdefault(key_of(speed, k), (speed, float(k)))
    return list(points.values())


def deck_number(key):
    return float(re.search(rf"^\s*{key}\s*=\s*([^!\n]*)", DECK.read_text(), flags=re.M).group(1))


def order_of_reference(program):
    """Orders that the reference's integrator shows with steps of one length."""
    command = [str(program), "--order", str(DECK), "3000", "1e8"]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    return [float(row["order"]) for row in csv.DictReader(run.stdout.splitlines())]


def plot(verdicts, study, folder):
    """Error over estimate, errors over steps, where the sample lies."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    size = (3.6 * len(verdicts), 3.8)
    figure, axes = plt.subplots(1, len(verdicts), figsize=size, sharex=True, sharey=True)
    for ax, v in zip(np.atleast_1d(axes), verdicts, strict=True):
        e = np.array(v.errors).reshape(-1, 4)
        line = np.array([1e-14, 1e0])
        ax.fill_between(line, line / FACTOR, line * FACTOR, color="0.9")
        ax.axhline(v.tolerance, color="tab:red", lw=0.8)
        ax.axhline(FLOOR, color="0.5", lw=0.8, ls=":")
        ax.loglog(np.maximum(e[:, 3], 1e-14), np.maximum(e[:, 2], 1e-14), ".", ms=3)
        ax.set(title=v.name, xlabel="estimate", xlim=(1e-13, 1), ylim=(1e-13, 1))
    np.atleast_1d(axes)[0].set_ylabel("true relative error")
    save(figure, folder / "estimate")

    if study:
        names = list(dict.fromkeys(s["regime"] for s in study))
        figure, axes = plt.subplots(1, len(names), figsize=(3.0 * len(names), 3.4), sharey=True)
        for ax, name in zip(np.atleast_1d(axes), names, strict=True):
            for s in (s for s in study if s["regime"] == name):
                order = "" if s["order"] is None else f", order {s['order']:.2f}"
                ax.loglog(s["steps"], np.maximum(s["errors"], 1e-14), "o-", ms=3, label=s["method"] + order)
            ax.axhline(FLOOR, color="0.5", lw=0.8, ls=":")
            ax.set(title=name, xlabel="steps a mesh period")
            ax.legend(fontsize=6)
        np.atleast_1d(axes)[0].set_ylabel("true relative error")
        save(figure, folder / "steps")

    figure, axes = plt.subplots(1, len(verdicts), figsize=size, sharey=True)
    for ax, v in zip(np.atleast_1d(axes), verdicts, strict=True):
        e = np.array([p for p in v.errors if p[1] > 0]).reshape(-1, 4)
        colour = np.log10(np.maximum(e[:, 2], 1e-12) / v.tolerance)
        shown = ax.scatter(e[:, 0], e[:, 1], c=colour, s=6, vmin=-4, vmax=1)
        bad = [(d["speed"], max(d["stiffness"], 5e2)) for d in v.defects]
        if bad:
            ax.plot(*zip(*bad, strict=True), "rx", ms=5)
        ax.set(title=v.name, xlabel="speed [rev/min]", yscale="log")
    np.atleast_1d(axes)[0].set_ylabel("support stiffness [N/m]")
    figure.colorbar(shown, ax=axes, label="log10(error / tolerance)")
    save(figure, folder / "sample", tight=False)


def save(figure, path, tight=True):
    if tight:
        figure.tight_layout()
    for ending in ("png", "pdf"):
        figure.savefig(path.with_suffix(f".{ending}"), dpi=150)


def describe(report):
    """The report as Markdown."""
    lines = ["# Accuracy of result files", ""]
    r = report["reference"]
    lines += [
        f"{r['points']} points of figure 9 ({r['flexible']} flexible, {r['rigid']} rigid) against",
        f"explicit Runge-Kutta of order 8 (seen: {min(r['orders']):.2f}-{max(r['orders']):.2f}) with located",
        f"crossings, {PERIODS} periods from the start, {report['soft_periods']} up to 1e5 N/m.",
        f"Its own error, from finer runs of {r['checked']} points: {r['own_error']:.1e}.",
        "",
        "Classes of the reference: " + ", ".join(f"{n} {k}" for k, n in r["classes"].items()) + ".",
        "",
    ]
    lines += table(
        "setting, periodic, below tolerance, largest error, median, estimate within x10, too small / large, "
        "classes agree, unresolved",
        [
            (
                s["setting"],
                s["periodic"],
                s["below_tolerance"],
                f"{s['largest_error']:.1e}",
                f"{s['median_error'] or 0:.1e}",
                f"{s['estimates_near']} of {s['judged_estimates']}",
                f"{s['estimates_too_small']} / {s['estimates_too_large']}",
                f"{s['classes_agree']} of {s['classes_known']}",
                f"{s['unresolved']} of {s['points']}",
            )
            for s in report["settings"]
        ],
    )
    lines += ["", "## Largest errors of the other numbers", ""]
    lines += ["y1_max and y1_min beside the amplitude, eta in units of 100 percent.", ""]
    rows = []
    for s in report["settings"]:
        values = [s["other_errors"].get(n) for n in OTHER_NAMES]
        rows.append((s["setting"], *(f"{v['value']:.1e}" if v else "-" for v in values)))
    lines += table("setting, " + ", ".join(OTHER_NAMES), rows)
    lines += ["", "## Classes: reference -> spurflex", ""]
    for s in report["settings"]:
        lines.append(f"- {s['setting']}: " + ", ".join(f"{k}: {n}" for k, n in s["confusion"].items()))
    lines += ["", "## Error over the step", ""]
    rows = []
    for s in report["steps"]:
        order = "-" if s["order"] is None else f"{s['order']:.2f}"
        errors = ", ".join(f"{n}: {e:.1e}" for n, e in zip(s["steps"], s["errors"], strict=True))
        where = s["regime"], f"{s['speed']:g}", f"{s['stiffness']:.3g}", s["motion"]
        rows.append((*where, s["method"], order, errors))
    lines += table("regime, speed, stiffness, motion, method, order, errors", rows)
    lines += ["", "## Criteria", ""]
    lines += [f"- {'ok  ' if ok else 'FAIL'} {name}" for name, ok in report["criteria"].items()]
    lines += ["", "## Defects", ""]
    for d in report["defects"][:200]:
        shown = f"error {d['error']:.1e}" if "error" in d else f"exponent {d['true_exponent']:.1e}"
        lines.append(
            f"- {d['kind']}: {d['setting']}, {d['speed']:g} rev/min, {d['stiffness']:.4g} N/m: {d['class']}, "
            f"amplitude {d['amplitude']:.6e} m, estimate {d['estimate']:.1e}; truth {d['true_class']}, "
            f"{d['true_amplitude']:.6e} m, {shown}"
        )
    return "\n".join([*lines, ""])


def table(titles, rows):
    """A table in Markdown."""
    titles = titles.split(", ")
    lines = [titles, ["---"] * len(titles), *rows]
    return ["| " + " | ".join(map(str, line)) + " |" for line in lines]


OTHER_NAMES = ("y1_rms", "y1_max", "y1_min", "eta1", "eta2", "floquet_magnitude", "contact")


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--reference", type=Path, required=True)
    parser.add_argument("--mpiexec", default="mpirun -n")
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--output", type=Path, default=ROOT / "results" / "accuracy")
    parser.add_argument("--small", action="store_true", help="a few points, for the tests")
    parser.add_argument("--map", type=Path, action="append", default=[], help="result file to judge too")
    return parser.parse_args()


def main():
    arguments = parse_arguments()
    folder = arguments.output.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if arguments.small:
        (folder / "reference.csv").unlink(missing_ok=True)
    reference = Reference(arguments.reference.resolve(), folder, arguments.ranks)
    runs = folder / "runs"
    runs.mkdir(exist_ok=True)
    spurflex = Spurflex(arguments.program.resolve(), shlex.split(arguments.mpiexec), arguments.ranks, runs)
    grids = SMALL_GRIDS if arguments.small else GRIDS
    soft = (lambda _: PERIODS) if arguments.small else periods_of
    points = unique_points(grids)
    truths = reference.solve(points, soft)
    by_key = {key_of(*p): t for p, t in zip(points, truths, strict=True)}

    verdicts = []
    for integrator, tolerance in SETTINGS:
        print(f"spurflex: {integrator}, tolerance {tolerance:g}", flush=True)
        found = {}
        for number, grid in enumerate(grids):
            name = f"{integrator}-{tolerance:.0e}-{number}"
            found |= spurflex.run(name, grid.speeds, grid.stiffnesses, integrator, tolerance)
        verdicts.append(Verdict(f"{integrator} {tolerance:.0e}", tolerance))
        verdicts[-1].add_points(found, by_key)
    for path in arguments.map:
        verdicts.append(Verdict(path.name, tolerance_of(path)))
        verdicts[-1].add_points(read_result(path), by_key)

    if arguments.small:
        study = step_study(spurflex, reference, REGIMES[:1])
        checked = 0.0, 0
    else:
        study = step_study(spurflex, reference, REGIMES)
        checked = own_error(reference, points, truths)
    orders = order_of_reference(arguments.reference)
    report = assemble(verdicts, study, checked, orders, points, truths)
    report["soft_periods"] = soft(1e3)
    (folder / "report.json").write_text(json.dumps(report, indent=1))
    (folder / "report.md").write_text(describe(report))
    if not arguments.small:
        plot(verdicts, study, folder)
    failed = [name for name, ok in report["criteria"].items() if not ok]
    print(f"report: {folder / 'report.md'}")
    print("every criterion met" if not failed else "failed: " + "; ".join(failed))
    if failed:
        print("\n".join(json.dumps(d) for d in report["defects"][:20]))
    return 1 if failed else 0


def assemble(verdicts, study, checked, orders, points, truths):
    """Everything that is reported."""
    summaries = [v.summary() for v in verdicts]
    criteria = {f"{s['setting']}: {name}": ok for s in summaries for name, ok in criteria_of(s).items()}
    for s in study:
        if s["method"] == "newmark" and s["contact_kept"]:
            met = s["order"] is not None and abs(s["order"] - ORDER) <= ORDER_MARGIN
            criteria[f"Newmark's order, {s['regime']}"] = met
    criteria["order of the reference"] = all(abs(o - 8) < 0.1 for o in orders)
    criteria["own error of the reference"] = checked[0] <= FLOOR
    classes = {}
    for t in truths:
        classes[class_name(t["motion"])] = classes.get(class_name(t["motion"]), 0) + 1
    rigid = sum(k == RIGID for _, k in points)
    return {
        "reference": {
            "points": len(points),
            "rigid": rigid,
            "flexible": len(points) - rigid,
            "orders": orders,
            "own_error": checked[0],
            "checked": checked[1],
            "classes": classes,
        },
        "settings": summaries,
        "steps": study,
        "criteria": criteria,
        "defects": [d for v in verdicts for d in v.defects],
    }


if __name__ == "__main__":
    sys.exit(main())
