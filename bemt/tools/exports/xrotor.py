"""XROTOR: a saved rotor with sections of few numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from bemt import __version__
from bemt.physics.sections.parametric import XrotorSection, fit_xrotor
from bemt.tools.exports.base import BladeExport, Files, Job
from bemt.tools.exports.blades import MOST_STATIONS, anchors_of, section_errors, stations
from bemt.tools.exports.parts import plain_name


class XrotorExport(BladeExport):
    """File for XROTOR's LOAD."""

    id = "xrotor"
    title = "XROTOR rotor"
    holds = "stations; per section: linear lift with smooth stall, parabolic drag, one exponent of Reynolds number"
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "mach", "density", "sections"})
    conventions = "r/R, c/R, beta in degrees from the plane of rotation; Adv = V/(Omega R); SI"
    source = "XROTOR 7.55 xio.f LOAD (read), xaero.f CLCDCM (section)"

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
        found = sections_of(job)
        rows += [f" {len(found)}", *(line for x, s in found for line in section_lines(x, s))]
        rows += [
            "!LVDuct  LDuct   LWind",
            "  T       F       F",
            "!   II Nblds",
            f" {r.size} {p.blades}",
            "!         r/R          C/R     Beta0deg         Ubody",
        ]
        rows += [f" {x / p.R:.10g} {y / p.R:.10g} {np.degrees(z):.10g} 0.0" for x, y, z in zip(r, c, b, strict=True)]
        rows += ["!      URDuct", " 1.0"]
        return {f"{plain_name(job.case.name)}.xrotor": "\n".join(rows) + "\n"}

    def sections(self, job: Job) -> list[Any]:
        """Fitted at the Reynolds number of the operating point."""
        return [s for _, s in sections_of(job)]

    def notes(self, job: Job) -> list[str]:
        """How well the sections hold."""
        return [
            *section_notes(job, section_errors(job, self.sections(job))),
            "tip loss, swirl and wake are XROTOR's own; stall delay and cascade are not in the file",
            *(
                ["static: Vel is 1 % of the tip speed, because XROTOR has no static case"]
                if job.airspeed <= 0.0
                else []
            ),
        ]


def sections_of(job: Job) -> list[tuple[float, XrotorSection]]:
    """Sections fitted at the anchors of the case, at the Reynolds number of the operating point."""
    return [(x, fit_xrotor(polar, Re)) for x, polar, Re in anchors_of(job)]


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


def section_notes(job: Job, errors: list[dict[str, float]], most: int = MOST_STATIONS) -> list[str]:
    """What a fit of sections leaves out."""
    thin = stations(job, most)[3]
    worst = ", ".join(f"r/R {e['r_over_R']:.2f}: cl {e['cl']:.3f}, cd {e['cd_pct']:.0f} %" for e in errors)
    return [
        f"sections are fits at the Reynolds numbers of the operating point; worst between the stalls: {worst}",
        "mcrit 0.8 and the pitching moment 0 are not from the case; what is read back gets this project's own effects",
        *([f"{most} stations instead of {job.case.rotor().blade.r.size}"] if thin else []),
    ]
