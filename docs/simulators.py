"""The programs that read the exports, each driven at points of its own: what it says of one propeller.

For ``docs/read_back.py``. A target is run by a function of a request and an empty folder; `PROGRAMS` lists them.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import os
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.tables import write_atomic
from bemt.tools.exports import exports
from bemt.tools.exports.base import Job, LoadsExport

SLUG_FT3, LBF, FT_LBF = 515.378818, 4.4482216152605, 1.3558179483314
"""A density, a force and a moment of JSBSim in kg/m3, N and N m."""


@dataclass(frozen=True, eq=False)
class Ran:
    """What a program said: loads at points (P,), and which way the rotor turns in it."""

    rpm: Any  # [rev/min]
    airspeed_m_s: Any
    thrust_N: Any
    torque_Nm: Any  # Of the shaft, positive where the rotor is driven
    sense: int  # +1 right-handed, from the sign of the torque on the vehicle
    rho: Any = None  # Where the program has an atmosphere of its own [kg/m3]


@dataclass(frozen=True, eq=False)
class Skewed:
    """What a program put on the vehicle in a wind across the shaft: force and moment (P, 3), z along the thrust."""

    rpm: Any  # [rev/min]
    velocity_m_s: Any  # (P, 3), of the hub through the air
    force_N: Any
    moment_Nm: Any
    rho: Any = None

    def loads(self, sense: int) -> np.ndarray:
        """Thrust, torque, H, Y, roll and pitch moment, (6, P)."""
        v, F, M = (np.asarray(a, dtype=float) for a in (self.velocity_m_s, self.force_N, self.moment_Nm))
        u = np.zeros_like(v)
        u[:, :2] = v[:, :2] / np.hypot(v[:, 0], v[:, 1])[:, None]
        z = np.array([0.0, 0.0, 1.0])
        a = sense * np.cross(u, z)
        along = ((F, u, -1.0), (F, a, 1.0), (M, np.cross(a, z), 1.0), (M, np.cross(u, z), 1.0))
        return np.array([F[:, 2], -sense * M[:, 2], *(sign * np.sum(x * y, axis=1) for x, y, sign in along)])


def skewed(job: Job, count: int, seed: int = 11) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [rev/min] and velocities (P, 3) [m/s] from 10 to 110 deg to the shaft, from any side."""
    t = job.performance
    rng = np.random.default_rng(seed)
    rpm = rng.uniform(0.5 * t.rpm[-1], t.rpm[-1], count)
    wind = rng.uniform(0.2, 0.9, count) * np.interp(rpm, t.rpm, t.J_zero) * rpm / 60.0 * t.diameter_m
    angle, side = np.radians(rng.uniform(10.0, 110.0, count)), rng.uniform(0.0, 2.0 * np.pi, count)
    ways = np.sin(angle) * np.cos(side), np.sin(angle) * np.sin(side), np.cos(angle)
    return rpm, wind[:, None] * np.stack(ways, axis=1)


def points(job: Job, count: int, seed: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [rev/min] and airspeeds [m/s] from rest to zero thrust; a third of them down to descent and up to dive."""
    t = job.performance
    rng = np.random.default_rng(seed)
    rpm = rng.uniform(t.rpm[0], t.rpm[-1], count)
    share = rng.uniform(0.0, 1.0, count)
    J = share * np.interp(rpm, t.rpm, t.J_zero)
    J[::6] = t.J[0] * share[::6]
    J[3::6] = t.J_zero[-1] * (1.0 + 2.5 * share[3::6])
    return rpm, J * rpm / 60.0 * t.diameter_m


def flight(job: Job, count: int, seed: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """Points from rest to zero thrust alone, from a quarter of full throttle, for targets that hold no windmill."""
    job = job.flown
    rpm, V = points(job, 2 * count, seed)
    t = job.performance
    J = V / (rpm / 60.0 * t.diameter_m)
    keep = np.flatnonzero((J >= 0.0) & (np.interp(rpm, t.rpm, t.J_zero) >= J))[:count]
    return rpm[keep], V[keep]


def _save(word: str, job: Job, folder: Path) -> Path:
    for name, data in exports()[word].write(job).items():
        write_atomic(folder / name, data)
    return folder


def _compiled(folder: Path, name: str, variables: str, calls: str) -> np.ndarray:
    """Numbers that a program prints which calls the C header of the table, a row a line."""
    main = f'#include <stdio.h>\n#include "{name}.h"\nint main(void) {{ double {variables};\n{calls}return 0; }}\n'
    (folder / "main.c").write_text(main, encoding="utf-8")
    program = str(folder / "program")
    flags = ["-std=c99", "-Wall", "-Werror", "-o", program, str(folder / "main.c"), "-lm"]
    subprocess.run([shutil.which("cc") or "gcc", *flags], check=True)
    out = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    return np.array([line.split() for line in out.splitlines()], dtype=float)


def table(job: Job, folder: Path) -> Ran:
    """C header, compiled."""
    _save("table", job, folder)
    name, rho = job.case.name, job.performance.rho
    rpm, V = points(job, 60)
    calls = "".join(f"{name}_loads({n!r}, {v!r}, {rho!r}, &T, &Q); printf(\"%.17g %.17g\\n\", T, Q);\n"
                    for n, v in zip(rpm.tolist(), V.tolist(), strict=True))  # fmt: skip
    calls += f'printf("%d 0\\n", {name.upper()}_SENSE); '
    T, Q = _compiled(folder, name, "T, Q", calls).T
    return Ran(rpm, V, T[:-1], Q[:-1], int(T[-1]))


def table_skewed(job: Job, folder: Path) -> Skewed:
    """C header, compiled."""
    _save("table", job, folder)
    name, rho = job.case.name, job.performance.rho
    rpm, v = skewed(job, 60)
    calls = "".join(
        f"{{ double v[3] = {{{x!r}, {y!r}, {z!r}}}; {name}_wrench({n!r}, v, {rho!r}, F, M); "
        'printf("%.17g %.17g %.17g %.17g %.17g %.17g\\n", F[0], F[1], F[2], M[0], M[1], M[2]); }\n'
        for n, (x, y, z) in zip(rpm.tolist(), v.tolist(), strict=True)
    )
    read = _compiled(folder, name, "F[3], M[3]", calls)
    return Skewed(rpm, v, read[:, :3], read[:, 3:])


def _jsbsim_stand(job: Job, folder: Path) -> Any:
    """JSBSim with the stand of the export, held down, at the program's own step."""
    import jsbsim as program

    fdm = program.FGFDMExec(str(folder))
    fdm.set_debug_level(0)
    fdm.set_aircraft_path("aircraft")
    fdm.set_engine_path("engine")
    fdm.set_systems_path("systems")
    assert fdm.load_model(next((folder / "aircraft").iterdir()).name)
    fdm.run_ic()
    fdm["forces/hold-down"] = 1
    return fdm


def jsbsim_skewed(job: Job, folder: Path) -> Skewed:
    """The stand in a wind from the side; forces of the propeller and the external reactions together."""
    _save("jsbsim", job, folder)
    rpm, v, F, M, rho = [], [], [], [], []
    for throttle, axial, y, z in (
        (0.6, 4.0, 5.0, 0.0),
        (0.5, 0.0, 0.0, 9.0),
        (0.8, 6.0, -6.0, 3.0),
        (0.7, -1.0, 4.0, -8.0),
    ):
        fdm = _jsbsim_stand(job, folder)
        for way, speed in (("north", axial), ("east", y), ("down", z)):
            fdm[f"atmosphere/wind-{way}-fps"] = -speed / 0.3048
        fdm["propulsion/set-running"] = -1
        for step in range(600):
            fdm["fcs/throttle-cmd-norm"] = 0.3 if step < 60 else throttle
            turns = fdm["propulsion/engine/propeller-rpm"]
            fdm.run()
        density = fdm["atmosphere/rho-slugs_ft3"] * SLUG_FT3
        force = [fdm[f"forces/fb{a}-external-lbs"] * LBF for a in "xyz"]
        moment = [fdm[f"moments/{a}-external-lbsft"] * FT_LBF for a in "lmn"]
        force[0] += fdm["propulsion/engine/thrust-lbs"] * LBF
        power = fdm["propulsion/engine/propeller-power-ftlbps"] * FT_LBF
        moment[0] -= job.performance.sense * power / (turns * np.pi / 30.0)
        # body x is the thrust: (y, z, x) is right-handed with z along it
        rpm.append(turns)
        v.append((y, z, axial))
        F.append((force[1], force[2], force[0]))
        M.append((moment[1], moment[2], moment[0]))
        rho.append(density)
    return Skewed(np.array(rpm), np.array(v), F, M, np.array(rho))


def _mujoco_loads(job: Job, folder: Path, rpm: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """What the actuators put on the body at speeds (P,) [rev/min] and velocities (P, 3) [m/s], (P, 6) [N], [N m]."""
    import mujoco as program

    _save("mujoco", job, folder)
    space: dict[str, Any] = {}
    exec((folder / f"{job.case.name}_mujoco.py").read_text(encoding="utf-8"), space)
    model = program.MjModel.from_xml_path(str(folder / f"{job.case.name}.xml"))
    data = program.MjData(model)
    propeller = space["Propeller"](model)
    found = []
    for n, v in zip(rpm, velocity, strict=True):
        program.mj_resetData(model, data)
        data.qvel[:3] = v
        program.mj_forward(model, data)
        propeller.rpm = n
        propeller(model, data)
        program.mj_forward(model, data)
        found.append(data.qfrc_actuator[:6].copy())
    return np.array(found)


def mujoco_skewed(job: Job, folder: Path) -> Skewed:
    """Forces and moments in a wind from any side."""
    rpm, v = skewed(job, 24)
    read = _mujoco_loads(job, folder, rpm, v)
    return Skewed(rpm, v, read[:, :3], read[:, 3:])


def _rotorpy_vehicle(job: Job, folder: Path, still: dict[str, float]) -> Any:
    """RotorPy's Hummingbird with the rotor of the export, and without the loads of its own that are `still`."""
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    space: dict[str, Any] = {}
    exec(next((_save("rotorpy", job, folder)).glob("*.py")).read_text(encoding="utf-8"), {}, space)
    own = space["rotor_direction"]
    way = {"rotor_directions": np.array([own, -own, own, -own])}
    return Multirotor({**quad_params, **still, **space["rotor_params"], **way}, aero=True)


def rotorpy_skewed(job: Job, folder: Path) -> Skewed:
    """Force and moment of a vehicle on which one rotor turns, about the hub of that rotor."""
    vehicle = _rotorpy_vehicle(job, folder, dict.fromkeys(("c_Dx", "c_Dy", "c_Dz"), 0.0))
    place = vehicle.rotor_geometry[0]
    rpm, v = skewed(job, 20)
    found = []
    for n, velocity in zip(rpm, v, strict=True):
        force, moment = vehicle.compute_body_wrench(np.zeros(3), np.array([n * np.pi / 30.0, 0, 0, 0]), velocity)
        # the gain of thrust k_h V^2 is there for the three rotors at rest too, about the centre that all four balance
        gain = 0.25 * vehicle.compute_body_wrench(np.zeros(3), np.zeros(4), velocity)[0]
        own_force = force - 3.0 * gain
        found.append((*own_force, *(moment - np.cross(place, own_force - gain))))
    read = np.array(found)
    return Skewed(rpm, v, read[:, :3], read[:, 3:])


def fmu_skewed(job: Job, folder: Path) -> Skewed:
    """Co-simulation by fmpy."""
    import fmpy

    _save("fmu", job, folder)
    rpm, v = skewed(job, 12)
    names = ("rpm", "velocity_x_m_s", "velocity_y_m_s", "airspeed_m_s")
    kinds = [("time", "<f8"), *((name, "<f8") for name in names)]
    signals = np.array([(float(i), n, *w) for i, (n, w) in enumerate(zip(rpm, v.tolist(), strict=True))], dtype=kinds)
    words = ["force_x_N", "force_y_N", "thrust_N", "moment_x_Nm", "moment_y_Nm", "torque_Nm", "sense"]
    last = float(rpm.size - 1)
    found = fmpy.simulate_fmu(str(folder / f"{job.case.name}.fmu"), stop_time=last, step_size=1.0, output_interval=1.0,
                              input=signals, output=words)[1:]  # fmt: skip
    read = np.array([found[word] for word in words]).T
    read[:, 5] *= -read[:, 6]
    return Skewed(rpm[:-1], v[:-1], read[:, :3], read[:, 3:6])


def gazebo_skewed(job: Job, folder: Path) -> Skewed:
    """The formula of the plugin (MulticopterMotorModel.cc) on the file as libsdformat prints it."""
    path = next(_save("gazebo", job, folder).glob("*.sdf"))
    text = subprocess.run(["ign", "sdf", "-p", str(path)], capture_output=True, text=True, check=True).stdout
    k = {word: float(value) for word, value in re.findall(r"<(\w+C\w+)>([-\d.e+]+)</", text)}
    rpm, v = skewed(job, 20)
    W, across = rpm * np.pi / 30.0, v * [1.0, 1.0, 0.0]
    turns = 1.0 if "<turningDirection>ccw<" in text else -1.0
    force = -k["rotorDragCoefficient"] * W[:, None] * across
    moment = -k["rollingMomentCoefficient"] * W[:, None] * across
    force[:, 2] = k["motorConstant"] * W**2
    moment[:, 2] = -turns * k["momentConstant"] * force[:, 2]
    return Skewed(rpm, v, force, moment)


def jsbsim(job: Job, folder: Path) -> Ran:
    """The stand of the export in a wind tunnel, at the speeds that it settles to; the motor brakes what windmills."""
    _save("jsbsim", job, folder)
    rows, rolls = [], []
    for V, throttle in ((0.0, 0.1), (0.0, 0.6), (6.0, 0.2), (12.0, 0.5), (20.0, 0.8), (20.0, 0.4), (25.0, 0.5)):
        fdm = _jsbsim_stand(job, folder)
        fdm["atmosphere/wind-north-fps"] = -V / 0.3048
        fdm["propulsion/set-running"] = -1
        for step in range(600):
            fdm["fcs/throttle-cmd-norm"] = 0.3 if step < 60 else throttle  # from rest, no wind turns a propeller up
            rpm = fdm["propulsion/engine/propeller-rpm"]  # the loads of a step are those of the speed before it
            fdm.run()
        power = fdm["propulsion/engine/propeller-power-ftlbps"] * FT_LBF
        rows.append((rpm, V, fdm["propulsion/engine/thrust-lbs"] * LBF, power / (rpm * np.pi / 30.0),
                     fdm["atmosphere/rho-slugs_ft3"] * SLUG_FT3))  # fmt: skip
        rolls.append(fdm["moments/l-prop-lbsft"])
    n, v, T, Q, rho = np.transpose(rows)
    return Ran(n, v, T, Q, -int(np.sign(rolls[1])), rho)  # the vehicle is rolled against the rotor


def mujoco(job: Job, folder: Path) -> Ran:
    """Thrust and torque along the shaft."""
    rpm, V = points(job, 24)
    read = _mujoco_loads(job, folder, rpm, V[:, None] * np.array([0.0, 0.0, 1.0]))
    # a right-handed rotor, clockwise seen from behind, turns about the thrust (+z); its reaction is about -z
    sense = -int(np.sign(read[1, 5]))
    return Ran(rpm, V, read[:, 2], -sense * read[:, 5], sense)


def rotorpy(job: Job, folder: Path) -> Ran:
    """Force and yaw moment of a vehicle on which one rotor turns."""
    vehicle = _rotorpy_vehicle(job, folder, dict.fromkeys(("c_Dx", "c_Dy", "c_Dz", "k_d", "k_h", "k_flap"), 0.0))
    rpm, V = flight(job, 20)
    T, about = [], []
    for n, v in zip(rpm, V, strict=True):
        speeds = np.array([n * np.pi / 30.0, 0.0, 0.0, 0.0])
        force, moment = vehicle.compute_body_wrench(np.zeros(3), speeds, np.array([0.0, 0.0, v]))
        T.append(force[2])
        about.append(moment[2])
    sense = -int(np.sign(about[0]))
    return Ran(rpm, V, T, -sense * np.array(about), sense)


def fmu(job: Job, folder: Path) -> Ran:
    """Validation and co-simulation by fmpy: the loads of an input stand at the end of its step."""
    import fmpy
    from fmpy.validation import validate_fmu

    _save("fmu", job, folder)
    path = str(folder / f"{job.case.name}.fmu")
    complaints = validate_fmu(path)
    assert not complaints, complaints
    units = {v.name: v.unit for v in fmpy.read_model_description(path).modelVariables}
    assert all(units[name] for name in ("rpm", "airspeed_m_s", "density_kg_m3", "thrust_N", "torque_Nm")), units
    rpm, V = points(job, 12)
    last = rpm.size - 1
    kinds = [("time", "<f8"), ("rpm", "<f8"), ("airspeed_m_s", "<f8")]
    signals = np.array([(float(i), n, v) for i, (n, v) in enumerate(zip(rpm, V, strict=True))], dtype=kinds)
    found = fmpy.simulate_fmu(path, stop_time=float(last), step_size=1.0, output_interval=1.0, input=signals,
                              output=["thrust_N", "torque_Nm", "sense"])  # fmt: skip
    return Ran(rpm[:last], V[:last], found["thrust_N"][1:], found["torque_Nm"][1:], int(found["sense"][-1]))


def gazebo(job: Job, folder: Path) -> Ran:
    """The file as libsdformat takes it, printed again; the motor model itself needs a running Gazebo: its formula."""
    path = next(_save("gazebo", job, folder).glob("*.sdf"))
    told = subprocess.run(["ign", "sdf", "-k", str(path)], capture_output=True, text=True, check=False)
    assert told.returncode == 0 and "Valid" in told.stdout and "arning" not in told.stderr, told
    text = subprocess.run(["ign", "sdf", "-p", str(path)], capture_output=True, text=True, check=True).stdout
    rpm, V = flight(job, 20)
    target = exports()["gazebo"]
    assert isinstance(target, LoadsExport)
    T, Q = target.loads({"printed.sdf": text[text.index("<sdf") :]}, rpm, V)
    way = re.search(r"<turningDirection>(\w+)<", text)
    assert way is not None
    return Ran(rpm, V, T, Q, 1 if way[1] == "ccw" else -1)


def rotor_disk(job: Job, folder: Path) -> Ran:
    """Two iterations of simpleFoam: the load does not answer to the flow, so they show it whole."""
    _save("rotor-disk", job, folder)
    control = folder / "system/controlDict"
    control.write_text(control.read_text(encoding="utf-8").replace("400;", "2;"), encoding="utf-8")
    subprocess.run(["sh", "Allrun"], cwd=folder, check=True)
    packaged = Path("/usr/share/openfoam")  # as Debian installs it, without its environment
    where = os.environ | ({"WM_PROJECT_DIR": str(packaged)} if packaged.is_dir() else {})
    for made in ("writeCellCentres", "writeCellVolumes"):
        command = ["postProcess", "-latestTime", "-func", made]
        subprocess.run(command, cwd=folder, check=True, capture_output=True, env=where)
    force, centre, volume = (_field(folder / "2" / name) for name in ("disk:rotorForce", "C", "V"))
    load = job.loading.rho * force * volume
    about = float(np.sum(centre[:, 0] * load[:, 1] - centre[:, 1] * load[:, 0]))
    lift = float((folder / "log.simpleFoam").read_text(encoding="utf-8").split("Effective lift =")[-1].split()[0])
    assert abs(load[:, 2].sum() / lift - 1.0) < 1e-3, (load[:, 2].sum(), lift)
    # the force of the fluid on the blades, z along the thrust: it holds a right-handed rotor back about -z
    sense = -int(np.sign(about))
    return Ran([job.loading.rpm], [job.loading.airspeed_m_s], [load[:, 2].sum()], [-sense * about], sense)


def _field(path: Path) -> np.ndarray:
    """Cells of an ASCII field of OpenFOAM."""
    text = path.read_text(encoding="utf-8")
    head = re.search(r"internalField\s+nonuniform List<\w+>\s*(\d+)\s*\(", text)
    assert head is not None
    body = text[head.end() : text.index("\n)\n", head.end())]
    return np.array(body.replace("(", "").replace(")", "").split(), dtype=float).reshape(int(head[1]), -1)


def flow360(job: Job, folder: Path) -> Ran:
    """The disk as the package's own BETDisk, which checks shapes and units; it solves nothing."""
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
    assert made.number_of_blades == job.performance.blades
    return Ran([], [], [], [], 1 if made.rotation_direction_rule == "rightHand" else -1)


@dataclass(frozen=True, eq=False)
class Course:
    """A run from rest at one throttle: last speed, thrust and torque, and the most of them over the last."""

    rpm: float
    thrust_N: float
    torque_Nm: float
    over_pct: float


SETTLED_S = 4.0
"""Length of a run from rest: forty time constants of a slow drive [s]."""


def _course(rpm: Any, thrust_N: Any, torque_Nm: Any) -> Course:
    over = max(float(np.max(y) / y[-1]) - 1.0 for y in (np.asarray(rpm), np.asarray(thrust_N)))
    return Course(float(rpm[-1]), float(thrust_N[-1]), float(torque_Nm[-1]), 100.0 * over)


def jsbsim_started(job: Job, folder: Path, throttle: float, rpm: float) -> Course:
    """The stand as a user runs it: load, run_ic, throttle; the program's own step and its own motor."""
    _save("jsbsim", job, folder)
    fdm, rows = _jsbsim_stand(job, folder), []
    fdm["propulsion/set-running"] = -1
    fdm["fcs/throttle-cmd-norm"] = throttle
    for _ in range(int(SETTLED_S / fdm.get_delta_t())):
        turns = fdm["propulsion/engine/propeller-rpm"]
        fdm.run()
        power = fdm["propulsion/engine/propeller-power-ftlbps"] * FT_LBF
        rows.append((turns, fdm["propulsion/engine/thrust-lbs"] * LBF, power / max(turns * np.pi / 30.0, 1e-9)))
    air = fdm["atmosphere/rho-slugs_ft3"] * SLUG_FT3 / job.case.air().rho
    n, T, Q = np.transpose(rows)
    return _course(n, T / air, Q / air)


def _run_up(rpm: float, step_s: float) -> np.ndarray:
    """Speeds from rest to a speed, as a motor with a time constant of 0.1 s gives them [rev/min]."""
    return np.asarray(rpm * (1.0 - np.exp(-np.arange(0.0, SETTLED_S, step_s) / 0.1)))


def mujoco_started(job: Job, folder: Path, throttle: float, rpm: float) -> Course:
    """The body held at rest, MuJoCo's own step; the motor is the user's: the speed that the library has there."""
    import mujoco as program

    _save("mujoco", job, folder)
    space: dict[str, Any] = {}
    exec(next(folder.glob("*_mujoco.py")).read_text(encoding="utf-8"), space)
    model = program.MjModel.from_xml_path(str(next(folder.glob("*.xml"))))
    data = program.MjData(model)
    propeller, rows = space["Propeller"](model), []
    for n in _run_up(rpm, model.opt.timestep):
        data.qpos[:], data.qvel[:] = (0, 0, 0, 1, 0, 0, 0), 0.0
        propeller.rpm = n
        propeller(model, data)
        program.mj_step(model, data)
        rows.append((n, data.qfrc_actuator[2], abs(data.qfrc_actuator[5])))
    return _course(*np.transpose(rows))


def fmu_started(job: Job, folder: Path, throttle: float, rpm: float) -> Course:
    """Co-simulation by fmpy with its own step; the speed is that of the library."""
    import fmpy

    path = str(next(_save("fmu", job, folder).glob("*.fmu")))
    n = _run_up(rpm, 0.01)
    signals = np.array(list(zip(np.arange(n.size) * 0.01, n, strict=True)), dtype=[("time", "<f8"), ("rpm", "<f8")])
    found = fmpy.simulate_fmu(path, stop_time=SETTLED_S, input=signals, output=["thrust_N", "torque_Nm"])
    return _course(np.r_[n, rpm], found["thrust_N"], found["torque_Nm"])


def _formula_started(word: str) -> Callable[[Job, Path, float, float], Course]:
    """The published formula on the written file, at the speed that the library has there."""

    def run(job: Job, folder: Path, throttle: float, rpm: float) -> Course:
        target = exports()[word]
        assert isinstance(target, LoadsExport)
        T, Q = target.loads(target.write(job), np.array([rpm]), np.zeros(1))
        return Course(rpm, float(T[0]), float(Q[0]), 0.0)

    return run


STARTED: dict[str, Callable[[Job, Path, float, float], Course]] = {
    "jsbsim": jsbsim_started, "mujoco": mujoco_started, "fmu": fmu_started,
    **{word: _formula_started(word) for word in ("gazebo", "px4", "ardupilot")},
}  # fmt: skip
"""Runs from rest: three programs, and three formulas of programs that are not here."""


def _package(name: str) -> Callable[[], str]:
    return lambda: f"{name} {importlib.metadata.version(name)}"


def _first(command: list[str], pattern: str, words: str) -> Callable[[], str]:
    def found() -> str:
        told = subprocess.run(command, capture_output=True, text=True, check=False)
        match = re.search(pattern, told.stdout + told.stderr)
        return f"{words} {match[1] if match else ''}".strip()

    return found


@dataclass(frozen=True)
class Program:
    """How a target is run."""

    run: Callable[[Job, Path], Ran]
    version: Callable[[], str]
    modules: tuple[str, ...] = ()  # Python packages that it needs
    tools: tuple[str, ...] = ()  # Commands that it needs
    loads: bool = True  # Whether the program itself computes thrust and torque
    skewed: Callable[[Job, Path], Skewed] | None = None  # The same in a wind across the shaft


OPENFOAM = ["sh", "-c", "WM_PROJECT_DIR=${WM_PROJECT_DIR:-/usr/share/openfoam} blockMesh"]
PROGRAMS = {
    "table": Program(table, _first(["cc", "--version"], r"(\d+\.\d+\.\d+)", "GCC"), tools=("cc",),
                     skewed=table_skewed),
    "jsbsim": Program(jsbsim, _package("jsbsim"), ("jsbsim",), skewed=jsbsim_skewed),
    "mujoco": Program(mujoco, _package("mujoco"), ("mujoco",), skewed=mujoco_skewed),
    "rotorpy": Program(rotorpy, _package("rotorpy"), ("rotorpy",), skewed=rotorpy_skewed),
    "fmu": Program(fmu, lambda: f"{_package('fmpy')()}, {_package('pythonfmu')()}", ("fmpy", "pythonfmu"),
                   skewed=fmu_skewed),
    "gazebo": Program(gazebo, _first(["ign", "sdf", "--versions"], r"(\d+\.\d+\.\d+)", "libsdformat"), tools=("ign",),
                      loads=False, skewed=gazebo_skewed),
    "rotor-disk": Program(rotor_disk, _first(OPENFOAM, r"OPENFOAM=(\w+)", "OpenFOAM"),
                          tools=("simpleFoam", "blockMesh")),
    "flow360": Program(flow360, _package("flow360"), ("flow360",), loads=False),
}  # fmt: skip


def installed(word: str) -> bool:
    """Whether the program of a target is here."""
    need = PROGRAMS[word]
    return all(importlib.util.find_spec(name) for name in need.modules) and all(map(shutil.which, need.tools))
