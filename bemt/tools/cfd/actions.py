"""Action ``cfd``: campaigns of OpenFOAM runs."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from bemt.base.action import Count, Told, action
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

if TYPE_CHECKING:
    from collections.abc import Callable

    Path = str | os.PathLike[str]

__all__ = ["cfd"]


@action(
    "Solids and CFD", "cfd campaign.toml --ranks 4", words=("campaign",), shown=True,
    common=("only", "ranks", "work", "keep"),
)  # fmt: skip
def cfd(
    campaign: Path, *, only: Count | None = None, ranks: Count = 2, work: Path | None = None, keep: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Told:  # fmt: skip
    """Run a campaign of OpenFOAM cases and record the results.

    Parameters
    ----------
    campaign : path
        campaign.toml or its folder.
    only : int, optional
        Run only this point, even if it is recorded.
    ranks : int
        Processes per run.
    work : path, optional
        Folder for grids and runs; temporary by default.
    keep : bool
        Keep the work folder.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Told
        Schema ``bemt.cfd-run/1``; ``exit_code`` 1 if a point did not converge.

    Raises
    ------
    InputError
        For a campaign that cannot be read, or without OpenFOAM.

    Examples
    --------
    >>> cfd("no/such/campaign.toml")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such/campaign.toml: got ...
    """
    from bemt.tools.cfd import campaign as campaigns

    name = os.fspath(campaign)
    say = progress
    told = None if say is None else (lambda line: say(f"{line}\n"))
    record = campaigns.run(name, only, ranks, None if work is None else os.fspath(work), keep, told)
    code = EXIT_OK if all(row.settled for row in record.rows) else EXIT_UNCONVERGED
    return Told(campaigns.document(record), campaigns.text(record), exit_code=code)
