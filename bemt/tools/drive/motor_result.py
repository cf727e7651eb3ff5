"""The torque constant by three methods, whether they agree, and why not."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.tables import csv_text, json_text, number_text, text_table, write_atomic
from bemt.tools.drive import motor_errors, motor_file, outputs, picture
from bemt.tools.drive.motor_constant import Line

RESULTS = ("motor.json", "trials.csv", "motor.png")
TITLES = {"data_sheet": "data sheet", "back_emf": "back-EMF", "torque": "torque sensor"}


def _method(name: str, line: Line, u_gain: float, to_kt: float) -> dict[str, Any]:
    mean, u = line.slope, math.hypot(math.sqrt(line.cov[0, 0]), u_gain * line.slope)
    return {
        "method": name,
        "n": len(line.slopes),
        "mean": mean * to_kt,
        "u": u * to_kt,
        "sigma3": 3.0 * line.sd * to_kt,
        "interval95": [(mean - 1.96 * u) * to_kt, (mean + 1.96 * u) * to_kt],
        "intercept": line.intercept,
        "u_intercept": float(math.sqrt(line.cov[1, 1])),
        "trials": [float(v) * to_kt for v in line.slopes],
    }


def document(trials: motor_file.MotorTrials, verdict: motor_errors.Verdict) -> dict[str, Any]:
    """All results as a JSON document."""
    m, to = trials.measured, trials.to_kt
    methods: list[dict[str, Any]] = []
    if m.data_sheet is not None:
        u = m.u_data_sheet * to
        interval = [m.data_sheet * to - 1.96 * u, m.data_sheet * to + 1.96 * u]
        methods.append({"method": "data_sheet", "n": 1, "mean": m.data_sheet * to, "u": u, "sigma3": math.nan,
                        "interval95": interval, "intercept": math.nan, "u_intercept": math.nan,
                        "trials": []})  # fmt: skip
    if m.back_emf is not None:
        methods.append(_method("back_emf", m.back_emf, m.u_gain_back_emf, to))
    if m.torque is not None:
        methods.append(_method("torque", m.torque, math.hypot(m.u_gain_torque, m.u_shunt), to))
    best = verdict.none if verdict.agree else verdict.explanations[0] if len(verdict.explanations) == 1 else None
    explained = [
        {"errors": list(e.names), "sizes": list(e.sizes), "u_sizes": list(e.u_sizes), "Kt": e.ke * to,
         "u_Kt": e.u_ke * to, "chi2": e.chi2, "p": e.p} for e in verdict.explanations
    ]  # fmt: skip
    return {
        "schema": "bemt.motor.result/1", "name": trials.name, "data": trials.data, "convention": trials.convention,
        "methods": methods, "agree": verdict.agree, "p_of_agreement": verdict.none.p, "explanations": explained,
        "named": list(verdict.named), "Kt": best.ke * to if best else None, "u_Kt": best.u_ke * to if best else None,
        "stated": dict(trials.stated), "notes": list(trials.notes),
    }  # fmt: skip


_UNITS = {
    "back_emf.offset": "V",
    "torque.offset": "N m",
    "torque.shunt": "times the resistor assumed",
    "data_sheet.gain": "times",
    "back_emf.gain": "times",
    "torque.gain": "times",
}


def verdict_text(made: dict[str, Any]) -> list[str]:
    """The verdict in words."""
    if made["agree"]:
        return [f"the methods agree (p = {made['p_of_agreement']:.2g}); this does not exclude an error common to all"]
    lines = [f"the methods do not agree (p = {made['p_of_agreement']:.1g})"]
    if not made["explanations"]:
        return [*lines, "no offset, resistor, convention factor or gain, nor any pair of them, explains it"]
    for e in made["explanations"]:
        parts = []
        for name, size, u in zip(e["errors"], e["sizes"], e["u_sizes"], strict=True):
            if u:
                parts.append(f"{name} {size:.4g} ± {1.96 * u:.2g} {_UNITS.get(name, '')}".rstrip())
            else:
                parts.append(f"{name}: its value is {size:.4g} times too large")
        lines.append(f"explained by {' and '.join(parts)}: K_t = {e['Kt']:.4f} ± {1.96 * e['u_Kt']:.1g} N m/A")
    if len(made["explanations"]) > 1:
        lines.append("these explain the trials equally well; the trials cannot distinguish them, so none is named")
    if any(name.endswith("gain") for e in made["explanations"] for name in e["errors"]):
        lines.append("a gain error is not an offset, resistor or convention error: look for a wrong calibration")
    if any("torque.offset" in e["errors"] for e in made["explanations"]):
        lines.append(
            "a torque offset is the zero of the sensor, friction or cogging: the trials alone do not show which"
        )
    return lines


def text(trials: motor_file.MotorTrials, made: dict[str, Any]) -> str:
    """Lay the results out for a terminal."""
    rows = []
    for m in made["methods"]:
        low, high = m["interval95"]
        interval = f"{low:.5f} to {high:.5f}" if math.isfinite(low) else "unknown"
        zero = f"{m['intercept']:.3g} ± {1.96 * m['u_intercept']:.2g}" if math.isfinite(m["intercept"]) else "-"
        unit = {"back_emf": " V", "torque": " N m"}.get(m["method"], "")
        rows.append([TITLES[m["method"]], str(m["n"]), number_text(m["mean"]), number_text(m["sigma3"], 3), interval,
                     zero + unit])  # fmt: skip
    head = ["method", "trials", "K_t [N m/A]", "3 sigma", "95 % of the mean", "intercept"]
    lines = [trials.name + (f" ({trials.data})" if trials.data else ""), trials.convention, text_table(head, rows)]
    lines += [f"stated: {name} {value:.4f}" for name, value in made["stated"].items()]
    lines += verdict_text(made)
    if made["Kt"] is not None:
        lines.append(f"K_t = {made['Kt']:.5f} ± {1.96 * made['u_Kt']:.2g} N m/A (95 %)")
    return "\n".join(lines + [f"! {note}" for note in made["notes"]]) + "\n"


def judge(file: str, out: str | None = None) -> tuple[motor_file.MotorTrials, dict[str, Any]]:
    """Read trials and judge them: what was read, and ``bemt.motor.result/1``; written where told, over no input."""
    trials = motor_file.read(file)
    if out:
        outputs.check("--out", Path(out), RESULTS, trials.files)
    made = document(trials, motor_errors.judge(trials.measured))
    if out:
        folder = Path(out)
        write_atomic(folder / "motor.json", json_text(made))
        rows = [
            {"method": m["method"], "trial": t, "Kt_Nm_A": v}
            for m in made["methods"]
            for t, v in enumerate(m["trials"] or [m["mean"]], 1)
        ]
        write_atomic(folder / "trials.csv", csv_text(["method", "trial", "Kt_Nm_A"], rows))
        title = f"{trials.name}: {trials.data}" if trials.data else trials.name
        values = {TITLES[m["method"]]: np.array(m["trials"] or [m["mean"]]) for m in made["methods"]}
        png = picture.box_plot(values, trials.stated, "torque constant [N m/A]", title)
        write_atomic(folder / "motor.png", png)
    return trials, made
