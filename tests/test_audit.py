"""Promise: every setting of a CFD run becomes a line with a consequence, and what nobody stated stays unknown."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from bemt.recordings import audit as au
from bemt.recordings.audit import STATUSES, AuditLine, CfdFacts, audit, combined
from bemt.recordings.audit_remarks import audit_rows, facts_from_remark

TOPICS = [
    "domain against disk",
    "compressibility against tip Mach",
    "grid study",
    "iterative drift",
    "balance of mass and momentum",
    "wall treatment against y+",
    "turbulence model",
    "where the thrust was read",
    "frozen rotor against inflow",
]
GOOD = CfdFacts(
    M_tip=0.625,
    J=0.0,
    pitch_over_D=0.625,
    CT=0.1,
    domain_over_D=5.0,
    compressible=True,
    grids=3,
    u_grid=0.012,
    cells=847e3,
    drift=0.002,
    mass_balance=-0.001,
    momentum_balance=0.003,
    wall="automatic",
    y_plus=51.0,
    turbulence="k-omega SST",
    thrust_from="forces",
    steady_mrf=True,
)
THESIS = (
    "Fluent; rotating cell zone in a cylinder of the propeller's diameter, realizable k-epsilon with scalable wall "
    "functions; thrust read at one node; no mesh count and no grid study"
)


def line(facts: CfdFacts, topic: str) -> AuditLine:
    return next(item for item in audit(facts) if item.topic == topic)


@pytest.mark.parametrize("facts", [CfdFacts(), GOOD, replace(GOOD, ducted=True), facts_from_remark(THESIS)])
def test_every_audit_has_every_topic_once(facts: CfdFacts) -> None:
    lines = audit(facts)
    assert [item.topic for item in lines] == TOPICS
    for item in lines:
        assert item.status in STATUSES and item.finding and item.consequence
        assert math.isnan(item.u_relative) or 0.0 <= item.u_relative < 1.0


def test_nothing_stated_is_all_unknown() -> None:
    lines = audit(CfdFacts(steady_mrf=None))
    assert {item.status for item in lines} == {"not stated"}
    assert all(math.isnan(item.u_relative) for item in lines)
    whole, known = combined(lines)
    assert math.isnan(whole) and known == 0.0


def test_a_run_with_everything_known_has_a_number() -> None:
    lines = audit(GOOD)
    assert {item.status for item in lines} == {"fine"}
    whole, known = combined(lines)
    parts = [item.u_relative for item in lines]
    assert whole == known == pytest.approx(math.sqrt(sum(p * p for p in parts)))
    assert whole > max(0.012, 0.002, au.MEASURED["turbulence"])


def test_the_thesis_is_found_out() -> None:
    facts = facts_from_remark(THESIS, CfdFacts(M_tip=0.625, pitch_over_D=0.625, CT=0.11))
    assert (facts.domain_over_D, facts.grids, facts.thrust_from) == (1.0, 0, "node")
    assert (facts.wall, facts.turbulence, facts.steady_mrf) == ("scalable", "realizable k-epsilon", True)
    assert facts.compressible is None, "the thesis does not say"
    faults = {item.topic for item in audit(facts) if item.status == "fault"}
    assert faults == {"domain against disk", "grid study", "where the thrust was read"}
    assert math.isnan(combined(audit(facts))[0])


@pytest.mark.parametrize(
    ("compressible", "M", "status", "u"),
    [
        (True, 1.09, "fine", 0.0),
        (False, 0.2, "fine", 0.063 * (0.2 / 0.625) ** 2),
        (False, 0.45, "doubtful", 0.063 * (0.45 / 0.625) ** 2),
        (False, 0.625, "fault", 0.063),
        (False, 0.94, "fault", math.nan),
        (None, 0.625, "not stated", 0.063 / math.sqrt(3)),
        (None, 0.94, "not stated", math.nan),
        (None, 0.2, "fine", 0.063 * (0.2 / 0.625) ** 2),
    ],
)
def test_compressibility_follows_the_tip_mach_number(
    compressible: bool | None, M: float, status: str, u: float
) -> None:
    item = line(replace(GOOD, compressible=compressible, M_tip=M), TOPICS[1])
    assert item.status == status
    assert item.u_relative == pytest.approx(u, nan_ok=True)


def test_blockage_falls_with_the_square_of_the_domain_and_flight_joins_rest() -> None:
    at = {size: line(replace(GOOD, domain_over_D=size), TOPICS[0]).u_relative for size in (3.0, 6.0, 12.0)}
    assert at[3.0] / at[6.0] == pytest.approx(4.0) and at[6.0] / at[12.0] == pytest.approx(4.0)
    slow = line(replace(GOOD, J=1e-6), TOPICS[0]).u_relative
    assert slow == pytest.approx(line(GOOD, TOPICS[0]).u_relative, rel=1e-4), "the limit at rest"
    # static, by hand: J off by a/(2 sqrt 2) sqrt(4 CT / pi), over J0 = 1.19 P/D
    by_hand = (1 / 25) / (2 * math.sqrt(2)) * math.sqrt(0.4 / math.pi) / (1.19 * 0.625)
    assert line(GOOD, TOPICS[0]).u_relative == pytest.approx(by_hand)


@pytest.mark.parametrize("size", [1.0, 1.3, 1.9])
def test_no_number_is_made_up_where_the_correction_does_not_hold(size: float) -> None:
    assert math.isnan(line(replace(GOOD, domain_over_D=size), TOPICS[0]).u_relative)


@pytest.mark.parametrize(
    ("wall", "y_plus", "status"),
    [
        ("function", 60.0, "fine"),
        ("function", 12.0, "doubtful"),
        ("scalable", 400.0, "fault"),
        ("automatic", 2.0, "fine"),
        ("automatic", 16.0, "doubtful"),
        ("resolved", 0.8, "fine"),
        ("resolved", 25.0, "fault"),
        ("", 50.0, "not stated"),
        ("function", math.nan, "not stated"),
    ],
)
def test_wall_treatment_goes_with_its_first_cell(wall: str, y_plus: float, status: str) -> None:
    assert line(replace(GOOD, wall=wall, y_plus=y_plus), TOPICS[5]).status == status


@pytest.mark.parametrize(
    ("skew", "steady", "status"), [(0.0, True, "fine"), (30.0, True, "fault"), (30.0, False, "fine")]
)
def test_a_frozen_rotor_does_not_see_skewed_inflow(skew: float, steady: bool, status: str) -> None:
    assert line(replace(GOOD, skew_deg=skew, steady_mrf=steady), TOPICS[8]).status == status


@pytest.mark.parametrize(
    ("mass", "momentum", "status", "u"),
    [
        (0.001, -0.004, "fine", 0.004),
        (0.11, 0.001, "fault", math.nan),
        (0.001, -0.13, "fault", math.nan),
        (math.nan, 0.13, "fault", math.nan),
        (0.001, math.nan, "not stated", math.nan),
        (math.nan, math.nan, "not stated", math.nan),
    ],
)
def test_a_flow_that_does_not_balance_is_a_fault(mass: float, momentum: float, status: str, u: float) -> None:
    item = line(replace(GOOD, mass_balance=mass, momentum_balance=momentum), TOPICS[4])
    assert item.status == status and item.u_relative == pytest.approx(u, nan_ok=True)


def test_drift_and_grid_are_taken_as_they_are() -> None:
    assert line(replace(GOOD, drift=-0.03), TOPICS[3]) == replace(
        line(replace(GOOD, drift=0.03), TOPICS[3]), finding="thrust drifts by -3.00% over the averaged part"
    )
    assert line(replace(GOOD, drift=0.03), TOPICS[3]).u_relative == 0.03
    assert line(replace(GOOD, u_grid=0.05), TOPICS[2]).status == "doubtful"
    assert line(replace(GOOD, u_grid=math.nan, grids=None), TOPICS[2]).status == "not stated"


def test_rules_of_an_open_propeller_are_not_used_for_a_duct() -> None:
    ducted = replace(GOOD, ducted=True, compressible=False, y_plus=12.0)
    for topic in (TOPICS[0], TOPICS[1], TOPICS[5], TOPICS[6]):
        assert math.isnan(line(ducted, topic).u_relative), topic


@pytest.mark.parametrize(
    ("remark", "field", "value"),
    [
        ("incompressible", "compressible", False),
        ("compressible", "compressible", True),
        ("drift 0.4 %", "drift", 0.004),
        ("mass balance 0.2 %", "mass_balance", 0.002),
        ("forces and momentum balance 12 %", "momentum_balance", 0.12),
        ("GCI 2.3 %", "u_grid", 0.02),
        ("domain 10 D", "domain_over_D", 10.0),
        ("249000 cells", "cells", 249000.0),
        ("sliding mesh", "steady_mrf", False),
        ("skew 30 deg", "skew_deg", 30.0),
    ],
)
def test_set_phrases_are_read(remark: str, field: str, value: object) -> None:
    assert getattr(facts_from_remark(remark), field) == value


def test_other_words_say_nothing() -> None:
    assert facts_from_remark("a nice picture; ran on Tuesday; the propeller is 8 in") == replace(CfdFacts())


def test_rows_of_a_sweep_are_audited_by_their_remarks() -> None:
    row = {
        "source": "cfd",
        "label": "cfd 2.6 kgf",
        "rpm": 20000.0,
        "airspeed_m_s": 0.0,
        "CT": 0.11,
        "M_tip": 0.63,
        "remark": THESIS,
    }
    found = audit_rows([row, {**row, "source": "bench"}, {**row, "label": "b", "CT": None}], 0.2032, 0.127, False)
    assert [item["reference"] for item in found] == ["cfd 2.6 kgf", "b"]
    assert [entry["topic"] for entry in found[0]["lines"]] == TOPICS
