"""Pages of files and tasks: benches, studies, reports, forms, refusals."""

from __future__ import annotations

from collections.abc import Mapping
from urllib.parse import quote

from bywire.server.contents import Contents
from bywire.server.live_pages import ShownBench
from bywire.server.pages.frame import form, frame, link, section, text
from bywire.server.task import Task, tasks


def bench_page(bench: ShownBench, there: Contents, largest: int) -> str:
    """Return the page of a bench.

    Parameters
    ----------
    bench
        What is said of it.
    there
        What the folder has.
    largest
        Bytes that a file may have that is dropped.
    """
    given = {"bench": bench.name}
    body = [
        section("Live page", "live", _live(bench)),
        section("Run with Python", "run", form(tasks()["run"], there, given)),
        section("Replay a measurement", "replay", form(tasks()["replay"], there, given)),
    ]
    compared = link("/task/compare", "Compare it with other runs", runs=bench.name)
    file = link(f"/file/{bench.name}", "The bench file") if bench.name in there.benches else ""
    body.append(f"<p>{compared}</p>\n<p>{file}</p>" if file else f"<p>{compared}</p>")
    return frame(bench.name, bench.summary, body, largest=largest)


def _live(bench: ShownBench) -> str:
    if bench.trouble:
        return f"<p>{text(bench.trouble)}</p>"
    cases = bench.cases
    if not cases:
        return "<p>This experiment computes a characteristic without any run: run it.</p>"
    address = f"/live?of={quote(bench.name, safe='')}"
    first = f"{address}&case={quote(cases[0], safe='')}" if len(cases) > 1 else address
    choice = ""
    if len(cases) > 1:
        options = "".join(f'<option value="{text(c)}">{text(c)}</option>' for c in cases)
        choice = (
            f'<p class="field"><label for="live-case">Run</label> <select id="live-case" '
            f'data-address="{text(address)}">{options}</select></p>\n'
        )
    return (
        f'{choice}<iframe id="live" title="Live page of {text(bench.name)}" src="{text(first)}">'
        f'</iframe>\n<p><a id="live-link" href="{text(first)}">The live page by itself</a>: it is '
        "made when it is first opened, which takes a while.</p>"
    )


# --- A study


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


# --- A report


def report_page(name: str) -> str:
    """Return a page that holds a file in a frame, which the policy of this page keeps here.

    What a frame leads to, by its script, by a link or after some time, its holder's policy admits
    or not. A page that is alone in its tab has no holder.
    """
    address = text(quote(f"/file/{name}"))
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{text(name)}</title>
<link rel="stylesheet" href="/assets/serve.css">
</head>
<body class="whole">
<iframe title="{text(name)}" src="{address}" sandbox="allow-scripts allow-downloads"></iframe>
</body>
</html>
"""


# --- A task that is no single bench's


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


# --- A refusal


def refusal_page(status: int, said: str) -> str:
    """Return a page without style or script: who sees it may not have the token."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{status}</title>\n</head>\n<body>\n<h1>bywire: {status}</h1>\n"
        f"<p>{text(said)}</p>\n</body>\n</html>\n"
    )
