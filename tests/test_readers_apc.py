"""The promise of bemt.data.readers.apc: PE0 and PER3 in SI units, checked against themselves, nothing dropped."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bemt.base import units
from bemt.base.errors import InputError
from bemt.data import readers as importers
from bemt.data.readers import apc
from bemt.physics.dataset import Dataset

NAMES = ["STATION", "CHORD", "PITCH", "PITCH", "PITCH", "SWEEP", "THICKNESS", "TWIST", "MAX-THICK", "CROSS-SECTION"]
NAMES += ["ZHIGH", "CGY", "CGZ"]
UNITS = "(IN) (IN) (QUOTED) (LE-TE) (PRATHER) (IN) RATIO (DEG) (IN) (IN**2) (IN) (IN) (IN)".split()


def pe0(designation: str = "10x4.7SF", R: float = 5.0, blades: int = 2, pitch: float = 4.7, extra: int = 0) -> str:
    """Make a PE0 file of made-up numbers; ``extra`` puts a 14th column in after the chord."""
    rows = []
    for r in (0.2 * R, 0.5 * R, 0.75 * R, R):
        chord, ratio = 0.8 - 0.1 * r / R, 0.12
        row = [r, chord, pitch, pitch, 0.9 * pitch, 0.3, ratio, math.degrees(math.atan(pitch / (2 * math.pi * r)))]
        row += [ratio * chord, 0.05, 0.2, 0.1, 0.02]
        rows.append([*row[:2], *[7.0] * extra, *row[2:]])
    names, kinds = ([*x[:2], *["NEW"] * extra, *x[2:]] for x in (NAMES, UNITS))
    table = "\n".join("  ".join(f"{x:.4f}" for x in row) for row in rows)
    return (
        f"{designation}        ({designation.replace('.', '')}.dat)\nv2022-0215\n\n"
        "  ----- AIRFOIL SUMMARY DATA -----\n\n"
        f"  {'  '.join(names)}\n  {'  '.join(kinds)}\n\n{table}\n\n\n RADIUS:  {R:.2f}    PROPELLER RADIUS (IN)\n"
        f" HUBTRA:  0.83    HUB TRANSITION (IN)\n BLADES:  {blades}       NUMBER OF BLADES\n\n"
        " AIRFOIL1:  0.95, E63         (Transition Start, Airfoil 1)\n"
        " AIRFOIL2:  3.66, APC12       (Transition End, Airfoil 2)\n NOTE: APC12 airfoil is equivalent to NACA 4412\n"
    )


def per3(designation: str = "13.4x13.5-3", file: str = "134x135-3", D: float = 13.4, glued: bool = True) -> str:
    """Make a PER3 file of made-up numbers with two rpm blocks; rho 1.2256 kg/m3."""
    text = f"     {designation}     ({file}.dat)     12/19/14\n\n"
    text += "  ====== PERFORMANCE DATA (versus advance ratio and MPH) ======\n"
    text += "  J=V/nD (advance ratio)\n"
    for rpm in (3000, 6000):
        text += f"\n   PROP RPM =       {rpm}\n\n   V   J   Pe   Ct   Cp   PWR   Torque   Thrust\n"
        text += "   (mph)  (Adv Ratio)    (Hp)  (In-Lbf)  (Lbf)\n"
        n, d = rpm / 60, D * 0.0254
        for J in (0.0, 0.4, 0.8):
            CT, CP = 0.1 - 0.08 * J, 0.05 - 0.02 * J
            T, P = CT * 1.2256 * n**2 * d**4, CP * 1.2256 * n**3 * d**5
            Q = P / (2 * math.pi * n)
            text += f"  {J * n * d / units.MPH:9.1f} {J:11.2f}"
            if glued and (rpm, J) == (6000, 0.4):
                text += "-NaN        -NaN        -NaN        -NaN        -NaN        -NaN\n"
            else:
                text += f" {J * CT / CP:11.4f} {CT:11.4f} {CP:11.4f} {P / units.HP:11.3f}"
                text += f" {Q / (units.LBF * units.INCH):11.3f} {T / units.LBF:11.3f}\n"
    return text


def save(tmp_path: Path, text: str, name: str = "file.txt") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("10x5E", (10.0, 5.0, 2)), ("10x4.7SF", (10.0, 4.7, 2)), ("10x47SF", (10.0, 4.7, 2)),
        ("134x135-3", (13.4, 13.5, 3)), ("11x7E-3", (11.0, 7.0, 3)), ("9x45MR-B4", (9.0, 4.5, 4)),
        ("525x475E", (5.25, 4.75, 2)), ("41x41E", (4.1, 4.1, 2)), ("88x875", (8.8, 8.75, 2)),
        ("27x13E", (27.0, 13.0, 2)), ("105x45", (10.5, 4.5, 2)), ("12x12WCAR-T6", (12.0, 12.0, 2)),
        ("propeller", None), ("2x2", None),
        ("10x99", (10.0, 9.9, 2)), ("10x0.5", None),
    ],
)  # fmt: skip
def test_designations(text: str, expected: tuple[float, float, int] | None) -> None:
    assert apc.parse_designation(text) == expected


@pytest.mark.parametrize("extra", [0, 1])
def test_pe0_in_si(tmp_path: Path, extra: int) -> None:
    blade = importers.read(save(tmp_path, pe0(extra=extra)))
    assert isinstance(blade, apc.ApcBlade)
    assert (blade.name, blade.blades, blade.version) == ("10x4.7SF", 2, "v2022-0215")
    assert blade.diameter_m == pytest.approx(0.254) and blade.pitch_m == pytest.approx(4.7 * 0.0254)
    assert blade.radius_m == pytest.approx(0.127)
    assert np.allclose(blade.r_m, np.array([1.0, 2.5, 3.75, 5.0]) * 0.0254)
    assert np.allclose(2 * math.pi * blade.r_m * np.tan(blade.beta_rad), 4.7 * 0.0254, rtol=1e-5)
    assert np.allclose(blade.chord_m / 0.0254, [0.78, 0.75, 0.725, 0.7]) and np.all(blade.t_c == 0.12)
    assert blade.notes == ("APC12 airfoil is equivalent to NACA 4412",)
    assert len(blade.provenance["sha256"]) == 64


def test_the_first_line_must_name_the_propeller(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a designation such as 10x4.7SF"):
        apc.read_pe0(save(tmp_path, pe0("thing")))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("4.7000  4.7000", "NaN  4.7000", "got NaN; expected a finite number"),
        ("0.0936", "0.3", "got MAX-THICK; expected thickness ratio x chord"),
        ("RADIUS:  5.00", "RADIUS:  4.70", "got 9.4 in; expected the diameter of 10x4.7SF, 10 in"),
        ("BLADES:  2 ", "BLADES:  x ", "BLADES: got BLADES: x"),
        (" HUBTRA", " HUBBUB", "got no line HUBTRA:"),
        ("STATION  CHORD", "STATIONS", "no station table"),
        ("SWEEP", "SWOOP", "no column sweep"),
    ],
)
def test_pe0_faults(tmp_path: Path, old: str, new: str, words: str) -> None:
    text = pe0()
    assert old in text
    with pytest.raises(InputError) as caught:
        apc.read_pe0(save(tmp_path, text.replace(old, new, 1)))
    assert words in str(caught.value)


def test_a_shifted_column_cannot_pass(tmp_path: Path) -> None:
    lines = pe0().splitlines()
    shifted = [line.replace("  0.3000  ", "  ", 1) if line.startswith("1.0000") else line for line in lines]
    with pytest.raises(InputError, match="12 numbers; expected 13"):
        apc.read_pe0(save(tmp_path, "\n".join(shifted)))
    stations = ("1.0000", "2.5000", "3.7500", "5.0000")
    both = [f"{line.replace('  0.3000  ', '  ', 1)}  0.0" if line[:6] in stations else line for line in lines]
    with pytest.raises(InputError, match="Have columns shifted"):
        apc.read_pe0(save(tmp_path, "\n".join(both)))


def test_per3_glued_nan_is_kept_and_flagged(tmp_path: Path) -> None:
    perf = importers.read(save(tmp_path, per3()))
    assert isinstance(perf, apc.ApcPerformance)
    s = perf.series
    assert (perf.blades, s.kind, len(s)) == (3, "vendor", 6)
    assert perf.diameter_m == pytest.approx(13.4 * 0.0254) and perf.pitch_m == pytest.approx(13.5 * 0.0254)
    assert s["rpm"].tolist() == [3000.0] * 3 + [6000.0] * 3 and s["J"].tolist() == [0.0, 0.4, 0.8] * 2
    assert s.flags == ((), (), (), (), ("NaN in the file",), ())
    assert np.isnan(s["CT"]).tolist() == [False, False, False, False, True, False]
    assert s["airspeed_m_s"][4] == pytest.approx(0.4 * 100 * 13.4 * 0.0254, rel=2e-3)
    assert "not measured" in s.provenance["remark"]


def test_per3_units(tmp_path: Path) -> None:
    s = apc.read_per3(save(tmp_path, per3(glued=False))).series
    rebuilt = s.select(s["rpm"] == 6000.0)
    direct = Dataset("vendor", "x", {k: rebuilt[k] for k in ("rpm", "CT", "CP", "J")}).derive(13.4 * 0.0254, 1.2256)
    for name in ("thrust_N", "torque_Nm", "power_W"):
        assert np.allclose(rebuilt[name], direct[name], rtol=2e-3)


def test_per3_sizes_without_points(tmp_path: Path) -> None:
    perf = apc.read_per3(save(tmp_path, per3(designation="134x135-3")))
    assert perf.diameter_m == pytest.approx(13.4 * 0.0254) and perf.blades == 3


def test_per3_diameter_must_agree_with_the_rows(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"V/\(n J\) = 13.4. in; expected the diameter of 10x5, 10 in"):
        apc.read_per3(save(tmp_path, per3(designation="10x5", file="10x5")))


def test_per3_wide_form_uses_its_si_columns(tmp_path: Path) -> None:
    names = "PWR Torque Thrust PWR Torque Thrust THR/PWR Mach Reyn FOM\n"
    text = per3(glued=False).replace("PWR   Torque   Thrust\n", names)
    rows = []
    for line in text.splitlines():
        wide = len(line.split()) == 8 and line.split()[0][0].isdigit()
        rows.append(line + "  11.5 0.25 3.125 9.9 0.1 50000 0.5" if wide else line)
    s = apc.read_per3(save(tmp_path, "\n".join(rows))).series
    assert set(s["power_W"]) == {11.5} and set(s["torque_Nm"]) == {0.25} and set(s["thrust_N"]) == {3.125}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("0.1000", "0.1000 junk", "Repair or delete the row"),
        ("0.1000", "", "expected 8 numbers"),
        ("PROP RPM =       3000", "PROP RPM =       ?", "PROP RPM = ?"),
        ("Ct   Cp", "Cq   Cp", "An unknown form of this file"),
    ],
)
def test_per3_faults(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        apc.read_per3(save(tmp_path, per3().replace(old, new, 1)))
    assert words in str(caught.value)


def test_the_published_files_import(shared_data: Path) -> None:
    blades = {p.name: apc.read_pe0(p) for p in sorted((shared_data / "apc").glob("*.PE0"))}
    assert len(blades) == 17
    assert blades["11x7E-3-PERF.PE0"].blades == 3
    assert blades["10x47SF-PERF.PE0"].pitch_m == pytest.approx(4.7 * 0.0254)
    for blade in blades.values():
        assert blade.r_m[-1] == pytest.approx(blade.radius_m)
        r = 0.75 * blade.radius_m
        mid = 2.0 * math.pi * r * math.tan(np.interp(r, blade.r_m, blade.beta_rad))
        assert mid == pytest.approx(blade.pitch_m, rel=0.25)


def test_the_published_tables_are_consistent(shared_data: Path) -> None:
    counts = {}
    for path in sorted((shared_data / "apc").glob("PER3_*.dat")):
        perf = apc.read_per3(path)
        counts[perf.name] = (len(perf.series), sum(bool(f) for f in perf.series.flags))
        s = perf.series.select(perf.series["thrust_N"] > 10.0)
        rho = s["thrust_N"] / (s["CT"] * (s["rpm"] / 60) ** 2 * perf.diameter_m**4)
        assert np.median(rho) == pytest.approx(1.2256, rel=1e-3)  # the tables are for the standard atmosphere
    assert counts == {"10x5E": (630, 0), "10x7SF": (540, 4), "12x6": (540, 1), "14x8": (420, 0), "8x4E": (780, 0)}


@settings(max_examples=80, deadline=None)
@given(
    which=st.sampled_from(["pe0", "per3"]), at=st.integers(0, 1800), length=st.integers(0, 60),
    junk=st.text("0123456789.-+eENaIf*x\n \xe9", max_size=12),
)  # fmt: skip
def test_damage_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, which: str, at: int, length: int, junk: str
) -> None:
    text = pe0() if which == "pe0" else per3()
    path = save(tmp_path_factory.mktemp("fuzz"), text[:at] + junk + text[at + length :])
    try:
        found = apc.read(path)
    except InputError as error:
        assert all(fault.got and fault.expected for fault in error.faults)
    else:
        if isinstance(found, apc.ApcBlade):
            assert np.all(np.isfinite(found.beta_rad)) and np.all(found.chord_m > 0) and np.all(np.diff(found.r_m) > 0)
        else:
            odd = np.isnan(found.series["CT"])
            assert all(flags for flags, nan in zip(found.series.flags, odd, strict=True) if nan)
