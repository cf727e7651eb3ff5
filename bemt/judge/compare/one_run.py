"""One CFD run or recording and the model at its points: loads, both bands, the duct's share, the audit of the run.

No physics is named: one point cannot tell causes apart. `bemt.diagnose` does, from several.
"""

from __future__ import annotations

import math
import os
import re
import shlex
import textwrap
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt import __version__
from bemt.base import unit_errors
from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_of, number_text, speed_text, text_table
from bemt.data.recordings.audit import KEYS, AuditLine, combined
from bemt.data.recordings.cfd_run import is_run, of_rotor, run_at
from bemt.data.recordings.cfd_setup import (
    Elsewhere,
    audit_of,
    conditions_of,
    faults_first,
    floor_note,
    grid_floor,
    stated_setup,
)
from bemt.data.recordings.channels import named, without_unit
from bemt.data.recordings.slips import NEAR
from bemt.physics.dataset import Dataset
from bemt.rotors.as_measured import FACTOR
from bemt.rotors.case import Case
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.case.propagate import Moved, propagate
from bemt.rotors.conditioning import STAND
from bemt.rotors.propeller import rotor_of

SCHEMA = "bemt.run-comparison/1"
_LOADS = {"thrust_N": "thrust [N]", "torque_Nm": "torque [N m]", "duct_share": "duct's share"}
STAND_U = dict(zip(("thrust_N", "torque_Nm"), STAND.tolist(), strict=True))
"""Standard uncertainty of a load that a stand does not state, over its size [1]."""
_KIND = {"thrust_N": "force", "torque_Nm": "torque"}
_ROWS = 6  # points on one screen
_WIDE = 2.0  # combined standard uncertainties within which nothing is shown to differ
_NEAR_ZERO = 0.1  # share of the largest value of a load below which a difference has no per cent
_FAR = 1.5  # ratio of the loads beyond which a slip is likelier than physics
_FLUIDS = {"water": 998.0, "air": 1.225, "a fluid of 1 kg/m3": 1.0}  # 1: what incompressible solvers have at first
_NO_DENSITY = re.compile(r"density: not stated")
_NAMES = {"program": "", "cells": "cells", "grid_level": "grid", "turbulence": "", "solver": "", "domain": "domain"}


class BothLoads(Documented):
    """One load by the run and by the model, with standard uncertainties."""

    cfd: float
    u_cfd: float
    bemt: float
    u_bemt: float
    u_bemt_by: Mapping[str, float]  # By origin
    difference: float
    u_both: float
    verdict: str

    @property
    def times(self) -> float:
        """Difference over both uncertainties together."""
        return abs(self.difference) / self.u_both if self.u_both else math.nan

    @property
    def percent(self) -> str:
        """Difference as a share of the run's value."""
        if not self.cfd:
            return "-"
        ratio = self.bemt / self.cfd
        return f"{100.0 * (ratio - 1.0):+.0f} %" if abs(ratio) < 10.0 else f"{number_text(ratio, 3)} times"


class PointOfRun(Documented):
    """Loads at one point."""

    label: str
    rpm: float
    airspeed_m_s: float
    density_kg_m3: float
    V_over_n_m: float
    loads: Mapping[str, BothLoads]
    flags: tuple[str, ...]


class RunComparison(Documented):
    """``bemt.run-comparison/1``: one run and the model of a case side by side."""

    run: str
    case: str
    kind: str  # cfd, or bench for a recording
    conditions: Mapping[str, str]
    points: tuple[PointOfRun, ...]
    audit: tuple[AuditLine, ...]
    audit_u_relative_known: float
    averaged: Mapping[str, str]
    notes: tuple[str, ...]
    sentence: str
    next: str

    def document(self) -> dict[str, object]:
        """Plain values."""
        return {"schema": SCHEMA, "version": __version__, **super().document()}


def cfd_points(
    path: str, read: Dataset | None = None, rotor: tuple[float, float, bool] | None = None
) -> tuple[Dataset, Dataset]:
    """Points of a CFD recording, and the file as it was `read`: a run, or a table of runs such as a campaign's.

    `rotor`: diameter [m], density [kg/m3] and duct of the case that it stands beside.
    """
    from bemt.data.recordings.load import as_dataset, import_file

    imported = import_file(path) if read is None else read
    if imported.kind == "cfd" and not is_run(imported) and "clock" in imported.provenance:
        try:
            imported = run_at(path) or imported
        except InputError as error:
            hint = f"`bemt import {path}` with what is missing, and --out run.toml, keeps it"
            first = Fault(path, "", "exports of CFD, not yet a run", "a run.toml", hint)
            raise InputError([first, *error.faults]) from error
    if is_run(imported):
        imported = imported if rotor is None else of_rotor(imported, *rotor)
        return imported, imported
    points = named(as_dataset(imported, rotor or ()))
    known = points.values.keys() & {"thrust_N", "torque_Nm", "CT", "CQ", "CP"}
    needed = "thrust_N" in points or ("J" not in points and "airspeed_m_s" in points)
    if not known or ("rpm" not in points and needed):
        got = f"channels {', '.join(list(imported.values)[:8])}"
        raise InputError(Fault(path, "", got, "a speed and a load", "`bemt import` shows how each column was read"))
    if conditions_of(imported):
        u = {}
        flies = np.nan_to_num(points.values.get("airspeed_m_s", np.zeros(len(points)))) > 0.5
        for k in known:
            least = np.abs(points[k]) * np.array([grid_floor(k, bool(f)) for f in flies])
            u[k] = np.fmax(points.u[k], least)
        points = Dataset("cfd", points.name, points.values, u, (), points.provenance, points.labels, notes=points.notes)
    return points, imported


def compare_run(
    path: str | os.PathLike[str] | Dataset, case: Any, progress: Callable[[str], None] | None = None, called: str = ""
) -> RunComparison:
    """Put one run (run.toml, a folder of exports, or a table of CFD points) and the model of a case side by side.

    A file that is no run, or of another rotor, is refused.
    """
    given = path if isinstance(path, Dataset) else None
    name = os.fspath(path) if not isinstance(path, Dataset) else path.file or path.name
    made = rotor_of(case).case
    points, imported = cfd_points(name, given, (made.diameter_m, float(made.air().rho), made.ducted))
    notes, points_stated = list(points.notes), {*points.values}
    for channel, words, value in (
        ("rpm", "rev/min", made.rpm),
        ("airspeed_m_s", "m/s", made.airspeed_m_s),
        ("density_kg_m3", "kg/m3", made.air().rho),
    ):
        if channel not in points and not (channel == "airspeed_m_s" and "J" in points):
            notes.append(f"{channel.split('_')[0]}: not stated; {value:.6g} {words} of the case")
            points = replace(points, values={**points.values, channel: np.full(len(points), float(value))})
    full = points.derive(made.diameter_m)
    keep = np.any([np.isfinite(full[k]) for k in ("thrust_N", "torque_Nm") if k in full], axis=0)
    rows = np.flatnonzero(keep & np.isfinite(full.rpm))
    if not rows.size:
        raise InputError(Fault(name, "", "no point with a speed and a load", "one or more"))
    step = None if progress is None else (lambda i, n, what: progress(f"{what} ({i}/{n})"))
    whole = propagate(
        made, full.rpm[rows], full.airspeed_m_s[rows], full.density_kg_m3[rows],
        angle_deg=_angle(full, rows, made, name), progress=step,
    )  # fmt: skip
    solved = whole.points
    computed = imported.kind == "cfd" or bool(stated_setup(imported))
    if not computed and (open_u := [k for k in STAND_U if k in full and np.isnan(full.u[k][rows]).any()]):
        usual = ", ".join(f"{k.rsplit('_', 1)[0]} {STAND_U[k]:.0%}" for k in open_u)
        notes.insert(
            0,
            f"u of the recording: not stated; that of a stand which nobody calibrated, {usual} "
            "(a computed table says so by a column turbulence, cells or solver)",
        )
        stand = {k: np.where(np.isnan(full.u[k]), STAND_U[k] * np.abs(full[k]), full.u[k]) for k in open_u}
        full = replace(full, u={**full.u, **stand})
    out = tuple(_point(full, solved, int(i), k) for k, i in enumerate(rows))
    if made.ducted and computed and "thrust_N" in full and "duct_thrust_N" not in full:
        notes.append(f"thrust: no part of the duct stated; taken for the whole. The rotor's alone is "
                     f"{float(solved.rotor_thrust_N[0]):.4g} N by BEMT; --zones says what counts")  # fmt: skip
    lines: list[AuditLine] = []
    if computed:
        at = int(rows[0])
        pitch = float(prepare_case(made, oblique=True).pitch_m)
        lines = [*audit_of(imported if len(imported) == len(full) else full, made.diameter_m, pitch, made.ducted,
                           float(made.air().a_sound), at)]  # fmt: skip
        if not is_run(imported):
            flies = full.airspeed_m_s[rows] > 0.5
            notes.insert(0, "u of the file, and " + floor_note(bool(flies.any()), bool(flies.all())))
    notes = [*made.as_built().no_check, *notes]
    known = combined(lines)[1] if lines else math.nan
    asked = called or (made.path.as_posix() if isinstance(case, Case) else os.fspath(case))
    return RunComparison(
        name, made.name, "cfd" if computed else "bench", {k: ", ".join(v) for k, v in conditions_of(imported).items()},
        out, tuple(faults_first(lines)), known, dict(imported.averaged) if is_run(imported) else {},
        tuple(dict.fromkeys(notes)),
        _sentence(out, "CFD" if computed else "Recording", open_units(imported),
                  imported.elsewhere if is_run(imported) else (),
                  "density_kg_m3" not in points_stated and not points_stated.isdisjoint(_KIND),
                  without_unit(points)),
        _next(out, lines, name, asked, whole.moved),
    )  # fmt: skip


def _angle(points: Dataset, rows: NDArray[np.intp], case: Case, name: str) -> NDArray[np.float64]:
    """Angle between wind and shaft at some points [deg]: the recorded one, where there is none that of the case."""
    for channel, factor in (("sideslip_deg", 1.0), ("sideslip_rad", 180.0 / math.pi)):
        if channel in points:
            angle = np.abs(points[channel][rows]) * factor
            angle = np.where(np.isnan(angle), case.angle_deg, angle)
            limit = 0.0 if case.ducted else 180.0
            if np.any(angle > limit):
                expected = "0 deg of a ducted rotor" if case.ducted else "0 to 180 deg"
                raise InputError(Fault(name, channel, f"{angle.max():g} deg", expected))
            return np.asarray(angle)
    return np.full(rows.size, case.angle_deg)


def _point(cfd: Dataset, bemt: Dataset, i: int, k: int) -> PointOfRun:
    """Loads at one point."""
    loads = {
        name: _load(float(cfd[name][i]), float(cfd.u[name][i]), bemt, name, k)
        for name in ("thrust_N", "torque_Nm")
        if name in cfd and math.isfinite(cfd[name][i])
    }
    if "duct_thrust_N" in cfd and "thrust_N" in loads and "duct_share" in bemt:
        T = loads["thrust_N"].cfd  # the total is the rotor's and the duct's: their errors go together
        share, u = float(cfd.duct_thrust_N[i]) / T, float(cfd.u_duct_thrust_N[i]) / abs(T)
        loads["duct_share"] = _load(share, u, bemt, "duct_share", k)
    rpm, V, rho = (float(cfd[key][i]) for key in ("rpm", "airspeed_m_s", "density_kg_m3"))
    per_turn = V / (rpm / 60.0) if rpm > 0 else math.nan
    return PointOfRun(cfd.labels[i] if cfd.labels else "", rpm, V, rho, per_turn, loads, tuple(bemt.flags[k]))


def _load(value: float, u: float, bemt: Dataset, name: str, k: int) -> BothLoads:
    ours, band = float(bemt[name][k]), float(bemt.u[name][k])
    both = math.hypot(u if math.isfinite(u) else 0.0, band)
    parts = {origin: float(part[name][k]) for origin, part in bemt.u_by.items() if name in part}
    return BothLoads(value, u, ours, band, parts, ours - value, both, _verdict(ours - value, both))


def _verdict(E: float, u: float) -> str:
    if not math.isfinite(E + u):
        return "no result"
    return "agrees" if abs(E) <= u else "within 2 u" if abs(E) <= _WIDE * u else "differs"


def other_fluid(off: Sequence[float], u: Sequence[float], density: float) -> str:
    """In which other fluid all loads would be as a model has them; "" where none is nearer by half, within two u.

    ``off``: loads of the run over the model's, natural logarithm; ``u``: their standard uncertainty [1].
    """
    y, wide = np.array(off), np.array(u)
    for words, other in _FLUIDS.items():
        far = math.log(other / density)
        if y.size and np.all(np.abs(y - far) < np.minimum(0.5 * np.abs(y), _WIDE * wide)):
            return f"All loads are about {math.exp(far):.3g} times BEMT's, as in {words}: first check the density"
    return ""


def _fluid(loads: Sequence[BothLoads], density: float) -> str:
    """What all loads look like if the run is of another density than was taken; "" where none brings them near."""
    said = [load for load in loads if load.cfd and load.bemt and math.isfinite(load.u_both)]
    off = [math.log(max(load.cfd / load.bemt, 1e-9)) for load in said]
    found = other_fluid(off, [_share(load) for load in said], density)
    return f" {found}." if found else ""


def _share(load: BothLoads) -> float:
    """Both bands over the loads, [1]."""
    return math.hypot(np.nan_to_num(load.u_cfd, posinf=0.0) / load.cfd, load.u_bemt / load.bemt, 0.02)


def _slip(
    name: str, loads: Sequence[BothLoads], unit_open: bool | None, density_open: bool = False
) -> tuple[float, str]:
    """What a difference looks like that is no physics, and how little it fits; "" when nothing is near.

    ``unit_open``: whether the unit is not stated; None of a coefficient, which has none.
    """
    said = [load for load in loads if load.cfd and load.bemt and math.isfinite(load.u_both)]
    if not said:
        return math.inf, ""
    if all(load.cfd * load.bemt < 0.0 for load in said):
        return 0.0, f" The signs are opposite: look at the sign of the {name.split('_')[0]}."
    off = np.array([load.cfd / load.bemt for load in said])
    if name not in _KIND or np.any(off <= 0.0) or 1.0 / _FAR < float(np.median(off)) < _FAR:
        return math.inf, ""
    wide = np.array([_share(load) for load in said])
    # no rotor of the case is off by FACTOR: then even a unit that is stated may be wrong
    errors = () if unit_open is None else unit_errors.errors(_KIND[name])
    may = (e for e in errors if unit_open or max(e.factor, e.repair) > FACTOR)
    near = [(e.rarity + float(np.mean(far**2)), e) for e in may
            if np.all((far := np.abs(np.log(off / e.factor)) / wide) < 1.0)]  # fmt: skip
    if not near:
        return math.inf, (
            f" First check {'unit, ' if unit_open else ''}{'density, ' if density_open else ''}sector, zones and speed."
        )
    score, error = min(near, key=lambda item: item[0])
    size = max(error.factor, error.repair)
    return score, (f" {name.split('_')[0].capitalize()} is off by about a factor of {size:.4g}, as of {error.actual} "
                   f"taken for {error.stated}: check the unit.")  # fmt: skip


def _one_factor(loads: Mapping[str, Sequence[BothLoads]], units_open: Collection[str]) -> str:
    """What to check first where thrust and torque are off by one factor, which no unit of one explains; else ""."""
    ratio = [np.array([v.cfd / v.bemt for v in loads.get(k, ()) if v.cfd and v.bemt]) for k in _KIND]
    if not all(r.size and np.all(r > 0.0) for r in ratio):
        return ""
    thrust, torque = (float(np.median(np.log(r))) for r in ratio)
    both = 0.5 * (thrust + torque)
    if abs(both) < math.log(_FAR) or abs(thrust - torque) > NEAR:
        return ""
    # loads go with the square of the speed
    speed = next((f"the speed, as of {e.actual} taken for {e.stated}" for e in unit_errors.errors("rotation")
                  if abs(both + 2.0 * math.log(e.factor)) <= NEAR), "speed, sector, density and diameter")  # fmt: skip
    units = ", then the units" if set(_KIND) <= set(units_open) else ""
    return f" Both loads are off by about a factor of {math.exp(abs(both)):.3g}: first check {speed}{units}."


def open_units(imported: Dataset) -> frozenset[str]:
    """Loads whose unit the file did not state; coefficients have none."""
    if is_run(imported):
        return frozenset(k for k in _KIND if k.split("_")[0] in imported.units_given)
    told = imported.headings
    return frozenset(k for k in _KIND if k in imported.values and not re.search(r"[\[(].+[\])]", told.get(k, "")))


def _not_counted(channel: str, loads: Sequence[BothLoads], elsewhere: Sequence[Elsewhere]) -> str:
    """What the files hold beside a load that brings it nearer to the model by half or more; "" without it."""
    ratio = [abs(load.cfd / load.bemt) for load in loads if load.cfd and load.bemt]
    off = np.abs(np.log(ratio)) if ratio else np.zeros(1)
    for e in elsewhere:
        if e.channel == channel and 0.0 < e.factor < math.inf and ratio:
            if float(np.median(np.abs(np.log(ratio) + math.log(e.factor)))) < 0.5 * float(np.median(off)):
                value, unit = loads[0].cfd * e.factor, _LOADS[channel].split("[")[1].rstrip("]")
                said, what = channel.split("_")[0].capitalize(), "axis" if e.words.startswith("along") else "zones"
                return f" {said} {e.words} is {number_text(value, 4)} {unit}: check the {what}."
    return ""


def _sentence(
    points: Sequence[PointOfRun], who: str, units_open: Collection[str] = (), elsewhere: Sequence[Elsewhere] = (),
    density_open: bool = False, unitless: Collection[str] = (),
) -> str:  # fmt: skip
    every = [(k, load) for p in points for k, load in p.loads.items()]
    off = [(k, load) for k, load in every if load.verdict == "differs"]
    near = [(k, load) for k, load in every if load.verdict == "within 2 u"]
    fluid = _fluid([load for k, load in every if k in _KIND], points[0].density_kg_m3) if density_open else ""
    lost = sum(load.verdict == "no result" for _, load in every)
    tail = f" No result for {number_of(lost, 'value')}." if lost else ""
    top = {k: max(abs(load.cfd) for name, load in every if name == k) for k, _ in every}
    agree = len(every) - len(off) - len(near) - lost
    if off:
        k, load = max(off, key=lambda x: x[1].times)
        loads = {name: [v for n, v in every if n == name] for name, _ in off}
        if left := [words for name, own in loads.items() if (words := _not_counted(name, own, elsewhere))]:
            tail += "".join(left)
        elif words := fluid or _one_factor(loads, units_open):
            tail += words
        else:
            slips = [_slip(name, own, None if name in unitless else name in units_open, density_open)
                     for name, own in loads.items()]  # fmt: skip
            said = [slip for slip in slips if slip[1]]  # a unit explains all that differs, or nothing
            tail += min(said, key=lambda slip: (math.isfinite(slip[0]), slip[0]))[1] if said else ""
        share = f" in {len(off)} of {len(every)} values" if len(every) > 1 else ""
        near_zero = abs(load.cfd) < _NEAR_ZERO * top[k]  # there the value is no measure of the difference
        share_of = f"{100.0 * load.difference / top[k]:+.0f} % of the largest" if near_zero else load.percent
        at = next(p for p in points if load in p.loads.values())
        where = f" at {speed_text(at.rpm)} rev/min, {number_text(at.airspeed_m_s, 4)} m/s" if len(points) > 1 else ""
        size = f"{_LOADS[k].split(' [')[0]} of BEMT is off by {share_of}{where}"
        return f"{who} and BEMT differ{share}: {size}, {load.times:.1f} times both bands together.{tail}"
    if near:
        worst = dict(sorted(near, key=lambda item: abs(item[1].difference)))  # of each load the farthest
        of = "in" if len(every) == len(worst) else "of the largest"
        sizes = " and ".join(f"{100.0 * load.difference / top[k]:+.0f} % {of} {_LOADS[k].split(' [')[0].lower()}"
                             for k, load in worst.items())  # fmt: skip
        if of == "in":
            return f"BEMT is off by {sizes}; both bands are too wide to call that a difference.{fluid}{tail}"
        rest = f"the others are within twice both bands, off by up to {sizes}"
        return f"{who} and BEMT agree in {agree} of {len(every)} values; {rest}.{fluid}{tail}"
    if lost == len(every):
        return f"No value of {who} and BEMT can be compared.{tail}"
    far = [(k, load) for k, load in every if abs(load.cfd) > _NEAR_ZERO * top[k] and load.u_both > 0.0]
    if not far:
        return f"{who} and BEMT agree within both bands.{tail}"
    k, load = max(far, key=lambda x: abs(x[1].difference / x[1].cfd))
    wide = f"both bands together are {100.0 * load.u_both / abs(load.cfd):.0f} %"
    return f"{who} and BEMT agree within both bands: BEMT is off by {load.percent} in " \
           f"{_LOADS[k].split(' [')[0].lower()}, {wide}.{tail}"  # fmt: skip


def _narrower(points: Sequence[PointOfRun], moved: Sequence[Moved]) -> str:
    """What most of both bands is, where they hide any difference: the unknown, or the spread of rotors as built."""
    key, load = next(iter(points[0].loads.items()))
    by, both = load.u_bemt_by, load.u_both
    widest = max(moved, key=lambda one: float(np.nan_to_num(one.u[key][0])), default=None) if key in _KIND else None
    differs = any(v.verdict not in ("agrees", "within 2 u") for p in points for v in p.loads.values())
    if differs or widest is None or max(by.values(), default=0.0) < load.u_cfd:
        return ""
    if by.get("input", 0.0) >= by.get("model", 0.0):
        part, what = float(widest.u[key][0]), f"{widest.unknown.key} measured and stated in the case"
    else:
        part, what = by["model"], "a clean run of this rotor on a stand, for `bemt lab calibrate-rotor`"
    rest, unit = math.sqrt(max(both**2 - part**2, 0.0)), _LOADS[key].split("[")[1].rstrip("]")
    return f"{what}: both bands together go from {number_text(both, 2)} to {number_text(rest, 2)} {unit} at best"


def _next(
    points: Sequence[PointOfRun], audit: Sequence[AuditLine], name: str, case: str, moved: Sequence[Moved]
) -> str:
    """What would tell more."""
    steps = [step] if (step := _narrower(points, moved)) else []
    name, case = shlex.quote(name), shlex.quote(case)
    if any(line.topic == "grid study" and line.status in ("fault", "not stated") for line in audit):
        steps.append("the same point on a finer grid (cells x 2 or more): its change is the u of the grid")
    if sum(len(p.loads.keys() - {"duct_share"}) for p in points) < 3:
        steps.append("two more speeds or airspeeds: one point fits any cause; then "
                     f"`bemt diagnose {name} OTHER_RUNS --case {case}`")  # fmt: skip
    else:
        steps.append(f"`bemt diagnose {name} --case {case}` names what fits all points, or says that it cannot")
    return "; ".join(steps)


def text(found: RunComparison, details: bool = False) -> str:
    """Lay it out on one screen; with `details` all points, notes and settings."""
    set_up = _set_up(found.conditions)
    who, bare = ("CFD", "set-up not stated") if found.kind == "cfd" else ("recorded", "a recording")
    lines = [_filled(found.sentence), "", f"{Path(found.run).name} ({set_up or bare}) and case {found.case}"]
    shown = found.points if details or len(found.points) <= _ROWS else found.points[: _ROWS - 1]
    if shown is not found.points:  # and the one of the largest difference behind them, or the next
        rest = found.points[_ROWS - 1 :]
        shown = (*shown, max(rest, key=lambda p: max(float(np.nan_to_num(v.times)) for v in p.loads.values())))
    rows = []
    for p in shown:
        head = [speed_text(p.rpm), number_text(p.airspeed_m_s, 4)]
        for name, load in p.loads.items():
            rows.append([
                *head, _LOADS[name], plus_minus(load.cfd, load.u_cfd), plus_minus(load.bemt, load.u_bemt),
                f"{number_text(load.difference, 3)} ({load.percent})", number_text(load.times, 2), load.verdict,
            ])  # fmt: skip
            head = ["", ""]
    lines.append(text_table(["rev/min", "V [m/s]", "", who, "BEMT", f"BEMT - {who}", "in u", ""], rows, (2, 7), "  "))
    if len(shown) < len(found.points):
        lines.append(f"  ... {len(found.points) - len(shown)} more points (--details)")
    first = next(iter(found.points[0].loads.values()))
    parts = ", ".join(f"{k} {number_text(v, 2)}" for k, v in first.u_bemt_by.items())
    lines.append(_filled(f"density {_span(p.density_kg_m3 for p in found.points)} kg/m3{_whose(found.notes)}", "  "))
    lines.append(f"  ±: one standard uncertainty; BEMT's in line 1: {parts}; in u: over both bands")
    for over in dict.fromkeys(found.averaged.values()):
        lines.append(f"  averaged: {', '.join(k for k, v in found.averaged.items() if v == over)}: {over}")
    lines += ["", "Audit of the CFD run"] if found.audit else []
    lines += map(_audited, found.audit if details else found.audit[:7])
    if keys := [KEYS[a.topic] for a in found.audit if a.status == "not stated" and a.topic in KEYS]:
        lines.append(_filled(f"`bemt import --setup KEY=VALUE` states: {', '.join(keys)}", "  "))
    flags = list(dict.fromkeys(f for p in found.points for f in p.flags))
    said = [f"! {n}" for n in (found.notes if details else found.notes[:4])]
    said += [f"! BEMT: {f}" for f in (flags if details else flags[:2])]
    said.append("No cause is named from one point." if len(found.points) == 1 else "No cause is named here.")
    lines += ["", *map(_filled, [*said, f"Next: {found.next}"])]
    return "\n".join(lines)


def _span(values: Iterable[float]) -> str:
    """One number, or the lowest and the highest."""
    own = list(values)
    low, high = number_text(min(own), 4), number_text(max(own), 4)
    return low if low == high else f"{low} to {high}"


def _whose(notes: Collection[str]) -> str:
    """That the density is the case's, where the recording states none."""
    return ", of the case: the recording states none" if any(map(_NO_DENSITY.match, notes)) else ""


def _set_up(told: Mapping[str, str]) -> str:
    """How a run was computed, as far as it says."""
    words = [f"{told[k]}{' ' + word if word else ''}" for k, word in _NAMES.items() if k in told]
    steady = {"yes": "steady", "no": "transient"}.get(told.get("steady", ""))
    return ", ".join([*words, *([steady] if steady else [])])


def _audited(line: AuditLine) -> str:
    """What one check of a run has found."""
    unsaid = line.finding.endswith("not stated") and line.consequence == "unknown"
    words = "not stated" if unsaid else ": ".join(filter(None, (line.finding, line.consequence)))
    lead = f"  {line.status:11s}"
    return _filled(f"{line.topic}: {words}", lead, " " * len(lead))


def _filled(words: str, lead: str = "", indent: str = "  ") -> str:
    return textwrap.fill(
        words, 120, initial_indent=lead, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


def plus_minus(value: float, u: float) -> str:
    """Number with its standard uncertainty."""
    return f"{number_text(value, 4)} ± {number_text(u if math.isfinite(u) else math.nan, 2, none='?')}"
