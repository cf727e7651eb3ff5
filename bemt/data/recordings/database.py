"""A public database of measured propellers into the user's cache.

The publisher gives no hash, so the first archive is trusted and its SHA-256 is written beside the data
(``.bemt-data.json``) with the hash of every file, so that what others put there or changed is told from it and never
deleted; a later ``--refresh`` refuses an archive with another hash. The data stay the publisher's: cite
them as they ask. Never run against the publisher's server in the tests, which use a local one.

Schema ``bemt.data/1``: ``kind``, ``folder``, ``url`` (or ``archive``), ``sha256``, ``bytes``, ``files``,
``propellers``, ``refused``, ``checksum`` (``first use``, ``as recorded``, ``replaced``), ``fetched``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bemt.base.cache import cache_dir
from bemt.base.errors import Fault, InputError
from bemt.base.tables import file_hash, json_text, number_of
from bemt.data.recordings.archive import download, unpacked

SCHEMA = "bemt.data/1"
RECORD = ".bemt-data.json"
URLS = {"uiuc": "https://m-selig.ae.illinois.edu/props/download/UIUC-propDB.zip"}
"""Public archive of each kind."""
CITE = {
    "uiuc": "J.B. Brandt, R.W. Deters, G.K. Ananda, O.D. Dantsker, M.S. Selig, UIUC Propeller Database, Vols 1-4, "
    "University of Illinois at Urbana-Champaign",
}
"""What the publisher asks to cite."""


def _record(folder: Path) -> dict[str, Any] | None:
    """What an earlier run wrote beside the data; None when there is none."""
    try:
        found = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and isinstance(found.get("sha256"), str) else None


def _files(folder: Path) -> dict[str, str]:
    """Start of the hash of every file below a folder but the record, by its path there."""
    found = (p for p in sorted(folder.rglob("*")) if p.is_symlink() or not p.is_dir())
    names = {p.relative_to(folder).as_posix(): p for p in found}
    return {n: "link" if p.is_symlink() else file_hash(p)[:16] for n, p in names.items() if n != RECORD}


def _check_own(folder: Path, known: dict[str, Any]) -> None:
    """Refuse to replace a folder that holds more than an earlier run put there."""
    there, names = _files(folder), known.get("names")
    hint = "Move them away, or name another folder with --out"
    if isinstance(names, dict):
        strange = [name for name, start in there.items() if names.get(name) != start]
        got = f"files added or changed since ({len(strange)}): {', '.join(strange[:5])}"
        got += ", ..." if len(strange) > 5 else ""
    else:  # a record of earlier versions: it only counts
        strange = list(there) if len(there) != known.get("files") else []
        got = f"{number_of(len(there), 'file')} where its record counts {known.get('files')}"
    if strange:
        raise InputError(Fault(os.fspath(folder), "", got, "only what this command put there", hint))


def get(
    kind: str,
    folder: Path,
    source: str | Path | None = None,
    url: str | None = None,
    refresh: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Put a database into a folder."""
    from bemt.data.readers.uiuc import scan_folder

    if source is not None and url is not None:
        raise InputError(Fault("", "--url", url, "none with --source, which downloads nothing", "Give one of the two"))
    known = _record(folder)
    if known is None and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        hint = "Name an empty or new folder with --out"
        raise InputError(Fault(os.fspath(folder), "", "files that this command did not put there", "no folder", hint))
    if known and source is None and not refresh:
        said = {key: value for key, value in known.items() if key != "names"}
        return {**said, "folder": os.fspath(folder), "checksum": "as recorded", "fetched": False}
    if known:
        _check_own(folder, known)
    address = url or URLS[kind]
    if source is None:
        archive = folder.with_name(f".{folder.name}.zip")
        digest = download(address, archive, known["sha256"] if known else None, progress)
    else:
        archive = Path(source)
        if not archive.is_file():
            raise InputError(Fault(os.fspath(source), "", "no such file", "a zip archive", "Check the path"))
        digest = file_hash(archive)
    try:
        with unpacked(archive, folder) as fresh:
            scan = scan_folder(fresh)
            if not scan.propellers:
                expected = "tables such as volume-1/data/apce_10x5_geom.txt"
                raise InputError(Fault(os.fspath(archive), "", "no propeller", expected, "Is this the archive?"))
            names = _files(fresh)
            document: dict[str, Any] = {
                "schema": SCHEMA, "kind": kind, "folder": os.fspath(folder),
                "url": address if source is None else None, "archive": None if source is None else archive.name,
                "sha256": digest, "bytes": archive.stat().st_size,
                "files": len(names), "propellers": len(scan.propellers),
                "refused": len(scan.faults), "cite": CITE[kind],
            }  # fmt: skip
            (fresh / RECORD).write_text(json_text({**document, "names": names}), encoding="utf-8")
    finally:
        if source is None:
            archive.unlink(missing_ok=True)
    same = known is not None and known["sha256"] == digest
    return {
        **document,
        "checksum": "as recorded" if same else "replaced" if known else "first use",
        "fetched": source is None,
    }


def text(doc: dict[str, Any]) -> str:
    """Tell where the data lie and where they came from."""
    said = {
        "first use": "first use: the publisher gives no hash, so this one is trusted and recorded",
        "as recorded": "as recorded at its first use",
        "replaced": "a different archive than before, as given by --source",
    }
    lines = [
        f"{doc['kind']}: {doc['propellers']} propellers, {doc['files']} files in {doc['folder']}",
        f"from {doc['url'] or doc['archive']}, {doc['bytes']} bytes",
        f"sha256 {doc['sha256']} ({said[doc['checksum']]})",
    ]
    if doc["refused"]:
        lines.append(f"{doc['refused']} faults in its files; bemt lab calibrate names them")
    return "\n".join([*lines, f"please cite: {doc['cite']}"])


def folder_of(kind: str, given: str | None) -> Path:
    """Folder as named, else that in the cache; without a cache one must be named."""
    cache = cache_dir()
    if given is None and cache is None:
        raise InputError(Fault("BEMT_CACHE", "", "switched off", "a cache folder, or --out DIR"))
    return Path(given) if given else Path(cache or ".") / "data" / kind
