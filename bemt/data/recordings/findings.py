"""What the sanity checks share: a finding, the facts that they look at, and their registry."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.tables import some
from bemt.data.recordings.channels import asks, named, names_of
from bemt.physics.air import LIQUID
from bemt.physics.dataset import Dataset

SEVERITIES = ("error", "warning", "note")
ENOUGH = 200_000
"""Rows from which a median is taken over every so many of them."""
MANY, GAP = 50, 50
"""Rows from which a recording is a log with fast and slow channels; rows over which a slow one is interpolated."""
LIKELY_RHO = 1.2
"""Density for windows so wide that its true value does not matter. [kg/m3]"""
# Share of flagged rows from which they are no spikes but a slip of the whole channel.
_SPIKES = 0.5


@dataclass(frozen=True)
class Finding:
    """One thing that looks wrong; nothing was corrected."""

    id: str  # Name of the fault, such as ``thrust_unit``
    channel: str  # Channel as the file names it in SI
    evidence: str  # Numbers that show it
    correction: str  # What would make it right
    rows: tuple[int, ...] = ()  # Rows, from 0; empty: the whole channel
    severity: str = "error"  # ``error`` (cannot be so), ``warning`` (hardly so) or ``note`` (known habit of stands)

    def __str__(self) -> str:
        return f"{self.severity}: {self.id} ({self.channel}): {self.evidence}. Correction: {self.correction}"


class _Channel:
    """A channel by its usual name, as an attribute; None without a finite value."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, facts: Facts, owner: type[Facts]) -> Array | None:
        return facts.get(self._name)


@dataclass(frozen=True, eq=False)
class Facts:
    """What the checks look at; every array has one entry per row."""

    values: Mapping[str, Array]  # (N,) channels by name of a Dataset
    raw: Mapping[str, Array]  # (N,) all channels as the file names them, with or without a unit
    unit: Mapping[str, str]  # Unit of each of them
    names: Mapping[str, str]  # Name in the file of each channel of `values`
    lines: Sequence[int]  # Line in the file
    # As far as known [m]
    diameter_m: float | None = None
    pitch_m: float | None = None
    density_kg_m3: float | None = None  # Of the case
    ducted: bool = False  # Rotor in a duct
    bare: bool = False  # Recorded without a propeller: nothing is expected of its loads
    settled: bool = False  # Rows are means of computed flows: one is enough
    asked: Mapping[str, tuple[str, str, str]] = field(default_factory=dict)  # As `channels.asks` gives it

    time_s, rpm, optical_rpm, electrical_rpm = _Channel(), _Channel(), _Channel(), _Channel()
    thrust_N, power_W, CT, CP, J, airspeed_m_s = (_Channel() for _ in range(6))

    def __len__(self) -> int:
        """Give the number of rows."""
        return len(self.lines)

    def get(self, name: str) -> Array | None:
        """Channel with a finite value, else None."""
        v = self.values.get(name)
        return v if v is not None and bool(np.any(np.isfinite(v))) else None

    def known(self, *names: str) -> Iterator[tuple[str, Array]]:
        """Channels of these with a finite value."""
        return ((name, v) for name in names if (v := self.get(name)) is not None)

    def named(self, name: str) -> str:
        """Name in the file."""
        return self.names.get(name, name)

    @property
    def rho(self) -> Array:
        """Density; where none is recorded that of the case, else a usual one. [kg/m3]"""
        v = self.values.get("density_kg_m3", np.full(len(self), np.nan))
        known = (v > 0.2) & (v < 2.0) | (v >= LIQUID[0]) & (v <= LIQUID[1])
        return np.where(known, v, LIKELY_RHO if self.density_kg_m3 is None else self.density_kg_m3)

    @property
    def power_by_product(self) -> bool:
        """Whether the electrical power was made of voltage and current."""
        return self.named("electrical_power_W") == "voltage_V x current_A"

    def sampled(self) -> Facts:
        """Every nth row of a long log: medians need no more."""
        step = -(-len(self) // ENOUGH)
        if step == 1:
            return self
        values, raw = ({k: v[::step] for k, v in part.items()} for part in (self.filled, self.raw))
        return replace(self, values=values, raw=raw, lines=self.lines[::step])

    @cached_property
    def filled(self) -> Mapping[str, Array]:
        """Channels, the gaps of slow ones closed in a log."""
        return {k: _filled(v) for k, v in self.values.items()}

    @cached_property
    def still(self) -> NDArray[np.bool_]:
        """Rows without airspeed, as far as the recording tells."""
        out = np.ones(len(self), dtype=bool)
        for name, most in (("airspeed_m_s", 0.5), ("J", 0.05)):
            v = self.values.get(name)
            if v is not None:
                out &= ~(np.abs(np.nan_to_num(v)) > most)
        return out

    @cached_property
    def loaded(self) -> NDArray[np.bool_]:
        """Rows in the upper part of the load, where zeros and resolution count for little."""
        n = len(self)
        out = np.ones(n, dtype=bool)
        for name in ("thrust_N", "torque_Nm", "power_W", "electrical_power_W"):
            v = self.filled.get(name)
            if v is not None and np.any(np.isfinite(v)) and float(np.nanpercentile(np.abs(v), 95)) > 0.0:
                size = np.abs(np.nan_to_num(v))
                out &= size >= 0.2 * float(np.percentile(size[size > 0.0], 95))
                break
        speed = self.rpm
        if speed is not None and np.any(np.nan_to_num(speed) != 0.0):
            out &= np.nan_to_num(speed) != 0.0
        return out


def _filled(v: Array) -> Array:
    """Channel with its gaps closed, where a slow sensor has a value in some rows of a fast log only."""
    rows = np.flatnonzero(np.isfinite(v))
    if len(v) < MANY or len(rows) < 10 or len(rows) > 0.8 * len(v):
        return v
    at = np.arange(len(v))
    after = np.clip(np.searchsorted(rows, at), 0, len(rows) - 1)
    before = np.clip(after - 1, 0, len(rows) - 1)
    near = (rows[after] - rows[before] <= GAP) & (at >= rows[0]) & (at <= rows[-1])
    return np.where(near, np.interp(at, rows, v[rows]), v)


Check = Callable[[Facts], Iterator[Finding]]
CHECKS: dict[str, Check] = {}
"""Checks by name, in the order in which they run."""


def check_for(name: str) -> Callable[[Check], Check]:
    """Register a check."""

    def register(check: Check) -> Check:
        if name in CHECKS:
            raise TypeError(f"two checks are called {name}")
        CHECKS[name] = check
        return check

    return register


def _without_spikes(rec: Dataset) -> Dataset:
    """Channels without their flagged spikes: what one row misread is no contradiction of the recording."""
    values = dict(rec.values)
    for channel, own in names_of(rec).items():
        odd = np.array([f"spike of {own}" in flags for flags in rec.flags or ()], dtype=bool)
        if odd.any() and odd.mean() < _SPIKES:
            values[channel] = np.where(odd, np.nan, values[channel])
    return replace(rec, values=values)


def facts_of(
    source: Dataset, diameter_m: float | None, pitch_m: float | None, ducted: bool, density_kg_m3: float | None = None
) -> Facts:
    """Gather the facts of a recording or a series."""
    rec = _without_spikes(named(source))
    raw = {k: np.where(far, np.nan, v) if (far := np.abs(v) > 1e12).any() else v for k, v in source.values.items()}
    said, about = source.constants, source.provenance
    return Facts(
        rec.values, raw, {k: source.unit(k) for k in raw}, names_of(rec), rec.lines,
        diameter_m if diameter_m is not None else said.get("diameter_m"),
        pitch_m if pitch_m is not None else said.get("pitch_m"), density_kg_m3,
        ducted or about.get("rotor_ducted") == "yes" or about.get("duct") == "yes", about.get("propeller") == "none",
        source.kind == "cfd", asks(source),
    )  # fmt: skip


def where_of(facts: Facts, rows: Array | NDArray[np.intp]) -> str:
    """Lines of the first of some rows."""
    return f"line{'s' if len(rows) > 1 else ''} {some((facts.lines[int(r)] for r in rows), 6)}"


# Rows from which a recording is a log, and share of those under load that are misread in one.
_LOG, _FEW_ROWS = 100, 0.2


MOTOR_EFFICIENCY = (0.2, 0.95)
"""Range of a motor's efficiency under load: declared [1]."""
LEAST_EFFICIENCY = 0.125
"""Below it power is lost that no motor takes: 86 recordings of shared stands hold 0.15 and more in the median [1]."""


def enough(odd: NDArray[np.bool_], among: NDArray[np.bool_]) -> bool:
    """Whether rows are more than the transients and spikes of a log: one in a table, 1 % of many."""
    return bool(np.any(odd)) and float(odd.sum()) > 0.01 * (float(among.sum()) if len(odd) >= MANY else 0.0)


def contradicts(odd: NDArray[np.bool_], among: NDArray[np.bool_]) -> str:
    """Severity of what cannot be so: a few rows of a log are misread, a table or much of a log contradicts itself."""
    few = len(odd) >= _LOG and float(odd.sum()) < _FEW_ROWS * float(among.sum())
    return "warning" if few else "error"


def rows_of(mask: NDArray[np.bool_]) -> tuple[int, ...]:
    """Rows of a mask."""
    return tuple(int(i) for i in np.flatnonzero(mask))


# Wind that a recording does not state: below some speed of rotation the propeller is a windmill.
# Thrust this small, share of the largest, has no sign; fewest readings of either sign; share of these on the wrong side
# of the zero, as misread speeds are; thrust coefficients next to the zero, share of the largest, that are no jump.
_SMALL, _FEWEST, _ASTRAY, _JUMP = 0.05, 3, 0.2, 0.75


def zero_thrust_speed(rpm: Array, thrust: Array) -> float | None:
    """Speed at which thrust changes its sign as in wind; None if it has one sign or does not follow the speed.

    At one airspeed CT falls with 1/n, through zero; the speed that divides the signs best is taken; NaN is left out.

    >>> n = np.linspace(2000.0, 6000.0, 9)
    >>> zero_thrust_speed(n, n**2 - 3700.0 * n)
    3750.0
    >>> zero_thrust_speed(n, np.where(n < 3700.0, -(n**2), n**2)) is None
    True
    """
    good = np.isfinite(rpm) & np.isfinite(thrust) & (rpm > 0.0)
    top = float(np.percentile(np.abs(thrust[good]), 95)) if good.any() else 0.0
    good &= np.abs(thrust) > _SMALL * top
    order = np.argsort(rpm[good], kind="stable")
    n, T = rpm[good][order], thrust[good][order]
    if top <= 0.0 or min(np.sum(T < 0.0), np.sum(T > 0.0)) < _FEWEST:
        return None
    astray = np.cumsum(T > 0.0)[:-1] + np.cumsum((T < 0.0)[::-1])[::-1][1:]
    k = int(np.argmin(astray)) + 1
    size, few = np.abs(T) / n**2, max(1, n.size // 20)
    near = float(np.median(size[max(k - few, 0) : k + few]))
    if astray[k - 1] > _ASTRAY * n.size or near > _JUMP * float(np.percentile(size, 90)):
        return None
    return float(0.5 * (n[k - 1] + n[k]))
