"""K1/K2 refitted on measured propellers and scored: where the formula holds, and where it fails.

Beside each other: the thesis's constants; its goal-seek (K2 = 1.5, K1 by mean error) repeated on the data; a robust
refit at rest, and one that includes flight. Refits are scored on FILES with the propeller left out of the fit, and on
``--test`` files with the constants of FILES, which must be other files (without FILES, the test is left out of the data
found).

Schema ``bemt.calibration/2``: ``k1k2``, ``scores`` (``calibration`` and ``test``: ``static``, ``flight``, ``J/(P/D)``,
``bands``), ``refused``, ``notes``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.folders import find_data
from bemt.base.tables import json_text, text_table, write_atomic
from bemt.base.units import INCH
from bemt.physics import k1k2 as empirical
from bemt.rotors.k1k2_points import FitPoints, files, load

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


@dataclass(frozen=True)
class K1K2:
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
    "P/D": (0.0, 0.4, 0.6, 0.8, 1.0, np.inf),
    "diameter [in]": (0.0, 6.0, 9.0, 12.0, 16.0, np.inf),
    "tip Mach": (0.0, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5, np.inf),
    "blades": (1.5, 2.5, 3.5, 4.5, np.inf),
}


def _counts(points: FitPoints) -> dict[str, int]:
    return {
        "propellers": len(points.propellers),
        "points": int(points.rpm.size),
        "static": int(np.count_nonzero(points.J == 0)),
        "ducted": sum(p.ducted for p in points.propellers),
    }


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
    points: FitPoints,
    test: FitPoints | None = None,
    draws: int = DRAWS,
    progress: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Fit, leave out, score."""
    notes = [*points.notes, *(test.notes if test else ())]
    if progress:
        progress("K1 and K2")
    k1k2 = _k1k2(points, draws, notes)
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "data": {"calibration": _counts(points), "test": _counts(test) if test else None},
        "k1k2": {name: asdict(c) for name, c in k1k2.items()},
        "scores": {"calibration": None, "test": None},
    }
    for name, which in (("calibration", points), ("test", test)):
        if which is None:
            continue
        CT = {key: CT_k1k2(which, c.K1, c.K2) for key, c in k1k2.items()}
        for key, in_flight in (("refit", False), ("refit_flight", True)) if name == "calibration" else ():
            if key in k1k2:
                CT[key] = left_out(which, in_flight)
        document["scores"][name] = score(which, CT)
    return document | {"refused": [*points.refused, *(test.refused if test else ())], "notes": notes}


def flight(points: FitPoints) -> Mask:
    """Points in flight whose relative error counts: forwards, below `X_MAX`, (N,)."""
    return (points.J > 0) & (points.x < X_MAX)


def ratios(ratio: Array) -> dict[str, Any]:
    """Count ratios of made to measured values. [-]

    >>> ratios(np.array([1.0, 1.1, 1.2, 2.0]))
    {'points': 4, 'median': 1.15, 'within_13': 0.5, 'within_26': 0.75}
    """
    if ratio.size == 0:
        return {"points": 0, "median": None, "within_13": None, "within_26": None}
    e = np.where(np.isfinite(ratio), np.abs(ratio - 1.0), np.inf)
    median = float(np.median(ratio[np.isfinite(ratio)])) if np.any(np.isfinite(ratio)) else None
    return {
        "points": int(ratio.size),
        "median": median,
        "within_13": float(np.mean(e <= NEAR + 1e-12)),
        "within_26": float(np.mean(e <= FAR + 1e-12)),
    }


def _labels(edges: tuple[float, ...]) -> list[str]:
    if edges == _EDGES["blades"]:
        return ["2", "3", "4", "5 and more"]
    return [
        f"below {b:g}" if a == 0.0 else f"{a:g} and more" if np.isinf(b) else f"{a:g} to {b:g}"
        for a, b in zip(edges[:-1], edges[1:], strict=True)
    ]


def score(points: FitPoints, models: Mapping[str, Array]) -> dict[str, Any]:
    """Score models of CT over all points and in bands."""
    open_rotors, positive = ~points.ducted, points.CT > 0
    still, moving = points.J == 0, flight(points)

    def row(mask: Mask) -> dict[str, Any]:
        m = mask & positive
        found: dict[str, Any] = {"propellers": int(np.unique(points.index[m]).size), "points": int(m.sum())}
        found["models"] = {name: ratios(CT[m] / points.CT[m]) for name, CT in models.items()}
        return found

    out: dict[str, Any] = {"static": row(still & open_rotors), "flight": row(moving & open_rotors)}
    x = points.x
    out["J/(P/D)"] = [
        {"band": f"{a:.1f} to {b:.1f}", **row((points.J > 0) & (x >= a) & (x < b) & open_rotors)}
        for a, b in zip(X_EDGES[:-1], X_EDGES[1:], strict=True)
    ]
    values = {
        "P/D": points.P_D,
        "diameter [in]": points.of("diameter_m") / INCH,
        "tip Mach": points.M_tip,
        "blades": points.of("blades"),
    }
    rows: list[dict[str, Any]] = []
    for quantity, v in values.items():
        edges = _EDGES[quantity]
        for label, a, b in zip(_labels(edges), edges[:-1], edges[1:], strict=True):
            for motion, where in (("static", still), ("flight", moving)):
                found = row((v >= a) & (v < b) & where & open_rotors)
                if found["points"]:
                    rows.append({"quantity": quantity, "band": label, "motion": motion, **found})
    for label, duct in (("no", open_rotors), ("yes", ~open_rotors)):
        for motion, where in (("static", still), ("flight", moving)):
            found = row(duct & where)
            if found["points"]:
                rows.append({"quantity": "ducted", "band": label, "motion": motion, **found})
    out["bands"] = rows
    return out


def _found(name: str) -> str:
    """Path as given, or the database of this name (``uiuc/volume-2``)."""
    return name if Path(name).exists() else str(find_data(name) or name)


def _resolved(name: str) -> frozenset[Path]:
    """Files that a name stands for, each under its one true name."""
    return frozenset(file.resolve() for file in files(Path(_found(name))))


def _twice(option: str, names: Iterable[str], seen: dict[Path, str]) -> list[Fault]:
    """Names that stand for files seen before; what they stand for is added to those."""
    faults = []
    hint = "Held-out data must not be fitted" if option == "--test" else "FitPoints that count twice weigh twice"
    for name in names:
        own = _resolved(name)
        again = sorted(own & seen.keys())
        if again:
            some = ", ".join(file.name for file in again[:3]) + (", ..." if len(again) > 3 else "")
            got = f"files that {seen[again[0]]} holds too ({len(again)}: {some})"
            faults.append(Fault(option, name, got, "every file once", hint))
        seen |= {file: f"{option} {name}" for file in own if file not in seen}
    return faults


def _read(given: Sequence[str], test: Sequence[str]) -> tuple[FitPoints, FitPoints | None]:
    """FitPoints to fit, and held out; all faults of both at once."""
    seen: dict[Path, str] = {}
    faults = _twice("FILES", given, seen)
    faults += _twice("--test", test, seen)
    found = frozenset[Path]() if given else _resolved("uiuc")
    held = found & seen.keys()  # of the data that nobody named
    names = given or ["uiuc"]
    if held and held == found:
        faults.append(Fault("--test", "", "all of the data found", "less than all", "Or name other FILES to fit"))
        names = []
    read: list[FitPoints] = []
    for which, without in ((names, held), (test, frozenset[Path]())):
        try:
            read += [load(map(_found, which), without)] if which else []
        except InputError as error:
            faults += error.faults
    if faults:
        raise InputError(faults)
    points = read[0]
    if held:
        note = f"{len(held)} files of --test are left out of uiuc before the fit, with all runs of their propellers"
        points = replace(points, notes=(note, *points.notes))
    return points, read[1] if test else None


def read(given: Sequence[str], test: Sequence[str] = ()) -> tuple[FitPoints, FitPoints | None]:
    """FitPoints to fit (of the data found when none are named) and held-out points; all faults of both at once."""
    if not given and find_data("uiuc") is None:
        hint = "Name files, or fetch a database: bemt lab fetch uiuc"
        raise InputError(Fault("FILES", "", "none, and no UIUC data found", "measured propellers", hint))
    return _read(given, test)


def document(
    points: FitPoints,
    test: FitPoints | None,
    given: Sequence[str],
    held: Sequence[str],
    progress: Callable[[str], None],
) -> dict[str, Any]:
    """Do as `calibrate`, with the names of the files in the document."""
    found = calibrate(points, test, progress=progress)
    names = {"files": [Path(f).name for f in given or ["uiuc"]], "test_files": [Path(f).name for f in held]}
    return {"schema": found["schema"], **names, **found}


def write(found: dict[str, Any], out: str | Path) -> None:
    """Write calibration.json and .txt."""
    folder = Path(out)
    write_atomic(folder / "calibration.json", json_text(found))
    write_atomic(folder / "calibration.txt", text(found) + "\n")


def _cell(row: Mapping[str, Any] | None) -> str:
    if not row or not row["points"] or row["median"] is None:
        return "-"
    return f"{row['median']:.2f} {100 * row['within_13']:3.0f} {100 * row['within_26']:3.0f}"


def _totals(found: Mapping[str, Any]) -> str:
    rows = []
    for key in found["static"]["models"]:
        row = [NAMES.get(key, key), _cell(found["static"]["models"][key]), _cell(found["flight"]["models"][key])]
        row += [_cell(band["models"][key])[:4] for band in found["J/(P/D)"][:5]]
        rows.append(row)
    header = ["thrust, made/measured: median, % in 13, 26 %", "at rest", "in flight"]
    return text_table([*header, *[band["band"] for band in found["J/(P/D)"][:5]]], rows, indent="  ")


def _set(name: str, found: Mapping[str, Any]) -> list[str]:
    s, f = found["static"], found["flight"]
    title = {"calibration": "CALIBRATION, fitted models with the propeller left out", "test": "TEST, held out"}[name]
    models = [k for k in ("thesis", "refit") if k in s["models"]]
    rows = [
        [r["quantity"], r["band"], r["motion"], str(r["propellers"]), str(r["points"]),
         *[_cell(r["models"][k]) for k in models]]
        for r in found["bands"]
    ]  # fmt: skip
    header = ["where", "band", "motion", "propellers", "points", *[NAMES[k] for k in models]]
    return [
        "",
        f"{title}: {s['points']} points of {s['propellers']} propellers at rest, {f['points']} of "
        f"{f['propellers']} in flight (J/(P/D) below 0.8)",
        _totals(found),
        "",
        text_table(header, rows, left=(0, 1, 2), indent="  "),
    ]


def text(doc: Mapping[str, Any]) -> str:
    """Tables for people."""
    rows = []
    for key, c in doc["k1k2"].items():
        spans = [f"{c[k][0]:.4f} to {c[k][1]:.4f}" if c[k][0] == c[k][0] else "-" for k in ("K1_95", "K2_95")]
        rows.append([NAMES[key], f"{c['K1']:.4f}", spans[0], f"{c['K2']:.3f}", spans[1], str(c["points"] or "-"),
                     str(c["propellers"] or "-")])  # fmt: skip
    header = ["F = rho A (vp^2 - vp V) (K1 D/p)^K2", "K1", "95 % (bootstrap)", "K2", "95 %", "points", "propellers"]
    lines = [text_table(header, rows)]
    for name, found in doc["scores"].items():
        if found is not None:
            lines += _set(name, found)
    if doc["refused"]:
        lines += ["", f"Left out ({len(doc['refused'])}):", *[f"  {line}" for line in doc["refused"][:10]]]
        lines += [f"  and {len(doc['refused']) - 10} more (--json lists them)"] if len(doc["refused"]) > 10 else []
    lines += [f"note: {note}" for note in doc["notes"][:10]]
    return "\n".join(lines)
