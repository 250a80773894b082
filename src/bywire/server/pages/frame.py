"""What all pages share: head, list of jobs, forms with their fields."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from types import MappingProxyType
from urllib.parse import quote

from bywire.core.version import __version__
from bywire.report.wording import clean
from bywire.server.contents import Contents
from bywire.server.field import Field
from bywire.server.task import Task

_LINES = ("lines", "pairs", "changes", "names")
_SEVERAL = ("files", "things")


def text(shown: str) -> str:
    """Return a text as HTML, harmless in content and attributes."""
    return escape(clean(shown), quote=True)


def row(task: Task, field: Field, there: Contents, chosen: str) -> str:
    """Return a field with its label and its hint; ``chosen`` is what it begins with."""
    name, mark = f"{task.name}-{field.name}", f'name="{text(field.name)}"'
    said = _hint(field)
    hint = f'<p class="hint" id="{name}-hint">{text(said)}</p>' if said else ""
    told = f' aria-describedby="{name}-hint"' if hint else ""
    wanted = " required" if field.is_required else ""
    attributes = f'id="{name}" {mark}{told}{wanted}'
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
    said = field.hint
    if field.kind in _LINES:
        said += " One in a line."
    if field.kind in _SEVERAL:
        said += " Several with Ctrl."
    return said.strip()


def _entry(field: Field, there: Contents, attributes: str, chosen: str) -> str:
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
    """Return what is chosen from: what the folder has, and what is known by name."""
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
        '<progress class="sent" max="1" value="0" hidden></progress></div>'
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
