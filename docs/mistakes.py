"""Write docs/mistakes.md: what is answered to each mistake of ``tests/test_mistakes.py``.

Run by hand: ``.venv/bin/python docs/mistakes.py``.
"""

from __future__ import annotations

import io
import os
import re
import shutil
import sys
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))

HEAD = """# Mistakes, and what is answered

Each row is run by the tests in an empty folder with one sound case, `mine`. Exit code 0: the file is read, and what
looks wrong in it is said. Written by `python docs/mistakes.py`; do not edit.

| mistake | typed | exit code | answer |
|---|---|---|---|
"""


TAIL = """
Not mistakes of typing, each with a test of its own or measured:

| what happens | exit code | answer |
|---|---|---|
| Ctrl-C | 130 | `interrupted`; a sweep goes on where it stopped |
| the cache cannot be written | 0 | the answer comes, it is only not kept |
| a folder that may not be written | 2 | the folder, and what the system says of it |
| two million rows | 0 | `import` in 5 s and 0.4 GB ([how cost grows](scaling.md)) |
"""


def put(name: str, text: str) -> str:
    """Write a file."""
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return name


def answer(name: str) -> str:
    """One row of the table."""
    from test_mistakes import RUNS

    from bemt.commands.cli import main

    make, _, words = RUNS[name]
    typed = make(put)
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            code = main(typed)
        except SystemExit as stopped:
            code = int(stopped.code or 0)
    lines = [line.strip() for line in (err.getvalue() + out.getvalue()).splitlines() if line.strip()]
    said = max(lines, key=lambda line: (sum(word in line for word in words), -len(line)))
    if all(word in said or not said for word in words):
        shown = said
    else:  # the answer runs over several lines
        hits = [i for i, line in enumerate(lines) if any(word in line for word in words)]
        shown = " ".join(lines[i] for i in hits[:3])
    shown = re.sub(r"(expected one of (?:[\w./-]+, ){3})(?:[\w./-]+, )+[\w./-]+", r"\1...", shown)
    command = " ".join(f'"{word}"' if " " in word else word for word in typed)
    return f"| {name} | `bemt {command}` | {code} | {shown.replace('|', '/')} |"


def main() -> None:
    """Run every mistake in a folder of its own."""
    from test_mistakes import RUNS

    rows = []
    for name in RUNS:
        with tempfile.TemporaryDirectory() as folder:
            shutil.copytree(ROOT / "cases" / "prop_8x5", Path(folder) / "mine")
            os.chdir(folder)
            if name == "validate without data":
                os.environ["BEMT_DATA"] = os.environ["BEMT_CACHE"] = str(Path(folder) / "none")
            rows.append(answer(name))
            os.chdir(ROOT)
    (ROOT / "docs" / "mistakes.md").write_text(HEAD + "\n".join(rows) + "\n" + TAIL, encoding="utf-8")


if __name__ == "__main__":
    main()
