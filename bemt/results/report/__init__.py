"""The validation report as one self-contained HTML file and a summary.

What the pages show is gathered, typed (:mod:`bemt.results.report.book`), then written; no value of a file
reaches a page unescaped, no file outside of DIR is written, and the HTML lets no script run but its own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from bemt.base.errors import Fault, InputError

if TYPE_CHECKING:
    from bemt.results.report.book import Book, Page, Part

__all__ = ["HTML_NAME", "MARKDOWN_NAME", "book_html", "write"]

HTML_NAME, MARKDOWN_NAME = "report.html", "report.md"


def _pages(book: Book) -> Iterator[Page]:
    """Pages in the order of the menu."""
    from bemt.results.report.book import Page, sections
    from bemt.results.report.case_page import case_sections, opening
    from bemt.results.report.diagnosis_block import diagnosis_parts, headline, page_verdict
    from bemt.results.report.front import answers, front_parts

    names = [page.result.name for page in book.cases]
    ids = [f"case-{i + 1}-" + re.sub(r"[^A-Za-z0-9_-]+", "-", name)[:60] for i, name in enumerate(names)]
    first: list[Part] = [("figures", opening(book.cases[0]))] if len(book.cases) == 1 else []
    yield Page("front", "Answers", "Answers", [*first, *front_parts(book, ids)], [], answers(book, ids))
    for case, name, key in zip(book.cases, names, ids, strict=True):
        said = "verdict", page_verdict(case)
        yield Page(key, name[:40], headline(case.result), [said], case_sections(case))
    told = sections(*((item.name, diagnosis_parts(item)) for item in book.diagnoses))
    yield from (p for p in (*book.tools, Page("diagnoses", "Diagnoses", "Diagnoses", [], told)) if p.sections)


def book_html(book: Book) -> str:
    """Write the HTML of a report."""
    from bemt.base.page import render
    from bemt.results.report.front import heading

    title, made = heading(book)
    lead = "Propellers and ducted fans: blade element momentum theory, the K1/K2 formula, CFD, bench and vendor data."
    if not any(case.result.no_check for case in book.cases):
        lead += " Nothing here is fitted to the value it is compared with."
    foot = (
        f"Made by bemt {book.version}. Thrust in newtons, CT = T/(ρ n² D⁴), CP = P/(ρ n³ D⁵). "
        "Colours after Okabe and Ito. This file loads nothing from the network."
    )
    return render(
        "bemt.results.report", "report.html", ["page.js", "plot.js", "rotor.js"], pages=list(_pages(book)), foot=foot,
        title=title, lead=f"{made}. {lead}" if made else lead,
    )  # fmt: skip


def write(
    paths: Sequence[str | Path], out: str | Path, progress: Callable[[str], None],
    about: Mapping[str, str] | None = None, recordings: Sequence[str] = (), references: Sequence[str] = (),
) -> tuple[Book, tuple[Path, Path]]:  # fmt: skip
    """Sweep the cases into a folder and write the report beside; returns what it shows, and its two files.

    ``about`` holds title, author, date and revision for the head of the page, each as far as wanted.
    ``recordings`` are runs of the one case: they are diagnosed first, beside ``references``, and stand on its page.
    """
    from bemt.base.tables import write_atomic
    from bemt.results.report.book import About
    from bemt.results.report.front import summary
    from bemt.results.report.gather import gather

    folder = Path(out)
    if references and not recordings:
        raise InputError(Fault("--reference", "", "no recording", "one to set beside it, --recording"))
    if recordings:
        from bemt.results.report.gather import diagnose_into

        diagnose_into(paths, recordings, folder, progress, references)
    book = replace(gather(paths, folder, progress, recordings), about=About.from_document(about or {}))
    files = folder / HTML_NAME, folder / MARKDOWN_NAME
    try:
        write_atomic(files[0], book_html(book))
        write_atomic(files[1], summary(book))
    except OSError as error:
        raise InputError(Fault(str(out), "", error.strerror or "no file", "a folder that can be written")) from error
    return book, files
