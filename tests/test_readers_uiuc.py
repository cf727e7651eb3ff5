"""The promise of bemt.data.readers.uiuc: every file of the archive imports, or is refused with a reason."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bemt.base.errors import InputError, refuse
from bemt.data import readers as importers
from bemt.data.readers import uiuc
from bemt.data.readers.uiuc_names import parse_file_name

GEOMETRY = "r/R    c/R     beta\n0.15 0.11 {0:.3f}\n0.50 0.18 {1:.3f}\n0.75 0.15 {2:.3f}\n1.00 0.05 {3:.3f}\n"
STATIC = "RPM    CT       CP\n2000.0 0.0950 0.0450\n4000.0 0.1000 0.0455\n"
LINE = "J    CT      CP      eta\n0.200 0.0900 0.0450 0.400\n0.400 0.0700 0.0430 0.651\n0.600 0.0400 0.0330 0.727\n"


def geometry(beta75: float = 15.0) -> str:
    return GEOMETRY.format(beta75 + 20, beta75 + 6, beta75, beta75 - 4)


def sound(path: Path) -> list[uiuc.UiucPropeller]:
    """Propellers of a folder without faults."""
    folder = uiuc.scan_folder(path)
    refuse(folder.faults)
    return list(folder.propellers)


def write(folder: Path, **files: str) -> Path:
    for stem, text in files.items():
        (folder / f"{stem}.txt").write_text(text)
    return folder


@pytest.mark.parametrize(
    ("stem", "diameter", "pitch", "blades"),
    [
        ("apce_10x5_geom", 10.0, 5.0, 2), ("apccf_7.4x8.25_static_2883cm", 7.4, 8.25, 2),
        ("apce_17x12_jb1092e_2000", 17.0, 12.0, 2), ("zin_11x7_3011TG_5016", 11.0, 7.0, 2),
        ("vp_140x45_0591rd_4991", 140 / 25.4, 45 / 25.4, 2), ("pl_57x20_geom", 57 / 25.4, 20 / 25.4, 2),
        ("pl_100x80_static_0581rd", 100 / 25.4, 80 / 25.4, 2), ("kpf_96x70_geom", 96 / 25.4, 70 / 25.4, 2),
        ("pl_triturbo_static_0566rd", 2.55, None, 2), ("union_u80_geom", 3.15, None, 2),
        ("cfnq_45p2_static_1323rd", 1.85, None, 2), ("mit_5x4_0363rd_3032", 5.0, 4.0, 3),
        ("da4022_9x6.75_4b_1086ga_2034", 9.0, 6.75, 4), ("ancf_125x75_static_0914od", 12.5, 7.5, 2),
        ("ancf_125x6_0925od_3027", 12.5, 6.0, 2), ("ancf_12x65_static_0806od", 12.0, 6.5, 2),
        ("ancf_12x13_0784od_4015", 12.0, 13.0, 2), ("ancf_11x10_geom", 11.0, 10.0, 2),
        ("apce_19x12_geom", 19.0, 12.0, 2), ("apcr-rh_9x4.5_0678rd_4000", 9.0, 4.5, 2),
    ],
)  # fmt: skip
def test_sizes_from_names(stem: str, diameter: float, pitch: float | None, blades: int) -> None:
    file = parse_file_name(stem)
    assert file is not None and not file.propeller.faults
    assert file.propeller.diameter_in == pytest.approx(diameter, rel=1e-12)
    assert file.propeller.pitch_in == (None if pitch is None else pytest.approx(pitch, rel=1e-12))
    assert file.propeller.blades == blades


def test_rpm_and_rotation_from_names_with_a_run_and_a_specimen() -> None:
    line = parse_file_name("gwsdd_2.5x0.8_spec3_0475rd_15023")
    assert line is not None and (line.role, line.rpm) == ("line", 15023.0)
    assert line.propeller.name == "gwsdd_2.5x0.8_spec3"
    pusher, tractor = parse_file_name("cfnq_45p1_geom"), parse_file_name("cfnq_45t1_geom")
    assert pusher is not None and tractor is not None
    assert (pusher.propeller.rotation, tractor.propeller.rotation) == (-1, 1)
    angled = parse_file_name("nr640_9_20deg_1048rd_3020")
    assert angled is not None and angled.propeller.angle_deg == 20.0
    assert angled.propeller.pitch_in == pytest.approx(0.75 * np.pi * 9 * np.tan(np.radians(20)))


def test_a_lost_decimal_point_is_refused_not_guessed(tmp_path: Path) -> None:
    write(tmp_path, xyz_12x65_static_01ab=STATIC, xyz_12x65_geom=geometry(), apce_9x6_static_01ab=STATIC)
    folder = uiuc.scan_folder(tmp_path)
    assert [p.name for p in folder.propellers] == ["apce_9x6"]
    (fault,) = folder.faults
    assert "pitch/diameter 5.42" in fault.got and "decimal point" in fault.hint and "2 files" in fault.file


def test_unknown_model_name_is_refused_with_a_reason(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="size 'turbo9'; expected a size such as 10x5"):
        sound(write(tmp_path, foo_turbo9_static_1rd=STATIC))


def test_groups_geometry_static_and_lines(tmp_path: Path) -> None:
    write(
        tmp_path, apce_10x5_geom=geometry(), apce_10x5_static_pg0827=STATIC, apce_10x5_pg0829_6014=LINE,
        apce_10x5_pg0828_4014=LINE,
    )  # fmt: skip
    (prop,) = sound(tmp_path)
    assert (prop.name, prop.family, prop.blades) == ("apce_10x5", "apce", 2)
    assert prop.geometry is not None and prop.geometry.origin == "own" and prop.geometry.beta_deg[2] == 15.0
    static = prop.static
    assert static is not None and static.rpm.tolist() == [2000.0, 4000.0]
    assert [line.rpm for line in prop.lines] == [4014.0, 6014.0]
    assert prop.lines[0].rows == (2, 3, 4) and Path(prop.lines[0].file).name == "apce_10x5_pg0828_4014.txt"
    assert prop.diameter_m == pytest.approx(0.254)


def test_two_static_runs_are_joined(tmp_path: Path) -> None:
    write(tmp_path, apce_10x5_static_a1234=STATIC, apce_10x5_static_b1235=STATIC)
    (prop,) = sound(tmp_path)
    assert len(prop.statics) == 2 and prop.static is not None and len(prop.static.rpm) == 4


def test_shared_rotated_and_design_geometry(tmp_path: Path) -> None:
    write(
        tmp_path, nr640_9_15deg_geom=geometry(16.4), nr640_9_15deg_3b_static_01ab=STATIC,
        nr640_9_20deg_static_02ab=STATIC, nr640_5_20deg_static_03ab=STATIC, nr640_geom=geometry(15.0),
        nr640_thick="r/R t/c\n0.3 0.35\n0.95 0.08\n",
    )  # fmt: skip
    by_name = {p.name: p for p in sound(tmp_path)}
    assert set(by_name) == {"nr640_9_15deg", "nr640_9_15deg_3b", "nr640_9_20deg", "nr640_5_20deg"}
    found = {n: (p.geometry.origin, round(p.geometry.rotation_deg, 9)) for n, p in by_name.items() if p.geometry}
    assert found == {
        "nr640_9_15deg": ("own", 0.0), "nr640_9_15deg_3b": ("shared", 0.0), "nr640_9_20deg": ("rotated", 5.0),
        "nr640_5_20deg": ("design", 5.0),
    }  # fmt: skip
    turned = by_name["nr640_9_20deg"].geometry
    assert turned is not None and turned.beta_deg[2] == pytest.approx(21.4)
    assert all(p.thickness is not None and p.thickness.t_c[0] == 0.35 for p in by_name.values())
    assert by_name["nr640_9_15deg_3b"].blades == 3


def test_pitch_variants_turn_by_the_nominal_angle(tmp_path: Path) -> None:
    (tmp_path / "da4052_9x6.75_geom.txt").write_text(geometry(18.8))
    (tmp_path / "da4052_9x4.76_static_1060rd.txt").write_text(STATIC)
    (tmp_path / "da4052_9x8.95_static_1066ga.txt").write_text(STATIC)
    by_name = {p.name: p.geometry for p in sound(tmp_path)}
    low, high = by_name["da4052_9x4.76"], by_name["da4052_9x8.95"]
    assert low is not None and high is not None
    # the site heads these "-5 deg" and "+5 deg" of 9x6.75
    assert low.rotation_deg == pytest.approx(-5.0, abs=0.05) and high.rotation_deg == pytest.approx(5.0, abs=0.25)


def test_other_families_never_lend_geometry(tmp_path: Path) -> None:
    write(tmp_path, apce_10x5_geom=geometry(), apce_10x7_static_1234ab=STATIC)
    by_name = {p.name: p for p in sound(tmp_path)}
    assert by_name["apce_10x7"].geometry is None


def test_a_refused_geometry_is_not_replaced(tmp_path: Path) -> None:
    write(
        tmp_path, nr640_9_20deg_geom=geometry().replace("0.75 0.15", "0.75 nan"), nr640_9_20deg_static_1ab=STATIC,
        nr640_geom=geometry(),
    )  # fmt: skip
    folder = uiuc.scan_folder(tmp_path)
    assert len(folder.faults) == 1 and folder.propellers[0].geometry is None


def test_volumes_stay_apart(tmp_path: Path) -> None:
    for volume in ("volume-1", "volume-2"):
        (tmp_path / volume / "data").mkdir(parents=True)
        write(tmp_path / volume / "data", gwsdd_9x5_static_0797rd=STATIC)
    write(tmp_path / "volume-1" / "data", gwsdd_9x5_geom=geometry())
    one, two = sound(tmp_path)
    assert one.name == two.name and one.folder != two.folder
    assert one.geometry is not None and two.geometry is None


@pytest.mark.parametrize(
    ("stem", "text", "place", "words"),
    [
        ("apce_9x6_1ab_4000", LINE.replace("0.0700", "NaN"), "3:2", "CT = NaN; expected a finite number"),
        ("apce_9x6_1ab_4000", LINE.replace("0.0700", "0,0700"), "3:2", "Use a decimal point"),
        ("apce_9x6_1ab_4000", LINE.replace("0.651", "0.651 bad run"), "3", "Remove the trailing text"),
        ("apce_9x6_1ab_4000", LINE.replace(" 0.651", ""), "3", "The row is cut short"),
        ("apce_9x6_1ab_4000", LINE.split("\n", 1)[1], "1", "Is the header line missing?"),
        ("apce_9x6_1ab_4000", STATIC, "1", "This is a static table"),
        ("apce_9x6_1ab_4000", "J CT CP eta\n", "", "no rows"),
        ("apce_9x6_1ab_4000", "J CT CP eta\n" + "0.2 0.045 0.09 0.4\n" * 4, "2", "are columns exchanged?"),
        ("apce_9x6_static_1ab", STATIC.replace("2000.0", "33.3"), "2:1", "rev/s or rad/s"),
        ("apce_9x6_static_1ab", STATIC.replace("0.0950", "9.5"), "2:2", "rotor-convention or dimensional"),
        ("apce_9x6_geom", geometry().replace("0.75 0.15", "0.45 0.15"), "4:1", "ascending r/R"),
        ("apce_9x6_geom", geometry().replace("0.18", "18.0"), "3:2", "chord in mm"),
        ("apce_9x6_geom", GEOMETRY.format(0.6, 0.4, 0.26, 0.2), "", "Are these radians?"),
        ("apce_9x6_geom", geometry().rsplit("\n", 2)[0] + "\n", "", "up to r/R = 0.9"),
    ],
)
def test_faults_name_line_and_column(tmp_path: Path, stem: str, text: str, place: str, words: str) -> None:
    folder = uiuc.scan_folder(write(tmp_path, **{stem: text}))
    assert not folder.propellers
    assert any(fault.where == place and words in str(fault) for fault in folder.faults), folder.faults


def test_all_faulty_rows_are_named_at_once(tmp_path: Path) -> None:
    path = tmp_path / "apce_9x6_1ab_4000.txt"
    path.write_text(LINE.replace("0.0900", "x").replace("0.0400", "inf"))
    with pytest.raises(InputError) as caught:
        uiuc.read_line(path)
    assert [fault.where for fault in caught.value.faults] == ["2:2", "4:2"]


def test_line_needs_its_rpm(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text(LINE)
    with pytest.raises(InputError, match="no rpm in the file name"):
        uiuc.read_line(path)


def test_line_endings_marks_comments_and_missing_eta(tmp_path: Path) -> None:
    path = tmp_path / "apce_9x6_1ab_4000.txt"
    path.write_bytes(b"\xef\xbb\xbf# comment\r\nJ CT CP\r\n0.2\t0.09\t0.045\r\n\r\n")
    line = uiuc.read_line(path)
    assert line.rows == (3,) and line.eta[0] == pytest.approx(0.4)


def test_repeats_are_kept_and_flagged(tmp_path: Path) -> None:
    path = tmp_path / "apce_9x6_static_1ab.txt"
    path.write_text("RPM CT CP\n2000 0.1 0.05\n2000 0.1 0.05\n1990 0.1 0.05\n")
    assert uiuc.read_static(path).flags == ((), ("rpm repeated",), ("rpm goes back",))


def test_foreign_files_are_named_not_swallowed(tmp_path: Path) -> None:
    write(tmp_path, apce_9x6_static_1ab=STATIC, notes="hello", stray=LINE)
    (tmp_path / "apce_9x6_geom.png").write_bytes(b"\x89PNG\0\0")
    folder = uiuc.scan_folder(tmp_path)
    assert sorted(Path(name).name for name, _ in folder.ignored) == ["apce_9x6_geom.png", "notes.txt"]
    assert ["stray" in fault.got for fault in folder.faults] == [True]


def test_the_extension_decides_nothing(tmp_path: Path) -> None:
    (tmp_path / "apce_9x6_static_1ab.dat").write_text(STATIC)
    (prop,) = sound(tmp_path)
    assert prop.static is not None
    assert isinstance(importers.read(tmp_path / "apce_9x6_static_1ab.dat"), uiuc.UiucStatic)


def test_a_packed_table_is_read_as_the_plain_one(tmp_path: Path) -> None:
    (tmp_path / "apce_9x6_static_1ab.txt.gz").write_bytes(gzip.compress(STATIC.encode()))
    (tmp_path / "apce_9x6_static_1ab.txt").write_text(STATIC)
    packed, plain = (importers.read(tmp_path / f"apce_9x6_static_1ab.{end}") for end in ("txt.gz", "txt"))
    assert np.array_equal(packed.CT, plain.CT) and packed.rows == plain.rows


def test_registry_finds_importers_and_asks_when_two_match(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = importers.importers()
    assert {"uiuc", "apc", "references"} <= set(known)
    path = tmp_path / "x.txt"
    path.write_text(STATIC)
    monkeypatch.setattr(known["apc"], "sniff", lambda head: True)
    with pytest.raises(InputError, match='claimed by apc, uiuc; expected one format. Give format = "apc" or format'):
        importers.detect(path)
    assert isinstance(importers.read(path, format="uiuc"), uiuc.UiucStatic)
    path.write_text("nothing known")
    monkeypatch.undo()
    with pytest.raises(InputError, match="content of no known format"):
        importers.read(path)
    with pytest.raises(InputError, match="got 'elf'; expected one of .*apc"):
        importers.read(path, format="elf")


@settings(max_examples=100, deadline=None)
@given(
    which=st.sampled_from(["geom", "static_1ab", "1ab_4000"]), at=st.integers(0, 120), length=st.integers(0, 30),
    junk=st.text("0123456789.-+eENa,#\n \xe9", max_size=10),
)  # fmt: skip
def test_damage_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, which: str, at: int, length: int, junk: str
) -> None:
    text = {"geom": geometry(), "static_1ab": STATIC, "1ab_4000": LINE}[which]
    folder = write(tmp_path_factory.mktemp("fuzz"), **{f"apce_9x6_{which}": text[:at] + junk + text[at + length :]})
    scan = uiuc.scan_folder(folder)
    assert bool(scan.propellers) != bool(scan.faults)
    for p in scan.propellers:
        tables: list[uiuc.UiucStatic | uiuc.UiucLine] = [*p.statics, *p.lines]
        assert all(np.all(np.isfinite(t.CT)) and np.all(np.isfinite(t.CP)) for t in tables)


@pytest.mark.parametrize(
    ("volume", "propellers", "lines", "points"), [("volume-1", 92, 606, 11145), ("volume-2", 38, 176, 3165)]
)
def test_the_whole_archive_imports(shared_data: Path, volume: str, propellers: int, lines: int, points: int) -> None:
    folder = uiuc.scan_folder(shared_data / "uiuc" / volume)
    assert not folder.faults and not folder.ignored
    assert len(folder.propellers) == propellers
    assert sum(len(p.lines) for p in folder.propellers) == lines
    assert sum(t.CT.size for p in folder.propellers for t in (*p.statics, *p.lines)) == points
    for p in folder.propellers:
        assert 2.0 < p.diameter_in < 20.0 and len(p.statics) == 1
        assert p.geometry is None or p.geometry.r_R[-1] == 1.0


def test_volume_2_has_geometry_for_every_propeller(shared_data: Path) -> None:
    props = {p.name: p for p in sound(shared_data / "uiuc" / "volume-2")}
    assert all(p.geometry is not None for p in props.values())
    assert {n for n, p in props.items() if p.geometry and p.geometry.origin != "own"} == {
        "nr640_5_15deg_3b", "nr640_5_15deg_4b", "nr640_5_20deg",
        "nr640_9_15deg_3b", "nr640_9_15deg_4b", "nr640_9_20deg",
    }  # fmt: skip
    assert {n: p.blades for n, p in props.items() if p.blades != 2} == {
        "nr640_5_15deg_3b": 3, "nr640_5_15deg_4b": 4, "nr640_9_15deg_3b": 3, "nr640_9_15deg_4b": 4,
    }  # fmt: skip
