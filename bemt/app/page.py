"""The page of ``bemt ui``: what one person asks first, over the public API only. Run by streamlit."""

from __future__ import annotations

import io
import math
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

import bemt
from bemt.app.face import parameters

FORMATS = ("stl", "qprop", "xrotor", "jsbsim", "rotor-disk", "table")
BLUE, ORANGE = "#0072B2", "#D55E00"
ABOUT = (
    "Thrust and power with one standard uncertainty (band). Nothing leaves this machine. A point that does not "
    "converge is left out, never zero."
)


def own(text: str) -> Path | None:
    """Case folder or file of stations that a text names; None for a label."""
    path = Path(text.strip()).expanduser()
    return path if text.strip() and path.exists() else None


def made(label: str, chord: float, pitch: float, diameter_in: float = 0.0) -> bemt.Propeller:
    """Propeller of a case, stations or a label, whose chord over radius (0: no) and share of pitch are as measured."""
    path = own(label)
    if path is not None:
        case = path.is_dir() or path.suffix == ".toml"
        return bemt.load(path) if case else bemt.propeller(stations=path, diameter_in=diameter_in)
    found = bemt.propeller(label)
    changes: dict[str, float] = {}
    if chord > 0.0:
        changes["blade.max_chord_over_R"] = chord
    if pitch != 1.0:
        changes["blade.pitch_in"] = found.case.get("blade.pitch_in") * pitch
    return found.replaced(changes) if changes else found


def archive(folder: Path) -> bytes:
    """Files of a folder as one zip."""
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as out:
        for file in sorted(p for p in folder.rglob("*") if p.is_file()):
            out.write(file, file.relative_to(folder).as_posix())
    return held.getvalue()


def curve(st: Any, points: Any, x: str, y: str, words: tuple[str, str], measured: Any = None) -> None:
    """Draw a curve with its band, and measured points."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2, 3.4), layout="constrained")
    axes = figure.subplots()
    at, value, u = points[x], points[y], points.u[y]
    axes.fill_between(at, value - u, value + u, color=BLUE, alpha=0.2, linewidth=0, label="band, 68 %")
    axes.plot(at, value, color=BLUE, label="BEMT")
    if measured is not None and x in measured.values and y in measured.values:
        axes.plot(measured[x], measured[y], "o", color=ORANGE, markersize=4, label="recording")
    axes.set_xlabel(words[0])
    axes.set_ylabel(words[1])
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8)
    st.pyplot(figure)


def told(name: str) -> str:
    """What the declarations of the actions say of a parameter, as in the help of the command line."""
    return next(p.help for action in (bemt.estimate, bemt.drive) for p in parameters(action) if p.name == name)


def asked(st: Any) -> tuple[bemt.Propeller, float, float, tuple[float, int] | None]:
    """What the user sets: the propeller, rev/min, m/s, and K_v and cells of a motor."""
    with st.sidebar:
        st.header("Propeller")
        label = st.text_input("Label, case folder or file of stations", "10x5", help=told("label"))
        path = own(label)
        stations = path is not None and path.is_file() and path.suffix != ".toml"
        diameter = st.number_input("Diameter [in]", 1.0, 400.0, 10.0, 0.5) if stations else 0.0
        known = st.checkbox("I measured the chord", disabled=path is not None)
        chord = st.slider("Largest chord / radius", 0.05, 0.40, 0.20, 0.005, disabled=not known or path is not None)
        pitch = st.slider("Pitch / pitch of the label", 0.7, 1.3, 1.0, 0.01, disabled=path is not None)
        propeller = made(label, chord if known else 0.0, pitch, diameter)
        st.header("Operating point")
        sonic = math.ceil(60.0 * 340.0 / (math.pi * propeller.case.diameter_m) / 1000.0) * 1000
        rpm = st.slider("Speed of rotation [rev/min]", 1000, max(sonic, 2000), min(6000, sonic), 100, help=told("rpm"))
        airspeed = st.slider("Airspeed [m/s]", 0.0, 40.0, 0.0, 0.5, help=told("airspeed_m_s"))
        st.header("Motor and battery")
        motor = st.checkbox("With a motor")
        kv = st.slider("K_v [rev/min/V]", 100, 4000, 900, 10, disabled=not motor, help=told("kv"))
        cells = st.slider("LiPo cells", 1, 12, 3, disabled=not motor, help=told("cells"))
    return propeller, float(rpm), float(airspeed), (kv, cells) if motor else None


def answer(st: Any, propeller: bemt.Propeller, rpm: float, V: float, motor: tuple[float, int] | None) -> None:
    """The numbers at a point, with flags beside them."""
    one = propeller.solve(rpm, V)
    cells = st.columns(3)
    for cell, name, key, unit in zip(cells, ("Thrust", "Shaft power", "Torque"), ("thrust_N", "power_W", "torque_Nm"),
                                     ("N", "W", "N m"), strict=True):  # fmt: skip
        value = float(one[key][0])
        cell.metric(name, f"{value:.3g} ± {float(one.u[key][0]):.2g} {unit}" if np.isfinite(value) else "no solution")
    for flag in one.flags[0]:
        st.warning(flag)
    if motor is not None:
        found = bemt.drive(propeller, kv=motor[0], cells=motor[1], airspeed_m_s=V)
        st.subheader("With this motor, full throttle")
        st.code(found.text, language=None)


def _read(path: Path) -> bemt.Dataset | tuple[str, ...]:
    """What a file holds; the names of its tables where one has to be chosen."""
    try:
        return bemt.read(path)
    except bemt.InputError as error:
        if tables := error.faults[0].choices:
            return tables
        raise


def recording(st: Any, propeller: bemt.Propeller) -> Any:
    """The recording that was dropped, read; None without one."""
    st.subheader("Your recording")
    file = st.file_uploader("Drop a bench log or a table (rpm, thrust_N, torque_Nm, ...)", key="recording")
    if file is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / Path(file.name).name
        path.write_bytes(file.getvalue())
        try:
            points = _read(path)
            if not isinstance(points, bemt.Dataset):  # sheets, or files in a zip
                part = st.selectbox("It has several tables", points, None, placeholder="Choose one", key="part")
                if part is None:
                    return None
                path = path.with_name(f"{path.name}#{part}")
                points = bemt.read(path)
        except bemt.InputError as error:
            for fault in error.faults:
                st.error(str(fault).replace(f"{folder}/", ""))
            return None
        for note in points.notes:
            st.caption(note)
        frame = points.to_pandas()
        frame.attrs = {}  # what the page cannot send
        st.dataframe(frame, height=180)
        if st.button("Diagnose", type="primary"):
            with st.spinner("Comparing with every effect and fault ..."):
                found = bemt.diagnose(path, propeller)
            head, mark, rest = found.text.replace(f"{folder}/", "").partition("verdict: ")  # commands name your file
            shown = st.success if found.verdict in ("named", "none") else st.info
            shown(" ".join(head.split()))
            with st.expander("The whole answer", expanded=True):
                st.code(mark + rest, language=None, wrap_lines=True)
    return points


def exports(st: Any, propeller: bemt.Propeller) -> None:
    """Buttons that write the case, exports and sources."""
    st.subheader("Export")
    left, right = st.columns(2)
    left.download_button("Case (case.toml)", propeller.text, "case.toml", "text/plain")
    chosen = right.selectbox("For another program", FORMATS)
    if right.button("Export"):
        with tempfile.TemporaryDirectory() as folder:
            written = bemt.export(propeller, folder, chosen)
            st.code(written.text.replace(folder, "."), language=None)
            st.download_button("Download", archive(Path(folder)), f"{propeller.name}_{chosen}.zip")
    with st.expander("Sources of this answer"):
        for source in bemt.cite(propeller):
            st.markdown(f"**{source.name}** ({source.kind}): {source.source}")


def main() -> None:
    """Draw the page."""
    import streamlit as st

    from bemt.app.served import end_with_parent

    end_with_parent()
    st.set_page_config(page_title="bemt", layout="wide")
    st.title("Propellers with uncertainty")
    st.caption(ABOUT)
    try:
        propeller, rpm, V, motor = asked(st)
        answer(st, propeller, rpm, V, motor)
        measured = recording(st, propeller)
        left, right = st.columns(2)
        with left:
            own = np.zeros(1) if measured is None or "rpm" not in measured else measured["rpm"]
            over = propeller.solve(np.linspace(0.3 * rpm, max(1.3 * rpm, float(np.nanmax(own))), 14), V)
            curve(st, over, "rpm", "thrust_N", ("rev/min", f"thrust [N] at {V:g} m/s"), measured)
        with right:
            along = propeller.curve(rpm, np.linspace(0.0, 0.8, 14))
            curve(st, along, "J", "CT", ("advance ratio J", f"CT at {rpm:g} rev/min"))
        exports(st, propeller)
    except bemt.InputError as error:
        for fault in error.faults:
            st.error(str(fault))


if __name__ == "__main__":
    main()
