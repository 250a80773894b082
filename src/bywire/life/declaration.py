"""What a brake declares of its life: slow states, what they change, what a stop does to them.

A stop changes slow states by a ten-thousandth of themselves. So stops are simulated with these
states held, and the states are stepped over many stops; see `bywire.life.projection`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from pydantic import Field

from bywire.core.catalog import Cited
from bywire.core.parameters import ParameterSet, require_units
from bywire.core.quantities import Unit
from bywire.core.registry import Kind, instances
from bywire.core.typing import Array

Values = dict[str, float]
"""slow states, or what is left of limits, by name [SI]"""


class StopConditions(ParameterSet):
    """What belongs to a stop beside the simulated bench."""

    pause: Annotated[float, Unit("s", 60.0), Field(gt=0, le=1e7, allow_inf_nan=False)]
    """time from this stop to the next"""
    T_air: Annotated[float, Unit("K", 300.0), Field(ge=200, le=350, allow_inf_nan=False)]
    """temperature of the air"""


@dataclass(frozen=True)
class Slow:
    """A slow state, or a limit that it runs into.

    Parameters
    ----------
    unit
        SI unit; ``"1"`` for a count.
    label
        What figures and tables say.
    is_drawn
        Whether the figure has a panel of it.
    """

    unit: str
    label: str
    is_drawn: bool = True


@dataclass(frozen=True)
class Effects:
    """What each of some stops does.

    Parameters
    ----------
    changes
        Slow state -> its change by each stop [SI], shape (stops,). What is not named stays.
    readings
        What is measured of these stops and read between stops, as means [SI].
    """

    changes: Mapping[str, Array]
    readings: Mapping[str, float] = field(default_factory=dict)


def as_it_is(z: Values, readings: Mapping[str, float], par: Any, wear: Any) -> Values:
    """Return the slow states of a brake to which nothing happens between stops."""
    return z


@dataclass(frozen=True)
class Life:
    """What wears in a brake.

    Parameters
    ----------
    name
        What files and the command line call it.
    summary
        One line for listings.
    experiment
        Name of the experiment that simulates a stop.
    wear, values
        Class of the parameters of wear, and each value with its provenance.
    states, limits
        Slow states, and what is left until the end of life, by name.
    begin
        ``begin(par, wear)``: slow states of the new brake; ``par`` are the bench's parameters.
    follows
        ``follows(z, par, wear)``: parameters of the bench that slow states change, by dotted name.
    effects
        ``effects(figures, stops, z, par, wear)``: what each stop does, by its key figures and
        conditions (arrays of shape (stops,) by name); ``z`` are the slow states it was made with.
    left
        ``left(z, par, wear)``: what is left of each limit; life ends where the first is zero.
    figures
        Key figures of the stop that ``effects`` reads.
    between
        ``between(z, readings, par, wear)``: slow states after what happens between two stops.
    settings
        Changes of the bench, as ``--set`` takes them, for its stops.
    population
        How stops vary unless a file says otherwise: entries of ``[vary]`` by name.
    """

    name: str
    summary: str
    experiment: str
    wear: type[ParameterSet]
    values: Mapping[str, Cited]
    states: Mapping[str, Slow]
    limits: Mapping[str, Slow]
    begin: Callable[[Any, Any], Values]
    follows: Callable[[Values, Any, Any], Mapping[str, float]]
    effects: Callable[[Mapping[str, Array], Mapping[str, Array], Values, Any, Any], Effects]
    left: Callable[[Values, Any, Any], Values]
    figures: tuple[str, ...]
    between: Callable[[Values, Mapping[str, float], Any, Any], Values] = as_it_is
    settings: Mapping[str, str] = field(default_factory=dict)
    population: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_units(self.wear)

    def defaults(self) -> ParameterSet:
        """Return the validated parameters of wear."""
        return self.wear.create({name: cited.value for name, cited in self.values.items()})


LIVES = Kind("life", ("life",), instances(Life))
"""every life that a brake declares"""
