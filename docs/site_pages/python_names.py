"""The public names of Python with their docstrings."""

from __future__ import annotations

import inspect
import re
from typing import Any, get_origin

import bywire
from bywire import authoring
from bywire.core.quantities import Unit
from bywire.report.wording import unit_text


def public() -> dict[str, Any]:
    """Return public name -> object."""
    return {name: getattr(bywire, name) for name in bywire.__all__}


def homes() -> dict[str, str]:
    """Return the full name of an object -> the name that users import."""
    known = {}
    for face in (authoring, bywire):  # of two names, the shorter
        for name in face.__all__:
            thing = getattr(face, name)
            home = getattr(thing, "__module__", "")
            if home.startswith("bywire."):
                known[f"{home}.{getattr(thing, '__qualname__', name)}"] = f"{face.__name__}.{name}"
    return known


def page() -> str:
    """Return the page of the package's functions and classes, as reStructuredText."""
    lines = [
        "Python",
        "======",
        "",
        "``import bywire`` is fast: modules load on first use. A function that is also a command "
        "takes the same arguments and gives the same warnings.",
        "",
    ]
    functions = {n: f for n, f in public().items() if inspect.isfunction(f)}
    for title, names in (("Functions", functions), ("Classes", public().keys() - functions)):
        lines += [title, "-" * len(title), ""]
        for name in sorted(names):
            lines += _entry("bywire", name, getattr(bywire, name))
    return "\n".join(lines)


def authoring_page() -> str:
    """Return the page of the names for writing models, as reStructuredText."""
    title = "Names for writing models"
    lines = [title, "=" * len(title), "", inspect.getdoc(authoring) or "", ""]
    both = public()
    for name in sorted(authoring.__all__, key=str.lower):
        thing = getattr(authoring, name)
        if both.get(name) is thing:  # described there
            lines += [f".. py:data:: bywire.authoring.{name}", ""]
            lines += [f"   See :obj:`bywire.{name}`.", ""]
        else:
            lines += _entry("bywire.authoring", name, thing)
    return "\n".join(lines)


def errors_page() -> str:
    """Return the page of errors, as reStructuredText."""
    return "\n".join(
        [
            "Errors",
            "======",
            "",
            "A command that fails prints one line and exits with the status below. Status 1 means "
            "that a requirement or check is not met, status 130 that the command was interrupted. "
            "Messages with causes and remedies: :doc:`../troubleshooting`.",
            "",
            ".. automodule:: bywire.core.errors",
            "   :members:",
            "   :show-inheritance:",
            "",
        ]
    )


def _entry(face: str, name: str, thing: Any) -> list[str]:
    if inspect.isfunction(thing):
        return [f".. autofunction:: {face}.{name}", ""]
    if inspect.isclass(thing):
        return [f".. autoclass:: {face}.{name}", "   :members:", ""]
    lines = [f".. py:data:: {face}.{name}", ""]
    if inspect.ismodule(thing):
        said = (inspect.getdoc(thing) or "").partition("\n\n")[0]
        return [*lines, f"   Module: {said}", ""]
    units = [note.symbol for note in getattr(thing, "__metadata__", ()) if isinstance(note, Unit)]
    if units:
        return [*lines, f"   Quantity in {unit_text(units[0]) or '1'}.", ""]
    return [*lines, f"   ``{_shown(thing)}``", ""]


def _shown(thing: Any) -> str:
    if not get_origin(thing):
        return type(thing).__name__
    return re.sub(r"\b(?:\w+\.)+(?=\w)", "", str(thing))  # without the modules
