"""What the exports wrote, run in the programs that read them: ``python docs/read_back.py`` rewrites docs/exports.md.

``python docs/read_back.py TARGET [TARGET ...]`` runs these targets, in processes of their own, and keeps what it
measured in docs/read_back.json with version and date; without a target, the page is written from there. A program runs
the export of a right-handed and of a left-handed rotor at the same operating points as BEMT. Needs ``pip install
'bemt[simulators]'``, and from Debian ``ignition-tools`` with ``libsdformat-dev`` (Gazebo) and ``openfoam``.
"""

from __future__ import annotations

import datetime
import importlib.metadata
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.tables import write_atomic
from bemt.case import load_case
from bemt.exports import exports
from bemt.exports.base import Job, LoadsExport, entry
from bemt.exports.performance import oblique_loads, solve_points

DOCS = Path(__file__).resolve().parent
CASES = DOCS.parent / "cases"
KEPT = DOCS / "read_back.json"


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
    """Points from rest to zero thrust alone, for targets that hold no windmill."""
    rpm, V = points(job, 2 * count, seed)
    t = job.performance
    J = V / (rpm / 60.0 * t.diameter_m)
    keep = np.flatnonzero((J >= 0.0) & (np.interp(rpm, t.rpm, t.J_zero) >= J))[:count]
    return rpm[keep], V[keep]


def _save(word: str, job: Job, folder: Path) -> Path:
    for name, data in exports()[word].write(job).items():
        write_atomic(folder / name, data)
    return folder


def table(job: Job, folder: Path) -> Ran:
    """C header, compiled."""
    _save("table", job, folder)
    name = job.case.name
    rpm, V = points(job, 60)
    rho = job.performance.rho
    calls = "".join(f"{name}_loads({n!r}, {v!r}, {rho!r}, &T, &Q); printf(\"%.17g %.17g\\n\", T, Q);\n"
                    for n, v in zip(rpm.tolist(), V.tolist(), strict=True))  # fmt: skip
    main = f'#include <stdio.h>\n#include "{name}.h"\nint main(void) {{ double T, Q;\n{calls}'
    main += f'printf("%d 0\\n", {name.upper()}_SENSE); return 0; }}\n'
    (folder / "main.c").write_text(main, encoding="utf-8")
    program = str(folder / "program")
    flags = ["-std=c99", "-Wall", "-Werror", "-o", program, str(folder / "main.c"), "-lm"]
    subprocess.run([shutil.which("cc") or "gcc", *flags], check=True)
    out = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    T, Q = np.array([line.split() for line in out.splitlines()], dtype=float).T
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
    main = f'#include <stdio.h>\n#include "{name}.h"\nint main(void) {{ double F[3], M[3];\n{calls}return 0; }}\n'
    (folder / "main.c").write_text(main, encoding="utf-8")
    program = str(folder / "program")
    flags = ["-std=c99", "-Wall", "-Werror", "-o", program, str(folder / "main.c"), "-lm"]
    subprocess.run([shutil.which("cc") or "gcc", *flags], check=True)
    out = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    read = np.array([line.split() for line in out.splitlines()], dtype=float)
    return Skewed(rpm, v, read[:, :3], read[:, 3:])


def _jsbsim_stand(job: Job, folder: Path) -> Any:
    """JSBSim with the stand of the export, held down."""
    import jsbsim as program

    fdm = program.FGFDMExec(str(folder))
    fdm.set_debug_level(0)
    fdm.set_aircraft_path("aircraft")
    fdm.set_engine_path("engine")
    fdm.set_systems_path("systems")
    assert fdm.load_model(f"{job.case.name}_stand")
    fdm.set_dt(1.0 / 2000.0)
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
        for step in range(8000):
            fdm["fcs/throttle-cmd-norm"] = 0.3 if step < 1000 else throttle
            turns = fdm["propulsion/engine/propeller-rpm"]
            fdm.run()
        density = fdm["atmosphere/rho-slugs_ft3"] * 515.378818
        force = [fdm[f"forces/fb{a}-external-lbs"] * 4.4482216152605 for a in "xyz"]
        moment = [fdm[f"moments/{a}-external-lbsft"] * 1.3558179483314 for a in "lmn"]
        force[0] += fdm["propulsion/engine/thrust-lbs"] * 4.4482216152605
        power = fdm["propulsion/engine/propeller-power-ftlbps"] * 1.3558179483314
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


def rotorpy_skewed(job: Job, folder: Path) -> Skewed:
    """Force and moment of a vehicle on which one rotor turns, about the hub of that rotor."""
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    space: dict[str, Any] = {}
    exec(next((_save("rotorpy", job, folder)).glob("*.py")).read_text(encoding="utf-8"), {}, space)
    own = space["rotor_direction"]
    way = {"rotor_directions": np.array([own, -own, own, -own]), "c_Dx": 0.0, "c_Dy": 0.0, "c_Dz": 0.0}
    vehicle = Multirotor({**quad_params, **space["rotor_params"], **way}, aero=True)
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
    """The stand of the export in a wind tunnel, at the speeds that it settles to; without power it windmills."""
    _save("jsbsim", job, folder)
    rows, rolls = [], []
    for V, throttle in ((0.0, 0.1), (0.0, 0.6), (6.0, 0.05), (12.0, 0.5), (20.0, 0.8), (20.0, 0.0), (25.0, 0.02)):
        fdm = _jsbsim_stand(job, folder)
        fdm["atmosphere/wind-north-fps"] = -V / 0.3048
        fdm["propulsion/set-running"] = -1
        for step in range(8000):
            fdm["fcs/throttle-cmd-norm"] = 0.3 if step < 1000 else throttle  # from rest, no wind turns a propeller up
            rpm = fdm["propulsion/engine/propeller-rpm"]  # the loads of a step are those of the speed before it
            fdm.run()
        power = fdm["propulsion/engine/propeller-power-ftlbps"] * 1.3558179483314
        rows.append((rpm, V, fdm["propulsion/engine/thrust-lbs"] * 4.4482216152605, power / (rpm * np.pi / 30.0),
                     fdm["atmosphere/rho-slugs_ft3"] * 515.378818))  # fmt: skip
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
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    space: dict[str, Any] = {}
    exec(next((_save("rotorpy", job, folder)).glob("*.py")).read_text(encoding="utf-8"), {}, space)
    still = dict.fromkeys(("c_Dx", "c_Dy", "c_Dz", "k_d", "k_h", "k_flap"), 0.0)
    own = space["rotor_direction"]
    way = {"rotor_directions": np.array([own, -own, own, -own])}
    vehicle = Multirotor({**quad_params, **still, **space["rotor_params"], **way}, aero=True)
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
    """Both directions of rotation, run in a process of their own: not all libraries bear each other."""
    call = [sys.executable, str(DOCS / "read_back.py"), "--child", word]
    out = subprocess.run(call, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(DOCS.parent)})
    found = [line for line in out.stdout.splitlines() if line.startswith("measured ")]
    if not found:
        raise RuntimeError(f"{word}: {out.stderr[-3000:]}")
    result: dict[str, Any] = json.loads(found[-1].removeprefix("measured "))
    return result


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


SEEN = {
    "dfdc": ("DFDC 0.70, built from its source", "2026-11-23", "a file of 30 stations converges in 16 iterations; with "
             "40 or 60 it is NaN. Loads were not compared: the file has neither stator nor tip gap, and its sections "
             "were those of an earlier fit"),
    "openfoam": ("OpenFOAM 1912 of Debian", "2026-11-23", "10x5, 10,000 rev/min, at rest, level 5: Allrun ends with "
                 "11.4 N and 0.205 N m; BEMT 13.5 N and 0.200 N m; the grid is the coarsest and shows no convergence"),
    "xrotor": ("XROTOR 7.55, built from its source", "2026-11-23", "10x5: thrust +1.5 to +2.9 %, torque +5 to +16 % of "
               "BEMT's; at one speed XROTOR settled on a stalled root"),
}  # fmt: skip
"""Runs by hand, of programs that neither Debian nor PyPI has, or that take long: program, date, what it said."""

TEXT = {
    "ardupilot": "formula of its source (SIM_Motor.cpp)",
    "c81": "our reader",
    "flow360": "shapes and units",
    "px4": "formula of its source (sih.cpp), ranges of its parameters",
    "qprop": "our reader",
    "simulink": "MAT file read by SciPy",
    "su2-bem": "layout of its test case",
    "su2-disk": "layout of its test case, integrals of the rows",
}
"""What the text of a target was checked with where its program was not run."""


def _percent(value: Any) -> str:
    if isinstance(value, dict):
        value = value.get("flight")
    if value is None:
        return "-"
    return f"{value:.0f} %" if value >= 10.0 else f"{value:.2g} %" if value > 1e-3 else "< 0.001 %"


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
        program, date, _ = SEEN[word]
        return f"by hand: {program} | see below | see below | {held} | {date} |"
    return f"text only: {TEXT.get(word, 'formula of its source')} | - | - | {held} | - |"


def _hub_rows(kept: dict[str, Any]) -> str:
    rows = []
    for word, target in exports().items():
        if "hub" not in target.features:
            continue
        run = kept.get(word, {})
        if "hub_pct" in run:
            read = run["program"] if PROGRAMS[word].loads else f"read: {run['program']}; formula of its source"
            cells = [_percent(run["hub_pct"][name]) for name in HUB]
            rows.append(f"| `{word}` | {read} | {' | '.join(cells)} | {run['hub_points']} |")
        else:
            rows.append(
                f"| `{word}` | text only: {TEXT.get(word, 'formula of its source')} | - | - | - | - | - | - | - |"
            )
    return "\n".join(rows)


def page() -> str:
    """Text of docs/exports.md."""
    job = example()
    fan = Job(load_case(CASES / "ds30/case.toml"), None, 20.0)
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    kinds: dict[str, list[str]] = {"solid": [], "loads": [], "disk": [], "blade": []}
    for word, target in exports().items():
        row = f"| `{word}` | {target.holds} |"
        if target.kind == "loads":
            error = entry(target, job, target.write(job))["fit_error_pct"]
            row += f" {_percent(error['thrust'])} | {_percent(error['torque'])} |"
        if target.kind == "blade":
            asked = fan if word == "dfdc" else job
            error = entry(target, asked, target.write(asked))["section_error"]
            row += " - | - |" if error is None else f" {error['cl']:.2f} | {error['cd_pct']:.0f} % |"
        if target.kind != "solid":
            row += " " + _program(word, kept)
        kinds[target.kind].append(row)
    ran = "run in | thrust off | torque off | direction of rotation | date |"
    line = "|---|---|---|---|---|---|---|"
    by_hand = {word: f"* `{word}`, {program}, {date}: {what}." for word, (program, date, what) in SEEN.items()}
    blades = "\n".join(line for word, line in by_hand.items() if exports()[word].kind == "blade")
    return f"""# Exports: one propeller for simulators, disks and design tools

Generated by `python docs/read_back.py`; do not edit.

    bemt export CASE --out DIR --format TARGET [TARGET ...]

This writes each simulator model, disk and blade into a folder of its own, such as `DIR/jsbsim`. Solids are files in
DIR, and `openfoam` makes DIR the case: `cd DIR && ./Allrun`. `DIR/manifest.json` says what each target can represent,
the fit error, the band of the prediction, conventions, the direction of rotation, and the valid range. With `--hold
reynolds` (or torque, airspeed, windmill, mach, density, rest, duct, sections, rotation, hub) a target that cannot
represent it is refused; the others are written and the exit code is 2. Another format into the same folder keeps what
is there; the manifest lists both, and the terminal names formats that were written from another state of the case.

"Run in" says which program took the file, at the same operating points as BEMT, once right- and once left-handed.
"Off" is the greatest difference to BEMT, in per cent of the greatest load at the same speed: it holds the error of the
model class and that of the file. Where it says "text only", no program has read the file. All rows are for the 10x5 in
`cases/` up to 10,000 rev/min; `dfdc` uses the fan `ds30`.

## Thrust and torque for simulators

| target | represents | thrust error | torque error | {ran}
{line}--|--|
{chr(10).join(kinds["loads"])}

The errors of the model class are from static to zero thrust, at points that are no nodes of the table. The programs
with a table were also run in descent and as a windmill. For targets with one or three numbers for all speeds, the error
includes the change of the coefficients from 2,500 to 10,000 rev/min (Reynolds number): give `--rpm` near the speed you
fly. A single constant (`gazebo`) is right in static operation and off by the whole thrust in flight. That is a limit of
the model, not of the fit.

Tables end where simulated aircraft rarely fly, because programs hold the last value: each speed is covered up to 1.2
times the airspeed at which the greatest speed has no thrust (J up to 4.8 times that of zero thrust), and an open rotor
in descent down to twice its induced speed at rest. The coefficients hold the Reynolds numbers of the case's air; a
note in the manifest says what three quarters of that density would change.

Two scripts run the exported 10x5 in a simulator without a controller: [hover.py](hover.py) (MuJoCo, at the speed that
`drive` predicts) and [zero_thrust.py](zero_thrust.py) (JSBSim, at the airspeed where BEMT predicts zero thrust).

## Loads across the shaft

A wind at an angle to the shaft adds a force H in the plane of the disk, downstream, a side force Y, and moments of the
hub. Seven targets carry them (`--hold hub`); the others say in their notes that they do not. Tables run over speed and
the advance ratios along and across the shaft; their angle is atan2 of the two. `table` also writes them as a CSV with
the angle between wind and shaft. RotorPy and Gazebo have one number for each load that they know. The moments are those
of stiff blades and come out too large; see [Wind from any side](oblique.md).

Greatest difference to BEMT's oblique solve, right- and left-handed, 10 to 110 deg to the shaft, wind from any side, in
per cent of the thrust at rest, its torque, and thrust times radius; "-": the target has no such load.

| target | run in | thrust | torque | H | Y | roll | pitch | points |
|---|---|---|---|---|---|---|---|---|
{_hub_rows(kept)}

In JSBSim the loads act as external reactions of the aircraft file, and the shaft power stays that of axial flow.

## Disks for flow solvers

| target | represents | {ran}
{line}
{chr(10).join(kinds["disk"])}

`rotor-disk` and `su2-disk` prescribe the load from BEMT. The other two solve the inflow themselves. OpenFOAM's
`rotorDisk` with ordinary section tables is wrong for propellers: lift acts along the axis, and the torque lacks
cl sin(phi). See [reports/disk](../reports/disk/README.md) for the run.

## Blades for design tools

| target | represents | lift coefficient off | drag coefficient off | {ran}
{line}--|--|
{chr(10).join(kinds["blade"])}

"Off" in the section columns is the greatest error of the fitted section between the stalls; C81 holds the tables
themselves at its operating point and has no Reynolds number dependence. These programs have wake models of their own,
so their loads are not those of BEMT. Runs by hand:

{blades}

`bemt stations FILE` turns an XROTOR, QPROP, DFDC or AeroDyn file into a case.

## Solids

| target | represents |
|---|---|
{chr(10).join(kinds["solid"])}

{by_hand["openfoam"]}
"""


def main(words: list[str]) -> int:
    """Run the targets, keep what they said, write the page; 1 where a program is missing."""
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
    if sys.argv[1:2] == ["--child"]:
        print("\nmeasured " + json.dumps(_child(sys.argv[2])), flush=True)
        os._exit(0)  # without what native libraries do on the way out
    sys.exit(main(sys.argv[1:]))
