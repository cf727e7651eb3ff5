"""The shipped NACA table: NeuralFoil's own answers, within its stated error."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from itertools import product

import numpy as np
import pytest

from bemt.physics.sections import neuralfoil
from bemt.physics.sections.rule import FAMILIES, RuleSection, airfoil
from bemt.rotors.case.unknowns import section_of
from geometry.airfoil import Airfoil, naca, naca4


def unknown(section: Airfoil) -> Airfoil:
    """The same outline, of which nobody says that it is a NACA section: NeuralFoil itself is asked."""
    return dataclasses.replace(section, four_digit=None)


@pytest.mark.parametrize("at", [(0, 2, 3, 1), (0, 0, 0, 4), (1, 4, 6, 0), (0, 6, 2, 3)])
def test_the_table_holds_what_neuralfoil_answers(at: tuple[int, ...]) -> None:
    pytest.importorskip("neuralfoil")
    p, m, t, n = (axis[i] for axis, i in zip(neuralfoil.table().axes, at, strict=True))
    section = naca4(m, p, t)
    held = neuralfoil.raw_polar((m, p, t), n)
    asked = neuralfoil.ask(section, neuralfoil.table().Re, n)
    assert np.abs(held.cl - asked.cl).max() <= 1.01e-4
    assert np.abs(np.log(held.cd / asked.cd)).max() <= 2.6e-4
    assert np.array_equal(held.confidence >= neuralfoil.CONFIDENCE_MIN, asked.confidence >= neuralfoil.CONFIDENCE_MIN)


@pytest.mark.parametrize("shape", [(0.0275, 0.40, 0.067, 2.0), (0.045, 0.40, 0.095, 6.0), (0.065, 0.45, 0.115, 8.0)])
def test_between_the_nodes_attached_flow_is_met(shape: tuple[float, ...]) -> None:
    pytest.importorskip("neuralfoil")
    section, n_crit = naca4(*shape[:3]), shape[3]
    a, b = (neuralfoil.tunnel_polar(s, n_crit=n_crit) for s in (section, unknown(section)))
    attached = np.abs(np.degrees(a.alpha) - 3.0) <= 5.0
    usual = (a.Re >= 6e4) & (a.Re <= 1e6)
    cl, ln_cd = (np.abs(x - y)[attached][:, usual] for x, y in ((a.cl, b.cl), (np.log(a.cd), np.log(b.cd))))
    assert np.median(cl) < 2e-3 and np.quantile(cl, 0.95) < 0.01 and cl.max() < 0.06
    assert np.median(ln_cd) < 0.01 and np.quantile(ln_cd, 0.95) < 0.05 and ln_cd.max() < 0.15


def test_the_rule_and_its_ranges_need_no_network() -> None:
    for section in (RuleSection(0.75, 0.035, 0.4, 0.09), *(s for one in FAMILIES.values() for s in one)):
        if section.shape == "naca4":
            assert neuralfoil.covers(airfoil(section).four_digit, 3.0)
    for ends in ((0.02, 0.4, 0.06), (0.07, 0.4, 0.12), (0.03, 0.45, 0.12)):
        assert neuralfoil.covers(naca4(*ends).four_digit, 1.0) and neuralfoil.covers(naca4(*ends).four_digit, 9.0)
    for kind in ("slow_flyer", "sport", "reversible", None):  # what a label's rotor may be
        camber, thickness = section_of(kind)
        for ends in product((camber.low, camber.value, camber.high), (thickness.low, thickness.high), (1.0, 5.0)):
            assert neuralfoil.covers(naca4(ends[0], 0.4, ends[1]).four_digit, ends[2])
    assert naca("4412").four_digit == (0.04, 0.4, 0.12)
    assert naca4(0.04, 0.4, 0.12, te_gap=0.0).four_digit is None  # another shape
    assert not neuralfoil.covers((0.04, 0.42, 0.10), 3.0) and not neuralfoil.covers((0.04, 0.4, 0.10), 9.5)


_WITHOUT = """
import sys
sys.modules["neuralfoil"] = None
import importlib.util
find = importlib.util.find_spec
from bemt.base import cache
cache.find_spec = lambda name: None if name == "neuralfoil" else find(name)
import bemt
print(bemt.propeller("10x5").solve(6000).thrust_N)
from bemt.base.errors import InputError
from bemt.physics.sections.neuralfoil import tunnel_polar
from geometry.airfoil import naca
try:
    tunnel_polar(naca("2415"))
except InputError as error:
    print(error)
print(sorted({"aerosandbox", "casadi"} & set(sys.modules)))
"""


def test_without_neuralfoil_a_label_is_answered_and_another_section_names_the_extra() -> None:
    done = subprocess.run([sys.executable, "-c", _WITHOUT], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "[neuralfoil]" in done.stdout and done.stdout.strip().endswith("[]")
