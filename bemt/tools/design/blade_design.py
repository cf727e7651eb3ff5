"""A blade for a thrust, from request to result: sections and duct, start, optimum, what is on sale, limits, bands."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base import cache
from bemt.base.action import Answered
from bemt.base.arrays import Array
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED, Fault, InputError, gathered, refuse
from bemt.base.units import INCH
from bemt.physics.air import Air
from bemt.rotors.case import Case, case_of, new_folder
from bemt.rotors.case.load import with_changes
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.case.propagate import propagate
from bemt.rotors.case.unknowns import AIR, SECTION, SURFACE
from bemt.tools.design import optimise as search
from bemt.tools.design.minimum_loss import MinimumLoss, actuator_disk, ducted_disk, minimum_loss, without_drag
from bemt.tools.design.optimise import Label, best_labels
from bemt.tools.design.problem import BladeProblem, Values
from bemt.tools.design.requirement import DesignPoint, Requirement, required

if TYPE_CHECKING:
    from bemt.physics.bem.model import Model
    from geometry.rotor import Blade

Progress = Callable[[str], None]

HUB_RATIO = 0.15
THIN_FROM = 0.5
"""r/R from which the thickness is the outer one [1]."""
FAMILY = (
    (0.12, 0.09), (0.15, 0.09), (0.18, 0.12), (0.21, 0.12), (0.24, 0.15), (0.28, 0.15), (0.28, 0.18), (0.30, 0.21),
)  # fmt: skip
"""Thickness at the hub and on the outer half that are tried, while stress limits the blade; the first is tabulated
without NeuralFoil [1]."""
FAR = 0.8  # Share of the thrust below which the next but one is tried [1]
DENSITY = (0.01, 10.0)  # of the air [kg/m3]
KEYS_KEPT = ("rotor", "duct", "air", "model", "polars")
"""Tables of a case with a duct that the new blade keeps."""


@dataclass(frozen=True)
class BandedLoads:
    """Thrust [N] and power [W] at a point with their standard uncertainties."""

    thrust_N: float
    u_thrust_N: float
    power_W: float
    u_power_W: float


@dataclass(frozen=True)
class OverRotors:
    """Thrust [N] and power [W] over rotors as built at the first point: means and standard deviations."""

    thrust_N: float
    sd_thrust_N: float
    power_W: float
    sd_power_W: float


@dataclass(frozen=True, eq=False)
class Design(Answered):
    """A blade that was designed.

    Attributes
    ----------
    need : Requirement
        What was asked for.
    thickness : tuple of float, or None
        Of the section at the hub and on the outer half, as found; None where they were stated [1].
    found : Optimum
        Start and result of the optimisation, for rotors as built if robust.
    files : dict of str to bytes
        Case folder: ``case.toml`` and ``stations.csv``, and what else the sections need.
    start : MinimumLoss or None
        Blade of minimum induced loss; None in a duct, whose own blade is the start.
    label : Label or None
        Best propeller on sale at the speed that suits it; None if none meets the points.
    same_speed : Label or None
        Best one at the speeds asked for, with at least the thrust.
    label_breaks : tuple of str
        Limits that it does not keep.
    disk_W, betz_W : float
        Mean power of the ideal disk and of the best blade without drag (NaN in a duct) [W].
    bands, label_bands : tuple of BandedLoads
        At each point.
    robust : tuple of OverRotors, or None
        This blade, and the one for the drawing alone, over rotors as built.
    """

    need: Requirement
    thickness: tuple[float, float] | None
    found: search.Optimum
    files: dict[str, bytes]
    start: MinimumLoss | None
    label: Label | None
    same_speed: Label | None
    label_breaks: tuple[str, ...]
    disk_W: float
    betz_W: float
    bands: tuple[BandedLoads, ...]
    label_bands: tuple[BandedLoads, ...]
    robust: tuple[OverRotors, OverRotors] | None
    ducted: bool

    @property
    def name(self) -> str:
        """Name of the case."""
        return name_of(self.need.points[0], 2.0 * self.need.R)

    @property
    def values(self) -> Values:
        """What the blade does as drawn."""
        return self.found.after

    @property
    def mean_W(self) -> float:
        """Mean power over the points [W]."""
        return float(self.found.problem.weights @ self.values.power_W)

    @property
    def active(self) -> list[str]:
        """Limits that are reached."""
        return self.found.problem.active(self.values)

    def case(self) -> Any:
        """Case of the blade, in a folder that lasts as long as the ``with`` block."""
        return new_folder.temporary(self.files)

    def write(self, folder: str | Path) -> Path:
        """Write the case into a new folder."""
        new_folder.write_files(self.files, Path(folder))
        return Path(folder)

    @property
    def text(self) -> str:
        """One screen: the blade next to the best label and the ideal."""
        from bemt.tools.design.design_answer import text

        return text(self)

    @property
    def exit_code(self) -> int:
        """1 if the search did not converge."""
        return EXIT_OK if self.found.converged else EXIT_UNCONVERGED

    def _document(self) -> dict[str, Any]:
        """``bemt.design/1``."""
        from bemt.tools.design.design_answer import document

        return document(self)

    def __repr__(self) -> str:
        return self.text


def name_of(point: DesignPoint, diameter_m: float) -> str:
    """Name of the case of a blade.

    >>> name_of(DesignPoint(6.5, 15.0), 0.254)
    'design_10in_6p5N'
    """
    return f"design_{diameter_m / INCH:.3g}in_{point.thrust_N:.3g}N".replace(".", "p")


def design_blade(
    points: Sequence[DesignPoint], diameter_m: float | None = None, blades: int | None = None, *,
    section: str | None = None, hub_ratio: float | None = None, density_kg_m3: float | None = None,
    duct: Case | None = None, robust: bool = False, progress: Progress | None = None, **limits: Any,
) -> Design:  # fmt: skip
    """Design a blade; parameters as `bemt.design`."""
    faults: list[Fault] = []
    base: Case | None = None
    with gathered(faults):
        base = _open_case(diameter_m, blades, section, hub_ratio, density_kg_m3) if duct is None else _in_duct(
            duct, diameter_m, blades, section, hub_ratio, density_kg_m3)  # fmt: skip
    if base is None:  # the rest of the request is judged on a size that can be
        try:
            required(points, 10.0 * INCH, HUB_RATIO, 2, Air.from_density(), **limits)
        except InputError as error:
            faults += [f for f in error.faults if "tip Mach" not in f.got]
        raise InputError(faults)
    need = required(points, base.diameter_m, base.hub_diameter_m / base.diameter_m, int(base.file.rotor.blades),
                    base.air(), **limits)  # fmt: skip
    say = progress or (lambda line: None)
    say("sections")
    _check_chords(search.problem_of(prepare_case(base), need, _first_blade(base, need, duct)[0])[0])
    say("propellers on sale")
    label, same = best_labels(need, duct)
    free = next((i for i, p in enumerate(need.points) if p.rpm is None), None)
    rpm0 = None if label is None or free is None else float(label.rpm[free])

    def step(n: int, what: str) -> None:
        say(f"{what}: step {n}")

    varied = section is None and duct is None
    base, thickness, start, found = _thickest_needed(base, need, duct, rpm0, varied, step)
    model = prepare_case(base)
    files = case_files(base, found, points)
    over = None
    if robust:
        with new_folder.temporary(files) as case:
            prior = case.as_built().prior
        variants = search.as_built_variants(found.problem.model, prior)
        drawn = _over_rotors(found, variants)
        better = search.improve(found, variants, step)
        plain = replace(better.problem, variants=found.problem.variants)
        after = plain.values(better.best)
        assert after is not None
        over = _over_rotors(better, variants), drawn
        found = search.Optimum(plain, found.start, better.best, found.before, after, found.steps + better.steps,
                             better.converged)  # fmt: skip
        files = case_files(base, found, points)
    say("bands")
    with new_folder.temporary(files) as case:
        bands = _bands(case, need, found.after.rpm)
    label_bands = () if label is None else _bands(label.case, need, label.rpm)
    breaks = () if label is None else _breaks(label, need)
    return Design(need, thickness, found, files, start, label, same, breaks, *_ideal(need, model, found), bands,
                  label_bands, over, duct is not None)  # fmt: skip


def _first_blade(
    base: Case, need: Requirement, duct: Case | None, rpm0: float | None = None
) -> tuple[Blade, MinimumLoss | None]:
    """Blade to start from: of least induced loss, at the speed of the best propeller on sale; in a duct its own."""
    model = prepare_case(base)
    if duct is not None:
        return model.rotor.blade, None
    known = need if rpm0 is None else replace(need, points=tuple(replace(p, rpm=p.rpm or rpm0) for p in need.points))
    return search.start_blade(model, known)


def _thickest_needed(
    base: Case, need: Requirement, duct: Case | None, rpm0: float | None, varied: bool,
    step: Callable[[int, str], None],
) -> tuple[Case, tuple[float, float] | None, MinimumLoss | None, search.Optimum]:  # fmt: skip
    """Sections and blade of the least power: thicker ones are tried while stress limits what was found.

    Returns the case, its thickness at the hub and on the outer half, the start and the optimum.
    """
    best: tuple[Case, tuple[float, float] | None, MinimumLoss | None, search.Optimum] | None = None
    refused: InputError | None = None
    family: tuple[tuple[float, float] | None, ...] = FAMILY if varied else (None,)
    k = 0
    while k < len(family):
        made = base if k == 0 else _thicker(base, FAMILY[k])
        blade, start = _first_blade(made, need, duct, rpm0)
        problem, x = search.problem_of(prepare_case(made), need, blade, rpm0)
        try:
            found = search.optimise(problem, x, step)
        except InputError as error:
            if best is not None:
                break
            refused = error if refused is None or _share(error, need) > _share(refused, need) else refused
            stressed, ahead = any("stress" in f.hint for f in error.faults), 1 + (_share(error, need) < FAR)
        else:
            if best is not None and found.after.objective > best[3].after.objective * (1.0 - ENOUGH_LESS):
                break
            best = made, family[k], start, found
            stressed, ahead = any(word.startswith("stress") for word in problem.active(found.after)), 1
        if not stressed or not cache.is_installed("neuralfoil"):
            break
        k += ahead
    if best is None:
        assert refused is not None
        raise refused
    return best


ENOUGH_LESS = 1e-4
"""Share of the power that thicker sections must save [1]."""


def _share(error: InputError, need: Requirement) -> float:
    """Thrust that a refusal names as the nearest, over the one asked for; 0 where it names none [1]."""
    words = error.faults[0].expected.split()
    return float(words[2]) / need.points[0].thrust_N if words[:2] == ["up", "to"] else 0.0


def _thicker(base: Case, thickness: tuple[float, float]) -> Case:
    """The case with other thicknesses of its section."""
    section = dict(base.written["blade"]["section"]) | {"thickness": list(thickness)}
    with _in_words_of_the_request():
        return with_changes(base, {"blade.section": section})


def _check_chords(problem: BladeProblem) -> None:
    """Refuse a least chord or thickness that the largest chord does not allow on the outer half of the blade."""
    outer = np.r_[0.0, problem.shape.r, problem.shape.R] > 0.5 * problem.shape.R
    asked, thick, most = (v[outer] for v in problem.chord_limits)
    limits, faults = problem.need.limits, []
    for name, value, least in (("--min-chord-mm", limits.min_chord_m, asked),
                               ("--min-thickness-mm", limits.min_thickness_m, thick)):  # fmt: skip
        if np.any(least > most):
            room = 1e3 * value * float((most / least).min())
            widest = f"The largest chord is {1e3 * most.max():.3g} mm"
            faults.append(Fault(name, "", f"{1e3 * value:g}", f"up to {room:.3g} mm", widest))
    refuse(faults)


def _breaks(label: Label, need: Requirement) -> tuple[str, ...]:
    """Limits that a propeller on sale does not keep, in words without places."""
    model = prepare_case(label.case)
    points = tuple(replace(p, rpm=float(n)) for p, n in zip(need.points, label.rpm, strict=True))
    rotor = model.rotor
    asked = replace(need, points=points, R=rotor.R, Rhub=rotor.Rhub, blades=rotor.B)
    problem, x = search.problem_of(model, asked, rotor.blade)
    v = problem.values(x)
    words = () if v is None else problem.broken(v)
    return tuple(
        dict.fromkeys(word.partition(" at r/R")[0] for word in words if not word.startswith(("least", "largest")))
    )


def _over_rotors(found: search.Optimum, variants: Sequence[Any]) -> OverRotors:
    """Means and standard deviations over rotors as built at the first point, each at the same speed."""
    each = [replace(found.problem, variants=(tuple(v),)).values(found.best) for v in variants]
    T, P = np.array([(v.thrust_N[0], v.power_W[0]) for v in each if v is not None]).T
    return OverRotors(float(T.mean()), float(T.std()), float(P.mean()), float(P.std()))


def _bands(case: Case, need: Requirement, rpm: Array) -> tuple[BandedLoads, ...]:
    """Thrust and power of a case at the points with their uncertainties, in the air of the design."""
    rho = float(need.air.rho)
    density = None if math.isclose(rho, float(case.air().rho), rel_tol=1e-9) else np.full(rpm.size, rho)
    V = np.array([p.airspeed_m_s for p in need.points])
    got = propagate(case, rpm, V, density).points
    return tuple(BandedLoads(*(float(v[i]) for v in (got.thrust_N, got.u_thrust_N, got.power_W, got.u_power_W)))
                 for i in range(rpm.size))  # fmt: skip


def _ideal(need: Requirement, model: Model, found: search.Optimum) -> tuple[float, float]:
    """Mean power of the ideal disk and of the best blade without drag. [W]"""
    rho, mu = float(need.air.rho), float(need.air.mu)
    disk, betz = [], []
    for p, rpm in zip(need.points, found.after.rpm, strict=True):
        if found.problem.flow is not None:
            disk.append(ducted_disk(p.thrust_N, p.airspeed_m_s, found.problem.flow, rho))
            betz.append(math.nan)
            continue
        disk.append(actuator_disk(p.thrust_N, p.airspeed_m_s, need.R, need.Rhub, rho))
        best = minimum_loss(
            p.thrust_N, p.airspeed_m_s, float(rpm), need.blades, need.R, need.Rhub, without_drag, rho, mu
        )
        betz.append(math.nan if best is None else best.power_W)
    w = found.problem.weights
    some = w > 0.0
    return float(w @ np.array(disk)), float(w[some] @ np.array(betz)[some])


def _section(text: str | None, hub_ratio: float) -> tuple[dict[str, Any], Path]:
    """Table [blade.section] of what ``--section`` says, and the folder of its files."""
    if text is None:
        radii = [round(hub_ratio, 4), round(max(THIN_FROM, hub_ratio + 0.1), 4)]
        return {"camber": SECTION[0].value, "thickness": list(FAMILY[0]), "r_over_R": radii}, Path(".")
    words = [word.strip() for word in text.split(",") if word.strip()]
    if not words:
        fault = Fault("--section", "", repr(text), "NACA digits or coordinate files", "As in 4412, or 4415,4409")
        raise InputError(fault)
    files = [Path(word) for word in words if word.lower().endswith(".dat")]
    if files and (len(files) < len(words) or len({f.parent for f in files}) > 1):
        raise InputError(Fault("--section", "", text, "NACA digits, or coordinate files (.dat) of one folder"))
    table: dict[str, Any] = {"dat": [f.name for f in files]} if files else {"naca": words}
    if len(words) > 1:
        table["r_over_R"] = [float(x) for x in np.linspace(hub_ratio, 1.0, len(words)).round(4)]
    else:
        table = {key: value[0] for key, value in table.items()}
    return table, files[0].parent if files else Path(".")


def _open_case(
    diameter_m: float | None, blades: int | None, section: str | None, hub_ratio: float | None, density: float | None
) -> Case:
    """Case with the sections and size of the blade to come."""
    import tomlkit

    hub = HUB_RATIO if hub_ratio is None else hub_ratio
    faults = []
    if diameter_m is None:
        faults.append(Fault("--diameter-in", "", "nothing", "the diameter [in]", "As in --diameter-in 10"))
    elif not 1.0 * INCH <= diameter_m <= 100.0 * INCH:
        hint = "In mm? Divide by 25.4" if 100.0 < diameter_m / INCH < 2600.0 else ""
        faults.append(Fault("--diameter-in", "", f"{diameter_m / INCH:g}", "a number from 1 to 100 in", hint))
    if blades is not None and not 1 <= blades <= 16:
        faults.append(Fault("--blades", "", f"{blades}", "1 to 16"))
    if not 0.05 <= hub <= 0.6:
        faults.append(Fault("--hub-ratio", "", f"{hub:g}", "a number from 0.05 to 0.6"))
    if density is not None and not DENSITY[0] <= density <= DENSITY[1]:
        faults.append(
            Fault("--density-kg-m3", "", f"{density:g}", "0.01 to 10 kg/m3", "In g/m3? Divide by 1000" * (density > 10))
        )
    if faults or diameter_m is None:
        raise InputError(faults)
    table, folder = _section(section, hub)
    document = {
        "schema": "bemt.case/1", "name": "blade",
        "rotor": {"kind": "propeller", "blades": blades or 2, "diameter_in": round(diameter_m / INCH, 6),
                  "hub_ratio": hub},
        "blade": {"chord_law": "constant", "pitch_ratio": 0.6, "known_from": "cad", "section": table},
        "operating": {"rpm": 1000.0}, "air": {"density_kg_m3": density or AIR.value},
    }  # fmt: skip
    with _in_words_of_the_request():
        return case_of(tomlkit.dumps(document), folder)


@contextmanager
def _in_words_of_the_request() -> Iterator[None]:
    """Faults of a case that was made here name the option."""
    try:
        yield
    except InputError as error:
        made = [f for f in error.faults if f.file.endswith("case.toml")]
        section = [replace(f, file="", where="--section") for f in made if f.where.startswith("blade.section")]
        rest = [replace(f, file="") for f in made if not f.where.startswith("blade.section")]
        raise InputError([*section, *rest, *(f for f in error.faults if f not in made)]) from None


def _in_duct(
    case: Case, diameter_m: float | None, blades: int | None, section: str | None, hub_ratio: float | None,
    density: float | None,
) -> Case:  # fmt: skip
    """Case of a rotor in its duct, refused where something besides blades and sections is asked for."""
    faults = [
        Fault(name, "", f"{value:g}", "nothing with --duct: the case states it")
        for name, value in (("--diameter-in", None if diameter_m is None else diameter_m / INCH),
                            ("--hub-ratio", hub_ratio), ("--density-kg-m3", density))
        if value is not None
    ]  # fmt: skip
    if not case.ducted:
        faults.append(Fault(case.path.as_posix(), "duct", "nothing", "a case with a duct", "Leave --duct out"))
    refuse(faults)
    changes: dict[str, Any] = {}
    if blades is not None:
        changes["rotor.blades"] = blades
    if section is not None:
        table, folder = _section(section, case.hub_diameter_m / case.diameter_m)
        if "dat" in table and folder.resolve() != case.folder.resolve():
            raise InputError(Fault("--section", "", section, "coordinate files in the folder of the case"))
        changes["blade.section"] = table
    if not changes:
        return case
    done = tuple(f"{key}." for key in changes)
    changes["assumptions"] = case.declared(lambda key: not f"{key}.".startswith(done))
    return with_changes(case, changes)


def case_files(base: Case, found: search.Optimum, points: Sequence[DesignPoint]) -> dict[str, bytes]:
    """Folder of the blade that was found."""
    import tomlkit

    p = points[0]
    rpm = float(found.after.rpm[0])
    need = found.problem.need
    inch = 2.0 * need.R / INCH
    x, chord, beta = found.problem.shape.table(found.best)
    rows = [f"{a:.7f},{c:.7f},{math.degrees(b):.6f}" for a, c, b in zip(x, chord, beta, strict=True)]
    kind = "fan" if base.ducted else "propeller"
    written = base.written
    blade: dict[str, Any] = {"stations": "stations.csv", "known_from": "cad"}
    if written["blade"].get("section") is not None:
        blade["section"] = written["blade"]["section"]
    document: dict[str, Any] = {
        "schema": "bemt.case/1", "name": name_of(p, 2.0 * need.R),
        "title": f"{kind} designed for {p.thrust_N:g} N {p.at}, {rpm:.0f} rev/min, {inch:.4g} in, {need.blades} blades",
        "origin": "bemt design", **{key: written[key] for key in KEYS_KEPT if written.get(key)},
        "blade": blade, "operating": {"rpm": round(rpm, 1), "airspeed_m_s": float(p.airspeed_m_s)},
    }  # fmt: skip
    unknown = [u for u in (*SURFACE, AIR) if not (base.ducted and u is AIR)]
    document["assumptions"] = [
        {"key": u.key, "low": u.low, "high": u.high, "why": u.why}
        for u in unknown
        if u is not AIR or math.isclose(float(need.air.rho), AIR.value, rel_tol=1e-9)
    ]
    if base.ducted:
        kept = tuple(f"{key}." for key in KEYS_KEPT)
        document["assumptions"] = base.declared(lambda key: key.startswith(kept) and key != "rotor.blades")
    files = {"case.toml": tomlkit.dumps(document).encode(),
             "stations.csv": ("r_over_R,chord_over_R,beta_deg\n" + "\n".join(rows) + "\n").encode()}  # fmt: skip
    return files | new_folder.companions(base)
