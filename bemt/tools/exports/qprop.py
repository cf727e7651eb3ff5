"""QPROP: a propeller file."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from bemt import __version__
from bemt.physics.sections.parametric import QpropSection, fit_qprop
from bemt.tools.exports.base import BladeExport, Files, Job
from bemt.tools.exports.blades import anchors_of, section_errors, stations
from bemt.tools.exports.parts import plain_name
from bemt.tools.exports.xrotor import section_notes

Anchors = list[tuple[float, QpropSection]]


class QpropExport(BladeExport):
    """Propeller file: eight lines of head, then stations with a section each."""

    id = "qprop"
    title = "QPROP propeller"
    holds = "stations; per station: clipped linear lift, two parabolas of drag, one exponent of Reynolds number"
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "density", "rest", "sections"})
    conventions = "metres and degrees (factors 1), R on the second line in metres; slope per radian"
    source = "QPROP 1.22 qprop.f (read), gvcalc.f, tqcalc.f (loads), cdfun.f (drag)"

    def write(self, job: Job) -> Files:
        """The file; sections between anchors are interpolated in their numbers."""
        p = job.loading
        r, c, b, _ = stations(job)
        found = _sections(job)
        first = found[0][1]
        rows = [
            f"{job.case.name}, {job.rotation}, bemt {__version__}",
            "",
            f" {p.blades} {p.R:.10g}  ! Nblades [ R ]",
            "",
        ]
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

    def sections(self, job: Job) -> list[Any]:
        """Fitted at the Reynolds number of the operating point."""
        return [s for _, s in _sections(job)]

    def notes(self, job: Job) -> list[str]:
        """How well the sections hold."""
        return [
            *section_notes(job, section_errors(job, self.sections(job))),
            "QPROP has no hub radius: the blade begins at the first station",
            "wake and tip loss are QPROP's own",
        ]


def _sections(job: Job) -> Anchors:
    """Sections with one reference Reynolds number: QPROP takes that of the first station for all (tqcalc.f, CDFUN)."""
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
