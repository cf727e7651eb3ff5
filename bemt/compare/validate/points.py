"""Measured points of one propeller beside what the solver gives for them, and the errors that count."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bemt.effects import Effect
    from bemt.readers.uiuc import UiucPropeller
    from geometry.rotor import Rotor

Array = NDArray[np.float64]
Stations = tuple[Array, Array, Array]

# Forward flight is compared up to this share of the measured zero-thrust advance ratio: beyond it a relative error
# of CT says more about J0 than about the model.
J_SHARE = 0.8
N_STATIONS = 40


@dataclass(frozen=True)
class Rows:
    """Measured and computed coefficients of one propeller, P points.

    Attributes
    ----------
    static : (P,) bool
        Static points.
    rpm, J : (P,) float
        Conditions [rev/min], [1].
    CT, CP, CT_bemt, CP_bemt : (P,) float
        Propeller convention [1]; NaN where not converged.
    J0, J0_bemt : float
        Advance ratio of zero thrust, measured and computed [1]; NaN where not reached.
    """

    static: NDArray[np.bool_]
    rpm: Array
    J: Array
    CT: Array
    CP: Array
    CT_bemt: Array
    CP_bemt: Array
    J0: float
    J0_bemt: float


def zero_thrust_J(lines: Iterable[tuple[Array, Array]]) -> float:
    """Advance ratio where thrust vanishes, median over rpm lines.

    Parameters
    ----------
    lines : iterable of ((N,) float, (N,) float)
        J and CT of each line [1].

    Returns
    -------
    float
        Interpolated at the change of sign, or extrapolated along the last third of the thrust when the line ends above
        zero but below 35 % of its largest CT; NaN if no line gets that far [1].

    >>> J = np.linspace(0.1, 0.7, 13)
    >>> round(zero_thrust_J([(J, 0.1 * (0.6 - J))]), 6)
    0.6
    """
    found = []
    for J, CT in lines:
        order = np.argsort(J)
        J, CT = np.asarray(J)[order], np.asarray(CT)[order]
        if J.size < 4 or not np.nanmax(CT) > 0:
            continue
        tail = CT < 0.35 * np.nanmax(CT)
        if np.count_nonzero(tail) < 2:
            continue
        slope, at_zero = np.polyfit(CT[tail], J[tail], 1)
        if slope < 0 and at_zero > 0:
            found.append(at_zero)
    return float(np.median(found)) if found else float("nan")


def build(propeller: UiucPropeller, stations: Stations | None = None) -> Rotor:
    """Rotor of a measured propeller with the rule's sections.

    Parameters
    ----------
    propeller : UiucPropeller
        Names, diameter, blade count, stations.
    stations : tuple of (N,) float, optional
        r/R [1], c/R [1] and beta [rad] to use instead of the propeller's own.

    Returns
    -------
    geometry.rotor.Rotor
        At the nominal diameter.
    """
    from bemt.sections.rule import airfoil, sections
    from geometry.blade import from_stations
    from geometry.rotor import Rotor

    if stations is None:
        g = propeller.geometry
        if g is None:
            raise ValueError(f"{propeller.name}: got no stations; expected a geometry file")
        stations = (g.r_R, g.c_R, np.radians(g.beta_deg))
    x, c, beta = stations
    R = 0.5 * propeller.diameter_m
    keep = x <= 1.0
    thickness = propeller.thickness
    law = None if thickness is None else (thickness.r_R, thickness.t_c)
    anchors = tuple((s.r_R, airfoil(s)) for s in sections(propeller.family, law))
    blade = from_stations(x[keep] * R, np.maximum(c[keep], 1e-3) * R, beta[keep], R, float(x[0]) * R, anchors=anchors)
    return Rotor(blade, propeller.blades, propeller.rotation, propeller.name)


def compare(
    propeller: UiucPropeller,
    effects: Sequence[Effect],
    fixed_re: float | None = None,
    stations: Stations | None = None,
) -> Rows:
    """Solve every measured point of one propeller.

    Parameters
    ----------
    propeller : UiucPropeller
        With stations and at least one measured table.
    effects : sequence of Effect
        Physics that is on.
    fixed_re : float, optional
        One Reynolds number for all section tables [1].
    stations : tuple of (N,) float, optional
        r/R [1], c/R [1] and beta [rad] from elsewhere, see :func:`build`.

    Returns
    -------
    Rows
        Measured and computed values, point by point.
    """
    from bemt.air import Air
    from bemt.bem import solver
    from bemt.sections import polars
    from bemt.sections.neuralfoil import neuralfoil_polar

    air = Air.from_density()
    rotor = build(propeller, stations)
    tables = []
    for x, shape in rotor.blade.anchors:
        table = neuralfoil_polar(shape)
        tables.append((x, polars.fixed_re(table, fixed_re) if fixed_re else table))
    prep = solver.prepare(rotor, tables, effects, n_stations=N_STATIONS, mach_max=0.7)
    static: list[NDArray[np.bool_]] = []
    rpm: list[Array] = []
    J: list[Array] = []
    CT: list[Array] = []
    CP: list[Array] = []
    for s in propeller.statics:
        static.append(np.ones(s.rpm.size, bool))
        rpm.append(s.rpm)
        J.append(np.zeros(s.rpm.size))
        CT.append(s.CT)
        CP.append(s.CP)
    for line in propeller.lines:
        static.append(np.zeros(line.J.size, bool))
        rpm.append(np.full(line.J.size, line.rpm))
        J.append(line.J)
        CT.append(line.CT)
        CP.append(line.CP)
    rpm_, J_ = np.concatenate(rpm), np.concatenate(J)
    sol = solver.solve(prep, rpm_, J_ * rpm_ / 60.0 * propeller.diameter_m, air)
    ends, i = [], sum(s.rpm.size for s in propeller.statics)
    for line in propeller.lines:
        ends.append((line.J, sol.CT[i : i + line.J.size]))
        i += line.J.size
    return Rows(
        np.concatenate(static), rpm_, J_, np.concatenate(CT), np.concatenate(CP), sol.CT, sol.CP,
        zero_thrust_J((line.J, line.CT) for line in propeller.lines),
        zero_thrust_J((a, b) for a, b in ends if np.all(np.isfinite(b))),
    )  # fmt: skip


def errors(rows: Rows) -> dict[str, dict[str, Array]]:
    """Relative errors that count.

    Parameters
    ----------
    rows : Rows
        One propeller.

    Returns
    -------
    dict
        ``static`` and ``forward``, each ``CT`` and ``CP``: (bemt - measured) / measured [1].  Forward points lie
        between 0 and 0.8 of the measured zero-thrust J; where that is unknown the largest measured J stands in.
    """
    limit = J_SHARE * (rows.J0 if np.isfinite(rows.J0) else float(np.max(rows.J, initial=0.0)))
    out: dict[str, dict[str, Array]] = {}
    for name, mask in (("static", rows.static), ("forward", ~rows.static & (rows.J <= limit) & (rows.J >= 0.0))):
        usable = mask & (rows.CT > 0.0) & (rows.CP > 0.0)
        out[name] = {
            "CT": rows.CT_bemt[usable] / rows.CT[usable] - 1.0,
            "CP": rows.CP_bemt[usable] / rows.CP[usable] - 1.0,
        }
    return out


def statistics(error: Array) -> dict[str, float | None]:
    """Median and 90th percentile of the absolute error and median error.

    Parameters
    ----------
    error : (N,) float
        Relative errors; NaN (not converged) counts as infinitely wrong [1].

    Returns
    -------
    dict
        ``median_abs``, ``p90_abs``, ``bias`` [1]; None without points.

    >>> statistics(np.array([-0.1, 0.0, 0.2]))["median_abs"]
    0.1
    """
    if error.size == 0:
        return {"median_abs": None, "p90_abs": None, "bias": None}
    size = np.where(np.isfinite(error), np.abs(error), np.inf)
    return {
        "median_abs": float(np.median(size)),
        "p90_abs": float(np.quantile(size, 0.9, method="higher")),
        "bias": float(np.nanmedian(error)) if np.any(np.isfinite(error)) else None,
    }
