"""What changed between two recordings of one stand: ratios at equal speed, and the causes that scale like that.

No case and no blade is needed. What is not recorded is assumed to be equal in both, and said.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, refuse
from bemt.base.tables import number_of, some
from bemt.base.units import ZERO_CELSIUS
from bemt.data.recordings import cfd_setup
from bemt.judge.compare import drive_laws, matched
from bemt.judge.compare import smooth_change as fits
from bemt.judge.compare.drive_laws import Judgement, Load
from bemt.judge.compare.matched import LOADS, MatchedChannel, StandRun, advance, density_change
from bemt.judge.compare.sentences import words_of_left_out
from bemt.judge.explanation import CHANGED, NONE, Size
from bemt.judge.loss import SECOND, Decision, decide, joined, parts

REVERSED = "thrust has the other sign in B, and its size is the same"
"""Verdict of a reversed cell, or of a rotor that is mounted or turns the other way round."""
AS_RECORDED = ("density as recorded", "by the thermometers")
"""Starts of the reason of a density that both files state."""
VOLTS_AS_RECORDED = "voltage as recorded"
"""Start of the reason of a voltage that both files state."""
ERROR_IN = ("error in ", "warning in ")
"""Start of a note on what cannot be so in A or B."""
# Recorded densities are this good: a barometer, a thermometer and nobody's humidity, share.
_TOLD_DENSITY, _SURE = 0.012, 2.0
# Torque follows thrust, where that alone is known, to this share of its change (declared).
_BY_THRUST = 0.5
NO_VERDICT = Judgement("insufficient", (), NONE, math.nan, "not recorded in both")
"""Of what was not recorded in both."""
_WIDE = 1.4
# Thrust of a propeller of 2.3 times the diameter at one speed: no stand takes both. [1]
_FAR_OFF = 30.0
# Share of misread speeds from which the sensor is doubtful, and from which the others are no good either.
_DOUBTFUL, _NOISE = 0.05, 0.3
# Difference of the mean advance ratios, share of the largest, from which the drive has another load.
_OTHER_WIND = 0.1
NOTHING_SHARED = "the two runs have no common speed and advance ratio"
"""Reason where every ratio would be one of two extrapolations."""
IN_WIND = "as in wind, and no airspeed is recorded"
"""End of the reason where one recording shows a wind that it does not state."""
ONLY_VOLTS = " voltage at equal electrical power"
"""End of the reason where thrust per watt is the same and the voltage is not."""
NO_SPEED = "without a speed a change of rotor, motor or scale looks the same"
"""Reason where thrust was compared at equal power or command."""
OTHER_STAND = "no change on one stand moves every load by this much: check units and speeds of both files"


@dataclass(frozen=True, eq=False)
class RunChange:
    """Outcome of a comparison of two recordings."""

    # Recordings
    a: StandRun
    b: StandRun
    diameter_m: float  # Of the rotor [m]; NaN: unknown
    channels: Mapping[str, MatchedChannel]  # What both recorded
    ratios: Mapping[str, fits.Ratio]  # B over A by channel
    rotor: fits.MatchedRuns
    behind: fits.MatchedRuns  # Motor, controller and battery
    judge: Callable[[RunChange], Judgement]  # Of the loads
    assumed: tuple[str, ...] = ()  # What neither recording says
    notes: tuple[str, ...] = field(default=())  # What was left out
    # What the user knows: effects that a check has ruled out, and that he changed
    gone: frozenset[str] = frozenset()
    told: frozenset[str] = frozenset()

    @cached_property
    def loads(self) -> Judgement:
        """Verdict on what acts on the rotor, worked out when it is asked for."""
        if not self.without_speed:
            return self.judge(self) if self.loads_by_name else NO_VERDICT
        # a cut blade takes less power, and gives as much thrust for it: at one command both are less
        P = min((drive_laws.weigh_factor(c, scatter) for c, scatter in self._bare), key=lambda P: P[NONE])
        said = decide(P)
        if said.leading == NONE and (volts := self._volts_at_power):
            said = replace(said, why=f"{volts}{ONLY_VOLTS}")
        return Judgement.of(replace(said, why=self.no_speed) if said.by == "files" else said, P)

    @property
    def _volts_at_power(self) -> str:
        """What the voltage of B differs by at equal electrical power, where it does and both tell; else ""."""
        runs = [run.points.values for run in (self.a, self.b)]
        if "at_power" not in self.rotor.channels or not all("voltage_V" in v for v in runs):
            return ""
        (P, V), (P_b, V_b) = (_by_power(v["electrical_power_W"], v["voltage_V"]) for v in runs)
        shared = P_b[(P_b >= P[0]) & (P_b <= P[-1])] if P.size and P_b.size else P[:0]
        if not shared.size:
            return ""
        moved = float(np.median(np.log(np.interp(shared, P_b, V_b) / np.interp(shared, P, V))))
        if abs(moved) < drive_laws.TOLD_VOLTAGE:
            return ""
        size = f"{100.0 * abs(math.expm1(moved)):.1f} % {'less' if moved < 0.0 else 'more'}"
        return f"the battery or supply of B gave {size}"

    @cached_property
    def _bare(self) -> list[tuple[MatchedChannel, fits.Scatter]]:
        """Thrust at what stands for the speed, with its scatter: at equal power, at equal command and known voltage."""
        runs, volts = [self.rotor], [r.points.values.get("voltage_V") for r in (self.a, self.b)]
        V = [float(np.nanmean(v)) for v in volts if v is not None]
        if "at_power" in self.rotor.channels and len(V) == 2 and abs(V[1] / V[0] - 1.0) < matched.SESSION["voltage"]:
            runs.append(fits.prepared(self.a, self.b, ("at_command",), self.diameter_m))
        return [(c, run.likelier[name]) for run in runs for name, c in run.channels.items()]

    @property
    def no_speed(self) -> str:
        """Why thrust that changed has no cause without a speed, with its change at each."""
        found = [fits.ratio_of(c, scatter) for c, scatter in self._bare]
        told = {f"{100.0 * (r.ratio - 1.0):+.1f} % at equal {matched.WITHOUT_SPEED[r.kind]}": None for r in found}
        return f"thrust {', '.join(told)}; {NO_SPEED}"

    @cached_property
    def drive(self) -> Judgement:
        """Verdict on motor, controller and battery, beside what follows from the load."""
        if not self.behind.channels:
            return NO_VERDICT
        if _unloaded(self.a, self.b, self.diameter_m):
            return replace(NO_VERDICT, why="the advance ratios differ, and the drive follows the load")
        weight = {i: CHANGED if i in self.told else 0.0 if i in self.gone else 1.0 for i in drive_laws.NAMES}
        scatters = self.behind.free, self.behind.steady
        P = drive_laws.weigh(self.behind.channels, scatters, self._load(self._miscount), weight)
        if not self._by_volts or self.gone & drive_laws.SUPPLY.ids:
            return drive_laws.judge_drive(P)
        # known from the files: what is left is whether something else changed as well
        ratio = math.exp(self._by_volts)
        said = drive_laws.judge_drive({k | drive_laws.SUPPLY: p * (1.0 if k == NONE else SECOND) for k, p in P.items()})
        if said.effects != tuple(drive_laws.SUPPLY):
            return said
        why = f"{VOLTS_AS_RECORDED}, {ratio - 1.0:+.1%} at equal command; the speed goes with it"
        return replace(said, parameters={"battery_sag": {"ratio": Size(ratio, ratio, ratio, "1")}}, why=why)

    @property
    def _by_volts(self) -> float:
        """Voltage of B over that of A at equal command where both tell and they differ, natural logarithm, else 0."""
        change = next((math.log(r.ratio) for r in self.ratios.values() if r.kind == "voltage"), 0.0)
        return change if "speed" in self.behind.channels and abs(change) >= drive_laws.TOLD_VOLTAGE else 0.0

    @property
    def _miscount(self) -> float:
        """What the speed of B reads over what it is, natural logarithm, if the loads say so."""
        said = self.loads.parameters.get("rpm_scale")
        return math.log(said["factor"].value * (1.0 + said["eps"].value)) if said else 0.0

    def told_by_drive(self, miscount: float = 0.0, misread: float = 0.0) -> float:
        """Log odds that speeds of B read exp(``miscount``) and torques exp(``misread``) times what they are [1].

        The drive takes them as they are: neither its speed at one command nor its electrical power knows of a cell.
        """
        at = {r.kind: (math.log(r.ratio), math.log(r.high68 / r.low68) / 2.0) for r in self.ratios.values()}
        drive: dict[str, tuple[float, float]] = {k: at[k] for k in ("speed", "electrical") if k in at}
        if not drive or (miscount and "speed" not in drive):
            return 0.0
        if misread and _unloaded(self.a, self.b, self.diameter_m):
            return 0.0
        volts = at["voltage"][0] if "voltage" in at else None
        read = self._load(miscount)
        loads = replace(read, change=read.change - misread), self._load(0.0)
        as_read, right = (drive_laws.log_density_of_ratios(drive, volts, load) for load in loads)
        return as_read - right

    def _load(self, miscount: float) -> Load:
        """How the load of the drive changed; where torque is not recorded, thrust tells it by half."""
        found = {r.kind: r for r in self.ratios.values() if r.kind in LOADS}
        r = found.get("torque", found.get("thrust"))
        if r is None:
            return Load(miscount=miscount)
        unsure, along = math.log(r.high68 / r.low68) / 2.0, np.log([point[2] for point in r.curve])
        varies = float(np.max(np.abs(along - math.log(r.ratio))))
        channel = next(c for c, one in self.ratios.items() if one is r)
        change = math.log(r.ratio) + matched.POWER_OF_SPEED.get(channel, 2.0) * miscount
        unsure = unsure if "torque" in found else math.hypot(unsure, _BY_THRUST * change)
        return Load(change, miscount, unsure, varies)

    @property
    def density_ratio(self) -> float:
        """Recorded density of B over that of A, by thermometers alone if need be; NaN unless both tell."""
        log_ratio, unsure = density_change(self.a, self.b)
        return math.exp(log_ratio) if unsure else self.b.density / self.a.density

    @property
    def without_speed(self) -> str:
        """What thrust is compared at, in words, where no speed is recorded; else ""."""
        return next((words for name, words in matched.WITHOUT_SPEED.items() if name in self.channels), "")

    @property
    def loads_by_name(self) -> dict[str, MatchedChannel]:
        """What acts on the rotor, by thrust and torque."""
        return {c.name: c for c in self.channels.values() if c.name in LOADS}

    @cached_property
    def leading(self) -> Judgement:
        """Verdict on both: loads at the measured speed, the drive at one command."""
        if not self.drive.ranked or not self.loads.ranked:
            return self.loads if self.loads.ranked or not self.drive.effects else self.drive
        P, Q = parts(self.loads.ranked, self.drive.ranked)
        loads, drive = self.with_density(decide(P)).reasoned_as(self.loads), decide(Q).reasoned_as(self.drive)
        said = joined(loads, drive, P.get(NONE, 0.0))
        P = {"drive": Q, "both": P | Q}.get(said.by, P)
        sizes = {**self.loads.parameters, **self.drive.parameters}
        return Judgement.of(said, P, sizes, self.loads.full_scale, self.loads.sizes)

    def with_density(self, said: Decision) -> Decision:
        """The recorded densities as the cause where nothing else is one."""
        if said.verdict != "none" or not self.by_density:
            return said
        return replace(said, verdict="named", effects=("air_density",), why=self.by_density, sets=(("air_density",),))

    @property
    def apart(self) -> bool:
        """Whether every ratio of a load would be one of two extrapolations."""
        loads = [r for r in self.ratios.values() if r.kind in LOADS]
        wide = (r.extrapolated and (r.apart or r.high95 / r.low95 > _WIDE) for r in loads)
        return bool(loads) and all(wide)

    @property
    def far_off(self) -> bool:
        """Whether loads differ by more than one stand can measure."""
        loads = [abs(math.log(r.ratio)) for r in self.ratios.values() if r.kind in LOADS]
        return min(loads, default=0.0) >= math.log(_FAR_OFF)

    @property
    def other_setup(self) -> str:
        """How B was computed otherwise than A, in words; "" where nothing says so."""
        return cfd_setup.other_setup(self.a.setup, self.b.setup)

    @property
    def wind(self) -> str:
        """Why the runs cannot be compared where one windmills, the other does not, and nobody says in what wind."""
        runs = (("A", self.a), ("B", self.b))
        zero = {letter: run.zero_thrust_rpm for letter, run in runs if math.isfinite(run.zero_thrust_rpm)}
        if len(zero) != 1:
            return ""
        ((letter, rpm),) = zero.items()
        return f"thrust of {letter} is negative below {rpm:.0f} rev/min, {IN_WIND}"

    @property
    def no_pair(self) -> str:
        """Why the runs cannot be compared; "" where they can."""
        other = f"computed otherwise: {self.other_setup}" if self.other_setup else ""
        return self.wind or (NOTHING_SHARED if self.apart else OTHER_STAND if self.far_off else other)

    @property
    def by_density(self) -> str:
        """Why the densities, where both recordings tell them and they differ, are a cause of their own."""
        size = max((abs(c.log_density) for c in self.loads_by_name.values()), default=0.0)
        unsure = density_change(self.a, self.b)[1]
        if size < max(_TOLD_DENSITY, _SURE * unsure):
            return ""
        if unsure:
            warm = f"{self.a.temperature_K - ZERO_CELSIUS:.1f} to {self.b.temperature_K - ZERO_CELSIUS:.1f} C"
            return f"{AS_RECORDED[1]}, {warm}, and one pressure; the coefficients agree"
        return f"{AS_RECORDED[0]}, {self.a.density:.4g} to {self.b.density:.4g} kg/m3; the coefficients agree"

    @property
    def by_proxy(self) -> bool:
        """Whether electrical power stands for torque, with the losses of the motor in it."""
        return any(c.channel == "electrical_power_W" for c in self.loads_by_name.values())

    @property
    def turned(self) -> bool:
        """Whether thrust has the other sign in B."""
        return any(c.turned for c in self.channels.values() if c.name == "thrust")


def _by_power(power_W: Array, volts: Array) -> tuple[Array, Array]:
    """Both where they are positive, in the order of the power."""
    good = (power_W > 0.0) & (volts > 0.0)
    order = np.argsort(power_W[good], kind="stable")
    return power_W[good][order], volts[good][order]


def changed(
    a: StandRun, b: StandRun, diameter_m: float, judge: Callable[[RunChange], Judgement], gone: Collection[str] = (),
    told: Collection[str] = (),
) -> RunChange:  # fmt: skip
    """Compare two recordings; ``judge`` says what acts on the rotor.

    Effects are ``gone`` that a check has ruled out; the user changed what he has ``told``.
    """
    diameter = next((d for d in (diameter_m, a.diameter_m, b.diameter_m) if math.isfinite(d)), math.nan)
    rotor = fits.prepared(a, b, tuple(LOADS), diameter)
    used = {c.channel for c in rotor.channels.values()}
    behind = fits.prepared(a, b, [k for k, names in matched.DRIVE.items() if not used & set(names)], diameter)
    for name in matched.WITHOUT_SPEED:
        if not rotor.channels and not behind.channels:
            rotor = fits.prepared(a, b, (name,), diameter)
    channels = {**rotor.channels, **behind.channels}
    if not channels:
        silent = [r for r in (a, b) if not {"rpm", "J"} & r.points.values.keys()]
        if silent:
            hint = "Head the column rpm, or record watts: thrust is compared at equal speed, power or throttle"
            expected = "a speed of rotation, J, electrical power or a throttle in both"
            raise InputError([Fault(r.points.name, "", _told(r), expected, hint) for r in silent])
        refuse(_not_converted(a, b, diameter))
        got, expected = f"{_told(a)} in A, {_told(b)} in B", "one load that both recorded at two or more speeds"
        hint = "Name units in the headings, or use a recording.toml"
        if single := [run for run in (a, b) if len(run) == 1]:
            hint = f"One point is no curve. Give two more, or `bemt compare {single[0].points.name} --case CASE`"
        raise InputError(Fault(f"{a.points.name}, {b.points.name}", "", got, expected, hint))
    scatter = {**rotor.likelier, **behind.likelier}
    ratios = {c.channel: fits.ratio_of(c, scatter[n]) for n, c in channels.items()}
    assumed = tuple(_assumed(a, b, diameter, rotor.channels))
    notes = tuple(_notes(a, b, channels, {**rotor.strays, **behind.strays}))
    return RunChange(a, b, diameter, channels, ratios, rotor, behind, judge, assumed, notes, frozenset(gone),
                     frozenset(told))  # fmt: skip


def _not_converted(a: StandRun, b: StandRun, diameter: float) -> list[Fault]:
    """What is missing to make coefficients of the loads of one recording, where the other holds coefficients."""
    coefficients, cells = {"CT", "CP", "CQ"}, {"thrust_N", "torque_Nm", "power_W"}
    runs = (("A", a), ("B", b))
    loads = [(n, r) for n, r in runs if cells & r.points.values.keys() and not coefficients & r.points.values.keys()]
    if len(loads) != 1 or not any(coefficients & r.points.values.keys() for _, r in runs):
        return []
    ((letter, run),) = loads
    missing = [
        words for open_, words in (
            ("rpm" not in run.points, f"the speed of rotation of {letter} (a column rpm)"),
            (math.isnan(diameter), "the diameter (--label 10x5, or --case CASE)"),
            (math.isnan(run.density), f"the air density of {letter} (--air-{letter.lower()} 22C,1013hPa)"),
        ) if open_
    ]  # fmt: skip
    got = f"loads in newtons in {letter}, coefficients in {'B' if letter == 'A' else 'A'}"
    expected = f"what CT = T / (rho n^2 D^4) needs: {' and '.join(missing)}"
    return [Fault(f"{a.points.name}, {b.points.name}", "", got, expected, "")] if missing else []


def _unloaded(a: StandRun, b: StandRun, diameter: float) -> bool:
    """Whether the rotor takes another load at one command because it meets another wind."""
    if not all("rpm" in run.points for run in (a, b)):
        return False
    one, two = (advance(run, diameter)[np.isfinite(run.points.rpm)] for run in (a, b))
    return bool(abs(np.median(two) - np.median(one)) > _OTHER_WIND * max(one.max(), two.max()))


def _told(run: StandRun) -> str:
    """Channels of a recording, how many points, and which of them are no measurement."""
    told = [
        k + ("" if np.nan_to_num(v).any() else " (all 0)")
        for k, v in run.points.values.items()
        if k not in ("run", "command")
    ]
    return f"{', '.join(told) or 'nothing'} at {len(run)} point{'s' if len(run) != 1 else ''}"


def _assumed(a: StandRun, b: StandRun, diameter: float, loads: Mapping[str, MatchedChannel]) -> list[str]:
    """What neither recording says, and how to say it."""
    runs, names = (("A", a), ("B", b)), [c.channel for c in loads.values()]
    unknown = [n for n, r in runs if not math.isfinite(r.density)]
    by_thermometer = bool(unknown) and bool(density_change(a, b)[1])
    still = [n for n, r in runs if not {"airspeed_m_s", "J"} & r.points.values.keys()]
    no_diameter = math.isnan(diameter) and not all("J" in r.points for _, r in runs)
    loads_known = {"thrust_N", "torque_Nm", "power_W"} & set(names) and not by_thermometer
    alike = [("equal air density", "22C,1013hPa", unknown if loads_known else []), ("still air", "18m/s", still)]
    told = [(words, how, letters) for words, how, letters in alike if letters]
    if len(told) == 2 and unknown == still:
        told = [("equal air density and still air", "22C,1013hPa,18m/s", still)]
    said = (
        (by_thermometer, "air pressure is not recorded in both: taken as equal within 1 %"),
        *((True, f"{words} in {' and '.join(letters)} (not recorded; state it as in --air-{letters[0].lower()} {how})")
          for words, how, letters in told),
        ("torque" not in loads and "thrust" in loads,
         "torque is not recorded in both: thrust alone cannot tell gain, air and blade apart"),
        ("electrical_power_W" in names,
         "torque is not recorded: electrical power replaces it, of one motor and controller"),
        ("at_power" in loads,
         "speed is not recorded in both: electrical power replaces it, of one motor and controller"),
        ("at_command" in loads,
         "speed is not recorded in both: the command replaces it, of one motor and controller at one voltage"),
        (no_diameter and any(c.advance_moves() for c in loads.values()),
         "no diameter: compared at equal advance per turn, V/n; --label 10x5 gives J"),
    )  # fmt: skip
    return [words for open_, words in said if open_]


def _notes(
    a: StandRun, b: StandRun, channels: Mapping[str, MatchedChannel], strays: Mapping[str, MatchedChannel]
) -> list[str]:  # fmt: skip
    other = cfd_setup.other_setup(a.setup, b.setup)
    out = [f"computed otherwise: {other}"] if other else []
    out += words_of_left_out([*channels.values()])
    out += [_misread(letter, run) for letter, run in (("A", a), ("B", b)) if run.misread[0]]
    out += [note for c in channels.values() for note in c.notes]
    out += [
        f"{number_of(c.y.size, 'reading')} of {c.channel} far from all others dropped: {some(_told_of(c), 3)}"
        for c in strays.values()
    ]
    for c in channels.values():
        low, high = c.common()
        if low > high and c.name in LOADS:
            gap = math.exp(low - high) - 1.0
            out.append(f"{c.channel}: no common speed, {gap:.0%} apart; extrapolated by the law of the speed")
    if a.command and b.command and a.command != b.command:
        out.append(f"different types of command ({a.command}, {b.command}): the drive is not compared")
    return list(dict.fromkeys([*out, *(f"A: {n}" for n in a.points.notes), *(f"B: {n}" for n in b.points.notes)]))


def _told_of(c: MatchedChannel) -> Iterator[str]:
    """Readings of a channel, each with where it was taken."""
    at = c.x[:, 0] if c.name in matched.OVER_COMMAND else np.exp(c.x[:, 0])
    power = 0.0 if c.name in matched.OVER_COMMAND else matched.POWER_OF_SPEED.get(c.channel, 0.0)
    size = np.exp(c.y + c.log_density * c.second) * at**power
    for v, x, J, second in zip(size, at, c.x[:, 1], c.second, strict=True):
        yield f"{v:.4g} at {x:.4g}{f' and advance {J:.2f}' if J else ''} in {'B' if second else 'A'}"


def _misread(letter: str, run: StandRun) -> str:
    """What is said of speeds that were left out."""
    n, total = run.misread
    words = f"rpm: {n} of {total} speeds of {letter} left out: no rotor can turn like that at such a command and load"
    if n > _NOISE * total:
        return f"{words}; the speed channel of {letter} is mostly noise, do not trust what is left"
    return words + (f"; check the speed sensor of {letter}" if n > _DOUBTFUL * total else "")
