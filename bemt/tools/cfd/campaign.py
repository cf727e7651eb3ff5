"""Run a list of CFD cases, resume where it stopped, record what came out."""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from filelock import FileLock, Timeout

from bemt.base.cache import cache_dir
from bemt.base.errors import Fault, InputError, refuse
from bemt.base.tables import number_text, remove_stale, speed_text, text_table
from bemt.data.recordings.cfd_setup import audit_of, faults_first, floor_note
from bemt.physics.dataset import Dataset
from bemt.physics.dataset.channels import channel_fault
from bemt.rotors.case.prepare import prepare_case
from bemt.tools.cfd.record import CampaignRecord
from bemt.tools.cfd.schema import COLUMNS, TEXTS, Campaign, CampaignPoint, RunRow, load_campaign
from bemt.tools.cfd.worker import Worker, point_key

if TYPE_CHECKING:
    from bemt.tools.cfd.openfoam import Settings


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
