"""Designs that seek: which cases come next depends on what the ones before gave.

They go where a requirement is missed: to its rare failures, or to the worst case. In rare failures
noise is one of the things that vary, as in drawn cases: each case has its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import scipy

from bywire.core.errors import ParameterError
from bywire.data.file_format import library
from bywire.studies.points import MOST

SUBSET, IMPORTANCE = "subset-simulation", "importance-sampling"
RARE = (SUBSET, IMPORTANCE)
"""designs that answer how probable the rare failure of a requirement is"""
WORST = "worst-case"
"""design that searches the ends of what varies for the worst case of each requirement"""
SOUGHT = (*RARE, WORST)
LIBRARY = ("studies of rare failures", "studies")
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
            library("openturns", *LIBRARY)
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
    return str(scipy.__version__ if kind == WORST else library("openturns", *LIBRARY).__version__)
