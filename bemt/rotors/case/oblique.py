"""Points whose wind is at an angle to the shaft: its parts, and what a model gives there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.physics import coefficients as co
from bemt.physics.bem.coaxial import PairModel
from bemt.physics.bem.model import HUB_LOADS, Flags, Model

if TYPE_CHECKING:
    from bemt.physics.air import Air
    from bemt.physics.bem.oblique_near import Near


def turned(
    model: Model | PairModel, rpm: Array, airspeed_m_s: Array, angle_deg: Array, air: Air, threads: int,
    near: Near | None,
) -> tuple[dict[str, Array], Flags]:  # fmt: skip
    """Channels and flags of points (P,); ``near`` as in :func:`bemt.physics.bem.solver.solve`.

    Airspeed and J are those given, eta is T V cos(angle) / P, and the loads of the hub are there, 0 in axial flow.
    """
    along, side = parted(airspeed_m_s, angle_deg)
    if isinstance(model, PairModel):
        found, flags = model.channels(rpm, along, air, threads, side)
    else:
        found, flags = model.channels(rpm, along, air, threads, side, near)
    n = found["rpm"] / 60.0
    eta = co.eta(along / n / model.diameter_m, found["CT"], found["CP"])
    none = dict.fromkeys(HUB_LOADS, np.where(np.isfinite(found["CT"]) & np.isfinite(found["CP"]), 0.0, np.nan))
    own = {"airspeed_m_s": airspeed_m_s, "J": np.asarray(co.J(airspeed_m_s, n, model.diameter_m)), "eta": eta,
           "sideslip_rad": np.arctan2(side, along)}  # fmt: skip
    return {**none, **found, **own}, flags


def parted(airspeed_m_s: Array, angle_deg: Array) -> tuple[Array, Array]:
    """Speeds along the shaft and in the plane of the disk [m/s] of a wind at an angle to the shaft.

    >>> parted(np.array([10.0, 10.0]), np.array([0.0, 90.0]))[0].round(12)
    array([10.,  0.])
    """
    side = np.where(angle_deg % 180.0 == 0.0, 0.0, np.abs(airspeed_m_s * np.sin(np.radians(angle_deg))))
    along = np.where(angle_deg % 180.0 == 90.0, 0.0, airspeed_m_s * np.cos(np.radians(angle_deg)))
    return along, side
