"""Polars come back as filed, continue to +-180 deg, or are refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.data import readers as importers
from bemt.data.readers import polars, polars_c81
from bemt.physics.sections.polars import ALPHA_GRID, DEFAULT_RE, Polar

KINDS = {reader.KIND: reader for reader in (*polars.READERS, polars_c81)}
ALPHA = np.arange(-12.0, 16.5, 1.0)


def cl_of(a_deg: np.ndarray, Re: float = 1e5, M: float = 0.0) -> np.ndarray:
    """Lift with a stall at 12 deg, rounded as files print it."""
    a = np.asarray(a_deg, dtype=float)
    shape = 0.1 * (a + 2.0) * np.where(a < 10.0, 1.0, 1.0 - 0.02 * (a - 10.0) ** 2)
    return np.round(shape * (1.0 + 0.05 * math.log10(Re / 1e5) + M), 4)


def cd_of(a_deg: np.ndarray, Re: float = 1e5, M: float = 0.0) -> np.ndarray:
    """Drag above zero, rounded as files print it."""
    return np.round((0.015 + 2e-4 * np.asarray(a_deg, dtype=float) ** 2) * (1e5 / Re) ** 0.3 * (1.0 + M), 4)


def csv(re_list: list[float] | None = None, alpha: np.ndarray = ALPHA, unit: str = "deg", mark: str = ",") -> str:
    """Polar as delimited text, in descending order of alpha."""
    head = [f"alpha_{unit}", "CL", "Cd", "cm"] + (["Re"] if re_list else [])
    lines = ["# made for a test", mark.join(head)]
    for Re in re_list or [1e5]:
        for a in alpha[::-1]:
            angle = repr(math.radians(a)) if unit == "rad" else f"{a:g}"
            row = [angle, f"{cl_of(a, Re):.4f}", f"{cd_of(a, Re):.4f}", "0"] + ([f"{Re:.6g}"] if re_list else [])
            lines.append(mark.join(row))
    return "\n".join(lines) + "\n"


def xfoil(Re: float = 2e5, alpha: np.ndarray = ALPHA, mach: float = 0.0, kind: str = "1 1") -> str:
    """Polar as XFOIL 6.99 saves it."""
    law = "fixed         " if kind == "1 1" else "~ 1/sqrt(CL)  "
    lines = [
        "", "       XFOIL         Version 6.99", "  ", " Calculated polar for: NACA 4412      ", "  ",
        f" {kind} Reynolds number {law}     Mach number fixed         ", "  ",
        " xtrf =   1.000 (top)        1.000 (bottom)  ",
        f" Mach = {mach:7.3f}     Re = {Re / 1e6:9.3f} e 6     Ncrit =   7.000", "  ",
        "   alpha    CL        CD       CDp       CM     Top_Xtr  Bot_Xtr",
        "  ------ -------- --------- --------- -------- -------- --------",
    ]  # fmt: skip
    for a in alpha:
        lines.append(f"{a:8.3f}{cl_of(a, Re):9.4f}{cd_of(a, Re):10.5f}{0.005:10.5f}{-0.09:9.4f}{0.5:9.4f}{1.0:9.4f}")
    return "\n".join(lines) + "\n"


def c81(alpha: np.ndarray, machs: np.ndarray, machs_d: np.ndarray | None = None) -> str:
    """Fixed-width C81 table with lift, drag and a moment table of zeros."""
    machs_d = machs if machs_d is None else machs_d
    counts = f"{len(machs):2d}{len(alpha):2d}{len(machs_d):2d}{len(alpha):2d}{len(machs):2d}{len(alpha):2d}"
    out = ["NACA 4412 TEST".ljust(30) + counts]

    def record(first: str, values: list[float], digits: int) -> None:
        for k in range(0, len(values), 9):
            out.append((first if k == 0 else " " * 7) + "".join(f"{v:7.{digits}f}" for v in values[k : k + 9]))

    for law, axis in ((cl_of, machs), (cd_of, machs_d), (lambda a, Re, M: 0.0, machs)):
        record(" " * 7, list(axis), 2)
        for a in alpha:
            record(f"{a:7.1f}", [float(law(a, 1e5, m)) for m in axis], 4)
    return "\n".join(out) + "\n"


@pytest.fixture
def put(tmp_path: Path) -> Callable[[str], Path]:
    """Write text to a file whose extension says nothing."""

    def write(text: str) -> Path:
        path = tmp_path / f"section{len(list(tmp_path.iterdir()))}.txt"
        path.write_text(text)
        return path

    return write


def same_data(p: Polar, Re: float, M: float = 0.0, alpha: np.ndarray = ALPHA, law_Re: float | None = None) -> None:
    """The table values come back exactly, and the polar is closed."""
    cl, cd = p.lookup(np.deg2rad(alpha), Re, M)
    np.testing.assert_allclose(cl, cl_of(alpha, law_Re or Re, M), atol=1e-9)
    np.testing.assert_allclose(cd, cd_of(alpha, law_Re or Re, M), atol=1e-9)
    assert p.alpha[0] == -math.pi and p.alpha[-1] == math.pi and p.cd.min() > 0.0


FULL = np.r_[np.arange(-180.0, -20.0, 20.0), np.arange(-16.0, 17.0, 2.0), np.arange(20.0, 181.0, 20.0)]
SAMPLES = {"polar_csv": csv([5e4, 2e5]), "polar_xfoil": xfoil(), "polar_c81": c81(ALPHA, np.array([0.0, 0.3, 0.6]))}


@pytest.mark.parametrize("kind", sorted(SAMPLES))
def test_content_alone_decides_the_format(kind: str, put: Callable[[str], Path]) -> None:
    claims = [k for k, module in KINDS.items() if module.sniff(SAMPLES[kind].encode())]
    assert claims == [kind]
    path = put(SAMPLES[kind])
    assert importers.detect(path) == kind
    assert isinstance(importers.read(path), Polar)


def test_no_polar_importer_claims_other_text() -> None:
    for head in (b"", b"\0\1", b"RPM CT CP\n1500 0.1 0.04\n", b"time,thrust\n0,1\n", b"alpha_deg,cl\n0,0\n"):
        assert not any(module.sniff(head) for module in KINDS.values()), head


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_csv_round_trip(mark: str, put: Callable[[str], Path]) -> None:
    p = polars.read_polar_csv(put(csv([5e4, 2e5], mark=mark)))
    assert p.Re.tolist() == [5e4, 2e5]
    for Re in (5e4, 2e5):
        same_data(p, Re)
    assert "column ignored: cm" in p.notes
    shared = p.on_grid()
    assert shared.on_grid() is shared
    fine = ALPHA_GRID[np.isin(np.round(np.rad2deg(ALPHA_GRID), 6), ALPHA)]
    np.testing.assert_allclose(shared.lookup(fine, DEFAULT_RE[0])[0], cl_of(np.rad2deg(fine), 5e4), atol=1e-9)


def test_csv_in_radians_equals_csv_in_degrees(put: Callable[[str], Path]) -> None:
    degrees, radians = (polars.read_polar_csv(put(csv(unit=unit))) for unit in ("deg", "rad"))
    at = np.linspace(-math.pi, math.pi, 721)
    np.testing.assert_allclose(radians.lookup(at, 1e5), degrees.lookup(at, 1e5), atol=1e-9)


def test_csv_full_circle_is_taken_as_it_is(put: Callable[[str], Path]) -> None:
    text = "alpha_deg,cl,cd\n" + "".join(
        f"{a:g},{math.sin(2 * math.radians(a)):.6f},{0.02 + math.sin(math.radians(a)) ** 2:.6f}\n" for a in FULL
    )
    p = polars.read_polar_csv(put(text))
    cl, cd = p.lookup(np.deg2rad(FULL), 1e5)
    np.testing.assert_allclose(cl, np.round(np.sin(2 * np.deg2rad(FULL)), 6), atol=2e-6)
    np.testing.assert_allclose(cd, np.round(0.02 + np.sin(np.deg2rad(FULL)) ** 2, 6), atol=2e-6)
    assert not any("Viterna" in n for n in p.notes)


def test_extension_is_announced(put: Callable[[str], Path]) -> None:
    p = polars.read_polar_csv(put(csv()))
    assert any("Viterna" in n for n in p.notes) and "the source states no Reynolds number" in p.notes
    assert any("one Reynolds number" in n for n in p.on_grid().notes)
    unstalled = polars.read_polar_csv(put(csv(alpha=np.arange(-6.0, 8.5, 1.0))))
    assert any("before the stall" in n for n in unstalled.notes)


def test_xfoil_round_trip_and_several_files(put: Callable[[str], Path]) -> None:
    p = polars.read_polar_xfoil(put(xfoil(2e5, mach=0.1)))
    assert p.name == "NACA 4412" and p.Re.tolist() == pytest.approx([2e5]) and p.M.tolist() == [0.1]
    assert "Ncrit 7" in p.notes
    np.testing.assert_allclose(p.lookup(np.deg2rad(ALPHA), 2e5, 0.1)[0], cl_of(ALPHA, 2e5), atol=1e-9)
    both = polars.read_many([put(xfoil(2e5)), put(xfoil(5e4))])
    assert both.Re == pytest.approx(np.array([5e4, 2e5]))
    for Re in (5e4, 2e5):
        same_data(both, Re)


@pytest.mark.parametrize("count", [2, 9, 11])
def test_c81_round_trip(count: int, put: Callable[[str], Path]) -> None:
    machs = np.round(np.linspace(0.0, 0.8, count), 2)
    p = polars_c81.read(put(c81(ALPHA, machs)))
    assert p.name == "NACA 4412 TEST" and p.Re.size == 1
    np.testing.assert_allclose(p.M, machs)
    for m in machs:
        same_data(p, 1e5, float(m))


def test_c81_tables_with_other_mach_numbers_are_joined(put: Callable[[str], Path]) -> None:
    p = polars_c81.read(put(c81(ALPHA, np.array([0.0, 0.4, 0.8]), np.array([0.0, 0.8]))))
    assert p.M.tolist() == [0.0, 0.4, 0.8] and "lift and drag interpolated to one grid" in p.notes
    cl, cd = p.lookup(np.deg2rad(ALPHA), 1e5, 0.4)
    np.testing.assert_allclose(cl, cl_of(ALPHA, 1e5, 0.4), atol=1e-9)
    np.testing.assert_allclose(cd, 0.5 * (cd_of(ALPHA) + cd_of(ALPHA, 1e5, 0.8)), atol=1e-9)


BASE = csv()
ONE_REPEATED = BASE + "4,0.9999,0.0182,0\n"
FAULTY: dict[str, tuple[str, str, list[str]]] = {
    "no unit": ("polar_csv", BASE.replace("alpha_deg", "alpha"), ["2:1: got 'alpha'", "alpha_deg or alpha_rad"]),
    "no drag": ("polar_csv", BASE.replace("Cd", "drag"), ["no column cd"]),
    "radians in a degree column": ("polar_csv", csv(unit="rad").replace("alpha_rad", "alpha_deg"), ["like radians"]),
    "degrees in a radian column": ("polar_csv", BASE.replace("alpha_deg", "alpha_rad"), ["column alpha_deg"]),
    "comma decimals": ("polar_csv", csv(mark=";").replace("0.0150", "0,0150"), ["'0,0150'", "decimal point"]),
    "text": ("polar_csv", BASE + "17,nan,0.2,0\n18,0.5,,0\n", ["32:2: got 'nan'", "33:3: got ''"]),
    "negative drag": ("polar_csv", BASE.replace("0.0150", "-0.015"), ["cd = -0.015", "above 0"]),
    "drag counts": ("polar_csv", "alpha_deg,cl,cd\n-5,-0.3,150\n0,0.2,120\n8,1.0,180\n", ["Drag counts"]),
    "millions": ("polar_csv", csv([0.2]), ["Re = 0.2", "Millions"]),
    "two values": ("polar_csv", ONE_REPEATED, ["another row at 4 deg", "each angle once"]),
    "too short": ("polar_csv", csv(alpha=np.arange(-4.0, 4.5, 1.0)), ["from -4 to 4 deg", "reach 5 deg"]),
    "past 180": ("polar_csv", BASE + "350,-0.8,0.03,0\n", ["350", "negative ones"]),
    "mach": ("polar_csv", csv([5e4, 2e5]).replace("Re\n", "Mach\n"), ["Mach = 50000", "from 0 to 1.5"]),
    "holes": ("polar_csv", "alpha_deg,cl,cd,Re,Mach\n" + "".join(f"{a},{a / 9},0.02,{r},{m}\n" for r, m in
              ((1e5, 0.1), (2e5, 0.1), (2e5, 0.3)) for a in (-5, 0, 9)), ["3 pairs of 2 Reynolds and 2 Mach"]),
    "type 2": ("polar_xfoil", xfoil(kind="2 1"), ["type 1"]),
    "inviscid": ("polar_xfoil", xfoil(Re=0.0 + 1.0), ["Re = 0"]),
    "stars": ("polar_xfoil", xfoil().replace("  12.000", "********"), ["'********'", "alpha as a number"]),
    "empty": ("polar_xfoil", xfoil(alpha=ALPHA[:0]), ["no rows"]),
    "cut": ("polar_c81", "\n".join(SAMPLES["polar_c81"].splitlines()[:20]), ["end of the file in the lift table"]),
    "shifted": ("polar_c81", SAMPLES["polar_c81"].replace("    0.0 ", "   0.0x "), ["7 characters wide"]),
    "disordered": ("polar_c81", c81(ALPHA, np.array([0.3, 0.0])), ["ascending Mach numbers"]),
}  # fmt: skip


@pytest.mark.parametrize("fault", sorted(FAULTY))
def test_faults_name_the_place_and_the_cure(fault: str, put: Callable[[str], Path]) -> None:
    kind, text, expected = FAULTY[fault]
    path = put(text)
    with pytest.raises(InputError) as caught:
        KINDS[kind].read(path)
    message = str(caught.value)
    assert all(f.file == str(path) for f in caught.value.faults)
    for part in expected:
        assert part in message, message


def test_all_faults_of_a_file_come_at_once(put: Callable[[str], Path]) -> None:
    text = "alpha_deg,cl,cd,Re\n-5,-0.3,0.02,1e5\n0,x,0.01,1e5\n2,0.4,0,1e5\n9,7,0.02,0.1\n"
    with pytest.raises(InputError) as caught:
        polars.read_polar_csv(put(text))
    message = str(caught.value)
    for part in ("3:2: got 'x'", "4: got cd = 0", "5: got cl = 7", "5: got Re = 0.1"):
        assert part in message, message


def test_bench_table_is_read_with_its_own_numbers(shared_data: Path) -> None:
    path = shared_data / "bench" / "polar_naca4412_multiRe.csv"
    if not path.exists():
        pytest.skip("no bench polar in the shared data")
    p = polars.read_polar_csv(path)
    table = np.genfromtxt(path, delimiter=",", names=True)
    cl, cd = p.lookup(np.deg2rad(table["alpha_deg"]), table["Re"])
    inside = np.abs(table["alpha_deg"]) < 180.0
    np.testing.assert_allclose(cl[inside], table["cl"][inside], atol=1e-7)
    np.testing.assert_allclose(cd[inside], table["cd"][inside], atol=1e-7)
