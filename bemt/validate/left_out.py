"""The population fitted to folders of measured propellers, and how well it does for families left out of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt import __version__
from bemt.base.tables import plain
from bemt.coefficients import M_tip
from bemt.rotors.fit import fit
from bemt.rotors.population import Population
from bemt.rotors.validity import Validity
from bemt.validate.built import Observed, conditioned, expect, observe
from bemt.validate.points import KINDS
from bemt.validate.pool import Pool

if TYPE_CHECKING:
    from bemt.effects import Effect
    from bemt.validate.folder import Folder

SCHEMA = "bemt.left_out/3"
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
        "command": f"bemt validate {name} --fit-population FILE",
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
                for on in ("static", "static_and_one"):
                    pools[f"on_{on}"].add_kind(conditioned(one, p, on), "forward")
    out = {"schema": SCHEMA, "folder": name, "families": families} | {k: pool.total() for k, pool in pools.items()}
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
        out[volume] = pool.total()
    return out


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
                if s["median_abs"] is None:
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


def document_of(p: Population) -> dict[str, Any]:
    """Plain values of a population for its file."""
    out: dict[str, Any] = plain(p.document(), 6)
    return out
