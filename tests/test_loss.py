"""The decision: what is said has the least expected loss."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from bemt.judge import loss
from bemt.judge.explanation import DOUBT, NONE, UNKNOWN, Explanation

GAIN, ZERO, DUCT = (Explanation.of(i) for i in ("thrust_gain", "thrust_zero", "duct"))
BOTH = Explanation.of("thrust_gain", "thrust_zero")


def test_there_are_ten_costs_at_most_and_each_says_what_it_is() -> None:
    source = inspect.getsource(loss.Costs)
    assert len(fields(loss.Costs)) <= 10
    assert all(f"{f.name}: float = " in source and "#" in source.split(f"{f.name}: ")[1].split("\n")[0]
               for f in fields(loss.Costs))  # fmt: skip


@pytest.mark.parametrize("what", [GAIN, DUCT, BOTH, NONE, UNKNOWN])
def test_what_is_certain_is_said(what: Explanation) -> None:
    said = loss.decide({what: 1.0})
    assert said.effects == tuple(what) and said.probability == 1.0
    word = "none" if what == NONE else "unknown" if what == UNKNOWN else "named" if "duct" in what else "sensor"
    assert said.verdict == word


def test_files_that_are_not_right_give_no_answer() -> None:
    assert loss.decide({DOUBT: 0.9, GAIN: 0.1}).verdict == "insufficient"


@pytest.mark.parametrize("seed", range(20))
def test_no_other_answer_has_a_smaller_loss(seed: int) -> None:
    """Against every name, every class of two or three, and every answer without a cause."""
    rng = np.random.default_rng(seed)
    what = [NONE, UNKNOWN, GAIN, ZERO, DUCT, BOTH]
    P = dict(zip(what, rng.dirichlet(np.full(6, 0.4)).tolist(), strict=True))
    said, c = loss.decide(P), loss.COSTS
    cause = sum(p for k, p in P.items() if k.ids)
    others = {
        "none": c.missed * (1.0 - P[NONE]), "unknown": c.phantom * P[NONE] + c.missed * cause,
        "insufficient": c.silent * (1.0 - P[NONE]) + c.timid * P[NONE],
        **{f"name {k}": loss.expected(k.ids, True, P) for k in (GAIN, ZERO, DUCT, BOTH)},
    }  # fmt: skip
    assert min(said.loss.values()) <= min(others.values()) + 1e-12
    assert said.loss[{"sensor": "named"}.get(said.verdict, said.verdict)] == min(said.loss.values())


def test_a_dearer_claim_is_made_less_often() -> None:
    P = {GAIN: 0.9, NONE: 0.1}
    assert loss.decide(P).verdict == "sensor"
    assert loss.decide(P, replace(loss.COSTS, wrong=30.0)).verdict == "insufficient"


def test_a_class_with_one_effect_in_all_of_it_has_a_set_for_each_cause() -> None:
    pair = Explanation.of("thrust_gain", "duct")
    said = loss.decide({BOTH: 0.5, pair: 0.48, NONE: 0.02})
    assert said.verdict == "class" and said.sets == (("thrust_gain",), ("thrust_zero", "duct")) and not said.beside


def test_the_page_states_the_costs(project: Path) -> None:
    text = (project / "docs" / "diagnosis.md").read_text(encoding="utf-8")
    for f in fields(loss.Costs):
        found = re.search(rf"^\| `{f.name}` \| ([\d./]+) \|", text, flags=re.M)
        assert found is not None and Fraction(found[1]) == Fraction(f.default).limit_denominator(100)


def test_what_moves_the_readings_without_a_fault_is_no_cause() -> None:
    """It is never a name; beside a fault it may stand in a class, and alone nothing is wrong."""
    day, blade, still = Explanation.of("another day"), Explanation.of("blade"), frozenset({"another day"})
    assert loss.decide({day: 0.9, blade: 0.1}, still=still).verdict == "none"
    assert loss.decide({day: 0.5, blade: 0.5}, still=still).verdict == "insufficient"
    both = loss.decide({day: 0.15, blade: 0.85}, still=still)
    assert both.verdict == "class" and set(both.effects) == {"another day", "blade"}
    assert loss.decide({day: 0.01, blade: 0.99}, still=still).effects == ("blade",)
