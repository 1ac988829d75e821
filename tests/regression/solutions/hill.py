"""Steady motion while contact is kept, by harmonic balance of the linear Hill equation.

The paper's equations in its own coordinates, but for the gear rotations, of which only
p = r1 th1 - r2 th2 moves: x1, y1, x2, y2 [, xM, yM, thM], p. With contact on the front flank

    M q'' + (C + c_m g g') q' + (K + k_m(t) g g') q = T - g [c_m e_m' + k_m(t) (e_m - b)]

is linear with periodic coefficients; its Fourier coefficients follow from one linear system.
"""

import numpy as np

from .deck import (
    CONTACT_KEPT,
    MOTION_PERIOD_1,
    STATUS_SETTLED,
    harmonics,
    read_deck,
    speeds,
    stiffnesses,
    transmission,
    write_reference,
)

MOST = 24  # harmonics of the motion
SAMPLES = 1 << 14  # of a mesh period, for extremes: a share of (pi MOST/SAMPLES)^2/2 is missed at most


def linear_parts(deck, support):
    """M, C, K, g, T and the rows that give the bearing deformations; the support None is a rigid one."""
    gears, bearings, box = deck.gears, deck.bearings, getattr(deck, "gearbox", None)
    mass, load = transmission(deck)
    flexible = support is not None
    n = 8 if flexible else 5
    x1, y1, x2, y2, p = 0, 1, 2, 3, n - 1
    rows = np.zeros((4, n))  # d_x1, d_y1, d_x2, d_y2, Eqs. (6)-(7)
    rows[range(4), [x1, y1, x2, y2]] = 1
    bodies = np.zeros(n)
    bodies[[x1, y1, x2, y2, p]] = gears.mass_1, gears.mass_1, gears.mass_2, gears.mass_2, mass
    springs = [(bearings.stiffness_1, bearings.damping_1, row) for row in rows[:2]]
    springs += [(bearings.stiffness_2, bearings.damping_2, row) for row in rows[2:]]
    if flexible:
        x_m, y_m, th_m = 4, 5, 6
        rows[[0, 2], x_m] = -1
        rows[[1, 3], y_m] = -1
        rows[1, th_m], rows[3, th_m] = box.gear_offset, -box.gear_offset
        bodies[[x_m, y_m, th_m]] = box.mass, box.mass, box.inertia
        damper = 2 * box.damping_ratio * np.sqrt(box.mass * support)  # Eq. (15)
        for side in (-1, 1):  # half of the support on the left, half on the right, Eqs. (8), (10)
            across, up = np.zeros(n), np.zeros(n)
            across[x_m] = 1
            up[y_m], up[th_m] = 1, side * box.support_offset
            springs += [(support / 2, damper / 2, across), (support / 2, damper / 2, up)]
    k = sum(spring * np.outer(row, row) for spring, _, row in springs)
    c = sum(damper * np.outer(row, row) for _, damper, row in springs)
    angle = np.radians(gears.pressure_angle)
    g = np.zeros(n)
    g[[x1, y1, x2, y2, p]] = np.sin(angle), -np.cos(angle), -np.sin(angle), np.cos(angle), 1
    pull = np.zeros(n)
    pull[p] = load
    return np.diag(bodies), c, k, g, pull, rows


def two_sided(sines):
    """Fourier coefficients -MOST..MOST of a sum of sines given by complex amplitudes."""
    line = np.zeros(2 * MOST + 1, dtype=complex)
    for n, sine in enumerate(sines, start=1):
        line[MOST + n] += sine / 2j
        line[MOST - n] -= np.conj(sine) / 2j
    return line


def steady_motion(deck, speed, support):
    """Samples over a period of y1, d_x1, d_y1, d_x2, d_y2 and of the clearance delta - b."""
    m, c, k, g, pull, rows = linear_parts(deck, support)
    mesh = deck.mesh
    w = 2 * np.pi * deck.gears.teeth_1 * speed / 60
    orders = np.arange(-MOST, MOST + 1)
    stiffness = mesh.mean_stiffness * two_sided(harmonics(mesh, "stiffness_coefficients", "stiffness_phases"))
    stiffness[MOST] += mesh.mean_stiffness
    error = two_sided(harmonics(mesh, "error_amplitudes", "error_phases"))

    def spring(h, order):
        return stiffness[h - order + MOST] if abs(h - order) <= MOST else 0

    n, size = len(g), len(orders)
    system = np.zeros((size, n, size, n), dtype=complex)
    right = np.zeros((size, n), dtype=complex)
    shifted = error.copy()
    shifted[MOST] -= mesh.half_backlash
    for i, h in enumerate(orders):
        system[i, :, i, :] = -((h * w) ** 2) * m + 1j * h * w * (c + mesh.damping * np.outer(g, g)) + k
        for j, order in enumerate(orders):
            system[i, :, j, :] += spring(h, order) * np.outer(g, g)
        drive = 1j * h * w * mesh.damping * error[i]
        drive += sum(spring(h, order) * shifted[j] for j, order in enumerate(orders))
        right[i] = (pull if h == 0 else 0) - g * drive
    lines = np.linalg.solve(system.reshape(size * n, -1), right.ravel()).reshape(size, n)
    observed = np.vstack([np.eye(n)[1], rows, g]) @ lines.T
    observed[-1] += shifted
    spectrum = np.zeros((len(observed), SAMPLES), dtype=complex)
    spectrum[:, orders % SAMPLES] = observed
    return (np.fft.ifft(spectrum, axis=1) * SAMPLES).real


def quantities(deck, speed, support):
    y1, x_1, y_1, x_2, y_2, clearance = steady_motion(deck, speed, support)
    assert clearance.min() > 0, f"contact is lost at {speed} rev/min, support {support}"
    return {
        "y1_amplitude": (y1.max() - y1.min()) / 2,
        "y1_rms": y1.std(),
        "y1_max": y1.max(),
        "y1_min": y1.min(),
        "bearing1_deformation_max": np.hypot(x_1, y_1).max(),
        "bearing2_deformation_max": np.hypot(x_2, y_2).max(),
    }


def reference(folder):
    """Every point of a deck with both supports."""
    deck = read_deck(folder / "deck.nml")
    axis, rows = speeds(deck.sweep), stiffnesses(deck.sweep)
    rigid = [quantities(deck, speed, None) for speed in axis]
    flexible = [[quantities(deck, speed, support) for speed in axis] for support in rows]
    values = {"speed": axis, "support_stiffness": rows}
    for name in rigid[0]:
        values[f"rigid_{name}"] = np.array([point[name] for point in rigid])
        values[name] = np.array([[point[name] for point in row] for row in flexible])
    for gear in (1, 2):  # Eq. (18)
        name = f"bearing{gear}_deformation_max"
        values[f"eta{gear}"] = 100 * (values[name] / values[f"rigid_{name}"] - 1)
    for prefix, shape in (("", values["y1_rms"].shape), ("rigid_", axis.shape)):
        values[f"{prefix}motion"] = np.full(shape, MOTION_PERIOD_1)
        values[f"{prefix}contact"] = np.full(shape, CONTACT_KEPT)
        values[f"{prefix}status"] = np.full(shape, STATUS_SETTLED)
    write_reference(folder, values)
