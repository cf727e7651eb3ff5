"""This project's own CFD: recordings of campaigns (schema ``bemt.cfd-recording/1``) found in the folder of results.

A recording is audited like anybody else's number. What has another shape than expected is left out.
Its pages: the recordings, and one rotor by blade elements, as a disk in a flow solver and with its blades resolved.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from bemt.base.page import Cell, num, table
from bemt.data.readers import number
from bemt.data.recordings.audit import CfdFacts, audit, audit_document
from bemt.data.recordings.cfd_study import LOADS, study_text
from bemt.results.report.found_files import read_json, safe_files
from bemt.results.report.plot import COLOURS, DASHES, SERIES, SHAPES, Plot, Trace, figure
from bemt.results.report.values import Part, Section, picture, sections
from bemt.results.sweep.comparison import Comparison
from bemt.rotors.validity import serious

SCHEMA = "bemt.cfd-recording/"
CSV_BYTES = 20_000_000
DOMAIN_OVER_D = {"free": 5.0, "pipe": 1.0}
"""Width of the domains of :mod:`bemt.tools.cfd.openfoam` over the rotor's diameter. [1]"""
TURBULENCE = {"kOmegaSST": "k-omega SST", "realizableKE": "realizable k-epsilon"}
NUMBERS = ("rpm", "airspeed_m_s", "J", "thrust_N", "torque_Nm", "u_thrust_N", "u_torque_Nm", "density_kg_m3",
           "wall_distance_m", "tip_gap_mm", "sideslip_deg", "pitch_offset_deg", "level", "cells", "iterations",
           "drift_thrust", "drift_torque", "scatter_thrust", "balance_mass", "balance_momentum", "yplus_avg", "seconds",
           "converged")  # fmt: skip
WORDS = ("run", "solver", "gas", "domain", "sector", "turbulence", "note")


def read_rows(path: Path) -> list[dict[str, str]]:
    """Lines of a CSV file that somebody else wrote; none when it is missing or no text."""
    try:
        if path.stat().st_size > CSV_BYTES:
            return []
        text = path.read_text(encoding="utf-8", errors="replace")
        return [
            {k: v for k, v in row.items() if isinstance(k, str) and isinstance(v, str)}
            for row in csv.DictReader(io.StringIO(text))
        ]
    except (OSError, csv.Error):
        return []


def value(text: str | None) -> float:
    """Finite number in a cell, else NaN."""
    found = number(text) if text else None
    return found if found is not None and math.isfinite(found) else math.nan


def cfd_runs(out: Path) -> list[dict[str, Any]]:
    """Read the recordings of CFD campaigns."""
    found = []
    for path in sorted(out.glob("cfd/*/manifest.json")):
        manifest = read_json(path)
        if not isinstance(manifest, Mapping) or not str(manifest.get("schema", "")).startswith(SCHEMA):
            continue
        runs = []
        for row in read_rows(path.parent / "recording.csv"):
            run: dict[str, Any] = {k: value(row.get(k)) for k in NUMBERS} | {k: row.get(k, "") for k in WORDS}
            if run["rpm"] > 0 and math.isfinite(run["thrust_N"]):
                runs.append(run)
        radial: dict[str, list[tuple[float, float, float]]] = {}
        for row in read_rows(path.parent / "radial.csv"):
            point = tuple(value(row.get(k)) for k in ("r_m", "thrust_per_radius_N_m", "torque_per_radius_Nm_m"))
            if all(map(math.isfinite, point)):
                radial.setdefault(row.get("run", ""), []).append(point)  # type: ignore[arg-type]
        if runs:
            found.append({"name": path.parent.name, "title": str(manifest.get("title") or path.parent.name),
                          "case": str(manifest.get("case") or ""), "manifest": dict(manifest), "runs": runs,
                          "radial": radial, "figures": safe_files(path.parent)})  # fmt: skip
    return found


def is_plain(run: Mapping[str, Any]) -> bool:
    """Tell whether a run is the bare case: free domain, axial flow, no plate, blades as they are, settled.

    A sector of one blade counts with its balance only: its sides may leak.
    """
    apart = [run["sideslip_deg"], run["pitch_offset_deg"]]
    closed = run["sector"] != "blade" or math.isfinite(run["balance_mass"])
    return (closed and run["domain"] == "free" and run["converged"] == 1 and math.isnan(run["wall_distance_m"])
            and all(not abs(v) > 1e-9 for v in apart))  # fmt: skip


def operating_run(found: Sequence[Mapping[str, Any]], result: Mapping[str, Any]) -> dict[str, Any] | None:
    """Choose the run that stands for a case at its operating point: compressible before not, then the finest grid."""
    c = result.get("conditions")
    if not c:
        return None
    ducted = result.get("kind") == "fan"
    best = None
    for item in found:
        if item["case"] != result["name"] or ("duct" in item["name"] and not ducted):
            continue
        for run in item["runs"]:
            if (
                not is_plain(run)
                or abs(run["rpm"] / c["rpm"] - 1) > 1e-3
                or (math.isfinite(run["tip_gap_mm"]) and not ducted)
                or abs(run["airspeed_m_s"] - c["airspeed_m_s"]) > 0.05
            ):
                continue
            rank = (run["solver"] == "compressible", run["turbulence"] == "kOmegaSST", run["level"])
            if best is None or rank > best[0]:
                best = (rank, {**run, "campaign": item["name"]})
    return None if best is None else best[1]


def radial_of(found: Sequence[Mapping[str, Any]], run: Mapping[str, Any]) -> list[tuple[float, float, float]]:
    """Loads along the radius of a run, ascending."""
    return next((sorted(item["radial"][run["run"]]) for item in found if run["run"] in item["radial"]), [])


def _facts(run: Mapping[str, Any], conditions: Mapping[str, Any], levels: int) -> CfdFacts:
    """What the audit asks for."""
    D, n = conditions["diameter_m"], run["rpm"] / 60.0
    T, u = abs(run["thrust_N"]), run["u_thrust_N"]
    grid = math.sqrt(max((u / T) ** 2 - run["scatter_thrust"] ** 2, 0.0)) if T > 0 and levels > 1 else math.nan
    return CfdFacts(
        M_tip=math.pi * D * n / conditions["a_sound_m_s"], J=run["airspeed_m_s"] / (n * D), cells=run["cells"],
        pitch_over_D=conditions["pitch_075R_m"] / D, CT=run["thrust_N"] / (run["density_kg_m3"] * n**2 * D**4),
        domain_over_D=DOMAIN_OVER_D.get(run["domain"], math.nan), compressible=run["solver"] == "compressible",
        grids=levels, u_grid=grid if grid > 0 else math.nan, drift=run["drift_thrust"], wall="function",
        y_plus=run["yplus_avg"], turbulence=TURBULENCE.get(run["turbulence"], run["turbulence"]), thrust_from="forces",
        steady_mrf=True, skew_deg=0.0 if math.isnan(run["sideslip_deg"]) else run["sideslip_deg"],
        mass_balance=run["balance_mass"], momentum_balance=run["balance_momentum"], ducted=conditions["ducted"],
    )  # fmt: skip


def _levels(item: Mapping[str, Any], found: Iterable[Mapping[str, Any]]) -> int:
    """Grids behind the uncertainty of a recording: its own study, else that of the same case."""
    rule = item["manifest"].get("rule")
    if not isinstance(rule, Mapping) or rule.get("grid_study") is not True:
        return 1
    sizes = [1]
    for other in (item, *(o for o in found if o["case"] == item["case"])):
        studies = other["manifest"].get("grid_studies")
        if isinstance(studies, list):
            sizes += [len(s["levels"]) for s in studies if isinstance(s, Mapping) and isinstance(s.get("levels"), list)]
    return max(sizes)


def _plain_rows(found: Sequence[Mapping[str, Any]], result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Runs of the bare case as rows like those of a sweep, each condition and flow once, finest grid."""
    c: Mapping[str, Any] = result.get("conditions") or {}
    best: dict[tuple[Any, ...], Mapping[str, Any]] = {}
    for item in found if c else ():
        if item["case"] != result["name"] or ("duct" in item["name"] and result.get("kind") != "fan"):
            continue
        for run in filter(is_plain, item["runs"]):
            if run["turbulence"] == "kOmegaSST":
                key = (run["solver"], round(run["rpm"], 3), round(run["airspeed_m_s"], 3))
                if key not in best or run["level"] > best[key]["level"]:
                    best[key] = run
    rows = []
    for run in best.values():
        n, D, rho = run["rpm"] / 60.0, c["diameter_m"], run["density_kg_m3"]
        power = 2 * math.pi * n * run["torque_Nm"]
        rows.append({
            "source": "openfoam" if run["solver"] == "compressible" else "openfoam incompressible",
            "label": f"{run['solver']}, {run['cells']:.0f} cells", "rpm": run["rpm"],
            "airspeed_m_s": run["airspeed_m_s"],
            "thrust_N": run["thrust_N"], "u": run["u_thrust_N"], "torque_Nm": run["torque_Nm"], "power_W": power,
            "CT": run["thrust_N"] / (rho * n**2 * D**4), "CP": power / (rho * n**3 * D**5),
        })  # fmt: skip
    return rows


def attach(book: dict[str, Any]) -> None:
    """Audit every run, and compare the run at a case's operating point with its BEMT.

    The uncertainty of the run is that of its audit, so it is unknown as long as one of its lines is.
    """
    found = book["cfd"]
    results = {page["result"]["name"]: page["result"] for page in book["cases"] if page["result"].get("conditions")}
    for item in found:
        result = results.get(item["case"])
        for run in item["runs"]:
            run["audit"] = None
            if result is not None:
                ducted = result.get("kind") == "fan" or "duct" in item["name"]
                facts = _facts(run, {**result["conditions"], "ducted": ducted}, _levels(item, found))
                run["audit"] = audit_document(f"{item['name']}: {run['run']}", audit(facts))
    for page in book["cases"]:
        result = page["result"]
        run = operating_run(found, result)
        page["own_cfd"] = run
        page["own_rows"] = _plain_rows(found, result)
        page["own_radial"] = radial_of(found, run) if run else []
        bemt = next((r for r in result.get("rows", []) if r["source"] == "bemt"), None)
        if run is None or bemt is None or bemt.get("thrust_N") is None:
            continue
        share = run["audit"]["u_relative"] if run["audit"] else math.nan
        S, D, u_D = bemt["thrust_N"], run["thrust_N"], abs(run["thrust_N"]) * share
        u_num, u_input, u_model = (
            math.nan if bemt.get(k) is None else bemt[k] for k in ("u_num", "u_input", "u_model")
        )
        line = Comparison("bemt", f"own CFD, {run['solver']}", "openfoam", "thrust_N", "N", S, D, u_num, u_input,
                          u_model, u_D, tuple(serious(bemt.get("flags", ()))))  # fmt: skip
        page["result"] = {**result, "comparisons": [*result["comparisons"], line.document()]}


FIDELITY_WORDS = (
    "The disk prescribes BEMT's load and shows what the wake does with it; resolved blades compute their own. "
    "The far wake of BEMT is drawn without contraction. CPU seconds; other work ran at the same time."
)


def fidelities(out: Path, cases: Sequence[str]) -> dict[str, Any]:
    """Loads (``disk/loads.csv``) and axial speeds behind the rotor (``disk/wake.csv``) of the report's own cases."""
    loads = [row for row in read_rows(out / "disk" / "loads.csv") if row.get("case") in cases]
    runs = {row.get("run"): row.get("source") for row in loads if row.get("run")}
    wake: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for row in read_rows(out / "disk" / "wake.csv"):
        if name := runs.get(row.get("run")):
            point = value(row.get("r_over_R")), value(row.get("axial_speed_m_s"))
            wake.setdefault((name, row.get("z_over_R", "")), []).append(point)
    return {"loads": loads, "wake": wake}


def fidelity_sections(found: Mapping[str, Any]) -> list[Section]:
    """Table of loads, and the axial speed at two distances behind."""
    rows = [[row["source"], num(value(row.get("J")), 2), num(value(row.get("thrust_N")), 4),
             num(value(row.get("torque_Nm")), 3), num(value(row.get("seconds")), 2), row.get("what", "")]
            for row in found["loads"]]  # fmt: skip
    heads = ["source", "J", "thrust [N]", "torque [N m]", "CPU [s]", "how"]
    plots = []
    places = {"0": " at the disk", "-inf": " far behind"}
    for behind in ("0.5", "2"):
        traces: list[Trace] = []
        for (name, at), points in found["wake"].items():
            if at == f"-{behind}" or at in places:
                i = len(traces)
                x, y = zip(*points, strict=True)
                traces.append(
                    Trace(name + places.get(at, ""), x, y, None, SERIES[i % len(SERIES)], DASHES[i % len(DASHES)])
                )
        if len(traces) > 1:
            title = f"Axial speed {behind} R behind the rotor, compared with BEMT"
            plots.append(figure(Plot(title, "r/R [-]", "axial speed [m/s]", traces)))
    return sections(("Loads and cost", [("table", table(heads, rows))] if rows else []), ("Wake", [("figures", plots)]))


KIND = {"fine": "fine", "doubtful": "doubtful", "fault": "fault", "not stated": "unknown"}


def _share(value: Any) -> str:
    return "unknown" if value is None or value != value else f"{100 * value:.1f} %"


def audit_parts(audit: Mapping[str, Any]) -> list[Part]:
    """Say what an audit comes to, and give its lines."""
    rows = []
    for line in audit["lines"]:
        u, status = line["u_relative"], str(line["status"])
        rows.append([str(line["topic"]), Cell(status, badge=KIND.get(status, "unknown")), str(line["finding"]),
                     str(line["consequence"]), num(None if u is None else 100 * u, 2, none="unknown")])  # fmt: skip
    known = audit["u_relative_known"]
    rest = f"the known parts make {_share(known)} together" if known else "no part of it is known"
    words = f"{audit['reference']}: uncertainty of the thrust {_share(audit['u_relative'])}; {rest}."
    head = ["setting", "status", "what is known", "consequence for the thrust", "u %"]
    return [("words", words), ("table", table(head, rows))]


CFD_WORDS = (
    "OpenFOAM runs on the solids of the cases: rotating frame, wall functions, forces integrated over the blades. "
    "Each run is audited like any other CFD result."
)

VARIED = (("J", "J [-]"), ("wall_distance_m", "distance of the plate [m]"), ("tip_gap_mm", "tip gap [mm]"),
          ("sideslip_deg", "angle of the inflow [deg]"), ("pitch_offset_deg", "offset of the blade angle [deg]"),
          ("cells", "cells [-]"))  # fmt: skip
COLUMNS = (("rpm", "rpm", 6), ("airspeed_m_s", "V [m/s]", 4), ("J", "J", 3), ("thrust_N", "T [N]", 4),
           ("u_thrust_N", "u [N]", 2), ("torque_Nm", "Q [N m]", 4), ("wall_distance_m", "plate [m]", 3),
           ("tip_gap_mm", "gap [mm]", 3), ("sideslip_deg", "skew [deg]", 3), ("pitch_offset_deg", "dβ [deg]", 3),
           ("cells", "cells", 6), ("yplus_avg", "y+", 3), ("drift_thrust", "drift", 2))  # fmt: skip


def study_parts(studies: Sequence[Mapping[str, Any]]) -> list[Part]:
    """Grid studies: a sentence and a picture each, values over the size of the cells down to zero."""
    figures = []
    for s in studies:
        h = [(s["cells"][0] / n) ** (1.0 / 3.0) for n in s["cells"]]
        unit = f" [{LOADS[s['channel']]}]" if LOADS[s["channel"]] else ""
        word = s["channel"].rsplit("_", 1)[0].replace("_", " ")
        words = [f"{n:,.0f} cells" for n in s["cells"]]
        u = [s["u_relative"] * abs(s["values"][0]), *[math.nan] * (len(h) - 1)]
        traces = [Trace("grids; on the finest its u", h, s["values"], u, COLOURS["cfd"], points=True, labels=words)]
        if s["order"] is not None:
            x = [k * max(h) / 40 for k in range(41)]
            y = [s["extrapolated"] + (s["values"][0] - s["extrapolated"]) * v ** s["order"] for v in x]
            traces.append(Trace(f"order {s['order']:.3g}", x, y, dash=DASHES[1]))
        plot = Plot(f"Grid study: {word} at {s.get('rpm', math.nan):g} rev/min", "cell size over the finest grid's",
                    word + unit, traces, note=f"{study_text(s)}.", zero=False, x_zero=True)  # fmt: skip
        figures.append(figure(plot))
    return [("figures", figures)] if figures else []


def _plots(item: Mapping[str, Any]) -> list[dict[str, Any] | None]:
    """Thrust and torque over the quantity that was varied most, one line per group of the others."""
    runs = [r for r in item["runs"] if r["converged"] == 1]

    def values(key: str) -> set[float]:
        return {round(r[key], 6) for r in runs if math.isfinite(r[key])}

    name, label = max(VARIED, key=lambda v: (len(values(v[0])), -VARIED.index(v)))
    if len(values(name)) < 2:
        return []
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for run in runs:
        words = [run["solver"], run["domain"], f"{run['rpm']:g} rev/min"]
        if name != "J" and len(values("J")) > 1:
            words.append(f"J {run['J']:.2g}")
        if len({r["turbulence"] for r in runs}) > 1:
            words.append(run["turbulence"])
        groups.setdefault(", ".join(words), []).append(run)
    if name == "cells" and len(values(name)) < 3:
        return []
    plots = []
    for key, word in (("thrust_N", "thrust [N]"), ("torque_Nm", "torque [N m]")):
        traces = []
        for i, (group, rows) in enumerate(groups.items()):
            rows = sorted(rows, key=lambda r: float(r[name]))
            x, y, u = [r[name] for r in rows], [r[key] for r in rows], [r[f"u_{key}"] for r in rows]
            look = SERIES[i % len(SERIES)], DASHES[i % len(DASHES)], SHAPES[i % len(SHAPES)]
            traces.append(Trace(group, x, y, u, *look, points=len(rows) == 1))
        plots.append(figure(Plot(f"{word.split(' [')[0].capitalize()}: {item['title']}", label, word, traces)))
    return plots


def _runs(item: Mapping[str, Any]) -> dict[str, Any] | None:
    used = [
        c
        for c in COLUMNS
        if any(math.isfinite(r[c[0]]) and (r[c[0]] != 0 or c[0] in ("J", "airspeed_m_s")) for r in item["runs"])
    ]
    rows = []
    for run in item["runs"]:
        audit = run.get("audit")
        u = None if not audit or audit["u_relative"] is None else 100 * audit["u_relative"]
        state = "settled" if run["converged"] == 1 else "did not settle"
        rows.append([run["run"][:6], run["solver"], run["domain"], *(num(run[key], digits) for key, _, digits in used),
                     num(u, 2, none="unknown"), state])  # fmt: skip
    return table(["run", "flow", "domain", *(label for _, label, _ in used), "u of T by audit [%]", "state"], rows)


def cfd_sections(found: Sequence[Mapping[str, Any]]) -> list[Section]:
    """Give the figures of all campaigns of this project's own CFD, then the runs and an audit of each."""
    figures, tables = [], []
    for item in found:
        figures += [*_plots(item), *(picture(name, data) for name, data in item["figures"])]
        first = next((run["audit"] for run in item["runs"] if run.get("audit")), None)
        parts = [("table", _runs(item)), *(audit_parts(first) if first else [])]
        tables.append(("more", (f"{item['title']}: {len(item['runs'])} runs, audit of the first", parts)))
    return sections(("Figures", [("figures", figures)]), ("Campaigns", tables))
