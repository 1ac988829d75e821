"""The solvers that are compared: spurflex through its driver, and the peers, all timed alike."""

import json
import re
import subprocess
from dataclasses import dataclass

import harness
import numpy as np
from peers import cvode_peer
from peers.model import Model, N

FEW = 8  # mesh periods from which the time of a mesh period is estimated
START = np.zeros(2 * N)  # static equilibrium
WARM = 9  # solutions of which the median counts

try:
    from peers import heyoka_peer
except ImportError:
    heyoka_peer = None
try:
    from peers import scipy_peer
except ImportError:
    scipy_peer = None


@dataclass
class Timing:
    """What a solver did at a point with one setting."""

    seconds: float  # of the whole answer; extrapolated if `extrapolated`
    amplitude: float  # [m]; NaN where it gave up
    periods: int  # mesh periods of the transient that the answer takes
    extrapolated: bool  # fewer periods were run, from the steady motion, and their time was scaled up

    def error(self, truth):
        """True relative error of the amplitude; 1 where there is none."""
        error = abs(self.amplitude / truth - 1)
        return float(error) if np.isfinite(error) else 1.0


def peers_available(deck, build):
    """Every mode of every peer that this machine has, and why others are missing."""
    found, missing = [], []
    model = Model(deck)
    if heyoka_peer:
        found += [heyoka_peer.Heyoka(model, mode) for mode in heyoka_peer.MODES]
    else:
        missing.append("heyoka is not installed")
    try:
        program = cvode_peer.compile_program(build / "benchmark")
        found += [
            cvode_peer.Cvode(program, method, borders)
            for method in cvode_peer.METHODS
            for borders in cvode_peer.BORDERS
        ]
    except RuntimeError as error:
        missing.append(f"CVODE: {error}")
    if scipy_peer:
        found += [scipy_peer.SciPy(method) for method in scipy_peer.METHODS]
    else:
        missing.append("SciPy is not installed")
    return model, found, missing


def versions(build):
    """Versions of the peers, and the options that the build folder was configured with."""
    cache = build / "CMakeCache.txt"
    text = cache.read_text() if cache.is_file() else ""
    keys = (
        r"(CMAKE_BUILD_TYPE|CMAKE_Fortran_COMPILER|CMAKE_Fortran_FLAGS_RELEASE|SPURFLEX_ARCH|SPURFLEX_NATIVE)"
    )
    configured = dict(re.findall(rf"^{keys}:\w+=(.*)$", text, flags=re.M))
    return {
        "build": configured,
        "fortran_compiler": harness.command_line_of(
            [configured.get("CMAKE_Fortran_COMPILER", "gfortran"), "--version"]
        ),
        "heyoka": heyoka_peer.VERSION if heyoka_peer else None,
        "sundials": cvode_peer.version(),
        "scipy": scipy_peer.VERSION if scipy_peer else None,
        "numpy": np.__version__,
        "c_compiler": harness.command_line_of(["cc", "--version"]),
        "c_flags": " ".join(cvode_peer.FLAGS),
    }


def time_peer(peer, equations, tolerance, point, periods, cap):
    """Time a peer at a point.

    It integrates `periods` mesh periods from the static start and measures the amplitude over one period of
    the motion. Where that would take longer than `cap` seconds, it runs fewer periods from the steady
    motion, and the time is scaled up to all of them; the time of a mesh period is as good as constant.
    """
    steady = np.array(point.section)
    few = min(FEW, periods)
    whole = periods + point.motion
    lanes = getattr(peer, "lanes", 1)
    for _ in range(2):  # the first call after compilation can be slow
        first = peer.run(equations, tolerance, steady, few, point.motion)
        wall = lanes * first.seconds / (few + point.motion)
        if wall * whole <= cap:
            break
    if wall * whole <= cap or few == periods:
        run = peer.run(equations, tolerance, START, periods, point.motion)
        return Timing(run.seconds, run.amplitude, periods, False)
    part = max(few, int(cap / wall) - point.motion)
    run = peer.run(equations, tolerance, steady, part, point.motion) if part > few else first
    return Timing(run.seconds * whole / (part + point.motion), run.amplitude, periods, True)


class Spurflex:
    """The solver modules of the program, through time_points."""

    def __init__(self, build, folder, integrator):
        """`integrator` is a word of the deck; decks are written to `folder`."""
        self.program = build / "tests" / "time_points"
        self.integrator = integrator
        self.name = f"spurflex, {integrator}"
        self.folder = folder

    def solve(self, points, tolerance, repeats=1):
        """Lines of time_points, one a point. RuntimeError where it fails."""
        deck = self.folder / f"{self.integrator}-{tolerance:g}.nml"
        values = {"integrator": self.integrator, "tolerance": tolerance, "max_periods": 20000}
        deck.write_text(harness.patched_deck(**values))
        given = "".join(f"{p.speed!r} {p.stiffness!r}\n" for p in points)
        command = [str(self.program), str(deck), str(repeats)]
        run = subprocess.run(command, input=given, capture_output=True, text=True, check=False)
        if run.returncode:
            raise RuntimeError(f"{self.program.name}: {run.stderr.strip()}")
        answers = [json.loads(line) for line in run.stdout.splitlines()]
        if len(answers) != len(points):
            raise RuntimeError(f"{self.program.name}: {len(answers)} answers for {len(points)} points")
        return answers

    def time(self, point, tolerance, repeats=WARM):
        """Time one point among copies of itself; the median, as the first solution finds cold caches."""
        answer = self.solve([point], tolerance, repeats)[0]
        amplitude = np.nan if answer["amplitude"] is None else answer["amplitude"]
        return Timing(answer["seconds"], amplitude, answer["periods_integrated"], False)
