"""Findings of a study: judged requirements, spread of key figures, and their drivers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
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
    running_sizes,
    share,
)
from bywire.studies.store import CASE, FAILURE, WARNINGS, Columns
from bywire.studies.stored_cases import BLOCK, StoredCases
from bywire.studies.survey import DemandTally, FigureTally, Reason, Survey

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
    share
        Fraction of cases that meet it, with the interval of the probability. Cases too close to the
        limit are counted neither as meeting nor as missing it.
    undecided
        Number of cases whose difference from the limit is smaller than the numerical error.
    outcome
        Whether it is met with the required probability, or in all cases without a probability.
    worst
        Row of the worst case, or of the most probable failure in a study of rare failures. A case
        without the figure is the worst. None if no case ran, or all cases are equal.
    lacking
        Number of cases with a result but without the figure.
    known, known_met
        Number of cases with a finite figure, and of those that meet the requirement.
    running
        Fraction of the first cases that meet it, for increasing numbers of cases.
    failure
        Probability that the requirement is missed, in a study of rare failures, where fractions of
        cases are not probabilities.
    """

    demand: Limit
    share: Share
    undecided: int
    outcome: Outcome
    worst: int | None
    lacking: int
    known: int
    known_met: int
    running: Sequence[Share] = field(default=(), repr=False)
    failure: FailureProbability | None = None


def judgment_of(tally: DemandTally, confidence: float) -> Judgment:
    """Return a requirement judged over all cases.

    Parameters
    ----------
    tally
        Counted cases. Cases whose difference from the limit is smaller than the numerical error are
        counted neither as meeting nor as missing it.
    confidence
        Confidence of the interval, between 0 and 1.
    """
    demand, count = tally.demand, tally.cases
    may, surely = (share(each, count, confidence) for each in (tally.may, tally.surely))
    if demand.probability is not None:
        outcome = judged(may, surely, demand.probability)
    elif may.count < count:
        outcome = "missed"
    else:
        outcome = "met" if surely.count == count else "undecided"
    told = replace(share(tally.met, count, confidence), low=surely.low, high=may.high)
    return Judgment(
        demand,
        told,
        tally.near,
        outcome,
        tally.worst,
        tally.lacking,
        tally.known,
        tally.known_met,
        tally.shares(confidence),
    )


# --- All findings

_SHARES = 100  # points of a convergence, spaced by equal ratios


@dataclass(frozen=True, repr=False)
class Findings:
    """The cases of a study, and their evaluation.

    Parameters
    ----------
    plan
        The study.
    source
        One row for each computed case, in memory or in the folder of a large study; see
        `bywire.studies.store.computed_chunk`.
    nominal
        Key figures of the bench itself, with their numerical error.
    rare
        Results of a study of rare failures; empty for other studies.
    searches
        Results of the searches for the worst case of each requirement; empty for other studies.
    """

    plan: StudyPlan
    source: pd.DataFrame | StoredCases
    nominal: tuple[Kpi, ...]
    rare: tuple[RareFailure, ...] = ()
    searches: tuple[WorstCase, ...] = ()

    def __repr__(self) -> str:
        return f"<Findings of {self.plan.name}: {self.count} cases>"

    @property
    def count(self) -> int:
        """Number of computed cases."""
        return self.source.count if isinstance(self.source, StoredCases) else len(self.source)

    @cached_property
    def cases(self) -> pd.DataFrame:
        """All cases; for a large study, read from its folder when they are first used."""
        return self.source.frame() if isinstance(self.source, StoredCases) else self.source

    @cached_property
    def first(self) -> pd.DataFrame:
        """The first cases: all, or at least `BLOCK` cases of a large study."""
        import pandas as pd

        if not isinstance(self.source, StoredCases):
            return self.source[:BLOCK]
        return pd.DataFrame(next(self.source.blocks()))

    @property
    def columns(self) -> list[str]:
        """Names of all columns of the cases."""
        return [str(name) for name in self.first]

    def blocks(self, names: Sequence[str]) -> Iterator[Columns]:
        """Yield the named columns of all cases block by block, shape (cases of the block,) each."""
        if isinstance(self.source, StoredCases):
            yield from self.source.blocks(names)
            return
        columns = {name: np.asarray(self.source[name]) for name in names if len(self.source)}
        for begin in range(0, len(self.source), BLOCK):
            yield {name: column[begin : begin + BLOCK] for name, column in columns.items()}

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
        each = [np.asarray(block[name], dtype=float) for block in self.blocks([name])]
        return np.concatenate(each) if each else np.empty(0)

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
        judgments = tuple(judgment_of(t, self.plan.confidence) for t in self._survey.demands)
        if self.rare:
            return tuple(map(self._rare_judgment, self.rare, judgments))
        return judgments

    @cached_property
    def _survey(self) -> Survey:
        """Counts and extremes of all cases."""
        demands = [each.demand for each in self.rare] or self.plan.demands
        sizes = running_sizes(self.count, _SHARES)
        survey = Survey(
            {name: FigureTally() for name in self.units},
            [DemandTally(each, self._error(each.figure), sizes) for each in demands],
        )
        varied = [v.name for v in self.plan.varied if v.unit]
        numbers = [*self.units, *varied]
        for block in self.blocks([*numbers, FAILURE, WARNINGS]):
            columns = {name: np.asarray(block[name], dtype=float) for name in numbers}
            texts = [np.asarray(block[name], dtype=object) for name in (FAILURE, WARNINGS)]
            survey.add(columns, varied, *texts)
        return survey

    @cached_property
    def spreads(self) -> tuple[Spread, ...]:
        """Every key figure that is defined in at least one case."""
        defined = {name: each for name, each in self._survey.figures.items() if each.count}
        for tally in defined.values():
            tally.expect(self.plan.confidence)
        for block in self.blocks(list(defined)) if defined else ():
            for name, tally in defined.items():
                tally.add_again(np.asarray(block[name], dtype=float))
        nominal = {kpi.name: kpi.value for kpi in self.nominal}
        return tuple(
            tally.spread(name, self.units[name], nominal.get(name, math.nan), self.count)
            for name, tally in defined.items()
        )

    @property
    def ends(self) -> Mapping[str, tuple[float, float]]:
        """Minimum and maximum of each varied number [SI], and of each defined key figure."""
        figures = {each.name: (each.least, each.largest) for each in self.spreads}
        return self._survey.ends | figures

    def influences(self, name: str) -> Sequence[Influence | ChoiceInfluence]:
        """Return the relations of a key figure to the quantities, the strongest first.

        Choices have no order. Their correlation ratio is ranked among magnitudes of rank
        correlations. For a large study, relations and intervals come from the `first` cases.
        """
        self._require(name)
        known, plan = self._influences, self.plan
        if name not in known:
            varied = [v.name for v in plan.varied if v.unit]
            columns = [np.asarray(self.first[each], dtype=float) for each in varied]
            figure = np.asarray(self.first[name], dtype=float) if self.count else np.empty(0)
            confidence = plan.confidence
            found: list[Influence | ChoiceInfluence] = [
                *influences(varied, columns, figure, confidence, bool(plan.correlations))
            ]
            for v in plan.varied:
                if not v.unit and (
                    each := choice_influence(v.name, self.first[v.name], figure, confidence)
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
        if self.plan.design != ONE or not self.count:
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

    @property
    def met(self) -> int:
        """Number of cases that meet all requirements."""
        return self._survey.met

    @property
    def failed(self) -> int:
        """Number of cases without a result."""
        return self._survey.failed

    @property
    def reasons(self) -> Sequence[Reason]:
        """Reasons why cases have no result."""
        return self._survey.reasons.reasons

    @property
    def warnings(self) -> Mapping[str, int]:
        """Number of cases by warning; warnings that differ only in numbers merge."""
        tally = self._survey.warnings
        return {
            text + ", and so on" * (kind in tally.several): tally.cases[kind]
            for kind, text in tally.first.items()
        }

    def _require(self, name: str) -> None:
        if name not in self.units:
            raise unknown_name("key figure", str(name), self.units)

    def row(self, row: int) -> Mapping[str, float | str]:
        """Return all columns of a case, by its row."""
        if row not in self._rows:
            if isinstance(self.source, StoredCases):
                self._rows[row] = {n: x[0] for n, x in self.source.row(row).items()}
            else:
                self._rows[row] = {str(n): self.source[n].iloc[row] for n in self.source}
        return self._rows[row]

    @cached_property
    def _rows(self) -> dict[int, Mapping[str, float | str]]:
        """Cases by row, stored since each needs a file."""
        return {}

    def number(self, row: int) -> int:
        """Return the number of a case by its row."""
        return int(self.row(row)[CASE])

    def values(self, row: int) -> dict[str, float | str]:
        """Return the varied values of a case [SI]."""
        names = [name for v in self.plan.varied for name in (v.name, *v.together)]
        return {name: self.row(row)[name] for name in names}

    def has_result(self, row: int) -> bool:
        """Return whether a case has a result, by its row."""
        return self.row(row)[FAILURE] == ""

    @cached_property
    def _sensitivities(self) -> dict[str, Sensitivity]:
        """Indices by key figure, stored because many cases take a second."""
        return {}

    @cached_property
    def _influences(self) -> dict[str, Sequence[Influence | ChoiceInfluence]]:
        """Influences by key figure, likewise."""
        return {}

    def _rare_judgment(self, rare: RareFailure, among: Judgment) -> Judgment:
        """Return a requirement for a design in which fractions of cases are not probabilities."""
        wanted = rare.demand.probability
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

    def is_close(self, demand: Limit, row: int) -> bool:
        """Return whether the numerical error of a case exceeds its difference from a limit."""
        figure = np.asarray(self.row(row)[demand.figure], dtype=float)
        return bool(demand.is_near(figure, self._error(demand.figure)))
