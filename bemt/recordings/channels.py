"""What a recording measured, under the names that a `Dataset` has: one view for reduction and sanity checks.

The importers keep the names of the file; here ``T_N`` becomes ``thrust_N``, the pulse width ``pwm_s``, one of several
speeds ``rpm``. Every choice is a note, every value that is left out an entry of `lost`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bemt.base import units
from bemt.readers._imported import Imported

__all__ = ["LOADS", "MEASURED", "Lost", "Recorded", "shaft_power", "view"]

Array = NDArray[np.float64]
HUGE = 1e9
"""Magnitude in SI above which no reading of a stand is physical."""
LOADS = ("thrust_N", "duct_thrust_N", "torque_Nm", "power_W", "electrical_power_W", "current_A", "CT", "CP", "CQ")
"""Channels of which a point needs one."""
MEASURED = (
    "time_s", "run", "pwm_s", "throttle", "rpm", "electrical_rpm", "optical_rpm", "airspeed_m_s", "J", "thrust_N",
    "duct_thrust_N", "torque_Nm", "power_W", "electrical_power_W", "voltage_V", "current_A", "temperature_K",
    "pressure_Pa", "humidity", "density_kg_m3", "tip_gap_m", "wall_distance_m", "sideslip_rad",
    "sideslip_deg", "CT", "CP", "CQ", "eta",
)  # fmt: skip
"""Channels that a reduced recording may have."""
_ALIASES = {
    "T_N": "thrust_N", "F_N": "thrust_N", "Q_Nm": "torque_Nm", "M_Nm": "torque_Nm", "U_V": "voltage_V",
    "I_A": "current_A", "pulse_width_s": "pwm_s", "V_m_s": "airspeed_m_s", "gap_m": "tip_gap_m",
    "mechanical_power_W": "power_W", "shaft_power_W": "power_W",
}  # fmt: skip
_SPEEDS = ("optical_rpm", "electrical_rpm")
# Says neither whose power it is.
_BARE_POWER = re.compile(r"\s*power\s*[\[(]\s*w(atts?)?\s*[\])]\s*", re.IGNORECASE)


@dataclass(frozen=True)
class Lost:
    """A row, or one value of it, that was left out: `line` in the file, `channel` ("" for the row) and `reason`."""

    line: int
    channel: str
    reason: str


@dataclass(frozen=True, eq=False)
class Recorded:
    """Channels of a recording by name of a Dataset.

    Parameters
    ----------
    values : mapping of str to (N,) float
        In SI, ``rpm`` in rev/min; NaN: no value.
    u : mapping of str to (N,) float
        Standard uncertainty that the file states row by row.
    lines : tuple of int
        Line in the file of each row (row number from 1 when it is not known).
    run : (N,) float
        Run of each row, from 1. [-]
    names : mapping of str to str
        Name that the importer gave to each channel.
    notes : tuple of str
        Choices that were made.
    lost : tuple of Lost
        Values that were left out.
    flags : tuple of tuple of str
        Of the importer, per row.
    """

    values: Mapping[str, Array]
    u: Mapping[str, Array]
    lines: tuple[int, ...]
    run: Array
    names: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    lost: tuple[Lost, ...] = ()
    flags: tuple[tuple[str, ...], ...] = ()

    def __len__(self) -> int:
        """Give the number of rows."""
        return len(self.lines)


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


def view(imported: Imported, speed: str | None = None) -> Recorded:
    """Name the channels of a recording.

    Examples
    --------
    >>> from bemt.readers._imported import Channel
    >>> read = Imported("table", "bench", 2, {"T_N": Channel([1.0, 2.0], "N"), "x": Channel([0.0, 1.0])})
    >>> sorted(view(read).values)
    ['thrust_N']
    """
    n = imported.rows
    lines = imported.lines if len(imported.lines) == n else tuple(range(1, n + 1))
    values: dict[str, Array] = {}
    names: dict[str, str] = {}
    notes: list[str] = []
    lost: list[Lost] = []
    raw = {k: np.asarray(c.values, dtype=float) for k, c in imported.channels.items()}
    raw = {k: v for k, v in raw.items() if v.shape == (n,)}
    for name, v in raw.items():
        if not imported.channels[name].unit and name not in ("run", "rpm", *_SPEEDS):
            continue
        target = _ALIASES.get(name, name)
        if target != name and (target in raw or target in values):
            continue
        if target not in MEASURED and _base_of_u(name) is None:
            continue
        far = np.flatnonzero(np.abs(v) > HUGE)
        lost += [Lost(lines[i], target, f"{v[i]:.3g} is no physical magnitude") for i in far]
        values[target], names[target] = np.where(np.abs(v) > HUGE, np.nan, v), name
    u = {}
    for name in [k for k in values if _base_of_u(k) is not None]:
        base = _base_of_u(name) or ""
        base = _ALIASES.get(base, base)
        column = values.pop(name)
        names.pop(name)
        if base in values:
            bad = np.flatnonzero(column < 0.0)
            lost += [Lost(lines[i], f"u_{base}", "a negative uncertainty") for i in bad]
            u[base] = np.where(column < 0.0, np.nan, column)
        else:
            notes.append(f"{name}: uncertainty of a channel that the file has not; left out")
    _speed(values, names, notes, speed)
    _power(values, names, notes, raw.get("P_W"))
    if names.get("power_W") == "power_W" and _BARE_POWER.fullmatch(imported.headings.get("power_W", "")):
        notes.append("power_W: taken as shaft power; if a wattmeter read it, name the column electrical_power_W")
    run = values.get("run", np.ones(n))
    if np.any(~np.isfinite(run)):
        notes.append(f"{int(np.sum(~np.isfinite(run)))} rows without a run: taken as run 0")
        run = np.where(np.isfinite(run), run, 0.0)
    flags = imported.flags if len(imported.flags) == n else ((),) * n
    return Recorded(values, u, lines, run, names, tuple(notes), tuple(lost), flags)


def _speed(values: dict[str, Array], names: dict[str, str], notes: list[str], speed: str | None) -> None:
    """Choose the speed of the rotor among those that the file has."""
    if speed is not None and speed != "rpm" and speed in values:
        values["rpm"], names["rpm"] = values[speed], names[speed]
        notes.append(f"rpm is {speed}, as told")
        return
    if "rpm" in values:
        return
    for name in _SPEEDS:
        if name in values and _alive(values[name]):
            values["rpm"], names["rpm"] = values[name], names[name]
            how = "" if name == "optical_rpm" else ": right only if the pole count set in the stand was right"
            notes.append(f"rpm is {name}{how}")
            return


def shaft_power(values: Mapping[str, Array]) -> Array | None:
    """Shaft power, torque times speed, (N,) [W]."""
    if "torque_Nm" not in values or "rpm" not in values:
        return None
    return values["torque_Nm"] * values["rpm"] * units.RPM


def _power(values: dict[str, Array], names: dict[str, str], notes: list[str], bare: Array | None) -> None:
    """Electrical power from its factors, and what a bare P stands for."""
    if bare is not None and "power_W" not in values:
        shaft = shaft_power(values)
        electric = values["voltage_V"] * values["current_A"] if {"voltage_V", "current_A"} <= values.keys() else None
        for name, product in (("power_W", shaft), ("electrical_power_W", electric)):
            if product is None or name in values:
                continue
            with np.errstate(all="ignore"):
                ratio = np.abs(bare / product)
            good = ratio[np.isfinite(ratio) & (ratio > 0.0)]
            usual = float(np.median(good)) if good.size >= 3 else np.nan
            if good.size >= 3 and float(np.median(np.abs(good / usual - 1.0))) < 0.005:
                values[name], names[name] = bare, "P_W"
                times = "" if abs(usual - 1.0) < 0.02 else f", {usual:.4g} times"
                notes.append(f"P_W is {name}: it goes with the product of its factors{times}")
                break
        else:
            notes.append("P_W: shaft or electrical power? Left out; name it power_W or electrical_power_W")
    if {"voltage_V", "current_A"} <= values.keys() and "electrical_power_W" not in values:
        values["electrical_power_W"] = values["voltage_V"] * values["current_A"]
        names["electrical_power_W"] = "voltage_V x current_A"
