"""One recording as the points that a comparison needs: steady loads over speed, and the drive over its command."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bemt.air import Air
from bemt.base.errors import Fault, InputError
from bemt.base.units import KNOT, MPH, ZERO_CELSIUS, split_suffix
from bemt.dataset import DIMENSIONLESS, Dataset
from bemt.readers._headings import may_be_shaft_speed, surely_shaft_speed
from bemt.recordings.channels import MEASURED, named
from bemt.recordings.reduce import reduce, reduction
from bemt.recordings.windmilling import zero_thrust_speed

Array = NDArray[np.float64]

_LOADS = ("thrust_N", "torque_Nm", "power_W", "CT", "CP", "CQ")
_UNITS_OF = {"thrust": ("N", "gf"), "torque": ("N m", "N mm"), "power": ("W",)}
_WANTED = (
    *_LOADS,
    "rpm",
    "airspeed_m_s",
    "J",
    "density_kg_m3",
    "electrical_power_W",
    "voltage_V",
    "throttle",
    "run",
    "temperature_K",
)
_AIR = re.compile(r"([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(C|K|hPa|Pa|kg/m3|m/s|kt|mph|km/h)")
_CONDITION = re.compile(r"\s*([^=]+?)\s*=\s*(.+?)\s*")
_RANGE = re.compile(r"([-+.\deE]+):([-+.\deE]+)")
_ROTOR = "rotor"
# Two numbers of a table that differ by less are the same number.
_SAME_NUMBER = 1e-6
# A ramp instead of plateaus: fewest points and rows, rows that must agree, ln of a misreading, 1/s of a slow ramp.
_ENOUGH, _ROWS, _WINDOW, _JUMP, _RATE = 8, 20, 7, 0.03, 0.25
# Load of a ramp over full scale that a lag of 0.2 s leaves when it takes ten seconds.
_LAG = 0.02
# Times that a speed may exceed those at higher commands; readings to compare with, fewest and most.
_ODD, _FEWEST, _MOST = 1.5, 6, 500
# What airspeeds of one wind differ by [m/s], and as a share.
_STEADY_WIND, _LIKE_WIND = 0.5, 0.1
# Temperatures that air of a stand can have [K].
_COLD, _HOT = 230.0, 330.0
# Name of a column without a heading: its number is that of no rotor.
_NUMBERED = re.compile(r"column_\d+")
_ROTOR_WORDS = ("left", "right", "upper", "lower", "front", "rear", "A", "B", "C", "D", "1", "2", "3", "4")


@dataclass(frozen=True, eq=False)
class StandRun:
    """Steady points of one recording, and what holds for all of it."""

    points: Dataset  # Channels in SI, rpm in rev/min; ``command`` is the pulse width [s] or the throttle [1]
    command: str  # ``pwm_s``, ``throttle`` or "" without one
    density: float  # Mean recorded density, or that of recorded pressure and temperature [kg/m3]; NaN: not recorded
    diameter_m: float  # As the recording or the label says [m]; NaN: unknown
    temperature_K: float = math.nan  # Mean of the air [K]; NaN: not recorded
    # Scatter between the runs of this recording at equal speed, share, by channel, where it shows
    session: Mapping[str, float] = field(default_factory=dict)
    # Columns that tell rows apart and are no channel of the rotor, as conditions may name them
    conditions: tuple[str, ...] = ()
    # What lag or hysteresis shifts a load by, standard deviation as a share of its largest value, by channel [1]
    shift: Mapping[str, float] = field(default_factory=dict)
    misread: tuple[int, int] = (0, 0)  # Speeds that no rotor can have at their command or load, and all
    # Speed below which thrust is negative as in a wind that is not recorded [rev/min]; NaN: no such wind
    zero_thrust_rpm: float = math.nan

    def __len__(self) -> int:
        """Give the number of points."""
        return len(self.points)


def _kept(imported: Dataset, column: str, wanted: str, where: str) -> NDArray[np.bool_]:
    """Rows of one condition: a text, a number, or a range of numbers."""
    names = {h: k for k, h in imported.provenance.get("headings", {}).items()}
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


def rotors_of(imported: Dataset) -> list[str]:
    """Rotors that the columns of a file tell apart.

    >>> rotors_of(Dataset("bench", "table", {"T_A_N": [1.0], "T_B_N": [2.0], "current_A": [3.0]}))
    ['A', 'B']
    >>> rotors_of(Dataset("bench", "table", {"thrust_N": [1.0], "current_A": [3.0]}))
    []
    """
    names = [_words(name) for name in imported.values if not _NUMBERED.fullmatch(name)]
    return [w for w in _ROTOR_WORDS if any(w in words for words in names)]


def _of_rotor(imported: Dataset, word: str, where: str) -> Dataset:
    """Columns of one of several rotors under their plain names; columns of the others go."""
    known = rotors_of(imported)
    if not known and any(f"only the {word} rotor" in note for note in imported.notes):
        return imported
    if word not in known:
        raise InputError(Fault(where, _ROTOR, word, f"one of {', '.join(known)}" if known else "a file of one rotor"))
    others = set(known) - {word}
    kept: dict[str, str] = {}
    for name in imported.values:
        own = _words(name)
        if word in own:
            base = "_".join(p for p in own if p != word)
            kept[base + name[len("_".join(own)) :] if base else name.removeprefix(f"{word}_")] = name
        elif not others & set(own):
            kept.setdefault(name, name)
    values = {new: imported[old] for new, old in kept.items()}
    units = {new: imported.unit(old) for new, old in kept.items()}
    return replace(
        imported, values=values, u={}, u_by={}, units=units, provenance={**imported.provenance, _ROTOR: word}
    )


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
        if found[1] == _ROTOR and _ROTOR not in imported:
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
_AIR_RANGES = {"temperature_K": (_COLD, _HOT), "pressure_Pa": (4e4, 1.1e5), "density_kg_m3": (0.4, 1.6),
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
    if faults:
        raise InputError(faults)
    if known.keys() >= {"temperature_K", "pressure_Pa"}:
        known["density_kg_m3"] = Air.from_state(known["pressure_Pa"], known["temperature_K"] - ZERO_CELSIUS).rho
    gone = {*known, *(_AIR_RANGES if known else ()), *(("airspeed_m_s", "V_m_s", "J") if wind is not None else ())}
    gone -= {"airspeed_m_s"} if wind is None else set()
    left = {k: v for k, v in imported.values.items() if k not in gone}
    if wind is not None:
        left["airspeed_m_s"] = np.full(len(imported), wind)
    u = {k: v for k, v in imported.u.items() if k in left}
    constants = {k: v for k, v in imported.provenance.get("constants", {}).items() if k not in gone}
    return replace(imported, values=left, u=u, provenance={**imported.provenance, "constants": constants | known})


def stand_run(imported: Dataset, name: str, diameter_m: float | None = None) -> StandRun:
    """Reduce one recording for a comparison."""
    units = {k: unit for k, unit in imported.units.items() if unit or k not in DIMENSIONLESS}
    imported = replace(imported, units=units)  # a throttle has none
    one_rotor(imported, name)
    speed_in_doubt(imported, name)
    series, ramp = _reduced(imported, diameter_m)
    values = {k: series[k] for k in _WANTED if k in series}
    if not {"thrust_N", "torque_Nm", "power_W"} & values.keys() and "rpm" not in values and "J" not in values:
        raise InputError(Fault(name, "", "no speed", "rpm, or J with coefficients", "Nothing to compare at"))
    command = next((k for k in ("pwm_s", "throttle") if k in series and _moves(series[k])), "")
    if command:
        values["command"] = series[command]
    if "power_W" in values and "torque_Nm" in values:
        del values["power_W"]
    gone = [x for x in reduction(series).dropped if x.channel == "rpm" and x.reason.startswith("misread")]
    false = _misread(values)
    if false.any():
        values["rpm"] = np.where(false, np.nan, values["rpm"])
    constants = imported.provenance.get("constants", {})
    rho = values.get("density_kg_m3", np.full(1, np.nan))
    density = float(np.nanmean(rho)) if np.isfinite(rho).any() else math.nan
    if not math.isfinite(density):
        density = float(constants.get("density_kg_m3", math.nan))
    diameter = diameter_m if diameter_m is not None else float(constants.get("diameter_m", math.nan))
    warm = values.get("temperature_K", np.array([constants.get("temperature_K", math.nan)]))
    warm = warm[(warm > _COLD) & (warm < _HOT)]
    return StandRun(
        Dataset(
            series.kind,
            name,
            values,
            {k: series.u[k] for k in values if k in series},
            notes=(*ramp, *(n for n in series.notes if "no density" not in n)),
            units={"command": "s" if command == "pwm_s" else "-"},
        ),
        command,
        density,
        diameter,
        float(warm.mean()) if warm.size else math.nan,
        {k: float(v["session"]) for k, v in reduction(series).correlated.items() if v.get("session")},
        conditions_of(imported),
        _shifts(series, bool(ramp)),
        (int(false.sum()) + len(gone), (int(np.isfinite(series["rpm"]).sum()) if "rpm" in series else 0) + len(gone)),
        math.nan if (zero := wind_of(imported)) is None else zero,
    )


def _with_headings(imported: Dataset, name: str) -> None:
    """Refuse a table without headings: which column is which quantity is not known."""
    headings = imported.provenance.get("headings", {})
    if not imported.values or any(headings.get(k) or not _NUMBERED.fullmatch(k) for k in imported.values):
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


def _misread(values: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Speeds that no rotor can have: much faster than most at the same or higher command, with less load.

    A change of battery or propeller moves speed and load in other ways; only readings at one airspeed are compared.
    A slow one may be a rotor that has just set off.

    >>> table = {"command": [1.0, 1.0, *[2.0] * 8], "rpm": [9e3, 3e3, *[5e3] * 8], "thrust_N": [1.0, 1.0, *[4.0] * 8]}
    >>> _misread({k: np.array(v) for k, v in table.items()}).tolist()[:3]
    [True, False, False]
    """
    load = next((np.abs(values[k]) for k in ("electrical_power_W", "torque_Nm", "thrust_N") if k in values), None)
    none = np.zeros(max((v.size for v in values.values()), default=0), dtype=bool)
    if load is None or not {"rpm", "command"} <= values.keys():
        return none
    good = np.isfinite(values["command"]) & (values["rpm"] > 0.0) & np.isfinite(load)
    rows = np.flatnonzero(good)
    if rows.size < _FEWEST:
        return none
    command, speed, load = values["command"][rows], np.log(values["rpm"][rows]), load[rows]
    every = np.unique(np.linspace(0, rows.size - 1, min(rows.size, _MOST)).astype(int))
    some = np.argsort(command, kind="stable")[every]
    V = np.nan_to_num(values.get("airspeed_m_s", np.zeros(none.size)))[rows]
    one_wind = np.abs(V[some] - V[:, None]) <= _STEADY_WIND + _LIKE_WIND * np.abs(V[:, None])
    beyond = one_wind & (command[some] >= command[:, None])
    contradict = beyond & (speed[:, None] - speed[some] > math.log(_ODD)) & (load[some] > load[:, None])
    votes = contradict.sum(axis=1)
    none[rows] = (votes >= _FEWEST) & (votes > 0.5 * beyond.sum(axis=1))
    return none


def one_rotor(imported: Dataset, name: str, how: str = "Choose it with --rows-a or --rows-b rotor={}") -> None:
    """Refuse the loads of several rotors, of which one has to be chosen, and columns that have no names."""
    _with_headings(imported, name)
    several = rotors_of(imported)
    if len(several) > 1 and not set(_LOADS) & named(imported).values.keys():
        got = f"loads of several rotors: {', '.join(several)}"
        raise InputError(Fault(name, "", got, "one of them", how.format(several[0])))


def speed_in_doubt(imported: Dataset, path: str) -> None:
    """Refuse a file whose speed cannot be read: it must not be left out, nor replaced by that of a case."""
    told = named(imported).values
    if "rpm" in told:
        return
    headings, faults = imported.provenance.get("headings", {}), []
    for name, v in imported.values.items():
        heading, unit = headings.get(name) or name, imported.unit(name)
        apart = name.startswith("u_") or "err" in name.split("_") or not np.any(np.nan_to_num(v))
        if not apart and not unit and may_be_shaft_speed(heading):
            faults.append(_no_unit(path, heading, "a speed without a unit"))
        elif not apart and (unit == "rpm" or (unit == "rad_s" and may_be_shaft_speed(heading))):
            line = f'[columns] rpm = {{ column = "{heading}", unit = "{unit}" }}'
            hint = f"If it is the speed of this rotor, head it rpm, or write in recording.toml: {line}"
            hint += "; electrical_rpm with pole_pairs if it counts electrical revolutions"
            got, expected = f"a speed under a name of its own ({name})", "one column that is the speed of the rotor"
            faults.append(Fault(path, f"column {heading}", got, expected, hint))
    for name, cells in imported.texts.items():
        heading = headings.get(name) or name
        if may_be_shaft_speed(heading) and sum(cell.strip()[:1].isdigit() for cell in cells) > len(cells) / 2:
            faults.append(_no_unit(path, heading, f"a speed as text, such as {cells[0].strip()[:20]!r}"))
    if faults and not set(_LOADS) & told.keys():  # said with the speed, not after it
        for name, units in _UNITS_OF.items():
            if name in imported.values and not imported.unit(name):
                heading = headings.get(name) or name
                hint = "Head it " + " or ".join(f"{heading} ({unit})" for unit in units)
                got, expected = f"a {name} without a unit", "a unit in the heading, or in a recording.toml"
                faults.append(Fault(path, f"column {heading}", got, expected, hint))
    beside = Path(path).with_name("recording.toml")
    if faults and any("names this file" in note for note in imported.notes):
        faults = [replace(f, hint=f"{beside.as_posix()} names this file: give that instead") for f in faults]
    if faults:
        raise InputError(faults)


def wind_of(imported: Dataset) -> float | None:
    """Speed of no thrust of a recording in a wind that it does not state [rev/min]; None: no such wind.

    One of several rotors may be in the slipstream of another.
    """
    told = named(imported).values
    if _ROTOR in imported.provenance or {"airspeed_m_s", "J"} & told.keys() or not {"rpm", "thrust_N"} <= told.keys():
        return None
    return zero_thrust_speed(told["rpm"], told["thrust_N"])


def _no_unit(path: str, heading: str, got: str) -> Fault:
    base = heading.split("(")[0].split("[")[0].strip()
    hint = f"Head it {base} (rev/min) or {base} (rad/s). "
    hint += "" if surely_shaft_speed(heading) else "If it is the airspeed, head it airspeed_m_s. "
    hint += "`diagnose --rpm N` states one speed for all rows"
    expected = "numbers with a unit in the heading, or a recording.toml that names column and unit"
    return Fault(path, f"column {heading}", got, expected, hint)


def conditions_of(imported: Dataset) -> tuple[str, ...]:
    """Columns that may tell one condition from another: no load, no speed, no clock, and not the same in every row.

    >>> made = Dataset("bench", "table", {"rpm": [4e3, 5e3, 6e3], "spacing_m": [0.1, 0.1, 0.2]})
    >>> conditions_of(made)
    ('spacing_m',)
    """
    texts = [k for k, v in imported.texts.items() if 1 < len(set(v)) < len(v)]
    known = {*MEASURED, *named(imported).provenance["names"].values()}
    known |= {k for k in imported.values if k.startswith("u_") or {"err", "rpm", "vibration"} & set(k.split("_"))}
    numbers = [k for k, v in imported.values.items() if k not in known and _moves(v)]
    return (*texts, *numbers)


def _shifts(points: Dataset, ramp: bool) -> dict[str, float]:
    """Half of what a load differs by on the way up and down, and the lag of a ramp, over its largest value."""
    out = dict.fromkeys(_LOADS, _LAG) if ramp else {}
    for name, loop in reduction(points).hysteresis.items():
        top = float(np.nanmax(np.abs(points[name])))
        out[name] = max(out.get(name, 0.0), 0.5 * abs(loop.difference) / top if top > 0.0 else 0.0)
    return out


def _reduced(imported: Dataset, diameter_m: float | None) -> tuple[Dataset, tuple[str, ...]]:
    """Steady points; for a slow ramp, which has hardly any, its rows."""
    try:
        steady = reduce(imported, diameter_m=diameter_m)
    except InputError:
        steady = None
    if steady is not None and (reduction(steady).mode == "points" or _useful(steady) >= _ENOUGH):
        return steady, ()
    slow = _ramp(imported)
    if slow is not None:
        rows = reduce(slow, diameter_m=diameter_m, steady=True)
        if steady is None or _useful(rows) > 2 * _useful(steady):
            words = f"few steady points: {len(slow)} of {len(imported)} rows of a slow ramp are used as they are"
            return rows, (words,)
    return steady or reduce(imported, diameter_m=diameter_m), ()


def _useful(points: Dataset) -> int:
    """Points with a speed and a load."""
    v = points.values
    loads = [np.isfinite(v[k]) for k in _LOADS if k in v]
    speed = np.isfinite(v["rpm"]) & (v["rpm"] > 0.0) if "rpm" in v else np.ones(len(points), dtype=bool)
    return int(np.sum(np.any(loads, axis=0) & speed)) if loads else 0


def _ramp(imported: Dataset) -> Dataset | None:
    """Rows of a record of samples at which the speed changes slowly and reads what its neighbours read."""
    seen = named(imported).values
    t, rpm = seen.get("time_s"), seen.get("rpm")
    if rpm is None or len(imported) < _ROWS:
        return None
    if t is None:
        return imported
    speed = np.where(rpm > 0.0, np.log(np.where(rpm > 0.0, rpm, 1.0)), np.nan)
    half = _WINDOW // 2
    padded = np.pad(speed, half, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, _WINDOW)
    with np.errstate(all="ignore"):
        full = np.isfinite(windows).sum(axis=1) > half
        middle = np.array([np.nanmedian(w) if ok else np.nan for w, ok in zip(windows, full, strict=True)])
        far = np.array(
            [np.nanmedian(np.abs(w - m)) if ok else np.nan for w, m, ok in zip(windows, middle, full, strict=True)]
        )
        rate = np.abs(np.gradient(middle, t))
    keep = np.isfinite(middle) & (np.abs(speed - middle) < _JUMP) & (far < _JUMP) & (rate < _RATE)
    return imported.select(keep) if keep.sum() >= _ROWS else None


def _moves(v: Array) -> bool:
    finite = v[np.isfinite(v)]
    return finite.size > 1 and float(np.ptp(finite)) > 0.0
