"""Live pages of benches, created on the first request and stored until their bench changes."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bywire.bench import bench_file
from bywire.core.errors import FileError, InputError
from bywire.data.toml_file import read_toml
from bywire.server.exchange import RefusedError
from bywire.server.field import is_file_name
from bywire.server.jobs import Job, Jobs
from bywire.server.place import Place
from bywire.server.task import tasks


class LivePages:
    """The live pages of a server.

    Parameters
    ----------
    place, jobs
        The served folder, and the jobs that create the pages.
    scratch
        Folder that stores the pages.
    """

    def __init__(self, place: Place, jobs: Jobs, scratch: Path) -> None:
        self._place, self._jobs, self._scratch = place, jobs, scratch
        self._made: dict[str, Job] = {}
        self._lock = threading.Lock()

    def file(self, bench: str, case: str) -> Path:
        """Return the file of a bench's live page, which is created if missing.

        Raises
        ------
        InputError
            If the bench file is invalid.
        RefusedError
            With status 422 and the reason if the page cannot be created.
        """
        task = tasks()["page"]
        asked = task.read({"bench": bench, "case": case}, self._place)
        key = hashlib.sha256("\n".join(self._state(asked)).encode()).hexdigest()[:32]
        with self._lock:
            job = self._made.get(key)
            if job is None or (job.ended.is_set() and job.state != "done"):
                job = self._jobs.start(task, asked, self._scratch / f"{key}.html")
                self._made[key] = job
        job.ended.wait()
        if job.state != "done":
            raise RefusedError(422, job.message or "the page was canceled. Reload it")
        return job.out

    def _state(self, asked: dict[str, Any]) -> Iterator[str]:
        """Yield the inputs of the page: the bench file, and the files that it lists."""
        yield from (asked["bench"], asked["case"])
        if not is_file_name(asked["bench"]):
            return
        file = self._place.root / asked["bench"]
        content = read_toml(file, "bench file")
        yield repr(content)
        for text in _texts(content):
            if len(text) < 1000 and "\0" not in text and (file.parent / text).is_file():
                status = (file.parent / text).stat()
                yield f"{text} {status.st_mtime_ns} {status.st_size}"


def _texts(content: Any) -> Iterator[str]:
    if isinstance(content, str):
        yield content
    elif isinstance(content, (dict, list)):
        for each in content.values() if isinstance(content, dict) else content:
            yield from _texts(each)


def experiments() -> dict[str, str]:
    """Return the summary of each experiment, by its name.

    Raises
    ------
    FileError
        If the index of experiments cannot be created.
    """
    from bywire.api.overview import overview

    try:
        every: dict[str, str] = dict(overview().things["experiments"])
    except OSError as error:
        raise FileError(f"cannot list experiments: {error}") from None
    return every


# --- A bench on its page, before any computation


@dataclass(frozen=True)
class ShownBench:
    """Bench that a page shows.

    Parameters
    ----------
    name
        File of the bench, or the experiment.
    summary
        Purpose of the test.
    cases
        Runs of the bench.
    trouble
        Reason why the bench has no runs with its defaults.
    """

    name: str
    summary: str
    cases: tuple[str, ...] = ()
    trouble: str = ""


def shown_bench(path: Path, name: str) -> ShownBench:
    """Return the page content of a bench file, or of an experiment with its defaults.

    Raises
    ------
    InputError
        If the bench file is invalid.
    """
    try:
        bench = bench_file.read(path, {})
    except InputError as error:
        if is_file_name(name):
            raise
        # The stimulus is missing, but a measurement may provide it.
        return ShownBench(name, experiments()[name], trouble=str(error))
    # Use the preview. Actual runs may start where earlier runs ended, which takes a while.
    cases = bench.cases_with(bench.par, bench.chosen_options, bench.definition.preview)
    summary = f"{bench.summary()}; parameters {bench.parameters}"
    return ShownBench(name, summary, tuple(case.label for case in cases))
