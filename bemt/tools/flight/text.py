"""The answer on a flight as text: what is wrong, what this flight shows, constants, and what it cannot show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bemt.base.tables import number_text
from bemt.judge.loss import Decision
from bemt.tools.flight.answer import FlightAnswer
from bemt.tools.flight.balance import BLADE, WEIGHT, WIDE
from bemt.tools.flight.change import FlightEvidence
from bemt.tools.flight.identify import Constant
from bemt.tools.flight.judge import FlightVerdict
from bemt.tools.flight.log import SpeedSensor
from bemt.tools.flight.vibration import STATED_MOST, Vibration
from bemt.tools.flight.wind import BREEZE

_OFTEN = 0.005  # share of the time at full command that is worth a word [1]
_WORDS = {WIDE: "another spread between flights than usual"}


def text(a: FlightAnswer, details: bool = False) -> str:
    """Three lines for the pilot, what this flight shows, and with `details` the constants."""
    log, j = a.log, a.judged
    lines = [*pilot(a), ""]
    if log.rotors:
        seconds = log.flying.mean() * np.ptp(log.t)
        lines.append(f"{log.file}: {log.format}, {log.rotors} rotors, {seconds:.1f} s in the air")
    else:
        count = f"{log.stated_rotors} rotors by its parameters, " if log.stated_rotors else ""
        lines.append(f"{log.file}: {log.format}, {count}{np.ptp(log.t):.1f} s, no output of a motor")
    if log.ends:
        lines.append(f"  {log.ends}")
    if log.mixed:
        lines.append(f"  No output of a motor was logged: its commands follow from the demands in {log.mixed}.")
    lines.append(f"  {headline(j)}: {j.said.why}.")
    if j.healthy:
        low, high = j.rate95
        by = f"by the other sessions of {j.sessions}" if j.sessions > 1 else "by the others"
        lines.append(f"  Error rate: {j.accused} of {j.healthy} healthy flights accused when each is judged {by} "
                     f"(95 %: {100 * low:.0f} to {100 * high:.0f} %).")  # fmt: skip
    if j.given and j.sessions < 2:
        lines.append("  The healthy flights count as one session: what changes from day to day (1.2 to 3.1 % of a "
                     "rotor's drive, on other vehicles) they cannot show.")  # fmt: skip
    if np.isfinite(j.visible):
        against = "against these healthy flights" if j.given else "without healthy flights of this vehicle"
        lines.append(f"  A damaged rotor shows from a change of its drive by {100 * j.visible:.0f} %, {against}.")
    if j.said.verdict == "none" and j.healthy:
        lines.append("  Not visible in this log: smaller damage; tape and imbalance without fast accelerometer data.")
    lines += _seen(a)
    if details:
        return "\n".join(lines + _details(a))
    # Who states the mass asks for the constants.
    weighed = [] if any(c.unit.endswith("/kg") for c in a.simulator.values()) else _constants(a)
    more = "More constants" if weighed else "Constants"
    lines += [*weighed, "", f"{more}, and what the log cannot show: --details, --json."]
    return "\n".join(lines)


def _details(a: FlightAnswer) -> list[str]:
    """Constants, and what is missing."""
    lines = ["", "Identified (± 95 %)"] if a.found.constants else []
    lines += [f"  {name:<34} {_number(c)}" for name, c in a.found.constants.items()]
    lines += [f"  {name:<34} {', '.join(number_text(v, 4) for v in values)}" for name, values in a.found.rotors.items()]
    if a.mass is not None:
        lines.append(f"  {'mass, from the healthy flights':<34} {_number(a.mass)}")
    if a.predicted is not None:
        k, u = a.predicted.constant, a.predicted.u
        lines.append(f"  {'thrust constant of the case':<34} {k:.4g} ± {2 * u:.2g} N/rpm^2 (two standard deviations)")
    lines += _flow(a)
    lines += _constants(a)
    lines += ["", "Not visible here"] if a.unseen else []
    return lines + [f"  {u}" for u in a.unseen]


def _constants(a: FlightAnswer) -> list[str]:
    """What goes into an autopilot and a simulator."""
    lines = []
    if a.curve:
        lines += ["", "For the autopilot (± 95 %; throttle after its thrust curve, as a share of full thrust)"]
        lines += [f"  {name:<34} {_number(c)}" for name, c in a.curve.items()]
    if a.simulator:
        lines += ["", "For a simulator (± 95 %; thrust: of another flight of this vehicle; command before that curve)"]
        lines += [f"  {name:<34} {_number(c)}" for name, c in a.simulator.items()]
    return lines


def pilot(a: FlightAnswer) -> list[str]:
    """Where to look, what else is certain or how small a damage would show, and the next step."""
    no = "Do not fly it as it is: it shakes more than an autopilot can take. " if a.vibration.high else ""
    return [f"{no}{_look(a)}{_in_wind(a)}", _second(a), f"Next: {a.judged.next.text or 'nothing'}."]


def _in_wind(a: FlightAnswer) -> str:
    """Wind that is sure and moves the trim."""
    w = a.wind
    return f" There was wind, {w.speed:.1f} ± {w.half:.1f} m/s." if w.sure and w.speed > BREEZE else ""


def _second(a: FlightAnswer) -> str:
    """The first of the other things that can be told of a flight."""
    j, log, level = a.judged, a.log, _level(a.vibration)
    if log.sensors:
        return " ".join(f"{sensor_text(s)}: look at the sensor. Its readings were repaired." for s in log.sensors)
    if a.vibration.high:
        return level
    if not log.rotors:
        return level or "Nothing else in it tells of the motors."
    if j.said.verdict == "none" and np.isfinite(j.visible):
        return f"Damage shows here once it changes a rotor's drive by {100 * j.visible:.0f} %."
    if j.given and a.days.day == "" and j.said.verdict != "insufficient":
        return "Of the same day as the healthy flights? Say so (--healthy-day): days move the drives by 1 to 3 %."
    if level:
        return level
    if j.given and j.readings.size:
        order = sorted(range(j.readings.size), key=lambda k: -abs(float(j.readings[k])))[:2]
        most = ", ".join(f"motor {k + 1} {_signed(float(j.readings[k]))}" for k in order)
        return f"Against the mean of all motors, drives changed most from the healthy flights at {most}."
    if np.isfinite(j.visible):
        return f"One flight alone shows damage once it changes a rotor's drive by {100 * j.visible:.0f} %."
    return f"{headline(j)}: {j.said.why}."


_SIGNS = {
    "imbalance": "it shakes more than in the healthy flights. Tape, dirt or a damaged blade would do this.",
    "weak motor": "it turns slower than its command. A weak motor, bearing or controller would do this.",
}
"""What a rotor shows by itself."""


def _look(a: FlightAnswer) -> str:
    """What is wrong, in a sentence of a mechanic."""
    j, said = a.judged, a.judged.said
    if said.verdict == "none" and j.total_moved:
        return _together(a)
    if said.verdict == "none":
        return "Nothing to look at: the motors share the work as in the healthy flights."
    if not said.effects:
        why = said.why[:1].upper() + said.why[1:]
        known = said.verdict != "unknown"
        return f"No verdict: {said.why}." if known else f"{why}: check arms, motor tilt and propellers."
    first, rest = said.effects[0], [*said.effects[1:]]
    for sign, words in _SIGNS.items():
        if first.startswith(sign):
            return f"Look at {first.rpartition(', ')[2]}: {words}"
    if first.startswith(BLADE):
        return _blades(a, first, rest)
    if not first.startswith(WEIGHT):
        return f"No motor stands out: {_alternatives(said.effects)} would do this."
    where = first.removeprefix(WEIGHT)
    more = f"{_alternatives(rest)} would do the same." if rest else ""
    moved = f"Look where battery and payload sit: the load moved {where.replace('near', 'towards')}."
    return f"{moved} {more[:1].upper()}{more[1:]}" if more else moved


def _blades(a: FlightAnswer, first: str, rest: Sequence[str]) -> str:
    """One motor or two that work harder, and what would do this."""
    j, said = a.judged, a.judged.said
    motors = sorted({int(i.removeprefix(BLADE)) for i in said.effects if i.removeprefix(BLADE).isdigit()})
    found, size = j.found.get(said.leading), ""
    others = "in the healthy flights" if j.given else "the others"
    if found is not None and found.size and np.isfinite(found.half) and not j.in_flight:
        size = f"{100 * found.size:.0f} ± {100 * found.half:.0f} % "
    if a.change is not None and j.in_flight:
        size, others = f"{100 * a.change.size:.0f} ± {100 * a.change.half:.0f} % ", "before"
        others += f" {a.change.at_s:.1f} s" if np.isfinite(a.change.at_s) else ""
    if said.leading.pair and len(motors) > 1:
        names = " and ".join(map(str, motors[:2])) if len(motors) == 2 else ", ".join(map(str, motors))
        return f"Look at motors {names}: they work {size}or more harder than {others}. Damaged blades would do this."
    k = first.removeprefix(BLADE)
    same = ["a weight near it" if i == f"{WEIGHT}near motor {k}" else i for i in rest]
    what = _alternatives(["a damaged blade", *same])
    return f"Look at motor {k}: it works {size}harder than {others}. {what[:1].upper()}{what[1:]} would do this."


def _together(a: FlightAnswer) -> str:
    """All motors do more, or less, than in the healthy flights."""
    j, m = a.judged, a.mass
    how = "harder" if j.total > 0.0 else "less"
    why = "weight at the centre, battery, air, or damage that balances"
    if m is not None:
        why = f"with their propellers it weighs {number_text(1e3 * m.value, 3)} ± {number_text(1e3 * m.half, 2)} g"
    return f"All motors are driven {100 * abs(j.total):.0f} % {how} than in the healthy flights (they differ by " \
           f"±{100 * j.total_half:.0f} %), and share the work as there: {why}."  # fmt: skip


def _alternatives(names: Sequence[str]) -> str:
    """Causes in a row, each motor once said."""
    words = [i if i.startswith(("a ", "an ", "flights", "another", "wind", "imbalance", "weak")) else f"a {i}"
             for i in (_WORDS.get(n, n.replace(", motor ", " at motor ")) for n in names)]  # fmt: skip
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"


def _level(shake: Vibration) -> str:
    """Vibration with its number."""
    if shake.stated:
        x, y, z = shake.rms
        fine = f"above the {STATED_MOST:g} that ArduPilot accepts" if shake.high else \
               f"below {STATED_MOST:g}, which ArduPilot calls acceptable"  # fmt: skip
        return f"Vibration (VIBE) {x:.2g}, {y:.2g}, {z:.2g} m/s2 in x, y, z: {fine}."
    if shake.unit != "m/s2" or not shake.rms or not (shake.high or np.isfinite(shake.line)):
        return ""
    total = float(np.linalg.norm(shake.rms))
    known = np.isfinite(shake.shaft_hz)
    what = "once a turn" if known else "likely once a turn; no speed was logged to know"
    where = ""
    if _stands_out(shake):
        where = f"most of it at {shake.line_hz:.0f} Hz ({what}), as a rotor out of balance shakes"
    high = "too high (in PX4's rule z reaches x or y), " if shake.high else ""
    return f"Vibration {total:.2g} m/s2 root mean square above 20 Hz, {high}{where}".rstrip(", ") + "."


def _stands_out(shake: Vibration) -> bool:
    """Whether one line holds most of the vibration; it is an amplitude, the others are root mean squares."""
    return shake.line**2 / 2.0 > 0.5 * float(np.sum(np.square(shake.rms)))


def _seen(a: FlightAnswer) -> list[str]:
    """Lines on what this flight alone shows."""
    parts = (_beside_case, _drives, _moved, _by_rotor, _demanded, _heard, _along_axes, _blown)
    return [f"  {line}" for part in parts for line in part(a)]


def _beside_case(a: FlightAnswer) -> list[str]:
    """Thrust at equal speed beside that of the case; without a mass, the mass that the case would carry."""
    if a.over_case is None:
        return []
    ratio, half = a.over_case
    if a.found.constants["thrust constant"].unit.endswith("/kg"):
        carried = f"{number_text(1e3 / ratio, 3)} ± {number_text(1e3 / ratio * half, 2)} g"
        return [f"With the thrust of the case at these speeds it would weigh {carried}: --mass-kg compares them."]
    line = f"Thrust at equal speed: {100 * (ratio - 1.0):+.0f} ± {100 * ratio * half:.0f} % from the case."
    return [line, *([f"{a.other_rotor}."] if a.other_rotor else [])]


def _drives(a: FlightAnswer) -> list[str]:
    """Drive of each motor, their balance, and what limits or falsifies it."""
    lines = []
    if a.drives:
        each = ", ".join(f"{i + 1}: {_signed(v)}" for i, v in enumerate(a.drives))
        lines.append(f"Drive of each motor against their mean: {each}.")
    if len(a.balance) == 3:
        pairs = (("left", "right"), ("front", "rear"), ("left-turning", "right-turning"))
        parts = [f"{one if b > 0 else two} by {100 * abs(b):.0f} %"
                 for (one, two), b in zip(pairs, a.balance, strict=True) if abs(b) >= 0.005]  # fmt: skip
        more = f"Driven harder: {', '.join(parts)} (centre of mass; trim in yaw)."
        lines.append(more if parts else "Left and right, front and rear, and both ways of turning are driven alike.")
    full = [f"motor {i + 1} {100 * v:.1f} %" for i, v in enumerate(a.limited) if v > _OFTEN]
    if full:
        lines.append(f"At full command: {', '.join(full)} of the time.")
    return lines + [
        f"{sensor_text(s)}; repaired to ± {200 * s.u:.1f} % before any constant was fitted." for s in a.log.sensors
    ]


def _moved(a: FlightAnswer) -> list[str]:
    """A change within the flight that the answer does not say already."""
    c = a.change
    if c is None or a.judged.in_flight:
        return []
    when = f"At {c.at_s:.1f} s" if c.kind == "step" else "Steadily over the flight"
    return [f"{when} the balance changed by {100 * c.size:.0f} ± {100 * c.half:.0f} % drive, as by: "
            f"{', '.join(c.causes)}."]  # fmt: skip


def _by_rotor(a: FlightAnswer) -> list[str]:
    """Rotors that turn or shake otherwise than in healthy flights."""
    lines = []
    for k, part in a.speeds:
        what = "a lighter load: a damaged blade" if part > 0.0 else "a weak motor, bearing or controller"
        lines.append(f"Motor {k + 1} turns {100 * part:+.0f} % against its drive in healthy flights: {what}.")
    for k, ratio, known in a.shaken:
        against = "in healthy flights" if known else "the other rotors"
        who = f"Motor {k + 1} shakes" if k >= 0 else "The rotors together shake"
        lines.append(f"{who} {ratio:.1f} times as much as {against} at the shaft frequency: "
                     "imbalance, tape or a damaged blade.")  # fmt: skip
    return lines


def _demanded(a: FlightAnswer) -> list[str]:
    """What the controller asks for."""
    if not a.demand:
        return []
    roll, pitch, yaw, near = (100 * v for v in a.demand)
    spin = f"; yaw beyond half of full for {near:.1f} % of the time" if near > 0.5 else ""
    return [f"The controller asks for {roll:+.1f} % of full roll, {pitch:+.1f} % pitch, {yaw:+.1f} % yaw "
            f"(right, nose up, right; trim){spin}."]  # fmt: skip


def _heard(a: FlightAnswer) -> list[str]:
    """Vibration of each rotor, else the strongest line."""
    shake, known = a.vibration, np.isfinite(a.vibration.shaft_hz)
    once, twice = (
        ", ".join(f"{i + 1}: {v:.2g}" for i, v in enumerate(row) if np.isfinite(v))
        for row in (shake.amplitude, shake.blade)
    )
    if once:
        lines = [f"Vibration once a turn ({shake.shaft_hz:.0f} Hz): {once} {shake.unit}."]
        return lines + ([f"Vibration twice a turn: {twice} {shake.unit}."] if twice else [])
    if not np.isfinite(shake.line) or not (known or _stands_out(shake)):
        return []
    seen = f"found in the spectrum: once a turn at {60 * shake.line_hz:.0f} rev/min, if so"
    where = "once a turn" if known else seen
    mean = f"{shake.line / np.sqrt(2.0):.2g} {shake.unit} root mean square (amplitude {shake.line:.2g})"
    lines = [f"Strongest vibration: {mean} at {shake.line_hz:.0f} Hz ({where})."]
    return lines + ([f"At twice that: amplitude {shake.twice:.2g} {shake.unit}."] if np.isfinite(shake.twice) else [])


def _along_axes(a: FlightAnswer) -> list[str]:
    """Vibration in the three axes."""
    shake = a.vibration
    if not shake.rms or not np.isfinite(shake.rms[0]):
        return []
    said = "as the autopilot states it (VIBE)" if shake.stated else "above 20 Hz"
    said = f"of the gyro {said}" if shake.unit == "rad/s" else said
    each = ", ".join(f"{v:.2g}" for v in shake.rms)
    more = f", in all {a.louder:.1f} times that of the healthy flights" if np.isfinite(a.louder) else ""
    return [f"Vibration {said}: {each} {shake.unit} in x, y, z (root mean square){more}."]


def _blown(a: FlightAnswer) -> list[str]:
    """Wind, or that none is seen."""
    w = a.wind
    if not np.isfinite(w.speed):
        return []
    if w.speed < w.half:
        return [f"No wind seen: {w.speed:.1f} ± {w.half:.1f} m/s."]
    return [f"Wind {w.speed:.1f} ± {w.half:.1f} m/s, towards {w.heading_deg:.0f} deg to the left of the log's x axis."]


def _flow(a: FlightAnswer) -> list[str]:
    """Lines on thrust in moving air, with the model's own where there is a case."""
    flow, said, lines = a.inflow, a.predicted, []
    if flow is None:
        return []
    along, across = (None, None) if said is None else (said.axial, said.inplane)
    for name, got, at, model in (
        ("thrust at {:+.1f} m/s along the axis", flow.axial, flow.axial_m_s[1], along),
        ("thrust at {:.1f} m/s in the plane", flow.inplane, flow.inplane_m_s, across),
    ):
        if got is not None:
            more = "" if model is None else f"; model {100 * np.interp(at, *model):+.1f} %"
            what = f"{100 * got[0]:+.1f} ± {100 * got[1]:.1f} % at equal speed of the rotors{more}"
            lines.append(f"  {name.format(at):<34} {what}")
    return lines


def sensor_text(s: SpeedSensor) -> str:
    """What is wrong with a speed sensor."""
    parts = []
    if s.count:
        parts.append(f"reads {s.ratio:.2f} of the speed, as if it saw {s.count.replace('/', ' blade of ')}")
    elif s.ratio == 0.0:
        parts.append("reads no speed")
    elif abs(s.ratio - 1.0) > 0.1:
        parts.append(f"reads {s.ratio:.2f} of the speed")
    if s.lost > _OFTEN:
        parts.append(f"drops out in {100 * s.lost:.0f} % of the flight")
    return f"The speed sensor of motor {s.motor} {' and '.join(parts)}"


def _signed(part: float) -> str:
    """A change in per cent, without the sign of nothing."""
    whole = round(100 * part)
    return f"{whole:+d} %" if whole else "0 %"


def _number(c: Constant) -> str:
    return f"{number_text(c.value, 4)} ± {number_text(c.half, 2)} {'' if c.unit == '1' else c.unit}".rstrip()


def stated_size(j: FlightVerdict) -> FlightEvidence | None:
    """Size of what is said, with its 95 % half width; None where none is stated."""
    found = j.found.get(j.said.leading)
    sized = not j.in_flight and any(i in j.said.leading for i in j.said.effects)
    return found if found is not None and found.size and sized else None


def headline(j: FlightVerdict) -> str:
    """What is wrong, without the reason."""
    said, found, size = j.said, stated_size(j), ""
    if found is not None:
        size = f" ({100 * found.size:+.0f} ± {100 * found.half:.0f} % drive)"
    if said.beside:
        return f"Cause found: {said.effects[0]}{size}; possibly also {' or '.join(said.effects[1:])}"
    words = {
        "none": "No cause found", "named": f"Cause found: {' and '.join(said.effects)}{size}",
        "class": f"One of these: {_open(said)}{size}", "unknown": "Something unlisted", "insufficient": "Cannot tell",
    }  # fmt: skip
    return words[said.verdict]


def _open(said: Decision) -> str:
    """Members of a class; of two at work, each with its look-alikes."""
    if len(said.sets) > 1:
        return "; with one of: ".join(" or ".join(s) for s in said.sets)
    return " or ".join(said.effects)
