"""Parameters that the user requested for a use case's brake."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.bench.changes import settled
from bywire.core.catalog import PARAMETER_SETS, CitedSet, main_set
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.values import parsed


def set_for(subject: str, assemblies: tuple[str, ...], name: str) -> CitedSet:
    """Return a parameter set of a brake.

    Parameters
    ----------
    subject, assemblies, name
        See `parameters_for`.

    Raises
    ------
    InputError
        If the name is unknown, or the parameter set is for another brake.
    """
    cited = PARAMETER_SETS.find(name or main_set(assemblies[0]))
    if cited.assembly not in assemblies:
        raise ParameterError(
            f"{subject} needs parameters of a {' or '.join(assemblies)}, but parameter set "
            f"{cited.name!r} belongs to a {cited.assembly}. Choose another parameter set",
            name="parameters",
            value=cited.name,
            valid=" or ".join(assemblies),
        )
    return cited


def parameters_for(
    subject: str, assemblies: tuple[str, ...], name: str, changes: Mapping[str, Any]
) -> tuple[str, ParameterSet]:
    """Return name and values of a parameter set, with changes.

    Parameters
    ----------
    subject
        Subject of the use case, for example ``"loop 'moment'"``.
    assemblies
        Brakes to which the subject belongs, the first one by default.
    name
        Parameter set. If empty, the first brake's main set.
    changes
        Parameters by dotted name or pattern, with units or relative to their values (see
        `settled`).

    Raises
    ------
    InputError
        If a name is unknown, a value is out of range, or the parameter set is for another brake.
    """
    cited = set_for(subject, assemblies, name)
    base = cited.parameters()
    return cited.name, base.replace(parsed(type(base), settled(base, changes), "parameter"))
