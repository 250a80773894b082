"""Whether a method can be trusted: what is put into simulated experiments has to come back.

Each experiment is made with a seed of its own, and identified from a start off the truth. Over
many of them the mean estimate has to hit the truth within its own scatter, and the 95 % intervals
have to hold it about 95 times in 100.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bywire.core.typing import Progress
from bywire.identification.method import Effort, Method
from bywire.identification.simulated_experiments import Outcome, experiments

_BIAS = 3.0  # standard errors of the mean
_COVERED = (0.90, 0.99)


@dataclass(frozen=True)
class Recovered:
    """How well one unknown comes back.

    Parameters
    ----------
    label, unit, truth
        What it is, its SI unit and the value put in.
    count
        Experiments that told it.
    bias
        Mean estimate less truth.
    bias_in_errors
        The same over the standard error of the mean.
    coverage, coverage_range
        Share of 95 % intervals that hold the truth, and the range of 95 % confidence in which the
        share of infinitely many lies (Clopper, Pearson 1934).
    scatter, claimed
        Standard deviation of the estimates, and the root mean square of those claimed.
    """

    label: str
    unit: str
    truth: float
    count: int
    bias: float
    bias_in_errors: float
    coverage: float
    coverage_range: tuple[float, float]
    scatter: float
    claimed: float

    @property
    def holds(self) -> bool:
        """Whether |bias| < 3 standard errors and the coverage can be 90 to 99 %."""
        low, high = self.coverage_range
        return abs(self.bias_in_errors) < _BIAS and low <= _COVERED[1] and high >= _COVERED[0]


@dataclass(frozen=True)
class Trust:
    """What many simulated experiments say of a method.

    Parameters
    ----------
    outcomes
        One per seed, in their order.
    recovered
        One per unknown.
    """

    outcomes: tuple[Outcome, ...]
    recovered: tuple[Recovered, ...]

    @property
    def failed(self) -> tuple[Outcome, ...]:
        """Experiments from which nothing was identified."""
        return tuple(o for o in self.outcomes if o.error)

    @property
    def holds(self) -> bool:
        """Whether every unknown comes back, from every experiment."""
        return bool(self.recovered) and not self.failed and all(r.holds for r in self.recovered)


def trust(
    method: Method,
    par: Any,
    options: Any,
    seeds: Iterable[int],
    effort: Effort | None = None,
    *,
    processes: int | None = 1,
    store: Path | None = None,
    progress: Progress | None = None,
) -> Trust:
    """Identify many simulated experiments.

    Parameters
    ----------
    method, par, options
        What is simulated and identified.
    seeds
        One experiment each.
    effort
        Of each search; ``spread`` is also how far off its first start is. One start by default.
    processes
        That many experiments at a time; None for all cores.
    store
        File that keeps every finished experiment; the same study goes on from there.
    progress
        Called with a label and the finished share.

    Raises
    ------
    KeyboardInterrupt
        When interrupted; finished experiments are in the store.
    """
    outcomes = experiments(
        method,
        par,
        options,
        seeds,
        effort or Effort(starts=1),
        processes=processes,
        store=store,
        progress=progress,
    )
    return Trust(outcomes, tuple(_recovered(method, par, options, outcomes)))


def put_in(method: Method, par: Any, options: Any) -> dict[str, float]:
    """Return the true values of a method's simulated measurements, SI, by label.

    Parameters
    ----------
    method
        Simulates with ``method.synthetic``.
    par, options
        Its parameters, None for a method of any assembly, and its options.

    Raises
    ------
    ParameterError
        When what is simulated has no true values of what the method estimates.
    """
    truth: dict[str, float] = {} if par is None else par.leaves()
    return truth if method.truth is None else {**truth, **method.truth(par, options)}


def _recovered(
    method: Method, par: Any, options: Any, outcomes: Sequence[Outcome]
) -> Iterator[Recovered]:
    from scipy import stats

    truth = put_in(method, par, options)
    for label in dict.fromkeys(label for o in outcomes for label in o.values if label in truth):
        telling = [o for o in outcomes if label in o.values]
        values = np.array([o.values[label] for o in telling])
        claimed = math.sqrt(float(np.mean([o.deviations[label] ** 2 for o in telling])))
        inside = sum(o.low[label] <= truth[label] <= o.high[label] for o in telling)
        scatter = float(values.std(ddof=1)) if len(telling) > 1 else math.nan
        error = (scatter if len(telling) > 1 else claimed) / math.sqrt(len(telling))
        bias = float(values.mean() - truth[label])
        ends = stats.binomtest(inside, len(telling)).proportion_ci(0.95)
        yield Recovered(
            label,
            telling[0].units[label],
            float(truth[label]),
            len(telling),
            bias,
            bias / error if error > 0.0 else math.copysign(math.inf, bias) if bias else 0.0,
            inside / len(telling),
            (float(ends.low), float(ends.high)),
            scatter,
            claimed,
        )
