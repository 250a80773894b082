"""What a word means here: everything whose declared name, meaning or unit mentions it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, NamedTuple

from bywire.analysis.linear.plant import PLANTS
from bywire.analysis.loop import LOOPS
from bywire.api.described_parameters import group_meaning
from bywire.api.described_systems import signals, system_summary
from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS
from bywire.bench.kpis.registry import definitions
from bywire.bench.stimuli.registry import STIMULI
from bywire.core.catalog import PARAMETER_SETS, main_set
from bywire.core.errors import quoted
from bywire.core.field_notes import field_notes
from bywire.core.model import ASSEMBLIES
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.quantities import display_unit
from bywire.identification.fitting.question import BENCH_METHODS
from bywire.identification.method import METHODS
from bywire.report.answer import Answer
from bywire.report.document import Document, Section, TableBlock
from bywire.report.tables import text_table
from bywire.synthesis.study import STUDIES

_SHOWN = 12  # rows on a terminal
_WORD = re.compile(r"[^\W\d_]{2,}|\w+")


class Mention(NamedTuple):
    """Something with a name, and what is declared of it."""

    kind: str
    name: str
    meaning: str
    unit: str = ""


@dataclass(frozen=True)
class Mentioned(Answer):
    """What mentions some words that are no name.

    Parameters
    ----------
    words
        What was asked for.
    mentions
        What mentions them, what is called so first.
    """

    words: str
    mentions: tuple[Mention, ...]

    def document(self) -> Document:
        """Return kind, name and meaning of each; on a terminal of as many as a screen holds."""
        rows = [(mention.kind, mention.name, mention.meaning) for mention in self.mentions]
        more = len(rows) - _SHOWN
        table, start = (
            text_table(("kind", "name", "meaning"), each) for each in (rows, rows[:_SHOWN])
        )
        left = [f"and {more} more: ask with more words"] if more > 0 else []
        head = f"nothing is called {quoted(self.words)}; it is mentioned by"
        return Document(
            self.words,
            head,
            sections=[Section("Mentioned by", [TableBlock(table)])],
            brief=[head, TableBlock(start, width=0), *left],
            data={
                "name": self.words,
                "found": [
                    {"kind": kind, "name": name, "summary": meaning, "unit": unit}
                    for kind, name, meaning, unit in self.mentions
                ],
            },
            has_files=False,
        )


def mentions(words: str) -> list[Mention]:
    """Return everything that mentions all of some words, what is called so first.

    A word is found at the beginning of a declared one, in names, meanings (docstrings, labels,
    summaries) and, as a whole, units.
    """
    asked = [word.lower() for word in _WORD.findall(words)]
    known = dict.fromkeys(_known()) if asked else {}
    return sorted(
        (mention for mention in known if all(_says(mention, word) for word in asked)),
        key=lambda mention: not all(_begins(mention.name, word) for word in asked),
    )


def nearest_words(name: str) -> Sequence[str]:
    """Return the declared words that are nearest to one that nothing mentions."""
    words = {word for mention in _known() for word in _WORD.findall(mention.meaning)}
    return get_close_matches(name, [word for word in words if len(word) > 3], n=2, cutoff=0.75)


def _says(mention: Mention, word: str) -> bool:
    whole = mention.unit.lower(), mention.name.lower()
    return word in whole or _begins(f"{mention.name} {mention.meaning}", word)


def _begins(text: str, word: str) -> bool:
    return any(each.lower().startswith(word) for each in _WORD.findall(text))


def _known() -> Iterator[Mention]:
    """Yield everything that has a name; groups of parameters first, which say what is where."""
    assemblies = dict.fromkeys(each.assembly for each in PARAMETER_SETS.all().values())
    classes = [PARAMETER_SETS.find(main_set(name)).parameter_class for name in assemblies]
    for cls in classes:
        yield from _groups(cls)
    for cls in classes:
        leaves = leaf_fields(cls)
        for name, note in field_notes(cls).items():
            unit = display_unit(leaves[name].unit.symbol) if name in leaves else ""
            yield Mention("parameter", name, " ".join(note.split()), unit)
    for name, rows in signals().items():
        yield Mention("signal", name, str(rows[0]["meaning"]), str(rows[0]["unit"]))
    for name, model in ASSEMBLIES.all().items():
        yield Mention("assembly", name, system_summary(model))
    kinds: dict[str, tuple[Any, ...]] = {
        "parameter set": (PARAMETER_SETS,),
        "experiment": (EXPERIMENTS, GENERIC_EXPERIMENTS),
        "loop": (LOOPS,),
        "plant": (PLANTS,),
        "study": (STUDIES,),
        "method": (METHODS, BENCH_METHODS),
        "stimulus": (STIMULI,),
    }
    for title, several in kinds.items():
        for kind in several:
            for thing in kind.all().values():
                yield Mention(title, thing.name, thing.summary)
    for figure in definitions().values():
        yield Mention("KPI", figure.name, figure.definition)


def _groups(cls: type[ParameterSet], prefix: str = "") -> Iterator[Mention]:
    for name, info in cls.model_fields.items():
        inner = info.annotation
        if isinstance(inner, type) and issubclass(inner, ParameterSet):
            yield Mention("parameter group", f"{prefix}{name}", group_meaning(inner))
            yield from _groups(inner, f"{prefix}{name}.")
