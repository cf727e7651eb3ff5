"""Files whose columns or conditions are in doubt: they are refused or asked about, nothing is guessed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.compare.selection import NUMBERED, ROTOR, SECOND_ROTOR, rotors_of
from bemt.dataset import Dataset
from bemt.readers._headings import may_be_shaft_speed, surely_shaft_speed
from bemt.recordings.channels import in_one_step, named
from bemt.recordings.windmilling import zero_thrust_speed

LOAD_CHANNELS = ("thrust_N", "torque_Nm", "power_W", "CT", "CP", "CQ")
_UNITS_OF = {"thrust": ("N", "gf"), "torque": ("N m", "N mm"), "power": ("W",)}


def one_rotor(imported: Dataset, name: str, how: str = "Choose it with --rows-a or --rows-b rotor={}") -> None:
    """Refuse the loads of several rotors, of which one has to be chosen, and columns that have no names."""
    with_headings(imported, name)
    several = rotors_of(imported)
    if len(several) > 1 and not set(LOAD_CHANNELS) & named(imported).values.keys():
        got = f"loads of several rotors: {', '.join(several)}"
        raise InputError(Fault(name, "", got, "one of them", how.format(several[0])))


def with_headings(imported: Dataset, name: str) -> None:
    """Refuse a table without headings: which column is which quantity is not known."""
    headings = imported.provenance.get("headings", {})
    if not imported.values or any(headings.get(k) or not NUMBERED.fullmatch(k) for k in imported.values):
        return
    path = Path(name)
    hint = (
        f"Write {path.with_name('recording.toml').as_posix()}, with your own columns and units, and give that file "
        f'instead:\n[recording]\nfile = "{path.name}"\nheader = false\n[columns]\n'
        'rpm = { column = 1, unit = "rpm" }\n'
        'thrust = { column = 2, unit = "N" }\n# units: rpm, rad_s; N, gf, kgf, lbf; Nm, mNm; s, us'
    )
    expected = "a heading with a unit for each column, or a recording.toml that names them"
    raise InputError(Fault(name, "", f"a table of {len(imported.values)} columns without headings", expected, hint))


def speed_in_doubt(imported: Dataset, path: str) -> None:
    """Refuse a file whose speed cannot be read: it must not be left out, nor replaced by that of a case."""
    told = named(imported).values
    if "rpm" in told:
        return
    headings, faults = imported.provenance.get("headings", {}), []
    for name, v in imported.values.items():
        heading, unit = headings.get(name) or name, imported.unit(name)
        apart = name.startswith("u_") or "err" in name.split("_") or not np.any(np.nan_to_num(v))
        if not apart and not unit and may_be_shaft_speed(heading):
            faults.append(_no_unit(path, heading, "a speed without a unit"))
        elif not apart and (unit == "rpm" or (unit == "rad_s" and may_be_shaft_speed(heading))):
            line = f'[columns] rpm = {{ column = "{heading}", unit = "{unit}" }}'
            hint = f"If it is the speed of this rotor, head it rpm, or write in recording.toml: {line}"
            hint += "; electrical_rpm with pole_pairs if it counts electrical revolutions"
            got, expected = f"a speed under a name of its own ({name})", "one column that is the speed of the rotor"
            faults.append(Fault(path, f"column {heading}", got, expected, hint))
    for name, cells in imported.texts.items():
        heading = headings.get(name) or name
        if may_be_shaft_speed(heading) and sum(cell.strip()[:1].isdigit() for cell in cells) > len(cells) / 2:
            faults.append(_no_unit(path, heading, f"a speed as text, such as {cells[0].strip()[:20]!r}"))
    if faults and not set(LOAD_CHANNELS) & told.keys():  # said with the speed, not after it
        for name, units in _UNITS_OF.items():
            if name in imported.values and not imported.unit(name):
                heading = headings.get(name) or name
                hint = "Head it " + " or ".join(f"{heading} ({unit})" for unit in units)
                got, expected = f"a {name} without a unit", "a unit in the heading, or in a recording.toml"
                faults.append(Fault(path, f"column {heading}", got, expected, hint))
    if faults and (step := in_one_step(imported)):
        faults[-1] = replace(faults[-1], hint=f"{faults[-1].hint}{step}")
    beside = Path(path).with_name("recording.toml")
    if faults and any("names this file" in note for note in imported.notes):
        faults = [replace(f, hint=f"{beside.as_posix()} names this file: give that instead") for f in faults]
    if faults:
        raise InputError(faults)


def wind_of(imported: Dataset) -> float | None:
    """Speed of no thrust of a recording in a wind that it does not state [rev/min]; None: no such wind.

    One of several rotors may be in the slipstream of another.
    """
    told = named(imported).values
    if (
        ROTOR in imported.provenance
        or {"airspeed_m_s", "J", SECOND_ROTOR} & told.keys()
        or not {"rpm", "thrust_N"} <= told.keys()
    ):
        return None
    return zero_thrust_speed(told["rpm"], told["thrust_N"])


def _no_unit(path: str, heading: str, got: str) -> Fault:
    base = heading.split("(")[0].split("[")[0].strip()
    hint = f"Head it {base} (rev/min) or {base} (rad/s). "
    hint += "" if surely_shaft_speed(heading) else "If it is the airspeed, head it airspeed_m_s. "
    hint += "`diagnose --rpm N` states one speed for all rows"
    expected = "numbers with a unit in the heading, or a recording.toml that names column and unit"
    return Fault(path, f"column {heading}", got, expected, hint)
