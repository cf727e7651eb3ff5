"""A recording.toml from what a user types: units, columns and signs that the headings of a table do not say."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bemt.base import units
from bemt.base.errors import Fault, InputError
from bemt.base.tables import write_atomic
from bemt.base.toml import validated
from bemt.base.toml_text import Collector
from bemt.data.readers import load_text
from bemt.data.readers.headings import heading, meanings
from bemt.data.readers.recording_toml import QUANTITIES, RecordingToml
from bemt.data.readers.split import decimal_mark, some, split_table
from bemt.data.readers.unit_text import unit_for
from bemt.data.recordings.cfd_options import pairs

_OF_DIMENSION = {"force": "thrust", "torque": "torque", "angular_speed": "rpm", "voltage": "voltage",
                 "current": "current", "speed": "airspeed", "density": "density", "pressure": "pressure"}  # fmt: skip
"""Quantity that a unit alone stands for."""


def _unit(quantity: str, text: str) -> str | None:
    """Unit under the name that recording.toml has for it."""
    found = unit_for(QUANTITIES[quantity], text)
    return found[0].suffix if found and found[0].suffix in units.UNITS else None


def write_recording(
    file: str, out: str, unit: Iterable[str] = (), column: Iterable[str] = (), sign: Iterable[str] = ()
) -> Path:
    """Write a recording.toml beside a table of measurements, in the same folder; all faults of the options at once.

    `unit` ``NAME=UNIT``, of a quantity or a heading; `column` ``QUANTITY=HEADING``; `sign` ``QUANTITY=-1``. InputError
    on what is no column, unit or quantity, and where `out` exists.
    """
    import tomlkit

    path = Path(out) if out.endswith(".toml") else Path(out) / "recording.toml"
    faults: list[Fault] = []
    if path.resolve().parent != Path(file).resolve().parent:
        faults.append(Fault("", "--out", out, f"a file in the folder of {Path(file).name}", "Both stay together"))
    if path.exists():
        faults.append(Fault(path.as_posix(), "", "a file that exists", "a new name", "Add the lines to it by hand"))
    table = split_table(load_text(file))
    known = [h for h in table.headings if h]
    columns: dict[str, dict[str, str | int]] = {}
    for name, text in pairs("--column", column, faults).items():
        if name not in QUANTITIES:
            faults.append(Fault("", "--column", name, f"one of {', '.join(QUANTITIES)}", "As in --column thrust=Fz"))
        elif text not in known:
            faults.append(Fault("", "--column", text, f"one of {some(map(repr, known), 12)}"))
        else:
            columns.setdefault(name, {})["column"] = text
    taken = {str(c["column"]): q for q, c in columns.items()}
    for name, text in pairs("--unit", unit, faults).items():
        stated = unit_for("", text)
        fits = [q for q in meanings(name) if _unit(q, text)] if name in known else []
        by_unit = _OF_DIMENSION.get(stated[0].dimension) if stated else None
        quantity = name if name in QUANTITIES else taken.get(name) or (fits[0] if fits else by_unit)
        if name not in QUANTITIES and name not in known:
            faults.append(Fault("", "--unit", name, f"one of {some(map(repr, known), 12)}, or a quantity"))
        elif quantity is None or (told := _unit(quantity, text)) is None:
            wanted = [d for q in (meanings(name) or [name]) if (d := QUANTITIES.get(q))]
            choice = ", ".join(u for d in dict.fromkeys(wanted) for u in units.suffixes(d)) or "a unit that bemt knows"
            faults.append(Fault("", "--unit", f"{name}={text}", choice))
        else:
            columns.setdefault(quantity, {})["unit"] = told
            if name in known:
                columns[quantity]["column"] = name
    for name, text in pairs("--sign", sign, faults).items():
        if taken.get(name, name) not in QUANTITIES or text not in ("1", "-1"):
            faults.append(Fault("", "--sign", f"{name}={text}", "a quantity and -1, as in --sign thrust=-1"))
        else:
            columns.setdefault(taken.get(name, name), {})["sign"] = int(text)
    for quantity, entry in columns.items():
        named = [h for h in known if quantity in meanings(h)]
        if "column" not in entry and len(named) == 1:
            entry["column"] = named[0]
        elif "column" not in entry:
            expected = f"--column {quantity}=HEADING with one of {some(map(repr, named or known), 12)}"
            faults.append(Fault("", "--column", f"no column for {quantity}", expected))
        if "column" in entry and "unit" not in entry:
            found = heading(str(entry["column"])).unit
            if found is not None and found.suffix in units.UNITS and found.dimension == QUANTITIES[quantity]:
                entry["unit"] = found.suffix
            else:
                expected = " or ".join(units.suffixes(QUANTITIES[quantity]))
                faults.append(Fault("", "--unit", f"no unit for {quantity}", f"--unit {quantity}= {expected}"))
    if faults:
        raise InputError(faults)
    head = {"file": Path(file).name} | ({"decimal": ","} if decimal_mark(table) == "," else {})
    out_faults = Collector(os.fspath(path))
    validated(RecordingToml, {"recording": head, "columns": columns}, out_faults)
    out_faults.check()
    document: dict[str, dict[str, Any]] = {
        "recording": head,
        "columns": {name: tomlkit.inline_table() for name in columns},
    }
    for name, entry in columns.items():
        document["columns"][name].update(entry)
    write_atomic(path, "# Written by bemt import. Give this file in place of the table.\n" + tomlkit.dumps(document))
    return path
