"""Unknowns as users write them: names, ranges ``LOW..HIGH``, priors ``MEAN +- DEVIATION``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bywire.bench.experiment import Case
from bywire.core.callers import option
from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.leaf import Leaf
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import signals_of, without_noise
from bywire.core.typing import Array
from bywire.core.units import difference_unit, shown, split
from bywire.core.values import number
from bywire.identification.fitting.question import BETWEEN, Question
from bywire.identification.unknown import Unknown, parameters_of, scattered

_OPEN = 1e-6  # of a range: how near an end comes to zero that is not admissible
_EXAMPLES = {"range": (0.5, 2.0), "prior": (1.0, 0.1)}  # of the usual magnitude
_STIMULUS, _OFFSET = "stimulus.", "offset."


def is_parameter(name: str) -> bool:
    """Return whether an unknown is a parameter of the bench, and no offset."""
    return not name.startswith((_STIMULUS, _OFFSET))


def unknowns_of(case: Case, known: ParameterSet, question: Question) -> tuple[Unknown, ...]:
    """Return what all records share; see `Question` for how it is written.

    Parameters
    ----------
    case
        Run of the bench: its parameters are the starts.
    known
        Parameters of the bench; what the experiment sets itself differs from them.
    question
        What is asked for.

    Raises
    ------
    UnknownNameError
        For a name that is no number of the bench, with the nearest.
    ParameterError, UnitError
        When nothing is asked for; for ranges and priors that cannot be read or are empty.
    """
    if not question.ranges:
        raise ParameterError(
            f"nothing is unknown: give {option('unknowns')} PARAMETER, once for each, for instance "
            f"{option('unknowns')} {next(iter(leaf_fields(type(case.par))))}"
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
            f"unknown {name}: initial values are each record's own; write "
            f"{option('states')} {name.removeprefix('initial.')}"
        )
    given, leaves = known.flat().get(name), leaf_fields(type(known))
    if name not in leaves and given is not None:
        raise ParameterError(
            f"unknown {name}: it is a choice, here {quoted(given)}, and no number; try each with "
            f"{option('overrides', {name: '...'})}"
        )
    if isinstance(given, tuple):
        raise ParameterError(
            f"unknown {name}: it is a table, of which no node can be estimated; name a number"
        )
    if name not in leaves:
        raise unknown_name("parameter", name, [k for k in leaves if k in known.leaves()])
    if case.par.leaves()[name] != known.leaves()[name]:
        raise ParameterError(
            f"unknown {name}: the experiment itself sets it, to "
            f"{shown(case.par.leaves()[name], leaves[name].unit.symbol)}; name another one"
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
            f"range of {unknown.name}: {quoted(within)} is empty; the lower end comes first"
        )
    if leaf is not None and (low < leaf.low or high > leaf.high):
        raise ParameterError(
            f"range of {unknown.name}: {quoted(within)} is not admissible: {unknown.name} must be "
            f"{leaf.range_text}"
        )
    low = low if low > unknown.low or leaf is None or not leaf.low_open else max(low, _OPEN * high)
    # Where the bench's own value lies outside, the search begins in the middle.
    start = unknown.start if low <= unknown.start <= high else 0.5 * (low + high)
    return replace(unknown, low=low, high=high, start=start)


def _prior(unknown: Unknown, text: str) -> tuple[float, float]:
    mean, deviation = _pair(unknown, text, BETWEEN.split(text), "prior", " +- ")
    if not deviation > 0.0:
        raise ParameterError(f"prior of {unknown.name}: {quoted(text)} wants a deviation > 0")
    return mean, deviation


def _pair(
    unknown: Unknown, text: str, parts: Sequence[str], kind: str, sign: str
) -> tuple[float, float]:
    """Return two quantities; a unit that only the second one has counts for both."""
    low, high = _EXAMPLES[kind]
    if len(parts) != 2 or not all(part.strip() for part in parts):
        raise ParameterError(
            f"{kind} of {unknown.name}: {quoted(text)} cannot be read; write for instance "
            f"'{shown(low * unknown.scale, unknown.unit)}{sign}"
            f"{shown(high * unknown.scale, _second_unit(unknown, kind))}'"
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
    """Return starts: the unknowns' own, then others, all over a range that was given.

    Parameters
    ----------
    ranges
        Texts by name; without one, starts scatter around the own one.
    count, spread, seed
        As of `scattered`.
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
    """Return why nothing may depend on an unknown: name -> choices that stand beside it.

    Parameters
    ----------
    known
        Parameters of the bench.
    unknowns
        What is searched.
    fitted
        Choices that the fit makes itself: dotted name -> choice.
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
