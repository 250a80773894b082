"""A study of many cases, whose report is written as chunks come."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from bywire.core import option_texts as texts
from bywire.core.errors import BywireError
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import bench_changes, changes_of, path_of
from bywire.server.contents import REPORT
from bywire.server.field import Field
from bywire.server.place import Place
from bywire.server.task import Task
from bywire.server.telling import tell

_ESTIMATE, _REPORT = 1.0, 5.0  # s of computing between two of each at least
_SHARE = 5.0  # and this many times what one took


class _SoFar:
    """Tells what a study shows so far, now and then: between its chunks, which go on after it."""

    def __init__(self, folder: Path, progress: Progress) -> None:
        self._folder, self._progress = folder, progress
        self._pauses = {self._estimate: _ESTIMATE, self._report: _REPORT}
        self._next = dict.fromkeys(self._pauses, -math.inf)  # the first chunk is shown at once

    def __call__(self, label: str, share: float) -> None:
        """Be the progress of the study."""
        self._progress(label, share)
        for tell_it, pause in self._pauses.items():
            begin = time.monotonic()
            if 0.0 < share < 1.0 and begin > self._next[tell_it]:
                with warnings.catch_warnings(), suppress(BywireError):  # too few cases yet: the
                    warnings.simplefilter("ignore")  # last report says what is wrong
                    tell_it()
                end = time.monotonic()
                self._next[tell_it] = end + max(pause, _SHARE * (end - begin))
                self._progress(label, share)

    def _estimate(self) -> None:
        from bywire.api.run_study import kept_study
        from bywire.server.study_so_far import so_far

        tell(so_far=so_far(kept_study(self._folder).findings))

    def _report(self) -> None:
        from bywire.api.run_study import study_report

        written = study_report(self._folder).write(self._folder)
        if any(path.suffix == REPORT for path in written):
            tell(report=True)


def _plan(asked: Mapping[str, Any], place: Place) -> object:
    from bywire.studies.study_file import read_study

    return read_study(path_of(asked["study"], place), changes_of(asked, place))


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.run_study import run_study

    return run_study(
        asked["study"], out, asked["set"], cases=asked["cases"], progress=_SoFar(out, progress)
    )


TASK = Task(
    "study",
    "Run the study",
    "Run, or go on",
    (
        Field(
            "study",
            "Study",
            "thing",
            texts.STUDY_FILE,
            is_required=True,
            offered=lambda there: list(there.studies),
            fits=lambda asked, place: _plan({**asked, "set": {}}, place),
        ),
        Field("cases", "Cases", "whole", texts.STUDY_CASES, least=1),
        bench_changes(_plan),
    ),
    _compute,
    subject="study",
    command="study run",
    is_kept=True,
)
