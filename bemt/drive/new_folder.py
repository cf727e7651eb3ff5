"""Folder of a new case: case.toml, the stations it names, and drive.toml where the motor's K_v is known."""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

from bemt.base.errors import Fault, InputError
from bemt.base.tables import write_atomic
from bemt.base.units import INCH
from bemt.case import Case, case_of, find_cases, fresh, from_solid, load_case
from bemt.drive import from_label


@dataclass(frozen=True)
class Wanted:
    """What the user of `bemt new` knows of a propeller or fan."""

    label: str | None = None
    stations: str | None = None
    scan: str | None = None
    unit: str | None = None
    diameter_mm: float | None = None
    fan: bool = False
    blades: int | None = None
    rpm: float | None = None
    airspeed_m_s: float = 0.0
    kv: float | None = None
    cells: int | None = None
    campaign: bool = False


_CAMPAIGN = """\
# OpenFOAM runs of this case: python -m bemt cfd {name}/cfd
schema = "bemt.cfd/1"
name = "{name}"
case = "../case.toml"

[defaults]
airspeed_m_s = {V:g}

[axes]                    # every combination; three grids show what a grid is worth
rpm = [{rpm:g}]
level = [5, 5.5, 6]       # cells on the blade R / 2^(level + 2): about 35,000, 65,000 and 115,000 for half a rotor
"""


def write(wanted: Wanted, out: str | None = None) -> tuple[Path, list[str]]:
    """Write a new case that can be solved; nothing is written unless all of it is sound. Gives folder and files."""
    faults = _faults(wanted)
    if faults:
        raise InputError(faults)
    with tempfile.TemporaryDirectory() as made:  # a case is checked with the files that it names
        files = _files(wanted)
        for name, content in files.items():
            (Path(made) / name).write_bytes(content)
        try:
            case = load_case(made)
        except InputError as error:
            place = Path(made).as_posix() + "/"
            raise InputError([replace(f, file=f.file.removeprefix(place)) for f in error.faults]) from None
        folder = Path(out) if out else Path(case.name)
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            got = f"a {'folder' if folder.is_dir() else 'file'} that already exists"
            raise InputError(Fault(folder.as_posix(), "", got, "a new folder", "Choose --out DIR"))
        if wanted.kv is not None and wanted.cells is not None:
            files["drive.toml"] = _drive_text(case, wanted.kv, wanted.cells).encode()
        if wanted.campaign:
            files["cfd/campaign.toml"] = _CAMPAIGN.format(name=case.name, rpm=case.rpm, V=case.airspeed_m_s).encode()
    for name in sorted(files, key=lambda name: name == "case.toml"):  # last: what it names is there
        write_atomic(folder / name, files[name])
    return folder, sorted(files)


def _faults(w: Wanted) -> list[Fault]:
    """What does not go together."""
    faults = []
    if w.stations is not None and (w.label is not None or w.scan is not None):
        faults.append(Fault("", "LABEL, --stations", "both", "one of them", "As in: new 10x5"))
    if w.label is None and w.stations is None and w.scan is None:
        faults.append(Fault("", "LABEL, --stations", "neither", "one of them, or --scan", "As in: new 10x5"))
    if w.fan and (w.stations is not None or w.scan is not None):
        faults.append(Fault("", "--fan", "together with a blade file", "--fan with the diameter as LABEL"))
    if w.scan is not None and w.blades is not None:
        faults.append(Fault("", "--blades", str(w.blades), "nothing with --scan, which shows them"))
    if w.unit is not None and w.scan is None:
        faults.append(Fault("", "--unit", w.unit, "nothing without --scan"))
    if w.stations is not None and w.diameter_mm is None:
        faults.append(Fault("", "--diameter-mm", "nothing", "the diameter, with --stations"))
    if w.diameter_mm is not None and (w.stations is None or not 5.0 <= w.diameter_mm <= 10000.0):
        expected = "5 to 10000 mm" if w.stations else "nothing without --stations"
        faults.append(Fault("", "--diameter-mm", f"{w.diameter_mm:g}", expected, "In m? Times 1000"))
    if (w.kv is None) != (w.cells is None):
        given = "--kv" if w.kv is not None else "--cells"
        faults.append(Fault("", given, "alone", "--kv and --cells together"))
    return faults


def _files(w: Wanted) -> dict[str, bytes]:
    """Content of the folder by name."""
    if w.scan is not None:
        found, scale, _ = from_solid.find_stations(Path(w.scan), w.unit)
        name = fresh.case_name(w.label or Path(w.scan).stem)
        source = re.sub(r'["\\\n]', "_", Path(w.scan).name)
        texts = from_solid.case_files(found, scale, name, source, "scan", w.rpm, w.airspeed_m_s)
        return {name: text.encode() for name, text in texts.items()}
    if w.stations is not None and w.diameter_mm is not None:
        file = Path(w.stations)
        hub, key = fresh.of_stations(file, w.diameter_mm * 1e-3)
        text = fresh.stations_text(file.name, w.diameter_mm * 1e-3, w.blades or 2, w.rpm, w.airspeed_m_s, hub, key)
        return {file.name: file.read_bytes(), "case.toml": text.encode()}
    return {"case.toml": _label_text(w, w.label or "").encode()}


def _label_text(w: Wanted, label: str) -> str:
    if not w.fan:
        return fresh.label_text(label, w.blades, w.rpm, w.airspeed_m_s)
    size = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(mm|in)?", label.strip())
    if size is None:
        if "x" in label.lower():
            D, pitch, told = fresh.label_parts(label, w.blades)
            return fresh.fan_text(D * INCH, pitch, told if told > 2 else w.blades, w.rpm)
        raise InputError(Fault("LABEL", "", repr(label), "a diameter, as in 70mm", "Or diameter x pitch in inches"))
    value = float(size[1])
    return fresh.fan_text(value * INCH if size[2] == "in" else value * 1e-3, None, w.blades, w.rpm)


def _drive_text(case: Case, kv: float, cells: int) -> str:
    """A drive.toml with the typical motor of this K_v under this rotor; every number assumed is named."""
    given = from_label.estimate(case, kv, cells).given
    typical = "not known; typical of measured motors with a propeller. Take it from the data sheet of the motor"
    assumed = {
        "motor.resistance_mohm": typical,
        "motor.no_load_A": typical,
        "motor.inertia_kg_mm2": "not known; only affects how fast thrust follows the throttle",
        "rotor.inertia_kg_mm2": "not known; blades of plastic, 0.06 kg per m2 of diameter squared",
        "battery.capacity_Ah": "not known; enter yours",
        "battery.resistance_mohm": "not known; 6 % of the voltage at full throttle",
    }
    # two slender blades: m R^2 / 3, their mass nearer to the hub than that: a third of it
    inertia = 0.06 * case.diameter_m**2 * (0.5 * case.diameter_m) ** 2 / 9.0 * 1e6 * case.file.rotor.blades
    rows = "".join(f'\n[[assumed]]\nkey = "{key}"\nwhy = "{text}"\n' for key, text in assumed.items())
    return f"""# Drive of {case.name}: K_v and cells as given, the rest assumed (see below). Replace what you know.
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

# [vehicle]  # for hover and flight time
# mass_kg = 1.5
# rotors = 4
{rows}"""


def estimate_of(
    what: str | None,
    kv: float | None,
    cells: int | None,
    mass_kg: float | None = None,
    rotors: int = 1,
    capacity_Ah: float | None = None,
    airspeed_m_s: float = 0.0,
) -> from_label.DriveEstimate:
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
