"""From a recording to the points of a bench map: pulse width, thrust, rpm, current, power, voltage when steady."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_of
from bemt.data.readers.recording import FULL_THROTTLE
from bemt.data.recordings import plateaus
from bemt.data.recordings.channels import THROTTLE_IS_PULSE, pulse_of
from bemt.physics.dataset import Dataset, concat

CHANNELS = {"thrust": "thrust_N", "rpm": "rpm", "current": "current_A", "power": "electrical_power_W"}
"""What a map gives beside the pulse width, and the channel it is fitted to."""
_RECORDED = (*CHANNELS.values(), "voltage_V")
RAMP = 40
"""Distinct commands, one sample each, from which a recording is a ramp and not a table of steps."""


def map_points(
    pulse_us: Array, recorded: Mapping[str, ArrayLike], run: int = 0, notes: Sequence[str] = (), ramp: bool = False
) -> Dataset:
    """Steady points over the pulse width [us]; NaN for what is not recorded. `ramp`: the command moved all the time."""
    nothing = np.full(len(pulse_us), np.nan)
    values = {
        "pulse_us": pulse_us,
        **{k: recorded.get(k, nothing) for k in _RECORDED},
        "run": np.full(len(pulse_us), run),
    }
    return Dataset("bench", "map", values, units={"pulse_us": "us"}, notes=tuple(notes), provenance={"ramp": ramp})


def _channel(got: Dataset, *names: str) -> Array | None:
    for name in names:
        v = got.values.get(name)
        if v is not None and got.unit(name) and np.any(np.isfinite(v) & (v != 0.0)):
            return v  # type: ignore[no-any-return]
    return None


def _command(got: Dataset, name: str, notes: list[str]) -> Array:
    pulse = _channel(got, "pulse_width_s")
    if pulse is not None:
        return pulse * 1e6
    throttle = _channel(got, "throttle")
    if throttle is not None:
        full = float(np.nanmax(throttle, initial=0.0))
        if full > FULL_THROTTLE:
            told = f"throttle up to {full:g} without a unit"
            raise InputError(Fault(name, "throttle", told, "a fraction of 0 to 1", "In percent? Head it throttle (%)"))
        notes.append(THROTTLE_IS_PULSE)
        return 1e6 * pulse_of(throttle)
    hint = "Log the ESC signal, or name its column as pulse_width or throttle in a recording.toml"
    raise InputError(Fault(name, "pulse_width_s", "no pulse width and no throttle", "a command per row", hint))


def points(got: Dataset, name: str = "", sign: int = 1, run: int = 0) -> Dataset:
    """Find the steady points of one recording."""
    notes: list[str] = []
    command = _command(got, name, notes)
    thrust = _channel(got, "thrust_N")
    if thrust is None:
        hint = "Name its column and unit in a recording.toml"
        raise InputError(Fault(name, "thrust_N", "no thrust with a unit", "a channel of thrust", hint))
    thrust = sign * thrust
    rpm = _channel(got, "rpm", "optical_rpm", "electrical_rpm")
    if rpm is not None and _channel(got, "rpm", "optical_rpm") is None:
        notes.append("rpm is the electrical reading of the stand, with the pole pairs set in its software")
    current, voltage = _channel(got, "current_A"), _channel(got, "voltage_V")
    power = _channel(got, "electrical_power_W")
    if power is None and current is not None and voltage is not None:
        power = current * voltage
    raw = (thrust, rpm, current, power, voltage)
    data = {key: np.full(len(command), np.nan) if v is None else v for key, v in zip(_RECORDED, raw, strict=True)}
    full = float(np.nanmax(np.abs(thrust)))
    silent = (data["rpm"] == 0.0) & (np.abs(thrust) > 0.05 * full)
    if np.any(silent):
        notes.append(f"rpm of 0 under thrust in {number_of(silent.sum(), 'row')}: no rpm there")
        data["rpm"] = np.where(silent, np.nan, data["rpm"])
    out = _reduced(got, command, data, notes, run)
    if len(out) < 4 or np.ptp(out.pulse_us) <= 0.0:
        got_text = f"{len(out)} steady points"
        raise InputError(Fault(name, "", got_text, "4 points or more at different pulse widths"))
    top = out.pulse_us >= np.max(out.pulse_us) - 0.2 * np.ptp(out.pulse_us)
    if np.nanmean(out.thrust_N[top]) <= 0.0:
        shown = f"{np.nanmean(out.thrust_N[top]):.3g} N at the greatest pulse widths"
        hint = "Give --sign -1 if the stand counts thrust the other way"
        raise InputError(Fault(name, "thrust_N", shown, "positive thrust", hint))
    return out


def _reduced(got: Dataset, command: Array, data: dict[str, Array], notes: list[str], run: int) -> Dataset:
    used = np.isfinite(command) & np.isfinite(data["thrust_N"])
    stays = np.mean(np.isclose(np.diff(command[used]), 0.0)) if np.count_nonzero(used) > 1 else 0.0
    if stays < 0.4:  # one row per step, or a ramp
        ramp = len(np.unique(command[used])) > RAMP
        if ramp:
            notes.append("the command moves all the time: lag of the drive is part of the map")
        return map_points(command[used], {key: v[used] for key, v in data.items()}, run, notes, ramp)
    found = plateaus.find(got.values.get("time_s"), data, "thrust_N", command)
    kept = [p for p in found.plateaus if "not settled" not in p.flags]
    if lost := len(found.plateaus) - len(kept):
        notes.append(f"{lost} plateaus that do not settle were dropped")
    pulse = np.array([p.command for p in kept], dtype=float)
    return map_points(pulse, {key: np.array([p.mean.get(key, np.nan) for p in kept]) for key in data}, run, notes)


def join(parts: Sequence[Dataset]) -> Dataset:
    """Put recordings of one drive together."""
    notes = dict.fromkeys(note for part in parts for note in part.notes)
    return replace(concat(parts), notes=tuple(notes), provenance={"ramp": any(p.provenance["ramp"] for p in parts)})
