"""Messages from a job's process to its server, with a study's results so far."""

from __future__ import annotations

import contextlib
import json
import math
import os
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from bywire.core.errors import BywireError
from bywire.core.typing import Progress
from bywire.server.contents import REPORT

if TYPE_CHECKING:
    from bywire.studies.findings import Findings

_told: list[IO[str]] = []


def begin_to_tell() -> None:
    """Reserve standard output for messages. Output of a brake's code goes to standard error."""
    _told.append(os.fdopen(os.dup(1), "w", encoding="utf-8"))
    os.dup2(2, 1)


def tell(**said: Any) -> None:
    """Send a message to the server, if there is one."""
    for stream in _told:
        with contextlib.suppress(OSError):  # the server has ended, which ends this process
            stream.write(json.dumps(said) + "\n")
            stream.flush()


# --- A study

_ESTIMATE, _REPORT = 1.0, 5.0  # minimum time between two messages of each kind, s
_SHARE = 5.0  # and at least this multiple of the time that one message takes
_MOST = 4  # maximum number of figures of a study without requirements


class StudyProgress:
    """Reporter of a study's results so far, at intervals between its chunks."""

    def __init__(self, folder: Path, progress: Progress) -> None:
        self._folder, self._progress = folder, progress
        self._pauses = {self._estimate: _ESTIMATE, self._report: _REPORT}
        self._next = dict.fromkeys(self._pauses, -math.inf)  # show the first chunk immediately

    def __call__(self, label: str, share: float) -> None:
        """Report the progress of the study."""
        self._progress(label, share)
        for tell_it, pause in self._pauses.items():
            begin = time.monotonic()
            if 0.0 < share < 1.0 and begin > self._next[tell_it]:
                with warnings.catch_warnings(), suppress(BywireError):  # if cases are too few, the
                    warnings.simplefilter("ignore")  # last report gives the error
                    tell_it()
                end = time.monotonic()
                self._next[tell_it] = end + max(pause, _SHARE * (end - begin))
                self._progress(label, share)

    def _estimate(self) -> None:
        from bywire.api.study_run import kept_study

        tell(so_far=so_far(kept_study(self._folder).findings))

    def _report(self) -> None:
        from bywire.usecases.study import study_report

        written = study_report(self._folder).write(self._folder)
        if any(path.suffix == REPORT for path in written):
            tell(report=True)


def so_far(findings: Findings) -> list[dict[str, Any]]:
    """Return intermediate results for each requirement, or else for the first key figures.

    A study that searches for its cases has none, because fractions of such cases mean nothing.

    Parameters
    ----------
    findings
        Findings from the cases so far.

    Returns
    -------
    list of dict
        For each, its ``text``, the ``counts`` of its histogram, and the histogram's ``ends`` with
        units.
    """
    if not findings.plan.is_sampled or not findings.count:
        return []
    return [
        {"text": text, **_bars(findings, name)}
        for name, text in (_judged(findings) if findings.judgments else _spread(findings))
    ]


def _judged(findings: Findings) -> Iterator[tuple[str, str]]:
    from bywire.api.study_tables import percent

    confidence = f"{100.0 * findings.plan.confidence:g} %"
    for each in findings.judgments:
        share = each.share
        low, high = percent(share.low, share), percent(share.high, share)
        yield (
            each.demand.figure,
            (
                f"{each.demand}: {share.count} of {share.cases} cases, probability "
                f"{percent(share.value, share)} ({confidence} interval: {low} to {high})"
            ),
        )


def _spread(findings: Findings) -> Iterator[tuple[str, str]]:
    from bywire.api.study_tables import figure_text

    for each in findings.spreads[:_MOST]:
        mean = figure_text(findings, each.name, each.mean)
        sd = figure_text(findings, each.name, each.sd, is_difference=True)
        yield each.name, f"{each.name}: mean {mean}, standard deviation {sd}"


def _bars(findings: Findings, name: str) -> dict[str, Any]:
    from bywire.api.study_tables import figure_text

    spread = next((each for each in findings.spreads if each.name == name), None)
    if spread is None:
        return {"counts": [], "ends": []}
    ends = [figure_text(findings, name, value) for value in (spread.least, spread.largest)]
    return {"counts": spread.counts.tolist(), "ends": ends}
