"""The promise of the notebooks: run again they say what they were committed with."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
BOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
TEMPORARY = re.compile(r"/\S*/tmp\w+/")


def said(cell: Any) -> tuple[list[str], list[float], int]:
    """Words, numbers and number of pictures of the outputs of a cell."""
    text, pictures = "", 0
    for output in cell.get("outputs", ()):
        data = output.get("data", {})
        pictures += "image/png" in data
        if "image/png" not in data:
            text += "".join(output.get("text", data.get("text/html", data.get("text/plain", "")))) + "\n"
    text = TEMPORARY.sub("", text)
    return NUMBER.sub("#", text).split(), [float(x) for x in NUMBER.findall(text)], pictures


@pytest.mark.parametrize("book", BOOKS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the kernel's own libraries
def test_a_notebook_says_what_it_was_committed_with(book: Path) -> None:
    """Rewritten by ``python docs/make.py --notebooks`` when the solver moves."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    committed, again = nbformat.read(book, 4), nbformat.read(book, 4)
    client = nbclient.NotebookClient(again, timeout=300, resources={"metadata": {"path": str(book.parent)}})
    client.execute(
        env={**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "module://matplotlib_inline.backend_inline"}
    )
    for before, after in zip(committed.cells, again.cells, strict=True):
        words, numbers, pictures = said(before)
        words_now, numbers_now, pictures_now = said(after)
        assert (words_now, pictures_now) == (words, pictures), before["source"]
        assert numbers_now == pytest.approx(numbers, rel=0.05, abs=0.02), before["source"]


def test_notebooks_are_committed_with_their_outputs() -> None:
    nbformat = pytest.importorskip("nbformat")
    assert len(BOOKS) >= 2
    for book in BOOKS:
        cells = [cell for cell in nbformat.read(book, 4).cells if cell["cell_type"] == "code"]
        assert sum(bool(cell["outputs"]) for cell in cells) > len(cells) / 2, book.name
        assert not any(o["output_type"] == "error" for cell in cells for o in cell["outputs"]), book.name
