"""Published recordings with a known effect hidden from the model, or with none: the proof's real part.

``real.toml`` registers what is concealed and where it is known from, ``pairs.toml`` pairs that differ by one documented
thing. The recordings are found in the data folders and are no part of the project. A pair becomes two tables of steady
points, ``reference.csv`` (A) and ``recording.csv`` (B), which the answering process compares without a case, or with a
case made of the label.
"""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.given import data_roots, find_data
from bemt.data.readers import uiuc
from bemt.data.readers.uiuc_names import class_of
from bemt.data.recordings.load import import_file
from bemt.data.recordings.reduce import reduce
from bemt.judge.compare.matched import stand_run
from bemt.judge.compare.selection import selected
from bemt.judge.proof.items import Cell, Item, case_text, recording_text, stations_text
from bemt.judge.proof.rows import Entry
from bemt.physics.sections import rule as section_rule
from bemt.rotors.case.unknowns import section_of

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


@dataclass(frozen=True)
class _Recorded:
    """Recordings of the manifest that are read alike."""

    file: str
    names: Sequence[str]
    called: str = "{}"
    where: Sequence[Mapping[str, str]] = ({},)  # Cells of the rows of each; the last holds for those that follow
    rows: Sequence[str] = ()
    # A plain table: channel to heading, and factor in it, or to number of the column; of a loop one half
    table: Mapping[str, str] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)
    numbered: Mapping[str, int] = field(default_factory=dict)
    half: str = ""
    constant: Mapping[str, float] = field(default_factory=dict)
    mass_kg: float | None = None


@dataclass(frozen=True)
class _Changed:
    """Pairs of the manifest that differ by the same thing."""

    set: str
    ab: Sequence[tuple[str, str]]
    causes: Sequence[str]
    reason: str
    alike: Sequence[str] = ()


@dataclass(frozen=True)
class _Labelled:
    """Sets that are asked again with a case of a label."""

    sets: Sequence[str]
    only: str
    case: Mapping[str, Any]


@cache
def _manifest(table: str) -> Sequence[Mapping[str, Any]]:
    found: Sequence[Mapping[str, Any]] = tomllib.loads(
        Path(__file__).with_name("pairs.toml").read_text(encoding="utf-8")
    )[table]
    return found


@cache
def _recordings() -> Mapping[str, _Recorded]:
    """Name of a recording to how it is read."""
    groups = [_Recorded(**group) for group in _manifest("recordings")]
    return {
        g.called.format(name): replace(g, file=g.file.format(name), where=(g.where[min(k, len(g.where) - 1)],))
        for g in groups
        for k, name in enumerate(g.names)
    }


@cache
def pairs() -> tuple[PairOf, ...]:
    """All pairs of the manifest, those with a label twice."""
    out = []
    labelled = [_Labelled(**told) for told in _manifest("labelled")]
    for group in (_Changed(**pair) for pair in _manifest("pair")):
        for a, b in group.ab:
            out.append(PairOf(group.set, a, b, tuple(group.causes), tuple(group.alike), group.reason))
            out += [replace(out[-1], kind=f"{group.set}, case", case=told.case)
                    for told in labelled if group.set in told.sets and told.only in a]  # fmt: skip
    return tuple(out)


def pair_files(a: str, b: str) -> dict[str, str] | None:
    """Files of an item that compares two recordings; None where one of them is not found."""
    places = ((name, root / _recordings()[name].file) for name in (a, b) for root in reversed(data_roots()))
    found = {name: path for name, path in places if path.is_file()}
    if len(found) < len({a, b}):
        return None
    return {"reference.csv": _text(found[a], a), "recording.csv": _text(found[b], b),
            "compare": "A reference, B recording\n"}  # fmt: skip


def _plain(path: Path, how: _Recorded) -> dict[str, Array]:
    """Columns of a plain table, by heading or by number."""
    if how.numbered:
        rows = np.loadtxt(path)
        columns = {name: rows[:, k - 1] for name, k in how.numbered.items()}
    else:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            read = [row for row in csv.DictReader(stream) if all(row[k] == v for k, v in how.where[0].items())]
        columns = {
            name: np.array([float(row[head]) for row in read]) / how.scale.get(name, 1.0)
            for name, head in how.table.items()
        }
    if how.half:
        command = next(iter(columns.values()))
        top = next(iter(np.flatnonzero(np.diff(command) < 0.0) + 1), command.size)
        part = slice(0, top) if how.half == "up" else slice(top, None)
        columns = {k: v[part] for k, v in columns.items()}
    if "rpm" in columns:
        good = columns["rpm"] > 0.0
        columns = {k: v[good] for k, v in columns.items()}
    return columns


def _flight(path: Path, mass_kg: float) -> dict[str, Array]:
    """Thrust per propeller of a flight: mass times acceleration along the rotors, averaged over a tenth of a second."""
    v = import_file(path)
    flying = (v.rpm > 0.5 * np.median(v.rpm)) & (v.height_m > 0.3)
    block = np.floor(v.time_s[flying] * 10.0).astype(int)
    _, block = np.unique(block, return_inverse=True)
    count = np.bincount(block)

    def mean(x: Array) -> Array:
        return np.asarray(np.bincount(block, x[flying]) / count)

    thrust = mass_kg * mean(v.acceleration_z_m_s2) / _PROPELLERS
    return {"rpm": np.sqrt(mean(v.rpm**2)), "thrust_N": thrust, "voltage_V": mean(v.voltage_V)}


def _read(path: Path, how: _Recorded) -> dict[str, Array]:
    """Steady points of one recording, in SI."""
    if how.mass_kg is not None:
        columns = _flight(path, how.mass_kg)
    elif how.table or how.numbered:
        columns = _plain(path, how)
    else:
        run = stand_run(selected(import_file(path), how.rows, path.name), path.name)
        columns = {k: run.points[k] for k in _KEPT if k in run.points}
        if run.command:
            columns["pulse_width_s" if run.command == "pwm_s" else run.command] = run.points.command
    n = next(iter(columns.values())).size
    columns |= {k: np.full(n, float(v)) for k, v in how.constant.items()}
    loads = [np.isfinite(columns[k]) for k in ("thrust_N", "torque_Nm") if k in columns]
    good = np.any(loads, axis=0) & np.isfinite(columns.get("rpm", np.ones(n)))
    return {k: v[good] for k, v in columns.items() if np.isfinite(v[good]).any()}


def _case_of_label(label: Mapping[str, Any], name: str = "label") -> str:
    """Case of a label: an APC-like blade where nothing more is known."""
    fan = "chord_law" in label
    rotor: dict[str, Cell] = {"kind": "propeller", "blades": label["blades"], "hub_ratio": label.get("hub_ratio", 0.1)}
    rotor |= {k: label[k] for k in ("diameter_in", "diameter_mm") if k in label}
    blade: dict[str, Cell] = {k: label[k] for k in ("pitch_in", "pitch_mm") if k in label}
    blade |= {"chord_law": label.get("chord_law", "apc_like")} | ({"max_chord_over_R": 0.35} if fan else {})
    section: dict[str, Cell] = {"camber": 0.05, "thickness": 0.09} if fan else {"camber": 0.04, "thickness": 0.10}

    operating = {"rpm": label["rpm"], "airspeed_m_s": 0.0}
    return case_text(name, {"rotor": rotor, "blade": blade, "blade.section": section, "operating": operating,
                               "air": {"density_kg_m3": 1.2}}, "g")  # fmt: skip


def draw_pairs() -> Iterator[Item]:
    """Make an item of every pair whose recordings are found."""
    for pair in pairs():
        files = pair_files(pair.a, pair.b)
        if files is None:
            continue
        files |= {} if pair.case is None else {"case.toml": _case_of_label(pair.case)}
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


CLEAR, ABSENT = 0.10, 0.02
"""Change of CT or CP over the speeds that counts as clear, and below which there is none. [1]"""
EVERY = 3
PITCH_DEG, DENSITY, WRONG_DENSITY = -3.0, 1.225, 1.00
POUND = 4.4482216152605
MIN_POINTS = 8
MAX_POINTS = 90


@dataclass(frozen=True)
class Concealed:
    """One registered set: what is hidden, how, and where that is known from."""

    set: str
    causes: Sequence[str]
    how: str
    source: str
    alike: Sequence[str] = ()


@cache
def manifest() -> Mapping[str, Concealed]:
    """Registered sets."""
    text = Path(__file__).with_name("real.toml").read_text(encoding="utf-8")
    return {entry.set: entry for entry in (Concealed(**one) for one in tomllib.loads(text)["concealed"])}


SETS = ("real reynolds", "real pitch", "real density", "real slip", "real duct", "real mach", "real null",
        "real shuffled")  # fmt: skip
"""Names in the manifest."""


def _item(
    kind: str, rig: str, columns: Mapping[str, Array], case: str, stations: str, variables: list[str],
    reference: Mapping[str, Array] | None = None,
) -> Item:  # fmt: skip
    causes, alike = tuple(manifest()[kind].causes), tuple(manifest()[kind].alike)
    n, rows = len(causes), int(next(iter(columns.values())).size)
    # what a table shows to the eye; there is no yardstick for a truth that nobody knows
    entry = Entry(set=kind, causes=causes, strengths=(1.0,) * n, separation=(99.0,) * n, alike=(alike,) * n,
                  variables=(tuple(variables),) * n, plan="real", rig=rig, rows=rows)  # fmt: skip
    files = {"recording.csv": recording_text(columns), "case.toml": case, "stations.csv": stations}
    return Item(files | ({} if reference is None else {"reference.csv": recording_text(reference)}), entry)


def _case(name: str, rotor: Mapping[str, Cell], section: Mapping[str, Cell], rpm: float, air: Mapping[str, Cell],
          off: Collection[str] = ()) -> str:  # fmt: skip
    return case_text(name, {
        "rotor": rotor, "blade": {"stations": "stations.csv"}, "blade.section": section,
        "operating": {"rpm": rpm, "airspeed_m_s": 0.0}, "air": air, "model": {"stations": 30, "effects_off": [*off]},
    })  # fmt: skip


def change_over_speed(rpm: Array, coefficient: Array) -> float:
    """Change of a coefficient over the speeds of rotation, noise smoothed away. [1]

    Examples
    --------
    >>> import numpy as np
    >>> n = np.geomspace(2000.0, 8000.0, 9)
    >>> round(change_over_speed(n, 0.1 * (1.0 + 0.2 * np.log(n / 2000.0) / np.log(4.0))), 3)
    0.182
    """
    x = np.log(rpm / rpm.mean())
    smooth = np.polyval(np.polyfit(x, coefficient, 2), x)
    return float(np.ptp(smooth) / abs(smooth.mean()))


def _uiuc_case(
    p: uiuc.UiucPropeller, rpm: float, air: Mapping[str, Cell], off: Collection[str] = (), turned: float = 0.0
) -> tuple[str, str]:
    g = p.geometry
    assert g is not None
    s = section_rule.section_at(0.75, p.family)
    rotor: dict[str, Cell] = {"kind": "propeller", "blades": p.blades, "diameter_in": p.diameter_in, "hub_ratio": 0.1}
    camber = section_of(class_of(p.family))[0].value if s.shape == "naca4" else s.camber
    section: dict[str, Cell] = {"camber": camber, "camber_position": s.position, "thickness": s.thickness}
    keep = (g.r_R <= 1.0) & (g.r_R > 0.1)
    name = p.name.replace(".", "p")
    return (_case(name, rotor, section, rpm, air, off),
            stations_text(g.r_R[keep], np.maximum(g.c_R[keep], 0.005), g.beta_deg[keep] + turned))  # fmt: skip


def _dimensional(p: uiuc.UiucPropeller) -> dict[str, Array]:
    """All points of a propeller as a stand at `DENSITY` would have read them."""
    still = p.static
    parts = [] if still is None else [(still.rpm, np.zeros(still.rpm.size), still.CT, still.CP)]
    parts += [(np.full(line.J.size, line.rpm), line.J, line.CT, line.CP) for line in p.lines]
    rpm, J, CT, CP = (np.concatenate([part[k] for part in parts]) for k in range(4))
    run = np.concatenate([np.full(part[0].size, float(k)) for k, part in enumerate(parts)])
    good = np.isfinite(CT + CP) & (CT > 0.0)
    # long tables are thinned evenly
    keep = np.flatnonzero(good)
    keep = keep[np.unique(np.linspace(0, keep.size - 1, min(MAX_POINTS, keep.size)).round().astype(int))]
    rpm, J, CT, CP, run = (v[keep] for v in (rpm, J, CT, CP, run))
    n, D = rpm / 60.0, p.diameter_m
    return {"run": run, "rpm": rpm, "airspeed_m_s": J * n * D, "thrust_N": CT * DENSITY * n**2 * D**4,
            "torque_Nm": CP * DENSITY * n**2 * D**5 / (2.0 * np.pi)}  # fmt: skip


def _uiuc(rng: np.random.Generator) -> Iterator[Item]:
    root = find_data("uiuc")
    folders = [] if root is None else [f for f in (root / "volume-1", root / "volume-2") if f.is_dir()] or [root]
    propellers = [p for f in folders for p in uiuc.scan_folder(f).propellers if p.geometry is not None]
    known = {"density_kg_m3": DENSITY}
    k = 0
    for p in sorted(propellers, key=lambda p: (p.folder, p.name)):
        still = p.static
        if still is not None and still.rpm.size >= MIN_POINTS:
            order = np.argsort(still.rpm, kind="stable")
            rpm, CT, CP = still.rpm[order], still.CT[order], still.CP[order]
            most = max(change_over_speed(rpm, CT), change_over_speed(rpm, CP))
            text, blade = _uiuc_case(p, float(np.median(rpm)), known, ("reynolds",))
            columns = {"rpm": rpm, "CT": CT, "CP": CP}
            if most > CLEAR:
                yield _item("real reynolds", p.name, columns, text, blade, ["rpm", "Re"])
                deal = rng.permutation(rpm.size)
                yield _item("real shuffled", p.name, {"rpm": rpm, "CT": CT[deal], "CP": CP[deal]}, text, blade, [])
            elif most < ABSENT:
                yield _item("real null", p.name, columns, text, blade, [])
        if still is None or not p.lines:
            continue
        k += 1
        points = _dimensional(p)
        middle = float(np.median(points["rpm"]))
        if k % EVERY == 0:
            text, blade = _uiuc_case(p, middle, known, turned=PITCH_DEG)
            yield _item("real pitch", p.name, points, text, blade, [])
        elif k % EVERY == 1:
            text, blade = _uiuc_case(p, middle, {"density_kg_m3": WRONG_DENSITY})
            yield _item("real density", p.name, points, text, blade, [])
        else:
            text, blade = _uiuc_case(p, middle, known)
            slipped = {**points, "thrust_N": points["thrust_N"] / POUND}
            yield _item("real slip", p.name, slipped, text, blade, [])


def _x22a() -> Iterator[Item]:
    root = find_data("x22a")
    if root is None:
        return
    R = 1.0668
    shape = np.genfromtxt(root / "x22a_geometry.csv", delimiter=",", skip_header=1)
    rows = np.genfromtxt(root / "x22a_measured_CT_CP_vs_J.csv", delimiter=",", skip_header=1, usecols=range(4))
    rotor: dict[str, Cell] = {"kind": "propeller", "blades": 3, "diameter_m": 2 * R, "hub_ratio": 0.2}
    for angle in (19, 29):
        q = rows[rows[:, 0] == angle]
        columns = {"rpm": np.full(len(q), 1200.0), "J": q[:, 1], "CT": q[:, 2], "CP": q[:, 3]}
        text = _case(f"x22a_{angle}", rotor, {"camber": 0.02, "thickness": 0.08}, 1200.0, {"density_kg_m3": 1.225},
                     ("duct",))  # fmt: skip
        keep = shape[:, 0] <= 1.0
        blade = stations_text(shape[keep, 0], shape[keep, 3] / R, shape[keep, 2] + angle - 20.0)
        yield _item("real duct", f"x22a_{angle}", columns, text, blade, ["J", "airspeed_m_s"])


def _caradonna_tung() -> Iterator[Item]:
    root = find_data("caradonna_tung")
    if root is None:
        return
    rows = np.genfromtxt(root / "caradonna_tung_CT_vs_tipMach.csv", delimiter=",", skip_header=1, usecols=range(4))
    r_R = np.linspace(0.18, 1.0, 10)
    rotor: dict[str, Cell] = {"kind": "propeller", "blades": 2, "diameter_m": 2.286, "hub_ratio": 0.17}
    for angle in np.unique(rows[:, 0]):
        q = rows[rows[:, 0] == angle]
        # thrust alone was measured: CT_rotor = T/(rho A (Omega R)^2)
        columns = {"rpm": q[:, 1], "airspeed_m_s": np.zeros(len(q)),
                   "thrust_N": q[:, 3] * 1.225 * np.pi * 1.143**2 * (q[:, 1] * np.pi / 30.0 * 1.143) ** 2}  # fmt: skip
        text = _case(f"caradonna_tung_{angle:g}", rotor, {"camber": 0.0, "thickness": 0.12}, float(q[0, 1]),
                     {"density_kg_m3": 1.225}, ("compressibility", "drag_divergence"))  # fmt: skip
        blade = stations_text(r_R, np.full(r_R.size, 0.1905 / 1.143), np.full(r_R.size, float(angle)))
        yield _item("real mach", f"caradonna_tung_{angle:g}", columns, text, blade, ["M_tip", "rpm"])


def _tmotor() -> Iterator[Item]:
    root = find_data("tmotor28_tr594")
    if root is None:
        return
    rows = np.genfromtxt(root / "tmotor28_data.csv", delimiter=";", skip_header=1)[:, :6]
    given = {}
    for line in (root / "tmotor28.ini").read_text(encoding="utf-8").splitlines():
        name, _, values = line.partition("=")
        if name.strip() in ("radius", "chord", "pitch"):
            given[name.strip()] = np.array([float(v) for v in values.split()])
    R = 0.3556
    blade = stations_text(given["radius"] / R, given["chord"] / R, given["pitch"])
    rotor: dict[str, Cell] = {"kind": "propeller", "blades": 2, "diameter_m": 2 * R, "hub_ratio": 0.0844}
    section: dict[str, Cell] = {"camber": 0.04, "camber_position": 0.4, "thickness": 0.10}
    columns = {"rpm": rows[:, 0], "airspeed_m_s": np.zeros(len(rows)), "thrust_N": rows[:, 3], "torque_Nm": rows[:, 4]}
    for kind, density in (("real null", DENSITY), ("real density", WRONG_DENSITY)):
        text = _case("tmotor_28", rotor, section, 2200.0, {"density_kg_m3": density})
        yield _item(kind, "tmotor_28", columns, text, blade, [])


_FAN = {"blades": 8, "diameter_mm": 76, "hub_ratio": 0.25, "pitch_mm": 70, "chord_law": "fan", "rpm": 20000}


def _fan() -> Iterator[Item]:
    root = find_data("jmajew")
    found = {}
    for name, pattern in (("ducted", "grp01__f1507_hqprop76x8_4s_duct_table*.csv"),
                          ("open", "grp01__f1507_hqprop76x8_4s_table*.csv")):  # fmt: skip
        parts = [reduce(import_file(str(f)), diameter_m=0.076).values
                 for f in sorted(root.glob(pattern))] if root else []  # fmt: skip
        if not parts:
            return
        keys = ("rpm", "thrust_N", "torque_Nm")
        run = np.concatenate([np.full(part["rpm"].size, float(k)) for k, part in enumerate(parts)])
        found[name] = {"run": run, **{k: np.concatenate([part[k] for part in parts]) for k in keys}}
    yield _item("real duct", "fan_76", found["ducted"], _case_of_label(_FAN, "fan_76"), "", ["rpm"], found["open"])


def draw_real(rng: np.random.Generator) -> list[Item]:
    """Make all real items, in mixed order."""
    items = [*_uiuc(rng), *_x22a(), *_fan(), *_caradonna_tung(), *_tmotor(), *draw_pairs()]
    if not items:
        roots = ", ".join(r.as_posix() for r in data_roots())
        hint = "`bemt lab fetch uiuc` fetches the largest; BEMT_DATA names a folder of them"
        raise InputError(Fault(roots, "", "no published recordings", "uiuc, x22a, jmajew ...", hint))
    return [items[int(i)] for i in rng.permutation(len(items))]
