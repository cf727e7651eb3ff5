"""Every number of the source thesis beside ours: ``python reports/studies/reproduce.py [--json]``.

Statuses: "reproduced" (rounds to the printed digits), "reproduced within rounding" (last digit cut off, or reached with
an input rounded as the note says), "not reproduced, because ...", "input, not computed", "not checked: data absent".
JSON is one document of schema ``bemt.reproduce/1``.
"""

from __future__ import annotations

import argparse
import json
import math
import textwrap
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import thesis as th

from bemt import __version__
from bemt.base.given import find_data
from bemt.base.units import INCH, KGF, RPM
from bemt.physics import coefficients as co
from bemt.physics import k1k2 as k
from bemt.physics.air import Air

SCHEMA = "bemt.reproduce/1"
WIDTH = 100
UIUC_POINTS, UIUC_PROPELLERS = 4122, 248


def find_uiuc() -> Path | None:
    """Folder of the UIUC data, see :func:`bemt.base.given.find_data`."""
    return find_data("uiuc")


def uiuc_statistics(folder: Path) -> dict[str, Any]:
    """Compare the K1/K2 model with measured propellers: nominal diameter and pitch, nothing fitted. [-]

    Thrust follows from CT at 1.225 kg/m3: density cancels in the ratio, and so does n.  Propellers without a nominal
    pitch are left out; 3- and 4-blade ones are kept, as the model has no blade count.
    """
    from bemt.data.readers.uiuc import scan_folder

    static: list[np.ndarray] = []
    x: list[np.ndarray] = []
    ratio: list[np.ndarray] = []
    J0: list[float] = []
    propellers = 0
    for p in scan_folder(folder).propellers:
        if p.pitch_in is None:
            continue
        D, pitch = p.diameter_m, p.pitch_in * INCH
        propellers += bool(p.statics)
        for s in p.statics:
            static.append(k.thrust(D, pitch, s.rpm) / co.thrust(s.CT, k.RHO_FIXED, s.rpm / 60, D))
        for line in p.lines:
            n = line.rpm / 60
            T = co.thrust(line.CT, k.RHO_FIXED, n, D)
            F = k.thrust(D, pitch, line.rpm, co.airspeed(line.J, n, D))
            ok = T > 0
            x.append(line.J[ok] * D / pitch)
            ratio.append(F[ok] / T[ok])
            cross = np.flatnonzero((line.CT[:-1] > 0) & (line.CT[1:] <= 0))
            if cross.size:
                i = cross[-1]
                J_zero = np.interp(0.0, -line.CT[[i, i + 1]], line.J[[i, i + 1]])
                J0.append(float(J_zero / k.zero_thrust_J(D, pitch)))
    R, X, Y = (np.concatenate(v) if v else np.empty(0) for v in (static, x, ratio))
    if R.size == 0:
        return {}
    low = np.arange(5) / 5
    bins = [Y[(a <= X) & (a + 0.2 > X)] for a in low]
    return {
        "points": int(R.size), "propellers": propellers, "median": float(np.median(R)), "sd": float(np.std(R)),
        "within_13": float(np.mean(np.abs(R - 1) <= 0.13)), "within_26": float(np.mean(np.abs(R - 1) <= 0.26)),
        "flight": [float(np.median(b)) if b.size else None for b in bins], "flight_points": int((X < 1).sum()),
        "zero_thrust": float(np.mean(J0)) if J0 else None, "zero_thrust_lines": len(J0),
    }  # fmt: skip


def _model(f: th.ThesisFacts, uiuc: dict[str, Any] | None) -> None:
    f.section = "1 K1/K2 model"
    f.given("density, fixed", "1.225", "kg/m3")
    f.check("K1 = 1/3.29546", "0.3034", k.K1)
    f.given("K2, set by trial", "1.5")
    f.given("vendor points behind K1", "149", "points", "not published, so the fit cannot be repeated")
    f.given("claim: 68 % of points within", "13", "%", "compared with UIUC data below")
    f.given("claim: 95 % of points within", "26", "%", "compared with UIUC data below")
    f.given("usable D/p, from", "0.5")
    f.given("usable D/p, to", "2.5")
    f.given("best D/p, from", "0.8")
    f.given("best D/p, to", "1.8")
    f.check("zero-thrust J over P/D, by the formula", "1.00", _zero_thrust())
    defect = {
        name: th.unit_defect(g, length=INCH)
        for name, g in (("right", k.corrected_equation), ("printed", th.printed_equation))
    }
    f.word(
        "printed final equation",
        "dimensionally wrong",
        _wrong(defect["printed"]),
        "the printed form turned out homogeneous",
        note=f"inches for metres change its thrust by {defect['printed']:+.0%}",
    )
    f.word(
        "equation with every term in the bracket",
        "right",
        "right" if abs(defect["right"]) < 1e-9 else "wrong",
        note=f"inches for metres change its thrust by {abs(defect['right']):.0e}",
    )
    u = uiuc or {}
    pct = {key: None if u.get(key) is None else 100 * u[key] for key in ("within_13", "within_26")}
    flight = u.get("flight") or [None] * 5
    rows: tuple[tuple[str, str, float | None, str], ...] = (
        ("UIUC static points", str(UIUC_POINTS), u.get("points"), ""),
        ("UIUC propellers", str(UIUC_PROPELLERS), u.get("propellers"), ""),
        ("UIUC static: median F/measured", "0.992", u.get("median"), ""),
        ("UIUC static: sd of F/measured", "0.196", u.get("sd"), ""),
        ("UIUC static: within 13 %", "55.1", pct["within_13"], "%"),
        ("UIUC static: within 26 %", "83.2", pct["within_26"], "%"),
        ("UIUC flight: F/measured, J/(P/D) < 0.2", "0.85", flight[0], ""),
        ("UIUC flight: F/measured, 0.8-1.0", "0.29", flight[-1], ""),
        ("UIUC: measured zero-thrust J over P/D", "1.19", u.get("zero_thrust"), ""),
    )
    part = ""
    if u.get("points", 0) != UIUC_POINTS:
        part = f"the folder holds {u.get('points')} of {UIUC_POINTS} points, {u.get('propellers')} of {UIUC_PROPELLERS}"
        part += " propellers"
    for name, stated, ours, unit in rows:
        if ours is None:
            f.items.append(th.ThesisItem(f.section, name, stated, None, unit, th.ABSENT, "set BEMT_DATA"))
        else:
            f.check(name, stated, float(ours), unit, note=part, because=part)


def _zero_thrust() -> float:
    """Zero of the thrust over airspeed, found by bisection, over the pitch speed (J over P/D)."""
    D, p, rpm = 8 * INCH, 5 * INCH, 20000.0
    low, high = 0.1, 3.0
    for _ in range(60):
        mid = 0.5 * (low + high)
        low, high = (mid, high) if k.thrust(D, p, rpm, mid * k.pitch_speed(rpm, p)) > 0 else (low, mid)
    return 0.5 * (low + high)


def _wrong(defect: float) -> str:
    return "dimensionally wrong" if abs(defect) > 1e-9 else "homogeneous"


def _cfd(f: th.ThesisFacts) -> None:
    f.section = "2 CFD against K1/K2, 20 000 rev/min, static"
    f.given("rotational speed", "20000", "rev/min")
    f.given("velocity nodes of the Fluent runs", "200", "", "no mesh count, no grid study; zone as wide as the disk")
    f.given("blades", "2")
    f.check("speed of sound for the tip Mach numbers", "340.3", Air.isa().a_sound, "m/s")
    variants = th.k1k2_variants()
    blind = th.mach_blindness()
    errors, signs = [], []
    for i, (d, p, fluent, printed, err, again, CT, M) in enumerate(th.PROPS):
        name = f"{d}x{p}"
        F = float(k.thrust(d * INCH, p * INCH, th.RPM_PROPS)) / KGF
        F_cfd = float(fluent)
        errors.append(abs(F_cfd - F) / F_cfd * 100)
        signs.append("low" if F < F_cfd else "high")
        f.given(f"{name}: Fluent", fluent, "kgf")
        f.check(f"{name}: K1/K2 as printed", printed, F, "kgf", variants=[("with " + n, v[i]) for n, v in variants])
        f.check(f"{name}: K1/K2 recomputed before", again, F, "kgf")
        of_print = abs(F_cfd - float(printed)) / F_cfd * 100
        f.check(f"{name}: printed error", err, errors[-1], "%", variants=[("of the printed, rounded values", of_print)])
        f.check(f"{name}: CT of the Fluent value", CT, co.CT(F_cfd * KGF, k.RHO_FIXED, th.RPM_PROPS / 60, d * INCH))
        f.check(
            f"{name}: rotational tip Mach",
            M,
            blind["M_tip"][name],
            note="supersonic" if blind["M_tip"][name] > 1 else "",
        )
    f.check("average error, printed", "5.22", float(np.mean(errors)), "%", note="mean of the unrounded errors")
    f.check("mean of the four printed errors", "5.21", float(np.mean([float(r[4]) for r in th.PROPS])), "%")
    f.word("K1/K2 against Fluent, 8, 10, 12, 14 in", "low low high high", " ".join(signs))
    f.word("supersonic tips", "14x8", " ".join(blind["supersonic"]) or "none")
    knows = "has no Mach number effects" if blind["CT_spread"] < 1e-9 else "depends on the Mach number"
    f.word(
        "K1/K2 and the Mach number",
        "has no Mach number effects",
        knows,
        note=f"CT from tip Mach 0.05 to 1.5 changes by {blind['CT_spread']:.0e}",
    )


def _fan(f: th.ThesisFacts) -> None:
    f.section = "3 DS-30-AXI-HDS"
    s, D = th.DS30, th.DS30["diameter_m"]
    n, hub = s["rpm"] / 60, s["hub_m"]
    annulus = math.pi / 4 * (D**2 - hub**2)
    f.given("max thrust, vendor", "27", "N")
    f.check("27 N, printed elsewhere as", "2.75", s["thrust_N"] / KGF, "kgf")
    f.check("27 N, printed elsewhere as", "2.7", s["thrust_N"] / KGF, "kgf")
    for name, stated, unit in (
        ("max exhaust speed", "87.3", "m/s"), ("duct diameter (table)", "70", "mm"),
        ("outer diameter (text)", "69", "mm"), ("length", "60", "mm"), ("hub diameter", "25.4", "mm"),
        ("max speed", "55000", "rev/min"), ("mass of the duct", "100", "g"), ("mass of the motor", "300", "g"),
        ("thrust, Fluent", "2.4", "kgf"), ("thrust, load cell", "2.4", "kgf"), ("thrust, vendor", "2.75", "kgf"),
    ):  # fmt: skip
        f.given(name, stated, unit)
    top = 6 * 4.2
    f.given(
        "motor HET 700-68-1400: last number",
        "1400",
        "",
        f"if this is rpm/V, six cells at 4.2 V turn it at most at {1400 * top:.0f} rev/min unloaded, and 55000 "
        f"rev/min need {s['rpm'] / 1400:.1f} V (not checked against a data sheet)",
    )
    f.check("tip Mach at 55 000 rev/min", "0.58", co.M_tip(n, D, th.A_THESIS))
    f.check("diameter", "2.717", D / INCH, "in")
    f.check("annulus area, 69 mm less hub", "3.233e-3", annulus, "m2")

    def F(pitch_in: float) -> float:
        return float(k.thrust(D, pitch_in * INCH, s["rpm"], hub_diameter_m=hub))

    f.check("K1/K2: F over sqrt(pitch in m)", "10.08", F(1.0) / math.sqrt(INCH), "N")
    for pitch, stated in ((1.5, "1.97"), (2.70, "2.64"), (6.0, "3.94")):
        f.check(f"K1/K2 at pitch {pitch:g} in", stated, F(pitch), "N")
    found = th.ds30_finding()
    best, claimed = found["best"], found["claimed"]
    other = "; ".join(
        f"without the K1/K2 factor, {r.area}, {1000 * r.diameter_m:g} mm: kgf at pitch/D {r.pitch_over_D:.2f}"
        + ("" if r.above_exhaust else " (below the exhaust bound)")
        for r in found["other_formulas"]
    )
    f.check("thrust, K1/K2", "2.64", found["K1K2_at_pitch_equal_diameter_N"] / KGF, "kgf", because=(
        f"at pitch = diameter the equation gives {found['K1K2_at_pitch_equal_diameter_N']:.2f} N; 2.64 kgf would need "
        f"a pitch of {claimed.pitch_m:.2f} m. Searched over formula, area, diameter, unit: inside D/p 0.5-2.5 it gives "
        f"2.64 only in {' and '.join(found['units'])}, first at pitch/D {best.pitch_over_D:.2f} ({best.area}). "
        f"Other formula, 2.64 kgf: {other or 'none'}."))  # fmt: skip
    f.word("unit in which K1/K2 gives 2.64", "N", " ".join(found["units"]))
    f.check("pitch/D where it does", "1.0", best.pitch_over_D)
    f.check(
        "factor below the claim",
        "9.81",
        found["slip_factor"],
        note=(f"ratio at pitch = diameter {found['ratio']:.2f}; nearest unit error: {found['slip']}"),
    )
    f.check("vendor thrust over K1/K2 ('about ten')", "10", s["thrust_N"] / found["K1K2_at_pitch_equal_diameter_N"])
    f.check("momentum check, rho A v^2", "30.2", k.RHO_FIXED * annulus * s["exhaust_m_s"] ** 2, "N",
            note="12 % above the 27 N of the vendor: holds for a straight exhaust of the annulus area")  # fmt: skip
    f.check("least pitch by the exhaust speed", "95", 1000 * s["exhaust_m_s"] / n, "mm")


def _bench(f: th.ThesisFacts) -> None:
    f.section = "4 Bench"
    T, arm = th.DS30["thrust_N"], 0.2
    for name, stated, unit in (
        ("PWM rate", "50", "Hz"), ("pulse at 0 %", "1000", "us"), ("pulse at 100 %", "2000", "us"),
        ("thrust tops out near", "2.4", "kgf"), ("ESC, one chapter", "95", "A"), ("ESC, another chapter", "35", "A"),
        ("battery cells in series", "6", ""), ("arm from the centre of mass", "0.2", "m"),
        ("mass of the robot", "6.5", "kg"), ("target thrust", "6", "kgf"), ("fans", "2", ""),
    ):  # fmt: skip
        f.given(name, stated, unit)
    f.check("roll moment of 27 N at 0.2 m", "5.4", T * arm, "N m")
    f.check("roll moment", "0.54", T * arm / KGF, "kgf m", variants=[("of the rounded 2.7 kgf", 2.7 * arm)])
    f.check("target thrust", "58", 6 * KGF, "N",
            note=f"two fans of 27 N give 54 N; 58.8 N over 6.5 kg is a thrust-to-weight of {6 / 6.5:.2f}")  # fmt: skip


def _motor(f: th.ThesisFacts) -> None:
    f.section = "5 Motor torque constant, MN4006 KV380"
    Kv = 380 * RPM
    clarke, per_q = th.clarke_factor()
    f.given("K_v", "380", "rpm/V")
    f.check("K_v", "39.79", Kv, "rad/s/V")
    f.check("K_b = 1/K_v", "0.02513", 1 / Kv, "V s/rad")
    f.check("transform factor sqrt(2/3)", "0.816", math.sqrt(2 / 3))
    f.check("I_q over phase amplitude, sqrt(3/2)", "1.2247", clarke, note="by a numerical Clarke transform")
    f.check("q-axis K_t = sqrt(3/2) K_b", "0.0308", per_q / Kv, "N m/A", note="by the power of three phases")
    f.check("q-axis K_t as printed", "0.0307", per_q / Kv, "N m/A")
    f.given("trials, back-EMF", "10")
    f.given("trials, torque sensor", "28")
    f.given("torque sensor range", "2", "N m")
    f.given("transmitter current, from", "4", "mA")
    f.given("transmitter current, to", "20", "mA")
    f.given(
        "K_t, mean of the torque sensor",
        "0.0311",
        "N m/A",
        f"{0.0311 * Kv / per_q - 1:+.1%} against the data sheet route",
    )


def items(uiuc: dict[str, Any] | None = None) -> list[th.ThesisItem]:
    """Give every number of the thesis with ours and its status.

    >>> [i.status for i in items() if i.quantity == "8x5: K1/K2 recomputed before"]
    ['reproduced']
    """
    f = th.ThesisFacts()
    _model(f, uiuc)
    for part in (_cfd, _fan, _bench, _motor):
        part(f)
    return f.items


def findings() -> dict[str, Any]:
    """Give what the searches found."""
    ds30 = th.ds30_finding()
    plain = {key: _plain(value) for key, value in ds30.items()}
    return {
        "ds30": plain | {"readings": [asdict(r) for r in th.ds30_readings() if r.sensible]},
        "mach": th.mach_blindness(),
        "k1k2_print": [{"variant": n, "kgf": list(v)} for n, v in th.k1k2_variants()],
        "printed_equation": {
            "inch_for_metre_changes_thrust_by": th.unit_defect(th.printed_equation, length=INCH),
            "right_form_changes_by": th.unit_defect(k.corrected_equation, length=INCH),
        },
    }


def _plain(value: Any) -> Any:
    if isinstance(value, th.PrintedValue):
        return asdict(value)
    return [_plain(v) for v in value] if isinstance(value, list) else value


def document(uiuc: dict[str, Any] | None = None) -> dict[str, Any]:
    """Make the JSON document."""
    rows = items(uiuc)
    return {"schema": SCHEMA, "version": __version__, "items": [asdict(i) for i in rows],
            "summary": {s: Counter(i.status for i in rows)[s] for s in th.STATUSES}, "findings": findings(),
            "uiuc": uiuc}  # fmt: skip


def table(rows: list[th.ThesisItem]) -> str:
    """Lay the items out in 100 columns."""
    out = [f"{'quantity':<41}{'stated':>10} {'ours':>10} {'unit':<8} status"]
    section = ""
    for i in rows:
        if i.section != section:
            section = i.section
            out += ["", section]
        status = i.status
        if isinstance(i.ours, str):
            out.append(f"  {i.quantity:<39}{'':>10} {'':>10} {'':<8} {status}")
            out.append(f"      stated: {i.stated}; ours: {i.ours}")
        else:
            ours = "" if i.ours is None else _number(i.ours, i.stated)
            out.append(f"  {i.quantity:<39}{i.stated:>10} {ours:>10} {i.unit:<8} {status}")
        if i.note:
            out += textwrap.wrap(i.note, WIDTH, initial_indent="      ", subsequent_indent="      ")
    counts = Counter(i.status.removesuffix(", because") for i in rows)
    out += ["", *textwrap.wrap(f"{len(rows)} numbers: " + "; ".join(f"{n} {s}" for s, n in counts.items()), WIDTH)]
    return "\n".join(line.rstrip() for line in out)


def _number(value: float, stated: str) -> str:
    """One digit more than was printed, so that the rounding can be seen."""
    if "e" in stated:
        return f"{value:.4e}"
    digits = len(stated.partition(".")[2])
    return f"{value:.0f}" if digits == 0 and value == round(value) else f"{value:.{digits + 1}f}"


def main(words: list[str] | None = None) -> int:
    """Print the table or the document; a number that is not reproduced is a finding, not a failure."""
    parser = argparse.ArgumentParser(description="Every number of the source thesis beside ours.")
    parser.add_argument("--json", action="store_true", help=f"print {SCHEMA}")
    as_json = parser.parse_args(words).json
    folder = find_uiuc()
    uiuc = uiuc_statistics(folder) if folder else None
    print(json.dumps(document(uiuc), indent=1, allow_nan=False) if as_json else table(items(uiuc)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
