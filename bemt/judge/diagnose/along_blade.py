"""Loads of CFD along the blade beside those of a rotor: where they part, and which one effect brings them together."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, refuse
from bemt.physics.air import Air
from bemt.physics.bem import solver
from bemt.physics.bem.model import Model, acts_on_points, acts_on_rotor
from bemt.physics.effects import catalogue, to_text
from bemt.physics.effects.base import Effect
from bemt.rotors.case.prepare import prepare_case

if TYPE_CHECKING:
    from bemt.rotors.case import Case

COLUMNS = ("r_m", "thrust_per_radius_N_m", "torque_per_radius_Nm_m")
# Root and tip are left out: hubs are not modelled, and what the last percents of a blade carry no two codes agree on.
BANDS = np.linspace(0.40, 0.95, 6)
# An effect explains when it leaves at most this share of the squared misfit; those within this factor of the best are
# not told apart.
EXPLAINED, ALIKE = 0.3, 1.5
# Loads that agree this well on the average need no explanation: grids of such CFD are no better. What the recording
# states of its own uncertainty counts where it is larger.
FINE = 0.10
# What untwists under load is no rotor of CFD: its blades are rigid.
RIGID = ("untwist",)


@dataclass(frozen=True)
class BladeLoads:
    """Thrust and torque per radius of the whole rotor at radii of one run [m], [N/m], [N m/m], and where it ran.

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


@dataclass(frozen=True)
class AlongBlade:
    """Rotor over recording in each band, and what is left of the squared misfit with each single effect."""

    bands: Array  # (N + 1,) Edges over the tip radius [1]
    # (N,) Load of the rotor over the recorded one [1]
    thrust: Array
    torque: Array
    # Effect as a case writes it to the share of the squared misfit that is left with it, best first [1]
    left: dict[str, float]
    named: tuple[str, ...]  # Effects that explain and are not told apart; empty: none does, or nothing needs to
    # (2,) Difference of thrust and torque up to which nothing needs to be explained [1]
    fine: tuple[float, float] = (FINE, FINE)

    @property
    def beyond(self) -> bool:
        """Whether the loads differ by more than need not be explained."""
        return _misfit(np.stack([self.thrust, self.torque]), self.fine) > self.thrust.size * 2.0

    def text(self) -> str:
        """Lines for people."""
        rms = float(np.sqrt(np.mean(np.log(np.stack([self.thrust, self.torque])) ** 2)))
        rows = [f"Along the blade the loads differ by {100 * rms:.0f} % on the average."]
        for name, ratio in (("thrust", self.thrust), ("torque", self.torque)):
            cells = (f"{a:.2f}-{b:.2f} R {100 * (v - 1):+.0f} %"
                     for a, b, v in zip(self.bands[:-1], self.bands[1:], ratio, strict=True))  # fmt: skip
            rows.append(f"  {name}: {', '.join(cells)}")
        if self.named:
            best = next(iter(self.left))
            rows.append(
                f"  {' or '.join(self.named)}: {best} leaves {100 * self.left[best]:.0f} % of the squared misfit."
            )
        elif self.beyond:
            rows.append("  No single effect explains it.")
        else:
            limits = "thrust by {:.0%} and torque by {:.0%}".format(*self.fine)
            rows.append(f"  Nothing to explain: the recording's own uncertainty is {limits}.")
        return "\n".join(rows)

    def document(self) -> Mapping[str, object]:
        """As JSON takes it."""
        return {"bands": self.bands.tolist(), "thrust_ratio": self.thrust.tolist(),
                "torque_ratio": self.torque.tolist(), "left": self.left, "named": list(self.named),
                "fine": list(self.fine)}  # fmt: skip


def read_blade_loads(path: Path) -> dict[str, BladeLoads]:
    """Read ``radial.csv`` of a campaign: columns run, r_m, thrust_per_radius_N_m, torque_per_radius_Nm_m.

    Speeds, density and uncertainties of each run come from ``recording.csv`` beside it, where there is one.
    """
    from bemt.data.readers import load_text, number

    rows = list(csv.DictReader(load_text(path).lines))
    needed = ("run", *COLUMNS)
    missing = [name for name in needed if rows and name not in rows[0]]
    if missing or not rows:
        got = f"no column {', '.join(missing)}" if rows else "no rows"
        raise InputError(Fault(path.as_posix(), "", got, ", ".join(needed)))
    faults = [Fault(path.as_posix(), f"{i}: {c}", repr(row[c]), "a number")
              for i, row in enumerate(rows, 2) for c in COLUMNS if number(row[c] or "") is None]  # fmt: skip
    refuse(faults)
    runs = dict.fromkeys(str(row["run"]) for row in rows)
    table = {run: np.array([[number(row[c]) for c in COLUMNS] for row in rows if row["run"] == run], float).T
             for run in runs}  # fmt: skip
    beside = path.with_name("recording.csv")
    points = {row["run"]: row for row in csv.DictReader(load_text(beside).lines)} if beside.is_file() else {}

    def made(run: str) -> BladeLoads:
        row = points.get(run, {})

        def of(name: str) -> float | None:
            return number(row.get(name) or "")

        rpm, V, density = (of(c) for c in ("rpm", "airspeed_m_s", "density_kg_m3"))
        shape = table[run][0], table[run][1], table[run][2]
        thrust, torque = (abs((of(f"u_{c}") or 0.0) / (of(c) or np.inf)) for c in ("thrust_N", "torque_Nm"))
        return BladeLoads(run, *shape, rpm, V, density, (thrust, torque))

    return {run: made(run) for run in table}


def along(case: Case, path: Path) -> dict[str, AlongBlade]:
    """Compare every run of a file of radial loads with a case, at the run's own speeds or the case's."""
    model = prepare_case(case)
    out = {}
    for run, loads in read_blade_loads(path).items():
        air = case.air() if loads.density is None else Air.from_density(loads.density)
        rpm = case.rpm if loads.rpm is None else loads.rpm
        out[run] = compare_along(model, loads, rpm, case.airspeed_m_s if loads.V is None else loads.V, air)
    return out


def compare_along(model: Model, loads: BladeLoads, rpm: float, V: float, air: Air) -> AlongBlade:
    """Compare loads in bands along the blade, then with each effect changed alone."""
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
    for effect in _candidates(model):
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
