"""Writes result files as the solver does, with data made up for the tests."""

from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from spurflex_postproc.published import PAPER_STIFFNESS

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
    """The same with a crest that passes 480 rev/min at `PAPER_STIFFNESS`; shape (m, n) [m]."""
    n, k = np.meshgrid(speed, stiffness)
    centre = 480 * np.sqrt(k / PAPER_STIFFNESS)
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


WINDOW = 840
"""Mesh periods of the spectrum of recorded files."""
SECOND = 0.37
"""Order of the second frequency of what is flagged quasi-periodic."""


def made_up_motion(flag: int, time: Reals, scale: float) -> tuple[Reals, Reals]:
    """A motion of one class: value [m] and rate per mesh period at times in mesh periods."""
    parts = [(1.0, 1.0, 0.3), (2.0, 0.25, 1.0)]
    if flag == 20:
        parts += [(SECOND, 0.4, 0.1), (1 - SECOND, 0.3, 0.7), (1 + SECOND, 0.2, 0.2)]
    elif flag > 1:
        flag %= 100
        parts += [(at / flag, 0.5 / at, 0.4 * at) for at in range(1, 2 * flag) if at % flag]
    value, rate = np.full(time.shape, 4 * scale), np.zeros(time.shape)
    for order, height, phase in parts:
        angle = 2 * np.pi * order * time + phase
        value += scale * height * np.sin(angle)
        rate += scale * height * 2 * np.pi * order * np.cos(angle)
    return value, rate


def made_up_spectrum(flag: int, scale: float, highest: float) -> Reals:
    """Its amplitude spectrum up to an order, over as many lines as `WINDOW` gives [m]."""
    whole = flag if 1 <= flag <= 8 else WINDOW
    time = np.arange(64 * whole) / 64
    value, _ = made_up_motion(flag, time, scale)
    taper = np.ones(value.shape) if whole < WINDOW else 1 - np.cos(2 * np.pi * time / whole)
    lines = 2 * np.abs(np.fft.rfft((value - value.mean()) * taper)) / len(time)
    lines[0] = abs(value.mean())
    found = np.zeros(round(highest * WINDOW) + 1)
    step = WINDOW // whole
    found[::step] = lines[: len(found[::step])]
    return found


def add_recordings(
    path: Path,
    *,
    quantities: tuple[str, ...] = ("y1",),
    highest: float = 4.0,
    sections: int = 24,
    periods: int = 8,
    samples: int = 64,
    scale: float = 1e-5,
) -> Path:
    """Add spectra, Poincare sections and histories of the flagged motions to a result file.

    Args:
        path: A file of `write_result`; its motion flags say what is recorded.
        quantities: What is recorded.
        highest: Highest order of the spectra.
        sections: Points of the sections.
        periods: Mesh periods of the histories.
        samples: Samples of a mesh period.
        scale: Amplitude of the motions at the first speed; it grows with the speed.

    Returns:
        The path.
    """
    with h5py.File(path, "r+") as file:
        axes = {
            "order": np.arange(round(highest * WINDOW) + 1) / WINDOW,
            "section": np.arange(1.0, sections + 1),
            "mesh_time": np.arange(periods * samples) / samples,
        }
        for name, values in axes.items():
            scale_ = file.create_dataset(name, data=values)
            scale_.make_scale(name)
            _describe(scale_, name)
        speed = file["speed"][:]
        for prefix in ("", "rigid_"):
            if f"{prefix}motion" not in file:
                continue
            flags = file[f"{prefix}motion"][:]
            size = scale * np.broadcast_to(speed / speed[0], flags.shape) ** 0.5
            for quantity in quantities:
                made: dict[str, Reals] = {}
                ending = "" if quantity == "y1" else f"_{quantity}"
                history = f"history/{prefix}{quantity}"
                for product, axis in (
                    (f"{prefix}spectrum{ending}", "order"),
                    (f"{prefix}poincare{ending}", "section"),
                    (f"{prefix}poincare{ending}_rate", "section"),
                    (history, "mesh_time"),
                    (f"{history}_rate", "mesh_time"),
                ):
                    made[product] = np.full((*flags.shape, len(axes[axis])), np.nan)
                    item = file.create_dataset(product, data=made[product])
                    for at, name in enumerate(("support_stiffness", "speed")[-flags.ndim :]):
                        item.dims[at].attach_scale(file[name])
                    item.dims[flags.ndim].attach_scale(file[axis])
                    item.attrs["units"] = np.bytes_("m/s" if product.endswith("rate") else "m")
                    if axis == "order":
                        item.attrs["window"] = np.bytes_("Hann over 840 mesh periods")
                for at in np.ndindex(flags.shape):
                    flag, height = int(flags[at]), float(size[at])
                    file[f"{prefix}spectrum{ending}"][at] = made_up_spectrum(flag, height, highest)
                    for name, time in (
                        (f"{prefix}poincare{ending}", axes["section"] - 1),
                        (history, axes["mesh_time"]),
                    ):
                        value, rate = made_up_motion(flag, time, height)
                        file[name][at], file[f"{name}_rate"][at] = value, rate
    return path


def write_motions(path: Path) -> Path:
    """Write a result of 20 speeds whose motions follow each other as published, and recordings.

    1T to 4600, quasi-periodic to 4900, 3T to 5300, 1T to 5500, 2T to 6000 rev/min; on the rigid
    support the first 2T point is one of 9T.
    """
    speed = np.arange(300.0, 6001.0, 300.0)
    write_result(path, speed, np.array([2.5e8]))
    flags = np.ones(speed.shape, dtype=np.int32)
    for first, flag in ((4600, 20), (4900, 3), (5300, 1), (5500, 2)):
        flags[speed > first] = flag
    with h5py.File(path, "r+") as file:
        file["motion"][0] = flags
        flags[np.argmax(flags == 2)] = 109
        file["rigid_motion"][...] = flags
    return add_recordings(path, quantities=("y1", "x2"))
