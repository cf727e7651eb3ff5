r"""CSV of CFD-Post: blocks of ``[Name]`` and ``[Data]``, units in the headings.

::

    [Name]
    Blade

    [Data]
    X [ m ], Y [ m ], Z [ m ], Wall Shear [ Pa ]
    7.69e-02, 5.98e-02, 8.56e-02, 3.79
"""

from __future__ import annotations

import os
import re
from dataclasses import replace

from bemt.base.errors import Fault, InputError
from bemt.dataset import Dataset
from bemt.readers import SourceText, load_text
from bemt.readers._cfd import Column, ExportRow, cells_of, head_lines, numeric_table, si_unit, slug
from bemt.readers._cfd_record import fields, history
from bemt.readers._columns import Channel, channels_of, dataset
from bemt.readers._headings import may_be_shaft_speed

KIND = "cfd_post_csv"

_SECTION = re.compile(r"\[(\w[\w ]*)\]")
_HEADING = re.compile(r"(.*?)\s*\[([^\]]*)\]\s*")


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the file begins with the section Name or Data.

    >>> sniff("[Name]\nBlade\n\n[Data]\nX [ m ], Y [ m ]"), sniff("[propeller]\nname = 1")
    (True, False)
    """
    lines = [line for line in head_lines(head) if not line.startswith("#")]
    return bool(lines) and lines[0].rstrip(",;") in ("[Name]", "[Data]")


def _heading(text: str) -> Column:
    """Column of a heading: unit in the name when it is SI, else the heading as it stands."""
    match = _HEADING.fullmatch(text)
    if not match:
        return Column(text or "unnamed")
    unit = si_unit(match[2])
    if unit is None:
        return Column(text if match[2].strip() else slug(match[1]), match[2].strip())
    role = "time" if unit == "s" and slug(match[1]) in ("time", "flow_time", "physical_time") else "value"
    if unit == "rpm" and may_be_shaft_speed(match[1]):
        return Column("rpm", unit)
    return Column(f"{slug(match[1])}_{unit}", unit, role)


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a CSV of CFD-Post."""
    source = load_text(path)
    data: list[tuple[str, list[ExportRow]]] = []
    section, name = "", ""
    skipped: set[str] = set()
    mark = ","
    for line, raw in enumerate(source.lines, 1):
        text = raw.strip()
        match = _SECTION.fullmatch(text.rstrip(",;"))
        if not text or text.startswith("#"):
            continue
        if match and match[1] in ("Name", "Data", "Lines", "Faces", "Spatial Fields", "Parameters"):
            section = match[1]
            if section == "Data":
                data.append((name or "data", []))
        elif section == "Name":
            name = text.rstrip(",;")
        elif section == "Data":
            if not data[-1][1]:
                mark = ";" if ";" in text else "\t" if "\t" in text and "," not in text else ","
            data[-1][1].append(ExportRow(line, cells_of(text, mark)))
        elif section:
            skipped.add(section)
        else:
            raise InputError(Fault(source.name, str(line), repr(text[:60]), "[Name] or [Data]", "Is the head cut?"))
    if not any(rows for _, rows in data):
        raise InputError(Fault(source.name, "", "no data", "a section [Data] with headings and rows"))
    notes = [f"section {', '.join(sorted(skipped))} not read"] if skipped else []
    records = [(block, _block(source, rows, mark != ",")) for block, rows in data if rows]
    if len(records) == 1:
        block, record = records[0]
        return replace(record, provenance={**record.provenance, "name": block}, notes=(*notes, *record.notes))
    channels: dict[str, Channel] = {}
    for k, (block, record) in enumerate(records):
        label = block if [b for b, _ in records].count(block) == 1 else f"{block} {k + 1}"
        channels |= {f"{key}({label})": channel for key, channel in channels_of(record).items()}
        notes += [f"{label}: {text}" for text in record.notes]
    about = {"file": source.name, "sha256": source.sha256, "clock": "none"}
    return dataset(KIND, "cfd", channels, notes, about)


def _block(source: SourceText, rows: list[ExportRow], commas: bool) -> Dataset:
    columns = [_heading(cell) for cell in rows[0].cells]
    if all(re.fullmatch(r"[-+.\deE]+", cell) for cell in rows[0].cells):
        got = f"numbers ({', '.join(rows[0].cells[:4])})"
        raise InputError(Fault(source.name, str(rows[0].line), got, "headings such as X [ m ]", "Is the head cut?"))
    body = [row for row in rows[1:] if row.cells != rows[0].cells]
    table = numeric_table(source, columns, body, commas=commas)
    notes = [f"headings repeated {len(rows) - 1 - len(body)} times"] if len(body) < len(rows) - 1 else []
    bare = [c.name for c in columns if not c.unit]
    if bare:
        notes.append(f"no unit stated for {', '.join(bare[:6])}")
    build = history if columns[0].role == "time" else fields
    return build(KIND, source, columns, table, notes)
