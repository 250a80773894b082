"""Reproduction of a paper's tables and figures, with published and computed values."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from bywire.core.libraries import on_one_thread
from bywire.usecases.declare import Ask, Form, use_case

if TYPE_CHECKING:
    from bywire.core.typing import Progress
    from bywire.reproduction.reproduction import Reproduction


def _sources() -> Sequence[str]:
    from bywire.reproduction.reproduction import SOURCES

    return sorted(SOURCES.all())


SourceName = Annotated[str, Ask("Published source, e.g. dardanelli2010.", "Source", words=_sources)]


@use_case("reproduce", form=Form("Reproduce a source", "Reproduce", "source"))
@on_one_thread()
def reproduce(source: SourceName, *, progress: "Progress | None" = None) -> "Reproduction":
    """Reproduce a paper's tables and figures, and compare computed values with the published ones.

    Parameters
    ----------
    source
        Name of the source, for example ``"dardanelli2010"``.
    progress
        Called with the label of a table or figure and its completed fraction, 0 to 1.

    Returns
    -------
    Reproduction
        Published and computed values side by side, in the units of the source.

    Raises
    ------
    UnknownNameError
        If the source is unknown. The message lists the closest matches.
    RunError
        If a run fails.
    """
    from bywire.reproduction.reproduction import SOURCES

    return SOURCES.find(source).reproduce(progress)
