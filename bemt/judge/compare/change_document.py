"""Two recordings without a case: ``bemt.comparison/1``, the step that would settle it, what an engineer would say."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np

from bemt import __version__
from bemt.base.document import Documented
from bemt.base.tables import or_null, text_table
from bemt.base.unit_errors import speed_ratios
from bemt.data.recordings.check import LEFT_OUT
from bemt.judge.compare import recordings
from bemt.judge.compare import sentences as say
from bemt.judge.compare.drive_laws import FAMILY, SUPPLY, Judgement, check_of, title_of
from bemt.judge.compare.matched import LOADS, OVER_COMMAND, WITHOUT_SPEED
from bemt.judge.compare.recordings import IN_WIND, NO_SPEED, NOTHING_SHARED, OTHER_STAND, REVERSED, RunChange
from bemt.judge.compare.selection import Invocation
from bemt.judge.compare.sizes import READ, titled
from bemt.judge.compare.smooth_change import Ratio
from bemt.judge.explanation import DOUBT, NONE, UNKNOWN, Explanation, Size
from bemt.judge.loss import BESIDE, CLAIMS, ON_ONE, SPREAD, checks_by_worth, minutes, ways

AIR_OF_BOTH = "--air-a TEMPERATURE,PRESSURE --air-b TEMPERATURE,PRESSURE"
ONE_SETUP = "compute both with one set-up: before that no physics is named"
DAYS = (
    "note temperature and pressure of both days, with units as in 20C,1013hPa; density is the first thing that differs "
    "between days"
)
"""What tells two runs apart whose loads differ by a share."""
SCHEMA = "bemt.comparison/1"
# Density is asked for unless it is this many times less likely than the likeliest cause.
_FIRST = 5.0
# Change of a load that days of one site can make, and from which on it is worth a thermometer, in ln.
_DAY, _SEEN = 0.12, 0.03
_ONE_BATTERY = "to compare at one voltage, repeat B with the battery or supply of A"
# Scatter of readings at one speed, share, that no stand has: something else changes from reading to reading.
_RESTLESS = 0.10
_REPEAT = "repeat the run of A and compare it with A: so much two runs differ by without a cause"
_STEPS, _NEARLY = 2, 0.5  # that are offered at once; share of the largest probability that is nearly as much


def next_step(change: RunChange, asked: Invocation) -> dict[str, str]:
    """Run or reading that would settle the answer, and the command to give then, with all that was asked."""
    said, checks = change.leading, ""
    if change.other_setup and said.verdict in ("none", "insufficient"):
        text, command = ONE_SETUP, ""
    elif said.why.startswith(recordings.VOLTS_AS_RECORDED) or said.why.endswith(recordings.ONLY_VOLTS):
        text, command = _ONE_BATTERY, asked.command(b="B_AGAIN.csv")
    elif said.verdict == "none":
        text, command = _to_see_more(change, asked)
    elif said.why.startswith(recordings.AS_RECORDED):
        text, command = "", ""
    elif said.verdict in ("named", "sensor"):
        checks = next(filter(check_of, said.effects), "")
        text = f"to be sure, {check_of(checks) or 'read the label of the channel'}"
        command = asked.without(checks) if checks else asked.command(case=asked.case or "CASE")
    elif lacking := _lacking(change, asked):
        text, command = lacking
    else:
        text, command, checks = _quickest_checks(change, asked)
    return {"text": text, "command": command, "checks": checks}


def _of_days(change: RunChange, least: float) -> bool:
    """Whether loads differ by this much, in ln, and no more than air of two days makes, which nobody has recorded."""
    apart = max((abs(math.log(r.ratio)) for r in change.ratios.values() if r.kind in LOADS), default=-1.0)
    return math.isnan(change.density_ratio) and least <= apart < _DAY and not (change.a.setup and change.b.setup)


def _to_see_more(change: RunChange, asked: Invocation) -> tuple[str, str]:
    """What shows a change that these runs do not show."""
    if _of_days(change, _SEEN):
        return DAYS, asked.with_days()
    if change.a.setup and change.b.setup:
        return "to see smaller changes, compute both on a finer grid", ""
    return "to see smaller changes, remove the propeller, mount it again and repeat each run once", ""


def _lacking(change: RunChange, asked: Invocation) -> tuple[str, str] | None:
    """What the recordings lack before any cause can be told; None where they lack nothing."""
    said, loads = change.leading, [r for r in change.ratios.values() if r.kind in LOADS]
    if said.why.endswith(IN_WIND):
        air = "air_a" if math.isfinite(change.a.zero_thrust_rpm) else "air_b"
        command = asked.command(**{air: ",".join(filter(None, [getattr(asked, air), "AIRSPEED"]))})
        return f"state the airspeed of {air[-1].upper()}, with its unit as in 18m/s", command
    if loads and all(r.extrapolated for r in loads):
        where = "where A was measured"
        if "rpm" in change.a.points:
            c = next(iter(change.loads_by_name.values()))
            low, high = (math.exp(f(c.x[~c.second, 0])) for f in (np.min, np.max))
            where = f"at the speeds of A, {low:.0f} to {high:.0f} rev/min"
        return f"run B again {where}, and at its airspeeds", asked.command(b="B_AGAIN.csv")
    if change.without_speed:
        scale = "hang a known weight on the scale, or run both propellers on one motor"
        text = f"record the speed in both runs, in a column rpm; without a counter, {scale}"
        return text, asked.command(a="A_WITH_RPM.csv", b="B_WITH_RPM.csv")
    if said.verdict in ("insufficient", "unknown") and (letter := _unrepeatable(change)):
        columns = (change.a if letter == "a" else change.b).conditions
        others = f" (the file has {', '.join(columns[:4])})" if columns else ""
        text = f"choose the rows of {letter.upper()} in which nothing else changes{others}"
        return text, asked.with_rows(letter, columns[0] if columns else "COLUMN")
    likely = [p for k, p in said.ranked.items() if k not in (NONE, UNKNOWN)]
    density = said.ranked.get(Explanation.of("air_density"), 0.0)
    if density * _FIRST >= max(likely, default=1.0) and _of_days(change, 0.0):
        return DAYS, asked.with_days()
    if "torque" not in change.loads_by_name and change.loads is said:
        text = "record torque in both runs: thrust alone cannot tell gain, air and blade apart"
        return text, asked.command(a="A_WITH_TORQUE.csv", b="B_WITH_TORQUE.csv")
    return None


def _quickest_checks(change: RunChange, asked: Invocation) -> tuple[str, str, str]:
    """Checks that find the cause soonest, one of each family, or the run of A again; and the cause looked for first."""
    said = change.leading
    read = SUPPLY.ids if "voltage_V" in change.ratios else frozenset[str]()  # which needs no check
    members = [k for k in said.effects if check_of(k) and k not in read]
    order = [k for k in checks_by_worth(said.ranked, minutes("reference", len(change.a.points))) if k not in read]
    firsts: dict[str, str] = {}
    causes = [k for k in said.ranked if k.ids and not k.ids & read]
    if causes and next(iter(said.ranked)) != NONE:
        # what is nearly as likely as the likeliest goes first, and before it that one where anybody would see it
        near = {i for k in causes if said.ranked[k] >= _NEARLY * said.ranked[causes[0]] for i in k}
        order = [*(i for i in causes[0] if i not in order), *(k for k in order if k in near), *order]
    for cause in [k for k in order if k in members or said.verdict != "class"] or members:
        firsts.setdefault(FAMILY.get(cause, cause), cause)
    told = [k for k in firsts.values() if not k or check_of(k)][:_STEPS] or [""]
    again = {"b": "A_AGAIN.csv", "rows_b": asked.rows_a, "air_b": asked.air_a}
    command = asked.without(told[0]) if told[0] else asked.command(**again)
    return "; or ".join(check_of(k) if k else _REPEAT for k in told), command, told[0]


def _unrepeatable(change: RunChange) -> str:
    """Letter of the recording whose readings at one speed differ by more than those of any stand; "" where none do."""
    for c in change.loads_by_name.values():
        for letter, here in (("b", c.second), ("a", ~c.second)):
            if np.median(c.u[here]) > _RESTLESS:
                return letter
    return ""


class RankedCause(Documented):
    """One explanation."""

    effect: str
    probability: float
    parameters: Mapping[str, Size] = field(default_factory=dict)


class SubVerdict(Documented):
    """What is said of loads or drive."""

    verdict: str
    effects: tuple[str, ...]
    rule: str
    ranking: tuple[RankedCause, ...]


class Densities(Documented):
    """Recorded densities [kg/m3]; None where they are not told."""

    A: float | None
    B: float | None
    ratio: float | None


class ComparedRuns(Documented):
    """``bemt.comparison/1``: what two recordings say, and what the diagnosis with a case says of them."""

    verdict: str
    effects: tuple[str, ...]
    probability: float | None
    diameter_m: float | None
    density: Densities
    rule: str = ""
    sets: tuple[tuple[str, ...], ...] = ()
    ranking: tuple[RankedCause, ...] = ()
    subsystems: Mapping[str, SubVerdict] = field(default_factory=dict)
    ratios: Mapping[str, Ratio] = field(default_factory=dict)
    points: Mapping[str, int] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    full_scale: Mapping[str, float] = field(default_factory=dict)  # Largest readings of B, SI, of which shares are
    recordings: tuple[str, ...] = ()
    rows: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    next_measurement: Mapping[str, Any] = field(default_factory=dict)
    case: str | None = None
    diagnosis: Mapping[str, Any] | None = None
    told: tuple[str, ...] | None = None  # Lines of the diagnosis

    def document(self) -> dict[str, object]:
        """Plain values; verdict and ranking in the words of the diagnosis where there is one."""
        said = {k: self.diagnosis[k] for k in DIAGNOSED} if self.diagnosis else {}
        return {"schema": SCHEMA, "version": __version__, **super().document(), **said}


DIAGNOSED = ("verdict", "effects", "probability", "ranking", "rule")
"""What a diagnosis says in place of the ratios."""


def document(change: RunChange) -> ComparedRuns:
    """What is said without a case."""
    said = change.leading
    return ComparedRuns(
        said.verdict, said.effects, or_null(said.probability), or_null(change.diameter_m),
        Densities(*map(or_null, (change.a.density, change.b.density, change.density_ratio))), said.why, said.sets,
        _ranking(said),
        {name: SubVerdict(j.verdict, j.effects, j.why, _ranking(j))
         for name, j in (("loads", change.loads), ("drive", change.drive))},
        change.ratios, {"A": len(change.a), "B": len(change.b)}, change.assumed, change.notes, said.full_scale,
    )  # fmt: skip


def _ranking(said: Judgement) -> tuple[RankedCause, ...]:
    first = list(said.ranked.items())[:12]
    return tuple(RankedCause(str(k), p, said.parameters.get(str(k), said.sizes.get(k, {}))) for k, p in first)


# Runs at nearly one speed say nothing of a change over it: error per doubling from which it is not shown [1].
_NO_SLOPE = 1.0
_ROWS, _NOTES = 8, 4
_GUESS = 0.1  # probability from which a cause is likely


def text(doc: ComparedRuns, details: bool = False) -> str:
    """Lines of a comparison."""
    lines = say.wrapped(headline(doc), "", "")
    lines += [say.verdict_line(doc.verdict, doc.effects), *_said(doc)]
    rows = []
    for channel, r in doc.ratios.items():
        raw = r.ratio * r.density_ratio
        slope = "-"
        over_speed = r.kind not in (*OVER_COMMAND, *WITHOUT_SPEED)
        if over_speed and r.slope is not None and r.slope_error is not None and r.slope_error < _NO_SLOPE:
            slope = f"{100.0 * r.slope:+.1f} ± {100.0 * r.slope_error:.1f} %"
        more = [slope, f"{100.0 * r.scatter:.1f} %", "{}, {}".format(*r.points)]
        rows.append([say.of_what(channel, r), f"{raw:.4f}", *_ends(r, r.density_ratio), *more])
        if abs(r.density_ratio - 1.0) > 1e-6:
            coefficient = "CT" if channel == "thrust_N" else "CP"
            rows.append([f"  {coefficient} (corrected for density)", f"{r.ratio:.4f}", *_ends(r), "", "", ""])
    header = ["B over A", "ratio", "68 %", "95 %", "change per doubling of n", "scatter", "points"]
    lines += ["", text_table(header, rows, left=(0,), indent="  ")]
    if details:
        lines += _tables(doc)
    lines += [line for a in doc.assumed for line in say.wrapped(f"assumed: {a}")]
    notes = [n for n in doc.notes if not n.startswith(recordings.ERROR_IN)]
    notes = notes if details else [n for n in notes if not n.startswith(("A: ", "B: "))][:_NOTES]
    lines += [f"  note: {n}" for n in notes]
    return "\n".join(lines)


def headline(doc: ComparedRuns) -> str:
    """What an engineer would say first."""
    verdict, change = doc.verdict, say.moved(doc.ratios, {FAMILY.get(k, k) for k in doc.effects} == {"drive"})
    size = f" ({change})" if change else ""
    if verdict == "none" and doc.rule.endswith(recordings.ONLY_VOLTS):
        return f"Same thrust per watt{size}; {doc.rule}."
    if verdict == "none":
        return f"No change beyond the difference between two set-ups{size or ' (drive only)'}."
    if verdict == "unknown":
        return f"{say.something(_posterior(doc))}{size}, and no listed cause explains it."
    if verdict == "insufficient":
        return _open(doc, size)
    if doc.rule == REVERSED:
        return f"{REVERSED[0].upper()}{REVERSED[1:]}{size}: the cell is reversed, or the rotor turns the other way."
    if doc.effects == ("air_density",) and doc.rule.startswith(recordings.AS_RECORDED):
        return f"Nothing but the air changed, as recorded{size}; the coefficients agree."
    beside, sets = doc.rule.endswith(BESIDE), doc.sets or (doc.effects,)
    return say.claimed(verdict, doc.probability or 0.0, sets, _ways(doc), partial(_title, doc), beside, change)


def _title(doc: ComparedRuns, name: str) -> str:
    """Title of a cause, or of a pair of them, with the size as far as it was worked out."""
    found = next((r.parameters for r in doc.ranking if r.effect == name), {})
    if "+" not in name:
        return titled(name, found, doc.full_scale)
    each = {i: {k[len(i) + 1 :]: v for k, v in found.items() if k.startswith(f"{i}.")} for i in name.split("+")}
    return " and ".join(titled(i, own, doc.full_scale) for i, own in each.items())


def _ways(doc: ComparedRuns) -> list[say.Way]:
    """What a class stands for, the likeliest first."""
    P = _posterior(doc)
    return [say.Way(_title(doc, str(k)), P.get(k, 0.0)) for k in ways(doc.effects, P)]


def _posterior(doc: ComparedRuns) -> dict[Explanation, float]:
    alone = {str(k): k for k in (NONE, UNKNOWN, DOUBT)}
    of = {k: alone[k] if k in alone else Explanation.of(*k.split("+")) for k in (r.effect for r in doc.ranking)}
    return {of[r.effect]: r.probability for r in doc.ranking}


def _open(doc: ComparedRuns, size: str) -> str:
    """Why nothing is said."""
    if doc.rule.endswith(NO_SPEED):
        return f"Something changed: {doc.rule}."
    if doc.rule.endswith((IN_WIND, NOTHING_SHARED)):
        return f"These recordings cannot be compared: {doc.rule}."
    if doc.rule.startswith(SPREAD):
        return f"These recordings cannot say whether anything changed{size}; two runs may differ by as much."
    if doc.rule == OTHER_STAND:
        return f"Something is wrong{size}: {doc.rule}."
    return f"{say.something(_posterior(doc))}{size}, and these recordings do not show what."


def _ends(r: Ratio, factor: float = 1.0) -> list[str]:
    return [f"{a * factor:.4f} to {b * factor:.4f}" for a, b in ((r.low68, r.high68), (r.low95, r.high95))]


def _said(doc: ComparedRuns) -> list[str]:
    """Sentences on loads, cause, what speaks against it, and the next step with its command."""
    text, command = (doc.next_measurement.get(k) for k in ("text", "command"))
    told = doc.told if doc.diagnosis and doc.told else _causes(doc)
    left = [w for w in _wrong(doc, recordings.ERROR_IN[1]) if w.kind in LEFT_OUT]
    out = [*say.left_out(left), *say.seen(doc.ratios, "B against A"), *_of_density(doc.density), *told,
           *_of_miscount(doc), *_of_drive(doc), *_of_files(doc), *([f"Next: {text}."] if text else [])]  # fmt: skip
    if command and "CASE" in command.split():
        out.append("  with a case of this rotor, or its label, the solver weighs the causes:")
    elif command and (checked := doc.next_measurement.get("checks")):
        out.append(f"  if {title_of(checked)} is ruled out:")
    return [line for words in (*out, *([f"  {command}"] if command else [])) for line in say.wrapped(words)]


def _wrong(doc: ComparedRuns, start: str) -> list[say.Wrong]:
    """Notes with such a start, in their parts."""
    out = []
    for note in (n for n in doc.notes if n.startswith(start)):
        where, _, rest = note.removeprefix(start).partition(": ")
        kind, _, words = rest.partition(": ")
        channel = next((c for c in READ if words.startswith(f"{c}: ")), "")
        evidence, _, fix = words.removeprefix(f"{channel}: ").partition("; ")
        told = (evidence, fix) if kind in LEFT_OUT else (words.removeprefix(f"{channel}: "), "")
        out.append(say.Wrong(where, kind, *told, channel=channel))
    return out


def _of_files(doc: ComparedRuns) -> list[str]:
    """What cannot be so in A or B, and what the files leave open."""
    wrong = _wrong(doc, recordings.ERROR_IN[0])
    wrong = [w._replace(both=any(w.kind == v.kind and w.where != v.where for v in wrong)) for w in wrong]
    first = next(iter(doc.ranking), None)
    cause = {first.effect: first.parameters} if first and doc.effects[:1] == (first.effect,) else {}
    warned = [n for n in doc.notes if n.startswith(recordings.ERROR_IN[1]) and n.split(": ", 2)[1] not in LEFT_OUT]
    return [*say.of_files(wrong, cause), *(f"{note[0].upper()}{note[1:]}." for note in warned)]


def _of_density(density: Densities) -> list[str]:
    if not density.ratio or abs(density.ratio - 1.0) <= 0.003:
        return []
    recorded = f"Recorded density: {density.A:.4g} to {density.B:.4g} kg/m3" if density.A and density.B else ""
    return [f"{recorded or 'Density from the recorded temperatures'} ({density.ratio - 1:+.1%})."]


def _of_miscount(doc: ComparedRuns) -> list[str]:
    """The commonest miscount of the speed that moves the loads as they moved, where that is a likely cause."""
    likely = [r.effect for r in doc.ranking if r.probability >= _GUESS]
    if doc.diagnosis or "rpm_scale" not in (*doc.effects, *likely):
        return []
    r = next((r for r in doc.ratios.values() if r.kind == "thrust"), None)
    low, high = (r.high95**-0.5, r.low95**-0.5) if r else (math.inf, 0.0)
    if found := [r.parameters["factor"].value for r in doc.ranking[:1] if "factor" in r.parameters]:
        low, high = 0.999 * found[0], 1.001 * found[0]  # of the answer
    fits = (m for m in speed_ratios(nearest=Fraction(8, 7)) if low < m.ratio < high)
    return [f"A miscount of {m.true}/{m.set} fits: in B, {m.words}; or the inverse in A." for m in fits][:1]


def _of_drive(doc: ComparedRuns) -> list[str]:
    """What the drive says beside the answer."""
    drive = doc.subsystems.get("drive")
    if drive and not set(drive.effects) <= {*doc.effects}:
        return [f"Drive: {', '.join(map(title_of, drive.effects))}."]
    if drive and drive.rule.startswith(recordings.VOLTS_AS_RECORDED) and drive.effects != doc.effects:
        return [f"Drive: {drive.rule}."]
    if drive and doc.verdict != "none" and drive.verdict == "none":
        moved = any(r.kind in OVER_COMMAND and not r.low95 < 1.0 < r.high95 for r in doc.ratios.values())
        return [f"Drive: no change beyond {'what load, voltage or a miscount explains' if moved else 'scatter'}."]
    return []


def _causes(doc: ComparedRuns) -> list[str]:
    """What else it may be, or what is likeliest; the reason where there is one."""
    if doc.verdict == "class":
        return say.others(_ways(doc), doc.sets, partial(_title, doc), _posterior(doc))
    if doc.verdict == "insufficient" and not doc.rule.endswith((IN_WIND, NOTHING_SHARED, NO_SPEED, OTHER_STAND)):
        return say.likeliest(_posterior(doc), lambda k: _title(doc, str(k)), say.NO_CHANGE)
    told = doc.rule.startswith((ON_ONE, *recordings.AS_RECORDED)) or doc.rule == REVERSED
    return [] if told or doc.verdict not in CLAIMS else [f"{doc.rule[0].upper()}{doc.rule[1:]}."]


def _tables(doc: ComparedRuns) -> list[str]:
    out = []
    parts = {"": doc.ranking} if doc.diagnosis else {name: one.ranking for name, one in doc.subsystems.items()}
    for name, ranking in parts.items():
        rows = []
        for r in ranking[:_ROWS]:
            sizes = (f"{k} {v.value:.4g}" for k, v in r.parameters.items() if isinstance(v.value, (int, float)))
            rows.append([r.effect, f"{r.probability:.3f}", ", ".join(sizes)])
        if rows:
            out += ["", text_table([name or "explanation", "probability", "size"], rows, left=(0, 2), indent="  ")]
    return out
