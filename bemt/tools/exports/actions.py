"""Action ``export``: a case as solids, as loads for simulators, as disks and blades for other programs."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Literal

from bemt.base.action import action

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bemt.rotors.propeller import Propeller
    from bemt.tools.exports.folder import Exported

    Path = str | os.PathLike[str]

__all__ = ["export"]


@action(
    "Solids and CFD", "export cases/prop_8x5 --out solids --format stl step", words=("case",), shown=True,
    common=("out", "format", "rpm", "airspeed_m_s", "hold", "printable", "nozzle_mm", "adapter"),
)  # fmt: skip
def export(
    case: Propeller | Path, out: Path, format: str | Sequence[str] = "stl", *,  # noqa: A002
    rpm: float | None = None, airspeed_m_s: float | None = None, hold: Sequence[str] = (),
    unit: Literal["mm", "m"] = "mm", fillet_mm: float | None = None, min_thickness_mm: float | None = None,
    printable: bool = False, nozzle_mm: float | None = None, adapter: str | None = None, bore_mm: float | None = None,
    recess_mm: tuple[float, float] | None = None, hex_mm: tuple[float, float] | None = None,
    hub_diameter_mm: float | None = None, hub_height_mm: float | None = None, trailing_edge_mm: float | None = None,
    tip_round: float | None = None, hand: Literal["right", "left", "both"] | None = None,
    sideslip_deg: float | None = None, level: float | None = None, domain: Literal["free", "pipe"] | None = None,
    sector: Literal["half", "blade", "full"] | None = None,
    turbulence: Literal["kOmegaSST", "realizableKE"] | None = None,
    solver: Literal["compressible", "incompressible"] | None = None, far_field_over_D: float | None = None,
    progress: Callable[[str], None] | None = None,
) -> Exported:  # fmt: skip
    """Write a case for CAD, CFD, simulators and design tools.

    Parameters
    ----------
    case : Propeller, str or path
        Propeller, case, label such as 10x5, or a folder of cases.
    out : path
        Folder for the files and manifest.json; of several cases, each gets a folder of its own in it.
    format : str or sequence of str
        Targets, such as stl, jsbsim or qprop; docs/exports.md lists them.
    rpm : float, optional
        Highest speed of tables, speed of a disk or of openfoam; from the case by default. A model of few numbers
        (gazebo, rotorpy, px4, ardupilot) has the loads of this speed at rest. [rev/min]
    airspeed_m_s : float, optional
        Axial speed of disks, blades and openfoam; from the case by default. [m/s]
    hold : sequence of str
        Refuse targets that cannot represent these: torque, airspeed, windmill, reynolds, mach, density, rest, duct,
        sections, rotation, hub.
    unit : {"mm", "m"}
        Unit of solids; openfoam is always in m.
    fillet_mm : float, optional
        Fillet of blade and hub, 0 by default; height of the flare of a printed blade. [mm]
    min_thickness_mm : float, optional
        Refuse a blade whose sections are thinner; a printed blade is made so, whatever the nozzle. [mm]
    printable : bool
        One solid for a printer: thick enough, round tip, hub with a bore (docs/design.md).
    nozzle_mm : float, optional
        Nozzle of the printer, 0.4 by default; the least thickness is two of its lines. [mm]
    adapter : str, optional
        Bore and recess of a printed hub: ring (quarter inch), m3, m5, m6 or m8 (nut).
    bore_mm : float, optional
        Hole through the printed hub. [mm]
    recess_mm : (float, float), optional
        Round recess in the back of the printed hub: diameter and depth. [mm]
    hex_mm : (float, float), optional
        Hexagonal recess in the back of the printed hub: across flats and depth. [mm]
    hub_diameter_mm : float, optional
        Diameter of the printed hub; that of the case by default. [mm]
    hub_height_mm : float, optional
        Height of the printed hub; what the root needs by default. [mm]
    trailing_edge_mm : float, optional
        Trailing edge of a printed blade; the least thickness by default. [mm]
    tip_round : float, optional
        Length of the rounded printed tip over the chord, 0.5 by default, 0.1 in a duct.
    hand : {"right", "left", "both"}, optional
        Direction of rotation; that of the case by default. Both: one print of each.
    sideslip_deg : float, optional
        Openfoam: angle between shaft and wind, 0 to 90; 0 by default. [deg]
    level : float, optional
        Openfoam: cells on the blade are R/2^(level+2), all others scale; 6 by default, 5 is faster.
    domain : {"free", "pipe"}, optional
        Openfoam: free field (default), or a cylinder of the propeller's diameter.
    sector : {"half", "blade", "full"}, optional
        Openfoam: periodic part; one blade from three up, else half, full in oblique flow by default.
    turbulence : {"kOmegaSST", "realizableKE"}, optional
        Openfoam: turbulence model; kOmegaSST by default.
    solver : {"compressible", "incompressible"}, optional
        Openfoam: rhoSimpleFoam (by default above a tip Mach number of 0.5) or simpleFoam.
    far_field_over_D : float, optional
        Flow: width of the box of air over the diameter, 10 by default; half of it is ahead of the rotor, all of it
        behind.
    progress : callable, optional
        Called with one line per target while it is written.

    Returns
    -------
    bemt.tools.exports.folder.Exported
        ``.files``, ``.manifests``, ``.text``; ``exit_code`` 2 where a target or a case was refused, and
        ``complaints`` say why.

    Raises
    ------
    InputError
        With every fault of the options, and where nothing could be written.

    Examples
    --------
    >>> import tempfile
    >>> made = export("10x5", tempfile.mkdtemp(), "qprop")
    >>> [file.suffix for file in made.files], "qprop" in str(made).lower()
    (['.qprop'], True)
    >>> export("10x5", tempfile.mkdtemp(), "qpropp")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: format: got qpropp; expected one of ...
    """
    from pathlib import Path as File

    from bemt.base.errors import Fault, InputError, refuse, system_fault
    from bemt.base.given import number, path_text
    from bemt.rotors.propeller import rotor_of
    from bemt.tools.exports.folder import Exported, export_cases
    from bemt.tools.exports.printing import Print, asked

    wanted = [word.lower() for word in ([format] if isinstance(format, str) else format)]
    numbers = {"rpm": rpm, "airspeed_m_s": airspeed_m_s, "sideslip_deg": sideslip_deg, "level": level,
               "far_field_over_D": far_field_over_D}  # fmt: skip
    given: dict[str, Any] = {k: None if v is None else number(k, v, finite=False) for k, v in numbers.items()}
    given |= {"domain": domain, "sector": sector, "turbulence": turbulence, "solver": solver}
    request = Print(
        None, nozzle_mm, trailing_edge_mm, tip_round, None, hub_diameter_mm, hub_height_mm, adapter, bore_mm,
        recess_mm, hex_mm, hand if printable or hand == "both" else None,
    )  # fmt: skip
    if printable:
        request = Print(**{**vars(request), "min_thickness_mm": min_thickness_mm, "flare_mm": fillet_mm})
    else:
        refuse(Fault("", name, "given", "nothing without --printable") for name in asked(request))
    folder = path_text("out", out)
    named = isinstance(case, (str, os.PathLike)) and File(case).exists()
    # Of a printed blade, flare and thickness are the print's
    fillet, least = (0.0, 0.0) if printable else (fillet_mm or 0.0, min_thickness_mm or 0.0)
    try:
        made, refused = export_cases(
            os.fspath(case) if named else rotor_of(case).case, folder, wanted or ["stl"], unit,  # type: ignore[arg-type]
            fillet, least, given, tuple(dict.fromkeys(hold)), request if printable else None, progress,
            None if printable else hand,
        )  # fmt: skip
    except OSError as error:
        raise InputError(system_fault(error)) from error
    return Exported.of(made, refused)
