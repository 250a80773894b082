"""The fields of a form as HTML: label, entry and hint of each."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

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
