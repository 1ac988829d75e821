"""What the parts of the benchmark share: options, decks, timed runs of the program, provenance, figures."""

import argparse
import contextlib
import json
import os
import platform
import re
import statistics
import subprocess
import sys
import time
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np
from spurflex_postproc import output, style

ROOT = Path(__file__).resolve().parents[2]
DECK = ROOT / "input" / "paper" / "figure9.nml"

COMPLETE, FAILED_POINTS = 0, 4  # exit codes of the program with a complete result file
DISTURBED = 0.05  # share of the processors that others may use while a run is timed
BYTES_PER_KIB = 1024
MEGABYTE = 1e6
# Open MPI 4 and 5 bind a job of one or two ranks to the first cores, as if it were alone.
UNBOUND = {"OMPI_MCA_hwloc_base_binding_policy": "none", "PRTE_MCA_hwloc_default_binding_policy": "none"}

# Options and decks -------------------------------------------------------------------------------


def option_parser(description, repeats=5):
    """Options that every part has."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--build", type=Path, default=ROOT / "build", help="folder with the program spurflex")
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "benchmark", help="folder of results")
    parser.add_argument("--quick", action="store_true", help="small grids: does it work, not how fast is it")
    parser.add_argument("--repeats", type=int, default=repeats, help="runs of each kind (%(default)s)")
    return parser


def prepare(options):
    """Make the paths absolute and the folders of results."""
    options.build = options.build.resolve()
    options.out = options.out.resolve()
    if options.repeats < 1:
        raise SystemExit("--repeats must be at least 1")
    (options.out / "runs").mkdir(parents=True, exist_ok=True)
    if not (options.build / "spurflex").is_file():
        raise SystemExit(f"{options.build}/spurflex is not built; scripts/build does it")
    return options


def patched_deck(**values):
    """The deck of figure 9 with some keys changed; texts get their quotes here."""
    text = DECK.read_text()
    for key, value in values.items():
        written = f"'{value}'" if isinstance(value, str | Path) else repr(value)
        line = re.compile(rf"^(\s*{key}\s*=\s*)[^!\n]*", flags=re.M)
        text, count = line.subn(lambda m, w=written: f"{m[1]}{w} ", text)
        if count != 1:
            raise RuntimeError(f"{DECK}: {count} lines with {key}")
    return text


# Runs --------------------------------------------------------------------------------------------


@dataclass
class Run:
    """One run of the program, measured from outside."""

    ranks: int
    wall_seconds: float  # from the start of mpirun to its end
    cpu_seconds: float  # of mpirun and all ranks
    others_share: float | None  # of the processors, used by others meanwhile
    memory_megabytes: list | None  # peak of the resident memory by rank, largest first, if asked for
    program_seconds: float | None  # as the log says it: without the start of MPI
    log: str = field(repr=False)

    def summary(self):
        """Everything but the log."""
        return {k: v for k, v in asdict(self).items() if k != "log"}


class Program:
    """The program under test."""

    def __init__(self, build, folder):
        self.path = build / "spurflex"
        self.folder = folder
        self.mpiexec = mpiexec_of(build)

    def prepare(self, name, **values):
        """Write a deck for a run; paths of the deck and of its result file, which is not there yet."""
        deck, result = self.folder / f"{name}.nml", self.folder / f"{name}.h5"
        deck.write_text(patched_deck(file=result, **values))
        clear(result)
        return deck, result

    def run(self, deck, ranks, memory=False, beside=False):
        """Run a deck under mpirun and measure it; memory takes a wrapper, which starts a little later.

        beside: another run goes on meanwhile, and must not be bound to the same core.
        """
        reports = self.folder / "memory"
        wrapper = []
        if memory:
            reports.mkdir(exist_ok=True)
            for old in reports.glob("*.json"):
                old.unlink()
            script = Path(__file__).with_name("rank_memory.py")
            wrapper = [sys.executable, "-S", "-E", str(script), str(reports)]
        command = [*self.mpiexec, str(ranks), *wrapper, str(self.path), str(deck)]
        run = measured(command, ranks, UNBOUND if beside else {})
        if memory:
            peaks = [json.loads(path.read_text())["peak_kib"] for path in reports.glob("*.json")]
            run.memory_megabytes = sorted((k * BYTES_PER_KIB / MEGABYTE for k in peaks), reverse=True)
        return run


def clear(result):
    """Remove a result file and what belongs to it."""
    for ending in ("", ".part", ".lock"):
        result.with_name(result.name + ending).unlink(missing_ok=True)


def mpiexec_of(build):
    """Words before the number of ranks: those of the library that the build is linked with."""
    cache = build / "CMakeCache.txt"
    text = cache.read_text() if cache.is_file() else ""
    keys = ("MPIEXEC_EXECUTABLE", "MPIEXEC_NUMPROC_FLAG")
    program, flag = (re.search(rf"^{key}:\w+=(.+)$", text, flags=re.M) for key in keys)
    return [program[1] if program else "mpirun", flag[1] if flag else "-n"]


def measured(command, ranks, variables=None):
    """Run a command that starts so many ranks, with these variables added: its output and what it used."""
    environment = {**os.environ, **(variables or {})}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    busy, start = busy_seconds(), time.perf_counter()
    with subprocess.Popen(command, env=environment, **pipes) as process:
        log = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (COMPLETE, FAILED_POINTS):
        raise RuntimeError(f"{' '.join(command)}: exit code {process.returncode}\n{log}")
    cpu = usage.ru_utime + usage.ru_stime
    others = None
    if busy is not None:
        others = max(0.0, busy_seconds() - busy - cpu) / (wall * os.cpu_count())
    done = re.search(r"^done in ([\d.]+) s", log, flags=re.M)
    return Run(ranks, wall, cpu, others, None, float(done[1]) if done else None, log)


def busy_seconds():
    """Processor time that everything on this machine has used; none where the system does not say."""
    try:
        words = Path("/proc/stat").read_text().split("\n", 1)[0].split()
    except OSError:
        return None
    user, nice, system, _idle, _iowait, irq, softirq = map(int, words[1:8])
    return (user + nice + system + irq + softirq) / os.sysconf("SC_CLK_TCK")


def disturbed(runs):
    """How many of the runs others disturbed."""
    return sum(r.others_share is not None and r.others_share > DISTURBED for r in runs)


def spread(values):
    """Median, extremes and all values."""
    values = list(values)
    return {"median": statistics.median(values), "min": min(values), "max": max(values), "values": values}


def paths_in(log):
    """Points by path and seconds by stage, of all lines `... by path` of the log together, and the lines."""
    points, seconds, lines = {}, {}, []
    for line in log.splitlines():
        found = re.search(r"\b(points|time) by path\b[^:]*:(.*)", line)
        if not found:
            continue
        lines.append(line.strip())
        if found[1] == "points":
            for count, name in re.findall(r"(\d+) (\w+)", re.sub(r"\([^)]*\)", "", found[2])):
                points[name] = points.get(name, 0) + int(count)
        else:
            for name, spent in re.findall(r"(\w+) ([\d.]+) s\b", found[2]):
                seconds[name] = seconds.get(name, 0.0) + float(spent)
    return {"points": points, "seconds": seconds, "lines": lines}


def steps_in(log):
    """Steps of points in all lanes, and their modes on average, by kind.

    Of all lines `steps in N lanes ...` of the log together.
    """
    steps, modes = {}, {}
    for lanes, kinds in re.findall(r"^steps in (\d+) lanes at once: (.*)$", log, flags=re.M):
        for count, name, mean in re.findall(r"(\d+) (?:of )?(\w+) with ([\d.]+) modes", kinds):
            steps[name] = steps.get(name, 0) + int(lanes) * int(count)
            modes[name] = modes.get(name, 0.0) + int(lanes) * int(count) * float(mean)
    return steps, {name: modes[name] / max(count, 1) for name, count in steps.items()}


# Result files ------------------------------------------------------------------------------------


def outcome_of(result):
    """Points by status, motion and contact, and the distribution of the error estimates."""
    outcome = {}
    with h5py.File(result, locking=False) as file:
        for prefix in ("", "rigid_"):
            if prefix + "status" not in file:
                continue
            counts = {name: counts_of(file[prefix + name]) for name in ("status", "motion", "contact")}
            error = file[prefix + "error_estimate"][:]
            error = error[np.isfinite(error)]
            shares = (0.5, 0.9, 0.99, 1.0) if error.size else ()
            outcome["rigid" if prefix else "flexible"] = counts | {
                "points": file[prefix + "status"].size,
                "error_estimate_quantiles": {f"{q:g}": float(np.quantile(error, q)) for q in shares},
            }
    return outcome


def counts_of(variable):
    """How often each flag of a variable occurs."""
    meanings = variable.attrs["flag_meanings"]
    meanings = meanings.decode() if isinstance(meanings, bytes) else str(meanings)
    names = dict(zip(map(int, variable.attrs["flag_values"]), meanings.split(), strict=True))
    values, counts = np.unique(variable[:], return_counts=True)
    return {names.get(int(v), str(v)): int(n) for v, n in zip(values, counts, strict=True)}


# Provenance, verdicts, figures -------------------------------------------------------------------


def provenance(program, result=None):
    """On what and with what the numbers were measured."""
    facts = {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": processor(),
        "processors": os.cpu_count(),
        "system": platform.platform(),
        "load_before": os.getloadavg()[0],
        "program": command_line_of([str(program.path), "--version"]),
        "mpirun": command_line_of([program.mpiexec[0], "--version"]),
        "commit": command_line_of(["git", "-C", str(ROOT), "rev-parse", "HEAD"]),
        "sources_changed": bool(command_line_of(["git", "-C", str(ROOT), "status", "--porcelain", "src"])),
    }
    if result:
        with h5py.File(result, locking=False) as file:
            for key in ("version", "commit", "compiler", "flags", "mpi", "hdf5"):
                with contextlib.suppress(KeyError):
                    value = file["provenance"][key].asstr()[()]
                    facts[f"program_{key}"] = str(value).strip()
    return facts


def processor():
    """Name of the processor."""
    with contextlib.suppress(OSError):
        found = re.search(r"^model name\s*:\s*(.*)$", Path("/proc/cpuinfo").read_text(), flags=re.M)
        if found:
            return found[1]
    return platform.processor() or platform.machine()


def command_line_of(command):
    """First line that a command prints; empty if it fails."""
    try:
        run = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return (run.stdout.splitlines() or [""])[0] if run.returncode == 0 else ""


def judge(value, limit, at_most=True):
    """A number against its target; not judged where the number is not known."""
    met = None if value is None else bool(value <= limit if at_most else value >= limit)
    return {"value": value, "target": f"{'<=' if at_most else '>='} {limit:g}", "met": met}


def write(options, name, report):
    """Write a report; say which targets it meets."""
    path = options.out / f"{name}.json"
    path.write_text(json.dumps(report, indent=1) + "\n")
    for title, verdict in report.get("targets", {}).items():
        state = {True: "ok  ", False: "MISS", None: "?   "}[verdict["met"]]
        value = "not measured" if verdict["value"] is None else f"{verdict['value']:.4g}"
        print(f"{state} {title}: {value} ({verdict['target']})")
    print(f"report: {path}")


def figure(columns=1, height=65.0, width=style.SINGLE):
    """A figure in the style of the project, and its axes."""
    style.apply()
    import matplotlib.pyplot as plt

    drawn, axes = plt.subplots(1, columns, figsize=style.size(width, height), layout="constrained")
    return drawn, axes


def save(drawn, options, name):
    """Write a figure as PNG and PDF."""
    output.save(drawn, options.out, name)
