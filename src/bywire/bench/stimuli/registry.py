"""Find the stimuli by name and build them from texts with units."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any, get_origin

import numpy as np
from numpy.typing import NDArray

from bywire.core.callers import option
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.registry import Kind
from bywire.core.values import nodes, number

Value = str | float | Sequence[str | float]


@dataclass(frozen=True)
class StimulusKind:
    """A kind of stimulus.

    Parameters
    ----------
    name
        What bench files and the command line call it: the name of its module.
    summary
        One line for listings.
    parameter_class
        Class that validates the values.
    function
        ``function(t, par)``: its samples [level] at the times [s].
    """

    name: str
    summary: str
    parameter_class: type[ParameterSet]
    function: Callable[[NDArray[np.float64], Any], NDArray[np.float64]]


@dataclass(frozen=True)
class Stimulus:
    """A stimulus with its parameters.

    Parameters
    ----------
    kind
        Name of the stimulus.
    parameters
        Its validated parameters, SI inside.
    """

    kind: str
    parameters: ParameterSet

    def sample(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the samples at times [s], in the SI unit of the driven signal."""
        return STIMULI.find(self.kind).function(t, self.parameters)


def _declared(module: ModuleType) -> Iterator[StimulusKind]:
    """Yield the kind that a module is: every module that offers ``Parameters`` and ``sample``."""
    if hasattr(module, "sample") and hasattr(module, "Parameters"):
        summary = (module.__doc__ or "").strip().splitlines()[0]
        name = module.__name__.rpartition(".")[2]
        yield StimulusKind(name, summary, module.Parameters, module.sample)


STIMULI = Kind("stimulus", ("stimuli",), _declared, "bywire.bench.stimuli")
"""every kind of stimulus"""


def create(kind: str, values: Mapping[str, Value], level_unit: str) -> Stimulus:
    """Build a stimulus from numbers (SI) and texts with units.

    Parameters
    ----------
    kind
        Name of the stimulus, for instance ``"ramp"``.
    values
        Its parameters by name. A table's nodes are a sequence, or one text with commas, each
        node with its unit: ``"0 s, 0.2 s, 1 s"``.
    level_unit
        SI unit of the driven signal, for instance ``"A"`` or ``"Pa"``.

    Raises
    ------
    UnknownNameError
        When kind or a parameter's name is unknown.
    UnitError
        When a text is no quantity or its unit measures something else.
    ParameterError
        When a value is missing, out of range or contradicts another.

    Examples
    --------
    >>> step = create("step", {"start": "0 A", "end": "350 mA", "t_step": "0.1 s"}, "A")
    >>> step.sample(np.array([0.0, 0.1]))
    array([0.  , 0.35])
    """
    cls = STIMULI.find(kind).parameter_class
    leaves = leaf_fields(cls)
    numbers: dict[str, Any] = dict(values)
    for name in [name for name in values if name in leaves]:
        symbol = leaves[name].unit.symbol.replace("level", level_unit)
        is_table = get_origin(cls.model_fields[name].annotation) is tuple
        read = nodes if is_table else number
        numbers[name] = read(values[name], symbol, f"{kind}.{name}")
    try:
        return Stimulus(kind, cls.create(numbers))
    except UnknownNameError as error:
        raise UnknownNameError(f"stimulus {kind!r}: {error}") from None
    except ParameterError as error:
        raise ParameterError(_in_terms_of(str(error), kind, level_unit)) from None


def _in_terms_of(message: str, kind: str, level_unit: str) -> str:
    """Return the message with the driven signal's unit where the class says ``level``."""
    unit = "" if level_unit == "1" else f" {level_unit}"
    lines = message.replace(" level/s", f" {level_unit}/s").replace(" level", unit).splitlines()
    return "\n".join(f"stimulus {kind!r}: {line.removeprefix('Parameters: ')}" for line in lines)


def wanted(stimulus: Stimulus | None, experiment: str) -> Stimulus:
    """Return a stimulus that an experiment cannot do without.

    Raises
    ------
    ParameterError
        When the bench gives none.
    """
    if stimulus is None:
        raise ParameterError(
            f"{experiment} needs a [stimulus] section: kind = step, ramp, sine, chirp, multisine "
            "or table, with its parameters; without a file "
            f"{option('overrides', {'stimulus.kind': 'step'})} and so on"
        )
    return stimulus
