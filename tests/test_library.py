"""The promise of `import bemt`: plain things in and out, loaded when used."""

from __future__ import annotations

import inspect
import json
import pydoc
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import bemt
from bemt.base.arguments import declared
from bemt.physics.dataset import from_pandas
from bemt.physics.effects import catalogue, source_of
from bemt.rotors.case import load_case
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.case.sources import Source, Sources, bibtex
from bemt.rotors.population import population
from bemt.tools.design.motors_file import KnownMotor

SPEEDS = np.arange(4000.0, 9001.0, 500.0)
FRAME = pd.DataFrame({"rpm": SPEEDS, "thrust_N": 1e-7 * SPEEDS**2})

ROOT = Path(__file__).resolve().parents[1]


def test_importing_it_loads_nothing() -> None:
    code = "import sys, bemt; print(*sorted({m.partition('.')[0] for m in sys.modules} & {'numpy', 'scipy', 'numba'}))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
    assert (ROOT / "bemt" / "py.typed").exists()
    with pytest.raises(AttributeError, match="It offers"):
        _ = bemt.nothing_of_the_kind  # type: ignore[attr-defined]


def test_actions_are_called() -> None:
    assert callable(bemt.diagnose) and callable(bemt.drive) and callable(bemt.compare)
    with pytest.raises(bemt.InputError, match="^kv: got 1"):
        bemt.drive("10x5", kv=1.0, cells=3)


@pytest.mark.parametrize("name", ["compare", "diagnose", "drive", "report", "validate"])
def test_help_of_an_action_shows_its_words(name: str) -> None:
    function = getattr(bemt, name)
    shown = pydoc.plain(pydoc.render_doc(function))
    assert "Parameters" in shown and f"{name}(" in shown and str(function.__doc__).splitlines()[0] in shown


PAIR = "10x5"
FOREIGN = re.compile(r"--[a-z]|case\.toml|second_rotor|LABEL")


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: bemt.propeller(PAIR).coaxial(-0.3), "z_over_D"),
        (lambda: bemt.propeller(PAIR).coaxial(0.3, turns="both"), "turns"),
        (lambda: bemt.propeller(PAIR).coaxial(0.3, second="9x"), "second"),
        (lambda: bemt.propeller(PAIR).coaxial(), "coaxial"),
        (lambda: bemt.propeller(PAIR).solve(6000, density_kg_m3=-1.0), "density_kg_m3"),
        (lambda: bemt.drive(PAIR, kv=2300), "cells"),
        (lambda: bemt.drive(PAIR, kv=2300, cells=3, mass_kg=1200), "mass_kg"),
        (lambda: bemt.design(6.0), "diameter_in"),
        (lambda: bemt.propeller("nine"), "label"),
    ],
)
def test_faults_are_those_of_the_arguments_of_the_call(call: Callable[[], object], name: str) -> None:
    with pytest.raises(bemt.InputError) as caught:
        call()
    for fault in caught.value.faults:
        assert (fault.file or fault.where) == name
        assert not FOREIGN.search(f"{fault.file} {fault.where} {fault.expected} {fault.hint}")


@pytest.mark.parametrize(
    "value", ["6000", ["6000"], True, [5000, "6000"], {"rpm": 6000}, np.array(["6000"]), 6000 + 1j, [5000, 6000 + 1j]]
)
@pytest.mark.filterwarnings("error")
def test_a_text_is_no_number(value: object) -> None:
    for call in (bemt.propeller(PAIR).solve, lambda v: bemt.estimate(PAIR, v)):
        with pytest.raises(bemt.InputError, match=r"^rpm: got \w+ .*; expected a number"):
            call(value)


def test_one_number_is_one() -> None:
    with pytest.raises(bemt.InputError, match="^density_kg_m3: got 2 numbers"):
        bemt.propeller(PAIR).solve(6000, density_kg_m3=[1.1, 1.2])
    assert bemt.propeller(PAIR).solve(6000, density_kg_m3=[1.1], bands=False)["density_kg_m3"][0] == 1.1


def test_a_case_gives_what_the_solver_gives() -> None:
    case = load_case(ROOT / "cases" / "prop_8x5")
    ours = bemt.load(ROOT / "cases" / "prop_8x5").solve([8000.0, 20000.0], [0.0, 10.0])
    raw = prepare_case(case).solve([8000.0, 20000.0], [0.0, 10.0], case.air())
    np.testing.assert_allclose(ours["thrust_N"], raw["thrust_N"], rtol=1e-12)
    np.testing.assert_allclose(ours["torque_Nm"], raw["torque_Nm"], rtol=1e-12)


def test_bands_come_from_the_declared_unknowns() -> None:
    wide, told = bemt.propeller("10x5"), bemt.propeller("10x5").replaced({"blade.max_chord_over_R": 0.2})
    assert set(wide.unknowns) - set(told.unknowns) == {"blade.max_chord_over_R"}
    d = wide.solve(6000)
    assert 0.03 < d.u["thrust_N"][0] / d["thrust_N"][0] < 0.3
    assert d.u["CT"][0] / d["CT"][0] < d.u["thrust_N"][0] / d["thrust_N"][0]  # of the unknown air
    dry = wide.replaced({"air.density_kg_m3": 1.2}).solve(6000)
    np.testing.assert_allclose(dry.u["CT"] / dry["CT"], dry.u["thrust_N"] / dry["thrust_N"])
    assert told.solve(6000).u["thrust_N"][0] < d.u["thrust_N"][0]
    assert np.isnan(wide.solve(6000, bands=False).u["thrust_N"][0])


def test_a_curve_is_every_speed_with_every_advance_ratio() -> None:
    d = bemt.propeller("10x5").curve(rpm=[4000, 8000], J=[0.0, 0.3, 0.5], bands=False)
    assert d["rpm"].tolist() == [4000.0] * 3 + [8000.0] * 3
    np.testing.assert_allclose(d["J"], [0.0, 0.3, 0.5] * 2)
    assert np.all(np.diff(d["CT"].reshape(2, 3)) < 0)
    frame = d.to_pandas()
    assert list(frame["rpm"]) == d["rpm"].tolist()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: bemt.propeller("ten by five"), "diameter x pitch"),
        (lambda: bemt.propeller(), "label, stations"),
        (lambda: bemt.propeller(stations="absent.csv"), "diameter_m"),
        (lambda: bemt.propeller(stations="x.csv", diameter_m=254.0), "Divide by 1000"),
        (lambda: bemt.propeller("10x5").solve(-6000), "Drop the sign"),
        (lambda: bemt.propeller("10x5", reading={"rpm": 5400, "thrust_g": 4100}), "expected loads of this rotor"),
        (lambda: bemt.propeller("10x5").solve(6000, 3.0, J=0.2), "one of them"),
        (lambda: bemt.propeller("10x5").solve(float("nan")), "finite"),
        (lambda: bemt.load("no/such/case"), "no/such/case"),
        (lambda: bemt.read("no/such/log.csv"), "no/such/log.csv"),
        (lambda: bemt.drive("10x5", kv=1000, cells=3, mass_kg=1500), "Write 1.5"),
        (lambda: bemt.diagnose("x.csv", "10x5", only=["tip_los"]), "Did you mean tip_loss"),
    ],
)
def test_bad_input_says_what_would_have_been_right(call: object, words: str) -> None:
    with pytest.raises(bemt.InputError, match=words):
        call()  # type: ignore[operator]


@pytest.mark.parametrize("J", [0.0, 0.3, 0.55])
def test_loads_along_the_blade_add_up_to_those_of_the_rotor(J: float) -> None:
    rotor = bemt.load(ROOT / "cases" / "prop_8x5")
    blade, whole = rotor.along_blade(rpm=9000, J=J), rotor.solve(9000, J=J, bands=False)
    width = np.diff(np.r_[blade.r_m[0] - (blade.r_m[1] - blade.r_m[0]) / 2, (blade.r_m[:-1] + np.diff(blade.r_m) / 2),
                          rotor.diameter_m / 2])  # fmt: skip
    for load, total in (("thrust_per_radius_N_m", "thrust_N"), ("torque_per_radius_Nm_m", "torque_Nm")):
        assert np.sum(blade[load] * width) == pytest.approx(whole[total][0], rel=0.02)
    np.testing.assert_allclose(blade.alpha_deg, blade.beta_deg - np.degrees(np.arctan2(
        blade.axial_m_s, 9000 / 60 * 2 * np.pi * blade.r_m - blade.swirl_m_s)), atol=0.5)  # fmt: skip
    with pytest.raises(bemt.InputError, match="one operating point"):
        rotor.along_blade(rpm=[5000, 6000])  # type: ignore[arg-type]


def test_a_recording_is_drawn_beside_a_curve_in_its_colours() -> None:
    pytest.importorskip("matplotlib").use("Agg")
    curve = bemt.propeller("10x5").curve(rpm=6000, J=[0.0, 0.3, 0.5], bands=False)
    axes = curve.plot("J", ["CT", "CP"])
    bench = bemt.Dataset("bench", "stand", {key: curve[key] for key in ("J", "CT", "CP", "rpm")})
    bench.plot("J", ["CT", "CP"], axes)
    lines = axes.lines
    assert [line.get_color() for line in lines[2:]] == [line.get_color() for line in lines[:2]]
    assert lines[2].get_linestyle() == "None" and axes.get_title() == curve.name
    assert "<td>" in curve._repr_html_() and "prop_10x5" in bemt.propeller("10x5")._repr_html_()


def test_what_was_solved_has_its_flags_in_a_table() -> None:
    """A flag that is only there when a point is flagged is not looked at."""
    assert list(bemt.propeller("5x2.5").solve(rpm=12000, bands=False).to_pandas()["flags"]) == [""]


def test_a_drawing_frames_every_line_and_point() -> None:
    """Two speeds, and a recording far off the curve."""
    pytest.importorskip("matplotlib").use("Agg")
    rotor = bemt.propeller("10x5")
    axes = rotor.curve(rpm=[4000, 6500], J=[0.0, 0.2, 0.4]).plot("J", ["thrust_N"])
    far = bemt.Dataset("bench", "stand", {"J": [0.1, 0.3], "thrust_N": [20.0, 30.0], "rpm": [6500.0, 6500.0]})
    far.plot("J", ["thrust_N"], axes)
    low, high = axes.get_ylim()
    assert all(low <= y <= high for line in axes.lines for y in line.get_ydata())


def test_a_log_is_read_and_diagnosed_from_a_frame(tmp_path: Path) -> None:
    pd = pytest.importorskip("pandas")
    prop = bemt.propeller("10x5")
    truth = prop.solve(np.repeat(np.linspace(4000, 9000, 8), 3), bands=False)
    frame = pd.DataFrame({"rpm": truth["rpm"], "thrust_gf": 1000 / 9.80665 * truth["thrust_N"],
                          "torque_Nm": truth["torque_Nm"]})  # fmt: skip
    frame.to_csv(tmp_path / "log.csv", index=False)
    read = bemt.read(tmp_path / "log.csv")
    assert read["thrust_N"].max() == pytest.approx(truth["thrust_N"].max(), rel=0.01)
    answer = bemt.diagnose(frame, prop)
    assert answer.verdict in ("none", "insufficient") and answer.text
    assert answer.improved is None and answer.to_dict()["schema"] == "bemt.diagnosis/1"


def test_a_written_case_is_one_that_the_command_line_runs(tmp_path: Path) -> None:
    prop = bemt.propeller("9x4.5x3")
    file = prop.write(tmp_path / "mine")
    assert bemt.load(file).solve(bands=False)["thrust_N"] == prop.solve(bands=False)["thrust_N"]
    with pytest.raises(bemt.InputError):
        prop.write(tmp_path / "mine")


def test_a_drive_of_a_label_stays_near_what_such_drives_do() -> None:
    """Thrust rises with cells; a motor sheet narrows; the numbers are within reach of the hobby's."""
    three, four = (bemt.drive("10x4.5", kv=900, cells=n) for n in (3, 4))
    assert four.full["thrust_N"].value > three.full["thrust_N"].value
    assert three.full["battery_A"].u_with_sheet < three.full["battery_A"].u
    assert 6.0 < three.full["thrust_N"].value < 12.0 and 8.0 < three.full["battery_A"].value < 25.0
    heavy = bemt.drive("10x4.5", kv=900, cells=3, mass_kg=20.0)
    assert not heavy.reached and "no hover" in heavy.text


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda p: bemt.propeller(10), "^label: "),  # type: ignore[arg-type]
        (lambda p: bemt.propeller("10x5", blades=0), "^blades: "),
        (lambda p: p.solve("fast"), "^rpm: "),
        (lambda p: p.solve([]), "^rpm: "),
        (lambda p: p.solve([5000, 6000], [1, 2, 3]), "2 of rpm, 3 of airspeed_m_s"),
        (lambda p: p.solve(1e7), "^rpm: "),
        (lambda p: p.solve(6000, density_kg_m3="thin"), "^density_kg_m3: "),
        (lambda p: p.curve(6000, "x"), "^J: "),
        (lambda p: p.curve(6000, [0.0, 0.1], bands=False).plot("nope"), "no such channel"),
        (lambda p: p.replaced("blade"), "^changes: "),
        (lambda p: bemt.load(None), "^path: "),  # type: ignore[arg-type]
        (lambda p: bemt.load("no/such/case.toml"), "no/such/case.toml"),
        (lambda p: bemt.read({"rpm": [1]}), "^path: "),  # type: ignore[arg-type]
        (lambda p: bemt.drive(p, kv="900", cells=3), "^kv: "),  # type: ignore[arg-type]
        (lambda p: bemt.drive(p, kv=900, cells=3.5), "whole number"),  # type: ignore[arg-type]
        (lambda p: bemt.drive("no/such/case", kv=900, cells=3), "no/such/case"),
        (lambda p: bemt.diagnose([], p), "^recordings: "),
        (lambda p: bemt.diagnose({"rpm": [5000]}, p), "^recordings: "),
        (lambda p: bemt.compare("a.csv", "b.csv", diameter_m=254), "Divide by 1000"),
    ],
)
def test_what_is_handed_over_wrongly_is_named_and_never_a_traceback(call: object, words: str) -> None:
    with pytest.raises(bemt.InputError, match=words):
        call(bemt.propeller("10x5"))  # type: ignore[operator]


def test_what_a_notebook_shows_is_a_line() -> None:
    p = bemt.propeller("10x5")
    shown = [repr(x) for x in (p, p.solve(6000, bands=False), bemt.drive(p, kv=900, cells=3))]
    assert all(len(words) < 200 and "10x5" in words for words in shown), shown


def test_a_case_cannot_be_written_into_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(bemt.InputError, match="file"):
        bemt.propeller("10x5").write(tmp_path / "file")


def test_faults_of_the_library_name_arguments() -> None:
    """All at once, and none speaks of an option of the command line."""
    with pytest.raises(bemt.InputError) as caught:
        bemt.estimate("10x5", rpm=-1, airspeed_m_s=1e6, chord_mm=0.8, density_kg_m3=1225)
    told = str(caught.value)
    assert len(caught.value.faults) == 4 and "--" not in told
    assert all(name in told for name in ("rpm", "airspeed_m_s", "chord_mm", "density_kg_m3"))


def test_estimate_is_the_answer_of_the_propeller() -> None:
    points = bemt.estimate("10x5", [4000, 6000], [0.0, 5.0])
    own = bemt.propeller("10x5").solve([4000, 4000, 6000, 6000], [0.0, 5.0, 0.0, 5.0])
    np.testing.assert_allclose(points.thrust_N, own.thrust_N, rtol=1e-9)
    np.testing.assert_allclose(points.u["thrust_N"], own.u["thrust_N"], rtol=1e-9)
    assert list(points.to_pandas().rpm) == [4000, 4000, 6000, 6000]
    oblique = bemt.estimate("10x5", 6000, 10.0, angle_deg=[0, 60])
    own = bemt.propeller("10x5").solve(6000, 10.0, angle_deg=[0, 60])
    np.testing.assert_allclose(oblique.thrust_N, own.thrust_N, rtol=1e-9)
    np.testing.assert_allclose(oblique["H_force_N"], own["H_force_N"], rtol=1e-9)


def test_a_plan_takes_a_frame_or_a_file(tmp_path: Path) -> None:
    import pandas as pd

    frame = pd.DataFrame({"rpm": [4000.0, 6000.0, 8000.0], "airspeed_m_s": [0.0, 4.0, 8.0]})
    stand = frame.rename(columns={"rpm": "Motor Optical Speed (RPM)"})  # as the log of a stand calls it
    stand.to_csv(tmp_path / "plan.csv", index=False)
    one, other = bemt.plan(frame, "10x5"), bemt.plan(tmp_path / "plan.csv", "10x5")
    assert one.detectable == other.detectable and one.to_dict()["size"] == pytest.approx(other.to_dict()["size"])


def test_a_report_of_one_case(tmp_path: Path) -> None:
    case = bemt.propeller("10x5").write(tmp_path / "case")
    html, summary = bemt.report(case, out=tmp_path / "out", title="Mine").files
    assert "Mine" in html.read_text(encoding="utf-8") and summary.exists()


def test_what_an_answer_stands_on_follows_the_case(tmp_path: Path) -> None:
    """An effect that is switched off is not cited; a duct brings its own; data of the case come along."""
    p = bemt.propeller("10x5")
    names = [s.name for s in bemt.cite(p)]
    assert "swirl" in names and "tip_gap" not in names and len(names) == len(set(names))
    assert "swirl" not in [s.name for s in bemt.cite(p.replaced({"model.effects_off": ["swirl"]}))]
    assert all(len(s.source) > 10 for s in bemt.cite(p))
    text = bemt.cite(p).text
    assert 'form = "table"' in text and 'form = "power"' not in text  # only what is on
    fan = bemt.cite(str(Path(__file__).parents[1] / "cases" / "ds30"))
    assert "tip_gap" in [s.name for s in fan] and any(s.kind == "data" and "Cahill" in s.source for s in fan)


def test_the_api_is_typed_where_it_is_installed_editable(project: Path) -> None:
    """One .pth file, which type checkers follow, instead of an import hook; and the marker of PEP 561."""
    import tomllib

    config = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))
    assert config["tool"]["setuptools"]["package-dir"] == {"": "."} and (project / "bemt" / "py.typed").exists()


def test_the_sources_of_an_answer_are_bibtex(project: Path) -> None:
    """Works are entries with fields of their own, what names none is a comment; each says where it is used."""
    text = bemt.cite(project / "cases" / "ds30").bibtex()
    entries = bibtex_entries(text)
    assert {"bemt", "glauert1935", "ning2014", "cahill2025"} <= entries.keys()
    assert {"mccormick1967", "pereira2008", "kuechemann1953", "idelchik2007"} <= entries.keys()
    assert entries["ning2014"]["doi"] == "10.1002/we.1636" and entries["ning2014"]["journal"] == "Wind Energy"
    assert entries["glauert1935"]["booktitle"] == "Aerodynamic Theory"
    assert "thesis" in entries["cahill2025"]["title"]
    database = entries["brandt2022"]
    assert "UIUC Propeller Database" in database["title"] and database["url"].startswith("https://m-selig.ae.illinois")
    assert all(re.search(r"(^|; )in \w", fields["note"]) for key, fields in entries.items() if key != "bemt")
    assert "not checked" in entries["horlock1958"]["note"] and "not checked" not in entries["ning2014"]["note"]
    assert "Selig" in bibtex_entries(bemt.cite("apce_10x7").bibtex())["brandt2022"]["author"]


def bibtex_entries(text: str) -> dict[str, dict[str, str]]:
    """Entries and their fields as BibTeX scans them: what is not in an entry is no @, and every brace counts."""
    out: dict[str, dict[str, str]] = {}
    at = 0
    while (at := text.find("@", at)) >= 0:
        head = re.compile(r"@(\w+)\{([^\s,{}@%#\\]+),").match(text, at)
        assert head, text[at : at + 60]
        fields, place = {"type": head[1]}, head.end()
        while not (end := re.compile(r"\s*\}").match(text, place)):
            name = re.compile(r"\s*(\w+) = \{").match(text, place)
            assert name, text[place : place + 60]
            place, depth = name.end(), 1
            while depth:
                depth += {"{": 1, "}": -1}.get(text[place], 0)
                place += 1
            assert name[1] not in fields
            fields[name[1]] = text[name.end() : place - 1]
            place += text[place] == ","
        assert head[2] not in out
        out[head[2]], at = fields, end.end()
    return out


REQUIRED = {
    "misc": set(), "article": {"journal"}, "book": {"publisher"}, "incollection": {"booktitle", "publisher"},
    "inproceedings": {"booktitle"}, "techreport": {"institution"}, "phdthesis": {"school"},
}  # fmt: skip
"""Fields that BibTeX asks for by type of entry, besides author, title and year."""


def test_every_source_compiles_as_bibtex(project: Path) -> None:
    """Those of every effect, and what a user wrote into a table of references."""
    of_effects = [Source("effect", name, source_of(cls)) for name, cls in catalogue().items()]
    odd = Source("data", "odd", r"Müller and O'Neil (2019), {half \ a brace, 100 % of #1 ~ x^2 & y_z, me@there.org")
    bare = Source("data", "mail", "asked of someone@there.org {")
    entries = bibtex_entries(bibtex(Sources((Source("method", "program", ""), *of_effects, odd, bare))))
    entries |= bibtex_entries(bemt.cite(project / "cases" / "ds30").bibtex())
    assert {"bemt", "muller2019", "ning2014"} <= entries.keys() and len(entries) > 40
    for key, fields in entries.items():
        assert REQUIRED[fields["type"]] | {"author", "title", "year"} <= fields.keys() and key.isascii(), key
        for name, value in fields.items():
            assert value.strip() and (name == "doi" or not re.search(r"(?<!\\)[&%$#_~^]", value)), (key, name, value)


def test_every_work_that_the_physics_names_has_its_fields() -> None:
    """Each has title and place of publication in works.bib, and no entry there is without a source that names it."""
    from bemt.rotors.case import sources as module

    told = [*map(source_of, catalogue().values()), module.METHOD, module.DUCT, module.TABLES, module.K1K2]
    whole = Sources(Source("method", "x", text) for text in ("", *told, population().provenance["source"]))
    assert bibtex_entries(bibtex(whole)).keys() == {"bemt", *module.works()}


def test_numbers_of_numpy_are_numbers_and_answers_are_plain_values() -> None:
    found = bemt.drive("10x4.5", kv=np.float32(900.0), cells=np.int64(4), rotors=np.int32(4), mass_kg=1.0)
    assert json.dumps(found.to_dict()) == json.dumps(
        bemt.drive("10x4.5", kv=900, cells=4, rotors=4, mass_kg=1.0).to_dict()
    )


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: bemt.prove(size="nonsense"), "size: got 'nonsense'; expected one of small, full"),
        (lambda: bemt.diagnose(FRAME, "10x5", channels=["lift"]), "channels: got 'lift'; expected one of thrust"),
        (lambda: bemt.estimate(["10x5"], rpm=6000), "label: got list"),
        (lambda: bemt.propeller("10x5").curve(rpm=6000, J=-99), "J: got 2514.6 m/s; expected up to 300 m/s"),
        (lambda: bemt.import_(FRAME), "files: got DataFrame"),
        (lambda: bemt.compare(FRAME, FRAME), "the same recording twice"),
    ],
)
def test_a_word_or_an_object_that_is_none_is_named(call: Callable[[], object], words: str) -> None:
    with pytest.raises(bemt.InputError) as error:
        call()
    assert words in str(error.value)


def test_one_thing_is_a_sequence_of_it_and_what_fits_no_parameter_is_refused(tmp_path: Path) -> None:
    """Every parameter of every action, given what people have at hand."""
    one = KnownMotor("mine", 920.0, 0.1, 0.5)
    odd = (one, Path("a.csv"), np.float64(5.0), np.int64(5), np.array(5.0), np.array([5.0, 6.0]), pd.Series(["duct"]),
           pd.Series([5.0]), FRAME, {"thrust_N": "N"}, {"duct"}, (k for k in ["duct"]), "duct", True, None,
           object())  # fmt: skip
    fits: dict[str, Callable[[Any], bool]] = {
        "float": lambda v: isinstance(v, (int, float)) and not isinstance(v, bool), "str": lambda v: isinstance(v, str),
        "Path": lambda v: isinstance(v, (str, Path)),
        "Sequence[str]": lambda v: isinstance(v, (list, tuple)) and all(isinstance(k, str) for k in v),
        "Mapping[str, str]": lambda v: isinstance(v, (dict, list)),
        "Path | Sequence[Path | KnownMotor]": lambda v: isinstance(v, (str, Path, list)),
    }  # fmt: skip
    seen = 0
    for function in (f for f in map(bemt.__getattr__, bemt._homes()) if hasattr(f, "about")):
        kinds = getattr(inspect.unwrap(function), "__annotations__", {})
        for name, kind in ((k, str(v)) for k, v in kinds.items() if k != "return"):
            for value in odd:
                try:
                    found = declared(name, kind, value)
                except bemt.InputError as error:
                    assert f"{name}: got " in str(error)
                    continue
                seen += 1
                plain = kind.removesuffix(" | None")
                by_default = value is None and (plain != kind or plain not in ("float", "str", "Path"))
                assert by_default or plain not in fits or fits[plain](found), (name, value)
    assert seen > 500
    with pytest.raises(bemt.InputError, match="^changed: propeler: got an unknown effect"):
        bemt.diagnose(FRAME, "10x5", changed="propeler")
    assert bemt.choose(8.0, 3, labels="10x4.5", motors=one).table.motor.tolist() == ["mine"]
    assert (
        bemt.choose(8.0, 3, labels=pd.Series(["10x4.5"]), kv=np.array([900.0]), blades=None).table.kv.iloc[0] == 900.0
    )
    with pytest.raises(bemt.InputError, match=r"label: got int 5.*\nrpm: got str 'x'") as several:
        bemt.compare(FRAME, FRAME, rpm="x", label=5)
    assert len(several.value.faults) == 2
    for point in (KnownMotor, np.float64(5.0), Path("a.csv")):
        with pytest.raises(bemt.InputError, match=r"points\[0\]"):
            bemt.design(points=point)
    for given in ({"logs": FRAME}, {"logs": None}, {"logs": "a.bin", "healthy": np.array([5.0])}):
        with pytest.raises(bemt.InputError, match=f"^{[*given][-1]}: got"):
            bemt.fly(**given)
    (tmp_path / "taken").write_text("")
    with pytest.raises(bemt.InputError, match="taken: got File exists"):
        bemt.choose(8.0, 3, labels="10x4.5", kv=900.0, out=tmp_path / "taken")
    with pytest.raises(bemt.InputError, match="^motors: got DataFrame"):
        bemt.choose(8.0, 3, motors=FRAME)


def test_a_frame_with_the_speed_as_its_index_is_the_same_frame() -> None:
    """As after ``set_index("rpm")``: without it the speed would be that of the case."""
    weak = FRAME.assign(thrust_N=0.9 * FRAME.thrust_N)
    plain, indexed = bemt.compare(FRAME, weak), bemt.compare(FRAME.set_index("rpm"), weak.set_index("rpm"))
    assert plain.document["ratios"] == indexed.document["ratios"]
    assert from_pandas(FRAME.set_index("rpm")).rpm.tolist() == FRAME.rpm.tolist()
    assert from_pandas(FRAME.rename_axis("sample")).labels == ()
    one, whole = bemt.compare(FRAME, case="10x5"), bemt.compare(FRAME.set_index("rpm"), case="10x5")
    assert one.document["points"] == whole.document["points"] and len(one.document["points"]) == len(FRAME)
    for call, words in (
        (lambda: bemt.propeller("10x5").solve(FRAME), "One column of it"),
        (lambda: bemt.compare(FRAME, FRAME.iloc[:0]), "^B: got no rows"),
    ):
        with pytest.raises(bemt.InputError, match=words):
            call()


def test_frames_are_compared_as_files_are(tmp_path: Path) -> None:
    weak = FRAME.assign(thrust_N=0.9 * FRAME.thrust_N)
    files = tmp_path / "a.csv", tmp_path / "b.csv"
    for frame, file in zip((FRAME, weak), files, strict=True):
        frame.to_csv(file, index=False)
    by_frames, by_files = bemt.compare(FRAME, weak), bemt.compare(*files)
    assert (by_frames.verdict, by_frames.effects) == (by_files.verdict, by_files.effects)
    assert bemt.compare(FRAME, weak, case="cases/prop_10x5").document["case"] == "prop_10x5"


def test_an_estimate_prints_its_text_with_parameters_and_takes_a_reading_by_name() -> None:
    assert "chord_mm" in str(bemt.estimate("10x5", 6000)) and "--" not in str(bemt.estimate("10x5", 6000))
    by_name = bemt.estimate("10x5", 6000, reading={"rpm": 5400, "thrust_g": 410})
    assert by_name.text == bemt.estimate("10x5", 6000, reading="rpm=5400,thrust_g=410").text


def test_the_help_of_the_package_lists_its_functions() -> None:
    shown = pydoc.plain(pydoc.render_doc(bemt))
    assert all(f"    {name}(" in shown for name in ("estimate", "diagnose", "drive", "propeller"))


@pytest.mark.parametrize("angle", [None, 30.0])
def test_a_rotor_that_stands_still_is_nan_and_flagged_and_the_others_are_solved(angle: float | None) -> None:
    p = bemt.propeller("10x5")
    d = p.solve(rpm=[0, 5000, float("nan")], airspeed_m_s=5.0, angle_deg=angle)
    alone = p.solve(rpm=5000, airspeed_m_s=5.0, angle_deg=angle)
    assert d.converged.tolist() == [False, True, False]
    assert [key for key in alone] == [key for key in d]
    for key in alone:
        if key not in ("rpm", "airspeed_m_s", "density_kg_m3"):
            np.testing.assert_array_equal(d[key], [np.nan, alone[key][0], np.nan])
    np.testing.assert_array_equal(d.u_thrust_N, [np.nan, alone.u_thrust_N[0], np.nan])
    assert d.flags[0] == ("stands still: no load is computed",) and d.flags[2][0].startswith("speed unknown")
    assert d.flags[1] == alone.flags[0]


def test_a_stopped_rotor_alone_is_no_zero_either() -> None:
    d = bemt.propeller("10x5").solve(0)
    assert np.isnan(d.thrust_N[0]) and not d.converged[0] and "stands still" in d.flags[0][0]
    c = bemt.propeller("10x5").curve(rpm=[0, 6000], J=[0.0, 0.3], bands=False)
    assert c.converged.tolist() == [False, False, True, True]
    with pytest.raises(bemt.InputError, match="got -5; expected speeds of 0 rev/min or more. Drop the sign"):
        bemt.propeller("10x5").solve([0, -5])
    with pytest.raises(bemt.InputError) as caught:
        bemt.propeller("10x5").along_blade(0)
    assert "above 0" in str(caught.value) and "sign" not in str(caught.value)


def test_who_gives_an_angle_reads_the_loads_in_the_plane_in_axial_flow_too() -> None:
    p = bemt.propeller("10x5")
    for key in ("sideslip_rad", "H_force_N", "Y_force_N", "roll_moment_Nm", "pitch_moment_Nm"):
        found = p.solve(rpm=5000, airspeed_m_s=5.0, angle_deg=[0, 0], bands=False)[key]
        np.testing.assert_array_equal(found, [0.0, 0.0])
        assert p.solve(rpm=5000, airspeed_m_s=5.0, angle_deg=[0, 1e-9], bands=False)[key] == pytest.approx(
            0.0, abs=1e-6
        )
        assert key not in p.solve(rpm=5000, airspeed_m_s=5.0, bands=False)
