"""Find the parameter sets of the catalog by name."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from bywire import catalog
from bywire.catalog.provenance import Cited
from bywire.core.discovery import pick
from bywire.core.parameters import ParameterSet


@dataclass(frozen=True)
class Entry:
    """A named parameter set.

    Parameters
    ----------
    name
        What bench files and the command line call it.
    assembly
        Name of the assembly that it is for.
    source
        Full citation.
    summary
        One line for listings.
    parameter_class
        Class that validates the values.
    values
        Every value by dotted name, with its provenance.
    """

    name: str
    assembly: str
    source: str
    summary: str
    parameter_class: type[ParameterSet]
    values: Mapping[str, Cited]

    def parameters(self) -> ParameterSet:
        """Return the validated parameter set."""
        return self.parameter_class.create({k: c.value for k, c in self.values.items()})


@cache
def entries() -> Mapping[str, Entry]:
    """Return every entry of the catalog: all ``ENTRIES`` of the modules in this folder."""
    return {name: one for module in _modules() for name, one in _of_module(module).items()}


def _modules() -> list[str]:
    return [module.name for module in pkgutil.iter_modules(catalog.__path__)]


@cache
def _of_module(module: str) -> Mapping[str, Entry]:
    loaded = importlib.import_module(f"{catalog.__name__}.{module}")
    return {one.name: one for one in getattr(loaded, "ENTRIES", ())}


def entry(name: str) -> Entry:
    """Return one entry.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    module = name.partition("-")[0]  # a name begins with its module: one import instead of all
    known = _of_module(module) if module in _modules() else {}
    return known[name] if name in known else pick(entries(), name, "parameter set")


def main_set(assembly: str) -> str:
    """Return the name of the first parameter set that the catalog has for an assembly."""
    return next(name for name, one in entries().items() if one.assembly == assembly)


def parameters(name: str) -> ParameterSet:
    """Return the parameters of a set of the catalog, validated.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    return entry(name).parameters()
