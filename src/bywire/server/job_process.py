"""Process of a job: one call of a public function, reported line by line.

The order arrives as a line of JSON on standard input: ``{task, asked, folder, out, systems}``.
Messages go as such lines to standard output: ``{progress: [label, share]}``, ``{report: true}``,
``{so_far}`` of a study, and finally one of ``{done}``, ``{error}`` and ``{canceled}``. When the
server ends, standard input closes, and this process ends with all its child processes.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core.callers import collected_warnings
from bywire.core.errors import BywireError
from bywire.core.interrupts import interrupt_handled, interrupts_noted
from bywire.server.study_so_far import begin_to_tell, tell

_PAUSE = 0.1  # s between two messages on progress


def main() -> None:
    """Run the ordered computation."""
    # As for commands, run the registered exit functions, then skip Python's finalization.
    atexit.register(os._exit, 0)
    begin_to_tell()
    with contextlib.suppress(OSError):  # if memory runs out, the system ends this process first
        Path("/proc/self/oom_score_adj").write_text("900")
    with interrupts_noted() as was_interrupted:
        try:
            line = sys.stdin.buffer.readline()
            threading.Thread(target=_end_with_the_server, daemon=True).start()
            _compute(json.loads(line))
        except KeyboardInterrupt as stop:
            interrupt_handled()
            tell(canceled=" ".join(map(str, stop.args)))
        except Exception as error:
            if was_interrupted():
                tell(canceled="")
            else:
                tell(error=_explained(error))


def _end_with_the_server() -> None:
    while sys.stdin.buffer.read(4096):
        pass
    if hasattr(os, "killpg"):
        os.killpg(os.getpgid(0), signal.SIGKILL)
    os._exit(1)


def _explained(error: Exception) -> str:
    from bywire.core.brake import foreign_line

    if isinstance(error, BywireError):
        return str(error)
    if isinstance(error, OSError):
        place = f"{error.filename}: " if error.filename else ""
        return (
            f"{place}{error.strerror or error}. Check that it exists and that the disk is not full"
        )
    if line := foreign_line(error):
        return line
    traceback.print_exception(error)
    return (
        f"{type(error).__name__}: this is a bug in bywire. Please report it with the lines that "
        "the "
        "server printed"
    )


def _compute(order: Mapping[str, Any]) -> None:
    from bywire.core.brake import load_system
    from bywire.core.callers import command_line
    from bywire.core.libraries import silence_matplotlib
    from bywire.report.answer import AnswerWarning, load_matplotlib, write_document
    from bywire.server.task import tasks

    silence_matplotlib()
    load_matplotlib()
    os.chdir(order["folder"])
    task, out = tasks()[order["task"]], Path(order["out"])
    with collected_warnings() as caught, command_line():
        for path in order["systems"]:
            load_system(path)
        answer = task.compute(order["asked"], out, _Words())
        if getattr(answer, "status", "") == "interrupted":
            raise KeyboardInterrupt
        document = answer.document()
        files = [] if task.form.is_file else write_document(document, out)
        others = [str(w.message) for w in caught if not issubclass(w.category, AnswerWarning)]
        said = [*others, *answer.warnings, *answer.notes, *answer.failures, *document.remarks]
        tell(
            done={
                "page": document.page_name if document.is_paged and files else "",
                "holds": answer.holds,
                "said": list(dict.fromkeys(said)),
                "headline": document.banner.text if document.banner is not None else "",
            }
        )


class _Words:
    """Progress, reported at intervals."""

    def __init__(self) -> None:
        self._last, self._next = ("", -1.0), 0.0

    def __call__(self, label: str, share: float) -> None:
        """Report the progress if it has changed."""
        now, word = time.monotonic(), (label, round(float(share), 3))
        if word != self._last and (now > self._next or label != self._last[0] or share >= 1.0):
            self._last, self._next = word, now + _PAUSE
            tell(progress=list(word))


if __name__ == "__main__":
    main()
