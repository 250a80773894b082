"""Parameters without effect: those that a structural choice switches off."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.bench.experiment import Case, FaultyCase
from bywire.core.errors import BywireError, ParameterError
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet, choice_fields, choices_of, leaf_fields
from bywire.core.traced import Traced
from bywire.core.units import shown
from bywire.simulation.engine import structure_of

_TIMES = 101  # number of times at which stimuli are compared
_KNOWN: dict[tuple[object, ...], frozenset[str] | None] = {}


@dataclass(frozen=True)
class Switch:
    """A choice that switches a parameter off.

    Parameters
    ----------
    name, value
        The choice and its value.
    others
        Values with which the parameter would have an effect.
    """

    name: str
    value: Any
    others: tuple[Any, ...]

    @property
    def hint(self) -> str:
        """Advice on how to switch the parameter on."""
        return f"set {self.name} = {' or '.join(map(repr, self.others))}"


def switches_of(name: str, cases: Sequence[Case]) -> list[Switch]:
    """Return the choices that switch a parameter off in all runs of an experiment.

    The equations decide: whether those of any run read the parameter, and whether they would with
    another value of a choice in the parameter's group or in a group above it. If the equations
    cannot be traced, the list is empty.

    Parameters
    ----------
    name
        Name of a number or table among the parameters.
    cases
        Runs of the experiment.
    """
    pairs = [(case.model, par) for case in cases for par in _parameters(case)]
    if not pairs or any(_is_read(name, model, par) for model, par in pairs):
        return []
    switches = []
    model, par = pairs[0]
    groups = name.split(".")[:-1]
    above = {".".join((*groups[:k], "")) for k in range(1, len(groups) + 1)}
    for choice in choice_fields(type(par)):
        if choice[: choice.rfind(".") + 1] not in above:
            continue
        value = par.value(choice)
        others = [other for other in choices_of(type(par), choice) if other != value]
        read = tuple(each for each in others if _is_read_with(name, model, par, choice, each))
        if read:
            switches.append(Switch(choice, value, read))
    return switches


def refuse_without_effect(
    name: str, value: Any, switches: Sequence[Switch], par: ParameterSet
) -> None:
    """Raise ParameterError for a parameter that choices switch off, if any do."""
    if not switches:
        return
    leaf = leaf_fields(type(par)).get(name)
    text = shown(value, leaf.unit.symbol) if leaf and isinstance(value, float) else repr(value)
    off = " and ".join(f"{each.name} = {each.value!r}" for each in switches)
    on = ", or ".join(each.hint for each in switches)
    raise ParameterError(
        f"{name} = {text} would have no effect because {off}: {on} too, or leave {name} out",
        name=name,
        value=text,
    )


def are_alike(cases: Sequence[Case], others: Sequence[Case]) -> bool:
    """Return whether runs have the same start, stimuli and times."""
    return len(cases) == len(others) and all(map(_is_alike, cases, others))


def _is_alike(case: Case, other: Case) -> bool:
    plans = [(c.duration, c.settle, c.keep, c.record) for c in (case, other)]
    if plans[0] != plans[1] or type(case.model) is not type(other.model):
        return False
    begun, also_begun = (np.array([*c.state, *c.memory], dtype=float) for c in (case, other))
    times = np.linspace(-case.settle, case.duration, _TIMES)
    driven, also = case.stimulus(times), other.stimulus(times)
    return (
        np.array_equal(begun, also_begun, equal_nan=True)
        and driven.keys() == also.keys()
        and all(np.array_equal(driven[n], also[n], equal_nan=True) for n in driven)
    )


def _parameters(case: Case) -> Iterator[ParameterSet]:
    """Yield the parameters of a run, and those after each change by its faults."""
    yield case.par
    if isinstance(case, FaultyCase):
        yield from (par for _, par in case.changes)


def _is_read_with(name: str, model: Model, par: ParameterSet, choice: str, value: Any) -> bool:
    try:
        return _is_read(name, model, par.replace({choice: value}), False)
    except BywireError:  # the other parameters contradict this value
        return False


def _is_read(name: str, model: Model, par: ParameterSet, unless_known: bool = True) -> bool:
    """Return whether equations read a parameter; ``unless_known``: where they cannot be traced."""
    read = parameters_read(model, par)
    if read is None:
        return unless_known
    return name in read or any(each.startswith(f"{name}.") for each in read)


def parameters_read(model: Model, par: ParameterSet) -> frozenset[str] | None:
    """Return the names of the numbers that a model's equations and controllers read.

    Tables have one name per node, ``name.0``. None where the equations cannot be traced.
    """
    key = structure_of(model, par)
    if key not in _KNOWN:
        try:
            _KNOWN[key] = _traced(model, par)
        except (TypeError, ValueError, AttributeError, ArithmeticError, RecursionError):
            _KNOWN[key] = None  # they branch on a value, or pass it to untraceable code
    return _KNOWN[key]


def _traced(model: Any, par: ParameterSet) -> frozenset[str]:
    leaves = {name: Traced(None, name) for name in par.leaves()}
    here: Any = par.with_leaves(leaves)

    def numbers(names: Iterable[Any]) -> tuple[Traced, ...]:
        return tuple(Traced(None, None) for _ in names)

    x, xe, rate = (model.State._make(numbers(model.State._fields)) for _ in range(3))
    m, u, flow = (
        kind._make(numbers(kind._fields)) for kind in (model.Memory, model.Stimulus, model.Flow)
    )
    groups = model.compliance(here)
    contact = numbers(range(sum(map(len, groups))))
    reaction = numbers((*model.frictions, *model.limits))
    zeros = _Zeros()
    mass, balance = model.mass(xe, here), model.balance(x, xe, m, here, contact)
    results: tuple[Any, ...] = (
        # A state without any force stays at rest, whatever its mass.
        tuple(
            each
            for each, force, name in zip(mass, balance, model.State._fields, strict=True)
            if not zeros.has(force) or name in model.frictions
        ),
        balance,
        model.bounds(x, xe, m, here, contact),
        groups,
        model.gap(x, xe, here),
        model.powers(x, xe, rate, m, here, contact, reaction),
        model.output(x, m, here, contact, reaction, flow),
        tuple(task.tick(x, m, u, here) for task in model.tasks(par)),
        tuple(task.period for task in model.tasks(here)),
    )
    return frozenset(_names_that_count(results, zeros)) & leaves.keys()


class _Zeros:
    """Numbers that are zero whatever their inputs; kernels leave these out, too."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[bool, Any]] = {}  # kept alive: ids stay unique

    def has(self, value: Any) -> bool:
        """Return whether a number is zero."""
        if not isinstance(value, Traced):
            return isinstance(value, (int, float)) and value == 0
        if id(value) not in self._known:
            self._known[id(value)] = self._judged(value), value
        return self._known[id(value)][0]

    def _judged(self, value: Traced) -> bool:
        if value.operation is operator.mul:
            return any(map(self.has, value.inputs))
        if value.operation is operator.truediv:
            return self.has(value.inputs[0])
        sums = (operator.add, operator.sub, operator.neg)
        return value.operation in sums and all(map(self.has, value.inputs))


def _names_that_count(values: Any, zeros: _Zeros) -> Iterator[Any]:
    """Yield the names from which values are computed, without those of zeros."""
    waiting, seen = [values], set()
    while waiting:
        each = waiting.pop()
        if isinstance(each, Traced):
            if id(each) in seen or zeros.has(each):
                continue
            seen.add(id(each))
            if each.operation is None:
                yield each.inputs[0]
            waiting += each.inputs
        elif isinstance(each, (tuple, list)):
            waiting += each
