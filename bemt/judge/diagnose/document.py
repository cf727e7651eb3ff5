"""The answer as a document ``bemt.diagnosis/1`` and as the lines an engineer would say."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bemt import __version__
from bemt.base.tables import or_null, text_table
from bemt.data.recordings.channels import AS_ELECTRICAL, AS_SHAFT
from bemt.data.recordings.check import LEFT_OUT
from bemt.judge.compare import sentences as say
from bemt.judge.compare.drive_laws import title_of
from bemt.judge.compare.sizes import in_words, of_largest, sized, titled
from bemt.judge.diagnose import fit as fitting
from bemt.judge.diagnose import other_rotor
from bemt.judge.diagnose.answer import Diagnosis, bare, share
from bemt.judge.diagnose.form import nearest
from bemt.judge.diagnose.posterior import LEAST
from bemt.judge.diagnose.record import DROPPED, NO_SPEED, POWER_OPEN
from bemt.judge.diagnose.suggest import LEVEL
from bemt.judge.explanation import DOUBT, NONE, UNKNOWN, Explanation, Size
from bemt.judge.loss import CLAIMS, SPREAD, ways
from bemt.physics import effects
from bemt.physics.effects.propeller import AnotherPropeller
from bemt.rotors.case.fresh import OPEN_ENDINGS

if TYPE_CHECKING:
    from bemt.judge.compare.recordings import RunChange

SCHEMA = "bemt.diagnosis/1"
_OPEN = 0.95  # share of a parameter's range that its interval may take before nothing is said of it [1]
_SHOWN = 8
_FINDINGS = 3
_GUESS = 0.3  # least probability of a guess
# Level that is said even where no cause shows, and from which on it is asked whether the rotor is that of the case.
_WORTH_SAYING, _WORTH_ASKING = 0.05, 0.15
_LINES = 12  # of an answer
_FINDING = re.compile(r"(.*?): (?:error|warning|note): (\w+) \((.*?)\): (.*?)\. Correction: (.*)", flags=re.S)
_NOTHING = "no cause, only noise and what calibration leaves open"


def document(d: Diagnosis) -> dict[str, Any]:
    """Give the document."""
    found, said, hyper = d.found, d.said, d.found.states[0].hyper
    ranking = []
    for name, p in sorted(found.probability.items(), key=lambda kv: -kv[1])[:12]:
        solved = name.ids and all(i in found.spans for i in name)
        own = fitting.intervals(found, name) if solved and p > 1e-3 else {}
        sizes = d.parameters if name == d.decision.leading else own
        flat = {k: v.document() for k, v in fitting.flat(name, sizes).items()}
        ranking.append({"effect": str(name), "probability": p, "parameters": flat})
    return {
        "schema": SCHEMA,
        "version": __version__,
        "verdict": said.verdict,
        "effects": list(said.effects),
        "probability": said.probability,
        "systems": d.systems,
        "ranking": ranking,
        "expected_loss": dict(said.loss),
        "inclusion": {k: v for k, v in found.inclusion.items() if v > 1e-3},
        "location": d.where.document(),
        "fit": {c: {k: or_null(v) for k, v in s.items()} for c, s in d.scores.items()},
        "blocks": d.blocks,
        "sets": [list(s) for s in said.sets],
        "in_reference": sorted(d.in_reference),
        "classes": d.alike.classes(),
        "next_measurement": d.next.document(),
        "p_value": d.p_value,
        "log_bayes": {str(e): odds for e, odds in d.posterior.log_bayes.items()},
        "nearest_signature": nearest(found),
        "visibility": {i: float(s) for i, s in zip(d.alike.ids, d.alike.size, strict=True)},
        "covariance": {"noise_scale": hyper.scale, "correlation": hyper.ar, "solver_error": hyper.model},
        "baseline": [effects.to_text(e) for e in d.problem.baseline],
        "not_tried": dict(d.absent),
        "rule": said.why,
        "headline": headline(d),
        "findings": list(d.problem.findings),
        "notes": list(d.problem.notes),
        "validity": [*d.problem.no_check, *d.problem.validity],
        "readings": int(d.problem.y.size),
        "explanation": " ".join(line.strip() for line in explanation(d)),
    }  # fmt: skip


@dataclass(frozen=True)
class Sentences:
    """Sentences of an answer, in the order in which they are said."""

    first: str
    seen: list[str]  # What was measured
    causes: list[str]  # What else it may be
    against: list[str]  # What the files say against it, or what has to be mended first
    details: list[str]  # Numbers behind the answer
    step: list[str]  # Next step, and what to type then
    last: list[str]  # What was not tried


def told(d: Diagnosis) -> Sentences:
    """Say the answer."""
    against = [*_files(d), *_of_another_rotor(d), *_level_alone(d), *_reference_off(d), *_of_loads(d),
               *(f"{words[:1].upper()}{words[1:]}." for words in d.problem.no_check)]  # fmt: skip
    details = [*_signs(d), *_beyond(d), *(f"Model: {words}." for words in d.problem.validity), _gain(d)]
    return Sentences(headline(d), [*_left_open(d), *_seen(d)], _causes(d), against, details, _next(d), _not_tried(d))


def explanation(d: Diagnosis) -> list[str]:
    """Say the answer in a few sentences."""
    said = told(d)
    return [said.first, *said.seen, *said.causes, *said.against, *said.details, *said.step, *said.last]


def _change(d: Diagnosis) -> RunChange | None:
    """Change from the references, of which loads and drive are parts."""
    return d.change if d.loads is None else d.loads.change


def _seen(d: Diagnosis) -> list[str]:
    """What was measured: the change from the reference, or where the recording is off the case."""
    words: list[str] = []
    if change := _change(d):
        words = say.seen(change.ratios, "Against the reference")
        words += say.seen(change.ratios, "Against the reference", True) if d.said.by == "drive" else []
    if words or d.said.verdict == "none":
        return words
    return [(d.where if _is_claim(d) else bare(d.found)).sentence(d.words)]


def _is_claim(d: Diagnosis) -> bool:
    return d.said.verdict not in ("unknown", "insufficient") or other_rotor.doubted(d.problem, d.said)


def _beyond(d: Diagnosis) -> list[str]:
    """Without a cause, what calibration would leave of the mismatch, where it is another thing than what was seen.

    The location of the document is what remains in the light of the likeliest explanation. Its sign, and where none is
    given even its channel, may be those of something that the recording does not show.
    """
    shown, rest = bare(d.found), d.where
    same = shown.one_sided and (shown.channel, shown.size > 0) == (rest.channel, rest.size > 0)
    if same or d.said.verdict == "none" or _is_claim(d):
        return []
    words = rest.rest(d.words)
    return [f"Beyond the uncertainty of gains, blade angle and solver: {words[0].lower()}{words[1:]}"]


def _causes(d: Diagnosis) -> list[str]:
    """Size of a cause that is named, what else a class may be, or what is likeliest where nothing is claimed."""
    said, problem = d.said, d.problem
    if said.verdict in ("named", "sensor"):
        size = _parameters(d)
        brackets = "; 90 % in brackets" if " to " in size else ""
        return [f"Size: {size}{brackets}."] if size and size not in headline(d) else []
    if said.verdict == "class":
        return say.others(_ways(d), said.sets, lambda i: _title(d, i), d.found.probability)
    if said.verdict == "unknown":
        where, _, size = d.found.states[0].best_rival.partition(": ")
        return [f"Something smooth that is not in the library: it shows in {where}, by about {size[:-1]} %."]
    if said.verdict == "none":
        return []
    if not _shown(d) and other_rotor.foreign(problem):
        return [f"Most likely: {other_rotor.nearest_slips(problem)}."]
    return say.likeliest(d.found.probability, lambda k: _both(d, k), say.NO_CHANGE if _shown(d) else _NOTHING)


def _shown(d: Diagnosis) -> bool:
    """Whether a reference shows the rotor."""
    return not d.problem.free.all()


def _signs(d: Diagnosis) -> list[str]:
    known = effects.catalogue()
    signs = "; ".join(known[i].sign for i in d.said.effects if i in known and known[i].sign)
    return [f"Signature: {signs}."] if signs and d.said.verdict in ("named", "sensor") else []


def _gain(d: Diagnosis) -> str:
    words = []
    for channel, s in d.scores.items():
        most = s["largest"] or 1.0
        words.append(
            f"{d.words[channel]} {s['holdout_before'] / most:.1%} before, {s['holdout_after'] / most:.1%} "
            f"after (noise {s['noise'] / most:.1%}, smooth fit without physics {s['gp_only'] / most:.1%})"
        )
    return f"Predicting {d.blocks} it was not fitted to, the error in % of the largest value is: {'; '.join(words)}."


def _parameters(d: Diagnosis) -> str:
    """What the parameters may be: effect by effect, named where there are two."""
    each = []
    for i, found in d.parameters.items():
        of = {p.name: p for p in effects.catalogue()[i].parameters}
        first, left = in_words(found), []
        words = [first] if first else []
        for k, v in found.items():
            if k in ("channel", "unit") or (k == "factor" and (first or v.value == 1.0)):
                continue
            word = k if k != "eps" else "off by another" if first else "off by"
            if isinstance(v.value, float) and v.high - v.low > _OPEN * (of[k].high - of[k].low):
                left.append(k)
            elif isinstance(v.value, float):
                low, value, high = (sized(of[k], end) for end in (v.low, v.value, v.high))
                words.append(f"{word} {value} ({low} to {high}){of_largest(i, k, v.value, full_scale(d))}{_odds(v)}")
            elif v.value is not None:
                words.append(f"{word} {v.value}{_odds(v)}")
        words += [f"{' and '.join(left)} not determined"] if left else []
        if words:
            each.append((f"{title_of(i)}: " if len(d.parameters) > 1 else "") + ", ".join(words))
    return "; ".join(each)


def _title(d: Diagnosis, name: str) -> str:
    """Title of an effect, with its state if that is not the usual one, or its size."""
    return titled(name, d.parameters.get(name, {}), full_scale(d))


def full_scale(d: Diagnosis) -> Mapping[str, float]:
    """Largest reading of each channel of the recording [SI]."""
    scales = [p.full_scale for p in d.problem.parts if not p.record.reference]
    return {k: max(s[k] for s in scales if k in s) for k in {k for s in scales for k in s}}


def _odds(told: Size) -> str:
    """Probabilities of the values of a discrete parameter, where more than one is left."""
    odds = [(v, p) for v, p in told.odds or () if p >= 0.05]
    if len(odds) < 2:
        return ""
    return " [" + ", ".join(f"{v if isinstance(v, str) else f'{v:.3g}'} {p:.2f}" for v, p in odds) + "]"


def _wrong(d: Diagnosis) -> tuple[list[say.Wrong], list[str]]:
    """What looks wrong in the recordings of the test in its parts, and what else is said of them."""
    problem, question, wrong, rest = d.problem, other_rotor.finding(d.problem), [], []
    known = [f for p in problem.parts if p.record.reference for f in p.record.findings]
    shared, claim = {m[2] for m in map(_FINDING.fullmatch, known) if m}, d.said.verdict in CLAIMS
    for f in (f for f in problem.findings if f not in known):
        if m := _FINDING.fullmatch(f):
            fix = "" if claim and m[2] not in LEFT_OUT else m[5]
            wrong.append(say.Wrong(m[1], m[2], m[4], fix, m[2] in shared, m[3]))
        elif f != question or not other_rotor.foreign(problem):
            rest.append(f"In the file: {f}.")
    return wrong, rest


def _files(d: Diagnosis) -> list[str]:
    """What the files contradict or lose."""
    problem, (wrong, rest) = d.problem, _wrong(d)
    wrong = [w for w in wrong if w.kind not in LEFT_OUT]
    cause = {i: d.parameters.get(i, {}) for i in d.said.leading} if d.said.verdict in CLAIMS else {}
    found = [*say.of_files(wrong, cause), *rest]
    if left := found[_FINDINGS:]:
        found[_FINDINGS - 1 :] = [f"{found[_FINDINGS - 1]} And {len(left)} more; `import` shows all."]
    return [*found, *(f"In the file: {note}." for note in problem.notes if DROPPED in note)]


def _left_open(d: Diagnosis) -> list[str]:
    """What the files leave open and was taken in another way than they say, so that all else hangs on it."""
    marks = [NO_SPEED, AS_ELECTRICAL, POWER_OPEN]
    if d.said.verdict != "none" and abs(d.problem.level.get("torque_Nm", 0.0)) > LEVEL:
        marks.append(AS_SHAFT)
    open_ = (f"In the file: {note}." for note in d.problem.notes if any(mark in note for mark in marks))
    return [*open_, *say.left_out([w for w in _wrong(d)[0] if w.kind in LEFT_OUT])]


def _reference_off(d: Diagnosis) -> list[str]:
    """How far the reference is from the case as stated, before the blade was fitted to it."""
    stated = d.problem.blade.moved
    if all(abs(v) <= LEVEL for v in stated.values()):
        return []
    off = ", ".join(f"{d.words[c]} {share(v)}" for c, v in stated.items())
    what = (
        "The case is not this rotor (reference:" if other_rotor.unlike(stated) else "The reference is off the case (by"
    )
    return [f"{what} {off}); the blade was fitted to the reference, so the comparison holds."]


def _level(d: Diagnosis) -> str:
    """How far the loads are from those of the case."""
    sizes = {c: share(v) if abs(v) > 1.0 else f"{v:+.0%}" for c, v in d.problem.level.items()}
    return " and ".join(f"{d.words[c]} by {size}" for c, size in sizes.items())


def _of_another_rotor(d: Diagnosis) -> list[str]:
    """Question whether the case is that of the rotor, and rotors that are nearer, where the loads speak for others."""
    said, problem, P = d.said, d.problem, d.found.probability
    doubted, lead = other_rotor.doubted(problem, said), ""
    open_ = problem.free.all() and said.verdict in ("insufficient", "unknown") and not problem.findings
    if open_ and problem.level and not doubted and P.get(DOUBT, 0.0) > d.found.prior.get(DOUBT, 1.0):
        lead = f"The loads are off the middle of the band ({_level(d)}): are {_stated(d)} its own?"
    if not (lead or doubted or said.effects[:1] == (AnotherPropeller.id,)):
        return []
    near = other_rotor.nearest_rotors(problem)
    words = [*filter(None, [lead, near and f"Nearest rotors: {near}."])]
    return [" ".join(words)] if words else []


def _level_alone(d: Diagnosis) -> list[str]:
    """That the level is off where there is no cause."""
    level = max(map(abs, d.problem.level.values()), default=0.0)
    if d.said.verdict != "none" or level <= _WORTH_SAYING:
        return []
    ask = f" Are {_stated(d)} right?" if not _shown(d) and level > _WORTH_ASKING else ""
    return [f"The level is off ({_level(d)}), within what gain, blade angle and solver allow; no cause shows.{ask}"]


def _of_loads(d: Diagnosis) -> list[str]:
    """What thrust and torque say for themselves, where the answer is that of the drive."""
    if d.loads is None or d.loads.decision.verdict == "none":
        return []
    return [f"Thrust and torque at the measured speed, judged separately: {headline(d.loads)}"]


def _stated(d: Diagnosis) -> str:
    """What a case states of its rotor: of a label the ending, too, which tells the kind of blade."""
    known = [p.as_built for p in d.problem.parts if p.as_built is not None]
    label = bool(known) and all(k.prior.known_from == "label" for k in known)
    label = label and not any(p.model.ducted for p in d.problem.parts)
    return f"diameter, pitch, blades and ending ({', '.join(OPEN_ENDINGS)})" if label else "diameter, pitch and blades"


def _next(d: Diagnosis) -> list[str]:
    """The next step, and what to type then."""
    step = d.next
    if not step.text:
        return []
    tells = [step.tells] if step.tells else []
    if step.minutes and step.gain:
        tells += [f"about {step.minutes:.0f} minutes", f"expected to settle {step.gain:.0%} of what is open"]
    why = f" ({', '.join(tells)})" if tells else ""
    case = "if nothing is wrong with it" if step.kind in ("mend", "case") else "without such a reference"
    other = [] if step.otherwise is None or step.kind == "run" else [f"  {case}: {step.otherwise.text}"]
    unless = [f"  if {title_of(step.checks)} is ruled out:"] if step.checks and step.commands else []
    return [f"Next: {step.text}{why}.", *unless, *(f"  {c}" for c in step.commands), *other]


def _not_tried(d: Diagnosis) -> list[str]:
    """Effects that could not be tried, by reason, in one line."""
    reasons: dict[str, list[str]] = {}
    for name, why in d.absent.items():
        reasons.setdefault(why, []).append(title_of(name))
    words = [f"{', '.join(names)} ({why})" for why, names in reasons.items()]
    return [f"Not tried: {'; '.join(words)}."] if words else []


def headline(d: Diagnosis) -> str:
    """What an engineer would say first."""
    said = d.said
    if said.verdict == "none":
        return _agreement(d)
    change = _moved(d)
    if said.verdict in CLAIMS:
        sets, against = said.sets or (said.effects,), f"{change} against the reference" if change else ""
        against += _in_both(d)
        return say.claimed(said.verdict, said.probability, sets, _ways(d), lambda i: _title(d, i), said.beside, against)
    if said.verdict == "insufficient" and (other_rotor.foreign(d.problem) or other_rotor.doubted(d.problem, said)):
        return f"These are not the loads of this case ({_off(d)}): check diameter, blades, units and speed first."
    file, wrong, _ = other_rotor.contradiction(d.problem)
    if file and said.verdict == "insufficient" and not _guess(d):  # a duct or a wall may be why it looks impossible
        return f"{file} cannot be right: {wrong}. Mend that before any cause is looked for."
    unknown, start = said.verdict == "unknown", say.something(d.found.probability)
    if not change:
        why = "and no effect in the library explains it" if unknown else "but these readings do not show why"
        return f"Recording and model differ ({_off(d)}), {why}."
    if not unknown and said.why.startswith(SPREAD):
        where = "whether anything changed from the reference"
        return f"These readings cannot say {where} ({change}); two runs may differ by as much."
    where = "in the drive, not in the loads" if said.by == "drive" else "from the reference"
    why = "no listed cause explains it" if unknown else "these readings do not show what"
    return f"{start} {where} ({change}), and {why}."


def _moved(d: Diagnosis) -> str:
    """What changed from the reference, by how much; "" where that was not compared."""
    change = _change(d)
    return "" if change is None else say.moved(change.ratios, d.said.by == "drive") or say.moved(change.ratios)


def _agreement(d: Diagnosis) -> str:
    """How far recording and model, or reference, agree where there is no cause."""
    if _shown(d):
        change = _moved(d)
        apart = f"{change} against the reference" if change else f"{_off(d)} from the model fitted to the reference"
        return f"No change beyond what two runs differ by ({apart}); no cause above {100.0 * LEAST:g} %."
    if max(map(abs, d.problem.level.values()), default=0.0) > LEVEL:
        allowed = "within the uncertainty of calibration, blade and solver; no cause"
        return f"Recording and model differ ({_off(d)}), {allowed}."
    return "Recording and model agree within noise, calibration and the uncertainty of the model."


def _ways(d: Diagnosis) -> list[say.Way]:
    """What a class stands for, the likeliest first."""
    P = d.found.probability
    return [say.Way(_both(d, k), P.get(k, 0.0)) for k in ways(d.said.effects, sorted(P, key=lambda k: -P[k]))]


def _both(d: Diagnosis, what: Explanation) -> str:
    """Titles of the effects that an explanation has at work together, with their sizes."""
    found = d.parameters if what == d.decision.leading else {}
    if not found and what.ids and all(i in d.found.spans for i in what):
        found = fitting.intervals(d.found, what)
    return " and ".join(titled(i, found.get(i, {}), full_scale(d)) for i in what)


def _off(d: Diagnosis) -> str:
    """By how much each channel differs from the case."""
    words = (f"{d.words[c]} {'up to ' if wide else ''}{share(v)}" for c, (v, wide) in d.off.items())
    return " and ".join(words)


def _in_both(d: Diagnosis) -> str:
    """What the case leaves out and the reference shows as well, of the effects that are claimed."""
    if not d.in_reference:
        return ""
    which = "it" if len(d.said.effects) == 1 else " and ".join(title_of(i) for i in d.in_reference)
    return f"; the case leaves {which} out, and the reference shows it as well"


def _guess(d: Diagnosis) -> bool:
    """Whether the likeliest effect is likely enough to be worth a look."""
    chance = d.found.probability.get(Explanation.of(*d.best.ids), 0.0) if d.best.ids else 0.0
    return chance >= max(_GUESS, d.found.probability[UNKNOWN], d.found.probability[NONE])


def text(d: Diagnosis, details: bool = False, lead: str = "") -> str:
    """The answer in twelve lines after a ``lead``; with ``details`` all sentences, and the tables behind them."""
    said = told(d)
    out = [*say.wrapped(f"{lead} {said.first}".strip(), "", ""), say.verdict_line(d.said.verdict, d.said.effects)]
    body = [*said.seen, *said.causes, *said.against]
    if not details:
        step = sum(len(say.wrapped(words)) for words in said.step)
        body = _few(body, [*_left_open(d), *said.causes], _LINES - len(out) - step)
    lines = [*body, *(said.details if details else []), *said.step]
    out += [line for words in lines for line in say.wrapped(words)]
    if details:
        out += [*_tables(d), *(f"  note: {note}" for note in d.problem.notes)]
        out += [line for words in said.last for line in say.wrapped(words)]
    return "\n".join(out)


def _few(body: list[str], sure: list[str], most: int) -> list[str]:
    """Sentences that fit into ``most`` lines, some of them in any case."""
    left, kept = most - sum(len(say.wrapped(words)) for words in sure), []
    for words in body:
        lines = 0 if words in sure else len(say.wrapped(words))
        if lines <= left or words in sure:
            kept.append(words)
            left -= lines
    return kept


def _tables(d: Diagnosis) -> list[str]:
    """The numbers behind the sentences."""
    found, size = d.found, dict(zip(d.alike.ids, d.alike.size, strict=True))
    rows = []
    for name, p in sorted(found.probability.items(), key=lambda kv: -kv[1])[:_SHOWN]:
        seen = f"{size[str(name)]:.1f}" if str(name) in size else "-"
        odds = "-" if name not in found.states[0].log_z else f"{found.log_bayes(name):.1f}"
        rows.append(["another rotor or file" if name.doubt else str(name), f"{p:.3f}", odds, seen])
    header = ["explanation", "probability", "ln odds over none", "typical size [sd]"]
    out = ["", text_table(header, rows, left=(0,), indent="  ")]
    kinds = ("before", "after", "noise", "holdout_before", "holdout_after", "gp_only")
    rows = [[c, *(f"{s[k] / s['largest']:.2%}" for k in kinds)] for c, s in d.scores.items()]
    header = ["RMSE over largest reading", "before", "after", "noise", "held out: before", "after", "smooth fit only"]
    h = found.states[0].hyper
    beside = "the stated or observed noise" if d.problem.u_known else "that of a typical stand (none is stated)"
    return [*out, "", text_table(header, rows, left=(0,), indent="  "),
            f"\n  p = {d.p_value:.3g}; noise x{h.scale:g} {beside}, correlation {h.ar:g}, "
            f"solver error {h.model:.0%}; {d.problem.y.size} readings"]  # fmt: skip
