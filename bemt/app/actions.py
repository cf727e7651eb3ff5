"""Actions of the doors themselves: the page in the browser, completion in the shell."""

from __future__ import annotations

from typing import Literal

from bemt.base.action import Told, action
from bemt.base.errors import EXIT_INTERNAL, EXIT_OK

__all__ = ["completion", "ui"]


@action("Propellers and fans", "ui", shown=True)
def ui(*, port: int = 8501, browser: bool = True) -> Told:
    """Open a page in the browser: label, motor, curves with bands, a recording, the diagnosis, exports.

    Parameters
    ----------
    port : int
        Port on this machine, which alone can reach the page.
    browser : bool
        Open the browser.

    Returns
    -------
    Told
        When the page is closed with Ctrl-C.

    Raises
    ------
    InputError
        For a port that is in use or not 1024 to 65535, and without the extra ``ui``.

    Examples
    --------
    >>> ui(port=80)
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: port: got 80; expected 1024 to 65535.
    """
    from bemt.app import served
    from bemt.base.errors import Fault, InputError, needs

    if not 1024 <= port <= 65535:
        raise InputError(Fault("--port", "", f"{port}", "1024 to 65535"))
    if served.taken(port):
        raise InputError(Fault("--port", "", f"{port}, which is in use", "a free port", f"Try --port {port + 1}"))
    needs("streamlit", "ui")
    code = served.serve(port, browser)
    document = {"schema": "bemt.ui/1", "port": port, "returncode": code}
    return Told(document, "", exit_code=EXIT_OK if code == 0 else EXIT_INTERNAL)


@action("Models and checks", "completion bash", words=("shell",))
def completion(shell: Literal["bash", "zsh", "tcsh"]) -> Told:
    """Print the script that completes commands, options and file names in your shell.

    Parameters
    ----------
    shell : {"bash", "zsh", "tcsh"}
        Your shell.

    Returns
    -------
    Told
        The script.

    Raises
    ------
    InputError
        Without the extra ``completion``.
    """
    from bemt.app.cli import whole_parser
    from bemt.base.errors import needs

    shtab = needs("shtab", "completion")
    parser, parts = whole_parser()
    for one in parts:
        for action_ in one._actions:
            if action_.choices is None and action_.nargs != 0 and getattr(action_.type, "__name__", "") == "text":
                vars(action_)["complete"] = shtab.DIRECTORY if action_.dest in ("out", "work") else shtab.FILE
    script = shtab.complete(parser, shell=shell)
    return Told({"schema": "bemt.completion/1", "script": script}, script)
