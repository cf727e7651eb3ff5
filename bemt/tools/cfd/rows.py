"""One run of a campaign as its recording holds it: a line of ``recording.csv``."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from bemt.base.document import Documented


@dataclass(frozen=True)
class RunRow(Documented):
    """Point, loads with their standard uncertainties, how it was computed, and how well it settled; NaN: not stated."""

    run: str = ""
    rpm: float = math.nan
    airspeed_m_s: float = math.nan
    J: float = math.nan
    thrust_N: float = math.nan
    torque_Nm: float = math.nan
    u_thrust_N: float = math.nan
    u_torque_Nm: float = math.nan
    thrust_rotor_N: float = math.nan
    thrust_standing_N: float = math.nan
    density_kg_m3: float = math.nan
    temperature_C: float = math.nan
    pressure_Pa: float = math.nan
    wall_distance_m: float = math.nan
    tip_gap_mm: float = math.nan
    sideslip_deg: float = math.nan
    pitch_offset_deg: float = math.nan
    solver: str = ""
    gas: str = ""
    domain: str = ""
    sector: str = ""
    turbulence: str = ""
    level: float = math.nan
    cells: float = math.nan
    iterations: float = math.nan
    averaged: float = math.nan
    drift_thrust: float = math.nan
    drift_torque: float = math.nan
    scatter_thrust: float = math.nan
    scatter_torque: float = math.nan
    balance_mass: float = math.nan
    balance_momentum: float = math.nan
    balance_angular_momentum: float = math.nan
    swirl_out: float = math.nan
    yplus_avg: float = math.nan
    seconds: float = math.nan
    start: str = ""
    converged: float = math.nan
    note: str = ""

    @property
    def settled(self) -> bool:
        """Whether it converged."""
        return self.converged == 1


COLUMNS = tuple(f.name for f in fields(RunRow))
TEXTS = {f.name for f in fields(RunRow) if f.type == "str"}
