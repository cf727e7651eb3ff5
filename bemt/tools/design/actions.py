"""Actions of the design tool: choose, design."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Literal

from bemt.base.action import Cells, Count, action

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bemt.tools.design.answer import DriveChoice
    from bemt.tools.design.blade_design import Design
    from bemt.tools.design.motors_file import KnownMotor

    Path = str | os.PathLike[str]

__all__ = ["choose", "design"]


@action(
    "Drive", "choose --thrust-N 27 --cells 6 --max-diameter-in 18", shown=True,
    common=("thrust_N", "cells", "mass_kg", "rotors", "airspeed_m_s", "max_diameter_in", "kv", "out"),
)  # fmt: skip
def choose(
    thrust_N: float | None = None, cells: Cells | None = None, *, kv: tuple[float, float] | float = (80.0, 8000.0),
    motors: Path | Sequence[Path | KnownMotor] = (),
    labels: str | Sequence[str] = (), blades: Count | Sequence[Count] = (2,),
    mass_kg: float | None = None, rest_kg: float | None = None, rotors: Count = 1, airspeed_m_s: float = 0.0,
    max_diameter_in: float | None = None, arm_mm: float | None = None, max_tip_mach: float = 0.8,
    capacity_Ah: float | None = None, minutes: float | None = None, fan: bool = False,
    fluid: Literal["air", "water"] = "air", coaxial: bool = False, reading: str | None = None, sure: float = 0.9,
    out: Path | None = None,
) -> DriveChoice:  # fmt: skip
    """Find which propeller and which motor constant reach a thrust, with the probability that they do.

    Parameters
    ----------
    thrust_N : float, optional
        Thrust of one rotor at full throttle; twice the hover thrust if only the mass is given. [N]
    cells : int
        LiPo cells in series, as 3 or 3S.
    kv : float or (low, high)
        Speed constant, or the range of which 72 are tried. [rev/min/V]
    motors : path or name, or sequence of them or of KnownMotor
        Real motors instead: CSV files with name,kv,resistance_mohm,no_load_A, or names of motors on sale, such as
        "T-Motor MN2212 920" (extra motors).
    labels : str or sequence of str
        Propellers to try, as 10x5 or 9x4.5x3; standard sizes by default.
    blades : int or sequence of int
        Blades of the standard sizes.
    mass_kg : float, optional
        Mass of the vehicle with the first pair on it: power, current and time are of hover. [kg]
    rest_kg : float, optional
        Of that mass, what is not motor, propeller, controller and frame; what the first pair leaves by default. Every
        pair lifts it and its own parts. [kg]
    rotors : int
        Rotors that carry the vehicle and share the battery; both of a coaxial pair count.
    airspeed_m_s : float
        Flight speed. [m/s]
    max_diameter_in : float, optional
        Largest diameter. [in]
    arm_mm : float, optional
        From the middle of the frame to a shaft, or from the only shaft to what is next to it: limits the diameter. [mm]
    max_tip_mach : float
        Limit on the helical tip Mach number at the thrust.
    capacity_Ah : float, optional
        Battery capacity, for the time. [A h]
    minutes : float, optional
        Time in hover that is part of the target, with the capacity. [min]
    fan : bool
        Ducted fans on sale, 30 to 120 mm, instead of propellers.
    fluid : {"air", "water"}
        What the propeller turns in; in water, too little blade area for the thrust is named: it may cavitate.
    coaxial : bool
        Each propeller is one of a pair, one above the other.
    reading : str, optional
        One reading of the propeller, of which the label is given: ``rpm=5400,thrust_g=410``.
    sure : float
        Probability from which on a pair counts as sure.
    out : path, optional
        Folder for JSON, CSV and a picture.

    Returns
    -------
    bemt.tools.design.answer.DriveChoice
        ``.table``, a row per pair, best first: the smallest within 5 % of the least power, then that with the least
        power (columns as :func:`bemt.tools.design.search.choose` says); ``.on_sale``, motors on sale for the first;
        ``exit_code`` 1 if nothing is sure.

    Raises
    ------
    InputError
        With every fault of the request, or if no size can be tried.

    Examples
    --------
    >>> found = choose(8.0, 3, labels=["10x4.5", "9x6", "8x4"], kv=(700, 1500))
    >>> found.table.label.iloc[0], found.exit_code
    ('10x4.5', 0)
    """
    from bemt.base.given import path_text
    from bemt.tools.design import search
    from bemt.tools.design.answer import DriveChoice

    target = search.target_of(thrust_N, cells, mass_kg, rest_kg, rotors, airspeed_m_s, max_tip_mach, capacity_Ah,
                              minutes, fan, fluid, coaxial, arm_mm, reading)  # fmt: skip
    found = DriveChoice(*search.choose(target, kv, motors, labels, blades, max_diameter_in, sure), sure)
    if out is not None:
        found.write(path_text("out", out))
    return found


@action(
    "Propellers and fans", "design --thrust-N 6 --airspeed-m-s 15 --rpm 7000 --diameter-in 10", shown=True,
    common=("thrust_N", "diameter_in", "airspeed_m_s", "rpm", "blades", "material", "duct", "out"),
)  # fmt: skip
def design(
    thrust_N: float | None = None, diameter_in: float | None = None, *, airspeed_m_s: float = 0.0,
    rpm: float | None = None, points: Sequence[str | tuple[float, float, float | None, float]] = (),
    blades: Count | None = None, section: str | None = None, hub_ratio: float | None = None,
    static_thrust_N: float | None = None, static_rpm: float | None = None, min_chord_mm: float | None = None,
    min_thickness_mm: float = 0.0, max_tip_mach: float = 0.8, stall_margin: float = 0.15,
    material: str = "pla", safety: float = 3.0,
    density_kg_m3: float | None = None, duct: Path | None = None, robust: bool = False, out: Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Design:  # fmt: skip
    """Design chord, twist and thickness of a blade for a thrust, next to the best propeller on sale and the ideal.

    Parameters
    ----------
    thrust_N : float, optional
        Thrust at least. [N]
    diameter_in : float, optional
        Diameter; not with a duct. [in]
    airspeed_m_s : float
        Flight speed. [m/s]
    rpm : float, optional
        Speed of rotation; that of the least power by default. [rev/min]
    points : sequence
        More points, as thrust=6,airspeed=15,rpm=7000,weight=1, or tuples (thrust_N, airspeed_m_s, rpm or None, weight);
        weights are shares of the time, and that of the first point is 1.
    blades : int, optional
        Number of blades, 2 by default, in a duct that of the case.
    section : str, optional
        NACA digits or coordinate files (.dat) from hub to tip, as 4412 or 4415,4409; by default 3.5 % camber, 12 %
        thick at the hub and 9 % outside, thicker where stress limits the blade.
    hub_ratio : float, optional
        Hub over tip radius; 0.15 by default.
    static_thrust_N : float, optional
        Thrust that the blade must also reach at rest; the stall margin is not asked for there. [N]
    static_rpm : float, optional
        Speed for that; any by default. [rev/min]
    min_chord_mm : float, optional
        Least chord; 5, of small rotors 4 % of the diameter by default. [mm]
    min_thickness_mm : float
        Least thickness of the section, for printing. [mm]
    max_tip_mach : float
        Limit on the helical tip Mach number.
    stall_margin : float
        Share of the section's largest lift that is kept in hand.
    material : str
        What the blade is made of: pla, petg, pc, pa12, pla_soft, pa6_gf or al6061.
    safety : float
        Strength over stress, at least.
    density_kg_m3 : float, optional
        Air density; 1.225 by default. [kg/m3]
    duct : path, optional
        Case of a ducted rotor: its duct, hub, air and sections are kept, its blade is the start.
    robust : bool
        Least expected power over rotors as built, instead of that of the drawing.
    out : path, optional
        New folder for the case, JSON and a picture; nothing is written without it.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    bemt.tools.design.blade_design.Design
        With the blade (``files``, ``write``, ``case``), the best label and the ideal next to it, bands and the limits
        that are reached; ``exit_code`` 1 if the search did not converge.

    Raises
    ------
    InputError
        With every fault of the request; with the nearest thrust that can be reached, if this one cannot.

    Examples
    --------
    >>> design(6.0, 254, airspeed_m_s=15.0, rpm=7000)
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: diameter_in: got 254; expected a number from 1 to 100 in. In mm? Divide by 25.4.

    The page on design (docs/design.md) has one that is designed.
    """
    from pathlib import Path as File

    from bemt.base.errors import Fault, refuse
    from bemt.base.given import path_text
    from bemt.base.units import INCH
    from bemt.rotors.case import load_case, new_folder
    from bemt.tools.design import design_answer
    from bemt.tools.design.blade_design import design_blade
    from bemt.tools.design.requirement import DesignPoint, point_of

    faults = []
    if thrust_N is None and (rpm is not None or airspeed_m_s):
        faults.append(Fault("", "--thrust-N", "nothing", "a thrust [N] with --airspeed-m-s and --rpm"))
    asked = [] if thrust_N is None else [DesignPoint(thrust_N, airspeed_m_s, rpm)]
    each: list[Any] = [points] if isinstance(points, str) else list(points)
    for i, point in enumerate(each):
        if isinstance(point, str):
            asked.append(point_of(point))
        elif not isinstance(point, (tuple, list)) or len(point) != 4:
            expected = "(thrust_N, airspeed_m_s, rpm or None, weight)"
            faults.append(Fault("", f"points[{i}]", repr(point), expected))
        else:
            asked.append(DesignPoint(*point))
    refuse(faults)
    folder = None if out is None else File(path_text("out", out))
    if folder is not None:
        new_folder.free_folder(folder)
    found = design_blade(
        asked, None if diameter_in is None else diameter_in * INCH, blades, section=section, hub_ratio=hub_ratio,
        density_kg_m3=density_kg_m3, duct=None if duct is None else load_case(path_text("duct", duct)),
        robust=robust, progress=progress, static_thrust_N=static_thrust_N, static_rpm=static_rpm,
        min_chord_mm=min_chord_mm, min_thickness_mm=min_thickness_mm, max_tip_mach=max_tip_mach,
        stall_margin=stall_margin, material=material, safety=safety,
    )  # fmt: skip
    if folder is not None:
        design_answer.write(found, folder)
    return found
