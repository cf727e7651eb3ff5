"""``motor.toml``: the recordings of a motor constant and the conventions they were made in.

::

    schema = "bemt.motor/1"

    [motor]
    name = "MN4006 KV380"
    winding = "delta"                  # or "wye"
    kv_rpm_V = 380                     # optional: method data sheet
    kv_tolerance_pct = 5.0             # half-width stated or assumed; without it the uncertainty is unknown
    kv_measure = "peak"                # which volt K_v means: peak, rms, peak_to_peak
    kv_between = "line"
    pole_pairs = 12                    # needed by waveforms
    data = "generated, seed 0"         # what the trials are

    [result]
    current = "q_power_invariant"      # K_t is torque per this current; also peak, rms, q_amplitude_invariant
    between = "phase"                  # in a winding, or line

    [back_emf]
    file = "back_emf.csv"              # columns trial, rpm, one in V; or
    waveforms = ["scope1.csv"]         # oscilloscope traces, one trial each
    measure = "peak_to_peak"
    between = "phase"
    u_gain_pct = 0.5                   # standard uncertainty common to all trials

    [torque]
    file = "torque.csv"                # columns trial, one in A, one in V
    shunt_ohm = 250.0
    u_shunt_pct = 0.05
    low_mA = 4.0
    high_mA = 20.0
    torque_low_Nm = 0.0
    torque_high_Nm = 2.0
    current = "q_power_invariant"
    between = "phase"
    u_gain_pct = 0.3

    [[stated]]                         # values of others, drawn beside ours
    name = "thesis, adopted"
    Kt_Nm_A = 0.0311
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt import readers as importers
from bemt.base.errors import Fault, InputError
from bemt.base.toml import Collector, Key, check_table, load_toml
from bemt.dataset import Dataset
from bemt.drive import motor_constant as mc
from bemt.drive.motor_errors import Measured

__all__ = ["SCHEMA", "MotorTrials", "read", "read_waveform"]

Array = NDArray[np.float64]
SCHEMA = "bemt.motor/1"
_VOLT, _AMP = tuple(mc.VOLTAGES), tuple(mc.CURRENTS)
_PCT = Key(unit="%", low=0.0, high=50.0)
TABLES: dict[str, dict[str, Key]] = {
    "": {"schema": Key("choice", choices=(SCHEMA,), required=True)},
    "motor": {
        "name": Key("text", required=True), "winding": Key("choice", choices=mc.WINDINGS, required=True),
        "kv_rpm_V": Key(unit="rev/min/V", low=1.0, high=50000.0), "kv_tolerance_pct": _PCT,
        "kv_measure": Key("choice", choices=_VOLT), "kv_between": Key("choice", choices=("line", "phase")),
        "pole_pairs": Key("integer", low=1, high=60), "data": Key("text"), "source": Key("text"),
    },
    "result": {"current": Key("choice", choices=_AMP), "between": Key("choice", choices=("line", "phase"))},
    "back_emf": {
        "file": Key("text"), "waveforms": Key("texts"), "measure": Key("choice", choices=_VOLT),
        "between": Key("choice", choices=("line", "phase"), required=True), "u_gain_pct": _PCT,
    },
    "torque": {
        "file": Key("text", required=True), "shunt_ohm": Key(unit="ohm", low=0.01, high=1e5, required=True),
        "u_shunt_pct": _PCT, "low_mA": Key(unit="mA", low=0.0, high=100.0),
        "high_mA": Key(unit="mA", low=0.1, high=100.0),
        "torque_low_Nm": Key(unit="N m", low=-1e4, high=1e4), "torque_high_Nm": Key(unit="N m", low=1e-4, high=1e4),
        "current": Key("choice", choices=_AMP, required=True),
        "between": Key("choice", choices=("line", "phase"), required=True), "u_gain_pct": _PCT,
    },
    "stated": {"name": Key("text", required=True), "Kt_Nm_A": Key(unit="N m/A", low=1e-7, high=1e3, required=True)},
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class MotorTrials:
    """All that was recorded of one motor.

    Parameters
    ----------
    name, data : str
        Of the motor; what the trials are.
    measured : Measured
        Results of the methods as ke.
    to_kt : float
        K_t in the convention asked for, over ke. [N m/A per V s/rad]
    convention : str
        Of K_t, in words.
    stated : mapping of str to float
        Values of others. [N m/A]
    notes : tuple of str
        What a reader has to know.
    files : tuple of Path
        All that was read: motor.toml and its recordings.
    """

    name: str
    data: str
    measured: Measured
    to_kt: float
    convention: str
    stated: Mapping[str, float]
    notes: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()


def read(path: str | Path) -> MotorTrials:
    """Read a motor.toml and its recordings."""
    file = Path(path) / "motor.toml" if Path(path).is_dir() else Path(path)
    out = Collector(file.as_posix())
    doc = load_toml(file, out)
    if doc is None:
        raise InputError(out.faults)
    tops = [name for name in TABLES if name]
    check_table(out, "", {k: v for k, v in doc.items() if k not in tops}, TABLES, subtables=tops)
    for name in ("motor", "result", "back_emf", "torque"):
        if name in doc:
            check_table(out, name, doc[name], TABLES)
    stated = doc.get("stated", [])
    for i, item in enumerate(stated if isinstance(stated, list) else [stated]):
        check_table(out, "stated", item, TABLES, where=f"stated[{i}]")
    if "motor" not in doc:
        out.add("motor", "nothing", "a table [motor]")
    elif not isinstance(doc["motor"], Mapping) or not ({"back_emf", "torque"} & set(doc) or "kv_rpm_V" in doc["motor"]):
        out.add("", "no method", "motor.kv_rpm_V, [back_emf] or [torque]")
    if out.faults:
        raise InputError(out.faults)
    return _built(file, doc, out)


def _built(file: Path, doc: dict[str, Any], out: Collector) -> MotorTrials:
    motor, result = doc["motor"], doc.get("result", {})
    winding, notes = motor["winding"], []
    measure, between = result.get("current", "q_power_invariant"), result.get("between", "phase")
    sheet, u_sheet = None, math.nan
    if "kv_rpm_V" in motor:
        words = motor.get("kv_measure", "peak"), motor.get("kv_between", "line")
        sheet = mc.from_kv(motor["kv_rpm_V"], winding, *words)
        if "kv_tolerance_pct" in motor:
            u_sheet = sheet * motor["kv_tolerance_pct"] / 100.0 / math.sqrt(3.0)
        else:
            notes.append("no tolerance of K_v is stated: the data sheet only bears on convention factors")
    emf = torque = loop = None
    try:
        emf = _back_emf(file, doc["back_emf"], winding, motor.get("pole_pairs")) if "back_emf" in doc else None
    except InputError as error:
        out.faults += error.faults
    try:
        if "torque" in doc:
            torque, loop = _torque(file, doc["torque"], winding)
    except InputError as error:
        out.faults += error.faults
    if out.faults:
        raise InputError(out.faults)
    gains = {name: doc.get(name, {}).get("u_gain_pct") for name in ("back_emf", "torque")}
    notes += [f"no gain uncertainty of {name} is stated: counted as none" for name, u in gains.items()
              if u is None and name in doc]  # fmt: skip
    measured = Measured(
        sheet, u_sheet, emf, torque, (gains["back_emf"] or 0.0) / 100.0, (gains["torque"] or 0.0) / 100.0,
        doc.get("torque", {}).get("u_shunt_pct", 0.0) / 100.0, loop.live_zero_Nm if loop else 0.0,
    )  # fmt: skip
    where = "a winding" if between == "phase" else "a line"
    convention = f"torque per {measure.replace('_', ' ')} current in {where}, {winding}"
    stated = {item["name"]: float(item["Kt_Nm_A"]) for item in doc.get("stated", [])}
    tables = doc.get("back_emf", {}), doc.get("torque", {})
    names = [name for table in tables for name in (table.get("file"), *table.get("waveforms", ())) if name]
    return MotorTrials(motor["name"], motor.get("data", ""), measured, mc.ke_to_kt(1.0, measure, between, winding),
                       convention, stated, tuple(notes), (file, *(file.parent / name for name in names)))  # fmt: skip


def _columns(path: Path, units: tuple[str, ...]) -> tuple[Array, ...]:
    """Column ``trial`` and one column per unit."""
    got = importers.read(path)
    name = path.as_posix()
    if not isinstance(got, Dataset):
        raise InputError(Fault(name, "", "no table of trials", "columns trial, " + ", ".join(units)))
    faults, found = [], []
    for unit in units:
        of_unit = [k for k in got.values if got.unit(k) == unit]
        if len(of_unit) != 1:
            shown = ", ".join(of_unit) or "none"
            faults.append(Fault(name, f"column in {unit}", shown, "one column", "Name the unit in the heading"))
        else:
            found.append(got[of_unit[0]])
    if "trial" not in got:
        faults.append(Fault(name, "trial", "no column trial", "the number of the trial of each row"))
    if faults:
        raise InputError(faults)
    columns = (got["trial"], *found)
    bad = ~np.all(np.isfinite(columns), axis=0)
    if np.any(bad):
        rows = ", ".join(str(got.lines[i] if got.lines else i + 1) for i in np.flatnonzero(bad)[:5])
        raise InputError(Fault(name, rows, "cells without a number", "a number in every cell"))
    return columns


def _back_emf(file: Path, table: Mapping[str, Any], winding: str, pole_pairs: int | None) -> mc.Line:
    if ("file" in table) == ("waveforms" in table):
        raise InputError(Fault(file.as_posix(), "back_emf", "both or neither of file, waveforms", "one of them"))
    if "file" in table:
        if "measure" not in table:
            hint = "peak_to_peak is twice the peak"
            raise InputError(Fault(file.as_posix(), "back_emf.measure", "nothing", f"one of {', '.join(_VOLT)}", hint))
        trial, rpm, volts = _columns(file.parent / table["file"], ("rpm", "V"))
        line = mc.line(rpm * 2.0 * math.pi / 60.0, volts, trial)
        return line.scaled(1.0 / mc.voltage_factor(table["measure"], table["between"], winding))
    if pole_pairs is None:
        raise InputError(Fault(file.as_posix(), "motor.pole_pairs", "nothing", "a whole number, for waveforms"))
    waves = [mc.fit_waveform(*read_waveform(file.parent / name)) for name in table["waveforms"]]
    if len(waves) < 3:
        raise InputError(Fault(file.as_posix(), "back_emf.waveforms", f"{len(waves)} traces", "3 or more"))
    omega = np.array([2.0 * math.pi * w.frequency_Hz / pole_pairs for w in waves])
    peak = np.array([w.amplitude_V for w in waves]) / mc.voltage_factor("peak", table["between"], winding)
    if len(np.unique(np.round(omega, 1))) >= 3:
        return mc.line(omega, peak, np.arange(len(waves)))
    each = peak / omega  # all at one speed: an offset of the amplitude cannot be told
    u2 = float(np.var(each, ddof=1)) / len(each) * (len(each) - 1) / max(len(each) - 3, 0.5)
    cov = np.diag([u2, (10.0 * float(peak.max())) ** 2])
    return mc.Line(float(each.mean()), 0.0, cov, each, np.full(len(each), math.nan), tuple(table["waveforms"]))


def _torque(file: Path, table: Mapping[str, Any], winding: str) -> tuple[mc.Line, mc.TorqueLoop]:
    names = ("low_mA", "high_mA", "torque_low_Nm", "torque_high_Nm")
    loop = mc.TorqueLoop(table["shunt_ohm"], **{k: table[k] for k in names if k in table})
    if loop.high_mA <= loop.low_mA:
        raise InputError(Fault(file.as_posix(), "torque.high_mA", f"{loop.high_mA:g}", "more than low_mA"))
    trial, amps, volts = _columns(file.parent / table["file"], ("A", "V"))
    mA = volts / loop.shunt_ohm * 1e3
    beyond = (mA < loop.low_mA - 1.0) | (mA > loop.high_mA + 2.0)
    if np.mean(beyond) > 0.5:
        got = f"a loop current of {np.median(mA):.3g} mA"
        hint = "Is shunt_ohm right, and the column in volts?"
        raise InputError(
            Fault(file.as_posix(), "torque.shunt_ohm", got, f"{loop.low_mA:g} to {loop.high_mA:g} mA", hint)
        )
    line = mc.line(amps, loop.torque(volts), trial)
    return line.scaled(mc.current_factor(table["current"], table["between"], winding) / 1.5), loop


def read_waveform(path: Path) -> tuple[Array, Array]:
    """Read an oscilloscope's CSV."""
    source = importers.load_text(path)
    split = [[c.strip().strip('"') for c in re.split(r"[,;\t]", line)] for line in source.lines if line.strip()]
    start = next((i for i, c in enumerate(split) if _pair(c, 0)), None)
    at = 0
    if start is None or any(_pair(c, 3) for c in split[:3]):
        start, at = next((i for i, c in enumerate(split) if _pair(c, 3)), None), 3
    if start is None:
        raise InputError(Fault(source.name, "", "no two columns of numbers", "time and voltage"))
    words = " ".join(" ".join(c) for c in (split[:20] if at == 3 else split[:start]))
    scale = [_scale(words, r"(?:s|sec|seconds?)", 1.0), _scale(words, r"(?:v|volts?)", 1.0)]
    if None in scale:
        hint = "Keep the heading lines of the oscilloscope, or write Time (s),CH1 (V)"
        raise InputError(Fault(source.name, "", "no units of time and voltage", "seconds and volts in a heading", hint))
    rows = [c for c in split[start:] if _pair(c, at)]
    data = np.array([[float(c[at]), float(c[at + 1])] for c in rows])
    return data[:, 0] * float(scale[0] or 1.0), data[:, 1] * float(scale[1] or 1.0)


def _pair(cells: list[str], at: int) -> bool:
    return len(cells) > at + 1 and all(importers.number(c) is not None for c in cells[at : at + 2])


def _scale(words: str, unit: str, one: float) -> float | None:
    """Factor to SI of a unit among words, with a prefix; None when it is not there."""
    for prefix, factor in (("m", 1e-3), ("[uµμ]", 1e-6), ("n", 1e-9), ("", one)):
        if re.search(rf"(?<![A-Za-z]){prefix}{unit}(?![A-Za-z])", words, re.IGNORECASE):
            return factor
    return None
