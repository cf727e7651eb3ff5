"""The promise of the proof's real part: published recordings, registered causes, and files that do not tell them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.case import load_case
from bemt.effects import catalogue
from bemt.proof import prove, real, score
from bemt.proof.items import Item
from bemt.recordings.load import import_file


@pytest.fixture(scope="module")
def drawn(shared_data: Path) -> list[Item]:
    return [item for item in real.draw_real(np.random.default_rng(3)) if item.entry["plan"] == "real"]


def test_the_manifest_says_what_is_concealed_and_where_it_is_known_from() -> None:
    known = real.manifest()
    assert set(known) == set(real.SETS)
    for entry in known.values():
        assert set(entry["causes"]) <= set(catalogue()) and entry["how"] and entry["source"]


def test_every_set_is_drawn_and_a_control_goes_with_every_claim_on_reynolds(drawn: list[Item]) -> None:
    sets = [item.entry["set"] for item in drawn]
    assert set(sets) == set(real.SETS)
    assert sets.count("real reynolds") == sets.count("real shuffled") > 20


def test_items_are_sound_and_say_nothing_of_their_cause(drawn: list[Item], tmp_path: Path) -> None:
    for k, item in enumerate(drawn[::12]):
        folder = tmp_path / str(k)
        folder.mkdir()
        for name, text in item.files.items():
            (folder / name).write_text(text, encoding="utf-8")
        case = load_case(folder / "case.toml")
        case.rotor()
        channels = import_file(str(folder / "recording.csv")).values
        assert {"thrust_N"} <= set(channels) or {"CT", "CP"} <= set(channels)
        words = "".join(text for text in item.files.values())
        assert not [c for c in item.entry["causes"] if c in words and c not in case.get("model.effects_off")]


def test_the_slip_and_the_wrong_density_are_in_the_files(drawn: list[Item]) -> None:
    """Thrust over torque of a slipped recording is smaller by the pound's factor than that of its neighbour sets."""

    def ratio(item: Item) -> float:
        table = np.genfromtxt(item.files["recording.csv"].splitlines(), delimiter=",", names=True)
        return float(np.median(table["thrust_N"] / table["torque_Nm"]))

    by_set = {kind: [ratio(i) for i in drawn if i.entry["set"] == kind] for kind in ("real slip", "real pitch")}
    assert np.median(by_set["real pitch"]) / np.median(by_set["real slip"]) == pytest.approx(real.POUND, rel=0.5)
    cases = [i.files["case.toml"] for i in drawn if i.entry["set"] == "real density"]
    assert cases and all("density_kg_m3 = 1\n" in text for text in cases)
    assert not any("density" in i.files["recording.csv"] for i in drawn)


def test_without_data_it_says_where_they_come_from(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(real, "find_data", lambda kind: None)
    monkeypatch.setattr(real, "draw_pairs", lambda: iter(()))
    with pytest.raises(InputError, match="BEMT_DATA"):
        prove.conceal(tmp_path / "p", prove.REAL, 1)
    assert not (tmp_path / "p").exists()


def test_the_score_counts_what_was_found_and_what_was_claimed_wrongly() -> None:
    def judged(kind: str, causes: list[str], verdict: str, effects: list[str]) -> score.Judged:
        entry = {"set": kind, "causes": causes, "alike": [[] for _ in causes], "separation": [99.0] * len(causes)}
        return score.judge(entry, {"verdict": verdict, "effects": effects, "ranking": []})

    rows = score.score_real([
        judged("real duct", ["duct"], "named", ["duct"]), judged("real duct", ["duct"], "named", ["section"]),
        judged("real shuffled", [], "none", []), judged("real shuffled", [], "class", ["reynolds", "drag_divergence"]),
    ])  # fmt: skip
    told = {row.what: (row.hits, row.n) for row in rows}
    assert told["real duct: found"] == told["real duct: wrong claims"] == told["real shuffled: wrong claims"] == (1, 2)
    assert told["failed"] == (0, 4) and len(told) == 4


def test_a_change_over_speed_is_not_noise() -> None:
    rng = np.random.default_rng(0)
    rpm = np.linspace(2000.0, 8000.0, 20)
    flat = 0.1 * (1.0 + 0.01 * rng.standard_normal(20))
    assert real.change_over_speed(rpm, flat) < real.ABSENT
    assert real.change_over_speed(rpm, flat * (rpm / 2000.0) ** 0.15) > real.CLEAR
