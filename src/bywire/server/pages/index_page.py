"""The start page: what the folder has."""

from __future__ import annotations

from collections.abc import Mapping

from bywire.server.contents import Contents
from bywire.server.pages.frame import frame, link, section, table, text
from bywire.server.task import tasks

_SHOWN = 200  # reports, and measurements


def index_page(folder: str, there: Contents, experiments: Mapping[str, str], largest: int) -> str:
    """Return the start page.

    Parameters
    ----------
    folder
        How it is called.
    there
        What it has.
    experiments
        Those of every brake that is known, with what each is.
    largest
        Bytes that a file may have that is dropped.
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
        section("Further work", "tools", table(["task", "what it gives"], tools)),
        section("Reports", "reports", _listed(["page"], reports, "reports")),
        section(
            "Experiments",
            "experiments",
            "<details>\n<summary>with their defaults, without a bench file</summary>\n"
            f"{table(['experiment', 'what it is'], others)}\n</details>",
        ),
    ]
    if not there.is_whole:
        body.insert(0, "<p>The folder has more files than are listed: serve a smaller one.</p>")
    return frame(folder, "Benches, studies and results of this folder", body, largest=largest)


def _listed(headings: list[str], rows: list[list[str]], what: str) -> str:
    return table(headings, rows) if rows else f"<p>There are no {text(what)} yet.</p>"
