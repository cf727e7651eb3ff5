"""What a case page plots: geometry, performance over J and rpm with bands, radial loading, refinement of the stations.

The bands are those of `bemt.rotors.case.propagate`, as everywhere.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import InputError
from bemt.rotors.case import Case

N_J, N_RPM = 29, 21
REFINED = (10, 20, 40, 80)
CHANNELS = ("CT", "CP", "eta", "thrust_N", "torque_Nm", "power_W")


def geometry_curves(case: Case) -> dict[str, Any]:
    """Chord, blade angle and thickness over the radius."""
    rotor = case.rotor()
    blade = rotor.blade
    r = np.linspace(blade.Rhub, blade.R, 41)
    chord, beta = blade.at(r)
    x = [a for a, _ in blade.anchors]
    t = [section.thickness for _, section in blade.anchors]
    return {
        "r_over_R": r / rotor.R,
        "chord_over_R": chord / rotor.R,
        "chord_mm": 1e3 * chord,
        "beta_deg": np.degrees(beta),
        "thickness": np.interp(r / rotor.R, x, t) if x else np.full(r.size, np.nan),
    }


def _grids(case: Case, pitch_over_D: float, full_rpm: float | None) -> tuple[Array, Array, int]:
    """Points of the curves: a line of J at the case's rpm, then a line of rpm at its airspeed, to full throttle."""
    J = np.linspace(0.0, 1.45 * pitch_over_D, N_J)
    rpm = np.linspace(0.2, 1.1, N_RPM) * case.rpm
    if full_rpm is not None:
        rpm = np.linspace(0.2, 1.0, N_RPM) * np.fmax(full_rpm, case.rpm)
    speeds = J * case.rpm / 60.0 * case.diameter_m
    return (
        np.concatenate([np.full(N_J, case.rpm), rpm]),
        np.concatenate([speeds, np.full(N_RPM, case.airspeed_m_s)]),
        N_J,
    )


def case_curves(case: Case, full_rpm: float | None = None) -> dict[str, Any]:
    """Performance over J and over rpm up to full throttle [rev/min], BEMT with bands and K1/K2."""
    from bemt.rotors.case.prepare import k1k2_case
    from bemt.rotors.case.propagate import propagate
    from bemt.rotors.validity import counted

    rotor = case.rotor()
    rpm, V, cut = _grids(case, rotor.blade.pitch_m() / rotor.D, full_rpm)
    found = propagate(case, rpm, V).points
    simple = k1k2_case(case, None, rpm, V, case.air())
    whole: dict[str, Array] = {
        **{name: found[name] for name in CHANNELS},
        **{f"u_{name}": found.u[name] for name in CHANNELS},
        "J": found.J,
        "rpm": rpm,
        "M_tip": found.M_tip,
        "k1k2_thrust_N": simple.thrust_N,
        "k1k2_CT": simple.CT,
    }
    shown = [*range(keep := _until_windmill(found.CT[:cut])), *range(cut, len(found))]
    over_J = {name: v[:cut] for name, v in whole.items()}
    return {
        "over_J": {name: v[:keep] for name, v in over_J.items()},
        "over_rpm": {name: v[cut:] for name, v in whole.items()},
        "flags": counted([found.flags[i] for i in shown]),
    }


def _until_windmill(CT: Array) -> int:
    """Points up to the first without thrust, that one included."""
    below = np.flatnonzero(CT < 0.0)
    return int(below[0]) + 1 if below.size else len(CT)


def radial_curves(case: Case) -> dict[str, Any]:
    """Loading along the blade at the case's own operating point."""
    from bemt.physics.bem import solver
    from bemt.rotors.case.prepare import prepare_case

    prep = prepare_case(case).prep
    answer = solver.solve(prep, case.rpm, case.airspeed_m_s, case.air(), radial=True)
    stations = prep.stations
    radial = {name: values[0] for name, values in answer.radial.items()}
    ok = np.where(answer.converged[0], 1.0, np.nan)
    return {
        "r_over_R": stations.r / prep.rotor.R,
        "dT_dr": radial["dT"] / stations.dr * ok,
        "dQ_dr": radial["dQ"] / stations.dr * ok,
        "alpha_deg": np.degrees(radial["alpha"]) * ok,
        "cl": radial["cl"] * ok,
        "M": radial["M"] * ok,
        "Re": radial["Re"] * ok,
    }


def refinement(case: Case) -> dict[str, Any]:
    """Thrust and torque against the number of blade elements."""
    from bemt.data.recordings.grid_study import grid_study
    from bemt.rotors.case.prepare import prepare_case

    air = case.air()
    points = [prepare_case(case, None, n).solve(case.rpm, case.airspeed_m_s, air) for n in REFINED]
    T, Q = (np.array([float(getattr(p, name)[0]) for p in points]) for name in ("thrust_N", "torque_Nm"))
    study = None
    if np.all(np.isfinite(T[-3:])) and not np.any(T[-2:] == 0.0):
        try:
            found = grid_study(T[:-4:-1].tolist(), [2.0, 2.0])
            study = {
                "order": found.order,
                "extrapolated": found.extrapolated,
                "gci_fine": found.gci_fine,
                "u_relative": found.u_relative,
                "flags": list(found.flags),
            }
        except InputError:
            study = None
    used = case.file.model.stations
    finest = float(T[-1])
    near = REFINED.index(used) if used in REFINED else None
    change = math.nan if near is None or finest == 0.0 else float(T[near]) / finest - 1.0
    return {
        "stations": list(REFINED),
        "used": used,
        "thrust_N": T,
        "torque_Nm": Q,
        "change_to_finest": change,
        "grid_study": study,
    }
