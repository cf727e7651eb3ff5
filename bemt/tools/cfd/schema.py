"""Campaign files: a TOML document becomes a list of CFD runs of one case."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import NoneType
from typing import Any, Literal, get_args

from pydantic import create_model
from pydantic.fields import FieldInfo

from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError, gathered, refuse
from bemt.base.toml import Table, entry, limits_of, shown, validated
from bemt.base.toml_text import Collector, load_toml
from bemt.data.readers import number
from bemt.rotors.case import Case, check_name, load_case
from bemt.tools.cfd.openfoam.settings import GASES, ZONES
from bemt.tools.cfd.openfoam.write import Run, RunTable

__all__ = ["Campaign", "CampaignFile", "CampaignPoint", "load_campaign"]


class PointOptions(RunTable):
    """[defaults], [[points]] and, as lists, [axes]: one CFD run; omitted values come from the case."""

    J: float | None = entry("advance ratio, with rpm and instead of airspeed_m_s", low=0, high=5)
    pitch_offset_deg: float | None = entry("rotation of the whole blade", "deg", -30, 30)
    tip_gap_pct_R: float | None = entry("tip gap, with a duct", "% of R", 0.1, 10)
    wall_distance_over_R: float | None = entry("round plate behind the rotor", "R", 0.2, 20)
    plate_radius_over_R: float | None = entry("radius of that plate", "R", 0.5, 5)
    gas: str | None = entry("gas model of the compressible solver", choices=GASES)
    iterations: int | None = entry("iterations of the solver", low=20, high=100_000)
    average: int | None = entry("number of last iterations to average", low=10, high=100_000)
    start: Literal["neighbour", "slipstream"] | None = entry("initial flow: run on the same grid, or momentum theory")
    zone: str | None = entry("ends of the rotating zone", choices=ZONES)


def _listed(field: FieldInfo) -> Any:
    kind: Any = next(part for part in get_args(field.annotation) if part is not NoneType)
    return tuple[kind, ...] | None, entry(field.description or "", limits_of(field))


AxesTable: Any = create_model(
    "AxesTable", __base__=Table, **{name: _listed(field) for name, field in PointOptions.model_fields.items()}
)


class CampaignDuct(Table):
    """[duct]: for runs with tip_gap_pct_R if the case has no duct."""

    length_mm: float = entry("length from inlet to exit", "mm", 1, 10_000, required=True)
    lip_radius_mm: float | None = entry("radius of the inlet lip", "mm", 0, 1000)
    rotor_position_mm: float | None = entry("distance of the rotor behind the inlet", "mm", -1000, 10_000)
    exit_area_ratio: float = entry("exit area over swept annulus", "", 0.3, 3, required=True)


class CampaignFile(Table):
    """campaign.toml: CFD runs of one case, every combination of [axes] and each of [[points]]."""

    schema_: Literal["bemt.cfd/1"] = entry("version of the format", required=True, alias="schema")
    name: str = entry("name of the folder of the runs", required=True)
    title: str | None = entry("one-line title")
    case: str = entry("path to case.toml", required=True)
    grid_study: str | None = entry("folder of the campaign that gives the numerical uncertainty")
    defaults: PointOptions = PointOptions()
    axes: AxesTable = AxesTable()
    points: tuple[PointOptions, ...] = ()
    duct: CampaignDuct | None = None


@dataclass(frozen=True)
class CampaignPoint:
    """One run of a campaign."""

    case: Case  # with the changes of this point
    run: Run
    values: Mapping[str, Any]  # what the file says for this point, defaults included
    warm: bool  # whether it may start from the flow of a run on the same grid


@dataclass(frozen=True)
class Campaign:
    """A checked campaign; recording and manifest stand beside its file."""

    path: Path
    name: str
    title: str
    case: Case
    points: tuple[CampaignPoint, ...]
    grid_study: Path | None  # folder of the campaign that gives the numerical uncertainty


def load_campaign(path: str | Path) -> Campaign:
    """Read and check a campaign file."""
    path = Path(path)
    if path.is_dir():
        path = path / "campaign.toml"
    out = Collector(path.as_posix())
    document = load_toml(path, out)
    if document is None:
        raise InputError(out.faults)
    file = validated(CampaignFile, document, out)
    check_name(out, document.get("name"))  # the default work folder bears it
    case = None
    if isinstance(document.get("case"), str) and document["case"].strip():
        with gathered(out.faults):
            case = load_case(path.parent / document["case"])
    rows = [] if file is None else _rows(out, file)
    if case is None or file is None or out.faults:
        raise InputError(out.faults)
    points = [p for where, row in rows for p in _point(out, where, row, case, file.duct)]
    refuse(out.faults)
    study = None if file.grid_study is None else path.parent / file.grid_study
    return Campaign(path, file.name, file.title or file.name, case, tuple(points), study)


def _rows(out: Collector, file: CampaignFile) -> list[tuple[str, dict[str, Any]]]:
    """What is stated of each run, with its place in the file."""
    defaults, axes = file.defaults.given(), file.axes.given()
    found = [(f"points[{i}]", defaults | item.given()) for i, item in enumerate(file.points)]
    if axes:
        crossed = itertools.product(*axes.values())
        found += [("axes", defaults | dict(zip(axes, chosen, strict=True))) for chosen in crossed]
    for where, row in found:
        if "J" in row and "airspeed_m_s" in row:
            out.add(where, "J and airspeed_m_s", "one of them")
        if "J" in row and "rpm" not in row:
            out.add(where, "J without rpm", "a speed to which it belongs")
    if not found:
        out.add("", "no points", "[axes] or [[points]]")
    out.faults = list(dict.fromkeys(out.faults))
    return found


def _point(
    out: Collector, where: str, row: dict[str, Any], case: Case, duct: CampaignDuct | None
) -> list[CampaignPoint]:
    overrides: dict[str, object] = {}
    if "pitch_offset_deg" in row:
        overrides["blade.beta_offset_deg"] = case.file.blade.beta_offset_deg + row["pitch_offset_deg"]
    if "tip_gap_pct_R" in row:
        if duct is None and not case.ducted:
            out.add(f"{where}.tip_gap_pct_R", shown(row["tip_gap_pct_R"]), "a table [duct] or a case with a duct")
            return []
        overrides |= {f"duct.{key}": value for key, value in (duct.given() if duct else {}).items()}
        overrides["duct.tip_gap_mm"] = 10.0 * row["tip_gap_pct_R"] * 0.5 * case.diameter_m
    rpm = float(row.get("rpm", case.rpm))
    speed = row.get("airspeed_m_s", row["J"] * rpm / 60 * case.diameter_m if "J" in row else case.airspeed_m_s)
    same = ("sideslip_deg", "solver", "gas", "sector", "domain", "turbulence", "level", "wall_distance_over_R",
            "plate_radius_over_R", "iterations", "average", "zone")  # fmt: skip
    run = Run(rpm=rpm, airspeed_m_s=float(speed), **{k: row[k] for k in same if k in row})
    if run.average > run.iterations:
        out.add(where, f"average = {run.average} of {run.iterations} iterations", "no more than all")
        return []
    try:
        changed = case.replaced(overrides)
        changed.rotor()
        changed.duct()
    except InputError as error:
        out.faults += [Fault(out.file, f"{where}: {f.where}", f.got, f.expected, f.hint) for f in error.faults]
        return []
    return [CampaignPoint(changed, run, row, row.get("start", "neighbour") == "neighbour")]


# One run of a campaign as its recording holds it, a line of ``recording.csv``, and the grid studies of its runs.


class RunRow(Documented):
    """Point, loads with their standard uncertainties, how it was computed, and how well it settled; NaN: not stated."""

    run: str = ""
    rpm: float = math.nan
    airspeed_m_s: float = math.nan
    J: float = math.nan
    thrust_N: float = math.nan
    torque_Nm: float = math.nan
    u_thrust_N: float = math.nan
    u_torque_Nm: float = math.nan
    thrust_rotor_N: float = math.nan
    thrust_standing_N: float = math.nan
    density_kg_m3: float = math.nan
    temperature_C: float = math.nan
    pressure_Pa: float = math.nan
    wall_distance_m: float = math.nan
    tip_gap_mm: float = math.nan
    sideslip_deg: float = math.nan
    pitch_offset_deg: float = math.nan
    solver: str = ""
    gas: str = ""
    domain: str = ""
    sector: str = ""
    turbulence: str = ""
    level: float = math.nan
    cells: float = math.nan
    iterations: float = math.nan
    averaged: float = math.nan
    drift_thrust: float = math.nan
    drift_torque: float = math.nan
    scatter_thrust: float = math.nan
    scatter_torque: float = math.nan
    balance_mass: float = math.nan
    balance_momentum: float = math.nan
    balance_angular_momentum: float = math.nan
    swirl_out: float = math.nan
    yplus_avg: float = math.nan
    seconds: float = math.nan
    start: str = ""
    converged: float = math.nan
    note: str = ""

    @property
    def settled(self) -> bool:
        """Whether it converged."""
        return self.converged == 1


class StudyResult(Documented):
    """Grid study of one load, finest grid first; standard uncertainty by level, relative [1]."""

    values: tuple[float, ...]
    order: float | None
    extrapolated: float | None
    gci_fine: float | None
    gci_coarse: float | None
    spread: float
    flags: tuple[str, ...]
    u_relative: Mapping[str, float]


class Study(Documented):
    """Runs that differ in their grid alone, finest first."""

    rpm: float
    airspeed_m_s: float
    wall_distance_m: float
    tip_gap_mm: float
    sideslip_deg: float
    pitch_offset_deg: float
    solver: str
    gas: str
    domain: str
    sector: str
    turbulence: str
    levels: tuple[float, ...]
    cells: tuple[float, ...]
    ratios: tuple[float, ...]
    by_cells: tuple[float, ...]
    thrust_N: StudyResult
    torque_Nm: StudyResult

    def of(self, load: str) -> StudyResult:
        """Study of ``thrust_N`` or ``torque_Nm``."""
        found: StudyResult = getattr(self, load)
        return found


COLUMNS = tuple(f.name for f in fields(RunRow))
TEXTS = {f.name for f in fields(RunRow) if f.type == "str"}


def run_of(cells: Mapping[str, str]) -> RunRow:
    """Run of a line as written; NaN where nothing or no number stands."""
    found: dict[str, Any] = {k: cells.get(k) or "" for k in TEXTS}
    for name in COLUMNS:
        if name not in TEXTS:
            read = number(text) if (text := cells.get(name)) else None
            found[name] = read if read is not None and math.isfinite(read) else math.nan
    return RunRow(**found)
