"""The promise of the sealing: the key is fixed before the diagnosis, which sees recording and case only; and the score
tells an oracle from a liar."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.case import load_case
from bemt.proof import draw, items, proof_text, prove, resolve, rigs, score, seal
from bemt.recordings.load import import_file

TINY = draw.Size(
    {"single": 2, "pair": 0, "null": 1, "mismatch": 1, "unlisted": 0, "sensor": 2, "underpowered": 1},
    ((False, ("static_narrow",)),),
)


@pytest.fixture(scope="module")
def patched() -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(draw.SIZES, "tiny", TINY)
        # the quickest plan stands for the good ones, too
        patch.setattr(draw, "_POOR", ("single_line",))
        patch.setattr(draw, "_OPEN", (*draw._OPEN, "static_narrow"))
        patch.setitem(TINY.items, "underpowered", 0)
        patch.setattr(items.Bench, "signatures", lambda self: {})  # look-alikes cost time and are tested with the truth
        yield patch


@pytest.fixture(scope="module")
def sealed(patched: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    out = tmp_path_factory.mktemp("proof")
    return out, prove.conceal(out, "tiny", 7)


def entries(folder: Path) -> list[dict[str, Any]]:
    return list(json.loads((folder / seal.KEY).read_text(encoding="utf-8"))["items"])


def _shown(entry: dict[str, Any]) -> set[str]:
    return {"recording.csv", "case.toml", "stations.csv"} | ({"reference.csv"} if entry["referenced"] else set())


def test_items_are_sound_and_say_nothing_of_their_cause(sealed: tuple[Path, str]) -> None:
    out, _ = sealed
    for entry in entries(out):
        folder = out / "items" / entry["folder"]
        assert {p.name for p in folder.iterdir()} == _shown(entry)
        assert ("u_thrust_N" in (folder / "recording.csv").read_text(encoding="utf-8")) == entry["stated"]
        case = load_case(folder / "case.toml")
        case.rotor()
        imported = import_file(str(folder / "recording.csv"))
        assert {"thrust_N", "torque_Nm"} <= set(imported.values)
        assert np.all(np.isfinite(imported["thrust_N"]))
        words = "".join(p.read_text(encoding="utf-8") for p in folder.iterdir())
        told = [c for c in entry["causes"] if c in words and c not in case.get("model.effects_off")]
        assert not told


def test_same_seed_same_key_other_seed_other_key(sealed: tuple[Path, str], patched: Any, tmp_path: Path) -> None:
    _, digest = sealed
    assert prove.conceal(tmp_path / "again", "tiny", 7) == digest
    assert prove.conceal(tmp_path / "other", "tiny", 8) != digest


def test_seal_holds_and_a_second_proof_is_refused(sealed: tuple[Path, str]) -> None:
    out, digest = sealed
    assert seal.sha256((out / seal.KEY).read_text(encoding="utf-8")) == digest
    assert seal.unseal(out, digest)["schema"] == "bemt.key/1"
    with pytest.raises(InputError, match="a folder without one"):
        prove.conceal(out, "tiny", 7)


@pytest.mark.parametrize("file", [seal.KEY, "recording.csv", "case.toml", "stations.csv"])
def test_tampering_is_noticed(sealed: tuple[Path, str], file: str) -> None:
    out, digest = sealed
    path = out / file if file == seal.KEY else out / "items" / "0001" / file
    whole = path.read_text(encoding="utf-8")
    try:
        path.write_text(whole.replace("1", "2", 1), encoding="utf-8")
        with pytest.raises(InputError, match="was changed"):
            prove.proof(out, digest)
    finally:
        path.write_text(whole, encoding="utf-8")
    prove.proof(out, digest)


def test_a_forged_seal_does_not_help(sealed: tuple[Path, str]) -> None:
    out, digest = sealed
    key, mark = out / seal.KEY, out / seal.SEAL
    whole, old = key.read_text(encoding="utf-8"), mark.read_text(encoding="utf-8")
    try:
        forged = whole.replace('"null"', '"pair"')
        key.write_text(forged, encoding="utf-8")
        mark.write_text(seal.sha256(forged), encoding="utf-8")
        with pytest.raises(InputError, match="key was changed"):
            prove.proof(out, digest)
    finally:
        key.write_text(whole, encoding="utf-8")
        mark.write_text(old, encoding="utf-8")


def test_diagnosis_sees_recording_and_case_only(sealed: tuple[Path, str], monkeypatch: pytest.MonkeyPatch) -> None:
    out, _ = sealed
    seen: list[tuple[list[str], set[str], bool]] = []

    def spy(command: list[str], cwd: str, **_: Any) -> subprocess.CompletedProcess[str]:
        box = Path(cwd)
        seen.append((command, {p.name for p in box.iterdir()}, out in box.parents))
        return subprocess.CompletedProcess(command, 0, '{"verdict": "none"}', "")

    monkeypatch.setattr(subprocess, "run", spy)
    answer, _ = prove.diagnose_folder(out / "items" / "0000")
    assert answer == {"verdict": "none"}
    (command, files, inside) = seen[0]
    assert files == _shown(entries(out)[0])
    assert not inside
    assert not any(str(out) in word for word in command)


def test_the_key_is_sealed_before_any_diagnosis(patched: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "proof"
    order: list[bool] = []

    def spy(folder: Path) -> tuple[dict[str, Any] | None, str]:
        text = (out / seal.KEY).read_text(encoding="utf-8")
        order.append((out / seal.SEAL).read_text(encoding="utf-8").strip() == seal.sha256(text))
        return None, "spy"

    monkeypatch.setattr(prove, "diagnose_folder", spy)
    document = prove.prove(str(out), "tiny", 3, 1)
    assert order and all(order)
    assert any(row["met"] is False for row in document["score"])
    assert document["schema"] == "bemt.proof/1"
    assert {r["what"]: r["hits"] for r in document["score"]}["failed"] == len(order)
    assert (out / "proof.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    assert "Misses" in (out / "proof.txt").read_text(encoding="utf-8")
    # an interrupted run goes on with the key it has, and asks again only what has no answer
    sealed_key = (out / seal.KEY).read_bytes()
    (out / "answers" / "0002.json").unlink()
    order.clear()
    prove.prove(str(out), "tiny", None, 1)
    assert (out / seal.KEY).read_bytes() == sealed_key
    assert order == [True]


def test_a_reference_is_given_when_it_was_asked_for_and_not_before(
    patched: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, seen = tmp_path / "proof", []
    open_ = {"verdict": "insufficient", "effects": [], "ranking": [], "next_measurement": {"kind": "reference"}}

    def spy(folder: Path) -> tuple[dict[str, Any] | None, str]:
        seen.append((folder.parent.name, folder.name))
        return open_ if folder.name != "0001" else {**open_, "verdict": "none"}, ""

    monkeypatch.setattr(prove, "diagnose_folder", spy)
    monkeypatch.setattr(items, "_REFERENCED", 0.0)
    document = prove.prove(str(out), "tiny", 3, 1)
    first = [name for kind, name in seen if kind == "items"]
    again = [name for kind, name in seen if kind == prove.ASKED]
    assert seen == [("items", n) for n in first] + [(prove.ASKED, n) for n in again]
    assert again and "0001" not in again and set(again) <= set(first)
    for name in again:
        folder = out / prove.ASKED / name
        assert (folder / "reference.csv").exists() and not (out / "items" / name / "reference.csv").exists()
    assert any("with a reference" in row["what"] for row in document["score"])


def test_the_reference_lacks_the_cause_and_nothing_else(patched: Any) -> None:
    """A thrust cell 10 % off: the same rotor reads a tenth less in the reference, torque and points are the same."""
    bench = draw.benches(TINY, np.random.SeedSequence(3))[0]
    item = items.make_item(bench, ("thrust_gain",), (2.0,), 5, "sensor")
    off = item.entry["parameters"]["thrust_gain"]["gain"]["value"]
    here, there = (
        np.genfromtxt(text.splitlines(), delimiter=",", names=True)
        for text in (item.files["recording.csv"], item.reference)
    )
    assert np.median(here["thrust_N"] / there["thrust_N"]) == pytest.approx(1.0 + off, abs=0.02)
    assert np.median(here["torque_Nm"] / there["torque_Nm"]) == pytest.approx(1.0, abs=0.02)
    assert abs(off) > 0.05


def entry(kind: str, *ids: str, separation: float = 12.0, alike: tuple[str, ...] = (), **more: Any) -> dict[str, Any]:
    return {"folder": "0000", "set": kind, "causes": list(ids), "separation": [separation] * len(ids),
            "alike": [list(alike)] * len(ids), "variables": [["rpm"]] * len(ids), "plan": "grid_shuffled",
            "rig": "open_0", "parameters": {i: {} for i in ids}, **more}  # fmt: skip


def answer(verdict: str, *effects: str, ranking: tuple[str, ...] | None = None, **more: Any) -> dict[str, Any]:
    names = ranking or (("+".join(effects),) if verdict in ("named", "sensor") else (verdict,))
    held = {"before": 4.0, "after": 1.0, "noise": 1.0, "gp_only": 1.1, "holdout_before": 4.0, "holdout_after": 1.1}
    return {"verdict": verdict, "effects": list(effects), "probability": 0.99, "location": {"variable": "rpm"},
            "ranking": [{"effect": n, "probability": 0.9, "parameters": {}} for n in names], "fit": {"thrust_N": held},
            **more}  # fmt: skip


SCENES = [
    (entry("null"), answer("none")),
    (entry("mismatch"), answer("unknown")),
    (entry("single", "untwist"), answer("named", "untwist")),
    (entry("single", "untwist", alike=("compressibility",)), answer("class", "compressibility", "untwist")),
    (entry("sensor", "thrust_zero"), answer("sensor", "thrust_zero")),
    (entry("pair", "untwist", "thrust_gain"), answer("named", "thrust_gain", "untwist")),
    (entry("unlisted", "resonance"), answer("unknown")),
    (entry("underpowered", "untwist", separation=1.0), answer("insufficient")),
]


def test_an_oracle_meets_every_target() -> None:
    rows = score.score([score.judge(e, a) for e, a in SCENES], [True])
    assert [r.what for r in rows if r.met is False] == []
    without = {r.what for r in rows if r.met is None and "with a reference" not in r.what}
    assert without == {"parameter error, median", "90 % interval holds the truth"}


def test_a_tool_that_always_names_something_fails_where_it_matters() -> None:
    rows = {r.what: r for r in score.score([score.judge(e, answer("named", "nacelle")) for e, _ in SCENES])}
    assert rows["claims on nulls, noise"].value == 1.0
    assert rows["unlisted given a listed name"].met is False
    assert rows["sensor faults blamed on the air"].value == 1.0
    assert rows["top 1, visible"].value == 0.0
    assert rows["wrong claims on what the plan cannot see"].met is False


def test_a_tool_that_never_speaks_is_not_praised() -> None:
    rows = {r.what: r for r in score.score([score.judge(e, answer("none")) for e, _ in SCENES])}
    assert rows["claims on nulls, noise"].met
    assert rows["claims on visible"].met is False
    assert rows["unlisted at 10 sigma called unknown"].met is False


@pytest.mark.parametrize(
    ("there", "said", "right"),
    [
        (entry("single", "untwist"), answer("named", "untwist", "nacelle"), False),  # one too many
        (entry("single", "untwist"), answer("class", "nacelle", "section"), False),  # a class without it
        (entry("single", "untwist", alike=("section",)), answer("named", "section"), True),  # the plan cannot tell
        (entry("pair", "untwist", "section"), answer("named", "untwist"), False),  # half a pair
        (entry("pair", "untwist", "section", separation_together=[12.0, 2.0]), answer("named", "untwist"), True),
        (entry("pair", "untwist", "section", separation_together=[12.0, 2.0]), answer("named", "section"), False),
        (entry("pair", "untwist", "section", separation_together=[12.0, 2.0]), answer("named", "nacelle"), False),
        (entry("null"), answer("class", "untwist", "section"), False),  # a class is a claim
        (entry("single", "untwist"), None, False),
    ],
)
def test_judgement(there: dict[str, Any], said: dict[str, Any] | None, right: bool) -> None:
    assert score.judge(there, said).right is right


def test_parameters_are_scored_where_both_sides_name_them() -> None:
    there = entry("single", "pitch_offset", parameters={"pitch_offset": {"offset_deg": {"value": 1.0, "unit": "deg"}}})
    told = answer("named", "pitch_offset")
    told["ranking"][0]["parameters"] = {"offset_deg": {"value": 1.1, "low": 0.9, "high": 1.3, "unit": "deg"}}
    rows = {r.what: r for r in score.score([score.judge(there, told)])}
    assert rows["parameter error, median"].value == pytest.approx(0.1)
    assert rows["90 % interval holds the truth"].hits == 1


def test_risk_listens_to_the_surest_first() -> None:
    sure = score.judge(entry("single", "untwist"), answer("named", "untwist"))
    unsure = score.judge(entry("null"), {**answer("named", "nacelle"), "probability": 0.6})
    curve = score.risk_coverage([unsure, sure], (0.5, 1.0))
    assert [point["risk"] for point in curve] == [0.0, 0.5]
    assert proof_text._percent(curve[1]["risk"]) == "50.0 %"


def test_a_recommended_run_is_tried_on_the_truth() -> None:
    """Elastic twist or Mach number in a static sweep: thinner air settles it, one more point of the same does not."""
    rig = rigs.draw_rig("open", False, np.random.default_rng(5))
    bench = items.Bench.draw(rig, "static_sweep", np.random.default_rng(1))
    there = entry("single", "untwist", strengths=[0.5], seed=4, stand={"noise": 0.006})
    top = rig.top_rpm
    said = answer("class", "untwist", "compressibility", ranking=("untwist",))
    thin = [{"rpm": f * top, "airspeed_m_s": 0.0, "pressure_Pa": 50e3} for f in np.linspace(0.6, 1.0, 8)]
    same = [{"rpm": 0.5 * top, "airspeed_m_s": 0.0}]
    tried = {
        name: resolve.resolves(bench, there, {**said, "next_measurement": {"points": points, "separates": []}})
        for name, points in (("thin", thin), ("same", same))
    }
    assert tried == {"thin": True, "same": False}
    assert resolve.resolves(bench, there, {**said, "next_measurement": {"points": []}}) is None


def test_no_answer_is_no_virtue() -> None:
    rows = {r.what: r for r in score.score([score.judge(e, None) for e, _ in SCENES])}
    assert rows["failed"].met is False
    assert rows["claims on nulls, noise"].met is None
    assert rows["top 1, visible"].value == 0.0
