"""Life files and their plan: a brake's wear, its stops, and the steps of the projection."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from bywire.bench import bench_file
from bywire.bench.bench import Bench
from bywire.bench.step_choice import spread_over, with_chosen_step
from bywire.core.callers import option
from bywire.core.errors import InputError, ParameterError, not_valid, quoted, unknown_name
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.quantities import Unit
from bywire.core.section import Hint, Section, Table
from bywire.core.typing import Progress
from bywire.core.values import parsed, require_units
from bywire.data.toml_file import LIFE, read_toml, require_kind
from bywire.life.declaration import LIVES, Life, StopConditions
from bywire.studies.designs import Sampled
from bywire.studies.distribution import read_distribution
from bywire.studies.plan import Varied
from bywire.studies.vary_section import entries_of, quantities_of, read_varied

CONDITION = "stop."
"""prefix of the names of a stop's conditions"""


@dataclass(frozen=True)
class LifePlan:
    """Content of a life file.

    Parameters
    ----------
    name
        Name in reports.
    life
        Wear of the brake.
    bench
        A stop of the new brake.
    wear
        Wear parameters.
    conditions
        Conditions of a stop without variation.
    varied
        Variations of the stops: numbers of the bench, options, and conditions named ``stop.NAME``.
    stops
        Number of stops that represent the population, simulated for each set of slow states.
    seed
        Seed of their sample.
    share
        Maximum fraction of the remaining stops in one step, 0 to 1.
    tolerance
        Maximum relative error of a rate within a step.
    longest
        Number of stops after which the projection ends.
    known
        Results so far, by the bench parameters that depend on slow states.
    """

    name: str
    life: Life
    bench: Bench
    wear: ParameterSet
    conditions: StopConditions
    varied: tuple[Varied, ...] = ()
    stops: int = 20
    seed: int = 1
    share: float = 0.05
    tolerance: float = 2e-2
    longest: int = 200_000
    known: dict[Any, Any] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def population(self) -> Mapping[str, NDArray[Any]]:
        """The stops: varied values by name [SI], shape (stops,); empty if all stops are equal."""
        if not self.varied:
            return {}
        laws = [each.distribution for each in self.varied]
        drawn = Sampled("latin-hypercube", self.seed, laws).values(0, self.stops)
        return {each.name: v for each, v in zip(self.varied, drawn, strict=True)}

    def with_step(self, progress: Progress | None = None) -> LifePlan:
        """Return the plan with the step for the error that its bench states, if it states one.

        The stops of the new brake decide.

        Raises
        ------
        StepError
            When no step meets the error.
        RunError
            When the bench fails.
        """
        stops = [
            {n: v[k].item() for n, v in self.population.items() if not n.startswith(CONDITION)}
            for k in self.different[0]
        ]
        bench = with_chosen_step(self.bench, spread_over(stops), progress)
        return self if bench is self.bench else replace(self, bench=bench)

    @property
    def count(self) -> int:
        """Number of stops that represent the population."""
        return self.stops if self.varied else 1

    @cached_property
    def different(self) -> tuple[list[int], NDArray[np.intp]]:
        """The stops with different benches, and for each stop in the population its index in them.

        Stops that differ only in their conditions are simulated once.
        """
        rows = [
            tuple(
                values[k].item()
                for name, values in self.population.items()
                if not name.startswith(CONDITION)
            )
            for k in range(self.count)
        ]
        first: dict[tuple[Any, ...], int] = {}
        for k, row in enumerate(rows):
            first.setdefault(row, k)
        places = {k: place for place, k in enumerate(first.values())}
        return list(places), np.array([places[first[row]] for row in rows])


# --- Life files: TOML in, a plan out; nothing in them is executed

WEAR = "wear."
"""prefix of the names of wear parameters"""
_MOST = 4096  # stops that represent a population
CONDITIONS = StopConditions(pause=600.0, T_air=293.15)
"""a stop every ten minutes at 20 degC"""


class ProjectionSection(Section):
    """The section ``[projection]``; omitted keys have the defaults of `LifePlan`."""

    stops: Annotated[int | None, Field(ge=2, le=_MOST)] = None
    seed: Annotated[int | None, Field(ge=0, le=2**63 - 1)] = None
    longest: Annotated[int | None, Field(ge=1, le=1_000_000)] = None
    share: Annotated[float | None, Unit("1"), Field(ge=0.001, le=0.5)] = None
    tolerance: Annotated[float | None, Unit("1"), Field(ge=1e-6, le=0.5)] = None


class LifeFile(Section):
    """A life file."""

    name: str
    life: Annotated[str, Hint("write life = \"...\" (see 'bywire list lives')")]
    set: Table
    vary: Mapping[str, Any] | None = None
    projection: ProjectionSection = ProjectionSection()


def read_life(source: str | Path, overrides: Mapping[str, str] = MappingProxyType({})) -> LifePlan:
    """Read a life file.

    Parameters
    ----------
    source
        TOML file with ``life`` and optional sections ``[set]``, ``[vary]`` and ``[projection]``
        (see ``docs/life.md``), or the name of a life, with its declared population of stops.
    overrides
        Additional changes, which override those in ``[set]``.

    Raises
    ------
    FileError
        If the file cannot be read or is not valid TOML.
    InputError
        For any invalid entry, with the file's name in front.
    """
    file = Path(source)
    is_name = file.suffix != ".toml" and not file.is_file()
    content = {"life": str(source)} if is_name else read_toml(file, "life file")
    try:
        require_kind(content, LIFE, file)
        return _plan(content, file.stem, overrides)
    except InputError as error:
        if is_name:
            raise
        raise error.reworded(f"{file}: {error}") from None


def _plan(content: Mapping[str, Any], name: str, overrides: Mapping[str, str]) -> LifePlan:
    file = LifeFile.read({"name": name, **content}, "a life file")
    life = LIVES.find(file.life)
    changes = _texts(bench_file.flattened(file.set)) | dict(overrides)
    of_bench = {k: v for k, v in changes.items() if not _is_of_life(k)}
    settings = bench_file.without_replaced(life.settings, of_bench, "simulation.")
    bench = bench_file.read(life.experiment, {**settings, **of_bench})
    conditions = CONDITIONS.replace(_given(StopConditions, changes, CONDITION))
    wear = life.defaults().replace(_given(life.wear, changes, WEAR))
    population = {k: v for k, v in life.population.items() if k not in changes}
    varied = tuple(_varied(bench, conditions, population if file.vary is None else file.vary))
    _require_free(life, bench, wear, varied)
    return LifePlan(
        file.name,
        life,
        bench,
        wear,
        conditions,
        varied,
        **file.projection.given,
    )


def _is_of_life(name: str) -> bool:
    return name.startswith((WEAR, CONDITION))


def _texts(changes: Mapping[str, Any]) -> dict[str, str]:
    for key, value in changes.items():
        if not isinstance(value, str):
            valid = f"a string with its unit, in the form of {option('overrides')}"
            raise not_valid(f"[set] {key}", quoted(value), valid)
    return dict(changes)


def _given(kind: type[ParameterSet], changes: Mapping[str, str], prefix: str) -> dict[str, Any]:
    """Return the changes to a parameter set whose names begin with a prefix [SI]."""
    named = {k.removeprefix(prefix): v for k, v in changes.items() if k.startswith(prefix)}
    require_units(kind, named)
    return parsed(kind, named, f"name after {prefix!r}")


def _varied(bench: Bench, conditions: StopConditions, section: Mapping[str, Any]) -> list[Varied]:
    """Return the variations of the bench, and of the conditions of its stops."""
    leaves = {f"{CONDITION}{k}": leaf for k, leaf in leaf_fields(StopConditions).items()}
    each = entries_of(section, {*quantities_of(bench), *leaves})
    of_bench = {name: entry for name, entry in each.items() if not name.startswith(CONDITION)}
    varied = list(read_varied(bench, of_bench))
    for name, entry in each.items():
        if name in of_bench:
            continue
        if name not in leaves:
            raise unknown_name("condition of a stop", name, leaves)
        nominal = float(conditions.value(name.removeprefix(CONDITION)))
        law = read_distribution(name, entry, leaves[name], nominal)
        varied.append(Varied(name, leaves[name].unit.symbol, nominal, law))
    return varied


def _require_free(life: Life, bench: Bench, wear: ParameterSet, varied: tuple[Varied, ...]) -> None:
    """Reject variations of numbers that depend on slow states."""
    slow = life.follows(life.begin(bench.par, wear), bench.par, wear)
    for each in varied:
        if not each.unit:
            name = f"[vary] {each.name}"
            raise ParameterError(f"{name} is a choice, but only numbers can vary", name=name)
        for name in (each.name, *each.together):
            if name in slow:
                raise ParameterError(
                    f"[vary] {name} depends on wear, so it cannot vary. To change its initial "
                    "value, use [set]",
                    name=f"[vary] {name}",
                )
