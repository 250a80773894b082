"""The public names of Python with their docstrings."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator
from typing import Any, get_origin

import bywire
from bywire import authoring
from bywire.core.lazy_names import LazyNames
from bywire.core.quantities import Unit
from bywire.core.signals import Signal
from bywire.report.wording import unit_text


def public() -> dict[str, Any]:
    """Return public name -> object."""
    return {name: getattr(bywire, name) for name in bywire.__all__}


def homes() -> dict[str, str]:
    """Return the full name of an object -> the name that users import."""
    known = {}
    for face in (authoring, bywire):  # if there are two names, use the shorter one
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
        "``import bywire`` is fast, because modules load on first use. If a function is also a "
        "command, both have the same arguments and warnings.",
        "",
    ]
    functions = {n: f for n, f in public().items() if inspect.isfunction(f)}
    for title, names in (("Functions", functions), ("Classes", public().keys() - functions)):
        lines += [title, "-" * len(title), ""]
        for name in sorted(names):
            lines += _entry("bywire", name, getattr(bywire, name))
    return "\n".join(lines)


def authoring_pages() -> Iterator[tuple[str, str]]:
    """Yield file and text of the pages of names for writing models, a page per module."""
    homes = LazyNames(authoring.__file__).homes
    modules: dict[str, list[str]] = {}
    for name in sorted(authoring.__all__, key=str.lower):
        modules.setdefault(homes[name][0], []).append(name)
    for module, names in sorted(modules.items()):
        about = (inspect.getdoc(importlib.import_module(module)) or "").partition("\n\n")[0]
        entries = [line for name in names for line in _authoring_entry(name)]
        title = module.removeprefix("bywire.")
        lines = [title, "=" * len(title), "", about, "", *entries]
        yield f"authoring/{module}.rst", "\n".join(lines)
    title = "Names for writing models"
    lines = [title, "=" * len(title), "", inspect.getdoc(authoring) or "", ""]
    lines += [".. list-table::", "   :header-rows: 1", ""]
    rows = [["name", "meaning", "page"]]
    for module, names in modules.items():
        page = f":doc:`{module.removeprefix('bywire.')} <{module}>`"
        rows += [[f":obj:`~bywire.authoring.{name}`", _summary(name), page] for name in names]
    for row in [rows[0], *sorted(rows[1:], key=lambda row: row[0].lower())]:
        # An empty cell is still a cell.
        lines += [f"   {'  ' if k else '* '}- {cell}".rstrip() for k, cell in enumerate(row)]
    lines += ["", ".. toctree::", "   :hidden:", "", *(f"   {m}" for m in sorted(modules)), ""]
    yield "authoring/index.rst", "\n".join(lines)


def _authoring_entry(name: str) -> list[str]:
    thing = getattr(authoring, name)
    if public().get(name) is not thing:
        return _entry("bywire.authoring", name, thing)
    return [f".. py:data:: bywire.authoring.{name}", "", f"   See :obj:`bywire.{name}`.", ""]


def _summary(name: str) -> str:
    """Return the first line about a name for writing models."""
    thing = getattr(authoring, name)
    if inspect.isfunction(thing) or inspect.isclass(thing) or inspect.ismodule(thing):
        line = (inspect.getdoc(thing) or "").partition("\n\n")[0]
        return re.sub(r"\s+", " ", line)
    return _constant(thing)


def errors_page() -> str:
    """Return the page of errors, as reStructuredText."""
    return "\n".join(
        [
            "Errors",
            "======",
            "",
            "If a command fails, it prints one line and exits with the status below. Status 1 "
            "means that a requirement or check is not met. Status 130 means that you interrupted "
            "the command. For messages with causes and remedies, see :doc:`../troubleshooting`.",
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
    return [f".. py:data:: {face}.{name}", "", f"   {_constant(thing)}", ""]


def _constant(thing: Any) -> str:
    """Return a sentence about a name that is neither a function nor a class."""
    if inspect.ismodule(thing):
        return f"Module: {(inspect.getdoc(thing) or '').partition(chr(10) * 2)[0]}"
    units = [note.symbol for note in getattr(thing, "__metadata__", ()) if isinstance(note, Unit)]
    if units:
        return f"Quantity in {unit_text(units[0]) or '1'}."
    labels = [n for n in getattr(thing, "__metadata__", ()) if isinstance(n, Signal)]
    if labels:
        return f"Signal in {unit_text(labels[0].unit) or '1'}: {labels[0].label}."
    if not get_origin(thing):
        return f"``{type(thing).__name__}``"
    name = re.sub(r"\b(?:\w+\.)+(?=\w)", "", str(thing))  # without the modules
    return f"``{name}``"
