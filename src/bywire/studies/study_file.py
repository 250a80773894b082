"""Study files: TOML in, a plan out; nothing in them is executed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from bywire.bench import bench_file
from bywire.bench.bench import Bench
from bywire.bench.bench_source import names_experiment
from bywire.core.errors import InputError, ParameterError, quoted
from bywire.core.section import Hint, Name, Section, Table
from bywire.data.file_kinds import STUDY, require_kind
from bywire.data.toml_file import read_toml
from bywire.studies.correlation_section import CorrelationSection, in_order, read_correlations
from bywire.studies.demand_section import read_demands
from bywire.studies.design_rules import require_agreement
from bywire.studies.design_section import DesignSection, read_design
from bywire.studies.measured import MeasuredSection
from bywire.studies.plan import StudyPlan
from bywire.studies.studied_bench import StudiedBench
from bywire.studies.vary_section import read_all_varied

BenchName = Annotated[
    Name,
    Hint(
        'write bench = "...", a bench file (its path starts at this file\'s folder), or an '
        "experiment of 'bywire list'"
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
        require_kind(content, STUDY, file)
        return _plan(content, file, overrides)
    except InputError as error:
        raise type(error)(f"{file}: {error}") from None


def _plan(content: Mapping[str, Any], file: Path, overrides: Mapping[str, str]) -> StudyPlan:
    _require_no_bench(content)
    study = StudyFile.read({"name": file.stem, **content}, "a study file")
    bench = read_bench(study.bench, study.set, file.parent, overrides)
    demands = tuple(read_demands(bench, study.requirements))
    limits = {demand.figure: demand.text for demand in demands}
    bench = replace(bench, requirements=limits, name=bench.name or study.name)
    varied, measured = read_all_varied(bench, study.vary, study.measured, file.parent)
    if not varied:
        raise ParameterError("[vary] is empty: say what varies, such as \"motor.R_m\" = '+-10 %'")
    correlations = {**measured, **read_correlations(study.correlation, varied, measured)}
    plan = StudyPlan(
        study.name,
        bench,
        in_order(varied, correlations),
        demands=demands,
        correlations=correlations,
        tested=StudiedBench(study.bench, {**bench_file.flattened(study.set), **overrides}),
        **read_design(study.design),
    )
    require_agreement(plan)
    return plan


def _require_no_bench(content: Mapping[str, Any]) -> None:
    """Refuse sections of a bench, and say where they belong."""
    keys = StudyFile.model_fields
    for key in content:
        if key in bench_file.SECTIONS and key not in keys:
            raise ParameterError(
                f"[{key}] is of the bench, not of a study: write it into the bench file, or change "
                f'single values in [set], as "{key}.NAME" = "VALUE"; a study file has '
                f"{', '.join(keys)}"
            )


def read_bench(
    source: str, changes: Mapping[str, Any], folder: Path, overrides: Mapping[str, str]
) -> Bench:
    """Return the bench that a file names, with the changes of its ``[set]`` and further ones."""
    flat = bench_file.flattened(changes)
    for key, value in flat.items():
        if not isinstance(value, str):
            raise ParameterError(
                f"[set] {key} = {quoted(value)}: write the value as a text, "
                "with its unit, as --set takes it"
            )
    there = source if names_experiment(source) else folder / source
    return bench_file.read(there, {**flat, **overrides})
