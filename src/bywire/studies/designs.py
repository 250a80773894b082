"""Where a study computes: designs of points, of groups for indices, and such that seek.

A chunk of points depends on the seed and its number alone, so that chunks may be computed in any
order, anywhere, and more of them be added later.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy import special

from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.data.file_format import library
from bywire.studies.distribution import TAIL, Distribution, normal_quantile

SAMPLED = ("monte-carlo", "latin-hypercube", "sobol")
"""designs that draw from the distributions: what they count are probabilities"""
SPANNED = ("grid", "corners", "one-at-a-time")
"""designs that go to the ends: what they show is what may happen, not how often"""
MOST = 10_000_000
"""cases of one study"""
_INSIDE = (2.0**-53, 1.0 - 2.0**-53)  # probabilities that have a finite quantile
_CORNERS = 16  # quantities of which all corners are visited


@dataclass(frozen=True)
class Sampled:
    """Points that are drawn, chunk by chunk.

    Parameters
    ----------
    kind
        One of `SAMPLED`. Of a Latin hypercube every chunk is one, so that more can be added; a
        Sobol sequence is scrambled.
    seed
        Of its random numbers.
    distributions
        Of each quantity.
    factor
        Lower triangular factor of the correlation of their normal scores; None of independent ones.
    """

    kind: str
    seed: int
    distributions: Sequence[Distribution]
    factor: Array | None = None

    def values(self, chunk: int, size: int) -> list[NDArray[np.generic]]:
        """Return the values of each quantity in a chunk of points, shape (size,) each."""
        u = np.clip(self._probabilities(chunk, size), *_INSIDE)
        if self.factor is not None:
            return self.values_at(normal_quantile(u))
        return self._quantiles(u)

    def values_at(self, scores: Array) -> list[NDArray[np.generic]]:
        """Return the values of each quantity at independent standard normal scores.

        Parameters
        ----------
        scores
            Shape (cases, quantities).
        """
        return self._quantiles(np.clip(special.ndtr(self.correlated(scores)), *_INSIDE))

    def correlated(self, scores: Array) -> Array:
        """Return the normal scores of the quantities by independent ones."""
        return scores if self.factor is None else scores @ self.factor.T

    def _quantiles(self, u: Array) -> list[NDArray[np.generic]]:
        return [each.quantile(u[:, k]) for k, each in enumerate(self.distributions)]

    def _probabilities(self, chunk: int, size: int) -> Array:
        """Return points of the unit cube, shape (size, quantities)."""
        count = len(self.distributions)
        if self.kind == "sobol":
            from scipy.stats import qmc  # slow to load

            sequence = qmc.Sobol(count, scramble=True, rng=np.random.default_rng(self.seed))
            if chunk:
                sequence.fast_forward(chunk * size)
            return np.asarray(sequence.random(size))
        rng = np.random.default_rng((self.seed, chunk))
        if self.kind == "latin-hypercube":
            from scipy.stats import qmc

            return np.asarray(qmc.LatinHypercube(count, rng=rng).random(size))
        return rng.random((size, count))


@dataclass(frozen=True)
class Spanned:
    """Points that are listed: all of them at once.

    Parameters
    ----------
    columns
        Values of each quantity, shape (cases,) each.
    """

    columns: Sequence[NDArray[np.generic]]

    @property
    def cases(self) -> int:
        """How many points there are."""
        return len(self.columns[0])

    def values(self, chunk: int, size: int) -> list[NDArray[np.generic]]:
        """Return the values of each quantity in a chunk of points; the last one is shorter."""
        return [column[chunk * size : (chunk + 1) * size] for column in self.columns]


def spanned(
    kind: str, distributions: Sequence[Distribution], nominal: Sequence[object], levels: int
) -> Spanned:
    """Return the points of a design that goes to the ends, the bench's own values first.

    Parameters
    ----------
    kind
        ``grid``: all combinations of ``levels`` values each; ``corners``: of both ends of each;
        ``one-at-a-time``: ``levels`` values of each, the others as they are.
    distributions
        Of each quantity.
    nominal
        What the bench has.
    levels
        Values of each quantity, >= 2; quantities of single values take these.

    Raises
    ------
    ParameterError
        For more cases than a study may have.
    """
    if kind == "corners" and len(distributions) > _CORNERS:
        raise ParameterError(
            f"[design] corners of {len(distributions)} quantities are too many (at most "
            f"{_CORNERS}): take 'latin-hypercube', or 'one-at-a-time' to see which matter"
        )
    each = [d.levels(2 if kind == "corners" else levels) for d in distributions]
    if kind == "one-at-a-time":
        rows = [
            [*nominal[:k], value, *nominal[k + 1 :]]
            for k, values in enumerate(each)
            for value in values
        ]
    else:
        count = int(np.prod([float(len(values)) for values in each]))
        if count > MOST:
            raise ParameterError(
                f"[design] a grid of {count:.3g} cases is too large (at most {MOST:.0e}): take "
                "fewer levels, or 'latin-hypercube'"
            )
        rows = [list(row) for row in product(*each)]
    rows.insert(0, list(nominal))
    return Spanned([np.array(column) for column in zip(*rows, strict=True)])


# --- Groups of cases for sensitivity indices, within which the quantities are exchanged
# Their cases are not independent, for those of a group share values: indices come out of them, and
# no probabilities.

MORRIS = "morris"
SENSITIVITY = ("sobol-indices", MORRIS)
"""designs of which indices of sensitivity come out"""
SALIB = ("studies with indices of sensitivity", "studies")
"""who needs the library, and the extra that brings it"""
LEVELS = 4
"""levels of each quantity on which Morris' trajectories go, an even number"""
STEP = LEVELS / (2.0 * (LEVELS - 1.0))
"""step of a trajectory: two thirds of the way from end to end"""
# From so many groups on, intervals of 95 % held the true value in 92 % of the studies and more.
_LEAST = {"sobol-indices": 64, "morris": 16}


@dataclass(frozen=True)
class SensitivityDesign:
    """Points for indices of sensitivity, by SALib.

    ``sobol-indices``: Saltelli's sample. Of two points A and B of a scrambled Sobol sequence, a
    group has A, A with each quantity in turn taken from B, and B. ``morris``: trajectories on four
    levels of probability, along which each quantity steps once, by two thirds.

    Parameters
    ----------
    kind
        One of `SENSITIVITY`.
    quantities
        How many vary.
    budget
        Most cases.
    seed
        Of its random numbers.

    References
    ----------
    A. Saltelli et al., Variance based sensitivity analysis of model output, Comput. Phys. Commun.
    181, 2010, section 4. M. D. Morris, Factorial sampling plans for preliminary computational
    experiments, Technometrics 33, 1991.
    """

    kind: str
    quantities: int
    budget: int
    seed: int

    @property
    def group(self) -> int:
        """Cases of a group."""
        return self.quantities + (2 if self.kind == "sobol-indices" else 1)

    @cached_property
    def base(self) -> int:
        """How many groups it has, the most that the budget admits; of Sobol's, a power of two.

        Raises
        ------
        ParameterError
            For a budget that is too small, or larger than a study may be.
        """
        groups, least = self.budget // self.group, _LEAST[self.kind]
        if groups < least:
            raise ParameterError(
                f"[design] cases = {self.budget} is too few: {self.kind!r} of {self.quantities} "
                f"quantities needs at least {least * self.group} ({least} groups of {self.group})"
            )
        if self.budget > MOST:
            raise ParameterError(f"[design] cases = {self.budget} is too many (at most {MOST:.0e})")
        # Even points are even only in powers of two.
        return 1 << (groups.bit_length() - 1) if self.kind == "sobol-indices" else groups

    @property
    def cases(self) -> int:
        """How many cases it has."""
        return self.base * self.group

    @cached_property
    def probabilities(self) -> Array:
        """Points of the unit cube, group by group, shape (cases, quantities).

        Raises
        ------
        FileError
            When SALib is not installed.
        """
        # A generator, for SALib takes the seed 0 as none.
        rng = np.random.default_rng(self.seed)
        if self.kind == "sobol-indices":
            sobol = library("SALib.sample.sobol", *SALIB)
            points = sobol.sample(self.problem, self.base, calc_second_order=False, seed=rng)
        else:
            morris = library("SALib.sample.morris", *SALIB)
            points = morris.sample(self.problem, self.base, num_levels=LEVELS, seed=rng)
        return np.asarray(points, dtype=float)

    @property
    def problem(self) -> dict[str, object]:
        """What SALib is told: quantities are probabilities, named by their numbers."""
        count = self.quantities
        names = [str(k) for k in range(count)]
        return {"num_vars": count, "names": names, "bounds": [[0.0, 1.0]] * count}

    def columns(self, distributions: Sequence[Distribution]) -> list[NDArray[np.generic]]:
        """Return the values of each quantity, shape (cases,) each.

        Morris' outer levels are the ends of a distribution, and 3 standard deviations where it has
        none, as those of a grid. Single values, whatever their weights, share the levels in their
        order, of three the last has two: a step is always one to another value.
        """
        u = self.probabilities
        if self.kind == "sobol-indices":
            return [
                d.quantile(np.clip(u[:, k], 2.0**-53, 1.0 - 2.0**-53))
                for k, d in enumerate(distributions)
            ]
        return [
            d.between(u[:, k])
            if d.is_discrete
            else d.quantile(
                np.clip(
                    u[:, k],
                    0.0 if math.isfinite(d.low) else TAIL,
                    1.0 if math.isfinite(d.high) else 1.0 - TAIL,
                )
            )
            for k, d in enumerate(distributions)
        ]


# --- Designs that seek: which cases come next depends on what the ones before gave
# They go where a requirement is missed: to its rare failures, or to the worst case. In rare
# failures noise is one of the things that vary, as in drawn cases: each case has its own.

SUBSET, IMPORTANCE = "subset-simulation", "importance-sampling"
RARE = (SUBSET, IMPORTANCE)
"""designs that answer how probable the rare failure of a requirement is"""
WORST = "worst-case"
"""design that searches the ends of what varies for the worst case of each requirement"""
SOUGHT = (*RARE, WORST)
OPENTURNS = ("studies of rare failures", "studies")
"""who needs OpenTURNS, and the extra that brings it"""
DEFAULT_CASES = {SUBSET: 25_600, IMPORTANCE: 4096, WORST: 4096}
"""most cases of each requirement where the file does not say"""
TOGETHER = 1024
"""cases of a batch of importance sampling"""
STEPS = 10
"""steps of each chain of subset simulation: a tenth of a level are the seeds of the next"""
_WHOLE = 640  # a tenth of a level, the seeds of the next, are whole chunks
_SEARCH = 1024  # chunks of a requirement that are kept for the search of its design point


@dataclass(frozen=True)
class SoughtDesign:
    """How cases are sought for each requirement; requirements take turns at chunks.

    Parameters
    ----------
    kind
        One of `SOUGHT`.
    requirements
        How many they are sought for.
    asked
        Cases asked for in each level of subset simulation.
    budget
        Most cases of each requirement.
    seed
        Of its random numbers.
    quantities
        How many vary.
    """

    kind: str
    requirements: int
    asked: int
    budget: int
    seed: int
    quantities: int

    @property
    def level(self) -> int:
        """Cases of each level, a whole number of chunks for each step of its chains."""
        return -(-self.asked // _WHOLE) * _WHOLE

    @property
    def together(self) -> int:
        """Cases that are computed at once."""
        if self.kind == WORST:
            return population(self.quantities)
        return self.level // STEPS if self.kind == SUBSET else TOGETHER

    @property
    def first_sampled(self) -> int:
        """First of a requirement's own chunks that is drawn and no part of a search."""
        return _SEARCH if self.kind == IMPORTANCE else 0

    def chunk(self, requirement: int, own: int) -> int:
        """Return the number of a chunk in the study by its number within a requirement."""
        return own * self.requirements + requirement

    def has_own_noise(self, chunk: int) -> bool:
        """Whether each case of a chunk has noise of its own.

        Those of a search have the bench's: derivatives by differences would be of the noise, and
        the worst case would be that of many draws.
        """
        return self.kind != WORST and chunk // self.requirements >= self.first_sampled

    def require_budget(self) -> None:
        """Refuse a budget with which nothing can be said.

        Raises
        ------
        ParameterError
            When it is below a single batch or level, or larger than a study may be.
        FileError
            When OpenTURNS is not installed.
        """
        if self.kind in RARE:
            library("openturns", *OPENTURNS)
        least = {SUBSET: self.level, IMPORTANCE: _WHOLE}.get(self.kind, self.together)
        if self.budget < least:
            raise ParameterError(
                f"[design] cases = {self.budget} is too few: {self.kind!r} needs at least {least} "
                + ("(one level of cases_per_level)" if self.kind == SUBSET else "")
            )
        if self.budget > MOST:
            raise ParameterError(f"[design] cases = {self.budget} is too many (at most {MOST:.0e})")


def population(quantities: int) -> int:
    """Return how many cases a generation of a search has: about a chunk for eight quantities.

    A power of two, for a sequence that visits corners.
    """
    return 64 << (-(-quantities // 8) - 1).bit_length()


def library_version(kind: str) -> str:
    """Return the version of OpenTURNS, or SciPy's, for another may draw other points.

    Raises
    ------
    FileError
        When it is not installed.
    """
    return str(scipy.__version__ if kind == WORST else library("openturns", *OPENTURNS).__version__)
