"""Parameter values of the cases of an ensemble, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bywire.core.errors import ParameterError, unknown_name
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array
from bywire.simulation.changes import require_unchanged
from bywire.simulation.run import Run

Variations = Mapping[str, Array | Sequence[float]]


def case_matrix(run: Run, variations: Variations) -> Array:
    """Return the parameter vectors of all cases, shape (parameters, cases).

    Ranges are checked for every value, rules within a group of parameters for every case, rules
    across groups at the extremes of each parameter.

    Raises
    ------
    UnknownNameError
        When a parameter is unknown.
    ParameterError
        When a value is out of range, lengths differ, or a sample time varies.
    """
    require_unchanged(run.changes, "variations")
    names = list(run.par.leaves())
    arrays = {name: np.atleast_1d(np.asarray(v, dtype=float)) for name, v in variations.items()}
    for name in arrays:
        if name not in names:
            raise unknown_name("parameter", name, names)
    lengths = {name: array.size for name, array in arrays.items()}
    if not arrays or len(set(lengths.values())) != 1 or 0 in lengths.values():
        raise ParameterError(f"variations must have one length >= 1 each, got {lengths}")
    count = next(iter(lengths.values()))
    matrix = np.repeat(np.array(list(run.par.leaves().values()))[:, None], count, axis=1)
    for name, array in arrays.items():
        _check_extremes(run, name, array)
        matrix[names.index(name)] = array
    for group in {name.partition(".")[0] for name in arrays}:
        _check_group(run.par, group, arrays, count)
    return matrix


def _check_extremes(run: Run, name: str, array: Array) -> None:
    values = [float(array.min()), float(array.max())]
    if not math.isfinite(float(array.sum())):
        values = [float(v) for v in array if not math.isfinite(v)][:1] or values
    periods = [task.period for task in run.model.tasks(run.par)]
    for value in values:
        changed = run.par.replace({name: value})
        if [task.period for task in run.model.tasks(changed)] != periods:
            raise ParameterError(f"{name} is a sample time and cannot vary within an ensemble")


def _check_group(par: ParameterSet, group: str, arrays: Mapping[str, Array], count: int) -> None:
    """Check the rules between the parameters of a group for every case, where it has rules."""
    node: Any = getattr(par, group)
    varied = {
        name.partition(".")[2]: v for name, v in arrays.items() if name.startswith(f"{group}.")
    }
    if len(varied) < 2 or not isinstance(node, ParameterSet) or not _has_rules(type(node)):
        return
    for k in range(count):
        try:
            node.replace({name: float(values[k]) for name, values in varied.items()})
        except ParameterError as error:
            raise ParameterError(f"case {k}: {error}") from None


def _has_rules(cls: type[ParameterSet]) -> bool:
    inner = (info.annotation for info in cls.model_fields.values())
    return bool(cls.__pydantic_decorators__.model_validators) or any(
        isinstance(kind, type) and issubclass(kind, ParameterSet) and _has_rules(kind)
        for kind in inner
    )
