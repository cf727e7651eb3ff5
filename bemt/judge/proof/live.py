"""The simulated stand: the rotor, the cells and the faults of the proof's hidden items, live behind a pulse width."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from bemt.judge.proof.causes import applied, extended
from bemt.judge.proof.items import Bench, Hidden, hidden
from bemt.judge.proof.rows import Entry
from bemt.judge.proof.stand import full_scales, record
from bemt.judge.proof.truth_world import Conditions, TrueLoads, loads

STOP_US, CUT_OFF_S = 1000.0, 0.2
_LAG_S = 0.15  # Motor and rotor, first order
_TOP, _CURVE = 1.4, 0.85  # Speed at full command over the top of the range, and its growth with the command
_SETTLED, _STILL, _CALM_S = 1e-3, 0.02, 0.03  # Of the speed; a command that stays so long is solved for
_STATES = {"wall": "wall_distance_m", "gap": "tip_gap_mm"}


class Truth:
    """A stand with what is wrong with it; time runs ``lapse`` times as fast."""

    def __init__(self, bench: Bench, entry: Entry, lapse: float = 1.0) -> None:
        self.bench, self.entry, self.lapse = bench, entry, lapse
        self.lock = threading.RLock()
        self.cells: dict[str, float] | None = None  # As they read at the speed ``read_at``
        self.read_at = self.torque = 0.0
        self.us, self.changed, self.client, self.cut = STOP_US, time.monotonic(), 0.0, False
        self.rpm, self.then, self.broken = 0.0, time.monotonic(), ""
        self.noise = np.random.default_rng()
        own = self._hidden(())
        self.scales = full_scales(bench.measure(own.world, own.stand)[0])
        self.set_up("again", [], (), 0)

    @property
    def patience(self) -> float:
        """Longest time without a client. [s]"""
        return CUT_OFF_S if self.lapse == 1.0 else 100.0 * CUT_OFF_S

    def _hidden(self, mended: Sequence[str]) -> Hidden:
        e = self.entry
        return hidden(self.bench, e.causes, e.strengths, e.seed, e.set, mended)

    def set_up(self, kind: str, runs: Sequence[Sequence[Mapping[str, float]]], mended: Sequence[str], day: int) -> Any:
        """Prepare a run as somebody at the stand does; its rows, those that the rotor can do."""
        plan = self.bench.rows
        draw: tuple[int, ...] = (4 if kind == "reference" else 3, day)
        if kind == "run":
            for points in runs:
                plan = extended(plan, points)
            own, draw = slice(plan.rpm.size - len(runs[-1]), None), (2, len(runs), day)
            plan = _part(plan, own)
        ducted = self.bench.rig.duct is not None
        taken = [c for c in self._hidden(()).causes if c.removable] if kind == "reference" else []
        h = self._hidden([*mended, *(c.id for c in taken)])
        world, stand = h.world, h.stand
        for cause in taken:
            ducted = ducted and cause.without.ducted is not False
            world, stand = applied(world, stand, cause.without)
        rotor = self.bench.rig.rotor if ducted else replace(self.bench.rig.rotor, wall=float("nan"))
        duct = self.bench.rig.duct if ducted else None
        real = loads(rotor, world, plan, duct, None)
        with self.lock:
            self.rotor, self.duct, self.world, self.stand, self.plan, self.real = rotor, duct, world, stand, plan, real
            self.seed, self.k, self.solved, self.cells = (self.entry.seed, *draw), 0, (0.0, 0.0, 0.0), None
        hall = np.random.default_rng((*self.seed, 5)).standard_normal(plan.rpm.size + 1)
        out = []
        for k in np.flatnonzero(np.isfinite(real.thrust) & np.isfinite(real.torque)):
            row = {"k": int(k), "run": int(plan.run[k]), "rpm": float(plan.rpm[k]), "time_s": float(plan.time[k]),
                   "airspeed_m_s": float(plan.airspeed[k]),
                   "temperature_C": float(plan.temperature_C[k] + 0.1 * hall[k])}  # fmt: skip
            if "air_density" not in self.entry.causes:  # the weather was asked for
                row["pressure_Pa"] = float(plan.pressure_Pa[k] + 30.0 * hall[-1])
            if np.isfinite(plan.wall[k]):
                row["wall_distance_m"] = float(plan.wall[k])
            if self.bench.plan == "gap":
                row["tip_gap_mm"] = 1e3 * float(plan.gap[k])
            out.append(row)
        return out

    def place(self, k: int) -> None:
        """Bring wind, wall, gap and air to those of a row."""
        with self.lock:
            self.k, self.solved, self.cells = k, (0.0, 0.0, 0.0), None

    def command(self, us: float) -> None:
        """Take a pulse width."""
        with self.lock:
            self._turn()
            self.client = time.monotonic()
            if not self.cut:
                self._output(us)

    def _output(self, us: float) -> None:
        if us != self.us:
            self.us, self.changed = us, time.monotonic()

    def watch(self) -> None:
        """Cut off where no client is heard: the stand's own watchdog."""
        with self.lock:
            if self.us > STOP_US and time.monotonic() - self.client > self.patience:
                self.cut_off()

    def cut_off(self) -> None:
        """Output to its stop value until it is cleared."""
        with self.lock:
            self._turn()
            self._output(STOP_US)
            self.cut = True

    def _there(self) -> float:
        """Speed that belongs to the command. [rev/min]"""
        return float(_TOP * self.bench.rig.top_rpm * (max(self.us - STOP_US, 0.0) / 1000.0) ** _CURVE)

    def _turn(self) -> None:
        """Let the rotor follow the command."""
        now = time.monotonic()
        there = self._there()
        self.rpm = there + (self.rpm - there) * float(np.exp(-(now - self.then) * self.lapse / _LAG_S))
        self.rpm = there if abs(self.rpm - there) < _SETTLED * there else self.rpm
        self.then = now

    def sample(self) -> dict[str, float]:
        """What the instruments show now."""
        with self.lock:
            self._turn()
            read = dict(self._cells())
            sigma = {n: self.stand.noise * abs(v) for n, v in read.items()}
            for name, full in zip(("thrust_N", "torque_Nm"), self.scales, strict=True):
                sigma[name] = float(np.hypot(sigma[name], self.stand.floor * full))
            sigma |= {"rpm": self.stand.rpm_noise * self.rpm, "airspeed_m_s": self.stand.airspeed_noise}
            row = {n: v + sigma[n] * float(self.noise.standard_normal()) for n, v in read.items()}
            k_t = 60.0 / (2.0 * np.pi * self.bench.rig.motor.kv)
            row["current_A"] = abs(self.torque) / k_t + self.bench.rig.motor.idle_A * (self.rpm > 0.0)
            row["vibration_m_s2"] = 0.2 + 2.0 * (self.rpm / self.bench.rig.top_rpm) ** 2
            if self.broken == "nan":
                row["thrust_N"] = float("nan")
            if self.broken == "current":
                row["current_A"] += 1e4
            if not np.any(self.plan.airspeed > 0.0):
                row.pop("airspeed_m_s")  # no tunnel, no pitot
            return row

    def _cells(self) -> dict[str, float]:
        """Cells at the present speed, the noise of this row and this day in them."""
        plan, k, there = self.plan, self.k, self._there()
        calm = (time.monotonic() - self.changed) * self.lapse > _CALM_S
        due = calm and there > _STILL * self.bench.rig.top_rpm and self.solved[0] != there
        if self.cells is not None and self.read_at == self.rpm and not due:
            return self.cells
        scaled = (there / float(plan.rpm[k])) ** 2
        if due:
            self.solved = (there, scaled * float(self.real.thrust[k]), scaled * float(self.real.torque[k]))
            c = _part(replace(plan, rpm=np.full(plan.rpm.size, there)), slice(k, k + 1))
            real = loads(self.rotor, self.world, c, self.duct, None)
            if np.isfinite(real.thrust[0] + real.torque[0]):
                self.solved = (there, float(real.thrust[0]), float(real.torque[0]))
        near = self.solved if self.solved[0] else (plan.rpm[k], self.real.thrust[k], self.real.torque[k])
        T, Q = (float(v) * (self.rpm / float(near[0])) ** 2 for v in near[1:])
        self.torque, self.read_at = Q, self.rpm
        thrust, torque, rpm = self.real.thrust.copy(), self.real.torque.copy(), plan.rpm.copy()
        thrust[k], torque[k], rpm[k] = T, Q, self.rpm
        quiet = np.nan_to_num(thrust), np.nan_to_num(torque)
        rng = np.random.default_rng(self.seed)
        shown = record(TrueLoads(*quiet, self.real.re75, self.real.m_tip, self.real.answer), replace(plan, rpm=rpm),
                       self.rotor.radius, None, self.stand, rng, self.scales)  # fmt: skip
        self.cells = {n: float(v[k]) for n, v in shown.items() if n != "time_s"}
        return self.cells


def _part(plan: Conditions, where: slice) -> Conditions:
    """Some rows of a plan."""
    return replace(plan, **{f.name: getattr(plan, f.name)[where] for f in fields(plan) if f.name != "transient"})
