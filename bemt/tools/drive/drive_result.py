"""What motor and battery make of a rotor: thrust over pulse width, hover, flight time, response, with bands.

One road for a label and for a case: the rotor by `bemt.rotors.case.propagate`, the motor by the case's table [drive].
Declared unknowns of rotor, motor and battery and the model's own error are carried through to every answer.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.action import Answered
from bemt.base.arrays import Array
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED, Fault, InputError, refuse
from bemt.base.tables import csv_text, json_text, number_text, write_atomic
from bemt.base.units import G0, KGF
from bemt.rotors.case import Case
from bemt.rotors.case.load import with_changes
from bemt.rotors.case.motor import named_motor
from bemt.rotors.case.propagate import propagate, vary
from bemt.rotors.case.schema import AIRSPEED
from bemt.rotors.case.tip_speed import fast_words
from bemt.tools.drive import drive_model, mission, outputs
from bemt.tools.drive.drive_model import EFFECTS, Drive, RotorMap, Steady

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = "bemt.drive.result/2"
COLUMNS = ("pulse_us", "rpm", "thrust_N", "battery_A", "voltage_V", "power_W", "efficiency")
CARRIED = ("rpm", "thrust_N", "battery_A", "power_W")
RESULTS = ("drive.json", "drive.csv", "drive.png")
LOW, HIGH = 0.2, 0.8
"""Shares of full thrust of the step."""
HOVER_SHARE = 0.5
"""Hover point as a share of full thrust where no mass is given: a thrust-to-weight ratio of 2."""
SHEET = ("drive.motor.size", "drive.motor.winding_drop", "drive.motor.idle_share")
"""What a motor sheet tells."""
OPTIONS = {
    "kv": "drive.kv", "cells": "drive.cells", "mass_kg": "drive.vehicle.mass_kg", "rotors": "drive.vehicle.rotors",
    "capacity_Ah": "drive.battery.capacity_Ah", "motor_mass_g": "drive.motor.mass_g",
    "resistance_mohm": "drive.motor.resistance_mohm", "no_load_A": "drive.motor.no_load_A",
}  # fmt: skip
"""Arguments that set values of the table [drive]."""


@dataclasses.dataclass(frozen=True)
class DriveBand:
    """Value with its standard uncertainty, and that which would be left with a motor sheet."""

    value: float
    u: float
    u_with_sheet: float


@dataclasses.dataclass(frozen=True, eq=False)
class DriveResult(Answered):
    """A rotor with its motor and battery; NaN where the drive does not get there.

    Parameters
    ----------
    case : Case
        With its table [drive].
    airspeed_m_s : float
        Of flight. [m/s]
    full, hover : mapping of str to DriveBand
        ``rpm``, ``thrust_N``, ``battery_A``, ``power_W``, ``g_per_W`` and, in hover, ``throttle`` [-] and
        ``minutes`` (of the capacity, or per A h where none is given).
    steady : bemt.tools.drive.drive_model.Steady
        Thrust, current and power at pulse widths, (21,).
    u : mapping of str to (21,) float
        Standard uncertainty of rpm, thrust_N, battery_A and power_W of `steady`.
    drive : bemt.tools.drive.drive_model.Drive
        Battery, ESC, motor and rotor as solved.
    notes : tuple of str
        What does not fit, or lies outside of what was measured.

    Examples
    --------
    >>> import bemt
    >>> found = bemt.drive("10x5", kv=1000, cells=3, mass_kg=1.2, rotors=4)
    >>> found.reached, 0.3 < found.hover["throttle"].value < 0.8, found.to_dict()["schema"]
    (True, True, 'bemt.drive.result/2')
    >>> print(found.text.splitlines()[0])
    prop_10x5, 1000 rev/min/V, 3S at 50% charge, ± one standard deviation
    """

    case: Case
    airspeed_m_s: float
    full: Mapping[str, DriveBand]
    hover: Mapping[str, DriveBand]
    steady: Steady
    u: Mapping[str, Array]
    drive: Drive
    response: tuple[mission.Response, ...]
    course: Any  # the simulated step, None where there is none
    settled_C: float  # where the winding settles at full throttle [C]
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        """Say what is known in a line."""
        t = drive_model.drive_table(self.case)
        return f"<drive of {self.case.name}: {t.kv:g} rev/min/V, {t.cells}S, {shown(self.full['thrust_N'], 'N')}>"

    @property
    def exit_code(self) -> int:
        """1 if hover or airspeed is beyond the drive, or a point is unconverged."""
        return EXIT_OK if self.reached else EXIT_UNCONVERGED

    @property
    def text(self) -> str:
        """The result for a terminal."""
        return text(self)

    @property
    def reached(self) -> bool:
        """Whether the drive holds airspeed and hover, and every point converged."""
        settled = bool(np.all(self.steady.converged)) and self.course is not None and bool(self.course.converged)
        return settled and math.isfinite(self.hover["power_W"].value)

    @property
    def no_hover(self) -> str:
        """Why there are no numbers of hover; empty where there are."""
        if math.isfinite(self.hover["power_W"].value):
            return ""
        most = self.full["thrust_N"].value
        gives = f"{most:.1f} N" if math.isfinite(most) else "an unknown maximum"
        return f"each rotor needs {self.hover['thrust_N'].value:.1f} N and gives {gives}"

    def to_pandas(self) -> pd.DataFrame:
        """Rows over the throttle, as drive.csv has them: SI units by name, ``u_`` the standard uncertainty."""
        import pandas as pd

        return pd.DataFrame(_rows(self))

    def _document(self) -> dict[str, Any]:
        """``bemt.drive.result/2``; thrust over power in gf/W."""
        t = drive_model.drive_table(self.case)
        motor, battery = self.drive.motor, self.drive.battery
        given = {"kv": t.kv, "cells": t.cells, "soc": t.soc, "airspeed_m_s": self.airspeed_m_s,
                 "mass_kg": t.vehicle.mass_kg, "rotors": t.vehicle.rotors, "capacity_Ah": t.battery.capacity_Ah,
                 "resistance_mohm": 1e3 * motor.resistance_ohm, "no_load_A": motor.no_load_A,
                 "battery_mohm": 1e3 * battery.resistance_ohm}  # fmt: skip
        parts = {name: {k: vars(b) for k, b in getattr(self, name).items()} for name in ("full", "hover")}
        steady = {f.name: getattr(self.steady, f.name) for f in dataclasses.fields(Steady)}
        return {"schema": SCHEMA, "case": self.case.name, "given": given, "off": sorted(self.drive.off), **parts,
                "steady": steady | {f"u_{k}": v for k, v in self.u.items()},
                "full_thrust_settled_temperature_C": self.settled_C,
                "response": [dataclasses.asdict(s) for s in self.response],
                "unknowns": {item.key: f"{item.range_text} ({item.why})" for item in self.case.assumptions},
                "no_hover": self.no_hover or None, "notes": list(self.notes)}  # fmt: skip


def with_drive(case: Case, motor: str | None = None, **given: float | None) -> Case:
    """The case with the numbers of `OPTIONS` that are given in its table [drive], typical losses where it is silent.

    ``motor`` is a name as `bemt.rotors.case.motor.named_motor` takes it.
    """
    changes: dict[str, float | str] = {OPTIONS[name]: v for name, v in given.items() if v is not None}
    changes = changes if motor is None else {**named_motor(motor).keys, **changes}
    if case.file.drive is None and not {"drive.kv", "drive.cells"} <= set(changes):
        missing = [f"--{name}" for name in ("kv", "cells") if OPTIONS[name] not in changes]
        hint = "As in --kv 900 --cells 3; or a table [drive] in the case"
        raise InputError([Fault("", name, "nothing", "--kv and --cells together", hint) for name in missing])
    names = {key: f"--{name.replace('_', '-')}" for name, key in OPTIONS.items()}
    try:
        return with_changes(case, changes) if changes else case
    except InputError as error:
        raise InputError(
            [dataclasses.replace(f, file="", where=names[f.where]) if f.where in names else f for f in error.faults]
        ) from None


def solve(case: Case, airspeed_m_s: float = 0.0, off: Sequence[str] = ()) -> DriveResult:
    """Solve a case with a table [drive]; impossible options come at once."""
    wrong = [Fault("", "--off", repr(n), f"one of {', '.join(EFFECTS)}") for n in off if n not in EFFECTS]
    if not AIRSPEED.low <= airspeed_m_s <= AIRSPEED.high:
        hint = "" if not AIRSPEED.high < airspeed_m_s < 3.6 * AIRSPEED.high else "km/h? Divide by 3.6"
        expected = f"a number from {AIRSPEED.low:g} to {AIRSPEED.high:g} m/s"
        wrong.append(Fault("", "--airspeed-m-s", f"{airspeed_m_s:g}", expected, hint))
    refuse(wrong)
    drive, bands, u = _carried(case, airspeed_m_s, off, _answers)
    table = drive_model.drive_table(case)
    steady = drive.steady(_pulses(drive), table.soc)
    steps, course = mission.response(drive, LOW, HIGH, table.soc)
    notes = [*case.unused, *_unusual(case), *_validity(case, bands["full.rpm"].value, airspeed_m_s), *drive.rotor.notes]
    if course is None:
        full = float(steady.thrust_N[-1])
        got = f"full pulse width gives {full:.2f} N" if math.isfinite(full) else "the air turns it beyond its table"
        notes.append(f"at {airspeed_m_s:g} m/s {got}: the drive does not hold this airspeed, no step")
    full_b, hover = (
        {key.partition(".")[2]: b for key, b in bands.items() if key.startswith(head)} for head in ("full.", "hover.")
    )
    settled = mission.settled_temperature(drive, drive.esc.pulse_max_us, table.soc)
    mass, lift_kg = table.vehicle.mass_kg, table.vehicle.rotors * float(full_b["thrust_N"].value) / G0
    if mass is not None and mass > math.sqrt(1e3) * lift_kg > 0.0:  # nearer to the lift in grams than in kg
        notes.insert(0, f"{mass:g} kg is {mass / lift_kg:.0f} times what the rotors lift: looks like grams, write "
                        f"{mass / 1e3:g} kg")  # fmt: skip
    return DriveResult(case, airspeed_m_s, full_b, hover, steady, u, drive, tuple(steps), course, settled, tuple(notes))


def full_throttle(case: Case, airspeed_m_s: float = 0.0, bands: bool = True) -> dict[str, DriveBand]:
    """Speed, thrust, current and power at full throttle and the stated charge: the one source of maximum thrust."""
    found = _carried(case, airspeed_m_s, (), _full, bands)[1]
    return {key.partition(".")[2]: band for key, band in found.items()}


def full_document(case: Case) -> dict[str, Any]:
    """Full throttle of a case that has a motor, as plain values with its line of text."""
    full, t = full_throttle(case), drive_model.drive_table(case)
    return {"kv": t.kv, "cells": t.cells, "soc": t.soc, "text": _line(case, full),
            **{k: {"value": b.value, "u": b.u} for k, b in full.items()}}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Circuit:
    """Battery, ESC and motor for a program that runs them itself, SI; None: not stated."""

    kv_rpm_V: float
    volts: float
    ohm: float
    battery_ohm: float
    no_load_A: float
    exponent: float
    limit_A: float | None
    motor_inertia_kg_m2: float
    rotor_inertia_kg_m2: float | None


def circuit(case: Case) -> Circuit | None:
    """Circuit of a case; None without a motor."""
    if case.file.drive is None:
        return None
    drive, t = _carried(case, 0.0, (), lambda _c, _d: {}, bands=False)[0], drive_model.drive_table(case)
    idle, limit = drive.esc.idle_A, drive.esc.current_limit_A
    stated = t.rotor_inertia_kg_mm2
    return Circuit(
        drive.motor.kv_rpm_V, float(drive.battery.voc(t.soc)) - drive.battery_ohm * idle,
        float(drive.motor.resistance(drive.motor.ambient_C)) + drive.esc.resistance_ohm, drive.battery_ohm,
        drive.motor.no_load_A, drive.esc.exponent, limit - idle if math.isfinite(limit) else None,
        drive.motor.inertia_kg_m2, None if stated is None else 1e-6 * stated,
    )  # fmt: skip


def _line(case: Case, full: Mapping[str, DriveBand]) -> str:
    t = drive_model.drive_table(case)
    return (
        f"full throttle, {t.kv:g} rev/min/V on {t.cells}S at {t.soc:.0%} charge: "
        f"{shown(full['thrust_N'], 'N')} at {shown(full['rpm'], 'rev/min')}, {shown(full['battery_A'], 'A')}"
    )


Ask = Callable[[Case, Drive], dict[str, Array]]


def _carried(
    case: Case, airspeed_m_s: float, off: Sequence[str], ask: Ask, bands: bool = True,
) -> tuple[Drive, dict[str, DriveBand], dict[str, Array]]:  # fmt: skip
    """Answers with their bands: unknowns and errors of the rotor through the drive, then unknowns of the drive."""
    if airspeed_m_s:
        case.axial_only()
    fastest = 1.02 * drive_model.rpm_max(case)
    rpm, V = drive_model.points(case.diameter_m, fastest, airspeed_m_s)
    found = propagate(case, rpm, V, angle_deg=0.0, bands=bands)
    rho, inertia = float(case.air().rho), drive_model.inertia_kg_m2(case)

    def rotor(loads: Mapping[str, Array]) -> RotorMap:
        return drive_model.from_loads(case, rpm, V, loads["thrust_N"], loads["torque_Nm"], rho, inertia)

    own, at_rest = rotor(found.nominal), None
    if airspeed_m_s:
        still = drive_model.points(case.diameter_m, fastest, 0.0)
        loads = propagate(case, *still, angle_deg=0.0, bands=False).nominal
        at_rest = drive_model.from_loads(case, *still, loads["thrust_N"], loads["torque_Nm"], rho, inertia)
    drive = drive_model.drive_of(case, own, at_rest).without(*off)
    if bands:
        values, by_origin = found.carry(lambda loads: ask(case, dataclasses.replace(drive, rotor=rotor(loads))))
    else:
        values, by_origin = ask(case, drive), {}
    unknown = [item for item in case.assumptions if item.key.startswith("drive.")] if bands else []
    moved = vary(case, values, lambda c, _: ask(c, drive_model.drive_of(c, own, at_rest).without(*off)), unknown)
    nan = {key: np.full(np.shape(v), math.nan) for key, v in values.items()}
    rest = {key: sum((part[key] ** 2 for part in by_origin.values()), np.zeros(np.shape(v))) if bands else nan[key]
            for key, v in values.items()}  # fmt: skip
    sheet = {key: rest[key] + sum(m.u[key] ** 2 for m in moved if m.unknown.key not in SHEET) for key in values}
    both = {key: rest[key] + sum(m.u[key] ** 2 for m in moved) for key in values}
    made = {key: DriveBand(float(v[0]), math.sqrt(both[key][0]), math.sqrt(sheet[key][0]))
            for key, v in values.items() if not key.startswith("steady.")}  # fmt: skip
    u = {key.partition(".")[2]: np.sqrt(both[key]) for key in values if key.startswith("steady.")}
    return drive, made, u


def _pulses(drive: Drive) -> Array:
    return np.linspace(drive.esc.pulse_min_us, drive.esc.pulse_max_us, 21)


def _full(case: Case, drive: Drive) -> dict[str, Array]:
    full = drive.steady(drive.esc.pulse_max_us, drive_model.drive_table(case).soc)
    out = {f"full.{key}": np.asarray(getattr(full, key)) for key in CARRIED}
    with np.errstate(divide="ignore", invalid="ignore"):
        out["full.g_per_W"] = 1e3 * out["full.thrust_N"] / KGF / out["full.power_W"]
    return out


def _answers(case: Case, drive: Drive) -> dict[str, Array]:
    """Full throttle, hover and the curve over pulse width."""
    table = drive_model.drive_table(case)
    out = _full(case, drive)
    curve = drive.steady(_pulses(drive), table.soc)
    out |= {f"steady.{key}": np.asarray(getattr(curve, key)) for key in CARRIED}
    mass, rotors, soc = table.vehicle.mass_kg, table.vehicle.rotors, table.soc
    one = HOVER_SHARE * float(out["full.thrust_N"][0]) / KGF if mass is None else mass / rotors
    h = mission.hover(drive, one, 1, soc)
    span = drive.esc.pulse_max_us - drive.esc.pulse_min_us
    hover = {"thrust_N": h.wanted_N, "rpm": h.rpm, "battery_A": h.battery_A, "power_W": h.power_W,
             "g_per_W": h.g_per_W, "throttle": (h.pulse_us - drive.esc.pulse_min_us) / span}  # fmt: skip
    if table.battery.capacity_Ah is None:
        hover["minutes"] = 60.0 * (1.0 - table.soc_min) / (h.battery_A * rotors)
    else:
        hover["minutes"] = mission.endurance(drive, one, 1, 1.0, table.soc_min)[0] / 60.0
    return out | {f"hover.{key}": np.array([value]) for key, value in hover.items()}


def _validity(case: Case, rpm: float, airspeed_m_s: float) -> tuple[str, ...]:
    """Flags of the rotor at full throttle."""
    if not math.isfinite(rpm):
        return ()
    return propagate(case, rpm, airspeed_m_s, angle_deg=0.0, bands=False).points.flags[0]


def _unusual(case: Case) -> list[str]:
    """Say when K_v, cells and diameter seldom go together."""
    table = drive_model.drive_table(case)
    loaded = float(drive_model.battery_of(table).voc(table.soc)) * (1.0 - (table.battery.sag or 0.06))
    words = fast_words(table.kv, loaded, f"{table.cells}S", case.diameter_m)
    return [words] if words and not case.ducted else []


def shown(band: DriveBand, unit: str, scale: float = 1.0) -> str:
    """Value ± u with digits that u deserves."""
    value, u = band.value * scale, band.u * scale
    if not math.isfinite(value):
        return "-"
    if not u > 0.0:
        return f"{number_text(value)} {unit}"
    digits = min(max(0, 1 - math.floor(math.log10(u))), 2)
    if u >= 100.0:
        value, u, digits = round(value, -1), round(u, -1), 0
    return f"{value:.{digits}f} ± {u:.{digits}f} {unit}"


def _aloft(found: DriveResult) -> str:
    """Flight time, or why there is none."""
    hover = found.hover
    if not (why := found.no_hover):
        t = drive_model.drive_table(found.case)
        time = shown(hover["minutes"], "min" if t.battery.capacity_Ah is not None else "min per A h of capacity")
        return f"{'flight time':<12}{'':<28}{time}, on {1.0 - t.soc_min:.0%} of the battery"
    return f"no hover: {why}"


def _assumed(found: DriveResult) -> list[str]:
    """What the sheet of the motor would bring, where it is not known."""
    if not {item.key for item in found.case.assumptions} & set(SHEET):
        return []
    motor, amps = found.drive.motor, found.full["battery_A"]
    a, b = (1e2 * u / amps.value for u in (amps.u, amps.u_with_sheet))
    return [
        f"assumed     winding {1e3 * motor.resistance_ohm:.0f} mohm, no-load current "
        f"{motor.no_load_A:.2g} A: typical of such motors. With both from the",
        f"            motor's sheet (--resistance-mohm, --no-load-A) the current is known to {b:.0f} % instead of "
        f"{a:.0f} %",
    ]


def text(found: DriveResult) -> str:
    """Lay a result out: one screen."""
    t, full, hover, drive = drive_model.drive_table(found.case), found.full, found.hover, found.drive
    lines = [f"{found.case.name}, {t.kv:g} rev/min/V, {t.cells}S at {t.soc:.0%} charge, ± one standard deviation"]
    lines += [*(f"! {note}" for note in found.notes), ""]
    mass, rotors = t.vehicle.mass_kg, t.vehicle.rotors
    where = "half of that thrust" if mass is None else f"hover of {mass:g} kg"
    one = " (one rotor)" if rotors > 1 else ""
    lines.append(f"{'':<12}{'full throttle' + one:<28}{where + one}")
    rows = (
        ("speed", "rpm", "rev/min", 1.0), ("thrust", "thrust_N", "N", 1.0), ("", "thrust_N", "gf", 1e3 / KGF),
        ("current", "battery_A", "A", 1.0), ("power", "power_W", "W", 1.0), ("", "g_per_W", "gf/W", 1.0),
    )  # fmt: skip
    lines += [f"{name:<12}{shown(full[key], unit, k):<28}{shown(hover[key], unit, k)}" for name, key, unit, k in rows]
    lines.append(f"{'throttle':<12}{'100 %':<28}{shown(hover['throttle'], '%', 100.0)}")
    lines.append(_aloft(found))
    at = range(4, 21, 4)
    curve = [shown(DriveBand(float(found.steady.thrust_N[i]), float(found.u["thrust_N"][i]), 0.0), "N") for i in at]
    lines += ["", "thrust at   " + ", ".join(f"{5 * i} %: {words}" for i, words in zip(at, curve, strict=True))]
    lines += [f"response    thrust {s.before_N:.2f} to {s.after_N:.2f} N: 63 % after {1e3 * s.time63_s:.0f} ms"
              for s in found.response[:1]]  # fmt: skip
    if np.any(found.steady.limited):
        lines.append(f"the ESC's limit of {drive.esc.current_limit_A:g} A acts at full throttle")
    if drive.motor.thermal_K_W > 0.0 and found.steady.converged[-1]:
        words = f"{found.settled_C:.0f} C" if math.isfinite(found.settled_C) else "no temperature (it runs away)"
        over = " above its limit" if not found.settled_C <= (t.motor.max_temperature_C or math.inf) else ""
        lines.append(f"at full throttle the winding settles at {words}{over}")
    lines += _assumed(found)
    ask = [name for name, v in (("--mass-kg", mass), ("--capacity-Ah", t.battery.capacity_Ah)) if v is None]
    if ask:
        lines.append(f"for more results give {' and '.join(ask)}, or mass_kg and capacity_Ah in [drive]")
    return "\n".join(lines) + "\n"


def _rows(found: DriveResult) -> list[dict[str, float]]:
    """Steady points over the throttle, with their standard uncertainties."""
    columns = {k: getattr(found.steady, k) for k in COLUMNS} | {f"u_{k}": v for k, v in found.u.items()}
    return [{k: float(v[i]) for k, v in columns.items()} for i in range(found.steady.rpm.size)]


def write(found: DriveResult, out: str | Path) -> None:
    """Write document, curve and picture to a folder, never over a file of the case."""
    folder, steady, rows = Path(out), found.steady, _rows(found)
    outputs.check("--out", folder, RESULTS, found.case.files())
    write_atomic(folder / RESULTS[0], json_text(found.to_dict()))
    write_atomic(folder / RESULTS[1], csv_text(list(rows[0]), rows))
    loads = (("thrust [N]", steady.thrust_N), ("battery current [A]", steady.battery_A))
    panels = [outputs.Panel("pulse width [µs]", y, [("", steady.pulse_us, v, "-")]) for y, v in loads]
    if found.course is not None:
        series = [("", found.course.time_s, found.course.thrust_N, "-")]
        panels.append(outputs.Panel("time [s]", "thrust [N]", series))
    write_atomic(folder / RESULTS[2], outputs.curves(panels, found.case.name))
