"""Tables and raw records of the thrust_tool stand (J. Majewski): throttle steps with an error per channel.

Tables have one row per throttle step and headings without units::

    out,th,th_err,tq,tq_err,rpm,rpm_err,v,v_err,a,a_err,pin,theff

out [%], th [gf], tq [gf cm], rpm [1/min], v [V], a [A], pin [W], theff [gf/W]; ``_err`` is the stated error in the unit
of its channel. That these units hold is checked within the file: pin = v a and theff = th/pin.

Raw records have one row per sample and no time; their headings name units as ``Thrust [G]`` (gram-force), counts of the
converters have none. ``RPM [1/min]`` is no sensor of its own: it is ``ESCT RPM`` (telemetry, hundreds of electrical
revolutions per minute) over the pole pairs; the factor is found in the file and reported.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np

from bemt.data.readers import first_cells
from bemt.data.readers.headings import Heading, heading, known, slug
from bemt.data.readers.recording import Builder, slip
from bemt.physics.dataset import Dataset

KIND = "jmajew"
_COLUMNS = {
    "out": ("throttle", "pct"), "th": ("thrust", "gf"), "tq": ("torque", "gf_cm"), "rpm": ("", "rpm"),
    "v": ("voltage", "V"), "a": ("current", "A"), "pin": ("electrical_power", "W"), "theff": ("efficacy", "gf/W"),
}  # fmt: skip
_RAW = {
    "Motor Output": ("pulse_width", "us"), "Motor Level": ("throttle", "pct"), "Thrust": ("thrust", "gf"),
    "Torque": ("torque", "gf_cm"), "RPM": ("", "rpm"), "VoltBatt": ("voltage", "V"), "CurrBatt": ("current", "A"),
    "Power In": ("electrical_power", "W"), "Power Out": ("mechanical_power", "W"),
    "Efficiency": ("motor_efficiency", "pct"), "Thrust Efficiency": ("efficacy", "gf/W"),
}  # fmt: skip
_RAW_KEYS = {"Motor Output", "ESCT RPM", "Thrust", "Torque"}


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the first line has this stand's headings.

    >>> sniff("out,th,th_err,tq,tq_err,rpm,rpm_err,v,v_err,a,a_err,pin,theff\n"), sniff("th,tq,rpm\n")
    (True, False)
    """
    cells = first_cells(head)
    return {"out", "th", "th_err", "tq", "tq_err", "rpm"} <= cells or set(map(_base, cells)) >= _RAW_KEYS


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a table or a raw record. ["form"]"""
    build = Builder.of_stand(path, KIND)
    raw = set(map(_base, build.table.headings)) >= _RAW_KEYS
    for k, text in enumerate(build.table.headings):
        if raw and _base(text) in _RAW and (_base(text) != text or text == "Motor Output"):
            build.add_usual(k, *_RAW[_base(text)])
        else:
            build.add(k, Heading(text, slug(text), None, "counts or telemetry") if raw else _table_heading(text))
    if not build.faults:
        build.need("thrust_N", "torque_Nm", "rpm")
    form = "raw" if raw else "table"
    said = {"stand": "thrust_tool (J. Majewski)", "form": form, **_name(Path(build.table.source.name).stem)}
    if not build.faults:
        with np.errstate(over="ignore", invalid="ignore"):  # damaged cells may hold any number
            (_check_raw if raw else _check_table)(build)
        build.flag(np.flatnonzero(build.channels["rpm"].values == 0.0), "rpm is 0")
        if said.get("propeller") == "none":
            build.warnings.append("recorded without a propeller: a tare of the stand, not performance data")
        build.check_magnitudes()
    return build.finish(said)


def _table_heading(text: str) -> Heading:
    base = text.removesuffix("_err")
    if base not in _COLUMNS:
        return heading(text)
    name, unit = _COLUMNS[base]
    return known(text, f"{name}_err".lstrip("_") if base != text and base != "theff" else name, unit)


def _base(text: str) -> str:
    return text.partition("[")[0].strip()


def _name(stem: str) -> dict[str, str]:
    """Motor, propeller, cells and duct as the file name tells them."""
    low = stem.lower()
    out = {"run_name": stem}
    if cells := re.search(r"_(\d)s(_|$)", low):
        out["battery_cells"] = cells[1]
    if re.search(r"no-?prop", low):
        out["propeller"] = "none"
    elif found := re.search(r"__([^_]+)_([^_]+)_\d+s", low):
        out["motor"], out["propeller"] = found[1], found[2]
    if re.search(r"(^|_)duct(_|$)", low):
        out["duct"] = "yes"
    return out


def _check_table(build: Builder) -> None:
    """Units are not in the file: see that its own products agree with them."""
    c = {name: channel.values for name, channel in build.channels.items()}
    if {"voltage_V", "current_A", "electrical_power_W"} <= c.keys():
        _ratio(build, c["voltage_V"] * c["current_A"], c["electrical_power_W"], "pin", "v x a", 0.05)
    if {"thrust_N", "electrical_power_W", "efficacy_N_W"} <= c.keys():
        with np.errstate(divide="ignore", invalid="ignore"):
            _ratio(build, c["thrust_N"] / c["electrical_power_W"], c["efficacy_N_W"], "theff", "th/pin", 0.01)
    for name in [n for n in c if "_err_" in n or n.endswith("err_rpm") or n == "err_rpm"]:
        build.flag(np.flatnonzero(c[name] < 0.0), f"{name} is negative")
        main = name.replace("_err_", "_").replace("err_rpm", "rpm")
        if main in c:
            usual = float(np.nanmedian(c[name]))
            wide = np.flatnonzero(c[name] > 20.0 * max(usual, 1e-12))
            build.flag(wide, f"stated error of {main} above 20 times its median")
    build.flag(np.flatnonzero(c["thrust_N"] < 0.0), "thrust_N is negative")
    if "throttle" in c:
        build.flag(np.flatnonzero(np.diff(c["throttle"], prepend=-np.inf) <= 0.0), "throttle does not rise")


def _ratio(build: Builder, expected: np.ndarray, got: np.ndarray, name: str, formula: str, tolerance: float) -> None:
    top = float(np.nanmax(np.abs(np.append(expected, 0.0))))
    good = np.isfinite(expected) & np.isfinite(got) & (np.abs(expected) > max(0.05 * top, 0.01))  # three decimals only
    if not np.any(good):
        return
    ratio = got[good] / expected[good]
    usual = float(np.median(ratio))
    if abs(usual - 1.0) > tolerance:
        text = f"{name} is {usual:.4g} times {formula}{slip(usual)}"
        build.warnings.append(f"{text}: the units of this table are in doubt")
    else:
        build.flag(np.flatnonzero(good)[np.abs(ratio / usual - 1.0) > 5 * tolerance], f"{name} differs from {formula}")


def _check_raw(build: Builder) -> None:
    c = {name: channel.values for name, channel in build.channels.items()}
    telemetry = c.get("ESCT_RPM")
    if telemetry is not None:
        good = (telemetry > 0) & (c["rpm"] > 0)
        if np.count_nonzero(good) >= 3:
            ratio = c["rpm"][good] / telemetry[good]
            usual = float(np.median(ratio))
            if float(np.max(np.abs(ratio / usual - 1.0))) < 1e-3:
                pairs = 100.0 / usual
                text = f"rpm is ESCT RPM x {usual:.5g} in all rows: ESC telemetry"
                near = abs(pairs - round(pairs)) < 0.01
                whole = f" of electrical speed over {round(pairs)} pole pairs" if near else ""
                build.warnings.append(text + whole + ", not a separate sensor")
    build.warnings.append("no time in a raw record: rows are in order of sampling")
    build.flag_spikes("thrust_N", "torque_Nm", "rpm")
    build.flag(np.flatnonzero(c["thrust_N"] < 0.0), "thrust_N is negative")
