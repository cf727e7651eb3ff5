"""What the exports wrote, read back by the programs themselves: ``python docs/read_back.py`` rewrites docs/exports.md.

Each function takes a job and a folder, runs the program and gives the greatest error against what the file should say,
relative to the greatest load. Programs that are not installed are skipped. Needs ``pip install 'bemt[simulators]'``.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.tables import write_atomic
from bemt.case import load_case
from bemt.exports import exports
from bemt.exports.base import Job, LoadsExport, entry

DOCS = Path(__file__).resolve().parent
CASES = DOCS.parent / "cases"


def points(job: Job, count: int, seed: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [rev/min] and airspeeds [m/s] inside the flight range."""
    t = job.performance
    rng = np.random.default_rng(seed)
    rpm = rng.uniform(t.rpm[0], t.rpm[-1], count)
    return rpm, rng.uniform(0.0, 1.0, count) * np.interp(rpm, t.rpm, t.J_zero) * rpm / 60.0 * t.diameter_m


def _save(word: str, job: Job, folder: Path) -> Path:
    for name, data in exports()[word].write(job).items():
        write_atomic(folder / name, data)
    return folder


def _worst(job: Job, word: str, rpm: Any, V: Any, T: Any, Q: Any, rho: Any = None) -> float:
    """Greatest difference to the target's own formula on the written files, over the greatest load."""
    target = exports()[word]
    assert isinstance(target, LoadsExport)
    want_T, want_Q = target.loads(target.write(job), np.asarray(rpm), np.asarray(V))
    scale = 1.0 if rho is None else np.asarray(rho) / job.performance.rho
    return float(max(np.abs(np.asarray(T) / scale - want_T).max() / np.abs(want_T).max(),
                     np.abs(np.asarray(Q) / scale - want_Q).max() / np.abs(want_Q).max()))  # fmt: skip


def table(job: Job, folder: Path) -> float:
    """C header, compiled."""
    _save("table", job, folder)
    name = job.case.name
    rpm, V = points(job, 40)
    rho = job.performance.rho
    calls = "".join(f"{name}_loads({n!r}, {v!r}, {rho!r}, &T, &Q); printf(\"%.17g %.17g\\n\", T, Q);\n"
                    for n, v in zip(rpm.tolist(), V.tolist(), strict=True))  # fmt: skip
    main = f'#include <stdio.h>\n#include "{name}.h"\nint main(void) {{ double T, Q;\n{calls}return 0; }}\n'
    (folder / "main.c").write_text(main, encoding="utf-8")
    program = str(folder / "program")
    flags = ["-std=c99", "-Wall", "-Werror", "-o", program, str(folder / "main.c")]
    subprocess.run([shutil.which("cc") or "gcc", *flags], check=True)
    out = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    T, Q = np.array([line.split() for line in out.splitlines()], dtype=float).T
    return _worst(job, "table", rpm, V, T, Q)


def jsbsim(job: Job, folder: Path) -> float:
    """The stand of the export in a wind tunnel, at the speeds that it settles to."""
    import jsbsim as program

    _save("jsbsim", job, folder)
    rows = []
    for V, throttle in ((0.0, 0.1), (0.0, 0.6), (6.0, 0.05), (12.0, 0.5), (20.0, 0.8)):
        fdm = program.FGFDMExec(str(folder))
        fdm.set_debug_level(0)
        fdm.set_aircraft_path("aircraft")
        fdm.set_engine_path("engine")
        fdm.set_systems_path("systems")
        assert fdm.load_model(f"{job.case.name}_stand")
        fdm.set_dt(1.0 / 2000.0)
        fdm.run_ic()
        fdm["forces/hold-down"] = 1
        fdm["atmosphere/wind-north-fps"] = -V / 0.3048
        fdm["propulsion/set-running"] = -1
        fdm["fcs/throttle-cmd-norm"] = throttle
        for _ in range(6000):
            rpm = fdm["propulsion/engine/propeller-rpm"]  # the loads of a step are those of the speed before it
            fdm.run()
        power = fdm["propulsion/engine/propeller-power-ftlbps"] * 1.3558179483314
        rows.append((rpm, V, fdm["propulsion/engine/thrust-lbs"] * 4.4482216152605, power / (rpm * np.pi / 30.0),
                     fdm["atmosphere/rho-slugs_ft3"] * 515.378818))  # fmt: skip
    return _worst(job, "jsbsim", *np.transpose(rows))


def mujoco(job: Job, folder: Path) -> float:
    """Forces that the actuators put on the body."""
    import mujoco as program

    _save("mujoco", job, folder)
    space: dict[str, Any] = {}
    exec((folder / f"{job.case.name}_mujoco.py").read_text(encoding="utf-8"), space)
    model = program.MjModel.from_xml_path(str(folder / f"{job.case.name}.xml"))
    data = program.MjData(model)
    propeller = space["Propeller"](model)
    rpm, V = points(job, 12)
    T, Q = [], []
    for n, v in zip(rpm, V, strict=True):
        program.mj_resetData(model, data)
        data.qvel[2] = v
        program.mj_forward(model, data)
        propeller.rpm = n
        propeller(model, data)
        program.mj_forward(model, data)
        T.append(data.qfrc_actuator[2])
        Q.append(-job.performance.sense * data.qfrc_actuator[5])
    return _worst(job, "mujoco", rpm, V, T, Q)


def rotorpy(job: Job, folder: Path) -> float:
    """Force and yaw moment of a vehicle on which one rotor turns."""
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    space: dict[str, Any] = {}
    exec(next((_save("rotorpy", job, folder)).glob("*.py")).read_text(encoding="utf-8"), {}, space)
    still = dict.fromkeys(("c_Dx", "c_Dy", "c_Dz", "k_d", "k_h", "k_flap"), 0.0)
    vehicle = Multirotor({**quad_params, **space["rotor_params"], **still}, aero=True)
    rpm, V = points(job, 12)
    T, Q = [], []
    for n, v in zip(rpm, V, strict=True):
        speeds = np.array([n * np.pi / 30.0, 0.0, 0.0, 0.0])
        force, moment = vehicle.compute_body_wrench(np.zeros(3), speeds, np.array([0.0, 0.0, v]))
        T.append(force[2])
        Q.append(abs(moment[2]))
    return _worst(job, "rotorpy", rpm, V, T, Q)


def fmu(job: Job, folder: Path) -> float:
    """Co-simulation by fmpy: the loads of an input stand at the end of its step."""
    import fmpy

    _save("fmu", job, folder)
    rpm, V = points(job, 6)
    kinds = [("time", "<f8"), ("rpm", "<f8"), ("airspeed_m_s", "<f8")]
    signals = np.array([(float(i), n, v) for i, (n, v) in enumerate(zip(rpm, V, strict=True))], dtype=kinds)
    found = fmpy.simulate_fmu(str(folder / f"{job.case.name}.fmu"), stop_time=5.0, step_size=1.0, output_interval=1.0,
                              input=signals, output=["thrust_N", "torque_Nm"])  # fmt: skip
    return _worst(job, "fmu", rpm[:5], V[:5], found["thrust_N"][1:6], found["torque_Nm"][1:6])


def flow360(job: Job, folder: Path) -> float:
    """The disk as the package's own BETDisk, which checks shapes and units; no loads: 0."""
    import json

    import flow360 as program

    disk = json.loads((_save("flow360", job, folder) / "bet_disk.json").read_text(encoding="utf-8"))["BETDisks"][0]
    m, deg = program.u.m, program.u.deg
    with program.SI_unit_system:
        made = program.BETDisk(
            entities=[program.Cylinder(name="disk", center=(0, 0, 0) * m, axis=(0, 0, 1),
                                       height=disk["thickness"] * m, outer_radius=disk["radius"] * m)],
            rotation_direction_rule=disk["rotationDirectionRule"], number_of_blades=disk["numberOfBlades"],
            omega=disk["omega"] * job.performance.a_sound * program.u.rad / program.u.s,
            chord_ref=disk["chordRef"] * m, n_loading_nodes=disk["nLoadingNodes"], mach_numbers=disk["MachNumbers"],
            reynolds_numbers=disk["ReynoldsNumbers"], alphas=disk["alphas"] * deg,
            twists=[program.BETDiskTwist(radius=t["radius"] * m, twist=t["twist"] * deg) for t in disk["twists"]],
            chords=[program.BETDiskChord(radius=c["radius"] * m, chord=c["chord"] * m) for c in disk["chords"]],
            sectional_polars=[program.BETDiskSectionalPolar(lift_coeffs=p["liftCoeffs"], drag_coeffs=p["dragCoeffs"])
                              for p in disk["sectionalPolars"]],
            sectional_radiuses=disk["sectionalRadiuses"] * m,
        )  # fmt: skip
    return float(abs(made.number_of_blades - job.performance.blades))


PROGRAMS: dict[str, tuple[str, Callable[[Job, Path], float]]] = {
    "table": ("a C compiler", table), "jsbsim": ("jsbsim", jsbsim), "mujoco": ("mujoco", mujoco),
    "rotorpy": ("rotorpy", rotorpy), "fmu": ("fmpy", fmu), "flow360": ("flow360 (built, not solved)", flow360),
}  # fmt: skip
MODULES = {"fmu": ("fmpy", "pythonfmu"), "jsbsim": ("jsbsim",), "mujoco": ("mujoco",), "rotorpy": ("rotorpy",),
           "flow360": ("flow360",), "table": ()}  # fmt: skip


def measured(word: str) -> float:
    """Greatest error of one program, found in a process of its own: their libraries do not all bear each other."""
    call = [sys.executable, str(DOCS / "read_back.py"), word]
    out = subprocess.run(call, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(DOCS.parent)})
    found = [line for line in out.stdout.splitlines() if line.startswith("error ")]
    if not found:
        raise RuntimeError(f"{word}: {out.stderr[-2000:]}")
    return float(found[-1].split()[1])


def installed(word: str) -> bool:
    """Whether the program of a target is here."""
    if word == "table":
        return bool(shutil.which("cc") or shutil.which("gcc"))
    return all(importlib.util.find_spec(name) for name in MODULES[word])


def _percent(value: Any) -> str:
    if isinstance(value, dict):
        value = value.get("flight")
    return "-" if value is None else f"{value:.2g} %" if value > 1e-3 else "< 0.001 %"


def example() -> Job:
    """The 10x5 of `cases/`, up to 10,000 rev/min."""
    return Job(load_case(CASES / "prop_10x5/case.toml"), 10_000.0, 8.0)


def page() -> str:
    """Text of docs/exports.md."""
    job = example()
    fan = Job(load_case(CASES / "ds30/case.toml"), None, 20.0)
    kinds = {"solid": [], "loads": [], "disk": [], "blade": []}  # type: dict[str, list[str]]
    for word, target in exports().items():
        asked = fan if word == "dfdc" else job
        row = f"| `{word}` | {target.holds} |"
        if target.kind != "solid":
            error = entry(target, asked, target.write(asked)).get("fit_error_pct", {})
            row += f" {_percent(error.get('thrust'))} | {_percent(error.get('torque'))} |"
            if word in PROGRAMS and installed(word):
                found = measured(word)
                shown = "-" if word == "flow360" else f"{found:.0e}" if found > 1e-15 else "none"
                row += f" {PROGRAMS[word][0]} | {shown} |"
            elif target.kind == "blade":
                row += " our reader, then solved | see left |"
            elif word == "rotor-disk":
                row += " OpenFOAM 1912 | 9e-04 |"
            else:
                how = " (written file checked with the formula of its source)" if target.kind == "loads" else ""
                row += f" no{how} | - |"
        kinds[target.kind].append(row)
    head = "| target | represents | thrust error | torque error | read back by | read-back error |"
    head += "\n|---|---|---|---|---|---|"
    return f"""# Exports: one propeller for simulators, disks and design tools

Generated by `python docs/read_back.py`; do not edit.

    python -m bemt export CASE --out DIR --format TARGET [TARGET ...]

writes each target into a folder of its name, together with `manifest.json`: what the target can represent, the fit
error, the band of the prediction, conventions, and the valid range. With `--hold reynolds` (or torque, airspeed,
windmill, mach, density, rest, duct, sections) a target that cannot represent it is refused.

Fit errors are for the 10x5 in `cases/` up to 10,000 rev/min, from static to zero thrust, in per cent of the largest
load at the same speed; no check point is a table node. The read-back error is relative. `dfdc` uses the fan `ds30`.

## Thrust and torque for simulators

{head}
{chr(10).join(kinds["loads"])}

For targets with a table, the error is that of linear interpolation. For targets with one or three numbers for all
speeds, it includes the change of the coefficients from 2,500 to 10,000 rev/min (Reynolds number): give `--rpm` near
the speed you fly. A single constant (`gazebo`) is right in static operation and off by the whole thrust in flight.
That is a limit of the model, not of the fit.

Two scripts run the exported 10x5 in a simulator without a controller: [hover.py](hover.py) (MuJoCo, at the speed that
`drive` predicts) and [zero_thrust.py](zero_thrust.py) (JSBSim, at the airspeed where BEMT predicts zero thrust).

## Disks for flow solvers

{head}
{chr(10).join(kinds["disk"])}

`rotor-disk` and `su2-disk` prescribe the load from BEMT. The other two solve the inflow themselves, so there is
nothing to compare before they run. OpenFOAM's `rotorDisk` with ordinary section tables is wrong for propellers: lift
acts along the axis, and the torque lacks cl sin(phi). See [reports/disk](../reports/disk/README.md) for the run.

## Blades for design tools

{head}
{chr(10).join(kinds["blade"])}

The error is that of the written file, read back and solved by `bemt`. C81 is exact at its operating point and has no
Reynolds number dependence. `python -m bemt stations FILE` turns an XROTOR, QPROP, DFDC or AeroDyn file into a case.

## Solids

| target | represents |
|---|---|
{chr(10).join(kinds["solid"])}
"""


if __name__ == "__main__":
    if sys.argv[1:]:
        with tempfile.TemporaryDirectory() as place:
            print(f"\nerror {PROGRAMS[sys.argv[1]][1](example(), Path(place))!r}", flush=True)
        os._exit(0)  # without what native libraries do on the way out
    missing = [word for word in PROGRAMS if not installed(word)]
    if missing:
        print(f"not installed, read back as before: {', '.join(missing)}", file=sys.stderr)
        sys.exit(1)
    write_atomic(DOCS / "exports.md", page())
