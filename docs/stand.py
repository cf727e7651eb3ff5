"""Sit at the simulated stand and show it in docs/stand.md: the log of the terminal and docs/img/stand.png.

    python docs/stand.py

The fault and its size are fixed; the noise of single samples is not, so that the numbers differ a little each time.
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import bemt

DOCS = Path(__file__).resolve().parent
WIDTH = 118


def shown(line: str) -> str:
    """A line of the log, as wide as a screen."""
    return line if len(line) <= WIDTH else line[: WIDTH - 4].rpartition(" ")[0] + " ..."


def main() -> None:
    """Make picture and log."""
    with tempfile.TemporaryDirectory() as box:
        found = bemt.stand(DOCS.parent / "cases" / "prop_8x5", out=Path(box) / "sitting", yes=True, seed=3,
                           fault=["thrust_gain"])  # fmt: skip
        (DOCS / "img" / "stand.png").write_bytes((Path(box) / "sitting" / "story.png").read_bytes())
    page = DOCS / "stand.md"
    log = "\n".join(shown(line) for line in found.details.splitlines() if not line.startswith(("plan", "next")))
    text = re.sub(r"(?s)(<!-- log -->\n\n```text\n).*?(\n```)", lambda m: m[1] + log + m[2], page.read_text("utf-8"))
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
