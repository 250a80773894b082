"""Sections of a bench that say what drives its signals, also from measured files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from bywire.bench.stimuli.registry import STIMULI, Stimulus, create
from bywire.core.errors import FileError, ParameterError, quoted

_FILE = ("format", "rate", "start", "decimal", "skip_lines")
_CLOCK = {"time": "column", "time_unit": "unit"}  # a table of a stimulus would be another one
_SIGNAL = ("column", "unit", "scale", "sign", "offset", "delay")
_NAME = "stimulus"
_SHOWN = 12


def with_nodes(values: Mapping[str, Any], level_unit: str) -> dict[str, Any]:
    """Return a table's parameters with ``file`` replaced by the nodes that it holds.

    Parameters
    ----------
    values
        Parameters of the stimulus. ``file``: path of the file; ``column``: name of the column,
        needed where there are several besides time; ``unit``, ``scale``, ``sign``, ``offset``,
        ``delay``, ``rate``, ``start``, ``format``, ``decimal`` and ``skip_lines`` as in a mapping,
        and ``time`` and ``time_unit`` for the column of the instants, where the file does not say
        them; ``max_gap``: longest pause that is bridged. Time starts at the first instant;
        ``between`` is ``"linear"`` unless given.
    level_unit
        SI unit of the driven signal.

    Raises
    ------
    InputError
        When the file cannot be used, or ``times`` or ``values`` are given beside it.
    """
    if "file" not in values:
        return dict(values)
    from bywire.data.mapping import mapping_from, signal_mapping  # most benches have no file
    from bywire.data.measurement import read_trace, trace_names

    keys = ("file", "max_gap", *_FILE, *_CLOCK, *_SIGNAL)
    rest = {key: value for key, value in values.items() if key not in keys}
    if "times" in rest or "values" in rest:
        raise ParameterError("stimulus 'table': give either file, or times and values")
    path = values["file"]
    if not isinstance(path, str):
        raise ParameterError(f"stimulus.file: it must be a text, got {quoted(path)}")
    whole = {key: values[key] for key in _FILE if key in values}
    clock = {inner: values[key] for key, inner in _CLOCK.items() if key in values}
    whole |= {"time": clock} if clock else {}
    signal = {key: values[key] for key in _SIGNAL if key in values}
    if "column" not in signal:
        names = trace_names(path, whole)
        if len(names) != 1:
            more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
            raise FileError(
                f"{path} has several columns besides time: name one of them with column "
                f"({', '.join(names[:_SHOWN])}{more})"
            )
        signal["column"] = names[0]
    meant = signal_mapping(_NAME, signal, "[stimulus]")
    trace = read_trace(
        path,
        {_NAME: level_unit},
        max_gap=values.get("max_gap", 0.1),
        mapping=replace(mapping_from(whole), signals={_NAME: meant}),
    )
    time = trace["time"].values
    nodes = {"times": (time - time[0]).tolist(), "values": trace[_NAME].values.tolist()}
    return {"between": "linear", **rest, **nodes}


# --- Sections


def stimulus_sections(stimulus: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return the sections of a stimulus by signal: what is no section itself under ""."""
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
        Of the signal; empty for a plain section.

    Raises
    ------
    InputError
        When there is no such kind, or its parameters or its file do not fit.
    """
    values = dict(section)
    kind = values.pop("kind", None)
    if not isinstance(kind, str):
        title = f"stimulus.{name}" if name else "stimulus"
        raise ParameterError(f"[{title}] needs a kind: {', '.join(sorted(STIMULI.all()))}")
    return create(kind, with_nodes(values, unit) if kind == "table" else values, unit)
