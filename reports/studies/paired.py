"""Another solver on the same propellers, paired: whose error is smaller, and is the difference more than chance.

``python reports/studies/paired.py uiuc [--peer ccblade] [--out DIR]``. A peer is a file ``peer_NAME.py`` with ``TITLE``
and ``solve(rotor, tables, rpm, J, air)``: rotor, section tables at r/R, (P,) points at sea level; it gives (2, P) CT
and CP in the propeller convention, NaN where it gives none.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from left_out import watch
from numpy.typing import NDArray

from bemt.base.tables import json_text, write_atomic
from bemt.physics.sections.neuralfoil import neuralfoil_polar, tunnel_polar
from bemt.rotors.population import population
from bemt.rotors.validate.points import KINDS, Observed, counted, expect, read_folders
from bemt.rotors.validate.propellers import effects_without, where

Array = NDArray[np.float64]

POINTS = 10
"""Points of each kind per propeller at which the peer is run [1]."""
RESAMPLES = 4000
USUAL = "4412"
"""Section of a user who does not know the blade's: NACA 4412, in a tunnel."""


def paired(seen: Sequence[Observed], name: str, say: Callable[[str], None] | None = None) -> dict[str, Any]:
    """Median error per propeller of the peer and of ours, differences and their bootstrap intervals.

    ``same`` is the peer on the same stations and section tables against the solver as drawn; ``usual`` the peer on the
    same stations as its users run it (NACA 4412, tunnel transition) against the expectation of the rotor as built.
    """
    from geometry.airfoil import naca

    module = importlib.import_module(f"peer_{name}")
    usual = [(0.75, tunnel_polar(naca(USUAL)))]
    errors: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    for i, one in enumerate(seen):
        if say:
            say(f"{i + 1}/{len(seen)} {module.TITLE}: {one.record.name}")
        rows, built = one.drawn, expect(one, population()).rows
        tables = [(x, neuralfoil_polar(shape)) for x, shape in one.solve.rotor.blade.anchors]
        for kind, mask in counted(rows).items():
            index = np.flatnonzero(mask & np.isfinite(rows.CT_bemt))
            if not index.size:
                continue
            index = index[np.unique(np.linspace(0, index.size - 1, min(index.size, POINTS)).round().astype(int))]
            measured = np.array([rows.CT[index], rows.CP[index]])
            for how, sections, own in (("same", tables, rows), ("usual", usual, built)):
                theirs = module.solve(one.solve.rotor, sections, rows.rpm[index], rows.J[index], one.solve.air)
                ours = np.array([own.CT_bemt[index], own.CP_bemt[index]])
                for c, q in enumerate(("CT", "CP")):
                    pair = (_median_error(ours[c], measured[c]), _median_error(theirs[c], measured[c]))
                    errors.setdefault((how, kind, q), []).append(pair)
    out: dict[str, Any] = {"schema": "bemt.paired/1", "peer": module.TITLE, "points_each": POINTS}
    for how in ("same", "usual"):
        out[how] = {kind: {q: difference(errors.get((how, kind, q), [])) for q in ("CT", "CP")} for kind in KINDS}
    return out


def _median_error(value: Array, measured: Array) -> float:
    return float(np.median(np.where(np.isfinite(value), np.abs(value / measured - 1.0), np.inf)))


def difference(pairs: Sequence[tuple[float, float]]) -> dict[str, Any]:
    """Medians of ours and theirs over propellers, propellers won, mean difference with its 95 % bootstrap interval."""
    if not pairs:
        return {"propellers": 0}
    values = np.array(pairs)
    finite = values[np.isfinite(values).all(axis=1)]
    delta = finite[:, 0] - finite[:, 1]
    random = np.random.default_rng(0)
    means = delta[random.integers(0, delta.size, (RESAMPLES, delta.size))].mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return {
        "propellers": int(values.shape[0]),
        "median_ours": float(np.median(values[:, 0])),
        "median_theirs": float(np.median(values[:, 1])),
        "won": int((values[:, 0] < values[:, 1]).sum()),
        "difference": float(delta.mean()),
        "interval95": [float(low), float(high)],
    }


def text(document: dict[str, Any]) -> str:
    """Document of `paired` for people."""
    words = {"same": "solver as drawn, same tables", "usual": f"as built against NACA {USUAL}"}
    head = f"{'ours':>6} {document['peer']:>8} {'won':>8} {'difference':>11}  95 %"
    lines = [f"{'median error per propeller, %':42} {head}"]
    for how, title in words.items():
        for kind in KINDS:
            for q in ("CT", "CP"):
                d = document[how][kind][q]
                if d["propellers"]:
                    low, high = (100 * v for v in d["interval95"])
                    cells = [
                        f"{title + ', ' + kind + ' ' + q:42} {100 * d['median_ours']:6.1f}",
                        f"{100 * d['median_theirs']:8.1f} {d['won']:4d}/{d['propellers']:<3d}",
                        f"{100 * d['difference']:+11.1f}  {low:+.1f} to {high:+.1f}",
                    ]
                    lines.append(" ".join(cells))
    lines.append(f"{document['points_each']} points of each kind per propeller; differences are means over propellers.")
    return "\n".join(lines)


def main(words: list[str] | None = None) -> int:
    """Run the peer, print the table."""
    parser = argparse.ArgumentParser(description="Another solver on the same propellers, paired.")
    parser.add_argument("folders", metavar="DIR", nargs="+", help="folders in the UIUC layout, or uiuc")
    parser.add_argument("--peer", metavar="NAME", default="ccblade", help="file peer_NAME.py (default ccblade)")
    parser.add_argument("--out", metavar="DIR", help="write the table and its document to this folder")
    args = parser.parse_args(words)

    def say(line: str) -> None:
        print(line, file=sys.stderr)

    seen = watch(read_folders([where(name) for name in args.folders]), effects_without([]), say)
    document = paired(seen, args.peer, say)
    if args.out:
        write_atomic(Path(args.out) / f"paired_{args.peer}.json", json_text(document))
        write_atomic(Path(args.out) / f"paired_{args.peer}.txt", text(document) + "\n")
    print(text(document))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
