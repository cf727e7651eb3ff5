"""Thrust and power from a label such as 10x5: BEMT on the label's case, with bands, and K1/K2 beside it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.action import in_words
from bemt.base.arrays import Array
from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError, gathered
from bemt.base.given import numbers
from bemt.base.tables import number_text, or_null, speed_text, text_table
from bemt.base.units import INCH, KGF
from bemt.data.readers.uiuc_names import find_family
from bemt.physics import coefficients as co
from bemt.physics.bem.model import HUB_LOADS
from bemt.physics.dataset import Dataset
from bemt.rotors.case import Case, case_of, fresh
from bemt.rotors.case.load import with_changes
from bemt.rotors.case.prepare import k1k2_case
from bemt.rotors.case.propagate import propagate
from bemt.rotors.case.reading import parse_reading, reading_text
from bemt.rotors.case.schema import AIRSPEED, ANGLE, RPM
from bemt.rotors.measured import records
from bemt.rotors.validity import counted
from geometry.designation import Designation

SCHEMA = "bemt.estimate/2"
UNITS = {"mm": 1e-3, "in": INCH, "cm": 1e-2, "m": 1.0}
"""Units in which a length may have been meant. [m]"""
POSSIBLE = {"pitch": (0.1, 2.5), "chord": (0.02, 0.4)}
"""Over the diameter; outside, a propeller is no propeller, mostly one unit has been taken for another. [1]"""
DENSITY = (0.01, 10.0)
SWAPPED = 1.5
"""Pitch over the diameter from which on the two may stand in the wrong order: declared [1]."""


def length_fault(option: str, value: float, unit: str, diameter_m: float, limits: tuple[float, float]) -> list[Fault]:
    """Refuse a length that no propeller of this diameter has, with the unit that would fit.

    >>> print(*length_fault("--chord-mm", 0.8, "mm", 0.2032, (0.02, 0.4)))
    --chord-mm: got 0.8; expected 0.02 to 0.4 diameters, 4.06 to 81.3 mm. 0.8 in would be 0.1 diameters.
    """
    low, high = limits
    ratio = value * UNITS[unit] / diameter_m
    if low <= ratio <= high:
        return []
    meant = [(name, value * m / diameter_m) for name, m in UNITS.items() if name != unit]
    fits = [(name, share) for name, share in meant if 1.5 * low <= share <= high]
    hint = f"{value:g} {fits[0][0]} would be {fits[0][1]:.2g} diameters" if fits else ""
    ends = " to ".join(f"{end * diameter_m / UNITS[unit]:.3g}" for end in limits)
    return [Fault(option, "", f"{value:g}", f"{low:g} to {high:g} diameters, {ends} {unit}", hint)]


def case_of_label(
    label: str, blades: int | None = None, chord_mm: float | None = None, measured_pitch_in: float | None = None,
    series: str | None = None, density: float | None = None, reading: str | None = None,
) -> Case:  # fmt: skip
    """Case of a label with what else was measured of the propeller; a measured value is no unknown any more.

    A chord at 0.75 R scales the chord law; a pitch measured there replaces that of the label, which the population of
    measured rotors then weighs against it. Either is of this piece: it is then none that a database measured.
    """
    this_piece = chord_mm is not None or measured_pitch_in is not None
    family = None if series is None else find_family(series)
    case = case_of(fresh.label_text(label, blades, family=family, measured=not this_piece, reading=reading))
    changes: dict[str, Any] = {}
    known: set[str] = set()
    if chord_mm is not None:
        own = float(case.rotor().blade.at(0.375 * case.diameter_m)[0])
        changes["blade.max_chord_over_R"] = case.get("blade.max_chord_over_R") * chord_mm * 1e-3 / own
        known.add("blade.max_chord_over_R")
    if measured_pitch_in is not None:
        changes |= {"blade.pitch_in": measured_pitch_in, "blade.label_pitch_in": case.get("blade.pitch_in"),
                    "blade.beta_offset_deg": 0.0,
                    "blade.known_from": "stations" if reading is None else "reference"}  # fmt: skip
        known.add("blade.beta_offset_deg")
    if density is not None:
        changes["air.density_kg_m3"] = density
        known.add("air.density_kg_m3")
    left = case.declared(lambda key: key not in known)
    return with_changes(case, changes | {"assumptions": left}) if changes else case


def of_label(
    label: str, rpm: Any, airspeed_m_s: Any = 0.0, blades: int | None = None, chord_mm: float | None = None,
    measured_pitch_in: float | None = None, series: str | None = None, density: float | None = None,
    angle_deg: Any = 0.0, reading: str | Mapping[str, float] | None = None,
) -> RotorEstimate:  # fmt: skip
    """Estimate every speed [rev/min] with every airspeed [m/s] at every angle between wind and shaft [deg].

    ``u_...`` is the rotor's own, ``u_reading_...`` what a stand shows
    (`bemt.rotors.case.propagate.Propagated.u_reading`). ``reading`` as `bemt.rotors.case.reading` takes it.

    An unreadable label, impossible numbers and an unknown series are refused, all at once.
    """
    told = None if reading is None else reading_text(reading)
    asked = (("rpm", rpm), ("airspeed_m_s", airspeed_m_s), ("angle_deg", angle_deg))
    axes = [np.atleast_1d(numbers(*pair, finite=False)).ravel().tolist() for pair in asked]
    try:
        return _of_label(label, axes, blades, chord_mm, measured_pitch_in, series, density, told)
    except InputError as error:
        if not isinstance(label, str) or not Path(label).exists():
            raise
        hint = f"A case? bemt sweep {label} solves it"
        raise InputError([replace(f, hint=hint) if f.file == "label" else f for f in error.faults]) from None


def _of_label(
    label: str, axes: Sequence[Sequence[float]], blades: int | None, chord_mm: float | None,
    measured_pitch_in: float | None, series: str | None, density: float | None, reading: str | None,
) -> RotorEstimate:  # fmt: skip
    told, faults = _label(label, blades)
    faults += _length_faults(told, chord_mm, measured_pitch_in)
    if density is not None and not DENSITY[0] <= density <= DENSITY[1]:
        hint = "In g/m3? Divide by 1000" if 10.0 < density < 2000.0 else ""
        faults.append(Fault("--density-kg-m3", "", f"{density:g}", "0.01 to 10 kg/m3", hint))
    rows: tuple[tuple[str, Sequence[float], float, float, str], ...] = (
        ("--rpm", axes[0], RPM.low, RPM.high, "rev/min"),
        ("--airspeed-m-s", axes[1], AIRSPEED.low, AIRSPEED.high, "m/s"),
        ("--angle-deg", axes[2], ANGLE.low, ANGLE.high, "deg"),
    )  # fmt: skip
    faults += [
        Fault(option, "", f"{value:g}", f"{low:g} to {high:g} {unit}")
        for option, values, low, high, unit in rows
        for value in values
        if not low <= value <= high
    ]
    for stated, check in ((series, find_family), (reading, parse_reading)):
        if stated is not None:
            with gathered(faults):
                check(stated)
    if faults or told is None:
        raise InputError(faults)
    case = case_of_label(label, blades, chord_mm, measured_pitch_in, series, density, reading)
    rpm, V, angle = (v.ravel() for v in np.meshgrid(*axes, indexing="ij"))
    found = propagate(case, rpm, V, angle_deg=angle)
    points, simple = found.points, k1k2_case(case, None, rpm, V, case.air(), angle)
    columns = {
        "rpm": rpm, "airspeed_m_s": V, "angle_deg": angle,
        "thrust_N": points.thrust_N, "u_thrust_N": points.u_thrust_N,
        "u95_thrust_N": found.half_width95("thrust_N"), "power_W": points.power_W, "u_power_W": points.u_power_W,
        "u95_power_W": found.half_width95("power_W"), "u_reading_thrust_N": found.u_reading("thrust_N"),
        "u_reading_power_W": found.u_reading("power_W"), "J": points.J, "CT": points.CT, "CP": points.CP,
        "FM": co.FM(points.CT, points.CP, V), "M_tip": points.M_tip, "Re75": points.Re75,
        "k1k2_thrust_N": simple.thrust_N, "torque_Nm": points.torque_Nm, "u_torque_Nm": points.u_torque_Nm,
        **{key: points.values.get(key, np.where(points.converged, 0.0, np.nan)) for key in HUB_LOADS},
    }  # fmt: skip
    given = EstimateInput(
        label, told.diameter_in, told.pitch_in, told.blades, told.blade_class, chord_mm, measured_pitch_in,
        case.file.blade.family, float(case.air().rho), reading, case.as_built().prior.known_from, measured_source(case),
    )  # fmt: skip
    u = {key: columns[f"u_{key}"] for key in ("thrust_N", "torque_Nm", "power_W")}
    values = {k: v for k, v in columns.items() if k.startswith("u_reading") or not k.startswith(("u_", "u95_"))}
    if (sideslip := np.radians(values.pop("angle_deg"))).any():
        values["sideslip_rad"] = sideslip
    return RotorEstimate("bemt", case.name, values, u, flags=points.flags, columns=columns, given=given)


def measured_source(case: Case) -> str | None:
    """Where a propeller was measured that bemt knows; None where it was not."""
    stated = case.file.blade.as_built
    return None if stated is None or stated.measured is None else records()[stated.measured].source


def _length_faults(told: Designation | None, chord_mm: float | None, pitch_in: float | None) -> Iterator[Fault]:
    """Measured lengths that are no numbers, or that no propeller of that diameter has."""
    lengths = (("--chord-mm", chord_mm, "mm", "chord"), ("--measured-pitch-in", pitch_in, "in", "pitch"))
    for option, value, unit, name in lengths:
        if value is not None and not math.isfinite(value):
            yield Fault(option, "", f"{value:g}", f"a length [{unit}]")
        elif value is not None and told:
            yield from length_fault(option, value, unit, told.diameter_in * INCH, POSSIBLE[name])


def _label(label: str, blades: int | None) -> tuple[Designation | None, list[Fault]]:
    try:
        return fresh.read_label(label, blades), []
    except InputError as error:
        return None, list(fresh.or_a_fan(error, label).faults)


class EstimateInput(Documented):
    """What an estimate was asked for, and what its label says; ``class`` in the document is `blade_class`."""

    label: str
    diameter_in: float
    pitch_in: float
    blades: int | None
    blade_class: str | None
    chord_mm: float | None
    measured_pitch_in: float | None
    series: str | None
    density_kg_m3: float
    reading: str | None
    known_from: str
    source: str | None


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RotorEstimate(Dataset):
    """Estimate from a label: a Dataset of kind ``bemt``, with its table and its document.

    Examples
    --------
    >>> from bemt import estimate
    >>> print(estimate("10x5", rpm=6000).text.splitlines()[-1])
    for narrower bands give --chord-mm (at 0.75 R) or --reading rpm=...,thrust_g=...
    """

    given: EstimateInput
    columns: Mapping[str, Array] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The rows as a table, with what not to trust below."""
        head = ["rpm", "V [m/s]", "T [N]", "± 68 %", "± 95 %", "on a stand", "P [W]", "± 68 %", "± 95 %", "on a stand",
                "K1/K2 [N]", "J", "FM", "M tip"]  # fmt: skip
        keys: tuple[str, ...] = ("rpm", "airspeed_m_s", "thrust_N", "u_thrust_N", "u95_thrust_N", "u_reading_thrust_N",
                                 "power_W", "u_power_W", "u95_power_W", "u_reading_power_W", "k1k2_thrust_N", "J",
                                 "FM", "M_tip")  # fmt: skip
        empty = [key for key in ("J", "FM") if not np.nan_to_num(self.columns[key]).any()]  # all at rest, or in flight
        head, keys = [h for h in head if h not in empty], tuple(k for k in keys if k not in empty)
        if self.columns["angle_deg"].any():
            head[2:2], keys = ["angle [deg]", "H [N]"], (*keys[:2], "angle_deg", "H_force_N", *keys[2:])
        shown = {key: [number_text(x, 2 if key.startswith("u") else 4) for x in self.columns[key]] for key in keys}
        shown["rpm"] = [speed_text(x) for x in self.rpm]
        cells = [list(row) for row in zip(*(shown[key] for key in keys), strict=True)]
        at = head.index("T [N]") + 1
        head.insert(at, "T [gf]")
        for row, thrust in zip(cells, self.thrust_N, strict=True):
            row.insert(at, number_text(1e3 * thrust / KGF, 3))
        g = self.given
        kind = f", {g.blade_class.replace('_', ' ')}" if g.blade_class else ""
        read = fresh.read_as(g.label, g.diameter_in, g.pitch_in)
        read += f": diameter {g.diameter_in:g} in, pitch {g.pitch_in:g} in, {g.blades} blades{kind}"
        return "\n".join([read, text_table(head, cells, left=()), *self._notes]) + "\n"

    @property
    def _notes(self) -> list[str]:
        """What the columns mean, what not to trust, and what would narrow the bands."""
        g = self.given
        notes = ["± 68 and 95 %: the rotor itself; on a stand: what yours may show, ± 68 %"]
        if g.source:
            notes.append(f"fitted to its measurement in the {g.source}")
        if self._open_kind:
            notes.append(f"{self._open_kind}; --details says by how much")
        if g.pitch_in > SWAPPED * g.diameter_in:
            notes.append(f"! a label is diameter x pitch: is it {g.pitch_in:g}x{g.diameter_in:g}?")
        notes += [f"! {flag}" for flag in counted([list(flags) for flags in self.flags])]
        more = ["--chord-mm (at 0.75 R)"] if g.chord_mm is None else []
        if g.reading is None:
            more.append("--reading rpm=...,thrust_g=...")
        if more and g.known_from == "label":
            notes.append(f"for narrower bands give {' or '.join(more)}")
        return notes

    @property
    def _open_kind(self) -> str:
        """What a label leaves open that states no kind of blade; else empty."""
        g = self.given
        return fresh.open_kind(g.label, g.blades) if g.known_from == "label" and g.series is None else ""

    @property
    def details(self) -> str:
        """The same, and what each ending of an open label would give."""
        return f"{self.text}{self._by_kind()}\n" if self._open_kind else self.text

    def _by_kind(self) -> str:
        """Thrust of the first row as each kind of blade that an ending tells."""
        g, at = self.given, [self.columns[k][:1] for k in ("rpm", "airspeed_m_s", "angle_deg")]
        shown = []
        for end in fresh.OPEN_ENDINGS:
            case = case_of_label(f"{g.label} {end}", g.blades, g.chord_mm, g.measured_pitch_in, None, g.density_kg_m3)
            found = propagate(case, at[0], at[1], angle_deg=at[2], bands=False).points
            shown.append(f"{end} {number_text(found.thrust_N[0], 3)}")
        return f"with an ending, T at {speed_text(at[0][0])} rev/min: {', '.join(shown)} N"

    def __str__(self) -> str:
        return in_words(self.text)

    def to_dict(self) -> dict[str, Any]:
        """Plain values of schema ``bemt.estimate/2``; unknown numbers are None."""
        rows = [{name: or_null(column[i]) for name, column in self.columns.items()} | {"flags": list(self.flags[i])}
                for i in range(len(self))]  # fmt: skip
        given = {"class" if key == "blade_class" else key: value for key, value in self.given.document().items()}
        return {"schema": SCHEMA, "case": self.name, "given": given, "rows": rows}
