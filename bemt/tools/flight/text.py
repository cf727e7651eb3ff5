"""The answer on a flight as text: what is wrong, what this flight shows, constants, and what it cannot show."""

from __future__ import annotations

import numpy as np

from bemt.tools.flight.answer import FlightAnswer
from bemt.tools.flight.decision import BESIDE_IT, Decision
from bemt.tools.flight.identify import Constant
from bemt.tools.flight.judge import FlightVerdict
from bemt.tools.flight.rules import IN_FLIGHT

_OFTEN = 0.005  # share of the time at full command that is worth a word [1]


def text(a: FlightAnswer) -> str:
    """One screen."""
    log, j = a.log, a.judged
    seconds = log.flying.mean() * np.ptp(log.t)
    lines = [f"{log.file}: {log.format}, {log.rotors} rotors, {seconds:.1f} s in the air"]
    if log.ends:
        lines.append(f"  {log.ends}")
    lines += ["", f"{headline(j)}: {j.said.why}."]
    if j.healthy:
        low, high = j.rate95
        lines.append(
            f"  Error rate: {j.accused} of {j.healthy} healthy flights accused when each is judged by the others "
            f"(95 %: {100 * low:.0f} to {100 * high:.0f} %)."
        )
    if np.isfinite(j.visible):
        against = "against these healthy flights" if j.given else "without healthy flights of this vehicle"
        lines.append(f"  A damaged rotor shows from a change of its drive by {100 * j.visible:.0f} %, {against}.")
    if j.said.verdict == "none" and j.healthy:
        lines.append("  Not visible in this log: smaller damage; tape and imbalance without fast accelerometer data.")
    if j.said.verdict == "none" and np.isfinite(j.total_half) and abs(j.total) > j.total_half:
        lines.append(f"  Total drive {100 * j.total:+.1f} % against healthy flights (they differ by "
                     f"±{100 * j.total_half:.1f} %): weight at the centre, battery, air, or damaged "
                     "rotors that balance each other.")  # fmt: skip
    lines += [f"  Next: {j.next.text}."] if j.next.text else []
    lines += _seen(a)
    lines += ["", "Identified (± 95 %)"] if a.found.constants else []
    lines += [f"  {name:<34} {_number(c)}" for name, c in a.found.constants.items()]
    lines += [f"  {name:<34} {', '.join(_figures(v, 4) for v in values)}" for name, values in a.found.rotors.items()]
    if a.mass is not None:
        lines.append(f"  {'mass, from the healthy flights':<34} {_number(a.mass)}")
    if a.predicted is not None:
        k, u = a.predicted.constant, a.predicted.u
        lines.append(f"  {'thrust constant of the case':<34} {k:.4g} ± {2 * u:.2g} N/rpm^2 (two standard deviations)")
    lines += _flow(a)
    if a.simulator:
        lines += ["", "For a simulator (± 95 %; thrust: of another flight of this vehicle)"]
        lines += [f"  {name:<34} {_number(c)}" for name, c in a.simulator.items()]
    lines += ["", "Not visible here"] if a.unseen else []
    lines += [f"  {u}" for u in a.unseen]
    return "\n".join(lines)


def _seen(answer: FlightAnswer) -> list[str]:
    """Lines on what this flight alone shows."""
    lines, shares = [], answer.found.rotors.get("mean command", answer.found.rotors.get("share of rpm^2", ()))
    if shares:
        mean = sum(shares) / len(shares)
        each = ", ".join(f"{i + 1}: {100 * (v / mean - 1.0):+.0f} %" for i, v in enumerate(shares))
        lines.append(f"  Drive of each motor against their mean: {each}.")
    if len(answer.balance) == 3:
        pairs = (("left", "right"), ("front", "rear"), ("left-turning", "right-turning"))
        parts = [
            f"{a if b > 0 else c} by {100 * abs(b):.0f} %" for (a, c), b in zip(pairs, answer.balance, strict=True)
        ]
        lines.append(f"  Driven harder: {', '.join(parts)} (centre of mass; trim in yaw).")
    full = [f"motor {i + 1} {100 * v:.1f} %" for i, v in enumerate(answer.limited) if v > _OFTEN]
    if full:
        lines.append(f"  At full command: {', '.join(full)} of the time.")
    c, shake = answer.change, answer.vibration
    if c is not None and answer.judged.said.rule != IN_FLIGHT:
        when = f"At {c.at_s:.1f} s" if c.kind == "step" else "Steadily over the flight"
        lines.append(f"  {when} the balance changed by {100 * c.size:.0f} ± {100 * c.half:.0f} % drive, as by: "
                     f"{', '.join(c.causes)}.")  # fmt: skip
    for k, part in answer.speeds:
        what = "a lighter load: a damaged blade" if part > 0.0 else "a weak motor, bearing or controller"
        lines.append(f"  Motor {k + 1} turns {100 * part:+.0f} % against its drive in healthy flights: {what}.")
    for k, ratio, known in answer.shaken:
        against = "in healthy flights" if known else "the other rotors"
        who = f"Motor {k + 1} shakes" if k >= 0 else "The rotors together shake"
        lines.append(f"  {who} {ratio:.1f} times as much as {against} at the shaft frequency: "
                     "imbalance, tape or a damaged blade.")  # fmt: skip
    heard = [f"{i + 1}: {v:.2g}" for i, v in enumerate(shake.amplitude) if np.isfinite(v)]
    if heard:
        lines.append(f"  Vibration once a turn ({shake.shaft_hz:.0f} Hz): {', '.join(heard)} {shake.unit}.")
    elif np.isfinite(shake.line):
        lines.append(f"  Strongest vibration: {shake.line:.2g} {shake.unit} at {shake.line_hz:.0f} Hz.")
    if np.isfinite(answer.wind.speed):
        w = answer.wind
        seen = "Wind" if w.speed > w.half else "No wind seen:"
        lines.append(f"  {seen} {w.speed:.1f} ± {w.half:.1f} m/s towards {w.heading_deg:.0f} deg from x.")
    return lines


def _flow(a: FlightAnswer) -> list[str]:
    """Lines on thrust in moving air, with the model's own where there is a case."""
    flow, said, lines = a.inflow, a.predicted, []
    if flow is None:
        return []
    for name, got, at, model in (
        (
            "thrust at {:+.1f} m/s along the axis",
            flow.axial,
            flow.axial_m_s[1],
            None if said is None else said.axial,
        ),
        (
            "thrust at {:.1f} m/s in the plane",
            flow.inplane,
            flow.inplane_m_s,
            None if said is None else said.inplane,
        ),
    ):
        if got is not None:
            more = "" if model is None else f"; model {100 * np.interp(at, *model):+.1f} %"
            what = f"{100 * got[0]:+.1f} ± {100 * got[1]:.1f} % at equal speed of the rotors{more}"
            lines.append(f"  {name.format(at):<34} {what}")
    return lines


def _number(c: Constant) -> str:
    return f"{_figures(c.value, 4)} ± {_figures(c.half, 2)} {'' if c.unit == '1' else c.unit}".rstrip()


def _figures(value: float, count: int) -> str:
    """A number with so many significant figures, without an exponent where it is short enough."""
    rounded = float(f"{value:.{count}g}")
    plain = 1e-3 <= abs(rounded) < 1e6
    return np.format_float_positional(rounded, trim="-") if plain else f"{value:.{count}g}"


def headline(j: FlightVerdict) -> str:
    """What is wrong, without the reason."""
    said = j.said
    found = j.found.get(said.leading)
    size = ""
    sized = said.rule != IN_FLIGHT and any(i in said.leading for i in said.effects)
    if found is not None and found.size and sized:
        size = f" ({100 * found.size:+.0f} ± {100 * found.half:.0f} % drive)"
    if said.rule == BESIDE_IT:
        return f"Cause found: {said.effects[0]}{size}; possibly also {' or '.join(said.effects[1:])}"
    words = {
        "none": "No cause found",
        "named": f"Cause found: {' and '.join(said.effects)}{size}",
        "class": f"One of these: {_open(said)}{size}",
        "unknown": "Something unlisted",
        "insufficient": "Cannot tell",
    }
    return words[said.verdict]


def _open(said: Decision) -> str:
    """Members of a class; of two at work, each with its look-alikes."""
    if len(said.sets) > 1:
        return "; with one of: ".join(" or ".join(s) for s in said.sets)
    return " or ".join(said.effects)
