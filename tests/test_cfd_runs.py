"""The promise of a CFD run: whatever program wrote its files, they become one recording that every command takes."""
# ruff: noqa: E501 - samples as they look in files

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.commands.cli import main
from bemt.readers.cfd_run import RunToml, toml_text
from bemt.recordings.cfd_run import assemble
from bemt.recordings.cfd_setup import GRID_FLOOR, conditions_that_differ, grid_floor

T, Q, RPM = 12.5, 0.31, 8000.0
"""Thrust [N], torque [N m] and speed of every run made here."""
PERIOD = 60.0 / RPM


def times(turns: float = 8.0, per_turn: int = 60) -> np.ndarray:
    return PERIOD / per_turn * np.arange(1, int(turns * per_turn) + 1)


def course(t: np.ndarray, mean: float) -> np.ndarray:
    """A start-up that dies out, and a ripple of the blade passage."""
    return mean * (1.0 + 0.04 * np.sin(4 * math.pi * t / PERIOD) + 3.0 * np.exp(-t / (0.12 * PERIOD)))


def rfile(name: str, values: np.ndarray, t: np.ndarray | None) -> str:
    clock = "Time Step" if t is not None else "Iteration"
    names = f'"{clock}" "{name}"' + (' "flow-time"' if t is not None else "")
    rows = [f"{k} {v:.7g}" + (f" {t[k - 1]:.7g}" if t is not None else "") for k, v in enumerate(values, 1)]
    return f'"{name}-rfile"\n"{clock}" "{name} etc.."\n({names})\n' + "\n".join(rows) + "\n"


def fluent(put: Callable[..., Path], zones: bool = False) -> list[str]:
    t = times()
    put("thrust.out", rfile("thrust", course(t, -T), t))
    put("torque.out", rfile("torque", course(t, Q), t))
    return ["thrust.out", "torque.out"]


def steady(mean: float, n: int = 500) -> np.ndarray:
    k = np.arange(1, n + 1)
    return mean * (1.0 - np.exp(-k / 20.0))


def foam(put: Callable[..., Path]) -> list[str]:
    for file, axis in (("force", T), ("moment", -Q)):
        names = " ".join(f"{p}_{a}" for p in ("total", "pressure", "viscous") for a in "xyz")
        rows = "".join(
            f"{k}\t0.01 -0.01 {v:.8e}\t0.01 -0.01 {0.9 * v:.8e}\t0 0 {0.1 * v:.8e}\n" for k, v in enumerate(steady(axis), 1)
        )
        put(f"postProcessing/forces/0/{file}.dat", f"# {file.title()}\n# CofR : (0 0 0)\n#\n# Time \t{names}\n{rows}")
    put("postProcessing/outlet/0/surfaceFieldValue.dat",
        "# Region type : patch outlet\n# Faces : 432\n# Area : 1.0e-02\n# Time\tareaAverage(p)\n" + "".join(f"{k}\t5.0\n" for k in range(1, 501)))  # fmt: skip
    return ["."]


def star(put: Callable[..., Path], timed: bool = False) -> list[str]:
    t = times()
    for name, unit, what, mean in (("Thrust 1", "N", "Thrust", T), ("Torque 1", "N-m", "Moment", Q)):
        head = '"Physical Time: Physical Time (s)"' if timed else '"Iteration"'
        clock, v = (t, course(t, mean)) if timed else (np.arange(1.0, 501), steady(mean))
        rows = "".join(f"{c:.8g},{x:.8g}\n" for c, x in zip(clock, v, strict=True))
        put(f"{name.split()[0].lower()}.csv", f'{head},"{name} Monitor: {what} ({unit})"\n{rows}')
    return ["thrust.csv", "torque.csv"]


AREA, LENGTH, SPEED, RHO = 0.03, 0.1, 80.0, 1.225
FORCE = 0.5 * RHO * SPEED**2 * AREA


def su2(put: Callable[..., Path]) -> list[str]:
    head = '"Time_Iter","Outer_Iter","Inner_Iter",     "rms[Rho]"     ,   "RefForce"   ,   "CFx"   ,   "CFy"   ,   "CFz"   ,   "CMx"   ,   "CMy"   ,   "CMz"   \n'
    rows = zip(steady(T / FORCE), steady(Q / FORCE / LENGTH), strict=True)
    put("history.csv", head + "".join(f"0, 0, {k}, -5.0, {FORCE:.9g}, 0, 0, {f:.9g}, 0, 0, {m:.9g}\n" for k, (f, m) in enumerate(rows)))
    return ["history.csv"]


def flow360(put: Callable[..., Path]) -> list[str]:
    rows = zip(steady(T / FORCE), steady(Q / FORCE / LENGTH), strict=True)
    text = "physical_step, pseudo_step, CL, CD, CFx, CFy, CFz, CMx, CMy, CMz, HeatTransfer\n"
    put("total_forces_v2.csv", text + "".join(f"0, {10 * k}, 0, 0, 0, 0, {f:.9g}, 0, 0, {m:.9g}, 0,\n".replace(", 0,\n", ", 0\n") for k, (f, m) in enumerate(rows)))
    return ["total_forces_v2.csv"]


def post(put: Callable[..., Path]) -> list[str]:
    rows = "".join(f"{n}, {T * (n / RPM) ** 2:.7g}, {Q * (n / RPM) ** 2:.7g}\n" for n in (4000, 6000, 8000))
    put("chart.csv", f"[Name]\nTable 1\n\n[Data]\nrpm [ rev min^-1 ], Thrust [ N ], Torque [ J ]\n{rows}")
    return ["chart.csv"]


def workbench(put: Callable[..., Path]) -> list[str]:
    head = "# 5/22/2017 3:33:44 PM\n# The parameters defined in the project are:\n# ,P1 - rpm [rev min^-1],P2 - thrust-op [N],P3 - torque-op [N m]\n#\n# The following header line defines the name of the columns by reference to the parameters.\nName,P1,P2,P3\n"
    rows = "".join(f"DP {k},{n},{-T * (n / RPM) ** 2:.7g},{Q * (n / RPM) ** 2:.7g}\n" for k, n in enumerate((4000, 6000, 8000)))
    put("points.csv", head + rows + "DP 3,10000,,\n")
    return ["points.csv"]


def force_report(put: Callable[..., Path]) -> list[str]:
    text = '                  "Force Report"\n'
    for title, unit, total in (("Forces - Direction Vector (0 0 1)", "Forces [N]", T), ("Moments - Moment Center (0 0 0) Moment Axis (0 0 1)", "Moments [N m]", Q)):
        zones = {"blade": 0.7 * total, "hub": 0.1 * total, "duct": 0.2 * total}
        rows = [f"{z}    {0.9 * v:.8g}   {0.1 * v:.8g}   {v:.8g}" for z, v in [*zones.items(), ("Net", total)]]
        rule = "------ ------ ------ ------"
        text += f"\n{title}\n          {unit}\nZone      Pressure   Viscous   Total\n" + "\n".join([*rows[:3], rule, rows[3]]) + "\n"
    put("report.txt", text)
    return ["report.txt"]


REFERENCE = f"area={AREA},length={LENGTH},speed={SPEED},density={RHO}"
RUNS: dict[str, tuple[Callable[..., list[str]], list[str]]] = {
    "Fluent, transient": (fluent, ["--rpm", "8000", "--unit", "thrust=N", "--unit", "torque=N m"]),
    "Fluent force report": (force_report, ["--rpm", "8000", "--zones", "blade", "hub", "duct"]),
    "CFD-Post": (post, []),
    "Workbench": (workbench, []),
    "STAR-CCM+ by iteration": (star, ["--rpm", "8000"]),
    "STAR-CCM+ by time": (lambda put: star(put, timed=True), ["--rpm", "8000"]),
    "OpenFOAM": (foam, ["--rpm", "8000"]),
    "SU2": (su2, ["--rpm", "8000", "--reference", f"length={LENGTH}"]),
    "Flow360": (flow360, ["--rpm", "8000", "--reference", REFERENCE]),
}
"""Program: how its files are made, options of its import."""


@pytest.fixture
def put(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    monkeypatch.chdir(tmp_path)

    def write(name: str, text: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    return write


def run_of(document: dict[str, Any], name: str = "run.toml") -> Any:
    return assemble(RunToml.model_validate(document), Path(), name)
