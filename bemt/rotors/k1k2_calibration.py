"""K1/K2 refitted on measured propellers and scored: where the formula holds, and where it fails.

Beside each other: the thesis's constants; its goal-seek (K2 = 1.5, K1 by mean error) repeated on the data; a robust
refit at rest, and one that includes flight. Refits are scored on FILES with the propeller left out of the fit, and on
``--test`` files with the constants of FILES, which must be other files (without FILES, the test is left out of the data
found).

Schema ``bemt.calibration/2``: ``k1k2``, ``scores`` (``calibration`` and ``test``: ``static``, ``flight``, ``J/(P/D)``,
``bands``), ``refused``, ``notes``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError
from bemt.base.tables import json_text, number_of, text_table, write_atomic
from bemt.base.units import INCH
from bemt.physics import k1k2 as empirical
from bemt.rotors.k1k2_points import FitPoints

# K1 and K2 from measured points: robust regression in logarithms, bootstrap over propellers, the thesis's goal-seek.
#
# With F = (pi/4) rho n^2 D^4 ((P/D)^2 - J P/D) (K1 D/P)^K2, the logarithm of measured CT over (pi/4)((P/D)^2 - J P/D)
# is K2 ln K1 - K2 ln(P/D): a straight line in ln(P/D). FitPoints of one propeller are no independent evidence, so each
# propeller weighs one and the bootstrap draws propellers.

HUBER = 1.345
"""Huber's threshold in robust standard deviations (95 % efficiency on normal errors) [-]."""
X_FLIGHT = 0.8
"""J/(P/D) up to which flight enters the fit of ``refit_flight`` [-]."""
SEED = 20240617
DRAWS = 1000


class K1K2(Documented):
    """Constants with their 95 % intervals."""

    # Constants [-]
    K1: float
    K2: float
    # Bootstrap percentiles over propellers; NaN where not estimated [-]
    K1_95: tuple[float, float] = (float("nan"), float("nan"))
    K2_95: tuple[float, float] = (float("nan"), float("nan"))
    # What they were fitted on
    points: int = 0
    propellers: int = 0
    # Root mean square of made over measured less one, at rest, each propeller left out of its fit [-]
    u: float = float("nan")


THESIS = K1K2(empirical.K1, empirical.K2)


def CT_k1k2(points: FitPoints, K1: float, K2: float) -> Array:
    """Thrust coefficient of the K1/K2 formula, (N,) [-]."""
    pd = points.P_D
    return np.pi / 4.0 * (pd**2 - points.J * pd) * (K1 / pd) ** K2


def usable(points: FitPoints, flight: bool = False) -> NDArray[np.bool_]:
    """Which points the regression may use: open rotors with thrust, at rest (or up to `X_FLIGHT` as well), (N,)."""
    x = points.x
    moving = (x > 0) & (x < X_FLIGHT) & flight
    return np.asarray((points.CT > 0) & ~points.ducted & ((points.J == 0) | moving))


def weights(index: NDArray[np.intp]) -> Array:
    """Weights that make each propeller count once, (N,) [-]."""
    return 1.0 / np.bincount(index)[index]


def huber_line(t: Array, y: Array, w: Array, scale: float | None = None) -> tuple[float, float]:
    """Weighted robust straight line y = a + b t. [-]

    P. J. Huber, "Robust Estimation of a Location Parameter", Annals of Mathematical Statistics 35, 1964, 73-101,
    doi:10.1214/aoms/1177703732. Not checked against the paper.

    >>> t = np.arange(10.0)
    >>> y = 1.0 + 2.0 * t
    >>> y[3] = 50.0
    >>> a, b = huber_line(t, y, np.ones(10))
    >>> round(a, 2), round(b, 2)
    (1.0, 2.0)
    """
    v = w
    a, b = float("nan"), float("nan")
    for _ in range(100):
        before = (a, b)
        total = v.sum()
        mean_t, mean_y = v @ t / total, v @ y / total
        from_mean = t - mean_t
        spread = v @ from_mean**2
        if not spread > 1e-12 * total:
            return float(mean_y), float("nan")
        b = float((v * from_mean) @ (y - mean_y) / spread)
        a = float(mean_y - b * mean_t)
        if abs(a - before[0]) + abs(b - before[1]) < 1e-9:
            break
        e = np.abs(y - a - b * t)
        width = robust_scale(e, w) if scale is None else scale
        v = w * np.minimum(1.0, HUBER * max(width, 1e-12) / np.maximum(e, 1e-12))
    return a, b


def robust_scale(e: Array, w: Array) -> float:
    """Standard deviation by the weighted median of deviations, as if they were normal. [-]

    >>> round(robust_scale(np.array([1.0, 2.0, 3.0, 100.0]), np.ones(4)), 4)
    3.7065
    """
    order = np.argsort(e)
    share = np.cumsum(w[order]) / w.sum()
    # where the share is just one half, the middle of two, however it was rounded
    at = np.minimum(np.searchsorted(share, [0.5 - 1e-9, 0.5 + 1e-9]), e.size - 1)
    return float(1.4826 * np.mean(e[order[at]]))


def _line_data(points: FitPoints) -> tuple[Array, Array]:
    pd = points.P_D
    return np.log(pd), np.log(points.CT / (np.pi / 4.0 * (pd**2 - points.J * pd)))


def _constants(a: float, b: float) -> tuple[float, float]:
    """K1, K2 of the line; both NaN where the line has no slope (K1 = exp(a/K2))."""
    K2 = -b
    return (float(np.exp(a / K2)), K2) if np.isfinite(K2) and abs(K2) > 1e-9 else (float("nan"), float("nan"))


def fit(points: FitPoints, flight: bool = False, draws: int = DRAWS) -> K1K2:
    """Fit both constants."""
    used = points.select(usable(points, flight))
    present = np.unique(used.index)
    if present.size < 3 or np.ptp(np.log(used.P_D)) < 0.05:
        got = f"{present.size} open propellers at rest with thrust" + (" and one P/D" if present.size >= 3 else "")
        raise InputError(Fault("", "points", got, "three or more, of different P/D", "Name more files"))
    t, y = _line_data(used)
    w = weights(used.index)
    a, b = huber_line(t, y, w)
    K1, K2 = _constants(a, b)
    scale = robust_scale(np.abs(y - a - b * t), w)
    rng = np.random.default_rng(SEED)
    rows_of = [np.flatnonzero(used.index == k) for k in present]
    found = []
    for _ in range(draws):
        rows = np.concatenate([rows_of[k] for k in rng.integers(present.size, size=present.size)])
        one = _constants(*huber_line(t[rows], y[rows], w[rows], scale))
        if np.isfinite(one[0]):
            found.append(one)
    out = K1K2(K1, K2, points=used.rpm.size, propellers=present.size)
    if len(found) < max(20, 0.9 * draws):
        return out
    low, high = np.percentile(np.array(found), [2.5, 97.5], axis=0)
    return K1K2(K1, K2, (float(low[0]), float(high[0])), (float(low[1]), float(high[1])), out.points, out.propellers)


def goal_seek(points: FitPoints) -> K1K2:
    """K1 as the thesis's source found it: K2 fixed, mean relative error of the static points zero."""
    used, K2 = points.select(usable(points)), empirical.K2
    mean = float(np.mean(CT_k1k2(used, 1.0, K2) / used.CT))
    return K1K2(mean ** (-1.0 / K2), K2, points=used.rpm.size, propellers=np.unique(used.index).size)


def left_out(points: FitPoints, flight: bool = False) -> Array:
    """CT of every point by constants that were fitted without its propeller, (N,) [-]."""
    mask = usable(points, flight)
    out = np.full(points.rpm.size, np.nan)
    used = points.select(mask)
    t, y = _line_data(used)
    w = weights(used.index)
    for k in np.unique(points.index):
        keep = used.index != k
        own = points.index == k
        K1, K2 = _constants(*huber_line(t[keep], y[keep], w[keep]))
        out[own] = CT_k1k2(points.select(own), K1, K2)
    return out


Mask = NDArray[np.bool_]


class Hits(Documented):
    """Made over measured values: their median, and which share is near."""

    points: int
    median: float | None
    within_13: float | None
    within_26: float | None

    def __str__(self) -> str:
        if not self.points or self.median is None or self.within_13 is None or self.within_26 is None:
            return "-"
        return f"{self.median:.2f} {100 * self.within_13:3.0f} {100 * self.within_26:3.0f}"


class BandScore(Documented):
    """Models over some of the points."""

    propellers: int
    points: int
    models: Mapping[str, Hits]
    quantity: str | None = None
    band: str | None = None
    motion: str | None = None


class Scores(Documented):
    """Models over all points and in bands."""

    static: BandScore
    flight: BandScore
    x: tuple[BandScore, ...]  # By J/(P/D)
    bands: tuple[BandScore, ...]

    def document(self) -> dict[str, Any]:
        """Plain values; the bands of J/(P/D) by that name."""
        own = super().document()
        return own | {"J/(P/D)": own.pop("x")}


class Counts(Documented):
    """What there is of the data."""

    propellers: int
    points: int
    static: int
    ducted: int

    @classmethod
    def of(cls, points: FitPoints) -> Counts:
        """Of points that were read."""
        still, ducted = int(np.count_nonzero(points.J == 0)), sum(p.ducted for p in points.propellers)
        return cls(len(points.propellers), int(points.rpm.size), still, ducted)


class Calibration(Documented):
    """``bemt.calibration/2``; of the test None where there is none."""

    files: tuple[str, ...]
    test_files: tuple[str, ...]
    data: Mapping[str, Counts | None]
    k1k2: Mapping[str, K1K2]
    scores: Mapping[str, Scores | None]
    refused: tuple[str, ...]
    notes: tuple[str, ...]

    def document(self) -> dict[str, Any]:
        """Plain values."""
        return {"schema": SCHEMA, **super().document()}


SCHEMA = "bemt.calibration/2"
NAMES = {
    "thesis": "K1/K2, thesis", "goal_seek": "K1/K2, goal-seek", "refit": "K1/K2, refit at rest",
    "refit_flight": "K1/K2, refit with flight",
}  # fmt: skip
NEAR, FAR = 0.13, 0.26
"""Shares within these relative errors are counted [-]: what the source of K1 and K2 claims for 68 and 95 %."""
X_MAX = 0.8
"""J/(P/D) up to which relative errors in flight are counted: thrust vanishes soon after [-]."""
X_EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
_EDGES: dict[str, tuple[float, ...]] = {
    "P/D": (0.0, 0.4, 0.6, 0.8, 1.0, np.inf), "diameter [in]": (0.0, 6.0, 9.0, 12.0, 16.0, np.inf),
    "tip Mach": (0.0, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5, np.inf), "blades": (1.5, 2.5, 3.5, 4.5, np.inf),
}  # fmt: skip


def _k1k2(points: FitPoints, draws: int, notes: list[str]) -> dict[str, K1K2]:
    """Constants by name; those that cannot be fitted are left out with a note."""
    found = {"thesis": THESIS}
    if np.any(usable(points)):
        found["goal_seek"] = goal_seek(points)
    for name, in_flight in (("refit", False), ("refit_flight", True)):
        try:
            found[name] = fit(points, in_flight, draws)
        except InputError as error:
            notes.append(f"{name} left out: {error}")
    return found


def calibrate(
    points: FitPoints, test: FitPoints | None, given: Sequence[str] = (), held: Sequence[str] = (),
    progress: Callable[[str], None] = lambda line: None,
) -> Calibration:  # fmt: skip
    """Fit, leave out, score; the names of the files stand in the document."""
    notes = [*points.notes, *(test.notes if test else ())]
    down = int(sum(np.sum(p.CT <= 0.0) for p in (points, test) if p))
    notes += [f"{number_of(down, 'point')} without forward thrust: neither fitted nor scored"] if down else []
    progress("K1 and K2")
    k1k2 = _k1k2(points, DRAWS, notes)
    CT = {key: CT_k1k2(points, c.K1, c.K2) for key, c in k1k2.items()}
    apart: dict[str, Array] = {
        key: left_out(points, key == "refit_flight") for key in ("refit", "refit_flight") if key in k1k2
    }
    CT |= apart
    rest = usable(points)
    w = weights(points.index[rest])
    off = {key: np.average((c[rest] / points.CT[rest] - 1.0) ** 2, weights=w) for key, c in apart.items()}
    k1k2 |= {key: replace(k1k2[key], u=float(np.sqrt(v))) for key, v in off.items()}
    tested = None if test is None else score(test, {key: CT_k1k2(test, c.K1, c.K2) for key, c in k1k2.items()})
    return Calibration(
        tuple(Path(f).name for f in given or ["uiuc"]), tuple(Path(f).name for f in held),
        {"calibration": Counts.of(points), "test": Counts.of(test) if test else None}, k1k2,
        {"calibration": score(points, CT), "test": tested},
        (*points.refused, *(test.refused if test else ())), tuple(notes),
    )  # fmt: skip


def flight(points: FitPoints) -> Mask:
    """Points in flight whose relative error counts: forwards, below `X_MAX`, (N,)."""
    return (points.J > 0) & (points.x < X_MAX)


def ratios(ratio: Array) -> Hits:
    """Count ratios of made to measured values. [-]

    >>> ratios(np.array([1.0, 1.1, 1.2, 2.0]))
    Hits(points=4, median=1.15, within_13=0.5, within_26=0.75)
    """
    if ratio.size == 0:
        return Hits(0, None, None, None)
    e = np.where(np.isfinite(ratio), np.abs(ratio - 1.0), np.inf)
    median = float(np.median(ratio[np.isfinite(ratio)])) if np.any(np.isfinite(ratio)) else None
    near, far = (float(np.mean(e <= limit + 1e-12)) for limit in (NEAR, FAR))
    return Hits(int(ratio.size), median, near, far)


def _labels(edges: tuple[float, ...]) -> list[str]:
    if edges == _EDGES["blades"]:
        return ["2", "3", "4", "5 and more"]
    return [
        f"below {b:g}" if a == 0.0 else f"{a:g} and more" if np.isinf(b) else f"{a:g} to {b:g}"
        for a, b in zip(edges[:-1], edges[1:], strict=True)
    ]


def score(points: FitPoints, models: Mapping[str, Array]) -> Scores:
    """Score models of CT over all points and in bands."""
    open_rotors, positive = ~points.ducted, points.CT > 0
    motions = {"static": points.J == 0, "flight": flight(points)}

    def row(mask: Mask, quantity: str | None = None, band: str | None = None, motion: str | None = None) -> BandScore:
        m = mask & positive
        hits = {name: ratios(CT[m] / points.CT[m]) for name, CT in models.items()}
        return BandScore(int(np.unique(points.index[m]).size), int(m.sum()), hits, quantity, band, motion)

    x, edges = points.x, zip(X_EDGES[:-1], X_EDGES[1:], strict=True)
    by_x = [row((points.J > 0) & (x >= a) & (x < b) & open_rotors, band=f"{a:.1f} to {b:.1f}") for a, b in edges]
    values = {"P/D": points.P_D, "diameter [in]": points.of("diameter_m") / INCH, "tip Mach": points.M_tip,
              "blades": points.of("blades")}  # fmt: skip
    parts = [
        (quantity, label, (v >= a) & (v < b) & open_rotors)
        for quantity, v in values.items()
        for label, a, b in zip(_labels(_EDGES[quantity]), _EDGES[quantity][:-1], _EDGES[quantity][1:], strict=True)
    ]
    parts += [("ducted", "no", open_rotors), ("ducted", "yes", ~open_rotors)]
    rows = [row(mask & where, q, label, motion) for q, label, mask in parts for motion, where in motions.items()]
    still, moving = (row(where & open_rotors) for where in motions.values())
    return Scores(still, moving, tuple(by_x), tuple(r for r in rows if r.points))


def write(found: Calibration, out: str | Path) -> None:
    """Write calibration.json and .txt."""
    write_atomic(Path(out) / "calibration.json", json_text(found.document()))
    write_atomic(Path(out) / "calibration.txt", text(found) + "\n")


def _set(name: str, found: Scores) -> list[str]:
    s, f = found.static, found.flight
    title = {"calibration": "CALIBRATION, fitted models with the propeller left out", "test": "TEST, held out"}[name]
    totals = [
        [NAMES.get(k, k), str(s.models[k]), str(f.models[k]), *[str(band.models[k])[:4] for band in found.x[:5]]]
        for k in s.models
    ]
    first = [
        "thrust, made/measured: median, % in 13, 26 %", "at rest", "in flight", *[str(b.band) for b in found.x[:5]],
    ]  # fmt: skip
    models = [k for k in ("thesis", "refit") if k in s.models]
    rows = [
        [str(r.quantity), str(r.band), str(r.motion), str(r.propellers), str(r.points),
         *[str(r.models[k]) for k in models]]
        for r in found.bands
    ]  # fmt: skip
    header = ["where", "band", "motion", "propellers", "points", *[NAMES[k] for k in models]]
    return [
        "",
        f"{title}: {s.points} points of {s.propellers} propellers at rest, {f.points} of {f.propellers} in flight "
        "(J/(P/D) below 0.8)",
        text_table(first, totals, indent="  "),
        "",
        text_table(header, rows, left=(0, 1, 2), indent="  "),
    ]


def text(doc: Calibration) -> str:
    """Tables for people."""
    rows = []
    for key, c in doc.k1k2.items():
        spans = [f"{low:.4f} to {high:.4f}" if low == low else "-" for low, high in (c.K1_95, c.K2_95)]
        rows.append([NAMES[key], f"{c.K1:.4f}", spans[0], f"{c.K2:.3f}", spans[1], str(c.points or "-"),
                     str(c.propellers or "-")])  # fmt: skip
    header = ["F = rho A (vp^2 - vp V) (K1 D/p)^K2", "K1", "95 % (bootstrap)", "K2", "95 %", "points", "propellers"]
    lines = [text_table(header, rows)]
    best = next((doc.k1k2[k] for k in ("refit", "goal_seek") if k in doc.k1k2), THESIS)
    if best.points:
        u = f", u_K1K2 = {best.u:.3f}" if np.isfinite(best.u) else ""
        lines += [
            "",
            f"For the K1/K2 column of a case, in [model], a line each: K1 = {best.K1:.4f}, K2 = {best.K2:.4f}{u}",
        ]
    for name, found in doc.scores.items():
        lines += _set(name, found) if found is not None else []
    if doc.refused:
        lines += ["", f"Left out ({len(doc.refused)}):", *[f"  {line}" for line in doc.refused[:10]]]
        lines += [f"  and {len(doc.refused) - 10} more (--json lists them)"] if len(doc.refused) > 10 else []
    return "\n".join([*lines, *(f"note: {note}" for note in doc.notes[:10])])
