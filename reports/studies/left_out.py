"""The population fitted to folders of measured propellers, and how well it does for families left out of it.

``python reports/studies/left_out.py uiuc uiuc_2 --out reports/validation/left_out`` writes the table; ``--fit FILE``
writes the population that the package ships (`bemt/rotors/population.json`).
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from population_fit import fit

from bemt import __version__
from bemt.base.tables import json_text, plain, write_atomic
from bemt.physics.coefficients import M_tip
from bemt.rotors.conditioning import ReferenceRun, condition, noise_of_run, scatter
from bemt.rotors.latents import Prior
from bemt.rotors.population import WEIGHTS, Population
from bemt.rotors.validate.points import (
    J_SHARE,
    KINDS,
    Expected,
    Folder,
    Observed,
    Pool,
    counted,
    expect,
    law,
    lying,
    observe,
    read_folders,
)
from bemt.rotors.validate.propellers import effects_without, where
from bemt.rotors.validity import Validity

if TYPE_CHECKING:
    from bemt.physics.effects import Effect

SCHEMA = "bemt.left_out/3"
RUN_POINTS = 24
"""Points of a run on which a rotor is conditioned [1]."""
GROUPS = 6
"""Families are left out in so many groups, dealt out by name."""
# Steps of the search with a family left out, from the numbers of all families.
_STEPS_LEFT_OUT = 10
_WORDS = {
    "as_drawn": "solver on the stations as given",
    "family_known": "as built, its family in the population",
    "unseen": "as built, family and section unknown",
    "on_static": "the same, after its static run",
    "on_static_and_one": "the same, after static run and one flight point",
    "on_hover": "the same, after one hover thrust",
    "on_hover_and_one": "the same, after that thrust and one flight point",
}
Say = Callable[[str], None] | None


def watch(folder: Folder, effects: Sequence[Effect], say: Say = None) -> list[Observed]:
    """Solve every propeller of a folder with its slopes."""
    out = []
    for i, (p, stations) in enumerate(folder.propellers):
        if say:
            say(f"{i + 1}/{len(folder.propellers)} {p.name}")
        out.append(observe(p, effects, stations))
    return out


def fit_population(seen: Sequence[Observed], name: str) -> tuple[Population, Any]:
    """Population of measured propellers and the numbers of its search."""
    provenance = {
        "propellers": len(seen),
        "points": int(sum(s.record.J.size for s in seen)),
        "folder": name,
        "families": sorted({s.record.family for s in seen}),
        "version": __version__,
        "command": f"reports/studies/left_out.py {name} --fit FILE",
        "source": "UIUC Propeller Database (Brandt, Deters, Ananda, Dantsker, Selig)",
    }
    p, numbers = fit([s.record for s in seen], provenance=provenance)
    return replace(p, validity=Validity.of_rotors(map(_covered, seen))), numbers


def _covered(one: Observed) -> Validity:
    """Ranges that the points of one propeller cover."""
    rotor, m, J0 = one.solve.rotor, one.record, one.drawn.J0_bemt
    fastest = M_tip(one.drawn.rpm.max() / 60.0, m.diameter_m, one.solve.air.a_sound)
    x = m.J / J0 if math.isfinite(J0) else np.zeros(1)
    return Validity.of_rotor(m.diameter_m, rotor.B, rotor.blade.pitch_m() / rotor.D, x, m.Re, fastest)


def leave_out(seen: Sequence[Observed], name: str, fitted: tuple[Population, Any], say: Say = None) -> dict[str, Any]:
    """Every family predicted by a population fitted without it and its group, sections unknown unless published."""
    everything, numbers = fitted
    pools = {key: Pool() for key in _WORDS}
    families = sorted({s.record.family for s in seen})
    for group in (families[i::GROUPS] for i in range(min(GROUPS, len(families)))):
        if say:
            say(f"without {', '.join(group)}")
        p, _ = fit([s.record for s in seen if s.record.family not in group], numbers, _STEPS_LEFT_OUT)
        for one in (s for s in seen if s.record.family in group):
            for key, population in (("family_known", everything), ("unseen", p)):
                found = expect(one, population)
                pools[key].add(found.rows, found)
            pools["as_drawn"].add(one.drawn)
            if one.record.static.any() and not one.record.static.all():
                for on in (key.removeprefix("on_") for key in _WORDS if key.startswith("on_")):
                    told = conditioned(one, p, on)
                    pools[f"on_{on}"].add(told.rows, told, KINDS if on.startswith("hover") else ("forward",))
    out = {"schema": SCHEMA, "folder": name, "families": families} | {
        k: pool.total().document() for k, pool in pools.items()
    }
    return out | {"transfer": transfer(seen, numbers, say)}


def transfer(seen: Sequence[Observed], numbers: Any, say: Say = None) -> dict[str, Any]:
    """Each volume of the data predicted by a population fitted to the others, families of the volume unknown."""
    volumes = sorted({Path(s.propeller.folder).name for s in seen})
    out = {}
    for volume in volumes if len(volumes) > 1 else []:
        if say:
            say(f"without {volume}")
        mine = [s for s in seen if Path(s.propeller.folder).name == volume]
        p, _ = fit([s.record for s in seen if s not in mine], numbers, _STEPS_LEFT_OUT)
        pool = Pool()
        for one in mine:
            found = expect(one, replace(p, families={}))
            pool.add(found.rows, found)
        out[volume] = pool.total().document()
    return out


def conditioned(seen: Observed, p: Population, on: str) -> Expected:
    """Expectation after conditioning on some points, see `told_by`; the other ones count."""
    told, drawn = lying(seen, p, *conditioned_law(seen, p, on)), seen.drawn
    kinds = counted(drawn)
    known = np.zeros(drawn.J.size, bool)
    known[
        np.flatnonzero(np.logical_or.reduce(list(kinds.values())) & np.isfinite(drawn.CT_bemt))[told_by(seen, on)]
    ] = True
    left = {
        name: {k: {q: v[~known[kinds[k]]] for q, v in of.items()} for k, of in getattr(told, name).items()}
        for name in ("probability", "width", "log_density")
    }
    return replace(told, rows=replace(told.rows, CT=np.where(known, np.nan, told.rows.CT)), **left)


def told_by(seen: Observed, on: str) -> np.ndarray:
    """Points of the record on which a rotor is conditioned, (P,).

    ``on`` is ``static``, ``forward``, ``all``, or ``hover``, one point in the middle of the static run; with
    ``_and_one`` the forward point nearest to half of the zero-thrust J too.
    """
    m, kind = seen.record, on.removesuffix("_and_one")
    run = np.flatnonzero(
        {"static": m.static, "forward": ~m.static, "hover": m.static}.get(kind, np.ones(m.J.size, bool))
    )
    few = run[np.unique(np.linspace(0, run.size - 1, min(run.size, RUN_POINTS)).round().astype(int))]
    run = run[np.argsort(m.Re[run])[run.size // 2 :][:1]] if kind == "hover" else few
    if kind == on:
        return run
    J0 = seen.drawn.J0_bemt
    middle = 0.5 * (J0 if math.isfinite(J0) else float(m.J.max()) / J_SHARE)
    return np.append(run, np.argmin(np.where(m.static, np.inf, np.abs(m.J - middle))))


def conditioned_law(seen: Observed, p: Population, on: str) -> tuple[Prior, ReferenceRun]:
    """Latent numbers of a propeller and rows of the run after conditioning on `told_by`, of a hover on its thrust."""
    m, drawn, run = seen.record, seen.drawn, told_by(seen, on)
    here = np.logical_or.reduce(list(counted(drawn).values())) & np.isfinite(drawn.CT_bemt)
    rpm, J = drawn.rpm[here], drawn.J[here]
    prior, at, y = law(p, m), m.part(run), m.y[:, run]
    if on.startswith("hover"):
        y[1, 0] = np.nan
    still = m.static[run]
    rough = np.array([[scatter(a, at.Re[still])] for a in (y - at.f)[:, still]]) * still
    noise = noise_of_run(p, at, y, np.hypot(p.noise_sd(at), rough))
    bias = p.bias(m)[:, run].reshape(-1)
    found = condition(
        lambda z: seen.solve(z, rpm[run], J[run]).reshape(-1) + bias, prior, y.reshape(-1), noise, p.rest_sizes, WEIGHTS
    )
    reference = ReferenceRun.given(at, noise, y.reshape(-1), found)
    return Prior(found.mean, found.cov, np.ones(1), np.ones(1), "reference"), reference


def log_score(total: dict[str, Any]) -> float:
    """Mean log score over CT and CP, static and forward."""
    return float(sum(total[kind][q]["log_score"] for kind in KINDS for q in ("CT", "CP")) / 4.0)


def table(document: dict[str, Any]) -> str:
    """Document of `leave_out` for people."""
    head = (
        f"{'each family held out of the population':60} {'median':>7} {'p90':>6} {'68 %':>6} {'95 %':>6} {'width':>6}"
    )
    lines = [head]
    named = [(document[key], text) for key, text in _WORDS.items()]
    named += [(total, f"{volume}, fitted to the other") for volume, total in document["transfer"].items()]
    for total, text in named:
        for kind in KINDS:
            for q in ("CT", "CP"):
                s = total[kind][q]
                if s["median_abs"] is None or math.isnan(s["median_abs"]):
                    continue
                held = s.get("coverage", {"68": None, "95": None})
                cells = [s["median_abs"], s["p90_abs"], held["68"], held["95"], s.get("width68")]
                shown = [f"{'-':>6}" if v is None else f"{100 * v:6.1f}" for v in cells]
                lines.append(f"{text + ', ' + kind + ' ' + q:60}  {' '.join(shown)}")
    n = document["unseen"]
    scores = [log_score(total) for total in (n, *document["transfer"].values())]
    lines += [
        "",
        f"Percent of the measured value; {len(document['families'])} families in {GROUPS} groups; static"
        f" {n['static']['points']} points of {n['static']['propellers']} propellers, forward"
        f" {n['forward']['points']} of {n['forward']['propellers']}.",
        f"Mean log score of held-out families and of each volume: {', '.join(f'{s:.3f}' for s in scores)}.",
        "68 %, 95 %: share of the points inside those intervals; width: median half width of the 68 % interval.",
    ]
    return "\n".join(lines)


def main(words: list[str] | None = None) -> int:
    """Fit the population; write it, or leave families out of it."""
    parser = argparse.ArgumentParser(description="Families held out of the population of measured rotors.")
    parser.add_argument("folders", metavar="DIR", nargs="+", help="folders in the UIUC layout, or uiuc")
    parser.add_argument("--fit", metavar="FILE", help="write the population, and leave no family out")
    parser.add_argument("--off", metavar="EFFECT", action="append", default=[], help="without this effect")
    parser.add_argument("--out", metavar="DIR", help="write the table and its document to this folder")
    args = parser.parse_args(words)
    folder, name = read_folders([where(f) for f in args.folders]), " ".join(args.folders)

    def say(line: str) -> None:
        print(line, file=sys.stderr)

    seen = watch(folder, effects_without(args.off), say)
    fitted = fit_population(seen, name)
    if args.fit:
        write_atomic(Path(args.fit), json_text(plain(fitted[0].document(), 6)))
        return 0
    document = leave_out(seen, name, fitted, say)
    if args.out:
        write_atomic(Path(args.out) / "left_out.json", json_text(document))
        write_atomic(Path(args.out) / "left_out.txt", table(document) + "\n")
    print(table(document))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
