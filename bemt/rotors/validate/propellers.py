"""BEMT against a folder of measured propellers, statistics per propeller and over all.

The folder is in the layout of the UIUC database (geometry, static and advance-ratio files).  Nothing is fitted:
sections and transition come from the declared rule of :mod:`bemt.physics.sections.rule`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.given import find_data
from bemt.base.tables import json_text, or_null, write_atomic
from bemt.rotors.population import population
from bemt.rotors.validate.points import (
    J_SHARE,
    Pool,
    Rows,
    Stations,
    compare,
    expect,
    observe,
    read_folders,
    statistics,
)

if TYPE_CHECKING:
    from bemt.data.readers.uiuc import UiucPropeller
    from bemt.physics.effects import Effect

# A blade angle that is further off than this is no error of setting or section any more.
REACH_DEG = 6.0
_STEP_DEG = 1.0
_CLOSE = 1e-4


def shift_to(J0: float, J0_of: Callable[[float], float]) -> float:
    """Blade angle shift that brings the zero-thrust advance ratio to the measured one."""
    from scipy.optimize import brentq

    last, at = J0_of(0.0) - J0, 0.0
    if not np.isfinite(last):
        return float("nan")
    step = -np.copysign(_STEP_DEG, last)
    while abs(last) > _CLOSE and abs(at) < REACH_DEG:
        now = J0_of(at + step) - J0
        if not np.isfinite(now):
            return float("nan")
        if now * last <= 0.0:
            return float(brentq(lambda d: J0_of(d) - J0, at, at + step, xtol=1e-3))
        last, at = now, at + step
    return float(at) if abs(last) <= _CLOSE else float("nan")


def matched(
    propeller: UiucPropeller, effects: Sequence[Effect], fixed_re: float | None, stations: Stations, J0: float
) -> tuple[float, Rows] | None:
    """Solve one propeller with its blades turned to the measured zero-thrust advance ratio. [deg]"""
    x, c, beta = stations

    def at(shift_deg: float) -> Rows:
        return compare(propeller, effects, fixed_re, (x, c, beta + np.radians(shift_deg)))

    shift = shift_to(J0, lambda d: at(d).J0_bemt)
    return (shift, at(shift)) if np.isfinite(shift) else None


def _percent(s: dict[str, float | None]) -> str:
    if s["median_abs"] is None or s["p90_abs"] is None:
        return f"{'-':>6} {'-':>6} {'-':>6}"
    bias = s["bias"]
    shown = "-" if bias is None else f"{100 * bias:+6.1f}"
    return f"{100 * s['median_abs']:6.1f} {100 * s['p90_abs']:6.1f} {shown:>6}"


def _totals(name: str, doc: dict[str, Any]) -> str:
    cells = "".join(f" | {_percent(doc[kind][q])}" for kind in ("static", "forward") for q in ("CT", "CP"))
    return f"{name:38}{cells}"


def _coverage_lines(doc: dict[str, Any]) -> list[str]:
    """Coverage and width of the intervals."""
    out = ["Rotors as built: expectation and intervals of the population (bemt.rotors), stations and labels combined."]
    for kind in ("static", "forward"):
        for q in ("CT", "CP"):
            s = doc[kind][q]
            held = s["coverage"]
            if held["68"] is not None:
                out.append(
                    f"  {kind} {q}: 68 % interval contains {100 * held['68']:.0f} %, 95 % one {100 * held['95']:.0f} %;"
                    f" median half width {100 * s['width68']:.1f} %"
                )
    return out


def text(doc: dict[str, Any]) -> str:
    """Table for people."""
    head = f"{'':24} {'J0':>6} {'bemt':>6}"
    for kind in ("static", "forward"):
        for q in ("CT", "CP"):
            head += f" | {kind} {q:<2}{'':>{19 - len(kind) - 3}}"
    sub = f"{'propeller':24} {'':>6} {'':>6}" + " | median    p90   bias" * 4
    lines = [head, sub, "-" * len(sub)]
    for r in doc["propellers"]:
        j = [f"{r[k]:6.3f}" if r[k] is not None else f"{'-':>6}" for k in ("J0", "J0_bemt")]
        lines.append(
            f"{r['name'][:24]:24} {j[0]} {j[1]}"
            + "".join(f" | {_percent(r[kind][q])}" for kind in ("static", "forward") for q in ("CT", "CP"))
        )
    lines.append("-" * len(sub))
    lines.append(_totals("all points", doc))
    drawn = doc.get("as_drawn")
    if drawn:
        lines.append(_totals("stations as given", drawn))
    turned = doc.get("matched_J0")
    if turned and turned["propellers"]:
        lines.append(_totals(f"turned to measured J0, {turned['propellers']}", turned))
    if drawn:
        lines += ["", *_coverage_lines(doc)]
    z = doc["zero_thrust_J"]
    lines += [
        "",
        f"Errors of BEMT in percent of the measured value. Static: {doc['static']['points']} points of "
        f"{doc['static']['propellers']} propellers; forward: {doc['forward']['points']} points of "
        f"{doc['forward']['propellers']}, J up to {doc['J_share']:g} J0.",
    ]
    if z["median_abs"] is not None:
        lines.append(f"Zero-thrust J: median error {100 * z['median_abs']:.1f} %, bias {100 * z['bias']:+.1f} %.")
    if turned and turned["propellers"]:
        low, mid, high = turned["shift_deg_p10_p50_p90"]
        lines.append(
            f"Turned: blades of {turned['propellers']} propellers by {mid:+.1f} deg (median; {low:+.1f} to "
            f"{high:+.1f} for 80 %) to the measured zero-thrust J; an experiment that uses the measurement."
        )
    p = doc["polar"]
    lines.append(
        f"Sections: declared rule, calibrated on {p['calibrated_on']}: n_crit {p['n_crit']:g}, "
        f"drag x{p['drag_level']:g}" + (f", Reynolds number fixed at {p['fixed_re']:g}." if p["fixed_re"] else ".")
    )
    lines.append("Effects on: " + ", ".join(e["id"] for e in doc["effects"]) + ".")
    if doc["unconverged"]:
        lines.append(f"NOT CONVERGED: {doc['unconverged']} points (counted as infinite error).")
    if doc["skipped"]:
        lines.append(f"Skipped: {len(doc['skipped'])} propellers without stations or without measurements.")
    lines += [f"fault: {f}" for f in doc["faults"]]
    return "\n".join(lines)


SCHEMA = "bemt.validation/1"


def validate(
    folder: Path | Sequence[Path], effects: Sequence[Effect] | None = None, fixed_re: float | None = None,
    progress: Callable[[str], None] | None = None, match_J0: bool = False, as_drawn: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Compare a folder."""
    from bemt.physics import effects as registry
    from bemt.physics.sections import rule as section_rule

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
            "J0": or_null(points.J0), "J0_bemt": or_null(points.J0_bemt), **statistic,
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
        "rule": "bemt.physics.sections.rule", "n_crit": section_rule.N_CRIT, "drag_level": section_rule.DRAG_LEVEL,
        "fixed_re": fixed_re, "calibrated_on": "UIUC volume 1",
    }  # fmt: skip
    doc["propellers"] = rows
    doc["skipped"] = [{"name": name, "reason": why} for name, why in found.skipped]
    doc["faults"] = list(found.faults)
    return doc


def effects_without(off: Sequence[str]) -> tuple[Effect, ...]:
    """Standard effects but those named, singly or with commas; unknown names are refused."""
    from bemt.physics import effects as registry

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
        hint = "Fetch them: bemt lab fetch uiuc, or set BEMT_DATA to the folder that holds uiuc"
        raise InputError(Fault(name, "", "no data", "the UIUC Propeller Database", hint))
    return found or Path(name)


def write(document: dict[str, Any], folder: str | Path) -> None:
    """Write validation.json and validation.txt."""
    write_atomic(Path(folder) / "validation.json", json_text(document))
    write_atomic(Path(folder) / "validation.txt", text(document) + "\n")
