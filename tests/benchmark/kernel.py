"""The innermost loops: point-steps per second on one core, and what share of the processor's peak that is.

The driver time_kernels.f90 runs them in lanes on eight neighbouring points. It is measured as the release is
built, and built for this processor and with the widest vectors, to see whether a kernel chosen at run time
would pay. Writes kernel.json, kernel.md and the figure kernel.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import harness
from harness import style

SECONDS = 2e-3  # of a repetition
AVX2_LIMIT, AVX512_LIMIT = 1e8, 2e8  # point-steps/s of Newmark's method with eight modes
PAYS = 1.2  # ratio of the rates from which on another build is worth the trouble
JUDGED = "Newmark, flexible"
TANGENTS, TANGENTS_NEWMARK = "collocation, tangents", "Newmark, tangents"
COMPARED = (JUDGED, TANGENTS_NEWMARK, "collocation, flexible", TANGENTS)

WIDEST = "-march=x86-64-v4, 512 bits"

# Builds beside that of --build: options of CMake, and what the processor must have.
BUILDS = {
    "-march=native": (["--preset", "native"], ""),
    WIDEST: (
        [
            "--preset",
            "release",
            "-DSPURFLEX_ARCH=x86-64-v4",
            "-DCMAKE_Fortran_FLAGS=-mprefer-vector-width=512",
        ],
        "avx512f",
    ),
}

# Floating-point operations of a step of one point, or of one tangent, as the sources write them: additions,
# multiplications and divisions one each, a fused multiply-add two; comparisons, choices, minima, maxima and
# moduli none; what all lanes share none. First what each mode takes, then the rest. What a crossing takes on
# top (lane_crossing) is not counted.
OPERATIONS = {
    # advance_newmark: carry a mode 6, sum 1, force 4; free 2, meet 21, N of both ends 1, extremes 1.
    "Newmark": (11, 25),
    # carry_newmark: the same of a mode; n 3, x 5.
    TANGENTS_NEWMARK: (11, 8),
    # advance_lanes: middle of a mode 4, carry 6, sum 1, three forces 12; set_law 29, solve 36,
    # find_margin 34, extremes 4.
    "collocation": (23, 103),
    # set_gain on top: law 3, p and q 30, the solution for two 16, product 30.
    "collocation, flexible, with derivatives": (23, 103 + 79),
    # carry_two, one tangent of the two: the same of a mode; n 15, x 6.
    TANGENTS: (23, 21),
}


def operations(kernel):
    """Operations of an item: those of the longest name that the kernel's begins with."""
    name = max((n for n in OPERATIONS if kernel["kernel"].startswith(n)), key=len)
    per_mode, rest = OPERATIONS[name]
    return per_mode * kernel["modes"] + rest


def measure(build, options):
    """All loops of one build."""
    repeats = 20 if options.quick else options.repeats
    command = [str(build / "tests" / "time_kernels"), str(harness.DECK), str(repeats), str(SECONDS)]
    affinity = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(affinity)})
    try:
        run = subprocess.run(command, capture_output=True, text=True, check=True)
    finally:
        os.sched_setaffinity(0, affinity)
    found = [json.loads(line) for line in run.stdout.splitlines()]
    for kernel in found:
        for which in ("best", "median"):
            kernel[f"{which}_per_second"] = kernel["items"] / kernel[f"{which}_seconds"]
    peaks = [k["best_per_second"] for k in found if k["unit"] == "operations"]
    kernels = [k for k in found if k["unit"] != "operations"]
    for kernel in kernels:
        kernel["operations"] = operations(kernel)
        kernel["share_of_peak"] = kernel["operations"] * kernel["best_per_second"] / max(peaks)
    return {"peak_operations_per_second": max(peaks), "peaks": peaks, "kernels": kernels}


def other_builds(options):
    """The folders of the other builds that this machine can make, and why others are missing."""
    folders, missing = {}, {}
    flags = Path("/proc/cpuinfo")
    able = flags.read_text() if flags.is_file() else ""
    cache = (options.build / "CMakeCache.txt").read_text().splitlines()
    kept = ("MPI_Fortran_COMPILER", "HDF5_Fortran_COMPILER_EXECUTABLE", "CMAKE_Fortran_COMPILER")
    same = [word for line in cache if line.split(":", 1)[0] in kept for word in ("-D", line)]
    for number, (name, (words, needs)) in enumerate(BUILDS.items()):
        folder = options.build / "benchmark" / f"kernel-{number}"
        if needs not in able:
            missing[name] = f"the processor has no {needs}"
            continue
        print(f"building with {name}", flush=True)
        configure = ["cmake", *words, "-S", str(harness.ROOT), "-B", str(folder), *same, "-Wno-dev"]
        make = ["cmake", "--build", str(folder), "--target", "time_kernels", "-j", str(options.jobs)]
        for command in (configure, make):
            run = subprocess.run(command, capture_output=True, text=True, check=False, cwd=harness.ROOT)
            if run.returncode != 0:
                missing[name] = f"{' '.join(command[:2])} failed: {run.stdout[-300:]}{run.stderr[-300:]}"
                break
        else:
            folders[name] = folder
    return folders, missing


def flags_of(build):
    """For which processors a build is made, as an option of the compiler."""
    cache = (build / "CMakeCache.txt").read_text()
    native = re.search(r"^SPURFLEX_NATIVE:\w+=(ON|TRUE|1)$", cache, flags=re.M)
    architecture = re.search(r"^SPURFLEX_ARCH:\w+=(.*)$", cache, flags=re.M)
    return f"-march={'native' if native or not architecture else architecture[1]}"


def rate_of(build, name=JUDGED):
    """Best rate of a loop."""
    return next(k for k in build["kernels"] if k["kernel"] == name)["best_per_second"]


def targets_of(builds):
    """The targets: AVX2 by the first build, AVX-512 by the best of the others."""
    first, *others = builds
    title = f"{JUDGED}, 8 modes, point-steps/s and core"
    best = max((rate_of(builds[name]) for name in others if WIDEST in builds), default=None)
    return {
        f"{title}, AVX2 ({first})": harness.judge(rate_of(builds[first]), AVX2_LIMIT, at_most=False),
        f"{title}, AVX-512": harness.judge(best, AVX512_LIMIT, at_most=False),
    }


def describe(builds, missing):
    """The report as Markdown."""
    lines = [
        "# Innermost loops, one core, eight points in lanes",
        "",
        "Steps per second: the best of the repetitions, in brackets the median. Operations: in floating",
        "point, a step. Share: of the peak that a loop of independent fused multiply-adds reaches there.",
    ]
    for name, build in builds.items():
        lines += [
            "",
            f"## {name}: peak {build['peak_operations_per_second'] / 1e9:.1f}e9 operations/s",
            "",
            "| loop | unit | modes | steps that cross | 10^6/s | operations | share of peak |",
            "|---|---|---|---|---|---|---|",
        ]
        lines += [
            f"| {k['kernel']} | {k['unit']} | {k['modes']} | {100 * k['crossing_steps']:.0f} % "
            f"| {k['best_per_second'] / 1e6:.1f} ({k['median_per_second'] / 1e6:.1f}) "
            f"| {k['operations']} | {100 * k['share_of_peak']:.0f} % |"
            for k in build["kernels"]
        ]
    lines += ["", *(f"Not measured: {name}: {why.strip()}" for name, why in missing.items())]
    first, *others = builds
    for name in others:
        ratios = {n: rate_of(builds[name], n) / rate_of(builds[first], n) for n in COMPARED}
        pays = "would pay" if min(ratios.values()) > PAYS else "does not pay"
        told = ", ".join(f"{n} {ratio:.2f}" for n, ratio in ratios.items())
        lines.append(f"{name} over {first}: {told}. A kernel chosen at run time {pays} on this processor.\n")
    return "\n".join(lines).rstrip() + "\n"


def plot(builds, options):
    """Rates of the loops by build."""
    drawn, axes = harness.figure(height=110.0, width=style.DOUBLE)
    names = [k["kernel"] for k in next(iter(builds.values()))["kernels"]]
    looks = ((style.BLUE, "o"), (style.VERMILION, "s"), (style.GREEN, "^"))
    for (name, build), (colour, marker) in zip(builds.items(), looks, strict=False):
        rates = [k["best_per_second"] / 1e6 for k in build["kernels"]]
        middle = [k["median_per_second"] / 1e6 for k in build["kernels"]]
        axes.plot(rates, range(len(names)), marker, color=colour, label=name)
        axes.plot(middle, range(len(names)), marker, mfc="none", color=colour)
    axes.axvline(AVX2_LIMIT / 1e6, color=style.GREY, ls="--", label="target AVX2")
    axes.axvline(AVX512_LIMIT / 1e6, color=style.GREY, ls=":", label="target AVX-512")
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set_xlim(left=0.0)
    axes.set_xlabel("steps per second and core, best (filled) and median (hollow) [10$^6$/s]")
    drawn.legend(loc="outside upper center", ncols=3)
    harness.save(drawn, options, "kernel")


def main(argv=None):
    """Build, measure, judge, draw."""
    parser = harness.option_parser(__doc__, repeats=200)
    parser.add_argument("--jobs", type=int, default=2, help="processes of a compilation (%(default)s)")
    parser.add_argument("--here", action="store_true", help="only the build of --build")
    options = harness.prepare(parser.parse_args(argv))
    folders, missing = ({}, {}) if options.here or options.quick else other_builds(options)
    folders = {flags_of(options.build): options.build, **folders}
    builds = {name: measure(folder, options) for name, folder in folders.items()}
    for name, build in builds.items():
        print(f"{name}: {JUDGED} {rate_of(build):.3g} point-steps/s", flush=True)
    report = {
        "part": "kernel",
        "quick": options.quick,
        "provenance": harness.provenance(harness.Program(options.build, options.out / "runs")),
        "operations_per_mode_and_rest": OPERATIONS,
        "targets": {} if options.quick else targets_of(builds),
        "not_measured": missing,
        "builds": builds,
    }
    harness.write(options, "kernel", report)
    (options.out / "kernel.md").write_text(describe(builds, missing))
    plot(builds, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
