"""Relations that are linear in parameters that drift, such as friction or clearance."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import xarray as xr

from bywire.core.errors import ParameterError, nearest_first, unknown_name
from bywire.core.registry import Kind, instances
from bywire.core.typing import Array


@dataclass(frozen=True)
class Rows:
    r"""Samples of a relation :math:`y = \varphi^T \theta`.

    Parameters
    ----------
    regressors, targets
        Shapes (n, p) and (n,); NaN where the relation does not hold.
    """

    regressors: Array
    targets: Array


@dataclass(frozen=True)
class Relation:
    """A relation that tells parameters.

    Parameters
    ----------
    name
        What it is called.
    assembly
        Whose parameters it tells.
    names, units
        All parameters of the relation, the tracked one first, and their SI units.
    signals
        What must be measured: name -> SI unit.
    rows
        ``rows(data, par) -> Rows``.
    start
        ``start(par) -> values``, shape (p,).
    assumption
        When it holds, one sentence.
    """

    name: str
    assembly: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    signals: Mapping[str, str]
    rows: Callable[[xr.Dataset, Any], Rows]
    start: Callable[[Any], Array]
    assumption: str

    @property
    def parameter(self) -> str:
        """Dotted name of the parameter that it tracks."""
        return self.names[0]


RELATIONS = Kind("relation", ("tracked",), instances(Relation))
"""by preference: the first of a parameter whose signals are measured is taken"""


def find_relation(name: str, data: xr.Dataset, par: Any) -> Relation:
    """Return the relation that tells a parameter from what is measured.

    Parameters
    ----------
    name
        Dotted name, or its last part.
    data
        Measured signals.
    par
        Parameters of the brake.

    Raises
    ------
    UnknownNameError
        When nothing tells such a parameter.
    ParameterError
        When what it needs is not measured, or the brake is another one.
    """
    known = {relation.parameter for relation in RELATIONS.all().values()}
    relations = [
        r for r in RELATIONS.all().values() if name in (r.parameter, r.parameter.rpartition(".")[2])
    ]
    if not relations:
        raise unknown_name("parameter to track", name, known)
    relations = [r for r in relations if r.parameter in par.flat()]
    if not relations:
        raise ParameterError(f"{name} is tracked on brakes that have it; the parameters lack it")
    for relation in relations:
        if all(signal in data for signal in relation.signals):
            return relation
    wanted = " or ".join(", ".join(r.signals) for r in relations)
    raise ParameterError(
        f"tracking {relations[0].parameter} needs the measured signals {wanted}; measured are "
        f"{nearest_first(map(str, data.data_vars), relations[0].signals)}"
    )
