"""What the elements of an assembly say of a recording, each of what it felt in every row.

What an element feels follows from few states: the assembly's equations are traced once a
structure, and on a recording only what leads to those elements is computed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bywire.core.traced import Traced, computed, names_in
from bywire.core.wired import Instant, Wired

_NAN = float("nan")
_PARAMETER = "."  # before the name of one, among names of signals

Felt = tuple[tuple[Any, dict[str, Any]], ...]
_KNOWN: dict[Any, Felt] = {}


def warnings_of(model: Any, recording: Any, par: Any) -> list[str]:
    """Return the warnings of an assembly's elements; see `Assembly.watch`."""
    felt = _felt(model, par)
    warnings: list[str] = []
    with np.errstate(all="ignore"):
        traced = tuple(tuple(each.values()) for _, each in felt)
        values = computed(traced, _Given(recording, par))
        for (part, names), each in zip(felt, values, strict=True):
            wired: Any = Wired(part, Instant(None, None, None, par, model.shared))
            more = dict(zip(names, each, strict=True))
            warnings += wired.call(part.element.watch, t=recording["time"].values, **more)
    return warnings


def watched_by_elements(model: Any, par: Any) -> tuple[str, ...]:
    """Return the signals from which follows what the elements of an assembly watch."""
    felt = tuple(value for _, each in _felt(model, par) for value in each.values())
    return tuple(name for name in names_in(felt) if not name.startswith(_PARAMETER))


def _felt(model: Any, par: Any) -> Felt:
    """Return the parts that watch, and how what each looks at follows from signals."""
    parts = [part for part in model.parts.values() if part.has("watch")]
    if not parts:
        return ()
    # What an instance holds of its own may stand in the equations.
    key = None if vars(model) else (type(model), tuple(par.numbers_and_choices[1].items()))
    if key in _KNOWN:
        return _KNOWN[key]
    leaves = {name: Traced(None, _PARAMETER + name) for name in par.leaves()}
    state, memory = (
        kind._make(Traced(None, name) for name in kind._fields)
        for kind in (model.State, model.Memory)
    )
    w = model.at(state, memory, par.with_leaves(leaves))
    felt = tuple((part, getattr(w, part.name).felt(part.element.watch)) for part in parts)
    if key is not None:
        _KNOWN[key] = felt
    return felt


class _Given(dict[str, Any]):
    """Rows of signals and values of parameters by name; of what is not recorded NaN."""

    def __init__(self, recording: Any, par: Any) -> None:
        self._recording, self._par = recording, par

    def __missing__(self, name: str) -> Any:
        if not name.startswith(_PARAMETER):
            return self._recording[name].values if name in self._recording else _NAN
        value = self._par
        for step in name[1:].split("."):
            value = value[int(step)] if isinstance(value, tuple) else getattr(value, step)
        return value
