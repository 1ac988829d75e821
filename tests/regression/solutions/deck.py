"""The numbers of a deck, and the reference file of its case."""

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np

MOTION_PERIOD_1, STATUS_SETTLED = 1, 1
CONTACT_KEPT, CONTACT_LOST, CONTACT_BOTH = 0, 1, 2


def read_deck(path):
    """Groups of a plain deck, their keys as attributes: numbers, lists of numbers, texts."""
    groups = SimpleNamespace()
    for line in Path(path).read_text(encoding="utf-8").splitlines():
        if match := re.match(r"\s*&(\w+)", line):
            group = SimpleNamespace()
            setattr(groups, match[1], group)
        elif match := re.match(r"\s*(\w+)\s*=\s*([^!]*)", line):
            setattr(group, match[1], value_of(match[2].strip()))
    return groups


def value_of(text):
    if text.startswith("'"):
        return text.strip("'")
    numbers = [float(part) for part in text.split(",")]
    return numbers if len(numbers) > 1 else numbers[0]


def harmonics(mesh, amplitudes, phases):
    """Complex amplitudes c_n of a sum of sines: the imaginary part of the sum of c_n exp(i n w t)."""
    sizes = np.atleast_1d(getattr(mesh, amplitudes))
    angles = np.radians(np.atleast_1d(getattr(mesh, phases, np.zeros(len(sizes)))))
    return sizes * np.exp(1j * angles)


def speeds(sweep):
    return np.linspace(sweep.speed_first, sweep.speed_last, int(sweep.speed_count))


def stiffnesses(sweep):
    return np.geomspace(sweep.stiffness_first, sweep.stiffness_last, int(sweep.stiffness_count))


def transmission(deck):
    """Mass m_t of the gear rotations on the line of action, and the mean mesh force F."""
    radius = np.array([deck.gears.base_radius_1, deck.gears.base_radius_2])
    inertia = np.array([deck.gears.inertia_1, deck.gears.inertia_2])
    mass = 1 / np.sum(radius**2 / inertia)
    return mass, mass * np.sum(radius * [deck.load.driving_torque, deck.load.load_torque] / inertia)


def write_reference(folder, values):
    """The reference of a case, in the form that run.py reads."""
    lines = [f'    "{name}": {json.dumps(np.asarray(value).tolist())}' for name, value in values.items()]
    text = '{\n  "exit_code": 0,\n  "values": {\n' + ",\n".join(lines) + "\n  }\n}\n"
    (Path(folder) / "reference.json").write_text(text, encoding="utf-8")
