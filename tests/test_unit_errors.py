"""The list of unit errors: exact, both ways, each once; every user takes its view of it."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from bemt.base import unit_errors
from bemt.base import units as u
from bemt.data.recordings.slips import slips
from bemt.physics import effects
from bemt.tools.drive.motor_constant import FACTORS

KINDS = ("force", "torque", "rotation", "airspeed", "density", "power", "electrical_power", "current", "voltage",
         "length", "diameter", "efficacy", "pressure", "temperature", "time", "angle", "fraction",
         "motor_constant")  # fmt: skip


def test_factors_follow_from_the_table_of_units() -> None:
    pairs = unit_errors.symmetric()
    assert pairs["kgf <-> N"] == u.UNITS["kgf"].factor
    assert pairs["lbf <-> N"] == u.UNITS["lbf"].factor
    assert pairs["rad/s <-> rev/min"] == pytest.approx(30 / math.pi)
    assert pairs["in <-> mm"] == pytest.approx(u.convert(1.0, "in", "mm"))
    assert all(f > 1 for f in pairs.values())


@pytest.mark.parametrize("kind", KINDS)
def test_each_unit_error_is_undone_by_its_repair_and_goes_both_ways(kind: str) -> None:
    found = unit_errors.errors(kind)
    for e in found:
        back = next(b for b in found if (b.actual, b.stated) == (e.stated, e.actual))
        assert e.factor * back.factor == pytest.approx(1.0) and e.rarity == back.rarity
        assert e.offset or abs(math.log(e.factor)) > 0.2, "nearer to 1 it is a gain, and no unit"
    assert len({(e.actual, e.stated) for e in found}) == len(found)


@pytest.mark.parametrize(("actual", "stated", "value"), [("C", "K", 15.0), ("F", "K", 59.0), ("F", "C", 59.0)])
def test_a_temperature_in_another_unit_is_repaired(actual: str, stated: str, value: float) -> None:
    e = unit_errors.named(actual, stated)
    assert u.to_si(value, stated) * e.repair + e.offset == pytest.approx(u.to_si(value, actual))


def test_speed_ratios_are_exact_and_each_known_once() -> None:
    every = unit_errors.speed_ratios()
    ratios = [Fraction(r.true, r.set) for r in every]
    assert len(set(ratios)) == len(ratios)
    assert {Fraction(x) for x in (2, 3, "1/2", "1/3", 7, "6/7", "7/6", "3/2", "11/12")} <= set(ratios)
    assert all(1 / f in ratios for f in ratios if f.denominator != 7), "only the default of a firmware goes one way"
    usual = {Fraction(r.true, r.set) for r in unit_errors.speed_ratios(rarest=1.0, nearest=Fraction(8, 7))}
    assert usual < set(ratios) and min(max(f, 1 / f) for f in usual) == Fraction(8, 7)
    np.testing.assert_allclose([r.weight for r in every], np.exp([-0.5 * r.rarity for r in every]))


def test_every_user_has_a_view_of_the_one_list() -> None:
    known = {r.ratio for r in unit_errors.speed_ratios()}
    variants = effects.catalogue()["rpm_scale"]().variants() or ()
    assert {v["factor"] for v in variants if v["factor"] != 1.0} < known
    counted = [s for s in slips() if s.id in ("rpm_electrical", "rpm_ratio")]
    assert {s.quantity for s in counted} == {"n", "n2"}
    assert all(min(abs(s.factor * ratio - 1.0) for ratio in known) < 1e-12 for s in counted)
    units = {e.factor for kind in KINDS for e in unit_errors.errors(kind)}
    for setting in effects.catalogue()["unit_slip"]().variants() or ():
        assert setting["factor"] in (units | {-1.0})
    assert set(FACTORS.values()) == {e.factor for e in unit_errors.errors("motor_constant")}


def test_what_is_common_has_more_of_the_prior() -> None:
    ratio, unit = (effects.catalogue()[name] for name in ("rpm_scale", "unit_slip"))
    assert ratio(factor=7.0, eps=0.0).odds() > ratio(factor=5.0, eps=0.0).odds() > ratio(factor=0.2, eps=0.0).odds() > 0
    kgf, ounce = (unit_errors.named(name, "N").factor for name in ("kgf", "ozf"))
    assert unit("thrust_N", kgf).odds() > unit("thrust_N", ounce).odds() > 0.0
