"""SciPy's solve_ivp: DOP853, LSODA and Radau, as most home-made programs use them."""

from math import cos, sin
from time import perf_counter

import numpy as np
import scipy
from scipy.integrate import solve_ivp

from .model import PERIOD, N, amplitude
from .run import Run

VERSION = scipy.__version__
METHODS = ("DOP853", "LSODA", "Radau")


class SciPy:
    """One method of SciPy."""

    def __init__(self, method):
        """`method` is one of `METHODS`."""
        self.method = method
        self.name = f"SciPy, {method}"

    def run(self, point, tolerance, start, periods, measured):
        """Integrate `periods` mesh periods from a section, then measure `measured` more (0: none).

        `start` is the scaled state, shape (16,).
        """
        options = {"method": self.method, "rtol": max(tolerance, 1e-13), "atol": tolerance}
        slope, jacobian = right_side(point)
        if self.method != "DOP853":
            options["jac"] = jacobian
        began = perf_counter()
        state = start
        if periods:
            end = periods * PERIOD
            answer = solve_ivp(slope, (0.0, end), start, t_eval=[end], **options)
            if not answer.success:
                return Run(perf_counter() - began, np.nan, start)
            state = answer.y[:, -1]
        if not measured:
            return Run(perf_counter() - began, np.nan, state)
        end = measured * PERIOD
        answer = solve_ivp(slope, (0.0, end), state, dense_output=True, **options)
        seconds = perf_counter() - began
        if not answer.success:
            return Run(seconds, np.nan, state)
        y1 = point.observation

        def motion(times):
            states = answer.sol(times)
            return y1 @ states[:N], y1 @ states[N:]

        return Run(seconds, amplitude(motion, 0.0, end) * point.length, state)


def right_side(point):
    """Rate of a state and its derivative."""
    b, k, c = point.half_backlash, point.mesh_stiffness, point.mesh_damping
    matrix = np.zeros((2 * N, 2 * N))
    matrix[:N, N:] = np.eye(N)
    matrix[N:, :N] = -point.position_matrix
    matrix[N:, N:] = -point.velocity_matrix
    drive = np.concatenate([np.zeros(N), point.drive])
    matrix[N:, N:] -= c * np.outer(point.drive, point.direction)
    contact = np.zeros((2 * N, 2 * N))
    contact[N:, :N] = -k * np.outer(point.drive, point.direction)
    direction, static, force = point.direction, point.static_deflection, point.mean_force
    # Sums of sines in plain Python: for a few harmonics it is faster than arrays.
    stiffness = [(n, a.real, a.imag) for n, a in enumerate(map(complex, point.stiffness_harmonics), 1)]
    errors = [(n, a.real, a.imag) for n, a in enumerate(map(complex, point.error_harmonics), 1)]

    def excitation(tau):
        kappa, error, rate = 1.0, 0.0, 0.0
        for n, p, q in stiffness:
            kappa += p * sin(n * tau) + q * cos(n * tau)
        for n, p, q in errors:
            sine, cosine = sin(n * tau), cos(n * tau)
            error += p * sine + q * cosine
            rate += n * (p * cosine - q * sine)
        return kappa, error, rate

    def slope(tau, x):
        kappa, error, rate = excitation(tau)
        deflection = static + float(direction.dot(x[:N])) + error
        elastic = deflection - b if deflection >= b else deflection + b if deflection <= -b else 0.0
        return matrix.dot(x) - drive * (c * rate + k * kappa * elastic - force)

    def jacobian(tau, x):
        kappa, error, _ = excitation(tau)
        touches = abs(static + direction @ x[:N] + error) >= b
        return matrix + kappa * contact if touches else matrix

    return slope, jacobian
