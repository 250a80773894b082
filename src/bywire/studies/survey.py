"""Statistics of a study's cases in two passes over blocks of cases.

The first pass counts and finds extremes. The second pass finds order statistics and counts
histograms. All results are exact, and the memory does not depend on the number of cases.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bywire.bench.requirements import Limit
from bywire.core.typing import Array
from bywire.studies.statistics import (
    QUANTILES,
    QuantileRanks,
    Share,
    Spread,
    bin_count,
    bin_edges,
    quantile_ranks,
    share,
)
from bywire.studies.store import warnings_in

_EDGES = 2048  # of the intervals in which values are counted: few cases lie between two of them
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass
class FigureTally:
    """Values of a key figure, counted block by block; only finite values count.

    Parameters
    ----------
    edges
        Values of the first block, in ascending order, between which values are counted.
    count, mean, squares
        Number of values, their mean, and the sum of squared differences from it.
    least, largest
        Extreme values; infinite without values.
    bins
        Number of bins of its histogram.
    """

    edges: Array = field(default_factory=lambda: np.empty(0))
    count: int = 0
    mean: float = math.nan
    squares: float = 0.0
    least: float = math.inf
    largest: float = -math.inf
    bins: int = 1
    _below: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    _upto: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    _ranks: list[QuantileRanks] = field(default_factory=list)
    _between: dict[int, list[Array]] = field(default_factory=dict)
    _bins: Array = field(default_factory=lambda: np.empty(0))
    _counts: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))

    @property
    def sd(self) -> float:
        """Standard deviation; NaN for a single value."""
        return math.sqrt(self.squares / (self.count - 1)) if self.count > 1 else math.nan

    def add(self, figure: Array) -> None:
        """Count a block in the first pass; NaN where the figure is undefined."""
        known = figure[np.isfinite(figure)]
        if not known.size:
            return
        ordered = np.sort(known)
        if not self.count:
            places = np.linspace(0, ordered.size - 1, min(ordered.size, _EDGES)).astype(np.intp)
            self.edges = np.unique(ordered[places])
            self.bins = bin_count(known)
            self._below = np.zeros(self.edges.size, np.int64)
            self._upto = np.zeros(self.edges.size, np.int64)
        self._below += np.searchsorted(ordered, self.edges, "left")
        self._upto += np.searchsorted(ordered, self.edges, "right")
        self.least = min(self.least, float(ordered[0]))
        self.largest = max(self.largest, float(ordered[-1]))
        mean = float(known.mean())
        squares = float(np.sum((known - mean) ** 2))
        if not self.count:
            self.count, self.mean, self.squares = known.size, mean, squares
            return
        # T. F. Chan, G. H. Golub and R. J. LeVeque, Algorithms for computing the sample variance,
        # Am. Stat. 37, 1983, eq. 2.1.
        total, moved = self.count + known.size, mean - self.mean
        self.squares += squares + moved * moved * self.count * known.size / total
        self.mean += moved * known.size / total
        self.count = total

    def expect(self, confidence: float) -> None:
        """Prepare the second pass for the quantiles of `spread`."""
        self._ranks = [quantile_ranks(self.count, p, confidence) for p in QUANTILES]
        for rank in (rank for each in self._ranks for rank in each.ranks):
            k = int(np.searchsorted(self._upto, rank, "right"))
            if k == self.edges.size or self._below[k] > rank:
                self._between.setdefault(k, [])
        self._bins = bin_edges(self.least, self.largest, self.bins)
        self._counts = np.zeros(self.bins, np.int64)

    def add_again(self, figure: Array) -> None:
        """Count a block in the second pass."""
        ordered = np.sort(figure[np.isfinite(figure)])
        for k, gathered in self._between.items():
            begin = np.searchsorted(ordered, self.edges[k - 1], "right") if k else 0
            end = np.searchsorted(ordered, self.edges[k]) if k < self.edges.size else ordered.size
            gathered.append(ordered[begin:end].copy())
        inner = np.searchsorted(ordered, self._bins[1:-1])
        self._counts += np.diff(np.concatenate([[0], inner, [ordered.size]]))

    def _ordered(self, rank: int) -> float:
        k = int(np.searchsorted(self._upto, rank, "right"))
        if k < self.edges.size and self._below[k] <= rank:
            return float(self.edges[k])
        values = np.sort(np.concatenate(self._between[k]))
        return float(values[rank - (self._upto[k - 1] if k else 0)])

    def spread(self, name: str, unit: str, nominal: float, cases: int) -> Spread:
        """Return the spread of the figure, once the second pass is complete.

        Parameters
        ----------
        name, unit, nominal
            Name and unit of the figure, and its value in the bench itself.
        cases
            Number of cases, including those without the figure.
        """
        return Spread(
            name,
            unit,
            nominal,
            cases - self.count,
            self.mean,
            self.sd,
            tuple(each.quantile(self._ordered) for each in self._ranks),
            self.least,
            self.largest,
            self._counts,
            self._bins,
        )


@dataclass
class DemandTally:
    """Cases that meet a requirement, counted block by block.

    Parameters
    ----------
    demand, error
        The requirement, and the numerical error of its figure, in its unit.
    sizes
        Increasing numbers of first cases for which to count those that meet it.
    cases, met, may, surely, near
        Number of cases, of cases that meet it, that meet it or are too close to the limit, that
        meet it and are not too close, and that are too close.
    lacking
        Number of cases with a result but without the figure.
    known, known_met
        Number of cases with a finite figure, and of those that meet the requirement.
    running
        Number of cases that meet it among the first ``sizes``.
    worst
        Row of the worst case: the first one without the figure, or the first one with the worst
        value; None if no case has a result, or all cases are equal.
    """

    demand: Limit
    error: float
    sizes: NDArray[np.int64]
    cases: int = 0
    met: int = 0
    may: int = 0
    surely: int = 0
    near: int = 0
    lacking: int = 0
    known: int = 0
    known_met: int = 0
    running: list[int] = field(default_factory=list)
    _row: int = -1
    _least: float = math.inf
    _largest: float = -math.inf
    _first_lacking: int = -1

    def add(self, figure: Array, failed: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Count a block, and return whether each case meets the requirement.

        Parameters
        ----------
        figure
            Key figure of each case, NaN if it is undefined.
        failed
            Whether each case has no result.
        """
        met, near = self.demand.is_met(figure), self.demand.is_near(figure, self.error)
        ends = self.sizes[len(self.running) :] - self.cases
        so_far = np.cumsum(met)[ends[ends <= figure.size] - 1]
        self.running += (self.met + so_far).tolist()
        known = np.isfinite(figure)
        lacking = np.flatnonzero(~known & ~failed)
        if lacking.size and self._first_lacking < 0:
            self._first_lacking = self.cases + int(lacking[0])
        if known.any():
            # Distance from the limit: the worst case has the least one.
            inside = np.where(known, -figure if self.demand.is_upper else figure, np.inf)
            k = int(np.argmin(inside))
            if inside[k] < self._least:
                self._row, self._least = self.cases + k, float(inside[k])
            self._largest = max(self._largest, float(np.max(inside[known])))
        self.met += int(met.sum())
        self.near += int(near.sum())
        self.may += int((met | near).sum())
        self.surely += int((met & ~near).sum())
        self.lacking += lacking.size
        self.known += int(known.sum())
        self.known_met += int((met & known).sum())
        self.cases += figure.size
        return met

    @property
    def worst(self) -> int | None:
        """Row of the worst case."""
        if self._first_lacking >= 0:
            return self._first_lacking
        if not self.known or (self.known > 1 and self._least == self._largest):
            return None  # all cases are equal, so none is the worst
        return self._row

    def shares(self, confidence: float) -> list[Share]:
        """Return the convergence of the fraction that meets it, for the first ``sizes`` cases."""
        return [
            share(met, size, confidence)
            for met, size in zip(self.running, self.sizes.tolist(), strict=True)
        ]


@dataclass(frozen=True)
class Reason:
    """Reason why cases have no result; reasons that differ only in numbers are the same.

    Parameters
    ----------
    text
        Reason of the first case.
    cases
        Number of cases.
    row
        Row of the first case.
    """

    text: str
    cases: int
    row: int


@dataclass
class TextTally:
    """Texts of cases, counted block by block; texts that differ only in numbers are the same.

    Parameters
    ----------
    first, rows
        First text of each kind, and its row.
    cases
        Number of cases of each kind.
    several
        Kinds with different numbers.
    """

    first: dict[str, str] = field(default_factory=dict)
    rows: dict[str, int] = field(default_factory=dict)
    cases: dict[str, int] = field(default_factory=dict)
    several: set[str] = field(default_factory=set)

    def add(self, text: str, row: int) -> None:
        """Count a text."""
        kind = _NUMBER.sub("#", text)
        if self.first.setdefault(kind, text) != text:
            self.several.add(kind)
        self.rows.setdefault(kind, row)
        self.cases[kind] = self.cases.get(kind, 0) + 1

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """The texts as reasons, in the order of their first cases."""
        return tuple(Reason(t, self.cases[kind], self.rows[kind]) for kind, t in self.first.items())


@dataclass
class Survey:
    """First pass over the cases of a study.

    Parameters
    ----------
    figures
        Key figures by name.
    demands
        Requirements.
    reasons, warnings
        Reasons for missing results, and warnings.
    ends
        Least and largest value of each varied number.
    cases, failed, met
        Number of cases, of cases without a result, and of cases that meet all requirements.
    """

    figures: Mapping[str, FigureTally]
    demands: Sequence[DemandTally]
    reasons: TextTally = field(default_factory=TextTally)
    warnings: TextTally = field(default_factory=TextTally)
    ends: dict[str, tuple[float, float]] = field(default_factory=dict)
    cases: int = 0
    failed: int = 0
    met: int = 0

    def add(
        self,
        columns: Mapping[str, Array],
        varied: Iterable[str],
        failures: NDArray[np.object_],
        warnings: NDArray[np.object_],
    ) -> None:
        """Count a block.

        Parameters
        ----------
        columns
            Key figures and varied numbers.
        varied
            Names of the varied numbers.
        failures, warnings
            Texts of each case, empty for none.
        """
        failed = np.asarray(failures != "", dtype=bool)
        for name, figure in self.figures.items():
            figure.add(columns[name])
        met = np.ones(failed.size, dtype=bool)
        for each in self.demands:
            met &= each.add(columns[each.demand.figure], failed)
        self.met += int(np.count_nonzero(met))
        for name in varied:
            low, high = self.ends.get(name, (math.inf, -math.inf))
            column = columns[name]
            self.ends[name] = min(low, float(column.min())), max(high, float(column.max()))
        rows = np.flatnonzero(failed)
        for row, text in zip(rows.tolist(), failures[rows], strict=True):
            self.reasons.add(text, self.cases + row)
        rows = np.flatnonzero(warnings != "")
        for row, cell in zip(rows.tolist(), warnings[rows], strict=True):
            for text in warnings_in(cell):
                self.warnings.add(text, self.cases + row)
        self.failed += int(np.count_nonzero(failed))
        self.cases += failed.size
