"""Statements of a source about an experiment: levels and ranges of signals, and key figures."""

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
    """Level of a signal that a source states in its text, or as the end of a figure's axis.

    Parameters
    ----------
    name
        Unique name of the statement.
    experiment
        Name of the experiment that the source describes.
    signal
        Name of the recorded signal.
    value
        The level in the signal's SI unit.
    label
        Short text for a legend.
    where
        Place in the source, and how the value was read; the reason for a tolerance that the source
        does not state.
    options
        Names of options that must have their default values for the statement to apply.
    tolerance
        Tolerance of the statement in the signal's SI unit; 0 if none is stated.
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
        """Lower end of the tolerance, in the signal's SI unit."""
        return self.value - self.tolerance

    @property
    def high(self) -> float:
        """Upper end of the tolerance, in the signal's SI unit."""
        return self.value + self.tolerance

    @property
    def levels(self) -> tuple[float, ...]:
        """Levels to draw: the value."""
        return (self.value,)


@checked
@dataclass(frozen=True)
class StatedRange:
    """Range of a signal that a source states, for example by the axes of a figure.

    Parameters
    ----------
    name, experiment, signal, label, where, options
        As in `StatedLevel`.
    low, high
        Ends of the range in the signal's SI unit.
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
        """Levels to draw: both ends."""
        return self.low, self.high


@checked
@dataclass(frozen=True)
class StatedFigure:
    """Key figure that a source states, shown next to the computed figure.

    Parameters
    ----------
    name, experiment, where, options
        As in `StatedLevel`.
    figure
        Name of the key figure.
    value
        Stated value in the figure's unit.
    bound
        ``"<="`` or ``">="`` if the statement is a bound on the figure.
    tolerance
        Tolerance of the statement in the figure's unit; 0 if none is stated.
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
"""every stated level and range of an experiment"""

STATED_FIGURES = Kind(
    "stated key figure", ("stated",), instances(StatedFigure), declared="a StatedFigure"
)
"""every stated key figure of an experiment"""


def stated_for(bench: Bench) -> list[StatedLevel | StatedRange]:
    """Return the statements about a bench's signals that apply to its options."""
    return _holding(bench, STATED.beside(type(bench.par)).values())


def stated_figures(bench: Bench) -> dict[str, StatedFigure]:
    """Return the statements about a bench's key figures that apply to its options, by figure."""
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
