"""A rotor with its section tables, duct and effects: solved at operating points into a
:class:`bemt.physics.dataset.Dataset`.

:mod:`bemt.physics.bem.solver` knows effects that change a rotor; effects that change single points (a wall behind it, a
lagging inflow, wrong density) act here, around it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array
from bemt.base.cache import Kept, content_key
from bemt.physics import coefficients as co
from bemt.physics.air import Air
from bemt.physics.bem import packing as arrays
from bemt.physics.bem import solver
from bemt.physics.bem.duct import DuctFlow, duct_flow
from bemt.physics.dataset import Dataset
from bemt.physics.effects import standard, to_text
from bemt.physics.effects.base import RE_FAST, Effect, Flow, Loads
from bemt.physics.sections.neuralfoil import neuralfoil_polar
from bemt.physics.sections.polars import RE_FIXED, Polar

if TYPE_CHECKING:
    from bemt.physics.bem.oblique_near import Near
    from geometry.duct import Duct
    from geometry.rotor import Rotor, Stations

# Slope of the loads with onset speed: central difference over this share of the tip speed.
_SPEED_STEP = 2e-3
# Section speeds over those without induction; tables beyond them are left out.
_SLOWEST, _FASTEST = 0.4, 1.5
# More points than these are not looked at one by one.
_MANY = 64

Flags = tuple[tuple[str, ...], ...]  # Words of each point
HUB_LOADS = ("H_force_N", "Y_force_N", "roll_moment_Nm", "pitch_moment_Nm")
"""Channels of the hub's loads in oblique flow, in the order of :attr:`bemt.physics.bem.solver.Solution.hub`."""


MOST_PREPARED = 130e6
"""Bytes of prepared rotors that a process keeps: the unknowns of two labels [B]."""
PREPARED: Kept[solver.Prepared] = Kept(MOST_PREPARED, lambda made: made.st.nbytes + made.tab.nbytes)
"""Prepared rotors of this process, by geometry, section tables, duct, effects and range."""


@dataclass(frozen=True, eq=False)
class Model:
    """Everything from which a rotor is solved with any set of effects; prepared rotors are kept (:data:`PREPARED`)."""

    rotor: Rotor
    polars: Sequence[tuple[float, Polar]]  # Section tables at r/R
    duct: DuctFlow | None = None
    n_stations: int = 40  # Blade elements [1]
    mach_max: float = 1.25  # Largest section Mach number that occurs [1]
    re_range: tuple[float, float] | None = None  # Section Reynolds numbers that occur; None: any [1]
    effects: tuple[Effect, ...] = field(default_factory=standard)  # Physics that is on
    notes: tuple[str, ...] = ()  # Remarks of the section tables
    # What a run of this rotor adds to CT and CP, (2, P), at advance ratios along the shaft and Reynolds numbers at 0.75
    # R of the rotation alone, (P,) each [1]
    learned: Callable[[Array, Array], Array] | None = None
    _reaching: dict[Any, Model] = field(default_factory=dict, init=False, repr=False)

    @property
    def diameter_m(self) -> float:
        """Rotor diameter [m]."""
        return self.rotor.D

    @property
    def hub_diameter_m(self) -> float:
        """Hub diameter [m]."""
        return 2.0 * self.rotor.Rhub

    @property
    def pitch_m(self) -> float:
        """Geometric pitch at 0.75 R [m]."""
        return self.rotor.blade.pitch_m()

    @cached_property
    def chord75_m(self) -> float:
        """Chord at 0.75 R [m]."""
        return float(self.rotor.blade.at(0.75 * self.rotor.R)[0])

    @cached_property
    def _texts(self) -> tuple[str, ...]:
        return tuple(to_text(e) for e in self.effects)

    @cached_property
    def _on_points(self) -> bool:
        return any(acts_on_points(e) for e in self.effects)

    @property
    def solidity(self) -> float:
        """Blade area over disk area [1]."""
        return self.rotor.solidity

    @property
    def ducted(self) -> bool:
        """Whether there is a duct."""
        return self.duct is not None

    @property
    def exit_area_m2(self) -> float:
        """Exit area of the duct, NaN without one [m2]."""
        return math.nan if self.duct is None else self.duct.wake_ratio * self.rotor.annulus_area

    def at_speeds(self, rpm: ArrayLike, V: ArrayLike, air: Air) -> Model:
        """Model with the tables of the Reynolds and Mach numbers that these points reach: same loads, prepared sooner.

        rpm [rev/min], V [m/s] and air broadcast together.
        """
        blade = self.rotor.blade
        omega, onset = np.multiply(rpm, math.pi / 30.0), np.abs(V)
        if np.size(omega) > _MANY and np.ndim(air.rho) == 0:
            # their extremes hold them all
            omega, onset = (np.array([np.min(v), np.max(v)]) for v in (omega, onset))
        per_m = np.broadcast_arrays(omega, onset, np.asarray(air.rho) / air.mu)
        Re = np.hypot(per_m[0][..., None] * blade.r, per_m[1][..., None]) * blade.chord * per_m[2][..., None]
        # effects read the tables at two Reynolds numbers besides
        low, high = min(_SLOWEST * float(Re.min()), RE_FIXED), max(_FASTEST * float(Re.max()), RE_FAST)
        mach = min(_FASTEST * float(np.max(np.hypot(omega * blade.R, onset) / air.a_sound)), self.mach_max)
        most, re_range = arrays.block(mach, (low, high))
        key = (most, re_range)
        if key not in self._reaching:  # few: blocks of the tables
            self._reaching[key] = replace(self, re_range=re_range, mach_max=min(most, self.mach_max))
        return self._reaching[key]

    def with_effects(self, effects: Sequence[Effect]) -> Model:
        """Model with other physics on."""
        other = replace(self, effects=tuple(effects))
        other.__dict__["_content"] = self._content  # which leaves effects out
        return other

    @property
    def prep(self) -> solver.Prepared:
        """Rotor with the effects that are on, as the solver consumes it."""
        return self.prepared(self.effects)

    @cached_property
    def _content(self) -> tuple[Hashable, ...]:
        """What decides a prepared rotor besides effects and stations: values, never identities."""
        rotor, blade = self.rotor, self.rotor.blade
        lines = [np.asarray(v) for v in (blade.sweep, blade.rake) if v is not None]
        shapes = [v for x, a in blade.anchors for v in (x, a.x, a.y)]
        sizes = (blade.R, blade.Rhub, blade.axis, rotor.B, rotor.rotation, rotor.name)
        hub = (rotor.hub_length, rotor.spinner_length)
        geometry = content_key(blade.r, blade.chord, blade.beta, len(lines), *lines, sizes, hub, *shapes)
        tables = tuple((x, polar.key) for x, polar in self.polars)
        reach = (arrays.mach_nodes(self.mach_max), arrays.re_nodes(self.re_range))
        return geometry, tables, repr(self.duct), self.n_stations, *reach

    @property
    def key(self) -> tuple[Hashable, ...]:
        """What decides the solver's loads at any point: values, never identities."""
        return self._content, self.effects

    def prepared(
        self, effects: Sequence[Effect], level: float = 1.0, stations: Stations | None = None
    ) -> solver.Prepared:
        """Rotor with these effects (those of points left out), at a share of the ones that differ between points.

        ``stations`` replaces the blade elements.
        """
        chosen = tuple(sorted((e for e in effects if acts_on_rotor(e)), key=lambda e: (e.order, e.id)))
        key = (self._content, chosen, level, None if stations is None else content_key(*stations))
        return PREPARED.get(key, lambda: solver.prepare(
            self.rotor, self.polars, chosen, self.duct, self.n_stations, stations, self.mach_max,
            level=level, re_range=self.re_range,
        ))  # fmt: skip

    def taught(self, rpm: Array, V: Array, rho: ArrayLike, mu: ArrayLike) -> tuple[Array, Array]:
        """Thrust [N] and torque [N m] that a run of this rotor taught beyond the solver's, (P,); zero without a run."""
        if self.learned is None:
            return np.zeros_like(rpm), np.zeros_like(rpm)
        n, D = rpm / 60.0, self.diameter_m
        change = self.learned(V / (n * D), np.asarray(co.Re75(self.chord75_m, n, D, 0.0, rho, mu)))
        thrust, power = co.thrust(change[0], rho, n, D), co.power(change[1], rho, n, D)
        return np.asarray(thrust), np.asarray(power) / (2.0 * np.pi * n)

    def solve(
        self, rpm: ArrayLike, V: ArrayLike = 0.0, air: Air | None = None, threads: int = 1, side: ArrayLike = 0.0
    ) -> Dataset:
        """Solve operating points; ``V`` [m/s] along the shaft, ``side`` [m/s] in the plane of the disk.

        With any ``side``, the airspeed of the result (and J) is that of the wind and ``sideslip_rad`` its angle to the
        shaft; ``eta`` is T V cos(angle) / P, with the speed along the shaft. The loads of the hub are added:
        ``H_force_N`` downstream, ``Y_force_N`` to the advancing side, ``roll_moment_Nm`` lifting the advancing side,
        ``pitch_moment_Nm`` lifting the upstream side.
        """
        return self.dataset(*self.channels(rpm, V, Air.from_density() if air is None else air, threads, side))

    def dataset(self, values: Mapping[str, Array], flags: Flags) -> Dataset:
        """Channels and flags with what they came from."""
        provenance = {"source": "bemt", "effects": self._texts, "stations": self.n_stations}
        name = self.rotor.name or "rotor"
        return Dataset("bemt", name, values, flags=flags, provenance=provenance, notes=self.notes)

    def channels(
        self, rpm: ArrayLike, V: ArrayLike, air: Air, threads: int, side: ArrayLike = 0.0, near: Near | None = None
    ) -> tuple[dict[str, Array], Flags]:
        """Channels and flags of :meth:`solve`; ``near`` as in :func:`bemt.physics.bem.solver.solve`."""
        s = solver.solve(self.prep, rpm, V, air, threads=threads, side=side, near=near)
        n, D = s.rpm / 60.0, self.diameter_m
        rho, mu, a = (np.broadcast_to(np.asarray(getattr(air, k), float), n.shape) for k in ("rho", "mu", "a_sound"))
        T, Q, T_duct, T_rotor, T_stator, V_exit, flags = s.T, s.Q, s.T_duct, s.T_rotor, s.T_stator, s.V_exit, s.flags
        if self._on_points:
            base = self.prepared([e for e in self.effects if not acts_on_points(e)])
            loads, _, ok = respond(self.prepared, self.effects, flow_of(base, s.rpm, s.V, air, side=s.side))
            ok = ok & s.converged
            T, Q, T_duct = (np.where(ok, v, np.nan) for v in (loads.T, loads.Q, loads.T_duct))
            T_rotor = T - s.T_stator - T_duct
            more = ((), ("unconverged with the effects that act on points",))
            flags = tuple((*f, *more[int(not good)]) for f, good in zip(s.flags, ok, strict=True))
        if self.learned is not None:
            more_T, more_Q = self.taught(s.rpm, s.V, rho, mu)
            T, drawn, Q = T + more_T, T, Q + more_Q
            # rotor, duct and stator share it, and the jet by momentum
            with np.errstate(divide="ignore", invalid="ignore"):
                grown = T / drawn
                faster = (V_exit - s.V) / (2.0 * V_exit - s.V) * V_exit * (grown - 1.0)
            T_rotor, T_duct, T_stator = (v * grown for v in (T_rotor, T_duct, T_stator))
            V_exit = np.where(np.isfinite(faster), V_exit + faster, V_exit)
        wind = s.V if s.side is None else np.hypot(s.V, s.side)
        CT, CQ, J = co.CT(T, rho, n, D), co.CQ(Q, rho, n, D), s.J if s.side is None else wind / (n * D)
        CP = 2.0 * np.pi * np.asarray(CQ)
        share = np.divide(T_duct, T, out=np.full_like(T, np.nan), where=T != 0.0)
        values = {
            "rpm": s.rpm, "airspeed_m_s": wind, "density_kg_m3": rho, "thrust_N": T, "torque_Nm": Q,
            "power_W": Q * (s.rpm * (math.pi / 30.0)), "CT": CT, "CP": CP, "J": J, "eta": co.eta(s.J, CT, CP),
            "M_tip": co.M_tip(n, D, a), "Re75": co.Re75(self.chord75_m, n, D, wind, rho, mu),
            "rotor_thrust_N": T_rotor, "duct_thrust_N": T_duct, "stator_thrust_N": T_stator,
            "exhaust_speed_m_s": V_exit, "mass_flow_kg_s": s.mass_flow, "duct_share": share,
        }  # fmt: skip
        if s.side is not None and s.hub is not None:
            values["sideslip_rad"] = np.arctan2(s.side, s.V)
            values |= {key: s.hub[:, i] for i, key in enumerate(HUB_LOADS)}
        return values, flags


def solve(
    rotor: Rotor, polars: Polar | Sequence[tuple[float, Polar]] | None = None,
    effects: Sequence[Effect] | None = None, duct: Duct | DuctFlow | None = None, *, rpm: ArrayLike,
    V: ArrayLike = 0.0, air: Air | None = None, n_stations: int = 40, threads: int = 1,
) -> Dataset:  # fmt: skip
    """Solve a rotor at operating points.

    Examples
    --------
    >>> from bemt.physics.sections.polars import linear_polar
    >>> from geometry.laws import helix
    >>> from geometry.rotor import Rotor
    >>> rotor = Rotor(helix(8 * 0.0254, 5 * 0.0254), B=2)
    >>> found = solve(rotor, linear_polar(cd=0.01), rpm=[5000, 6000], V=8.0)
    >>> bool(found.converged.all()), found.CT.round(3)
    (True, array([0.029, 0.042]))
    """
    if polars is None:
        polars = [(x, neuralfoil_polar(section)) for x, section in rotor.blade.anchors]
        if not polars:
            raise ValueError("polars: got none, and the blade has no section; expected one of them")
    tables = [(0.75, polars)] if isinstance(polars, Polar) else polars
    flow = duct if duct is None or isinstance(duct, DuctFlow) else duct_flow(duct, rotor)
    on = standard() if effects is None else tuple(effects)
    return Model(rotor, tables, flow, n_stations, effects=on).solve(rpm, V, air, threads)


def _has(effect: Effect, *hooks: str) -> bool:
    return _overrides(type(effect), hooks)  # type: ignore[arg-type]  # a class hashes by identity


@cache  # asked some ten thousand times by a diagnosis
def _overrides(kind: type[Effect], hooks: tuple[str, ...]) -> bool:
    return any(getattr(kind, hook) is not getattr(Effect, hook) for hook in hooks)


def acts_on_rotor(effect: Effect) -> bool:
    """Whether an effect changes the prepared rotor; one without any hook is a switch of the solver."""
    return _has(effect, "blade", "inflow", "section", "momentum", "duct") or not acts_on_points(effect)


def acts_on_points(effect: Effect) -> bool:
    """Whether an effect has hooks around the solver."""
    return _has(effect, "flow", "loads", "reading")


def only_reads(effect: Effect) -> bool:
    """Whether an effect changes nothing but what instruments show."""
    return _has(effect, "reading") and not _has(
        effect, "blade", "inflow", "section", "momentum", "duct", "flow", "loads", "share"
    )


def _solve(prep: solver.Prepared, flow: Flow) -> solver.Solution:
    air = cast("Air", SimpleNamespace(rho=flow.rho, mu=flow.mu, a_sound=flow.a_sound))
    if prep.duct is None or flow.side is None or not np.any(flow.side):
        return solver.solve(prep, flow.rpm, flow.V, air, side=0.0 if flow.side is None else flow.side)
    # an effect that turns the wind, with one that adds a duct: nobody solves that
    axial, turned = solver.solve(prep, flow.rpm, flow.V, air), flow.side != 0.0
    T, Q, T_duct = (np.where(turned, np.nan, v) for v in (axial.T, axial.Q, axial.T_duct))
    return replace(axial, T=T, Q=Q, T_duct=T_duct, converged=axial.converged & ~turned)


def flow_of(
    prep: solver.Prepared, rpm: ArrayLike, V: ArrayLike, air: Any, extra: Mapping[str, Array] | None = None,
    chord: float | None = None, side: Array | None = None,
) -> Flow:  # fmt: skip
    """Conditions at points with the baseline's loads there; speeds [rev/min], [m/s], chord at 0.75 R [m]."""
    arrays = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (rpm, V, air.rho, air.mu, air.a_sound)))
    rpm_, V_, rho, mu, a_sound = (np.atleast_1d(a).astype(float) for a in arrays)
    rotor = prep.rotor
    flow = Flow(
        rpm_, V_, rho, mu, a_sound, rotor.R, rotor.Rhub,
        float(rotor.blade.at(0.75 * rotor.R)[0]) if chord is None else chord, rotor.B, prep.duct is not None,
        np.zeros_like(rpm_), np.zeros_like(rpm_), np.zeros_like(rpm_), np.zeros_like(rpm_), dict(extra or {}), side,
    )  # fmt: skip
    base = _solve(prep, flow)
    step = _SPEED_STEP * flow.omega * flow.R
    up, down = (_solve(prep, replace(flow, V=flow.V + s)) for s in (step, -step))
    flow.T0, flow.Q0 = base.T, base.Q
    flow.dT_dV = (up.T - down.T) / (2.0 * step)
    flow.dQ_dV = (up.Q - down.Q) / (2.0 * step)
    return flow


def respond(
    prepared: Callable[[Sequence[Effect], float], solver.Prepared], effects: Sequence[Effect], flow: Flow,
    known: dict[tuple[tuple[Effect, ...], float], solver.Solution] | None = None,
) -> tuple[Loads, Flow, NDArray[np.bool_]]:  # fmt: skip
    """Loads at points with all effects on, the flow that the rotor meets, (P,) bool converged; ``flow`` stays as it is.

    ``prepared`` gives a rotor for effects and a level (:meth:`Model.prepared`).  An effect of the solver whose size
    differs between points (:meth:`Effect.share`) is solved at levels 0, 1/2 and 1 and interpolated by the parabola
    through them; several of them add up.  ``known`` keeps solutions at the flow as it is.
    """
    met = replace(flow, **{k: getattr(flow, k).copy() for k in ("rpm", "V", "rho", "mu", "a_sound")})
    # what instruments got wrong first: a wrong airspeed is that of the tunnel, not what a wall makes of it
    for e in sorted(effects, key=lambda e: e.kind != "stand"):
        e.flow(met)
    shared = [(e, s) for e in effects if (s := e.share(met)) is not None]
    varying = [e for e, _ in shared]
    plain = [e for e in effects if e not in varying]
    kept = {} if known is None or any(_has(e, "flow") for e in effects) else known

    def solution(some: Sequence[Effect], level: float) -> solver.Solution:
        rotor = tuple(e.solved() for e in some if acts_on_rotor(e))
        if (rotor, level) not in kept:
            kept[rotor, level] = _solve(prepared(rotor, level), met)
        return kept[rotor, level]

    base = solution(plain, 1.0)
    T, Q, T_duct, ok = base.T, base.Q, base.T_duct, base.converged
    for e, share in shared:
        half, whole = (solution([*plain, e], level) for level in (0.5, 1.0))
        w_half, w_whole = 4.0 * share * (1.0 - share), share * (2.0 * share - 1.0)
        T = T + w_half * (half.T - base.T) + w_whole * (whole.T - base.T)
        Q = Q + w_half * (half.Q - base.Q) + w_whole * (whole.Q - base.Q)
        T_duct = T_duct + w_half * (half.T_duct - base.T_duct) + w_whole * (whole.T_duct - base.T_duct)
        ok = ok & half.converged & whole.converged
    loads = Loads(T.copy(), Q.copy(), T_duct.copy())
    for e in effects:
        e.loads(loads, met)
    return loads, met, ok
