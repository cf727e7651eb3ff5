"""DFDC: a ducted rotor with its walls."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bemt import __version__
from bemt.base.arrays import Array
from bemt.base.errors import Fault
from bemt.tools.exports.base import BladeExport, Files, Job
from bemt.tools.exports.blades import section_errors, stations
from bemt.tools.exports.parts import plain_name
from bemt.tools.exports.xrotor import section_lines, section_notes, sections_of

if TYPE_CHECKING:
    from bemt.rotors.case import Case

MOST_STATIONS = 30
"""IRX of DFDC.INC; a file with more is read and gives NaN."""


class DfdcExport(BladeExport):
    """Case file for DFDC's LOAD."""

    id = "dfdc"
    title = "DFDC ducted fan"
    holds = "stations, sections as XROTOR's, duct and centre body as outlines; no stator"
    features = frozenset({"torque", "airspeed", "reynolds", "mach", "density", "rest", "duct", "sections"})
    conventions = "metres, x downstream from the lip, beta in degrees from the plane of rotation, RPM in rev/min"
    source = "DFDC 0.70 documentation (dfdc_doc.txt), sample cases, DFDC.INC (IRX = 30)"

    def faults(self, job: Job) -> list[Fault]:
        """Refuse a rotor without walls."""
        out = super().faults(job)
        if not job.case.ducted:
            out.append(
                Fault(job.file, f"--format {self.id}", "an open rotor", "a rotor in a duct", "xrotor or qprop hold it")
            )
        return out

    def write(self, job: Job) -> Files:
        """OPER, AERO, ROTOR and GEOM."""
        p, rotor, duct = job.loading, job.case.rotor(), self.compared(job).duct()
        assert duct is not None and duct.rotor_x is not None
        r, c, b, _ = stations(job, MOST_STATIONS)
        x = duct.rotor_x
        found = sections_of(job)
        V_ref = max(p.airspeed_m_s, 0.2 * p.omega * p.R)
        rows = [
            "DFDC Version  0.70",
            f"{job.case.name}, {job.rotation}, bemt {__version__}"[:80],
            "",
            "OPER",
            "!        Vinf         Vref          RPM",
            f" {p.airspeed_m_s:.9g} {V_ref:.9g} {p.rpm:.9g}",
            "!         Rho          Vso          Rmu           Alt",
            f" {p.rho:.9g} {p.a_sound:.9g} {p.mu:.9g} 0.0",
            "!       XDwake        Nwake",
            " 0.8 20",
            "!       Lwkrlx",
            " F",
            "ENDOPER",
            "",
            "AERO",
            "!  #sections",
            f" {len(found)}",
            *(line for at, s in found for line in section_lines(at, s)),
            "ENDAERO",
            "",
            "ROTOR",
            "!       Xdisk        Nblds       NRPdef",
            f" {x:.9g} {p.blades} 11",
            "!  #stations",
            f" {r.size}",
            "!           r        Chord         Beta",
        ]
        rows += [f" {a:.10g} {s:.10g} {np.degrees(t):.10g}" for a, s, t in zip(r, c, b, strict=True)]
        rows += ["ENDROTOR", "", "GEOM", f"{job.case.name}"]
        rows += [f" {a:.10f} {h:.10f}" for a, h in _body(rotor.Rhub, x, duct.length)] + [" 999.0 999.0"]
        rows += [f" {a:.10f} {h:.10f}" for a, h in _duct(duct)] + ["ENDGEOM"]
        return {f"{plain_name(job.case.name)}.case": "\n".join(rows) + "\n"}

    def compared(self, job: Job) -> Case:
        """The case without stator and tip gap, which the format does not hold."""
        duct = job.case.file.duct
        gone: dict[str, float] = {}
        if duct is not None and duct.stator is not None:
            gone["duct.stator.recovery"] = 0.0
        if duct is not None and duct.tip_gap_mm is not None:
            gone["duct.tip_gap_mm"] = 0.0
        return job.case.replaced(gone) if gone else job.case

    def sections(self, job: Job) -> list[Any]:
        """As XROTOR's."""
        return [s for _, s in sections_of(job)]

    def notes(self, job: Job) -> list[str]:
        """What DFDC does not hold of the case."""
        return [
            *section_notes(job, section_errors(job, self.sections(job)), MOST_STATIONS),
            "the stator and its recovery of swirl are left out",
            "the centre body is a cylinder of the hub's radius with an elliptic nose: not from the case",
            "the tip gap is left out: the wall is drawn in to the blade tip",
        ]


def _body(Rhub: float, x: float, end: float) -> Array:
    """Outline from the back over the top to the nose, (n, 2)."""
    front = x - 1.5 * Rhub
    back = np.linspace(end, x - 0.3 * Rhub, 25)
    t = np.linspace(np.pi / 2.0, 0.0, 25)[1:]
    nose = np.stack([x - 0.3 * Rhub - 1.2 * Rhub * np.cos(t), Rhub * np.sin(t)], axis=1)
    assert abs(nose[-1, 0] - front) < 1e-9
    return np.concatenate([np.stack([back, np.full(back.size, Rhub)], axis=1), nose])


def _duct(duct: Any) -> Array:
    """Outline from the trailing edge over the outside to the lip and back along the bore, (n, 2)."""
    inner, outer = duct.profile(61)
    return np.concatenate([outer[::-1], inner[1:]])
