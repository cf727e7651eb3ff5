"""Where a thrust formula holds and where it fails: ratios over measured values in bands of the conditions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.units import INCH
from bemt.formula import compact
from bemt.formula.points import FitPoints
from bemt.formula.refit import Fitted, has, predict

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

NEAR, FAR = 0.13, 0.26
"""Shares within these relative errors are counted [-]: what the source of K1 and K2 claims for 68 and 95 %."""
X_MAX = 0.8
"""J/(P/D) up to which relative errors in flight are counted: thrust vanishes soon after [-]."""
X_EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
_EDGES: dict[str, tuple[float, ...]] = {
    "P/D": (0.0, 0.4, 0.6, 0.8, 1.0, np.inf),
    "diameter [in]": (0.0, 6.0, 9.0, 12.0, 16.0, np.inf),
    "tip Mach": (0.0, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5, np.inf),
    "Re": (0.0, 2e4, 4e4, 6e4, 1e5, np.inf),
    "blades": (1.5, 2.5, 3.5, 4.5, np.inf),
}


def flight(points: FitPoints) -> Mask:
    """Points in flight whose relative error counts: forwards, below `X_MAX`, (N,)."""
    return (points.J > 0) & (points.x < X_MAX)


def ratios(ratio: Array) -> dict[str, Any]:
    """Count ratios of made to measured values. [-]

    >>> ratios(np.array([1.0, 1.1, 1.2, 2.0]))
    {'points': 4, 'median': 1.15, 'within_13': 0.5, 'within_26': 0.75}
    """
    if ratio.size == 0:
        return {"points": 0, "median": None, "within_13": None, "within_26": None}
    e = np.where(np.isfinite(ratio), np.abs(ratio - 1.0), np.inf)
    median = float(np.median(ratio[np.isfinite(ratio)])) if np.any(np.isfinite(ratio)) else None
    return {
        "points": int(ratio.size),
        "median": median,
        "within_13": float(np.mean(e <= NEAR + 1e-12)),
        "within_26": float(np.mean(e <= FAR + 1e-12)),
    }


def _labels(edges: tuple[float, ...]) -> list[str]:
    if edges == _EDGES["blades"]:
        return ["2", "3", "4", "5 and more"]
    return [
        f"below {b:g}" if a == 0.0 else f"{a:g} and more" if np.isinf(b) else f"{a:g} to {b:g}"
        for a, b in zip(edges[:-1], edges[1:], strict=True)
    ]


def score(points: FitPoints, models: Mapping[str, Array]) -> dict[str, Any]:
    """Score models of CT over all points and in bands."""
    open_rotors, positive = ~points.ducted, points.CT > 0
    still, moving = points.J == 0, flight(points)

    def row(mask: Mask) -> dict[str, Any]:
        m = mask & positive
        found: dict[str, Any] = {"propellers": int(np.unique(points.index[m]).size), "points": int(m.sum())}
        found["models"] = {name: ratios(CT[m] / points.CT[m]) for name, CT in models.items()}
        return found

    out: dict[str, Any] = {"static": row(still & open_rotors), "flight": row(moving & open_rotors)}
    x = points.x
    out["J/(P/D)"] = [
        {"band": f"{a:.1f} to {b:.1f}", **row((points.J > 0) & (x >= a) & (x < b) & open_rotors)}
        for a, b in zip(X_EDGES[:-1], X_EDGES[1:], strict=True)
    ]
    values = {
        "P/D": points.P_D,
        "diameter [in]": points.of("diameter_m") / INCH,
        "tip Mach": points.M_tip,
        "Re": points.Re(points.chord()),
        "blades": points.of("blades"),
    }
    rows: list[dict[str, Any]] = []
    for quantity, v in values.items():
        edges = _EDGES[quantity]
        for label, a, b in zip(_labels(edges), edges[:-1], edges[1:], strict=True):
            for motion, where in (("static", still), ("flight", moving)):
                found = row((v >= a) & (v < b) & where & open_rotors)
                if found["points"]:
                    rows.append({"quantity": quantity, "band": label, "motion": motion, **found})
    for label, duct in (("no", open_rotors), ("yes", ~open_rotors)):
        for motion, where in (("static", still), ("flight", moving)):
            found = row(duct & where)
            if found["points"]:
                rows.append({"quantity": "ducted", "band": label, "motion": motion, **found})
    out["bands"] = rows
    return out


def power_score(points: FitPoints, CP: Mapping[str, Array]) -> dict[str, Any]:
    """Score power in the same way: ``static`` and ``flight``, per model."""
    out: dict[str, Any] = {}
    for motion, where in (("static", points.J == 0), ("flight", flight(points))):
        m = where & ~points.ducted & np.isfinite(points.CP) & (points.CP > 0)
        out[motion] = {name: ratios(v[m] / points.CP[m]) for name, v in CP.items()}
    return out


def coverage(points: FitPoints, fitted: Fitted, given: str) -> dict[str, float | None]:
    """Share of points inside the published bands of the compact formula. [-]"""
    m = ~points.ducted & ((points.J == 0) | flight(points))
    used = points.select(m & has(points, given))
    still = replace(used, J=np.zeros_like(used.J))
    made, scale = predict(used, fitted, given), predict(still, fitted, given)
    out: dict[str, float | None] = {}
    for i, (name, measured) in enumerate((("CT", used.CT), ("CP", used.CP))):
        ok = np.isfinite(measured)
        for share in ("68", "95"):
            width = np.interp(used.x, compact.BAND_X, compact.BANDS[given][name + share])
            inside = np.abs(measured - made[i]) <= width * scale[i]
            out[name + share] = float(np.mean(inside[ok])) if np.any(ok) else None
    return out
