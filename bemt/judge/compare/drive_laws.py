"""Which change of motor, controller or battery makes the ratios of two recordings at equal command or load.

How speed and electrical power move together is a table, its sources in the rows; each row is a linear Gaussian model on
top of :func:`bemt.judge.compare.smooth_change.covariance`, so its evidence has a closed form (Rasmussen and Williams
2006, eq. 2.30 and 2.40 to 2.43). Two rivals always compete: nothing, and a smooth change of every channel on its own.
What acts on the rotor is judged by :mod:`bemt.judge.diagnose.by_laws`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from bemt.base.arrays import Array
from bemt.base.gaussian.evidence import LinearTerms, log_sum, shares
from bemt.base.gaussian.whitening import log_density, whitener
from bemt.judge.compare import smooth_change as fits
from bemt.judge.compare.matched import FOLLOWS_LOAD, POWER_OF_SPEED, MatchedChannel
from bemt.judge.compare.smooth_change import Scatter
from bemt.judge.explanation import DOUBT, NONE, UNKNOWN, Explanation, KindPrior, Size, Sizes
from bemt.judge.loss import Decision, decide
from bemt.physics.effects import catalogue
from bemt.physics.effects.base import FORM

PRIOR = KindPrior(none=0.7, single=0.2, pair=0.05, unknown=0.05)
"""Prior probability of the kinds of explanation of a drive, which is judged beside the loads: a cause is half as likely
as there (declared) [1]."""
_PRIOR = {NONE: PRIOR.none, UNKNOWN: PRIOR.unknown}
SUPPLY = Explanation.of("battery_sag")
"""Another voltage of battery or supply."""
# What a recorded voltage does at one command and at one speed, powers of its ratio with their standard deviations: the
# speed is K_v (V - I R), and a controller at part throttle loses more the higher the voltage (declared).
_BY_VOLTS = {"speed": (0.85, 0.15), "electrical": (0.0, 0.5)}
TOLD_VOLTAGE = 0.03
"""Voltages of battery or supply that were read apart by more than this at equal command are a cause, ln [1]."""
BY_LOAD = {"speed": (-0.13, 0.09), "electrical": (1.0, FOLLOWS_LOAD)}
"""How speed at one command and power at one speed follow the torque, as powers with their standard deviations: at
voltage V and a drop I R of 5 to 40 % of the rest dn/n = -c/(1 + 2 c) dQ/Q with c = I R/(V - I R); losses go with the
square of the torque (declared)."""
# A smooth change of each channel on its own, as (size, and its level, bend and local shape over it): nobody knows what
# makes it.
_UNKNOWN_KINDS = ((0.1, 1.0, 0.1, 0.06), (0.35, 1.0, 0.1, 0.06), (1.0, 1.0, 0.1, 0.06))
_SIZES = (0.02, 0.07, 0.25)
FAMILY = {
    **dict.fromkeys(("diameter", "pitch_offset", "section", "propeller", "untwist", "tip_cut"), "blade"),
    **dict.fromkeys(("duct", "ground_effect", "coaxial_neighbour", "recirculation"), "surroundings"),
    **dict.fromkeys(("airspeed_offset", "airspeed_gain", "nacelle", "oblique_inflow", "tunnel_blockage"), "airspeed"),
    **dict.fromkeys(("thrust_gain", "torque_gain", "thrust_zero", "torque_zero", "cross_talk", "thrust_drift",
                     "torque_drift"), "load cell"),
    **dict.fromkeys(("battery_sag", "motor_heating", "motor"), "drive"),
}  # fmt: skip
"""What an engineer would look at, at once; an effect that is not listed is a family of its own."""
FAMILY_WORD = {
    "blade": "another blade, pitch or diameter", "surroundings": "the surroundings of the rotor",
    "airspeed": "the airspeed", "load cell": "a load cell", "drive": "the drive", "air_density": "the density",
    "rpm_scale": "the speed reading", "unit_slip": "a unit",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Judgement(Decision):
    """What is said of one sub-system, with the posterior that it was made on."""

    ranked: Mapping[Explanation, float] = field(default_factory=dict)  # Of every explanation, the likeliest first [1]
    parameters: Sizes = field(default_factory=dict)  # Of effects, as far as they were worked out
    full_scale: Mapping[str, float] = field(default_factory=dict)  # Largest readings of B that shares are of [SI]
    # Parameters of the likeliest explanations, each alone, by name as a ranking has them
    sizes: Mapping[Explanation, Mapping[str, Size]] = field(default_factory=dict)

    @classmethod
    def of(cls, said: Decision, P: Mapping[Explanation, float], parameters: Sizes | None = None,
           full_scale: Mapping[str, float] | None = None,
           sizes: Mapping[Explanation, Mapping[str, Size]] | None = None) -> Judgement:  # fmt: skip
        """The same decision with its posterior."""
        ranked = dict(sorted(P.items(), key=lambda kv: -kv[1]))
        return cls(**{f.name: getattr(said, f.name) for f in fields(Decision)}, ranked=ranked,
                   parameters=parameters or {}, full_scale=full_scale or {}, sizes=sizes or {})  # fmt: skip


@dataclass(frozen=True)
class DriveLaw:
    """How one cause moves speed at equal command and electrical power at equal speed."""

    id: str  # Of the effect, as in the catalogue of effects where it is there
    title: str  # In words
    # Size relative to the first term, and channel to basis to weight. Bases: ``all`` 1; ``ramp`` along the command.
    terms: tuple[tuple[float, Mapping[str, Mapping[str, float]]], ...]
    says: str  # Why this cause, in a sentence
    settles: str  # Measurement that distinguishes it from others
    source: str  # Of the scaling
    sizes: tuple[float, ...] = _SIZES  # Standard deviations of the first term, share; they share the prior [1]


LAWS: tuple[DriveLaw, ...] = (
    DriveLaw(
        "battery_sag", "supply or battery voltage",
        ((1.0, {"speed": {"all": 1.0}}), (0.5, {"electrical": {"all": 1.0}})),
        "speed at one command follows the voltage; loads at the measured speed are unchanged",
        "log voltage at the controller", "n ~ command x V less I R", (*_SIZES, 0.8),
    ),
    DriveLaw(
        "motor_heating", "motor heating (winding and magnets)",
        ((1.0, {"speed": {"all": -0.5}, "electrical": {"all": 1.0}}), (0.4, {"electrical": {"all": 1.0}})),
        "more electrical power for the same speed and load, and less speed at one command",
        "repeat after a pause", "R = R0 (1 + 0.0039 dT)", (0.03, 0.1),
    ),
    DriveLaw(
        "motor", "different motor, controller or setting",
        ((1.0, {"speed": {"all": 1.0}}), (1.0, {"electrical": {"all": 1.0}}), (0.5, {"speed": {"ramp": 1.0}}),
         (0.5, {"electrical": {"ramp": 1.0}})),
        "speed at one command and electrical power change, loads at the measured speed are unchanged",
        "compare motor, controller and its settings", "shares of their own",
    ),
)  # fmt: skip
"""Causes behind the rotor."""
NAMES = tuple(row.id for row in LAWS)
_EACH = (1.0 - sum(_PRIOR.values())) / len(LAWS)


def law(name: str) -> DriveLaw | None:
    """Row of a cause; None for effects on the rotor."""
    return next((row for row in LAWS if row.id == name), None)


def title_of(name: str) -> str:
    """Title of a cause, or of a pair of them: of its scaling law, or of an effect that has none."""
    rows = [(law(k) or catalogue().get(k), k) for k in name.split("+")]
    return " and ".join(row.title if row else FAMILY_WORD.get(k, k) for row, k in rows)


def check_of(name: str) -> str:
    """Measurement that distinguishes a cause from others."""
    row = law(name)
    return row.settles if row is not None else catalogue()[name].check if name in catalogue() else ""


def _bases(c: MatchedChannel) -> dict[str, Array]:
    """Columns that a law may use, for the points of B."""
    b = c.second.astype(float)
    ramp = fits.unit_coordinates(c)[:, 0]
    ramp = ramp / max(float(np.abs(ramp).max()), 1e-12)
    return {"all": b, "ramp": b * ramp, "bow": b * (ramp**2 - 0.5)}


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


@dataclass(frozen=True)
class Load:
    """How much more torque B takes than A at one speed, natural logarithm."""

    change: float = 0.0  # Mean
    miscount: float = 0.0  # What the speed of B reads over what it is; the change is that at the true speed
    unsure: float = 0.0  # Standard deviation of the mean
    varies: float = 0.0  # Largest departure from the mean


_READ = {"speed": 1.0, "electrical": -POWER_OF_SPEED["electrical_power_W"]}
"""Power of what a speed reads over what it is, with which a channel of the drive goes."""


def log_density_of_ratios(ratios: Mapping[str, tuple[float, float]], volts: float | None, load: Load) -> float:
    """Log density of ratios of the drive, whatever changed it: ``ratios`` and ``volts`` as ln and standard deviation.

    >>> read = {"speed": (0.154, 0.02), "electrical": (-0.462, 0.03)}  # 7/6 of a speed that did not change
    >>> miscounted, turned = Load(0.0, 0.154, 0.02), Load(-0.31, 0.0, 0.02)
    >>> log_density_of_ratios(read, 0.0, miscounted) > log_density_of_ratios(read, 0.0, turned) + 3.0
    True
    """
    names, v = list(ratios), volts or 0.0
    by_volts, by_load = (np.array([table.get(k, (0.0, 0.0)) for k in names]).T for table in (_BY_VOLTS, BY_LOAD))
    y, unsure = np.array([ratios[k] for k in names]).T
    y = y - by_volts[0] * v - by_load[0] * load.change - [_READ[k] * load.miscount for k in names]
    own = np.diag(unsure**2 + (by_volts[1] * v) ** 2 + (by_load[1] * load.change) ** 2)
    own += load.unsure**2 * np.outer(by_load[0], by_load[0])
    ways = [(PRIOR.none, 0.0 * own)]
    ways += [(PRIOR.unknown / len(_UNKNOWN_KINDS), size**2 * np.eye(y.size)) for size, *_ in _UNKNOWN_KINDS]
    for row in LAWS:
        if volts is None or row.id not in SUPPLY:
            T = np.array([[w * term.get(k, {}).get("all", 0.0) for k in names] for w, term in row.terms])
            ways += [(_EACH / len(row.sizes), size**2 * T.T @ T) for size in row.sizes]
    return float(log_sum([math.log(w) + log_density(own + C, y) for w, C in ways]))


def _followed(
    channels: Mapping[str, MatchedChannel], volts: Mapping[str, float | Array], load: Load
) -> tuple[dict[str, Array], dict[str, Array]]:  # fmt: skip
    """What follows from voltages as recorded and from the load: mean (N,) and covariance (N, N), by channel."""
    mean, open_ = {}, {}
    for name, c in channels.items():
        (by_volts, more_volts), (by_load, more_load) = _BY_VOLTS.get(name, (0.0, 0.0)), BY_LOAD.get(name, (0.0, 0.0))
        basis = _bases(c)
        b, v = basis["all"], np.broadcast_to(volts.get(name, 0.0), c.y.shape)
        mean[name] = b * (by_volts * v + by_load * load.change + _READ.get(name, 0.0) * load.miscount)
        level = b * math.hypot(more_load * load.change, by_load * load.unsure)
        columns = np.column_stack([*(more_volts * v * basis[k] for k in ("all", "ramp", "bow")), level])
        # another load is another curve over the command
        bent = b * (abs(by_load) * load.varies + more_load * abs(load.change))
        open_[name] = columns @ columns.T + np.outer(bent, bent) * fits.smooth_kernel(c)
    return mean, open_


def _columns(row: DriveLaw, channels: Mapping[str, MatchedChannel], form: float) -> Array | None:
    """Columns of a law over all channels, (M, terms and form), each of unit size; None where nothing moves."""
    parts = []
    for name, c in channels.items():
        basis = _bases(c)
        columns = [
            w * sum((f * basis[k] for k, f in term.get(name, {}).items()), np.zeros(c.y.size)) for w, term in row.terms
        ]
        moved = sum((np.abs(v) for v, (w, _) in zip(columns, row.terms, strict=True) if w >= 1.0), np.zeros(c.y.size))
        scale = form * float(moved.max())
        for which in channels:
            columns += [scale * (which == name) * basis[k] for k in ("ramp", "bow")]
        parts.append(np.column_stack(columns))
    joined = np.vstack(parts)
    if np.abs(joined[:, 0]).max() <= 1e-9:
        return None
    used = np.abs(joined).max(axis=0) > 1e-12
    used[: len(row.terms)] = True
    return joined[:, used]


def weigh(
    channels: Mapping[str, MatchedChannel], scatters: Sequence[Mapping[str, Scatter]], load: Load,
    weight: Mapping[str, float] | None = None,
) -> dict[Explanation, float]:  # fmt: skip
    """Probability of what changed beside the load, the likeliest first; ``scatters``: settings of single readings'.

    Where both voltages are recorded, "none" is nothing but these. ``weight`` of each cause, 1 by default.
    """
    found = [_weighed(channels, scatter, load) for scatter in scatters]
    share_of = {i: (weight or {}).get(i, 1.0) for i in NAMES}
    each = (1.0 - sum(_PRIOR.values())) / (sum(share_of.values()) or 1.0)
    prior = {**_PRIOR, **{Explanation.of(i): each * w for i, w in share_of.items()}}
    score = {k: float(log_sum([z[k] for z in found])) for k in found[0] if prior[k] > 0.0}
    log_prior = {k: math.log(prior[k]) for k in score}
    share = shares([score[k] + log_prior[k] for k in score]).tolist()
    return dict(sorted(zip(score, share, strict=True), key=lambda kv: -kv[1]))


def _weighed(
    channels: Mapping[str, MatchedChannel], scatter: Mapping[str, Scatter], load: Load
) -> dict[Explanation, float]:  # fmt: skip
    """Log evidence of every explanation at one setting of the scatter."""
    from scipy.linalg import block_diag

    volts = _volts(channels)
    if volts:  # a condition then, no answer
        channels = {k: c for k, c in channels.items() if k != "voltage"}
    mean, open_ = _followed(channels, volts, load)
    channels = {k: replace(c, y=c.y - mean[k]) for k, c in channels.items()}
    base = {k: fits.covariance(c, scatter[k]) + open_[k] for k, c in channels.items()}
    white = whitener(block_diag(*base.values()))
    r = white(np.concatenate([c.y - c.y.mean() for c in channels.values()]))
    none = -0.5 * float(r @ r) - white.log_det
    score = {NONE: none}
    for row in LAWS:
        if volts and row.id in SUPPLY:  # known, and no question
            continue
        found = []
        for form, prior in FORM.items():  # what a change may rise or bow with the command, as of every law
            columns = _columns(row, channels, form)
            if columns is not None:
                A, weight = white(columns), math.log(prior / len(row.sizes))
                found += [_evidence(row, A, r, s) + weight for s in row.sizes]
        if found:
            score[Explanation.of(row.id)] = none + float(log_sum(found))
    score[UNKNOWN] = _any_change(channels, base, none)
    return score


def _evidence(row: DriveLaw, A: Array, r: Array, size: float) -> float:
    """Log evidence over that of none.

    Terms of weight 1 or more stand on their own; the others are shares of what these turn out to be.
    """
    free = np.array([w >= 1.0 for w, _ in row.terms] + [False] * (A.shape[1] - len(row.terms)))
    b = np.where(free, size, 0.0)
    for _ in range(3):
        sd = np.where(free, size, np.maximum(float(np.abs(b[free]).max()), 1e-5))
        terms = LinearTerms.of(A * sd)
        b = sd * terms.posterior(r)[0]
    return float(terms.gain(r))


def _any_change(channels: Mapping[str, MatchedChannel], base: Mapping[str, Array], none: float) -> float:
    """Log evidence of a smooth change of every channel on its own, on the scale of the others."""
    found = []
    for size, level, bend, local in _UNKNOWN_KINDS:
        total = none
        for name, c in channels.items():
            y, free = c.y - c.y.mean(), size**2 * fits.free_change(c, level, bend, local)
            total += log_density(base[name] + free, y) - log_density(base[name], y)
        found.append(total)
    return float(log_sum(found)) - math.log(len(found))


def weigh_factor(c: MatchedChannel, s: Scatter) -> dict[Explanation, float]:
    """Probability that a channel changed by one factor, or nearly so, by what nobody can tell: "doubt"; or not."""
    y, C = c.y - c.y.mean(), fits.covariance(c, s)
    found = [log_density(C + size**2 * fits.steady_change(c), y) for size, *_ in _UNKNOWN_KINDS]
    none = math.log(PRIOR.none) + log_density(C, y)
    changed = math.log((1.0 - PRIOR.none) / len(found)) + float(log_sum(found))
    return dict(zip((NONE, DOUBT), shares([none, changed]).tolist(), strict=True))


def judge_drive(P: Mapping[Explanation, float]) -> Judgement:
    """Answer of least expected loss on motor, controller and battery."""
    said = decide(P)
    row = law(said.effects[0]) if said.verdict == "named" and len(said.effects) == 1 else None
    return Judgement.of(replace(said, why=row.says) if row else said, P)
