"""Draw and conceal causes, seal the key, let the diagnosis run on its own, open the key, score."""

from __future__ import annotations

import json
import math
import os
import secrets
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from bemt import __version__
from bemt.base.checkout import commit
from bemt.base.errors import Fault, InputError
from bemt.base.tables import json_text, write_atomic
from bemt.judge.proof import causes, rows, score
from bemt.judge.proof.causes import CAUSES, LISTED, UNLISTED, extended
from bemt.judge.proof.items import Bench, Item, NoSolutionError, make_item
from bemt.judge.proof.rows import Entry, Key, Miss, Proof, ScoreRow, ToldAnswer
from bemt.judge.proof.stand import StandErrors, yardstick

_STRENGTHS = (0.5, 1.0, 1.7)
_GRIDS = ("grid_shuffled", "grid_ordered", "two_air")


@dataclass(frozen=True)
class ProofSize:
    """Counts of a run of the proof."""

    # Items of each set; a null is noise only, a mismatch the difference of truth and solver only. [-]
    items: dict[str, int]
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


def benches_of(key: Key) -> dict[tuple[str, str], Bench]:
    """Benches of a sealed key by rig and plan."""
    first, _ = np.random.SeedSequence(int(key.seed)).spawn(2)
    return {(b.rig.name, b.plan): b for b in benches(SIZES[key.size], first)}


def _pick(
    found: list[Bench], ids: Collection[str], rng: np.random.Generator, plans: Collection[str] = ()
) -> Bench | None:
    fit = [b for b in found if (not plans or b.plan in plans) and set(ids) <= {c.id for c in b.allowed()}]
    return fit[int(rng.integers(len(fit)))] if fit else None


def _strength(name: str, k: int, rng: np.random.Generator) -> float:
    """Three strengths, each a little off; what is real everywhere cannot be much stronger or weaker."""
    f = _STRENGTHS[k % 3] * float(rng.uniform(0.85, 1.15))
    return float(f**0.35) if CAUSES[name].without != causes.Change() else f


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
    for ks, of_bench in zip(mine.values(), _measured(work, jobs), strict=True):
        for k, item in zip(ks, of_bench, strict=True):
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
    return [_made(bench, d, known, standard) for d in drawn]


def _made(bench: Bench, d: Drawn, known: Collection[str], standard: Collection[str], left: int = 5) -> Item:
    """An item; a blade on which the truth has no solution is drawn anew, a few times."""
    try:
        return make_item(bench, d.ids, d.strengths, d.seed, d.kind, known, standard)
    except NoSolutionError:
        if not left:
            raise
        return _made(bench, replace(d, seed=d.seed + 1), known, standard, left - 1)


def _pair(found: list[Bench], rng: np.random.Generator) -> tuple[Bench, tuple[str, ...]]:
    """Two causes at once, of which one is of the air."""
    while True:
        bench = _pick(found, (), rng, _GRIDS)
        assert bench is not None
        able = [c.id for c in bench.allowed() if c.kind != "unlisted" and c.id != "unit_slip"]
        ids = tuple(str(i) for i in rng.choice(able, 2, replace=False))
        if any(CAUSES[i].kind == "air" for i in ids):
            return bench, ids


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
        bench, ids = _pair(found, rng)
        jobs.append(("pair", ids, tuple(_strength(i, int(rng.integers(1, 3)), rng) for i in ids), bench))
    for kind in ("null", "mismatch"):
        for _ in range(size.items[kind]):
            plain = _pick(found, (), rng, good)
            assert plain is not None
            jobs.append((kind, (), (), plain))
    number = {id(bench): k for k, bench in enumerate(found)}
    drawn = []
    for at in rng.permutation(len(jobs)):
        kind, ids, strengths, bench = jobs[int(at)]
        drawn.append(Drawn(number[id(bench)], ids, strengths, int(rng.integers(2**62)), kind))
    return found, drawn


T = TypeVar("T")
R = TypeVar("R")
SCHEMA, KEY_SCHEMA = "bemt.proof/1", "bemt.key/1"
REAL = "real"
"""Size of the run on published recordings."""
_GIVEN = ("recording.csv", "case.toml", "stations.csv", "reference.csv")
COMPARE = "compare"
"""File of an item that asks what changed between reference.csv and recording.csv."""
ASKED = "with_reference"
"""Folder of the same items with the reference that a diagnosis may ask for; it is not shown before."""
TIME_LIMIT_S = 900.0


def conceal(out: Path, size: str, seed: int, say: Callable[[str], None] | None = None, jobs: int = 1) -> str:
    """Draw and write all items, and the sealed key."""
    from bemt.judge.proof import real
    from bemt.physics import effects

    if (out / "items").exists() or (out / rows.KEY).exists():
        raise InputError(Fault(out.as_posix(), "", "a proof", "a folder without one", "Choose another --out"))
    known = set(effects.catalogue())
    standard = {e.id for e in effects.standard()}
    entries = []
    drawn: Iterable[Item] = (
        real.draw_real(np.random.default_rng(seed)) if size == REAL
        else draw_items(SIZES[size], seed, known, standard, teller("concealed", say), jobs)
    )  # fmt: skip
    for k, item in enumerate(drawn):
        name = f"{k:04d}"
        folder = out / "items" / name
        folder.mkdir(parents=True)
        for file, text in item.files.items():
            write_atomic(folder / file, text)
        if item.reference and "reference.csv" not in item.files:
            (out / ASKED / name).mkdir(parents=True)
            for file, text in {**item.files, "reference.csv": item.reference}.items():
                write_atomic(out / ASKED / name / file, text)
        hashes = {file: rows.sha256(text) for file, text in item.files.items()}
        entries.append(replace(item.entry, folder=name, files=hashes))
    return rows.seal(out, Key(KEY_SCHEMA, __version__, str(seed), size, tuple(entries)))


def teller(what: str, say: Callable[[str], None] | None) -> Callable[[int, int], None]:
    """Progress by number as a line of words."""
    return lambda done, n: say(f"{what} {done}/{n}") if say else None


def on_threads(one: Callable[[T], R], todo: Sequence[T], jobs: int, tell: Callable[[int, int], None]) -> list[R]:
    """Results of tasks, in order; each is told of once it and all before it are done."""
    found = []
    with ThreadPoolExecutor(jobs) as pool:
        for result in pool.map(one, todo):
            found.append(result)
            tell(len(found), len(todo))
    return found


def diagnose_folder(folder: Path) -> tuple[ToldAnswer, str]:
    """Run the diagnosis on one folder, as a process of its own that sees a copy of recording and case only."""
    with tempfile.TemporaryDirectory(prefix="bemt-") as box:
        given = [name for name in _GIVEN if (folder / name).exists()]
        for name in given:
            shutil.copy(folder / name, box)
        return asked(Path(box), question(folder))


def asked(folder: Path, words: Sequence[str]) -> tuple[ToldAnswer, str]:
    """Answer to a command in a folder, an empty one and what went wrong where there is none."""
    command = [sys.executable, "-m", "bemt", *words, "--json"]
    # the numerical libraries' own threads would fight over the cores that --jobs shares out
    one = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")}
    found = str(Path(__file__).resolve().parents[3])
    path = os.pathsep.join(p for p in (found, os.environ.get("PYTHONPATH", "")) if p)
    try:
        ran = subprocess.run(command, cwd=folder, env={**os.environ, **one, "PYTHONPATH": path}, capture_output=True,
                             text=True, timeout=TIME_LIMIT_S, check=False)  # fmt: skip
        return ToldAnswer.from_document(json.loads(ran.stdout)), ran.stderr.strip()
    except subprocess.TimeoutExpired:
        return ToldAnswer(), f"no answer within {TIME_LIMIT_S:g} s"
    except ValueError:
        return ToldAnswer(), ran.stderr.strip() or "no JSON document on the output"


def question(folder: Path) -> list[str]:
    """Subcommand and files that are asked."""
    case = ["--case", "case.toml"] if (folder / "case.toml").exists() else []
    if (folder / COMPARE).exists():
        return ["compare", "reference.csv", "recording.csv", *case]
    known = ["--reference", "reference.csv"] if (folder / "reference.csv").exists() else []
    return ["diagnose", "recording.csv", *case, *known]


def diagnose_all(out: Path, jobs: int, say: Callable[[str], None] | None = None) -> None:
    """Diagnose all items that have no answer yet, then those again that asked for a reference, with it.

    Answers go to ``answers/<folder>.json`` and ``answers_with_reference/<folder>.json``.
    """
    _diagnose_folders(sorted((out / "items").iterdir()), out / "answers", jobs, teller("diagnosed", say))
    asked = [f for f in sorted((out / ASKED).glob("*")) if asks(rows.stored(out / "answers" / f"{f.name}.json").answer)]
    _diagnose_folders(asked, out / f"answers_{ASKED}", jobs, teller("reference given", say))


def asks(answer: ToldAnswer) -> bool:
    """Whether an answer leaves the cause open and asks for a reference."""
    return answer.verdict in ("insufficient", "unknown") and answer.step.kind == "reference"


def _diagnose_folders(folders: Sequence[Path], answers: Path, jobs: int, tell: Callable[[int, int], None]) -> None:
    answers.mkdir(exist_ok=True)
    todo = [f for f in folders if not (answers / f"{f.name}.json").exists()]

    def one(folder: Path) -> None:
        began = time.monotonic()
        answer, words = diagnose_folder(folder)
        if words == "interrupted":  # not an answer: it is asked for again
            return
        told = {"answer": answer.document() if answer else None, "error": "" if answer else words[-2000:],
                "seconds": time.monotonic() - began}  # fmt: skip
        write_atomic(answers / f"{folder.name}.json", json.dumps(told))

    on_threads(one, todo, jobs, tell)


def proof(out: Path, digest: str | None = None) -> Proof:
    """Open the key and score the answers."""
    key = rows.unseal(out, digest)
    made = key.size != REAL
    stored = {e.folder: rows.stored(out / "answers" / f"{e.folder}.json") for e in key.items}
    judged = [score.judge(e, stored[e.folder].answer) for e in key.items]
    seconds = sorted(one.seconds for one in stored.values())
    misses = tuple(_miss(j, stored[j.entry.folder].error) for j in judged
                   if not j.right and (j.claims or j.visible or not j.answer))  # fmt: skip
    scored = _scored(out, key, judged) if made else score.score_real(judged)
    return Proof(
        SCHEMA, __version__, key.size, key.seed, _commit(),
        digest or (out / rows.SEAL).read_text(encoding="utf-8").strip(), len(judged), tuple(scored),
        baselines=tuple(score.baselines(judged)) if made else (), strata=tuple(score.strata(judged)) if made else (),
        reliability=tuple(score.reliability(judged)), confusion=score.confusion(judged),
        answers={} if made else score.answers(judged), misses=misses,
        seconds_median=seconds[len(seconds) // 2] if seconds else math.nan,
    )  # fmt: skip


def _scored(out: Path, key: Key, judged: Sequence[score.Judged]) -> list[ScoreRow]:
    """Score of generated items, with the runs that answers recommend and the references that they ask for."""
    found = benches_of(key)
    settles = [resolves(found[j.entry.rig, j.entry.plan], j.entry, j.answer) for j in judged if j.answer]
    again = [score.judge(j.entry, rows.stored(out / f"answers_{ASKED}" / f"{j.entry.folder}.json").answer)
             for j in judged if asks(j.answer) and (out / ASKED / j.entry.folder).exists()]  # fmt: skip
    return score.score(judged, [one for one in settles if one is not None], again)


def _miss(j: score.Judged, error: str) -> Miss:
    e, a = j.entry, j.answer
    ranking = tuple((r.effect, r.probability) for r in a.ranking[:4])
    return Miss(e.folder, e.set, e.causes, e.plan, e.rig, j.separation, e.alike, j.said, a.verdict or None, a.effects,
                ranking, "" if a else error)  # fmt: skip


def _commit() -> str:
    """Commit of the checkout, with a plus sign when files differ; empty outside of one."""
    here = Path(__file__).resolve().parents[3]
    if not (here / ".git").exists():  # installed: a checkout further up is somebody else's
        return ""
    command = ["git", "-c", "core.fsmonitor=", "-c", "core.hooksPath=/dev/null", "status", "--porcelain"]
    try:
        changed = subprocess.run(command, cwd=here, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
    return commit(here) + ("+" if changed else "")


def prove(
    out: str | None, size: str = "small", seed: int | None = None, jobs: int | None = None,
    say: Callable[[str], None] | None = None, tell: Callable[[str], None] | None = None,
) -> Proof:  # fmt: skip
    """Do the whole proof; with a folder and without a seed an interrupted one is resumed with its sealed key.

    ``say`` takes passing lines of progress, ``tell`` the hash of the key, once it is sealed.
    """
    jobs = jobs or os.cpu_count() or 1
    with tempfile.TemporaryDirectory(prefix="bemt-proof-") as spare:
        folder = Path(out) if out else Path(spare)
        began = time.monotonic()
        if seed is None and (folder / rows.SEAL).exists():  # an interrupted run: its key stays as it is
            digest = (folder / rows.SEAL).read_text(encoding="utf-8").strip()
            words = f"going on with the sealed key of size {rows.unseal(folder, digest).size}, SHA-256 {digest}"
        else:
            digest = conceal(folder, size, secrets.randbits(63) if seed is None else seed, say, jobs)
            words = f"key sealed, SHA-256 {digest}"
        if tell:
            tell(words)
        sealed = time.monotonic()
        diagnose_all(folder, jobs, say)
        found = replace(
            proof(folder, digest), seconds={"conceal": sealed - began, "diagnose": time.monotonic() - sealed}
        )
        if out:
            write_atomic(folder / "proof.json", json_text(found.document()))
            write_atomic(folder / "proof.txt", score.text(found) + "\n")
            write_atomic(folder / "proof.html", score.html(found))
    return found


# Whether the run that a diagnosis recommends would settle the tie, measured on the truth.
_ENOUGH = 3.0


def resolves(bench: Bench, entry: Entry, answer: ToldAnswer) -> bool | None:
    """Whether the recommended points separate the concealed cause from what it was confused with."""
    points = answer.step.points
    if len(entry.causes) != 1 or not points or answer.verdict not in ("class", "insufficient"):
        return None
    name = entry.causes[0]
    named = [*answer.effects, *answer.step.separates]
    more = Bench(bench.rig, bench.plan, extended(bench.rows, points))
    able = {c.id: c for c in more.allowed()}
    rivals = [i for i in dict.fromkeys(named) if i != name and i in able]
    if not rivals or name not in CAUSES:
        return None
    cause = CAUSES[name]
    change = cause.make(entry.strengths[0], bench.rig, bench.rows, np.random.default_rng(entry.seed))
    plain, columns = more.measure(more.plain(), StandErrors())
    electric = {str(n): columns[n] for n in ("voltage_V", "current_A", "pwm_us") if n in columns}
    rule = yardstick(plain, more.rows.run, StandErrors(**entry.stand), more.tangents(), electric)
    rng = np.random.default_rng(0)
    others = {i: rule.stack(more.signature(able[i].make(1.0, more.rig, more.rows, rng), able[i])) for i in rivals}
    own = rule.stack(more.signature(change, cause))
    return rule.separation(own)[1] >= _ENOUGH and not rule.alike(own, others, _ENOUGH)
