"""``drive.toml``: battery, ESC, motor and vehicle that belong to the rotor of a case."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from bemt.base.toml import Table, entry, read_model
from bemt.drive.drive_model import LIPO_SOC, LIPO_V, Battery, Drive, Esc, Motor
from bemt.drive.rotor_table import RotorMap


def _slip_mohm(value: float) -> str:
    return "Is that in ohm? Write milliohm" if 0.0 < value < 0.05 else ""


class BatteryTable(Table):
    """[battery]: battery of the whole vehicle."""

    cells: int = entry("cells in series", low=1, high=60, required=True)
    capacity_Ah: float = entry("capacity", "A h", 0.01, 1000.0, required=True)
    resistance_mohm: float = entry("resistance of the pack with leads", "mohm", 0.0, 5000.0, _slip_mohm, required=True)
    soc: float = entry("state of charge at the start", "", 0.01, 1.0, default=1.0)
    soc_min: float = entry("state of charge at the end of a flight", "", 0.0, 0.99, default=0.2)
    soc_table: tuple[float, ...] = entry("states of charge for ocv_cell_V, ascending", "", 0.0, 1.0, default=LIPO_SOC)
    ocv_cell_V: tuple[float, ...] = entry("open-circuit voltages of a cell", "V", 0.5, 5.0, default=LIPO_V)

    def rules(self) -> Iterable[tuple[str, ...]]:
        """A flight ends below its start; the table of voltages is whole."""
        if self.soc_min >= self.soc:
            yield "soc_min", f"{self.soc_min:g}", "less than soc"
        if ("soc_table" in self.model_fields_set) != ("ocv_cell_V" in self.model_fields_set):
            yield "ocv_cell_V", "one of soc_table, ocv_cell_V", "both or none"
        elif not len(self.soc_table) == len(self.ocv_cell_V) > 1 or np.any(np.diff(self.soc_table) <= 0):
            yield "soc_table", "lists that do not fit", "rising values, as many as ocv_cell_V, 2 or more"


class EscTable(Table):
    """[esc]: speed controller."""

    name: str | None = entry("name of the controller")
    pulse_min_us: float = entry("pulse width at zero throttle", "us", 0.0, 5000.0, default=1000.0)
    pulse_max_us: float = entry("pulse width at full throttle", "us", 1.0, 5000.0, default=2000.0)
    exponent: float = entry("duty = throttle share to this power", "", 0.2, 5.0, default=1.0)
    resistance_mohm: float = entry("resistance of the switches", "mohm", 0.0, 1000.0, _slip_mohm, default=0.0)
    idle_A: float = entry("current of the controller itself", "A", 0.0, 5.0, default=0.0)
    current_limit_A: float | None = entry("limit of the battery current; none if omitted", "A", 0.1, 1000.0)
    braking: Literal["yes", "no"] = entry("synchronous switching (yes) or freewheeling diodes (no)", default="yes")
    brake_on_stop: float = entry("braking strength at zero throttle; 0: the rotor coasts", "", 0.0, 1.0, default=1.0)
    pwm_kHz: float | None = entry(
        "switching frequency; with motor.inductance_uH it sets when the diode current stops", "kHz", 0.1, 1000.0
    )

    def rules(self) -> Iterable[tuple[str, ...]]:
        """Pulse widths in order."""
        if self.pulse_max_us <= self.pulse_min_us:
            yield "pulse_max_us", f"{self.pulse_max_us:g}", "more than pulse_min_us"


class MotorTable(Table):
    """[motor]: electric motor."""

    name: str | None = entry("name of the motor")
    kv_rpm_V: float = entry("speed constant", "rev/min/V", 1.0, 50000.0, required=True)
    resistance_mohm: float = entry(
        "winding resistance between two leads", "mohm", 0.01, 50000.0, _slip_mohm, required=True
    )
    no_load_A: float = entry("no-load current", "A", 0.0, 100.0, required=True)
    inertia_kg_mm2: float = entry("inertia of the rotating part", "kg mm2", 0.0, 1e7, required=True)
    heat_capacity_J_K: float | None = entry("heat capacity of the winding; stays cold if omitted", "J/K", 0.01, 1e6)
    thermal_K_W: float | None = entry(
        "thermal resistance from winding to air; with heat_capacity_J_K", "K/W", 0.001, 1000.0
    )
    ambient_C: float = entry("ambient temperature", "C", -60.0, 60.0, default=25.0)
    max_temperature_C: float | None = entry("highest temperature of the winding", "C", 20.0, 400.0)
    inductance_uH: float | None = entry("inductance between two leads", "uH", 0.01, 1e5)
    pole_pairs: int | None = entry("pole pairs, for the reactance of the winding", low=1, high=200)

    def rules(self) -> Iterable[tuple[str, ...]]:
        """Heat needs both numbers, reactance needs the inductance."""
        if (self.heat_capacity_J_K is None) != (self.thermal_K_W is None):
            yield "thermal_K_W", "one of heat_capacity_J_K, thermal_K_W", "both or none"
        if self.pole_pairs is not None and self.inductance_uH is None:
            yield "inductance_uH", "nothing", "a value, as motor.pole_pairs is given"


class TurningTable(Table):
    """[rotor]: rotor data that the case does not have."""

    inertia_kg_mm2: float = entry("inertia of the rotor", "kg mm2", 0.0, 1e7, required=True)


class VehicleTable(Table):
    """[vehicle]: mass and rotor count."""

    mass_kg: float = entry("total mass", "kg", 0.001, 1e5, required=True)
    rotors: int = entry("number of rotors on the battery", low=1, high=64, required=True)


class AssumedTable(Table):
    """[[assumed]]: a value in this file that no source states."""

    key: str = entry("dotted key, such as motor.kv_rpm_V", required=True)
    why: str = entry("source of the value", required=True)


class DriveToml(Table):
    """drive.toml: battery, ESC, motor and vehicle that belong to the rotor of a case."""

    schema_: Literal["bemt.drive/1"] = entry("version of the format", required=True, alias="schema")
    battery: BatteryTable
    esc: EscTable = EscTable()
    motor: MotorTable
    rotor: TurningTable
    vehicle: VehicleTable | None = None
    assumed: tuple[AssumedTable, ...] = ()

    def rules(self) -> Iterable[tuple[str, ...]]:
        """What joins battery, controller, motor and rotor."""
        if self.esc.pwm_kHz is not None and self.motor.inductance_uH is None:
            yield "motor.inductance_uH", "nothing", "a value, as esc.pwm_kHz is given"
        if self.rotor.inertia_kg_mm2 + self.motor.inertia_kg_mm2 <= 0.0:
            yield "rotor.inertia_kg_mm2", "0 with a motor of 0", "more than 0 together"
        for i, item in enumerate(self.assumed):
            table, _, key = item.key.partition(".")
            home = self.inner(table) if table in self.named() and table != "assumed" else None
            if home is None or key not in home.named():
                yield f"assumed[{i}].key", repr(item.key), "a dotted key of this file, as motor.kv_rpm_V"


@dataclass(frozen=True, eq=False)
class DriveFile:
    """A drive.toml as the drive is solved: battery and its resistance are the share of one rotor."""

    path: Path
    battery: Battery
    esc: Esc
    motor: Motor
    rotor_inertia_kg_m2: float
    soc: float  # at the start
    soc_min: float  # where a flight ends
    mass_kg: float  # of the vehicle, NaN without one
    rotors: int  # that share the battery
    max_temperature_C: float  # of the winding, NaN when not stated
    assumed: Mapping[str, str]  # key to reason

    def drive(self, rotor: RotorMap) -> Drive:
        """Put the drive of a rotor together."""
        return Drive(self.battery, self.esc, self.motor, rotor)

    @property
    def rpm_max(self) -> float:
        """Speed at no load and full battery, a bound for rotor tables. [rev/min]"""
        return float(self.battery.voc(1.0)) * self.motor.kv_rpm_V


def read(path: Path) -> DriveFile:
    """Read a drive.toml."""
    file = read_model(DriveToml, path)
    b, e, m = file.battery, file.esc, file.motor
    n = file.vehicle.rotors if file.vehicle else 1
    henry = None if m.inductance_uH is None else m.inductance_uH * 1e-6
    return DriveFile(
        path=path,
        battery=Battery(b.cells, n * b.resistance_mohm * 1e-3, b.capacity_Ah / n, b.soc_table, b.ocv_cell_V),
        esc=Esc(
            e.pulse_min_us, e.pulse_max_us, e.exponent, e.resistance_mohm * 1e-3, e.idle_A,
            _or(e.current_limit_A, math.inf), e.braking == "yes", e.brake_on_stop,
            math.inf if henry is None or e.pwm_kHz is None else 2e3 * henry * e.pwm_kHz,
        ),
        motor=Motor(
            m.kv_rpm_V, m.resistance_mohm * 1e-3, m.no_load_A, m.inertia_kg_mm2 * 1e-6,
            _or(m.heat_capacity_J_K, math.inf), _or(m.thermal_K_W, 0.0), m.ambient_C,
            0.0 if henry is None or m.pole_pairs is None else m.pole_pairs * henry,
        ),
        rotor_inertia_kg_m2=file.rotor.inertia_kg_mm2 * 1e-6, soc=b.soc, soc_min=b.soc_min,
        mass_kg=file.vehicle.mass_kg if file.vehicle else math.nan, rotors=n,
        max_temperature_C=_or(m.max_temperature_C, math.nan), assumed={item.key: item.why for item in file.assumed},
    )  # fmt: skip


def _or(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value
