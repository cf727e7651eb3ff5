"""recording.toml: said once, strictly, every fault found at once."""

from __future__ import annotations

import random
import shlex
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest

import bemt
from bemt.app.cli import main
from bemt.base import units
from bemt.base.errors import InputError
from bemt.data import readers as importers
from bemt.data.readers import recording_toml
from bemt.data.recordings.channels import named
from bemt.data.recordings.check import check
from bemt.data.recordings.load import import_file
from bemt.physics.air import Air

TABLE = "t,F,M,eRPM,U\n" + "".join(f"{20 * k},{-(100 + k)},{2 * k + 40},{70000 + 700 * k},11.1\n" for k in range(12))

GOOD = """
[recording]
file = "run.csv"
session = "one"

[columns]
time = { column = "t", unit = "ms" }
thrust = { column = 2, unit = "gf", sign = -1, u_gain_pct = 0.5, u_zero = 1.0, u_sample = 2.0 }
torque = { column = "M", unit = "mNm" }
electrical_rpm = { column = "eRPM", unit = "rpm" }

[rotor]
pole_pairs = 7
diameter_in = 10
gap_mm = 0.5
name = "10x5"

[air]
pressure_hPa = 1002.0
temperature_C = 21.0
humidity_pct = 45.0

[stand]
wall_distance_m = 1.2
"""

Put = Callable[..., Path]


@pytest.fixture
def put(tmp_path: Path) -> Put:
    def write(toml: str = GOOD, table: str = TABLE, name: str = "run.csv") -> Path:
        (tmp_path / name).write_text(table, encoding="utf-8")
        path = tmp_path / "recording.toml"
        path.write_text(toml, encoding="utf-8")
        return path

    return write


def faults(path: Path) -> dict[str, str]:
    with pytest.raises(InputError) as caught:
        importers.read(path)
    return {fault.where: str(fault) for fault in caught.value.faults}


def test_columns_units_signs_and_pole_pairs_are_applied(put: Put) -> None:
    path = put()
    assert importers.detect(path) == "recording"
    got = importers.read(path)
    k = np.arange(12)
    assert np.allclose(got["time_s"], 0.02 * k)
    assert np.allclose(got["thrust_N"], (100 + k) * units.KGF * 1e-3)
    assert np.allclose(got["torque_Nm"], (2 * k + 40) * 1e-3)
    assert np.allclose(got["rpm"], 10000 + 100 * k)
    assert np.allclose(got["electrical_rpm"], 70000 + 700 * k)  # kept beside it
    assert any("over 7 pole pairs" in text for text in got.notes)
    assert got.unit("U") == "" and any("'U'" in text for text in got.notes)  # unnamed, unit unknown
    assert (got.kind, len(got), got.provenance["session"]) == ("bench", 12, "one")


def test_constants_and_instrument_are_in_si(put: Put) -> None:
    got = importers.read(put())
    air = Air.from_state(100200.0, 21.0, 45.0)
    assert got.provenance["constants"] == pytest.approx(
        {"pole_pairs": 7, "diameter_m": 0.254, "gap_m": 5e-4, "wall_distance_m": 1.2, "density_kg_m3": float(air.rho),
         "temperature_K": 294.15}
    )  # fmt: skip
    gf = units.KGF * 1e-3
    assert got.provenance["instrument"] == {"thrust_N": pytest.approx({"gain": 0.005, "zero": gf, "sample": 2 * gf})}


@pytest.mark.parametrize("unit", ["rpm", "rev_s", "rad_s"])
def test_a_speed_in_any_unit_becomes_rpm(unit: str, put: Put) -> None:
    factor = units.RPM / units.UNITS[unit].factor
    table = "F;n\n" + "".join(f"{k};{(3000 + k) * factor!r}\n" for k in range(5))
    toml = f'[recording]\nfile = "run.csv"\n[columns]\nrpm = {{ column = "n", unit = "{unit}" }}\n'
    got = importers.read(put(toml, table))
    assert got.unit("rpm") == "rpm" and np.allclose(got["rpm"], 3000 + np.arange(5))
    assert any("no air state" in text for text in got.notes)


def test_decimal_commas_and_missing_headings_are_said(put: Put) -> None:
    table = "".join(f"{k},5;{k},25\n" for k in range(5))
    toml = """[recording]
file = "run.csv"
decimal = ","
header = false
[columns]
time = { column = 1, unit = "s" }
thrust = { column = 2, unit = "N" }
"""
    got = importers.read(put(toml, table))
    assert np.allclose(got["thrust_N"], np.arange(5) + 0.25) and len(got) == 5


def test_a_table_without_headings_prints_the_command_that_names_its_columns(tmp_path: Path) -> None:
    """What the message says to type writes a recording.toml, and that is read."""
    text = "6000;12.1;0.21\n7000;16.3;0.28\n8000;21.4;0.37\n9000;27.2;0.47\n"
    (tmp_path / "bare.csv").write_text(text)
    with chdir(tmp_path):
        notes = importers.read("bare.csv").notes
        step = next(n for n in notes if "bemt import" in n).partition("bemt import")[2]
        words = [w for word in shlex.split(step) for w in ([word, "torque=3"] if word == "--column" else [word])]
        assert (
            main(["import", *[w for word in words for w in ([word, "torque=Nm"] if word == "--unit" else [word])]]) == 0
        )
        got = importers.read("recording.toml")
    assert np.allclose(got["rpm"], [6000, 7000, 8000, 9000]) and np.allclose(got["thrust_N"], [12.1, 16.3, 21.4, 27.2])
    assert np.allclose(got["torque_Nm"], [0.21, 0.28, 0.37, 0.47])


def test_runs_are_joined_in_their_order(put: Put, tmp_path: Path) -> None:
    (tmp_path / "second.csv").write_text(TABLE.replace(",11.1", ",12.6"), encoding="utf-8")
    got = importers.read(put(GOOD.replace('"run.csv"', '["run.csv", "second.csv"]')))
    assert len(got) == 24 and np.array_equal(got["run"], np.repeat([1.0, 2.0], 12))
    assert np.array_equal(got["U"], np.repeat([11.1, 12.6], 12))
    assert len(got.flags) == len(got.lines) == 24 and got.provenance["file"] == "run.csv+second.csv"


def test_all_faults_are_found_at_once(put: Put) -> None:
    bad = GOOD.replace('unit = "gf"', 'unit = "g"').replace("torque =", "tork =").replace('"ms"', '"minutes"')
    bad = bad.replace("pole_pairs = 7\n", "").replace("gap_mm = 0.5", "gap_mm = 5000").replace("[stand]", "[stnd]")
    bad = bad.replace("pressure_hPa = 1002.0", "pressure_hPa = 100200.0").replace("sign = -1", "sign = 0")
    found = faults(put(bad))
    assert set(found) == {
        "columns.thrust.unit", "columns.tork", "columns.time.unit", "rotor.pole_pairs", "rotor.gap_mm", "stnd",
        "air.pressure_hPa", "columns.thrust.sign",
    }  # fmt: skip
    assert "g is a mass: write gf" in found["columns.thrust.unit"]
    assert "Did you mean torque?" in found["columns.tork"] and "Did you mean stand?" in found["stnd"]


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ('column = "M"', 'column = "Q"', "columns.torque.column"),
        ('column = "M"', "column = 2", "columns.torque.column"),
        ('column = "M"', "column = 99", "columns.torque.column"),
        ('column = "M"', "column = 0", "columns.torque.column"),
        ('column = "M", ', "", "columns.torque.column"), ('"mNm"', '"N"', "columns.torque.unit"),
        ("electrical_rpm", "rpm", "rotor.pole_pairs"), ("pole_pairs = 7", "pole_pairs = 7.5", "rotor.pole_pairs"),
        ("diameter_in = 10", "diameter_in = 10\ndiameter_mm = 254", "rotor.diameter_mm"),
        ("diameter_in = 10", "diameter = 10", "rotor.diameter"), ("temperature_C = 21.0\n", "", "air.temperature_C"),
        ("humidity_pct", "altitude_m = 10\nhumidity_pct", "air"), ("[air]", "[air]\ndensity_kg_m3 = 1.2", "air"),
        ('"run.csv"', '"other.csv"', ""), ('"run.csv"', '"../run.csv"', "recording.file"),
        ('session = "one"', "header = 1", "recording.header"), ('file = "run.csv"', "", "recording.file"),
        ("u_zero = 1.0", "u_zero = -1.0", "columns.thrust.u_zero"), ("[columns]", "[column]", "column"),
    ],
)  # fmt: skip
def test_each_fault_has_its_place(old: str, new: str, where: str, put: Put) -> None:
    text = GOOD.replace(old, new)
    assert text != GOOD
    assert where in faults(put(text))


@pytest.mark.parametrize(
    ("air", "density"),
    [
        ("density_kg_m3 = 1.19", 1.19),
        ("altitude_m = 0.0", 1.225),
        ("altitude_m = 0.0\ntemperature_C = 30.0", 1.1644),
        ("pressure_hPa = 1013.25\ntemperature_C = 15.0", 1.2250),
    ],
)
def test_every_air_state_gives_a_density(air: str, density: float, put: Put) -> None:
    start = GOOD.index("[air]")
    text = GOOD[:start] + "[air]\n" + air + "\n" + GOOD[GOOD.index("[stand]") :]
    assert importers.read(put(text)).provenance["constants"]["density_kg_m3"] == pytest.approx(density, rel=5e-4)


def test_a_table_points_to_the_recording_beside_it(put: Put) -> None:
    path = put()
    got = importers.read(path.with_name("run.csv"))
    assert any("import recording.toml" in text for text in got.notes)


def test_faults_of_the_table_name_the_table(put: Put) -> None:
    found = faults(put(table=TABLE.replace("\n40,", "\n40,7,7,")))
    assert any("run.csv" in text and "7 cells" in text for text in found.values())


def test_mutated_recordings_are_read_or_refused(put: Put) -> None:
    rng = random.Random(11)
    read = 0
    for _ in range(250):
        text = GOOD
        for _ in range(rng.randint(1, 3)):
            at = rng.randrange(len(text))
            match rng.randrange(4):
                case 0:
                    text = text[:at] + text[at + rng.randint(1, 12) :]
                case 1:
                    junk = ["1", '"', "[", "{", "=", "\n", "nan", "-", ".", "é", "true", ","]
                    text = text[:at] + rng.choice(junk) + text[at:]
                case 2:
                    lines = text.split("\n")
                    lines[rng.randrange(len(lines))] = rng.choice(lines)
                    text = "\n".join(lines)
                case _:
                    lines = text.split("\n")
                    rng.shuffle(lines)
                    text = "\n".join(lines)
        try:
            got = recording_toml.read(put(text))
        except InputError as error:
            assert error.faults
            continue
        read += 1
        assert len(got) == 12 and len(got.flags) == 12
    assert 5 < read < 245


def test_what_a_table_shows_of_itself_survives_a_statement_about_one_column(put: Put) -> None:
    """Power that is voltage times current, and a power coefficient beside CT, stay what they are."""
    rows = "".join(f"{k}000,{k * k},{10 + k},{k / 2},{(10 + k) * k / 2},0.1,0.05\n" for k in range(3, 8))
    head = "rpm,Zug,voltage (V),current (A),power (W),CT,Cp\n"
    toml = '[recording]\nfile = "run.csv"\n[columns]\nthrust = { column = "Zug", unit = "gf" }\n'
    stated = importers.read(put(toml, head + rows))
    alone = importers.read(put("", head + rows).with_name("run.csv"))
    assert {"electrical_power_W", "CP"} <= alone.values.keys() - {"Zug"} <= stated.values.keys()
    assert "power_W" not in stated


@pytest.mark.parametrize("heading", ["eRPM", "ESC speed (erpm)", "Electrical Speed (eRPM)"])
def test_electrical_revolutions_are_no_speed_before_the_pole_pairs_are_stated(heading: str, tmp_path: Path) -> None:
    """A raw eRPM is no speed of the rotor; the command that is shown, with the pairs, makes it one, without a fault."""
    rows = [(3000, 1.1), (4000, 2.0), (5000, 3.1), (6000, 4.6), (7000, 6.2), (8000, 8.1)]
    file = tmp_path / "esc.csv"
    file.write_text(f"{heading},Thrust (N)\n" + "".join(f"{7 * n},{T}\n" for n, T in rows))
    found = named(import_file(file))
    assert "rpm" not in found
    assert any("--pole-pairs PAIRS" in note for note in import_file(file).notes)
    told = bemt.import_(file, pole_pairs=7, out=tmp_path / "esc.toml")
    kept = import_file(tmp_path / "esc.toml")
    assert np.allclose(kept["rpm"], [n for n, _ in rows])
    assert told.exit_code == 0
    assert not [f for f in check(kept) if f.severity == "error"]
    with pytest.raises(InputError, match="pole"):
        bemt.diagnose(file, case="10x5")


def _electrical(folder: Path) -> Path:
    """A table whose speed counts electrical revolutions, in a folder of its own."""
    folder.mkdir()
    rows = [(3000, 1.1), (4000, 2.0), (5000, 3.1), (6000, 4.6), (7000, 6.2), (8000, 8.1)]
    (folder / "esc.csv").write_text("eRPM,Thrust (N)\n" + "".join(f"{7 * n},{T}\n" for n, T in rows))
    return folder / "esc.csv"


def test_what_is_stated_is_kept_beside_its_table_under_a_free_name(tmp_path: Path) -> None:
    """A recording.toml that is there is not written over, so that the next command is one that runs."""
    file = _electrical(tmp_path / "data")
    for name in ("recording.toml", "esc.toml"):
        step = next(note for note in import_file(file).notes if "bemt import" in note)
        kept = file.with_name(name)
        assert step.endswith(f"--pole-pairs PAIRS --out {kept.as_posix()}")
        bemt.import_(file, pole_pairs=7, out=kept)
        assert import_file(kept)["rpm"][0] == pytest.approx(3000)


def test_pole_pairs_can_be_tried_before_they_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = _electrical(tmp_path / "data")
    monkeypatch.chdir(tmp_path)
    tried = bemt.import_("data/esc.csv", pole_pairs=7)
    step = "bemt import data/esc.csv --pole-pairs 7 --out data/recording.toml"
    assert tried.exit_code == 0 and step in tried.text
    assert "3000" in tried.text and not list(tmp_path.glob("**/*.toml"))
    kept = bemt.import_(file, pole_pairs=7, out="data/recording.toml")
    points = [told.to_dict()["files"][0]["reduction"]["points"] for told in (tried, kept)]
    assert points[0] == points[1]
