"""Values that are costly to make, kept by what decided them: bounded in memory, shared by threads."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, TypeVar

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
