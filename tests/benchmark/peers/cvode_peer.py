"""CVODE of SUNDIALS in C (cvode_points.c): BDF and Adams, plain and with located borders of the backlash."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np

from .run import Run

SOURCE = Path(__file__).with_name("cvode_points.c")
FLAGS = ("-O3", "-march=native", "-std=c11", "-D_POSIX_C_SOURCE=199309L", "-Wall", "-Wextra")
LIBRARIES = ("cvode", "nvecserial", "sunmatrixdense", "sunlinsoldense", "sunnonlinsolfixedpoint", "m")
METHODS = ("bdf", "adams", "adams-fixed")
BORDERS = ("plain", "located")


def compile_program(folder):
    """Compile cvode_points into a folder unless it is newer than its source.

    Returns its path. RuntimeError: no C compiler, no SUNDIALS, or the compiler complains.
    """
    program = Path(folder).resolve() / "cvode_points"
    if program.is_file() and program.stat().st_mtime > SOURCE.stat().st_mtime:
        return program
    # SUNDIALS built with MPI includes mpi.h.
    compiler = next((c for c in ("mpicc", "cc") if shutil.which(c)), None)
    if not compiler:
        raise RuntimeError("no C compiler")
    program.parent.mkdir(parents=True, exist_ok=True)
    libraries = [f"-lsundials_{name}" if name != "m" else "-lm" for name in LIBRARIES]
    command = [compiler, *FLAGS, str(SOURCE), "-o", str(program), *libraries]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode:
        raise RuntimeError(f"cannot compile {SOURCE.name}: {run.stderr.strip()}")
    return program


def version():
    """Version of SUNDIALS from its header, or "unknown"."""
    for folder in ("/usr/include", "/usr/local/include"):
        header = Path(folder) / "sundials" / "sundials_config.h"
        if header.is_file():
            return re.search(r'SUNDIALS_VERSION "([^"]+)"', header.read_text()).group(1)
    return "unknown"


class Cvode:
    """One method of CVODE."""

    def __init__(self, program, method, borders):
        """`method` is one of `METHODS`, `borders` one of `BORDERS`."""
        self.program, self.method, self.borders = program, method, borders
        self.name = f"CVODE, {method}, {borders}"

    def run(self, point, tolerance, start, periods, measured):
        """Integrate `periods` mesh periods from a section, then measure `measured` more (0: none).

        `start` is the scaled state, shape (16,). RuntimeError where the program fails.
        """
        words = [self.program, self.method, self.borders, repr(tolerance), periods, measured, 1]
        run = subprocess.run(
            [str(w) for w in words], input=text_of(point, start), capture_output=True, text=True, check=False
        )
        if run.returncode:
            raise RuntimeError(run.stderr.strip())
        answer = json.loads(run.stdout)
        found = answer["amplitude"]
        found = np.nan if found is None else found * point.length
        return Run(answer["seconds"][-1], found, np.array(answer["state"]))


def text_of(point, start):
    """The numbers of a point in the order in which cvode_points reads them."""

    def pairs(harmonics):
        # The imaginary part of c exp(i tau) is Re c sin tau + Im c cos tau.
        return np.column_stack([harmonics.real, harmonics.imag])

    scalars = [
        point.mesh_stiffness,
        point.mesh_damping,
        point.mean_force,
        point.static_deflection,
        point.half_backlash,
    ]
    parts = [
        point.position_matrix,
        point.velocity_matrix,
        point.drive,
        point.direction,
        point.observation,
        scalars,
        [len(point.stiffness_harmonics), len(point.error_harmonics)],
        pairs(point.stiffness_harmonics),
        pairs(point.error_harmonics),
        start,
    ]
    return " ".join(repr(float(x)) for part in parts for x in np.ravel(part))
