"""Plan of a study: the bench, the variations, the design, and the requirements."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.bench.bench import Bench
from bywire.bench.computation import bench_identity
from bywire.bench.requirements import Limit
from bywire.cases.identity import as_json, digest_of
from bywire.core.errors import ParameterError
from bywire.core.parameters import leaf_fields
from bywire.core.typing import Array
from bywire.studies.designs import (
    MORRIS,
    RARE,
    SAMPLED,
    SENSITIVITY,
    SOUGHT,
    WORST,
    Sampled,
    SensitivityDesign,
    SoughtDesign,
    Spanned,
    library_version,
    spanned,
)
from bywire.studies.distribution import Distribution


@dataclass(frozen=True)
class StudiedBench:
    """Source of the bench of a study.

    Parameters
    ----------
    bench
        The bench file, as written in the study file, or the experiment.
    changes
        Changes by ``[set]`` and ``--set``, as texts by name.
    """

    bench: str
    changes: Mapping[str, str] = field(default_factory=dict)


# --- Correlations of the varied quantities' normal scores: a Gaussian copula


def correlation_factor(
    names: Sequence[str], correlations: Mapping[tuple[str, str], float]
) -> Array | None:
    """Return the Cholesky factor of a correlation matrix; None without correlations.

    Raises
    ------
    ParameterError
        If the matrix is not positive definite, so that no quantities can have these correlations.
    """
    if not correlations:
        return None
    matrix = np.eye(len(names))
    for (first, second), value in correlations.items():
        i, k = names.index(first), names.index(second)
        matrix[i, k] = matrix[k, i] = value
    try:
        return np.asarray(np.linalg.cholesky(matrix))
    except np.linalg.LinAlgError:
        least = float(np.linalg.eigvalsh(matrix)[0])
        told = "; ".join(f"{a}, {b}: {value:g}" for (a, b), value in correlations.items())
        raise ParameterError(
            f"[[correlation]] {told}: these correlations contradict each other. Their matrix is "
            f"not positive definite (smallest eigenvalue {least:.2g}). Use values closer to zero",
            name="[[correlation]]",
            value=told,
        ) from None


# --- The plan

CHUNK = 64
"""number of cases in a chunk, the unit in which a study computes, stores and counts cases"""


@dataclass(frozen=True)
class Varied:
    """A quantity that varies.

    Parameters
    ----------
    name
        Dotted name of a parameter or choice, or ``options.NAME``.
    unit
        SI unit; empty for a choice.
    nominal
        Value in the bench.
    distribution
        Its distribution.
    together
        Other parameters that vary with it at a constant ratio.
    """

    name: str
    unit: str
    nominal: Any
    distribution: Distribution
    together: tuple[str, ...] = ()


@dataclass(frozen=True)
class StudyPlan:
    """Content of a study file.

    Parameters
    ----------
    name
        Name in reports.
    bench
        The tested bench, which has the study's requirements.
    varied
        Quantities that vary.
    design
        One of `designs.SAMPLED`, `designs.SPANNED`, `designs.SENSITIVITY` or
        `designs.SOUGHT`.
    cases
        Requested number of cases; an upper limit for indices and for each rare failure. Other
        listed points are all computed.
    seed
        Seed of the points.
    demands
        Requirements.
    confidence
        Confidence of all intervals, between 0 and 1.
    levels
        Number of values of each quantity in a grid, or one at a time.
    time
        Limit of the computing time [s], each time that the study is run or resumed.
    cases_per_level
        Requested number of cases in each level of subset simulation.
    correlations
        Pairs of names -> correlation of their normal scores.
    tested
        Source of the bench, from the file; None for a plan without a file.
    """

    name: str
    bench: Bench
    varied: tuple[Varied, ...]
    design: str = "monte-carlo"
    cases: int = 1024
    seed: int = 1
    demands: tuple[Limit, ...] = ()
    confidence: float = 0.95
    levels: int = 5
    time: float = math.inf
    cases_per_level: int = 2560
    correlations: Mapping[tuple[str, str], float] = field(default_factory=dict)
    tested: StudiedBench | None = None

    @property
    def is_sampled(self) -> bool:
        """Whether fractions of its cases are probabilities."""
        return self.design in SAMPLED

    @cached_property
    def sensitivity(self) -> SensitivityDesign | None:
        """Design of its sensitivity indices; None for a study without indices."""
        if self.design not in SENSITIVITY:
            return None
        return SensitivityDesign(self.design, len(self.varied), self.cases, self.seed)

    @cached_property
    def sought(self) -> SoughtDesign | None:
        """Design whose cases depend on earlier ones; None for other studies."""
        if self.design not in SOUGHT:
            return None
        return SoughtDesign(
            self.design,
            len(self.judged_demands),
            self.cases_per_level,
            self.cases,
            self.seed,
            len(self.varied),
        )

    @property
    def judged_demands(self) -> tuple[Limit, ...]:
        """Judged requirements; for rare failures, those with a probability."""
        if self.design not in RARE:
            return self.demands
        return tuple(each for each in self.demands if each.probability is not None)

    @cached_property
    def scored(self) -> Sampled:
        """The quantities as functions of standard normal scores."""
        each = [v.distribution for v in self.varied]
        return Sampled(self.design, self.seed, each, self._factor)

    @cached_property
    def points(self) -> Sampled | Spanned:
        """The points of the design."""
        each = [v.distribution for v in self.varied]
        if self.sensitivity is not None:
            return Spanned(self.sensitivity.columns(each))
        if self.is_sampled or self.sought is not None:
            return self.scored
        return spanned(self.design, each, [v.nominal for v in self.varied], self.levels)

    @property
    def chunks(self) -> int:
        """Number of chunks; chunks of sampled points are complete."""
        points = self.points
        cases = points.cases if isinstance(points, Spanned) else self.cases
        return -(-cases // CHUNK)

    @property
    def total(self) -> int:
        """Number of cases; for each rare failure, an upper limit."""
        if self.sought is not None:
            return self.cases
        points = self.points
        return points.cases if isinstance(points, Spanned) else self.chunks * CHUNK

    @cached_property
    def units(self) -> Mapping[str, str]:
        """SI unit of every number that varies, including proportional ones, by name."""
        leaves = leaf_fields(type(self.bench.par))
        units = {v.name: v.unit for v in self.varied if v.unit}
        return units | {name: leaves[name].unit.symbol for v in self.varied for name in v.together}

    @cached_property
    def column_units(self) -> Mapping[str, str]:
        """Unit of every number of a case: varied quantities and key figures."""
        return {**self.units, **self.bench.definition.kpis_with(self.bench.chosen_options)}

    def values(self, chunk: int) -> dict[str, NDArray[Any]]:
        """Return the values of the varied quantities, by name, in each case of a chunk [SI].

        Parameters listed in ``together`` follow at a constant ratio.
        """
        return self._named(self.points.values(chunk, CHUNK))

    def values_at(self, scores: Array) -> dict[str, NDArray[Any]]:
        """Return the values of the varied quantities, by name, for the scores of a search [SI].

        Parameters
        ----------
        scores
            Independent standard normal scores, shape (cases, quantities); in a worst-case search,
            positions between the ends, 0 to 1.
        """
        if self.design == WORST:
            return self._named(
                [
                    v.distribution.between(column)
                    for v, column in zip(self.varied, scores.T, strict=True)
                ]
            )
        return self._named(self.scored.values_at(scores))

    def _named(self, values: Sequence[NDArray[Any]]) -> dict[str, NDArray[Any]]:
        columns: dict[str, NDArray[Any]] = {}
        flat = self.bench.par.flat()
        for each, column in zip(self.varied, values, strict=True):
            columns[each.name] = column
            columns |= {
                follower: flat[follower] * (column.astype(float) / each.nominal)
                for follower in each.together
            }
        return columns

    @cached_property
    def _factor(self) -> Array | None:
        return correlation_factor([v.name for v in self.varied], self.correlations)

    @property
    def _choices(self) -> Iterator[dict[str, str]]:
        """Choices of the cases, one at a time, since each has its own equations."""
        for varied in self.varied:
            for value in varied.distribution.singles:
                if isinstance(value, str):
                    yield {varied.name: value}

    @property
    def digest(self) -> str:
        """Digest that identifies the study."""
        return digest_of(self.identity)

    @cached_property
    def identity(self) -> Mapping[str, Any]:
        """Everything that affects the figures of its cases."""
        bench = self.bench
        identity: dict[str, Any] = {
            **bench_identity(bench, self._choices),
            "order": [v.name for v in self.varied],
            "varied": {
                v.name: [
                    v.distribution.text,
                    v.together,
                    v.distribution.quantile(np.linspace(0.01, 0.99, 9)).tolist(),
                ]
                for v in self.varied
            },
            "correlation": {" and ".join(pair): r for pair, r in self.correlations.items()},
            "design": self.design,
            "seed": self.seed,
            "chunk": CHUNK,
            "levels": 0 if self.is_sampled else self.levels,
        }
        if self.sensitivity is not None:
            # Indices use all groups together. The identity includes the points, since a library
            # draws them.
            identity["groups"] = self.sensitivity.base
            points = self.sensitivity.probabilities.tobytes()
            identity["points"] = hashlib.sha256(points).hexdigest()
            if self.design == MORRIS and any(v.distribution.is_discrete for v in self.varied):
                identity["single values"] = "in turn"
        if self.sought is not None:
            # The search depends on the requirements, and on the library's random numbers.
            identity["points"] = library_version(self.design)
            identity["cases_per_level"] = self.sought.level
            identity["requirements"] = {each.figure: each.text for each in self.judged_demands}
        return as_json(identity)
