"""One reading of a rotor, such as a hover: it makes the rotor of a label or a case this very one.

``rpm=5400, thrust_g=410`` conditions the rotor's latent numbers as a recording of one row does
(`bemt.rotors.as_measured`); more readings stand behind semicolons. It is a key of a case,
``blade.as_built.reading``, so that every door that takes a case takes a reading.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.errors import Fault, InputError, refuse
from bemt.base.units import UNITS, split_suffix
from bemt.physics.air import Air
from bemt.rotors.case.as_built import MOVED, CaseAsBuilt, as_built_of
from bemt.rotors.conditioning import SESSION, apart
from bemt.rotors.measured import records

if TYPE_CHECKING:
    from bemt.rotors.case.load import Case

SETTLED = frozenset({
    "model.drag_level", "model.n_crit", "blade.section.thickness", "blade.section.thickness_scale", "rotor.hub_ratio",
    *(key for keys in MOVED.values() for key in keys),
})  # fmt: skip
"""Assumptions that readings of a rotor settle: its latent numbers take their place."""
DENSITY = 1.225
"""Air of a reading that states none [kg/m3]."""
THIRST = 2.0
"""Standard deviations above what its thrust tells from which on a power is doubted to be that of the shaft [1]."""
_NAMES = {"rpm": "angular_speed", "n": "angular_speed", "thrust": "force", "T": "force", "weight": "force",
          "torque": "torque", "Q": "torque", "power": "power", "P": "power", "airspeed": "speed", "V": "speed",
          "density": "density"}  # fmt: skip
_PLAIN = {"rpm": "rpm", "V": "m_s", "T": "N", "Q": "Nm", "P": "W", "n": "rev_s"}
_SHORT = {"T": "thrust", "weight": "thrust", "Q": "torque", "P": "power", "V": "airspeed", "n": "rpm"}
_EXPECTED = "rpm=5400,thrust_g=410 and, if known, airspeed_m_s=, power_W= of the shaft or torque_Nm=, density_kg_m3="


@dataclass(frozen=True)
class RotorReading:
    """One reading of a rotor; NaN where it says nothing."""

    rpm: float  # [rev/min]
    thrust_N: float
    torque_Nm: float  # Of the shaft
    airspeed_m_s: float
    density_kg_m3: float
    by_power: bool = False  # The torque is that of a power


def parse_reading(text: str, where: str = "--reading") -> tuple[RotorReading, ...]:
    """Read readings as people type them: ``name=value`` with commas between, readings with semicolons.

    Names carry their unit: ``rpm``, ``thrust_g`` (gram-force), ``thrust_N``, ``airspeed_m_s``, ``torque_Nm``,
    ``power_W`` (of the shaft), ``density_kg_m3`` (1.225 by default). ``V`` is the airspeed in m/s.

    >>> one, = parse_reading("rpm=5400, thrust_g=410")
    >>> round(one.thrust_N, 3), one.airspeed_m_s
    (4.021, 0.0)
    >>> parse_reading("rpm=6000,power_W=60")[0].torque_Nm.__round__(4)
    0.0955
    >>> parse_reading("rpm=6000")
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: --reading: got 'rpm=6000'; expected a thrust, a torque or a power beside the speed.
    """
    out: list[RotorReading] = []
    faults: list[Fault] = []
    for part in filter(str.strip, text.split(";")):
        found: dict[str, float] = {}
        for word in filter(str.strip, part.split(",")):
            name, _, value = (piece.strip() for piece in word.partition("="))
            try:
                quantity, number = _value(name, value)
            except ValueError as error:
                faults.append(Fault(where, "", repr(word.strip()), str(error)))
                continue
            if quantity in found:
                faults.append(Fault(where, "", repr(word.strip()), f"each quantity once, not {quantity} again"))
            found[quantity] = number
        rpm, torque = found.get("rpm", math.nan), found.get("torque", math.nan)
        if not {"thrust", "torque", "power"} & set(found):
            faults.append(Fault(where, "", repr(part.strip()), "a thrust, a torque or a power beside the speed"))
        elif not 1.0 <= rpm <= 1e6:
            faults.append(Fault(where, "", repr(part.strip()), "a speed, such as rpm=5400", _EXPECTED))
        if "power" in found and not faults:
            torque = found["power"] / (rpm * math.pi / 30.0)
        out.append(RotorReading(rpm, found.get("thrust", math.nan), torque, found.get("airspeed", 0.0),
                           found.get("density", DENSITY), "power" in found))  # fmt: skip
    if not out and not faults:
        faults.append(Fault(where, "", repr(text), _EXPECTED))
    refuse(faults)
    return tuple(out)


def _value(name: str, value: str) -> tuple[str, float]:
    """Quantity and SI value, rev/min for a speed; ValueError says what was expected."""
    base, unit = split_suffix(name)
    unit = unit if base != name or name in UNITS else None
    if name in _PLAIN:
        base, unit = name, UNITS[_PLAIN[name]]
    dimension = _NAMES.get(base)
    if dimension is None or unit is None:
        raise ValueError(_EXPECTED)
    factor, offset = unit.factor, unit.offset
    if dimension == "force" and unit.dimension == "mass":  # thrust in grams is a weight
        factor *= 9.80665
    elif unit.dimension != dimension:
        known = ", ".join(f"{base}_{u}" for u, one in UNITS.items() if one.dimension == dimension)
        raise ValueError(f"one of {known}")
    try:
        number = float(value)
    except ValueError:
        raise ValueError(f"{name}=NUMBER") from None
    if not math.isfinite(number) or (dimension != "speed" and number < 0.0):
        raise ValueError(f"{name}=NUMBER, finite and not below zero")
    si = number * factor + offset
    return _SHORT.get(base, base), si * 30.0 / math.pi if dimension == "angular_speed" else si


def reading_text(reading: str | Mapping[str, float | str] | Sequence[Mapping[str, float | str]]) -> str:
    """Readings as one text, of a text or of names and numbers.

    >>> reading_text({"rpm": 5400, "thrust_g": 410})
    'rpm=5400, thrust_g=410'
    """
    if isinstance(reading, str):
        return reading
    rows = [reading] if isinstance(reading, Mapping) else reading
    return "; ".join(
        ", ".join(f"{k}={v}" if isinstance(v, str) else f"{k}={v:.10g}" for k, v in row.items()) for row in rows
    )


def with_reading(case: Case, reading: str | Mapping[str, float] | Sequence[Mapping[str, float]]) -> Case:
    """Case of the rotor that gave a reading; what the reading settles is no assumption any more."""
    from bemt.rotors.case.as_built import known_from
    from bemt.rotors.case.load import with_changes

    text = reading_text(reading)
    parse_reading(text)
    blade = case.file.blade
    if blade.as_built is not None and blade.as_built.file is not None:
        raise InputError(Fault("--reading", "", repr(text), "a case that no recording calibrated"))
    changes = {"blade.as_built.reading": text}
    if known_from(blade) != "measured":
        changes["blade.known_from"] = "reference"
    return with_changes(case, changes)


def conditioned(case: Case, text: str) -> CaseAsBuilt:
    """What readings tell of the rotor of a case, beside what a database tells of another piece of it."""
    readings = parse_reading(text, "blade.as_built.reading")
    stated = case.file.blade.as_built
    known = records()[stated.measured] if stated is not None and stated.measured is not None else None
    from bemt.rotors.as_measured import FAR, as_measured

    blade = case.file.blade.model_copy(update={"as_built": None, "known_from": _source_before(case)})
    base = replace(case, file=case.file.model_copy(update={"blade": blade}))
    rows = np.array([[r.rpm, r.airspeed_m_s, r.thrust_N, r.torque_Nm, r.density_kg_m3] for r in readings]).T
    rpm, V, T, Q, rho = rows
    D = case.diameter_m
    scale = rho * (rpm / 60.0) ** 2 * D**4
    y = np.array([T / scale, 2.0 * math.pi * Q / (scale * D)])
    u = SESSION * np.nan_to_num(y)
    mine = np.ones(rpm.size, bool)
    if known is not None:  # its smooth readings, of another piece in another campaign
        rpm, V = np.append(rpm, known.rpm), np.append(V, known.at.J * known.rpm / 60.0 * D)
        y, u = np.append(y, known.y, axis=1), np.append(u, known.single, axis=1)
        mine = np.append(mine, np.zeros(known.rpm.size, bool))
    prior = as_built_of(base.file, base.folder, base.rotor(), False, None if known is None else False).prior
    found = as_measured(
        base, rpm, V, Air.from_density(), y[0], y[1], u[0], u[1], others=apart(D), theirs=~mine, prior=prior,
        where=f"reading {text!r}", typed=True,
    )  # fmt: skip
    known_as = replace(found.posterior, known_from="reference")
    asks = []
    if found.far > FAR:
        off = f"{found.far:.2g} standard deviations off what is known of this rotor: {found.told} what the case gives"
        asks.append(f"{off}. Unit, speed or label?")
    if found.thirst > THIRST and any(r.by_power for r in readings):
        off = f"its power lies {found.thirst:.2g} standard deviations above that of such a rotor"
        asks.append(f"{off}: is it that of the shaft? A wattmeter reads the losses of the motor, too")
    doubt = f"reading {text!r}: {'; '.join(asks)}" if asks else ""
    told = " and ".join([f"its reading {text}", *([f"its measurement in the {known.source}"] if known else [])])
    return CaseAsBuilt(known_as, found.posterior.mean, found.reference, doubt, told)


def _source_before(case: Case) -> str | None:
    """How the blade was known before the reading: a label's chord law with a measured pitch is stations at 0.75 R."""
    blade = case.file.blade
    return None if blade.chord_law is None else "label" if blade.label_pitch_in is None else "stations"
