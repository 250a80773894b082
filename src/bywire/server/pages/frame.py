"""What all pages share: head, list of jobs, forms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from urllib.parse import quote

from bywire.core.version import __version__
from bywire.report.wording import clean
from bywire.server.contents import Contents
from bywire.server.task import Field, Task


def text(shown: str) -> str:
    """Return a text as HTML, harmless in content and attributes."""
    return escape(clean(shown), quote=True)


def frame(title: str, summary: str, body: Iterable[str], *, largest: int) -> str:
    """Return a page.

    Parameters
    ----------
    title, summary
        Its heading and the line below, plain text.
    body
        HTML.
    largest
        Bytes that a file may have that is dropped.
    """
    inner = "\n".join(body)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{text(title)}</title>
<link rel="stylesheet" href="/assets/page.css">
<link rel="stylesheet" href="/assets/serve.css">
<script src="/assets/serve.js" defer></script>
</head>
<body data-largest="{largest}">
<header>
<p class="home"><a href="/">All of this folder</a></p>
<h1>{text(title)}</h1>
<p class="summary">{text(summary)}</p>
<p id="message" class="status bad" role="alert" hidden></p>
<noscript><p class="status bad">These pages need their script: allow it here.</p></noscript>
</header>
<main>
{inner}
<section aria-labelledby="jobs-title">
<h2 id="jobs-title">Jobs</h2>
<p id="no-jobs">Nothing was computed since the server was started.</p>
<ul id="jobs"></ul>
<p id="spoken" class="spoken" role="status"></p>
</section>
</main>
<footer>bywire {text(__version__)}, on this machine only</footer>
</body>
</html>
"""


def section(title: str, name: str, inner: str) -> str:
    """Return a section of a page; ``inner`` is HTML."""
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


def form(task: Task, there: Contents, given: Mapping[str, str], open_fields: int = 3) -> str:
    """Return the form of a task.

    Parameters
    ----------
    task
        What is asked for.
    there
        Files that can be chosen.
    given
        Values that the page itself knows: their fields are not shown.
    open_fields
        Fields that are seen at once; the others are folded.
    """
    hidden = "".join(
        f'<input type="hidden" name="{text(name)}" value="{text(value)}">'
        for name, value in given.items()
    )
    shown = [_row(task, field, there) for field in task.fields if field.name not in given]
    first, others = "\n".join(shown[:open_fields]), "\n".join(shown[open_fields:])
    folded = f"<details>\n<summary>More</summary>\n{others}\n</details>\n" if others else ""
    return (
        f'<form class="task" data-task="{text(task.name)}">\n{hidden}{first}\n{folded}'
        f'<button type="submit">{text(task.action)}</button>\n</form>'
    )


def _row(task: Task, field: Field, there: Contents) -> str:
    name, mark = f"{task.name}-{field.name}", f'name="{text(field.name)}"'
    hint = f'<p class="hint" id="{name}-hint">{text(field.hint)}</p>' if field.hint else ""
    told = f' aria-describedby="{name}-hint"' if hint else ""
    wanted = " required" if field.is_required else ""
    attributes = f'id="{name}" {mark}{told}{wanted}'
    if field.kind == "flag":
        return (
            f'<p class="field flag"><input type="checkbox" {attributes}> '
            f'<label for="{name}">{text(field.label)}</label></p>{hint}'
        )
    return (
        f'<div class="field"><label for="{name}">{text(field.label)}</label>\n'
        f"{_entry(field, there, attributes)}\n{hint}</div>"
    )


def _entry(field: Field, there: Contents, attributes: str) -> str:
    if field.kind in ("lines", "pairs", "changes", "names"):
        return f'<textarea rows="2" spellcheck="false" {attributes}></textarea>'
    if field.choices is not None:
        return f"<select {attributes}>{_options(field.choices())}</select>"
    if field.kind in ("file", "files"):
        is_map = field.name == "mapping"
        names = there.maps if is_map else list(there.measurements)
        many = ' multiple size="4"' if field.kind == "files" else ""
        none = [] if many or field.is_required else [""]
        chosen = f"<select {attributes}{many}>{_options([*none, *names])}</select>"
        return chosen if is_map else _drop(chosen)
    if field.kind == "bench":
        return f"<select {attributes}>{_options(['', *there.benches])}</select>"
    return f'<input type="text" spellcheck="false" autocomplete="off" {attributes}>'


def _drop(chosen: str) -> str:
    return (
        f'<div class="drop">{chosen}\n<label class="pick">or drop a file here, or '
        '<span>choose one</span><input type="file" class="upload"></label>\n'
        '<progress class="sent" max="1" value="0" hidden></progress></div>'
    )


def _options(names: Sequence[str]) -> str:
    return "".join(f'<option value="{text(n)}">{text(n) or "-"}</option>' for n in names)
