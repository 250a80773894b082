"""Stretches of a record that are judged by themselves: given in a file, or found in the demand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.core.callers import option
from bywire.core.errors import InputError, ParameterError
from bywire.core.quantities import Unit
from bywire.core.section import Hint, Section
from bywire.core.typing import Array
from bywire.data.toml_file import read_toml

_STEADY = 0.02  # of the demand's range: it holds while it moves less than this over a window
_WINDOW = 0.1  # s
_MOST = 60
_Limits = Annotated[Mapping[str, str], Field(default_factory=dict), Hint("write a text, '<= 5 %'")]
_Instant = Annotated[float, Unit("s"), Hint('write for instance start = "1 s", stop = "2 s"')]


class SegmentSection(Section):
    """A section ``[segments.NAME]``."""

    start: _Instant
    stop: _Instant
    tolerances: _Limits


class SegmentFile(Section):
    """A file of segments."""

    segments: Annotated[Mapping[str, SegmentSection], Field(default_factory=dict)]
    tolerances: _Limits


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
        raise error.reworded(f"{file}: {error}") from None


def _from(content: Mapping[str, Any], tolerances: Mapping[str, str]) -> list[Segment]:
    file = SegmentFile.read(content, "a file of segments")
    if not file.segments:
        raise ParameterError("no segment: write [segments.NAME] with start and stop")
    shared = {**tolerances, **file.tolerances}
    segments = []
    for name, section in file.segments.items():
        if not section.start < section.stop:
            raise ParameterError(f"[segments.{name}]: start must lie before stop")
        limits = {**shared, **section.tolerances}
        segments.append(Segment(name, section.start, section.stop, limits))
    return segments
