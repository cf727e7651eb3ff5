"""Section data continued to +-180 degrees: Viterna-Corrigan past the stall, reversed flow behind, tables of users."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.physics.sections.polars import ALPHA_GRID, Polar, first_stall

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
    alpha: Array,
    cl: Array,
    cd: Array,
    *,
    lo: float,
    hi: float,
    cd_max: float,
    out: Array = ALPHA_GRID,
    half: float = 0.0,
    method: str = "viterna",
) -> tuple[Array, Array]:
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
    tables: Sequence[ExtrapolatedTable],
    *,
    name: str = "",
    source: str = "",
    cd_max: float | None = None,
    notes: Sequence[str] = (),
) -> Polar:
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
