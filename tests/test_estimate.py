"""The promise of `estimate`: three numbers in, thrust and power with a band out; where not to trust them is said."""

from __future__ import annotations

import json

import numpy as np
import pytest
from bemt.formula.estimate import estimate

from bemt.base.errors import InputError
from bemt.base.units import INCH
from bemt.commands import cli
from bemt.rotors import k1k2 as empirical


def told(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, object]:
    assert cli.main(["estimate", *words, "--json"]) == 0
    return dict(json.loads(capsys.readouterr().out))


def test_the_document_is_the_formula_with_k1k2_beside_it(capsys: pytest.CaptureFixture[str]) -> None:
    doc = told(capsys, "10x4.7x3", "--rpm", "5000", "7000", "--airspeed", "0", "8", "--chord-mm", "21",
               "--series", "APC Slow Flyer", "--density", "1.1")  # fmt: skip
    assert doc["schema"] == "bemt.estimate/1" and doc["given"]["blades"] == 3  # type: ignore[index]
    rows = doc["rows"]
    assert [(r["rpm"], r["airspeed_m_s"]) for r in rows] == [(5000, 0), (5000, 8), (7000, 0), (7000, 8)]  # type: ignore[attr-defined]
    from bemt.air import Air

    air = Air.from_density(1.1)
    ours = estimate(10 * INCH, 4.7 * INCH, 3, 7000.0, 8.0, air, 0.021, None, "apcsf")
    theirs = empirical.estimate(10 * INCH, 4.7 * INCH, 7000.0, 8.0, air)
    assert rows[3]["thrust_N"] == pytest.approx(ours.thrust_N[0], rel=1e-6)  # type: ignore[index]
    assert rows[3]["u95_power_W"] == pytest.approx(ours.u95_power_W[0], rel=1e-6)  # type: ignore[index]
    assert rows[3]["k1k2_thrust_N"] == pytest.approx(theirs.thrust_N[0], rel=1e-6)  # type: ignore[index]


def test_an_unknown_band_is_null_and_its_reason_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    doc = told(capsys, "14x8", "--rpm", "20000")
    row = doc["rows"][0]  # type: ignore[index]
    assert row["u_thrust_N"] is None and any("supersonic" in flag for flag in row["flags"])
    assert cli.main(["estimate", "14x8", "--rpm", "20000"]) == 0
    out = capsys.readouterr().out
    assert "do not trust: tip Mach 1.09 is supersonic" in out and "--chord-mm" in out


def test_the_chord_narrows_the_band(capsys: pytest.CaptureFixture[str]) -> None:
    wide, narrow = (told(capsys, "10x5", "--rpm", "6000", *more)["rows"][0] for more in ((), ("--chord-mm", "20")))  # type: ignore[index]
    assert narrow["u_thrust_N"] / narrow["thrust_N"] < 0.8 * wide["u_thrust_N"] / wide["thrust_N"]


@pytest.mark.parametrize(("words", "message"), [
    (("10x47", "--rpm", "5000"), "Meant 10x4.7?"),
    (("8x5x3", "--blades", "2", "--density", "1225", "--rpm", "1"), "--blades: got 2; expected 3, as in 8x5x3."),
    (("8x5x3", "--blades", "2", "--density", "1225", "--rpm", "1"), "--density: got 1225; expected kg/m3"),
    (("5x3", "--rpm", "-1", "--chord-mm", "300"), "--chord-mm: got 300; expected 0.02 to 0.4 diameters, 2.54 to 50.8"),
    (("5x3", "--rpm", "-1", "--chord-mm", "300"), "rpm: got -1"),
    (("5x3", "--rpm", "9000", "--series", "nobody"), "series: got nobody"),
    (("5x3", "--rpm", "1e9", "--airspeed=-300"), "--rpm: got 1e+09; expected 0 to 300000 rev/min"),
    (("5x3", "--rpm", "1e9", "--airspeed=-300"), "--airspeed: got -300; expected -100 to 300 m/s"),
])  # fmt: skip
def test_bad_input_is_refused_all_at_once(
    words: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["estimate", *words]) == 2
    said = capsys.readouterr()
    assert message in said.err and not said.out


@pytest.mark.parametrize(("words", "expected"), [
    (("--measured-pitch-in", "127"), "0.1 to 2.5 diameters, 0.8 to 20 in. 127 mm would be 0.62 diameters."),
    (("--measured-pitch-in", "0.127"), "0.1 to 2.5 diameters, 0.8 to 20 in. 0.127 m would be 0.62 diameters."),
    (("--measured-pitch-in", "12.7e6"), "0.1 to 2.5 diameters, 0.8 to 20 in."),
    (("--chord-mm", "0.02"), "0.02 to 0.4 diameters, 4.06 to 81.3 mm. 0.02 m would be 0.098 diameters."),
    (("--chord-mm", "0.8"), "0.02 to 0.4 diameters, 4.06 to 81.3 mm. 0.8 in would be 0.1 diameters."),
    (("--chord-mm", "1.9"), "0.02 to 0.4 diameters, 4.06 to 81.3 mm. 1.9 in would be 0.24 diameters."),
])  # fmt: skip
def test_a_length_in_another_unit_is_refused_with_the_unit_that_fits(
    words: tuple[str, str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["estimate", "8x5", "--rpm", "5000", *words]) == 2
    said = capsys.readouterr()
    assert said.err == f"{words[0]}: got {float(words[1]):g}; expected {expected}\n" and not said.out


@pytest.mark.parametrize("D", [0.05, 0.2032, 3.0])
def test_every_length_that_may_be_is_taken_and_its_neighbours_are_not(D: float) -> None:
    ends = {"pitch_m": (0.1, 2.5), "chord_m": (0.02, 0.4), "measured_pitch_m": (0.1, 2.5)}
    for name, limits in ends.items():
        for end, outward in zip(limits, (0.999, 1.001), strict=True):
            base = {"diameter_m": D, "pitch_m": 0.6 * D, "blades": 2, "rpm": 5000.0}
            assert np.isfinite(estimate(**(base | {name: end * D})).thrust_N[0])
            with pytest.raises(InputError, match=f"^{name}: "):
                estimate(**(base | {name: [0.3 * D, end * D * outward]}))


def test_numbers_that_are_none_come_all_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["8x5", "--rpm", "5000", "nan", "--airspeed", "inf", "--density", "nan", "--chord-mm", "nan",
             "--measured-pitch-in", "inf", "--series", "nobody"]  # fmt: skip
    assert cli.main(["estimate", *words]) == 2
    said = capsys.readouterr().err.splitlines()
    heads = ["--density: got nan", "--chord-mm: got nan", "--measured-pitch-in: got inf", "series: got nobody",
             "rpm: got nan", "airspeed_m_s: got inf"]  # fmt: skip
    assert len(said) == len(heads) and all(any(line.startswith(head) for line in said) for head in heads)
    words[words.index("--density") + 1] = "9"
    assert cli.main(["estimate", "8by5", *words[1:-2]]) == 2  # an unreadable label hides nothing
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith("LABEL") and "--density: got 9" in said[1] and len(said) == 6
