"""What the exports wrote, run in the programs that read them: ``python docs/read_back.py`` rewrites docs/exports.md.

``python docs/read_back.py throttles`` runs every shipped case and three labels from rest at five throttles, at each
program's own step, into docs/throttles.csv. ``python docs/read_back.py TARGET [TARGET ...]`` runs these targets, in
processes of their own, and keeps what it measured in docs/read_back.json with version and date; without a target, the
page is written from there. A program runs the export of a right-handed and of a left-handed rotor at the same operating
points as BEMT. Needs ``pip install 'bemt[simulators]'``, and from Debian ``ignition-tools`` with ``libsdformat-dev``
(Gazebo) and ``openfoam``.
"""

from __future__ import annotations

import datetime
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bemt.base.tables import csv_text, write_atomic
from bemt.rotors.case import Case, load_case
from bemt.rotors.propeller import rotor_of
from bemt.tools.drive import drive_result
from bemt.tools.drive.drive_result import with_drive
from bemt.tools.exports import exports
from bemt.tools.exports.base import Job, LoadsExport
from bemt.tools.exports.jsbsim import motor_of
from bemt.tools.exports.parts import entry
from bemt.tools.exports.performance import oblique_loads, solve_points

sys.path.insert(0, str(Path(__file__).resolve().parent))
import qprop_equations
from simulators import PROGRAMS, STARTED, installed

DOCS = Path(__file__).resolve().parent
CASES = DOCS.parent / "cases"
KEPT = DOCS / "read_back.json"
STARTED_CSV = DOCS / "throttles.csv"


def compared(word: str, job: Job) -> dict[str, Any]:
    """One run beside BEMT and beside the target's own formula; loads in per cent of the greatest at that speed."""
    with tempfile.TemporaryDirectory() as place:
        ran = PROGRAMS[word].run(job, Path(place))
    out: dict[str, Any] = {"points": len(ran.rpm), "sense_kept": ran.sense == job.case.rotor().rotation}
    if not out["points"]:
        return out
    rpm, V = np.asarray(ran.rpm, dtype=float), np.asarray(ran.airspeed_m_s, dtype=float)
    rho = job.case.air().rho
    scale = 1.0 if ran.rho is None else np.asarray(ran.rho) / rho
    rest = solve_points(job.case, rpm, 0.0)
    truth = solve_points(job.case, rpm, V)
    target = exports()[word]
    written = target.loads(target.write(job), rpm, V) if isinstance(target, LoadsExport) else (None, None)
    for k, (name, got) in enumerate((("thrust", ran.thrust_N), ("torque", ran.torque_Nm))):
        exact, most = getattr(truth, {"thrust": "thrust_N", "torque": "torque_Nm"}[name]), None
        most = np.maximum(np.abs(exact), getattr(rest, {"thrust": "thrust_N", "torque": "torque_Nm"}[name]))
        value = np.asarray(got, dtype=float) / scale
        out[f"{name}_pct"] = float(100.0 * np.max(np.abs(value - exact) / most))
        if written[k] is not None:
            out[f"{name}_formula_pct"] = float(100.0 * np.max(np.abs(value - written[k]) / most))
    return out


HUB = ("thrust", "torque", "H", "Y", "roll", "pitch")


def hub_compared(word: str, job: Job) -> dict[str, Any]:
    """One run in a wind across the shaft: in per cent of thrust at rest, its torque, and thrust times radius."""
    run, target = PROGRAMS[word].skewed, exports()[word]
    if run is None or not isinstance(target, LoadsExport):
        return {}
    with tempfile.TemporaryDirectory() as place:
        ran = run(job, Path(place))
    rpm, v = np.asarray(ran.rpm, dtype=float), np.asarray(ran.velocity_m_s, dtype=float)
    at = rpm, v[:, 2], np.hypot(v[:, 0], v[:, 1])
    rest, R = solve_points(job.case, rpm, 0.0), 0.5 * job.performance.diameter_m
    full = np.array([rest.thrust_N, rest.torque_Nm, rest.thrust_N, rest.thrust_N, R * rest.thrust_N, R * rest.thrust_N])
    scale = 1.0 if ran.rho is None else np.asarray(ran.rho) / job.case.air().rho
    got = ran.loads(job.performance.sense) / scale
    written = target.hub_loads(target.write(job), *at)
    assert written is not None
    exact = oblique_loads(job.case, *at)
    off = 100.0 * np.max(np.abs(got - exact) / full, axis=1)
    file = 100.0 * np.nanmax(np.abs(got - np.where(np.isnan(written), got, written)) / full)
    held = ~np.isnan(written).any(axis=1)
    named = {name: float(x) if there else None for name, x, there in zip(HUB, off, held, strict=True)}
    return {"hub_points": int(rpm.size), "hub_pct": named, "hub_formula_pct": float(file)}


def example(rotation: str = "right") -> Job:
    """The 10x5 of `cases/`, up to 10,000 rev/min, at 8 m/s."""
    return Job(load_case(CASES / "prop_10x5/case.toml").replaced({"rotor.rotation": rotation}), 10_000.0, 8.0)


def measured(word: str) -> dict[str, Any]:
    """Both directions of rotation."""
    found: dict[str, Any] = _apart("--child", word)
    return found


def _apart(what: str, word: str) -> Any:
    """Run one target in a process of its own: not all libraries bear each other."""
    call = [sys.executable, str(DOCS / "read_back.py"), what, word]
    out = subprocess.run(call, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(DOCS.parent)})
    found = [line for line in out.stdout.splitlines() if line.startswith("measured ")]
    if not found:
        raise RuntimeError(f"{word}: {out.stderr[-3000:]}")
    return json.loads(found[-1].removeprefix("measured "))


def _child(word: str) -> dict[str, Any]:
    right, left = (compared(word, example(hand)) | hub_compared(word, example(hand)) for hand in ("right", "left"))
    hub = {}
    if "hub_pct" in right:
        pairs = {k: (right["hub_pct"][k], left["hub_pct"][k]) for k in HUB}
        hub = {"hub_points": right["hub_points"],
               "hub_pct": {k: None if None in pair else max(pair) for k, pair in pairs.items()}}  # fmt: skip
    both = {key: max(value, left[key]) for key, value in right.items() if key.endswith("_pct") and key != "hub_pct"}
    kept = right["sense_kept"] and left["sense_kept"]
    return {"program": PROGRAMS[word].version(), "points": right["points"], "sense_kept": kept, **both, **hub}


THROTTLES = (0.2, 0.4, 0.6, 0.8, 1.0)
LABELS = (("5x4.3x3", 2400.0, 4), ("10x4.7SF", 1000.0, 3), ("16x5.5", 380.0, 6))
"""Labels beside the shipped cases, with K_v [rev/min/V] and cells."""
ROWS = ("case", "target", "throttle", "rpm_library", "thrust_N_library", "torque_Nm_library", "rpm", "thrust_N",
        "torque_Nm", "thrust_off_pct", "torque_off_pct", "over_pct")  # fmt: skip


def started_cases() -> list[Case]:
    """Every shipped case, and labels with a motor."""
    shipped = [load_case(path) for path in sorted(CASES.glob("*/case.toml"))]
    return shipped + [with_drive(rotor_of(label).case, kv=kv, cells=cells) for label, kv, cells in LABELS]


def library_at(job: Job, throttle: float) -> tuple[float, float, float]:
    """Speed [rev/min], thrust and torque at rest by the library: its drive, else BEMT on the motor that stands in."""
    from scipy.optimize import brentq

    if job.case.file.drive is not None:
        drive, _, _ = drive_result._carried(job.case, 0.0, (), lambda _c, _d: {}, bands=False)
        e = drive.esc
        pulse = e.pulse_min_us + throttle * (e.pulse_max_us - e.pulse_min_us)
        one = drive.steady(pulse, job.case.file.drive.soc)
        rpm = float(one.rpm[0])
    else:
        motor = motor_of(job)

        def surplus(n: float) -> float:
            return float(motor.torque(np.array(throttle), np.array(n))) - float(
                solve_points(job.case, n, 0.0).torque_Nm[0]
            )

        rpm = float(brentq(surplus, 0.03 * job.performance.rpm[-1], job.performance.rpm[-1] * 1.001))
    found = solve_points(job.case, rpm, 0.0)
    return rpm, float(found.thrust_N[0]), float(found.torque_Nm[0])


def _started(word: str) -> list[dict[str, Any]]:
    """Rows of one target, all cases and throttles."""
    rows = []
    for case in started_cases():
        job = Job(case)
        for throttle in THROTTLES:
            rpm, T, Q = library_at(job, throttle)
            with tempfile.TemporaryDirectory() as place:
                ran = STARTED[word](job, Path(place), throttle, rpm)
            off = (100.0 * (got / own - 1.0) for got, own in ((ran.thrust_N, T), (ran.torque_Nm, Q)))
            values = (case.name, word, throttle, rpm, T, Q, ran.rpm, ran.thrust_N, ran.torque_Nm, *off, ran.over_pct)
            rows.append(dict(zip(ROWS, values, strict=True)))
    return rows


def throttles() -> None:
    """Run all targets from rest and write docs/throttles.csv."""
    rows = [row for word in STARTED for row in _apart("--started", word)]
    shown = [{k: v if isinstance(v, str) else float(f"{v:.5g}") for k, v in row.items()} for row in rows]
    write_atomic(STARTED_CSV, csv_text(list(ROWS), shown))


FORMULA = {
    "gazebo": "T = k W^2 with one k for all speeds: no Reynolds number",
    "px4": "one CT and CP for all speeds: no Reynolds number",
    "ardupilot": "T of the share of full speed, fitted to rest and flight at once: the static end pays for T(V)",
}


def _started_rows() -> str:
    """Worst of all cases and throttles, by target."""
    table = pd.read_csv(STARTED_CSV)
    out = []
    for word in STARTED:
        rows = table[table.target == word]
        worst = [f"{rows[c].abs().max():.2g}" for c in ("thrust_off_pct", "torque_off_pct")]
        over = f"{rows.over_pct.max():.1f}" if word in ("jsbsim", "mujoco", "fmu") else "-"
        out.append(f"| `{word}` | " + " | ".join([*(w.replace("nan", "-") for w in worst), over]) + " |")
    return "\n".join(out)


def _qprop() -> str:
    """Differences of QPROP's equations, at rest and in flight."""
    rows = list(qprop_equations.compared())
    said = []
    for when, some in (("at rest", [r for r in rows if r[2] == 0.0]), ("in flight", [r for r in rows if r[2] > 0.0])):
        spans = [f"{load} {min(r[k] for r in some):+.1f} to {max(r[k] for r in some):+.1f} %"
                 for k, load in ((3, "thrust"), (4, "torque"))]  # fmt: skip
        said.append(f"{when} {' and '.join(spans)}")
    return "; ".join(said)


SEEN = {
    "dfdc": ("DFDC 0.70, built from its source", "2026-11-26", "`ds30`: thrust +8 to +14 %, torque +23 to +28 % of "
             "BEMT's, because the file has neither stator nor tip gap, and its sections are parabolas; like for like, "
             "see [Ducts](duct.md). Use 30 stations: with 40 or 60 it is NaN"),
    "openfoam": ("OpenFOAM 1912 of Debian", "2026-11-23", "10x5, 10,000 rev/min, at rest, level 5: Allrun ends with "
                 "11.4 N and 0.205 N m; BEMT 13.5 N and 0.200 N m; the grid is the coarsest and shows no convergence"),
    "qprop": ("its own equations (docs/qprop_equations.py)", "2026-11-28", "the four propellers of `cases/`, "
              "numbers below; QPROP's own gvcalc.f, tqcalc.f and cdfun.f, built, agree with them within 0.1 %"),
    "xrotor": ("XROTOR 7.55, built from its source", "2026-11-26", "10x5: thrust and torque within +3.9 to -0.5 % of "
               "BEMT's"),
}  # fmt: skip
"""Runs by hand, of programs that neither Debian nor PyPI has, or that take long: program, date, what it said."""

TEXT = {
    "ardupilot": "formula of its source (SIM_Motor.cpp)",
    "c81": "our reader",
    "fan": "profile by its grammar, integrals of the rows",
    "flow360": "shapes and units",
    "px4": "formula of its source (sih.cpp), ranges of its parameters",
    "su2-disk": "layout of its test case, integrals of the rows",
    "vbm": "tables by their grammar, loads at the angles of the point",
}
"""What the text of a target was checked with where its program was not run."""


def _percent(value: Any) -> str:
    if isinstance(value, dict):
        value = value.get("flight")
    if value is None:
        return "-"
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}" if value > 1e-3 else "0.001"


def _program(word: str, kept: dict[str, Any]) -> str:
    """Last columns of a row: program, deviation of thrust and of torque, direction, date."""
    if word in kept:
        run = kept[word]
        if not PROGRAMS[word].loads:
            turns = "kept" if run["sense_kept"] else "LOST"
            return f"read, not flown: {run['program']} | - | - | {turns} | {run['date']} |"
        off = (_percent(run.get(f"{name}_pct")) for name in ("thrust", "torque"))
        return f"{run['program']} | {' | '.join(off)} | {'kept' if run['sense_kept'] else 'LOST'} | {run['date']} |"
    held = "kept" if "rotation" in exports()[word].features else "not held"
    if word in SEEN:
        return f"by hand, below | - | - | {held} | {SEEN[word][1]} |"
    return f"text only: {TEXT.get(word, 'formula of its source')} | - | - | {held} | - |"


def _hub_rows(kept: dict[str, Any]) -> str:
    rows = []
    for word, target in exports().items():
        if "hub" not in target.features:
            continue
        run = kept.get(word, {})
        if "hub_pct" in run:
            cells = [_percent(run["hub_pct"][name]) for name in HUB]
            rows.append(f"| `{word}` | {' | '.join(cells)} | {run['hub_points']} |")
    return "\n".join(rows)


def page() -> str:
    """Text of docs/exports.md."""
    job = example()
    fan = Job(load_case(CASES / "ds30/case.toml"), None, 20.0)
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    still = 0.0
    kinds: dict[str, list[str]] = {"solid": [], "loads": [], "disk": [], "blade": []}
    for word, target in exports().items():
        row = f"| `{word}` | {target.holds} |" if target.kind != "solid" else f"`{word}`"
        if target.kind == "loads":
            error = entry(target, job, target.write(job))["fit_error_pct"]
            still = error["thrust"]["at_rest"] if word == "gazebo" else still
            row += f" {_percent(error['thrust'])} | {_percent(error['torque'])} |"
        if target.kind == "blade":
            asked = fan if word == "dfdc" else job
            error = entry(target, asked, target.write(asked))["section_error"]
            row += " - | - |" if error is None else f" {error['cl']:.2f} | {error['cd_pct']:.0f} |"
        if target.kind != "solid":
            row += " " + _program(word, kept)
        kinds[target.kind].append(row)
    ran = "run in | thrust off, % | torque off, % | rotation | date |"
    line = "|---|---|---|---|---|---|---|"
    by_hand = {word: f"* `{word}`, {program}, {date}: {what}." for word, (program, date, what) in SEEN.items()}
    blades = "\n".join(line for word, line in by_hand.items() if word in exports() and exports()[word].kind == "blade")
    return f"""# Exports: one propeller for simulators, disks and design tools

Generated by `python docs/read_back.py`; do not edit.

    bemt export CASE --out DIR --format TARGET [TARGET ...]

Each simulator model, disk and blade gets a folder of its own, such as `DIR/jsbsim`. Solids are files in DIR, and
`openfoam` makes DIR the case: `cd DIR && ./Allrun`. `DIR/manifest.json` says what each target can represent, the fit
error, the band of the prediction, conventions, the direction of rotation, and the valid range. `--hold reynolds` (or
torque, airspeed, windmill, mach, density, rest, duct, sections, rotation, hub) refuses targets that cannot represent
it; the others are written and the exit code is 2.

"Run in": the program that took the file, right- and left-handed. "Off": the greatest difference to BEMT, in per cent
of the greatest load at that speed. "Text only": no program has read the file. All rows are for the 10x5 in `cases/` up
to 10,000 rev/min; `dfdc` uses the fan `ds30`.

## Thrust and torque for simulators

| target | represents | thrust error, % | torque error, % | {ran}
{line}--|--|
{chr(10).join(kinds["loads"])}

The errors are those of the model class, from static to zero thrust. Targets of one or three numbers err with speed,
too: they are right at rest at `--rpm`. A single constant (`gazebo`) is within {still:.0f} % at rest and off by the
whole thrust in flight.

### From rest, at the program's own step

Five throttles (20 to 100 %) of every shipped case and of three labels. Greatest difference to the library, in per cent
of the load at that throttle ([all rows](throttles.csv)). Gazebo, PX4 SIH and ArduPilot were not run: these are the
formulas of their sources.

| target | thrust off, % | torque off, % | overshoot, % |
|---|---|---|---|
{_started_rows()}

JSBSim's motor is that of the case's `[drive]`, without one as large as the rotor needs; where light blades would
overshoot its explicit Euler, `ixx` is raised. [hover.py](hover.py) (MuJoCo) and [zero_thrust.py](zero_thrust.py)
(JSBSim) run the exported 10x5 without a controller.

## Loads across the shaft

[Wind at an angle to the shaft](oblique.md) adds a force H, a side force Y, and moments of the hub (stiff blades).
Greatest difference to BEMT's oblique solve, right- and left-handed, 10 to 110 deg to the shaft, in per cent of the
thrust at rest, its torque, and thrust times radius; "-": the target has no such load.

| target | thrust | torque | H | Y | roll | pitch | points |
|---|---|---|---|---|---|---|---|
{_hub_rows(kept)}

In JSBSim the shaft power stays that of axial flow.

## Disks for flow solvers

| target | represents | {ran}
{line}
{chr(10).join(kinds["disk"])}

`fan`, `rotor-disk` and `su2-disk` prescribe the load from BEMT; `flow360` and `vbm` solve the inflow themselves. `fan`
is a radial profile for Fluent, the same as a table for STAR-CCM+, and `fan.txt` with axis, direction and units. `vbm`
has what Fluent's Virtual Blade Model and the blade-element virtual disk of STAR-CCM+ read: `sections.csv` (radius,
chord, twist, airfoil of 20 stations, to be typed), one airfoil file and one table per station, and `disk.txt`. The
tables are those of the solver, the other blades and the Mach number included; duct and gap belong into your mesh. At
the angles of the point they give the rotor's loads within 0.5 %; a gap is then missing (3 % of thrust in `ds30`).
OpenFOAM's `rotorDisk` with ordinary section tables is wrong for propellers: the torque lacks cl sin(phi)
([reports/disk](../reports/disk/README.md)).

## Blades for design tools

| target | represents | cl off | cd off, % | {ran}
{line}--|--|
{chr(10).join(kinds["blade"])}

"Off" of sections is the greatest error of the fit between the stalls; C81 holds the tables themselves. These programs
have wake models of their own, so their loads are not those of BEMT. Runs by hand:

{blades}

The exported files in QPROP's equations, beside BEMT:
{_qprop()}.
QPROP takes the reference Reynolds number of the first station for all (a slip of its tqcalc.f), so the file has one.

`bemt lab stations FILE` turns an XROTOR, QPROP or DFDC file into a case.

## Solids

{", ".join(kinds["solid"])}: the shape; `flow` is the air around it, `zone` the cylinder
that turns, `openfoam` a case that finds the loads.
An STL has one named solid per surface, and they are closed together: merge equal corners
(`trimesh.load(FILE, force="mesh")`, then `merge_vertices()`). OBJ, 3MF and STEP are closed as they are read.

{by_hand["openfoam"]}
"""


def main(words: list[str]) -> int:
    """Run the targets, keep what they said, write the page; 1 where a program is missing."""
    if "throttles" in words:
        throttles()
        words = [word for word in words if word != "throttles"]
    missing = [word for word in words if not installed(word)]
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    for word in words:
        if word not in missing:
            kept[word] = measured(word) | {"date": datetime.datetime.now(datetime.UTC).date().isoformat()}
            print(f"{word}: {kept[word]}", flush=True)
    write_atomic(KEPT, json.dumps(dict(sorted(kept.items())), indent=1) + "\n")
    write_atomic(DOCS / "exports.md", page())
    if missing:
        print(f"not installed, kept as they were: {', '.join(missing)}", file=sys.stderr)
    return 1 if missing else 0


if __name__ == "__main__":
    if sys.argv[1:2] in (["--child"], ["--started"]):
        ask = _child if sys.argv[1] == "--child" else _started
        print("\nmeasured " + json.dumps(ask(sys.argv[2])), flush=True)
        os._exit(0)  # without what native libraries do on the way out
    sys.exit(main(sys.argv[1:]))
