"""``new NAME``: one blade, thirty dialects of stations, one vocabulary."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.rotors.case import load_case
from bemt.rotors.case.new_folder import Wanted, write
from bemt.rotors.case.propagate import propagate
from bemt.rotors.propeller import propeller

R = 0.127
X = np.array([0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 1.0])
C = np.array([0.13, 0.17, 0.185, 0.165, 0.13, 0.1, 0.06])
BETA = np.array([33.0, 26.5, 20.0, 16.0, 13.0, 11.5, 10.0])
MM, IN, CM = 1e3 * R, R / 0.0254, 100.0 * R


def table(head: str, scales: tuple[float, float, float] = (1.0, 1.0, 1.0), mark: str = ",", point: str = ".") -> str:
    rows = np.transpose([X, C, BETA]) * scales
    return head + "\n" + "\n".join(mark.join(f"{v:.9g}".replace(".", point) for v in row) for row in rows) + "\n"


def german(head: str, *scales: float, mark: str = ";") -> str:
    return table(head, scales or (1.0, 1.0, 1.0), mark, ",")  # type: ignore[arg-type]


LENGTHS, SHARES, INCHES = (MM, MM, 1.0), (1.0, 1.0, 1.0), (IN, IN, 1.0)
DIALECTS: dict[str, str | bytes] = {
    "our own": table("r_over_R,chord_over_R,beta_deg"),
    "shares": table("r/R,c/R,beta (deg)"),
    "UIUC": table("r/R c/R beta", mark="   "),
    "UIUC with commas": table("r/R,c/R,beta"),
    "semicolons": table("r/R;c/R;beta (deg)", mark=";"),
    "tabs": table("r/R\tc/R\tbeta [deg]", mark="\t"),
    "decimal comma": german("r/R;c/R;beta (deg)"),
    "decimal comma, tabs": german("r/R\tc/R\tbeta (deg)", mark="\t"),
    "millimetres": table("r (mm),c (mm),beta (deg)", LENGTHS),
    "millimetres, words": table("Radius [mm], Chord [mm], Pitch angle [deg]", LENGTHS),
    "capitals": table("RADIUS (MM),CHORD (MM),BETA (DEG)", LENGTHS),
    "inches": table("Radial station (in),Chord (in),Blade angle (deg)", INCHES),
    "inches, no brackets": table("r_in,chord_in,beta_deg", INCHES),
    "inches in words": table("radius in inches,chord in inches,blade angle in degrees", INCHES),
    "centimetres": table("r cm;chord cm;beta °", (CM, CM, 1.0), ";"),
    "metres and radians": table("r [m],c [m],theta [rad]", (R, R, np.pi / 180)),
    "mixed": table("r/R,chord_mm,beta_deg", (1.0, MM, 1.0)),
    "over D": table("2r/D,c/D,beta (deg)", (1.0, 0.5, 1.0)),
    "per cent": table("r/R (%),c/R (%),beta (deg)", (100.0, 100.0, 1.0)),
    "per cent of R": table("r (% R),chord (% R),beta (deg)", (100.0, 100.0, 1.0)),
    "share in brackets": table("Radius [r/R],Chord [c/R],Blade angle β [°]"),
    "symbols and words": table("Radius r (mm);Chord c (mm);Blade pitch β (deg)", LENGTHS, ";"),
    "German": german("Radius [mm];Profiltiefe [mm];Einstellwinkel [°]", *LENGTHS),
    "German, units below": german("Radius;Sehne;Blattwinkel\nmm;mm;°", *LENGTHS),
    "German, Latin-1": german("Radius in Millimeter;Blattbreite in Millimeter;Blattwinkel (Grad)", *LENGTHS
                              ).encode("latin-1"),
    "French": german("Rayon (mm);Corde (mm);Angle de calage (degrés)", *LENGTHS).encode("utf-8-sig"),
    "French, over R": german("rayon/R;corde/R;calage (°)"),
    "Spanish": german("Radio (mm);Cuerda (mm);Ángulo de paso (grados)", *LENGTHS).encode("cp1252"),
    "Italian": table("Raggio [mm],Corda [mm],Calettamento [°]", LENGTHS),
    "Chinese": table("半径(mm),弦长(mm),桨叶角(°)", LENGTHS).encode("gb18030"),
    "UTF-16": german("Radius (mm)\tSehne (mm)\tEinstellwinkel (°)", *LENGTHS, mark="\t").encode("utf-16"),
    "Excel": "sep=;\n" + german("r (mm);c (mm);beta (deg)", *LENGTHS),
    "titles above": "Blade 7 scanned,,\n\n" + table("r/R,c/R,beta (deg)"),
    "a comment, and more columns": "# blade 7\n" + table("r/R,c/R,beta_deg").replace("\n", ",0.1\n").replace(
        "beta_deg,0.1", "beta_deg,t/c"),
}  # fmt: skip


@pytest.mark.parametrize("name", DIALECTS)
def test_a_name_with_stations_in_any_dialect_is_the_same_case(name: str, tmp_path: Path) -> None:
    text = DIALECTS[name]
    (tmp_path / "blade.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    write(Wanted("mine", str(tmp_path / "blade.csv"), diameter_mm=2e3 * R), str(tmp_path / "mine"))
    case = load_case(tmp_path / "mine")
    blade = case.rotor().blade
    assert case.name == "mine"
    assert np.allclose(np.interp(X * R, blade.r, blade.chord), C * R, rtol=2e-3)
    assert np.allclose(np.degrees(np.interp(X * R, blade.r, blade.beta)), BETA, rtol=2e-3)


@pytest.mark.parametrize(("head", "words"), [
    ("r,c,beta", r"r \(mm\), c \(mm\)"), ("r/R,c/R,twist (deg)", "Rename it to beta_deg if"),
    ("r/R,c/R,sweep (deg)", "beta_deg"),
    ("r (V),c/R,beta (deg)", "r_over_R"), ("r/R,chord [-],beta (deg)", "chord"), ("", "headings"),
])  # fmt: skip
def test_stations_that_leave_a_doubt_are_refused_with_what_to_write(head: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "blade.csv").write_text(table(head).lstrip())
    with pytest.raises(InputError, match=words):
        write(Wanted("mine", str(tmp_path / "blade.csv"), diameter_mm=2e3 * R), str(tmp_path / "mine"))


def test_the_hub_ends_where_the_innermost_station_is(tmp_path: Path) -> None:
    """Of a fan as well, whose hub is a third of its tip and more."""
    from bemt.rotors.case.fresh import of_stations

    for first in (21.0, 30.0, 9.0):
        (tmp_path / "b.csv").write_text(f"r_mm,chord_mm,beta_deg\n{first},24,52\n41,24,35\n59.6,20,26\n")
        assert of_stations(tmp_path / "b.csv", 0.1192)[0] == pytest.approx(first / 59.6)


def test_a_missing_file_of_stations_is_called_missing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        write(Wanted("mine", str(tmp_path / "none.csv"), diameter_mm=254.0), str(tmp_path / "mine"))


def test_a_label_that_is_misspelt_is_no_name(tmp_path: Path) -> None:
    (tmp_path / "blade.csv").write_text(DIALECTS["shares"])  # type: ignore[arg-type]
    with pytest.raises(InputError, match="label"):
        write(Wanted("10x0", str(tmp_path / "blade.csv"), diameter_mm=254.0), str(tmp_path / "mine"))


def test_stations_from_the_tip_inwards_are_the_same_blade_and_two_stations_know_less_than_ten(tmp_path: Path) -> None:
    x = np.linspace(0.15, 1.0, 10)
    rows = [f"{r:.3f},{0.2 - 0.1 * r:.4f},{np.degrees(np.arctan2(0.16, r)):.3f}\n" for r in x]
    bands = {}
    for name, lines in {"up": rows, "down": rows[::-1], "two": [rows[0], rows[-1]]}.items():
        (tmp_path / f"{name}.csv").write_text("r/R,c/R,beta_deg\n" + "".join(lines))
        write(Wanted(name, str(tmp_path / f"{name}.csv"), diameter_mm=254.0, rpm=6000.0), str(tmp_path / name))
        points = propagate(load_case(tmp_path / name), 6000.0, 0.0).points
        bands[name] = points.thrust_N[0], points.u["thrust_N"][0] / points.thrust_N[0]
    assert bands["down"] == pytest.approx(bands["up"], rel=1e-12)
    assert bands["two"][1] > 1.2 * bands["up"][1]


@pytest.mark.parametrize(("head", "scale"), [
    ("Dicke [%]", 100.0), ("thickness", 1.0), ("t/c", 1.0), ("max thickness (mm)", 1e3 * R * C), ("t/c %", 100.0),
])  # fmt: skip
def test_a_measured_thickness_is_the_sections(head: str, scale: float | np.ndarray, tmp_path: Path) -> None:
    T = np.array([0.15, 0.13, 0.12, 0.11, 0.1, 0.09, 0.08])
    rows = np.transpose([X, C, BETA, T * scale, 0.1 * X])
    (tmp_path / "blade.csv").write_text(
        f"r/R;c/R;beta (deg);{head};Skew\n" + "".join(";".join(f"{v:.9g}" for v in row) + "\n" for row in rows)
    )
    _, _, notes = write(Wanted("mine", str(tmp_path / "blade.csv"), diameter_mm=2e3 * R), str(tmp_path / "mine"))
    case = load_case(tmp_path / "mine")
    assert np.allclose(case.file.blade.section.thickness, T, rtol=2e-3)
    assert not any(a.key == "blade.section.thickness" for a in case.file.assumptions)
    assert [note.split("'")[1] for note in notes if "not used" in note] == ["Skew"]


def test_a_thickness_that_no_section_has_is_named_not_used(tmp_path: Path) -> None:
    rows = np.transpose([X, C, BETA, 12.0 + X])
    text = "r/R,c/R,beta (deg),thickness\n" + "".join(",".join(f"{v:.9g}" for v in row) + "\n" for row in rows)
    (tmp_path / "blade.csv").write_text(text)
    _, _, notes = write(Wanted("mine", str(tmp_path / "blade.csv"), diameter_mm=2e3 * R), str(tmp_path / "mine"))
    (note,) = (n for n in notes if not n.startswith("taken: "))
    assert "thickness" in note and load_case(tmp_path / "mine").file.blade.section.thickness == 0.09


def test_a_diameter_is_given_in_the_same_words_at_both_doors(tmp_path: Path) -> None:
    (tmp_path / "blade.csv").write_text(DIALECTS["shares"])  # type: ignore[arg-type]
    made = [propeller(stations=tmp_path / "blade.csv", **{k: v}) for k, v in
            (("diameter_in", 10.0), ("diameter_mm", 254.0), ("diameter_m", 0.254))]  # fmt: skip
    assert [p.diameter_m for p in made] == pytest.approx([0.254] * 3)
    with pytest.raises(InputError, match="one of them"):
        propeller(stations=tmp_path / "blade.csv", diameter_in=10.0, diameter_m=0.254)
