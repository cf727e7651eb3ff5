"""Ten thousand injured recordings: read and reduced, or refused; never a traceback.

And never a silent drop: every line below the heading is a row, every row is in one point or in what was dropped.
"""

from __future__ import annotations

import json
import math
import random
import re
from collections import Counter
from pathlib import Path

import pytest

from bemt.base.errors import InputError
from bemt.data.recordings.adapt import findings, is_recording, reduction_of
from bemt.data.recordings.channels import named
from bemt.data.recordings.load import import_file
from bemt.data.recordings.reduce import reduction
from bemt.data.recordings.shown import points_text, reduction_document
from bemt.physics.dataset import Dataset

INJURIES = (
    "cut", "garble", "bytes", "encoding", "huge", "tiny", "swap columns", "drop column", "double column", "rename",
    "swap rows", "double row", "drop row", "delimiter", "decimal comma", "words", "empty cells", "signs", "blank",
    "nothing",
)  # fmt: skip
HUGE = ["1e308", "-1e308", "9e99", "1e15", "-1e12", "1e999", "nan", "inf", "-inf", "1" + "0" * 300]
WORDS = ["--", "n/a", "ERR", "#REF!", "12 V", "0x1F", "1_000", "٣", "²", "1.2.3", "+-4", "é", "=A1", '"', "'"]
HEADS = ["Thrust (g)", "thrust_lbf", "T(N)", "rpm", "eRPM", "u_thrust_N", "run", "time_s", "x", "", "Torque (N·m)"]
HEADS += ["pwm_us", "humidity_pct", "pressure_Pa", "temperature_C", "u_rpm", "P(W)", "J", "CT", "thrust_err_N"]


def log_text(rows: int = 60, mark: str = ",") -> str:
    """Continuous log: rest, two levels, rest."""
    out = [mark.join(["time_s", "pwm_us", "rpm", "thrust_N", "torque_Nm", "voltage_V", "current_A"])]
    for k in range(rows):
        level = (0, 1, 2, 0)[4 * k // rows]
        rpm = 3000.0 * level + (k % 3 if level else 0)
        cells = [
            0.02 * k, 1000 + 300 * level, rpm, 2e-7 * rpm**2 + 0.01 * (k % 5), 3e-9 * rpm**2, 15.0 - level,
            4.0 * level,
        ]  # fmt: skip
        out.append(mark.join(f"{c:.6g}" for c in cells))
    return "\n".join(out) + "\n"


def points_csv(rows: int = 14) -> str:
    """Table of steady points with the columns of the diagnosis."""
    head = (
        "run,rpm,airspeed_m_s,thrust_N,u_thrust_N,torque_Nm,power_W,temperature_C,pressure_Pa,humidity_pct,tip_gap_mm"
    )
    out = [head]
    for k in range(rows):
        rpm = 3000.0 + 400 * (k % 7)
        q = 3e-9 * rpm**2
        cells = [1 + k // 7, rpm, 0.0, 2e-7 * rpm**2, 0.01, q, q * rpm * math.pi / 30, 21.5, 99800, 45, 0.4]
        out.append(",".join(f"{c:.8g}" for c in cells))
    return "\n".join(out) + "\n"


def stand_text(rows: int = 14) -> str:
    """Step test as an RCbenchmark stand writes it."""
    out = ["Time (s),ESC signal (µs),Torque (N·m),Thrust (gf),Voltage (V),Current (A),Motor Electrical Speed (RPM),"
           "Motor Optical Speed (RPM),Electrical Power (W),Mechanical Power (W),App message,"]  # fmt: skip
    for k in range(rows):
        rpm = 400.0 * k
        q = 3e-9 * rpm**2
        shaft = q * rpm * math.pi / 30
        cells = [3.5 * k, 1000 + 50 * k, q, 2e-5 * rpm**2, 11.1, shaft / 8, rpm, 0, shaft / 0.72, shaft]
        out.append(",".join(f"{c:.8g}" for c in cells) + ",,")
    return "\ufeff" + "\n".join(out) + "\n"


def maker_text(rows: int = 12) -> str:
    """Table of the thrust_tool stand."""
    out = ["out,th,th_err,tq,tq_err,rpm,rpm_err,v,v_err,a,a_err,pin,theff"]
    for k in range(rows):
        rpm, v, a = 4000.0 + 900 * k, 12.0 - 0.1 * k, 0.5 + 0.8 * k
        th = 4e-6 * rpm**2
        cells = [20 + 6 * k, th, 0.5, 1.5e-6 * rpm**2, 1, rpm, 20, v, 0.004, a, 0.03, v * a, th / (v * a)]
        out.append(",".join(f"{c:.6g}" for c in cells))
    return "\n".join(out) + "\n"


BASES = {"log.csv": log_text(), "log_semicolon.csv": log_text(40, ";"), "points.csv": points_csv(),
         "stand.csv": stand_text(), "maker.csv": maker_text(), "short.csv": log_text(8)}  # fmt: skip


def _mark(text: str) -> str:
    return ";" if ";" in text.split("\n", 1)[0] else ","


def injure(text: str, what: str, rng: random.Random) -> str | bytes:
    """One injury of the named kind."""
    mark = _mark(text)
    lines = text.split("\n")
    rows = [line.split(mark) for line in lines]
    row = rows[rng.randrange(len(rows))]
    cell, width = rng.randrange(len(row)), len(rows[0])
    one, two = rng.randrange(width), rng.randrange(width)
    at = rng.randrange(len(text) + 1)
    match what:
        case "cut":
            return text[:at]
        case "garble":
            return (
                text[:at]
                + "".join(chr(rng.choice([*range(32, 127), 233, 0x2028, 0x1F600])) for _ in range(9))
                + text[at + 5 :]
            )
        case "bytes":
            raw = bytearray(text.encode())
            for _ in range(rng.randint(1, 5)):
                raw[rng.randrange(len(raw))] = rng.randrange(256)
            return bytes(raw)
        case "encoding":
            return text.encode(
                rng.choice(["utf-16", "utf-16-le", "utf-32", "latin-1", "utf-8-sig", "cp1252"]), "replace"
            )
        case "huge":
            row[cell] = rng.choice(HUGE)
        case "tiny":
            row[cell] = rng.choice(["1e-320", "-0", "0", "5e-324", "1e-30"])
        case "words":
            row[cell] = rng.choice(WORDS)
        case "signs":
            for other in rows[1:]:
                if one < len(other):
                    other[one] = "-" + other[one]
        case "empty cells":
            for other in rng.sample(rows[1:], rng.randint(0, len(rows) - 1)):
                if one < len(other):
                    other[one] = ""
        case "swap columns":
            for other in rows[1:]:
                if max(one, two) < len(other):
                    other[one], other[two] = other[two], other[one]
        case "drop column":
            for other in rows[rng.randint(0, 1) :]:
                del other[one : one + 1]
        case "double column":
            for other in rows:
                other.insert(one, other[two] if two < len(other) else "")
        case "rename":
            rows[0][one] = rng.choice(HEADS)
        case "swap rows":
            k, j = rng.randrange(len(rows)), rng.randrange(len(rows))
            rows[k], rows[j] = rows[j], rows[k]
        case "double row":
            rows[1:1] = [list(r) for r in rng.choices(rows, k=rng.randint(1, 30))]
        case "drop row":
            del rows[rng.randrange(len(rows))]
        case "delimiter":
            return text.replace(mark, rng.choice(["\t", "|", " ", ";", ",", "  ", ", "]))
        case "decimal comma":
            return text.replace(".", ",")
        case "blank":
            return rng.choice(
                ["", "\n", " ", mark, text.split("\n", 1)[0], "\n" * 50, "\r\n".join(lines), "\r".join(lines)]
            )
    return "\n".join(mark.join(r) for r in rows)


def injured(text: str, rng: random.Random) -> tuple[list[str], bytes]:
    """One to three injuries, and what is left."""
    kinds = [rng.choice(INJURIES) for _ in range(rng.randint(1, 3))]
    for kind in kinds:
        if not text.strip():
            break
        got = injure(text, kind, rng)
        if isinstance(got, bytes):
            return kinds, got
        text = got
    return kinds, text.encode("utf-8", "surrogatepass")


def lines_below_the_heading(raw: bytes) -> set[int]:
    """Lines that hold something and are no comment."""
    wide = raw[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        text = raw.decode("utf-16" if wide else "utf-8-sig", "replace" if wide else "strict")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return {k for k, line in enumerate(lines, 1) if line.strip(" \t;,|") and not re.match(r"\s*[#%](?!\s*[,;|])", line)}


def try_injured(count: int, seed: int, folder: Path, bases: dict[str, str]) -> Counter[str]:
    rng = random.Random(seed)
    outcome: Counter[str] = Counter()
    names = sorted(bases)
    for k in range(count):
        name = rng.choice(names)
        kinds, raw = injured(bases[name], rng)
        path = folder / name
        path.write_bytes(raw)
        case = (k, name, kinds)
        try:
            record = import_file(path)
        except InputError as error:
            assert error.faults and all(f.file and f.got and f.expected for f in error.faults), case
            outcome["refused"] += 1
            continue
        if record.provenance["format"] not in ("table", "rcbenchmark", "jmajew"):
            outcome["other format"] += 1
            continue
        notes = " ".join(record.notes)
        head = ("no heading line" not in notes and "headings are the comment" not in notes) + ("holds units" in notes)
        head += sum(int(n) for n in re.findall(r"(\d+) lines? (?:above the headings|left out)", notes))
        below = lines_below_the_heading(raw)
        assert len(record.lines) == len(record) == len(below) - head and set(record.lines) <= below, case
        found = findings(record)
        assert all(f.id and f.evidence and f.correction and all(0 <= r < len(record) for r in f.rows) for f in found), (
            case
        )
        outcome["findings"] += bool(found)
        reduced = reduction_of(record) if is_recording(record, False) else None
        told = reduction_document(reduced)
        json.dumps([told, [str(f) for f in found]], allow_nan=False)
        if isinstance(reduced, Dataset):
            how = reduction(reduced)
            kept = [record.lines[r] for rows in how.rows for r in rows]
            gone = [line for lost in how.dropped if not lost.channel for line in lost.lines]
            assert sorted(kept + gone) == sorted(record.lines), case
            assert all(lost.reason for lost in how.dropped), case
            seen = named(record)
            values = {(line, lost.channel) for lost in how.dropped for line in lost.lines}
            for channel, own in seen.provenance["names"].items():  # a value that is lost on the way was told
                if own in record.values and channel in seen.values:
                    for row, value in enumerate(record[own]):
                        if math.isfinite(value) and not math.isfinite(seen.values[channel][row]):
                            assert {(record.lines[row], channel), (record.lines[row], own)} & values, case
            assert told is not None and points_text(reduced), case
            outcome["reduced"] += 1
        else:
            assert reduced is None or ("got " in reduced and "expected " in reduced), case
            outcome["not reduced"] += 1
    return outcome


def test_two_hundred_injured_recordings(tmp_path: Path) -> None:
    outcome = try_injured(200, 7, tmp_path, BASES)
    assert min(outcome["refused"], outcome["reduced"], outcome["findings"]) > 20 and outcome["not reduced"] > 2


@pytest.mark.slow
def test_ten_thousand_injured_recordings(tmp_path: Path, shared_data: Path) -> None:
    real = dict(BASES)
    for folder in ("rcbenchmark", "jmajew", "thrust_map", "tmotor28_tr594", "thrust_step", "mit_copter_rcbenchmark"):
        for file in sorted((shared_data / folder).rglob("*")):
            if file.suffix in (".csv", ".txt") and file.stat().st_size < 20_000:
                real[f"{folder}-{file.name}"] = file.read_text(encoding="utf-8-sig")
    outcome = try_injured(10_000, 8, tmp_path, real)
    assert min(outcome["refused"], outcome["reduced"], outcome["findings"]) > 1000
