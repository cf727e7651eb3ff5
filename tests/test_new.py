"""The promise of `new`: a folder that runs at once, every unknown declared; and of `drive LABEL`: no file needed."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest

import bemt
from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.rotors.case import case_of, fresh, load_case
from bemt.rotors.case.unknowns import section_of

STATIONS = "r_over_R,chord_over_R,beta_deg\n0.2,0.14,35\n0.5,0.19,22\n0.75,0.16,15\n1.0,0.06,10\n"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "blade.csv").write_text(STATIONS)
    return tmp_path


def test_a_station_off_the_line_between_its_neighbours_is_refused(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "odd.csv").write_text(STATIONS.replace("0.75,0.16,15", "0.75,0.16,51"))
    assert main(["new", "odd", "--stations", "odd.csv", "--diameter-mm", "254"]) == 2
    assert "odd.csv: 4:3: got 51; expected about 14" in capsys.readouterr().err
    # three stations of one pitch are a screw, however steep its root
    screw = "".join(f"{x},0.15,{math.degrees(math.atan2(0.4, math.pi * x)):.6g}\n" for x in (0.05, 0.35, 1.0))
    (here / "screw.csv").write_text(f"r_over_R,chord_over_R,beta_deg\n{screw}")
    assert main(["new", "screw", "--stations", "screw.csv", "--diameter-mm", "254"]) == 0


def test_a_folder_that_exists_is_said_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    assert main(["new", "10x5", "--out", str(tmp_path / "mine")]) == 2
    assert "mine: got a folder that already exists; expected a new folder." in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (["10x5"], "prop_10x5"),
        (["8x4.5x3", "--rpm", "9000", "--airspeed-m-s", "5"], "prop_8x4.5x3"),
        (["10x4.5", "--kv", "900", "--cells", "3"], "prop_10x4.5"),
        (["70mm", "--fan"], "fan_70"),
        (["--stations", "blade.csv", "--diameter-mm", "254"], "blade"),
        (["10x5E", "--stations", "blade.csv", "--kv", "900", "--cells", "3"], "prop_10x5_electric"),
        (["APC 10x4.7SF"], "prop_10x4.7_slow_flyer"),
    ],
)
def test_a_new_folder_runs_at_once(words: list[str], name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", *words]) == 0
    assert name in capsys.readouterr().out
    case = load_case(name)
    assert case.assumptions and all(item.why for item in case.assumptions)
    assert main(["sweep", name, "--json"]) == 0
    row = json.loads(capsys.readouterr().out)["cases"][0]["rows"][0]
    assert row["converged"] and row["thrust_N"] > 0 and row["u_input"] > 0
    if "--kv" in words:
        assert main(["drive", name, "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["unknowns"] and found["steady"]["thrust_N"][-1] > 1.0


@pytest.mark.parametrize(("unit", "metres"), [("in", 0.0254), ("mm", 1e-3), ("m", 1.0)])
def test_stations_in_lengths_are_those_in_shares_of_the_radius(unit: str, metres: float, here: Path) -> None:
    rows = [[float(c) for c in row.split(",")] for row in STATIONS.split()[1:]]
    lengths = [f"{b:g},{0.127 * x / metres:.8g},{0.127 * c / metres:.8g},7" for x, c, b in rows]
    (here / "lengths.csv").write_text("\n".join([f"beta_deg,r_{unit},chord_{unit},thickness_over_c", *lengths]))
    for file in ("blade.csv", "lengths.csv"):
        assert main(["new", "--stations", file, "--diameter-mm", "254"]) == 0
    shares, same = load_case("blade"), load_case("lengths")
    assert same.hub_diameter_m == pytest.approx(shares.hub_diameter_m)
    one, other = shares.rotor().blade, same.rotor().blade
    assert other.chord == pytest.approx(one.chord, rel=1e-6) and other.beta == pytest.approx(one.beta, rel=1e-6)


@pytest.mark.parametrize(
    ("header", "diameter", "where", "hint"),
    [
        ("r_mm,chord_mm,beta_deg", "150", "r_mm", "75 mm"),
        ("r_mm,chord_mm,beta_deg", "400", "r_mm", "200 mm"),
        ("r_mm,chord_mm,r_over_R,beta_deg", "200", "1", "r_mm and r_over_R"),
        ("r_mm,chord_over_R,beta_deg", "200", "chord_over_R", "Divide the chord"),
    ],
)
def test_stations_that_cannot_be_of_this_rotor(
    header: str, diameter: str, where: str, hint: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    columns = {"r_mm": (20, 60, 100), "r_over_R": (0.2, 0.6, 1.0), "beta_deg": (30, 20, 12)}
    rows = zip(*(columns.get(name, (20, 20, 10)) for name in header.split(",")), strict=True)
    (here / "odd.csv").write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]))
    assert main(["new", "--stations", "odd.csv", "--diameter-mm", diameter]) == 2
    (said,) = capsys.readouterr().err.strip().splitlines()
    assert said.startswith(f"odd.csv: {where}: got ") and hint in said
    assert not (here / "odd").exists()


def test_an_angle_that_may_be_twist_is_refused(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "twist.csv").write_text(STATIONS.replace("beta_deg", "twist_deg"))
    assert main(["new", "--stations", "twist.csv", "--diameter-mm", "254"]) == 2
    told = capsys.readouterr().err
    assert "twist.csv" in told and "beta_deg" in told and not (here / "twist").exists()


SIX = """schema = "bemt.case/1"
name = "prop_10x5"
rotor.blades = 2
rotor.diameter_in = 10
blade.pitch_in = 5
operating.rpm = 6000
"""


def test_six_lines_are_the_case_that_new_writes(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "case.toml").write_text(SIX)
    short = load_case("case.toml")
    assert main(["new", "10x5", "--rpm", "6000"]) == 0
    written = load_case("prop_10x5")
    tables = ("rotor", "blade", "operating", "air", "model")
    assert [getattr(short.file, t) for t in tables] == [getattr(written.file, t) for t in tables]
    assert {a.key: a for a in short.assumptions} == {a.key: a for a in written.assumptions}
    capsys.readouterr()
    assert main(["sweep", "case.toml", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["cases"][0]["assumptions"]
    assert {"rotor.hub_ratio", "blade.max_chord_over_R", "air.density_kg_m3"} <= {a["key"] for a in told}
    assert all(a["u_thrust_N"] > 0 and a["why"] for a in told)


def test_what_a_short_case_states_is_no_assumption(here: Path) -> None:
    text = SIX + 'rotor.hub_diameter_mm = 30\nair.altitude_m = 500\nblade.section.naca = "4412"\n'
    text += '[[assumptions]]\nkey = "blade.max_chord_over_R"\nlow = 0.19\nhigh = 0.20\nwhy = "measured"\n'
    (here / "case.toml").write_text(text)
    case = load_case("case.toml")
    assert case.hub_diameter_m == 0.03 and case.air().rho < 1.18
    assert case.file.blade.max_chord_over_R == pytest.approx(0.195)  # the middle of the range that the user gives
    assert {a.key: a.values for a in case.assumptions} == {
        "blade.max_chord_over_R": (0.19, 0.20),
        "blade.beta_offset_deg": (0.0, 1.4),
    }


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["10by5"], "label"),
        ([], "label, --stations"),
        (["10x5", "--kv", "900"], "--cells together"),
        (["--stations", "blade.csv"], "--diameter-mm"),
        (["--stations", "absent.csv", "--diameter-mm", "254"], "absent"),
        (["--stations", "blade.csv", "--diameter-mm", "0.254"], "Times 1000"),
        (["seventy", "--fan"], "70mm"),
        (["mine", "--scan", "absent.stl"], "absent.stl"),
        (["mine", "--scan", "blade.csv"], "a solid"),
        (["10x5", "--unit", "mm"], "--scan"),
        (["mine", "--scan", "a.stl", "--blades", "2"], "--blades"),
    ],
)
def test_what_is_no_propeller_is_refused_and_nothing_is_written(
    words: list[str], said: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", *words]) == 2
    assert said in capsys.readouterr().err
    assert [p.name for p in here.iterdir()] == ["blade.csv"]


def test_nobody_loses_a_case(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "10x5"]) == 0
    before = Path("prop_10x5/case.toml").read_bytes()
    assert main(["new", "10x5"]) == 2
    assert Path("prop_10x5/case.toml").read_bytes() == before


def test_a_case_gets_its_motor_later(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As it was written it is written again with the motor; one that was changed stays, and the way is said."""
    motor = ["--kv", "826", "--cells", "4"]
    assert main(["new", "10x4.5"]) == 0 and main(["new", "10x4.5", *motor]) == 0
    assert load_case(here / "prop_10x4.5").file.drive is not None
    assert main(["new", "10x5"]) == 0
    own = here / "prop_10x5" / "case.toml"
    own.write_text(own.read_text() + "# mine\n")
    assert main(["new", "10x5", *motor]) == 2 and own.read_text().endswith("# mine\n")
    assert "[drive]" in capsys.readouterr().err


def test_a_name_before_the_label_is_the_name_of_the_case(here: Path) -> None:
    assert main(["new", "quad=10x4.5"]) == 0
    assert load_case(here / "quad").name == "quad" and not (here / "prop_10x4.5").exists()


def test_a_label_with_its_motor_needs_no_file(capsys: pytest.CaptureFixture[str]) -> None:
    motor = ["--kv", "900", "--cells", "3", "--mass-kg", "1.4", "--rotors", "4", "--capacity-Ah", "3"]
    words = ["drive", "10x4.5", *motor]
    assert main(words) == 0
    shown = capsys.readouterr().out
    assert all(word in shown for word in ("thrust", "current", "gf/W", "throttle", "flight time", "motor's sheet", "±"))
    assert max(map(len, shown.splitlines())) <= 120 and len(shown.splitlines()) <= 24
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["schema"] == "bemt.drive.result/2" and found["hover"]["minutes"]["u"] > 0
    assert main(["drive", "10x4.5", "--kv", "900", "--cells", "3", "--mass-kg", "30"]) == 1
    assert "no hover" in capsys.readouterr().out


def test_a_motor_for_a_smaller_propeller_is_called_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["drive", "10x5", "--kv", "2300", "--cells", "4"]) == 0
    assert "suits propellers of" in capsys.readouterr().out
    assert bemt.drive("10x5", kv=900, cells=3).notes == ()


def test_an_estimate_of_the_drive_is_written_where_it_is_told(tmp_path: Path) -> None:
    assert main(["drive", "10x5", "--kv", "900", "--cells", "3", "--out", str(tmp_path / "out")]) == 0
    assert json.loads((tmp_path / "out" / "drive.json").read_text())["schema"] == "bemt.drive.result/2"


def test_most_thrust_is_one_at_every_door(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of a 10x4.5 with 920 rev/min/V on 4 cells there were four: 9.7, 10.2, 16.7 and 19.6 N."""
    import re

    words = ["10x4.5", "--kv", "920", "--cells", "4"]
    assert main(["new", *words]) == 0
    case = "prop_10x4.5"
    capsys.readouterr()

    def of(*args: str) -> dict[str, object]:
        assert main([*args, "--json"]) == 0
        return dict(json.loads(capsys.readouterr().out))

    label, own = of("drive", *words), of("drive", case)
    (swept,) = of("sweep", case)["cases"]  # type: ignore[misc]
    (exported,) = of("export", case, "--format", "px4", "--out", "out")["cases"]  # type: ignore[misc]
    target = exported["targets"][0]  # type: ignore[index]
    library = bemt.drive("10x4.5", kv=920, cells=4)
    found = [
        (d["rpm"]["value"], d["thrust_N"]["value"], d["thrust_N"]["u"])  # type: ignore[index]
        for d in (label["full"], own["full"], swept["drive"], target["full_throttle"])  # type: ignore[index]
    ]
    found.append((library.full["rpm"].value, library.full["thrust_N"].value, library.full["thrust_N"].u))
    for one in found[1:]:
        assert one == pytest.approx(found[0], rel=1e-3)
    row = swept["rows"][0]  # type: ignore[index]
    assert row["thrust_N"] == pytest.approx(found[0][1], rel=2e-3)  # the case's own speed is that of full throttle
    text = next(Path("out").rglob("*_sih.params")).read_text()
    assert float(re.findall(r"set-default SIH_T_MAX (\S+)", text)[0]) == pytest.approx(found[0][1], rel=1e-3)
    assert float(re.findall(r"set-default SIH_F_RPM_MAX (\S+)", text)[0]) == pytest.approx(found[0][0], rel=1e-3)


def test_a_class_of_blades_brings_its_camber_and_its_family(here: Path) -> None:
    for label, family in (("APC 10x4.7SF", "apcsf"), ("GWS 10x4.7 slow flyer", "gwssf"), ("10x4.7", None)):
        case = case_of(fresh.label_text(label))
        assert case.file.blade.family == family
        assert case.file.blade.section.camber == section_of("slow_flyer" if family else None)[0].value  # type: ignore[union-attr]
    short = case_of(SIX + 'blade.class = "slow_flyer"\n')
    assert short.file.blade.section.camber > 0.05  # type: ignore[union-attr]
    assert short.file.blade.max_chord_over_R > 1.3 * case_of(SIX).file.blade.max_chord_over_R  # type: ignore[operator]


def test_stations_and_label_are_one_case_that_weighs_both(here: Path) -> None:
    assert main(["new", "10x5", "--stations", "blade.csv"]) == 0
    both = load_case("prop_10x5")
    assert both.diameter_m == pytest.approx(0.254) and both.file.blade.label_pitch_in == 5
    assert main(["new", "--stations", "blade.csv", "--diameter-mm", "254"]) == 0
    alone = load_case("blade")
    assert both.rotor().blade.beta == pytest.approx(alone.rotor().blade.beta)
    # the stations are steeper than the label: the population expects a flatter blade than they say
    assert both.as_built().prior.mean[0] < alone.as_built().prior.mean[0]
    assert both.as_built().prior.sd[0] < alone.as_built().prior.sd[0]


def test_a_calibrated_case_keeps_its_things_under_a_name_of_its_own(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "case.toml").write_text(
        SIX + 'drive.kv = 900\ndrive.cells = 3\nreferences = "references.csv"\nnotes = "mine"\n'
    )
    header = "quantity,value,unit,uncertainty,kind,source,rpm,airspeed_m_s,density_kg_m3,remark"
    (here / "references.csv").write_text(f"{header}\nthrust,4.9,N,0.1,bench,stand,6000,0,1.225,\n")
    (here / "run.csv").write_text("rpm,thrust_N,torque_Nm\n5000,3.4,0.055\n6000,4.9,0.079\n7000,6.8,0.107\n")
    assert main(["calibrate-rotor", "run.csv", "--case", ".", "--out", "measured"]) == 0
    shown = capsys.readouterr().out
    assert "one flight point" in shown and "next:" in shown and "measured: references.csv" in shown
    known = load_case("measured")
    assert known.name == "prop_10x5_measured" and known.file.drive is not None and known.file.notes == "mine"
    assert not any(item.key.startswith("blade.") for item in known.assumptions)
    assert main(["sweep", "case.toml", "measured", "--json"]) == 0  # no double name
    u = [case["rows"][0]["u"] for case in json.loads(capsys.readouterr().out)["cases"]]
    assert u[1] < u[0]
    assert main(["drive", "measured"]) == 0


@pytest.mark.parametrize(
    ("words", "diameter_m"),
    [(["--diameter-in", "2.75"], 0.06985), (["--diameter-mm", "90"], 0.09)],
)
def test_a_fan_has_a_name_and_a_diameter_in_millimetres_or_inches(
    tmp_path: Path, words: list[str], diameter_m: float
) -> None:
    assert main(["new", "EDF70", "--fan", *words, "--out", str(tmp_path / "fan")]) == 0
    case = load_case(tmp_path / "fan")
    assert (case.name, case.ducted) == ("EDF70", True)
    assert case.diameter_m == pytest.approx(diameter_m)
    assert main(["new", "70mm", "--fan", *words, "--out", str(tmp_path / "two")]) == 2
    assert main(["new", "10x5", *words, "--out", str(tmp_path / "two")]) == 2
    both = ["--diameter-mm", "90", "--diameter-in", "3"]
    assert main(["new", "EDF70", "--fan", *both, "--out", str(tmp_path / "two")]) == 2
    assert not (tmp_path / "two").exists()


def test_a_fan_says_what_it_assumed(tmp_path: Path) -> None:
    """A 10x5 with --fan is a ducted fan of 254 mm: how many blades it has was nobody's word."""
    told = bemt.new("10x5", fan=True, out=tmp_path / "a").text
    assert "assumed" in told and "blades 11" in told
    assert "blades 11" not in bemt.new("10x5", fan=True, blades=8, out=tmp_path / "b").text
    assert "assumed" not in bemt.new("10x5", out=tmp_path / "c").text


def test_a_ratio_just_above_one_is_no_per_cent(tmp_path: Path) -> None:
    bemt.new("70mm", fan=True, out=tmp_path / "a")
    file = tmp_path / "a" / "case.toml"
    text = file.read_text()
    for wrong, hint in (("1.3", ""), ("37", "write hub_ratio = 0.37")):
        file.write_text(re.sub(r"^hub_ratio = .*$", f"hub_ratio = {wrong}", text, flags=re.M))
        with pytest.raises(InputError) as caught:
            load_case(file)
        (fault,) = [f for f in caught.value.faults if f.where == "rotor.hub_ratio"]
        assert hint in fault.hint and ("percent" in fault.hint) == bool(hint)


def test_a_case_is_called_as_the_user_called_it(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A name with a size in it is a name: the folder has it, and without one nothing is taken for the label."""
    assert main(["new", "my12x6", "--stations", "blade.csv"]) == 0
    own = load_case(here / "my12x6")
    assert (own.name, own.diameter_m) == ("my12x6", pytest.approx(12 * 0.0254))
    assert main(["sweep", "my12x6", "--quiet"]) == 0
    with pytest.raises(
        InputError, match="her12x6: got no folder or case of this name; expected a case, or a label: 12x6"
    ):
        bemt.diagnose("blade.csv", "her12x6")


def test_a_folder_that_is_not_there_is_no_label(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What begins as `new` calls its folders is a folder: one's own, changed by hand, is not passed over in silence."""
    assert main(["new", "5x4.3x3"]) == 0 and (here / "prop_5x4.3x3_fpv").is_dir()
    assert main(["export", "prop_5x4.3x3", "--out", "out"]) == 2
    assert "no folder or case of this name" in (said := capsys.readouterr().err)
    assert "a label: 5x4.3x3. Meant prop_5x4.3x3_fpv?" in said
    with pytest.raises(InputError, match="prop_10x5: got no folder or case of this name; expected a case, or a label"):
        bemt.import_("blade.csv", case="prop_10x5")


@pytest.mark.parametrize("head", ["r/R,chord mm,angle deg", "r_over_R,chord_mm,angle_deg", "r/R,c [mm],Angle (deg)",
                                  "r/R,Sehne [mm],Winkel [Grad]", "r/R,corda [mm],Angolo (gradi)"])  # fmt: skip
def test_the_one_angle_of_a_blade_is_its_blade_angle(head: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "b.csv").write_text(f"{head}\n0.2,24,33\n0.5,29,17.5\n0.75,22,12\n0.97,11,9\n")
    assert main(["new", "mine", "--stations", "b.csv", "--diameter-in", "12"]) == 0
    assert "read as beta_deg" in capsys.readouterr().out
    assert main(["new", "small", "--stations", "b.csv", "--diameter-mm", "12"]) == 2
    assert "A diameter of 12 mm? 12 in is --diameter-in 12" in capsys.readouterr().err


def test_a_blade_that_needs_the_network_is_told_what_to_install(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A thickness of one's own is no section of the shipped table; without it the base install solves the blade."""
    monkeypatch.setattr("bemt.base.cache.is_installed", lambda package: package != "neuralfoil")
    rows = (0.2, 24, 33, 4.8), (0.5, 29, 17.5, 5.2), (0.75, 22, 12, 3.5), (0.97, 11, 9, 1.4)
    for name, width in (("thick", 4), ("plain", 3)):
        head = ",".join(("r/R", "chord_mm", "beta_deg", "t_mm")[:width])
        body = "".join(",".join(map(str, row[:width])) + "\n" for row in rows)
        (here / f"{name}.csv").write_text(f"{head}\n{body}")
        assert main(["new", name, "--stations", f"{name}.csv", "--diameter-mm", "254"]) == 0
        assert ("bemt[neuralfoil]" in capsys.readouterr().out) == (name == "thick")


def test_a_blade_without_an_angle_is_told_what_was_understood(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "b.csv").write_text("Radius [mm];Sehne [mm];Wnkl [Grad]\n20;24;33\n50;29;17\n")
    assert main(["new", "mine", "--stations", "b.csv", "--diameter-mm", "110"]) == 2
    assert "Understood: 'Radius [mm]' as r, 'Sehne [mm]' as chord" in capsys.readouterr().err


def test_two_fans_that_new_wrote_can_be_swept_together(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A fan that nobody calls by a name has that of its folder; the name of a propeller says its size, as a check."""
    for words in ((), ("--out", "edf12", "--blades", "12")):
        assert main(["new", "70mm", "--fan", *words]) == 0
    assert main(["new", "EDF", "--fan", "--diameter-mm", "70", "--out", "mine"]) == 0
    assert [load_case(here / name).name for name in ("fan_70", "edf12", "mine")] == ["fan_70", "edf12", "EDF"]
    assert main(["new", "10x5", "--out", "ten"]) == 0 and load_case(here / "ten").name == "prop_10x5"
