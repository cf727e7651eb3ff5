r"""APC files: blade geometry (``*-PERF.PE0``) and computed performance (``PER3_*.dat``).

PE0 holds about 40 stations in inches and degrees, then radius, hub transition, blade number and sections. The columns
are found by their names, so that the 13-column form and forms with further columns read alike; each row is checked
against itself (maximum thickness = ratio x chord, twist = atan(pitch/(2 pi r)) with the LE-TE pitch), so that a shifted
column cannot pass.

PER3 holds blocks of constant rpm: V [mph], J, Pe, Ct, Cp, PWR [hp], Torque [in lbf], Thrust [lbf]; newer files add
W, N m, N, g/W, Mach, Reynolds number, figure of merit. It is APC's own vortex code, NOT measured, so the series is of
kind ``vendor``. Points at which that code failed are printed as ``-NaN`` and glued to the column before (``0.34-NaN``),
or end after V and J; they stay in the series as NaN with a flag. Coefficients are in the propeller convention.

Sizes come from the designation printed in the first line. Where it drops the decimal point (``134x135-3`` is 13.4x13.5
with 3 blades), the largest reading with a diameter of 4 to 28 in and pitch/diameter of 0.25 to 1.7 is taken, and then
checked against the radius (PE0) or against D = V/(n J) of the rows (PER3).
"""

from __future__ import annotations

import os

from bemt.base.errors import Fault, InputError
from bemt.readers import head_text, load_text
from bemt.readers._apc_common import parse_designation
from bemt.readers._apc_pe0 import ApcBlade, read_pe0
from bemt.readers._apc_per3 import ApcPerformance, read_per3

__all__ = ["KIND", "ApcBlade", "ApcPerformance", "parse_designation", "read", "read_pe0", "read_per3", "sniff"]

KIND = "apc"


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the head of a file is an APC PE0 or PER3 file.

    >>> sniff("10x5E (10x5E.dat)\n ----- AIRFOIL SUMMARY DATA -----"), sniff("RPM CT CP")
    (True, False)
    """
    return _form(head_text(head)) is not None


def _form(text: str) -> str | None:
    if "AIRFOIL SUMMARY DATA" in text and ".dat" in text:
        return "pe0"
    return "per3" if "PERFORMANCE DATA (versus advance ratio" in text else None


def read(path: str | os.PathLike[str]) -> ApcBlade | ApcPerformance:
    """Read either APC file by its content."""
    source = load_text(path)
    form = _form(source.text)
    if form is None:
        expected = "AIRFOIL SUMMARY DATA (PE0) or PERFORMANCE DATA (PER3)"
        raise InputError(Fault(source.name, "", "neither form of an APC file", expected, "Is it an APC file?"))
    return read_pe0(path) if form == "pe0" else read_per3(path)
