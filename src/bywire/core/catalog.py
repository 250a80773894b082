"""Parameter sets by name, every value with its source."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any

from bywire.core.brake import brakes, loaded_files
from bywire.core.errors import ModelError, ParameterError
from bywire.core.parameters import ParameterSet, require_units
from bywire.core.provenance import Cited, chosen
from bywire.core.registry import Kind, instances


@dataclass(frozen=True)
class CitedSet:
    """A named parameter set.

    Parameters
    ----------
    name
        What bench files and the command line call it.
    assembly
        Name of the assembly that it is for.
    source
        Full citation; empty where the values have none.
    summary
        One line for listings.
    parameter_class
        Class that validates the values.
    values
        Every value by dotted name, with its provenance; a plain one counts as chosen.
    """

    name: str
    assembly: str
    source: str
    summary: str
    parameter_class: type[ParameterSet]
    values: Mapping[str, Any]

    def __post_init__(self) -> None:
        require_units(self.parameter_class)
        plain = {k: v for k, v in self.values.items() if not isinstance(v, Cited)}
        cited = {k: chosen(v, "") for k, v in plain.items()}
        object.__setattr__(self, "values", {**self.values, **cited})
        object.__setattr__(self, "source", self.source or "not given")

    def parameters(self) -> ParameterSet:
        """Return the validated parameter set."""
        try:
            return self.parameter_class.create({k: c.value for k, c in self.values.items()})
        except ParameterError as error:
            raise ParameterError(f"parameter set {self.name!r}: {error}") from None


PARAMETER_SETS = Kind("parameter set", ("sets",), instances(CitedSet), declared="a CitedSet")
"""every parameter set of every brake"""


def main_set(assembly: str, beside: type | None = None) -> str:
    """Return the name of the first parameter set that there is for an assembly.

    Parameters
    ----------
    assembly
        Name of the assembly.
    beside
        A class of the brake that is asked first, so that no other brake need be loaded.

    Raises
    ------
    ModelError
        When there is none.
    """
    first = () if beside is None else (PARAMETER_SETS.beside(beside),)
    rest = (PARAMETER_SETS.of(brake.module) for brake in brakes().values())
    for sets in chain(first, rest):  # as many as it takes: their models are loaded with them
        for name, cited in sets.items():
            if cited.assembly == assembly:
                return name
    raise ModelError(
        f"there is no parameter set for a {assembly}: declare a bywire.CitedSet of that assembly"
    )


def sets_of_loaded() -> tuple[str, ...]:
    """Return the names of the parameter sets of all brakes that were loaded by their path.

    Such a brake is the one that a user means: its set is taken where it is the only one.
    """
    files = loaded_files()
    loaded = [brake.module for brake in brakes().values() if brake.file in files]
    return tuple(name for module in loaded for name in PARAMETER_SETS.of(module))


def parameters(name: str) -> ParameterSet:
    """Return the parameters of a set, validated.

    Parameters
    ----------
    name
        Of the parameter set, see ``bywire list``.

    Returns
    -------
    ParameterSet
        The values by group, SI units inside.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    return PARAMETER_SETS.find(name).parameters()
