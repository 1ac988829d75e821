"""heyoka: Taylor's method, compiled just in time. Compilation is not part of the times.

Modes: "batch", eight lanes of one SIMD vector with the backlash as a `select`; "events", one point at a time
with the borders of the backlash as located terminal events; "batch events", both together.
"""

from time import perf_counter

import heyoka as hy
import numpy as np

from .model import PERIOD, N, amplitude
from .run import Run

VERSION = hy.__version__
LANES = 8
MODES = ("batch", "events", "batch events")

# What changes from point to point is a parameter, the rest is compiled in.
SQUARE, RATE, SUPPORT, SUPPORT_DAMPING, CONTACT, OFFSET = range(6)


def right_side(model, located):
    """Variables with their rates, and the mesh deflection."""
    z = hy.make_vars(*[f"z{i}" for i in range(N)])
    v = hy.make_vars(*[f"v{i}" for i in range(N)])
    deck = model.deck
    k = [deck.bearings.stiffness_1] * 2 + [deck.bearings.stiffness_2] * 2
    c = [deck.bearings.damping_1] * 2 + [deck.bearings.damping_2] * 2
    # Without unit, but for the mass: time is the phase of the mesh.
    forces = [k[i] * hy.par[SQUARE] * z[i] + c[i] * hy.par[RATE] * v[i] for i in range(4)]
    for i, share in zip((4, 5, 6), (1.0, 1.0, deck.gearbox.support_offset**2), strict=True):
        forces.append(share * (hy.par[SUPPORT] * z[i] + hy.par[SUPPORT_DAMPING] * v[i]))

    def wave(harmonics, derivative=False):
        terms = []
        for n, a in enumerate(harmonics, 1):
            sine, cosine = hy.sin(n * hy.time), hy.cos(n * hy.time)
            if derivative:
                sine, cosine = n * cosine, -n * sine
            terms += [part * f for part, f in ((a.real, sine), (a.imag, cosine)) if part]
        return hy.sum(terms) if terms else hy.expression(0.0)

    point = model.at(60.0, 1.0)
    g = point.direction
    deflection = hy.sum(
        [g[i] * z[i] for i in range(N) if g[i]]
        + [wave(model.error_harmonics), hy.expression(point.static_deflection)]
    )
    rate = hy.sum([g[i] * v[i] for i in range(N) if g[i]] + [wave(model.error_harmonics, True)])
    b = point.half_backlash
    if located:
        elastic = hy.par[CONTACT] * deflection - hy.par[OFFSET]
    else:
        gap = hy.select(hy.lte(deflection, -b), deflection + b, hy.expression(0.0))
        elastic = hy.select(hy.gte(deflection, b), deflection - b, gap)
    kappa = 1.0 + wave(model.stiffness_harmonics)
    mesh = deck.mesh.damping * hy.par[RATE] * rate + hy.par[SQUARE] * (
        deck.mesh.mean_stiffness * kappa * elastic - model.force / model.length
    )
    w, h = model.inverse_mass, model.drive
    system = [(z[i], v[i]) for i in range(N)]
    for i in range(N):
        terms = [-w[i, j] * forces[j] for j in range(N - 1) if w[i, j]]
        if h[i]:
            terms.append(-h[i] * mesh)
        system.append((v[i], hy.sum(terms)))
    return system, deflection, b


def parameters(point, deflection, slope):
    """Parameters of a point, with the branch of the backlash where it starts, shape (6,)."""
    w = PERIOD / point.period
    b = point.half_backlash
    inside = abs(deflection) < b or (abs(deflection) == b and deflection * slope < 0)
    side = 0.0 if inside else float(np.sign(deflection))
    return np.array([1 / w**2, 1 / w, point.stiffness[4], point.damping[4], abs(side), side * b])


class Heyoka:
    """One mode of heyoka; integrators are compiled once a tolerance."""

    def __init__(self, model, mode):
        """Build the expressions. `mode` is one of `MODES`."""
        self.model, self.mode = model, mode
        self.name = f"heyoka, {mode}"
        self.is_batch, self.located = "batch" in mode, "events" in mode
        self.lanes = LANES if self.is_batch else 1
        self.system, self.deflection, self.half_backlash = right_side(model, self.located)
        self.compiled = {}

    def integrator(self, tolerance):
        """The integrator of a tolerance."""
        if tolerance not in self.compiled:
            count = 6 if self.located else 4
            options = {"tol": tolerance, "pars": [0.0] * count}
            state = [0.0] * (2 * N)
            if self.located:
                options["t_events"] = self.events()
            if self.is_batch:
                options["pars"] = np.zeros((count, LANES))
                state = np.zeros((2 * N, LANES))
                made = hy.taylor_adaptive_batch(self.system, state, force_avx512=True, **options)
            else:
                made = hy.taylor_adaptive(self.system, state, **options)
            self.compiled[tolerance] = made
        return self.compiled[tolerance]

    def events(self):
        """Terminal events at both borders that change the branch and go on."""
        b = self.half_backlash
        kind = hy.t_event_batch if self.is_batch else hy.t_event

        def change(border):
            def scalar(integrator, sign):
                inside = sign * border < 0
                integrator.pars[CONTACT] = 0.0 if inside else 1.0
                integrator.pars[OFFSET] = 0.0 if inside else border
                return True

            def batch(integrator, sign, lane):
                inside = sign * border < 0
                integrator.pars[CONTACT, lane] = 0.0 if inside else 1.0
                integrator.pars[OFFSET, lane] = 0.0 if inside else border
                return True

            return batch if self.is_batch else scalar

        return [kind(self.deflection - border, callback=change(border)) for border in (b, -b)]

    def run(self, point, tolerance, start, periods, measured):
        """Integrate `periods` mesh periods from a section, then measure `measured` more (0: none).

        `start` is the scaled state, shape (16,); in batch mode every lane gets it.
        """
        made = self.integrator(tolerance)
        g = point.direction
        _, error, error_rate = point.excitation(0.0)
        deflection = point.static_deflection + g @ start[:N] + error
        values = parameters(point, deflection, g @ start[N:] + error_rate)[: len(made.pars)]
        made.state[:] = start[:, None] if self.is_batch else start
        made.pars[:] = values[:, None] if self.is_batch else values
        if self.is_batch:
            made.set_time([0.0] * LANES)
        else:
            made.time = 0.0
        if self.located:
            made.reset_cooldowns()
        began = perf_counter()
        made.propagate_until(periods * PERIOD)
        seconds = perf_counter() - began
        state = np.array(made.state[:, 0] if self.is_batch else made.state)
        if not measured:
            return Run(seconds / self.lanes, np.nan, state)
        # The phase anew, so that late times cost no digits.
        if self.is_batch:
            made.set_time([0.0] * LANES)
        else:
            made.time = 0.0
        began = perf_counter()
        output = made.propagate_until(measured * PERIOD, c_output=True)[0 if self.is_batch else 4]
        seconds += perf_counter() - began
        found = np.nan
        if output is not None and np.all(np.isfinite(made.state)):
            y1 = point.observation

            def motion(times):
                if self.is_batch:
                    states = output(np.repeat(times[:, None], LANES, 1))[:, :, 0]
                else:
                    states = output(times)
                return states[:, :N] @ y1, states[:, N:] @ y1

            found = amplitude(motion, 0.0, measured * PERIOD) * point.length
        return Run(seconds / self.lanes, found, state)
