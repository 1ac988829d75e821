"""The numbers behind figure 9: crests and the effect of the stiffness, against the published."""

import warnings

import numpy as np
from numpy.typing import NDArray

from spurflex_postproc.features import CrestLine, Peak, compare, comparison_table, find_peaks
from spurflex_postproc.published import PAPER_STIFFNESS, PublishedMap

Reals = NDArray[np.float64]
Flags = NDArray[np.bool_]

CLEAR = 1.4
"""Ratio of speeds at which a row counts as clearly on one side of the crest line."""
WITHIN = 0.06
"""Largest distance of a computed crest from its published partner, as a fraction."""


def map_table(
    stiffness: Reals,
    speed: Reals,
    amplitude: Reals,
    regular: Flags,
    crest: CrestLine,
    told: PublishedMap,
) -> str:
    """Compare the map with what is published on it.

    Args:
        stiffness: Support stiffnesses [N/m], shape (m,).
        speed: Rotating speeds [rev/min], shape (n,).
        amplitude: Amplitudes, NaN where there is none, shape (m, n).
        regular: True where the motion is periodic, shape (m, n).
        crest: The computed crest line.
        told: The published features.

    Returns:
        Lines of text.
    """
    start = crest.between(PAPER_STIFFNESS)
    rows = [
        (f"crest at {PAPER_STIFFNESS:.3g} N/m", [told.crest], [start] if start > 0 else []),
    ]
    low = speed < told.flat[0]
    peaks = [
        find_peaks(speed[low], line[low], mask[low])
        for line, mask in zip(amplitude, regular, strict=True)
    ]
    passing = crest.speed_at(stiffness)
    for name, wanted, power in (
        ("crest below the line", told.crests_below, -1),
        ("crest above the line", told.crests_above, 1),
    ):
        for here in wanted:
            side = (passing / here) ** power > CLEAR
            found = _median_peak([peaks[at] for at in np.flatnonzero(side)], here)
            rows.append((name, [here], [found] if found else []))
    table = comparison_table(
        "crests of the map (median over the rows on that side)",
        [(name, compare(here, there)) for name, here, there in rows],
    )
    return "\n".join([table, *_crest_lines(crest), *_spreads(speed, amplitude, told)])


def _median_peak(rows: list[list[Peak]], wanted: float) -> float | None:
    """Return the median speed of the peaks nearest to one wanted, a peak a row."""
    found = []
    for peaks in rows:
        near = [peak.speed for peak in peaks if abs(peak.speed / wanted - 1) <= WITHIN]
        if near:
            found.append(min(near, key=lambda speed: abs(speed - wanted)))
    return float(np.median(found)) if found else None


def _crest_lines(crest: CrestLine) -> list[str]:
    """Say from where to where the crest line could be followed."""
    known = np.flatnonzero(np.isfinite(crest.speed))
    if not known.size:
        return ["  crest line: none found"]
    ends = [
        f"{crest.speed[at]:.0f} rev/min at {crest.stiffness[at]:.2g} N/m"
        for at in (known[0], known[-1])
    ]
    return [f"  crest line followed from {ends[0]} to {ends[1]}"]


def _spreads(speed: Reals, amplitude: Reals, told: PublishedMap) -> list[str]:
    """Say how much the amplitude varies with the stiffness in the published ranges."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # speeds without any value
        low, middle, high = np.nanpercentile(amplitude, (5, 50, 95), axis=0)
    spread = 100 * (high - low) / middle
    lines = [
        "  effect of the support stiffness on the amplitude (5th to 95th percentile over the"
        " stiffnesses, relative to the median; typical is the median over the speeds)"
    ]
    for first, last in (
        (float(speed[0]), told.flat[0]),
        told.flat,
        (told.irregular_above, float(speed[-1])),
    ):
        inside = spread[(speed >= first) & (speed <= last) & np.isfinite(spread)]
        if inside.size:
            lines.append(
                f"    {first:>4.0f} to {last:.0f} rev/min: amplitude varies with stiffness by"
                f" {np.median(inside):.0f} % typically, {inside.max():.0f} % at most"
            )
    return lines
