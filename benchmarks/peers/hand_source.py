"""Hand-written C of a brake: its source put together for a parameter set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bywire.core.parameters import ParameterSet


@dataclass(frozen=True)
class Subject:
    """A brake, and the hand-written C that there is of it.

    Parameters
    ----------
    folder
        Where the files are.
    source, indices, shared
        Files in that folder: the scheme; what it includes for the generated indices;
        what it includes for the parts that it shares with other schemes.
    model
        The brake's model, whose signals the indices name.
    flow
        NamedTuple of the integrals over the run.
    choices
        The choices that the C covers: name of a parameter, its admissible texts.
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
        """The model's outputs in order."""
        return tuple(self.model.Output._fields)

    def enums(self, par: ParameterSet) -> str:
        """Return the C enums that name the entries of the arrays, in the model's own order."""
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

        ``scheme``: another file in place of ``source``.

        Raises
        ------
        ValueError
            When the set makes a choice that the hand-written C does not cover.
        """
        values = par.flat()
        for name, covered in self.choices.items():
            if values[name] not in covered:
                raise ValueError(
                    f"{name} = {values[name]!r}: the hand-written C covers "
                    f"{' and '.join(map(repr, covered))} only"
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
