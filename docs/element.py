"""One blade element for docs/theory.md: the picture, the worked number and the answers: ``python docs/element.py``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bemt.physics.bem.plain import PlainBlade, PlainLoads, solve_plain

DOCS = Path(__file__).resolve().parent
R, RHUB, AT, WIDE, CHORD, PITCH, OMEGA = 0.127, 0.020, 0.095, 0.005, 0.020, 0.127, 628.3
"""A 10x5 in metres, its element at 95 mm of 5 mm width, and 6,000 rev/min in rad/s."""


def section(alpha: np.ndarray, Re: np.ndarray, M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:  # noqa: ARG001
    """Straight lift curve with zero lift at -0.05 rad, and constant drag."""
    return 2.0 * np.pi * np.sin(alpha + 0.05), np.full_like(alpha, 0.02)


def element(V: float, B: int = 2, turned_deg: float = 0.0) -> PlainLoads:
    """Loads of the element."""
    beta = np.arctan(PITCH / (2.0 * np.pi * AT)) + np.radians(turned_deg)
    one = PlainBlade(*(np.array([v]) for v in (AT, WIDE, CHORD, beta)), B, RHUB, R)
    return solve_plain(one, section, OMEGA, V)


def numbers() -> dict[str, float]:
    """What the page states, by name."""
    rest, flight, three = element(0.0), element(8.0), element(8.0, 3)
    low, high = 8.0, 30.0
    for _ in range(60):  # speed at which the element has no thrust
        mid = 0.5 * (low + high)
        low, high = (mid, high) if element(mid).T > 0.0 else (low, mid)
    beta = np.arctan(PITCH / (2.0 * np.pi * AT))
    phi, W = float(flight.phi[0]), float(flight.W[0])
    q = 2.0 - 8.0 / (W * np.sin(phi))  # (V + 2 v) / (V + v)
    phi_w = np.arctan(np.tan(phi) * q**1.5)
    f, usual = ((R - AT) / (AT * np.sin(angle)) for angle in (phi_w, phi))
    return {
        "beta_deg": float(np.degrees(beta)), "onset_deg": float(np.degrees(np.arctan2(8.0, OMEGA * AT))),
        "phi_deg": float(np.degrees(phi)), "alpha_deg": float(np.degrees(beta - phi)), "W": W,
        "cl": float(section(np.array(beta - phi), np.array(0), np.array(0))[0]), "F": float(flight.F[0]),
        "q": q, "phi_w_deg": float(np.degrees(phi_w)), "f": float(f),
        "F_disk": float(2.0 / np.pi * np.arccos(np.exp(-usual))),
        "w": W * np.sin(phi), "dT": flight.T, "dQ_mNm": 1e3 * flight.Q, "eta": flight.T * 8.0 / (flight.Q * OMEGA),
        "dT_rest": rest.T, "dT_three": three.T, "V_none": low, "dT_turned": element(8.0, 2, 1.0).T,
    }  # fmt: skip


def picture(path: Path) -> None:
    """The annulus from the front, and the velocities at the element."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Annulus, Circle, Polygon

    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.35))
    left.add_patch(Circle((0, 0), R, fill=False, lw=1.0, ls="--"))
    left.add_patch(Annulus((0, 0), AT + 2 * WIDE, 4 * WIDE, color="#0072B2", alpha=0.25, lw=0))
    for turn in (0.0, np.pi):
        r = np.linspace(RHUB, R, 40)
        width = CHORD * (1.15 - 0.75 * ((r - 0.045) / R) ** 2)
        x, y = np.r_[r, r[::-1]], np.r_[0.35 * width, -0.65 * width[::-1]]
        points = np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)], axis=1)
        left.add_patch(Polygon(points, closed=True, fc="0.75", ec="0.2", lw=0.8))
    left.add_patch(Circle((0, 0), RHUB, fc="0.5", ec="0.2"))
    left.annotate("", (AT, -0.02), (0, -0.02), arrowprops={"arrowstyle": "<->", "shrinkA": 0, "shrinkB": 0})
    left.text(0.5 * AT, -0.036, "r", ha="center")
    left.annotate("annulus of width dr", (-0.068, 0.068), (-0.135, 0.145), arrowprops={"arrowstyle": "-"})
    left.annotate("", (0.085, 0.115), (0.125, 0.07), arrowprops={"arrowstyle": "->", "connectionstyle": "arc3,rad=0.2"})
    left.text(0.115, 0.115, "Ω")
    left.set(xlim=(-0.16, 0.16), ylim=(-0.15, 0.165), aspect="equal")

    # the blade moves to the left, the air goes down through the disk; angles are drawn larger than they are
    beta, phi = np.radians(36.0), np.radians(20.0)
    fall = np.tan(phi)
    arrow = {"arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0, "lw": 1.6}
    right.axhline(0.0, color="0.6", lw=0.8, ls="--")
    right.text(1.0, 0.03, "plane of rotation", fontsize=8, color="0.4", ha="right")
    for start, end, color, text, at in (
        ((-1, fall), (0, fall), "#0072B2", r"$\Omega r - v_t$", (-0.62, fall + 0.05)),
        ((0, fall), (0, 0), "#0072B2", r"$w = V + v$", (-0.27, 0.55 * fall)),
        ((-1, fall), (0, 0), "#D55E00", r"$W$", (-0.62, 0.5 * fall - 0.11)),
    ):
        right.annotate("", end, start, arrowprops=arrow | {"color": color})
        right.text(*at, text, color=color)
    x = np.linspace(0.0, 1.0, 60)
    thick = 0.6 * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
    camber = 0.16 * x * (1.0 - x)
    shape = 0.9 * np.stack([np.r_[x, x[::-1]] - 0.25, np.r_[camber + thick, (camber - thick)[::-1]]])
    turn = np.array([[np.cos(beta), np.sin(beta)], [-np.sin(beta), np.cos(beta)]])
    right.add_patch(Polygon((turn @ shape).T, closed=True, fc="0.85", ec="0.2", lw=0.8))
    chord, wind = np.array([np.cos(beta), -np.sin(beta)]), np.array([np.cos(phi), -np.sin(phi)])
    right.plot(*np.stack([-0.25 * chord, 1.0 * chord]).T, color="0.2", lw=0.8, ls=":")
    right.plot(*np.stack([0.0 * wind, 1.0 * wind]).T, color="#D55E00", lw=0.9, ls="--")
    for low, high, radius, text, color in ((0.0, beta, 0.80, "β", "0.2"), (0.0, phi, 0.55, "φ", "0.2"),
                                           (phi, beta, 0.95, "α", "#D55E00")):  # fmt: skip
        t, at = np.linspace(low, high, 40), low + (0.25 if text == "β" else 0.5) * (high - low)
        right.plot(radius * np.cos(t), -radius * np.sin(t), color=color, lw=1.0)
        right.text((radius + 0.03) * np.cos(at), -(radius + 0.03) * np.sin(at), text, color=color, va="center")
    lift = np.array([np.sin(phi), np.cos(phi)])
    for end, text, at in ((0.75 * lift, r"$dL$", 0.75 * lift + [0.03, -0.02]), (0.25 * wind, r"$dD$", (0.27, -0.085))):
        right.annotate("", end, (0, 0), arrowprops=arrow | {"color": "#009E73"})
        right.text(*at, text, color="#009E73")
    right.set(xlim=(-1.1, 1.05), ylim=(-0.65, 0.8), aspect="equal")
    for axes in (left, right):
        axes.axis("off")
    figure.savefig(path, dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    picture(DOCS / "img" / "element.png")
    print({k: round(v, 5) for k, v in numbers().items()})
