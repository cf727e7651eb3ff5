"""Section aerodynamics: lift and drag tables over (alpha, Re, Mach), all of +-180 degrees.

Every `Polar` that the solver sees lives on the shared grids below (`Polar.on_grid`), so a kernel finds its cell by
arithmetic. Alpha is uniform in two zones: ALPHA_FINE_STEP inside [ALPHA_FINE_LO, ALPHA_FINE_HI], ALPHA_COARSE_STEP
outside it. Reynolds number is uniform in its logarithm: index = (ln Re - LOG_RE0) / DLOG_RE.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base import cache
from bemt.base.arrays import Array

ALPHA_FINE_LO = float(np.deg2rad(-30.0))
ALPHA_FINE_HI = float(np.deg2rad(40.0))
ALPHA_FINE_STEP = float(np.deg2rad(0.5))
ALPHA_COARSE_STEP = float(np.deg2rad(5.0))
_deg = np.r_[np.arange(-180.0, -30.0, 5.0), np.arange(-60, 81) / 2.0, np.arange(45.0, 181.0, 5.0)]
ALPHA_GRID: Array = np.deg2rad(_deg)
"""Shared angles of attack [rad]: 30 coarse steps, 140 fine ones, 28 coarse ones."""
DEFAULT_RE: Array = 1e4 * 500.0 ** (np.arange(-3, 12) / 11.0)
"""Shared chord Reynolds numbers: 15 in ratio, 1.8e3 to 5e6, with 1e4 the fourth [-]."""
LOG_RE0 = float(np.log(DEFAULT_RE[0]))
DLOG_RE = float(np.log(DEFAULT_RE[-1] / DEFAULT_RE[0]) / (len(DEFAULT_RE) - 1))
ALPHA_GRID.setflags(write=False)
DEFAULT_RE.setflags(write=False)

RE_FIXED = 1.0e5
"""Reynolds number of all sections when the effect ``reynolds`` is off: upper end of small propellers [-]."""

STALL_DROP = 0.03
"""Fall of cl behind a local maximum that makes it a stall."""


@dataclass(frozen=True, eq=False)
class Polar:
    """Lift and drag coefficients of one section over angle of attack, Reynolds and Mach number.

    Raises ValueError: when shapes disagree, an axis does not ascend, a number is not finite, cd <= 0 or +-pi do not
    agree.

    >>> p = linear_polar(cd=0.01)
    >>> cl, cd = p.lookup(np.deg2rad(3.0), 1e5)
    >>> round(float(cl), 6), round(float(cd), 6)
    (0.328987, 0.01)
    """

    alpha: Array  # (Na,) angles of attack, ascending from -pi to pi [rad]
    Re: Array  # (Nr,) chord Reynolds numbers, ascending; one entry means no dependence [-]
    M: Array  # (Nm,) Mach numbers, ascending; one entry means no dependence [-]
    # (Na, Nr, Nm) lift and drag coefficients [-]
    cl: Array
    cd: Array
    # (Na, Nr) the data source's own confidence, 0 to 1 (0 in extrapolated parts); None when it states none [-]
    confidence: Array | None = None
    name: str = ""  # Name of the section
    source: str = ""  # Where the numbers come from
    notes: tuple[str, ...] = ()  # What a user of the numbers should know (extrapolation, resampling)

    def __post_init__(self) -> None:
        """Freeze the arrays and check them."""
        for field in ("alpha", "Re", "M", "cl", "cd", "confidence"):
            value = getattr(self, field)
            if value is None:
                continue
            value = np.array(value, dtype=float)
            if not np.all(np.isfinite(value)):
                raise ValueError(f"{field}: got a value that is not finite; expected finite numbers.")
            value.setflags(write=False)
            object.__setattr__(self, field, value)
        shape = (self.alpha.size, self.Re.size, self.M.size)
        for field in ("cl", "cd"):
            if getattr(self, field).shape != shape:
                raise ValueError(f"{field}: got shape {getattr(self, field).shape}; expected (Na, Nr, Nm) = {shape}.")
        if self.confidence is not None and self.confidence.shape != shape[:2]:
            raise ValueError(f"confidence: got shape {self.confidence.shape}; expected (Na, Nr) = {shape[:2]}.")
        for field in ("alpha", "Re", "M"):
            value = getattr(self, field)
            if value.ndim != 1 or np.any(np.diff(value) <= 0):
                raise ValueError(f"{field}: got {value}; expected one ascending axis.")
        if abs(self.alpha[0] + np.pi) > 1e-9 or abs(self.alpha[-1] - np.pi) > 1e-9:
            raise ValueError(f"alpha: got {self.alpha[0]} to {self.alpha[-1]}; expected -pi to pi. Use from_tables.")
        if np.min(self.cd) <= 0.0:
            raise ValueError(f"cd: got {np.min(self.cd):g}; expected values above 0.")
        if max(np.abs(self.cl[0] - self.cl[-1]).max(), np.abs(self.cd[0] - self.cd[-1]).max()) > 1e-9:
            raise ValueError("cl, cd: got different values at -pi and pi; expected equal ones (same flow).")

    @cached_property
    def key(self) -> str:
        """Content hash of the tables (names and notes do not count)."""
        return cache.content_key(self.alpha, self.Re, self.M, self.cl, self.cd)

    def lookup(self, alpha: ArrayLike, Re: ArrayLike, M: ArrayLike = 0.0) -> tuple[Array, Array]:
        """Interpolated cl and cd: linear in alpha [rad], ln Re and M; the reference for the compiled kernel."""
        a, r, m = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (alpha, Re, M)))
        cl, cd = self._interpolate((self.cl, self.cd), a, r, m)
        return cl, cd

    def _interpolate(self, tables: Sequence[Array], a: Array, r: Array, m: Array) -> list[Array]:
        """Multilinear values of several tables at the same broadcast points."""
        na, nr, nm = self.cl.shape
        ia, wa = _cell(self.alpha, np.where(np.abs(a) <= np.pi, a, np.remainder(a + np.pi, 2.0 * np.pi) - np.pi))
        ir, wr = _cell(np.log(self.Re), np.log(np.maximum(r, 1e-300)))
        im, wm = _cell(self.M, m)
        out = [np.zeros(a.shape) for _ in tables]
        for ja, fa in ((ia, 1 - wa), (np.minimum(ia + 1, na - 1), wa)):
            for jr, fr in ((ir, 1 - wr), (np.minimum(ir + 1, nr - 1), wr)):
                for jm, fm in ((im, 1 - wm), (np.minimum(im + 1, nm - 1), wm)):
                    for k, table in enumerate(tables):
                        out[k] = out[k] + fa * fr * fm * table[ja, jr, jm]
        return out

    def alpha0(self, Re: float, M: float = 0.0) -> float:
        """Angle of zero lift [rad]: the crossing within 15 deg nearest to the chord line, else the least |cl|."""
        a = self.alpha[np.abs(self.alpha) <= np.deg2rad(15.01)]
        cl, _ = self.lookup(a, Re, M)
        at = np.flatnonzero((cl[:-1] <= 0.0) & (cl[1:] > 0.0))
        if at.size == 0:
            return float(a[np.argmin(np.abs(cl))])
        crossing = a[at] - cl[at] * (a[at + 1] - a[at]) / (cl[at + 1] - cl[at])
        return float(crossing[np.argmin(np.abs(crossing))])

    def cl_alpha(self, Re: float, M: float = 0.0) -> float:
        """Lift-curve slope [1/rad]: least squares from 2 deg below to 6 deg above zero lift, or to the stall."""
        a0 = self.alpha0(Re, M)
        top = max(min(a0 + np.deg2rad(6.0), self.stall(Re, M)[0]), a0 + np.deg2rad(2.0))
        a = np.linspace(a0 - np.deg2rad(2.0), top, 33)
        return float(np.polyfit(a, self.lookup(a, Re, M)[0], 1)[0])

    def stall(self, Re: float, M: float = 0.0, side: int = 1) -> tuple[float, float]:
        """Angle [rad] and lift of the first extremum behind which cl falls by 0.03, else the largest within 20 deg."""
        a0 = self.alpha0(Re, M)
        step = np.arange(0.0, np.deg2rad(20.0) + 1e-9, ALPHA_FINE_STEP)
        cl = side * self.lookup(a0 + side * step, Re, M)[0]
        i = int(first_stall(cl))
        return float(a0 + side * step[i]), float(side * cl[i])

    def on_grid(self, alpha: Array = ALPHA_GRID, re: Array = DEFAULT_RE, m: Array | None = None) -> Polar:
        """Resampled: linear in alpha, ln Re and M, held at the ends of Re and M; itself if nothing changes."""
        m = self.M if m is None else np.asarray(m, dtype=float)
        if np.array_equal(alpha, self.alpha) and np.array_equal(re, self.Re) and np.array_equal(m, self.M):
            return self
        conf = np.zeros((self.alpha.size, self.Re.size)) if self.confidence is None else self.confidence
        axes = np.broadcast_arrays(alpha[:, None, None], re[None, :, None], m[None, None, :])
        everywhere = np.repeat(conf[:, :, None], self.M.size, axis=2)
        cl, cd, sure = self._interpolate((self.cl, self.cd, everywhere), *axes)
        notes = self.notes
        if self.Re.size == 1:
            notes += (f"one Reynolds number ({self.Re[0]:.3g}) is used for all",)
        elif re[0] < self.Re[0] * 0.999 or re[-1] > self.Re[-1] * 1.001:
            notes += (f"held constant outside Re {self.Re[0]:.3g} to {self.Re[-1]:.3g}",)
        kept = None if self.confidence is None else sure[:, :, 0]
        return Polar(alpha, re, m, cl, cd, kept, self.name, self.source, tuple(dict.fromkeys(notes)))


def _cell(axis: Array, x: Array) -> tuple[NDArray[np.intp], Array]:
    """Lower index and weight of the upper neighbour, held at the ends."""
    if axis.size == 1:
        return np.zeros(x.shape, dtype=np.intp), np.zeros(x.shape)
    i = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, axis.size - 2)
    return i, np.clip((x - axis[i]) / (axis[i + 1] - axis[i]), 0.0, 1.0)


def first_stall(cl: Array) -> NDArray[np.intp]:
    """Index along axis 0 of the first maximum behind which cl falls by 0.03, else of the largest.

    >>> int(first_stall(np.array([0.0, 1.0, 1.2, 1.1, 1.3])))
    2
    """
    best = np.maximum.accumulate(cl, axis=0)
    fallen = best - cl > STALL_DROP
    end = np.where(fallen.any(axis=0), fallen.argmax(axis=0), cl.shape[0])
    inside = np.arange(cl.shape[0]).reshape((-1,) + (1,) * (cl.ndim - 1)) < end
    return np.asarray(np.argmax(np.where(inside, cl, -np.inf), axis=0), dtype=np.intp)


def blend(a: Polar, b: Polar, w: float) -> Polar:
    """Mix (1 - w) a + w b of two polars on the grids of a.

    >>> p = blend(linear_polar(cd=0.01), linear_polar(cd=0.03), 0.5)
    >>> round(float(p.lookup(0.0, 1e5)[1]), 6)
    0.02
    """
    b = b.on_grid(a.alpha, a.Re, a.M)
    conf = None if a.confidence is None or b.confidence is None else (1 - w) * a.confidence + w * b.confidence
    name, notes = f"{1 - w:.3f} {a.name} + {w:.3f} {b.name}", tuple(dict.fromkeys(a.notes + b.notes))
    cl, cd = (1 - w) * a.cl + w * b.cl, (1 - w) * a.cd + w * b.cd
    return Polar(a.alpha, a.Re, a.M, cl, cd, conf, name, a.source, notes)


def fixed_re(polar: Polar, Re: float) -> Polar:
    """Polar whose tables at every Reynolds number are those at one."""
    one = polar.on_grid(polar.alpha, np.array([float(Re)]), polar.M)
    cl, cd = (np.repeat(v, polar.Re.size, axis=1) for v in (one.cl, one.cd))
    conf = None if one.confidence is None else np.repeat(one.confidence, polar.Re.size, axis=1)
    return replace(polar, cl=cl, cd=cd, confidence=conf, notes=(*polar.notes, f"tables of Re {Re:.4g} at every Re"))


def linear_polar(cl_alpha: float = 2.0 * np.pi, alpha0: float = 0.0, cd: float = 1e-12) -> Polar:
    """Ideal section: cl = cl_alpha (alpha - alpha0) to 80 deg, then straight to 0 at 180 deg; constant cd."""
    knee = np.deg2rad(80.0)
    cl_knee = cl_alpha * np.array([-knee - alpha0, knee - alpha0])
    cl = np.interp(ALPHA_GRID, [-np.pi, -knee, knee, np.pi], [0.0, *cl_knee, 0.0])
    shape = (ALPHA_GRID.size, DEFAULT_RE.size, 1)
    return Polar(ALPHA_GRID, DEFAULT_RE, np.zeros(1), np.broadcast_to(cl[:, None, None], shape),
                 np.full(shape, float(cd)), None, "linear", "analytic")  # fmt: skip


# Section data continued to +-180 degrees: Viterna-Corrigan past the stall, reversed flow behind, tables of users.

METHODS = ("viterna", "normal")
"""Names of the post-stall models of `extend`."""
REVERSED_LIFT = 0.7
"""Lift of the reversed section against the same angle in normal flow."""
SUCTION_DECAY_DEG = 5.0
"""Angle past the matching point over which method "normal" lets the chordwise suction fade by 1/e. [deg]"""
MIRROR_LIMIT_DEG = 20.0
"""Tables without a negative side are mirrored up to this angle at most. [deg]"""


def viterna_cd_max(ar: float) -> float:
    """Drag coefficient at 90 deg: 1.11 + 0.018 AR up to AR 50 (Viterna and Janetzke 1982, NASA TM-82944; not checked).

    >>> viterna_cd_max(10.0)
    1.29
    """
    return round(1.11 + 0.018 * min(float(ar), 50.0), 12)


def _viterna(a: Array, a_s: float, cl_s: float, cd_s: float, cd_max: float, method: str) -> tuple[Array, Array]:
    """Viterna-Corrigan post-stall cl, cd at 0 < a <= pi/2, equal to (cl_s, cd_s) at the matching angle a_s > 0.

    cl = cd_max/2 sin 2a + A2 cos^2 a / sin a,  cd = cd_max sin^2 a + B2 cos a  (Viterna & Janetzke 1982).
    Then cl tan a - cd = (A2 - B2) cos a: the suction along the chord at a_s never fades. Method "normal" lets it.
    """
    a2 = (cl_s - cd_max * np.sin(a_s) * np.cos(a_s)) * np.sin(a_s) / np.cos(a_s) ** 2
    b2 = (cd_s - cd_max * np.sin(a_s) ** 2) / np.cos(a_s)
    cl, cd = 0.5 * cd_max * np.sin(2 * a) + a2 * np.cos(a) ** 2 / np.sin(a), cd_max * np.sin(a) ** 2 + b2 * np.cos(a)
    if method == "normal":
        faded = -np.expm1(-np.maximum(a - a_s, 0.0) / np.deg2rad(SUCTION_DECAY_DEG))
        cd = cd + max(a2 - b2, 0.0) * np.cos(a) * faded
    return cl, cd


def extend(
    alpha: Array, cl: Array, cd: Array, *, lo: float, hi: float, cd_max: float, out: Array = ALPHA_GRID,
    half: float = 0.0, method: str = "viterna",
) -> tuple[Array, Array]:  # fmt: skip
    """One section's cl and cd continued to +-pi: data between lo and hi, Viterna-Corrigan and reversed flow outside.
    [-]

    Up to 90 deg either side: Viterna & Janetzke (1982) matched to the data at hi, and mirrored to the data at lo.
    Beyond 90 deg: the same curve seen from behind with 0.7 of its lift, and within hi (lo) of 180 deg a straight line
    of cl through 0, as in AirfoilPrep (NREL). Drag at 180 deg is twice the least drag of the data, 0.02 at least (own
    assumption). The fading of method "normal", exp(-(alpha - hi) / 5 deg), is an assumption as well. Equation
    numbers and values at 180 deg are not checked against the papers.

    Viterna, L. A., Janetzke, D. C.: Theoretical and experimental power from large horizontal-axis wind turbines.
    NASA TM-82944 (1982).
    """
    cd_reversed = max(2.0 * float(np.min(cd)), 0.02)
    cl_out, cd_out = np.interp(out, alpha, cl), np.interp(out, alpha, cd)
    for sign, edge in ((1.0, hi), (-1.0, -lo)):
        cl_e = sign * float(np.interp(sign * edge, alpha, cl))
        cd_e = float(np.interp(sign * edge, alpha, cd))
        a = sign * out
        outside = a > edge - half
        front = np.clip(np.where(a > np.pi / 2, np.pi - a, a), max(edge - half, 1e-3), np.pi / 2)
        behind = outside & (np.pi - a >= edge)
        cl_v, cd_v = _viterna(front, edge, cl_e, cd_e, cd_max, method)
        cl_v = np.where(behind & (a > np.pi / 2), -REVERSED_LIFT * cl_v, cl_v)
        tail = np.pi - a < edge
        cl_v = np.where(tail, -REVERSED_LIFT * cl_e * (np.pi - a) / edge, cl_v)
        cd_v = np.where(tail, cd_reversed + (cd_e - cd_reversed) * (np.sin(np.pi - a) / np.sin(edge)) ** 2, cd_v)
        t = np.clip((a - edge + half) / (2.0 * half), 0.0, 1.0) if half > 0.0 else np.ones_like(a)
        w = np.where(outside, t * t * (3.0 - 2.0 * t), 0.0)
        cl_out = (1.0 - w) * cl_out + w * sign * cl_v
        cd_out = (1.0 - w) * cd_out + w * cd_v
    ends = np.abs(np.abs(out) - np.pi) < 1e-9
    return np.where(ends, 0.0, cl_out), np.where(ends, cd_reversed, cd_out)


@dataclass(frozen=True, eq=False)
class ExtrapolatedTable:
    """One measured or computed polar at one Reynolds and Mach number, over any range of alpha."""

    alpha: Array  # (N,) ascending angles of attack [rad]
    # (N,) coefficients [-]
    cl: Array
    cd: Array
    # Reynolds number (1e5 stands in when the source states none) and Mach number [-]
    Re: float = 1e5
    M: float = 0.0


def from_tables(
    tables: Sequence[ExtrapolatedTable], *, name: str = "", source: str = "", cd_max: float | None = None,
    notes: Sequence[str] = (),
) -> Polar:  # fmt: skip
    """Polar from single-Re tables, each continued to +-180 deg where its data stop."""
    top = viterna_cd_max(10.0) if cd_max is None else float(cd_max)
    re, mach = (np.unique([getattr(t, k) for t in tables]) for k in ("Re", "M"))
    if len(tables) != re.size * mach.size or len({(t.Re, t.M) for t in tables}) != len(tables):
        raise ValueError(
            f"tables: got {len(tables)} for {re.size} Reynolds x {mach.size} Mach numbers; expected one for each pair."
        )
    angles = np.concatenate([ALPHA_GRID, *(np.asarray(t.alpha, dtype=float) for t in tables)])
    alpha = np.unique(np.round(angles, 10))
    alpha[0], alpha[-1] = -np.pi, np.pi
    cl, cd = np.empty((2, alpha.size, re.size, mach.size))
    said = list(notes)
    for t in tables:
        i, j = int(np.searchsorted(re, t.Re)), int(np.searchsorted(mach, t.M))
        cl[:, i, j], cd[:, i, j], more = _close(t, alpha, top)
        said += more
    return Polar(alpha, re, mach, cl, cd, None, name, source, tuple(dict.fromkeys(said)))


def _close(t: ExtrapolatedTable, out: Array, cd_max: float) -> tuple[Array, Array, list[str]]:
    """One table on the angles out, over all of +-pi, with notes on what was added."""
    a, cl, cd = (np.asarray(v, dtype=float) for v in (t.alpha, t.cl, t.cd))
    if a.size < 3 or np.any(np.diff(a) <= 0) or a[0] > 0.0 or a[-1] < np.deg2rad(5.0) or a[-1] > np.pi + 1e-9:
        raise ValueError(
            f"alpha: got {a.size} angles from {np.rad2deg(a.min()):.4g} to {np.rad2deg(a.max()):.4g} deg; expected an "
            "ascending range within +-180 deg that holds 0 and reaches 5 deg."
        )
    if a[0] <= -np.pi + 1e-6 and a[-1] >= np.pi - 1e-6:
        cl_out, cd_out = np.interp(out, a, cl), np.interp(out, a, cd)
        gap = abs(cl[0] - cl[-1]) + abs(cd[0] - cd[-1])
        cl_out[[0, -1]], cd_out[[0, -1]] = 0.5 * (cl[0] + cl[-1]), 0.5 * (cd[0] + cd[-1])
        return cl_out, cd_out, [f"values at +-180 deg differ by {gap:.3g}: mean taken"] if gap > 1e-9 else []
    said = [f"data end at {np.rad2deg(a[0]):.4g} and {np.rad2deg(a[-1]):.4g} deg (Re {t.Re:.3g}): Viterna beyond"]
    hi = min(float(a[-1]), np.deg2rad(85.0))
    if int(first_stall(cl[a >= 0.0])) == int(np.sum(a >= 0.0)) - 1:
        said.append(f"data end before the stall (Re {t.Re:.3g}): cl beyond {np.rad2deg(hi):.4g} deg is a guess")
    mirror = min(hi, np.deg2rad(MIRROR_LIMIT_DEG))
    if a[0] > -mirror:
        said.append(f"negative side (Re {t.Re:.3g}) beyond the data: mirrored with {REVERSED_LIFT:g} of the lift")
        at = np.interp(mirror, a, cl), np.interp(mirror, a, cd)
        a, cl, cd = np.r_[-mirror, a], np.r_[-REVERSED_LIFT * at[0], cl], np.r_[at[1], cd]
    lo = max(float(a[0]), np.deg2rad(-85.0))
    return *extend(a, cl, cd, lo=lo, hi=hi, cd_max=cd_max, out=out), said
