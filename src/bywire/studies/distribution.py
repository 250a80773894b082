"""Distributions of quantities: laws in closed form, discrete values, and their form in files.

``scipy.stats`` takes as long to load as the rest of a study, in each of its processes. Even
``scipy.special`` takes a tenth of a run's time, and runs load this module without a distribution.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bywire.bench.changes import refuse_share_of_temperature, share_of
from bywire.core.errors import ParameterError, not_valid, quoted, unknown_name
from bywire.core.parameters import Leaf
from bywire.core.quantities import Unit, display_unit
from bywire.core.typing import Array
from bywire.core.units import difference_unit, parse, shown
from bywire.core.values import written


class Law(Protocol):
    """Probability distribution over the real numbers."""

    def support(self) -> tuple[float, float]:
        """Return its ends."""
        ...

    def ppf(self, q: Array) -> Array:
        """Return the quantiles at probabilities in (0, 1)."""
        ...

    def cdf(self, x: float) -> float:
        """Return the probability below a value."""
        ...

    def sf(self, x: float) -> float:
        """Return the probability above a value."""
        ...


@dataclass(frozen=True)
class Uniform:
    """Uniform distribution from ``low`` over a width."""

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
    """Normal distribution, by mean and standard deviation."""

    mean: float
    sd: float

    def support(self) -> tuple[float, float]:
        """Return its ends, which are infinite."""
        return -math.inf, math.inf

    def ppf(self, q: Array) -> Array:
        """Return quantiles."""
        return np.asarray(normal_quantile(q) * self.sd + self.mean)

    def cdf(self, x: float) -> float:
        """Return the probability below."""
        from scipy import special

        return float(special.ndtr((x - self.mean) / self.sd))

    def sf(self, x: float) -> float:
        """Return the probability above."""
        from scipy import special

        return float(special.ndtr((self.mean - x) / self.sd))


@dataclass(frozen=True)
class LogNormal:
    """Log-normal distribution; ``sigma``: standard deviation of the logarithm."""

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
        from scipy import special

        return float(special.ndtr(self._score(x)))

    def sf(self, x: float) -> float:
        """Return the probability above."""
        from scipy import special

        return float(special.ndtr(-self._score(x)))

    def _score(self, x: float) -> float:
        share = x / self.median
        return math.log(share) / self.sigma if share > 0.0 else -math.inf


@dataclass(frozen=True)
class Triangular:
    """Triangular distribution; ``mode``: its position as a fraction of the width."""

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
    """Return the normal distribution truncated to two scores, from SciPy for accurate tails."""
    from scipy import stats

    law: Law = stats.truncnorm(low, high, mean, sd)
    return law


def normal_quantile(share: Any) -> Any:
    """Return the standard normal score of a cumulative probability."""
    from scipy import special

    return special.ndtri(share)


def binomial_ranks(count: int, probability: float, beyond: float) -> tuple[int, int]:
    """Return the bounds of a binomial count with a given probability beyond each bound.

    Parameters
    ----------
    count, probability
        Number of trials, and the probability in each.
    beyond
        Probability, above 0 and below 1/2.

    Returns
    -------
    tuple
        The smallest count that is not exceeded with at least this probability, and the smallest
        count that is exceeded with at most this probability.
    """
    from scipy import special

    low = _least(lambda k: special.bdtr(k, count, probability) >= beyond, count)
    high = _least(lambda k: special.bdtrc(k, count, probability) <= beyond, count)
    return low, high


def _least(is_enough: Any, count: int) -> int:
    """Return the smallest number that meets a monotonic condition."""
    below, above = -1, count
    while above - below > 1:
        middle = (below + above) // 2
        below, above = (below, middle) if is_enough(middle) else (middle, above)
    return above


def ranked(values: Array) -> Array:
    """Return the ranks of values, starting at 1; equal values get their mean rank."""
    _, place, times = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(times)
    return np.asarray((last - 0.5 * (times - 1))[place])


# --- Distributions
# Ranges and tolerances are also distributions; a grid and a worst-case search use their ends.

NEVER = 1e-9
"""probability of invalid values that is treated as zero"""
TAIL = 0.5 * math.erfc(3.0 / math.sqrt(2.0))
"""probability beyond 3 standard deviations, where a grid ends for an unbounded distribution"""


@dataclass(frozen=True)
class Distribution:
    """Distribution of a quantity.

    Parameters
    ----------
    kind
        Name of its kind in a study file.
    text
        Description, for example ``"normal, mean 0.39 ohm, sd 0.02 ohm"``.
    quantile
        ``quantile(u) -> values`` [SI], for probabilities in (0, 1), shape (n,) each; for choices,
        an array of texts.
    low, high
        Ends [SI]; infinite if it has none, NaN for choices.
    below, above
        ``below(x)``, ``above(x)``: probability below and above a value; None for discrete values,
        which end at ``low`` and ``high``.
    singles
        Discrete values [SI], or texts, in the order of their quantiles; empty for continuous
        distributions.
    weights
        Probability of each discrete value.
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
        """Whether it is discrete."""
        return bool(self.singles)

    def levels(self, count: int) -> NDArray[Any]:
        """Return values for a grid: evenly spaced from end to end, or the discrete values.

        Without an end, the grid ends at a probability of 0.135 % beyond, which for a normal
        distribution is 3 standard deviations from the middle.
        """
        if self.is_discrete:
            return np.array(self.singles)
        near = self.quantile(np.array([TAIL, 1.0 - TAIL])).tolist()
        low = self.low if math.isfinite(self.low) else float(near[0])
        high = self.high if math.isfinite(self.high) else float(near[1])
        return np.asarray(np.linspace(low, high, count))

    def between(self, places: Array) -> NDArray[Any]:
        """Return values at positions between the ends of `levels`, 0 to 1."""
        ends = self.levels(2)
        if self.is_discrete:
            return np.asarray(ends[np.minimum((places * ends.size).astype(int), ends.size - 1)])
        return np.asarray(ends[0] + places * (ends[1] - ends[0]))


# --- Single values: structural choices, and numbers of the kind ``discrete``

DISCRETE = "discrete"
"""kind of discrete values; choices may omit it"""
KEYS = ("values", "weights")
"""keys of a section of discrete values"""


def read_choice(name: str, entry: Any, admitted: Sequence[Any]) -> Distribution:
    """Return the distribution of a choice: its values with their weights.

    Parameters
    ----------
    name
        Dotted name of a structural choice, or ``options.NAME`` of an option of the experiment.
    entry
        Entry of the study file.
    admitted
        Valid values of the choice, texts or truth values; empty if any text is valid.

    Returns
    -------
    Distribution
        Distribution of texts; see `choice_text`.

    Raises
    ------
    InputError
        For an invalid list of choices, a single value, and a value that is listed twice.
    """
    texts = list(map(choice_text, admitted))
    values = entry.get("values") if isinstance(entry, Mapping) else None
    if not isinstance(values, Sequence) or isinstance(values, str) or not values:
        raise ParameterError(
            f"[vary] {name} = {quoted(entry)} is not valid for a choice. Write "
            f"{{ kind = '{DISCRETE}', values = [...] }}"
            + (f" with values from {', '.join(map(repr, texts))}" if texts else ""),
            name=f"[vary] {name}",
            value=quoted(entry),
            valid=", ".join(map(repr, texts)),
        )
    for key in entry.keys() - {*KEYS, "kind", "together"}:
        raise unknown_name(f"key of [vary] {name} (a choice)", key, (*KEYS, "kind"))
    if entry.get("kind", DISCRETE) != DISCRETE:
        raise ParameterError(
            f"[vary] {name} is a choice, so its kind must be '{DISCRETE}', not "
            f"{quoted(entry['kind'])}",
            name=f"[vary] {name}",
            value=quoted(entry["kind"]),
            valid=f"'{DISCRETE}'",
        )
    given = list(map(choice_text, values))
    for text in given:
        if texts and text not in texts:
            raise unknown_name(f"value of {name}", text, texts)
    weights = weights_of(f"[vary] {name}", entry, len(given))
    require_several(f"[vary] {name}", given, given)
    return among(given, weights, ", ".join(given))


def choice_text(value: Any) -> str:
    """Return a choice in the form of a study's cases.

    Examples
    --------
    >>> choice_text("ideal"), choice_text(True)
    ('ideal', 'true')
    """
    return value if isinstance(value, str) else quoted(value)


def require_several(where: str, values: Sequence[Any], shown: Sequence[str]) -> None:
    """Require at least two different discrete values.

    Parameters
    ----------
    where
        Name of the entry in errors, for example ``"[vary] motor.R_m"``.
    values, shown
        Its values, and their texts in errors.

    Raises
    ------
    ParameterError
        For a single value, or a value that is listed twice, with the name of the entry.
    """
    if len(values) == 1:
        raise ParameterError(
            f"{where} has only one value, {shown[0]}, so nothing varies. List at least two values, "
            "or set this value in [set]",
            name=where,
            value=shown[0],
        )
    for value, text in zip(values, shown, strict=True):
        if values.count(value) > 1:
            raise ParameterError(
                f"{where} lists the value {text} twice. List it once, and specify frequencies with "
                "weights = [...]",
                name=where,
                value=text,
            )


def among(values: list[Any], weights: Array, text: str) -> Distribution:
    """Return the distribution of discrete values.

    Parameters
    ----------
    values
        Numbers [SI], or texts.
    weights
        Their probabilities, shape (values,).
    text
        Text that lists the values.
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
    """Return the distribution of discrete numbers, with rising quantiles.

    A file may list them in any order. Without sorting, a positive correlation with another quantity
    could become a negative one.
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
    """Return the probabilities of discrete values, shape (count,); equal by default.

    Raises
    ------
    ParameterError
        For an invalid list of ``count`` numbers > 0.
    """
    given = section.get("weights", [1.0] * count)
    is_listed = isinstance(given, list) and all(type(each) in (int, float) for each in given)
    weights = np.array(given if is_listed else [], dtype=float)
    if weights.shape != (count,) or not (weights > 0).all() or not np.isfinite(weights).all():
        raise not_valid(f"{where}.weights", quoted(given), f"{count} numbers > 0, one per value")
    shares = weights / weights.max()  # with a finite sum
    return np.asarray(shares / shares.sum())


# --- Distributions in study files: a tolerance, or a section with ``kind``

_NEXT = {
    "tolerance": "Use a narrower tolerance, or kind 'uniform' with bounds within this range",
    "uniform": "Choose 'low' and 'high' within this range",
    "normal": "Truncate the distribution with 'low' or 'high' within this range",
    "log-normal": "Use another 'median' or a smaller 'sd'",
    "triangular": "Choose 'low', 'mode' and 'high' within this range",
}
"""advice, by the kind of a distribution"""
_ROUNDING = 1e-12  # fraction of a range by which rounding may move an end beyond a limit


def admitted(where: str, made: Distribution, leaf: Leaf, advice: str = "") -> Distribution:
    """Return a distribution that stays within the valid range of its number.

    An end that misses a limit only by rounding is moved to it. A distribution that is truncated at
    an open limit (``> 0``) is treated as unbounded there, so that designs that visit the ends stay
    within the limit.

    Parameters
    ----------
    where
        Name of the entry in errors, for example ``"[vary] motor.R_m"``.
    made, leaf
        Its distribution, and the declaration of the number.
    advice
        Advice for a distribution that leaves the range; by default that of its kind.

    Raises
    ------
    ParameterError
        When it leaves the range, with the range and the probability beyond it or the invalid end.
    """
    if made.singles:
        _require_singles(where, made.singles, leaf)
        return made
    assert made.below is not None
    assert made.above is not None
    valid, advice = leaf.range_text, advice or _NEXT[made.kind]
    beyond = made.below(leaf.low) + made.above(leaf.high)
    if beyond > NEVER:
        often = f", with a probability of {beyond:.2g}" if beyond < 1.0 else ""
        raise ParameterError(
            f"{where}: {made.text} leaves the valid range, {valid}{often}. {advice}",
            name=where,
            value=made.text,
            valid=valid,
        )
    low, high = (_at_limit(end, leaf, made.high - made.low) for end in (made.low, made.high))
    if made.kind == "normal":
        low = -math.inf if leaf.low_open and low == leaf.low else low
        high = math.inf if leaf.high_open and high == leaf.high else high
    for end in (low, high):
        if math.isfinite(end) and not leaf.admits(end):
            raise ParameterError(
                f"{where}: {made.text}. Its bound at {shown(end, leaf.unit.symbol)} is not valid: "
                f"it must be {valid}. {advice}",
                name=where,
                value=shown(end, leaf.unit.symbol),
                valid=valid,
            )
    return replace(made, low=low, high=high)


def _require_single_values(where: str, kind: str, leaf: Leaf, nominal: float) -> None:
    """Reject a continuous distribution of a whole number.

    Parameters
    ----------
    where, kind
        Name of the entry in errors, and the kind of its distribution.
    leaf, nominal
        Declaration of the number, and its value in the bench.

    Raises
    ------
    ParameterError
        For such a distribution, with valid discrete values.
    """
    if not leaf.is_whole or kind == DISCRETE:
        return
    near = [x for x in (nominal - 1.0, nominal, nominal + 1.0) if leaf.admits(x)]
    raise ParameterError(
        f"{where} is a whole number, {leaf.range_text}, but kind {kind!r} has values in between. "
        f"For example, use kind = '{DISCRETE}', values = [{', '.join(f'{x:g}' for x in near)}]",
        name=where,
        value=kind,
        valid=f"'{DISCRETE}'",
    )


def whole(where: str, values: Sequence[float], leaf: Leaf) -> list[float]:
    """Return discrete values; whole numbers lose the rounding errors of percentages.

    Raises
    ------
    ParameterError
        For values of a whole number that are not whole.
    """
    if not leaf.is_whole:
        return list(values)
    for value in values:
        if not math.isfinite(value) or abs(value - round(value)) > _ROUNDING * abs(value):
            raise not_valid(
                f"{where}.values", f"{value:.10g}", f"a whole number, {leaf.range_text}"
            )
    return [float(round(value)) for value in values]


def require_following(where: str, made: Distribution, leaf: Leaf, unit: Unit, ratio: float) -> None:
    """Reject a distribution that moves a proportional quantity out of its range.

    Parameters
    ----------
    where
        Name of the proportional quantity in errors.
    made, unit
        Distribution of the other quantity, and its unit.
    leaf
        Declaration of the proportional quantity.
    ratio
        Ratio of its value to the other's value in the bench, not zero.

    Raises
    ------
    ParameterError
        As `admitted`, in the unit of the other quantity.
    """
    low, high = (leaf.low, leaf.low_open), (leaf.high, leaf.high_open)
    low, high = (low, high) if ratio > 0.0 else (high, low)
    admitted(where, made, Leaf(leaf.name, unit, low[0] / ratio, high[0] / ratio, low[1], high[1]))


def _require_singles(where: str, values: Sequence[float], leaf: Leaf) -> None:
    beyond = [value for value in values if not leaf.admits(value)]
    if beyond:
        texts = [", ".join(shown(x, leaf.unit.symbol) for x in each) for each in (values, beyond)]
        raise ParameterError(
            f"{where}: one of {texts[0]} leaves the valid range, {leaf.range_text}. Remove "
            f"{texts[1]}",
            name=where,
            value=texts[1],
            valid=leaf.range_text,
        )


def _at_limit(end: float, leaf: Leaf, width: float) -> float:
    """Return an end, or the limit that it misses only by rounding."""
    limits = [limit for limit in (leaf.low, leaf.high) if math.isfinite(limit)]
    room = _ROUNDING * width if math.isfinite(width) else 0.0
    return next((limit for limit in limits if abs(end - limit) <= room), end)


# --- Distributions of numbers

_TOLERANCE = re.compile(r"\s*(?:\+-|\+/-|±)\s*(\S.*)")


def read_distribution(
    name: str, entry: Any, leaf: Leaf, nominal: float, title: str = "[vary]", advice: str = ""
) -> Distribution:
    """Return the distribution of a number.

    Parameters
    ----------
    name
        Dotted name of the parameter or option.
    entry
        Entry of the study file: a tolerance such as ``"+-5 %"``, or a section with ``kind``.
    leaf
        Unit and valid range of the number.
    nominal
        Its value in the bench [SI]; percentages are relative to it.
    title
        Section of the file, for errors.
    advice
        Advice for a distribution that leaves the valid range; by default that of its kind.

    Raises
    ------
    InputError
        For entries that cannot be read, contradict themselves, or leave the valid range.
    """
    tolerance = _TOLERANCE.fullmatch(entry) if isinstance(entry, str) else None
    if tolerance is not None:
        entry = {"kind": "tolerance", "tolerance": tolerance[1]}
    if not isinstance(entry, Mapping):
        raise ParameterError(
            f"{title} {name} = {quoted(entry)} is not valid. Write a tolerance such as '+-5 %', "
            "or a "
            "section such as { kind = 'normal', sd = '5 %' }",
            name=f"{title} {name}",
            value=quoted(entry),
            valid="a tolerance such as '+-5 %'",
        )
    if "kind" not in entry:
        raise _without_kind(f"{title} {name}", entry, leaf)
    kind = entry["kind"]
    if not isinstance(kind, str) or kind not in _KINDS:
        raise unknown_name(f"kind of {title} {name}", choice_text(kind), _KINDS)
    _require_single_values(f"{title} {name}", kind, leaf, nominal)
    known, make = _KINDS[kind]
    for key in entry.keys() - {"kind", "together"}:
        if key not in known:
            raise unknown_name(f"key of {title} {name} (kind {kind})", key, known)
    made = make(_Entry(f"{title} {name}", entry, leaf, nominal))
    first, *_, last = made.levels(2)
    if not made.singles and not first < last:
        raise ParameterError(
            f"{title} {name}: {made.text} is too narrow for floating-point numbers, so nothing "
            "varies. Use a larger width",
            name=f"{title} {name}",
            value=made.text,
        )
    return admitted(f"{title} {name}", made, leaf, advice)


def _without_kind(where: str, entry: Mapping[str, Any], leaf: Leaf) -> ParameterError:
    """Return the error for a section without a valid kind of distribution."""
    given = entry.keys() - {"together"}
    near = [kind for kind, (keys, _) in _KINDS.items() if given and given <= {*keys}]
    near = [DISCRETE] if leaf.is_whole else near
    which = " or ".join(map(repr, near or _KINDS))
    others = f" (valid kinds are {', '.join(_KINDS)})" if near else ""
    return ParameterError(
        f"{where} = {quoted(entry)} has no kind. Add kind = {which}{others}",
        name=where,
        value=quoted(entry),
        valid=f"kind = {which}",
    )


@dataclass(frozen=True)
class _Entry:
    """A section of ``[vary]`` with the context for its texts; ``where``: its name in errors."""

    where: str
    section: Mapping[str, Any]
    leaf: Leaf
    nominal: float

    def level(self, key: str, default: float | None = None) -> float:
        """Return a value [SI]; a signed percentage, ``+10 %``, changes the nominal value."""
        if key not in self.section and default is not None:
            return default
        text = self._given(key)
        share = share_of(text)
        if share is None:
            return self._number(key, text)
        self._refuse_share(key, text)
        return (1.0 + share) * self.nominal

    def width(self, key: str, of: float) -> float:
        """Return a width > 0 [SI]; a percentage is relative to another value."""
        text = self._given(key)
        if isinstance(text, str) and text.strip().endswith("%"):
            self._refuse_share(key, text)
            width = abs(of) * parse(text, "1", f"{self.where}.{key}")
        else:
            width = self._number(key, text, difference_unit(self.leaf.unit.symbol))
        if not width > 0.0 or not math.isfinite(width):
            advice = "" if of else "with a unit, because a percentage of 0 is 0"
            raise not_valid(f"{self.where}.{key}", quoted(text), "a width > 0", advice)
        return width

    def amount(self, value: float) -> str:
        """Return a value in its display unit: the text is part of a study's identity."""
        symbol = self.leaf.unit.symbol
        return shown(value, symbol, display_unit(symbol))

    def _refuse_share(self, key: str, text: str) -> None:
        refuse_share_of_temperature(f"{self.where}.{key}", text, self.leaf.unit.symbol)

    def _given(self, key: str) -> Any:
        if key not in self.section:
            raise ParameterError(
                f"{self.where} of kind {self.section['kind']} needs the key {key!r}",
                name=key,
                value=str(self.section["kind"]),
            )
        return self.section[key]

    def breadth(self, value: float) -> str:
        """Return a width in its display unit, like `amount`."""
        symbol = difference_unit(self.leaf.unit.symbol)
        return shown(value, symbol, display_unit(symbol))

    def _number(self, key: str, value: Any, symbol: str = "") -> float:
        unit = self.leaf.unit
        where = f"{self.where}.{key}"
        return float(written(value, symbol or unit.symbol, where, unit.nominal))

    def refused(self, why: str) -> ParameterError:
        """Return the error for a section that contradicts itself."""
        return ParameterError(f"{self.where} (kind {self.section['kind']}): {why}", name=self.where)


def _frozen(
    entry: _Entry, law: Law, text: str, low: float = -math.inf, high: float = math.inf
) -> Distribution:
    """Return a distribution from its law; kinds with tails are unbounded, even if the law ends."""
    return Distribution(str(entry.section["kind"]), text, law.ppf, low, high, law.cdf, law.sf)


def _uniform(entry: _Entry) -> Distribution:
    low, high = entry.level("low"), entry.level("high")
    if not low < high:
        raise entry.refused(f"low = {entry.amount(low)} must be below high = {entry.amount(high)}")
    text = f"uniform, {entry.amount(low)} to {entry.amount(high)}"
    return _frozen(entry, Uniform(low, high - low), text, low, high)


def _tolerance(entry: _Entry) -> Distribution:
    width = entry.width("tolerance", entry.nominal)
    low, high = entry.nominal - width, entry.nominal + width
    shape = entry.section.get("shape", "uniform")
    text = f"{entry.amount(entry.nominal)} +- {entry.breadth(width)}"
    if shape == "uniform":
        return _frozen(entry, Uniform(low, high - low), f"{text}, uniform", low, high)
    if shape != "normal":
        raise unknown_name(f"shape of {entry.where}", str(shape), ("uniform", "normal"))
    law = truncated_normal(-3.0, 3.0, entry.nominal, width / 3.0)
    return _frozen(entry, law, f"{text}, normal with bounds at 3 sd", low, high)


def _normal(entry: _Entry) -> Distribution:
    mean = entry.level("mean", entry.nominal)
    sd = entry.width("sd", mean)
    text = f"normal, mean {entry.amount(mean)}, sd {entry.breadth(sd)}"
    low = entry.level("low", -math.inf)
    high = entry.level("high", math.inf)
    if math.isinf(low) and math.isinf(high):
        return _frozen(entry, Normal(mean, sd), text)
    if not low < high:
        raise entry.refused(f"low = {entry.amount(low)} must be below high = {entry.amount(high)}")
    law = Normal(mean, sd)  # a difference of the smaller probabilities is more accurate
    kept = law.sf(low) - law.sf(high) if low > mean else law.cdf(high) - law.cdf(low)
    if kept < NEVER:
        raise entry.refused(
            f"only {kept:.2g} of the distribution ({text}) is between low and high, which is too "
            "little for sampling. Choose other bounds or another mean"
        )
    cut = truncated_normal((low - mean) / sd, (high - mean) / sd, mean, sd)
    sides = [
        f"{word} {entry.amount(x)}" for word, x in (("from", low), ("to", high)) if math.isfinite(x)
    ]
    return _frozen(entry, cut, f"{text}, truncated {' '.join(sides)}", low, high)


def _lognormal(entry: _Entry) -> Distribution:
    median = entry.level("median", entry.nominal)
    if not median > 0.0:
        raise entry.refused(f"the median {entry.amount(median)} must be > 0")
    variation = entry.width("sd", median) / median
    sigma = math.sqrt(math.log1p(variation**2))
    text = f"log-normal, median {entry.amount(median)}, sd {100.0 * variation:.3g} %"
    return _frozen(entry, LogNormal(sigma, median), text)  # zero is treated as unbounded


def _triangular(entry: _Entry) -> Distribution:
    low, high = entry.level("low"), entry.level("high")
    mode = entry.level("mode", entry.nominal)
    ends = f"{entry.amount(low)}, {entry.amount(mode)}, {entry.amount(high)}"
    if not low <= mode <= high or not low < high:
        raise entry.refused(f"low, mode and high must be in increasing order, but are {ends}")
    law = Triangular((mode - low) / (high - low), low, high - low)
    return _frozen(entry, law, f"triangular, {ends}", low, high)


def _discrete(entry: _Entry) -> Distribution:
    values = entry.section.get("values")
    if not isinstance(values, list) or not values:
        raise entry.refused("this kind needs values = [...]")
    each = [replace(entry, section={"values": value}).level("values") for value in values]
    read = whole(entry.where, each, entry.leaf)
    weights = weights_of(entry.where, entry.section, len(read))
    texts = list(map(entry.amount, read))
    require_several(entry.where, read, texts)
    return replace(among(read, weights, ", ".join(texts)), low=min(read), high=max(read))


_KINDS: dict[str, tuple[tuple[str, ...], Callable[[_Entry], Distribution]]] = {
    "tolerance": (("tolerance", "shape"), _tolerance),
    "uniform": (("low", "high"), _uniform),
    "normal": (("mean", "sd", "low", "high"), _normal),
    "log-normal": (("median", "sd"), _lognormal),
    "triangular": (("low", "mode", "high"), _triangular),
    DISCRETE: (KEYS, _discrete),
}
ENTRY_KEYS = frozenset({"kind", "together"}).union(*(keys for keys, _ in _KINDS.values()))
"""all valid keys of a section of a quantity"""
