"""Compare the motions of `report.py` with whole transients: 20,000 mesh periods, 100,000 on soft supports.

Needs reference.csv, which scripts/accuracy writes; adds brute_force.md beside it. Exits with 1 if a
class or an amplitude differs.
"""

import argparse
import csv
import subprocess
import sys
from pathlib import Path

SOFT = 1.001e5
"""Support stiffness up to which the transient is slow [N/m]."""

TOLERANCE = 1e-6
"""Relative difference of the amplitudes of a periodic motion: two integrators at their usual steps."""


def read(lines, title=True):
    """Yield (speed, stiffness) and the rest of each line."""
    rows = csv.DictReader(lines) if title else csv.reader(lines)
    for row in rows:
        values = list(row.values()) if title else row
        yield (float(values[0]), float(values[1])), row


def main():
    """Run and compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", required=True, type=Path)
    parser.add_argument("--deck", required=True, type=Path)
    parser.add_argument("--output", required=True, type=Path)
    parser.add_argument("--periods", type=int, default=20_000)
    parser.add_argument("--soft-periods", type=int, default=100_000)
    parser.add_argument("--processes", type=int, default=2)
    wanted = parser.parse_args()

    points = wanted.output / "reference.csv"
    with points.open() as file:
        expected = dict(read(file))
    command = [wanted.program, wanted.deck, points, wanted.periods, wanted.soft_periods]
    jobs = [
        subprocess.Popen(
            [*map(str, command), str(part), str(wanted.processes)], stdout=subprocess.PIPE, text=True
        )
        for part in range(wanted.processes)
    ]
    found = {}
    for job in jobs:
        text, _ = job.communicate()
        if job.returncode:
            sys.exit(f"{wanted.program} failed")
        found.update(read(text.splitlines(), title=False))

    faults, largest, soft, soft_largest = [], 0.0, 0, 0.0
    for point, row in expected.items():
        motion, reference = int(found[point][3]), int(row["motion"])
        # The reference has negative flags for what is not periodic, brute force has 0.
        if motion != max(reference, 0):
            faults.append(f"{point}: class {reference}, brute force {motion}")
        elif motion > 0:
            difference = abs(float(found[point][4]) / float(row["y1_amplitude"]) - 1)
            largest = max(largest, difference)
            if 0 < point[1] < SOFT:
                soft, soft_largest = soft + 1, max(soft_largest, difference)
            if difference > TOLERANCE:
                faults.append(f"{point}: amplitude differs by {difference:.1e}")
    lines = [
        "# Whole transients",
        "",
        f"{len(expected)} points over {wanted.periods} mesh periods, {wanted.soft_periods} up to 1e5 N/m:"
        f" {len(faults)} differ.",
        f"Largest relative difference of a periodic amplitude: {largest:.1e};"
        f" at the {soft} points up to 1e5 N/m: {soft_largest:.1e}.",
        *[f"- {fault}" for fault in faults],
    ]
    (wanted.output / "brute_force.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
