"""The set of models that a design must serve: the nominal one, and what may come instead."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from bywire.analysis.design.loop_figures import LoopFigures
from bywire.analysis.linear_model import LinearModel
from bywire.analysis.loop import Loop
from bywire.core.errors import InputError, ParameterError, unknown_name
from bywire.core.interrupts import interrupts_deferred
from bywire.core.parameters import ParameterSet

NOMINAL = "nominal"
"""label of the model at the operating point itself"""
_MOST = 500


@dataclass(frozen=True)
class LinearCase:
    """One model of the set.

    Parameters
    ----------
    label
        What distinguishes it, for instance ``"wedge.mu_B = 0.2"``.
    build
        ``build(gains) -> (loop gain, closed loop)`` for gains by dotted name, both sampled alike.
    """

    label: str
    build: Callable[[Mapping[str, float]], tuple[LinearModel, LinearModel]]

    def figures(self, gains: Mapping[str, float], points: int = 400) -> LoopFigures:
        """Return the figures of the loop with some gains, see `LoopFigures`."""
        with interrupts_deferred():  # CasADi would swallow them
            return LoopFigures(*self.build(gains), points)


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
        if name in loop.tunables:
            raise ParameterError(f"{name} is what the design chooses: it cannot also be a range")
        if name != loop.at.name and name not in par.leaves():
            raise unknown_name("parameter", name, [loop.at.name, *par.leaves()])
    combinations = list(product(*over.values())) if over else []
    if len(combinations) > _MOST:
        raise ParameterError(
            f"the ranges have {len(combinations)} combinations: {_MOST} at most, take fewer values"
        )
    found = [_case(loop, NOMINAL, par, value)]
    for one in combinations:
        values = dict(zip(over, one, strict=True))
        label = ", ".join(f"{name} = {number:.6g}" for name, number in values.items())
        at = values.pop(loop.at.name, value)
        try:
            own = par.replace(values)
            loop.point(own, at)
        except InputError as error:
            raise ParameterError(f"{label}: {error}") from None
        found.append(_case(loop, label, own, at))
    return tuple(found)


def _case(loop: Loop, label: str, par: ParameterSet, value: float) -> LinearCase:
    def build(gains: Mapping[str, float]) -> tuple[LinearModel, LinearModel]:
        own = par.replace(gains)
        return loop.gain(own, value), loop.closed(own, value)

    return LinearCase(label, build)
