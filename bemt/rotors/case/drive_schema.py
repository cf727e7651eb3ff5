"""[drive] of a case file: battery, ESC, motor and vehicle that turn the rotor.

A motor's label gives its K_v only. What is known of its losses is how loaded motors are in use: the share of the
voltage that the speed says is lost, 1 - n/(K_v U), and the share of the current that friction and iron take, both near
full throttle. Medians and 68 % ranges are of points with a propeller, collected by Drive Calculator (direct drive): the
voltage of 2879 points on 859 motors of 174 makers, half of all, chosen by a checksum of the maker's name; the current
of 3582 points on 1088 motors. A uniform range has its ends at sqrt(3) times that.

The speed is lost in more than the winding at rest. Without load these motors turn at 0.994 of K_v (U - R I) in the
median, with a propeller at 0.926, whatever share of the voltage R I is. What is missing acts as a resistance in series,
33 to 60 mohm in the median from low to high winding resistance: switches, leads, commutation and the warm winding,
which the source does not part. So a motor of known resistance also has the share `drop` of its controller.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Literal

import numpy as np

from bemt.base.toml import FieldLimits, Table, entry

LIPO_SOC = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
LIPO_V = (3.27, 3.61, 3.69, 3.73, 3.77, 3.80, 3.84, 3.87, 3.95, 4.02, 4.11, 4.20)
"""Open-circuit voltage of a lithium polymer cell, as printed on hobby charts: declared, not measured here. [V]"""
KV = FieldLimits(
    "rev/min/V", 20.0, 50_000.0, lambda v: "That is rev/min per volt, as printed on the motor" if v < 20 else ""
)
MASS = FieldLimits("kg", 0.005, 1000.0, lambda v: f"In grams? Write {v / 1e3:g}" if v > 1000.0 else "")
CAPACITY = FieldLimits("A h", 0.01, 1000.0, lambda v: f"Looks like mAh: write {v / 1e3:g}" if v > 200.0 else "")


def _slip_mohm(value: float) -> str:
    return "Is that in ohm? Write milliohm" if 0.0 < value < 0.05 else ""


class BatteryTable(Table):
    """[drive.battery]: battery of the whole vehicle."""

    capacity_Ah: float | None = entry("capacity", CAPACITY)
    resistance_mohm: float | None = entry("resistance of the pack with leads", "mohm", 0.0, 5000.0, _slip_mohm)
    sag: float | None = entry("instead: share of its voltage that the pack loses at full throttle", "", 0.0, 0.6)
    soc_table: tuple[float, ...] = entry("states of charge for ocv_cell_V, ascending", "", 0.0, 1.0, default=LIPO_SOC)
    ocv_cell_V: tuple[float, ...] = entry("open-circuit voltages of a cell", "V", 0.5, 5.0, default=LIPO_V)

    def rules(self) -> Iterable[tuple[str, ...]]:
        """One statement of the resistance; the table of voltages is whole."""
        if self.resistance_mohm is not None and self.sag is not None:
            yield "sag", f"{self.sag:g}", "nothing, because resistance_mohm is given"
        if ("soc_table" in self.model_fields_set) != ("ocv_cell_V" in self.model_fields_set):
            yield "ocv_cell_V", "one of soc_table, ocv_cell_V", "both or none"
        elif not len(self.soc_table) == len(self.ocv_cell_V) > 1 or np.any(np.diff(self.soc_table) <= 0):
            yield "soc_table", "lists that do not fit", "rising values, as many as ocv_cell_V, 2 or more"


class EscTable(Table):
    """[drive.esc]: speed controller."""

    name: str | None = entry("name of the controller")
    pulse_min_us: float = entry("pulse width at zero throttle", "us", 0.0, 5000.0, default=1000.0)
    pulse_max_us: float = entry("pulse width at full throttle", "us", 1.0, 5000.0, default=2000.0)
    exponent: float = entry("duty = throttle share to this power", "", 0.2, 5.0, default=1.0)
    resistance_mohm: float = entry("resistance of the switches", "mohm", 0.0, 1000.0, _slip_mohm, default=0.0)
    drop: float | None = entry(
        "instead: share of the voltage lost in controller, leads and warming at full throttle", "", 0.0, 0.6
    )
    idle_A: float = entry("current of the controller itself", "A", 0.0, 5.0, default=0.0)
    current_limit_A: float | None = entry("limit of the battery current; none if omitted", "A", 0.1, 1000.0)
    braking: Literal["yes", "no"] = entry("synchronous switching (yes) or freewheeling diodes (no)", default="yes")
    brake_on_stop: float = entry("braking strength at zero throttle; 0: the rotor coasts", "", 0.0, 1.0, default=1.0)
    pwm_kHz: float | None = entry(
        "switching frequency; with motor.inductance_uH it sets when the diode current stops", "kHz", 0.1, 1000.0
    )

    def rules(self) -> Iterable[tuple[str, ...]]:
        """Pulse widths in order; one statement of the resistance."""
        if self.drop is not None and "resistance_mohm" in self.model_fields_set:
            yield "drop", f"{self.drop:g}", "nothing, because resistance_mohm is given"
        if self.pulse_max_us <= self.pulse_min_us:
            yield "pulse_max_us", f"{self.pulse_max_us:g}", "more than pulse_min_us"


class MotorTable(Table):
    """[drive.motor]: electric motor."""

    name: str | None = entry("name of the motor")
    resistance_mohm: float | None = entry("winding resistance between two leads", "mohm", 0.01, 50000.0, _slip_mohm)
    winding_drop: float | None = entry(
        "instead: share of the voltage lost in the winding at full throttle", "", 0.0, 0.6
    )
    size: float = entry(
        "without either: ln of the resistance over that usual for the current, or for K_v and mass", "", -3.0, 3.0,
        default=0.0,
    )  # fmt: skip
    mass_g: float | None = entry("mass of the motor", "g", 0.5, 1e5)
    stator: str | None = entry("instead of the mass: diameter and height of the stator in mm, such as 2212")
    no_load_A: float | None = entry("no-load current", "A", 0.0, 100.0)
    idle_share: float | None = entry(
        "instead: share of the current lost to friction and iron at full throttle", "", 0.0, 0.6
    )
    inertia_kg_mm2: float | None = entry(
        "inertia of the rotating part; 0.3 times that of the rotor if omitted", "kg mm2", 0.0, 1e7
    )
    heat_capacity_J_K: float | None = entry("heat capacity of the winding; stays cold if omitted", "J/K", 0.01, 1e6)
    thermal_K_W: float | None = entry(
        "thermal resistance from winding to air; with heat_capacity_J_K", "K/W", 0.001, 1000.0
    )
    ambient_C: float = entry("ambient temperature", "C", -60.0, 60.0, default=25.0)
    max_temperature_C: float | None = entry("highest temperature of the winding", "C", 20.0, 400.0)
    inductance_uH: float | None = entry("inductance between two leads", "uH", 0.01, 1e5)
    pole_pairs: int | None = entry("pole pairs, for the reactance of the winding", low=1, high=200)

    def rules(self) -> Iterable[tuple[str, ...]]:
        """One statement of each loss; heat needs both numbers, reactance needs the inductance."""
        for stated, share in (("resistance_mohm", "winding_drop"), ("no_load_A", "idle_share")):
            if getattr(self, stated) is not None and getattr(self, share) is not None:
                yield share, f"{getattr(self, share):g}", f"nothing, because {stated} is given"
        if self.stator is not None and not re.fullmatch(r"[1-9]\d{3}", self.stator):
            yield "stator", repr(self.stator), "four digits, such as 2212"
        if (self.heat_capacity_J_K is None) != (self.thermal_K_W is None):
            yield "thermal_K_W", "one of heat_capacity_J_K, thermal_K_W", "both or none"
        if self.pole_pairs is not None and self.inductance_uH is None:
            yield "inductance_uH", "nothing", "a value, as pole_pairs is given"


class VehicleTable(Table):
    """[drive.vehicle]: mass and rotor count, for hover and flight time."""

    mass_kg: float | None = entry("total mass; hover is at half of full thrust if omitted", MASS)
    rotors: int = entry("number of rotors on the battery", low=1, high=64, default=1)


class DriveTable(Table):
    """[drive]: motor and battery of the rotor; speed range and maximum thrust follow from it."""

    kv: float = entry("speed constant of the motor", KV, required=True)
    cells: int = entry("battery cells in series", low=1, high=60, required=True)
    soc: float = entry("state of charge at which thrust, current and hover are stated", "", 0.01, 1.0, default=0.5)
    soc_min: float = entry("state of charge at which a flight ends; it begins at 1", "", 0.0, 0.99, default=0.2)
    rotor_inertia_kg_mm2: float | None = entry(
        "inertia of the rotor; that of slender plastic blades if omitted", "kg mm2", 0.0, 1e7
    )
    battery: BatteryTable = BatteryTable()
    esc: EscTable = EscTable()
    motor: MotorTable = MotorTable()
    vehicle: VehicleTable = VehicleTable()

    def rules(self) -> Iterable[tuple[str, ...]]:
        """What joins battery, controller and motor."""
        if self.soc_min >= self.soc:
            yield "soc_min", f"{self.soc_min:g}", "less than soc"
        if self.esc.pwm_kHz is not None and self.motor.inductance_uH is None:
            yield "motor.inductance_uH", "nothing", "a value, as esc.pwm_kHz is given"
        if self.rotor_inertia_kg_mm2 == 0.0 and not self.motor.inertia_kg_mm2:
            yield "rotor_inertia_kg_mm2", "0 with a motor of 0", "more than 0 together"
