"""What a source states for an experiment: levels and ranges under our curves, key figures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from types import ModuleType
from typing import Protocol, TypeVar

from bywire.bench.bench import Bench
from bywire.core.arguments import checked
from bywire.core.registry import Kind, instances


@checked
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
        Place in the source, with how it was read; of a tolerance that is ours, why so much.
    options
        Names of the experiment's options that must be its defaults for the statement to hold.
    tolerance
        How far a curve may be off and still be what is stated, in the signal's SI unit; 0 where
        nobody says.
    """

    name: str
    experiment: str
    signal: str
    value: float
    label: str
    where: str
    options: tuple[str, ...] = ()
    tolerance: float = 0.0

    @property
    def low(self) -> float:
        """Lower end of what counts as stated, in the signal's SI unit."""
        return self.value - self.tolerance

    @property
    def high(self) -> float:
        """Upper end of what counts as stated, in the signal's SI unit."""
        return self.value + self.tolerance

    @property
    def levels(self) -> tuple[float, ...]:
        """What is drawn as a line: the value."""
        return (self.value,)


@checked
@dataclass(frozen=True)
class StatedRange:
    """A range within which a source states a signal to be, for instance between a figure's axes.

    Parameters
    ----------
    name, experiment, signal, label, where, options
        As of a `StatedLevel`.
    low, high
        Its ends in the signal's SI unit.
    """

    name: str
    experiment: str
    signal: str
    low: float
    high: float
    label: str
    where: str
    options: tuple[str, ...] = ()

    @property
    def levels(self) -> tuple[float, ...]:
        """What is drawn as lines: both ends."""
        return self.low, self.high


@checked
@dataclass(frozen=True)
class StatedFigure:
    """A key figure that a source states, shown beside ours.

    Parameters
    ----------
    name, experiment, where, options
        As of a `StatedLevel`.
    figure
        Name of the key figure.
    value
        What is stated, in the figure's unit.
    bound
        ``"<="`` or ``">="`` where the statement is a bound on the figure.
    tolerance
        How far the figure may be off and still be what is stated, in its unit; 0 where nobody
        says.
    """

    name: str
    experiment: str
    figure: str
    value: float
    where: str
    options: tuple[str, ...] = ()
    bound: str = ""
    tolerance: float = 0.0


class _Statement(Protocol):
    @property
    def experiment(self) -> str: ...
    @property
    def options(self) -> tuple[str, ...]: ...


S = TypeVar("S", bound=_Statement)


def _levels(module: ModuleType) -> list[StatedLevel | StatedRange]:
    return [*instances(StatedLevel)(module), *instances(StatedRange)(module)]


STATED = Kind("stated level", ("stated",), _levels, declared="a StatedLevel or a StatedRange")
"""every level and range that a source states for an experiment of its brake"""

STATED_FIGURES = Kind(
    "stated key figure", ("stated",), instances(StatedFigure), declared="a StatedFigure"
)
"""every key figure that a source states for an experiment of its brake"""


def stated_for(bench: Bench) -> list[StatedLevel | StatedRange]:
    """Return what sources state for a bench's signals, as far as its options are theirs."""
    return _holding(bench, STATED.beside(type(bench.par)).values())


def stated_figures(bench: Bench) -> dict[str, StatedFigure]:
    """Return what sources state for a bench's key figures, by figure, likewise."""
    statements = STATED_FIGURES.beside(type(bench.par)).values()
    return {each.figure: each for each in _holding(bench, statements)}


def _holding(bench: Bench, statements: Iterable[S]) -> list[S]:
    chosen, ours = bench.definition.defaults.flat(), bench.chosen_options.flat()
    return [
        each
        for each in statements
        if each.experiment == bench.experiment
        and all(chosen[name] == ours[name] for name in each.options)
    ]
