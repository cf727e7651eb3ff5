"""How far intervals of parameters miss on a development set, and the factors that make them hold.

Items are those of kept proofs whose cause was named: only then does anybody read an interval.  Each is weighed with
its true cause alone.  The score of an item is how many half-widths the truth lies away; the factor is the quantile of
the scores that a new item stays below in nine cases of ten (split conformal).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bemt import __version__, effects
from bemt.diagnose import evidence, fit, signatures
from bemt.diagnose.assemble import build
from bemt.diagnose.explanation import Explanation
from bemt.diagnose.load import load_all
from bemt.proof import seal
from bemt.proof.score import VISIBLE

__all__ = ["SCHEMA", "calibrate", "misses"]

SCHEMA = "bemt.interval_scales/1"
SHARE = 0.9
# Scores from which a parameter has a factor of its own, and what a factor may be: beyond three the law is off.
_ENOUGH = 12
_LOWEST, _HIGHEST = 0.7, 3.0


def misses(folder: Path, say: Callable[[str], None] = lambda _: None) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Open the key of a kept proof; say what set it is, and how many half-widths each true parameter lies off."""
    key = seal.unseal(folder)
    chosen = [e for e in key["items"] if _useful(e) and _named(folder, e)]
    out: list[dict[str, Any]] = []
    for k, entry in enumerate(chosen):
        (cause,) = entry["causes"]
        found = _estimated(folder / "items" / entry["folder"], cause)
        for name, true in entry["parameters"][cause].items():
            if name in found:
                score = _score(found[name], float(true["value"]))
                with_reference = entry.get("referenced", False)
                out.append({"effect": cause, "parameter": name, "score": score, "reference": with_reference})
        say(f"intervals {k + 1}/{len(chosen)}")
    return {k: key[k] for k in ("seed", "size", "version")}, out


def _useful(entry: Mapping[str, Any]) -> bool:
    """Whether an item has one cause that the plan can see, and numbers of it that the library has, too."""
    if len(entry["causes"]) != 1 or entry["set"] == "unlisted" or min(entry["separation"]) < VISIBLE:
        return False
    cls = effects.catalogue()[entry["causes"][0]]
    told = set(entry["parameters"][entry["causes"][0]])
    return bool(told) and told <= {p.name for p in cls.parameters} - set(cls.discrete)


def _named(folder: Path, entry: Mapping[str, Any]) -> bool:
    """Whether the kept answer names the cause."""
    answer = json.loads((folder / "answers" / f"{entry['folder']}.json").read_text(encoding="utf-8"))["answer"]
    return bool(answer) and answer["effects"] == entry["causes"] and answer["verdict"] in ("named", "sensor")


def _estimated(folder: Path, cause: str) -> Mapping[str, Mapping[str, float]]:
    """Parameters of the true cause, as a diagnosis would give them before any factor."""
    known = [str(folder / "reference.csv")] if (folder / "reference.csv").exists() else []
    cases, records = load_all([str(folder / "recording.csv")], [str(folder / "case.toml")], known, [], ())
    speed = effects.catalogue()[cause].kind == "drive"
    some = [r.only(("rpm",) if speed else ("thrust_N", "torque_Nm")) for r in records]
    with evidence.one_thread():
        problem = build(some, cases)
        candidates, absent = signatures.candidates(problem, [cause])
        if absent:
            return {}
        found = evidence.weigh(problem, candidates, pairs=False)
        return fit.refined(found, fit.fit(found, Explanation.of(cause)))[1][cause]


def _score(told: Mapping[str, float], true: float) -> float:
    """Distance of the truth from the estimate in half-widths on its side [1]."""
    off = true - told["value"]
    half = told["high"] - told["value"] if off > 0 else told["value"] - told["low"]
    return abs(off) / max(half, 1e-12)


def calibrate(found: Sequence[Mapping[str, Any]], sets: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Document of the factors, with where they come from."""
    by_name: dict[str, list[float]] = {}
    by_kind: dict[str, list[float]] = {}
    for m in found:
        by_name.setdefault(f"{m['effect']}.{m['parameter']}", []).append(m["score"])
        by_kind.setdefault(effects.catalogue()[m["effect"]].kind, []).append(m["score"])
    return {
        "schema": SCHEMA, "version": __version__, "sets": list(sets), "share": SHARE,
        "kinds": {k: _factor(v) for k, v in sorted(by_kind.items())},
        "parameters": {k: _factor(v) for k, v in sorted(by_name.items()) if len(v) >= _ENOUGH},
    }  # fmt: skip


def _factor(scores: Sequence[float]) -> dict[str, Any]:
    """Conformal quantile of the scores, their number, and the share that needed no factor."""
    n = len(scores)
    rank = min(math.ceil(SHARE * (n + 1)), n)
    scale = float(np.clip(np.sort(scores)[rank - 1], _LOWEST, _HIGHEST))
    return {"scale": round(scale, 3), "n": n, "held": round(float(np.mean(np.array(scores) <= 1.0)), 3)}
