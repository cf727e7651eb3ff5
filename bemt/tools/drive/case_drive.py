"""The drive of a case: its battery, ESC and motor around its rotor, with whatever a label leaves open filled in.

A case that states no winding has that of its class (`bemt.rotors.case.motor`), whatever the rotor; one that states the
share of voltage or current that is lost at full throttle has the ohms and amperes of a motor that is as large as this
rotor needs. The motor does not change with an unknown of the rotor: it is the same motor, whatever the blade turns out
to be.
"""

from __future__ import annotations

import math

from bemt.rotors.case import Case
from bemt.rotors.case.drive_schema import DriveTable
from bemt.rotors.case.motor import class_resistance
from bemt.tools.drive.drive_model import Battery, Drive, Esc, Motor, RotorMap

ROTOR_DENSITY = 0.06
"""Mass of a plastic two-blade propeller over its diameter squared: declared. [kg/m2]"""


def battery_of(table: DriveTable, resistance_ohm: float = 0.0) -> Battery:
    """The share of the battery that one rotor has."""
    b, n = table.battery, table.vehicle.rotors
    capacity = math.nan if b.capacity_Ah is None else b.capacity_Ah / n
    return Battery(table.cells, resistance_ohm, capacity, b.soc_table, b.ocv_cell_V)


def rpm_max(case: Case) -> float:
    """Speed at no load and full battery, at any end of the declared range of K_v: no rotor turns faster. [rev/min]"""
    table = drive_table(case)
    kv = max([table.kv, *(float(v) for item in case.assumptions if item.key == "drive.kv" for v in item.values)])
    return kv * float(battery_of(table).voc(1.0))


def drive_table(case: Case) -> DriveTable:
    """The table [drive] of a case that has one."""
    assert case.file.drive is not None
    return case.file.drive


def inertia_kg_m2(case: Case) -> float:
    """Rotor inertia that the case states, else of slender blades, m R^2/3 with their mass nearer to the hub. [kg m2]"""
    stated = drive_table(case).rotor_inertia_kg_mm2
    if stated is not None:
        return 1e-6 * stated
    return ROTOR_DENSITY * case.diameter_m**2 * (0.5 * case.diameter_m) ** 2 / 9.0 * case.file.rotor.blades


def drive_of(case: Case, rotor: RotorMap) -> Drive:
    """Drive of a case; shares are taken at full throttle and the stated charge with the rotor that is given."""
    t = drive_table(case)
    m, e = t.motor, t.esc
    henry = None if m.inductance_uH is None else m.inductance_uH * 1e-6
    battery, winding, idle, bridge = _losses(t, rotor)
    esc = Esc(
        e.pulse_min_us, e.pulse_max_us, e.exponent, bridge, e.idle_A,
        math.inf if e.current_limit_A is None else e.current_limit_A, e.braking == "yes", e.brake_on_stop,
        math.inf if henry is None or e.pwm_kHz is None else 2e3 * henry * e.pwm_kHz,
    )  # fmt: skip
    turning = 0.3 * rotor.inertia_kg_m2 if m.inertia_kg_mm2 is None else m.inertia_kg_mm2 * 1e-6
    motor = Motor(
        t.kv, winding, idle, turning, math.inf if m.heat_capacity_J_K is None else m.heat_capacity_J_K,
        m.thermal_K_W or 0.0, m.ambient_C, 0.0 if henry is None or m.pole_pairs is None else m.pole_pairs * henry,
    )  # fmt: skip
    return Drive(battery_of(t, battery), esc, motor, rotor)


def _losses(t: DriveTable, rotor: RotorMap) -> tuple[float, float, float, float]:
    """Resistance of the battery share and of the winding [ohm], no-load current [A], resistance of the ESC [ohm].

    The current at full throttle, on which the shares depend, is the root of a falling function: damped iteration.
    """
    volts, k = float(battery_of(t).voc(t.soc)), 30.0 / (math.pi * t.kv)
    stated = None if t.battery.resistance_mohm is None else t.vehicle.rotors * t.battery.resistance_mohm * 1e-3
    ohm = None if t.motor.resistance_mohm is None else t.motor.resistance_mohm * 1e-3
    if ohm is None and t.motor.winding_drop is None:
        ohm = class_resistance(t)
    sag, drop, share = t.battery.sag or 0.0, t.motor.winding_drop or 0.0, t.motor.idle_share or 0.0
    more, lost = t.esc.resistance_mohm * 1e-3, t.esc.drop or 0.0
    amps = 1e-3
    for _ in range(200):
        loaded = volts * (1.0 - sag) if stated is None else volts - stated * (amps + t.esc.idle_A)
        emf = loaded * (1.0 - lost) - more * amps - (loaded * drop if ohm is None else ohm * amps)
        load = float(rotor.torque(max(emf, 0.0) / k)) / k
        new = load / (1.0 - share) if t.motor.no_load_A is None else load + t.motor.no_load_A
        step = new - amps
        amps = max(amps + 0.3 * step, 1e-3)
        if abs(step) < 1e-9 * amps:
            break
    battery = volts * sag / amps if stated is None else stated
    winding = loaded * drop / amps if ohm is None else ohm
    no_load = share * amps if t.motor.no_load_A is None else t.motor.no_load_A
    return battery, winding, no_load, more + loaded * lost / amps
