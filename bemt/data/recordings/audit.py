r"""Audit of a CFD number: what its set-up does to its uncertainty, line by line.

A recorded CFD thrust is a measurement by an instrument whose settings can be read. Each line names one setting, what is
known of it, and its part of the standard uncertainty of the number, relative to it, where a rule exists: published, or
measured by this project's own OpenFOAM runs (:data:`COMPRESSIBLE`). Without a rule the part is NaN, printed "unknown",
and then so is the whole.

Domain. A wall round the rotor holds its slipstream; Glauert's correction for a propeller in a closed tunnel of area C
gives the equivalent free-stream speed

    V' = V (1 - a tau / (2 sqrt(1 + 2 tau))),    a = A / C,    tau = T / (rho A V^2),

whose limit at rest is V' = -(a / (2 sqrt 2)) sqrt(T / (rho A)). The change of thrust follows from the straight line
T ~ 1 - J / J0 with J0 = 1.19 P/D, the mean of measured propellers (:mod:`bemt.physics.k1k2`). It is
one-dimensional and not used for a > 0.25.

References
----------
H. Glauert, "Wind Tunnel Interference on Wings, Bodies and Airscrews", ARC R&M 1566, 1933 (not checked against the
paper). ASME V&V 20-2009. Limits of y+ for wall functions: B.E. Launder, D.B. Spalding, Comput. Methods Appl. Mech. Eng.
3(2), 1974, 269-289 (not checked against the paper).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

from bemt.base.document import Documented
from bemt.physics.k1k2 import ZERO_THRUST_MEASURED

_FINE_GRID = 0.02
STATUSES = ("fine", "doubtful", "fault", "not stated")

COMPRESSIBLE, COMPRESSIBLE_M_TIP, BUFFER_LAYER, TURBULENCE = 0.063, 0.625, 0.012, 0.016
"""Relative change of static thrust of one 8x5 propeller at 20,000 rev/min, OpenFOAM, half domain [1]: compressible for
incompressible flow (at tip Mach 0.625, isentropic gas, ``reports/cfd``; torque 7.5 %), first cell at y+ 16 for 51,
realizable k-epsilon for k-omega SST.  The last two are differences on one grid of 249,000 cells from before the
periodic sides were mended, and have not been measured again."""

M_TIP_NEGLIGIBLE, M_TIP_MODERATE = 0.3, 0.5
M_TIP_KNOWN = 0.75
"""Tip Mach number above which the quadratic rule is no longer taken: shocks. [1]"""
BLOCKAGE_KNOWN = 0.25
DOMAIN_WIDE = 5.0
"""Domain diameter over disk diameter that counts as a free field (blockage 4 %). [1]"""
BALANCE_LIMIT = 0.01
"""Residual of mass or momentum above which a number is that of no flow; own runs are refused above it too. [1]"""
SKEW_LIMIT = 5.0
"""Inflow angle below which a frozen rotor is taken as fine. [deg]"""


@dataclass(frozen=True)
class CfdFacts:
    """What is known of a CFD run; None or NaN where nothing is stated."""

    # Rotational tip Mach number, advance ratio, pitch over diameter, thrust coefficient [1]
    M_tip: float = math.nan
    J: float = 0.0
    pitch_over_D: float = math.nan
    CT: float = math.nan
    domain_over_D: float = math.nan  # Diameter of the domain over that of the disk [1]
    compressible: bool | None = None  # Whether the density followed the pressure
    grids: int | None = None  # Number of grids the value was computed on; 0 or 1 is no grid study
    u_grid: float = math.nan  # Standard uncertainty from a grid study (GCI / 1.15), relative [1]
    cells: float = math.nan  # Cells of the grid [1]
    drift: float = math.nan  # Change of the thrust over the averaged iterations or revolutions, relative [1]
    wall: str = ""  # ``function``, ``scalable``, ``automatic``, ``resolved`` or empty
    # Mean distance of the first cell in wall units, and the largest [1]
    y_plus: float = math.nan
    y_plus_max: float = math.nan
    turbulence: str = ""  # Model; empty is not stated
    thrust_from: str = ""  # ``forces``, ``node``, ``momentum`` or empty
    steady_mrf: bool | None = None  # Whether the rotor was frozen in a rotating frame
    skew_deg: float = 0.0  # Angle of the inflow against the shaft [deg]
    # Residual of mass over what passes the disk, and of axial momentum over the thrust [1]
    mass_balance: float = math.nan
    momentum_balance: float = math.nan
    # Whether the rotor runs in a duct; the rules that were measured on an open propeller are not used then
    ducted: bool = False


class AuditLine(Documented):
    """One setting and its consequence."""

    topic: str  # Setting
    status: str  # One of :data:`STATUSES`
    finding: str  # What is known
    consequence: str  # What that does to the number
    u_relative: float  # Part of the standard uncertainty of the thrust; NaN is unknown [1]


Judged = tuple[str, str, str, float]
"""Status, finding, consequence and uncertainty of an :class:`AuditLine`."""


def _domain(f: CfdFacts) -> Judged:
    if math.isnan(f.domain_over_D):
        return "not stated", "size of the domain not stated", "blockage unknown", math.nan
    a = 1.0 / f.domain_over_D**2
    words = f"domain {f.domain_over_D:.3g} disk diameters wide, blockage {a:.2g}"
    if f.domain_over_D < 1.5:
        says = "a rotor in a pipe, not a free propeller: no entrainment, no far field"
        return "fault", words, f"{says}; the one-dimensional correction does not hold", math.nan
    status = "fine" if f.domain_over_D >= DOMAIN_WIDE else "doubtful"
    J0 = ZERO_THRUST_MEASURED * f.pitch_over_D
    if a > BLOCKAGE_KNOWN or f.ducted or not (math.isfinite(J0) and f.CT > 0 and J0 > f.J):
        return status, words, "no rule for this blockage or rotor", math.nan
    load = f.CT * 4.0 / math.pi  # T / (rho A) over (n D)^2
    if f.J > 0:
        tau = load / f.J**2
        shift = f.J * a * tau / (2.0 * math.sqrt(1.0 + 2.0 * tau))
    else:
        shift = a / (2.0 * math.sqrt(2.0)) * math.sqrt(load)
    u = shift / (J0 - f.J)
    return status, words, f"Glauert's tunnel correction: J off by {shift:.2g}, thrust by {u:.1%}", u


def _compressibility(f: CfdFacts) -> Judged:
    M = f.M_tip
    if f.compressible:
        return "fine", f"compressible flow, tip Mach {M:.2f}", "none", 0.0
    known = "incompressible flow" if f.compressible is False else "not stated whether compressible"
    words = f"{known}, tip Mach {M:.2f}" if math.isfinite(M) else f"{known}, tip Mach unknown"
    if math.isnan(M):
        return "not stated", words, "unknown", math.nan
    bias = COMPRESSIBLE * (M / COMPRESSIBLE_M_TIP) ** 2
    if M <= M_TIP_NEGLIGIBLE:
        return "fine", words, f"thrust at most {bias:.1%} low (own runs, M^2)", bias
    told = f.compressible is False
    if M > M_TIP_KNOWN:
        shocks = "shocks and wave drag are missing: " if told else ""
        return "fault" if told else "not stated", words, f"{shocks}beyond the measured rule", math.nan
    if f.ducted:
        size = f"an open rotor's thrust is {bias:.1%} low (own runs, M^2); no rule measured for ducted rotors"
        return ("doubtful" if M <= M_TIP_MODERATE else "fault") if told else "not stated", words, size, math.nan
    if not told:
        low = f"thrust up to {bias:.1%} low if incompressible (own runs, M^2)"
        return "not stated", words, low, bias / math.sqrt(3.0)
    low = f"thrust about {bias:.1%} low, torque a fifth more than that (own runs, M^2)"
    return "doubtful" if M <= M_TIP_MODERATE else "fault", words, low, bias


def _grid(f: CfdFacts) -> Judged:
    cells = f"{f.cells:,.0f} cells" if f.cells > 0 else "cells not stated"
    if math.isfinite(f.u_grid):
        n = f.grids or 3
        status = "fine" if f.u_grid <= _FINE_GRID and n >= 3 else "doubtful"
        told = f"u of the grid {f.u_grid:.2%} (GCI / 1.15; {_FINE_GRID:.0%} on three grids is fine)"
        return status, f"{n} grids, {cells}", told, f.u_grid
    if f.grids is None:
        return "not stated", f"grid study not stated; {cells}", "discretization unknown", math.nan
    words = "no grid study" if f.grids <= 1 else f"{f.grids} grids without an index"
    return "fault", f"{words}; {cells}", "discretization unknown", math.nan


def _drift(f: CfdFacts) -> Judged:
    if math.isnan(f.drift):
        return "not stated", "history of the thrust not stated", "convergence unknown", math.nan
    size = abs(f.drift)
    status = "fine" if size <= 0.005 else "doubtful" if size <= 0.02 else "fault"
    words = f"thrust drifts by {round(f.drift, 4) + 0.0:+.2%} over the averaged part"
    return status, words, "taken in full as the standard uncertainty", size


def _wall(f: CfdFacts) -> Judged:
    y = f.y_plus
    words = {
        "function": "wall functions", "scalable": "scalable wall functions", "automatic": "automatic wall functions",
        "resolved": "resolved down to the wall",
    }.get(f.wall, "wall treatment not stated")  # fmt: skip
    if math.isnan(y):
        return "not stated", f"{words}; y+ not stated", "skin friction and stall unknown", math.nan
    words = f"{words}, mean y+ {y:.3g}" + (f", up to {f.y_plus_max:.4g}" if math.isfinite(f.y_plus_max) else "")
    if not f.wall:
        return "not stated", words, "unknown", math.nan
    if f.wall == "resolved":
        if y <= 2.0:
            return "fine", words, "none", 0.0
        return "fault", words, "the sublayer is not resolved", math.nan
    if 30.0 <= y <= 300.0:
        if f.y_plus_max > 300.0:
            return "doubtful", words, "first cell above the log layer in places", math.nan
        return "fine", words, "within the log layer", 0.0
    if y > 300.0:
        return "fault", words, "first cell above the log layer", math.nan
    if y <= 5.0 and f.wall == "automatic":
        return "fine", words, "within the viscous sublayer", 0.0
    if f.ducted:
        return "doubtful", words, "buffer layer; no rule measured for ducted rotors", math.nan
    says = "buffer layer: own runs at y+ 16 and 51 differ by 1.2 % in thrust, 2.4 % in torque"
    return "doubtful", words, says, BUFFER_LAYER


def _turbulence(f: CfdFacts) -> Judged:
    if not f.turbulence:
        return "not stated", "model not stated", "unknown", math.nan
    if f.ducted:
        return "doubtful", f.turbulence, "no rule measured for ducted rotors", math.nan
    says = "own runs: k-omega SST and realizable k-epsilon differ by 1.6 % in thrust, 4.5 % in torque"
    return "fine", f.turbulence, says, TURBULENCE


def _thrust(f: CfdFacts) -> Judged:
    if f.thrust_from == "forces":
        return "fine", "pressure and shear integrated over the blades", "none", 0.0
    table = {
        "momentum": ("doubtful", "momentum through a plane", "depends on the plane and on the pressure there"),
        "node": ("fault", "one node behind the propeller", "one point of a non-uniform wake, not an integral"),
    }
    return *table.get(f.thrust_from, ("not stated", "not stated", "unknown")), math.nan


def _balance(f: CfdFacts) -> Judged:
    parts = {"mass": f.mass_balance, "momentum": f.momentum_balance}
    known = {name: abs(value) for name, value in parts.items() if math.isfinite(value)}
    words = ", ".join(
        f"{name} {parts[name]:+.2%}" if name in known else f"balance of {name} not stated" for name in parts
    )
    open_ones = [name for name, size in known.items() if size > BALANCE_LIMIT]
    if open_ones:
        consequence = f"{' and '.join(open_ones)} created or lost in the domain: the loads belong to a different flow"
        return "fault", words, consequence, math.nan
    if len(known) < len(parts):
        return "not stated", words, "a leak is not excluded: a leak of 11 % went unnoticed here", math.nan
    u = max(known.values())
    return "fine", words, "the larger one taken in full as the standard uncertainty", u


def _frame(f: CfdFacts) -> Judged:
    if f.steady_mrf is None:
        return "not stated", "steady or transient not stated", "unknown", math.nan
    if not f.steady_mrf:
        return "fine", "the mesh turns", "none", 0.0
    words = f"rotating frame, inflow {f.skew_deg:.3g} deg off the shaft"
    if abs(f.skew_deg) <= SKEW_LIMIT:
        return "fine", words, "none: steady in that frame", 0.0
    return "fault", words, "blades are frozen at one azimuth: once-per-revolution loads are missing", math.nan


JUDGES: Mapping[str, Callable[[CfdFacts], Judged]] = {
    "domain against disk": _domain, "compressibility against tip Mach": _compressibility, "grid study": _grid,
    "iterative drift": _drift, "balance of mass and momentum": _balance, "wall treatment against y+": _wall,
    "turbulence model": _turbulence, "where the thrust was read": _thrust, "frozen rotor against inflow": _frame,
}  # fmt: skip


KEYS: Mapping[str, str] = {
    "domain against disk": "domain_over_D", "compressibility against tip Mach": "compressible",
    "grid study": "grids, gci_pct", "balance of mass and momentum": "balance_mass, balance_momentum",
    "wall treatment against y+": "wall, y_plus", "turbulence model": "turbulence",
    "frozen rotor against inflow": "steady",
}  # fmt: skip
"""Keys of [setup] in a run.toml that answer what a line calls not stated."""


def audit(facts: CfdFacts) -> tuple[AuditLine, ...]:
    """Judge the set-up of a CFD run.

    >>> lines = audit(CfdFacts(M_tip=0.63, domain_over_D=1.0, grids=0, thrust_from="node", pitch_over_D=0.625, CT=0.11))
    >>> [line.topic for line in lines if line.status == "fault"]
    ['domain against disk', 'grid study', 'where the thrust was read']
    """
    return tuple(AuditLine(topic, *judge(facts)) for topic, judge in JUDGES.items())


def combined(lines: Iterable[AuditLine]) -> tuple[float, float]:
    """Put the parts together as a root of squares. [1]

    >>> combined([AuditLine("a", "fine", "", "", 0.03), AuditLine("b", "fine", "", "", 0.04)])
    (0.05, 0.05)
    """
    parts = [line.u_relative for line in lines]
    known = math.hypot(*(p for p in parts if not math.isnan(p)))
    return (math.nan if any(map(math.isnan, parts)) else known), known


class Audit(Documented):
    """Lines about one recorded value, and what they come to."""

    reference: str
    lines: tuple[AuditLine, ...]
    # Standard uncertainty of the thrust from all lines, NaN where one is not known; from those that are [1]
    u_relative: float
    u_relative_known: float

    @classmethod
    def of(cls, reference: str, facts: CfdFacts) -> Audit:
        """Audit a recorded value."""
        lines = audit(facts)
        return cls(reference, lines, *combined(lines))


# Audit of the CFD values of a case: what the remarks of their references say of the set-up.

_PHRASES: tuple[tuple[str, Mapping[str, float | bool | str]], ...] = (
    (r"cylinder of the (propeller|rotor|fan)'s (own )?diameter", {"domain_over_D": 1.0}),
    (r"\bincompressible\b", {"compressible": False}),
    (r"(?<!in)\bcompressible\b", {"compressible": True}),
    (r"\bno grid study\b|\bno mesh study\b", {"grids": 0}),
    (r"\bscalable wall functions?\b", {"wall": "scalable"}),
    (r"(?<!scalable )(?<!automatic )\bwall functions?\b", {"wall": "function"}),
    (r"\bautomatic wall functions?\b", {"wall": "automatic"}),
    (r"\bat (one|a single) node\b", {"thrust_from": "node"}),
    (r"\bforces integrated\b|\bintegrated over the blades\b", {"thrust_from": "forces"}),
    (r"\brotating (cell )?(zone|frame)\b|\bMRF\b|\bfrozen rotor\b", {"steady": True}),
    (r"\bsliding mesh\b", {"steady": False}),
    (r"\brealizable k-epsilon\b", {"turbulence": "realizable k-epsilon"}),
    (r"\bk-omega SST\b", {"turbulence": "k-omega SST"}),
)
"""Words of a remark and what they state."""


def setup_in(remark: str) -> dict[str, float | bool | str]:
    """Conditions that set phrases of a remark in ``references.csv`` state; other words say nothing.

    >>> setup_in("MRF; k-omega SST with automatic wall functions")
    {'wall': 'automatic', 'steady': True, 'turbulence': 'k-omega SST'}
    """
    return {k: v for pattern, told in _PHRASES if re.search(pattern, remark, re.IGNORECASE) for k, v in told.items()}


_WALLS = {"kOmegaSST": "k-omega SST", "realizableKE": "realizable k-epsilon"}
_FAR = {"free": 5.0, "pipe": 1.0}  # Domain of our own campaigns over the disk, diameters [1] (reports/cfd)


def facts_of(get: Callable[[str], Any], own: bool, **flow: float) -> CfdFacts:
    """Facts of a run, of our campaigns (`own`) or anybody's, by what it states; `flow` M_tip, J, CT and the rotor's.

    `get` gives a condition or a number by its name, None where it is not stated.
    """
    names = ("solver", "domain_over_D", "turbulence", "compressible")
    solver, domain, turbulence, compressible = map(get, names)
    if compressible is None and isinstance(solver, str):
        compressible = {"compressible": True, "incompressible": False}.get(solver)
    return CfdFacts(
        domain_over_D=number_or(domain) if domain is not None else _FAR.get(str(get("domain")), math.nan),
        compressible=None if compressible is None else bool(compressible),
        grids=_whole(get("grids"), 0 if own else None), u_grid=number_or(get("u_grid")), cells=number_or(get("cells")),
        drift=number_or(get("drift_thrust")), wall=str(get("wall") or ("function" if own else "")),
        y_plus=number_or(get("y_plus"), number_or(get("yplus_avg"))),
        y_plus_max=number_or(get("y_plus_max")),
        turbulence=_WALLS.get(str(turbulence), str(turbulence or "")),
        thrust_from="forces" if own else str(get("thrust_from") or ""), steady_mrf=True if own else get("steady"),
        skew_deg=number_or(get("sideslip_deg"), 0.0), mass_balance=number_or(get("balance_mass")),
        momentum_balance=number_or(get("balance_momentum")), **flow,  # type: ignore[arg-type]
    )  # fmt: skip


def number_or(value: Any, other: float = math.nan) -> float:
    """A finite number, else the other."""
    return float(value) if isinstance(value, Real) and math.isfinite(value) else other


def _whole(value: Any, other: int | None) -> int | None:
    return int(value) if isinstance(value, (int, float)) and math.isfinite(value) else other
