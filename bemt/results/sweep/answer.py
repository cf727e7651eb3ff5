"""A sweep as both doors show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from bemt.base.errors import EXIT_UNCONVERGED
from bemt.results.sweep import batch
from bemt.results.sweep.rows import Sweep
from bemt.results.sweep.summary import summary
from bemt.results.sweep.text import case_text, overview_text
from bemt.rotors.case import find_cases


@dataclass(frozen=True, eq=False)
class SweepAnswer:
    """Cases that were solved and compared, returned by :func:`bemt.sweep`."""

    found: Sweep
    paths: tuple[str, ...]
    reasons: tuple[str, ...] = ()  # points beyond the tolerance of a strict sweep

    @property
    def exit_code(self) -> int:
        """Worst of all cases."""
        return max(self.found.exit_code, EXIT_UNCONVERGED if self.reasons else 0)

    @property
    def complaints(self) -> tuple[str, ...]:
        """Faults of single cases, and points beyond the tolerance."""
        return (*(str(fault) for result in self.found.cases for fault in result.faults), *self.reasons)

    @property
    def text(self) -> str:
        """One screen."""
        return summary(self.found.cases, find_cases(self.paths), cut=False)

    def screen(self) -> str:
        """The same for a terminal, long tables cut."""
        return summary(self.found.cases, find_cases(self.paths), cut=True)

    @property
    def details(self) -> str:
        """Every case in full."""
        return "\n\n".join([*map(case_text, self.found.cases), overview_text(self.found.cases)])

    def __str__(self) -> str:
        return self.text

    def to_dict(self) -> dict[str, Any]:
        """Plain values of schema ``bemt.sweep/1``."""
        return self.found.document()


def sweep(paths: Sequence[str], out: str | None, *, tolerance: float | None, **more: Any) -> SweepAnswer:
    """Sweep; with a tolerance [%] the points beyond it are reasons to end with 1."""
    found = batch.sweep(paths, out, **more)
    solved = [r for r in found.cases if r.rows]
    reasons = [] if tolerance is None else [line for r in solved for line in batch.off_tolerance(r, tolerance)]
    return SweepAnswer(found, tuple(paths), tuple(reasons))
