"""A case at operating points: the one place where cases meet polars, effects, duct and solver."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt import coefficients as co
from bemt import effects
from bemt.base.errors import Fault, InputError
from bemt.bem import duct as duct_model
from bemt.bem import forward, solver
from bemt.formula import k1k2 as empirical
from bemt.sections import polars
from bemt.sections.neuralfoil import neuralfoil_polar

if TYPE_CHECKING:
    from bemt.air import Air
    from bemt.case import Case
    from bemt.case.schema import PolarTable
    from geometry.rotor import Rotor

__all__ = ["Points", "Ready", "air_arrays", "evaluate", "k1k2", "prepare"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ready:
    """A case prepared for the solver.

    Parameters
    ----------
    model : bemt.bem.forward.Model
        Rotor and tables, to prepare with any effects.
    effects : tuple of Effect
        Physics that is on.
    diameter_m, hub_diameter_m, pitch_m, chord75_m, solidity : float
        Diameters, geometric pitch and chord at 0.75 R [m]; blade area over disk area [-].
    ducted : bool
        Whether there is a duct.
    exit_area_m2 : float
        Exit area of the duct, NaN without one. [m2]
    notes : tuple of str
        Remarks of the section tables.
    """

    model: forward.Model
    effects: tuple[effects.Effect, ...]
    diameter_m: float
    hub_diameter_m: float
    pitch_m: float
    chord75_m: float
    solidity: float
    ducted: bool
    exit_area_m2: float
    notes: tuple[str, ...]

    @property
    def prep(self) -> solver.Prepared:
        """What the solver consumes."""
        return self.model.prepared(self.effects)


@dataclass(frozen=True)
class Points:
    """Results at P operating points; NaN where not converged.

    Attributes
    ----------
    rpm, airspeed_m_s, density_kg_m3 : (P,) float
        Conditions. [rev/min], [m/s], [kg/m3]
    thrust_N, torque_Nm, power_W : (P,) float
        Total thrust (with a duct, all of it) [N], shaft torque [N m], shaft power [W].
    CT, CP, J, eta, M_tip, Re75 : (P,) float
        Propeller convention; rotational tip Mach number; Reynolds number at 0.75 R. [-]
    rotor_thrust_N, duct_thrust_N, stator_thrust_N, exhaust_speed_m_s : (P,) float
        Shares of the thrust [N]; speed at the exit or in the far wake [m/s].
    converged : (P,) bool
        Whether every blade element has a solution.
    flags : tuple of tuple of str
        Words per point.
    """

    rpm: Array
    airspeed_m_s: Array
    density_kg_m3: Array
    thrust_N: Array
    torque_Nm: Array
    power_W: Array
    CT: Array
    CP: Array
    J: Array
    eta: Array
    M_tip: Array
    Re75: Array
    rotor_thrust_N: Array
    duct_thrust_N: Array
    stator_thrust_N: Array
    exhaust_speed_m_s: Array
    converged: NDArray[np.bool_]
    flags: tuple[tuple[str, ...], ...]

    @property
    def duct_share(self) -> Array:
        """Duct thrust over total thrust. [-]"""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.duct_thrust_N / self.thrust_N


def _effects(case: Case) -> tuple[effects.Effect, ...]:
    known = effects.catalogue()
    faults = []
    on: dict[str, effects.Effect] = {}
    for key in ("effects_on", "effects_off", "also_without"):
        for i, text in enumerate(getattr(case.file.model, key)):
            name = text.partition("(")[0].strip()
            where = f"model.{key}[{i}]"
            if name not in known or (key != "effects_on" and name != text):
                close = difflib.get_close_matches(name, known, n=1)
                hint = f"Did you mean {close[0]}?" if close else ""
                faults.append(Fault(case.path.as_posix(), where, repr(text), f"one of {', '.join(known)}", hint))
            elif name in on and key == "effects_on":
                got, hint = f"{text!r} after {effects.to_text(on[name])!r}", "The last one would win"
                faults.append(Fault(case.path.as_posix(), where, got, "each effect once", hint))
            elif key == "effects_on":
                try:
                    on[name] = effects.from_text(text)
                except ValueError as error:
                    got, _, expected = str(error).partition("; expected ")
                    faults.append(Fault(case.path.as_posix(), where, got, expected))
    if faults:
        raise InputError(faults)
    off = set(case.file.model.effects_off)
    standard = {effect.id for effect in effects.standard()}
    return tuple(on.get(name) or cls() for name, cls in known.items() if name in (standard | set(on)) - off)


def _polars(case: Case, anchors: Sequence[tuple[float, Any]]) -> list[tuple[float, polars.Polar]]:
    given = case.file.polars
    if given:
        return _user_polars(case, given)
    rule = case.file.model.n_crit, case.file.model.drag_level
    return [(x, neuralfoil_polar(section, *rule)) for x, section in anchors]


def _user_polars(case: Case, given: Sequence[PolarTable]) -> list[tuple[float, polars.Polar]]:
    """Read the tables of a case; several XFOIL files at one r/R are its Reynolds numbers."""
    from bemt import readers as importers
    from bemt.readers import polar_xfoil

    groups: dict[float, list[PolarTable]] = {}
    for item in given:
        groups.setdefault(item.r_over_R, []).append(item)
    out, faults = [], []
    for x, items in sorted(groups.items()):
        paths = [case.folder / item.file for item in items]
        kind = items[0].format
        if len(items) > 1:
            out.append((x, polar_xfoil.read_many(paths)))
            continue
        read = importers.read(paths[0], None if kind is None else f"polar_{kind}")
        if isinstance(read, polars.Polar):
            out.append((x, read))
        else:
            got = f"a file of another kind ({type(read).__name__})"
            faults.append(Fault(paths[0].as_posix(), "", got, "a polar: CSV, XFOIL, C81 or AeroDyn"))
    if faults:
        raise InputError(faults)
    return out


def _duct_flow(case: Case, rotor: Rotor) -> duct_model.DuctFlow | None:
    duct = case.duct()
    if duct is None:
        return None
    flow = duct_model.duct_flow(duct, rotor)
    recovery = case.get("duct.stator.recovery")
    return flow if recovery is None else dataclasses.replace(flow, stator=float(recovery))


def prepare(case: Case, overrides: Mapping[str, Any] | None = None, n_stations: int | None = None) -> Ready:
    """Build geometry, section tables and effects of a case.

    Parameters
    ----------
    case : Case
        The case.
    overrides : mapping, optional
        Changed values, dotted key to value.
    n_stations : int, optional
        Blade elements; the case says by default.

    Returns
    -------
    Ready
        For :func:`evaluate`.

    Raises
    ------
    InputError
        When the changed values do not make a rotor, or an effect is unknown.
    """
    case = case.replaced(overrides)
    rotor, duct = case.rotor(), case.duct()
    if "duct" in case.file.model.effects_off:
        duct = None
    tables = _polars(case, rotor.blade.anchors)
    n = case.file.model.stations if n_stations is None else n_stations
    model = forward.Model(rotor, tables, _duct_flow(case, rotor) if duct is not None else None, n)
    chosen = _effects(case)
    notes = tuple(dict.fromkeys(note for _, polar in tables for note in polar.notes))
    blade = rotor.blade
    exit_area = float("nan") if duct is None else duct.exit_area
    return Ready(
        model, chosen, rotor.D, 2.0 * rotor.Rhub, blade.pitch_m(), float(blade.at(0.75 * rotor.R)[0]), rotor.solidity,
        duct is not None, exit_area, notes,
    )  # fmt: skip


def air_arrays(states: Sequence[Air], index: NDArray[np.intp]) -> Air:
    """One state of the air per point.

    Parameters
    ----------
    states : sequence of Air
        Distinct states.
    index : (P,) int
        Which one holds at each point.

    Returns
    -------
    Air
        An object whose rho, mu, a_sound and temperature_K are (P,) arrays.
    """
    names = ("rho", "mu", "a_sound", "temperature_K")
    fields = {name: np.array([getattr(s, name) for s in states], dtype=float)[index] for name in names}
    return cast("Air", SimpleNamespace(**fields))


def evaluate(ready: Ready, rpm: ArrayLike, airspeed_m_s: ArrayLike, air: Air, threads: int = 1) -> Points:
    """Solve operating points.

    Parameters
    ----------
    ready : Ready
        Prepared case.
    rpm, airspeed_m_s : array_like
        Speed of rotation [rev/min] and of flight [m/s]; broadcast.
    air : Air
        One state, or arrays from :func:`air_arrays`.
    threads : int
        Threads of the solver; the answer does not depend on it.

    Returns
    -------
    Points
        One entry per point.
    """
    s = solver.solve(ready.prep, rpm, airspeed_m_s, air, threads=threads)
    around = [e for e in ready.effects if forward.acts_on_points(e)]
    if around:
        s = _with_points(ready, s, air)
    n, D = s.rpm / 60.0, ready.diameter_m
    rho, mu, a = (np.broadcast_to(np.asarray(getattr(air, k), float), n.shape) for k in ("rho", "mu", "a_sound"))
    return Points(
        rpm=s.rpm, airspeed_m_s=s.V, density_kg_m3=rho, thrust_N=s.T, torque_Nm=s.Q, power_W=s.P,
        CT=s.CT, CP=s.CP, J=s.J, eta=np.asarray(co.eta(s.J, s.CT, s.CP)), M_tip=np.asarray(co.M_tip(n, D, a)),
        Re75=np.asarray(co.Re75(ready.chord75_m, n, D, s.V, rho, mu)),
        rotor_thrust_N=s.T_rotor, duct_thrust_N=s.T_duct, stator_thrust_N=s.T_stator,
        exhaust_speed_m_s=s.V_exit, converged=s.converged, flags=s.flags,
    )  # fmt: skip


def _with_points(ready: Ready, s: solver.Solution, air: Air) -> solver.Solution:
    """Solution after the effects that act on points; what instruments would show is not part of it."""
    base = ready.model.prepared([e for e in ready.effects if not forward.acts_on_points(e)])
    flow = forward.flow_of(base, s.rpm, s.V, air)
    loads, met, ok = forward.respond(ready.model.prepared, ready.effects, flow)
    nan = np.where(ok, 1.0, np.nan)
    T, Q = loads.T * nan, loads.Q * nan
    scale = flow.rho * flow.n**2 * ready.diameter_m**4
    flags = tuple((*f, *(() if good else ("unconverged with the effects of the case",)))
                  for f, good in zip(s.flags, ok, strict=True))  # fmt: skip
    return dataclasses.replace(
        s, T=T, Q=Q, P=Q * flow.omega, CT=T / scale, CQ=Q / (scale * ready.diameter_m),
        CP=2.0 * np.pi * Q / (scale * ready.diameter_m), T_duct=loads.T_duct * nan,
        T_rotor=T - s.T_stator - loads.T_duct, converged=s.converged & ok, flags=flags,
    )  # fmt: skip


def k1k2(
    case: Case, overrides: Mapping[str, Any] | None, rpm: Array, airspeed_m_s: Array, air: Air
) -> empirical.Estimate:
    """K1/K2 model of a case; a ducted rotor counts its annulus only.

    Parameters
    ----------
    case : Case
        The case.
    overrides : mapping or None
        Changed values.
    rpm, airspeed_m_s : (P,) float
        Conditions. [rev/min], [m/s]
    air : Air
        One state, or arrays from :func:`air_arrays`.

    Returns
    -------
    bemt.formula.k1k2.Estimate
        Thrust, uncertainty, flags. The pitch is the one that the case states, else that of the blade at 0.75 R.
    """
    case = case.replaced(overrides)
    pitch = case.stated_pitch_m
    if np.isnan(pitch):
        pitch = case.rotor().blade.pitch_m()
    hub = case.hub_diameter_m if case.ducted else 0.0
    return empirical.estimate(case.diameter_m, pitch, rpm, airspeed_m_s, air, hub, case.ducted)
