"""Content-addressed disk cache for arrays that are costly to make, with an in-process front.

An entry is one ``.npz`` file named by the SHA-256 of everything that decided its content. It is written to a
temporary name and renamed, so a reader never sees half a file; an entry that cannot be read counts as absent; a
folder that cannot be written switches the disk part off and nothing else.

The folder is ``$BEMT_CACHE``, else ``$XDG_CACHE_HOME/bemt``, else ``~/.cache/bemt``. ``BEMT_CACHE=off`` (or empty)
keeps everything in the process. `Kept` bounds what is kept in memory only.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from typing import Any, Generic, TypeVar

import numpy as np

V = TypeVar("V")


class Kept(Generic[V]):
    """Values by key; beyond ``most`` units of size the ones used longest ago are dropped.

    A key must hold everything that decides the value, so that none is ever stale. Threads that miss the same key at
    once make it twice and share the first.

    >>> kept = Kept(most=2, size=len)
    >>> [kept.get(key, lambda: key) for key in ("a", "b", "a", "c")], len(kept)
    (['a', 'b', 'a', 'c'], 2)
    """

    def __init__(self, most: float, size: Callable[[V], float]) -> None:
        self.most, self._size = most, size
        self._values: OrderedDict[Hashable, tuple[V, float]] = OrderedDict()
        self._lock = Lock()
        self.size, self.made = 0.0, 0

    def __len__(self) -> int:
        return len(self._values)

    def get(self, key: Hashable, make: Callable[[], V]) -> V:
        """Value of a key, made if it is not there."""
        with self._lock:
            found = self._values.get(key)
            if found is not None:
                self._values.move_to_end(key)
                return found[0]
        value = make()
        size = float(self._size(value))
        with self._lock:
            self.made += 1
            if key in self._values:
                return self._values[key][0]
            if size <= self.most:
                self._values[key] = value, size
                self.size += size
            while self.size > self.most:
                self.size -= self._values.popitem(last=False)[1][1]
        return value

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._values.clear()
            self.size = 0.0


Arrays = dict[str, np.ndarray]

MEMORY_ENTRIES = 256
_memory: OrderedDict[str, Arrays] = OrderedDict()
_watched: list[dict[tuple[str, str], Arrays]] = []


def cache_dir() -> Path | None:
    """Folder of the disk cache, or None when it is switched off.

    A home folder that cannot be found counts as switched off.
    """
    named = os.environ.get("BEMT_CACHE")
    if named is not None:
        return None if named.strip().lower() in ("", "off", "0") else Path(named).expanduser()
    xdg = os.environ.get("XDG_CACHE_HOME")
    if xdg:
        return Path(xdg) / "bemt"
    try:
        return Path.home() / ".cache" / "bemt"
    except RuntimeError:
        return None


def content_key(*parts: object) -> str:
    """Hash of everything that decides a result.

    >>> content_key("a", 1.0) == content_key("a", 1.0)
    True
    >>> content_key("a", 1.0) == content_key("a", 1.0 + 1e-15)
    False
    """
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype.str}{part.shape}".encode())
            digest.update(np.ascontiguousarray(part).tobytes())
        else:
            digest.update(json.dumps(part, sort_keys=True, default=_plain).encode())
        digest.update(b"\x00")
    return digest.hexdigest()


def _plain(value: object) -> object:
    """Turn numpy scalars and arrays inside containers into JSON (repr of a float is exact)."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"cannot hash a {type(value).__name__}")


def cached_arrays(kind: str, key: str, make: Callable[[], Arrays]) -> Arrays:
    """Arrays of a cache entry, made and kept when absent.

    Faults of the disk (no room, no permission, damaged entry) never reach the caller.

    >>> a = cached_arrays("doctest", content_key("x"), lambda: {"v": np.arange(3.0)})
    >>> a["v"].tolist()
    [0.0, 1.0, 2.0]
    """
    name = f"{kind}-{key}"
    found = _memory.get(name)
    if found is not None:
        _memory.move_to_end(name)
        for watched in _watched:
            watched[kind, key] = found
        return found
    folder = cache_dir()
    path = None if folder is None else folder / kind / f"{key}.npz"
    arrays = _read(path) if path is not None else None
    if arrays is None:
        arrays = {k: np.array(v) for k, v in make().items()}
        if path is not None:
            _write(path, arrays)
    for value in arrays.values():
        value.setflags(write=False)
    _memory[name] = arrays
    while len(_memory) > MEMORY_ENTRIES:
        _memory.popitem(last=False)
    for watched in _watched:
        watched[kind, key] = arrays
    return arrays


@contextmanager
def used() -> Iterator[dict[tuple[str, str], Arrays]]:
    """Collect the entries that are asked for, so that another process can be given them.

    >>> with used() as entries:
    ...     _ = cached_arrays("doctest", "0" * 64, lambda: {"v": np.arange(2.0)})
    >>> list(entries) == [("doctest", "0" * 64)]
    True
    """
    entries: dict[tuple[str, str], Arrays] = {}
    _watched.append(entries)
    try:
        yield entries
    finally:
        _watched[:] = [held for held in _watched if held is not entries]


def shipped_arrays(package: str, file: str) -> Arrays:
    """Arrays of a file that lies beside the modules of a package."""
    with resources.files(package).joinpath(file).open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def always_compile() -> bool:
    """Whether ``BEMT_COMPILE=always`` asks for compiled code even for a few points: equal to the last bit."""
    return os.environ.get("BEMT_COMPILE", "") == "always"


def watched() -> bool:
    """Whether somebody collects the entries that are asked for (:func:`used`)."""
    return bool(_watched)


def is_installed(package: str) -> bool:
    """Whether a package could be imported."""
    return find_spec(package) is not None


@lru_cache(maxsize=16)
def installed_version(package: str) -> str:
    """Version of an installed package, found without importing it.

    The folder beside the package says it; ``importlib.metadata`` does as well, but takes 15 ms to import.
    """
    spec = find_spec(package)
    if spec is not None and spec.origin:
        names = [p.name.removesuffix(".dist-info") for p in Path(spec.origin).parents[1].glob("*.dist-info")]
        found = [n.split("-") for n in names if n.split("-")[0].lower() == package.lower()]
        if len(found) == 1 and len(found[0]) == 2:
            return found[0][1]
    from importlib.metadata import version

    return version(package)


def clear_memory() -> None:
    """Forget the in-process entries; the disk keeps its own."""
    _memory.clear()


def _seal(arrays: Arrays) -> np.ndarray:
    """Checksum stored with an entry: a zip CRC alone would not notice a swapped or missing array."""
    parts: list[Any] = [[name, arrays[name]] for name in sorted(arrays)]
    return np.frombuffer(bytes.fromhex(content_key(*[x for pair in parts for x in pair])), dtype=np.uint8)


def _read(path: Path) -> Arrays | None:
    """Entry at path, or None when it is absent or damaged in whatever way."""
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        seal = arrays.pop("_seal")
        return arrays if np.array_equal(seal, _seal(arrays)) else None
    except Exception:  # zipfile, zlib, OSError, KeyError, ValueError: a damaged entry must only cost time
        return None


def _write(path: Path, arrays: Arrays) -> None:
    """Write to a temporary name in the same folder, then rename; give up quietly."""
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".new-", suffix=".npz")
        with os.fdopen(handle, "wb") as stream:
            np.savez(stream, **arrays, _seal=_seal(arrays))  # type: ignore[arg-type]
        os.replace(temporary, path)
    except OSError:
        if temporary is not None:
            try:
                os.unlink(temporary)
            except OSError:
                pass
