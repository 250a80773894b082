"""Parameters at the top of the live page of an unchanged bench: its brake's choice."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from bywire.bench.bench import Bench
from bywire.core.arguments import checked
from bywire.core.registry import Kind, instances

_COUNT = 6  # at the top if no brake chooses


@checked
@dataclass(frozen=True)
class Sliders:
    """Parameters with the strongest effect on an assembly, which get sliders.

    Parameters
    ----------
    name
        Name of this choice; it must be unique.
    assemblies
        Names of the assemblies that it applies to.
    parameters
        Their names in the form of ``--set``, the most important first. A page leaves out parameters
        without effect in its run, such as those of a law that is not active.
    """

    name: str
    assemblies: tuple[str, ...]
    parameters: tuple[str, ...]


SLIDERS = Kind("choice of sliders", ("panels", "sliders"), instances(Sliders), declared="a Sliders")
"""every brake's choice of parameters at the top of its pages"""


def first_sliders(bench: Bench, names: Sequence[str]) -> list[str]:
    """Return the parameters at the top of a bench's page where nobody chose any.

    Parameters
    ----------
    names
        Parameters that have an effect in the page's run, in the order of the model.

    Returns
    -------
    list of str
        Those that the bench changes; else its brake's choice; else the first of each part of the
        model, because the first parameters alone may all belong to one part.
    """
    changed = [name for name in bench.overrides if name in names]
    assembly = bench.definition.assembly
    declared = [
        name
        for choice in SLIDERS.all().values()
        if assembly in choice.assemblies
        for name in choice.parameters
        if name in names
    ]
    return changed or declared or list(_part_by_part(names))[:_COUNT]


def _part_by_part(names: Sequence[str]) -> Iterator[str]:
    parts: dict[str, list[str]] = {}
    for name in names:
        parts.setdefault(name.rpartition(".")[0], []).append(name)
    for row in zip_longest(*parts.values()):
        yield from (name for name in row if name is not None)
