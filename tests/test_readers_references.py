"""The promise of bemt.data.readers.references: recorded values with unit, uncertainty and source, or a refusal."""
# ruff: noqa: E501 - a table of exact messages

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bemt.base.errors import InputError
from bemt.data import readers as importers
from bemt.data.readers import references

HEAD = "quantity,value,unit,uncertainty,kind,source,remark,rpm,airspeed_m_s,density_kg_m3\n"


def save(tmp_path: Path, *rows: str, head: str = HEAD) -> Path:
    path = tmp_path / "references.csv"
    path.write_text(head + "\n".join(rows) + "\n")
    return path


def faults(path: Path) -> list[str]:
    with pytest.raises(InputError) as caught:
        references.read(path)
    return [str(fault).removeprefix(f"{path}: ") for fault in caught.value.faults]


@pytest.mark.parametrize(
    ("quantity", "value", "unit", "channel", "expected"),
    [
        ("thrust", 2.6, "kgf", "thrust_N", 2.6 * 9.80665),
        ("thrust", 2600, "gf", "thrust_N", 2.6 * 9.80665),
        ("thrust", 27, "N", "thrust_N", 27.0),
        ("thrust", 1, "lbf", "thrust_N", 4.4482216152605),
        ("torque", 0.35, "N m", "torque_Nm", 0.35),
        ("torque", 0.35, "N·m", "torque_Nm", 0.35),
        ("torque", 10, "in-lbf", "torque_Nm", 1.1298482902761668),
        ("power", 1.5, "kW", "power_W", 1500.0),
        ("exhaust_speed", 87.3, "m/s", "exhaust_speed_m_s", 87.3),
        ("exhaust_speed", 90, "km/h", "exhaust_speed_m_s", 25.0),
        ("rpm", 55000, "rpm", "rpm", 55000.0),
        ("rpm", 100, "rev/s", "rpm", 6000.0),
        ("CT", 0.11, "-", "CT", 0.11),
        ("eta", 65, "%", "eta", 0.65),
    ],
)
def test_units(tmp_path: Path, quantity: str, value: float, unit: str, channel: str, expected: float) -> None:
    (ref,) = references.read(save(tmp_path, f"{quantity},{value},{unit},{value / 10},bench,me,,,,"))
    assert ref.channel == channel
    assert ref.value == pytest.approx(expected, rel=1e-12) and ref.u == pytest.approx(expected / 10, rel=1e-12)


def test_everything_is_kept(tmp_path: Path) -> None:
    path = save(tmp_path, "# a comment", 'thrust,2.60,kgf,unknown,cfd,"Cahill 2025, table 1",Fluent,20000,0,1.225')
    (ref,) = importers.read(path)
    assert (ref.kind, ref.source, ref.remark) == ("cfd", "Cahill 2025, table 1", "Fluent")
    assert (ref.rpm, ref.airspeed_m_s, ref.density_kg_m3) == (20000.0, 0.0, 1.225)
    assert math.isnan(ref.u) and ref.printed == "2.60 kgf" and ref.where == f"{path}:3"


def test_condition_columns_are_optional(tmp_path: Path) -> None:
    head = "quantity,value,unit,uncertainty,kind,source,remark\n"
    (ref,) = references.read(save(tmp_path, "CT,0.1,-,unknown,vendor,x,", head=head))
    assert ref.condition == (None, None, None)


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("thrust,2.6,kg,unknown,cfd,x,,,,", "2:3: got unit 'kg'; expected one of N, mN, kN, kgf, gf, lbf, ozf. A mass is not a force: write kgf."),
        ("thrust,2.6,,unknown,cfd,x,,,,", "2:3: got no unit; expected one of N, mN, kN, kgf, gf, lbf, ozf."),
        ("thrust,2.6,Nm,unknown,cfd,x,,,,", "2:3: got unit 'Nm'; expected one of N, mN, kN, kgf, gf, lbf, ozf. Did you mean N?"),
        ("CT,0.1,N,unknown,cfd,x,,,,", "2:3: got unit 'N'; expected - (dimensionless)."),
        ("thrust,nan,N,unknown,cfd,x,,,,", "2:2: got value = nan; expected a finite number."),
        ('thrust,"2,6",N,unknown,cfd,x,,,,', "2:2: got value = 2,6; expected a finite number. Use a decimal point."),
        ("thrust,2.6 kgf,kgf,unknown,cfd,x,,,,", "2:2: got value = 2.6 kgf; expected a finite number. Put the unit into its own column."),
        ("thrust,-3,N,unknown,cfd,x,,,,", "2:2: got thrust = -3 N; expected 0.001 to 100000 in SI units. Is the unit right?"),
        ("eta,65,-,unknown,cfd,x,,,,", "2:2: got eta = 65 -; expected -10 to 1 in SI units. Is the unit right?"),
        ("thrust,3,N,,cfd,x,,,,", '2:4: got uncertainty = nothing; expected a standard uncertainty in the unit of the value, or "unknown".'),
        ("thrust,3,N,0,cfd,x,,,,", '2:4: got uncertainty = 0; expected a positive number. Write "unknown" if nobody stated it.'),
        ("thrust,3,N,5,cfd,x,,,,", "2:4: got uncertainty = 5; expected less than the value, 3. Is it in percent? Give it in the unit of the value."),
        ("thrust,3,N,unknown,cdf,x,,,,", "2:5: got kind 'cdf'; expected one of cfd, bench, vendor, k1k2_printed, k1k2, bemt, flight, other. Did you mean cfd?"),
        ("thrust,3,N,unknown,cfd,,,,,", "2:6: got no source; expected where the value comes from."),
        ("thrust,3,N,unknown,cfd,x,,5,,", "2:8: got rpm = 5; expected 10 to 300000. Is this in rev/s or rad/s?"),
        ("thrust,3,N,unknown,cfd,x,,,1e3,", "2:9: got airspeed_m_s = 1000; expected -100 to 400. Is this in km/h or mph?"),
        ("thrust,3,N,unknown,cfd,x,,,,0.001225", "2:10: got density_kg_m3 = 0.001225; expected 0.01 to 1100. Is this in g/cm3?"),
        ("thrust,3,N,unknown,cfd,x,,,", "2: got 9 cells; expected 10 cells. Write empty cells too."),
        ("thrust,3,N,unknown,cfd,x, y,,,,", "2: got 11 cells; expected 10 cells. Quote cells that hold a comma."),
    ],
)  # fmt: skip
def test_faults(tmp_path: Path, row: str, expected: str) -> None:
    assert faults(save(tmp_path, row)) == [expected]


def test_unknown_quantity(tmp_path: Path) -> None:
    (fault,) = faults(save(tmp_path, "trust,3,N,unknown,cfd,x,,,,"))
    assert fault.startswith("2:1: got quantity 'trust'; expected one of thrust,") and fault.endswith(
        "Did you mean thrust?"
    )


def test_all_faults_at_once(tmp_path: Path) -> None:
    found = faults(save(tmp_path, "trust,3,N,unknown,cfd,x,,,,", "CT,x,-,-1,cfd,,,,,"))
    assert [fault.split(": ")[0] for fault in found] == ["2:1", "3:2", "3:4", "3:6"]


def test_kgf_for_newton_is_refused(tmp_path: Path) -> None:
    found = faults(save(tmp_path, "thrust,27,N,unknown,vendor,a,,55000,,", "thrust,27,kgf,unknown,bench,b,,55000,,"))
    assert found == [
        "3: got 27 kgf where line 2 has 27 N; expected values in their own units. "
        "They differ by 9.81: is one kgf and one N?"
    ]
    # the same value at another condition, and honest conversions, pass
    good = references.read(
        save(tmp_path, "thrust,27,N,unknown,vendor,a,,55000,,", "thrust,2.75,kgf,unknown,vendor,b,,55000,,",
             "thrust,27,kgf,unknown,bench,b,,20000,,")
    )  # fmt: skip
    assert len(good) == 3


def test_repeated_rows_are_refused(tmp_path: Path) -> None:
    row = "thrust,27,N,unknown,vendor,a,,,,"
    assert faults(save(tmp_path, row, row)) == [
        "3: got the row of line 2 again; expected each value once. Delete one of them."
    ]


@pytest.mark.parametrize(
    ("head", "words"),
    [
        (HEAD.replace("unit,", ""), "1: got no column unit"),
        (HEAD.replace("remark", "remarks"), "1:7: got column 'remarks'"),
        (HEAD.replace("rpm", "unit"), "1:8: got column 'unit' twice"),
        (HEAD.replace(",", ";"), "Separate columns by commas."),
    ],
)
def test_header_faults(tmp_path: Path, head: str, words: str) -> None:
    assert any(words in fault for fault in faults(save(tmp_path, head=head)))


def test_a_remark_is_no_must(tmp_path: Path) -> None:
    (one,) = references.read(save(tmp_path, "thrust,27,N,unknown,vendor,a,,,", head=HEAD.replace("remark,", "")))
    assert one.remark == "" and one.value == 27.0


def test_empty_and_missing_files(tmp_path: Path) -> None:
    assert "no rows" in faults(save(tmp_path))[0]
    assert "an empty file" in faults(save(tmp_path, head=""))[0]
    assert "no such file" in faults(tmp_path / "none.csv")[0]


def test_series_by_kind_and_source(tmp_path: Path) -> None:
    path = save(
        tmp_path,
        "thrust,2.4,kgf,0.1,bench,cell,,55000,0,1.2", "exhaust_speed,87.3,m/s,unknown,bench,cell,hot wire,55000,0,1.2",
        "thrust,1.2,kgf,0.1,bench,cell,,40000,0,1.2", "thrust,27,N,unknown,vendor,sheet,,,,",
    )  # fmt: skip
    bench, vendor = references.to_series(references.read(path), "ds30")
    assert (bench.kind, len(bench), vendor.kind, len(vendor)) == ("bench", 2, "vendor", 1)
    assert bench["rpm"].tolist() == [55000.0, 40000.0]
    assert np.allclose(bench["thrust_N"], np.array([2.4, 1.2]) * 9.80665) and np.allclose(bench.u["thrust_N"], 0.980665)
    assert np.array_equal(bench["exhaust_speed_m_s"], [87.3, np.nan], equal_nan=True)
    assert "rpm" not in vendor and np.isnan(vendor.u["thrust_N"][0])
    assert bench.provenance["source"] == "cell" and bench.provenance["remark"] == "hot wire"


@settings(max_examples=80, deadline=None)
@given(
    at=st.integers(0, 200),
    length=st.integers(0, 40),
    junk=st.text('0123456789.,-+eE \n"#kgfNunow/%\xe9\u4e2d', max_size=12),
)
def test_damage_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, at: int, length: int, junk: str) -> None:
    text = HEAD + 'thrust,2.60,kgf,0.1,cfd,"Cahill, 1",Fluent,20000,0,1.225\nCT,0.11,-,unknown,bench,x,,,,\n'
    path = tmp_path_factory.mktemp("fuzz") / "references.csv"
    path.write_text(text[:at] + junk + text[at + length :], encoding="utf-8")
    try:
        values = [ref.value for ref in references.read(path)]
    except InputError as error:
        assert all(fault.got and fault.expected for fault in error.faults)
    else:
        assert values and np.all(np.isfinite(values))
