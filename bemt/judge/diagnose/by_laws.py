"""Two recordings without a case: the same judge, with signatures from the laws of a rotor that its reference shows."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.judge import loss
from bemt.judge.compare import recordings
from bemt.judge.compare.drive_laws import Judgement
from bemt.judge.compare.matched import LOADS, MARGIN, SESSION, StandRun, density_change, like_voltage, losses_differ
from bemt.judge.compare.recordings import RunChange
from bemt.judge.compare.smooth_change import Scatter
from bemt.judge.diagnose import fit as fitting
from bemt.judge.diagnose import knowledge, posterior, signatures
from bemt.judge.diagnose.assemble import assemble
from bemt.judge.diagnose.law_rotor import BLADE_LAWS, LAWS, VARIANTS, CoefficientCurve, LawRotor, Laws, law_part
from bemt.judge.diagnose.problem import Part, Problem
from bemt.judge.diagnose.record import CHANNELS, STILL, Record, thinned
from bemt.judge.diagnose.signatures import Candidate
from bemt.judge.explanation import DOUBT, NONE, UNKNOWN, Explanation
from bemt.physics import effects
from bemt.physics.air import Air
from bemt.physics.bem.model import acts_on_rotor
from bemt.physics.dataset import Dataset
from bemt.rotors.model import air_of_points

MOST = 40
"""Points of a recording that are weighed; more are averaged with alike ones [1]."""
# Log odds below which nothing is counted.
_SHUT = -60.0
# What a cell reads at least, share of what it was: a logarithm needs something.
_LEAST_READ = 1e-3
# Speed below this share of the largest: a rotor that has just set off.
_STARTED = 0.15
_COVARIATES = ("time_s", "temperature_K", "tip_gap_m", "wall_distance_m", "second_rotor_rad_s", "run")
# Where nothing tells: density [kg/m3], diameter [m] and speed [rev/min] that coefficients are turned into loads with.
_RHO, _D, _RPM = 1.2, 0.25, 6000.0
_FEWEST = 4
_TOLD = 1e-3  # probability from which the size of an explanation is told
# At rest a coefficient below this share of the usual one is no reading of a turning rotor.
_NEAR_ZERO = 0.15
# Rows this many robust standard deviations off the curve through all of them are strays, and at least this share off.
_FAR, _FAR_SHARE, _STRAYS = 5.0, 0.05, 0.1


def law_effects() -> list[str]:
    """Effects whose signature needs no blade, and that steady points may show.

    >>> {"thrust_zero", "oblique_inflow", "propeller"} <= set(law_effects()), "stall_delay" in law_effects()
    (True, False)
    """
    return [
        i for i, cls in effects.catalogue().items()
        if cls.kind != "drive" and not cls.on_by_default and (i in BLADE_LAWS or not acts_on_rotor(cls()))
        and not cls.transient
    ]  # fmt: skip


def changed(
    a: StandRun, b: StandRun, diameter_m: float = math.nan, gone: Collection[str] = (), told: Collection[str] = ()
) -> RunChange:  # fmt: skip
    """Compare two recordings; what acts on the rotor is judged when it is asked for."""
    return recordings.changed(a, b, diameter_m, judged, gone, told)


def judged(pair: RunChange, only: Collection[str] | None = None) -> Judgement:
    """What changed the loads from A to B; ``only`` these effects."""
    with posterior.one_thread():
        found = weighed(pair, only)
        if found is None:
            return recordings.NO_VERDICT
        P = _factored(found, pair)
        said = loss.decide(P)
        leading = said.leading
        solved = said.effects and leading and all(i in found.spans for i in leading)
        parameters = fitting.refined(found, fitting.fit(found, leading))[1] if solved else {}
        likely = [k for k, p in P.items() if p > _TOLD and k.ids and all(i in found.spans for i in k)]
        sizes = {k: fitting.flat(k, fitting.intervals(found, k)) for k in likely}
    said = pair.with_density(said)
    if pair.turned and said.effects == ("unit_slip",):
        said = replace(said, why=recordings.REVERSED)
    elif said.verdict == "insufficient" and (why := pair.no_pair):
        said = replace(said, why=why)
    test = found.problem.parts[0]
    told = (k for k in test.channels if k not in test.record.unitless and not (k == "torque_Nm" and pair.by_proxy))
    return Judgement.of(said, P, parameters, {k: test.full_scale[k] for k in told}, sizes)


def _factored(found: posterior.Evidence, pair: RunChange) -> dict[Explanation, float]:
    """Posterior with what makes two recordings no pair: no common range, another stand, a wind that nobody states.

    A ratio of pole pairs moves the speeds apart itself, a unit the loads.
    """
    P = found.probability
    if pair.other_setup:
        P = knowledge.shared_with_files(P, {k for k in P if k.ids or k == UNKNOWN})
    if pair.by_proxy:  # the losses of a motor are something smooth that is no cause
        P = {**P, UNKNOWN: 0.0, DOUBT: P[UNKNOWN]}
    if pair.turned:  # nothing but the cell or the sense of rotation turns thrust round
        kept = {k: p for k, p in P.items() if "unit_slip" in k.ids}
        total = sum(kept.values())
        return {k: p / total for k, p in kept.items()} if total > 0.0 else P
    if not (pair.wind or pair.apart or pair.far_off):
        return P
    slips = set() if pair.wind else {"rpm_scale", "unit_slip"}
    kept = {k: p for k, p in P.items() if k.ids & slips or (pair.wind and k == NONE)}
    return {**kept, DOUBT: 1.0 - sum(kept.values())}


def weighed(pair: RunChange, only: Collection[str] | None = None) -> posterior.Evidence | None:
    """Explanations of what changed from A to B, weighed; None where nothing can be."""
    both = records_of(pair)
    if both is None:
        return None
    known, test = both

    def parts(laws: Laws) -> tuple[Part, ...]:
        rotor = LawRotor.of(known, pair.diameter_m, laws)
        return law_part(test, rotor), law_part(known, rotor)

    problem = replace(assemble(parts(LAWS)), variants=tuple(map(parts, VARIANTS)), told=pair.told)
    names = [i for i in law_effects() if (only is None or i in only) and i not in pair.gone]
    candidates, _ = signatures.candidates(problem, names)
    # what two thermometers leave open of the density counts as repeatability
    thermometers = density_change(pair.a, pair.b)[1]
    candidates = tuple(as_driven(c, pair, problem) for c in candidates if not (thermometers and c.id == "air_density"))
    return posterior.weigh(problem, knowledge.possible(problem, candidates))


def as_driven(candidate: Candidate, pair: RunChange, problem: Problem) -> Candidate:
    """Candidate with the odds of the drive, which knows neither what a speed is read as nor what a cell reads."""
    if effects.catalogue()[candidate.id].kind != "stand":
        return candidate
    cell = "torque" in {r.kind for r in pair.ratios.values()} and not pair.by_proxy
    here = (problem.channel == CHANNELS.index("torque_Nm")) & problem.free & (np.abs(problem.f0) > 0.0)
    read = np.ones(len(candidate.settings))  # what the cell reads over what it was [1]
    if cell and here.any():
        read += np.median(candidate.signatures[here] / problem.f0[here, None], axis=0)

    def told(setting: Mapping[str, Any], torque: float) -> float:
        if candidate.id == "rpm_scale" or setting.get("channel") == "rpm":
            return pair.told_by_drive(math.log(abs(setting["factor"]) * (1.0 + setting.get("eps", 0.0))))
        return pair.told_by_drive(misread=math.log(max(abs(torque), _LEAST_READ))) if torque != 1.0 else 0.0

    odds = [told(s, x) for s, x in zip(candidate.settings, read.tolist(), strict=True)]
    return replace(candidate, weight=candidate.weight * np.exp(np.maximum(odds, _SHUT)))


def records_of(pair: RunChange) -> tuple[Record, Record] | None:
    """Both recordings with the same channels, A as reference, in the air that both tell."""
    a, b, diameter_m = pair.a, pair.b, pair.diameter_m
    # what is near zero throughout has no scatter, and is no load
    channels = {q: c for q, c in _channels_of(a, b).items() if q.partition("_")[0] in pair.rotor.likelier}
    if not channels:
        return None
    log_ratio, unsure = density_change(a, b)
    apart = [r.session.get(c, 0.0) for r in (a, b) for c in channels.values()]
    apart += [SESSION["torque"], unsure]
    D = diameter_m if math.isfinite(diameter_m) else _D
    # what lags on the way up and down in one of them may be a zero of the other
    shift = {c: max(r.shift.get(c, 0.0) for r in (a, b)) for c in channels.values()}
    power = pair.ratios.get("electrical_power_W")
    losses = float(losses_differ(math.log(power.ratio) if power else 0.0))
    known, test = (
        _record(r, channels, D, rho, max(apart), reference, pair.rotor.likelier, shift, losses)
        for r, rho, reference in ((a, 1.0, True), (b, math.exp(log_ratio), False))
    )
    if known is None or test is None:
        return None
    known, test = (_without_strays(r, D) for r in (known, test))
    return thinned(known, MOST), thinned(_in_reach(test, known), MOST)


def _channels_of(a: StandRun, b: StandRun) -> dict[str, str]:
    """Channels that thrust and torque are read from in both; loads need a speed, coefficients none."""
    out = {}
    for name, quantity in (("thrust", "thrust_N"), ("torque", "torque_Nm")):
        known = [c for c in LOADS[name] if all(c in r.points and np.isfinite(r.points[c]).sum() >= 2 for r in (a, b))]
        c = next((c for c in known if c != "electrical_power_W" or like_voltage(a, b)), "")
        if c in ("CT", "CP", "CQ") or (c and all("rpm" in r.points for r in (a, b))):
            out[quantity] = c
    return out


def _in_reach(test: Record, known: Record) -> Record:
    """Points of the test where the reference was, with a margin; all where they share no range."""
    keep = np.ones(len(test), dtype=bool)
    for x, seen in ((np.log(test.rpm), np.log(known.rpm)), (test.V / test.rpm, known.V / known.rpm)):
        wider = MARGIN * max(float(np.ptp(seen)), 1e-12)
        inside = (x >= seen.min() - wider) & (x <= seen.max() + wider)
        if (keep & inside).sum() >= _FEWEST:
            keep &= inside
    return test.take(np.flatnonzero(keep))


def _record(
    run: StandRun, channels: dict[str, str], D: float, density: float, repeatability: float, reference: bool,
    scatter: Mapping[str, Scatter], shift: Mapping[str, float], losses: float,
) -> Record | None:  # fmt: skip
    points = run.points
    usual = {"rpm": _RPM, "density_kg_m3": np.nan, "airspeed_m_s": 0.0}
    rpm, rho, V = (np.asarray(points.values.get(k, np.full(len(run), v)), float) for k, v in usual.items())
    n, recorded, V = rpm / 60.0, math.isfinite(run.density), np.nan_to_num(V)
    rho = np.where(np.isfinite(rho), rho, run.density if recorded else _RHO * density)
    if "J" in points:
        V = np.nan_to_num(points.J) * n * D
    unit: dict[str, Array | float] = {
        "thrust_N": 1.0, "torque_Nm": 1.0, "power_W": 1.0 / (2.0 * np.pi * n),
        "electrical_power_W": 1.0 / (2.0 * np.pi * n), "CT": rho * n**2 * D**4,
        "CP": rho * n**2 * D**5 / (2.0 * np.pi), "CQ": rho * n**2 * D**5,
    }  # fmt: skip
    measured = {k: np.asarray(points[c] * unit[c], dtype=float) for k, c in channels.items()}
    if "torque_Nm" in measured:  # its sign is the sense of rotation
        measured["torque_Nm"] *= np.sign(np.nansum(measured["torque_Nm"])) or 1.0
    u, zero = _errors({c: (k, measured[k], unit[c]) for k, c in channels.items()}, points, scatter, shift, losses)
    good = np.isfinite(rpm) & (rpm > 0.0) & np.isfinite(rho)
    good &= np.any([np.isfinite(v) for v in measured.values()], axis=0)
    good &= rpm > _STARTED * float(np.max(rpm, where=good, initial=0.0))
    for v in measured.values():
        size = np.abs(v) / (rho * n**2)
        usual = np.nanquantile(np.where(good, size, np.nan), 0.9)
        v[(V <= STILL * n * D) & ~(size > _NEAR_ZERO * usual)] = np.nan
    good &= np.any([np.isfinite(v) for v in measured.values()], axis=0)
    if good.sum() < 2:
        return None
    air = Air.from_density(_RHO)
    fields = {"rho": rho, **{k: np.full(len(run), float(getattr(air, k))) for k in ("mu", "a_sound", "temperature_K")}}
    extra = {k: np.asarray(points[k], float) for k in _COVARIATES if k in points and np.isfinite(points[k][good]).all()}
    angle = _angle(points)
    if reference:  # its curves are over V cos(angle)
        V = V * np.cos(angle)
    elif np.any(angle != 0.0):
        extra["sideslip_rad"] = angle
    if "second_rotor_rad_s" in extra:  # what it changes is no scatter
        u = {k: np.full(len(run), np.nan) for k in u}
    record = Record(
        points.name, rpm, V, air_of_points(fields), measured, u, extra, {}, zero, recorded,
        reference=reference, repeatability=repeatability,
        electrical=channels.get("torque_Nm") == "electrical_power_W",
        unitless=frozenset(k for k, c in channels.items() if c in ("CT", "CP", "CQ")),
        computed=points.kind == "cfd" or bool(run.setup), setup=run.setup,
    )  # fmt: skip
    return record.take(np.flatnonzero(good))


def _errors(
    readings: Mapping[str, tuple[str, Array, Array | float]], points: Dataset, scatter: Mapping[str, Scatter],
    shift: Mapping[str, float], losses: float,
) -> tuple[dict[str, Array], dict[str, float]]:  # fmt: skip
    """Standard uncertainties of loads, and of their zeros; ``readings`` by channel with their unit."""
    u, zero = {}, {}
    for c, (k, y, unit) in readings.items():
        full, s = float(np.nanmax(np.abs(y))), scatter["thrust" if k == "thrust_N" else "torque"]
        stated = np.nan_to_num(np.asarray(points.u[c], float)) * np.abs(unit)
        u[k] = np.sqrt(stated**2 + (s.share * y) ** 2 + (s.floor * full) ** 2)
        if shift[c]:
            zero[k] = shift[c] * full
        if c == "electrical_power_W":  # a motor takes power without any load
            u[k], zero[k] = np.hypot(u[k], losses * y), max(zero.get(k, 0.0), SESSION["electrical"] * full)
    return u, zero


def _angle(points: Dataset) -> Array:
    """Angle between wind and shaft, (P,) [rad]; 0 where it is not recorded."""
    for name, unit in (("sideslip_rad", 1.0), ("sideslip_deg", math.pi / 180.0)):
        if name in points and np.isfinite(points[name]).all():
            return np.abs(points[name]) * unit
    return np.zeros(len(points))


def _without_strays(record: Record, D: float) -> Record:
    """Record without readings that all others of it contradict."""
    n = record.rpm / 60.0
    unit, J = np.asarray(record.air.rho) * n**2, record.V / (n * D)
    measured = {}
    for channel, v in record.measured.items():
        y = v / unit
        good = np.isfinite(y)
        off = np.where(good, y - CoefficientCurve.of(y, J, record.rpm, (-1.0, 0.0, 0.5))(J, record.rpm), 0.0)
        middle = float(np.median(off[good]))
        spread = 1.48 * float(np.median(np.abs(off[good] - middle)))
        far = np.abs(off - middle) > max(_FAR * spread, _FAR_SHARE * float(np.max(np.abs(y[good]))))
        measured[channel] = np.where(far, np.nan, v) if far.sum() <= _STRAYS * good.sum() else v
    kept = np.any([np.isfinite(v) for v in measured.values()], axis=0)
    return replace(record, measured=measured).take(np.flatnonzero(kept))
