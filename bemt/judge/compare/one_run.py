"""One CFD run or recording and the model at its points: loads, both bands, the duct's share, the audit of the run.

No physics is named: one point cannot tell causes apart. `bemt.diagnose` does, from several.
"""

from __future__ import annotations

import math
import os
import shlex
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt import __version__
from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_of, number_text, speed_text, text_table
from bemt.data.recordings.audit import KEYS, AuditLine, combined
from bemt.data.recordings.cfd_run import is_run, of_rotor, run_at
from bemt.data.recordings.cfd_setup import audit_of, conditions_of, faults_first, floor_note, grid_floor, stated_setup
from bemt.data.recordings.channels import named
from bemt.judge.compare.slips import KIND, LOADS, WIDE, LeftOpen, first_check, fluid_of
from bemt.physics.dataset import Dataset
from bemt.rotors.case import Case
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.case.propagate import Moved, propagate
from bemt.rotors.conditioning import STAND
from bemt.rotors.propeller import rotor_of

SCHEMA = "bemt.run-comparison/1"
STAND_U = dict(zip(("thrust_N", "torque_Nm"), STAND.tolist(), strict=True))
"""Standard uncertainty of a load that a stand does not state, over its size [1]."""
_ROWS = 6  # points on one screen
_NEAR_ZERO = 0.1  # share of the largest value of a load below which a difference has no per cent
_NO_DENSITY = "density: not stated"
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
    path: str | os.PathLike[str] | Dataset, case: Any, progress: Callable[[str], None] | None = None, called: str = "",
    file: str = "",
) -> RunComparison:  # fmt: skip
    """Put one run (run.toml, a folder of exports, or a table of CFD points) and the model of a case side by side.

    A file that is no run, or of another rotor, is refused. `called` and `file` are what the case and a Dataset were
    typed as.
    """
    given = path if isinstance(path, Dataset) else None
    name = os.fspath(path) if not isinstance(path, Dataset) else file or path.file or path.name
    made = rotor_of(case).case
    points, imported = cfd_points(name, given, (made.diameter_m, float(made.air().rho), made.ducted))
    completed, of_case = _completed(points, made)
    full = completed.derive(made.diameter_m)
    keep = np.any([np.isfinite(full[k]) for k in ("thrust_N", "torque_Nm") if k in full], axis=0)
    rows = np.flatnonzero(keep & np.isfinite(full.rpm))
    if not rows.size:
        raise InputError(Fault(name, "", "no point with a speed and a load", "one or more"))
    step = None if progress is None else (lambda i, n, what: progress(f"{what} ({i}/{n})"))
    whole = propagate(
        made, full.rpm[rows], full.airspeed_m_s[rows], full.density_kg_m3[rows],
        angle_deg=_angle(full, rows, made, name), progress=step,
    )  # fmt: skip
    computed = imported.kind == "cfd" or bool(stated_setup(imported))
    lines: list[AuditLine] = []
    of_u, of_duct = [], []
    if computed:
        pitch = float(prepare_case(made, oblique=True).pitch_m)
        lines = [*audit_of(imported if len(imported) == len(full) else full, made.diameter_m, pitch, made.ducted,
                           float(made.air().a_sound), int(rows[0]))]  # fmt: skip
        flies = full.airspeed_m_s[rows] > 0.5
        if not is_run(imported):
            of_u = ["u of the file, and " + floor_note(bool(flies.any()), bool(flies.all()))]
        if made.ducted and "thrust_N" in full and "duct_thrust_N" not in full:
            of_duct = [f"thrust: no part of the duct stated; taken for the whole. The rotor's alone is "
                       f"{float(whole.points.rotor_thrust_N[0]):.4g} N by BEMT; --zones says what counts"]  # fmt: skip
    else:
        full, of_u = _with_u_of_stand(full, rows)
    out = tuple(_point(full, whole.points, int(i), k) for k, i in enumerate(rows))
    notes = dict.fromkeys([*made.as_built().no_check, *of_u, *points.notes, *of_case, *of_duct])
    asked = called or (made.path.as_posix() if isinstance(case, Case) else os.fspath(case))
    return RunComparison(
        name, made.name, "cfd" if computed else "bench", {k: ", ".join(v) for k, v in conditions_of(imported).items()},
        out, tuple(faults_first(lines)), combined(lines)[1] if lines else math.nan,
        dict(imported.averaged) if is_run(imported) else {}, tuple(notes),
        _sentence(out, "CFD" if computed else "Recording", LeftOpen.of(points, imported)),
        _next(out, lines, name, asked, whole.moved),
    )  # fmt: skip


def _completed(points: Dataset, case: Case) -> tuple[Dataset, list[str]]:
    """Points with what they do not state taken from the case, and notes that say so."""
    notes, values = [], dict(points.values)
    of_case = {"rpm": (case.rpm, "rev/min"), "airspeed_m_s": (case.airspeed_m_s, "m/s"),
               "density_kg_m3": (case.air().rho, "kg/m3")}  # fmt: skip
    for channel, (value, unit) in of_case.items():
        if channel not in points and not (channel == "airspeed_m_s" and "J" in points):
            notes.append(f"{channel.split('_')[0]}: not stated; {value:.6g} {unit} of the case")
            values[channel] = np.full(len(points), float(value))
    return replace(points, values=values), notes


def _with_u_of_stand(points: Dataset, rows: NDArray[np.intp]) -> tuple[Dataset, list[str]]:
    """A recording with the uncertainty of a usual stand where it states none, and the note of that."""
    missing = [k for k in STAND_U if k in points and np.isnan(points.u[k][rows]).any()]
    if not missing:
        return points, []
    usual = ", ".join(f"{LOADS[k][0]} {STAND_U[k]:.0%}" for k in missing)
    u = {k: np.where(np.isnan(points.u[k]), STAND_U[k] * np.abs(points[k]), points.u[k]) for k in missing}
    return replace(points, u={**points.u, **u}), [
        f"u of the recording: not stated; that of a stand which nobody calibrated, {usual} "
        "(a computed table says so by a column turbulence, cells or solver)"
    ]


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
    return "agrees" if abs(E) <= u else "within 2 u" if abs(E) <= WIDE * u else "differs"


def _sentence(points: Sequence[PointOfRun], who: str, open_: LeftOpen) -> str:
    """That loads differ and what to check first, that the bands are too wide to say, or that they agree."""
    every = [(k, load) for p in points for k, load in p.loads.items()]
    off, near, lost = ([(k, load) for k, load in every if load.verdict == verdict]
                       for verdict in ("differs", "within 2 u", "no result"))  # fmt: skip
    tail = f" No result for {number_of(len(lost), 'value')}." if lost else ""
    fluid = fluid_of([load for k, load in every if k in KIND], points[0].density_kg_m3) if open_.density else ""
    top = {k: max(abs(load.cfd) for name, load in every if name == k) for k, _ in every}
    if off:
        loads = {name: [load for k, load in every if k == name] for name, _ in off}
        share = f" in {len(off)} of {len(every)} values" if len(every) > 1 else ""
        return f"{who} and BEMT differ{share}: {_worst(points, off, top)}.{tail}{first_check(loads, fluid, open_)}"
    if near:
        worst = dict(sorted(near, key=lambda item: abs(item[1].difference)))  # of each load the farthest
        sizes = {k: f"{100.0 * load.difference / top[k]:+.0f} %" for k, load in worst.items()}
        if len(every) == len(worst):
            words = " and ".join(f"{size} in {LOADS[k][0]}" for k, size in sizes.items())
            return f"BEMT is off by {words}; both bands are too wide to call that a difference.{fluid}{tail}"
        words = " and ".join(f"{size} of the largest {LOADS[k][0]}" for k, size in sizes.items())
        agree = f"{who} and BEMT agree in {len(every) - len(near) - len(lost)} of {len(every)} values"
        return f"{agree}; the others are within twice both bands, off by up to {words}.{fluid}{tail}"
    if len(lost) == len(every):
        return f"No value of {who} and BEMT can be compared.{tail}"
    return f"{who} and BEMT agree within both bands{_largest(every, top)}.{tail}"


def _largest(every: Sequence[tuple[str, BothLoads]], top: Mapping[str, float]) -> str:
    """Largest difference of loads that agree, and how wide the bands are there; "" where all are near zero."""
    far = [(k, load) for k, load in every if abs(load.cfd) > _NEAR_ZERO * top[k] and load.u_both > 0.0]
    if not far:
        return ""
    k, load = max(far, key=lambda item: abs(item[1].difference / item[1].cfd))
    wide = f"both bands together are {100.0 * load.u_both / abs(load.cfd):.0f} %"
    return f": BEMT is off by {load.percent} in {LOADS[k][0]}, {wide}"


def _worst(points: Sequence[PointOfRun], off: Sequence[tuple[str, BothLoads]], top: Mapping[str, float]) -> str:
    """Load that is farthest off, and at which point; ``top``: largest value of each load."""
    k, load = max(off, key=lambda item: item[1].times)
    near_zero = abs(load.cfd) < _NEAR_ZERO * top[k]  # there the value is no measure of the difference
    size = f"{100.0 * load.difference / top[k]:+.0f} % of the largest" if near_zero else load.percent
    at = next(p for p in points if load in p.loads.values())
    where = f" at {speed_text(at.rpm)} rev/min, {number_text(at.airspeed_m_s, 4)} m/s" if len(points) > 1 else ""
    return f"{LOADS[k][0]} of BEMT is off by {size}{where}, {load.times:.1f} times both bands together"


def _narrower(points: Sequence[PointOfRun], moved: Sequence[Moved]) -> str:
    """What most of both bands is, where they hide any difference: the unknown, or the spread of rotors as built."""
    key, load = next(iter(points[0].loads.items()))
    by, both = load.u_bemt_by, load.u_both
    widest = max(moved, key=lambda one: float(np.nan_to_num(one.u[key][0])), default=None) if key in KIND else None
    differs = any(v.verdict not in ("agrees", "within 2 u") for p in points for v in p.loads.values())
    if differs or widest is None or max(by.values(), default=0.0) < load.u_cfd:
        return ""
    if by.get("input", 0.0) >= by.get("model", 0.0):
        part, what = float(widest.u[key][0]), f"{widest.unknown.key} measured and stated in the case"
    else:
        part, what = by["model"], "a clean run of this rotor on a stand, for `bemt lab calibrate-rotor`"
    rest = math.sqrt(max(both**2 - part**2, 0.0))
    sizes = f"{number_text(both, 2)} to {number_text(rest, 2)} {LOADS[key][1]}"
    return f"{what}: both bands together go from {sizes} at best"


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
    who, bare = ("CFD", "set-up not stated") if found.kind == "cfd" else ("recorded", "a recording")
    shown = found.points if details else _shown(found.points)
    first = next(iter(found.points[0].loads.values()))
    parts = ", ".join(f"{k} {number_text(v, 2)}" for k, v in first.u_bemt_by.items())
    header = ["rev/min", "V [m/s]", "", who, "BEMT", f"BEMT - {who}", "in u", ""]
    lines = [
        _filled(found.sentence), "",
        f"{Path(found.run).name} ({_set_up(found.conditions) or bare}) and case {found.case}",
        text_table(header, [row for p in shown for row in _rows(p)], (2, 7), "  "),
    ]  # fmt: skip
    whose = ", of the case: the recording states none" if any(n.startswith(_NO_DENSITY) for n in found.notes) else ""
    if left := len(found.points) - len(shown):
        lines.append(f"  ... {left} more points (--details)")
    lines.append(_filled(f"density {_span(p.density_kg_m3 for p in found.points)} kg/m3{whose}", "  "))
    lines.append(f"  ±: one standard uncertainty; BEMT's in line 1: {parts}; in u: over both bands")
    for over in dict.fromkeys(found.averaged.values()):
        lines.append(f"  averaged: {', '.join(k for k, v in found.averaged.items() if v == over)}: {over}")
    if found.audit:
        lines += ["", "Audit of the CFD run", *map(_audited, found.audit if details else found.audit[:7])]
    if keys := [KEYS[a.topic] for a in found.audit if a.status == "not stated" and a.topic in KEYS]:
        lines.append(_filled(f"`bemt import --setup KEY=VALUE` states: {', '.join(keys)}", "  "))
    flags = list(dict.fromkeys(f for p in found.points for f in p.flags))
    said = [f"! {n}" for n in (found.notes if details else found.notes[:4])]
    said += [f"! BEMT: {f}" for f in (flags if details else flags[:2])]
    said.append("No cause is named from one point." if len(found.points) == 1 else "No cause is named here.")
    return "\n".join([*lines, "", *map(_filled, [*said, f"Next: {found.next}"])])


def _shown(points: tuple[PointOfRun, ...]) -> tuple[PointOfRun, ...]:
    """Points that fit on one screen: the first ones, and the one of the largest difference behind them, or the next."""
    if len(points) <= _ROWS:
        return points
    rest = points[_ROWS - 1 :]
    worst = max(rest, key=lambda p: max(float(np.nan_to_num(v.times)) for v in p.loads.values()))
    return *points[: _ROWS - 1], worst


def _rows(p: PointOfRun) -> list[list[str]]:
    """One row for each load of a point; speed and airspeed in the first."""
    head, rows = [speed_text(p.rpm), number_text(p.airspeed_m_s, 4)], []
    for name, load in p.loads.items():
        word, unit = LOADS[name]
        rows.append([
            *head, f"{word} [{unit}]" if unit else word, plus_minus(load.cfd, load.u_cfd),
            plus_minus(load.bemt, load.u_bemt), f"{number_text(load.difference, 3)} ({load.percent})",
            number_text(load.times, 2), load.verdict,
        ])  # fmt: skip
        head = ["", ""]
    return rows


def _span(values: Iterable[float]) -> str:
    """One number, or the lowest and the highest."""
    own = list(values)
    low, high = number_text(min(own), 4), number_text(max(own), 4)
    return low if low == high else f"{low} to {high}"


def _set_up(told: Mapping[str, str]) -> str:
    """How a run was computed, as far as it says."""
    words = [f"{told[k]}{' ' + word if word else ''}" for k, word in _NAMES.items() if k in told]
    steady = {"yes": "steady", "no": "transient"}.get(told.get("steady", ""))
    return ", ".join([*words, *([steady] if steady else [])])


def _audited(line: AuditLine) -> str:
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
