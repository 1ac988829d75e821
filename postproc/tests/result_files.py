"""Writes result files as the solver does, with data made up for the tests."""

from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

UNITS = {"speed": "rpm", "support_stiffness": "N/m", "eta1": "percent", "error_estimate": "1"}
DECK = "&gears\n  teeth_1 = 55\n/\n"


def crest(speed: Reals, centre: float | Reals, width: float, height: float | Reals) -> Reals:
    """A smooth resonance: half the height at `width` from the centre."""
    return np.asarray(height / (1 + ((speed - centre) / width) ** 2))


def rigid_amplitude(speed: Reals) -> Reals:
    """Two crests at 1180 and 1730 and a jump at 3140 rev/min [m]."""
    smooth = 1.2 + crest(speed, 1180, 55, 6) + crest(speed, 1730, 80, 9)
    upper = np.where(speed > 3140, 14 - (speed - 3140) / 400, crest(speed, 3600, 500, 5))
    return 1e-6 * (smooth + upper)


def flexible_amplitude(speed: Reals, stiffness: Reals) -> Reals:
    """The same with a crest that passes 480 rev/min at 2.5e8 N/m; shape (m, n) [m]."""
    n, k = np.meshgrid(speed, stiffness)
    centre = 480 * np.sqrt(k / 2.5e8)
    soft = 1 / (1 + (k / 2e9) ** 1.5)
    first, second = 1180 + 110 * soft, 1730 + 170 * soft
    smooth = 1.2 + crest(n, first, 55, 6) + crest(n, second, 80, 9)
    smooth += crest(n, centre, 30, 5 * (480 / centre) ** 0.7) * (centre > 150)
    upper = np.where(n > 3140, 14 - (n - 3140) / 400, crest(n, 3600, 500, 5))
    return np.asarray(1e-6 * (smooth + upper))


def veering_crests(stiffness: Reals) -> tuple[Reals, Reals]:
    """Three crests that veer instead of crossing: the support's meets two of the gear pair.

    Returns:
        Speeds [rev/min] and amplitudes [m] of the crests, shape (m, 3). With a soft support
        they lie near 0, 1290 and 1900, with a stiff one near 1180, 1730 and infinity.
    """
    first, second = 1180.0**2, 1730.0**2
    couple = np.sqrt([first * (1290.0**2 - first), second * (1900.0**2 - second)])
    matrix = np.zeros((len(stiffness), 3, 3))
    matrix[:, 0, 0] = 470.0**2 * stiffness / 2.5e8 + couple[0] ** 2 / first
    matrix[:, 0, 0] += couple[1] ** 2 / second
    matrix[:, 0, 1:] = matrix[:, 1:, 0] = couple
    matrix[:, 1, 1], matrix[:, 2, 2] = first, second
    squares, shapes = np.linalg.eigh(matrix)
    return np.sqrt(squares), 1e-6 * (1.5 + 16 * (1 - shapes[:, 0, :] ** 2))


def veering_amplitude(speed: Reals, stiffness: Reals) -> Reals:
    """A map with the crests of `veering_crests`; shape (m, n) [m]."""
    centres, heights = veering_crests(stiffness)
    curves = [crest(speed, centres[:, [at]], 35, heights[:, [at]]) for at in range(3)]
    return np.asarray(5e-7 + np.sum(curves, axis=0))


def write_result(
    path: Path,
    speed: Reals,
    stiffness: Reals,
    *,
    support: str = "both",
    irregular: tuple[float, float] | None = None,
) -> Path:
    """Write a complete result file.

    Args:
        path: Where to.
        speed: Rotating speeds [rev/min].
        stiffness: Support stiffnesses [N/m].
        support: 'both', 'rigid' or 'flexible'.
        irregular: First and last speed of a chaotic band whose points did not settle.

    Returns:
        The path.
    """
    random = np.random.default_rng(7)
    with h5py.File(path, "w") as file:
        scales = {"speed": speed}
        if support != "rigid":
            scales["support_stiffness"] = stiffness
        for name, values in scales.items():
            scale = file.create_dataset(name, data=values)
            scale.make_scale(name)
            _describe(scale, name)
        for prefix, dimensions in (("", ("support_stiffness", "speed")), ("rigid_", ("speed",))):
            if support == ("flexible" if prefix else "rigid"):
                continue
            amplitude = rigid_amplitude(speed) if prefix else flexible_amplitude(speed, stiffness)
            status = np.ones(amplitude.shape, dtype=np.int32)
            motion = np.ones(amplitude.shape, dtype=np.int32)
            if irregular is not None:
                band = (speed >= irregular[0]) & (speed <= irregular[1])
                amplitude[..., band] *= random.uniform(0.8, 1.6, amplitude[..., band].shape)
                status[..., band], motion[..., band] = 2, 30
            values = {
                "y1_amplitude": amplitude,
                "bearing1_deformation_max": 2 * amplitude,
                "error_estimate": np.full(amplitude.shape, 1e-6),
                "motion": motion,
                "contact": np.zeros(amplitude.shape, dtype=np.int32),
                "status": status,
            }
            if support == "both" and not prefix:
                values["eta1"] = np.zeros(amplitude.shape)
            for name, data in values.items():
                item = file.create_dataset(prefix + name, data=data)
                for at, dimension in enumerate(dimensions):
                    item.dims[at].attach_scale(file[dimension])
                _describe(item, name)
        file.create_group("provenance").create_dataset("deck", data=DECK)
        file.create_group("history")
    return path


def _describe(item: h5py.Dataset, name: str) -> None:
    """Attach unit and long name as fixed-length strings, as Fortran writes them."""
    metres = name.endswith(("amplitude", "deformation_max"))
    unit = UNITS.get(name, "m" if metres else "1")
    item.attrs["units"] = np.bytes_(unit)
    item.attrs["long_name"] = np.bytes_(name.replace("_", " "))
