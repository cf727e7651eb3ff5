"""Before the measurement: which effects a test plan can see, and which it cannot distinguish."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bemt.base.action import Answered
from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.gaussian.evidence import log_sum
from bemt.base.gaussian.whitening import whitener
from bemt.base.tables import text_table
from bemt.data.recordings.channels import named
from bemt.judge.diagnose import form, knowledge, noise, posterior, problem, signatures
from bemt.judge.diagnose import suggest as suggestion
from bemt.judge.diagnose.assemble import assemble, build
from bemt.judge.diagnose.record import Record, from_series
from bemt.judge.explanation import NONE, Explanation
from bemt.judge.loss import COSTS
from bemt.physics import effects
from bemt.physics.dataset import Dataset, from_pandas
from bemt.physics.dataset.channels import channel_fault
from bemt.rotors.case import Case

SCHEMA = "bemt.plan/1"

# What a plan may count on: noise as stated, and a solver error that earlier comparisons suggest; and the best that it
# may meet, the solver being as good as any rotor has shown it.
_HYPER = (1.0, 0.0, 0.01, 1.0)
_BEST = (1.0, 0.0, 0.003, 1.0)
_ONE_IN_20 = 1.645
DETECTABLE = {"visible": "yes", "marginal": "maybe", "invisible": "no"}
"""Words for people."""


@dataclass(frozen=True, eq=False)
class Plan(Answered):
    """What a plan can do."""

    confusion: form.Confusion  # Distances
    # (N,) What the readings will say for each effect against nothing, usually and if the solver is at its best, as
    # standard deviations: the square root of twice the expected log odds [1]
    size: Array
    best: Array
    bar: Array  # (N,) Log odds from which a diagnosis names each effect [1]
    absent: dict[str, str]  # Effects that cannot show, and why
    added: suggestion.Suggestion | None  # A run that separates the largest pair of look-alikes
    points: int  # Points of the plan [1]
    notes: tuple[str, ...] = ()  # What the file left open, and what was assumed for it

    @property
    def sight(self) -> dict[str, str]:
        """Each effect at its ordinary strength: visible, marginal or invisible.

        Log odds scatter by their size from one recording to the next. Visible: named in 19 of 20 recordings;
        invisible: in less than one of 20, even if the solver is at its best.
        """
        words = {}
        for i, s, most, bar in zip(self.confusion.ids, self.size, self.best, self.bar, strict=True):
            seen, hidden = 0.5 * s**2 - _ONE_IN_20 * s >= bar, 0.5 * most**2 + _ONE_IN_20 * most < bar
            words[i] = "visible" if seen else "invisible" if hidden else "marginal"
        return words | dict.fromkeys(self.absent, "invisible")

    @property
    def detectable(self) -> dict[str, str]:
        """Each effect: yes, maybe or no at its ordinary strength."""
        return {effect: DETECTABLE[word] for effect, word in self.sight.items()}

    @property
    def text(self) -> str:
        """Tables for a terminal."""
        return self._told(False)

    @property
    def details(self) -> str:
        """The same, with every effect that these points do not show, and why."""
        return self._told(True)

    def _told(self, every: bool) -> str:
        c = self.confusion
        rows, unseen = [], [i for i in c.ids if self.detectable[i] == "no" and not every]
        for a in np.argsort(-self.size):
            if c.ids[a] in unseen:
                continue
            near = [(c.distance[a, b], c.ids[b]) for b in range(len(c.ids)) if b != a and c.size[b] >= form.ALIKE]
            nearest = min(near, default=(float("nan"), "-"))
            rows.append([c.ids[a], effects.catalogue()[c.ids[a]].title, f"{self.size[a]:.1f}",
                         self.detectable[c.ids[a]],
                         f"{nearest[1]} ({nearest[0]:.1f})" if near else "-"])  # fmt: skip
        header = ["effect", "", "size", "detectable", "nearest look-alike"]
        out = [f"plan of {self.points} points: size of each effect at typical strength, in standard deviations",
               text_table(header, rows, left=(0, 1, 3, 4), indent="  ")]  # fmt: skip
        for group in c.classes():
            out.append(f"  cannot be distinguished: {', '.join(group)}")
        if self.added is not None:
            tells = f" ({self.added.tells})" if self.added.tells else ""
            out.append(f"  to add: {self.added.text}{tells}")
        if every:
            out += [f"  not visible: {i}: {why}" for i, why in self.absent.items()]
        elif unseen or self.absent:
            gone = f"{len(unseen)} too small for these points" if unseen else ""
            cannot = f"{len(self.absent)} that they cannot hold" if self.absent else ""
            out.append(f"  not visible: {' and '.join(filter(None, (gone, cannot)))}; --details lists them")
        return "\n".join([*out, *(f"  note: {note}" for note in self.notes)])

    def _document(self) -> Mapping[str, object]:
        return document(self)


def given(points: Any, case: Case) -> Record:
    """Points of a plan (path, Dataset, DataFrame or columns): a recording whose loads are not there yet."""
    from bemt.data.recordings.load import import_file

    imported = import_file(os.fspath(points)) if isinstance(points, (str, os.PathLike)) else points
    if not isinstance(imported, Dataset):
        import pandas as pd

        if not isinstance(points, (Mapping, pd.DataFrame)):
            expected = "a path, a Dataset, a DataFrame or columns by name"
            raise InputError(Fault("", "points", f"{type(points).__name__} {points!r:.40}", expected))
        imported = from_pandas(pd.DataFrame(points), name="points")
    rows = named(imported)
    values = {k: v for k, v in imported.values.items() if imported.unit(k) or k in ("rpm", "J", "run")}
    values |= dict(rows.values)
    values = {k: v for k, v in values.items() if channel_fault(k) is None}  # rpm stands for the speed of each sensor
    if "rpm" not in values:
        raise InputError(Fault(imported.name, "", f"columns {', '.join(imported.values)}", "a column rpm"))
    n = len(imported)
    loads = {k: values.get(k, np.ones(n)) for k in ("thrust_N", "torque_Nm")}
    lawful = {k: v for k, v in values.items() if not k.startswith("u_")}
    u = {k[2:]: np.abs(v) for k, v in values.items() if k.startswith("u_") and k[2:] in loads}
    made = from_series(Dataset("bench", imported.name, lawful | loads, u), case)
    return replace(made, notes=(*made.notes, *imported.notes, *rows.notes))


@posterior.one_thread()
def plan(record: Record, case: Case, progress: Callable[[str], None] | None = None) -> Plan:
    """Say what a plan can see."""
    first = build([record], [case])
    flow = first.parts[0].flow
    own = {"thrust_N": flow.T0, "torque_Nm": flow.Q0, "rpm": record.rpm}
    measured = {k: own[k] for k in record.measured if k in own}
    whole = assemble((replace(first.parts[0], record=replace(record, measured=measured), _solved={}),))
    candidates, absent = signatures.candidates(
        whole, None, (lambda n: progress(f"solving with {n}")) if progress else None
    )
    found = posterior.bare(whole, candidates, noise.Hyper(*_HYPER, 1.0))
    alike = form.confusion(found)
    size, best = _sizes(whole, candidates, [noise.Hyper(*h, 1.0) for h in (_HYPER, _BEST)])
    added = None
    groups = sorted(alike.classes(), key=len, reverse=True)
    if groups:
        a, b = groups[0][:2]
        settings = {c.id: c.settings[c.middle] for c in candidates}
        added = suggestion.suggest(found, [suggestion.Rival(i, settings[i], 0.5) for i in (a, b)])
    before = knowledge.log_priors(knowledge.prior_weights(whole, alike.ids), pairs=False)
    odds = float(np.log(COSTS.wrong / COSTS.silent))  # from which a name is the answer of least loss
    bar = np.array([odds + before[NONE] - before[Explanation.of(i)] for i in alike.ids])
    return Plan(alike, size, best, bar, absent, added, len(record), record.notes)


def _sizes(
    whole: problem.Problem, candidates: Sequence[signatures.Candidate], truths: Sequence[noise.Hyper]
) -> list[Array]:
    """Root of twice the expected log odds of each candidate over nothing, for each covariance that may be the true one.

    "Nothing" may choose another covariance, which costs what it makes of everything else (Kullback and Leibler 1951):
    correlated noise or a bad solver is a rival of every effect. An effect pays for settings that it might have had.
    """
    shown = np.zeros((whole.y.size, len(candidates)))
    for k, c in enumerate(candidates):
        shown[:, k] = c.signatures[:, c.middle]
    own = [whitener(noise.covariance(whole, h), whole.u) for h in truths]
    least = np.full((len(truths), len(candidates)), np.inf)
    for _, C in noise.covariances(whole):
        white = whitener(C, whole.u)
        gain = 0.5 * np.sum(white(shown) ** 2, axis=0)
        for k, true in enumerate(own):
            price = 0.5 * (float(np.sum(white(true.factor) ** 2)) - whole.y.size) + white.log_det - true.log_det
            least[k] = np.minimum(least[k], gain + price)
    for k, true in enumerate(own):
        for i, c in enumerate(candidates):
            apart = true(c.signatures - shown[:, i, None])
            least[k, i] += log_sum(-0.5 * np.sum(apart**2, axis=0), np.log(c.weight))
    return [np.asarray(row) for row in np.sqrt(2.0 * np.maximum(least, 0.0))]


def document(answer: Plan) -> Mapping[str, object]:
    """Give the document ``bemt.plan/1``."""
    c = answer.confusion
    return {
        "schema": SCHEMA, "points": answer.points, "sight": answer.sight,
        "size": {i: float(s) for i, s in zip(c.ids, answer.size, strict=True)},
        "size_at_best": {i: float(s) for i, s in zip(c.ids, answer.best, strict=True)},
        "classes": c.classes(),
        "distance": {i: {j: float(c.distance[a, b]) for b, j in enumerate(c.ids)} for a, i in enumerate(c.ids)},
        "not_tried": answer.absent,
        "next_measurement": None if answer.added is None else answer.added.document(),
        "notes": list(answer.notes),
    }  # fmt: skip
