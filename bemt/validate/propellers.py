"""BEMT against a folder of measured propellers, statistics per propeller and over all.

The folder is in the layout of the UIUC database (geometry, static and advance-ratio files).  Nothing is fitted:
sections and transition come from the declared rule of :mod:`bemt.sections.rule`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.folders import find_data
from bemt.base.tables import json_text, write_atomic
from bemt.rotors.population import population
from bemt.validate.built import expect, observe
from bemt.validate.folder import read_folders
from bemt.validate.match import matched
from bemt.validate.points import J_SHARE, compare, statistics
from bemt.validate.pool import Pool
from bemt.validate.text import text

if TYPE_CHECKING:
    from bemt.effects import Effect

SCHEMA = "bemt.validation/1"


def validate(
    folder: Path | Sequence[Path],
    effects: Sequence[Effect] | None = None,
    fixed_re: float | None = None,
    progress: Callable[[str], None] | None = None,
    match_J0: bool = False,
    as_drawn: bool = False,
) -> dict[str, Any]:
    """Compare a folder."""
    from bemt import effects as registry
    from bemt.sections import rule as section_rule

    folders = [folder] if isinstance(folder, Path) else list(folder)
    found = read_folders(folders)
    eff = registry.standard() if effects is None else tuple(effects)
    built = not as_drawn and fixed_re is None and {e.id for e in eff} == {e.id for e in registry.standard()}
    rows: list[dict[str, Any]] = []
    pool, drawn, turned = Pool(), Pool(), Pool()
    shifts: list[float] = []
    unconverged = 0
    for i, (p, stations) in enumerate(found.propellers):
        if progress:
            progress(f"{i + 1}/{len(found.propellers)} {p.name}")
        if built:
            seen = observe(p, eff, stations)
            expected = expect(seen, population())
            points, statistic = seen.drawn, pool.add(expected.rows, expected) | {"as_drawn": drawn.add(seen.drawn)}
        else:
            points = compare(p, eff, fixed_re, stations)
            statistic = pool.add(points)
        unconverged += int(np.count_nonzero(~np.isfinite(points.CT_bemt)))
        row: dict[str, Any] = {
            "name": p.name, "family": p.family, "diameter_in": p.diameter_in, "pitch_in": p.pitch_in,
            "blades": p.blades, "stations": p.geometry.origin if p.geometry is not None else "apc_pe0",
            "J0": _number(points.J0), "J0_bemt": _number(points.J0_bemt), **statistic,
        }  # fmt: skip
        if match_J0:
            fit = matched(p, eff, fixed_re, stations, points.J0)
            row["matched_J0"] = None if fit is None else {"shift_deg": fit[0], **turned.add(fit[1])}
            shifts.extend([] if fit is None else [fit[0]])
        rows.append(row)
    j0 = np.array([r["J0_bemt"] / r["J0"] - 1.0 for r in rows if r["J0"] and r["J0_bemt"]])
    names = " ".join(f.name for f in folders)
    doc: dict[str, Any] = {"schema": SCHEMA, "folder": names, "J_share": J_SHARE, **pool.total()}
    if built:
        doc["as_drawn"] = drawn.total()
        doc["population"] = dict(population().provenance)
    doc["zero_thrust_J"] = {"propellers": int(j0.size), **statistics(j0)}
    if match_J0:
        spread = np.quantile(shifts, (0.1, 0.5, 0.9)).tolist() if shifts else None
        doc["matched_J0"] = {"propellers": len(shifts), "shift_deg_p10_p50_p90": spread, **turned.total()}
    doc["unconverged"] = unconverged
    doc["effects"] = [e.describe() for e in eff]
    doc["polar"] = {
        "rule": "bemt.sections.rule",
        "n_crit": section_rule.N_CRIT,
        "drag_level": section_rule.DRAG_LEVEL,
        "fixed_re": fixed_re,
        "calibrated_on": "UIUC volume 1",
    }
    doc["propellers"] = rows
    doc["skipped"] = [{"name": name, "reason": why} for name, why in found.skipped]
    doc["faults"] = list(found.faults)
    return doc


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def effects_without(off: Sequence[str]) -> tuple[Effect, ...]:
    """Standard effects but those named, singly or with commas; unknown names are refused."""
    from bemt import effects as registry

    names = [name for item in off for name in str(item).split(",") if name]
    unknown = [name for name in names if name not in registry.catalogue()]
    if unknown:
        known = ", ".join(registry.catalogue())
        raise InputError([Fault("--off", n, "an unknown effect", f"one of {known}", "") for n in unknown])
    return registry.without(registry.standard(), names)


def where(name: str) -> Path:
    """Folder as named, or that of the database of this name."""
    found = Path(name) if Path(name).exists() else find_data(name)
    if found is None and name.partition("/")[0] == "uiuc":
        hint = "Fetch them: bemt data uiuc, or set BEMT_DATA to the folder that holds uiuc"
        raise InputError(Fault(name, "", "no data", "the UIUC Propeller Database", hint))
    return found or Path(name)


def write(document: dict[str, Any], folder: str | Path) -> None:
    """Write validation.json and validation.txt."""
    write_atomic(Path(folder) / "validation.json", json_text(document))
    write_atomic(Path(folder) / "validation.txt", text(document) + "\n")
