"""Files of a CFD run: found in folders, read, parts of a restarted history joined, the settled part averaged."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bemt.base.arrays import Array
from bemt.base.averaging import MIN_ROWS, keep_last, relation, revolution_average, steady_average
from bemt.base.errors import Fault, InputError
from bemt.data import readers
from bemt.data.readers.split import some
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
SCATTERED = 0.02
"""Spread of the means of single revolutions above which a load is not periodic. [1]"""


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
    files = sorted(p for p in found if p.is_file())
    out = []
    for path in files:
        try:
            if readers.detect(path) in PROGRAMS:
                out.append(path)
        except InputError:
            continue
    return tuple(out)


def y_plus(files: Sequence[Path]) -> dict[str, float]:
    """Mean y+ of each patch at the last time of the yPlus.dat that OpenFOAM wrote beside the forces; {}: none [1]."""
    beside = {f.with_name(WALLS) for f in files}
    for post in {f.parents[2] for f in files if len(f.parents) > 2}:
        beside |= {*post.glob(f"*/*/{WALLS}")} if post.name == "postProcessing" else set()
    out: dict[str, float] = {}
    for path in sorted(p for p in beside if p.is_file()):
        for cells in map(str.split, readers.load_text(path).lines):
            if len(cells) == 5 and (average := readers.number(cells[4])) is not None:
                out[cells[1]] = average
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
        try:
            found = readers.read(path)
        except InputError as error:
            faults += error.faults
            continue
        if isinstance(found, Dataset) and found.kind == "cfd":
            read.append((str(path), found))
        else:
            got = f"a {found.kind if isinstance(found, Dataset) else type(found).__name__}, no export of CFD"
            faults.append(Fault(str(path), "", got, f"an export of {', '.join(dict.fromkeys(PROGRAMS.values()))}"))
    wrong: list[Fault] = []
    read = _joined(read, wrong)
    wrong += _other_bases(read)
    if wrong:
        raise InputError(faults + wrong)
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
            clock, coarse = (
                "iteration",
                f"; {step:.3g} s a row, {period / step:.2g} rows a revolution: taken for iterations",
            )
    if clock == "time":
        found = revolution_average(time[index], values[index], period, revolutions)
        if found.mean is None:
            return found.problem
        turns = np.array(found.per_revolution)
        scatter = float(np.std(turns, ddof=1) / math.sqrt(turns.size)) if turns.size > 1 else 0.0
        wide = (np.ptp(turns) / abs(found.mean) if turns.size and found.mean else 0.0) > SCATTERED
        over = found.span + ("; revolutions differ by more than 2 %" if wide else "")
        if found.drift is None:
            over += ", with none before it: nothing says that it has settled"
        drift = math.nan if found.drift is None else found.drift * abs(found.mean)
        return Settled(np.array([found.mean]), drift, scatter, over)
    if clock == "iteration":
        found = steady_average(values)
        if found.mean is None:
            return found.problem
        part = values[values.size - found.rows :]
        over = f"last {found.rows} of {values.size} rows{coarse}"
        return Settled(np.array([found.mean]), (found.drift or 0.0) * abs(found.mean), float(np.std(part)), over)
    mean = record.means
    over = "as in the file"
    if values.size > 1 and mean and record.format == "fluent_transcript":
        values, over = values[np.isfinite(values)][-1:], "the last one computed"
    return Settled(np.array(values, dtype=float), math.nan, 0.0, over)
