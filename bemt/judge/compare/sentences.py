"""Sentences of every answer on recordings, with a case or without: cause, what was seen, what else it may be."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from bemt.base.tables import number_text, some
from bemt.judge.compare.matched import LOADS, OVER_COMMAND, WITHOUT_SPEED, MatchedChannel
from bemt.judge.compare.sizes import READ, Found
from bemt.judge.compare.smooth_change import Ratio
from bemt.judge.explanation import DOUBT, NONE, UNKNOWN, Explanation
from bemt.physics import effects

WORD = {
    "thrust_N": "thrust", "torque_Nm": "torque", "power_W": "shaft power", "CT": "CT", "CP": "CP", "CQ": "CQ",
    "electrical_power_W": "electrical power", "rpm": "speed at equal command",
    "voltage_V": "voltage at equal command",
}  # fmt: skip
NO_CHANGE = "no change, only what two runs differ by"
"""Explanation without a cause where two recordings are compared."""
WHY_LEFT = {
    "none": "no number", "zero": "so near zero that they say nothing of the rotor",
    "beyond": "beyond the range that both have",
}  # fmt: skip
"""Why readings are not compared."""
_SHORT = {"electrical_power_W": "electrical power", "at_power": "thrust", "at_command": "thrust"}
"""Channels in words, where their name is none."""
_PERCENT = (0.5, 2.0)  # ratios between these are said in percent
_PULSE = 0.01  # a command below is a pulse width [s], above a throttle [1]
_LEAST, _SURE = 0.01, 0.995  # probabilities beyond are not told with two digits
_MOST, _GUESS = 3, 0.1  # causes that are told where none is claimed, and more that are as likely as this
_LIKELIER = 0.5  # probability from which a cause is likelier than all others together
_LINE = 110
_UNITS = re.compile(r"(?<=\d) (?=(?:%|N|W|deg|rev/min|m/s|m)(?!\w))|(?<=\d N) (?=m(?!\w))")
_QUIET = 0.05  # probability of no change from which on a change is not certain, and of a cause that is told
_MERIT, _OF_MERIT = "figure of merit", ("thrust_N", "torque_Nm", "rpm", "loads")  # relation, and what it is made of


def shares(*values: float) -> list[str]:
    """Changes in one notation: percent, or factors where one of them is far from 1.

    >>> shares(2.09, 1.66, 2.63), shares(1.0, 0.9), shares(-1.4)
    (['x2.09', 'x1.66', 'x2.63'], ['+0.0 %', '-10.0 %'], ['x-1.40'])
    """
    near = all(_PERCENT[0] < x < _PERCENT[1] for x in values)
    return [f"{100.0 * (x - 1.0):+.1f} %" if near else f"x{number_text(x, 3)}" for x in values]


def odds(p: float) -> str:
    """Probability, which is never 0 or 1.

    >>> odds(0.873), odds(0.9999), odds(0.001)
    ('0.87', 'above 0.99', 'below 0.01')
    """
    return f"below {_LEAST}" if p < _LEAST else "above 0.99" if p >= _SURE else f"{p:.2f}"


class Way(NamedTuple):
    """One explanation: title with its size, and probability."""

    title: str
    probability: float

    def __str__(self) -> str:
        """As a list has it."""
        return f"{self.title} {odds(self.probability)}"


def claimed(
    verdict: str, probability: float, sets: Sequence[Sequence[str]], ways: Sequence[Way], title: Callable[[str], str],
    beside: bool, change: str,
) -> str:  # fmt: skip
    """What is wrong, by how much and how sure, of a verdict that gives a cause, and the ``change`` that was measured.

    ``beside`` as of a decision.

    >>> both = [Way("gain", 0.6), Way("zero", 0.3)]
    >>> claimed("class", 0.9, (("gain", "zero"),), both, str, False, "thrust +5.0 %")
    'Most likely gain, probability 0.60; thrust +5.0 %.'
    >>> claimed("class", 0.9, (("gain",), ("zero", "duct")), both, str, False, "")
    'Two causes, probability 0.90: gain and (zero or duct).'
    """
    if verdict != "class":
        where = " in the stand, not the air" if verdict == "sensor" else ""
        what = " and ".join(title(i) for one in sets for i in one)
        told = f"Cause found{where}: {what}, probability {odds(probability)}"
    elif beside:
        more = " or ".join(map(title, sets[1]))
        told = f"Cause found: {title(sets[0][0])}, probability {odds(probability)}, and possibly {more}"
    elif len(sets) > 1:
        each = [_either(one, title) for one in sets]
        told = f"Two causes, probability {odds(probability)}: {' and '.join(each)}"
    elif ways[0].probability >= _LIKELIER:
        told = f"Most likely {ways[0].title}, probability {odds(ways[0].probability)}"
    else:  # little is known of the cause
        first = f"likeliest {ways[0].title}, probability {odds(ways[0].probability)}"
        alike = f"one of {len(ways)} causes that these readings cannot tell apart, {first}"
        told, change = f"{change}: {alike}" if change else alike, ""
    return f"{told[0].upper()}{told[1:]}{f'; {change}' if change else ''}."


def _either(one: Sequence[str], title: Callable[[str], str]) -> str:
    """The first of a set, and how many others it may be instead."""
    if len(one) == 1:
        return title(one[0])
    return f"({title(one[0])} or {title(one[1]) if len(one) == 2 else f'one of {len(one) - 1} others'})"


def something(P: Mapping[Explanation, float]) -> str:
    """Start of the sentence that there is a change, where its cause is open."""
    return "Something changed" if P.get(NONE, 0.0) < _QUIET else "Something may have changed"


def others(
    ways: Sequence[Way], sets: Sequence[Sequence[str]], title: Callable[[str], str], P: Mapping[Explanation, float]
) -> list[str]:
    """What else a class may be, each once; of two causes what either may be instead of the one that was said."""
    if len(sets) < 2:
        return [f"It may also be: {'; '.join(map(str, ways[1:]))}."] if len(ways) > 1 else []
    share = {i: sum(p for k, p in P.items() if i in k) for one in sets for i in one}
    each = {title(one[0]): [Way(title(i), share[i]) for i in one[1:]] for one in sets}
    return [f"In place of {first}: {'; '.join(map(str, rest))}." for first, rest in each.items() if len(rest) > 1]


def likeliest(P: Mapping[Explanation, float], title: Callable[[Explanation], str], nothing: str) -> list[str]:
    """The likeliest explanations where no cause is claimed; ``nothing``: what "none" stands for.

    >>> gain = Explanation.of("thrust_gain")
    >>> likeliest({NONE: 0.54, gain: 0.3, UNKNOWN: 0.16}, str, "no change")
    ['Likeliest (probability): no change 0.54; thrust_gain 0.30; something that is not in the library 0.16.']
    """
    words = {NONE: nothing, UNKNOWN: "something that is not in the library",
             DOUBT: "another rotor, unit or file than stated"}  # fmt: skip
    told, causes = [], 0
    for k, p in sorted(P.items(), key=lambda kv: -kv[1]):
        if p < (_GUESS if causes >= _MOST else _QUIET if causes else _LEAST):
            break
        told.append(Way(words[k] if k in words else title(k), p))
        causes += bool(k.ids)
    return [f"Likeliest (probability): {'; '.join(map(str, told))}."] if causes else []


def moved(ratios: Mapping[str, Ratio], drive: bool = False) -> str:
    """What changed by how much: the loads, or the drive where a cause in it has moved that."""
    kinds = ("speed", "voltage", "electrical") if drive else (*LOADS, *WITHOUT_SPEED)
    found = {r.kind: f"{of_what(c, r)} {_interval(r)[0]}" for c, r in ratios.items()}
    return " and ".join([found[k] for k in kinds if k in found][:2])


def seen(ratios: Mapping[str, Ratio], lead: str, drive: bool = False) -> list[str]:
    """How far the channels of one recording are from those of another, at equal speed or at equal command."""
    kinds = ("speed", "voltage") if drive else (*LOADS, *WITHOUT_SPEED)
    loads = {c: r for c, r in ratios.items() if r.kind in kinds}
    if not loads:
        return []
    first = next(iter(loads.values()))
    where = "extrapolated to one speed" if first.extrapolated else _range(first)
    words = [f"{WORD[c]} {{}} ({{}} to {{}})".format(*_interval(r)) for c, r in loads.items()]
    place = "" if drive else f" at equal {WITHOUT_SPEED.get(first.kind, 'speed')}, {where}"
    return [f"{lead}{place}: {', '.join(words)}; 95 % in brackets.", *_along(loads)]


def _along(loads: Mapping[str, Ratio]) -> Iterator[str]:
    """How ratios change along the speed, with their ends; in words where they change along something else."""
    rest: dict[str, list[str]] = {}
    for c, r in loads.items():
        (slow, _, low, *_), (fast, _, high, *_) = r.curve[0], r.curve[-1]
        if r.depends_on == ("speed",) and r.kind in LOADS and fast > slow:
            ends = zip(shares(low * r.density_ratio, high * r.density_ratio), (slow, fast), strict=True)
            told = ", ".join(f"{size} at {math.exp(x):.0f}" for size, x in ends)
            yield f"The change of {WORD[c]} depends on speed: {told} rev/min."
        elif r.depends_on:
            of = {"speed": WITHOUT_SPEED.get(r.kind, "speed"), "advance": "advance ratio"}
            rest.setdefault(" and ".join(of[k] for k in r.depends_on), []).append(WORD[c])
    for along, names in rest.items():
        yield f"The change of {' and '.join(names)} depends on {along}."


def of_what(channel: str, r: Ratio) -> str:
    """What a ratio is of, and at what it is taken if not at the speed."""
    return f"{WORD[channel]} at equal {WITHOUT_SPEED[r.kind]}" if r.kind in WITHOUT_SPEED else WORD[channel]


def _interval(r: Ratio) -> list[str]:
    """Change of a channel as measured and the ends of its 95 % interval, in one notation."""
    return shares(*(k * r.density_ratio for k in (r.ratio, r.low95, r.high95)))


def _range(r: Ratio) -> str:
    low, high = r.range
    if r.kind == "at_power":
        return f"{math.exp(low):.0f} to {math.exp(high):.0f} W"
    if r.kind in OVER_COMMAND:
        return f"{1e6 * low:.0f} to {1e6 * high:.0f} µs" if high < _PULSE else f"{low:.0%} to {high:.0%}"
    if high - low < 1e-9:
        return "advance ratio {:.2f} to {:.2f}".format(*r.advance_range)
    return f"{math.exp(low):.0f} to {math.exp(high):.0f} rev/min"


def words_of_left_out(channels: Iterable[MatchedChannel]) -> list[str]:
    """A line for each reason for which readings are not compared, with their lines and channels."""
    out = []
    for why, words in WHY_LEFT.items():
        of: dict[tuple[str, tuple[str, ...]], list[str]] = {}
        for c in channels:
            for one in (k for k in c.left if k.why == why):
                of.setdefault((one.letter, one.where), []).append(_SHORT.get(c.channel, _SHORT.get(c.name, c.name)))
        both: dict[tuple[tuple[str, ...], tuple[str, ...]], list[str]] = {}
        for (letter, where), own in of.items():
            both.setdefault((where, tuple(own)), []).append(letter)
        told = []
        for (where, names), letters in both.items():
            at = where[0] if why == "beyond" else f"line{'s' if len(where) > 1 else ''} {some(where, 4)}"
            told.append(f"{at} of {' and '.join(letters)} ({', '.join(names)})")
        out += [f"not compared, {words}: {'; '.join(told)}"] if told else []
    return out


def verdict_line(verdict: str, effects: Sequence[str]) -> str:
    """Verdict, and what is named; the members of a class are in the sentences."""
    return " ".join(["verdict:", verdict, *([", ".join(effects)] if verdict != "class" and effects else [])])


def wrapped(words: str, lead: str = "  ", indent: str = "    ") -> list[str]:
    """Lines of a sentence, numbers with their units; a command stays in one line, to be copied."""
    if words.startswith("  "):
        return [f"  {words}"]
    told = _UNITS.sub("\N{NO-BREAK SPACE}", words)
    lines = textwrap.wrap(told, _LINE, initial_indent=lead, subsequent_indent=indent, break_on_hyphens=False)
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


class Wrong(NamedTuple):
    """What cannot be so in a recording."""

    where: str  # File, or letter of the recording
    kind: str
    evidence: str  # Numbers that show it
    correction: str = ""  # What would make it right
    both: bool = False  # Whether the recording that it is compared with shows the same
    channel: str = ""


def left_out(found: Sequence[Wrong]) -> list[str]:
    """Readings that the checks left out, once where several channels say the same of their rows."""
    told: dict[tuple[str, str], list[Wrong]] = {}
    for wrong in found:
        told.setdefault((wrong.where, wrong.correction), []).append(wrong)
    return [f"Left out in {where}: {READ.get(first.channel, first.channel)} {first.evidence}"
            f"{''.join(f', {READ.get(w.channel, w.channel)} alike' for w in more)}; {fix.partition('; ')[0]}."
            for (where, fix), (first, *more) in told.items()]  # fmt: skip


def of_files(found: Sequence[Wrong], cause: Mapping[str, Found]) -> list[str]:
    """What the files say of the cause: that it explains what cannot be so in them, or what it leaves to be mended.

    ``cause``: parameters of each effect that is claimed. What both recordings show is no change between them.
    """
    support, rest, shared = [], [], dict[str, str]()
    for wrong in found:
        if wrong.both:
            shared.setdefault(wrong.kind, f"In both files, and so no change: {wrong.evidence}.")
        elif _explains(cause, f"{wrong.channel} {wrong.evidence}"):
            support.append(f"It explains what cannot be in {wrong.where}: {'; '.join(wrong.evidence.split('; ')[:2])}.")
        else:
            rest.append(f"In {wrong.where}: {'; '.join(filter(None, (wrong.evidence, wrong.correction)))}.")
    return [*support[:1], *rest, *shared.values()]


def _explains(cause: Mapping[str, Found], evidence: str) -> bool:
    """Whether a fault of the stand is one of what a relation is made of."""
    known = effects.catalogue()
    stand = {i: found for i, found in cause.items() if i in known and known[i].kind == "stand"}
    read = {str(found["channel"].value) if "channel" in found else known[i].sensor for i, found in stand.items()}
    return any(READ.get(c, c) in evidence or (c in _OF_MERIT and _MERIT in evidence) for c in read)
