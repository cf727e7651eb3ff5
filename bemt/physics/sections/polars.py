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
