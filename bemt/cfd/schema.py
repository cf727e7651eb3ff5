"""Campaign files: a TOML document becomes a list of CFD runs of one case."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bemt.base.errors import Fault, InputError
from bemt.base.toml import Collector, Key, check_table, load_toml, shown
from bemt.case import Case, check_name, load_case
from bemt.exports.openfoam.settings import DOMAINS, GASES, SECTORS, TURBULENCE, ZONES
from bemt.exports.openfoam.write import Run

__all__ = ["SCHEMA_NAME", "Campaign", "CampaignPoint", "load_campaign"]

SCHEMA_NAME = "bemt.cfd/1"
STARTS = ("neighbour", "slipstream")
POINT: dict[str, Key] = {
    "rpm": Key(unit="rev/min", low=10, high=300_000),
    "airspeed_m_s": Key(unit="m/s", low=0, high=300),
    "J": Key(low=0, high=5),
    "sideslip_deg": Key(unit="deg", low=0, high=90),
    "pitch_offset_deg": Key(unit="deg", low=-30, high=30),
    "tip_gap_pct_R": Key(unit="% of R", low=0.1, high=10),
    "wall_distance_over_R": Key(unit="R", low=0.2, high=20),
    "plate_radius_over_R": Key(unit="R", low=0.5, high=5),
    "solver": Key("choice", choices=("incompressible", "compressible")),
    "gas": Key("choice", choices=GASES),
    "sector": Key("choice", choices=SECTORS),
    "domain": Key("choice", choices=DOMAINS),
    "turbulence": Key("choice", choices=TURBULENCE),
    "level": Key(low=4, high=9),
    "iterations": Key("integer", low=20, high=100_000),
    "average": Key("integer", low=10, high=100_000),
    "start": Key("choice", choices=STARTS),
    "zone": Key("choice", choices=ZONES),
}
SCHEMA: dict[str, dict[str, Key]] = {
    "": {
        "schema": Key("choice", required=True, choices=(SCHEMA_NAME,)),
        "name": Key("text", required=True),
        "title": Key("text"),
        "case": Key("text", required=True),
        "grid_study": Key("text"),
    },
    "defaults": POINT,
    "point": POINT,
    "duct": {
        "length_mm": Key(unit="mm", low=1, high=10_000, required=True),
        "lip_radius_mm": Key(unit="mm", low=0, high=1000),
        "rotor_position_mm": Key(unit="mm", low=-1000, high=10_000),
        "exit_area_ratio": Key(low=0.3, high=3, required=True),
    },
}


@dataclass(frozen=True)
class CampaignPoint:
    """One run of a campaign.

    Parameters
    ----------
    case : Case
        The case with the changes of this point.
    run : Run
        Operating point, domain, grid and models.
    values : mapping
        What the file says for this point, defaults included.
    warm : bool
        Whether it may start from the flow of a run on the same grid.
    """

    case: Case
    run: Run
    values: Mapping[str, Any]
    warm: bool


@dataclass(frozen=True)
class Campaign:
    """A checked campaign.

    Parameters
    ----------
    path : Path
        Its file; recording and manifest stand beside it.
    name, title : str
        Names.
    case : Case
        The case, unchanged.
    points : tuple of CampaignPoint
        In the order in which they run.
    grid_study : Path or None
        Folder of the campaign whose grid study gives the numerical uncertainty.
    """

    path: Path
    name: str
    title: str
    case: Case
    points: tuple[CampaignPoint, ...]
    grid_study: Path | None


def load_campaign(path: str | Path) -> Campaign:
    """Read and check a campaign file."""
    path = Path(path)
    if path.is_dir():
        path = path / "campaign.toml"
    out = Collector(path.as_posix())
    document = load_toml(path, out)
    if document is None:
        raise InputError(out.faults)
    tables = ("defaults", "axes", "points", "duct")
    check_table(out, "", document, SCHEMA, subtables=tables)
    check_name(out, document.get("name"))  # the default work folder bears it
    for table in ("defaults", "duct"):
        if table in document:
            check_table(out, table, document[table], SCHEMA)
    rows = _rows(out, document)
    case = None
    if isinstance(document.get("case"), str) and document["case"].strip():
        try:
            case = load_case(path.parent / document["case"])
        except InputError as error:
            out.faults += error.faults
    points = []
    if case is not None and not out.faults:
        for where, row in rows:
            points += _point(out, where, row, case, document.get("duct"))
    if out.faults:
        raise InputError(out.faults)
    assert case is not None
    study = document.get("grid_study")
    return Campaign(path, document["name"], document.get("title", document["name"]), case, tuple(points),
                    None if study is None else path.parent / study)  # fmt: skip


def _rows(out: Collector, document: Mapping[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    defaults = document.get("defaults", {})
    defaults = dict(defaults) if isinstance(defaults, Mapping) else {}
    found: list[tuple[str, dict[str, Any]]] = []
    axes, listed = document.get("axes", {}), document.get("points", [])
    if not isinstance(axes, Mapping):
        out.add("axes", shown(axes), "a table [axes]")
        axes = {}
    for name, values in axes.items():
        if not isinstance(values, list) or not values:
            out.add(f"axes.{name}", shown(values), "a list of values")
    if not isinstance(listed, list):
        out.add("points", shown(listed), "tables [[points]]")
        listed = []
    for i, item in enumerate(listed):
        if not isinstance(item, Mapping):
            out.add(f"points[{i}]", shown(item), "a table [[points]]")
            continue
        found.append((f"points[{i}]", {**defaults, **item}))
    if axes and not out.faults:
        for chosen in itertools.product(*axes.values()):
            found.append(("axes", {**defaults, **dict(zip(axes, chosen, strict=True))}))
    before = len(out.faults)
    for where, row in found:
        check_table(out, "point", row, SCHEMA, where=where)
        if len(out.faults) - before > 20:
            break
    for where, row in found:
        given = {k for k in ("J", "airspeed_m_s") if k in row}
        if len(given) == 2:
            out.add(where, "J and airspeed_m_s", "one of them")
        if "J" in row and "rpm" not in row:
            out.add(where, "J without rpm", "a speed to which it belongs")
    if not found and not out.faults:
        out.add("", "no points", "[axes] or [[points]]")
    out.faults = list(dict.fromkeys(out.faults))
    return found


def _point(
    out: Collector, where: str, row: dict[str, Any], case: Case, duct: Mapping[str, Any] | None
) -> list[CampaignPoint]:
    overrides: dict[str, Any] = {}
    if "pitch_offset_deg" in row:
        overrides["blade.beta_offset_deg"] = case.file.blade.beta_offset_deg + row["pitch_offset_deg"]
    if "tip_gap_pct_R" in row:
        if duct is None and not case.ducted:
            out.add(f"{where}.tip_gap_pct_R", shown(row["tip_gap_pct_R"]), "a table [duct] or a case with a duct")
            return []
        overrides |= {f"duct.{key}": value for key, value in (duct or {}).items()}
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
