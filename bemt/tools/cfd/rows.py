"""One run of a campaign as its recording holds it, a line of ``recording.csv``, and the grid studies of its runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from bemt.base.document import Documented
from bemt.data.readers import number


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


class LoadStudy(Documented):
    """Grid study of one load, finest grid first; standard uncertainty by level, relative [1]."""

    values: tuple[float, ...]
    order: float | None
    extrapolated: float | None
    gci_fine: float | None
    gci_coarse: float | None
    spread: float
    flags: tuple[str, ...]
    u_relative: Mapping[str, float]


class Study(Documented):
    """Runs that differ in their grid alone, finest first."""

    rpm: float
    airspeed_m_s: float
    wall_distance_m: float
    tip_gap_mm: float
    sideslip_deg: float
    pitch_offset_deg: float
    solver: str
    gas: str
    domain: str
    sector: str
    turbulence: str
    levels: tuple[float, ...]
    cells: tuple[float, ...]
    ratios: tuple[float, ...]
    by_cells: tuple[float, ...]
    thrust_N: LoadStudy
    torque_Nm: LoadStudy

    def of(self, load: str) -> LoadStudy:
        """Study of ``thrust_N`` or ``torque_Nm``."""
        found: LoadStudy = getattr(self, load)
        return found


COLUMNS = tuple(f.name for f in fields(RunRow))
TEXTS = {f.name for f in fields(RunRow) if f.type == "str"}


def run_of(cells: Mapping[str, str]) -> RunRow:
    """Run of a line as written; NaN where nothing or no number stands."""
    found: dict[str, Any] = {k: cells.get(k) or "" for k in TEXTS}
    for name in COLUMNS:
        if name not in TEXTS:
            read = number(text) if (text := cells.get(name)) else None
            found[name] = read if read is not None and math.isfinite(read) else math.nan
    return RunRow(**found)
