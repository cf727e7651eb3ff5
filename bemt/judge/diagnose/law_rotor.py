"""A rotor that is known by its own recording alone: its curves, and how loads scale from there.

Without a case the signatures of effects come from here, everything else of the judge stays: loads are CT(J, n) and
CQ(J, n) of the reference at V/(n D), V cos(alpha) and rho n^2 of each row. What instruments and the air around a rotor
do follows from that alone, by the hooks of the effects themselves. What changes the blade is scaled by momentum theory
and the slopes of the curves; the error of such laws is that of every law (:mod:`bemt.judge.diagnose.form`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.judge.diagnose.problem import BY_LAWS, Part
from bemt.judge.diagnose.record import STILL, Record
from bemt.physics.effects.base import Effect, Flow, Loads

# Where the reference has no airspeed: advance ratio of no thrust where CP/CT is not known, and the slope of thrust at
# rest, a + b CP/CT between two ends [1]. Those of the solver for eight propellers by label, 8x3.8 to 18x12, and three
# others lie within 0.2 of this line (declared).
_NO_THRUST, _AT_REST, _ENDS = 0.65, (-2.4, 3.9), (-1.8, -0.05)
# How far a coefficient may bend over J and over ln n, share of its largest value.
_OVER_J, _OVER_SPEED = (3.0, 3.0, 2.0), (0.15, 0.1)
# Zero of a cell of the reference, share of full scale (declared).
_ZERO = 0.01
# Scatter of single rows for the fit of a curve, share of the row and of full scale.
_ROW, _FLOOR = 0.01, 0.003
# Bends of a recording that are followed: lengths over J and ln n, size over scatter, fewest points.
_NEAR_J, _NEAR_SPEED, _BENT, _ENOUGH = 0.1, 0.08, 1.5, 8
# Coefficient of thrust by which a diameter is guessed where none is known: propellers of drones have 0.06 to 0.16.
_CT = 0.1
# Least share of profile drag in the torque (declared).
_LEAST_PROFILE = 0.1
# Radius at which blade forces act, share of the tip radius.
_AT = 0.75


@dataclass(frozen=True)
class Laws:
    """Numbers of the laws that theory leaves open; each of :data:`VARIANTS` changes one of them by its uncertainty."""

    no_thrust: float = 1.65  # Advance ratio of no thrust over CP/CT at rest: 1.5 to 1.8 of the same propellers [1]
    slope: float = 0.0  # Added to the slope of thrust at rest [1]
    last_torque: float = 0.3  # Torque there, share of that at rest: 0.1 to 0.5 [1]
    kappa: float = 1.25  # Induced power over that of the ideal disk: 1.1 to 1.4 (Leishman 2006, ch. 2; not checked) [1]
    rise: float = 1.5  # Power of the lift that profile drag rises with [1]
    # Powers of the diameter with which thrust and torque go: 4 and 5 of similar propellers, 1.3 and 1.1 of a tapered
    # blade that is cut, by the solver [1]
    diameter: tuple[float, float] = (4.0, 5.0)
    ducted_kappa: float = 1.05  # As ``kappa`` within a duct, whose wall carries the flow to the tips [1]
    size: float = 1.0  # Diameter over the one that is guessed, where none is known [1]
    # Where electrical power stands for torque: voltage lost in the winding over that of rotation, and current without
    # load over the whole, both at the largest power: 0.05 to 0.25 and 0.02 to 0.1 of drone motors (declared) [1]
    copper: float = 0.15
    idle: float = 0.05


LAWS = Laws()
VARIANTS = (
    replace(LAWS, no_thrust=1.35), replace(LAWS, slope=0.25), replace(LAWS, last_torque=0.5), replace(LAWS, kappa=1.4),
    replace(LAWS, rise=3.0), replace(LAWS, diameter=(2.5, 3.0)), replace(LAWS, ducted_kappa=0.9),
    replace(LAWS, size=0.8), replace(LAWS, copper=0.25), replace(LAWS, idle=0.1),
)  # fmt: skip
"""Laws in which one number is off by about its standard deviation."""


@dataclass(frozen=True, eq=False)
class CoefficientCurve:
    """Coefficient over V/(n D) and ln n, fitted to one recording; beyond it a straight line over J, level over n."""

    weights: Array
    J: tuple[float, float]
    speed: tuple[float, float]  # ln rpm, middle of the recording and half its range
    powers: int  # of J
    # Points (J, ln rpm) of the recording and what they add near them: bends of the stand that no law has
    near: tuple[Array, Array, Array] | None = None

    @classmethod
    def of(cls, coefficient: Array, J: Array, rpm: Array, at_rest: tuple[float, float, float]) -> CoefficientCurve:
        """Least squares with weak priors for slopes and bends (ridge).

        ``at_rest``: slope and bend over J, shares of the coefficient, of a rotor whose recording has no airspeed, and
        the J to which they hold.
        """
        good = np.isfinite(coefficient)
        c, J, x = coefficient[good], J[good], np.log(rpm[good])
        top = float(np.max(np.abs(c), initial=0.0)) or 1.0
        middle, half = 0.5 * float(x.max() + x.min()), 0.5 * float(np.ptp(x))
        span = float(np.ptp(J))
        still = span <= STILL
        powers = 2 if still else min(3, np.unique(np.round(J, 2)).size - 1)
        last = max(float(J.max()), at_rest[2]) if still else float(J.max())
        out = cls(np.zeros(0), (float(J.min()), last), (middle, max(half, 1e-6)), powers)
        A = out._columns(J, x)
        mean, sd = np.zeros(A.shape[1]), np.zeros(A.shape[1])
        level = float(np.median(c))
        mean[0], sd[0] = level, 10.0 * top
        if still:
            mean[1:3], sd[1:3] = np.array(at_rest[:2]) * level, 1e-6 * top
        else:
            sd[1 : 1 + powers] = np.array(_OVER_J[:powers]) * top
        sd[1 + powers :] = np.array((*_OVER_SPEED, _ZERO)) * top * min(1.0, half / 0.1)
        noise = np.hypot(_ROW * c, _FLOOR * top)
        W = A * sd / noise[:, None]
        found = np.linalg.lstsq(
            np.vstack([W, np.eye(sd.size)]), np.concatenate([(c - A @ mean) / noise, np.zeros(sd.size)]), rcond=None
        )[0]
        return replace(out, weights=mean + sd * found)._bent(c, J, x)

    def _bent(self, c: Array, J: Array, x: Array) -> CoefficientCurve:
        """With what neighbours in speed and J share beyond the line, where they scatter by less (kriging)."""
        if x.size < _ENOUGH:
            return self
        left = c - self(J, np.exp(x))
        order = np.lexsort((x, np.round(J, 2)))
        scatter, size = float(np.std(np.diff(left[order]))) / math.sqrt(2.0), float(np.std(left))
        if size < _BENT * max(scatter, _FLOOR * float(np.max(np.abs(c)))):
            return self
        K = size**2 * _neighbours(J, x, J, x)
        weights = np.linalg.solve(K + scatter**2 * np.eye(x.size), left) * size**2
        return replace(self, near=(J, x, np.asarray(weights, float)))

    def _columns(self, J: Array, x: Array) -> Array:
        at = np.clip((x - self.speed[0]) / self.speed[1], -1.0, 1.0) * min(1.0, self.speed[1] / 0.1)
        # full scale is at the highest speed
        zero = np.exp(-2.0 * (np.maximum(x, self.speed[0] - self.speed[1]) - self.speed[0] - self.speed[1]))
        return np.column_stack([np.ones_like(J), *(J ** (k + 1) for k in range(self.powers)), at, at**2, zero - 1.0])

    def __call__(self, J: Array, rpm: Array) -> Array:
        """Coefficient at points."""
        inside = np.clip(J, *self.J)
        line = self._columns(inside, np.log(rpm)) @ self.weights
        if self.near is not None:
            line = line + _neighbours(J, np.log(rpm), *self.near[:2]) @ self.near[2]
        return np.asarray(line + (J - inside) * self.slope(inside))

    def slope(self, J: Array) -> Array:
        """Its slope over J."""
        at = np.clip(J, *self.J)
        return np.asarray(sum((k + 1) * self.weights[1 + k] * at**k for k in range(self.powers)))


def _neighbours(J: Array, x: Array, J_of: Array, x_of: Array) -> Array:
    """How much points share with those of a recording, (P, N) [1]."""
    apart = [(J[:, None] - J_of) / _NEAR_J, (x[:, None] - x_of) / _NEAR_SPEED]
    return np.asarray(np.exp(-0.5 * sum(d * d for d in apart)))


@dataclass(frozen=True, eq=False)
class LawRotor:
    """Stands for the solver's rotor: loads at points with effects on."""

    diameter_m: float
    curves: Mapping[str, CoefficientCurve]
    laws: Laws = LAWS
    # Largest electrical power, where it stands for torque [W], and its speed [rev/min]; NaN: torque itself
    full_power: float = math.nan
    full_rpm: float = math.nan
    duct: Any = None  # as of `bemt.physics.bem.Model`: a recording does not say whether there is one

    @classmethod
    def of(cls, record: Record, diameter_m: float, laws: Laws = LAWS) -> LawRotor:
        """Rotor of a reference; without a diameter the one that a usual thrust coefficient gives."""
        n, rho = record.rpm / 60.0, np.asarray(record.air.rho)
        c = {k: v / (rho * n**2) for k, v in record.measured.items()}
        T, Q = (float(np.nanmedian(np.abs(c[k]))) if k in c else math.nan for k in ("thrust_N", "torque_Nm"))
        D = diameter_m
        if not math.isfinite(D):
            D = laws.size * ((T / _CT) ** 0.25 if math.isfinite(T) else (10.0 * Q / _CT) ** 0.2)
        ratio = 2.0 * math.pi * Q / (T * D) if math.isfinite(T * Q) else _NO_THRUST / LAWS.no_thrust
        last = laws.no_thrust * ratio
        slope = (float(np.clip(_AT_REST[0] + _AT_REST[1] * ratio, *_ENDS)) + laws.slope) * last
        falls = 0.1 * last  # of torque, slightly
        at_rest = {
            "thrust_N": (slope / last, -(1.0 + slope) / last**2, last),
            "torque_Nm": (-falls / last, (laws.last_torque - 1.0 + falls) / last**2, last),
        }
        J = record.V / (n * D)
        curves = {k: CoefficientCurve.of(v, J, record.rpm, at_rest[k]) for k, v in c.items()}
        if not record.electrical:
            return cls(D, curves, laws)
        power = record.measured["torque_Nm"] * 2.0 * math.pi * n
        k = int(np.nanargmax(power))
        return cls(D, curves, laws, float(power[k]), float(record.rpm[k]))

    def flow(self, record: Record) -> Flow:
        """Conditions of a recording with the loads of the curves."""
        nothing, air = np.zeros_like(record.rpm), record.air
        rho, mu, a_sound = (np.asarray(v, float) for v in (air.rho, air.mu, air.a_sound))
        R = 0.5 * self.diameter_m
        flow = Flow(
            record.rpm, record.V, rho, mu, a_sound, R, 0.1 * R, 0.15 * R, 2, False,
            nothing, nothing, nothing, nothing, dict(record.extra),
        )  # fmt: skip
        flow.T0, flow.Q0, flow.dT_dV, flow.dQ_dV = self.loads(flow)
        return flow

    def loads(self, flow: Flow) -> tuple[Array, Array, Array, Array]:
        """Thrust, torque and their slopes with V; zero where the reference does not show one."""
        unit, D = flow.rho * flow.n**2, self.diameter_m
        out = []
        for channel in ("thrust_N", "torque_Nm"):
            c = self.curves.get(channel)
            zero = np.zeros_like(flow.rpm)
            J = flow.V / (flow.n * D)
            out.append((zero, zero) if c is None else (unit * c(J, flow.rpm), unit * c.slope(J) / (flow.n * D)))
        (T, dT), (Q, dQ) = out
        if self.by_power:
            i, n = self._current(Q, flow)
            unit = self.full_power / flow.omega / (1.0 + self.laws.copper)
            Q, dQ = n * (i - self.laws.idle) * unit, dQ * n / (n + 2.0 * self.laws.copper * i)
        return T, Q, dT, dQ

    def respond(self, effects: Sequence[Effect], flow: Flow) -> tuple[Loads, Flow]:
        """Loads with effects on, and the flow that the rotor meets; ``flow`` is one of :meth:`flow`."""
        met = replace(flow, **{k: getattr(flow, k).copy() for k in ("rpm", "V", "rho", "mu", "a_sound")})
        for e in sorted(effects, key=lambda e: e.kind != "stand"):
            e.flow(met)
        if not all(np.array_equal(getattr(met, k), getattr(flow, k)) for k in ("rpm", "V", "rho")):
            met.T0, met.Q0, met.dT_dV, met.dQ_dV = self.loads(met)
        loads = Loads(met.T0.copy(), met.Q0.copy(), np.zeros_like(met.T0))
        for e in effects:
            law = BLADE_LAWS.get(e.id)
            if law is not None:
                law(e, loads, met, self.laws)
            e.loads(loads, met)
        loads.Q = self._read_as(loads.Q, met) * met.rpm / flow.rpm if self.by_power else loads.Q
        return loads, met

    @property
    def by_power(self) -> bool:
        """Whether its torque is electrical power over the speed."""
        return math.isfinite(self.full_power)

    def _current(self, Q: Array, flow: Flow) -> tuple[Array, Array]:
        """Current of a motor that takes the power Q omega, and its speed, shares of those at full power, (P,) [1].

        With i the current and n + r i the voltage, P = i (n + r i)/(1 + r), of which n (i - i0)/(1 + r) turns the
        shaft: a motor of constant K_v, winding and idle current (Drela 2007, "First-Order DC Electric Motor Model",
        eqs 1 to 5; not checked). A controller at part throttle passes power on.
        """
        r, n = self.laws.copper, flow.rpm / self.full_rpm
        share = np.maximum(Q, 0.0) * flow.omega / self.full_power * (1.0 + r)
        return (np.sqrt(n**2 + 4.0 * r * share) - n) / (2.0 * r), n

    def _read_as(self, Q: Array, flow: Flow) -> Array:
        """Electrical power over the speed for a torque of the shaft, (P,) [N m]."""
        r, n, unit = self.laws.copper, flow.rpm / self.full_rpm, self.full_power / flow.omega
        i = np.maximum(self.laws.idle + Q / unit * (1.0 + r) / n, 0.0)
        return np.asarray(i * (n + r * i) / (1.0 + r) * unit)


def _turned(degrees: Array | float, loads: Loads, flow: Flow, laws: Laws) -> None:
    """Turn the blade by an angle at 0.75 R.

    Drag follows the angle also where the blade stalls and lift does not: as much as where thrust follows best.
    """
    _lifted(np.radians(degrees) * _AT * flow.omega * flow.R, loads, flow, laws, stalled=True)


def _lifted(faster: Array, loads: Loads, flow: Flow, laws: Laws, stalled: bool = False) -> None:
    """More lift, as of an inflow slower by so much [m/s] with the induced speed left to follow, and its torque.

    The slope of thrust over V has dv/dV in it: with v (V + v) = T/(2 rho A) (Glauert 1935, ch. VII 2) an angle changes
    thrust by (V + 2 v)/(V + v) times as much as the same change of inflow by V. The power of the added thrust is
    dT (V + 1.5 kappa v), P = T (V + kappa v) + profile.
    """
    V, v = np.maximum(flow.V, 0.0), flow.induced
    dT = -flow.dT_dV * faster * (V + 2.0 * v) / np.maximum(V + v, 1e-9)
    top = np.max(np.abs(flow.T0) / flow.n**2, initial=0.0) * flow.n**2
    share = np.divide(dT, top, out=np.zeros_like(dT), where=top > 0.0)
    if stalled:
        angle = faster / (flow.omega * flow.R)
        slope = np.divide(share, angle, out=np.zeros_like(dT), where=angle != 0.0)
        share = np.asarray(np.max(np.abs(slope), initial=0.0) * angle)
    loads.Q = loads.Q + dT * (V + 1.5 * laws.kappa * v) / flow.omega + _profile(loads, flow, laws) * laws.rise * share
    loads.T = loads.T + dT


def _profile(loads: Loads, flow: Flow, laws: Laws) -> Array:
    """Torque of the profile drag: what thrust and induced speed leave, (P,) [N m]."""
    lifting = np.maximum(loads.T, 0.0) * (flow.V + laws.kappa * flow.induced) / flow.omega
    return np.asarray(np.maximum(loads.Q - lifting, _LEAST_PROFILE * np.abs(loads.Q)))


def _untwist(e: Any, loads: Loads, flow: Flow, laws: Laws) -> None:
    """Nose down by turn_deg at 0.75 R in proportion to rho Omega^2."""
    _turned(-e.turn_deg * e.share(flow), loads, flow, laws)


def _section(e: Any, loads: Loads, flow: Flow, laws: Laws) -> None:
    """Camber turns the zero-lift line by 2 camber; drag scales the profile torque and brakes thrust."""
    dQ = (e.drag - 1.0) * _profile(loads, flow, laws)
    _lifted(2.0 * e.camber * _AT * flow.omega * flow.R, loads, flow, laws)
    helix = (flow.V + flow.induced) / (_AT * flow.omega * flow.R)
    loads.Q = loads.Q + dQ
    loads.T = loads.T - dQ * helix / (_AT * flow.R)


def _diameter(e: Any, loads: Loads, flow: Flow, laws: Laws) -> None:
    """What other powers than those of similar propellers make; the effect itself does the rest."""
    T, Q = (p - q for p, q in zip(laws.diameter, LAWS.diameter, strict=True))
    loads.T, loads.Q = (1.0 + e.change) ** T * loads.T, (1.0 + e.change) ** Q * loads.Q


def _duct(e: Any, loads: Loads, flow: Flow, laws: Laws) -> None:
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
    profile = _profile(loads, flow, laws)
    induced = (loads.Q - profile) * 2.0 * e.wake_ratio * root**3 * (laws.ducted_kappa / laws.kappa)
    loads.Q = loads.Q + fade * (induced + profile * 0.5 * (1.0 + root**2) - loads.Q)
    loads.T = loads.T * (1.0 + fade * (more - 1.0)) - e.outer_drag * 0.5 * flow.rho * V**2 * flow.area


BLADE_LAWS: dict[str, Callable[[Any, Loads, Flow, Laws], None]] = {
    "pitch_offset": lambda e, *of: _turned(e.offset_deg, *of), "untwist": _untwist, "section": _section, "duct": _duct,
    "diameter": _diameter, **dict.fromkeys(("propeller", "nacelle"), lambda *_: None),  # their other hooks say it all
}  # fmt: skip
"""How loads change with effects that have hooks inside of the solver, by id."""


@dataclass(frozen=True, eq=False)
class LawPart(Part):
    """Recording of a rotor that only the reference shows."""

    rotor: LawRotor = field(default_factory=lambda: LawRotor(1.0, {}))

    def _respond(self, effects: Sequence[Effect]) -> tuple[Array, Array, Flow]:
        loads, met = self.rotor.respond(effects, self.flow)
        return loads.T, loads.Q, met


def law_part(record: Record, rotor: LawRotor) -> LawPart:
    """Part of a recording."""
    return LawPart(record, rotor, (), rotor.flow(record), BY_LAWS, rotor=rotor)  # type: ignore[arg-type]
