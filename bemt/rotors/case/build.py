"""Objects of a case: rotor, duct and air from the checked document."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.units import ZERO_CELSIUS
from bemt.physics.air import Air, isa_pressure
from bemt.rotors.case.schema import AirTable, CaseFile
from geometry.airfoil import Airfoil, naca, naca4, parse_dat
from geometry.common import GeometryError
from geometry.duct import Duct, Stator, around
from geometry.laws import from_laws
from geometry.rotor import Blade, Rotor, from_stations

if TYPE_CHECKING:
    from bemt.data.readers.stations import BladeStations

T = TypeVar("T")


def _as_input(file: str, where: str, make: Callable[[], T]) -> T:
    """Call, and turn geometry's faults into faults of the case file."""
    try:
        return make()
    except InputError:
        raise
    except GeometryError as error:
        raise InputError(
            [Fault(file, f"{where}.{at}" if where else at, *rest) for at, *rest in error.faults]
        ) from error
    except ValueError as error:
        raise InputError(Fault(file, where, "values that do not fit together", str(error))) from error


def _per_anchor(value: Any, count: int) -> list[Any]:
    return list(value) if isinstance(value, (list, tuple)) else [value] * count


def _anchors(case: CaseFile, path: Path) -> list[tuple[float, Airfoil]]:
    section = case.blade.section
    assert section is not None  # a rule of the file
    radii = section.r_over_R or (0.0,)
    file = path.as_posix()
    if section.naca is not None:
        shapes = [
            _as_input(file, "blade.section.naca", lambda d=d: naca(d))  # type: ignore[misc]
            for d in _per_anchor(section.naca, len(radii))
        ]
    elif section.dat is not None:
        shapes = [_dat(path.parent / name) for name in _per_anchor(section.dat, len(radii))]
    else:
        shape = (section.camber, section.camber_position, section.thickness)
        columns = [_per_anchor(value, len(radii)) for value in shape]
        scale, thicker = section.camber_scale, section.thickness_scale
        shapes = [
            _as_input(file, "blade.section", lambda m=m, p=p, t=t: naca4(m * scale, p, t * thicker))  # type: ignore[misc]
            for m, p, t in zip(*columns, strict=True)
        ]
    return list(zip(map(float, radii), shapes, strict=True))


def _dat(path: Path) -> Airfoil:
    from bemt.data.readers import load_text

    text = load_text(path).text
    return _as_input(path.as_posix(), "", lambda: parse_dat(text, path.stem))


def _blade(case: CaseFile, path: Path) -> Blade:
    blade = case.blade
    R = 0.5 * case.rotor.diameter_m
    hub = case.rotor.hub_diameter_m / case.rotor.diameter_m
    anchors = _anchors(case, path)
    scale, turned = blade.chord_scale, math.radians(blade.beta_offset_deg)
    if blade.chord_law is not None:
        chord = {"max_chord": blade.max_chord_over_R, "taper": blade.taper}
        laws = {"pitch": blade.pitch_m(case.rotor.diameter_m), "relief": blade.tip_relief}
        made = from_laws(
            case.rotor.diameter_m, blade.chord_law, blade.pitch_law, hub, anchors=anchors,
            chord={k: v for k, v in chord.items() if v is not None},
            pitch={k: v for k, v in laws.items() if v is not None},
        )  # fmt: skip
        return _bent(
            case, from_stations(made.r, made.chord * scale, made.beta + turned, R, hub * R, anchors, name=case.name)
        )
    x, c, beta, *_ = _stations(case, path)
    return _bent(case, from_stations(x * R, c * R * scale, beta + turned, R, hub * R, anchors, name=case.name))


def _bent(case: CaseFile, blade: Blade) -> Blade:
    """Blade with the sweep and the rake of the case, quadratic in the radius; chord and blade angle stay."""
    sweep, rake = 1e-3 * case.blade.tip_sweep_mm, 1e-3 * case.blade.tip_rake_mm
    if sweep == 0.0 and rake == 0.0:
        return blade
    start = case.blade.sweep_from * blade.R
    grown = (np.clip(blade.r - start, 0.0, None) / (blade.R - start)) ** 2
    return replace(blade, sweep=sweep * grown, rake=rake * grown)


def _stations(case: CaseFile, path: Path) -> BladeStations:
    """Stations of whichever file of stations the case names."""
    key = next(k for k in ("stations", "uiuc", "apc") if getattr(case.blade, k) is not None)  # a rule of the file
    return stations_in(path.parent / getattr(case.blade, key), 0.5 * case.rotor.diameter_m, key)


def stations_in(file: Path, R: float, key: str) -> BladeStations:
    """Stations of a file, by the key of [blade] that names it; tip radius in m."""
    from bemt.data.readers.stations import BladeStations, read_stations

    if key == "uiuc":
        from bemt.data.readers.uiuc import read_geometry

        table = read_geometry(file)
        return BladeStations(table.r_R, table.c_R, np.radians(table.beta_deg))
    if key == "apc":
        from bemt.data.readers.apc import read_pe0

        apc = read_pe0(file)
        return BladeStations(apc.r_m / apc.radius_m, apc.chord_m / apc.radius_m, apc.beta_rad, apc.t_c)
    return read_stations(file, R)


def key_of(file: Path) -> str:
    """Key of [blade] for a file of stations, by its content: ``apc``, ``uiuc``, or our own table, ``stations``."""
    from bemt.data.readers import HEAD_BYTES, load_text
    from bemt.data.readers.apc import sniff
    from bemt.data.readers.uiuc import role_of

    head = load_text(file).text[:HEAD_BYTES]
    return "apc" if sniff(head) else "uiuc" if role_of(head) == "geometry" else "stations"


def build_rotor(case: CaseFile, path: Path) -> Rotor:
    """Build the rotor of a case; right-handed rotation is +1. Raises InputError where the values make none."""
    rotor = case.rotor
    sign = -1 if rotor.rotation == "left" else 1
    spinner = 1e-3 * rotor.spinner_mm

    def make() -> Rotor:
        return Rotor(_blade(case, path), rotor.blades, sign, case.name, spinner_length=spinner)

    return _as_input(path.as_posix(), "blade", make)


def build_duct(case: CaseFile, path: Path, rotor: Rotor) -> Duct | None:
    """Build the duct around a rotor, None when the case has none. Raises InputError where the values make none."""
    duct = case.duct
    if duct is None:
        return None
    inner, hub, x = duct.inner_diameter_m, 0.5e-3 * (duct.exit_hub_diameter_mm or 0.0), duct.rotor_position_mm
    gap = 1e-3 * (duct.tip_gap_mm or 0.0) if math.isnan(inner) else 0.5 * inner - rotor.R
    ratio = duct.exit_area_ratio
    if duct.exit_diameter_mm is not None:
        ratio = math.pi * ((0.5e-3 * duct.exit_diameter_mm) ** 2 - hub**2) / rotor.annulus_area
    assert ratio is not None  # a rule of the file

    def metres(value: float | None, times: float = 1e-3) -> float | None:
        return None if value is None else value * times

    def make() -> Duct:
        vanes = duct.stator
        turned = 0.0 if vanes is None else math.radians(rotor.rotation * vanes.angle_deg)  # their tails with the swirl
        stator = None if vanes is None else Stator(vanes.blades, vanes.chord_mm * 1e-3, beta=0.5 * math.pi + turned)
        return around(
            rotor, duct.length_mm * 1e-3, gap, (duct.lip_radius_mm or 0.0) * 1e-3, exit_area_ratio=ratio,
            exit_hub_radius=hub, rotor_x=metres(x), stator=stator, lip_length=metres(duct.lip_length_mm),
            outer_radius=metres(duct.outer_diameter_mm, 0.5e-3), te_thickness=metres(duct.trailing_edge_mm),
            name=case.name,
        )  # fmt: skip

    return _as_input(path.as_posix(), "", make)


def build_air(air: AirTable) -> Air:
    """Build the state of the air from the table [air].

    Without a temperature, a given density has that of 15 degC and a given altitude that of the standard atmosphere.

    >>> round(build_air(AirTable(altitude_m=0.0, temperature_C=30.0)).rho, 4)
    1.1644
    """
    temperature = air.temperature_C
    if air.fluid == "water":
        return Air.water(15.0 if temperature is None else temperature, air.salinity_g_kg or 0.0)
    if air.density_kg_m3 is not None:
        return Air.from_density(air.density_kg_m3, 15.0 if temperature is None else temperature)
    if air.altitude_m is not None:
        offset = 0.0 if temperature is None else temperature + ZERO_CELSIUS - isa_pressure(air.altitude_m)[1]
        return Air.isa(air.altitude_m, offset)
    assert air.pressure_hPa is not None and temperature is not None  # rules of the file
    return Air.from_state(100.0 * air.pressure_hPa, temperature, air.humidity_pct or 0.0)
