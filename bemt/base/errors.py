"""Faults, input errors and warnings that every room of the project shares.

A :class:`Fault` is one thing wrong with one place of one file, phrased as ``file: where: got X; expected Y. Hint.``
An :class:`InputError` carries *all* faults that were found, so that a user repairs a file in one pass.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

__all__ = [
    "EXIT_INPUT", "EXIT_INTERNAL", "EXIT_OK", "EXIT_UNCONVERGED", "BemtWarning", "Fault",
    "InputError", "RangeWarning", "gathered", "needs", "refuse", "system_fault",
]  # fmt: skip

EXIT_OK = 0
"""Everything fine."""
EXIT_UNCONVERGED = 1
"""Out of tolerance or unconverged."""
EXIT_INPUT = 2
"""Usage or input error."""
EXIT_INTERNAL = 3
"""Internal error (a bug)."""


@dataclass(frozen=True)
class Fault:
    """One thing wrong with one place of one input.

    Parameters
    ----------
    file : str
        File (or other input) that holds the fault; empty when there is none.
    where : str
        Dotted key, or ``line:column`` for tables; empty when the whole file is meant.
    got : str
        What was found there.
    expected : str
        What would have been right.
    hint : str
        How to repair it; may be empty.
    choices : tuple of str
        Names of which one is expected, where a program may ask; not printed.

    Examples
    --------
    >>> print(Fault("case.toml", "operating.rpm", "-5", "a number from 10 to 300000 rev/min", "Drop the sign"))
    case.toml: operating.rpm: got -5; expected a number from 10 to 300000 rev/min. Drop the sign.
    >>> print(Fault("", "rpm", "nan", "a finite number"))
    rpm: got nan; expected a finite number.
    """

    file: str
    where: str
    got: str
    expected: str
    hint: str = ""
    choices: tuple[str, ...] = field(default=(), kw_only=True)

    def __str__(self) -> str:
        head = "".join(f"{part}: " for part in (self.file, self.where) if part)
        text = f"{head}got {self.got}; expected {self.expected.rstrip('.')}."
        if self.hint:
            text += f" {self.hint.rstrip('.')}" + ("" if self.hint.endswith("?") else ".")
        return text


class InputError(ValueError):
    """Bad input: carries every fault found; the command line leaves with exit code 2.

    Parameters
    ----------
    faults : Fault, or iterable of Fault
        All faults found; at least one.

    Examples
    --------
    >>> error = InputError([Fault("a.csv", "3:2", "'x'", "a number"), Fault("a.csv", "", "no rows", "one row or more")])
    >>> print(error)
    a.csv: 3:2: got 'x'; expected a number.
    a.csv: got no rows; expected one row or more.
    >>> error.exit_code, len(error.faults)
    (2, 2)
    """

    exit_code: int = EXIT_INPUT

    def __init__(self, faults: Fault | Iterable[Fault]) -> None:
        self.faults: tuple[Fault, ...] = (faults,) if isinstance(faults, Fault) else tuple(faults)
        if not self.faults:
            raise TypeError("InputError needs at least one Fault")
        super().__init__("\n".join(str(fault) for fault in self.faults))

    def __reduce__(self) -> tuple[type[InputError], tuple[tuple[Fault, ...]]]:
        """Pickle by the faults (worker processes send errors back)."""
        return (type(self), (self.faults,))


def refuse(faults: Iterable[Fault]) -> None:
    """Raise all faults that were found; nothing happens where there are none.

    Parameters
    ----------
    faults : iterable of Fault
        What was found.

    Raises
    ------
    InputError
        With all of them.
    """
    if found := tuple(faults):
        raise InputError(found)


class gathered:
    """Add the faults of what is refused inside to others, and go on.

    >>> faults = []
    >>> with gathered(faults):
    ...     raise InputError(Fault("a.csv", "", "no rows", "one row or more"))
    >>> len(faults)
    1
    """

    def __init__(self, faults: list[Fault]) -> None:
        self._faults = faults

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: object, trace: object) -> bool:
        """Whether it was a refusal."""
        self._faults += error.faults if isinstance(error, InputError) else ()
        return isinstance(error, InputError)


def system_fault(error: OSError, file: str = "", expected: str = "a file or folder that can be used") -> Fault:
    """Say what the system would not do; what is missing is called missing.

    Parameters
    ----------
    error : OSError
        With the system's word, `strerror`; an error of a library may have none, and is quoted.
    file : str
        As the user called it; empty: as the error does.
    expected : str
        What would have been right.

    Returns
    -------
    Fault
        The fault, at the file that the error names.

    Examples
    --------
    >>> print(system_fault(OSError(28, "No space left on device", "out/grid.csv")))
    out/grid.csv: got No space left on device; expected a file or folder that can be used.
    """
    place = file or str(error.filename or "")
    if isinstance(error, FileNotFoundError):
        return Fault(place, "", "no such file or folder", expected, "Check the path")
    return Fault(place, "", error.strerror or str(error), expected)


def installs(extra: str) -> str:
    """Command that installs an extra of this project."""
    return f'python -m pip install "bemt[{extra}]"'


def needs(module: str, extra: str) -> Any:
    """Import a library that an extra brings, or say which extra is missing.

    Parameters
    ----------
    module : str
        Dotted name of the module.
    extra : str
        Extra of this project that installs it.

    Returns
    -------
    module
        The imported module.

    Raises
    ------
    InputError
        When it is not installed.

    Examples
    --------
    >>> needs("math", "cad").floor(2.5)
    2
    >>> needs("no_such_library", "cad")
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no_such_library: got a library that is not installed; expected the extra [cad].
    Install it with python -m pip install "bemt[cad]".
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or not module.startswith(error.name):
            raise
        hint = f"Install it with {installs(extra)}"
        raise InputError(Fault(module, "", "a library that is not installed", f"the extra [{extra}]", hint)) from error


class BemtWarning(UserWarning):
    """Base of the warnings of this project."""


class RangeWarning(BemtWarning):
    """A model is used outside the range that its source states."""
