"""What a sweep keeps in its folder: results that know their content, of one sweep at a time.

``DIR/<case>`` holds ``result.json``, ``table.txt`` and, when the case sweeps axes, ``grid.csv``.
A result says what it was made from (its fingerprint) and what it was when it was written (SHA-256 of itself and of the
grid); one that was edited, cut off or made from something else is never used. It is removed before the case is solved
anew, so that no reader takes an old one for the answer of a case that has failed or was interrupted.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import bemt
from bemt.base.errors import Fault, InputError
from bemt.base.tables import csv_text, file_hash, json_text, number_of, number_text, text_table, write_atomic
from bemt.physics import coefficients as co
from bemt.results.sweep.rows import ROW_SOURCES, Fan, GridResult, PairResult, Result, Row, Sweep

# Tables of a sweep for terminals and spreadsheets.

WIDTH = 118
CSV_COLUMNS = (
    "case", "source", "label", "rpm", "airspeed_m_s", "density_kg_m3", "thrust_N", "thrust_kgf", "u", "u_num",
    "u_input", "u_model", "torque_Nm", "power_W", "CT", "CP", "J", "M_tip", "Re", "exhaust_speed_m_s", "duct_share",
    "angle_deg", "H_force_N", "upper_thrust_N", "lower_thrust_N", "bemt_error_pct", "bemt_u_val", "k1k2_error_pct",
    "k1k2_u_val", "converged", "flags", "origin", "remark",
)  # fmt: skip


def _n(value: Any, digits: int = 4) -> str:
    return number_text(None if value is None else float(value), digits)


def _pct(value: Any) -> str:
    return "-" if value is None or math.isnan(value) else f"{value:+.1f}"


def _wrap(text: str, indent: str, first: str = "") -> str:
    lines = textwrap.wrap(" ".join(text.split()), WIDTH, initial_indent=indent + first,
                          subsequent_indent=indent + " " * len(first), break_long_words=False)  # fmt: skip
    return "\n".join(lines)


def _u_val(row: Row) -> str:
    value = row.bemt_u_val
    return "" if value is None else "unknown" if math.isnan(value) else _n(value, 3)


def _main_table(result: Result) -> str:
    header = ["source", "rpm", "V m/s", "T kgf", "T N", "u N", "Q N m", "CT", "CP", "FM", "M_tip", "Re75",
              "BEMT err %", "K1K2 err %", "u_val N", "flags"]  # fmt: skip
    notes: list[str] = []
    body = []
    for row in result.all_rows:
        marks = []
        for flag in row.flags:
            if flag not in notes:
                notes.append(flag)
            marks.append(str(notes.index(flag) + 1))
        body.append([
            row.label, f"{row.rpm:g}", f"{row.airspeed_m_s:g}", _kgf(row.thrust_kgf), _n(row.thrust_N),
            _u(row.u), _n(row.torque_Nm),
            _n(row.CT), _n(row.CP), _n(co.FM(row.CT, row.CP, row.airspeed_m_s), 3), _n(row.M_tip, 3), _n(row.Re, 3),
            _pct(row.bemt_error_pct),
            _pct(row.k1k2_error_pct), _u_val(row), ",".join(marks),
        ])  # fmt: skip
    if len(result.densities) > 1:
        header.insert(3, "kg/m3")
        for cells, row in zip(body, result.all_rows, strict=True):
            cells.insert(3, _n(row.density_kg_m3))
    if angle := result.at.angle_deg:
        header[3:3] = ["angle deg", "H N"]
        for cells, row in zip(body, result.all_rows, strict=True):
            cells[3:3] = [f"{angle:g}", _n(row.H_force_N)]
    table = text_table(header, body, left=(0, len(header) - 1), indent="  ")
    return "\n".join([table, *(_wrap(note, "    ", f"{i}: ") for i, note in enumerate(notes, 1))])


def _kgf(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3f}"


def _ends(values: Sequence[float]) -> str:
    """Show the results at both ends of a range, or the extremes over many values."""
    return " .. ".join(map(_n, values if len(values) == 2 else (min(values), max(values))))


def _assumption_table(result: Result) -> str:
    rows = [
        [a.key, f"{a.nominal:g}" if isinstance(a.nominal, (int, float)) else str(a.nominal), a.range,
         _ends(a.thrust_N), _n(a.u_thrust_N, 2), a.why]
        for a in result.assumptions
    ]  # fmt: skip
    header = ["assumed (not stated by the source)", "value", "range", "T N over the range", "u N", "why"]
    shown = [row[:-1] for row in rows]
    table = text_table(header[:-1], shown, left=(0,), indent="  ").split("\n")
    reasons = [_wrap(str(row[-1]), "      ") for row in rows]
    return "\n".join([table[0], *(f"{line}\n{why}" for line, why in zip(table[1:], reasons, strict=True))])


def _comparison_lines(result: Result) -> list[str]:
    """BEMT against every recorded value, with uncertainties."""
    rows = []
    for c in result.comparisons:
        if c.model != "k1k2" and c.source in ROW_SOURCES:
            error = "-" if math.isnan(c.E) else f"{c.E:+.4g}"
            us = [_n(c.u_num, 2), _n(c.u_input, 2), _n(c.u_model, 2), _u(c.u_D), _u(c.u_val)]
            rows.append([c.model, c.reference, c.quantity, _n(c.S), _n(c.D), error, _pct(c.E_pct), *us, c.verdict])
    if not rows:
        return []
    us = ["u_num", "u_input", "u_model", "u_D", "u_val"]
    header = ["E = S - D", "against", "quantity", "S", "D", "E", "E %", *us, "verdict"]
    return ["", text_table(header, rows, left=(0, 1, 2, 12), indent="  ")]


def _audit_lines(result: Result) -> list[str]:
    """How the set-up of every recorded CFD value affects its uncertainty."""
    out: list[str] = []
    for item in result.audit:
        whole, known = _share(item.u_relative), item.u_relative_known
        rest = f"known parts together {_share(known)}" if known else "no part known"
        out += ["", _wrap(f"audit of {item.reference}: u of its thrust {whole}; {rest}", "  ")]
        for line in item.lines:
            words = f"{line.status}, u {_share(line.u_relative)}: {line.finding}; {line.consequence}"
            if line.finding.endswith("not stated") and line.consequence == "unknown":
                words = "not stated"
            out.append(_wrap(words, "    ", f"{line.topic}: "))
    return out


def _share(value: float) -> str:
    return "unknown" if math.isnan(value) else f"{100 * value:.1f} %"


def _u(value: float) -> str:
    return "unknown" if math.isnan(value) else _n(value, 2)


def _fan_lines(fan: Fan | None) -> list[str]:
    if fan is None:
        return []
    return [
        "",
        f"  duct: rotor {_n(fan.rotor_thrust_N)} N + duct {_n(fan.duct_thrust_N)} N + stator "
        f"{_n(fan.stator_thrust_N)} N; duct share {_n(100 * fan.duct_share, 3)} %; blade solidity of the annulus "
        f"{_n(fan.annulus_solidity, 3)}",
        f"  mass flow {_n(fan.mass_flow_kg_s)} kg/s; exhaust {_n(fan.exhaust_speed_m_s)} m/s "
        f"(u {_n(fan.u_exhaust_speed_m_s, 2)}); pitch speed {_n(fan.geometric_pitch_speed_m_s)} m/s",
        f"  momentum through the exit {_n(fan.exit_momentum_N)} N; pressure in the exit plane and on the outer wall "
        f"{_n(fan.exit_pressure_N, 3)} N",
    ]


def _pair_lines(pair: PairResult | None) -> list[str]:
    if pair is None:
        return []
    turns = "turns against the first" if pair.turns == "opposite" else "turns as the first"
    loads = "; ".join(
        f"{name} rotor {_n(T)} N (u {_n(u_T, 2)}), {_n(Q)} N m, {_n(100 * ratio, 3)} % of its thrust alone "
        f"(u {_n(100 * u_ratio, 2)})"
        for name, T, u_T, Q, ratio, u_ratio in (
            ("first", pair.upper_thrust_N, pair.u_upper_thrust_N, pair.upper_torque_Nm, pair.upper_thrust_ratio,
             pair.u_upper_thrust_ratio),
            ("second", pair.lower_thrust_N, pair.u_lower_thrust_N, pair.lower_torque_Nm, pair.lower_thrust_ratio,
             pair.u_lower_thrust_ratio),
        )
    )  # fmt: skip
    head = f"second rotor: {pair.rotor}, {turns}, {_n(pair.lower_rpm)} rev/min, z/D {_n(pair.z_over_D, 3)}"
    rest = f"torque about the axis {_n(pair.reaction_torque_Nm)} N m. T, Q, CT and CP above are of both"
    return ["", _wrap(f"{head}; {loads}; {rest}", "  ")]


def _grid_lines(grid: GridResult | None) -> list[str]:
    if grid is None:
        return []
    axes = ", ".join(f"{k} {v.num} x {v.min:g} .. {v.max:g}" for k, v in grid.axes.items())
    low, high = grid.thrust_N
    where = f"; {grid.file}" if grid.file else "; saved with --out DIR"
    slow, fast = grid.M_tip
    line = (
        f"grid: {axes}: {grid.points} points, {grid.unconverged} unconverged, "
        f"thrust {_n(low)} .. {_n(high)} N, tip Mach {_n(slow, 3)} .. {_n(fast, 3)}{where}"
    )
    return ["", _wrap(line, "  ")]


def case_text(result: Result) -> str:
    """Table of one case."""
    if not result.rows:
        return "\n".join([f"{result.name}: not solved", *(f"  {fault}" for fault in result.faults)])
    c = result.at
    head = (
        f"D {_n(c.diameter_m)} m, hub {_n(c.hub_diameter_m)} m, {c.blades} blades, pitch at 0.75 R "
        f"{_n(c.pitch_075R_m)} m, solidity {_n(c.solidity, 3)}; {_n(c.density_kg_m3)} kg/m3, "
        f"{_n(c.temperature_C, 3)} degC; {c.convention}; {c.stations} stations, n_crit {c.n_crit:g}, "
        f"section drag x {c.drag_level:g}"
    )
    lines = [f"{result.name}: {result.title}", _wrap(head, "  "), _wrap("effects: " + ", ".join(c.effects), "  ")]
    if result.drive:
        lines += ["", _wrap(result.drive.text, "  "), ""]
    lines += [
        _main_table(result), *_fan_lines(result.fan), *_pair_lines(result.pair), *_comparison_lines(result),
        *_audit_lines(result),
    ]  # fmt: skip
    if result.assumptions:
        bemt = result.rows[0]
        low, high = bemt.thrust_N_range or (math.nan, math.nan)
        lines += ["", _assumption_table(result)]
        parts = ", ".join(f"{k} {_n(getattr(bemt, k), 3)} N" for k in ("u_input", "u_model", "u_num"))
        lines += [f"  together: {parts}; varied one at a time, thrust is {_n(low)} to {_n(high)} N"]
    lines += _grid_lines(result.grid)
    lines += [_wrap(note, "  ", "note: ") for note in (*(result.no_check or ()), *result.notes)]
    return "\n".join(lines)


def overview_text(results: Sequence[Result]) -> str:
    """Table over all cases."""
    header = ["case", "source", "T kgf", "T N", "CT", "CP", "M_tip", "Re75", "BEMT err %", "K1K2 err %", "flags"]
    body = []
    for result in results:
        if not result.rows:
            body.append([result.name, "not solved", *[""] * 8, number_of(len(result.faults), "fault")])
        for row in result.all_rows:
            count = len(row.flags)
            body.append([
                result.name, row.label, _kgf(row.thrust_kgf), _n(row.thrust_N), _n(row.CT),
                _n(row.CP), _n(row.M_tip, 3), _n(row.Re, 3),
                _pct(row.bemt_error_pct), _pct(row.k1k2_error_pct),
                f"{count} flags" if count > 1 else "1 flag" if count else "",
            ])  # fmt: skip
    return text_table(header, body, left=(0, 1, 10))


def rows_csv(results: Sequence[Result]) -> str:
    """All rows of all cases as CSV."""
    rows = [{"case": r.name, **row.document()} for r in results for row in r.all_rows]
    return csv_text(CSV_COLUMNS, rows)


SCHEMA = "bemt.sweep/1"
OVERVIEW = ("sweep.csv", "sweep.txt", "sweep.json")
"""Files over all cases, in the order in which they are written."""
RESULT, TABLE, LOCK = "result.json", "table.txt", ".sweep.lock"


def fingerprint(content: str) -> str:
    """Identity of everything that decides a result."""
    return hashlib.sha256(f"{SCHEMA} {program_hash()} {content}".encode()).hexdigest()


def _seal(stored: Mapping[str, Any]) -> str:
    return hashlib.sha256(json_text(stored).encode(errors="backslashreplace")).hexdigest()


def reuse(folder: Path, mark: str) -> Result | None:
    """Take up the result of an earlier sweep; its table is written anew."""
    try:
        stored = json.loads((folder / RESULT).read_text(encoding="utf-8"))
        seal = stored.pop("sha256")
        if stored["fingerprint"] != mark or seal != _seal(stored):
            return None
        result = Result.from_document(stored["result"])
        if result.grid is not None and file_hash(folder / "grid.csv") != result.grid.sha256:
            return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    write_atomic(folder / TABLE, case_text(result) + "\n")
    return result


def keep(folder: Path, mark: str, result: Result) -> None:
    """Write table and result; the result comes last, so its presence marks completion."""
    stored = {"fingerprint": mark, "result": result.document()}
    write_atomic(folder / TABLE, case_text(result) + "\n")
    write_atomic(folder / RESULT, json_text({**stored, "sha256": _seal(stored)}))


def remove_result(folder: Path) -> None:
    """Remove the result of a case; finished chunks of its grid, which only their fingerprint makes a result, stay."""
    for name in (RESULT, TABLE, "grid.csv"):
        with suppress(FileNotFoundError, NotADirectoryError):
            (folder / name).unlink()


def clear_overview(folder: Path) -> None:
    """Remove the files over all cases, and what a kill left of them: they stand there only when a sweep has ended."""
    for path in (*(folder / name for name in OVERVIEW), *folder.glob(".sweep.*.tmp")):
        path.unlink(missing_ok=True)


def keep_overview(folder: Path, found: Sweep) -> None:
    """Write the files over all cases."""
    texts = (rows_csv(found.cases), overview_text(found.cases) + "\n", json_text(found.document()))
    for name, text in zip(OVERVIEW, texts, strict=True):
        write_atomic(folder / name, text)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a whole folder of results for one sweep; InputError when another one holds it.

    The lock is the system's, on an open file: it ends with the process, however that ends.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(folder / LOCK, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        got, hint = "a folder in use by another sweep", "Wait for the other one, or give another --out"
        raise InputError(Fault(str(folder), "", got, "one for this sweep", hint)) from None
    try:
        yield
    finally:
        with suppress(OSError):  # Windows keeps open files: there it stays
            (folder / LOCK).unlink()
        lock.release()


@lru_cache(maxsize=1)
def program_hash() -> str:
    """Hash of the program text and of the libraries that decide numbers."""
    digest = hashlib.sha256(bemt.__version__.encode())
    here = Path(bemt.__file__).parent
    for folder in (here, here.parent / "geometry"):
        for path in sorted(folder.rglob("*.py")):
            digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    for library in ("numpy", "numba", "neuralfoil"):
        try:
            digest.update(f"{library} {importlib.metadata.version(library)}\0".encode())
        except importlib.metadata.PackageNotFoundError:
            digest.update(f"{library} absent\0".encode())
    return digest.hexdigest()
