"""What a case page plots: geometry, performance over J and rpm with bands, radial loading, refinement of the stations.

The bands are those of `bemt.rotors.case.propagate`, as everywhere.
"""

from __future__ import annotations

import math

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import InputError
from bemt.results.report.book import BladeCurves, CaseCurves, RadialCurves, Refinement
from bemt.rotors.case import Case

N_J, N_RPM = 29, 21
REFINED = (10, 20, 40, 80)


def blade_curves(case: Case) -> BladeCurves:
    """Chord and blade angle over the radius."""
    rotor = case.rotor()
    r = np.linspace(rotor.blade.Rhub, rotor.blade.R, 41)
    chord, beta = rotor.blade.at(r)
    return BladeCurves(r / rotor.R, 1e3 * chord, np.degrees(beta))


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


def case_curves(case: Case, full_rpm: float | None = None) -> CaseCurves:
    """Performance over J and over rpm up to full throttle [rev/min], BEMT with bands and K1/K2."""
    from bemt.rotors.case.prepare import k1k2_case
    from bemt.rotors.case.propagate import propagate
    from bemt.rotors.validity import counted

    rotor = case.rotor()
    rpm, V, cut = _grids(case, rotor.blade.pitch_m() / rotor.D, full_rpm)
    found = propagate(case, rpm, V).points
    simple = k1k2_case(case, None, rpm, V, case.air())
    shown = [*range(keep := _until_windmill(found.CT[:cut])), *range(cut, len(found))]
    flags = counted([found.flags[i] for i in shown])
    over_J, over_rpm = found.select(slice(keep)), found.select(slice(cut, None))
    return CaseCurves(over_J, over_rpm, simple.CT[:keep], simple.thrust_N[cut:], flags)


def _until_windmill(CT: Array) -> int:
    """Points up to the first without thrust, that one included."""
    below = np.flatnonzero(CT < 0.0)
    return int(below[0]) + 1 if below.size else len(CT)


def radial_curves(case: Case) -> RadialCurves:
    """Loading along the blade at the case's own operating point."""
    from bemt.physics.bem import solver
    from bemt.rotors.case.prepare import prepare_case

    prep = prepare_case(case).prep
    answer = solver.solve(prep, case.rpm, case.airspeed_m_s, case.air(), radial=True)
    stations = prep.stations
    ok = np.where(answer.converged[0], 1.0, np.nan)
    dT, dQ, alpha, M = (answer.radial[name][0] for name in ("dT", "dQ", "alpha", "M"))
    r_over_R = stations.r / prep.rotor.R
    return RadialCurves(r_over_R, dT / stations.dr * ok, dQ / stations.dr * ok, np.degrees(alpha) * ok, M * ok)


def refinement(case: Case) -> Refinement:
    """Thrust and torque against the number of blade elements."""
    from bemt.data.recordings.grid_study import grid_study
    from bemt.rotors.case.prepare import prepare_case

    air = case.air()
    points = [prepare_case(case, None, n).solve(case.rpm, case.airspeed_m_s, air) for n in REFINED]
    T, Q = (np.array([float(getattr(p, name)[0]) for p in points]) for name in ("thrust_N", "torque_Nm"))
    study = None
    if np.all(np.isfinite(T[-3:])) and not np.any(T[-2:] == 0.0):
        try:
            study = grid_study(T[:-4:-1].tolist(), [2.0, 2.0])
        except InputError:
            study = None
    used = case.file.model.stations
    finest = float(T[-1])
    near = REFINED.index(used) if used in REFINED else None
    change = math.nan if near is None or finest == 0.0 else float(T[near]) / finest - 1.0
    return Refinement(REFINED, T, Q, used, change, study)
