"""The contract for exports: one target per file in this folder, a subclass of :class:`Export`."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from bemt.base import plugins
from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.tables import plain, write_atomic
from bemt.base.toml import Table
from bemt.rotors.case.schema import PointTable
from bemt.tools.exports.parts import CHECK_ANGLES, HubTable, hub_of
from bemt.tools.exports.performance import (
    Loading,
    Performance,
    StatedBand,
    at_speed,
    band_of,
    loading_of,
    oblique_loads,
    performance_of,
    solve_points,
    thinner_air,
    zero_thrust,
)

if TYPE_CHECKING:
    from bemt.rotors.case import Case
    from bemt.tools.exports.printing import Print, Shape
    from geometry.mesh import Options

__all__ = [
    "FEATURES", "BladeExport", "DiskExport", "Export", "Files", "Job", "LoadsExport", "Manifest", "SolidExport",
]  # fmt: skip

Files = Mapping[str, str | bytes]
"""Content by path below the folder of the export."""
Manifest = dict[str, Any]
"""What ``manifest.json`` says of an export, or a part of it."""

FEATURES = {
    "torque": "shaft torque as well as thrust",
    "airspeed": "thrust that falls with axial airspeed",
    "windmill": "negative thrust beyond the advance ratio of zero thrust",
    "reynolds": "coefficients that change with speed of rotation (Reynolds number)",
    "mach": "coefficients that change with tip Mach number",
    "density": "loads that scale with the air density of the simulation",
    "rest": "static operation (J = 0)",
    "duct": "thrust of the duct as well as the rotor",
    "sections": "section polars, so that the target solves the inflow itself",
    "rotation": "direction of rotation, which gives the torque its sign",
    "hub": "in-plane force and hub moments with a wind across the shaft",
}
"""Features that a user can require of a target (``--hold``), in words."""

CONVENTION = "CT = T/(rho n^2 D^4), CP = P/(rho n^3 D^5), J = V/(n D), n in rev/s (propeller convention); SI units"


@dataclass(frozen=True)
class Job:
    """Request to an export.

    Parameters
    ----------
    case : Case
        The case, including changes.
    rpm : float or None
        Highest speed of tables and fits, speed of a disk; None: from the case, tables up to full throttle of its motor.
        [rev/min]
    airspeed_m_s : float or None
        Axial speed of a disk and of frozen polars; None: from the case. [m/s]
    hold : tuple of str
        Keys of :data:`FEATURES` that the target must support.
    unit : str
        Unit of solids, ``mm`` or ``m``.
    solid : geometry.mesh.Options or None
        Fillet, least thickness and tessellation of solids.
    printed : Print or None
        What a solid for a printer is to be; None is the rotor as its sections say.
    own : mapping
        Options of single targets by name, as :attr:`Export.options` declares them; what is missing is its default.
    slow : bool
        Whether tables start at a twentieth of the greatest speed, else at a quarter.
    matched_rpm : float or None
        Speed at which a model of few numbers has the loads of BEMT at rest; None: least squares over all speeds.
        [rev/min]
    """

    case: Case
    rpm: float | None = None
    airspeed_m_s: float | None = None
    hold: tuple[str, ...] = ()
    unit: str = "mm"
    solid: Options | None = None
    printed: Print | None = None
    own: Mapping[str, Any] = field(default_factory=dict)
    slow: bool = True
    matched_rpm: float | None = None

    @property
    def rpm_top(self) -> float:
        """Highest speed. [rev/min]"""
        return self.case.rpm if self.rpm is None else float(self.rpm)

    @property
    def airspeed(self) -> float:
        """Axial speed of the single point; a case with an angle is refused. [m/s]"""
        self.case.axial_only()
        return self.case.airspeed_m_s if self.airspeed_m_s is None else float(self.airspeed_m_s)

    @property
    def file(self) -> str:
        """Name of the case file, for faults."""
        return self.case.path.as_posix()

    @cached_property
    def full_throttle(self) -> dict[str, Any] | None:
        """Speed and thrust at full throttle with their u, where the case has a motor."""
        found: dict[str, Any] | None = plugins.part("drive", self.case)
        return found

    @property
    def rpm_full(self) -> float:
        """Speed that a full command stands for: full throttle of the case's motor, else that of the case. [rev/min]"""
        full = self.full_throttle if self.rpm is None else None
        return float(full["rpm"]["value"]) if full else self.rpm_top

    @cached_property
    def shapes(self) -> list[Shape]:
        """Solids to write; meshed once. Raises geometry.common.GeometryError."""
        from bemt.tools.exports.printing import shapes

        return shapes(self.case, self.solid, self.printed)

    @cached_property
    def performance(self) -> Performance:
        """Thrust and torque over rpm and advance ratio, up to the case's speed and its full throttle; solved once."""
        return performance_of(self.case, max(self.rpm_top, self.rpm_full), self.slow)

    @cached_property
    def flown(self) -> Job:
        """Request from a quarter of full throttle up to it, for a target whose few numbers are fitted to flight.

        Where they are matched at a speed, the range stays that of the case and its motor.
        """
        at = self.matched_rpm
        top = self.rpm_full if at is None else max(replace(self, rpm=None).rpm_full, at)
        return replace(self, rpm=top, slow=False)

    @cached_property
    def fitted(self) -> Performance:
        """What few numbers are fitted to: the whole table, or its flight at the speed where they are matched."""
        table = self.performance
        return table if self.matched_rpm is None else at_speed(self.case, table, self.matched_rpm)

    @property
    def speeds_note(self) -> str | None:
        """Why the speeds of tables, fits and disks differ; None where they do not."""
        if self.rpm_full == self.rpm_top:
            return None
        return (
            f"speeds: the case states {self.rpm_top:.6g} rev/min (disks and blades), its motor reaches "
            f"{self.rpm_full:.6g} at full throttle (full command of a fit); tables go to "
            f"{max(self.rpm_top, self.rpm_full):.6g}"
        )

    @cached_property
    def hub(self) -> HubTable | None:
        """Loads of the hub over speed, axial and in-plane advance ratio; None for a ducted rotor; solved once."""
        return None if self.case.ducted else hub_of(self.case, self.performance)

    @cached_property
    def J_zero(self) -> float:
        """Advance ratio of zero thrust at the highest speed. [-]"""
        return float(zero_thrust(self.case, np.array([self.rpm_top]))[0])

    @cached_property
    def thinner(self) -> tuple[float, float]:
        """Change of static CT and CP in air of `THINNER` times the density; solved once. [-]"""
        return thinner_air(self.case, self.rpm_top)

    @property
    def rotation(self) -> str:
        """Direction of rotation in words."""
        right = self.case.rotor().rotation > 0
        return f"{'right' if right else 'left'}-handed, {'' if right else 'counter-'}clockwise seen from behind"

    @cached_property
    def band(self) -> StatedBand:
        """Standard uncertainty of the prediction, static and at half the airspeed of zero thrust."""
        top = self.rpm_top
        return band_of(self.case, top, (0.0, 0.5 * self.J_zero * top / 60.0 * self.case.diameter_m))

    @cached_property
    def band_at_point(self) -> StatedBand:
        """Standard uncertainty of the prediction, static and at the single point."""
        return band_of(self.case, self.rpm_top, (0.0, self.airspeed))

    @cached_property
    def loading(self) -> Loading:
        """Loads along the blade at the single point."""
        return loading_of(self.case, self.rpm_top, self.airspeed)


class Export(ABC):
    """A target: a simulator, a disk of a flow solver, a design tool, a solid.

    A subclass in a module of ``bemt/tools/exports/`` is found by scanning, one of another tool by its ``EXPORTS``; its
    ``id`` is the value of ``--format``.

    A class defines ``id`` (name on the command line) and ``title``; ``kind``: ``solid``, ``loads`` (thrust and
    torque of a simulator), ``disk`` (a flow solver) or ``blade`` (a design tool); ``holds``: the model class, as a
    formula where there is one; ``features``: keys of :data:`FEATURES`; ``conventions``: signs, axes and units of the
    written numbers; ``source`` of format and formula; ``needs``: Python packages beyond the installation; ``options``:
    the options that it declares beside the operating point; ``uses``: which of them it reads; ``told``: what it tells
    the user of every case; ``turn``: 0 has a folder of its own, 1 stands beside others, 2 makes the folder itself a
    case and comes last.
    """

    id: ClassVar[str]
    title: ClassVar[str]
    kind: ClassVar[str]
    holds: ClassVar[str]
    features: ClassVar[frozenset[str]] = frozenset()
    conventions: ClassVar[str] = CONVENTION
    source: ClassVar[str]
    needs: ClassVar[tuple[str, ...]] = ()
    options: ClassVar[type[Table]] = PointTable
    uses: ClassVar[frozenset[str]] = frozenset()
    told: ClassVar[tuple[str, ...]] = ()
    turn: ClassVar[int] = 0

    def put(self, job: Job, out: Path) -> Manifest:
        """Write the files into the folder of the export and give their part of the manifest.

        Nothing is written where the request cannot be met (InputError).
        """
        from bemt.tools.exports.parts import entry
        from geometry.export import MANIFEST, SCHEMA

        if found := self.faults(job):
            raise InputError(found)
        files = self.write(job)
        made = plain(entry(self, job, files))
        (out / MANIFEST).unlink(missing_ok=True)  # a manifest never speaks of files that are being replaced
        for name, data in files.items():
            path = out / self.id / name
            write_atomic(path, data)
            if str(data)[:2] == "#!":
                os.chmod(path, 0o755)
        return {"schema": SCHEMA, "name": job.case.name, "targets": [made]}

    def text(self, part: Mapping[str, Any]) -> list[str]:
        """Lines for a terminal on its own part of the manifest, what that holds under `id`."""
        return [str(note) for note in part.get("notes", [])]

    def faults(self, job: Job) -> list[Fault]:
        """All requests that the target cannot meet; overriding methods add to this list."""
        import importlib.util

        out = []
        for word in job.hold:
            if word not in self.features:
                got, wanted = f"the target {self.id}: {self.holds}", f"a target that holds {FEATURES[word]}"
                others = f"It represents {', '.join(sorted(self.features)) or 'shape only'}"
                out.append(Fault(job.file, f"--hold {word}", got, wanted, others))
        if job.case.ducted and "hub" in job.hold and "hub" in self.features:
            got = "a ducted rotor, whose loads across the shaft are not solved"
            out.append(Fault(job.file, "--hold hub", got, "an open rotor"))
        where = f"--format {self.id}"
        if job.case.ducted and self.kind != "loads" and "duct" not in self.features:
            holds = f"The target represents {self.holds}"
            out.append(Fault(job.file, where, "a rotor in a duct", "an open rotor", holds))
        for name in self.needs:
            if importlib.util.find_spec(name) is None:
                got, hint = f"no package {name}", "pip install 'bemt[simulators]'"
                out.append(Fault("", where, got, "the extra of this target", hint))
        return out

    @abstractmethod
    def write(self, job: Job) -> Files:
        """Content of the files of a request without `faults`. InputError where the case cannot be solved there."""

    def notes(self, job: Job) -> list[str]:
        """Sentences for the user of the files."""
        return list(self.told)

    def checked(self, job: Job, files: Files) -> Manifest:
        """``fit_error_pct``, ``band`` and ``range`` of what :meth:`write` gave, for the manifest."""
        return {}


class LoadsExport(Export):
    """A target that holds thrust and torque: its fit is checked on the written files against fresh solves."""

    kind = "loads"
    uses = frozenset({"rpm"})

    def asked(self, job: Job) -> Job:
        """Request as the target takes it: numbers without a table are fitted up to full throttle."""
        return job if "reynolds" in self.features else job.flown

    def notes(self, job: Job) -> list[str]:
        """Where the numbers are those of BEMT, for a model that has them at one speed or at none."""
        t, at = self.asked(job).performance, self.asked(job).matched_rpm
        if "reynolds" in self.features:
            return super().notes(job)
        span = f"{t.rpm[0]:.6g} to {t.rpm[-1]:.6g} rev/min"
        how = f"fitted to {span} alike: --rpm N matches them at rest at the speed that you fly"
        if at is not None:
            how = f"matched at rest at {at:.6g} rev/min; fit_error_pct tells {span}"
        return [*super().notes(job), f"the constants are {how}"]

    @abstractmethod
    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """The target's published formula, evaluated on the written files.

        Parameters
        ----------
        files : mapping
            What :meth:`write` gave.
        rpm, airspeed_m_s : (P,) float
            Points. [rev/min], [m/s]

        Returns
        -------
        thrust, torque : (P,) float
            Loads [N], [N m]; NaN where the target does not hold them.
        """

    def hub_loads(self, files: Files, rpm: Array, airspeed_m_s: Array, side_m_s: Array) -> Array | None:
        """The same with a wind across the shaft.

        Parameters
        ----------
        files : mapping
            What :meth:`write` gave.
        rpm, airspeed_m_s, side_m_s : (P,) float
            Points: speed, airspeed along the shaft and across it. [rev/min], [m/s]

        Returns
        -------
        (6, P) float or None
            Thrust [N], torque [N m], H, Y [N], roll and pitch moment [N m], NaN where the target has no such load; None
            if it holds none of the hub's.
        """
        return None

    def hub_checked(self, job: Job, files: Files) -> Manifest | None:
        """Errors of the hub's loads at oblique points that are no nodes of the table."""
        table = self.asked(job).performance
        rpm, J = table.check_points()
        keep = np.flatnonzero((J > 0.0) & (rpm >= 0.5 * table.rpm[-1]))[::3]
        angle = np.radians(np.resize(CHECK_ANGLES, keep.size))
        wind = J[keep] * rpm[keep] / 60.0 * table.diameter_m
        at = rpm[keep], wind * np.cos(angle), wind * np.sin(angle)
        got = self.hub_loads(files, *at) if not job.case.ducted else None
        if got is None:
            return None
        exact = oblique_loads(job.case, *at)
        rest = solve_points(job.case, rpm[keep], 0.0)
        full = np.array(
            [rest.thrust_N, rest.torque_Nm, *[rest.thrust_N] * 2, *[0.5 * table.diameter_m * rest.thrust_N] * 2]
        )
        share = 100.0 * np.abs(got - exact) / full
        return {
            name: _worst(row)
            for name, row in zip(("thrust", "torque", "H", "Y", "roll", "pitch"), share, strict=True)
        } | {"of": "thrust at rest, its torque, and thrust times radius", "points": int(keep.size)}  # fmt: skip

    def checked(self, job: Job, files: Files) -> Manifest:
        """Errors at points that are no nodes of the table, at rest and over the flight range."""
        table = self.asked(job).performance
        rpm, J = table.check_points()
        V = J * rpm / 60.0 * table.diameter_m
        truth = solve_points(job.case, rpm, V)
        got = self.loads(files, rpm, V)
        static, errors = J == 0.0, dict[str, object]()
        for name, value, exact in zip(("thrust", "torque"), got, (truth.thrust_N, truth.torque_Nm), strict=True):
            off = 100.0 * np.abs(value - exact)
            share = off / np.array([exact[rpm == n].max() for n in rpm])
            errors[name] = {
                "at_rest": _worst((off / exact)[static]),
                "flight": _worst(share),
                "flight_upper_half_of_rpm": _worst(share[rpm >= 0.5 * table.rpm[-1]]),
            }
        return {
            "fit_error_pct": errors
            | {"of": "the greatest load at the same rpm; at rest the load itself", "points": int(rpm.size)},
            "oblique_error_pct": self.hub_checked(job, files),
            "band": job.band.document(),
            "range": table.range_document(),
        }


def _worst(share: Array) -> float | None:
    """Greatest error; None where the target holds no such load."""
    return None if share.size == 0 or np.isnan(share).any() else float(share.max())


class DiskExport(Export):
    """A target that holds the loads of a disk at one operating point."""

    kind = "disk"
    uses = frozenset({"rpm", "airspeed_m_s"})
    at_rest: ClassVar[bool] = True

    def faults(self, job: Job) -> list[Fault]:
        """Refuse a point at rest where the target cannot hold it, and a rotor that is no propeller there."""
        out = super().faults(job)
        if not self.at_rest and not job.airspeed > 0.0:
            got, hint = f"an airspeed of {job.airspeed:g} m/s", f"{self.holds}; give --airspeed-m-s"
            out.append(Fault(job.file, f"--format {self.id}", got, "a speed above 0", hint))
        return out

    def notes(self, job: Job) -> list[str]:
        """Sentences for the user of the files; a prescribed load leaves out the duct."""
        duct = "the load is the rotor's alone: duct and stator belong into your mesh"
        return [*self.told, *([duct] if job.case.ducted and "sections" not in self.features else [])]

    def checked(self, job: Job, files: Files) -> Manifest:
        """Loads of the point, and what the written numbers integrate to."""
        point = job.loading
        T, Q = self.totals(job, files)
        own = "; not held: the target solves the inflow itself" if None in (T, Q) else ""
        return {
            "point": point.document(),
            "fit_error_pct": {
                "thrust": None if T is None else 100.0 * abs(T / point.thrust_N - 1.0),
                "torque": None if Q is None else 100.0 * abs(Q / point.torque_Nm - 1.0),
                "of": f"the loads of the rotor at this point{own}",
            },
            "band": job.band_at_point.document(),
            "range": {"rpm": point.rpm, "airspeed_m_s": point.airspeed_m_s, "density_kg_m3": point.rho},
        }

    def totals(self, job: Job, files: Files) -> tuple[float | None, float | None]:
        """Thrust [N] and torque [N m] that the written numbers integrate to by the target's rule, or None."""
        return None, None


class SolidExport(Export):
    """A solid; several in one folder share a manifest, which `bemt.tools.exports.folder` sees to."""

    kind = "solid"
    holds = "shape"
    conventions = "z along the shaft towards thrust, x the pitch axis of blade 1; unit in the manifest"

    turn = 1

    def put(self, job: Job, out: Path) -> Manifest:
        """The files that `geometry.export` makes."""
        from bemt.tools.exports.parts import joined
        from geometry.common import GeometryError, LibraryError
        from geometry.export import export

        found: Manifest = {}
        try:
            for s in job.shapes:
                made = export(s.rotor, s.duct, out, [self.id], name=job.case.name + s.end, unit=job.unit,
                              options=s.options, model=s.model, box=job.own.get("far_field_over_D"))  # fmt: skip
                told = {} if s.printed is None else {"printed": s.printed.document()}
                found = joined(found, made | {"name": job.case.name} | told)
        except GeometryError as error:
            alone = isinstance(error, LibraryError)
            faults = [Fault(at, "", *rest) if alone else Fault(job.file, at, *rest) for at, *rest in error.faults]
            raise InputError(faults) from error
        return found

    def write(self, job: Job) -> Files:
        """What `put` leaves in a folder."""
        import tempfile

        from geometry.export import MANIFEST

        with tempfile.TemporaryDirectory() as folder:
            home = Path(folder)
            self.put(job, home)
            files = [path for path in sorted(home.rglob("*")) if path.is_file() and path.name != MANIFEST]
            return {path.relative_to(home).as_posix(): path.read_bytes() for path in files}

    def faults(self, job: Job) -> list[Fault]:
        """Nothing of a case is too much for a solid; loads are."""
        return [
            Fault(job.file, f"--hold {word}", f"the target {self.id}: shape", f"a target that holds {FEATURES[word]}")
            for word in job.hold
        ]


class BladeExport(Export):
    """A target that holds a blade and its sections, and solves itself: its file is read back and solved here."""

    kind = "blade"
    uses = frozenset({"rpm", "airspeed_m_s"})

    def read_back(self, job: Job, files: Files, folder: Path) -> Case:
        """What :meth:`write` gave as a case in an empty folder, by the reader of the same name."""
        from bemt.data.readers import importers
        from bemt.data.readers.blade import case_text
        from bemt.rotors.case import load_case

        name, data = next(iter(files.items()))
        write_atomic(folder / name, data)
        blade = importers()[self.id].read(folder / name)
        for path, text in case_text(blade, "read_back", name).items():
            write_atomic(folder / path, text)
        return load_case(folder / "case.toml")

    def compared(self, job: Job) -> Case:
        """The case that what is read back is compared with."""
        return job.case

    def sections(self, job: Job) -> list[Any] | None:
        """Fitted section of each anchor; None where the target holds the tables themselves."""
        return None

    def checked(self, job: Job, files: Files) -> Manifest:
        """Loads of the case at the operating point, and how far fitted sections are off its tables."""
        from bemt.tools.exports.blades import section_errors

        p, fitted = job.loading, self.sections(job)
        errors = None if fitted is None else section_errors(job, fitted)
        worst = None if errors is None else {key: max(e[key] for e in errors) for key in ("cl", "cd_pct")}
        return {
            "point": p.document(),
            "section_error": worst if worst is None else worst | {"of": "cl, and cd relative, between the stalls"},
            "band": job.band_at_point.document(),
            "range": {"rpm": p.rpm, "airspeed_m_s": p.airspeed_m_s, "density_kg_m3": p.rho},
        }
