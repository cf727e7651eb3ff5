"""Which change can make the ratios of two recordings, without any blade: how loads scale, weighed by their evidence.

Every row of :mod:`bemt.compare.scaling_laws` says how thrust, torque or the drive move together and with what they
grow. A row is a linear Gaussian model on top of :func:`bemt.compare.smooth_change.covariance`, so its evidence has a
closed form (Rasmussen and Williams 2006, eq. 2.30 and 2.40 to 2.43). Two rivals always compete: nothing, and a smooth
change of every channel on its own. What a blade would do in detail is not known here; with a case,
:mod:`bemt.diagnose.contrast` asks the solver.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from bemt.base import unit_errors
from bemt.base.unit_errors import SpeedRatio
from bemt.compare import smooth_change as fits
from bemt.compare.matched import LOADS, POWER_OF_SPEED, MatchedChannel
from bemt.compare.scaling_laws import FAMILY, LAWS, ScalingLaw, law
from bemt.compare.smooth_change import Scatter
from bemt.gaussian.evidence import LinearTerms, log_sum, shares
from bemt.gaussian.whitening import log_density, whitener

Array = NDArray[np.float64]

NONE, UNKNOWN = "none", "unknown"
_PRIOR = {NONE: 0.5, UNKNOWN: 0.1}
# Smooth changes of each load on its own, as (size, and its level, bend and local shape over it): nobody knows what
# makes them; beyond a tenth of level it is rather another blade, whose coefficients are other lines with a slight bend.
_UNKNOWN_KINDS = ((0.1, 1.0, 0.1, 0.06), (0.35, 1.0, 0.1, 0.06), (1.0, 0.35, 0.1, 0.06))
_WITHOUT_BLADES = (*_UNKNOWN_KINDS[:2], (1.0, 1.0, 0.1, 0.06))
_BLADE_KINDS = ((0.35, 1.0, 0.03, 0.0), (1.0, 1.0, 0.03, 0.0))
SURE = 0.85
"""Probability from which one effect is named."""
FORM = {0.15: 0.7, 0.45: 0.3}
"""What a change by air or blade may rise or bow with speed or advance, share of the change, with its prior weight: the
sizes by which published laws of one effect differ (:mod:`bemt.diagnose.form`)."""
_EXACT = {1.0: 1.0}
NEAR, MOST, FAMILIES = 20.0, 6, 3
"""An effect this many times less likely than the leading one is still in its class, which has at most so many members,
or members of at most so many families: a law is rougher than its evidence."""
ENOUGH, WIDEST, KINDS, CLEAR = 0.85, 8, 4, 0.1
"""Without so few: a wider class where its members hold this much of all probability, so many at most, of so many
families, of a load that changed by this much [ln]: half of the list is ruled out then; no stand repeats as badly."""
OWN_SHAPE, _FURTHER = "propeller", 20.0
RIVAL, DOUBT = 0.1, 0.3
"""An effect beside which the unknown keeps more than the first is not named; a class beside the second is not given."""
# Speed at equal command of one motor, in ln: battery and load change it by no more.
_SAME_DRIVE = 0.06
# No battery changes the speed at equal command by more than this, in ln.
_ODD_SPEED = 0.4
# A nearer ratio than 9 : 8 is a small error of the speed, which the law has.
_RATIOS = unit_errors.speed_ratios(rarest=1.0, nearest=Fraction(9, 8))


@dataclass(frozen=True, eq=False)
class Judgement:
    """What is said of one sub-system."""

    verdict: str  # none, named, sensor, class, unknown or insufficient
    effects: tuple[str, ...]  # Of the verdict
    probability: Mapping[str, float]  # Of every explanation, the likeliest first
    # (value, error) of the first term of each effect: ln ratio, or share of full scale
    size: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    why: str = ""  # The rule that decided


def _bases(c: MatchedChannel, volts: float | Array = 1.0, other: MatchedChannel | None = None) -> dict[str, Array]:
    """Columns that a law may use, for the points of B; ``other``: the other load, of the same points."""
    b = c.second.astype(float)
    advance = c.x[:, 1]
    top = float(np.max(np.abs(advance)))
    J = advance / top if top > 0.0 else advance
    slope = np.zeros(b.size)
    if c.advance_moves():
        X = np.column_stack([np.ones(b.size), b, J, J**2])  # at one airspeed J and n are one coordinate
        fit = np.linalg.lstsq(X, c.y, rcond=None)[0]
        slope = J * (fit[2] + 2.0 * fit[3] * J)
    square = np.exp(2.0 * (c.x[:, 0] - c.x[:, 0].max())) if c.name in LOADS else np.ones(b.size)
    slower = np.exp(c.x[:, 0].mean() - c.x[:, 0]) if c.name in LOADS else np.ones(b.size)
    talk = np.zeros(b.size)
    if other is not None and other.y.size == b.size:
        talk = np.exp((other.y - c.y) - float(np.max(other.y - c.y)))
    load = np.exp(c.y - c.y.max())
    ramp = fits.unit_coordinates(c)[:, 0]
    ramp = ramp / max(float(np.abs(ramp).max()), 1e-12)
    return {
        "all": b,
        "zero": b * c.floor,
        "still": b * (1.0 - np.abs(J)),
        "slope": b * slope,
        # d ln C / dJ times the shift of J, which an offset of the airspeed makes larger at low speed of rotation
        "slip": b * np.divide(slope, J, out=np.zeros_like(J), where=np.abs(J) > 1e-9) * slower,
        "talk": b * talk,
        "drag": b * J**2 / load,
        "n2": b * square,
        "ramp": b * ramp,
        "bow": b * (ramp**2 - 0.5),
        "advance": b * (J - J.mean()),
        "volts": b * volts,
    }


def _volts(channels: Mapping[str, MatchedChannel]) -> dict[str, float | Array]:
    """Logarithm of B's voltage over A's at the command of every point of the drive; empty without voltages."""
    v = channels.get("voltage")
    if v is None:
        return {}
    order = np.argsort(v.x[:, 0], kind="stable")
    at, y, second = v.x[order, 0], v.y[order], v.second[order]
    out: dict[str, float | Array] = {}
    for name, c in channels.items():
        if name == "speed":
            out[name] = np.asarray(
                np.interp(c.x[:, 0], at[second], y[second]) - np.interp(c.x[:, 0], at[~second], y[~second])
            )
        elif name == "electrical":
            out[name] = float(y[second].mean() - y[~second].mean())
    return out


def _columns(
    row: ScalingLaw,
    channels: Mapping[str, MatchedChannel],
    form: float,
    volts: Mapping[str, float | Array],
) -> Array | None:
    """Columns of a law over all channels, (M, terms and form), each of unit size; None where nothing moves.

    Instruments are exact. Air and blades follow their law roughly: what they change may rise or bow with speed.
    """
    shapes = () if row.kind == "stand" or row.exact else ("ramp", "bow", "advance")
    parts = []
    for name, c in channels.items():
        basis = _bases(
            c, volts.get(name, 1.0), next((o for k, o in channels.items() if k != name and k in LOADS), None)
        )
        columns = [
            w * sum((f * basis[k] for k, f in term.get(name, {}).items()), np.zeros(c.y.size)) for w, term in row.terms
        ]
        moved = sum((np.abs(v) for v, (w, _) in zip(columns, row.terms, strict=True) if w >= 1.0), np.zeros(c.y.size))
        scale = form * float(moved.max())
        for which in channels:
            columns += [scale * (which == name) * basis[k] for k in shapes]
        parts.append(np.column_stack(columns))
    joined = np.vstack(parts)
    if np.abs(joined[:, 0]).max() <= 1e-9:
        return None
    used = np.abs(joined).max(axis=0) > 1e-12
    used[: len(row.terms)] = True
    return joined[:, used]


def _slips(channels: Mapping[str, MatchedChannel]) -> list[tuple[float, Array]]:
    """Changes by ratios of units, (share of the prior, (M,) mean)."""
    from bemt.effects.unit_slip import UnitSlip

    start, out = 0, []
    total = sum(c.y.size for c in channels.values())
    for c in channels.values():
        for way in UnitSlip().variants():
            factor = float(way["factor"])
            if way["channel"] == c.channel and factor > 0.0:
                mean = np.zeros(total)
                mean[start : start + c.y.size] = math.log(factor) * c.second
                out.append((UnitSlip(c.channel, factor).odds(), mean))
        start += c.y.size
    return out


def _miscounts(speeds: tuple[float, float] | None) -> list[SpeedRatio]:
    """Ratios by which the speed of B may be miscounted."""
    if speeds is None:
        return list(_RATIOS)
    # one motor at one command: what is indicated changes by the same ratio
    return [r for r in _RATIOS if abs(speeds[0] - math.log(r.ratio)) < _SAME_DRIVE + speeds[1]]


def _at_speed(c: MatchedChannel, factor: float) -> MatchedChannel:
    """The channel with the true speed of B so many times the indicated one.

    With airspeed the points stay where they are: what a shift of J does there, a pitch does as well.
    """
    x = c.x.copy()
    if not c.advance_moves():
        x[c.second, 0] += math.log(factor)
    return replace(c, x=x, y=c.y - POWER_OF_SPEED.get(c.channel, 2.0) * math.log(factor) * c.second)


def _by_poles(
    channels: Mapping[str, MatchedChannel], scatter: Mapping[str, Scatter], speeds: tuple[float, float] | None
) -> tuple[float, float] | None:
    """Log evidence of a wrong number of poles, and the logarithm of the likeliest ratio."""
    ratios = _miscounts(speeds)
    if not ratios:
        return None
    terms = []
    for ratio in ratios:
        there = {k: _at_speed(c, 1.0 / ratio.ratio) for k, c in channels.items()}
        each = sum(log_density(fits.covariance(c, scatter[k]), c.y - c.y.mean(), False) for k, c in there.items())
        terms.append(each + math.log(ratio.weight))
    odd = speeds is not None and abs(speeds[0]) > _ODD_SPEED
    ways = sum(r.weight for r in (ratios if odd else _RATIOS))
    best = ratios[int(np.argmax(terms))]
    return float(log_sum(terms)) - math.log(ways), -math.log(best.ratio)


def weigh(
    channels: Mapping[str, MatchedChannel],
    scatters: Sequence[Mapping[str, Scatter]],
    kinds: Sequence[str],
    density: float | None = None,
    speeds: tuple[float, float] | None = None,
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Evidence of every explanation; ``density``: how well the ratio of the densities is known [1]."""
    found = [_weighed(channels, scatter, kinds, density, speeds) for scatter in scatters]
    names = list(found[0][0])
    score = {k: float(log_sum([z[k] for z, _ in found])) for k in names}
    size = {k: max(found, key=lambda f: f[0][k])[1][k] for k in names if k in found[0][1]}
    listed = [k for k in score if k not in _PRIOR]
    log_prior = {k: math.log(_PRIOR.get(k, (1.0 - sum(_PRIOR.values())) / max(len(listed), 1))) for k in score}
    share = shares([score[k] + log_prior[k] for k in score]).tolist()
    return dict(sorted(zip(score, share, strict=True), key=lambda kv: -kv[1])), size


def _weighed(
    channels: Mapping[str, MatchedChannel],
    scatter: Mapping[str, Scatter],
    kinds: Sequence[str],
    density: float | None,
    speeds: tuple[float, float] | None,
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Log evidence of every explanation at one setting of the scatter, and sizes."""
    from scipy.linalg import block_diag

    volts = _volts(channels)
    if volts:  # a condition then, no answer
        channels = {k: c for k, c in channels.items() if k != "voltage"}
    base = {k: fits.covariance(c, scatter[k]) for k, c in channels.items()}
    y = np.concatenate([c.y - c.y.mean() for c in channels.values()])
    white = whitener(block_diag(*base.values()))
    r = white(y)
    none = -0.5 * float(r @ r) - white.log_det
    score: dict[str, float] = {NONE: none}
    size: dict[str, tuple[float, float]] = {}
    moving = any(c.advance_moves() for c in channels.values())
    for row in (row for row in LAWS if row.kind in kinds and (moving or not row.flow)):
        sizes = (density,) if row.id == "air_density" and density is not None else row.sizes
        found = []
        for form, prior in (_EXACT if row.kind == "stand" or row.exact else FORM).items():
            columns = _columns(row, channels, form, volts)
            if columns is not None:
                A, weight = white(columns), math.log(prior / len(sizes))
                for s in sizes:
                    z, value, error = _evidence(row, A, r, s)
                    found.append((z + weight, value, error))
        if found:
            score[row.id] = none + float(log_sum([z for z, _, _ in found]))
            best = max(found, key=lambda f: f[0])
            size[row.id] = best[1], best[2]
    if "rpm_scale" in score:
        poles = _by_poles(channels, scatter, speeds)
        if poles is not None:
            if poles[0] > score["rpm_scale"]:
                size["rpm_scale"] = poles[1], 0.0
            score["rpm_scale"] = float(np.logaddexp(score["rpm_scale"], poles[0])) - math.log(2.0)
    slips = _slips(channels) if "stand" in kinds else []
    if slips:
        z, mean = _shifted(slips, white, r, none)
        score["unit_slip"], size["unit_slip"] = z, (mean, 0.0)
    blades = OWN_SHAPE in score
    score[UNKNOWN] = _any_change(channels, base, none, _UNKNOWN_KINDS if blades else _WITHOUT_BLADES)
    if blades:
        own = _any_change(channels, base, none, _BLADE_KINDS)
        score[OWN_SHAPE] = float(np.logaddexp(score[OWN_SHAPE], own)) - math.log(2.0)
    return score, size


def _shifted(
    known: Sequence[tuple[float, Array]], white: Callable[[Array], Array], r: Array, none: float
) -> tuple[float, float]:
    """Log evidence of known changes, each with its share of the prior, and the likeliest one."""
    terms = [0.5 * float(r @ r) - 0.5 * float(np.sum((r - white(m)) ** 2)) + math.log(w) for w, m in known]
    mean = known[int(np.argmax(terms))][1]
    total = math.log(sum(w for w, _ in known))
    return none + float(log_sum(terms)) - total, float(mean[np.argmax(np.abs(mean))])


def _evidence(row: ScalingLaw, A: Array, r: Array, size: float) -> tuple[float, float, float]:
    """Log evidence over that of none, first coefficient and its error.

    Terms of weight 1 or more stand on their own; the others are shares of what these turn out to be.
    """
    free = np.array([w >= 1.0 for w, _ in row.terms] + [False] * (A.shape[1] - len(row.terms)))
    b = np.where(free, size, 0.0)
    for _ in range(3):
        sd = np.where(free, size, np.maximum(float(np.abs(b[free]).max()), 1e-5))
        terms = LinearTerms.of(A * sd)
        mean, error = terms.posterior(r)
        b = sd * mean
    return float(terms.gain(r)), float(b[0]), float(sd[0] * error[0])


def _any_change(
    channels: Mapping[str, MatchedChannel],
    base: Mapping[str, Array],
    none: float,
    kinds: Sequence[tuple[float, float, float, float]],
) -> float:
    """Log evidence of a smooth change of every channel on its own, on the scale of the others."""
    found = []
    for size, level, bend, local in kinds:
        total = none
        for name, c in channels.items():
            y, free = c.y - c.y.mean(), size**2 * fits.free_change(c, level, bend, local)
            total += log_density(base[name] + free, y) - log_density(base[name], y)
        found.append(total)
    return float(log_sum(found)) - math.log(len(found))


def judge(probability: Mapping[str, float], size: Mapping[str, tuple[float, float]], largest: float = 0.0) -> Judgement:
    """Say what the evidence allows: the order of the questions is the order of caution.

    ``largest``: of the changes of the loads, natural logarithm.
    """

    def answer(verdict: str, effects: Sequence[str], why: str) -> Judgement:
        return Judgement(verdict, tuple(effects), probability, size, why)

    if probability[NONE] >= 0.5:
        return answer("none", (), f"no change beyond scatter and set-up (probability {probability[NONE]:.2f})")
    listed = {k: p for k, p in probability.items() if k not in _PRIOR}
    mass, unknown = sum(listed.values()), probability[UNKNOWN]
    if unknown > 0.5:
        return answer("unknown", (), f"no listed cause changes these channels like that (probability {unknown:.2f})")
    if not listed or mass <= 0.5:
        return answer("insufficient", (), "the change is too small to be distinguished from none")
    best = max(listed.values())
    credible = [k for k, p in sorted(listed.items(), key=lambda kv: -kv[1]) if p >= best / NEAR]
    first = credible[0]
    if largest >= CLEAR:  # that an instrument is exact and a blade is not says little of what made a large change
        further = [k for k, p in sorted(listed.items(), key=lambda kv: -kv[1]) if p >= best / (NEAR * _FURTHER)]
        credible = further if _few(further) else credible
    if credible == [OWN_SHAPE]:  # curves of its own fit anything: what comes near is not ruled out
        credible = [k for k, p in sorted(listed.items(), key=lambda kv: -kv[1]) if p >= best / (NEAR * _FURTHER)]
    if len(credible) == 1 and listed[first] >= SURE and unknown <= RIVAL:
        row = law(first)
        kind = "sensor" if first == "unit_slip" or (row is not None and row.kind == "stand") else "named"
        return answer(kind, (first,), row.says if row is not None else "the ratio is exactly that of two units")
    if 1 < len(credible) and "blade" in {FAMILY.get(k) for k in credible}:  # which of them is hard to say
        least = best / (NEAR * _FURTHER)
        credible += [k for k, p in listed.items() if FAMILY.get(k) == "blade" and p >= least and k not in credible]
    few = _few(credible)
    if len(credible) > 1 and few and unknown <= DOUBT and probability[NONE] <= RIVAL:
        return answer("class", credible, f"the data cannot tell these apart (probability {mass:.2f})")
    wide = _wider(listed) if largest >= CLEAR else []
    if wide and len(credible) > 1 and unknown <= DOUBT and probability[NONE] <= RIVAL:
        return answer(
            "class", wide, f"the data cannot tell these apart (probability {sum(listed[k] for k in wide):.2f})"
        )
    if len(credible) == 1 and listed[first] < SURE:
        return answer("insufficient", (), f"{first} is likely (probability {listed[first]:.2f}) but not sure")
    if len(credible) == 1:
        return answer(
            "insufficient",
            (),
            f"{first} fits best (probability {listed[first]:.2f}), but one that is not listed has {unknown:.2f}",
        )
    why = f"{len(credible)} listed causes change these channels in this way"
    if probability[NONE] > RIVAL:
        why = f"it is hardly beyond scatter and set-up (probability of no change {probability[NONE]:.2f}), and {why}"
    elif few:
        why = f"a cause that is not listed may have caused it (probability {unknown:.2f}), and {why}"
    return answer("insufficient", (), why)


def _few(names: Sequence[str]) -> bool:
    """Whether effects are few enough for a class, or of few kinds."""
    return len(names) <= MOST or len({FAMILY.get(k, k) for k in names}) <= FAMILIES


def _wider(listed: Mapping[str, float]) -> list[str]:
    """Likeliest effects that hold enough of the probability together; none where these are too many."""
    chosen: list[str] = []
    for name in sorted(listed, key=lambda k: -listed[k]):
        chosen.append(name)
        if sum(listed[k] for k in chosen) >= ENOUGH:
            few = len(chosen) <= WIDEST and len({FAMILY.get(k, k) for k in chosen}) <= KINDS
            return chosen if few else []
    return []
