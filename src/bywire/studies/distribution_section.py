"""Distributions of numbers as study files write them: a tolerance, or a section with ``kind``."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from bywire.bench.relative_changes import share_of
from bywire.bench.values import number
from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.leaf import Leaf
from bywire.core.units import difference_unit, parse, shown
from bywire.studies.admissible import require_admissible
from bywire.studies.distribution import Distribution
from bywire.studies.laws import Law, LogNormal, Normal, Triangular, Uniform, truncated_normal
from bywire.studies.single_values import among, weights_of

_TOLERANCE = re.compile(r"\s*(?:\+-|\+/-|±)\s*(\S.*)")


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
    require_admissible(name, made, leaf)
    return made


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
    weights = weights_of(entry.name, entry.section, len(read))
    made = among(read, weights, ", ".join(map(entry.amount, read)))
    return replace(made, low=min(read), high=max(read))


_KINDS: dict[str, tuple[tuple[str, ...], Callable[[_Entry], Distribution]]] = {
    "tolerance": (("tolerance", "shape"), _tolerance),
    "uniform": (("low", "high"), _uniform),
    "normal": (("mean", "sd", "low", "high"), _normal),
    "log-normal": (("median", "sd"), _lognormal),
    "triangular": (("low", "mode", "high"), _triangular),
    "discrete": (("values", "weights"), _discrete),
}
