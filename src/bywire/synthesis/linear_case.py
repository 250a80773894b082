"""Requirements on a loop, and the linear models for which a design must meet them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, product
from typing import Any

import numpy as np

from bywire.analysis.crossings import DROP
from bywire.analysis.linear.corners import CornerError
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.loop import Loop
from bywire.analysis.loop_figures import LOOP_FIGURES, LoopFigure, LoopFigures
from bywire.analysis.margins import NO_LOOP
from bywire.bench.requirements import Limit, parted, split_probability
from bywire.core import units
from bywire.core.errors import (
    InputError,
    ParameterError,
    UnitError,
    not_valid,
    quoted,
    unknown_name,
)
from bywire.core.interrupts import interrupts_deferred
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.units import shown

_ZERO = 1e-3
"""Value that is treated as zero if the limit is zero; all figures that can be zero are in %."""

STEADY = 0.05
"""Steady-state error that is treated as zero if zero is required [%], since converters round."""

_BY_WORD: Mapping[str, LoopFigure] = {
    **{figure.margin: figure for figure in LOOP_FIGURES.values() if figure.margin},
    **LOOP_FIGURES,
}
"""figures by their names in requirements, including the names in `bywire margins --json`"""


def share_left(limit: Limit, value: float) -> float:
    """Return the margin of a value to its limit, as a fraction of the limit; -inf for NaN."""
    bound = limit.bound or (STEADY if limit.figure == "steady_state_error" else _ZERO)
    share = (bound - value if limit.is_upper else value - bound) / bound
    return -math.inf if math.isnan(share) else share


def read(texts: Sequence[str], *, has_probabilities: bool = False) -> tuple[Limit, ...]:
    """Return requirements written as text.

    Parameters
    ----------
    texts
        Texts such as ``"bandwidth >= 10 Hz"``; the name of a figure may contain blanks and hyphens,
        or be a name from `bywire.margins`, such as ``phase``.
    has_probabilities
        Whether a requirement may end with a probability, such as ``with 99 %``.

    Raises
    ------
    UnknownNameError
        When a figure is unknown.
    ParameterError
        When a text cannot be read, every loop or no loop meets a limit, or two texts contradict
        each other.
    UnitError
        When a limit's unit has another dimension.
    """
    if not texts:
        raise ParameterError(
            "a design needs at least one requirement, for example 'bandwidth >= 10 Hz'",
            name="requirement",
            valid="'bandwidth >= 10 Hz'",
        )
    requirements = tuple(_read(text, has_probabilities) for text in texts)
    for first, second in combinations(requirements, 2):
        _require_compatible(first, second)
    return requirements


def _read(text: str, has_probability: bool) -> Limit:
    word, compare, written = parted(text) if isinstance(text, str) else ("", None, "")
    if not word or compare is None or not written:
        raise ParameterError(
            f"requirement {quoted(text)} is not valid. For example, use 'bandwidth >= 10 Hz'",
            name="requirement",
            value=text,
            valid="'bandwidth >= 10 Hz'",
        )
    word = re.sub(r"[ -]+", "_", word)
    if word not in _BY_WORD:
        raise unknown_name("figure of a loop", word, LOOP_FIGURES)
    figure, is_least = _BY_WORD[word], compare in (">=", ">")
    limit, probability = split_probability(
        figure.name,
        f"{compare} {written}",
        f"requirement {figure.name}",
        has_probability=has_probability,
    )
    written = limit.removeprefix(compare).strip()
    bound = _bound(written, figure)
    # Every loop, or no loop, meets a limit at the end of the possible range.
    possible = figure.low <= bound <= figure.high and not (is_least and bound >= figure.high)
    if not possible or not math.isfinite(bound) or (is_least and bound <= 0):
        low, high = figure.low, figure.high
        reach = f"above {low:g}" if high == math.inf else f"{low:g} to {high:g}"
        raise ParameterError(
            f"requirement {quoted(text)} is not valid, because {figure.name} is {reach} "
            f"{figure.unit} for every loop. Specify a value within this range",
            name=figure.name,
            value=text,
            valid=f"{reach} {figure.unit}",
        )
    return Limit(figure.name, compare, bound, figure.unit, f"{compare} {written}", probability)


def _bound(text: str, figure: LoopFigure) -> float:
    name = f"requirement {figure.name}"
    if figure.in_decibel and text.endswith("dB"):
        return float(10.0 ** (units.parse(text.removesuffix("dB").strip(), "1", name) / 20.0))
    if figure.unit == "%":
        if not text.endswith("%") and not re.fullmatch(r"0+\.?0*", text):
            raise not_valid(
                name, quoted(text), "a limit in percent such as '<= 15 %'", kind=UnitError
            )
        return 100.0 * units.parse(text, "1", name)
    if figure.unit == "deg":
        if re.fullmatch(r"[-+\d.eE]+", text):
            raise UnitError(
                f"{name} = {quoted(text)} has no unit. Use '{text} deg'",
                name=name,
                value=text,
                valid=f"{text} deg",
            )
        return math.degrees(units.parse(text.replace("°", "deg"), "rad", name))
    return units.parse(text, figure.unit, name)


def _require_compatible(first: Limit, second: Limit) -> None:
    if first.figure != second.figure:
        return
    if first.is_upper == second.is_upper:
        raise ParameterError(
            f"there are two requirements on {first.figure}, {str(first)!r} and {str(second)!r}. "
            "Remove one of them",
            name=first.figure,
        )
    low, high = (second, first) if first.is_upper else (first, second)
    if low.bound > high.bound:
        raise ParameterError(
            f"{str(low)!r} and {str(high)!r} contradict each other. Change one of the limits",
            name=low.figure,
        )


# --- Models

NOMINAL = "nominal"
"""label of the model at the operating point itself"""
_MOST = 500


@dataclass(frozen=True)
class LinearCase:
    """One model of the set.

    Parameters
    ----------
    label
        Label of the case, for example ``"motor.R_m = 0.2"``.
    build
        ``build(gains) -> (loop gain, closed loop)`` for gains by dotted name, with equal sample
        times.
    changes, at
        Differences of its parameters from the nominal model, and its operating point [SI]; None for
        a model that is not a loop of the bench, for example an identified one.
    draws
        For a randomly drawn model, the number of draws to which it belongs, including those for
        which no model exists; 0 for the nominal model and those of ranges.
    """

    label: str
    build: Callable[[Mapping[str, float]], tuple[LinearModel, LinearModel]]
    changes: Mapping[str, float] = field(default_factory=dict)
    at: float | None = None
    draws: int = 0

    def figures(self, gains: Mapping[str, float], points: int = 400) -> LoopFigures:
        """Return the figures of the loop with given gains; see `LoopFigures`."""
        with interrupts_deferred():  # CasADi would ignore them
            return LoopFigures(*self.build(gains), points)


def state_of(figures: LoopFigures) -> str:
    """Return the reason why a model has no loop figures; empty if it has them."""
    if not figures.has_loop:
        return NO_LOOP
    return "" if figures.is_stable else "unstable"


def values_of(figures: LoopFigures) -> dict[str, float]:
    """Return every figure that can be required, by name; NaN if not defined."""
    if not figures.is_stable:
        return dict.fromkeys(LOOP_FIGURES, math.nan)
    return {name: float(getattr(figures, name)) for name in LOOP_FIGURES}


def room(figures: LoopFigures, requirement: Limit) -> float:
    """Return the distance of a figure from its limit, as a fraction of the limit."""
    return share_left(requirement, float(getattr(figures, requirement.figure)))


def slack(figures: LoopFigures, requirement: Limit) -> float:
    """Return the slack of a requirement, as a fraction of its limit: the objective of the search.

    For a bandwidth, it is the margin of the closed loop's magnitude above -3 dB up to the limit,
    because the frequency itself jumps when a dip touches this level.
    """
    if requirement.figure != "bandwidth" or requirement.is_upper:
        return room(figures, requirement)
    if not figures.answers:
        return -math.inf
    below = figures.T[figures.frequencies < requirement.bound]
    at = figures.closed.response(np.array([requirement.bound]))[:, 0, 0]
    size = float(np.min(np.abs(np.append(below, at))))
    return size / (DROP * figures.rest) - 1.0


def cases_of(
    loop: Loop, par: ParameterSet, value: float, over: Mapping[str, Sequence[float]]
) -> tuple[LinearCase, ...]:
    """Return the nominal model of a loop and those of every combination of ranges.

    Parameters
    ----------
    loop, par, value
        Loop, parameters and operating point.
    over
        Dotted name of a parameter, or of the loop's operating quantity -> its values [SI].

    Raises
    ------
    UnknownNameError
        When the parameter is unknown.
    ParameterError
        When a tunable is varied, there are too many combinations, or a model does not exist.
    """
    for name in over:
        require_given(loop, name)
        loop.require_number(par, name)
    combinations = list(product(*over.values())) if over else []
    if len(combinations) > _MOST:
        raise ParameterError(
            f"the ranges have {len(combinations)} combinations, but the number must be <= {_MOST}. "
            "Use fewer values",
            name="ranges",
            value=str(len(combinations)),
            valid=f"<= {_MOST}",
        )
    cases = [case_of(loop, NOMINAL, par, {}, value)]
    for combination in combinations:
        values = dict(zip(over, combination, strict=True))
        label = ", ".join(_shown(loop, par, name, number) for name, number in values.items())
        at = values.pop(loop.at.name, value)
        cases.append(existing_case(loop, label, par, values, at))
    return tuple(cases)


def require_given(loop: Loop, name: str) -> None:
    """Reject a varied parameter that the design chooses."""
    if name in loop.tunables or _scheduled(loop, name):
        raise ParameterError(f"{name} cannot vary because the design chooses it", name=name)


def _shown(loop: Loop, par: ParameterSet, name: str, value: float) -> str:
    """Return a value of a range in the user's units."""
    known = leaf_fields(type(par))  # a table's name has the unit of its nodes
    leaf = known.get(name) or known.get(name.rpartition(".")[0])
    unit = loop.at.unit if leaf is None else leaf.unit.symbol
    return f"{name} = {shown(value, unit)}"


def _scheduled(loop: Loop, name: str) -> bool:
    regions = loop.schedule.regions.values() if loop.schedule is not None else ()
    return any(name in region for region in regions)


def existing_case(
    loop: Loop, label: str, par: ParameterSet, changes: Mapping[str, Any], at: float
) -> LinearCase:
    """Return a model of a loop with other parameters.

    Raises
    ------
    ParameterError
        When the model does not exist, with its label.
    """
    try:
        loop.point(par.replace(changes), at)
    except InputError as error:
        raise error.reworded(f"{label}: {error}") from None
    return case_of(loop, label, par, changes, at)


def case_of(
    loop: Loop, label: str, par: ParameterSet, changes: Mapping[str, Any], at: float
) -> LinearCase:
    """Return a model of a loop with other parameters, which must exist."""
    base = par.replace(changes)

    def build(gains: Mapping[str, float]) -> tuple[LinearModel, LinearModel]:
        try:
            return loop.gain_and_closed(base.replace(gains), at)
        except CornerError as error:
            raise (error if label == NOMINAL else error.reworded(f"{label}: {error}")) from None

    return LinearCase(label, build, changes, at)
