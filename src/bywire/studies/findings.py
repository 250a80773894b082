"""What a study found: its requirements judged, its key figures' spread, and what drives them."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Limit
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.typing import Array
from bywire.studies.choice_influence import ChoiceInfluence, choice_influence
from bywire.studies.chunk import CASE, FAILURE, WARNINGS
from bywire.studies.effects import ONE, Effect, effects
from bywire.studies.judgment import Judgment, judgment_of
from bywire.studies.plan import StudyPlan
from bywire.studies.rare_failures import RareFailure
from bywire.studies.sensitivity import Sensitivity, sensitivity
from bywire.studies.spread import Spread, spread_of
from bywire.studies.statistics import Influence, influences
from bywire.studies.worst_case import WorstCase

if TYPE_CHECKING:
    import pandas as pd

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True, repr=False)
class Findings:
    """The cases of a study, and what they say.

    Parameters
    ----------
    plan
        The study.
    cases
        A row for each case that was computed; see `bywire.studies.chunk.computed_chunk`.
    nominal
        Key figures of the bench itself, with their error from the step.
    rare
        What a study of rare failures found; of another, nothing.
    searches
        How searches for the worst case of each requirement ended; of another study, nothing.
    """

    plan: StudyPlan
    cases: pd.DataFrame
    nominal: tuple[Kpi, ...]
    rare: tuple[RareFailure, ...] = ()
    searches: tuple[WorstCase, ...] = ()

    def __repr__(self) -> str:
        return f"<Findings of {self.plan.name}: {len(self.cases)} cases>"

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Unit of every key figure by name."""
        bench = self.plan.bench
        return bench.definition.kpis_with(bench.chosen_options)

    def figure(self, name: str) -> Array:
        """Return a key figure of every case in its unit, shape (cases,); NaN where one has it not.

        Raises
        ------
        UnknownNameError
            For a figure that the study does not have.
        """
        self._require(name)
        return np.asarray(self.cases[name], dtype=float)

    def size(self, name: str) -> float:
        """Return the largest magnitude of a key figure in any case; 0 where none has it."""
        self._require(name)
        return self._sizes.get(name, 0.0)

    @cached_property
    def _sizes(self) -> Mapping[str, float]:
        """Largest magnitude of every key figure: every cell of a table asks for it."""
        return {s.name: max(abs(s.least), abs(s.largest)) for s in self.spreads}

    @cached_property
    def judgments(self) -> tuple[Judgment, ...]:
        """Every requirement, in the order of the file."""
        if self.rare:
            return tuple(map(self._rare_judgment, self.rare))
        return tuple(map(self._judgment, self.plan.demands))

    @cached_property
    def spreads(self) -> tuple[Spread, ...]:
        """Every key figure that any case has."""
        nominal = {kpi.name: kpi.value for kpi in self.nominal}
        return tuple(
            spread_of(
                name, unit, nominal.get(name, math.nan), self.figure(name), self.plan.confidence
            )
            for name, unit in (self.units if len(self.cases) else {}).items()
            if np.isfinite(self.figure(name)).any()
        )

    def influences(self, name: str) -> Sequence[Influence | ChoiceInfluence]:
        """Return how a key figure goes with what varies, the strongest first.

        Choices, which have no order, stand by their correlation ratio among sizes of rank
        correlations.
        """
        known, plan = self._influences, self.plan
        if name not in known:
            varied = [v.name for v in plan.varied if v.unit]
            columns = [np.asarray(self.cases[each], dtype=float) for each in varied]
            figure, confidence = self.figure(name), plan.confidence
            found: list[Influence | ChoiceInfluence] = [
                *influences(varied, columns, figure, confidence, bool(plan.correlations))
            ]
            for v in plan.varied:
                if not v.unit and (
                    each := choice_influence(v.name, self.cases[v.name], figure, confidence)
                ):
                    found.append(each)
            known[name] = sorted(found, key=lambda each: -each.strength)
        return known[name]

    def sensitivity(self, name: str) -> Sensitivity:
        """Return the indices of a key figure, in a study whose design is made for them.

        Raises
        ------
        UnknownNameError
            For a figure that the study does not have.
        ParameterError
            Of another design.
        """
        self._require(name)
        known, design = self._sensitivities, self.plan.sensitivity
        if design is None:
            raise ParameterError(
                f"a study of {self.plan.design!r} has no indices: 'sobol-indices' and 'morris' have"
            )
        if name not in known:
            names = [v.name for v in self.plan.varied]
            singles = [v.name for v in self.plan.varied if v.distribution.is_discrete]
            known[name] = sensitivity(
                design, names, singles, self.figure(name), self.plan.confidence
            )
        return known[name]

    def effects(self, name: str) -> Sequence[Effect]:
        """Return what each quantity alone does to a key figure, where the design shows that."""
        self._require(name)
        if self.plan.design != ONE or not len(self.cases):
            return []
        columns = [self.cases[v.name].tolist() for v in self.plan.varied]
        return effects(self.plan.varied, self.plan.levels, columns, self.figure(name))

    def drivers(self, name: str) -> Sequence[str]:
        """Return the quantities that a key figure goes with, the strongest first.

        By importance, by indices, by what each does alone, or by the size of rank correlations and
        correlation ratios.
        """
        if self.rare:
            return [
                i.quantity
                for each in self.rare
                if each.demand.figure == name
                for i in each.importance
            ]
        if self.plan.sensitivity is not None:
            return [each.quantity for each in self.sensitivity(name).drivers]
        if self.plan.design == ONE:
            return [each.quantity for each in self.effects(name) if each.swing or each.lacking]
        return [each.quantity for each in self.influences(name) if each.strength]

    @cached_property
    def failures(self) -> Mapping[int, str]:
        """Row -> why the case has no result."""
        texts = self._texts(FAILURE)
        return {k: texts[k] for k in np.flatnonzero(self._failed).tolist()}

    @cached_property
    def _failed(self) -> NDArray[np.bool_]:
        """Whether each case has no result, shape (cases,): texts of a million are told once."""
        return np.asarray(self._texts(FAILURE) != "")

    @property
    def reasons(self) -> Mapping[str, Sequence[int]]:
        """Why cases have no result -> their rows; what differs in its numbers alone, once."""
        said: dict[str, list[int]] = {}
        for row, text in self.failures.items():
            said.setdefault(_NUMBER.sub("#", text), []).append(row)
        return {self.failures[rows[0]]: rows for rows in said.values()}

    @cached_property
    def warnings(self) -> Mapping[str, int]:
        """What runs warned of -> in how many cases; what differs in its numbers alone, once."""
        said: dict[str, Counter[str]] = {}
        for text, cases in Counter(self._texts(WARNINGS).tolist()).items():
            for each in filter(None, text.split("; ")):
                said.setdefault(_NUMBER.sub("#", each), Counter())[each] += cases
        return {
            next(iter(each)) + ", and so on" * (len(each) > 1): each.total()
            for each in said.values()
        }

    def _require(self, name: str) -> None:
        if name not in self.units:
            raise unknown_name("key figure", str(name), self.units)

    def _texts(self, column: str) -> NDArray[np.object_]:
        """Return a text of every case, shape (cases,); pandas would be slow to hand over each."""
        return np.asarray(self.cases[column] if len(self.cases) else (), dtype=object)

    def number(self, row: int) -> int:
        """Return the number of a case by its row."""
        return int(self.cases[CASE].iloc[row])

    def values(self, row: int) -> dict[str, float | str]:
        """Return what varied in a case [SI]."""
        names = [name for v in self.plan.varied for name in (v.name, *v.together)]
        return {name: self.cases[name].iloc[row] for name in names}

    @cached_property
    def _sensitivities(self) -> dict[str, Sensitivity]:
        """Indices by key figure, as they were asked for: those of many cases take a second."""
        return {}

    @cached_property
    def _influences(self) -> dict[str, Sequence[Influence | ChoiceInfluence]]:
        """Influences by key figure, likewise."""
        return {}

    def _rare_judgment(self, rare: RareFailure) -> Judgment:
        """Return a requirement of which shares of the cases say nothing."""
        among, wanted = self._judgment(rare.demand), rare.demand.probability
        assert wanted is not None
        numbers, error = np.asarray(self.cases[CASE]), self._error(rare.demand.figure)
        return replace(
            among,
            outcome=rare.failure.outcome(wanted, error),
            worst=None if rare.case is None else int(np.flatnonzero(numbers == rare.case)[0]),
            failure=replace(rare.failure, estimate=rare.failure.within(error)),
        )

    def _error(self, name: str) -> float:
        """Return what a key figure may be off by, in its unit; nothing where that is not known."""
        error = {kpi.name: kpi.bound for kpi in self.nominal}.get(name, math.nan)
        return 0.0 if math.isnan(error) else error

    def is_close(self, demand: Limit) -> NDArray[np.bool_]:
        """Return which cases are no further from a limit than their figure may be off."""
        return demand.is_near(self.figure(demand.figure), self._error(demand.figure))

    def _judgment(self, demand: Limit) -> Judgment:
        figure, error = self.figure(demand.figure), self._error(demand.figure)
        return judgment_of(demand, figure, self._failed, error, self.plan.confidence)
