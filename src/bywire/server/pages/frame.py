"""What all pages share: head, list of jobs, forms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from urllib.parse import quote

from bywire.core.version import __version__
from bywire.server.contents import Contents
from bywire.server.pages.entries import row, text
from bywire.server.task import Task


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
        What is asked for.
    there
        Files that can be chosen.
    given
        Values that the page itself knows: their fields are not shown.
    open_fields
        Fields that are seen at once; the others are folded.
    chosen
        Values with which fields begin.
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
    # The script makes the button work: pressed before it is there, it would send to nowhere.
    return (
        f'<form class="task" data-task="{text(task.name)}">\n{hidden}{first}\n{folded}'
        f'<button type="submit" disabled>{text(task.form.action)}</button>\n</form>'
    )
