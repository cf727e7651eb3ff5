"""``drive.toml``: battery, ESC, motor and vehicle that belong to the rotor of a case.

::

    schema = "bemt.drive/1"

    [battery]
    cells = 6
    capacity_Ah = 5.0
    resistance_mohm = 20.0          # of the pack with leads
    soc = 1.0                       # state of charge at the start
    soc_min = 0.2                   # where a flight ends
    # soc_table, ocv_cell_V: open-circuit voltage of a cell; a lithium polymer cell by default

    [esc]
    pulse_min_us = 1000
    pulse_max_us = 2000
    exponent = 1.0                  # duty = share of the pulse width to this power
    resistance_mohm = 5.0
    idle_A = 0.05
    current_limit_A = 95
    braking = "yes"                 # complementary switching; "no": diodes
    brake_on_stop = 1.0             # brake force at no throttle; 0: the rotor coasts (firmware setting of that name)
    # pwm_kHz: switching frequency; with motor.inductance_uH it says when a current through diodes stops

    [motor]
    name = "HET 700-68-1400"
    kv_rpm_V = 1400
    resistance_mohm = 12.0
    no_load_A = 3.0
    inertia_kg_mm2 = 20.0           # of the turning part
    heat_capacity_J_K = 60.0        # these two or none: without them the motor stays cold
    thermal_K_W = 1.5
    max_temperature_C = 120
    # inductance_uH (between lines) and pole_pairs: reactance of the winding

    [rotor]
    inertia_kg_mm2 = 8.0

    [vehicle]
    mass_kg = 6.5
    rotors = 2                      # that share the battery

    [[assumed]]
    key = "motor.resistance_mohm"
    why = "no data sheet at hand"
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bemt.base.errors import InputError
from bemt.base.toml import Collector, Key, check_table, load_toml
from bemt.drive.drive_model import LIPO_SOC, LIPO_V, Battery, Drive, Esc, Motor
from bemt.drive.rotor_table import RotorMap

__all__ = ["SCHEMA", "DriveFile", "read"]

SCHEMA = "bemt.drive/1"


def _slip_mohm(value: float) -> str:
    return "Is that in ohm? Write milliohm" if 0.0 < value < 0.05 else ""


TABLES: dict[str, dict[str, Key]] = {
    "": {"schema": Key("choice", choices=(SCHEMA,), required=True)},
    "battery": {
        "cells": Key("integer", low=1, high=60, required=True),
        "capacity_Ah": Key(unit="A h", low=0.01, high=1000.0, required=True),
        "resistance_mohm": Key(unit="mohm", low=0.0, high=5000.0, required=True, suspect=_slip_mohm),
        "soc": Key(low=0.01, high=1.0), "soc_min": Key(low=0.0, high=0.99),
        "soc_table": Key("numbers", low=0.0, high=1.0), "ocv_cell_V": Key("numbers", unit="V", low=0.5, high=5.0),
    },
    "esc": {
        "pulse_min_us": Key(unit="us", low=0.0, high=5000.0), "pulse_max_us": Key(unit="us", low=1.0, high=5000.0),
        "exponent": Key(low=0.2, high=5.0),
        "resistance_mohm": Key(unit="mohm", low=0.0, high=1000.0, suspect=_slip_mohm),
        "idle_A": Key(unit="A", low=0.0, high=5.0), "current_limit_A": Key(unit="A", low=0.1, high=1000.0),
        "braking": Key("choice", choices=("yes", "no")), "name": Key("text"),
        "brake_on_stop": Key(low=0.0, high=1.0),
        "pwm_kHz": Key(unit="kHz", low=0.1, high=1000.0),
    },
    "motor": {
        "name": Key("text"), "kv_rpm_V": Key(unit="rev/min/V", low=1.0, high=50000.0, required=True),
        "resistance_mohm": Key(unit="mohm", low=0.01, high=50000.0, required=True, suspect=_slip_mohm),
        "no_load_A": Key(unit="A", low=0.0, high=100.0, required=True),
        "inertia_kg_mm2": Key(unit="kg mm2", low=0.0, high=1e7, required=True),
        "heat_capacity_J_K": Key(unit="J/K", low=0.01, high=1e6),
        "thermal_K_W": Key(unit="K/W", low=0.001, high=1000.0),
        "ambient_C": Key(unit="C", low=-60.0, high=60.0), "max_temperature_C": Key(unit="C", low=20.0, high=400.0),
        "inductance_uH": Key(unit="uH", low=0.01, high=1e5), "pole_pairs": Key("integer", low=1, high=200),
    },
    "rotor": {"inertia_kg_mm2": Key(unit="kg mm2", low=0.0, high=1e7, required=True)},
    "vehicle": {
        "mass_kg": Key(unit="kg", low=0.001, high=1e5, required=True),
        "rotors": Key("integer", low=1, high=64, required=True),
    },
    "assumed": {"key": Key("text", required=True), "why": Key("text", required=True)},
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class DriveFile:
    """A drive.toml, read.

    Parameters
    ----------
    path : Path
        Of the file.
    battery : Battery
        Share of one rotor: its capacity over the rotors, its resistance times them.
    esc : Esc
        Controller.
    motor : Motor
        Machine.
    rotor_inertia_kg_m2 : float
        Of the rotor. [kg m2]
    soc, soc_min : float
        State of charge at start and end. [1]
    mass_kg : float
        Of the vehicle, NaN without one. [kg]
    rotors : int
        That share the battery.
    max_temperature_C : float
        Of the winding, NaN when not stated. [C]
    assumed : mapping of str to str
        Values that no source states, with the reason.
    """

    path: Path
    battery: Battery
    esc: Esc
    motor: Motor
    rotor_inertia_kg_m2: float
    soc: float
    soc_min: float
    mass_kg: float
    rotors: int
    max_temperature_C: float
    assumed: Mapping[str, str]

    def drive(self, rotor: RotorMap) -> Drive:
        """Put the drive of a rotor together."""
        return Drive(self.battery, self.esc, self.motor, rotor)

    @property
    def rpm_max(self) -> float:
        """Speed at no load and full battery, a bound for rotor tables. [rev/min]"""
        return float(self.battery.voc(1.0)) * self.motor.kv_rpm_V


def read(path: Path) -> DriveFile:
    """Read a drive.toml."""
    out = Collector(path.as_posix())
    doc = load_toml(path, out)
    if doc is None:
        raise InputError(out.faults)
    tops = [name for name in TABLES if name]
    check_table(out, "", {k: v for k, v in doc.items() if k not in tops}, TABLES, subtables=tops)
    for name in ("battery", "esc", "motor", "rotor", "vehicle"):
        if name in doc:
            check_table(out, name, doc[name], TABLES)
        elif name not in ("esc", "vehicle"):
            out.add(name, "nothing", f"a table [{name}]")
    assumed = doc.get("assumed", [])
    for i, item in enumerate(assumed if isinstance(assumed, list) else [assumed]):
        check_table(out, "assumed", item, TABLES, where=f"assumed[{i}]")
    if not out.faults:
        _consistent(doc, out)
    if out.faults:
        raise InputError(out.faults)
    b, e, m = doc["battery"], doc.get("esc", {}), doc["motor"]
    vehicle = doc.get("vehicle", {})
    n = int(vehicle.get("rotors", 1))
    battery = Battery(
        int(b["cells"]), n * b["resistance_mohm"] * 1e-3, b["capacity_Ah"] / n, tuple(b.get("soc_table", LIPO_SOC)),
        tuple(b.get("ocv_cell_V", LIPO_V)),
    )  # fmt: skip
    esc = Esc(
        e.get("pulse_min_us", 1000.0), e.get("pulse_max_us", 2000.0), e.get("exponent", 1.0),
        e.get("resistance_mohm", 0.0) * 1e-3, e.get("idle_A", 0.0), e.get("current_limit_A", math.inf),
        e.get("braking", "yes") == "yes",
        e.get("brake_on_stop", 1.0),
        2e-3 * m["inductance_uH"] * e["pwm_kHz"] if "inductance_uH" in m and "pwm_kHz" in e else math.inf,
    )  # fmt: skip
    motor = Motor(
        m["kv_rpm_V"], m["resistance_mohm"] * 1e-3, m["no_load_A"], m["inertia_kg_mm2"] * 1e-6,
        m.get("heat_capacity_J_K", math.inf), m.get("thermal_K_W", 0.0), m.get("ambient_C", 25.0),
        m["pole_pairs"] * m["inductance_uH"] * 1e-6 if "pole_pairs" in m else 0.0,
    )  # fmt: skip
    return DriveFile(
        path, battery, esc, motor, doc["rotor"]["inertia_kg_mm2"] * 1e-6, b.get("soc", 1.0), b.get("soc_min", 0.2),
        vehicle.get("mass_kg", math.nan), n, m.get("max_temperature_C", math.nan),
        {item["key"]: item["why"] for item in assumed},
    )  # fmt: skip


def _consistent(doc: Mapping[str, Any], out: Collector) -> None:
    b, e, m = doc["battery"], doc.get("esc", {}), doc["motor"]
    if e.get("pulse_max_us", 2000.0) <= e.get("pulse_min_us", 1000.0):
        out.add("esc.pulse_max_us", f"{e.get('pulse_max_us', 2000.0):g}", "more than pulse_min_us")
    if ("soc_table" in b) != ("ocv_cell_V" in b):
        out.add("battery.ocv_cell_V", "one of soc_table, ocv_cell_V", "both or none")
    elif "soc_table" in b:
        rising = all(x < y for x, y in zip(b["soc_table"][:-1], b["soc_table"][1:], strict=True))
        if len(b["soc_table"]) != len(b["ocv_cell_V"]) or len(b["soc_table"]) < 2 or not rising:
            out.add("battery.soc_table", "lists that do not fit", "rising values, as many as ocv_cell_V, 2 or more")
    if ("heat_capacity_J_K" in m) != ("thermal_K_W" in m):
        out.add("motor.thermal_K_W", "one of heat_capacity_J_K, thermal_K_W", "both or none")
    for key, has in (("esc.pwm_kHz", "pwm_kHz" in e), ("motor.pole_pairs", "pole_pairs" in m)):
        if has and "inductance_uH" not in m:
            out.add("motor.inductance_uH", "nothing", f"a value, as {key} is given")
    if b.get("soc_min", 0.2) >= b.get("soc", 1.0):
        out.add("battery.soc_min", f"{b.get('soc_min', 0.2):g}", "less than soc")
    if doc["rotor"]["inertia_kg_mm2"] + m["inertia_kg_mm2"] <= 0.0:
        out.add("rotor.inertia_kg_mm2", "0 with a motor of 0", "more than 0 together")
    for i, item in enumerate(doc.get("assumed", [])):
        table, _, key = item["key"].partition(".")
        if key not in TABLES.get(table, {}) or table in ("", "assumed"):
            out.add(f"assumed[{i}].key", repr(item["key"]), "a dotted key of this file, as motor.kv_rpm_V")
