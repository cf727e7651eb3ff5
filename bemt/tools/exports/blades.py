"""Blade and sections as design tools and disks take them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.arrays import Array
from bemt.physics.sections.polars import Polar

if TYPE_CHECKING:
    from bemt.tools.exports.base import Job

MOST_STATIONS = 60
"""Stations that QPROP (81) and XROTOR (60 to 100, by compilation) take."""


def stations(job: Job, most: int = MOST_STATIONS) -> tuple[Array, Array, Array, bool]:
    """Radius [m], chord [m] and angle [rad] of the stations, with what effects do to the blade; whether thinned."""
    blade, p = job.case.rotor().blade, job.loading
    r, thin = blade.r, blade.r.size > most
    if thin:
        r = np.linspace(blade.r[0], blade.r[-1], most)
    chord, beta = blade.at(r)
    turned = p.beta - blade.at(p.r)[1]  # by effects such as pitch_offset
    return r, chord, beta + np.interp(r, p.r, turned), thin


def anchors_of(job: Job) -> list[tuple[float, Polar, float]]:
    """Section tables of the case: r/R, table, Reynolds number there at the operating point."""
    from bemt.rotors.case.prepare import prepare_case

    point = job.loading
    found = prepare_case(job.case).polars
    many = len(found) > 1
    at = [np.clip(x, point.r[0] / point.R, point.r[-1] / point.R) if many else 0.75 for x, _ in found]
    return [
        (x, polar, float(np.interp(where, point.r / point.R, point.Re)))
        for (x, polar), where in zip(found, at, strict=True)
    ]


def section_errors(job: Job, sections: list[Any]) -> list[dict[str, float]]:
    """Greatest error of cl and of cd relative to cd, from the negative to the positive stall, per anchor."""
    out = []
    for (x, polar, Re), s in zip(anchors_of(job), sections, strict=True):
        a = polar.alpha[(polar.alpha >= polar.stall(Re, side=-1)[0]) & (polar.alpha <= polar.stall(Re)[0])]
        cl, cd = polar.lookup(a, Re)
        got_l, got_d = s.cl_cd(a, Re)
        out.append(
            {
                "r_over_R": float(x),
                "Re": Re,
                "cl": float(np.abs(got_l - cl).max()),
                "cd_pct": float(100.0 * np.abs(got_d / cd - 1.0).max()),
            }
        )
    return out


@dataclass(frozen=True, eq=False)
class Frozen:
    """Tables at radii with Reynolds number held at that of the operating point."""

    # (S,) stations [m], [rad]
    r: Array
    chord: Array
    beta: Array
    alpha: Array  # (Na,) angles of attack [rad]
    M: Array  # (Nm,) Mach numbers [1]
    # (S, Na, Nm) coefficients [1]
    cl: Array
    cd: Array
    Re: Array  # (S,) Reynolds numbers that were held [1]
    # (S,) angle of attack [rad] and Mach number of the operating point
    at_alpha: Array
    at_M: Array


def baked(job: Job, count: int = 20) -> Frozen:
    """Section tables as the solver uses them, all effects on sections included, at some of its stations."""
    from bemt.physics.bem.packing import M2_STEP
    from bemt.physics.sections.polars import ALPHA_GRID
    from bemt.rotors.case.prepare import prepare_case

    point = job.loading
    prep = prepare_case(job.case).prep
    keep = np.unique(np.round(np.linspace(0, point.r.size - 1, min(count, point.r.size))).astype(int))
    tab = prep.tables[keep]  # (S, Nm, Nr, Na, 2)
    Re_axis = _re_axis(prep.grid, tab.shape[2])
    mixed = np.empty((keep.size, tab.shape[1], tab.shape[3], 2))
    for k, Re in enumerate(point.Re[keep]):
        if tab.shape[2] == 1:
            mixed[k] = tab[k, :, 0]
            continue
        x = np.log(np.clip(Re, Re_axis[0], Re_axis[-1]))
        j = int(np.clip(np.searchsorted(np.log(Re_axis), x, side="right") - 1, 0, Re_axis.size - 2))
        w = (x - np.log(Re_axis[j])) / np.log(Re_axis[j + 1] / Re_axis[j])
        mixed[k] = (1.0 - w) * tab[k, :, j] + w * tab[k, :, j + 1]
    M = np.sqrt(M2_STEP * np.arange(tab.shape[1]))
    cl, cd = (np.swapaxes(mixed[..., i], 1, 2) for i in (0, 1))
    return Frozen(
        point.r[keep],
        point.chord[keep],
        point.beta[keep],
        np.asarray(ALPHA_GRID),
        M,
        cl,
        cd,
        point.Re[keep],
        point.alpha[keep],
        point.M[keep],
    )


def _re_axis(grid: Array, count: int) -> Array:
    """Reynolds numbers of the solver's tables (see `bemt.physics.bem.packing.pack_grid`): uniform in the logarithm."""
    first, inverse = float(grid[7]), float(grid[8])
    return np.asarray(np.exp(first + np.arange(count) / (inverse or 1.0)))
