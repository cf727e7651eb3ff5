"""Action ``export``: a case as solids, as loads for simulators, as disks and blades."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from bemt.base.action import action
from bemt.base.errors import EXIT_INPUT, EXIT_OK, Fault, InputError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path as Folder

    from bemt.rotors.propeller import Propeller

    Path = str | os.PathLike[str]

__all__ = ["Exported", "export"]


@dataclass(frozen=True, eq=False)
class Exported:
    """What an export wrote.

    Parameters
    ----------
    cases : tuple of (dict, Path)
        Contents of each ``manifest.json`` (files with hashes, what each target holds, its greatest error, notes), and
        its folder.
    refused : tuple of Fault
        Why cases or targets were refused; the others are written.
    """

    cases: tuple[tuple[dict[str, Any], Folder], ...]
    refused: tuple[Fault, ...] = ()

    @property
    def files(self) -> tuple[Folder, ...]:
        """Files that were written now."""
        from bemt.tools.exports.folder import listed

        return tuple(folder / name for manifest, folder in self.cases for name in listed(manifest))

    @property
    def text(self) -> str:
        """What was written and how well it holds the case."""
        from bemt.tools.exports.folder import text

        return "\n".join(text(manifest, folder) for manifest, folder in self.cases)

    @property
    def complaints(self) -> tuple[str, ...]:
        """What was refused."""
        return tuple(str(fault) for fault in self.refused)

    @property
    def exit_code(self) -> int:
        """2 if a case or target was refused."""
        return EXIT_INPUT if self.refused else EXIT_OK

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {"schema": "bemt.export/1", "cases": [manifest for manifest, _ in self.cases]}


@action(
    "Solids and CFD", "export cases/prop_8x5 --out solids --format stl step", words=("case",), shown=True,
    common=("out", "format", "rpm", "airspeed_m_s", "printable", "hold", "unit", "min_thickness_mm"),
)  # fmt: skip
def export(
    case: Propeller | Path, *, out: Path, format: str | Sequence[str] = ("stl",),  # noqa: A002
    rpm: float | None = None, airspeed_m_s: float | None = None, hold: Sequence[str] = (),
    unit: Literal["mm", "m"] = "mm", fillet_mm: float | None = None, min_thickness_mm: float | None = None,
    printable: bool = False, adapter: str | None = None, bore_mm: float | None = None,
    recess_mm: tuple[float, float] | None = None, hex_mm: tuple[float, float] | None = None,
    hub_diameter_mm: float | None = None, hub_height_mm: float | None = None, trailing_edge_mm: float | None = None,
    tip_round: float | None = None, hand: Literal["right", "left", "both"] | None = None,
    sideslip_deg: float | None = None, level: float | None = None, domain: Literal["free", "pipe"] | None = None,
    sector: Literal["half", "blade", "full"] | None = None,
    turbulence: Literal["kOmegaSST", "realizableKE"] | None = None,
    solver: Literal["incompressible", "compressible"] | None = None,
) -> Exported:  # fmt: skip
    """Write a case for CAD, CFD, simulators and design tools.

    Parameters
    ----------
    case : Propeller, str or path
        Propeller, case file, its folder, a folder of cases, or a label such as 10x5.
    out : path
        Folder for the files and manifest.json.
    format : str or sequence of str
        Targets, one or more, such as stl, jsbsim, qprop or openfoam; docs/exports.md lists them.
    rpm : float, optional
        Highest speed of tables and fits; speed of a disk or openfoam; from the case by default. [rev/min]
    airspeed_m_s : float, optional
        Axial speed of disks, blades and openfoam; from the case by default. [m/s]
    hold : sequence of str
        Refuse targets that cannot represent it: torque, airspeed, windmill, reynolds, mach, density, rest, duct,
        sections, rotation, hub.
    unit : {"mm", "m"}
        Unit of the files; openfoam is always in m.
    fillet_mm : float, optional
        Fillet of blade and hub, 0 by default; height of a printed flare. [mm]
    min_thickness_mm : float, optional
        Refuse a blade whose sections are thinner; a printed blade is made so thick, 0.8 by default. [mm]
    printable : bool
        One solid for a printer: thick enough, round tip, hub with a bore; stl, step, 3mf or obj (docs/printing.md).
    adapter : str, optional
        Printing: bore and recess of ring (quarter inch), m3, m5, m6 or m8 (nut).
    bore_mm : float, optional
        Printing: hole through the hub. [mm]
    recess_mm : tuple of float, optional
        Printing: round recess in the back of the hub, diameter and depth. [mm]
    hex_mm : tuple of float, optional
        Printing: hexagonal recess in the back of the hub, across flats and depth. [mm]
    hub_diameter_mm, hub_height_mm : float, optional
        Printing: hub; that of the case and what the root needs by default. [mm]
    trailing_edge_mm : float, optional
        Printing: trailing edge; the least thickness by default. [mm]
    tip_round : float, optional
        Printing: length of the rounded tip over the chord, 0.5 by default, 0.1 in a duct. [1]
    hand : {"right", "left", "both"}, optional
        Printing: direction of rotation; that of the case by default.
    sideslip_deg : float, optional
        openfoam: angle between shaft and wind, 0 to 90; 0 by default. [deg]
    level : float, optional
        openfoam: cells on the blade are R/2^(level+2), all others scale; 6 by default, 5 is faster. [1]
    domain : {"free", "pipe"}, optional
        openfoam: free field, the default, or a cylinder of the propeller's diameter.
    sector : {"half", "blade", "full"}, optional
        openfoam: periodic part; by default one blade from three up, else half; full in oblique flow.
    turbulence : {"kOmegaSST", "realizableKE"}, optional
        openfoam: turbulence model, kOmegaSST by default.
    solver : {"incompressible", "compressible"}, optional
        openfoam: simpleFoam or rhoSimpleFoam; rhoSimpleFoam above a tip Mach number of 0.5 by default.

    Returns
    -------
    Exported
        ``.files``, ``.text``, ``.cases``; ``exit_code`` 2 and ``.refused`` if a target was refused, the others are
        written.

    Raises
    ------
    InputError
        For unknown targets and options that no target reads, and if all targets were refused.

    Examples
    --------
    >>> import tempfile
    >>> made = export("10x5", out=tempfile.mkdtemp(), format="qprop")
    >>> [file.suffix for file in made.files], "qprop" in made.text.lower()
    (['.qprop'], True)
    >>> export("10x5", out=tempfile.mkdtemp(), format="qpropp")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: format: got qpropp; expected one of ...
    """
    from bemt.base.given import path_text
    from bemt.rotors.propeller import Propeller, rotor_of
    from bemt.tools.exports.folder import export_cases
    from bemt.tools.exports.printing import request_of

    given = {"rpm": rpm, "airspeed_m_s": airspeed_m_s, "sideslip_deg": sideslip_deg, "level": level, "domain": domain,
             "sector": sector, "turbulence": turbulence, "solver": solver}  # fmt: skip
    printed = request_of(
        printable, min_thickness_mm=min_thickness_mm, trailing_edge_mm=trailing_edge_mm, tip_round=tip_round,
        flare_mm=fillet_mm, hub_diameter_mm=hub_diameter_mm, hub_height_mm=hub_height_mm, adapter=adapter,
        bore_mm=bore_mm, recess_mm=recess_mm, hex_mm=hex_mm, hand=hand,
    )  # fmt: skip
    label = isinstance(case, Propeller) or not (os.path.exists(case) or "/" in os.fspath(case))
    words = [format] if isinstance(format, str) else list(format)
    solid = (0.0, 0.0) if printed is not None else (fillet_mm or 0.0, min_thickness_mm or 0.0)
    made, errors = export_cases(
        rotor_of(case).case if label else os.fspath(case), path_text("out", out), words, unit, *solid, given,
        tuple(dict.fromkeys(hold)), printed,
    )  # fmt: skip
    refused = tuple(fault for error in errors for fault in error.faults)
    if refused and not made:
        raise InputError(refused)
    return Exported(tuple(made), refused)
