"""What changed between two recordings of one stand: ratios at equal speed, and the causes that scale like that.

No case and no blade is needed. What is not recorded is assumed to be equal in both, and said.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.units import ZERO_CELSIUS
from bemt.compare import smooth_change as fits
from bemt.compare.matched import DRIVE, LOADS, MatchedChannel, advance, density_change
from bemt.compare.scaling import CLEAR, OWN_SHAPE, UNKNOWN, Judgement, judge, weigh
from bemt.compare.scaling_laws import law
from bemt.compare.smooth_change import Scatter
from bemt.compare.stand_run import StandRun

REVERSED = "thrust has the other sign in B, and its size is the same"
"""Verdict of a reversed cell, or of a rotor that is mounted or turns the other way round."""
ERROR_IN = "error in "
"""Start of a note on what cannot be so in A or B."""
# Recorded densities are this good: a barometer, a thermometer and nobody's humidity, share.
_TOLD_DENSITY, _BAROMETER, _SURE = 0.012, 0.004, 2.0
# A battery or supply: voltage that was read apart by more than this at equal command, share; loads that do not matter.
_TOLD_VOLTAGE, _FOLLOWS, _SAME_LOAD = 0.03, 0.3, 0.1
_NO_TALK = Judgement("insufficient", (), {}, {}, "not recorded in both")
_MOVED, _WIDE = 2.5, 1.4
# Thrust of a propeller of 2.3 times the diameter at one speed: no stand takes both. [1]
_FAR_OFF = 30.0
# Share of misread speeds from which the sensor is doubtful, and from which the others are no good either.
_DOUBTFUL, _NOISE = 0.05, 0.3
# Odds (ln) of any smooth change over one factor from which a load did not change by one.
_BENT = 3.0
# Difference of the mean advance ratios, share of the largest, from which the drive has another load.
_OTHER_WIND = 0.1
# Standard deviations, set-up included, from which a load has changed.
_CHANGED = 3.0
NOT_ALONE = "alone, which changed as well"
"""End of the reason where the likeliest cause is ruled out; what is left was unlikely beside it."""
NOTHING_SHARED = "the two runs have no common speed and advance ratio"
"""Reason where every ratio would be one of two extrapolations."""
IN_WIND = "as in wind, and no airspeed is recorded"
"""End of the reason where one recording shows a wind that it does not state."""
OTHER_STAND = "no change on one stand moves every load by this much: check units and speeds of both files"


@dataclass(frozen=True, eq=False)
class RunChange:
    """Outcome of a comparison of two recordings."""

    # Recordings
    a: StandRun
    b: StandRun
    diameter_m: float  # Of the rotor [m]; NaN: unknown
    channels: Mapping[str, MatchedChannel]  # What both recorded
    # B over A by channel: of :func:`bemt.compare.smooth_change.ratio_of`, and ``density_ratio``
    ratios: Mapping[str, Mapping[str, Any]]
    # Verdict on what acts on the rotor, and on motor, controller and battery
    loads: Judgement
    drive: Judgement
    assumed: tuple[str, ...] = ()  # What neither recording says
    notes: tuple[str, ...] = field(default=())  # What was left out

    @property
    def density_ratio(self) -> float:
        """Recorded density of B over that of A, by thermometers alone if need be; NaN unless both tell."""
        log_ratio, unsure = density_change(self.a, self.b)
        return math.exp(log_ratio) if unsure else self.b.density / self.a.density

    @property
    def loads_by_name(self) -> dict[str, MatchedChannel]:
        """What acts on the rotor, by thrust and torque."""
        return {c.name: c for c in self.channels.values() if c.name in LOADS}

    @property
    def leading(self) -> Judgement:
        """Verdict on the loads; that on the drive where the loads agree, or nearly, and the drive does not."""
        open_ = self.loads.verdict == "none" or (self.loads.verdict == "insufficient" and self.near)
        return self.drive if open_ and self.drive.effects else self.loads

    @property
    def near(self) -> bool:
        """Whether no load differs so much that the drive would follow it."""
        loads = [abs(math.log(r["ratio"])) for r in self.ratios.values() if r["kind"] in LOADS]
        return bool(loads) and max(loads) < _SAME_LOAD


def changed(a: StandRun, b: StandRun, diameter_m: float = math.nan) -> RunChange:
    """Compare two recordings."""
    told = [d for d in (diameter_m, a.diameter_m, b.diameter_m) if math.isfinite(d)]
    diameter = told[0] if told else math.nan
    rotor = fits.prepared(a, b, tuple(LOADS), diameter)
    loads = rotor.channels
    spoken = {c.channel for c in loads.values()}
    behind = fits.prepared(a, b, [k for k, names in DRIVE.items() if not spoken & set(names)], diameter)
    drive = behind.channels
    if not loads and not drive:
        silent = [r for r in (a, b) if not {"rpm", "J"} & r.points.values.keys()]
        if silent:
            hint = "Head the column rpm; nothing can be compared but at equal speed"
            expected = "a speed of rotation, or J"
            raise InputError([Fault(r.points.name, "", _told(r), expected, hint) for r in silent])
        got = f"{_told(a)} in A, {_told(b)} in B"
        raise InputError(
            Fault(
                f"{a.points.name}, {b.points.name}",
                "",
                got,
                "one load that both recorded at two or more speeds of rotation, above zero",
                "Name units in the headings, or use a recording.toml",
            )
        )
    told_density, unsure = density_change(a, b)
    known = math.hypot(_BAROMETER, unsure) if told_density or math.isfinite(a.density + b.density) else None
    scatter = {**rotor.likelier, **behind.likelier}
    ratios = {c.channel: _ratio(c, scatter[n]) for n, c in {**loads, **drive}.items()}
    verdict = _NO_TALK
    if loads:
        weighed = weigh(loads, (rotor.free, rotor.steady), ("air", "stand"), known, _speeds(ratios))
        largest = max(abs(math.log(r["ratio"])) for r in ratios.values() if r["kind"] in LOADS)
        if largest >= CLEAR and max(rotor.bent[n] for n in loads) < _BENT:
            weighed = (_by_factors(weighed[0]), weighed[1])
        verdict = judge(*weighed, largest)
        verdict = _far_off(_far_apart(_with_density(_by_proxy(verdict, loads), a, b, loads), ratios), ratios)
        verdict = _all_loads(verdict, loads, ratios)
        verdict = _wind(verdict, a, b)
        if verdict.verdict == "none" and any(c.turned for c in loads.values() if c.name == "thrust"):
            verdict = Judgement("sensor", ("unit_slip",), {"unit_slip": 1.0}, {}, REVERSED)
    found = RunChange(
        a,
        b,
        diameter,
        {**loads, **drive},
        ratios,
        verdict,
        _NO_TALK,
        tuple(_assumed(a, b, diameter, loads)),
        tuple(_notes(a, b, {**loads, **drive}, {**rotor.strays, **behind.strays})),
    )
    if drive and _unloaded(a, b, diameter):
        found = replace(found, drive=replace(_NO_TALK, why="the advance ratios differ, and the drive follows the load"))
    elif drive and (verdict.verdict == "none" or found.near):
        motor = judge(*weigh(drive, (behind.free, behind.steady), ("drive",)))
        found = replace(found, drive=_with_voltage(motor, ratios))
    elif drive:
        found = replace(
            found, drive=replace(_NO_TALK, why="the load changed or may have changed, and the drive follows it")
        )
    return found


def _unloaded(a: StandRun, b: StandRun, diameter: float) -> bool:
    """Whether the rotor takes another load at one command because it meets another wind."""
    if not all("rpm" in run.points for run in (a, b)):
        return False
    one, two = (advance(run, diameter)[np.isfinite(run.points["rpm"])] for run in (a, b))
    return bool(abs(np.median(two) - np.median(one)) > _OTHER_WIND * max(one.max(), two.max()))


def _with_voltage(said: Judgement, ratios: Mapping[str, Mapping[str, Any]]) -> Judgement:
    """The recorded voltages as the cause, where the speed at equal command goes with them and nothing else is left."""
    volts, speed = (
        next((math.log(r["ratio"]) for r in ratios.values() if r["kind"] == k), 0.0) for k in ("voltage", "speed")
    )
    follows = volts * speed > 0.0 and abs(speed) > _FOLLOWS * abs(volts)
    if not volts:
        return said
    if abs(volts) < _TOLD_VOLTAGE and said.effects == ("battery_sag",):
        why = f"speeds go with the recorded voltages, which are {math.expm1(volts):+.1%} apart"
        return replace(said, verdict="none", effects=(), why=why)
    if said.verdict not in ("none", "insufficient") or abs(volts) < _TOLD_VOLTAGE or not follows:
        return said
    why = f"voltage as recorded, {math.expm1(volts):+.1%} at equal command; the speed goes with it"
    probability = {"battery_sag": 1.0 - said.probability.get("unknown", 0.0)}
    left = {k: p for k, p in said.probability.items() if k not in ("none", "battery_sag")}
    return Judgement("named", ("battery_sag",), probability | left, {"battery_sag": (volts, 0.0)}, why)


def _by_proxy(said: Judgement, loads: Mapping[str, MatchedChannel]) -> Judgement:
    """No claim of something unlisted where electrical power stands for torque: the motor's losses are in it."""
    if said.verdict != "unknown" or "torque" not in loads or loads["torque"].channel != "electrical_power_W":
        return said
    return replace(
        said, verdict="insufficient", why="electrical power replaces torque and includes the losses of the motor"
    )


def _far_apart(said: Judgement, ratios: Mapping[str, Mapping[str, Any]]) -> Judgement:
    """No answer where the runs share no advance ratio or no speed, unless a ratio of pole pairs explains just that."""
    loads = [r for r in ratios.values() if r["kind"] in LOADS]
    wide = all(r["extrapolated"] and (r["apart"] or r["high95"] / r["low95"] > _WIDE) for r in loads)
    if not loads or not wide or said.effects == ("rpm_scale",):
        return said
    return Judgement("insufficient", (), said.probability, said.size, NOTHING_SHARED)


def _wind(said: Judgement, a: StandRun, b: StandRun) -> Judgement:
    """No answer where one of the runs windmills, the other does not, and nobody says in what wind."""
    zero = {letter: run.zero_thrust_rpm for letter, run in (("A", a), ("B", b)) if math.isfinite(run.zero_thrust_rpm)}
    if len(zero) != 1 or said.verdict == "none":
        return said
    ((letter, rpm),) = zero.items()
    why = f"thrust of {letter} is negative below {rpm:.0f} rev/min, {IN_WIND}"
    return Judgement("insufficient", (), said.probability, said.size, why)


def _far_off(said: Judgement, ratios: Mapping[str, Mapping[str, Any]]) -> Judgement:
    """No answer where loads differ by more than one stand can measure."""
    loads = [abs(math.log(r["ratio"])) for r in ratios.values() if r["kind"] in LOADS]
    if min(loads) < math.log(_FAR_OFF) or said.effects in (("rpm_scale",), ("unit_slip",)):
        return said
    return Judgement("insufficient", (), said.probability, said.size, OTHER_STAND)


def _by_factors(probability: Mapping[str, float]) -> dict[str, float]:
    """Probabilities where every load changed by one large factor: that is another propeller, and nothing unlisted."""
    if OWN_SHAPE not in probability:
        return dict(probability)
    moved = {OWN_SHAPE: probability[OWN_SHAPE] + probability[UNKNOWN], UNKNOWN: 0.0}
    return dict(sorted({**probability, **moved}.items(), key=lambda kv: -kv[1]))


def _all_loads(
    said: Judgement, loads: Mapping[str, MatchedChannel], ratios: Mapping[str, Mapping[str, Any]]
) -> Judgement:
    """No cause that leaves a load alone which has clearly changed; probabilities are those of the others then."""
    moved = _moved(said.effects)
    if not moved:
        return said
    changed_too = []
    for name, c in loads.items():
        r = ratios[c.channel]
        unsure = math.hypot(math.log(r["high95"] / r["ratio"]) / 1.96, c.session)
        if abs(math.log(r["ratio"])) > _CHANGED * unsure:
            changed_too.append(name)
    missed = next((name for name in changed_too if name not in moved), None)
    if missed is None:
        return said
    why = f"{' and '.join(said.effects)} would leave the {missed} {NOT_ALONE}"
    left = {k: p for k, p in said.probability.items() if not (of := _moved((k,))) or of.issuperset(changed_too)}
    total = sum(left.values())
    return Judgement("insufficient", (), {k: p / total for k, p in left.items()} if total else left, said.size, why)


def _moved(effects: Sequence[str]) -> set[str]:
    """Loads that effects move by their laws; empty where there is no law of one of them."""
    rows = [law(k) for k in effects]
    return set() if None in rows else {name for row in rows if row for _, term in row.terms for name in term}


def _speeds(ratios: Mapping[str, Mapping[str, Any]]) -> tuple[float, float] | None:
    """Logarithm of the speed of B over A at equal command, and its 95 % error."""
    found = next((r for r in ratios.values() if r["kind"] == "speed"), None)
    return None if found is None else (math.log(found["ratio"]), math.log(found["high95"] / found["ratio"]))


def _told(run: StandRun) -> str:
    """Channels of a recording, how many points, and which of them are no measurement."""
    told = [
        k + ("" if np.nan_to_num(v).any() else " (all 0)")
        for k, v in run.points.values.items()
        if k not in ("run", "command")
    ]
    return f"{', '.join(told) or 'nothing'} at {len(run)} point{'s' if len(run) != 1 else ''}"


def _ratio(c: MatchedChannel, s: Scatter) -> dict[str, Any]:
    out = dict(fits.ratio_of(c, s))
    out["kind"] = c.name
    out["density_ratio"] = math.exp(c.log_density)
    moved = abs(float(out.get("slope", 0.0))) / max(float(out.get("slope_error", math.inf)), 1e-9)
    along = abs(float(out.get("advance_slope", 0.0))) / max(float(out.get("advance_slope_error", math.inf)), 1e-9)
    out["depends_on"] = [n for n, z in (("speed", moved), ("advance", along)) if z > _MOVED]
    return out


def _with_density(said: Judgement, a: StandRun, b: StandRun, loads: Mapping[str, MatchedChannel]) -> Judgement:
    """The recorded densities as the cause, where nothing else is left."""
    size = max((abs(c.log_density) for c in loads.values()), default=0.0)
    log_ratio, unsure = density_change(a, b)
    if said.verdict != "none" or size < max(_TOLD_DENSITY, _SURE * unsure):
        return said
    why = f"density as recorded, {a.density:.4g} to {b.density:.4g} kg/m3; the coefficients agree"
    if unsure:
        why = (
            f"by the thermometers, {a.temperature_K - ZERO_CELSIUS:.1f} to {b.temperature_K - ZERO_CELSIUS:.1f} C, and "
            "one pressure; the coefficients agree"
        )
    probability = {
        "air_density": said.probability["none"],
        **{k: p for k, p in said.probability.items() if k not in ("none", "air_density")},
    }
    sizes = {"air_density": (log_ratio, unsure)}
    return Judgement("named", ("air_density",), probability, sizes, why)


def _assumed(a: StandRun, b: StandRun, diameter: float, loads: Mapping[str, MatchedChannel]) -> list[str]:
    out = []
    unknown = [n for n, r in (("A", a), ("B", b)) if not math.isfinite(r.density)]
    if unknown and density_change(a, b)[1]:
        out.append("air pressure is not recorded in both: taken as equal within 1 %")
    elif unknown and any(c.channel in ("thrust_N", "torque_Nm", "power_W") for c in loads.values()):
        how = " ".join(f"--air-{n.lower()} 22C,1013hPa" for n in unknown)
        out.append(f"air density is not recorded in {' and '.join(unknown)}: taken as equal; {how} states it")
    still = [n for n, r in (("A", a), ("B", b)) if not {"airspeed_m_s", "J"} & r.points.values.keys()]
    if still:
        how = " ".join(f"--air-{n.lower()} 18m/s" for n in still)
        out.append(
            f"airspeed is not recorded in {' and '.join(still)}: taken as still air; {how} states a wind"
            " (with the air: 22C,1013hPa,18m/s)"
        )
    if "torque" not in loads and "thrust" in loads:
        out.append("torque is not recorded in both: thrust alone cannot tell gain, air and blade apart")
    if "torque" in loads and loads["torque"].channel == "electrical_power_W":
        out.append(
            "torque is not recorded: electrical power replaces it, assuming the same motor and controller in both"
        )
    told = all("J" in r.points for r in (a, b))
    if not told and not math.isfinite(diameter) and any(c.advance_moves() for c in loads.values()):
        out.append("no diameter: compared at equal advance per turn, V/n; --label 10x5 gives J")
    return out


def _notes(a: StandRun, b: StandRun, channels: Mapping[str, MatchedChannel], strays: Mapping[str, int]) -> list[str]:
    out = [_misread(letter, run) for letter, run in (("A", a), ("B", b)) if run.misread[0]]
    out += [note for c in channels.values() for note in c.notes]
    out += [
        f"{n} reading{'s' if n > 1 else ''} of {channels[k].channel} far from all others dropped"
        for k, n in strays.items()
    ]
    for c in channels.values():
        low, high = c.common()
        if low > high and c.name in LOADS:
            gap = math.exp(low - high) - 1.0
            out.append(f"{c.channel}: no common speed, {gap:.0%} apart; extrapolated by the law of the speed")
    if a.command and b.command and a.command != b.command:
        out.append(f"different types of command ({a.command}, {b.command}): the drive is not compared")
    return list(dict.fromkeys([*out, *(f"A: {n}" for n in a.points.notes), *(f"B: {n}" for n in b.points.notes)]))


def _misread(letter: str, run: StandRun) -> str:
    """What is said of speeds that were left out."""
    n, total = run.misread
    words = f"rpm: {n} of {total} speeds of {letter} left out: no rotor can turn like that at such a command and load"
    if n > _NOISE * total:
        return f"{words}; the speed channel of {letter} is mostly noise, do not trust what is left"
    return words + (f"; check the speed sensor of {letter}" if n > _DOUBTFUL * total else "")
