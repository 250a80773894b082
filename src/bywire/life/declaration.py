"""Declaration of a brake's life: slow states, their effects, and their changes during a stop.

A stop changes slow states by about a ten-thousandth. Stops are therefore simulated with constant
slow states, which then advance over many stops; see `bywire.life.projection`.
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
"""slow states, or remaining margins to limits, by name [SI]"""


class StopConditions(ParameterSet):
    """Conditions of a stop that are not part of the simulated bench."""

    pause: Annotated[float, Unit("s", 60.0), Field(gt=0, le=1e7, allow_inf_nan=False)]
    """time from this stop to the next"""
    T_air: Annotated[float, Unit("K", 300.0), Field(ge=200, le=350, allow_inf_nan=False)]
    """temperature of the air"""


@dataclass(frozen=True)
class Slow:
    """A slow state, or a limit on it.

    Parameters
    ----------
    unit
        SI unit; ``"1"`` for a count.
    label
        Label in figures and tables.
    is_drawn
        Whether the figure has a panel for it.
    """

    unit: str
    label: str
    is_drawn: bool = True


@dataclass(frozen=True)
class Effects:
    """Effects of several stops.

    Parameters
    ----------
    changes
        Slow state -> its change during each stop [SI], shape (stops,). States without an entry are
        constant.
    readings
        Means of measurements in these stops, which are read between stops [SI].
    """

    changes: Mapping[str, Array]
    readings: Mapping[str, float] = field(default_factory=dict)


def as_it_is(z: Values, readings: Mapping[str, float], par: Any, wear: Any) -> Values:
    """Return unchanged slow states, since nothing happens between stops."""
    return z


@dataclass(frozen=True)
class Life:
    """Wear of a brake.

    Parameters
    ----------
    name
        Name in files and on the command line.
    summary
        One line for listings.
    experiment
        Name of the experiment that simulates a stop.
    wear, values
        Class of the wear parameters, and each value with its provenance.
    states, limits
        Slow states, and margins to the end of life, by name.
    begin
        ``begin(par, wear)``: slow states of the new brake; ``par`` contains the bench's parameters.
    follows
        ``follows(z, par, wear)``: parameters of the bench that slow states change, by dotted name.
    effects
        ``effects(figures, stops, z, par, wear)``: effects of each stop, from its key figures and
        conditions (arrays of shape (stops,) by name); ``z`` contains the slow states of the stop.
    left
        ``left(z, par, wear)``: margin to each limit; life ends when the first margin is zero.
    figures
        Key figures of the stop that ``effects`` reads.
    between
        ``between(z, readings, par, wear)``: slow states after the events between two stops.
    settings
        Changes to the bench for its stops, as for ``--set``.
    population
        Default variation of the stops: entries of ``[vary]`` by name.
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
        """Return the validated wear parameters."""
        return self.wear.create({name: cited.value for name, cited in self.values.items()})


LIVES = Kind("life", ("life",), instances(Life))
"""every life that a brake declares"""
