"""Loads of CFD along the blade beside those of a rotor: where they part, and which one effect brings them together."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bemt.base import unit_errors
from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_text, speed_text
from bemt.data.readers import load_text, number, slices
from bemt.physics.air import Air
from bemt.physics.bem import solver
from bemt.physics.bem.model import Model, acts_on_points, acts_on_rotor
from bemt.physics.effects import catalogue, to_text
from bemt.physics.effects.base import Effect
from bemt.rotors.case.prepare import prepare_case

if TYPE_CHECKING:
    from bemt.judge.diagnose.record import Record
    from bemt.rotors.case import Case
    from geometry.rotor import Rotor

# Root and tip are left out: hubs are not modelled, and what the last percents of a blade carry no two codes agree on.
BANDS = np.linspace(0.40, 0.95, 6)
# An effect explains when it leaves at most this share of the squared misfit; those within this factor of the best are
# not told apart.
EXPLAINED, ALIKE = 0.3, 1.5
# Loads that agree this well on the average need no explanation: grids of such CFD are no better. What the recording
# states of its own uncertainty counts where it is larger.
FINE = 0.10
# Radius over the tip's up to which the slices of a rotor may reach; speeds that are one within this share.
BEYOND, ONE = 1.05, 2e-3
# What untwists under load is no rotor of CFD: its blades are rigid.
RIGID = ("untwist",)


@dataclass(frozen=True)
class BladeLoads:
    """Thrust and torque per radius of the whole rotor at radii of one run [m], [N/m], [N m/m], and where it ran.

    The radii are over that of the tip [1] where ``over_R``.
    ``u`` holds the standard uncertainty of thrust and torque, the grid's included, as a share [1].
    """

    run: str
    r: Array
    thrust: Array
    torque: Array
    rpm: float | None = None
    V: float | None = None
    density: float | None = None
    u: tuple[float, float] = (0.0, 0.0)
    over_R: bool = False


@dataclass(frozen=True)
class AlongBlade:
    """Rotor over recording in each band, and what is left of the squared misfit with each single effect."""

    bands: Array  # (N + 1,) Edges over the tip radius [1]
    # (N,) Load of the rotor over the recorded one [1]
    thrust: Array
    torque: Array
    # Effect as a case writes it to the share of the squared misfit that is left with it, best first [1]; empty where
    # nothing needs to be explained
    left: dict[str, float]
    named: tuple[str, ...]  # Effects that explain and are not told apart; empty: none does, or nothing needs to
    # (2,) Difference of thrust and torque up to which nothing needs to be explained [1]
    fine: tuple[float, float] = (FINE, FINE)
    state: str = ""  # Speed, airspeed and density of the comparison, and who says them
    whole: str = ""  # That the slices do not add up to the recorded load

    @property
    def beyond(self) -> bool:
        """Whether the loads differ by more than need not be explained."""
        return _misfit(np.stack([self.thrust, self.torque]), self.fine) > self.thrust.size * 2.0

    def text(self) -> str:
        """Lines for people."""
        both, state = np.stack([self.thrust, self.torque]), f" {self.state}" if self.state else ""
        differ = "have the other sign in some bands"
        if np.all(both > 0.0):
            differ = f"differ by {100 * float(np.sqrt(np.mean(np.log(both) ** 2))):.0f} % on the average"
        rows = [f"Along the blade{state} the loads {differ}."]
        rows += [f"  ! {self.whole}"] if self.whole else []
        for name, ratio in (("thrust", self.thrust), ("torque", self.torque)):
            cells = (f"{a:.2f}-{b:.2f} R {100 * (v - 1):+.0f} %"
                     for a, b, v in zip(self.bands[:-1], self.bands[1:], ratio, strict=True))  # fmt: skip
            rows.append(f"  {name}: {', '.join(cells)}")
        if self.named:
            best = next(iter(self.left))
            rows.append(
                f"  {' or '.join(self.named)}: {best} leaves {100 * self.left[best]:.0f} % of the squared misfit."
            )
        elif self.beyond and self.whole:
            rows.append("  No cause is named from slices that do not add up to the recording.")
        elif self.beyond:
            rows.append("  No single effect explains it.")
        else:
            said = zip(("thrust", "torque"), self.fine, strict=True)
            known = (f"{k} {u:.0%} ({'its u in recording.csv' if u > FINE else 'grids of such CFD'})" for k, u in said)
            rows.append(f"  Nothing to explain within {' and '.join(known)}.")
        return "\n".join(rows)

    def document(self) -> Mapping[str, object]:
        """As JSON takes it."""
        return {"bands": self.bands.tolist(), "thrust_ratio": self.thrust.tolist(),
                "torque_ratio": self.torque.tolist(), "left": self.left, "named": list(self.named),
                "fine": list(self.fine), "state": self.state, "whole": self.whole}  # fmt: skip


def read_blade_loads(path: Path) -> dict[str, BladeLoads]:
    """Read slices (`bemt.data.readers.slices`), as ``radial.csv`` of a campaign has them, by run.

    Speeds, density and uncertainties that they do not state come from ``recording.csv`` beside it, where there is one.
    """
    beside = path.with_name("recording.csv")
    points = {row["run"]: row for row in csv.DictReader(load_text(beside).lines)} if beside.is_file() else {}

    def made(run: str, s: slices.Slices) -> BladeLoads:
        row = points.get(run, {})

        def of(name: str) -> float | None:
            return number(row.get(name) or "")

        rpm, V, density = (s.stated.get(c, of(c)) for c in ("rpm", "airspeed_m_s", "density_kg_m3"))
        thrust, torque = (abs((of(f"u_{c}") or 0.0) / (of(c) or np.inf)) for c in ("thrust_N", "torque_Nm"))
        return BladeLoads(run, s.r, s.thrust, s.torque, rpm, V, density, (thrust, torque), s.over_R)

    return {run: made(run, s) for run, s in slices.read(path).items()}


@dataclass(frozen=True)
class SliceCondition:
    """Speed [rev/min], airspeed [m/s] and density [kg/m3] at which slices are compared, and who says the speed."""

    rpm: float
    V: float
    density: float | None  # None: that of the case
    whose: str
    loads: tuple[float, float] = (np.nan, np.nan)  # Thrust [N] and torque [N m] of the recording there


def along(
    case: Case, path: Path, recorded: Sequence[Record] = (), rpm: float | None = None, V: float | None = None
) -> dict[str, AlongBlade]:  # fmt: skip
    """Compare every run of a table of slices with a case.

    Speed, airspeed and density are those that the slices state, else `rpm` and `V`, else those of the recordings, if
    they have one condition, else the case's where nothing was recorded. InputError on recordings of several speeds, and
    on slices beyond the tip or short of it.
    """
    model = prepare_case(case)
    out = {}
    for run, loads in read_blade_loads(path).items():
        if loads.over_R:
            loads = replace(loads, r=loads.r * model.rotor.R, over_R=False)
        _within(model.rotor.R, loads.r, path, run)
        if np.trapezoid(loads.torque, loads.r) < 0.0:  # its sign is the sense of rotation
            loads = replace(loads, torque=-loads.torque)
        at = _condition(case, loads, recorded, rpm, V, path)
        air = case.air() if at.density is None else Air.from_density(at.density)
        told = compare_along(model, loads, at.rpm, at.V, air)
        state = f"at {speed_text(at.rpm)} rev/min, {number_text(at.V, 4)} m/s, {number_text(float(air.rho), 4)} kg/m3"
        whole = _whole(loads, at, case.ducted, model.rotor)  # what is not the recording explains nothing of it
        named = () if whole else told.named
        out[run] = replace(told, state=f"{state} (speed {at.whose})", whole=whole, named=named)
    return out


def _within(R: float, r: Array, path: Path, run: str) -> None:
    """Refuse radii beyond the tip, or short of every band: they are in another unit."""
    top = float(r.max()) / R
    if BANDS[0] < top <= BEYOND:
        return
    near = [e for e in unit_errors.errors("length") if BANDS[-2] < top * e.repair <= BEYOND and e.stated == "m"]
    hint = f"{near[0].actual} in a column of {near[0].stated}?" if near else "Slices reach from the root to the tip"
    got = f"radii of run {run} up to {r.max():.4g} m, {top:.4g} R"
    raise InputError(Fault(path.as_posix(), "radius", got, f"slices up to about the tip, {R:.4g} m", hint))


def _condition(
    case: Case, loads: BladeLoads, recorded: Sequence[Record], rpm: float | None, V: float | None, path: Path
) -> SliceCondition:  # fmt: skip
    """Where slices are compared: as they state, as the options say, as the one condition that was recorded is."""
    own = [r for r in recorded if not r.reference]
    n, v = (np.concatenate([np.empty(0), *x]) for x in ([r.rpm for r in own], [r.V for r in own]))
    rho = np.concatenate([np.empty(0), *(np.broadcast_to(r.air.rho, r.rpm.shape) for r in own)])
    speed, whose = (loads.rpm, "of the slices") if loads.rpm is not None else (rpm, "as --rpm says")
    wind = V if loads.V is None else loads.V
    here = np.ones(n.size, dtype=bool) if speed is None else np.abs(n / speed - 1.0) < ONE
    here &= np.ones(n.size, dtype=bool) if wind is None else np.abs(v - wind) < np.maximum(0.02, ONE * abs(wind))
    one = here.any() and np.ptp(n[here]) < ONE * n[here].max() and np.ptp(v[here]) < max(0.02, ONE * v[here].max())
    if n.size and speed is None and not one:
        got = f"slices without a speed, and {n.size} readings at {n.min():g} to {n.max():g} rev/min"
        got += f", {v.min():g} to {v.max():g} m/s"
        raise InputError(Fault(path.as_posix(), "rpm", got, "the speed of the slices", "A column rpm in their table"))
    if n.size and not here.any():
        reach = " to ".join(dict.fromkeys(speed_text(float(x)) for x in (n.min(), n.max())))
        whose += f"; nothing was recorded there: the readings are at {reach} rev/min"
    if not one:
        speed, whose = (case.rpm, "of the case") if speed is None else (speed, whose)
        return SliceCondition(speed, case.airspeed_m_s if wind is None else wind, loads.density, whose)
    measured: list[float] = []
    for name in ("thrust_N", "torque_Nm"):
        every = [r.measured.get(name, np.full(len(r), np.nan)) for r in own]
        found = np.concatenate(every)[here]
        measured.append(float(np.nanmean(found)) if np.isfinite(found).any() else np.nan)
    density = float(np.mean(rho[here])) if loads.density is None else loads.density
    whose = "of the recording" if speed is None else whose
    speed = float(np.mean(n[here])) if speed is None else speed
    return SliceCondition(
        speed, float(np.mean(v[here])) if wind is None else wind, density, whose, (measured[0], measured[1])
    )


def _whole(loads: BladeLoads, at: SliceCondition, ducted: bool, rotor: Rotor) -> str:
    """What slices add up to, where that is not what the recording has; a duct carries a thrust of its own.

    What the blade may carry beyond the outermost slices is their load up to hub and tip.
    """
    said = []
    within, tip = loads.r[0] - rotor.Rhub, rotor.R - loads.r[-1]
    both = (("thrust", "N", loads.thrust, at.loads[0]), ("torque", "N m", loads.torque, at.loads[1]))
    for name, unit, per, whole in both:
        total = float(np.trapezoid(per, loads.r))
        most = total + max(per[0] * within, 0.0) + max(per[-1] * tip, 0.0)
        if not np.isfinite(whole) or not whole or (ducted and name == "thrust"):
            continue
        if total > (1.0 + FINE) * whole or most < (1.0 - FINE) * whole:
            said.append(f"{number_text(total, 4)} {unit} of {name} (recorded: {number_text(whole, 4)})")
    return f"The slices add up to {' and '.join(said)}: are they of all blades, at this speed?" if said else ""


def compare_along(model: Model, loads: BladeLoads, rpm: float, V: float, air: Air) -> AlongBlade:
    """Compare loads in bands along the blade, then, if they differ, with each effect changed alone."""
    model = model.at_speeds(rpm, V, air)
    recorded = _banded(loads.r / model.rotor.R, np.stack([loads.thrust, loads.torque]))
    fine = (max(FINE, loads.u[0]), max(FINE, loads.u[1]))

    def ratio(effects: Sequence[Effect]) -> Array:
        prep = model.prepared([e for e in effects if not acts_on_points(e)])
        s = solver.solve(prep, rpm, V, air, radial=True)
        found = np.stack([getattr(s.radial, k)[0] / prep.st[:, 1] for k in ("dT", "dQ")])
        return _banded(np.broadcast_to(s.radial.r, (1, prep.st.shape[0]))[0] / model.rotor.R, found) / recorded

    base = ratio(model.effects)
    whole = _misfit(base, fine)
    left = {}
    for effect in _candidates(model) if whole > base.size else ():
        others = [e for e in model.effects if e.id != effect.id]
        left[to_text(effect)] = _misfit(ratio([*others, effect]), fine) / max(whole, 1e-12)
    left = dict(sorted(left.items(), key=lambda item: item[1]))
    best = next(iter(left.values()), np.inf)
    named: tuple[str, ...] = ()
    if whole > base.size and best < EXPLAINED:
        good = [text for text, share in left.items() if share <= max(ALIKE * best, 0.02)]
        named = tuple(dict.fromkeys(text.partition("(")[0] for text in good))
    return AlongBlade(BANDS, base[0], base[1], left, named, fine)


def _misfit(ratio: Array, fine: tuple[float, float]) -> float:
    """Sum of squares of the logarithms of (2, N) ratios over what needs no explanation; infinite for reversed load."""
    if not np.all(ratio > 0.0):
        return float(np.inf)
    return float(np.sum((np.log(ratio) / np.array(fine)[:, None]) ** 2))


def _banded(x: Array, values: Array) -> Array:
    """(2, N) mean of the values in each band, linear between radii."""
    fine = np.linspace(BANDS[0], BANDS[-1], 10 * (BANDS.size - 1), endpoint=False) + 0.05 * (BANDS[1] - BANDS[0])
    at = np.stack([np.interp(fine, x, v) for v in values])
    return np.asarray(at.reshape(2, BANDS.size - 1, 10).mean(axis=2))


def _candidates(model: Model) -> list[Effect]:
    """Every diagnosed effect of a rigid rotor, at each of its settings that the model does not have."""
    out: list[Effect] = []
    on = {e.id: e for e in model.effects}
    for cls in catalogue().values():
        plain = cls()
        if not cls.diagnosed or not acts_on_rotor(plain) or cls.id in RIGID:
            continue
        ranged = [(p.name, v) for p in cls.parameters if p.steps > 1 for v in np.linspace(p.low, p.high, p.steps)]
        settings = [{}, *(plain.variants() or ({name: float(v)} for name, v in ranged))]
        for setting in settings:
            effect = replace(plain, **setting)  # type: ignore[type-var]
            if on.get(effect.id) != effect and effect not in out:
                out.append(effect)
    return out
