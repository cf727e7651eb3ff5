"""The trend page and its numbers: thrust over diameter, pitch, rpm and tip Mach; choice of a drive; roll moment.

Families start from the first solved propeller case and change one quantity at a time, all else kept. The robot of the
last two plots is that of T. Cahill, MS thesis, Northeastern University, April 2025: 6.5 kg, two drives, 6 kgf wanted,
arms of 0.2 m.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import InputError
from bemt.base.page import num, table
from bemt.base.units import G0, INCH, KGF
from bemt.physics.k1k2 import D_OVER_P_USABLE, M_TIP_LIMIT
from bemt.results.report.book import Book, Choice, Family, Line
from bemt.results.report.plot import COLOURS, DASHES, Mark, Plot, Trace, figure, points
from bemt.results.report.values import Section, sections
from bemt.results.sweep.rows import Result
from bemt.rotors.case import Case
from geometry.common import GeometryError

ORIGIN = "Cahill 2025"
"""What a case of the source thesis states as its ``origin``."""
MASS_KG, DRIVES, WANTED_KGF, ARM_M, FAN_MASS_KG = 6.5, 2, 6.0, 0.2, 0.4
"""Robot of the source thesis; the fan is the DS-30 (duct 100 g, motor 300 g), the only drive whose mass it gives."""
N, COARSE = 15, 20
"""Points of a family, and their blade elements: thrust within 0.2 % of the usual 40."""


def _line(case: Case, key: str, values: Array) -> Line:
    """Solve one point for each value of a key of the case."""
    from bemt.rotors.case.prepare import k1k2_case, prepare_case

    rows = []
    for value in values:
        changes = {key: float(value)}
        row = [math.nan] * 3
        try:
            air = case.air()
            rpm, V = np.array([case.rpm]), np.array([case.airspeed_m_s])
            points = prepare_case(case, changes, COARSE).solve(rpm, V, air)
            simple = k1k2_case(case, changes, rpm, V, air)
            row = [float(a[0]) for a in (points.thrust_N, simple.thrust_N, points.M_tip)]
        except (InputError, GeometryError, ValueError):
            pass  # this value makes no rotor: a gap in the line
        rows.append(row)
    return Line(values, *np.array(rows).T)


def families(case: Case) -> Family:
    """Vary diameter, pitch and rpm of one propeller."""
    from bemt.rotors.case.prepare import k1k2_case, prepare_case

    ready = prepare_case(case)
    D_in, p_in = case.diameter_m / INCH, ready.pitch_m / INCH
    stated = case.stated_pitch_m / INCH
    p_in = stated if math.isfinite(stated) else p_in
    diameters, pitches = np.linspace(0.5, 2.0, N) * D_in, np.linspace(0.3, 2.2, N) * p_in
    rpm = np.linspace(0.1, 1.75, 2 * N) * case.rpm
    air, V = case.air(), np.full(2 * N, case.airspeed_m_s)
    points, simple = ready.solve(rpm, V, air), k1k2_case(case, None, rpm, V, air)
    return Family(
        case.name, case.title, D_in, p_in, case.rpm,
        mach_per_rpm=math.pi * case.diameter_m / 60.0 / air.a_sound,
        mach_per_inch=math.pi * INCH * case.rpm / 60.0 / air.a_sound,
        diameter=_line(case, "rotor.diameter_in", diameters), pitch=_line(case, "blade.pitch_in", pitches),
        rpm=Line(rpm, points.thrust_N, simple.thrust_N, points.M_tip),
    )  # fmt: skip


def choice(results: Sequence[Result]) -> list[Choice]:
    """Compare drives on the robot by thrust over weight."""
    weight = MASS_KG * G0
    out = []
    for result in results:
        row = result.first("bemt")
        if row is None or not math.isfinite(row.thrust_N):
            continue
        T, P = row.thrust_N, row.power_W
        out.append(
            Choice(
                result.name,
                T,
                row.u,
                P,
                disk_loading=T / (math.pi / 4.0 * result.at.diameter_m**2),
                g_per_W=T / KGF * 1000.0 / P if P else math.nan,
                robot_ratio=DRIVES * T / weight,
                u_ratio=DRIVES * row.u / weight,
                needed=WANTED_KGF * KGF / T if T > 0 else math.nan,
                recorded=[
                    (r.label, r.source, DRIVES * r.thrust_N / weight) for r in result.of("cfd", "bench", "vendor")
                ],
            )  # fmt: skip
        )
    return out


def moments(results: Sequence[Result]) -> tuple[str, list[tuple[str, str, float, float]]]:
    """Name and thrusts of one drive of a pair, whose roll moment about the middle grows with its mounting distance."""
    solved = [r for r in results if r.rows]
    chosen = next((r for r in solved if r.kind == "fan"), solved[0] if solved else None)
    if chosen is None:
        return "", []
    found = [r for r in chosen.of("bemt", "cfd", "bench", "vendor") if not math.isnan(r.thrust_N)]
    return chosen.name, [(r.label, r.source, r.thrust_N, r.u) for r in found]


NAMES = {"bemt": "BEMT", "cfd": "CFD, recorded"}


def _recorded(results: Sequence[Result], x: Any, keep: Any) -> Trace:
    """Recorded CFD of open propellers."""
    rows = [
        (x(r, row), row.thrust_N, None, f"{r.name}: {row.label}")
        for r in results
        for row in r.of("cfd")
        if r.kind != "fan" and not math.isnan(row.thrust_N) and keep(row)
    ]
    return points("recorded CFD of the cases", rows, "cfd", "diamond")


def _pair(x: Array, line: Line) -> list[Trace]:
    return [
        Trace("BEMT", x, line.thrust_N, None, COLOURS["bemt"]),
        Trace("K1/K2", x, line.k1k2_thrust_N, None, COLOURS["k1k2"], "7 4"),
    ]


def _families(f: Family | None, results: Sequence[Result]) -> Section:
    if f is None:
        return "", []
    D, p, rpm = f.D_in, f.pitch_in, f.rpm_case
    per_inch, per_rpm = f.mach_per_inch, f.mach_per_rpm
    low, high = D_OVER_P_USABLE
    size = _recorded(results, lambda r, row: r.at.diameter_m / INCH, lambda row: row.rpm == rpm)
    mach = _recorded(results, lambda r, row: row.M_tip, lambda row: True)
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
             [*_pair(f.diameter.x, f.diameter), size], by_size,
             note + "Shaded: outside of section theory."),
        Plot(f"Thrust over pitch, {D:.3g} in, {rpm:g} rev/min", "pitch [in]", T,
             _pair(f.pitch.x, f.pitch), by_pitch,
             "BEMT predicts stall where the formula continues. Shaded: outside the range of the formula."),
        Plot(f"Thrust over rotational speed, {label}", "rotational speed [rev/min]", T,
             _pair(f.rpm.x, f.rpm), by_speed),
        Plot(f"Thrust over tip Mach number, {label}", "tip Mach number [-]", T,
             [*_pair(f.rpm.M_tip, f.rpm), mach], by_mach,
             "One propeller by speed, against the recorded propellers, which differ in size." if mach.x else ""),
    ]  # fmt: skip
    words = f"One quantity changes, all else stays as in {f.title}."
    title = f"Thrust against size, pitch and speed ({f.name})"
    return title, [("words", words), ("figures", [figure(plot) for plot in plots])]


def _choice(rows: Sequence[Choice]) -> Section:
    if not rows:
        return "", []
    m, n = MASS_KG, DRIVES
    names = [r.name for r in reversed(rows)]
    at = {name: i for i, name in enumerate(names)}
    own = [(r.robot_ratio, at[r.name], r.u_ratio, "") for r in rows]
    traces = [points("BEMT", own, "bemt", "circle", True)]
    for source, shape in (("cfd", "diamond"), ("bench", "cross"), ("vendor", "triangle")):
        found = [(ratio, at[r.name], None, words) for r in rows for words, s, ratio in r.recorded if s == source]
        traces.append(points(NAMES.get(source, source), found, source, shape))
    wanted = WANTED_KGF
    plot = figure(Plot(
        f"Thrust of {n} drives over the weight of a {m:g} kg robot", "thrust / weight [-]", "", traces,
        [Mark(1.0, "carries its weight"), Mark(wanted / m, f"{wanted:g} kgf wanted")],
        "At the speed of each case; the mass of propeller, motor and battery is not added.", names, x_zero=True,
        wide=True,
    ))  # fmt: skip
    lines = [[r.name, num(r.thrust_N), num(r.u, 2), num(r.power_W), num(r.g_per_W, 3), num(r.disk_loading, 3),
              num(r.robot_ratio, 3), num(r.needed, 3)] for r in rows]  # fmt: skip
    header = ["drive", "thrust [N]", "u [N]", "shaft power [W]", "gf per W", "disk loading [N/m²]",
              f"{n} drives over {m:g} kg", f"drives for {wanted:g} kgf"]  # fmt: skip
    fan = FAN_MASS_KG
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


def _moments(name: str, lines: Sequence[tuple[str, str, float, float]]) -> Section:
    if not lines:
        return "", []
    x, arm = np.linspace(0.0, 0.4, 9), ARM_M
    traces = []
    used: dict[str, int] = {}
    for label, source, T, u in lines:
        k = used[source] = used.get(source, -1) + 1
        band = [v * u for v in x] if math.isfinite(u) and source == "bemt" else None
        dash = DASHES[(k + list(COLOURS).index(source)) % len(DASHES)] if source in COLOURS else ""
        said = f"{NAMES.get(source, source) if source == 'bemt' else label}, {T:.4g} N"
        traces.append(Trace(said, x, [v * T for v in x], band, COLOURS.get(source, COLOURS["other"]), dash))
    at = [(arm, arm * T, None, f"{label}: {T:.4g} N at {arm:g} m = {arm * T:.3g} N m") for label, _, T, _ in lines]
    traces.append(points(f"at {arm:g} m", at, "other", "circle"))
    note = (
        f"One drive of the pair pushes, the other is off. The thesis: 27 N at 0.2 m = 5.4 N m. Here {arm:g} m gives "
        + "; ".join(f"{label} {arm * T:.3g} N m" for label, _, T, _ in lines)
        + "."
    )
    plot = Plot(f"Roll moment about the middle ({name})", "distance from the centre of mass [m]",
                "roll moment [N m]", traces, [Mark(arm, f"arm {arm:g} m")], note, wide=True)  # fmt: skip
    return "Moment of two drives against mounting distance", [("figures", [figure(plot)])]


def trend_sections(book: Book) -> list[Section]:
    """Give how thrust moves, and what that means for the robot of the thesis."""
    t = book.trends
    return sections(
        _families(t.family, [page.result for page in book.cases]), _choice(t.choice), _moments(t.pair, t.moments)
    )
