"""Elements' warnings about a recording, evaluated in each row.

An element's inputs depend on only a few states. The assembly's equations are traced once per
structure. Only those equations that lead to elements with a ``watch`` function are evaluated on a
recording.
"""

from __future__ import annotations

import operator
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from bywire.core.model import Model
from bywire.core.parameters import leaf_table
from bywire.core.traced import Traced, computed, names_in
from bywire.core.wires import Instant, Wired

_NAN = float("nan")
_PARAMETER = "."  # prefix of a parameter's name among signal names


class Watching(Model):
    """An assembly's warnings about recordings, from its elements and subassemblies."""

    parts: ClassVar[dict[str, Any]]
    subs: ClassVar[dict[str, Any]]

    def watch(self, recording: Any, par: Any) -> list[str]:
        """Return the elements' warnings about a recording, evaluated in each row.

        Signals that were not recorded do not cause warnings.
        """
        within = (
            f"{sub.label}: {text}"
            for sub in self.subs.values()
            for text in sub.assembly.watch(sub.seen(recording), sub.parameters(par))
        )
        return [*_warnings_of(self, recording, par), *within]

    def watched(self, par: Any) -> tuple[str, ...] | None:
        """Return the signals that ``watch`` reads, or None if a subclass overrides ``watch``."""
        if type(self).watch is not Watching.watch:
            return None
        names = [*watched_by_elements(self, par)]
        for sub in self.subs.values():
            inner = sub.assembly.watched(sub.parameters(par))
            if inner is None:
                return None
            names += map(sub.named, inner)
        return tuple(names)

    def silent(self, rows: Any, pars: Sequence[Any]) -> frozenset[str]:
        """Return the names of the parts that have no warnings in any of several cases.

        ``rows``: signals of shape (cases, rows); ``pars``: parameters of each case.
        """
        within = (
            f"{name}.{part}"
            for name, sub in self.subs.items()
            for part in sub.assembly.silent(sub.seen(rows), [sub.parameters(p) for p in pars])
        )
        return silent_parts(self, rows, pars) | frozenset(within)

    def may_warn(self, rows: Any, pars: Sequence[Any]) -> Sequence[int]:
        """Return the cases for which ``watch`` may warn; no case if all parts are silent.

        If a subclass overrides ``watch`` but not this method, the method returns all cases.
        """
        if type(self).watch is not Watching.watch or not self.are_silent(rows):
            return range(len(pars))
        within = [
            sub.assembly.may_warn(sub.seen(rows), [sub.parameters(p) for p in pars])
            for sub in self.subs.values()
        ]
        return tuple(sorted({case for cases in within for case in cases}))

    def are_silent(self, rows: Any) -> bool:
        """Return whether ``rows.silent`` contains every part that watches."""
        watching = (part.name for part in self.parts.values() if part.has("watch"))
        return all(name in rows.silent for name in watching)


_Felt = tuple[tuple[Any, dict[str, Any]], ...]
_MONOTONIC = (operator.add, operator.sub, operator.mul, operator.neg, operator.pos)
_KNOWN: dict[Any, _Felt] = {}


def _warnings_of(model: Any, recording: Any, par: Any) -> list[str]:
    """Return the elements' warnings; see `Assembly.watch`."""
    silent = getattr(recording, "silent", ())
    felt = tuple(each for each in _watching_parts(model, par) if each[0].name not in silent)
    if not felt:
        return []
    return [text for _, texts in _warnings_by_part(model, felt, recording, par) for text in texts]


def silent_parts(model: Any, rows: Any, pars: Sequence[Any]) -> frozenset[str]:
    """Return an assembly's parts that have no warnings in any of several cases.

    ``rows``: signals of shape (cases, rows). Only elements that judge each row separately can be
    evaluated. Parameters that differ between the cases become arrays of shape (cases, 1).
    """
    felt = tuple(
        (part, each)
        for part, each in _watching_parts(model, pars[0])
        if hasattr(part.element.watch, "row_by_row")
    )
    joined = _joined(pars)
    outlined = rows.outlined() if hasattr(type(rows), "outlined") else None
    return frozenset(
        each[0].name
        for each in felt
        if (_is_outlined(each, outlined) and _is_silent(model, each, outlined, joined, pars))
        or _is_silent(model, each, rows, joined, pars)
    )


def _is_silent(
    model: Any, each: tuple[Any, dict[str, Any]], rows: Any, joined: Any, pars: Sequence[Any]
) -> bool:
    """Return whether a part has no warnings in any of several cases."""
    try:
        ((_, texts),) = _warnings_by_part(model, (each,), rows, joined, len(pars) > 1)
    except (TypeError, ValueError):  # the function needs or returns more than a single number
        return False
    return not texts


def _is_outlined(each: tuple[Any, dict[str, Any]], outlined: Any) -> bool:
    """Return whether the lowest and highest values of signals determine a part's warnings.

    This requires inputs that follow from one signal each, by operations that rise or fall with it.
    """
    part, inputs = each
    if outlined is None or not hasattr(part.element.watch, "within_limits"):
        return False
    values = [one for value in inputs.values() for one in (value if _is_tuple(value) else (value,))]
    signals = {name for value in values for name in names_in(value) if _PARAMETER not in name[:1]}
    return all(map(_rises_or_falls, values)) and all(
        name not in outlined or np.isfinite(outlined[name].values).all() for name in signals
    )


def _is_tuple(value: Any) -> bool:
    return isinstance(value, tuple)


def _rises_or_falls(value: Any) -> bool:
    """Return whether a number is a monotonic function of at most one signal, also when rounded."""
    if not isinstance(value, Traced) or value.operation is None:
        return not _is_tuple(value)
    if value.operation not in _MONOTONIC:
        return _signals_in(value) == 0
    several = sum(_signals_in(each) > 0 for each in value.inputs) > 1
    return not several and all(map(_rises_or_falls, value.inputs))


def _signals_in(value: Any) -> int:
    return sum(not name.startswith(_PARAMETER) for name in names_in(value))


def _joined(pars: Sequence[Any]) -> Any:
    """Join sets with the same structure; values that differ become arrays over the sets."""
    if len(pars) == 1:
        return pars[0]
    names, table = tuple(pars[0].leaves()), leaf_table(pars)
    differs = np.flatnonzero((table != table[0]).any(axis=0)).tolist()
    return pars[0].with_leaves({names[k]: table[:, k : k + 1] for k in differs})


def _warnings_by_part(
    model: Any, felt: _Felt, rows: Any, par: Any, is_joined: bool = False
) -> Iterator[tuple[Any, list[str]]]:
    """Yield each part that watches, with its warnings about rows.

    ``is_joined``: whether ``par`` joins the sets of several runs.
    """
    with np.errstate(all="ignore"):
        operands = _Operands(rows, par, is_joined)
        values = computed(tuple(tuple(each.values()) for _, each in felt), operands)
        for (part, names), each in zip(felt, values, strict=True):
            wired: Any = Wired(part, Instant(None, None, None, par, model.shared), type(model))
            more = dict(zip(names, each, strict=True))
            yield part, wired.call(part.element.watch, t=rows["time"].values, **more)


def watched_by_elements(model: Any, par: Any) -> tuple[str, ...]:
    """Return the signals that determine the inputs of the elements' ``watch`` functions."""
    felt = tuple(value for _, each in _watching_parts(model, par) for value in each.values())
    return tuple(name for name in names_in(felt) if not name.startswith(_PARAMETER))


def _watching_parts(model: Any, par: Any) -> _Felt:
    """Return the parts that watch, with their inputs as traced functions of signals."""
    # An instance with attributes is not cached, because its equations may use the attributes.
    key = None if vars(model) else (type(model), tuple(par.choices().items()))
    if key in _KNOWN:
        return _KNOWN[key]
    parts = [part for part in model.parts.values() if part.has("watch")]
    if not parts:
        return ()
    leaves = {name: Traced(None, _PARAMETER + name) for name in par.leaves()}
    state, memory = (
        kind._make(Traced(None, name) for name in kind._fields)
        for kind in (model.State, model.Memory)
    )
    ports = {port.name: Traced(None, port.name) for port in model.ports}
    w = model.at(state, memory, par.with_leaves(leaves), ports=ports)
    felt = tuple((part, getattr(w, part.name).felt(part.element.watch)) for part in parts)
    if key is not None:
        _KNOWN[key] = felt
    return felt


class _Operands(dict[str, Any]):
    """Signals' rows and parameters' values by name; NaN for signals that were not recorded."""

    def __init__(self, recording: Any, par: Any, is_joined: bool) -> None:
        self._recording, self._par, self._is_joined = recording, par, is_joined

    def __missing__(self, name: str) -> Any:
        if not name.startswith(_PARAMETER):
            return self._recording[name].values if name in self._recording else _NAN
        value = self._par.value(name[len(_PARAMETER) :])
        return (
            np.asarray(value) if self._is_joined else value
        )  # an array, so that 1 / 0 is infinite
