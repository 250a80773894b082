"""A reproduction in a few sentences: why it disagrees, and how often."""

from __future__ import annotations

from bywire.reproduction.reproduction import Reproduction
from bywire.reproduction.tally import tallies


def in_short(reproduction: Reproduction) -> list[str]:
    """Return the root causes, then the counts of each parameter set."""
    return [*_causes(reproduction), *_counts(reproduction)]


def _causes(reproduction: Reproduction) -> list[str]:
    lines = []
    for cause in reproduction.causes:
        number = len(cause.explained(reproduction.items))
        plural = "" if number == 1 else "s"
        lines.append(f"{cause.text} [{number} disagreement{plural}]")
    return lines


def _counts(reproduction: Reproduction) -> list[str]:
    names = reproduction.sets
    return [
        f"{names.get(name, f'@{name}' if name else 'Main set')}: {counted}."
        for name, counted in tallies(reproduction.items).items()
    ]
