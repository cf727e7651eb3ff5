"""What may have been left out: nothing, a set of effects, or something smooth that no effect of the catalogue is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from bemt.base.document import Documented
from bemt.physics import effects

__all__ = ["CHANGED", "DOUBT", "NONE", "UNKNOWN", "Explanation", "KindPrior", "Size", "Sizes"]


CHANGED = 50.0
"""Weight, in the prior, of an effect that the user says he changed: said, weighed, checked [1]."""


@dataclass(frozen=True)
class KindPrior:
    """Probability of the kinds of explanation; they add up to one. [1]"""

    none: float
    single: float
    pair: float
    unknown: float


@dataclass(frozen=True)
class Explanation:
    """A set of effects; false where it has none. Documents write it as ``str`` does: "none", "unknown", "a", "a+b".

    Examples
    --------
    >>> str(Explanation.of("thrust_zero", "reynolds")), str(NONE), str(UNKNOWN)
    ('reynolds+thrust_zero', 'none', 'unknown')
    """

    ids: frozenset[str] = frozenset()  # Effects at work
    smooth: bool = False  # Whether something smooth is at work that no effect of the catalogue is
    doubt: bool = False  # Whether the files are not what they say: another rotor, stand or unit than stated

    @classmethod
    @cache
    def of(cls, *ids: str) -> Explanation:
        """Explanation by effects."""
        return cls(frozenset(ids))

    @property
    def pair(self) -> bool:
        """Whether two effects or more are at work."""
        return len(self.ids) > 1

    def __or__(self, other: Explanation) -> Explanation:
        """Both at work; where the files are in doubt nothing else is known."""
        if self.doubt or other.doubt:
            return DOUBT
        return Explanation(self.ids | other.ids, self.smooth or other.smooth)

    def __iter__(self) -> Iterator[str]:
        """Effects in the order of the catalogue."""
        place = effects.places()
        return iter(sorted(self.ids, key=lambda i: (place.get(i, len(place)), i)))

    def __len__(self) -> int:
        """How many effects."""
        return len(self.ids)

    def __contains__(self, effect: object) -> bool:
        """Whether an effect is one of them."""
        return effect in self.ids

    def __str__(self) -> str:
        """As documents write it."""
        words = [*self, *(["unknown"] if self.smooth else [])]
        return "doubt" if self.doubt else "+".join(words) or "none"


NONE, UNKNOWN, DOUBT = Explanation(), Explanation(smooth=True), Explanation(doubt=True)


class Size(Documented):
    """Value of a parameter of an explanation, and the ends of its 90 % interval; None or words if it is no number."""

    value: Any
    low: Any
    high: Any
    unit: str
    odds: tuple[tuple[Any, float], ...] | None = None  # Of the values that a discrete one may have [1]


Sizes = Mapping[str, Mapping[str, Size]]
"""By effect and parameter."""
