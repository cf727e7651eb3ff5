"""The rotor of a flight as a case: its thrust constant is a reference run at hover."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.judge.diagnose.rotor_calibration import learn
from bemt.rotors.model import air_fields, air_of_points
from bemt.tools.flight.repeat import flight_scatter

if TYPE_CHECKING:
    from bemt.rotors.as_measured import AsMeasured
    from bemt.rotors.case import Case
    from bemt.tools.flight.identify import Identified

AIR = 0.03
"""Uncertainty of the density, which logs do not hold, against that of the case: 8 K or 300 m of altitude [1]."""


def learn_from_flights(case: Case, files: Sequence[str], flights: Sequence[Identified]) -> AsMeasured:
    """Condition the rotor of a case on hovering flights, one point a flight, by the names of their logs.

    Thrust is that of the rotor where it sits: body in its wash and neighbours included. Flights differ by what
    :func:`bemt.tools.flight.repeat.flight_scatter` says; all share the uncertainty of the density. InputError when a
    flight has no thrust constant in N/rpm^2, or one that is not of this propeller.
    """
    faults, k, own, rpm = [], [], [], []
    for file, flight in zip(files, flights, strict=True):
        c = flight.constants.get("thrust constant")
        if c is None or c.unit != "N/rpm^2":
            got = "no speeds of the rotors" if c is None else "no mass"
            faults.append(Fault(file, "", f"{got}, so no thrust", "a flight with rotor speeds, and --mass-kg"))
            continue
        k.append(c.value)
        own.append(c.half / c.value / 2.0)
        rpm.append(float(np.mean(flight.rotors["mean rpm"])))
    if faults:
        raise InputError(faults)
    air = {name: np.broadcast_to(v, len(k)) for name, v in air_fields(case.air()).items()}
    CT = 3600.0 * np.array(k) / (air["rho"] * case.diameter_m**4)
    sd, _ = flight_scatter(k)
    u = CT * np.hypot(own, sd)
    unseen = np.full(CT.shape, np.nan)
    still = np.zeros(CT.shape)
    return learn(case, files, [CT, unseen], [u, still], np.array(rpm), still, air_of_points(air), (AIR, AIR))
