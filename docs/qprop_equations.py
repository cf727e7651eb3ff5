"""A QPROP file by QPROP's own equations, for where the program is not built: ``python docs/qprop_equations.py``.

With ``qprop`` on the path the program itself answers. It reads `qcon.def` of its folder: density, viscosity, sound.

M. Drela, "QPROP formulation" (MIT, 2006; not read): swirl by Prandtl's factor at the local wake angle, without
light-loading assumption, as in gvcalc.f, tqcalc.f and cdfun.f of QPROP 1.22 (read). The Reynolds number to which drag
is scaled is that of the first station for all, as there; 25 stations with splines between those of the file. The rise
of the drag above the critical Mach number is left out.
"""

from __future__ import annotations

import math
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from bemt.base.arrays import Array

STATIONS = 25
MACH2 = 0.9  # Beyond, Prandtl and Glauert's factor is held


def read(path: Path) -> tuple[float, float, Array]:
    """Blades, tip radius [m] and a row per station: r, c, beta [rad], then the ten numbers of its section."""
    lines = [line.split("!")[0].strip() for line in path.read_text(encoding="utf-8").splitlines()[1:]]
    rows = [[float(v) for v in line.split()] for line in lines if line and not line.startswith("#")]
    (blades, R), head = rows[0], [v for row in rows[1:5] for v in row]
    table = np.array([row + head[len(row) - 3 :] for row in rows[7:]])
    table[:, 2] = np.radians(table[:, 2])
    return blades, R, table


def loads(path: Path, rpm: float, airspeed_m_s: float, air: Any) -> tuple[float, float]:
    """Thrust [N] and torque [N m] at a speed [rev/min] and an axial airspeed."""
    B, R, table = read(path)
    share = (np.arange(STATIONS) + 0.5) / STATIONS
    r = table[0, 0] * (1.0 - share) + table[-1, 0] * share
    dr = (table[-1, 0] - table[0, 0]) / STATIONS
    c, beta, cl0, cla, low, high, cd0, cd2u, cd2l, clcd0, _, exponent = CubicSpline(
        table[:, 0], table[:, 1:], bc_type="natural"
    )(r).T
    Ua, Ut = np.full(STATIONS, airspeed_m_s), rpm * math.pi / 30.0 * r
    U = np.hypot(Ua, Ut)

    def state(psi: Array) -> tuple[Array, ...]:
        Wa, Wt = 0.5 * (Ua + U * np.sin(psi)), 0.5 * (Ut + U * np.cos(psi))
        wake = Wa / Wt * r / R
        F = 2.0 / math.pi * np.arccos(np.exp(-np.minimum(0.5 * B * (1.0 - r / R) / wake, 20.0)))
        circulation = 4.0 / B * F * (Ut - Wt) * np.hypot(math.pi * r, 4.0 / B * R * wake)
        W2 = Wa**2 + Wt**2
        alpha = beta - np.arctan2(Wa, Wt)
        factor = 1.0 / np.sqrt(1.0 - np.minimum(W2 / air.a_sound**2, MACH2))
        cl = (cla * alpha + cl0) * factor
        stall = (cl > high) | (cl < low)
        held = np.clip(cl, low, high)
        cl = np.where(stall, held * np.cos(alpha - cl0 / cla), cl)
        return circulation - 0.5 * c * cl * np.sqrt(W2), Wa, Wt, cl, alpha, stall

    psi = np.maximum(np.arctan2(Ua, Ut), beta + cl0 / cla)
    for _ in range(60):
        slope = (state(psi + 1e-7)[0] - state(psi - 1e-7)[0]) / 2e-7
        psi = psi + np.clip(-state(psi)[0] / slope, -0.1, 0.1)
    res, Wa, Wt, cl, alpha, stall = state(psi)
    W = np.hypot(Wa, Wt)
    Re = air.rho * c * W / air.mu
    cd = (cd0 + np.where(cl > clcd0, cd2u, cd2l) * (cl - clcd0) ** 2) * (Re / table[0, 11]) ** exponent
    cd = cd + np.where(stall, 2.0 * np.sin(alpha - (clcd0 - cl0) / cla) ** 2, 0.0)
    if np.abs(res).max() > 1e-6 * np.abs(0.5 * c * W).max():
        return math.nan, math.nan
    half = 0.5 * air.rho * B * c * W * dr
    return float(np.sum(half * (cl * Wt - cd * Wa))), float(np.sum(half * (cl * Wa + cd * Wt) * r))


def program(path: Path, rpm: float, airspeed_m_s: float, air: Any) -> tuple[float, float]:
    """Thrust [N] and torque [N m] of the program `qprop`, by its format 2100 (qprop.f); NaN where it ends without."""
    (path.parent / "qcon.def").write_text(f" {air.rho:.9g}\n {air.mu:.9g}\n {air.a_sound:.9g}\n")
    call = ["qprop", path.name, "motor", f"{airspeed_m_s:.9g}", f"{rpm:.9g}"]
    said = subprocess.run(call, cwd=path.parent, capture_output=True, text=True, timeout=60).stdout
    rows = [line for line in said.splitlines() if len(line) > 150 and line[0] == "#" and line[8:9].isdigit()]
    return (float(rows[-1][28:40]), float(rows[-1][40:52])) if rows else (math.nan, math.nan)


def compared() -> list[tuple[str, float, float, float, float]]:
    """Case, speed, airspeed, and how far thrust and torque of QPROP's equations are off BEMT's [%]."""
    import tempfile

    from bemt.rotors.case import load_case
    from bemt.tools.exports import exports
    from bemt.tools.exports.base import Job
    from bemt.tools.exports.performance import solve_points

    cases = Path(__file__).resolve().parent.parent / "cases"
    rows = []
    for name in ("prop_8x5", "prop_10x5", "prop_12x6", "prop_14x8"):
        case = load_case(cases / name / "case.toml")
        for rpm, J in ((4000.0, 0.0), (8000.0, 0.0), (8000.0, 0.3), (8000.0, 0.5)):
            V = J * rpm / 60.0 * case.diameter_m
            job = Job(case, rpm, V)
            own = solve_points(case, rpm, V)
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "blade.qprop"
                path.write_text(str(next(iter(exports()["qprop"].write(job).values()))), encoding="utf-8")
                by = program if shutil.which("qprop") else loads
                T, Q = by(path, rpm, V, case.air())
            rows.append((name, rpm, V, 100.0 * (T / own.thrust_N[0] - 1.0), 100.0 * (Q / own.torque_Nm[0] - 1.0)))
    return rows


if __name__ == "__main__":
    print("| case | rev/min | m/s | thrust % | torque % |\n|---|---|---|---|---|")
    for name, rpm, V, T, Q in compared():
        print(f"| {name} | {rpm:.0f} | {V:.1f} | {T:+.1f} | {Q:+.1f} |")
