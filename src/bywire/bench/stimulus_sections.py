"""Sections of a bench that say what drives its signals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.bench.stimuli.registry import STIMULI, Stimulus, create
from bywire.bench.stimulus_file import with_nodes
from bywire.core.errors import ParameterError


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
