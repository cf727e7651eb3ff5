"""The solids of a case as STL, STEP, OBJ or OpenFOAM surfaces."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bemt.base.errors import Fault, InputError
from bemt.base.tables import file_hash, number_text, text_table, write_atomic
from bemt.base.toml import shown
from bemt.case import Case, find_cases, load_case, repeated_names
from bemt.exports.openfoam.write import Run, check_run, settings_of, write_openfoam
from geometry.common import GeometryError
from geometry.export import MANIFEST, SCHEMA, export
from geometry.mesh import Options

__all__ = ["export_case", "export_cases", "text"]

NAMES = {"rpm": "--rpm", "airspeed_m_s": "--airspeed", "sideslip_deg": "--sideslip-deg", "level": "--level",
         "domain": "--domain", "sector": "--sector", "turbulence": "--turbulence",
         "solver": "--compressible"}  # fmt: skip
"""Options that say what the OpenFOAM case is to compute."""



def export_case(
    case: Case, out: Path, formats: list[str], unit: str = "mm", options: Options | None = None, flow: Run | None = None
) -> dict[str, Any]:
    """Write the solids of one case.

    Parameters
    ----------
    case : Case
        The case.
    out : Path
        Folder. What an earlier export wrote there and this one does not goes: the files that the earlier manifest lists
        and that are as they were written; no others.
    formats : list of str
        Some of ``stl``, ``step``, ``obj``, ``openfoam``.
    unit : str
        ``mm`` or ``m``.
    options : Options or None
        How fine; None is fine enough for chord and twist errors below 0.2 %.
    flow : Run or None
        What the OpenFOAM case is to compute; None is the case's own point.

    Returns
    -------
    dict
        The manifest.

    Raises
    ------
    InputError
        When the case makes no sound solid; nothing is written then.
    """
    earlier = _listed(out)
    others = [word for word in formats if word != "openfoam"]
    run = flow or Run()
    if "openfoam" in formats:
        settings_of(case, run, options)  # its faults come before anything is written
    try:
        solids = (
            export(case.rotor(), case.duct(), out, others, name=case.name, unit=unit, options=options) if others else {}
        )  # noqa: E501
    except GeometryError as error:
        raise InputError([Fault(case.path.as_posix(), *fault) for fault in error.faults]) from error
    manifest = solids
    if "openfoam" in formats:
        manifest = write_openfoam(case, out, run, options)
        if solids:
            manifest |= {"volumes_m3": solids["volumes_m3"], "files": [*solids["files"], *manifest["files"]]}
            write_atomic(out / MANIFEST, json.dumps(manifest, indent=1) + "\n")
    if manifest:
        now = _hashes(manifest)
        _remove(out, {path: digest for path, digest in earlier.items() if path not in now})
    return manifest


def _hashes(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Files that a manifest lists, and what was in them."""
    files: dict[str, str] = {item["path"]: item["sha256"] for item in manifest["files"]}
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


def export_cases(
    path: str, out: str, formats: list[str], unit: str = "mm", fillet_mm: float = 0.0, min_thickness_mm: float = 0.0,
    flow: Run | None = None,
) -> tuple[list[tuple[dict[str, Any], Path]], list[InputError]]:  # fmt: skip
    """Write the solids of a case, or of all cases of a folder, each into a folder of its own.

    Returns manifests with their folders, and why others were refused. Faults of the options are raised before anything
    is written.
    """
    flow = flow or Run()
    faults = check_run(flow, NAMES) if "openfoam" in formats else _unused(flow)
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
            made.append((export_case(case, folder, formats, unit, options, flow), folder))
        except InputError as error:
            refused.append(error)
    return made, refused


def _unused(flow: Run) -> list[Fault]:
    """Options of OpenFOAM that were given without that format: what they ask for would not be done."""
    plain, faults = Run(), []
    for key, option in NAMES.items():
        value = getattr(flow, key)
        if value != getattr(plain, key):
            option, got = (f"--{value}", "the option") if key == "solver" else (option, shown(value).strip("'"))
            faults.append(Fault("", option, got, "nothing without the format openfoam", "Add --format openfoam"))
    return faults


def text(manifest: dict[str, Any], out: Path) -> str:
    """Lay a manifest out for a terminal."""
    rows = [[item["path"], item["format"], item["unit"], f"{item['bytes'] / 1e6:.2f}",
             ", ".join(s["name"] for s in item["surfaces"]), item["sha256"][:12]] for item in manifest["files"]]  # fmt: skip  # noqa: E501
    volumes, checks = manifest["volumes_m3"], manifest["checks_m"]
    lines = [f"{manifest['name']}: {manifest['blades']} blades, in {out}",
             text_table(["file", "format", "unit", "MB", "surfaces", "sha256"], rows, left=(0, 1, 2, 4, 5)).rstrip()]  # fmt: skip  # noqa: E501
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
        lines.append(f"OpenFOAM case: {about['solver']}, {about['turbulence']}, {about['domain']}, {about['sector']}, "
                     f"level {about['level']:g}; run it with ./Allrun")  # fmt: skip
        lines += about["notes"]
    return "\n".join(lines)
