"""Hook of mkdocs.yml: pages that are made (README, reports, API, commands, notebooks), their links, the navigation.

The markdown files of the tree stay the source. A link that leaves ``docs/`` brings its target along.
"""

from __future__ import annotations

import argparse
import base64
import html
import json
import os
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
LINK = re.compile(r"(?<=\]\()([^)\s#]+)(#[^)\s]*)?(?=\))")
PLACES = {"README.md": "index.md"}  # other files keep their path; those of docs/ are at the top


def actions() -> tuple[str, ...]:
    """Dotted names of all actions."""
    from bemt.app import registry

    return tuple(where.replace(":", ".") for where in registry.homes().values())


API = {  # page: title, introduction, names
    "api_propeller.md": ("Propellers", "`import bemt` loads nothing else until it is used.", (
        "bemt.rotors.propeller.propeller", "bemt.rotors.propeller.load", "bemt.rotors.propeller.Propeller")),
    "api_answers.md": ("Questions", "Each is `bemt.read`, `bemt.diagnose` and so on, and a command of that name.", (
        "bemt.data.actions.read", *actions(), "bemt.judge.diagnose.ask.Answer",
        "bemt.judge.diagnose.rotor_calibration.CalibratedRotor", "bemt.judge.diagnose.contrast.Contrast",
        "bemt.tools.drive.drive_result.DriveResult", "bemt.tools.drive.drive_result.DriveBand",
        "bemt.tools.design.blade_design.Design", "bemt.rotors.case.sources.Source")),
    "api_dataset.md": ("Dataset", "What every source gives and every question takes.", (
        "bemt.physics.dataset.points", "bemt.physics.dataset.make", "bemt.base.errors.InputError",
        "bemt.base.errors.Fault")),
    "api_contracts.md": ("Plug-in contracts", "One file each, found by scanning; [examples](adding.md).", (
        "bemt.physics.effects.base", "bemt.data.readers", "bemt.tools.exports.base", "bemt.base.action")),
}  # fmt: skip
PARTS = {  # navigation; a name ending in * stands for all pages of that name
    "Start": ("index.md", "quickstart.md", "people.md", "gallery.md"),
    "How to": (
        "choose.md",
        "design.md",
        "notebooks/*",
        "flight_logs.md",
        "stand.md",
        "exports.md",
        "adding.md",
        "scaling.md",
    ),
    "Python": tuple(API),
    "Commands and files": ("command_line.md", "commands.md", "reference_*", "mistakes.md", "nomenclature.md"),
    "Theory": (
        "believe.md",
        "promises.md",
        "theory.md",
        "oblique.md",
        "duct.md",
        "coaxial.md",
        "effects.md",
        "diagnosis.md",
    ),
    "Project": (
        "structure.md",
        "reports/README.md",
        "reports/report.md",
        "CONTRIBUTING.md",
        "RELEASING.md",
        "CHANGELOG.md",
    ),
}


def place(path: Path) -> str:
    """Address of a file of the tree within the site."""
    name = path.relative_to(ROOT).as_posix().replace(".ipynb", ".md")
    return PLACES.get(name, name.removeprefix("docs/"))


def linked(path: Path, found: dict[str, Path]) -> None:
    """Collect a page and every file that it links to, at whatever depth."""
    if path.suffix != ".ipynb":
        found[place(path)] = path
    if path.suffix not in (".md", ".ipynb"):
        return
    for target, _ in LINK.findall(path.read_text(encoding="utf-8")):
        there = Path(os.path.normpath(path.parent / target))
        if "://" in target or there.suffix == ".ipynb" or place(there) in found:
            continue
        if there.is_file() and there.is_relative_to(ROOT):
            linked(there, found)


def relinked(text: str, source: Path) -> str:
    """Text of a page with its links turned to where the files are in the site; a link to a folder is text."""
    here = os.path.dirname(place(source))

    def turn(match: re.Match[str]) -> str:
        there = Path(os.path.normpath(source.parent / match[1]))
        if "://" in match[1] or not there.is_relative_to(ROOT):
            return match[0]
        return os.path.relpath(place(there), here or ".") + (match[2] or "")

    text = re.sub(r"\[([^\]]+)\]\(([^)\s]+)/\)", r"`\2`", text)
    return LINK.sub(turn, text)


def commands() -> str:
    """Page of all commands, from their declarations."""
    from bemt.app import registry
    from bemt.app.face import described, parser_of
    from bemt.base.action import about

    groups: dict[str, list[str]] = {}
    for name in sorted(registry.homes()):
        function = registry.find(name)
        told, prog = about(function), "bemt" if name in registry.ORDER else "bemt lab"
        rows = [f"## {name}", "", described(function)[0], "", "```sh", f"{prog} {told.example}", "```", ""]
        table = [row for action in parser_of(function, everything=True)._actions if (row := option(action))]
        groups.setdefault(told.group, []).extend([*rows, "| argument | does |", "|---|---|", *table, ""])
    lines = ["# Commands", "", "`bemt COMMAND`, or `python -m bemt COMMAND`. Exit codes: 0 fine, 1 out of tolerance or "
             "unconverged, 2 usage or input, 3 internal. The library has each of them, with the same words.",
             ""]  # fmt: skip
    for title, rows in groups.items():
        lines += [f"**{title}**: " + ", ".join(f"[{r[3:]}](#{r[3:]})" for r in rows if r.startswith("## ")), ""]
    return "\n".join([*lines, *(row for rows in groups.values() for row in rows)])


def option(action: argparse.Action) -> str:
    """One row of the table of a command; nothing for ``--help``."""
    if isinstance(action, argparse._HelpAction):
        return ""
    value = action.metavar or ("{" + ",".join(map(str, action.choices)) + "}" if action.choices else "")
    if action.nargs == 0:
        value = ""
    elif not value:
        value = action.dest.upper()
    value = " ".join(value) if isinstance(value, tuple) else value
    names = " ".join(filter(None, (", ".join(action.option_strings), value)))
    text = (action.help or "").replace("%%", "%").replace("%(default)s", str(action.default))
    return f"| `{names.replace('|', chr(92) + '|')}` | {html.escape(text, quote=False).replace('|', chr(92) + '|')} |"


def notebook(path: Path) -> tuple[str, dict[str, bytes]]:
    """A notebook as markdown, and its pictures by name."""
    lines: list[str] = []
    pictures: dict[str, bytes] = {}
    for k, cell in enumerate(json.loads(path.read_text(encoding="utf-8"))["cells"]):
        body = "".join(cell["source"])
        lines += [body, ""] if cell["cell_type"] == "markdown" else ["```python", body, "```", ""]
        for j, output in enumerate(cell.get("outputs", ())):
            data = output.get("data", {})
            shown = html.escape("".join(output.get("text", data.get("text/plain", ""))))
            inner = f"<pre>{shown}</pre>"
            if "image/png" in data:
                name = f"{path.stem}_{k}_{j}.png"
                pictures[name] = base64.b64decode("".join(data["image/png"]))
                inner = f'<img alt="figure of the cell above" src="{name}">'
            elif "text/html" in data:
                inner = "".join(data["text/html"])
            inner = re.sub(r"\n\s*\n", "\n&#8203;\n", inner)  # an empty line would end the block for markdown
            lines += [f'<div class="output">{inner}</div>', ""]
    return "\n".join(lines), pictures


def on_files(files: Any, config: Any) -> Any:
    """Add what is not a file of docs/, and what is made."""
    found: dict[str, Path] = {}
    top = [ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "RELEASING.md")]
    for page in (*DOCS.glob("*.md"), *DOCS.glob("notebooks/*.ipynb"), *top):
        if page.exists():
            linked(page, found)
    made: dict[str, str | bytes] = {"commands.md": commands()}
    for name, (title, text, names) in API.items():
        whole = "\n    options:\n      show_root_full_path: true" if name == "api_contracts.md" else ""
        made[name] = "\n\n".join([f"# {title}", text, *(f"::: {n}{whole}" for n in names)])
    for book in sorted((DOCS / "notebooks").glob("*.ipynb")):
        text, pictures = notebook(book)
        text = relinked(text, book)
        made[f"notebooks/{book.stem}.md"] = text
        made |= {f"notebooks/{name}": raw for name, raw in pictures.items()}
    for name, path in found.items():
        if files.get_file_from_path(name) is None:
            raw = path.read_bytes()
            made[name] = relinked(raw.decode("utf-8"), path) if path.suffix == ".md" else raw
    for name, content in made.items():
        files.append(File.generated(config, name, content=content))
    config["nav"] = navigation([file.src_uri for file in files.documentation_pages()])
    return files


def navigation(pages: list[str]) -> list[Any]:
    """The parts of the site, with those of their pages that exist."""
    nav: list[Any] = []
    left = {name for name in pages if "/" not in name}
    for title, names in PARTS.items():
        chosen: list[str] = []
        for name in names:
            chosen += sorted(p for p in pages if p.startswith(name[:-1])) if name.endswith("*") else [name]
        known = [{"Overview": name} if name == "index.md" else name for name in chosen if name in pages]
        nav.append({title: known})
        left -= set(chosen)
    return [*nav, *([{"More": sorted(left)}] if left else [])]


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Turn the links of the files of docs/; the made ones have it behind them."""
    path = DOCS / page.file.src_uri
    return relinked(markdown, path) if path.is_file() else markdown


def on_page_content(content: str, **_: Any) -> str:
    """Show the roles of docstrings as code."""
    return re.sub(r":(?:class|func|meth|data|attr|mod):<code>~?([\w.]+)</code>", r"<code>\1</code>", content)


def on_post_page(output: str, **_: Any) -> str:
    """Name the search for screen readers; what scrolls can be reached by keyboard."""
    dialog = 'data-md-component="search" role="dialog"'
    output = output.replace(dialog, f'{dialog} aria-label="Search"')
    return output.replace('<div style="overflow-x:auto">', '<div style="overflow-x:auto" tabindex="0">')
