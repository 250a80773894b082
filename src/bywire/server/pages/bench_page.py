"""A bench: its live page, and what needs Python."""

from __future__ import annotations

from urllib.parse import quote

from bywire.server.contents import Contents
from bywire.server.pages.entries import text
from bywire.server.pages.frame import form, frame, link, section
from bywire.server.shown_bench import ShownBench
from bywire.server.task import tasks


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
