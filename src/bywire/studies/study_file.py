"""Study files: TOML in, a plan out; nothing in them is executed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from bywire.bench import bench_file
from bywire.bench.bench import Bench
from bywire.bench.bench_source import names_experiment
from bywire.core.callers import option
from bywire.core.errors import InputError, ParameterError, quoted, unknown_of_few
from bywire.data.file_kinds import STUDY, require_kind
from bywire.data.toml_file import read_toml
from bywire.studies.correlation_section import in_order, read_correlations
from bywire.studies.demand_section import read_demands
from bywire.studies.design_rules import require_agreement
from bywire.studies.design_section import read_design
from bywire.studies.plan import StudyPlan
from bywire.studies.studied_bench import StudiedBench
from bywire.studies.vary_section import read_all_varied

_KEYS = ("name", "bench", "vary", "measured", "correlation", "design", "set", "requirements")


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
    _require_known(content)
    for key in ("vary", "measured", "design", "set", "requirements"):
        if not isinstance(content.get(key, {}), Mapping):
            raise ParameterError(f"[{key}] must be a section with key = value lines")
    name = content.get("name", file.stem)
    if not isinstance(name, str) or not name.strip():
        raise ParameterError(f"name = {quoted(name)}: a text is wanted")
    bench = read_bench(content, file.parent, overrides)
    demands = tuple(read_demands(bench, content.get("requirements", {})))
    limits = {demand.kpi: demand.limit for demand in demands}
    bench = replace(bench, requirements=limits, name=bench.name or name)
    varied, measured = read_all_varied(bench, content, file.parent)
    if not varied:
        raise ParameterError("[vary] is empty: say what varies, such as \"motor.R_m\" = '+-10 %'")
    said = {**measured, **read_correlations(content.get("correlation", []), varied, measured)}
    changes = {**bench_file.flattened(content.get("set", {})), **overrides}
    plan = StudyPlan(
        name,
        bench,
        in_order(varied, said),
        demands=demands,
        correlations=said,
        tested=StudiedBench(content["bench"], changes),
        **read_design(content.get("design", {})),
    )
    require_agreement(plan)
    return plan


def _require_known(content: Mapping[str, Any]) -> None:
    """Refuse what no study file has, and say where that of a bench belongs."""
    for key in content:
        if key in bench_file.SECTIONS and key not in _KEYS:
            raise ParameterError(
                f"[{key}] is of the bench, not of a study: write it into the bench file, or change "
                f'single values in [set], as "{key}.NAME" = "VALUE"; a study file has '
                f"{', '.join(_KEYS)}"
            )
        if key not in _KEYS:
            raise unknown_of_few("key of a study file", key, _KEYS)


def read_bench(content: Mapping[str, Any], folder: Path, overrides: Mapping[str, str]) -> Bench:
    """Return the bench that a file names, with the changes of its ``[set]`` and further ones."""
    source = content.get("bench")
    if not isinstance(source, str) or not source.strip():
        said = f"bench = {quoted(source)}" if "bench" in content else "bench is missing"
        raise ParameterError(
            f'{said}: write bench = "...", a bench file (its path starts at this file\'s folder), '
            "or an experiment of 'bywire list'"
        )
    changes = bench_file.flattened(content.get("set", {}))
    there = source if names_experiment(source) else folder / source
    for key, value in changes.items():
        if not isinstance(value, str):
            raise ParameterError(
                f"[set] {key} = {quoted(value)}: write the value as a text, "
                f"with its unit, as {option('overrides')} takes it"
            )
    return bench_file.read(there, {**changes, **overrides})
