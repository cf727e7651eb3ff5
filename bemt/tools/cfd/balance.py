r"""Balance of a CFD run: what goes in has to come out, else its loads are not those of the flow it was asked for.

The control volume is the whole grid. In a rotating zone the solver moves absolute velocities U with the flux phi
relative to the zone; its source Omega x U just makes up for the arms that turn. In a steady flow, with dm = rho phi,

    mass               sum dm                                     = 0
    axial momentum     sum U_z dm + F_z                           = 0
    angular momentum   sum (x U_y - y U_x) dm + M_z               = 0

over all patches, F and M being pressure and shear of the air ON the patch (Reynolds transport theorem: F.M. White,
Fluid Mechanics, ch. 3, not checked; absolute velocities in a rotating frame: derived here). Periodic sides must cancel
out by themselves, so they are left out of the first two sums, and what they make shows there. With the sides, the sums
of a settled run close to 1e-5 in mass and 1e-3 of the thrust (measured). So a residual above 1 % is a fault of the case
or of the iteration, not of a coarse grid.

Angular momentum is another matter. The scheme conserves momentum, not its moment, and cells of half a radius do not
hold the swirl that reaches an outlet 10 R behind: 1.19 (level 4) and 0.66 (level 5) of the shaft torque left one
propeller's grid in runs that were tight in mass and momentum. So `angular_momentum` is what the periodic sides make:
flux, pressure and shear, exact on any grid. `swirl` (what leaves at the open ends over the shaft torque) is recorded
beside it and judges nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, refuse
from bemt.tools.cfd.openfoam import Settings
from bemt.tools.cfd.openfoam.run import OPEN, SIDES, through

BALANCE_LIMIT = 0.01
"""Residual, relative, above which a run counts as not converged."""
LEAST_CT, LEAST_CQ = 0.01, 0.001
"""Coefficients below which loads are no measure of themselves: a rotor near zero thrust."""
BANDS_PER_R = 10
"""Bands along the shaft in which the sides are compared, per tip radius."""


@dataclass(frozen=True)
class Balance:
    """Residuals of a run, relative and signed.

    Positive is made in the domain: mass, momentum along the axis, angular momentum in the sense of rotation.
    """

    # Net outflow of the open ends over the mass flow of an actuator disk with the run's thrust, rho A (V/2 + sqrt(V^2/4
    # + |T| / (2 rho A))) (W.F. Durand ed., H. Glauert, Aerodynamic Theory IV, div. L, 1935, not checked) [1]
    mass: float
    momentum: float  # Axial momentum of the open ends and force on all walls over the thrust (at least CT = 0.01) [1]
    # What the periodic sides make over the shaft torque (at least CQ = 0.001); NaN without such sides [1]
    angular_momentum: float
    swirl: float  # Angular momentum that leaves through the open ends over the shaft torque [1]
    leaks: tuple[str, ...] = ()  # Where each residual beyond :data:`BALANCE_LIMIT` is made


@dataclass(frozen=True)
class _Patch:
    """Mass [kg/s], axial and angular momentum [N, N m] that leave through a patch, and the first along the shaft."""

    mass: float
    axial: float
    angular: float
    z: Array
    dm: Array


def _table(path: Path, width: int, faults: list[Fault]) -> Array:
    """Rows of numbers of a file, vectors in parentheses or not; a fault when it is absent, empty or cut short."""
    nothing = np.zeros((0, width))
    if not path.is_file():
        faults.append(Fault(path.as_posix(), "", "no such file", "a balance of every patch", "Run the solver again"))
        return nothing
    rows = []
    for number, line in enumerate(path.read_text(encoding="ascii", errors="replace").splitlines(), 1):
        words = line.replace("(", " ").replace(")", " ").split()
        if not words or words[0].startswith("#"):
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) < width or not all(map(math.isfinite, row)):
            faults.append(Fault(path.as_posix(), str(number), repr(line[:60]), f"{width} numbers"))
            return nothing
        rows.append(row[:width])
    if not rows:
        faults.append(Fault(path.as_posix(), "", "no rows", "one per iteration that was written"))
    return np.array(rows) if rows else nothing


def _patch(folder: Path, name: str, times: Array, rho: float, faults: list[Fault]) -> _Patch:
    """Means over the iterations that were written of what leaves through a patch."""
    sums, dm, z = [], np.zeros(0), np.zeros(0)
    for time in times:
        at = f"surface/{time:g}"
        flux = _table(folder / f"mass_{name}" / at / f"phi_patch_{name}.raw", 4, faults)
        U = _table(folder / f"momentum_{name}" / at / f"U_patch_{name}.raw", 6, faults)
        if flux.size and U.size and len(flux) != len(U):
            where = (folder / f"momentum_{name}" / at).as_posix()
            faults.append(Fault(where, "", f"{len(U)} faces", f"the {len(flux)} of the flux"))
        if faults:
            return _Patch(math.nan, math.nan, math.nan, z, dm)
        dm, z = rho * flux[:, 3], flux[:, 2]
        swirl = U[:, 0] * U[:, 4] - U[:, 1] * U[:, 3]
        sums.append([dm.sum(), (dm * U[:, 5]).sum(), (dm * swirl).sum()])
    mass, axial, angular = np.mean(sums, axis=0)
    return _Patch(float(mass), float(axial), float(angular), z, dm)


def _load(folder: Path, name: str, times: Array, faults: list[Fault]) -> tuple[float, float]:
    """Axial force [N] and its moment [N m] of the air on the patches of a function object, means over iterations."""
    found = []
    for file in ("force.dat", "moment.dat"):
        path = folder / name / "0" / file
        before = len(faults)
        table = _table(path, 4, faults)
        chosen = table[np.isin(table[:, 0], times)]
        if len(faults) == before and len(chosen) < len(times):
            got = f"{len(chosen)} of {len(times)} iterations"
            faults.append(Fault(path.as_posix(), "", got, "those of the balance", "Run the solver again"))
        found.append(float(chosen[:, 3].mean()) if len(chosen) else math.nan)
    return found[0], found[1]


def balance_of(run: Path, settings: Settings) -> Balance:
    """Balance a run by what its function objects wrote during the averaged iterations.

    See the head of this module for the equations and what each residual is relative to. Loads are means over the same
    iterations as the fluxes.
    """
    folder, s, faults = run / "postProcessing", settings, list[Fault]()
    rho = 1.0 if s.compressible else s.rho
    written = folder / "mass_inlet" / "0" / "surfaceFieldValue.dat"
    times = _table(written, 2, faults)[:, 0]
    refuse(faults)
    patches = {}
    for name in through(s):
        mine: list[Fault] = []
        patches[name] = _patch(folder, name, times, rho, mine)
        faults += mine
    on_rotor = _load(folder, "forces", times, faults)
    others = ["standing"] if any(wall != "plate" for wall in s.walls) else []
    others += ["plate"] if s.plate_z is not None else []
    on_walls = [on_rotor, *(_load(folder, name, times, faults) for name in others)]
    on_open = _load(folder, "open", times, faults)
    on_sides = _load(folder, "sides", times, faults) if s.sectors > 1 else (0.0, 0.0)
    refuse(faults)

    ends = [patches[name] for name in OPEN]
    sides = [patches[name] for name in SIDES if name in patches]
    mass, made = sum(p.mass for p in ends), -sum(p.mass for p in sides)
    axial = sum(p.axial for p in ends) + on_open[0] + sum(force for force, _ in on_walls)
    axial_made = -sum(p.axial for p in sides) - on_sides[0]
    angular_made = -sum(p.angular for p in sides) - on_sides[1]
    swirl = sum(p.angular for p in ends)
    return _relative(s, on_rotor, (mass, made), (axial, axial_made), angular_made, swirl, _worst_band(sides, s.R))


def _relative(
    s: Settings, on_rotor: tuple[float, float], mass: tuple[float, float], axial: tuple[float, float], angular: float,
    swirl: float, place: str,
) -> Balance:  # fmt: skip
    """Residuals of one sector over the measures of one sector; (residual, made by the sides) of mass and momentum."""
    n, D, area = s.rpm / 60, 2 * s.R, math.pi * s.R**2
    thrust = max(s.sectors * abs(on_rotor[0]), LEAST_CT * s.rho * n**2 * D**4)
    torque = max(s.sectors * abs(on_rotor[1]), LEAST_CQ * s.rho * n**2 * D**5)
    V = s.V * math.cos(s.sideslip)
    through_disk = s.rho * area * (0.5 * V + math.sqrt(0.25 * V * V + thrust / (2 * s.rho * area)))
    measure = [s.sectors / through_disk, s.sectors / thrust, s.rotation * s.sectors / torque]
    turned = measure[2] * angular if s.sectors > 1 else math.nan
    found = {"mass": measure[0] * mass[0], "momentum": measure[1] * axial[0], "angular momentum": turned}
    by_sides = {"mass": measure[0] * mass[1], "momentum": measure[1] * axial[1], "angular momentum": math.inf}
    leaks = []
    for name, value in found.items():
        if abs(value) > BALANCE_LIMIT:
            from_sides = s.sectors > 1 and abs(by_sides[name]) >= 0.5 * abs(value)
            where = f"at side1 and side2{place}" if from_sides else "inside: the iteration has not closed"
            leaks.append(f"{name} {value:+.2%} {where}")
    return Balance(found["mass"], found["momentum"], found["angular momentum"], measure[2] * swirl, tuple(leaks))


def _worst_band(sides: list[_Patch], R: float) -> str:
    """Where along the shaft the flux of the two sides differs most."""
    if not sides:
        return ""
    z, dm = np.concatenate([p.z for p in sides]), np.concatenate([p.dm for p in sides])
    band = np.floor(z / R * BANDS_PER_R).astype(int)
    each = np.bincount(band - band.min(), weights=dm)
    worst = int(np.argmax(np.abs(each))) + int(band.min())
    return f", most at z = {worst / BANDS_PER_R:.1f} to {(worst + 1) / BANDS_PER_R:.1f} R"
