"""Tables of Drive Calculator: propellers as power laws of the speed, and motor points.

Propellers (``myid,tbs,Name,Dia,Pitch,a,b,...,c,d,...,n10N,n100W,...``): static thrust [gf] = a (n/1000)^b and shaft
power [W] = c (n/1000)^d with n in rev/min; Dia and Pitch in inches. The headings name no units, but the table proves
those of thrust and power itself: ``n10N`` and ``n100W`` are the speeds at 10 N and 100 W. Rows where they disagree are
flagged. The laws are fits of others' measurements at the altitude and temperature beside them, not measurements.

Motor points (``id,motor_id,motor,...,U_V,n_rpm,I_A,...``) name most units in their headings.
"""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np

from bemt.data.readers import first_cells, load_text
from bemt.data.readers.headings import heading, known
from bemt.data.readers.recording import Builder
from bemt.data.readers.split import split_table
from bemt.physics.dataset import Dataset

KIND = "drivecalc"
_PROPELLERS = {"Name", "Dia", "Pitch", "a", "b", "c", "d", "n10N", "n100W"}
_POINTS = {"motor_id", "motor", "kV", "Rm", "U_V", "n_rpm", "I_A", "no_load"}
_KNOWN = {
    "Dia": ("diameter", "in"), "Pitch": ("pitch", "in"), "a": ("thrust_law", "gf"), "c": ("power_law", "W"),
    "AltThr": ("thrust_altitude", "m"), "TmpThr": ("thrust_temperature", "C"), "MaxRPM": ("max", "rpm"),
    "AltPwr": ("power_altitude", "m"), "TmpPwr": ("power_temperature", "C"), "n10N": ("at_10_N", "rpm"),
    "n100W": ("at_100_W", "rpm"), "b": ("thrust_exponent", "-"), "d": ("power_exponent", "-"),
}  # fmt: skip


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the first line has the headings of one of the two tables.

    >>> sniff("myid,tbs,Name,Dia,Pitch,a,b,c,d,n10N,n100W\n"), sniff("Name,Dia,Pitch\n")
    (True, False)
    """
    cells = first_cells(head)
    return cells >= _PROPELLERS or cells >= _POINTS


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read one of the two tables."""
    build = Builder(split_table(load_text(path), header=True), KIND, kind="table")
    propellers = set(build.table.headings) >= _PROPELLERS
    for k, text in enumerate(build.table.headings):
        own = known(text, *_KNOWN[text]) if text in _KNOWN else replace(heading(text), unit=None, doubt="", told="")
        build.add(k, own if propellers else heading(text))
    if propellers and not build.faults:
        _check(build, "thrust_law_N", "thrust_exponent", "at_10_N_rpm", 10.0)
        _check(build, "power_law_W", "power_exponent", "at_100_W_rpm", 100.0)
        build.warnings.append("power laws fitted to measurements of others (columns srcThr, srcPwr), no measurements")
    elif not build.faults:
        build.warnings.append("kV [(rev/min)/V] and Rm [ohm] carry no unit in this table")
        build.flag_speeds("rpm")
    return build.finish({"program": "Drive Calculator", "form": "propellers" if propellers else "motor points"})


def _check(build: Builder, law: str, exponent: str, at: str, target: float) -> None:
    """Hold a law against the speed at which the table says that it gives the target."""
    if not {law, exponent, at} <= build.channels.keys():
        return
    a, b, n = (build.channels[name].values for name in (law, exponent, at))
    with np.errstate(over="ignore", invalid="ignore"):
        ratio = a * np.clip(n, 0.0, None) ** b / 1000.0**b / target
    used = np.isfinite(ratio) & (a > 0) & (n > 0)
    build.flag(np.flatnonzero(used & (np.abs(ratio - 1.0) > 0.02)), f"{law} disagrees with {at}")
    build.flag(np.flatnonzero(np.isfinite(a) & ~used), f"{law} or {at} is 0: no law")
    if np.any(used):
        share = float(np.mean(np.abs(ratio[used] - 1.0) <= 0.02))
        text = f"{law}: {100 * share:.1f} % of {np.count_nonzero(used)} rows agree with {at} within 2 %"
        build.warnings.append(text + ("" if share > 0.5 else ": its unit is in doubt"))
