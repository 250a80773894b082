"""Page of each physical element and control law: figure, equations, parameters, signals, faults."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pkgutil
import typing
from collections.abc import Iterator
from types import ModuleType

from bywire import control, plant
from bywire.core.brake import brakes
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, field_notes, leaf_fields
from bywire.core.signals import signals_of
from bywire.report.wording import range_text, unit_text
from site_pages import element_figures

_ROOMS = {"elements": "Elements", "laws": "Laws"}


def modules() -> dict[str, dict[str, ModuleType]]:
    """Return title of a folder -> name -> element or law; general folders come first."""
    rooms = {"Elements": _inside(plant), "Control laws": _inside(control)}
    for brake in brakes().values():
        for folder, title in _ROOMS.items():
            name = f"{brake.module}.{folder}"
            if importlib.util.find_spec(name) is not None:
                rooms[f"{title} of the {brake.name}"] = _inside(importlib.import_module(name))
    return rooms


def _inside(package: ModuleType) -> dict[str, ModuleType]:
    names = (each.name for each in pkgutil.iter_modules(package.__path__))
    return {n: importlib.import_module(f"{package.__name__}.{n}") for n in names}


def index() -> str:
    """Return the page that lists all elements and laws."""
    lines = ["Elements and control laws", "=" * 25, ""]
    for title, inside in modules().items():
        lines += [title, "-" * len(title), ""]
        rows = ([f":doc:`{name} <{m.__name__}>`", _summary(m)] for name, m in inside.items())
        lines += _list_table(["name", "meaning"], rows)
        lines += [".. toctree::", "   :hidden:", ""]
        lines += [f"   {module.__name__}" for module in inside.values()] + [""]
    return "\n".join(lines)


def _summary(module: ModuleType) -> str:
    return " ".join((inspect.getdoc(module) or "").partition("\n\n")[0].split())


def page(module: ModuleType) -> str:
    """Return the page of an element or law, as reStructuredText for Sphinx's autodoc."""
    name = module.__name__
    title = name.rpartition(".")[2].replace("_", " ").capitalize()
    lines = [title, "=" * len(title), "", f".. py:module:: {name}", ""]
    lines += [inspect.getdoc(module) or "", "", *element_figures.lines(module)]
    functions = [f for f in _declared_here(module) if inspect.isfunction(f)]
    if functions:
        lines += ["Equations", "-" * 9, ""]
    for function in functions:
        lines += [f".. autofunction:: {name}.{function.__name__}", ""]
    for each in _declared_here(module):
        if isinstance(each, type) and issubclass(each, ParameterSet):
            lines += _heading(each) + _parameters(each)
        elif isinstance(each, type) and issubclass(each, tuple):
            lines += _heading(each) + _signals(each)
    lines += _faults(getattr(module, "FAULTS", ()))
    return "\n".join(lines)


def _declared_here(module: ModuleType) -> Iterator[typing.Any]:
    for name, value in vars(module).items():
        if not name.startswith("_") and getattr(value, "__module__", "") == module.__name__:
            yield value


def _heading(cls: type) -> list[str]:
    return [cls.__name__, "-" * len(cls.__name__), "", inspect.getdoc(cls) or "", ""]


def _list_table(headings: list[str], rows: Iterator[list[str]]) -> list[str]:
    lines = [".. list-table::", "   :header-rows: 1", ""]
    for row in (headings, *rows):
        for k, cell in enumerate(row):
            # An empty cell is still a cell.
            lines.append(f"   {'  ' if k else '* '}- {cell}".rstrip())
    return [*lines, ""]


def _parameters(cls: type[ParameterSet]) -> list[str]:
    leaves, notes = leaf_fields(cls), field_notes(cls)

    def rows() -> Iterator[list[str]]:
        for name, info in cls.model_fields.items():
            leaf = leaves.get(name)
            if leaf is not None:
                unit, limits = unit_text(leaf.unit.symbol) or "1", range_text(leaf)
            else:
                unit, limits = "", ", ".join(f"``{c}``" for c in typing.get_args(info.annotation))
            yield [f"``{name}``", unit, limits, notes.get(name, "").replace("*", r"\*")]

    return _list_table(["name", "unit", "range or choices", "meaning"], rows())


def _signals(cls: type) -> list[str]:
    known = signals_of(cls).items()
    rows = [[f"``{name}``", unit_text(s.unit) or "1", s.label] for name, s in known]
    return _list_table(["name", "unit", "meaning"], iter(rows)) if rows else []


def _faults(faults: tuple[ParameterFault, ...]) -> list[str]:
    if not faults:
        return []
    rows = ([f"``{fault.name}``", fault.summary] for fault in faults)
    return ["Faults", "------", "", *_list_table(["name", "effect"], rows)]
