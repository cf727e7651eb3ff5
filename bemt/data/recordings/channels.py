"""What a recording measured, under the usual names, for reduction and sanity checks.

Readers keep the names of the file; here ``T_N`` becomes ``thrust_N``, the pulse width ``pwm_s``, one of several speeds
``rpm``, and a column of uncertainties goes with its channel. Every choice is a note, every value that is left out an
entry of `dropped`.
"""

from __future__ import annotations

import difflib
import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from bemt.base import units
from bemt.base.arrays import Array
from bemt.base.tables import few, number_of
from bemt.data.readers.headings import USUAL, counts_electrical, may_be_shaft_speed, meanings, unit_alone
from bemt.data.readers.recording import FULL_THROTTLE
from bemt.physics.dataset import Dataset

HUGE = 1e9
"""Magnitude in SI above which no reading of a stand is physical."""
LATEST_S = 1e11
"""A clock may count from 1970."""
LOADS = ("thrust_N", "duct_thrust_N", "torque_Nm", "power_W", "electrical_power_W", "current_A", "CT", "CP", "CQ")
"""Channels of which a point needs one."""
MEASURED = (
    "time_s", "run", "pwm_s", "throttle", "rpm", "electrical_rpm", "optical_rpm", "airspeed_m_s", "J", "thrust_N",
    "duct_thrust_N", "torque_Nm", "power_W", "electrical_power_W", "voltage_V", "current_A", "temperature_K",
    "pressure_Pa", "humidity", "density_kg_m3", "tip_gap_m", "wall_distance_m", "sideslip_rad",
    "sideslip_deg", "second_rotor_rad_s", "CT", "CP", "CQ", "eta",
)  # fmt: skip
"""Channels that a reduced recording may have."""
_SPEEDS = ("optical_rpm", "electrical_rpm")
_DRIVE_SPEEDS = {
    "motor_rpm": "right only if the motor turns the propeller without a gear",
    "ESC_rpm": "right only if the ESC was given the pole count and there is no gear",
}
"""Speeds that are the rotor's where there is no other, and on what condition."""
AS_SHAFT = "power_W: taken as shaft power"
"""Start of the note on a power of which the heading does not say whose it is."""
AS_ELECTRICAL = (
    "power_W: taken as electrical, no torque is beside it; if a wattmeter read it, name the column electrical_power_W; "
    "else shaft_power_W"
)
"""Note on one beside a thrust alone."""
_NO_MOTOR = 0.95
"""Shaft power over electrical power that no motor with its controller reaches: declared. [1]"""


@dataclass(frozen=True, slots=True)
class DroppedCells:
    """Rows, or one value of each, that were left out: first and last line, `channel` ("" for the rows) and `reason`."""

    line: int
    last: int
    channel: str
    reason: str

    @property
    def lines(self) -> range:
        """Their lines in the file."""
        return range(self.line, self.last + 1)


def lost(d: Dataset, rows: ArrayLike, channel: str, reason: str) -> list[DroppedCells]:
    """Rows that are left out, one entry for lines that follow each other."""
    at = np.asarray(rows, dtype=np.intp)
    if not at.size:
        return []
    lines = np.asarray(d.lines, dtype=np.intp)[at] if not isinstance(d.lines, range) else d.lines.start + at
    cuts = np.flatnonzero(np.diff(lines) != 1) + 1
    first, last = lines[np.concatenate([[0], cuts])], lines[np.concatenate([cuts - 1, [-1]])]
    return [DroppedCells(a, b, channel, reason) for a, b in zip(first.tolist(), last.tolist(), strict=True)]


def _alive(v: Array) -> bool:
    finite = v[np.isfinite(v)]
    return bool(finite.size) and bool(np.any(finite != 0.0))


def _base_of_u(name: str) -> str | None:
    """Channel whose uncertainty a column is; None when it is none."""
    if name.startswith("u_"):
        return name[2:]
    if name == "err_rpm" or name.endswith("_err_rpm"):
        return name.replace("err_rpm", "rpm")
    return re.sub(r"_err_", "_", name) if "_err_" in name else None


def dropped(d: Dataset) -> tuple[DroppedCells, ...]:
    """Values and rows that were left out so far."""
    return tuple(d.provenance.get("dropped", ()))


def names_of(d: Dataset) -> Mapping[str, str]:
    """Names that the file has for channels."""
    found: Mapping[str, str] = d.provenance.get("names", {})
    return found


def file_name(d: Dataset, channel: str) -> str:
    """Name that the file has for a channel."""
    return names_of(d).get(channel, channel)


def clocks_of(d: Dataset) -> tuple[str, tuple[str, ...]]:
    """Channel that counts the time of a history, "" without one, and all that count its rows: times and steps."""
    every = str(d.provenance.get("clock_channels", "")).split("\t")
    return str(d.provenance.get("time_channel", "")), tuple(filter(None, every))


def stated(d: Dataset) -> dict[str, Array]:
    """Standard uncertainties that the file states row by row."""
    return {key: u for key, u in d.u.items() if np.isfinite(u).any()}


def in_one_step(d: Dataset) -> str:
    """Command that states what the headings of a table leave open, as a sentence to append; "" where none is known."""
    step = next((note for note in d.notes if "bemt import " in note), "")
    return f"; {step}" if step else ""


def asks(d: Dataset) -> dict[str, tuple[str, str, str]]:
    """Quantities that no heading names and a column may be: its channel, why it may, and the option that says so.

    >>> read = Dataset("bench", "table", {"Thurst_g": [1.0, 2.0]}, units={"Thurst_g": ""})
    >>> asks(replace(read, provenance={"headings": {"Thurst_g": "Thurst (g)"}}))["thrust"][2]
    "is it the thrust? --column thrust='Thurst (g)'"
    """
    seen, out = named(d).values, {}
    for quantity, name in misspelt(d).items():
        text = d.headings.get(name) or name
        option = f"--column {quantity}={shlex.quote(text)}"
        out[quantity] = name, f"not read, and no {quantity} is known", f"is it the {quantity}? {option}"
    for quantity, name in d.provenance.get("asked", {}).items():
        if name in d.values and not any(k.startswith(f"{quantity}_") for k in seen):
            unit = d.unit(name).replace("_", "/")
            option = f"--column {quantity}={shlex.quote(d.headings.get(name) or name)}"
            out[quantity] = name, f"in {unit}, and no {quantity} is known", f"is it the {quantity}? {option}"
    return out


NEAR = 0.65
"""Likeness of two words, as `difflib` counts it, from which one may be the other misspelt (RMP and rpm). [1]"""


def misspelt(d: Dataset) -> dict[str, str]:
    """Quantities that no heading names, and the channel whose heading is nearest to the name."""
    seen, out = names_of(rec := named(d)), {}
    unread = {k: d.headings.get(k) or k for k, v in d.values.items() if k not in {*seen.values(), *rec.values}}
    words = {k: re.split(r"[\s_(\[]", text.strip().lower())[0] for k, text in unread.items()}
    words = {k: word for k, word in words.items() if not meanings(word) and not may_be_shaft_speed(unread[k])}
    for quantity in ("rpm", "thrust", "torque"):
        known = any(k == quantity or k.startswith(f"{quantity}_") for k in rec.values)
        if not known and (near := difflib.get_close_matches(quantity, words.values(), 1, NEAR)):
            out[quantity] = next(k for k, word in words.items() if word == near[0])
    return out


def runs_of(d: Dataset) -> Array:
    """Run of each row, (N,), from 1; 0 where the file has a gap."""
    return np.nan_to_num(d.run) if "run" in d else np.ones(len(d))


def named(d: Dataset) -> Dataset:
    """Give the channels of a recording their usual names.

    >>> read = Dataset("bench", "table", {"T_N": [1.0, 2.0], "x": [0.0, 1.0]}, units={"x": ""})
    >>> sorted(named(read).values)
    ['thrust_N']
    """
    n = len(d)
    d = d if d.lines else replace(d, lines=range(1, n + 1))
    seen = _Named(d)
    seen.measured()
    seen.uncertainties()
    seen.angular()
    seen.speed()
    seen.command()
    seen.power()
    values, notes = seen.values, seen.notes
    if none := int(np.sum(~np.isfinite(values["run"]))) if "run" in values else 0:
        notes.append(f"{number_of(none, 'row')} without a run: taken as run 0")
    own = {key: d.unit(name) for key, name in seen.names.items() if name in d}
    about = {**d.provenance, "names": seen.names, "dropped": tuple(seen.lost)}
    return replace(d, values=values or {"run": np.ones(n)}, u=seen.u, u_by={}, provenance=about, notes=tuple(notes),
                   units=own, texts={})  # fmt: skip


@dataclass
class _Named:
    """A recording while its channels get their usual names: values, the names that the file has for them, notes."""

    d: Dataset
    values: dict[str, Array] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    lost: list[DroppedCells] = field(default_factory=list)
    u: dict[str, Array] = field(default_factory=dict)

    def take(self, channel: str, name: str, values: Array, note: str) -> None:
        """Take a column of the file for a channel."""
        self.values[channel], self.names[channel] = values, name
        self.notes.append(note)

    def measured(self) -> None:
        """Columns of known unit that a stand measures, and their uncertainties, without what no sensor reads."""
        d, values = self.d, self.values
        for name, v in d.values.items():
            if not d.unit(name) and name not in ("run", "rpm", *_SPEEDS):
                continue
            target = USUAL.get(name, name)
            twice = target != name and (target in d or target in values)
            if twice or (target not in MEASURED and _base_of_u(name) is None):
                continue
            far = np.abs(v) > (HUGE if target != "time_s" else LATEST_S)
            if far.any():
                shown = few([f"{x:.3g}" for x in v[far][:4]], 3)
                self.lost += lost(d, np.flatnonzero(far), target, f"{shown}: no physical magnitude")
            values[target], self.names[target] = np.where(far, np.nan, v) if far.any() else v, name

    def uncertainties(self) -> None:
        """Put columns of uncertainties with the channels they are of."""
        values = self.values
        self.u = {USUAL.get(key, key): v for key, v in stated(self.d).items() if USUAL.get(key, key) in values}
        for name, base in [(k, base) for k in values if (base := _base_of_u(k)) is not None]:
            base = USUAL.get(base, base)
            column = values.pop(name)
            del self.names[name]
            if base in values:
                self.lost += lost(self.d, np.flatnonzero(column < 0.0), f"u_{base}", "a negative uncertainty")
                self.u[base] = np.where(column < 0.0, np.nan, column)
            else:
                self.notes.append(f"{name}: uncertainty of a channel that the file has not; left out")

    def angular(self) -> None:
        """Speed of rotation from an angular speed, where the file has no other."""
        words = re.compile(r"(omega|angular|rotation|motor|w|speed|[nωΩ]_)", re.IGNORECASE)
        found = [k for k in self.d.values if self.d.unit(k) == "rad_s" and words.match(k)]
        if len(found) == 1 and not {"rpm", *_SPEEDS} & self.values.keys():
            self.take("rpm", found[0], self.d[found[0]] / units.RPM, f"rpm is {found[0]} in rev/min")

    def speed(self) -> None:
        """Choose the speed of the rotor among those that the file has."""
        d, values = self.d, self.values
        if "rpm" in values:
            return
        for name in _SPEEDS:
            if d.format == "table" and counts_electrical(d.headings.get(self.names.get(name, ""), "")):
                self.notes.append(f"{name} is no speed of the rotor until it is divided by the pole pairs")
            elif name in values and _alive(values[name]):
                how = "" if name == "optical_rpm" else ": right only if the pole count set in the stand was right"
                return self.take("rpm", self.names[name], values[name], f"rpm is {name}{how}")
        for name, condition in _DRIVE_SPEEDS.items():
            if name in d.values and _alive(d[name]):
                return self.take("rpm", name, d[name], f"rpm is {name}: {condition}")

    def command(self) -> None:
        """A throttle is a command as a pulse width is: what needs one takes either."""
        throttle = self.values.get("throttle")
        if throttle is None or "pwm_s" in self.values or not np.isfinite(throttle).any():
            return
        if np.nanmin(throttle) >= 0.0 and np.nanmax(throttle) <= FULL_THROTTLE:
            self.take("pwm_s", self.names["throttle"], pulse_of(throttle), THROTTLE_IS_PULSE)

    def power(self) -> None:
        """Electrical power from its factors, and whose power it is under a heading that does not say so."""
        d, values, names = self.d, self.values, self.names
        plain = names.get("power_W") == "power_W" and d.headings.get("power_W", "power_W") != "power_W"
        bare = values.get("power_W") if plain else d.values.get("P_W")
        if bare is not None:
            # beside a thrust alone: no stand without a torque cell reads what a shaft takes
            others = {"torque_Nm", "CP", "CQ", "voltage_V", "current_A"} & values.keys()
            alone = plain and "thrust_N" in values and not others
            if self._metered(bare, alone):
                own = names["electrical_power_W"] = names.pop("power_W", "P_W")
                values["electrical_power_W"] = values.pop("power_W", bare)
                note = f"{own} is electrical_power_W: no torque is beside it"
                self.notes.append(AS_ELECTRICAL if alone else note)
            elif "power_W" not in values:
                self._by_factors(bare)
        if "electrical_power_W" not in values and (electric := electrical_power(values)) is not None:
            values["electrical_power_W"], names["electrical_power_W"] = electric, "voltage_V x current_A"
        if plain and "power_W" in values:
            self.notes.append(f"{AS_SHAFT}; if a wattmeter read it, name the column electrical_power_W")

    def _metered(self, bare: Array, alone: bool) -> bool:
        """Whether a power is what a wattmeter reads: no torque is beside it, and no shaft takes that much."""
        values = self.values
        in_watts = unit_alone(self.d.headings.get("P_W", "")) is not None  # as an instrument shows it, and no more
        if not (in_watts or alone or {"voltage_V", "current_A"} & values.keys()):
            return False
        product = electrical_power(values)
        with np.errstate(all="ignore"):
            share = 1.0 if product is None else float(np.nanmedian(np.abs(bare / product)))
        return share > _NO_MOTOR and not {"torque_Nm", "electrical_power_W"} & values.keys()

    def _by_factors(self, bare: Array) -> None:
        """Take a power for that of the shaft, or the electrical one, if it goes with the product of its factors."""
        values = self.values
        for name, product in (("power_W", shaft_power(values)), ("electrical_power_W", electrical_power(values))):
            if product is None or name in values:
                continue
            with np.errstate(all="ignore"):
                ratio = np.abs(bare / product)
            good = ratio[np.isfinite(ratio) & (ratio > 0.0)]
            usual = float(np.median(good)) if good.size >= 3 else np.nan
            if good.size >= 3 and float(np.median(np.abs(good / usual - 1.0))) < 0.005:
                times = "" if abs(usual - 1.0) < 0.02 else f", {usual:.4g} times"
                return self.take(name, "P_W", bare, f"P_W is {name}: it goes with the product of its factors{times}")
        self.notes.append("P_W: shaft or electrical power? Ignored; name it power_W or electrical_power_W")


THROTTLE_IS_PULSE = "throttle read as 1000 us at 0 % and 2000 us at 100 %, which the file does not say"


def pulse_of(throttle: Array) -> Array:
    """Pulse width that a throttle stands for where the file has none, (N,) [s]."""
    return 1e-3 + 1e-3 * throttle


def throttle_of(pulse_s: Array) -> Array:
    """Throttle that `pulse_of` made a pulse width of, (N,) [1].

    >>> throttle_of(pulse_of(np.array([0.25])))
    array([0.25])
    """
    return (pulse_s - 1e-3) * 1e3


def without_unit(d: Dataset) -> frozenset[str]:
    """Loads that a series tells by coefficients alone: no unit can be wrong there."""
    told, loads = d.values.keys(), {"thrust_N": {"thrust_N"}, "torque_Nm": {"torque_Nm", "power_W"}}
    of = {"thrust_N": {"CT"}, "torque_Nm": {"CP", "CQ"}}
    return frozenset(k for k in loads if told & of[k] and not told & loads[k])


def moves(v: Array) -> bool:
    """Whether a column has more than one value."""
    finite = v[np.isfinite(v)]
    return finite.size > 1 and float(np.ptp(finite)) > 0.0


def shaft_power(values: Mapping[str, Array]) -> Array | None:
    """Shaft power, torque times speed, (N,) [W]."""
    torque, rpm = values.get("torque_Nm"), values.get("rpm")
    return None if torque is None or rpm is None else torque * rpm * units.RPM


def electrical_power(values: Mapping[str, Array]) -> Array | None:
    """Electrical power, voltage times current, (N,) [W]."""
    volts, amps = values.get("voltage_V"), values.get("current_A")
    return None if volts is None or amps is None else volts * amps
