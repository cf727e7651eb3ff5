"""BEMT against a folder of measured propellers, statistics per propeller and over all.

The folder is in the layout of the UIUC database (geometry, static and advance-ratio files).  Nothing is fitted:
sections and transition come from the declared rule of :mod:`bemt.physics.sections.rule`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError
from bemt.base.given import find_data
from bemt.base.tables import json_text, write_atomic
from bemt.rotors.measured import records
from bemt.rotors.population import population
from bemt.rotors.validate.points import (
    J_SHARE,
    ErrorStatistics,
    ErrorTotals,
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
    propeller: UiucPropeller, effects: Sequence[Effect], stations: Stations, J0: float
) -> tuple[float, Rows] | None:
    """Solve one propeller with its blades turned to the measured zero-thrust advance ratio. [deg]"""
    x, c, beta = stations

    def at(shift_deg: float) -> Rows:
        return compare(propeller, effects, (x, c, beta + np.radians(shift_deg)))

    shift = shift_to(J0, lambda d: at(d).J0_bemt)
    return (shift, at(shift)) if np.isfinite(shift) else None


class ShiftedErrors(ErrorTotals):
    """Errors of one propeller with its blades turned."""

    shift_deg: float


class ValidatedRotor(ErrorTotals):
    """One propeller; zero-thrust advance ratios are NaN where there are none."""

    name: str
    family: str
    diameter_in: float
    pitch_in: float | None
    blades: int
    stations: str
    J0: float
    J0_bemt: float
    as_drawn: ErrorTotals | None = None
    matched_J0: ShiftedErrors | None = None


class ZeroThrustErrors(ErrorStatistics):
    """Errors of the zero-thrust advance ratio."""

    propellers: int = 0


class TurnedErrors(ErrorTotals):
    """Errors of all propellers whose blades were turned to the measured zero-thrust advance ratio."""

    propellers: int
    shift_deg_p10_p50_p90: tuple[float, ...] | None


class SectionRule(Documented):
    """How sections were made."""

    n_crit: float
    drag_level: float
    rule: str = "bemt.physics.sections.rule"
    calibrated_on: str = "UIUC volume 1"


class Skipped(Documented):
    """A propeller that cannot be compared."""

    name: str
    reason: str


class Validation(ErrorTotals):
    """``bemt.validation/1``."""

    folder: str
    J_share: float
    zero_thrust_J: ZeroThrustErrors
    unconverged: int
    effects: tuple[Mapping[str, Any], ...]
    polar: SectionRule
    propellers: tuple[ValidatedRotor, ...]
    skipped: tuple[Skipped, ...]
    faults: tuple[str, ...]
    as_drawn: ErrorTotals | None = None
    population: Mapping[str, Any] | None = None
    matched_J0: TurnedErrors | None = None

    def document(self) -> dict[str, Any]:
        """Plain values; a propeller whose blades could not be turned has None there."""
        own = {"schema": SCHEMA, **super().document()}
        for row in own["propellers"] if self.matched_J0 else ():
            row.setdefault("matched_J0", None)
        return own


def _percents(found: ErrorTotals) -> str:
    cells = []
    for s in found.each():
        if math.isnan(s.median_abs):
            cells.append(f" | {'-':>6} {'-':>6} {'-':>6}")
        else:
            bias = "-" if math.isnan(s.bias) else f"{100 * s.bias:+6.1f}"
            cells.append(f" | {100 * s.median_abs:6.1f} {100 * s.p90_abs:6.1f} {bias:>6}")
    return "".join(cells)


def _coverage_lines(doc: Validation) -> list[str]:
    """Coverage and width of the intervals."""
    out = ["Rotors as built: expectation and intervals of the population (bemt.rotors), stations and labels combined."]
    for word, s in zip(("static CT", "static CP", "forward CT", "forward CP"), doc.each(), strict=True):
        if s.coverage and s.width68 is not None and not math.isnan(s.coverage["68"]):
            out.append(
                f"  {word}: 68 % interval contains {100 * s.coverage['68']:.0f} %, 95 % one "
                f"{100 * s.coverage['95']:.0f} %; median half width {100 * s.width68:.1f} %"
            )
    return out


def _table(doc: Validation) -> list[str]:
    """Errors of each propeller and of all together."""
    head = f"{'':24} {'J0':>6} {'bemt':>6}"
    for kind in ("static", "forward"):
        for q in ("CT", "CP"):
            head += f" | {kind} {q:<2}{'':>{19 - len(kind) - 3}}"
    sub = f"{'propeller':24} {'':>6} {'':>6}" + " | median    p90   bias" * 4
    lines = [head, sub, "-" * len(sub)]
    for r in doc.propellers:
        j = [f"{J:6.3f}" if math.isfinite(J) else f"{'-':>6}" for J in (r.J0, r.J0_bemt)]
        lines.append(f"{r.name[:24]:24} {j[0]} {j[1]}{_percents(r)}")
    totals: list[tuple[str, ErrorTotals]] = [("all points", doc)]
    drawn, turned = doc.as_drawn, doc.matched_J0
    totals += [("stations as given", drawn)] if drawn else []
    totals += [(f"turned to measured J0, {turned.propellers}", turned)] if turned and turned.propellers else []
    lines += ["-" * len(sub), *(f"{name:38}{_percents(found)}" for name, found in totals)]
    return lines


def text(doc: Validation) -> str:
    """Table for people."""
    lines, drawn, turned, z, p = _table(doc), doc.as_drawn, doc.matched_J0, doc.zero_thrust_J, doc.polar
    lines += ["", *_coverage_lines(doc)] if drawn else []
    mine = [r.name for r in doc.propellers if r.name in records()]
    if drawn and mine:
        some = f"All {len(mine)}" if len(mine) == len(doc.propellers) else f"{len(mine)} of {len(doc.propellers)}"
        lines.append(f"  {some} are among the propellers that this population was fitted to: no independent check.")
    lines += [
        "",
        f"Errors of {'the rotor as built, as expected,' if drawn else 'BEMT'} in percent of the measured value. "
        f"Static: {doc.static.points} points of "
        f"{doc.static.propellers} propellers; forward: {doc.forward.points} points of "
        f"{doc.forward.propellers}, J up to {doc.J_share:g} J0.",
    ]
    if not math.isnan(z.median_abs):
        lines.append(f"Zero-thrust J: median error {100 * z.median_abs:.1f} %, bias {100 * z.bias:+.1f} %.")
    if turned and turned.shift_deg_p10_p50_p90:
        low, mid, high = turned.shift_deg_p10_p50_p90
        lines.append(
            f"Turned: blades of {turned.propellers} propellers by {mid:+.1f} deg (median; {low:+.1f} to "
            f"{high:+.1f} for 80 %) to the measured zero-thrust J; an experiment that uses the measurement."
        )
    lines.append(
        f"Sections: declared rule, calibrated on {p.calibrated_on}: n_crit {p.n_crit:g}, drag x{p.drag_level:g}."
    )
    lines.append("Effects on: " + ", ".join(e["id"] for e in doc.effects) + ".")
    if doc.unconverged:
        lines.append(f"NOT CONVERGED: {doc.unconverged} points (counted as infinite error).")
    if doc.skipped:
        lines.append(f"Skipped: {len(doc.skipped)} propellers without stations or without measurements.")
    return "\n".join([*lines, *(f"fault: {f}" for f in doc.faults)])


SCHEMA = "bemt.validation/1"


def validate(
    folder: Path | Sequence[Path], effects: Sequence[Effect] | None = None,
    progress: Callable[[str], None] | None = None, match_J0: bool = False,
) -> Validation:  # fmt: skip
    """Compare a folder."""
    from bemt.physics import effects as registry
    from bemt.physics.sections import rule as section_rule

    folders = [folder] if isinstance(folder, Path) else list(folder)
    found = read_folders(folders)
    eff = registry.standard() if effects is None else tuple(effects)
    built = {e.id for e in eff} == {e.id for e in registry.standard()}
    rows: list[ValidatedRotor] = []
    pool, drawn, turned = Pool(), Pool(), Pool()
    shifts: list[float] = []
    pairs: list[tuple[float, float]] = []  # J0 measured and of bemt
    unconverged = 0
    for i, (p, stations) in enumerate(found.propellers):
        if progress:
            progress(f"{i + 1}/{len(found.propellers)} {p.name}")
        as_given = None
        if built:
            seen = observe(p, eff, stations)
            expected = expect(seen, population())
            points, own, as_given = seen.drawn, pool.add(expected.rows, expected), drawn.add(seen.drawn)
        else:
            points = compare(p, eff, stations)
            own = pool.add(points)
        unconverged += int(np.count_nonzero(~np.isfinite(points.CT_bemt)))
        fit = matched(p, eff, stations, points.J0) if match_J0 else None
        shifted = None
        if fit is not None:
            at = turned.add(fit[1])
            shifted = ShiftedErrors(at.static, at.forward, fit[0])
            shifts.append(fit[0])
        pairs.append((points.J0, points.J0_bemt))
        rows.append(ValidatedRotor(
            own.static, own.forward, p.name, p.family, p.diameter_in, p.pitch_in, p.blades,
            p.geometry.origin if p.geometry is not None else "apc_pe0", points.J0, points.J0_bemt, as_given, shifted,
        ))  # fmt: skip
    J0 = np.reshape(pairs, (-1, 2))
    J0 = J0[np.isfinite(J0).all(axis=1) & (J0 != 0.0).all(axis=1)]
    zero = statistics(J0[:, 1] / J0[:, 0] - 1.0)
    spread = tuple(np.quantile(shifts, (0.1, 0.5, 0.9)).tolist()) if shifts else None
    whole, again = pool.total(), turned.total()
    return Validation(
        whole.static, whole.forward, " ".join(f.name for f in folders), J_SHARE,
        ZeroThrustErrors(zero.median_abs, zero.p90_abs, zero.bias, propellers=len(J0)), unconverged,
        tuple(e.describe() for e in eff), SectionRule(section_rule.N_CRIT, section_rule.DRAG_LEVEL),
        tuple(rows), tuple(Skipped(name, why) for name, why in found.skipped), tuple(found.faults),
        drawn.total() if built else None, dict(population().provenance) if built else None,
        TurnedErrors(again.static, again.forward, len(shifts), spread) if match_J0 else None,
    )  # fmt: skip


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


def write(found: Validation, folder: str | Path) -> None:
    """Write validation.json and validation.txt."""
    write_atomic(Path(folder) / "validation.json", json_text(found.document()))
    write_atomic(Path(folder) / "validation.txt", text(found) + "\n")
