"""A task that is no single bench's: what it asks."""

from __future__ import annotations

from collections.abc import Mapping

from bywire.server.contents import Contents
from bywire.server.pages.frame import form, frame, section
from bywire.server.task import Task


def task_page(task: Task, there: Contents, chosen: Mapping[str, str], largest: int) -> str:
    """Return the page of a task; what it is given stands in `bench_page`.

    ``chosen`` has values of fields, with which the form begins.
    """
    inner = form(task, there, {}, open_fields=4, chosen=chosen)
    return frame(
        task.form.title,
        task.case.summary,
        [section("What is asked", task.name, inner)],
        largest=largest,
    )
