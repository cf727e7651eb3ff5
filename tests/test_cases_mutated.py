"""The promise of damaged case files: loaded, or refused with faults that say where; never a traceback."""

from __future__ import annotations

import random
import re
import shutil
from collections import Counter
from pathlib import Path

import pytest

from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.rotors.case import load_case

VALUES = [
    "1e308", "-1e308", "1" + "0" * 320, "nan", "inf", "-inf", "0", "-1", "1e-320", "true", '"x"', "[]", "{}", "[[1]]",
    "1979-05-27", "07:32:00", "''", '"../../etc"', "[1, 'a']", "0x10", "1_0", "1.5", '"Ünï"', "{ a = { b = 1 } }",
]  # fmt: skip
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w.\"])")
FACTORS = (0.0, -1.0, 0.1, 0.3, 0.7, 0.9, 0.97, 0.99, 1.01, 1.03, 1.1, 1.4, 3.0, 10.0, 25.4, 1 / 25.4)
INJURIES = ("value", "drop line", "double line", "swap lines", "cut", "byte", "rename", "table", "nest", "long key")


def injure(text: str, what: str, rng: random.Random) -> bytes:
    """One injury of the named kind."""
    lines = text.split("\n")
    k, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    holds = [i for i, line in enumerate(lines) if "=" in line and not line.lstrip().startswith("#")]
    at = rng.choice(holds) if holds else k
    match what:
        case "value":
            lines[at] = lines[at].partition("=")[0] + "= " + rng.choice(VALUES)
        case "drop line":
            del lines[k]
        case "double line":
            lines.insert(k, lines[j])
        case "swap lines":
            lines[k], lines[j] = lines[j], lines[k]
        case "cut":
            return text[: rng.randrange(len(text) + 1)].encode()
        case "byte":
            raw = bytearray(text.encode() or b" ")
            raw[rng.randrange(len(raw))] = rng.randrange(256)
            return bytes(raw)
        case "rename":
            lines[at] = rng.choice(["x", "rotor", "blades", "a.b", '""', "name"]) + " =" + lines[at].partition("=")[2]
        case "table":
            lines.insert(k, rng.choice(["[rotor]", "[[rotor]]", "[x]", "[[assumptions]]", "[blade]", "[duct]"]))
        case "nest":
            depth = rng.choice([3, 60, 2000])
            lines[at] = lines[at].partition("=")[0] + "= " + "[" * depth + "]" * depth
        case "long key":
            lines.insert(k, ".".join(["a"] * rng.choice([3, 60, 100_000])) + " = 1")
    return "\n".join(lines).encode("utf-8", "replace")


def other_numbers(text: str, rng: random.Random) -> bytes:
    """One to three numbers changed by a factor, as a hand or a wrong unit changes them: still a case by its form."""
    for _ in range(rng.randint(1, 3)):
        if places := [
            m for m in NUMBER.finditer(text) if text[: m.start()].rpartition("\n")[2].partition("#")[1] == ""
        ]:
            at = rng.choice(places)
            value = float(at[0]) * rng.choice(FACTORS)
            whole = "." not in at[0] and value.is_integer()
            text = text[: at.start()] + (f"{value:.0f}" if whole else f"{value:.6g}") + text[at.end() :]
    return text.encode()


def try_injured(count: int, seed: int, cases: Path, folder: Path) -> Counter[str]:
    rng = random.Random(seed)
    texts = {file.parent: file.read_text(encoding="utf-8") for file in sorted(cases.glob("*/case.toml"))}
    outcome: Counter[str] = Counter()
    for source in texts:  # what a case names lies beside it
        shutil.copytree(source, folder / source.name)
    for k in range(count):
        source = rng.choice(list(texts))
        kinds = [rng.choice(INJURIES) for _ in range(rng.randint(1, 2))] if k % 2 else ["numbers"]
        raw = texts[source].encode()
        for kind in kinds:
            text = raw.decode("utf-8", "replace")
            raw = other_numbers(text, rng) if kind == "numbers" else injure(text, kind, rng)
        path = folder / source.name / "case.toml"
        path.write_bytes(raw)
        try:
            load_case(path)
            outcome["loaded"] += 1
        except InputError as error:
            assert error.faults and all(f.file and f.got and f.expected for f in error.faults), (k, source.name, kinds)
            outcome["refused"] += 1
        except Exception as error:
            raise AssertionError((k, source.name, kinds)) from error
    return outcome


def test_sixty_injured_cases(project: Path, tmp_path: Path) -> None:
    outcome = try_injured(60, 3, project / "cases", tmp_path)
    assert min(outcome["loaded"], outcome["refused"]) > 2


@pytest.mark.slow
def test_six_thousand_injured_cases(project: Path, tmp_path: Path) -> None:
    outcome = try_injured(6000, 4, project / "cases", tmp_path)
    assert min(outcome["loaded"], outcome["refused"]) > 1000


@pytest.mark.parametrize(
    "line",
    [
        "x = " + "[" * 3000 + "]" * 3000, "x = " + "{a=" * 3000 + "1" + "}" * 3000,
        ".".join(["a"] * 100_000) + " = 1", "[" + ".".join(["a"] * 100_000) + "]", "x = 1" + "0" * 400,
        "x = 1" + "0" * 5000,
    ],
    ids=["arrays", "tables", "key", "table name", "integer", "longer integer"],
)  # fmt: skip
def test_what_no_case_can_hold_is_refused_in_one_line(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str
) -> None:
    text = (project / "cases" / "prop_8x5" / "case.toml").read_text(encoding="utf-8")
    (tmp_path / "case.toml").write_text(f"{text}\n{line}\n", encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_case(tmp_path)
    assert len(error.value.faults) == 1
    assert main(["sweep", str(tmp_path), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
