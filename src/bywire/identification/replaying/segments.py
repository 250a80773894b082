"""Stretches of a record that are judged by themselves: given in a file, or found in the demand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from bywire.core.callers import option
from bywire.core.errors import InputError, ParameterError, quoted, unknown_name
from bywire.core.typing import Array
from bywire.core.units import parse
from bywire.data.toml_file import read_toml

_STEADY = 0.02  # of the demand's range: it holds while it moves less than this over a window
_WINDOW = 0.1  # s
_MOST = 60
_KEYS = ("start", "stop", "tolerances")


@dataclass(frozen=True)
class Segment:
    """A stretch of a record.

    Parameters
    ----------
    name
        What reports call it.
    start, stop
        On the measurement's clock [s].
    tolerances
        Figure, or ``SIGNAL.FIGURE`` -> limits, such as ``{"nrmse": "<= 5 %"}`` or
        ``{"lag": ">= -1 ms and <= 5 ms"}``.
    """

    name: str
    start: float
    stop: float
    tolerances: Mapping[str, str] = field(default_factory=dict)


def whole_record(time: Array, tolerances: Mapping[str, str]) -> list[Segment]:
    """Return the record as one stretch."""
    return [Segment("whole", float(time[0]), float(time[-1]), dict(tolerances))]


def found_in(demand: xr.DataArray, tolerances: Mapping[str, str]) -> list[Segment]:
    """Return the stretches in which a demand holds, and those in which it moves.

    It holds while it has changed by less than 2 % of its range within the last 0.1 s, so that
    what follows a step within that time belongs to the step. Shorter stretches join the one
    before.

    Raises
    ------
    ParameterError
        When there are more than can be judged by eye.
    """
    time, values = demand["time"].values, demand.values
    interval = float(np.median(np.diff(time)))
    width = max(round(_WINDOW / interval), 1)
    change = np.abs(values - np.pad(values, (width, 0), mode="edge")[: values.size])
    moving = change > _STEADY * max(float(np.ptp(values)), 1e-300)
    edges = np.flatnonzero(np.diff(moving.astype(int))) + 1
    ends = [0, *edges.tolist(), values.size - 1]
    merged = [ends[0]]
    for end in ends[1:-1]:
        if (end - merged[-1]) * interval >= _WINDOW:
            merged.append(end)
    if len(merged) > 1 and (ends[-1] - merged[-1]) * interval < _WINDOW:
        merged.pop()
    merged.append(ends[-1])
    if len(merged) - 1 > _MOST:
        raise ParameterError(
            f"the demand {demand.name} holds and moves {len(merged) - 1} times: name the "
            f"stretches that matter in a file, {option('segments')} FILE"
        )
    counts = {"hold": 0, "move": 0}
    segments = []
    for a, b in pairwise(merged):
        kind = "move" if moving[a:b].mean() > 0.5 else "hold"
        counts[kind] += 1
        segments.append(
            Segment(f"{kind}-{counts[kind]}", float(time[a]), float(time[b]), dict(tolerances))
        )
    return segments


def read_segments(path: str | Path, tolerances: Mapping[str, str]) -> list[Segment]:
    """Read a file of segments.

    Parameters
    ----------
    path
        TOML file with a section ``[segments.NAME]`` for each, with ``start``, ``stop`` and
        ``tolerances``; a section ``[tolerances]`` holds for all.
    tolerances
        For all as well; those in the file go first.

    Raises
    ------
    FileError
        When the file cannot be read or is no TOML.
    InputError
        For anything in it that does not fit.
    """
    file = Path(path)
    content = read_toml(file, "file of segments")
    try:
        return _from(content, tolerances)
    except InputError as error:
        raise type(error)(f"{file}: {error}") from None


def _from(content: Mapping[str, Any], tolerances: Mapping[str, str]) -> list[Segment]:
    for key in content:
        if key not in ("segments", "tolerances"):
            raise unknown_name("key", key, ("segments", "tolerances"))
    shared = {**tolerances, **_texts(content.get("tolerances", {}), "tolerances")}
    sections = _table(content.get("segments", {}), "segments")
    if not sections:
        raise ParameterError("no segment: write [segments.NAME] with start and stop")
    segments = []
    for name, section in sections.items():
        entry = _table(section, f"segments.{name}")
        for key in entry:
            if key not in _KEYS:
                raise unknown_name(f"key in [segments.{name}]", key, _KEYS)
        ends = []
        for key in ("start", "stop"):
            if key not in entry:
                raise ParameterError(f'segments.{name}.{key} is missing: write {key} = "1 s"')
            ends.append(parse(entry[key], "s", f"segments.{name}.{key}"))
        if not ends[0] < ends[1]:
            raise ParameterError(f"segments.{name}: start must lie before stop")
        limits = _texts(entry.get("tolerances", {}), f"segments.{name}.tolerances")
        segments.append(Segment(name, ends[0], ends[1], {**shared, **limits}))
    return segments


def _table(value: Any, name: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ParameterError(f"{name} = {quoted(value)}: it must be a table of key = value")
    return value


def _texts(value: Any, name: str) -> dict[str, str]:
    table = _table(value, name)
    for key, text in table.items():
        if not isinstance(text, str):
            raise ParameterError(f"{name}.{key} = {quoted(text)}: write for instance '<= 5 %'")
    return dict(table)
