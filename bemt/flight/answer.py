"""The answer on a flight, in named groups; text and document are views of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.flight.identify import Constant, Identified, identify
from bemt.flight.judge import FALSE_ALARM, FlightVerdict, features, judge
from bemt.flight.layout import layout_of
from bemt.flight.log import FlightLog
from bemt.flight.repeat import flight_scatter
from bemt.flight.simulator import simulator_constants
from bemt.flight.wind import Wind, wind

__all__ = ["FlightAnswer", "answer_on"]

SPEED_POWER = 0.1
"""Bound (95 %) on the power of the speed with which a thrust constant changes as the speed does: -0.02 to 0.10 above
8,000 or 15,000 rev/min on three benches of a Crazyflie (IMRCLab/crazyflie-data-collection @ 4d777a5a) [1]."""


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
    mass : Constant or None
        Mass from healthy flights of known mass [kg].
    predicted : tuple of float or None
        Thrust constant of the case at the mean speed, and its standard uncertainty [N/rpm^2].
    simulator : dict of str to Constant
        Constants in the units of simulators; the band of the thrust constant holds what flights differ by.
    """

    log: FlightLog
    found: Identified
    judged: FlightVerdict
    wind: Wind
    mass: Constant | None = None
    predicted: tuple[float, float] | None = None
    simulator: dict[str, Constant] = field(default_factory=dict)

    def document(self) -> dict[str, Any]:
        """JSON of schema bemt.flight/1."""
        log, f = self.log, self.found
        return {
            "schema": "bemt.flight/1",
            "readings": {
                "file": log.file, "format": log.format, "rotors": log.rotors, "samples": int(log.t.size),
                "flying_s": float(log.flying.mean() * np.ptp(log.t)), "command_unit": log.command_unit,
                "join_s": log.join_s, "ends": log.ends,
            },
            "constants": {k: asdict(c) for k, c in f.constants.items()},
            "simulator": {k: asdict(c) for k, c in self.simulator.items()},
            "rotors": {k: list(v) for k, v in f.rotors.items()},
            "mass_kg": None if self.mass is None else asdict(self.mass),
            "baseline": None if self.predicted is None else
                {"thrust_constant": self.predicted[0], "u": self.predicted[1], "unit": "N/rpm^2"},
            "decision": {"verdict": self.judged.verdict, "effects": list(self.judged.effects), "why": self.judged.why},
            "explanations": [asdict(e) for e in self.judged.explanations],
            "error_rate": {"accused": self.judged.accused, "healthy": self.judged.healthy,
                           "interval95": list(self.judged.rate95)},
            "visible": self.judged.visible,
            "share_change": self.judged.readings.tolist(),
            "total_change": self.judged.total,
            "wind": asdict(self.wind),
            "unseen": list(f.unseen),
        }  # fmt: skip

    def text(self) -> str:
        """One screen."""
        log, j, f = self.log, self.judged, self.found
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
            lines.append(f"  A rotor shows here from a change of its drive by {100 * j.visible:.0f} %.")
        if j.verdict == "none" and j.healthy:
            lines.append(
                "  Not visible in this log: smaller damage; tape and imbalance without fast accelerometer data."
            )
        if j.verdict == "none" and np.isfinite(j.total_half) and abs(j.total) > j.total_half:
            lines.append(f"  Total drive {100 * j.total:+.1f} % against healthy flights (they differ by "
                         f"±{100 * j.total_half:.1f} %): weight at the centre, battery or air.")  # fmt: skip
        if np.isfinite(self.wind.speed):
            w = self.wind
            seen = "Wind" if w.speed > w.half else "No wind seen:"
            lines.append(f"  {seen} {w.speed:.1f} ± {w.half:.1f} m/s towards {w.heading_deg:.0f} deg from x.")
        lines += ["", "Identified (± 95 %)"]
        lines += [f"  {name:<34} {_number(c)}" for name, c in f.constants.items()]
        lines += [f"  {name:<34} {', '.join(f'{v:.4g}' for v in values)}" for name, values in f.rotors.items()]
        if self.mass is not None:
            lines.append(f"  {'mass, from the healthy flights':<34} {_number(self.mass)}")
        if self.predicted is not None:
            k, u = self.predicted
            lines.append(
                f"  {'thrust constant of the case':<34} {k:.4g} ± {2 * u:.2g} N/rpm^2 (two standard deviations)"
            )
        if self.simulator:
            lines += ["", "For a simulator (± 95 %; thrust: of another flight of this vehicle)"]
            lines += [f"  {name:<34} {_number(c)}" for name, c in self.simulator.items()]
        lines += ["", "Not visible here"] if f.unseen else []
        lines += [f"  {u}" for u in f.unseen]
        return "\n".join(lines)


def _number(c: Constant) -> str:
    return f"{c.value:.4g} ± {c.half:.2g} {'' if c.unit == '1' else c.unit}".rstrip()


def _verdict(j: FlightVerdict) -> str:
    leading = next((e for e in j.explanations if e.cause in j.effects), None)
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
    found = identify(log, mass_kg)
    mine = features(log)
    if mine is None:
        judged = FlightVerdict("insufficient", (), "the log shows no flight with all motors running", (), np.zeros(0))
    else:
        judged = judge(mine, [x for h in healthy if (x := features(h)) is not None], placed, false_alarm)
    mass = None
    if healthy_mass_kg is not None and found.weight_per_drive is not None:
        same = [h for h in healthy if (h.rpm is None) == (log.rpm is None)]
        known = [(h, w) for h in same if (w := identify(h).weight_per_drive) is not None]
        if known:
            mass = _mass(log, found.weight_per_drive, known, healthy_mass_kg)
    return FlightAnswer(log, found, judged, wind(log, healthy), mass, simulator=simulator_constants(log, found))


def _mass(log: FlightLog, mine: Constant, known: Sequence[tuple[FlightLog, Constant]], healthy_mass: float) -> Constant:
    """Mass at which this flight's thrust constant is that of the healthy ones, with what flights differ by."""
    values = np.array([k.value for _, k in known])
    m = healthy_mass * float(values.mean()) / mine.value
    sd, factor = flight_scatter(values)
    between = factor * sd * np.sqrt(1.0 + 1.0 / values.size)
    speeds = [float(h.rpm[h.flying].mean()) for h, _ in known if h.rpm is not None]
    slope = 0.0 if log.rpm is None else SPEED_POWER * float(np.log(log.rpm[log.flying].mean() / np.mean(speeds)))
    return Constant(m, m * float(np.hypot(np.hypot(mine.half / mine.value, between), slope)), "kg")
