"""Rows on figure 3, the ranges of motion, and on the points of figures 4 to 8."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from spurflex_postproc.features.curve import CurveFeatures, curve_features
from spurflex_postproc.features.orders import Line, find_lines, second_frequency
from spurflex_postproc.features.regimes import (
    IRREGULAR,
    flag_name,
    match_borders,
    motion_name,
    sequence,
)
from spurflex_postproc.flags import Motion
from spurflex_postproc.layout import SPEED
from spurflex_postproc.published import (
    PublishedPoint,
    published_points,
    published_regimes,
    tolerance,
)
from spurflex_postproc.published_table.row import Row, number, statement
from spurflex_postproc.recordings import SPECTRUM, Spectra, has_recording, read_spectra

SPEED_CLOSE = 0.5
"""Largest distance of the speed of a point from the published one [rev/min]."""
LISTED = 12
"""Most lines of a spectrum that a row lists."""

SIDES = {
    "lower": "end of the lower range; another motion follows",
    "upper": "beginning of the upper range; another motion precedes",
}


def regime_rows(result: xr.Dataset) -> list[Row]:
    """Compare the motions of one result with figure 3.

    Args:
        result: A dataset from `open_result` with both supports and one stiffness.

    Returns:
        For each support the order of the motions, every border and the chaotic range.
    """
    rows = []
    for support in ("flexible", "rigid"):
        found = curve_features(result, support)
        told = published_regimes(support)
        wanted = [IRREGULAR if name == "chaotic" else name for name, _, _ in told]
        rows.append(
            statement(
                f"figure 3 {support} order",
                "3",
                f"{support} support: order of the motions",
                ", ".join(name for name, _, _ in told),
                sequence(found.regimes),
                [regime.motion for regime in found.regimes] == wanted,
            )
        )
        motions = {regime.motion for regime in found.regimes}
        for border in match_borders(found.regimes, told):
            lacking = [
                f"second {name}" if name in motions else name
                for name, there in zip((border.before, border.after), border.found, strict=True)
                if not there
            ]
            note = f"no {' and no '.join(lacking)} range" if lacking else SIDES.get(border.side, "")
            rows.append(
                number(
                    f"figure 3 {support} {border.before} to {border.after} {border.published:.0f}",
                    "3",
                    f"{support} support: {border.before} to {border.after}",
                    border.published,
                    border.computed,
                    tolerance("boundary"),
                    whole=border.complete,
                    note=note,
                )
            )
        rows.append(_chaotic(result, found, support))
    return rows


def _chaotic(result: xr.Dataset, found: CurveFeatures, support: str) -> Row:
    """Check whether the motion in the published chaotic range is chaotic."""
    ((_, first, last),) = [one for one in published_regimes(support) if one[0] == "chaotic"]
    inside = (found.speed > first) & (found.speed <= last)
    flags, counts = np.unique(found.motion[inside], return_counts=True)
    order = np.argsort(-counts)
    shares = [
        f"{flag_name(int(flags[at]))} {100 * counts[at] / inside.sum():.0f} %" for at in order
    ]
    name = "rigid_lyapunov_exponent" if support == "rigid" else "lyapunov_exponent"
    note = ""
    if name in result:
        values = np.ravel(result[name].values)[: len(found.speed)][inside]
        values = values[np.isin(found.motion[inside], (Motion.QUASI_PERIODIC, Motion.CHAOTIC))]
        values = values[np.isfinite(values)]
        if values.size:
            note = f"largest Lyapunov exponent {values.max():+.1e} per mesh period"
    chaotic = counts[flags == Motion.CHAOTIC].sum() / max(int(inside.sum()), 1)
    irregular = np.array([motion_name(int(flag)) == IRREGULAR for flag in flags], dtype=bool)
    met = float(counts[irregular].sum() / max(int(inside.sum()), 1))
    return statement(
        f"figure 3 {support} chaos",
        "3",
        f"{support} support: motion between {first:.0f} and {last:.0f}",
        "chaotic",
        ", ".join(shares[:4]),
        bool(chaotic > 0.5),
        note,
        met=met,
    )


def point_rows(
    results: Sequence[xr.Dataset], *, complete: bool = True, sweeps: Sequence[xr.Dataset] = ()
) -> list[Row]:
    """Compare the motion and the spectrum at the five speeds of figures 4 to 8.

    Args:
        results: Datasets from `open_result` with the flexible support. Each motion and each
            spectrum is taken from the first that holds it.
        complete: Whether rows that cannot be told are listed as open; if not, they are left out.
        sweeps: Datasets with spectra over many speeds. Where another order than the published one
            is the strongest, a note says at which speeds the published one is.

    Returns:
        For each speed the motion, the strongest order and the other orders.
    """
    rows = []
    for point in published_points():
        key, where = f"figure {point.figure}", f"flexible support, {point.speed:.0f} rev/min"
        flag = next(
            (
                int(result["motion"].values[0, column])
                for result in results
                if (column := _column(result, point.speed)) is not None
            ),
            None,
        )
        if flag is not None:
            named, irregular = flag_name(flag), motion_name(flag) == IRREGULAR
            rows.append(
                statement(
                    f"{key} motion",
                    point.figure,
                    f"{where}: motion",
                    point.motion,
                    named,
                    named == point.motion,
                    "irregular" if irregular and named != "chaotic" else "",
                    met=float(irregular == (point.motion == "chaotic")) / 2,
                )
            )
        elif complete:
            rows.append(_open(f"{key} motion", point, f"{where}: motion", point.motion))
        rows += _orders(point, results, sweeps, complete=complete)
    return rows


def _orders(
    point: PublishedPoint,
    results: Sequence[xr.Dataset],
    sweeps: Sequence[xr.Dataset],
    *,
    complete: bool,
) -> list[Row]:
    """Compare the lines of the spectrum."""
    key, where = f"figure {point.figure}", f"flexible support, {point.speed:.0f} rev/min"
    dominant, others = f"{where}: strongest order", f"{where}: other orders"
    wanted = ", ".join(f"{order:.4g}" for order in point.orders)
    found = _spectrum(point.speed, results)
    if found is None:
        if not complete:
            return []
        return [
            _open(f"{key} dominant", point, dominant, f"{point.dominant:g}"),
            _open(f"{key} orders", point, others, wanted),
        ]
    close = tolerance("order")
    lines = find_lines(found.order, found.amplitude[0])
    if not lines:
        return []
    strengths = {one: _strength(one, lines, close) for one in point.orders}
    absent = [f"{one:.4g}" for one, strength in strengths.items() if not strength]
    notes = [f"lacking {', '.join(absent)}"] if absent else []
    notes += [strength for strength in strengths.values() if strength]
    second = second_frequency([line.order for line in lines[:LISTED]])
    if second is not None:
        notes.append(f"the lines are combinations of 1 and {second:.3f}")
    return [
        number(
            f"{key} dominant",
            point.figure,
            dominant,
            point.dominant,
            lines[0].order,
            close,
            note="; ".join(
                part
                for part in (
                    _strength(point.dominant, lines, close),
                    _where_strongest(point, lines[0].order, sweeps, close),
                )
                if part
            ),
        ),
        statement(
            f"{key} orders",
            point.figure,
            others,
            wanted,
            ", ".join(f"{line.order:.2f}" for line in lines[:LISTED]),
            not absent,
            "; ".join(notes),
            met=1 - len(absent) / len(point.orders),
        ),
    ]


def _strength(order: float, lines: Sequence[Line], close: float) -> str:
    """Say how strong the line at an order is; empty if there is none."""
    for line in lines:
        if abs(line.order - order) <= close:
            return f"{order:.4g}: {100 * line.amplitude / lines[0].amplitude:.1f} %"
    return ""


def _where_strongest(
    point: PublishedPoint, strongest: float, sweeps: Sequence[xr.Dataset], close: float
) -> str:
    """Say where in the published motion its strongest order is the strongest, if not here."""
    if abs(strongest - point.dominant) <= close:
        return ""
    for result in sweeps:
        speed = np.asarray(result[SPEED].values, dtype=float)
        named = [flag_name(int(flag)) for flag in result["motion"].values[0]]
        inside = np.array([name == point.motion for name in named])
        spectra = read_spectra(result, "y1", "flexible", 0)
        heights = np.where(spectra.order > 0, np.nan_to_num(spectra.amplitude), 0.0)
        tops = spectra.order[np.argmax(heights, axis=1)]
        there = speed[inside & (np.abs(tops - point.dominant) <= close)]
        if there.size:
            here = speed[inside]
            return (
                f"strongest from {there[0]:.0f} to {there[-1]:.0f} of the {point.motion} motions"
                f" from {here[0]:.0f} to {here[-1]:.0f}"
            )
    return ""


def _open(key: str, point: PublishedPoint, feature: str, published: str) -> Row:
    """Make a row that the results do not tell."""
    return statement(
        key, point.figure, feature, published, None, None, "no result file tells it at this speed"
    )


def _column(result: xr.Dataset, speed: float) -> int | None:
    """Return the position of a speed [rev/min] in a result; None if it is not there."""
    at = int(np.argmin(np.abs(result[SPEED].values - speed)))
    return at if abs(float(result[SPEED].values[at]) - speed) <= SPEED_CLOSE else None


def _spectrum(speed: float, results: Sequence[xr.Dataset]) -> Spectra | None:
    """Look for a spectrum of y1 on the flexible support at a speed [rev/min]."""
    for result in results:
        column = _column(result, speed)
        if column is None or not has_recording(result, SPECTRUM, "y1", "flexible"):
            continue
        spectrum = read_spectra(result, "y1", "flexible", 0, column)
        if np.isfinite(spectrum.amplitude).any():
            return spectrum
    return None
