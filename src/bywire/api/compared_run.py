"""One side of a comparison: a bench that was run just now or earlier, and how it was set."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from bywire.bench.bench_file import flattened
from bywire.bench.changes import OPTION
from bywire.bench.experiment import Experiment
from bywire.bench.generic_experiment import experiment_of
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Verdict
from bywire.bench.result_folder import read_result
from bywire.bench.running import Result
from bywire.bench.stimulus import STIMULI
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import InputError
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.report.document import Change
from bywire.report.subject import bench_changes

_BENCH = {
    "experiment": "experiment",
    "parameter_set": "parameters",
    "model": "assembly",
    "step": "simulation.step",
    "seed": "simulation.seed",
}
"""attributes of a recording that bench files set, by what they call them"""
_PROGRAM = ("bywire_version", "engine")


@dataclass(frozen=True)
class Setting:
    """What a bench was set to: a value in an SI unit, or a choice."""

    value: Any
    unit: str = "1"


@dataclass(frozen=True)
class ComparedRun:
    """A bench that was run.

    Parameters
    ----------
    label
        What the comparison calls it.
    source
        Where it comes from: a folder, a bench file, an experiment.
    recordings
        One dataset per run of the experiment, by label.
    kpis, verdicts
        Key figures, and the requirements beside them.
    warnings
        What its run warned of.
    changes
        What of it was changed.
    """

    label: str
    source: str
    recordings: Mapping[str, xr.Dataset]
    kpis: tuple[Kpi, ...]
    verdicts: tuple[Verdict, ...]
    warnings: tuple[str, ...] = ()
    changes: tuple[Change, ...] = ()

    @cached_property
    def attributes(self) -> Mapping[str, Any]:
        """What the first recording says of how it was made, as plain numbers and texts."""
        said = next(iter(self.recordings.values())).attrs
        return {key: v.item() if isinstance(v, np.generic) else v for key, v in said.items()}

    @property
    def model(self) -> str:
        """Name of the assembly that was tested."""
        return str(self.attributes.get("model", ""))

    @cached_property
    def definition(self) -> Experiment | None:
        """The experiment; None where this installation does not know it."""
        said = self.attributes
        name, cited, model = (
            str(said.get(k, "")) for k in ("experiment", "parameter_set", "model")
        )
        with contextlib.suppress(InputError):
            return experiment_of(name, cited, model, flattened(_object(said, "options")))
        return None

    @cached_property
    def options(self) -> Any:
        """The options of the experiment; None where they cannot be read."""
        if self.definition is None:
            return None
        with contextlib.suppress(InputError):
            return self.definition.options.create(_tupled(_object(self.attributes, "options")))
        return None

    @cached_property
    def settings(self) -> dict[str, Setting]:
        """Everything that was set, by the names that ``--set`` takes."""
        said = self.attributes
        settings = {
            name: Setting(said[key], "s" if key == "step" else "1")
            for key, name in _BENCH.items()
            if key in said
        }
        options = None if self.definition is None else self.definition.options
        settings |= dict(_settings(_object(said, "options"), options, OPTION))
        settings |= dict(self._stimuli())
        settings |= dict(_settings(_object(said, "parameters"), self._parameter_class))
        return settings | {key: Setting(said[key]) for key in _PROGRAM if key in said}

    @property
    def has_units(self) -> bool:
        """Whether the units of its parameters are known: its parameter set is installed."""
        return self._parameter_class is not None

    @property
    def _parameter_class(self) -> type[ParameterSet] | None:
        name = str(self.attributes.get("parameter_set", ""))
        cited = PARAMETER_SETS.all().get(name)
        return None if cited is None else cited.parameter_class

    def _stimuli(self) -> Iterator[tuple[str, Setting]]:
        """Yield what ``[stimulus]`` and its further sections were set to."""
        sections = _object(self.attributes, "stimulus")
        further = {name: each for name, each in sections.items() if isinstance(each, Mapping)}
        plain = {name: each for name, each in sections.items() if name not in further}
        units: dict[str, str] = {}
        if self.definition is not None and self.options is not None:
            known = self.definition
            units = dict(known.beside(self.options)) if known.beside is not None else {}
            if known.driven_unit is not None:
                units[""] = known.driven_unit(self.options)
        for signal, section in {"": plain, **further}.items():
            kind = STIMULI.all().get(str(section.get("kind", "")))
            prefix = f"stimulus.{signal}." if signal else "stimulus."
            cls = None if kind is None else kind.parameter_class
            yield from _settings(section, cls, prefix, units.get(signal, "1"))


def ran(result: Result, label: str, source: str) -> ComparedRun:
    """Return a bench that was run just now."""
    warned = tuple(result.warnings)
    return ComparedRun(
        label,
        source,
        result.recordings,
        result.kpis,
        result.verdicts,
        warned,
        bench_changes(result.bench),
    )


def kept(folder: Path) -> ComparedRun:
    """Return what a result folder holds.

    Raises
    ------
    FileError
        As `read_result`.
    """
    result = read_result(folder)
    name = folder.resolve().name
    changes = tuple(
        Change(changed, each["value"], each["instead_of"], each["of"])
        for changed, each in result.changes.items()
    )
    return ComparedRun(
        name, str(folder), result.recordings, result.kpis, result.verdicts, result.warnings, changes
    )


def _settings(
    values: Mapping[str, Any], cls: type[ParameterSet] | None, prefix: str = "", level: str = "1"
) -> Iterator[tuple[str, Setting]]:
    leaves = {} if cls is None else leaf_fields(cls)
    for name, value in _tupled(values).items():
        unit = leaves[name].unit.symbol if name in leaves else "1"
        yield f"{prefix}{name}", Setting(value, unit.replace("level", level))


def _tupled(values: Mapping[str, Any]) -> dict[str, Any]:
    flat = flattened(values)
    return {name: tuple(v) if isinstance(v, list) else v for name, v in flat.items()}


def _object(said: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Return an attribute that holds a JSON object; an empty one where there is none."""
    with contextlib.suppress(ValueError):
        content = json.loads(str(said.get(key, "{}")))
        return content if isinstance(content, dict) else {}
    return {}
