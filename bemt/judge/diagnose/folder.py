"""Folder of an answer: diagnosis.json, its text, figures and the improved cases; nobody loses files of their own."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomlkit

from bemt.base.errors import Fault, InputError
from bemt.base.tables import json_text, write_atomic
from bemt.judge.diagnose import figures as pictures
from bemt.judge.diagnose.answer import Diagnosis
from bemt.judge.diagnose.document import text
from bemt.judge.diagnose.signatures import effect_of
from bemt.physics import effects
from bemt.physics.bem import model as bem
from bemt.rotors.case import Case, repeated_names


def write(
    folder: str, answer: Any, document: Mapping[str, object], cases: Sequence[Case], figures: bool = True,
    texts: Sequence[str] = (),
) -> None:  # fmt: skip
    """Write everything; improved cases of an earlier answer go. `texts` are those of cases that have no file."""
    out = Path(folder)
    improved = _improved(out, answer, cases, texts)
    out.mkdir(parents=True, exist_ok=True)
    _forget(out, cases)
    write_atomic(out / "diagnosis.json", json_text(document))
    write_atomic(out / "diagnosis.txt", text(answer) + "\n")
    for file, content in improved.items():
        write_atomic(file, content)
    if figures:
        pictures.draw(answer, out, cases)


def _targets(out: Path, cases: Sequence[Case]) -> dict[Path, Case]:
    """Folder of the improved case of each case: that of the answer, or one by name in it where there are several."""
    own = list({c.path.resolve(): c for c in cases}.values())
    if len(own) == 1:
        return {out: own[0]}
    repeated = repeated_names(dict(enumerate(own)))
    if repeated:
        raise InputError(list(repeated.values()))
    return {out / c.name: c for c in own}


def _written(file: Path) -> bool:
    """Whether a case file was written here, not by hand."""
    first = file.read_text(encoding="utf-8", errors="replace").partition("\n")[0] if file.is_file() else ""
    return first.startswith("#") and _HEAD in first


def check(folder: str | None, cases: Sequence[Case]) -> None:
    """Let nobody lose files of their own: an improved case goes where only its like has been."""
    if not folder:
        return
    out = Path(folder)
    given, lost = {c.path.resolve() for c in cases}, []
    for home, case in _targets(out, cases).items():
        target = home / "case.toml"
        mine = _written(target)
        if target.is_file() and (not mine or target.resolve() in given):
            lost.append(target)
        for file in () if mine else beside(case):
            copy = home / file.relative_to(case.folder)
            if copy.is_file() and copy.read_bytes() != file.read_bytes():
                lost.append(copy)
    if lost:
        raise InputError([Fault("--out", "", f"a folder with an existing file, {p.as_posix()}", "a folder without one",
                                "The improved case would replace it") for p in lost])  # fmt: skip


def _forget(out: Path, cases: Sequence[Case]) -> None:
    """Take away the improved cases of the answer that stands in a folder: the next one may have none, or others."""
    try:
        earlier = [str(name) for name in json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))["cases"]]
    except (OSError, ValueError, KeyError, TypeError):
        earlier = []
    given = {c.path.resolve() for c in cases}
    for folder in {out, *(out / name for name in earlier if Path(name).name == name != "..")}:
        file = folder / "case.toml"
        if _written(file) and file.resolve() not in given:
            file.unlink()


def _improved(out: Path, answer: Any, cases: Sequence[Case], texts: Sequence[str]) -> dict[Path, bytes | str]:
    """The cases with what was found on, cases that `sweep` runs, as files and their content; case.toml last."""
    told = {c.path.resolve(): text for c, text in zip(cases, texts, strict=False)}
    files: dict[Path, bytes | str] = {}
    for folder, case in _targets(out, cases).items():
        source = case.path.read_text(encoding="utf-8-sig") if case.path.is_file() else told[case.path.resolve()]
        document = improved_case(answer, case, source)
        if document:  # stations, sections and recorded values lie beside the case, as before
            files |= {folder / file.relative_to(case.folder): file.read_bytes() for file in beside(case)}
            files[folder / "case.toml"] = document
    return files


# The case with what was found switched on: a case that ``sweep`` runs.
_HEAD = "with what `bemt diagnose` found: "


def improved_case(answer: Diagnosis, case: Case, source: str) -> str:
    """Text of a case file with the effects of the verdict on."""
    named = answer.decision.verdict in ("named", "class")
    found = [effect_of(i, s) for i, s in zip(answer.best.ids, answer.best.settings, strict=True)]
    found = [e for e in found if bem.acts_on_rotor(e) or (e.kind == "air" and not e.needs)]
    if not named or not found:
        return ""
    ids = {e.id for e in found}
    on = [t for t in case.file.model.effects_on if t.partition("(")[0] not in ids] + [effects.to_text(e) for e in found]
    off = [i for i in case.file.model.effects_off if i not in ids]
    if "duct" in case.file.model.effects_off and "duct" in ids and case.ducted:
        on = [t for t in on if t.partition("(")[0] != "duct"]  # the case's own duct is there again
    text = tomlkit.parse(source.lstrip("\ufeff"))
    if "model" not in text:
        text["model"] = tomlkit.table()
    model: Any = text["model"]
    model["effects_on"], model["effects_off"] = on, off
    text["name"] = name_after(case.name, "improved")
    elsewhere(text, case)
    head = f"# {case.name} {_HEAD}{', '.join(effects.to_text(e) for e in found)}"
    return f"{head}\n{tomlkit.dumps(text).rstrip()}\n"


def name_after(name: str, mark: str) -> str:
    """Name of a case that was made of another: its own, or a sweep of both could not tell them apart.

    >>> [name_after(n, "improved") for n in ("prop_10x5", "prop_10x5_improved", "prop_10x5_improved_2")]
    ['prop_10x5_improved', 'prop_10x5_improved_2', 'prop_10x5_improved_3']
    """
    match = re.fullmatch(rf"(.*_{mark})(?:_([1-9]\d*))?", name)
    return f"{match[1]}_{int(match[2] or 1) + 1}" if match else f"{name}_{mark}"


def beside(case: Case) -> list[Path]:
    """Files of a case that lie in its folder, and so go with it."""
    folder = case.folder.resolve()
    return [f for f in case.files() if f != case.path and f.resolve().is_relative_to(folder)]


def elsewhere(node: Any, case: Case) -> None:
    """Name files that lie elsewhere by their whole path: the improved case stands in another folder."""
    far = {f.resolve() for f in case.files()} - {case.path.resolve(), *(f.resolve() for f in beside(case))}
    keys = range(len(node)) if isinstance(node, list) else list(node)
    for key in keys:
        value = node[key]
        if isinstance(value, str):
            if (case.folder / value).resolve() in far:
                node[key] = (case.folder / value).resolve().as_posix()
        elif isinstance(value, (dict, list)):
            elsewhere(value, case)
