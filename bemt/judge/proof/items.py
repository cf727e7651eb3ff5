"""Concealed items: a recording and a case in a folder, and the entry of the key that tells what is in them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array
from bemt.judge.proof.causes import CAUSES, LISTED, Cause, Change, Rig, applied, conditions, extended
from bemt.judge.proof.rows import Entry, TrueValue
from bemt.judge.proof.stand import FREEDOM, StandErrors, Yardstick, freedom, full_scales, record, yardstick
from bemt.judge.proof.truth import TrueAnswer
from bemt.judge.proof.truth_section import SectionPhysics
from bemt.judge.proof.truth_world import EXPRESSIBLE, Conditions, TrueLoads, World, loads

_DIGITS = 6
# Share of the items that state the uncertainty of their readings, and that come with a run without the cause.
_STATED, _REFERENCED = 0.75, 0.5
# Standard deviation of a blade that only its reference shows: angle [deg] and camber [1], beside the freedom of all.
_BLADE_OFF, _CAMBER_OFF = 0.8, 0.003


@dataclass
class Bench:
    """A rig in a plan, with the signatures of the causes once they were asked for."""

    rig: Rig  # What is tested
    plan: str  # Name of the plan
    rows: Conditions  # Real conditions
    _signatures: dict[str, dict[str, Array]] = field(default_factory=dict)
    _tangents: list[dict[str, Array]] = field(default_factory=list)
    _starts: dict[bool, TrueAnswer] = field(default_factory=dict)

    @classmethod
    def draw(cls, rig: Rig, plan: str, rng: np.random.Generator) -> Bench:
        """Draw weather and order of a plan."""
        return cls(rig, plan, conditions(plan, rig, rng))

    def allowed(self) -> list[Cause]:
        """Causes that can be at work here."""
        ducted = self.rig.duct is not None
        able = EXPRESSIBLE if self.rig.rotor.code == "ccblade" else CAUSES
        return [c for c in CAUSES.values() if self.plan in c.plans and c.ducted in (None, ducted) and c.id in able]

    def plain(self) -> World:
        """World without any cause: with a wall behind the rotor in plans that have one."""
        return World(ground=1.0 if self.plan == "wall" else 0.0)

    def measure(
        self, world: World, stand: StandErrors, rng: np.random.Generator | None = None, ducted: bool = True,
        scales: tuple[float, float] | None = None,
    ) -> tuple[TrueLoads, dict[str, Array]]:  # fmt: skip
        """Real loads and what the stand reads."""
        duct = self.rig.duct if ducted else None
        rotor = self.rig.rotor if duct is not None else replace(self.rig.rotor, wall=float("nan"))
        real = loads(rotor, world, self.rows, duct, self._starts.get(duct is not None))
        self._starts.setdefault(duct is not None, real.answer)
        motor = self.rig.motor if self.plan == "endurance" else None
        return real, record(real, self.rows, self.rig.rotor.radius, motor, stand, rng, scales)

    def signature(self, change: Change, cause: Cause) -> dict[str, Array]:
        """Readings with a cause less those without it, noise apart."""
        quiet = StandErrors()
        without_world, without_stand = applied(self.plain(), quiet, cause.without)
        real, base = self.measure(without_world, without_stand, ducted=cause.without.ducted is not False)
        world, stand = applied(self.plain(), quiet, change)
        _, with_it = self.measure(world, stand, scales=full_scales(real))
        out = {name: with_it[name] - base[name] for name in base if name not in ("rpm", "airspeed_m_s", "time_s")}
        # a wrong speed or airspeed is seen through what the model says there
        if stand.rpm_scale or stand.airspeed_offset or stand.airspeed_gain:
            shifted = replace(self.rows, rpm=with_it["rpm"], airspeed=with_it["airspeed_m_s"])
            there = Bench(self.rig, self.plan, shifted, _starts=self._starts).measure(world, quiet)[1]
            for name in ("thrust_N", "torque_Nm"):
                out[name] = base[name] - there[name]
        return out

    def signatures(self) -> dict[str, dict[str, Array]]:
        """Signatures of all listed causes at ordinary strength; kept."""
        if not self._signatures:
            rng = np.random.default_rng(0)
            for cause in self.allowed():
                if cause.kind != "unlisted":
                    self._signatures[cause.id] = self.signature(cause.make(1.0, self.rig, self.rows, rng), cause)
        return self._signatures

    def tangents(self) -> list[dict[str, Array]]:
        """Differences of the readings for one standard deviation of each nuisance; kept. [units of the channels]"""
        if not self._tangents:
            quiet, world = StandErrors(), self.plain()
            base = self.measure(world, quiet)[1]
            rows = replace(self.rows, rpm=self.rows.rpm * (1.0 + FREEDOM.rpm))
            faster = Bench(self.rig, self.plan, rows, _starts=self._starts)
            found = [self.measure(changed, quiet)[1] for changed in freedom(world).values()]
            names = [n for n in base if n not in ("rpm", "airspeed_m_s", "time_s")]
            found.append(faster.measure(world, quiet)[1])
            self._tangents += [{n: got[n] - base[n] for n in names} for got in found]
        return self._tangents


@dataclass(frozen=True)
class Item:
    """One concealed item."""

    files: Mapping[str, str]  # Name to text: recording.csv, case.toml, stations.csv
    entry: Entry  # What the key says of it
    # Run without the causes that can be taken away, given when the diagnosis asks for one; "" where it has no solution
    reference: str = ""


def _quality(rng: np.random.Generator, quiet: bool) -> StandErrors:
    if quiet:
        return StandErrors(noise=0.001, floor=0.0002, session=0.0, rpm_noise=0.0001, airspeed_noise=0.01)
    return StandErrors(
        noise=float(rng.uniform(0.003, 0.010)), floor=float(rng.uniform(0.0005, 0.0015)),
        share=float(rng.uniform(0.3, 0.8)), memory=float(rng.uniform(0.4, 0.85)),
        session=float(rng.uniform(0.0, 0.004)), airspeed_noise=float(rng.uniform(0.02, 0.08)),
    )  # fmt: skip


@dataclass(frozen=True)
class Hidden:
    """Rotor and stand of an item, with and without their causes, and the random numbers that are still to be drawn."""

    causes: list[Cause]
    changes: list[Change]
    world: World
    stand: StandErrors
    own_world: World
    own_stand: StandErrors
    stated: bool
    referenced: bool
    rng: np.random.Generator
    more: np.random.Generator


def hidden(
    bench: Bench, ids: Sequence[str], strengths: Sequence[float], seed: int, kind: str, mended: Collection[str] = ()
) -> Hidden:  # fmt: skip
    """Draw rotor and stand of an item from its seed; the same whenever it is asked, but for causes that were mended."""
    rng = np.random.default_rng(seed)
    causes = [CAUSES[i] for i in ids]
    changes = [c.make(f, bench.rig, bench.rows, rng) for c, f in zip(causes, strengths, strict=True)]
    stand = _quality(rng, kind == "mismatch")
    # no two blades and no two stands are alike: half of the freedom that a diagnosis must allow for
    section = SectionPhysics(
        drag_level=1.0 + 0.5 * FREEDOM.drag * rng.standard_normal(),
        slope_level=1.0 + 0.5 * FREEDOM.slope * rng.standard_normal(),
    )
    world = replace(bench.plain(), section=section, pitch_offset=0.5 * FREEDOM.pitch * float(rng.standard_normal()))
    if kind == "mismatch":
        world = bench.plain()
    more = np.random.default_rng((seed, 1))
    stated = bool(more.random() < _STATED) or kind == "mismatch"
    referenced = bool(more.random() < _REFERENCED) and kind != "mismatch"
    if referenced:  # a blade that is not the case's, as a reference shows it
        turn, camber = more.standard_normal(2)
        section = replace(world.section, camber=_CAMBER_OFF * float(camber))
        world = replace(world, section=section, pitch_offset=world.pitch_offset + _BLADE_OFF * float(turn))
    own_world, own_stand = world, stand
    for cause, change in zip(causes, changes, strict=True):
        if cause.id in mended:
            continue
        own, shape = dict(change.world), dict(change.section)
        if "pitch_offset" in own:
            own["pitch_offset"] += world.pitch_offset
        if "camber" in shape:
            shape["camber"] += world.section.camber
        world, stand = applied(world, stand, replace(change, world=own, section=shape))
    return Hidden(causes, changes, world, stand, own_world, own_stand, stated, referenced, rng, more)


class NoSolutionError(ValueError):
    """The truth has no solution at most rows."""


def make_item(
    bench: Bench, ids: tuple[str, ...], strengths: tuple[float, ...], seed: int, kind: str,
    known: Collection[str] = (), standard: Collection[str] = (),
) -> Item:  # fmt: skip
    """Measure a truth with concealed causes; NoSolutionError where it has none at most rows."""
    h = hidden(bench, ids, strengths, seed, kind)
    causes, stand, rng = h.causes, h.stand, h.rng
    real, columns = bench.measure(h.world, stand, rng)
    good = np.isfinite(columns["thrust_N"]) & np.isfinite(columns["torque_Nm"])
    if np.mean(good) < 0.8:
        raise NoSolutionError(f"{bench.rig.name} {bench.plan} {ids}: the truth has no solution at most rows")

    air_known = "air_density" not in ids and (bench.plan == "two_air" or bool(rng.random() < 0.5))
    shown = _shown(bench, real, columns, stand, air_known, rng, h.stated)
    off = tuple(dict.fromkeys(e for c in causes for e in c.off))
    on = ("ground_effect",) if bench.plan == "wall" and "ground_effect" not in ids else ()
    files = {
        "recording.csv": recording_text({n: v[good] for n, v in shown.items()}),
        "case.toml": case_of(
            bench, [e for e in off if e in standard], [e for e in on if e in known], with_duct="duct" not in off
        ),
        "stations.csv": stations_text(bench.rig.rotor.r_R, bench.rig.rotor.c_R, np.degrees(bench.rig.rotor.beta)),
    }
    reference = _reference(bench, h, air_known)
    if h.referenced and reference:
        files["reference.csv"] = reference
    entry = Entry(
        set=kind, causes=ids, kinds=tuple(c.kind for c in causes), strengths=strengths, plan=bench.plan,
        rig=bench.rig.name, ducted=bench.rig.duct is not None, seed=seed, referenced="reference.csv" in files,
        stated=h.stated, air_known=air_known, rows=int(np.count_nonzero(good)),
        stand={k: v for k, v in vars(stand).items() if k in _QUALITY},
    )  # fmt: skip
    return Item(files, _judged(entry, bench, h), reference)


def _judged(entry: Entry, bench: Bench, h: Hidden) -> Entry:
    """Entry with the sizes of its causes and how well the plan can see them."""
    signed = [bench.signature(ch, c) for ch, c in zip(h.changes, h.causes, strict=True)]
    loads_, columns = bench.measure(bench.plain(), StandErrors())
    electric: dict[str, Array] = {n: columns[n] for n in ("voltage_V", "current_A", "pwm_us") if n in columns}
    rule = yardstick(loads_, bench.rows.run, StandErrors(**entry.stand), bench.tangents(), electric)
    parts = [_judge(rule, bench, cause, s) for cause, s in zip(h.causes, signed, strict=True)]
    noise, whole, alike = zip(*parts, strict=True) if parts else ((), (), ())
    together = None
    if len(parts) > 1:  # how far the weaker of a pair stands out when the stronger may take what it can
        a, b = (rule.whole(rule.stack(s)) for s in signed)
        together = _across(a, b), _across(b, a)
    true = {c.id: {n: TrueValue(v, u) for n, (v, u) in ch.parameters.items()}
            for c, ch in zip(h.causes, h.changes, strict=True)}  # fmt: skip
    return replace(
        entry, parameters=true, separation=whole, separation_noise=noise, alike=alike, separation_together=together,
        variables=tuple(_varied(c.variables, bench.rows) for c in h.causes),
    )  # fmt: skip


def _shown(
    bench: Bench, real: TrueLoads, columns: dict[str, Array], stand: StandErrors, air_known: bool,
    rng: np.random.Generator, stated: bool,
) -> dict[str, Array]:  # fmt: skip
    """Columns of a recording, uncertainties among them where they are stated."""
    rows = bench.rows
    shown: dict[str, Array] = {"run": rows.run.astype(float), **columns}
    shown["temperature_C"] = rows.temperature_C + 0.1 * rng.standard_normal(rows.rpm.size)
    if air_known:
        shown["pressure_Pa"] = rows.pressure_Pa + 30.0 * rng.standard_normal()
    if np.any(np.isfinite(rows.wall)):
        shown["wall_distance_m"] = rows.wall
    if bench.plan == "gap":
        shown["tip_gap_mm"] = rows.gap * 1e3
    if not stated:
        return shown
    exact = record(real, rows, bench.rig.rotor.radius, None, stand, None)
    for name, value in (("u_thrust_N", exact["thrust_N"]), ("u_torque_Nm", exact["torque_Nm"])):
        full = float(np.nanmax(np.abs(value)))
        shown[name] = np.hypot(np.hypot(stand.noise, stand.session) * np.abs(value), stand.floor * full)
    return shown


def further_run(
    bench: Bench, entry: Entry, runs: Sequence[Sequence[Mapping[str, float]]],
    mended: Collection[str] = (), day: int = 0,
) -> str:  # fmt: skip
    """The last of the runs that were asked for, as CSV, on the rotor and stand of an item; "" if it has no solution.

    ``mended`` are causes that are no longer there; each ``day`` has noise of its own.
    """
    rows = bench.rows
    for points in runs:
        rows = extended(rows, points)
    own = np.arange(rows.rpm.size) >= rows.rpm.size - len(runs[-1])
    told = any("pressure_Pa" in p for p in runs[-1])
    return _measured_again(Bench(bench.rig, bench.plan, rows), bench, entry, own, mended, (2, len(runs), day), told)


def recorded_again(bench: Bench, entry: Entry, mended: Collection[str], day: int) -> str:
    """The points of an item once more on another day, as CSV, without the causes that were mended; "" if unsolved."""
    return _measured_again(bench, bench, entry, np.ones(bench.rows.rpm.size, dtype=bool), mended, (3, day), False)


def _measured_again(
    wider: Bench, bench: Bench, entry: Entry, own: NDArray[np.bool_], mended: Collection[str],
    draw: tuple[int, ...], air_told: bool,
) -> str:  # fmt: skip
    """Own rows of a bench on rotor and stand of an item."""
    h = hidden(bench, entry.causes, entry.strengths, entry.seed, entry.set, mended)
    # each cell keeps the full scale that it had
    scales = full_scales(bench.measure(h.world, h.stand)[0])
    rng = np.random.default_rng((entry.seed, *draw))
    real, columns = wider.measure(h.world, h.stand, rng, scales=scales)
    air_known = (air_told and "air_density" not in entry.causes) or bool(entry.air_known)
    shown = _shown(wider, real, columns, h.stand, air_known, rng, h.stated)
    good = own & np.isfinite(columns["thrust_N"]) & np.isfinite(columns["torque_Nm"])
    return recording_text({n: v[good] for n, v in shown.items()}) if np.count_nonzero(good) > 1 else ""


def _reference(bench: Bench, h: Hidden, air_known: bool) -> str:
    """The same rotor at the same points on another day, without what can be taken away; "" where it has no solution."""
    world, stand, ducted = h.own_world, h.own_stand, True
    for cause, change in sorted(zip(h.causes, h.changes, strict=True), key=lambda pair: pair[0].removable):
        world, stand = applied(world, stand, cause.without if cause.removable else change)
        ducted = ducted and not (cause.removable and cause.without.ducted is False)
    real, columns = bench.measure(world, stand, h.more, ducted=ducted)
    good = np.isfinite(columns["thrust_N"]) & np.isfinite(columns["torque_Nm"])
    shown = _shown(bench, real, columns, stand, air_known, h.more, h.stated)
    return recording_text({n: v[good] for n, v in shown.items()}) if np.mean(good) >= 0.8 else ""


_QUALITY = ("noise", "floor", "share", "memory", "session", "step", "rpm_noise", "airspeed_noise")


def _varied(names: Sequence[str], rows: Conditions) -> tuple[str, ...]:
    """Variables of a cause that the plan varies: where nothing changes along one, nothing can be located in it."""
    still = float(np.ptp(rows.airspeed)) == 0.0
    return tuple(n for n in names if not (still and n in ("j", "airspeed")))


def _across(own: Array, other: Array) -> float:
    length = float(other @ other)
    return float(np.linalg.norm(own - (own @ other) / length * other)) if length > 0.0 else float(np.linalg.norm(own))


def _judge(
    rule: Yardstick, bench: Bench, cause: Cause, signature: Mapping[str, Array]
) -> tuple[float, float, tuple[str, ...]]:
    """Separation over noise and over all that is unknown, and what looks alike."""
    own = rule.stack(signature)
    others = {i: rule.stack(s) for i, s in bench.signatures().items() if i != cause.id and i in LISTED}
    return *rule.separation(own), tuple(rule.alike(own, others))


def recording_text(columns: Mapping[str, Iterable[float]]) -> str:
    """Recording as CSV."""
    body = zip(*([f"{float(v):.{_DIGITS}g}" if n != "run" else str(int(v)) for v in column]
                 for n, column in columns.items()), strict=True)  # fmt: skip
    return "\n".join([",".join(columns), *(",".join(row) for row in body)]) + "\n"


def stations_text(r_R: ArrayLike, c_R: ArrayLike, beta_deg: ArrayLike) -> str:
    """Stations of a blade as CSV."""
    rows = np.column_stack([r_R, c_R, beta_deg]).tolist()
    return "r_over_R,chord_over_R,beta_deg\n" + "".join(f"{x:.5f},{c:.6f},{b:.4f}\n" for x, c, b in rows)


Cell = str | float | list[str] | tuple[float, str]
"""Value of a case: words, a number, effects, or a number with its format."""


def case_text(name: str, tables: Mapping[str, Mapping[str, Cell]], form: str = ".7g") -> str:
    """Case file."""

    def shown(v: Cell) -> str:
        if isinstance(v, list):
            return f"[{', '.join(map(shown, v))}]"
        return f'"{v}"' if isinstance(v, str) else f"{v[0]:{v[1]}}" if isinstance(v, tuple) else f"{v:{form}}"

    lines = ['schema = "bemt.case/1"', f'name = "{name}"']
    for head, rows in tables.items():
        lines += ["", f"[{head}]", *(f"{k} = {shown(v)}" for k, v in rows.items())]
    return "\n".join(lines) + "\n"


def case_of(bench: Bench, off: Sequence[str], on: Sequence[str], with_duct: bool = True) -> str:
    """Case file of a rig: its geometry, its laboratory's air, and what the baseline leaves out."""
    rig, rows = bench.rig, bench.rows
    rotor, section = rig.rotor, rig.rotor.section
    duct = rig.duct if with_duct else None
    tables: dict[str, dict[str, Cell]] = {
        "rotor": {"kind": "fan" if duct is not None else "propeller", "blades": rotor.blades,
                  "diameter_mm": (2e3 * rotor.radius, ".4f"), "hub_ratio": (rotor.hub, "g")},
        "blade": {"stations": "stations.csv"},
        "blade.section": {"camber": (section.camber, ".5f"), "camber_position": (section.position, "g"),
                          "thickness": (section.thickness, ".5f")},
        "operating": {"rpm": (float(np.median(rows.rpm)), ".1f"), "airspeed_m_s": 0},
        "air": {"pressure_hPa": (float(np.max(rows.pressure_Pa)) / 100.0, ".2f"),
                "temperature_C": (float(np.median(rows.temperature_C)), ".2f")},
        "model": {"stations": 30, "effects_off": [*off], "effects_on": [*on]},
    }  # fmt: skip
    if duct is not None:
        R = rotor.radius * 1e3
        gap = float(np.nanmax(rows.gap)) * 1e3 if np.any(np.isfinite(rows.gap)) else duct.gap * R
        tables["duct"] = {
            "tip_gap_mm": (gap, ".4f"), "length_mm": (duct.length * R, ".3f"),
            "lip_radius_mm": (duct.lip_radius * R, ".3f"), "rotor_position_mm": (duct.position * R, ".3f"),
            "exit_area_ratio": (duct.exit_ratio, ".5f"),
        }  # fmt: skip
    return case_text(rig.name, tables)
