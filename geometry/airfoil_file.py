"""Section files: coordinates in Selig or Lednicer form."""

from __future__ import annotations

import math

import numpy as np

from geometry.airfoil import Airfoil
from geometry.common import Faults


def _numbers(text: str, faults: Faults) -> tuple[str, list[tuple[int, float, float]]]:
    """Read title and number pairs with their line numbers; note what is neither."""
    title = ""
    rows: list[tuple[int, float, float]] = []
    for number, line in enumerate(text.lstrip("\ufeff").splitlines(), start=1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            values = [float(word) for word in words]
        except ValueError:
            if not title and not rows:
                title = line.strip()
            else:
                faults.add(f"line {number}", repr(line.strip()), "two numbers, x and y")
            continue
        if len(values) != 2 and not title and not rows:
            title = line.strip()  # such as "23012"
        elif len(values) != 2 or not all(map(math.isfinite, values)):
            faults.add(f"line {number}", repr(line.strip()), "two finite numbers, x and y")
        else:
            rows.append((number, values[0], values[1]))
    return title, rows


def parse_dat(text: str, name: str = "") -> Airfoil:
    r"""Read a section file in Selig or Lednicer form.

    >>> from geometry.airfoil import naca
    >>> section = naca("2412")
    >>> text = "my section" + "".join(f"\n{x:.6f} {y:.6f}" for x, y in zip(section.x, section.y))
    >>> parse_dat(text).name, round(parse_dat(text).thickness, 3)
    ('my section', 0.12)
    """
    faults = Faults()
    title, rows = _numbers(text, faults)
    counts: tuple[int, int] | None = None
    if rows and rows[0][1] > 1.5 and rows[0][2] > 1.5 and all(v == int(v) for v in rows[0][1:]):
        counts = (int(rows[0][1]), int(rows[0][2]))
        rows = rows[1:]
    if len(rows) < 7 and not faults.found:
        faults.add("section file", f"{len(rows)} points", "7 points or more", "Is it a coordinate file?")
    if counts is not None and sum(counts) != len(rows) and not faults.found:
        faults.add(
            "section file",
            f"{len(rows)} points",
            f"{counts[0]} + {counts[1]} as its second line says",
            "Truncated file?",
        )
    faults.check()
    points = np.array([row[1:] for row in rows])
    if not (abs(points[:, 0].max() - 1) <= 0.02 and abs(points[:, 0].min()) <= 0.02):
        hint = "Coordinates in percent or millimetres? Divide by the chord" if points[:, 0].max() > 1.5 else ""
        got = f"x from {points[:, 0].min():g} to {points[:, 0].max():g}"
        faults.add("section file", got, "x from 0 to 1 (unit chord)", hint)
    faults.check()
    if counts is not None or points[0, 0] < 0.5 * points[:, 0].max():
        fall = np.diff(points[:, 0])
        if counts is None and fall.min() > -0.5:  # a loop that starts at the nose
            cut = int(np.argmax(points[:, 0]))
            points = np.vstack([points[cut:], points[: cut + 1]])
        else:  # Lednicer; without counts the second side starts where x falls back to the nose
            cut = counts[0] if counts is not None else int(np.argmin(fall)) + 1
            points = np.vstack([points[:cut][::-1], points[cut:]])
    points = points[np.concatenate([[True], np.abs(np.diff(points, axis=0)).max(axis=1) > 1e-9])]
    x, y = points.T
    if np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0:
        x, y = x[::-1], y[::-1]
    return Airfoil(name or title or "section", x, y)
