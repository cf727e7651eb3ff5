"""Which rows, rotor and air of a file a comparison means; what is in doubt is refused or asked about, never guessed."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError, refuse
from bemt.base.units import KNOT, MPH, RPM, ZERO_CELSIUS, split_suffix
from bemt.data.readers.headings import counts_electrical, heading, may_be_shaft_speed, surely_shaft_speed
from bemt.data.recordings.cfd_run import WHICH, is_run
from bemt.data.recordings.channels import MEASURED, asks, in_one_step, moves, named, names_of
from bemt.data.recordings.findings import zero_thrust_speed
from bemt.data.recordings.shown import options_of
from bemt.physics.air import AIR_C, Air
from bemt.physics.dataset import Dataset

_AIR = re.compile(r"([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(C|K|hPa|Pa|kg/m3|m/s|kt|mph|km/h)")
_CONDITION = re.compile(r"\s*([^=]+?)\s*=\s*(.+?)\s*")
_RANGE = re.compile(r"([-+.\deE]+):([-+.\deE]+)")
ROTOR = "rotor"
SECOND_ROTOR = "second_rotor_rad_s"
"""Channel of the speed of the other one of two rotors."""
# Two numbers of a table that differ by less are the same number.
_SAME_NUMBER = 1e-6
# Temperatures that air of a stand can have [K].
COLD, HOT = (c + ZERO_CELSIUS for c in AIR_C)
# Name of a column without a heading: its number is that of no rotor.
NUMBERED = re.compile(r"column_\d+")
_ROTOR_WORDS = ("left", "right", "upper", "lower", "front", "rear", "A", "B", "C", "D", "1", "2", "3", "4")


def _kept(imported: Dataset, column: str, wanted: str, where: str) -> NDArray[np.bool_]:
    """Rows of one condition: a text, a number, or a range of numbers."""
    names = {h: k for k, h in imported.headings.items()}
    name = column if column in imported or column in imported.texts else names.get(column, column)
    if name in imported.texts:
        found = np.array([cell.strip() == wanted for cell in imported.texts[name]])
        if not found.any():
            known = ", ".join(list(dict.fromkeys(c.strip() for c in imported.texts[name]))[:8])
            raise InputError(Fault(where, column, f"no row with {wanted}", f"one of {known}"))
        return found
    values = imported.values.get(name)
    if values is None:
        known = ", ".join([*imported.texts, *imported.values][:12])
        raise InputError(Fault(where, column, "no such column", f"one of {known}"))
    span = _RANGE.fullmatch(wanted)
    try:
        low, high = (float(span[1]), float(span[2])) if span else (float(wanted), float(wanted))
    except ValueError:
        raise InputError(Fault(where, column, wanted, "a number, or a range such as 0.9:1.1")) from None
    slack = _SAME_NUMBER * max(abs(low), abs(high), 1e-12)
    kept = (values >= low - slack) & (values <= high + slack)
    if not kept.any():
        v = values[np.isfinite(values)]
        told = f"{v.min():g} to {v.max():g} in SI" if v.size else "a number"
        raise InputError(Fault(where, column, f"no row with {wanted}", told))
    return np.asarray(kept)


def _words(name: str) -> list[str]:
    """Words of the name of a channel, without its unit: the A of a current in ampere names no rotor."""
    return split_suffix(name)[0].split("_")


def _without(rotor: str, name: str) -> str:
    """Name of a channel without that of its rotor."""
    words = _words(name)
    base = "_".join(w for w in words if w != rotor)
    return base + name[len("_".join(words)) :] if base else name.removeprefix(f"{rotor}_")


def rotors_of(imported: Dataset) -> list[str]:
    """Rotors that the columns of a file tell apart.

    >>> rotors_of(Dataset("bench", "table", {"T_A_N": [1.0], "T_B_N": [2.0], "current_A": [3.0]}))
    ['A', 'B']
    >>> rotors_of(Dataset("bench", "table", {"thrust_N": [1.0], "current_A": [3.0]}))
    []
    """
    names = [_words(name) for name in imported.values if not NUMBERED.fullmatch(name)]
    return [w for w in _ROTOR_WORDS if any(w in words for words in names)]


def _of_rotor(imported: Dataset, word: str, where: str) -> Dataset:
    """Columns of one of several rotors under their plain names; columns of the others go."""
    known = rotors_of(imported)
    if not known and any(f"only the {word} rotor" in note for note in imported.notes):
        return imported
    if word not in known:
        raise InputError(Fault(where, ROTOR, word, f"one of {', '.join(known)}" if known else "a file of one rotor"))
    others = set(known) - {word}
    kept: dict[str, str] = {}
    for name in imported.values:
        if word in _words(name):
            kept[_without(word, name)] = name
        elif not others & set(_words(name)):
            kept.setdefault(name, name)
    turning = [name for name in imported.values if others & set(_words(name)) and imported.unit(name) == "rpm"]
    turning = turning or [name for name in imported.values if others & set(name.split("_")) and name.endswith("_rpm")]
    values = {new: imported[old] for new, old in kept.items()}
    units = {new: imported.unit(old) for new, old in kept.items()}
    if len(turning) == 1:  # its slipstream is recorded with it
        values[SECOND_ROTOR], units[SECOND_ROTOR] = imported[turning[0]] * RPM, "rad_s"
    return replace(imported, values=values, u={}, u_by={}, units=units, provenance={**imported.provenance, ROTOR: word})


def selected(imported: Dataset, conditions: Sequence[str], where: str) -> Dataset:
    """Keep the rows, or the rotor, that a user means.

    >>> made = Dataset("bench", "table", {"rpm": [4e3, 5e3]}, lines=(2, 3))
    >>> selected(made, ["rpm=4500:6000"], "a.csv").lines
    (3,)
    """
    keep = np.ones(len(imported), dtype=bool)
    for text in conditions:
        found = _CONDITION.fullmatch(text)
        if not found:
            raise InputError(Fault(where, text, "no condition", "COLUMN=VALUE, COLUMN=LOW:HIGH or rotor=NAME"))
        if found[1] == ROTOR and ROTOR not in imported:
            imported = _of_rotor(imported, found[2], where)
        else:
            keep &= _kept(imported, found[1], found[2], where)
    if keep.all():
        return imported
    if not keep.any():
        raise InputError(Fault(where, ", ".join(conditions), "no row that meets all", "one or more"))
    return imported.select(keep)


_AIR_UNITS = {
    "C": ("temperature_K", 1.0, ZERO_CELSIUS), "K": ("temperature_K", 1.0, 0.0),
    "hPa": ("pressure_Pa", 100.0, 0.0),
    "Pa": ("pressure_Pa", 1.0, 0.0), "kg/m3": ("density_kg_m3", 1.0, 0.0), "m/s": ("airspeed_m_s", 1.0, 0.0),
    "kt": ("airspeed_m_s", KNOT, 0.0), "mph": ("airspeed_m_s", MPH, 0.0), "km/h": ("airspeed_m_s", 1.0 / 3.6, 0.0),
}  # fmt: skip
_AIR_RANGES = {"temperature_K": (COLD, HOT), "pressure_Pa": (4e4, 1.1e5), "density_kg_m3": (0.4, 1.6),
               "airspeed_m_s": (0.0, 200.0)}  # fmt: skip


def with_air(imported: Dataset, told: str | None, where: str) -> Dataset:
    """Add the air of the day that a user tells, such as ``22C,1013hPa``, in place of what is recorded.

    >>> told = with_air(Dataset("bench", "table", {"rpm": [4e3]}), "22C, 1013hPa", "--air-a").provenance
    >>> round(told["constants"]["density_kg_m3"], 3)
    1.196
    """
    if told is None:
        return imported
    known, faults = {}, []
    for part in told.split(","):
        found = _AIR.fullmatch(part.strip())
        name, factor, offset = _AIR_UNITS[found[2]] if found else ("", 1.0, 0.0)
        value = float(found[1]) * factor + offset if found else math.nan
        low, high = _AIR_RANGES.get(name, (0.0, 0.0))
        if not low <= value <= high:
            hint = "A temperature alone takes one pressure for both runs"
            expected = "a number with C, K, hPa, Pa, kg/m3 or, of a wind, m/s, kt, such as 22C,1013hPa"
            faults.append(Fault(where, "", repr(part), expected, hint))
        known[name] = value
    wind = known.pop("airspeed_m_s", None)
    if set(known) == {"pressure_Pa"}:
        faults.append(Fault(where, "", repr(told), "a temperature too, or a density"))
    refuse(faults)
    if known.keys() >= {"temperature_K", "pressure_Pa"}:
        known["density_kg_m3"] = Air.from_state(known["pressure_Pa"], known["temperature_K"] - ZERO_CELSIUS).rho
    gone = {*known, *(_AIR_RANGES if known else ()), *(("airspeed_m_s", "V_m_s", "J") if wind is not None else ())}
    gone -= {"airspeed_m_s"} if wind is None else set()
    left = {k: v for k, v in imported.values.items() if k not in gone}
    if wind is not None:
        left["airspeed_m_s"] = np.full(len(imported), wind)
    u = {k: v for k, v in imported.u.items() if k in left}
    constants = {k: v for k, v in imported.constants.items() if k not in gone}
    return replace(imported, values=left, u=u, provenance={**imported.provenance, "constants": constants | known})


def conditions_of(imported: Dataset) -> tuple[str, ...]:
    """Columns that may tell one condition from another: no load, no speed, no clock, and not the same in every row.

    >>> made = Dataset("bench", "table", {"rpm": [4e3, 5e3, 6e3], "spacing_m": [0.1, 0.1, 0.2]})
    >>> conditions_of(made)
    ('spacing_m',)
    """
    texts = [k for k, v in imported.texts.items() if 1 < len(set(v)) < len(v)]
    known = {*MEASURED, *names_of(named(imported)).values()}
    known |= {k for k in imported.values if k.startswith("u_") or {"err", "rpm", "vibration"} & set(k.split("_"))}
    numbers = [k for k, v in imported.values.items() if k not in known and moves(v)]
    return (*texts, *numbers)


# Range of speeds, ln, that shows how a column goes with it, powers of a load or its power, and correlation [1].
_SPAN, _POWERS, _ALIKE, _FEWEST = 0.2, (1.5, 3.5), 0.95, 3
LOAD_CHANNELS = ("thrust_N", "torque_Nm", "power_W", "CT", "CP", "CQ")
_UNITS_OF = {"thrust": ("N", "gf"), "torque": ("N m", "N mm"), "power": ("W",)}


def one_rotor(imported: Dataset, name: str, how: str = "Choose it with --rows-a or --rows-b rotor={}") -> None:
    """Refuse the loads of several rotors, of which one has to be chosen, and columns that have no names."""
    with_headings(imported, name)
    several = rotors_of(imported)
    if len(several) > 1 and not set(LOAD_CHANNELS) & named(imported).values.keys():
        got = f"loads of several rotors: {', '.join(several)}"
        raise InputError(Fault(name, "", got, "one of them", how.format(several[0])))


def with_headings(imported: Dataset, name: str) -> None:
    """Refuse a table without headings: which column is which quantity is not known."""
    headings = imported.headings
    if not imported.values or any(headings.get(k) or not NUMBERED.fullmatch(k) for k in imported.values):
        return
    path = Path(name)
    hint = (
        f"Write {path.with_name('recording.toml').as_posix()}, with your own columns and units, and give that file "
        f'instead:\n[recording]\nfile = "{path.name}"\nheader = false\n[columns]\n'
        'rpm = { column = 1, unit = "rpm" }\n'
        'thrust = { column = 2, unit = "N" }\n# units: rpm, rad_s; N, gf, kgf, lbf; Nm, mNm; s, us'
    )
    expected = "a heading with a unit for each column, or a recording.toml that names them"
    raise InputError(Fault(name, "", f"a table of {len(imported.values)} columns without headings", expected, hint))


def speed_in_doubt(imported: Dataset, path: str) -> None:
    """Refuse a file whose speed, or airspeed, cannot be read: it must not be left out, nor be that of a case."""
    if is_run(imported) and imported.unread:
        hint = f"{WHICH[0].upper()}{WHICH[1:]}"
        got, expected = "rows that differ in nothing else that was read", "the meaning of what they differ in"
        raise InputError(Fault(path, imported.unread, got, expected, hint))
    told, doubts, headings = named(imported).values, asks(imported), imported.headings
    for what, instead, expected, more in (
        ("airspeed", "J", "the airspeed", "in still air: --airspeed-m-s 0 (compare: --air-a 0m/s, --air-b 0m/s)"),
        ("rpm", "rpm", "the speed of rotation", "one speed for all rows: --rpm N"),
    ):
        if what in doubts and instead not in told:
            name, got, fix = doubts[what]
            hint = f"{fix[0].upper()}{fix[1:]}; {more}"
            raise InputError(Fault(path, f"column {headings.get(name, name)}", got, expected, hint))
    if "rpm" in told:
        return
    heading = {name: headings.get(name) or name for name in (*imported.values, *imported.texts)}
    faults = []
    for name, v in imported.values.items():
        unit, may = imported.unit(name), may_be_shaft_speed(heading[name])
        if name.startswith("u_") or "err" in name.split("_") or not np.any(np.nan_to_num(v)):
            continue
        if not unit and may:
            faults.append(_no_unit(path, heading[name], "a speed without a unit"))
        elif unit == "rpm" or (unit == "rad_s" and may):
            line = f'[columns] rpm = {{ column = "{heading[name]}", unit = "{unit}" }}'
            hint = f"If it is the speed of this rotor, head it rpm, or write in recording.toml: {line}"
            got, expected = f"a speed under a name of its own ({name})", "one column that is the speed of the rotor"
            if counts_electrical(heading[name]):
                got = "electrical revolutions"
                hint = "The speed of the rotor is that over the pole pairs: --pole-pairs N in diagnose and compare"
            else:
                hint += "; electrical_rpm with pole_pairs if it counts electrical revolutions"
            faults.append(Fault(path, f"column {heading[name]}", got, expected, hint))
    for name, cells in imported.texts.items():
        if may_be_shaft_speed(heading[name]) and sum(cell.strip()[:1].isdigit() for cell in cells) > len(cells) / 2:
            faults.append(_no_unit(path, heading[name], f"a speed as text, such as {cells[0].strip()[:20]!r}"))
    if faults and not set(LOAD_CHANNELS) & told.keys():  # said with the speed, not after it
        faults += _loads_in_doubt(imported, heading, path)
    if faults and (step := in_one_step(imported)):
        faults[-1] = replace(faults[-1], hint=f"{faults[-1].hint}{step}")
    beside = Path(path).with_name("recording.toml")
    if faults and any("names this file" in note for note in imported.notes):
        faults = [replace(f, hint=f"{beside.as_posix()} names this file: give that instead") for f in faults]
    refuse(faults)


def _loads_in_doubt(imported: Dataset, heading: Mapping[str, str], path: str) -> Iterator[Fault]:
    for name, units in _UNITS_OF.items():
        if name in imported.values and not imported.unit(name):
            hint = "Head it " + " or ".join(f"{heading[name]} ({unit})" for unit in units)
            got, expected = f"a {name} without a unit", "a unit in the heading, or in a recording.toml"
            yield Fault(path, f"column {heading[name]}", got, expected, hint)


def like_loads(imported: Dataset, known: Dataset) -> list[str]:
    """Headings of columns without a unit that rise with a power of the speed as loads do, nearest its square first."""
    out = {}
    for name, v in imported.values.items():
        loaded = np.isfinite(v) & (v != 0.0) & (known.rpm > 0.0) if "rpm" in known else np.zeros(v.size, dtype=bool)
        n = np.log(known.rpm[loaded])
        said = heading(imported.headings.get(name, name))
        bare = imported.units.get(name) == "" and said.unit is None and not said.doubt
        if not bare or n.size < _FEWEST or np.ptp(n) < _SPAN:
            continue
        load = np.log(np.abs(v[loaded]))
        power = float(np.polyfit(n, load, 1)[0])
        if _POWERS[0] < power < _POWERS[1] and np.corrcoef(n, load)[0, 1] > _ALIKE:
            out[imported.headings.get(name, name)] = abs(power - 2.0)
    return sorted(out, key=lambda k: out[k])


def wind_of(imported: Dataset) -> float | None:
    """Speed of no thrust of a recording in a wind that it does not state [rev/min]; None: no such wind.

    One of several rotors may be in the slipstream of another.
    """
    told = named(imported)
    if (
        ROTOR in imported.provenance
        or {"airspeed_m_s", "J", SECOND_ROTOR} & told.values.keys()
        or not {"rpm", "thrust_N"} <= told.values.keys()
    ):
        return None
    return zero_thrust_speed(told.rpm, told.thrust_N)


def _no_unit(path: str, heading: str, got: str) -> Fault:
    base = heading.split("(")[0].split("[")[0].strip()
    hint = f"Head it {base} (rev/min) or {base} (rad/s). "
    hint += "" if surely_shaft_speed(heading) else "If it is the airspeed, head it airspeed_m_s. "
    hint += "`diagnose --rpm N` states one speed for all rows"
    expected = "numbers with a unit in the heading, or a recording.toml that names column and unit"
    return Fault(path, f"column {heading}", got, expected, hint)


PLACE = {"temperature": "TEMPERATURE", "pressure": "PRESSURE"}
"""What stands in a command for a reading that the user has to fill in."""


@dataclass(frozen=True)
class Invocation:
    """Files and options of a comparison, as a command line has them."""

    a: str = "A"  # First recording
    b: str = "B"  # Second recording
    # Conditions on their rows
    rows_a: tuple[str, ...] = ()
    rows_b: tuple[str, ...] = ()
    air_a: str | None = None  # Air of A
    air_b: str | None = None  # Air of B
    label: str | None = None  # Label that gives the diameter
    case: str | None = None  # Case of the rotor
    diameter_m: float | None = None  # Of the rotor [m]
    stated: Mapping[str, Sequence[str]] = field(default_factory=dict)  # Of the columns: unit, column and sign
    ruled_out: tuple[str, ...] = ()  # Effects that a check has ruled out
    changed: tuple[str, ...] = ()  # Effects that the user says he changed

    @property
    def chosen(self) -> bool:
        """Whether rows or air were given, which no other command takes."""
        return bool(self.rows_a or self.rows_b or self.air_a or self.air_b)

    def command(self, **other: Any) -> str:
        """Command that asks this, some of it replaced.

        >>> Invocation("a.csv", "b.csv", rows_b=("rotor=right",), label="10x5").command(case="CASE")
        'bemt compare a.csv b.csv --rows-b rotor=right --label 10x5 --case CASE'
        """
        given = replace(self, **other)
        words = [given.a, given.b]
        for option, rows in (("--rows-a", given.rows_a), ("--rows-b", given.rows_b)):
            words += [word for row in rows for word in (option, row)]
        options = {"--air-a": given.air_a, "--air-b": given.air_b, "--label": given.label, "--case": given.case}
        words += [word for option, text in options.items() if text is not None for word in (option, text)]
        size = [] if given.diameter_m is None else [given.diameter_m]
        known = {"changed": given.changed, "ruled-out": given.ruled_out}
        more = options_of({"diameter-m": size, **given.stated, **known})
        return " ".join(["bemt compare", *(shlex.quote(word) for word in words), *more])

    def without(self, cause: str) -> str:
        """Command that asks this after a check has ruled a cause out."""
        out = cause.split("+")
        left = tuple(k for k in self.changed if k not in out)
        return self.command(changed=left, ruled_out=(*self.ruled_out, *out))

    def with_rows(self, letter: str, column: str) -> str:
        """Command that also chooses a range of one column of A or B; LOW and HIGH are the user's to fill in."""
        name = f"rows_{letter}"
        return self.command(**{name: (*getattr(self, name), f"{column}=LOW:HIGH")})

    def with_days(self) -> str:
        """Command with the air of both days; what was not given is the user's to fill in.

        >>> Invocation("a.csv", "b.csv", air_a="45kt", air_b="1.2kg/m3").with_days()
        'bemt compare a.csv b.csv --air-a TEMPERATURE,PRESSURE,45kt --air-b 1.2kg/m3'
        """
        return self.command(air_a=_with_places(self.air_a), air_b=_with_places(self.air_b))


def _with_places(air: str | None) -> str:
    """Air with a place for the temperature and the pressure that are not in it."""
    parts = [part.strip() for part in (air or "").split(",") if part.strip()]
    if any(part.endswith("kg/m3") for part in parts):
        return ",".join(parts)
    warm = [part for part in parts if part.endswith(("C", "K"))] or [PLACE["temperature"]]
    pressure = [part for part in parts if part.endswith("Pa")] or [PLACE["pressure"]]
    return ",".join([*warm, *pressure, *(part for part in parts if part not in (*warm, *pressure))])
