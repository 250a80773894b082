"""Contracts of a parameter set, and samples of arguments from annotations."""

from __future__ import annotations

import inspect
import itertools
import math
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from bywire.contracts.elements import Number, flat, is_parameters, is_signals, numbers
from bywire.contracts.evidence import Evidence, Place, field_place, place_of
from bywire.core.errors import ParameterError
from bywire.core.leaf import Leaf
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.typing import Array

NODES = 4  # of every table
ATTEMPTS = 2000
_SHOWN = 24  # values in a message
MANY = 64
"""combinations of choices above which not all are tried"""

Arguments = dict[str, Any]
Choices = dict[str, Any]


def combinations(annotations: Mapping[str, Any]) -> Iterator[Choices]:
    """Yield combinations of structural choices, ``par.law`` and the like, of some arguments.

    Every combination where there are few; else every choice beside the first and beside the last
    of all the others.

    Raises
    ------
    TypeError
        When a field of a parameter set is neither a quantity nor a choice.
    """
    options: dict[str, tuple[Any, ...]] = {}
    for name, annotation in annotations.items():
        if is_parameters(annotation):
            options |= _options(annotation, f"{name}.")
    if math.prod(map(len, options.values())) <= MANY:
        for values in itertools.product(*options.values()):
            yield dict(zip(options, values, strict=True))
        return
    for end in (0, -1):
        beside = {name: values[end] for name, values in options.items()}
        yield beside
        for name, values in options.items():
            for value in values:
                if value != beside[name]:
                    yield {**beside, name: value}


def _options(cls: type[ParameterSet], prefix: str) -> dict[str, tuple[Any, ...]]:
    options: dict[str, tuple[Any, ...]] = {}
    leaves = leaf_fields(cls)
    for name, info in cls.model_fields.items():
        if is_parameters(info.annotation):
            options |= _options(typing.cast(Any, info.annotation), f"{prefix}{name}.")
        elif typing.get_origin(info.annotation) is typing.Literal:
            options[prefix + name] = typing.get_args(info.annotation)
        elif info.annotation is bool:
            options[prefix + name] = (False, True)
        elif name not in leaves:
            raise TypeError(f"{cls.__module__}.{cls.__name__}.{name}: neither quantity nor choice")
    return options


class Sampler:
    """Some arguments with one combination of choices; samples of it share one structure."""

    def __init__(self, annotations: Mapping[str, Any], choices: Choices, seed: int = 2010) -> None:
        self.annotations = dict(annotations)
        self.choices = choices
        self._rng = np.random.default_rng(seed)
        each = {name: numbers(name, annotation) for name, annotation in annotations.items()}
        self._known = {k: number for known in each.values() for k, number in known.items()}
        self._of = {name: tuple(known.values()) for name, known in each.items()}

    def sample(self) -> Arguments:
        """Return one sample of all arguments, as floats."""
        return {name: self._argument(name, note) for name, note in self.annotations.items()}

    def known(self, name: str) -> Number:
        """Return what is known of a flattened number; the nodes of a table share it."""
        return self._known[name if name in self._known else name.rsplit(".", 1)[0]]

    def _argument(self, name: str, annotation: Any) -> Any:
        if is_parameters(annotation):
            return self._parameters(name, annotation)
        if is_signals(annotation):
            return annotation(*(self._draw(n) for n in self._of[name]))
        return self._draw(self._known[name])

    def _parameters(self, name: str, cls: type[ParameterSet]) -> ParameterSet:
        prefix = f"{name}."
        chosen = {
            k.removeprefix(prefix): v for k, v in self.choices.items() if k.startswith(prefix)
        }
        for _ in range(ATTEMPTS):
            drawn = {k: self._leaf(cls, k, self._known[prefix + k]) for k in leaf_fields(cls)}
            try:
                return cls.create(drawn | chosen)
            except ParameterError as error:
                refusal = error
        raise ParameterError(f"{cls.__module__}: no sample of {chosen} passes: {refusal}")

    def _leaf(self, cls: type[ParameterSet], name: str, number: Number) -> Any:
        if not is_table(cls, name):
            return self._draw(number)
        steps = self._rng.uniform(0.3, 1.5, NODES - 1) * number.nominal
        return (0.0, *np.cumsum(steps).tolist())

    def _draw(self, number: Number) -> float:
        """Return a value well inside its range, of the magnitude of the nominal one."""
        if math.isfinite(number.low) and math.isfinite(number.high):
            share = self._rng.uniform(0.05, 0.95)
            return number.low + share * (number.high - number.low)
        if not math.isfinite(number.low):
            return min(number.high, number.nominal * self._rng.uniform(-1.0, 1.0))
        if number.nominal <= number.low:
            raise ValueError(f"{number}: the nominal value must lie inside the range")
        return number.low + (number.nominal - number.low) * 10 ** self._rng.uniform(-0.3, 0.3)


def samples_of(
    annotations: Mapping[str, Any], choices: Choices, count: int
) -> tuple[Arguments, np.ndarray]:
    """Return one sample, and the numbers of ``count`` samples, shape (numbers, count).

    Contracts of the same arguments look at the same samples.
    """
    return _samples(tuple(annotations.items()), tuple(choices.items()), count)


@lru_cache(maxsize=1024)
def _samples(
    annotations: tuple[tuple[str, Any], ...], choices: tuple[tuple[str, Any], ...], count: int
) -> tuple[Arguments, np.ndarray]:
    sampler = Sampler(dict(annotations), dict(choices))
    samples = [sampler.sample() for _ in range(count)]
    numbers_in = np.array([list(flattened(s).values()) for s in samples]).T
    numbers_in.setflags(write=False)
    return samples[0], numbers_in


@lru_cache(maxsize=4096)
def is_table(cls: type[ParameterSet], name: str) -> bool:
    """Tell whether the leaf of a parameter class is a table."""
    *groups, last = name.split(".")
    for group in groups:
        cls = typing.cast(Any, cls.model_fields[group].annotation)
    return typing.get_origin(cls.model_fields[last].annotation) is tuple


def flattened(arguments: Arguments) -> dict[str, float]:
    """Return all numbers of some arguments by dotted name."""
    numbers_in: dict[str, float] = {}
    for name, value in arguments.items():
        if isinstance(value, ParameterSet):
            numbers_in |= {f"{name}.{k}": v for k, v in value.leaves().items()}
        elif isinstance(value, tuple):
            numbers_in |= {f"{name}.{k}": v for k, v in typing.cast(Any, value)._asdict().items()}
        else:
            numbers_in[name] = value
    return numbers_in


def carrying(arguments: Arguments, values: Mapping[str, Any]) -> Arguments:
    """Return arguments of the same structure that carry other objects as their numbers."""
    renewed: Arguments = {}
    for name, value in arguments.items():
        if isinstance(value, ParameterSet):
            renewed[name] = value.with_leaves({k: values[f"{name}.{k}"] for k in value.leaves()})
        elif isinstance(value, tuple):
            fields = typing.cast(Any, value)._fields
            renewed[name] = type(value)(*(values[f"{name}.{k}"] for k in fields))
        else:
            renewed[name] = values[name]
    return renewed


def described(
    choices: Choices,
    structure: Arguments | None = None,
    values: Sequence[float] | Array = (),
    is_broken: bool = True,
) -> str:
    """Return with which choices and values a contract was tried, as messages end; with units.

    Parameters
    ----------
    structure, values
        A sample, and the numbers in it, in the order of `flattened`; none where all were alike.
    is_broken
        Whether the values matter, as they broke the contract.
    """
    texts = [f"{name} = {value}" for name, value in choices.items()]
    if structure is not None and is_broken:
        pairs = zip(flattened(structure), values, strict=True)
        texts += [f"{name} = {value:.6g}" for name, value in pairs]
    more = len(texts) - _SHOWN
    shown = texts[:_SHOWN] + ([f"and {more} more"] if more > 0 else [])
    return f"; with {', '.join(shown)}" if texts else ""


def symbolic(arguments: Arguments) -> tuple[ca.SX, Arguments]:
    """Return a column of symbols and the arguments that carry them."""
    names = list(flattened(arguments))
    column = ca.SX.sym("a", len(names))
    return column, carrying(arguments, dict(zip(names, ca.vertsplit(column), strict=True)))


def evaluate(function: Callable[..., Any], structure: Arguments, rows: Any) -> np.ndarray:
    """Return the results of one call, one row each; ``rows`` holds floats or arrays."""
    numbers_in = dict(zip(flattened(structure), rows, strict=True))
    results = flat(call(function, carrying(structure, numbers_in)))
    return np.array([np.broadcast_to(np.asarray(r, float), np.shape(rows[0])) for r in results])


def traced(function: Callable[..., Any], structure: Arguments) -> tuple[ca.SX, ca.SX]:
    """Return a column of symbols and the column of results as expressions of them."""
    column, arguments = symbolic(structure)
    return column, ca.vertcat(*flat(call(function, arguments)))


def call(function: Callable[..., Any], arguments: Arguments) -> Any:
    """Call a function with those of the arguments that it takes."""
    return function(**{name: arguments[name] for name in inspect.signature(function).parameters})


# --- Contracts

Class = type[ParameterSet]


def samples(cls: Class) -> Iterator[ParameterSet]:
    """Yield a sample of a class for every combination of its choices."""
    for choices in combinations({"par": cls}):
        yield Sampler({"par": cls}, choices).sample()["par"]


def survives_json(cls: Class) -> Iterator[Evidence]:
    """Find whether the JSON of samples of a class gives the same sets back."""
    for par in samples(cls):
        yield set_survives_json(par)


def set_survives_json(par: ParameterSet) -> Evidence:
    """Find whether the JSON of a set gives the same set back."""
    again = type(par).model_validate_json(par.model_dump_json())
    before, after = par.flat(), again.flat()
    lost = [name for name in before if before[name] != after.get(name)]
    kept = again == par and not lost
    text = "its JSON gives the same set back" if kept else f"JSON changes {', '.join(lost)}"
    return Evidence(kept, text)


def keeps_its_ranges(cls: Class) -> Iterator[Evidence]:
    """Find whether samples of a class refuse what lies outside the range of any number."""
    for par in samples(cls):
        for name in leaf_fields(cls):
            yield from refuses_outside(par, name, _says_both)


def set_keeps_its_ranges(par: ParameterSet) -> Iterator[Evidence]:
    """Find whether a set refuses what lies outside the range of any of its numbers."""
    for name in leaf_fields(type(par)):
        if not is_table(type(par), name) or par.flat()[name]:
            yield from refuses_outside(par, name, _says_which)


def _says_which(leaf: Leaf, value: float) -> tuple[str, ...]:
    return leaf.name, str(value)


def _says_range(leaf: Leaf, value: float) -> tuple[str, ...]:
    unit = "" if leaf.unit.symbol == "1" else f" {leaf.unit.symbol}"
    return f"{value}{unit}", leaf.range_text


def _says_both(leaf: Leaf, value: float) -> tuple[str, ...]:
    return *_says_which(leaf, value), *_says_range(leaf, value)


def refuses_outside(
    par: ParameterSet, name: str, wanted: Callable[[Leaf, float], tuple[str, ...]]
) -> Iterator[Evidence]:
    """Find whether a set refuses every value nearest to the range of a number but not in it.

    Parameters
    ----------
    name
        Dotted name of the number, or of a table of them.
    wanted
        ``wanted(leaf, value)``: what the message has to contain.
    """
    leaf = leaf_fields(type(par))[name]
    place = _declared_at(type(par), name)
    for value in outside(leaf):
        wrong = (*par.flat()[name][:-1], value) if is_table(type(par), name) else value
        message = refusal(par, name, wrong)
        if message is None:
            text = f"{name} = {value!r} was taken; admissible is {leaf.range_text}"
            if not math.isfinite(value):
                text += ": write allow_inf_nan=False in its Field"
            yield Evidence(False, text, place=place)
            continue
        lacking = [part for part in wanted(leaf, value) if part not in message]
        said = f"{lacking[0]!r} is missing in {message!r}" if lacking else f"{name} keeps its range"
        yield Evidence(not lacking, said, place=place)


def outside(leaf: Leaf) -> Iterator[float]:
    """Yield what is no number, and the values nearest to the range that are not in it."""
    yield from (math.nan, math.inf, -math.inf)
    if math.isfinite(leaf.low):
        yield leaf.low if leaf.low_open else math.nextafter(leaf.low, -math.inf)
    if math.isfinite(leaf.high):
        yield leaf.high if leaf.high_open else math.nextafter(leaf.high, math.inf)


def refusal(par: ParameterSet, name: str, value: Any) -> str | None:
    """Return the message with which a set refuses a value; None where it takes it."""
    try:
        par.replace({name: value})
    except ParameterError as error:
        return str(error)
    return None


def _declared_at(cls: Class, name: str) -> Place:
    """Return the line that declares a number, in the class of its group."""
    *groups, last = name.split(".")
    for group in groups:
        inner = cls.model_fields[group].annotation
        if isinstance(inner, type) and issubclass(inner, ParameterSet):
            cls = inner
    return field_place(cls, last) if last in cls.model_fields else place_of(cls)
