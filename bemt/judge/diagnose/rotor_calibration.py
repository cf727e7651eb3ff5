"""Reference recordings of a rotor become a case with a smaller uncertainty, by `bemt.rotors.as_measured`."""

from __future__ import annotations

import copy
import math
import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from bemt import __version__
from bemt.base.action import Answered, in_words_of_the_library
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED, Fault, InputError
from bemt.base.given import path_text
from bemt.base.tables import json_text, number_text, write_atomic
from bemt.judge.diagnose.folder import beside, elsewhere, name_after
from bemt.judge.diagnose.load import cases_of, load
from bemt.physics.k1k2 import ZERO_THRUST_MEASURED
from bemt.rotors.as_measured import AsMeasured, as_measured
from bemt.rotors.case import Case
from bemt.rotors.case.as_built import posterior_document
from bemt.rotors.case.reading import SETTLED
from bemt.rotors.conditioning import SESSION
from bemt.rotors.latents import NAMES, UNITS
from bemt.rotors.model import air_fields, air_of_points
from bemt.rotors.propeller import Propeller
from bemt.rotors.propeller import load as load_rotor

SCHEMA = "bemt.rotor_calibration/1"
POSTERIOR = "as_built.json"


def calibrate(
    paths: Sequence[str], case_path: str, say: Callable[[str], None] | None = None
) -> tuple[Case, AsMeasured]:
    """Read recordings and condition the rotor of a case on them; gives the new case and what was learnt."""
    (case,) = cases_of([case_path], [], 1)
    records = [load(path, case) for path in paths]
    if say:
        say(f"{sum(map(len, records))} points")
    air = {k: np.concatenate([np.broadcast_to(air_fields(r.air)[k], r.rpm.shape) for r in records])
           for k in ("rho", "mu", "a_sound", "temperature_K")}  # fmt: skip
    rpm, V = (np.concatenate([getattr(r, k) for r in records]) for k in ("rpm", "V"))
    scale = air["rho"] * (rpm / 60.0) ** 2 * case.diameter_m**4
    unit = {"thrust_N": scale, "torque_Nm": scale * case.diameter_m / (2.0 * np.pi)}
    none = [np.full(r.rpm.shape, np.nan) for r in records]

    def column(table: str, channel: str) -> Any:
        parts = [getattr(r, table).get(channel, n) for r, n in zip(records, none, strict=True)]
        return np.concatenate(parts) / unit[channel]

    y = [column("measured", c) for c in unit]
    u = [np.nan_to_num(column("u", c)) for c in unit]
    stated = [[g for r in records if (g := r.gain.get(c)) is not None and math.isfinite(g)] for c in unit]
    gains = [max(g) if g else SESSION for g in stated]
    if not any(np.isfinite(v).any() for v in y):
        raise InputError(Fault(paths[0], "", "neither thrust nor torque", "one of them, or coefficients"))
    return case, as_measured(case, rpm, V, air_of_points(air), y[0], y[1], u[0], u[1],
                            (gains[0], gains[1]), where=", ".join(paths))  # fmt: skip


def write(
    case: Case, found: AsMeasured, paths: Sequence[str], folder: str | Path, command: str = "calibrate-rotor",
    option: str = "--out",
) -> list[str]:  # fmt: skip
    """Write the case with the rotor as measured, under a name of its own, and the files beside it: their names."""
    out = Path(folder)
    if case.path.is_file() and out.resolve() == case.folder.resolve():
        raise InputError(Fault(option, "", "the folder of the case itself", "another folder", "It would be replaced"))
    source = _source(case)
    source["name"] = name_after(case.name, "measured")
    blade: Any = source["blade"]
    blade["known_from"] = "reference"
    blade.pop("as_built", None)
    blade["as_built"] = {"file": POSTERIOR}
    settled = SETTLED - {"rotor.hub_ratio"}
    kept = case.declared(lambda key: key not in settled)
    source.pop("assumptions", None)
    if kept:
        array = tomlkit.aot()
        for item in kept:
            array.append(tomlkit.item(item))
        source["assumptions"] = array
    elsewhere(source, case)
    names = ", ".join(Path(p).name for p in paths)
    head = f"# {case.name} with its rotor as `bemt {command}` found it from {names}"
    files = {file.relative_to(case.folder): file.read_bytes() for file in beside(case) if file.name != POSTERIOR}
    for name, data in files.items():
        write_atomic(out / name, data)
    provenance = {"case": case.name, "reference": [Path(p).name for p in paths], "points": found.points,
                  "version": __version__}  # fmt: skip
    write_atomic(out / POSTERIOR, json_text(posterior_document(found.posterior, found.reference, provenance)))
    write_atomic(out / "case.toml", f"{head}\n{tomlkit.dumps(source).rstrip()}\n")
    return [*(name.as_posix() for name in files), POSTERIOR, "case.toml"]


def _source(case: Case) -> Any:
    """Document of the case file, with its comments; a short case in full, or its unknowns would come back."""
    if not case.path.is_file():  # a label
        return copy.deepcopy(dict(case.written))
    source: Any = tomlkit.parse(case.path.read_text(encoding="utf-8-sig"))
    return source if source.unwrap() == case.written else copy.deepcopy(dict(case.written))


def flight_point(case: Case, found: AsMeasured) -> float | None:
    """Airspeed at which one more point would settle flight, at the case's speed; None if the run has one. [m/s]"""
    if found.reference.in_flight:
        return None
    pitch = case.rotor().blade.pitch_m()
    return 0.5 * ZERO_THRUST_MEASURED * pitch * case.rpm / 60.0


_WORDS = {"angle_deg": "blade angle", "lift": "lift (ln)", "drag": "drag (ln)",
          "camber_deg": "zero-lift angle lower by"}  # fmt: skip


def _size(found: AsMeasured) -> float:
    """Distance of the rotor from its description, in those of usual rotors [1]."""
    return float(found.found.weights @ found.prior.sizes)


def lines_of(case: Case, one: AsMeasured, paths: Sequence[str], advice: bool = True) -> list[str]:
    """What the runs say, for people; with ``advice`` also the point that would say more."""
    state = f"{'converged' if one.found.converged else 'NOT CONVERGED'} after {one.found.steps} iterations"
    head = f"rotor as built, beyond its {one.prior.known_from}"
    lines = [f"{case.name}: {one.points} points of {', '.join(Path(p).name for p in paths)}; {state}",
             f"{head:42} {'before':>8} {'u':>7}   {'after':>8} {'u':>7}"]  # fmt: skip
    for k, name in enumerate(NAMES):
        word = _WORDS[name] + ("" if UNITS[name] == "1" else f" [{UNITS[name]}]")
        (m0, u0), (m1, u1) = ((d.mean[k], d.sd[k]) for d in (one.prior, one.posterior))
        lines.append(f"{word:42} {m0:+8.3f} {u0:7.3f}   {m1:+8.3f} {u1:7.3f}")
    if (size := _size(one)) > 2.0:
        lines.append(f"This rotor is {size:.1f} times as far from its description as usual: check the case.")
    if one.found.excess > 1.0:
        times = number_text(math.sqrt(one.found.excess), 2)
        lines.append(
            f"No rotor of this kind gives these readings: noise taken as {times} times larger. Check the recording."
        )
    if advice and (V := flight_point(case, one)) is not None:
        lines.append(
            "All points are at rest, which leaves flight uncertain. Recommended: one flight point too, at an advance\n"
            f"ratio near {V / (case.rpm / 60.0 * case.diameter_m):.2f}, such as {V:.0f} m/s at {case.rpm:g} rev/min; "
            "name both recordings as REFERENCE."
        )
    return lines


@dataclass(frozen=True, eq=False)
class CalibratedRotor(Answered):
    """A rotor as its own runs show it, returned by :func:`bemt.calibrate_rotor`.

    Parameters
    ----------
    source : Propeller
        The propeller as its case describes it.
    found : bemt.rotors.as_measured.AsMeasured
        What the runs say.
    recordings : tuple of str
        The files.
    folder : str, optional
        Where its case was written.
    files : tuple of str
        Names of its files there.

    Examples
    --------
    See :func:`bemt.calibrate_rotor`, which shows ``.converged``, ``.text``, ``.to_dict()`` and ``.write(folder)``.
    """

    source: Propeller
    found: AsMeasured
    recordings: tuple[str, ...]
    folder: str | None = None
    files: tuple[str, ...] = ()

    @property
    def converged(self) -> bool:
        """Whether the fit converged."""
        return bool(self.found.found.converged)

    @property
    def exit_code(self) -> int:
        """1 if the fit did not converge."""
        return EXIT_OK if self.converged else EXIT_UNCONVERGED

    @property
    def text(self) -> str:
        """What the runs say, and the next command."""
        lines = lines_of(self.source.case, self.found, self.recordings)
        if self.folder is None:
            return "\n".join([*lines, "nothing written; --out DIR writes the case with this rotor"])
        typed = shlex.quote(Path(self.folder).as_posix())
        lines += [f"{Path(self.folder).as_posix()}: {', '.join(self.files)}", f"next: bemt sweep {typed}"]
        lines += [f"      bemt drive {typed}"] if self.source.case.file.drive is not None else []
        return "\n".join(lines)

    def _document(self) -> Mapping[str, object]:
        """Plain values of schema ``bemt.rotor_calibration/1``."""
        case, one = self.source.case, self.found
        numbers = {
            name: {"unit": UNITS[name], "before": float(one.prior.mean[k]), "u_before": float(one.prior.sd[k]),
                   "after": float(one.posterior.mean[k]), "u_after": float(one.posterior.sd[k])}
            for k, name in enumerate(NAMES)
        }  # fmt: skip
        airspeed = flight_point(case, one)
        return {
            "schema": SCHEMA, "case": case.name, "reference": [Path(p).name for p in self.recordings],
            "points": one.points, "converged": one.found.converged, "steps": one.found.steps,
            "log_evidence": one.found.log_evidence, "size": _size(one), "excess": one.found.excess,
            "known_from": one.prior.known_from, "numbers": numbers, "recommended_airspeed_m_s": airspeed,
            "rpm": case.rpm,
            "recommended_J": None if airspeed is None else airspeed / (case.rpm / 60.0 * case.diameter_m),
        }  # fmt: skip

    def write(self, folder: str | os.PathLike[str]) -> Propeller:
        """Write the case of the rotor as measured, and load it.

        Parameters
        ----------
        folder : str or path
            Folder for the case; not the one of the case itself.

        Returns
        -------
        Propeller
            The rotor with its narrower band.
        """
        with in_words_of_the_library():
            write(self.source.case, self.found, self.recordings, path_text("out", folder))
        return load_rotor(folder)
