"""Write the reference of this case by the brute force of tests/accuracy, in some ten seconds."""

import csv
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from solutions.deck import CONTACT_BOTH, CONTACT_LOST, STATUS_SETTLED, read_deck, speeds, write_reference

CASE = Path(__file__).resolve().parent
SOLVER = CASE.parents[2] / "build" / "tests" / "reference_motion"
PERIODS = 20000  # mesh periods at most; the motions repeat to round-off much earlier
COMPARED = ("y1_amplitude", "bearing1_deformation_max", "bearing2_deformation_max")

deck = read_deck(CASE / "deck.nml")
stiffness = deck.sweep.stiffness_first
with tempfile.TemporaryDirectory() as folder:
    points, output = Path(folder, "points.csv"), Path(folder, "reference.csv")
    lines = [
        f"{speed!r},{stiffness!r},{deck.sweep.start},{PERIODS}\n" for speed in map(float, speeds(deck.sweep))
    ]
    points.write_text("speed,support_stiffness,start,periods\n" + "".join(lines))
    subprocess.run([SOLVER, CASE / "deck.nml", points, output], check=True)
    found = list(csv.DictReader(output.read_text().splitlines()))
assert all(float(row["floquet_magnitude"]) < 1 for row in found), "stable motions"
backlash = deck.mesh.half_backlash
assert all(float(row["smallest_deflection"]) < backlash for row in found), "contact is lost"
contact = [CONTACT_BOTH if float(row["smallest_deflection"]) <= -backlash else CONTACT_LOST for row in found]
write_reference(
    CASE,
    {
        "motion": np.array([[int(row["motion"]) for row in found]]),
        "status": np.full((1, len(found)), STATUS_SETTLED),
        "contact": np.array([contact]),
        **{name: np.array([[float(row[name]) for row in found]]) for name in COMPARED},
    },
)
