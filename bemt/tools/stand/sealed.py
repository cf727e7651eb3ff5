"""What a simulated stand has wrong: an item of a proof, or a fault of one's own case, sealed before it is asked."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bemt import __version__
from bemt.base.errors import Fault, InputError
from bemt.base.tables import write_atomic
from bemt.judge.proof import prove, rows
from bemt.judge.proof.causes import CAUSES, WALL, Rig, draw_rig
from bemt.judge.proof.items import Bench
from bemt.judge.proof.prove import KEY_SCHEMA
from bemt.judge.proof.rows import Entry, Key
from bemt.judge.proof.truth import TruthRotor
from bemt.judge.proof.truth_section import TrueSection
from bemt.judge.proof.truth_world import Conditions, TruthDuct

if TYPE_CHECKING:
    from bemt.rotors.case import Case

_OWN, _ITEM, _POINTS = "case", "0000", "points.json"
_SOUND = 343.0
_DUCT = 1.2, 0.4  # Length and place of the rotor over R, where a case has a duct [1]
# Causes that are drawn for a case: those that anybody may have, none in one of four
_DRAWN = ("thrust_gain", "torque_gain", "thrust_zero", "torque_zero", "rpm_scale", "cross_talk", "pitch_offset",
          "section", "air_density", "untwist")  # fmt: skip
_NOTHING = 0.25


def bench_of(folder: Path, item: str) -> tuple[Bench, Entry]:
    """Bench and entry of an item of a sealed key."""
    key = rows.unseal(folder)
    entry = next(e for e in key.items if e.folder == item)
    if key.size == _OWN:
        from bemt.rotors.case import load_case

        told = json.loads((folder / _POINTS).read_text("utf-8"))
        rig = rig_of(load_case(told["case"]), told["top_rpm"])
        return Bench(rig, entry.plan, rows_of(told["points"])), entry
    return prove.benches_of(key)[entry.rig, entry.plan], entry


def seal_case(
    folder: Path, case: Case, points: Sequence[Mapping[str, float]], top_rpm: float, faults: Sequence[str], seed: int
) -> str:  # fmt: skip
    """Seal what is wrong with the simulated stand of a case; the hash. Drawn where no fault is declared."""
    rng = np.random.default_rng(seed)
    able = [n for n in CAUSES if not CAUSES[n].without.section and CAUSES[n].kind != "drive"]
    wrong = [n for n in faults if n not in able]
    if wrong:
        raise InputError(Fault("", "fault", ", ".join(wrong), f"of {', '.join(sorted(able))}"))
    names = tuple(faults) or (() if rng.random() < _NOTHING else (str(rng.choice(_DRAWN)),))
    entry = Entry(
        folder=_ITEM, set="pair" if len(names) > 1 else "single" if names else "null", causes=names,
        strengths=tuple(float(rng.uniform(1.0, 1.7)) for _ in names), seed=int(rng.integers(2**31)), rig=case.name,
        plan="static_sweep" if max(p["airspeed_m_s"] for p in points) == 0.0 else "grid_ordered", air_known=True,
        alike=tuple(() for _ in names),
    )  # fmt: skip
    told = {"case": case.path.resolve().as_posix(), "top_rpm": top_rpm, "points": [dict(p) for p in points]}
    write_atomic(folder / _POINTS, json.dumps(told))
    return rows.seal(folder, Key(KEY_SCHEMA, __version__, str(seed), _OWN, (entry,)))


def rig_of(case: Case, top_rpm: float) -> Rig:
    """The proof's rotor with the blade of a case; its sections are the proof's, of the camber and thickness stated."""
    from bemt.rotors.case.prepare import prepare_case

    model = prepare_case(case)
    blade, flow = model.rotor.blade, model.duct
    R, foil = blade.R, blade.anchors[-1][1]
    section = TrueSection(max(foil.camber, 0.0), 0.4, foil.thickness)
    x, c, beta = (tuple(map(float, v)) for v in (blade.r / R, blade.chord / R, blade.beta))
    rotor = TruthRotor(R, model.rotor.B, x, c, beta, section, wall=np.nan if flow is None else WALL)
    duct = None if flow is None else TruthDuct(*_DUCT, max(flow.gap / R, 0.003), flow.wake_ratio)
    motor = draw_rig("motor", flow is not None, np.random.default_rng(0)).motor
    pitch = float(np.pi * 0.75 * np.tan(np.interp(0.75, x, beta)))
    return Rig(case.name, rotor, duct, pitch, top_rpm * np.pi / 30.0 * R / _SOUND, motor)


def rows_of(points: Sequence[Mapping[str, float]]) -> Conditions:
    """Conditions of points, in their order."""
    n = len(points)
    rpm, V = (np.array([float(p[k]) for p in points]) for k in ("rpm", "airspeed_m_s"))
    T, p, still = np.full(n, 20.0), np.full(n, 101325.0), np.full(n, np.nan)
    run = np.array([int(q.get("run", 0)) for q in points])
    return Conditions(rpm, V, T, p, np.linspace(0.0, 12.0 * (n - 1), n), np.full(n, 600.0), still, still, run)
