"""A requirement as a limit state: how far a case is from failing, over standard normal scores."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bywire.bench.requirements import Limit
from bywire.core.typing import Array
from bywire.data.file_format import library
from bywire.studies.sought_design import LIBRARY

BEYOND = -1e300
"""margin of a case without the figure: it fails, and is beyond every level"""
_LEAST = float(np.finfo(float).tiny)  # margin of a case that meets its limit exactly

Margins = Callable[[Array], Array]
"""margins of a batch of cases by their scores, shape (cases, quantities): a case fails at <= 0"""


class UnfinishedError(Exception):
    """Cases that are asked for are not there: the budget is spent, or they are not computed."""


class BudgetSpentError(UnfinishedError):
    """No more cases are admitted."""


def margins_of(values: Array, limit: Limit) -> Array:
    """Return how far each figure is from missing its limit, in its unit; it is missed at <= 0.

    A figure that is not defined is `BEYOND`: a finite number, for levels are ranked by it.

    Examples
    --------
    >>> limit = Limit("overshoot", "<=", 15.0, "%", "<= 15 %")
    >>> margins_of(np.array([14.0, 16.0, np.nan]), limit).tolist()
    [1.0, -1.0, -1e+300]
    """
    distance = limit.bound - values if limit.is_upper else values - limit.bound
    finite = np.clip(np.where(np.isnan(values), BEYOND, distance), BEYOND, -BEYOND)
    return np.asarray(
        np.where(limit.is_met(values), np.maximum(finite, _LEAST), np.minimum(finite, 0.0))
    )


@dataclass
class Trail:
    """The cases that a method asked for, in their order.

    Parameters
    ----------
    margins
        What gives their margins; see `Margins`.
    """

    margins: Margins
    _scores: list[Array] = field(default_factory=list)
    _values: list[Array] = field(default_factory=list)
    _stopped: list[BaseException] = field(default_factory=list)

    def __call__(self, scores: Any) -> Array:
        """Return the margins of a batch, and remember both."""
        z = np.array(scores, dtype=float)
        if self._stopped:
            raise self._stopped[0]
        try:
            values = self.margins(z)
        except BaseException as error:
            self._stopped.append(error)
            raise
        self._scores.append(z)
        self._values.append(values)
        return values

    @property
    def runs(self) -> int:
        """How many cases there were."""
        return sum(map(len, self._values))

    @property
    def nearest(self) -> tuple[int, Array] | None:
        """The most probable failing case, its place and scores; None where none failed."""
        if not self._values:
            return None
        scores, failed = np.vstack(self._scores), np.concatenate(self._values) <= 0.0
        if not failed.any():
            return None
        place = int(np.argmin(np.where(failed, (scores**2).sum(axis=1), np.inf)))
        return place, scores[place]

    @contextmanager
    def within_library(self, seed: int) -> Iterator[None]:
        """Have what stopped a batch raised as it was: the library wraps it in an error of its own.

        Its random numbers are one sequence of the process: whoever uses them too gets theirs back.
        """
        ot = library("openturns", *LIBRARY)
        state, shown = ot.RandomGenerator.GetState(), ot.Log.Flags()
        ot.Log.Show(ot.Log.NONE)
        # It takes 32 bits.
        ot.RandomGenerator.SetSeed(int(np.random.SeedSequence(seed).generate_state(1)[0]))
        try:
            yield
        except Exception:
            if self._stopped:
                raise self._stopped[0] from None
            raise
        finally:
            ot.RandomGenerator.SetState(state)
            ot.Log.Show(shown)


def failing_event(margins: Margins, quantities: int, step: float | None = None) -> Any:
    """Return the library's event of a margin <= 0 of standard normal scores.

    Parameters
    ----------
    margins
        Of a batch of cases.
    quantities
        How many scores a case has.
    step
        Of central differences for derivatives, in scores; None without any.
    """
    ot = library("openturns", *LIBRARY)

    def batch(scores: Any) -> Array:
        return margins(np.asarray(scores))[:, None]

    function = ot.Function(ot.PythonFunction(quantities, 1, func_sample=batch))
    if step is not None:
        function.setGradient(ot.CenteredFiniteDifferenceGradient(step, function.getEvaluation()))
    vector = ot.CompositeRandomVector(function, ot.RandomVector(ot.Normal(quantities)))
    return ot.ThresholdEvent(vector, ot.LessOrEqual(), 0.0)
