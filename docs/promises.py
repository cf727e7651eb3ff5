"""Write docs/promises.md: ``.venv/bin/python docs/promises.py``. From a promise to the test that holds it."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs"))
import figures  # noqa: E402

HEAD = """# Promises and their tests

*Made by `docs/promises.py`.* A promise that breaks fails its test.

## Figures

The report that holds each figure of the README and of [what to believe](believe.md), the first of each quoted;
[`tests/test_figures.py`](../tests/test_figures.py) compares them all.

"""


def promise(file: Path) -> str:
    """First clause of a module's docstring, without the words that all of them have and without its subject."""
    text = " ".join((ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").split("\n\n")[0].split())
    said = re.sub(r"^(?:The )?[Pp]romises?(?:: | that | behind | of [^:]*: | to [^:]*: )", "", text)
    subject = re.match(r"([A-Z]\w{2,})s?: ", said)
    if subject and file.stem.removeprefix("test_").startswith(subject[1][:5].lower()):
        said = said[subject.end() :]
    said = re.split(r"; |\. ", said)[0].rstrip(".") + "."
    return said[:1].upper() + said[1:]


def short(text: str) -> str:
    """Beginning of a figure's sentence, up to a number at least."""
    words = text.split()
    n = max(6, next((k + 2 for k, word in enumerate(words) if word[:1].isdigit()), len(words)))
    return f'"{" ".join(words[:n])}{" …" if n < len(words) else ""}"'


def made() -> str:
    """The page."""
    held: dict[str, list[str]] = {}
    for figure in figures.FIGURES:
        text = figure.sentence
        for number in figure.stated():
            text = text.replace("#", number, 1)
        held.setdefault(figure.report, []).append(text)
    rows = []
    for report, said in held.items():
        more = f" and {len(said) - 1} more" if len(said) > 1 else ""
        rows.append(f"* [{report.removeprefix('reports/')}](../{report}): {short(said[0])}{more}\n")
    tests = []
    for file in sorted((ROOT / "tests").glob("test_*.py")):
        tests.append(f"* [{file.stem.removeprefix('test_')}](../tests/{file.name}): {promise(file)}\n")
    return HEAD + "".join(rows) + "\n## Behaviour\n\n" + "".join(tests)


if __name__ == "__main__":
    (ROOT / "docs" / "promises.md").write_text(made(), encoding="utf-8")
