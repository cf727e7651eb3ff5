"""The answer on a flight, in named groups; text and document are views of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError
from bemt.flight.change import FlightChange, change_in
from bemt.flight.identify import Constant, Identified, identify
from bemt.flight.inflow import Inflow, inflow
from bemt.flight.judge import FALSE_ALARM, FlightVerdict, axes_of, features, judge
from bemt.flight.layout import layout_of
from bemt.flight.log import FlightLog
from bemt.flight.motor_speed import speed_changes
from bemt.flight.repeat import flight_scatter
from bemt.flight.simulator import simulator_constants
from bemt.flight.vibration import Vibration, shaken, vibration
from bemt.flight.wind import Wind, wind

__all__ = ["FlightAnswer", "Predicted", "answer_on"]

_BREEZE = 2.0  # wind, or speed over ground beyond that of healthy flights, that may move the trim [m/s]
_FULL, _OFTEN = 0.98, 0.005  # share of full drive that is a limit; share of the time that is worth a word [1]

SPEED_POWER = 0.1
"""Bound (95 %) on the power of the speed with which a thrust constant changes as the speed does: -0.02 to 0.10 above
8,000 or 15,000 rev/min on three benches of a Crazyflie (IMRCLab/crazyflie-data-collection @ 4d777a5a) [1]."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """What the model of a case says of the rotor in this flight.

    Attributes
    ----------
    constant, u : float
        Thrust constant at the mean speed, hovering, and its standard uncertainty [N/rpm^2].
    axial, inplane : (2, n) float
        Velocity along the axis (above zero in a climb) and in the plane [m/s], and the relative change of the thrust
        constant that it makes [1].
    """

    constant: float
    u: float
    axial: NDArray[np.float64]
    inplane: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FlightAnswer:
    """What a flight shows and what is wrong.

    Attributes
    ----------
    log : FlightLog
        The flight.
    found : Identified
        Constants with bands.
    judged : FlightVerdict
        The decision, with the evidence and the error rate.
    wind : Wind
        Speed [m/s].
    balance : tuple of float
        By how much the left motors are driven harder than the right ones, the front ones than the rear ones, and those
        that turn to the left than those that turn to the right; empty without a layout [1].
    limited : tuple of float
        Share of the time at full command, of each motor [1].
    change : FlightChange or None
        A change within the flight.
    vibration : Vibration
        At the frequencies of the rotors.
    shaken : tuple of (int, float, bool)
        As :func:`bemt.flight.vibration.shaken` gives it.
    speeds : tuple of (int, float)
        As :func:`bemt.flight.motor_speed.speed_changes` gives it.
    inflow : Inflow or None
        Thrust over the flow.
    mass : Constant or None
        Mass from healthy flights of known mass [kg].
    predicted : Predicted or None
        The case in this flight.
    simulator : dict of str to Constant
        Constants in the units of simulators; the band of the thrust constant holds what flights differ by.
    """

    log: FlightLog
    found: Identified
    judged: FlightVerdict
    wind: Wind
    balance: tuple[float, ...] = ()
    limited: tuple[float, ...] = ()
    change: FlightChange | None = None
    vibration: Vibration = field(default_factory=lambda: Vibration(float("nan"), float("nan")))
    shaken: tuple[tuple[int, float, bool], ...] = ()
    speeds: tuple[tuple[int, float], ...] = ()
    inflow: Inflow | None = None
    mass: Constant | None = None
    predicted: Predicted | None = None
    simulator: dict[str, Constant] = field(default_factory=dict)

    def document(self) -> dict[str, Any]:
        """JSON of schema bemt.flight/1."""
        log, f, j, flow, said = self.log, self.found, self.judged, self.inflow, self.predicted
        return {
            "schema": "bemt.flight/1",
            "readings": {
                "file": log.file, "format": log.format, "rotors": log.rotors, "samples": int(log.t.size),
                "flying_s": float(log.flying.mean() * np.ptp(log.t)), "command_unit": log.command_unit,
                "layout": log.layout, "join_s": log.join_s, "ends": log.ends,
            },
            "constants": {k: asdict(c) for k, c in f.constants.items()},
            "simulator": {k: asdict(c) for k, c in self.simulator.items()},
            "rotors": {k: list(v) for k, v in f.rotors.items()},
            "balance": dict(zip(("left_right", "front_rear", "left_turning_right_turning"), self.balance,
                                strict=False)),
            "at_full_command": list(self.limited),
            "mass_kg": None if self.mass is None else asdict(self.mass),
            "baseline": None if said is None else
                {"thrust_constant": said.constant, "u": said.u, "unit": "N/rpm^2"},
            "decision": {"verdict": j.verdict, "effects": list(j.effects), "why": j.why, "rule": j.rule},
            "explanations": [asdict(e) for e in j.explanations],
            "error_rate": {"accused": j.accused, "healthy": j.healthy, "interval95": list(j.rate95)},
            "visible": j.visible,
            "share_change": j.readings.tolist(),
            "total_change": j.total,
            "change_in_flight": None if self.change is None else asdict(self.change),
            "vibration": asdict(self.vibration),
            "shaken": [{"motor": k + 1, "ratio": r, "against_healthy": h} for k, r, h in self.shaken],
            "speed_at_drive": [{"motor": k + 1, "change": c} for k, c in self.speeds],
            "inflow": None if flow is None else {"axial": flow.axial, "axial_m_s": flow.axial_m_s,
                                                 "inplane": flow.inplane, "inplane_m_s": flow.inplane_m_s},
            "wind": asdict(self.wind),
            "unseen": list(self.unseen),
        }  # fmt: skip

    @property
    def unseen(self) -> tuple[str, ...]:
        """What the log cannot show, with the manoeuvre or channel that would."""
        out, flow, shake = list(self.found.unseen), self.inflow, self.vibration
        if shake.missing and self.log.rotors:
            more = "; log it at more than twice the shaft frequency" if "which rotor" not in shake.missing else ""
            out.append(f"vibration, tape and imbalance: {shake.missing}{more}")
        if flow is None:
            out.append("thrust in forward flight, climb and descent: log speed of the rotors, accelerometer, velocity "
                       "and attitude")  # fmt: skip
        elif flow.axial is None or abs(flow.axial[0]) < flow.axial[1]:
            out.append("thrust in climb and descent: fly both at three steady rates, up to a third of the hover's wash")
        return tuple(out)

    def text(self) -> str:
        """One screen."""
        log, j = self.log, self.judged
        seconds = log.flying.mean() * np.ptp(log.t)
        lines = [f"{log.file}: {log.format}, {log.rotors} rotors, {seconds:.1f} s in the air"]
        if log.ends:
            lines.append(f"  {log.ends}")
        lines += ["", _verdict(j)]
        if j.healthy:
            low, high = j.rate95
            lines.append(
                f"  Error rate: {j.accused} of {j.healthy} healthy flights accused when each is judged by the others "
                f"(95 %: {100 * low:.0f} to {100 * high:.0f} %)."
            )
        if np.isfinite(j.visible):
            against = "against these healthy flights" if j.given else "without healthy flights of this vehicle"
            lines.append(f"  A damaged rotor shows from a change of its drive by {100 * j.visible:.0f} %, {against}.")
        if j.verdict == "none" and j.healthy:
            lines.append(
                "  Not visible in this log: smaller damage; tape and imbalance without fast accelerometer data."
            )
        if j.verdict == "none" and np.isfinite(j.total_half) and abs(j.total) > j.total_half:
            lines.append(f"  Total drive {100 * j.total:+.1f} % against healthy flights (they differ by "
                         f"±{100 * j.total_half:.1f} %): weight at the centre, battery or air.")  # fmt: skip
        lines += self._seen()
        lines += ["", "Identified (± 95 %)"] if self.found.constants else []
        lines += [f"  {name:<34} {_number(c)}" for name, c in self.found.constants.items()]
        lines += [f"  {name:<34} {', '.join(f'{v:.4g}' for v in values)}" for name, values in self.found.rotors.items()]
        if self.mass is not None:
            lines.append(f"  {'mass, from the healthy flights':<34} {_number(self.mass)}")
        if self.predicted is not None:
            k, u = self.predicted.constant, self.predicted.u
            lines.append(
                f"  {'thrust constant of the case':<34} {k:.4g} ± {2 * u:.2g} N/rpm^2 (two standard deviations)"
            )
        lines += self._flow()
        if self.simulator:
            lines += ["", "For a simulator (± 95 %; thrust: of another flight of this vehicle)"]
            lines += [f"  {name:<34} {_number(c)}" for name, c in self.simulator.items()]
        lines += ["", "Not visible here"] if self.unseen else []
        lines += [f"  {u}" for u in self.unseen]
        return "\n".join(lines)

    def _seen(self) -> list[str]:
        """Lines on what this flight alone shows."""
        lines, shares = [], self.found.rotors.get("mean command", self.found.rotors.get("share of rpm^2", ()))
        if shares:
            mean = sum(shares) / len(shares)
            each = ", ".join(f"{i + 1}: {100 * (v / mean - 1.0):+.0f} %" for i, v in enumerate(shares))
            lines.append(f"  Drive of each motor against their mean: {each}.")
        if len(self.balance) == 3:
            pairs = (("left", "right"), ("front", "rear"), ("left-turning", "right-turning"))
            parts = [f"{a if b > 0 else c} over {c if b > 0 else a} {100 * abs(b):.0f} %"
                     for (a, c), b in zip(pairs, self.balance, strict=True)]  # fmt: skip
            lines.append(f"  Driven harder: {', '.join(parts)} (centre of mass; tilted motors or trim in yaw).")
        full = [f"motor {i + 1} {100 * v:.1f} %" for i, v in enumerate(self.limited) if v > _OFTEN]
        if full:
            lines.append(f"  At full command: {', '.join(full)} of the time.")
        c, shake = self.change, self.vibration
        if c is not None:
            when = f"At {c.at_s:.1f} s" if c.kind == "step" else "Steadily over the flight"
            lines.append(f"  {when} the balance changed by {100 * c.size:.0f} ± {100 * c.half:.0f} % drive, as by: "
                         f"{', '.join(c.causes)}.")  # fmt: skip
        for k, part in self.speeds:
            what = "a lighter load: a damaged blade" if part > 0.0 else "a weak motor, bearing or controller"
            lines.append(f"  Motor {k + 1} turns {100 * part:+.0f} % against its drive in healthy flights: {what}.")
        for k, ratio, known in self.shaken:
            against = "in healthy flights" if known else "the other rotors"
            who = f"Motor {k + 1} shakes" if k >= 0 else "The rotors together shake"
            lines.append(f"  {who} {ratio:.1f} times as much as {against} at the shaft frequency: "
                         "imbalance, tape or a damaged blade.")  # fmt: skip
        heard = [f"{i + 1}: {v:.2g}" for i, v in enumerate(shake.amplitude) if np.isfinite(v)]
        if heard:
            lines.append(f"  Vibration once a turn ({shake.shaft_hz:.0f} Hz): {', '.join(heard)} {shake.unit}.")
        elif np.isfinite(shake.line):
            lines.append(f"  Strongest vibration: {shake.line:.2g} {shake.unit} at {shake.line_hz:.0f} Hz.")
        if np.isfinite(self.wind.speed):
            w = self.wind
            seen = "Wind" if w.speed > w.half else "No wind seen:"
            lines.append(f"  {seen} {w.speed:.1f} ± {w.half:.1f} m/s towards {w.heading_deg:.0f} deg from x.")
        return lines

    def _flow(self) -> list[str]:
        """Lines on thrust in moving air, with the model's own where there is a case."""
        flow, said, lines = self.inflow, self.predicted, []
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
    return f"{c.value:.4g} ± {c.half:.2g} {'' if c.unit == '1' else c.unit}".rstrip()


def _verdict(j: FlightVerdict) -> str:
    leading = next((e for e in j.explanations if e.cause in j.effects and j.rule != "vibration"), None)
    size = "" if leading is None else f" ({100 * leading.size:+.0f} ± {100 * leading.half:.0f} % drive)"
    words = {
        "none": "No cause found: ",
        "named": f"Cause found: {', '.join(j.effects)}{size}: ",
        "class": f"One of these: {', '.join(j.effects)}{size}: ",
        "unknown": "Something unlisted: ",
        "insufficient": "Cannot tell: ",
    }
    return f"{words[j.verdict]}{j.why}."


def answer_on(
    log: FlightLog,
    healthy: Sequence[FlightLog] = (),
    mass_kg: float | None = None,
    layout: str = "",
    healthy_mass_kg: float | None = None,
    false_alarm: float = FALSE_ALARM,
) -> FlightAnswer:
    """Identify and judge one flight.

    Parameters
    ----------
    log : FlightLog
        The flight.
    healthy : sequence of FlightLog
        Healthy flights of the same vehicle.
    mass_kg : float or None
        Mass of this flight with battery [kg].
    layout : str
        As :func:`bemt.flight.layout.layout_of` takes it; empty: the usual one of the format.
    healthy_mass_kg : float or None
        Mass of the healthy flights [kg]; gives the mass of this one.
    false_alarm : float
        Accepted probability that a healthy flight is accused [1].

    Returns
    -------
    FlightAnswer
        In SI units but for speeds [rev/min].

    Raises
    ------
    InputError
        When logs have another number of rotors, or the layout does not fit.
    """
    others = [h for h in healthy if h.rotors != log.rotors or (h.command is None) != (log.command is None)]
    if others:
        expected = f"{log.rotors} rotors and the same channels as {log.file}"
        raise InputError([Fault(h.file, "", f"{h.rotors} rotors", expected) for h in others])
    if layout:
        log = replace(log, layout=layout)
    placed = layout_of(log.layout, log.rotors) if log.rotors else None
    found, air = identify(log, mass_kg), wind(log, healthy)
    mine = features(log)
    if mine is None:
        judged = FlightVerdict("insufficient", (), "the log shows no flight with all motors running", (), np.zeros(0))
    else:
        calm_ones = [x for h in healthy if (x := features(h)) is not None]
        judged = judge(mine, calm_ones, placed, false_alarm, _windy(log, healthy, air))
    mass = None
    if healthy_mass_kg is not None and found.weight_per_drive is not None:
        same = [h for h in healthy if (h.rpm is None) == (log.rpm is None)]
        known = [(h, w) for h in same if (w := identify(h).weight_per_drive) is not None]
        if known:
            mass = _mass(log, found.weight_per_drive, known, healthy_mass_kg)
    shake, calm = vibration(log), [vibration(h) for h in healthy]
    moved = shaken(shake, calm)
    judged = _with_vibration(judged, moved, calm)
    balance: tuple[float, ...] = ()
    limited: tuple[float, ...] = ()
    if mine is not None and placed is not None:
        balance = tuple(2.0 * float(r) for r in axes_of(placed, log.rotors) @ mine)
    if log.command is not None and log.command_unit == "1" and log.flying.any():
        limited = tuple(map(float, np.mean(log.command[log.flying] > _FULL, axis=0)))
    return FlightAnswer(
        log, found, judged, air, balance, limited, change_in(log, placed), shake, moved,
        speed_changes(log, healthy), inflow(log), mass, simulator=simulator_constants(log, found),
    )  # fmt: skip


def _windy(log: FlightLog, healthy: Sequence[FlightLog], air: Wind) -> bool:
    """Whether the rotors met more wind than in the healthy flights: from the force, or by their own way over ground."""

    def speed(one: FlightLog) -> float:
        if one.velocity is None or not one.flying.any():
            return 0.0
        return float(np.mean(np.linalg.norm(one.velocity[one.flying, :2], axis=1)))

    if air.speed > max(air.half, _BREEZE):
        return True
    return speed(log) > _BREEZE + max([speed(h) for h in healthy], default=0.0)


def _with_vibration(
    judged: FlightVerdict, moved: tuple[tuple[int, float, bool], ...], calm: Sequence[Vibration]
) -> FlightVerdict:
    """The verdict where the balance shows nothing and one rotor shakes more than in healthy flights."""
    known = [(k, ratio) for k, ratio, by_healthy in moved if by_healthy]
    if judged.verdict != "none" or len(known) != 1:
        return judged
    from scipy import stats

    k, ratio = known[0]
    accused = sum(bool(shaken(c, [*calm[:i], *calm[i + 1 :]])) for i, c in enumerate(calm))
    accused = min(accused + judged.accused, judged.healthy)
    interval = stats.binomtest(accused, judged.healthy).proportion_ci(method="exact")
    why = f"it shakes {ratio:.1f} times as much as in healthy flights at its shaft frequency; the balance did not move"
    which = f"motor {k + 1}" if k >= 0 else "a rotor"
    effects = f"imbalance or tape, {which}", f"damaged blade, {which}"
    return replace(judged, verdict="class", effects=effects, why=why, rule="vibration", accused=accused,
                   rate95=(float(interval.low), float(interval.high)))  # fmt: skip


def _mass(log: FlightLog, mine: Constant, known: Sequence[tuple[FlightLog, Constant]], healthy_mass: float) -> Constant:
    """Mass at which this flight's thrust constant is that of the healthy ones, with what flights differ by."""
    values = np.array([k.value for _, k in known])
    m = healthy_mass * float(values.mean()) / mine.value
    sd, factor = flight_scatter(values)
    between = factor * sd * np.sqrt(1.0 + 1.0 / values.size)
    speeds = [float(h.rpm[h.flying].mean()) for h, _ in known if h.rpm is not None]
    slope = 0.0 if log.rpm is None else SPEED_POWER * float(np.log(log.rpm[log.flying].mean() / np.mean(speeds)))
    return Constant(m, m * float(np.hypot(np.hypot(mine.half / mine.value, between), slope)), "kg")
