"""Every figure that README.md and docs/believe.md state, with the committed report that holds it.

A row is a sentence with a mark per number and a function of a report that gives these numbers; `check` compares them
to the digits stated. `tests/test_figures.py` runs it, and holds that no other number stands in those paragraphs.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
README, BELIEVE = "README.md", "docs/believe.md"
PARTS = {README: ("## What to believe", "## Read on"), BELIEVE: ("* **Measured", "* Formulas")}
"""Where a page states results: from, to."""
NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d,]*(?:\.\d+)?(?![\w.]*\d)")
NO_RESULT = {
    README: "68 %|K1/K2|version 0\\.[23]|95 %",
    BELIEVE: "K1/K2|volume [12]|68 %|95 %|\\b\\d+x\\d+\\b|2\\.5 in|DS-30|20,000|8,000 rev|8 and 12 deg|5 deg|X-22A|19A"
    "|version 0\\.[23]|\\]\\([^)]*\\)|J 0\\.[68]|0\\.8 P/D|one in ten|76 mm|0\\.4 mm|goals 70 and 45|1 %",
}  # fmt: skip
"""Numbers that name a thing, a definition or a condition, not a result."""
NUM = r"([-+]?\d[\d,]*(?:\.\d+)?)"


@dataclass(frozen=True)
class Figure:
    """A sentence of `page`, ``#`` for each number, and the numbers as `report` holds them."""

    page: str
    sentence: str
    report: str
    numbers: Callable[[Any], Sequence[float]]

    def stated(self) -> list[str]:
        """Numbers in the sentence as the page has it; empty when it has no such sentence."""
        text = " ".join((ROOT / self.page).read_text(encoding="utf-8").split())
        found = re.search(re.escape(self.sentence).replace(r"\#", NUM).replace(r"\ ", " "), text)
        return list(found.groups()) if found else []

    def held(self) -> list[float]:
        """Numbers that the report holds."""
        return [float(v) for v in self.numbers(load(self.report))]


@cache
def load(report: str) -> Any:
    """A committed report: JSON as it is, another file as text with single blanks."""
    text = (ROOT / report).read_text(encoding="utf-8")
    return json.loads(text) if report.endswith(".json") else text


def agrees(stated: str, held: float) -> bool:
    """Whether a number is stated to its digits.

    >>> agrees("6.1", 6.14), agrees("6.1", 6.2), agrees("456", 456)
    (True, False, True)
    """
    text = stated.replace(",", "").lstrip("+")
    digits = len(text.partition(".")[2])
    return abs(held - float(text)) <= 0.5000001 * 10.0**-digits


def check(figure: Figure) -> str:
    """What is wrong with a figure; empty when nothing is."""
    said, held = figure.stated(), figure.held()
    if len(said) != len(held):
        return f"{figure.page} has no sentence {figure.sentence!r} with {len(held)} numbers"
    wrong = [f"{s}, {figure.report} holds {h:.5g}" for s, h in zip(said, held, strict=True) if not agrees(s, h)]
    return f"{figure.page}: {figure.sentence!r} states " + "; ".join(wrong) if wrong else ""


def unheld(page: str) -> list[str]:
    """Numbers of the paragraphs of results that no row holds and that name no thing."""
    text = (ROOT / page).read_text(encoding="utf-8")
    first, last = PARTS[page]
    text = " ".join(text[text.index(first) : text.index(last)].split())
    for figure in FIGURES:
        if figure.page == page:
            pattern = re.escape(figure.sentence).replace(r"\#", NUM).replace(r"\ ", " ")
            text = re.sub(pattern, " ", text)
    return NUMBER.findall(re.sub(NO_RESULT[page], " ", text, flags=re.IGNORECASE))


def _errors(part: str, share: str, *keys: tuple[str, str]) -> Callable[[Any], list[float]]:
    return lambda d: [100.0 * d[part][motion][q][share] for motion, q in keys]


_ALL = (("static", "CT"), ("static", "CP"), ("forward", "CT"), ("forward", "CP"))


def _coverage(part: str, level: str) -> Callable[[Any], list[float]]:
    def ends(d: Any) -> list[float]:
        found = [100.0 * d[part][motion][q]["coverage"][level] for motion, q in _ALL]
        return [min(found), max(found)]

    return ends


def _of_transfer(part: Callable[[Any], list[float]]) -> Callable[[Any], list[float]]:
    """A figure of a volume predicted by a population that was fitted to the other."""
    return lambda d: part(d["transfer"])


def claims(text: str) -> list[int]:
    """Right and all claims of the proof of this version: pooled, then run by run.

    >>> claims("right in 456 of 474 claims (96.2 %; 246 of 251, then 210 of 223: one")
    [456, 474, 246, 251, 210, 223]
    """
    found = re.search(r"right in (\d+) of (\d+) claims \(.*?; (\d+) of (\d+), then (\d+) of (\d+)", text)
    assert found
    return [int(g) for g in found.groups()]


def wilson(hits: int, n: int, z: float = 1.96) -> tuple[float, float]:
    """Ends of the 95 % interval of a share, in percent (Wilson 1927).

    >>> [round(v, 1) for v in wilson(456, 474)]
    [94.1, 97.6]
    """
    p, q = hits / n, z * z / n
    half = z * np.sqrt(p * (1 - p) / n + q / (4 * n))
    return 100.0 * (p + q / 2 - half) / (1 + q), 100.0 * (p + q / 2 + half) / (1 + q)


def third(text: str) -> list[int]:
    """Right and all claims of the run after the two of one code."""
    return [int(v) for v in re.findall(r"had (\d+) of (\d+) claims right", text)[0]]


def real_claims(text: str) -> list[int]:
    """Right and all claims on real recordings, of every kind of this version's table."""
    rows = re.findall(r"^\| ([^|]+) \| \d+ \| ([-\d]+) \| ([-\d]+) \|.*\| (\d+) \|$", text, re.MULTILINE)
    found = [[int(v.replace("-", "0")) for v in row[1:]] for row in rows if "by version" not in row[0]]
    right = sum(a + b for a, b, _ in found)
    return [right, right + sum(wrong for *_, wrong in found)]


def _score(what: str, key: str = "value") -> Callable[[Any], list[float]]:
    return lambda d: [next(row[key] for row in d["score"] if row["what"] == what)]


def runs(text: str, campaign: str, **columns: str) -> list[tuple[float, float]]:
    """Thrust of CFD and of BEMT in the runs of a campaign whose columns begin so; a run without a thrust is none."""
    block = text[text.index(f"\n{campaign}: ") :].split("\n\n")[0].splitlines()[2:]
    head = ("run", "solver", "level", "cells", "rpm", "J")
    out = []
    for line in block:
        cells = line.split()
        row = dict(zip(head, cells, strict=False))
        numbers = re.findall(r"(?<=\s)(?:\d+\.?\d*|-)(?=\s|$)", line)
        if all(row.get(k) == v for k, v in columns.items()) and len(numbers) >= 9 and numbers[-8] != "-":
            out.append((float(numbers[-8]), float(numbers[-6])))
    return out


def _off(campaign: str, **columns: str) -> Callable[[Any], list[float]]:
    return lambda text: [100.0 * max(abs(cfd / bemt - 1.0) for cfd, bemt in runs(text, campaign, **columns))]


def _fan(d: Any) -> dict[str, float]:
    """Thrust of the DS-30 by source. [N]"""
    return {row["source"]: row["thrust_N"] for row in d["result"]["rows"][::-1]}


def _grid(text: str) -> list[float]:
    ratios = {line[0]: line for line in runs(text, "prop_8x5_grid", solver="incompressible")}
    low, high = min(ratios), max(ratios)
    return [100.0 * (1.0 - high / ratios[high][1]), 100.0 * (1.0 - low / ratios[low][1])]


LEFT_OUT, PROOF = "reports/validation/left_out/left_out.json", "reports/proof/README.md"
CFD, FAN, CALIBRATION = "reports/cfd/summary.txt", "reports/ds30/result.json", "reports/calibration/calibration.json"
VOLUME = "reports/validation/uiuc_volume_{}/validation.json"


LABELS = "reports/validation/labels/uiuc.txt"


def _of_labels(text: str) -> list[float]:
    """Median errors of labels in the order of ``_ALL``. [%]"""
    rows = (("rest", "CT"), ("rest", "CP"), ("flight", "CT"), ("flight", "CP"))
    return [float(re.findall(rf"^all +{motion} +{q} +\d+ +([\d.]+)", text, re.MULTILINE)[0]) for motion, q in rows]


def _k1k2_low(d: Any) -> list[float]:
    """How low K1/K2 is in flight, first and last band of J/(P/D) below 0.8. [%]"""
    bands = d["scores"]["calibration"]["J/(P/D)"]
    return [100.0 * (1.0 - bands[k]["models"]["thesis"]["median"]) for k in (0, 3)]


FIGURES = (
    Figure(README, "on # measured propellers the median error from blade stations is # % of static thrust and # % of "
           "static power, one in ten off by more than # and # %", LEFT_OUT,
           lambda d: [d["unseen"]["static"]["propellers"], *_errors("as_drawn", "median_abs", *_ALL[:2])(d),
                      *_errors("as_drawn", "p90_abs", *_ALL[:2])(d)]),
    Figure(README, "from labels # and # %", LABELS, lambda t: _of_labels(t)[:2]),
    Figure(README, "flight point of your own rotor bring flight to # %", LEFT_OUT,
           lambda d: [max(_errors("on_static_and_one", "median_abs", *_ALL[2:])(d))]),
    Figure(README, "the 68 % band holds # to # % of left-out families' points", LEFT_OUT, _coverage("unseen", "68")),
    Figure(README, "# of # claims were right (# %)", PROOF,
           lambda t: [*claims(t)[:2], 100.0 * claims(t)[0] / claims(t)[1]]),
    Figure(README, "in a third # of #", PROOF, lambda t: third(t)),
    Figure(README, "on real recordings # of #", PROOF, lambda t: real_claims(t)),
    Figure(README, "runs of # simulated tests", "reports/proof/proof.json", lambda d: [d["items"]]),
    Figure(README, "# to # % low in flight", CALIBRATION, _k1k2_low),
    Figure(README, "a factor of # low on the ducted fan", FAN, lambda d: [_fan(d)["cfd"] / _fan(d)["k1k2"]]),
    Figure(BELIEVE, "Median thrust error of BEMT: # % static and # % in flight on UIUC volume 1", VOLUME.format(1),
           _errors("as_drawn", "median_abs", *_ALL[::2])),
    Figure(BELIEVE, "which calibrated the section rule; # and # % on volume 2", VOLUME.format(2),
           _errors("as_drawn", "median_abs", *_ALL[::2])),
    Figure(BELIEVE, "Untwisted rotors (Caradonna-Tung) are # to # % high", "reports/README.md",
           lambda t: [float(v) for v in re.findall(r"\*\*\+(\d+) to \+(\d+) %", t)[0]]),
    Figure(BELIEVE, "at 8 and 12 deg and # to # % at 5 deg", "reports/README.md",
           lambda t: [float(v) for v in re.findall(r"\(5 deg: \+(\d+) to \+(\d+) %", t)[0]]),
    Figure(BELIEVE, ", or # to # % with", "reports/README.md",
           lambda t: [float(v) for v in re.findall(r"with `lifting_surface`, \+(\d+) to \+(\d+) %", t)[0]]),
    Figure(BELIEVE, "On # measured propellers of # families", LEFT_OUT,
           lambda d: [d["unseen"]["static"]["propellers"], len(d["families"])]),
    Figure(BELIEVE, "contain # to # % of the points", LEFT_OUT, _coverage("unseen", "68")),
    Figure(BELIEVE, "and the 95 % intervals # to # %", LEFT_OUT, _coverage("unseen", "95")),
    Figure(BELIEVE, "Median errors are # % (static CT), # % (static CP), # % (CT in flight) and # % (CP in flight)",
           LEFT_OUT, _errors("unseen", "median_abs", *_ALL)),
    Figure(BELIEVE, "What is printed is the solver's own number: # / # / # / # % from stations", LEFT_OUT,
           _errors("as_drawn", "median_abs", *_ALL)),
    Figure(BELIEVE, "(nine of ten: # / # / # / # %)", LEFT_OUT, _errors("as_drawn", "p90_abs", *_ALL)),
    Figure(BELIEVE, "# / # / # / # % from labels", LABELS, _of_labels),
    Figure(BELIEVE, "Its 90 % intervals held the truth in # of #", "reports/proof/proof.json",
           lambda d: [_score("90 % interval holds the truth", k)(d)[0] for k in ("hits", "n")]),
    Figure(BELIEVE, "nine of ten points are within # to # %", LEFT_OUT,
           lambda d: [f(_errors("unseen", "p90_abs", *_ALL)(d)) for f in (min, max)]),
    Figure(BELIEVE, "the 68 % intervals contain # to # % of the points of volume 2", LEFT_OUT,
           _of_transfer(_coverage("volume-2", "68"))),
    Figure(BELIEVE, "of volume 2 and the 95 % intervals # to # %", LEFT_OUT, _of_transfer(_coverage("volume-2", "95"))),
    Figure(BELIEVE, "nine of ten points are within # to # % there", LEFT_OUT,
           _of_transfer(lambda d: [f(_errors("volume-2", "p90_abs", *_ALL)(d)) for f in (min, max)])),
    Figure(README, "but # to # % of volume 2 if fitted to volume 1", LEFT_OUT,
           _of_transfer(_coverage("volume-2", "68"))),
    Figure(BELIEVE, "brings flight to # and # %", LEFT_OUT, _errors("on_static_and_one", "median_abs", *_ALL[2:])),
    Figure(BELIEVE, "thrust within # % at 20,000 rev/min", CFD,
           lambda t: _off("prop_8x5_compressible", rpm="20000")(t)),
    Figure(BELIEVE, "within # % at 8,000 rev/min", CFD, lambda t: _off("prop_8x5_compressible", rpm="8000")(t)),
    Figure(BELIEVE, "At rest thrust is # to # % below BEMT", CFD, _grid),
    Figure(BELIEVE, "in a pipe of the propeller's diameter it drops by # %", CFD,
           lambda t: [100.0 * (1.0 - runs(t, "prop_8x5_pipe", J="0")[0][0]
                               / runs(t, "prop_8x5_incompressible", J="0", rpm="20000")[0][0])]),
    Figure(BELIEVE, "settles on three grids at # to # N", CFD,
           lambda t: [f(c for c, _ in runs(t, "ds30_spinner") if c > 21.0) for f in (min, max)]),
    Figure(BELIEVE, "its 0.4 mm gap the CFD oscillates around # N", CFD,
           lambda t: [min(c for c, _ in runs(t, "ds30_spinner"))]),
    Figure(BELIEVE, "In flight it is # to # % low", CALIBRATION, _k1k2_low),
    Figure(BELIEVE, "on the ducted fan it gives # N for # N", FAN, lambda d: [_fan(d)["k1k2"], _fan(d)["cfd"]]),
    Figure(BELIEVE, "On real recordings # of # claims were right", PROOF, lambda t: real_claims(t)),
    Figure(BELIEVE, "A third had # of #", PROOF, lambda t: third(t)),
    Figure(BELIEVE, "two runs of # simulated items", "reports/proof/proof.json", lambda d: [d["items"]]),
    Figure(BELIEVE, "# of # claims were right: # %, 95 % interval # to # %", PROOF,
           lambda t: [*claims(t)[:2], 100.0 * claims(t)[0] / claims(t)[1], *wilson(*claims(t)[:2])]),
    Figure(BELIEVE, "Of the visible causes of the second # % were claimed with a reference run, # % without one",
           "reports/proof/proof.json",
           lambda d: [100.0 * _score(f"claims on visible, {w} a reference")(d)[0] for w in ("with", "without")]),
    Figure(BELIEVE, "# of # items without a cause got a name", PROOF,
           lambda t: [float(v) for v in re.findall(r"claims on recordings without a cause (\d+) of (\d+)", t)[0]]),
    Figure(BELIEVE, "# of # UIUC propellers without a cause got a name", PROOF,
           lambda t: [float(v) for v in re.findall(r"no cause, no reference (\d+) of (\d+) named", t)[0]]),
)  # fmt: skip
"""Rows by page."""
