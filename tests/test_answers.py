"""Promise: every answer is used alike: its text, plain values that are strict JSON, and a table where it has one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import bemt
from bemt.base.errors import InputError

ROWS = [(n, 1.39e-7 * n**2, 2.52e-9 * n**2) for n in range(3000, 9001, 500)]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One table with its units in the headings, and one without, of the same rows."""
    folder = tmp_path_factory.mktemp("bench")
    for name, head in (("with", "rpm,thrust_gf,torque_Nm"), ("without", "rpm,thrust,torque")):
        lines = [head, *(f"{n},{T / 9.80665e-3:.6f},{Q:.6f}" for n, T, Q in ROWS)]
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder


def test_units_that_are_stated_are_those_of_the_headings(bench: Path) -> None:
    told = {"thrust": "gf", "torque": "Nm"}
    stated = bemt.diagnose(bench / "without.csv", "10x5", unit=told)
    headed = bemt.diagnose(bench / "with.csv", "10x5")
    assert (stated.verdict, stated.effects) == (headed.verdict, headed.effects)
    assert stated.probability == pytest.approx(headed.probability, abs=1e-6)
    import pandas as pd

    frame = bemt.diagnose(pd.read_csv(bench / "without.csv"), "10x5", unit=told)
    assert (frame.verdict, frame.effects) == (headed.verdict, headed.effects)
    shown = bemt.import_(bench / "without.csv", unit=told)
    assert "thrust_N" in shown.text and "--unit thrust=gf" in shown.text
    with pytest.raises(InputError, match="'thrust'") as error:
        bemt.diagnose(bench / "without.csv", "10x5", unit={"thrst": "gf"})
    assert "thrst" in str(error.value) and error.value.faults[0].where == "unit"


def test_every_answer_has_one_face(bench: Path) -> None:
    impossible = bemt.drive("10x5", kv=900, cells=3, mass_kg=9.0, rotors=4)  # no hover: numbers that are not known
    assert "N and gives" in impossible.no_hover and impossible.to_dict()["hover"]["power_W"]["value"] is None
    found = bemt.sweep("cases/prop_8x5")
    answers = (impossible, found, bemt.estimate("10x5", rpm=6000),
               bemt.choose(8.0, 3, labels=["10x4.5", "8x4"], kv=(700, 1500)),
               bemt.diagnose(bench / "with.csv", "10x5"), bemt.compare(bench / "with.csv", bench / "without.csv",
               unit={"thrust": "gf", "torque": "Nm"}))  # fmt: skip
    for answer in answers:
        assert str(answer).splitlines()[0] and not str(answer).startswith("<")
        json.dumps(answer.to_dict(), allow_nan=False)
    for answer in answers[:5]:
        assert len(answer.to_pandas())
    table = found.to_pandas()
    assert {"case", "source", "thrust_N", "u", "power_W", "flags"} <= set(table.columns)
    assert (table[table.source == "bemt"].u > 0.0).all()
