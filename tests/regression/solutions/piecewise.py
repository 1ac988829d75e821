"""Gear pair with backlash as a single degree of freedom, piece by piece in closed form.

    x'' + 2 z x' + f(x) = Fm + Fa W^2 cos(W t),   f(x) = x - 1 above 1, x + 1 below -1, else 0

A. Kahraman, R. Singh, J. Sound Vib. 142 (1990) 49. Between two crossings of x = 1 and x = -1 the
equation is linear; a crossing is a zero of its solution. There is no time step.
"""

from dataclasses import dataclass

import numpy as np

LOOKS = 400  # places in a mesh period at which crossings are looked for
BISECTIONS = 60
SETTLING = 40  # mesh periods of the transient between two attempts of Newton's method
MOST_ATTEMPTS = 200
NEAR = 1e-3  # how far Newton's method may move a state that has settled


@dataclass
class Piece:
    """Solution of one linear piece from a state at a time."""

    oscillator: "Oscillator"
    side: int
    start: float
    state: np.ndarray

    def __post_init__(self):
        o = self.oscillator
        w, z = o.frequency, o.damping
        spring = abs(self.side)
        self.forced = o.excitation * w**2 / (spring - w**2 + 2j * z * w)
        self.free_rate = np.sqrt(1 - z**2)
        here = self.forced * np.exp(1j * w * self.start)
        self.offset = self.side + o.load if spring else 0.0
        self.drift = 0.0 if spring else o.load / (2 * z)
        self.free = self.state - np.array([here.real + self.offset, (1j * w * here).real + self.drift])

    def matrix(self, t):
        """What a difference of states at the start becomes."""
        z, r, s = self.oscillator.damping, self.free_rate, t - self.start
        if not self.side:
            decay = np.exp(-2 * z * s)
            return np.array([[np.ones_like(s), (1 - decay) / (2 * z)], [np.zeros_like(s), decay]])
        decay, c, si = np.exp(-z * s), np.cos(r * s), np.sin(r * s)
        return decay * np.array([[c + z / r * si, si / r], [-si / r, c - z / r * si]])

    def at(self, t):
        """Displacement and velocity, shape (2, ...)."""
        t = np.asarray(t, dtype=float)
        forced = self.forced * np.exp(1j * self.oscillator.frequency * t)
        free = np.einsum("ij...,j->i...", self.matrix(t), self.free)
        x = forced.real + self.offset + self.drift * (t - self.start) + free[0]
        v = (1j * self.oscillator.frequency * forced).real + self.drift + free[1]
        return np.array([x, v])

    def force(self, t):
        """Mesh force in units of the stiffness times half of the backlash."""
        x, v = self.at(t)
        return 2 * self.oscillator.damping * v + abs(self.side) * (x - self.side)

    def leaves(self, x):
        """Positive where x has left the piece."""
        return 1 - self.side * x if self.side else np.abs(x) - 1

    def end(self, limit, step):
        """Where the piece is left, at most the limit."""
        looks = self.start + step * np.arange(1, np.ceil((limit - self.start) / step - 1e-9) + 1)
        looks[-1] = limit
        left = np.flatnonzero(self.leaves(self.at(looks)[0]) > 0)
        if not len(left):
            return limit
        low, high = (looks[left[0] - 1] if left[0] else self.start), looks[left[0]]
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            if self.leaves(self.at(middle)[0]) > 0:
                high = middle
            else:
                low = middle
        return high


@dataclass
class Oscillator:
    """One operating point."""

    damping: float
    load: float
    excitation: float
    frequency: float

    @property
    def period(self):
        return 2 * np.pi / self.frequency

    def advance(self, state):
        """State after a period, its derivative by the state, and the pieces."""
        t, pieces, derivative = 0.0, [], np.eye(2)
        state = np.array(state, dtype=float)
        side = int(np.sign(state[0])) if abs(state[0]) >= 1 else 0
        while t < self.period * (1 - 1e-14):
            piece = Piece(self, side, t, state)
            t = piece.end(self.period, self.period / LOOKS)
            pieces.append((piece, t))
            derivative = piece.matrix(np.float64(t)) @ derivative
            state = piece.at(t)
            if side:
                side = 0 if piece.leaves(state[0]) > -1e-9 else side
            else:
                side = int(np.sign(state[0])) if piece.leaves(state[0]) > -1e-9 else 0
        return state, derivative, pieces

    def steady(self, state):
        """The stable motion of one period that a state settles to, and its pieces."""
        for _ in range(MOST_ATTEMPTS):
            for _ in range(SETTLING):
                state = self.advance(state)[0]
            better = state
            for _ in range(20):
                after, derivative, pieces = self.advance(better)
                step = np.linalg.solve(np.eye(2) - derivative, after - better)
                better = better + step
                if np.abs(step).max() < 1e-13:
                    break
            after, derivative, pieces = self.advance(better)
            stable = np.abs(np.linalg.eigvals(derivative)).max() < 1
            if stable and np.abs(after - better).max() < 1e-10 and np.abs(better - state).max() < NEAR:
                return better, pieces
        raise RuntimeError(f"no steady motion at {self.frequency}")


def refined_maximum(function, t):
    """Largest value of a smooth function, looked for at some times and once more around the best of them."""
    best = np.argmax(function(t))
    low, high = t[max(best - 1, 0)], t[min(best + 1, len(t) - 1)]
    return function(np.linspace(low, high, len(t))).max()


def measure_force(pieces):
    """Largest, smallest and mean force over a period, and its root mean square about the mean."""
    largest, smallest, total, square, period = -np.inf, np.inf, 0.0, 0.0, pieces[-1][1]
    nodes, weights = np.polynomial.legendre.leggauss(24)
    for piece, end in pieces:
        t = np.linspace(piece.start, end, 4001)
        largest = max(largest, refined_maximum(piece.force, t))
        smallest = min(smallest, -refined_maximum(lambda times, force=piece.force: -force(times), t))
        length = end - piece.start
        values = piece.force(piece.start + length * (nodes + 1) / 2)
        total += length / 2 * weights @ values
        square += length / 2 * weights @ values**2
    mean = total / period
    return largest, smallest, mean, np.sqrt(square / period - mean**2)
