"""Operating points that are compared, with the truth about them.

The truth is the independent reference of tests/accuracy: the paper's own coordinates, Runge-Kutta of order 8
with located crossings. heyoka adds what only the peers need: the section of the steady motion, and how
many mesh periods from the static start it takes until the amplitude is right.
"""

import json
import math
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path

import h5py
import harness
import numpy as np
from solvers import START

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "accuracy"))
import report as accuracy

# Regimes of the work-precision diagrams: name, speed [rev/min], support stiffness [N/m]. Read off the map of
# figure 9: motion and contact there are in the name, the peaks at 1290 and 2.5e8 among the highest.
REGIMES = (
    ("1T, contact kept", 1500.0, 10**7.7),
    ("1T, contact lost", 3500.0, 1e9),
    ("resonance, contact lost", 1290.0, 10**8.4),
    ("2T, both flanks", 5700.0, 1e9),
    ("soft support", 2000.0, 1e4),
    ("stiff support", 3600.0, 1e12),
)

LEVELS = tuple(10.0**-n for n in range(2, 11))
SHARE = 0.5  # of the wanted error that the rest of the transient may have
SETTLED = 1e-12  # rest of the transient of a motion that counts as steady
STRIDE = 1.05  # ratio of the numbers of periods after which the transient is looked at
EXACT = 1e-13  # tolerance of the integration that finds the steady section
AGREED = 1e-8  # relative difference of the steady amplitudes of heyoka and of the reference


@dataclass
class Point:
    """An operating point with a periodic motion."""

    speed: float  # [rev/min]
    stiffness: float  # [N/m]
    motion: int  # mesh periods after which the motion repeats
    contact: int  # as in the result file
    multiplier: float  # largest Floquet multiplier in modulus, over the period of the motion
    searched: int  # mesh periods that the program integrated
    weight: float = 1.0  # points of the map that it stands for
    stratum: str = ""
    amplitude: float = math.nan  # true amplitude of y1 [m]
    section: list = field(default_factory=list)  # scaled state on the steady motion, shape (16,)
    fewest: dict = field(default_factory=dict)  # periods until the rest is below SHARE of a wanted error

    def rule(self, wanted):
        """Mesh periods after which a transient of relative size one is below SHARE of the wanted error."""
        rate = -math.log(max(self.multiplier, 1e-6)) / self.motion
        return math.ceil(math.log(1 / (SHARE * wanted)) / rate)

    def periods(self, wanted):
        """Mesh periods of the transient of a peer: by the multiplier, more where the capture takes longer."""
        return max(self.rule(wanted), self.fewest.get(f"{wanted:g}", 0))


def read_map(path):
    """Points of a result file with periodic motion, by stratum: contact, motion and decade of stiffness."""
    with h5py.File(path, locking=False) as file:
        names = ("motion", "contact", "floquet_magnitude", "periods_integrated", "status")
        motion, contact, multiplier, searched, status = (file[n][:] for n in names)
        speeds, stiffnesses = file["speed"][:], file["support_stiffness"][:]
    strata = {}
    periodic = (motion >= 1) & (motion <= 8) & (status == 1) & np.isfinite(multiplier)
    for i, j in np.argwhere(periodic):
        decade = math.floor(math.log10(stiffnesses[i]) + 1e-9)
        name = f"contact {contact[i, j]}, {motion[i, j]}T, 1e{decade}"
        point = Point(
            speed=float(speeds[j]),
            stiffness=float(stiffnesses[i]),
            motion=int(motion[i, j]),
            contact=int(contact[i, j]),
            multiplier=float(multiplier[i, j]),
            searched=int(searched[i, j]),
            stratum=name,
        )
        strata.setdefault(name, []).append(point)
    return strata


def sample(strata, count, seed=1):
    """About `count` points, as many from each stratum where it has so many; weights make up for that."""
    random = np.random.default_rng(seed)
    share = 1
    while sum(min(len(s), share) for s in strata.values()) < count and share < max(map(len, strata.values())):
        share += 1
    chosen = []
    for name in sorted(strata):
        stratum = strata[name]
        taken = min(share, len(stratum))
        for k in sorted(random.choice(len(stratum), taken, replace=False)):
            stratum[k].weight = len(stratum) / taken
            chosen.append(stratum[k])
    return chosen


def regimes(strata):
    """The points of the table of regimes; ValueError where the map has no periodic point there."""
    every = [p for stratum in strata.values() for p in stratum]
    chosen = []
    for name, speed, stiffness in REGIMES:
        near = [p for p in every if p.speed == speed and abs(p.stiffness / stiffness - 1) < 1e-6]
        if not near:
            raise ValueError(f"{name}: no periodic point of the map at {speed:g} rev/min, {stiffness:g} N/m")
        near[0].stratum = name
        chosen.append(near[0])
    return chosen


class Truths:
    """The truth about points: computed once, kept in files beside the results."""

    def __init__(self, build, folder, model, exact):
        """`exact` is the peer that finds steady sections."""
        folder = folder / "truth"
        folder.mkdir(parents=True, exist_ok=True)
        # One after the other: several processes would share the core that is timed on.
        self.reference = accuracy.Reference(build / "tests" / "reference_motion", folder, 1)
        self.file = folder / "sections.json"
        self.model, self.exact = model, exact
        self.kept = {}
        if self.file.is_file():
            kept = json.loads(self.file.read_text())
            self.kept = kept["points"] if kept["stamp"] == self.reference.stamp else {}

    def complete(self, points):
        """Fill in the truth; points whose motion the reference and heyoka find too, and the others."""
        rows = self.reference.solve([(p.speed, p.stiffness) for p in points], accuracy.periods_of)
        good, bad = [], []
        for number, (point, row) in enumerate(zip(points, rows, strict=True)):
            point.amplitude = row["y1_amplitude"]
            key = " ".join(accuracy.key_of(point.speed, point.stiffness))
            if key not in self.kept:
                self.kept[key] = self.settle(point)
                self.file.write_text(json.dumps({"stamp": self.reference.stamp, "points": self.kept}))
            point.section, point.fewest = self.kept[key]["section"], self.kept[key]["fewest"]
            same = (
                row["motion"] == point.motion
                and abs(self.kept[key]["amplitude"] / point.amplitude - 1) < AGREED
            )
            (good if same else bad).append(point)
            if number % 20 == 19:
                print(f"truth: {number + 1} of {len(points)} points", flush=True)
        return good, bad

    def settle(self, point):
        """Steady section, its amplitude, and the periods until the transient is below SHARE of each level."""
        equations = self.model.at(point.speed, point.stiffness)
        end = point.rule(SETTLED / SHARE) + 2 * point.searched
        state, done, looks = START, 0, []
        while done < end:
            stride = max(point.motion, round(done * (STRIDE - 1)))
            stride += -stride % point.motion
            run = self.exact.run(equations, EXACT, state, stride, point.motion)
            state, done = run.state, done + stride
            looks.append((done, run.amplitude))
        steady = looks[-1][1]
        fewest = {}
        for level in LEVELS:
            wrong = [n for n, a in looks if not abs(a / steady - 1) <= SHARE * level]
            fewest[f"{level:g}"] = next((n for n, _ in looks if n > max(wrong, default=0)), looks[-1][0])
        return {"section": state.tolist(), "amplitude": steady, "fewest": fewest}


def describe(points):
    """Points as they go into reports."""
    left_out = ("section",)
    return [{k: v for k, v in asdict(p).items() if k not in left_out} for p in points]


def map_file(options):
    """The finished map of figure 9, or a stop that says how to make it."""
    path = harness.ROOT / "results" / "figure9.h5"
    if not path.is_file():
        raise SystemExit(f"{path} is missing; scripts/reproduce makes it")
    return path
