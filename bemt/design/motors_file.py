"""A CSV of real motors: name, kv, resistance and no-load current."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

from bemt.base.errors import Fault, InputError, system_fault

COLUMNS = {"name": (), "kv": (20.0, 50_000.0), "resistance_mohm": (0.05, 50_000.0), "no_load_A": (0.0, 100.0)}
"""Columns with their limits: [rev/min/V], [mohm], [A]."""


@dataclass(frozen=True)
class KnownMotor:
    """A motor; NaN resistance or no-load current: not known."""

    name: str
    kv: float  # [rev/min/V]
    resistance_ohm: float = math.nan  # between two leads [ohm]
    no_load_A: float = math.nan  # [A]


def read_motors(path: str | Path) -> tuple[KnownMotor, ...]:
    """Read a CSV with the columns ``name, kv, resistance_mohm, no_load_A``; an empty cell is unknown.

    Raises
    ------
    InputError
        With every fault of the file.
    """
    file = Path(path)
    try:
        rows = list(csv.DictReader(file.read_text(encoding="utf-8-sig").splitlines()))
    except OSError as error:
        raise InputError(system_fault(error)) from error
    except UnicodeDecodeError:
        raise InputError(Fault(file.as_posix(), "", "bytes that are no UTF-8", "a CSV in UTF-8")) from None
    missing = [name for name in COLUMNS if not rows or name not in rows[0]]
    if missing:
        hint = f"The first line is {','.join(COLUMNS)}"
        raise InputError(
            [Fault(file.as_posix(), f"column {m}", "none", "a column and a row or more", hint) for m in missing]
        )
    faults, out = [], []
    for line, row in enumerate(rows, 2):
        values = {}
        for key, limits in COLUMNS.items():
            if not limits:
                continue
            text = (row[key] or "").strip()
            try:
                value = float(text) if text else math.nan
            except ValueError:
                value = math.inf
            known = math.isnan(value) and not text and key != "kv"
            if not known and not limits[0] <= value <= limits[1]:
                expected = f"a number from {limits[0]:g} to {limits[1]:g}"
                hint = "Is that in ohm? Write milliohm" if key == "resistance_mohm" and 0.0 < value < 0.05 else ""
                faults.append(Fault(file.as_posix(), f"line {line}, {key}", text or "nothing", expected, hint))
            values[key] = value
        name = (row["name"] or "").strip() or f"line {line}"
        out.append(KnownMotor(name, values["kv"], 1e-3 * values["resistance_mohm"], values["no_load_A"]))
    if faults:
        raise InputError(faults)
    return tuple(out)
