"""Stimuli from measured files: the nodes of a table out of a CSV or TSV file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.core.errors import FileError, ParameterError, quoted
from bywire.data.trace import read_trace

_KEYS = ("file", "column", "max_gap")


def with_nodes(values: Mapping[str, Any], level_unit: str) -> dict[str, Any]:
    """Return a table's parameters with ``file`` replaced by the nodes that it holds.

    Parameters
    ----------
    values
        Parameters of the stimulus. ``file``: path of the file; ``column``: name of the column,
        needed where there are several besides time; ``max_gap``: longest pause that is bridged.
        Time starts at the first row; ``between`` is ``"linear"`` unless given.
    level_unit
        SI unit of the driven signal.

    Raises
    ------
    FileError
        When the file cannot be used.
    ParameterError
        When ``times`` or ``values`` are given beside a file.
    """
    rest = {key: value for key, value in values.items() if key not in _KEYS}
    if "file" not in values:
        return dict(values)
    if "times" in rest or "values" in rest:
        raise ParameterError("stimulus 'table': give either file, or times and values")
    for key in ("file", "column"):
        if not isinstance(values.get(key, ""), str):
            raise ParameterError(f"stimulus.{key}: it must be a text, got {quoted(values[key])}")
    path, column = values["file"], values.get("column")
    wanted = None if column is None else {column: level_unit}
    trace = read_trace(path, wanted, max_gap=values.get("max_gap", 0.1))
    names = [str(name) for name in trace.data_vars]
    if len(names) != 1:
        raise FileError(
            f"{path} has several columns besides time: name one of them with column "
            f"({', '.join(names)})"
        )
    signal = trace[names[0]]
    if signal.attrs["units"] != level_unit:
        raise FileError(
            f"{path}: column {names[0]!r} is in {signal.attrs['units']}, but the stimulus drives "
            f"{level_unit}"
        )
    time = trace["time"].values
    nodes = {"times": (time - time[0]).tolist(), "values": signal.values.tolist()}
    return {"between": "linear", **rest, **nodes}
