"""Blade-element-momentum solver: prepare a rotor once, solve any number of operating points.

:func:`prepare` bakes geometry, section tables and effects into arrays; :func:`solve` hands them to the compiled
kernel (:mod:`bemt._kernel`), in batch, and gives back a :class:`Solution`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt import _kernel as K
from bemt.air import Air
from bemt.effects import Effect, standard
from bemt.effects.base import Baking
from bemt.polars import (
    ALPHA_COARSE_STEP,
    ALPHA_FINE_HI,
    ALPHA_FINE_LO,
    ALPHA_FINE_STEP,
    ALPHA_GRID,
    DEFAULT_RE,
)

if TYPE_CHECKING:
    from bemt.duct import DuctFlow
    from bemt.polars import Polar
    from geometry.blade import Stations
    from geometry.rotor import Rotor

Array = NDArray[np.float64]

_AGRID = np.array([
    ALPHA_FINE_LO, ALPHA_FINE_HI, 1.0 / ALPHA_FINE_STEP, 1.0 / ALPHA_COARSE_STEP,
    round((ALPHA_FINE_LO + math.pi) / ALPHA_COARSE_STEP),
    round((ALPHA_FINE_LO + math.pi) / ALPHA_COARSE_STEP) + round((ALPHA_FINE_HI - ALPHA_FINE_LO) / ALPHA_FINE_STEP),
    ALPHA_GRID.size,
])  # fmt: skip

# Squared Mach number grid: uniform, so that the kernel needs neither root nor search.
M2_STEP = 0.1

REASONS = {
    K.NO_BRACKET: "no inflow angle balances momentum and blade forces",
    K.NOT_CONVERGED: "root search did not reach its tolerance",
}


@dataclass(frozen=True)
class Prepared:
    """A rotor ready to solve; made by :func:`prepare`, not by hand."""

    rotor: Rotor
    stations: Stations
    effects: tuple[Effect, ...]
    duct: DuctFlow | None
    st: Array
    onset: Array
    tab: Array
    agrid: Array
    rgrid: Array
    num: Array

    @property
    def D(self) -> float:
        """Diameter [m]."""
        return 2.0 * self.rotor.R


@dataclass(frozen=True)
class Solution:
    """Results over P operating points, NaN where not converged.

    Attributes
    ----------
    rpm, V : (P,) float
        Rotation speed [rev/min] and axial onset speed [m/s].
    T, Q, P : (P,) float
        Thrust [N], torque [N m], shaft power [W].  With a duct T is the total.
    CT, CQ, CP, J : (P,) float
        Propeller convention, CT = T/(rho n^2 D^4) [1].
    T_rotor, T_duct, T_stator, V_exit : (P,) float
        Thrust shares [N]; exhaust speed [m/s] (ducted) or far-wake speed (open).
    converged : (P,) bool
        False where any blade element failed.
    flags : tuple of tuple of str
        Words per point: reasons of failure, turbulent states, Mach number above the tables.
    radial : dict of (P, N) float, empty unless asked for
        r, phi, alpha, cl, cd, W, w, v_t, F, dT, dQ, a, ap, Re, M.
    """

    rpm: Array
    V: Array
    T: Array
    Q: Array
    P: Array
    CT: Array
    CQ: Array
    CP: Array
    J: Array
    T_rotor: Array
    T_duct: Array
    T_stator: Array
    V_exit: Array
    converged: NDArray[np.bool_]
    flags: tuple[tuple[str, ...], ...]
    radial: dict[str, Array] = field(default_factory=dict)


def prepare(
    rotor: Rotor,
    polars: Sequence[tuple[float, Polar]],
    effects: Iterable[Effect] | None = None,
    duct: DuctFlow | None = None,
    n_stations: int = 40,
    stations: Stations | None = None,
    mach_max: float = 1.25,
) -> Prepared:
    """Bake a rotor, its section tables and its effects for the kernel.

    Parameters
    ----------
    rotor : geometry.rotor.Rotor
        Blades, blade count, hub.
    polars : sequence of (float, Polar)
        Section tables at r/R; linear blend in r/R between them, constant beyond the ends.
    effects : iterable of Effect, optional
        Physics that is on; default :func:`bemt.effects.standard`.
    duct : DuctFlow, optional
        Momentum numbers of a duct, see :mod:`bemt.duct`.
    n_stations : int
        Blade elements, cosine spaced [1].
    stations : Stations, optional
        Blade elements to use as they are, instead.
    mach_max : float
        Largest section Mach number to tabulate [1]; beyond it the last table is held and the point flagged.

    Returns
    -------
    Prepared
        For :func:`solve`.

    Raises
    ------
    ValueError
        If polars are missing or a station is not usable.
    """
    if not polars:
        raise ValueError("polars: got none; expected at least one (r/R, Polar) pair")
    eff = standard() if effects is None else tuple(effects)
    blade = rotor.blade
    s = stations if stations is not None else blade.midpoints(n_stations, spacing="cosine")
    if not np.all(np.isfinite([s.r, s.dr, s.chord, s.beta])) or np.any(s.r <= 0) or np.any(s.chord < 0):
        raise ValueError("stations: got non-finite values, a radius <= 0 or a negative chord")
    x = np.array([p[0] for p in polars])
    if np.any(np.diff(x) <= 0):
        raise ValueError(f"polars: got r/R {x.tolist()}; expected ascending, distinct values")
    with_mach = any(p.M.size > 1 for _, p in polars)
    n_m = 1
    if with_mach or any(e.uses_mach for e in eff):
        n_m = max(2, math.ceil(mach_max**2 / M2_STEP) + 1)
    M2 = np.arange(n_m) * M2_STEP
    Re, cl, cd = _common_grid([p for _, p in polars], np.sqrt(M2))
    rR = s.r / blade.R
    w = _blend_weights(rR, x)
    alpha0, cla = _zero_and_slope(ALPHA_GRID, cl[:, 0])
    tx = np.array([a[0] for a in blade.anchors])
    bake = Baking(
        r=s.r, dr=s.dr, chord=s.chord, beta=s.beta.copy(), sigma=rotor.B * s.chord / (2.0 * np.pi * s.r),
        R=blade.R, Rhub=blade.Rhub, B=rotor.B, alpha=ALPHA_GRID, Re=Re, M2=M2,
        cl=np.tensordot(w, cl, axes=1), cd=np.tensordot(w, cd, axes=1), alpha0=w @ alpha0, cla=w @ cla,
        onset=np.zeros((s.r.size, 2)), thickness=np.interp(rR, tx, [a[1].thickness for a in blade.anchors]),
        own_mach=w @ np.array([float(p.M.size > 1) for _, p in polars]),
        gap=duct.gap if duct is not None else float("nan"), ducted=duct is not None,
    )  # fmt: skip
    for hook in ("blade", "inflow", "section", "momentum"):
        for e in eff:
            getattr(e, hook)(bake)
    return _pack(rotor, s, eff, duct, bake)


def _common_grid(polars: Sequence[Polar], M: Array) -> tuple[Array, Array, Array]:
    """Reynolds axis and cl, cd of all polars as (P, Nm, Nr, Na); one Reynolds number stays one."""
    re = DEFAULT_RE if any(p.Re.size > 1 for p in polars) else polars[0].Re[:1]
    cl = np.empty((len(polars), M.size, re.size, ALPHA_GRID.size))
    cd = np.empty_like(cl)
    for i, p in enumerate(polars):
        q = p.on_grid(ALPHA_GRID, re, M if p.M.size > 1 else p.M)
        cl[i] = q.cl.transpose(2, 1, 0)
        cd[i] = q.cd.transpose(2, 1, 0)
    return re, cl, cd


def _zero_and_slope(alpha: Array, cl: Array) -> tuple[Array, Array]:
    """Zero-lift angle and slope over the 5 degrees above it, per polar and Reynolds number, (P, Nr) each."""
    window = np.abs(alpha) < np.radians(14.0)
    a = alpha[window]
    y = cl[..., window]
    # last upward crossing below the strongest lift: thin sections may cross more than once in stalled flow
    up = (y[..., :-1] <= 0.0) & (y[..., 1:] > 0.0)
    last = up.shape[-1] - 1 - np.argmax(up[..., ::-1], axis=-1)
    i = np.where(up.any(axis=-1), last, int(np.argmin(np.abs(a))))[..., None]
    y0 = np.take_along_axis(y, i, -1)[..., 0]
    y1 = np.take_along_axis(y, i + 1, -1)[..., 0]
    i = i[..., 0]
    a0 = a[i] - np.where(y1 != y0, y0 / np.where(y1 != y0, y1 - y0, 1.0), 0.0) * (a[1] - a[0])
    j = np.minimum(i + round(math.radians(5.0) / (a[1] - a[0])), a.size - 1)
    slope = np.take_along_axis(y, j[..., None], -1)[..., 0] / np.maximum(a[j] - a0, 1e-6)
    return a0, np.clip(slope, 1.0, 8.0)


def _blend_weights(rR: Array, x: Array) -> Array:
    """(N, P) weights of P anchors at N stations."""
    eye = np.eye(x.size)
    return np.stack([np.interp(rR, x, eye[i]) for i in range(x.size)], axis=1)


def _pack(rotor: Rotor, s: Stations, eff: tuple[Effect, ...], duct: DuctFlow | None, bake: Baking) -> Prepared:
    num = np.zeros(K.N_NUM)
    n = bake.num
    num[K.N_TIP] = n.get("tip", 0.0)
    num[K.N_HUB] = n.get("hub", 0.0) if bake.Rhub > 0 else 0.0
    num[K.N_FAR] = n.get("far_wake", 0.0)
    num[K.N_SWIRL] = n.get("swirl", 0.0)
    num[K.N_BRIDGE] = n.get("bridge", 0.0)
    if duct is not None:
        num[K.N_DUCTED] = 1.0
        num[K.N_WAKE] = 1.0 / duct.wake_ratio**2 + duct.wall_loss
        num[K.N_LIP] = duct.lip_loss
        num[K.N_STATOR] = duct.stator
        num[K.N_GAP] = n.get("gap_share", 0.0)
        num[K.N_LEAK] = n.get("gap_loss", 0.0)
    # the kernel takes the root of the Prandtl exponent, huge where the factor is off
    off = np.full(bake.r.size, 1e6)
    tip = np.sqrt(num[K.N_TIP] * 0.5 * bake.B * np.maximum(bake.R - bake.r, 0.0) / bake.r)
    hub = np.sqrt(num[K.N_HUB] * 0.5 * bake.B * np.maximum(bake.r - bake.Rhub, 0.0) / max(bake.Rhub, 1e-9))
    tip = tip if num[K.N_TIP] > 0.0 else off
    hub = hub if num[K.N_HUB] > 0.0 else off
    st = np.stack(
        [bake.r, bake.dr, bake.chord, bake.beta, bake.sigma, tip, hub, np.log(np.maximum(bake.chord, 1e-9))], axis=1
    )
    tab = np.ascontiguousarray(np.stack([bake.cl, bake.cd], axis=-1))
    nr = bake.Re.size
    log_re = np.log(bake.Re)
    rgrid = np.array(
        [log_re[0], (nr - 1) / (log_re[-1] - log_re[0]) if nr > 1 else 0.0, nr, 1.0 / M2_STEP, bake.M2.size]
    )
    return Prepared(rotor, s, eff, duct, np.ascontiguousarray(st), np.ascontiguousarray(bake.onset), tab,
                    _AGRID, rgrid, num)  # fmt: skip


def solve_point(prep: Prepared, rpm: float, V: float, air: Air) -> tuple[float, float, bool]:
    """One operating point with as little around the kernel as possible.

    Parameters
    ----------
    prep : Prepared
        Rotor from :func:`prepare`.
    rpm : float
        Rotation speed [rev/min].
    V : float
        Axial onset speed [m/s].
    air : Air
        State of the air.

    Returns
    -------
    tuple
        Thrust of the rotor [N], torque [N m], converged.  NaN where not converged.
    """
    out = np.empty(K.N_OUT)
    K.solve_point(rpm * (math.pi / 30.0), V, air.rho, air.mu, air.a_sound, prep.st, prep.onset, prep.tab, prep.agrid,
                  prep.rgrid, prep.num, prep.rotor.B, out, _NO_RADIAL)  # fmt: skip
    if out[5] != K.OK:
        return math.nan, math.nan, False
    return out[0], out[1], True


_NO_RADIAL = np.empty((0, K.N_RADIAL))


def solve(
    prep: Prepared,
    rpm: ArrayLike,
    V: ArrayLike = 0.0,
    air: Air | None = None,
    *,
    radial: bool = False,
    threads: int = 1,
) -> Solution:
    """Solve operating points.

    Parameters
    ----------
    prep : Prepared
        Rotor from :func:`prepare`.
    rpm, V : array_like
        Rotation speed [rev/min] and axial onset speed [m/s], broadcast against each other and raveled to P points.
    air : Air
        State of the air; its fields may be arrays that broadcast too.
    radial : bool
        Keep the radial distributions.
    threads : int
        The batch is cut into so many threads; the answer does not depend on it [1].

    Returns
    -------
    Solution
        Integrated and, if asked for, radial results.

    Raises
    ------
    ValueError
        If a speed is not finite, rpm is not positive or density is not positive.
    """
    air = Air.from_density() if air is None else air
    rpm_, V_, rho, mu, a = (
        np.ascontiguousarray(v, dtype=float).ravel()
        for v in np.broadcast_arrays(
            np.asarray(rpm, float), np.asarray(V, float), np.asarray(air.rho, float), np.asarray(air.mu, float),
            np.asarray(air.a_sound, float),
        )
    )  # fmt: skip
    if not (np.all(np.isfinite(rpm_)) and np.all(rpm_ > 0)):
        raise ValueError("rpm: got a value that is not finite and positive; expected rev/min > 0")
    if not (np.all(np.isfinite(V_)) and np.all(rho > 0)):
        raise ValueError("airspeed or density: got a value that is not finite or not positive")
    n_pts = rpm_.size
    n_st = prep.st.shape[0]
    out = np.empty((n_pts, K.N_OUT))
    rad = np.empty((n_pts, n_st if radial else 0, K.N_RADIAL))
    Omega = rpm_ * (np.pi / 30.0)

    def run(i: int, j: int) -> None:
        K.solve_batch(Omega[i:j], V_[i:j], rho[i:j], mu[i:j], a[i:j], prep.st, prep.onset, prep.tab, prep.agrid,
                      prep.rgrid, prep.num, prep.rotor.B, out[i:j], rad[i:j])  # fmt: skip

    if threads > 1 and n_pts > 64:
        edges = np.linspace(0, n_pts, threads * 4 + 1).astype(int)
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(lambda ij: run(*ij), zip(edges[:-1], edges[1:], strict=True)))
    else:
        run(0, n_pts)
    return _collect(prep, rpm_, V_, rho, mu, a, out, rad)


def _collect(
    prep: Prepared, rpm: Array, V: Array, rho: Array, mu: Array, a_sound: Array, out: Array, rad: Array
) -> Solution:
    ok = (out[:, 5] == K.OK) & np.isfinite(out[:, 0]) & np.isfinite(out[:, 1])
    nan = np.where(ok, 1.0, np.nan)
    T_rotor = out[:, 0] * nan
    Q = out[:, 1] * nan
    n = rpm / 60.0
    D = prep.D
    if prep.duct is not None:
        T, T_stator, V_exit = prep.duct.total(prep, rho, V, out)
        T, T_stator, V_exit = T * nan, T_stator * nan, V_exit * nan
        T_duct = T - T_rotor - T_stator
    else:
        T, T_stator, T_duct = T_rotor, np.zeros_like(T_rotor), np.zeros_like(T_rotor)
        mdot = out[:, 2] * nan
        with np.errstate(divide="ignore", invalid="ignore"):
            V_exit = np.where(np.abs(mdot) > 0, V + T / mdot, V)
    P = Q * rpm * (np.pi / 30.0)
    CT = T / (rho * n**2 * D**4)
    CQ = Q / (rho * n**2 * D**5)
    radial = _radial(prep, rpm, V, rho, mu, a_sound, rad) if rad.shape[1] else {}
    flags = tuple(_flags(prep, o, rp, v, a) for o, rp, v, a in zip(out, rpm, V, a_sound, strict=True)) \
        if n_pts_flagged(out, ok, prep, rpm, V, a_sound) else ((),) * rpm.size  # fmt: skip
    return Solution(rpm, V, T, Q, P, CT, CQ, 2.0 * np.pi * CQ, V / (n * D), T_rotor, T_duct, T_stator, V_exit, ok,
                    flags, radial)  # fmt: skip


def n_pts_flagged(out: Array, ok: NDArray[np.bool_], prep: Prepared, rpm: Array, V: Array, a: Array) -> bool:
    """Whether any point needs words at all (a batch of a million usually does not)."""
    return bool(np.any(~ok) or np.any(out[:, 7] > 0) or np.any(_mach(prep, rpm, V) / a > _mach_top(prep)))


def _mach(prep: Prepared, rpm: Array | float, V: Array | float) -> Any:
    return np.hypot(np.asarray(rpm) * (np.pi / 30.0) * prep.rotor.R, V)


def _mach_top(prep: Prepared) -> float:
    n_m = int(prep.rgrid[4])
    return math.inf if n_m == 1 else math.sqrt((n_m - 1) * M2_STEP)


def _flags(prep: Prepared, out: Array, rpm: float, V: float, a: float) -> tuple[str, ...]:
    words: list[str] = []
    if out[5] != K.OK:
        x = prep.stations.r[int(out[6])] / prep.rotor.R
        words.append(f"not converged at r/R {x:.2f}: {REASONS[int(out[5])]}")
    elif not (np.isfinite(out[0]) and np.isfinite(out[1])):
        words.append("not converged: result is not finite")
    if out[7] > 0:
        share = out[7] / prep.st.shape[0]
        state = "turbulent windmill state" if V > 0 else "vortex-ring or windmill-brake state"
        words.append(f"{state} on {share:.0%} of the blade: momentum theory replaced by an empirical curve")
    if _mach(prep, rpm, V) / a > _mach_top(prep):
        words.append(f"helical tip Mach above {_mach_top(prep):.2f}: section tables held")
    return tuple(words)


def _radial(prep: Prepared, rpm: Array, V: Array, rho: Array, mu: Array, a_sound: Array, rad: Array) -> dict[str, Array]:
    names = ("phi", "alpha", "cl", "cd", "W", "w", "v_t", "F", "dT", "dQ")
    res = {name: rad[:, :, i].copy() for i, name in enumerate(names)}
    r = prep.stations.r
    res["r"] = np.broadcast_to(r, res["phi"].shape).copy()
    UT = rpm[:, None] * (np.pi / 30.0) * r + prep.onset[None, :, 1]
    UP = V[:, None] + prep.onset[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        # induction factors relative to the onset speed; a is infinite at rest and reported as NaN
        res["a"] = np.where(UP != 0.0, res["w"] / UP - 1.0, np.nan)
        res["ap"] = res["v_t"] / UT
    res["Re"] = rho[:, None] * np.abs(res["W"]) * prep.stations.chord / mu[:, None]
    res["M"] = np.abs(res["W"]) / a_sound[:, None]
    return res
