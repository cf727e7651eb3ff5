"""Promise: one file, honest words, nothing of the data acts."""

from __future__ import annotations

import base64
import csv
import hashlib
import html.parser
import io
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest
from made_case import make_case

from bemt.app.cli import main
from bemt.base.page import render
from bemt.physics.dataset import Dataset
from bemt.results.report import book_html
from bemt.results.report.book import About, Book, CasePage
from bemt.results.report.diagnosis_block import answer, verdict
from bemt.results.report.front import front_parts, summary
from bemt.results.report.gather import attach_diagnoses, gather, safe_files
from bemt.results.report.plot import Mark, Plot, Trace, figure, ticks, viewer
from bemt.results.sweep.rows import Comparison, Result, Row
from bemt.tools.cfd.report import attach, cfd_runs, operating_run, report_pages
from geometry.mesh import Surface

EVIL = "<script>window.pwned=1</script><img src=x onerror=window.pwned=1>\"'`]]>--><svg onload=window.pwned=1>"


def write_case(folder: Path, name: str, title: str, remark: str, bench_u: str = "0.01") -> Path:
    """Folder of a case that has a title, with a remark on a reference."""
    quoted = remark.replace('"', '""')
    references = (
        "quantity,value,unit,uncertainty,kind,source,remark,rpm,airspeed_m_s,density_kg_m3\n"
        f'thrust,0.5,kgf,{bench_u},bench,"{quoted[:300]}",,6000,0,1.2\n'
        f'thrust,0.62,kgf,unknown,cfd,solver,"{quoted}",6000,0,1.2\n'
    )
    return make_case(folder, name, references=references, title=title).parent


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Book, Path]:
    """Book and folder of two cases that can be solved, one of them hostile, and one that cannot."""
    root = tmp_path_factory.mktemp("report")
    write_case(root / "cases", "plain", "A plain propeller", "MRF, incompressible; domain 5 D")
    write_case(
        root / "cases", "rude", EVIL.replace("\\", "").replace('"', "'"), (EVIL.replace("\n", "") * 200)[:10_000]
    )
    wrong = root / "cases" / "wrong"
    wrong.mkdir()
    (wrong / "case.toml").write_text(f"schema = 'bemt.case/1'\nname = '''../{EVIL}'''\n")
    return gather([root / "cases"], root / "out"), root


@pytest.fixture(scope="module")
def text(made: tuple[Book, Path]) -> str:
    return book_html(made[0])


class Reader(html.parser.HTMLParser):
    """Elements with their attributes, and the text of every element."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.words: dict[str, list[str]] = {}
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        while self.open and self.open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if self.open:
            self.words.setdefault(self.open[-1], []).append(data)


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    return reader


def tables(page: str) -> list[list[list[str]]]:
    """Lines of every CSV that the page offers."""
    links = [a["href"] or "" for t, a in read(page).found if t == "a" and "download" in a]
    return [list(csv.reader(io.StringIO(unquote(link.partition(",")[2])))) for link in links]


TAGS = {
    "html", "head", "meta", "link", "title", "style", "body", "header", "h1", "h2", "h3", "p", "nav", "ul", "li", "a",
    "main", "section", "article", "div", "span", "strong", "code", "img", "figure", "figcaption", "svg", "path", "g",
    "text", "circle", "canvas", "button", "details", "summary", "table", "thead", "tbody", "tr", "th", "td", "footer",
    "script",
}  # fmt: skip


def assert_harmless(page: str) -> None:
    """Only known elements, one script, no handlers, no address but inner ones and data."""
    reader = read(page)
    assert {tag for tag, _ in reader.found} <= TAGS
    assert sum(tag == "script" for tag, _ in reader.found) == 1
    for tag, attributes in reader.found:
        for name, value in attributes.items():
            assert not name.startswith("on"), (tag, name)
            if name in ("href", "src"):
                inner = ("#", "data:image/", "data:,", *(["data:text/csv;"] if "download" in attributes else []))
                assert value is not None and value.startswith(inner), (tag, value)


def test_the_file_stands_alone(text: str) -> None:
    assert_harmless(text)
    assert len(text.encode()) < 8e6
    assert "http:" not in text and "https:" not in text and "@import" not in text and "url(" not in text
    reader = read(text)
    policy = next(a["content"] for t, a in reader.found if t == "meta" and a.get("http-equiv"))
    script = "".join(reader.words["script"])
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert policy is not None and "default-src 'none'" in policy and f"script-src 'sha256-{digest}'" in policy
    assert len(script) < 40_000


def test_no_clock_and_no_chance_is_in_the_file(made: tuple[Book, Path], text: str) -> None:
    assert book_html(made[0]) == text
    plain = text[text.index('id="case-1-plain"') : text.index('id="case-2-rude"')]
    assert str(made[1]) not in plain, "no path of this machine"


def test_menu_leads_to_pages_and_no_panel_is_empty(text: str) -> None:
    reader = read(text)
    ids = [a["id"] for t, a in reader.found if t == "section"]
    menu = [a["href"] for t, a in reader.found if t == "a" and "download" not in a]
    assert {f"#{i}" for i in ids} == set(menu) and len(ids) == len(set(ids))
    assert "front" in ids
    for plot in re.findall(r"<figure class=\"plot[^>]*>.*?</figure>", text, re.DOTALL):
        assert re.search(r'<g class="trace" data-t="0"[^>]*>.*<path', plot)
    assert not re.search(r"<h3>[^<]*</h3>\s*(<h3>|</section>)|</h2>\s*</section>", text), (
        "a heading without anything below"
    )
    assert not re.search(r"<tbody></tbody>", text)


def test_every_plot_names_its_axes_with_units(text: str) -> None:
    plots = tables(text)
    assert len(plots) == sum("data-at" in a for _, a in read(text).found) >= 26, "a CSV behind every plot"  # 2 cases
    for head, *rows in plots:
        assert re.search(r"\[.+\]$", head[1]), head
        assert head[2] == "row" or re.search(r"\[.+\]$", head[2]), head
        assert rows and all(len(row) == len(head) and math.isfinite(float(row[1])) for row in rows)


def test_every_part_of_a_case_is_there(text: str) -> None:
    page = text[text.index('id="case-1-plain"') :]
    page = page[: page.index('<section class="page"')]
    for heading in (
        "Geometry",
        "Performance",
        "Radial loading",
        "Validation",
        "Audit of the CFD",
        "Verification",
        "Inputs and assumptions",
        "Limits",
    ):
        assert f"<h3>{heading}</h3>" in page
    assert "Diagnosis" not in page, "nothing is shown of what is not there"
    for name in ("case.toml", "references.csv", "polar.csv"):
        assert name in page
    assert re.search(r"<code>[0-9a-f]{64}</code>", page)


def test_a_faulty_case_is_named_and_does_not_stop_the_others(made: tuple[Book, Path], text: str) -> None:
    assert made[0].exit_code == 2
    assert "not solved" in text and "A plain propeller" in text
    inside = {path.relative_to(made[1]).as_posix().split("/")[0] for path in made[1].rglob("*")}
    assert inside == {"cases", "out"}, "nothing is written beside the folder of results"


def poison(value: Any) -> Any:
    """Same shape; every text hostile, every number NaN."""
    if isinstance(value, Dataset):
        return replace(value, values=poison(value.values), u=poison(value.u), flags=poison(value.flags))
    if isinstance(value, dict | MappingProxyType):
        return {k: poison(v) for k, v in value.items()}
    if is_dataclass(value) and not isinstance(value, Surface):
        kept = ("source", "status", "model")
        return replace(value, **{f.name: poison(getattr(value, f.name)) for f in fields(value) if f.name not in kept})
    if isinstance(value, list):
        return [poison(v) for v in value]
    if isinstance(value, tuple):
        return tuple(poison(v) for v in value)
    if isinstance(value, np.ndarray):
        return np.full(value.shape, np.nan)
    if isinstance(value, str):
        return (EVIL * 100)[:10_000]
    return math.nan if isinstance(value, float) else value


def test_nan_everywhere_and_hostile_words_render_harmlessly(made: tuple[Book, Path]) -> None:
    book = poison(made[0])
    page = book_html(book)
    assert_harmless(page)
    assert 'data-at="' not in page, "NaN makes no panel"
    assert ">nan<" not in page.lower() and ">inf<" not in page.lower()
    markdown = summary(book)
    assert "<script" not in markdown and "<img" not in markdown


DIAGNOSIS = {
    "schema": "bemt.diagnosis/1",
    "verdict": "named",
    "effects": ["duct"],
    "explanation": "Thrust is low. " + EVIL,
    "ranking": [
        {
            "effect": "duct",
            "probability": 0.97,
            "parameters": {"sigma": {"value": 1.1, "low": 1.0, "high": 1.2, "unit": "-"}},
        }
    ],
    "location": {"channel": "thrust", "variable": "J", "low": 0.0, "high": 0.4, "size": 0.08, "z": 6.0},
    "fit": {
        "thrust": {"before": 8.1, "after": 1.9, "noise": 1.6, "gp_only": 2.0, "holdout_before": 8.4, "holdout_after": 2}
    },
    "classes": [["duct", "ground_effect"]],
    "next_measurement": {"text": "Weigh the duct alone."},
    "p_value": 0.001,
}


def test_a_diagnosis_is_shown_with_its_figures_and_none_from_outside(made: tuple[Book, Path], tmp_path: Path) -> None:
    book = made[0]
    folder = tmp_path / "plain" / "diagnosis"
    folder.mkdir(parents=True)
    (folder / "diagnosis.json").write_text(json.dumps(DIAGNOSIS))
    (folder / "residual_map.svg").write_text('<svg xmlns="x"><script>window.pwned=1</script></svg>')
    (folder / "residual_map.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(5000))  # the same, larger
    (folder / "no_picture.png").write_bytes(b"not a png")
    (tmp_path / "secret.svg").write_text("<svg>secret</svg>")
    (folder / "link.svg").symlink_to(tmp_path / "secret.svg")
    assert [name for name, _ in safe_files(folder)] == ["residual_map.svg"]
    book = attach_diagnoses(book, tmp_path)
    page = book_html(book)
    assert_harmless(page)
    assert "Diagnosis: what the model leaves out" in page and "Weigh the duct alone." in page
    assert "residual map" in page and "duct thrust or wall behind the propeller" in page


def test_a_parameter_of_another_form_of_the_law_is_not_shown(made: tuple[Book, Path], tmp_path: Path) -> None:
    unused, used = (dict(zip(("value", "low", "high"), values, strict=True), unit="")
                    for values in ([None] * 3, (0.84, 0.8, 0.91)))  # fmt: skip
    ranking = [{"effect": "drag_divergence", "probability": 0.9, "parameters": {"form": unused, "kappa": used}}]
    folder = tmp_path / "diagnosis" / "one"
    folder.mkdir(parents=True)
    (folder / "diagnosis.json").write_text(json.dumps({**DIAGNOSIS, "ranking": ranking}))
    book = attach_diagnoses(made[0], tmp_path)
    page = book_html(book)
    assert "kappa 0.840 (0.800 to 0.910)" in page and "form -" not in page


@pytest.mark.parametrize(
    "content",
    [
        "",
        "[]",
        "{",
        '{"schema": 3}',
        '{"schema": "bemt.diagnosis/1"}',
        '{"schema": "bemt.diagnosis/1", "ranking": {"a": 1}, "fit": [1], "location": "x", '
        '"effects": 7, "classes": [1], "next_measurement": []}',
    ],
)
def test_a_broken_diagnosis_breaks_nothing(made: tuple[Book, Path], tmp_path: Path, content: str) -> None:
    book = made[0]
    (tmp_path / "plain" / "diagnosis").mkdir(parents=True)
    (tmp_path / "plain" / "diagnosis" / "diagnosis.json").write_text(content)
    book = attach_diagnoses(book, tmp_path)
    assert_harmless(book_html(book))


RECORDING = """run,rpm,airspeed_m_s,J,thrust_N,torque_Nm,u_thrust_N,u_torque_Nm,density_kg_m3,wall_distance_m,tip_gap_mm,sideslip_deg,pitch_offset_deg,solver,gas,domain,sector,turbulence,level,cells,iterations,drift_thrust,drift_torque,scatter_thrust,yplus_avg,seconds,converged,note
coarse,6000,0,0,4.6,0.09,0.02,0.001,1.2,,,0,0,incompressible,,free,half,kOmegaSST,5,34000,300,0.002,0.002,0.001,60,200,1,
fine,6000,0,0,4.8,0.09,0.05,0.001,1.2,,,0,0,compressible,,free,half,kOmegaSST,6,90000,300,0.002,0.002,0.001,45,200,1,
finer,6000,0,0,9.9,0.09,0.05,0.001,1.2,,,0,0,compressible,,free,half,kOmegaSST,7,90000,300,0.9,0.9,0.9,45,200,0,
plate,6000,0,0,5.9,0.09,0.05,0.001,1.2,0.1,,0,0,compressible,,free,half,kOmegaSST,7,90000,300,0,0,0,45,200,1,
pipe,6000,0,0,2.9,0.09,0.05,0.001,1.2,,,0,0,compressible,,pipe,half,kOmegaSST,7,90000,300,0,0,0,45,200,1,
fast,6000,9.0,0.35,3.1,0.08,0.05,0.001,1.2,,,0,0,compressible,,free,half,kOmegaSST,6,90000,300,0,0,0,45,200,1,
"""  # noqa: E501
STUDY = {"schema": "bemt.cfd-recording/1", "title": "made " + EVIL, "case": "plain", "rule": {"grid_study": True},
         "grid_studies": [{"levels": [6, 5.5, 5]}]}  # fmt: skip


def cfd_folder(root: Path, manifest: object, recording: str) -> Path:
    folder = root / "cfd" / "made"
    folder.mkdir(parents=True)
    (folder / "manifest.json").write_text(manifest if isinstance(manifest, str) else json.dumps(manifest))
    (folder / "recording.csv").write_text(recording)
    (folder / "radial.csv").write_text(
        "run,r_m,thrust_per_radius_N_m,torque_per_radius_Nm_m\nfine,0.05,40,1\nfine,0.1,60,2\n"
    )
    return root


def test_own_cfd_stands_beside_bemt_with_its_audit(made: tuple[Book, Path], tmp_path: Path) -> None:
    book = made[0]
    book = report_pages(book, cfd_folder(tmp_path / "before the check", STUDY, RECORDING))
    line = book.cases[0].result.comparisons[-1]
    assert math.isnan(line.u_D) and line.verdict.startswith("u_D unknown"), "nobody has shown that it balances"
    book = made[0]
    balanced = "\n".join(
        f"{row}{',0.001,-0.002' if k else ',balance_mass,balance_momentum'}"
        for k, row in enumerate(RECORDING.splitlines())
    )
    folder = cfd_folder(tmp_path, STUDY, balanced)
    book, found = attach(book, cfd_runs(folder))
    page = book.cases[0]
    run = operating_run(found, page.result)
    assert run is not None and run.run == "fine", "settled, free, bare, compressible, finest"
    assert {row.label for row in page.own_rows} == {"incompressible, 34000 cells", "compressible, 90000 cells"}
    assert page.own_radial == {"CFD, own, compressible": [(0.05, 40.0, 1.0), (0.1, 60.0, 2.0)]}
    line = page.result.comparisons[-1]
    assert run.audit is not None
    parts = [item.u_relative for item in run.audit.lines]
    assert line.D == 4.8 and line.u_D == pytest.approx(4.8 * math.sqrt(sum(p * p for p in parts)))
    grid = next(item for item in run.audit.lines if item.topic == "grid study")
    assert grid.u_relative == pytest.approx(math.sqrt((0.05 / 4.8) ** 2 - 0.001**2))
    assert line.u_val > 0 and line.verdict in ("not distinguishable from noise", "differs")
    html_text = book_html(report_pages(made[0], folder))
    assert_harmless(html_text)
    assert "Own CFD" in html_text and "did not settle" in html_text


@pytest.mark.parametrize(("manifest", "recording"), [
    ("", RECORDING), ("[]", RECORDING), ({"schema": "bemt.cfd-recording/1"}, ""),
    ({"schema": "bemt.cfd-recording/1", "rule": 3, "grid_studies": "x", "case": ["plain"]}, RECORDING),
    (STUDY, RECORDING.replace("6000", EVIL.replace(",", ""))),
    (STUDY, RECORDING.replace(",4.8,", ",nan,") + "cut,60\x00"),
    (STUDY, "run,rpm\n" + "a," * 500),
])  # fmt: skip
def test_broken_recordings_break_nothing(made: tuple[Book, Path], tmp_path: Path, manifest: object,
                                         recording: str) -> None:  # fmt: skip
    book = made[0]
    book = report_pages(book, cfd_folder(tmp_path, manifest, recording))
    assert_harmless(book_html(book))


@pytest.mark.parametrize(
    ("E", "u_D", "kind", "words"),
    [
        (1.0, 1.7, "same", "Not distinguishable from noise"),
        (3.0, 1.7, "differs", "more than the validation uncertainty"),
        (3.0, None, "unknown", "is at least this uncertain: bench 2.8 N"),
        (0.5, math.nan, "same", "whatever the uncertainty of the recording"),
    ],
)
def test_verdicts_follow_validation_uncertainty(E: float, u_D: float | None, kind: str, words: str) -> None:
    line = Comparison(reference="bench", source="bench", S=10.0, D=10.0 - E, u_input=1.0).document() | {"u_D": u_D}
    row = Row("bemt", "bemt", 10.0, u=1.0)
    found, _, sentence = verdict(Result("one", rows=(row,), comparisons=(Comparison.from_document(line),)))
    assert found == kind and words in sentence


def test_like_stands_beside_like_where_the_recording_is_at_another_speed() -> None:
    """A case at 9000 rev/min whose CFD ran at 6000: BEMT's value is that at 6000, everywhere."""
    rows = (
        Row("bemt", "bemt", 11.01, rpm=9000.0, airspeed_m_s=0.0, u=1.0),
        Row("bemt", "bemt", 4.751, rpm=6000.0, airspeed_m_s=0.0, u=0.4),
        Row("cfd", "cfd 5.250 N", 5.25, rpm=6000.0, airspeed_m_s=0.0, bemt_error_pct=-9.5),
    )
    line = Comparison(reference="cfd 5.250 N", source="cfd", S=4.751, D=5.25, u_input=0.4, rpm=6000.0)
    result = Result("one", rows=rows, comparisons=(line,))
    told = [answer(result), verdict(result)[2], summary(Book("0", (CasePage(result),), 0))]
    for text in told:
        assert "4.751" in text and "6000" in text and "11.0" not in text and "9000" not in text
    bench = Row("bench", "bench 10 N", 10.0, rpm=9000.0, airspeed_m_s=0.0)
    second = Comparison(reference="bench 10 N", source="bench", S=11.01, D=10.0, rpm=9000.0)
    at_both = replace(result, rows=(*rows, bench), comparisons=(line, second))
    assert "BEMT 11.01" in answer(at_both) and "CFD 5.25 N at 6000 rev/min" in answer(at_both)


def test_nothing_is_ever_called_correct(text: str, made: tuple[Book, Path]) -> None:
    assert not re.search(r"\b(correct|validated|accurate|proven)\b", text + summary(made[0]), re.IGNORECASE)


def test_plots_keep_their_numbers_and_leave_out_what_is_not_one() -> None:
    plot = Plot(
        "t",
        "x [m]",
        "y [N]",
        [Trace("a", [0.0, 1.0, 2.0, 3.0], [1.0, math.nan, 3.0, None], [0.1] * 4), Trace("gone", [math.inf], [1.0])],
        [Mark(math.nan, "nowhere"), Mark(1.5, "here")],
    )
    out = figure(plot)
    assert out is not None and [t.name for t in out.traces] == ["a"]
    page = render("bemt.results.report", "report.html", pages=[{"id": "a", "name": "a", "title": "a", "top": [],
                  "sections": [("a", [("figures", [out])])]}], title="", lead="", foot="")  # fmt: skip
    ((head, *rows),) = tables(page)
    assert [[float(v) for v in row[1:4]] for row in rows] == [[0.0, 1.0, 0.1], [2.0, 3.0, 0.1]]
    assert "here" in page and "nowhere" not in page
    places = [tuple(map(float, p.split(",")))[1:] for p in out.at.split()]
    lines = [d for kind, d in out.traces[0].paths if kind == "dot"]
    assert len(places) == len(lines) == 2 and places[0][0] < places[1][0] and places[0][1] > places[1][1]


def test_a_rotor_in_the_viewer_is_small_and_keeps_its_shape(made: tuple[Book, Path]) -> None:
    found = made[0].cases[0].surfaces
    packed = viewer(found)
    assert len(packed.mesh) < 300_000
    for one, mesh in zip(found, json.loads(packed.mesh), strict=True):
        back = np.frombuffer(base64.b64decode(mesh["data"]), "<i2").reshape(mesh["rows"], mesh["columns"], 3) / 32767
        assert np.linalg.norm(back, axis=-1).max() < 1.0001, "turned anyhow, it stays in the window"
        a, b = (np.diff(points.reshape(-1, 3), axis=0) for points in (back, one.points))
        size = np.linalg.norm(b) / np.linalg.norm(a)
        assert np.abs(a * size - b).max() < 5e-5 * size


def test_one_outlier_does_not_flatten_the_axis() -> None:
    far = Trace("far", [0.1], [0.0], points=True)
    near = Trace("near", [0.9, 1.1], [0.0, 0.2], points=True)
    plot = Plot("t", "ratio [-]", "", [near, far], y_names=["case"], x_limits=(0.4, 2.0))
    shown, alone = figure(plot), figure(replace(plot, traces=[near]))
    assert shown is not None and alone is not None
    assert shown.traces[0] == alone.traces[0], "the others stand where they stand without it"
    assert [t.words for t in shown.traces[1].words] == ["0.10"], "and it is named at the edge"


@pytest.mark.parametrize(
    ("low", "high"), [(0.0, 1.0), (-3.2e-5, 7.7e-5), (18_000.0, 61_000.0), (-1e9, 2e9), (0.97, 0.971)]
)
def test_ticks_are_round_and_inside(low: float, high: float) -> None:
    marks = ticks(low, high)
    assert 3 <= len(marks) <= 12 and low <= marks[0] and marks[-1] <= high
    steps = np.diff(marks)
    assert np.allclose(steps, steps[0])


def test_escaping_leaves_nothing_that_acts() -> None:
    page = render("bemt.base", "page.html", title=EVIL + "a\x00b\u202ec\ud800")
    assert "<img" not in page and "<svg" not in page and "<script" not in page and "abc" in page
    harm = figure(Plot("t", "x [m]", "y [N]", [Trace("=cmd|' /C calc'!A0", [1.0], [2.0], labels=["@SUM(1)"])]))
    assert harm is not None
    rows = list(csv.reader(io.StringIO(unquote(harm.csv.partition(",")[2]))))
    assert not any(cell[:1] in "=+-@" for row in rows for cell in row if cell), "no formula for a spreadsheet"


def test_command_writes_two_files_and_says_so(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    made: tuple[Book, Path],
) -> None:
    monkeypatch.setattr("bemt.results.report.gather.gather", lambda paths, out, progress, recordings: made[0])
    assert main(["report", str(made[1] / "cases"), "--out", str(tmp_path / "r")]) == 2
    assert sorted(p.name for p in (tmp_path / "r").iterdir()) == ["report.html", "report.md"]
    assert "report.html" in capsys.readouterr().out


def test_the_summary_says_a_sentence_of_a_diagnosis_once_and_whole(tmp_path: Path) -> None:
    """Of a case without a reference of its own, the answer is the first of them."""
    case = write_case(tmp_path / "cases", "plain", "A plain propeller", "")
    (case / "references.csv").unlink()
    (case / "case.toml").write_text((case / "case.toml").read_text().replace('references = "references.csv"\n', ""))
    said = [f"Part {k} is {k}.5% before and 0.5 % after, at rest as in wind." for k in range(40)]
    folder = tmp_path / "plain" / "diagnosis"
    folder.mkdir(parents=True)
    (folder / "diagnosis.json").write_text(json.dumps(DIAGNOSIS | {"explanation": " ".join(said)}))
    told = summary(attach_diagnoses(gather([case], tmp_path / "out"), tmp_path))
    (line,) = (line for line in told.splitlines() if line.startswith("Diagnosis: "))
    assert said[0] in told.partition(line)[0]
    assert max(told.count(one) for one in said) == 1 and "…" not in line and line.endswith(said[-1][-8:])
    assert 600 < len(line) < 900


# ---- the committed report -------------------------------------------------------------------------------------------


def test_committed_summary_agrees_with_the_committed_sweep(project: Path) -> None:
    page = (project / "reports" / "report.md").read_text(encoding="utf-8")
    kept = json.loads((project / "reports" / "sweep.json").read_text(encoding="utf-8"))
    for case in kept["cases"]:
        name = case["name"].replace("_", "\\_")
        cells = next(line for line in page.splitlines() if line.startswith(f"| {name} |")).split("|")
        for source, column in (("bemt", 2), ("k1k2", 4)):
            row = next(r for r in case["rows"] if r["source"] == source)
            assert float(cells[column]) == pytest.approx(row["thrust_N"], rel=1e-3), (case["name"], source)


def test_a_report_of_one_case_made_from_its_label_holds_no_word_of_the_thesis(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "10x5"]) == 0
    case = next(path.parent for path in tmp_path.rglob("case.toml"))
    about = ["--title", "Mine", "--author", "A. Body", "--date", "1 May", "--commit", "rev 7"]
    assert main(["report", str(case), "--out", "r", *about, "--quiet"]) == 0
    page = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert "<h1>Mine</h1><p>A. Body · 1 May · commit rev 7." in page
    reader = read(page)
    said = [w for tag, words in reader.words.items() if tag not in ("style", "script") for w in words]
    words = " ".join([*said, *(unquote(v or "") for _, a in reader.found for v in a.values())]).lower()
    for word in ("thesis", "cahill", "northeastern", "robot", "fluent", "own cfd", "reproduc"):
        assert word not in words, word
    front = page[page.index('id="front"') : page.index('id="case-1')]
    assert re.search(r'<figure class="plot.*?<g class="trace" data-t="0"[^>]*>.*?<path', front, re.DOTALL), (
        "the first picture stands on the front page"
    )


def test_a_report_of_own_cases_holds_no_word_of_the_thesis(made: tuple[Book, Path], text: str) -> None:
    assert "thesis" not in text.lower() and "Cahill" not in text


def test_the_head_says_whose_report_it_is(made: tuple[Book, Path]) -> None:
    page = book_html(replace(made[0], about=About("Fan <3>", "A. Body", "2026-11-22")))
    assert "<h1>Fan &lt;3&gt;</h1>" in page and "A. Body · 2026-11-22." in page
    told = summary(replace(made[0], about=About("Fan <3>", "A. Body", "2026-11-22")))
    assert told.startswith("# Fan &lt;3&gt;\n") and "A. Body · 2026-11-22." in told
    one = Book("0", (CasePage(Result("one", title="My fan")),), 0)
    assert summary(one).startswith("# My fan\n")


def test_a_table_without_a_number_is_a_sentence() -> None:
    failed = CasePage(Result("one", faults=("case.toml: got nothing",)))
    solved = CasePage(Result("two", rows=(Row("bemt", "bemt", 4.75, rpm=6000.0, airspeed_m_s=0.0, u=0.4),)))
    none, some = (Book("0", pages, 0) for pages in ((failed,), (failed, solved)))
    for page, empty in ((none, True), (some, False)):
        told, parts = summary(page), dict(front_parts(page, [f"case-{k}" for k in range(len(page.cases))]))
        assert ("|" in told) != empty and (parts["table"] is None) == empty
    assert "CFD" not in summary(some).split("##")[0], "a column that no case fills is not there"


# ---- in a browser ---------------------------------------------------------------------------------------------------

RELAY = (
    "import os, sys\nos.dup2(int(sys.argv[1]), 3)\nos.dup2(int(sys.argv[2]), 4)\nos.execvp(sys.argv[3], sys.argv[3:])"
)


class Browser:
    """Headless Chromium, driven over the pipes of its debugging protocol."""

    def __init__(self, program: str, profile: str) -> None:
        to_read, self.write = os.pipe()
        self.read, to_write = os.pipe()
        flags = [
            "--headless", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic",
            "--no-first-run", "--disable-sync", "--disable-background-networking", "--disable-component-update",
            "--disable-dev-shm-usage", "--remote-debugging-pipe", f"--user-data-dir={profile}", "about:blank",
        ]  # fmt: skip
        self.process = subprocess.Popen(
            [sys.executable, "-c", RELAY, str(to_read), str(to_write), program, *flags],
            pass_fds=(to_read, to_write),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_read)
        os.close(to_write)
        self.buffer, self.count, self.session = b"", 0, ""
        self.complaints: list[str] = []
        self.addresses: list[str] = []
        self.loaded = False
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def _event(self) -> dict[str, Any]:
        while b"\0" not in self.buffer:
            part = os.read(self.read, 1 << 20)
            assert part, "the browser has gone"
            self.buffer += part
        line, _, self.buffer = self.buffer.partition(b"\0")
        message: dict[str, Any] = json.loads(line)
        method, params = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.complaints.append(str(params["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning"):
            self.complaints.append(str(params["args"]))
        elif method == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            if "ReadPixels" in params["entry"]["text"]:  # the tests look at what WebGL drew
                return message
            self.complaints.append(params["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.addresses.append(params["request"]["url"])
        elif method == "Page.loadEventFired":
            self.loaded = True
        return message

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Send one command and wait for its answer."""
        self.count += 1
        message: dict[str, Any] = {"id": self.count, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._event()
            if answer.get("id") == self.count:
                assert "error" not in answer, answer["error"]
                return dict(answer.get("result", {}))

    def open(self, path: Path, width: int = 1280) -> None:
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=width < 600
        )
        self.loaded = False
        self.call("Page.navigate", url=path.as_uri())
        while not self.loaded:
            self._event()

    def run(self, code: str) -> Any:
        """Value of an expression on the page."""
        result = self.call("Runtime.evaluate", expression=code, returnByValue=True)
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def close(self) -> None:
        self.process.terminate()
        self.process.wait(timeout=120)
        os.close(self.read)
        os.close(self.write)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if program is None:
        pytest.skip("no chromium on this machine")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        window = Browser(program, profile)
        yield window
        window.close()


@pytest.fixture(scope="module")
def opened(browser: Browser, text: str, tmp_path_factory: pytest.TempPathFactory) -> Browser:
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(text, encoding="utf-8")
    browser.open(path)
    browser.path = path  # type: ignore[attr-defined]
    return browser


def test_it_opens_without_complaint_and_asks_for_nothing(opened: Browser) -> None:
    assert opened.complaints == []
    assert [a for a in opened.addresses if not a.startswith(("file:", "data:"))] == []
    assert opened.run("typeof window.pwned") == "undefined"
    assert opened.run("document.querySelectorAll('script').length") == 1


def test_one_page_is_shown_at_a_time(opened: Browser) -> None:
    shown = "Array.from(document.querySelectorAll('section.page')).filter(s => s.offsetHeight > 0).map(s => s.id)"
    for page in ("case-1-plain", "front"):
        opened.run(f"document.querySelector('nav a[href=\"#{page}\"]').click()")
        opened.run("new Promise(r => setTimeout(r, 50))")
        for _ in range(50):
            if opened.run(shown) == [page]:
                break
        assert opened.run(shown) == [page]
        assert opened.run("document.querySelector('nav a[aria-current]').getAttribute('href')") == f"#{page}"


def test_plots_answer_the_pointer_and_their_keys(opened: Browser) -> None:
    opened.run("location.hash = '#front'; 0")
    at = "document.querySelector('#front svg[data-at]')"
    point = (
        f"(() => {{const s = {at}, c = s.querySelector('g.trace .dot').getBoundingClientRect();"
        "const o = {clientX: c.x + c.width / 2, clientY: c.y + c.height / 2, bubbles: true};"
        "s.dispatchEvent(new PointerEvent('pointermove', o));"
        "const t = s.closest('figure').querySelector('.tip'); return [t.hidden, t.textContent];})()"
    )
    hidden, words = opened.run(point)
    assert not hidden and words.startswith("BEMT\nthrust / recorded thrust [-]: ")
    key = f"{at}.closest('figure').querySelector('.key')"
    state = f"[getComputedStyle({at}.querySelector('g.trace')).display, {key}.getAttribute('aria-pressed')]"
    assert opened.run(state) == ["inline", "true"]
    opened.run(f"{key}.click()")
    assert opened.run(state) == ["none", "false"]
    opened.run(f"{key}.click()")
    assert opened.run(state) == ["inline", "true"]


def test_the_values_of_a_plot_are_those_of_its_csv(opened: Browser, text: str) -> None:
    opened.run("location.hash = '#front'; 0")
    at = "document.querySelector('#front details.values')"
    opened.run(f"{at}.open = true; {at}.dispatchEvent(new Event('toggle')); 0")
    shown = opened.run(f"Array.from({at}.querySelectorAll('tr')).map(r => Array.from(r.cells).map(c => c.textContent))")
    assert shown == tables(text)[0]


def test_the_rotor_turns_by_keys_and_stays_still_without_webgl(opened: Browser) -> None:
    opened.run("location.hash = '#case-1-plain'; 0")
    opened.run("window.dispatchEvent(new HashChangeEvent('hashchange')); 0")
    at = "document.querySelector('#case-1-plain figure.rotor')"
    shown = f"['canvas', 'img'].filter(n => getComputedStyle({at}.querySelector(n)).display !== 'none')"
    if opened.run(f"!{at}.classList.contains('turning')"):
        assert opened.run(shown) == ["img"], "no WebGL here"
        return
    assert opened.run(shown) == ["canvas"]
    picture = (
        f"new Promise(r => {{const c = {at}.querySelector('canvas');"
        "c.dispatchEvent(new KeyboardEvent('keydown', {key: 'KEY'}));"
        "requestAnimationFrame(() => r(c.toDataURL()));})"
    )

    def after(key: str) -> str:
        code = picture.replace("KEY", key)
        done = opened.call("Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True)
        return str(done["result"]["value"])

    first = after("Home")
    assert after("ArrowRight") != first != after("+")
    assert after("Home") == first


def test_tables_sort_up_and_down_with_gaps_last(opened: Browser) -> None:
    at = "document.querySelector('#front table.sort')"
    column = f"Array.from({at}.tBodies[0].rows).map(r => r.cells[2].getAttribute('data-v'))"
    click = f"{at}.querySelectorAll('thead button')[2].click()"
    for order in (1, -1):
        opened.run(click)
        values = opened.run(column)
        assert values[-1] == "", "the case without a result"
        known = [float(v) for v in values[:-1]]
        assert len(known) == 2 and known == sorted(known, reverse=order < 0)


def test_no_column_of_the_front_page_is_cut_off_on_a_desktop(opened: Browser) -> None:
    opened.open(opened.path)  # type: ignore[attr-defined]
    opened.run("location.hash = '#front'; 0")
    box = "document.querySelector('#front table').closest('.scroll')"
    assert opened.run(f"{box}.scrollWidth - {box}.clientWidth") == 0


@pytest.mark.slow
def test_the_report_of_the_shipped_cases_prints_on_20_pages(browser: Browser, project: Path, tmp_path: Path) -> None:
    for name in ("cfd", "diagnosis"):
        shutil.copytree(project / "reports" / name, tmp_path / name)
    assert main(["report", str(project / "cases"), "--out", str(tmp_path), "--quiet"]) == 0
    assert (tmp_path / "report.html").stat().st_size < 6e6
    browser.open(tmp_path / "report.html")
    page = base64.b64decode(browser.call("Page.printToPDF", preferCSSPageSize=True)["data"])
    assert len(re.findall(rb"/Type\s*/Page\b", page)) <= 20


@pytest.mark.parametrize("width", [1280, 390])
def test_no_page_is_wider_than_the_window(opened: Browser, width: int) -> None:
    opened.open(opened.path, width)  # type: ignore[attr-defined]
    wide = (
        "Array.from(document.querySelectorAll('section.page')).map(s => {location.hash = '#' + s.id;"
        "document.querySelectorAll('section.page').forEach(p => p.classList.toggle('shown', p === s));"
        "return [s.id, document.documentElement.scrollWidth];})"
    )
    for page, size in opened.run(wide):
        assert size <= width, page
    assert opened.complaints == []


def test_runs_of_cfd_beside_a_case_stand_beside_the_model_at_their_own_speed(tmp_path: Path) -> None:
    case = write_case(tmp_path / "cases", "plain", "A plain propeller", "")
    (case / "references.csv").unlink()
    (case / "case.toml").write_text((case / "case.toml").read_text().replace('references = "references.csv"\n', ""))
    rows = "".join(f"{k},2.1\n" for k in range(99))
    (tmp_path / "cfd.csv").write_text('"Iteration","Thrust Monitor: Thrust (N)"\n' + rows)
    (tmp_path / "run.toml").write_text('[run]\nfiles = ["cfd.csv"]\nrpm = 4000.0\nairspeed_m_s = 0.0\n')
    book = gather([case], tmp_path / "out", recordings=[str(tmp_path / "run.toml")])
    at = {row.source: row.thrust_N for row in book.cases[0].result.rows if row.rpm == 4000.0}
    assert at["cfd"] == pytest.approx(2.1) and at["bemt"] > 1.0
    (line,) = (line for line in summary(book).splitlines() if line.startswith("| plain |"))
    assert "2.100" in line and "4000" in line
    assert "2.100" in book_html(book)
