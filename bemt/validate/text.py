"""The document of ``bemt.validation/1`` as a table for people."""

from __future__ import annotations

from typing import Any


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
