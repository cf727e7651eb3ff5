"""K1/K2 refitted on measured propellers, and the compact formula beside it.

Beside each other: the thesis's constants; its goal-seek (K2 = 1.5, K1 by mean error) repeated on the data; a robust
refit at rest, and one that includes flight; the compact formula (:mod:`bemt.formula.compact`), refitted when enough
propellers have a chord, from measured chords and pitches, from measured chords, and from labels alone. Fitted models
are scored on FILES with the propeller (compact: also its maker) left out of the fit, and on ``--test`` files with the
constants of FILES, which must be other files (without FILES, the test is left out of the data found); beside them
what the same inputs can carry at all (:mod:`bemt.formula.limit`).

Schema ``bemt.calibration/1``: ``k1k2``, ``compact``, ``scores`` (``calibration`` and ``test``: ``static``, ``flight``,
``J/(P/D)``, ``chord_known``, ``bands``, ``power``, ``coverage``, ``limit``), ``refused``, ``notes``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError
from bemt.base.folders import find_data
from bemt.base.tables import json_text, write_atomic
from bemt.formula import compact, refit, score
from bemt.formula import fit as fitting
from bemt.formula.gather import files, load
from bemt.formula.limit import limit
from bemt.formula.points import FitPoints
from bemt.formula.text import text

Array = NDArray[np.float64]

SCHEMA = "bemt.calibration/1"
MODELS = {"compact_pitch": "pitch", "compact": "chord", "compact_no_chord": "label"}
"""Compact models by what they are given, of `bemt.formula.refit.GIVEN`."""


def _counts(points: FitPoints) -> dict[str, int]:
    return {
        "propellers": len(points.propellers),
        "points": int(points.rpm.size),
        "static": int(np.count_nonzero(points.J == 0)),
        "with_chord": sum(bool(np.isfinite(p.chord_m)) for p in points.propellers),
        "ducted": sum(p.ducted for p in points.propellers),
    }


def _k1k2(points: FitPoints, draws: int, notes: list[str]) -> dict[str, fitting.K1K2]:
    """Constants by name; those that cannot be fitted are left out with a note."""
    found = {"thesis": fitting.THESIS}
    if np.any(fitting.usable(points)):
        found["goal_seek"] = fitting.goal_seek(points)
    for name, in_flight in (("refit", False), ("refit_flight", True)):
        try:
            found[name] = fitting.fit(points, in_flight, draws)
        except InputError as error:
            notes.append(f"{name} left out: {error}")
    return found


def calibrate(
    points: FitPoints,
    test: FitPoints | None = None,
    draws: int = fitting.DRAWS,
    progress: Callable[[str], None] | None = None,
) -> tuple[dict[str, Any], dict[str, tuple[FitPoints, dict[str, Array]]]]:
    """Fit, leave out, score."""
    say = progress or (lambda _: None)
    notes = [*points.notes, *(test.notes if test else ())]
    say("K1 and K2")
    k1k2 = _k1k2(points, draws, notes)
    say("compact formula")
    fitted = refit.fit(points)
    if fitted is None:
        few = f"fewer than {refit.MIN_PROPELLERS} propellers with chord and power"
        notes.append(f"compact formula not refitted: {few}; the published constants serve")
    used = fitted or refit.PUBLISHED
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "data": {"calibration": _counts(points), "test": _counts(test) if test else None},
        "k1k2": {name: asdict(c) for name, c in k1k2.items()},
        "compact": {
            "constants": asdict(used.constants),
            "published": asdict(compact.CONSTANTS),
            "refitted": fitted is not None,
            "propellers": used.propellers,
            "chords": used.chords,
            "series": {name: asdict(series) for name, series in used.series.items()},
        },
    }
    sets = {"calibration": points} | ({"test": test} if test else {})
    predictions: dict[str, tuple[FitPoints, dict[str, Array]]] = {}
    document["scores"] = {"calibration": None, "test": None}
    for name, which in sets.items():
        CT = {key: fitting.CT_k1k2(which, c.K1, c.K2) for key, c in k1k2.items()}
        CP: dict[str, Array] = {}
        for key, given in MODELS.items():
            CT[key], CP[key] = refit.predict(which, used, given)
        if name == "calibration":
            for key, in_flight in (("refit", False), ("refit_flight", True)):
                if key in k1k2:
                    CT[key] = fitting.left_out(which, in_flight)
            if fitted:
                _leave_out(which, fitted, CT, CP, document, say)
        found = score.score(which, CT)
        own_chord = np.isfinite(which.of("chord_m"))
        part = score.score(which.select(own_chord), {key: v[own_chord] for key, v in CT.items()})
        found["chord_known"] = {key: part[key] for key in ("static", "flight", "J/(P/D)")}
        found["power"] = score.power_score(which, CP)
        found["coverage"] = {given: score.coverage(which, used, given) for given in refit.GIVEN}
        say("what the inputs carry")
        found["limit"] = {given: limit(which, given) for given in refit.GIVEN}
        document["scores"][name] = found
        predictions[name] = (which, CT)
    document["refused"] = [*points.refused, *(test.refused if test else ())]
    document["notes"] = notes
    return document, predictions


def _leave_out(
    points: FitPoints,
    fitted: refit.Fitted,
    CT: dict[str, Array],
    CP: dict[str, Array],
    document: dict[str, Any],
    say: Callable[[str], None],
) -> None:
    """Replace the compact predictions by those without the propeller, add those without the maker, and the bands."""
    makers = np.unique([p.maker for p in points.propellers], return_inverse=True)[1][points.index]
    for suffix, groups in (("", points.index), ("_maker_out", makers)):
        found = refit.left_out(points, fitted, groups, lambda i, n: say(f"compact formula, left out {i} of {n}"))
        for key, given in MODELS.items():
            CT[key + suffix], CP[key + suffix] = found[given]
    document["compact"]["bands"] = {}
    for key, given in MODELS.items():
        made = [np.where(refit.has(points, given), v[f"{key}_maker_out"], np.nan) for v in (CT, CP)]
        document["compact"]["bands"][given] = refit.bands(points, made[0], made[1], fitted, given)


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
        hint = "Name files, or fetch a database: python -m bemt data uiuc"
        raise InputError(Fault("FILES", "", "none, and no UIUC data found", "measured propellers", hint))
    return _read(given, test)


def document(
    points: FitPoints,
    test: FitPoints | None,
    given: Sequence[str],
    held: Sequence[str],
    progress: Callable[[str], None],
) -> tuple[dict[str, Any], dict[str, tuple[FitPoints, dict[str, Array]]]]:
    """Do as `calibrate`, with the names of the files in the document."""
    found, predictions = calibrate(points, test, progress=progress)
    names = {"files": [Path(f).name for f in given or ["uiuc"]], "test_files": [Path(f).name for f in held]}
    return {"schema": found["schema"], **names, **found}, predictions


def write(found: dict[str, Any], predictions: dict[str, tuple[FitPoints, dict[str, Array]]], out: str | Path) -> None:
    """Write calibration.json, .txt and .png."""
    from bemt.formula.figure import draw

    folder = Path(out)
    write_atomic(folder / "calibration.json", json_text(found))
    write_atomic(folder / "calibration.txt", text(found) + "\n")
    draw(predictions, folder / "calibration.png")
