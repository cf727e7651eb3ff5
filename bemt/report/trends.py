"""Numbers of the trend page: thrust over diameter, pitch, rpm and tip Mach; choice of a drive; roll moment.

Families start from the first solved propeller case and change one quantity at a time, all else kept. The robot of the
last two plots is that of T. Cahill, MS thesis, Northeastern University, April 2025: 6.5 kg, two drives, 6 kgf wanted,
arms of 0.2 m.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import InputError
from bemt.base.units import G0, INCH, KGF
from bemt.case import Case
from geometry.common import GeometryError

__all__ = ["ROBOT", "choice", "families", "moments"]

ORIGIN = "Cahill 2025"
"""What a case of the source thesis states as its ``origin``."""
ROBOT = {"mass_kg": 6.5, "drives": 2, "wanted_kgf": 6.0, "arm_m": 0.2, "fan_mass_kg": 0.4}
"""Of the source thesis; `fan_mass_kg` is the DS-30 (duct 100 g, motor 300 g), the only drive whose mass it gives."""
N, COARSE = 15, 20
"""Points of a family, and their blade elements: thrust within 0.2 % of the usual 40."""

Array = NDArray[np.float64]


def _line(case: Case, key: str, values: Array) -> dict[str, Any]:
    """Solve one point for each value of a key of the case."""
    from bemt.case.prepare import k1k2_case, prepare_case

    out: dict[str, list[float]] = {name: [] for name in ("thrust_N", "k1k2_thrust_N", "M_tip", "power_W")}
    for value in values:
        changes = {key: float(value)}
        row = [math.nan] * 4
        try:
            air = case.air()
            rpm, V = np.array([case.rpm]), np.array([case.airspeed_m_s])
            points = prepare_case(case, changes, COARSE).solve(rpm, V, air)
            simple = k1k2_case(case, changes, rpm, V, air)
            row = [float(a[0]) for a in (points.thrust_N, simple.thrust_N, points.M_tip, points.power_W)]
        except (InputError, GeometryError, ValueError):
            pass  # this value makes no rotor: a gap in the line
        for name, number in zip(out, row, strict=True):
            out[name].append(number)
    return {name: np.array(v) for name, v in out.items()}


def families(case: Case) -> dict[str, Any]:
    """Vary diameter, pitch and rpm of one propeller."""
    from bemt.case.prepare import k1k2_case, prepare_case

    ready = prepare_case(case)
    D_in, p_in = case.diameter_m / INCH, ready.pitch_m / INCH
    stated = case.stated_pitch_m / INCH
    p_in = stated if math.isfinite(stated) else p_in
    diameters, pitches = np.linspace(0.5, 2.0, N) * D_in, np.linspace(0.3, 2.2, N) * p_in
    rpm = np.linspace(0.1, 1.75, 2 * N) * case.rpm
    air, V = case.air(), np.full(2 * N, case.airspeed_m_s)
    points, simple = ready.solve(rpm, V, air), k1k2_case(case, None, rpm, V, air)
    return {
        "name": case.name,
        "title": case.title,
        "D_in": D_in,
        "pitch_in": p_in,
        "rpm_case": case.rpm,
        "mach_per_rpm": math.pi * case.diameter_m / 60.0 / air.a_sound,
        "mach_per_inch": math.pi * INCH * case.rpm / 60.0 / air.a_sound,
        "mach_top": float(ready.prep.mach_top),
        "diameter": {"diameter_in": diameters, **_line(case, "rotor.diameter_in", diameters)},
        "pitch": {"pitch_in": pitches, **_line(case, "blade.pitch_in", pitches)},
        "rpm": {
            "rpm": rpm,
            "thrust_N": points.thrust_N,
            "k1k2_thrust_N": simple.thrust_N,
            "M_tip": points.M_tip,
            "power_W": points.power_W,
        },
    }


def choice(results: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Compare drives on the robot by thrust over weight."""
    weight = ROBOT["mass_kg"] * G0
    out = []
    for result in results:
        row = next((r for r in result.get("rows", []) if r["source"] == "bemt"), None)
        if row is None or row.get("thrust_N") is None or not math.isfinite(row["thrust_N"]):
            continue
        T, P, u = float(row["thrust_N"]), row.get("power_W"), row.get("u")
        D = float(result["conditions"]["diameter_m"])
        rows = [
            (r["label"], r["source"], ROBOT["drives"] * r["thrust_N"] / weight)
            for r in result["rows"]
            if r["source"] in ("cfd", "bench", "vendor") and r.get("thrust_N") is not None
        ]
        out.append(
            {
                "name": result["name"],
                "kind": result["kind"],
                "thrust_N": T,
                "u": u,
                "power_W": P,
                "disk_loading": T / (math.pi / 4.0 * D**2),
                "g_per_W": T / KGF * 1000.0 / P if P else math.nan,
                "robot_ratio": ROBOT["drives"] * T / weight,
                "rows": rows,
                "u_ratio": math.nan if u is None else ROBOT["drives"] * u / weight,
                "needed": ROBOT["wanted_kgf"] * KGF / T if T > 0 else math.nan,
            }
        )
    return out


def moments(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Roll moment of one drive of a pair about the middle, over its mounting distance."""
    solved = [r for r in results if r.get("rows")]
    chosen = next((r for r in solved if r.get("kind") == "fan"), solved[0] if solved else None)
    if chosen is None:
        return {}
    lines = [
        (r["label"], r["source"], r["thrust_N"], r.get("u"))
        for r in chosen["rows"]
        if r["source"] in ("bemt", "cfd", "bench", "vendor") and r.get("thrust_N") is not None
    ]
    return {"name": chosen["name"], "distance_m": np.linspace(0.0, 0.4, 9), "lines": lines}
