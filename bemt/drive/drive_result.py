"""Thrust over pulse width, hover, endurance and response of a case with its drive: document, files, text."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.tables import csv_text, json_text, number_text, text_table, write_atomic
from bemt.case import load_case
from bemt.case.schema import AIRSPEED
from bemt.drive import drive_file, mission, outputs, picture, rotor_table
from bemt.drive.drive_model import EFFECTS, Drive, Steady

COLUMNS = {"pulse_us": "pulse [us]", "rpm": "rpm", "thrust_N": "T [N]", "battery_A": "I [A]", "voltage_V": "V [V]",
           "power_W": "P [W]", "efficiency": "eta"}  # fmt: skip
RESULTS = ("drive.json", "drive.csv", "drive.png")
LOW, HIGH = 0.2, 0.8
"""Shares of full thrust of the step."""


@dataclasses.dataclass(frozen=True)
class DriveResult:
    """Result of a drive; ``reached`` is False when hover or airspeed is beyond the drive, or a point is unconverged."""

    document: dict[str, Any]
    steady: Steady
    drive: Drive
    file: drive_file.DriveFile
    reached: bool


def solve(
    case_path: str | None,
    drive_path: str | None = None,
    off: Sequence[str] = (),
    airspeed: float = 0.0,
    out: str | None = None,
) -> DriveResult:
    """Solve a case with its drive, ``bemt.drive.result/1``; faults of options, case and drive.toml come at once."""
    if not case_path:
        raise InputError(Fault("", "CASE", "nothing", "a case file or its folder", "Or --validate DIR"))
    wrong = [Fault("", "--off", repr(n), f"one of {', '.join(EFFECTS)}") for n in off if n not in EFFECTS]
    if not AIRSPEED.low <= airspeed <= AIRSPEED.high:
        hint = "" if not AIRSPEED.high < airspeed < 3.6 * AIRSPEED.high else "km/h? Divide by 3.6"
        expected = f"a number from {AIRSPEED.low:g} to {AIRSPEED.high:g} m/s"
        wrong.append(Fault("", "--airspeed", f"{airspeed:g}", expected, hint))
    path = Path(case_path)
    if not path.exists():
        hint = "Check the path; a label needs its motor: drive 10x5 --kv 900 --cells 3"
        raise InputError([*wrong, Fault(case_path, "", "no such file or folder", "a case file or its folder", hint)])
    path = path / "case.toml" if path.is_dir() else path
    try:  # what is wrong with the files comes with what is wrong with the options
        case = load_case(path)
        beside = Path(drive_path) if drive_path else case.folder / "drive.toml"
        if not beside.is_file():
            hint = "Without one: --kv and --cells, as in drive 10x5 --kv 900 --cells 3"
            raise InputError(Fault(beside.as_posix(), "", "no such file", "a drive.toml", hint))
        file = drive_file.read(beside)
    except InputError as error:
        raise InputError([*wrong, *error.faults]) from None
    if wrong:
        raise InputError(wrong)
    if out:
        outputs.check("--out", Path(out), RESULTS, [*case.files(), file.path])
    rotor = rotor_table.from_case(case, 1.02 * file.rpm_max, airspeed, case.air(), file.rotor_inertia_kg_m2)
    drive = file.drive(rotor).without(*off)
    pulse = np.linspace(drive.esc.pulse_min_us, drive.esc.pulse_max_us, 21)
    steady = drive.steady(pulse, file.soc)
    steps, course = mission.response(drive, LOW, HIGH, file.soc)
    notes = list(rotor.notes)
    if course is None:
        full = float(steady.thrust_N[-1])
        got = f"full pulse width gives {full:.2f} N" if math.isfinite(full) else "the air turns it beyond its table"
        notes.append(f"at {airspeed:g} m/s {got}: the drive does not hold this airspeed, no step")
    hover = duration = None
    if math.isfinite(file.mass_kg):
        hover = mission.hover(drive, file.mass_kg, file.rotors, file.soc)
        duration = mission.endurance(drive, file.mass_kg, file.rotors, file.soc, file.soc_min)
    full_pulse = drive.esc.pulse_max_us
    document: dict[str, Any] = {
        "schema": "bemt.drive.result/1", "case": case.name, "drive": file.path.as_posix(), "off": sorted(drive.off),
        "airspeed_m_s": airspeed, "soc": file.soc,
        "steady": {f.name: getattr(steady, f.name) for f in dataclasses.fields(Steady)},
        "full_thrust_settled_temperature_C": mission.settled_temperature(drive, full_pulse, file.soc),
        "hover": dataclasses.asdict(hover) if hover else None,
        "endurance_s": duration[0] if duration else None, "soc_end": duration[1] if duration else None,
        "response": [dataclasses.asdict(s) for s in steps], "assumed": dict(file.assumed), "notes": notes,
    }  # fmt: skip
    if out:
        folder = Path(out)
        rows = [{k: float(getattr(steady, k)[i]) for k in COLUMNS} for i in range(len(pulse))]
        write_atomic(folder / RESULTS[0], json_text(document))
        write_atomic(folder / RESULTS[1], csv_text(list(COLUMNS), rows))
        panels = [
            {"x": "pulse width [µs]", "y": "thrust [N]", "series": [("", pulse, steady.thrust_N, "-")]},
            {"x": "pulse width [µs]", "y": "battery current [A]", "series": [("", pulse, steady.battery_A, "-")]},
        ]
        if course is not None:
            series = [("", course.time_s, course.thrust_N, "-")]
            panels.append({"x": "time [s]", "y": "thrust [N]", "series": series})
        write_atomic(folder / RESULTS[2], picture.curves(panels, case.name))
    reached = hover is None or math.isfinite(hover.pulse_us)
    settled = bool(np.all(steady.converged)) and course is not None and course.converged
    return DriveResult(document, steady, drive, file, reached and settled)


def text(result: DriveResult) -> str:
    """Lay a result out for a terminal."""
    doc, steady, drive, file = result.document, result.steady, result.drive, result.file
    rows = [[number_text(float(getattr(steady, k)[i])) for k in COLUMNS] for i in range(len(steady.rpm))]
    lines = [
        f"{doc['case']}: {file.path.as_posix()}, charge {file.soc:.0%}",
        text_table(list(COLUMNS.values()), rows, left=()),
    ]
    if np.any(steady.limited):
        lines.append(f"the ESC's limit of {drive.esc.current_limit_A:g} A acts in {int(steady.limited.sum())} rows")
    warm = doc["full_thrust_settled_temperature_C"]
    if drive.motor.thermal_K_W > 0.0 and steady.converged[-1]:
        words = f"{warm:.0f} C" if math.isfinite(warm) else "no temperature (it runs away)"
        over = " above its limit" if warm > file.max_temperature_C or not math.isfinite(warm) else ""
        lines.append(f"at full pulse width the winding settles at {words}{over}")
    if (h := doc["hover"]) is not None:
        if math.isfinite(h["pulse_us"]):
            lines.append(
                f"hover: {h['wanted_N']:.2f} N of each rotor at {h['pulse_us']:.0f} us, {h['rpm']:.0f} rpm, "
                f"{h['battery_A']:.2f} A, {h['power_W']:.1f} W, {h['g_per_W']:.2f} gf/W"
            )
            lines.append(f"endurance: {doc['endurance_s'] / 60.0:.1f} min, to a charge of {doc['soc_end']:.0%}")
        else:
            gives = f"{h['full_N']:.1f} N" if math.isfinite(h["full_N"]) else "an unknown maximum"
            lines.append(f"no hover: each rotor needs {h['wanted_N']:.1f} N and gives {gives}")
    for s in doc["response"]:
        lines.append(f"thrust {s['before_N']:.2f} to {s['after_N']:.2f} N: 63 % after {1e3 * s['time63_s']:.1f} ms")
    lines += [f"! assumed: {key}: {why}" for key, why in file.assumed.items()] + [f"! {note}" for note in doc["notes"]]
    return "\n".join(lines) + "\n"
