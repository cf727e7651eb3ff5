"""``python -m bemt diagnose`` and ``python -m bemt plan``: files in, answer out."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt import effects
from bemt.air import Air
from bemt.base.errors import Fault, InputError
from bemt.base.tables import json_text, write_atomic
from bemt.base.units import ZERO_CELSIUS
from bemt.bem import evaluate
from bemt.case import find_cases, load_case, repeated_names
from bemt.dataset import Dataset
from bemt.diagnose import record as records
from bemt.recordings.channels import view
from bemt.recordings.check import check

if TYPE_CHECKING:
    from bemt.case import Case
    from bemt.diagnose.record import Record
    from bemt.readers._imported import Imported
    from bemt.recordings.channels import Recorded

__all__ = ["load", "run"]

Array = NDArray[np.float64]

_POINT = ("rpm", "J", "airspeed_m_s", "density_kg_m3", "sideslip_deg", *records.COVARIATES)
_LOADS = ("CT", "CP", "CQ", "thrust_N", "torque_Nm", "power_W")
# Share by which a stated diameter or advance ratio may differ from the case's; advance ratios that are as good as none.
_SAME, _SLOW = 0.05, 0.02
_NAMED = 8


def cases_of(paths: Sequence[str], off: Sequence[str], n: int) -> list[Case]:
    """Cases of the command line, one or one for each recording."""
    found = [load_case(p) for given in paths for p in find_cases([given])]
    if len(found) not in (1, n):
        got, expected = f"{len(found)} cases for {n} recordings", "one case, or one for each recording"
        raise InputError(Fault("--case", "", got, expected))
    unknown = [i for i in off if i not in effects.catalogue()]
    if unknown:
        known = ", ".join(effects.catalogue())
        raise InputError([Fault("--off", i, "an unknown effect", f"one of {known}") for i in unknown])
    if off:
        found = [c.replaced({"model.effects_off": [*c.get("model.effects_off"), *off]}) for c in found]
    return found


def load(path: str, case: Case) -> Record:
    """Read one recording, whatever its format.

    Parameters
    ----------
    path : str
        File.
    case : Case
        Diameter, and what the recording does not say.

    Returns
    -------
    Record
        Points.

    Raises
    ------
    InputError
        If the file is not a recording.
    """
    from bemt.recordings import reduce as reduction
    from bemt.recordings.load import import_file

    imported = import_file(path)
    _same_rotor(imported, case, path)
    ducted = case.ducted
    findings = check(imported, diameter_m=case.diameter_m, blades=int(case.get("rotor.blades")), ducted=ducted)
    found = tuple(f"{Path(path).name}: {f}" for f in findings if f.severity != "note")
    rows = view(imported)
    if {"CT", "CP", "CQ"} & set(imported.channels):
        made = records.from_series(_points(imported, rows, path), case)
    else:
        reduced = reduction.reduce(imported, diameter_m=case.diameter_m)
        if reduced.mode == "points" and imported.format == "table":
            # somebody's own table of points: every row counts, a jump from row to row may be what it shows
            made = records.from_series(_points(imported, rows, path), case, reduced.correlated)
        else:
            made = records.from_series(reduced.series, case, reduced.correlated)
    notes = (*made.notes, *imported.warnings, *rows.notes, *_unused(imported, rows, case))
    return replace(made, findings=found, notes=notes)


def _same_rotor(imported: Imported, case: Case, path: str) -> None:
    """Refuse a recording that says itself that it is of another rotor, or contradicts itself."""
    faults = []
    told = imported.constants.get("diameter_m")
    if told and abs(told / case.diameter_m - 1.0) > _SAME:
        faults.append(Fault(path, "diameter_m", f"{told:.4g}", f"{case.diameter_m:.4g} as in the case {case.name}",
                            "The case of another rotor?"))  # fmt: skip
    v = view(imported).values
    if {"J", "airspeed_m_s", "rpm"} <= v.keys():
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = v["airspeed_m_s"] / (v["rpm"] / 60.0 * case.diameter_m) / v["J"]
        ratio = ratio[np.isfinite(ratio) & (v["J"] > _SLOW)]
        if ratio.size and abs(float(np.median(ratio)) - 1.0) > _SAME:
            faults.append(Fault(path, "J", f"airspeed over n D is {np.median(ratio):.3g} times it", "the same number",
                                "Another diameter than the case's, or another unit of the airspeed?"))  # fmt: skip
    if faults:
        raise InputError(faults)


def _unused(imported: Imported, rows: Recorded, case: Case) -> list[str]:
    """Channels that the file has and that nothing here looks at, and loads that it has twice."""
    known = {*_POINT, *_LOADS, "humidity"}
    heard = {rows.names.get(k, k) for k in rows.values if k in known} | {k for k in imported.channels if k in known}
    left = [k for k in imported.channels if k not in heard and not k.startswith("u_") and "err" not in k]
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


def _points(imported: Imported, rows: Recorded, path: str) -> Dataset:
    """Rows as they are: coefficients by their own names, measured channels as a recording names them."""
    n, known = imported.rows, {*_POINT, *_LOADS}
    raw = {k: np.broadcast_to(c.values, (n,)) for k, c in imported.channels.items() if c.values.shape in ((n,), (1,))}
    values = {k: v for k, v in {**raw, **rows.values}.items() if k in known}
    u = {k[2:]: v for k, v in raw.items() if k.startswith("u_")} | dict(rows.u)
    wet = {k: rows.values.get(k) for k in ("pressure_Pa", "temperature_K", "humidity")}
    if "density_kg_m3" not in values and all(v is not None and np.isfinite(v).all() for v in wet.values()):
        states = zip(*wet.values(), strict=True)
        values["density_kg_m3"] = np.array([Air.from_state(p, t - ZERO_CELSIUS, 100.0 * h).rho for p, t, h in states])
    told = {k: np.abs(v) for k, v in u.items() if k in values}
    return Dataset("bench", Path(path).name, values, told, imported.flags, {"file": path})


def _progress(args: argparse.Namespace) -> Callable[[str], None] | None:
    if args.quiet or args.json or not sys.stderr.isatty():
        return None

    def say(what: str) -> None:
        print(f"\r\x1b[K{what} ...", end="", file=sys.stderr, flush=True)

    return say


def run(args: argparse.Namespace) -> int:
    """Run ``diagnose`` or ``plan``.

    Parameters
    ----------
    args : argparse.Namespace
        Parsed command line.

    Returns
    -------
    int
        Exit code.
    """
    return _plan(args) if args.command == "plan" else _diagnose(args)


def _diagnose(args: argparse.Namespace) -> int:
    from bemt.diagnose.chain import diagnose
    from bemt.diagnose.document import document, text

    _told_twice(args)
    cases = cases_of(args.case, args.off, len(args.recordings))
    if args.out:
        _refuse_foreign(Path(args.out), cases)
    for case in cases:
        evaluate.prepare(case, None, 10)  # an unknown effect in the case is said before the work begins
    chosen = cases * len(args.recordings) if len(cases) == 1 else cases
    loaded = [load(p, c) for p, c in zip(args.recordings, chosen, strict=True)]
    if args.reference and len(cases) > 1:
        raise InputError(Fault("--reference", "", f"{len(cases)} cases", "one case for all when there are references"))
    loaded += [replace(load(p, cases[0]), reference=True) for p in args.reference]
    say = _progress(args)
    answer = diagnose(loaded, cases, args.only or None, say, baseline=args.baseline)
    if say:
        print("\r\x1b[K", end="", file=sys.stderr)
    doc = document(answer) | {"recordings": list(args.recordings), "cases": [c.name for c in cases]}
    rendered = json_text(doc)
    if args.out:
        out = Path(args.out)
        out.mkdir(parents=True, exist_ok=True)
        _forget(out, cases)
        write_atomic(out / "diagnosis.json", rendered)
        write_atomic(out / "diagnosis.txt", text(answer) + "\n")
        _improved(out, answer, cases)
        if not args.no_figures:
            from bemt.diagnose import figures

            figures.draw(answer, out)
    if args.json:
        print(rendered, end="")
    elif not args.quiet:
        print(text(answer))
    return 0


def _told_twice(args: argparse.Namespace) -> None:
    """Refuse recordings that count twice and effects that nobody knows."""
    files = [Path(p).resolve() for p in (*args.recordings, *args.reference)]
    faults = [Fault(p, "", "a recording given twice", "each once", "Its points would count twice")
              for k, p in enumerate((*args.recordings, *args.reference)) if files[k] in files[:k]]  # fmt: skip
    known = effects.catalogue()
    faults += [Fault("--only", i, "an unknown effect", f"one of {', '.join(known)}") for i in args.only or ()
               if i not in known]  # fmt: skip
    if faults:
        raise InputError(faults)


def _targets(out: Path, cases: Sequence[Case]) -> dict[Path, Case]:
    """Folder of the improved case of each case: that of the answer, or one by name in it where there are several."""
    own = list({c.path.resolve(): c for c in cases}.values())
    if len(own) == 1:
        return {out: own[0]}
    repeated = repeated_names(dict(enumerate(own)))
    if repeated:
        raise InputError(list(repeated.values()))
    return {out / c.name: c for c in own}


def _written(file: Path) -> bool:
    """Whether a case file is an improved one."""
    from bemt.diagnose.improve import is_improved

    return file.is_file() and is_improved(file.read_text(encoding="utf-8", errors="replace"))


def _refuse_foreign(out: Path, cases: Sequence[Case]) -> None:
    """Let nobody lose files of their own: an improved case goes where only its like has been."""
    from bemt.diagnose.improve import beside

    given, lost = {c.path.resolve() for c in cases}, []
    for folder, case in _targets(out, cases).items():
        target = folder / "case.toml"
        mine = _written(target)
        if target.is_file() and (not mine or target.resolve() in given):
            lost.append(target)
        for file in () if mine else beside(case):
            copy = folder / file.relative_to(case.folder)
            if copy.is_file() and copy.read_bytes() != file.read_bytes():
                lost.append(copy)
    if lost:
        raise InputError([Fault("--out", "", f"a folder with a file of its own, {p.as_posix()}", "a folder without one",
                                "The improved case would replace it") for p in lost])  # fmt: skip


def _forget(out: Path, cases: Sequence[Case]) -> None:
    """Take away the improved cases of the answer that stands in a folder: the next one may have none, or others."""
    try:
        earlier = [str(name) for name in json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))["cases"]]
    except (OSError, ValueError, KeyError, TypeError):
        earlier = []
    given = {c.path.resolve() for c in cases}
    for folder in {out, *(out / name for name in earlier if Path(name).name == name != "..")}:
        file = folder / "case.toml"
        if _written(file) and file.resolve() not in given:
            file.unlink()


def _improved(out: Path, answer: Any, cases: Sequence[Case]) -> None:
    """Save the cases with what was found on, cases that `sweep` runs."""
    from bemt.diagnose.improve import beside, improved_case

    for folder, case in _targets(out, cases).items():
        document = improved_case(answer, case, case.path.read_text(encoding="utf-8-sig"))
        if document:
            for file in beside(case):  # stations, sections and recorded values lie beside the case, as before
                write_atomic(folder / file.relative_to(case.folder), file.read_bytes())
            write_atomic(folder / "case.toml", document)


def _plan(args: argparse.Namespace) -> int:
    from bemt.diagnose import plan

    cases = cases_of([args.case], args.off, 1)
    say = _progress(args)
    answer = plan.plan(plan.points(args.plan, cases[0]), cases[0], say)
    if say:
        print("\r\x1b[K", end="", file=sys.stderr)
    if args.json:
        print(json_text(plan.document(answer)), end="")
    elif not args.quiet:
        print(plan.text(answer))
    if args.out:
        out = Path(args.out)
        out.mkdir(parents=True, exist_ok=True)
        write_atomic(out / "plan.json", json_text(plan.document(answer)))
    return 0
