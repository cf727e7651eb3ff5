"""The torque constant by three methods, whether they agree, and why not."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from bemt.base.arrays import Array
from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError, gathered, refuse
from bemt.base.given import inside
from bemt.base.tables import csv_text, json_text, number_text, text_table, write_atomic
from bemt.base.toml import FieldLimits, Table, entry, read_model
from bemt.data import readers as importers
from bemt.data.readers.split import find_delimiter, split_line
from bemt.physics.dataset import Dataset
from bemt.tools.drive import motor_constant, outputs
from bemt.tools.drive import motor_constant as mc
from bemt.tools.drive.motor_constant import Line, Measured

# ``motor.toml``: the recordings of a motor constant and the conventions they were made in.

Volt = Literal["peak", "rms", "peak_to_peak"]
Ampere = Literal["q_power_invariant", "q_amplitude_invariant", "peak", "rms"]
Between = Literal["line", "phase"]
_PCT = FieldLimits("%", 0.0, 50.0)


class MotorHead(Table):
    """[motor]: the machine and its data sheet."""

    name: str = entry("name of the motor", required=True)
    winding: Literal["wye", "delta"] = entry("connection of the phases", required=True)
    kv_rpm_V: float | None = entry("speed constant, for the data sheet method", "rev/min/V", 1.0, 50000.0)
    kv_tolerance_pct: float | None = entry("half-width, stated or assumed; unknown if omitted", _PCT)
    kv_measure: Volt = entry("voltage measure that K_v refers to", default="peak")
    kv_between: Between = entry("where that voltage is measured", default="line")
    pole_pairs: int | None = entry("required with waveforms", low=1, high=60)
    data: str = entry("description of the trials", default="")
    source: str | None = entry("source of the trials")

    @property
    def ke_sheet(self) -> tuple[float | None, float]:
        """Constant of the data sheet and its standard uncertainty, of a uniform tolerance. [V s/rad]"""
        if self.kv_rpm_V is None:
            return None, math.nan
        ke = mc.from_kv(self.kv_rpm_V, self.winding, self.kv_measure, self.kv_between)
        return ke, math.nan if self.kv_tolerance_pct is None else ke * self.kv_tolerance_pct / 100.0 / math.sqrt(3.0)


class ResultTable(Table):
    """[result]: convention for K_t."""

    current: Ampere = entry("current that K_t refers to", default="q_power_invariant")
    between: Between = entry("current in a winding (phase) or a lead (line)", default="phase")


class BackEmfTable(Table):
    """[back_emf]: generator trials."""

    file: str | None = entry("columns trial, rpm, one in V")
    waveforms: tuple[str, ...] | None = entry("oscilloscope traces, one trial each")
    measure: Volt | None = entry("voltage measure in the column in V")
    between: Between = entry("where it is measured", required=True)
    u_gain_pct: float | None = entry("standard uncertainty common to all trials", _PCT)

    def rules(self) -> Iterable[tuple[str, ...]]:
        """One way; a column needs its measure."""
        if (self.file is None) == (self.waveforms is None):
            yield "", "both or neither of file, waveforms", "one of them"
        elif self.file is not None and self.measure is None:
            yield "measure", "nothing", f"one of {', '.join(get_args(Volt))}", "peak_to_peak is twice the peak"
        elif self.waveforms is not None and len(self.waveforms) < 3:
            yield "waveforms", f"{len(self.waveforms)} traces", "3 or more"


class TorqueTable(Table):
    """[torque]: trials with a torque sensor on a current loop."""

    file: str = entry("columns trial, one in A, one in V", required=True)
    shunt_ohm: float = entry(
        "shunt that converts the loop current into the column in V", "ohm", 0.01, 1e5, required=True
    )
    u_shunt_pct: float = entry("its standard uncertainty", _PCT, default=0.0)
    low_mA: float = entry("current at torque_low_Nm", "mA", 0.0, 100.0, default=4.0)
    high_mA: float = entry("current at torque_high_Nm", "mA", 0.1, 100.0, default=20.0)
    torque_low_Nm: float = entry("lower limit of the sensor", "N m", -1e4, 1e4, default=0.0)
    torque_high_Nm: float = entry("upper limit of the sensor", "N m", 1e-4, 1e4, default=2.0)
    current: Ampere = entry("current measure in the column in A", required=True)
    between: Between = entry("where it is measured", required=True)
    u_gain_pct: float | None = entry("standard uncertainty common to all trials", _PCT)

    def rules(self) -> Iterable[tuple[str, ...]]:
        """Ends of the loop in order."""
        if self.high_mA <= self.low_mA:
            yield "high_mA", f"{self.high_mA:g}", "more than low_mA"


class StatedTable(Table):
    """[[stated]]: a published value, plotted for comparison."""

    name: str = entry("whose", required=True)
    Kt_Nm_A: float = entry("torque constant", "N m/A", 1e-7, 1e3, required=True)


class MotorToml(Table):
    """motor.toml: the recordings of a motor constant and the conventions they were made in."""

    schema_: Literal["bemt.motor/1"] = entry("version of the format", required=True, alias="schema")
    motor: MotorHead
    result: ResultTable = ResultTable()
    back_emf: BackEmfTable | None = None
    torque: TorqueTable | None = None
    stated: tuple[StatedTable, ...] = ()

    def rules(self) -> Iterable[tuple[str, ...]]:
        """One method or more; waveforms need the pole pairs."""
        if self.back_emf is None and self.torque is None and self.motor.kv_rpm_V is None:
            yield "", "no method", "motor.kv_rpm_V, [back_emf] or [torque]"
        if self.back_emf is not None and self.back_emf.waveforms and self.motor.pole_pairs is None:
            yield "motor.pole_pairs", "nothing", "a whole number, for waveforms"

    @property
    def files(self) -> dict[str, str]:
        """Names of the recordings by key."""
        emf, torque = self.back_emf, self.torque
        named = {"back_emf.file": emf and emf.file, "torque.file": torque and torque.file}
        named |= {f"back_emf.waveforms[{i}]": name for i, name in enumerate((emf and emf.waveforms) or ())}
        return {where: name for where, name in named.items() if name}

    @property
    def gains(self) -> dict[str, float | None]:
        """Stated uncertainty of the gain of each recorded method. [%]"""
        tables = {"back_emf": self.back_emf, "torque": self.torque}
        return {name: table.u_gain_pct for name, table in tables.items() if table}


@dataclass(frozen=True, eq=False)
class MotorTrials:
    """All that was recorded of one motor."""

    name: str
    data: str  # what the trials are
    measured: Measured  # results of the methods as ke
    to_kt: float  # K_t in the convention asked for, over ke [N m/A per V s/rad]
    convention: str  # of K_t, in words
    stated: Mapping[str, float]  # values of others [N m/A]
    notes: tuple[str, ...] = ()  # what a reader has to know
    files: tuple[Path, ...] = ()  # all that was read, motor.toml first


def read(path: str | Path) -> MotorTrials:
    """Read a motor.toml and its recordings."""
    file = Path(path) / "motor.toml" if Path(path).is_dir() else Path(path)
    made = read_model(MotorToml, file)
    motor, result, emf_table, torque_table = made.motor, made.result, made.back_emf, made.torque
    winding, names = motor.winding, made.files
    sheet, u_sheet = motor.ke_sheet
    far = {where: name for where, name in names.items() if not inside(file.parent, name)}
    expected = "the name of a file in the folder of the motor.toml"
    refuse(Fault(file.as_posix(), k, repr(v), expected, "Copy it there") for k, v in far.items())
    faults: list[Fault] = []
    emf = torque = loop = None
    with gathered(faults):
        emf = None if emf_table is None else _back_emf(file, emf_table, winding, motor.pole_pairs)
    with gathered(faults):
        if torque_table is not None:
            torque, loop = _torque(file, torque_table, winding)
    refuse(faults)
    gains = made.gains
    notes = [f"no gain uncertainty of {name} is stated: counted as none" for name, u in gains.items() if u is None]
    if motor.kv_rpm_V is not None and motor.kv_tolerance_pct is None:
        notes.insert(0, "no tolerance of K_v is stated: the data sheet only bears on convention factors")
    measured = Measured(
        sheet, u_sheet, emf, torque, (gains.get("back_emf") or 0.0) / 100.0, (gains.get("torque") or 0.0) / 100.0,
        torque_table.u_shunt_pct / 100.0 if torque_table else 0.0, loop.live_zero_Nm if loop else 0.0,
    )  # fmt: skip
    where = "a winding" if result.between == "phase" else "a line"
    convention = f"torque per {result.current.replace('_', ' ')} current in {where}, {winding}"
    stated = {item.name: item.Kt_Nm_A for item in made.stated}
    to_kt = mc.ke_to_kt(1.0, result.current, result.between, winding)
    files = (file, *(file.parent / name for name in names.values()))
    return MotorTrials(motor.name, motor.data, measured, to_kt, convention, stated, tuple(notes), files)


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
    refuse(faults)
    columns = (got["trial"], *found)
    bad = ~np.all(np.isfinite(columns), axis=0)
    if np.any(bad):
        rows = ", ".join(str(got.lines[i] if got.lines else i + 1) for i in np.flatnonzero(bad)[:5])
        raise InputError(Fault(name, rows, "cells without a number", "a number in every cell"))
    return columns


def _back_emf(file: Path, table: BackEmfTable, winding: str, pole_pairs: int | None) -> mc.Line:
    if table.file is not None and table.measure is not None:
        trial, rpm, volts = _columns(file.parent / table.file, ("rpm", "V"))
        line = mc.line(rpm * 2.0 * math.pi / 60.0, volts, trial)
        return line.scaled(1.0 / mc.voltage_factor(table.measure, table.between, winding))
    names = table.waveforms or ()
    waves = [mc.fit_waveform(*read_waveform(file.parent / name)) for name in names]
    omega = np.array([2.0 * math.pi * w.frequency_Hz / (pole_pairs or 1) for w in waves])
    peak = np.array([w.amplitude_V for w in waves]) / mc.voltage_factor("peak", table.between, winding)
    if len(np.unique(np.round(omega, 1))) >= 3:
        return mc.line(omega, peak, np.arange(len(waves)))
    each = peak / omega  # all at one speed: an offset of the amplitude cannot be told
    u2 = float(np.var(each, ddof=1)) / len(each) * (len(each) - 1) / max(len(each) - 3, 0.5)
    cov = np.diag([u2, (10.0 * float(peak.max())) ** 2])
    return mc.Line(float(each.mean()), 0.0, cov, each, np.full(len(each), math.nan), names)


def _torque(file: Path, table: TorqueTable, winding: str) -> tuple[mc.Line, mc.TorqueLoop]:
    loop = mc.TorqueLoop(table.shunt_ohm, table.low_mA, table.high_mA, table.torque_low_Nm, table.torque_high_Nm)
    trial, amps, volts = _columns(file.parent / table.file, ("A", "V"))
    mA = volts / loop.shunt_ohm * 1e3
    beyond = (mA < loop.low_mA - 1.0) | (mA > loop.high_mA + 2.0)
    if np.mean(beyond) > 0.5:
        got = f"a loop current of {np.median(mA):.3g} mA"
        hint = "Is shunt_ohm right, and the column in volts?"
        fault = Fault(file.as_posix(), "torque.shunt_ohm", got, f"{loop.low_mA:g} to {loop.high_mA:g} mA", hint)
        raise InputError(fault)
    line = mc.line(amps, loop.torque(volts), trial)
    return line.scaled(mc.current_factor(table.current, table.between, winding) / 1.5), loop


def read_waveform(path: Path) -> tuple[Array, Array]:
    """Read an oscilloscope's CSV."""
    source = importers.load_text(path)
    lines = [line for line in source.lines if line.strip()]
    mark = find_delimiter(lines[-5:])
    split = [split_line(line, mark) for line in lines]
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


RESULTS = ("motor.json", "trials.csv", "motor.png")
TITLES = {"data_sheet": "data sheet", "back_emf": "back-EMF", "torque": "torque sensor"}


class MethodResult(Documented):
    """K_t by one method, in the convention asked for [N m/A]."""

    method: str
    n: int
    mean: float
    u: float
    sigma3: float
    interval95: tuple[float, float]
    intercept: float
    u_intercept: float
    trials: tuple[float, ...]

    @property
    def values(self) -> tuple[float, ...]:
        """Of its trials, or the one value."""
        return self.trials or (self.mean,)


class Explained(Documented):
    """Errors that make the methods agree, with the K_t that is left."""

    errors: tuple[str, ...]
    sizes: tuple[float, ...]
    u_sizes: tuple[float, ...]
    Kt: float
    u_Kt: float
    chi2: float
    p: float


class MotorResult(Documented):
    """``bemt.motor.result/1``: K_t by all methods, and whether they agree."""

    name: str
    data: str
    convention: str
    methods: tuple[MethodResult, ...]
    agree: bool
    p_of_agreement: float
    explanations: tuple[Explained, ...]
    named: tuple[str, ...]
    Kt: float | None
    u_Kt: float | None
    stated: Mapping[str, float]
    notes: tuple[str, ...]

    def document(self) -> dict[str, Any]:
        """Plain values."""
        return {"schema": "bemt.motor.result/1", **super().document()}


def _method(name: str, line: Line, u_gain: float, to_kt: float) -> MethodResult:
    mean, u = line.slope, math.hypot(math.sqrt(line.cov[0, 0]), u_gain * line.slope)
    return MethodResult(
        name, len(line.slopes), mean * to_kt, u * to_kt, 3.0 * line.sd * to_kt,
        ((mean - 1.96 * u) * to_kt, (mean + 1.96 * u) * to_kt), line.intercept, float(math.sqrt(line.cov[1, 1])),
        tuple(float(v) * to_kt for v in line.slopes),
    )  # fmt: skip


def result(trials: MotorTrials, verdict: motor_constant.Verdict) -> MotorResult:
    """All results."""
    m, to = trials.measured, trials.to_kt
    methods: list[MethodResult] = []
    if m.data_sheet is not None:
        K, u = m.data_sheet * to, m.u_data_sheet * to
        span = (K - 1.96 * u, K + 1.96 * u)
        methods.append(MethodResult("data_sheet", 1, K, u, math.nan, span, math.nan, math.nan, ()))
    if m.back_emf is not None:
        methods.append(_method("back_emf", m.back_emf, m.u_gain_back_emf, to))
    if m.torque is not None:
        methods.append(_method("torque", m.torque, math.hypot(m.u_gain_torque, m.u_shunt), to))
    best = verdict.none if verdict.agree else verdict.explanations[0] if len(verdict.explanations) == 1 else None
    explained = tuple(Explained(tuple(e.names), tuple(e.sizes), tuple(e.u_sizes), e.ke * to, e.u_ke * to, e.chi2, e.p)
                      for e in verdict.explanations)  # fmt: skip
    return MotorResult(
        trials.name, trials.data, trials.convention, tuple(methods), verdict.agree, verdict.none.p, explained,
        tuple(verdict.named), best.ke * to if best else None, best.u_ke * to if best else None, dict(trials.stated),
        tuple(trials.notes),
    )  # fmt: skip


_UNITS = {
    "back_emf.offset": "V", "torque.offset": "N m", "torque.shunt": "times the resistor assumed",
    "data_sheet.gain": "times", "back_emf.gain": "times", "torque.gain": "times",
}  # fmt: skip


def verdict_text(made: MotorResult) -> list[str]:
    """The verdict in words."""
    if made.agree:
        return [f"the methods agree (p = {made.p_of_agreement:.2g}); this does not exclude an error common to all"]
    lines = [f"the methods do not agree (p = {made.p_of_agreement:.1g})"]
    if not made.explanations:
        return [*lines, "no offset, resistor, convention factor or gain, nor any pair of them, explains it"]
    for e in made.explanations:
        parts = [
            f"{name} {size:.4g} ± {1.96 * u:.2g} {_UNITS.get(name, '')}".rstrip()
            if u
            else f"{name}: its value is {size:.4g} times too large"
            for name, size, u in zip(e.errors, e.sizes, e.u_sizes, strict=True)
        ]
        lines.append(f"explained by {' and '.join(parts)}: K_t = {e.Kt:.4f} ± {1.96 * e.u_Kt:.1g} N m/A")
    if len(made.explanations) > 1:
        lines.append("these explain the trials equally well; the trials cannot distinguish them, so none is named")
    names = {name for e in made.explanations for name in e.errors}
    if any(name.endswith("gain") for name in names):
        lines.append("a gain error is not an offset, resistor or convention error: look for a wrong calibration")
    if "torque.offset" in names:
        text = "a torque offset is the zero of the sensor, friction or cogging: the trials alone do not show which"
        lines.append(text)
    return lines


def text(made: MotorResult) -> str:
    """Lay the results out for a terminal."""
    rows = []
    for m in made.methods:
        low, high = m.interval95
        interval = f"{low:.5f} to {high:.5f}" if math.isfinite(low) else "unknown"
        zero = f"{m.intercept:.3g} ± {1.96 * m.u_intercept:.2g}" if math.isfinite(m.intercept) else "-"
        unit = {"back_emf": " V", "torque": " N m"}.get(m.method, "")
        rows.append([TITLES[m.method], str(m.n), number_text(m.mean), number_text(m.sigma3, 3), interval, zero + unit])
    head = ["method", "trials", "K_t [N m/A]", "3 sigma", "95 % of the mean", "intercept"]
    lines = [made.name + (f" ({made.data})" if made.data else ""), made.convention, text_table(head, rows)]
    lines += [f"stated: {name} {value:.4f}" for name, value in made.stated.items()]
    lines += verdict_text(made)
    if made.Kt is not None and made.u_Kt is not None:
        lines.append(f"K_t = {made.Kt:.5f} ± {1.96 * made.u_Kt:.2g} N m/A (95 %)")
    return "\n".join(lines + [f"! {note}" for note in made.notes]) + "\n"


def judge(file: str, out: str | None = None) -> MotorResult:
    """Read trials and judge them; written where told, over no input."""
    trials = read(file)
    if out:
        outputs.check("--out", Path(out), RESULTS, trials.files)
    made = result(trials, motor_constant.judge(trials.measured))
    if out:
        folder, names = Path(out), ["method", "trial", "Kt_Nm_A"]
        write_atomic(folder / "motor.json", json_text(made.document()))
        rows = [(m.method, t, v) for m in made.methods for t, v in enumerate(m.values, 1)]
        write_atomic(folder / "trials.csv", csv_text(names, [dict(zip(names, row, strict=True)) for row in rows]))
        title = f"{made.name}: {made.data}" if made.data else made.name
        values = {TITLES[m.method]: np.array(m.values) for m in made.methods}
        write_atomic(folder / "motor.png", outputs.box_plot(values, made.stated, "torque constant [N m/A]", title))
    return made
