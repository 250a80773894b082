"""Assemble the hand-written C source of a brake for a parameter set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bywire.core.parameters import ParameterSet


@dataclass(frozen=True)
class Subject:
    """A brake and its hand-written C.

    Parameters
    ----------
    folder
        Where the files are.
    source, indices, shared
        Files in that folder: the scheme, its include file for the generated indices, and its
        include files for parts that it shares with other schemes.
    model
        The brake's model, whose signals the indices name.
    flow
        NamedTuple of the integrals over the run.
    choices
        Choices that the C covers, as parameter names with their valid values.
    """

    folder: Path
    source: str
    indices: str
    model: Any
    flow: Any
    choices: Mapping[str, tuple[str, ...]]
    shared: tuple[str, ...] = ()

    @property
    def outputs(self) -> tuple[str, ...]:
        """Outputs of the model in order."""
        return tuple(self.model.Output._fields)

    def enums(self, par: ParameterSet) -> str:
        """Return C enums with the names of the array entries, in the order of the model."""
        lists: dict[str, Iterable[str]] = {
            "P": (name.replace(".", "_") for name in par.leaves()),
            "X": self.model.State._fields,
            "M": self.model.Memory._fields,
            "U": self.model.Stimulus._fields,
            "E": self.flow._fields,
            "O": self.model.Output._fields,
        }
        return "".join(
            f"enum {{ {', '.join(f'{prefix}_{name}' for name in (*names, 'COUNT'))} }};\n"
            for prefix, names in lists.items()
        )

    def text(self, par: ParameterSet, scheme: str | None = None) -> str:
        """Return the complete C source for the structure of a parameter set.

        ``scheme``: a file to use instead of ``source``.

        Raises
        ------
        ValueError
            If the parameter set contains a choice that the hand-written C does not cover.
        """
        values = par.flat()
        for name, covered in self.choices.items():
            if values[name] not in covered:
                raise ValueError(
                    f"{name} = {values[name]!r} is not covered by the hand-written C, only "
                    f"{' and '.join(map(repr, covered))}"
                )
        pieces = {self.indices: self.enums(par)}
        pieces |= {name: (self.folder / name).read_text() for name in self.shared}
        path = self.folder / (scheme or self.source)
        text = path.read_text()
        for name, piece in pieces.items():
            line = f'#include "{name}"\n'
            if line not in text:
                raise ValueError(f"{path} must include {name}")
            text = text.replace(line, piece)
        return text
