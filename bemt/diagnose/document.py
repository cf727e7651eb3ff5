"""The answer as a document ``bemt.diagnosis/1`` and as the lines an engineer would say."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt import __version__, effects
from bemt.base.tables import text_table
from bemt.diagnose import fit as fitting
from bemt.diagnose.confusion import nearest
from bemt.diagnose.explanation import NONE, UNKNOWN, Explanation
from bemt.diagnose.locate import bare
from bemt.diagnose.verdict import inclusion

if TYPE_CHECKING:
    from bemt.diagnose.chain import Diagnosis
    from bemt.diagnose.locate import Location

__all__ = ["SCHEMA", "document", "explanation", "text"]

SCHEMA = "bemt.diagnosis/1"

_CHANNEL = {"thrust_N": "Thrust", "torque_Nm": "Torque", "rpm": "Speed of rotation"}
_VARIABLE = {
    "J": ("advance ratio", "", 2), "M_tip": ("tip Mach number", "", 2), "Re": ("Reynolds number", "", 0),
    "rpm": ("speed of rotation", " rev/min", 0), "time_s": ("time", " s", 0), "temperature_K": ("temperature", " K", 1),
    "wall_distance_m": ("wall distance", " m", 3), "tip_gap_m": ("tip gap", " m", 5), "voltage_V": ("voltage", " V", 2),
    "current_A": ("current", " A", 1), "sideslip_rad": ("sideslip", " rad", 2),
    "density_kg_m3": ("density", " kg/m3", 3),    "pwm_s": ("pulse width", " s", 6), "run": ("run", "", 0),
}  # fmt: skip
_SHOWN = 8
_FINDINGS = 3
# All loads off the case by more than this share: first the question whether it is the rotor of the case.
_ANOTHER_ROTOR = 0.25
# Level that is said even where no cause shows.
_WORTH_SAYING = 0.05


def _number(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


def document(d: Diagnosis) -> dict[str, Any]:
    """Give the document.

    Parameters
    ----------
    d : Diagnosis
        The answer.

    Returns
    -------
    dict
        Fit for JSON, schema ``bemt.diagnosis/1``.
    """
    found = d.found
    ranking = []
    for name, p in sorted(found.probability.items(), key=lambda kv: -kv[1])[:12]:
        parameters = fitting.intervals(found, name) if name and p > 1e-3 else {}
        if name == d.decision.leading:
            parameters = d.parameters
        flat = {(f"{i}.{k}" if name.pair else k): v for i, q in parameters.items() for k, v in q.items()}
        ranking.append({"effect": str(name), "probability": p, "parameters": flat})
    state = found.states[0]
    return {
        "schema": SCHEMA,
        "version": __version__,
        "verdict": d.decision.verdict,
        "effects": list(d.decision.effects),
        "probability": d.decision.probability,
        "ranking": ranking,
        "inclusion": {k: v for k, v in inclusion(found).items() if v > 1e-3},
        "location": d.where.document(),
        "fit": {c: {k: _number(v) for k, v in s.items()} for c, s in d.scores.items()},
        "blocks": d.blocks,
        "classes": [list(c) for c in d.decision.classes] or d.alike.classes(),
        "next_measurement": {"text": "", "points": [], "separates": []} if d.next is None else d.next.document(),
        "p_value": d.p_value,
        "log_bayes": {str(e): found.log_bayes(e) for e in (*map(Explanation.of, found.spans), UNKNOWN)},
        "nearest_signature": nearest(found),
        "visibility": {i: float(s) for i, s in zip(d.alike.ids, d.alike.size, strict=True)},
        "covariance": {"noise_scale": state.hyper.scale, "correlation": state.hyper.ar,
                       "solver_error": state.hyper.model},
        "baseline": [effects.to_text(e) for e in d.problem.baseline],
        "not_tried": dict(d.absent),
        "rule": d.decision.why,
        "left_over": _number(d.decision.left_over),
        "findings": list(d.problem.findings),
        "notes": list(d.problem.notes),
        "readings": int(d.problem.y.size),
        "explanation": " ".join(explanation(d)),
    }  # fmt: skip


def _where(w: Location) -> str:
    name, unit, digits = _VARIABLE.get(w.variable, (w.variable, "", 3))
    sign = "high" if w.size > 0 else "low"
    both = f"{w.low:.{digits}f} to {w.high:.{digits}f}{unit}" if w.high > w.low else f"{w.low:.{digits}f}{unit}"
    error = abs(w.size / w.z) if w.z else float("nan")
    spread = "" if not np.isfinite(error) else f" +- {max(error, 1e-4):.1%}"
    return f"{_CHANNEL[w.channel]} is {sign} by {abs(w.size):.1%}{spread} of the model's mean at {name} {both}."


def _unexplained(d: Diagnosis) -> list[str]:
    """What the recording shows, and, where it is another thing, what calibration would leave of it.

    The location of the document is what remains in the light of the likeliest explanation. Where none is given, its
    sign and even its channel may be those of something that the recording does not show.
    """
    seen, rest = bare(d.found), d.where
    lines = [_where(seen)]
    if (seen.channel, seen.size > 0) != (rest.channel, rest.size > 0):
        words = _where(rest)
        lines.append(f"Beyond what gains, blade angles and the solver may be: {words[0].lower()}{words[1:]}")
    return lines


def _gain(d: Diagnosis) -> str:
    words = []
    for channel, s in d.scores.items():
        mean = s["mean"] or 1.0
        words.append(
            f"{_CHANNEL[channel].lower()} {s['holdout_before'] / mean:.1%} to {s['holdout_after'] / mean:.1%} "
            f"(noise {s['noise'] / mean:.1%}, smooth curve without physics {s['gp_only'] / mean:.1%})"
        )
    return f"Error on held-out {d.blocks}: " + "; ".join(words) + "."


def _parameters(d: Diagnosis) -> str:
    words = []
    for i, found in d.parameters.items():
        for k, v in found.items():
            if isinstance(v["value"], float):
                unit = "" if v["unit"] in ("1", "") else f" {v['unit']}"
                words.append(f"{i} {k} {v['value']:.3g} ({v['low']:.3g} to {v['high']:.3g}){unit}")
            elif v["value"] is not None:
                words.append(f"{i} {k} {v['value']}")
    return ", ".join(words)


def explanation(d: Diagnosis) -> list[str]:
    """Say the answer in a few sentences.

    Parameters
    ----------
    d : Diagnosis
        The answer.

    Returns
    -------
    list of str
        About five lines.
    """
    decision, catalogue = d.decision, effects.catalogue()
    lines = [f"Before any physics: {f}" for f in d.problem.findings[:_FINDINGS]]
    level = d.problem.level
    off = " and ".join(f"{_CHANNEL[c].lower()} by {v:+.0%}" for c, v in level.items())
    if not lines and level and min(abs(v) for v in level.values()) > _ANOTHER_ROTOR:
        lines.append(f"Before any physics: off the case {off}. Are diameter, pitch and blades those of this rotor?")
    if len(d.problem.findings) > _FINDINGS:
        lines[-1] += f" And {len(d.problem.findings) - _FINDINGS} more; `import` shows all."
    if decision.verdict == "none":
        lines.append(f"No mismatch beyond noise and calibration: {decision.why} (p = {d.p_value:.2g}).")
        if max((abs(v) for v in level.values()), default=0.0) > _WORTH_SAYING:
            lines.append(f"The level is off ({off}), which gains, blade angles and the solver may be; no cause shows.")
        return [*lines, _gain(d), *_next(d, "To see more")]
    lines += _unexplained(d) if decision.verdict in ("unknown", "insufficient") else [_where(d.where)]
    names = " and ".join(catalogue[i].title for i in decision.effects)
    if decision.verdict in ("named", "sensor"):
        lead = "Not the air but the stand" if decision.verdict == "sensor" else "Left out"
        told = _parameters(d)
        lines.append(f"{lead}: {names} ({decision.probability:.2f})." + (f" {told}." if told else ""))
        signs = [catalogue[i].sign for i in decision.effects if catalogue[i].sign]
        if signs:
            lines.append("Because: " + "; ".join(signs) + ".")
    elif decision.verdict == "class":
        lead = "One of these, which this plan cannot tell apart" if decision.classes else decision.why.capitalize()
        lines.append(f"{lead} ({decision.probability:.2f}): "
                     + ", ".join(f"{i} ({catalogue[i].title})" for i in decision.effects) + ".")  # fmt: skip
    elif decision.verdict == "unknown":
        kernel = d.found.states[0].best_rival
        lines.append(f"Something that is not in the library: {decision.why}. It looks like {kernel}.")
    else:
        lines.append(f"There is a mismatch (p = {d.p_value:.2g}), but {decision.why}.")
    lines.append(_gain(d))
    others = [i for group in decision.classes for i in group if i not in decision.effects]
    if others:
        lines.append(f"Cannot be told from: {', '.join(others)}.")
    lines += _next(d, "To be sure")
    return [line for line in lines if line]


def _next(d: Diagnosis, lead: str) -> list[str]:
    if d.next is None or not d.next.text:
        return []
    return [f"{lead}: {d.next.text} (separates {' from '.join(d.next.separates)}: {d.next.before:.1f} to "
            f"{d.next.after:.1f} standard deviations)."]  # fmt: skip


def text(d: Diagnosis) -> str:
    """Lines, and the tables behind them.

    Parameters
    ----------
    d : Diagnosis
        The answer.

    Returns
    -------
    str
        For a terminal.
    """
    found = d.found
    out = [f"verdict: {d.decision.verdict}" + (f" {', '.join(d.decision.effects)}" if d.decision.effects else "")]
    out += [textwrap.fill(line, 110, initial_indent="  ", subsequent_indent="    ") for line in explanation(d)]
    size = dict(zip(d.alike.ids, d.alike.size, strict=True))
    rows = []
    for name, p in sorted(found.probability.items(), key=lambda kv: -kv[1])[:_SHOWN]:
        seen = f"{size[str(name)]:.1f}" if str(name) in size else "-"
        rows.append([str(name), f"{p:.3f}", f"{found.log_bayes(name):.1f}" if name != NONE else "0.0", seen])
    out += [
        "",
        text_table(
            ["explanation", "probability", "ln odds over none", "size in this plan"], rows, left=(0,), indent="  "
        ),
    ]
    kinds = ("before", "after", "noise", "holdout_before", "holdout_after", "gp_only")
    rows = [[c, *(f"{s[k] / s['mean']:.2%}" for k in kinds)] for c, s in d.scores.items()]
    header = ["RMSE over mean reading", "before", "after", "noise", "held out: before", "after", "smooth curve only"]
    out += ["", text_table(header, rows, left=(0,), indent="  ")]
    h = found.states[0].hyper
    out.append(f"\n  p = {d.p_value:.3g}; noise x{h.scale:g} of stated, correlation {h.ar:g}, "
               f"solver error {h.model:.0%}; {d.problem.y.size} readings")  # fmt: skip
    out += [f"  note: {note}" for note in d.problem.notes]
    return "\n".join(out)
