"""What the source thesis states, and the computations that its numbers are held against.

Only facts and figures of T. Cahill, "System Identification of Thrust and Torque Characteristics for a Bipedal Robot
with Integrated Propulsion", MS thesis, Northeastern University, April 2025, and of public data they were checked with.
Nothing here prints; `reproduce.py` does.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any

import numpy as np

from bemt.base import unit_errors
from bemt.base.units import G0, INCH, KGF, LBF
from bemt.physics import coefficients as co
from bemt.physics import k1k2 as k

REPRODUCED = "reproduced"
ROUNDING = "reproduced within rounding"
NOT = "not reproduced, because"
INPUT = "input, not computed"
ABSENT = "not checked: data absent"
STATUSES = (REPRODUCED, ROUNDING, NOT, INPUT, ABSENT)

A_THESIS = 340.3
"""Speed of sound used with the stated tip Mach numbers [m/s]."""
RPM_PROPS = 20000.0
PROPS = (  # d [in], p [in], Fluent [kgf], K1/K2 as printed [kgf], error as printed [%], recomputed [kgf], CT, tip Mach
    (8, 5, "2.60", "2.455", "5.57", "2.456", "0.110", "0.63"),
    (10, 5, "5.80", "5.36", "7.58", "5.363", "0.100", "0.78"),
    (12, 6, "10.70", "11.11", "3.83", "11.121", "0.089", "0.94"),
    (14, 8, "21.20", "22.017", "3.85", "22.025", "0.096", "1.09"),
)
DS30 = {"diameter_m": 0.069, "duct_m": 0.070, "hub_m": 0.0254, "rpm": 55000.0, "exhaust_m_s": 87.3, "thrust_N": 27.0,
        "claim_kgf": 2.64, "bench_kgf": 2.4}  # fmt: skip
"""DS-30-AXI-HDS as stated; lengths [m], speeds [rev/min], [m/s], thrust [N] and [kgf]."""
_PITCH_D = tuple(1.0 / x for x in reversed(k.D_OVER_P_USABLE))


@dataclass(frozen=True)
class ThesisItem:
    """One stated number beside ours."""

    section: str  # Part of the thesis
    quantity: str  # What it is
    stated: str  # As printed, so that its rounding is known
    ours: float | str | None  # Computed; None for an input
    unit: str  # Unit of both
    status: str  # One of `STATUSES`
    note: str = ""  # Reason or remark


def matches(stated: str, value: float) -> str | None:
    """Compare a computed number with a printed one, at the digits that were printed.

    >>> matches("0.0308", 0.030779), matches("0.0307", 0.030779), matches("0.0306", 0.030779)
    ('reproduced', 'reproduced within rounding', None)
    """
    number = Decimal(stated)
    exponent = number.as_tuple().exponent
    assert isinstance(exponent, int)
    step, error = 10.0**exponent, abs(value - float(number))
    if error <= 0.5 * step * (1.0 + 1e-9):
        return REPRODUCED
    return ROUNDING if error < step else None


def printed_equation(rho: Any, area: Any, v_pitch: Any, V: Any, d_over_p: Any) -> Any:
    """K1/K2 equation as printed in the thesis, kept ONLY to show that it cannot be right.  Never use it.

    The term with V stands outside the bracket that density and area multiply, (rho A v_p^2 - v_p V)(K1 D/p)^K2.  A
    change of units therefore changes the ratio to `k.corrected_equation`; see `unit_defect`.  Static values agree.

    >>> static = (1.225, 0.05, 40.0, 0.0, 1.6)
    >>> printed_equation(*static) == k.corrected_equation(*static)
    True
    """
    return (rho * area * v_pitch**2 - v_pitch * V) * (k.K1 * d_over_p) ** k.K2


def unit_defect(formula: Callable[..., float], mass: float = 1.0, length: float = 1.0, time: float = 1.0) -> float:
    """Relative error that a mere change of units makes in a thrust formula; zero for a right one. [-]

    Any physical equation is homogeneous in mass, length and time (Bridgman, "Dimensional Analysis", 1922), so that the
    result is zero for every choice of units.  Evaluated for an 8x5 at 6000 rev/min and half its pitch speed.

    >>> abs(unit_defect(k.corrected_equation, length=0.0254)) < 1e-12
    True
    >>> abs(unit_defect(printed_equation, length=0.0254)) > 0.5
    True
    """
    rho, area, v, V, ratio = 1.225, math.pi * 0.2032**2 / 4.0, 12.7, 6.35, 1.6
    si = formula(rho, area, v, V, ratio)
    speed = length / time
    other = formula(rho / (mass / length**3), area / length**2, v / speed, V / speed, ratio)
    return float(other * mass * length / time**2 / si - 1.0)


def k1k2_variants() -> list[tuple[str, tuple[float, ...]]]:
    """Search for the rounding of inputs that gives all four printed K1/K2 values.

    Varied: standard gravity (9.80665, 9.81, 9.8), K1 (exact, 0.3034, 0.303), inch (0.0254, 0.025), each at most once.
    """
    choices = {
        "g": (G0, 9.81, 9.8),
        "K1": (k.K1, 0.3034, 0.303),
        "inch": (INCH, 0.025),
    }
    found = []
    for combo in itertools.product(*choices.values()):
        changed = [f"{name} = {v:g}" for (name, c), v in zip(choices.items(), combo, strict=True) if v != c[0]]
        g, k1, inch = combo
        values = tuple(float(k.thrust(d * inch, p * inch, RPM_PROPS)) * (k1 / k.K1) ** k.K2 / g for d, p, *_ in PROPS)
        if all(matches(row[3], v) for row, v in zip(PROPS, values, strict=True)):
            found.append((len(changed), ", ".join(changed) or "as stated", values))
    return [(name, values) for _, name, values in sorted(found)]


def mach_blindness() -> dict[str, Any]:
    """Find the supersonic tips, and whether the formula notices. [-]"""
    M = {f"{d}x{p}": float(co.M_tip(RPM_PROPS / 60, d * INCH, A_THESIS)) for d, p, *_ in PROPS}
    spread = 0.0
    for d, p, *_ in PROPS:
        rpm = np.linspace(0.05, 1.5, 30) * A_THESIS / (math.pi * d * INCH) * 60
        CT = co.CT(k.thrust(d * INCH, p * INCH, rpm), k.RHO_FIXED, rpm / 60, d * INCH)
        spread = max(spread, float(np.ptp(CT) / np.mean(CT)))
    return {"M_tip": M, "supersonic": [name for name, m in M.items() if m > 1.0], "CT_spread": spread}


@dataclass(frozen=True)
class PrintedValue:
    """One way to reach the stated K1/K2 thrust of the fan."""

    # Formula variant, area that makes thrust, unit in which the number is read
    formula: str
    area: str
    unit: str
    # Diameter [m], the pitch that gives the number [m], their ratio [-]
    diameter_m: float
    pitch_m: float
    pitch_over_D: float
    unit_factor: float  # Newtons per unit read over newtons per kilogram-force: 1 agrees with the claim [-]
    sensible: bool  # Pitch inside the stated range of the model, D/p 0.5-2.5
    above_exhaust: bool  # Pitch above the one that the stated exhaust speed demands


def ds30_readings() -> list[PrintedValue]:
    """Search for what gives 2.64: over formula, area, diameter and unit, solved for the pitch that is not given.

    K1/K2 at rest is F = rho A n^2 K1^1.5 D^1.5 p^0.5, so p = D (F/F(p = D))^2; without the factor (K1 D/p)^K2 it is
    F = rho A n^2 p^2, so p = D (F/F(p = D))^0.5.
    """
    n = DS30["rpm"] / 60
    least = DS30["exhaust_m_s"] / n
    units = {"kgf": KGF, "N": 1.0, "lbf": LBF, "ozf": LBF / 16}
    out = []
    for (unit, factor), area, D in itertools.product(
        units.items(), ("annulus", "whole disk"), (DS30["diameter_m"], DS30["duct_m"])
    ):
        hub = DS30["hub_m"] if area == "annulus" else 0.0
        F = DS30["claim_kgf"] * factor
        at_D = float(k.thrust(D, D, DS30["rpm"], hub_diameter_m=hub))
        bare = at_D / k.K1**k.K2
        for formula, p in (("K1/K2", D * (F / at_D) ** 2), ("rho A v_p^2, no K1/K2 factor", D * (F / bare) ** 0.5)):
            ok = _PITCH_D[0] <= p / D <= _PITCH_D[1]
            out.append(PrintedValue(formula, area, unit, D, p, p / D, factor / KGF, ok, p > least))
    return sorted(out, key=lambda r: (not r.sensible, r.formula != "K1/K2", abs(math.log(r.pitch_over_D))))


def nearest_slip(ratio: float) -> tuple[str, float, float]:
    """Name the slip of units nearest to a ratio.

    >>> name, factor, miss = nearest_slip(9.78)
    >>> name, round(factor, 5), round(miss, 4)
    ('kgf <-> N', 9.80665, -0.0027)
    """
    r = max(ratio, 1.0 / ratio)
    name, f = min(unit_errors.symmetric().items(), key=lambda nv: abs(math.log(r / nv[1])))
    return name, f, r / f - 1.0


def ds30_finding() -> dict[str, Any]:
    """Conclude on the stated 2.64 kgf from the search."""
    readings = ds30_readings()
    own = [r for r in readings if r.formula == "K1/K2"]
    best = next(r for r in own if r.sensible)
    claimed = next(r for r in own if r.unit == "kgf" and r.area == "annulus" and r.diameter_m == DS30["diameter_m"])
    D = DS30["diameter_m"]
    at_D = float(k.thrust(D, D, DS30["rpm"], hub_diameter_m=DS30["hub_m"]))
    slip, factor, miss = nearest_slip(DS30["claim_kgf"] * KGF / at_D)
    return {
        "units": sorted({r.unit for r in own if r.sensible}),
        "best": best,
        "claimed": claimed,
        "K1K2_at_pitch_equal_diameter_N": at_D,
        "ratio": DS30["claim_kgf"] * KGF / at_D,
        "slip": slip,
        "slip_factor": factor,
        "slip_miss": miss,
        "other_formulas": [r for r in readings if r.formula != "K1/K2" and r.unit == "kgf" and r.sensible],
    }


def clarke_factor() -> tuple[float, float]:
    """Power-invariant Clarke transform of a balanced three-phase machine, by numbers.

    >>> [round(x, 6) for x in clarke_factor()]
    [1.224745, 1.224745]
    """
    theta = np.linspace(0.0, 2.0 * np.pi, 25)[:, None] - 2.0 * np.pi / 3.0 * np.arange(3)
    i = np.cos(theta)  # amplitude 1 A, in phase with the back-EMF of amplitude K_b omega
    T = math.sqrt(2.0 / 3.0) * np.array([[1.0, -0.5, -0.5], [0.0, math.sqrt(3) / 2, -math.sqrt(3) / 2]])
    Iq = float(np.mean(np.linalg.norm(i @ T.T, axis=1)))
    torque = float(np.mean(np.sum(np.cos(theta) * i, axis=1)))  # over K_b
    return Iq, torque / Iq


@dataclass
class ThesisFacts:
    """Collects items; `check` decides the status from the digits."""

    items: list[ThesisItem] = field(default_factory=list)
    section: str = ""

    def given(self, quantity: str, stated: str, unit: str = "", note: str = "") -> None:
        """Add a number that nothing can be computed from."""
        self.items.append(ThesisItem(self.section, quantity, stated, None, unit, INPUT, note))

    def check(
        self,
        quantity: str,
        stated: str,
        ours: float,
        unit: str = "",
        note: str = "",
        variants: Iterable[tuple[str, float]] = (),
        because: str = "",
    ) -> None:
        """Add a computed number; the status follows from the printed digits, then from variants of rounded inputs."""
        status = matches(stated, ours)
        if status != REPRODUCED:
            for name, value in variants:
                if matches(stated, value):
                    status, note = ROUNDING, f"{name}: {value:.6g}" + (f"; {note}" if note else "")
                    break
        if status is None:
            status, note = NOT, because or "no variant of the inputs gives it"
        self.items.append(ThesisItem(self.section, quantity, stated, ours, unit, status, note))

    def word(self, quantity: str, stated: str, ours: str, because: str = "", note: str = "") -> None:
        """Add a statement in words; equal or not."""
        same = stated == ours
        self.items.append(
            ThesisItem(self.section, quantity, stated, ours, "", REPRODUCED if same else NOT, note if same else because)
        )
