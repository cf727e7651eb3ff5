"""Loads along the blade name the effect that brings them back."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bemt.judge.diagnose import along_blade
from bemt.judge.diagnose.along_blade import EXPLAINED, BladeLoads, along, compare_along, read_blade_loads
from bemt.physics.air import Air
from bemt.physics.bem import solver
from bemt.physics.bem.model import Model
from bemt.rotors.case import Case, load_case
from bemt.rotors.case.prepare import prepare_case
from bemt.tools.cfd.schema import load_campaign

AIR = Air.from_density(1.225)


def fan(project: Path, folder: Path, model: str = "") -> Case:
    """DS-30 without its stator, as our CFD has it."""
    text = (project / "cases" / "ds30" / "case.toml").read_text()
    text = text[: text.index("[[assumptions]]")].replace('references = "references.csv"\n', "")
    text = text[: text.index("[duct.stator]")] + text[text.index("[operating]") :]
    folder.mkdir(exist_ok=True)
    (folder / "case.toml").write_text(text.replace("[model]", f"[model]\n{model}"))
    return load_case(folder / "case.toml")


def loads(model: Model, noise: float = 0.0) -> BladeLoads:
    """What a rotor carries, as a recording."""
    s = solver.solve(model.prep, 55000.0, 0.0, AIR, radial=True)
    dr = model.prep.st[:, 1]
    r = np.broadcast_to(s.radial.r, (1, dr.size))[0]
    wobble = 1.0 + noise * np.random.default_rng(3).standard_normal((2, dr.size))
    return BladeLoads("made", r, s.radial.dT[0] / dr * wobble[0], s.radial.dQ[0] / dr * wobble[1])


def test_a_rotor_beside_itself_needs_no_explanation(project: Path, tmp_path: Path) -> None:
    model = prepare_case(fan(project, tmp_path))
    found = compare_along(model, loads(model), 55000.0, 0.0, AIR)
    assert found.thrust == pytest.approx(1.0, abs=1e-9) and found.torque == pytest.approx(1.0, abs=1e-9)
    assert found.named == ()


def test_the_row_is_found_along_the_blade(project: Path, tmp_path: Path) -> None:
    truth = loads(prepare_case(fan(project, tmp_path / "whole")), noise=0.02)
    bare = prepare_case(fan(project, tmp_path / "bare", 'effects_off = ["cascade"]'))
    found = compare_along(bare, truth, 55000.0, 0.0, AIR)
    assert found.named[0] == "cascade"
    assert next(iter(found.left.values())) < 0.05


@pytest.mark.parametrize(
    ("old", "sure"),
    [
        pytest.param('effects_on = ["cascade(zero_lift=0.0)"]', 1, marks=pytest.mark.slow),
        ('effects_off = ["cascade"]', 2),
    ],
)
def test_our_cfd_names_a_class_with_the_row(project: Path, tmp_path: Path, old: str, sure: int) -> None:
    """The single section's zero-lift angle alone looks much like a wider exit, which one of two sectors prefers."""
    path = project / "reports" / "cfd" / "ds30" / "radial.csv"
    runs = along(fan(project, tmp_path, old), path)
    assert len(runs) == 2  # the sector that leaks at its sides, and the mended one
    assert all(found.left["cascade"] < EXPLAINED for found in runs.values())
    assert sum("cascade" in found.named for found in runs.values()) >= sure


def test_our_cfd_beside_its_own_row_names_nothing(project: Path, tmp_path: Path) -> None:
    runs = along(fan(project, tmp_path), project / "reports" / "cfd" / "ds30" / "radial.csv")
    assert runs and all(now.named == () for now in runs.values())


def test_what_lies_within_the_recordings_own_uncertainty_is_not_named(project: Path, tmp_path: Path) -> None:
    truth = loads(prepare_case(fan(project, tmp_path / "whole")), noise=0.02)
    bare = prepare_case(fan(project, tmp_path / "bare", 'effects_off = ["cascade"]'))
    for u, named in ((0.05, True), (0.5, False)):
        found = compare_along(bare, replace(truth, u=(u, u)), 55000.0, 0.0, AIR)
        assert bool(found.named) == found.beyond == named, found.text()


TRUE = {"prop_8x5_pipe": {"duct"}, "prop_8x5_duct": {"duct"}, "prop_8x5_pitch": {"pitch_offset"}}


@pytest.fixture(scope="module")
def named(project: Path) -> list[tuple[str, set[str], set[str]]]:
    """Every converged run beside its case, with or without effects of the Mach number: run, named and true causes."""
    told = []
    for path in sorted((project / "reports" / "cfd").glob("*/radial.csv")):
        campaign = load_campaign(path.with_name("campaign.toml"))
        with path.with_name("recording.csv").open(encoding="utf-8") as stream:
            solver_of = {row["run"]: row["solver"] for row in csv.DictReader(stream)}
        solver_of["e9d7473b3a56"] = "compressible"  # the DS-30 that leaked: its loads stay, its row is gone
        for solved, off in (("compressible", []), ("incompressible", ["compressibility", "drag_divergence"])):
            case = campaign.case.replaced({"model.effects_off": off})
            for run, found in along(case, path).items():
                if solver_of[run] == solved:
                    true = TRUE.get(path.parent.name, set())
                    told.append((f"{path.parent.name} {run}", set(found.named), true))
    return told


@pytest.mark.slow
def test_our_campaigns_name_the_cause_among_what_looks_alike(named: list[tuple[str, set[str], set[str]]]) -> None:
    assert not [one for one in named if one[1] and not one[1] & one[2]]


@pytest.mark.slow
@pytest.mark.xfail(strict=True, reason="the turned blade is named with the section, which looks alike")
def test_our_campaigns_name_nothing_wrong(named: list[tuple[str, set[str], set[str]]]) -> None:
    assert not [one for one in named if not one[1] <= one[2]]


@pytest.fixture
def no_causes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Causes, which take most of the time, are not asked for."""
    monkeypatch.setattr(along_blade, "_candidates", lambda _: [])


@pytest.mark.usefixtures("no_causes")
def test_the_sign_of_a_torque_along_the_blade_is_the_sense_of_rotation(tmp_path: Path) -> None:
    case = load_case(Path(__file__).parents[1] / "cases" / "prop_8x5" / "case.toml")
    r = np.linspace(0.02, 0.1, 9)
    for name, sign in (("right", 1.0), ("left", -1.0)):
        rows = "".join(f"a,{x},{300.0 * x},{sign * 5.0 * x}\n" for x in r)
        (tmp_path / f"{name}.csv").write_text("run,r_m,thrust_per_radius_N_m,torque_per_radius_Nm_m\n" + rows)
    right, left = (along(case, tmp_path / f"{name}.csv")["a"] for name in ("right", "left"))
    assert np.array_equal(right.torque, left.torque) and "nan" not in left.text()


def test_a_file_without_its_columns_is_refused(tmp_path: Path) -> None:
    from bemt.base.errors import InputError

    (tmp_path / "radial.csv").write_text("run,r_m\na,0.1\n")
    with pytest.raises(InputError, match="thrust_per_radius_N_m"):
        read_blade_loads(tmp_path / "radial.csv")


@pytest.mark.usefixtures("no_causes")
def test_loads_beside_too_few_readings_are_read_and_shown(project: Path, tmp_path: Path) -> None:
    import bemt
    from bemt.base.errors import InputError

    (tmp_path / "one.csv").write_text("rpm,thrust_N\n6000,5\n")
    case = fan(project, tmp_path / "fan")
    given = {"case": case.path.parent, "airspeed_m_s": 0.0}
    with pytest.raises(InputError, match="none.csv"):
        bemt.diagnose(tmp_path / "one.csv", along=tmp_path / "none.csv", **given)
    lines = [f"a,6000,0,1.2,{r:g},1.0,0.01" for r in np.linspace(0.006, 0.014, 9)]
    head = "run,rpm,airspeed_m_s,density_kg_m3,r_m,thrust_per_radius_N_m,torque_per_radius_Nm_m"
    (tmp_path / "radial.csv").write_text("\n".join([head, *lines]) + "\n")
    found = bemt.diagnose(tmp_path / "one.csv", along=tmp_path / "radial.csv", **given)
    assert found.verdict == "insufficient" and "a" in found.to_dict()["along_blade"] and "0.84-0.95 R" in found.text


def slices(tmp_path: Path, name: str, head: str, scale: float, columns: tuple[np.ndarray, ...]) -> Path:
    rows = "".join(f"{r * scale:.9g},{T:.9g},{Q:.9g}\n" for r, T, Q in zip(*columns, strict=True))
    (tmp_path / name).write_text(f"{head}\n{rows}")
    return tmp_path / name


def test_slices_are_compared_at_the_speed_of_the_recording(tmp_path: Path) -> None:
    """Made by the model at 6000 rev/min: at the case's own speed they would name a cause that is none."""
    import bemt
    from bemt.base.errors import InputError

    case = bemt.propeller("10x5", rpm=9000).case
    model = prepare_case(case)
    s = solver.solve(model.prep, 6000.0, 0.0, case.air(), radial=True)
    dr = model.prep.st[:, 1]
    made = np.broadcast_to(s.radial.r, (1, dr.size))[0], s.radial.dT[0] / dr, s.radial.dQ[0] / dr
    whole = [float(np.trapezoid(v, made[0])) for v in made[1:]]
    run = tmp_path / "run.csv"
    run.write_text(f"rpm,airspeed_m_s,thrust_N,torque_Nm,cells\n6000,0,{whole[0]},{whole[1]},1e6\n")
    path = slices(tmp_path, "s.csv", "r [mm],dT/dr [N/m],dQ/dr [N m/m]", 1e3, made)
    found = bemt.diagnose(run, case, along=path)
    (told,) = found.to_dict()["along_blade"].values()
    assert "at 6000 rev/min" in told["state"] and not told["whole"] and not told["named"]
    assert np.allclose(told["thrust_ratio"], 1.0, atol=0.01)
    over = made[0] / model.rotor.R
    ratio = slices(tmp_path, "ratio.csv", "r/R,dT/dr [N/m],dQ/dr [N m/m]", 1.0, (over, *made[1:]))
    plot = tmp_path / "plot.xy"
    curves = ("\n".join(f"{x:.9g}\t{y:.9g}" for x, y in zip(over, v, strict=True)) for v in made[1:])
    keys = ("dT/dr [N/m]", "dQ/dr [N m/m]")
    text = "".join(f'((xy/key/label "{k}")\n{c}\n)\n\n' for k, c in zip(keys, curves, strict=True))
    plot.write_text(f'(title "loads")\n(labels "r/R" "per radius")\n\n{text}')
    for other in (ratio, plot):
        (same,) = bemt.diagnose(run, case, along=other).to_dict()["along_blade"].values()
        assert np.allclose(same["thrust_ratio"], told["thrust_ratio"], rtol=1e-6) and same["whole"] == told["whole"]
    plot.write_text(f'(title "v")\n(labels "Position" "Axial Velocity")\n\n{text}'.replace(keys[0], "inlet"))
    with pytest.raises(InputError, match="a Fluent XY plot of 'Axial Velocity' over 'Position', curves 'inlet'"):
        bemt.diagnose(run, case, along=plot)
    (told,) = bemt.diagnose(run, case, along=path, rpm=6500).to_dict()["along_blade"].values()
    assert "at 6500 rev/min" in told["state"] and min(told["thrust_ratio"]) > 1.1
    assert "readings are at 6000 rev/min" in told["state"]  # two speeds: both are said
    one = slices(tmp_path, "one.csv", "r [mm],dT/dr [N/m],dQ/dr [N m/m]", 1e3, (made[0], made[1] / 2, made[2] / 2))
    (told,) = bemt.diagnose(run, case, along=one).to_dict()["along_blade"].values()
    assert "are they of all blades" in told["whole"] and not told["named"]
    inner = (over > 0.45) & (over < 0.92)  # neither the hub nor the tip is reached
    for times in (1.0, 0.5):
        short = slices(tmp_path, "short.csv", "r [mm],dT/dr [N/m],dQ/dr [N m/m]", 1e3,
                       (made[0][inner], times * made[1][inner], times * made[2][inner]))  # fmt: skip
        (told,) = bemt.diagnose(run, case, along=short).to_dict()["along_blade"].values()
        assert bool(told["whole"]) == (times < 1.0)
    with pytest.raises(InputError, match="mm in a column of m"):
        along(case, slices(tmp_path, "mm.csv", "r_m,thrust_per_radius_N_m,torque_per_radius_Nm_m", 1e3, made))
    with pytest.raises(InputError, match=r"dT/dr: got no unit"):
        along(case, slices(tmp_path, "bare.csv", "r [m],dT/dr,dQ/dr [N]", 1.0, made))
    run.write_text("rpm,airspeed_m_s,thrust_N,torque_Nm\n" + "".join(f"{n},0,5,0.1\n" for n in (5000, 6000, 7000)))
    with pytest.raises(InputError, match="slices without a speed, and 3 readings at 5000 to 7000 rev/min"):
        bemt.diagnose(run, case, along=path)


@pytest.mark.parametrize("angle", ["alpha_deg", "Alpha (deg)"])
@pytest.mark.parametrize("loads", ['"Thrust per unit span (N/m)","Torque per unit span (N)"',
                                   '"Thrust per Length (N/m)","Torque per Length (N-m/m)"'])  # fmt: skip
def test_a_table_of_slices_is_known_as_one(tmp_path: Path, angle: str, loads: str) -> None:
    from bemt.data.recordings.load import import_file

    rows = "".join(f"{x},{0.1 * x},0.02,{8 - 4 * x},1.1,0.03,0.1,{100 * x},{2 * x}\n" for x in (0.2, 0.6, 1.0))
    head = f'"r/R","Radius (m)","Chord (m)","{angle}","Cl","Cd","Mach",{loads}'
    (tmp_path / "slices.csv").write_text(f"{head}\n{rows}")
    found = import_file(tmp_path / "slices.csv")
    assert found.format == "slices" and any(n.startswith("slices: 4.8 N and 0.096 N m") for n in found.notes)
    (read,) = read_blade_loads(tmp_path / "slices.csv").values()
    assert read.thrust.tolist() == [20.0, 60.0, 100.0] and read.torque.tolist() == [0.4, 1.2, 2.0]


def test_slices_without_loads_per_radius_are_no_polar(tmp_path: Path) -> None:
    from bemt.base.errors import InputError
    from bemt.data.recordings.load import import_file

    (tmp_path / "s.csv").write_text("r_m,chord_m,alpha_deg,cl,cd,Fz_N\n0.02,0.02,6,0.7,0.02,0.1\n")
    with pytest.raises(InputError) as caught:
        import_file(tmp_path / "s.csv")
    assert len(caught.value.faults) == 1 and "thrust_per_radius" in str(caught.value)
