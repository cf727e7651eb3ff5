"""The blade as an optimisation: power and constraints of control values, with gradients, all from the real solver.

    minimise   sum_k w_k P_k                            mean power over the points
    subject to T_k >= T_k required                      also at points of weight 0
               alpha <= that of (1 - margin) cl_max     every element, every point of weight
               stress <= strength / safety              every element, every point
               chord >= what chord and thickness ask    every element, hub and tip
               chord <= 0.3 R and 0.9 of the gap between blades (in a duct R and twice the gap)

The angle of attack is limited, not the lift coefficient, since a stalled section has a lift that any limit allows: up
to where the table with which the solver works (rotation, neighbouring blades) first has the lift that is left of the
isolated section's largest, at the element's Reynolds number, less by Prandtl and Glauert's factor at its Mach number.
The annuli of a rotor do not know of each other, so that five rotors give the gradient of everything by all chords and
angles (:mod:`bemt.physics.bem.gradient`); the control points follow by the chain rule. Over rotors as built,
power, thrust and margins are means of the rotors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import InputError
from bemt.physics.bem import gradient as around
from bemt.physics.bem.kernel import N_OUT, O_JET, O_MASS, O_SPIN, O_STATOR, O_WHIRL
from bemt.physics.bem.packing import blend_weights
from bemt.physics.effects import Effect
from bemt.physics.sections.polars import ALPHA_GRID, DEFAULT_RE, DLOG_RE, LOG_RE0, first_stall
from bemt.tools.design import requirement
from bemt.tools.design.minimum_loss import CONTROLS, BladeShape
from bemt.tools.design.requirement import WIDEST, Requirement

if TYPE_CHECKING:
    from bemt.physics.bem.duct import DuctFlow
    from bemt.physics.bem.model import Model
    from bemt.physics.bem.solver import Prepared
    from bemt.physics.sections.polars import Polar
    from geometry.rotor import Stations

COLUMNS = ("dT", "dQ", "alpha", "W", "w", "v_t", "cl")
_ALPHA, _W, _AXIAL, _SWIRL, _CL, _ROOM, _LIFT = range(2, 9)  # the last two are added here
_STEP_RPM = 1e-6
_FLOOR = 1e-3
_STEEP = 5.0  # Lift coefficient over angle: of the size of the other constraints [1/rad]
_ANGLES = np.flatnonzero((ALPHA_GRID >= math.radians(-20.0)) & (ALPHA_GRID <= math.radians(35.0)))
_MACH = 0.9  # Beyond, Prandtl and Glauert's factor is held
GAPS, FAN_GAPS = 0.9, 2.0
"""Largest chord over the distance between blades, in the open and in a duct [1]."""
_TIGHT = 2e-3
"""Distance from a limit, as a share of it, below which it counts as reached."""


@dataclass(frozen=True, eq=False)
class Values:
    """What a blade does at the points: rotors as built averaged."""

    # (P,) Speed [rev/min], thrust with duct, shaft power
    rpm: Array
    thrust_N: Array
    power_W: Array
    # (P, N) Lift coefficient and its limit [1], thrust per radius of all blades [N/m], stress [Pa]
    cl: Array
    limit: Array
    load: Array
    stress_Pa: Array
    objective: float  # Mean power over the scale of the problem
    margins: Array  # (M,) Constraints, good at 0 or above
    # (V,), (M, V) Their derivatives by the variables
    gradient: Array
    jacobian: Array


@dataclass(frozen=True, eq=False)
class BladeProblem:
    """A requirement, a model with its sections and duct, and blades around a start.

    ``variants`` are the effects of the rotors that count alike: one rotor as drawn, or several as built. Variables are
    the control values of `Shape`, then the logarithm of the free speeds over ``rpm0``.
    """

    need: Requirement
    model: Model
    shape: BladeShape
    rpm0: Array
    variants: Sequence[Sequence[Effect]]
    scale_W: float
    _last: dict[bool, tuple[bytes, Values]] = field(default_factory=dict, init=False)

    @cached_property
    def free(self) -> NDArray[np.intp]:
        """Points whose speed is found."""
        return np.array([i for i, p in enumerate(self.need.points) if p.rpm is None], dtype=np.intp)

    @cached_property
    def size(self) -> int:
        """Number of variables."""
        return 2 * CONTROLS + self.free.size

    @cached_property
    def weights(self) -> Array:
        """Shares of the time, (P,)."""
        w = np.array([p.weight for p in self.need.points])
        return np.asarray(w / w.sum())

    @cached_property
    def price(self) -> Array:
        """What the objective counts of each power, (P,): a floor a little, lest its speed is higher than needed."""
        return np.where(self.weights > 0.0, self.weights, _FLOOR)

    @cached_property
    def flown(self) -> NDArray[np.intp]:
        """Points of weight, which keep the stall margin."""
        return np.flatnonzero(self.weights > 0.0)

    @cached_property
    def asked(self) -> Array:
        """Thrusts, (P,) [N]."""
        return np.array([p.thrust_N for p in self.need.points])

    @cached_property
    def flow(self) -> DuctFlow | None:
        """Numbers of the duct, with what effects make of them."""
        return self.model.prepared(self.variants[0]).duct

    @cached_property
    def blend(self) -> Array:
        """Weights of the section tables at the elements."""
        return blend_weights(self.shape.r / self.shape.R, np.array([x for x, _ in self.model.polars]))

    @cached_property
    def top(self) -> Array:
        """Lift coefficients that the elements' sections may have, (N, Nr), at the shared Reynolds numbers."""
        tops = [top_lift(polar) for _, polar in self.model.polars]
        table = np.array([np.interp(np.log(DEFAULT_RE), np.log(Re), cl) for Re, cl in tops])
        return np.asarray((1.0 - self.need.limits.stall_margin) * (self.blend @ table))

    @cached_property
    def strength(self) -> requirement.SectionStrength:
        """Shape numbers of the elements' sections."""
        anchors = list(self.model.rotor.blade.anchors)
        x = np.array([a[0] for a in anchors])
        return requirement.strength(anchors, blend_weights(self.shape.r / self.shape.R, x))

    @cached_property
    def chord_limits(self) -> tuple[Array, Array, Array]:
        """Chords at hub, elements and tip, (N + 2,): asked for, that of the least thickness, and the most [m]."""
        limits, s = self.need.limits, self.shape
        r = np.r_[s.Rhub, s.r, s.R]
        anchors = self.model.rotor.blade.anchors
        thickness = np.interp(r / s.R, [a[0] for a in anchors], [a[1].thickness for a in anchors])
        wide, gaps = (1.0, FAN_GAPS) if self.model.ducted else (WIDEST, GAPS)
        most = np.minimum(wide * s.R, gaps * 2.0 * np.pi * r / self.need.blades)
        return np.full(r.size, limits.min_chord_m), limits.min_thickness_m / thickness, most

    @cached_property
    def chord_range(self) -> tuple[Array, Array]:
        """Least and largest ln(chord / R) at hub, elements and tip, (N + 2,)."""
        asked, thick, most = self.chord_limits
        least = np.maximum(asked, thick)
        return np.log(least / self.shape.R), np.log(np.maximum(most, least) / self.shape.R)

    def speeds(self, x: Array) -> Array:
        """Speeds of the points, (P,) [rev/min]."""
        rpm = self.rpm0.copy()
        rpm[self.free] *= np.exp(x[2 * CONTROLS : 2 * CONTROLS + self.free.size])
        return rpm

    def bounds(self) -> list[tuple[float, float]]:
        """Of the variables: chords, angles half a turn of `TURN`, speeds up to the tip Mach number."""
        low, high = self.chord_range
        chord = [(float(low.min()), float(high.max()))] * CONTROLS
        fast = [(math.log(0.1), math.log(max(self.need.slow / self.rpm0[i], 0.11))) for i in self.free]
        return [*chord, *[(-4.0, 4.0)] * CONTROLS, *fast]

    def values(self, x: Array, derivatives: bool = False) -> Values | None:
        """What control values give; None where the solver does not converge."""
        key = x.tobytes()
        for deep in (True, derivatives):
            if deep in self._last and self._last[deep][0] == key:
                return self._last[deep][1]
        try:
            found = self._values(np.asarray(x, dtype=float), derivatives)
        except (InputError, ValueError, FloatingPointError):
            return None
        self._last[derivatives] = key, found
        return found

    def _values(self, x: Array, derivatives: bool) -> Values:
        s, P = self.shape.stations(x), len(self.need.points)
        rpm = self.speeds(x)
        V = np.array([p.airspeed_m_s for p in self.need.points])
        near = [rpm[self.free] * (1.0 + sign * _STEP_RPM) for sign in (1.0, -1.0)] if derivatives else []
        every, along = np.concatenate([rpm, *near]), np.concatenate([V, *[V[self.free]] * len(near)])
        parts = [self._solved(effects, every, along, s, derivatives) for effects in self.variants]
        e, by_c, by_b = (np.mean([part[i] for part in parts], axis=0) for i in range(3))
        omega = every * (math.pi / 30.0)
        # means of the rotors, in a duct the total of the mean sums
        T, dT_c, dT_b = self._thrust(e, by_c, by_b, along, derivatives)
        Q = e[1].sum(axis=1)
        power = omega * Q
        stress = [self._stress(i, omega[i], s, e, by_c if derivatives else None, by_b) for i in range(P)]
        allowed = self.need.limits.material.strength_MPa * 1e6 / self.need.limits.safety
        low, high = self.chord_range
        spline = self.shape.ln_chord(x)
        margins = np.concatenate([
            T[:P] / self.asked - 1.0, _STEEP * e[_ROOM, self.flown].ravel(),
            *(np.log(allowed / one.value) for one in stress), spline - low, high - spline,
        ])  # fmt: skip
        objective = float(self.price @ power[:P] / self.scale_W)
        stresses = np.array([one.value for one in stress])
        rest = rpm, T[:P], power[:P], e[_CL, :P], e[_LIFT, :P], e[0, :P] / s.dr, stresses, objective, margins
        if not derivatives:
            return Values(*rest, np.empty(0), np.empty((0, 0)))

        def chain(c: Array, b: Array) -> Array:
            return self.shape.pull_back(c, b, s.chord)

        diagonal = np.eye(s.r.size)
        rows = [chain(dT_c[:P], dT_b[:P]) / self.asked[:, None]]
        rows += [
            _STEEP * chain(diagonal * by_c[_ROOM, k][:, None], diagonal * by_b[_ROOM, k][:, None])
            for k in self.flown
        ]  # fmt: skip
        rows += [-chain(one.by_chord, one.by_beta) / one.value[:, None] for one in stress]
        none = np.zeros_like(self.shape.basis)
        rows += [np.c_[self.shape.basis, none], np.c_[-self.shape.basis, none]]
        power_rows = omega[:P, None] * chain(by_c[1, :P], by_b[1, :P])
        jacobian = np.zeros((margins.size, self.size))
        jacobian[:, : 2 * CONTROLS] = np.concatenate(rows)
        gradient = np.zeros(self.size)
        gradient[: 2 * CONTROLS] = self.price @ power_rows / self.scale_W
        N, F = s.r.size, self.free.size
        for j, k in enumerate(self.free):
            up, down, v = P + j, P + F + j, 2 * CONTROLS + j
            wide = 2.0 * _STEP_RPM  # of the logarithm

            def slope(a: Array, up: int = up, down: int = down, wide: float = wide) -> Any:
                return (a[up] - a[down]) / wide

            gradient[v] = self.price[k] * slope(power) / self.scale_W
            jacobian[k, v] = slope(T) / self.asked[k]
            if k in self.flown:
                place = P + N * int(np.searchsorted(self.flown, k))
                jacobian[place : place + N, v] = _STEEP * slope(e[_ROOM])
            ends = [self._stress(i, omega[i], s, e, None, None).value for i in (up, down)]
            first = P + (self.flown.size + k) * N
            jacobian[first : first + N, v] = -np.log(ends[0] / ends[1]) / wide
        return Values(*rest, gradient, jacobian)

    def _solved(
        self, effects: Sequence[Effect], rpm: Array, V: Array, s: Stations, derivatives: bool
    ) -> tuple[Array, Array, Array]:
        """Columns of the elements with room to the largest angle and the lift there, and their own derivatives."""
        if not derivatives:
            return self._columns(around.only(self.model, effects, s), rpm, V), np.zeros(1), np.zeros(1)
        rotors = around.moved(self.model, effects, s)
        base, *slopes = self._columns(rotors.base, rpm, V), *(
            (self._columns(high, rpm, V) - self._columns(low, rpm, V)) / width
            for low, high, width in (rotors.chord, rotors.beta)
        )  # fmt: skip
        return base, slopes[0], slopes[1]

    def _columns(self, prep: Prepared, rpm: Array, V: Array) -> Array:
        air = self.need.air
        e = around.elements(prep, rpm, V, air.rho, air, COLUMNS)
        W = np.abs(e[_W])
        ln_Re0, per_step, last = prep.grid[7], prep.grid[8], prep.axes[1] - 1
        at = np.log(np.maximum(float(air.rho) * W * prep.stations.chord / float(air.mu), 1.0))
        place = np.clip((at - ln_Re0) * per_step, 0.0, max(last - 1e-6, 0.0))
        i, n = place.astype(np.intp), np.arange(W.shape[1])[None, :]
        nodes = np.clip(np.rint((ln_Re0 - LOG_RE0) / DLOG_RE).astype(int) + np.arange(last + 1), 0, DEFAULT_RE.size - 1)
        top = self.top[:, nodes]
        zero, most = (_angle_of(_lift_at_rest(prep), top * share) for share in (0.0, 1.0))
        j = np.minimum(i + 1, last)
        low, wide, lift = (t[n, i] + (place - i) * (t[n, j] - t[n, i]) for t in (zero, most - zero, top))
        factor = np.sqrt(1.0 - np.minimum(W / float(air.a_sound), _MACH) ** 2)
        return np.concatenate([e, [low + factor * wide - e[_ALPHA], lift]])

    def _thrust(self, e: Array, by_c: Array, by_b: Array, V: Array, derivatives: bool) -> tuple[Array, Array, Array]:
        """Thrust at points, (P,), and its derivatives by the elements' chords and angles, (P, N)."""
        if self.flow is None:
            return e[0].sum(axis=1), by_c[0] if derivatives else by_c, by_b[0] if derivatives else by_b
        sums = self._sums(e, V)
        T = self._total(sums.sum(axis=2), V)
        if not derivatives:
            return T, by_c, by_b
        # the total by each sum, each sum by each element
        size = np.abs(sums.sum(axis=2)).max(axis=1) + 1e-12
        step = 1e-6
        out = []
        for tangent in (by_c, by_b):
            # the sums are smooth functions of w and v_t of the element alone
            h = step / (np.abs(tangent[_AXIAL]).max() + np.abs(tangent[_SWIRL]).max() + 1e-12)
            moved = [self._sums(e + sign * h * tangent, V) for sign in (1.0, -1.0)]
            out.append((moved[0] - moved[1]) / (2.0 * h))
        by = np.empty((len(size), T.size))
        for i, wide in enumerate(step * size):
            one = np.zeros((len(size), 1))
            one[i] = wide
            total = sums.sum(axis=2)
            by[i] = (self._total(total + one, V) - self._total(total - one, V)) / (2.0 * wide)
        return T, *(np.einsum("ip,ipn->pn", by, d) for d in out)

    def _sums(self, e: Array, V: Array) -> Array:
        """What each element adds to the duct's sums, (5, P, N): mass, jet, stator, spin, whirl; as the kernel does."""
        flow, s, rho = self.flow, self.shape, float(self.need.air.rho)
        assert flow is not None
        area = 2.0 * math.pi * s.r * s.dr
        w, v_t = e[_AXIAL], e[_SWIRL]
        mass = rho * np.abs(w) * area
        jet = mass * flow.jet_speed(w, V[:, None], float(self.need.air.mu) / rho)
        stator = flow.stator * 2.0 * rho * np.maximum(v_t, 0.0) ** 2 * area
        return np.stack([mass, jet, stator, 4.0 * v_t**2 * s.dr / s.r, 4.0 * mass * v_t**2])

    def _total(self, sums: Array, V: Array) -> Array:
        """Thrust of rotor, stator and duct from the sums, (5, P). [N]"""
        assert self.flow is not None
        out = np.zeros((V.size, N_OUT))
        out[:, [O_MASS, O_JET, O_STATOR, O_SPIN, O_WHIRL]] = sums.T
        rho, mu = (np.full(V.size, float(v)) for v in (self.need.air.rho, self.need.air.mu))
        return np.asarray(self.flow.total(rho, V, mu, out)[0])

    def _stress(
        self, k: int, omega: float, s: Stations, e: Array, by_c: Array | None, by_b: Array | None
    ) -> requirement.Stress:
        tangents = (None, None) if by_c is None or by_b is None else (by_c[:2, k], by_b[:2, k])
        return requirement.stress(self.strength, self.need.limits.material.density, self.need.blades, omega, s.r, s.dr,
                                s.chord, s.beta, e[:2, k], *tangents)  # fmt: skip

    def active(self, v: Values) -> list[str]:
        """Limits that are reached, in words, the thrust's left out."""
        return self._words(v, lambda margin: margin < _TIGHT)

    def broken(self, v: Values) -> list[str]:
        """Limits that are not kept, in words."""
        return self._words(v, lambda margin: margin < -_TIGHT)

    def _words(self, v: Values, chosen: Callable[[Array], NDArray[np.bool_]]) -> list[str]:
        P, N = len(self.need.points), self.shape.r.size
        x = self.shape.r / self.shape.R
        words = []
        for i, k in enumerate(self.flown):
            hit = chosen(v.margins[P + i * N : P + (i + 1) * N])
            words += [f"stall margin at r/R {_span(x[hit])}{self._of(int(k))}"] if hit.any() else []
        rest = v.margins[P + self.flown.size * N :]
        for k in range(P):
            hit = chosen(rest[k * N : (k + 1) * N])
            words += [f"stress at r/R {_span(x[hit])}{self._of(k)}"] if hit.any() else []
        ends = np.r_[self.shape.Rhub / self.shape.R, x, 1.0]
        why = "thickness" if self.need.limits.min_thickness_m > 0.0 else "chord"
        for margin, name in zip(rest[P * N :].reshape(2, -1), (f"least {why}", "largest chord"), strict=True):
            hit = chosen(margin)
            words += [f"{name} at r/R {_span(ends[hit])}"] if hit.any() else []
        fast = chosen(1.0 - v.rpm[self.free] / self.need.slow)
        return words + [f"tip Mach{self._of(int(k))}" for k in self.free[fast]]

    def _of(self, k: int) -> str:
        return "" if len(self.need.points) == 1 else f" (point {k + 1})"


def _span(x: Array) -> str:
    return f"{x[0]:.2f}" if x[-1] - x[0] < 0.01 else f"{x[0]:.2f} to {x[-1]:.2f}"


def top_lift(polar: Polar) -> tuple[Array, Array]:
    """Reynolds numbers, and the lift coefficient at which the section stalls there."""
    some = np.flatnonzero((polar.alpha >= 0.0) & (polar.alpha <= math.radians(30.0)))
    cl = polar.cl[some, :, 0]
    return np.asarray(polar.Re), np.take_along_axis(cl, first_stall(cl)[None, :], axis=0)[0]


def _lift_at_rest(prep: Prepared) -> Array:
    """Lift coefficients of the stations' tables without compressibility, (N, Nr, angles), at `_ANGLES`."""
    n_r = prep.axes[1]
    rows = (
        prep.tab[:, :n_r] if prep.layout == "factored" else prep.tab.reshape(prep.tab.shape[0], *prep.axes, -1, 2)[:, 0]
    )
    return np.asarray(rows[:, :, _ANGLES, 0])


def _angle_of(cl: Array, wanted: Array) -> Array:
    """Angle at which the lift first reaches a value, (N, Nr) [rad]; that of the most lift where it never does."""
    alpha = ALPHA_GRID[_ANGLES]
    reached = cl >= wanted[..., None]
    i = np.where(reached.any(axis=-1), reached.argmax(axis=-1), cl.argmax(axis=-1))
    k = np.maximum(i - 1, 0)
    low, high = (np.take_along_axis(cl, m[..., None], axis=-1)[..., 0] for m in (k, i))
    part = np.clip((wanted - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    return np.asarray(alpha[k] + part * (alpha[i] - alpha[k]))
