"""One screen of a sweep: thrust beside what was recorded, what differs most and why, and where to read on."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bemt.base.tables import number_text, text_table
from bemt.rotors.validity import kind, serious
from bemt.sweep.agreement import known, needed
from bemt.sweep.case import ROW_SOURCES
from bemt.sweep.text import with_nan

WIDTH, ROWS, SCREEN = 80, 20, 45
"""Columns of the screen, rows of the table and lines of the screen: the rest is counted."""


def summary(results: Sequence[Mapping[str, Any]], files: Sequence[Path] = (), cut: bool = True) -> str:
    """Summary of all cases, at most 45 lines of 80 columns; without `cut` long lines go on in the next one.

    ``files`` are those of the results: two cases may have one name.
    """
    solved = [with_nan(r) for r in results if r["rows"]]
    where = [f" ({path.as_posix()})" for path in files] or [""] * len(results)
    failed = [(r["name"] + place, len(r["faults"])) for r, place in zip(results, where, strict=True) if not r["rows"]]
    lines: list[str] = []
    found = sorted((c for r in solved for c in _compared(r)), key=lambda c: -c["rank"])
    if solved:
        lines += _table(solved, found)
    for name, n in failed[:6]:
        lines += _short(f"{name}: not solved, {n} {'fault' if n == 1 else 'faults'} (see the messages)", cut)
    if len(failed) > 6:
        lines.append(f"and {len(failed) - 6} more that were not solved")
    end = ["", *_next(bool(found))] if solved else []
    for words in (_drives(solved), _worst(found), _ducts(solved), _unknowns(solved), _grids(solved, cut)):
        lines += ["", *words] if words else []
    flags = _flags(solved, SCREEN - len(lines) - len(end) - 1)
    return "\n".join([*lines, *(["", *flags] if flags else []), *end])


def _compared(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """BEMT against each recorded thrust of a case; equal values of one kind count once."""
    rows = [
        c
        for c in result["comparisons"]
        if c["model"] == "bemt" and c["quantity"] == "thrust_N" and c["source"] in ROW_SOURCES
    ]
    largest = max((abs(c["D"]) for c in rows), default=0.0)
    out: dict[tuple[str, str, float], dict[str, Any]] = {}
    for c in rows:
        share = abs(c["E"]) / largest if largest > 0.0 else 0.0
        row = next(r for r in result["rows"] if r["label"] == c["reference"])
        out.setdefault((c["source"], number_text(c["D"], 3), row["rpm"]), {
            **c, "case": result, "known": known(c), "share": share, "rank": share if math.isfinite(share) else 9e9,
            "rpm": row["rpm"], "airspeed_m_s": row["airspeed_m_s"],
        })  # fmt: skip
    return list(out.values())


def _agreement(c: Mapping[str, Any]) -> str:
    """Whether model and recording agree, or how good the recording would have to be; "!" where a flag forbids it."""
    return _judged(c) + (" !" if c.get("doubts") else "")


def _judged(c: Mapping[str, Any]) -> str:
    if not math.isfinite(c["E"]):
        return "no result"
    if not math.isfinite(c["known"]):
        return "BEMT's u unknown"
    if abs(c["E"]) <= c["known"]:
        return "agrees"
    if math.isfinite(c["u_D"]):
        return "agrees" if abs(c["E"]) <= math.hypot(c["known"], c["u_D"]) else "differs"
    return f"u > {number_text(needed(c), 2)}"


def _table(solved: Sequence[Mapping[str, Any]], found: Sequence[Mapping[str, Any]]) -> list[str]:
    moving = any(r["airspeed_m_s"] for result in solved for r in result["rows"] if r["source"] == "bemt")
    header = ["thrust [N]", "rpm", *(["V"] if moving else []), "BEMT", "K1/K2", "recorded", "difference", "agree?"]
    keep = {id(c) for c in found[: max(ROWS - len(solved), 4)]}
    body: list[list[str]] = []
    for result in solved:
        points = [r for r in result["rows"] if r["source"] == "bemt"]
        formula = {(r["rpm"], r["airspeed_m_s"]): r for r in result["rows"] if r["source"] == "k1k2"}
        first = True
        for k, row in enumerate(points):
            own = [c for c in found if c["case"] is result and c["rpm"] == row["rpm"]
                   and c["airspeed_m_s"] == row["airspeed_m_s"] and id(c) in keep]  # fmt: skip
            if k and not own:
                continue
            u = "" if not math.isfinite(row["u"]) else f" ± {number_text(row['u'], 2)}"
            simple = formula.get((row["rpm"], row["airspeed_m_s"]), {}).get("thrust_N")
            at = [f"{row['rpm']:.0f}", *([f"{row['airspeed_m_s']:g}"] if moving else [])]
            cells = [*at, f"{number_text(row['thrust_N'], 3)}{u}", number_text(simple, 3)]
            some: list[Mapping[str, Any] | None] = [*own] if own else [None]
            for c in some:
                told = ["-", "", ""] if c is None else [
                    f"{number_text(c['D'], 3)} {c['source']}", f"{c['E']:+.3g} ({100 * c['share']:.0f} %)",
                    _agreement(c)]  # fmt: skip
                body.append([_name(result["name"]) if first else "", *cells, *told])
                cells, first = [""] * len(cells), False
    shown = body[:ROWS]
    lines = [line.rstrip() for line in text_table(header, shown, left=(0, len(header) - 1)).splitlines()]
    left = len({id(c) for c in found}) - sum(1 for row in shown if row[-3] != "-")
    if left > 0 or len(body) > len(shown):
        lines.append(f"and {max(left, len(body) - len(shown))} more rows (--details shows all)")
    if found:
        lines.append("±, u: one standard uncertainty (BEMT: inputs and model); %: of the largest")
        lines.append("recorded value; u > X: they agree only if the recording's own u exceeds X N")
        if any(c.get("doubts") for c in found):
            lines.append("!: do not take it for agreement; the flag below says why")
    return lines


def _name(name: str) -> str:
    """A name of 20 letters at most; a cut shows."""
    return name if len(name) <= 20 else f"{name[:19]}…"


def _drives(solved: Sequence[Mapping[str, Any]]) -> list[str]:
    """Most thrust of the cases that have a motor."""
    told = [(r["name"], r["drive"]["text"]) for r in solved if r.get("drive")]
    lines = [
        line for name, text in told[:4] for line in textwrap.wrap(f"{name}, {text}", WIDTH, subsequent_indent="  ")
    ]
    return lines + ([f"and {len(told) - 4} more cases with a motor (--details)"] if len(told) > 4 else [])


def _worst(found: Sequence[Mapping[str, Any]]) -> list[str]:
    if not found:
        return []
    c = found[0]
    case = c["case"]
    words = (
        f"Largest difference: {case['name']}, BEMT {number_text(c['S'], 3)} N minus {c['reference']}: {c['E']:+.3g} N."
    )
    if abs(c["E"]) <= c["known"]:
        words += " This is within the uncertainty of BEMT."
    elif not math.isfinite(c["u_D"]) and math.isfinite(needed(c)):
        words += f" The recording states no u: they agree only if it exceeds {number_text(needed(c), 2)} N."
    audit = next((a for a in case.get("audit", []) if a["reference"] == c["reference"]), None)
    faults = [line["finding"] for line in (audit or {"lines": []})["lines"] if line["status"] == "fault"]
    if faults:
        words += f" Faults of its set-up: {'; '.join(faults)}."
    return textwrap.wrap(words, WIDTH)


def _ducts(solved: Sequence[Mapping[str, Any]]) -> list[str]:
    """Why K1/K2 is far off for a ducted fan."""
    told = []
    for result in solved:
        own, simple = (next((r for r in result["rows"] if r["source"] == s), None) for s in ("bemt", "k1k2"))
        if result.get("kind") == "fan" and own and simple and own["thrust_N"] > 0.0:
            told.append(f"{number_text(simple['thrust_N'] / own['thrust_N'], 2)} of BEMT on {result['name'][:30]}")
    words = (
        f"K1/K2 gives {', '.join(told[:3])}: it is a fit to open propellers with diameter and pitch only. It ignores "
        "the duct and the number of blades."
    )
    return textwrap.wrap(words, WIDTH) if told else []


def _unknowns(solved: Sequence[Mapping[str, Any]]) -> list[str]:
    lines = []
    for result in solved[:8]:
        first = sorted(
            (a for a in result["assumptions"] if math.isfinite(a["u_thrust_N"])), key=lambda a: -a["u_thrust_N"]
        )[:3]
        if first:
            told = [f"{a['key'].rpartition('.')[2]} {number_text(a['u_thrust_N'], 2)} N" for a in first]
            while len(", ".join(told)) > WIDTH - 24:
                told.pop()
            lines.append(f"  {_name(result['name']):<17} {', '.join(told)}")
    return ["Unknowns that widen BEMT most (their part of u in thrust):", *lines] if lines else []


def _flags(solved: Sequence[Mapping[str, Any]], room: int) -> list[str]:
    """Every flag of BEMT, the serious ones first; those that do not fit the lines are named in short and counted."""
    told: dict[str, list[str]] = {}
    for result in solved:
        for row in result["rows"]:
            if row["source"] == "bemt":
                for flag in row["flags"]:
                    told.setdefault(flag, []).append(result["name"])
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


def _grids(solved: Sequence[Mapping[str, Any]], cut: bool) -> list[str]:
    lines = []
    for result in solved:
        if grid := result.get("grid"):
            where = f", {grid['file']}" if grid["file"] else ", kept with --out DIR"
            told = f"grid of {result['name']}: {grid['points']} points, {grid['unconverged']} unconverged{where}"
            lines.append(told)
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
