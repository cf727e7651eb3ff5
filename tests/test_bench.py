"""Benchmark: its work, its numbers, its document. Speed itself is not asserted here."""

import json
import math

import bench
import bench_work as benchwork
import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.physics.air import Air
from bemt.physics.bem import solver


@pytest.fixture(scope="module")
def work():
    return benchwork.load()


@pytest.fixture(scope="module")
def doc(work):
    return bench.document(work, quick=True)


def test_the_shipped_table_is_a_cambered_section_over_the_full_circle(work):
    np.testing.assert_allclose(work.alpha_deg, np.arange(-180, 181))
    assert work.cl[0] == pytest.approx(work.cl[-1], abs=1e-9) and work.cd[0] == pytest.approx(work.cd[-1], abs=1e-9)
    assert np.all(work.cd > 0)
    small = (work.alpha_deg >= 0) & (work.alpha_deg <= 8)  # below 0 a laminar bubble steepens the curve at Re 1e5
    slope = np.polyfit(np.radians(work.alpha_deg[small]), work.cl[small], 1)[0]
    assert 5.0 < slope < 2 * math.pi * 1.1
    assert 0.35 < np.interp(0.0, work.alpha_deg, work.cl) < 0.55
    rising = (work.alpha_deg >= -5) & (work.alpha_deg <= 5)
    assert -4.5 < np.interp(0.0, work.cl[rising], work.alpha_deg[rising]) < -2.5


def test_generating_again_gives_the_shipped_files(work, tmp_path):
    files = benchwork.generate(tmp_path)
    assert sorted(f.name for f in files) == sorted(f.name for f in benchwork.DATA.glob("*.csv"))
    again = benchwork.load(tmp_path)
    for name in ("edges", "r_R", "c_R", "beta_deg"):
        np.testing.assert_allclose(getattr(again, name), getattr(work, name), rtol=1e-9)
    attached = (work.alpha_deg >= -4) & (work.alpha_deg <= 8)  # another release of the network may differ a little
    np.testing.assert_allclose(again.cl[attached], work.cl[attached], atol=0.05)
    np.testing.assert_allclose(again.cd[attached], work.cd[attached], atol=0.01)


def test_the_work_is_sixty_points(work):
    assert work.rpm.size == work.V.size == 60
    assert set(work.rpm) == {3000.0, 5000.0, 6700.0}
    J = work.V / (work.rpm / 60 * 0.254)
    np.testing.assert_allclose(J.reshape(3, 20), np.tile(np.linspace(0, 0.8, 20), (3, 1)), atol=1e-12)


def test_results_are_those_of_a_propeller(doc):
    CT, CP, J = (np.reshape(doc[k], (3, 20)) for k in ("CT", "CP", "J"))
    assert np.all(CT[:, 0] > 0.05) and np.all(CT[:, 0] < 0.15)  # thrust at rest, not the zero of some peers
    assert np.all(np.diff(CT, axis=1) < 0)
    # one Reynolds number, no Mach number: coefficients depend on J alone
    np.testing.assert_allclose(CT, np.tile(CT[0], (3, 1)), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(CP, np.tile(CP[0], (3, 1)), rtol=1e-6, atol=1e-9)
    zero = np.interp(0.0, -CT[0], J[0])
    assert 0.5 < zero < 0.8  # P/D is 0.5, a cambered section goes on
    assert np.all((J * CT / CP)[CT > 0] < 0.9)


def test_an_absent_peer_is_no_error(work, monkeypatch):
    import sys

    for name in ("wisdem", "wisdem.ccblade", "wisdem.ccblade.ccblade"):
        monkeypatch.setitem(sys.modules, name, None)
    result = bench.ccblade(work)
    assert result["us_per_point"] is None and "not installed" in result["note"]


def test_ccblade_agrees_and_is_zero_at_rest(work):
    pytest.importorskip("wisdem.ccblade.ccblade", reason="optional peer wisdem is not installed")
    result = bench.ccblade(work, quick=True)
    sol = solver.solve(benchwork.prepare(work), work.rpm, work.V, Air.from_density())
    still = work.V == 0
    assert "zero thrust" in result["note"] and not np.any(np.array(result["CT"])[still])
    assert np.abs(np.array(result["CT"]) - sol.CT)[~still].max() < 0.006
    assert np.abs(np.array(result["CP"]) - sol.CP)[~still].max() < 0.002


def test_other_files_of_the_same_layout(tmp_path):
    benchwork.generate(tmp_path)
    for part in ("edges31", "mid30"):
        (tmp_path / f"generic_10x5_{part}.csv").rename(tmp_path / f"mine_{part}.csv")
    assert benchwork.load(tmp_path).name == "mine"
    text = (tmp_path / "mine_mid30.csv").read_text().replace("0.1641666667", "x", 1)
    (tmp_path / "mine_mid30.csv").write_text(text)
    with pytest.raises(InputError, match=r"mine_mid30\.csv: 3:1: got r_R = x; expected a finite number"):
        benchwork.load(tmp_path)


def test_missing_files_are_named(tmp_path):
    with pytest.raises(InputError, match="expected <name>_edges31.csv, _mid30.csv and a polar"):
        benchwork.load(tmp_path)
    with pytest.raises(InputError, match="got blades generic_10x5"):
        benchwork.load(name="none")


def test_the_original_work_runs_when_it_is_there(shared_data):
    work = benchwork.load(shared_data / "bench", "apce_10x5")
    sol = solver.solve(benchwork.prepare(work), work.rpm, work.V, Air.from_density())
    assert sol.converged.all() and work.r_R.size == 30
    assert sol.CT[0] == pytest.approx(0.100, abs=0.012)  # measured 0.092 near rest; sound peers read 4 to 19 % high


def test_command(capsys, monkeypatch, doc):
    monkeypatch.setattr(bench, "document", lambda work, quick: doc)
    assert bench.main(["--quick"]) == 0
    text = capsys.readouterr().out
    assert "us per operating point" in text
    assert bench.main(["--json", "--quick"]) == 0
    assert json.loads(capsys.readouterr().out)["schema"] == "bemt.bench/1"
    monkeypatch.setattr(bench, "document", lambda work, quick: doc | {"converged": 59})
    assert bench.main(["--quick"]) == 1
