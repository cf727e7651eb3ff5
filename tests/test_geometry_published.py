"""Published sections: the numbers their authors state, and the same shapes from another collection."""

from __future__ import annotations

import numpy as np
import pytest

from bemt.sections import rule as section_rule
from geometry.airfoil import naca
from geometry.common import GeometryError
from geometry.published import PUBLISHED, published, thickened


def test_sda1075_has_the_blunt_edge_of_the_printed_blades() -> None:
    section = published("sda1075")
    assert section.thickness == pytest.approx(0.12, abs=2e-4)  # 12 % thick with the edge that printing asked for
    assert section.te_gap == pytest.approx(0.011, abs=5e-4)


def test_clark_y_is_that_of_the_uiuc_collection() -> None:
    import aerosandbox

    other = aerosandbox.Airfoil("clarky")
    x = np.linspace(0.02, 0.98, 49)
    upper, lower = published("clark_y").surfaces(x)
    for ours, theirs in ((upper, other.upper_coordinates()[::-1]), (lower, other.lower_coordinates())):
        assert np.max(np.abs(ours - np.interp(x, *theirs.T))) < 0.003  # theirs was smoothed


def test_clark_y_lies_on_its_chord_not_on_its_flat_bottom() -> None:
    section = published("clark_y")
    nose = section.y[np.argmin(section.x)]
    assert abs(nose) < 1e-3 and 0.5 * (section.y[0] + section.y[-1]) == pytest.approx(0.0, abs=1e-12)
    x = np.array([0.4, 0.9])
    flat = section.surfaces(x)[1]
    assert np.degrees(np.arctan(np.diff(flat)[0] / np.diff(x)[0])) == pytest.approx(1.97, abs=0.05)


@pytest.mark.parametrize("name", PUBLISHED)
def test_scaling_keeps_the_shape(name: str) -> None:
    section = published(name)
    assert thickened(section, section.thickness).y == pytest.approx(section.y, rel=1e-12, abs=1e-15)
    thin = thickened(section, 0.05)
    assert thin.thickness == pytest.approx(0.05, rel=1e-9)
    assert thin.camber / section.camber == pytest.approx(0.05 / section.thickness, rel=1e-6)


def test_faults_are_said() -> None:
    with pytest.raises(GeometryError, match="'clarkx'; expected sda1075 or clark_y"):
        published("clarkx")
    with pytest.raises(GeometryError, match="4 % is 0.04"):
        thickened(naca("0012"), 12.0)


def test_a_thickness_file_replaces_the_law_of_its_family_and_of_no_other() -> None:
    law = ([0.3, 0.6, 0.95], [0.3671, 0.10, 0.08])
    told = section_rule.sections("nr640", law)
    assert [s.thickness for s in told][:2] == [0.25, 0.25]  # thicker is hub
    assert told[-1].thickness == pytest.approx(0.08)
    assert section_rule.airfoil(told[-1]).thickness == pytest.approx(0.08, rel=1e-9)
    assert section_rule.airfoil(told[-1]).camber == pytest.approx(told[-1].camber, rel=0.01)
    for family in ("da4002", "apcsf", None):
        assert section_rule.sections(family, law) == section_rule.sections(family)
    assert section_rule.section_at(0.75, "nr640").r_R == pytest.approx(0.75, abs=0.08)
