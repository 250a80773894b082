"""A study: how far it is, and its report as chunks come."""

from __future__ import annotations

from urllib.parse import quote

from bywire.server.contents import Contents
from bywire.server.pages.entries import text
from bywire.server.pages.frame import form, frame, link, section
from bywire.server.task import tasks


def study_page(
    study: str, bench: str, report: str, progress: str, there: Contents, largest: int
) -> str:
    """Return the page of a study.

    Parameters
    ----------
    study, bench
        Its file, and what is varied.
    report
        Its page in the folder, whether or not it is there; see `bywire.server.routes`.
    progress
        How far it is.
    there
        What the folder has.
    largest
        Bytes that a file may have that is dropped.
    """
    is_there = report in there.reports
    address = text(quote(f"/file/{report}"))
    source = f' src="{address}"' if is_there else " hidden"
    seen = (
        f'<p id="study-progress">{text(progress)}</p>\n<ul id="study-so-far"></ul>\n'
        f'<iframe id="study-report" '
        f'title="Report of {text(study)}" data-address="{address}"{source}></iframe>'
    )
    body = [
        section("Run the study", "study", form(tasks()["study"], there, {"study": study})),
        section("What it shows", "shown", seen),
        f"<p>{link(f'/file/{study}', 'The study file')}</p>",
    ]
    return frame(study, f"Study of {bench}", body, largest=largest)
