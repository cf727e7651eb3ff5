"""A CSV of real motors: name, kv, resistance and no-load current."""

from __future__ import annotations

import csv
import math
import os
from dataclasses import dataclass
from pathlib import Path

from bemt.base.errors import Fault, InputError, system_fault
from bemt.base.tables import number_of

COLUMNS = ("name", "kv", "resistance_mohm", "no_load_A")
LIMITS = {
    "kv": (20.0, 50_000.0, "In thousands? Write rev/min/V", ""),
    "resistance_mohm": (1.0, 50_000.0, "In ohm? Write milliohm", "In microohm? Divide by 1000"),
    "no_load_A": (0.0, 30.0, "", "In mA? Divide by 1000"),
}
"""Least and greatest values [rev/min/V], [mohm], [A], and what to ask below and above; hardly a winding of those that
Drive Calculator has recorded is below 1 mohm."""


@dataclass(frozen=True)
class KnownMotor:
    """A motor; NaN resistance or no-load current: not known."""

    name: str
    kv: float  # [rev/min/V]
    resistance_ohm: float = math.nan  # between two leads [ohm]
    no_load_A: float = math.nan  # [A]


def read_motors(path: str | os.PathLike[str]) -> tuple[KnownMotor, ...]:
    """Read a CSV with the columns ``name, kv, resistance_mohm, no_load_A``; an empty cell is unknown.

    Semicolons or tabs may stand between the cells, then also decimal commas; other columns are left alone.

    Raises
    ------
    InputError
        With every fault of the file.
    """
    file = Path(path)
    name = file.as_posix()
    hint = f"The first line is {','.join(COLUMNS)}"
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise InputError(system_fault(error)) from error
    except UnicodeDecodeError:
        raise InputError(Fault(name, "", "bytes that are no UTF-8", "a CSV in UTF-8")) from None
    rows = [(i, line) for i, line in enumerate(lines, 1) if line.strip()]
    if not rows:
        raise InputError(Fault(name, "", "an empty file", "a CSV of motors", hint))
    mark = max(",;\t", key=rows[0][1].count)
    try:
        head, *cells = csv.reader((line for _, line in rows), delimiter=mark)
    except csv.Error as error:
        raise InputError(Fault(name, "", str(error), "cells of some words")) from error
    place = {key.strip().casefold(): i for i, key in enumerate(head)}
    missing = [key for key in COLUMNS if key.casefold() not in place]
    if missing:
        raise InputError([Fault(name, f"column {key}", "none", "this column", hint) for key in missing])
    if not cells:
        raise InputError(Fault(name, "", "no motor", "a row or more below the first line"))
    faults: list[Fault] = []
    out = []
    for (line, _), row in zip(rows[1:], cells, strict=True):
        if len(row) > len(head):
            got, expected = number_of(len(row), "cell"), f"{len(head)}, as in the first line"
            faults.append(Fault(name, f"line {line}", got, expected, "A decimal comma? Write 0.8"))
            continue
        row += [""] * (len(head) - len(row))
        found = {key: row[place[key.casefold()]].strip() for key in COLUMNS}
        values = {}
        for key, (low, high, below, above) in LIMITS.items():
            text = found[key] if mark == "," else found[key].replace(",", ".")
            try:
                value = float(text) if text else math.nan
            except ValueError:
                value = math.inf
            unknown = not text and key != "kv"
            if not unknown and not low <= value <= high:
                ask = below if 0.0 < value < low else above if high < value < math.inf else ""
                expected = f"a number from {low:g} to {high:g}"
                faults.append(Fault(name, f"line {line}, {key}", found[key] or "nothing", expected, ask))
            values[key] = value
        motor = found["name"] or f"line {line}"
        out.append(KnownMotor(motor, values["kv"], 1e-3 * values["resistance_mohm"], values["no_load_A"]))
    if faults:
        raise InputError(faults)
    return tuple(out)
