"""Slips of units, found by what must hold between the channels.

Every relation used here is a product of powers of the recorded quantities: CT = T / (rho n^2 D^4), figure of merit
(in flight the ideal power of axial momentum theory over the power, near the recorded state),
shaft power over electrical power, thrust over (efficacy x power), tip Mach number, thrust over that of the K1/K2
formula. A relation has a window that any propeller of any size keeps, or, where the file holds a product of its own
columns, the exact value 1. The windows of static CT, CQ and figure of merit are about twice as wide as the 130 static
tests of the UIUC database at hand (CT 0.059 to 0.21, figure of merit 0.22 to 0.71).

When a relation is violated, each usual slip of each quantity is tried: a slip is named when it repairs every violated
relation and breaks none. Several may fit; then all are told, the likeliest first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from statistics import median

import numpy as np
from numpy.typing import NDArray

from bemt.base import unit_errors
from bemt.base.arrays import Array
from bemt.base.tables import some
from bemt.data.readers.samples import MOST_RPM_PER_V
from bemt.data.recordings.findings import MOTOR_EFFICIENCY, Facts, Finding, check_for
from bemt.physics import k1k2 as empirical

EXACT = 0.03
"""Relative width of a relation that holds within the file."""
ALIKE = 4.0
"""Difference in score (chi-square) within which slips are told together."""

_FEWEST = 3  # rows that a relation rests on
_IN_FLIGHT = 1.4  # share of the ideal power over that at rest: blades are near their best angle, 0.7 against 0.5
ELECTRICAL, MISCOUNT = "rpm_electrical", "rpm_ratio"
SAME_DIGITS = 0.001
"""Scatter of a product that the file itself formed. [1]"""


@dataclass(frozen=True)
class Relation:
    """A product of powers with the value that it must have."""

    name: str  # In words
    # Exponent of each quantity: T, Q, n, D, P (shaft), E (electrical), U, I, H (thrust per electrical power), G (thrust
    # per shaft power), n2 (second speed), p (pitch)
    powers: Mapping[str, float]
    value: float  # Median over the rows under load [1]
    # Between which the middle three fifths of those rows lie [1]
    range_low: float
    range_high: float
    # Bounds [1]
    low: float
    high: float
    # Usual value and the factor of one standard deviation [1]
    centre: float
    spread: float
    exact: bool = False  # Whether it holds by definition

    def after(self, shift: Mapping[str, float]) -> float:
        """Value once quantities are multiplied by the factors of `shift`."""
        return self.value * float(math.prod(factor ** self.powers.get(q, 0.0) for q, factor in shift.items()))

    @property
    def broken(self) -> bool:
        """Whether most rows are outside the bounds: a slip of a unit moves all rows alike, a poor sensor does not."""
        return self.range_low > self.high or self.range_high < self.low

    @property
    def due(self) -> str:
        """What it must be, in words."""
        return f"{self.centre:g}" if self.exact else f"{self.low:g} to {self.high:g}"

    def holds(self, shift: Mapping[str, float]) -> bool:
        """Whether it is inside its bounds after `shift`."""
        return self.low <= self.after(shift) <= self.high

    def distance(self, shift: Mapping[str, float]) -> float:
        """Square of the distance from the usual value, in standard deviations."""
        return (math.log(max(self.after(shift), 1e-300) / self.centre) / math.log(self.spread)) ** 2


@dataclass(frozen=True)
class Slip:
    """A usual mistake: `id`, `quantity`, `factor` that would repair it, words, and how unusual it is (chi-square)."""

    id: str
    quantity: str
    factor: float
    words: str
    rarity: float = 0.0


_QUANTITY = {
    "T": "thrust_N", "Q": "torque_Nm", "n": "rpm", "P": "power_W", "E": "electrical_power_W", "U": "voltage_V",
    "I": "current_A",
}  # fmt: skip


# Kinds of unit errors of each quantity, and what a finding is called.
_KINDS = {
    "T": ("thrust_unit", "force"), "Q": ("torque_unit", "torque"), "n": ("rpm_unit", "rotation"),
    "P": ("power_unit", "power"), "E": ("electrical_power_unit", "electrical_power"), "I": ("current_unit", "current"),
    "U": ("voltage_unit", "voltage"), "D": ("diameter_unit", "length", "diameter"), "H": ("efficacy_unit", "efficacy"),
    "G": ("efficacy_unit", "efficacy"),
}  # fmt: skip


@cache
def slips() -> tuple[Slip, ...]:
    """List the unit errors and miscounts of each quantity.

    >>> next(s.words for s in slips() if s.quantity == "T")
    'kgf taken for N: multiply by 9.80665'
    """
    found = [Slip(id_, q, e.repair, e.words, e.rarity) for q, (id_, *kinds) in _KINDS.items()
             for kind in kinds for e in unit_errors.errors(kind)]  # fmt: skip
    found += [Slip(ELECTRICAL if r.set == 1 else MISCOUNT, q, 1.0 / r.ratio, r.words, r.rarity)
              for q in ("n", "n2") for r in unit_errors.speed_ratios(rarest=2.0)]  # fmt: skip
    return tuple(found)


def _quantities(facts: Facts) -> dict[str, Array]:
    """Absolute values of the recorded quantities; NaN where there is none."""
    q = {key: np.abs(facts.filled[name]) for key, name in _QUANTITY.items() if facts.get(name) is not None}
    if "n" in q:
        q["n"] = q["n"] / 60.0
    if facts.power_by_product:
        q.pop("E", None)
    if "E" not in q and {"U", "I"} <= q.keys():
        q["E"] = q["U"] * q["I"]
    for key, words in (("H", ("overall_efficiency_N_W", "efficacy_N_W")), ("G", ("propeller_mech_efficiency_N_W",))):
        for name in words:
            if name in facts.raw and np.any(np.isfinite(facts.raw[name])):
                q[key] = np.abs(facts.raw[name])
    n = len(facts)
    for key, length, column in (("D", facts.diameter_m, "diameter_m"), ("p", facts.pitch_m, "pitch_m")):
        if length is not None and length > 0.0:
            q[key] = np.full(n, length)
        elif column in facts.raw:  # several rotors
            q[key] = np.abs(facts.raw[column])
    optical, electrical = facts.optical_rpm, facts.electrical_rpm
    if optical is not None and electrical is not None:
        q["n2"] = np.abs(electrical if facts.named("rpm") == "optical_rpm" else optical) / 60.0
    return {k: np.where(v > 0.0, v, np.nan) for k, v in q.items()}


def _merit_rows(facts: Facts, still: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], Array]:
    """Rows for a figure of merit and their airspeed [m/s], (N,): at rest, else, as in a tunnel, all that pull.

    The ideal power at an airspeed V is T (V / 2 + sqrt(V^2 / 4 + T / (2 rho A))) (Glauert 1935, eq.
    VII 2.3 times T); at rest that is T^1.5 / sqrt(2 rho A).
    """
    V, T = facts.airspeed_m_s, facts.thrust_N
    if V is None or T is None or np.count_nonzero(still) >= _FEWEST:
        return still, np.zeros(len(facts))
    return facts.loaded & (np.nan_to_num(T) > 0.0), np.maximum(np.nan_to_num(V), 0.0)


def relations(facts: Facts) -> list[Relation]:
    """Relations that the recorded channels allow."""
    q = _quantities(facts)
    out: list[Relation] = []
    rho = facts.rho
    duct = facts.ducted
    still = facts.loaded & facts.still
    product = facts.power_by_product  # E is U I then, by construction
    electric = {"U": 1.0, "I": 1.0} if product else {"E": 1.0}

    def add(name: str, powers: Mapping[str, float], scale: Array | float, bounds: tuple[float, float],
            usual: tuple[float, float], rows: NDArray[np.bool_] = still, exact: bool = False) -> None:  # fmt: skip
        if not powers.keys() <= q.keys():
            return
        v = np.exp(sum(p * np.log(q[k]) for k, p in powers.items())) * scale
        v = np.broadcast_to(v, rows.shape)[rows]
        v = v[np.isfinite(v) & (v > 0.0)]
        if v.size < (1 if facts.settled else _FEWEST):
            return
        value = float(np.median(v))
        span = np.percentile(v, [20.0, 80.0])
        if exact and float(np.median(np.abs(v / value - 1.0))) > EXACT:
            return  # no fixed ratio: no slip of a unit
        out.append(Relation(name, powers, value, float(span[0]), float(span[1]), *bounds, *usual, exact))

    tau = 2.0 * math.pi
    shaft, minus = {"Q": 1.0, "n": 1.0}, {k: -p for k, p in electric.items()}
    alike, near, close = (1 - EXACT, 1 + EXACT), (0.9, 1.1), (1.0, 1.02)
    any_row = facts.loaded
    add("shaft power over torque x speed", {"P": 1.0, "Q": -1.0, "n": -1.0}, 1 / tau, alike, (1.0, 1.01), any_row, True)
    if not product:
        powers = {"E": 1.0, "U": -1.0, "I": -1.0}
        add("electrical power over voltage x current", powers, 1.0, (0.85, 1.15), (1.0, 1.05), any_row, True)
    add("thrust over (efficacy x electrical power)", {"T": 1.0, "H": -1.0, **minus}, 1.0, near, close, any_row, True)
    add("thrust over (efficacy x shaft power)", {"T": 1.0, "G": -1.0, "P": -1.0}, 1.0, near, close, any_row, True)
    add("one speed over the other", {"n": 1.0, "n2": -1.0}, 1.0, (0.95, 1.05), (1.0, 1.01), any_row, True)
    add("CT", {"T": 1.0, "n": -2.0, "D": -4.0}, 1 / rho, (0.015, 2.0 if duct else 0.42), (0.11, 1.4))
    CQ = (1e-3, 0.3 if duct else 0.06)
    add("CQ", {"Q": 1.0, "n": -2.0, "D": -5.0}, 1 / rho, CQ, (0.009, 1.7))
    add("CQ from shaft power", {"P": 1.0, "n": -3.0, "D": -5.0}, 1 / (tau * rho), CQ, (0.009, 1.7))
    add("torque over thrust x diameter", {"Q": 1.0, "T": -1.0, "D": -1.0}, 1.0, (0.025, 0.4), (0.08, 1.4))
    disk = 0.5 * math.pi * rho  # 2 rho A over the square of the diameter
    most = math.sqrt(2.0 * 1.3) if duct else 1.05
    # without a diameter the one that makes CT = 0.1 stands in; at rest it enters with the fourth root only
    rows, V = _merit_rows(facts, still)

    def add_merit(words: str, power: Mapping[str, float], scale: float, low: float, guessed: float,
                  usual: tuple[float, float]) -> None:  # fmt: skip
        if not {"T", *power} <= q.keys() or not q.keys() & {"D", "n"}:
            return
        known = "D" in q
        square = q["D"] ** 2 if known else np.sqrt(q["T"] / (0.1 * rho)) / q["n"]
        w = np.hypot(0.5 * V, np.sqrt(q["T"] / (disk * square)))
        share = ((w - 0.5 * V) / w)[rows]
        e = 0.5 * float(np.nanmedian(share)) if np.any(np.isfinite(share)) else 0.5
        powers = {"T": 1.0 + e, "D": -2.0 * e} if known else {"T": 1.0 + 0.5 * e, "n": e}
        powers = {k: powers.get(k, 0.0) - power.get(k, 0.0) for k in (*powers, *power)}
        merit = scale * q["T"] * (0.5 * V + w) / math.prod(q[k] ** p for k, p in power.items())
        merit_of = "figure of merit" if rows is still else "ideal power in flight over that"
        name = f"{merit_of} from {words}" + ("" if known else ", diameter guessed by CT = 0.1")
        per_unit = merit / math.prod(q[k] ** p for k, p in powers.items())
        centre = usual[0] * (_IN_FLIGHT if rows is not still else 1.0)
        add(name, powers, per_unit, (low, most if known else guessed), (centre, usual[1]), rows)

    guessed = 2.4 if duct else 1.4
    add_merit("torque x speed", shaft, 1 / tau, 0.11, guessed, (0.5, 1.4))
    add_merit("shaft power", {"P": 1.0}, 1.0, 0.11, guessed, (0.5, 1.4))
    electrical = {k: -p for k, p in minus.items()}
    add_merit("electrical power", electrical, 1.0, 0.02, 2.0 if duct else 1.2, (0.33, 1.8))
    add("torque x speed over electrical power", {**shaft, **minus}, tau, (0.02, 1.05), (0.6, 1.5), any_row)
    add("shaft power over electrical power", {"P": 1.0, **minus}, 1.0, (0.02, 1.05), (0.6, 1.5), any_row)
    add("tip Mach number", {"n": 1.0, "D": 1.0}, math.pi / 343.0, (0.02, 1.1), (0.3, 2.0), any_row)
    add("speed [rev/min]", {"n": 1.0}, 60.0, (150.0, 3e5), (8000.0, 3.0), any_row)
    add("speed over voltage [rev/min/V]", {"n": 1.0, "U": -1.0}, 60.0, (20.0, MOST_RPM_PER_V), (700.0, 3.0), any_row)
    add("supply voltage [V]", {"U": 1.0}, 1.0, (0.5, 1000.0), (15.0, 3.0), any_row)
    if "p" in q and "D" in q and not duct:
        low, high = empirical.D_OVER_P_USABLE
        usable = (low * q["p"] <= q["D"]) & (q["D"] <= high * q["p"])
        D, pitch = (np.where(usable, q[k], 1.0) for k in ("D", "p"))
        model = np.asarray(empirical.thrust(D, pitch, 60.0, 0.0, rho), dtype=float)  # at 1 rev/s
        scale = np.where(usable, D**3.5 / model, np.nan)
        add("thrust over that of the K1/K2 formula", {"T": 1.0, "n": -2.0, "D": -3.5}, scale, (0.35, 2.5), (1.0, 1.25))
    return out


def _told(q: str, facts: Facts) -> str:
    if q in _QUANTITY:
        return facts.named(_QUANTITY[q])
    if q == "n2":
        return "electrical_rpm" if facts.named("rpm") == "optical_rpm" else "optical_rpm"
    return {"D": "diameter_m", "H": "efficacy_N_W", "G": "propeller_mech_efficiency_N_W"}.get(q, q)


def _repairs(known: list[Relation], facts: Facts) -> list[tuple[float, Slip]]:
    """Slips that repair all that is broken and break nothing else, with what they leave; best first."""
    broken = [r for r in known if r.broken]
    quantities = {q for r in known for q in r.powers}
    two_speeds = any("n2" in r.powers for r in broken)
    fits: list[tuple[float, Slip]] = []
    for slip in slips() if broken else ():
        if slip.quantity not in quantities or (slip.id == MISCOUNT and not two_speeds):
            continue  # some ratio of small numbers is near any factor
        shift = {slip.quantity: slip.factor}
        if all(r.holds(shift) for r in known if r in broken or slip.quantity in r.powers):
            fits.append((sum(r.distance(shift) for r in known) + slip.rarity, slip))
    return sorted(fits, key=lambda fit: fit[0])


@check_for("slips")
def find_slips(facts: Facts) -> Iterator[Finding]:
    """Name the slip of a unit that repairs what does not fit together."""
    if facts.bare:
        return
    facts = facts.sampled()
    known = relations(facts)
    broken = [r for r in known if r.broken]
    share = _electrical(facts, broken)
    if not broken and share is None:
        return
    fits = _repairs(known, facts)
    if share is not None:
        yield _power_electrical(share, [slip for _, slip in fits[:1]], facts)
        return
    evidence = "; ".join(f"{r.name} is {r.value:.4g}, must be {r.due}" for r in broken[:4])
    certain = any(r.exact for r in broken)
    if not fits:
        channels = sorted({_told(q, facts) for r in broken for q in r.powers if q in _QUANTITY or q == "D"})
        text = "no single unit error explains it: check " + ", ".join(channels)
        yield Finding("inconsistent", "+".join(channels), evidence, text, (), "warning")
        return
    best, slip = fits[0]
    others = [s for score, s in fits[1:] if score - best < ALIKE]
    words = f"{_told(slip.quantity, facts)}: {slip.words}"
    if others:
        words += ". Fits as well: " + "; ".join(_listed(others, facts))
    yield Finding(slip.id, _told(slip.quantity, facts), evidence, words, (), "error" if certain else "warning")


def _power_electrical(share: tuple[float, float, float], slips: Sequence[Slip], facts: Facts) -> Finding:
    """A power of which that of the shaft is a share; `slips` name what it would be as power of the shaft."""
    low, middle, high = share
    text = f"torque x speed is {middle:.3g} of it ({low:.3g} to {high:.3g} under load), "
    fix = "is it electrical power? Then name the column electrical_power_W"
    fix += "".join(f". If it is power of the shaft: {_told(s.quantity, facts)}: {s.words}" for s in slips)
    text += "as the efficiency of a motor would be"
    return Finding("power_electrical", facts.named("power_W"), text, fix, (), "warning")


def _electrical(facts: Facts, broken: list[Relation]) -> tuple[float, float, float] | None:
    """Share of a power that torque x speed is, when it can be that of a motor: low, middle, high; else None.

    A unit is one number to the last digit; an efficiency goes with the load, or scatters as sensors do.
    """
    q = _quantities(facts)
    if facts.named("power_W") not in ("power_W", "P_W") or not {"P", "Q", "n"} <= q.keys():
        return None
    if any("P" not in r.powers for r in broken):
        return None  # something else is wrong, and may be the reason
    ratio = (2.0 * math.pi * q["Q"] * q["n"] / q["P"])[facts.loaded]
    battery = (q["P"] / q["E"])[facts.loaded] if "E" in q else np.ones(1)
    ratio, battery = ratio[np.isfinite(ratio)], battery[np.isfinite(battery)]
    if ratio.size < 3 or (battery.size and abs(float(np.median(battery)) - 1.0) > 0.1):
        return None
    low, middle, high = (float(x) for x in np.percentile(ratio, [20.0, 50.0, 80.0]))
    if not (MOTOR_EFFICIENCY[0] <= low and high <= MOTOR_EFFICIENCY[1]):
        return None
    digits = float(np.median(np.abs(ratio / middle - 1.0))) < SAME_DIGITS
    repairs = {"Q": 1.0 / middle, "n": 1.0 / middle, "P": middle}
    units = (s for s in slips() if s.quantity in repairs and s.id != MISCOUNT)
    if digits and any(abs(s.factor / repairs[s.quantity] - 1.0) < 0.005 for s in units):
        return None
    return low, middle, high


def _listed(others: list[Slip], facts: Facts) -> list[str]:
    """Alternatives in words; pole pairs as one range."""
    poles = sorted(round(1 / s.factor) for s in others if s.id == ELECTRICAL)
    out = [f"{_told(s.quantity, facts)}: {s.words}" for s in others if s.id != ELECTRICAL][:5]
    if poles:
        span = f"{poles[0]}" if len(poles) == 1 else f"{poles[0]} to {poles[-1]}"
        out.insert(0, f"{_told('n', facts)}: electrical revolutions over {span} pole pairs")
    return out


# A recording in other units than its companions, found by its level: readings over what the same model gives.
#
# One recording alone shows a slip of a unit only where it leaves the windows of `slips`. Beside others
# of the same rotor, or of rotors with models of their own, its level does: what they share, the error of the model
# included, drops out, and what is left is one factor. A mixture of units otherwise looks like physics, since the levels
# of the recordings then go with whatever else differs between them.
TOGETHER, FAR, NEAR = 0.35, math.log(2.0), 0.25
"""Logarithms of ratios: within which levels agree, from which they differ, within which a difference is a slip's."""
SPREADS = 3.0
"""Spreads of the companions that a slip is away from them at least."""
_SIGMA, _COMMON = 0.1, 1.0
_LOADS = {"thrust_N": "T", "torque_Nm": "Q"}


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
    for channel in _LOADS:
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
                     for (c, q), o in zip(_LOADS.items(), mine.values(), strict=True)}  # fmt: skip
            if speed:
                text = f"{_evidence(odd)}, and so are those of torque_Nm"
                also = [", ".join(f"{c}: {s[0].words}" for c, s in units.items())] if all(units.values()) else []
                found[id(odd.level)] = (odd.level, Finding(speed[0].id, "rpm", text, _fix(odd, speed, also)))
            if speed or not all(units.values()):
                continue
        for channel, odd in mine.items():
            likely = _likely(_LOADS[channel], -odd.by)
            if likely:
                finding = Finding(likely[0].id, channel, _evidence(odd), _fix(odd, likely))
                found[id(odd.level)] = (odd.level, finding)
    return list(filter(None, (found.get(id(v)) for v in levels)))


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
    names = some((w.name for w in odd.rest), 3)
    agree = f", which agree within {math.expm1(max(odd.spread, 0.01)):.0%}" if len(odd.rest) > 1 else ""
    return f"readings over what the case gives are {math.exp(odd.by):.4g} times those of {names}{agree}"


def _fix(odd: _Odd, likely: Sequence[Slip], also: Sequence[str] = ()) -> str:
    others = [*(s.words for s in likely[1:]), *also]
    fix = likely[0].words + (". Fits as well: " + "; ".join(others) if others else "")
    return fix + (f". Or {odd.rest[0].name} is the one in a different unit" if len(odd.rest) == 1 else "")
