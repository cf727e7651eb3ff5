"""Score of the proof: what was said beside what was there, in the rows of DIAGNOSIS 5, as table and HTML file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from bemt.base.page import Cell, render, table
from bemt.base.tables import text_table
from bemt.judge.loss import CLAIMS
from bemt.judge.proof.causes import CAUSES
from bemt.judge.proof.rows import Entry, Proof, Reliability, ScoreRow, Stratum, ToldAnswer, ToldLocation

VISIBLE = 5.0
"""Separation in standard deviations from which on a cause counts as visible. [1]"""
_CLEAR = 10.0
_NOTHING = ("none", "unknown")


def wilson(hits: int, n: int, z: float = 1.96) -> tuple[float, float]:
    """Wilson interval of a share. [-]

    Notes
    -----
    E. B. Wilson, J. American Statistical Association 22, 1927, 209.

    Examples
    --------
    >>> [round(v, 3) for v in wilson(9, 10)]
    [0.596, 0.982]
    """
    if n == 0:
        return 0.0, 1.0
    p = hits / n
    middle = p + z * z / (2 * n)
    spread = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max((middle - spread) / (1 + z * z / n), 0.0), min((middle + spread) / (1 + z * z / n), 1.0)


@dataclass(frozen=True)
class Judged:
    """One item with its answer."""

    entry: Entry
    answer: ToldAnswer  # Empty when it failed
    claims: bool  # Whether a cause or a class of causes was claimed
    # Whether the claim holds, or, where nothing is to be claimed, nothing was.  A claim holds when every effect it
    # names is at work and none is missing that the plan can see; of a class, when one of its members is
    right: bool
    # Whether the cause, or one that the plan cannot tell from it, leads the ranking or is among its first three
    top1: bool
    top3: bool

    @property
    def separation(self) -> float:
        """Of the weaker cause, when the other may take what it can. [1]"""
        return float(min(self.entry.seen or [0.0]))

    @property
    def visible(self) -> bool:
        """Whether the plan can see the cause."""
        return bool(self.entry.causes) and self.separation >= VISIBLE

    @property
    def said(self) -> str:
        """The answer in a word."""
        if not self.answer:
            return "failed"
        verdict = self.answer.verdict
        return "+".join(self.answer.effects) if verdict in ("named", "sensor") else verdict


def judge(entry: Entry, answer: ToldAnswer) -> Judged:
    """Judge one answer."""
    if not answer:
        return Judged(entry, answer, False, False, False, False)
    causes, verdict, said = entry.causes, answer.verdict, answer.effects
    claims = verdict in CLAIMS
    if not causes or entry.set == "unlisted":
        return Judged(entry, answer, claims, not claims, False, False)
    allowed, seen = entry.allowed, entry.seen
    if verdict == "class":
        right = any(c in said for c in causes)
    else:
        right = claims and (_matches(said, allowed) or any(
            _matches(said, [allowed[k]]) and max((*seen[:k], *seen[k + 1 :]), default=0.0) < VISIBLE
            for k in range(len(allowed)) if len(allowed) > 1
        ))  # fmt: skip
    names = [r.effect for r in answer.ranking]
    listed = [n for n in names if n not in _NOTHING]
    top1 = (verdict == "class" and right) or bool(listed) and _matches(listed[0].split("+"), allowed)
    top3 = top1 or any(_matches(n.split("+"), allowed) for n in names[:3])
    return Judged(entry, answer, claims, right, top1, top3)


def _matches(said: Sequence[str], allowed: Sequence[set[str]]) -> bool:
    """Whether every cause is met by one word that the plan cannot tell from it, and no word is left over."""
    if len(said) != len(allowed):
        return False
    return any(all(s in a for s, a in zip(order, allowed, strict=True)) for order in permutations(said))


def in_sets(j: Judged) -> bool:
    """Whether there is one set for each cause, with the cause in it or one that the plan cannot tell from it."""
    if j.right and j.answer.verdict != "class":
        return True
    sets, allowed = [set(s) for s in j.answer.sets], j.entry.allowed
    if len(sets) != len(allowed):
        return False
    return any(all(s & a for s, a in zip(order, allowed, strict=True)) for order in permutations(sets))


def _share(what: str, flags: Iterable[bool], target: str, limit: float, low_is_good: bool = False) -> ScoreRow:
    values = list(flags)
    hits, n = sum(values), len(values)
    value = hits / n if n else math.nan
    met = None if not (n and target) else (value <= limit if low_is_good else value >= limit)
    return ScoreRow(what, hits, n, value, *wilson(hits, n), target, met)


def _median(what: str, values: Sequence[float], target: str, limit: float) -> ScoreRow:
    good = [v for v in values if math.isfinite(v)]
    value = float(np.median(good)) if good else math.nan
    return ScoreRow(what, len(good), len(good), value, math.nan, math.nan, target, value <= limit if good else None)


def _blamed(j: Judged) -> bool:
    """Whether a fault of the stand was put down to the air."""
    said = set(j.answer.effects)
    return j.claims and not said & set(j.entry.causes) and any(i not in CAUSES or CAUSES[i].kind == "air" for i in said)


def _beside(j: Judged) -> bool:
    """Whether a claim holds no cause that is at work, and none that the plan cannot tell from one."""
    there = {*j.entry.causes, *(i for alike in j.entry.alike for i in alike)}
    return not there & set(j.answer.effects)


def _parameters(j: Judged) -> list[tuple[float, bool]]:
    """Relative error of each parameter that both sides name, and whether its interval holds the truth."""
    out = []
    ranking = {r.effect: r.parameters for r in j.answer.ranking}
    name = next((n for n in ranking if set(n.split("+")) == set(j.entry.causes)), None)
    if name is None or not j.right or j.answer.verdict not in ("named", "sensor"):
        return []
    for cause, wanted in j.entry.parameters.items():
        for parameter, true in wanted.items():
            got = ranking[name].get(parameter) or ranking[name].get(f"{cause}.{parameter}")
            if got and isinstance(got.value, (int, float)) and true.value:
                size = abs(float(got.value) - true.value) / abs(true.value)
                low, high = got.low, got.high
                # ratios of units are exact in the library and rounded in the key
                near = low == high and math.isclose(low, true.value, rel_tol=1e-3)
                out.append((size, low <= true.value <= high or near))
    return out


def _held_out(j: Judged) -> tuple[float, float]:
    """Held-out error after over before, and after over noise, all channels together."""
    before = after = 0.0
    count = 0
    for fit in j.answer.fit.values():
        first, last = (v / fit.noise if fit.noise else math.nan for v in (fit.holdout_before, fit.holdout_after))
        if math.isfinite(first) and math.isfinite(last):
            before, after, count = before + first**2, after + last**2, count + 1
    return (math.sqrt(after / before), math.sqrt(after / count)) if count and before else (math.nan, math.nan)


def _located(j: Judged) -> bool:
    where = j.answer.location or ToldLocation()
    # what rises and falls together in this plan is one variable to it
    words = [v.lower() for v in (where.variable, *where.ties)]
    families = j.entry.variables[0]
    return any(w == f or w.startswith(f"{f}_") or (len(f) > 2 and f in w) for w in words for f in families)


def score(judged: Sequence[Judged], settled: Sequence[bool] = (), again: Sequence[Judged] = ()) -> list[ScoreRow]:
    """The table of DIAGNOSIS 5; ``again`` are items that asked for a reference, with the answer that it led to."""
    p = _Pool(judged)
    return [*_claimed(p), *_of_sets(p), *_numbers(p, settled), *_with_reference([j for j in again if j.answer]),
            _share("failed", (not j.answer for j in (*judged, *again)), "0", 0.0, True)]  # fmt: skip


@dataclass(frozen=True)
class _Pool:
    """Items by what is asked of them."""

    judged: Sequence[Judged]

    def of(self, *sets: str, seen: bool = False) -> list[Judged]:
        """Items of these sets; ``seen``: that the plan can see."""
        return [j for j in self.judged if j.entry.set in sets and (j.visible or not seen)]

    def told(self, *sets: str) -> list[Judged]:
        """Items with an answer: who does not answer has not refrained from a wrong claim."""
        return [j for j in self.of(*sets) if j.answer]

    @property
    def visible(self) -> list[Judged]:
        """Single causes that the plan can see."""
        return self.of("single", "sensor", seen=True)

    @property
    def pairs(self) -> list[Judged]:
        """Pairs in plans over speed and advance ratio."""
        return [j for j in self.of("pair", seen=True) if j.entry.plan.startswith(("grid", "two_air"))]


def _claimed(p: _Pool) -> list[ScoreRow]:
    """Rows of what was claimed, and of what was not to be."""
    visible = p.visible
    hidden = [j for j in p.told("single", "sensor", "underpowered") if not j.visible]
    with_cause = [j for j in p.of("single", "sensor", "pair", "underpowered") if j.claims]
    return [
        _share("claims on nulls, noise", (j.claims for j in p.told("null")), "<= 2 %", 0.02, True),
        _share("claims on nulls, solver mismatch only", (j.claims for j in p.told("mismatch")), "<= 2 %", 0.02, True),
        _share("top 1, visible", (j.top1 for j in visible), ">= 90 %", 0.90),
        _share("top 3, visible", (j.top3 for j in visible), ">= 98 %", 0.98),
        _share("right when it claims", (j.right for j in with_cause), ">= 98 %", 0.98),
        _share("claims that name only what is not at work", map(_beside, with_cause), "<= 3 %", 0.03, True),
        _share("claims on visible", (j.claims for j in visible), ">= 75 %", 0.75),
        *(_share(f"claims on visible, {word} a reference",
                 [j.claims for j in visible if bool(j.entry.referenced) is told], "", 0.0)
          for word, told in (("with", True), ("without", False))),
        _share("wrong claims on what the plan cannot see", (j.claims and not j.right for j in hidden), "<= 2 %", 0.02,
               True),
    ]  # fmt: skip


def _of_sets(p: _Pool) -> list[ScoreRow]:
    """Rows of pairs, of what is not listed, of the stand."""
    pairs, unlisted = p.pairs, p.told("unlisted")
    clear = [j for j in unlisted if j.separation >= _CLEAR]
    return [
        _share("pairs named exactly, rpm x J", (j.right and j.answer.verdict != "class" for j in pairs), ">= 75 %",
               0.75),
        _share("pairs named, or one of each in its set, rpm x J", map(in_sets, pairs), ">= 75 %", 0.75),
        _share("unlisted given a listed name", (j.claims for j in unlisted), "<= 5 %", 0.05, True),
        _share("unlisted at 10 sigma called unknown", (j.answer.verdict == "unknown" for j in clear), ">= 80 %",
               0.80),
        _share("sensor faults blamed on the air", map(_blamed, p.told("sensor")), "<= 2 %", 0.02, True),
    ]  # fmt: skip


def _numbers(p: _Pool, settled: Sequence[bool]) -> list[ScoreRow]:
    """Rows of sizes, predictions, places and next steps."""
    seen = [j for j in p.visible + p.pairs if j.answer]
    sizes, held = [one for j in seen for one in _parameters(j)], [_held_out(j) for j in seen]
    where = [j for j in p.visible if j.answer and j.entry.variables[0]]
    return [
        _median("parameter error, median", [s for s, _ in sizes], "<= 15 %", 0.15),
        _share("90 % interval holds the truth", (inside for _, inside in sizes), "85 to 95 %", 0.85),
        _median("held-out RMSE after / before, median", [a for a, _ in held], "<= 0.5", 0.5),
        _median("held-out RMSE after / noise, median", [b for _, b in held], "<= 1.2", 1.2),
        _share("right variable in the location", map(_located, where), ">= 90 %", 0.90),
        _share("recommended run settles the tie", settled, ">= 70 %", 0.70),
    ]  # fmt: skip


def _with_reference(again: Sequence[Judged]) -> list[ScoreRow]:
    """What a reference made of the items that asked for one."""
    causes = [j for j in again if j.entry.set in ("single", "sensor", "pair") and j.visible]
    claims = [j for j in again if j.claims and j.entry.set in ("single", "sensor", "pair", "underpowered")]
    nothing = [j for j in again if j.entry.set in ("null", "mismatch")]
    return [
        _share("left open though visible: right or in a class with a reference", (j.right for j in causes), ">= 50 %",
               0.5),
        _share("right when it claims, with a reference", (j.right for j in claims), ">= 97 %", 0.97),
        _share("claims on nulls, with a reference", (j.claims for j in nothing), "<= 2 %", 0.02, True),
        _share("unlisted given a listed name, with a reference",
               (j.claims for j in again if j.entry.set == "unlisted"), "<= 5 %", 0.05, True),
    ]  # fmt: skip


def score_real(judged: Sequence[Judged]) -> list[ScoreRow]:
    """Score of published recordings: by set, what was found and what was claimed wrongly."""
    out = []
    for kind in sorted({j.entry.set for j in judged}):
        some = [j for j in judged if j.entry.set == kind and j.answer]
        wrong = (j.claims and not j.right for j in some)
        if some and some[0].entry.causes:
            out.append(_share(f"{kind}: found", (j.claims and j.right for j in some), ">= 80 %", 0.80))
        out.append(_share(f"{kind}: wrong claims", wrong, "<= 2 %", 0.02, True))
    return [*out, _share("failed", (not j.answer for j in judged), "0", 0.0, True)]


def answers(judged: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """How often each set was answered how."""
    return _counted((j.entry.set, answered(j)) for j in judged)


def _counted(found: Iterable[tuple[str, str]]) -> dict[str, dict[str, int]]:
    out: dict[str, dict[str, int]] = {}
    for there, said in found:
        row = out.setdefault(there, {})
        row[said] = row.get(said, 0) + 1
    return dict(sorted(out.items()))


def answered(j: Judged) -> str:
    """Answer to one item in a word of :func:`answers`."""
    if not j.answer:
        return "failed"
    if not j.claims:
        return j.answer.verdict
    if not j.right:
        return "wrong"
    return "class" if j.answer.verdict == "class" else "found"


def baselines(judged: Sequence[Judged]) -> list[ScoreRow]:
    """What simpler rules would have said of the same data."""
    visible = [j for j in judged if j.entry.set in ("single", "sensor") and j.visible and j.answer]
    nothing = [j for j in judged if j.entry.set in ("null", "mismatch", "unlisted") and j.answer]

    def best(j: Judged) -> tuple[str, float]:
        odds = {k: v for k, v in (j.answer.log_bayes or {}).items() if k not in _NOTHING and "+" not in k}
        name = max(odds, key=lambda k: odds[k], default="")
        return name, float(odds.get(name, 0.0))

    def smooth(j: Judged) -> float:
        ratios = [f.gp_only / f.noise if f.noise else math.nan for f in j.answer.fit.values()]
        good = [r**2 for r in ratios if math.isfinite(r)]
        return math.sqrt(sum(good) / len(good)) if good else math.nan

    return [
        _share("best single: top 1, visible",
               (best(j)[0] in {*j.entry.causes, *j.entry.alike[0]} for j in visible), "", 0.0),
        _share("best single: claims where nothing listed is", (best(j)[1] > 0.0 for j in nothing), "", 1.0, True),
        _share("nearest signature: top 1, visible",
               (j.answer.nearest_signature in {*j.entry.causes, *j.entry.alike[0]} for j in visible), "",
               0.0),
        _median("smooth curve only: held-out RMSE / noise", [smooth(j) for j in visible], "", math.inf),
    ]  # fmt: skip


def reliability(
    judged: Sequence[Judged], edges: Sequence[float] = (0.0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98, 1.0)
) -> list[Reliability]:  # fmt: skip
    """How often an effect was there, by the probability that was printed of it, with a reference and without.

    Calibration of probabilities by what happened: DeGroot and Fienberg 1983, The Statistician 32:12 (not checked).
    """
    out = []
    for referenced in (True, False):
        told = [(p, i in j.entry.causes) for j in judged if bool(j.entry.referenced) is referenced
                for i, p in j.answer.inclusion.items()]  # fmt: skip
        for low, high in zip(edges[:-1], edges[1:], strict=True):
            some = [(p, there) for p, there in told if low <= p < high or p == high == edges[-1]]
            if some:
                stated = float(np.mean([p for p, _ in some]))
                out.append(Reliability(referenced, low, high, len(some), stated, sum(there for _, there in some)))
    return out


def strata(judged: Sequence[Judged], edges: Sequence[float] = (0.0, 3.0, 5.0, 10.0, 20.0, math.inf)) -> list[Stratum]:
    """Single causes by separation."""
    single = [j for j in judged if j.entry.set in ("single", "sensor", "underpowered")]
    out = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        some = [j for j in single if low <= j.separation < high]
        top1, claims = sum(j.top1 for j in some), sum(j.claims for j in some)
        out.append(Stratum(low, high, len(some), top1, claims, sum(j.claims and j.right for j in some)))
    return out


def confusion(judged: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """How often what was there was called what."""
    return _counted(("+".join(j.entry.causes) or j.entry.set, j.said) for j in judged)


def _percent(value: float) -> str:
    return f"{100 * value:.1f} %" if math.isfinite(value) else "-"


def _rows(rows: Sequence[ScoreRow]) -> list[list[str]]:
    out = []
    for r in rows:
        share, value = math.isfinite(r.low), r.value
        words = f"{value:.3g}" if math.isfinite(value) else "-"
        interval = f"{_percent(r.low)} to {_percent(r.high)}" if share and r.n else ""
        count = f"{r.hits}/{r.n}" if share else str(r.n)
        state = {True: "yes", False: "NO", None: "no data"}[r.met] if r.target else ""
        out.append([r.what, count, _percent(value) if share else words, interval, r.target, state])
    return out


MET = {"yes": "fine", "NO": "fault", "no data": "unknown"}
_HEADER = ["metric", "count", "value", "95 % (Wilson)", "target", "met"]


def _tables(found: Proof) -> list[tuple[str, list[str], list[list[str]]]]:
    strata = [[f"{s.low:g} to {s.high:g}" if math.isfinite(s.high) else f"above {s.low:g}", str(s.n),
               str(s.top1), str(s.claims), str(s.right)] for s in found.strata]  # fmt: skip
    reliable = [["with" if r.reference else "without", f"{r.low:g} to {r.high:g}", str(r.n), f"{r.stated:.3f}",
                 f"{r.there / r.n:.3f}", " to ".join(f"{v:.2f}" for v in wilson(r.there, r.n))]
                for r in found.reliability]  # fmt: skip
    confusion = [[there, ", ".join(f"{said} {n}" for said, n in sorted(row.items(), key=lambda kv: -kv[1]))]
                 for there, row in found.confusion.items()]  # fmt: skip
    kinds = ("found", "class", "none", "unknown", "insufficient", "wrong", "failed")
    answers = [[kind, *(str(row.get(k, 0)) for k in kinds)] for kind, row in found.answers.items()]
    misses = [
        [m.folder, m.set, "+".join(m.causes) or "-", m.plan, f"{m.separation:.1f}",
         "class: " + ", ".join(m.effects) if m.verdict == "class" else m.said]
        for m in found.misses
    ]  # fmt: skip
    tables = [
        ("Score", _HEADER, _rows(found.score)),
        ("Answers by set", ["set", *kinds], answers),
        ("Simpler rules on the same data", _HEADER, _rows(found.baselines)),
        ("Single causes by separation", ["sigma", "items", "top 1", "claims", "right claims"], strata),
        (
            "Printed probability of an effect, and how often it was there",
            ["reference", "printed", "effects", "mean", "there", "95 % (Wilson)"],
            reliable,
        ),
        ("What was there, and what was said", ["there", "said"], confusion),
        ("Misses", ["item", "set", "there", "plan", "sigma", "said"], misses),
    ]
    return [t for t in tables if t[2] or t[0] == "Misses"]


def text(found: Proof) -> str:
    """Give the tables for a terminal."""
    parts = [f"{found.items} concealed items ({found.size}), seed {found.seed}, "
             f"commit {found.commit or 'unknown'}\nkey SHA-256 {found.key_sha256}"]  # fmt: skip
    for title, header, rows in _tables(found):
        left = (0, 1, 2, 3, 5) if title == "Misses" else (0, 1) if "said" in header else (0,)
        parts.append(f"{title}\n" + text_table(header, rows, left=left, indent="  ") if rows else f"{title}: none")
    return "\n\n".join(parts)


def html(found: Proof) -> str:
    """Give one HTML file with the same tables."""
    tables = [(title, table(header, [[Cell(c, badge=MET[c]) if c in MET else c for c in row] for row in rows]))
              for title, header, rows in _tables(found)]  # fmt: skip
    lead = f"{found.items} items ({found.size}), seed {found.seed}, commit {found.commit or 'unknown'}."
    title = "Proof on concealed causes"
    return render("bemt.judge.proof", "proof.html", ["page.js"], title=title, lead=lead, key=found.key_sha256,
                  tables=tables)  # fmt: skip
