"""The promise of the readers of design tools: blades become cases that solve, or faults are told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.data.readers import blade, detect
from bemt.data.readers.stations import read_stations
from bemt.physics.sections.parametric import QpropSection, XrotorSection, fit_qprop, fit_xrotor
from bemt.rotors.case import load_case
from bemt.rotors.case.prepare import prepare_case

QPROP = """
A 6x3 folder

 2   0.0762     ! Nblades  [ R ]

 0.50   5.8   ! CL0  CL_a
-0.40   1.2   ! CLmin  CLmax

 0.028  0.050 0.020 0.5   !  CD0  CD2u CD2l CLCD0
 70000   -0.7              !  REref  REexp

 0.0254  0.0254   1.0    !  Rfac   Cfac   Bfac
 0.0     0.0      0.0    !  Radd   Cadd   Badd

#  r     c     beta
  0.75  0.66  27.5
  1.00  0.69  22.0
  1.50  0.63  15.2
  2.00  0.55  10.2
  2.50  0.44   6.5
  2.875 0.30   4.6
  3.00  0.19   4.2
"""
SECTION = """!   Xisection
   0.0000
!       A0deg        dCLdA        CLmax         CLmin
  -1.5000       6.1000       1.3000     -0.60000
!  dCLdAstall     dCLstall      Cmconst         Mcrit
   0.1000       0.10000     -0.10000      0.62000
!       CDmin      CLCDmin     dCDdCL^2
  0.12000E-01   0.4500      0.10000E-01
!       REref        REexp
   150000.     -0.40000
"""
XROTOR = f"""XROTOR VERSION:  7.55
A blade
!         Rho          Vso          Rmu           Alt
   1.2260       340.00      0.17800E-04   999.00
!         Rad          Vel          Adv          Rake
  0.1000  10.000      0.10   0.0000
!         XI0          XIW
  0.15      0.15
!  Naero
     1
{SECTION}!LVDuct  LDuct   LWind
  T       F       F
!   II Nblds
    4     3
!         r/R          C/R     Beta0deg         Ubody
  0.2000      0.2000       40.0       0.0000
  0.4000      0.2200       25.0       0.0000
  0.7000      0.1800       16.0       0.0000
  0.9900      0.0800       11.0       0.0000
!      URDuct
   1.0000
"""
DFDC = f"""DFDC Version  0.70
A fan

OPER
!        Vinf         Vref          RPM
   5.0000       50.000       8000.0
!         Rho          Vso          Rmu           Alt
   1.2260       340.00      0.17800E-04   0.0000
!       XDwake        Nwake
  0.80000               20
!       Lwkrlx
            F
ENDOPER

AERO
!  #sections
     1
{SECTION}ENDAERO

ROTOR
!       Xdisk        Nblds       NRPdef
  0.12000                5           11
!  #stations
     4
!           r        Chord         Beta
  0.050    0.050   50.0
  0.080    0.045   38.0
  0.110    0.040   31.0
  0.145    0.035   26.0
ENDROTOR

GEOM
walls
  0.30  0.040
  0.00  0.040
 -0.03  0.000
 999.0 999.0
  0.30  0.170
  0.00  0.170
 -0.01  0.160
  0.00  0.150
  0.30  0.150
ENDGEOM
"""
FILES = {"qprop": QPROP, "xrotor": XROTOR, "dfdc": DFDC}
READERS = {reader.KIND: reader for reader in blade.READERS}


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    for word, text in FILES.items():
        (tmp_path / f"a.{word}").write_text(text)
    return {word: tmp_path / f"a.{word}" for word in FILES}


@pytest.mark.parametrize("word", sorted(FILES))
def test_a_file_is_known_by_its_content_and_becomes_a_case(
    word: str, files: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert detect(files[word]) == word
    out = tmp_path / "case"
    assert main(["stations", str(files[word]), "--out", str(out)]) == 0
    capsys.readouterr()
    case = load_case(out / "case.toml")
    points = prepare_case(case).solve(case.rpm, [0.0, 5.0], case.air())
    assert points.converged.all() and (points.thrust_N > 0).all() and points.thrust_N[1] < points.thrust_N[0]


def test_numbers_and_units_of_each_file(files: dict[str, Path]) -> None:
    q = blade.read_qprop(files["qprop"])
    assert (q.blades, q.R_m, q.r_m[0], q.chord_m[1]) == pytest.approx((2, 0.0762, 0.01905, 0.69 * 0.0254))
    assert np.degrees(q.beta_rad[[0, -1]]) == pytest.approx([27.5, 4.2])
    assert q.sections == [(0.0, QpropSection(0.5, 5.8, -0.4, 1.2, 0.028, 0.05, 0.02, 0.5, 70000.0, -0.7))]
    x = blade.read_xrotor(files["xrotor"])
    assert (x.blades, x.R_m, x.Rhub_m) == (3, 0.1, pytest.approx(0.015))
    assert x.rpm == pytest.approx(10.0 / (0.1 * 0.1) * 30.0 / np.pi) and x.airspeed_m_s == 10.0
    assert x.sections[0][1].a0 == pytest.approx(np.radians(-1.5)) and x.sections[0][1].reexp == -0.4
    d = blade.read_dfdc(files["dfdc"])
    assert (d.blades, d.rpm, d.airspeed_m_s) == (5, 8000.0, 5.0)
    assert (d.R_m, d.Rhub_m) == pytest.approx((0.15, 0.04))  # walls at Xdisk, not the outermost stations


def test_sections_that_fit_are_found_again() -> None:
    """A table made of a section gives the section back: lift to 1e-6, drag to 1e-4 of itself."""
    from bemt.physics.sections.polars import ALPHA_GRID, DEFAULT_RE, Polar

    known = (
        (fit_xrotor, XrotorSection(np.radians(-2.0), 6.0, 1.2, -0.7, 0.2, 0.12, 0.011, 0.35, 0.009, 1.2e5, -0.45)),
        (fit_qprop, QpropSection(0.35, 5.9, -0.5, 1.15, 0.014, 0.03, 0.02, 0.4, 1.2e5, -0.5)),
    )
    for fit, section in known:
        near = np.abs(ALPHA_GRID) < np.radians(30.0)
        cl, cd = section.cl_cd(ALPHA_GRID[:, None], DEFAULT_RE[None])
        cl = np.where(near[:, None], cl, 0.0)
        cd = np.where(near[:, None], cd, 1.0)
        found = fit(Polar(ALPHA_GRID, DEFAULT_RE, np.zeros(1), cl[..., None], cd[..., None]), 2.3e5)
        alpha = np.radians(np.linspace(-7.0, 11.0, 37))
        for Re in (1e5, 2.3e5, 4e5):
            for got, want, close in zip(found.cl_cd(alpha, Re), section.cl_cd(alpha, Re), (1e-6, 1e-4), strict=True):
                assert got == pytest.approx(want, rel=close, abs=1e-6)


@pytest.mark.parametrize(
    ("word", "old", "new", "where", "hint"),
    [
        ("qprop", "0.0762 ", "3.0 ", "R = 3", "Rfac"),
        ("qprop", "0.50   5.8", "0.50   0.1", "CL_a 0.1", "per radian"),
        ("qprop", "2.00  0.55", "1.20  0.55", "rise", ""),
        ("qprop", "2.00  0.55", "2.00  x.55", "x.55", ""),
        ("xrotor", "6.1000", "0.1060", "slope", "Per degree"),
        ("xrotor", "0.1000  10.000", "100.0  10.000", "radius", "Other units"),
        ("xrotor", "    4     3", "    7     3", "stations", ""),
        ("xrotor", "0.4000      0.2200", "0.4000      -.2200", "chords", ""),
        ("dfdc", "ROTOR\n!       Xdisk", "ACTDISK\n!       Xdisk", "actuator disk", "blade"),
        ("dfdc", "0.110    0.040", "0.110    nan", "nan", ""),
    ],
)
def test_faults_are_told_and_nothing_is_converted(
    word: str, old: str, new: str, where: str, hint: str, files: dict[str, Path]
) -> None:
    text = files[word].read_text()
    assert old in text
    files[word].write_text(text.replace(old, new))
    with pytest.raises(InputError) as caught:
        READERS[word].read(files[word])
    told = str(caught.value)
    assert where in told and hint in told and files[word].name in told


@pytest.mark.parametrize("word", sorted(FILES))
def test_a_cut_file_is_refused_and_never_half_read(word: str, files: dict[str, Path]) -> None:
    text = files[word].read_text()
    whole = READERS[word].read(files[word])
    rng = np.random.default_rng(5)
    for at in rng.integers(1, len(text) - 1, 40):
        files[word].write_text(text[: int(at)])
        try:
            cut = READERS[word].read(files[word])
        except InputError:
            continue
        assert cut.r_m.size <= whole.r_m.size and np.all(cut.chord_m > 0) and cut.blades == whole.blades


_ROWS = ((0.2, 0.16, 30.0), (0.6, 0.18, 15.0), (1.0, 0.06, 8.0))  # r/R, c/R, beta [deg]


def _table(head: str, mark: str = ",", scales: tuple[float, float, float] = (1.0, 1.0, 1.0), point: str = ".") -> str:
    rows = [[f"{v * s:.6g}".replace(".", point) for v, s in zip(row, scales, strict=True)] for row in _ROWS]
    return "\n".join([head, *(mark.join(row) for row in rows)]) + "\n"


@pytest.mark.parametrize(
    "text",
    [
        _table("r_over_R,chord_over_R,beta_deg"), _table("r/R,c/R,beta (deg)"), _table("r/R c/R beta_deg", " "),
        _table("r/R;c/R;beta_deg", ";"), _table("r/R;c/R;beta_deg", ";", point=","), _table("r/R\tc/R\tbeta_deg", "\t"),
        _table("r_mm,chord_mm,beta_deg", scales=(127.0, 127.0, 1.0)),
        _table("Radius (in),Chord (in),Blade angle (deg)", scales=(5.0, 5.0, 1.0)),
        _table("r (mm);c (mm);beta (°)", ";", (127.0, 127.0, 1.0), ","),
        _table("r/R,c/D,beta [deg]", scales=(1.0, 0.5, 1.0)), _table("x/R,chord/D,theta (deg)", scales=(1.0, 0.5, 1.0)),
        _table("r/R,c/R,beta (rad)", scales=(1.0, 1.0, np.pi / 180.0)),
        "# blade 7, scanned\n" + _table("r/R,c/R,beta_deg,t/c").replace(".16,30", ".16,30,0.1").replace(
            ".18,15", ".18,15,0.09").replace(".06,8", ".06,8,0.08"),
    ],
)  # fmt: skip
def test_stations_are_the_same_blade_however_they_are_written(text: str, tmp_path: Path) -> None:
    (tmp_path / "blade.csv").write_text(text)
    x, c, beta = read_stations(tmp_path / "blade.csv", 0.127)[:3]
    for got, want in zip((x, c, np.degrees(beta)), np.transpose(_ROWS), strict=True):
        assert np.allclose(got, want, rtol=1e-5)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        (_table("r/R,c/R,beta_deg", scales=(1.0, 8.0, 1.0)), "tip radius"),  # 1.4 R wide: a chord in another unit
        (_table("r/R,c/R,beta_deg", scales=(1.0, 1.0, np.pi / 180.0)), "radians"),
        (_table("r/R,c/R,twist_deg"), "beta_deg"),
        (_table("r/R,c/R,beta", scales=(1.0, 1.0, np.pi / 180.0)), "radians"),
        (_table("r_mm,chord_mm,beta_deg", scales=(5.0, 5.0, 1.0)), "tip radius 127 mm"),
        (_table("r/R,c/R,c/D,beta_deg"), "one of them"),
    ],
)  # fmt: skip
def test_stations_in_doubt_are_refused_with_the_likely_reason(text: str, hint: str, tmp_path: Path) -> None:
    (tmp_path / "blade.csv").write_text(text)
    with pytest.raises(InputError, match=hint):
        read_stations(tmp_path / "blade.csv", 0.127)
