"""Study files: TOML in, a plan out; nothing in them is executed."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from bywire.bench import bench_file
from bywire.bench.bench import Bench
from bywire.bench.ensemble import varied_leaf
from bywire.bench.requirements import limit_of
from bywire.core.errors import InputError, ParameterError, quoted, unknown_name
from bywire.core.parameters import choice_fields, choices_of, leaf_fields
from bywire.core.units import parse
from bywire.data.toml_file import read_toml
from bywire.studies.correlation import correlation_factor
from bywire.studies.design_rules import require_agreement
from bywire.studies.distribution import read_choice, read_distribution
from bywire.studies.measured import varied_as_measured
from bywire.studies.plan import Demand, StudyPlan, Varied
from bywire.studies.points import MOST, SAMPLED, SPANNED
from bywire.studies.sensitivity_design import LEVELS, SENSITIVITY
from bywire.studies.sought_design import DEFAULT_CASES, SOUGHT, SUBSET

_KEYS = ("name", "bench", "vary", "measured", "correlation", "design", "set", "requirements")
_DESIGN = ("kind", "cases", "seed", "levels", "confidence", "cases_per_level", "time")
_KINDS = (*SAMPLED, *SPANNED, *SENSITIVITY, *SOUGHT)
_WITH = re.compile(r"(.*\S)\s+with\s+(\S.*%)\s*", re.DOTALL)
_WITH_LEVELS = ("grid", "one-at-a-time")
_OPTION = "options."


def read_study(
    path: str | Path, overrides: Mapping[str, str] = MappingProxyType({})
) -> StudyPlan:
    """Read a study file.

    Parameters
    ----------
    path
        TOML file with ``bench``, the section ``[vary]``, and ``[design]``, ``[[correlation]]``,
        ``[set]`` and ``[requirements]`` as wanted; see ``docs/studies.md``.
    overrides
        Further changes of the bench, which count more than those of ``[set]``.

    Raises
    ------
    FileError
        When the file cannot be read or is no TOML.
    InputError
        For anything in it that does not fit, with the file's name in front.
    """
    file = Path(path)
    content = read_toml(file, "study file")
    try:
        return _plan(content, file, overrides)
    except InputError as error:
        raise type(error)(f"{file}: {error}") from None


def _plan(
    content: Mapping[str, Any], file: Path, overrides: Mapping[str, str]
) -> StudyPlan:
    for key in content:
        if key not in _KEYS:
            raise unknown_name("key of a study file", key, _KEYS)
    for key in ("vary", "measured", "design", "set", "requirements"):
        if not isinstance(content.get(key, {}), Mapping):
            raise ParameterError(f"[{key}] must be a section with key = value lines")
    name = content.get("name", file.stem)
    if not isinstance(name, str) or not name.strip():
        raise ParameterError(f"name = {quoted(name)}: a text is wanted")
    bench = read_bench(content, file.parent, overrides)
    demands = tuple(_demands(bench, content.get("requirements", {})))
    limits = {demand.kpi: demand.limit for demand in demands}
    bench = replace(bench, requirements=limits, name=bench.name or name)
    varied, measured = read_all_varied(bench, content, file.parent)
    if not varied:
        raise ParameterError("[vary] is empty: say what varies, such as \"motor.R_m\" = '+-10 %'")
    correlations = {**measured, **_correlations(content.get("correlation", []), varied, measured)}
    plan = StudyPlan(
        name, bench, varied, demands=demands, correlations=correlations,
        **_design(content.get("design", {})),
    )  # fmt: skip
    require_agreement(plan)
    return plan


def read_bench(
    content: Mapping[str, Any], folder: Path, overrides: Mapping[str, str]
) -> Bench:
    """Return the bench that a file names, with the changes of its ``[set]`` and further ones."""
    source = content.get("bench")
    if not isinstance(source, str) or not source.strip():
        raise ParameterError(
            f"bench = {quoted(source)}: name a bench file (its path starts at the study file's "
            "folder), or an experiment of 'bywire list'"
        )
    changes = bench_file.flattened(content.get("set", {}))
    there = source if bench_file.names_experiment(source) else folder / source
    for key, value in changes.items():
        if not isinstance(value, str):
            raise ParameterError(f"[set] {key} = {quoted(value)}: write the value as a text, "
                                 "with its unit, as --set takes it")  # fmt: skip
    return bench_file.read(there, {**changes, **overrides})


def _demands(bench: Bench, section: Mapping[str, Any]) -> Iterator[Demand]:
    """Yield what is required: by the study, and by its bench of what the study says nothing of."""
    units = bench.definition.kpis_with(bench.chosen_options)
    for kpi, text in {**bench.requirements, **section}.items():
        if kpi not in units:
            raise unknown_name("KPI in [requirements]", kpi, units)
        split = _WITH.fullmatch(text) if isinstance(text, str) else None
        limit, probability = (split[1], _probability(kpi, split[2])) if split else (text, None)
        limit_of(kpi, limit, units[kpi])
        yield Demand(kpi, limit, probability)


def _probability(kpi: str, text: str) -> float:
    share = parse(text, "1", f"probability of requirement {kpi}")
    if not 0.0 < share < 1.0:
        raise ParameterError(
            f"requirement {kpi}: a probability of {text} is not admissible: it must lie between 0 "
            "and 100 %, as 'with 99.9 %'; leave it out where every case has to meet the limit"
        )
    return share


def read_all_varied(
    bench: Bench, content: Mapping[str, Any], folder: Path
) -> tuple[tuple[Varied, ...], Mapping[tuple[str, str], float]]:
    """Return what varies, as the file says or as it was measured, and what goes together so."""
    measured: tuple[Varied, ...] = ()
    correlations: Mapping[tuple[str, str], float] = {}
    if "measured" in content:
        measured, correlations = varied_as_measured(bench, content["measured"], folder)
    varied = (*measured, *read_varied(bench, content.get("vary", {})))
    names = [name for each in varied for name in (each.name, *each.together)]
    for name in names:
        if names.count(name) > 1:
            raise ParameterError(f"[vary] {name} varies twice: leave one of both out")
    return varied, correlations


def read_varied(bench: Bench, section: Mapping[str, Any]) -> Iterator[Varied]:
    """Yield what a section ``[vary]`` varies of a bench.

    Raises
    ------
    InputError
        For names that are no numbers or choices of the bench, and values that do not fit.
    """
    entries = dict(entries_of(section))
    values = {
        **bench.par.flat(),
        **{f"{_OPTION}{k}": v for k, v in bench.chosen_options.flat().items()},
    }
    choices = choice_fields(type(bench.par))
    for name, entry in entries.items():
        together = _together(name, entry, bench, values)
        if name in choices:
            if together:
                raise ParameterError(f"[vary] {name} is a choice: nothing varies by its ratio")
            law = read_choice(name, entry, choices_of(type(bench.par), name))
            yield Varied(name, "", values[name], law)
            continue
        leaf = varied_leaf(bench, name)
        if isinstance(values[name], tuple):
            raise ParameterError(f"[vary] {name} is a table: single numbers vary, and choices")
        law = read_distribution(name, entry, leaf, float(values[name]))
        yield Varied(name, leaf.unit.symbol, float(values[name]), law, together)


def entries_of(section: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the entries of ``[vary]`` by dotted name, however the file nests them."""
    for key, value in section.items():
        is_group = isinstance(value, Mapping) and value and "kind" not in value and all(
            isinstance(each, (Mapping, str)) for each in value.values()
        )  # fmt: skip
        if is_group:
            yield from entries_of(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _together(
    name: str, entry: Any, bench: Bench, values: Mapping[str, Any]
) -> tuple[str, ...]:
    given = entry.get("together", []) if isinstance(entry, Mapping) else []
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise ParameterError(f"[vary] {name}.together = {quoted(given)}: a list of names is wanted")
    leaves = leaf_fields(type(bench.par))
    for each in given:
        if each not in leaves:
            raise unknown_name(f"parameter that varies together with {name}", str(each), leaves)
    if given and not values.get(name):
        raise ParameterError(f"[vary] {name} is zero in the bench: nothing can keep its ratio")
    return tuple(given)


def _correlations(
    entries: Any, varied: Sequence[Varied], known: Mapping[tuple[str, str], float]
) -> dict[tuple[str, str], float]:
    if not isinstance(entries, list) or not all(isinstance(each, Mapping) for each in entries):
        raise ParameterError("write [[correlation]] with two brackets, once for each pair")
    names = {each.name: each for each in varied}
    pairs: dict[tuple[str, str], float] = {}
    for entry in entries:
        for key in entry:
            if key not in ("of", "value"):
                raise unknown_name("key of [[correlation]]", key, ("of", "value"))
        pair, value = entry.get("of"), entry.get("value")
        if not isinstance(pair, list) or len(pair) != 2 or pair[0] == pair[1]:
            raise ParameterError(f"[[correlation]] of = {quoted(pair)}: two names are wanted")
        for name in pair:
            if name not in names:
                raise unknown_name("quantity of [[correlation]]", str(name), names)
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not is_number or not -1.0 < value < 1.0:
            raise ParameterError(
                f"[[correlation]] of {pair[0]} and {pair[1]}: value = {quoted(value)} must be a "
                "number between -1 and 1"
            )
        first, second = sorted(pair)
        if (first, second) in {**known, **pairs}:
            raise ParameterError(f"[[correlation]] of {first} and {second} stands there twice")
        pairs[first, second] = float(value)
    correlation_factor(list(names), {**known, **pairs})
    return pairs


def _design(section: Mapping[str, Any]) -> dict[str, Any]:
    for key in section:
        if key not in _DESIGN:
            raise unknown_name("key of [design]", key, _DESIGN)
    design: dict[str, Any] = {}
    if "kind" in section:
        if section["kind"] not in _KINDS:
            raise unknown_name("[design] kind", str(section["kind"]), _KINDS)
        design["design"] = section["kind"]
    _require_of_use(design.get("design", StudyPlan.design), section)
    if (default := DEFAULT_CASES.get(design.get("design", ""))) is not None:
        design["cases"] = default
    for key, low, high in (
        ("cases", 1, MOST), ("seed", 0, 2**63 - 1), ("levels", 2, 1000),
        ("cases_per_level", 1, MOST),
    ):  # fmt: skip
        if key in section:
            design[key] = _whole(key, section[key], low, high)
    if "confidence" in section:
        share = parse(section["confidence"], "1", "[design] confidence")
        if not 0.5 <= share < 1.0:
            raise ParameterError(
                f"[design] confidence = {quoted(section['confidence'])} must be at least 50 %, and "
                "below 100 %"
            )
        design["confidence"] = share
    if "time" in section:
        design["time"] = parse(section["time"], "s", "[design] time")
        if not design["time"] > 0.0:
            raise ParameterError(f"[design] time = {quoted(section['time'])} must be above zero")
    return design


def _require_of_use(kind: str, section: Mapping[str, Any]) -> None:
    """Refuse what a design has no use for."""
    if "levels" in section and kind not in _WITH_LEVELS:
        raise ParameterError(
            f"[design] levels: {kind!r} has none to choose"
            + (f", it steps on {LEVELS}" if kind == "morris" else "")
            + ": leave them out"
        )
    if "cases_per_level" in section and kind != SUBSET:
        raise ParameterError(
            f"[design] cases_per_level: {kind!r} has no levels to fill, {SUBSET!r} has: leave it "
            "out"
        )
    if "time" in section and kind in SOUGHT:
        raise ParameterError(f"[design] time: the budget of {kind!r} is its 'cases': leave it out")
    if "cases" in section and kind in SPANNED:
        raise ParameterError(
            f"[design] cases: {kind!r} lists its cases by quantities and levels: leave them out"
        )


def _whole(key: str, value: Any, low: int, high: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise ParameterError(
            f"[design] {key} = {quoted(value)}: a whole number from {low} to {high} is wanted"
        )
    return value
