"""Draw docs/img/wings.svg and rewrite the table of docs/structure.md from the code: ``.venv/bin/python docs/wings.py``.

A wing is a folder of ``bemt`` (the tools each their own) or ``geometry``; what it is for is the first line of its
docstring; a line leads to each wing that it imports, with the number of its files that do. The lines stand in the
picture as text too, so that a test can tell when it is out of date.
"""

from __future__ import annotations

import ast
import json
import re
from collections import Counter
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import FancyBboxPatch

ROOT = Path(__file__).resolve().parents[1]
PICTURE, PAGE = ROOT / "docs" / "img" / "wings.svg", ROOT / "docs" / "structure.md"
ORDER = ("app", "tools", "results", "judge", "rotors", "data", "physics", "base", "geometry")
"""From the doors down to the ground floor; geometry knows none of them."""
COLOURS = dict(
    zip(
        ORDER,
        ("#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#0072B2", "#D55E00", "#7A6A00", "#666666", "#333333"),
        strict=True,
    )
)
"""After Okabe and Ito (2008), darkened where they are thin on white."""


def wing(module: str) -> str:
    """Wing of a module; empty for those that belong to none."""
    parts = module.split(".")
    name = parts[0] if parts[0] == "geometry" else parts[1] if len(parts) > 1 else ""
    return name if name in ORDER else ""


def imports(path: Path) -> set[str]:
    """Modules of this project that a file imports, but for the type checker only."""
    found: set[str] = set()
    tree = ast.parse(path.read_text(encoding="utf-8"))
    typed = {id(n) for i in ast.walk(tree) if isinstance(i, ast.If) and "TYPE_CHECKING" in ast.unparse(i.test)
             for b in i.body for n in ast.walk(b)}  # fmt: skip
    for node in ast.walk(tree):
        if isinstance(node, ast.Import) and id(node) not in typed:
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and id(node) not in typed and node.module:
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in found if wing(name)}


def files(name: str) -> list[Path]:
    """Files of a wing."""
    return sorted((ROOT / name if name == "geometry" else ROOT / "bemt" / name).rglob("*.py"))


def arrows() -> Counter[tuple[str, str]]:
    """Number of files of one wing that import another."""
    found: Counter[tuple[str, str]] = Counter()
    for name in ORDER:
        for path in files(name):
            found.update((name, other) for other in {wing(m) for m in imports(path)} - {name})
    return found


def lines(name: str) -> int:
    """Lines of a wing."""
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files(name))


def purpose(folder: Path) -> str:
    """First paragraph of the docstring of a package, on one line."""
    text = ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8"))) or ""
    return " ".join(text.partition("\n\n")[0].split()).rstrip(".")


def draw(found: Counter[tuple[str, str]]) -> None:
    """The picture: wings from the doors down, one lane for the imports of each."""
    plt.rcParams |= {"svg.fonttype": "none", "svg.hashsalt": "wings", "font.family": "sans-serif"}
    fig, ax = plt.subplots(figsize=(9.5, 8.2))
    tools = sorted(path.name for path in (ROOT / "bemt" / "tools").iterdir() if (path / "__init__.py").is_file())
    inner = {"tools": tools, "physics": ["dataset", "sections", "effects", "bem"], "data": ["readers", "recordings"],
             "judge": ["compare", "diagnose", "proof"], "results": ["sweep", "report"]}  # fmt: skip
    width, y = 5.2, {name: -1.25 * i for i, name in enumerate(ORDER)}
    for name in ORDER:
        ax.add_patch(FancyBboxPatch((0, y[name] - 0.38), width, 0.76, "round,pad=0.02,rounding_size=0.08",
                                    facecolor="white", edgecolor=COLOURS[name], linewidth=2))  # fmt: skip
        ax.text(0.12, y[name] + 0.13, f"{name}/", weight="bold", size=13, va="center", color=COLOURS[name])
        ax.text(
            width - 0.12, y[name] + 0.13, f"{lines(name):,} lines", size=10, va="center", ha="right", color="#333333"
        )
        more = "  ".join(inner.get(name, ())) or {
            "app": "command line and library", "rotors": "cases, bands, K1/K2", "base": "knows no rotor",
            "geometry": "shapes and solids; knows no aerodynamics"}[name]  # fmt: skip
        ax.text(0.12, y[name] - 0.2, more, size=10, va="center", color="#333333")
    for i, name in enumerate(ORDER):
        lane, below = width + 0.55 * (len(ORDER) - i), [other for other in ORDER if (name, other) in found]
        if below:
            ax.plot(
                [width, lane, lane],
                [y[name] + 0.2, y[name] + 0.2, y[below[-1]]],
                color=COLOURS[name],
                linewidth=1.8,
                zorder=1,
            )
        for other in below:
            ax.annotate("", (width + 0.05, y[other]), (lane, y[other]), zorder=0,
                        arrowprops={"arrowstyle": "-|>", "color": "#BBBBBB", "shrinkA": 0, "shrinkB": 0})  # fmt: skip
            ax.text(lane, y[other], str(found[name, other]), size=9, ha="center", va="center", color="white",
                    bbox={"boxstyle": "circle,pad=0.25", "facecolor": COLOURS[name], "edgecolor": "white"})  # fmt: skip
    ax.set_xlim(-0.1, width + 0.55 * len(ORDER) + 0.3)
    ax.set_ylim(y["geometry"] - 1.3, 0.5)
    ax.axis("off")
    words = "A line goes down from the wing that imports, in its colour;"
    words += "\nthe number in a row: so many of its files import that wing."
    ax.text(width + 0.55 * len(ORDER) + 0.2, y["geometry"] - 0.7, words, size=9, ha="right", va="top", color="#333333")
    note = json.dumps(sorted(f"{a} > {b}" for a, b in found))
    fig.savefig(PICTURE, bbox_inches="tight", metadata={"Date": None, "Description": note})
    plt.close(fig)


def table() -> str:
    """Table of the page."""
    folders = {name: ROOT / name if name == "geometry" else ROOT / "bemt" / name for name in ORDER}
    rows = [f"| `{name}/` | {purpose(folder)} |" for name, folder in folders.items()]
    return "\n".join(["| wing | what it is for |", "|---|---|", *rows]) + "\n"


def main() -> None:
    """Rewrite picture and table."""
    draw(arrows())
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(re.sub(r"\| wing \|.*\n(\|.*\n)*", lambda _: table(), text), encoding="utf-8")


if __name__ == "__main__":
    main()
