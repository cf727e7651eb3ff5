"""Rotor descriptions of pyBEMT: ``.ini`` files with ``[rotor]``, ``[case]`` and ``[fluid]``.

Lengths are in metres and angles in degrees, rpm in rev/min, v_inf in m/s, rho in kg/m3, as pyBEMT's own documentation
has them; the file itself states no units. A second rotor (``[rotor2]``) of a coaxial pair follows the first, told apart
by the channel ``rotor``. Names of sections are kept as text.
"""

from __future__ import annotations

import configparser
import os
from collections.abc import Mapping

import numpy as np

from bemt.base import units
from bemt.data.readers import SourceText, head_text, load_text, number
from bemt.data.readers.columns import Channel, dataset
from bemt.physics.dataset import Dataset

KIND = "pybemt_ini"
_LISTS = ("radius", "chord", "pitch")
_SCALARS: dict[str, dict[str, tuple[str, float, float]]] = {  # section -> key -> (constant, low, high)
    "case": {"rpm": ("rpm", 0.0, 3e5), "rpm2": ("rotor2_rpm", 0.0, 3e5), "v_inf": ("airspeed_m_s", -100.0, 400.0),
             "dz": ("rotor_distance_m", 0.0, 10.0)},
    "rotor": {"nblades": ("blades", 1.0, 64.0), "diameter": ("diameter_m", 0.005, 100.0),
              "radius_hub": ("hub_radius_m", 0.0, 50.0)},
    "fluid": {"rho": ("density_kg_m3", 0.05, 2000.0), "mu": ("viscosity_Pa_s", 1e-7, 1.0)},
}  # fmt: skip


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a text is an ini file with a rotor of this format. [rotor]

    >>> sniff("[rotor]\nnblades = 2\nradius = 0.1 0.2\n"), sniff("[rotor]\nblades = 2\n")
    (True, False)
    """
    lines = [line.strip() for line in head_text(head).splitlines()]
    keys = {line.split("=")[0].strip() for line in lines if "=" in line}
    return "[rotor]" in lines and {"nblades", "radius"} <= keys


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read one description."""
    source = load_text(path)
    parser = configparser.ConfigParser(interpolation=None, strict=True, inline_comment_prefixes=("#", ";"))
    try:
        parser.read_string(source.text)
    except configparser.Error as error:
        source.refuse("", " ".join(str(error).split())[:160], "an ini file with sections and key = value")
    tables = {name: dict(parser.items(name)) for name in parser.sections()}
    constants: dict[str, float] = {}
    warnings = ["the file states no units; those of pyBEMT are taken: m, degrees, rev/min, m/s, kg/m3"]
    rotors = [name for name in ("rotor", "rotor2") if name in tables]
    if "rotor" not in tables:
        source.add("rotor", "nothing", "a section [rotor]")
    parts = []
    for k, name in enumerate(rotors, 1):
        _scalars(source, name, tables[name], f"rotor{k}_" if k > 1 else "", constants)
        part = _stations(source, name, tables[name])
        if part is not None:
            parts.append((k, *part))
    for part_name in ("case", "fluid"):
        _scalars(source, part_name, tables.get(part_name, {}), "", constants)
    for title, table in tables.items():
        used = {*_SCALARS.get(title.rstrip("2"), {}), "section", "coaxial"}
        used |= set(_LISTS) if title.startswith("rotor") else set()
        warnings += [f"[{title}] {key} is not used" for key in table if key not in used]
    source.check()
    index, columns, names = zip(*parts, strict=True)
    values = {key: np.concatenate([c[key] for c in columns]) for key in _LISTS}
    rotor = np.concatenate([np.full(len(c["radius"]), float(k)) for k, c in zip(index, columns, strict=True)])
    channels = {
        "r_m": Channel(values["radius"], "m"),
        "chord_m": Channel(values["chord"], "m"),
        "beta_rad": Channel(values["pitch"] * units.DEG, "rad"),
    }
    if len(parts) > 1:
        channels["rotor"] = Channel(rotor, "-")
    said_of = {**source.about, "coaxial": tables.get("case", {}).get("coaxial", "False")}
    texts = {"section": sum(names, ())}
    return dataset(KIND, "geometry", channels, warnings, said_of, texts=texts, constants=constants)


def _scalars(source: SourceText, name: str, table: Mapping[str, str], prefix: str, constants: dict[str, float]) -> None:
    """Numbers of one section, checked against their ranges."""
    for key, (constant, low, high) in _SCALARS[name.rstrip("2")].items():
        if key not in table:
            if name.startswith("rotor") and key != "radius_hub":
                source.add(f"{name}.{key}", "nothing", "a number")
            continue
        value = number(table[key])
        if value is None or not low <= value <= high:
            expected = f"a number from {low:g} to {high:g}"
            hint = "pyBEMT's lengths are in metres" if constant.endswith("_m") else ""
            source.add(f"{name}.{key}", repr(table[key][:40]), expected, hint)
        else:
            constants[prefix + constant] = value


def _stations(
    source: SourceText, name: str, table: Mapping[str, str]
) -> tuple[dict[str, np.ndarray], tuple[str, ...]] | None:
    """Stations of one rotor and its section names, or None with the faults added."""
    before = len(source.faults)
    lists: dict[str, np.ndarray] = {}
    for key in _LISTS:
        words = table.get(key, "").split()
        numbers = [number(word) for word in words]
        bad = [word for word, value in zip(words, numbers, strict=True) if value is None]
        if not words or bad:
            got = f"{bad[0]!r}" if bad else "nothing"
            source.add(f"{name}.{key}", got, "numbers, one per station")
        else:
            lists[key] = np.array(numbers, dtype=float)
    sections = tuple(table.get("section", "").split())
    lengths = {key: len(v) for key, v in lists.items()} | {"section": len(sections)}
    if len(set(lengths.values())) > 1 and len(source.faults) == before:
        source.add(name, ", ".join(f"{n} of {key}" for key, n in lengths.items()), "equal numbers")
    if len(source.faults) > before:
        return None
    r, chord, pitch = (lists[key] for key in _LISTS)
    diameter = number(table.get("diameter", ""))
    if np.any(np.diff(r) <= 0):
        source.add(f"{name}.radius", "radii that do not rise", "radii from hub to tip")
    if diameter is not None and (np.any(r <= 0) or np.any(r > 0.5 * diameter * (1 + 1e-9))):
        got = f"radii from {r.min():g} to {r.max():g} at diameter {diameter:g}"
        source.add(f"{name}.radius", got, "radii above 0 and up to half the diameter", "Other units?")
    if np.any(chord <= 0) or (diameter is not None and np.any(chord > diameter)):
        source.add(f"{name}.chord", f"chords {chord.min():g} to {chord.max():g}", "chords in metres")
    if np.any(np.abs(pitch) > 90.0):
        source.add(f"{name}.pitch", f"{np.abs(pitch).max():g}", "blade angles within 90 degrees")
    elif np.all(np.abs(pitch) < 1.6) and np.any(pitch != 0):
        got, hint = f"angles up to {np.abs(pitch).max():g}", "Radians? They are not converted"
        source.add(f"{name}.pitch", got, "blade angles in degrees", hint)
    return None if len(source.faults) > before else (lists, sections)
