"""Descriptions of names (methods, experiments, signals), and a search for words."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, NamedTuple

from bywire.api.things import Object, group_meaning, signals, thing_kinds
from bywire.core.arguments import checked
from bywire.core.catalog import PARAMETER_SETS, main_set
from bywire.core.errors import UnknownNameError, quoted, unknown_name
from bywire.core.parameters import ParameterSet, field_notes, leaf_fields
from bywire.core.quantities import display_unit
from bywire.report.answer import Answer
from bywire.report.document import Document, Flat, Paragraph, Section, TableBlock
from bywire.report.tables import Table, text_table
from bywire.report.wording import unit_text

_SHOWN = 12  # rows in a terminal
_WORD = re.compile(r"[^\W\d_]{2,}|\w+")


class Mention(NamedTuple):
    """Name with its declared meaning."""

    kind: str
    name: str
    meaning: str
    unit: str = ""


@dataclass(frozen=True)
class Mentioned(Answer):
    """Results of a search.

    Parameters
    ----------
    words
        Words of the search.
    mentions
        Things that mention the words, starting with those whose name contains the words.
    """

    words: str
    mentions: tuple[Mention, ...]

    def document(self) -> Document:
        """Return kind, name and meaning of each result. A terminal shows one screen of them."""
        rows = [(mention.kind, mention.name, mention.meaning) for mention in self.mentions]
        more = len(rows) - _SHOWN
        table, start = (
            text_table(("kind", "name", "meaning"), each) for each in (rows, rows[:_SHOWN])
        )
        left = [f"and {more} more. Add words to narrow the search"] if more > 0 else []
        head = f"nothing is named {quoted(self.words)}, but these entries mention it"
        return Document(
            self.words,
            head,
            sections=[Section("Mentioned by", [TableBlock(table)])],
            brief=[head, TableBlock(start), *left],
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
    """Return everything that mentions all words, with name matches first.

    A word matches the beginning of a word in names and meanings (docstrings, labels, summaries).
    Units must match completely.
    """
    asked = [word.lower() for word in _WORD.findall(words)]
    known = dict.fromkeys(_known()) if asked else {}
    return sorted(
        (mention for mention in known if all(_says(mention, word) for word in asked)),
        key=lambda mention: not all(_begins(mention.name, word) for word in asked),
    )


def _nearest_words(name: str) -> Sequence[str]:
    """Return the declared words that are closest to an unknown word."""
    words = {word for mention in _known() for word in _WORD.findall(mention.meaning)}
    return get_close_matches(name, [word for word in words if len(word) > 3], n=2, cutoff=0.75)


def _says(mention: Mention, word: str) -> bool:
    whole = mention.unit.lower(), mention.name.lower()
    return word in whole or _begins(f"{mention.name} {mention.meaning}", word)


def _begins(text: str, word: str) -> bool:
    return any(each.lower().startswith(word) for each in _WORD.findall(text))


def _known() -> Iterator[Mention]:
    """Yield everything that has a name, starting with parameter groups for orientation."""
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
    for kind in thing_kinds():
        if kind.meaning is not None:
            title = kind.title.partition(" of any ")[0]
            for name, thing in kind.things().items():
                yield Mention(title, name, kind.meaning(thing))


def _groups(cls: type[ParameterSet], prefix: str = "") -> Iterator[Mention]:
    for name, info in cls.model_fields.items():
        inner = info.annotation
        if isinstance(inner, type) and issubclass(inner, ParameterSet):
            yield Mention("parameter group", f"{prefix}{name}", group_meaning(inner))
            yield from _groups(inner, f"{prefix}{name}.")


# --- All about a name

_LINES = (
    *("details", "parts", "assembly", "system", "at", "unit", "range", "experiment", "records"),
    "source",
)
"""keys of an object that are shown as lines, before the keys of an assembly"""
_LONGEST = 200  # characters of a search
_TABLES = ("drives", "signals", "found in", "values", "estimates", "kpis")


def described(name: str) -> list[Object]:
    """Return an object for each thing with this name, for example a method and an experiment.

    Raises
    ------
    UnknownNameError
        If there is no such thing. The message lists the closest matches.
    """
    objects: list[Object] = [
        {"kind": kind.title, "name": name, **kind.describe(things[name])}
        for kind in thing_kinds()
        if kind.describe is not None and name in (things := kind.things())
    ]
    if not objects:
        names = {n for kind in thing_kinds() if kind.describe is not None for n in kind.things()}
        raise unknown_name("name", name, names.union(_nearest_words(name)))
    return objects


@dataclass(frozen=True)
class Description(Answer):
    """Description of a name as plain data, with one object for each kind of thing."""

    name: str
    objects: tuple[Object, ...]

    def document(self) -> Document:
        """Return the lines and tables of each object."""
        blocks = [_blocks(thing) for thing in self.objects]
        titles = [f"{thing['kind']} {thing['name']}" for thing in self.objects]
        spaced = [part for k, each in enumerate(blocks) for part in ([""] * (k > 0) + each)]
        return Document(
            self.name,
            "; ".join(str(thing["summary"]) for thing in self.objects),
            sections=[
                Section(title, [Paragraph(b) if isinstance(b, str) else b for b in each])
                for title, each in zip(titles, blocks, strict=True)
            ],
            brief=spaced,
            data={"name": self.name, "found": list(self.objects)},
            has_files=False,
        )


@checked
def describe(name: str) -> Description | Mentioned:
    """Describe a listed thing, a parameter, a group of parameters, or a signal.

    For other words, list everything whose declared meaning mentions them.

    Parameters
    ----------
    name
        Name of an assembly, element, experiment, loop, plant, study, method, parameter set,
        stimulus, key figure, parameter (``"motor.R_m"``), group of parameters, or signal; or
        search words, such as ``"battery"``.

    Returns
    -------
    Description or Mentioned
        Description of the name, or things that mention the words.

    Raises
    ------
    UnknownNameError
        If nothing mentions the words. The message lists the closest matches.
    """
    if len(name) > _LONGEST:
        raise UnknownNameError(
            f"{quoted(name)} is too long. Specify a name or a few words with at most {_LONGEST} "
            "characters",
            name="name",
            value=quoted(name),
            valid=f"at most {_LONGEST} characters",
        )
    try:
        return Description(name, tuple(described(name)))
    except UnknownNameError:
        mentioned = mentions(name)
        if not mentioned:
            raise
        return Mentioned(name, tuple(mentioned))


def _blocks(thing: Object) -> list[str | Flat]:
    """Return an object's lines and tables, separated by empty lines."""
    there = [kind.topic.replace("_", " ") for kind in thing_kinds() if kind.has_assembly]
    lines = [f"{thing['kind']} {thing['name']}: {thing['summary']}"]
    lines += [
        f"  {key}: {(unit_text(thing[key]) or '-') if key == 'unit' else thing[key]}"
        for key in (*_LINES, *there)
        if thing.get(key)
    ]
    blocks: list[str | Flat] = ["\n".join(lines)]
    for key in _TABLES:
        rows = thing.get(key)
        if rows:
            columns = list(rows[0])
            cells = [
                [(unit_text(row[n]) if n == "unit" else row[n]) or "-" for n in columns]
                for row in rows
            ]
            blocks += ["", key, TableBlock(text_table(columns, cells))]
    for key, heading in (("options", "default"), ("parameters", "value")):
        if thing.get(key):
            changed = f", changed with {thing['changed_with']}" if "changed_with" in thing else ""
            heading = "default" if thing["kind"] == "stimulus" else heading
            blocks += ["", f"{key}{changed}", TableBlock(_option_table(thing[key], heading))]
    if thing.get("see"):
        blocks += ["", thing["see"]]
    return blocks


def _option_table(rows: Sequence[Mapping[str, Any]], heading: str) -> Table:
    """Return a table of options, with a heading for their values."""
    columns = ["name", "value", "range", "meaning"]
    if all(row["value"] is None for row in rows):
        columns.remove("value")
    if any(row.get("provenance") for row in rows):
        columns.append("provenance")
    titles = [heading if name == "value" else name for name in columns]
    return text_table(titles, [[row.get(name) or "-" for name in columns] for row in rows])
