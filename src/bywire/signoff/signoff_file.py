"""Sign-off files: requirements, assumptions and evidence in TOML; nothing in them is executed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from bywire.bench.requirements import Limit
from bywire.core.errors import ParameterError, not_valid, quoted, unknown_name
from bywire.core.section import Hint, Name, Names, Section, Table
from bywire.data.toml_file import SIGNOFF, entry_lines, read_toml, require_kind
from bywire.signoff.exchange.importing import AttributeNames, Imported, imported_from
from bywire.signoff.plan import Evidence, SignOffPlan, Task
from bywire.signoff.statements import Place, Statement, placed, require_id, require_sound

Arguments = Mapping[str, Any]
Readers = Mapping[str, Callable[[str, Arguments, Path], Task]]
"""kinds of evidence: ``read(subject, arguments, folder)`` by the key that contains the subject"""

_REQUIREMENT, _ASSUMPTION, _EVIDENCE = "requirement", "assumption", "evidence"
_OWN = ("shows", "limit", "note")
"""keys of every ``[[evidence]]``"""
_SIGNATURES = ("prepared", "reviewed", "released")


class StatementSection(Section):
    """Section ``[[requirement]]`` or ``[[assumption]]``."""

    id: Name
    text: Name
    source: str = ""
    group: str = ""
    assumes: Names = ()


_Tables = Annotated[Any, Hint("write it in double brackets, once per entry")]


class SignOffFile(Section):
    """Keys and sections of a sign-off file."""

    name: Name
    requirements: str = ""
    attributes: AttributeNames = AttributeNames()
    only: Table
    signatures: Names = _SIGNATURES
    requirement: _Tables = ()
    assumption: _Tables = ()
    evidence: _Tables = ()


def read_signoff(path: str | Path, readers: Readers) -> SignOffPlan:
    """Read a sign-off file with the files to which it refers.

    Parameters
    ----------
    path
        TOML file (see ``docs/signoff.md``).
    readers
        Kinds of evidence.

    Raises
    ------
    FileError
        If the file cannot be read or is not valid TOML.
    InputError
        For any invalid entry. The message begins with the file and the line.
    """
    file = Path(path)
    content = read_toml(file, "sign-off file")
    lines = entry_lines(file)
    with placed(Place(file)):
        require_kind(content, SIGNOFF, file)
        read = SignOffFile.read({"name": file.stem, **content}, "a sign-off file")
    statements = [
        *_statements(read.requirement, _REQUIREMENT, file, lines),
        *_statements(read.assumption, _ASSUMPTION, file, lines),
    ]
    imported = _imported(read, file)
    if imported is not None:
        statements = [*imported.statements, *statements]
    if not statements:
        raise ParameterError(
            f"{file} contains no requirement. Add a [[requirement]] with an id and a text, or "
            'specify a requirements file with requirements = "FILE"',
            name="requirement",
        )
    require_sound(statements)
    evidence = [
        _evidence(entry, Place(file, line), readers, statements)
        for entry, line in _entries(read.evidence, _EVIDENCE, file, lines)
    ]
    return SignOffPlan(
        read.name,
        file,
        tuple(each for each in statements if not each.is_assumption),
        tuple(each for each in statements if each.is_assumption),
        _together(evidence),
        read.signatures,
        imported,
    )


def _imported(read: SignOffFile, file: Path) -> Imported | None:
    """Return the requirements from the file that a sign-off file specifies, or None."""
    if read.requirements:
        return imported_from(file.parent / read.requirements, read.attributes, read.only)
    for key in ("attributes", "only"):
        if key in read.given:
            raise ParameterError(
                f"{file}: [{key}] needs a requirements file. Add requirements = "
                '"FILE.csv" or "FILE.reqif"',
                name=key,
            )
    return None


def _entries(
    value: Any, name: str, file: Path, lines: Mapping[str, Sequence[int]]
) -> Iterator[tuple[dict[str, Any], int]]:
    """Yield the entries of an array of tables with their lines."""
    if not value:
        return
    if not isinstance(value, Sequence) or not all(isinstance(each, Mapping) for each in value):
        raise ParameterError(
            f"{file}: [[{name}]] must be a list. Write [[{name}]] once for each entry",
            name=f"[[{name}]]",
        )
    known = lines.get(name, ())
    for k, each in enumerate(value):
        yield dict(each), known[k] if k < len(known) else 0


def _statements(
    value: Any, name: str, file: Path, lines: Mapping[str, Sequence[int]]
) -> Iterator[Statement]:
    for entry, line in _entries(value, name, file, lines):
        place = Place(file, line)
        with placed(place):
            section = StatementSection.read(entry, f"[[{name}]]")
            require_id(section.id)
        yield Statement(
            section.id,
            section.text,
            section.source,
            section.group,
            section.assumes,
            name == _ASSUMPTION,
            place,
        )


def _evidence(
    entry: dict[str, Any], place: Place, readers: Readers, statements: Sequence[Statement]
) -> Evidence:
    with placed(place):
        kinds = [key for key in entry if key in readers]
        if not kinds:
            unknown = [key for key in entry if key not in _OWN]
            if unknown:
                raise unknown_name("kind of [[evidence]]", unknown[0], readers)
            raise ParameterError(
                "[[evidence]] does not specify a kind of evidence. Add one of these keys: "
                f"{', '.join(readers)}",
                name="[[evidence]]",
                valid=", ".join(readers),
            )
        kind = _kind(kinds)
        subject = entry[kind]
        if not isinstance(subject, str) or not subject.strip():
            valid = "a name or a file in quotation marks"
            raise not_valid(f"[[evidence]] {kind}", quoted(subject), valid)
        shows = _texts(entry.get("shows", ()), "shows")
        known = [each.id for each in statements]
        for id in shows:
            if id not in known:
                raise unknown_name("requirement in shows", id, known)
        arguments = {key: each for key, each in entry.items() if key not in (*_OWN, kind)}
        task = readers[kind](subject, arguments, place.file.parent)
        limits = tuple(task.limit(text) for text in _texts(entry.get("limit", ()), "limit"))
        note = entry.get("note", "")
        if not isinstance(note, str):
            raise not_valid("[[evidence]] note", quoted(note), "a string in quotation marks")
    return Evidence(task, limits, shows, note, place)


def _together(evidence: Sequence[Evidence]) -> tuple[Evidence, ...]:
    """Return the evidence with the limits of equal computations joined, so that they run once."""
    limits: dict[str, dict[str, Limit]] = {}
    tasks: dict[str, Task] = {}
    for each in evidence:
        entry = repr(each.task.origin)  # different entries may have the same title
        tasks.setdefault(entry, each.task)
        joined = limits.setdefault(entry, {})
        joined.update({str(limit): limit for limit in each.limits})
    made: list[Evidence] = []
    first: dict[str, Evidence] = {}
    for each in evidence:
        with placed(each.place):
            entry = repr(each.task.origin)
            task = tasks[entry].with_limits(tuple(limits[entry].values()))
            other = first.setdefault(task.shelf, replace(each, task=task))
            if other.task.digest != task.digest:
                raise ParameterError(
                    f"[[evidence]] repeats the computation of {other.place} with different "
                    "settings. Use the same settings in both entries, or remove one of them",
                    name="[[evidence]]",
                    value=task.title,
                )
        made.append(replace(each, task=task))
    return tuple(made)


def _kind(kinds: Sequence[str]) -> str:
    """Return the key that contains the subject; a record also has a bench, as an argument."""
    for each in kinds:
        if set(kinds) <= {each, *_ARGUMENTS.get(each, ())}:
            return each
    raise ParameterError(
        f"[[evidence]] has several kinds ({', '.join(kinds)}). Write a separate [[evidence]] for "
        "each",
        name="[[evidence]]",
        value=", ".join(kinds),
    )


_ARGUMENTS: Mapping[str, tuple[str, ...]] = {
    "record": ("bench",),
    "identification": ("bench",),
}
"""kinds of evidence with an argument whose name is another kind"""


def _texts(value: Any, key: str) -> tuple[str, ...]:
    """Return a text or a list of texts as a tuple."""
    values = (value,) if isinstance(value, str) else value
    if not isinstance(values, Sequence) or not all(
        isinstance(each, str) and each.strip() for each in values
    ):
        raise not_valid(f"[[evidence]] {key}", quoted(value), "a string or a list of strings")
    return tuple(values)
