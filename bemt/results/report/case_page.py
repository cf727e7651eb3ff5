"""The page of one case."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bemt.base.page import Cell, num, table
from bemt.base.tables import number_text
from bemt.physics import coefficients as co
from bemt.results.report.book import Beside, CasePage, Section, sections, uri
from bemt.results.report.diagnosis_block import (
    audit_parts,
    diagnosis_parts,
    first_pictures,
    headline,
    stand,
    study_parts,
)
from bemt.results.report.plot import COLOURS, Figure, Plot, RotorView, Trace, figure, points, viewer
from bemt.results.sweep.rows import Comparison, Fan, Result, Row

LOOK = {"cfd": "diamond", "bench": "cross", "vendor": "triangle", "openfoam": "star",
        "openfoam incompressible": "square", "flight": "square"}  # fmt: skip
NAMES = {"cfd": "CFD, recorded", "openfoam": "CFD, own, compressible",
         "openfoam incompressible": "CFD, own, incompressible"}  # fmt: skip
LABELS = {"CT": "CT", "CP": "CP", "eta": "efficiency η"}

MODELS = {"bemt": "BEMT", "k1k2": "K1/K2", "bemt variant": "BEMT, variant"}
US = ("u_num", "u_input", "u_model", "u_D", "u_val")


def _points(page: CasePage, x: str, y: str, keep: Callable[[Row], bool]) -> list[Trace]:
    """Recorded values as points, one trace per source."""
    out = []
    D = page.result.at.diameter_m
    for source, shape in LOOK.items():
        rows = [
            (
                r.airspeed_m_s / (r.rpm / 60.0 * D) if x == "J" else getattr(r, x),
                getattr(r, y),
                r.u if y == "thrust_N" else None,
                r.label,
            )
            for r in (*page.result.rows, *page.own_rows)
            if r.source == source and not math.isnan(getattr(r, y)) and keep(r)
        ]
        if rows:
            out.append(points(NAMES.get(source, source), rows, source, shape))
    return out


def _geometry(page: CasePage) -> Section:
    g = page.blade
    plots: list[Figure | RotorView | None] = []
    if page.surfaces:
        plots.append(viewer(page.surfaces, f"{headline(page.result)}: rotor", uri(page.picture)))
    if g is not None:
        r = g.r_over_R
        beta = [Trace("β", r, g.beta_deg, colour=COLOURS["bench"])]
        plots.append(figure(Plot("Chord", "r/R [-]", "chord [mm]", [Trace("chord", r, g.chord_mm)])))
        plots.append(figure(Plot("Blade angle and twist", "r/R [-]", "blade angle β [deg]", beta)))
    return "Geometry", [("figures", plots)]


def _inputs(page: CasePage) -> Section:
    result = page.result
    c = result.at
    rows: list[Sequence[object]] = [
        ["rotational speed", num(c.rpm, 6), "rev/min"],
        ["airspeed", num(c.airspeed_m_s), "m/s"],
        *([["drive", result.drive.text, ""]] if result.drive else []),
        ["density", num(c.density_kg_m3), "kg/m³"],
        ["temperature", num(c.temperature_C, 3), "°C"],
        ["diameter", num(c.diameter_m), "m"],
        ["hub diameter", num(c.hub_diameter_m), "m"],
        ["blades", num(c.blades), "-"],
        ["pitch at 0.75 R", num(c.pitch_075R_m), "m"],
        ["solidity", num(c.solidity, 3), "-"],
        ["blade elements", num(c.stations), "-"],
        ["n_crit of the section tables", num(c.n_crit, 3), "-"],
        ["section drag level", num(c.drag_level, 3), "-"],
    ]
    words = (
        f"Effects on: {', '.join(c.effects)}. Convention: {c.convention}. Air: {c.air}. "
        f"Program version {result.version}."
    )
    files = [[name, Cell(sha256, code=True)] for name, sha256 in page.files]
    told = (
        "The source does not state the following values. Each is declared as a range; the last columns show the effect "
        "on the thrust when only this value is changed."
    )
    lines: list[Sequence[object]] = []
    for a in result.assumptions:
        at = [v for v in a.thrust_N if not math.isnan(v)]
        spread = f"{number_text(min(at))} – {number_text(max(at))}" if at else "unknown"
        shown = num(a.nominal) if isinstance(a.nominal, int | float) else Cell(str(a.nominal))
        lines.append([Cell(a.key, code=True), shown, a.range, spread, num(a.u_thrust_N, 2), a.why])
    head = ["assumed", "value", "range", "thrust over the range [N]", "u [N]", "why"]
    return "Inputs and assumptions", [
        ("table", table(["input", "value", "unit"], rows, sort=False)),
        ("words", words),
        ("words", told if lines else ""),
        ("table", table(head, lines)),
        ("more", ("Files and their SHA-256", [("table", table(["file", "SHA-256"], files, sort=False))])),
    ]


def opening(page: CasePage) -> list[Any]:
    """First pictures of a report on one case: recording and prediction, else thrust over speed and CT over J."""
    told = first_pictures(page.diagnosis) if page.diagnosis else []
    curves = _curves(page)
    return told or [figure(curves[k]) for k in (len(LABELS), 0) if curves]


def _performance(page: CasePage) -> Section:
    words = (
        "Bands: one standard uncertainty from the declared assumptions and from the model on real rotors. "
        "Points: recorded values; a value without a bar states no uncertainty."
    )
    curves = _curves(page)
    return ("Performance", [("words", words), ("figures", [figure(p) for p in curves])]) if curves else ("", [])


def _curves(page: CasePage) -> list[Plot]:
    """Coefficients over J, then thrust, power and their ratio over the speed of rotation."""
    result, c = page.result, page.curves
    if c is None:
        return []
    own, j, w = result.at, c.over_J, c.over_rpm
    plots = []

    def near(given: float, stated: float) -> bool:
        return abs(given - stated) <= 0.02 * max(abs(stated), 1.0)

    for name, label in LABELS.items():
        y = j[name]
        if name == "eta":  # a ratio of two small numbers where thrust ends
            y = np.where(j.CT > 0.1 * np.nanmax(np.append(j.CT, 0.0)), y, np.nan)
        most = None
        if name == "eta":  # of the least thrust in the band, as the limit falls with thrust
            most = co.eta_limit(j.J, 0.0 if result.fan else j.CT - j.u["CT"])
        traces = [Trace("BEMT", j.J, y, j.u[name], ceiling=most)]
        if name == "CT":
            traces.append(Trace("K1/K2", j.J, c.k1k2_CT, None, COLOURS["k1k2"], "7 4"))
        if name != "eta":
            traces += _points(page, "J", name, lambda r: near(r.rpm, own.rpm))
        title = f"{label[0].upper()}{label[1:]} over advance ratio at {own.rpm:g} rev/min"
        note = "The band ends at the limit of momentum theory." if name == "eta" else ""
        if name == "eta" and math.isfinite(merit := float(co.FM(j.CT[0], j.CP[0], j.J[0]))):
            note = f"{note} At rest, where it is zero, the figure of merit is {merit:.2f}."
        plots.append(Plot(title, "J = V / (n D) [-]", f"{label} [-]", traces, note=note))
    with np.errstate(divide="ignore", invalid="ignore"):
        per_kW: Any = np.where(w.power_W > 0, 1e3 * w.thrust_N / w.power_W, np.nan)
    simple = Trace("K1/K2", w.rpm, c.k1k2_thrust_N, None, COLOURS["k1k2"], "7 4")
    for title, label, y, u, more, channel in (
        ("Thrust over rotational speed", "thrust [N]", w.thrust_N, w.u["thrust_N"], [simple], "thrust_N"),
        ("Shaft power over rotational speed", "shaft power [W]", w.power_W, w.u["power_W"], [], "power_W"),
        ("Thrust per shaft power", "thrust per power [N/kW]", per_kW, None, [], ""),
    ):
        seen = _points(page, "rpm", channel, lambda r: near(r.airspeed_m_s, own.airspeed_m_s)) if channel else []
        traces = [Trace("BEMT", w.rpm, y, u), *more, *seen]
        title = f"{title} at {own.airspeed_m_s:g} m/s"
        plots.append(Plot(title, "rotational speed [rev/min]", label, traces, x_zero=True))
    return plots


def _radial(page: CasePage) -> Section:
    d = page.radial
    if d is None:
        return "", []
    r = d.r_over_R
    R = 0.5 * page.result.at.diameter_m
    thrust, torque = (
        [
            Trace(name, [p[0] / R for p in own], [p[k] for p in own], None, COLOURS["openfoam"], "7 4")
            for name, own in page.own_radial.items()
            if own
        ]
        for k in (1, 2)
    )
    plots = (
        Plot("Thrust loading, all blades", "r/R [-]", "dT/dr [N/m]", [Trace("BEMT", r, d.dT_dr), *thrust]),
        Plot("Torque loading, all blades", "r/R [-]", "dQ/dr [N]", [Trace("BEMT", r, d.dQ_dr), *torque]),
        Plot("Angle of attack", "r/R [-]", "α [deg]", [Trace("BEMT", r, d.alpha_deg)]),
        Plot("Section Mach number", "r/R [-]", "M [-]", [Trace("BEMT", r, d.M)]),
    )
    return "Radial loading", [("figures", [figure(p) for p in plots])]


def _fan(fan: Fan | None) -> Section:
    if fan is None:
        return "", []
    rows: list[Sequence[object]] = [
        ["thrust of the rotor", num(fan.rotor_thrust_N), "N"],
        ["thrust of the duct", num(fan.duct_thrust_N), "N"],
        ["thrust of the stator", num(fan.stator_thrust_N), "N"],
        ["share of the duct", num(fan.duct_share, 3), "-"],
        ["mass flow", num(fan.mass_flow_kg_s), "kg/s"],
        ["exhaust speed", num(fan.exhaust_speed_m_s), "m/s"],
        ["u of the exhaust speed", num(fan.u_exhaust_speed_m_s, 2, none="unknown"), "m/s"],
        ["momentum through the exit", num(fan.exit_momentum_N), "N"],
        [
            "pressure in the exit plane and on the outer wall",
            num(fan.exit_pressure_N, 3),
            "N",
        ],
        ["pitch speed", num(fan.geometric_pitch_speed_m_s), "m/s"],
    ]
    return "Duct and fan", [("table", table(["part", "value", "unit"], rows, sort=False))]


def _verification(page: CasePage) -> Section:
    v = page.refinement
    if v is None:
        return "", []
    line = Trace("BEMT", v.stations, v.thrust_N)
    title = "Thrust against blade elements"
    plot = figure(Plot(title, "blade elements [-]", "thrust [N]", [line], log_x=True, zero=False))
    solved = zip(v.stations, v.thrust_N.tolist(), v.torque_Nm.tolist(), strict=True)
    rows = [[num(n), num(T, 7), num(Q, 6)] for n, T, Q in solved]
    words, study = [], v.grid_study
    if math.isfinite(v.change_to_finest):
        words.append(
            f"With the {v.used} elements used, the thrust is {100 * v.change_to_finest:+.3f} % off that with "
            f"{v.stations[-1]}."
        )
    if study and study.order is not None and study.gci_fine is not None:
        words.append(f"Observed order {study.order:.2f}; grid convergence index {100 * study.gci_fine:.4f} %.")
    if study and study.flags:
        words.append("Remarks: " + "; ".join(study.flags) + ".")
    found = table(["elements", "thrust [N]", "torque [N m]"], rows) if plot else None
    side = Beside([("table", found), ("words", " ".join(words))]) if plot or words else None
    return "Verification", [("figures", [plot, side])]


def _validation(result: Result) -> Section:
    """Every comparison, BEMT's first; a column of uncertainties that nobody knows is left out."""
    found = [c for c in result.comparisons if c.source != "k1k2_printed" or c.model == "k1k2"]
    us = [u for u in US if any(math.isfinite(getattr(c, u)) for c in found)]
    rows: list[Sequence[object]] = []
    for c in sorted(found, key=lambda c: list(MODELS).index(c.model) if c.model in MODELS else len(MODELS)):
        kind, word = stand(c)
        rows.append([MODELS.get(c.model, c.model), c.reference, num(c.rpm, 6), _quantity(c), num(c.S), num(c.D),
                     num(c.E_pct, signed=True), *(num(getattr(c, u), 2, none="unknown") for u in us),
                     Cell(word, badge=kind)])  # fmt: skip
    words = (
        "After ASME V&V 20: E = S − D, u_val² = u_num² + u_input² + u_model² + u_D². The two agree where |E| ≤ u_val. "
        "If u_D is not stated, the last column gives the smallest u_D for which they would agree, as a share of D."
    )
    head = ["model", "against", "rev/min", "quantity", "S", "D", "E %", *us, "agreement"]
    return "Validation", [("words", words), ("table", table(head, rows))]


def _quantity(c: Comparison) -> str:
    """Name of a channel with its unit: thrust [N]."""
    name = c.quantity
    for suffix in ("_m_s", "_Nm", "_N", "_W"):
        name = name.removesuffix(suffix)
    return f"{name.replace('_', ' ')} [{c.unit}]"


def _limits(page: CasePage) -> Section:
    result = page.result
    flags: dict[str, None] = {}
    for row in (*result.rows, *result.variants):
        for flag in row.flags:
            flags.setdefault(f"{row.label}: {flag}")
    for flag in page.curves.flags if page.curves else ():
        flags.setdefault(f"curves: {flag}")
    general = [
        "Blade elements are independent: no sweep, no radial flow, no blade-vortex interaction, no unsteady loads.",
        "Section tables come from a network trained on XFOIL, weak near stall at low Reynolds numbers; beyond stall "
        "they continue as a flat plate.",
    ]
    return "Limits", [("list", [*flags, *result.notes, *page.problems, *general])]


def case_sections(page: CasePage) -> list[Section]:
    """Give the sections of one case."""
    result = page.result
    if not result.rows:
        return sections(("Faults", [("list", result.faults)]))
    audits = [part for audit in result.audit for part in audit_parts(audit)]
    told = page.diagnosis
    return sections(
        ("Your recording and the prediction", [("figures", first_pictures(told))] if told else []),
        _validation(result), _geometry(page), _performance(page), _radial(page), _fan(result.fan),
        ("Grids of the CFD", study_parts(result.grid_studies)), ("Audit of the CFD", audits), _verification(page),
        ("Diagnosis: what the model leaves out", diagnosis_parts(told, first=False) if told else []),
        _inputs(page), _limits(page),
    )  # fmt: skip
