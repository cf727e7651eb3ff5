"""The promise of the documents: commands that run as printed, docstrings that agree with the code and name units."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import os
import pkgutil
import re
import struct
import tomllib
from collections.abc import Callable, Iterator
from fnmatch import fnmatch
from pathlib import Path
from types import ModuleType

import pytest

import bemt

PACKAGES = ("bemt", "geometry")
# Types of numbers that have a dimension: float, array_like, (N,) float, tuple of float; not counts, masks or records.
NUMERIC = re.compile(r"^(tuple of )?(\([^()]*\) )*(float|array_like|ndarray)\b(?! of (int|bool|str))")
UNIT = re.compile(r"\[[^\[\]]+\]|\bunits?\b")  # "[m]", or words such as "in the unit of x"


def public_modules() -> list[str]:
    """Every module whose dotted name holds no private part."""
    names = []
    for package in PACKAGES:
        found = pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}.")
        names += [package, *(info.name for info in found)]
    return sorted(name for name in names if not any(part.startswith("_") for part in name.split(".")))


def public_objects(module: ModuleType) -> Iterator[tuple[str, object]]:
    """Functions and classes that a module defines and offers, and the methods of the classes."""
    for name in getattr(module, "__all__", [n for n in vars(module) if not n.startswith("_")]):
        item = getattr(module, name)
        if not (inspect.isfunction(item) or inspect.isclass(item)) or item.__module__ != module.__name__:
            continue
        yield f"{module.__name__}.{name}", item
        if inspect.isclass(item):
            for key, member in vars(item).items():
                inner = getattr(member, "fget", None) or getattr(member, "func", None) or getattr(member, "__func__", member)
                if not key.startswith("_") and inspect.isfunction(inner) and inner.__qualname__.startswith(name + "."):
                    yield f"{module.__name__}.{name}.{key}", inner


def sections(doc: str) -> dict[str, str]:
    """Sections of a numpydoc text by heading; the text before the first is ``""``."""
    parts = re.split(r"^(\w[\w ]*)\n-{3,}$", inspect.cleandoc(doc), flags=re.MULTILINE)
    return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


def entries(text: str) -> Iterator[tuple[list[str], str, str]]:
    """Names, type and description of each entry of a Parameters-like section."""
    for head, body in re.findall(r"^(\S[^\n]*)\n?((?:[ \t]+[^\n]*\n?|\n)*)", text.strip("\n") + "\n", flags=re.MULTILINE):
        names, _, kind = head.partition(" : ")
        yield [n.strip().lstrip("*") for n in names.split(",")], kind, body


def documented_names(item: object, doc: dict[str, str]) -> list[str]:
    wanted = "Parameters" if "Parameters" in doc or not inspect.isclass(item) else "Attributes"
    return [name for names, _, _ in entries(doc.get(wanted, "")) for name in names]


def signature_names(item: object) -> list[str]:
    """What a caller passes: parameters of a function, fields of a dataclass, arguments of another class."""
    if inspect.isclass(item):
        if dataclasses.is_dataclass(item):
            return [f.name for f in dataclasses.fields(item) if not f.name.startswith("_")]
        if item.__init__ is object.__init__ or issubclass(item, (tuple, BaseException)) and "__init__" not in vars(item):
            return []
    assert callable(item)
    names = inspect.signature(item).parameters
    return [name for name in names if name not in ("self", "cls")]


def docstring_faults(name: str, item: object) -> list[str]:
    """What is wrong with one docstring."""
    text = vars(item).get("__doc__") if inspect.isclass(item) else getattr(item, "__doc__", None)
    if not text or text.startswith(f"{getattr(item, '__name__', '')}("):  # the latter is made by dataclass
        return [f"{name}: no docstring"]
    doc = sections(text)
    faults = []
    first = doc[""].strip().splitlines()[0]
    if len(first) > 120 or not first.endswith((".", "!", "?", ":")):
        # a long first sentence may run on, but it must end
        if not re.search(r"[.!?:](\s|$)", doc[""]):
            faults.append(f"{name}: the summary is no sentence")
    said, given = documented_names(item, doc), signature_names(item)
    method = name.count(".") > item.__module__.count(".") + 1  # type: ignore[attr-defined]
    optional = inspect.isclass(item) or (method and len(given) <= 1 and not said)
    # fields may be grouped by unit, arguments keep their order
    agree = sorted(said) == sorted(given) if inspect.isclass(item) else said == given
    if not agree and not (optional and not said):
        faults.append(f"{name}: documents {said}, takes {given}")
    for heading in ("Parameters", "Returns", "Attributes", "Yields"):
        for names, kind, body in entries(doc.get(heading, "")):
            what = kind or ", ".join(names)  # Returns may give the type alone
            if NUMERIC.search(what) and not UNIT.search(kind + body):
                faults.append(f"{name}: {heading}: {', '.join(names)} is a number without a unit in brackets")
    return faults


@pytest.mark.parametrize("module", public_modules())
def test_docstrings_agree_with_the_code_and_name_units(module: str) -> None:
    loaded = importlib.import_module(module)
    assert loaded.__doc__, "a module says what it is for"
    faults = [fault for name, item in public_objects(loaded) for fault in docstring_faults(name, item)]
    assert not faults, "\n".join(faults)
