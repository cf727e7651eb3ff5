"""Rigs and test plans of the proof: which rotor is tested, in which duct, at which points and in which order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.judge.proof.stand import StandMotor
from bemt.judge.proof.truth import TruthRotor
from bemt.judge.proof.truth_duct import TruthDuct
from bemt.judge.proof.truth_section import TrueSection
from bemt.judge.proof.truth_world import Conditions

OPEN_PLANS = ("static_sweep", "grid_shuffled", "grid_ordered", "two_air", "wall", "endurance", "transient")
DUCTED_PLANS = ("static_sweep", "grid_shuffled", "two_air", "gap", "endurance")
UNDERPOWERED = ("static_narrow", "single_line")
HUB_OPEN, HUB_DUCTED, WALL = 0.15, 0.35, 1.01
_SOUND = 343.0


@dataclass(frozen=True)
class Rig:
    """A rotor on its stand."""

    name: str  # Fit for a folder
    rotor: TruthRotor  # Blades
    duct: TruthDuct | None  # Duct around it
    pitch_ratio: float  # Geometric pitch over diameter. [-]
    tip_mach: float  # Rotational tip Mach number at the top of its speed range, 20 C. [-]
    motor: StandMotor  # Drive

    @property
    def top_rpm(self) -> float:
        """Highest speed. [rev/min]"""
        return self.tip_mach * _SOUND / self.rotor.radius * 60.0 / (2.0 * np.pi)


def draw_rig(name: str, ducted: bool, rng: np.random.Generator, code: str = "vortex") -> Rig:
    """Draw a rotor from the ranges of small propellers and fans."""
    hub = HUB_DUCTED if ducted else HUB_OPEN
    blades = int(rng.choice((3, 4, 5, 6) if ducted else (2, 2, 2, 3, 4)))
    radius = float(rng.uniform(0.035, 0.12) if ducted else rng.uniform(0.09, 0.22))
    pitch = float(rng.uniform(0.7, 1.1) if ducted else rng.uniform(0.45, 0.85))
    mach = float(rng.uniform(0.5, 0.85))
    x = np.linspace(hub, 1.0, 21)
    widest = float(rng.uniform(0.18, 0.30) if ducted else rng.uniform(0.14, 0.23))
    peak = float(rng.uniform(0.35, 0.55))
    if ducted:
        chord = widest * (1.0 + float(rng.uniform(-0.2, 0.2)) * (x - peak))
    else:
        inner = 0.55 + 0.45 * np.sin(0.5 * np.pi * np.clip((x - hub) / (peak - hub), 0.0, 1.0))
        chord = widest * np.where(x < peak, inner, np.sqrt(np.maximum(1.0 - ((x - peak) / (1.04 - peak)) ** 2, 0.05)))
    section = TrueSection(float(rng.uniform(0.02, 0.05)), 0.4, float(rng.uniform(0.07, 0.12)))
    beta = np.arctan(pitch / (np.pi * x))
    rotor = TruthRotor(
        radius, blades, tuple(map(float, x)), tuple(map(float, chord)), tuple(map(float, beta)), section,
        wall=WALL if ducted else float("nan"), code=code,
    )  # fmt: skip
    duct = None
    if ducted:
        length = float(rng.uniform(0.8, 1.8))
        duct = TruthDuct(length, length * float(rng.uniform(0.25, 0.45)), float(rng.uniform(0.006, 0.012)),
                         float(rng.uniform(0.92, 1.05)), float(rng.uniform(0.08, 0.2)))  # fmt: skip
    top = mach * _SOUND / radius * 60.0 / (2.0 * np.pi)
    # torque at full speed, roughly, sets current and resistance of a motor that fits
    torque = 0.006 * 1.2 * (top / 60.0) ** 2 * (2.0 * radius) ** 5 * blades / 2.0
    volts = 22.2 if radius < 0.15 else 44.4
    kv = top / (0.75 * volts)
    amps = torque * 2.0 * np.pi * kv / 60.0
    return Rig(
        name, rotor, duct, pitch, mach, StandMotor(kv, 0.06 * volts / amps, 0.02 * amps, volts, 0.03 * volts / amps)
    )


def conditions(plan: str, rig: Rig, rng: np.random.Generator) -> Conditions:
    """Rows of a test plan, in the order in which they are taken."""
    top, R = rig.top_rpm, rig.rotor.radius
    T0, p0 = float(rng.uniform(12.0, 26.0)), float(rng.uniform(97e3, 102.5e3))
    jmax = (0.9 if rig.duct is None else 0.6) * rig.pitch_ratio
    nan = float("nan")

    def rows(
        rpm: Array, j: Array, T: Array | float = T0, p: Array | float = p0, wall: Array | float = nan,
        gap: Array | float = nan, run: Array | int = 0, dwell: float = 12.0, shuffle: bool = False, start: bool = False,
    ) -> Conditions:  # fmt: skip
        parts = list(np.broadcast_arrays(*(np.asarray(v, float) for v in (rpm, j, T, p, wall, gap, run))))
        if shuffle:
            order = np.lexsort((rng.random(parts[0].size), parts[6]))
            parts = [v[order] for v in parts]
        n = parts[0].size
        label = parts[6].astype(np.int64)
        time = dwell * np.arange(n) * (1.0 + 0.1 * rng.random()) + 240.0 * np.cumsum(
            np.diff(label, prepend=label[0]) != 0
        )
        first = np.array([np.flatnonzero(label == k)[0] for k in label])
        since = time - time[first] + dwell if start else np.full(n, 600.0)
        drift = 0.3 * np.sin(time / 900.0)  # a hall warms and cools
        return Conditions(parts[0], parts[1] * parts[0] / 60.0 * 2.0 * R, parts[2] + drift, parts[3], time, since,
                          parts[4], parts[5], label)  # fmt: skip

    def grid(speeds: Array, advances: Array) -> tuple[Array, Array]:
        a, b = np.meshgrid(speeds, advances, indexing="ij")
        return a.ravel(), b.ravel()

    if plan == "static_sweep":
        up = np.linspace(0.25, 1.0, 12) * top
        once = np.concatenate((up, up[::-1]))
        return rows(np.tile(once, 2), np.zeros(48), run=np.repeat([0, 1], 24))
    if plan in ("grid_shuffled", "grid_ordered"):
        n, j = grid(np.linspace(0.3, 1.0, 6) * top, np.linspace(0.0, jmax, 9))
        return rows(n, j, run=np.repeat([0, 1, 2, 3, 4, 5], 9) // 2, shuffle=plan == "grid_shuffled")
    if plan == "two_air":
        n, j = grid(np.linspace(0.35, 1.0, 5) * top, np.linspace(0.0, jmax, 6))
        cold = np.repeat([0, 1], n.size)
        return rows(np.tile(n, 2), np.tile(j, 2), T=np.where(cold, T0 - 22.0, T0), p=np.where(cold, 0.80 * p0, p0),
                    run=cold, shuffle=True)  # fmt: skip
    if plan == "wall":
        n, z = grid(np.linspace(0.35, 0.9, 6) * top, np.array([0.6, 0.8, 1.1, 1.6, 2.5, 4.0, 8.0]) * R)
        return rows(n, np.zeros(n.size), wall=z, run=0, shuffle=True)
    if plan == "gap":
        span = (1.0 - rig.rotor.hub) * R
        n, g = grid(np.linspace(0.4, 1.0, 6) * top, np.array([0.006, 0.012, 0.02, 0.03, 0.045]) * span)
        n2, g2 = n, g
        return rows(np.concatenate((n, n2)), np.repeat([0.0, 0.5 * jmax], n.size), gap=np.concatenate((g, g2)),
                    run=np.repeat([0, 1], n.size), shuffle=True)  # fmt: skip
    if plan == "endurance":
        levels = np.tile(np.array([0.45, 0.7, 0.95, 0.6, 0.85]) * top, 12)
        return rows(levels, np.zeros(60), run=np.repeat([0, 1, 2], 20), dwell=30.0, start=True)
    if plan == "transient":
        t = np.asarray(np.arange(160) * 0.025, dtype=np.float64)
        corners = [0.0, 0.5, 0.51, 1.5, 1.51, 2.5, 2.51, 3.2, 3.21, 4.0]
        target = np.interp(t, corners, np.repeat([0.4, 0.8, 0.55, 0.95, 0.5], 2))
        n = np.empty(t.size)
        n[0] = target[0]
        for i in range(1, t.size):
            n[i] = n[i - 1] + (1.0 - np.exp(-0.025 / 0.12)) * (target[i] - n[i - 1])
        still = np.full(t.size, nan)
        state = (np.full(t.size, T0), np.full(t.size, p0), t, np.full(t.size, 600.0), still, still)
        return Conditions(np.asarray(n * top), 0.0 * t, *state, np.zeros(t.size, dtype=np.int64), True)
    if plan == "static_narrow":
        return rows(np.tile(np.linspace(0.45, 0.55, 4) * top, 3), np.zeros(12))
    if plan == "single_line":
        return rows(np.full(9, 0.5 * top), np.linspace(0.0, jmax, 9))
    raise ValueError(f"unknown plan {plan!r}")


def extended(rows: Conditions, points: Sequence[Mapping[str, float]]) -> Conditions:
    """Rows of a plan with recommended points behind them, as a run of its own."""

    def column(name: str, key: str, usual: float, scale: float = 1.0) -> np.ndarray[Any, np.dtype[np.float64]]:
        new = [float(p[key]) * scale if key in p else usual for p in points]
        return np.concatenate((getattr(rows, name), new))

    last = float(rows.time[-1]) + 240.0
    moment = np.concatenate((rows.time, [float(p.get("time_s", last + 12.0 * k)) for k, p in enumerate(points)]))
    wall, gap = (float(np.median(v)) for v in (rows.wall, rows.gap))
    return Conditions(
        column("rpm", "rpm", float(np.median(rows.rpm))), column("airspeed", "airspeed_m_s", 0.0),
        column("temperature_C", "temperature_C", float(np.median(rows.temperature_C))),
        column("pressure_Pa", "pressure_Pa", float(np.median(rows.pressure_Pa))), moment,
        np.concatenate((rows.since_start, np.full(len(points), 600.0))), column("wall", "wall_distance_m", wall),
        column("gap", "tip_gap_mm", gap, 1e-3), np.concatenate((rows.run, np.full(len(points), rows.run.max() + 1))),
        rows.transient,
    )  # fmt: skip
