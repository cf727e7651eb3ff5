"""Chord, angle, camber and drag of classes of blades, fitted to readings through the slopes of the label's rotor.

``python reports/studies/label_classes.py uiuc uiuc_2 --drivecalc FILE`` prints the table from which
`bemt.rotors.case.unknowns.CLASS_CHORD`, `CLASS_DRAG`, `WIDTH_CHORD` and `BLADES_EXPONENT` were read, and, with makers
alike in weight, `BLADES_DRAG`.  APC's computed tables come with
the package setuav-pythrust; they and Drive Calculator's stands share a gain of their own.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bemt.base.units import G0, INCH
from bemt.data.readers import uiuc
from bemt.data.readers.uiuc import UiucPropeller
from bemt.data.readers.uiuc_names import class_of
from bemt.physics import coefficients as co
from bemt.physics.air import Air
from bemt.physics.sections.rule import DRAG_LEVEL
from bemt.rotors.case import case_of, fresh
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.latents import NAMES, Sensed
from bemt.rotors.model import beta75_deg, coefficients
from bemt.rotors.population import population
from bemt.rotors.predict import sense
from bemt.rotors.validate.points import J_SHARE, measured, zero_thrust_J
from bemt.rotors.validate.propellers import where
from geometry.common import GeometryError
from geometry.designation import parse_designation

Array = NDArray[np.float64]
COMPUTED, STAND = (0.05, 0.08), (0.05, 0.10)
"""Gains on CT and CP that all readings of a computed table, or of a hobby stand, share [1]."""
GAINS = {"uiuc": (0.0, 0.0), "apc": COMPUTED, "stands": STAND}
_LOOSE = np.array([0.5, 0.25, 0.8, 0.5])  # prior of a class: angle [deg], ln(chord), camber [deg], ln(drag)
_ONLY_DRAG = np.array([0.01, 0.01, 0.01, 0.5])
_SD, _SD_LN = np.array([0.6, 0.12, 0.7, 0.2]), np.array([0.4, 0.5, 0.4, 0.5])  # prior of the scatter within one
_LIFT, _NU = 0.037, 5.0


@dataclass(frozen=True, eq=False)
class Labelled:
    """Readings of a propeller beside the rotor that its size alone draws."""

    source: str
    maker: str
    kind: str | None
    width: int
    blades: int
    diameter_in: float
    pitch_ratio: float
    at: Sensed
    chord_slope: Array  # (2, P) of CT and CP with ln(chord)
    y: Array  # (2, P)


def beside(
    source: str, maker: str, kind: str | None, width: int, size: tuple[float, float, int],
    rpm: Array, J: Array, y: Array,
) -> Labelled:  # fmt: skip
    """Solve the rotor of a size, without any class, with its slopes."""
    D, pitch, blades = size
    case = case_of(fresh.label_text(f"{D:.4g}x{pitch:.4g}x{blades}", measured=False), ends=False)
    case = case.replaced({"blade.max_chord_over_R": 0.2 * (D / 10.0) ** -0.2, "model.drag_level": DRAG_LEVEL})
    air, V = Air.from_density(), J * rpm / 60.0 * case.diameter_m
    model = prepare_case(case).at_speeds(rpm, V, air)
    Re = np.asarray(co.Re75(model.chord75_m, rpm / 60.0, model.diameter_m, V, air.rho, air.mu))
    at = sense(coefficients(model, air), model.diameter_m, beta75_deg(model), rpm, J, Re)
    ends = []
    for factor in (0.9, 1.1):
        wider = case.replaced({"blade.max_chord_over_R": factor * case.get("blade.max_chord_over_R")})
        found = prepare_case(wider).at_speeds(rpm, V, air).solve(rpm, V, air)
        ends.append(np.array([found.CT, found.CP]))
    return Labelled(source, maker, kind, width, blades, D, pitch / D, at, (ends[1] - ends[0]) / math.log(1.1 / 0.9), y)


def readings(folders: Sequence[Path]) -> Iterator[tuple[UiucPropeller, Array, Array, Array]]:
    """Every measured propeller with a pitch: rpm, J, CT and CP, (2, P), of up to four static and ten flight points."""
    for p in (p for folder in folders for p in uiuc.scan_folder(folder).propellers):
        if not p.pitch_in or not (p.statics or p.lines):
            continue
        static, rpm, J, CT, CP = measured(p)
        J0 = zero_thrust_J([(line.J, line.CT) for line in p.lines])
        good = (CT > 0) & (CP > 0) & (J >= 0) & (static | (J_SHARE * (J0 if math.isfinite(J0) else J.max()) >= J))
        rows = [np.flatnonzero(static & good), np.flatnonzero(~static & good)]
        keep = np.concatenate([r[np.unique(np.linspace(0, r.size - 1, min(n, r.size)).round().astype(int))]
                               for r, n in zip(rows, (4, 10), strict=True) if r.size] or [rows[0]])  # fmt: skip
        if keep.size:
            yield p, rpm[keep], J[keep], np.array([CT, CP])[:, keep]


def of_uiuc(folders: Sequence[Path]) -> Iterator[Labelled]:
    """Every measured propeller with a pitch, whether its stations are known or not."""
    for p, rpm, J, y in readings(folders):
        yield beside("uiuc", p.family, class_of(p.family), 0, (p.diameter_in, p.pitch_in, p.blades), rpm, J, y)


def of_drivecalc(file: Path) -> Iterator[Labelled]:
    """Static thrust [gf] a n^b and power [W] c n^d over krpm, at tip speeds of 80 and 120 m/s."""
    with file.open(encoding="utf-8") as text:
        for row in csv.DictReader(text):
            D, pitch, a, b, c, d = (float(row[k] or 0) for k in ("Dia", "Pitch", "a", "b", "c", "d"))
            try:
                told = parse_designation(f"{row['Name'].strip()} {D:g}x{pitch:g}")
            except GeometryError:
                continue
            rho = [_density(float(row[f"Alt{k}"] or 0), float(row[f"Tmp{k}"] or 15)) for k in ("Thr", "Pwr")]
            rpm = np.array([80.0, 120.0]) * 60.0 / (math.pi * D * INCH)
            n, m = rpm / 60.0, D * INCH
            CT = a * (rpm / 1e3) ** b * 1e-3 * G0 / (rho[0] * n**2 * m**4) if a > 0 else np.full(2, np.nan)
            CP = c * (rpm / 1e3) ** d / (rho[1] * n**3 * m**5) if c > 0 else np.full(2, np.nan)
            size = (D, pitch, told.blades or 2)
            yield beside(
                "stands",
                row["Name"].split()[0],
                told.blade_class,
                told.width,
                size,
                rpm,
                np.zeros(2),
                np.array([CT, CP]),
            )


def _density(altitude_m: float, temperature_C: float) -> float:
    return 101325.0 * (1.0 - 2.25577e-5 * altitude_m) ** 5.25588 / (287.05 * (temperature_C + 273.15))


def of_apc() -> Iterator[Labelled]:
    """APC's computed tables at the tip speed nearest to 120 m/s, six advance ratios each."""
    from pythrust import dataset_dir

    for file in sorted((Path(dataset_dir()) / "propellers").glob("*/APC_*.json")):
        about = json.loads(file.read_text(encoding="utf-8"))
        told = parse_designation(f"APC {about['model']}")
        with file.with_suffix(".csv").open(encoding="utf-8") as text:
            rows = np.array([[float(r[k]) for k in ("rpm", "advance_ratio", "thrust_coeff", "power_coeff")]
                             for r in csv.DictReader(text)])  # fmt: skip
        speeds = np.unique(rows[:, 0])
        here = speeds[np.argmin(np.abs(speeds - 120.0 * 60.0 / (math.pi * about["diameter_in"] * INCH)))]
        line = rows[(rows[:, 0] == here) & (rows[:, 2] > 0.015)]
        line = line[np.unique(np.linspace(0, len(line) - 1, 6).round().astype(int))]
        size = (about["diameter_in"], about["pitch_in"], about["blade_count"])
        yield beside("apc", "APC", told.blade_class, told.width, size, line[:, 0], line[:, 1], line[:, 2:].T)


def fit(
    members: Sequence[Labelled], loose: Array = _LOOSE, weights: Sequence[float] | None = None
) -> tuple[Array, Array, Array]:
    """Mean of angle [deg], ln(chord), camber [deg] and ln(drag) of a class, its standard error, the scatter within."""
    from scipy.optimize import minimize

    p, rows = population(), []
    names = [NAMES.index(n) for n in ("angle_deg", "camber_deg", "drag", "lift")]
    for one, weight in zip(members, weights or [1.0] * len(members), strict=True):
        at = one.at
        left = (one.y - at.f - p.bias(at)).reshape(-1)
        slopes = [at.T[:, names[0]], one.chord_slope, *(at.T[:, k] for k in names[1:])]
        T = np.stack(slopes, -1).reshape(left.size, -1)
        N = p.rest(at) + np.diag((p.noise_sd(at) ** 2).reshape(-1))
        for i, g in enumerate(GAINS[one.source]):
            common = np.zeros_like(one.y)
            common[i] = g * np.nan_to_num(one.y[i])
            N = N + np.outer(common.reshape(-1), common.reshape(-1))
        good = np.isfinite(left) & np.isfinite(at.f.reshape(-1))
        if good.any():
            rows.append((weight, left[good], T[good], N[np.ix_(good, good)]))

    def misfit(theta: Array) -> float:
        mean, sd = np.append(theta[:4], 0.0), np.exp(theta[4:])
        C = np.diag([*sd**2, _LIFT**2])
        total = 0.5 * float(np.sum((theta[:4] / loose) ** 2) + np.sum(((theta[4:] - np.log(_SD)) / _SD_LN) ** 2))
        for weight, left, T, N in rows:
            S, e = T @ C @ T.T + N, left - T @ mean
            q = float(e @ np.linalg.solve(S, e))
            total += weight * (0.5 * float(np.linalg.slogdet(S)[1]) + 0.5 * (_NU + e.size) * math.log1p(q / _NU))
        return total

    found = minimize(misfit, np.append(np.zeros(4), np.log(_SD)), method="BFGS", options={"maxiter": 60, "gtol": 1e-3})
    return found.x[:4], np.sqrt(np.diag(found.hess_inv))[:4], np.exp(found.x[4:])


def usable(one: Labelled) -> bool:
    """Whether readings of a stand can be those of a propeller as drawn: pitch, figure of merit."""
    FM = float(np.mean(0.8 * one.y[0] ** 1.5 / one.y[1]))
    return one.diameter_in >= 4.0 and 0.3 <= one.pitch_ratio <= 0.95 and 0.2 < FM < 0.85


def main(words: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Classes of blades beside the usual one.")
    parser.add_argument("folders", metavar="DIR", nargs="+", help="folders in the UIUC layout, or uiuc")
    parser.add_argument("--drivecalc", metavar="FILE", help="static fits of Drive Calculator")
    args = parser.parse_args(words)
    found = [*of_uiuc([where(f) for f in args.folders]), *of_apc()]
    found += of_drivecalc(Path(args.drivecalc)) if args.drivecalc else []
    groups: dict[tuple[str, str | None, int, int], list[Labelled]] = {}
    for one in found:
        groups.setdefault((one.source, one.kind, one.width, min(one.blades, 4)), []).append(one)
    head = ("source, class, width, blades", "n", "angle [deg]", "ln chord", "camber [deg]", "ln drag")
    print("{:34} {:>4}  {:>14}  {:>14}  {:>14}  {:>14}  scatter".format(*head))
    for key, members in sorted(groups.items(), key=str):
        if len(members) < 2:
            continue
        name = " ".join(map(str, key))
        _show(name, members, *fit(members))
    many = [one for one in found if one.blades > 2 and one.source != "apc" and (one.source == "uiuc" or usable(one))]
    for left in ("", *sorted({one.maker for one in many})) if many else ():
        some = [one for one in many if one.maker != left]
        count = Counter(one.maker for one in some)
        weights = [count[one.maker] ** -0.5 for one in some]
        _show(f"three and more blades{' but ' * bool(left)}{left}", some, *fit(some, _ONLY_DRAG, weights))
    return 0


def _show(name: str, members: Sequence[Labelled], mean: Array, error: Array, sd: Array) -> None:
    cells = "  ".join(f"{m:+6.2f} +- {e:4.2f}" for m, e in zip(mean, error, strict=True))
    print(f"{name:34} {len(members):4d}  {cells}   {sd[0]:.2f} {sd[1]:.3f} {sd[2]:.2f} {sd[3]:.2f}", flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
