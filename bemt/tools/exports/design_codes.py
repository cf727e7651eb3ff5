"""Files of XROTOR, QPROP and DFDC: rotors with sections of few numbers."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from bemt import __version__
from bemt.base.arrays import Array
from bemt.base.errors import Fault
from bemt.physics.sections.parametric import QpropSection, XrotorSection, fit_qprop, fit_xrotor
from bemt.tools.exports.base import BladeExport, Files, Job
from bemt.tools.exports.blades import MOST_STATIONS, anchors_of, section_errors, stations
from bemt.tools.exports.parts import plain_name

if TYPE_CHECKING:
    from bemt.rotors.case import Case


class SectionExport(BladeExport):
    """A target whose sections are fits of few numbers."""

    most: ClassVar[int] = MOST_STATIONS

    def fitted(self, job: Job) -> list[tuple[float, Any]]:
        """r/R and section of each anchor at the Reynolds number of the operating point; XROTOR's and DFDC's."""
        return [(x, fit_xrotor(polar, Re)) for x, polar, Re in anchors_of(job)]

    def sections(self, job: Job) -> list[Any]:
        """Fitted at the Reynolds number of the operating point."""
        return [s for _, s in self.fitted(job)]

    def notes(self, job: Job) -> list[str]:
        """What a fit of sections leaves out."""
        errors = section_errors(job, self.sections(job))
        worst = ", ".join(f"r/R {e['r_over_R']:.2f}: cl {e['cl']:.3f}, cd {e['cd_pct']:.0f} %" for e in errors)
        thin = stations(job, self.most)[3]
        return [
            f"sections are fits at the Reynolds numbers of the operating point; worst between the stalls: {worst}",
            "mcrit 0.8 and the pitching moment 0 are not from the case; what is read back gets this project's own "
            "effects",
            *([f"{self.most} stations instead of {job.case.rotor().blade.r.size}"] if thin else []),
            *self.told,
        ]


class XrotorExport(SectionExport):
    """File for XROTOR's LOAD."""

    id = "xrotor"
    title = "XROTOR rotor"
    holds = "stations; per section: linear lift with smooth stall, parabolic drag, one exponent of Reynolds number"
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "mach", "density", "sections"})
    conventions = "r/R, c/R, beta in degrees from the plane of rotation; Adv = V/(Omega R); SI"
    source = "XROTOR 7.55 xio.f LOAD (read), xaero.f CLCDCM (section)"
    told = ("tip loss, swirl and wake are XROTOR's own; stall delay and cascade are not in the file",)

    def write(self, job: Job) -> Files:
        """The rotor at the operating point; at rest XROTOR gets a small speed."""
        p = job.loading
        r, c, b, _ = stations(job)
        V = max(p.airspeed_m_s, 0.01 * p.omega * p.R)
        rows = ["XROTOR VERSION:  7.55", f"{job.case.name}, {job.rotation}, bemt {__version__}"[:80]]
        rows += [
            "!         Rho          Vso          Rmu           Alt",
            f" {p.rho:.9g} {p.a_sound:.9g} {p.mu:.9g} 999.0",
        ]
        rows += [
            "!         Rad          Vel          Adv          Rake",
            f" {p.R:.10g} {V:.10g} {V / (p.omega * p.R):.10g} 0.0",
        ]
        rows += ["!         XI0          XIW", f" {p.Rhub / p.R:.10g} {p.Rhub / p.R:.10g}", "!  Naero"]
        found = self.fitted(job)
        rows += [f" {len(found)}", *(line for x, s in found for line in section_lines(x, s))]
        rows += [
            "!LVDuct  LDuct   LWind", "  T       F       F", "!   II Nblds", f" {r.size} {p.blades}",
            "!         r/R          C/R     Beta0deg         Ubody",
        ]  # fmt: skip
        rows += [f" {x / p.R:.10g} {y / p.R:.10g} {np.degrees(z):.10g} 0.0" for x, y, z in zip(r, c, b, strict=True)]
        rows += ["!      URDuct", " 1.0"]
        return {f"{plain_name(job.case.name)}.xrotor": "\n".join(rows) + "\n"}

    def notes(self, job: Job) -> list[str]:
        """What every such file leaves out, and how a point at rest stands in it."""
        static = "static: Vel is 1 % of the tip speed, because XROTOR has no static case"
        return [*super().notes(job), *([static] if job.airspeed <= 0.0 else [])]


def section_lines(x: float, s: XrotorSection) -> list[str]:
    """Lines of one section, as XROTOR and DFDC write them."""
    return [
        "!   Xisection",
        f" {x:.10g}",
        "!       A0deg        dCLdA        CLmax         CLmin",
        f" {np.degrees(s.a0):.12g} {s.dclda:.12g} {s.clmax:.12g} {s.clmin:.12g}",
        "!  dCLdAstall     dCLstall      Cmconst         Mcrit",
        f" {s.dclda_stall:.12g} {s.dcl_stall:.12g} {s.cmcon:.6g} {s.mcrit:.6g}",
        "!       CDmin      CLCDmin     dCDdCL^2",
        f" {s.cdmin:.12g} {s.clcdmin:.12g} {s.dcdcl2:.12g}",
        "!       REref        REexp",
        f" {s.reref:.12g} {s.reexp:.12g}",
    ]


# QPROP: a propeller file.

Anchors = list[tuple[float, QpropSection]]


class QpropExport(SectionExport):
    """Propeller file: eight lines of head, then stations with a section each."""

    id = "qprop"
    title = "QPROP propeller"
    holds = "stations; per station: clipped linear lift, two parabolas of drag, one exponent of Reynolds number"
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "density", "rest", "sections"})
    conventions = "metres and degrees (factors 1), R on the second line in metres; slope per radian"
    source = "QPROP 1.22 qprop.f (read), gvcalc.f, tqcalc.f (loads), cdfun.f (drag)"
    told = (
        "QPROP has no hub radius: the blade begins at the first station",
        "wake and tip loss are QPROP's own",
    )

    def write(self, job: Job) -> Files:
        """The file; sections between anchors are interpolated in their numbers."""
        p = job.loading
        r, c, b, _ = stations(job)
        found = self.fitted(job)
        first = found[0][1]
        rows = [
            f"{job.case.name}, {job.rotation}, bemt {__version__}", "", f" {p.blades} {p.R:.10g}  ! Nblades [ R ]",
            "",
        ]  # fmt: skip
        rows += [
            f" {first.cl0:.12g} {first.cla:.12g}  ! CL0 CL_a",
            f" {first.clmin:.12g} {first.clmax:.12g}  ! CLmin CLmax",
        ]
        rows += ["", f" {first.cd0:.12g} {first.cd2u:.12g} {first.cd2l:.12g} {first.clcd0:.12g}  ! CD0 CD2u CD2l CLCD0"]
        rows += [f" {first.reref:.12g} {first.reexp:.12g}  ! REref REexp", ""]
        rows += [" 1.0 1.0 1.0  ! Rfac Cfac Bfac", " 0.0 0.0 0.0  ! Radd Cadd Badd", "", "#  r  chord  beta"]
        for x, y, z in zip(r, c, b, strict=True):
            row = f" {x:.10g} {y:.10g} {np.degrees(z):.10g}"
            if len(found) > 1:
                row += " " + " ".join(f"{v:.12g}" for v in _between(found, x / p.R))
            rows.append(row)
        return {f"{plain_name(job.case.name)}.qprop": "\n".join(rows) + "\n"}

    def fitted(self, job: Job) -> Anchors:
        """Sections with one reference Reynolds number: QPROP takes that of the first station for all (its CDFUN)."""
        found = [(x, fit_qprop(polar, Re)) for x, polar, Re in anchors_of(job)]
        common = found[0][1].reref
        out = []
        for x, s in found:
            scale = (common / s.reref) ** s.reexp
            out.append((x, replace(s, cd0=s.cd0 * scale, cd2u=s.cd2u * scale, cd2l=s.cd2l * scale, reref=common)))
        return out


def _between(found: Anchors, x: float) -> list[float]:
    from dataclasses import astuple

    at = [a for a, _ in found]
    table = np.array([astuple(s) for _, s in found])
    return [float(np.interp(x, at, column)) for column in table.T]


# DFDC: a ducted rotor with its walls.

DFDC_STATIONS = 30
"""IRX of DFDC.INC; a file with more is read and gives NaN."""


class DfdcExport(SectionExport):
    """Case file for DFDC's LOAD."""

    id = "dfdc"
    title = "DFDC ducted fan"
    holds = "stations, sections as XROTOR's, duct and centre body as outlines; no stator"
    features = frozenset({"torque", "airspeed", "reynolds", "mach", "density", "rest", "duct", "sections"})
    conventions = "metres, x downstream from the lip, beta in degrees from the plane of rotation, RPM in rev/min"
    source = "DFDC 0.70 documentation (dfdc_doc.txt), sample cases, DFDC.INC (IRX = 30)"
    told = (
        "the stator and its recovery of swirl are left out",
        "the centre body is a cylinder of the hub's radius with an elliptic nose: not from the case",
        "the tip gap is left out: the wall is drawn in to the blade tip",
    )
    most = DFDC_STATIONS

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
        r, c, b, _ = stations(job, self.most)
        x = duct.rotor_x
        found = self.fitted(job)
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
