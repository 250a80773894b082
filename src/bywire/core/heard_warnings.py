"""Warnings that a command, a job or a process of a study records, to tell them in its own words."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

_FOR_DEVELOPERS = (
    DeprecationWarning,
    PendingDeprecationWarning,
    ImportWarning,
    ResourceWarning,
)
"""what Python hides by default: a user can do nothing about it"""


@contextmanager
def heard_warnings() -> Iterator[list[warnings.WarningMessage]]:
    """Yield a list to which every warning is added until the block ends, each time it is given.

    Those for developers are left out, unless whoever started Python asked for warnings.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for category in () if sys.warnoptions else _FOR_DEVELOPERS:
            warnings.simplefilter("ignore", category)
        yield caught
