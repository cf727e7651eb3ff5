"""One CFD run: grid (shared by runs of one geometry), start, solver, what came out."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.averaging import steady_average
from bemt.base.document import Documented
from bemt.base.errors import InputError
from bemt.base.tables import write_atomic
from bemt.tools.cfd.balance import balance_of
from bemt.tools.cfd.openfoam import Settings, case_files
from bemt.tools.cfd.openfoam.run import BINS, control
from bemt.tools.cfd.openfoam.write import settings_of, write_openfoam
from bemt.tools.cfd.schema import CampaignPoint, RunRow

# Start of a run from the flow of another on the same grid: internal fields, scaled by similarity.
#
# Velocities go with the speed of rotation, pressures with its square; the change of the wind is added. Boundary
# conditions are those of the new run.

_FIELD = re.compile(rb"internalField\s+nonuniform\s+List<(scalar|vector)>\s*(\d+)\s*\(")
_UNIFORM = re.compile(rb"internalField\s+uniform[^;]*;")
POWERS = {"U": 1, "p": 2, "k": 2, "omega": 1, "epsilon": 3, "nut": 1}


class StartField(Documented):
    """What a flow was computed for."""

    rpm: float  # Speed [rev/min]
    wind: tuple[float, float, float]  # Velocity far away [m/s]
    pressure: float  # Static pressure far away; 0 for kinematic pressures [Pa]
    compressible: bool  # Whether pressures are absolute


def splice(name: str, source: bytes, target: bytes, old: StartField, new: StartField) -> bytes | None:
    """Put the internal field of one file, scaled, into another."""
    found, place = _FIELD.search(source), _UNIFORM.search(target)
    power = POWERS.get(name)
    if found is None or place is None or power is None or (name == "p" and old.compressible != new.compressible):
        return None
    width = 3 if found[1] == b"vector" else 1
    count = int(found[2])
    data = source[found.end() : found.end() + 8 * width * count]
    if len(data) != 8 * width * count:
        return None
    values = np.frombuffer(data, dtype="<f8").reshape(count, width)
    ratio = (new.rpm / old.rpm) ** power
    if name == "p":
        values = new.pressure + (values - old.pressure) * ratio
    else:
        values = values * ratio
    if name == "U":
        values = values + (np.array(new.wind) - np.array(old.wind) * ratio)
    if not np.all(np.isfinite(values)):
        return None
    head = b"internalField   nonuniform List<" + found[1] + b">\n" + str(count).encode() + b"\n("
    body = head + np.ascontiguousarray(values, dtype="<f8").tobytes() + b")\n;"
    text = target[: place.start()] + body + target[place.end() :]
    return re.sub(rb"format\s+ascii;", b"format binary;", text, count=1)


DRIFT_LIMIT = 0.03
"""Change over the averaged iterations, of the mean, above which a run counts as not converged."""
SCATTER_LIMIT = 0.05
"""Standard deviation over the averaged iterations, of the mean, above which it counts as not converged."""
RESIDUALS = ("balance_mass", "balance_momentum", "balance_angular_momentum", "swirl_out")
"""Columns of what :class:`bemt.tools.cfd.balance.Balance` holds."""
TEMPORARY = "temporary"
"""File in a folder of grid or run that may go when its campaign has ended."""
NOTE_LENGTH = 800
"""Characters of a program's last lines that a note keeps."""
GRID_FILES = ("system/blockMeshDict", "system/snappyHexMeshDict", "system/topoSetDict", "system/createPatchDict",
              "constant/triSurface/lines.obj")  # fmt: skip
_WATCH = 'read word || { kill -TERM -"$1"; sleep 2; kill -KILL -"$1"; }'
"""Ends the processes of a solver when ours is gone without a word, as after kill -9."""


def _digest(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def point_key(point: CampaignPoint) -> tuple[str, str, Settings]:
    """Name a run and its grid by all that decides them.

    The number of ranks, the place of the files and what is written down for the balance do not count.
    """
    settings, parts = settings_of(point.case, point.run)
    files = case_files(settings) | {"system/controlDict": control(settings, balance=False)}
    wall = None if parts.duct is None else parts.duct.key()
    shape = f"{parts.rotor.key()}|{wall}|{None if parts.tail is None else parts.tail.round(9).tolist()}"
    body = [f"{name}\n{text}" for name, text in sorted(files.items()) if name != "Allrun"]
    grid = _digest(shape, *(files[name] for name in GRID_FILES))
    return _digest(shape, *body, str(settings.average), str(point.warm))[:12], grid[:12], settings


@dataclass
class Outcome:
    """What a run gave."""

    row: RunRow  # Line of the recording
    history: Array | None = None  # (N, 3) iteration, thrust [N], torque [N m] of the whole rotor
    radial: Array | None = None  # (M, 3) radius [m], thrust and torque of all blades per radius [N/m, N m/m]


def history_of(folder: Path, settings: Settings) -> Array:
    """Read the loads of a run: rotor, and all that stands on the same mount, (N, 4)."""
    from bemt.data.readers import read

    def column(name: str, file: str, channel: str) -> Array:
        return np.asarray(read(folder / "postProcessing" / name / "0" / file, "openfoam_forces")[channel])

    force, moment = (
        column("forces", "force.dat", "force_total_z_N"),
        column("forces", "moment.dat", "moment_total_z_Nm"),
    )
    other = np.zeros_like(force)
    if any(name != "plate" for name in settings.walls):
        other = column("standing", "force.dat", "force_total_z_N")
    n = min(len(force), len(moment), len(other))
    parts = settings.sectors
    return np.column_stack([np.arange(1.0, n + 1), parts * force[:n], -settings.rotation * parts * moment[:n],
                            parts * other[:n]])  # fmt: skip


def radial_of(folder: Path, settings: Settings, last: int) -> Array | None:
    """Read the loads of the blades along the radius, (M, 3).

    Bins are those of x, along blade 1: within 1 - cos of the blade's half angle of the radius.
    """
    loads = []
    for file in ("forceBin.dat", "momentBin.dat"):
        path = folder / "postProcessing" / "radial" / "0" / file
        if not path.is_file():
            return None
        text = path.read_text(encoding="ascii", errors="replace")
        about = dict(re.findall(r"^# (start|delta)\s+: (\S+)", text, re.M))
        rows = [[float(w) for w in line.replace("(", " ").replace(")", " ").split()]
                for line in text.splitlines() if line and not line.startswith("#")]  # fmt: skip
        rows = [row for row in rows if len(row) == 1 + 9 * BINS]
        if not rows or len(about) < 2:
            return None
        table = np.array(rows)
        table = table[table[:, 0] > table[-1, 0] - last]
        loads.append(table[:, 1:].mean(axis=0).reshape(BINS, 3, 3)[:, 0, 2])
    start, delta = float(about["start"]), float(about["delta"])
    r = start + delta * (np.arange(BINS) + 0.5)
    parts = settings.sectors
    return np.column_stack([r, parts * loads[0] / delta, -settings.rotation * parts * loads[1] / delta])


def _y_plus(folder: Path) -> float:
    path = folder / "postProcessing" / "yPlus" / "0" / "yPlus.dat"
    rows = [line.split() for line in path.read_text().splitlines()] if path.is_file() else []
    found = [float(row[4]) for row in rows if len(row) == 5 and row[1] == "blade"]
    return found[-1] if found else math.nan


def _grid_report(folder: Path) -> tuple[int, str]:
    path = folder / "log.checkMesh"
    text = path.read_text(errors="replace") if path.is_file() else ""
    cells = re.search(r"^\s*cells:\s+(\d+)", text, re.M)
    bad = re.findall(r"\*\*\*([^\n]*)", text)
    return (int(cells[1]) if cells else 0), "; ".join(bad) or "ok"


def _last_words(out: Path) -> str:
    """Why a step of Allrun failed: which program, and the end of its log."""
    text = out.read_text(errors="replace") if out.is_file() else ""
    lines = [" ".join(line.split()) for line in text.splitlines() if line.strip()]
    head = [k for k, line in enumerate(lines) if " failed; the end of log." in line]
    if not head:
        return " | ".join(lines[-3:])[-NOTE_LENGTH:]
    end = " | ".join(lines[head[-1] + 1 :])
    return f"{lines[head[-1]]} {end[-NOTE_LENGTH:]}".strip()


@dataclass
class Worker:
    """Runs points in a work folder."""

    work: Path  # Folder of grids and runs
    ranks: int = 1  # Processes of a run
    # Whether the folders made there stay for good; else they are marked, and :meth:`clear` removes them
    keep: bool = True

    def _own(self, folder: Path) -> None:
        """Mark a folder as one that goes at the end, or as one that stays."""
        if self.keep:
            (folder / TEMPORARY).unlink(missing_ok=True)
        else:
            write_atomic(folder / TEMPORARY, "")

    def clear(self, keys: Iterable[tuple[str, str]]) -> None:
        """Remove the folders of some runs that were made here without `keep`, and nothing else."""
        for run, grid in keys:
            for folder in [self.work / f"run-{run}", *self.work.glob(f"grid-{grid}-*")]:
                if (folder / TEMPORARY).is_file():
                    shutil.rmtree(folder, ignore_errors=True)

    def _program(self, folder: Path, step: str) -> int:
        """Run one step of Allrun; its processes end with us."""
        with (folder / f"out.{step}").open("wb") as stream:
            process = subprocess.Popen(["./Allrun", step], cwd=folder, stdout=stream, stderr=subprocess.STDOUT,
                                       env={**os.environ, "NP": str(self.ranks)}, start_new_session=True)  # fmt: skip
            quiet: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
            watch = subprocess.Popen(["/bin/sh", "-c", _WATCH, "sh", str(process.pid)], stdin=subprocess.PIPE, **quiet)
            try:
                return process.wait()
            except BaseException:
                os.killpg(process.pid, signal.SIGTERM)
                process.wait()
                raise
            finally:
                watch.communicate(b"ended\n")

    def _places(self, folder: Path) -> list[Path]:
        return [folder] if self.ranks == 1 else sorted(folder.glob("processor*"))

    def grid(self, point: CampaignPoint, key: str) -> Path:
        """Make the grid of a point, or find it."""
        folder = self.work / f"grid-{key}-{self.ranks}"
        if (folder / "done").is_file():
            if self.keep:
                self._own(folder)
            return folder
        shutil.rmtree(folder, ignore_errors=True)
        self._own(folder)
        write_openfoam(point.case, folder, point.run)
        begin = time.monotonic()
        if self._program(folder, "mesh") != 0:
            (folder / TEMPORARY).unlink(missing_ok=True)  # its logs stay to be read
            raise RuntimeError(f"grid: {_last_words(folder / 'out.mesh')}")
        write_atomic(folder / "done", f"{time.monotonic() - begin:.1f}\n")
        return folder

    def _prepare(self, point: CampaignPoint, run: str, grid: str, settings: Settings) -> tuple[Path, str]:
        """Case folder with its grid and, where there is one, the flow of a neighbour."""
        source = self.grid(point, grid)
        folder = self.work / f"run-{run}"
        shutil.rmtree(folder, ignore_errors=True)
        self._own(folder)
        for name, text in case_files(settings, point.case.title).items():
            write_atomic(folder / name, text)
        os.chmod(folder / "Allrun", 0o755)
        for place in self._places(source):
            mesh = place.relative_to(source) / "constant" / "polyMesh"
            shutil.copytree(source / mesh, folder / mesh, copy_function=os.link)
        for name in ("log.checkMesh", "system/decomposeParDict"):
            if (source / name).is_file():
                shutil.copy(source / name, folder / name)
        started = self._warm(folder, grid, settings) if point.warm else ""
        return folder, started or "slipstream"

    def _neighbour(self, grid: str, new: StartField) -> tuple[Path, StartField] | None:
        """Nearest finished run on a grid: by advance ratio, then solver, then speed."""
        found = []
        for path in sorted(self.work.glob("run-*/state.json")):
            about = json.loads(path.read_text(encoding="utf-8"))
            if about.pop("grid") == grid and about.pop("ranks") == self.ranks:
                old = StartField.from_document(about)
                gap = np.array(new.wind) / new.rpm - np.array(old.wind) / old.rpm
                away = 1e3 * float(np.linalg.norm(gap)) + 2.0 * (old.compressible != new.compressible)
                found.append((away + abs(math.log(new.rpm / old.rpm)), path.parent.name, old))
        if not found:
            return None
        _, name, old = min(found, key=lambda item: item[:2])
        return self.work / name, old

    def _warm(self, folder: Path, grid: str, settings: Settings) -> str:
        new = _state(settings)
        nearest = self._neighbour(grid, new)
        if nearest is None:
            return ""
        before, old = nearest
        for place in self._places(before):
            times = [p for p in place.iterdir() if p.name.isdigit() and p.name != "0"]
            if not times:
                return ""
            latest = max(times, key=lambda p: int(p.name))
            target = folder / "warm" / place.relative_to(before) / "0"
            for initial in sorted((folder / "0.orig").iterdir()):
                if (latest / initial.name).is_file():
                    data = splice(initial.name, (latest / initial.name).read_bytes(), initial.read_bytes(), old, new)
                    if data is not None:
                        write_atomic(target / initial.name, data)
        write_atomic(folder / "start", "#!/bin/sh\ncp -r warm/. .\n")
        os.chmod(folder / "start", 0o755)
        return before.name.removeprefix("run-")

    def run(self, point: CampaignPoint, keys: tuple[str, str, Settings] | None = None) -> Outcome:
        """Run one point."""
        name, grid, settings = keys or point_key(point)
        begin = time.monotonic()
        row = _row(point, settings, name)
        history, radial, note, failed = None, None, "", ""
        try:
            folder, start = self._prepare(point, name, grid, settings)
            cells, note = _grid_report(folder)
            row = replace(row, start=start, cells=cells)
            code = self._program(folder, "solve")
            if code != 0:  # said before the loads are read: there may be none
                failed = _last_words(folder / "out.solve")
            history = history_of(folder, settings)
            row, said = _balanced(row, folder, settings, len(history))
            failed = " ".join(words for words in (failed, said) if words)
            row, moving = _means(row, history, settings, code, not said)
            failed = " ".join(words for words in (failed, moving) if words)
            row = replace(row, yplus_avg=_y_plus(folder))
            radial = radial_of(folder, settings, settings.average)
            if code == 0:
                about = {"grid": grid, "ranks": self.ranks, **_state(settings).document()}
                write_atomic(folder / "state.json", json.dumps(about) + "\n")
        except (RuntimeError, InputError, OSError) as error:
            failed = failed or str(error)[: NOTE_LENGTH + 100]
            (self.work / f"run-{name}" / TEMPORARY).unlink(missing_ok=True)  # its logs stay to be read
        note = " ".join(words for words in (note, failed) if words)
        row = replace(row, seconds=round(time.monotonic() - begin, 1), note=note.replace("\n", " "))
        return Outcome(row, history, radial if row.converged else None)


def _state(s: Settings) -> StartField:
    return StartField(s.rpm, s.wind, s.pressure if s.compressible else 0.0, s.compressible)


def _row(point: CampaignPoint, s: Settings, name: str) -> RunRow:
    """What is known of a run beforehand; results are NaN until they are there."""
    nan = math.nan
    return RunRow(
        name, s.rpm, s.V, s.V / (s.rpm / 60 * 2 * s.R), density_kg_m3=s.rho, temperature_C=s.temperature - 273.15,
        pressure_Pa=s.pressure, wall_distance_m=nan if s.plate_z is None else -s.plate_z,
        tip_gap_mm=nan if s.duct is None else 1e3 * s.gap, sideslip_deg=point.run.sideslip_deg,
        pitch_offset_deg=point.values.get("pitch_offset_deg", 0.0),
        solver="compressible" if s.compressible else "incompressible", gas=s.gas if s.compressible else "",
        domain=s.domain, sector=s.sector, turbulence=s.turbulence, level=s.level, cells=0, iterations=0,
        averaged=s.average, converged=0,
    )  # fmt: skip


def _balanced(row: RunRow, folder: Path, s: Settings, done: int) -> tuple[RunRow, str]:
    """Fill in the residuals; say what keeps the run from balancing, empty when it does."""
    if done < s.iterations:
        return row, f"stopped after {done} of {s.iterations} iterations"
    try:
        found = balance_of(folder, s)
    except InputError as error:
        return row, f"not balanced: {str(error)[:NOTE_LENGTH]}"
    row = replace(row, balance_mass=found.mass, balance_momentum=found.momentum,
                  balance_angular_momentum=found.angular_momentum, swirl_out=found.swirl)  # fmt: skip
    return row, f"does not balance: {'; '.join(found.leaks)}" if found.leaks else ""


def _means(row: RunRow, history: Array, s: Settings, code: int, balanced: bool) -> tuple[RunRow, str]:
    """Fill in means, drift and scatter; the means stay NaN unless the run converged and balances. Says what moves."""
    row = replace(row, iterations=len(history))
    if len(history) < s.average:
        return row, ""
    share = s.average / len(history)
    total = history[:, 1] + history[:, 3]
    why: list[str] = []
    means = []
    for key, series in (("thrust", total), ("torque", history[:, 2])):
        average = steady_average(series, share)
        if average.mean is None:
            return row, f"{key}: {average.problem}"
        scale = max(abs(average.mean), 1e-12)
        drift = math.nan if average.drift is None else average.drift
        scatter = float(np.std(series[-s.average :])) / scale
        row = replace(row, **{f"drift_{key}": drift, f"scatter_{key}": scatter})  # type: ignore[arg-type]
        means.append(average.mean)
        if not abs(drift) <= DRIFT_LIMIT:
            why.append(f"{key} drifts by {drift:+.1%} over the last {s.average} iterations (limit {DRIFT_LIMIT:.0%})")
        if not scatter <= SCATTER_LIMIT:
            text = f"{key} scatters by {scatter:.1%} over the last {s.average} iterations (limit {SCATTER_LIMIT:.0%})"
            why.append(text)
    if code == 0 and balanced and not why:
        rotor, standing = (float(history[-s.average :, k].mean()) for k in (1, 3))
        row = replace(row, thrust_N=means[0], torque_Nm=means[1], converged=1, thrust_rotor_N=rotor,
                      thrust_standing_N=standing)  # fmt: skip
    return row, "; ".join(why)
