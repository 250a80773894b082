"""Designs of studies: sampled points, groups for sensitivity indices, and searches.

A chunk of points depends only on the seed and its number. Chunks can therefore be computed in any
order, anywhere, and more chunks can be added later.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import ParameterError, not_valid
from bywire.core.typing import Array
from bywire.data.file_format import library
from bywire.studies.distribution import TAIL, Distribution, normal_quantile

SAMPLED = ("monte-carlo", "latin-hypercube", "sobol")
"""designs that sample the distributions, so that fractions of cases are probabilities"""
SPANNED = ("grid", "corners", "one-at-a-time")
"""designs that visit the ends, which show what can happen, but not how often"""
MOST = 10_000_000
"""maximum number of cases of a study"""
_INSIDE = (2.0**-53, 1.0 - 2.0**-53)  # probabilities that have a finite quantile
_CORNERS = 16  # maximum number of quantities in a design of corners


@dataclass(frozen=True)
class Sampled:
    """Randomly drawn points, chunk by chunk.

    Parameters
    ----------
    kind
        One of `SAMPLED`. Each chunk is a separate Latin hypercube, so that more can be added; a
        Sobol sequence is scrambled.
    seed
        Seed of the random numbers.
    distributions
        Distribution of each quantity.
    factor
        Lower triangular factor of the correlation of the normal scores; None for independent
        quantities.
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
        from scipy import special

        return self._quantiles(np.clip(special.ndtr(self.correlated(scores)), *_INSIDE))

    def correlated(self, scores: Array) -> Array:
        """Return the correlated normal scores from independent ones."""
        return scores if self.factor is None else scores @ self.factor.T

    def _quantiles(self, u: Array) -> list[NDArray[np.generic]]:
        return [each.quantile(u[:, k]) for k, each in enumerate(self.distributions)]

    def _probabilities(self, chunk: int, size: int) -> Array:
        """Return points of the unit cube, shape (size, quantities)."""
        count = len(self.distributions)
        if self.kind == "sobol":
            return np.asarray(_sobol_at(count, self.seed, chunk * size).random(size))
        rng = np.random.default_rng((self.seed, chunk))
        if self.kind == "latin-hypercube":
            from scipy.stats import qmc

            return np.asarray(qmc.LatinHypercube(count, rng=rng).random(size))
        return rng.random((size, count))


_kept = threading.local()
"""sequence of the latest chunk of each thread"""


def _sobol_at(quantities: int, seed: int, first: int) -> Any:
    """Return the scrambled Sobol sequence of a seed from a point on.

    SciPy skips points one by one, which takes 80 ms for ten million. The next chunk usually
    continues the sequence of the previous chunk.
    """
    from scipy.stats import qmc  # slow to load

    kept: dict[str, Any] = vars(_kept)
    sequence: Any = kept.get("sobol")
    if kept.get("key") != (quantities, seed) or sequence.num_generated > first:
        sequence = qmc.Sobol(quantities, scramble=True, rng=np.random.default_rng(seed))
        kept.update(key=(quantities, seed), sobol=sequence)
    if first > sequence.num_generated:
        sequence.fast_forward(first - sequence.num_generated)
    return sequence


@dataclass(frozen=True)
class Spanned:
    """Listed points in one table.

    Parameters
    ----------
    columns
        Values of each quantity, shape (cases,) each.
    """

    columns: Sequence[NDArray[np.generic]]

    @property
    def cases(self) -> int:
        """Number of points."""
        return len(self.columns[0])

    def values(self, chunk: int, size: int) -> list[NDArray[np.generic]]:
        """Return the values of each quantity in a chunk of points; the last chunk is shorter."""
        return [column[chunk * size : (chunk + 1) * size] for column in self.columns]


def spanned(
    kind: str, distributions: Sequence[Distribution], nominal: Sequence[object], levels: int
) -> Spanned:
    """Return the points of a design that visits the ends, starting with the bench's own values.

    Parameters
    ----------
    kind
        ``grid``: all combinations of ``levels`` values of each quantity; ``corners``: all
        combinations of the ends; ``one-at-a-time``: ``levels`` values of each quantity, while the
        others keep their values.
    distributions
        Distribution of each quantity.
    nominal
        Values of the bench.
    levels
        Number of values of each quantity, >= 2; discrete quantities use their own values.

    Raises
    ------
    ParameterError
        For more cases than the largest study.
    """
    if kind == "corners" and len(distributions) > _CORNERS:
        raise ParameterError(
            f"[design] kind = {kind!r} is not possible for {len(distributions)} quantities (at "
            f"most {_CORNERS}). Use 'latin-hypercube', or 'one-at-a-time' to see which "
            "quantities matter",
            name="[design] kind",
            value=kind,
            valid=f"at most {_CORNERS}",
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
                f"[design] kind = {kind!r} has {count:.3g} cases, which is too many (at most "
                f"{MOST:.0e}). Use fewer levels, or 'latin-hypercube'",
                name="[design] kind",
                value=kind,
                valid=f"at most {MOST:.0e}",
            )
        rows = [list(row) for row in product(*each)]
    rows.insert(0, list(nominal))
    return Spanned([np.array(column) for column in zip(*rows, strict=True)])


# --- Groups of cases for sensitivity indices, within which the quantities are exchanged
# Cases of a group share values, so they are not independent: they determine indices, but no
# probabilities.

MORRIS = "morris"
SENSITIVITY = ("sobol-indices", MORRIS)
"""designs for sensitivity indices"""
SALIB = ("studies with sensitivity indices", "studies")
"""feature that needs SALib, and its extra"""
LEVELS = 4
"""levels of each quantity in Morris' trajectories, an even number"""
STEP = LEVELS / (2.0 * (LEVELS - 1.0))
"""step of a trajectory: two thirds of the way from end to end"""
# With at least this many groups, 95 % intervals contained the true value in 92 % of the studies or
# more.
_LEAST = {"sobol-indices": 64, "morris": 16}


@dataclass(frozen=True)
class SensitivityDesign:
    """Points for sensitivity indices, from SALib.

    ``sobol-indices``: Saltelli's sample. From two points A and B of a scrambled Sobol sequence, a
    group contains A, A with each quantity in turn replaced by its value in B, and B. ``morris``:
    trajectories on four levels of probability, along which each quantity steps once by two thirds.

    Parameters
    ----------
    kind
        One of `SENSITIVITY`.
    quantities
        Number of quantities that vary.
    budget
        Maximum number of cases.
    seed
        Seed of the random numbers.

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
        """Cases per group."""
        return self.quantities + (2 if self.kind == "sobol-indices" else 1)

    @cached_property
    def base(self) -> int:
        """Maximum number of groups within the budget; for Sobol indices, a power of two.

        Raises
        ------
        ParameterError
            For a budget that is too small, or larger than the largest study.
        """
        groups, least = self.budget // self.group, _LEAST[self.kind]
        if groups < least:
            raise not_valid(
                "[design] cases",
                f"{self.budget}",
                f">= {least * self.group}",
                f"{least} groups of {self.group} for {self.kind!r} of {self.quantities} quantities",
            )
        if self.budget > MOST:
            raise not_valid("[design] cases", f"{self.budget}", f"<= {MOST:.0e}")
        # The points of a sequence are even only for powers of two.
        return 1 << (groups.bit_length() - 1) if self.kind == "sobol-indices" else groups

    @property
    def cases(self) -> int:
        """Number of cases."""
        return self.base * self.group

    @cached_property
    def probabilities(self) -> Array:
        """Points of the unit cube, group by group, shape (cases, quantities).

        Raises
        ------
        FileError
            If SALib is not installed.
        """
        # A generator, because SALib treats the seed 0 as no seed.
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
        """Problem definition for SALib, in which quantities are probabilities with number names."""
        count = self.quantities
        names = [str(k) for k in range(count)]
        return {"num_vars": count, "names": names, "bounds": [[0.0, 1.0]] * count}

    def columns(self, distributions: Sequence[Distribution]) -> list[NDArray[np.generic]]:
        """Return the values of each quantity, shape (cases,) each.

        Morris' outer levels are the ends of a distribution, or 3 standard deviations if it has no
        ends, as in a grid. Discrete values share the levels in their order, regardless of their
        weights; the last of three values has two levels. Every step therefore changes the value.
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


# --- Search designs, whose next cases depend on the results of earlier cases
# They search for missed requirements: rare failures, or the worst case. For rare failures, each
# case has its own noise, as in sampled designs.

SUBSET, IMPORTANCE = "subset-simulation", "importance-sampling"
RARE = (SUBSET, IMPORTANCE)
"""designs that estimate the probability of rare failures"""
WORST = "worst-case"
"""design that searches the ranges for the worst case of each requirement"""
SOUGHT = (*RARE, WORST)
OPENTURNS = ("studies of rare failures", "studies")
"""feature that needs OpenTURNS, and its extra"""
DEFAULT_CASES = {SUBSET: 25_600, IMPORTANCE: 4096, WORST: 4096}
"""default limit of the number of cases for each requirement"""
TOGETHER = 1024
"""number of cases in a batch of importance sampling"""
STEPS = 10
"""steps of each chain of subset simulation: a tenth of a level seeds the next level"""
_WHOLE = 640  # a tenth of this, the seeds of the next level, is a whole chunk
_SEARCH = 1024  # chunks of a requirement that are reserved for the search of its design point


@dataclass(frozen=True)
class SoughtDesign:
    """Budget and numbering of a search for each requirement; requirements alternate by chunks.

    Parameters
    ----------
    kind
        One of `SOUGHT`.
    requirements
        Number of requirements.
    asked
        Requested cases in each level of subset simulation.
    budget
        Maximum number of cases for each requirement.
    seed
        Seed of the random numbers.
    quantities
        Number of quantities that vary.
    """

    kind: str
    requirements: int
    asked: int
    budget: int
    seed: int
    quantities: int

    @property
    def level(self) -> int:
        """Number of cases in each level, with whole chunks for each step of its chains."""
        return -(-self.asked // _WHOLE) * _WHOLE

    @property
    def together(self) -> int:
        """Cases per batch."""
        if self.kind == WORST:
            return population(self.quantities)
        return self.level // STEPS if self.kind == SUBSET else TOGETHER

    @property
    def first_sampled(self) -> int:
        """First chunk of a requirement that is sampled and not part of its search."""
        return _SEARCH if self.kind == IMPORTANCE else 0

    def chunk(self, requirement: int, own: int) -> int:
        """Return the number of a chunk in the study from its number within a requirement."""
        return own * self.requirements + requirement

    def has_own_noise(self, chunk: int) -> bool:
        """Whether each case of a chunk has its own noise.

        Cases of a search have the bench's noise. Otherwise, finite differences would contain noise,
        and the worst case would be the worst of many noise samples.
        """
        return self.kind != WORST and chunk // self.requirements >= self.first_sampled

    def require_budget(self) -> None:
        """Reject a budget that is too small for a result.

        Raises
        ------
        ParameterError
            If it is smaller than one batch or level, or larger than the largest study.
        FileError
            If OpenTURNS is not installed.
        """
        if self.kind in RARE:
            library("openturns", *OPENTURNS)
        least = {SUBSET: self.level, IMPORTANCE: _WHOLE}.get(self.kind, self.together)
        if self.budget < least:
            level = ", one level of cases_per_level" if self.kind == SUBSET else ""
            raise not_valid(
                "[design] cases", f"{self.budget}", f">= {least}", f"for {self.kind!r}{level}"
            )
        if self.budget > MOST:
            raise not_valid("[design] cases", f"{self.budget}", f"<= {MOST:.0e}")


def population(quantities: int) -> int:
    """Return the number of cases in a generation of a search: about a chunk per eight quantities.

    It is a power of two, because the sequence visits corners.
    """
    return 64 << (-(-quantities // 8) - 1).bit_length()


def library_version(kind: str) -> str:
    """Return the version of OpenTURNS or SciPy, since another version may draw other points.

    Raises
    ------
    FileError
        If OpenTURNS is not installed.
    """
    if kind != WORST:
        return str(library("openturns", *OPENTURNS).__version__)
    import scipy

    return str(scipy.__version__)
