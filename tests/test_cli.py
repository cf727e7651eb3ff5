"""Promise: the command line answers fast, results on stdout, honest exit codes."""

from __future__ import annotations

import inspect
import io
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import chdir, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import bemt as package
from bemt import __version__
from bemt.app import cli, registry
from bemt.app.face import PROGRESS, nothing_empty, parameters, parser_of
from bemt.base.action import Told, about, did_you_mean
from bemt.base.errors import Fault, InputError
from bemt.base.units import split_suffix
from geometry.common import needs as geometry_needs

ROOT = Path(__file__).resolve().parents[1]
MALFORMED = ROOT / "tests" / "malformed"


class Done(NamedTuple):
    """Outcome of a command line."""

    returncode: int
    stdout: str
    stderr: str


def bemt(*arguments: str, cwd: Path = ROOT) -> Done:
    """Run the command line in a folder."""
    with chdir(cwd), redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        code = ended([*arguments])
    return Done(code, out.getvalue(), err.getvalue())


def ended(arguments: list[str]) -> int:
    """Exit code of a command line, however it ends."""
    try:
        return cli.main(arguments)
    except SystemExit as stop:
        return int(stop.code or 0)


def stub(monkeypatch: pytest.MonkeyPatch, command: str, do: Callable[[dict[str, object]], object]) -> None:
    """Put another function behind a command, with the declaration of its own."""
    real = registry.find(command)

    def fake(**given: object) -> object:
        return do(given)

    for name, value in (("__signature__", inspect.signature(real)), ("__doc__", real.__doc__),
                        ("about", real.about), ("__annotations__", inspect.unwrap(real).__annotations__)):  # type: ignore[attr-defined]  # fmt: skip
        setattr(fake, name, value)
    monkeypatch.setattr(registry, "find", lambda name: fake if name == command else real)


def test_help_is_fast_and_names_every_command() -> None:
    """A tenth of a second of CPU, whatever else the machine does."""

    def cpu(*command: str) -> float:
        resource = pytest.importorskip("resource")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([sys.executable, *command], cwd=ROOT, capture_output=True, text=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert command == ("-c", "") or all(name in done.stdout for name in ("sweep", "report", "diagnose"))
        return float(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)

    python = min(cpu("-c", "") for _ in range(5))
    assert min(cpu("-m", "bemt", "--help") for _ in range(5)) - python < 0.1


def test_importing_the_command_line_imports_nothing_heavy() -> None:
    code = "import sys, bemt.app.cli; bemt.app.cli.help_text(); print(*sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = {name.split(".")[0] for name in done.stdout.split()}
    assert not loaded & {
        "numpy", "scipy", "numba", "pandas", "neuralfoil", "matplotlib", "cadquery", "trimesh", "geometry",
    }  # fmt: skip


ACTIONS = sorted(registry.homes())


@pytest.mark.parametrize("command", ACTIONS)
def test_both_doors_have_the_same_words(command: str) -> None:
    """Every parameter is an option or a bare word, every one is explained, and the library has the action."""
    function = registry.find(command)
    found = {p.name: p for p in parameters(function)}
    own = set(inspect.signature(function).parameters) - {PROGRESS}
    assert own == set(found) and all(p.help for p in found.values())
    options = {action.dest for action in parser_of(function, everything=True)._actions}
    assert own == options - {"json", "quiet", "details", "help", "help_all"}
    assert getattr(package, registry.python_name(command)) is function
    name, given = cli.parsed(about(function).example.split())
    assert name == command and set(given) <= own, "the example parses"


def test_points_of_a_design_are_words() -> None:
    """A parameter that takes text is never read as a number."""
    words = ["thrust=6,airspeed=15", "thrust=4,airspeed=20,rpm=7000,weight=2"]
    assert cli.parsed(["design", "--points", *words])[1] == {"points": words}


def test_the_commands_that_are_shown_are_few(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 0
    shown = capsys.readouterr().out
    assert len(registry.ORDER) == 14 and set(registry.ORDER) <= set(ACTIONS)
    assert all(f"  {name} " in shown for name in registry.ORDER)
    assert cli.main(["lab"]) == 0
    rest = capsys.readouterr().out
    assert all(f"  {name} " in rest for name in set(ACTIONS) - set(registry.ORDER))


@pytest.mark.parametrize("command", ACTIONS)
def test_help_shows_eight_options_at_most_and_help_all_every_one(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    function = registry.find(command)
    told = about(function)
    assert len([p for p in parameters(function) if p.name in told.common and p.name not in told.words]) <= 8
    for option in ("--help", "--help-all"):
        with suppress(SystemExit):
            cli.main([command, option])
    short, _, whole = capsys.readouterr().out.rpartition("usage:")
    assert all(p.option in whole for p in parameters(function) if p.name not in told.words)
    assert len(short) <= len(whole) + 10


def test_an_old_name_answers_and_names_the_new_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.parsed(["estimate", "10x5", "--rpm", "6000", "--airspeed", "5"])[1]["airspeed_m_s"] == [5.0]
    assert capsys.readouterr().err == "estimate: --airspeed is now --airspeed-m-s\n"


def test_both_doors_take_a_quantity_in_another_unit_that_its_suffix_names() -> None:
    for words in (["--airspeed-km-h", "18", "36"], ["--airspeed-km-h=18", "36", "--json"]):
        given = cli.parsed(["estimate", "10x5", "--rpm", "6000", *words])[1]
        assert given["airspeed_m_s"] == pytest.approx([5.0, 10.0], rel=1e-12) and given["rpm"] == [6000.0]
    rotor = package.propeller("10x5")
    other = rotor.solve(rpm=6000, airspeed_km_h=[18.0, 36.0])  # type: ignore[call-arg]
    assert np.allclose(other.thrust_N, rotor.solve(rpm=6000, airspeed_m_s=[5.0, 10.0]).thrust_N, rtol=1e-12)
    with pytest.raises(TypeError, match="airspeed_kg"):
        rotor.solve(rpm=6000, airspeed_kg=3.0)  # type: ignore[call-arg]


def test_a_converted_quantity_is_stated_below_the_answer(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["estimate", "10x5", "--rpm", "6000", "--airspeed-km-h", "30", "36"]) == 0
    stated = re.findall(r"--airspeed-km-h (\S+) is --airspeed-m-s (\S+)", capsys.readouterr().out)
    assert [(float(a), float(b)) for a, b in stated] == [(30, pytest.approx(30 / 3.6, rel=1e-5)), (36, 10)]
    assert cli.main(["estimate", "10x5", "--rpm", "6000", "--airspeed-m-s", "10"]) == 0
    assert " is --" not in capsys.readouterr().out


@pytest.mark.parametrize("name", sorted(registry.homes()))
def test_a_unit_alone_makes_no_option_near(name: str) -> None:
    options = [one.option for one in parameters(registry.find(name))]
    units = {split_suffix(one[2:].replace("-", "_"))[1] for one in options} - {None}
    for unit in units:
        suffix = unit.suffix.replace("_", "-")
        assert did_you_mean(f"--zzqx-{suffix}", options) == ""
    for one in options:
        stem, unit = split_suffix(one[2:].replace("-", "_"))
        if unit is not None and len(stem) > 4:
            other = "deg" if unit.dimension != "angle" else "kg"
            assert stem.replace("_", "-") in did_you_mean(f"--{stem[1:]}-{other}".replace("_", "-"), options)


def test_a_wrong_keyword_is_answered_with_the_right_one() -> None:
    with pytest.raises(TypeError, match=r"solve\(\) got 'airspeed'. Did you mean airspeed_m_s\?"):
        package.propeller("10x5").solve(rpm=6000, airspeed=5.0)  # type: ignore[call-arg]


def test_version() -> None:
    command = [sys.executable, "-m", "bemt", "--version"]
    assert subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout.strip() == f"bemt {__version__}"


WRONG = [
    (["swep", "cases"], "Did you mean sweep?"),
    (["sweep", "cases", "--tolerence-pct", "3"], "Did you mean --tolerance-pct?"),
    (["diagnose", "a.csv", "--baseline", "bemr"], "Did you mean bemt?"),
    (["sweep", "cases", "--engine", "loca"], "Did you mean local?"),
    (["validate"], "--folders: got none; expected one or more."),
    (["fetch"], "the following arguments are required: KIND."),
    (["plan", "c", "--case", "a", "--case", "b"], "argument --case: got it twice; expected it once"),
    (["estimate", "8x5", "--rpm", "5000", "--chord", "3"], "unrecognized arguments: --chord 3"),
    (["estimate", "10x5", "--rmp", "6000"], "Did you mean --rpm?"),
    (["estimate", "10x5", "--rpm", "6000", "--airspeed-kmh", "30"], "Did you mean --airspeed-km-h?"),
    (["estimate", "10x5", "--rpm", "6000", "--airspeed-furlong", "30"], "Did you mean --airspeed-m-s?"),
    (["new", "10x5", "--pitch-in", "5"], "--pitch-in 5. The pitch is in the label"),
    (
        ["estimate", "10x4.5", "--kv", "920", "--cells", "3"],
        "required: --rpm. Got --kv, --cells. With a motor and a battery: bemt drive 10x4.5 --kv 920 --cells 3.",
    ),
    (["drive", "70mm", "--fan", "--blades", "11"], "--fan: A fan is a case: bemt new 70mm --fan --blades 11, then"),
    (["diagnose", "a.csv", "--case", "c", "--temperature-C", "12"], "State --density-kg-m3 1.19, or temperature_C"),
    (["compare", "a.csv", "b.csv", "--density-kg-m3", "1.2"], "Each run has its own: --air-a 1.19kg/m3,5m/s."),
    (["estimate", "10x5", "--rpm", "6k"], "--rpm: got 6k; expected a number, without its unit"),
    (["estimate", "cases", "--rpm", "6000"], "bemt sweep cases"),
    (["new", "10x5", "--kv", "2300", "--cells", "33"], "--kv, --cells: got 2300 rev/min/V on 33 cells"),
    (["sweep", "cases", "--tolerance-pct", "nan"], "got nan; expected a finite number of 0 or more"),
    (["sweep", "cases", "--tolerance-pct", "3"], "--tolerance-pct: got 3; expected --strict"),
    (["sweep", "cases", "--tolerance-pct", "few"], "--tolerance-pct: got few; expected a number, without its unit"),
    (["sweep", "cases", "--jobs", "two"], "--jobs: got two; expected a whole number"),
    (["sweep", "cases", "--jobs", "0"], "--jobs: got 0; expected a whole number of 1 or more"),
    (["prove", "--seed", "-1"], "got -1; expected a whole number of 0 or more"),
    (["prove", "--seed", "x"], "--seed: got x; expected a whole number"),
]


@pytest.mark.parametrize(("arguments", "words"), WRONG, ids=lambda a: " ".join(a) if isinstance(a, list) else "")
def test_wrong_usage_is_2_and_named_as_it_was_typed(arguments: list[str], words: str) -> None:
    """Nothing is guessed or dropped: a last one that wins, half a name that loses its unit are not what was meant."""
    done = bemt(*arguments)
    assert done.returncode == 2 and done.stdout == "" and words in " ".join(done.stderr.split())


def test_results_do_not_go_among_the_files_of_a_case(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(ROOT / "cases" / "prop_8x5", tmp_path / "prop_8x5")
    before = sorted((tmp_path / "prop_8x5").iterdir())
    assert cli.main(["sweep", str(tmp_path), "--out", str(tmp_path), "--quiet"]) == 2
    assert "--out: got the folder of the case prop_8x5 itself" in capsys.readouterr().err
    assert sorted((tmp_path / "prop_8x5").iterdir()) == before


@pytest.mark.parametrize("command", [["validate", "x"], ["drive", "cases/ds30"], ["estimate", "8x5", "--rpm", "5000"]])
def test_trouble_with_files_is_an_input_fault(
    command: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(_: object) -> object:
        raise OSError(28, "No space left on device", "out/table.txt")

    stub(monkeypatch, command[0], full)
    assert cli.main(command) == 2
    assert capsys.readouterr().err == (
        "out/table.txt: got No space left on device; expected a file or folder that can be used.\n"
    )


def test_a_sweep_without_cases_takes_those_of_this_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["sweep"]) == 2 and "no case" in capsys.readouterr().err
    assert cli.main(["new", "10x5"]) == 0 and cli.main(["sweep"]) == 0
    assert "prop_10x5" in capsys.readouterr().out


def test_another_package_of_the_name_geometry_is_named(tmp_path: Path) -> None:
    (tmp_path / "geometry.py").write_text("")
    env = {**os.environ, "PYTHONPATH": os.pathsep.join((str(tmp_path), str(ROOT)))}
    command = [sys.executable, "-m", "bemt", "sweep", str(ROOT / "cases" / "prop_8x5")]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=600)
    assert done.returncode == 2 and str(tmp_path / "geometry.py") in done.stderr, done.stderr


def test_a_library_that_fails_is_no_fault_of_the_input(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Shared libraries that are missing come as OSError, too: their words must be seen."""

    def broken(_: object) -> object:
        raise OSError("libGL.so.1: cannot open shared object file")

    stub(monkeypatch, "validate", broken)
    assert cli.main(["validate", "x"]) == 3
    assert "libGL.so.1: cannot open shared object file" in capsys.readouterr().err


def test_json_is_utf_8_whatever_the_terminal_is() -> None:
    env = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "latin-1"}
    done = subprocess.run([sys.executable, "-m", "bemt", "effects", "--json"], cwd=ROOT, env=env, capture_output=True)
    assert json.loads(done.stdout.decode("utf-8"))["schema"] == "bemt.effects/1"


@pytest.mark.parametrize(
    ("outcome", "code", "words"),
    [
        (None, 0, ""),
        (1, 1, ""),
        (InputError([Fault("a", "b", "1", "2"), Fault("a", "c", "3", "4")]), 2, "a: b: got 1; expected 2.\na: c: "),
        (ZeroDivisionError("boom"), 3, "internal error"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_exit_code_follows_the_outcome(
    outcome: object, code: int, words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(args: object) -> object:
        if isinstance(outcome, BaseException):
            raise outcome
        return Told({}, "", exit_code=outcome or 0)  # type: ignore[arg-type]

    stub(monkeypatch, "effects", run)
    assert cli.main(["effects"]) == code
    shown = capsys.readouterr()
    assert words in shown.err and shown.out == ""


def test_bad_case_is_2_with_every_message_on_stderr() -> None:
    done = bemt("sweep", "many_faults.toml", "--quiet", cwd=MALFORMED)
    assert done.returncode == 2
    assert done.stdout == ""
    announced = [
        line[3:] for line in (MALFORMED / "many_faults.toml").read_text().splitlines() if line.startswith("#! ")
    ]
    assert done.stderr.splitlines() == announced


def test_missing_path_is_2() -> None:
    done = bemt("sweep", "no/such/folder")
    assert done.returncode == 2
    assert done.stderr == (
        "no/such/folder: got no such file or folder; expected a case file or a folder of cases. Check the path.\n"
    )


def test_folder_of_results_that_is_a_file_is_2(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    done = bemt("sweep", str(ROOT / "cases"), "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    assert done.stderr.startswith(
        f"--out: got {tmp_path / 'out'}, a file; expected a folder. sweep writes files into it"
    )


@pytest.mark.parametrize(
    "arguments",
    [["validate", "uiuc", "--out"], ["calibrate", "--out"], ["prove", "--out"], ["export", "case", "--out"],
     ["diagnose", "log.csv", "--case", "case", "--out"], ["cfd", "campaign", "--work"], ["fetch", "uiuc", "--out"]],
    ids=lambda a: a[0],
)  # fmt: skip
@pytest.mark.parametrize("below", ["", "/deeper/still"])
def test_a_file_for_a_folder_is_refused_before_any_work(
    arguments: list[str],
    below: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    begun: list[str] = []

    def begin(_: object) -> object:
        begun.append(arguments[0])
        return Told({}, "")

    stub(monkeypatch, arguments[0], begin)
    file = tmp_path / "file"
    file.write_text("")
    assert cli.main([*arguments, f"{file}{below}"]) == 2
    assert not begun
    assert capsys.readouterr().err.startswith(f"{arguments[-1]}: got {file}, a file; expected a folder. ")
    assert cli.main([*arguments, str(tmp_path / "new.STL")]) == 2
    assert not begun
    assert f"give {tmp_path / 'new'}" in capsys.readouterr().err, "a folder that is called prop.stl helps nobody"
    (tmp_path / "old.csv").mkdir()
    assert cli.main([*arguments, str(tmp_path / "old.csv")]) == 0, "a folder that is there may have any name"
    assert cli.main([*arguments, str(tmp_path / "new" / "folder")]) == 0
    assert begun


@pytest.mark.parametrize("command", ["thrusters", "motor", "cfd"])
def test_a_missing_file_is_not_called_a_case_file_where_none_is_wanted(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([command, str(tmp_path / "absent.toml")]) == 2
    words = "absent.toml: got no such file; expected a TOML file. Check the path."
    assert capsys.readouterr().err == f"{tmp_path}/{words}\n"


def test_reader_that_goes_away_is_no_error() -> None:
    # `| head -1` closes the pipe while the table is being written
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = f"{sys.executable} -m bemt sweep {MALFORMED}/number_is_nan.toml --json | head -c 1"
    done = subprocess.run(command, shell=True, env=env, capture_output=True, text=True, timeout=600)
    assert done.stdout == "{"
    assert "Traceback" not in done.stderr


def test_json_of_a_bad_case_is_still_a_document() -> None:
    done = bemt("sweep", "number_is_nan.toml", "--json", cwd=MALFORMED)
    document = json.loads(done.stdout)
    assert done.returncode == document["exit_code"] == 2
    assert document["schema"] == "bemt.sweep/1"
    assert document["cases"][0]["rows"] == []
    assert document["cases"][0]["faults"] == [
        "number_is_nan.toml: operating.rpm: got nan; expected a number from 10 to 300000 rev/min."
    ]


class Terminal(io.StringIO):
    """A stream that somebody watches."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("stream", "variables", "coloured"),
    [
        (Terminal, {}, True),
        (Terminal, {"NO_COLOR": "1"}, False),
        (Terminal, {"TERM": "dumb"}, False),
        (io.StringIO, {}, False),
    ],
)
def test_colour_is_for_terminals_and_verdicts(
    stream: type[io.StringIO],
    variables: dict[str, str],
    coloured: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("NO_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    out, err = stream(), stream()
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", err)
    log = tmp_path / "l.csv"
    log.write_text("rpm,thrust_N\n4000,-1.1\n6000,2.4\n8000,4.3\n9000,5.4\n")
    assert cli.main(["import", str(log)]) == 0 and cli.main(["sweep", str(tmp_path / "none")]) == 2
    assert (sys.stdout, sys.stderr) == (out, err)
    for text in (out.getvalue(), err.getvalue()):
        assert ("\x1b[3" in text) is coloured
    assert "\x1b[31m  ! error:\x1b[0m" in out.getvalue() or not coloured


def test_an_interrupted_command_leaves_no_empty_folder(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), nothing_empty(tmp_path / "new" / "out"):
        (tmp_path / "new" / "out" / "case").mkdir(parents=True)
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


def test_ctrl_c_waits_for_a_library_that_is_loading(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compiled libraries turn an interrupt into an ImportError, or crash."""
    (tmp_path / "slow_library.py").write_text("import signal; signal.raise_signal(signal.SIGINT); whole = True")
    monkeypatch.syspath_prepend(tmp_path)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    try:
        with pytest.raises(KeyboardInterrupt):
            geometry_needs("slow_library", "cad")
    finally:
        signal.signal(signal.SIGINT, before)
    assert sys.modules["slow_library"].whole


@pytest.mark.parametrize("command", ["import", "fly", "sweep"])
def test_a_pipe_is_refused_for_what_it_is(command: str, tmp_path: Path) -> None:
    """Looking at its start takes it away: it is no empty and no damaged file."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    done = bemt(command, str(pipe))
    assert done.returncode == 2 and "got a pipe, which can be read once; expected a file" in done.stderr


def test_a_port_in_use_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("localhost", 0)) as server:
        port = server.getsockname()[1]
        assert cli.main(["ui", "--no-browser", "--port", str(port)]) == 2
    assert f"--port: got {port}, which is in use; expected a free port." in capsys.readouterr().err


def test_a_count_may_be_a_list_and_a_number_with_a_comma_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """A comma between whole counts cannot be read twice; 6,000 or 2,5 can, and is not guessed."""
    assert cli.parsed(["choose", "--thrust-N", "7", "--cells", "3", "--blades", "2,3"])[1]["blades"] == [2, 3]
    assert cli.parsed(["choose", "--thrust-N", "7", "--cells", "3", "--blades", "2", "3"])[1]["blades"] == [2, 3]
    for wrong in ("6,000", "2,5", "3000:9000"):
        with pytest.raises(SystemExit):
            cli.parsed(["estimate", "10x5", "--rpm", wrong])
        assert "spaces" in capsys.readouterr().err


@pytest.mark.parametrize("command", sorted(registry.homes()))
def test_an_old_option_names_one_that_the_command_has(command: str) -> None:
    known = {p.option for p in parameters(registry.find(command))}
    for old in registry.EVERYWHERE:
        told: list[str] = []
        words = registry.renamed(command, [old, "x"], known, told.append)
        assert words == [old, "x"] or not words[0].startswith("--") or words[0] in known


def test_a_word_that_is_no_command_of_the_laboratory_is_answered_with_those_that_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert cli.main(["lab", "nothing"]) == 2
    told = capsys.readouterr().err
    assert "cite" in told and "estimate" not in told


def test_cells_are_taken_as_people_write_them(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["drive", "10x5"], ["choose", "--thrust-N", "5", "--labels", "10x5"]):
        told = []
        for cells in ("3", "3S", "3s"):
            assert cli.main([*words, "--kv", "1000", "--cells", cells, "--json"]) == 0
            told.append(capsys.readouterr().out)
        assert told[0] == told[1] == told[2]
    assert package.drive("10x5", kv=1000, cells="3S").text == package.drive("10x5", kv=1000, cells=3).text  # type: ignore
    for cells in ("3x", "S", "3.5", "0"):
        assert ended(["drive", "10x5", "--kv", "1000", "--cells", cells]) == 2


def test_long_work_shows_that_it_goes_on_where_stderr_is_a_pipe_too(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, "SILENT_S", 0.05)
    began, seen = time.monotonic(), ""
    with registry.progress() as say:
        say("solving")
        while seen.count("solving") < 3 and time.monotonic() < began + 60.0:
            time.sleep(0.01)
            told = capsys.readouterr()
            seen += told.err
            assert not told.out
    assert seen.count("solving") >= 3 and time.monotonic() - began > 0.05 + 0.1 + 0.2, "ever more rarely"
    with registry.progress(quiet=True) as say:
        say("solving")
        time.sleep(0.2)
    assert not capsys.readouterr().err


@pytest.mark.parametrize("name", ["diagnose", "compare", "import"])
def test_what_is_stated_of_columns_has_a_help_of_its_own_each(name: str) -> None:
    told = {p.name: p.help for p in parameters(registry.find(name)) if p.name in ("unit", "column", "sign")}
    assert len(told) == 3 and all(told.values()) and len(set(told.values())) == 3
