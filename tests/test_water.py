"""The promise of water: a propeller has the coefficients of its Reynolds number, whatever the fluid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.case import load_case
from bemt.case.prepare import prepare_case

CASE = """schema = "bemt.case/1"
name = "hydro"
[rotor]
kind = "propeller"
blades = 3
diameter_mm = 250
hub_ratio = 0.18
[blade]
pitch_mm = 250
chord_law = "apc_like"
max_chord_over_R = 0.3
[blade.section]
camber = 0.03
thickness = 0.08
[operating]
rpm = 300
airspeed_m_s = 0.6
[air]
{air}
"""


def coefficients(folder: Path, air: str, rpm: float, J: float = 0.5) -> tuple[float, float]:
    folder.mkdir()
    (folder / "case.toml").write_text(CASE.format(air=air), "utf-8")
    case = load_case(folder / "case.toml")
    made = case.air()
    point = prepare_case(case).solve(np.array([rpm]), np.array([J * rpm / 60.0 * 0.25]), made)
    q = made.rho * (rpm / 60.0) ** 2 * 0.25**4
    return float(point.thrust_N[0]) / q, float(point.torque_Nm[0]) / (q * 0.25)


def test_water_and_air_agree_at_one_reynolds_number(tmp_path: Path) -> None:
    wet = coefficients(tmp_path / "wet", 'fluid = "water"\ntemperature_C = 15', 150.0)
    faster = 1.4607e-5 / 1.1386e-6  # kinematic viscosities of air at 15 C, 1.225 kg/m3, and of fresh water
    dry = coefficients(tmp_path / "dry", "density_kg_m3 = 1.225\ntemperature_C = 15", 150.0 * faster)
    assert wet == pytest.approx(dry, rel=0.01)


def test_a_density_between_gas_and_water_is_refused(tmp_path: Path) -> None:
    for k, air in enumerate(("density_kg_m3 = 500", "density_kg_m3 = 1.2\nsalinity_g_kg = 35",
                             'fluid = "water"\ntemperature_C = -5', 'fluid = "water"\naltitude_m = 0')):  # fmt: skip
        with pytest.raises(InputError):
            coefficients(tmp_path / str(k), air, 300.0)
    assert coefficients(tmp_path / "by_density", "density_kg_m3 = 999.1", 300.0) == pytest.approx(
        coefficients(tmp_path / "by_name", 'fluid = "water"', 300.0), rel=1e-3
    )
