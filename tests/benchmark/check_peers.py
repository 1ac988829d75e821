"""Every peer that is there, and spurflex, against the independent reference at two points.

usage: check_peers.py [--build BUILD]; exit code 1 if one is wrong, 77 if there is no peer at all.
"""

import sys
import tempfile
from pathlib import Path

import harness
import points
from solvers import START, Spurflex, peers_available

SKIPPED = 77

# Tolerance, mesh periods and largest error by the beginning of the name. Multipliers are 0.90 and 0.87: the
# transient has fallen below 1e-13 after 300 periods, below 1e-4 after 100.
CHECKS = (
    ("heyoka", 1e-12, 300, 1e-9),
    ("CVODE", 1e-9, 300, 1e-5),
    ("SciPy, Radau", 1e-5, 100, 1e-3),
    ("SciPy", 1e-6, 100, 1e-3),
)
PROMISED = 1e-6  # tolerance of spurflex
WITHOUT_BORDERS = "heyoka, batch"  # Taylor's method across a border: right only where contact is kept


def check(point, model, peers, build, folder):
    """Names and errors of the solvers that are wrong at a point."""
    equations = model.at(point.speed, point.stiffness)
    found = []
    for peer in peers:
        tolerance, periods, limit = next(c[1:] for c in CHECKS if peer.name.startswith(c[0]))
        if peer.name == WITHOUT_BORDERS and point.contact:
            continue
        run = peer.run(equations, tolerance, START, periods, point.motion)
        found.append((peer.name, run.amplitude, limit))
    timing = Spurflex(build, folder, "collocation").time(point, PROMISED)
    found.append(("spurflex", timing.amplitude, PROMISED))
    wrong = []
    for name, amplitude, limit in found:
        error = abs(amplitude / point.amplitude - 1)
        print(f"{point.stratum}: {name}: {error:.1e} (at most {limit:g})")
        if not error <= limit:
            wrong.append(name)
    return wrong


def main(argv=None):
    """Check; say what is missing."""
    options = harness.option_parser(__doc__).parse_args(argv)
    build = options.build.resolve()
    model, peers, missing = peers_available(harness.DECK, build)
    print(*missing, sep="\n")
    if not peers:
        return SKIPPED
    wrong = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        reference = points.accuracy.Reference(build / "tests" / "reference_motion", folder, 1)
        for stratum, speed, stiffness in points.REGIMES[:2]:
            row = reference.solve([(speed, stiffness)], lambda _: points.accuracy.PERIODS)[0]
            point = points.Point(speed, stiffness, row["motion"], contact_of(row, model), 0.0, 0)
            point.stratum, point.amplitude = stratum, row["y1_amplitude"]
            wrong += check(point, model, peers, build, folder)
    print("wrong: " + "; ".join(wrong) if wrong else "all right")
    return 1 if wrong else 0


def contact_of(row, model):
    """1 where the teeth part."""
    return int(row["smallest_deflection"] < model.deck.mesh.half_backlash)


if __name__ == "__main__":
    sys.exit(main())
