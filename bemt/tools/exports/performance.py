"""Loads of a case for the exports: a table over rpm and advance ratio, one loaded blade, and the band of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.physics.bem.model import HUB_LOADS
from bemt.rotors.validity import kind

if TYPE_CHECKING:
    from bemt.physics.air import Air
    from bemt.physics.bem.model import Model
    from bemt.physics.dataset import Dataset
    from bemt.rotors.case import Case

LOWEST = 0.25
"""Speed over the greatest from which a table is whole."""
SLOW = (0.05, 0.0625, 0.08, 0.1, 0.125, 0.16, 0.2)
"""Slower ones, for small throttle: there where the whole flight range converges at their Reynolds numbers."""
N_RPM = 16
N_J = 25
"""Steps from J = 0 to the greatest J of zero thrust."""
BELOW, BEYOND = 3, 5
"""Steps of that size below J = 0 and beyond zero thrust."""
DIVE = 1.2
"""Airspeed up to which each speed of a table is covered, over that of zero thrust at the greatest speed."""
GROWTH = 1.05
"""Ratio of neighbouring J in the windmill, where coefficients grow as J^2: linear between them within 0.1 %."""
SLOW_DESCENT = 8
"""Steps through the descent of an open rotor, down to twice the induced speed at rest."""


def _prepared(case: Case) -> Model:
    from bemt.rotors.case.prepare import prepare_case

    return prepare_case(case)


def solve_points(
    case: Case, rpm: ArrayLike, airspeed_m_s: ArrayLike, ready: Model | None = None, air: Air | None = None
) -> Dataset:
    """Solve points of a case without bands, in its own air unless another is given; an unsolved point is refused."""
    rpm, V = np.broadcast_arrays(np.asarray(rpm, dtype=float), np.asarray(airspeed_m_s, dtype=float))
    found = (ready or _prepared(case)).solve(rpm.ravel(), V.ravel(), air or case.air())
    _refuse(case, found, found.converged)
    return found


def oblique_loads(case: Case, rpm: Array, airspeed_m_s: Array, side_m_s: Array) -> Array:
    """Thrust, torque, H, Y, roll and pitch moment with a wind along and across the shaft, (6, P) [N], [N m]."""
    found = _prepared(case).solve(rpm, airspeed_m_s, case.air(), side=side_m_s)
    _refuse(case, found, found.converged)
    return np.array([found.thrust_N, found.torque_Nm, *(found[key] for key in HUB_LOADS)])


def _refuse(case: Case, found: Dataset, good: NDArray[np.bool_]) -> None:
    """Refuse to write anything of points that are not good."""
    if not good.all():
        bad = int(np.flatnonzero(~good)[0])
        where = f"{found.rpm[bad]:g} rev/min, {found.airspeed_m_s[bad]:g} m/s"
        words = "; ".join(found.flags[bad]) or "not converged"
        raise InputError(Fault(case.path.as_posix(), where, words, "a converged point", "Nothing was written"))


@dataclass(frozen=True, eq=False)
class Performance:
    """Loads over speed of rotation and advance ratio."""

    name: str  # Of the case
    rpm: Array  # (R,) ascending [rev/min]
    J: Array  # (K,) ascending, from below 0 to beyond zero thrust; holds 0 [-]
    # (R, K) loads [N], [N m]; propeller convention [-]
    thrust_N: Array
    torque_Nm: Array
    CT: Array
    CP: Array
    J_zero: Array  # (R,) where thrust vanishes [-]
    # Of rotor and air [m], [kg/m3], [m/s], [Pa s]
    diameter_m: float
    rho: float
    a_sound: float
    mu: float
    # Number; +1 right-handed, seen from behind clockwise
    blades: int
    sense: int

    @property
    def at_rest(self) -> int:
        """Index of J = 0."""
        return int(np.flatnonzero(self.J == 0.0)[0])

    def check_points(self) -> tuple[Array, Array]:
        """Ends of the speeds and what lies between the nodes, at advance ratios from rest to zero thrust, (P,) each."""
        rpm: Array = np.r_[self.rpm[0], np.sqrt(self.rpm[1:] * self.rpm[:-1]), self.rpm[-1]]
        last = np.interp(rpm, self.rpm, self.J_zero)
        share = np.array([0.0, 0.031, 0.13, 0.27, 0.39, 0.52, 0.63, 0.77, 0.89, 0.97])
        return np.repeat(rpm, share.size), (last[:, None] * share).ravel()

    def flight_nodes(self) -> tuple[Array, Array, Array, Array]:
        """Speed, J, CT and CP at nodes from rest to zero thrust, (N,) each: what fits of few numbers are made to."""
        rpm, J = np.meshgrid(self.rpm, self.J, indexing="ij")
        inside = (J >= 0.0) & (J <= self.J_zero[:, None])
        return rpm[inside], J[inside], self.CT[inside], self.CP[inside]

    def lookup(self, rpm: ArrayLike, airspeed_m_s: ArrayLike) -> tuple[Array, Array]:
        """Thrust [N] and torque [N m] from CT and CP linear in rpm and J, held at the ends."""
        rpm_, V = np.asarray(rpm, dtype=float), np.asarray(airspeed_m_s, dtype=float)
        return table_loads(self.rpm, self.J, self.CT, self.CP, self.rho, self.diameter_m, rpm_, V)

    @property
    def fastest_m_s(self) -> float:
        """Greatest airspeed that each speed of the table is made for. [m/s]"""
        return float(DIVE * self.J_zero.max() * self.rpm[-1] / 60.0 * self.diameter_m)

    @property
    def greatest(self) -> tuple[float, float]:
        """Greatest thrust [N] and torque [N m] up to that airspeed; nodes of a table beyond it are no flight."""
        airspeed = np.outer(self.rpm / 60.0 * self.diameter_m, self.J)
        met = airspeed <= self.fastest_m_s * (1.0 + 1e-9)
        return float(np.abs(self.thrust_N[met]).max()), float(np.abs(self.torque_Nm[met]).max())

    def range_document(self) -> dict[str, Any]:
        """Where the rotor flies and the table reaches, for the manifest."""
        n = self.rpm / 60.0
        return {
            "rpm": [float(self.rpm[0]), float(self.rpm[-1])], "J": [0.0, float(self.J_zero.max())],
            "J_of_table": [float(self.J[0]), float(self.J[-1])],
            "J_zero_thrust": [float(self.J_zero[0]), float(self.J_zero[-1])],
            "airspeed_m_s_of_zero_thrust_at_greatest_rpm": float(self.J_zero[-1] * n[-1] * self.diameter_m),
            "tip_mach_greatest": float(np.pi * n[-1] * self.diameter_m / self.a_sound),
            "density_kg_m3": self.rho, "diameter_m": self.diameter_m,
            "airspeed_m_s_greatest": self.fastest_m_s,
            "flight": "J from 0 to zero thrust; axial flow, steady; doubtful in descent and as a windmill",
        }  # fmt: skip


def table_loads(
    rpm_axis: Array, J_axis: Array, CT: Array, CP: Array, rho: float, D: float, rpm: Array, V: Array
) -> tuple[Array, Array]:
    """Thrust [N] and torque [N m] of a table of coefficients (R, K), bilinear in rpm and J, held at the ends."""
    n = rpm / 60.0
    ct, cp = held((rpm_axis, J_axis), np.array([CT, CP]), rpm, V / np.where(n > 0.0, n * D, np.inf))
    scale = rho * n**2 * D**4
    return ct * scale, cp * scale * D / (2.0 * np.pi)


def held(axes: Sequence[Array], tables: Array, *at: Array) -> Array:
    """Tables over common axes at points, linear along each axis and held at its ends, (tables, P)."""
    from scipy.interpolate import RegularGridInterpolator

    inside = [np.clip(x, axis[0], axis[-1]) for axis, x in zip(axes, at, strict=True)]
    found = RegularGridInterpolator(axes, np.moveaxis(tables, 0, -1))(np.stack(np.broadcast_arrays(*inside), axis=-1))
    return np.asarray(np.moveaxis(found, -1, 0))


def _crossing(J: Array, CT: Array) -> float:
    """First J above 0 where CT falls through zero, NaN without one."""
    ahead = J >= 0.0
    j, c = J[ahead], CT[ahead]
    down = np.flatnonzero((c[:-1] > 0.0) & (c[1:] <= 0.0))
    if down.size == 0:
        return float("nan")
    k = int(down[0])
    return float(j[k] + c[k] * (j[k + 1] - j[k]) / (c[k] - c[k + 1]))


def zero_thrust(case: Case, rpm: Array) -> Array:
    """Advance ratio at which thrust vanishes at each speed [rev/min], (R,); refused where there is none [-]."""
    ready, air = _prepared(case), case.air()

    def thrust(J: Array) -> Array:
        """Thrust at J (R, K)."""
        n = np.broadcast_to(rpm[:, None], J.shape)
        found = ready.solve(n.ravel(), (J * n / 60.0 * ready.diameter_m).ravel(), air)
        return np.where(found.converged, found.thrust_N, np.nan).reshape(J.shape)

    for reach in (4.0, 16.0):  # blades that are all but feathered lose their thrust late
        J = np.broadcast_to(np.linspace(0.0, reach, 161), (rpm.size, 161))
        first = np.array([_crossing(j, row) for j, row in zip(J, thrust(J), strict=True)])
        if not np.isnan(first).any():
            break
    if np.isnan(first).any():
        got = f"no zero of thrust below J = {reach:g} at {rpm[int(np.flatnonzero(np.isnan(first))[0])]:.0f} rev/min"
        wanted, hint = "a rotor with static thrust and none at speed", "A table over J has no end without it"
        raise InputError(Fault(case.path.as_posix(), "operating", got, wanted, hint))
    near = np.maximum(first[:, None] + reach / 160.0 * np.linspace(-1.0, 1.0, 33), 0.0)
    closer = np.array([_crossing(j, row) for j, row in zip(near, thrust(near), strict=True)])
    return np.where(np.isnan(closer), first, closer)


def _nodes(J_zero: float, CT_rest: float, ducted: bool) -> Array:
    """Advance ratios of a table (K,): even through the flight range, wider in descent and in the windmill.

    Programs hold the ends of a table, so the ends lie where a simulated aircraft hardly gets: up to the J of the lowest
    speed at `DIVE` times the airspeed at which the greatest speed has no thrust; down to the descent at twice the
    induced speed at rest (J of the induced speed: sqrt(2 CT / pi), momentum theory), where the vortex ring state ends.
    A duct from behind is not modelled: its table ends just below J = 0.
    """
    step = J_zero / N_J
    near = step * np.arange(-BELOW, N_J + BEYOND + 1)
    last = DIVE * J_zero / SLOW[0]
    far = np.geomspace(near[-1], last, 1 + int(np.ceil(np.log(last / near[-1]) / np.log(GROWTH))))[1:]
    J = np.concatenate([near, far])
    deepest = -2.0 * np.sqrt(2.0 * max(CT_rest, 0.0) / np.pi)
    if not ducted and deepest < near[0] - step:
        J = np.concatenate([np.linspace(deepest, near[0], SLOW_DESCENT + 1)[:-1], J])
    J[int(np.argmin(np.abs(J)))] = 0.0
    return J


def performance_of(case: Case, rpm_top: float, slow_too: bool = True) -> Performance:
    """Tabulate a case from a twentieth (else a quarter) of a speed up to it, from descent to the windmill.

    Inside the flight range (`BELOW` steps under J = 0 to `BEYOND` steps over zero thrust) every point must converge.
    Outside, from the first point of a row that does not, or whose tip is sonic, the force of the point before goes on:
    with the square of the airspeed in the windmill, constant in descent.
    """
    ready = _prepared(case)
    D, air = ready.diameter_m, case.air()
    rpm = np.asarray(
        rpm_top * np.linspace(LOWEST, 1.0, N_RPM), dtype=float
    )  # equal steps: Mach number matters at the upper end
    J_zero = zero_thrust(case, rpm)
    greatest = float(J_zero.max())
    rest = float(solve_points(case, rpm_top, 0.0, ready=ready).thrust_N[0])
    J = _nodes(greatest, rest / (air.rho * (rpm_top / 60.0) ** 2 * D**4), case.ducted)
    n, j = np.meshgrid(rpm, J, indexing="ij")
    V = j * n / 60.0 * D
    step = greatest / N_J
    flight = (j > -(BELOW + 0.5) * step) & (j < (N_J + BEYOND + 0.5) * step)
    slow = _slow(case, ready, rpm_top, J, flight[0]) if slow_too else np.empty(0)
    if slow.size:
        rpm, J_zero = np.r_[slow, rpm], np.r_[zero_thrust(case, slow), J_zero]
        n, j = np.meshgrid(rpm, J, indexing="ij")
        V, flight = j * n / 60.0 * D, np.broadcast_to(flight[0], n.shape)
    T, Q = np.full(n.shape, np.nan), np.full(n.shape, np.nan)
    inside = solve_points(case, n[flight], V[flight], ready=ready)
    T[flight], Q[flight] = inside.thrust_N, inside.torque_Nm
    found = ready.solve(n[~flight], V[~flight], air)
    good = found.converged & (np.hypot(np.pi * n[~flight] / 60.0 * D, V[~flight]) < air.a_sound)
    T[~flight], Q[~flight] = (np.where(good, load, np.nan) for load in (found.thrust_N, found.torque_Nm))
    for row in range(rpm.size):
        held = np.flatnonzero(np.isnan(T[row]))
        ends = (np.min(held[J[held] > 0.0], initial=J.size), np.max(held[J[held] < 0.0], initial=-1))
        up, down = slice(ends[0], None), slice(0, ends[1] + 1)
        for load in (T, Q):
            load[row, up] = load[row, ends[0] - 1] * (J[up] / J[ends[0] - 1]) ** 2
            load[row, down] = load[row, ends[1] + 1]
    scale = air.rho * (rpm[:, None] / 60.0) ** 2 * D**4
    return Performance(
        name=case.name, rpm=rpm, J=J, thrust_N=T, torque_Nm=Q, CT=T / scale, CP=2.0 * np.pi * Q / (scale * D),
        J_zero=J_zero, diameter_m=D, rho=float(air.rho), a_sound=float(air.a_sound), mu=float(air.mu),
        blades=int(case.rotor().B), sense=int(case.rotor().rotation),
    )  # fmt: skip


def at_speed(case: Case, table: Performance, rpm: float) -> Performance:
    """The flight range of a table, from rest to zero thrust, solved at one speed [rev/min]."""
    zero = zero_thrust(case, np.array([rpm]))
    J = np.linspace(0.0, float(zero[0]), N_J + 1)
    n, D = rpm / 60.0, table.diameter_m
    found = solve_points(case, rpm, J * n * D)
    T, Q = found.thrust_N[None], found.torque_Nm[None]
    scale = table.rho * n**2 * D**4
    return replace(table, rpm=np.array([rpm]), J=J, thrust_N=T, torque_Nm=Q, CT=T / scale,
                   CP=2.0 * np.pi * Q / (scale * D), J_zero=zero)  # fmt: skip


def _slow(case: Case, ready: Model, rpm_top: float, J: Array, flight: NDArray[np.bool_]) -> Array:
    """Speeds of `SLOW`, down to the first whose flight range does not converge or has no zero of thrust [rev/min]."""
    rpm, inside = rpm_top * np.array(SLOW), J[flight]
    n = np.repeat(rpm, inside.size)
    found = ready.solve(n, np.tile(inside, rpm.size) * n / 60.0 * ready.diameter_m, case.air())
    good = found.converged.reshape(rpm.size, -1).all(axis=1)
    CT = found.thrust_N.reshape(rpm.size, -1)
    good &= np.isfinite([_crossing(inside, row) for row in CT])
    return rpm[np.flatnonzero(~good).max(initial=-1) + 1 :]


THINNER = 0.75
"""Density for :func:`thinner_air` over that of the case: about 2,900 m higher."""


def thinner_air(case: Case, rpm: float) -> tuple[float, float]:
    """Change of static CT and CP where the density alone falls to `THINNER` of the case's: Reynolds number [-]."""
    from dataclasses import replace

    air, ready = case.air(), _prepared(case)
    base = solve_points(case, rpm, 0.0, ready=ready)
    thin = solve_points(case, rpm, 0.0, ready=ready, air=replace(air, rho=THINNER * air.rho))
    thrust, torque = (
        float(getattr(thin, name)[0] / (THINNER * getattr(base, name)[0]) - 1.0) for name in ("thrust_N", "torque_Nm")
    )
    return thrust, torque


@dataclass(frozen=True)
class StatedBand:
    """Thrust and torque at two airspeeds with their relative standard uncertainty [1], and what is wrong there."""

    thrust: tuple[float, float]
    torque: tuple[float, float]
    thrust_N: tuple[float, float]
    torque_Nm: tuple[float, float]
    rpm: float
    airspeed_m_s: tuple[float, float]
    origin: str
    flags: tuple[str, ...]  # Of both points, each kind once

    def document(self) -> dict[str, Any]:
        """For the manifest, uncertainties in per cent."""
        return {
            "rpm": self.rpm, "airspeed_m_s": list(self.airspeed_m_s), "thrust_N": list(self.thrust_N),
            "thrust_pct": [100.0 * u for u in self.thrust], "torque_Nm": list(self.torque_Nm),
            "torque_pct": [100.0 * u for u in self.torque], "level": "one standard uncertainty",
            "origin": self.origin, "flags": list(self.flags),
        }  # fmt: skip


def band_of(case: Case, rpm: float, airspeed_m_s: tuple[float, float]) -> StatedBand:
    """Loads at a speed and two airspeeds with the band of `bemt.rotors.case.propagate`."""
    from bemt.rotors.case.propagate import propagate

    made = propagate(case, rpm, airspeed_m_s)
    found = made.points
    _refuse(case, found, np.isfinite(found.u_thrust_N) & np.isfinite(found.u_torque_Nm))
    (T0, T1), (Q0, Q1) = ((float(v[0]), float(v[1])) for v in (found.thrust_N, found.torque_Nm))
    with np.errstate(divide="ignore"):
        u = [found.u[name] / np.abs(found[name]) for name in ("thrust_N", "torque_Nm")]
    thrust, torque = ((float(v[0]), float(v[1])) for v in u)
    origin = f"{len(made.moved)} declared assumptions of the case and the spread of rotors as built"
    flags = tuple({kind(flag): flag for point in found.flags for flag in point}.values())
    V0, V1 = airspeed_m_s
    return StatedBand(thrust, torque, (T0, T1), (Q0, Q1), float(rpm), (float(V0), float(V1)), origin, flags)


@dataclass(frozen=True, eq=False)
class Loading:
    """Loads along the blade at one point; all blades together."""

    # The point. [rev/min], [m/s], SI
    rpm: float
    airspeed_m_s: float
    rho: float
    mu: float
    a_sound: float
    # (N,) elements, with what effects do to the blade [m], [rad]
    r: Array
    dr: Array
    chord: Array
    beta: Array
    # (N,) thrust [N] and torque [N m] of each element, of all blades
    dT: Array
    dQ: Array
    # (N,) angle of attack [rad], chord Reynolds and Mach number at which the section tables are read
    alpha: Array
    Re: Array
    M: Array
    # (N,) speed that the loads are made of; axial speed through the disk, in a duct the mean of the ring [m/s]
    W: Array
    w: Array
    # Tip and hub radius [m]
    R: float
    Rhub: float
    # Number; +1 right-handed
    blades: int
    sense: int
    # Sums over the elements [N], [N m]
    thrust_N: float
    torque_Nm: float
    duct_thrust_N: float  # Thrust of duct and stator beside the rotor's [N]

    @property
    def omega(self) -> float:
        """Speed. [rad/s]"""
        return self.rpm * np.pi / 30.0

    @property
    def J(self) -> float:
        """Advance ratio. [-]"""
        return self.airspeed_m_s / (self.rpm / 60.0 * 2.0 * self.R)

    def document(self) -> dict[str, Any]:
        """For the manifest."""
        n, D = self.rpm / 60.0, 2.0 * self.R
        scale = self.rho * n**2 * D**4
        return {
            "rpm": self.rpm, "airspeed_m_s": self.airspeed_m_s, "J": self.J, "rotor_thrust_N": self.thrust_N,
            "torque_Nm": self.torque_Nm, "CT": self.thrust_N / scale,
            "CP": 2.0 * np.pi * self.torque_Nm / (scale * D), "duct_thrust_N": self.duct_thrust_N,
        }  # fmt: skip


def loading_of(case: Case, rpm: float, airspeed_m_s: float) -> Loading:
    """Solve one point with its radial distributions."""
    from bemt.physics.bem import kernel as K
    from bemt.physics.bem import solver

    ready, air = _prepared(case), case.air()
    prep = ready.prep
    s = solver.solve(prep, rpm, airspeed_m_s, air, radial=True)
    if not s.converged[0]:
        got = "; ".join(s.flags[0]) or "not converged"
        fault = Fault(case.path.as_posix(), f"{rpm:g} rev/min, {airspeed_m_s:g} m/s", got, "a converged point")
        raise InputError(fault)
    around = [e.id for e in ready.effects if e not in prep.effects]
    if around:
        raise InputError(
            Fault(
                case.path.as_posix(), "model.effects_on", ", ".join(around),
                "effects that have a radial distribution", "Switch them off for a disk",
            )
        )  # fmt: skip
    rotor = prep.rotor
    at = solver.Radial(*(v[0] for v in s.radial))
    W, chord = at.W, prep.st[:, K.S_CHORD]
    if prep.duct is None:  # an open rotor looks its tables up at the speed without the share of drag, see bem.residual
        W = rpm * np.pi / 30.0 * at.r * np.cos(at.phi) + airspeed_m_s * np.sin(at.phi)
    Re, M = air.rho * np.abs(W) * chord / air.mu, np.abs(W) / air.a_sound
    scale = float(s.T_rotor[0]) / float(at.dT.sum()), float(s.Q[0]) / float(at.dQ.sum())
    if abs(scale[0] - 1.0) > 1e-9 or abs(scale[1] - 1.0) > 1e-9:  # pragma: no cover - a bug
        raise AssertionError(f"radial loads do not sum to the totals: {scale}")
    return Loading(
        float(rpm), float(airspeed_m_s), float(air.rho), float(air.mu), float(air.a_sound), at.r,
        prep.stations.dr, chord, prep.st[:, K.S_BETA], at.dT, at.dQ, at.alpha, Re, M, at.W, at.w, rotor.R, rotor.Rhub,
        int(rotor.B), int(rotor.rotation), float(at.dT.sum()), float(at.dQ.sum()), float(s.T_duct[0] + s.T_stator[0]),
    )  # fmt: skip
