"""Sets of the proof: which causes, how strong, on which rigs and plans, all from one seed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bemt.judge.proof import causes
from bemt.judge.proof.causes import CAUSES, LISTED, UNLISTED
from bemt.judge.proof.items import Bench, Item, make_item

SETS = ("single", "pair", "null", "mismatch", "unlisted", "sensor", "underpowered")
"""Kinds of items; a null is noise only, a mismatch the difference of truth and solver only."""

_STRENGTHS = (0.5, 1.0, 1.7)
_PHYSICAL = ("reynolds", "compressibility", "drag_divergence", "stall_delay", "duct", "tip_gap", "ground_effect")
_GRIDS = ("grid_shuffled", "grid_ordered", "two_air")


@dataclass(frozen=True)
class ProofSize:
    """Counts of a run of the proof."""

    items: dict[str, int]  # Items of each set. [-]
    plans: tuple[tuple[bool, tuple[str, ...]], ...]  # Rigs: whether ducted, and plans. [-]
    code: str = "vortex"  # Code of the truth


_OPEN, _DUCTED, _POOR = causes.OPEN_PLANS, causes.DUCTED_PLANS, causes.UNDERPOWERED
SIZES = {
    "small": ProofSize(
        {"single": 16, "pair": 3, "null": 5, "mismatch": 3, "unlisted": 5, "sensor": 6, "underpowered": 3},
        (
            (False, ("grid_shuffled", "endurance", "static_sweep", "static_narrow")),
            (False, ("two_air", "wall", "transient", "single_line")),
            (True, ("grid_shuffled", "gap")),
        ),
    ),
    "full": ProofSize(
        {"single": 240, "pair": 60, "null": 70, "mismatch": 35, "unlisted": 80, "sensor": 80, "underpowered": 40},
        (*((False, (*_OPEN, *_POOR)),) * 6, *((True, (*_DUCTED, "static_narrow")),) * 4),
    ),
    "stand": ProofSize(  # what a pulse width can do: settled points, no endurance
        {"single": 20, "pair": 10, "null": 8, "mismatch": 0, "unlisted": 10, "sensor": 12, "underpowered": 0},
        (
            *((False, ("static_sweep", "grid_shuffled", "grid_ordered", "wall")),) * 4,
            *((True, ("static_sweep", "grid_shuffled", "gap")),) * 3,
        ),
    ),
    "ccblade": ProofSize(
        {"single": 30, "pair": 6, "null": 10, "mismatch": 4, "unlisted": 6, "sensor": 12, "underpowered": 0},
        ((False, _GRIDS),) * 3,
        "ccblade",
    ),
}
"""Runs of the proof by name."""


def benches(size: ProofSize, seeds: np.random.SeedSequence) -> list[Bench]:
    """Draw rigs and their plans."""
    out = []
    for k, ((ducted, plans), seed) in enumerate(zip(size.plans, seeds.spawn(len(size.plans)), strict=True)):
        rng = np.random.default_rng(seed)
        rig = causes.draw_rig(f"{'ducted' if ducted else 'open'}_{k}", ducted, rng, size.code)
        out += [Bench.draw(rig, plan, rng) for plan in plans]
    return out


def _pick(
    found: list[Bench], ids: Collection[str], rng: np.random.Generator, plans: Collection[str] = ()
) -> Bench | None:
    fit = [b for b in found if (not plans or b.plan in plans) and set(ids) <= {c.id for c in b.allowed()}]
    return fit[int(rng.integers(len(fit)))] if fit else None


def _strength(name: str, k: int, rng: np.random.Generator) -> float:
    """Three strengths, each a little off; what is real everywhere cannot be much stronger or weaker."""
    f = _STRENGTHS[k % 3] * float(rng.uniform(0.85, 1.15))
    return float(f**0.35) if name in _PHYSICAL else f


@dataclass(frozen=True)
class Drawn:
    """One item that was drawn and not yet measured: its bench by number, and what :func:`make_item` takes."""

    bench: int
    ids: tuple[str, ...]
    strengths: tuple[float, ...]
    seed: int
    kind: str


def draw_items(
    size: ProofSize, seed: int, known: Collection[str], standard: Collection[str],
    tell: Callable[[int, int], None] = lambda i, n: None, jobs: int = 1,
) -> Iterator[Item]:  # fmt: skip
    """Draw and measure all items of a run, in mixed order; the same items whatever the number of processes."""
    found, drawn = _drawn(size, seed)
    # a bench keeps what it has solved, so all its items are made in one place
    mine = {b: [k for k, d in enumerate(drawn) if d.bench == b] for b in sorted({d.bench for d in drawn})}
    work = [(found[b], [drawn[k] for k in ks], known, standard) for b, ks in mine.items()]
    made: list[Item | None] = [None] * len(drawn)
    done = 0
    for ks, items in zip(mine.values(), _measured(work, jobs), strict=True):
        for k, item in zip(ks, items, strict=True):
            made[k] = item
        done += len(ks)
        tell(done, len(drawn))
    yield from (item for item in made if item is not None)


def _measured(work: Sequence[tuple[Any, ...]], jobs: int) -> Iterator[list[Item]]:
    """Items of every bench, in order."""
    if jobs == 1:
        yield from map(_of_bench, work)
        return
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(_of_bench, work)


def _of_bench(work: tuple[Bench, list[Drawn], Collection[str], Collection[str]]) -> list[Item]:
    bench, drawn, known, standard = work
    return [make_item(bench, d.ids, d.strengths, d.seed, d.kind, known, standard) for d in drawn]


def _drawn(size: ProofSize, seed: int) -> tuple[list[Bench], list[Drawn]]:
    """Benches, and all items in mixed order."""
    first, second = np.random.SeedSequence(seed).spawn(2)
    found = benches(size, first)
    rng = np.random.default_rng(second)
    jobs: list[tuple[str, tuple[str, ...], tuple[float, ...], Bench]] = []

    def cycle(pool: list[str], kind: str, plans: Collection[str] = ()) -> None:
        """Every cause in turn at every strength, as long as some bench allows it."""
        able = [i for i in pool if _pick(found, (i,), rng, plans)]
        turn = [(i, k) for k in rng.permutation(3) for i in rng.permutation(able)]
        for j in range(size.items[kind]):
            name, k = turn[j % len(turn)]
            bench = _pick(found, (name,), rng, plans)
            assert bench is not None
            jobs.append((kind, (str(name),), (_strength(str(name), int(k), rng),), bench))

    good = [p for p in (*_OPEN, *_DUCTED) if p not in _POOR]
    air = [i for i in LISTED if CAUSES[i].kind in ("air", "drive")]
    cycle(air, "single", good)
    cycle([i for i in LISTED if CAUSES[i].kind == "stand"], "sensor", good)
    cycle(list(UNLISTED), "unlisted", good)
    cycle(air, "underpowered", _POOR)
    for _ in range(size.items["pair"]):
        while True:
            bench = _pick(found, (), rng, _GRIDS)
            assert bench is not None
            able = [c.id for c in bench.allowed() if c.kind != "unlisted" and c.id != "unit_slip"]
            ids = tuple(str(i) for i in rng.choice(able, 2, replace=False))
            if any(CAUSES[i].kind == "air" for i in ids):
                break
        jobs.append(("pair", ids, tuple(_strength(i, int(rng.integers(1, 3)), rng) for i in ids), bench))
    for kind in ("null", "mismatch"):
        for _ in range(size.items[kind]):
            bench = _pick(found, (), rng, good)
            assert bench is not None
            jobs.append((kind, (), (), bench))
    number = {id(bench): k for k, bench in enumerate(found)}
    drawn = []
    for at in rng.permutation(len(jobs)):
        kind, ids, strengths, bench = jobs[int(at)]
        drawn.append(Drawn(number[id(bench)], ids, strengths, int(rng.integers(2**62)), kind))
    return found, drawn
