"""What all shapes share: faults of the input, read-only arrays and PCHIP interpolation."""

from __future__ import annotations

import importlib
import math
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class GeometryError(ValueError):
    """Bad geometry input: every fault found at once.

    Parameters
    ----------
    faults : sequence of tuple of str
        ``(where, got, expected, hint)`` each; the hint may be empty.

    Examples
    --------
    >>> print(GeometryError([("chord", "-0.01 m", "a positive number", "Drop the sign")]))
    chord: got -0.01 m; expected a positive number. Drop the sign.
    """

    def __init__(self, faults: Sequence[tuple[str, str, str, str]]) -> None:
        self.faults: tuple[tuple[str, str, str, str], ...] = tuple(faults)
        lines = []
        for where, got, expected, hint in self.faults:
            tail = f" {hint.rstrip('.')}" + ("" if hint.endswith("?") else ".") if hint else ""
            lines.append(f"{where}: got {got}; expected {expected}.{tail}")
        super().__init__("\n".join(lines))

    def __reduce__(self) -> tuple[type[GeometryError], tuple[tuple[tuple[str, str, str, str], ...]]]:
        """Pickle by the faults (worker processes send errors back)."""
        return (type(self), (self.faults,))


class LibraryError(GeometryError):
    """A library that an extra brings is not installed: no fault of the geometry."""


def needs(module: str, extra: str) -> Any:
    """Import a library that an extra brings, or say which extra is missing."""
    try:
        with _whole():
            return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or not module.startswith(error.name):
            raise
        hint = f'Install it with python -m pip install "bemt[{extra}]"'
        raise LibraryError([(module, "no such library", f"the extra [{extra}]", hint)]) from error


@contextmanager
def _whole() -> Iterator[None]:
    """Hold Ctrl-C back to the end: a compiled library that is interrupted while it loads fails or crashes."""
    own, pressed = signal.getsignal(signal.SIGINT), list[int]()
    held = callable(own) and threading.current_thread() is threading.main_thread()
    if held:
        signal.signal(signal.SIGINT, lambda number, _: pressed.append(number))
    try:
        yield
    finally:
        if held:
            signal.signal(signal.SIGINT, own)
    if pressed:
        signal.raise_signal(pressed[0])


class Faults:
    """Collects faults, then raises them together.

    >>> faults = Faults()
    >>> faults.number("gap", -1.0, 0.0, 1.0, "m")
    >>> faults.found
    [('gap', '-1 m', 'a number from 0 to 1 m', '')]
    """

    def __init__(self) -> None:
        self.found: list[tuple[str, str, str, str]] = []

    def add(self, where: str, got: str, expected: str, hint: str = "") -> None:
        """Note one fault."""
        self.found.append((where, got, expected, hint))

    def number(self, where: str, value: float, low: float, high: float, unit: str = "", hint: str = "") -> None:
        """Note a fault unless ``low <= value <= high``; infinite bounds are open, NaN always fails."""
        if low <= value <= high and math.isfinite(value):
            return
        unit = f" {unit}" if unit else ""
        span = f"from {low:g} to {high:g}" if math.isfinite(high) else f"of {low:g} or more"
        self.add(where, f"{value:g}{unit}", f"a number {span}{unit}", hint)

    def check(self) -> None:
        """Raise all faults noted so far, if any."""
        if self.found:
            raise GeometryError(self.found)


def frozen(values: ArrayLike) -> Array:
    """Return a read-only float copy."""
    out = np.array(values, dtype=np.float64)
    out.flags.writeable = False
    return out


def offset(outline: Array, distance: float) -> Array:
    """Move a closed outline outwards along its normals (mean of the two edges at a corner, mitre up to 2)."""
    edge = np.roll(outline, -1, axis=0) - outline
    length = np.linalg.norm(edge, axis=1, keepdims=True)
    unit = edge / np.maximum(length, 1e-300)
    normal = np.stack([unit[:, 1], -unit[:, 0]], axis=1)
    area = np.sum(outline[:, 0] * np.roll(outline[:, 1], -1) - np.roll(outline[:, 0], -1) * outline[:, 1])
    normal *= math.copysign(1.0, area)
    both = normal + np.roll(normal, 1, axis=0)
    size = np.linalg.norm(both, axis=1, keepdims=True)
    out: Array = outline + distance * both / np.maximum(size, 1e-9) * np.minimum(2 / np.maximum(size, 1e-9), 2.0)
    return out


def pchip_slopes(x: Array, y: Array) -> Array:
    """Find the slopes that :func:`pchip` gives the nodes, (N, k)."""
    h = np.diff(x)[:, None]
    d = np.diff(y, axis=0) / h
    if len(x) == 2:
        return np.asarray(np.vstack([d, d]), dtype=np.float64)
    m = np.zeros_like(y)
    h0, h1, d0, d1 = h[:-1], h[1:], d[:-1], d[1:]
    w0, w1 = 2 * h1 + h0, h1 + 2 * h0
    same = d0 * d1 > 0
    safe0, safe1 = np.where(same, d0, 1.0), np.where(same, d1, 1.0)
    m[1:-1] = np.where(same, (w0 + w1) / (w0 / safe0 + w1 / safe1), 0.0)
    for end, a, b in ((0, 0, 1), (-1, -1, -2)):
        s = ((2 * h[a] + h[b]) * d[a] - h[a] * d[b]) / (h[a] + h[b])
        s = np.where(s * d[a] <= 0, 0.0, s)
        m[end] = np.where((d[a] * d[b] <= 0) & (np.abs(s) > 3 * np.abs(d[a])), 3 * d[a], s)
    return m


def pchip(x: Array, y: Array, xq: ArrayLike, slopes: Array | None = None) -> Array:
    """Interpolate monotone-preserving (PCHIP), clamped to the end values outside the data.

    Weighted harmonic mean slopes, one-sided three-point ends: what ``scipy.interpolate.PchipInterpolator`` does,
    without its half-second import. Overshoots nowhere; second order at data extrema, third order elsewhere.

    F. N. Fritsch and J. Butland, A method for constructing local monotone piecewise cubic interpolants, SIAM J. Sci.
    Stat. Comput. 5 (1984) 300-304, doi:10.1137/0905021 (slope formula; not checked against the paper).

    >>> pchip(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 1.0]), [-1.0, 0.5, 1.5, 9.0]).tolist()
    [0.0, 0.6875, 1.0, 1.0]
    """
    y2 = y.reshape(len(x), -1)
    m = pchip_slopes(x, y2) if slopes is None else slopes
    q = np.clip(np.asarray(xq, dtype=np.float64), x[0], x[-1])
    flat = q.ravel()
    i = np.clip(np.searchsorted(x, flat, side="right") - 1, 0, len(x) - 2)
    h = (x[i + 1] - x[i])[:, None]
    t = (flat - x[i])[:, None] / h
    rise, m0, m1 = y2[i + 1] - y2[i], h * m[i], h * m[i + 1]
    out = y2[i] + t * (m0 + t * (3 * rise - 2 * m0 - m1 + t * (m0 + m1 - 2 * rise)))
    return np.asarray(out.reshape(q.shape + y.shape[1:]), dtype=np.float64)
