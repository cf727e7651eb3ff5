"""The population fitted to folders of measured propellers, and how well it does for families left out of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bemt import __version__
from bemt.base.tables import plain
from bemt.base.units import INCH
from bemt.coefficients import M_tip
from bemt.rotors.fit import fit
from bemt.rotors.population import Population
from bemt.rotors.validity import Validity
from bemt.sections import rule as section_rule
from bemt.validate.built import Observed, conditioned, expect, observe
from bemt.validate.points import KINDS
from bemt.validate.pool import Pool
from bemt.validate.static_limit import from_static

if TYPE_CHECKING:
    from bemt.effects import Effect
    from bemt.validate.folder import Folder

SCHEMA = "bemt.left_out/2"
LARGE_IN = 8.9
"""Propellers of 9 in and more are reported beside all [in]."""
# Steps of the search with a family left out, from the numbers of all families.
_STEPS_LEFT_OUT = 15
_WORDS = {
    "as_drawn": "solver on the stations as given", "declared": "as built",
    "general_section": "as built, calibrated sections treated as unknown",
    "as_drawn_large": "solver, 9 in and more", "declared_large": "as built, 9 in and more",
    "on_static": "conditioned on the rotor's static run",
    "on_static_and_one": "on its static run and one forward point", "on_forward": "conditioned on its forward runs",
}  # fmt: skip
_LIMITS = {
    "constant": "{}, best without a static run, answers known",
    "seen": "{}, best line from the static run, answers known",
    "left_out": "{}, best line from the static run, rotor left out",
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
        "points": int(sum(s.record.x.size for s in seen)),
        "folder": name,
        "families": sorted({s.record.family for s in seen}),
        "version": __version__,
        "command": f"python -m bemt validate {name} --fit-population FILE",
        "source": "UIUC Propeller Database (Brandt, Deters, Ananda, Dantsker, Selig)",
    }
    p, numbers = fit([s.record for s in seen], provenance=provenance)
    return replace(p, validity=Validity.of_rotors(map(_covered, seen))), numbers


def _covered(one: Observed) -> Validity:
    """Ranges that the points of one propeller cover."""
    rotor, m = one.solve.rotor, one.record
    fastest = M_tip(one.drawn.rpm.max() / 60.0, m.diameter_m, one.solve.air.a_sound)
    return Validity.of_rotor(m.diameter_m, rotor.B, rotor.blade.pitch_m() / rotor.D, m.x, m.Re, fastest)


def leave_out(
    folder: Folder, seen: Sequence[Observed], effects: Sequence[Effect], name: str, say: Say = None
) -> dict[str, Any]:
    """Every family predicted by a population fitted without it.

    ``declared`` keeps the section rule as it is, whose cambers of a few families were calibrated on volume 1;
    ``general_section`` takes those families for unknown, which is what a new family meets.
    """
    _, numbers = fit_population(seen, name)
    pools = {key: Pool() for key in _WORDS}
    families = sorted({s.record.family for s in seen})
    stations = {p.name: s for p, s in folder.propellers}
    for i, family in enumerate(families):
        if say:
            say(f"{i + 1}/{len(families)} without {family}")
        p, _ = fit([s.record for s in seen if s.record.family != family], numbers, _STEPS_LEFT_OUT)
        for one in (s for s in seen if s.record.family == family):
            found = expect(one, p)
            for other_kind, on in (("forward", "static"), ("forward", "static_and_one"), ("static", "forward")):
                if one.record.static.any() and not one.record.static.all():
                    pools[f"on_{on}"].add_kind(conditioned(one, p, on), other_kind)
            large = one.record.diameter_m >= LARGE_IN * INCH
            for key in ("declared", *(["declared_large"] if large else [])):
                pools[key].add(found.rows, found)
            for key in ("as_drawn", *(["as_drawn_large"] if large else [])):
                pools[key].add(one.drawn)
            if section_rule.source(family) == "published":
                pools["general_section"].add(found.rows, found)
            else:
                other = observe(one.propeller, effects, stations[one.record.name], general=True)
                found = expect(other, p)
                pools["general_section"].add(found.rows, found)
    out = {"schema": SCHEMA, "folder": name, "families": families} | {k: pool.total() for k, pool in pools.items()}
    return out | {"transfer": transfer(seen, say), "static_limit": static_limit(seen)}


def static_limit(seen: Sequence[Observed]) -> dict[str, Any]:
    """What the static runs can tell of flight at best."""
    return from_static([s.record for s in seen], [s.drawn.J0_bemt / s.drawn.J0 - 1.0 for s in seen])


def transfer(seen: Sequence[Observed], say: Say = None) -> dict[str, Any]:
    """Each volume (folder of the data) predicted by a population fitted to the others."""
    volumes = sorted({s.propeller.folder for s in seen})
    out = {}
    for folder in volumes if len(volumes) > 1 else []:
        if say:
            say(f"without {Path(folder).name}")
        p, _ = fit([s.record for s in seen if s.propeller.folder != folder])
        pool = Pool()
        for one in (s for s in seen if s.propeller.folder == folder):
            found = expect(one, p)
            pool.add(found.rows, found)
        out[Path(folder).name] = pool.total()
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
    limit = document["static_limit"]
    for q, name in (("CT", "forward CT"), ("CP", "forward CP"), ("J0", "zero-thrust J")):
        for key, text in _LIMITS.items():
            if limit[q][key]["median_abs"] is None:
                continue
            errors = f"{100 * limit[q][key]['median_abs']:6.1f} {100 * limit[q][key]['p90_abs']:6.1f}"
            lines.append(f"{text.format(name):60}  {errors}")
    n = document["declared"]
    scores = [log_score(total) for total in (n, *document["transfer"].values())]
    lines += [
        "",
        f"Percent of the measured value; {len(document['families'])} families; static {n['static']['points']} points of"
        f" {n['static']['propellers']} propellers, forward {n['forward']['points']} of {n['forward']['propellers']}.",
        f"Mean log score of held-out families and of each volume: {', '.join(f'{s:.3f}' for s in scores)}.",
        "68 %, 95 %: share of the points inside those intervals; width: median half width of the 68 % interval.",
    ]
    return "\n".join(lines)


def document_of(p: Population) -> dict[str, Any]:
    """Plain values of a population for its file."""
    out: dict[str, Any] = plain(p.document(), 6)
    return out
