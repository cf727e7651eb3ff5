"""How a flight is judged: numbers, a decision, and a list of rules of which the first that holds answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bemt.judge.explanation import Explanation

BESIDE_IT = "one is sure, another may be there"
"""Rule after which the second cause may as well be absent."""
GATE = 0.01
"""Largest p-value at which a mismatch counts as one [1]."""
SURE, NAMED = 0.85, 0.95
"""Probability from which a class is an answer, and a single name [1]."""
LEFT_OVER, SMALL = 4.0, 0.1
"""Log odds of a rest from which the cause is unknown; a rest that is a detail, share of what is explained [1]."""
EARNED = 8.0
"""Log odds that each effect of a pair must add to the other alone [1]."""
LIKE, MOST = 0.1, 3
"""Share of the likeliest second cause that others mentioned with it have; most members of an open answer [1]."""
RARE, NEAR = 0.02, 5.0
"""Members of a class are at least this share as likely as the likeliest, and at most so far behind, log odds [1]."""
IN_SET, LARGEST = 0.95, 6
"""Share of the probability of two causes that their sets hold; most effects of both together [1]."""


@dataclass(frozen=True)
class FlightDecision:
    """What is said, and why."""

    verdict: str  # none, named, class, unknown or insufficient
    effects: tuple[str, ...]  # Causes of the verdict; of a class all members
    leading: Explanation  # What is shown
    probability: float  # Of the verdict [1]
    left_over: float  # Logarithm of the odds of a rest beside the leading explanation [1]
    why: str  # Reason, in words
    rule: str = ""  # Name of the rule that decided
    sets: tuple[tuple[str, ...], ...] = ()  # One set of effects per cause: one of each is at work


@dataclass(frozen=True)
class Rule:
    """One row of the list."""

    name: str  # What it asks
    ask: Callable[[Any], FlightDecision | None]  # Its answer; None where it does not apply. Its docstring is its source
    threshold: str = ""  # Names of the numbers it asks with
    revises: bool = False  # Whether it sees the answer of the rows before it, and only then is asked

    @property
    def source(self) -> str:
        """Where it comes from."""
        return str(self.ask.__doc__)


def decide(query: Any, rules: Sequence[Rule]) -> FlightDecision:
    """Go through a list, of this judge or of one that asks of other readings; `query` has `said` and `steps`."""
    for rule in rules:
        if rule.revises == (query.said is not None) and (answer := rule.ask(query)) is not None:
            query.steps.append(replace(answer, rule=rule.name))
    said: FlightDecision | None = query.said
    assert said is not None, "the last rule that does not revise always holds"
    return said


def credible_sets(
    probability: Mapping[Explanation, float], pair: Explanation, sure: str = ""
) -> tuple[tuple[str, ...], ...]:
    """One set of effects per cause of a pair, likeliest first: with one effect of each set nearly all pairs are there.

    Credible sets of causes as Wang, Sarkar, Carbonetto and Stephens (2020, J. R. Statist. Soc. B 82:1273) have them,
    of the pairs together: from the leading pair the sets grow by what adds most per member, on one side or on both.
    The set of an effect that is sure does not.
    """
    pairs = {k: v for k, v in probability.items() if k.pair and (not sure or sure in k.ids)}
    ids = sorted({i for k in pairs for i in k})
    P = np.zeros((len(ids), len(ids)))
    for k, v in pairs.items():
        i, j = (ids.index(name) for name in k)
        P[i, j] = P[j, i] = v
    A, B = ([ids.index(i)] for i in pair)
    if sure:
        A, B = sorted((A, B), key=lambda side: ids[side[0]] != sure)
    while P[np.ix_(A, B)].sum() < IN_SET * sum(pairs.values()) and len(A) + len(B) < LARGEST:
        free = np.ones(len(ids), dtype=bool)
        free[[*A, *B]] = False
        to_a, to_b = (np.where(free, P[:, side].sum(axis=1), 0.0) for side in (B, A))
        i, j = int(np.argmax(to_a)), int(np.argmax(to_b))
        steps = [(to_b[j], [], [j])] if sure else [(to_b[j], [], [j]), (to_a[i], [i], [])]
        if not sure and len(A) + len(B) + 2 <= LARGEST:
            both = np.where(np.outer(free, free), 0.5 * (to_a[:, None] + to_b[None, :] + P), 0.0)
            at = np.unravel_index(int(np.argmax(both)), both.shape)
            steps.append((both[at], [int(at[0])], [int(at[1])]))
        gain, a, b = max(steps, key=lambda step: step[0])
        if gain < RARE * probability[pair]:
            break
        A, B = A + a, B + b
    return tuple(ids[i] for i in A), tuple(ids[i] for i in B)
