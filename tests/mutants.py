# ruff: noqa: E501 - a table
"""Sixty small wrong changes, each of which some test must notice: ``python tests/mutants.py [WORD]`` lists survivors.

A parent loads the libraries once and forks for each mutant; the child reads one file of the tree with one text replaced
and runs the tests named beside it. The kernel is interpreted: what is compiled on the disk is that of the true text.
"""

from __future__ import annotations

import importlib
import importlib._bootstrap_external as external
import importlib.machinery
import json
import os
import resource
import sys
import time
import traceback
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
MOST_SECONDS = 90
"""CPU time of a child, after which the mutant counts as noticed: it does not end. [s]"""
WARM = ("numpy", "numpy.testing", "scipy.stats", "scipy.optimize", "scipy.interpolate", "pandas", "numba", "pydantic",
        "tomlkit", "matplotlib.figure")  # fmt: skip
INTERPRETED = {  # texts that make the kernel run as Python
    "bemt/physics/bem/kernel.py": (("self._fast = always_compile()", "self._fast = False"),
                                   ("INTERPRETED = 6000", "INTERPRETED = 10**9"),
                                   ("return bool(compiled._cache._cache_file._load_index())", "return False")),
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """A file, a text of it, what stands there instead, and the tests that must notice."""

    file: str
    text: str
    instead: str
    tests: str

    @property
    def name(self) -> str:
        return f"{self.file.removeprefix('bemt/')}: {self.text.strip()} -> {self.instead.strip()}"


K, D, E, X = "bemt/physics/bem/", "bemt/physics/bem/", "bemt/physics/effects/", "bemt/tools/exports/"
RES, KER, DUCT = f"{K}residual.py", f"{K}kernel.py", f"{D}duct.py"
PLAIN, GUARDS = "test_plain.py", "test_kernel_guards.py"
LIMITS = "test_limits.py -k disk"
FAN = "test_limits.py test_duct.py -k '(duct or swirl or f1 or stator or x22 or lip) and not oblique'"
PHYSICS = "test_effects_physics.py -k 'not oblique and not turned'"
AIR, COEFFICIENTS, UNITS = "test_air.py", "test_coefficients.py", "test_units.py"
EXPORTS = "test_exports.py -k '(nobody_fitted or what_it_can) and {}'"
RECORDINGS, CFD = "test_readers_recordings.py", "test_readers_cfd.py"
DRIVE = "test_drive_model.py -k 'not thesis and not real and not command and not fan'"

MUTANTS = (
    # kernel
    Mutant(RES, "_DESCENT = (1.0, 1.125, -1.372", "_DESCENT = (1.0, 1.125, -1.272", GUARDS),
    Mutant(RES, "_S_RING = 0.45 /", "_S_RING = 0.6 /", GUARDS),
    Mutant(RES, "dn = dp - 2.0 * c * s if far", "dn = dp + 2.0 * c * s if far", GUARDS),
    Mutant(RES, "F = Ft * Fh\n    dF = dFt * Fh + Ft * dFh\n    y = w0", "F = Ft\n    dF = dFt\n    y = w0", PLAIN),
    Mutant(RES, "cn = cl * c - cd * s\n    ct = cl * s + cd * c\n    dcn = dcl * c - cl * s - dcd * s - cd * c\n    dct = dcl * s "
           "+ cl * c + dcd * c - cd * s\n    FM", "cn = cl * c + cd * s\n    ct = cl * s + cd * c\n    dcn = dcl * c - cl * s "
           "- dcd * s - cd * c\n    dct = dcl * s + cl * c + dcd * c - cd * s\n    FM", PLAIN),
    Mutant(RES, "res = FM * across - sg4 * (cn * UT + ct * ctUP)", "res = FM * across - sg4 * cn * UT", PLAIN),
    Mutant(RES, "q2s * q * ss if far else ss * ss", "q2s * ss if far else ss * ss", GUARDS),
    Mutant(RES, "return l0 + wa * dl, d0 + wa * dd, dl * inv", "return l0 + wa * dl, d0, dl * inv", GUARDS),
    Mutant(RES, "l0 = l00 + wm * (l10 - l00)", "l0 = l00", GUARDS),
    Mutant(KER, "drag = 1.0 + w[_SG4 + k] * cd / max(X, 1e-12)", "drag = 1.0", PLAIN),
    Mutant(KER, "(cl * s + cd * c) * st[i, S_R]", "(cl * s - cd * c) * st[i, S_R]", PLAIN),
    Mutant(f"{K}oblique.py", "PITT_PETERS = 15.0 * math.pi / 32.0", "PITT_PETERS = 15.0 * math.pi / 64.0",
           "test_kernel_guards.py -k oblique"),
    # duct
    Mutant(DUCT, "bend = np.where(V > 0.0, self.bend * V / np.hypot(y, V), 0.0)", "bend = 0.0 * y", GUARDS),
    Mutant(DUCT, "T = jet - mdot * V - rho", "T = jet - rho", FAN),
    Mutant(DUCT, "wall_loss=wall_friction * 4.0 *", "wall_loss=wall_friction * 2.0 *", "test_kernel_guards.py -k duct"),
    Mutant(DUCT, "tip2 = (0.5 * (self.area / (math.pi * self.span) + self.span)) ** 2",
           "tip2 = (0.5 * (self.area / (math.pi * self.span) - self.span)) ** 2", FAN),
    Mutant(DUCT, "left = np.where(runs, 1.0 - self.stator, 0.0)", "left = np.where(runs, 1.0, 0.0)", FAN),
    Mutant(RES, "idle = 1.0 + fx[N_STREAM]\n    y = k_w", "idle = 1.0\n    y = k_w", FAN),
    Mutant(RES, "Ft = 1.0 - fx[N_GAP] * (1.0 - Ft)", "Ft = 1.0", "test_kernel_guards.py -k duct"),
    Mutant(RES, "lip * suck * suck - ram", "0.5 * lip * suck * suck - ram", "test_kernel_guards.py -k duct"),
    # effects
    Mutant(f"{E}drag_divergence.py", "self.kappa - tc - 0.1 * cl0", "self.kappa - tc", GUARDS),
    Mutant(f"{E}drag_divergence.py", "(0.1 / 80.0) ** (1.0 / 3.0)", "(0.1 / 40.0) ** (1.0 / 3.0)", PHYSICS),
    Mutant(f"{E}compressibility.py", "1.0 + self.amplitude * (ratio - 1.0)", "1.0 + (ratio - 1.0)", PHYSICS),
    Mutant(f"{E}compressibility.py", "- 0.1 * np.minimum(np.abs(np.asarray(cl)), 1.2)", "", GUARDS),
    Mutant(f"{E}ground_effect.py", "(1.0 - (0.25 / z) ** 2) ** 1.5", "(1.0 - (0.25 / z) ** 2)", PHYSICS),
    Mutant(f"{E}ground_effect.py", "v * (V + v) / np.maximum(V + left, 1e-12) - left", "v - left", PHYSICS),
    Mutant(f"{E}ground_effect.py", "np.arctan2(1.0, zeta) - zeta / (1.0 + zeta**2)", "np.arctan2(1.0, zeta)", PHYSICS),
    Mutant(f"{E}nacelle.py", "loads.T - self.cd * 0.5", "loads.T + self.cd * 0.5", PHYSICS),
    Mutant(f"{E}tip_gap.py", "bake.num.gap_loss = min(self.loss * gap", "bake.num.gap_loss = min(gap", GUARDS),
    Mutant(f"{E}motor_heating.py", "b, r = 1.0 - MAGNET * self.rise_K", "b, r = 1.0 + MAGNET * self.rise_K", PHYSICS),
    Mutant(f"{E}battery_sag.py", "self.sag * power + self.discharge * charge", "self.sag * power", PHYSICS),
    Mutant(f"{E}recirculation.py", "flow.V + self.k * v", "flow.V - self.k * v", PHYSICS),
    # units, air, coefficients
    Mutant("bemt/base/units.py", '"ozf_in": OZF * INCH', '"ozf_in": OZF * FOOT', UNITS),
    Mutant("bemt/base/units.py", '"inHg": 3386.389', '"inHg": 3368.389', GUARDS),
    Mutant("bemt/base/units.py", "ZERO_CELSIUS - 32.0 * 5.0 / 9.0", "ZERO_CELSIUS - 32.0", UNITS),
    Mutant("bemt/physics/coefficients.py", "CP_PER_ROTOR = math.pi**4 / 4.0", "CP_PER_ROTOR = math.pi**3 / 4.0", COEFFICIENTS),
    Mutant("bemt/physics/coefficients.py", "W = np.hypot(0.75 *", "W = np.hypot(0.7 *", COEFFICIENTS),
    Mutant("bemt/physics/air.py", "(temperature_K + 110.4)", "(temperature_K + 111.4)", AIR),
    Mutant("bemt/physics/air.py", "f = 1.00062 +", "f = 1.0062 +", GUARDS),
    # readers and averages
    Mutant("bemt/base/averaging.py", "0.0 if t[0] == 0.0 else min(dt[0], t[0])", "dt[0] if t[0] == 0.0 else min(dt[0], t[0])",
           "test_cfd_numbers.py"),
    Mutant("bemt/base/averaging.py", 'edges[:-1] + slack, side="right"', 'edges[:-1] - slack, side="left"', "test_cfd_numbers.py"),
    Mutant("bemt/data/readers/unit_text.py", '"kgf/W": units.Unit("N_W", "efficacy", units.KGF)',
           '"kgf/W": units.Unit("N_W", "efficacy", 1.0)', f"{RECORDINGS} -k mutant_changed"),
    Mutant("bemt/data/readers/headings.py", '("Hz", "1/s")', '("Hz",)', f"{RECORDINGS} -k mutant_changed"),
    Mutant("bemt/data/readers/stands.py", "values[0] = np.nan", "pass", f"{RECORDINGS} -k tare"),
    Mutant("bemt/data/readers/stations.py", "(0.5 if found[1] else 1.0)", "1.0", "test_stations_new.py -k over"),
    Mutant("bemt/data/readers/stations.py", "np.arctan2(beta, 2.0 * np.pi * x)", "np.arctan2(beta, np.pi * x)",
           "test_strangers.py -k stations"),
    Mutant("bemt/base/packed.py", "if cells > MAX_CELLS:", "if cells > 1e6 * MAX_CELLS:", "test_packed.py -k ods"),
    Mutant("bemt/tools/flight/px4.py", 'params.get("PWM_MIN", 1000.0)', '1000.0', "test_flight_autopilots.py -k pulse_widths"),
    Mutant("bemt/tools/flight/repeat.py", "SCATTER = 0.007", "SCATTER = 0.07", "test_kernel_guards.py -k scatter"),
    Mutant("bemt/tools/flight/repeat.py", "free = SCATTER_FREE + own", "free = own or 1", "test_kernel_guards.py -k scatter"),
    # bands
    Mutant("bemt/rotors/validity.py", "SINK = 0.125", "SINK = 0.0", "test_kernel_guards.py -k sink"),
    Mutant("bemt/rotors/validity.py", "SINK * np.clip(sink, 0.0, 1.0) * loads", "SINK * loads", "test_kernel_guards.py -k sink"),
    # exports
    Mutant(f"{X}autopilots.py", "rho * n**2 * D**5 / (2.0 * np.pi)", "rho * n**2 * D**5 / np.pi", EXPORTS.format("px4")),
    Mutant(f"{X}simulators.py", "{kQ / kT:.12e}", "{kT / kQ:.12e}", EXPORTS.format("gazebo")),
    Mutant(f"{X}simulators.py", "float(scale * a)", "float(2.0 * scale * a)", EXPORTS.format("rotorpy")),
    Mutant(f"{X}autopilots.py", "ROTORS * np.pi * t.diameter_m**2 / 4.0", "ROTORS * np.pi * t.diameter_m**2",
           "test_exports.py -k sweeps_its_disks"),
    Mutant(f"{X}rotor_disk.py", "cl = thrust / (q * p.blades)", "cl = thrust / q", "test_exports.py -k own_formula"),
    Mutant(f"{X}design_codes.py", "{p.Rhub / p.R:.10g} {p.Rhub / p.R:.10g}", "{p.Rhub:.10g} {p.Rhub:.10g}", EXPORTS.format("xrotor")
           .replace("nobody_fitted", "(nobody_fitted or comes_back)")),
    # costs: energy, time, heat
    Mutant("bemt/tools/drive/mission.py", "share = 3600.0 * drive", "share = 3000.0 * drive", DRIVE),
    Mutant("bemt/tools/drive/drive_model.py", "self.resistance_ohm * (1.0 + COPPER * warm)", "self.resistance_ohm", DRIVE),
    Mutant("bemt/tools/drive/drive_model.py", "volts = voc - self.battery_ohm * bus", "volts = voc", DRIVE),
)  # fmt: skip


def _changed(edits: dict[str, list[tuple[str, str]]]) -> None:
    """Let imports see files of the tree with texts replaced."""
    texts: dict[str, bytes] = {}
    for file, pairs in edits.items():
        text = (ROOT / file).read_text(encoding="utf-8")
        for old, new in pairs:
            assert text.count(old) >= 1, f"{file} has no {old!r}"
            text = text.replace(old, new, 1)
        texts[str(ROOT / file)] = text.encode()
    true_data, true_cache = importlib.machinery.SourceFileLoader.get_data, external.cache_from_source

    def get_data(self: Any, path: str) -> bytes:
        return texts[path] if path in texts else true_data(self, path)

    def cache_from_source(path: str, *args: Any, **kwargs: Any) -> str:
        if str(path) in texts:
            raise NotImplementedError
        return true_cache(path, *args, **kwargs)

    importlib.machinery.SourceFileLoader.get_data = get_data  # type: ignore[method-assign]
    external.cache_from_source = cache_from_source  # type: ignore[assignment]


def _child(tests: str, mutant: Mutant, log: Path) -> int:
    """Run tests in this process; its exit code."""
    import shlex

    import pytest

    resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS + 5))
    with log.open("w") as stream:
        os.dup2(stream.fileno(), 1)
        os.dup2(stream.fileno(), 2)
    edits = {mutant.file: [(mutant.text, mutant.instead)]}
    if mutant.file in (RES, KER):
        for file, pairs in INTERPRETED.items():
            edits.setdefault(file, []).extend(pairs)
    elif mutant.file.startswith(K):
        os.environ["NUMBA_CACHE_DIR"] = str(log.with_suffix(".numba"))
    _changed(edits)
    files = [w if not w.startswith("test_") else f"tests/{w}" for w in shlex.split(tests)]
    return int(
        pytest.main(
            [
                *files, "-x", "-q", "--no-header", "-o", "addopts=", "-m", "not slow", "-p", "no:cacheprovider", "-W",
                "ignore",
            ]
        )
    )  # fmt: skip


def _forked(tests: str, mutant: Mutant, log: Path) -> tuple[int, float]:
    """Exit code and CPU time of a child."""
    pid = os.fork()
    if pid == 0:
        code = 70
        try:
            code = _child(tests, mutant, log)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    _, status, used = os.wait4(pid, 0)
    return os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime


def run(mutants: Iterable[Mutant], folder: Path) -> dict[str, Any]:
    """Survivors, and which tests fail without a mutant: those say nothing."""
    os.chdir(ROOT)
    os.environ["BEMT_COMPILE"] = ""
    sys.path[:0] = [str(ROOT), str(ROOT / "tests")]
    for name in WARM:
        importlib.import_module(name)
    assert not any(name == "bemt" or name.startswith("bemt.") for name in sys.modules)
    began, mutants = time.monotonic(), list(mutants)
    found: dict[str, Any] = {"mutants": len(mutants), "killed": 0, "survived": [], "broken": [], "cpu_s": 0.0}
    sound: dict[tuple[str, bool], int] = {}
    for k, mutant in enumerate(mutants):
        key = mutant.tests, mutant.file in (RES, KER)
        if key not in sound:  # the same way, without a change
            same = replace(mutant, instead=mutant.text)
            sound[key], seconds = _forked(mutant.tests, same, folder / f"sound_{k}.txt")
            found["cpu_s"] += seconds
        code, seconds = _forked(mutant.tests, mutant, folder / f"mutant_{k}.txt")
        found["cpu_s"] += seconds
        if sound[key] != 0 or code in (3, 4, 5, 70):
            found["broken"].append(f"{mutant.name} (tests {sound[key]}, mutant {code})")
        elif code == 0:
            found["survived"].append(mutant.name)
        else:
            found["killed"] += 1
        print(f"{k:3} {code:4} {seconds:6.1f} s  {' '.join(mutant.name.split())[:150]}", file=sys.stderr, flush=True)
    return found | {"seconds": time.monotonic() - began}


if __name__ == "__main__":
    import tempfile

    word = sys.argv[1] if len(sys.argv) > 1 else ""
    with tempfile.TemporaryDirectory() as made:
        out = Path(os.environ.get("MUTANTS_LOGS", made))
        out.mkdir(parents=True, exist_ok=True)
        print(json.dumps(run([m for m in MUTANTS if word in m.name or word in m.tests], out), indent=1))
