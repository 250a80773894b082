"""Parameter sets by name, every value with its source."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

from bywire.core.arguments import checked
from bywire.core.brake import brakes, loaded_files
from bywire.core.errors import ModelError, ParameterError
from bywire.core.parameters import ParameterSet, require_units
from bywire.core.provenance import Cited, chosen
from bywire.core.registry import Kind, instances

_SAME = 1e-9  # of a derived value: rounding of its formula


@checked
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
        object.__setattr__(self, "values", computed_values({**self.values, **cited}))
        object.__setattr__(self, "source", self.source or "not given")

    def parameters(self) -> ParameterSet:
        """Return the validated parameter set."""
        try:
            return self.parameter_class.create({k: c.value for k, c in self.values.items()})
        except ParameterError as error:
            raise ParameterError(f"parameter set {self.name!r}: {error}") from None


def computed_values(values: Mapping[str, Cited]) -> dict[str, Cited]:
    """Return cited values, the derived ones computed by their formulas.

    Raises
    ------
    ModelError
        When formulas read each other's values in a circle, or what there is not.
    """
    known = {name: each.value for name, each in values.items() if each.formula is None}
    waiting = {name: each for name, each in values.items() if each.formula is not None}
    while waiting:
        ready = {}
        for name, each in waiting.items():
            try:
                ready[name] = each.computed(_Known(known, waiting))[0]
            except KeyError:  # one of them is still to be computed
                continue
        if not ready:
            raise ModelError(f"formulas of {', '.join(sorted(waiting))} wait for each other")
        known |= ready
        waiting = {name: each for name, each in waiting.items() if name not in ready}
    return {name: replace(each, value=known[name]) for name, each in values.items()}


class _Known(dict[str, Any]):
    """Values by name; one that is still to be computed is there, and cannot be read."""

    def __init__(self, known: Mapping[str, Any], waiting: Mapping[str, Any]) -> None:
        super().__init__({**dict.fromkeys(waiting), **known})
        self._waiting = waiting

    def __getitem__(self, name: str) -> Any:
        if name in self._waiting:
            raise KeyError(name)
        return super().__getitem__(name)


@dataclass(frozen=True)
class Outdated:
    """A derived value that no longer matches what it was derived from.

    Parameters
    ----------
    name, where
        Its name, and what it follows from.
    now, formula
        The value that it has, and what its formula gives [SI].
    changed
        Names of the changed parameters that the formula reads.
    """

    name: str
    where: str
    now: float
    formula: float
    changed: tuple[str, ...]


def outdated_values(
    cited: Mapping[str, Cited], par: ParameterSet, changed: Collection[str]
) -> list[Outdated]:
    """Return the derived values of a set that some changed parameters leave behind.

    Parameters
    ----------
    cited
        Values of the set that was changed.
    par
        All parameters, the changed ones among them.
    changed
        Names of what was changed; a derived value that is among them is meant as it is.
    """
    found: list[Outdated] = []
    values: dict[str, Any] = {}
    for name, each in cited.items():
        if each.formula is None or name in changed:
            continue
        values = values or par.flat()
        value, read = each.computed(values)
        moved = tuple(sorted(read.intersection(changed)))
        if moved and not math.isclose(value, values[name], rel_tol=_SAME):
            found.append(Outdated(name, each.where, values[name], value, moved))
    return found


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


@checked
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
