"""A blade from the file of another program: stations, sections of few numbers, an operating point; and as a case."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.base.tables import number_of
from bemt.data.readers import Reader, SourceText, begins, head_text, load_text, number
from bemt.physics.sections.parametric import QpropSection, XrotorSection
from bemt.physics.sections.polars import DEFAULT_RE, Polar

SPAN_DEG = (-20.0, 25.0)
"""Angles of the written tables; beyond them flat-plate laws continue."""
RE_RANGE = (5e3, 3e6)


@dataclass(frozen=True, eq=False)
class BladeFile:
    """One rotor of a file."""

    # Title in the file; program
    name: str
    source: str
    blades: int  # Number
    # Tip and hub radius [m]
    R_m: float
    Rhub_m: float
    # (N,) stations [m], [rad]
    r_m: Array
    chord_m: Array
    beta_rad: Array
    # At r/R, ascending; linear between, held outside
    sections: Sequence[tuple[float, XrotorSection | QpropSection | Polar]]
    # Operating point, where the file states one
    rpm: float | None = None
    airspeed_m_s: float | None = None
    rho: float | None = None
    notes: tuple[str, ...] = ()  # What was left out
    duct: Mapping[str, float] | None = None  # Keys of a case's ``[duct]``; None: an open rotor


class Cursor(SourceText):
    """Lines of numbers of a blade file, taken one after the other; faults are gathered.

    Lines are neither blank nor begin with one of the characters of `comment`.
    """

    def __init__(self, file: str | os.PathLike[str] | SourceText, comment: str) -> None:
        source = file if isinstance(file, SourceText) else load_text(file)
        super().__init__(source.name, source.text, source.sha256)
        self.rows = [(i, t) for i, t in enumerate(self.lines, 1) if t.strip() and t.lstrip()[0] not in comment]
        self.at = 0

    def take(self, count: int, what: str, most: int | None = None) -> list[float]:
        """Numbers of the next line in list-directed form (blanks or commas); NaN and a fault for what is none."""
        if self.at >= len(self.rows):
            self.refuse(len(self.lines), "the end of the file", what)
        line, text = self.rows[self.at]
        self.at += 1
        words = [w for w in re.split(r"[\s,]+", text.split("!")[0].strip()) if w]
        out: list[float] = []
        for k, word in enumerate(words[: most or count]):
            value = number(word)
            if value is None:
                self.add(f"{line}:{k + 1}", repr(word[:30]), f"a number for {what}")
            out.append(math.nan if value is None else value)
        if len(out) < count:
            self.add(line, f"{len(out)} numbers", f"{count} for {what}")
            out += [math.nan] * (count - len(out))
        return out

    def table(self, rows: int, columns: int, what: str) -> Array:
        """The next rows, fewer at the end of the file, (n, columns)."""
        n = min(rows, len(self.rows) - self.at)
        return np.array([self.take(columns, what) for _ in range(max(n, 0))]).reshape(-1, columns)

    def finish(self, blade: BladeFile) -> BladeFile:
        """The blade, if its numbers can be one; lengths in other units are refused, not converted."""
        r, c, b = blade.r_m, blade.chord_m, np.degrees(blade.beta_rad)
        steepest = np.abs(b).max() if b.size else 0.0
        if not 1 <= blade.blades <= 64:
            self.add("blades", f"{blade.blades}", "1 to 64")
        if not 0.002 <= blade.R_m <= 50.0:
            self.add("radius", f"{blade.R_m:g} m", "0.002 to 50 m", "Other units?")
        if r.size < 2 or np.any(np.diff(r) <= 0.0):
            self.add("stations", f"{r.size} radii that do not rise", "two or more rising radii")
        elif r[-1] > blade.R_m * (1.0 + 1e-6):
            self.add("stations", f"a radius of {r[-1]:g} m", f"radii up to R = {blade.R_m:g} m")
        if np.any(c <= 0.0) or np.any(c > 2.0 * blade.R_m):
            self.add("stations", f"chords from {np.min(c):g} to {np.max(c):g} m", "chords above 0, below the diameter")
        if np.any(np.abs(b) > 90.0):
            self.add("stations", f"blade angles up to {steepest:g}", "within 90 degrees")
        elif np.all(np.abs(b) < 1.6) and np.any(b != 0.0):
            self.add("stations", f"blade angles up to {steepest:g}", "degrees", "Radians? They are not converted")
        self.check()
        return blade


def as_count(value: float) -> int:
    """A count; 0 for what is none (its fault is told already)."""
    return int(value) if value == value and 0.0 <= value <= 1e4 else 0


def _polar_csv(section: XrotorSection | QpropSection | Polar) -> str:
    if isinstance(section, Polar):
        rows = [
            f"{math.degrees(a):.9g},{section.cl[i, j, 0]:.9g},{section.cd[i, j, 0]:.9g},{Re:.9g}"
            for j, Re in enumerate(section.Re)
            for i, a in enumerate(section.alpha)
        ]
        return "\n".join(["alpha_deg,cl,cd,Re", *rows]) + "\n"
    alpha = np.arange(SPAN_DEG[0], SPAN_DEG[1] + 0.25, 0.5)
    Re = DEFAULT_RE[(DEFAULT_RE >= RE_RANGE[0]) & (DEFAULT_RE <= RE_RANGE[1])]
    Re = Re if section.reexp != 0.0 else Re[:1]
    lines = ["alpha_deg,cl,cd,Re"]
    for one in Re:
        cl, cd = section.cl_cd(np.radians(alpha), one)
        lines += [f"{a:.1f},{x:.12g},{max(y, 1e-6):.12g},{one:.12g}" for a, x, y in zip(alpha, cl, cd, strict=True)]
    return "\n".join(lines) + "\n"


def case_text(blade: BladeFile, name: str, file: str) -> dict[str, str]:
    """The blade as a case: ``case.toml``, ``stations.csv`` and a table per section."""
    rows = [
        f"{a:.12g},{b:.12g},{c:.12g}"
        for a, b, c in zip(blade.r_m / blade.R_m, blade.chord_m / blade.R_m, np.degrees(blade.beta_rad), strict=True)
    ]
    files = {"stations.csv": "r_over_R,chord_over_R,beta_deg\n" + "\n".join(rows) + "\n"}
    tables = []
    for k, (x, section) in enumerate(blade.sections):
        files[f"section_{k}.csv"] = _polar_csv(section)
        tables.append(f'[[polars]]\nfile = "section_{k}.csv"\nr_over_R = {x:.12g}\nformat = "csv"\n')
    title = re.sub(r'["\\\x00-\x1f]', " ", blade.name).strip() or name
    rpm = blade.rpm if blade.rpm is not None else float(f"{120.0 / blade.R_m * 30 / math.pi:.2g}")
    remark = "" if blade.rpm is not None else "  # not in the file: a tip speed near 120 m/s, set yours"
    rho = blade.rho if blade.rho is not None and blade.rho > 0.0 else 1.225
    notes = "".join(f"# {note}\n" for note in blade.notes)
    walls = "".join(f"{key} = {value:.9g}\n" for key, value in (blade.duct or {}).items())
    walls = f"\n[duct]\n{walls}" if walls else ""
    files["case.toml"] = f"""# From {blade.source}, {re.sub(r"[^ -~]", "_", file)}.
{notes}schema = "bemt.case/1"
name = "{name}"
title = "{title}"

[rotor]
kind = "{"propeller" if blade.duct is None else "fan"}"
blades = {blade.blades}
diameter_m = {2.0 * blade.R_m:.12g}
hub_diameter_mm = {2e3 * blade.Rhub_m:.12g}

[blade]
stations = "stations.csv"

[blade.section]
thickness = 0.12  # not in the file; only wave drag looks at it
{walls}
[operating]
rpm = {rpm:.12g}{remark}
airspeed_m_s = {blade.airspeed_m_s or 0.0:.12g}

[air]
density_kg_m3 = {rho:.9g}

{chr(10).join(tables)}"""
    return files


# XROTOR: saved rotors of version 6.9 and later.

XROTOR = "xrotor"
sniff_xrotor = begins(r"\s*XROTOR\s+VERSION")
_SECTION = (
    (1, "r/R of a section"), (4, "A0deg dCLdA CLmax CLmin"), (4, "dCLdAstall dCLstall Cmconst Mcrit"),
    (3, "CDmin CLCDmin dCDdCL^2"), (2, "REref REexp"),
)  # fmt: skip


def read_section(rows: Cursor) -> tuple[float, XrotorSection]:
    """Five lines of a section, of XROTOR and of DFDC: r/R, lift, stall, drag, Reynolds number."""
    line = rows.rows[min(rows.at, len(rows.rows) - 1)][0]
    (x,), (a0, slope, top, bottom), (stall, span, cm, mcrit), (least, middle, bend), (reref, reexp) = (
        rows.take(*what) for what in _SECTION
    )
    if not 0.5 <= slope <= 15.0:
        rows.add(line, f"a lift slope of {slope:g}", "0.5 to 15 per radian", "Per degree?")
    if not (span > 0.0 and reref > 0.0 and least > 0.0):
        rows.add(line, f"dCLstall {span:g}, REref {reref:g}, CDmin {least:g}", "values above 0")
    numbers = (slope, top, bottom, stall, span, least, middle, bend, reref, reexp, cm, mcrit)
    return x, XrotorSection(math.radians(a0), *numbers)


def read_xrotor(path: str | os.PathLike[str]) -> BladeFile:
    """Read one saved rotor."""
    rows = Cursor(path, "!#")
    if len(rows.rows) < 9 or not sniff_xrotor(rows.text):
        rows.refuse(1, repr(rows.text[:30]), "XROTOR VERSION, a title and the rotor")
    name, rows.at = rows.rows[1][1].strip(), 2
    rho, *_ = rows.take(4, "Rho Vso Rmu Alt")
    R, V, adv, rake = rows.take(4, "Rad Vel Adv Rake")
    hub, _ = rows.take(2, "XI0 XIW")
    (count,) = rows.take(1, "Naero")
    rows.check()
    if not 1 <= count <= 50:
        rows.refuse(rows.rows[5][0], f"{count:g} sections", "1 to 50")
    sections = [read_section(rows) for _ in range(as_count(count))]
    if rows.at + 1 >= len(rows.rows):
        rows.refuse("", "the end of the file", "flags, stations")
    flags = rows.rows[rows.at][1].split()
    rows.at += 1
    n, blades = rows.take(2, "II Nblds")
    left = len(rows.rows) - rows.at
    if min(left, as_count(n)) < n:
        rows.add(rows.rows[-1][0], number_of(min(left, as_count(n)), "station"), f"{n:g}")
    table = rows.table(as_count(n), 4, "r/R C/R Beta0deg Ubody")
    rows.check()
    notes = ["compressibility: effects of the case instead of XROTOR's Mcrit"]
    if len(flags) > 1 and flags[1].upper().startswith("T"):
        notes.append("the file has XROTOR's duct option on: read as an open rotor")
    if rake != 0.0:
        notes.append(f"rake {rake:g} is left out")
    if np.any(table[:, 3] != 0.0):
        notes.append("the velocity of a body (Ubody) is left out")
    rpm = V / (R * adv) * 30.0 / math.pi if adv > 0.0 and V > 0.0 else None
    air = rho if 0.01 < rho < 10.0 else None
    x = np.array([s[0] for s in sections])
    if np.any(np.diff(x) <= 0.0):
        rows.add("sections", f"r/R {x.tolist()}", "ascending")
    r, c, beta = table[:, 0] * R, table[:, 1] * R, np.radians(table[:, 2])
    point = (rpm, V if rpm else None, air)
    return rows.finish(
        BladeFile(name, "XROTOR", as_count(blades), R, hub * R, r, c, beta, sections, *point, tuple(notes))
    )


# QPROP: propeller files.

QPROP = "qprop"
HEAD = (
    (1, "Nblades R"), (2, "CL0 CL_a"), (2, "CLmin CLmax"), (4, "CD0 CD2u CD2l CLCD0"), (2, "REref REexp"),
    (3, "Rfac Cfac Bfac"), (3, "Radd Cadd Badd"),
)  # fmt: skip


def sniff_qprop(head: bytes | str) -> bool:
    r"""Tell whether a file has a title and the seven lines of numbers of a propeller file, then stations.

    >>> head = "6x3\n 2 .0762\n0.5 5.8\n-0.4 1.2\n.028 .05 .05 .5\n70000 -.7\n.0254 .0254 1\n0 0 0\n"
    >>> sniff_qprop(head + ".75 .66 27.5\n1 .69 22\n")
    True
    """
    rows = [t for t in head_text(head).splitlines() if t.strip() and t.lstrip()[0] not in "#!"]
    if len(rows) < 10:
        return False

    def count(text: str) -> int:
        words = text.split("!")[0].replace(",", " ").split()
        try:
            [float(w.replace("D", "e").replace("d", "e")) for w in words]
        except ValueError:
            return -1
        return len(words)

    wanted = [count(t) for t in rows[1:10]]
    fits = ((1, 2, 3), (2,), (2,), (3, 4), (2,), (3,), (3,))  # a short line of drag is told by `read`
    titled = not 1 <= count(rows[0]) <= 3
    return titled and all(n in fit for n, fit in zip(wanted, fits, strict=False)) and min(wanted[7:]) >= 3


def read_qprop(path: str | os.PathLike[str]) -> BladeFile:
    """Read one propeller file."""
    rows = Cursor(path, "#!")
    if len(rows.rows) < 10:
        rows.refuse("", number_of(len(rows.rows), "line"), "a title, seven lines of numbers, two stations")
    rows.at, line = 1, rows.rows[1][0]
    got = [rows.take(n, what, max(n, 2)) for n, what in HEAD]
    body = [rows.take(3, "r c beta", 13) for _ in rows.rows[8:]]
    rows.check()
    (blades, *given), (cl0, cla), (low, high), drag, reynolds, factor, offset = got
    basic = [cl0, cla, low, high, *drag, *reynolds]
    r, c, b = (np.array([row[:3] for row in body]) * factor + offset).T
    stated = bool(given and given[0] > 0.0)
    R = given[0] if stated else float(r[-1])
    notes = [] if stated else ["no tip radius in the file: that of the last station"]
    notes.append("the file has no hub radius: that of the first station; compressibility: effects of the case")
    sections: list[tuple[float, QpropSection]] = [(0.0, QpropSection(*basic))]
    if {len(row) for row in body} != {3}:
        full = [row[3:] + basic[len(row) - 3 :] for row in body]
        sections = [(float(x / R), QpropSection(*row)) for x, row in zip(r, full, strict=True)]
    for k, (_, s) in enumerate(sections):
        if not (0.5 <= s.cla <= 15.0 and s.reref > 0.0 and s.cd0 > 0.0 and s.clmin < s.clmax):
            told = f"CL_a {s.cla:g}, CD0 {s.cd0:g}, CLmin {s.clmin:g}, CLmax {s.clmax:g}"
            rows.add(f"section {k + 1}", told, "a slope per radian from 0.5 to 15, drag above 0, CLmin < CLmax")
    last = f"{r[-1]:g} m"
    if R > 1.5 * r[-1]:
        rows.add(line, f"R = {R:g} m with a last radius of {last}", "a tip near it", "R takes no Rfac: metres")
    if blades != as_count(blades):
        rows.add(line, f"{blades:g} blades", "a whole number")
    if R * (1 + 1e-9) < r[-1]:
        rows.add(line, f"R = {R:g}", f"at least the last radius, {last}", "R is in metres, whatever Rfac is")
    name, beta = rows.rows[0][1].strip(), np.radians(b)
    blade = BladeFile(name, "QPROP", as_count(blades), R, float(r[0]), r, c, beta, sections, notes=tuple(notes))
    return rows.finish(blade)


# DFDC: case files with a bladed rotor in a duct (the centre body gives the hub).

DFDC = "dfdc"


def read_dfdc(path: str | os.PathLike[str]) -> BladeFile:
    """Read the rotor of one case."""
    rows = Cursor(path, "!#")
    words = [text.split()[0].split("!")[0].upper() for _, text in rows.rows]
    if "ROTOR" not in words:
        got = "an actuator disk without blades" if "ACTDISK" in words else "no ROTOR"
        rows.refuse("", got, "a case with a ROTOR block", "A disk has no blade to read")
    notes = ["the blade ends at the wall: the file has no tip gap"]
    name = rows.rows[1][1].strip() if len(rows.rows) > 1 else ""
    V = rpm = rho = None
    if "OPER" in words:
        rows.at = words.index("OPER") + 1
        V, _, turning = rows.take(3, "Vinf Vref RPM")
        air, *_ = rows.take(4, "Rho Vso Rmu Alt")
        rpm, rho = abs(turning) or None, air if 0.01 < air < 10.0 else None
    sections = []
    if "AERO" in words:
        rows.at = words.index("AERO") + 1
        sections = [read_section(rows) for _ in range(as_count(rows.take(1, "#sections")[0]))]
    else:
        rows.add("AERO", "nothing", "sections of the blade")
    rows.at = words.index("ROTOR") + 1
    if words.count("ROTOR") > 1:
        notes.append("the file has several rotors: the first is read")
    x_disk, blades, _ = rows.take(3, "Xdisk Nblds NRsta")
    n = as_count(rows.take(1, "#stations")[0])
    body = rows.table(n, 3, "r chord beta")
    if len(body) < n:
        rows.add("ROTOR", number_of(len(body), "station"), f"{n}")
    rows.check()
    r, c, b = body.T
    hub, tip, duct = _walls(rows, words, x_disk)
    if hub is None or not 0.0 < hub <= r[0]:
        hub = float(r[0])
        notes.append("no centre body at the rotor: the hub is that of the first station")
    if tip is None or tip < r[-1]:
        tip = float(r[-1])
        notes.append("no duct at the rotor: the tip is that of the last station")
    blade = BladeFile(
        name, "DFDC", as_count(blades), tip, hub, r, c, np.radians(b), sections, rpm, V, rho, tuple(notes), duct
    )
    return rows.finish(blade)


def _walls(rows: Cursor, words: list[str], x: float) -> tuple[float | None, float | None, dict[str, float] | None]:
    """Radii of centre body and bore at the rotor, None where there is no outline; the duct's keys of a case."""
    if "GEOM" not in words or "ENDGEOM" not in words:
        return None, None, None
    parts: list[list[list[float]]] = [[]]
    rows.at = words.index("GEOM") + 2
    while rows.at < words.index("ENDGEOM"):
        pair = rows.take(2, "x r")
        if pair[0] > 900.0:
            parts.append([])
        else:
            parts[-1].append(pair)
    outlines = [np.array(part).reshape(-1, 2) for part in parts]
    body = max(_crossings(outlines[0], x), default=None)
    if len(outlines) < 2 or not (bores := _crossings(outlines[1], x)):
        return body, None, None
    wall, bore = outlines[1], min(bores)
    lip = int(np.argmin(wall[:, 0]))
    inside, outside = sorted((wall[lip:], wall[lip::-1]), key=lambda part: float(part[:, 1].mean()))
    x_lip, (x_exit, r_exit) = wall[lip, 0], inside[-1]
    duct = {
        "inner_diameter_mm": 2e3 * bore,
        "length_mm": 1e3 * (x_exit - x_lip),
        "lip_radius_mm": 1e3 * max(wall[lip, 1] - bore, 0.0),
        "rotor_position_mm": 1e3 * (x - x_lip),
        "exit_diameter_mm": 2e3 * r_exit,
        "trailing_edge_mm": 1e3 * max(outside[-1, 1] - r_exit, 0.0),
        "exit_hub_diameter_mm": 2e3 * max(_crossings(outlines[0], x_exit - 1e-6 * abs(x_exit)), default=0.0),
    }
    widest = outside[np.argmax(outside[:, 1])]
    if widest[0] < 0.5 * (x_lip + x_exit):  # of a nose
        duct["outer_diameter_mm"] = 2e3 * widest[1]
    return body, bore, duct


def _crossings(outline: np.ndarray, x: float) -> list[float]:
    """Radii at which an outline passes an axial position."""
    out = []
    for (x0, r0), (x1, r1) in zip(outline[:-1], outline[1:], strict=True):
        if min(x0, x1) <= x <= max(x0, x1) and x0 != x1:
            out.append(float(abs(r0 + (x - x0) / (x1 - x0) * (r1 - r0))))
    return out


READERS = (
    Reader(XROTOR, sniff_xrotor, read_xrotor, BLADE=True),
    Reader(QPROP, sniff_qprop, read_qprop, BLADE=True),
    Reader(DFDC, begins(r"\s*DFDC\s+Version"), read_dfdc, BLADE=True),
)
