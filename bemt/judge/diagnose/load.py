"""Files and cases of a diagnosis: recordings of any format, as points of a case."""

from __future__ import annotations

import difflib
import os
import shlex
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.errors import Fault, InputError, gathered, refuse
from bemt.base.packed import part_of
from bemt.base.tables import few
from bemt.base.units import ZERO_CELSIUS
from bemt.data.readers.left_open import one_step
from bemt.data.recordings.cfd_run import is_run, of_rotor, run_at
from bemt.data.recordings.cfd_setup import one_grid, stated_setup
from bemt.data.recordings.channels import file_name, named, stated
from bemt.data.recordings.check import check, left_out, without_current
from bemt.data.recordings.grids import are_grids, together
from bemt.data.recordings.reduce import reduce, reduction
from bemt.judge.compare.selection import LOAD_CHANNELS, like_loads, one_rotor, speed_in_doubt, wind_of
from bemt.judge.diagnose import record as records
from bemt.judge.diagnose.record import Record
from bemt.physics import effects
from bemt.physics.air import Air
from bemt.physics.dataset import Dataset, from_pandas
from bemt.rotors.case import Case, find_cases, load_case
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.propeller import rotor_of

_POINT = ("rpm", "J", "airspeed_m_s", "density_kg_m3", "sideslip_deg", *records.COVARIATES)
# Share by which a stated diameter or advance ratio may differ from the case's; advance ratios that are as good as none.
_SAME, _SLOW = 0.05, 0.02
_NAMED = 8
# Rows up to which a log is kept whole for its transients, and share of them in steady points from which it is not.
_SHORT, _STEADY = 200, 0.75
# Largest over smallest thrust that a wall, a gap or the air may make at one speed in still air.
_ONE_SPEED = 2.0


def cases_of(given: Sequence[Any], off: Sequence[str], n: int) -> list[Case]:
    """Cases by object, path or label, one or one for each recording."""
    found: list[Case] = []
    for one in given:
        folder = isinstance(one, (str, os.PathLike)) and Path(one).is_dir()
        found += map(load_case, find_cases([os.fspath(one)])) if folder else [rotor_of(one).case]
    if len(found) not in (1, n):
        got, expected = f"{len(found)} cases for {n} recordings", "one case, or one for each recording"
        raise InputError(Fault("--case", "", got, expected))
    unknown = [i for i in off if i not in effects.catalogue()]
    if unknown:
        known = ", ".join(effects.catalogue())
        raise InputError([Fault("--off", i, "an unknown effect", f"one of {known}") for i in unknown])
    if off:
        found = [c.replaced({"model.effects_off": [*c.file.model.effects_off, *off]}) for c in found]
    return found


def load(
    path: str, case: Case, imported: Dataset | None = None, rpm: float | None = None,
    airspeed_m_s: float | None = None, density_kg_m3: float | None = None,
) -> Record:  # fmt: skip
    """Read one recording, whatever its format."""
    from bemt.data.recordings.load import import_file
    from bemt.data.recordings.stated import filled

    if imported is None:
        imported = run_at(path, rpm, airspeed_m_s)
    if imported is None:
        imported = import_file(path)
        imported = filled(imported, rpm, airspeed_m_s, density_kg_m3) if is_run(imported) else imported
    setup = stated_setup(imported)
    if not is_run(imported):
        _one_setup(imported, path)
        one_rotor(imported, path, "`compare A B --rows-b rotor={} --case CASE` takes one of them")
    if is_run(imported):
        speed_in_doubt(imported, path)
        imported = of_rotor(imported, case.diameter_m, float(case.air().rho), case.ducted)
        run, gains = one_grid(imported)
        made = records.from_series(run, case, gains)
        return replace(made, notes=(*made.notes, *imported.notes), computed=True, setup=setup, whole=imported)
    imported = filled(imported, rpm, airspeed_m_s, density_kg_m3)
    speed_in_doubt(imported, path)
    _speed_missing(imported, path)
    _airspeed_in_doubt(imported, case, path)
    _same_rotor(imported, case, path)
    findings = check(imported, diameter_m=case.diameter_m, ducted=case.ducted, density_kg_m3=float(case.air().rho))
    imported, findings = without_current(imported, findings)
    found = tuple(f"{Path(path).name}: {f}" for f in findings if f.severity != "note")
    imported = left_out(imported, findings)
    rows = named(imported)
    _load_missing(imported, rows, path)
    # in the log of a stand the sign is the hand of the rotor; in somebody's own table it may be a slip
    log = imported.format != "table"
    hand = log and any(f.id == "sign_flipped" and f.severity == "note" for f in findings)
    if {"CT", "CP", "CQ"} & set(imported.values):
        made = records.from_series(_points(imported, rows, path), case)
    else:
        points = reduce(imported, diameter_m=case.diameter_m)
        correlated = reduction(points).correlated
        if reduction(points).mode == "points" and imported.format == "table":
            # somebody's own table of points: every row counts, a jump from row to row may be what it shows
            points = _scattered(_points(imported, rows, path), points)
        elif _step_responses(imported, rows, points):
            points = replace(_points(imported, rows, path), notes=("short log: every row counts, transients too",))
        if hand:  # a rotor of the other hand: the sign of its torque is the sense of rotation
            points = replace(points, values={**points.values, "torque_Nm": -points.torque_Nm})
        made = records.from_series(points, case, correlated)
    turned = ("torque_Nm: negative under load (sense of rotation): sign reversed here",) if hand else ()
    notes = (*made.notes, *turned, *imported.notes, *rows.notes, *_unused(imported, rows, case))
    broken = tuple(f for f in findings if f.severity == "error" or (f.id == "sign_flipped" and f.severity == "warning"))
    units = imported.provenance.get("declared", {})
    declared = {k: units[name] for k in rows.values if (name := file_name(rows, k)) in units}
    return replace(made, findings=found, contradictions=broken, notes=notes, declared=declared,
                   computed=imported.kind == "cfd" or bool(setup), setup=setup, whole=imported)  # fmt: skip


def _load_missing(imported: Dataset, rows: Dataset, path: str) -> None:
    """Refuse a recording without a load, with the columns that may be one."""
    if not set(LOAD_CHANNELS) & rows.values.keys() and (columns := like_loads(imported, rows)):
        step = one_step(path, [f"--column thrust={shlex.quote(columns[0])}", "--unit thrust=UNIT"])
        goes = f"{' and '.join(map(repr, columns))} {'goes' if len(columns) == 1 else 'go'} with the speed as loads do"
        hint = f"{goes}. If it is the thrust: {step}"
        raise InputError(Fault(path, "", "no load with a unit", "a thrust or a torque", hint))


def _speed_missing(imported: Dataset, path: str) -> None:
    """Refuse loads without a speed that cannot be those of one speed."""
    told = named(imported).values
    thrust = np.abs(told.get("thrust_N", np.zeros(0)))
    thrust = thrust[np.isfinite(thrust)]
    if {"rpm", "J", "airspeed_m_s"} & told.keys() or not thrust.size:
        return
    low, high = float(thrust.min()), float(thrust.max())
    if high > _ONE_SPEED * low:
        got = f"no speed of rotation, and thrust from {low:.3g} to {high:.3g} N"
        hint = (
            "Head the column rpm; `--rpm N` states one speed for all rows. With watts and no speed: "
            "`bemt compare A B` of two runs, at equal power; `bemt drive CASE --kv KV --cells N` beside them"
        )
        raise InputError(Fault(path, "rpm", got, "the speed of every row", hint))


def _airspeed_in_doubt(imported: Dataset, case: Case, path: str) -> None:
    """Refuse thrust that passes zero as in a wind that nobody stated: everything would be blamed on the rotor."""
    zero = wind_of(imported)
    if zero is not None and not case.airspeed_m_s:
        got = f"thrust that is negative below {zero:.0f} rev/min, as in wind, and no airspeed"
        hint = "State it: --airspeed-m-s V (compare: --air-a or --air-b); in still air, where the cell's zero is off: 0"
        raise InputError(Fault(path, "airspeed_m_s", got, "the airspeed", hint))


def _step_responses(imported: Dataset, rows: Dataset, points: Dataset) -> bool:
    """Whether a short log of a turning rotor is for its transients, which its steady points leave out."""
    found, rpm = reduction(points), rows.values.get("rpm", np.zeros(1))
    log = found.mode == "samples" and imported.format == "table" and len(imported) <= _SHORT
    return log and bool(np.all(rpm > 0.0)) and sum(map(len, found.rows)) < _STEADY * len(imported)


def _scattered(series: Dataset, reduced: Dataset) -> Dataset:
    """Rows that state no uncertainty with that which the repeats of the reduction showed."""
    u, floor = {k: np.array(v) for k, v in series.u.items()}, 1e-3
    for name, seen in reduced.u.items():
        if name not in ("thrust_N", "torque_Nm") or name not in series or np.isfinite(u[name]).any():
            continue
        full = float(np.nanmax(np.abs(series[name])))
        for rows, value in zip(reduction(reduced).rows, seen, strict=True):
            u[name][rows] = np.hypot(value, floor * full)
    return replace(series, u=u)


def _same_rotor(imported: Dataset, case: Case, path: str) -> None:
    """Refuse a recording that says itself that it is of another rotor, or contradicts itself."""
    faults = []
    told = imported.constants.get("diameter_m")
    if told and abs(told / case.diameter_m - 1.0) > _SAME:
        faults.append(Fault(path, "diameter_m", f"{told:.4g}", f"{case.diameter_m:.4g} as in the case {case.name}",
                            "Case of a different rotor?"))  # fmt: skip
    v = named(imported)
    if {"J", "airspeed_m_s", "rpm"} <= v.values.keys():
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = v.airspeed_m_s / (v.rpm / 60.0 * case.diameter_m) / v.J
        ratio = ratio[np.isfinite(ratio) & (v.J > _SLOW)]
        if ratio.size and abs(float(np.median(ratio)) - 1.0) > _SAME:
            faults.append(Fault(path, "J", f"airspeed over n D is {np.median(ratio):.3g} times it", "the same number",
                                "Wrong diameter in the case, or wrong unit of the airspeed?"))  # fmt: skip
    refuse(faults)


def _unused(imported: Dataset, rows: Dataset, case: Case) -> list[str]:
    """Channels that the file has and that nothing here looks at, and loads that it has twice."""
    known = {*_POINT, *LOAD_CHANNELS, "humidity"}
    heard = {file_name(rows, k) for k in rows.values if k in known} | {k for k in imported.values if k in known}
    left = [k for k in imported.values if k not in heard and not k.startswith("u_") and "err" not in k]
    shown = ", ".join(left[:_NAMED]) + (f" and {len(left) - _NAMED} more" if len(left) > _NAMED else "")
    out = [f"not used: {shown}"] if left else []
    v, n = rows.values, rows.values.get("rpm", np.full(len(rows), np.nan)) / 60.0
    for load, coefficient, power in (("thrust_N", "CT", 4), ("power_W", "CP", 5), ("torque_Nm", "CQ", 5)):
        if load in v and coefficient in v:
            unit = case.air().rho * n ** (3 if load == "power_W" else 2) * case.diameter_m**power
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = float(np.nanmedian(v[load] / (v[coefficient] * unit)))
            out.append(f"{coefficient}: {load} is used, which is {ratio:.3g} times it in the air of the case")
    return out


def _points(imported: Dataset, rows: Dataset, path: str) -> Dataset:
    """Rows as they are: coefficients by their own names, measured channels as a recording names them."""
    values = {k: v for k, v in rows.values.items() if k in {*_POINT, *LOAD_CHANNELS}}
    u = {k[2:]: v for k, v in imported.values.items() if k.startswith("u_")} | stated(rows)
    wet = {k: rows.values.get(k) for k in ("pressure_Pa", "temperature_K", "humidity")}
    if "density_kg_m3" not in values and all(v is not None and np.isfinite(v).all() for v in wet.values()):
        states = zip(*wet.values(), strict=True)
        values["density_kg_m3"] = np.array([Air.from_state(p, t - ZERO_CELSIUS, 100.0 * h).rho for p, t, h in states])
    told = {k: np.abs(v) for k, v in u.items() if k in values}
    return Dataset("bench", Path(path).name, values, told, imported.flags, {"file": path})


def load_all(
    recordings: Sequence[Any], cases: Sequence[Any], references: Sequence[Any] = (), off: Sequence[str] = (),
    said: Mapping[str, Sequence[str]] | None = None, before: Callable[[Sequence[Case]], None] | None = None,
    rpm: Sequence[float] = (), airspeed_m_s: Sequence[float] = (), density_kg_m3: Sequence[float] = (),
    reference_case: Case | None = None,
) -> tuple[list[Case], list[Record]]:  # fmt: skip
    """Cases of the recordings, and recordings with the references last; each a path, a Dataset or a DataFrame.

    ``before`` may refuse the cases before any recording is read. References have the case of the recordings unless
    they have one of their own. Effects are ``said`` by option.
    """
    refuse([*_told_twice([*recordings, *references]), *unknown_effects(said or {})])
    found = at_once(
        lambda: cases_of(cases, off, len(recordings)), *(partial(_there, p) for p in (*recordings, *references))
    )[0]
    if before:
        before(found)
    for case in found:
        prepare_case(case, None, 10)  # an unknown effect in the case is said before the work begins
    chosen = found * len(recordings) if len(found) == 1 else found
    counts = (len(recordings), len(recordings) + len(references))
    given = {"rpm": rpm, "airspeed_m_s": airspeed_m_s, "density_kg_m3": density_kg_m3}
    columns = zip(*(_each(f"--{k.replace('_', '-')}", v, *counts) for k, v in given.items()), strict=True)
    told = [dict(zip(given, row, strict=True)) for row in columns]
    of_each = [*chosen, *[reference_case or found[0]] * len(references)]
    files = list(zip([*recordings, *references], of_each, told, strict=True))
    if references and len(found) > 1 and reference_case is None:
        hint = "--reference-case states that of the references"
        raise InputError(Fault("--reference", "", f"{len(found)} cases", "one case for all, or theirs", hint))
    own, other = files[: len(recordings)], files[len(recordings) :]
    steps = [*_on_grids(own), *(s := _on_grids(other))]
    read = at_once(*(partial(_read, p, c, d, told) for p, c, told, d in steps))
    known = [replace(r, reference=True) for r in read[len(read) - len(s) :]]
    return found, [*read[: len(read) - len(s)], *known]


_File = tuple[Any, "Case", dict[str, float | None]]


def _on_grids(files: Sequence[_File]) -> list[tuple[Any, Case, dict[str, float | None], Dataset | None]]:
    """Files with what was read of each; CFD runs of one condition on several grids are one study, no repeats."""
    from bemt.data.recordings.load import import_file

    read: dict[int, Dataset] = {}
    for i, (path, _, told) in enumerate(files if len(files) > 1 else ()):
        with suppress(InputError):  # said where it is loaded
            if isinstance(path, str):
                run = run_at(path, told["rpm"], told["airspeed_m_s"])
                if run is not None or {*told.values()} == {None}:
                    read[i] = import_file(path) if run is None else run
    runs = {i: run for i, run in read.items() if is_run(run)}
    out, taken = [], set[int]()
    for i, file in enumerate(files):
        if i in taken:
            continue
        group = [i] if i in runs else []
        for k in group and range(i + 1, len(files)):
            if k in runs and files[k][1] is file[1] and are_grids([runs[j] for j in (*group, k)]):
                group.append(k)
        taken |= {*group}
        out.append((*file, together([runs[j] for j in group]) if len(group) > 1 else read.get(i)))
    return out


def _read(given: Any, case: Case, run: Dataset | None, told: Mapping[str, float | None]) -> Record:
    if isinstance(given, str):
        return load(given, case, run, **told)
    if isinstance(given, Dataset) and given.format == "cfd_run":
        return load(given.name, case, given)
    if isinstance(given, Dataset) and "stated" in given.provenance:
        return load(given.provenance["stated"], case, given, **told)
    return records.from_series(given if isinstance(given, Dataset) else from_pandas(given), case)


def at_once(*steps: Callable[[], Any]) -> list[Any]:
    """Results of some steps, or the faults of all of them."""
    out: list[Any] = []
    faults: list[Fault] = []
    for step in steps:
        with gathered(faults):
            out.append(step())
    refuse(faults)
    return out


def is_table(given: Any) -> bool:
    """Whether a recording is given as a Dataset or a DataFrame, not as a file."""
    return isinstance(given, Dataset) or hasattr(given, "columns")


def _there(path: Any) -> None:
    """Refuse a recording that does not exist."""
    if not isinstance(path, str):
        if not is_table(path):
            expected = "a path, a Dataset or a DataFrame"
            raise InputError(Fault("", "recordings", f"{type(path).__name__} {path!r:.40}", expected))
    elif not Path(part_of(path)[0]).exists():
        raise InputError(Fault(path, "", "no such file or folder", "a recording", "Check the path"))


def _each(option: str, given: Sequence[float], recordings: int, n: int) -> list[float | None]:
    """One number for each of n files, the references last: the same for all, or as given."""
    if len(given) not in (0, 1, recordings, n):
        raise InputError(Fault(option, "", f"{len(given)} numbers for {n} files", "one for all, or one each"))
    if len(given) == 1:
        return [float(given[0])] * n
    return [*map(float, given), *[None] * (n - len(given))]


def _told_twice(given: Sequence[Any]) -> Iterator[Fault]:
    """Recordings that count twice."""
    paths = [p for p in given if isinstance(p, str)]
    files = [Path(p).resolve() for p in paths]
    for k, p in enumerate(paths):
        if files[k] in files[:k]:
            yield Fault(p, "", "a recording given twice", "each once", "Its points would count twice")


def unknown_effects(said: Mapping[str, Sequence[str]], known: Collection[str] = ()) -> Iterator[Fault]:
    """Effects, by option, that nobody knows, and what was changed and is ruled out; ``known``: all by default."""
    known = known or effects.catalogue()
    for option, names in said.items():
        for name in names:
            if name not in known:
                near = difflib.get_close_matches(name, known, 1)
                hint = f"Did you mean {near[0]}?" if near else ""
                yield Fault(option, name, "an unknown effect", f"one of {', '.join(known)}", hint)
    for name in sorted({*said.get("--changed", ())} & {*said.get("--ruled-out", ())}):
        yield Fault("--ruled-out", name, "an effect that is changed as well", "one of both")


def _one_setup(imported: Dataset, path: str) -> None:
    """Refuse a table of several propellers or motors: their points are no one curve."""
    from bemt.data.readers.generic_csv import setups

    for name, kinds in setups(imported.texts, imported.values).items():
        got = f"{len(kinds)} set-ups: {few(kinds)}"
        hint = "Put the rows of each into a separate file"
        heading = imported.headings.get(name, name)
        raise InputError(Fault(path, heading, got, "one propeller with one motor", hint))
