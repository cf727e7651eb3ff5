"""What a sweep gives: rows, comparisons and conditions of a case, typed, and the document of each.

A float is NaN, null in JSON, where nothing is known; what is None does not belong to the row, and its document is
without it. Units stand in the names, as everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field, fields
from typing import Any, Literal

from bemt.base.document import Documented
from bemt.base.tables import number_text
from bemt.data.recordings.audit import Audit

# A model's value against a recorded one after ASME V&V 20, also where nobody states how good the recording is.

State = Literal["no result", "model unknown", "agrees", "differs", "inside", "open"]
"""`inside` the model's own band whatever the recording's uncertainty is, `open` until that is stated."""


class Comparison(Documented):
    """One channel at one point: E = S - D beside its standard uncertainties, in `unit`; NaN where unknown.

    >>> Comparison(S=12.0, D=7.0, u_input=3.0).needed, Comparison(S=12.0, D=7.0, u_input=3.0).state
    (4.0, 'open')
    """

    model: str = "bemt"
    reference: str = ""
    source: str = ""
    quantity: str = "thrust_N"
    unit: str = "N"
    # Simulated and recorded value; their difference, also in per cent of the recording, follows where it is not given
    S: float = math.nan
    D: float = math.nan
    E: float = field(default=math.nan, kw_only=True)
    E_pct: float = field(default=math.nan, kw_only=True)
    # Of the model's numerics, inputs and form; of the recording
    u_num: float = 0.0
    u_input: float = 0.0
    u_model: float = 0.0
    u_D: float = math.nan
    u_val: float = field(default=math.nan, kw_only=True)  # Of both sides, follows likewise
    doubts: tuple[str, ...] = ()  # Flags for which agreement means little here
    rpm: float = math.nan
    airspeed_m_s: float = math.nan
    density_kg_m3: float = math.nan

    def __post_init__(self) -> None:
        """Fill in what follows; a stored line keeps what was computed before its parts were rounded."""
        E = self.S - self.D
        follows = {"E": E, "E_pct": 100.0 * E / self.D if self.D else math.nan,
                   "u_val": math.sqrt(self.u_num**2 + self.u_input**2 + self.u_model**2 + self.u_D**2)}  # fmt: skip
        for name, value in follows.items():
            if math.isnan(getattr(self, name)):
                object.__setattr__(self, name, value)

    @property
    def point(self) -> tuple[float, float, float]:
        """Operating point: speed [rev/min], airspeed [m/s], density [kg/m3]."""
        return self.rpm, self.airspeed_m_s, self.density_kg_m3

    @property
    def known(self) -> float:
        """Standard uncertainty of the model's side; NaN where a part of it is unknown."""
        return math.sqrt(self.u_num**2 + self.u_input**2 + self.u_model**2)

    @property
    def needed(self) -> float:
        """Least standard uncertainty of the recording with which the two agree: |E| <= u_val; 0 inside the band."""
        return math.nan if math.isnan(self.known) else math.sqrt(max(self.E**2 - self.known**2, 0.0))

    @property
    def needed_pct(self) -> str:
        """The same as a share of the recording, with two figures; "" where that is zero."""
        return f"{100.0 * self.needed / abs(self.D):.2g} %" if self.D else ""

    @property
    def state(self) -> State:
        """How model and recording stand, whatever is flagged."""
        if not math.isfinite(self.E):
            return "no result"
        if not math.isfinite(self.known):
            return "model unknown"
        if math.isfinite(self.u_D):
            return "agrees" if abs(self.E) <= self.u_val else "differs"
        return "inside" if abs(self.E) <= self.known else "open"

    @property
    def but_flagged(self) -> str:
        """Why agreement means little at this point, to be added to it; empty where nothing is flagged."""
        return f", but flagged: {', '.join(self.doubts)}" if self.doubts else ""

    @property
    def verdict(self) -> str:
        """How the comparison stands, or what the recording's uncertainty would have to be."""
        share = f" ({self.needed_pct})" if self.needed_pct else ""
        words: dict[State, str] = {
            "no result": "no result", "model unknown": "uncertainty of the model unknown",
            "agrees": "not distinguishable from noise", "differs": "differs",
            "inside": "u_D unknown; within the uncertainty of the model",
            "open": f"u_D unknown; agrees only if it is {number_text(self.needed, 2)} {self.unit}{share} or more",
        }  # fmt: skip
        return words[self.state] + self.but_flagged

    def document(self) -> dict[str, Any]:
        """Line of a result, what follows from it included."""
        return super().document() | {"verdict": self.verdict}


ROW_SOURCES = ("bemt", "k1k2", "cfd", "bench", "vendor")


class Row(Documented):
    """One model or one recorded value at one operating point."""

    source: str
    label: str
    thrust_N: float
    thrust_kgf: float = math.nan
    torque_Nm: float = math.nan
    power_W: float = math.nan
    CT: float = math.nan
    CP: float = math.nan
    rpm: float = math.nan
    airspeed_m_s: float = math.nan
    density_kg_m3: float = math.nan
    M_tip: float = math.nan
    Re: float = math.nan
    u: float = math.nan  # Standard uncertainty of the thrust, whole and by origin [N]
    flags: tuple[str, ...] = ()
    u_num: float | None = None
    u_input: float | None = None
    u_model: float | None = None
    thrust_N_range: tuple[float, float] | None = None  # While one assumption is varied at a time
    exhaust_speed_m_s: float | None = None
    duct_share: float | None = None
    converged: bool | None = None
    H_force_N: float | None = None
    upper_thrust_N: float | None = None
    lower_thrust_N: float | None = None
    J: float | None = None
    angle_deg: float | None = None
    origin: str | None = None
    remark: str | None = None
    # Of a recorded value: how far the models are off, and u_val of both [N]
    bemt_error_pct: float | None = None
    bemt_u_val: float | None = None
    k1k2_error_pct: float | None = None
    k1k2_u_val: float | None = None

    @property
    def point(self) -> tuple[float, float, float]:
        """Operating point as :attr:`Comparison.point`."""
        return self.rpm, self.airspeed_m_s, self.density_kg_m3


def beside(one: Row | Comparison, other: Row | Comparison) -> bool:
    """Whether two values are of one speed, airspeed and density; what states none is of the point shown."""
    return not any(abs(a - b) > max(1e-6 * b, 1e-9) for a, b in zip(one.point, other.point, strict=True))


class CaseConditions(Documented):
    """Operating point, air, rotor and model of a case."""

    rpm: float
    airspeed_m_s: float
    angle_deg: float
    density_kg_m3: float
    temperature_C: float
    a_sound_m_s: float
    air: str
    diameter_m: float
    hub_diameter_m: float
    blades: int
    pitch_075R_m: float
    solidity: float
    stations: int
    effects: tuple[str, ...]
    n_crit: float
    drag_level: float
    convention: str = "CT = T/(rho n^2 D^4), CP = P/(rho n^3 D^5)"


class AssumptionRow(Documented):
    """One value that the source does not state, with its effect at the case's own operating point."""

    key: str
    nominal: Any
    values: tuple[Any, ...]
    discrete: bool
    range: str
    why: str
    thrust_N: tuple[float, ...]
    torque_Nm: tuple[float, ...]
    u_thrust_N: float
    u_torque_Nm: float


class Stated(Documented):
    """A recorded value as its file has it."""

    quantity: str
    kind: str
    printed: str
    value: float
    u: float
    channel: str
    source: str
    remark: str


class Band(Documented):
    """Value with its standard uncertainty."""

    value: float
    u: float


class FullThrottle(Documented):
    """Full throttle of a case with a motor, as the tool that knows motors gives it."""

    kv: float
    cells: float
    soc: float
    text: str
    rpm: Band
    thrust_N: Band
    battery_A: Band
    power_W: Band
    g_per_W: Band


class Fan(Documented):
    """What a duct adds, at the case's own operating point."""

    rotor_thrust_N: float
    duct_thrust_N: float
    stator_thrust_N: float
    duct_share: float
    exhaust_speed_m_s: float
    u_exhaust_speed_m_s: float
    mass_flow_kg_s: float
    annulus_area_m2: float
    exit_area_m2: float
    exit_momentum_N: float
    annulus_solidity: float
    geometric_pitch_speed_m_s: float

    @property
    def exit_pressure_N(self) -> float:
        """Thrust that is no momentum through the exit: pressure in its plane and on the outer wall [N]."""
        return self.rotor_thrust_N + self.duct_thrust_N + self.stator_thrust_N - self.exit_momentum_N


class PairResult(Documented):
    """What a second rotor adds, at the case's own operating point; the upper rotor is the first."""

    z_over_D: float
    turns: str
    rotor: str
    lower_rpm: float
    upper_thrust_N: float
    upper_torque_Nm: float
    lower_thrust_N: float
    lower_torque_Nm: float
    reaction_torque_Nm: float
    upper_thrust_ratio: float
    lower_thrust_ratio: float
    thrust_ratio: float
    u_upper_thrust_N: float
    u_upper_torque_Nm: float
    u_lower_thrust_N: float
    u_lower_torque_Nm: float
    u_reaction_torque_Nm: float
    u_upper_thrust_ratio: float
    u_lower_thrust_ratio: float
    u_thrust_ratio: float


class Axis(Documented):
    """Values of one axis of a grid, in the unit of its name."""

    num: int
    min: float
    max: float


class Statistics(Documented):
    """What is told of the points of a grid: how many, and the ends of their finite values."""

    points: int
    unconverged: int
    thrust_N: tuple[float, float]
    torque_Nm: tuple[float, float]
    M_tip: tuple[float, float]


class GridResult(Statistics):
    """A grid that was solved, and where it was written."""

    axes: Mapping[str, Axis]
    columns: tuple[str, ...]
    file: str | None
    sha256: str | None


class Result(Documented):
    """One case: models beside what was recorded; without rows it was not solved, and its faults say why."""

    name: str
    title: str = ""
    kind: str = ""
    origin: str = ""
    version: str = "unknown"
    rows: tuple[Row, ...] = ()
    variants: tuple[Row, ...] = ()
    other_rows: tuple[Row, ...] = ()
    comparisons: tuple[Comparison, ...] = ()
    audit: tuple[Audit, ...] = ()
    grid_studies: tuple[Mapping[str, Any], ...] = ()  # Documents of `LoadStudy`
    conditions: CaseConditions | None = None
    assumptions: tuple[AssumptionRow, ...] = ()
    references: tuple[Stated, ...] = ()
    drive: FullThrottle | None = None
    fan: Fan | None = None
    pair: PairResult | None = None
    no_check: tuple[str, ...] | None = None  # Readings to which the rotor was fitted; None where there are none
    notes: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    grid: GridResult | None = None
    exit_code: int = 0

    def document(self) -> dict[str, Any]:
        """Entry of ``sweep.json``; short for a case that was not solved."""
        told = super().document()
        names = [f.name for f in fields(self)]
        if not self.rows:
            names = ["name", "title", "rows", "variants", "other_rows", "comparisons", "faults", "exit_code"]
        return {name: told.get(name) for name in names}

    @property
    def all_rows(self) -> tuple[Row, ...]:
        """Rows, those of variants and those of other sources."""
        return self.rows + self.variants + self.other_rows

    @property
    def at(self) -> CaseConditions:
        """Conditions of a solved case."""
        assert self.conditions is not None
        return self.conditions

    @property
    def densities(self) -> set[float]:
        """Densities of its points [kg/m3]."""
        return {row.density_kg_m3 for row in self.of("bemt")}

    def of(self, *sources: str) -> list[Row]:
        """Rows of some sources."""
        return [row for row in self.rows if row.source in sources]

    def first(self, source: str) -> Row | None:
        """First row of a source, None where there is none."""
        return next(iter(self.of(source)), None)

    def audit_of(self, reference: str) -> Audit | None:
        """Audit of one recorded value."""
        own = [a for a in self.audit if f"{reference} ".startswith(f"{a.reference} ")]  # of it, or of all of its file
        return max(own, key=lambda a: len(a.reference), default=None)


class Sweep(Documented):
    """All cases, in the order in which they were given."""

    schema: str
    version: str
    cases: tuple[Result, ...]
    exit_code: int
