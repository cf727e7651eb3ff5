"""The promise of the readable method: the same loads as the kernel, in about a hundred lines."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray

from bemt.physics.air import Air
from bemt.physics.bem import kernel as K
from bemt.physics.bem import plain, solver
from bemt.physics.effects import catalogue
from bemt.physics.sections.polars import linear_polar
from geometry.laws import helix
from geometry.rotor import Rotor

Array = NDArray[np.float64]
EFFECTS = ("tip_loss", "hub_loss", "swirl", "high_induction")
AIR = Air.from_density()


def both(V: float, rpm: float = 6000.0, B: int = 2) -> tuple[plain.PlainLoads, solver.Solution]:
    """One rotor with one section table, by both."""
    rotor = Rotor(helix(0.254, 0.127), B=B)
    polar = linear_polar(cd=0.012)
    prep = solver.prepare(rotor, [(0.75, polar)], tuple(catalogue()[name]() for name in EFFECTS), None, 40)
    st = prep.st

    def section(alpha: Array, Re: Array, M: Array) -> tuple[Array, Array]:
        turn = np.angle(np.exp(1j * alpha))
        return (np.interp(turn, polar.alpha, polar.cl[:, 0, 0]), np.interp(turn, polar.alpha, polar.cd[:, 0, 0]))

    blade = plain.PlainBlade(st[:, K.S_R], st[:, K.S_DR], st[:, K.S_CHORD], st[:, K.S_BETA], B, rotor.Rhub, rotor.R)
    Omega = rpm * math.pi / 30.0
    rho, mu, a = (float(np.asarray(x)) for x in (AIR.rho, AIR.mu, AIR.a_sound))
    return plain.solve_plain(blade, section, Omega, V, rho, mu, a), solver.solve(prep, rpm, V, AIR, radial=True)


@pytest.mark.parametrize("B", [2, 4])
@pytest.mark.parametrize("V", [0.0, 3.0, 8.0, 15.0, 25.0])
def test_the_readable_method_gives_the_kernel_s_loads(V: float, B: int) -> None:
    """At rest, in flight, beyond zero thrust."""
    ours, kernel = both(V, B=B)
    assert ours.T == pytest.approx(kernel.T[0], rel=1e-6, abs=1e-6)
    assert ours.Q == pytest.approx(kernel.Q[0], rel=1e-6, abs=1e-8)
    np.testing.assert_allclose(ours.phi, kernel.radial.phi[0], atol=1e-6)
    np.testing.assert_allclose(ours.F, kernel.radial.F[0], atol=1e-5)
    np.testing.assert_allclose(ours.W, kernel.radial.W[0], rtol=1e-6)


def test_the_worked_element_of_the_theory_page_is_that_of_the_plain_method(
    project: Path, script: Callable[[str], ModuleType]
) -> None:  # fmt: skip
    """Every number of the section follows from docs/element.py, to its digits."""
    n = script("element").numbers()
    page = (project / "docs" / "theory.md").read_text(encoding="utf-8")
    page = " ".join(page[page.index("**Worked number.**") : page.index("## The residual of one")].split())
    for pattern, value in {
        r"= ([\d.]+) deg\. Without": n["beta_deg"], r"= ([\d.]+) deg\. 2\.": n["onset_deg"],
        r"`phi` = ([\d.]+) deg": n["phi_deg"], r"`alpha` = ([\d.]+) deg": n["alpha_deg"], r"`cl` = ([\d.]+)": n["cl"],
        r"W = ([\d.]+) m/s": n["W"], r"`w = W sin\(phi\)` = ([\d.]+) m/s": n["w"], r"factor is F = ([\d.]+) ": n["F"],
        r"0\.457 = ([\d.]+) N": n["dT"], r"3\.04 = ([\d.]+) N": n["dT"], r"torque is ([\d.]+) mN": n["dQ_mNm"],
        r"efficiency of the element ([\d.]+)\. ": n["eta"], r"\(1\) ([\d.]+) N": n["dT_rest"],
        r"No: ([\d.]+) N": n["dT_three"], r"N, ([\d.]+) times": n["dT_three"] / n["dT"],
        r"\(3\) ([\d.]+) m/s": n["V_none"], r"Here q = ([\d.]+),": n["q"], r"`phi_w` = ([\d.]+) deg": n["phi_w_deg"],
        r"deg, f = ([\d.]+)\. ": n["f"], r"at this angle F = ([\d.]+)\. ": n["F_disk"],
    }.items():  # fmt: skip
        found = re.search(pattern, page)
        assert found is not None, pattern
        digits = len(found[1].partition(".")[2])
        assert float(found[1]) == pytest.approx(value, abs=0.51 * 10.0**-digits), pattern
