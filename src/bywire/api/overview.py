"""What there is: assemblies, parameter sets, experiments, loops, studies, methods, key figures."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bywire.core.brake import brakes
from bywire.core.errors import FileError, unknown_name
from bywire.core.sources import source_state
from bywire.report.answer import Answer
from bywire.report.answering import answering
from bywire.report.document import Document, Section, TableBlock
from bywire.report.tables import Table, text_table

_WIDTH = 80  # characters of a line of the index
_NAME = 21  # columns of a topic
_HINT = (
    "'bywire list TOPIC' opens one of these. 'bywire list NAME' shows all about a\n"
    "name, a parameter (motor.R_m), a group (motor) or a signal (p_mc); of other\n"
    "words, such as battery, what mentions them."
)


@dataclass(frozen=True)
class Overview(Answer):
    """Everything that has a name.

    Parameters
    ----------
    things
        Kind of thing -> name -> summary; a list of names where there is no summary, and the names
        of the key figures of every experiment.
    topic
        The kind that is shown; all where empty.
    doubts
        What is declared for something that does not exist.
    """

    things: Mapping[str, Any]
    topic: str = ""
    doubts: tuple[str, ...] = ()

    @property
    def warnings(self) -> list[str]:
        """What is declared for something that does not exist."""
        return [*self.doubts]

    def document(self) -> Document:
        """Return an index of the kinds, and a table of the names and summaries of each."""
        shown = {self.topic: self.things[self.topic]} if self.topic else self.things
        tables = {key.replace("_", " "): _table(content) for key, content in shown.items()}
        brief = next(iter(tables.items())) if self.topic else None
        return Document(
            "What there is",
            _HINT.replace("\n", " "),
            sections=[Section(title, [TableBlock(table)]) for title, table in tables.items()],
            brief=[brief[0], TableBlock(brief[1])] if brief else [self._index()],
            data=shown,
            has_files=False,
        )

    def _index(self) -> str:
        """Return a line for each kind, and what to do next: a screen of 80 by 24."""
        heads = {
            f"{key.replace('_', ' '):<{_NAME}}{len(content):>3}  ": content
            for key, content in self.things.items()
        }
        lines = [f"{head}{_first(names, _WIDTH - len(head))}" for head, names in heads.items()]
        return "\n".join([*lines, "", _HINT])


@answering
def overview(topic: str = "") -> Overview:
    """Return everything that has a name, from an index that is made anew when a file changes.

    Making it loads every brake and all that it brings; the index is kept in the folder of compiled
    kernels, so that a listing need not.

    Parameters
    ----------
    topic
        The kind of things that is shown, for instance ``"experiments"``; all where empty.

    Returns
    -------
    Overview
        Names and summaries by kind, without units.

    Raises
    ------
    UnknownNameError
        With the nearest topics.
    """
    things, doubts = _things()
    chosen = _plain(topic)
    if topic and chosen not in things:
        raise unknown_name("topic", topic, things)
    return Overview(things, chosen, tuple(doubts))


def is_topic(name: str) -> bool:
    """Return whether a name is one of the kinds that `overview` opens."""
    return _plain(name) in _things()[0]


def _plain(topic: str) -> str:
    return topic.lower().replace("-", "_").replace(" ", "_")


def _things() -> tuple[Mapping[str, Any], list[str]]:
    """Return what there is, and what is doubtful of it."""
    from bywire.simulation.compiler import keep_text, usable_folder

    names = hashlib.sha256(" ".join(brakes()).encode()).hexdigest()[:8]
    index: Path | None = None
    state = source_state().digest
    try:
        index = usable_folder() / f"overview-{names}.json"
        kept = json.loads(index.read_text(encoding="utf-8"))
        if kept["state"] == state:
            return kept["things"], kept["doubts"]
    except (FileError, OSError, ValueError, KeyError, TypeError):
        pass  # none yet, not ours, or no room for any
    from bywire.api.things import all_things, doubts

    things, texts = all_things(), doubts()
    if index is not None:
        keep_text(index, json.dumps({"state": state, "things": things, "doubts": texts}))
    return things, texts


def _first(names: Iterable[str], width: int) -> str:
    """Return as many names as a line has room for."""
    text = ", ".join(names)
    return text if len(text) <= width else text[: width - 4].rpartition(", ")[0] + " ..."


def _table(content: Any) -> Table:
    """Return names with their summaries, or with the names that belong to them."""
    if not isinstance(content, dict):
        return text_table(["name"], [[name] for name in content])
    pairs = content.items()
    return text_table(
        ["name", "meaning"],
        [[n, about if isinstance(about, str) else ", ".join(about)] for n, about in pairs],
    )
