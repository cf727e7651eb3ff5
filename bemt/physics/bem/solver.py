"""Blade-element-momentum solver: prepare a rotor once, solve any number of operating points.

:func:`prepare` bakes geometry, section tables and effects into arrays; :func:`solve` hands them to the compiled
kernel (:mod:`bemt.physics.bem.kernel`), in batch, and gives back a :class:`Solution`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array
from bemt.physics import coefficients as co
from bemt.physics.air import Air
from bemt.physics.bem import kernel as K
from bemt.physics.bem import packing as arrays
from bemt.physics.bem import residual as res
from bemt.physics.bem.packing import M2_STEP
from bemt.physics.cavitation import WET, keller_N
from bemt.physics.effects import Effect, standard
from bemt.physics.effects.base import RotorBuild
from bemt.physics.sections.polars import ALPHA_GRID

if TYPE_CHECKING:
    from bemt.physics.bem.duct import DuctFlow
    from bemt.physics.bem.oblique_near import Near
    from bemt.physics.sections.polars import Polar
    from geometry.rotor import Rotor, Stations

__all__ = ["REASONS", "Prepared", "Solution", "prepare", "solve", "solve_point", "standard"]

REASONS = {
    K.NOT_CONVERGED: "root search did not reach its tolerance",
    K.JUMP: "the balance of momentum and blade forces jumps over zero",
    K.NOT_FINITE: "the balance of momentum and blade forces is not finite",
}
"""Words for the kernel's states of failure."""

THICKNESS = 0.12
"""Thickness over chord of blades whose sections are not known [1]."""

_RAD_PER_RPM = math.pi / 30.0
# Share of the least Reynolds number of tables that is no departure from it.
_ROUND = 0.01
_NO_COLUMNS = np.empty((1, 0, K.N_RADIAL))
# Fewer points than this are not worth a thread.
_THREAD_MIN = 64


@dataclass(frozen=True, eq=False)
class Prepared:
    """A rotor ready to solve; made by :func:`prepare`, not by hand."""

    rotor: Rotor
    stations: Stations
    effects: tuple[Effect, ...]  # Physics that is on
    duct: DuctFlow | None  # Momentum numbers of the duct
    st: Array  # (N, 14) Columns ``S_*`` of :mod:`bemt.physics.bem.kernel`, in SI units
    # (N, rows, Na, 2) Section tables as the kernel reads them, see :func:`bemt.physics.bem.kernel.entry`; written out
    # in ``tables`` [1]
    tab: Array
    axes: tuple[int, int]  # Mach and Reynolds numbers of the tables
    # (13,), (17,) Numbers of the effects and of the table axes, see :mod:`bemt.physics.bem.residual` and
    # :mod:`bemt.physics.bem.kernel` [SI units]
    num: Array
    grid: Array
    cone: float | None = None  # Coning angle of blades on flapping hinges; None: stiff blades [rad]
    Re_bottom: float = 0.0  # Least Reynolds number of the tables at 0.75 R; 0 when they do not depend on it [1]

    @property
    def D(self) -> float:
        """Diameter [m]."""
        return 2.0 * self.rotor.R

    @property
    def mach_top(self) -> float:
        """Largest tabulated Mach number; infinite when the tables do not depend on it [1]."""
        n_m = self.axes[0]
        return math.inf if n_m == 1 else math.sqrt((n_m - 1) * M2_STEP)

    @property
    def layout(self) -> str:
        """How ``tab`` is laid out: the kernel's word for it."""
        if self.axes == (1, 1):
            return "plain"
        return "factored" if self.grid[12] < 2 * self.tab.shape[2] * self.axes[1] and self.axes[0] > 1 else "full"

    @property
    def tables(self) -> Array:
        """Coefficients cl, cd over squared Mach number, Reynolds number and angle, (N, Nm, Nr, Na, 2) [1]."""
        n, rows, n_a, _ = self.tab.shape
        if self.layout != "factored":
            return self.tab.reshape(n, *self.axes, n_a, 2)
        over_re, over_m = self.tab[:, None, : self.axes[1]], self.tab[:, self.axes[1] :, None]
        return np.stack([over_re[..., 0] * over_m[..., 0], over_re[..., 1] + over_m[..., 1]], axis=-1)

    @cached_property
    def kernel(self) -> tuple[Callable[..., None], Array, Array, Array]:
        """Entry point of the kernel that fits the rotor, and its constant arguments."""
        entry = K.entry(bool(self.num[res.N_DUCTED] > 0.0), self.layout)
        st = np.array(self.st, dtype=np.float64, order="C")
        tab = np.ascontiguousarray(self.tab, dtype=np.float64).reshape(-1)
        return entry, st, tab, np.concatenate([self.num, self.grid])


class Radial(NamedTuple):
    """Distributions along the blade, (P, N) each; the first ten are the columns of the kernel."""

    phi: Array  # Inflow angle [rad]
    alpha: Array  # Angle of attack [rad]
    cl: Array
    cd: Array
    W: Array  # Speed at the section [m/s]
    w: Array  # Axial and tangential speed through the disk [m/s]
    v_t: Array
    F: Array  # Loss factor [1]
    dT: Array  # Thrust [N] and torque [N m] of an element of all blades
    dQ: Array
    r: Array  # [m]
    a: Array  # Induction factors [1]
    ap: Array
    Re: Array
    M: Array


_NO_RADIAL = Radial(*np.empty((len(Radial._fields), 1, 0)))


@dataclass(frozen=True, eq=False)
class Solution:
    """Results over P operating points, NaN where not converged."""

    # (P,) Rotation speed [rev/min] and axial onset speed [m/s]
    rpm: Array
    V: Array
    # (P,) Thrust [N], torque [N m], shaft power [W].  With a duct T is the total
    T: Array
    Q: Array
    P: Array
    # (P,) Propeller convention, CT = T/(rho n^2 D^4) [1]
    CT: Array
    CQ: Array
    CP: Array
    J: Array
    # (P,) Thrust shares [N]; speed in the exit plane, mass flow / (rho A_exit) (ducted), or in the far wake, averaged
    # over the mass flow (open) [m/s]
    T_rotor: Array
    T_duct: Array
    T_stator: Array
    V_exit: Array
    mass_flow: Array  # (P,) Mass flow through the disk [kg/s]
    converged: NDArray[np.bool_]  # (P,) False where any blade element failed
    # Words per point: reasons of failure, turbulent states, Mach number above the tables
    flags: tuple[tuple[str, ...], ...]
    radial: Radial = _NO_RADIAL  # Distributions along the blade, if asked for
    side: Array | None = None  # (P,) In-plane onset speed [m/s], if any was given
    # (P, 4) In-plane forces H (downstream), Y (to the advancing side) [N], roll moment (lifts the advancing side) and
    # pitch moment (lifts the upstream side) [N m]; given with `side`
    hub: Array | None = None
    # (P, N, azimuths) Thrust per area over blade and azimuth, if asked for with `radial` [N/m2]; 0 where `side` is 0
    disk: Array | None = None


def prepare(
    rotor: Rotor, polars: Sequence[tuple[float, Polar]], effects: Iterable[Effect] | None = None,
    duct: DuctFlow | None = None, n_stations: int = 40, stations: Stations | None = None, mach_max: float = 1.25, *,
    level: float = 1.0, re_range: tuple[float, float] | None = None,
) -> Prepared:  # fmt: skip
    """Bake a rotor, its section tables and its effects (default: the standard ones) for the kernel.

    A blade without sections counts as 12 % thick (wave drag). Section tables at r/R blend linearly between them and are
    constant beyond the ends; beyond `mach_max` the last table is held and the point flagged. `stations` are used as
    they are instead of `n_stations` cosine-spaced ones. `level`: share at which effects act whose size differs between
    points, see :meth:`bemt.physics.effects.Effect.share`. `re_range`: Reynolds numbers that will occur; other tables
    are left out, which makes many preparations cheap. ValueError if polars are missing or a station is not usable.

    >>> from bemt.physics.sections.polars import linear_polar
    >>> from geometry.laws import helix
    >>> from geometry.rotor import Rotor
    >>> ready = prepare(Rotor(helix(0.254, 0.127), 2), [(0.75, linear_polar(cd=0.01))])
    >>> ready.st.shape[0], round(ready.mach_top, 3)
    (40, 1.265)
    """
    if not polars:
        raise ValueError("polars: got none; expected at least one (r/R, Polar) pair")
    eff = standard() if effects is None else tuple(effects)
    by_Re = any(e.id == "reynolds" for e in eff)
    if not by_Re:
        polars = [(x, arrays.at_fixed_re(p)) for x, p in polars]
    for e in (e for e in eff if type(e).duct is not Effect.duct):
        duct = _enclosed(duct, e.duct(rotor.R, duct is not None))
    if duct is not None:
        duct = replace(duct, area=rotor.annulus_area, span=rotor.R - rotor.Rhub)
    s = stations if stations is not None else rotor.blade.midpoints(n_stations, spacing="cosine")
    if not np.all(np.isfinite([s.r, s.dr, s.chord, s.beta])) or np.any(s.r <= 0) or np.any(s.chord < 0):
        raise ValueError("stations: got non-finite values, a radius <= 0 or a negative chord")
    bake = _build(rotor, s, polars, any(e.uses_mach for e in eff), mach_max, re_range, duct, level)
    for hook in ("blade", "inflow", "section", "momentum"):
        for e in (e for e in eff if getattr(type(e), hook) is not getattr(Effect, hook)):
            if hook == "section" and bake.mach_apart and not e.uses_mach:
                bake.spread()
            # behind a change of Mach number, one that is written into the tables would come before it
            bake.cl.flags.writeable = bake.cd.flags.writeable = not bake.mach_apart
            getattr(e, hook)(bake)
    if bake.Re.size == 1:
        bake.spread()  # nothing to save
    num = _numbers(bake, duct)
    st, tab, grid = arrays.pack_stations(bake, num), arrays.pack_tables(bake), arrays.pack_grid(bake)
    cone = None if math.isnan(bake.num.cone) else bake.num.cone
    at_75 = arrays.blend_weights(np.array([0.75]), np.array([x for x, _ in polars]))[0] > 0.0
    least = [float(p.Re[0]) for (_, p), used in zip(polars, at_75, strict=True) if used and p.Re.size > 1]
    bottom = max(least, default=0.0) if by_Re else 0.0
    return Prepared(rotor, s, eff, duct, st, tab, (bake.M2.size, bake.Re.size), num, grid, cone, bottom)


def _build(
    rotor: Rotor, s: Stations, polars: Sequence[tuple[float, Polar]], uses_mach: bool, mach_max: float,
    re_range: tuple[float, float] | None, duct: DuctFlow | None, level: float,
) -> RotorBuild:  # fmt: skip
    """Stations, section tables blended to them, and the numbers that effects start from."""
    blade, x = rotor.blade, np.array([p[0] for p in polars])
    if np.any(np.diff(x) <= 0):
        raise ValueError(f"polars: got r/R {x.tolist()}; expected ascending, distinct values")
    own_mach = np.array([p.M.size > 1 for _, p in polars])
    M2 = arrays.mach_grid(mach_max) if uses_mach or own_mach.any() else np.zeros(1)
    tabulated = np.sqrt(M2) if own_mach.any() else np.zeros(1)
    Re, cl, cd = arrays.common_grid([p for _, p in polars], tabulated, re_range)
    rR = s.r / blade.R
    w = arrays.blend_weights(rR, x)
    alpha0, cla = arrays.zero_and_slope(ALPHA_GRID, cl[:, 0])
    shapes = [(a[0], a[1].thickness) for a in blade.anchors] or [(0.0, THICKNESS)]
    return RotorBuild(
        r=s.r, dr=s.dr, chord=s.chord, beta=s.beta.copy(), sigma=rotor.B * s.chord / (2.0 * np.pi * s.r),
        R=blade.R, Rhub=blade.Rhub, B=rotor.B, alpha=ALPHA_GRID, Re=Re, M2=M2,
        cl=_blended(w, cl), cd=_blended(w, cd), alpha0=w @ alpha0, cla=w @ cla,
        Vx_factor=np.ones(s.r.size), Vy_factor=np.ones(s.r.size), Vx_add=np.zeros(s.r.size),
        Vy_add=np.zeros(s.r.size), thickness=np.interp(rR, [x for x, _ in shapes], [t for _, t in shapes]),
        own_mach=w @ own_mach.astype(float),
        gap=duct.gap if duct is not None else float("nan"), ducted=duct is not None, level=level,
        sections=blade.anchors,
    )  # fmt: skip


def _blended(w: Array, tables: Array) -> Array:
    """Tables of sections (P, Nm, Nr, Na) as those of stations (N, Nm, Nr, Na); one section needs no sum."""
    if w.shape[1] == 1:
        return np.repeat(tables, w.shape[0], axis=0)
    return np.tensordot(w, tables, axes=1)


def _enclosed(duct: DuctFlow | None, numbers: Mapping[str, float] | None) -> DuctFlow | None:
    """Duct with the numbers that an effect sets; an open rotor gets a duct of its own."""
    if numbers is None:
        return None
    from bemt.physics.bem.duct import DuctFlow

    return replace(duct or DuctFlow(1.0), **dict[str, Any](numbers))


def _numbers(bake: RotorBuild, duct: DuctFlow | None) -> Array:
    """Numbers of effects and duct in the order of :mod:`bemt.physics.bem.residual`."""
    n = bake.num
    num = np.zeros(res.N_NUM)
    num[res.N_TIP] = n.tip
    num[res.N_HUB] = n.hub if bake.Rhub > 0 else 0.0
    num[res.N_FAR] = n.far_wake
    num[res.N_SWIRL] = n.swirl
    num[res.N_BRIDGE] = n.bridge
    if duct is not None:
        num[res.N_DUCTED] = 1.0
        num[res.N_WAKE] = 1.0 / (duct.wake_ratio * duct.contraction)
        num[res.N_STREAM] = duct.capture / duct.contraction - 1.0
        num[res.N_BEND] = duct.bend
        num[res.N_LEFT] = duct.nose_capture / duct.contraction
        num[res.N_LENGTH] = duct.length
        num[res.N_WALL] = duct.wall_loss
        num[res.N_LIP] = duct.lip_loss + n.lip_loss
        num[res.N_STATOR] = duct.stator
        num[res.N_GAP] = n.gap_share
        num[res.N_LEAK] = n.gap_loss
    return num


def solve_point(prep: Prepared, rpm: float, V: float, air: Air) -> tuple[float, float, bool]:
    """Thrust [N], torque [N m] and convergence of one point, with as little around the kernel as possible."""
    entry, *constant = prep.kernel
    point = np.array([[rpm * _RAD_PER_RPM, V, air.rho, air.mu, air.a_sound]])
    out = np.empty((1, K.N_OUT))
    entry(point, *constant, out, _NO_COLUMNS)
    T, Q = float(out[0, K.O_T]), float(out[0, K.O_Q])
    if out[0, K.O_STATUS] != K.OK or not math.isfinite(T + Q):
        return math.nan, math.nan, False
    return T, Q, True


def solve(
    prep: Prepared, rpm: ArrayLike, V: ArrayLike = 0.0, air: Air | None = None, *, radial: bool = False,
    threads: int = 1, side: ArrayLike = 0.0, near: Near | None = None,
) -> Solution:  # fmt: skip
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
    side : array_like
        In-plane onset speed [m/s]; points that have some are solved by :mod:`bemt.physics.bem.oblique`, open rotors
        only.
    near : Near
        Rotors that differ a little, at the same points in oblique flow: those after the first cost a tenth and have no
        hub loads.

    Returns
    -------
    Solution
        Integrated and, if asked for, radial results.

    Raises
    ------
    ValueError
        If a speed is not finite, rpm is not positive or a property of the air is not positive.

    Examples
    --------
    >>> from bemt.physics.sections.polars import linear_polar
    >>> from geometry.laws import helix
    >>> from geometry.rotor import Rotor
    >>> ready = prepare(Rotor(helix(0.254, 0.127), 2), [(0.75, linear_polar(cd=0.01))])
    >>> s = solve(ready, 6000.0, [0.0, 5.0, 10.0])
    >>> bool(s.converged.all()), bool(np.all(np.diff(s.CT) < 0))
    (True, True)
    """
    air = Air.from_density() if air is None else air
    if np.any(side):
        return _solve_oblique(prep, rpm, V, air, side, radial, near)
    fields = [np.asarray(v, dtype=float) for v in (rpm, V, air.rho, air.mu, air.a_sound)]
    points = np.empty((*np.broadcast_shapes(*(f.shape for f in fields)), K.N_POINT))
    for i, values in enumerate(fields):
        points[..., i] = values
    points = points.reshape(-1, K.N_POINT)
    _check(points)
    rpm_ = points[:, K.P_OMEGA].copy()
    points[:, K.P_OMEGA] *= _RAD_PER_RPM
    n = points.shape[0]
    out = np.empty((n, K.N_OUT))
    rad = np.empty((n, prep.st.shape[0] if radial else 0, K.N_RADIAL))
    entry, *constant = prep.kernel
    if threads > 1 and n > _THREAD_MIN:
        edges = np.linspace(0, n, threads * 4 + 1).astype(int)

        def part(i: int, j: int) -> None:
            entry(points[i:j], *constant, out[i:j], rad[i:j])

        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(part, edges[:-1], edges[1:]))
    else:
        entry(points, *constant, out, rad)
    return _collect(prep, rpm_, points, out, rad)


def _check(points: Array) -> None:
    """Refuse speeds and air that no rotor runs in."""
    if not (np.all(np.isfinite(points[:, 0])) and np.all(points[:, 0] > 0)):
        raise ValueError("rpm: got a value that is not finite and positive; expected rev/min > 0")
    if not (np.all(np.isfinite(points)) and np.all(points[:, 2 : K.N_POINT] > 0)):
        raise ValueError("airspeed or air: got a value that is not finite or not positive")


def _solve_oblique(
    prep: Prepared, rpm: ArrayLike, V: ArrayLike, air: Air, side: ArrayLike, radial: bool, near: Near | None
) -> Solution:
    """Points of which some have in-plane wind: the others go through the axial kernel."""
    from bemt.physics.bem import oblique

    if prep.duct is not None:
        raise ValueError("side: got in-plane wind on a ducted rotor; expected an open rotor")
    fields = np.broadcast_arrays(*(np.asarray(v, float) for v in (rpm, V, air.rho, air.mu, air.a_sound, side)))
    points = np.stack([f.reshape(-1) for f in fields], axis=1)
    if not np.all(np.isfinite(points[:, oblique.P_SIDE]) & (points[:, oblique.P_SIDE] >= 0.0)):
        raise ValueError("side: got a value that is not finite or is negative; expected m/s >= 0")
    _check(points)
    n, skew = points.shape[0], points[:, oblique.P_SIDE] > 0.0
    rpm_ = points[:, 0].copy()
    points[:, K.P_OMEGA] *= _RAD_PER_RPM
    entry, st, tab, par = prep.kernel
    out, rad = np.empty((n, K.N_OUT)), np.empty((n, 0, K.N_RADIAL))
    given = prep.layout, points[skew], st, tab, par, prep.rotor.R
    disk_ = np.zeros((given[1].shape[0], 0, 0))
    if prep.cone is not None:
        out[skew], hub_, disk_ = oblique.flap(*given, prep.cone, disk=radial)
    elif radial or near is None:
        out[skew], hub_, disk_ = oblique.run(*given, disk=radial)
    else:
        out[skew], hub_ = near.run(*given)
    if not np.all(skew):
        rest = np.ascontiguousarray(points[~skew, : K.N_POINT])
        part = np.empty((rest.shape[0], K.N_OUT))
        entry(rest, st, tab, par, part, np.empty((rest.shape[0], 0, K.N_RADIAL)))
        out[~skew] = part
    hub, disk = np.zeros((n, hub_.shape[1])), np.zeros((n, *disk_.shape[1:]))
    hub[skew], disk[skew] = hub_, disk_
    found = _collect(prep, rpm_, points, out, rad)
    hub = np.where(found.converged[:, None], hub, np.nan)
    return replace(found, side=points[:, oblique.P_SIDE].copy(), hub=hub, disk=disk if radial else None)


def _collect(prep: Prepared, rpm: Array, points: Array, out: Array, rad: Array) -> Solution:
    ok = (out[:, K.O_STATUS] == K.OK) & np.isfinite(out[:, K.O_T]) & np.isfinite(out[:, K.O_Q])
    nan = np.where(ok, 1.0, np.nan)
    V, rho = points[:, K.P_V].copy(), points[:, K.P_RHO]
    T_rotor, Q = out[:, K.O_T] * nan, out[:, K.O_Q] * nan
    n = rpm / 60.0
    D = prep.D
    if prep.duct is not None:
        T, T_stator, V_exit = (v * nan for v in prep.duct.total(rho, V, points[:, K.P_MU], out))
        T_duct = T - T_rotor - T_stator
        mass = out[:, K.O_MASS] * nan
    else:
        T, T_stator, T_duct = T_rotor, np.zeros_like(T_rotor), np.zeros_like(T_rotor)
        mass = out[:, K.O_MASS] * nan
        with np.errstate(divide="ignore", invalid="ignore"):
            V_exit = np.where(mass > 0.0, V + T / mass, V * nan)
    CT = T / (rho * n**2 * D**4)
    CQ = Q / (rho * n**2 * D**5)
    radial = _radial(prep, points, rad) if rad.shape[1] else _NO_RADIAL
    return Solution(
        rpm, V, T, Q, Q * points[:, K.P_OMEGA], CT, CQ, 2.0 * np.pi * CQ, V / (n * D), T_rotor, T_duct, T_stator,
        V_exit, mass, ok, _flags(prep, points, out, ok), radial,
    )  # fmt: skip


def _flags(prep: Prepared, points: Array, out: Array, ok: NDArray[np.bool_]) -> tuple[tuple[str, ...], ...]:
    """Words per point: one set for each combination that occurs, so that a large batch costs no loop over points."""
    n = out.shape[0]
    tip = points[:, K.P_OMEGA] * prep.rotor.R
    if points.shape[1] > K.N_POINT:
        tip = tip + points[:, K.N_POINT]  # of the advancing blade
    mach = np.hypot(tip, points[:, K.P_V]) / points[:, K.P_SOUND]
    behind = points[:, K.P_V] < 0.0
    # the columns of the words, each a small whole number
    status = np.where(ok | (out[:, K.O_STATUS] > 0), out[:, K.O_STATUS], K.NOT_FINITE)
    counts = [out[:, i] for i in (K.O_BRIDGED, K.O_STAGNANT, K.O_REVERSED)]
    # of the rotation, at 0.75 R, where a rotor is judged
    slow = _Re75(prep, points) < (1.0 - _ROUND) * prep.Re_bottom
    columns = [status, np.where(ok, -1.0, out[:, K.O_WHERE]) + 1.0, *counts, mach > prep.mach_top, slow, behind]
    wet, cavitates = points[:, K.P_RHO] > WET, np.zeros(n, dtype=bool)
    if wet.any():
        cavitates = wet & (out[:, K.O_T] > keller_N(prep.rotor))
    columns.append(cavitates)
    backwards = behind if prep.duct is not None else np.zeros(n, dtype=bool)
    loud = np.flatnonzero(~ok | (mach > prep.mach_top) | slow | backwards | cavitates | (np.sum(counts, axis=0) > 0))
    flags: list[tuple[str, ...]] = [()] * n
    if loud.size == 0:
        return tuple(flags)
    base = prep.st.shape[0] + 2
    key = np.zeros(loud.size, dtype=np.int64)
    for column in columns:
        key = key * base + column[loud].astype(np.int64)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    words = [_words(prep, *(int(c[loud[i]]) for c in columns)) for i in first]
    for i, j in zip(loud.tolist(), inverse.tolist(), strict=True):
        flags[i] = words[j]
    return tuple(flags)


def _Re75(prep: Prepared, points: Array) -> Array:
    """Reynolds number at 0.75 R without induced velocity, (P,) [1]."""
    chord = float(np.interp(0.75 * prep.rotor.R, prep.stations.r, prep.stations.chord))
    turns = points[:, K.P_OMEGA] / (2.0 * np.pi)
    return np.asarray(co.Re75(chord, turns, prep.D, *(points[:, i] for i in (K.P_V, K.P_RHO, K.P_MU))))


def below_tables(prep: Prepared) -> str:
    """Flag of a point whose Reynolds number at 0.75 R the section tables do not reach."""
    return f"Re at 0.75 R below {prep.Re_bottom:,.0f}: section tables held at their least Reynolds number"


def _words(
    prep: Prepared, status: int, where: int, bridged: int, stagnant: int, reversed_: int, fast: int, slow: int,
    behind: int, cavitates: int,
) -> tuple[str, ...]:  # fmt: skip
    words: list[str] = []
    n = prep.st.shape[0]
    if status != K.OK:
        place = f" at r/R {prep.stations.r[where - 1] / prep.rotor.R:.2f}" if where > 0 else ""
        words.append(f"not converged{place}: {REASONS[status]}")
    if bridged:
        state = "vortex-ring or windmill-brake state" if behind else "turbulent windmill state"
        words.append(f"{state} on {bridged / n:.0%} of the blade: momentum theory replaced by an empirical curve")
    if stagnant:
        words.append(f"drag swirls the flow along with {stagnant / n:.0%} of the blade: momentum theory doubtful")
    if reversed_:
        words.append(f"flow reversed through the duct on {reversed_ / n:.0%} of the blade")
    if behind and prep.duct is not None:
        words.append("onset flow from behind the duct: exit and lip losses are not known in that direction")
    if fast:
        words.append(f"helical tip Mach above {prep.mach_top:.2f}: section tables held at their last Mach number")
    if slow:
        words.append(below_tables(prep))
    if cavitates:
        words.append(
            f"cavitates at a depth of 1 m: blades of this area take {keller_N(prep.rotor):.3g} N (Keller 1966)"
        )
    return tuple(words)


def _radial(prep: Prepared, points: Array, rad: Array) -> Radial:
    phi, alpha, cl, cd, W, w, v_t, F, dT, dQ = (rad[:, :, i].copy() for i in range(10))
    alpha = np.remainder(alpha + np.pi, 2.0 * np.pi) - np.pi
    r = prep.st[:, K.S_R]
    Omega, V, rho, mu, a_sound = (points[:, i, None] for i in range(K.N_POINT))
    UT = Omega * r * prep.st[:, K.S_TANG_FACTOR] + prep.st[:, K.S_TANG]
    UP = V * prep.st[:, K.S_AXIAL_FACTOR] + prep.st[:, K.S_AXIAL]
    with np.errstate(divide="ignore", invalid="ignore"):
        # induction factors relative to the onset speed; a is infinite at rest and reported as NaN
        a, ap = np.where(UP != 0.0, w / UP - 1.0, np.nan), v_t / UT
    Re = rho * np.abs(W) * prep.st[:, K.S_CHORD] / mu
    r = np.broadcast_to(r, phi.shape).copy()
    return Radial(phi, alpha, cl, cd, W, w, v_t, F, dT, dQ, r, a, ap, Re, np.abs(W) / a_sound)
