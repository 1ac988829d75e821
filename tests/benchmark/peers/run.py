"""What a run of a solver gives."""

from dataclasses import dataclass

import numpy as np


@dataclass
class Run:
    """One integration of one point."""

    seconds: float  # for one point: a batch counts by lane
    amplitude: float  # of y1 [m]; NaN where the solver gave up or nothing was measured
    state: np.ndarray  # scaled state at the section where the measured periods begin, shape (16,)
