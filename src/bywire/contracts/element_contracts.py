"""Contracts of elements, control laws and parameter sets: equations, energy and values."""

from __future__ import annotations

import inspect
import itertools
import math
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np

from bywire.contracts.dimensioned import Dimensioned, fits
from bywire.contracts.elements import (
    Element,
    Number,
    flat,
    functions,
    is_parameters,
    is_signals,
    merged,
    numbers,
    parameter_classes,
    signature_of,
)
from bywire.contracts.evidence import (
    Contract,
    Demand,
    Demands,
    Evidence,
    Place,
    field_place,
    measured,
    place_of,
)
from bywire.core.errors import ParameterError
from bywire.core.parameters import Leaf, ParameterSet, leaf_fields
from bywire.core.typing import Array

NODES = 4  # number of nodes of every table
ATTEMPTS = 2000
_SHOWN = 24  # values in a message
_ROWS = 6  # of signals that an element watches
MANY = 64
"""maximum number of combinations of choices for which all combinations are tested"""

Arguments = dict[str, Any]
Choices = dict[str, Any]


def combinations(annotations: Mapping[str, Any]) -> Iterator[Choices]:
    """Yield combinations of the arguments' structural choices, such as ``par.law``.

    If there are only a few combinations, the function yields all of them. Otherwise, it combines
    each choice with the first and with the last value of all other choices.

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
            raise TypeError(
                f"{cls.__module__}.{cls.__name__}.{name} is neither a quantity nor a choice"
            )
    return options


class Sampler:
    """Sampler of arguments for one combination of choices; its samples have the same structure."""

    def __init__(self, annotations: Mapping[str, Any], choices: Choices, seed: int = 2010) -> None:
        self.annotations = dict(annotations)
        self.choices = choices
        self._rng = np.random.default_rng(seed)
        each = {name: numbers(name, annotation) for name, annotation in annotations.items()}
        self._known = {k: number for known in each.values() for k, number in known.items()}
        self._of = {name: tuple(known.values()) for name, known in each.items()}

    def sample(self) -> Arguments:
        """Return one sample of all arguments, with floats as numbers."""
        return {name: self._argument(name, note) for name, note in self.annotations.items()}

    def known(self, name: str) -> Number:
        """Return the description of a flattened number; all nodes of a table have the same one."""
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
                return cls.create(_fitted(cls, drawn) | chosen)
            except ParameterError as error:
                refusal = error
        raise ParameterError(
            f"{cls.__module__}: no sample with {chosen} is valid ({refusal})",
            name=cls.__module__,
            value=str(chosen),
        )

    def _leaf(self, cls: type[ParameterSet], name: str, number: Number) -> Any:
        if not is_table(cls, name):
            return self._draw(number)
        steps = self._rng.uniform(0.3, 1.5, NODES - 1) * number.nominal
        return (0.0, *np.cumsum(steps).tolist())

    def _draw(self, number: Number) -> float:
        """Return a value well inside the range, with the magnitude of the nominal value."""
        if math.isfinite(number.low) and math.isfinite(number.high):
            share = self._rng.uniform(0.05, 0.95)
            return number.low + share * (number.high - number.low)
        if not math.isfinite(number.low):
            return min(number.high, number.nominal * self._rng.uniform(-1.0, 1.0))
        if number.nominal <= number.low:
            raise ValueError(f"{number}: the nominal value must be inside the range")
        return number.low + (number.nominal - number.low) * 10 ** self._rng.uniform(-0.3, 0.3)


def _fitted(cls: type[ParameterSet], drawn: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return values whose tables fit each other, if a class declares how (``fitting``)."""
    own = {name: drawn[prefix + name] for name in cls.model_fields if prefix + name in drawn}
    if hasattr(cls, "fitting"):
        own = cls.fitting(own)
    values = {prefix + name: value for name, value in own.items()}
    for name, info in cls.model_fields.items():
        if is_parameters(info.annotation):
            values |= _fitted(typing.cast(Any, info.annotation), drawn, f"{prefix}{name}.")
    return values


def samples_of(
    annotations: Mapping[str, Any], choices: Choices, count: int
) -> tuple[Arguments, np.ndarray]:
    """Return one sample, and the numbers of ``count`` samples, shape (numbers, count).

    Contracts for the same arguments use the same samples.
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
    """Return whether a leaf of a parameter class is a table."""
    *groups, last = name.split(".")
    for group in groups:
        cls = typing.cast(Any, cls.model_fields[group].annotation)
    return typing.get_origin(cls.model_fields[last].annotation) is tuple


def flattened(arguments: Arguments) -> dict[str, float]:
    """Return all numbers in the arguments by dotted name."""
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
    """Return arguments with the same structure but other objects in place of the numbers."""
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
    """Return a trial's choices and values, for the end of a message.

    Parameters
    ----------
    structure, values
        A sample, and its numbers in the order of `flattened`; None if all samples give the same
        result.
    is_broken
        Whether to list the values, because they broke the contract.
    """
    texts = [f"{name} = {value}" for name, value in choices.items()]
    if structure is not None and is_broken:
        pairs = zip(flattened(structure), values, strict=True)
        texts += [f"{name} = {value:.6g}" for name, value in pairs]
    more = len(texts) - _SHOWN
    shown = texts[:_SHOWN] + ([f"and {more} more"] if more > 0 else [])
    return f" (with {', '.join(shown)})" if texts else ""


def symbolic(arguments: Arguments) -> tuple[ca.SX, Arguments]:
    """Return a column of symbols and the arguments that contain them."""
    names = list(flattened(arguments))
    column = ca.SX.sym("a", len(names))
    return column, carrying(arguments, dict(zip(names, ca.vertsplit(column), strict=True)))


def evaluate(function: Callable[..., Any], structure: Arguments, rows: Any) -> np.ndarray:
    """Return the results of one call, one row per result; ``rows`` contains floats or arrays."""
    numbers_in = dict(zip(flattened(structure), rows, strict=True))
    results = flat(call(function, carrying(structure, numbers_in)))
    return np.array([np.broadcast_to(np.asarray(r, float), np.shape(rows[0])) for r in results])


def traced(function: Callable[..., Any], structure: Arguments) -> tuple[ca.SX, ca.SX]:
    """Return a column of symbols, and a column of results as expressions of these symbols."""
    column, arguments = symbolic(structure)
    return column, ca.vertcat(*flat(call(function, arguments)))


def call(function: Callable[..., Any], arguments: Arguments) -> Any:
    """Call a function with those of the arguments that it accepts."""
    return function(**{name: arguments[name] for name in inspect.signature(function).parameters})


# --- Contracts

Class = type[ParameterSet]


def samples(cls: Class) -> Iterator[ParameterSet]:
    """Yield a sample of a class for each combination of its choices."""
    for choices in combinations({"par": cls}):
        yield Sampler({"par": cls}, choices).sample()["par"]


def survives_json(cls: Class) -> Iterator[Evidence]:
    """Check that samples of a class stay the same after a round trip through JSON."""
    for par in samples(cls):
        yield set_survives_json(par)


def set_survives_json(par: ParameterSet) -> Evidence:
    """Check that a set stays the same after a round trip through JSON."""
    again = type(par).model_validate_json(par.model_dump_json())
    before, after = par.flat(), again.flat()
    lost = [name for name in before if before[name] != after.get(name)]
    kept = again == par and not lost
    text = "the set equals its JSON" if kept else f"JSON changes {', '.join(lost)}"
    return Evidence(kept, text)


def keeps_its_ranges(cls: Class) -> Iterator[Evidence]:
    """Check that samples of a class reject values outside the range of each number."""
    for par in samples(cls):
        for name in leaf_fields(cls):
            yield from refuses_outside(par, name, _says_both)


def set_keeps_its_ranges(par: ParameterSet) -> Iterator[Evidence]:
    """Check that a set rejects values outside the range of each of its numbers."""
    for name in leaf_fields(type(par)):
        if not is_table(type(par), name) or par.flat()[name]:
            yield from refuses_outside(par, name, _says_which)


def _says_which(leaf: Leaf, value: float) -> tuple[str, ...]:
    return leaf.name, leaf.outside_text(value)[0]


def _says_both(leaf: Leaf, value: float) -> tuple[str, ...]:
    return leaf.name, *leaf.outside_text(value)


def refuses_outside(
    par: ParameterSet, name: str, expected: Callable[[Leaf, float], tuple[str, ...]]
) -> Iterator[Evidence]:
    """Check that a set rejects the values just outside the range of a number.

    Parameters
    ----------
    name
        Dotted name of a number or a table.
    expected
        ``expected(leaf, value)``: texts that the error message must contain.
    """
    leaf = leaf_fields(type(par))[name]
    place = _declared_at(type(par), name)
    for value in outside(leaf):
        wrong = (*par.flat()[name][:-1], value) if is_table(type(par), name) else value
        message = refusal(par, name, wrong)
        if message is None:
            text = f"{name} accepts {value!r}, but it must be {leaf.range_text}"
            if not math.isfinite(value):
                text += ". Add allow_inf_nan=False to its Field"
            yield Evidence(False, text, place=place)
            continue
        lacking = [part for part in expected(leaf, value) if part not in message]
        text = f"{name} enforces its range"
        if lacking:
            text = f"the error {message!r} does not contain {lacking[0]!r}"
        yield Evidence(not lacking, text, place=place)


def outside(leaf: Leaf) -> Iterator[float]:
    """Yield NaN, infinities, and the values just outside the range."""
    yield from (math.nan, math.inf, -math.inf)
    if math.isfinite(leaf.low):
        yield leaf.low if leaf.low_open else math.nextafter(leaf.low, -math.inf)
    if math.isfinite(leaf.high):
        yield leaf.high if leaf.high_open else math.nextafter(leaf.high, math.inf)


def refusal(par: ParameterSet, name: str, value: Any) -> str | None:
    """Return a set's error message for a value, or None if it accepts the value."""
    try:
        par.replace({name: value})
    except ParameterError as error:
        return str(error)
    return None


def _declared_at(cls: Class, name: str) -> Place:
    """Return the line that declares a number in the class of its group."""
    *groups, last = name.split(".")
    for group in groups:
        inner = cls.model_fields[group].annotation
        if isinstance(inner, type) and issubclass(inner, ParameterSet):
            cls = inner
    return field_place(cls, last) if last in cls.model_fields else place_of(cls)


# --- Contracts of elements and control laws

Function = Callable[..., Any]

SAMPLES = 30
BACK_ENDS = 1e-12
"""maximum difference between floats, arrays and symbols, relative to the largest value"""
DIFFERENCE = 1e-6
"""step of the finite differences, relative to the nominal value"""
SLOPE = 1e-7
"""maximum deviation of a derivative from finite differences"""
PREFIX = 1e-12
"""maximum deviation from one of a unit's SI factor"""


def with_units(sampler: Sampler) -> Arguments:
    """Return a sample whose numbers have units."""
    sample = sampler.sample()
    values = {k: Dimensioned(v, sampler.known(k).unit) for k, v in flattened(sample).items()}
    return carrying(sample, values)


def has_annotated_units(function: Function) -> Iterator[Evidence]:
    """Check that results have the dimension of their annotation for all choices."""
    arguments, returns = signature_of(function)
    expected = numbers("result", returns)
    for choices in combinations(arguments):
        got = flat(call(function, with_units(Sampler(arguments, choices))))
        for (name, number), value in zip(expected.items(), got, strict=True):
            text = f"{name} is {value}, but its unit is {number.unit}{described(choices)}"
            yield Evidence(fits(value, number.unit), text)


def is_in_SI(function: Function) -> Iterator[Evidence]:
    """Check that all units are SI units, because no code applies the factor of a prefix."""
    arguments, returns = signature_of(function)
    for argument, annotation in (*arguments.items(), ("result", returns)):
        for name, number in numbers(argument, annotation).items():
            factor = Dimensioned(1.0, number.unit).value
            text = f"{name} has the unit {number.unit}, which is {factor:g} SI units"
            yield measured(abs(factor - 1.0), PREFIX, text)


def has_agreeing_back_ends(function: Function) -> Iterator[Evidence]:
    """Check that floats, NumPy arrays and CasADi symbols give the same result."""
    arguments, _ = signature_of(function)
    for choices in combinations(arguments):
        structure, samples = samples_of(arguments, choices, SAMPLES)
        each = [evaluate(function, structure, numbers_in) for numbers_in in samples.T.tolist()]
        floats = np.array(each).T
        arrays = evaluate(function, structure, samples)
        column, results = traced(function, structure)
        symbols = ca.Function("f", [column], [results])(samples).full()
        # A difference of large terms is only as accurate as its terms, so use the row's largest
        # value as the scale.
        scale = np.abs(floats).max(axis=1, keepdims=True)
        for name, other in (("arrays", arrays), ("symbols", symbols)):
            apart = np.abs(other - floats)
            off = _relative(apart, scale)
            at = int(np.argmax((apart / np.where(scale > 0, scale, 1)).max(axis=0)))
            where = described(choices, structure, samples[:, at], off > BACK_ENDS)
            text = f"results for {name} and floats differ by {off:.1e}{where}"
            yield measured(off, BACK_ENDS, text)


def has_its_slopes(function: Function) -> Iterator[Evidence]:
    """Check that the symbolic Jacobian equals the function's slope except at kinks."""
    arguments, _ = signature_of(function)
    for choices in combinations(arguments):
        sampler = Sampler(arguments, choices)
        structure, samples = samples_of(arguments, choices, SAMPLES)
        column, results = traced(function, structure)
        shape = (results.numel(), column.numel(), SAMPLES)
        compiled = ca.Function("J", [column], [ca.vec(ca.densify(ca.jacobian(results, column)))])
        exact = compiled(samples).full().reshape(shape, order="F")
        if not np.all(np.isfinite(exact)):
            at = int(np.argmax(~np.isfinite(exact).all(axis=(0, 1))))
            where = described(choices, structure, samples[:, at])
            yield Evidence(False, f"the Jacobian is not finite{where}")
            return
        largest = np.abs(evaluate(function, structure, samples)).max(axis=1)[:, None]
        names = list(flattened(structure))
        nominals = np.array([abs(sampler.known(name).nominal) for name in names])
        both = [
            _slopes(function, structure, samples, h * nominals)
            for h in (DIFFERENCE, DIFFERENCE / 2)
        ]
        for j, (name, nominal, wide, narrow) in enumerate(zip(names, nominals, *both, strict=True)):
            scale = largest / nominal + np.abs(exact[:, j])
            # If the two differences disagree, there is a kink or a jump in the interval.
            smooth = np.abs(wide - narrow) <= 1e-3 * scale
            if not np.all(smooth.mean(axis=1) > 0.5):
                text = f"the function has kinks everywhere along {name}{described(choices)}"
                yield Evidence(False, text)
                return
            off = np.abs(narrow - exact[:, j]) / np.where(scale > 0, scale, 1)
            share = float(off[smooth].max())
            at = int(np.argmax(np.where(smooth, off, -1.0).max(axis=0)))
            where = described(choices, structure, samples[:, at], share > SLOPE)
            text = f"the error of the slope along {name} is {share:.1e}{where}"
            yield measured(share, SLOPE, text)


def _slopes(function: Function, structure: Arguments, matrix: Array, steps: Array) -> Array:
    """Return central differences along each row of the samples, shape (rows, results, samples)."""
    moves = np.kron(np.diag(steps), np.ones(matrix.shape[1]))
    many = np.tile(matrix, len(steps))
    difference = evaluate(function, structure, many + moves) - evaluate(
        function, structure, many - moves
    )
    along = difference.reshape(len(difference), len(steps), matrix.shape[1])
    return np.asarray(along.transpose(1, 0, 2) / (2.0 * steps[:, None, None]))


def _relative(off: Array, scale: Array) -> float:
    """Return the maximum relative difference; infinite if the scale is zero but values differ."""
    wide = np.broadcast_to(scale, off.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(off == 0.0, 0.0, off / wide)
    return float(share.max())


# --- Energy: the rate of the stored energy equals the input power minus the losses
# An element with ``energy`` also has ``power_in``. If the energy depends on a ``State``, the
# element has ``mass`` and ``balance``, or ``rate`` and ``slip_width`` if its states are stop
# operators. If the energy depends on inputs, it has ``input_rate``, a tuple with the derivatives of
# these inputs under the same names. Without ``power_loss``, the element is lossless. If another
# function of the element returns the type of an argument (such as the contact forces), that
# function computes the argument.

BALANCE = 1e-9
"""maximum error relative to the powers; the series for the fluid's flow energy has about 1e-10"""
ENERGETIC = ("energy", "power_in", "power_loss", "mass", "balance", "input_rate")
STOPPED = ("rate", "slip_width")
"""functions of an element whose states are stop operators"""


def has_rates_of_its_states(module: ModuleType) -> Iterator[Evidence]:
    """Check that balance divided by mass has the dimension of the state's derivative."""
    mass, balance = (functions(module)[name] for name in ("mass", "balance"))
    arguments = merged((mass, balance))
    states = numbers("state", module.State)
    for choices in combinations(arguments):
        sample = with_units(Sampler(arguments, choices))
        rates = zip(flat(call(balance, sample)), flat(call(mass, sample)), strict=True)
        for (name, number), (top, bottom) in zip(states.items(), rates, strict=True):
            rate, unit = top / bottom, f"({number.unit})/s"
            yield Evidence(
                fits(rate, unit),
                f"the rate of {name} is {rate}, but its unit is {unit}{described(choices)}",
                place=place_of(balance),
            )


def keeps_energy(module: ModuleType) -> Iterator[Evidence]:
    """Check that an element neither creates nor hides energy."""
    stops = STOPPED if "slip_width" in functions(module) else ()
    laws = {k: f for k, f in functions(module).items() if k in (*ENERGETIC, *stops)}
    powers = [law for name, law in laws.items() if name in ("energy", "power_in", "power_loss")]
    moving = getattr(module, "State", None) in merged(powers).values()
    needed = {"power_in", *((stops or ("mass", "balance")) if moving else ())}
    place = place_of(laws["energy"])
    if needed - laws.keys():
        missing = ", ".join(sorted(needed - laws.keys()))
        text = f"the element stores energy, so it also needs {missing}"
        yield Evidence(False, text, place=place)
        return
    arguments = merged(laws.values())
    is_alive = False
    for choices in combinations(arguments):
        structure, samples = samples_of(arguments, choices, SAMPLES)
        column, sample = symbolic(structure)
        sample = _consistent(module, arguments, sample)
        rates = _rates(module, laws, arguments, sample)
        stored = call(laws["energy"], sample)
        slopes = dict(
            zip(flattened(structure), ca.vertsplit(ca.gradient(stored, column)), strict=True)
        )
        terms = [slopes[name] * rate for name, rate in rates.items()]
        terms.append(-call(laws["power_in"], sample))
        terms.append(call(laws["power_loss"], sample) if "power_loss" in laws else 0.0)
        signals = [k for k in slopes if not is_parameters(arguments[k.split(".")[0]])]
        unmoved = [slopes[k] for k in signals if k not in rates]
        results = [ca.vertcat(*terms), ca.vertcat(0.0, *unmoved)]
        if stops:
            results = _held_or_slipping(module, laws, arguments, sample, results)
        compiled = ca.Function("E", [column], results)
        powers, hidden = (out.full() for out in compiled(samples))
        if hidden.any():
            text = (
                "the energy depends on inputs. Add a function input_rate(u) that returns their "
                f"derivatives{described(choices)}"
            )
            yield Evidence(False, text, place=place)
            return
        off, scale = np.abs(powers.sum(axis=0)), np.abs(powers).sum(axis=0)
        if not scale.any():  # choices may switch the element off
            continue
        is_alive = True
        shares = off / np.where(scale > 0, scale, 1.0)
        at = int(np.argmax(shares))
        share = float(shares[at])
        where = described(choices, structure, samples[:, at], share > BALANCE)
        text = f"the error of d(energy)/dt is {share:.1e} of the powers{where}"
        yield measured(share, BALANCE, text, place)
    if not is_alive:
        yield Evidence(False, "all powers are zero for all choices", place=place)


def loses_what_it_says(module: ModuleType) -> Iterator[Evidence]:
    """Check that a loss does not deliver energy, unless its docstring calls it signed."""
    loss = functions(module)["power_loss"]
    claim, place = loss.__doc__ or "", place_of(loss)
    if (">= 0" in claim) == ("signed" in claim):
        text = "the docstring of power_loss must contain either '>= 0' or 'signed'"
        yield Evidence(False, text, place=place)
        return
    if "signed" in claim:
        return
    arguments, _ = signature_of(loss)
    for choices in combinations(arguments):
        structure, samples = samples_of(arguments, choices, SAMPLES * 4)
        column, sample = symbolic(structure)
        heat = call(loss, _consistent(module, arguments, sample))
        values = ca.Function("P", [column], [heat])(samples).full()
        at = int(np.argmin(values))
        least = float(values.flat[at])
        where = described(choices, structure, samples[:, at], not least >= 0.0)
        yield Evidence(
            least >= 0.0, f"the minimum of power_loss is {least:g} W{where}", place=place
        )


def warns_at_extremes(module: ModuleType) -> Iterator[Evidence]:
    """Check that the lowest and highest values of inputs determine whether an element warns.

    Studies on a graphics processor rely on this for a ``watch`` that is declared `within_limits`.
    """
    watch, rng = module.watch, np.random.default_rng(2010)
    annotations, _ = signature_of(watch)
    texts = {name: "here" for name, note in annotations.items() if note is str}
    annotations = {n: note for n, note in annotations.items() if n != "t" and n not in texts}
    signals = [name for name, note in annotations.items() if not is_parameters(note)]
    for choices in combinations(annotations):
        sampler = Sampler(annotations, choices)
        for _ in range(SAMPLES):
            sample = sampler.sample() | texts
            rows = {name: _spread(rng, flat(sample[name])) for name in signals}
            ends = {name: np.sort(each, axis=1)[:, [0, -1]] for name, each in rows.items()}
            every, two = (
                watch(t=np.arange(float(n)), **_filled(sample, given))
                for n, given in ((_ROWS, rows), (2, ends))
            )
            text = "a warning about some rows depends on more than their lowest and highest values"
            yield Evidence(
                bool(every) == bool(two),
                f"{text}. Declare watch as row_by_row instead{described(choices)}",
                place=place_of(watch),
            )


def _spread(rng: np.random.Generator, values: Sequence[float]) -> Array:
    """Return rows around values, over several orders of magnitude and of both signs."""
    shape = len(values), _ROWS
    scale = 10.0 ** rng.uniform(-2.0, 4.0, shape) * np.array(values)[:, None]
    return np.asarray(scale * rng.uniform(-1.0, 1.0, shape))


def _filled(sample: Arguments, rows: Mapping[str, Array]) -> Arguments:
    """Return arguments whose signals have rows, shape (numbers, rows) each."""
    return sample | {
        name: type(sample[name])(*each) if isinstance(sample[name], tuple) else each[0]
        for name, each in rows.items()
    }


def _consistent(module: ModuleType, known: dict[str, Any], sample: Arguments) -> Arguments:
    """Return the arguments, with those that the element's own laws determine replaced."""
    computed: Arguments = {}
    for law in (f for k, f in functions(module).items() if k not in (*ENERGETIC, *STOPPED)):
        takes, gives = signature_of(law)
        free = is_signals(gives) and gives is not getattr(module, "State", None)
        for name in (k for k, note in known.items() if note is gives and free):
            if takes.keys() <= sample.keys() - {name}:
                computed[name] = call(law, sample)
    return sample | computed


def _rates(
    module: ModuleType, laws: dict[str, Any], known: dict[str, Any], sample: Arguments
) -> dict[str, Any]:
    """Return the derivatives of all states and varying inputs, by the name of their argument."""
    rates: dict[str, Any] = {}
    place = {note: name for name, note in known.items() if is_signals(note)}
    if "balance" in laws and hasattr(module, "State"):
        pairs = zip(
            flat(call(laws["balance"], sample)), flat(call(laws["mass"], sample)), strict=True
        )
        for field, (top, bottom) in zip(module.State._fields, pairs, strict=True):
            rates[f"{place[module.State]}.{field}"] = top / bottom
    if "slip_width" in laws:
        slip = sample.get("slip")
        for k, (field, speed) in enumerate(
            zip(module.State._fields, flat(call(laws["rate"], sample)), strict=True)
        ):
            rates[f"{place[module.State]}.{field}"] = speed - (0.0 if slip is None else slip[k])
    if "input_rate" in laws:
        moving = call(laws["input_rate"], sample)
        rates |= {f"{place[module.Input]}.{k}": v for k, v in moving._asdict().items()}
    return rates


def _held_or_slipping(
    module: ModuleType, laws: dict[str, Any], known: dict[str, Any], sample: Arguments, results: Any
) -> Any:
    """Return results in which each stop operator holds, or slips at its width with the motion."""
    place = next(name for name, note in known.items() if note is module.State)
    speeds, widths = (flat(call(laws[name], sample)) for name in ("rate", "slip_width"))
    drawn, found = [], []
    for k, (speed, width) in enumerate(zip(speeds, widths, strict=True)):
        z = sample[place][k]
        slips = z * speed > 0
        held = ca.fmin(ca.fmax(z, -width), width)
        drawn.append(z)
        found.append(ca.if_else(slips, width * ca.sign(speed), held))
        if "slip" in sample:
            drawn.append(sample["slip"][k])
            found.append(ca.if_else(slips, speed, 0))
    return ca.substitute(results, drawn, found)


# --- All of them

OF_A_FUNCTION: dict[str, Contract] = {
    "units": has_annotated_units,
    "SI units": is_in_SI,
    "back ends": has_agreeing_back_ends,
    "derivatives": has_its_slopes,
}
"""contracts of each public function"""

OF_A_CLASS: dict[str, Contract] = {
    "round trip": survives_json,
    "refusals": keeps_its_ranges,
}
"""contracts of each parameter class"""


def demands_on(element: Element) -> Demands:
    """Yield all contracts of an element."""
    functions = element.functions
    for name, function in functions.items():
        for contract, test in OF_A_FUNCTION.items():
            yield Demand(contract, f"{element.name}.{name}", function, test)
    module = element.module
    if {"mass", "balance"} <= functions.keys():
        yield Demand("rates", element.name, module, has_rates_of_its_states)
    if "energy" in functions:
        yield Demand("energy balance", element.name, module, keeps_energy)
    if "power_loss" in functions:
        yield Demand("loss", element.name, module, loses_what_it_says)
    if hasattr(getattr(module, "watch", None), "within_limits"):
        yield Demand("warnings", element.name, module, warns_at_extremes)
    for cls in parameter_classes(module):
        for contract, test in OF_A_CLASS.items():
            yield Demand(contract, f"{element.name}.{cls.__name__}", cls, test)
