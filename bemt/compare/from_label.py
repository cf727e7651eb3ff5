"""Thrust and power from a label such as 10x5, with bands, K1/K2 beside them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from bemt.air import Air
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_text, text_table
from bemt.base.units import INCH
from bemt.case.schema import AIRSPEED, RPM
from bemt.formula.estimate import POSSIBLE, estimate, length_faults
from bemt.rotors import k1k2 as empirical
from geometry.common import GeometryError
from geometry.designation import parse_designation

SCHEMA = "bemt.estimate/1"


def _label(text: str, faults: list[Fault]) -> tuple[float, float, int | None]:
    """Diameter and pitch [in], blades if stated; NaN where the label cannot be read."""
    try:
        return parse_designation(text)
    except GeometryError as error:
        faults += [Fault("LABEL", *fault) for fault in error.faults]
        return math.nan, math.nan, None


def document(
    label: str,
    speeds: Sequence[float],
    airspeeds: Sequence[float] = (),
    blades: int | None = None,
    chord_mm: float | None = None,
    measured_pitch_in: float | None = None,
    series: str | None = None,
    density: float = 1.225,
    ducted: bool = False,
) -> dict[str, Any]:
    """Estimate every speed [rev/min] with every airspeed [m/s]: ``bemt.estimate/1``; unknown numbers are null.

    An unreadable label, impossible numbers and an unknown series are refused, all at once.
    """
    faults: list[Fault] = []
    D, pitch, marked = _label(label, faults)
    told, blades = blades, blades or marked or 2
    if told and marked and told != marked:
        faults.append(Fault("--blades", "", str(told), f"{marked}, as in {label}"))
    if not 0.1 <= density <= 2.0:
        faults.append(Fault("--density", "", f"{density:g}", "kg/m3 from 0.1 to 2 (1.225 at sea level)"))
    lengths = (("--chord-mm", chord_mm, "mm", "chord"), ("--measured-pitch-in", measured_pitch_in, "in", "pitch"))
    for option, value, unit, name in lengths:
        faults += [] if value is None else length_faults((option, ""), value, unit, D * INCH, POSSIBLE[name])
    # what is no number, or turns backwards, the formula refuses itself
    faults += [Fault("--rpm", "", f"{n:g}", f"0 to {RPM.high:g} rev/min") for n in speeds if RPM.high < n < math.inf]
    limits = f"{AIRSPEED.low:g} to {AIRSPEED.high:g} m/s"
    faults += [
        Fault("--airspeed", "", f"{v:g}", limits)
        for v in airspeeds
        if math.isfinite(v) and not AIRSPEED.low <= v <= AIRSPEED.high
    ]
    rpm, V = (v.ravel() for v in np.meshgrid(speeds, list(airspeeds) or [0.0], indexing="ij"))
    if faults:  # the rest is looked at beside a propeller that is right, so that all faults come at once
        try:
            estimate(0.254, 0.127, blades, rpm, V, series=series)
        except InputError as error:
            faults += error.faults
        raise InputError(faults)
    air = Air.from_density(density)
    chord = None if chord_mm is None else chord_mm * 1e-3
    measured = None if measured_pitch_in is None else measured_pitch_in * INCH
    e = estimate(D * INCH, pitch * INCH, blades, rpm, V, air, chord, measured, series, ducted)
    k = empirical.estimate(D * INCH, pitch * INCH, rpm, V, air, ducted=ducted)

    def number(value: float) -> float | None:
        return float(value) if math.isfinite(value) else None

    columns = {
        "rpm": e.rpm, "airspeed_m_s": e.airspeed_m_s, "thrust_N": e.thrust_N, "u_thrust_N": e.u_thrust_N,
        "u95_thrust_N": e.u95_thrust_N, "power_W": e.power_W, "u_power_W": e.u_power_W, "u95_power_W": e.u95_power_W,
        "J": e.J, "CT": e.CT, "CP": e.CP, "M_tip": e.M_tip, "Re75": e.Re, "k1k2_thrust_N": k.thrust_N,
    }  # fmt: skip
    rows = [
        {name: number(column[i]) for name, column in columns.items()} | {"flags": list(e.flags[i])}
        for i in range(rpm.size)
    ]
    given = {"label": label, "diameter_in": D, "pitch_in": pitch, "blades": blades, "chord_mm": chord_mm,
             "measured_pitch_in": measured_pitch_in, "series": series, "density_kg_m3": density,
             "ducted": ducted}  # fmt: skip
    return {"schema": SCHEMA, "given": given, "rows": rows}


def text(doc: dict[str, Any]) -> str:
    """Give the rows as a table, with what not to trust below."""

    def shown(value: float | None, digits: int = 4) -> str:
        return number_text(math.nan if value is None else value, digits)

    head = ["rpm", "V [m/s]", "T [N]", "+- 68 %", "+- 95 %", "P [W]", "+- 68 %", "+- 95 %", "K1/K2 [N]", "J", "M tip"]
    keys = ("rpm", "airspeed_m_s", "thrust_N", "u_thrust_N", "u95_thrust_N", "power_W", "u_power_W", "u95_power_W",
            "k1k2_thrust_N", "J", "M_tip")  # fmt: skip
    table = [
        [shown(row[key], 2 if key.startswith("u") else 6 if key == "rpm" else 4) for key in keys] for row in doc["rows"]
    ]
    words = {flag: None for row in doc["rows"] for flag in row["flags"]}
    notes = [f"do not trust: {flag}" for flag in words]
    more = [f"--{key.replace('_', '-')}" for key in ("chord_mm", "measured_pitch_in") if doc["given"][key] is None]
    if more:
        notes.append(f"for narrower bands give {' and '.join(more)} (at 0.75 R)")
    return "\n".join([text_table(head, table, left=()), *notes]) + "\n"
