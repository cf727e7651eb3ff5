"""A rotor that is known by its own recording alone: its curves, and how loads scale from there.

Without a case the signatures of effects come from here, everything else of the judge stays: loads are CT(J, n) and
CQ(J, n) of the reference at V/(n D), V cos(alpha) and rho n^2 of each row. What instruments and the air around a rotor
do follows from that alone, by the hooks of the effects themselves. What changes the blade is scaled by momentum theory
and the slopes of the curves; the error of such laws is that of every law (:mod:`bemt.diagnose.form`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.diagnose.problem import Part
from bemt.diagnose.record import Record
from bemt.effects.base import Effect, Flow, Loads, Reading

__all__ = ["BLADE_LAWS", "Curve", "LawPart", "LawRotor", "law_part"]

Array = NDArray[np.float64]

# Slope of a load over V/(n D) at rest, share of the load, and its standard deviation, where the reference has no airspeed.
# Of thrust it follows CP/CT, that is the pitch: the solver's of eight propellers by label, 8x3.8 to 18x12, and three
# others lie within 0.2 of this line (declared). Torque hardly changes, as the induced power falls with thrust.
_AT_REST = {"thrust_N": (-0.8, 0.4), "torque_Nm": (-0.05, 0.15)}
_BY_PITCH, _BY_PITCH_SD, _STEEP = (-2.4, 3.9), 0.25, (-1.8, -0.05)
# How far a coefficient may bend over J and over ln n, share of its largest value.
_OVER_J, _OVER_SPEED = (3.0, 3.0, 2.0), (0.15, 0.1)
_STILL = 0.02
# Scatter of single rows for the fit of a curve, share of the row and of full scale.
_ROW, _FLOOR = 0.01, 0.003
# Coefficient of thrust by which a diameter is guessed where none is known: propellers of drones have 0.06 to 0.16.
_CT = 0.1
# Induced power over that of the ideal disk, and least share of profile drag in the torque (declared).
_KAPPA, _LEAST_PROFILE = 1.25, 0.1
# Radius at which blade forces act, share of the tip radius.
_AT = 0.75


@dataclass(frozen=True, eq=False)
class Curve:
    """Coefficient over V/(n D) and ln n, fitted to one recording; beyond it a straight line over J, level over n."""

    weights: Array
    J: tuple[float, float]
    speed: tuple[float, float]  # ln rpm, middle of the recording and half its range
    powers: int  # of J

    @classmethod
    def of(cls, coefficient: Array, J: Array, rpm: Array, at_rest: tuple[float, float]) -> Curve:
        """Least squares with weak priors for slopes and bends (ridge)."""
        good = np.isfinite(coefficient)
        c, J, x = coefficient[good], J[good], np.log(rpm[good])
        top = float(np.max(np.abs(c), initial=0.0)) or 1.0
        middle, half = 0.5 * float(x.max() + x.min()), 0.5 * float(np.ptp(x))
        span = float(np.ptp(J))
        powers = min(3, np.unique(np.round(J, 2)).size - 1) if span > _STILL else 1
        out = cls(np.zeros(0), (float(J.min()), float(J.max())), (middle, max(half, 1e-6)), powers)
        A = out._columns(J, x)
        mean, sd = np.zeros(A.shape[1]), np.zeros(A.shape[1])
        level = float(np.median(c))
        mean[0], sd[0] = level, 10.0 * top
        for k in range(powers):
            sd[1 + k] = _OVER_J[k] * top
        if span <= _STILL:
            slope, spread = at_rest
            mean[1], sd[1] = slope * level, spread * abs(level)
        sd[1 + powers :] = np.array(_OVER_SPEED) * top * min(1.0, half / 0.1)
        noise = np.hypot(_ROW * c, _FLOOR * top)
        W = A * sd / noise[:, None]
        found = np.linalg.lstsq(
            np.vstack([W, np.eye(sd.size)]), np.concatenate([(c - A @ mean) / noise, np.zeros(sd.size)]), rcond=None
        )[0]
        return replace(out, weights=mean + sd * found)

    def _columns(self, J: Array, x: Array) -> Array:
        at = np.clip((x - self.speed[0]) / self.speed[1], -1.0, 1.0) * min(1.0, self.speed[1] / 0.1)
        return np.column_stack([np.ones_like(J), *(J ** (k + 1) for k in range(self.powers)), at, at**2])

    def __call__(self, J: Array, rpm: Array) -> Array:
        """Coefficient at points."""
        inside = np.clip(J, *self.J)
        line = self._columns(inside, np.log(rpm)) @ self.weights
        return np.asarray(line + (J - inside) * self.slope(inside))

    def slope(self, J: Array) -> Array:
        """Its slope over J."""
        at = np.clip(J, *self.J)
        return np.asarray(sum((k + 1) * self.weights[1 + k] * at**k for k in range(self.powers)))


@dataclass(frozen=True, eq=False)
class LawRotor:
    """Stands for the solver's rotor: loads at points with effects on."""

    diameter_m: float
    curves: Mapping[str, Curve]
    duct: Any = None  # as of `bemt.bem.Model`: a recording does not say whether there is one

    @classmethod
    def of(cls, record: Record, diameter_m: float) -> LawRotor:
        """Rotor of a reference; without a diameter the one that a usual thrust coefficient gives."""
        n, rho = record.rpm / 60.0, np.asarray(record.air.rho)
        D = diameter_m
        if not math.isfinite(D):
            T, Q = (np.abs(record.measured.get(c, np.full(n.size, np.nan))) / (rho * n**2) for c in _AT_REST)
            D = float(np.nanquantile(T, 0.9) / _CT) ** 0.25 if np.isfinite(T).any() else (
                float(np.nanquantile(Q, 0.9) / (0.1 * _CT))) ** 0.2  # fmt: skip
        J, unit = record.V / (n * D), rho * n**2
        at_rest = dict(_AT_REST)
        if at_rest.keys() <= record.measured.keys():
            T, Q = (float(np.nanmedian(record.measured[c] / unit)) for c in at_rest)
            slope = _BY_PITCH[0] + _BY_PITCH[1] * 2.0 * math.pi * Q / (T * D) if T > 0.0 else _AT_REST["thrust_N"][0]
            at_rest["thrust_N"] = float(np.clip(slope, *_STEEP)), _BY_PITCH_SD
        return cls(D, {c: Curve.of(y / unit, J, record.rpm, at_rest[c]) for c, y in record.measured.items()})

    def flow(self, record: Record) -> Flow:
        """Conditions of a recording with the loads of the curves."""
        nothing, air = np.zeros_like(record.rpm), record.air
        R = 0.5 * self.diameter_m
        flow = Flow(
            record.rpm, record.V, air.rho, air.mu, air.a_sound, R, 0.1 * R, 0.15 * R, 2, False,
            nothing, nothing, nothing, nothing, dict(record.extra),
        )  # fmt: skip
        flow.T0, flow.Q0, flow.dT_dV, flow.dQ_dV = self.loads(flow)
        return flow

    def loads(self, flow: Flow) -> tuple[Array, Array, Array, Array]:
        """Thrust, torque and their slopes with V; zero where the reference does not show one."""
        unit, D = flow.rho * flow.n**2, self.diameter_m
        out = []
        for channel in _AT_REST:
            c = self.curves.get(channel)
            zero = np.zeros_like(flow.rpm)
            J = flow.V / (flow.n * D)
            out.append((zero, zero) if c is None else (unit * c(J, flow.rpm), unit * c.slope(J) / (flow.n * D)))
        return out[0][0], out[1][0], out[0][1], out[1][1]

    def respond(self, effects: Sequence[Effect], flow: Flow) -> tuple[Loads, Flow]:
        """Loads with effects on, and the flow that the rotor meets."""
        met = replace(flow, **{k: getattr(flow, k).copy() for k in ("rpm", "V", "rho", "mu", "a_sound")})
        for e in sorted(effects, key=lambda e: e.kind != "stand"):
            e.flow(met)
        met.T0, met.Q0, met.dT_dV, met.dQ_dV = self.loads(met)
        loads = Loads(met.T0.copy(), met.Q0.copy(), np.zeros_like(met.T0))
        for e in effects:
            law = BLADE_LAWS.get(e.id)
            if law is not None:
                law(e, loads, met)
            e.loads(loads, met)
        return loads, met


def _turned(degrees: Array | float, loads: Loads, flow: Flow) -> None:
    """Turn the blade by an angle at 0.75 R."""
    _lifted(np.radians(degrees) * _AT * flow.omega * flow.R, loads, flow)


def _lifted(faster: Array, loads: Loads, flow: Flow) -> None:
    """More lift, as of an inflow slower by so much [m/s] with the induced speed left to follow, and its torque.

    The slope of thrust over V has dv/dV in it: with v (V + v) = T/(2 rho A) (Glauert 1935, ch. VII 2) an angle changes
    thrust by (V + 2 v)/(V + v) times as much as the same change of inflow by V. The power of the added thrust is
    dT (V + 1.5 kappa v), P = T (V + kappa v) + profile; the profile drag rises as the lift to the power 1.5 (declared).
    """
    V, v = np.maximum(flow.V, 0.0), flow.induced
    dT = -flow.dT_dV * faster * (V + 2.0 * v) / np.maximum(V + v, 1e-9)
    top = np.max(np.abs(flow.T0) / flow.n**2, initial=0.0) * flow.n**2
    share = np.divide(dT, top, out=np.zeros_like(dT), where=top > 0.0)
    loads.Q = loads.Q + dT * (V + 1.5 * _KAPPA * v) / flow.omega + _profile(loads, flow) * 1.5 * share
    loads.T = loads.T + dT


def _profile(loads: Loads, flow: Flow) -> Array:
    """Torque of the profile drag: what thrust and induced speed leave, (P,) [N m]."""
    lifting = np.maximum(loads.T, 0.0) * (flow.V + _KAPPA * flow.induced) / flow.omega
    return np.asarray(np.maximum(loads.Q - lifting, _LEAST_PROFILE * np.abs(loads.Q)))


def _pitch_offset(e: Any, loads: Loads, flow: Flow) -> None:
    _turned(e.offset_deg, loads, flow)


def _untwist(e: Any, loads: Loads, flow: Flow) -> None:
    """Nose down by tip_deg (r/R)^2 in proportion to rho Omega^2; at 0.75 R."""
    _turned(-e.tip_deg * _AT**2 * e.share(flow), loads, flow)


def _section(e: Any, loads: Loads, flow: Flow) -> None:
    """Camber turns the zero-lift line by 2 camber; drag scales the profile torque and brakes thrust."""
    dQ = (e.drag - 1.0) * _profile(loads, flow)
    _turned(math.degrees(2.0 * e.camber), loads, flow)
    helix = (flow.V + flow.induced) / (_AT * flow.omega * flow.R)
    loads.Q = loads.Q + dQ
    loads.T = loads.T - dQ * helix / (_AT * flow.R)


def _tip_cut(e: Any, loads: Loads, flow: Flow) -> None:
    """A blade that tapers to its tip loses less there than a similar smaller one, and keeps its J of no thrust.

    Powers of the radius: the solver's of tapered blades are 1.3 and 1.1, of similar ones 4 and 5 (declared: between).
    """
    smaller = 1.0 - e.cut
    loads.T, loads.Q = smaller**2.0 * loads.T, smaller**1.8 * loads.Q


def _duct(e: Any, loads: Loads, flow: Flow) -> None:
    """More air through the disk unloads the blades, the duct adds to the thrust; both fade with speed.

    At rest the disk takes sigma (2 T_r/(rho A))^1/2 instead of (T/(2 rho A))^1/2, and T = 2 sigma T_r (McCormick 1967,
    ch. 9), so that x = T_r/T solves x = 1 - s (2 sigma x^1/2 - 1), s the unloading by one induced speed. Lip loss takes
    its share of the duct's part, walls drag, and without flow around the tips kappa is 1 or nearly.
    """
    V, v = np.maximum(flow.V, 0.0), flow.induced
    fade = v**2 / np.maximum(v**2 + flow.V**2, 1e-12)
    slope = np.divide(-flow.dT_dV * v, flow.T0, out=np.zeros_like(v), where=flow.T0 > 0.0)
    s = np.clip(2.0 * slope / np.maximum(1.0 - slope, 0.2), 0.0, 2.0)
    root = -s * e.wake_ratio + np.sqrt((s * e.wake_ratio) ** 2 + 1.0 + s)
    more = root**2 * (1.0 + (2.0 * e.wake_ratio - 1.0) * (1.0 - 1.6 * e.lip_loss))
    profile = _profile(loads, flow)
    induced = (loads.Q - profile) * 2.0 * e.wake_ratio * root**3 * (1.05 / _KAPPA)
    loads.Q = loads.Q + fade * (induced + profile * 0.5 * (1.0 + root**2) - loads.Q)
    loads.T = loads.T * (1.0 + fade * (more - 1.0)) - e.outer_drag * 0.5 * flow.rho * V**2 * flow.area


def _nothing(e: Any, loads: Loads, flow: Flow) -> None:
    """Its other hooks say it all."""


BLADE_LAWS: dict[str, Callable[[Any, Loads, Flow], None]] = {
    "pitch_offset": _pitch_offset, "untwist": _untwist, "section": _section, "tip_cut": _tip_cut, "duct": _duct,
    "propeller": _nothing, "diameter": _nothing, "nacelle": _nothing,
}  # fmt: skip
"""How loads change with effects that have hooks inside of the solver, by id."""


@dataclass(frozen=True, eq=False)
class LawPart(Part):
    """Recording of a rotor that only the reference shows."""

    rotor: LawRotor = field(default_factory=lambda: LawRotor(1.0, {}))

    def _ours(self, effects: Sequence[Effect]) -> Array:
        key = tuple(effects)
        loads, met = self.rotor.respond(key, self.flow)
        reading = Reading({"thrust_N": loads.T.copy(), "torque_Nm": loads.Q.copy()}, self.full_scale)
        for e in key:
            e.reading(reading, met)
        return np.concatenate([reading.values[c] for c in self.channels])


def law_part(record: Record, rotor: LawRotor) -> LawPart:
    """Part of a recording."""
    return LawPart(record, rotor, (), rotor.flow(record), "laws", rotor=rotor)  # type: ignore[arg-type]
