"""Ducted rotors beside what was measured or computed of them: ``python reports/studies/duct_fans.py``.

Prints the tables of which docs/duct.md shows the ends and draws docs/img/duct.png. The folder of the recordings is
named by the variable ``BEMT_DATA``. Sources and faults of the recordings: tests/test_duct.py, which builds the same
fans.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.tables import json_text, plain, write_atomic
from bemt.base.units import KGF
from bemt.rotors.case import Case
from bemt.rotors.case.load import case_of, load_case
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.case.propagate import propagate
from bemt.rotors.model import RealRotor
from bemt.rotors.population import WEIGHTS, Ducted, Population, population
from bemt.rotors.predict import LEVELS, half_width, zero_thrust
from bemt.rotors.validity import Validity

Array = NDArray[np.float64]

HEAD = 'schema = "bemt.case/1"\nname = "published"\n'
HOME = Path(__file__).resolve().parents[2]

F1 = """[rotor]
kind = "fan"
blades = 3
diameter_mm = 300
hub_ratio = 0.22
[blade]
stations = "stations.csv"
[blade.section]
camber = 0.0358
thickness = 0.10
[duct]
tip_gap_mm = 0
length_mm = 130
lip_radius_mm = 18
lip_loss = 0
rotor_position_mm = 45
exit_area_ratio = 1.0
exit_hub_diameter_mm = 66
[operating]
rpm = 4898.98
[air]
density_kg_m3 = 1.225
[[polars]]
file = "polar.csv"
r_over_R = 0.75
"""
X22A = """[rotor]
kind = "fan"
blades = 3
diameter_m = 2.1336
hub_ratio = 0.2
[blade]
stations = "stations.csv"
[blade.section]
camber = 0.02
thickness = 0.08
[duct]
tip_gap_mm = 10.16
length_mm = 1244.6
lip_radius_mm = 128
rotor_position_mm = 355.6
exit_area_ratio = 1.27
[operating]
rpm = 1200
[air]
density_kg_m3 = 1.225
"""
FAN_76 = """[rotor]
kind = "propeller"
blades = 8
diameter_mm = 76
hub_ratio = 0.25
[blade]
pitch_mm = {pitch}
chord_law = "fan"
max_chord_over_R = 0.35
[blade.section]
camber = 0.05
thickness = 0.09
{duct}[operating]
rpm = 20000
[air]
density_kg_m3 = 1.2
"""
DUCT_76 = """[duct]
tip_gap_mm = 0.5
length_mm = 25
lip_radius_mm = 4
exit_area_ratio = 1.0
"""


@dataclass(frozen=True)
class Known:
    """What is known of a ducted rotor over the advance ratio; the duct's share is NaN where nobody measured it."""

    name: str
    case: Case
    J: Array
    CT: Array
    CQ: Array
    share: Array

    def airspeed(self, J: Array) -> Array:
        """Airspeed at advance ratios [m/s]."""
        return J * self.case.rpm / 60.0 * self.case.diameter_m


def rows(path: Path) -> list[dict[str, Any]]:
    """Rows of a table."""
    with path.open(encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def made(folder: Path, body: str, **files: str) -> Case:
    """Case of a text and the tables that it names, by their name without ending."""
    folder.mkdir(exist_ok=True, parents=True)
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
    return case_of(HEAD + body, folder)


def stations(table: list[tuple[float, float, float]]) -> str:
    """Text of a table of r/R, chord/R and angle [deg]."""
    return "r_over_R,chord_over_R,beta_deg\n" + "".join(f"{x:.5f},{c:.6f},{b:.4f}\n" for x, c, b in table)


def f1(data: Path, folder: Path) -> Known:
    """F1 as DFDC has it: no gap, no lip loss."""
    tables = {name: (data / "dfdc" / f"F1_{name}.csv").read_text() for name in ("stations", "polar")}
    found = [r for r in rows(data / "dfdc" / "reference.csv")
             if (r["geometry"], float(r["tip_gap_mm"]), float(r["exit_ratio"])) == ("F1", 0.0, 1.0)]  # fmt: skip
    J, CT, duct, CQ = (np.array([float(r[k]) for r in found]) for k in ("J", "CT_momentum", "CT_duct", "CQ"))
    return Known("F1, DFDC", made(folder, F1, **tables), J, CT, CQ, duct / CT)


FANS = {"F1": "002", "F2": "012", "F3": "011"}
"""Folders of ``concealed_2`` with blade and duct of the fans that DFDC computed; the gaps closed: tables ``F?:g0``."""


@dataclass(frozen=True)
class Alike:
    """A fan of DFDC without gap beside ours without losses, over the advance ratio."""

    known: Known  # with our case: no gap, no friction, no loss of the lip
    flow: Array  # DFDC's mass flow [kg/s]
    ours: Array  # that of our duct at DFDC's thrust of the rotor [kg/s]
    share: Array  # our duct's share at that thrust [1]


def alike(data: Path, name: str) -> Alike:
    """F1, F2 or F3 under the conditions of DFDC.

    The duct alone, at the pressure that DFDC's rotor makes, so that neither sections nor blades count. DFDC's mass flow
    is T / (Vj - V), as its folder says of the momentum.
    """
    folder = data / "concealed_2" / FANS[name]
    case = case_of((folder / "case.toml").read_text(), folder).replaced(
        {f"duct.{key}": 0.0 for key in ("tip_gap_mm", "lip_loss", "wall_friction")}
    )
    table = np.array(json.loads((folder.parent / "tables3.json").read_text())[f"{name}:g0"])
    rpm, J, CT, duct, CQ = table[:, :5].T
    case = case.replaced({"operating.rpm": float(rpm[0])})
    known = Known(f"{name}, DFDC", case, J, CT, CQ, duct / CT)
    V, rho, flow = known.airspeed(J), case.air().rho, prepare_case(case).duct
    assert flow is not None
    unit = rho * (rpm / 60.0) ** 2 * case.diameter_m**4
    jet = np.sqrt(V**2 + 2.0 * (CT - duct) * unit / (rho * flow.area))
    low, high = np.zeros_like(V), 5.0 * jet
    for _ in range(60):  # speed through the disk at which our jet has that of DFDC
        middle = 0.5 * (low + high)
        below = flow.jet_speed(middle, V) < jet
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    ours = rho * flow.area * low
    return Alike(known, CT * unit / (jet - V), ours, 1.0 - (CT - duct) * unit / (ours * (jet - V)))


DS30_OFF = {"duct.stator.recovery": 0.0}
DS30 = (  # what, what BEMT leaves out: overrides of the case
    ("vanes, gap 0.4 mm, Mach, body ends, losses (the case)", {}),
    ("body through the exit", {"duct.exit_hub_diameter_mm": 25.4}),
    ("no vanes", DS30_OFF),
    ("no vanes, no gap", DS30_OFF | {"duct.tip_gap_mm": 0.0}),
    ("no vanes, no gap, no Mach number (as our CFD)",
     DS30_OFF | {"duct.tip_gap_mm": 0.0, "model.effects_off": ("compressibility", "drag_divergence")}),
    ("no vanes, no gap, no losses of lip and wall (as DFDC)",
     DS30_OFF | {"duct.tip_gap_mm": 0.0, "duct.lip_loss": 0.0, "duct.wall_friction": 0.0}),
    ("vanes, no gap, no losses of lip and wall (as DFDC)",
     {"duct.stator.recovery": 1.0, "duct.tip_gap_mm": 0.0, "duct.lip_loss": 0.0, "duct.wall_friction": 0.0}),
)  # fmt: skip


def ds30(data: Path) -> list[str]:
    """Rows of a Markdown table: who computed the DS-30 with what, thrust, torque and the duct's share."""
    case = load_case(HOME / "cases" / "ds30")
    out = ["| thesis | Fluent; vanes, gap, body and speed not stated | 23.5 | - | - |"]
    for name, words in (("ds30_spinner", "no vanes"), ("ds30_vanes", "vanes")):
        found = [r for r in rows(HOME / "reports" / "cfd" / name / "recording.csv") if r["converged"] == "1"]
        for gap, told in ((False, "gap closed"), (True, "gap 0.4 mm")):
            some = [r for r in found if (float(r["tip_gap_mm"]) > 0.1) == gap]
            T, Q, rotor = (np.array([float(r[k]) for r in some]) for k in ("thrust_N", "torque_Nm", "thrust_rotor_N"))
            if some:
                grids = f"{len(some)} grid{'s' if len(some) > 1 else ''}"
                text = f"| own CFD | {words}, {told}, no Mach number, body ends; {grids} |"
                out.append(f"{text} {_ends(T)} | {_ends(Q, 3)} | {_ends(100.0 * (1.0 - rotor / T), 0)} |")
    unit = case.air().rho * (case.rpm / 60.0) ** 2 * case.diameter_m**4
    for r in rows(data / "dfdc" / "reference.csv"):
        if r["geometry"] == "DS30" and r["exit_ratio"] == "0.925" and float(r["tip_gap_mm"]) in (0.0, 0.4):
            T, duct, Q = float(r["CT_momentum"]), float(r["CT_duct"]), float(r["CQ"]) * unit * case.diameter_m
            gap = "gap 0.4 mm" if float(r["tip_gap_mm"]) else "no gap"
            vanes = "no vanes" if r["stator"] == "none" else "vanes"
            text = f"| DFDC | {vanes}, {gap}, Mach, body ends, no losses; {r['section_lift']} |"
            out.append(f"{text} {T * unit:.1f} | {Q:.3f} | {100 * duct / T:.0f} |")
    for words, changes in DS30:
        p = prepare_case(case.replaced(changes)).solve(case.rpm, 0.0, case.air())
        out.append(f"| BEMT | {words} | {p.thrust_N[0]:.1f} | {p.torque_Nm[0]:.3f} | {100 * p.duct_share[0]:.0f} |")
    return out


def _ends(v: Array, digits: int = 1) -> str:
    """Range of some values."""
    ends = [f"{x:.{digits}f}" for x in (v.min(), v.max())]
    return " to ".join(dict.fromkeys(ends))


def x22a(data: Path, folder: Path, angle: int) -> Known:
    """X-22A at 19 or 29 deg."""
    shape = [(float(r["r_over_R"]), float(r["chord_m"]) / 1.0668, float(r["beta_geom_deg(beta75=20)"]))
             for r in rows(data / "x22a" / "x22a_geometry.csv")]  # fmt: skip
    table = stations([(x, c, b + angle - 20.0) for x, c, b in shape if x <= 1.0])
    found = rows(data / "x22a" / "x22a_measured_CT_CP_vs_J.csv")
    q = np.array([[float(v) for v in list(r.values())[:4]] for r in found])
    q = q[q[:, 0] == angle]
    case = made(folder, X22A, stations=table)
    return Known(f"X-22A, {angle} deg", case, q[:, 1], q[:, 2], q[:, 3] / (2.0 * math.pi), np.full(len(q), math.nan))


def nozzle_19a(data: Path, folder: Path, pitch: float, series: str = "4-70") -> Known:
    """Ka 4-70 or 5-75 of a pitch over diameter in nozzle 19A, in air; the outer wall as in tests/test_duct.py.

    The series have one outline: chords are those of the 4-55 by area ratio over blades.
    """
    D, L = 0.24, 0.12
    blades, area = (float(v) for v in series.split("-"))
    g = [[float(v) for v in r.values()] for r in rows(data / "ducted_marine" / "ka4-55_geometry.csv")]
    blade, thick = [], []
    for x, chord_mm, t_over_D, _ in g:
        chord = chord_mm / 1e3 * (area / blades) / (55.0 / 4.0)
        blade.append((x, chord / (0.5 * D), math.degrees(math.atan2(pitch, math.pi * x))))
        thick.append(t_over_D * D / chord)
    bore = 0.5e3 * D + 0.8
    body = f"""[rotor]
kind = "fan"
blades = {blades:g}
diameter_mm = {1e3 * D}
hub_ratio = 0.167
[blade]
stations = "stations.csv"
[blade.section]
r_over_R = {[r[0] for r in g]}
camber = {[round(t / 2.0, 4) for t in thick]}
camber_position = 0.5
thickness = {[round(max(t, 0.02), 4) for t in thick]}
[duct]
tip_gap_mm = 0.8
length_mm = {1e3 * L}
lip_radius_mm = {182.5 * L}
lip_length_mm = {400.0 * L}
outer_diameter_mm = {2.0 * (bore + 210.7 * L)}
trailing_edge_mm = {40.0 * L}
exit_diameter_mm = {2.0 * (bore + 23.6 * L)}
rotor_position_mm = {500.0 * L}
[operating]
rpm = 9000
[air]
density_kg_m3 = 1.225
"""
    found = [r for r in rows(data / "ducted_marine" / "ka_19A_open_water_table.csv")
             if r["series"] == f"Ka{series}_19A" and float(r["P_over_D"]) == pitch]  # fmt: skip
    J, K, N, Q = (np.array([float(r[k]) for r in found]) for k in ("J", "KT_total", "KT_nozzle", "10KQ"))
    case = made(folder, body, stations=stations(blade))
    return Known(f"Ka {series} in 19A, P/D {pitch:g}", case, J, K, Q / 10.0, N / K)


PITCHES = 0.6, 0.8, 1.0, 1.2, 1.4
LIGHT = 0.15
"""Share of the static thrust above which errors count [1]."""


def x22a_slow(data: Path, folder: Path) -> Known:
    """X-22A at 19 deg from rest to J 0.2; power between the readings."""
    known, found = x22a(data, folder, 19), rows(data / "x22a" / "x22a_beta19_full_J_range.csv")
    T, P = (np.array([[float(r["J"]), float(r["value"])] for r in found if r["quantity"] == name]).T
            for name in ("CT_total", "CP"))  # fmt: skip
    J = T[0][T[0] < 0.25]
    CQ = np.interp(J, *P) / (2.0 * math.pi)
    return Known("X-22A, 19 deg, slow", known.case, J, T[1][: J.size], CQ, np.full(J.size, math.nan))


def stated(data: Path, folder: Path) -> dict[str, list[Known]]:
    """Ducted rotors whose case is stated, by family: what they have in common counts once.

    Beside DFDC what it does not have is left out of ours. The exit of the X-22A was chosen with its points from J 0.3
    on in view.
    """
    return {
        "nozzle 19A": [nozzle_19a(data, folder / f"{s}_{p}", p, s) for s in ("4-70", "5-75") for p in PITCHES],
        "X-22A": [*(x22a(data, folder / str(angle), angle) for angle in (19, 29)), x22a_slow(data, folder / "19")],
        **{f"{name}, DFDC": [alike(data, name).known] for name in FANS},
    }


@dataclass(frozen=True)
class Level:
    """How far a rotor is from ours above `LIGHT`, over what open rotors let expect of the rest."""

    known: Known
    error: Array  # (2, P) of CT and CP [1]
    over: Array  # (2, P) the same over the rest's standard deviation of open rotors [1]
    x: Array  # (P,) Advance ratio over that of zero thrust [1]
    Re: Array  # (P,)
    M_tip: Array  # (P,)

    @property
    def size(self) -> tuple[float, int, float]:
        """Diameter [m], blades, pitch over diameter."""
        case = self.known.case
        return case.diameter_m, int(case.file.rotor.blades), case.rotor().blade.pitch_m() / case.diameter_m

    def inside(self, people: Population, level: float) -> Array:
        """Share of the points within the rest of a population of ducted rotors, (2,)."""
        known = people.validity
        assert known is not None
        sd = known.at(*self.size, self.x, self.Re, self.M_tip)[0] * people.rest_CT / population().rest_CT
        held = np.abs(self.over) < half_width(level, sd[:, None] * people.rest_sizes, WEIGHTS)
        return np.asarray(held.mean(axis=1))


def level(known: Known) -> Level:
    """Errors of a rotor, and where it is."""
    case = known.case
    model, told = prepare_case(case), case.as_built()
    p = model.solve(case.rpm, known.airspeed(known.J), case.air())
    rotor = RealRotor.of(model, case.air(), told.prior, told.drawn)
    off = np.array([p.CT - known.CT, p.CP - 2.0 * math.pi * known.CQ])
    over = off / population().rest_sd(rotor.at(p.rpm, p.J, p.Re75))
    some = known.CT > LIGHT * known.CT[0]
    x = p.J / zero_thrust(rotor.solve, told.drawn, case.rpm)
    error = off / np.array([known.CT, 2.0 * math.pi * known.CQ])
    return Level(known, error[:, some], over[:, some], x[some], p.Re75[some], p.M_tip[some])


def rms(v: Array, axis: int | None = None) -> Array:
    """Root mean square."""
    return np.asarray(np.sqrt(np.mean(np.square(v), axis=axis)))


def ducted(levels: dict[str, list[Level]]) -> Ducted:
    """What families of ducted rotors say of the rest: each counts once, thrust and torque alike."""
    size = rms(np.array([rms(np.array([rms(one.over) for one in family])) for family in levels.values()]))
    at = [Validity.of_rotor(*one.size, one.x, one.Re, one.M_tip) for family in levels.values() for one in family]
    about = {"families": list(levels), "command": "reports/studies/duct_fans.py --fit FILE"}
    return Ducted(float(size), len(levels), Validity.of_rotors(at), about)


def left_out(levels: dict[str, list[Level]]) -> list[str]:
    """Rows of a Markdown table: errors of each rotor, and whether the rest from the other families holds them."""
    out, held = [], []
    for name, family in levels.items():
        others = ducted({k: v for k, v in levels.items() if k != name})
        people = replace(population(), ducted=others).in_duct()
        found = np.array([[one.inside(people, k) for k in LEVELS] for one in family])  # rotor, level, load
        held.append(found.mean(axis=0))
        for one, shares in zip(family, found, strict=True):
            T, Q = 100.0 * rms(one.error, axis=1)
            zT, zQ = rms(one.over, axis=1)
            cells = " | ".join(f"{100 * v:.0f}" for v in shares.T.ravel())
            out.append(f"| {one.known.name} | {T:.1f}, {Q:.1f} | {zT:.2f}, {zQ:.2f} | {others.size:.2f} | {cells} |")
    cells = " | ".join(f"{100 * v:.0f}" for v in np.mean(held, axis=0).T.ravel())
    return [*out, f"| all families alike | | | {ducted(levels).size:.2f} | {cells} |"]


def fan_76(data: Path, folder: Path, pitch_mm: float, duct: bool) -> tuple[Case, Array]:
    """Fan of 76 mm with a guessed blade, and rows of rev/min, thrust [N] and torque [N m]."""
    pattern = "grp01__f1507_hqprop76x8_4s_duct_table*.csv" if duct else "grp01__f1507_hqprop76x8_4s_table*.csv"
    found = [[float(r["rpm"]), float(r["th"]) * KGF * 1e-3, float(r["tq"]) * KGF * 1e-5]
             for path in sorted((data / "jmajew").glob(pattern)) for r in rows(path)]  # fmt: skip
    return made(folder, FAN_76.format(pitch=pitch_mm, duct=DUCT_76 if duct else "")), np.array(found)


def over_measured(case: Case, measured: Array) -> Array:
    """Thrust and torque over the measured ones at rest, (2, N)."""
    p = prepare_case(case).solve(measured[:, 0], np.zeros(len(measured)), case.air())
    return np.array([p.thrust_N, p.torque_Nm]) / measured[:, 1:].T


def pitch_of_torque(data: Path, folder: Path) -> float:
    """Pitch of the 76 mm fan at which the torque of the open runs is right in the median [mm]."""
    low, high = 50.0, 110.0
    while high - low > 0.05:
        middle = 0.5 * (low + high)
        off = np.median(over_measured(*fan_76(data, folder, middle, False))[1]) - 1.0
        low, high = (low, middle) if off > 0.0 else (middle, high)
    return 0.5 * (low + high)


def table_of(known: Known, case: Case | None = None) -> list[str]:
    """Rows of a Markdown table: J; thrust, torque and share, ours and the reference."""
    case = known.case if case is None else case
    p = prepare_case(case).solve(case.rpm, known.airspeed(known.J), case.air())
    out = []
    for i, J in enumerate(known.J):
        share = f"{100 * known.share[i]:.1f}" if math.isfinite(known.share[i]) else "-"
        off = (100.0 * (p.CT[i] / known.CT[i] - 1.0), 100.0 * (p.CP[i] / (2.0 * math.pi) / known.CQ[i] - 1.0))
        thrust = f"{p.CT[i]:.4f} / {known.CT[i]:.4f} | {off[0]:+.1f}"
        out.append(f"| {known.name} | {J:.2f} | {thrust} | {off[1]:+.1f} | {100 * p.duct_share[i]:.1f} / {share} |")
    return out


def draw(panels: list[list[Known]], to: Path) -> None:
    """CT and the duct's share over J, with the band of one standard deviation."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(2, len(panels), figsize=(12.5, 6.6), layout="constrained", sharex="col")
    for column, fans in zip(axes.T, panels, strict=True):
        for k, known in enumerate(fans):
            J = np.linspace(0.0, known.J[known.CT > 0.12 * known.CT[0]].max(), 25)
            found = propagate(known.case, known.case.rpm, known.airspeed(J)).points
            seen = known.J <= J.max() + 1e-9
            shown = ("CT", 1.0, known.CT), ("duct_share", 100.0, known.share)
            for ax, (key, scale, reference) in zip(column, shown, strict=True):
                y, u = scale * found[key], scale * found.u[key]
                ax.plot(J, y, color=f"C{k}", label=f"BEMT: {known.name}")
                ax.fill_between(J, y - u, y + u, color=f"C{k}", alpha=0.2, lw=0)
                ax.plot(known.J[seen], scale * reference[seen], "o", color=f"C{k}", mec="k", ms=5)
        column[0].legend(fontsize=8)
        column[0].set(ylabel="thrust coefficient CT", ylim=(0, None))
        column[1].set(xlabel="advance ratio J", ylabel="share of the duct [%]", ylim=(-25, 65))
        column[1].axhline(0.0, color="0.6", lw=0.8)
    sources = "DFDC, a panel code", "NASA TN D-4142, measured", "Oosterveld 1970, measured"
    for ax, source in zip(axes[0], sources, strict=True):
        ax.set_title(f"points: {source}", fontsize=10)
    fig.savefig(to, dpi=110)


def main() -> None:
    """Print the tables and draw the picture, or write the population with what ducted rotors say of its rest."""
    parser = argparse.ArgumentParser(description="Ducted rotors beside what is known of them.")
    parser.add_argument("--fit", metavar="FILE", help="write the population with the rest of ducted rotors, no more")
    to = parser.parse_args().fit
    data = Path(os.environ["BEMT_DATA"])
    with tempfile.TemporaryDirectory() as scratch:
        at = Path(scratch)
        levels = {name: [level(one) for one in family] for name, family in stated(data, at).items()}
        if to:
            found = replace(population(), ducted=ducted(levels))
            write_atomic(Path(to), json_text(plain(found.document(), 6)))
            return
        print("| rotor | error of thrust, torque, % rms | over the rest of open rotors | size of the others | "
              "thrust inside 68, 95 % | | torque inside | |\n|---|---|---|---|---|---|---|---|")  # fmt: skip
        print("\n".join(left_out(levels)), "\n")
        first = f1(data, at / "f1")
        x = [x22a(data, at / str(angle), angle) for angle in (19, 29)]
        ka = [nozzle_19a(data, at / f"ka{pitch}", pitch) for pitch in PITCHES]
        print("| fan | J | mass flow, kg/s: ours / DFDC | % | share of the duct, %: ours / DFDC | points |")
        print("|---|---|---|---|---|---|")
        for name in FANS:
            a = alike(data, name)
            for i, J in enumerate(a.known.J):
                flow = f"{a.ours[i]:.4f} / {a.flow[i]:.4f} | {100 * (a.ours[i] / a.flow[i] - 1):+.1f}"
                own, other = 100 * a.share[i], 100 * a.known.share[i]
                print(f"| {name} | {J:.2f} | {flow} | {own:.1f} / {other:.1f} | {own - other:+.1f} |")
        print("\n| who | with what | thrust, N | torque, N m | share of the duct, % |")
        print("\n".join(["|---|---|---|---|---|", *ds30(data)]), "\n")
        print("| rotor | J | CT: ours / known | % | CQ, % | share of the duct, %: ours / known |")
        print("|---|---|---|---|---|---|")
        smooth = replace(first, name="F1, no friction", case=first.case.replaced({"duct.wall_friction": 0.0}))
        print("\n".join(line for known in (first, smooth, *x, ka[1], ka[3]) for line in table_of(known)))
        print("\n19A, medians: pitch, |KT|, share in points, |KQ|")
        for known in ka:
            p = prepare_case(known.case).solve(known.case.rpm, known.airspeed(known.J), known.case.air())
            some = known.CT > 0.15 * known.CT[0]
            off = (p.CT / known.CT - 1.0, p.duct_share - known.share, p.CP / (2.0 * math.pi) / known.CQ - 1.0)
            print(known.name, *(f"{100 * np.median(np.abs(v[some])):.1f}" for v in off))
        pitch = pitch_of_torque(data, at / "76")
        for value in (70.0, pitch):
            for duct in (False, True):
                off = over_measured(*fan_76(data, at / "76", value, duct)) - 1.0
                parts = (f"{np.median(v):+.1f} ({v.min():+.1f} to {v.max():+.1f})" for v in 100.0 * off)
                print(f"76 mm, pitch {value:.1f} mm, {'ducted' if duct else 'open'}: T, Q {'; '.join(parts)} %")
        draw([[first], x, [ka[1], ka[3]]], HOME / "docs" / "img" / "duct.png")


if __name__ == "__main__":
    main()
