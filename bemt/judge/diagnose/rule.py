"""A rule of a verdict, and how a list of rules decides."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from bemt.judge.diagnose.verdict import Decision


@dataclass(frozen=True)
class Rule:
    """One row of the list."""

    name: str  # What it asks
    ask: Callable[[Any], Decision | None]  # Its answer; None where it does not apply. Its docstring is its source
    threshold: str = ""  # Names of the numbers it asks with
    revises: bool = False  # Whether it sees the answer of the rows before it, and only then is asked

    @property
    def source(self) -> str:
        """Where it comes from."""
        return str(self.ask.__doc__)


def appended(
    rules: list[Rule], revises: bool = False
) -> Callable[..., Callable[[Callable[[Any], Decision | None]], Any]]:
    """Give the decorator that appends a function to a list, by name and the names of the numbers it asks with."""

    def rule(name: str, threshold: str = "") -> Callable[[Callable[[Any], Decision | None]], Any]:
        def append(ask: Callable[[Any], Decision | None]) -> Any:
            rules.append(Rule(name, ask, threshold, revises))
            return ask

        return append

    return rule


def decide(query: Any, rules: Sequence[Rule]) -> Decision:
    """Go through a list, of this judge or of one that asks of other readings; `query` has `said` and `steps`."""
    for rule in rules:
        if rule.revises == (query.said is not None) and (answer := rule.ask(query)) is not None:
            query.steps.append(replace(answer, rule=rule.name))
    said: Decision | None = query.said
    assert said is not None, "the last rule that does not revise always holds"
    return said
