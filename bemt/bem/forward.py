"""Loads at recorded points with every hook of the effects: what the rotor meets, the solver, what follows.

:mod:`bemt.bem.solver` knows effects that change a rotor; effects that change single points (a wall behind it, a lagging
inflow, wrong density) act here, around it.  Cases and diagnosis share this one way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.bem import solver
from bemt.effects.base import Effect, Flow, Loads

if TYPE_CHECKING:
    from bemt.air import Air
    from bemt.bem.duct import DuctFlow
    from bemt.sections.polars import Polar
    from geometry.rotor import Rotor

__all__ = ["Model", "acts_on_points", "flow_of", "respond"]

Array = NDArray[np.float64]

# Slope of the loads with onset speed: central difference over this share of the tip speed.
_SPEED_STEP = 2e-3


@dataclass(frozen=True, eq=False)
class Model:
    """Everything from which a rotor with any set of effects is prepared; prepared rotors are kept.

    Parameters
    ----------
    rotor : geometry.rotor.Rotor
        Rotor.
    polars : sequence of (float, Polar)
        Section tables at r/R.
    duct : DuctFlow or None
        Duct.
    n_stations : int
        Blade elements [1].
    mach_max : float
        Largest section Mach number that occurs [1].
    re_range : tuple of float or None
        Section Reynolds numbers that occur; None: any [1].
    """

    rotor: Rotor
    polars: Sequence[tuple[float, Polar]]
    duct: DuctFlow | None = None
    n_stations: int = 40
    mach_max: float = 1.25
    re_range: tuple[float, float] | None = None
    _kept: dict[Any, solver.Prepared] = field(default_factory=dict, repr=False)

    def prepared(self, effects: Sequence[Effect], level: float = 1.0) -> solver.Prepared:
        """Rotor with these effects.

        Parameters
        ----------
        effects : sequence of Effect
            Physics that is on; hooks of points are left out by their nature.
        level : float
            Share of the effects that differ between points [1].

        Returns
        -------
        Prepared
            For :func:`bemt.bem.solver.solve`.
        """
        chosen = tuple(sorted((e for e in effects if acts_on_rotor(e)), key=lambda e: (e.order, e.id)))
        key = (chosen, level)
        if key not in self._kept:
            self._kept[key] = solver.prepare(
                self.rotor, self.polars, chosen, self.duct, self.n_stations, mach_max=self.mach_max,
                level=level, re_range=self.re_range,
            )  # fmt: skip
        return self._kept[key]


def _has(effect: Effect, *hooks: str) -> bool:
    return any(getattr(type(effect), hook) is not getattr(Effect, hook) for hook in hooks)


def acts_on_rotor(effect: Effect) -> bool:
    """Whether an effect changes the prepared rotor (an effect without any hook is a switch of the solver).

    Parameters
    ----------
    effect : Effect
        Any effect.

    Returns
    -------
    bool
        True when it does.
    """
    return _has(effect, "blade", "inflow", "section", "momentum", "duct") or not acts_on_points(effect)


def acts_on_points(effect: Effect) -> bool:
    """Whether an effect has hooks around the solver.

    Parameters
    ----------
    effect : Effect
        Any effect.

    Returns
    -------
    bool
        True when it does.
    """
    return _has(effect, "flow", "loads", "reading")


def only_reads(effect: Effect) -> bool:
    """Whether an effect changes nothing but what instruments show.

    Parameters
    ----------
    effect : Effect
        Any effect.

    Returns
    -------
    bool
        True when it does.
    """
    return _has(effect, "reading") and not _has(
        effect, "blade", "inflow", "section", "momentum", "duct", "flow", "loads", "share"
    )


def _solve(prep: solver.Prepared, flow: Flow) -> solver.Solution:
    air = cast("Air", SimpleNamespace(rho=flow.rho, mu=flow.mu, a_sound=flow.a_sound))
    return solver.solve(prep, flow.rpm, flow.V, air)


def flow_of(
    prep: solver.Prepared, rpm: ArrayLike, V: ArrayLike, air: Any, extra: Mapping[str, Array] | None = None,
    chord: float | None = None,
) -> Flow:  # fmt: skip
    """Conditions at points, with the loads of a baseline there.

    Parameters
    ----------
    prep : Prepared
        Baseline.
    rpm, V : array_like
        Speed of rotation [rev/min], axial onset speed [m/s].
    air : Air
        State of the air, scalars or (P,) arrays.
    extra : mapping, optional
        Further covariates, see :class:`bemt.effects.base.Flow`.
    chord : float, optional
        Chord at 0.75 R [m]; the rotor's own by default.

    Returns
    -------
    Flow
        Fresh arrays of (P,).
    """
    arrays = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (rpm, V, air.rho, air.mu, air.a_sound)))
    rpm_, V_, rho, mu, a_sound = (np.atleast_1d(a).astype(float) for a in arrays)
    rotor = prep.rotor
    flow = Flow(
        rpm_, V_, rho, mu, a_sound, rotor.R, rotor.Rhub,
        float(rotor.blade.at(0.75 * rotor.R)[0]) if chord is None else chord, rotor.B, prep.duct is not None,
        np.zeros_like(rpm_), np.zeros_like(rpm_), np.zeros_like(rpm_), np.zeros_like(rpm_), dict(extra or {}),
    )  # fmt: skip
    base = _solve(prep, flow)
    step = _SPEED_STEP * flow.omega * flow.R
    up, down = (_solve(prep, replace(flow, V=flow.V + s)) for s in (step, -step))
    flow.T0, flow.Q0 = base.T, base.Q
    flow.dT_dV = (up.T - down.T) / (2.0 * step)
    flow.dQ_dV = (up.Q - down.Q) / (2.0 * step)
    return flow


def respond(prepared: Callable[[Sequence[Effect], float], solver.Prepared], effects: Sequence[Effect], flow: Flow
            ) -> tuple[Loads, Flow, NDArray[np.bool_]]:  # fmt: skip
    """Loads at points with all effects on.

    Parameters
    ----------
    prepared : callable
        Gives a prepared rotor for effects and a level, see :meth:`Model.prepared`.
    effects : sequence of Effect
        Physics that is on.
    flow : Flow
        Recorded conditions and the baseline's loads there; left as it is.

    Returns
    -------
    tuple
        Loads, the flow that the rotor meets, (P,) bool converged.

    Notes
    -----
    An effect of the solver whose size differs between points (:meth:`Effect.share`) is solved at levels 0, 1/2 and 1
    and interpolated by the parabola through them; several of them add up.
    """
    met = replace(flow, **{k: getattr(flow, k).copy() for k in ("rpm", "V", "rho", "mu", "a_sound")})
    # what instruments got wrong first: a wrong airspeed is that of the tunnel, not what a wall makes of it
    for e in sorted(effects, key=lambda e: e.kind != "stand"):
        e.flow(met)
    shared = [(e, s) for e in effects if (s := e.share(met)) is not None]
    varying = [e for e, _ in shared]
    plain = [e for e in effects if e not in varying]
    base = _solve(prepared(plain, 1.0), met)
    T, Q, T_duct, ok = base.T, base.Q, base.T_duct, base.converged
    for e, share in shared:
        half, whole = (_solve(prepared([*plain, e], level), met) for level in (0.5, 1.0))
        w_half, w_whole = 4.0 * share * (1.0 - share), share * (2.0 * share - 1.0)
        T = T + w_half * (half.T - base.T) + w_whole * (whole.T - base.T)
        Q = Q + w_half * (half.Q - base.Q) + w_whole * (whole.Q - base.Q)
        ok = ok & half.converged & whole.converged
    loads = Loads(T.copy(), Q.copy(), T_duct.copy())
    for e in effects:
        e.loads(loads, met)
    return loads, met, ok
