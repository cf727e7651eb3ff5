"""A design as text, document and files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base import canvas
from bemt.base.arrays import Array
from bemt.base.canvas import BLUE, GREY, ORANGE
from bemt.base.tables import json_text, number_text, text_table, write_atomic
from bemt.base.units import G0, INCH
from bemt.tools.design.blade_design import FAMILY, BandedLoads, Design
from bemt.tools.design.minimum_loss import actuator_disk

# The blade before and after: outline, chord, twist, lift coefficient and loading.

BEFORE: dict[str, Any] = {"color": ORANGE, "ls": "--", "lw": 1.4}
AFTER: dict[str, Any] = {"color": BLUE, "ls": "-", "lw": 1.8}
LIMIT: dict[str, Any] = {"color": GREY, "ls": ":", "lw": 1.3}


def picture(d: Design) -> bytes:
    """Draw the start and the result. PNG bytes."""
    figure = canvas.figure(10.0, 7.2)
    axes = figure.subplot_mosaic([["blade", "blade"], ["chord", "twist"], ["lift", "load"]],
                                 height_ratios=[0.75, 1.0, 1.0])  # fmt: skip
    blade, chords, twist, lift, load = (axes[key] for key in ("blade", "chord", "twist", "lift", "load"))
    shape, R = d.found.problem.shape, d.need.R
    x = shape.r / R
    tables = [shape.table(d.found.start), shape.table(d.found.best)]
    start = "before: minimum induced loss" if d.start is not None else "before: blade of the case"
    looks: tuple[Any, ...] = (
        (tables[0], d.found.before, {**BEFORE, "label": start}),
        (tables[1], d.values, {**AFTER, "label": "after"}),
    )
    for (r, chord, beta), v, look in looks:
        _outline(blade, 1e3 * R * r, 1e3 * R * chord, look)
        chords.plot(r, 1e3 * R * chord, **look)
        twist.plot(r, np.degrees(beta), **look)
        for k in d.found.problem.flown:
            label = look if k == d.found.problem.flown[0] else {**look, "label": None, "alpha": 0.5}
            lift.plot(x, v.cl[k], **label)
            load.plot(x, v.load[k], **label)
    low, _ = d.found.problem.chord_range
    chords.plot(tables[1][0], 1e3 * R * np.exp(low), **LIMIT, label="least")
    for k in d.found.problem.flown:
        lift.plot(x, d.values.limit[k], **LIMIT, label="largest allowed" if k == d.found.problem.flown[0] else None)
    later = "" if len(d.found.problem.flown) == 1 else " (later points lighter)"
    blade.set(xlabel="radius [mm]", ylabel="[mm]", aspect="equal")
    blade.set_title(d.name + f": {d.need.blades} blades, outline along the quarter chord, unrolled", fontsize=10)
    for ax, y in ((chords, "chord [mm]"), (twist, "blade angle [deg]"), (lift, "lift coefficient" + later),
                  (load, "thrust per radius [N/m]")):  # fmt: skip
        ax.set(xlabel="r/R", ylabel=y, xlim=(0.0, 1.0))
        ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
    chords.legend(frameon=False, fontsize=8)
    lift.legend(frameon=False, fontsize=8)
    for ax in axes.values():
        canvas.frame(ax)
    return canvas.png(figure)


def _outline(ax: Any, r: Array, chord: Array, look: dict[str, Any]) -> None:
    """Leading and trailing edge around the quarter chord, closed."""
    edge = np.r_[0.25 * chord, (-0.75 * chord)[::-1]]
    ax.plot(np.r_[r, r[::-1], r[0]], np.r_[edge, edge[0]], **look)


SCHEMA = "bemt.design/1"
RESULTS = ("design.json", "design.png")
MUCH = 1.05  # Thrust over that asked for from which on the text says why


def _row(
    name: str, rpm: float, thrust: str, power: str, T: float, V: float, P: float, mach: float, d: Design
) -> list[str]:
    """Thrust and power at a point, with the efficiency in flight or the figure of merit at rest."""
    need = d.need
    ideal = T * V if V else actuator_disk(T, 0.0, need.R, need.Rhub, float(need.air.rho)) if not d.ducted else math.nan
    return [name, "-" if math.isnan(rpm) else f"{rpm:.0f}", thrust, power, number_text(ideal / P, 3),
            number_text(1e3 * T / G0 / P, 3), number_text(mach, 2)]  # fmt: skip


def _banded(value: float, u: float) -> str:
    digits = 3 if value < 1000.0 else 4
    return f"{number_text(value, digits)} ± {number_text(u, 2)}" if math.isfinite(u) else number_text(value, digits)


def _loads(b: BandedLoads) -> tuple[str, str]:
    return _banded(b.thrust_N, b.u_thrust_N), _banded(b.power_W, b.u_power_W)


def _mach(d: Design, rpm: float, V: float, R: float) -> float:
    return math.hypot(rpm * math.pi / 30.0 * R, V) / float(d.need.air.a_sound)


def _rows(d: Design) -> list[list[str]]:
    """The blade at each point, beside the best label; at one point also beside the ideal limits."""
    need, v, several = d.need, d.values, len(d.need.points) > 1
    rows = []
    for k, p in enumerate(need.points):
        point = f"{k + 1}: " if several else ""
        V = p.airspeed_m_s
        mach = _mach(d, float(v.rpm[k]), V, need.R)
        rows.append(_row(point + "design", float(v.rpm[k]), *_loads(d.bands[k]), float(v.thrust_N[k]), V,
                         float(v.power_W[k]), mach, d))  # fmt: skip
        others = [(d.label, "its best speed", d.label_bands), (d.same_speed, "same speed", ())]
        for label, what, bands in others:
            if label is None or (what == "same speed" and p.rpm is None):
                continue
            T, P, rpm = (float(a[k]) for a in (label.thrust_N, label.power_W, label.rpm))
            shown = _loads(bands[k]) if bands else (number_text(T, 3), number_text(P, 3))
            mach = _mach(d, rpm, V, 0.5 * label.case.diameter_m)
            rows.append(_row(f"{point}{label.name}, {what}", rpm, *shown, T, V, P, mach, d))
    if not several:
        T, V = need.points[0].thrust_N, need.points[0].airspeed_m_s
        ideal = [("best without drag (Betz)", d.betz_W), ("ideal disk", d.disk_W)]
        rows += [_row(name, math.nan, number_text(T, 3), number_text(P, 3), T, V, P, math.nan, d)
                 for name, P in ideal if math.isfinite(P)]  # fmt: skip
    return rows


def text(d: Design) -> str:
    """One screen: the blade next to the best label and the ideal limits, what it buys and what limits it."""
    need, several = d.need, len(d.need.points) > 1
    lines = [
        f"{d.name}: {2.0 * need.R / INCH:.4g} in, {need.blades} blades, "
        + "; ".join(f"{p.thrust_N:g} N {p.at}" + ("" if p.weight else " (floor)") for p in need.points),
        "",
    ]
    quality = "eta" if all(p.airspeed_m_s for p in need.points) else "eta, FM" if several else "FM"
    lines.append(text_table(["", "rpm", "thrust N", "power W", quality, "g/W", "tip Mach"], _rows(d)))
    if several:
        other = "" if d.label is None else f", {d.label.name} {d.label.mean_W:.4g} W"
        lines.append(f"mean power: design {d.mean_W:.4g} W{other}"
                     + (f", best without drag {d.betz_W:.4g} W" if math.isfinite(d.betz_W) else "")
                     + f", ideal disk {d.disk_W:.4g} W")  # fmt: skip
    lines += ["± one standard uncertainty: " + ("the label's unknown shape is most of its band" if not d.ducted else
                                                "duct and gap are most of it"), "", *_bought(d)]  # fmt: skip
    limits = d.need.limits
    stress, allowed = float(np.nanmax(d.values.stress_Pa)) / 1e6, limits.material.strength_MPa / limits.safety
    if d.thickness is not None and d.thickness != FAMILY[0]:
        note = "section {:.0%} thick at the hub and {:.0%} from half the radius, for the stress".format(*d.thickness)
        lines.append(note)
    lines.append(f"limits reached: {'; '.join(d.active) or 'none'}")
    lines.append(f"largest stress {stress:.3g} MPa; {allowed:.3g} allowed ({limits.material.name}, "
                 f"{limits.material.strength_MPa:g} MPa over {limits.safety:g})")  # fmt: skip
    if d.robust is not None:
        lines.append("over rotors as built, " + "; ".join(
            f"{name}: {_banded(o.thrust_N, o.sd_thrust_N)} N, {_banded(o.power_W, o.sd_power_W)} W"
            for name, o in zip(("this blade", "the blade for the drawing alone"), d.robust, strict=True)))  # fmt: skip
    if not d.found.converged:
        lines.append("! the search did not converge: the blade keeps its limits, but less power may be possible")
    return "\n".join(lines) + "\n"


def _ratio(times: float) -> str:
    """A power over another one, in words.

    >>> _ratio(0.99), _ratio(1.107), _ratio(50.0)
    ('1.0% less power than', '10.7% more power than', '50 times the power of')
    """
    if times > 10.0:
        return f"{times:.3g} times the power of"
    return f"{abs(times - 1.0):.1%} {'less' if times <= 1.0 else 'more'} power than"


SAME = 0.01
"""Share of the power below which two blades are equals: far below the band of either [1]."""


def _beside(d: Design, gain: float) -> str:
    """The blade beside the best propeller on sale, up to the kind of that."""
    assert d.label is not None
    name = d.label.name
    if abs(gain) <= SAME:
        return f"No better than a {name} ({_ratio(1.0 + gain).removesuffix(' than')}), the best "
    return f"{_ratio(1.0 + gain).capitalize()} a {name} at the speed that suits it, the best "


def _label_breaks(d: Design) -> str:
    """Limits that the propeller on sale does not keep, as a sentence."""
    assert d.label is not None
    what = {
        "stress": f"break in {d.need.limits.material.name.upper()}",
        "stall margin": "have less in hand before the stall",
        "tip Mach": "turn too fast",
    }
    words = [what.get(w.partition(" (")[0], w) for w in d.label_breaks]
    return f"The {d.label.name} would {' and '.join(dict.fromkeys(words))}." if words else ""


def _bought(d: Design) -> list[str]:
    """What the design buys over the best label, and how far the ideal is."""
    kind = (
        "blade of constant pitch in this duct" if d.ducted else f"standard label up to {2.0 * d.need.R / INCH:.4g} in"
    )
    lines = []
    if d.same_speed is None and not d.ducted and all(p.rpm is not None for p in d.need.points if p.weight > 0.0):
        lines.append(f"at the speed asked for, no {kind} reaches the thrust")
    if d.label is None:
        lines.append(f"no {kind} does this at any speed within the tip Mach number")
    else:
        gain = d.mean_W / d.label.mean_W - 1.0
        lines.append(f"{_beside(d, gain)}{kind}. {_label_breaks(d)}".rstrip())
        if gain > 0.0 and any(p.rpm is not None for p in d.need.points):
            lines.append("leave the rpm out, and the speed is found too")
    ideal, name = (d.disk_W, "ideal disk") if math.isnan(d.betz_W) else (d.betz_W, "best blade without drag")
    lines.append(f"{_ratio(d.mean_W / ideal)} the {name}, which no real blade reaches")
    least = min(d.values.thrust_N / [p.thrust_N for p in d.need.points])
    if least > MUCH:
        lines.append(f"{least:.3g} times the thrust asked for: at this speed less of it takes no less power. "
                     "Try a smaller diameter or less rpm")  # fmt: skip
    return lines


def document(d: Design) -> dict[str, Any]:
    """Plain values, ``bemt.design/1``."""
    v, need = d.values, d.need
    r, chord, beta = d.found.problem.shape.table(d.found.best)
    return {
        "schema": SCHEMA, "name": d.name, "diameter_in": 2.0 * need.R / INCH, "blades": need.blades,
        "converged": d.found.converged, "steps": d.found.steps,
        "limits": {"min_chord_mm": 1e3 * need.limits.min_chord_m, "min_thickness_mm": 1e3 * need.limits.min_thickness_m,
                   "max_tip_mach": need.limits.max_tip_mach, "stall_margin": need.limits.stall_margin,
                   "material": need.limits.material.name, "safety": need.limits.safety},
        "active": d.active, "thickness": None if d.thickness is None else list(d.thickness),
        "points": [
            {"thrust_N": float(v.thrust_N[k]), "asked_N": p.thrust_N, "airspeed_m_s": p.airspeed_m_s,
             "rpm": float(v.rpm[k]), "weight": p.weight, "power_W": float(v.power_W[k]),
             "u_thrust_N": d.bands[k].u_thrust_N, "u_power_W": d.bands[k].u_power_W,
             "tip_mach": _mach(d, float(v.rpm[k]), p.airspeed_m_s, need.R),
             "stress_MPa": float(np.nanmax(v.stress_Pa[k])) / 1e6}
            for k, p in enumerate(need.points)
        ],
        "mean_power_W": d.mean_W, "disk_W": d.disk_W, "betz_W": None if math.isnan(d.betz_W) else d.betz_W,
        "label": None if d.label is None else {
            "name": d.label.name, "rpm": d.label.rpm.tolist(), "power_W": d.label.power_W.tolist(),
            "mean_power_W": d.label.mean_W, "breaks": list(d.label_breaks),
            "bands": [vars(b) for b in d.label_bands]},
        "same_speed": None if d.same_speed is None else {
            "name": d.same_speed.name, "rpm": d.same_speed.rpm.tolist(), "thrust_N": d.same_speed.thrust_N.tolist(),
            "power_W": d.same_speed.power_W.tolist()},
        "robust": None if d.robust is None else {"this": vars(d.robust[0]), "drawn": vars(d.robust[1])},
        "stations": {"r_over_R": r.tolist(), "chord_over_R": chord.tolist(), "beta_deg": np.degrees(beta).tolist()},
    }  # fmt: skip


def write(d: Design, folder: str | Path) -> Path:
    """Write case, document and picture into a new folder; the document last."""
    drawn = picture(d)
    out = d.write(folder)
    write_atomic(out / RESULTS[1], drawn)
    write_atomic(out / RESULTS[0], json_text(document(d)))
    return out
