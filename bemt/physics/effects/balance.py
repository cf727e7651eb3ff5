"""Errors of the balance: gain, zero, drift, cross talk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Flow, Parameter, Reading, choice


@dataclass(frozen=True)
class Gain(Effect):
    """The cell shows (1 + gain) times its load.

    Notes
    -----
    Linear calibration error of a load cell (ISO 376:2011 states it as a relative error; not checked). Typically a few
    percent, sometimes far more (wrong arm, wrong calibration mass, factor of another cell). Hence a heavy-tailed prior;
    declared.
    """

    gain: float = 0.03

    kind = "stand"
    fault = "gain"
    parameters = (Parameter("gain", "1", -0.4, 0.4, "declared, workshop calibration; seldom far more", 3, 0.0, 0.05),)
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Scale the channel."""
        reading.values[self.sensor] = reading.values[self.sensor] * (1.0 + self.gain)


class ThrustGain(Gain):
    """The thrust cell shows (1 + gain) times the thrust."""

    id = "thrust_gain"
    title = "gain error of the thrust cell"
    sign = "thrust off by one factor at every speed and airspeed while torque is right; air density would move both"
    sensor = "thrust_N"


class TorqueGain(Gain):
    """The torque cell shows (1 + gain) times the torque."""

    id = "torque_gain"
    title = "gain error of the torque cell"
    sign = "torque off by one factor at every speed and airspeed while thrust is right; air density would move both"
    sensor = "torque_Nm"


# Zero of a load cell.


@dataclass(frozen=True)
class Zero(Effect):
    """The cell shows its load plus a constant share of full scale.

    Notes
    -----
    Zero error of a load cell (ISO 376:2011; not checked): falls as 1/n^2 in the coefficient. Full scale is the largest
    reading of the recording. No tare, cable pull, weight of the motor: typically a few percent, sometimes far more.
    Hence a heavy-tailed prior; declared.
    """

    zero: float = 0.01

    kind = "stand"
    fault = "zero"
    parameters = (Parameter("zero", "1", -0.25, 0.25, "declared, of full scale; a weight not tared", 3, 0.0, 0.02),)
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Shift the channel."""
        reading.values[self.sensor] = reading.values[self.sensor] + self.zero * reading.full_scale[self.sensor]


class ThrustZero(Zero):
    """The thrust cell shows the thrust plus a constant share of full scale."""

    id = "thrust_zero"
    title = "zero offset of the thrust cell"
    sign = "thrust off by a constant, which falls as 1/n^2 in the coefficient, at any airspeed; torque is right"
    sensor = "thrust_N"


class TorqueZero(Zero):
    """The torque cell shows the torque plus a constant share of full scale."""

    id = "torque_zero"
    title = "zero offset of the torque cell"
    sign = "torque off by a constant, which falls as 1/n^2 in the coefficient, at any airspeed; thrust is right"
    sensor = "torque_Nm"


# Drift of a load cell.

TARED = ("run", "once")


@dataclass(frozen=True)
class Drift(Effect):
    """The zero of the cell creeps with time from the start of a run, and follows temperature.

    Notes
    -----
    zero (1 - exp(-t/tau)) + thermal (T - T_0), shares of full scale, T_0 at the start of the run: creep and warm-up of
    strain-gauge cells (OIML R 60:2017 bounds both: creep in 30 min, zero in %/5 K; not checked). Ranges are declared,
    wide enough for hobby cells next to a hot motor. ``tared = "once"``: t counts from the start of the recording, for a
    cell that is not tared before each run.
    """

    zero: float = 0.02
    tau_s: float = 300.0
    thermal: float = 0.0
    tared: str = "run"

    along = ("time_s",)
    kind = "stand"
    fault = "drift"
    parameters = (
        Parameter("zero", "1", -0.10, 0.10, "declared, share of full scale", 3, 0.0),
        Parameter("tau_s", "s", 60.0, 1800.0, "warm-up of strain-gauge cells, 1 to 30 min", 4),
        Parameter("thermal", "1/K", -0.003, 0.003, "declared, ten times OIML R 60 class C", 3, 0.0),
    )
    on_by_default = False

    def __post_init__(self) -> None:
        """Refuse unknown words."""
        choice("tared", self.tared, TARED)

    def applies(self, flow: Flow) -> str:
        """Only time or temperature can show it."""
        if np.ptp(flow.clock) > 0.0 or np.nanmax(np.abs(flow.warming)) > 0.0:
            return ""
        return "the recording has neither time nor a temperature that changes"

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Shift the channel."""
        share = self.zero * -np.expm1(-self._elapsed(flow) / self.tau_s) + self.thermal * flow.warming
        reading.values[self.sensor] = reading.values[self.sensor] + share * reading.full_scale[self.sensor]

    def _elapsed(self, flow: Flow) -> Array:
        """Time since the cell was set to zero, (P,) [s]."""
        if self.tared == "run" or "time_s" not in flow.extra:
            return flow.clock
        t = flow.extra["time_s"]
        return np.asarray(np.nan_to_num(t - np.nanmin(t)))

    def variants(self) -> tuple[dict[str, float | str], ...]:
        """Creep alone, with sizes and times in ratio, and temperature alone."""
        times = (60.0, 120.0, 240.0, 480.0, 930.0, 1800.0)
        sizes = (0.005, 0.01, 0.02, 0.03, 0.05, 0.075, 0.10)
        creep: list[dict[str, float | str]] = [
            {"zero": s * z, "tau_s": t, "thermal": 0.0, "tared": k}
            for k in TARED for s in (-1.0, 1.0) for z in sizes for t in times
        ]  # fmt: skip
        warm: list[dict[str, float | str]] = [
            {"zero": 0.0, "tau_s": 300.0, "thermal": a / 4000.0, "tared": "run"} for a in range(-12, 13) if a
        ]
        return (*creep, *warm)


class ThrustDrift(Drift):
    """The zero of the thrust cell creeps with time from the start of a run, and follows temperature."""

    id = "thrust_drift"
    title = "drift of the thrust cell"
    sign = "thrust depends on time or temperature: the same point reads differently later; torque does not"
    sensor = "thrust_N"


class TorqueDrift(Drift):
    """The zero of the torque cell creeps with time from the start of a run, and follows temperature."""

    id = "torque_drift"
    title = "drift of the torque cell"
    sign = "torque depends on time or temperature: the same point reads differently later; thrust does not"
    sensor = "torque_Nm"


# Cells that feel each other's load.

FORMS = ("torque_in_thrust", "thrust_in_torque")
_SIZES = tuple(k / 100.0 for k in range(-20, 21) if k)


@dataclass(frozen=True)
class CrossTalk(Effect):
    """One cell shows a share of the other load: thrust + k Q / R, or torque + k T R.

    Notes
    -----
    Off-diagonal term of a balance's calibration matrix (AIAA R-091A-2020; Barlow, Rae and Pope 1999, Low-Speed Wind
    Tunnel Testing, ch. 7; not checked). The lever R makes k a pure number; 5 % is declared: an axis that misses the
    cell by R/20, seldom much more. Its sign reverses with the direction of rotation.
    """

    form: str = "torque_in_thrust"
    k: float = 0.02

    id = "cross_talk"
    title = "cross-talk between thrust and torque cell"
    check = "hang a dead weight on each cell separately and read both"
    sign = "one channel follows the load of the other over advance ratio; the sign reverses with the sense of rotation"
    kind = "stand"
    fault = "cross-talk"
    parameters = (Parameter("k", "1", -0.2, 0.2, "declared, arm error of R/20, seldom R/5", off=0.0, usual=0.05),)
    on_by_default = False

    def __post_init__(self) -> None:
        """Refuse unknown forms."""
        choice("form", self.form, FORMS)

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Add the share of the other load."""
        T, Q = reading.values["thrust_N"], reading.values["torque_Nm"]
        if self.form == "torque_in_thrust":
            reading.values["thrust_N"] = T + self.k * Q / flow.R
        else:
            reading.values["torque_Nm"] = Q + self.k * T * flow.R

    def variants(self) -> tuple[dict[str, str | float], ...]:
        """Both directions at forty sizes."""
        return tuple({"form": f, "k": k} for f in FORMS for k in _SIZES)
