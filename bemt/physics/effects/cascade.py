"""Mutual interference of blades at high solidity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.physics.effects.base import Array, Effect, Flow, Parameter, RotorBuild
from bemt.physics.sections.row import row_shift, weinig_factor

if TYPE_CHECKING:
    from geometry.airfoil import Airfoil

FORMS = ("potential", "carter")
# A blade row this loose is a propeller, this tight a compressor's: between them what was measured on compressor rows
# fades in.
LOOSE, TIGHT = 0.3, 0.6
# Whole up to the first angle from zero lift, nothing beyond the second: separated flow knows little of its row.
_ATTACHED, _BROADSIDE = np.radians(30.0), np.radians(90.0)
_STEEPEST = np.radians(85.0)
_SLOPES = (0.2, 1.6)
# Equivalent diffusion beyond which the boundary layer of Lieblein's fit has left the blade.
_D_EQ_MAX = 2.2


@dataclass(frozen=True)
class Cascade(Effect):
    """Section in a row of blades: lift slope and zero-lift angle of the row in the place of the single section's.

    Notes
    -----
    A row turns the flow at most to its own exit angle (potential flow of the row; losses: Carter 1950, Lieblein 1959,
    Howell 1945, not checked). Isolated sections turn it 50 % too far at solidity 1. ``form = "potential"``: slope and
    zero-lift angle of the row of the blade's own sections, thick and cambered
    (:func:`bemt.physics.sections.row.row_shift`), over those of the isolated section. The table is read at the angle
    where the isolated section carries the same share of its lift, alpha_0 + K (alpha - alpha_0 - shift). Drag and stall
    move with the lift. A blade without section shapes uses one with the zero-lift angle of the table. ``form =
    "carter"``: Weinig's slope of flat plates; the zero-lift angle makes a circular arc at zero incidence leave with
    Carter's deviation, m theta sqrt(s/c) with m = 0.23 + 0.1 beta_2 / 50 deg (Carter 1950, ARC R&M 2804; as quoted in
    Cohen, Rogers and Saravanamuttoo, Gas Turbine Theory, sec. 5.9; not checked), in rows of solidity above 0.6, faded
    in from 0.3.

    ``zero_lift`` is the share of the row's shift of the zero-lift angle; 0 keeps that of the isolated section. At the
    solidity of a two-blade propeller (below 0.1) K differs from 1 by less than 1 %. Losses of compressor rows are faded
    in over the same range: drag is at least that of Lieblein's wake momentum thickness theta/c = 0.004 / (1 - 1.17 ln
    D_eq), D_eq = cos(b2) / cos(b1) (1.12 + 0.61 cos^2(b1) / sigma (tan(b1) - tan(b2))) (Lieblein 1959, J. Basic Eng.
    81:387; not checked). A ducted row also has secondary losses, 0.018 cl^2 (Howell 1945, Proc. IMechE 153:441; as
    quoted in Cohen, Rogers and Saravanamuttoo; not checked against the paper). Howell's annulus loss, 0.020 s/h with
    spacing s and blade height h, is friction of both walls expressed as drag of the blades. It is left out: the outer
    wall stands still and brakes the stream, not the shaft, and the friction of both is in the duct's balance of
    pressure already (:mod:`bemt.physics.bem.duct`). Counted again, at half of its size, it raises the torque of four
    wide blades in nozzle 19A by 7 to 40 %.
    """

    zero_lift: float = 1.0
    secondary: float = 0.018
    form: str = "potential"

    id = "cascade"
    inviscid = True
    title = "blade interference at high solidity (cascade)"
    sign = (
        "less thrust and less torque by shares that grow with solidity and barely depend on speed; solidity above 0.3"
    )
    words = {"form": FORMS}
    parameters = (
        Parameter("zero_lift", "1", 0.0, 1.0, "1: the row's zero-lift angle; 0: the single section's", steps=0),
        Parameter("secondary", "1", 0.010, 0.030, "Howell 1945: 0.018", steps=0),
    )
    order = 30

    def applies(self, flow: Flow) -> str:
        """Blades far apart are single ones."""
        solidity = flow.B * flow.chord / (2.0 * np.pi * 0.75 * flow.R)
        return "" if solidity > LOOSE else f"solidity {solidity:.2f} at 0.75 R: the blades are far apart"

    def variants(self) -> tuple[dict[str, str | float], ...]:
        """Both forms, and the row with the single section's zero-lift angle."""
        return {"form": "potential"}, {"form": "carter"}, {"form": "potential", "zero_lift": 0.0}

    def section(self, bake: RotorBuild) -> None:
        """Read the tables at the angle that the row leaves of the incidence; add the losses of rows."""
        stagger = np.minimum(0.5 * np.pi - np.abs(bake.beta), _STEEPEST)  # turned the other way: a mirror image
        K, shift = _row(bake, stagger)
        if self.form == "carter":
            K, shift = _carter(bake, stagger, K, shift)
        _read_at(bake, K, self.zero_lift * shift)
        tight = np.clip((bake.sigma - LOOSE) / (TIGHT - LOOSE), 0.0, 1.0)
        k = np.flatnonzero(tight > 0.0)
        if k.size:
            tight = tight[k, None, None, None]
            near = slice(*np.searchsorted(bake.alpha, [-_ATTACHED, _ATTACHED]))
            cd = bake.cd[k, :, :, near]
            bake.cd[k, :, :, near] += tight * np.maximum(_diffusion_drag(bake, stagger, k, near) - cd, 0.0)
            if bake.ducted:
                bake.cd[k] += tight * self.secondary * bake.cl[k] ** 2


def _row(bake: RotorBuild, stagger: Array) -> tuple[Array, Array]:
    """Slope of the row over that of the section alone (N,), and shift of the zero-lift angle (N, 1) [rad]."""
    sections = bake.sections or _stand_in(bake)
    x = np.array([r_R for r_R, _ in sections])
    # blades turned the other way are the mirror image; at zero pitch the row is half one, half the other
    upright = np.clip(0.5 + 0.5 * bake.beta / (0.5 * np.pi - _STEEPEST), 0.0, 1.0)
    out = np.zeros((2, bake.r.size))
    for weight, (_, section) in zip(np.eye(x.size), sections, strict=True):
        at = np.interp(bake.r / bake.R, x, weight)
        for side, share in ((1.0, at * upright), (-1.0, at * (1.0 - upright))):
            k = np.flatnonzero(share > 0.0)
            if k.size:
                out[:, k] += share[k] * np.array(row_shift(section, bake.sigma[k], side * stagger[k]))
    return np.clip(out[0], *_SLOPES), out[1][:, None]


def _stand_in(bake: RotorBuild) -> tuple[tuple[float, Airfoil], ...]:
    """Section for blades that have none: camber by thin-aerofoil theory from the zero-lift angle of the tables."""
    from geometry.airfoil import naca4

    camber = -0.5 * float(np.median(bake.alpha0))
    return ((0.75, naca4(min(max(round(camber, 3), -0.09), 0.09), 0.5, round(float(np.median(bake.thickness)), 3))),)


def _carter(bake: RotorBuild, stagger: Array, K: Array, shift: Array) -> tuple[Array, Array]:
    """Weinig's slope, and the shift at which a circular arc met along its camber line leaves by Carter's deviation."""
    tight = np.clip((bake.sigma - LOOSE) / (TIGHT - LOOSE), 0.0, 1.0)
    K = K + tight * (np.clip(weinig_factor(bake.sigma, stagger), *_SLOPES) - K)
    sigma = np.maximum(bake.sigma, LOOSE)
    sections = bake.sections or _stand_in(bake)
    f = np.interp(bake.r / bake.R, [r_R for r_R, _ in sections], [section.camber for _, section in sections])
    side = np.where(bake.beta < 0.0, -1.0, 1.0)
    theta = 4.0 * np.arctan(2.0 * side * f)
    b1 = np.clip(stagger + 0.5 * theta, -_STEEPEST, _STEEPEST)
    per_root = theta / np.sqrt(sigma)
    b2 = (stagger - 0.5 * theta + 0.23 * per_root) / (1.0 - 0.1 / np.radians(50.0) * per_root)
    bm = np.arctan(0.5 * (np.tan(b1) + np.tan(b2)))
    cl = 2.0 / sigma * np.cos(bm) * (np.tan(b1) - np.tan(b2))
    zero = (side * (bm - stagger))[:, None] - (side * cl / K)[:, None] / bake.cla
    return K, shift + tight[:, None] * (zero - bake.alpha0 - shift)


def _read_at(bake: RotorBuild, K: Array, shift: Array) -> None:
    """Read both tables at alpha_0 + K (alpha - alpha_0 - shift), at the angle itself far from zero lift."""
    alpha = bake.alpha
    near = slice(*np.searchsorted(alpha, [-0.5 * np.pi - 0.3, 0.5 * np.pi + 0.3]))
    a = alpha[near]
    zero = bake.alpha0[:, :, None]
    x = a - zero - shift[:, :, None]
    fade = np.clip((_BROADSIDE - np.abs(x)) / (_BROADSIDE - _ATTACHED), 0.0, 1.0)
    fade = fade * fade * (3.0 - 2.0 * fade)
    seen = a + fade * (zero + K[:, None, None] * x - a)
    place = np.interp(seen, a, np.arange(float(a.size)))
    i = np.minimum(place.astype(np.intp), a.size - 2)
    weight = place - i
    n, n_m, n_r, n_a = bake.cl.shape
    i += near.start + n_a * (np.arange(n_r)[:, None] + n_m * n_r * np.arange(n)[:, None, None])
    for table in (bake.cl, bake.cd):
        flat = np.ascontiguousarray(table).reshape(-1).copy()
        for m in range(n_m):
            low = flat.take(i + m * n_r * n_a)
            table[:, m, :, near] = low + weight * (flat.take(i + (m * n_r * n_a + 1)) - low)
    bake.alpha0 = bake.alpha0 + shift
    bake.cla = bake.cla * K[:, None]


def _diffusion_drag(bake: RotorBuild, stagger: Array, k: NDArray[np.intp], near: slice) -> Array:
    """Drag by Lieblein's momentum thickness at the diffusion of each lift, zero where the row does not pump."""
    side = np.where(bake.beta[k] < 0.0, -1.0, 1.0)[:, None, None, None]
    sigma = np.maximum(bake.sigma[k], LOOSE)[:, None, None, None]
    bm = np.clip(stagger[k, None, None, None] + side * bake.alpha_col[..., near], -_STEEPEST, _STEEPEST)
    cl = side * bake.cl[k, :, :, near]
    half = 0.25 * sigma * np.maximum(cl, 0.0) / np.cos(bm)
    t1, t2 = np.tan(bm) + half, np.tan(bm) - half
    c1, c2 = 1.0 + t1 * t1, 1.0 + t2 * t2
    D_eq = np.sqrt(c1 / c2) * (1.12 + 1.22 / c1 / sigma * half)
    theta = 0.004 / (1.0 - 1.17 * np.log(np.clip(D_eq, 1.0, _D_EQ_MAX)))
    return np.where(cl > 0.0, np.minimum(2.0 * theta * np.cos(bm) ** 3 * c2 * np.sqrt(c2), 0.2), 0.0)
