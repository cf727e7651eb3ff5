"""Folder of a new case: case.toml, the stations it names, and drive.toml where the motor's K_v is known."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from bemt.base.errors import Fault, InputError
from bemt.base.tables import write_atomic
from bemt.base.units import INCH
from bemt.case import Case, case_of, find_cases, fresh, load_case
from bemt.drive import from_label

__all__ = ["write"]


def write(
    label: str | None, stations: str | None = None, diameter_mm: float | None = None, fan: bool = False,
    blades: int | None = None, rpm: float | None = None, airspeed_m_s: float = 0.0, kv: float | None = None,
    cells: int | None = None, out: str | None = None,
) -> tuple[Path, list[str]]:  # fmt: skip
    """Write a new case that can be solved; nothing is written unless all of it is sound. Gives folder and files."""
    text, source = _text(label, stations, diameter_mm, fan, blades, rpm, airspeed_m_s)
    if (kv is None) != (cells is None):
        given = "--kv" if kv is not None else "--cells"
        raise InputError(Fault("", given, "alone", "--kv and --cells together"))
    case = case_of(text, source.parent if source else ".")
    folder = Path(out) if out else Path(case.name)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(Fault(folder.as_posix(), "", "something there already", "a new folder", "Choose --out DIR"))
    drive = _drive_text(case, kv, cells) if kv is not None and cells is not None else None
    if source is not None:
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, folder / source.name)
    if drive is not None:
        write_atomic(folder / "drive.toml", drive)
    write_atomic(folder / "case.toml", text)  # last: what it names is there
    return folder, sorted(path.name for path in folder.iterdir())


def _text(
    label: str | None, stations: str | None, diameter_mm: float | None, fan: bool, blades: int | None,
    rpm: float | None, airspeed_m_s: float,
) -> tuple[str, Path | None]:  # fmt: skip
    """Text of the case, and the file of stations that goes beside it."""
    faults = []
    if (label is None) == (stations is None):
        got = "neither" if label is None else "both"
        faults.append(Fault("", "LABEL, --stations", got, "one of them", "As in: new 10x5"))
    if stations is not None and fan:
        faults.append(Fault("", "--fan", "beside --stations", "--fan with the diameter as LABEL"))
    if stations is not None and diameter_mm is None:
        faults.append(Fault("", "--diameter-mm", "nothing", "the diameter beside --stations"))
    if diameter_mm is not None and (stations is None or not 5.0 <= diameter_mm <= 10000.0):
        expected = "5 to 10000 mm" if stations else "nothing without --stations"
        faults.append(Fault("", "--diameter-mm", f"{diameter_mm:g}", expected, "In m? Times 1000"))
    if faults:
        raise InputError(faults)
    if stations is not None and diameter_mm is not None:
        file = Path(stations)
        hub, key = fresh.of_stations(file)
        return fresh.stations_text(file.name, diameter_mm * 1e-3, blades or 2, rpm, airspeed_m_s, hub, key), file
    assert label is not None
    if not fan:
        return fresh.label_text(label, blades, rpm, airspeed_m_s), None
    size = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(mm|in)?", label.strip())
    if size is None:
        if "x" in label.lower():
            D, pitch, told = fresh.label_parts(label, blades)
            return fresh.fan_text(D * INCH, pitch, told if told > 2 else blades, rpm), None
        raise InputError(Fault("LABEL", "", repr(label), "a diameter, as in 70mm", "Or diameter x pitch in inches"))
    value = float(size[1])
    return fresh.fan_text(value * INCH if size[2] == "in" else value * 1e-3, None, blades, rpm), None


def _drive_text(case: Case, kv: float, cells: int) -> str:
    """A drive.toml with the typical motor of this K_v under this rotor; every number assumed is named."""
    given = from_label.estimate(case, kv, cells).given
    typical = "not known: typical of measured motors under a propeller; take it from the motor's sheet"
    assumed = {
        "motor.resistance_mohm": typical, "motor.no_load_A": typical,
        "motor.inertia_kg_mm2": "not known; it only decides how fast thrust follows the throttle",
        "rotor.inertia_kg_mm2": "not known; blades of plastic, 0.06 kg per m2 of diameter squared",
        "battery.capacity_Ah": "yours?", "battery.resistance_mohm": "not known: 6 % of the voltage at full throttle",
    }  # fmt: skip
    # two slender blades: m R^2 / 3, their mass nearer to the hub than that: a third of it
    inertia = 0.06 * case.diameter_m**2 * (0.5 * case.diameter_m) ** 2 / 9.0 * 1e6 * case.file.rotor.blades
    rows = "".join(f'\n[[assumed]]\nkey = "{key}"\nwhy = "{text}"\n' for key, text in assumed.items())
    return f"""# Drive of {case.name}: K_v and cells as told, everything else assumed, see below. Replace what you know.
schema = "bemt.drive/1"

[battery]
cells = {cells}
capacity_Ah = 2.2
resistance_mohm = {given["battery_mohm"]:.3g}

[esc]
pulse_min_us = 1000
pulse_max_us = 2000

[motor]
kv_rpm_V = {kv:g}
resistance_mohm = {given["resistance_mohm"]:.3g}
no_load_A = {given["no_load_A"]:.3g}
inertia_kg_mm2 = {max(1.0, 0.3 * inertia):.3g}

[rotor]
inertia_kg_mm2 = {inertia:.3g}

# [vehicle]  # for hover and time aloft
# mass_kg = 1.5
# rotors = 4
{rows}"""


def estimate_of(
    what: str | None, kv: float | None, cells: int | None, mass_kg: float | None = None, rotors: int = 1,
    capacity_Ah: float | None = None, airspeed_m_s: float = 0.0,
) -> from_label.DriveEstimate:  # fmt: skip
    """Estimate of a label, or of a case, as the command line names it."""
    faults = []
    if what is None:
        faults.append(Fault("", "CASE", "nothing", "a label such as 10x5, or a case"))
    for name, value in (("--kv", kv), ("--cells", cells)):
        if value is None:
            faults.append(Fault("", name, "nothing", "--kv and --cells together", "As in: --kv 900 --cells 3"))
    if faults or what is None or kv is None or cells is None:
        raise InputError(faults)
    case = load_case(find_cases([what])[0]) if Path(what).exists() else case_of(fresh.label_text(what))
    return from_label.estimate(case, kv, cells, mass_kg, rotors, capacity_Ah, airspeed_m_s)
