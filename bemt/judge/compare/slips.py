"""What a difference between a run and the model looks like that is no physics: a unit, a fluid, an axis, zones."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bemt.base import unit_errors
from bemt.base.tables import number_text
from bemt.data.recordings.cfd_run import is_run
from bemt.data.recordings.channels import without_unit
from bemt.data.recordings.slips import NEAR
from bemt.rotors.as_measured import FACTOR

if TYPE_CHECKING:
    from bemt.data.recordings.cfd_setup import Elsewhere
    from bemt.judge.compare.one_run import BothLoads
    from bemt.physics.dataset import Dataset

LOADS = {"thrust_N": ("thrust", "N"), "torque_Nm": ("torque", "N m"), "duct_share": ("duct's share", "")}
"""Word and unit."""
KIND = {"thrust_N": "force", "torque_Nm": "torque"}
"""Loads that have a unit, and of what."""
WIDE = 2.0
"""Combined standard uncertainties within which nothing is shown to differ [1]."""
_FAR = 1.5  # ratio of the loads beyond which a slip is likelier than physics
_FLUIDS = {"water": 998.0, "air": 1.225, "a fluid of 1 kg/m3": 1.0}  # 1: what incompressible solvers have at first


@dataclass(frozen=True)
class LeftOpen:
    """What a file leaves open, so that a slip may be why its loads are off."""

    units: frozenset[str] = frozenset()  # Loads whose unit it does not state
    unitless: frozenset[str] = frozenset()  # Loads that it tells by coefficients alone
    density: bool = False  # Whether loads are given, and no density
    elsewhere: Sequence[Elsewhere] = ()  # What it holds beside the loads

    @classmethod
    def of(cls, points: Dataset, imported: Dataset) -> LeftOpen:
        """By a file and the points that were read from it."""
        density = "density_kg_m3" not in points and not points.values.keys().isdisjoint(KIND)
        return cls(open_units(imported), without_unit(points), density, imported.elsewhere if is_run(imported) else ())


def open_units(imported: Dataset) -> frozenset[str]:
    """Loads whose unit the file did not state; coefficients have none."""
    if is_run(imported):
        return frozenset(k for k in KIND if k.split("_")[0] in imported.units_given)
    told = imported.headings
    return frozenset(k for k in KIND if k in imported.values and not re.search(r"[\[(].+[\])]", told.get(k, "")))


def first_check(loads: Mapping[str, Sequence[BothLoads]], fluid: str, open_: LeftOpen) -> str:
    """What to check before any physics where ``loads`` differ; "" without it."""
    if elsewhere := "".join(_not_counted(name, own, open_.elsewhere) for name, own in loads.items()):
        return elsewhere
    if one := fluid or _one_factor(loads, open_):
        return one
    slips = [slip for name, own in loads.items() if (slip := _slip(name, own, open_))[1]]
    # a unit explains all that differs, or nothing
    return min(slips, key=lambda slip: (math.isfinite(slip[0]), slip[0]), default=(0.0, ""))[1]


def other_fluid(off: Sequence[float], u: Sequence[float], density: float) -> str:
    """In which other fluid all loads would be as a model has them; "" where none is nearer by half, within two u.

    ``off``: loads of the run over the model's, natural logarithm; ``u``: their standard uncertainty [1].
    """
    y, wide = np.array(off), np.array(u)
    for words, other in _FLUIDS.items():
        far = math.log(other / density)
        if y.size and np.all(np.abs(y - far) < np.minimum(0.5 * np.abs(y), WIDE * wide)):
            return f"All loads are about {math.exp(far):.3g} times BEMT's, as in {words}: first check the density"
    return ""


def fluid_of(loads: Sequence[BothLoads], density: float) -> str:
    """What all loads look like if the run is of another density than was taken; "" where none brings them near."""
    known = _comparable(loads)
    off = [math.log(max(load.cfd / load.bemt, 1e-9)) for load in known]
    found = other_fluid(off, [_share(load) for load in known], density)
    return f" {found}." if found else ""


def _comparable(loads: Sequence[BothLoads]) -> list[BothLoads]:
    return [load for load in loads if load.cfd and load.bemt and math.isfinite(load.u_both)]


def _share(load: BothLoads) -> float:
    """Both bands over the loads, [1]."""
    return math.hypot(np.nan_to_num(load.u_cfd, posinf=0.0) / load.cfd, load.u_bemt / load.bemt, 0.02)


def _slip(name: str, loads: Sequence[BothLoads], open_: LeftOpen) -> tuple[float, str]:
    """What a difference looks like that is no physics, and how little it fits; "" when nothing is near."""
    known = _comparable(loads)
    if not known:
        return math.inf, ""
    word, _ = LOADS[name]
    off = np.array([load.cfd / load.bemt for load in known])
    if all(load.cfd * load.bemt < 0.0 for load in known):
        return 0.0, f" The signs are opposite: look at the sign of the {word}."
    if name not in KIND or np.any(off <= 0.0) or 1.0 / _FAR < float(np.median(off)) < _FAR:
        return math.inf, ""
    unit_open = name in open_.units and name not in open_.unitless
    # no rotor of the case is off by FACTOR: then even a unit that is stated may be wrong
    errors = () if name in open_.unitless else unit_errors.errors(KIND[name])
    may = (e for e in errors if unit_open or max(e.factor, e.repair) > FACTOR)
    wide = np.array([_share(load) for load in known])
    near = [(e.rarity + float(np.mean(far**2)), e) for e in may
            if np.all((far := np.abs(np.log(off / e.factor)) / wide) < 1.0)]  # fmt: skip
    if not near:
        open_words = ("unit, " if unit_open else "") + ("density, " if open_.density else "")
        return math.inf, f" First check {open_words}sector, zones and speed."
    score, error = min(near, key=lambda item: item[0])
    size = max(error.factor, error.repair)
    return score, (f" {word.capitalize()} is off by about a factor of {size:.4g}, as of {error.actual} taken for "
                   f"{error.stated}: check the unit.")  # fmt: skip


def _one_factor(loads: Mapping[str, Sequence[BothLoads]], open_: LeftOpen) -> str:
    """What to check first where thrust and torque are off by one factor, which no unit of one explains; else ""."""
    ratio = [np.array([v.cfd / v.bemt for v in loads.get(k, ()) if v.cfd and v.bemt]) for k in KIND]
    if not all(r.size and np.all(r > 0.0) for r in ratio):
        return ""
    thrust, torque = (float(np.median(np.log(r))) for r in ratio)
    both = 0.5 * (thrust + torque)
    if abs(both) < math.log(_FAR) or abs(thrust - torque) > NEAR:
        return ""
    first = f"speed, sector{', density' if open_.density else ''} and diameter"
    for e in unit_errors.errors("rotation"):
        if abs(both + 2.0 * math.log(e.factor)) <= NEAR:  # loads go with the square of the speed
            first = f"the speed, as of {e.actual} taken for {e.stated}"
            break
    units = ", then the units" if set(KIND) <= open_.units else ""
    return f" Both loads are off by about a factor of {math.exp(abs(both)):.3g}: first check {first}{units}."


def _not_counted(channel: str, loads: Sequence[BothLoads], elsewhere: Sequence[Elsewhere]) -> str:
    """What the files hold beside a load that brings it nearer to the model by half or more; "" without it."""
    off = np.log([abs(load.cfd / load.bemt) for load in loads if load.cfd and load.bemt])
    for e in elsewhere:
        if e.channel != channel or not 0.0 < e.factor < math.inf or not off.size:
            continue
        if np.median(np.abs(off + math.log(e.factor))) < 0.5 * np.median(np.abs(off)):
            (word, unit), what = LOADS[channel], "axis" if e.words.startswith("along") else "zones"
            value = number_text(loads[0].cfd * e.factor, 4)
            return f" {word.capitalize()} {e.words} is {value} {unit}: check the {what}."
    return ""
