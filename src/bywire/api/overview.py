"""Index of all names: assemblies, parameter sets, experiments, loops, studies, methods, etc."""

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
    "'bywire list TOPIC' lists the names in a topic. 'bywire list NAME' shows details\n"
    "of a name, parameter (motor.R_m), group (motor) or signal (p_mc).\n"
    "'bywire list WORD' searches for any other word, such as battery."
)


@dataclass(frozen=True)
class Overview(Answer):
    """Index of everything that has a name.

    Parameters
    ----------
    things
        Kind of thing -> name -> summary, or a list of names without summaries. Also contains the
        key figure names of every experiment.
    topic
        Topic to show. If empty, all topics.
    doubts
        Declarations that refer to something that does not exist.
    """

    things: Mapping[str, Any]
    topic: str = ""
    doubts: tuple[str, ...] = ()

    @property
    def warnings(self) -> list[str]:
        """Declarations that refer to something that does not exist."""
        return [*self.doubts]

    def document(self) -> Document:
        """Return an index of the topics, and each topic's names and summaries."""
        shown = {self.topic: self.things[self.topic]} if self.topic else self.things
        tables = {key.replace("_", " "): _table(content) for key, content in shown.items()}
        brief = next(iter(tables.items())) if self.topic else None
        return Document(
            "Index",
            _HINT.replace("\n", " "),
            sections=[Section(title, [TableBlock(table)]) for title, table in tables.items()],
            brief=[brief[0], TableBlock(brief[1])] if brief else [self._index()],
            data=shown,
            has_files=False,
        )

    def _index(self) -> str:
        """Return one line per topic, and a hint, for a terminal of 80 by 24 characters."""
        heads = {
            f"{key.replace('_', ' '):<{_NAME}}{len(content):>3}  ": content
            for key, content in self.things.items()
        }
        lines = [f"{head}{_first(names, _WIDTH - len(head))}" for head, names in heads.items()]
        return "\n".join([*lines, "", _HINT])


@answering
def overview(topic: str = "") -> Overview:
    """List everything that has a name, from an index that bywire rebuilds when a file changes.

    Building the index loads every brake with all its parts. bywire caches the index in the folder
    of compiled kernels, so that a listing does not load the brakes.

    Parameters
    ----------
    topic
        Kind of things to show, for example ``"experiments"``. If empty, all kinds.

    Returns
    -------
    Overview
        Names and summaries by kind, without units.

    Raises
    ------
    UnknownNameError
        If the topic is unknown. The message lists the closest matches.
    """
    things, doubts = _things()
    chosen = _plain(topic)
    if topic and chosen not in things:
        raise unknown_name("topic", topic, things)
    return Overview(things, chosen, tuple(doubts))


def is_topic(name: str) -> bool:
    """Return whether a name is a topic of `overview`."""
    return _plain(name) in _things()[0]


def _plain(topic: str) -> str:
    """Return a topic in the spelling of the index; ``sets`` means parameter sets."""
    plain = topic.lower().replace("-", "_").replace(" ", "_")
    return "parameter_sets" if plain == "sets" else plain


def _things() -> tuple[Mapping[str, Any], list[str]]:
    """Return all names by kind, and doubtful declarations."""
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
        pass  # no index yet, an invalid one, or no space for one
    from bywire.api.things import all_things, doubts

    things, texts = all_things(), doubts()
    if index is not None:
        keep_text(index, json.dumps({"state": state, "things": things, "doubts": texts}))
    return things, texts


def _first(names: Iterable[str], width: int) -> str:
    """Return as many names as fit in a line."""
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
