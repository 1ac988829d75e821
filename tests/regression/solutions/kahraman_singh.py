"""Reference of a deck that is the single-degree-of-freedom gear pair; the deck states the mapping."""

import numpy as np

from .deck import (
    CONTACT_KEPT,
    CONTACT_LOST,
    MOTION_PERIOD_1,
    STATUS_SETTLED,
    harmonics,
    read_deck,
    speeds,
    transmission,
    write_reference,
)
from .piecewise import Oscillator, measure_force


def oscillator(deck, speed):
    """The dimensionless equation of a point of the deck."""
    mass, load = transmission(deck)
    mesh = deck.mesh
    natural = np.sqrt(mesh.mean_stiffness / mass)
    # e'' of an error c sin(w t + phase) is -c w^2 sin(w t + phase), which is c w^2 cos(w t) at -90 degrees.
    error = harmonics(mesh, "error_amplitudes", "error_phases")[0] * 1j
    assert abs(error.imag) < 1e-12 * abs(error), "the phase of the error must be -90 degrees"
    return Oscillator(
        damping=mesh.damping / (2 * np.sqrt(mesh.mean_stiffness * mass)),
        load=load / (mesh.mean_stiffness * mesh.half_backlash),
        excitation=error.real / mesh.half_backlash,
        frequency=2 * np.pi * deck.gears.teeth_1 * speed / 60 / natural,
    )


def reference(folder):
    """Follow the steady motion from speed to speed as the deck says."""
    deck = read_deck(folder / "deck.nml")
    axis = speeds(deck.sweep)
    order = range(len(axis)) if deck.sweep.start == "up" else range(len(axis) - 1, -1, -1)
    unit = deck.mesh.mean_stiffness * deck.mesh.half_backlash / deck.bearings.stiffness_1
    columns = {name: np.zeros(len(axis)) for name in ("amplitude", "rms", "max", "min")}
    contact = np.zeros(len(axis), dtype=int)
    state = None
    for k in order:
        point = oscillator(deck, axis[k])
        if state is None:
            state = np.array([1 + point.load, 0.0])
        state, pieces = point.steady(state)
        largest, smallest, _, rms = measure_force(pieces)
        columns["max"][k], columns["min"][k] = unit * largest, unit * smallest
        columns["amplitude"][k], columns["rms"][k] = unit * (largest - smallest) / 2, unit * rms
        contact[k] = CONTACT_KEPT if all(piece.side == 1 for piece, _ in pieces) else CONTACT_LOST
        assert all(piece.side >= 0 for piece, _ in pieces), "no contact of the back flank in this case"
    whole = np.ones(len(axis), dtype=int)
    write_reference(
        folder,
        {
            "speed": axis,
            **{f"rigid_y1_{name}": column for name, column in columns.items()},
            "rigid_bearing1_deformation_max": np.maximum(columns["max"], -columns["min"]),
            "rigid_motion": MOTION_PERIOD_1 * whole,
            "rigid_contact": contact,
            "rigid_status": STATUS_SETTLED * whole,
        },
    )
