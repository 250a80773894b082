"""Use case as a contributor would write it, which counts the letters of a loop's name."""

from dataclasses import dataclass
from typing import Annotated

from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.report.answer import Answer
from bywire.report.document import Document
from bywire.usecases.asks import Changes, LoopName
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

MOST = 9


@dataclass(frozen=True)
class Letters(Answer):
    """Number of letters."""

    count: int

    def document(self) -> Document:
        """Return the number."""
        return Document(
            "Letters", "", sections=[], brief=[str(self.count)], data={"count": self.count}
        )

    @property
    def holds(self) -> bool:
        """Whether there are letters."""
        return self.count > 0


def _read(loop: str, times: int) -> None:
    if times > MOST:
        raise ParameterError(f"{option('times')} = {times}: at most {MOST}, for {loop} too")


@use_case(
    Command("letters", status_1="where there are none"),
    form=Form("Letters of a loop", "Count", "loop"),
    check=_read,
)
def count_letters(
    loop: LoopName,
    overrides: Changes = NOTHING,
    *,
    times: Annotated[
        int, Ask("Number of times to count them.", "Times", name="often", least=0)
    ] = 1,
) -> Letters:
    """Count the letters of a loop's name.

    Parameters
    ----------
    loop
        Name of the loop.
    overrides
        Changes, which do not affect the number.
    times
        Number of times to count them.

    Returns
    -------
    Letters
        The number of letters.

    Raises
    ------
    ParameterError
        If the number of times is too large.
    """
    _read(loop, times)
    return Letters(times * len(loop))
