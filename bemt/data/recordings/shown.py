"""What ``import`` shows of files and CFD runs: as text, and as plain values.

Schema ``bemt.import/1``: ``runs`` is a list of CFD runs (``name``, ``files``, ``points``, ``averaged``, ``drift``,
``conditions``, ``notes``), ``to_do`` what would make the files one run (null: nothing, or they are none). ``files`` is
a list of ``path``, ``format``, ``kind``, ``rows``, ``channels`` (name to ``unit``, ``mean``, ``averaged_over``,
``drift``), ``warnings``, ``error`` (null when the file was read), ``findings`` (``id``, ``channel``, ``evidence``,
``correction``, ``rows``, ``severity``; nothing is corrected) and ``reduction`` (null unless it is a recording:
``mode``, ``points``, ``correlated``, ``dropped`` with first ``line`` and ``last``, ``channel`` and ``reason``,
``notes``, ``error``). A channel of a recording has a mean only where the recording is one steady point.
"""

from __future__ import annotations

import math
import shlex
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base import tables
from bemt.base.averaging import Mean
from bemt.base.errors import EXIT_INPUT, EXIT_INTERNAL, EXIT_OK
from bemt.data.readers.cfd_run import KIND as RUN
from bemt.data.readers.headings import USUAL
from bemt.data.readers.recording import Remark
from bemt.data.recordings.cfd_setup import CfdRun, conditions_text
from bemt.data.recordings.channels import named
from bemt.data.recordings.findings import Finding
from bemt.data.recordings.reduce import Reduction, reduction
from bemt.physics.dataset import Dataset

SCHEMA = "bemt.import/1"
INTERNAL = "internal error of this program"
"""Start of the error of a file on which a reader failed."""
_LOADS = {"thrust_N", "torque_Nm", "CT", "CP"}
SHOWN = ("run", "pwm_s", "throttle", "rpm", "airspeed_m_s", "J", "thrust_N", "torque_Nm", "power_W",
         "electrical_power_W", "CT", "CP", "eta", "FM")  # fmt: skip
"""Channels of the table of points, as far as they are there."""
_ROWS = 20  # channels on one screen
MOST = 40
"""Points shown; JSON has all."""


def options_of(told: Mapping[str, Sequence[str | float]], *only: str) -> list[str]:
    """Words of options, of those (`only`) that were told, quoted for a shell.

    >>> options_of({"rpm": [6000.0], "only": [], "column": ["thrust=load cell"]})
    ['--rpm', '6000', '--column', "'thrust=load cell'"]
    """
    words = {name: [shlex.quote(v if isinstance(v, str) else f"{v:g}") for v in told[name]] for name in told}
    return [word for name, values in words.items() if values and name in (only or told)
            for word in (f"--{name}", *values)]  # fmt: skip


def between_setups(record: Dataset, path: str) -> list[str]:
    """Words of `compare` for the first two set-ups that a column of text tells apart in one file; none without."""
    from bemt.data.readers.generic_csv import setups

    for name, (one, two, *_) in setups(record.texts).items():
        file = shlex.quote(path)
        return [file, file, *options_of({"rows-a": [f"{name}={one}"], "rows-b": [f"{name}={two}"]})]
    return []


def reduction_document(reduced: Dataset | str | None) -> dict[str, Any] | None:
    """The part of the JSON document that holds the steady points."""
    if reduced is None:
        return None
    if isinstance(reduced, str):
        return {"mode": None, "points": [], "correlated": {}, "dropped": [], "notes": [], "error": reduced}
    how = reduction(reduced)
    rows = [{**row, "direction": way} for row, way in zip(reduced.to_rows(), how.directions, strict=True)]
    return {
        "mode": how.mode, "points": rows, "correlated": {k: dict(v) for k, v in how.correlated.items()},
        "dropped": [asdict(lost) for lost in how.dropped], "notes": list(reduced.notes), "error": None,
    }  # fmt: skip


def ranges(lines: Iterable[tuple[int, int]]) -> str:
    """First and last lines as ranges.

    >>> ranges([(5, 5), (2, 3), (4, 4), (9, 9)])
    '2-5, 9'
    """
    out: list[list[int]] = []
    for first, last in sorted(set(lines)):
        if out and first <= out[-1][1] + 1:
            out[-1][1] = max(last, out[-1][1])
        else:
            out.append([first, last])
    return ", ".join(f"{a}" if a == b else f"{a}-{b}" for a, b in out)


def points_text(reduced: Dataset | str) -> list[str]:
    """Steady points, what was dropped and the notes, as lines of text."""
    if isinstance(reduced, str):
        return [f"  not reduced: {reduced}"]
    how, n = reduction(reduced), len(reduced)
    columns = _columns_of_points(reduced)
    many = "" if n <= MOST else f", the first {MOST} of them"
    what = "one per row" if how.mode == "points" else "means of plateaus"
    rows = list(zip(*(column[:MOST] for column in columns.values()), strict=True))
    shared = (f"{channel}: {', '.join(f'{k} {v:.3g}' for k, v in parts.items())}"
              for channel, parts in how.correlated.items())  # fmt: skip
    return [
        f"  {tables.number_of(n, 'steady point')}, {what}{many}:",
        tables.text_table(list(columns), rows, (len(columns) - 1,), "    "),
        *(f"  {text}" for text in dropped_words(how)), *(f"  shared by all points, {text}" for text in shared),
        *(f"  . {t}" for t in reduced.notes),
    ]  # fmt: skip


def _columns_of_points(points: Dataset) -> dict[str, list[str]]:
    """Cells of a table of points by heading: lines of the file, channels with their u, flags."""
    values, stated_u = ({k: v for k, v in d.items() if np.isfinite(v).any()} for d in (points.values, points.u))
    if "throttle" in values:  # one command
        values.pop("pwm_s", None)
    columns = {"from": [label.rsplit(":", 1)[-1] for label in points.labels or ("",) * len(points)]}
    for name in (k for k in SHOWN if k in values):
        columns[name] = [_cell(name, x, 5) for x in values[name][:MOST]]
        if name in stated_u:
            columns[f"u({name})"] = [_cell("", x, 2) for x in stated_u[name][:MOST]]
    return columns | {"flags": [", ".join(flags) or "-" for flags in points.flags]}


def _curve(record: Dataset) -> list[str]:
    """Rows of coefficients, which are points as they stand."""
    shown = [k for k in (*SHOWN, "CQ") if k in record.values]
    rows = [[_cell(k, record[k][i], 5) for k in shown] for i in range(min(len(record), MOST))]
    many = f"  the first {MOST} of {len(record)} rows:" if len(record) > MOST else f"  {len(record)} rows:"
    return [many, tables.text_table(shown, rows, (), "    ")]


def _cell(name: str, value: float, digits: int) -> str:
    if name == "rpm":
        return tables.speed_text(float(f"{value:.5g}"))
    return tables.number_text(float(value) if math.isfinite(value) else None, digits)


def dropped_words(how: Reduction) -> Iterator[str]:
    """What was left out, with its lines, a reason a line."""
    reasons: dict[tuple[str, str], list[tuple[int, int]]] = {}
    for lost in how.dropped:
        what = f"values of {lost.channel}" if lost.channel else "rows"
        reasons.setdefault((what, lost.reason), []).append((lost.line, lost.last))
    for (what, reason), lines in reasons.items():
        text = ranges(lines)
        text = text if len(text) <= 90 else text[:90].rsplit(",", 1)[0] + ", ..."
        yield f"dropped {sum(b - a + 1 for a, b in lines)} {what} (lines {text}): {reason}"


_OF_RUNS = {"rpm": "rev/min", "airspeed_m_s": "V [m/s]", "J": "J", "thrust_N": "thrust [N]",
          "duct_thrust_N": "of it duct [N]", "torque_Nm": "torque [N m]", "power_W": "power [W]",
          "CT": "CT", "CQ": "CQ", "CP": "CP"}  # fmt: skip


def _with_u(x: float, u: float) -> str:
    return tables.number_text(x, 5) + (f" ± {tables.number_text(u, 2)}" if math.isfinite(u) else "")


def run_text(d: CfdRun) -> str:
    """A run for a terminal: points with u, what was averaged, what was decided."""
    averaged, drifts = d.averaged, d.drift
    names = [k for k in _OF_RUNS if k in d]
    rows = [[_with_u(d[k][i], d.u[k][i]) for k in names] for i in range(len(d))]
    lines = [f"one run: {', '.join(Path(f).name for f in d.files)}"]
    lines.append(tables.text_table([_OF_RUNS[k] for k in names], rows, (), "  "))
    for over in dict.fromkeys(averaged.values()):
        own = [k.rsplit("_", 1)[0] for k, v in averaged.items() if v == over]
        drift = ", ".join(f"{k.rsplit('_', 1)[0]} {v:+.2%}" for k, v in drifts.items() if averaged.get(k) == over)
        lines.append(f"  {', '.join(own)}: {over}" + (f"; drift {drift}" if drift else ""))
    return "\n".join([*lines, f"  set-up: {conditions_text(d.conditions)}", *(f"  ! {note}" for note in d.notes)])


@dataclass(frozen=True, eq=False)
class ImportedFile:
    """One file as it was read, or why it was not."""

    path: str
    format: str | None
    record: Dataset | None = None
    reduced: Dataset | str | None = None  # Steady points of a recording, or why there are none
    means: Mapping[str, Mean] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    warnings: tuple[str, ...] = ()
    error: str | None = None

    @property
    def title(self) -> str:
        """The file in a line."""
        kind, rows = (self.record.kind, len(self.record)) if self.record else (None, 0)
        return f"{self.path}: {self.format} ({kind}), {rows} rows"

    @property
    def step(self) -> str:
        """Command that states what it leaves open of its loads or its speed; empty where nothing is."""
        return "" if self.record is None else self.record.provenance.get("step", "")

    @property
    def curve(self) -> bool:
        """Whether its rows are coefficients, points as they stand."""
        record = self.record
        return bool(record and self.reduced is None and not record.clock and {"CT", "CP", "CQ"} & record.values.keys())

    @property
    def sentence(self) -> str:
        """What a recording holds and whether it contradicts itself; "" for what is none."""
        points = self.record if self.curve else self.reduced
        if self.record is None or not isinstance(points, Dataset):
            return ""
        from bemt.data.recordings.first_sentence import sentence

        return sentence(self.record, points, self.findings, bool(self.step))

    def document(self) -> dict[str, Any]:
        """Plain values."""
        record = self.record
        return {
            "path": self.path, "format": self.format, "kind": record.kind if record else None,
            "rows": len(record) if record else 0,
            "channels": {k: self._channel(k) for k in record.values} if record else {},
            "warnings": list(self.warnings), "error": self.error,
            "findings": [asdict(finding) for finding in self.findings], "reduction": reduction_document(self.reduced),
        }  # fmt: skip

    def _channel(self, name: str) -> Mapping[str, str | float | None]:
        found = self.means.get(name)
        known = found is not None and math.isfinite(found.value)
        mean, over = (found.value, found.over) if found is not None and known else (None, "")
        unit = self.record.unit(name) if self.record else ""
        return {"unit": unit, "mean": mean, "averaged_over": over, "drift": found.drift if found else None}

    @property
    def text(self) -> str:
        """What is in it, for a terminal; what was refused is in `Imported.complaints`."""
        if self.record is None:
            return ""
        told = [
            f"  ! {f.severity}: {f.id} in {f.channel}: {f.evidence}. Suggestion: {f.correction}" for f in self.findings
        ]
        errors = [text for f, text in zip(self.findings, told, strict=True) if f.severity == "error"]
        first = textwrap.wrap(self.sentence, 110, initial_indent="  ", subsequent_indent="    ")
        lines = [self.title, *first, *errors, *self._channels_text(self.record, {} if self.curve else self.means)]
        lines += points_text(self.reduced) if self.reduced is not None else _curve(self.record) if self.curve else []
        step = self.step.partition("   (")[0]  # it stands under Next
        lines += [f"  {'.' if isinstance(w, Remark) else '!'} {w}" for w in self.warnings if not step or step not in w]
        lines += [text for text in told if text not in errors]
        return "\n".join(lines)

    def _channels_text(self, record: Dataset, means: Mapping[str, Mean]) -> list[str]:
        """Table of the channels with a mean, and the names of the others."""
        rows, plain = [], []
        for name in record.values:
            unit, found = record.unit(name).replace("_", "/"), means.get(name)  # SI: m_s, rad_s
            if found is None or not math.isfinite(found.value):
                plain.append(f"{name} [{unit}]" if unit not in ("", "-", "1") else name)
                continue
            drift = "-" if found.drift is None else f"{found.drift:+.2%}"
            rows.append([name, unit or "-", tables.number_text(found.value, 6), drift, found.over])
        lines = []
        if len(rows) > _ROWS:  # of a report by zones the sums, with their parts in JSON
            sums = [row for row in rows if "_total_" in row[0]] or rows[:_ROWS]
            lines.append(f"  {len(sums)} of {len(rows)} channels (--json has all):")
            rows = sums
        if rows:
            heads = ["channel", "unit", "mean", "drift", "averaged over"]
            lines.append(tables.text_table(heads, rows, (0, 1, 4), "  "))
        if plain:
            lead = "  not averaged: " if rows else "  channels: "
            lines.append(textwrap.fill(", ".join(plain), 110, initial_indent=lead, subsequent_indent="    "))
        return lines


@dataclass(frozen=True, eq=False)
class Imported:
    """Files as they were read, the CFD runs among them, and what would make the files one run."""

    files: tuple[ImportedFile, ...]
    runs: tuple[CfdRun, ...]
    to_do: str | None

    def document(self) -> dict[str, Any]:
        """Plain values, ``bemt.import/1``."""
        return {"schema": SCHEMA, "files": [f.document() for f in self.files],
                "runs": [d.document() for d in self.runs], "to_do": self.to_do}  # fmt: skip

    @property
    def complaints(self) -> tuple[str, ...]:
        """What could not be read and why, for the error stream."""
        nothing = () if self.files or not self.to_do else (self.to_do,)
        return (*(f.error for f in self.files if f.error is not None), *nothing)

    @property
    def exit_code(self) -> int:
        """Worst of all files: 3 when a reader failed, 2 when a file was refused or nothing was read, else 0."""
        told = self.complaints
        return EXIT_INTERNAL if any(text.startswith(INTERNAL) for text in told) else EXIT_INPUT if told else EXIT_OK

    def text(self, wrote: str = "", said: Mapping[str, Sequence[str | float]] = {}) -> str:  # noqa: B006
        """For a terminal, with what to do next with recordings of a rotor, of which the options `said` were given."""
        own = {name for run in self.runs for name in run.files}
        lines = [f.title if f.path in own else f.text + "\n" for f in self.files
                 if f.format != RUN and f.error is None]  # fmt: skip
        grids = {name for run in self.runs if run.studies for name in run.files if name != run.file}  # of its study
        lines += [run_text(run) + "\n" for run in self.runs if run.file not in grids]
        if self.to_do and self.files:
            steps = "\n".join(f"  ! {line}" for line in self.to_do.splitlines())
            lines.append(f"To use it as a CFD run, and --out run.toml to keep it:\n{steps}\n")
        if wrote or self.runs:
            return "\n".join([*lines, self._next_with_a_run(wrote, said or {"case": ["CASE"]})])
        return "\n".join([*lines, *self._next_with_recordings(said or {"case": ["CASE"]})])

    def _next_with_a_run(self, wrote: str, said: Mapping[str, Sequence[str | float]]) -> str:
        """What to do with a CFD run: in the file that was written, in one that was given, or in one to be written."""
        name = "" if wrote else self.runs[0].file
        usable = Path(name).is_file() and name.endswith(".toml")
        usable = usable or any(f.path == name and f.format == RUN for f in self.files)
        file = wrote or (name if usable else "study.toml" if self.runs[0].studies else "run.toml")
        lead = f"{wrote} written. " if wrote else "" if file == name else f"With --out {file}: "
        said = said if file == name else {"case": said["case"]}
        return f"{lead}Next: bemt compare {' '.join([shlex.quote(file), *options_of(said)])}{_a_case(said)}\n"

    @property
    def _turned(self) -> list[str]:
        """Quantities whose sign is flipped in every file."""
        flips = [{USUAL.get(g.channel, g.channel).rsplit("_", 1)[0] for g in f.findings
                  if g.id == "sign_flipped" and g.severity == "warning"} for f in self.files]  # fmt: skip
        return sorted(set[str]().union(*flips).intersection(*flips))

    def _next_with_recordings(self, said: Mapping[str, Sequence[str | float]]) -> list[str]:
        """What to do with recordings of loads, if they have the speed; first what states a load that was not read."""
        if steps := [f.step for f in self.files if f.step]:
            step, *own = steps[0].partition("   (")
            of_run = options_of(said, "rpm", "airspeed-m-s", "density-kg-m3")
            return [f"Next: {' '.join([step, *of_run])}{''.join(own)}\n"]
        if turned := [f"{quantity}=-1" for quantity in self._turned]:
            said = {**said, "sign": [*said.get("sign", ()), *turned]}
        read = [(shlex.quote(f.path), f.record.kind, set(named(f.record).values)) for f in self.files if f.record]
        read = [(path, kind, known) for path, kind, known in read if _LOADS & known]
        loaded = [path for path, _, known in read if "rpm" in {*known, *said}]
        alone = [path for path, kind, _ in read if kind == "bench"]
        how = options_of(said, "unit", "column", "sign")
        one = self.files[0].record if len(read) == len(self.files) == 1 else None
        if words := between_setups(one, self.files[0].path) if one else []:
            return [f"Next: {' '.join(['bemt compare', *words, *how])}\n"]
        if alone and not loaded:
            pair = " ".join(["bemt compare", *(alone if len(alone) == 2 else [alone[0], "ANOTHER_RUN"]), *how])
            return [f"Next: {pair}   (beside a model: a column headed rpm, the speed of every row)\n"]
        if not loaded:
            return []
        step = f"Next: {' '.join(['bemt diagnose', loaded[0], *options_of(said)])}{_a_case(said)}\n"
        return [step + (f"      {' '.join(['bemt compare', *loaded, *how])}\n" if len(loaded) == 2 else "")]


def _a_case(said: Mapping[str, Sequence[str | float]]) -> str:
    """How to make the case that a command has a word for."""
    return "   (a case: bemt new 10x5)" if said["case"] == ["CASE"] else ""
