"""Pages of the server: start page, benches, studies, reports, forms, error pages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from types import MappingProxyType
from urllib.parse import quote

from bywire.core.version import __version__
from bywire.report.wording import clean
from bywire.server.contents import Contents
from bywire.server.field import Field
from bywire.server.live_pages import ShownBench
from bywire.server.task import Task, tasks

_LINES = ("lines", "pairs", "changes", "names")
_SEVERAL = ("files", "things")


def text(shown: str) -> str:
    """Return a text escaped for HTML content and attributes."""
    return escape(clean(shown), quote=True)


def row(task: Task, field: Field, there: Contents, chosen: str) -> str:
    """Return a field with its label and its hint. ``chosen`` is its initial value."""
    name, mark = f"{task.name}-{field.name}", f'name="{text(field.name)}"'
    words = _hint(field)
    hint = f'<p class="hint" id="{name}-hint">{text(words)}</p>' if words else ""
    described = f' aria-describedby="{name}-hint"' if hint else ""
    required = " required" if field.is_required else ""
    attributes = f'id="{name}" {mark}{described}{required}'
    if field.kind == "flag":
        checked = " checked" if field.default else ""
        return (
            f'<div class="field flag"><input type="checkbox" {attributes}{checked}> '
            f'<label for="{name}">{text(field.label)}</label>\n{hint}</div>'
        )
    return (
        f'<div class="field"><label for="{name}">{text(field.label)}</label>\n'
        f"{_entry(field, there, attributes, chosen)}\n{hint}</div>"
    )


def _hint(field: Field) -> str:
    hint = field.hint
    if field.kind in _LINES:
        hint += " One per line."
    if field.kind in _SEVERAL:
        hint += " Select several with Ctrl."
    return hint.strip()


def _entry(field: Field, there: Contents, attributes: str, chosen: str) -> str:
    if field.example:
        attributes += f' placeholder="{text(field.example)}"'
    if field.kind in _LINES:
        return f'<textarea rows="2" spellcheck="false" {attributes}>{text(chosen)}</textarea>'
    if field.kind in ("file", "files"):
        return _drop(_select(field, [*there.measurements], attributes, chosen))
    if field.kind in ("choice", "thing", "things"):
        offered = field.offered(there) if field.offered is not None else ()
        return _select(field, offered, attributes, chosen)
    numeric = ' inputmode="numeric"' if field.kind == "whole" else ""
    shown = chosen or ("" if field.default is None else str(field.default))
    return (
        f'<input type="text" spellcheck="false" autocomplete="off"{numeric} {attributes} '
        f'value="{text(shown)}">'
    )


def _select(field: Field, offered: Iterable[str], attributes: str, chosen: str) -> str:
    """Return a selection of files in the folder and known names."""
    many = f' multiple size="{8 if field.choices else 4}"' if field.kind in _SEVERAL else ""
    here = _options(offered, chosen)
    known = _options(field.choices(), chosen) if field.choices is not None else ""
    if here and known:
        here = f'<optgroup label="in this folder">{here}</optgroup>'
        known = f'<optgroup label="by name">{known}</optgroup>'
    none = "" if many or (field.is_required and (here or known)) else '<option value="">-</option>'
    return f"<select {attributes}{many}>{none}{here}{known}</select>"


def _drop(chosen: str) -> str:
    return (
        f'<div class="drop">{chosen}\n<label class="pick">or drop a file here, or '
        '<span>choose one</span><input type="file" class="upload"></label>\n'
        '<progress class="sent" max="1" value="0" hidden></progress></div>\n'
        '<div class="columns" aria-live="polite" hidden></div>'
    )


def _options(names: Iterable[str], chosen: str) -> str:
    return "".join(
        f'<option value="{text(n)}"{" selected" if n == chosen else ""}>{text(n)}</option>'
        for n in names
    )


# --- The frame


def frame(title: str, summary: str, body: Iterable[str], *, largest: int) -> str:
    """Return a page.

    Parameters
    ----------
    title, summary
        Heading and the line below it, as plain text.
    body
        HTML.
    largest
        Maximum size of an uploaded file, in bytes.
    """
    inner = "\n".join(body)
    return f"""<!DOCTYPE html>
<html lang="en"> <head> <meta charset="utf-8"> <meta name="viewport" content="width=device-width,
initial-scale=1"> <title>{text(title)}</title> <link rel="stylesheet" href="/assets/page.css"> <link
rel="stylesheet" href="/assets/serve.css"> <script src="/assets/columns.js" defer></script> <script
src="/assets/serve.js" defer></script> </head> <body data-largest="{largest}"> <header> <p
class="home"><a href="/">Folder overview</a></p> <h1>{text(title)}</h1> <p
class="summary">{text(summary)}</p> <p id="message" class="status bad" role="alert" hidden></p>
<noscript><p class="status bad">These pages need JavaScript. Allow JavaScript for this
address.</p></noscript> </header> <main> {inner} <section aria-labelledby="jobs-title"> <h2
id="jobs-title">Jobs</h2> <p id="no-jobs">No jobs since the server started.</p> <ul id="jobs"></ul>
<p id="spoken" class="spoken" role="status"></p> </section> </main> <footer>bywire
{text(__version__)}, on this machine only</footer> </body> </html>
"""


def section(title: str, name: str, inner: str) -> str:
    """Return a section of a page. ``inner`` is HTML."""
    return (
        f'<section aria-labelledby="{name}-title">\n<h2 id="{name}-title">{text(title)}</h2>\n'
        f"{inner}\n</section>"
    )


def link(target: str, name: str, **query: str) -> str:
    """Return a link to a page of the server."""
    asked = "&".join(f"{key}={quote(value, safe='')}" for key, value in query.items())
    address = quote(target) + (f"?{asked}" if asked else "")
    return f'<a href="{text(address)}">{text(name)}</a>'


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table whose cells are HTML."""
    head = "".join(f'<th scope="col">{text(each)}</th>' for each in headings)
    body = "\n".join("<tr>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>" for row in rows)
    return (
        f'<div class="scroll"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>\n'
        "</table></div>"
    )


def form(
    task: Task,
    there: Contents,
    given: Mapping[str, str],
    open_fields: int = 3,
    chosen: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """Return the form of a task.

    Parameters
    ----------
    task
        The task.
    there
        Files to choose from.
    given
        Values that the page determines. Their fields are hidden.
    open_fields
        Number of fields to show. The others are collapsed.
    chosen
        Initial values of fields.
    """
    hidden = "".join(
        f'<input type="hidden" name="{text(name)}" value="{text(value)}">'
        for name, value in given.items()
    )
    shown = [
        row(task, field, there, chosen.get(field.name, ""))
        for field in task.fields
        if field.name not in given
    ]
    first, others = "\n".join(shown[:open_fields]), "\n".join(shown[open_fields:])
    folded = f"<details>\n<summary>More</summary>\n{others}\n</details>\n" if others else ""
    # The script enables the button. Without the script, the button would send the form nowhere.
    return (
        f'<form class="task" data-task="{text(task.name)}">\n{hidden}{first}\n{folded}'
        f'<button type="submit" disabled>{text(task.form.action)}</button>\n</form>'
    )


# --- The start page

_SHOWN = 200  # reports, and measurements


def index_page(folder: str, there: Contents, experiments: Mapping[str, str], largest: int) -> str:
    """Return the start page.

    Parameters
    ----------
    folder
        Name of the folder.
    there
        Contents of the folder.
    experiments
        Experiments of all known brakes, with their summaries.
    largest
        Maximum size of an uploaded file, in bytes.
    """
    benches = [[link("/bench", name, of=name), text(what)] for name, what in there.benches.items()]
    studies = [[link("/study", name, of=name), text(what)] for name, what in there.studies.items()]
    reports = [[link(f"/file/{name}", name)] for name in there.reports[:_SHOWN]]
    others = [[link("/bench", name, of=name), text(what)] for name, what in experiments.items()]
    campaigns = [
        [link("/task/faults", name, campaign=name), text(what)]
        for name, what in there.campaigns.items()
    ]
    lives = [
        [link("/task/life", name, life=name), text(what)] for name, what in there.lives.items()
    ]
    procedures = [
        [link("/task/procedure", name, procedure=name), text(what)]
        for name, what in there.procedures.items()
    ]
    tools = [
        [link(f"/task/{each.name}", each.form.title), text(each.case.summary)]
        for each in tasks().values()
        if each.form.is_listed
    ]
    body = [
        section("Benches", "benches", _listed(["file", "experiment"], benches, "bench files")),
        section("Studies", "studies", _listed(["file", "bench"], studies, "study files")),
        *(
            [section("Fault campaigns", "campaigns", table(["file", "bench"], campaigns))]
            if campaigns
            else []
        ),
        *([section("Lives", "lives", table(["file", "life"], lives))] if lives else []),
        *(
            [section("Procedures", "procedures", table(["file", "title"], procedures))]
            if procedures
            else []
        ),
        section("Tools", "tools", table(["task", "description"], tools)),
        section("Reports", "reports", _listed(["page"], reports, "reports")),
        section(
            "Experiments",
            "experiments",
            "<details>\n<summary>with their defaults, without a bench file</summary>\n"
            f"{table(['experiment', 'description'], others)}\n</details>",
        ),
    ]
    if not there.is_whole:
        body.insert(
            0,
            "<p>The folder contains more files than listed here. Serve a smaller "
            "folder to see all.</p>",
        )
    return frame(folder, "Benches, studies and results in this folder", body, largest=largest)


def _listed(headings: list[str], rows: list[list[str]], what: str) -> str:
    return table(headings, rows) if rows else f"<p>There are no {text(what)} yet.</p>"


# --- Benches, studies, reports, forms, error pages


def bench_page(bench: ShownBench, there: Contents, largest: int) -> str:
    """Return the page of a bench.

    Parameters
    ----------
    bench
        The bench.
    there
        Contents of the folder.
    largest
        Maximum size of an uploaded file, in bytes.
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
        return "<p>This experiment computes a characteristic, not a run. Use Run with Python.</p>"
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
        f'</iframe>\n<p><a id="live-link" href="{text(first)}">Open only the live '
        "page</a>. The first start takes a while.</p>"
    )


# --- A study


def study_page(
    study: str, bench: str, report: str, progress: str, there: Contents, largest: int
) -> str:
    """Return the page of a study.

    Parameters
    ----------
    study, bench
        Study file, and the bench that the study varies.
    report
        Path of the study's page in the folder, whether or not it exists (see
        `bywire.server.routes`).
    progress
        Progress of the study as a sentence.
    there
        Contents of the folder.
    largest
        Maximum size of an uploaded file, in bytes.
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
        section("Results", "shown", seen),
        f"<p>{link(f'/file/{study}', 'The study file')}</p>",
    ]
    return frame(study, f"Study of {bench}", body, largest=largest)


# --- A report


def report_page(name: str) -> str:
    """Return a page that shows a file in a frame, which the policy of this page restricts.

    The outer page's policy determines where a script, a link or a timer in the frame may navigate.
    A file opened directly in a tab would have no outer page.
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


# --- A task that does not belong to a single bench


def task_page(task: Task, there: Contents, chosen: Mapping[str, str], largest: int) -> str:
    """Return the page of a task. ``chosen`` contains initial values of fields."""
    inner = form(task, there, {}, open_fields=4, chosen=chosen)
    return frame(
        task.form.title,
        task.case.summary,
        [section("Settings", task.name, inner)],
        largest=largest,
    )


# --- Error pages


def refusal_page(status: int, message: str) -> str:
    """Return an error page without style or script, because its reader may lack the token."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{status}</title>\n</head>\n<body>\n<h1>bywire: {status}</h1>\n"
        f"<p>{text(message)}</p>\n</body>\n</html>\n"
    )
