"""Find the sizing studies by name."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from bywire.analysis import studies
from bywire.analysis.study import Study
from bywire.core.discovery import declared, pick


@cache
def all_studies() -> Mapping[str, Study]:
    """Return every study: the ``STUDY`` of each module in ``studies``."""
    return declared(studies, "STUDY", Study)


def find_study(name: str) -> Study:
    """Return one study.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    return pick(all_studies(), name, "study")
