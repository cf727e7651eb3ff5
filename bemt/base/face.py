"""How the public face looks: rooms that are also functions, and answers as a notebook shows them."""

from __future__ import annotations

import html
import importlib
import inspect
from collections.abc import Mapping
from types import ModuleType
from typing import Any


class _Help(str):
    """Docstring of the class, which gives every room that of its function when it is read."""

    def __get__(self, room: CallableRoom | None, owner: type) -> str:
        return str(self) if room is None else room._help()

    def __set__(self, room: CallableRoom, text: str) -> None:  # else what stands in the module's file would win
        raise AttributeError("__doc__ of a room is that of its function")


class CallableRoom(ModuleType):
    """Package whose call, signature and help are those of the function of its name in ``bemt.library``.

    So ``bemt.diagnose(...)``, ``help(bemt.diagnose)`` and ``from bemt.diagnose import plan`` all work.
    """

    def _help(self) -> str:
        """Docstring of the function, then that of the package; examples are tested where the function is."""
        name, function = self.__name__, inspect.getdoc(self._function()) or ""
        lead, _, rest = function.partition("\n\n")
        quoted = "\n".join(f"| {line}" if line.startswith((">>>", "...")) else line for line in rest.splitlines())
        package = inspect.cleandoc(self.__dict__.get("__doc__") or "")
        return f"{lead}\n\n{name}{self.__signature__}\n\n{quoted}\n\nThe package {name}: {package}\n"

    __doc__ = _Help(__doc__ or "")

    def __call__(self, *args: Any, **more: Any) -> Any:
        """Call the function of the public face."""
        return self._function()(*args, **more)

    def _function(self) -> Any:
        return getattr(importlib.import_module("bemt.library"), self.__name__.rpartition(".")[2])

    @property
    def __signature__(self) -> inspect.Signature:
        return inspect.signature(self._function())


def as_html(head: str, text: str) -> str:
    """A heading and a text of fixed width, for notebooks.

    >>> as_html("a < b", "text")
    '<strong>a &lt; b</strong><pre style="line-height:1.35">text</pre>'
    """
    return f'<strong>{html.escape(head)}</strong><pre style="line-height:1.35">{html.escape(text)}</pre>'


def table_html(head: str, rows: Mapping[str, str]) -> str:
    """A heading and names with their values, for notebooks.

    >>> table_html("10x5", {"blades": "2"})
    '<strong>10x5</strong><table class="bemt"><tr><th>blades</th><td>2</td></tr></table>'
    """
    cells = "".join(f"<tr><th>{html.escape(k)}</th><td>{html.escape(v)}</td></tr>" for k, v in rows.items())
    return f'<strong>{html.escape(head)}</strong><table class="bemt">{cells}</table>'
