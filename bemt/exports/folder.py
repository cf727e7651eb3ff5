"""What an export leaves in a folder: files, one manifest, nothing of an earlier export that is not asked for."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bemt.base.errors import Fault, InputError
from bemt.base.tables import file_hash, number_text, plain, text_table, write_atomic
from bemt.base.toml import shown
from bemt.case import Case, find_cases, load_case, repeated_names
from bemt.exports import exports
from bemt.exports.base import FEATURES, Job, entry
from bemt.exports.openfoam.write import Run, check_run, settings_of, write_openfoam
from geometry.common import GeometryError
from geometry.export import MANIFEST, SCHEMA, export
from geometry.mesh import Options

NAMES = {
    "rpm": "--rpm",
    "airspeed_m_s": "--airspeed",
    "sideslip_deg": "--sideslip-deg",
    "level": "--level",
    "domain": "--domain",
    "sector": "--sector",
    "turbulence": "--turbulence",
    "solver": "--compressible",
}
"""Options that say at which point and what a target is to compute."""


def export_case(
    case: Case,
    out: Path,
    formats: list[str],
    unit: str = "mm",
    options: Options | None = None,
    flow: Run | None = None,
    hold: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Write one case for one or more targets."""
    earlier = _listed(out)
    run = flow or Run()
    targets, contents = _targets(case, formats, run, hold)
    solid = [word for word in dict.fromkeys(formats) if exports()[word].kind == "solid"]
    others = [word for word in solid if word != "openfoam"]
    if "openfoam" in formats:
        settings_of(case, run, options)  # its faults come before anything is written
    try:
        solids = (
            export(case.rotor(), case.duct(), out, others, name=case.name, unit=unit, options=options) if others else {}
        )
    except GeometryError as error:
        raise InputError([Fault(case.path.as_posix(), *fault) for fault in error.faults]) from error
    manifest = solids
    if "openfoam" in formats:
        manifest = write_openfoam(case, out, run, options)
        if solids:
            manifest |= {"volumes_m3": solids["volumes_m3"], "files": [*solids["files"], *manifest["files"]]}
            write_atomic(out / MANIFEST, json.dumps(manifest, indent=1) + "\n")
    if targets:
        manifest = (manifest or {"schema": SCHEMA, "name": case.name, "files": []}) | {"targets": plain(targets)}
        (out / MANIFEST).unlink(missing_ok=True)  # a manifest never speaks of files that are being replaced
        for name, data in contents.items():
            write_atomic(out / name, data)
            if str(data)[:2] == "#!":
                os.chmod(out / name, 0o755)
        write_atomic(out / MANIFEST, json.dumps(manifest, indent=1) + "\n")
    if manifest:
        now = _hashes(manifest)
        _remove(out, {path: digest for path, digest in earlier.items() if path not in now})
    return manifest


def _hashes(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Files that a manifest lists, and what was in them."""
    files: dict[str, str] = {item["path"]: item["sha256"] for item in manifest["files"]}
    files |= {
        f"{t['target']}/{item['path']}": item["sha256"] for t in manifest.get("targets", []) for item in t["files"]
    }
    return files | dict(manifest.get("openfoam", {}).get("files", {}))


def _listed(out: Path) -> dict[str, str]:
    """Files of the export that is in a folder; none when its manifest is not one of ours."""
    try:
        manifest = json.loads((out / MANIFEST).read_text(encoding="utf-8"))
        found = _hashes(manifest) if manifest["schema"] == SCHEMA else {}
        return {Path(path).as_posix(): digest for path, digest in found.items() if "\0" not in path}
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return {}


def _remove(out: Path, files: Mapping[str, str]) -> None:
    """Remove files of an earlier export that are below a folder and unchanged, and folders that they leave empty."""
    home = out.resolve()
    for name, digest in files.items():
        path = (home / name).parent.resolve() / Path(name).name
        if not path.is_relative_to(home) or path.is_symlink() or not path.is_file():
            continue  # a manifest is a file that anybody may have edited
        if file_hash(path) != digest:
            continue
        path.unlink()
        for folder in path.parents:
            if folder == home or any(folder.iterdir()):
                break
            folder.rmdir()


def _targets(
    case: Case, formats: list[str], run: Run, hold: tuple[str, ...]
) -> tuple[list[dict[str, Any]], dict[str, str | bytes]]:
    """Manifest entries and files of all targets that are no solids; all faults at once, before anything is written."""
    chosen = [exports()[word] for word in dict.fromkeys(formats) if exports()[word].kind != "solid"]
    job = Job(case, run.rpm, run.airspeed_m_s, hold)
    faults = [fault for target in chosen for fault in target.faults(job)]
    if faults:
        raise InputError(faults)
    entries: list[dict[str, Any]] = []
    contents: dict[str, str | bytes] = {}
    for target in chosen:
        files = target.write(job)
        entries.append(entry(target, job, files))
        contents |= {f"{target.id}/{name}": data for name, data in files.items()}
    return entries, contents


def export_cases(
    path: str,
    out: str,
    formats: list[str],
    unit: str = "mm",
    fillet_mm: float = 0.0,
    min_thickness_mm: float = 0.0,
    flow: Run | None = None,
    hold: tuple[str, ...] = (),
) -> tuple[list[tuple[dict[str, Any], Path]], list[InputError]]:
    """Write a case for its targets, or all cases of a folder, each into a folder of its own.

    Returns manifests with their folders, and why others were refused. Faults of the options are raised before anything
    is written.
    """
    flow = flow or Run()
    faults = check_run(flow, NAMES) + _unused(flow, formats, hold)
    try:
        options = Options(fillet=fillet_mm * 1e-3, min_thickness=min_thickness_mm * 1e-3)
    except GeometryError as error:
        faults += [Fault("", *fault) for fault in error.faults]
    if faults:
        raise InputError(faults)
    paths = find_cases([path])
    cases, refused, made = [], [], []
    for file in paths:
        try:
            cases.append(load_case(file))
        except InputError as error:
            refused.append(error)
    if len(paths) > 1:
        repeated = repeated_names(dict(enumerate(cases)))
        if repeated:  # they would write into one folder
            raise InputError(list(repeated.values()))
    for case in cases:
        folder = Path(out) / case.name if len(paths) > 1 else Path(out)
        try:
            made.append((export_case(case, folder, formats, unit, options, flow, hold), folder))
        except InputError as error:
            refused.append(error)
    return made, refused


def _unused(flow: Run, formats: list[str], hold: tuple[str, ...]) -> list[Fault]:
    """Options that no chosen format reads: what they ask for would not be done."""
    plain, faults = Run(), []
    used = {word for name in formats for word in exports()[name].uses}
    for key, option in NAMES.items():
        value = getattr(flow, key)
        if value != getattr(plain, key) and key not in used:
            option, got = (f"--{value}", "the option") if key == "solver" else (option, shown(value).strip("'"))
            readers = ", ".join(name for name, target in exports().items() if key in target.uses)
            faults.append(
                Fault(
                    "", option, got, f"nothing with the format {', '.join(formats)}", f"Formats that read it: {readers}"
                )
            )
    if hold and all(exports()[name].kind == "solid" for name in formats):
        faults.append(
            Fault("", "--hold", ", ".join(hold), "a format of loads, disks or blades", "Solids hold no loads")
        )
    faults += [
        Fault("", "--hold", repr(word), f"one of {', '.join(FEATURES)}") for word in hold if word not in FEATURES
    ]
    return faults


def _targets_text(manifest: dict[str, Any], out: Path) -> list[str]:
    """What each target holds, and how well."""
    lines = []
    for item in manifest.get("targets", []):
        lines.append(
            f"{manifest['name']} as {item['title']}, in {out / item['target']}: "
            f"{', '.join(f['path'] for f in item['files'])}"
        )
        lines.append(f"  holds {item['holds']}")
        error = item.get("fit_error_pct", {})
        shown_errors = []
        for word in ("thrust", "torque"):
            value = error.get(word)
            worst = value.get("flight") if isinstance(value, dict) else value
            shown_errors.append(f"{word} {'not held' if worst is None else number_text(worst, 3) + ' %'}")
        if error:
            lines.append(f"  greatest error {', '.join(shown_errors)} (of {error['of']})")
        if "band" in item:
            band = item["band"]
            speeds = dict.fromkeys(zip(band["airspeed_m_s"], band["thrust_pct"], band["torque_pct"], strict=True))
            words = ", ".join(
                f"{number_text(t, 3)} % of thrust, {number_text(q, 3)} % of torque at {number_text(v, 3)} m/s"
                for v, t, q in speeds
            )
            lines.append(f"  standard uncertainty of the prediction: {words} ({band['origin']})")
            lines += [f"  ! {flag}" for flag in band["flags"]]
        lines += [f"  note: {note}" for note in item["notes"]]
    return lines


def text(manifest: dict[str, Any], out: Path) -> str:
    """Lay a manifest out for a terminal."""
    targets = _targets_text(manifest, out)
    if not manifest["files"] and targets:
        return "\n".join(targets)
    rows = [
        [
            item["path"],
            item["format"],
            item["unit"],
            f"{item['bytes'] / 1e6:.2f}",
            ", ".join(s["name"] for s in item["surfaces"]),
            item["sha256"][:12],
        ]
        for item in manifest["files"]
    ]
    volumes, checks = manifest["volumes_m3"], manifest["checks_m"]
    lines = [
        f"{manifest['name']}: {manifest['blades']} blades, in {out}",
        text_table(["file", "format", "unit", "MB", "surfaces", "sha256"], rows, left=(0, 1, 2, 4, 5)).rstrip(),
    ]
    meshed, exact = volumes["volume_rotor_mesh"], volumes["volume_rotor_sections"]
    words = [f"rotor {meshed * 1e6:.4f} cm3, sections {100 * (exact / meshed - 1):+.3f} %"]
    if "volume_rotor_cad" in volumes:
        words.append(f"CAD {100 * (volumes['volume_rotor_cad'] / meshed - 1):+.3f} %")
    if "gap" in checks:
        words.append(f"gap {number_text(checks['gap'] * 1e3)} mm")
    words.append(f"thinnest section {number_text(checks['min_section_thickness'] * 1e3)} mm")
    lines.append(", ".join(words))
    if "openfoam" in manifest:
        about = manifest["openfoam"]
        lines.append(
            f"OpenFOAM case: {about['solver']}, {about['turbulence']}, {about['domain']}, {about['sector']}, "
            f"level {about['level']:g}; run it with ./Allrun"
        )
        lines += about["notes"]
    return "\n".join(lines + targets)
