"""What an export leaves in a folder: files, one manifest, nothing of an earlier export that is not asked for."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bemt.base.action import Answered, did_you_mean
from bemt.base.document import Documented
from bemt.base.errors import EXIT_INPUT, EXIT_OK, Fault, InputError, gathered, refuse
from bemt.base.plugins import missing, tool_of
from bemt.base.tables import file_hash, number_text, text_table, write_atomic
from bemt.base.toml import check_field, shown
from bemt.base.toml_text import Collector
from bemt.rotors.case import Case, find_cases, load_case, repeated_names
from bemt.tools.exports import exports
from bemt.tools.exports.base import FEATURES, Job, Manifest
from bemt.tools.exports.parts import joined
from bemt.tools.exports.printing import AsPrinted, Print, Widened, faults_of, printed_text
from geometry.common import GeometryError
from geometry.export import MANIFEST, SCHEMA
from geometry.mesh import Options


class SolidPart(Documented):
    """Named part of a solid, and its size in words where the shape is ours to choose."""

    name: str
    extent: str = ""


class Listed(Documented):
    """A file as a manifest lists it."""

    path: str
    sha256: str
    format: str = ""
    unit: str = ""
    bytes: int = 0
    surfaces: tuple[SolidPart, ...] = ()


class ShownBand(Documented):
    """Band of the prediction, one standard uncertainty [%]."""

    airspeed_m_s: tuple[float, ...]
    thrust_pct: tuple[float, ...]
    torque_pct: tuple[float, ...]
    origin: str
    flags: tuple[str, ...]


class SectionError(Documented):
    """Greatest error of fitted sections: of cl, and of cd in per cent."""

    cl: float
    cd_pct: float


class TargetPart(Documented):
    """What a manifest says of a target that is no solid."""

    target: str
    files: tuple[Listed, ...]
    title: str = ""
    holds: str = ""
    notes: tuple[str, ...] = ()
    fit_error_pct: Mapping[str, Any] = field(default_factory=dict)
    section_error: SectionError | None = None
    band: ShownBand | None = None


class Volumes(Documented):
    """Volume of a rotor as a mesh, by its sections, and of the solid of CAD [m^3]."""

    volume_rotor_mesh: float
    volume_rotor_sections: float
    volume_rotor_cad: float | None = None


class Checks(Documented):
    """Sizes that were checked; those of the blade as a whole where it was made for a printer [m]."""

    gap: float | None = None
    min_thickness: float | None = None
    trailing_edge: float = math.nan
    min_section_thickness: float = math.nan


class ManifestContents(Documented):
    """What a manifest says, of it what is read again; `parts` has the files of formats that list their own."""

    schema: str = ""
    name: str = ""
    files: tuple[Listed, ...] = ()
    targets: tuple[TargetPart, ...] = ()
    parts: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    blades: int = 0
    volumes_m3: Volumes | None = None
    checks_m: Checks = Checks()
    printed: Widened | AsPrinted | None = None
    kept: tuple[str, ...] = ()
    stale: tuple[str, ...] = ()
    case_sha256: Mapping[str, str] = field(default_factory=dict)

    @property
    def formats(self) -> list[str]:
        """Formats that it speaks of."""
        out = [file.format for file in self.files if file.format not in self.parts]
        return list(dict.fromkeys([*out, *self.parts, *(one.target for one in self.targets)]))

    @property
    def hashes(self) -> dict[str, str]:
        """Files that it lists, and what was in them."""
        files = {file.path: file.sha256 for file in self.files}
        files |= {f"{one.target}/{file.path}": file.sha256 for one in self.targets for file in one.files}
        return files | {path: digest for part in self.parts.values() for path, digest in part.items()}


def _told(manifest: Mapping[str, Any]) -> ManifestContents:
    own = {key: v["files"] for key, v in manifest.items() if isinstance(v, dict) and isinstance(v.get("files"), dict)}
    return ManifestContents.from_document({**manifest, "parts": own})


class PartlyRefused(InputError):
    """Some targets were refused; the others are written, and `manifest` speaks of them."""

    def __init__(self, faults: list[Fault], manifest: Manifest) -> None:
        super().__init__(faults)
        self.manifest = manifest


def export_case(job: Job, out: Path, formats: Sequence[str], progress: Callable[[str], None] | None = None) -> Manifest:
    """Write one case for one or more targets; each is whole or not there.

    Formats of an earlier export of the same case stay, in the folder and in its manifest: the answer has those in
    ``kept``, and in ``stale`` the ones written from another state of the case. If some targets were refused, the others
    are written (`PartlyRefused`); if all were, or the folder holds another case, nothing is.
    """
    case, (before, old) = job.case, _manifest(out)
    if old.name not in ("", case.name):
        got, wanted = f"the export of {old.name!r}", f"a folder without an export, or with one of {case.name!r}"
        raise InputError(Fault((out / MANIFEST).as_posix(), "name", got, wanted, "Give each case an --out of its own"))
    manifest: Manifest = {}
    faults: list[Fault] = []
    for target in sorted((exports()[word] for word in dict.fromkeys(formats)), key=lambda target: target.turn):
        if progress is not None:  # a solid of CAD takes up to a minute
            progress(f"{case.name}: writing {target.id}")
        with gathered(faults):
            manifest = joined(manifest, target.put(job, out))
    if manifest:
        content = case.content_hash()
        formats = _told(manifest).formats
        kept = _kept(before, old, set(formats), out)
        stays = {word: old.case_sha256.get(word, "") for word in _told(kept).formats}
        manifest["case_sha256"] = dict.fromkeys(formats, content)
        whole = joined(kept | {"case_sha256": stays}, manifest)
        write_atomic(out / MANIFEST, json.dumps(whole, indent=1) + "\n")
        listed = {Path(path).as_posix(): digest for path, digest in old.hashes.items() if "\0" not in path}
        now = _told(whole).hashes
        _remove(out, {path: digest for path, digest in listed.items() if path not in now})
        stale = sorted(word for word, digest in stays.items() if digest != content)
        manifest |= {"kept": sorted(stays), "stale": stale}
    told = list(dict.fromkeys(faults))
    if told and not manifest:
        raise InputError(told)
    if told:
        raise PartlyRefused(told, manifest)
    return manifest


def _kept(before: Manifest, old: ManifestContents, gone: set[str], out: Path) -> Manifest:
    """What stays of the manifest before: formats that were not asked for again and whose files are as they were."""

    def there(files: Mapping[str, str], folder: str = "") -> bool:
        return all(_unchanged(out, folder + path, digest) for path, digest in files.items())

    def stays(file: Listed) -> bool:
        own = bool(file.format) and file.format not in gone and (file.format not in old.parts or file.format in kept)
        return own and there({file.path: file.sha256})

    kept = {key: value for key, value in before.items() if key not in ("files", "targets", "case_sha256", *old.parts)}
    kept |= {word: before[word] for word, files in old.parts.items() if word not in gone and there(files)}
    files = [item for item, file in zip(before.get("files", []), old.files, strict=True) if stays(file)]
    kept |= {"files": files} if files else {}
    targets = [
        item
        for item, one in zip(before.get("targets", []), old.targets, strict=True)
        if one.target not in gone and there({f.path: f.sha256 for f in one.files}, f"{one.target}/")
    ]
    return kept | ({"targets": targets} if targets else {})


def _manifest(out: Path) -> tuple[Manifest, ManifestContents]:
    """Manifest of the export that is in a folder; empty when it is not one of ours."""
    try:
        manifest = json.loads((out / MANIFEST).read_text(encoding="utf-8"))
        told = _told(manifest)
        return (manifest, told) if told.schema == SCHEMA else ({}, ManifestContents())
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return {}, ManifestContents()


def _unchanged(out: Path, name: str, digest: str) -> Path | None:
    """A file of the manifest that is below the folder, no link, and as it was written; else None."""
    if "\0" in name:
        return None
    home = out.resolve()
    path = (home / name).parent.resolve() / Path(name).name
    inside = path.is_relative_to(home) and not path.is_symlink() and path.is_file()  # anybody may edit a manifest
    return path if inside and file_hash(path) == digest else None


def _remove(out: Path, files: Mapping[str, str]) -> None:
    """Remove files of an earlier export that are below a folder and unchanged, and folders that they leave empty."""
    for path in filter(None, (_unchanged(out, name, digest) for name, digest in files.items())):
        path.unlink()
        for folder in path.parents:
            if folder == out.resolve() or any(folder.iterdir()):
                break
            folder.rmdir()


def _loaded(files: Iterable[Path]) -> tuple[list[Case], list[InputError]]:
    """Cases, and why others are none."""
    cases, refused = [], []
    for file in files:
        try:
            cases.append(load_case(file))
        except InputError as error:
            refused.append(error)
    return cases, refused


def export_cases(
    path: str | Case, out: str, formats: Sequence[str], unit: str = "mm", fillet_mm: float = 0.0,
    min_thickness_mm: float = 0.0, given: Mapping[str, Any] | None = None, hold: tuple[str, ...] = (),
    printed: Print | None = None, progress: Callable[[str], None] | None = None, rotation: str | None = None,
) -> tuple[list[tuple[Manifest, Path]], list[InputError]]:  # fmt: skip
    """Write a case for its targets, or all cases of a folder, each into a folder of its own.

    `given` is the operating point (``rpm``, ``airspeed_m_s``) and the options of single targets
    (:attr:`Export.options <bemt.tools.exports.base.Export.options>`); None is not given. `rotation` is ``right`` or
    ``left`` instead of the cases' own.

    Returns manifests with their folders, and why cases or targets were refused. Faults of the options are raised before
    anything is written.
    """
    known = exports()
    unknown = [word for word in formats if word not in known]
    faults = [Fault("", "--format", word, f"one of {', '.join(known)}", _nearest(word)) for word in unknown]
    refuse(faults)
    asked = {key: value for key, value in (given or {}).items() if value is not None}
    faults += option_faults(asked) + _unused(asked, formats, hold)
    faults += faults_of(printed, formats) if printed is not None else []
    try:
        solid = Options(fillet=fillet_mm * 1e-3, min_thickness=min_thickness_mm * 1e-3)
    except GeometryError as error:
        faults += [Fault("", f"{_option(name)}-mm", *rest) for name, *rest in error.faults]
    refuse(faults)
    cases, refused = ([path], []) if isinstance(path, Case) else _loaded(find_cases([path]))
    several = len(cases) + len(refused) > 1
    if several and (repeated := repeated_names(dict(enumerate(cases)))):  # they would write into one folder
        raise InputError(list(repeated.values()))
    made = []
    rpm, airspeed = asked.pop("rpm", None), asked.pop("airspeed_m_s", None)
    for case in cases:
        folder = Path(out) / case.name if several else Path(out)
        try:
            case = case if rotation is None else case.replaced({"rotor.rotation": rotation})
            job = Job(case, rpm, airspeed, hold, unit, solid, printed, asked, matched_rpm=rpm)
            made.append((export_case(job, folder, formats, progress), folder))
        except PartlyRefused as error:
            made.append((error.manifest, folder))
            refused.append(error)
        except InputError as error:
            refused.append(error)
    return made, refused


def _nearest(word: str) -> str:
    """What a word that is no target may have meant: one spelt alike, or those that speak of it."""
    known = exports()
    about = [name for name, t in known.items() if re.search(rf"\b{re.escape(word)}", f"{t.title} {t.source}", re.I)]
    words = f"For {word}: {' or '.join(about)}" if len(word) > 2 and about else ""
    return absent_target(word) or did_you_mean(word.lower(), known).strip() or words


def absent_target(word: str) -> str:
    """Sentence on the absent tool that a target belongs to, or nothing."""
    return missing(tool) if (tool := tool_of(word)) else ""


def option_faults(given: Mapping[str, Any]) -> list[Fault]:
    """Find the options of targets that are out of range or unknown words.

    >>> for fault in option_faults({"rpm": float("nan")}): print(fault)
    --rpm: got nan; expected a number from 10 to 300000 rev/min.
    """
    out = Collector("")
    for key, value in given.items():
        for table in [target.options for target in exports().values() if key in target.options.named()][:1]:
            check_field(out, _option(key), table, key, value)
    return out.faults


def _option(key: str) -> str:
    return f"--{key.replace('_', '-')}"


def _unused(given: Mapping[str, Any], formats: Sequence[str], hold: tuple[str, ...]) -> list[Fault]:
    """Options that no chosen format reads: what they ask for would not be done."""
    faults = []
    used = {word for name in formats for word in exports()[name].uses}
    wanted = f"nothing with the format {', '.join(formats)}"
    for key, value in given.items():
        if key not in used:
            readers = [name for name, target in exports().items() if key in target.uses]
            hint = f"Formats that read it: {', '.join(readers) or 'none here'}; else leave it out"
            faults.append(Fault("", _option(key), shown(value).strip("'"), wanted, hint))
    if hold and all(exports()[name].kind == "solid" for name in formats):
        wanted = "a format of loads, disks or blades"
        faults.append(Fault("", "--hold", ", ".join(hold), wanted, "Solids hold no loads"))
    known = ", ".join(FEATURES)
    return faults + [Fault("", "--hold", repr(word), f"one of {known}") for word in hold if word not in FEATURES]


def _errors_text(error: Mapping[str, Any]) -> list[str]:
    """Greatest errors: of a target of many points at rest and in flight, else of its one point."""
    if not error:
        return []
    parted = any(isinstance(error.get(word), dict) for word in ("thrust", "torque"))
    lines = []
    for at, words in (("at_rest", " at rest"), ("flight", ", flight included")) if parted else (("", ""),):
        worst = {w: v.get(at) if isinstance(v := error.get(w), dict) else v for w in ("thrust", "torque")}
        told = (f"{w} {'not held' if v is None else number_text(v, 3) + ' %'}" for w, v in worst.items())
        of = "the load itself" if at == "at_rest" else error["of"]
        lines.append(f"  greatest error{words}: {', '.join(told)} (of {of})")
    return lines


def _targets_text(told: ManifestContents, out: Path) -> list[str]:
    """What each target holds, and how well; a note that several have is told once."""
    lines, said = [], set[str]()
    for one in told.targets:
        files = ", ".join(f.path for f in one.files)
        lines += [f"{told.name} as {one.title}, in {out / one.target}: {files}", f"  holds {one.holds}"]
        lines += _errors_text(one.fit_error_pct)
        if one.section_error:
            cl, cd = (number_text(e, 2) for e in (one.section_error.cl, one.section_error.cd_pct))
            lines.append(f"  sections: cl within {cl}, cd within {cd} % between the stalls")
        if band := one.band:
            speeds = dict.fromkeys(zip(band.airspeed_m_s, band.thrust_pct, band.torque_pct, strict=True))
            words = ", ".join(
                f"{number_text(t, 3)} % of thrust, {number_text(q, 3)} % of torque at {number_text(v, 3)} m/s"
                for v, t, q in speeds
            )
            lines.append(f"  standard uncertainty of the prediction: {words} ({band.origin})")
            lines += [f"  ! {flag}" for flag in band.flags]
        lines += [f"  note: {note}" for note in one.notes if note not in said]
        said |= {*one.notes}
    if told.kept:
        lines.append(f"kept from an earlier export into {out}: {', '.join(told.kept)}")
    if told.stale:
        lines.append(f"  of another state of the case, export them again: {', '.join(told.stale)}")
    return lines


def text(manifest: Manifest, out: Path) -> str:
    """Lay a manifest out for a terminal."""
    told = _told(manifest)
    targets, volumes, checks = _targets_text(told, out), told.volumes_m3, told.checks_m
    if volumes is None:  # no solid was made
        return "\n".join(targets)
    rows = [
        [f.path, f.format, f.unit, f"{f.bytes / 1e6:.2f}", ", ".join(s.name for s in f.surfaces), f.sha256[:12]]
        for f in told.files
    ]
    lines = [
        f"{told.name}: {told.blades} blades, in {out}",
        text_table(["file", "format", "unit", "MB", "surfaces", "sha256"], rows, left=(0, 1, 2, 4, 5)).rstrip(),
    ]
    meshed = volumes.volume_rotor_mesh
    words = [f"rotor {meshed * 1e6:.4f} cm3, sections {100 * (volumes.volume_rotor_sections / meshed - 1):+.3f} %"]
    if volumes.volume_rotor_cad is not None:
        words.append(f"CAD {100 * (volumes.volume_rotor_cad / meshed - 1):+.3f} %")
    if checks.gap is not None:
        words.append(f"gap {number_text(checks.gap * 1e3)} mm")
    if checks.min_thickness is not None:
        words.append(f"thinnest place of the blade {number_text(checks.min_thickness * 1e3)} mm")
        words.append(f"trailing edge {number_text(checks.trailing_edge * 1e3, 3)} mm")
    else:
        words.append(f"thinnest section {number_text(checks.min_section_thickness * 1e3)} mm")
    lines.append(", ".join(words))
    lines += [f"{f.path}: {s.extent}" for f in told.files for s in f.surfaces if s.extent]
    lines += printed_text(told.printed) if told.printed is not None else []
    for word in told.parts:
        if word in exports():
            lines += exports()[word].text(manifest[word])
    return "\n".join(lines + targets)


# Answer of ``export``: what was written, where, and what was refused.

ANSWER = "bemt.export/1"


@dataclass(frozen=True, eq=False)
class Exported(Answered):
    """Cases that were written for other programs.

    Parameters
    ----------
    manifests : tuple of mapping
        What ``manifest.json`` says of each case, with the formats that were kept and that are stale.
    folders : tuple of Path
        Folder of each.
    refused : tuple of InputError
        Why cases or targets were refused.
    """

    manifests: tuple[Mapping[str, Any], ...]
    folders: tuple[Path, ...]
    refused: tuple[InputError, ...] = ()

    @classmethod
    def of(cls, made: Sequence[tuple[Manifest, Path]], refused: Sequence[InputError]) -> Exported:
        """What `export_cases` gives; refused where nothing was written."""
        if not made:
            raise InputError([fault for error in refused for fault in error.faults])
        return cls(tuple(manifest for manifest, _ in made), tuple(where for _, where in made), tuple(refused))

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that the manifests list."""
        both = zip(self.manifests, self.folders, strict=True)
        return tuple(home / name for one, home in both for name in sorted(_told(one).hashes))

    @property
    def text(self) -> str:
        """What was written, for a terminal."""
        return "\n".join(text(dict(one), home) for one, home in zip(self.manifests, self.folders, strict=True))

    @property
    def exit_code(self) -> int:
        """2 where something was refused."""
        return EXIT_INPUT if self.refused else EXIT_OK

    @property
    def complaints(self) -> tuple[str, ...]:
        """Why, a line each."""
        return tuple(str(error) for error in self.refused)

    def _document(self) -> dict[str, Any]:
        """``bemt.export/1``."""
        return {"schema": ANSWER, "cases": [dict(one) for one in self.manifests]}

    def __repr__(self) -> str:
        return f"<export of {', '.join(str(one['name']) for one in self.manifests)}: {len(self.files)} files>"
