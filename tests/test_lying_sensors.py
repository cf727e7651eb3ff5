"""A sensor that lies: repeats of one propeller on one stand, of which the second is read wrong in one known way.

Rotor, air, motor and scatter are real, the fault alone is made. The measured data are not part of the project;
everything here skips without them. Slow: minutes.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import pytest

import bemt

pytestmark = pytest.mark.slow

Rows = list[dict[str, str]]
# Every propeller of the stand that a label describes and that was run twice with torque and speed.
PROPELLERS = {
    "dualsky-eco2814c-v2_aeronaut-12x6_3s": "12x6", "dualsky-eco2814c-v2_aeronaut-9x7_4s": "9x7",
    "dualsky-eco2814c-v2_graupner-10x6_4s": "10x6", "dualsky-eco2814c-v2_graupner-12x6_3s": "12x6",
    "mn2206_gemfanbull6045_3s": "6x4.5", "mn2206_hqprop6x3-5_3s": "6x3.5", "mn2206_hqprop6x4x3_3s": "6x4x3",
}  # fmt: skip
CLAIMS = ("named", "sensor", "class")


def times(column: str, factor: float) -> Callable[[Rows], Rows]:
    return lambda rows: [{**r, column: f"{float(r[column]) * factor:.6g}"} for r in rows]


def plus(column: str, share: float) -> Callable[[Rows], Rows]:
    def read(rows: Rows) -> Rows:
        zero = share * max(abs(float(r[column])) for r in rows)
        return [{**r, column: f"{float(r[column]) + zero:.6g}"} for r in rows]

    return read


FAULTS: dict[str, tuple[str, Callable[[Rows], Rows]]] = {
    "none": ("", lambda rows: rows), "6 pole pairs for 7": ("rpm_scale", times("rpm", 7.0 / 6.0)),
    "electrical speed": ("rpm_scale", times("rpm", 2.0)), "thrust cell +10 %": ("thrust_gain", times("th", 1.1)),
    "torque cell -12 %": ("torque_gain", times("tq", 0.88)), "torque in gf mm": ("unit_slip", times("tq", 10.0)),
    "zero of the torque cell": ("torque_zero", plus("tq", 0.05)),
}  # fmt: skip


@pytest.fixture(scope="module")
def answers(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str, str], set[str] | None]:
    """Effects that are claimed, by door, propeller and fault; None: no claim."""
    out: dict[tuple[str, str, str], set[str] | None] = {}
    for name, label in PROPELLERS.items():
        first, second = (shared_data / "jmajew" / f"grp01__{name}_table{k}.csv" for k in (1, 2))
        with second.open() as file:
            rows = list(csv.DictReader(file))
        for fault, (_, read) in FAULTS.items():
            made = tmp_path_factory.mktemp("lie") / "second.csv"
            with made.open("w", newline="") as file:
                table = csv.DictWriter(file, list(rows[0]))
                table.writeheader()
                table.writerows(read(rows))
            with_label = bemt.diagnose(made, case=label, reference=[first])
            for door, answer in {"compare": bemt.compare(first, made), "diagnose": with_label}.items():
                said = answer.to_dict()
                out[door, name, fault] = set(said["effects"]) if said["verdict"] in CLAIMS else None
    return out


@pytest.mark.parametrize("door", ["compare", "diagnose"])
def test_a_repeat_is_no_change(answers: dict[tuple[str, str, str], set[str] | None], door: str) -> None:
    assert [k for k, said in answers.items() if k[0] == door and k[2] == "none" and said] == []


@pytest.mark.parametrize("door", ["compare", "diagnose"])
def test_what_is_claimed_is_the_fault_or_cannot_be_told_from_it(
    answers: dict[tuple[str, str, str], set[str] | None], door: str
) -> None:
    mine = {k: said for k, said in answers.items() if k[0] == door and k[2] != "none"}
    wrong = [(k, said) for k, said in mine.items() if said and FAULTS[k[2]][0] not in said]
    found = sum(bool(said) and FAULTS[k[2]][0] in said for k, said in mine.items())
    assert not wrong
    assert found >= 0.8 * len(mine), {k: said for k, said in mine.items() if not said}


def test_a_count_and_a_unit_are_named_by_their_ratio_though_shapes_of_a_blade_come_near(
    answers: dict[tuple[str, str, str], set[str] | None],
) -> None:
    exact = {
        k: said for k, said in answers.items() if k[0] == "compare" and FAULTS[k[2]][0] in ("rpm_scale", "unit_slip")
    }
    assert sum(said == {FAULTS[k[2]][0]} for k, said in exact.items()) >= 0.8 * len(exact), exact
