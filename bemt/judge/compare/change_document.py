"""Two recordings without a case: ``bemt.comparison/1``, the step that would settle it, what an engineer would say."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from typing import Any

import numpy as np

from bemt import __version__
from bemt.base.document import Documented
from bemt.base.tables import number_text, or_null, text_table
from bemt.base.unit_errors import speed_ratios
from bemt.judge.compare import recordings
from bemt.judge.compare.drive_laws import FAMILY, FAMILY_WORD, Judgement, check_of, title_of
from bemt.judge.compare.matched import LOADS, OVER_COMMAND, WITHOUT_SPEED
from bemt.judge.compare.recordings import IN_WIND, NO_SPEED, NOTHING_SHARED, OTHER_STAND, REVERSED, RunChange
from bemt.judge.compare.selection import Invocation
from bemt.judge.compare.sizes import titled
from bemt.judge.compare.smooth_change import Ratio
from bemt.judge.explanation import NONE, UNKNOWN, Explanation, Size
from bemt.judge.loss import SPREAD, checks_by_worth, minutes, ways

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
_STEPS = 2  # that are offered at once


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
        text = "record the speed in both runs, headed rpm: at equal speed causes scale apart"
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
    members = [k for k in said.effects if check_of(k)]
    order = checks_by_worth(said.ranked, minutes("reference", len(change.a.points)))
    firsts: dict[str, str] = {}
    for cause in [k for k in order if k in members or said.verdict != "class"] or members:
        firsts.setdefault(FAMILY.get(cause, cause), cause)
    causes = [*firsts.values()][:_STEPS] or [""]
    again = {"b": "A_AGAIN.csv", "rows_b": asked.rows_a, "air_b": asked.air_a}
    command = asked.without(causes[0]) if causes[0] else asked.command(**again)
    return "; or ".join(check_of(k) if k else _REPEAT for k in causes), command, causes[0]


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
    return tuple(RankedCause(str(k), p, said.parameters.get(str(k), {})) for k, p in first)


WORD = {
    "thrust_N": "thrust", "torque_Nm": "torque", "power_W": "shaft power", "CT": "CT", "CP": "CP", "CQ": "CQ",
    "electrical_power_W": "electrical power", "rpm": "speed at equal command",
    "voltage_V": "voltage at equal command",
}  # fmt: skip
# Runs at nearly one speed say nothing of a change over it: error per doubling from which it is not shown [1].
_NO_SLOPE = 1.0
_ROWS, _NOTES = 8, 4
_PULSE = 0.01  # a command below is a pulse width [s], above a throttle [1]
# Families of causes, less one, from which a headline says the change first.
_MANY = 2
# Probability from which a cause is said as a guess.
_GUESS = 0.1
_LEAST = 0.01  # probability that is told with two digits
_NO_CAUSE = ("none", "unknown", "doubt")


def _shares(*values: float) -> list[str]:
    """Changes in one notation: percent, or factors where one of them is far from 1.

    >>> _shares(2.09, 1.66, 2.63), _shares(1.0, 0.9)
    (['x2.09', 'x1.66', 'x2.63'], ['+0.0%', '-10.0%'])
    """
    near = all(0.4 < x < 2.5 for x in values)
    return [f"{x - 1.0:+.1%}" if near else f"x{number_text(x, 3)}" for x in values]


def _intervals(channels: Sequence[Ratio]) -> list[list[str]]:
    """Change of each channel as measured and the ends of its 95 % interval, all in one notation."""
    said = _shares(*(k * r.density_ratio for r in channels for k in (r.ratio, r.low95, r.high95)))
    return [said[i : i + 3] for i in range(0, len(said), 3)]


def _range(r: Ratio) -> str:
    low, high = r.range
    if r.kind == "at_power":
        return f"{math.exp(low):.0f} to {math.exp(high):.0f} W"
    if r.kind in OVER_COMMAND:
        return f"{1e6 * low:.0f} to {1e6 * high:.0f} µs" if high < _PULSE else f"{low:.0%} to {high:.0%}"
    if high - low < 1e-9:
        return "advance ratio {:.2f} to {:.2f}".format(*r.advance_range)
    return f"{math.exp(low):.0f} to {math.exp(high):.0f} rev/min"


def text(doc: ComparedRuns, details: bool = False) -> str:
    """Lines of a comparison."""
    lines = textwrap.wrap(headline(doc), 110)
    lines += [f"verdict: {doc.verdict}" + (f" {', '.join(doc.effects)}" if doc.effects else "")]
    errors = [n for n in doc.notes if n.startswith(recordings.ERROR_IN)]
    lines += [textwrap.fill(n, 110, initial_indent="  ", subsequent_indent="    ") for n in errors]
    lines += _said(doc)
    rows = []
    for channel, r in doc.ratios.items():
        raw = r.ratio * r.density_ratio
        slope = "-"
        over_speed = r.kind not in (*OVER_COMMAND, *WITHOUT_SPEED)
        if over_speed and r.slope is not None and r.slope_error is not None and r.slope_error < _NO_SLOPE:
            slope = f"{r.slope:+.1%} +- {r.slope_error:.1%}"
        more = [slope, f"{r.scatter:.1%}", "{}, {}".format(*r.points)]
        rows.append([_at(WORD.get(channel, channel), r), f"{raw:.4f}", *_ends(r, r.density_ratio), *more])
        if abs(r.density_ratio - 1.0) > 1e-6:
            coefficient = "CT" if channel == "thrust_N" else "CP"
            rows.append([f"  {coefficient} (corrected for density)", f"{r.ratio:.4f}", *_ends(r), "", "", ""])
    header = ["B over A", "ratio", "68 %", "95 %", "change per doubling of n", "scatter", "points"]
    lines += ["", text_table(header, rows, left=(0,), indent="  ")]
    if details:
        lines += _tables(doc)
    lines += [f"  assumed: {a}" for a in doc.assumed]
    notes = [n for n in doc.notes if n not in errors]
    notes = notes if details else [n for n in notes if not n.startswith(("A: ", "B: "))][:_NOTES]
    lines += [f"  note: {n}" for n in notes]
    return "\n".join(lines)


def headline(doc: ComparedRuns) -> str:
    """What an engineer would say first."""
    effects, verdict = list(doc.effects), doc.verdict
    moved = _moved(doc)
    if verdict == "none" and doc.rule.endswith(recordings.ONLY_VOLTS):
        return f"Same thrust per watt ({moved}); {doc.rule}."
    if verdict == "none":
        return f"No change beyond the difference between two set-ups ({moved or 'drive only'})."
    if verdict == "unknown":
        return "Something changed" + (f" ({moved})" if moved else "") + ", and no listed cause explains it."
    if verdict == "insufficient":
        return _open(doc, f" ({moved})" if moved else "")
    if doc.rule == REVERSED:
        return f"{REVERSED[0].upper()}{REVERSED[1:]} ({moved}): the cell is reversed, or the rotor turns the other way."
    if effects == ["air_density"] and doc.rule.startswith(recordings.AS_RECORDED):
        return f"Nothing but the air changed, as recorded ({moved}); the coefficients agree."
    if len(effects) == 1:
        lead = "The stand, not the rotor" if verdict == "sensor" else "What changed"
        return f"{lead}: {_title(doc, effects[0])} ({moved or 'drive alone'})."
    several = families(effects, doc.ranking)
    if several.count(", or ") >= _MANY:  # what was measured first, where little is known of the cause
        return f"{moved[0].upper()}{moved[1:]}: {several}." if moved else f"The drive: {several}."
    return f"{several[0].upper()}{several[1:]} ({moved or 'drive alone'})."


def _title(doc: ComparedRuns, name: str) -> str:
    """Title of a cause, or of a pair of them, with the size as far as it was worked out."""
    return titled(name, next((r.parameters for r in doc.ranking if r.effect == name), {}), doc.full_scale)


def _moved(doc: ComparedRuns) -> str:
    """What changed by how much: a cause in the drive has moved the drive, not the loads."""
    drive = {FAMILY.get(k, k) for k in doc.effects} == {"drive"}
    kinds = ("speed", "voltage", "electrical") if drive else ("thrust", "torque", *WITHOUT_SPEED)
    loads = {r.kind: (_at(WORD[c], r), r) for c, r in doc.ratios.items()}
    shown = [loads[k] for k in kinds if k in loads][:2]
    shares = _intervals([r for _, r in shown])
    return " and ".join(f"{word} {share[0]}" for (word, _), share in zip(shown, shares, strict=True))


def _at(word: str, r: Ratio) -> str:
    """What a ratio is of, and at what it is taken if not at the speed."""
    return f"{word} at equal {WITHOUT_SPEED[r.kind]}" if r.kind in WITHOUT_SPEED else word


def _open(doc: ComparedRuns, size: str) -> str:
    """Why nothing is said, and what is likeliest."""
    if doc.rule.endswith(NO_SPEED):
        return f"Something changed: {doc.rule}."
    if doc.rule.endswith((IN_WIND, NOTHING_SHARED)):
        return f"These recordings cannot be compared: {doc.rule}."
    if doc.rule.startswith(SPREAD):
        return f"These recordings cannot say whether anything changed{size}; two runs may differ by as much."
    guess = "" if doc.rule == OTHER_STAND else families(_likely(doc), doc.ranking)
    return f"These recordings cannot say what changed{size}" + (f"; likeliest {guess}." if guess else ".")


def _likely(doc: ComparedRuns) -> list[str]:
    """Causes that are likely enough to be said as a guess, the likeliest first."""
    return [r.effect for r in doc.ranking if r.probability >= _GUESS and r.effect not in _NO_CAUSE]


def families(effects: Sequence[str], ranking: Sequence[RankedCause] = ()) -> str:
    """What an engineer would look at, the likeliest first; "" where nothing is listed."""
    likely = {r.effect: r.probability for r in ranking}
    titles: dict[str, list[str]] = {}
    for k in effects:
        titles.setdefault(FAMILY.get(k, k), []).append(k)
    order = sorted(titles, key=lambda f: -sum(likely.get(k, 0.0) for k in titles[f]))
    return ", or ".join(FAMILY_WORD.get(f, f) if len(titles[f]) > 1 else title_of(titles[f][0]) for f in order)


def _ends(r: Ratio, factor: float = 1.0) -> list[str]:
    return [f"{a * factor:.4f} to {b * factor:.4f}" for a, b in ((r.low68, r.high68), (r.low95, r.high95))]


def _said(doc: ComparedRuns) -> list[str]:
    """Sentences on loads, density, cause, drive and next step, with the command."""
    text, command = (doc.next_measurement.get(k) for k in ("text", "command"))
    told = (doc.told or ()) if doc.diagnosis else (sentence(doc),)
    below = ("Next: ", "bemt ", "if ") if text else ()
    out = [*_of_loads(doc), *_of_density(doc.density), *(t for t in told if not t.lstrip().startswith(below)),
           *_of_miscount(doc), *_of_drive(doc), *([f"Next: {text}."] if text else [])]  # fmt: skip
    out = [textwrap.fill(line, 110, initial_indent="  ", subsequent_indent="    ") for line in out]
    if command:
        checks = "" if doc.diagnosis else doc.next_measurement.get("checks")
        out += [f"    if {title_of(checks)} is ruled out:"] if checks else []
        out += [f"    {t.strip()}" for t in told if t.lstrip().startswith("if ")]
        out.append(f"    {command}")
    return out


def _of_density(density: Densities) -> list[str]:
    if not density.ratio or abs(density.ratio - 1.0) <= 0.003:
        return []
    recorded = f"Recorded density: {density.A:.4g} to {density.B:.4g} kg/m3" if density.A and density.B else ""
    return [f"{recorded or 'Density from the recorded temperatures'} ({density.ratio - 1:+.1%})."]


def _of_miscount(doc: ComparedRuns) -> list[str]:
    """The commonest miscount of the speed that moves the loads as they moved, where that is a likely cause."""
    if doc.diagnosis or "rpm_scale" not in (*doc.effects, *_likely(doc)):
        return []
    r = next((r for r in doc.ratios.values() if r.kind == "thrust"), None)
    low, high = (r.high95**-0.5, r.low95**-0.5) if r else (math.inf, 0.0)
    fits = (m for m in speed_ratios(nearest=Fraction(8, 7)) if low < m.ratio < high)
    return [f"A miscount of {m.true}/{m.set} fits: in B, {m.words}; or the inverse in A." for m in fits][:1]


def _of_drive(doc: ComparedRuns) -> list[str]:
    """What the drive says beside the answer."""
    drive = doc.subsystems.get("drive")
    if drive and drive.effects and drive.effects != doc.effects:
        return [f"Drive: {drive.verdict}: {', '.join(title_of(k) for k in drive.effects)}."]
    if drive and doc.verdict != "none" and drive.verdict == "none":
        moved = any(r.kind in OVER_COMMAND and not r.low95 < 1.0 < r.high95 for r in doc.ratios.values())
        return [f"Drive: no change beyond {'what load, voltage or a miscount explains' if moved else 'scatter'}."]
    return []


def _of_loads(doc: ComparedRuns) -> list[str]:
    """How far the loads of B are from those of A."""
    loads = {c: r for c, r in doc.ratios.items() if r.kind in ("thrust", "torque", *WITHOUT_SPEED)}
    if not loads:
        return []
    first, intervals = next(iter(loads.values())), _intervals(list(loads.values()))
    words = [f"{WORD[c]} {at} ({low} to {high})" for c, (at, low, high) in zip(loads, intervals, strict=True)]
    where = "extrapolated to one speed" if first.extrapolated else _range(first)
    grows = [WORD[c] for c, r in loads.items() if r.depends_on]
    at = WITHOUT_SPEED.get(first.kind, "speed")
    more = f"The ratio of {' and '.join(grows)} changes with {'it' if at != 'speed' else 'speed or advance ratio'}."
    return [f"B against A at equal {at}, {where}: {', '.join(words)}; 95 % in brackets.", *([more] if grows else [])]


def sentence(doc: ComparedRuns) -> str:
    """Verdict and reason."""
    names = ", ".join(map(title_of, doc.effects))
    sure = f" (probability {doc.probability:.2f})" if doc.probability else ""
    if doc.verdict == "none":
        return f"{doc.rule[0].upper()}{doc.rule[1:]}."
    if doc.verdict in ("named", "sensor"):
        lead = "The stand" if doc.verdict == "sensor" else "What changed"
        return f"{lead}: {names}{sure}: {doc.rule}."
    if doc.verdict == "class":
        if len(doc.sets) > 1:  # more than one cause
            return f"{doc.rule}{sure}: {names}."
        P = {Explanation.of(*r.effect.split("+")): r.probability for r in doc.ranking}
        return one_of(doc.probability, {_title(doc, str(k)): P.get(k, 0.0) for k in ways(doc.effects, P)})
    if doc.verdict == "unknown":
        return f"Unknown: {doc.rule}."
    first = [title_of(k) for k in _likely(doc)]
    if doc.rule == OTHER_STAND or doc.rule.endswith((IN_WIND, NOTHING_SHARED, NO_SPEED)):
        return f"No cause can be given: {doc.rule}."
    if doc.rule.startswith(SPREAD):
        return f"No change is proven: {doc.rule}" + (f"; else {', '.join(first)}" if first else "") + "."
    return f"There is a change, but {doc.rule}" + (f". Likeliest: {', '.join(first)}" if first else "") + "."


def one_of(total: float | None, each: Mapping[str, float]) -> str:
    """What a class stands for, each way with its probability.

    >>> one_of(0.97, {"gain": 0.9, "zero": 0.07, "duct": 0.001})
    'One of these (0.97 in all): gain 0.90; zero 0.07; duct below 0.01.'
    """
    listed = "; ".join(f"{title} {p:.2f}" if p >= _LEAST else f"{title} below {_LEAST}" for title, p in each.items())
    return f"One of these{'' if total is None else f' ({total:.2f} in all)'}: {listed}."


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
