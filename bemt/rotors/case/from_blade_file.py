"""A design tool's blade (XROTOR, QPROP, DFDC) as a case."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_text, text_table, write_atomic
from bemt.data.readers import HEAD_BYTES, importers
from bemt.data.readers.blade import case_text
from bemt.rotors.case.from_solid import SCHEMA, refuse_other

if TYPE_CHECKING:
    from bemt.data.readers.blade import BladeFile


def read_blade(path: Path, unit: str | None = None) -> BladeFile | None:
    """Blade of a design tool's file, None when no reader of blades claims it."""
    if not path.is_file():
        return None
    with path.open("rb") as stream:
        head = stream.read(HEAD_BYTES)
    for module in importers().values():
        if getattr(module, "BLADE", False) and module.sniff(head):
            if unit is not None:
                raise InputError(Fault(path.as_posix(), "unit", f"--unit {unit}", "none: the format fixes its units"))
            found: BladeFile = module.read(path)
            return found
    return None


def write(blade: BladeFile, path: Path, out: Path) -> None:
    """Write ``case.toml``, ``stations.csv`` and a table per section."""
    stem = re.sub(r"[^A-Za-z0-9_.-]", "_", path.stem).lstrip("_.-") or "rotor"
    files = case_text(blade, stem, path.name)
    refuse_other(out / "case.toml", files["case.toml"])
    for name in sorted(files, key=lambda n: n == "case.toml"):  # the case last: what it names is there
        write_atomic(out / name, files[name])


def document(blade: BladeFile, path: Path) -> dict[str, Any]:
    """Plain values of what was found."""
    return {
        "schema": SCHEMA,
        "file": path.name,
        "program": blade.source,
        "blades": blade.blades,
        "diameter_m": 2 * blade.R_m,
        "hub_diameter_m": 2 * blade.Rhub_m,
        "warnings": list(blade.notes),
        "stations": {"r_m": blade.r_m, "chord_m": blade.chord_m, "beta_deg": np.degrees(blade.beta_rad)},
    }


def text(blade: BladeFile, path: Path, out: str | None) -> str:
    """Lay the stations out for a terminal."""
    beta = np.degrees(blade.beta_rad)
    rows = [
        [number_text(v) for v in row]
        for row in zip(blade.r_m / blade.R_m, blade.r_m * 1e3, blade.chord_m * 1e3, beta, strict=True)
    ]
    lines = [
        f"{path.name}: {blade.source}, {blade.blades} blades, diameter {number_text(2e3 * blade.R_m, 5)} mm, "
        f"{len(blade.sections)} sections"
    ]
    lines += [f"note: {note}" for note in blade.notes]
    lines.append(text_table(["r/R", "r mm", "chord mm", "beta deg"], rows, left=()).rstrip())
    if out is not None:
        lines.append(f"case in {Path(out) / 'case.toml'}")
    return "\n".join(lines) + "\n"
