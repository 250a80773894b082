"""A task that is no single bench's: identification, design."""

from __future__ import annotations

from bywire.server.contents import Contents
from bywire.server.pages.frame import form, frame, section
from bywire.server.task import Task

_SAYS = {
    "identify": "Parameters with their confidence from measured experiments, or a simulated one",
    "design": "Gains of a control loop from requirements",
}
PAGES = tuple(_SAYS)
"""tasks that have a page of their own"""


def task_page(task: Task, there: Contents, largest: int) -> str:
    """Return the page of a task; what it is given stands in `bench_page`."""
    inner = form(task, there, {}, open_fields=4)
    return frame(task.title, _SAYS[task.name], [section("What is asked", task.name, inner)],
                 largest=largest)  # fmt: skip
