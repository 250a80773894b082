"""Find the parameter sets of the catalog by name."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from bywire import catalog
from bywire.catalog.provenance import Cited
from bywire.core.errors import unknown_name
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
    found: dict[str, Entry] = {}
    for module in pkgutil.iter_modules(catalog.__path__):
        loaded = importlib.import_module(f"{catalog.__name__}.{module.name}")
        for entry in getattr(loaded, "ENTRIES", ()):
            found[entry.name] = entry
    return found


def entry(name: str) -> Entry:
    """Return one entry.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    known = entries()
    if name not in known:
        raise unknown_name("parameter set", name, known)
    return known[name]


def parameters(name: str) -> ParameterSet:
    """Return the parameters of a set of the catalog, validated.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    return entry(name).parameters()
