"""The set of models that a design must serve: the nominal one, and what may come instead."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from bywire.analysis.crossings import DROP
from bywire.analysis.linear.corners import CornerError
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.loop import Loop
from bywire.analysis.loop_figures import LOOP_FIGURES, LoopFigures
from bywire.analysis.margins import NO_LOOP
from bywire.bench.requirements import Limit
from bywire.core.errors import InputError, ParameterError
from bywire.core.interrupts import interrupts_deferred
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.units import shown
from bywire.synthesis.requirement import share_left

NOMINAL = "nominal"
"""label of the model at the operating point itself"""
_MOST = 500


@dataclass(frozen=True)
class LinearCase:
    """One model of the set.

    Parameters
    ----------
    label
        What distinguishes it, for instance ``"motor.R_m = 0.2"``.
    build
        ``build(gains) -> (loop gain, closed loop)`` for gains by dotted name, both sampled alike.
    changes, at
        Parameters in which it differs from the nominal model, and its operating point [SI]; None
        for a model that is no loop of the bench, for instance an identified one.
    """

    label: str
    build: Callable[[Mapping[str, float]], tuple[LinearModel, LinearModel]]
    changes: Mapping[str, float] = field(default_factory=dict)
    at: float | None = None

    def figures(self, gains: Mapping[str, float], points: int = 400) -> LoopFigures:
        """Return the figures of the loop with some gains, see `LoopFigures`."""
        with interrupts_deferred():  # CasADi would swallow them
            return LoopFigures(*self.build(gains), points)


def state_of(figures: LoopFigures) -> str:
    """Return why a model has no figures of a loop; empty where it has."""
    if not figures.has_loop:
        return NO_LOOP
    return "" if figures.is_stable else "unstable"


def values_of(figures: LoopFigures) -> dict[str, float]:
    """Return every figure that can be required, by name; NaN where it is not defined."""
    if not figures.is_stable:
        return dict.fromkeys(LOOP_FIGURES, math.nan)
    return {name: float(getattr(figures, name)) for name in LOOP_FIGURES}


def room(figures: LoopFigures, requirement: Limit) -> float:
    """Return the distance of a figure from its limit, as a share of it."""
    return share_left(requirement, float(getattr(figures, requirement.figure)))


def slack(figures: LoopFigures, requirement: Limit) -> float:
    """Return how far a requirement is met, as a share of its limit: what a search climbs.

    For a bandwidth it is the room of the closed loop's magnitude above -3 dB up to the limit:
    the frequency itself jumps where a dip touches that level.
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
        When there is no such number.
    ParameterError
        When a tunable is among them, there are too many combinations, or one does not exist.
    """
    for name in over:
        require_given(loop, name)
        loop.require_number(par, name)
    combinations = list(product(*over.values())) if over else []
    if len(combinations) > _MOST:
        raise ParameterError(
            f"the ranges have {len(combinations)} combinations: {_MOST} at most, take fewer values"
        )
    cases = [case_of(loop, NOMINAL, par, {}, value)]
    for combination in combinations:
        values = dict(zip(over, combination, strict=True))
        label = ", ".join(_shown(loop, par, name, number) for name, number in values.items())
        at = values.pop(loop.at.name, value)
        cases.append(existing_case(loop, label, par, values, at))
    return tuple(cases)


def require_given(loop: Loop, name: str) -> None:
    """Refuse what the design chooses, of what varies."""
    if name in loop.tunables or _scheduled(loop, name):
        raise ParameterError(f"{name} is what the design chooses: it cannot also vary")


def _shown(loop: Loop, par: ParameterSet, name: str, value: float) -> str:
    """Return a value of a range as a user writes it."""
    known = leaf_fields(type(par))  # tables have their unit under the name of the table
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
        With its label, when it does not exist.
    """
    try:
        loop.point(par.replace(changes), at)
    except InputError as error:
        raise ParameterError(f"{label}: {error}") from None
    return case_of(loop, label, par, changes, at)


def case_of(
    loop: Loop, label: str, par: ParameterSet, changes: Mapping[str, Any], at: float
) -> LinearCase:
    """Return a model of a loop with other parameters, that exists."""
    base = par.replace(changes)

    def build(gains: Mapping[str, float]) -> tuple[LinearModel, LinearModel]:
        try:
            return loop.gain_and_closed(base.replace(gains), at)
        except CornerError as error:
            raise (error if label == NOMINAL else error.reworded(f"{label}: {error}")) from None

    return LinearCase(label, build, changes, at)
