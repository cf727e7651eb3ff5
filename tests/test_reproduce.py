"""Reproduction of the source thesis: every number, its status by its digits."""

import json

import pytest
import reproduce
import thesis as th

INCH, KGF = 0.0254, 9.80665


@pytest.fixture(scope="module")
def items():
    return reproduce.items()


def find(items, quantity):
    found = [i for i in items if i.quantity == quantity]
    assert len(found) == 1, quantity
    return found[0]


def test_statuses_are_the_declared_ones_and_reasons_are_given(items):
    for i in items:
        assert i.status in th.STATUSES
        assert (i.ours is None) == (i.status in (th.INPUT, th.ABSENT)), i.quantity
        assert i.note or i.status != th.NOT, i.quantity


@pytest.mark.parametrize(
    ("stated", "value", "status"),
    [
        ("2.456", 2.4560, th.REPRODUCED), ("2.456", 2.45649, th.REPRODUCED), ("2.456", 2.4566, th.ROUNDING),
        ("2.456", 2.4571, None), ("22.017", 22.01752, th.ROUNDING), ("58", 58.84, th.ROUNDING),
        ("10", 10.2, th.REPRODUCED),
        ("3.233e-3", 3.2326e-3, th.REPRODUCED), ("3.233e-3", 3.2345e-3, None), ("0.0307", 0.03078, th.ROUNDING),
        ("2.7", 2.7532, th.ROUNDING), ("0.54", 0.5506, None), ("-1.0", -1.04, th.REPRODUCED),
    ],
)  # fmt: skip
def test_comparison_at_the_printed_digits(stated, value, status):
    assert th.matches(stated, value) == status


# Number as stated, ours, to the digits given here: the list of the source, section by section.
@pytest.mark.parametrize(
    ("quantity", "stated", "ours", "status"),
    [
        ("8x5: K1/K2 recomputed before", "2.456", 2.456, th.REPRODUCED),
        ("10x5: K1/K2 recomputed before", "5.363", 5.363, th.REPRODUCED),
        ("12x6: K1/K2 recomputed before", "11.121", 11.121, th.REPRODUCED),
        ("14x8: K1/K2 recomputed before", "22.025", 22.025, th.REPRODUCED),
        ("8x5: K1/K2 as printed", "2.455", 2.456, th.ROUNDING),
        ("10x5: K1/K2 as printed", "5.36", 5.363, th.REPRODUCED),
        ("12x6: K1/K2 as printed", "11.11", 11.121, th.ROUNDING),
        ("14x8: K1/K2 as printed", "22.017", 22.025, th.ROUNDING),
        ("8x5: printed error", "5.57", 5.540, th.ROUNDING),
        ("10x5: printed error", "7.58", 7.534, th.ROUNDING),
        ("12x6: printed error", "3.83", 3.932, th.ROUNDING),
        ("14x8: printed error", "3.85", 3.892, th.ROUNDING),
        ("average error, printed", "5.22", 5.2245, th.REPRODUCED),
        ("mean of the four printed errors", "5.21", 5.2075, th.REPRODUCED),
        ("8x5: rotational tip Mach", "0.63", 0.6253, th.REPRODUCED),
        ("14x8: rotational tip Mach", "1.09", 1.0943, th.REPRODUCED),
        ("8x5: CT of the Fluent value", "0.110", 0.1099, th.REPRODUCED),
        ("14x8: CT of the Fluent value", "0.096", 0.0955, th.REPRODUCED),
        ("tip Mach at 55 000 rev/min", "0.58", 0.5839, th.REPRODUCED),
        ("annulus area, 69 mm less hub", "3.233e-3", 3.2326e-3, th.REPRODUCED),
        ("K1/K2: F over sqrt(pitch in m)", "10.08", 10.081, th.REPRODUCED),
        ("K1/K2 at pitch 1.5 in", "1.97", 1.968, th.REPRODUCED),
        ("K1/K2 at pitch 2.7 in", "2.64", 2.640, th.REPRODUCED),
        ("K1/K2 at pitch 6 in", "3.94", 3.935, th.REPRODUCED),
        ("thrust, K1/K2", "2.64", 0.270, th.NOT),
        ("momentum check, rho A v^2", "30.2", 30.18, th.REPRODUCED),
        ("least pitch by the exhaust speed", "95", 95.24, th.REPRODUCED),
        ("roll moment of 27 N at 0.2 m", "5.4", 5.4, th.REPRODUCED),
        ("roll moment", "0.54", 0.5506, th.ROUNDING),
        ("target thrust", "58", 58.84, th.ROUNDING),
        ("K_b = 1/K_v", "0.02513", 0.025130, th.REPRODUCED),
        ("q-axis K_t = sqrt(3/2) K_b", "0.0308", 0.03078, th.REPRODUCED),
        ("q-axis K_t as printed", "0.0307", 0.03078, th.ROUNDING),
    ],
)
def test_numbers_of_the_thesis(items, quantity, stated, ours, status):
    item = next(i for i in items if i.quantity == quantity and i.ours is not None)
    assert (item.stated, item.status) == (stated, status)
    assert item.ours == pytest.approx(ours, rel=6e-4)


def test_vendor_and_bench_values_are_inputs(items):
    for quantity in ("8x5: Fluent", "thrust, Fluent", "thrust, load cell", "thrust, vendor", "max exhaust speed",
                     "PWM rate", "K_t, mean of the torque sensor"):  # fmt: skip
        assert find(items, quantity).status == th.INPUT


def test_the_printed_k1k2_values_come_from_a_rounded_gravity():
    variants = th.k1k2_variants()
    assert [name for name, _ in variants] == ["g = 9.81"]
    assert variants[0][1] == pytest.approx((2.45513, 5.36118, 11.11694, 22.01752), abs=1e-5)


def test_the_fan_value_is_found_in_newtons_not_kgf():
    f = th.ds30_finding()
    assert f["units"] == ["N"]
    assert (f["best"].unit, f["best"].area) == ("N", "annulus")
    assert f["best"].pitch_over_D == pytest.approx(1.0, abs=0.02)
    assert f["claimed"].pitch_over_D > 90
    assert f["slip"] == "kgf <-> N" and f["slip_factor"] == KGF and abs(f["slip_miss"]) < 0.005


def test_the_search_follows_the_claim_and_is_no_fixed_sentence(monkeypatch):
    """A claim ten times smaller must be found in kgf, a claim in pounds in pounds."""
    monkeypatch.setitem(th.DS30, "claim_kgf", 0.2699)
    f = th.ds30_finding()
    assert f["best"].unit == "kgf" and abs(f["ratio"] - 1) < 0.01
    monkeypatch.setitem(th.DS30, "claim_kgf", 2.648 / 4.4482216)
    assert th.ds30_finding()["best"].unit == "lbf"


def test_every_reading_gives_the_number_it_claims():
    from bemt.physics.k1k2 import K1, K2, thrust

    units = {"kgf": KGF, "N": 1.0, "lbf": 4.4482216152605, "ozf": 4.4482216152605 / 16}
    readings = th.ds30_readings()
    assert len(readings) == 2 * 2 * 2 * 4
    for r in readings:
        hub = 0.0254 if r.area == "annulus" else 0.0
        F = thrust(r.diameter_m, r.pitch_m, 55000.0, hub_diameter_m=hub)
        if r.formula != "K1/K2":
            F /= (K1 * r.diameter_m / r.pitch_m) ** K2
        assert F / units[r.unit] == pytest.approx(2.64, rel=1e-9)
        assert r.sensible == (0.5 <= r.diameter_m / r.pitch_m <= 2.5)
        assert r.above_exhaust == (r.pitch_m * 55000 / 60 > 87.3)


def test_the_supersonic_tip_is_found_and_the_formula_is_blind():
    blind = th.mach_blindness()
    assert blind["supersonic"] == ["14x8"]
    assert blind["CT_spread"] < 1e-12


def test_a_formula_with_a_mach_number_would_not_be_called_blind(monkeypatch):
    real = th.k.thrust
    monkeypatch.setattr(th.k, "thrust", lambda D, p, rpm, *a: real(D, p, rpm, *a) * (1 + (rpm / 5e4) ** 2))
    assert th.mach_blindness()["CT_spread"] > 0.1


def test_clarke_transform_by_numbers():
    assert th.clarke_factor() == pytest.approx((1.5**0.5, 1.5**0.5), rel=1e-12)


@pytest.mark.parametrize(("ratio", "name"), [(1 / 9.81, "kgf <-> N"), (25.4, "in <-> mm"), (57.3, "deg <-> rad"),
                                             (6.28, "rev/s (Hz) <-> rad/s"),
                                             (60.0, "rev/s (Hz) <-> rev/min")])  # fmt: skip
def test_nearest_slip(ratio, name):
    assert th.nearest_slip(ratio)[0] == name


def test_without_data_the_database_numbers_are_not_checked(items):
    absent = [i for i in items if i.status == th.ABSENT]
    assert len(absent) == 9 and all(i.quantity.startswith("UIUC") for i in absent)


def test_statistics_of_the_database(shared_data):
    u = reproduce.uiuc_statistics(shared_data / "uiuc")
    # Stated over 4122 points of 248 propellers; whatever part is there must agree as a sample.
    assert u["points"] > 1000 and u["propellers"] > 60
    assert u["median"] == pytest.approx(0.992, abs=0.03)
    assert u["sd"] == pytest.approx(0.196, abs=0.03)
    assert u["within_13"] == pytest.approx(0.551, abs=0.05)
    assert u["within_26"] == pytest.approx(0.832, abs=0.04)
    assert u["flight"][0] == pytest.approx(0.85, abs=0.03) and u["flight"][-1] == pytest.approx(0.29, abs=0.04)
    assert all(a > b for a, b in zip(u["flight"], u["flight"][1:], strict=False))
    assert u["zero_thrust"] == pytest.approx(1.19, abs=0.03)
    rows = [i for i in reproduce.items(u) if i.quantity.startswith("UIUC")]
    assert all(i.status in (th.REPRODUCED, th.ROUNDING, th.NOT) for i in rows)
    if u["points"] != 4122:
        assert all(f"{u['points']} of 4122" in i.note for i in rows)


def test_statistics_on_a_made_up_folder(tmp_path):
    """CT made from the formula itself: every ratio is 1 exactly, and the zero of thrust is P/D."""
    from bemt.physics.k1k2 import K1, K2

    CT0 = 3.141592653589793 / 4 * 0.6**2 * (K1 / 0.6) ** K2
    static = "".join(f"{rpm} {CT0:.9f} 0.05\n" for rpm in (3000, 6000))
    (tmp_path / "aa_10x6_static_1.txt").write_text("RPM CT CP\n" + static)
    line = "".join(f"{J:.3f} {CT0 * (1 - J / 0.6):.9f} 0.05 {J * CT0 * (1 - J / 0.6) / 0.05:.4f}\n"
                   for J in (0.1, 0.3, 0.5, 0.7))  # fmt: skip
    (tmp_path / "aa_10x6_2_5000.txt").write_text("J CT CP eta\n" + line)
    u = reproduce.uiuc_statistics(tmp_path)
    assert (u["points"], u["propellers"]) == (2, 1)
    assert (u["median"], u["within_13"]) == (pytest.approx(1.0, abs=1e-6), 1.0)
    assert u["zero_thrust"] == pytest.approx(1.0, abs=1e-6)
    assert [x for x in u["flight"] if x is not None] == pytest.approx([1.0, 1.0, 1.0], abs=1e-4)
    empty = tmp_path / "empty"
    empty.mkdir()
    assert reproduce.uiuc_statistics(empty) == {}


def test_command_prints_table_and_json(capsys, monkeypatch):
    monkeypatch.setattr(reproduce, "find_uiuc", lambda: None)
    assert reproduce.main([]) == 0
    assert "reproduced within rounding" in capsys.readouterr().out
    assert reproduce.main(["--json"]) == 0
    doc = json.loads(capsys.readouterr().out)
    assert doc["schema"] == "bemt.reproduce/1"
    assert sum(doc["summary"].values()) == len(doc["items"])
    assert doc["findings"]["mach"]["supersonic"] == ["14x8"]
    assert doc["findings"]["ds30"]["units"] == ["N"]
    assert doc["findings"]["k1k2_print"][0]["variant"] == "g = 9.81"
    assert set(doc["items"][0]) == {"section", "quantity", "stated", "ours", "unit", "status", "note"}
