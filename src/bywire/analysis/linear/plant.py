"""The plant of a brake without its controllers: where it is linearized, what moves and answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from bywire.analysis.linear.corners import taking
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import Friction
from bywire.analysis.loop import Quantity
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.registry import Kind, instances


@dataclass(frozen=True)
class PlantPoint:
    """Where a plant is linearized, and what its dry friction does there.

    Parameters
    ----------
    quantity, value
        What the operating point is given by, and its value [SI].
    friction
        As in `bywire.analysis.linear.linearize.linearize`.
    speed
        Motor speed [rad/s], positive toward clamping; nonzero for sliding friction only.
    """

    quantity: Quantity
    value: float
    friction: Friction = "removed"
    speed: float = 0.0

    @contextmanager
    def named(self, unless: Quantity) -> Iterator[None]:
        """Name the value in errors of what follows from it; ``unless``: whose errors name it."""
        try:
            yield
        except ParameterError as error:
            if self.quantity is unless:
                raise
            raise self.quantity.refused(self.value, error) from None


@dataclass(frozen=True)
class Plant:
    """A plant.

    Parameters
    ----------
    name
        What the command line calls it.
    assembly
        What it is the plant of.
    summary
        One line for listings.
    at
        What its operating point may be given by; the first one is usual.
    model
        ``model(par, point) -> LinearModel``.
    band
        Frequency [Hz] up to which it is usually looked at.
    whole
        The model that this one simplifies, of the same inputs and outputs; None for the exact one.
    side
        As of `bywire.analysis.loop.Loop`.
    """

    name: str
    assembly: str
    summary: str
    at: tuple[Quantity, ...]
    model: Callable[[ParameterSet, PlantPoint], LinearModel]
    band: float
    whole: Callable[[ParameterSet, PlantPoint], LinearModel] | None = None
    side: str = ""

    def linear(self, par: ParameterSet, point: PlantPoint) -> LinearModel:
        """Return `model` on the plant's side of corners."""
        with taking(self.side):
            return self.model(par, point)

    def exact(self, par: ParameterSet, point: PlantPoint) -> LinearModel | None:
        """Return the model that this one simplifies, likewise; None for the exact one."""
        with taking(self.side):
            return None if self.whole is None else self.whole(par, point)

    @property
    def usual(self) -> PlantPoint:
        """Where it is usually looked at."""
        return PlantPoint(self.at[0], self.at[0].default)


PLANTS = Kind("plant", ("plants",), instances(Plant), declared="a Plant")
"""every plant and simplified model of one"""
