"""Measured propellers of a folder: who can be compared, the solver at their points, and the errors that count."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError
from bemt.base.units import INCH
from bemt.data.readers.uiuc_names import class_of
from bemt.physics.sections import rule as section_rule
from bemt.rotors.conditioning import ReferenceRun
from bemt.rotors.latents import Prior, Sensed
from bemt.rotors.population import Population, label_angle_deg
from bemt.rotors.predict import LEVELS, half_width, inside, predict, sense

if TYPE_CHECKING:
    from bemt.data.readers.uiuc import UiucPropeller
    from bemt.physics.effects import Effect
    from geometry.rotor import Rotor


Stations = tuple[Array, Array, Array]

# Forward flight is compared up to this share of the measured zero-thrust advance ratio: beyond it a relative error
# of CT says more about J0 than about the model.
J_SHARE = 0.8
N_STATIONS = 40
KINDS = ("static", "forward")


@dataclass(frozen=True)
class Rows:
    """Measured and computed coefficients of one propeller, P points."""

    static: NDArray[np.bool_]  # (P,) static points
    # (P,) conditions [rev/min], [1]
    rpm: Array
    J: Array
    # (P,) propeller convention [1]; NaN where not converged
    CT: Array
    CP: Array
    CT_bemt: Array
    CP_bemt: Array
    # Advance ratio of zero thrust, measured and computed [1]; NaN where not reached
    J0: float
    J0_bemt: float


def zero_thrust_J(lines: Iterable[tuple[Array, Array]]) -> float:
    """Advance ratio where thrust vanishes, median over rpm lines."""
    found = []
    for J, CT in lines:
        order = np.argsort(J)
        J, CT = np.asarray(J)[order], np.asarray(CT)[order]
        if J.size < 4 or not np.nanmax(CT) > 0:
            continue
        tail = CT < 0.35 * np.nanmax(CT)
        if np.count_nonzero(tail) < 2:
            continue
        slope, at_zero = np.polyfit(CT[tail], J[tail], 1)
        if slope < 0 and at_zero > 0:
            found.append(at_zero)
    return float(np.median(found)) if found else float("nan")


def build(propeller: UiucPropeller, stations: Stations | None = None) -> Rotor:
    """Rotor of a measured propeller with the rule's sections."""
    from bemt.physics.sections.rule import airfoil, sections
    from geometry.rotor import Rotor, from_stations

    if stations is None:
        g = propeller.geometry
        if g is None:
            raise ValueError(f"{propeller.name}: got no stations; expected a geometry file")
        stations = (g.r_R, g.c_R, np.radians(g.beta_deg))
    x, c, beta = stations
    R = 0.5 * propeller.diameter_m
    keep = x <= 1.0
    thickness = propeller.thickness
    law = None if thickness is None else (thickness.r_R, thickness.t_c)
    anchors = tuple((s.r_R, airfoil(s)) for s in sections(propeller.family, law))
    blade = from_stations(x[keep] * R, np.maximum(c[keep], 1e-3) * R, beta[keep], R, float(x[0]) * R, anchors=anchors)
    return Rotor(blade, propeller.blades, propeller.rotation, propeller.name)


def measured(propeller: UiucPropeller) -> tuple[NDArray[np.bool_], Array, Array, Array, Array]:
    """All points of a propeller: static or not, rpm, J, CT, CP; static runs first, then line by line."""
    statics, lines = propeller.statics, propeller.lines
    static = [*(np.ones(s.rpm.size, bool) for s in statics), *(np.zeros(line.J.size, bool) for line in lines)]
    rpm = [*(s.rpm for s in statics), *(np.full(line.J.size, line.rpm) for line in lines)]
    J = [*(np.zeros(s.rpm.size) for s in statics), *(line.J for line in lines)]
    CT, CP = ([*(getattr(t, q) for t in (*statics, *lines))] for q in ("CT", "CP"))
    found = [np.concatenate(v) for v in (rpm, J, CT, CP)]
    return np.concatenate(static), found[0], found[1], found[2], found[3]


class Solver:
    """CT and CP of a propeller on its stations, with any latent numbers; the rotor of the last ones is kept."""

    def __init__(self, propeller: UiucPropeller, effects: Sequence[Effect], stations: Stations | None) -> None:
        from bemt.physics.air import Air
        from bemt.physics.sections.neuralfoil import neuralfoil_polar

        self.rotor = build(propeller, stations)
        self.air = Air.from_density()
        self.diameter_m = propeller.diameter_m
        self._effects = tuple(effects)
        self._tables = [(x, neuralfoil_polar(shape)) for x, shape in self.rotor.blade.anchors]
        self._last: tuple[bytes, Any] = (b"", None)

    def __call__(self, z: Array, rpm: Array, J: Array, which: Any = None) -> Array:
        """(2, P) CT and CP, NaN where not converged."""
        from bemt.physics.bem import solver
        from bemt.rotors.latents import as_built

        key = z.tobytes()
        if self._last[0] != key:
            changed = [*self._effects, as_built(z)] if z.any() else self._effects
            effects = sorted(changed, key=lambda e: (e.order, e.id))
            prepared = solver.prepare(self.rotor, self._tables, effects, n_stations=N_STATIONS, mach_max=0.7)
            self._last = (key, prepared)
        found = solver.solve(self._last[1], rpm, J * rpm / 60.0 * self.diameter_m, self.air)
        return np.array([found.CT, found.CP])


def compare(propeller: UiucPropeller, effects: Sequence[Effect], stations: Stations | None = None) -> Rows:
    """Solve every measured point of one propeller."""
    return rows(propeller, Solver(propeller, effects, stations))


def rows(propeller: UiucPropeller, solve: Solver, z: Array | None = None) -> Rows:
    """Measured points beside the solver with some latent numbers, those of the drawing by default."""
    from bemt.rotors.latents import NAMES

    static, rpm, J, CT, CP = measured(propeller)
    CT_bemt, CP_bemt = solve(np.zeros(len(NAMES)) if z is None else z, rpm, J)
    ends, i = [], sum(s.rpm.size for s in propeller.statics)
    for line in propeller.lines:
        ends.append((line.J, CT_bemt[i : i + line.J.size]))
        i += line.J.size
    return Rows(
        static, rpm, J, CT, CP, CT_bemt, CP_bemt, zero_thrust_J((line.J, line.CT) for line in propeller.lines),
        zero_thrust_J((a, b) for a, b in ends if np.all(np.isfinite(b))),
    )  # fmt: skip


def counted(rows: Rows) -> dict[str, NDArray[np.bool_]]:
    """Points that count, (P,) of ``static`` and of ``forward``.

    Forward points lie between 0 and 0.8 of the measured zero-thrust J; where that is unknown the largest measured J
    stands in.
    """
    limit = J_SHARE * (rows.J0 if np.isfinite(rows.J0) else float(np.max(rows.J, initial=0.0)))
    usable = (rows.CT > 0.0) & (rows.CP > 0.0)
    return {"static": rows.static & usable, "forward": ~rows.static & (rows.J <= limit) & (rows.J >= 0.0) & usable}


def errors(rows: Rows) -> dict[str, dict[str, Array]]:
    """Relative errors that count: ``static`` and ``forward``, each CT and CP, (bemt - measured) / measured [1]."""
    return {
        name: {"CT": rows.CT_bemt[mask] / rows.CT[mask] - 1.0, "CP": rows.CP_bemt[mask] / rows.CP[mask] - 1.0}
        for name, mask in counted(rows).items()
    }


class ErrorStatistics(Documented):
    """Median and 90th percentile of the absolute error, and median error; NaN where nothing is known [1]."""

    median_abs: float
    p90_abs: float
    bias: float
    # Share of points inside the 68 and 95 % intervals, median half width of the first, mean log density
    coverage: Mapping[str, float] | None = None
    width68: float | None = None
    log_score: float | None = None


def statistics(error: Array) -> ErrorStatistics:
    """Statistics of errors; one that is not finite counts as infinite."""
    if error.size == 0:
        return ErrorStatistics(math.nan, math.nan, math.nan)
    size = np.where(np.isfinite(error), np.abs(error), np.inf)
    bias = float(np.nanmedian(error)) if np.any(np.isfinite(error)) else math.nan
    return ErrorStatistics(float(np.median(size)), float(np.quantile(size, 0.9, method="higher")), bias)


class KindErrors(Documented):
    """Errors at rest, or in flight."""

    points: int
    CT: ErrorStatistics
    CP: ErrorStatistics
    propellers: int | None = None


class ErrorTotals(Documented):
    """Errors at rest and in flight."""

    static: KindErrors
    forward: KindErrors

    def each(self) -> tuple[ErrorStatistics, ...]:
        """CT and CP at rest, CT and CP in flight."""
        return self.static.CT, self.static.CP, self.forward.CT, self.forward.CP


# UIUC family of an APC blade series, by the suffix of the PE0 file's designation.
_APC_SERIES = {"E": "apce", "SF": "apcsf", "": "apcsp", "F": "apcff", "MR": "apcmr"}


@dataclass(frozen=True)
class Folder:
    """What a folder holds."""

    # (UiucPropeller, Stations) measured propellers with their stations: r/R [1], c/R [1], beta [rad]
    propellers: tuple[tuple[UiucPropeller, Stations], ...]
    skipped: tuple[tuple[str, str], ...]  # Name and reason of those that cannot be compared
    faults: tuple[str, ...]  # What could not be read


def read_folders(folders: Sequence[Path]) -> Folder:
    """Several folders as one."""
    found = [read_folder(folder) for folder in folders]
    parts = zip(*((one.propellers, one.skipped, one.faults) for one in found), strict=True)
    return Folder(*(tuple(item for part in parts_ for item in part) for parts_ in parts))


def read_folder(folder: Path) -> Folder:
    """Read a folder in UIUC layout; APC PE0 files in it supply stations for propellers without their own."""
    from bemt.data.readers import uiuc

    if not folder.is_dir():
        got = "a file" if folder.exists() else "no such folder"
        raise InputError([Fault(str(folder), "", got, "a folder in UIUC layout", "Check the path")])
    scan = uiuc.scan_folder(folder)
    pe0, notes = _pe0_stations(folder)
    usable, skipped = [], []
    for p in scan.propellers:
        stations = _own(p) or pe0.get((p.family, round(p.diameter_in, 2), round(p.pitch_in or 0.0, 2)))
        if stations is None:
            skipped.append((p.name, "no stations"))
        elif not p.statics and not p.lines:
            skipped.append((p.name, "no measurements"))
        else:
            usable.append((p, stations))
    if not usable:
        raise InputError(
            [*scan.faults, Fault(str(folder), "propellers", f"{len(scan.propellers)} propellers, none with stations "
             "and measurements", "at least one of each", "Stations are in NAME_geom.txt or an APC PE0 file.")]
        )  # fmt: skip
    return Folder(tuple(usable), tuple(skipped), (*(str(f) for f in scan.faults), *notes))


def _own(p: UiucPropeller) -> Stations | None:
    g = p.geometry
    return None if g is None else (g.r_R, g.c_R, np.radians(g.beta_deg))


def _pe0_stations(folder: Path) -> tuple[dict[tuple[str, float, float], Stations], list[str]]:
    from bemt.data.readers import apc

    found: dict[tuple[str, float, float], Stations] = {}
    notes: list[str] = []
    for file in sorted(folder.rglob("*")):
        if file.suffix.upper() != ".PE0":
            continue
        try:
            blade = apc.read_pe0(file)
        except InputError as err:
            notes.extend(str(f) for f in err.faults)
            continue
        series = "".join(ch for ch in file.name.split("-")[0].upper().partition("X")[2] if ch.isalpha())
        family = _APC_SERIES.get(series)
        if family is None:
            notes.append(f"{file.name}: series {series!r} has no UIUC family; stations not used")
            continue
        R = blade.radius_m
        found[family, round(blade.diameter_m / INCH, 2), round(blade.pitch_m / INCH, 2)] = (
            blade.r_m / R,
            blade.chord_m / R,
            blade.beta_rad,
        )
    return found, notes


# Measured propellers as built: what the population expects of each, how wide, and what each tells the population.


@dataclass(frozen=True, eq=False)
class ComparedRotor(Sensed):
    """One measured propeller beside the solver at P readings; ``y`` (2, P) are CT and CP measured [1]."""

    name: str
    family: str
    section: str
    gap_deg: float
    static: NDArray[np.bool_]
    y: Array
    blade_class: str | None = None
    known_from: str = "stations"


def law(p: Population, m: ComparedRotor) -> Prior:
    """What is known of a propeller before it is measured."""
    return p.prior(m.known_from, m.diameter_m, m.gap_deg, m.family, m.section, blade_class=m.blade_class)


@dataclass(frozen=True, eq=False)
class Observed:
    """One propeller of a folder: the solver as drawn at its points, and its sensitivities."""

    propeller: UiucPropeller  # As read
    solve: Solver  # For other latent numbers
    drawn: Rows  # All points, the solver on the stations
    record: ComparedRotor  # The points that count, static ones first


@dataclass(frozen=True, eq=False)
class Expected:
    """Expectation for one propeller and how the measured points lie in it, over the points that count."""

    rows: Rows  # As `Observed.drawn`, the computed coefficients being expectations
    # (P,) ``static`` and ``forward``, CT and CP: of an interval as wide as the error [1]
    probability: dict[str, dict[str, Array]]
    width: dict[str, dict[str, Array]]  # (P,) half width of the 68 % interval over the expectation [1]
    log_density: dict[str, dict[str, Array]]  # (P,) logarithm of the predictive density of the reading over itself [1]


def observe(propeller: UiucPropeller, effects: Sequence[Effect], stations: Stations) -> Observed:
    """Solve one propeller at its points with the slopes."""
    solve = Solver(propeller, effects, stations)
    drawn = rows(propeller, solve)
    here = np.logical_or.reduce(list(counted(drawn).values())) & np.isfinite(drawn.CT_bemt)
    rotor = solve.rotor
    chord, beta = (float(v) for v in rotor.blade.at(0.75 * rotor.R)[:2])
    n, D = drawn.rpm[here] / 60.0, rotor.D
    speed = n * D * np.hypot(0.75 * math.pi, drawn.J[here])
    Re = solve.air.rho * speed * chord / solve.air.mu
    at = sense(solve, D, math.degrees(beta), drawn.rpm[here], drawn.J[here], Re)
    gap = math.nan
    if propeller.pitch_in:
        gap = math.degrees(beta) - label_angle_deg(propeller.pitch_in, propeller.diameter_in)
    y = np.array([drawn.CT[here], drawn.CP[here]])
    record = ComparedRotor(
        **vars(at), name=propeller.name, family=propeller.family, section=section_rule.source(propeller.family),
        gap_deg=gap, static=drawn.static[here], y=y, blade_class=class_of(propeller.family),
    )  # fmt: skip
    return Observed(propeller, solve, drawn, record)


def expect(seen: Observed, p: Population) -> Expected:
    """Expectation of a propeller and how its points lie in it."""
    return lying(seen, p, law(p, seen.record))


def lying(seen: Observed, p: Population, prior: Prior, reference: ReferenceRun | None = None) -> Expected:
    """How the points lie in a prediction."""
    m = seen.record
    now = rows(seen.propeller, seen.solve, prior.mean)
    good = counted(now)
    here = np.logical_or.reduce(list(good.values())) & np.isfinite(seen.drawn.CT_bemt)
    found = predict(p, prior, m, np.array([now.CT_bemt[here], now.CP_bemt[here]]), reference)
    CT, CP = now.CT_bemt.copy(), now.CP_bemt.copy()
    CT[here], CP[here] = found.mean
    now = replace(now, CT_bemt=CT, CP_bemt=CP)
    sds = found.sds(noise=True)
    density = found.log_density(m.y) + np.log(np.abs(m.y))
    probability: dict[str, dict[str, Array]] = {}
    width: dict[str, dict[str, Array]] = {}
    log_density: dict[str, dict[str, Array]] = {}
    for kind, mask in good.items():
        k = mask[here]
        probability[kind], width[kind], log_density[kind] = {}, {}, {}
        for i, q in enumerate(("CT", "CP")):
            mean, sd = found.mean[i][k], sds[i][k]
            probability[kind][q] = inside(m.y[i][k] - mean, sd, found.chances)
            width[kind][q] = half_width(LEVELS[0], sd, found.chances) / np.abs(mean)
            log_density[kind][q] = density[i][k]
    return Expected(now, probability, width, log_density)


class Pool:
    """Errors of many propellers, together; with intervals also how many points they hold and how wide they are."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str, str], list[Array]] = {}

    def add(self, rows: Rows, expected: Expected | None = None, kinds: Sequence[str] = KINDS) -> ErrorTotals:
        """Take the points of one propeller, of these kinds; returns its own statistics."""
        own = Pool()
        for kind, found in errors(rows).items():
            for q, e in found.items():
                own._found[kind, q, "error"] = [e]
                if expected is not None:
                    own._found[kind, q, "probability"] = [expected.probability[kind][q]]
                    own._found[kind, q, "width"] = [expected.width[kind][q]]
                    own._found[kind, q, "log_density"] = [expected.log_density[kind][q]]
        for key, values in own._found.items():
            if key[0] in kinds:
                self._found.setdefault(key, []).extend(values)
        sums = own.total()
        return ErrorTotals(replace(sums.static, propellers=None), replace(sums.forward, propellers=None))

    def total(self) -> ErrorTotals:
        """Statistics over all points; ``log_score`` is a mean over propellers of the mean log density of their
        points.
        """
        static, forward = (self._of(kind) for kind in KINDS)
        return ErrorTotals(static, forward)

    def _of(self, kind: str) -> KindErrors:
        sizes = [e.size for e in self._found.get((kind, "CT", "error"), [])]
        found = {}
        for q in ("CT", "CP"):
            e, probability, width = (
                np.concatenate([*self._found.get((kind, q, what), []), np.empty(0)])
                for what in ("error", "probability", "width")
            )
            found[q] = statistics(e)
            if (kind, q, "probability") in self._found:
                means = [float(np.mean(v)) for v in self._found[kind, q, "log_density"] if v.size]
                held = {name: float(np.mean(probability <= level)) if probability.size else math.nan
                        for name, level in zip(("68", "95"), LEVELS, strict=True)}  # fmt: skip
                found[q] = replace(found[q], coverage=held, width68=float(np.median(width)) if width.size else math.nan,
                                   log_score=float(np.mean(means)) if means else math.nan)  # fmt: skip
        return KindErrors(sum(sizes), found["CT"], found["CP"], sum(size > 0 for size in sizes))
