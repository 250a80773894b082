"""Reader of study files (TOML), which does not execute any of their content."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import Field

from bywire.bench import bench_file
from bywire.bench.bench import Bench
from bywire.bench.bench_file import names_experiment
from bywire.bench.requirements import read_limits
from bywire.core.callers import option
from bywire.core.errors import InputError, ParameterError, not_valid, quoted, unknown_name
from bywire.core.quantities import Unit
from bywire.core.section import Hint, Name, Names, Section, Table
from bywire.data.toml_file import STUDY, read_toml, require_kind
from bywire.studies.designs import (
    DEFAULT_CASES,
    IMPORTANCE,
    LEVELS,
    MORRIS,
    MOST,
    RARE,
    SAMPLED,
    SENSITIVITY,
    SOUGHT,
    SPANNED,
    SUBSET,
    SoughtDesign,
)
from bywire.studies.distribution import rising
from bywire.studies.plan import StudiedBench, StudyPlan, Varied, correlation_factor
from bywire.studies.vary_section import MeasuredSection, read_all_varied

_CORRELATION = Hint("for example, write of = ['motor.R_m', 'motor.K_e'] and value = 0.5")


class CorrelationSection(Section):
    """A section ``[[correlation]]``: two quantities, and the correlation of their scores."""

    of: Annotated[Names, _CORRELATION]
    value: Annotated[float, Unit("1"), Field(gt=-1, lt=1), _CORRELATION]


def _in_order(
    varied: Sequence[Varied], correlations: Mapping[tuple[str, str], float]
) -> tuple[Varied, ...]:
    """Return the varied quantities, with correlated discrete values in ascending order."""
    correlated = {name for pair in correlations for name in pair}
    return tuple(
        replace(each, distribution=rising(each.distribution))
        if each.name in correlated and each.distribution.is_discrete
        else each
        for each in varied
    )


def _read_correlations(
    sections: Sequence[CorrelationSection],
    varied: Sequence[Varied],
    known: Mapping[tuple[str, str], float],
) -> dict[tuple[str, str], float]:
    """Return the correlations of ``[[correlation]]`` by pairs of names in alphabetical order.

    Parameters
    ----------
    sections
        Sections of the file.
    varied
        Quantities that vary.
    known
        Correlations from other sources.

    Raises
    ------
    InputError
        For invalid entries, and for correlations that contradict each other.
    """
    names = {each.name: each for each in varied}
    pairs: dict[tuple[str, str], float] = {}
    for section in sections:
        pair = section.of
        if len(pair) != 2 or pair[0] == pair[1]:
            raise not_valid("[[correlation]] of", quoted(list(pair)), "two different names")
        for name in pair:
            if name not in names:
                raise unknown_name("quantity of [[correlation]]", name, names)
            if not names[name].unit:
                raise ParameterError(
                    f"[[correlation]] of {pair[0]} and {pair[1]}: {name} is a choice. Choices "
                    "have no order and therefore no correlation. Remove this section, or run a "
                    "study for each value",
                    name=name,
                )
        first, second = sorted(pair)
        if (first, second) in {**known, **pairs}:
            raise ParameterError(
                f"[[correlation]] lists {first}, {second} twice. Remove one of the sections",
                name=f"{first}, {second}",
            )
        pairs[first, second] = section.value
    correlation_factor(list(names), {**known, **pairs})
    return pairs


# --- Probabilities, correlations and numbers of cases that a design permits

_DEPENDENT = "has cases that share values and are not independent"


def _require_agreement(plan: StudyPlan) -> None:
    """Reject probabilities and correlations for designs without independent cases.

    Raises
    ------
    ParameterError
        For these, and for a number of cases that is not valid for the design.
    """
    if plan.is_sampled:
        return
    if plan.sought is not None and plan.design in RARE:
        _require_rare(plan, plan.sought)
        return
    is_indexed = plan.design in SENSITIVITY
    others = ", ".join(map(repr, SAMPLED))
    if plan.correlations:
        why = (
            "exchanges quantities one at a time, so they must be independent"
            if is_indexed
            else "visits the bounds of each quantity separately"
        )
        raise ParameterError(
            f"[[correlation]] is not possible: {plan.design!r} {why}. Remove it, or use {others}",
            name="[[correlation]]",
            value=plan.design,
            valid=others,
        )
    if plan.design == MORRIS:
        for each in plan.varied:
            if (count := len(each.distribution.singles)) > LEVELS:
                raise ParameterError(
                    f"[vary] {each.name} has {count} values, but {plan.design!r} uses only "
                    f"{LEVELS} levels. List at most {LEVELS} values, or use 'sobol-indices'",
                    name=f"[vary] {each.name}",
                    value=str(count),
                    valid=str(LEVELS),
                )
    for demand in plan.demands:
        if demand.probability is not None:
            why = _DEPENDENT if plan.design == "sobol-indices" else "does not draw random cases"
            raise ParameterError(
                f"requirement {str(demand)!r}: {plan.design!r} {why}, so its cases have no "
                f"probability. Use {others}, or remove 'with ...' to require that every case meets "
                "the limit",
                name=demand.figure,
                value=str(demand),
                valid=others,
            )
    if plan.sought is not None:
        if not plan.demands:
            raise ParameterError(
                f"[requirements] is empty, but {plan.design!r} searches for the worst case of each "
                'requirement. For example, write overshoot = "<= 15 %"',
                name="[requirements]",
                value=plan.design,
            )
        plan.sought.require_budget()
        return
    plan.points  # noqa: B018 - rejects invalid numbers of cases


def _require_rare(plan: StudyPlan, design: SoughtDesign) -> None:
    """Reject rare failures without a probability, and design points among discrete values."""
    if not plan.judged_demands:
        raise ParameterError(
            f"[requirements] contains no probability, but {plan.design!r} computes the probability "
            'of missing a requirement. For example, write "<= 15 % with 99.99 %"',
            name="[requirements]",
            value=plan.design,
        )
    singles = [each.name for each in plan.varied if each.distribution.is_discrete]
    if singles and plan.design == IMPORTANCE:
        raise ParameterError(
            f"[vary] {', '.join(singles)}: {plan.design!r} needs derivatives, but discrete values "
            f"have none. Use {SUBSET!r}",
            name=f"[vary] {', '.join(singles)}",
            valid=repr(SUBSET),
        )
    design.require_budget()


# --- The section ``[design]``: kind of design, and number of cases

_KINDS = (*SAMPLED, *SPANNED, *SENSITIVITY, *SOUGHT)
_WITH_LEVELS = ("grid", "one-at-a-time")
_Cases = Annotated[int | None, Field(ge=1, le=MOST)]


class DesignSection(Section):
    """Section ``[design]``. Omitted keys have the defaults of `StudyPlan`."""

    kind: str = StudyPlan.design
    cases: _Cases = None
    seed: Annotated[int | None, Field(ge=0, le=2**63 - 1)] = None
    levels: Annotated[int | None, Field(ge=2, le=1000)] = None
    confidence: Annotated[float | None, Unit("1"), Field(ge=0.5, lt=1)] = None
    cases_per_level: _Cases = None
    time: Annotated[float | None, Unit("s"), Field(gt=0)] = None


def _read_design(section: DesignSection) -> dict[str, Any]:
    """Return the content of the section, by the fields of a `StudyPlan`.

    Raises
    ------
    InputError
        For unknown keys, and for keys that the kind of design does not use.
    """
    if section.kind not in _KINDS:
        raise unknown_name("[design] kind", section.kind, _KINDS)
    given = section.given
    _require_of_use(section.kind, given)
    if section.kind in DEFAULT_CASES:
        given.setdefault("cases", DEFAULT_CASES[section.kind])
    return {"design": section.kind} | {key: given[key] for key in given if key != "kind"}


def _require_of_use(kind: str, section: Mapping[str, Any]) -> None:
    """Reject keys that the design does not use."""
    if "levels" in section and kind not in _WITH_LEVELS:
        raise ParameterError(
            f"[design] levels has no effect for {kind!r}"
            + (f", which always uses {LEVELS}" if kind == "morris" else "")
            + ". Remove it",
            name="[design] levels",
            value=str(kind),
        )
    if "cases_per_level" in section and kind != SUBSET:
        raise ParameterError(
            f"[design] cases_per_level applies only to {SUBSET!r}, not to {kind!r}. Remove it",
            name="[design] cases_per_level",
            value=str(kind),
            valid=str(SUBSET),
        )
    if "time" in section and kind in SOUGHT:
        raise ParameterError(
            f"[design] time has no effect for {kind!r}, whose budget is 'cases'. Remove it",
            name="[design] time",
            value=str(kind),
        )
    if "cases" in section and kind in SPANNED:
        raise ParameterError(
            f"[design] cases has no effect for {kind!r}, because quantities and levels determine "
            "the number of cases. Remove it",
            name="[design] cases",
            value=str(kind),
        )


# --- The file

BenchName = Annotated[
    Name,
    Hint(
        'write bench = "...", a bench file (with a path relative to this file\'s folder) or an '
        "experiment (see 'bywire list')"
    ),
]


class StudyFile(Section):
    """A study file."""

    name: Name
    bench: BenchName
    vary: Table
    measured: MeasuredSection | None = None
    correlation: tuple[CorrelationSection, ...] = ()
    design: DesignSection = DesignSection()
    set: Table
    requirements: Table


def read_study(path: str | Path, overrides: Mapping[str, str] = MappingProxyType({})) -> StudyPlan:
    """Read a study file.

    Parameters
    ----------
    path
        TOML file with ``bench``, the section ``[vary]``, and optional sections ``[design]``,
        ``[[correlation]]``, ``[set]`` and ``[requirements]``; see ``docs/studies.md``.
    overrides
        Additional changes to the bench, which override those in ``[set]``.

    Raises
    ------
    FileError
        If the file cannot be read or is not valid TOML.
    InputError
        For any invalid entry, with the file's name in front.
    """
    file = Path(path)
    content = read_toml(file, "study file")
    try:
        require_kind(content, STUDY, file)
        return _plan(content, file, overrides)
    except InputError as error:
        raise error.reworded(f"{file}: {error}") from None


def _plan(content: Mapping[str, Any], file: Path, overrides: Mapping[str, str]) -> StudyPlan:
    _require_no_bench(content)
    study = StudyFile.read({"name": file.stem, **content}, "a study file")
    bench = read_bench(study.bench, study.set, file.parent, overrides)
    units = bench.definition.kpis_with(bench.chosen_options)
    texts = {**bench.requirements, **study.requirements}
    demands = tuple(read_limits(texts, units, has_probabilities=True).values())
    limits = {demand.figure: demand.text for demand in demands}
    bench = replace(bench, requirements=limits, name=bench.name or study.name)
    varied, measured = read_all_varied(bench, study.vary, study.measured, file.parent)
    if not varied:
        raise ParameterError(
            "[vary] is empty. Add a quantity that varies, such as \"motor.R_m\" = '+-10 %'",
            name="[vary]",
        )
    correlations = {**measured, **_read_correlations(study.correlation, varied, measured)}
    plan = StudyPlan(
        study.name,
        bench,
        _in_order(varied, correlations),
        demands=demands,
        correlations=correlations,
        tested=StudiedBench(study.bench, {**bench_file.flattened(study.set), **overrides}),
        **_read_design(study.design),
    )
    _require_agreement(plan)
    return plan


def _require_no_bench(content: Mapping[str, Any]) -> None:
    """Reject sections of a bench file, and explain where they belong."""
    keys = StudyFile.model_fields
    for key in content:
        if key in bench_file.SECTIONS and key not in keys:
            raise ParameterError(
                f"[{key}] belongs in the bench file, not in a study file. Move it there, or change "
                f'single values in [set], as "{key}.NAME" = "VALUE". A study file can contain '
                f"{', '.join(keys)}",
                name=f"[{key}]",
                valid=", ".join(keys),
            )


def read_bench(
    source: str, changes: Mapping[str, Any], folder: Path, overrides: Mapping[str, str]
) -> Bench:
    """Return a study file's bench with the changes in ``[set]`` and additional changes."""
    flat = bench_file.flattened(changes)
    for key, value in flat.items():
        if not isinstance(value, str):
            raise ParameterError(
                f"[set] {key} = {quoted(value)} is not valid: it must be a string with its unit, "
                f"as for {option('overrides')}",
                name=f"[set] {key}",
                value=quoted(value),
                valid="a string with its unit",
            )
    there = source if names_experiment(source) else folder / source
    kept = bench_file.without_replaced(flat, overrides, "simulation.")
    return bench_file.read(there, {**kept, **overrides})
