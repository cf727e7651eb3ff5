"""The document of ``bemt.calibration/1`` as tables for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bemt.base.tables import text_table

NAMES = {
    "thesis": "K1/K2, thesis", "goal_seek": "K1/K2, goal-seek", "refit": "K1/K2, refit at rest",
    "refit_flight": "K1/K2, refit with flight", "compact_pitch": "compact, chord and pitch",
    "compact": "compact, chord", "compact_no_chord": "compact, label",
    "compact_pitch_maker_out": "compact, chord and pitch, maker out", "compact_maker_out": "compact, chord, maker out",
    "compact_no_chord_maker_out": "compact, label, maker out",
}  # fmt: skip
_SHORT = ("thesis", "compact_pitch", "compact", "compact_no_chord")
_GIVEN = {"pitch": "chord and pitch", "chord": "chord", "label": "label"}


def _cell(row: Mapping[str, Any] | None) -> str:
    if not row or not row["points"] or row["median"] is None:
        return "-"
    return f"{row['median']:.2f} {100 * row['within_13']:3.0f} {100 * row['within_26']:3.0f}"


def _totals(found: Mapping[str, Any], which: str) -> str:
    rows = []
    names = found["static"]["models"] if which == "all" else found["chord_known"]["static"]["models"]
    part = found if which == "all" else found["chord_known"]
    for key in names:
        row = [NAMES.get(key, key), _cell(part["static"]["models"][key]), _cell(part["flight"]["models"][key])]
        row += [_cell(band["models"][key])[:4] for band in part["J/(P/D)"][:5]]
        rows.append(row)
    header = ["thrust, made/measured: median, % in 13, 26 %", "at rest", "in flight"]
    return text_table([*header, *[band["band"] for band in part["J/(P/D)"][:5]]], rows, indent="  ")


def _set(name: str, found: Mapping[str, Any]) -> list[str]:
    s, f = found["static"], found["flight"]
    title = {"calibration": "CALIBRATION, fitted models with the propeller left out", "test": "TEST, held out"}[name]
    lines = [
        "",
        f"{title}: {s['points']} points of {s['propellers']} propellers at rest, {f['points']} of "
        f"{f['propellers']} in flight (J/(P/D) below 0.8)",
    ]
    lines.append(_totals(found, "all"))
    with_chord = found["chord_known"]["static"]
    if 0 < with_chord["points"] < s["points"]:
        title = (
            f"  the {with_chord['propellers']} propellers with a known chord, {with_chord['points']} points at rest:"
        )
        lines += ["", title, _totals(found, "chord")]
    power = found["power"]
    rows = [[NAMES.get(key, key), _cell(v), _cell(power["flight"][key])] for key, v in power["static"].items()]
    lines += ["", text_table(["power", "at rest", "in flight"], rows, indent="  ")]
    for key, words in _GIVEN.items():
        c = found["coverage"][key]
        if c["CT68"] is not None:
            text = ", ".join(f"{k[:2]} {k[2:]} %: {100 * v:.0f} %" for k, v in c.items() if v is not None)
            lines.append(f"  inside the published bands, given {words}: {text}")
    limits = [[words, str(c["propellers"]),
               *[f"{100 * c[f'{k}_13']:3.0f} {100 * c[f'{k}_26']:3.0f}" for k in ("maker_out", "within", "ideal")],
               f"{c['scatter']:.3f}"]
              for key, words in _GIVEN.items() if (c := found["limit"][key]) is not None]  # fmt: skip
    if limits:
        header = ["free function of the inputs, fitted on these data: % in 13, 26 % at rest", "propellers", "maker out",
                  "propeller out", "perfect", "scatter of ln CT"]  # fmt: skip
        lines += ["", text_table(header, limits, left=(0,), indent="  ")]
    models = [k for k in _SHORT if k in s["models"]]
    rows = [
        [r["quantity"], r["band"], r["motion"], str(r["propellers"]), str(r["points"]),
         *[_cell(r["models"][k]) for k in models]]
        for r in found["bands"]
    ]  # fmt: skip
    header = ["where", "band", "motion", "propellers", "points", *[NAMES[k] for k in models]]
    return [*lines, "", text_table(header, rows, left=(0, 1, 2), indent="  ")]


def text(doc: Mapping[str, Any]) -> str:
    """Tables for people."""
    rows = []
    for key, c in doc["k1k2"].items():
        spans = [f"{c[k][0]:.4f} to {c[k][1]:.4f}" if c[k][0] == c[k][0] else "-" for k in ("K1_95", "K2_95")]
        rows.append([NAMES[key], f"{c['K1']:.4f}", spans[0], f"{c['K2']:.3f}", spans[1], str(c["points"] or "-"),
                     str(c["propellers"] or "-")])  # fmt: skip
    header = ["F = rho A (vp^2 - vp V) (K1 D/p)^K2", "K1", "95 % (bootstrap)", "K2", "95 %", "points", "propellers"]
    lines = [text_table(header, rows)]
    c = doc["compact"]
    head = "refitted" if c["refitted"] else "published constants, too few chords to refit"
    on = f" on {c['propellers']} propellers with chord and {c['chords']} chords" if c["refitted"] else ""
    lines += ["", f"Compact formula, {head}{on} (published beside it):"]
    lines += ["  " + ", ".join(f"{k} {v:.4g} ({c['published'][k]:.4g})" for k, v in c["constants"].items())]
    lines += ["  series (a0 added [rad], chord over typical):"]
    lines += [f"    {key} {v['zero_lift']:+.3f} {v['chord']:.2f}  {v['name']}" for key, v in c["series"].items()]
    for name, found in doc["scores"].items():
        if found is not None:
            lines += _set(name, found)
    if doc["refused"]:
        lines += ["", f"Left out ({len(doc['refused'])}):", *[f"  {line}" for line in doc["refused"][:10]]]
        lines += [f"  and {len(doc['refused']) - 10} more (--json lists them)"] if len(doc["refused"]) > 10 else []
    lines += [f"note: {note}" for note in doc["notes"][:10]]
    return "\n".join(lines)
