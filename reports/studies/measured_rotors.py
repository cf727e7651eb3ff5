"""The measured propellers that the package ships, and how well one measurement tells another.

``python reports/studies/measured_rotors.py uiuc uiuc_2 --out bemt/rotors/measured.npz`` writes the file.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np
from left_out import conditioned_law, watch

from bemt.base.units import INCH
from bemt.physics.air import Air
from bemt.rotors import measured
from bemt.rotors.as_measured import as_measured
from bemt.rotors.case import Case, case_of, fresh
from bemt.rotors.measured import MeasuredRotor
from bemt.rotors.population import Population, population
from bemt.rotors.predict import predict
from bemt.rotors.reference import apart
from bemt.rotors.validate.built import Observed, counted
from bemt.rotors.validate.points import read_folders
from bemt.rotors.validate.propellers import effects_without, where

STILL, FLIGHT = 3, 9
"""Smooth readings at rest and in flight; all of one kind where the other was not measured [1]."""


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


def label_case(seen: Observed) -> Case:
    """The rotor that the propeller's label draws."""
    one = seen.propeller
    blades = f"x{one.blades}" if one.blades != 2 else ""
    label = f"{one.family} {one.diameter_in:.4g}x{one.pitch_in:.4g}{blades}"
    return case_of(fresh.label_text(label, measured=False), ends=False)


def record(seen: Observed, p: Population) -> MeasuredRotor:
    """One propeller as it is shipped."""
    one = seen.propeller
    mean, sd, rpm, J, y, single = smooth(seen, p)
    case = label_case(seen)
    D = case.diameter_m
    scale = (np.array([one.diameter_m / D]) ** np.array([[4.0], [5.0]]))  # labels are rounded
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


def main(words: list[str] | None = None) -> int:
    """Write the file."""
    parser = argparse.ArgumentParser(description="Measured propellers as reference runs.")
    parser.add_argument("folders", metavar="DIR", nargs="+", help="folders in the UIUC layout, or uiuc")
    parser.add_argument("--out", metavar="FILE", required=True, help="write the records to this file")
    args = parser.parse_args(words)
    folder = read_folders([where(f) for f in args.folders])
    made = []
    for seen in watch(folder, effects_without([]), lambda line: print(line, file=sys.stderr)):
        if not seen.propeller.pitch_in or not math.isfinite(seen.propeller.pitch_in):
            print(f"{seen.propeller.name}: no pitch, so no label", file=sys.stderr)
            continue
        made.append(record(seen, population()))
    np.savez_compressed(args.out, **measured.packed(made))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
