"""The trend page: how thrust moves with size, pitch and speed, and what that means for a robot."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bemt.base.page import num, table
from bemt.base.units import INCH
from bemt.report.plot import COLOURS, DASHES, Mark, Plot, Trace, figure, points
from bemt.report.trends import ROBOT
from bemt.report.values import Section, sections
from bemt.rotors.k1k2 import D_OVER_P_USABLE, M_TIP_LIMIT

__all__ = ["trend_sections"]

NAMES = {"bemt": "BEMT", "cfd": "CFD, recorded"}


def _recorded(results: Sequence[Mapping[str, Any]], x: Any, keep: Any) -> Trace:
    """Recorded CFD of open propellers."""
    rows = [
        (x(r, row), row["thrust_N"], None, f"{r['name']}: {row['label']}")
        for r in results
        for row in r.get("rows", [])
        if r.get("kind") != "fan" and row["source"] == "cfd" and row.get("thrust_N") is not None and keep(row)
    ]
    return points("recorded CFD of the cases", rows, "cfd", "diamond")


def _pair(x: Any, line: Mapping[str, Any]) -> list[Trace]:
    return [
        Trace("BEMT", x, line["thrust_N"], None, COLOURS["bemt"]),
        Trace("K1/K2", x, line["k1k2_thrust_N"], None, COLOURS["k1k2"], "7 4"),
    ]


def _families(f: Mapping[str, Any], results: Sequence[Mapping[str, Any]]) -> Section:
    if not f:
        return "", []
    D, p, rpm = f["D_in"], f["pitch_in"], f["rpm_case"]
    per_inch, per_rpm = f["mach_per_inch"], f["mach_per_rpm"]
    low, high = D_OVER_P_USABLE
    size = _recorded(results, lambda r, row: r["conditions"]["diameter_m"] / INCH, lambda row: row["rpm"] == rpm)
    mach = _recorded(results, lambda r, row: row["M_tip"], lambda row: True)
    over, sonic = f"K1/K2: tip Mach {M_TIP_LIMIT:g}", "supersonic tip"
    narrow, wide = f"K1/K2: D/p {low:g}", f"K1/K2: D/p {high:g}"
    by_size = [
        Mark(M_TIP_LIMIT / per_inch, over),
        Mark(1.0 / per_inch, sonic, beyond="above"),
        Mark(low * p, narrow),
        Mark(high * p, wide),
    ]
    by_pitch = [Mark(D / high, wide, beyond="below"), Mark(D / low, narrow, beyond="above")]
    by_speed = [Mark(M_TIP_LIMIT / per_rpm, over), Mark(1.0 / per_rpm, sonic, beyond="above")]
    by_mach = [Mark(M_TIP_LIMIT, over), Mark(1.0, sonic, beyond="above")]
    note = "The recorded propellers have different pitches. " if size.x else ""
    T, label = "thrust [N]", f"{D:.3g}x{p:.3g} in"
    plots = [
        Plot(f"Thrust over diameter, pitch {p:.3g} in, {rpm:g} rev/min", "diameter [in]", T,
             [*_pair(f["diameter"]["diameter_in"], f["diameter"]), size], by_size,
             note + "Shaded: outside of section theory."),
        Plot(f"Thrust over pitch, {D:.3g} in, {rpm:g} rev/min", "pitch [in]", T,
             _pair(f["pitch"]["pitch_in"], f["pitch"]), by_pitch,
             "BEMT predicts stall where the formula continues. Shaded: outside the range of the formula."),
        Plot(f"Thrust over rotational speed, {label}", "rotational speed [rev/min]", T,
             _pair(f["rpm"]["rpm"], f["rpm"]), by_speed),
        Plot(f"Thrust over tip Mach number, {label}", "tip Mach number [-]", T,
             [*_pair(f["rpm"]["M_tip"], f["rpm"]), mach], by_mach,
             "One propeller by speed, against the recorded propellers, which differ in size." if mach.x else ""),
    ]  # fmt: skip
    words = f"One quantity changes, all else stays as in {f['title']}."
    title = f"Thrust against size, pitch and speed ({f['name']})"
    return title, [("words", words), ("figures", [figure(plot) for plot in plots])]


def _choice(rows: Sequence[Mapping[str, Any]]) -> Section:
    if not rows:
        return "", []
    m, n = ROBOT["mass_kg"], ROBOT["drives"]
    names = [str(r["name"]) for r in reversed(rows)]
    at = {name: i for i, name in enumerate(names)}
    own = [(r["robot_ratio"], at[str(r["name"])], r["u_ratio"], "") for r in rows]
    traces = [points("BEMT", own, "bemt", "circle", True)]
    for source, shape in (("cfd", "diamond"), ("bench", "cross"), ("vendor", "triangle")):
        found = [(ratio, at[str(r["name"])], None, words) for r in rows for words, s, ratio in r["rows"] if s == source]
        traces.append(points(NAMES.get(source, source), found, source, shape))
    wanted = ROBOT["wanted_kgf"]
    plot = figure(Plot(
        f"Thrust of {n} drives over the weight of a {m:g} kg robot", "thrust / weight [-]", "", traces,
        [Mark(1.0, "carries its weight"), Mark(wanted / m, f"{wanted:g} kgf wanted")],
        "At the speed of each case; the mass of propeller, motor and battery is not added.", names, x_zero=True,
        wide=True,
    ))  # fmt: skip
    lines = [[str(r["name"]), num(r["thrust_N"]), num(r["u"], 2), num(r["power_W"]), num(r["g_per_W"], 3),
              num(r["disk_loading"], 3), num(r["robot_ratio"], 3), num(r["needed"], 3)] for r in rows]  # fmt: skip
    header = ["drive", "thrust [N]", "u [N]", "shaft power [W]", "gf per W", "disk loading [N/m²]",
              f"{n} drives over {m:g} kg", f"drives for {wanted:g} kgf"]  # fmt: skip
    fan = ROBOT["fan_mass_kg"]
    words = (
        f"A ducted fan pays for its small diameter with power: compare thrust per watt and disk loading. Masses are "
        f"given for the DS-30 only ({fan:g} kg with motor: 27 N is {27 / (fan * 9.80665):.1f} times its weight); for "
        f"the propellers they are not, so the choice is based on the weight of the robot."
    )
    return "Choice of a drive by thrust to weight", [
        ("words", words),
        ("figures", [plot]),
        ("table", table(header, lines)),
    ]


def _moments(d: Mapping[str, Any]) -> Section:
    if not d or not d["lines"]:
        return "", []
    x, arm = d["distance_m"], ROBOT["arm_m"]
    traces = []
    used: dict[str, int] = {}
    for label, source, T, u in d["lines"]:
        k = used[source] = used.get(source, -1) + 1
        band = [v * u for v in x] if u is not None and math.isfinite(u) and source == "bemt" else None
        dash = DASHES[(k + list(COLOURS).index(source)) % len(DASHES)] if source in COLOURS else ""
        name = f"{NAMES.get(source, source) if source == 'bemt' else label}, {T:.4g} N"
        traces.append(Trace(name, x, [v * T for v in x], band, COLOURS.get(source, COLOURS["other"]), dash))
    at = [(arm, arm * T, None, f"{label}: {T:.4g} N at {arm:g} m = {arm * T:.3g} N m") for label, _, T, _ in d["lines"]]
    traces.append(points(f"at {arm:g} m", at, "other", "circle"))
    note = (
        f"One drive of the pair pushes, the other is off. The thesis: 27 N at 0.2 m = 5.4 N m. Here {arm:g} m gives "
        + "; ".join(f"{label} {arm * T:.3g} N m" for label, _, T, _ in d["lines"])
        + "."
    )
    plot = Plot(f"Roll moment about the middle ({d['name']})", "distance from the centre of mass [m]",
                "roll moment [N m]", traces, [Mark(arm, f"arm {arm:g} m")], note, wide=True)  # fmt: skip
    return "Moment of two drives against mounting distance", [("figures", [figure(plot)])]


def trend_sections(book: Mapping[str, Any]) -> list[Section]:
    """Give how thrust moves, and what that means for the robot of the thesis."""
    t = book["trends"]
    return sections(
        _families(t["family"], [page["result"] for page in book["cases"]]), _choice(t["choice"]), _moments(t["moments"])
    )
