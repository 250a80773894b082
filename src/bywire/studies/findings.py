"""Findings of a study: judged requirements, spread of key figures, and their drivers."""

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
from scipy import special

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Limit
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.typing import Array
from bywire.studies.distribution import ranked
from bywire.studies.plan import StudyPlan, Varied
from bywire.studies.sensitivity import Sensitivity, sensitivity
from bywire.studies.sought_cases import RareFailure, WorstCase
from bywire.studies.statistics import (
    FailureProbability,
    Influence,
    Outcome,
    Share,
    Spread,
    influences,
    judged,
    share,
    spread_of,
)
from bywire.studies.store import CASE, FAILURE, WARNINGS, warnings_in

if TYPE_CHECKING:
    import pandas as pd

ONE = "one-at-a-time"
"""the design that shows the effect of each quantity alone"""


@dataclass(frozen=True)
class Effect:
    """Effect of one quantity on a key figure.

    Parameters
    ----------
    quantity, unit
        Its name and SI unit; a choice has no unit.
    values
        Its values [SI], or the choices, in the order of the cases, shape (levels,).
    figures
        The key figure at each value, NaN if it is not defined, shape (levels,).
    nominal
        The key figure of the bench itself.
    """

    quantity: str
    unit: str
    values: Sequence[float | str]
    figures: Array
    nominal: float

    @property
    def least(self) -> float:
        """Minimum of the key figure, including that of the bench itself."""
        return float(np.nanmin([*self.figures, self.nominal]))

    @property
    def largest(self) -> float:
        """Maximum of the key figure, including that of the bench itself."""
        return float(np.nanmax([*self.figures, self.nominal]))

    @property
    def swing(self) -> float:
        """Maximum minus minimum."""
        return self.largest - self.least

    @property
    def lacking(self) -> int:
        """Number of levels at which the key figure is not defined."""
        return int(np.count_nonzero(~np.isfinite(self.figures)))


def effects(
    varied: Sequence[Varied], levels: int, columns: Sequence[Sequence[float | str]], figure: Array
) -> list[Effect]:
    """Return the effect of each quantity on a key figure, the largest swing first.

    Quantities with undefined key figures come before all others.

    Parameters
    ----------
    varied, levels
        Quantities that vary, and their number of values; discrete quantities use their own values.
    columns
        Values of each quantity in every case, starting with the bench itself.
    figure
        The key figure in every case; cases that are not computed yet are missing at the end.
    """
    found: list[Effect] = []
    begin = 1
    for each, column in zip(varied, columns, strict=True):
        end = begin + len(each.distribution.levels(levels))
        figures = figure[begin:end]
        if figures.size == end - begin and np.isfinite([figure[0], *figures]).any():
            found.append(
                Effect(each.name, each.unit, list(column[begin:end]), figures, float(figure[0]))
            )
        begin = end
    return sorted(found, key=lambda effect: (-effect.lacking, -effect.swing))


# --- Relation of a key figure to a choice, which has no order


@dataclass(frozen=True)
class ChoiceInfluence:
    """Relation of a key figure to a choice that varies.

    Parameters
    ----------
    quantity
        Its name.
    correlation_ratio
        0 to 1, on the scale of rank correlations; it has no sign.
    is_distinct
        Whether it differs significantly from zero.
    """

    quantity: str
    correlation_ratio: float
    is_distinct: bool

    @property
    def strength(self) -> float:
        """Strength of the relation, 0 to 1."""
        return self.correlation_ratio


def choice_influence(
    quantity: str, choices: Sequence[str], figure: Array, confidence: float
) -> ChoiceInfluence | None:
    """Return the relation of a key figure to a choice; None if either does not vary.

    The square of the ratio is the fraction of the ranks' variance between the choices, minus the
    part due to chance (T. L. Kelley, An unbiased correlation ratio measure, Proc. Natl. Acad. Sci.
    21, 1935). With two choices and without this correction, the ratio is the magnitude of the rank
    correlation. A rank test decides whether it differs from zero (W. H. Kruskal and W. A. Wallis,
    Use of ranks in one-criterion variance analysis, J. Am. Stat. Assoc. 47, 1952). An interval
    would require the distribution of the figure.

    Parameters
    ----------
    quantity, choices
        Its name, and the choice of each case.
    figure
        The key figure in each case, shape (cases,); cases without the figure do not count.
    confidence
        Confidence of the test, between 0 and 1.
    """
    known = np.isfinite(figure)
    y = ranked(figure[known])
    _, group = np.unique(np.asarray(choices, dtype=str)[known], return_inverse=True)
    counts = np.bincount(group)
    if counts.size < 2 or y.size - counts.size < 1 or np.ptp(y) == 0.0:
        return None
    within = y - (np.bincount(group, y) / counts)[group]
    rest = float(np.sum(within**2) / np.sum((y - y.mean()) ** 2))
    ratio = math.sqrt(max(0.0, 1.0 - rest * (y.size - 1) / (y.size - counts.size)))
    by_chance = float(special.chdtrc(counts.size - 1, (y.size - 1) * (1.0 - rest)))
    return ChoiceInfluence(quantity, ratio, by_chance < 1.0 - confidence)


# --- Requirements judged over the cases


@dataclass(frozen=True)
class Judgment:
    """A requirement over all cases.

    Parameters
    ----------
    demand
        The requirement.
    met
        Whether each case meets it, shape (cases,); a case without a result does not.
    share
        Fraction of cases that meet it, with the interval of the probability. Cases too close to the
        limit count for neither side.
    undecided
        Number of cases closer to the limit than the numerical error of their figure.
    outcome
        Whether it is met with the required probability, or in all cases without a probability.
    worst
        Row of the worst case, or of the most probable failure in a study of rare failures. A case
        without the figure is the worst. None if no case ran, or all cases are equal.
    failure
        Probability that the requirement is missed, in a study of rare failures, where fractions of
        cases are not probabilities.
    """

    demand: Limit
    met: NDArray[np.bool_]
    share: Share
    undecided: int
    outcome: Outcome
    worst: int | None
    failure: FailureProbability | None = None


def judgment_of(
    demand: Limit,
    figure: Array,
    failed: NDArray[np.bool_],
    error: float,
    confidence: float,
) -> Judgment:
    """Return a requirement judged over all cases.

    Parameters
    ----------
    demand
        The requirement.
    figure
        Its key figure in every case, shape (cases,); NaN if a case does not have it.
    failed
        Whether a case has no result, shape (cases,).
    error
        Numerical error of the figure, in its unit: cases closer to the limit count for neither
        side.
    confidence
        Confidence of the interval, between 0 and 1.
    """
    met, near = demand.is_met(figure), demand.is_near(figure, error)
    count = figure.size
    may, surely = (share(int(each.sum()), count, confidence) for each in (met | near, met & ~near))
    if demand.probability is not None:
        outcome = judged(may, surely, demand.probability)
    elif may.count < count:
        outcome = "missed"
    else:
        outcome = "met" if surely.count == count else "undecided"
    told = replace(share(int(met.sum()), count, confidence), low=surely.low, high=may.high)
    worst = _worst(figure, failed, demand.is_upper)
    return Judgment(demand, met, told, int(near.sum()), outcome, worst)


def _worst(figure: Array, failed: NDArray[np.bool_], is_upper: bool) -> int | None:
    """Return the row of the worst case by an upper or a lower limit."""
    known = np.isfinite(figure)
    lacking = np.flatnonzero(~known & ~failed)
    if lacking.size:
        return int(lacking[0])
    if not known.any() or (known.sum() > 1 and np.ptp(figure[known]) == 0.0):
        return None  # all cases are equal, so none is the worst
    return int(np.argmin(np.where(known, -figure if is_upper else figure, np.inf)))


# --- All findings

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True, repr=False)
class Findings:
    """The cases of a study, and their evaluation.

    Parameters
    ----------
    plan
        The study.
    cases
        One row for each computed case; see `bywire.studies.store.computed_chunk`.
    nominal
        Key figures of the bench itself, with their numerical error.
    rare
        Results of a study of rare failures; empty for other studies.
    searches
        Results of the searches for the worst case of each requirement; empty for other studies.
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
        """Return a key figure of every case in its unit, shape (cases,); NaN if it is undefined.

        Raises
        ------
        UnknownNameError
            For a figure that the study does not have.
        """
        self._require(name)
        return np.asarray(self.cases[name], dtype=float)

    def size(self, name: str) -> float:
        """Return the maximum magnitude of a key figure; 0 if it is undefined in all cases."""
        self._require(name)
        return self._sizes.get(name, 0.0)

    @cached_property
    def _sizes(self) -> Mapping[str, float]:
        """Maximum magnitude of every key figure, stored because each cell of a table needs it."""
        return {s.name: max(abs(s.least), abs(s.largest)) for s in self.spreads}

    @cached_property
    def judgments(self) -> tuple[Judgment, ...]:
        """Every requirement, in the order of the file."""
        if self.rare:
            return tuple(map(self._rare_judgment, self.rare))
        return tuple(map(self._judgment, self.plan.demands))

    @cached_property
    def spreads(self) -> tuple[Spread, ...]:
        """Every key figure that is defined in at least one case."""
        nominal = {kpi.name: kpi.value for kpi in self.nominal}
        return tuple(
            spread_of(
                name, unit, nominal.get(name, math.nan), self.figure(name), self.plan.confidence
            )
            for name, unit in (self.units if len(self.cases) else {}).items()
            if np.isfinite(self.figure(name)).any()
        )

    def influences(self, name: str) -> Sequence[Influence | ChoiceInfluence]:
        """Return the relations of a key figure to the quantities, the strongest first.

        Choices have no order. Their correlation ratio is ranked among magnitudes of rank
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
        """Return the sensitivity indices of a key figure, in a study with such a design.

        Raises
        ------
        UnknownNameError
            For a figure that the study does not have.
        ParameterError
            For another design.
        """
        self._require(name)
        known, design = self._sensitivities, self.plan.sensitivity
        if design is None:
            raise ParameterError(
                f"[design] kind = {self.plan.design!r} has no sensitivity indices. Use "
                "'sobol-indices' or 'morris'",
                name="[design] kind",
                value=self.plan.design,
                valid="'sobol-indices' or 'morris'",
            )
        if name not in known:
            names = [v.name for v in self.plan.varied]
            singles = [v.name for v in self.plan.varied if v.distribution.is_discrete]
            known[name] = sensitivity(
                design, names, singles, self.figure(name), self.plan.confidence
            )
        return known[name]

    def effects(self, name: str) -> Sequence[Effect]:
        """Return the effect of each quantity alone on a key figure, if the design shows it."""
        self._require(name)
        if self.plan.design != ONE or not len(self.cases):
            return []
        columns = [self.cases[v.name].tolist() for v in self.plan.varied]
        return effects(self.plan.varied, self.plan.levels, columns, self.figure(name))

    def drivers(self, name: str) -> Sequence[str]:
        """Return the quantities that drive a key figure, the strongest first.

        They are ranked by importance, indices, the effect of each quantity alone, or the magnitude
        of rank correlations and correlation ratios.
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
        """Reason why a case has no result, by row."""
        texts = self._texts(FAILURE)
        return {k: texts[k] for k in np.flatnonzero(self._failed).tolist()}

    @cached_property
    def _failed(self) -> NDArray[np.bool_]:
        """Whether each case has no result, shape (cases,); stored, since it reads many texts."""
        return np.asarray(self._texts(FAILURE) != "")

    @property
    def reasons(self) -> Mapping[str, Sequence[int]]:
        """Rows of cases without a result, by reason; reasons that differ only in numbers merge."""
        rows_by_text: dict[str, list[int]] = {}
        for row, text in self.failures.items():
            rows_by_text.setdefault(_NUMBER.sub("#", text), []).append(row)
        return {self.failures[rows[0]]: rows for rows in rows_by_text.values()}

    @cached_property
    def warnings(self) -> Mapping[str, int]:
        """Number of cases by warning; warnings that differ only in numbers merge."""
        said: dict[str, Counter[str]] = {}
        for text, cases in Counter(self._texts(WARNINGS).tolist()).items():
            for each in warnings_in(text):
                said.setdefault(_NUMBER.sub("#", each), Counter())[each] += cases
        return {
            next(iter(each)) + ", and so on" * (len(each) > 1): each.total()
            for each in said.values()
        }

    def _require(self, name: str) -> None:
        if name not in self.units:
            raise unknown_name("key figure", str(name), self.units)

    def _texts(self, column: str) -> NDArray[np.object_]:
        """Return a text of every case, shape (cases,); pandas would be slow row by row."""
        return np.asarray(self.cases[column] if len(self.cases) else (), dtype=object)

    def number(self, row: int) -> int:
        """Return the number of a case by its row."""
        return int(self.cases[CASE].iloc[row])

    def values(self, row: int) -> dict[str, float | str]:
        """Return the varied values of a case [SI]."""
        names = [name for v in self.plan.varied for name in (v.name, *v.together)]
        return {name: self.cases[name].iloc[row] for name in names}

    @cached_property
    def _sensitivities(self) -> dict[str, Sensitivity]:
        """Indices by key figure, stored because many cases take a second."""
        return {}

    @cached_property
    def _influences(self) -> dict[str, Sequence[Influence | ChoiceInfluence]]:
        """Influences by key figure, likewise."""
        return {}

    def _rare_judgment(self, rare: RareFailure) -> Judgment:
        """Return a requirement for a design in which fractions of cases are not probabilities."""
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
        """Return the numerical error of a key figure, in its unit; 0 if it is unknown."""
        error = {kpi.name: kpi.bound for kpi in self.nominal}.get(name, math.nan)
        return 0.0 if math.isnan(error) else error

    def is_close(self, demand: Limit) -> NDArray[np.bool_]:
        """Return a mask of the cases closer to a limit than their figure's numerical error."""
        return demand.is_near(self.figure(demand.figure), self._error(demand.figure))

    def _judgment(self, demand: Limit) -> Judgment:
        figure, error = self.figure(demand.figure), self._error(demand.figure)
        return judgment_of(demand, figure, self._failed, error, self.plan.confidence)
