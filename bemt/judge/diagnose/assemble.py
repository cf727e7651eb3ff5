"""Recordings and cases become a problem: baselines solved, noise and nuisances worked out, the blade calibrated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.data.recordings.slips import Level, outlier_runs
from bemt.judge.compare.matched import SESSION, like_volts, losses_differ
from bemt.judge.diagnose import repeats
from bemt.judge.diagnose.blade import PLAIN, CalibratedBlade, calibrated, prior_of
from bemt.judge.diagnose.noise import in_time, loading
from bemt.judge.diagnose.nuisance import nuisances
from bemt.judge.diagnose.problem import Part, Problem, SpeedCurve
from bemt.judge.diagnose.record import CHANNELS, POWER_OPEN, Record, concatenated, dense, merged, owners
from bemt.physics import coefficients as co
from bemt.physics.bem import model as bem
from bemt.physics.bem.solver import below_tables
from bemt.physics.effects.base import Effect
from bemt.rotors.case.prepare import k1k2_case, prepare_case
from bemt.rotors.case.propagate import validity_of
from bemt.rotors.validity import counted

if TYPE_CHECKING:
    from bemt.judge.diagnose.problem import Problem
    from bemt.rotors.case import Case

_STATIONS = 16
_FEWEST = 3
# Share of the largest load coefficient from which on a reading shows the level of its recording.
_LOADED = 0.3
# No slip of units is larger, and numbers beyond it are beyond floating point.
_FARTHEST = 1e6
_U_DEFAULT = 0.01
_U_RPM = 0.003
_U_FLOOR = 0.002


def _part(record: Record, case: Case, baseline: str) -> Part:
    model = prepare_case(case, None, _STATIONS)
    R = model.rotor.R
    omega = record.rpm * np.pi / 30.0
    speed = np.hypot(omega * R, record.V)
    top = min(1.25, float(np.max(speed / record.air.a_sound)) * 1.12 + 0.03)
    reached = model.at_speeds(record.rpm, record.V, record.air)
    model = replace(reached, mach_max=top)
    plain = [e for e in model.effects if not bem.acts_on_points(e)]
    flow = bem.flow_of(model.prepared(plain), record.rpm, record.V, record.air, record.extra, model.chord75_m)
    part = Part(record, model, model.effects, flow, case.content_hash(), case.file.model.effects_off)
    if baseline == "bemt":
        return replace(part, as_built=case.as_built(counting_assumptions=False))
    thrust = k1k2_case(case, None, record.rpm, record.V, record.air).thrust_N
    nothing = np.full_like(thrust, np.nan)
    return replace(part, instead=np.concatenate([thrust if c == "thrust_N" else nothing for c in part.channels]))


def build(records: Sequence[Record], cases: Sequence[Case], baseline: str = "bemt") -> Problem:
    """Put recordings beside the baselines of their cases."""
    chosen = list(cases) * len(records) if len(cases) == 1 else list(cases)
    # recordings of one case share the errors of its model
    groups: dict[tuple[bool, str], tuple[Case, list[Record]]] = {}
    for r, c in zip(records, chosen, strict=True):
        groups.setdefault((r.reference, c.content_hash()), (c, []))[1].append(r)
    order = sorted(groups, key=lambda k: k[0])
    problem = assemble(_one_drive([_part(merged(groups[k][1]), groups[k][0], baseline) for k in order]))
    if problem.y.size < _FEWEST:
        got = f"{problem.y.size} with a converged baseline"
        raise InputError(Fault(records[0].name, "readings", got, f"{_FEWEST} or more"))
    for k, name in enumerate(CHANNELS):
        mine = problem.channel == k
        ratio = float(np.median(np.abs(problem.y[mine])) / np.median(np.abs(problem.f0[mine]))) if mine.any() else 1.0
        if not 1.0 / _FARTHEST < ratio < _FARTHEST:
            raise InputError(Fault(records[0].name, name, f"{ratio:.2g} times what the case gives",
                                   "readings of this rotor", "Wrong unit, or wrong case?"))  # fmt: skip
    odd = _between(problem, [groups[k][1] for k in order], records)
    problem, found = _calibrated(problem, [groups[k][0] for k in order])
    problem = _with_power(problem)
    outside: dict[str, list[str]] = {}
    for part, key in zip(problem.parts, order, strict=True):
        whose = "the reference" if part.record.reference else "the recording"
        for words in _outside(part, groups[key][0]):
            outside.setdefault(words, []).append(whose)
    same = (words for c in chosen for words in c.as_built().no_check) if baseline == "bemt" else ()
    validity = tuple(_of(" and ".join(dict.fromkeys(whose)), words) for words, whose in outside.items())
    return replace(problem, between=(*odd, *found), validity=validity, no_check=tuple(dict.fromkeys(same)))


def _of(whose: str, words: str) -> str:
    """Say whose points a flag is about.

    >>> _of("the reference", "2 of 3 points: supersonic tip: Mach 1.09"), _of("the recording", "a duct")
    ('2 of 3 points of the reference: supersonic tip: Mach 1.09', 'the recording: a duct')
    """
    count, points, rest = words.partition(" points: ")
    return f"{count} points of {whose}: {rest}" if points else f"{whose}: {words}"


def _outside(part: Part, case: Case) -> tuple[str, ...]:
    """Where a recording leaves what the solver was measured against."""
    if part.instead is not None:  # K1/K2
        return ()
    flow = part.flow
    n, D = flow.n, 2.0 * flow.R
    Re = np.asarray(co.Re75(flow.chord, n, D, flow.V, flow.rho, flow.mu))
    J, M_tip = np.asarray(co.J(flow.V, n, D)), np.asarray(co.M_tip(n, D, flow.a_sound))
    prep = part.model.prep
    held = np.where(Re < prep.Re_bottom, below_tables(prep), "")
    return counted(
        [(*filter(None, [own]), *flags) for own, flags in zip(held, validity_of(case, J, Re, M_tip)[1], strict=True)]
    )


def _one_drive(parts: Sequence[Part]) -> tuple[Part, ...]:
    """Parts whose speed and voltage over pulse width are measured against the references', where these show them."""
    turning = [p for p in parts if "rpm" in p.channels]
    shown = [p.record for p in turning if p.record.reference]
    join = np.concatenate
    curve = None
    if shown:
        curve = SpeedCurve.of(join([r.extra["pwm_s"] for r in shown]), join([r.measured["rpm"] for r in shown]))

    def driven(p: Part) -> Part:
        extra = {**p.flow.extra, **_usual_voltage(shown or [p.record], p.record)}
        return replace(p, drive=curve, flow=replace(p.flow, extra=extra))

    return tuple(driven(p) if "rpm" in p.channels else p for p in parts)


def _usual_voltage(shown: Sequence[Record], record: Record) -> dict[str, Array]:
    """Voltage that belongs to the speed over pulse width of some recordings, at the pulse widths of one."""
    if not all("voltage_V" in r.extra for r in shown):
        return {}
    pulse, volts = (np.concatenate([r.extra[k] for r in shown]) for k in ("pwm_s", "voltage_V"))
    good, top = np.isfinite(volts), float(np.max(pulse))
    if not good.any():
        return {}
    degree = min(2, np.unique(np.round(pulse[good], 6)).size - 1)
    found = np.polynomial.polynomial.polyfit(pulse[good] / top, volts[good], degree)
    return {"usual_voltage_V": np.asarray(np.polynomial.polynomial.polyval(record.extra["pwm_s"] / top, found), float)}


def _calibrated(problem: Problem, cases: Sequence[Case]) -> tuple[Problem, tuple[str, ...]]:
    """Problem with the blade as its references show it, and findings."""
    refers = [p for p in problem.parts if p.record.reference]
    if not refers or len({p.key for p in problem.parts}) > 1 or any(p.instead is not None for p in problem.parts):
        return problem, ()
    blade, note, finding = calibrated(problem, prior_of(cases[0]))
    notes, found = (note,) if note else (), (f"{refers[0].record.name}: {finding}",) if finding else ()
    if blade is None:
        return replace(problem, notes=(*problem.notes, *notes)), found
    whole = assemble(tuple(_with_blade(p, blade.effect) for p in problem.parts), blade)
    return replace(whole, notes=(*whole.notes, *notes)), found


def _with_power(problem: Problem) -> Problem:
    """Problem with the torque that electrical power stands for, where reference and test show no other.

    The losses of motor and controller are what the reference shows of them over speed and advance ratio.
    """
    records = [p.record for p in problem.parts]
    known = next((p for p in problem.parts if p.record.reference), None)
    if known is None and any("electrical_power_W" in r.extra and "torque_Nm" not in r.measured for r in records):
        return replace(problem, notes=(*problem.notes, POWER_OPEN))
    if known is None or len(problem.parts) != 2 or any(p.instead is not None for p in problem.parts):
        return problem
    needs = {"electrical_power_W", "voltage_V"}
    if any("torque_Nm" in r.measured or not needs <= r.extra.keys() for r in records):
        return problem
    if not like_volts(*(float(np.median(r.extra["voltage_V"])) for r in records)):
        return problem
    losses = _losses(known)
    return problem if losses is None else assemble(tuple(_by_power(p, losses(p)) for p in problem.parts), problem.blade)


def _losses(known: Part) -> Callable[[Part], Array] | None:
    """Electrical power over that of the shaft as a reference shows it, at the points of a part; None: it does not."""
    flow, power = known.flow, known.record.extra["electrical_power_W"]
    good = (flow.Q0 > 0.0) & (power > 0.0)
    if np.count_nonzero(good) < _FEWEST:
        return None
    low, high = np.log(flow.rpm[good].min()), np.log(flow.rpm[good].max())

    def columns(p: Part) -> Array:
        x = (np.clip(np.log(p.flow.rpm), low, high) - low) / max(high - low, 1e-6)
        return np.stack([np.ones_like(x), x, x**2, p.flow.J], axis=1)

    y = np.log(power[good] / (flow.omega * flow.Q0)[good])
    found = np.linalg.lstsq(columns(known)[good], y, rcond=1e-6)[0]
    return lambda p: np.asarray(np.exp(columns(p) @ found))


def _by_power(part: Part, losses: Array) -> Part:
    """Part with a torque from its electrical power."""
    record = part.record
    torque = record.extra["electrical_power_W"] / (part.flow.omega * losses)
    size, usual = np.abs(torque), np.abs(part.flow.Q0)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = size * losses_differ(np.where((size > 0.0) & (usual > 0.0), np.log(size / usual), 0.0))
    note = "torque: not recorded; electrical power stands for it, losses as in the reference"
    told = replace(
        record, measured={**record.measured, "torque_Nm": torque}, u={**record.u, "torque_Nm": u},
        zero={**record.zero, "torque_Nm": SESSION["electrical"] * float(np.max(size))}, electrical=True,
        notes=(*record.notes, note),
    )  # fmt: skip
    return replace(part, record=told, _solved={})


def _with_blade(part: Part, blade: Effect) -> Part:
    """Part whose baseline has another blade."""
    baseline, old = part.turned(blade), part.flow
    plain = [e for e in baseline if not bem.acts_on_points(e)]
    flow = bem.flow_of(
        part.model.prepared(plain), part.record.rpm, part.record.V, part.record.air, old.extra, old.chord
    )
    return replace(part, baseline=baseline, flow=flow, _solved={})


def _between(problem: Problem, joined: Sequence[Sequence[Record]], records: Sequence[Record]) -> tuple[str, ...]:
    """Recordings in other units than their companions, by the level of their loads beside the baseline."""
    names = [r.name for r in records]
    label = {id(r): r.name if names.count(r.name) == 1 else f"{r.name} (recording {k})"
             for k, r in enumerate(records, 1)}  # fmt: skip
    unit = np.concatenate([p.flow.rho * p.flow.n**2 for p in problem.parts])[problem.point]
    owner = np.concatenate([owners(rs, p.record) for rs, p in zip(joined, problem.parts, strict=True)])[problem.point]
    size, levels = np.abs(problem.f0) / unit, []
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.log(np.abs(problem.y / problem.f0))
    for c, channel in enumerate(CHANNELS[:2]):
        for i, rs in enumerate(joined):
            same = np.array([p.key == problem.parts[i].key for p in problem.parts])[problem.part]
            alike = (problem.channel == c) & same
            if not alike.any():
                continue
            # where the load fades the ratio is that of two errors, and says nothing of the level
            loaded = alike & np.isfinite(off) & (size >= _LOADED * np.quantile(size[alike], 0.9))
            for k, r in enumerate(rs):
                mine = off[loaded & (problem.part == i) & (owner == k)]
                if mine.size >= _FEWEST:
                    low, mid, high = np.quantile(mine, [0.1, 0.5, 0.9])
                    levels.append(Level(label[id(r)], channel, float(mid), float(high - low) / 2.0))
    return tuple(f"{level.name}: {finding}" for level, finding in outlier_runs(levels))


def assemble(parts: tuple[Part, ...], blade: CalibratedBlade = PLAIN, like: Problem | None = None) -> Problem:
    """Stack the readings of parts and add the nuisances; `like`: one part that these readings go on from.

    What goes on from others is as noisy as they are: computed readings beside them would look like scatter.
    """
    full = [p.predict(p.baseline) for p in parts]
    y = np.concatenate([np.concatenate([p.record.measured[c] for c in p.channels]) for p in parts])
    u = np.concatenate([np.concatenate([p.record.u[c] for c in p.channels]) for p in parts])
    f0 = np.concatenate(full)
    sizes = [len(p.record) for p in parts]
    first = np.cumsum([0, *sizes])
    channel = np.concatenate(
        [np.repeat([CHANNELS.index(c) for c in p.channels], n) for p, n in zip(parts, sizes, strict=True)]
    )
    # a stand goes on without the channels that it has no reading of
    read = np.isfinite(y) & (like is None or np.isin(channel, like.channel))
    kept = read & np.isfinite(f0)
    point = np.concatenate(
        [np.tile(np.arange(n) + f, len(p.channels)) for p, n, f in zip(parts, sizes, first, strict=False)]
    )
    part = np.repeat(np.arange(len(parts)), [len(p.channels) * n for p, n in zip(parts, sizes, strict=True)])
    notes = [f"{p.record.name}: {note}" for p in parts for note in p.record.notes]
    lost = int(read.sum() - kept.sum())
    if lost:
        notes.append(f"{lost} readings dropped: the baseline does not converge there")
    scale = np.concatenate([_scale(p) for p in parts])
    problem = Problem(
        parts, y[kept], f0[kept], u[kept], scale[kept], False, channel[kept], point[kept],
        part[kept], kept, _covariates(parts), np.zeros((int(kept.sum()), 0)), (), np.zeros(0, dtype=bool), tuple(notes),
        blade=blade, offset=np.zeros(int(kept.sum())),
    )  # fmt: skip
    problem = _with_noise(problem) if like is None else _as_noisy(problem, like)
    columns, names, own, offset = nuisances(problem)
    return replace(problem, tangents=columns, names=names, own=own, offset=offset)


def _as_noisy(problem: Problem, like: Problem) -> Problem:
    """Uncertainty of the readings that come first as it is, of the others the same share."""
    sigma = problem.u.copy()
    for c in np.unique(problem.channel):
        mine, known = problem.channel == c, like.channel == c
        new = np.abs(problem.y[mine][np.count_nonzero(known) :])
        share = np.median(like.u[known] / np.maximum(np.abs(like.y[known]), 1e-12))
        sigma[mine] = np.concatenate([like.u[known], share * new])
    return replace(problem, u=sigma, u_known=like.u_known, scatter=like.scatter)


def _with_noise(problem: Problem) -> Problem:
    """Uncertainty of every reading: what is stated, what repeats show, else what stands usually have."""
    stated = np.where(np.isfinite(problem.u) & (problem.u > 0.0), problem.u, np.nan)
    full = np.zeros_like(problem.y)
    for i, p in enumerate(problem.parts):
        for c, name in enumerate(CHANNELS):
            full[(problem.part == i) & (problem.channel == c)] = p.full_scale.get(name, 0.0)
    tachometer = problem.channel == CHANNELS.index("rpm")
    usual = np.where(tachometer, _U_RPM * problem.y, np.hypot(_U_DEFAULT * problem.y, _U_FLOOR * full))
    sigma, known, notes = np.where(np.isfinite(stated), stated, usual), np.isfinite(stated), list(problem.notes)
    X, rows = problem.covariates, np.arange(problem.y.size)
    owner = np.concatenate([np.full(len(p.record), i) for i, p in enumerate(problem.parts)])
    lengths = (
        [X[k] for k in ("tip_gap_m", "wall_distance_m") if k in X]
        + [np.exp(X[k]) for k in ("sideslip_rad",) if k in X]
        + [100.0 + X[k] for k in ("second_rotor_rad_s",) if k in X]
    )
    label = repeats.conditions(X["rpm"], X["J"], X["density_kg_m3"], lengths, owner.astype(float))
    label[np.array([dense(p.record) for p in problem.parts])[owner]] = -1
    run, place = in_time(X)
    fell = loading(problem)[1] if "time_s" in X else np.zeros(problem.y.size)  # rows without a clock have no direction
    sided = (fell != 0.5) | np.all(fell == 0.5)  # the first reading of a run has no history
    shares: dict[str, float] = {}
    for c, name in enumerate(CHANNELS[:2]):
        mine = rows[(problem.channel == c) & (label[problem.point] >= 0) & sided]
        # readings that are those of the model to the last digit are a plan, not a measurement
        if not np.any(np.abs(problem.residual[mine]) > 1e-9 * full[mine]):
            continue
        points, size = problem.point[mine], np.where(problem.y[mine] < 0, -1.0, 1.0) * problem.scale[mine]
        fixed = repeats.projected_out(label[points], size, problem.f0[mine], full[mine], run[points], place[points],
                                       fell[mine])  # fmt: skip
        told = np.where(known[mine], sigma[mine], 0.0) if known[mine].any() else None
        found = repeats.noise_sizes(problem.residual[mine], problem.y[mine], full[mine], fixed, told)
        if found is None or not any(found[:2]):
            continue
        a, b, dof = found
        every = problem.channel == c
        seen = np.hypot(a * problem.y[every], b * full[every])
        sigma[every] = np.where(known[every], np.hypot(sigma[every], seen), seen)
        known = known | every
        shares[name] = float(np.median(seen / np.maximum(np.abs(problem.y[every]), 1e-12)))
        beside = " in addition to the stated uncertainty" if told is not None else ""
        notes.append(f"{name}: {dof} repeats scatter by {a:.2%} of the reading and {b:.2%} of full scale{beside}")
    return replace(problem, u=sigma, u_known=bool(known.mean() > 0.5), notes=tuple(notes), scatter=shares)


def _scale(part: Part) -> Array:
    """Size of each reading that relative errors refer to: it does not vanish where the load does."""
    f, out = part.flow, []
    unit = {"thrust_N": f.rho * f.n**2, "torque_Nm": f.rho * f.n**2}
    for c in part.channels:
        y = part.record.measured[c]
        if c == "rpm":
            out.append(np.abs(part.steady_rpm))
        else:
            coefficient = np.abs(y / unit[c])
            coefficient = coefficient[np.isfinite(coefficient)]
            # where nearly all readings are 0 the largest stands for the size
            size = np.quantile(coefficient, 0.9) or np.max(coefficient) if coefficient.size else np.nan
            out.append(unit[c] * float(size))
    return np.concatenate(out)


def _covariates(parts: Sequence[Part]) -> dict[str, Array]:
    def join(f: Callable[[Part], Array]) -> Array:
        return np.concatenate([f(p) for p in parts])

    def turns(p: Part) -> Array:
        """Speed as a variable: where it is what was measured, that of the drive, or its own noise would follow it."""
        driven = p.steady_rpm if p.channels == CHANNELS[2:] else p.flow.rpm
        return np.where(np.isfinite(driven), driven, p.flow.rpm)

    found = {
        "rpm": join(turns),
        "J": join(lambda p: p.flow.J * p.flow.rpm / turns(p)),
        "M_tip": join(lambda p: p.flow.M_tip),
        "Re": join(
            lambda p: p.flow.rho * p.flow.chord * np.hypot(0.75 * p.flow.omega * p.flow.R, p.flow.V) / p.flow.mu
        ),
        "density_kg_m3": join(lambda p: p.flow.rho),
    }
    return found | concatenated([p.record for p in parts])
