"""How a quantity varies: laws by closed forms, as SciPy's, and single values.

``scipy.stats`` takes as long to load as all else of a study, and every process of one would.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import special

from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.typing import Array


class Law(Protocol):
    """A law of probability over the real numbers."""

    def support(self) -> tuple[float, float]:
        """Return its ends."""
        ...

    def ppf(self, q: Array) -> Array:
        """Return the values below which such shares lie, of shares in (0, 1)."""
        ...

    def cdf(self, x: float) -> float:
        """Return the probability of what lies below a value."""
        ...

    def sf(self, x: float) -> float:
        """Return the probability of what lies above a value."""
        ...


@dataclass(frozen=True)
class Uniform:
    """Evenly from ``low`` on, over a width."""

    low: float
    width: float

    def support(self) -> tuple[float, float]:
        """Return its ends."""
        return self.low, self.width + self.low

    def ppf(self, q: Array) -> Array:
        """Return quantiles."""
        return q * self.width + self.low

    def cdf(self, x: float) -> float:
        """Return the probability below."""
        return min(max((x - self.low) / self.width, 0.0), 1.0)

    def sf(self, x: float) -> float:
        """Return the probability above."""
        return 1.0 - self.cdf(x)


@dataclass(frozen=True)
class Normal:
    """The normal one, by mean and standard deviation."""

    mean: float
    sd: float

    def support(self) -> tuple[float, float]:
        """Return its ends: none."""
        return -math.inf, math.inf

    def ppf(self, q: Array) -> Array:
        """Return quantiles."""
        return np.asarray(normal_quantile(q) * self.sd + self.mean)

    def cdf(self, x: float) -> float:
        """Return the probability below."""
        return float(special.ndtr((x - self.mean) / self.sd))

    def sf(self, x: float) -> float:
        """Return the probability above."""
        return float(special.ndtr((self.mean - x) / self.sd))


@dataclass(frozen=True)
class LogNormal:
    """Of which the logarithm is normal, with standard deviation ``sigma`` around the median's."""

    sigma: float
    median: float

    def support(self) -> tuple[float, float]:
        """Return its ends."""
        return 0.0, math.inf

    def ppf(self, q: Array) -> Array:
        """Return quantiles."""
        return np.asarray(np.exp(self.sigma * normal_quantile(q)) * self.median)

    def cdf(self, x: float) -> float:
        """Return the probability below."""
        return float(special.ndtr(self._score(x)))

    def sf(self, x: float) -> float:
        """Return the probability above."""
        return float(special.ndtr(-self._score(x)))

    def _score(self, x: float) -> float:
        share = x / self.median
        return math.log(share) / self.sigma if share > 0.0 else -math.inf


@dataclass(frozen=True)
class Triangular:
    """Rising to a mode and falling from it; the mode as a share of the width."""

    mode: float
    low: float
    width: float

    def support(self) -> tuple[float, float]:
        """Return its ends."""
        return self.low, self.width + self.low

    def ppf(self, q: Array) -> Array:
        """Return quantiles."""
        c = self.mode
        shares = np.where(q < c, np.sqrt(c * q), 1 - np.sqrt((1 - c) * (1 - q)))
        return np.asarray(shares * self.width + self.low)

    def cdf(self, x: float) -> float:
        """Return the probability below."""
        at, c = min(max((x - self.low) / self.width, 0.0), 1.0), self.mode
        return at * at / c if at < c else 1.0 - (1.0 - at) ** 2 / (1.0 - c) if c < 1.0 else at * at

    def sf(self, x: float) -> float:
        """Return the probability above."""
        return 1.0 - self.cdf(x)


def truncated_normal(low: float, high: float, mean: float, sd: float) -> Law:
    """Return the normal law of what lies between two scores; SciPy's, for its tails' digits."""
    from scipy import stats

    law: Law = stats.truncnorm(low, high, mean, sd)
    return law


def normal_quantile(share: Any) -> Any:
    """Return the standard normal score below which a share lies."""
    return special.ndtri(share)


def binomial_ranks(count: int, probability: float, beyond: float) -> tuple[int, int]:
    """Return the ends of how often something comes, with a share beyond either of them.

    Parameters
    ----------
    count, probability
        Trials, and how probable it is in each.
    beyond
        Share, above 0 and below 1/2.

    Returns
    -------
    tuple
        The least number that no more come with at least this probability, and the least one that
        more come with at most this probability.
    """
    low = _least(lambda k: special.bdtr(k, count, probability) >= beyond, count)
    high = _least(lambda k: special.bdtrc(k, count, probability) <= beyond, count)
    return low, high


def _least(is_enough: Any, count: int) -> int:
    """Return the least number for which something holds that holds for all above it."""
    below, above = -1, count
    while above - below > 1:
        middle = (below + above) // 2
        below, above = (below, middle) if is_enough(middle) else (middle, above)
    return above


def ranked(values: Array) -> Array:
    """Return the ranks of values from 1 on, that of equal ones their mean."""
    _, place, times = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(times)
    return np.asarray((last - 0.5 * (times - 1))[place])


# --- Distributions
# A range or a tolerance is a distribution as any other; a grid and a worst-case search use its
# ends.

NEVER = 1e-9
"""probability that counts as none: of values that the model would not admit"""
TAIL = 0.5 * math.erfc(3.0 / math.sqrt(2.0))
"""probability beyond 3 standard deviations, at which a grid ends where a distribution does not"""


@dataclass(frozen=True)
class Distribution:
    """How a quantity varies.

    Parameters
    ----------
    kind
        What the study file calls it.
    text
        What it is, for instance ``"normal, mean 0.39 ohm, sd 0.02 ohm"``.
    quantile
        ``quantile(u) -> values`` [SI], of probabilities in (0, 1), shape (n,) each; of choices,
        an array of texts.
    low, high
        Ends [SI]; infinite where there is none, NaN of choices.
    below, above
        ``below(x)``, ``above(x)``: probability of values below and above; None of single values,
        which end at ``low`` and ``high``.
    singles
        Single values that it has [SI], or texts, in the order in which probabilities go through
        them; none of what has any value.
    weights
        Probability of each of them.
    """

    kind: str
    text: str
    quantile: Callable[[Array], NDArray[Any]]
    low: float = math.nan
    high: float = math.nan
    below: Callable[[float], float] | None = None
    above: Callable[[float], float] | None = None
    singles: tuple[Any, ...] = ()
    weights: tuple[float, ...] = ()

    @property
    def is_discrete(self) -> bool:
        """Whether it has single values."""
        return bool(self.singles)

    def levels(self, count: int) -> NDArray[Any]:
        """Return values for a grid: evenly from end to end; those of single values as they are.

        Where it has no end, the grid ends 3 standard deviations from the middle of a normal one:
        at a probability of 0.135 % beyond.
        """
        if self.is_discrete:
            return np.array(self.singles)
        near = self.quantile(np.array([TAIL, 1.0 - TAIL])).tolist()
        low = self.low if math.isfinite(self.low) else float(near[0])
        high = self.high if math.isfinite(self.high) else float(near[1])
        return np.asarray(np.linspace(low, high, count))

    def between(self, places: Array) -> NDArray[Any]:
        """Return values by their places between the ends of `levels`, 0 to 1."""
        ends = self.levels(2)
        if self.is_discrete:
            return np.asarray(ends[np.minimum((places * ends.size).astype(int), ends.size - 1)])
        return np.asarray(ends[0] + places * (ends[1] - ends[0]))


# --- Single values: structural choices, and numbers of the kind ``discrete``

DISCRETE = "discrete"
"""the kind of single values, which choices need not name"""
KEYS = ("values", "weights")
"""keys of a section of single values"""


def read_choice(name: str, entry: Any, admitted: Sequence[Any]) -> Distribution:
    """Return how a choice varies: among values, each with a weight.

    Parameters
    ----------
    name
        Dotted name of a structural choice, or ``options.NAME`` of the experiment's.
    entry
        What the study file says.
    admitted
        What the choice may be, texts or truth values; empty where any text will do.

    Returns
    -------
    Distribution
        Its values are texts, see `choice_text`.

    Raises
    ------
    InputError
        For what is no list of choices, for a value alone, and one that stands there twice.
    """
    texts = list(map(choice_text, admitted))
    values = entry.get("values") if isinstance(entry, Mapping) else None
    if not isinstance(values, Sequence) or isinstance(values, str) or not values:
        raise ParameterError(
            f"[vary] {name} = {quoted(entry)}: a choice varies among values, "
            f"{{ kind = '{DISCRETE}', values = [...] }}"
            + (f", of {', '.join(map(repr, texts))}" if texts else "")
        )
    for key in entry.keys() - {*KEYS, "kind", "together"}:
        raise unknown_name(f"key of [vary] {name} (a choice)", key, (*KEYS, "kind"))
    if entry.get("kind", DISCRETE) != DISCRETE:
        raise ParameterError(
            f"[vary] {name} is a choice: its kind is '{DISCRETE}', not {quoted(entry['kind'])}"
        )
    given = list(map(choice_text, values))
    for text in given:
        if texts and text not in texts:
            raise unknown_name(f"value of {name}", text, texts)
    weights = weights_of(f"[vary] {name}", entry, len(given))
    require_several(f"[vary] {name}", given, given)
    return among(given, weights, ", ".join(given))


def choice_text(value: Any) -> str:
    """Return a choice as the cases of a study hold it.

    Examples
    --------
    >>> choice_text("ideal"), choice_text(True)
    ('ideal', 'true')
    """
    return value if isinstance(value, str) else quoted(value)


def require_several(where: str, values: Sequence[Any], shown: Sequence[str]) -> None:
    """Refuse single values that are one alone, or of which one stands there twice.

    Parameters
    ----------
    where
        What errors call it, for instance ``"[vary] motor.R_m"``.
    values, shown
        Its values, and how errors show them.

    Raises
    ------
    ParameterError
        Naming it.
    """
    if len(values) == 1:
        raise ParameterError(
            f"{where} has one value alone, {shown[0]}: nothing varies; name two at least, or "
            "give it this value in [set]"
        )
    for value, text in zip(values, shown, strict=True):
        if values.count(value) > 1:
            raise ParameterError(
                f"{where}: the value {text} stands there twice: name it once; weights = "
                "[...] say how often each comes"
            )


def among(values: list[Any], weights: Array, text: str) -> Distribution:
    """Return the distribution of single values.

    Parameters
    ----------
    values
        Numbers [SI], or texts.
    weights
        Their probabilities, shape (values,).
    text
        The values as they are shown.
    """
    each, edges = np.array(values), np.cumsum(weights)[:-1]
    alike = np.allclose(weights, weights[0])
    shares = "" if alike else f", with {', '.join(f'{100.0 * w:.3g} %' for w in weights)}"
    return Distribution(
        DISCRETE,
        f"one of {text}{shares}",
        partial(_picked, each, edges),
        singles=tuple(values),
        weights=tuple(weights.tolist()),
    )


def rising(made: Distribution) -> Distribution:
    """Return the distribution of single numbers whose quantiles rise, as those of any number.

    A file lists them in any order, in which probabilities go through them: what they are correlated
    with would fall with them, or neither.
    """
    order = np.argsort(np.array(made.singles))
    values = [made.singles[k] for k in order]
    ordered = among(values, np.array(made.weights)[order], "")
    return replace(
        made, quantile=ordered.quantile, singles=ordered.singles, weights=ordered.weights
    )


def _picked(values: NDArray[Any], edges: Array, u: Array) -> NDArray[Any]:
    return values[np.searchsorted(edges, u, side="right")]


def weights_of(where: str, section: Mapping[str, Any], count: int) -> Array:
    """Return the probabilities of single values, shape (count,), alike by default.

    Raises
    ------
    ParameterError
        For what is no list of so many numbers > 0.
    """
    given = section.get("weights", [1.0] * count)
    is_listed = isinstance(given, list) and all(type(each) in (int, float) for each in given)
    weights = np.array(given if is_listed else [], dtype=float)
    if weights.shape != (count,) or not (weights > 0).all() or not np.isfinite(weights).all():
        raise ParameterError(
            f"{where}.weights = {quoted(given)}: {count} numbers > 0 are wanted, one a value"
        )
    shares = weights / weights.max()  # whose sum is finite
    return np.asarray(shares / shares.sum())
