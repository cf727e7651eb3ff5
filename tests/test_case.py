"""Promise: a case file is checked whole, each fault has its message."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bemt.base.errors import Fault, InputError
from bemt.physics import bem
from bemt.rotors.case import Case, find_cases, load_case
from bemt.rotors.case.prepare import prepare_case
from geometry.airfoil import naca
from geometry.laws import helix
from geometry.rotor import Rotor

MALFORMED = Path(__file__).parent / "malformed"
CASES = Path(__file__).resolve().parents[1] / "cases"
SHIPPED = ("ds30", "prop_8x5", "prop_10x5", "prop_12x6", "prop_14x8")  # a case of one's own may lie beside them
FILES = sorted(MALFORMED.glob("*.toml"))
INCH = 0.0254

GOOD = """
schema = "bemt.case/1"
name = "good"
[rotor]
kind = "propeller"
blades = 2
diameter_in = 10
hub_ratio = 0.15
[blade]
pitch_in = 5
chord_law = "apc_like"
[blade.section]
naca = "4412"
[operating]
rpm = 6000
[air]
density_kg_m3 = 1.225
"""


def write(folder: Path, text: str) -> Path:
    """Write a case file."""
    path = folder / "case.toml"
    path.write_text(text)
    return path


def expected_messages(path: Path) -> list[str]:
    """Messages that a malformed file announces in its head."""
    lines = path.read_bytes().decode("latin-1").splitlines()
    return [line.removeprefix("#! ") for line in lines if line.startswith("#! ")]


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_malformed_file_gives_exactly_its_messages(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(MALFORMED)
    with pytest.raises(InputError) as caught:
        load_case(path.name)
    assert [str(fault) for fault in caught.value.faults] == expected_messages(path)
    assert str(caught.value).splitlines() == expected_messages(path)
    assert caught.value.exit_code == 2


def test_there_are_enough_malformed_files_and_all_differ() -> None:
    messages = [tuple(expected_messages(path)) for path in FILES]
    assert len(FILES) >= 30
    assert all(messages) and len(set(messages)) == len(FILES)


def test_all_faults_of_a_file_come_at_once() -> None:
    assert len(expected_messages(MALFORMED / "many_faults.toml")) == 8


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_case_states_nominal_inside_a_reasoned_range(name: str) -> None:
    case = load_case(CASES / name)
    assert case.name == name
    assert case.references_path is not None and case.references_path.is_file()
    assert case.assumptions
    for assumption in case.assumptions:
        assert math.isclose(assumption.nominal, np.mean(assumption.values), rel_tol=0.01), assumption.key
        assert len(assumption.why) > 20


def test_no_value_that_the_source_does_not_give_is_left_undeclared() -> None:
    # given by the source: diameter, pitch, two blades (propellers); duct length, hub, speed, about the diameter (fan)
    given = {"rotor.blades", "rotor.diameter_in", "blade.pitch_in"}
    for name in SHIPPED:
        case = load_case(CASES / name)
        declared = {a.key for a in case.assumptions}
        numbers = {
            f"{t}.{k}" for t in ("rotor", "blade") for k, v in case.written[t].items() if isinstance(v, (int, float))
        }
        numbers |= {f"blade.section.{k}" for k in ("camber", "thickness")}
        numbers |= {f"duct.{k}" for k, v in case.written.get("duct", {}).items() if isinstance(v, (int, float))}
        given_here = given if case.kind == "propeller" else {"rotor.hub_diameter_mm", "duct.length_mm"}
        neutral = {"blade.chord_scale", "blade.beta_offset_deg"} - declared  # 1 and 0 unless declared
        for key in neutral:
            assert case.get(key) in (0.0, 1.0)
        assert numbers - given_here - neutral <= declared, name


def test_find_cases_counts_digits_as_numbers(tmp_path: Path) -> None:
    for name in sorted(SHIPPED):  # 10x5 first
        (tmp_path / name).mkdir()
        write(tmp_path / name, GOOD)
    assert tuple(path.parent.name for path in find_cases([tmp_path])) == SHIPPED
    assert set(SHIPPED) <= {path.parent.name for path in find_cases([CASES])}


def test_sizes_reach_the_geometry(tmp_path: Path) -> None:
    case = load_case(write(tmp_path, GOOD))
    rotor = case.rotor()
    assert rotor.D == pytest.approx(10 * INCH, rel=1e-12)
    assert rotor.Rhub == pytest.approx(0.15 * 5 * INCH, rel=1e-12)
    assert rotor.blade.pitch_m() == pytest.approx(5 * INCH, rel=1e-6)
    assert case.duct() is None
    assert case.air().rho == 1.225


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("diameter_in = 10", "diameter_mm = 254"), ("diameter_in = 10", "diameter_m = 0.254"),
        ("pitch_in = 5", "pitch_mm = 127"), ("pitch_in = 5", "pitch_ratio = 0.5"),
        ("hub_ratio = 0.15", "hub_diameter_mm = 38.1"), ("hub_ratio = 0.15", "hub_diameter_in = 1.5"),
    ],
)  # fmt: skip
def test_units_are_only_another_way_to_write_the_same(tmp_path: Path, old: str, new: str) -> None:
    one = load_case(write(tmp_path, GOOD)).rotor().blade
    other = load_case(write(tmp_path, GOOD.replace(old, new))).rotor().blade
    assert other.key() == one.key()


@pytest.mark.parametrize(("old", "new", "said"), [
    ("rpm = 6000", "rpm = 942 rad/s", "the number alone, in rev/min. 942 rad/s = 8995 rev/min: write rpm = 8995."),
    ("rpm = 6000", "rpm = 6000rpm  # no blank", "the number alone, in rev/min. Write rpm = 6000."),
    ("rpm = 6000", 'rpm = "942 rad/s"', "a number from 10 to 300000 rev/min. 942 rad/s = 8995 rev/min"),
    ("pitch_in = 5", "pitch_in = 127 mm", "the number alone, in inches. 127 mm = 5 inches: write pitch_in = 5."),
    ("pitch_in = 5", 'pitch_in = 5"', "expected the number alone, in inches. Write pitch_in = 5."),
    ("pitch_in = 5", "pitch_in = 5 kg", "The unit of pitch is inches, as its key says."),
    ("blades = 2", "blades = 2 pcs", "got more text after a value"),
])  # fmt: skip
def test_a_unit_behind_a_number_is_refused_with_the_number_that_the_key_wants(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    assert GOOD.count(old) == 1
    with pytest.raises(InputError) as caught:
        load_case(write(tmp_path, GOOD.replace(old, new)))
    (fault,) = caught.value.faults
    assert said in str(fault)


def test_all_units_behind_numbers_are_told_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("diameter_in = 10", "diameter_in = 10 in").replace("rpm = 6000", "rpm = 100 rev/s")
    with pytest.raises(InputError, match="write rpm = 6000") as caught:
        load_case(write(tmp_path, text))
    assert len(caught.value.faults) == 2


@pytest.mark.parametrize(("name", "diameter", "pitch", "where", "hint"), [
    ("mine", "diameter_mm = 10", "pitch_in = 6", "rotor.diameter_mm", "inches: write diameter_in = 10 or"),
    ("mine", "diameter_in = 10", "pitch_mm = 6", "blade.pitch_mm", "inches: write pitch_in = 6 or pitch_mm = 152.4"),
    ("mine", "diameter_m = 0.254", "pitch_mm = 6", "blade.pitch_mm", "inches: write pitch_in = 6"),
    ("mine", "diameter_in = 10", "pitch_in = 100", "blade.pitch_in", "millimetres: write pitch_mm = 100"),
    ("mine", "diameter_mm = 51", "pitch_in = 20", "blade.pitch_in", "diameter_mm = 1295; or pitch_in"),
    ("mine", "diameter_in = 10", "pitch_in = 0.3", "blade.pitch_in", ""),
    ("prop_10x6", "diameter_mm = 10", "pitch_in = 6", "rotor.diameter_mm", "inches: write diameter_in = 10"),
    ("prop_10x6", "diameter_mm = 10", "pitch_mm = 6", "rotor.diameter_mm", "inches: write diameter_in = 10"),
    ("prop_5x4", "diameter_in = 127", "pitch_mm = 3000", "rotor.diameter_in", "millimetres: write diameter_mm = 127"),
])  # fmt: skip
def test_the_length_with_the_wrong_unit_is_the_one_that_is_named(
    tmp_path: Path, name: str, diameter: str, pitch: str, where: str, hint: str
) -> None:
    text = f'schema = "bemt.case/1"\nname = "{name}"\nrotor.blades = 2\nrotor.{diameter}\nblade.{pitch}\n'
    with pytest.raises(InputError) as caught:
        load_case(write(tmp_path, text + "operating.rpm = 1000\n"))
    (fault,) = caught.value.faults
    assert fault.where == where and hint in fault.hint and bool(fault.hint) == bool(hint)


def test_override_replaces_the_quantity_in_whatever_unit_it_was(tmp_path: Path) -> None:
    case = load_case(write(tmp_path, GOOD.replace("diameter_in = 10", "diameter_mm = 254")))
    changed = case.replaced({"rotor.diameter_in": 8.0, "operating.rpm": 1234.0})
    assert changed.diameter_m == pytest.approx(8 * INCH)
    assert changed.rpm == 1234.0
    assert case.diameter_m == pytest.approx(0.254)
    assert case.rpm == 6000.0


@pytest.mark.parametrize(
    ("table", "rho"),
    [
        ("density_kg_m3 = 1.1", 1.1),
        ("altitude_m = 0", 1.225),
        ("altitude_m = 5000", 0.73612),
        ("altitude_m = 0\ntemperature_C = 30", 1.225 * 288.15 / 303.15),
        ("pressure_hPa = 1013.25\ntemperature_C = 20\nhumidity_pct = 50", 1.1992),
    ],
)
def test_air_three_ways(tmp_path: Path, table: str, rho: float) -> None:
    case = load_case(write(tmp_path, GOOD.replace("density_kg_m3 = 1.225", table)))
    assert case.air().rho == pytest.approx(rho, rel=1e-4)


def test_blade_from_stations_is_interpolated_through_them(tmp_path: Path) -> None:
    (tmp_path / "blade.csv").write_text((MALFORMED / "stations_good.csv").read_text())
    text = GOOD.replace('pitch_in = 5\nchord_law = "apc_like"', 'stations = "blade.csv"\nbeta_offset_deg = 1.5')
    blade = load_case(write(tmp_path, text)).rotor().blade
    chord, beta = blade.at(0.5 * blade.R)
    assert float(chord) / blade.R == pytest.approx(0.18)
    assert math.degrees(float(beta)) == pytest.approx(21.5)


def test_published_stations_can_be_named(tmp_path: Path, shared_data: Path) -> None:
    for key, name in (("uiuc", "uiuc/volume-1/apce_10x5_geom.txt"), ("apc", "apc/10x5E-PERF.PE0")):
        text = GOOD.replace('pitch_in = 5\nchord_law = "apc_like"', f'{key} = "{(shared_data / name).as_posix()}"')
        blade = load_case(write(tmp_path, text)).rotor().blade
        assert blade.pitch_m() / INCH == pytest.approx(5.0, rel=0.15), key


def test_sections_may_change_along_the_blade(tmp_path: Path) -> None:
    lists = "camber = [0.02, 0.05]\nthickness = [0.18, 0.09]\nr_over_R = [0.2, 0.9]\nthickness_scale = 0.5"
    blade = load_case(write(tmp_path, GOOD.replace('naca = "4412"', lists))).rotor().blade
    assert [x for x, _ in blade.anchors] == [0.2, 0.9]
    assert [round(s.thickness, 3) for _, s in blade.anchors] == [0.09, 0.045]


def test_gap_and_bore_are_the_same_information(tmp_path: Path) -> None:
    fan = (CASES / "ds30" / "case.toml").read_text().replace('references = "references.csv"', "")
    fan = fan[: fan.index("[[assumptions]]")]
    by_gap = load_case(write(tmp_path, fan)).duct()
    by_bore = load_case(write(tmp_path, fan.replace("tip_gap_mm = 0.4", "inner_diameter_mm = 69.8"))).duct()
    assert by_gap is not None and by_bore is not None
    assert by_bore.gap == pytest.approx(by_gap.gap, rel=1e-9)
    assert by_bore.exit_radius == pytest.approx(by_gap.exit_radius, rel=1e-12)


def test_axes_as_list_or_as_range(tmp_path: Path) -> None:
    text = GOOD + "[sweep]\nrpm = {start = 2000, stop = 6000, num = 5}\npitch_in = [4, 6]\n"
    axes = load_case(write(tmp_path, text)).axes()
    assert {k: v.tolist() for k, v in axes.items()} == {"rpm": [2000, 3000, 4000, 5000, 6000], "pitch_in": [4, 6]}


def test_hash_follows_every_file_and_no_path(tmp_path: Path) -> None:
    def make(name: str, stations: str) -> Case:
        folder = tmp_path / name
        folder.mkdir()
        (folder / "blade.csv").write_text(stations)
        return load_case(write(folder, GOOD.replace('pitch_in = 5\nchord_law = "apc_like"', 'stations = "blade.csv"')))

    good = (MALFORMED / "stations_good.csv").read_text()
    one, same, other = make("a", good), make("b", good), make("c", good.replace("0.18", "0.19"))
    assert one.content_hash() == same.content_hash() != other.content_hash()


def test_a_script_gives_the_thrust_of_the_case(tmp_path: Path) -> None:
    """The example of the README and a case of the same propeller: one section table, the rule's."""
    case = load_case(write(tmp_path, GOOD))
    found = bem.solve(Rotor(helix(0.254, 0.127, anchors=naca("4412")), B=2), rpm=6000.0, air=case.air())
    wanted = prepare_case(case).solve(6000.0, 0.0, case.air())
    assert found.kind == wanted.kind == "bemt" and found.values.keys() == wanted.values.keys()
    for channel in ("thrust_N", "torque_Nm", "CT", "Re75"):
        assert found[channel] == pytest.approx(wanted[channel], rel=1e-9)


@pytest.mark.parametrize(
    ("make", "got"),
    [(lambda p: p / "prop_8x5", "no such file or folder"), (lambda p: p, "no case")],
)
def test_paths_without_a_case(tmp_path: Path, make: object, got: str) -> None:
    with pytest.raises(InputError) as caught:
        find_cases([make(tmp_path)])  # type: ignore[operator]
    assert [fault.got for fault in caught.value.faults] == [got]
    assert "A label?" not in caught.value.faults[0].hint, "`new` takes no path"


def test_fault_reads_as_a_sentence() -> None:
    assert str(Fault("a.toml", "x", "1", "2", "Did you mean 2?")) == "a.toml: x: got 1; expected 2. Did you mean 2?"
    assert str(Fault("a.toml", "", "1", "2.", "Try 2.")) == "a.toml: got 1; expected 2. Try 2."
