"""The answer as a document ``bemt.diagnosis/1`` and as the lines an engineer would say."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from bemt import __version__
from bemt.base.tables import or_null, text_table
from bemt.data.recordings.channels import AS_ELECTRICAL, AS_SHAFT
from bemt.judge.compare.change_document import WORD, families, one_of
from bemt.judge.compare.drive_laws import title_of
from bemt.judge.compare.sizes import in_words, of_largest, sized, titled
from bemt.judge.diagnose import fit as fitting
from bemt.judge.diagnose import other_rotor
from bemt.judge.diagnose.answer import POWER, Diagnosis, bare, share
from bemt.judge.diagnose.form import nearest
from bemt.judge.diagnose.posterior import LEAST
from bemt.judge.diagnose.record import DROPPED, NO_SPEED, POWER_OPEN
from bemt.judge.diagnose.suggest import LEVEL
from bemt.judge.explanation import DOUBT, NONE, UNKNOWN, Explanation, Size
from bemt.judge.loss import CLAIMS, ways
from bemt.physics import effects
from bemt.physics.effects.propeller import AnotherPropeller
from bemt.rotors.case.fresh import OPEN_ENDINGS

SCHEMA = "bemt.diagnosis/1"
_OPEN = 0.95  # share of a parameter's range that its interval may take before nothing is said of it [1]
_SHOWN = 8
_FINDINGS = 3
_A_GROUP = 5  # members from which on a class is said as a group
_GUESS = 0.3  # least probability of a guess
# Level that is said even where no cause shows, and from which on it is asked whether the rotor is that of the case.
_WORTH_SAYING, _WORTH_ASKING = 0.05, 0.15
# Lines of an answer, and sentences that are only in its details.
_LINES, _DETAILS = 12, ("Model: ", "Signature: ", "Predicting ")


def document(d: Diagnosis) -> dict[str, Any]:
    """Give the document."""
    found, said, hyper = d.found, d.said, d.found.states[0].hyper
    ranking = []
    for name, p in sorted(found.probability.items(), key=lambda kv: -kv[1])[:12]:
        solved = name.ids and all(i in found.spans for i in name)
        own = fitting.intervals(found, name) if solved and p > 1e-3 else {}
        sizes = d.parameters if name == d.decision.leading else own
        flat = {(f"{i}.{k}" if name.pair else k): v.document() for i, q in sizes.items() for k, v in q.items()}
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


def _located(d: Diagnosis, claimed: bool) -> list[str]:
    """What the recording shows; without a cause also, where it is another thing, what calibration would leave of it.

    The location of the document is what remains in the light of the likeliest explanation. Its sign, and where none is
    given even its channel, may be those of something that the recording does not show.
    """
    if claimed:
        return [d.where.sentence(d.words)]
    seen, rest = bare(d.found), d.where
    lines = [seen.sentence(d.words)]
    if not seen.one_sided or (seen.channel, seen.size > 0) != (rest.channel, rest.size > 0):
        words = rest.rest(d.words)
        lines.append(f"Beyond the uncertainty of gains, blade angle and solver: {words[0].lower()}{words[1:]}")
    return lines


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


def _title(d: Diagnosis, name: str, sized: bool = False) -> str:
    """Title of an effect, with its state if that is not the usual one; ``sized``: where one number is its size, it."""
    found = d.parameters.get(name, {})
    return titled(name, found if sized else {k: v for k, v in found.items() if k == "state"}, full_scale(d))


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


def explanation(d: Diagnosis) -> list[str]:
    """Say the answer in a few sentences."""
    return [
        headline(d), *(f"{words[:1].upper()}{words[1:]}." for words in d.problem.no_check), *_before_physics(d),
        *(f"Model: {words}." for words in d.problem.validity), *_reference_off(d), *_of_another_rotor(d),
        *(_without_cause(d) if d.said.verdict == "none" else _with_cause(d)), _gain(d), *_of_loads(d), *_next(d),
        *_not_tried(d),
    ]  # fmt: skip


def _before_physics(d: Diagnosis) -> list[str]:
    """What the files leave open, contradict or lose."""
    problem, notes = d.problem, d.problem.notes
    marks = [NO_SPEED, AS_ELECTRICAL, POWER_OPEN]
    if d.said.verdict != "none" and abs(problem.level.get("torque_Nm", 0.0)) > LEVEL:
        marks.append(AS_SHAFT)
    findings = list(problem.findings[:_FINDINGS])
    if left := problem.findings[_FINDINGS:]:
        findings[-1] += f" And {len(left)} more; `import` shows all."
    open_ = (f"{note}." for note in notes if any(mark in note for mark in marks))
    dropped = (f"{note}." for note in notes if DROPPED in note)
    return [f"Before any physics: {words}" for words in (*open_, *findings, *dropped)]


def _reference_off(d: Diagnosis) -> list[str]:
    """How far the reference is from the case as stated, before the blade was fitted to it."""
    stated = d.problem.blade.moved
    if all(abs(v) <= LEVEL for v in stated.values()):
        return []
    off = " and ".join(f"{d.words[c]} {share(v)}" for c, v in stated.items())
    return [f"The reference is off the case as stated by {off}; the blade was fitted to it. Are diameter, "
            "pitch and blades of the case right?"]  # fmt: skip


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


def _without_cause(d: Diagnosis) -> list[str]:
    """Why there is no cause, and that the level is off all the same."""
    level = max(map(abs, d.problem.level.values()), default=0.0)
    lines = [f"Why: {d.said.why}."]
    if level > _WORTH_SAYING:
        ask = d.problem.free.all() and level > _WORTH_ASKING
        lines.append(
            f"The level is off ({_level(d)}), within what gain, blade angle and solver allow; no cause shows."
            + (f" Are {_stated(d)} right?" if ask else "")
        )
    return lines


def _with_cause(d: Diagnosis) -> list[str]:
    """Where the recording differs from the case, and what is said of the cause."""
    said = d.said
    if said.verdict in ("named", "sensor"):
        told, known = _parameters(d), effects.catalogue()
        named = f"Named: {', '.join(map(title_of, said.effects))} (probability {said.probability:.2f})"
        signs = "; ".join(known[i].sign for i in said.effects if i in known and known[i].sign)
        words = [f"{named}: {told}." if told else f"{named}.", *([f"Signature: {signs}."] if signs else [])]
    elif said.verdict == "class":
        if len(said.sets) < 2:
            words = [one_of(said.probability, {_both(d, k): d.found.probability.get(k, 0.0) for k in _ways(d)})]
        else:
            listed = ", ".join(_title(d, i) for i in said.effects)
            words = [f"{said.why[0].upper()}{said.why[1:]} ({said.probability:.2f}): {listed}."]
    elif said.verdict == "unknown":
        where, _, size = d.found.states[0].best_rival.partition(": ")
        words = [f"The cause is not in the library: {said.why}. It shows in {where}, by about {size[:-1]} %."]
    else:
        words = [f"No name is given: {said.why}."]
    claimed = said.verdict not in ("unknown", "insufficient") or other_rotor.doubted(d.problem, said)
    return [*_located(d, claimed), *words]


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
    cost = ""
    if step.minutes and step.gain:
        cost = f" About {step.minutes:.0f} minutes; expected to settle {step.gain:.0%} of what is open."
    case = "if nothing is wrong with it" if step.kind in ("mend", "case") else "without such a reference"
    other = [] if step.otherwise is None or step.kind == "run" else [f"  {case}: {step.otherwise.text}"]
    unless = [f"  if {title_of(step.checks)} is ruled out:"] if step.checks and step.commands else []
    return [f"Next: {step.text}{step.tells}.{cost}", *unless, *(f"  {c}" for c in step.commands), *other]


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
    if said.verdict in CLAIMS:
        moved = ", ".join(f"{name} {share(v)}" for name, v in _ratios(d))
        against = f" ({moved} against the reference)" if moved else ""
        stand = " in the stand, not the air" if said.verdict == "sensor" else ""
        what = _of_class(d) if said.verdict == "class" else f"Cause found{stand}: {_both(d, said.effects, True)}"
        return f"{what}{against}{_in_both(d)}."
    if said.verdict == "insufficient" and (other_rotor.foreign(d.problem) or other_rotor.doubted(d.problem, said)):
        return f"These are not the loads of this case ({_off(d)}): check diameter, blades, units and speed first."
    file, wrong, _ = other_rotor.contradiction(d.problem)
    if file and said.verdict == "insufficient" and not _guess(d):  # a duct or a wall may be why it looks impossible
        return f"{file} cannot be right: {wrong}. Mend that before any cause is looked for."
    what = _from_reference(d) or f"Recording and model differ ({_off(d)})"
    shown = f"but these readings do not show why{_guess(d)}"
    why = "and no effect in the library explains it" if said.verdict == "unknown" else shown
    return f"{what[0].upper()}{what[1:]}, {why}."


def _agreement(d: Diagnosis) -> str:
    """How far recording and model, or reference, agree where there is no cause."""
    if not d.problem.free.all():
        apart = _from_reference(d) or "the recording differs from the reference"
        return f"No cause above {100.0 * LEAST:g} %: {apart}, no more than runs do; from the model fitted to the " \
               f"reference, {_off(d)}."  # fmt: skip
    if max(map(abs, d.problem.level.values()), default=0.0) > LEVEL:
        allowed = "within the uncertainty of calibration, blade and solver; no cause"
        return f"Recording and model differ ({_off(d)}), {allowed}."
    return "Recording and model agree within noise, calibration and the uncertainty of the model."


def _of_class(d: Diagnosis) -> str:
    said = d.said
    titles = [_title(d, i) for i in said.effects]
    if said.beside:
        return f"Cause found: {titles[0]}. Possibly also: {' or '.join(titles[1:])}"
    if len(said.sets) > 1:
        each = [" / ".join(_title(d, i) for i in s) for s in said.sets]
        return f"Two causes: {' and '.join(f'one of ({w})' if ' / ' in w else w for w in each)}"
    if len(titles) > _A_GROUP:
        return f"{len(titles)} causes look alike in these readings: {families(said.effects)}"
    first, *others = _ways(d)
    lead = f"{_both(d, first, not first.pair)}, probability {d.found.probability.get(first, 0.0):.2f}"
    if len(others) > 1:  # each with its own probability further down
        return f"The cause is {lead}, or one of {len(others)} others that these readings cannot distinguish from it"
    return f"The cause is {lead}, or {_both(d, others[0])}; these readings cannot distinguish them"


def _ways(d: Diagnosis) -> list[Explanation]:
    """What a class stands for, the likeliest first."""
    P = d.found.probability
    return ways(d.said.effects, sorted(P, key=lambda k: -P[k]))


def _both(d: Diagnosis, what: Iterable[str], sized: bool = False) -> str:
    """Titles of the effects that an explanation has at work together."""
    return " and ".join(_title(d, i, sized) for i in what)


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


def _guess(d: Diagnosis) -> str:
    """Title of the likeliest effect, where it is likely enough to be worth a look."""
    chance = d.found.probability.get(Explanation.of(*d.best.ids), 0.0) if d.best.ids else 0.0
    if chance < max(_GUESS, d.found.probability[UNKNOWN], d.found.probability[NONE]):
        return ""
    return f"; {' and '.join(title_of(i) for i in d.best.ids)} is likeliest ({chance:.2f}), too little to be named"


def _ratios(d: Diagnosis) -> list[tuple[str, float]]:
    """Loads of the recording over those of the reference at equal speed, less 1; none where they were not compared."""
    if d.change is None:
        return []
    of = d.change.loads_by_name.values()
    return [(WORD[c.channel] if c.channel == POWER else c.name, d.change.ratios[c.channel].ratio - 1.0) for c in of]


def _from_reference(d: Diagnosis) -> str:
    """What the recording differs from the reference by, in words."""
    words = " and ".join(f"{name} by {share(v)}" for name, v in _ratios(d))
    return f"the recording differs from the reference ({words} at equal speed)" if words else ""


def text(d: Diagnosis, details: bool = False, lead: str = "") -> str:
    """The answer in twelve lines after a ``lead``; with ``details`` all sentences, and the tables behind them."""
    first, *rest = explanation(d)
    last = _not_tried(d)  # it explains little and takes lines
    named = f" {', '.join(d.said.effects)}" if d.said.effects else ""
    out = [*textwrap.wrap(f"{lead} {first}".strip(), 110), f"verdict: {d.said.verdict}{named}"]
    # a command stays in one line, to be copied
    shown = {line: [f"  {line}"] if line.startswith("  ") else _wrapped(line) for line in rest if line not in last}
    if not details:
        shown = _few(shown, _next(d), _LINES - len(out))
    out += [line for wrapped in shown.values() for line in wrapped]
    if details:
        out += [*_tables(d), *(f"  note: {note}" for note in d.problem.notes), *map("\n".join, map(_wrapped, last))]
    return "\n".join(out)


def _wrapped(words: str) -> list[str]:
    return textwrap.wrap(words, 110, initial_indent="  ", subsequent_indent="    ")


def _few(shown: Mapping[str, list[str]], steps: Sequence[str], most: int) -> dict[str, list[str]]:
    """First remark on the files, the next steps, and of the other sentences those that fit into ``most`` lines."""
    warned = [line for line in shown if line.startswith("Before any physics: ")][:1]
    sure = {*warned, *steps}
    left, told = most - sum(len(wrapped) for line, wrapped in shown.items() if line in sure), {}
    for line, wrapped in shown.items():
        if line in sure:
            told[line] = wrapped
        elif not line.startswith(_DETAILS) and len(wrapped) <= left:
            told[line], left = wrapped, left - len(wrapped)
    return told


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
