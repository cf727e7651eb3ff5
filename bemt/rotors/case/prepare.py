"""A case becomes a model: its polars, effects and duct, for BEMT and for K1/K2."""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from bemt.base import cache
from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, refuse
from bemt.physics import effects, k1k2
from bemt.physics.bem.coaxial import PairModel
from bemt.physics.bem.duct import (
    STATOR_RECOVERY,
    WALL_FRICTION,
    WALL_FRICTION_RANGE,
    DuctFlow,
    duct_flow,
    hydraulic_diameter,
    lip_loss,
)
from bemt.physics.bem.model import Model, acts_on_points
from bemt.physics.effects.tip_gap import GAP_LOSS, TipGap
from bemt.physics.sections import polars
from bemt.physics.sections.neuralfoil import neuralfoil_polar
from bemt.rotors.case.load import Assumption
from bemt.rotors.model import with_run

if TYPE_CHECKING:
    from pathlib import Path

    from bemt.physics.air import Air
    from bemt.physics.dataset import Dataset
    from bemt.rotors.case import Case
    from bemt.rotors.case.schema import PolarTable
    from geometry.rotor import Rotor


def _effects(case: Case) -> tuple[effects.Effect, ...]:
    known = effects.catalogue()
    faults = []
    on: dict[str, effects.Effect] = {}
    for key in ("effects_on", "effects_off", "also_without"):
        for i, text in enumerate(getattr(case.file.model, key)):
            name = text.partition("(")[0].strip()
            where = f"model.{key}[{i}]"
            if name not in known or (key != "effects_on" and name != text):
                close = difflib.get_close_matches(name, known, n=1)
                hint = f"Did you mean {close[0]}?" if close else ""
                faults.append(Fault(case.path.as_posix(), where, repr(text), f"one of {', '.join(known)}", hint))
            elif name in on and key == "effects_on":
                got, hint = f"{text!r} after {effects.to_text(on[name])!r}", "The last one would win"
                faults.append(Fault(case.path.as_posix(), where, got, "each effect once", hint))
            elif key == "effects_on":
                try:
                    on[name] = effects.from_text(text)
                except ValueError as error:
                    got, _, expected = str(error).partition("; expected ")
                    faults.append(Fault(case.path.as_posix(), where, got, expected))
    refuse(faults)
    if (duct := case.file.duct) is not None and duct.gap_loss is not None:
        on.setdefault("tip_gap", TipGap(loss=duct.gap_loss))
    off = set(case.file.model.effects_off)
    standard = {effect.id for effect in effects.standard()}
    return tuple(on.get(name) or cls() for name, cls in known.items() if name in (standard | set(on)) - off)


def _polars(case: Case, anchors: Sequence[tuple[float, Any]]) -> list[tuple[float, polars.Polar]]:
    given = case.file.polars
    if given:
        return _user_polars(case, given)
    rule = case.file.model.n_crit, case.file.model.drag_level
    return [(x, neuralfoil_polar(section, *rule)) for x, section in anchors]


def _user_polars(case: Case, given: Sequence[PolarTable]) -> list[tuple[float, polars.Polar]]:
    """Read the tables of a case; several XFOIL files at one r/R are its Reynolds numbers."""
    from bemt.data.readers.polars import read_many

    groups: dict[float, list[PolarTable]] = {}
    for item in given:
        groups.setdefault(item.r_over_R, []).append(item)
    out, faults = [], []
    for x, items in sorted(groups.items()):
        paths = [case.folder / item.file for item in items]
        kind = items[0].format
        if len(items) > 1:
            out.append((x, read_many(paths)))
            continue
        read = _table(paths[0], None if kind is None else f"polar_{kind}")
        if isinstance(read, polars.Polar):
            out.append((x, read))
        else:
            got = f"a different type of file ({type(read).__name__})"
            faults.append(Fault(paths[0].as_posix(), "", got, "a polar: CSV, XFOIL or C81"))
    refuse(faults)
    return out


_TABLES: cache.Kept[Any] = cache.Kept(32, lambda _: 1.0)


def _table(path: Path, kind: str | None) -> Any:
    """Content of a file, read again only when it has changed."""
    from bemt.data import readers as importers

    if not path.is_file():
        return importers.read(path, kind)  # which says what is wrong
    return _TABLES.get((path.as_posix(), kind, path.read_bytes()), lambda: importers.read(path, kind))


def _duct_flow(case: Case, rotor: Rotor) -> DuctFlow | None:
    duct = case.duct()
    if duct is None:
        return None
    friction = case.get("duct.wall_friction")
    flow = duct_flow(duct, rotor, WALL_FRICTION if friction is None else float(friction))
    given = {"stator": case.get("duct.stator.recovery"), "lip_loss": case.get("duct.lip_loss")}
    stated: dict[str, Any] = {k: float(v) for k, v in given.items() if v is not None}
    return dataclasses.replace(flow, **stated)


def duct_unknowns(case: Case) -> tuple[Assumption, ...]:
    """What a case leaves open of its duct, losses and shape, each with its value here and its range.

    Shape: the body may end at the exit or go through it as wide as the hub; a lip is sharp, or well rounded from 0.15
    of the hydraulic diameter on (Crane TP-410, p. A-29, not checked); rotors sit 15 to 60 % behind the inlet
    (declared); vanes give back 60 to 100 % of the swirl (declared).
    """
    duct = None if "duct" in case.file.model.effects_off else case.duct()
    if duct is None:
        return ()
    lip = lip_loss(duct.lip_radius / hydraulic_diameter(duct, case.rotor()))
    gap = next((effect.loss for effect in _effects(case) if isinstance(effect, TipGap)), None)
    said = any(text.startswith("tip_gap") for text in case.file.model.effects_on)
    found = [
        Assumption("duct.lip_loss", lip.nominal, (lip.low, lip.high), False, "not stated; range of its sources"),
        Assumption("duct.wall_friction", WALL_FRICTION, WALL_FRICTION_RANGE, False, "not stated; Re of 1e5 to 1e7"),
    ]
    hydraulic, mm = hydraulic_diameter(duct, case.rotor()), 1e3
    hub, exit_ = 2.0 * case.rotor().Rhub, 2.0 * float(duct.exit_radius or duct.inner_radius)
    widest = min(hub, 0.9 * exit_) * mm
    inside = math.inf if duct.outer_radius is None else duct.outer_radius - duct.inner_radius
    round_ = min(0.15 * hydraulic, duct.length, inside) * mm
    at = float(duct.rotor_x or 0.0) * mm
    places = (min(at, 0.15 * duct.length * mm), max(at, 0.6 * duct.length * mm))
    found += [
        Assumption("duct.exit_hub_diameter_mm", 0.0, (0.0, widest), True, "not stated; it ends there, or is the hub"),
        Assumption("duct.lip_radius_mm", 0.0, (0.0, round_), False, "not stated; sharp to well rounded"),
        Assumption("duct.rotor_position_mm", at, places, False, "not stated; 15 to 60 % of the length"),
    ]
    thin, thick = float(duct.te_thickness or 0.0), duct.nose[1]
    outside = tuple(2e3 * (duct.inner_radius + duct.lip_radius + rise) for rise in (thin, thick))
    why = "not stated; a wall of the trailing edge's thickness, to a lip as thick outside as inside"
    found.append(Assumption("duct.outer_diameter_mm", outside[1], outside, False, why))
    if duct.stator is not None:
        why = "not stated; share of the swirl's dynamic pressure"
        found.append(Assumption("duct.stator.recovery", STATOR_RECOVERY, (0.6, 1.0), False, why))
    if gap is not None and not said and duct.gap > 0.0:
        found.append(Assumption("duct.gap_loss", gap, GAP_LOSS, False, "not stated; range measured on compressors"))
    known = {item.key for item in case.assumptions}
    return tuple(item for item in found if item.key not in known and case.get(item.key) is None)


def prepare_case(
    case: Case, overrides: Mapping[str, Any] | None = None, n_stations: int | None = None, oblique: bool = False,
    alone: bool = False,
) -> Model:  # fmt: skip
    """Rotor, section tables, duct and effects of a case; InputError if the changed values make none.

    ``oblique`` says that the caller solves at the angle of the case. All others know axial flow only: a case with an
    angle is refused, lest its wind is taken as axial. ``alone`` says that the caller wants the first rotor of a pair by
    itself; all others are refused one.
    """
    case = case.replaced(overrides)
    if not oblique:
        case.axial_only()
    if not alone:
        case.one_rotor_only()
    told = case.file.blade.as_built
    if case.file.polars or (told is not None and told.file is not None) or cache.watched():
        return _model(case, n_stations)  # of files that may have changed
    return case.once(("model", n_stations), lambda: _model(case, n_stations))


def prepare_pair(case: Case, n_stations: int | None = None, second: Case | None = None) -> PairModel:
    """Both rotors of a coaxial case; ``second`` replaces the case of the second one."""
    told = case.file.second_rotor
    assert told is not None  # the caller asks for a pair
    lower = case.second() if second is None else second
    first, other = (prepare_case(one, None, n_stations, oblique=True, alone=True) for one in (case, lower))
    for one, model in ((case, first), (lower, other)):
        around = [effect.id for effect in model.effects if acts_on_points(effect)]
        if around:
            got, hint = ", ".join(around), "Their law is that of one rotor"
            raise InputError(Fault(one.path.as_posix(), "model.effects_on", got, "none of them with a pair", hint))
    ratio = 1.0 if told.rpm_ratio is None else told.rpm_ratio
    return PairModel(
        first, other, told.spacing_m(case.diameter_m), told.turns == "opposite", told.wake_radius, told.interference,
        ratio, told.rpm, told.torque_balance, told.swirl, told.mount_drag,
    )  # fmt: skip


def _model(case: Case, n_stations: int | None) -> Model:
    rotor = case.rotor()
    tables = _polars(case, rotor.blade.anchors)
    duct = None if "duct" in case.file.model.effects_off else _duct_flow(case, rotor)
    n = case.file.model.stations if n_stations is None else n_stations
    notes = tuple(dict.fromkeys(note for _, polar in tables for note in polar.notes))
    model = Model(rotor, tables, duct, n, effects=(*_effects(case), *case.stated_effects()), notes=notes)
    known = case.as_built()
    if known.reference is None:
        return model
    return with_run(model, case.air(), known.prior, known.drawn, known.reference)


def k1k2_case(
    case: Case, overrides: Mapping[str, Any] | None, rpm: Array, airspeed_m_s: Array, air: Air,
    angle_deg: ArrayLike | None = None,
) -> Dataset:  # fmt: skip
    """K1/K2 at points [rev/min], [m/s], for the stated pitch, else that at 0.75 R; a duct counts its annulus only.

    It knows one rotor in axial flow: NaN and flagged for a pair, and where the wind, at an angle [deg], is not along
    the shaft.
    """
    case = case.replaced(overrides)
    pitch = case.stated_pitch_m
    if np.isnan(pitch):
        pitch = case.rotor().blade.pitch_m()
    hub = case.hub_diameter_m if case.ducted else 0.0
    m = case.file.model
    found = k1k2.estimate(case.diameter_m, pitch, rpm, airspeed_m_s, air, hub, case.ducted, m.K1, m.K2, m.u_K1K2)
    angle = np.asarray(case.angle_deg if angle_deg is None else angle_deg, dtype=float)
    skewed = np.broadcast_to((angle != 0.0) & (np.asarray(airspeed_m_s) != 0.0), (len(found),))
    why = "K1/K2 knows axial flow only"
    if case.paired:
        skewed, why = np.ones(len(found), dtype=bool), "K1/K2 knows one rotor only"
    if not np.any(skewed):
        return found
    nan = np.where(skewed, np.nan, 1.0)
    values = {key: v * nan if key in ("thrust_N", "CT") else v for key, v in found.values.items()}
    words = ((why,) if one else () for one in skewed)
    flags = tuple((*f, *more) for f, more in zip(found.flags, words, strict=True))
    return dataclasses.replace(found, values=values, u={"thrust_N": found.u_thrust_N * nan}, flags=flags)
