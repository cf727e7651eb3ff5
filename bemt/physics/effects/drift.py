"""Drift of a load cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Flow, Parameter, Reading

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
    words = {"tared": TARED}
    parameters = (
        Parameter("zero", "1", -0.10, 0.10, "declared, share of full scale", 3, 0.0),
        Parameter("tau_s", "s", 60.0, 1800.0, "warm-up of strain-gauge cells, 1 to 30 min", 4),
        Parameter("thermal", "1/K", -0.003, 0.003, "declared, ten times OIML R 60 class C", 3, 0.0),
    )
    on_by_default = False

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
        t = flow.time_s
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
