"""What there is: assemblies, parameter sets, experiments, loops, studies, methods, key figures."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

from bywire.core.brake import brakes
from bywire.core.sources import source_state
from bywire.report.answer import Answer
from bywire.report.document import Document, Listing, Section

_WIDTH = 100  # characters of a line
_NAME = 26  # columns of a name
_HINT = (
    "'bywire list NAME' shows the options, signals and units of one of them, of a parameter "
    "(motor.R_m), a group of parameters (motor), or a signal (p_mc)"
)


@dataclass(frozen=True)
class Overview(Answer):
    """Everything that has a name.

    Parameters
    ----------
    things
        Kind of thing -> name -> summary; a list of names where there is no summary, and the names
        of the key figures of every experiment.
    """

    things: Mapping[str, Any]

    def document(self) -> Document:
        """Return the names with their summaries, kind by kind."""
        lines: list[str] = []
        sections = []
        for title, content in self.things.items():
            pairs = content.items() if isinstance(content, dict) else ((n, "") for n in content)
            entries = [line for name, about in pairs for line in _entry(name, about)]
            lines += [title.replace("_", " "), *entries, ""]
            sections.append(Section(title.replace("_", " "), [Listing(entries)]))
        return Document(
            "What there is", _HINT, sections=sections, brief=["\n".join([*lines, _HINT])],
            data=self.things, has_files=False,
        )  # fmt: skip


def overview() -> Overview:
    """Return everything that has a name, from an index that is made anew when a file changes.

    Making it loads every brake and all that it brings; the index is kept in the folder of compiled
    kernels, so that a listing need not.
    """
    from bywire.simulation.kernel_cache import keep_text, usable_folder

    names = hashlib.sha256(" ".join(brakes()).encode()).hexdigest()[:8]
    index = usable_folder() / f"overview-{names}.json"
    state = source_state().digest
    try:
        kept = json.loads(index.read_text(encoding="utf-8"))
        if kept["state"] == state:
            return Overview(kept["things"])
    except (OSError, ValueError, KeyError, TypeError):
        pass  # none yet, or not ours
    from bywire.api.things import all_things

    things = all_things()
    keep_text(index, json.dumps({"state": state, "things": things}))
    return Overview(things)


def _entry(name: str, about: str | Iterable[str]) -> list[str]:
    """Return the lines of an entry: its summary, or names broken over several lines."""
    if isinstance(about, str):
        return [f"  {name:<{_NAME}}  {about}".rstrip()]
    return wrap(
        f"  {name:<{_NAME}}  {', '.join(about)}", _WIDTH, subsequent_indent=" " * (_NAME + 4)
    )
