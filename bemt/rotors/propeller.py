"""Propellers and fans of the public API: from a label, from stations or from a case; solved into Datasets."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.action import in_words_of_the_library, worded
from bemt.base.errors import Fault, InputError, refuse
from bemt.base.given import number, numbers, path_text
from bemt.base.tables import number_of
from bemt.base.units import INCH
from bemt.physics.bem.coaxial import LOADS, RATIOS
from bemt.physics.dataset import Dataset
from bemt.rotors.case import Case, case_of, find_cases, fresh, load_case
from bemt.rotors.case.lattice import conditions, turned
from bemt.rotors.case.load import FILE_NAME
from bemt.rotors.case.reading import reading_text

if TYPE_CHECKING:
    import pandas as pd

    from bemt.physics.bem.gradient import Gradient
    from bemt.physics.bem.model import Model

__all__ = ["Propeller", "load", "propeller"]

CHANNELS = (
    "rpm", "airspeed_m_s", "density_kg_m3", "J", "thrust_N", "torque_Nm", "power_W", "CT", "CP", "eta", "M_tip",
)  # fmt: skip
DUCTED = ("rotor_thrust_N", "duct_thrust_N", "stator_thrust_N", "exhaust_speed_m_s", "duct_share")
PAIRED = ("lower_rpm", *LOADS, *RATIOS)
OBLIQUE = ("sideslip_rad", "H_force_N", "Y_force_N", "roll_moment_Nm", "pitch_moment_Nm")


@dataclass(frozen=True, eq=False)
class Propeller:
    """A propeller or fan that can be solved; create one with :func:`propeller` or :func:`load`.

    Parameters
    ----------
    case : bemt.rotors.case.Case
        Geometry, air, model and declared unknowns.
    text : str
        The case as text, as written by :meth:`write`.

    Examples
    --------
    >>> p = propeller("10x5")
    >>> p
    <propeller prop_10x5: 0.254 m, 2 blades, 8 unknowns>
    """

    case: Case
    text: str

    def __repr__(self) -> str:
        """One-line summary."""
        kind = "fan" if self.case.ducted else "propeller"
        return f"<{kind} {self.name}: {self.diameter_m:.4g} m, {self.blades} blades, {len(self.unknowns)} unknowns>"

    def _repr_html_(self) -> str:
        """Show it in a notebook: size, operating point, declared unknowns."""
        from bemt.base.notebook import table_html

        head = f"{'fan' if self.case.ducted else 'propeller'} {self.name}"
        size = {"diameter": f"{self.diameter_m:.4g} m", "blades": f"{self.blades}"}
        point = f"{self.case.rpm:g} rev/min, {self.case.airspeed_m_s:g} m/s"
        unknowns = {f"unknown {key}": text for key, text in self.unknowns.items()}
        return table_html(head, {**size, "default operating point": point, **unknowns})

    @property
    def name(self) -> str:
        """Name of the case.

        Examples
        --------
        >>> propeller("10x5").name
        'prop_10x5'
        """
        return self.case.name

    @property
    def diameter_m(self) -> float:
        """Diameter. [m]

        Examples
        --------
        >>> propeller("10x5").diameter_m
        0.254
        """
        return self.case.diameter_m

    @property
    def blades(self) -> int:
        """Number of blades.

        Examples
        --------
        >>> propeller("9x4.5x3").blades
        3
        """
        return int(self.case.file.rotor.blades)

    @property
    def unknowns(self) -> dict[str, str]:
        """Declared unknowns and their ranges, which contribute to the bands.

        Examples
        --------
        >>> propeller("10x5").unknowns["blade.max_chord_over_R"]
        '0.15 .. 0.26'
        """
        return {item.key: item.range_text for item in self.case.assumptions}

    @worded
    def solve(
        self, rpm: ArrayLike | None = None, airspeed_m_s: ArrayLike | None = None, *, J: ArrayLike | None = None,
        angle_deg: ArrayLike | None = None, density_kg_m3: float | None = None, bands: bool = True,
    ) -> Dataset:  # fmt: skip
        """Solve operating points one by one.

        Parameters
        ----------
        rpm : array_like, optional
            Speed of rotation; from the case by default. [rev/min]
        airspeed_m_s : array_like, optional
            Airspeed; from the case by default. Broadcast with `rpm`. [m/s]
        J : array_like, optional
            Advance ratio V/(n D) instead of `airspeed_m_s`. [-]
        angle_deg : array_like, optional
            Angle between wind and shaft: 0 climb, 90 edgewise, 180 descent; open rotors only. From the case by
            default. [deg]
        density_kg_m3 : float, optional
            Air density; from the case by default. [kg/m3]
        bands : bool
            Also compute standard uncertainties: every declared unknown is varied over its range. An unknown air,
            speed or airspeed acts at points that share the case's own.

        Returns
        -------
        Dataset
            Kind ``bemt``; every channel is (N,), the arguments broadcast and flattened in C order. A point without a
            solution is NaN and flagged, never zero; so is one that stands still, or whose speed is NaN among others. A
            point that no measured rotor covers is flagged, and its band is
            wider. With an angle it also has ``sideslip_rad``, ``H_force_N`` (in the
            plane of the disk, downstream), ``Y_force_N`` (to the advancing side), ``roll_moment_Nm`` (lifts the
            advancing side) and ``pitch_moment_Nm`` (lifts the upstream side), all without a band.

        Raises
        ------
        InputError
            If both `airspeed_m_s` and `J` are given, numbers are not finite, a speed is below zero, an angle is not
            within 0 to 180 deg, or the rotor is ducted and the angle not 0.

        Examples
        --------
        >>> d = propeller("10x5").solve(rpm=[6000, 9000])
        >>> d.thrust_N.round(1), d.power_W.round(0)
        (array([ 4.8, 11. ]), array([ 46., 156.]))
        >>> d = propeller("10x5").solve(6000, 10.0, angle_deg=[0, 90], bands=False)
        >>> bool(d.thrust_N[1] > 2 * d.thrust_N[0]), bool(d.H_force_N[1] > 0)
        (True, True)
        """
        from bemt.rotors.case import lattice

        n, V, angle = turned(self.case, *conditions(self.case, rpm, airspeed_m_s, J, stopped=True), angle_deg)
        density = None if density_kg_m3 is None else number("density_kg_m3", density_kg_m3)
        with in_words_of_the_library({"air.density_kg_m3": "density_kg_m3"}, self.case.path.as_posix()):
            found = lattice.solve(self.case, n, V, density, bands, angle)
        if angle_deg is not None:  # in axial flow too: a caller who sweeps the angle reads the same channels
            none = np.where(found.converged, 0.0, np.nan)
            found = replace(found, values={**dict.fromkeys(OBLIQUE, none), **found.values})
        more = (*(DUCTED if self.case.ducted else PAIRED), *OBLIQUE)
        names = [key for key in (*CHANNELS, *more) if key in found]
        by = {origin: {key: v for key, v in part.items() if key in names} for origin, part in found.u_by.items()}
        notes = ("bands, one standard deviation: declared unknowns (input), real rotors compared with BEMT (model), "
                 "blade elements (numerics)",)  # fmt: skip
        about = {"source": "bemt", "file": self.case.path.as_posix()}
        return Dataset("bemt", self.name, {key: found[key] for key in names}, flags=found.flags, provenance=about,
                       u_by=by, notes=notes if bands else (), units=found.units)  # fmt: skip

    @worded
    def coaxial(
        self, z_over_D: float | None = None, *, spacing_mm: float | None = None, second: str | None = None,
        turns: str = "opposite", rpm_ratio: float | None = None, rpm: float | None = None,
        torque_balance: bool = False,
    ) -> Propeller:  # fmt: skip
        """Put a second rotor on the axis, downstream; both are solved together.

        Parameters
        ----------
        z_over_D : float, optional
            Distance of the two disks over the diameter of this propeller. [-]
        spacing_mm : float, optional
            The same in millimetres, instead. [mm]
        second : str, optional
            Label or case of another propeller; by default the second one is like this one.
        turns : str
            Whether it turns ``"opposite"`` to this one or the ``"same"`` way.
        rpm_ratio, rpm : float, optional
            Its speed over that of this one, 1 by default, or a speed of its own. [-], [rev/min]
        torque_balance : bool
            Instead, let it turn at the speed at which both torques are equal.

        Returns
        -------
        Propeller
            The pair. In what :meth:`solve` returns, ``rpm`` is the speed of the first rotor; thrust, torque and power
            are totals, coefficients refer to diameter and speed of the first; ``upper_...`` belongs to the first
            rotor, ``lower_...`` to the second; ``lower_thrust_ratio`` is its thrust over that alone at its speed.

        Raises
        ------
        InputError
            For values that do not make a pair, such as a rotor in a duct.

        Examples
        --------
        >>> pair = propeller("15x5").coaxial(0.3)
        >>> found = pair.solve(rpm=5000, bands=False)
        >>> bool(0.6 < found["lower_thrust_ratio"][0] < found["upper_thrust_ratio"][0] < 1.0)
        True
        >>> balanced = propeller("15x5").coaxial(0.3, torque_balance=True).solve(rpm=5000, bands=False)
        >>> bool(abs(balanced["reaction_torque_Nm"][0]) < 1e-6), bool(balanced["lower_rpm"][0] > 5000)
        (True, True)
        """
        import tomlkit

        given = {"z_over_D": z_over_D, "spacing_mm": spacing_mm, "turns": turns, "rpm_ratio": rpm_ratio, "rpm": rpm,
                 "torque_balance": torque_balance or None}  # fmt: skip
        if second is not None:
            text = path_text("second", second)
            is_case = Path(text).exists() or text.endswith(".toml") or "/" in text
            given["case" if is_case else "label"] = Path(text).resolve().as_posix() if is_case else text
        written = {key: value for key, value in self.case.written.items() if key != "assumptions"}
        unknowns = self.case.declared(lambda key: not key.startswith("second_rotor."))
        table = {"second_rotor": {key: value for key, value in given.items() if value is not None}}
        text = tomlkit.dumps(written | table | ({"assumptions": unknowns} if unknowns else {}))
        keys = {f"second_rotor.{key}": key for key in given} | {
            f"second_rotor.{k}": "second" for k in ("label", "case")
        }
        keys["second_rotor"] = "coaxial"
        with in_words_of_the_library(keys, self.case.path.as_posix()):
            return Propeller(case_of(text, self.case.folder), text)

    @worded
    def curve(
        self, rpm: ArrayLike | None = None, J: ArrayLike | None = None, *, airspeed_m_s: ArrayLike | None = None,
        density_kg_m3: float | None = None, bands: bool = True,
    ) -> Dataset:  # fmt: skip
        """Solve every combination of speed of rotation and advance ratio or airspeed.

        Parameters
        ----------
        rpm : array_like, optional
            Speeds of rotation; from the case by default. [rev/min]
        J : array_like, optional
            Advance ratios; 0 to 0.9 if neither these nor `airspeed_m_s` are given. [-]
        airspeed_m_s : array_like, optional
            Airspeeds instead of advance ratios. [m/s]
        density_kg_m3, bands : optional
            As for :meth:`solve`.

        Returns
        -------
        Dataset
            One point per pair, every channel (N,) with the speed of rotation as the outer loop: over one speed
            ``d.thrust_N.reshape(len(rpm), -1)[i]``.

        Examples
        --------
        >>> d = propeller("10x5").curve(rpm=6000, J=[0.0, 0.3, 0.6])
        >>> bool(d.u["CT"][0] > 0), d.CT.round(2)
        (True, array([0.09, 0.06, 0.01]))
        """
        given = J is not None or airspeed_m_s is not None
        n = np.atleast_1d(numbers("rpm", self.case.rpm if rpm is None else rpm, finite=False))
        x = np.linspace(0.0, 0.9, 19)
        if given:
            x = np.atleast_1d(numbers("airspeed_m_s", airspeed_m_s) if J is None else numbers("J", J))
        a, b = (v.ravel() for v in np.meshgrid(n, x, indexing="ij"))
        speed: dict[str, Any] = {"airspeed_m_s": b} if airspeed_m_s is not None and J is None else {"J": b}
        if J is not None and airspeed_m_s is not None:
            speed = {"J": b, "airspeed_m_s": airspeed_m_s}  # refused below
        return self.solve(a, density_kg_m3=density_kg_m3, bands=bands, **speed)

    @worded
    def along_blade(
        self, rpm: float | None = None, airspeed_m_s: float | None = None, *, J: float | None = None,
        density_kg_m3: float | None = None,
    ) -> pd.DataFrame:  # fmt: skip
        """Solve one operating point and return the distribution along the blade.

        Parameters
        ----------
        rpm, airspeed_m_s, J, density_kg_m3 : optional
            As for :meth:`solve`, one number each.

        Returns
        -------
        pandas.DataFrame
            A row per blade element, from hub to tip: ``r_m``, ``chord_m``, ``beta_deg``, ``alpha_deg``, ``cl``, ``cd``,
            ``Re``, ``M``, ``axial_m_s`` and ``swirl_m_s`` (air velocity at the disk), ``thrust_per_radius_N_m``,
            ``torque_per_radius_Nm_m`` (all blades together). NaN if the point does not converge.

        Raises
        ------
        InputError
            For more than one point; otherwise as :meth:`solve`.

        Notes
        -----
        Effects that act on points (a wall behind, the body of the vehicle) change the loads of the whole rotor in
        :meth:`solve` and are not distributed along the blade here.

        Examples
        --------
        >>> p = propeller("10x5")
        >>> blade = p.along_blade(rpm=6000)
        >>> bool(abs(np.trapezoid(blade.thrust_per_radius_N_m, blade.r_m) / p.solve(6000).thrust_N[0] - 1) < 0.02)
        True
        """
        import pandas as pd

        from bemt.physics.bem import kernel as K
        from bemt.physics.bem import solver

        n, V = conditions(self.case, rpm, airspeed_m_s, J)
        if n.size != 1:
            raise InputError(Fault("", "rpm, airspeed_m_s, J", number_of(n.size, "point"), "one operating point"))
        density = None if density_kg_m3 is None else number("density_kg_m3", density_kg_m3)
        air = self.case.air(None if density is None else {"air.density_kg_m3": density})
        prep = self._model.prep
        at = solver.Radial(*(v[0] for v in solver.solve(prep, n, V, air, radial=True).radial))
        width, chord = prep.st[:, K.S_DR], prep.st[:, K.S_CHORD]
        return pd.DataFrame({
            "r_m": at.r, "chord_m": chord, "beta_deg": np.degrees(prep.st[:, K.S_BETA]),
            "alpha_deg": np.degrees(at.alpha), "cl": at.cl, "cd": at.cd, "Re": at.Re, "M": at.M,
            "axial_m_s": at.w, "swirl_m_s": at.v_t, "thrust_per_radius_N_m": at.dT / width,
            "torque_per_radius_Nm_m": at.dQ / width,
        })  # fmt: skip

    @worded
    def gradient(
        self, rpm: float | None = None, airspeed_m_s: float | None = None, *, J: float | None = None
    ) -> Gradient:
        """Differentiate rotor thrust and torque at one operating point.

        Parameters
        ----------
        rpm, airspeed_m_s, J : optional
            As for :meth:`solve`, one number each.

        Returns
        -------
        Gradient
            ``thrust_N``, ``torque_Nm`` and the derivatives of both with respect to every element's ``chord`` [1/m] and
            ``beta`` [1/rad], (2, N), and to ``pitch`` [1/rad], ``rpm``, ``airspeed`` and ``density``, (2,). Thrust of
            the rotor alone, without duct and stator.

        Raises
        ------
        InputError
            For more than one point, one that does not converge, or effects that act around the rotor.

        Examples
        --------
        >>> g = propeller("10x5").gradient(rpm=6000, airspeed_m_s=5)
        >>> g.beta.shape, bool(g.pitch[0] > 0), bool(g.airspeed[0] < 0)
        ((2, 40), True, True)
        """
        from bemt.physics.bem.gradient import gradient

        one, V = conditions(self.case, rpm, airspeed_m_s, J)
        if one.size != 1:
            raise InputError(Fault("", "rpm", number_of(one.size, "point"), "one operating point"))
        return gradient(self._model, self._model.effects, float(one[0]), float(V[0]), self.case.air())

    @cached_property
    def _model(self) -> Model:
        """The rotor prepared once."""
        from bemt.rotors.case.prepare import prepare_case

        return prepare_case(self.case)

    def replaced(self, changes: Mapping[str, Any]) -> Propeller:
        """Change values of the case; a declared unknown that is set becomes known.

        Parameters
        ----------
        changes : mapping
            Dotted key, as in a case file, to value: ``{"blade.pitch_in": 6}``.

        Returns
        -------
        Propeller
            A new propeller.

        Examples
        --------
        >>> p = propeller("10x5")
        >>> steeper = p.replaced({"blade.pitch_in": 7})
        >>> bool(steeper.solve(6000, bands=False).thrust_N > p.solve(6000, bands=False).thrust_N)
        True
        """
        import tomlkit

        given: object = changes
        if not isinstance(given, Mapping):
            expected = "a mapping of dotted keys to values"
            raise InputError(Fault("", "changes", repr(changes), expected, 'As in {"blade.pitch_in": 6}'))
        case = self.case.replaced(changes)
        written = {key: value for key, value in case.written.items() if key != "assumptions"}
        unknowns = case.declared(lambda key: key not in changes)
        text = tomlkit.dumps(written | ({"assumptions": unknowns} if unknowns else {}))
        return Propeller(case_of(text, self.case.folder), text)

    def write(self, folder: str | os.PathLike[str]) -> Path:
        """Write the case to a new folder, for use on the command line.

        Parameters
        ----------
        folder : str or path
            Folder for ``case.toml``; it must not contain one.

        Returns
        -------
        Path
            The written file.

        Raises
        ------
        InputError
            If there is a case already, or the folder cannot be written.

        Examples
        --------
        >>> import tempfile
        >>> file = propeller("10x5").write(Path(tempfile.mkdtemp()) / "mine")
        >>> load(file).name
        'prop_10x5'
        """
        from bemt.base.errors import system_fault
        from bemt.base.tables import write_atomic

        file = Path(path_text("folder", folder)) / "case.toml"
        if file.exists():
            raise InputError(Fault(file.as_posix(), "", "an existing file", "a new folder"))
        try:
            write_atomic(file, self.text)
        except OSError as error:
            raise InputError(system_fault(error)) from error
        return file


def _size_faults(told: Mapping[str, tuple[float, float]], label: str | None) -> list[Fault]:
    """What is wrong with diameters by key: value and its unit. [m]"""
    faults = []
    for key, (value, unit) in told.items():
        if not 0.01 <= value * unit <= 10.0:
            hint = "Is that in mm? Divide by 1000" if unit == 1.0 and 10.0 < value <= 1e4 else ""
            ends = f"{0.01 / unit:.4g} to {10.0 / unit:.4g} {key.partition('_')[2]}"
            faults.append(Fault("", key, f"{value:g}", ends, hint))
        if label is not None:
            faults.append(Fault("", key, f"{value:g}", "nothing, because the label states it"))
    return faults


def _source_faults(label: Any, stations: Any, told: Mapping[str, Any], blades: Any, reading: Any) -> Iterator[Fault]:
    """Faults of what a propeller is to be made of."""
    as_in = 'As in propeller("10x5")'
    if (label is None) == (stations is None):
        yield Fault("", "label, stations", "neither" if label is None else "both", "one of them", as_in)
    if stations is not None and not told:
        yield Fault("", "diameter_in, diameter_mm", "nothing", "the diameter, with stations")
    if len(told) > 1:
        yield Fault("", ", ".join(told), "together", "one of them")
    if label is not None and not isinstance(label, str):
        yield Fault("", "label", repr(label), "a text: diameter x pitch in inches", as_in)
    if blades is not None and not (isinstance(blades, (int, np.integer)) and blades >= 1):
        yield Fault("", "blades", repr(blades), "a whole number of 1 or more")
    if stations is not None and reading is not None:
        yield Fault("", "reading", "with stations", "a label")


@worded
def propeller(
    label: str | None = None, *, stations: str | os.PathLike[str] | None = None, diameter_m: float | None = None,
    diameter_in: float | None = None, diameter_mm: float | None = None, blades: int | None = None,
    rpm: float | None = None, airspeed_m_s: float = 0.0, reading: str | Mapping[str, float] | None = None,
) -> Propeller:  # fmt: skip
    """Create a propeller from a label or from a file of blade stations.

    Parameters
    ----------
    label : str, optional
        Diameter x pitch in inches, and blades if not two: ``"10x5"``, ``"8x4.5x3"``.
    stations : str or path, optional
        Instead of the label: a CSV with ``r_over_R,chord_over_R,beta_deg`` (r and chord may be lengths, such as
        ``r_mm``), a UIUC geometry file or an APC PE0 file.
    diameter_m, diameter_in, diameter_mm : float, optional
        Diameter, one of them with `stations`. [m, in, mm]
    blades : int, optional
        Number of blades; by default from the label, else 2.
    rpm : float, optional
        Default speed of :meth:`Propeller.solve`. [rev/min]
    airspeed_m_s : float
        Default airspeed of :meth:`Propeller.solve`. [m/s]
    reading : str or mapping, optional
        With a label: one reading of this propeller, or several: ``rpm=5400,thrust_g=410``.

    Returns
    -------
    Propeller
        Everything that is not given is a declared unknown with a range, see :attr:`Propeller.unknowns`.

    Raises
    ------
    InputError
        For an unreadable label or file, or values that do not define a propeller.

    Examples
    --------
    >>> propeller("8x4.5x3").blades
    3
    >>> propeller("ten by five")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: label: 'ten by five': got unreadable text; expected ...
    """
    sizes = {"diameter_m": (diameter_m, 1.0), "diameter_in": (diameter_in, INCH), "diameter_mm": (diameter_mm, 1e-3)}
    told = {key: (number(key, v), unit) for key, (v, unit) in sizes.items() if v is not None}
    if stations is not None:
        stations = path_text("stations", stations)
    rpm = None if rpm is None else number("rpm", rpm)
    airspeed_m_s = number("airspeed_m_s", airspeed_m_s)
    refuse([*_source_faults(label, stations, told, blades, reading), *_size_faults(told, label)])
    if label is not None:
        told_by = None if reading is None else reading_text(reading)
        text = fresh.label_text(label, blades, rpm, airspeed_m_s, reading=told_by)
        case = case_of(text)
        if reading is not None:
            case.as_built()  # refuses a reading that no such rotor gives
        return Propeller(case, text)
    assert stations is not None
    ((value, unit),) = told.values()
    diameter_m, file = value * unit, Path(stations)
    hub, key, found = fresh.of_stations(file, diameter_m)
    text = fresh.stations_text(file.name, diameter_m, blades or 2, rpm, airspeed_m_s, hub, key, found=found)
    return Propeller(case_of(text, file.parent), text)


def load(path: str | os.PathLike[str]) -> Propeller:
    """Read a case.

    Parameters
    ----------
    path : str or path
        ``case.toml`` or its folder.

    Returns
    -------
    Propeller
        The propeller or fan of the case.

    Raises
    ------
    InputError
        With every fault of the file.

    Examples
    --------
    >>> load("cases/prop_8x5").solve(rpm=8000, bands=False).thrust_N.round(1)
    array([3.9])
    >>> load("no/such/folder")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such/folder: got no such file or folder; expected ...
    """
    files = find_cases([path_text("path", path)])
    if len(files) != 1:
        raise InputError(Fault(os.fspath(path), "", number_of(len(files), "case"), "one case", "Name its folder"))
    case = load_case(files[0])
    return Propeller(case, case.path.read_text(encoding="utf-8-sig"))


def rotor_of(given: Propeller | Case | str | os.PathLike[str]) -> Propeller:
    """Propeller as it is, of a case, or of a label."""
    if isinstance(given, Propeller):
        return given
    if isinstance(given, Case):
        return Propeller(given, given.path.read_text(encoding="utf-8-sig") if given.path.is_file() else "")
    what: object = given
    if not isinstance(what, (str, os.PathLike)):
        expected = "a Propeller, a case or a label"
        raise InputError(Fault("", "case", f"{type(given).__name__} {given!r:.40}", expected))
    text = os.fspath(given)
    if Path(text).exists() or fresh.is_path(text):
        return load(text)
    if size := fresh.own_name(text):
        near = [case.parent.name for case in Path().glob(f"{glob.escape(text)}*/{FILE_NAME}")]
        meant = f"Meant {' or '.join(sorted(near)[:3])}?" if near else ""
        raise InputError(Fault(text, "", "no folder or case of this name", f"a case, or a label: {size}", meant))
    try:
        return propeller(text)
    except InputError as error:
        got, expected = "no folder or case of this name, and no label", "a case, its folder, or a label such as 10x5"
        if text[:1].isdigit():
            raise
        if fresh.looks_like_label(text):
            unread = [replace(f, got=f"{got}: {f.got}") for f in error.faults]
            raise InputError(unread) from None
        raise InputError(Fault(text, "", got, expected)) from None
