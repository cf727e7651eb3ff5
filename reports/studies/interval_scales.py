"""How far told intervals miss on a development set, and the factors that make them hold.

``python reports/studies/interval_scales.py DIR ... --out bemt/judge/diagnose/interval_scales.json`` writes the factors
on the intervals that kept proofs (``bemt lab prove --out DIR``) show.

Items are those of kept proofs whose cause was named: only then does anybody read an interval.  The score of a parameter
is how many half-widths, before the factor in use, the truth lies away; the new factor is the quantile of the scores
that a new item stays below in nine cases of ten (split conformal).  Half-widths end at physical ranges.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bemt import __version__
from bemt.base.tables import json_text, write_atomic
from bemt.judge.diagnose.fit import scale_of
from bemt.judge.proof import rows
from bemt.judge.proof.rows import Entry, Estimate
from bemt.judge.proof.score import VISIBLE, judge
from bemt.physics import effects

SCHEMA = "bemt.interval_scales/1"
SHARE = 0.9
# Scores from which a parameter has a factor of its own, and what a factor may be: beyond three the law is off.
_ENOUGH = 12
_LOWEST, _HIGHEST = 0.7, 3.0


@dataclass(frozen=True)
class Off:
    """Half-widths that a true parameter is off."""

    name: str  # effect.parameter
    score: float


def misses(folder: Path) -> tuple[dict[str, str], list[Off]]:
    """Open the key of a kept proof, answered with the factors in use; half-widths that each true parameter is off."""
    key = rows.unseal(folder)
    out = []
    for entry in key.items:
        told = _told(folder, entry)
        for cause, parameters in entry.parameters.items():
            for name, true in parameters.items():
                found = told.get(name) or told.get(f"{cause}.{name}")
                if found and found.low < found.high:
                    out.append(Off(f"{cause}.{name}", _score(found, true.value) * scale_of(cause, name)))
    return {"seed": key.seed, "size": key.size, "version": key.version}, out


def _told(folder: Path, entry: Entry) -> Mapping[str, Estimate]:
    """Parameters that the kept answer gives where it names the causes and the plan can see them."""
    if not entry.causes or entry.set == "unlisted" or min(entry.separation) < VISIBLE:
        return {}
    answer = rows.stored(folder / "answers" / f"{entry.folder}.json").answer
    if not judge(entry, answer).right or set(answer.effects) != set(entry.causes):
        return {}
    listed = {frozenset(r.effect.split("+")): r.parameters for r in answer.ranking}
    found = listed.get(frozenset(entry.causes), {})
    return {k: v for k, v in found.items() if isinstance(v.value, float)}


def _score(told: Estimate, true: float) -> float:
    """Distance of the truth from the estimate in half-widths on its side [1]."""
    value = float(told.value)
    off = true - value
    half = told.high - value if off > 0 else value - told.low
    return abs(off) / max(half, 1e-12)


def calibrate(found: Sequence[Off], sets: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Document of the factors, with where they come from; a kind is calibrated on those without one of their own."""
    by_name: dict[str, list[float]] = {}
    for m in found:
        by_name.setdefault(m.name, []).append(m.score)
    own = {k: v for k, v in sorted(by_name.items()) if len(v) >= _ENOUGH}
    by_kind: dict[str, list[float]] = {}
    for name, scores in by_name.items():
        if name not in own:
            by_kind.setdefault(effects.catalogue()[name.split(".")[0]].kind, []).extend(scores)
    return {
        "schema": SCHEMA, "version": __version__, "sets": list(sets), "share": SHARE,
        "kinds": {k: _factor(v) for k, v in sorted(by_kind.items())},
        "parameters": {k: _factor(v) for k, v in own.items()},
    }  # fmt: skip


def _factor(scores: Sequence[float]) -> dict[str, float]:
    """Conformal quantile of the scores, their number, and the share that needed no factor.

    Between ranks: the next higher one holds 95 % where there are eighteen.
    """
    n = len(scores)
    quantile = np.interp(SHARE * (n + 1), np.arange(1, n + 1), np.sort(scores))
    scale = float(np.clip(quantile, _LOWEST, _HIGHEST))
    return {"scale": round(scale, 3), "n": n, "held": round(float(np.mean(np.array(scores) <= 1.0)), 3)}


def main(words: list[str] | None = None) -> int:
    """Write the factors."""
    parser = argparse.ArgumentParser(description="Factors on the intervals of a diagnosis.")
    parser.add_argument("folders", metavar="DIR", nargs="+", type=Path, help="kept proofs")
    parser.add_argument("--out", metavar="FILE", type=Path, required=True)
    args = parser.parse_args(words)
    sets, found = zip(*(misses(folder) for folder in args.folders), strict=True)
    write_atomic(args.out, json_text(calibrate([m for some in found for m in some], sets)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
