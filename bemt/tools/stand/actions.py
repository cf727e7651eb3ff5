"""Action ``stand``: a stand that answers."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Literal

from bemt.base.action import Count, action

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bemt.rotors.propeller import Propeller
    from bemt.tools.stand.session import StandAnswer

    Path = str | os.PathLike[str]

__all__ = ["stand"]


@action(
    "Recordings", "stand cases/prop_8x5 --yes --out sitting", words=("case",),
    common=("on", "address", "largest_us", "current_A", "top_rpm", "wind_m_s", "yes", "out"),
)  # fmt: skip
def stand(
    case: Propeller | Path, *, out: Path,
    on: Literal["simulated", "flightstand", "rcbenchmark", "serial"] = "simulated",
    address: str = "", line: str = "", largest_us: float | None = None, ramp_us_s: float | None = None,
    current_A: float | None = None, vibration_m_s2: float | None = None, top_rpm: float | None = None,
    wind_m_s: float = 0.0, temperature_C: float | None = None, pressure_hPa: float | None = None, runs: Count = 3,
    fault: Sequence[str] = (), seed: int | None = None, lapse: float = 100.0, yes: bool = False,
    progress: Callable[[str], None] | None = None,
) -> StandAnswer:  # fmt: skip
    """Measure a rotor on a stand, diagnose it, and make the runs that decide.

    A process of its own holds the wire and stops the motor: without a heartbeat, without rows, at a reading that is no
    number, above a limit, at Ctrl-C, at an error and at the end. Each run is shown and confirmed.

    Parameters
    ----------
    case : Propeller, str or path
        Propeller, case or label on the stand.
    out : path
        New folder for recordings, log, and the story.
    on : {"simulated", "flightstand", "rcbenchmark", "serial"}
        Stand: simulated with a sealed fault, Tyto Flight Stand (extra stand), RCbenchmark (UDP), or a serial line
        (extra stand).
    address : str
        Where it is: host:port, host:port:own port, or device@baud; the usual one where it is empty.
    line : str
        Format of a serial line, S{pulse_us} -> {time_ms},{thrust_gf},{torque_mNm},{rpm},{current_A} by default.
    largest_us : float, optional
        Largest pulse width; from the case's ESC, else asked for. [us]
    ramp_us_s : float, optional
        Fastest rise of the pulse width; asked for on a real stand. [us/s]
    current_A : float, optional
        Current at which the motor is stopped; from the case's ESC, else asked for. [A]
    vibration_m_s2 : float, optional
        Vibration at which it is stopped. [m/s2]
    top_rpm : float, optional
        Top of the speed range; that of the case by default. At a tenth above it the motor is stopped. [rev/min]
    wind_m_s : float
        Most that the tunnel gives; 0 without one. [m/s]
    temperature_C, pressure_hPa : float, optional
        Air at the stand; asked for once. [C], [hPa]
    runs : int
        Most runs after the first recording.
    fault : sequence of str
        What is wrong with the simulated stand; drawn and sealed by default.
    seed : int, optional
        Seed of the simulated stand; from the operating system by default.
    lapse : float
        How much faster the simulated stand's time runs. [1]
    yes : bool
        Do not ask before each run; simulated stands only.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    StandAnswer
        ``.found``, ``.course``, ``.text``, ``.to_dict()`` of schema ``bemt.stand/1``, ``.files``; ``exit_code`` 1 if
        the guard stopped the motor.

    Raises
    ------
    InputError
        For a stand that does not answer, a limit that cannot be, and a run that nobody confirms.

    Examples
    --------
    >>> stand("10x5", out="x", on="serial", yes=True)
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: yes: got a real stand; expected on="simulated". Runs of a real stand are confirmed.
    """
    import shutil
    from pathlib import Path as File

    from bemt.base.errors import Fault, refuse
    from bemt.base.given import path_text
    from bemt.rotors.propeller import rotor_of
    from bemt.tools.stand.session import sit

    folder, faults = File(path_text("out", out)), []
    if yes and on != "simulated":
        faults.append(Fault("", "yes", "a real stand", 'on="simulated"', "Runs of a real stand are confirmed"))
    if on != "simulated" and (fault or seed is not None):
        faults.append(Fault("", "fault, seed", "a real stand", 'on="simulated"'))
    if not lapse >= 1.0:
        faults.append(Fault("", "lapse", f"{lapse:g}", "1 or more"))
    if wind_m_s < 0.0:
        faults.append(Fault("", "wind_m_s", f"{wind_m_s:g}", "0 m/s or more"))
    if folder.exists() and any(folder.iterdir()):
        faults.append(Fault(folder.as_posix(), "", "a folder with files", "a new folder"))
    refuse(faults)
    given = {"largest_us": largest_us, "ramp_us_s": ramp_us_s, "current_A": current_A, "pressure_hPa": pressure_hPa,
             "vibration_m_s2": vibration_m_s2, "temperature_C": temperature_C}  # fmt: skip
    try:
        return sit(
            rotor_of(case), on, address, line, given, top_rpm=top_rpm, wind_m_s=wind_m_s, runs=runs, faults=fault,
            seed=seed, lapse=lapse if on == "simulated" else 1.0, yes=yes, out=folder,
            say=progress or (lambda text: None),
        )  # fmt: skip
    except BaseException:
        if not list(folder.glob("1_*.csv")):  # nothing was measured: nothing stays
            shutil.rmtree(folder, ignore_errors=True)
        raise
