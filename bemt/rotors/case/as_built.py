"""What a case says of its rotor as built: how the blade is known, and what a reference run told."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.units import INCH
from bemt.data.readers.uiuc_names import class_of
from bemt.physics.sections import rule as section_rule
from bemt.rotors.conditioning import ReferenceRun
from bemt.rotors.latents import NAMES, Prior
from bemt.rotors.measured import records
from bemt.rotors.population import label_angle_deg, population

if TYPE_CHECKING:
    from pathlib import Path

    from bemt.rotors.case.schema import AsBuiltTable, BladeTable, CaseFile
    from geometry.rotor import Rotor

# Assumptions that move a latent number of their own accord.
MOVED = {
    "angle": ("blade.beta_offset_deg", "blade.pitch_in", "blade.pitch_mm", "blade.pitch_ratio"),
    "chord": ("blade.max_chord_over_R", "blade.chord_scale", "blade.chord_law"),
    "camber": ("blade.section.camber", "blade.section.camber_scale", "blade.section.naca", "blade.section.dat"),
}
_SCHEMA = "bemt.as_built/2"


@dataclass(frozen=True, eq=False)
class CaseAsBuilt:
    """What is known of the rotor of a case."""

    prior: Prior  # Law of the latent numbers, after the reference run if there is one
    drawn: Array  # (K,) latent numbers with which the case is solved: zero, or what the case states [units of `NAMES`]
    reference: ReferenceRun | None = None  # The run's rows
    doubt: str = ""  # Why the readings may not be this rotor's
    fitted_to: str = ""  # Readings that moved the rotor, as in "fitted to X"; empty where none did

    @property
    def no_check(self) -> tuple[str, ...]:
        """What a comparison with those readings is not; nothing where the rotor is as it is drawn."""
        return (f"the rotor was fitted to {self.fitted_to}: agreement with that is no independent check",
                ) if self.fitted_to else ()  # fmt: skip


def known_from(blade: BladeTable) -> str:
    """How the blade is known: as the case says, else by what tells of it as built, else by its stations."""
    told = blade.as_built
    if blade.known_from is not None:
        return blade.known_from
    if told is not None and (told.measured or told.file or told.reading):
        return "measured" if told.measured else "reference"
    return "label" if blade.chord_law is not None else "cad" if blade.apc is not None else "stations"


def _gap_deg(blade: BladeTable, rotor: Rotor) -> float:
    pitch = blade.pitch_m(rotor.D) if blade.label_pitch_in is None else blade.label_pitch_in * INCH
    if math.isnan(pitch):
        return math.nan
    return math.degrees(float(rotor.blade.at(0.75 * rotor.R)[1])) - label_angle_deg(pitch, rotor.D)


def as_built_of(
    file: CaseFile, folder: Path, rotor: Rotor, counting_assumptions: bool = True, chord_known: bool | None = None
) -> CaseAsBuilt:
    """Read what a case file says; faults as `InputError`."""
    blade, stated = file.blade, file.blade.as_built
    if stated is not None and (learned := _learned(stated, folder)) is not None:
        return learned
    assumed = {item.key for item in file.assumptions}
    moved = assumed if counting_assumptions else set()
    declared = {what for what, keys in MOVED.items() if moved & set(keys)}
    # a chord that is no assumption was measured
    if not assumed & set(MOVED["chord"]) if chord_known is None else chord_known:
        declared.add("chord")
    source = known_from(blade)
    drawn_section = blade.section is not None and blade.section.dat is not None
    drawn_section = drawn_section or bool(file.polars) or source in ("cad", "scan")
    section = "given" if drawn_section else section_rule.source(blade.family)
    sds, drawn = {}, np.array([getattr(stated, name, None) or 0.0 for name in NAMES])  # zero elsewhere
    if stated is not None:
        named = {"angle_deg": "angle_sd_deg", "camber_deg": "camber_sd_deg", "lift": "lift_sd", "drag": "drag_sd"}
        for name, sd in named.items():
            if getattr(stated, sd) is not None:
                sds[name] = getattr(stated, sd)
    gap = _gap_deg(blade, rotor)
    kind = None if blade.section is not None else blade.class_ or class_of(blade.family)  # the rule knows no classes
    prior = population().prior(source, rotor.D, gap, blade.family, section, declared, sds, kind)
    stated_mean = np.where(drawn != 0.0, drawn, prior.mean)
    return CaseAsBuilt(Prior(stated_mean, prior.cov, prior.sizes, prior.weights, source), drawn)


def _learned(stated: AsBuiltTable, folder: Path) -> CaseAsBuilt | None:
    """What readings told of the rotor, in a file of its own or among the measured propellers."""
    if stated.file is not None:
        return _posterior(folder / stated.file)
    if stated.measured is None:
        return None
    one = records()[stated.measured]
    prior, reference = one.as_built()
    return CaseAsBuilt(prior, prior.mean, reference, fitted_to=f"its measurement in the {one.source}")


def _posterior(path: Path) -> CaseAsBuilt:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        schema, latents = (document[k] for k in ("schema", "latents"))
        if schema != _SCHEMA or latents != list(NAMES):
            raise ValueError(f"schema {schema!r} of {latents}")
        mean, cov, sizes, weights = (np.array(document[k], float) for k in ("mean", "cov", "sizes", "weights"))
        reference = ReferenceRun.of(document["reference"])
        names = document.get("provenance", {}).get("reference", [])
    except (KeyError, ValueError, TypeError) as error:
        expected = f"a file of {_SCHEMA} with the latent numbers {', '.join(NAMES)}"
        raise InputError(Fault(path.as_posix(), "", str(error), expected, "calibrate-rotor writes it")) from error
    told = ", ".join(map(str, names)) or "a run of its own"
    return CaseAsBuilt(Prior(mean, cov, sizes, weights, "reference"), mean, reference, fitted_to=told)


def posterior_document(prior: Prior, reference: ReferenceRun, provenance: dict[str, object]) -> dict[str, object]:
    """Document that `blade.as_built.file` names."""
    return {
        "schema": _SCHEMA, "latents": list(NAMES), "mean": prior.mean.tolist(), "cov": prior.cov.tolist(),
        "sizes": prior.sizes.tolist(), "weights": prior.weights.tolist(), "reference": reference.document(),
        "provenance": provenance,
    }  # fmt: skip
