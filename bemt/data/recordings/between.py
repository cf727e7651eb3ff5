"""A recording in other units than its companions, found by its level: readings over what the same model gives.

One recording alone shows a slip of a unit only where it leaves the windows of `slips`. Beside others
of the same rotor, or of rotors with models of their own, its level does: what they share, the error of the model
included, drops out, and what is left is one factor. A mixture of units otherwise looks like physics, since the levels
of the recordings then go with whatever else differs between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from bemt.data.recordings.findings import Finding
from bemt.data.recordings.slips import ALIKE, MISCOUNT, Slip, slips

TOGETHER, FAR, NEAR = 0.35, math.log(2.0), 0.25
"""Logarithms of ratios: within which levels agree, from which they differ, within which a difference is a slip's."""
SPREADS = 3.0
"""Spreads of the companions that a slip is away from them at least."""
_SIGMA, _COMMON = 0.1, 1.0
_QUANTITY = {"thrust_N": "T", "torque_Nm": "Q"}


@dataclass(frozen=True)
class Level:
    """Level of one load in one recording."""

    name: str  # Recording; no two have one name
    channel: str  # thrust_N or torque_Nm
    log_ratio: float  # Median of ln |reading / model| over readings under load [1]
    spread: float  # Half of what the middle four fifths of those span [1]


def outlier_runs(levels: Sequence[Level]) -> list[tuple[Level, Finding]]:
    """Name recordings whose level differs from that of most others by the factor of a usual slip.

    >>> files = [("a", 0.02), ("b", -0.05), ("c", 4.6), ("d", 0.8)]  # c reads 102 times, d 2.3 times what others do
    >>> [(level.name, f.correction.split(".")[0]) for level, f in outlier_runs([Level(n, "thrust_N", x, 0.1)
    ...     for n, x in files])]
    [('c', 'gf taken for N: multiply by 0'), ('d', 'lbf taken for kgf: multiply by 0')]
    """
    off: dict[str, dict[str, _Odd]] = {}
    for channel in _QUANTITY:
        for odd in _apart([v for v in levels if v.channel == channel]):
            off.setdefault(odd.level.name, {})[channel] = odd
    found = {}
    for mine in off.values():
        by = [odd.by for odd in mine.values()]
        if len(mine) == 2 and abs(by[0] - by[1]) <= NEAR:  # by one factor: what both are divided by, first of all
            odd = mine["thrust_N"]
            speed = _likely("n", 0.5 * odd.by)
            # two errors at once are believed of common units only
            units = {c: [s for s in _likely(q, -o.by) if s.rarity <= _COMMON]
                     for (c, q), o in zip(_QUANTITY.items(), mine.values(), strict=True)}  # fmt: skip
            if speed:
                text = f"{_evidence(odd)}, and so are those of torque_Nm"
                also = [", ".join(f"{c}: {s[0].words}" for c, s in units.items())] if all(units.values()) else []
                found[id(odd.level)] = (odd.level, Finding(speed[0].id, "rpm", text, _fix(odd, speed, also)))
            if speed or not all(units.values()):
                continue
        for channel, odd in mine.items():
            likely = _likely(_QUANTITY[channel], -odd.by)
            if likely:
                finding = Finding(likely[0].id, channel, _evidence(odd), _fix(odd, likely))
                found[id(odd.level)] = (odd.level, finding)
    return [found[id(v)] for v in levels if id(v) in found]


@dataclass(frozen=True)
class _Odd:
    """A level that is apart from those of the rest by the logarithm `by`."""

    level: Level
    by: float
    rest: tuple[Level, ...]
    spread: float


def _apart(levels: Sequence[Level]) -> list[_Odd]:
    """Levels of one channel that are far from where most are."""
    if len(levels) < 2:
        return []
    groups = [tuple(w for w in levels if abs(w.log_ratio - v.log_ratio) <= TOGETHER) for v in levels]
    _, _, k = min((-len(groups[k]), abs(v.log_ratio), k) for k, v in enumerate(levels))
    usual = median(w.log_ratio for w in groups[k])
    spread = max(abs(w.log_ratio - usual) for w in groups[k])
    far = max(FAR, SPREADS * spread)
    # a slip is one factor: readings that scatter about it have another reason
    return [
        _Odd(v, v.log_ratio - usual, groups[k], spread)
        for v in levels
        if v not in groups[k] and abs(v.log_ratio - usual) >= far and v.spread <= TOGETHER
    ]


def _likely(quantity: str, log_factor: float) -> list[Slip]:
    """Slips that the logarithm of a factor repairs, the likeliest first."""
    fits = [
        (((log_factor - math.log(s.factor)) / _SIGMA) ** 2 + s.rarity, k, s)
        for k, s in enumerate(slips())
        if s.quantity == quantity and s.id != MISCOUNT and abs(log_factor - math.log(s.factor)) <= NEAR
    ]
    best = min(fits, default=(0.0,))[0]
    return [s for score, _, s in sorted(fits) if score - best < ALIKE]


def _evidence(odd: _Odd) -> str:
    names = ", ".join(w.name for w in odd.rest[:3]) + (f" and {len(odd.rest) - 3} more" if len(odd.rest) > 3 else "")
    agree = f", which agree within {math.expm1(max(odd.spread, 0.01)):.0%}" if len(odd.rest) > 1 else ""
    return f"readings over what the case gives are {math.exp(odd.by):.4g} times those of {names}{agree}"


def _fix(odd: _Odd, likely: Sequence[Slip], also: Sequence[str] = ()) -> str:
    others = [*(s.words for s in likely[1:]), *also]
    fix = likely[0].words + (". Fits as well: " + "; ".join(others) if others else "")
    return fix + (f". Or {odd.rest[0].name} is the one in a different unit" if len(odd.rest) == 1 else "")
