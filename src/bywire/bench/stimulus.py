"""Stimuli: their quantities, their kinds by name, and their sections in a bench.

A stimulus may drive a current, a voltage, a pressure or a force. Its levels therefore have the unit
``level``, which `create` replaces by the unit of the driven signal. Every file in ``stimuli/``
defines a kind by ``Parameters`` and a function ``sample(t, par)``. The function returns the driven
signal [level] at times [s] of any shape.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Annotated, Any, get_origin

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from bywire.core.callers import option
from bywire.core.errors import FileError, ParameterError, UnknownNameError, not_valid, quoted
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.quantities import Unit, display_unit
from bywire.core.registry import Kind
from bywire.core.values import nodes, number

Level = Annotated[float, Unit("level"), Field(allow_inf_nan=False)]
Amplitude = Annotated[float, Unit("level"), Field(ge=0, allow_inf_nan=False)]

TOLERANCE = 1e-9  # s: far above the rounding errors of ticks at k * T


def reached(t: NDArray[np.float64], instant: float) -> NDArray[np.bool_]:
    """Return whether each time has reached another time, within the rounding errors of a tick.

    ``t``: times [s], any shape; ``instant``: the time to reach [s].
    """
    return t >= instant - TOLERANCE


# --- Kinds of stimuli

Value = str | float | Sequence[str | float]


@dataclass(frozen=True)
class StimulusKind:
    """A kind of stimulus.

    Parameters
    ----------
    name
        Name in bench files and on the command line: the name of its module.
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
    """Yield the kind that a module with ``Parameters`` and ``sample`` declares."""
    if hasattr(module, "sample") and hasattr(module, "Parameters"):
        summary = (module.__doc__ or "").strip().splitlines()[0]
        name = module.__name__.rpartition(".")[2]
        yield StimulusKind(name, summary, module.Parameters, module.sample)


STIMULI = Kind("stimulus", ("stimuli",), _declared, "bywire.bench.stimuli")
"""every kind of stimulus"""


def create(kind: str, values: Mapping[str, Value], level_unit: str) -> Stimulus:
    """Build a stimulus from SI numbers and texts with units.

    Parameters
    ----------
    kind
        Name of the stimulus, for example ``"ramp"``.
    values
        Its parameters by name. The nodes of a table are a sequence, or one text with commas in
        which each node has its unit: ``"0 s, 0.2 s, 1 s"``.
    level_unit
        SI unit of the driven signal, for example ``"A"`` or ``"Pa"``.

    Raises
    ------
    UnknownNameError
        When the kind or a parameter is unknown.
    UnitError
        When a text is not a quantity, or has a unit of another dimension.
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
        raise error.reworded(f"stimulus {kind!r}: {error}") from None
    except ParameterError as error:
        raise error.reworded(_in_terms_of(str(error), kind, level_unit)) from None


def _in_terms_of(message: str, kind: str, level_unit: str) -> str:
    """Return the message with the unit of the driven signal in place of ``level``."""
    unit = "" if level_unit == "1" else f" {level_unit}"
    lines = message.replace(" level/s", f" {level_unit}/s").replace(" level", unit).splitlines()
    return "\n".join(f"stimulus {kind!r}: {line.removeprefix('Parameters: ')}" for line in lines)


def required_stimulus(stimulus: Stimulus | None, experiment: str) -> Stimulus:
    """Return the stimulus of a bench, which an experiment needs.

    Raises
    ------
    ParameterError
        When the bench has no stimulus.
    """
    if stimulus is None:
        raise ParameterError(
            f"{experiment} needs a [stimulus] section with a kind (step, ramp, sine, chirp, "
            "multisine or table) and its parameters. Without a bench file, use "
            f"{option('overrides', {'stimulus.kind': 'step'})} and likewise for its parameters",
            name="stimulus",
        )
    return stimulus


# --- Sections of a bench

_FILE = ("format", "rate", "start", "decimal", "skip_lines")
_CLOCK = {"time": "column", "time_unit": "unit"}  # flat, because a table is another stimulus
_SIGNAL = ("column", "unit", "scale", "sign", "offset", "delay")
_NAME = "stimulus"
_SHOWN = 12


def with_nodes(values: Mapping[str, Any], level_unit: str) -> dict[str, Any]:
    """Return the parameters of a table, with ``file`` replaced by its nodes.

    Parameters
    ----------
    values
        Parameters of the stimulus. ``file``: path of the file. ``column``: name of the column,
        required if there is more than one in addition to time. ``unit``, ``scale``, ``sign``,
        ``offset``, ``delay``, ``rate``, ``start``, ``format``, ``decimal`` and ``skip_lines`` are
        the same as in a mapping, as are ``time`` and ``time_unit`` for the time column.
        ``max_gap``: maximum gap that is interpolated. Time starts at the first row. Default of
        ``between``: ``"linear"``.
    level_unit
        SI unit of the driven signal.

    Raises
    ------
    InputError
        When the file cannot be used, or ``times`` or ``values`` are also present.
    """
    if "file" not in values:
        return dict(values)
    from bywire.data.mapping import mapping_from, signal_mapping  # most benches have no file
    from bywire.data.measurement import read_trace, trace_names

    keys = ("file", "max_gap", *_FILE, *_CLOCK, *_SIGNAL)
    rest = {key: value for key, value in values.items() if key not in keys}
    if "times" in rest or "values" in rest:
        raise ParameterError(
            "stimulus 'table' has both a file and times or values. Specify either file, or times "
            "and values",
            name="stimulus.file",
        )
    path = values["file"]
    if not isinstance(path, str):
        raise not_valid("stimulus.file", quoted(path), "a string")
    whole = {key: values[key] for key in _FILE if key in values}
    clock = {inner: values[key] for key, inner in _CLOCK.items() if key in values}
    whole |= {"time": clock} if clock else {}
    signal = {key: values[key] for key in _SIGNAL if key in values}
    if "column" not in signal:
        names = trace_names(path, whole)
        if len(names) != 1:
            more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
            raise FileError(
                f"{path} has several columns in addition to time. Choose one with the key column "
                f"({', '.join(names[:_SHOWN])}{more})",
                name="stimulus.column",
                valid=", ".join(names),
            )
        signal["column"] = names[0]
    mapped = signal_mapping(_NAME, signal, "[stimulus]")
    trace = read_trace(
        path,
        {_NAME: level_unit},
        max_gap=values.get("max_gap", 0.1),
        mapping=replace(mapping_from(whole), signals={_NAME: mapped}),
    )
    time = trace["time"].values
    nodes = {"times": (time - time[0]).tolist(), "values": trace[_NAME].values.tolist()}
    return {"between": "linear", **rest, **nodes}


# --- Sections


def stimulus_sections(stimulus: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return the sections of a stimulus by signal; plain keys are the section ""."""
    plain = {key: value for key, value in stimulus.items() if not isinstance(value, Mapping)}
    further = {key: value for key, value in stimulus.items() if isinstance(value, Mapping)}
    return ({"": plain} if plain else {}) | further


def stimulus_of(section: Mapping[str, Any], unit: str, name: str) -> Stimulus:
    """Return the validated stimulus of a section.

    Parameters
    ----------
    section
        ``{"kind": ..., **parameters}``.
    unit
        SI unit of the driven signal.
    name
        Name of the signal; empty for a plain section.

    Raises
    ------
    InputError
        When the kind is unknown, or its parameters or its file are not valid.
    """
    values = dict(section)
    kind = values.pop("kind", None)
    title = f"stimulus.{name}" if name else "stimulus"
    if not isinstance(kind, str):
        kinds = ", ".join(sorted(STIMULI.all()))
        raise ParameterError(f"[{title}] needs a kind: {kinds}", name=f"{title}.kind", valid=kinds)
    values = with_nodes(values, unit) if kind == "table" else values
    _require_values(title, kind, values, unit)
    return create(kind, values, unit)


def _require_values(title: str, kind: str, values: Mapping[str, Any], level: str) -> None:
    """Reject a section with missing values, and list them as options of the command."""
    cls = STIMULI.find(kind).parameter_class
    fields = cls.model_fields
    lacking = [name for name in fields if fields[name].is_required() and name not in values]
    if lacking and values.keys() <= fields.keys():  # otherwise, a name may be misspelled
        leaves = leaf_fields(cls)
        typed = {}
        for name in lacking:
            symbol = leaves[name].unit.symbol.replace("level", level) if name in leaves else "1"
            unit = display_unit(symbol)
            typed[f"{title}.{name}"] = "VALUE" if unit == "1" else f"VALUE {unit}"
        verb = "is" if len(lacking) == 1 else "are"
        raise ParameterError(
            f"stimulus {kind!r}: {', '.join(lacking)} {verb} missing. Add "
            f"{'it' if len(lacking) == 1 else 'them'} to [{title}], or type "
            f"{option('overrides', typed)}",
            name=", ".join(typed),
        )
