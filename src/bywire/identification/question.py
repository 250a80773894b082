"""Questions for identification on a bench: measured signals and unknowns as texts, and options."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.core.arguments import checked
from bywire.core.callers import option
from bywire.core.errors import ParameterError, not_valid, quoted, unknown_name
from bywire.core.parameters import Leaf, ParameterSet, leaf_fields
from bywire.core.quantities import Factor, Unit
from bywire.core.registry import Kind, instances
from bywire.core.signals import signals_of, without_noise
from bywire.core.typing import Array
from bywire.core.units import difference_unit, shown, split
from bywire.core.values import number
from bywire.identification.least_squares import Loss
from bywire.identification.method import METHODS, Method
from bywire.identification.output_error import Between
from bywire.identification.unknown import Unknown, parameters_of, scattered

if TYPE_CHECKING:
    import xarray as xr

Texts = Mapping[str, str] | Iterable[str]
"""text for each name; or the names alone"""

BETWEEN = re.compile(r"\s*(?:\+-|\+/-|±)\s*")
"""separator of a value, or a column, and its standard deviation"""

_NUMBER = re.compile(r"[-+]?\.?\d")  # first characters of a noise

Share = Annotated[float, Unit("1", 0.01), Field(ge=0, le=1, allow_inf_nan=False)]


@checked
@dataclass(frozen=True)
class Question:
    """Question for a method on any bench: measured signals and unknowns.

    Texts have units as on the command line.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or an experiment's name.
    inputs
        Stimulus of the model -> measured signal, or column such as ``"Demand [bar]"``; default:
        all of the same name.
    outputs
        Output of the model -> standard deviation of its noise, such as ``"0.02 bar"``, its column,
        such as ``"Pressure [psi]"``, or both, ``"Pressure [psi] +- 0.02 bar"``. Empty, or the names
        alone, for a column of that name and the record's own noise.
    unknowns
        Parameter, ``stimulus.NAME`` or ``offset.SIGNAL`` -> range such as ``"0.1..1 ohm"``; empty,
        or the names alone, for none.
    priors
        Prior knowledge of an unknown: ``"0.35 +- 0.02 ohm"``.
    states
        States whose initial values are unknown, separately for every record.
    case
        Run of the experiment; the first one by default.
    holdout
        A measurement for validation, which is not fitted.
    loss
        Loss of the residuals: ``linear``, ``soft_l1``, ``huber`` or ``cauchy``; by default that of
        the method.
    """

    bench: Bench | str | Path | None = None
    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Texts = field(default_factory=dict)
    unknowns: Texts = field(default_factory=dict)
    priors: Mapping[str, str] = field(default_factory=dict)
    states: Sequence[str] = ()
    case: str = ""
    holdout: str | Path | xr.Dataset | None = None
    loss: str = ""

    @property
    def noise(self) -> dict[str, str]:
        """Noise of each measured output as written; empty to estimate it from the record."""
        return {name: _column_and_noise(text)[1] for name, text in _texts_of(self.outputs).items()}

    @property
    def columns(self) -> dict[str, str]:
        """Column of each output for which the user specified one, as written."""
        texts = {name: _column_and_noise(text)[0] for name, text in _texts_of(self.outputs).items()}
        return {name: column for name, column in texts.items() if column}

    @property
    def ranges(self) -> dict[str, str]:
        """Range of each unknown as written; may be empty."""
        return _texts_of(self.unknowns)

    @property
    def key(self) -> str:
        """Text that identifies simulated experiments for this question."""
        return f"{self.inputs} {self.noise} {self.ranges} {self.priors} {self.states} {self.case}"

    @property
    def given(self) -> tuple[str, ...]:
        """Names of the fields that the user specified."""
        options = {
            "bench": self.bench is not None,
            "inputs": self.inputs,
            "outputs": self.outputs,
            "unknowns": self.unknowns,
            "priors": self.priors,
            "states": self.states,
            "case": self.case,
            "holdout": self.holdout is not None,
            "loss": self.loss,
        }
        return tuple(name for name, value in options.items() if value)


def _texts_of(names: Texts) -> dict[str, str]:
    """Return the text for each name; empty if there are only names."""
    if isinstance(names, Mapping):
        return dict(names)
    return dict.fromkeys([names] if isinstance(names, str) else names, "")


def _column_and_noise(text: str) -> tuple[str, str]:
    """Return the column and the noise in a text; both may be empty.

    A text that starts with a digit and has no unit in brackets is a noise.

    Examples
    --------
    >>> _column_and_noise("0.02 bar"), _column_and_noise("Druck [psi] +- 0.02 bar")
    (('', '0.02 bar'), ('Druck [psi]', '0.02 bar'))
    >>> _column_and_noise("2nd sensor [bar]")
    ('2nd sensor [bar]', '')
    """
    text = text.strip()
    *before, last = BETWEEN.split(text)
    if before and _NUMBER.match(last):
        return " +- ".join(before).strip(), last.strip()
    is_noise = _NUMBER.match(text) and not text.endswith(("]", ")"))
    return ("", text) if is_noise else (text, "")


@dataclass(frozen=True)
class BenchMethod:
    """A named method for any bench.

    Parameters
    ----------
    name
        Name on the command line.
    summary
        One line for listings.
    options, defaults, simulated
        As for the methods that it makes.
    on
        ``on(bench, question) -> Method``: the method for a question about a bench.
    """

    name: str
    summary: str
    options: type[ParameterSet]
    defaults: ParameterSet
    simulated: tuple[str, ...]
    on: Callable[[Bench, Question], Method]


BENCH_METHODS = Kind(
    "method", ("methods",), instances(BenchMethod), "bywire.identification.methods"
)
"""methods that need a bench"""


def find_method(name: str) -> Method:
    """Return one method that needs no bench.

    Raises
    ------
    UnknownNameError
        With the nearest known names, including methods that need a bench.
    """
    if name not in METHODS.all():
        raise METHODS.unknown(name, BENCH_METHODS)
    return METHODS.all()[name]


class Options(ParameterSet):
    """Loss of the residuals, and limits for the result."""

    loss: Loss
    """loss of the residuals: beyond the noise, a robust loss grows more slowly than the square"""
    between: Between
    """inputs between samples: held, for a controller's demand, or linear, for smooth inputs that
    the model reads faster than they were measured"""
    most_residual: Factor
    """ratio of residual to noise above which the model does not explain the record"""
    most_outliers: Share
    """maximum fraction of residuals beyond four times the noise that a robust loss may exclude"""
    least_vaf: Share
    """minimum variance accounted for in the held-out record, for each signal"""
    noise: Share
    """synthetic: default standard deviation of an output's noise, relative to the output's range"""


# --- Unknowns as texts: names, ranges ``LOW..HIGH``, priors ``MEAN +- DEVIATION``

_OPEN = 1e-6  # of a range: distance of an end from zero if zero is not valid
_EXAMPLES = {"range": (0.5, 2.0), "prior": (1.0, 0.1)}  # of the usual magnitude
_STIMULUS, _OFFSET = "stimulus.", "offset."


def is_parameter(name: str) -> bool:
    """Return whether an unknown is a parameter of the bench, not an offset."""
    return not name.startswith((_STIMULUS, _OFFSET))


def unknowns_of(case: Case, known: ParameterSet, question: Question) -> tuple[Unknown, ...]:
    """Return the unknowns that all records share; `Question` describes the texts.

    Parameters
    ----------
    case
        Run of the bench: its parameters are the starts.
    known
        Parameters of the bench; those that the experiment sets differ from them.
    question
        Question of the user.

    Raises
    ------
    UnknownNameError
        For a name that is not a number of the bench, with the nearest names.
    ParameterError, UnitError
        When there are no unknowns, or a range or prior is not valid or empty.
    """
    if not question.ranges:
        raise ParameterError(
            f"there is no unknown. Add {option('unknowns')} PARAMETER for each unknown, for "
            f"example {option('unknowns')} {next(iter(leaf_fields(type(case.par))))}",
            name="unknowns",
        )
    for name in question.priors:
        if name not in question.ranges:
            raise unknown_name(f"unknown in {option('priors')}", name, question.ranges)
    leaves = leaf_fields(type(known))
    return tuple(
        _with_texts(
            _bare(name, case, known, question.noise),
            text,
            question.priors.get(name, ""),
            leaves.get(name),
        )
        for name, text in question.ranges.items()
    )


def _bare(name: str, case: Case, known: ParameterSet, outputs: Iterable[str]) -> Unknown:
    """Return an unknown without range and prior."""
    if name.startswith(_STIMULUS):
        stimuli = signals_of(case.model.Stimulus)
        driven = without_noise(stimuli)
        if name.removeprefix(_STIMULUS) not in driven:
            raise unknown_name("input", name, [f"{_STIMULUS}{k}" for k in driven])
        signal = stimuli[name.removeprefix(_STIMULUS)]
        return Unknown(name, 0.0, scale=signal.nominal, unit=signal.unit)
    if name.startswith(_OFFSET):
        if name.removeprefix(_OFFSET) not in outputs:
            raise unknown_name("output", name, [f"{_OFFSET}{k}" for k in outputs])
        signal = signals_of(case.model.Output)[name.removeprefix(_OFFSET)]
        return Unknown(name, 0.0, scale=signal.nominal, unit=signal.unit)
    if name.startswith("initial."):
        raise ParameterError(
            f"unknown {name} is not valid because each record has its own initial values. Use "
            f"{option('states')} {name.removeprefix('initial.')}",
            name=name,
        )
    given, leaves = known.flat().get(name), leaf_fields(type(known))
    if name not in leaves and given is not None:
        raise ParameterError(
            f"unknown {name} is not valid because it is a choice (here {quoted(given)}), not a "
            f"number. Try each value with {option('overrides', {name: '...'})}",
            name=name,
        )
    if isinstance(given, tuple):
        raise ParameterError(
            f"unknown {name} is not valid because bywire cannot estimate the nodes of a table. "
            "Choose a number",
            name=name,
        )
    if name not in leaves:
        raise unknown_name("parameter", name, [k for k in leaves if k in known.leaves()])
    if case.par.leaves()[name] != known.leaves()[name]:
        raise ParameterError(
            f"unknown {name} is not valid because the experiment sets it to "
            f"{shown(case.par.leaves()[name], leaves[name].unit.symbol)}. Choose another parameter",
            name=name,
        )
    return parameters_of(case.par, [name])[0]


def _with_texts(unknown: Unknown, within: str, prior: str, leaf: Leaf | None) -> Unknown:
    if prior:
        unknown = replace(unknown, prior=_prior(unknown, prior))
    if not within:
        return unknown
    low, high = _pair(unknown, within, within.split(".."), "range", "..")
    if not low < high:
        raise ParameterError(
            f"range of {unknown.name}: {quoted(within)} is empty. Write the lower bound first",
            name=f"range of {unknown.name}",
            value=quoted(within),
        )
    if leaf is not None and (low < leaf.low or high > leaf.high):
        raise not_valid(f"range of {unknown.name}", quoted(within), leaf.range_text)
    low = low if low > unknown.low or leaf is None or not leaf.low_open else max(low, _OPEN * high)
    # If the bench's value is outside, the search starts in the middle.
    start = unknown.start if low <= unknown.start <= high else 0.5 * (low + high)
    return replace(unknown, low=low, high=high, start=start)


def _prior(unknown: Unknown, text: str) -> tuple[float, float]:
    mean, deviation = _pair(unknown, text, BETWEEN.split(text), "prior", " +- ")
    if not deviation > 0.0:
        valid = "MEAN +- DEVIATION with a deviation > 0"
        raise not_valid(f"prior of {unknown.name}", quoted(text), valid)
    return mean, deviation


def _pair(
    unknown: Unknown, text: str, parts: Sequence[str], kind: str, sign: str
) -> tuple[float, float]:
    """Return two quantities; a unit after the second one alone applies to both."""
    low, high = _EXAMPLES[kind]
    if len(parts) != 2 or not all(part.strip() for part in parts):
        raise ParameterError(
            f"{kind} of {unknown.name}: {quoted(text)} is not valid. For example, use "
            f"'{shown(low * unknown.scale, unknown.unit)}{sign}"
            f"{shown(high * unknown.scale, _second_unit(unknown, kind))}'",
            name=f"{kind} of {unknown.name}",
            value=quoted(text),
        )
    first, second = (part.strip() for part in parts)
    unit = split(second)[1]
    if unit and not split(first)[1] and _second_unit(unknown, kind) == unknown.unit:
        first = f"{first} {unit}"
    what = f"{kind} of {unknown.name}"
    return (
        number(first, unknown.unit, what, unknown.scale),
        number(second, _second_unit(unknown, kind), what, unknown.scale),
    )


def _second_unit(unknown: Unknown, kind: str) -> str:
    """Return the SI unit of the second quantity: a deviation is a difference."""
    return difference_unit(unknown.unit) if kind == "prior" else unknown.unit


def starts_of(
    unknowns: Sequence[Unknown], ranges: Mapping[str, str], count: int, spread: float, seed: int
) -> tuple[Array, ...]:
    """Return starts: the unknowns' own, then others throughout the specified ranges.

    Parameters
    ----------
    ranges
        Texts by name; without a range, starts scatter around the first.
    count, spread, seed
        As for `scattered`.
    """
    first, *others = scattered(unknowns, count, spread, seed)
    given = [k for k, u in enumerate(unknowns) if ranges.get(u.name)]
    low, high = (np.array([getattr(unknowns[k], e) for k in given]) for e in ("low", "high"))
    random = np.random.default_rng([seed, 1])
    for start in others:
        start[given] = random.uniform(low, high)
    return (first, *others)


def switched_off(
    known: ParameterSet, unknowns: Iterable[Unknown], fitted: Mapping[str, str]
) -> dict[str, str]:
    """Return reasons why no output may depend on an unknown: name -> choices in the same group.

    Parameters
    ----------
    known
        Parameters of the bench.
    unknowns
        Unknowns of the search.
    fitted
        Choices that the fit sets: dotted name -> choice.
    """
    choices = {n: c for n, c in known.choices().items() if isinstance(c, str)}
    choices |= {name: c for name, c in fitted.items() if name in choices}
    silent = {}
    for unknown in unknowns:
        group = unknown.name.rpartition(".")[0]
        beside = [f"{n} = {c}" for n, c in choices.items() if n.rpartition(".")[0] == group]
        if beside:
            silent[unknown.name] = f"here {', '.join(beside)}"
    return silent
