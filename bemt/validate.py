"""``python -m bemt validate DIR``: BEMT against a folder of measured propellers, statistics per propeller and over all.

The folder is in the layout of the UIUC database (geometry, static and advance-ratio files).  APC ``.PE0`` files in it
supply stations for measured propellers that have none of their own.  Nothing is fitted: sections and transition come
from the declared rule of :mod:`bemt.section_rule`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.data.folders import find_data
from bemt.errors import Fault, InputError
from bemt.units import INCH
from bemt.validate_text import text

if TYPE_CHECKING:
    from bemt.effects import Effect
    from bemt.importers.uiuc import UiucPropeller
    from geometry.rotor import Rotor

Array = NDArray[np.float64]

SCHEMA = "bemt.validation/1"
# Forward flight is compared up to this share of the measured zero-thrust advance ratio: beyond it a relative error
# of CT says more about J0 than about the model.
J_SHARE = 0.8
N_STATIONS = 40

# UIUC family of an APC blade series, by the suffix of the PE0 file's designation.
_APC_SERIES = {"E": "apce", "SF": "apcsf", "": "apcsp", "F": "apcff", "MR": "apcmr"}


@dataclass(frozen=True)
class Rows:
    """Measured and computed coefficients of one propeller, P points.

    Attributes
    ----------
    static : (P,) bool
        Static points.
    rpm, J : (P,) float
        Conditions [rev/min], [1].
    CT, CP, CT_bemt, CP_bemt : (P,) float
        Propeller convention [1]; NaN where not converged.
    J0, J0_bemt : float
        Advance ratio of zero thrust, measured and computed [1]; NaN where not reached.
    """

    static: NDArray[np.bool_]
    rpm: Array
    J: Array
    CT: Array
    CP: Array
    CT_bemt: Array
    CP_bemt: Array
    J0: float
    J0_bemt: float


def zero_thrust_J(lines: Iterable[tuple[Array, Array]]) -> float:
    """Advance ratio where thrust vanishes, median over rpm lines.

    Parameters
    ----------
    lines : iterable of ((N,) float, (N,) float)
        J and CT of each line [1].

    Returns
    -------
    float
        Interpolated at the change of sign, or extrapolated along the last third of the thrust when the line ends above
        zero but below 35 % of its largest CT; NaN if no line gets that far [1].

    >>> J = np.linspace(0.1, 0.7, 13)
    >>> round(zero_thrust_J([(J, 0.1 * (0.6 - J))]), 6)
    0.6
    """
    found = []
    for J, CT in lines:
        order = np.argsort(J)
        J, CT = np.asarray(J)[order], np.asarray(CT)[order]
        if J.size < 4 or not np.nanmax(CT) > 0:
            continue
        tail = CT < 0.35 * np.nanmax(CT)
        if np.count_nonzero(tail) < 2:
            continue
        slope, at_zero = np.polyfit(CT[tail], J[tail], 1)
        if slope < 0 and at_zero > 0:
            found.append(at_zero)
    return float(np.median(found)) if found else float("nan")


def build(propeller: UiucPropeller, stations: tuple[Array, Array, Array] | None = None) -> Rotor:
    """Rotor of a measured propeller with the rule's sections.

    Parameters
    ----------
    propeller : UiucPropeller
        Names, diameter, blade count, stations.
    stations : tuple of (N,) float, optional
        r/R [1], c/R [1] and beta [rad] to use instead of the propeller's own.

    Returns
    -------
    geometry.rotor.Rotor
        At the nominal diameter.
    """
    from bemt.section_rule import airfoil, sections
    from geometry.blade import from_stations
    from geometry.rotor import Rotor

    if stations is None:
        g = propeller.geometry
        if g is None:
            raise ValueError(f"{propeller.name}: got no stations; expected a geometry file")
        stations = (g.r_R, g.c_R, np.radians(g.beta_deg))
    x, c, beta = stations
    R = 0.5 * propeller.diameter_m
    keep = x <= 1.0
    anchors = tuple((s.r_R, airfoil(s)) for s in sections(propeller.family))
    blade = from_stations(x[keep] * R, np.maximum(c[keep], 1e-3) * R, beta[keep], R, float(x[0]) * R, anchors=anchors)
    return Rotor(blade, propeller.blades, propeller.rotation, propeller.name)


def compare(
    propeller: UiucPropeller,
    effects: Sequence[Effect],
    fixed_re: float | None = None,
    stations: tuple[Array, Array, Array] | None = None,
) -> Rows:
    """Solve every measured point of one propeller.

    Parameters
    ----------
    propeller : UiucPropeller
        With stations and at least one measured table.
    effects : sequence of Effect
        Physics that is on.
    fixed_re : float, optional
        One Reynolds number for all section tables [1].
    stations : tuple of (N,) float, optional
        r/R [1], c/R [1] and beta [rad] from elsewhere, see :func:`build`.

    Returns
    -------
    Rows
        Measured and computed values, point by point.
    """
    from bemt import polars, section_rule, solver
    from bemt.air import Air

    air = Air.from_density()
    rotor = build(propeller, stations)
    tables = []
    for x, shape in rotor.blade.anchors:
        table = section_rule.polar(shape)
        tables.append((x, polars.fixed_re(table, fixed_re) if fixed_re else table))
    prep = solver.prepare(rotor, tables, effects, n_stations=N_STATIONS, mach_max=0.7)
    static: list[NDArray[np.bool_]] = []
    rpm: list[Array] = []
    J: list[Array] = []
    CT: list[Array] = []
    CP: list[Array] = []
    for s in propeller.statics:
        static.append(np.ones(s.rpm.size, bool))
        rpm.append(s.rpm)
        J.append(np.zeros(s.rpm.size))
        CT.append(s.CT)
        CP.append(s.CP)
    for line in propeller.lines:
        static.append(np.zeros(line.J.size, bool))
        rpm.append(np.full(line.J.size, line.rpm))
        J.append(line.J)
        CT.append(line.CT)
        CP.append(line.CP)
    rpm_, J_ = np.concatenate(rpm), np.concatenate(J)
    sol = solver.solve(prep, rpm_, J_ * rpm_ / 60.0 * propeller.diameter_m, air)
    ends, i = [], sum(s.rpm.size for s in propeller.statics)
    for line in propeller.lines:
        ends.append((line.J, sol.CT[i : i + line.J.size]))
        i += line.J.size
    return Rows(
        np.concatenate(static), rpm_, J_, np.concatenate(CT), np.concatenate(CP), sol.CT, sol.CP,
        zero_thrust_J((line.J, line.CT) for line in propeller.lines),
        zero_thrust_J((a, b) for a, b in ends if np.all(np.isfinite(b))),
    )  # fmt: skip


def errors(rows: Rows) -> dict[str, dict[str, Array]]:
    """Relative errors that count.

    Parameters
    ----------
    rows : Rows
        One propeller.

    Returns
    -------
    dict
        ``static`` and ``forward``, each ``CT`` and ``CP``: (bemt - measured) / measured [1].  Forward points lie
        between 0 and 0.8 of the measured zero-thrust J; where that is unknown the largest measured J stands in.
    """
    limit = J_SHARE * (rows.J0 if np.isfinite(rows.J0) else float(np.max(rows.J, initial=0.0)))
    out: dict[str, dict[str, Array]] = {}
    for name, mask in (("static", rows.static), ("forward", ~rows.static & (rows.J <= limit) & (rows.J >= 0.0))):
        usable = mask & (rows.CT > 0.0) & (rows.CP > 0.0)
        out[name] = {
            "CT": rows.CT_bemt[usable] / rows.CT[usable] - 1.0,
            "CP": rows.CP_bemt[usable] / rows.CP[usable] - 1.0,
        }
    return out


def statistics(error: Array) -> dict[str, float | None]:
    """Median and 90th percentile of the absolute error and median error.

    Parameters
    ----------
    error : (N,) float
        Relative errors; NaN (not converged) counts as infinitely wrong [1].

    Returns
    -------
    dict
        ``median_abs``, ``p90_abs``, ``bias`` [1]; None without points.

    >>> statistics(np.array([-0.1, 0.0, 0.2]))["median_abs"]
    0.1
    """
    if error.size == 0:
        return {"median_abs": None, "p90_abs": None, "bias": None}
    size = np.where(np.isfinite(error), np.abs(error), np.inf)
    return {
        "median_abs": float(np.median(size)),
        "p90_abs": float(np.quantile(size, 0.9, method="higher")),
        "bias": float(np.nanmedian(error)) if np.any(np.isfinite(error)) else None,
    }


def _pe0_stations(folder: Path) -> tuple[dict[tuple[str, float, float], tuple[Array, Array, Array]], list[str]]:
    from bemt.importers import apc

    found: dict[tuple[str, float, float], tuple[Array, Array, Array]] = {}
    notes: list[str] = []
    for file in sorted(folder.rglob("*")):
        if file.suffix.upper() != ".PE0":
            continue
        try:
            blade = apc.read_pe0(file)
        except InputError as err:
            notes.extend(str(f) for f in err.faults)
            continue
        series = "".join(ch for ch in file.name.split("-")[0].upper().partition("X")[2] if ch.isalpha())
        family = _APC_SERIES.get(series)
        if family is None:
            notes.append(f"{file.name}: series {series!r} has no UIUC family; stations not used")
            continue
        R = blade.radius_m
        found[family, round(blade.diameter_m / INCH, 2), round(blade.pitch_m / INCH, 2)] = (
            blade.r_m / R, blade.chord_m / R, blade.beta_rad,
        )  # fmt: skip
    return found, notes


def validate(
    folder: Path, effects: Sequence[Effect] | None = None, fixed_re: float | None = None, progress: bool = False
) -> dict[str, Any]:
    """Compare a folder.

    Parameters
    ----------
    folder : Path
        UIUC layout, with APC PE0 files if any.
    effects : sequence of Effect, optional
        Physics that is on; default all.
    fixed_re : float, optional
        One Reynolds number for all section tables [1].
    progress : bool
        Show a counter on stderr.

    Returns
    -------
    dict
        Document of schema ``bemt.validation/1``; errors are fractions.

    Raises
    ------
    InputError
        If the folder is missing or holds no propeller that can be compared.
    """
    from bemt import effects as registry
    from bemt import section_rule
    from bemt.importers import uiuc

    if not folder.is_dir():
        raise InputError([Fault(str(folder), "folder", "nothing there", "a folder in UIUC layout", "Check the path.")])
    eff = registry.standard() if effects is None else tuple(effects)
    scan = uiuc.scan_folder(folder)
    pe0, notes = _pe0_stations(folder)
    skipped = [{"name": p.name, "reason": why} for p in scan.propellers if (why := _unusable(p, pe0))]
    usable = [p for p in scan.propellers if not _unusable(p, pe0)]
    if not usable:
        raise InputError(
            [*scan.faults, Fault(str(folder), "propellers", f"{len(scan.propellers)} propellers, none with stations "
             "and measurements", "at least one of each", "Stations are in NAME_geom.txt or an APC PE0 file.")]
        )  # fmt: skip
    rows: list[dict[str, Any]] = []
    pooled: dict[str, dict[str, list[Array]]] = {k: {"CT": [], "CP": []} for k in ("static", "forward")}
    counted = {"static": 0, "forward": 0}
    unconverged = 0
    for i, p in enumerate(usable):
        if progress:
            print(f"\r{i + 1}/{len(usable)} {p.name:<28}", end="", file=sys.stderr, flush=True)
        own = p.geometry is not None
        stations = None if own else pe0[p.family, round(p.diameter_in, 2), round(p.pitch_in or 0.0, 2)]
        points = compare(p, eff, fixed_re, stations)
        unconverged += int(np.count_nonzero(~np.isfinite(points.CT_bemt)))
        e = errors(points)
        row: dict[str, Any] = {
            "name": p.name, "family": p.family, "diameter_in": p.diameter_in, "pitch_in": p.pitch_in,
            "blades": p.blades, "stations": p.geometry.origin if p.geometry is not None else "apc_pe0",
            "J0": _number(points.J0), "J0_bemt": _number(points.J0_bemt),
        }  # fmt: skip
        for kind in ("static", "forward"):
            counted[kind] += int(e[kind]["CT"].size > 0)
            row[kind] = {"points": int(e[kind]["CT"].size)}
            for q in ("CT", "CP"):
                pooled[kind][q].append(e[kind][q])
                row[kind][q] = statistics(e[kind][q])
        rows.append(row)
    if progress:
        print("\r" + " " * 48 + "\r", end="", file=sys.stderr, flush=True)
    j0 = np.array([r["J0_bemt"] / r["J0"] - 1.0 for r in rows if r["J0"] and r["J0_bemt"]])
    doc: dict[str, Any] = {"schema": SCHEMA, "folder": folder.name, "J_share": J_SHARE}
    for kind in ("static", "forward"):
        all_ct = np.concatenate(pooled[kind]["CT"])
        doc[kind] = {"propellers": counted[kind], "points": int(all_ct.size)}
        for q in ("CT", "CP"):
            doc[kind][q] = statistics(np.concatenate(pooled[kind][q]))
    doc["zero_thrust_J"] = {"propellers": int(j0.size), **statistics(j0)}
    doc["unconverged"] = unconverged
    doc["effects"] = [e.describe() for e in eff]
    doc["polar"] = {
        "rule": "bemt.section_rule", "n_crit": section_rule.N_CRIT, "drag_level": section_rule.DRAG_LEVEL,
        "fixed_re": fixed_re, "calibrated_on": "UIUC volume 1",
    }  # fmt: skip
    doc["propellers"] = rows
    doc["skipped"] = skipped
    doc["faults"] = [str(f) for f in scan.faults] + notes
    return doc


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _unusable(p: UiucPropeller, pe0: dict[tuple[str, float, float], Any]) -> str:
    """Why a propeller cannot be compared, empty if it can."""
    if p.geometry is None and (p.family, round(p.diameter_in, 2), round(p.pitch_in or 0.0, 2)) not in pe0:
        return "no stations"
    if not p.statics and not p.lines:
        return "no measurements"
    return ""


def run(args: argparse.Namespace) -> int:
    """Command ``validate``.

    Parameters
    ----------
    args : argparse.Namespace
        dir, json, polar (Reynolds number or None), off (list of effect ids), out.

    Returns
    -------
    int
        0, or 1 when points did not converge.

    Raises
    ------
    InputError
        For a bad folder or an unknown effect.
    """
    from bemt import effects as registry
    from bemt.tables import json_text, write_atomic

    off = [name for item in (args.off or []) for name in str(item).split(",") if name]
    unknown = [name for name in off if name not in registry.catalogue()]
    if unknown:
        known = ", ".join(registry.catalogue())
        raise InputError([Fault("--off", n, "an unknown effect", f"one of {known}", "") for n in unknown])
    eff = registry.without(registry.standard(), off)
    fixed = args.polar
    folder = Path(args.dir) if Path(args.dir).exists() else find_data(args.dir) or Path(args.dir)
    doc = validate(folder, eff, fixed, progress=sys.stderr.isatty())
    rendered = json_text(doc)  # an infinite error (not converged) becomes null: JSON has no infinity
    if args.out:
        folder = Path(args.out)
        folder.mkdir(parents=True, exist_ok=True)
        write_atomic(folder / "validation.json", rendered)
        write_atomic(folder / "validation.txt", text(doc) + "\n")
    print(rendered.rstrip() if args.json else text(doc))
    return 1 if doc["unconverged"] else 0
