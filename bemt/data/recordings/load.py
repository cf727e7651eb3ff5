r"""What is in a file of results, with honest means.

Nothing is guessed. A mean over revolutions needs the speed (``--rpm`` or ``--period-s``). The files of one CFD run are
shown as they are, and then as one run (`bemt.data.recordings.cfd_run`): joined, with the units, sign, sector and zones
that the user states.
"""

from __future__ import annotations

import os
import traceback
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.averaging import Mean
from bemt.base.errors import Fault, InputError, system_fault
from bemt.base.tables import some
from bemt.data import readers as importers
from bemt.data.readers.cfd_run import KIND as RUN
from bemt.data.readers.cfd_run import RunHead, RunToml
from bemt.data.readers.left_open import one_step
from bemt.data.readers.marks import EXPORT
from bemt.data.readers.uiuc import NO_SPEED
from bemt.data.recordings import cfd_run
from bemt.data.recordings.adapt import (
    Choice,
    adapt,
    averaged,
    findings,
    is_recording,
    reduction_of,
)
from bemt.data.recordings.cfd_files import PROGRAMS, WALLS, cfd_files, other_than_loads
from bemt.data.recordings.grids import merged, of_table
from bemt.data.recordings.reduce import reduction
from bemt.data.recordings.shown import INTERNAL, Imported, ImportedFile, options_of
from bemt.physics.dataset import Dataset
from bemt.physics.dataset.channels import channel_fault

__all__ = ["Choice", "as_dataset", "averaged", "import_file", "import_files"]

SETTLED = 0.01
"""Drift above which a mean is called unsettled."""


def import_file(path: str | os.PathLike[str], format: str | None = None, choice: Choice | None = None) -> Dataset:  # noqa: A002
    """Read one file or folder of any known format."""
    choice = choice or Choice()
    name = os.fspath(path)
    if (Path(path) / "case.toml").is_file():
        raise InputError(Fault(name, "", "a folder with a case", "a recording", "`bemt sweep` solves cases"))
    if format is None and Path(path).is_dir():
        if (Path(path) / "run.toml").is_file():
            return import_file(Path(path) / "run.toml")
        if (run := cfd_run.run_at(name)) is not None:
            return run
    kind = importers.detect(path) if format is None else format
    try:
        found = importers.read(path, kind)
    except InputError as error:  # the columns of a UIUC line under a name of one's own: a table without a speed
        if format is not None or kind != "uiuc" or not any(f.got == NO_SPEED for f in error.faults):
            raise
        kind = "table"
        found = importers.read(path, kind)
    if isinstance(found, RunToml):
        return cfd_run.assemble(found, Path(path).parent, name)
    record = adapt(found, kind, name)
    if record is not found:  # made from a series, a polar, a geometry: no recording of a stand
        record = replace(record, provenance={**record.provenance, "adapted": type(found).__name__})
    return _finished(record, choice)


def _finished(record: Dataset, choice: Choice) -> Dataset:
    """What was read, averaged as asked, as a study of grids where it is one, with a note on means that move."""
    made = of_table(record) if record.format in ("table", "recording") else record
    if made is not record:
        record = made
    elif choice.period is not None:
        record = averaged(record, choice.period, choice.revolutions)
    elif record.clock == "time":
        note = "mean over all rows, including start-up; give --rpm or --period-s for whole revolutions"
        record = replace(record, notes=(*record.notes, note))
    return replace(record, notes=(*record.notes, *_unsettled(record)))


def _unsettled(record: Dataset) -> list[str]:
    """One line for the loads whose mean still moves; small ones beside large ones of the same unit do not count."""
    if record.clock not in ("time", "iteration"):
        return []
    means: Mapping[str, Mean] = record.means
    top: dict[str, float] = {"": 0.0}
    for name, mean in means.items():
        if unit := record.unit(name):
            top[unit] = max(top.get(unit, 0.0), abs(mean.value))
    moving = [
        f"{name} {mean.drift:+.2%}"
        for name, mean in means.items()
        if mean.drift is not None
        and abs(mean.drift) > SETTLED
        and not name.lower().startswith(("rms[", "res_"))
        and abs(mean.value) >= 0.05 * top[record.unit(name)]
    ]
    return [f"not settled (drift over the averaged part): {some(moving, 6)}"] if moving else []


def _of_no_run(names: list[str], runs: Sequence[Dataset], to_do: str | None) -> list[str]:
    """Files and folders that no run, read or still asked for, stands for."""
    if not (runs or to_do):
        return names
    whole = {f for d in runs for f in d.files}
    return [n for n in names if not (Path(n).is_dir() and cfd_files(Path(n)))
            and not (Path(n).name == WALLS and (to_do or n in whole))]  # fmt: skip


def import_files(
    paths: Iterable[str | os.PathLike[str]], format: str | None = None, choice: Choice | None = None,  # noqa: A002
    run: RunToml | None = None, insist: bool = False, stated: Mapping[str, Dataset] = {},  # noqa: B006
    rotor: tuple[float, float, bool] | None = None,
) -> Imported:  # fmt: skip
    """Read files, those of `stated` as the user states them; with ``insist`` they must be the CFD run of ``run``.

    `rotor`: diameter [m], density [kg/m3] and duct of the case, as far as it is known.
    """
    names = [os.fspath(path) for path in paths]
    runs, to_do = runs_of(names, run, insist)
    names = _of_no_run(names, runs, to_do)
    records: dict[str, Dataset] = {}
    errors: dict[str, str] = {}
    for name in names:
        try:
            records[name] = stated[name] if name in stated else import_file(name, format, choice)
        except Exception as error:  # the other files are read all the same
            errors[name] = _refusal(error)
    if none := _without_loads(records, bool(runs)):
        records = {name: record for name, record in records.items() if name not in none}
        errors, to_do = errors | none, None
    told = {d.file for d in runs}
    runs = [*runs, *(d for d in records.values() if cfd_run.is_run(d) and d.file not in told)]
    made = [d if rotor is None else cfd_run.of_rotor(d, *rotor) for d in runs if cfd_run.is_run(d)]
    files = [_file(name, format, records.get(name), errors.get(name), rotor or ()) for name in names]
    return Imported(tuple(files), tuple(made), to_do)


def _without_loads(records: Mapping[str, Dataset], run: bool) -> dict[str, str]:
    """Refusals of the exports of a CFD program, by file, where none of them has a load and they make no run."""
    alone = {n: r for n, r in records.items() if r.kind == "cfd" and not cfd_run.is_run(r)}
    what = {n: other_than_loads(r.values) for n, r in alone.items()}
    if run or not all(what.values()):
        return {}
    return {n: str(Fault(n, "", f"{what[n]}: {some(r.values, 8)}", cfd_run.NO_LOAD, EXPORT)) for n, r in alone.items()}


def as_stated(files: Sequence[Any], run: Mapping[str, Any]) -> list[Any]:
    """Recordings with what the user states of them; the files themselves where nothing is.

    Tables of measurements, and DataFrames, each for itself; exports of CFD are one run, together.
    """
    if not any(v is not None and v != [] for v in run.values()):
        return list(files)
    from bemt.data.recordings.cfd_options import run_from
    from bemt.data.recordings.stated import stated_frame

    if not run.get("zones") and all(hasattr(f, "columns") or is_measured(f) for f in files):
        told: list[list[str]] = [run.get(name) or [] for name in ("unit", "column", "sign", "ignore")]
        pairs = run.get("pole_pairs")
        if not any(told) and run.get("rpm") is None and not pairs:
            return list(files)
        unit, column, sign, ignore = told
        return [stated_frame(f, unit, column, sign, pairs) if hasattr(f, "columns")
                else _stated(f, run.get("rpm"), unit, column, sign, pairs, ignore) for f in files]  # fmt: skip
    of_runs = {k: v for k, v in run.items() if k != "pole_pairs"}
    if len(of_runs) < len(run) and run["pole_pairs"]:
        raise InputError(Fault("", "--pole-pairs", f"{run['pole_pairs']} with these files", "tables of measurements"))
    return list(runs_of(files, run_from(list(files), **of_runs), insist=True)[0])


def one_as_stated(file: str, run: Mapping[str, Any]) -> Dataset:
    """One of two recordings as stated; a speed is that of files without one."""
    told = as_stated([file], run)[0]
    return told if isinstance(told, Dataset) else import_file(file)


def stated_options(run: Mapping[str, Any]) -> dict[str, Sequence[str]]:
    """Options of a command that state the columns of tables.

    >>> stated_options({"unit": ["thrust=N"], "pole_pairs": 7, "zones": ["blade"]})
    {'unit': ['thrust=N'], 'pole-pairs': ['7']}
    """
    columns = {name: run[name] for name in ("unit", "column", "sign") if run.get(name)}
    return columns | ({"pole-pairs": [f"{run['pole_pairs']}"]} if run.get("pole_pairs") else {})


def is_measured(file: Any) -> bool:
    """Whether a file is a table of measurements, of whose columns units, headings and signs may be stated."""
    return isinstance(file, str) and not Path(file).is_dir() and importers.kind_of(file) not in ("", RUN, *PROGRAMS)


def _stated(
    file: str, rpm: float | None, unit: Sequence[str], column: Sequence[str], sign: Sequence[str],
    pole_pairs: int | None = None, ignore: Sequence[str] = (),
) -> Dataset:  # fmt: skip
    """A table of measurements as a recording.toml with these facts would read it.

    Pole pairs and headings to ignore are stated to ``import`` alone: its next step is the file that keeps them.
    """
    from bemt.data.readers.recording_toml import RecordingToml, joined
    from bemt.data.recordings.stated import filled, recording_from

    if unit or column or sign or pole_pairs or ignore:
        made = RecordingToml.model_validate(recording_from(file, unit, column, sign, pole_pairs, ignore=ignore))
        record = _finished(joined(made, Path(file).parent, file), Choice())
    else:
        record = import_file(file)
    record = filled(record, rpm)
    about = {**record.provenance, "stated": file}
    if (pole_pairs or ignore) and "step" not in about:
        options = options_of({"unit": unit, "column": column, "sign": sign, "ignore": ignore,
                              "pole-pairs": [pole_pairs] if pole_pairs else []})  # fmt: skip
        about["step"] = one_step(file, options)
    return replace(record, provenance=about)


def _study(run: RunToml, insist: bool) -> list[Dataset]:
    """Runs on several grids as one, which is a study of the grid where their cells are stated."""
    if not insist and all(g.cells is None for g in run.grids):
        return merged([import_file(f) for f in run.files])
    found = cfd_run.assemble(run, Path(), f"{len(run.grids)} grids")
    if not found.studies:
        got = "runs of unlike conditions: no two of them are one speed and airspeed on two grids"
        raise InputError(Fault("--out", "", got, "one condition on several grids", "Import each run by itself"))
    return [found]


def _runs_and_exports(names: Sequence[str], insist: bool) -> tuple[list[Dataset], list[str]]:
    """Which names are a run by themselves, as a run.toml is, and which are exports of CFD programs."""
    runs, exports = [], list[str]()
    walls = [n for n in names if Path(n).name == WALLS]
    for name in [n for n in names if n not in walls] or names:
        at = Path(name)
        try:
            if at.is_dir() and not (at / "run.toml").is_file():
                exports += map(str, cfd_files(at))
            elif (kind := RUN if at.is_dir() else importers.detect(name)) == RUN:
                runs.append(import_file(name))
            elif kind in PROGRAMS:
                exports.append(name)
        except (InputError, OSError):
            if insist:
                raise
    return runs, exports + walls if exports else exports


def runs_of(
    names: Sequence[str], run: RunToml | None = None, insist: bool = False
) -> tuple[list[Dataset], str | None]:  # fmt: skip
    """CFD runs of files as the options of `run` say (`cfd_options.run_from`), and what exports that are no run yet
    need.

    A run.toml each, and exports, which are one run together; with ``run.grids`` all of them are one study.
    """
    if run is not None and run.grids:
        return _study(run, insist), None
    runs, exports = _runs_and_exports(names, insist)
    if insist and not exports:
        hint = "A run.toml has its own" if runs else "Name the files, or the folder that holds them (postProcessing)"
        hint += "" if runs else "; a table of CFD points says so by a column cells"
        got = "no export of CFD, which options of a run are about"
        raise InputError([Fault(name, "", got, "exports of a CFD run", hint) for name in names])
    if not exports:
        return runs, None
    head = (run.run if run else RunHead(files=())).model_copy(update={"files": tuple(exports)})
    whole = run.model_copy(update={"run": head}) if run else RunToml(run=head)
    name = " + ".join(Path(e).name for e in exports[:3])
    try:
        return [*runs, cfd_run.assemble(whole, Path(), name)], None
    except Exception as error:
        if insist:
            raise
        if not isinstance(error, InputError):
            # what a file refuses to hold its own entry says; where we fail to join files, nothing else does
            return runs, None if isinstance(error, (ValueError, OSError)) else _refusal(error)
        return runs, str(error)


def _refusal(error: Exception) -> str:
    """Why a file was not read: its faults, or where our reader failed on it."""
    if isinstance(error, ValueError):  # InputError, or what a record refuses to hold
        return str(error) or type(error).__name__
    if isinstance(error, OSError) and error.strerror:
        return str(system_fault(error))
    at = traceback.extract_tb(error.__traceback__)[-1]
    words = f"{type(error).__name__}: {error}, in {Path(at.filename).name} line {at.lineno}"
    return f"{INTERNAL} ({words}). The file may be damaged; please report it with the file"


def _file(
    name: str, format: str | None, record: Dataset | None, error: str | None, rotor: Sequence[Any]  # noqa: A002
) -> ImportedFile:  # fmt: skip
    if record is None:
        return ImportedFile(name, format, error=error)
    try:
        reduced = _reduced(record)
        found = ImportedFile(name, record.format, record, reduced, _means(record, reduced),
                             findings(record, *rotor), record.notes, error)  # fmt: skip
        found.document()  # what cannot be shown is refused with its file
    except Exception as failed:
        return ImportedFile(name, format, error=_refusal(failed))
    return found


def _reduced(record: Dataset) -> Dataset | str | None:
    """Steady points of a recording."""
    return reduction_of(record) if is_recording(record, "adapted" in record.provenance) else None


def _means(record: Dataset, reduced: Dataset | str | None) -> Mapping[str, Mean]:
    """Means of the file, and of the channels where the whole recording is one steady point."""
    means: dict[str, Mean] = dict(record.means)
    if isinstance(reduced, Dataset) and len(reduced) == 1:
        over = f"the steady rows ({len(reduction(reduced).rows[0])} of {len(record)})"
        means = {name: Mean(float(reduced[name][0]), over) for name in record.values if name in reduced} | means
    return means


def check_format(name: str | None) -> None:
    """Refuse the name of an unknown reader."""
    if name is not None and name not in importers.importers():
        raise InputError(Fault("", "--format", repr(name), f"one of {', '.join(importers.importers())}"))


def as_dataset(record: Dataset, rotor: Sequence[Any] = ()) -> Dataset:
    """Points of what was read: steady points of a recording, rows of a table, else one point of means.

    `rotor`: diameter [m], density [kg/m3] and duct of the case, where one is known.
    """
    if cfd_run.is_run(record):
        return record
    notes = [*record.notes, *(f"{f.severity}: {f.id} in {f.channel}: {f.evidence}" for f in findings(record, *rotor))]
    reduced = _reduced(record)
    if isinstance(reduced, Dataset):
        return replace(reduced, notes=(*reduced.notes, *notes))
    if isinstance(reduced, str):
        notes.append(reduced)
    file, form = record.file, record.format
    fit = [name for name in record.values if not channel_fault(name)]
    means: Mapping[str, Mean] = record.means
    whole = [k for k in fit if k in means] if record.clock in ("time", "iteration") else []
    left = [name for name in record.values if name not in (whole or fit)]
    notes += [f"ignored, no known unit: {', '.join(left)}"] if left else []
    if not fit:
        got = f"channels {', '.join(list(record.values)[:8])}"
        raise InputError(Fault(file, "", got, "a quantity in a known unit", "Name units, as in thrust_N"))
    told = {"file": file, "format": form}
    values = {k: np.array([means[k].value]) for k in whole} or {k: record[k] for k in fit}
    return Dataset(record.kind, Path(file).stem or form, values, provenance=told, notes=tuple(notes))
