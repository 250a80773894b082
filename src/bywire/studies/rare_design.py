"""Designs for rare failures: cases that go where a requirement is missed, found batch by batch.

Which cases come next depends on what the ones before gave. Noise is one of the things that vary,
as in drawn cases: each case has its own.
"""

from __future__ import annotations

from dataclasses import dataclass

from bywire.core.errors import ParameterError
from bywire.data.file_format import library
from bywire.studies.points import MOST

SUBSET, IMPORTANCE = "subset-simulation", "importance-sampling"
RARE = (SUBSET, IMPORTANCE)
"""designs that answer how probable the rare failure of a requirement is"""
LIBRARY = ("studies of rare failures", "studies")
"""who needs OpenTURNS, and the extra that brings it"""
DEFAULT_CASES = {SUBSET: 25_600, IMPORTANCE: 4096}
"""most cases of each requirement where the file does not say"""
TOGETHER = 1024
"""cases of a batch of importance sampling"""
STEPS = 10
"""steps of each chain of subset simulation: a tenth of a level are the seeds of the next"""
_WHOLE = 640  # a tenth of a level, the seeds of the next, are whole chunks
_SEARCH = 1024  # chunks of a requirement that are kept for the search of its design point


@dataclass(frozen=True)
class RareDesign:
    """How the failure of each requirement is looked for; requirements take turns at chunks.

    Parameters
    ----------
    kind
        One of `RARE`.
    requirements
        How many are judged.
    asked
        Cases asked for in each level of subset simulation.
    budget
        Most cases of each requirement.
    seed
        Of its random numbers.
    """

    kind: str
    requirements: int
    asked: int
    budget: int
    seed: int

    @property
    def level(self) -> int:
        """Cases of each level, a whole number of chunks for each step of its chains."""
        return -(-self.asked // _WHOLE) * _WHOLE

    @property
    def together(self) -> int:
        """Cases that are computed at once."""
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

        Those of a search have the bench's: derivatives by differences would be of the noise.
        """
        return chunk // self.requirements >= self.first_sampled

    def require_budget(self) -> None:
        """Refuse a budget with which nothing can be said.

        Raises
        ------
        ParameterError
            When it is below a single level, or larger than a study may be.
        FileError
            When OpenTURNS is not installed.
        """
        library("openturns", *LIBRARY)
        least = self.level if self.kind == SUBSET else 640
        if self.budget < least:
            raise ParameterError(
                f"[design] cases = {self.budget} is too few: {self.kind!r} needs at least {least} "
                + ("(one level of cases_per_level)" if self.kind == SUBSET else "")
            )
        if self.budget > MOST:
            raise ParameterError(f"[design] cases = {self.budget} is too many (at most {MOST:.0e})")


def library_version() -> str:
    """Return the version of OpenTURNS, for another may draw other points.

    Raises
    ------
    FileError
        When it is not installed.
    """
    return str(library("openturns", *LIBRARY).__version__)
