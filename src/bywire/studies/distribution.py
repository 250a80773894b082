"""How a quantity varies: read from a study file, and drawn by its quantile function.

A range or a tolerance is a distribution as any other; a grid and a worst-case search use its ends.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.bench.relative_changes import share_of
from bywire.bench.values import number
from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.leaf import Leaf
from bywire.core.typing import Array
from bywire.core.units import difference_unit, parse, shown
from bywire.studies.laws import Law, LogNormal, Normal, Triangular, Uniform, truncated_normal

NEVER = 1e-9
"""probability that counts as none: of values that the model would not admit"""
TAIL = 0.5 * math.erfc(3.0 / math.sqrt(2.0))
"""probability beyond 3 standard deviations, at which a grid ends where a distribution does not"""
_TOLERANCE = re.compile(r"\s*(?:\+-|\+/-|±)\s*(\S.*)")


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
    is_discrete
        Whether it has single values.
    """

    kind: str
    text: str
    quantile: Callable[[Array], NDArray[Any]]
    low: float = math.nan
    high: float = math.nan
    below: Callable[[float], float] | None = None
    above: Callable[[float], float] | None = None
    is_discrete: bool = False

    def levels(self, count: int) -> NDArray[Any]:
        """Return values for a grid: evenly from end to end; those of single values as they are.

        Where it has no end, the grid ends 3 standard deviations from the middle of a normal one:
        at a probability of 0.135 % beyond.
        """
        if self.is_discrete:
            return np.array(list(dict.fromkeys(self.quantile(np.linspace(0.0, 1.0, 4097)[1:-1]))))
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


def read_distribution(name: str, entry: Any, leaf: Leaf, nominal: float) -> Distribution:
    """Return how a number varies.

    Parameters
    ----------
    name
        Dotted name of the parameter or option.
    entry
        What the study file says: a tolerance as text, ``"+-5 %"``, or a section with ``kind``.
    leaf
        Unit and admissible range of the number.
    nominal
        Its value in the bench [SI]: shares are of it.

    Raises
    ------
    InputError
        For entries that cannot be read, contradict themselves, or leave the admissible range.
    """
    tolerance = _TOLERANCE.fullmatch(entry) if isinstance(entry, str) else None
    if tolerance is not None:
        entry = {"kind": "tolerance", "tolerance": tolerance[1]}
    if not isinstance(entry, Mapping):
        raise ParameterError(
            f"[vary] {name} = {quoted(entry)}: write a tolerance such as '+-5 %', or a section "
            "such as { kind = 'normal', sd = '5 %' }"
        )
    kind = entry.get("kind")
    if kind not in _KINDS:
        raise unknown_name(f"kind of [vary] {name}", str(kind), _KINDS)
    known, make = _KINDS[kind]
    for key in entry.keys() - {"kind", "together"}:
        if key not in known:
            raise unknown_name(f"key of [vary] {name} (kind {kind})", key, known)
    made = make(_Entry(name, entry, leaf, nominal))
    _require_admissible(name, made, leaf)
    return made


def read_choice(name: str, entry: Any, admitted: Sequence[Any]) -> Distribution:
    """Return how a structural choice varies: among values, each with a weight.

    Raises
    ------
    InputError
        For what is no list of choices.
    """
    values = entry.get("values") if isinstance(entry, Mapping) else None
    if not isinstance(values, Sequence) or isinstance(values, str) or not values:
        raise ParameterError(
            f"[vary] {name} = {quoted(entry)}: a choice varies among values, "
            "{ kind = 'discrete', values = [...] }"
            + (f", of {', '.join(map(repr, admitted))}" if admitted else "")
        )
    for value in values:
        if admitted and value not in admitted:
            raise unknown_name(f"value of {name}", str(value), map(str, admitted))
    return _among(list(map(str, values)), _weights(name, entry, len(values)), ", ".join(values))


@dataclass(frozen=True)
class _Entry:
    """A section of ``[vary]`` with what its texts are read by."""

    name: str
    section: Mapping[str, Any]
    leaf: Leaf
    nominal: float

    def level(self, key: str, default: float | None = None) -> float:
        """Return a value [SI]; a share with a sign, ``+10 %``, is a change of the nominal one."""
        if key not in self.section and default is not None:
            return default
        text = self._given(key)
        share = share_of(text)
        return self._number(key, text) if share is None else (1.0 + share) * self.nominal

    def width(self, key: str, of: float) -> float:
        """Return a width [SI] > 0; a share is of another value."""
        text = self._given(key)
        if isinstance(text, str) and text.strip().endswith("%"):
            width = abs(of) * parse(text, "1", f"[vary] {self.name}.{key}")
        else:
            width = self._number(key, text, difference_unit(self.leaf.unit.symbol))
        if not width > 0.0 or not math.isfinite(width):
            raise ParameterError(
                f"[vary] {self.name}.{key} = {quoted(text)}: a width > 0 is wanted"
                + ("; a share of 0 is none: give an amount" if not of else "")
            )
        return width

    def amount(self, value: float) -> str:
        """Return a value with its unit."""
        return shown(value, self.leaf.unit.symbol)

    def _given(self, key: str) -> Any:
        if key not in self.section:
            raise ParameterError(f"[vary] {self.name} of kind {self.section['kind']} needs {key!r}")
        return self.section[key]

    def breadth(self, value: float) -> str:
        """Return a width with its unit."""
        return shown(value, difference_unit(self.leaf.unit.symbol))

    def _number(self, key: str, value: Any, symbol: str = "") -> float:
        unit = self.leaf.unit
        where = f"[vary] {self.name}.{key}"
        if isinstance(value, (int, float)) and not isinstance(value, bool) and value != 0:
            value = repr(value)  # a file's plain number: 37 is not 37 bar, and hardly 37 Pa
        return float(number(value, symbol or unit.symbol, where, unit.nominal))

    def refused(self, why: str) -> ParameterError:
        """Return the error of a section that contradicts itself."""
        return ParameterError(f"[vary] {self.name} (kind {self.section['kind']}): {why}")


def _frozen(entry: _Entry, law: Law, text: str) -> Distribution:
    low, high = map(float, law.support())
    return Distribution(
        str(entry.section["kind"]), text, law.ppf, low, high, law.cdf, law.sf
    )


def _uniform(entry: _Entry) -> Distribution:
    low, high = entry.level("low"), entry.level("high")
    return _between(entry, low, high, f"uniform, {entry.amount(low)} to {entry.amount(high)}")


def _between(entry: _Entry, low: float, high: float, text: str) -> Distribution:
    if not low < high:
        raise entry.refused(f"low = {entry.amount(low)} must be below high = {entry.amount(high)}")
    return _frozen(entry, Uniform(low, high - low), text)


def _tolerance(entry: _Entry) -> Distribution:
    width = entry.width("tolerance", entry.nominal)
    shape = entry.section.get("shape", "uniform")
    text = f"{entry.amount(entry.nominal)} +- {entry.breadth(width)}"
    if shape == "uniform":
        return _between(entry, entry.nominal - width, entry.nominal + width, f"{text}, uniform")
    if shape != "normal":
        raise unknown_name(f"shape of [vary] {entry.name}", str(shape), ("uniform", "normal"))
    law = truncated_normal(-3.0, 3.0, entry.nominal, width / 3.0)
    return _frozen(entry, law, f"{text}, normal with 3 sd at the ends")


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
    law = truncated_normal((low - mean) / sd, (high - mean) / sd, mean, sd)
    ends = " to ".join("any" if math.isinf(x) else entry.amount(x) for x in (low, high))
    return _frozen(entry, law, f"{text}, truncated: {ends}")


def _lognormal(entry: _Entry) -> Distribution:
    median = entry.level("median", entry.nominal)
    if not median > 0.0:
        raise entry.refused(f"the median {entry.amount(median)} must be above zero")
    variation = entry.width("sd", median) / median
    sigma = math.sqrt(math.log1p(variation**2))
    text = f"log-normal, median {entry.amount(median)}, sd {100.0 * variation:.3g} %"
    # It ends at zero, but as it ends where it has no end: not within any standard deviation.
    return replace(_frozen(entry, LogNormal(sigma, median), text), low=-math.inf)


def _triangular(entry: _Entry) -> Distribution:
    low, high = entry.level("low"), entry.level("high")
    mode = entry.level("mode", entry.nominal)
    ends = f"{entry.amount(low)}, {entry.amount(mode)}, {entry.amount(high)}"
    if not low <= mode <= high or not low < high:
        raise entry.refused(f"low, mode and high must rise, got {ends}")
    law = Triangular((mode - low) / (high - low), low, high - low)
    return _frozen(entry, law, f"triangular, {ends}")


def _discrete(entry: _Entry) -> Distribution:
    values = entry.section.get("values")
    if not isinstance(values, list) or not values:
        raise entry.refused("it needs values = [...]")
    read = [replace(entry, section={"value": value}).level("value") for value in values]
    weights = _weights(entry.name, entry.section, len(read))
    made = _among(read, weights, ", ".join(map(entry.amount, read)))
    return replace(made, low=min(read), high=max(read))


def _among(values: list[Any], weights: Array, text: str) -> Distribution:
    each, edges = np.array(values), np.cumsum(weights)[:-1]
    alike = np.allclose(weights, weights[0])
    shares = "" if alike else f", with {', '.join(f'{100.0 * w:.3g} %' for w in weights)}"
    return Distribution(
        "discrete", f"one of {text}{shares}", partial(_picked, each, edges), is_discrete=True
    )


def _picked(values: NDArray[Any], edges: Array, u: Array) -> NDArray[Any]:
    return values[np.searchsorted(edges, u, side="right")]


def _weights(name: str, section: Mapping[str, Any], count: int) -> Array:
    """Return the probabilities of single values, alike by default."""
    given = section.get("weights", [1.0] * count)
    try:
        weights = np.array(given, dtype=float)
    except (TypeError, ValueError):
        weights = np.array([])
    if weights.shape != (count,) or not (weights > 0).all() or not np.isfinite(weights).all():
        raise ParameterError(
            f"[vary] {name}.weights = {quoted(given)}: {count} numbers > 0 are wanted, one a value"
        )
    return np.asarray(weights / weights.sum())


def _require_admissible(name: str, made: Distribution, leaf: Leaf) -> None:
    """Refuse what leaves the admissible range: a study would silently be of another question."""
    if made.below is None or made.above is None:
        beyond = float(
            made.low < leaf.low or (leaf.low_open and made.low == leaf.low)
            or made.high > leaf.high or (leaf.high_open and made.high == leaf.high)
        )  # fmt: skip
    else:
        beyond = float(made.below(leaf.low) + made.above(leaf.high))
    if beyond > NEVER:
        raise ParameterError(
            f"[vary] {name}: {made.text} leaves what is admissible, {leaf.range_text}"
            + (f", with a probability of {beyond:.2g}" if beyond < 1.0 else "")
            + ": give 'low' and 'high' to a normal distribution, or other ends"
        )


_KINDS: dict[str, tuple[tuple[str, ...], Callable[[_Entry], Distribution]]] = {
    "tolerance": (("tolerance", "shape"), _tolerance),
    "uniform": (("low", "high"), _uniform),
    "normal": (("mean", "sd", "low", "high"), _normal),
    "log-normal": (("median", "sd"), _lognormal),
    "triangular": (("low", "mode", "high"), _triangular),
    "discrete": (("values", "weights"), _discrete),
}
