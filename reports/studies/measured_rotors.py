"""The measured propellers that the package ships, and how well one measurement tells another.

``python reports/studies/measured_rotors.py uiuc uiuc_2 --out bemt/rotors/measured.npz`` writes the file; ``--pairs``
instead predicts every propeller that was measured more than once, as two pieces or in two volumes, from its label
alone and from its label with each other measurement. ``--sittings`` does so for what was measured in two sittings: by
other people, or with other propellers between (names of files carry initials and a number that counts runs).
"""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from left_out import conditioned_law, watch

from bemt.base.units import INCH
from bemt.data.readers.uiuc import UiucPropeller
from bemt.physics.air import Air
from bemt.rotors import measured
from bemt.rotors.as_measured import as_measured
from bemt.rotors.case import Case, case_of, fresh
from bemt.rotors.case.propagate import propagate
from bemt.rotors.case.reading import with_reading
from bemt.rotors.conditioning import apart
from bemt.rotors.measured import MeasuredRotor
from bemt.rotors.population import Population, population
from bemt.rotors.predict import predict
from bemt.rotors.validate.points import Folder, Observed, Stations, counted, read_folders
from bemt.rotors.validate.propellers import effects_without, where

STILL, FLIGHT = 3, 9
"""Smooth readings at rest and in flight; all of one kind where the other was not measured [1]."""
APART = 20
"""Runs from which on others lay between, of at most nine of one propeller [1]."""


def smooth(seen: Observed, p: Population) -> tuple[np.ndarray, ...]:
    """Latent numbers of the stations, their sds, and a dozen readings of the fit: rpm, J, y and sd, (2, P) each."""
    m = seen.record
    posterior, reference = conditioned_law(seen, p, "all")
    rows = [np.flatnonzero(m.static), np.flatnonzero(~m.static)]
    rows = [rows[0][np.argsort(m.Re[rows[0]])], rows[1][np.argsort(m.J[rows[1]])]]
    many = [STILL, FLIGHT] if all(r.size for r in rows) else [STILL + FLIGHT] * 2
    chosen = np.concatenate([
        r[np.linspace(0, r.size - 1, n).round().astype(int)] for r, n in zip(rows, many, strict=True) if r.size
    ])  # fmt: skip
    good = np.logical_or.reduce(list(counted(seen.drawn).values())) & np.isfinite(seen.drawn.CT_bemt)
    rpm, J = seen.drawn.rpm[good][chosen], seen.drawn.J[good][chosen]
    at = m.part(chosen)
    mean = seen.solve(posterior.mean, rpm, J)
    found = predict(p, posterior, at, mean, reference)
    sd = np.hypot(found.latent_sd, found.rest_sd)
    return posterior.mean, posterior.sd, rpm, J, found.mean, sd


def case_text(seen: Observed) -> str:
    """The rotor that the propeller's label draws."""
    one = seen.propeller
    blades = f"x{one.blades}" if one.blades != 2 else ""
    return fresh.label_text(f"{one.family} {one.diameter_in:.4g}x{one.pitch_in:.4g}{blades}", measured=False)


def record(seen: Observed, p: Population) -> MeasuredRotor:
    """One propeller as it is shipped."""
    one = seen.propeller
    mean, sd, rpm, J, y, single = smooth(seen, p)
    case = case_of(case_text(seen), ends=False)
    D = case.diameter_m
    scale = np.array([one.diameter_m / D]) ** np.array([[4.0], [5.0]])  # labels are rounded
    V = J * rpm / 60.0 * D
    found = as_measured(case, rpm, V, Air.from_density(), *(y * scale), *(single * scale), others=apart(D))
    at, kept = found.reference.at, case.file.blade
    assert kept.section is not None and at.J.size == rpm.size
    order = np.lexsort((rpm, np.round(J, 2)))
    return MeasuredRotor(
        one.name, one.family, Path(one.folder).name, case.diameter_m / INCH, round(float(one.pitch_in), 4), one.blades,
        float(kept.max_chord_over_R), float(case.get("blade.section.camber")), kept.beta_offset_deg,
        found.posterior.mean, found.posterior.cov, mean, sd, rpm[order], (y * scale)[:, order],
        (single * scale)[:, order], at, found.reference.left, found.found.excess, found.reference.size,
    )  # fmt: skip


def conditions(seen: Observed) -> tuple[np.ndarray, np.ndarray]:
    """Speed [rev/min] and advance ratio of the points that count, (P,) each."""
    good = np.logical_or.reduce(list(counted(seen.drawn).values())) & np.isfinite(seen.drawn.CT_bemt)
    return seen.drawn.rpm[good], seen.drawn.J[good]


def predicted(case: Case, seen: Observed, again: bool = False) -> dict[str, np.ndarray]:
    """Errors of CT and CP over the reading at the points that count, and whether u and the 95 % interval hold them.

    Bands of the rotor, or with ``again`` those of a reading.
    """
    m, (rpm, J) = seen.record, conditions(seen)
    found = propagate(case, rpm, J * rpm / 60.0 * case.diameter_m, float(Air.from_density().rho))
    off = np.array([found.points.CT, found.points.CP]) - m.y
    bands = (found.u_reading, found.reading95) if again else (found.points.u.__getitem__, found.half_width95)
    u, u95 = (np.array([of(q) for q in ("CT", "CP")]) for of in bands)
    return {"error": off / m.y, "held68": np.abs(off) <= u, "held95": np.abs(off) <= u95}


def calibrated(text: str, seen: Observed) -> Case:
    """The rotor of a label as a run of its own shows it: up to `STILL` + `FLIGHT` of its points."""
    case, m, (rpm, J) = case_of(text, ends=False), seen.record, conditions(seen)
    rows = [np.flatnonzero(m.static), np.flatnonzero(~m.static)]
    rows = [r[np.unique(np.linspace(0, r.size - 1, min(n, r.size)).round().astype(int))]
            for r, n in zip(rows, (STILL, FLIGHT), strict=True) if r.size]  # fmt: skip
    n, D, rho = rpm / 60.0, seen.propeller.diameter_m, float(Air.from_density().rho)
    return with_reading(case, [
        {"rpm": rpm[i], "V_m_s": J[i] * n[i] * D, "thrust_N": m.y[0, i] * rho * n[i] ** 2 * D**4,
         "power_W": m.y[1, i] * rho * n[i] ** 3 * D**5} for i in np.concatenate(rows)])  # fmt: skip


def sittings(p: UiucPropeller) -> list[UiucPropeller]:
    """The propeller as each sitting measured it."""
    runs: dict[tuple[str, int], list[str]] = {}
    for one in (*p.statics, *p.lines):
        tag = re.search(r"_(?:([a-z]+)(\d{3,4})|(\d{3,4})([a-z]+))(?:_\d+)?$", Path(one.file).stem)
        if tag:
            runs.setdefault((tag[1] or tag[4], int(tag[2] or tag[3])), []).append(one.file)
    groups: list[set[str]] = []
    last = ("", 0)
    for who, number in sorted(runs):
        if who != last[0] or number - last[1] > APART:
            groups.append(set())
        groups[-1] |= set(runs[who, number])
        last = who, number
    return [
        replace(p, statics=tuple(s for s in p.statics if s.file in g), lines=tuple(x for x in p.lines if x.file in g))
        for g in groups
    ]


Predicted = dict[str, list[tuple[np.ndarray, dict[str, np.ndarray]]]]


HOW = ("with", "without", "calibrated", "its stand")
"""Known by the other measurement in the database, by the label, by the other as its own run: rotor, and reading."""


def twins_of(seen: Sequence[Observed]) -> list[list[Observed]]:
    """What was measured more than once."""
    groups: dict[tuple[object, ...], list[Observed]] = {}
    for one in seen:
        p = one.propeller
        if p.pitch_in:
            groups.setdefault((p.family, round(p.diameter_in, 2), round(p.pitch_in, 2), p.blades), []).append(one)
    return [group for group in groups.values() if len(group) > 1]


def each_other(twins: Sequence[Observed]) -> Predicted:
    """Every measurement of a propeller, predicted with and without another one of it; which points are static."""
    found: Predicted = {how: [] for how in HOW}
    for target in twins:
        text, still = case_text(target), target.record.static
        found["without"].append((still, predicted(case_of(text, ends=False), target)))
        for other in (one for one in twins if one is not target):
            known = record(other, population())
            known = replace(known, name=f"{known.name}@{known.volume}")
            measured.records()[known.name] = known
            told = f'known_from = "measured"\n\n[blade.as_built]\nmeasured = "{known.name}"\n\n[blade.section]'
            short = text[: text.index("\n[[assumptions]]")].replace("[blade.section]", told)
            found["with"].append((still, predicted(case_of(short, ends=False), target)))
            own = calibrated(text, other)
            found["calibrated"].append((still, predicted(own, target)))
            found["its stand"].append((still, predicted(own, target, again=True)))
    return found


def parts_apart(one: tuple[list[UiucPropeller], Stations]) -> Predicted:
    """The sittings of a propeller, predicted from each other."""
    return each_other(watch(Folder(tuple((p, one[1]) for p in one[0]), (), ()), effects_without([])))


def table(of: Sequence[Predicted]) -> str:
    """Errors and coverage of propellers that were measured more than once."""
    lines = [f"{'':11}{'':8}{'':>4} {'pairs':>6} {'median':>7} {'p90':>6} {'68 %':>6} {'95 %':>6}"]
    for how in HOW:
        rows = [row for one in of for row in one[how]]
        for kind, still in (("static", True), ("forward", False)):
            for i, q in enumerate(("CT", "CP")):
                own = [{k: v[i][static == still] for k, v in one.items()} for static, one in rows]
                own = [one for one in own if one["error"].size]
                if own:
                    error = np.abs([np.median(one["error"]) for one in own])
                    held = [100.0 * np.mean([one[k].mean() for one in own]) for k in ("held68", "held95")]
                    shown = [100.0 * np.median(error), 100.0 * np.quantile(error, 0.9), *held]
                    lines.append(f"{how:11}{kind:8}{q:>4} {len(own):6d} " + " ".join(f"{v:6.1f}" for v in shown))
    return "\n".join(lines)


def packed(rotors: list[MeasuredRotor]) -> dict[str, np.ndarray]:
    """Arrays of the shipped file, a row for each propeller."""
    out = {"latents": np.array(measured.NAMES)}
    for name in ("name", "family", "volume"):
        out[name] = np.array([getattr(one, name) for one in rotors])
    for name in ("diameter_in", "pitch_in", "chord", "camber", "offset_deg", "excess", "size"):
        out[name] = np.array([getattr(one, name) for one in rotors])
    out["blades"] = np.array([one.blades for one in rotors])
    for name in ("mean", "cov", "stations", "stations_sd", "rpm", "y", "single", "left"):
        out[name] = np.array([getattr(one, name) for one in rotors], dtype=np.float32)
    out["diameter_m"] = np.array([one.at.diameter_m for one in rotors])
    return out | {k: np.array([getattr(one.at, k) for one in rotors], dtype=np.float32) for k in measured.SENSED}


def main(words: list[str] | None = None) -> int:
    """Write the file."""
    parser = argparse.ArgumentParser(description="Measured propellers as reference runs.")
    parser.add_argument("folders", metavar="DIR", nargs="+", help="folders in the UIUC layout, or uiuc")
    parser.add_argument("--out", metavar="FILE", help="write the records to this file")
    parser.add_argument("--pairs", action="store_true", help="predict what was measured more than once")
    parser.add_argument("--sittings", action="store_true", help="predict what was measured in two sittings")
    parser.add_argument("--jobs", type=int, default=1, help="processes of --sittings")
    args = parser.parse_args(words)
    folder = read_folders([where(f) for f in args.folders])
    if args.sittings:
        parted = [(parts, s) for p, s in folder.propellers if len(parts := sittings(p)) > 1 and p.pitch_in]
        with ProcessPoolExecutor(args.jobs) as pool:
            print(table(list(pool.map(parts_apart, parted))))
        return 0
    every = watch(folder, effects_without([]))
    if args.pairs:
        print(table([each_other(twins) for twins in twins_of(every)]))
    made = []
    for seen in every if args.out else []:
        if not seen.propeller.pitch_in or not math.isfinite(seen.propeller.pitch_in):
            print(f"{seen.propeller.name}: no pitch, so no label", file=sys.stderr)
            continue
        made.append(record(seen, population()))
    if made:
        np.savez_compressed(args.out, **packed(made))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
