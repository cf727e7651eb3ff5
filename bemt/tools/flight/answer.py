"""The answer on a flight, in named groups; text and document are views of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, refuse
from bemt.base.tables import number_of
from bemt.judge.diagnose.suggest import Suggestion
from bemt.judge.explanation import NONE
from bemt.judge.loss import Decision
from bemt.tools.flight.balance import LOADED, TOTAL_FREE, at_equal_voltage, axes_of, battery_volts, features
from bemt.tools.flight.change import FlightChange, change_in
from bemt.tools.flight.identify import Constant, Identified, identify
from bemt.tools.flight.judge import BesideBalance, FlightVerdict, judge, total_sd
from bemt.tools.flight.layout import layout_of, mass_faults
from bemt.tools.flight.log import FlightLog
from bemt.tools.flight.repeat import Sessions, flight_scatter, sessions
from bemt.tools.flight.speed_sensor import checked, speed_changes
from bemt.tools.flight.thrust_curve import Inflow, inflow, simulator_constants, thrust_curve
from bemt.tools.flight.vibration import Vibration, shaken, vibration
from bemt.tools.flight.wind import BREEZE, Wind, wind

_FULL = 0.98  # share of full drive that is a limit [1]
_NEAR_LIMIT = 0.5  # demand in yaw that few mixers can give in full [1]

SPEED_POWER, SPEED_POWER_HALF = 0.05, 0.1
"""Power of the speed with which a thrust constant grows as the Reynolds number does, and the half width of its 95 %
band: -0.02 to 0.10 above 8,000 or 15,000 rev/min on benches of a Crazyflie (IMRCLab/crazyflie-data-collection @
4d777a5a) [1]."""


COMMAND_POWER, COMMAND_POWER_HALF = 1.5, 0.5
"""Power of the command with which thrust grows, and the half width of its 95 % band: from a command that is thrust to
one that is speed [1]."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """What the model of a case says of the rotor in this flight."""

    # Thrust constant at the mean speed, hovering, and its standard uncertainty [N/rpm^2]
    constant: float
    u: float
    # (2, n) Velocity along the axis (above zero in a climb) and in the plane [m/s], and the relative change of the
    # thrust constant that it makes [1]
    axial: NDArray[np.float64]
    inplane: NDArray[np.float64]


FAR = math.log(2.0)
"""Logarithm of the ratio of thrusts at one speed beyond which the propeller is in question: declared. [1]"""


@dataclass(frozen=True, eq=False)
class FlightAnswer:
    """What a flight shows and what is wrong."""

    log: FlightLog  # The flight
    found: Identified  # Constants with bands
    judged: FlightVerdict  # The decision, with the evidence and the error rate
    wind: Wind  # Speed [m/s]
    # By how much the left motors are driven harder than the right ones, the front ones than the rear ones, and those
    # that turn to the left than those that turn to the right; empty without a layout [1]
    balance: tuple[float, ...] = ()
    drives: tuple[float, ...] = ()  # Usual drive of each motor over their mean, less one [1]
    limited: tuple[float, ...] = ()  # Share of the time at full command, of each motor [1]
    change: FlightChange | None = None  # A change within the flight
    # At the frequencies of the rotors
    vibration: Vibration = field(default_factory=Vibration)
    shaken: tuple[tuple[int, float, bool], ...] = ()  # As :func:`bemt.tools.flight.vibration.shaken` gives it
    louder: float = float("nan")  # Level of vibration over the mean of the healthy flights' [1]
    speeds: tuple[tuple[int, float], ...] = ()  # As :func:`bemt.tools.flight.speed_sensor.speed_changes` gives it
    inflow: Inflow | None = None  # Thrust over the flow
    mass: Constant | None = None  # Mass from healthy flights of known mass [kg]
    predicted: Predicted | None = None  # The case in this flight
    # Constants in the units of simulators; the band of the thrust constant holds what flights differ by
    simulator: dict[str, Constant] = field(default_factory=dict)
    curve: dict[str, Constant] = field(default_factory=dict)  # Parameters of the autopilot's thrust curve
    days: Sessions = field(default_factory=lambda: Sessions((), "", ""))  # Sessions of the flights
    # Usual demand in roll to the right, nose up and yaw to the right, and share of the time near the limit in yaw; as
    # shares of full; empty where it was not logged [1]
    demand: tuple[float, ...] = ()

    @property
    def over_case(self) -> tuple[float, float] | None:
        """Thrust at equal speed over that of the case, and its half width (95 %) as a share of it; None without both.

        Without a mass, the thrust is that of each kilogram.
        """
        k, said = self.found.constants.get("thrust constant"), self.predicted
        if k is None or said is None:
            return None
        return k.value / said.constant, float(np.hypot(k.half / k.value, 2.0 * said.u / said.constant))

    @property
    def other_rotor(self) -> str:
        """What to ask where the mass needs a thrust that no scatter of propellers explains; empty elsewhere."""
        told = self.over_case
        weighed = told is not None and self.found.constants["thrust constant"].unit == "N/rpm^2"
        if told is None or not weighed or abs(math.log(told[0])) - told[1] < FAR:
            return ""
        ratio = told[0]
        return (
            f"Is it this rotor? The mass fits {ratio**0.5:.2f} times the logged speeds (pole pairs, marks), "
            f"{ratio**0.25:.2f} times the diameter, or {1.0 / ratio:.2g} times the mass (kg?)"
        )

    def document(self) -> dict[str, Any]:
        """JSON of schema bemt.flight/1."""
        log, f, j, flow, said = self.log, self.found, self.judged, self.inflow, self.predicted
        return {
            "schema": "bemt.flight/1",
            "readings": {
                "file": log.file, "format": log.format, "rotors": log.rotors, "samples": int(log.t.size),
                "flying_s": float(log.flying.mean() * np.ptp(log.t)), "command_unit": log.command_unit,
                "stated_rotors": log.stated_rotors, "mixed": log.mixed, "date": log.date,
                "layout": log.layout, "join_s": log.join_s, "ends": log.ends,
            },
            "sensors": [asdict(s) for s in log.sensors],
            "constants": {k: asdict(c) for k, c in f.constants.items()},
            "thrust_curve": {k: asdict(c) for k, c in self.curve.items()},
            "simulator": {k: asdict(c) for k, c in self.simulator.items()},
            "rotors": {k: list(v) for k, v in f.rotors.items()},
            "balance": dict(zip(("left_right", "front_rear", "left_turning_right_turning"), self.balance,
                                strict=False)),
            "at_full_command": list(self.limited),
            "mass_kg": None if self.mass is None else asdict(self.mass),
            "baseline": None if said is None else
                {"thrust_constant": said.constant, "u": said.u, "unit": "N/rpm^2"},
            "decision": {"verdict": j.said.verdict, "effects": list(j.said.effects),
                         "probability": j.said.probability, "sets": [list(s) for s in j.said.sets],
                         "why": j.said.why, "expected_loss": dict(j.said.loss)},
            "ranking": [{"effect": str(e), "probability": p,
                         **({"size": j.found[e].size, "half": j.found[e].half} if e in j.found else {})}
                        for e, p in sorted(j.probability.items(), key=lambda kv: -kv[1])[:12]],
            "next_measurement": j.next.document(),
            "error_rate": {"accused": j.accused, "healthy": j.healthy, "interval95": list(j.rate95),
                           "left_out": "session" if j.sessions > 1 else "flight"},
            "sessions": {"of_healthy": list(self.days.days), "by": self.days.by, "of_this":
                         "unknown" if self.days.day == "" else "another" if self.days.day is None else self.days.day},
            "demand": dict(zip(("roll", "pitch", "yaw", "yaw_near_limit"), self.demand, strict=False)),
            "visible": j.visible,
            "share_change": j.readings.tolist(),
            "total_change": j.total,
            "change_in_flight": None if self.change is None else asdict(self.change),
            "vibration": asdict(self.vibration), "vibration_over_healthy": self.louder,
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


def answer_on(
    log: FlightLog, healthy: Sequence[FlightLog] = (), mass_kg: float | None = None, layout: str = "",
    healthy_mass_kg: float | None = None, stated_days: Sequence[str] = (), day: str = "",
) -> FlightAnswer:  # fmt: skip
    """Identify and judge one flight, with healthy flights of the same vehicle.

    Masses include the battery [kg]; that of the healthy flights gives the mass of this one where it is not stated.
    `stated_days` and `day` are as :func:`bemt.tools.flight.repeat.sessions` takes them. InputError when logs have
    another number of rotors or are of another autopilot, or the layout (as
    :func:`bemt.tools.flight.layout.layout_of` takes it) does not fit, or a mass cannot have flown.
    """
    _refuse_unlike(log, healthy, mass_kg, healthy_mass_kg)
    log = checked(replace(log, layout=layout or log.layout))
    healthy = [checked(replace(h, layout=layout or h.layout)) for h in healthy]
    placed = layout_of(log.layout, log.rotors) if log.rotors else None
    found, air, mine = identify(log, mass_kg), wind(log, healthy), features(log)
    shake, calm = vibration(log), [vibration(h) for h in healthy]
    levels = np.array([v.level if shake.alike(v) else np.nan for v in calm])
    past = levels[np.isfinite(levels)]
    moved, turned = shaken(shake, calm), speed_changes(log, healthy)
    changed, days = change_in(log, placed), sessions(log, healthy, stated_days, day)
    mass = _by_healthy(log, found, healthy, healthy_mass_kg)
    trims: tuple[tuple[float, ...], tuple[float, ...]] = (), ()
    if mine is None:
        judged = _not_flown(log)
    else:
        flown = [(k, x) for k, h in enumerate(healthy) if (x := features(h)) is not None]
        upset = [bool(shaken(calm[k], [*calm[:k], *calm[k + 1 :]])) or change_in(healthy[k], placed) is not None
                 for k, _ in flown]  # fmt: skip
        beside = BesideBalance(
            tuple(k + 1 for k, part in turned if part > 0.0), tuple(k + 1 for k, part in turned if part < 0.0),
            tuple(k + 1 for k, _, known in moved if known), changed, tuple(upset),
            shake.level, tuple(levels[k] for k, _ in flown),
        )  # fmt: skip
        mine, *others = at_equal_voltage([log, *(healthy[k] for k, _ in flown)], [mine, *(x for _, x in flown)])
        judged = judge(mine, others, placed, _windy(log, healthy, air), beside,
                       [days.days[k] for k, _ in flown], days.day)  # fmt: skip
        if mass is not None and judged.next.kind == "run" and judged.said.verdict == "none":
            step = "see whether payload and battery explain the mass; a full battery and a hover of 30 s show the rest"
            judged = replace(judged, next=replace(judged.next, text=step))
        trims = _trims(log, placed)
    return FlightAnswer(
        log, found, judged, air, *trims, _limited(log), changed, shake, moved,
        float(np.exp(shake.level - past.mean())) if past.size else float("nan"), turned, inflow(log), mass,
        simulator=simulator_constants(log, found), curve=thrust_curve(log), days=days, demand=_demand(log),
    )  # fmt: skip


def _trims(log: FlightLog, placed: Array | None) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Balance of the usual drives about the axes of the layout, and each of them over their mean, less 1."""
    usual = _usual(log)
    drives = tuple(map(float, np.exp(usual) / np.exp(usual).mean() - 1.0))
    axes = () if placed is None else axes_of(placed, log.rotors) @ usual
    return tuple(2.0 * float(r) for r in axes), drives


def _refuse_unlike(
    log: FlightLog, healthy: Sequence[FlightLog], mass_kg: float | None, healthy_mass_kg: float | None
) -> None:  # fmt: skip
    """Refuse healthy flights of another vehicle, and masses that cannot have flown."""
    others = [h for h in healthy if h.rotors != log.rotors or (h.command is None) != (log.command is None)]
    if log.rotors and others:
        expected = f"{log.rotors} rotors and the same channels as {log.file}"
        raise InputError([Fault(h.file, "", f"{h.rotors} rotors", expected) for h in others])
    if strange := [h for h in healthy if h.format != log.format]:
        expected = f"a log of {log.format}, as {log.file}"
        raise InputError([Fault(h.file, "", f"a log of {h.format}", expected, "Healthy flights are of the same vehicle")
                          for h in strange])  # fmt: skip
    faults = mass_faults(log, mass_kg, "--mass-kg")
    for h in healthy:
        faults = faults or mass_faults(h, healthy_mass_kg, "--healthy-mass-kg")
    refuse(faults)


def _not_flown(log: FlightLog) -> FlightVerdict:
    """Verdict on a log without a flight that could be judged."""
    why = "the log shows no flight with all motors running"
    if (seen := int(log.flying.sum())) and log.drive is not None and np.all(log.drive[log.flying].mean(axis=0) > 0.0):
        why = f"{number_of(seen, 'sample')} in the air are too few"
    if not log.rotors:
        why = f"no output of {f'any of the {log.stated_rotors}' if log.stated_rotors else 'the'} motors was logged"
    elif log.airborne is not None and not np.any(log.airborne > 0.5):
        why = "the vehicle stays on the ground or disarmed all along, by the autopilot's own record"
    step = "log a flight of 10 s or more with the commands of the motors (ArduPilot RCOU or RATE, PX4 " \
           "actuator_motors, a Crazyflie's motor.m1 to m4)"  # fmt: skip
    if log.ends:
        why, step = f"{why}; the file {log.ends}", f"download the log again, whole; or {step}"
    said = Decision("insufficient", (), NONE, 1.0, why)
    return FlightVerdict(said, np.zeros(0), Suggestion(step, "run"))


def _by_healthy(
    log: FlightLog, found: Identified, healthy: Sequence[FlightLog], mass_kg: float | None
) -> Constant | None:  # fmt: skip
    """Mass by healthy flights of a known one, where their drive was logged in the same way."""
    if mass_kg is None or found.weight_per_drive is None:
        return None
    same = [h for h in healthy if (h.rpm is None) == (log.rpm is None)]
    known = [(h, w) for h in same if (w := identify(h).weight_per_drive) is not None]
    return _mass(log, found.weight_per_drive, known, mass_kg) if known else None


def _limited(log: FlightLog) -> tuple[float, ...]:
    """Share of the time that each motor is at its limit [1]."""
    if log.command is None or log.command_unit != "1" or not log.flying.any():
        return ()
    return tuple(map(float, np.mean(log.command[log.flying] > _FULL, axis=0)))


def _usual(log: FlightLog) -> Array:
    """Log of the drives at their usual: the median of twenty means over the flight, so a spin of seconds is none."""
    drive = log.drive
    assert drive is not None
    return np.asarray(np.log(np.maximum(_by_stretches(drive[log.flying]), 1e-9)), dtype=float)


def _by_stretches(rows: Array) -> Array:
    """Median of the means of twenty stretches of a flight, (P, k) to (k,)."""
    stretches = np.array_split(rows, min(20, len(rows)))
    return np.asarray(np.median([s.mean(axis=0) for s in stretches], axis=0), dtype=float)


def _demand(log: FlightLog) -> tuple[float, ...]:
    """Usual demand in roll, pitch and yaw, and the share of the time near the limit in yaw [1]."""
    if log.torque is None or not log.flying.any():
        return ()
    torque = log.torque[log.flying]
    return (*map(float, _by_stretches(torque)), float(np.mean(np.abs(torque[:, 2]) > _NEAR_LIMIT)))


def _windy(log: FlightLog, healthy: Sequence[FlightLog], air: Wind) -> bool:
    """Whether the rotors met more wind than in the healthy flights: from the force, or by their own way over ground."""

    def speed(one: FlightLog) -> float:
        if one.velocity is None or not one.flying.any():
            return 0.0
        return float(np.mean(np.linalg.norm(one.velocity[one.flying, :2], axis=1)))

    if air.speed > max(air.half, BREEZE):
        return True
    return speed(log) > BREEZE + max([speed(h) for h in healthy], default=0.0)


def _mass(log: FlightLog, mine: Constant, known: Sequence[tuple[FlightLog, Constant]], healthy_mass: float) -> Constant:
    """Mass at which this flight's thrust constant is that of the healthy ones, with what flights differ by."""
    values = np.array([k.value for _, k in known])
    if log.rpm is None:
        return _mass_by_commands(log, mine, known, healthy_mass)
    m = healthy_mass * float(values.mean()) / mine.value
    # Not narrowed by the healthy flights: another load is what they cannot show (a payload weighs 2 % too little).
    sd, factor = flight_scatter([])
    between = factor * sd * np.sqrt(1.0 + 1.0 / values.size)
    faster = float(np.log(log.rpm[log.flying].mean() / np.mean([h.rpm[h.flying].mean() for h, _ in known])))  # type: ignore[index]
    m *= float(np.exp(SPEED_POWER * faster))
    parts = (mine.half / mine.value, between, SPEED_POWER_HALF * faster)
    return Constant(m, m * float(np.linalg.norm(parts)), "kg")


def _mass_by_commands(
    log: FlightLog, mine: Constant, known: Sequence[tuple[FlightLog, Constant]], healthy_mass: float
) -> Constant:  # fmt: skip
    """The same where no speed was logged: commands at one battery voltage, on a curve that is not known."""
    from scipy import stats

    flights = [log, *(h for h, _ in known)]
    x = [np.log(f.drive[f.flying].mean(axis=0)) for f in flights]  # type: ignore[index]
    even = np.array(at_equal_voltage(flights, x))
    harder = float(np.mean(np.log([k.value for _, k in known]))) - float(np.log(mine.value))
    moved = (even - x).mean(axis=1)
    harder += float(moved[0] - moved[1:].mean())
    free = len(known) - 1 + TOTAL_FREE
    between = float(stats.t.ppf(0.975, free)) * total_sd(even[1:])
    if log.duty > 0.0 and any(battery_volts(f) is None for f in flights):
        between = float(np.hypot(between, LOADED))
    m = healthy_mass * float(np.exp(COMMAND_POWER * harder))
    parts = (COMMAND_POWER * mine.half / mine.value, COMMAND_POWER * between, COMMAND_POWER_HALF * harder)
    return Constant(m, m * float(np.linalg.norm(parts)), "kg")
