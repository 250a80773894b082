"""A reproduction as text for a terminal: numbers and verdicts, then the whole in short."""

from __future__ import annotations

import textwrap

from bywire.report.table_text import table_text
from bywire.reproduction.in_short import in_short
from bywire.reproduction.reproduction import Reproduction
from bywire.reproduction.results import as_table

LONGEST_LINE = 100
"""characters beyond which sentences are hard to read, however wide the terminal"""


def terminal_text(reproduction: Reproduction, width: int, report: str) -> str:
    """Return the table of verdicts, the root causes, the counts, and where to read on.

    Parameters
    ----------
    reproduction
        What was reproduced.
    width
        Characters per line.
    report
        Where the report is, or how to get it.
    """
    lines = [table_text(as_table(reproduction), width), "", "In short"]
    lines += [_bullet(text, min(width, LONGEST_LINE)) for text in in_short(reproduction)]
    return "\n".join([*lines, "", report])


def _bullet(text: str, width: int) -> str:
    return textwrap.fill(
        text, max(width, 20), initial_indent="- ", subsequent_indent="  ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
