"""The story of a sitting: what was run, what was said after each run, and what was decided; HTML and a picture."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.canvas import CYCLE, GREY, STYLE, blank, frame, png
from bemt.base.page import render
from bemt.base.tables import write_atomic
from bemt.judge.proof.loop import Course

if TYPE_CHECKING:
    from bemt.rotors.propeller import Propeller

_MOST = 5  # Explanations in a picture
_KINDS = {"again": "recording", "run": "run", "reference": "reference"}


def write(
    out: Path, rotor: Propeller, course: Course, made: Sequence[tuple[str, str]], lines: Sequence[str]
) -> tuple[Path, ...]:  # fmt: skip
    """Write story.html and story.png."""
    if not made:
        return ()
    picture = out / "story.png"
    write_atomic(picture, png(drawn(rotor, course, made)))
    told = [tuple(line.partition(": ")[::2]) for line in lines]
    image = base64.b64encode(picture.read_bytes()).decode()
    page = render("bemt.tools.stand", "story.html", title=f"{rotor.name} on the stand", lines=told, image=image)
    write_atomic(out / "story.html", page)
    return out / "story.html", picture


def drawn(rotor: Propeller, course: Course, made: Sequence[tuple[str, str]]) -> Any:
    """Loads over those of the model, run by run, beside the probabilities after each answer."""
    import matplotlib

    made = made[:4]
    with matplotlib.rc_context(STYLE):
        return _drawn(rotor, course, made)


def _drawn(rotor: Propeller, course: Course, made: Sequence[tuple[str, str]]) -> Any:
    figure, axes = blank(3.0, 1, 3)
    for k, (kind, text) in enumerate(made):
        rows = np.genfromtxt(text.splitlines(), delimiter=",", names=True)
        points = rotor.solve(rpm=rows["rpm"], airspeed_m_s=rows["airspeed_m_s"], bands=False)
        for ax, name in zip(axes[0], ("thrust_N", "torque_Nm"), strict=False):
            share = 100.0 * (rows[name] / np.asarray(getattr(points, name)) - 1.0)
            u = 100.0 * rows[f"u_{name}"] / np.asarray(getattr(points, name))
            ax.errorbar(rows["rpm"], share, u, fmt="o", ms=3, lw=0.8, color=CYCLE[k], label=f"{k + 1} {_KINDS[kind]}")
    for ax, what in zip(axes[0], ("thrust", "torque"), strict=False):
        ax.axhline(0.0, color=GREY, lw=0.8)
        ax.set(xlabel="speed [rev/min]", title=f"{what} off the model [%]")
        frame(ax)
    axes[0, 0].legend()
    ax = axes[0, 2]
    said = [{r.effect or "nothing": r.probability for r in a.ranking} for a in course.answers]
    names = list(dict.fromkeys(n for one in said for n in sorted(one, key=lambda n: -one[n])[:3]))[:_MOST]
    for k, one in enumerate(said):
        at = np.arange(len(names)) + 0.8 * (k + 0.5) / len(said) - 0.4
        share = [one.get(n, 0.0) for n in names]
        ax.barh(at, share, 0.7 / len(said), color=CYCLE[k % len(CYCLE)], label=f"answer {k + 1}")
    ax.set(yticks=np.arange(len(names)), yticklabels=names, xlim=(0.0, 1.0), title="probability")
    ax.invert_yaxis()
    ax.legend()
    frame(ax)
    return figure
