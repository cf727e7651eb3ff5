"""The work that is timed: one two-bladed 10x5 in 30 elements, one section table, 60 operating points.

The files in ``bench_data`` were made by `generate` and are read by `load`; `prepare` makes the rotor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError
from bemt.physics import coefficients as co

if TYPE_CHECKING:
    from bemt.physics.bem.solver import Prepared

Array = NDArray[np.float64]
DATA = Path(__file__).with_name("bench_data")
RPM = (3000.0, 5000.0, 6700.0)
"""Rotational speeds of the work [rev/min]."""
J_VALUES = np.linspace(0.0, 0.8, 20)
"""Advance ratios at each of them [-]."""
DIAMETER, PITCH = 0.254, 0.127
"""Diameter and pitch [m]."""
BLADES, HUB, RE = 2, 0.15, 1e5
"""Blades, hub radius over R, Reynolds number of the table [-]."""
PEER_EFFECTS = ("tip_loss", "hub_loss", "swirl", "high_induction")
"""Physics that the peers have too."""


@dataclass(frozen=True, eq=False)
class Work:
    """What is timed."""

    name: str  # Of the blade
    edges: Array  # (31,) element edges r/R [-]
    # (30,) element centres and chords over R [-]
    r_R: Array
    c_R: Array
    beta_deg: Array  # (30,) blade angles [deg]
    alpha_deg: Array  # (Na,) angles of attack of the table [deg]
    # (Na,) section table [-]
    cl: Array
    cd: Array
    # (60,) operating points [rev/min], [m/s]
    rpm: Array
    V: Array


def _columns(path: Path, names: tuple[str, ...]) -> list[Array]:
    """Read named columns of a CSV file; ``#`` starts a comment line."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise InputError(Fault(str(path), "", error.strerror or str(error), "a readable file")) from error
    rows = [(i, line.split(",")) for i, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    head = [c.strip() for c in rows[0][1]] if rows else []
    missing = [n for n in names if n not in head]
    if missing or len(rows) < 3:
        got = f"columns {', '.join(head) or 'none'} and {max(len(rows) - 1, 0)} rows"
        raise InputError(Fault(str(path), "1", got, f"columns {', '.join(names)} and two rows or more"))
    faults, out = [], np.empty((len(names), len(rows) - 1))
    for k, (i, cells) in enumerate(rows[1:]):
        for j, name in enumerate(names):
            column = head.index(name)
            try:
                out[j, k] = float(cells[column])
                if not math.isfinite(out[j, k]):
                    raise ValueError
            except (ValueError, IndexError):
                cell = cells[column].strip() if column < len(cells) else "nothing"
                faults.append(Fault(str(path), f"{i}:{column + 1}", f"{name} = {cell}", "a finite number"))
    if faults:
        raise InputError(faults)
    return list(out)


def load(folder: Path | str | None = None, name: str | None = None) -> Work:
    """Read the work.

    >>> work = load()
    >>> work.name, work.edges.size, work.r_R.size, work.rpm.size
    ('generic_10x5', 31, 30, 60)
    """
    root = DATA if folder is None else Path(folder)
    found = sorted(p.name.removesuffix("_edges31.csv") for p in root.glob("*_edges31.csv"))
    polars = sorted(root.glob("polar_*.csv"), key=lambda p: ("re100k" not in p.name.lower(), p.name))
    if not found or not polars or (name is not None and name not in found):
        got = f"blades {', '.join(found) or 'none'}, {len(polars)} polars"
        raise InputError(Fault(str(root), "", got, f"{name or '<name>'}_edges31.csv, _mid30.csv and a polar_*.csv"))
    name = name or found[0]
    (edges,) = _columns(root / f"{name}_edges31.csv", ("r_R",))
    r_R, c_R, beta = _columns(root / f"{name}_mid30.csv", ("r_R", "c_R", "beta_deg"))
    alpha, cl, cd = _columns(polars[0], ("alpha_deg", "cl", "cd"))
    if edges.size != r_R.size + 1 or np.any(r_R <= edges[:-1]) or np.any(r_R >= edges[1:]):
        got = f"{edges.size} edges and {r_R.size} centres"
        raise InputError(Fault(str(root / f"{name}_mid30.csv"), "r_R", got, "one centre between each pair of edges"))
    rpm = np.repeat(RPM, J_VALUES.size)
    V = np.asarray(co.airspeed(np.tile(J_VALUES, len(RPM)), rpm / 60, DIAMETER))
    return Work(name, edges, r_R, c_R, beta, alpha, cl, cd, rpm, V)


def generate(folder: Path | str) -> list[Path]:
    """Make the files of the work: stations by a documented law, table by NeuralFoil.

    beta = atan(pitch/(2 pi r)) with 5 in of pitch on 10 in, chord ``apc_like``; 30 equal elements from r/R 0.15 to 1,
    values at their centres.  The table: every degree from -180 to 180.
    """
    from bemt.physics.sections.neuralfoil import tunnel_polar
    from geometry.airfoil import naca
    from geometry.laws import chord_over_R

    root = Path(folder)
    root.mkdir(parents=True, exist_ok=True)
    edges = np.linspace(HUB, 1.0, 31)
    polar = tunnel_polar(naca("4412"), re=np.array([RE]))
    alpha = np.arange(-180.0, 181.0)
    cl, cd = (np.interp(np.radians(alpha), polar.alpha, table[:, 0, 0]) for table in (polar.cl, polar.cd))
    head = "# generated by bench_work.generate: "
    blade = head + "10x5, constant pitch, chord law apc_like, hub r/R 0.15, 30 equal elements"
    files = []

    def write(name: str, comment: str, columns: str, *data: Array) -> None:
        rows = "\n".join(",".join(f"{v:.10g}" for v in row) for row in np.column_stack(data))
        path = root / name
        part = path.with_suffix(".part")
        part.write_text(f"{comment}\n{columns}\n{rows}\n", encoding="utf-8")
        part.replace(path)
        files.append(path)

    for name, x in (("generic_10x5_edges31.csv", edges), ("generic_10x5_mid30.csv", 0.5 * (edges[1:] + edges[:-1]))):
        beta = np.degrees(np.arctan(PITCH / (np.pi * DIAMETER * x)))
        write(name, blade, "r_R,c_R,beta_deg", x, chord_over_R("apc_like", x, HUB), beta)
    write("polar_naca4412_re100k.csv", head + f"NACA 4412, Re 1e5, {polar.source}", "alpha_deg,cl,cd", alpha, cl, cd)
    return files


def prepare(work: Work, effects: tuple[str, ...] | None = PEER_EFFECTS) -> Prepared:
    """Prepare the rotor of the work."""
    from bemt.physics.bem import solver
    from bemt.physics.effects import standard
    from bemt.physics.sections.polars import ExtrapolatedTable, from_tables
    from geometry.airfoil import naca
    from geometry.rotor import Rotor, Stations, from_stations

    R = 0.5 * DIAMETER
    r, chord, beta = work.r_R * R, work.c_R * R, np.radians(work.beta_deg)
    blade = from_stations(r, chord, beta, R, float(work.edges[0]) * R, naca("4412"), name=work.name)
    table = ExtrapolatedTable(np.radians(work.alpha_deg), work.cl, work.cd, RE)
    polar = from_tables([table], name="NACA 4412", source=work.name)
    on = standard() if effects is None else tuple(e for e in standard() if e.id in effects)
    stations = Stations(r, np.diff(work.edges) * R, chord, beta)
    return solver.prepare(Rotor(blade, BLADES), [(0.75, polar)], on, stations=stations)
