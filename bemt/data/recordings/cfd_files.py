"""Files of a CFD run: found in folders, read, parts of a restarted history joined, the settled part averaged.

Their columns: force or moment, axis, zone, and what a heading may be.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bemt.base.arrays import Array
from bemt.base.averaging import MIN_ROWS, keep_last, relation, revolution_average, steady_average
from bemt.base.errors import Fault, gathered, refuse
from bemt.base.tables import some
from bemt.data import readers
from bemt.data.readers.cfd import unit_of
from bemt.data.readers.cfd_run import QUANTITIES
from bemt.data.readers.headings import CELLS, channel_of, heading, may_be_shaft_speed, meanings
from bemt.data.recordings.channels import clocks_of
from bemt.physics.dataset import Dataset

PROGRAMS: Mapping[str, str] = {
    "fluent_report": "Fluent", "fluent_monitor": "Fluent", "fluent_forces": "Fluent", "fluent_transcript": "Fluent",
    "cfd_post_csv": "CFD-Post", "design_points": "Workbench", "star_monitor": "STAR-CCM+",
    "openfoam_forces": "OpenFOAM", "su2_history": "SU2", "flow360_forces": "Flow360",
}  # fmt: skip
"""Program by reader."""
SEVERAL = (
    "One condition on several grids: --setup cells=a,b,c, a number for each grid. Other runs: import each with --out, "
    "then give the .toml files together. A restart with its own clock: alone"
)
WALLS = "yPlus.dat"
"""What the function object yPlus of OpenFOAM writes: no load, but how fine the first cell is."""


@dataclass(frozen=True, eq=False)
class Settled:
    """A load after averaging."""

    values: Array  # (N,) SI, rpm in rev/min
    drift: float  # change over the averaged part, in the unit of the values; NaN: nothing was averaged
    scatter: float  # standard deviation over it
    over: str


def cfd_files(folder: Path) -> tuple[Path, ...]:
    """Exports of a run in a folder: the files in it, or those below ``postProcessing`` or one of its folders."""
    post = folder / "postProcessing"
    if post.is_dir() or folder.name == "postProcessing":
        found = (post if post.is_dir() else folder).glob("*/*/*.dat")
    else:
        found = folder.glob("*/*.dat" if folder.parent.name == "postProcessing" else "*")
    return tuple(p for p in sorted(found) if p.is_file() and readers.kind_of(p) in PROGRAMS)


def y_plus(files: Sequence[Path]) -> dict[str, tuple[float, float]]:
    """Mean and largest y+ of each patch at the last time of the yPlus.dat beside the forces; {}: none [1]."""
    beside = {f.with_name(WALLS) for f in files}
    for post in {f.parents[2] for f in files if len(f.parents) > 2}:
        beside |= {*post.glob(f"*/*/{WALLS}")} if post.name == "postProcessing" else set()
    out: dict[str, tuple[float, float]] = {}
    for path in sorted(p for p in beside if p.is_file()):
        for cells in map(str.split, readers.load_text(path).lines):
            if len(cells) == 5 and (average := readers.number(cells[4])) is not None:
                out[cells[1]] = average, readers.number(cells[3]) or math.nan
    return out


def monitored_y_plus(columns: Iterable[LoadColumn]) -> dict[str, tuple[float, float]]:
    """Mean and largest y+ of each zone by monitors beside the loads, as :func:`y_plus`."""
    out: dict[str, tuple[float, float]] = {}
    for c in columns:
        if _OTHER["y+ of walls"].search(c.stem) and not re.search("min", c.stem, re.IGNORECASE):
            mean, most = out.get(c.zone, (math.nan, math.nan))
            most, mean = (level(c), mean) if re.search("max", c.stem, re.IGNORECASE) else (most, level(c))
            out[c.zone] = mean, most
    return out


def zone_of(path: Path, form: str) -> str:
    """Function object of a file of OpenFOAM, which writes name/time/file."""
    timed = form == "openfoam_forces" and readers.number(path.parent.name) is not None
    return path.parent.parent.name if timed else ""


def read_run(paths: Sequence[Path]) -> tuple[list[tuple[str, Dataset]], list[Fault]]:
    """Files of a run, the parts of a restarted history put together, and the faults of those that cannot be read."""
    read: list[tuple[str, Dataset]] = []
    faults: list[Fault] = []
    for path in paths:
        with gathered(faults):
            found = readers.read(path)
            if isinstance(found, Dataset) and found.kind == "cfd":
                read.append((str(path), found))
                continue
            got = f"a {found.kind if isinstance(found, Dataset) else type(found).__name__}, no export of CFD"
            faults.append(Fault(str(path), "", got, f"an export of {', '.join(dict.fromkeys(PROGRAMS.values()))}"))
    wrong: list[Fault] = []
    read = _joined(read, wrong)
    if wrong := [*wrong, *_other_bases(read)]:
        refuse([*faults, *wrong])
    return read, faults


def _joined(read: list[tuple[str, Dataset]], faults: list[Fault]) -> list[tuple[str, Dataset]]:
    out: list[tuple[str, Dataset]] = []
    others: dict[str, list[str]] = {"from the same start": [], "on another clock": []}
    for name, record in read:
        home = home_of(name, record)
        at = next((k for k, (file, other) in enumerate(out) if home == home_of(file, other)), None)
        if at is None or record.clock not in ("time", "iteration"):
            out.append((name, record))
            continue
        file, before = out[at]
        then, now = clock_of(before), clock_of(record)
        how = relation(then, now)
        if home[0] == "openfoam_forces" and not now[1].size and now[0][0] > then[0][0]:  # one folder a start
            how = "continues" if now[0][0] > then[0][-1] else "overlaps"
        if how == "other clock" and now[0].size and now[0][-1] < then[0][0]:
            before, record, then, now = record, before, now, then
            how = relation(then, now)
        if how == "other clock":
            again = all(np.array_equal(a[:1], b[:1]) for a, b in zip(then, now, strict=True))
            others["from the same start" if again else "on another clock"].append(name)
            continue
        cut = now[0][0]
        kept = then[0] < cut
        values = {k: np.concatenate([before[k][kept], record[k]]) for k in before.values}
        note = f"{Path(name).name} {how} {Path(file).name}: joined at step {cut:g}"
        notes = (*before.notes, note)
        out[at] = file, replace(before, values=values, u={}, flags=(), lines=(), texts={}, notes=notes)
    for how, names in others.items():
        if names:
            got = f"the same columns in {some(names, 3)}, {how}"
            faults.append(Fault(out[0][0], "", got, "files of one run", SEVERAL))
    return out


def home_of(name: str, record: Dataset) -> tuple[str, str, tuple[str, ...]]:
    """What the parts of one history have in common: format, function object, columns."""
    form = record.format
    return form, zone_of(Path(name), form), tuple(record.values)


def clock_of(record: Dataset) -> tuple[Array, Array]:
    """Steps (times where none are counted) and times of a history; empty: none."""
    time, every = clocks_of(record)
    names = [n for n in every if n in record and n != time]
    times = record[time] if time in record else np.empty(0)
    return (record[names[0]] if names else times), times


def _other_bases(read: Sequence[tuple[str, Dataset]]) -> list[Fault]:
    """Histories that do not overlap: they are not one run."""
    faults = []
    for kind in ("time", "iteration"):
        own = [(n, clock_of(r)[kind == "time"]) for n, r in read if r.clock == kind]
        own = [(n, clock) for n, clock in own if clock.size > 1]
        for (a, x), (b, y) in zip(own, own[1:], strict=False):
            shared = min(x[-1], y[-1]) - max(x[0], y[0])
            if shared < 0.5 * min(x[-1] - x[0], y[-1] - y[0]):
                got = f"{kind} {y[0]:g} to {y[-1]:g}, where {Path(a).name} has {x[0]:g} to {x[-1]:g}"
                faults.append(Fault(b, "", got, "files of one run, over the same steps", SEVERAL))
    return faults


def settled(
    values: Array, record: Dataset, period: float, revolutions: int | None, end: float = math.inf
) -> Settled | str:
    """Settled part of a history: whole revolutions by time, else the last fifth; text: why there is none."""
    clock = record.clock
    coarse = ""
    if clock == "time":
        time = record[clocks_of(record)[0]]
        index, _ = keep_last(time)
        index = index[time[index] <= end * (1.0 + 1e-9)]
        step = float(np.median(np.diff(time[index]))) if index.size > 1 else 0.0
        if step > period / MIN_ROWS:
            clock = "iteration"
            coarse = f"; {step:.3g} s a row, {period / step:.2g} rows a revolution: taken for iterations"
    if clock == "time":
        found = revolution_average(time[index], values[index], period, revolutions)
        if found.mean is None:
            return found.problem
        turns = np.array(found.per_revolution)
        scatter = float(np.std(turns, ddof=1) / math.sqrt(turns.size)) if turns.size > 1 else 0.0
        over = found.span + ("; revolutions differ by more than 2 %" if found.unlike else "")
        if found.drift is None:
            over += ", with none before it: nothing says that it has settled"
        drift = math.nan if found.drift is None else found.drift * found.mean
        return Settled(np.array([found.mean]), drift, scatter, over)
    if clock == "iteration":
        found = steady_average(values)
        if found.mean is None:
            return found.problem
        part = values[values.size - found.rows :]
        over = f"last {found.rows} of {values.size} rows{coarse}"
        return Settled(np.array([found.mean]), (found.drift or 0.0) * found.mean, float(np.std(part)), over)
    mean = record.means
    over = "as in the file"
    if values.size > 1 and mean and record.format == "fluent_transcript":
        values, over = values[np.isfinite(values)][-1:], "the last one computed"
    return Settled(np.array(values, dtype=float), math.nan, 0.0, over)


# Columns of the files, and what they may be by name and unit.

_FORCE = re.compile(r"force_total(?:_([xyz]))?(?:_N)?( along .*)?|C(?:F)([xyz])")
_MOMENT = re.compile(r"moment_total(?:_([xyz]))?(?:_Nm)?( along .*)?|C(?:M)([xyz])")
_ASIDE = re.compile(
    r"(force|moment)_(pressure|viscous|porous|internal)(_|\b)|center_of_pressure|(force|moment)_coefficient"
)
"""Columns beside a total: its parts, where it acts, the same once more."""
_WORDS: dict[str, str] = {
    "thrust": r"thrust|\bforce|^f[xyz]?$|axial[_ -]?load|schub|traction|empuje",
    "torque": r"torque|moment|^m[xyz]?$|couple|drehmoment|par[_ ]motor",
    "power": r"power|leistung",
    "duct_thrust": r"duct|shroud|nozzle",
    "airspeed": r"inlet[-_ ]?(velocity|speed)|(velocity|speed|\bv)[-_ ]?inlet|(advance|flight)[-_ ](speed|velocity)",
    "cells": CELLS.pattern,
}
"""Headings of a quantity in CFD beside those that benches have as well (`usual`)."""
_NOT = re.compile(r"coeff|spectral|^c[dlmt]\b|residual|^res_|^rms\[|kt\b|kq\b", re.IGNORECASE)
_COEFFICIENT = re.compile(r"coeff|\bC[A-Z]\w*\b")
_OTHER = {
    "residuals": re.compile(r"residual|continuity|^res_|^(rms|max|bgs)\[", re.IGNORECASE),
    "y+ of walls": re.compile(r"\by ?\+|y_?plus", re.IGNORECASE),
}
"""What a monitor may hold beside loads."""
CHANNEL = {"thrust": "thrust_N", "duct_thrust": "duct_thrust_N", "torque": "torque_Nm", "power": "power_W"}
"""Channel of a load."""
VECTOR = {"thrust": "force", "torque": "moment"}
COEFFICIENTS = ("CT", "CQ", "CP", "J")
_MEANT = CHANNEL | {"airspeed": "airspeed_m_s", "density": "density_kg_m3"}


@dataclass(frozen=True, eq=False)
class LoadColumn:
    """One column of one file of the run."""

    file: str
    name: str  # as the file has it
    stem: str  # without its zone
    zone: str
    axis: str  # of a vector
    part: str  # force, moment, or "" where only the heading tells
    unit: str
    record: Dataset

    @property
    def words(self) -> str:
        """Heading without what programs append, and without its unit."""
        word = re.sub(r"[-_ ](op|rfile)$", "", self.stem)
        return word.removesuffix(f"_{self.unit}") if self.unit else word

    @property
    def of_reference(self) -> bool:
        """Whether the heading is a coefficient of which only the user knows the reference: ``ct``, ``cd-1``."""
        bare = re.fullmatch(r"c[a-z]?[a-z]([-_]\w*)?|.*coeff.*", self.words, re.IGNORECASE)
        return bool(bare) and self.unit in ("", "-") and not self.coefficient[0]

    @property
    def coefficient(self) -> tuple[str, float]:
        """Coefficient of a propeller that the heading names, or its advance ratio, and the factor on the values."""
        word = re.sub(r" \d$", "", self.words)  # STAR-CCM+ numbers its reports
        head = heading(word.upper() if re.fullmatch("(10)?k[tq]", word) else word)
        known = head.unit is not None and head.name in COEFFICIENTS and self.unit in ("", "-")
        return (head.name, head.unit.factor) if known and head.unit else ("", 1.0)


def columns_of(file: str, record: Dataset, several: bool) -> list[LoadColumn]:
    """Columns of one file that may be loads or say something of them."""
    form = record.format
    home = zone_of(Path(file), form) if several else ""
    time, every = clocks_of(record)
    clock = {time, *every}
    out = []
    for name in record.values:
        if name in clock or _ASIDE.match(name):
            continue
        match = re.fullmatch(r"(.+?)\s*\(([^()]*)\)", name) if form != "openfoam_forces" else None
        stem, zone = (match[1], match[2]) if match else (name, home)
        part, axis = "", ""
        for word, pattern in (("force", _FORCE), ("moment", _MOMENT)):
            if (m := pattern.fullmatch(stem)) and (m[3] is None or form in ("su2_history", "flow360_forces")):
                part, axis = word, m[1] or m[3] or ""
        out.append(LoadColumn(file, name, stem, zone, axis, part, record.unit(name), record))
    return out


def recorded(found: list[LoadColumn]) -> list[LoadColumn]:
    """Columns without what a transcript tells of the same quantity: somebody computed that at some moment."""
    written = [c for c in found if c.record.format != "fluent_transcript"]
    return written or found


def other_than_loads(names: Iterable[str]) -> str:
    """What columns of a monitor are, when they are no loads and nothing that may be one; else "".

    >>> other_than_loads(["rms[Rho]", "rms[RhoE]"]), other_than_loads(["rms[Rho]", "CFx"]), other_than_loads(["lift"])
    ('residuals', '', '')
    """
    own = list(names)
    words = [re.compile(_WORDS[q], re.IGNORECASE) for q in ("thrust", "torque", "power")]
    if any(pattern.search(name) for name in own for pattern in (_FORCE, _MOMENT, _COEFFICIENT, *words)):
        return ""
    return next((what for what, pattern in _OTHER.items() if any(map(pattern.search, own))), "")


def fits(c: LoadColumn, quantity: str, told: str | None = None) -> bool:
    """Whether a column may be a quantity, by its unit, or what is ``told`` of it, and by the words of its heading."""
    unit, stated = unit_of(c.unit), unit_of(told or "")
    if stated is not None and unit is not None and unit.dimension == "mass":  # kg for kgf
        unit = stated
    if (unit is None and _NOT.search(c.stem)) or (unit is not None and unit.dimension != QUANTITIES[quantity][0]):
        return False
    word = c.words
    if quantity == "rpm":
        return may_be_shaft_speed(word) or unit is not None
    if c.part and c.part == VECTOR.get(quantity):
        return True
    if not c.part and quantity in _WORDS and re.search(_WORDS[quantity], word, re.IGNORECASE):
        return True
    if unit is None:  # in the words of any recording only what nothing else is
        return quantity in ("airspeed", "density") and quantity in meanings(word)
    name = channel_of(word.upper() if len(word) == 1 and word != "n" else word, unit.suffix)
    return {"P_W": "power_W"}.get(name, name) == _MEANT.get(quantity)  # CFD has no electrical power


def level(c: LoadColumn) -> float:
    """Mean of the last fifth of a column, as the file has it."""
    tail = c.record[c.name][-max(1, len(c.record) // 5) :]
    return float(np.mean(tail[np.isfinite(tail)])) if np.isfinite(tail).any() else 0.0
