"""The promise of the CFD importers: read by the header, or refused with the reason; damage is never silent."""
# ruff: noqa: E501 - samples as they look in files

from __future__ import annotations

import gzip
import random
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.data import readers as importers
from bemt.data.readers import cfd
from bemt.data.recordings.load import import_file, import_files
from bemt.physics.dataset import Dataset

N = 40


def _history(rows: int = N) -> np.ndarray:
    """Step, thrust near -12 (as projected), torque near 0.3, time: no two columns share a value."""
    k = np.arange(1, rows + 1)
    return np.column_stack([k + 100, -12.0 + 0.01 * np.sin(k), 0.3 + 0.001 * np.cos(k), 1e-3 * k])


def report(names: tuple[str, ...] = ("Time Step", "thrust(blade)", "torque", "flow-time"), rows: int = N) -> str:
    head = f'"thrust-rfile"\n"{names[0]}" "{names[1]} etc.."\n(' + " ".join(f'"{n}"' for n in names) + ")\n"
    return head + "".join(f"{int(s)} {t:.9g} {q:.9g} {time:.9g}\n" for s, t, q, time in _history(rows))


def monitor() -> str:
    rows = "".join(f"{time:.5e}     {t:.5e}\r\n" for _, t, _, time in _history())
    return '"Drag Convergence"\r\n"Flow Time" "cd"\r\n' + rows


def forces(unit: str = "n") -> str:
    zones = {"blade:1": (-10.25, -0.5), "hub": (1.25, -0.0625), "duct": (-4.5, -0.125)}
    zones["Net"] = tuple(sum(v[k] for v in zones.values()) for k in (0, 1))  # type: ignore[assignment]
    names = "Pressure        Viscous         Total"
    text = (
        '                  "Force Report"\n\nForces\n'
        + f"             Forces ({unit})                             Coefficients\n"
    )
    text += f"Zone      {names}      {names}\n"
    lines, scalars = [], []
    for zone, (p, v) in zones.items():
        cells = [f"({a:g} {2 * a:g} 0)" for a in (p, v, p + v, p / 4, v / 4, (p + v) / 4)]
        lines.append(f"{zone:24s}  " + "  ".join(cells) + "  ")
        scalars.append(f"{zone:24s}  " + "  ".join(f"{a:g}" for a in (p, v, p + v, p / 4, v / 4, (p + v) / 4)) + "  ")
    rule = "------------------------ --------------- ---------------\n"
    text += "\n".join(lines[:-1]) + "\n" + rule + lines[-1] + "\n\nForces - Direction Vector (1 0 0)\n"
    text += f"             Forces ({unit})                             Coefficients\nZone      {names}      {names}\n"
    return text + "\n".join(scalars[:-1]) + "\n" + rule + scalars[-1] + "\n"


def transcript() -> str:
    out = ["              Welcome to ANSYS Fluent 2025 R2", "     1061927 cells,     3 cell zones ...", ""]
    for k in range(3):
        out += ["  iter  continuity  x-velocity           k     time/iter",
                f" {10 + k}  1.8226e-0{k + 2}  1.1633e-05  1.1935e-04  0:01:28   15",
                f"Flow time = {0.5 + 0.001 * k:.15g}s, time step = {20 + k}", ""]  # fmt: skip
    out += ["                          Moment               [N m]", "-------------------------------- -------------------",
            "                           blade         -0.18741116", "(cx-gui-do cx-activate-item)", ""]  # fmt: skip
    return "\n".join(out)


def post() -> str:
    head = "[Name]\nLoads\n\n[Data]\nTime [ s ], Thrust [ N ], Velocity u [ m s^-1 ], Moment [ N m ]\n"
    return head + "".join(f"{k}.5e-02, {k}.25e-01, {k + 70}.5, {k}.125\n" for k in range(10))


def foam_new() -> str:
    names = " ".join(f"{p}_{a}" for p in ("total", "pressure", "viscous") for a in "xyz")
    text = f"# Force\n# CofR          : (0 0 0)\n#\n# Time          \t{names}\n"
    for k in range(1, N):
        p, v = np.array([20.0, 3.0, 2.0]) + 0.01 * k, np.array([-0.5, 0.25, 0.125])
        text += f"{0.001 * k:g}\t" + " ".join(f"{x:.8e}" for x in (*(p + v), *p, *v)) + "\n"
    return text


def foam_old() -> str:
    text = "# Forces\n# CofR       : (0 0 0)\n# Time       forces(pressure viscous porous)\tmoments(pressure viscous porous)\n"
    for k in range(1, 14):
        force = f"({20 + k}.5 {3 + k}.25 0) (-0.5 0.{k:02d} 0) (0 0 0)"
        text += f"{10 * k:<12d}\t({force}) ((0 0 {60 + k}.5) (0 0 0.25) (0 0 0))\n"
    return text


def su2() -> str:
    head = '"Time_Iter","Outer_Iter","Inner_Iter",     "rms[Rho]"     ,       "CD"       ,       "CL"       \n'
    rows = "".join(
        f"{0:11d}, {0:11d}, {k:11d}, {-1 - 0.01 * k:17.10g}, {0.25 + 1e-4 * k:17.10g}, {70 + k:17.10g}\n"
        for k in range(N)
    )
    return head + rows


SAMPLES: dict[str, Callable[[], str]] = {
    "fluent_report": report, "fluent_monitor": monitor, "fluent_forces": forces, "fluent_transcript": transcript,
    "cfd_post_csv": post, "openfoam_forces": foam_new, "openfoam_forces:old": foam_old, "su2_history": su2,
}  # fmt: skip


@pytest.fixture
def put(tmp_path: Path) -> Callable[..., Path]:
    def write(data: str | bytes, name: str = "file.out") -> Path:
        path = tmp_path / name
        path.write_bytes(data.encode() if isinstance(data, str) else data)
        return path

    return write


@pytest.mark.parametrize("form", SAMPLES)
def test_every_format_is_found_by_content_whatever_its_name_encoding_or_packing(
    put: Callable[..., Path], form: str
) -> None:
    text = SAMPLES[form]()
    plain = importers.read(put(text, "a.xyz"))
    assert plain.provenance["format"] == form.split(":")[0]
    variants = {
        "bom": b"\xef\xbb\xbf" + text.encode(), "utf16": text.encode("utf-16"), "gzip": gzip.compress(text.encode()),
        "crlf": text.replace("\r\n", "\n").replace("\n", "\r\n").encode(),
        "mixed": "".join(p + ("\r\n" if k % 2 else "\n") for k, p in enumerate(text.splitlines())).encode(),
    }  # fmt: skip
    for name, data in variants.items():
        path = put(data, name)
        assert importers.detect(path) == plain.provenance["format"], name
        other = importers.read(path)
        assert list(other.values) == list(plain.values) and len(other) == len(plain), name
        for key, values in plain.values.items():
            np.testing.assert_array_equal(values, other[key], err_msg=name)


def test_columns_go_by_the_third_header_line(put: Callable[..., Path]) -> None:
    names = ("thrust(blade)", "flow-time", "Time Step", "torque")
    data = _history()[:, [1, 3, 0, 2]]
    text = '"t"\n"Time Step" "thrust etc.."\n(' + " ".join(f'"{n}"' for n in names) + ")\n"
    text += "".join(" ".join(f"{v:.9g}" for v in row) + "\n" for row in data)
    record = import_file(put(text))
    assert record.provenance["means"]["torque"].value == pytest.approx(0.3, abs=1e-3)
    assert record.provenance["means"]["thrust(blade)"].value == pytest.approx(
        -12.0, abs=1e-2
    )  # the sign is that of the file
    assert record.unit("time_s") == "s" and "time_s" not in record.provenance["means"]
    assert record.unit("torque") == ""  # stated nowhere, so none


def test_a_report_file_without_its_third_line_is_refused(put: Callable[..., Path]) -> None:
    lines = report().splitlines(keepends=True)
    path = put("".join(lines[:2] + lines[3:]))
    assert importers.detect(path) == "fluent_report"
    with pytest.raises(InputError, match="Line 3 of a report file lists all names; line 2 is abbreviated"):
        importers.read(path)


def test_a_report_file_without_a_value_column_says_so(put: Callable[..., Path]) -> None:
    text = '"t"\n"Time Step"\n("Time Step" "flow-time")\n' + "".join(f"{k} {k * 0.1:.3f}\n" for k in range(5))
    assert "the file has no column of values, only its clock" in import_file(put(text)).notes


@pytest.mark.parametrize(("where", "kept"), [("rows", None), ("header", None), ("both", "torque")])
@pytest.mark.parametrize("dropped", [0, 1, 2, 3])
def test_a_dropped_column_never_shifts_the_others(
    put: Callable[..., Path], dropped: int, where: str, kept: str | None
) -> None:
    names = ["Time Step", "thrust", "torque", "flow-time"]
    rows = [[f"{v:.9g}" for v in row] for row in _history()]
    if where != "header":
        rows = [[c for k, c in enumerate(row) if k != dropped] for row in rows]
    if where != "rows":
        names = [n for k, n in enumerate(names) if k != dropped]
    text = '"t"\n"x etc.."\n(' + " ".join(f'"{n}"' for n in names) + ")\n" + "".join(" ".join(r) + "\n" for r in rows)
    if where != "both":
        with pytest.raises(InputError, match="A column was dropped or added"):
            importers.read(put(text))
        return
    record = importers.read(put(text))
    for name, low, high in (("thrust", -12.1, -11.9), ("torque", 0.29, 0.31)):
        if name in record.values:
            assert low < record.provenance["means"][name].value < high


def test_number_oddities(put: Callable[..., Path]) -> None:
    cells = ["1e-21", "-0", "1.5D+01", "NaN", "-1.#IND", "1e999", "20.24100076", "0.3"]
    text = '"t"\n"i" "q"\n("Iteration" "q")\n' + "".join(f"{k + 20241} {c}\n" for k, c in enumerate(cells))
    record = importers.read(put(text))
    np.testing.assert_array_equal(record["q"], [1e-21, 0, 15, *[np.nan] * 3, 20.24100076, 0.3])
    assert "means" not in record.provenance
    assert "q: 3 of 8 values are not finite numbers in the file: diverged?" in record.notes
    lost = importers.read(put('"t"\n"i" "q"\n("Iteration" "q")\n1 1.0\n2 1.0\n9 nan\n3 1.0\n4 1.0\n'))
    assert lost["q"].tolist() == [1.0] * 4 and any(note.endswith("diverged?") for note in lost.notes)
    assert not any("out of order" in note for note in lost.notes)
    commas = put('"t"\n"i" "q"\n("Iteration" "q")\n1 0,25\n2 0,75\n')
    record = importers.read(commas)
    assert record.provenance["means"]["q"].value == 0.5 and "decimal commas read as decimal points" in record.notes


def test_a_cut_last_row_is_left_out_with_a_warning(put: Callable[..., Path]) -> None:
    text = report()
    for cut in range(2, 24):
        record = importers.read(put(text[:-cut]))
        assert len(record) in (N - 1, N - 2)
        assert len(record) == N - 2 or any("cut" in w for w in record.notes)
        assert set(record["torque"]) <= set(importers.read(put(text))["torque"])


def test_restarts_inside_a_file(put: Callable[..., Path]) -> None:
    lines = report().splitlines()
    head, rows = lines[:3], lines[3:]
    later = [row.replace(" 0.3", " 0.4").replace(" 0.29", " 0.39") for row in rows[20:30]]
    record = importers.read(put("\n".join([*head, *rows, head[2], *later]) + "\n"))
    assert len(record) == 30  # rows 31..40 belong to the branch that was given up
    assert np.all(record["torque"][20:] > 0.35) and np.all(record["torque"][:20] < 0.35)
    assert any("header repeated" in w for w in record.notes)
    assert any("goes back" in w for w in record.notes)
    twice = importers.read(
        put("\n".join([*head, *rows[:5], later[0].replace("121", "105").replace("0.021", "0.005"), *rows[5:]]) + "\n")
    )
    assert len(twice) == N and twice["torque"][4] > 0.35  # the last row of a step wins


def test_zones_stay_apart(put: Callable[..., Path]) -> None:
    record = importers.read(put(forces()))
    get = {name: mean.value for name, mean in record.provenance["means"].items()}
    assert get["force_total_x_N(blade:1)"] == -10.75 and get["force_pressure_y_N(hub)"] == 2.5
    assert get["force_total_N along (1 0 0) (Net)"] == -14.1875 and get["force_coefficient_viscous_x(duct)"] == -0.03125
    assert record.unit("force_total_x_N(hub)") == "N"
    wrong = forces().replace("(-10.75 ", "(-10.85 ", 1)
    assert any("its parts add up to -10.75" in w for w in importers.read(put(wrong)).notes)
    pounds = importers.read(put(forces("lbf")))
    assert pounds.unit("force_total_x(hub)") == "lbf"  # shown as it is, never called newtons


def test_transcripts_give_what_was_computed(put: Callable[..., Path]) -> None:
    record = importers.read(put(transcript()))
    assert (
        record.provenance["means"]["moment_Nm(blade)"].value == -0.18741116 and record.unit("moment_Nm(blade)") == "Nm"
    )
    assert list(record.values) == ["moment_Nm(blade)"]  # residuals and times say nothing of a load
    assert record.provenance["cells"] == "1061927" and record.provenance["solver"] == "ANSYS Fluent 2025 R2"
    with pytest.raises(InputError, match="no computed values; expected .*Write a report file of thrust and torque"):
        importers.read(put(transcript().partition("   Moment")[0]))


def test_openfoam_layouts_agree(put: Callable[..., Path]) -> None:
    new, old = importers.read(put(foam_new())), importers.read(put(foam_old()))
    total = [f"force_total_{a}_N" for a in "xyz"]
    assert set(total) <= set(new.values) & set(old.values)
    np.testing.assert_allclose(old["force_total_x_N"], 20 + np.arange(1, 14))
    np.testing.assert_allclose(old["moment_total_z_Nm"], 60.75 + np.arange(1, 14))
    swapped = foam_new().replace("total_x total_y", "total_y total_x")
    assert any("is not the sum of its parts" in w for w in importers.read(put(swapped)).notes)


def test_a_block_over_time_is_a_history_and_any_other_a_table_without_a_mean(put: Callable[..., Path]) -> None:
    record = importers.read(put(post()))
    assert [(k, record.unit(k)) for k in record.values] == [
        ("time_s", "s"), ("thrust_N", "N"), ("velocity_u_m_s", "m_s"), ("moment_Nm", "Nm")]  # fmt: skip
    assert record.clock == "time" and record.provenance["means"]["thrust_N"].value == pytest.approx(0.475)
    two = importers.read(put(post() + post().replace("Loads", "Duct")))
    assert {"thrust_N(Loads)", "thrust_N(Duct)"} <= set(two.values)
    points = importers.read(put(post().replace("Time [ s ]", "X [ m ]").replace("Thrust [ N ]", "X [ m ]")))
    assert "means" not in points.provenance and points.clock == "none" and "x_m#2" in points.values
    plot = '(title "Velocity")\n(labels "Position" "Velocity")\n\n((xy/key/label "inlet")\n0\t1\n1\t2\n2\t3\n)\n'
    probes = "# Probe 0 (0.05 0 0)\n#       Probe   0\n#        Time\n0.1  (0 1 0)\n0.2  (0 2 0)\n"
    plus = "# y+ ()\n# Time \tpatch \tmin \tmax \taverage\n10\tblade\t5.5\t90\t30\n10\thub\t1\t2\t1.5\n"
    for text, what in ((plot, "a Fluent XY plot"), (probes, "values at probes"), (plus, r"y\+ of walls")):
        with pytest.raises(InputError, match=f"{what}.*Write a report file"):
            import_file(put(text))


def test_dual_time_keeps_the_last_inner_iteration(put: Callable[..., Path]) -> None:
    text = '"Time_Iter","Inner_Iter","Cur_Time","CL"\n'
    text += "".join(f"{t}, {i}, {0.1 * (t + 1):.3f}, {t + i / 10}\n" for t in range(4) for i in range(3))
    record = importers.read(put(text))
    np.testing.assert_allclose(record["CL"], [0.2, 1.2, 2.2, 3.2])
    assert record.provenance["clock"] == "time"


def test_a_history_says_all_its_faults(put: Callable[..., Path]) -> None:
    head = '"Time_Iter","Outer_Iter","Inner_Iter","CD"'
    rows = "0,0,1,0.2\n0,0,2,x\n0,0,3,y\n0,0,4,z\n0,0,5,0.3\n"
    other = head.replace("CD", "CL")
    with pytest.raises(InputError) as caught:
        importers.read(put(f"{head}\n{rows}{other}\n0,0,6,0.1\n", "history.csv"), "su2_history")
    assert [f.where for f in caught.value.faults] == ["7", "3:4", "4:4", "5:4"]


def test_expressions_have_their_values_and_units(put: Callable[..., Path]) -> None:
    path = put("Expression;Value\nThrust;-2.5 [kg m s^-2]\nyplus;31 []\nmassFlow = 0.5 [kg s^-1]\n", "e.csv")
    record = importers.read(path)
    assert record["thrust_N"] == -2.5 and record["yplus"] == 31.0 and record.unit("massFlow [kg s^-1]") == "kg s^-1"
    with pytest.raises(InputError) as caught:
        importers.read(put("Thrust = 2.5 [N]\na = force_z()@blade\nb = c\n", "f.csv"))
    assert [f.where for f in caught.value.faults] == ["2", "3"]


def test_other_dialects(put: Callable[..., Path]) -> None:
    rows = "".join(f"{k}, 0.1, 0.02, {k * 0.1:.1f}\n" for k in range(20))
    old = importers.read(put('"Iteration","CL","CD","Time(min)"\n' + rows))
    tecplot = importers.read(
        put('TITLE = "SU2"\nVARIABLES = "Iteration","CL","CD","Time(min)"\nZONE T= "history"\n' + rows)
    )
    for record in (old, tecplot):
        assert record.provenance["format"] == "su2_history" and record.provenance["means"]["CD"].value == pytest.approx(
            0.02
        )
        assert "Time(min)" not in record.provenance["means"]  # wall time is no result
    names = "(total_x total_y total_z)\t(pressure_x pressure_y pressure_z)\t(viscous_x viscous_y viscous_z)"
    foam = (
        "# Moment\n# Time\t"
        + names
        + "\n"
        + "".join(f"{0.1 * k:g}\t(1.5 2 3)\t(1 1 1)\t(0.5 1 2)\n" for k in range(1, 9))
    )
    assert importers.read(put(foam)).provenance["means"]["moment_viscous_z_Nm"].value == 2.0
    bare = "# Forces\n# CofR : (0 0 0)\n# Time  forces(pressure viscous)  moments(pressure viscous)\n"
    bare += "".join(f"{0.1 * k:g} ((1 0 0) (0.5 0 0)) ((0 0 1) (0 0 {k}))\n" for k in range(1, 9))
    np.testing.assert_allclose(importers.read(put(bare))["moment_total_z_Nm"], np.arange(2, 10))
    several = '"a"\n"Iteration" "a etc.."\n("Iteration" "a" "flow-time")\n'
    several += "".join(f"{k} {k} {0.01 * ((k - 1) // 5 + 1):.4f}\n" for k in range(1, 101))
    steps = importers.read(put(several))
    assert len(steps) == 20 and steps["a"][0] == 5  # the last iteration of each time step
    still = importers.read(
        put('"a"\n"i"\n("Iteration" "a" "flow-time")\n' + "".join(f"{k} 7 0\n" for k in range(1, 51)))
    )
    assert still.provenance["clock"] == "iteration" and len(still) == 50


# --- damage ----------------------------------------------------------------------------------------------------------


def _numbers(line: str) -> list[str]:
    return line.split(",") if "," in line else line.split()


def mutants(rng: random.Random) -> Iterator[tuple[str, bytes, str]]:
    """Endless damaged files: format, bytes, kind of damage."""
    texts = {form: make() for form, make in SAMPLES.items()}
    while True:
        form = rng.choice(list(texts))
        text = texts[form]
        raw = text.encode()
        kind = rng.choice(
            ["cut", "head", "bytes", "line", "column", "some", "huge", "encode", "zip", "swap", "noise", "comma"]
        )
        lines = text.splitlines(keepends=True)
        first = next((k for k, line in enumerate(lines) if re.match(r"\s*[-\d]", line)), len(lines) - 1)
        if kind == "cut":
            raw = raw[: rng.randrange(len(raw))]
        elif kind == "head":
            raw = raw[rng.randrange(min(len(raw), 400)) :]
        elif kind == "bytes":
            data = bytearray(raw)
            for _ in range(rng.randrange(1, 20)):
                data[rng.randrange(len(data))] = rng.choice(
                    (rng.randrange(256), ord(rng.choice('0123456789.eE-+,() \n\t"')))
                )
            raw = bytes(data)
        elif kind == "line":
            k = rng.randrange(len(lines))
            lines[k : k + 1] = rng.choice(
                ([], [lines[k]] * 2, [rng.choice(lines), lines[k]], ["\n"], ["garbage here\n"])
            )
            raw = "".join(lines).encode()
        elif kind in ("column", "some", "swap"):
            mark = "," if "," in lines[-2] else " "
            at = rng.randrange(12)
            for k in range(first, len(lines)):
                if kind == "some" and rng.random() < 0.7 or not re.match(r"\s*[-\d]", lines[k]):
                    continue
                cells = _numbers(lines[k].rstrip("\r\n"))
                i = at % len(cells)
                if kind == "swap" and i:
                    cells[0], cells[i] = cells[i], cells[0]
                elif rng.random() < 0.5 or kind == "column":
                    del cells[i]
                else:
                    cells.insert(i, "7.5")
                lines[k] = mark.join(cells) + "\n"
            raw = "".join(lines).encode()
        elif kind == "huge":
            wild = rng.choice(
                ["1e308", "-1e308", "1e999", "NaN", "inf", "*****", "9" * 400, "1.5D+300", "0x10", "1_0", "--1", "1,5"]
            )
            found = list(re.finditer(r"-?\d+\.\d+(e[-+]\d+)?", text))
            for match in sorted(rng.sample(found, min(3, len(found))), key=lambda m: -m.start()):
                text = text[: match.start()] + wild + text[match.end() :]
            raw = text.encode()
        elif kind == "encode":
            raw = rng.choice([text.encode("utf-16"), text.encode("utf-16-be"), text.encode("utf-32"), b"\xff\xfe" + raw,
                              text.replace("thrust", "poussée°").encode("latin-1"), raw.replace(b"\n", b"\r")])  # fmt: skip
        elif kind == "zip":
            packed = gzip.compress(raw)
            raw = rng.choice([packed, packed[: rng.randrange(len(packed))], packed[:10] + raw])
        elif kind == "noise":
            raw = rng.randbytes(rng.randrange(400)) + raw[rng.randrange(len(raw)) :]
        elif kind == "comma":
            raw = re.sub(rb"(\d)\.(\d)", rb"\1,\2", raw, count=rng.choice([0, 1, 5]))
        yield form, raw, kind


EXACT = {"cut", "line", "column", "some", "zip", "encode"}
"""Damage that changes no digits: what comes out under a name must be values of that name."""


def check(form: str, raw: bytes, kind: str, path: Path, truth: dict[str, Dataset]) -> str:
    path.write_bytes(raw)
    (file,) = import_files([path], choice=None).document()["files"]
    if file["error"] is not None:
        assert file["error"].strip() and not file["channels"]
        return "refused"
    for channel in file["channels"].values():
        assert channel["mean"] is None or np.isfinite(channel["mean"])
    if file["format"] != form.split(":")[0]:
        return "other"
    record = import_file(path)
    known = truth[form]
    spoken = set(record.notes) - set(known.notes)
    if kind in EXACT:
        for name, values in record.values.items():
            if name not in known.values:
                assert spoken or "°" in name, (name, kind)
                continue
            strange = set(values[np.isfinite(values)]) - set(known[name])
            assert not strange or any("may be cut" in w for w in spoken), (
                form, kind, name, sorted(strange)[:5], record.notes,
            )  # fmt: skip
    return "read"


def attack(count: int, seed: int, path: Path) -> dict[str, int]:
    truth = {}
    for form, make in SAMPLES.items():
        path.write_text(make(), newline="")
        truth[form] = import_file(path)
    rng = random.Random(seed)
    outcome: dict[str, int] = {}
    source = mutants(rng)
    for k in range(count):
        form, raw, kind = next(source)
        try:
            told = check(form, raw, kind, path, truth)
        except Exception as error:
            raise AssertionError(f"mutant {k} of seed {seed}: {form}, {kind}: {raw[:2000]!r}") from error
        outcome[told] = outcome.get(told, 0) + 1
    return outcome


def test_300_damaged_files(tmp_path: Path) -> None:
    outcome = attack(300, 3, tmp_path / "mutant")
    assert outcome["read"] > 50 and outcome["refused"] > 50


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_20000_damaged_files(tmp_path: Path, seed: int) -> None:
    attack(2000, 1000 + seed, tmp_path / "mutant")


# --- the published samples -------------------------------------------------------------------------------------------


REFUSED = {
    "SOURCES.md": "a text without a table", "LICENSE": "a text without a table", "laminar_cylinder.cas": "a Fluent case file",
    "laminar_cylinder.dat": "a Fluent data file", "PPTC_VP1304_CFD_report.md": "a text without a table",
    "FFF.6.set": "solver settings of Fluent", "yPlus.dat": "y+ of walls", "probes_U": "values at probes", "axial-velocity-mesh-1.xy": "a Fluent XY plot",
    "axial-velocity-mesh-2.xy": "a Fluent XY plot", "FFT_1": "a Fluent XY plot",
}  # fmt: skip


def test_every_published_sample_is_read_or_refused_with_the_reason(shared_data: Path) -> None:
    files = [path for path in sorted((shared_data / "cfd_exports").rglob("*")) if path.is_file()]
    assert len(files) >= 30
    for file in import_files(files).document()["files"]:
        reason = REFUSED.get(Path(file["path"]).name)
        if reason is None:
            assert file["error"] is None and file["rows"] > 0 and file["channels"], file["path"]
        else:
            assert reason in file["error"], file["path"]


def test_si_units_only_when_stated() -> None:
    assert cfd.si_unit("[N m]") == "Nm" and cfd.si_unit("dyn") is None
    names = cfd.unique(["a", "a", "a#2", "a"])
    assert len(set(names)) == 4 and names[0] == "a"
