"""u_model of a sweep: how far the rotor as built may lie from the solver's answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.rotors.model import predict_model
from bemt.rotors.population import population

if TYPE_CHECKING:
    from bemt.air import Air
    from bemt.bem.model import Model
    from bemt.case import Case
    from bemt.dataset import Dataset

Array = NDArray[np.float64]


def beyond(case: Case, points: Dataset) -> tuple[Array, tuple[str, ...]]:
    """Factor on u_model at points outside of what the population learnt, and for each point why, or nothing."""
    learnt, known = population().learnt, case.as_built()
    if learnt is None or known.reference is not None:
        return np.ones(points.rpm.size), ("",) * points.rpm.size
    return learnt.beyond(case.diameter_m, points.M_tip, case.ducted)


def u_model(case: Case, model: Model, points: Dataset, air: Air) -> dict[str, Array]:
    """Standard uncertainty of each channel from the model itself: 68 % half width, about the nominal result.

    Beyond the population it is wider by `beyond`. What the population expects beside the nominal result counts too, as
    a root sum of squares.  Exhaust speed follows thrust by momentum, T = m V_e - m V, so that dV_e/V_e = (V_e - V)/(2
    V_e - V) dT/T.  The duct's share has none: no population tells of it.
    """
    known = case.as_built()
    found = predict_model(model, known.prior, points, air, known.drawn, known.reference)
    nominal = np.array([points.CT, points.CP])
    u = beyond(case, points)[0] * np.hypot(found.half_width(), found.mean - nominal)
    with np.errstate(divide="ignore", invalid="ignore"):
        thrust, power = np.abs(u / nominal)
        V, exit_speed = points.airspeed_m_s, points.exhaust_speed_m_s
        exhaust = np.abs(exit_speed - V) / np.abs(2.0 * exit_speed - V) * thrust * np.abs(exit_speed)
    return {
        "thrust_N": thrust * np.abs(points.thrust_N),
        "CT": u[0],
        "CP": u[1],
        "torque_Nm": power * np.abs(points.torque_Nm),
        "power_W": power * np.abs(points.power_W),
        "exhaust_speed_m_s": exhaust,
    }
