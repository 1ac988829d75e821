"""Rows on figure 3, the ranges of motion, and on the points of figures 4 to 8."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from spurflex_postproc.features.curve import CurveFeatures, curve_features
from spurflex_postproc.features.orders import dominant_order, find_orders
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
    return statement(
        f"figure 3 {support} chaos",
        "3",
        f"{support} support: motion between {first:.0f} and {last:.0f}",
        "chaotic",
        ", ".join(shares[:4]),
        bool(chaotic > 0.5),
        note,
    )


def point_rows(result: xr.Dataset, spectra: Sequence[xr.Dataset]) -> list[Row]:
    """Compare the motion and the spectrum at the five speeds of figures 4 to 8.

    Args:
        result: A dataset from `open_result` with the flexible support and one stiffness.
        spectra: Datasets with the variable `spectrum` on (support_stiffness, speed, order).

    Returns:
        For each speed the motion, the strongest order and the other orders. Without a spectrum
        at that speed the latter two stay open.
    """
    found = curve_features(result, "flexible")
    rows = []
    for point in published_points():
        flag = int(found.motion[found.at(point.speed)])
        named = flag_name(flag)
        rows.append(
            statement(
                f"figure {point.figure} motion",
                point.figure,
                f"flexible support, {point.speed:.0f} rev/min: motion",
                point.motion,
                named,
                named == point.motion,
                "irregular" if motion_name(flag) == IRREGULAR and named != "chaotic" else "",
            )
        )
        rows += _orders(point, spectra)
    return rows


def _orders(point: PublishedPoint, spectra: Sequence[xr.Dataset]) -> list[Row]:
    """Compare the lines of the spectrum."""
    key = f"figure {point.figure}"
    where = f"flexible support, {point.speed:.0f} rev/min"
    lines = _spectrum(point.speed, spectra)
    wanted = ", ".join(f"{order:g}" for order in point.orders)
    if lines is None:
        missing = "no result file holds the spectrum at this speed"
        head = statement(
            f"{key} dominant",
            point.figure,
            f"{where}: strongest order",
            f"{point.dominant:g}",
            None,
            None,
            missing,
        )
        rest = statement(
            f"{key} orders", point.figure, f"{where}: other orders", wanted, None, None, missing
        )
        return [head, rest]
    order, amplitude = lines
    close = tolerance("order")
    peaks = find_orders(order, amplitude)
    absent = [one for one in point.orders if not any(abs(p - one) <= close for p in peaks)]
    return [
        number(
            f"{key} dominant",
            point.figure,
            f"{where}: strongest order",
            point.dominant,
            dominant_order(order, amplitude),
            close,
        ),
        statement(
            f"{key} orders",
            point.figure,
            f"{where}: other orders",
            wanted,
            ", ".join(f"{one:.2f}" for one in peaks),
            not absent,
            f"lacking {', '.join(f'{one:g}' for one in absent)}" if absent else "",
        ),
    ]


def _spectrum(speed: float, spectra: Sequence[xr.Dataset]) -> tuple[np.ndarray, np.ndarray] | None:
    """Look for the spectrum at a speed [rev/min]; orders and amplitudes, shape (n,)."""
    for result in spectra:
        at = int(np.argmin(np.abs(result[SPEED].values - speed)))
        if abs(float(result[SPEED].values[at]) - speed) > 0.5:
            continue
        values = result["spectrum"].isel({SPEED: at})
        others = {name: 0 for name in values.dims if name != "order"}
        values = values.isel(others)
        amplitude = np.asarray(values.values, dtype=float)
        if np.isfinite(amplitude).any():
            return np.asarray(result["order"].values, dtype=float), amplitude
    return None
