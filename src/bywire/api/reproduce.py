"""A paper's tables and figures: stated, computed, agrees or not."""

from __future__ import annotations

from bywire.bench.running import Progress
from bywire.core.blas import on_one_thread
from bywire.report.answer import use_case
from bywire.reproduction.reproduction import SOURCES, Reproduction


@use_case
@on_one_thread()
def reproduce(source: str, *, progress: Progress | None = None) -> Reproduction:
    """Reproduce every table and figure of a published source; a disagreement is no error.

    Parameters
    ----------
    source
        Name of the source, for instance ``"dardanelli2010"``.
    progress
        Called with the label of a table or figure and its finished share, 0 to 1.

    Returns
    -------
    Reproduction
        What is stated beside what is computed, each in the unit of the statement.

    Raises
    ------
    UnknownNameError
        With the nearest known sources.
    RunError
        When a run fails.
    """
    return SOURCES.find(source).reproduce(progress)
