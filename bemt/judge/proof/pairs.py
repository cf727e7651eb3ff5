"""Pairs of published recordings that differ by one documented thing, prepared as ``pairs.toml`` says.

A pair becomes two tables of steady points, ``reference.csv`` (A) and ``recording.csv`` (B), which the answering process
compares without a case, or with a case made of the label.
"""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.given import data_roots
from bemt.judge.proof.items import Item, case_text, recording_text
from bemt.judge.proof.rows import Entry

_KEPT = ("rpm", "airspeed_m_s", "thrust_N", "torque_Nm", "density_kg_m3", "electrical_power_W", "voltage_V",
         "second_rotor_rad_s", "run")  # fmt: skip
_PROPELLERS = 4


@dataclass(frozen=True)
class PairOf:
    """Two recordings of the manifest."""

    kind: str  # Set
    # Names of the recordings
    a: str
    b: str
    # What was changed, and what cannot be told from it there
    causes: tuple[str, ...]
    alike: tuple[str, ...]
    reason: str  # Where that is documented
    case: Mapping[str, Any] | None = None  # Label of the rotor, for a case


@cache
def _manifest() -> Mapping[str, Any]:
    return tomllib.loads(Path(__file__).with_name("pairs.toml").read_text(encoding="utf-8"))


@cache
def _recordings() -> Mapping[str, Mapping[str, Any]]:
    """Name of a recording to how it is read."""
    out = {}
    for group in _manifest()["recordings"]:
        conditions = group.get("where", [{}])
        for k, name in enumerate(group["names"]):
            where = conditions[min(k, len(conditions) - 1)]
            out[str(group.get("as", "{}")).format(name)] = {**group, "path": group["file"].format(name), "cells": where}
    return out


@cache
def pairs() -> tuple[PairOf, ...]:
    """All pairs of the manifest, those with a label twice."""
    out = []
    for group in _manifest()["pair"]:
        for a, b in group["ab"]:
            one = PairOf(
                group["set"], a, b, tuple(group["causes"]), tuple(group.get("alike", ())), str(group["reason"])
            )
            out.append(one)
            out += [
                PairOf(f"{one.kind}, case", a, b, one.causes, one.alike, one.reason, told["case"])
                for told in _manifest()["labelled"]
                if one.kind in told["sets"] and told["only"] in a
            ]
    return tuple(out)


@dataclass(frozen=True)
class Followed:
    """A silent pair, the step that was recommended, and the recordings that took it."""

    of: tuple[str, str]
    step: str
    ab: tuple[str, str]


def followed() -> tuple[Followed, ...]:
    """Steps of the manifest that somebody took."""
    return tuple(
        Followed((r["of"][0], r["of"][1]), r["step"], (r["ab"][0], r["ab"][1])) for r in _manifest()["followed"]
    )


def pair_files(a: str, b: str) -> dict[str, str] | None:
    """Files of an item that compares two recordings; None where one of them is not found."""
    paths = [_find(_recordings()[name]["path"]) for name in (a, b)]
    if None in paths:
        return None
    texts = [_text(path, name) for path, name in zip(paths, (a, b), strict=True) if path is not None]
    return {"reference.csv": texts[0], "recording.csv": texts[1], "compare": "A reference, B recording\n"}


def _plain(path: Path, how: Mapping[str, Any]) -> dict[str, Array]:
    """Columns of a plain table, by heading or by number."""
    if "numbered" in how:
        rows = np.loadtxt(path)
        columns = {name: rows[:, k - 1] for name, k in how["numbered"].items()}
    else:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            read = [row for row in csv.DictReader(stream) if all(row[k] == v for k, v in how["cells"].items())]
        scale = how.get("scale", {})
        columns = {
            name: np.array([float(row[head]) for row in read]) / scale.get(name, 1.0)
            for name, head in how["table"].items()
        }
    if "half" in how:
        command = next(iter(columns.values()))
        drop = np.flatnonzero(np.diff(command) < 0.0)
        top = int(drop[0]) + 1 if drop.size else command.size
        part = slice(0, top) if how["half"] == "up" else slice(top, None)
        columns = {k: v[part] for k, v in columns.items()}
    if "rpm" in columns:
        good = columns["rpm"] > 0.0
        columns = {k: v[good] for k, v in columns.items()}
    return columns


def _flight(path: Path, mass_kg: float) -> dict[str, Array]:
    """Thrust per propeller of a flight: mass times acceleration along the rotors, averaged over a tenth of a second."""
    from bemt.data.recordings.load import import_file

    v = import_file(path).values
    flying = (v["rpm"] > 0.5 * np.median(v["rpm"])) & (v["height_m"] > 0.3)
    block = np.floor(v["time_s"][flying] * 10.0).astype(int)
    _, block = np.unique(block, return_inverse=True)
    count = np.bincount(block)

    def mean(x: Array) -> Array:
        return np.asarray(np.bincount(block, x[flying]) / count)

    thrust = mass_kg * mean(v["acceleration_z_m_s2"]) / _PROPELLERS
    return {"rpm": np.sqrt(mean(v["rpm"] ** 2)), "thrust_N": thrust, "voltage_V": mean(v["voltage_V"])}


def _read(path: Path, how: Mapping[str, Any]) -> dict[str, Array]:
    """Steady points of one recording, in SI."""
    from bemt.data.recordings.load import import_file
    from bemt.judge.compare.matched import stand_run
    from bemt.judge.compare.selection import selected

    if "mass_kg" in how:
        columns = _flight(path, float(how["mass_kg"]))
    elif "table" in how or "numbered" in how:
        columns = _plain(path, how)
    else:
        run = stand_run(selected(import_file(path), how.get("rows", ()), path.name), path.name)
        columns = {k: run.points[k] for k in _KEPT if k in run.points}
        if run.command:
            columns["pulse_width_s" if run.command == "pwm_s" else run.command] = run.points["command"]
    n = next(iter(columns.values())).size
    columns |= {k: np.full(n, float(v)) for k, v in how.get("constant", {}).items()}
    load = [np.isfinite(columns[k]) for k in ("thrust_N", "torque_Nm") if k in columns]
    good = np.any(load, axis=0) & np.isfinite(columns.get("rpm", np.ones(n)))
    return {k: v[good] for k, v in columns.items() if np.isfinite(v[good]).any()}


def _find(path: str) -> Path | None:
    return next((root / path for root in data_roots() if (root / path).is_file()), None)


def _case(label: Mapping[str, Any]) -> str:
    """Case of a label: an APC-like blade where nothing more is known."""
    fan = "chord_law" in label
    rotor = {"kind": "propeller", "blades": label["blades"], "hub_ratio": label.get("hub_ratio", 0.1)}
    rotor |= {k: label[k] for k in ("diameter_in", "diameter_mm") if k in label}
    blade = {k: label[k] for k in ("pitch_in", "pitch_mm") if k in label}
    blade |= {"chord_law": label.get("chord_law", "apc_like")} | ({"max_chord_over_R": 0.35} if fan else {})
    section = {"camber": 0.05, "thickness": 0.09} if fan else {"camber": 0.04, "thickness": 0.10}

    operating = {"rpm": label["rpm"], "airspeed_m_s": 0.0}
    return case_text("label", {"rotor": rotor, "blade": blade, "blade.section": section, "operating": operating,
                               "air": {"density_kg_m3": 1.2}}, "g")  # fmt: skip


def draw_pairs() -> Iterator[Item]:
    """Make an item of every pair whose recordings are found."""
    for pair in pairs():
        files = pair_files(pair.a, pair.b)
        if files is None:
            continue
        files |= {} if pair.case is None else {"case.toml": _case(pair.case)}
        n = len(pair.causes)
        yield Item(files, Entry(
            set=pair.kind, causes=pair.causes, strengths=(1.0,) * n, separation=(99.0,) * n, alike=(pair.alike,) * n,
            variables=((),) * n, plan="pair", rig=f"{pair.a} | {pair.b}",
            rows=files["recording.csv"].count("\n") - 1, reason=pair.reason,
        ))  # fmt: skip


@cache
def _text(path: Path, name: str) -> str:
    columns = _read(path, _recordings()[name])
    if "run" in columns and np.ptp(columns["run"]) == 0.0:
        del columns["run"]
    return recording_text(columns)
