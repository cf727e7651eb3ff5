"""Actions of the drive: drive, map, motor, thrusters."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Literal

from bemt.base.action import Cells, Count, Told, action
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bemt.rotors.propeller import Propeller
    from bemt.tools.drive.drive_result import DriveResult

    Path = str | os.PathLike[str]

__all__ = ["drive", "map", "motor", "thrusters"]


_FAN = "A fan is a case: bemt new 70mm --fan --blades 11, then bemt drive fan_70 --kv 2800 --cells 4."


@action(
    "Drive", "drive 10x4.5 --kv 900 --cells 3", words=("case",), shown=True,
    common=("motor", "kv", "cells", "mass_kg", "rotors", "capacity_Ah", "reading", "out"),
    elsewhere=dict.fromkeys(("fan", "duct"), _FAN) | {
        "blades": "They are in the label, as the 3 of 10x5x3.",
        "rpm": "The motor sets the speed; at a speed of your own: bemt estimate 10x5 --rpm 6000.",
    },
)  # fmt: skip
def drive(
    case: Propeller | Path = ".", *, motor: str | None = None, kv: float | None = None, cells: Cells | None = None,
    motor_mass_g: float | None = None, resistance_mohm: float | None = None, no_load_A: float | None = None,
    mass_kg: float | None = None, rotors: Count | None = None,
    capacity_Ah: float | None = None, airspeed_m_s: float = 0.0, reading: str | None = None, off: Sequence[str] = (),
    out: Path | None = None,
) -> DriveResult:  # fmt: skip
    """Solve a rotor with its motor and battery: thrust, current and hover.

    Parameters
    ----------
    case : Propeller, str or path
        Propeller, case or label such as 10x5; this folder by default.
    motor : str, optional
        Name of the motor, such as "T-Motor MN2212 920" (needs the extra ``motors``).
    kv : float, optional
        Speed constant of the motor; from the case's table [drive] by default, like all that follows. [rev/min/V]
    cells : int, optional
        LiPo cells in series, as 3 or 3S.
    motor_mass_g : float, optional
        Mass of the motor, which tells its winding. [g]
    resistance_mohm : float, optional
        Resistance of the motor between two leads, from its sheet. [mohm]
    no_load_A : float, optional
        Current of the motor without a propeller, from its sheet. [A]
    mass_kg : float, optional
        Mass of the vehicle, for the hover point. [kg]
    rotors : int, optional
        Number of rotors that carry the vehicle and share the battery.
    capacity_Ah : float, optional
        Capacity of the battery, for the flight time. [A h]
    airspeed_m_s : float
        Flight speed. [m/s]
    reading : str, optional
        One reading of this propeller: ``rpm=5400,thrust_g=410``.
    off : sequence of str
        Switch off battery_sag, motor_heating, rotor_inertia or inflow_lag.
    out : path, optional
        Folder for JSON, CSV and a picture.

    Returns
    -------
    bemt.tools.drive.drive_result.DriveResult
        ``.full``, ``.hover``, ``.text``, ``.to_dict()``; each value with its band. ``exit_code`` 1 if hover or airspeed
        is beyond the drive.

    Raises
    ------
    InputError
        For impossible values, and without K_v and cells from either side.

    Examples
    --------
    >>> import bemt
    >>> d = bemt.drive("10x5", kv=1000, cells=3)
    >>> bool(7.0 < d.full["thrust_N"].value < 13.0)
    True
    """
    from bemt.base.given import number, path_text
    from bemt.rotors.case.reading import with_reading
    from bemt.rotors.propeller import rotor_of
    from bemt.tools.drive import drive_result

    given = {"kv": kv, "cells": cells, "motor_mass_g": motor_mass_g, "resistance_mohm": resistance_mohm,
             "no_load_A": no_load_A, "mass_kg": mass_kg, "rotors": rotors, "capacity_Ah": capacity_Ah}  # fmt: skip
    told = {name: value if value is None else number(name, value, finite=False) for name, value in given.items()}
    told |= {name: given[name] for name in ("cells", "rotors")}
    own = rotor_of(case).case
    found = drive_result.with_drive(own if reading is None else with_reading(own, reading), motor, **told)
    result = drive_result.solve(found, number("airspeed_m_s", airspeed_m_s, finite=False), list(off))
    if out is not None:
        drive_result.write(result, path_text("out", out))
    return result


@action("Drive", "map bench.csv --out map", words=("files",))
def map(  # noqa: A001
    files: Path | Sequence[Path], *, sign: Literal["1", "-1"] = "1", nodes: Count = 41, name: str | None = None,
    thrust_N: float | None = None, voltage_V: float | None = None, out: Path | None = None,
) -> Told:  # fmt: skip
    """Fit a map from pulse width to thrust, and its inverse, to a bench recording.

    Parameters
    ----------
    files : path or sequence of paths
        Recordings of one drive, with one or more batteries.
    sign : {"1", "-1"}
        -1 reverses the sign of the thrust.
    nodes : int
        Number of table rows.
    name : str, optional
        Name of the files and of the C tables; that of the first recording by default.
    thrust_N : float, optional
        Say the pulse width for this thrust. [N]
    voltage_V : float, optional
        Battery voltage for the thrust. [V]
    out : path, optional
        Folder for CSV, JSON, a C header and a picture.

    Returns
    -------
    Told
        Schema ``bemt.map/1``; ``exit_code`` 1 if the drive cannot give the thrust.

    Raises
    ------
    InputError
        For recordings without pulse width and thrust.

    Examples
    --------
    >>> map("no/such.csv")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such.csv: got ...
    """
    from bemt.base.given import paths_text
    from bemt.tools.drive import map_result

    where = None if out is None else os.fspath(out)
    found = map_result.fit(paths_text("files", files, 1), int(sign), nodes, name, thrust_N, voltage_V, where)
    code = EXIT_OK if found.reached else EXIT_UNCONVERGED
    return Told(found.document(), map_result.text(found), exit_code=code)


@action("Drive", "motor motor.toml", words=("file",))
def motor(file: Path, *, out: Path | None = None) -> Told:
    """Find a motor's torque constant by three methods, and say which one errs.

    Parameters
    ----------
    file : path
        motor.toml or its folder.
    out : path, optional
        Folder for JSON, trials as CSV and a box plot.

    Returns
    -------
    Told
        Schema ``bemt.motor.result/1``; ``exit_code`` 1 when the methods disagree.

    Raises
    ------
    InputError
        With every fault of the file.

    Examples
    --------
    >>> motor("no/such.toml")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such.toml: got ...
    """
    from bemt.tools.drive import motor_result

    found = motor_result.judge(os.fspath(file), None if out is None else os.fspath(out))
    code = EXIT_OK if found.agree else EXIT_UNCONVERGED
    return Told(found.document(), motor_result.text(found), exit_code=code)


@action("Drive", "thrusters thrusters.toml --force-N 40", words=("file",))
def thrusters(
    file: Path, *, force_N: float | None = None, moment_Nm: float | None = None, out: Path | None = None
) -> Told:
    """Allocate force and roll moment to the thrusters of a vehicle.

    Parameters
    ----------
    file : path
        thrusters.toml or its folder.
    force_N : float, optional
        Requested force; from the file by default. [N]
    moment_Nm : float, optional
        Requested roll moment; from the file by default. [N m]
    out : path, optional
        Folder for JSON, CSV and a picture.

    Returns
    -------
    Told
        Schema ``bemt.thrusters.result/1``; ``exit_code`` 1 if the command is beyond the thrusters.

    Raises
    ------
    InputError
        With every fault of the file.

    Examples
    --------
    >>> thrusters("no/such.toml")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such.toml: got ...
    """
    from bemt.tools.drive import thrusters_result

    where = None if out is None else os.fspath(out)
    found, shown, met = thrusters_result.share(os.fspath(file), force_N, moment_Nm, where)
    return Told(found, shown, exit_code=EXIT_OK if met else EXIT_UNCONVERGED)
