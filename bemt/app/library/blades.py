"""Functions of the public API that make blades: design."""

from __future__ import annotations

import os
from collections.abc import Sequence
from numbers import Real
from typing import TYPE_CHECKING

from bemt.app.library.given import in_words_of_the_library, path_text
from bemt.base.errors import Fault, InputError
from bemt.base.units import INCH

if TYPE_CHECKING:
    from bemt.tools.design.blade_design import Design

__all__ = ["design"]


def design(
    thrust_N: float | None = None, diameter_in: float | None = None, *, airspeed_m_s: float = 0.0,
    rpm: float | None = None, points: Sequence[tuple[float, float, float | None, float]] = (),
    blades: int | None = None, section: str | None = None, hub_ratio: float | None = None,
    static_thrust_N: float | None = None, static_rpm: float | None = None, min_chord_mm: float | None = None,
    min_thickness_mm: float = 0.0, max_tip_mach: float = 0.8, stall_margin: float = 0.15, material: str = "pla",
    safety: float = 3.0, density_kg_m3: float | None = None, duct: str | os.PathLike[str] | None = None,
    robust: bool = False,
) -> Design:  # fmt: skip
    """Design chord and twist of a blade for a thrust, or for several points, with the least mean power.

    Parameters
    ----------
    thrust_N : float
        Thrust at least. [N]
    diameter_in : float
        Diameter; not with `duct`. [in]
    airspeed_m_s, rpm : float
        Flight speed [m/s] and speed of rotation [rev/min]; without rpm, that of the least power.
    points : sequence of (thrust_N, airspeed_m_s, rpm or None, weight)
        More points; weights are shares of the time, and that of the first is 1.
    blades : int, optional
        Number of blades, 2 by default, in a duct that of the case.
    section : str, optional
        NACA digits or coordinate files (.dat) from hub to tip, as ``"4412"`` or ``"4415,4409"``; by default that of
        the section rule (3.5 % camber, 9 % thickness), 12 % thick at the hub.
    hub_ratio : float, optional
        Hub over tip radius [1]; 0.15 by default.
    static_thrust_N, static_rpm : float, optional
        Thrust that the blade must also reach at rest [N], at this or any speed [rev/min]; the stall margin is not asked
        for there.
    min_chord_mm, min_thickness_mm : float
        Least chord, 5 mm or 4 % of a small diameter by default, and least thickness of the section. [mm]
    max_tip_mach, stall_margin : float
        Helical tip Mach number; share of the section's largest lift that is kept in hand. [1]
    material, safety : str, float
        One of `bemt.tools.design.materials.MATERIALS`; strength over stress at least.
    density_kg_m3 : float, optional
        Air density; 1.225 by default. [kg/m3]
    duct : path, optional
        Case of a ducted rotor: its duct, hub, air and sections are kept, its blade is the start.
    robust : bool
        Least expected power over rotors as built, instead of that of the drawing.

    Returns
    -------
    Design
        With the blade (``files``, ``write``, ``case``), the best label and the ideal next to it, bands and the limits
        that are reached. Its text is the comparison.

    Raises
    ------
    InputError
        With every fault of the request; with the nearest thrust that can be reached, if this one cannot.

    Examples
    --------
    >>> import bemt
    >>> bemt.design(6.0, 254, airspeed_m_s=15.0, rpm=7000)
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: diameter_in: got 254; expected a number from 1 to 100 in. In mm? Divide by 25.4.

    The page on design (docs/design.md) has one that is designed.
    """
    from bemt.rotors.case import load_case
    from bemt.tools.design.blade_design import design_blade
    from bemt.tools.design.requirement import DesignPoint

    given = {"thrust_N": thrust_N, "diameter_in": diameter_in, "airspeed_m_s": airspeed_m_s, "rpm": rpm,
             "blades": blades, "hub_ratio": hub_ratio, "static_thrust_N": static_thrust_N, "static_rpm": static_rpm,
             "min_chord_mm": min_chord_mm, "min_thickness_mm": min_thickness_mm, "max_tip_mach": max_tip_mach,
             "stall_margin": stall_margin, "safety": safety, "density_kg_m3": density_kg_m3}  # fmt: skip
    words = [k for k, v in given.items() if not isinstance(v, (Real, type(None)))]
    if words:
        raise InputError([Fault("", k, repr(given[k]), "a number") for k in words])
    with in_words_of_the_library():
        asked = [] if thrust_N is None else [DesignPoint(thrust_N, airspeed_m_s, rpm)]
        for i, point in enumerate(points):
            if len(point) != 4:
                raise InputError(
                    Fault("", f"points[{i}]", repr(point), "(thrust_N, airspeed_m_s, rpm or None, weight)")
                )
            asked.append(DesignPoint(*point))
        return design_blade(
            asked, None if diameter_in is None else diameter_in * INCH, blades, section=section, hub_ratio=hub_ratio,
            density_kg_m3=density_kg_m3, duct=None if duct is None else load_case(path_text("duct", duct)),
            robust=robust, static_thrust_N=static_thrust_N, static_rpm=static_rpm, min_chord_mm=min_chord_mm,
            min_thickness_mm=min_thickness_mm, max_tip_mach=max_tip_mach, stall_margin=stall_margin, material=material,
            safety=safety,
        )  # fmt: skip
