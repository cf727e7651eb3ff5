"""Recording against recording: what changed, from the ratios alone or through the solver with A as reference of B."""

from __future__ import annotations

import math
import os
import shlex
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from bemt.base.action import Told
from bemt.base.document import rows_of
from bemt.base.errors import Fault, InputError, refuse
from bemt.base.page import FIRST
from bemt.base.tables import json_text, write_atomic
from bemt.base.units import INCH
from bemt.data.readers.left_open import meant as left_open
from bemt.data.readers.left_open import one_step
from bemt.data.recordings.channels import named
from bemt.data.recordings.check import OPEN_OR_OUT, check, left_out
from bemt.data.recordings.load import as_stated, import_file, is_measured, one_as_stated, stated_options
from bemt.data.recordings.shown import between_setups, options_of
from bemt.data.recordings.stated import IGNORED, filled
from bemt.judge.compare import drive_laws, one_run, two_runs
from bemt.judge.compare.change_document import DIAGNOSED, ComparedRuns, RankedCause, document, next_step, text
from bemt.judge.compare.matched import WITHOUT_SPEED, stand_run
from bemt.judge.compare.recordings import RunChange
from bemt.judge.compare.selection import Invocation, conditions_of, like_loads, selected, with_air
from bemt.judge.diagnose import by_laws
from bemt.judge.diagnose.load import at_once, is_table, load, load_all, unknown_effects
from bemt.judge.diagnose.record import from_series
from bemt.judge.diagnose.suggest import Given
from bemt.judge.loss import VerdictAnswer
from bemt.physics import effects
from bemt.physics.dataset import Dataset, from_pandas
from bemt.rotors.propeller import Propeller, rotor_of
from geometry.common import GeometryError
from geometry.designation import parse_designation

if TYPE_CHECKING:
    import pandas as pd

    from bemt.data.recordings.findings import Finding
    from bemt.rotors.case import Case

# Finding on a column that is no measurement; two columns with one ratio may be computed ones.
_STUCK = "constant_column"
# Rows and number of the values of a column that tells parts of one file apart.
_ROWS, _KINDS = 3, 20


@dataclass(frozen=True, eq=False)
class Contrast(VerdictAnswer):
    """What changed between two recordings.

    Attributes
    ----------
    change : RunChange
        Ratios and scaling.
    said : ComparedRuns
        What is said of them.
    """

    change: RunChange
    said: ComparedRuns

    @property
    def document(self) -> dict[str, Any]:
        """``bemt.comparison/1``."""
        return self.said.document()

    @property
    def text(self) -> str:
        """The answer on one screen."""
        return text(self.said)

    @property
    def details(self) -> str:
        """The answer with its ranking, sub-systems and all notes."""
        return text(self.said, details=True)

    def to_pandas(self) -> pd.DataFrame:
        """A row for each channel that both recorded: ``ratio`` of B over A, its ends and how it changes along n."""
        import pandas as pd

        rows = pd.DataFrame([{"channel": k, **v} for k, v in self.document["ratios"].items()])
        return rows.drop(columns=[k for k in rows if isinstance(rows[k].iloc[0], (list, dict))])

    def picture(self) -> bytes:
        """The two recordings and what changed, as PNG."""
        from bemt.judge.compare.first_picture import picture

        return picture(self.change, self.said)

    def __repr__(self) -> str:
        """Say the verdict in a line."""
        runs = f"{self.change.a.points.name}, {self.change.b.points.name}"
        return f"<contrast of {runs}: {' '.join((self.verdict, ', '.join(self.effects))).strip()}>"


def compare(
    a: Any, b: Any, case: Propeller | Case | str | os.PathLike[str] | None = None, *, diameter_m: float | None = None,
    label: str | None = None, rows_a: Sequence[str] = (), rows_b: Sequence[str] = (), air_a: str | None = None,
    air_b: str | None = None, ruled_out: Sequence[str] = (), changed: Sequence[str] = (),
    progress: Callable[[str], None] | None = None, run: Mapping[str, Any] | None = None,
) -> Contrast:  # fmt: skip
    """Say what changed between two recordings of one stand: paths, Datasets or DataFrames.

    ``label``, such as ``"10x5"``, gives the diameter. ``air_a`` and ``air_b`` say what the files do not:
    ``"22C,1013hPa"``, ``"22C"``, ``"1.19kg/m3"``, ``"18m/s"``. Effects are ``ruled_out`` by a check, or were
    ``changed``.

    Notes
    -----
    Loads are compared as load / (rho n^2) on a smooth curve over ln n and V/(n D), by Gaussian processes (Rasmussen and
    Williams 2006, eq. 2.23 to 2.24 and 2.37 to 2.42). Density counts where both recordings tell it.
    """
    names = ["A" if is_table(a) else os.fspath(a), "B" if is_table(b) else os.fspath(b)]
    D = label_diameter(label) if diameter_m is None else diameter_m
    rotor = None if case is None else rotor_of(case).case
    named = None if rotor is None else os.fspath(case) if isinstance(case, str | os.PathLike) else rotor.path.as_posix()
    asked = Invocation(names[0], names[1], tuple(rows_a), tuple(rows_b), air_a, air_b, label, named, diameter_m,
                       stated_options(run or {}), tuple(ruled_out), tuple(changed))  # fmt: skip
    _known(asked)
    if (a is b or Path(names[0]).resolve() == Path(names[1]).resolve()) and sorted(rows_a) == sorted(rows_b):
        expected = "two recordings, or two choices of rows"
        raise InputError(Fault(names[0], "", "the same recording twice", expected, _two_choices(names[0])))
    read: list[Dataset] = at_once(partial(_read, a, names[0], rows_a, air_a, "--air-a", run or {}),
                                  partial(_read, b, names[1], rows_b, air_b, "--air-b", run or {}))  # fmt: skip
    if all(f"rpm: {IGNORED} rpm" in imported.notes for imported in read):
        raise InputError(
            Fault("--rpm", "", "two files with a speed of their own", "a file without one", "Leave it out")
        )
    D = rotor.diameter_m if rotor is not None and D is None else D
    rho = None if rotor is None else float(rotor.air().rho)
    findings = [_findings(imported, D, rotor is not None and rotor.ducted, rho) for imported in read]
    read = [_sound(imported, found) for imported, found in zip(read, findings, strict=True)]
    told = [f"{name} ({', '.join(rows)})" if rows else name for name, rows in zip(names, (rows_a, rows_b), strict=True)]
    one, two = at_once(*(partial(stand_run, imported, name, D) for imported, name in zip(read, told, strict=True)))
    found = by_laws.changed(one, two, math.nan if D is None else D, ruled_out, changed)
    said = document(found)
    if rotor is not None and not (found.wind or found.without_speed):
        said = _diagnosed(said, asked, read, rotor, found, progress)
    return Contrast(found, replace(
        said, recordings=tuple(names), rows={"A": tuple(rows_a), "B": tuple(rows_b)},
        notes=(*_errors(findings), *_unread(read, names), *_bare_notes(read), *said.notes),
        next_measurement=_next(said, found, asked, read),
    ))  # fmt: skip


def _known(asked: Invocation) -> None:
    """Refuse effects that nobody knows, and a change that shows in no ratio."""
    drives = [*dict.fromkeys([*effects.catalogue(), *drive_laws.NAMES])]
    faults = [*unknown_effects({"--ruled-out": asked.ruled_out, "--changed": asked.changed}, drives)]
    shown = {*by_laws.law_effects(), *drive_laws.NAMES}
    for name in () if asked.case or faults else asked.changed:
        if name not in shown:
            hint = f"With a case of the rotor the solver weighs it: {asked.command(case='CASE')}"
            faults.append(Fault("--changed", name, "an effect that ratios alone do not show", "--case CASE", hint))
    refuse(faults)


def _read(given: Any, name: str, rows: Sequence[str], air: str | None, option: str, run: Mapping[str, Any]) -> Dataset:
    """A recording as the user states it."""
    if is_table(given):
        told = as_stated([given], {k: v for k, v in run.items() if k != "rpm"})[0]
        made = filled(from_pandas(told, name=name) if hasattr(told, "columns") else cast(Dataset, told), run.get("rpm"))
    else:
        made = one_as_stated(name, run)
    if not len(made):
        raise InputError(Fault(name, "", "no rows", "two points or more"))
    return with_air(selected(made, list(rows), name), air, option)


def _bare(imported: Dataset) -> dict[str, str]:
    """Voltage and current that a recording has without their units: heading by quantity."""
    columns = [imported.headings.get(k) or k for k in imported.values if imported.units.get(k) == ""]
    found = left_open(columns, imported.values)
    return {q: name for q, name in found.items() if q in ("voltage", "current")}


def _bare_notes(read: Sequence[Dataset]) -> list[str]:
    """Notes on voltage and current that are not used, for want of a unit."""
    of: dict[str, list[str]] = {}
    for letter, imported in zip("AB", read, strict=True):
        if bare := " and ".join(map(repr, _bare(imported).values())):
            of.setdefault(bare, []).append(letter)
    return [f"warning in {' and '.join(letters)}: {bare} not used, without a unit" for bare, letters in of.items()]


def _next(said: ComparedRuns, change: RunChange, asked: Invocation, read: Sequence[Dataset]) -> Mapping[str, Any]:
    """Next step, with a command unless it would ask the same again; units that are open come before a speed."""
    bare = [_bare(imported) for imported in read]
    if change.without_speed == WITHOUT_SPEED["at_command"] and bare[0].keys() >= {"voltage"} and bare[0] == bare[1]:
        text = (
            f"state the unit of {' and '.join(map(repr, bare[0].values()))}: at equal power a battery makes no change"
        )
        units = [*asked.stated.get("unit", ()), *(f"{name}=UNIT" for name in bare[0].values())]
        return {"text": text, "command": asked.command(stated={**asked.stated, "unit": units}), "checks": ""}
    step: Mapping[str, Any] = said.diagnosis["next_measurement"] if said.diagnosis else next_step(change, asked)
    command = [*step["commands"], ""][0] if said.diagnosis else step["command"]
    return {**step, "command": "" if command == asked.command() else command}


def compared(
    a: Any, b: Any, case: Any, *, label: str | None, diameter_m: float | None, rows_a: Sequence[str],
    rows_b: Sequence[str], air_a: str | None, air_b: str | None, out: str | None, figures: bool,
    progress: Callable[[str], None] | None, run: Mapping[str, Any] | None = None, ruled_out: Sequence[str] = (),
    changed: Sequence[str] = (),
) -> Contrast | Told:  # fmt: skip
    """One CFD run beside a case, two grids of a run, two CFD runs, or two recordings; written if a folder is given."""
    found: Contrast | Told
    tables = is_table(a) or is_table(b)
    of_two = {"--air-a": air_a, "--air-b": air_b, "--ruled-out": ruled_out, "--changed": changed}
    if b is None:
        refuse(_unused({"--rows-a": rows_a, "--rows-b": rows_b, **of_two}, "one file, beside a case"))
        if case is None:
            inside = between_setups(one_as_stated(a, run or {}), a) if is_measured(a) else []
            pair = " ".join(["bemt compare", *inside, *options_of(stated_options(run or {}))])
            hint = f"Two set-ups of this file: {pair}" if inside else "Two recordings, A B, need none"
            raise InputError(Fault("--case", "", "one recording and no case", "the case to compare it with", hint))
        typed = "" if is_table(a) else os.fspath(a)
        given = as_stated([a], run or {})[0]
        given = from_pandas(given) if hasattr(given, "columns") else given
        one = one_run.compare_run(given, case, progress, file=typed)
        found = Told(one.document(), one_run.text(one), one_run.text(one, details=True))
    elif not tables and (runs := two_runs.compare_runs(a, b, rows_a, rows_b, run or {})) is not None:
        refuse(_unused(of_two, "two runs of CFD, of which no cause is named"))
        found = Told(runs.document(), runs.text)
    else:
        found = compare(a, b, case, label=label, diameter_m=diameter_m, rows_a=rows_a, rows_b=rows_b, air_a=air_a,
                        air_b=air_b, ruled_out=ruled_out, changed=changed, progress=progress, run=run)  # fmt: skip
    if out is not None:
        beside = case if figures and not (rows_a or rows_b or air_a or air_b) else None
        _write(Path(out), found, figures, [name for name in (a, b) if name is not None], beside)
    return found


def _unused(given: Mapping[str, Any], here: str) -> list[Fault]:
    """Options that are of no use here."""
    return [Fault(option, "", here, "two recordings of measurements") for option, value in given.items() if value]


def _write(out: Path, found: Contrast | Told, figures: bool, files: Sequence[str], case: Any) -> None:
    """Write comparison.json, its text, a picture, and the recordings inside the prediction band of the case."""
    from bemt.judge.diagnose.figures import first_picture

    out.mkdir(parents=True, exist_ok=True)
    write_atomic(out / "comparison.json", json_text(found.to_dict()))
    write_atomic(out / "comparison.txt", (found.details or found.text) + "\n")
    if figures and isinstance(found, Contrast):
        write_atomic(out / "comparison.png", found.picture())
    if case is not None and not (isinstance(found, Told) and len(files) > 1):
        cases, records = load_all(files, [case])
        write_atomic(out / f"{FIRST}.png", first_picture(records, cases)[0].png())


def _findings(
    imported: Dataset, diameter_m: float | None, ducted: bool, density_kg_m3: float | None
) -> tuple[Finding, ...]:
    """What cannot be so in a recording, what it leaves open or out, as ``import`` and ``diagnose`` find it."""
    of_rotor = {"diameter_m": diameter_m, "density_kg_m3": density_kg_m3}
    found = check(imported, ducted=ducted, **of_rotor) if imported.kind in ("bench", "table") else ()
    # a propeller that windmills pulls the other way; signs have a note of their own
    return tuple(f for f in found if (f.severity == "error" or f.id in OPEN_OR_OUT) and f.id != "sign_flipped")


def _sound(imported: Dataset, findings: Sequence[Finding]) -> Dataset:
    """The recording without readings, and columns, that are no measurement."""
    imported, gone = left_out(imported, findings), {f.channel for f in findings if f.id == _STUCK}
    if not gone:
        return imported
    values = {k: v for k, v in imported.values.items() if k not in gone}
    return replace(imported, values=values, u={k: v for k, v in imported.u.items() if k in values}, u_by={})


def _errors(findings: Sequence[Sequence[Finding]]) -> list[str]:
    """Notes on what cannot be so in A and B, and on what is open or left out."""
    out = []
    for letter, found in zip("AB", findings, strict=True):
        for f in found:
            told = f.evidence if f.evidence.startswith(f.channel) else f"{f.channel}: {f.evidence}"
            left = "; left out" if f.id == _STUCK else f"; {f.correction}" if f.severity == "warning" else ""
            out.append(f"{f.severity} in {letter}: {f.id}: {told}{left}")
    return out


def _unread(read: Sequence[Dataset], names: Sequence[str]) -> list[str]:
    """Notes on a load that the other recording has, where columns without a unit go with the speed as a load does."""
    known, out = [named(imported) for imported in read], []
    for k, letter in enumerate("AB"):
        lacks = [c.partition("_")[0] for c in ("thrust_N", "torque_Nm") if c in known[1 - k] and c not in known[k]]
        columns = like_loads(read[k], known[k]) if lacks else []
        if columns:
            how = one_step(names[k], [f"--column {lacks[0]}={shlex.quote(columns[0])}", f"--unit {lacks[0]}=UNIT"])
            goes = f"{' and '.join(map(repr, columns))}, which {'goes' if len(columns) == 1 else 'go'}"
            out.append(f"warning in {letter}: no {' and no '.join(lacks)} is read, which {'BA'[k]} has; not used, "
                       f"without a unit: {goes} with the speed as loads do. State it as in: {how}")  # fmt: skip
    return out


def _two_choices(name: str) -> str:
    """How to choose two parts of one file, with a column that tells them apart."""
    how = "Its scatter would count as agreement"
    try:
        found = import_file(name)
    except InputError:
        return how
    cells = {**found.texts, **{k: tuple(f"{v:g}" for v in found[k]) for k in conditions_of(found) if k in found.values}}
    for column, kinds in cells.items():
        told = [k for k, n in Counter(kinds).items() if n >= _ROWS and k.strip() not in ("", "nan")]
        if 2 <= len(told) <= _KINDS:
            one, two = (shlex.quote(f"{column}={k}") for k in told[:2])
            return f"{how}; choose as in --rows-a {one} --rows-b {two}"
    return how


def _diagnosed(
    said: ComparedRuns, asked: Invocation, read: Sequence[Dataset], case: Case, found: RunChange,
    progress: Callable[[str], None] | None,
) -> ComparedRuns:  # fmt: skip
    """The same with the verdict of the diagnosis of B with A as reference."""
    from bemt.judge.diagnose.chain import diagnose
    from bemt.judge.diagnose.document import document as diagnosis
    from bemt.judge.diagnose.document import full_scale
    from bemt.judge.diagnose.document import told as sentences

    a, b = (
        load(name, case, imported) if "format" in imported.provenance else from_series(imported, case)
        for name, imported in zip((asked.a, asked.b), read, strict=True)
    )
    answer = diagnose([b, replace(a, reference=True)], [case], None, progress, given=_given(asked), change=found)
    by_case = diagnosis(answer)
    found_by_case = sentences(answer)
    told = [*found_by_case.causes, *found_by_case.against]
    told = [f"The case {case.name}, with A as reference:", *told] if told else []
    verdict, effects, probability, ranking, rule = (by_case[k] for k in DIAGNOSED)
    return replace(said, verdict=verdict, effects=tuple(effects), probability=probability, rule=rule,
                   sets=tuple(map(tuple, by_case["sets"])),
                   ranking=rows_of(RankedCause, ranking), diagnosis=by_case, case=case.name,
                   told=tuple(told), full_scale=full_scale(answer))  # fmt: skip


def _given(asked: Invocation) -> Given:
    """Commands of the diagnosis that carry what was asked; rows and air are taken by a comparison alone."""

    class _Pair(Given):
        def command(self, run: str = "", reference: str = "", ruled_out: str = "") -> str:
            if not asked.chosen:
                return super().command(run, reference, ruled_out)
            again = asked.without(ruled_out) if ruled_out else asked.command(b=run or asked.b)
            return asked.command(a=reference) if reference else again

        def comparison(self, reference: str) -> str:
            return asked.command(a=reference, case=None)

        def of_days(self) -> tuple[str, ...]:
            return (asked.with_days(),)

    case = f"--case {shlex.quote(asked.case or 'CASE')}"
    return _Pair((shlex.quote(asked.b),), (shlex.quote(asked.a),), case, ruled_out=asked.ruled_out,
                 changed=asked.changed, stated=asked.stated)  # fmt: skip


def label_diameter(label: str | None) -> float | None:
    """Diameter of a label such as 10x5 [m]."""
    if label is None:
        return None
    try:
        return parse_designation(label).diameter_in * INCH
    except GeometryError as error:
        raise InputError([Fault("--label", *fault) for fault in error.faults]) from error
