"""A sweep as both doors show it."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from bemt.base.action import Answered
from bemt.base.errors import EXIT_UNCONVERGED
from bemt.base.tables import number_text, text_table
from bemt.results.sweep import batch
from bemt.results.sweep.rows import ROW_SOURCES, Comparison, Result, Row, State, Sweep, beside
from bemt.results.sweep.store import case_text, overview_text
from bemt.rotors.case import find_cases
from bemt.rotors.validity import kind, serious

if TYPE_CHECKING:
    import pandas as pd

# One screen of a sweep: thrust beside what was recorded, what differs most and why, and where to read on.

WIDTH, ROWS, SCREEN = 80, 20, 45
"""Columns of the screen, rows of the table and lines of the screen: the rest is counted."""
NEAR_ZERO = 0.1
"""Share of the largest recorded thrust below which a difference has no per cent [1]."""


class _Thrust(NamedTuple):
    """BEMT against one recorded thrust of a case, at its operating point."""

    c: Comparison
    case: Result
    share: float  # of the largest recorded thrust [1]
    row: Row

    @property
    def rank(self) -> float:
        """Largest first, no result before all."""
        return self.share if math.isfinite(self.share) else 9e9


def summary(results: Sequence[Result], files: Sequence[Path] = (), cut: bool = True) -> str:
    """Summary of all cases, at most 45 lines of 80 columns; without `cut` long lines go on in the next one.

    ``files`` are those of the results: two cases may have one name.
    """
    solved = [r for r in results if r.rows]
    where = [f" ({path.as_posix()})" for path in files] or [""] * len(results)
    failed = [(r.name + place, len(r.faults)) for r, place in zip(results, where, strict=True) if not r.rows]
    lines: list[str] = []
    found = sorted((c for r in solved for c in _compared(r)), key=lambda c: -c.rank)
    if solved:
        lines += _table(solved, found)
    for name, n in failed[:6]:
        lines += _short(f"{name}: not solved, {n} {'fault' if n == 1 else 'faults'} (see the messages)", cut)
    if len(failed) > 6:
        lines.append(f"and {len(failed) - 6} more that were not solved")
    end = ["", *_next(bool(found))] if solved else []
    for words in (_drives(solved), _worst(found), _ducts(solved), _unknowns(solved), _grids(solved, cut)):
        lines += ["", *words] if words else []
    lines += ["", *checks] if (checks := _no_checks(solved)) else []
    flags = _flags(solved, SCREEN - len(lines) - len(end) - 1)
    return "\n".join([*lines, *(["", *flags] if flags else []), *end])


def _compared(result: Result) -> list[_Thrust]:
    """BEMT against each recorded thrust of a case; equal values of one kind count once."""
    rows = [c for c in result.comparisons if (c.model, c.quantity) == ("bemt", "thrust_N") and c.source in ROW_SOURCES]
    largest = max((abs(c.D) for c in rows), default=0.0)
    out: dict[tuple[str, str, float, float], _Thrust] = {}
    for c in rows:
        share = abs(c.E) / largest if largest > 0.0 else 0.0
        row = next(r for r in result.rows if r.label == c.reference and beside(c, r))
        out.setdefault((c.source, number_text(c.D, 3), row.rpm, row.density_kg_m3), _Thrust(c, result, share, row))
    return list(out.values())


def _agreement(c: Comparison) -> str:
    """Whether model and recording agree, or how good the recording would have to be; "flagged !" where a flag forbids.

    A flag takes nothing from a difference: only what would be called agreement has the mark.
    """
    if _forbidden(c):
        return "flagged !"
    words: dict[State, str] = {"model unknown": "BEMT's u unknown", "inside": "agrees",
                               "open": f"u > {number_text(c.needed, 2)}"}  # fmt: skip
    return words.get(c.state, c.state)


def _forbidden(c: Comparison) -> bool:
    """Whether a flag forbids to call it agreement."""
    return bool(c.doubts) and c.state in ("agrees", "inside")


def _percent(t: _Thrust) -> str:
    """Behind a difference: per cent of the recorded value at its point, as everywhere; none near zero thrust."""
    near_zero = t.share > 0.0 and abs(t.c.D) < NEAR_ZERO * abs(t.c.E) / t.share
    return f" ({100.0 * t.c.E / abs(t.c.D):+.0f} %)" if t.c.D and not near_zero else ""


def _lines(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    text = text_table(list(header), [list(row) for row in rows], left=(0, len(header) - 1))
    return [line.rstrip() for line in text.splitlines()]


def _table(solved: Sequence[Result], found: Sequence[_Thrust]) -> list[str]:
    moving = any(r.airspeed_m_s for result in solved for r in result.of("bemt"))
    airs = any(len(result.densities) > 1 for result in solved)
    point = ["rpm", *(["V"] if moving else []), *(["kg/m3"] if airs else [])]
    header = ["thrust [N]", *point, "BEMT", "W", "K1/K2", "recorded", "difference", "agree?"]
    kept = found[: max(ROWS - len(solved), 4)]
    body = [row for result in solved for row in _rows(result, [t for t in kept if t.case is result], moving, airs)]
    shown = body[:ROWS]
    lines = _lines(header, shown)
    if max(map(len, lines)) > WIDTH:  # the power is in --details, too
        at = header.index("W")
        header, *narrow = ([*row[:at], *row[at + 1 :]] for row in (header, *shown))
        lines = _lines(header, narrow)
    left = len(found) - sum(1 for row in shown if row[-3] != "-")
    if left > 0 or len(body) > len(shown):
        lines.append(f"and {max(left, len(body) - len(shown))} more rows (--details shows all)")
    if found:
        lines.append("±, u: one standard uncertainty (BEMT: inputs and model); %: of the recorded")
        lines.append("value at that point; u > X: they agree only if the recording's own u exceeds X N")
        if any(_forbidden(t.c) for t in found):
            lines.append("flagged !: within the band, but no agreement; the flag below says why")
    return lines


def _rows(result: Result, found: Sequence[_Thrust], moving: bool, airs: bool) -> list[list[str]]:
    """Rows of a case: its first point, and those with a recorded value beside them; what repeats is left blank."""
    body: list[list[str]] = []
    for k, row in enumerate(result.of("bemt")):
        told = [[f"{number_text(t.c.D, 3)} {t.c.source}", f"{t.c.E:+.3g}{_percent(t)}", _agreement(t.c)]
                for t in found if beside(t.row, row)]  # fmt: skip
        u = "" if not math.isfinite(row.u) else f" ± {number_text(row.u, 2)}"
        cells = [f"{row.rpm:.0f}", *([f"{row.airspeed_m_s:g}"] if moving else []),
                 *([number_text(row.density_kg_m3, 4)] if airs else []),
                 f"{number_text(row.thrust_N, 3)}{u}", number_text(row.power_W, 3),
                 number_text(next((r.thrust_N for r in result.of("k1k2") if beside(r, row)), None), 3)]  # fmt: skip
        for words in told or ([] if k else [["-", "", ""]]):
            body.append([_name(result.name) if not body else "", *cells, *words])
            cells = [""] * len(cells)
    return body


def _name(name: str) -> str:
    """A name of 20 letters at most; a cut shows."""
    return name if len(name) <= 20 else f"{name[:19]}…"


def _drives(solved: Sequence[Result]) -> list[str]:
    """Most thrust of the cases that have a motor."""
    told = [(r.name, r.drive.text) for r in solved if r.drive]
    lines = [
        line for name, text in told[:4] for line in textwrap.wrap(f"{name}, {text}", WIDTH, subsequent_indent="  ")
    ]
    return lines + ([f"and {len(told) - 4} more cases with a motor (--details)"] if len(told) > 4 else [])


def _worst(found: Sequence[_Thrust]) -> list[str]:
    if not found:
        return []
    c, case = found[0].c, found[0].case
    words = f"Largest difference: {case.name}, BEMT {number_text(c.S, 3)} N minus {c.reference}: {c.E:+.3g} N."
    if abs(c.E) <= c.known:
        words += " This is within the uncertainty of BEMT."
    elif c.state == "open":
        words += f" The recording states no u: they agree only if it exceeds {number_text(c.needed, 2)} N."
    audit = case.audit_of(c.reference)
    faults = [line.finding for line in (audit.lines if audit else ()) if line.status == "fault"]
    if faults:
        words += f" Faults of its set-up: {'; '.join(faults)}."
    return textwrap.wrap(words, WIDTH)


def _ducts(solved: Sequence[Result]) -> list[str]:
    """What the duct carries, and why K1/K2 is far off for a ducted fan."""
    told = []
    for result in solved:
        own, simple = result.first("bemt"), result.first("k1k2")
        if result.kind == "fan" and own and simple and own.thrust_N > 0.0:
            share = f", whose duct has {100 * result.fan.duct_share:.0f} % of the thrust" if result.fan else ""
            told.append(f"{number_text(simple.thrust_N / own.thrust_N, 2)} of BEMT on {result.name[:30]}{share}")
    words = (
        f"K1/K2 gives {', '.join(told[:3])}: it is a fit to open propellers with diameter and pitch only. It ignores "
        "the duct and the number of blades."
    )
    return textwrap.wrap(words, WIDTH) if told else []


def _unknowns(solved: Sequence[Result]) -> list[str]:
    lines = []
    for result in solved[:8]:
        first = sorted((a for a in result.assumptions if math.isfinite(a.u_thrust_N)), key=lambda a: -a.u_thrust_N)[:3]
        if first:
            told = [f"{a.key.rpartition('.')[2]} {number_text(a.u_thrust_N, 2)} N" for a in first]
            while len(", ".join(told)) > WIDTH - 24:
                told.pop()
            lines.append(f"  {_name(result.name):<17} {', '.join(told)}")
    return ["Unknowns that widen BEMT most (their part of u in thrust):", *lines] if lines else []


def _no_checks(solved: Sequence[Result]) -> list[str]:
    """Cases whose rotor was fitted to readings."""
    told: dict[str, list[str]] = {}
    for result in solved:
        for words in (result.no_check or ()) if result.comparisons else ():
            told.setdefault(words, []).append(result.name)
    return [line for words, names in [*told.items()][:3]
            for line in textwrap.wrap(f"! {_some(names)}: {words}", WIDTH, subsequent_indent="  ")]  # fmt: skip


def _flags(solved: Sequence[Result], room: int) -> list[str]:
    """Every flag of BEMT, the serious ones first; those that do not fit the lines are named in short and counted."""
    told: dict[str, list[str]] = {}
    for result in solved:
        for row in result.of("bemt"):
            for flag in row.flags:
                told.setdefault(flag, []).append(result.name)
    lines: list[str] = []
    rest: dict[str, list[str]] = {}
    for flag in sorted(told, key=lambda f: not serious([f])):
        names = list(dict.fromkeys(told[flag]))
        part = textwrap.wrap(f"! {_some(names)}: {flag}", WIDTH, subsequent_indent="  ", break_on_hyphens=False)
        if not rest and len(lines) + len(part) <= max(room - 3, 3):
            lines += part
        else:
            rest.setdefault(kind(flag), []).extend(names)
    for head, names in rest.items():
        some = _some(list(dict.fromkeys(names)))
        lines += textwrap.wrap(f"! {len(names)} more: {head} ({some}; --details)", WIDTH, subsequent_indent="  ")
    return lines


def _some(names: Sequence[str]) -> str:
    """First names, and how many more there are."""
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _grids(solved: Sequence[Result], cut: bool) -> list[str]:
    lines = []
    for result in solved:
        if grid := result.grid:
            where = f", {grid.file}" if grid.file else ", kept with --out DIR"
            lines.append(f"grid of {result.name}: {grid.points} points, {grid.unconverged} unconverged{where}")
    return [part for line in lines[:4] for part in _short(line, cut)]


def _next(compared: bool) -> list[str]:
    lines = [
        "More: --details (every case in full), --out DIR (tables), --json,",
        "  bemt report CASES --out DIR (figures)",
    ]
    if compared:
        lines[-1] += ","
        lines.append("  bemt diagnose LOG --case CASE (what the model leaves out)")
    return lines


def _short(line: str, cut: bool) -> list[str]:
    """One line of the screen, cut to its width; or all of it, on as many lines as it takes."""
    if not cut:
        return textwrap.wrap(line, WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return [line if len(line) <= WIDTH else line[: WIDTH - 3] + "..."]


@dataclass(frozen=True, eq=False)
class SweepAnswer(Answered):
    """Cases that were solved and compared, returned by :func:`bemt.sweep`."""

    found: Sweep
    paths: tuple[str, ...]
    reasons: tuple[str, ...] = ()  # points beyond the tolerance of a strict sweep

    @property
    def exit_code(self) -> int:
        """Worst of all cases."""
        return max(self.found.exit_code, EXIT_UNCONVERGED if self.reasons else 0)

    @property
    def complaints(self) -> tuple[str, ...]:
        """Faults of single cases, and points beyond the tolerance."""
        return (*(str(fault) for result in self.found.cases for fault in result.faults), *self.reasons)

    @property
    def text(self) -> str:
        """One screen."""
        return summary(self.found.cases, find_cases(self.paths), cut=False)

    def screen(self) -> str:
        """The same for a terminal, long tables cut."""
        return summary(self.found.cases, find_cases(self.paths), cut=True)

    @property
    def details(self) -> str:
        """Every case in full."""
        return "\n\n".join([*map(case_text, self.found.cases), overview_text(self.found.cases)])

    def __repr__(self) -> str:
        """Say in a line how many cases were solved."""
        solved = sum(bool(result.rows) for result in self.found.cases)
        return f"<sweep of {len(self.found.cases)} cases, {solved} solved>"

    def _document(self) -> dict[str, Any]:
        """Schema ``bemt.sweep/1``."""
        return self.found.document()

    def to_pandas(self) -> pd.DataFrame:
        """A row for each model and recorded value of each case; ``u``: standard uncertainty of the thrust. [N]"""
        import pandas as pd

        rows = [{"case": one.name} | row.document() for one in self.found.cases for row in one.rows]
        return pd.DataFrame([row | {"flags": "; ".join(row["flags"])} for row in rows])


def sweep(paths: Sequence[str], out: str | None, *, tolerance: float | None, **more: Any) -> SweepAnswer:
    """Sweep; with a tolerance [%] the points beyond it are reasons to end with 1."""
    found = batch.sweep(paths, out, **more)
    solved = [r for r in found.cases if r.rows]
    reasons = [] if tolerance is None else [line for r in solved for line in batch.off_tolerance(r, tolerance)]
    return SweepAnswer(found, tuple(paths), tuple(reasons))
