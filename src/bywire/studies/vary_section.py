"""The section ``[vary]``: distributions as study files write them, and what varies of a bench."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from bywire.bench.bench import Bench
from bywire.bench.changes import OPTION, refuse_share_of_temperature, share_of
from bywire.bench.ensemble import varied_choices, varied_leaf
from bywire.core.errors import FileError, InputError, ParameterError, quoted, unknown_name
from bywire.core.leaf import Leaf
from bywire.core.parameters import leaf_fields
from bywire.core.quantities import Unit
from bywire.core.section import Hint, Name, Names, Section
from bywire.core.units import difference_unit, parse, shown
from bywire.core.values import written
from bywire.studies.distribution import (
    DISCRETE,
    KEYS,
    NEVER,
    Distribution,
    Law,
    LogNormal,
    Normal,
    Triangular,
    Uniform,
    among,
    choice_text,
    read_choice,
    require_several,
    truncated_normal,
    weights_of,
)
from bywire.studies.plan import Varied

_NEXT = {
    "tolerance": "take a narrower tolerance, or kind 'uniform' with ends within it",
    "uniform": "give 'low' and 'high' within it",
    "normal": "truncate it, with 'low' or 'high' within it",
    "log-normal": "take another 'median', or a smaller 'sd'",
    "triangular": "give 'low', 'mode' and 'high' within it",
}
"""what helps, by the kind of a distribution"""
_ROUNDING = 1e-12  # share of a range by which an end may miss a limit that it was meant to be at


def admitted(where: str, made: Distribution, leaf: Leaf, advice: str = "") -> Distribution:
    """Return a distribution that stays within the admissible range of its number.

    An end that rounding put beside a limit is at the limit. Where a distribution is truncated at a
    limit that is itself not admissible (``> 0``), it ends there but as one without an end: designs
    that go to the ends stop within it.

    Parameters
    ----------
    where
        What errors call it, for instance ``"[vary] motor.R_m"``.
    made, leaf
        How it varies, and what is known about it.
    advice
        What to do about a distribution that does not; by default what its kind has for that.

    Raises
    ------
    ParameterError
        With what is admissible, and the probability of what is not, or the end that is not.
    """
    if made.singles:
        _require_singles(where, made.singles, leaf)
        return made
    assert made.below is not None
    assert made.above is not None
    wanted, advice = leaf.range_text, advice or _NEXT[made.kind]
    beyond = made.below(leaf.low) + made.above(leaf.high)
    if beyond > NEVER:
        often = f", with a probability of {beyond:.2g}" if beyond < 1.0 else ""
        raise ParameterError(
            f"{where}: {made.text} leaves the valid range, {wanted}{often}: {advice}"
        )
    low, high = (_at_limit(end, leaf, made.high - made.low) for end in (made.low, made.high))
    if made.kind == "normal":
        low = -math.inf if leaf.low_open and low == leaf.low else low
        high = math.inf if leaf.high_open and high == leaf.high else high
    for end in (low, high):
        if math.isfinite(end) and not leaf.admits(end):
            raise ParameterError(
                f"{where}: {made.text}: its end at {shown(end, leaf.unit.symbol)} is not "
                f"valid: it must be {wanted}; {advice}"
            )
    return replace(made, low=low, high=high)


def _require_single_values(where: str, kind: str, leaf: Leaf, nominal: float) -> None:
    """Refuse a distribution of a whole number that has any value between its ends.

    Parameters
    ----------
    where, kind
        What errors call it, and the kind of its distribution.
    leaf, nominal
        What is known about it, and what the bench has.

    Raises
    ------
    ParameterError
        With single values that it may have.
    """
    if not leaf.is_whole or kind == DISCRETE:
        return
    near = [x for x in (nominal - 1.0, nominal, nominal + 1.0) if leaf.admits(x)]
    raise ParameterError(
        f"{where} is a whole number, {leaf.range_text}, and kind {kind!r} has values in between: "
        f"vary it by kind = '{DISCRETE}', values = [{', '.join(f'{x:g}' for x in near)}] for "
        "instance"
    )


def whole(where: str, values: Sequence[float], leaf: Leaf) -> list[float]:
    """Return single values; of a whole number without the last digit that a share leaves.

    Raises
    ------
    ParameterError
        For those of a whole number that are not whole.
    """
    if not leaf.is_whole:
        return list(values)
    for value in values:
        if not math.isfinite(value) or abs(value - round(value)) > _ROUNDING * abs(value):
            raise ParameterError(
                f"{where}.values: {value:.10g} is not valid: it must be a whole number, "
                f"{leaf.range_text}"
            )
    return [float(round(value)) for value in values]


def _require_following(
    where: str, made: Distribution, leaf: Leaf, unit: Unit, ratio: float
) -> None:
    """Refuse a distribution that takes what keeps its ratio to it out of the range of that.

    Parameters
    ----------
    where
        What errors call what follows.
    made, unit
        How the other one varies, and its unit.
    leaf
        What is known about the one that follows.
    ratio
        Its value over that of the other in the bench, not zero.

    Raises
    ------
    ParameterError
        As `admitted`, in the unit of the other one.
    """
    low, high = (leaf.low, leaf.low_open), (leaf.high, leaf.high_open)
    low, high = (low, high) if ratio > 0.0 else (high, low)
    admitted(where, made, Leaf(leaf.name, unit, low[0] / ratio, high[0] / ratio, low[1], high[1]))


def _require_singles(where: str, values: Sequence[float], leaf: Leaf) -> None:
    beyond = [value for value in values if not leaf.admits(value)]
    if beyond:
        texts = [", ".join(shown(x, leaf.unit.symbol) for x in each) for each in (values, beyond)]
        raise ParameterError(
            f"{where}: one of {texts[0]} leaves the valid range, {leaf.range_text}: leave out "
            f"{texts[1]}"
        )


def _at_limit(end: float, leaf: Leaf, width: float) -> float:
    """Return an end, or the limit that it misses by rounding alone."""
    limits = [limit for limit in (leaf.low, leaf.high) if math.isfinite(limit)]
    room = _ROUNDING * width if math.isfinite(width) else 0.0
    return next((limit for limit in limits if abs(end - limit) <= room), end)


# --- Distributions of numbers

_TOLERANCE = re.compile(r"\s*(?:\+-|\+/-|±)\s*(\S.*)")


def read_distribution(
    name: str, entry: Any, leaf: Leaf, nominal: float, title: str = "[vary]", advice: str = ""
) -> Distribution:
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
    title
        Section of the file that says so, for errors.
    advice
        What to do about a distribution that leaves the admissible range; by default what its kind
        has for that.

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
            f"{title} {name} = {quoted(entry)}: write a tolerance such as '+-5 %', or a section "
            "such as { kind = 'normal', sd = '5 %' }"
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
            f"{title} {name}: {made.text}: it is no wider than the last digit of a number, and "
            "nothing varies: give it a larger width"
        )
    return admitted(f"{title} {name}", made, leaf, advice)


def _without_kind(where: str, entry: Mapping[str, Any], leaf: Leaf) -> ParameterError:
    """Return the error of a section that does not say what kind of distribution it is."""
    given = entry.keys() - {"together"}
    near = [kind for kind, (keys, _) in _KINDS.items() if given and given <= {*keys}]
    near = [DISCRETE] if leaf.is_whole else near
    which = " or ".join(map(repr, near or _KINDS))
    others = f" (there are {', '.join(_KINDS)})" if near else ""
    return ParameterError(f"{where} = {quoted(entry)}: kind is missing: add kind = {which}{others}")


@dataclass(frozen=True)
class _Entry:
    """A section of ``[vary]`` with what its texts are read by; ``where``: what errors call it."""

    where: str
    section: Mapping[str, Any]
    leaf: Leaf
    nominal: float

    def level(self, key: str, default: float | None = None) -> float:
        """Return a value [SI]; a share with a sign, ``+10 %``, is a change of the nominal one."""
        if key not in self.section and default is not None:
            return default
        text = self._given(key)
        share = share_of(text)
        if share is None:
            return self._number(key, text)
        self._refuse_share(key, text)
        return (1.0 + share) * self.nominal

    def width(self, key: str, of: float) -> float:
        """Return a width [SI] > 0; a share is of another value."""
        text = self._given(key)
        if isinstance(text, str) and text.strip().endswith("%"):
            self._refuse_share(key, text)
            width = abs(of) * parse(text, "1", f"{self.where}.{key}")
        else:
            width = self._number(key, text, difference_unit(self.leaf.unit.symbol))
        if not width > 0.0 or not math.isfinite(width):
            raise ParameterError(
                f"{self.where}.{key} = {quoted(text)}: a width > 0 is wanted"
                + ("; a share of 0 is none: give an amount" if not of else "")
            )
        return width

    def amount(self, value: float) -> str:
        """Return a value with its unit."""
        return shown(value, self.leaf.unit.symbol)

    def _refuse_share(self, key: str, text: str) -> None:
        refuse_share_of_temperature(f"{self.where}.{key}", text, self.leaf.unit.symbol)

    def _given(self, key: str) -> Any:
        if key not in self.section:
            raise ParameterError(f"{self.where} of kind {self.section['kind']} needs {key!r}")
        return self.section[key]

    def breadth(self, value: float) -> str:
        """Return a width with its unit."""
        return shown(value, difference_unit(self.leaf.unit.symbol))

    def _number(self, key: str, value: Any, symbol: str = "") -> float:
        unit = self.leaf.unit
        where = f"{self.where}.{key}"
        return float(written(value, symbol or unit.symbol, where, unit.nominal))

    def refused(self, why: str) -> ParameterError:
        """Return the error of a section that contradicts itself."""
        return ParameterError(f"{self.where} (kind {self.section['kind']}): {why}")


def _frozen(
    entry: _Entry, law: Law, text: str, low: float = -math.inf, high: float = math.inf
) -> Distribution:
    """Return a distribution by its law; that of a tail has no end, wherever its law ends."""
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
    return _frozen(entry, law, f"{text}, normal with 3 sd at the ends", low, high)


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
    law = Normal(mean, sd)  # the difference of the smaller ones, for their digits
    kept = law.sf(low) - law.sf(high) if low > mean else law.cdf(high) - law.cdf(low)
    if kept < NEVER:
        raise entry.refused(
            f"what lies within low and high has a probability of {kept:.2g} of {text}: nothing of "
            "it is left; give other ends, or another mean"
        )
    cut = truncated_normal((low - mean) / sd, (high - mean) / sd, mean, sd)
    sides = [
        f"{word} {entry.amount(x)}" for word, x in (("from", low), ("to", high)) if math.isfinite(x)
    ]
    return _frozen(entry, cut, f"{text}, truncated {' '.join(sides)}", low, high)


def _lognormal(entry: _Entry) -> Distribution:
    median = entry.level("median", entry.nominal)
    if not median > 0.0:
        raise entry.refused(f"the median {entry.amount(median)} must be above zero")
    variation = entry.width("sd", median) / median
    sigma = math.sqrt(math.log1p(variation**2))
    text = f"log-normal, median {entry.amount(median)}, sd {100.0 * variation:.3g} %"
    return _frozen(entry, LogNormal(sigma, median), text)  # ends at zero as where it has no end


def _triangular(entry: _Entry) -> Distribution:
    low, high = entry.level("low"), entry.level("high")
    mode = entry.level("mode", entry.nominal)
    ends = f"{entry.amount(low)}, {entry.amount(mode)}, {entry.amount(high)}"
    if not low <= mode <= high or not low < high:
        raise entry.refused(f"low, mode and high must rise, got {ends}")
    law = Triangular((mode - low) / (high - low), low, high - low)
    return _frozen(entry, law, f"triangular, {ends}", low, high)


def _discrete(entry: _Entry) -> Distribution:
    values = entry.section.get("values")
    if not isinstance(values, list) or not values:
        raise entry.refused("it needs values = [...]")
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
_ENTRY_KEYS = frozenset({"kind", "together"}).union(*(keys for keys, _ in _KINDS.values()))
"""all keys that a section of a quantity may have"""


# --- What varies

_ESTIMATE = "estimate.json"
"""file of an identification's folder that holds its estimates"""
_LARGEST = 20_000_000  # bytes of a file that is read
_TRUNCATE = "cut it off, with truncate = true"
_WEAK = 1e-9  # correlation that counts as none


class MeasuredSection(Section):
    """The section ``[measured]``: estimates of an identification, of which parameters vary."""

    file: Annotated[Name, Hint("name the folder that 'bywire identify --out' has written")]
    of: Names | None = None
    truncate: bool = False


@dataclass(frozen=True)
class Measured:
    """Estimated parameters.

    Parameters
    ----------
    values, deviations
        By name [SI]: estimate and standard deviation.
    units
        SI unit by name.
    correlations
        Pairs of names, in alphabetical order -> correlation of their estimates.
    """

    values: Mapping[str, float]
    deviations: Mapping[str, float]
    units: Mapping[str, str]
    correlations: Mapping[tuple[str, str], float]

    def only(self, names: Sequence[str]) -> Measured:
        """Return some of the estimates.

        Raises
        ------
        UnknownNameError
            When one was not estimated.
        """
        for name in names:
            if name not in self.values:
                raise unknown_name("estimate in [measured] of", name, self.values)
        return Measured(
            {n: self.values[n] for n in names},
            {n: self.deviations[n] for n in names},
            {n: self.units[n] for n in names},
            {pair: c for pair, c in self.correlations.items() if set(pair) <= set(names)},
        )


def _varied_as_measured(
    bench: Bench, section: MeasuredSection, folder: Path
) -> tuple[tuple[Varied, ...], dict[tuple[str, str], float]]:
    """Return parameters that vary as they were measured, and the correlations of their estimates.

    Each is normal, with its estimate as mean.

    Parameters
    ----------
    bench
        What is tested.
    section
        ``[measured]`` of a study file: ``file``; ``of``, names, by default all that the bench has;
        ``truncate``, whether what leaves the admissible range is cut off.
    folder
        Where the path of the file starts.

    Raises
    ------
    InputError
        For a section that does not fit, and estimates that leave the admissible range.
    """
    measured = _read_measured(folder / section.file)
    leaves, values = leaf_fields(type(bench.par)), bench.par.flat()
    of = [name for name in measured.values if name in leaves] if section.of is None else section.of
    if not of:
        raise ParameterError(
            f"[measured] {section.file} has estimates of {', '.join(measured.values)}: "
            "name some of them with of = [...] that the bench has too"
        )
    chosen = measured.only(of)
    varied = []
    for name, value in chosen.values.items():
        if name not in leaves:
            raise unknown_name("parameter of [measured]", name, leaves)
        leaf, unit = leaves[name], chosen.units[name]
        entry = {
            "kind": "normal",
            "mean": _text(value, unit),
            "sd": _text(chosen.deviations[name], unit),
        }
        ends = {"low": leaf.low, "high": leaf.high} if section.truncate else {}
        symbol = leaf.unit.symbol
        entry |= {key: _text(x, symbol) for key, x in ends.items() if math.isfinite(x)}
        nominal = float(values[name])
        law = read_distribution(name, entry, leaf, nominal, "[measured]", _TRUNCATE)
        varied.append(Varied(name, leaf.unit.symbol, nominal, law))
    return tuple(varied), dict(chosen.correlations)


def _text(value: float, unit: str) -> str:
    """Return a value as a study file has it; a pure number has no unit."""
    return repr(value) if unit == "1" else f"{value!r} {unit}"


def _read_measured(path: Path) -> Measured:
    """Read what an identification estimated.

    Parameters
    ----------
    path
        Folder that ``bywire identify --out`` has written, or its ``estimate.json``.

    Raises
    ------
    FileError
        When there is none, or it is damaged.
    """
    file = path / _ESTIMATE if path.is_dir() else path
    try:
        data = file.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(
            f"cannot read {file}: {reason}: name the folder that 'bywire identify --out' has "
            "written"
        ) from None
    try:
        if len(data) > _LARGEST:
            raise ValueError("it is far too large")
        said = json.loads(data)
        return _joined(list(_estimates(said["estimates"])))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise FileError(
            f"{file} holds no estimates of an identification ({type(error).__name__}: "
            f"{quoted(str(error))}): name the folder that 'bywire identify --out' has written"
        ) from None


def _estimates(said: Mapping[str, Any]) -> Iterator[Measured]:
    for each in said.values():
        rows = each["parameters"]
        values = {str(name): _number(row["value"]) for name, row in rows.items()}
        deviations = {str(name): _number(row["standard_deviation"]) for name, row in rows.items()}
        if not all(d > 0.0 for d in deviations.values()):
            raise ValueError("a standard deviation is not above zero")
        names = [str(name) for name in each["correlation"]["names"]]
        matrix = np.array(each["correlation"]["matrix"], dtype=float)
        if matrix.shape != (len(names), len(names)) or {*names} != {*values}:
            raise ValueError("the correlations are of other parameters")
        pairs = {
            (min(a, b), max(a, b)): _number(float(matrix[i, k]))
            for (i, a), (k, b) in combinations(enumerate(names), 2)
            if abs(matrix[i, k]) > _WEAK
        }
        units = {str(name): str(row["unit"]) for name, row in rows.items()}
        yield Measured(values, deviations, units, pairs)


def _joined(each: Sequence[Measured]) -> Measured:
    """Return several estimates as one: those of different ones are independent."""
    names = [name for file in each for name in file.values]
    if not names:
        raise ParameterError("nothing is estimated in it")
    if len(names) != len({*names}):
        twice = next(name for name in names if names.count(name) > 1)
        raise ParameterError(f"{twice} is estimated twice in it")
    return Measured(
        {k: v for file in each for k, v in file.values.items()},
        {k: v for file in each for k, v in file.deviations.items()},
        {k: v for file in each for k, v in file.units.items()},
        {k: v for file in each for k, v in file.correlations.items()},
    )


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"{quoted(value)} is no number")
    return float(value)


# --- What varies


def read_all_varied(
    bench: Bench, section: Mapping[str, Any], estimates: MeasuredSection | None, folder: Path
) -> tuple[tuple[Varied, ...], Mapping[tuple[str, str], float]]:
    """Return what varies, as the file says or as it was measured, and what goes together so.

    Parameters
    ----------
    bench
        What is tested.
    section, estimates
        ``[vary]`` and ``[measured]`` of its file.
    folder
        Where its paths start.

    Raises
    ------
    InputError
        For sections that do not fit, and what varies twice.
    """
    measured: tuple[Varied, ...] = ()
    correlations: Mapping[tuple[str, str], float] = {}
    if estimates is not None:
        measured, correlations = _varied_as_measured(bench, estimates, folder)
    varied = tuple(read_varied(bench, section))
    places: dict[str, str] = {}
    for title, each in (("[measured]", measured), ("[vary]", varied)):
        for quantity in each:
            _put_once(places, quantity.name, title)
            for name in quantity.together:
                _put_once(places, name, f"{title} {quantity.name}.together")
    return (*measured, *varied), correlations


def _put_once(places: dict[str, str], name: str, place: str) -> None:
    """Note where a quantity varies, or refuse one that varies elsewhere too."""
    if name in places:
        raise ParameterError(
            f"[vary] {name} varies twice, by {places[name]} and by {place}: leave one of both out"
        )
    places[name] = place


def read_varied(bench: Bench, section: Mapping[str, Any]) -> Iterator[Varied]:
    """Yield what a section ``[vary]`` varies of a bench.

    Raises
    ------
    InputError
        For names that are no numbers or choices of the bench, and values that do not fit.
    """
    values, choices = quantities_of(bench), varied_choices(bench)
    for name, entry in entries_of(section, values).items():
        if name not in values:
            raise unknown_name("parameter or option to vary", name, values)
        together = _together(name, entry, bench, values)
        if name in choices:
            if together:
                raise ParameterError(f"[vary] {name} is a choice: nothing varies by its ratio")
            law = read_choice(name, entry, choices[name])
            _require_alike(bench, name, law.singles)
            yield Varied(name, "", choice_text(values[name]), law)
            continue
        if isinstance(values[name], (str, bool)):
            raise ParameterError(
                f"[vary] {name} = {quoted(values[name])} names a signal or a file: only numbers "
                "vary, and choices among what is listed"
            )
        if isinstance(values[name], tuple):
            raise ParameterError(f"[vary] {name} is a table: single numbers vary, and choices")
        leaf = varied_leaf(bench, name)
        nominal = float(values[name])
        if not choices.keys() & section.keys():  # one of them may switch it on
            bench.require_effect(name)
        law = read_distribution(name, entry, leaf, nominal)
        for each in filter(values.get, together):
            _require_following(
                f"[vary] {name}.together {each}",
                law,
                varied_leaf(bench, each),
                leaf.unit,
                values[each] / nominal,
            )
        yield Varied(name, leaf.unit.symbol, nominal, law, together)


def quantities_of(bench: Bench) -> dict[str, Any]:
    """Return all numbers [SI], tables and choices of a bench by name, ``options.NAME`` too."""
    options = bench.chosen_options.flat()
    return {**bench.par.flat(), **{f"{OPTION}{name}": value for name, value in options.items()}}


def _require_alike(bench: Bench, name: str, values: Sequence[str]) -> None:
    """Refuse values of an option with which the experiment is another one.

    What it drives may have another unit with them, and its key figures may be others: neither a
    stimulus nor a requirement would mean the same in all cases.
    """
    if not name.startswith(OPTION):
        return
    figures = bench.definition.kpis_with(bench.chosen_options)
    for value in values:
        options = {**bench.options, name.removeprefix(OPTION): value}
        try:
            other = replace(bench, options=options, requirements={})
        except InputError as error:
            raise error.reworded(f"[vary] {name} = {value!r}: {error}") from None
        given = other.definition.kpis_with(other.chosen_options)
        if given != figures:
            differing = sorted(given.keys() ^ figures.keys()) or sorted(figures)
            raise ParameterError(
                f"[vary] {name} = {value!r}: {bench.experiment!r} has other key figures with it "
                f"than with the bench's own ({', '.join(differing)}): vary it among values that "
                "have the same, or make it a study of its own"
            )


def entries_of(section: Mapping[str, Any], known: Collection[str]) -> dict[str, Any]:
    """Return the entries of ``[vary]`` by dotted name, however the file nests them.

    Parameters
    ----------
    section
        What the file holds.
    known
        Names that may vary: a table under one of them is an entry, whatever it holds.

    Raises
    ------
    ParameterError
        For a name that is written in two ways, ``motor.R_m`` and ``"motor.R_m"``.
    """
    entries: dict[str, Any] = {}
    for name, entry in _spread(section, known):
        if name in entries:
            raise ParameterError(
                f'[vary] {name} varies twice, by {name} and by "{name}" in quotation marks: '
                "leave one of both out"
            )
        entries[name] = entry
    return entries


def _spread(
    section: Mapping[str, Any], known: Collection[str], prefix: str = ""
) -> Iterator[tuple[str, Any]]:
    for key, value in section.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping) and value and not _is_entry(name, value, known):
            yield from _spread(value, known, f"{name}.")
        else:
            yield name, value


def _is_entry(name: str, value: Mapping[str, Any], known: Collection[str]) -> bool:
    """Return whether a table says how a quantity varies, and is no group of quantities."""
    if name in known or any(each.startswith(f"{name}.") for each in known):
        return name in known
    return "kind" in value or value.keys() <= _ENTRY_KEYS  # of a name that nothing answers to


def _together(name: str, entry: Any, bench: Bench, values: Mapping[str, Any]) -> tuple[str, ...]:
    given = entry.get("together", []) if isinstance(entry, Mapping) else []
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise ParameterError(f"[vary] {name}.together = {quoted(given)}: a list of names is wanted")
    leaves = leaf_fields(type(bench.par))
    for each in given:
        if not isinstance(each, str) or each not in leaves:
            kind = f"parameter that varies together with {name}"
            raise unknown_name(kind, choice_text(each), leaves)
        if isinstance(values[each], tuple):
            raise ParameterError(f"[vary] {name}.together {each} is a table: single numbers vary")
        if leaves[each].is_whole:
            raise ParameterError(
                f"[vary] {name}.together {each} is a whole number, which keeps no ratio: vary it "
                "by itself, or leave it as in the bench"
            )
    if given and not values.get(name):
        raise ParameterError(f"[vary] {name} is zero in the bench: nothing can keep its ratio")
    return tuple(given)
