"""Run a list of CFD cases, resume where it stopped, record what came out."""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from filelock import FileLock, Timeout

from bemt.base.cache import cache_dir
from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError, refuse
from bemt.base.tables import number_text, remove_stale, speed_text, text_table
from bemt.data.recordings.cfd_setup import audit_of, faults_first, floor_note
from bemt.physics.bem import solver
from bemt.physics.bem.model import Model
from bemt.physics.dataset import Dataset
from bemt.physics.dataset.channels import channel_fault
from bemt.rotors.case import Case
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.case.propagate import parted
from bemt.tools.cfd.record import CampaignRecord, csv_rows, studies_of
from bemt.tools.cfd.schema import COLUMNS, TEXTS, Campaign, CampaignPoint, RunRow, Study, load_campaign, run_of
from bemt.tools.cfd.worker import Worker, point_key

if TYPE_CHECKING:
    from bemt.tools.cfd.openfoam import Settings


# All campaigns of a folder beside BEMT: one row a run, and the loads along the radius in bands.

BANDS = (0.15, 0.30, 0.45, 0.60, 0.75, 0.90, 1.0)
"""Edges of the bands. [R]"""
MACH_EFFECTS = ["compressibility", "drag_divergence"]


class _Bemt:
    """BEMT of the cases of the runs; without effects of Mach number beside incompressible flow."""

    def __init__(self) -> None:
        self.ready: dict[str, Model] = {}

    def solve(self, campaign: Campaign, row: RunRow) -> solver.Solution:
        case = _case_of(campaign, row)
        overrides: dict[str, object] = {}
        if row.solver == "incompressible":
            overrides["model.effects_off"] = sorted({*case.file.model.effects_off, *MACH_EFFECTS})
        vanes = case.get("duct.stator.blades")
        if vanes and row.sector == "blade" and vanes % case.rotor().B:
            overrides["duct.stator.recovery"] = 0.0  # left out of the grid
        changed = case.replaced(overrides)
        key = changed.file.model_dump_json()
        if key not in self.ready:
            self.ready[key] = prepare_case(changed)
        skew = 0.0 if math.isnan(row.sideslip_deg) else row.sideslip_deg
        V, side = parted(np.array(row.airspeed_m_s), np.array(skew))
        return solver.solve(self.ready[key].prep, row.rpm, V, case.air(), radial=True, side=side)


def _case_of(campaign: Campaign, row: RunRow) -> Case:
    """Case with the changes of the point that a run belongs to: blade angle, duct, gap; the plain one where none is."""
    pitch, gap = row.pitch_offset_deg, row.tip_gap_mm
    for point in campaign.points:
        own = point.case.get("duct.tip_gap_mm") if point.case.ducted else math.nan
        alike = math.isnan(gap) and math.isnan(own) or math.isclose(gap, own, rel_tol=1e-3)
        if alike and math.isclose(point.values.get("pitch_offset_deg", 0.0), 0.0 if math.isnan(pitch) else pitch):
            return point.case
    return campaign.case


def _bands(R: float, edges: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Share out loads of pieces between edges over the bands, evenly within each piece."""
    limits = np.array(BANDS) * R
    limits[-1] = max(limits[-1], edges[-1])
    total = np.concatenate([[0.0], np.cumsum(load)])
    return np.diff(np.interp(limits, edges, total))


def _edges(r: np.ndarray) -> np.ndarray:
    middle = 0.5 * (r[1:] + r[:-1])
    return np.concatenate([[2 * r[0] - middle[0]], middle, [2 * r[-1] - middle[-1]]])


class Bands(Documented):
    """Loads of the blades in bands of the radius, and where BEMT's sections stand [deg]."""

    edges_over_R: tuple[float, ...]
    cfd_thrust_N: tuple[float, ...]
    bemt_thrust_N: tuple[float, ...]
    cfd_torque_Nm: tuple[float, ...]
    bemt_torque_Nm: tuple[float, ...]
    bemt_alpha_deg: tuple[float, ...]


class Compared(Documented):
    """A run beside BEMT."""

    cells: Mapping[str, str]  # Line of the recording as written
    run: RunRow
    bemt_thrust_N: float
    bemt_torque_Nm: float
    radial: Bands | None

    def document(self) -> dict[str, Any]:
        """Line of the summary."""
        return {**self.cells, "bemt_thrust_N": self.bemt_thrust_N, "bemt_torque_Nm": self.bemt_torque_Nm,
                "radial": self.radial and self.radial.document()}  # fmt: skip


class CampaignSummary(Documented):
    """One campaign."""

    name: str
    title: str
    points: int
    recorded: int
    converged: int
    balanced: int
    grid_studies: tuple[Study, ...]
    rows: tuple[Compared, ...]


class Summary(Documented):
    """All campaigns of a folder."""

    schema: str
    campaigns: tuple[CampaignSummary, ...]


def _radial(campaign: Campaign, run: str, found: solver.Solution) -> Bands | None:
    rows = [row for row in csv_rows(campaign.path.parent / "radial.csv") if row["run"] == run]
    if not rows:
        return None
    names = ("r_m", "thrust_per_radius_N_m", "torque_per_radius_Nm_m")
    r, dT, dQ = (np.array([float(row[name]) for row in rows]) for name in names)
    R = 0.5 * campaign.case.diameter_m
    at = solver.Radial(*(v[0] for v in found.radial))
    edges = _edges(at.r)
    a, b, c, d = (
        tuple(_bands(R, ends, load).tolist())
        for recorded, solved in ((dT, at.dT), (dQ, at.dQ))
        for ends, load in ((_edges(r), recorded * np.diff(_edges(r))), (edges, solved))
    )
    alpha = (
        float(np.degrees(np.interp((a + b) * R / 2, at.r, at.alpha))) for a, b in zip(BANDS, BANDS[1:], strict=False)
    )
    return Bands(BANDS, a, b, c, d, tuple(alpha))


def summary(folder: str | Path) -> Summary:
    """Collect the recordings of all campaigns in a folder and solve their points by BEMT."""
    folder = Path(folder)
    paths = sorted(folder.glob("*/campaign.toml"))
    if not paths:
        raise InputError(Fault(folder.as_posix(), "", "no campaign", "campaign.toml, or folders with one each"))
    model, out = _Bemt(), []
    for path in paths:
        campaign = load_campaign(path)
        rows = []
        for cells in csv_rows(path.parent / "recording.csv"):
            run = run_of(cells)
            found = model.solve(campaign, run)
            radial = _radial(campaign, run.run, found)
            rows.append(Compared(cells, run, float(found.T[0]), float(found.Q[0]), radial))
        settled = [row.run for row in rows if row.run.settled]
        balanced = sum(not math.isnan(run.balance_mass) for run in settled)
        out.append(CampaignSummary(campaign.name, campaign.title, len(campaign.points), len(rows), len(settled),
                                   balanced, studies_of(path.parent), tuple(rows)))  # fmt: skip
    return Summary("bemt.cfd-summary/1", tuple(out))


def _leak(run: RunRow) -> str:
    sizes = [abs(size) for size in (run.balance_mass, run.balance_momentum, run.balance_angular_momentum)]
    known = [size for size in sizes if not math.isnan(size)]
    return number_text(100 * max(known), 2) if known else "-"


def summary_text(found: Summary) -> str:
    """Give the summary as tables."""
    lines = []
    counts = [[c.name, *map(str, (c.points, c.recorded, c.converged, c.balanced))] for c in found.campaigns]
    counts.append(["all", *(str(sum(int(row[k]) for row in counts)) for k in (1, 2, 3, 4))])
    lines.append(text_table(["campaign", "points", "run", "converged", "and balanced"], counts))
    head = ["run", "solver", "level", "cells", "rpm", "J", "other", "T [N]", "u", "BEMT", "Q [N m]", "u", "BEMT", "y+",
            "leak [%]"]  # fmt: skip
    # leak: the largest residual of mass, momentum and angular momentum; empty where none was written
    for campaign in found.campaigns:
        rows = []
        for row in campaign.rows:
            r = row.run
            other = [f"{word} {value:.7g}" for value, word in (
                (r.wall_distance_m, "plate m"), (r.tip_gap_mm, "gap mm"), (r.sideslip_deg, "wind deg"),
                (r.pitch_offset_deg, "pitch deg")) if value and not math.isnan(value)]  # fmt: skip
            other += [r.domain] if r.domain != "free" else []
            other += [r.turbulence] if r.turbulence != "kOmegaSST" else []
            other += ["energy equation"] if r.gas == "perfect" else []
            rows.append([r.run[:6], r.solver, f"{r.level:g}", f"{r.cells:.0f}", f"{r.rpm:.7g}", number_text(r.J, 3),
                         ", ".join(other), number_text(r.thrust_N), number_text(r.u_thrust_N, 2),
                         number_text(row.bemt_thrust_N), number_text(r.torque_Nm), number_text(r.u_torque_Nm, 2),
                         number_text(row.bemt_torque_Nm), number_text(r.yplus_avg, 3), _leak(r)])  # fmt: skip
        lines += ["", f"{campaign.name}: {campaign.title}"]
        lines.append(text_table(head, rows, left=(0, 1, 6)) if rows else "  nothing has run yet")
        for study in campaign.grid_studies:
            words = []
            for key in ("thrust_N", "torque_Nm"):
                of = study.of(key)
                gci = number_text(math.nan if of.gci_fine is None else 100 * of.gci_fine, 2)
                said = f": {'; '.join(of.flags)}" if of.flags else ""
                order, limit = number_text(of.order, 3), number_text(of.extrapolated)
                words.append(f"{key} order {order}, limit {limit}, GCI {gci} %{said}")
            levels = ", ".join(f"{level:g}" for level in study.levels)
            lines.append(f"  grid study {study.solver} levels {levels}: {' | '.join(words)}")
    return "\n".join([*lines, *_radial_text(found)]) + "\n"


def _radial_text(found: Summary) -> list[str]:
    lines = ["", "Loads along the radius, CFD / BEMT, in bands of r/R"]
    rows, seen = [], set()
    for campaign in found.campaigns:
        for row in campaign.rows:
            r, table = row.run, row.radial
            plain = r.domain == "free" and math.isnan(r.wall_distance_m) and math.isnan(r.tip_gap_mm)
            if table is None or not plain or r.run in seen or r.rpm < 20000:
                continue
            seen.add(r.run)
            for key, ours, theirs in (("thrust_N", table.cfd_thrust_N, table.bemt_thrust_N),
                                      ("torque_Nm", table.cfd_torque_Nm, table.bemt_torque_Nm)):  # fmt: skip
                cells = [f"{number_text(a, 3)} / {number_text(b, 3)}" for a, b in zip(ours, theirs, strict=True)]
                rows.append([campaign.name, r.solver, f"{r.level:g}", number_text(r.J, 2), key, *cells])
            angles = [f"{a:.1f}" for a in table.bemt_alpha_deg]
            rows.append(["", "", "", "", "BEMT alpha [deg]", *angles])
    heads = [f"{a:.2f}-{b:.2f}" for a, b in zip(BANDS, BANDS[1:], strict=False)]
    lines.append(text_table(["campaign", "solver", "level", "J", "load", *heads], rows, left=(0, 1, 4)))
    return lines


def _keys(campaign: Campaign, only: int | None) -> list[tuple[str, str, Settings]]:
    """Run, grid and settings of each point; all faults at once."""
    file = campaign.path.as_posix()
    keys: list[tuple[str, str, Settings]] = []
    faults: list[Fault] = []
    for k, point in enumerate(campaign.points, 1):
        try:
            keys.append(point_key(point))
        except InputError as error:
            faults += [Fault(file, f"point {k}: {f.where}", f.got, f.expected, f.hint) for f in error.faults]
    if only is not None and not 1 <= only <= len(campaign.points):
        faults.append(Fault("", "--only", str(only), f"1 to {len(campaign.points)}"))
    order = [name for name, _, _ in keys]
    if not faults and len(set(order)) < len(order):
        twice = sorted({str(order.index(name) + 1) for name in order if order.count(name) > 1})
        faults.append(Fault(file, f"points {', '.join(twice)}", "the same run twice", "each once"))
    refuse(faults)
    return keys


def _said(point: CampaignPoint) -> str:
    """What a point asks for, in words."""
    shown = {k: v for k, v in point.values.items() if k not in ("iterations", "average", "start")}
    return ", ".join(f"{k} {v:g}" if isinstance(v, float) else f"{k} {v}" for k, v in shown.items())


def run_campaign(
    campaign: Campaign, work: Path, only: int | None = None, ranks: int = 2,
    tell: Callable[[str], None] | None = None, keep: bool = True,
) -> CampaignRecord:  # fmt: skip
    """Run the points of a campaign that are not recorded yet."""
    keys = _keys(campaign, only)
    order = [name for name, _, _ in keys]
    remove_stale(campaign.path.parent)
    record = CampaignRecord(campaign)
    record.borrow(order if only is None else [])
    record.write(order)
    fresh = not work.exists()
    work.mkdir(parents=True, exist_ok=True)

    say = tell or (lambda line: None)
    worker = Worker(work, ranks, keep)
    for k, (point, key) in enumerate(zip(campaign.points, keys, strict=True), 1):
        if (only is not None and k != only) or (only is None and key[0] in record.done):
            continue
        say(f"{campaign.name} {k}/{len(campaign.points)}: {_said(point)}")
        outcome = worker.run(point, key)
        record.add(outcome, order)
        v = outcome.row
        state = "" if v.converged else f"  NOT CONVERGED {v.note}"
        say(f"  T {number_text(v.thrust_N)} N, Q {number_text(v.torque_Nm)} N m, {v.cells} cells, "
             f"{v.seconds:.0f} s{state}")  # fmt: skip
        if not v.iterations:
            say(f"  nothing was computed: it will be tried again; logs below {work}")
    record.write(order)
    if not keep and only is None:  # a single point is tried again and again: its grid waits for the whole campaign
        worker.clear([key[:2] for key in keys])
        if fresh:
            _remove_empty(work)
    return record


def _remove_empty(folder: Path) -> None:
    """Remove a folder unless something is in it."""
    with contextlib.suppress(OSError):
        folder.rmdir()


def text(record: CampaignRecord) -> str:
    """Lay a record out for a terminal."""
    head = ["run", "rpm", "V [m/s]", "T [N]", "u [N]", "Q [N m]", "solver", "level", "cells", "drift T [%]", "y+", "s"]
    rows = []
    for r in record.rows:
        rows.append([r.run, speed_text(r.rpm), number_text(r.airspeed_m_s), number_text(r.thrust_N),
                     number_text(r.u_thrust_N, 2), number_text(r.torque_Nm), r.solver, number_text(r.level),
                     f"{r.cells:.0f}", number_text(100 * r.drift_thrust, 2), number_text(r.yplus_avg, 3),
                     number_text(r.seconds, 3)])  # fmt: skip
    lines = [f"{record.campaign.name}: {record.campaign.title}", text_table(head, rows, left=(0, 6))]
    return "\n".join([*lines, *_audit_lines(record)])


def _audit_lines(record: CampaignRecord) -> list[str]:
    """What the audit of other people's CFD says of our own, and what u is where there is no grid study."""
    solved = [row for row in record.rows if row.settled]
    if not solved:
        return []
    case = record.campaign.case
    flies = [row.airspeed_m_s > 0 for row in solved]
    out = [] if record.studies() else [floor_note(any(flies), all(flies))]
    found = named_rows(solved[:1])
    pitch = float(prepare_case(case).pitch_m)
    lines = audit_of(found, case.diameter_m, pitch, case.ducted, float(case.air().a_sound))
    lines = tuple(x for x in lines if not (record.studies() and x.topic == "grid study"))
    return [*out, *(f"audit, {x.status}: {x.topic}: {x.finding}: {x.consequence}" for x in faults_first(lines))]


def named_rows(rows: Sequence[RunRow]) -> Dataset:
    """Rows of a campaign as a recording."""
    texts = {k: tuple(str(getattr(r, k)) for r in rows) for k in COLUMNS if k in TEXTS}
    numbers = {k: np.array([float(getattr(r, k)) for r in rows]) for k in COLUMNS if k not in TEXTS}
    units = {k: "" for k in numbers if channel_fault(k)}
    return Dataset("cfd", "campaign", numbers, units=units, texts=texts)


def document(record: CampaignRecord) -> dict[str, Any]:
    """Give a record as ``bemt.cfd-run/1``."""
    return {
        "schema": "bemt.cfd-run/1",
        "campaign": record.campaign.name,
        "rows": [row.document() for row in record.rows],
    }


def is_folder_of_campaigns(path: str | Path) -> bool:
    """Whether a path is a folder without a campaign of its own: its campaigns are summed up, nothing runs."""
    return Path(path).is_dir() and not (Path(path) / "campaign.toml").is_file()


def run(
    path: str, only: int | None = None, ranks: int = 2, work: str | None = None, keep: bool = False,
    tell: Callable[[str], None] | None = None,
) -> CampaignRecord:  # fmt: skip
    """Read a campaign and run it in a folder that goes afterwards unless it is named or kept."""
    campaign = load_campaign(path)
    for program in ("blockMesh", "snappyHexMesh", "simpleFoam"):
        if shutil.which(program) is None:
            hint = "Debian and Ubuntu: the package openfoam"
            raise InputError(Fault("", "", f"no program {program}", "OpenFOAM", hint))
    named = work or os.environ.get("BEMT_CFD_WORK")
    folder = Path(named) if named else _own_folder(campaign)
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # so that the solver ends with us
    try:
        with _locked(folder):
            record = run_campaign(campaign, folder, only, ranks, tell, keep)
    finally:
        signal.signal(signal.SIGTERM, before)
    if not named and not keep:
        _remove_empty(folder)  # made by us, now or before we were stopped
    return record


def _own_folder(campaign: Campaign) -> Path:
    """Work folder of a campaign, in the cache, which is the user's own; without a cache a new private one."""
    cache = cache_dir()
    if cache is None:
        return Path(tempfile.mkdtemp(prefix="bemt-cfd-"))
    where = hashlib.sha256(str(campaign.path.resolve()).encode()).hexdigest()[:12]
    folder = cache / "cfd" / f"{campaign.name}-{where}"
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.parent.chmod(0o700)
    return folder


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold a work folder for one campaign at a time."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    place = folder.parent / f".{folder.name}.lock"
    lock = FileLock(place)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        hint = "Wait for it, or give another folder: --work DIR"
        raise InputError(
            Fault(folder.as_posix(), "", "a work folder in use by another campaign", "a free one", hint)
        ) from None
    try:
        yield
    finally:
        place.unlink(missing_ok=True)
        lock.release()
