"""Section aerodynamics: lift and drag tables over (alpha, Re, Mach), all of +-180 degrees.

Every `Polar` that the solver sees lives on the shared grids below (`Polar.on_grid`), so a kernel finds its cell by
arithmetic. Alpha is uniform in two zones: ALPHA_FINE_STEP inside [ALPHA_FINE_LO, ALPHA_FINE_HI], ALPHA_COARSE_STEP
outside it. Reynolds number is uniform in its logarithm: index = (ln Re - LOG_RE0) / DLOG_RE.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt import cache

__all__ = [
    "ALPHA_COARSE_STEP", "ALPHA_FINE_HI", "ALPHA_FINE_LO", "ALPHA_FINE_STEP", "ALPHA_GRID", "DEFAULT_RE", "DLOG_RE",
    "LOG_RE0", "Polar", "SectionTable", "blend", "extend", "fixed_re", "from_tables", "linear_polar",
    "neuralfoil_polar",
]  # fmt: skip

Array = NDArray[np.float64]

ALPHA_FINE_LO = float(np.deg2rad(-30.0))
ALPHA_FINE_HI = float(np.deg2rad(40.0))
ALPHA_FINE_STEP = float(np.deg2rad(0.5))
ALPHA_COARSE_STEP = float(np.deg2rad(5.0))
_deg = np.r_[np.arange(-180.0, -30.0, 5.0), np.arange(-60, 81) / 2.0, np.arange(45.0, 181.0, 5.0)]
ALPHA_GRID: Array = np.deg2rad(_deg)
"""Shared angles of attack [rad]: 30 coarse steps, 140 fine ones, 28 coarse ones."""
DEFAULT_RE: Array = np.geomspace(1e4, 5e6, 12)
"""Shared chord Reynolds numbers [-]."""
LOG_RE0 = float(np.log(DEFAULT_RE[0]))
DLOG_RE = float(np.log(DEFAULT_RE[-1] / DEFAULT_RE[0]) / (len(DEFAULT_RE) - 1))
ALPHA_GRID.setflags(write=False)
DEFAULT_RE.setflags(write=False)

TABLE_VERSION = 2
"""Raise when the making of tables changes: older cache entries are then ignored."""
RAW_LIMIT_DEG = 20.0
"""NeuralFoil is used up to this |alpha| at most (beyond 20-25 deg it has no training data)."""
CONFIDENCE_MIN = 0.5
"""Past its stall, NeuralFoil is used while its own confidence is above this."""
BLEND_DEG = 2.0
"""Half-width of the blend between the section data and the post-stall model. [deg]"""
REVERSED_LIFT = 0.7
"""Lift of the reversed section against the same angle in normal flow."""
STALL_DROP = 0.03
"""Fall of cl behind a local maximum that makes it a stall."""
SUCTION_DECAY_DEG = 5.0
"""Angle past the matching point over which method "normal" lets the chordwise suction fade by 1/e. [deg]"""
RE_REFERENCE = 3e5
"""Reynolds number whose lift bounds that of lower ones (`lift_floor`)."""
LIFT_SLACK = 0.1
"""Lift coefficient by which lower Reynolds numbers may miss that bound (room for a shift of the zero-lift angle)."""
METHODS = ("viterna", "normal")


class SectionShape(Protocol):
    """What is needed of `geometry.airfoil.Airfoil`."""

    name: str
    x: Array
    y: Array

    def key(self) -> str:
        """Content hash of the coordinates."""
        ...


@dataclass(frozen=True, eq=False)
class Polar:
    """Lift and drag coefficients of one section over angle of attack, Reynolds and Mach number.

    Parameters
    ----------
    alpha : (Na,) float
        Angles of attack, ascending from -pi to pi. [rad]
    Re : (Nr,) float
        Chord Reynolds numbers, ascending; one entry means no dependence. [-]
    M : (Nm,) float
        Mach numbers, ascending; one entry means no dependence. [-]
    cl, cd : (Na, Nr, Nm) float
        Lift and drag coefficients. [-]
    confidence : (Na, Nr) float or None
        The data source's own confidence, 0 to 1 (0 in extrapolated parts); None when it states none. [-]
    name : str
        Name of the section.
    source : str
        Where the numbers come from.
    notes : tuple of str
        What a user of the numbers should know (extrapolation, resampling).

    Raises
    ------
    ValueError
        When shapes disagree, an axis does not ascend, a number is not finite, cd <= 0 or +-pi do not agree.

    Examples
    --------
    >>> p = linear_polar(cd=0.01)
    >>> cl, cd = p.lookup(np.deg2rad(3.0), 1e5)
    >>> round(float(cl), 6), round(float(cd), 6)
    (0.328987, 0.01)
    """

    alpha: Array
    Re: Array
    M: Array
    cl: Array
    cd: Array
    confidence: Array | None = None
    name: str = ""
    source: str = ""
    notes: tuple[str, ...] = ()

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

    @property
    def is_shared(self) -> bool:
        """Whether alpha and Re are the shared grids that kernels index by arithmetic."""
        return np.array_equal(self.alpha, ALPHA_GRID) and np.array_equal(self.Re, DEFAULT_RE)

    def lookup(self, alpha: ArrayLike, Re: ArrayLike, M: ArrayLike = 0.0) -> tuple[Array, Array]:
        """Interpolated cl and cd: linear in alpha, ln Re and M; the reference for the compiled kernel.

        Parameters
        ----------
        alpha : array_like of float
            Angle of attack, any turn (wrapped to +-pi). [rad]
        Re, M : array_like of float
            Reynolds and Mach number, broadcast with alpha; held at the ends of the tables. [-]

        Returns
        -------
        cl, cd : ndarray of float
            Coefficients in the broadcast shape. [-]
        """
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
        """Angle of zero lift [rad]: the crossing of cl between -15 and 15 deg that lies nearest to the chord line."""
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
        """First stall on one side of zero lift.

        Parameters
        ----------
        Re, M : float
            Reynolds and Mach number. [-]
        side : {1, -1}
            Positive or negative lift.

        Returns
        -------
        alpha_stall, cl_max : float
            Angle [rad] and lift coefficient [-] (negative for side -1) of the first extremum behind which cl falls
            by 0.03; without one, those of the largest cl within 20 deg of zero lift.
        """
        a0 = self.alpha0(Re, M)
        step = np.arange(0.0, np.deg2rad(20.0) + 1e-9, ALPHA_FINE_STEP)
        cl = side * self.lookup(a0 + side * step, Re, M)[0]
        i = int(_first_stall(cl))
        return float(a0 + side * step[i]), float(side * cl[i])

    def on_grid(self, alpha: Array = ALPHA_GRID, re: Array = DEFAULT_RE, m: Array | None = None) -> Polar:
        """Resampled polar: linear in alpha, ln Re and M, held at the ends of Re and M (with a note).

        Parameters
        ----------
        alpha, re : (Na,), (Nr,) float, optional
            New axes; the shared grids by default. [rad], [-]
        m : (Nm,) float, optional
            New Mach numbers; the old ones by default. [-]

        Returns
        -------
        Polar
            Itself when nothing changes.
        """
        m = self.M if m is None else np.asarray(m, dtype=float)
        if np.array_equal(alpha, self.alpha) and np.array_equal(re, self.Re) and np.array_equal(m, self.M):
            return self
        conf = np.zeros((self.alpha.size, self.Re.size)) if self.confidence is None else self.confidence
        axes = np.broadcast_arrays(alpha[:, None, None], re[None, :, None], m[None, None, :])
        everywhere = np.repeat(conf[:, :, None], self.M.size, axis=2)
        cl, cd, sure = self._interpolate((self.cl, self.cd, everywhere), *axes)
        notes = self.notes
        if self.Re.size == 1:
            notes += (f"one Reynolds number ({self.Re[0]:.3g}) stands for all",)
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


def _first_stall(cl: Array) -> NDArray[np.intp]:
    """Index along axis 0 of the first maximum behind which cl falls by STALL_DROP (else of the largest)."""
    best = np.maximum.accumulate(cl, axis=0)
    fallen = best - cl > STALL_DROP
    end = np.where(fallen.any(axis=0), fallen.argmax(axis=0), cl.shape[0])
    inside = np.arange(cl.shape[0]).reshape((-1,) + (1,) * (cl.ndim - 1)) < end
    return np.asarray(np.argmax(np.where(inside, cl, -np.inf), axis=0), dtype=np.intp)


def viterna_cd_max(ar: float) -> float:
    """Drag coefficient at 90 deg of a blade of aspect ratio ar: 1.11 + 0.018 AR, held at 2.01 for AR > 50.

    Notes
    -----
    Viterna & Janetzke (1982), NASA TM-82944; equation numbers not checked against the paper.

    Examples
    --------
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

    Parameters
    ----------
    alpha, cl, cd : (N,) float
        Data, ascending in alpha, covering lo - half to hi + half. [rad], [-]
    lo, hi : float
        Matching angles, lo < 0 < hi < pi/2. [rad]
    cd_max : float
        Drag coefficient at 90 deg. [-]
    out : (M,) float, optional
        Angles wanted, within +-pi. [rad]
    half : float, optional
        Half-width of the smooth blend around lo and hi (the data are then needed there); 0 joins at the point. [rad]
    method : {"viterna", "normal"}, optional
        "normal" is Viterna-Corrigan with a suction force along the chord that fades past the stall, so that the drag
        tends to cl tan(alpha) (separated flow: force normal to the chord).

    Returns
    -------
    cl, cd : (M,) float
        Continuous in alpha and across +-pi. [-]

    Notes
    -----
    Up to 90 deg either side: Viterna & Janetzke (1982) matched to the data at hi, and mirrored to the data at lo.
    Beyond 90 deg: the same curve seen from behind with 0.7 of its lift, and within hi (lo) of 180 deg a straight line
    of cl through 0, as in AirfoilPrep (NREL). Drag at 180 deg is twice the least drag of the data, 0.02 at least (own
    assumption). The fading of method "normal", exp(-(alpha - hi) / 5 deg), is an assumption as well. Equation
    numbers and values at 180 deg are not checked against the papers.

    References
    ----------
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


def _confident_range(alpha: Array, cl: Array, confidence: Array, past_stall: float) -> tuple[float, float]:
    """Find the matching angles of one column of NeuralFoil numbers: past the stall while confident, 5 to 20 deg."""
    edge = []
    for sign in (1.0, -1.0):
        use = np.argsort(sign * alpha)
        use = use[(sign * alpha[use] >= -1e-9) & (sign * alpha[use] <= np.deg2rad(RAW_LIMIT_DEG) + 1e-9)]
        i = int(_first_stall(sign * cl[use]))
        end = sign * alpha[use[i]] + past_stall + 1e-9
        while i + 1 < use.size and confidence[use[i + 1]] >= CONFIDENCE_MIN and sign * alpha[use[i + 1]] <= end:
            i += 1
        edge.append(max(abs(float(alpha[use[i]])), float(np.deg2rad(5.0))))
    return -edge[1], edge[0]


def neuralfoil_polar(
    airfoil: SectionShape, *, re: Array = DEFAULT_RE, n_crit: float = 9.0, xtr_upper: float = 1.0,
    xtr_lower: float = 1.0, model: str = "xlarge", ar: float = 10.0, cd_max: float | None = None,
    method: str = "viterna", past_stall: float = np.pi, lift_floor: float = 0.5,
) -> Polar:  # fmt: skip
    """Incompressible polar of a section from NeuralFoil, continued to +-180 deg, cached on disk by content.

    Parameters
    ----------
    airfoil : geometry.airfoil.Airfoil
        Section in Selig order, unit chord.
    re : (Nr,) float, optional
        Chord Reynolds numbers, ascending. [-]
    n_crit : float, optional
        Critical amplification factor of transition (9: average wind tunnel; lower: more disturbed flow). [-]
    xtr_upper, xtr_lower : float, optional
        Forced transition as fraction of chord; 1 is free transition. [-]
    model : str, optional
        NeuralFoil network: "medium", "large", "xlarge", "xxlarge" or "xxxlarge".
    ar : float, optional
        Blade aspect ratio, for the drag at 90 deg. [-]
    cd_max : float, optional
        Drag coefficient at 90 deg; by default 1.11 + 0.018 ar. [-]
    method : {"viterna", "normal"}, optional
        Post-stall model, see `extend`.
    past_stall : float, optional
        How far past its first stall NeuralFoil is used at most (20 deg of alpha and its confidence bound it too). [rad]
    lift_floor : float, optional
        Least share of the lift at Re 3e5, less 0.1 in cl, that lower Reynolds numbers keep; 0: no bound. [-]

    Returns
    -------
    Polar
        On ALPHA_GRID, re and M = [0]; compressibility belongs to `bemt.effects`.

    Raises
    ------
    ValueError
        For a method or a network that is not known, or Reynolds numbers that do not ascend from above 0.

    Notes
    -----
    Two bounds keep low Reynolds numbers sane. NeuralFoil mirrors XFOIL, whose steady laminar separation without
    reattachment takes nearly all lift (NACA 2415, Re 2e4, n_crit 9: cl(0) < 0, slope 0.45 of 2 pi), while the mean
    lift of the unsteady flow keeps about half: hence `lift_floor` (own assumption). And no cd is below laminar friction
    on both sides, 2.656 / sqrt(Re) (Blasius).

    References
    ----------
    Sharpe, P., Hansman, R. J.: NeuralFoil: an airfoil aerodynamics analysis tool using physics-informed machine
    learning. arXiv:2503.16323 (2025).
    """
    re = np.asarray(re, dtype=float)
    if method not in METHODS:
        raise ValueError(f"method: got {method!r}; expected one of {', '.join(METHODS)}.")
    if re.ndim != 1 or re.size == 0 or not np.all(re > 0.0) or np.any(np.diff(re) <= 0.0):
        raise ValueError(f"re: got {re}; expected ascending Reynolds numbers above 0.")
    top = viterna_cd_max(ar) if cd_max is None else float(cd_max)
    settings: dict[str, Any] = {"n_crit": float(n_crit), "xtr": [float(xtr_upper), float(xtr_lower)], "model": model,
                                "cd_max": top, "method": method, "past_stall": float(past_stall),
                                "lift_floor": float(lift_floor)}  # fmt: skip
    version = cache.installed_version("neuralfoil")
    key = cache.content_key(TABLE_VERSION, version, airfoil.key(), settings, re, ALPHA_GRID)
    made = cache.cached_arrays("polar", key, lambda: _make_neuralfoil(airfoil, re, settings))
    source = f"NeuralFoil {version} {model}, n_crit {n_crit:g}, xtr {xtr_upper:g}/{xtr_lower:g}"
    return Polar(ALPHA_GRID, re, np.zeros(1), made["cl"][:, :, None], made["cd"][:, :, None], made["confidence"],
                 airfoil.name, f"{source}; {method} cd_max {top:g}")  # fmt: skip


def _make_neuralfoil(airfoil: SectionShape, re: Array, settings: dict[str, Any]) -> dict[str, Array]:
    """Tables (Na, Nr) from one vectorised NeuralFoil call."""
    import neuralfoil as nf

    reach = RAW_LIMIT_DEG + BLEND_DEG
    raw_deg = np.arange(-2 * reach, 2 * reach + 1) / 2.0
    a, r = np.meshgrid(raw_deg, np.append(re, RE_REFERENCE), indexing="ij")
    aero = nf.get_aero_from_coordinates(
        np.column_stack([airfoil.x, airfoil.y]), a.ravel(), r.ravel(), n_crit=settings["n_crit"],
        xtr_upper=settings["xtr"][0], xtr_lower=settings["xtr"][1], model_size=settings["model"],
    )  # fmt: skip
    cl, cd, conf = (np.asarray(aero[k], dtype=float).reshape(a.shape) for k in ("CL", "CD", "analysis_confidence"))
    if settings["lift_floor"] > 0.0:
        up, down, keep = np.maximum(cl[:, -1:], 0.0), np.minimum(cl[:, -1:], 0.0), settings["lift_floor"]
        sane = np.clip(cl, keep * up + down / keep - LIFT_SLACK, keep * down + up / keep + LIFT_SLACK)
        cl = np.where(np.append(re, np.inf) < RE_REFERENCE, sane, cl)
    cl, cd, conf = cl[:, :-1], cd[:, :-1], conf[:, :-1]
    cd = np.maximum(cd, 2.656 / np.sqrt(re))
    alpha = np.deg2rad(raw_deg)
    out = {name: np.zeros((ALPHA_GRID.size, re.size)) for name in ("cl", "cd", "confidence")}
    half = np.deg2rad(BLEND_DEG)
    for j in range(re.size):
        lo, hi = _confident_range(alpha, cl[:, j], conf[:, j], settings["past_stall"])
        out["cl"][:, j], out["cd"][:, j] = extend(
            alpha, cl[:, j], cd[:, j], lo=lo, hi=hi, cd_max=settings["cd_max"], half=half, method=settings["method"]
        )
        inside = (ALPHA_GRID > lo - half) & (ALPHA_GRID < hi + half)
        out["confidence"][:, j] = np.where(inside, np.interp(ALPHA_GRID, alpha, conf[:, j]), 0.0)
    return out


@dataclass(frozen=True, eq=False)
class SectionTable:
    """One measured or computed polar at one Reynolds and Mach number, over any range of alpha.

    Parameters
    ----------
    alpha : (N,) float
        Ascending angles of attack. [rad]
    cl, cd : (N,) float
        Coefficients. [-]
    Re, M : float
        Reynolds number (1e5 stands in when the source states none) and Mach number. [-]
    """

    alpha: Array
    cl: Array
    cd: Array
    Re: float = 1e5
    M: float = 0.0


def from_tables(
    tables: Sequence[SectionTable], *, name: str = "", source: str = "", ar: float = 10.0,
    cd_max: float | None = None, notes: Sequence[str] = (),
) -> Polar:  # fmt: skip
    """Polar from single-Re tables, each continued to +-180 deg where its data stop.

    Parameters
    ----------
    tables : sequence of SectionTable
        One per (Re, M); together they fill a rectangle of Re x M.
    name, source : str, optional
        Labels of the Polar.
    ar, cd_max : float, optional
        As in `neuralfoil_polar`. [-]
    notes : sequence of str, optional
        Notes to begin with.

    Returns
    -------
    Polar
        On the union of all angles of the data and ALPHA_GRID.

    Raises
    ------
    ValueError
        When data are too short in alpha (they must hold 0 and reach 5 deg), disordered, or fill no rectangle.
    """
    top = viterna_cd_max(ar) if cd_max is None else float(cd_max)
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


def _close(t: SectionTable, out: Array, cd_max: float) -> tuple[Array, Array, list[str]]:
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
    if int(_first_stall(cl[a >= 0.0])) == int(np.sum(a >= 0.0)) - 1:
        said.append(f"data end before the stall (Re {t.Re:.3g}): cl beyond {np.rad2deg(hi):.4g} deg is a guess")
    mirror = min(hi, np.deg2rad(RAW_LIMIT_DEG))
    if a[0] > -mirror:
        said.append(f"negative side (Re {t.Re:.3g}) beyond the data: mirrored with {REVERSED_LIFT:g} of the lift")
        at = np.interp(mirror, a, cl), np.interp(mirror, a, cd)
        a, cl, cd = np.r_[-mirror, a], np.r_[-REVERSED_LIFT * at[0], cl], np.r_[at[1], cd]
    lo = max(float(a[0]), np.deg2rad(-85.0))
    return *extend(a, cl, cd, lo=lo, hi=hi, cd_max=cd_max, out=out), said


def blend(a: Polar, b: Polar, w: float) -> Polar:
    """Mix of two polars, (1 - w) a + w b, on the grids of a.

    Parameters
    ----------
    a, b : Polar
        Polars at both ends.
    w : float
        Share of b, 0 to 1. [-]

    Returns
    -------
    Polar
        Linear mix of cl, cd and confidence.

    Examples
    --------
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
    """Polar whose tables at every Reynolds number are those at one (Reynolds physics taken out).

    Parameters
    ----------
    polar : Polar
        Polar with Reynolds dependence.
    Re : float
        Reynolds number to keep. [-]

    Returns
    -------
    Polar
        Same axes as the given one.
    """
    one = polar.on_grid(polar.alpha, np.array([float(Re)]), polar.M)
    cl, cd = (np.repeat(v, polar.Re.size, axis=1) for v in (one.cl, one.cd))
    conf = None if one.confidence is None else np.repeat(one.confidence, polar.Re.size, axis=1)
    return replace(polar, cl=cl, cd=cd, confidence=conf, notes=(*polar.notes, f"tables of Re {Re:.4g} at every Re"))


def linear_polar(cl_alpha: float = 2.0 * np.pi, alpha0: float = 0.0, cd: float = 1e-12) -> Polar:
    """Ideal section for limits and tests: cl = cl_alpha (alpha - alpha0) without stall to 80 deg, constant cd.

    Parameters
    ----------
    cl_alpha : float, optional
        Lift slope. [1/rad]
    alpha0 : float, optional
        Angle of zero lift. [rad]
    cd : float, optional
        Drag coefficient, above 0. [-]

    Returns
    -------
    Polar
        On the shared grids; beyond 80 deg cl returns to 0 at 180 deg on a straight line.
    """
    knee = np.deg2rad(80.0)
    cl_knee = cl_alpha * np.array([-knee - alpha0, knee - alpha0])
    cl = np.interp(ALPHA_GRID, [-np.pi, -knee, knee, np.pi], [0.0, *cl_knee, 0.0])
    shape = (ALPHA_GRID.size, DEFAULT_RE.size, 1)
    return Polar(ALPHA_GRID, DEFAULT_RE, np.zeros(1), np.broadcast_to(cl[:, None, None], shape),
                 np.full(shape, float(cd)), None, "linear", "analytic")  # fmt: skip
