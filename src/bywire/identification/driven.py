"""A model of one's own under measured inputs alone: no controller, no books of energy."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any, ClassVar, NamedTuple

from bywire.core.model import Model, Task
from bywire.core.signals import Signal


class NoPower(NamedTuple):
    """No energy is booked."""

    none: Annotated[float, Signal("W", "no power")]


class Driven(Model):
    """A model whose inputs were measured; a subclass has ``name``, ``State`` and ``Input``.

    Besides them it gives ``mass`` and ``balance``, which gets an ``Input`` as its memory; what it
    shows are its states unless it has an ``Output`` and ``output`` of its own. Inputs hold for
    ``par.T_s``, the sample time, or for what ``period`` returns.
    """

    Flow: ClassVar = NoPower
    Memory: ClassVar[Any] = NoPower  # these three are set where a subclass names its own types
    Stimulus: ClassVar[Any] = NoPower
    Output: ClassVar[Any] = NoPower

    def __init_subclass__(cls, **options: Any) -> None:
        """Take the inputs for stimuli and for what is held, and the states for outputs."""
        super().__init_subclass__(**options)
        for kind, source in (("Memory", "Input"), ("Stimulus", "Input"), ("Output", "State")):
            if source in vars(cls) and kind not in vars(cls):
                setattr(cls, kind, vars(cls)[source])

    def period(self, par: Any) -> float:
        """Return for how long an input is held [s]."""
        return float(par.T_s)

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return the one that holds a sample."""
        return (Task("held", self.period(par), lambda x, m, u, par: u),)

    @abstractmethod
    def mass(self, xe: Any, par: Any) -> Any:
        """Return the factor of each state's derivative, a State."""

    @abstractmethod
    def balance(self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]) -> Any:
        """Return the smooth right-hand side, a State; ``memory`` are the inputs."""

    def powers(
        self,
        x: Any,
        xe: Any,
        rate: Any,
        memory: Any,
        par: Any,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
    ) -> NoPower:
        """Return none."""
        return NoPower(0.0 * x[0])

    def output(
        self,
        x: Any,
        memory: Any,
        par: Any,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: Any,
    ) -> Any:
        """Return the states."""
        return x
