"""Levels that a source states for an experiment: its own points, under our curves."""

from __future__ import annotations

from dataclasses import dataclass

from bywire.bench.bench import Bench
from bywire.core.registry import Kind, instances


@dataclass(frozen=True)
class StatedLevel:
    """A level of a signal that a source states in its text or by the end of a figure's axis.

    Parameters
    ----------
    name
        Of the statement, unlike any other.
    experiment
        Name of the experiment that the source describes.
    signal
        Name of the recorded signal.
    value
        The level in the signal's SI unit.
    label
        What a legend says of it, short.
    where
        Place in the source, with how it was read.
    options
        Names of the experiment's options that must be its defaults for the statement to hold.
    """

    name: str
    experiment: str
    signal: str
    value: float
    label: str
    where: str
    options: tuple[str, ...] = ()


STATED = Kind("stated level", ("stated",), instances(StatedLevel), declared="a StatedLevel")
"""every level that a source states for an experiment of its brake"""


def stated_for(bench: Bench) -> list[StatedLevel]:
    """Return what sources state for a bench's experiment, as far as its options are theirs."""
    chosen, ours = bench.definition.defaults.flat(), bench.chosen_options.flat()
    return [
        each for each in STATED.all().values()
        if each.experiment == bench.experiment
        and all(chosen[name] == ours[name] for name in each.options)
    ]  # fmt: skip
