"""One recording as the points that a comparison needs: steady loads over speed, and the drive over its command."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.data.recordings.channels import moves, named
from bemt.data.recordings.reduce import reduce, reduction
from bemt.judge.compare.selection import COLD, HOT, LOAD_CHANNELS, conditions_of, one_rotor, speed_in_doubt, wind_of
from bemt.physics.dataset import DIMENSIONLESS, Dataset

_WANTED = (
    *LOAD_CHANNELS, "rpm", "airspeed_m_s", "J", "density_kg_m3", "electrical_power_W", "voltage_V", "throttle", "run",
    "temperature_K", "time_s", "tip_gap_m", "wall_distance_m", "sideslip_rad", "sideslip_deg", "second_rotor_rad_s",
)  # fmt: skip
# A ramp instead of plateaus: fewest points and rows, rows that must agree, ln of a misreading, 1/s of a slow ramp.
_ENOUGH, _ROWS, _WINDOW, _JUMP, _RATE = 8, 20, 7, 0.03, 0.25
# Load of a ramp over full scale that a lag of 0.2 s leaves when it takes ten seconds.
_LAG = 0.02
# Times that a speed may exceed those at higher commands; readings to compare with, fewest and most.
_ODD, _FEWEST, _MOST = 1.5, 6, 500
# What airspeeds of one wind differ by [m/s], and as a share.
_STEADY_WIND, _LIKE_WIND = 0.5, 0.1


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
    command = next((k for k in ("pwm_s", "throttle") if k in series and moves(series[k])), "")
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
    warm = warm[(warm > COLD) & (warm < HOT)]
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


def _shifts(points: Dataset, ramp: bool) -> dict[str, float]:
    """Half of what a load differs by on the way up and down, and the lag of a ramp, over its largest value."""
    out = dict.fromkeys(LOAD_CHANNELS, _LAG) if ramp else {}
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
    loads = [np.isfinite(v[k]) for k in LOAD_CHANNELS if k in v]
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
