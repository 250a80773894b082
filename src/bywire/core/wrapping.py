"""A model around another one: as that one, but for what a subclass defines anew."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from bywire.core.model import Bounds, Matrix, Model, Task


class Wrapping(Model):
    """The model inside, with another memory where a subclass says so.

    Parameters
    ----------
    inner
        The model inside.
    """

    def __init__(self, inner: Model) -> None:
        self.inner = inner

    def memory_inside(self, memory: Any) -> Any:
        """Return the memory as the plant inside feels it."""
        return memory

    @property
    def name(self) -> str:
        """As inside, like all that follows."""
        return self.inner.name

    @property
    def State(self) -> type[NamedTuple]:
        """Continuous states."""
        return self.inner.State

    @property
    def Memory(self) -> type[NamedTuple]:
        """What the tasks hold."""
        return self.inner.Memory

    @property
    def Stimulus(self) -> type[NamedTuple]:
        """External inputs."""
        return self.inner.Stimulus

    @property
    def Flow(self) -> type[NamedTuple]:
        """Integrals."""
        return self.inner.Flow

    @property
    def Output(self) -> type[NamedTuple]:
        """What a recording holds."""
        return self.inner.Output

    @property
    def frictions(self) -> tuple[str, ...]:
        """Velocity states with dry friction."""
        return self.inner.frictions

    @property
    def limits(self) -> tuple[str, ...]:
        """States that cannot fall below zero."""
        return self.inner.limits

    @property
    def usually_open(self) -> tuple[bool, ...]:
        """Contact groups that rarely touch."""
        return self.inner.usually_open

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return the controllers."""
        return self.inner.tasks(par)

    def mass(self, xe: Any, par: Any) -> Any:
        """Return the masses."""
        return self.inner.mass(xe, par)

    def balance(self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]) -> Any:
        """Return the smooth right-hand side."""
        return self.inner.balance(x, xe, self.memory_inside(memory), par, contact)

    def bounds(
        self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the bounds of the frictions."""
        return self.inner.bounds(x, xe, self.memory_inside(memory), par, contact)

    def compliance(self, par: Any) -> tuple[Matrix, ...]:
        """Return the compliances."""
        return self.inner.compliance(par)

    def gap(self, x: Any, xe: Any, par: Any) -> tuple[tuple[float, ...], ...]:
        """Return the overlaps."""
        return self.inner.gap(x, xe, par)

    def powers(
        self,
        x: Any,
        xe: Any,
        rate: Any,
        memory: Any,
        par: Any,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
    ) -> Any:
        """Return the rates of the integrals."""
        felt = self.memory_inside(memory)
        return self.inner.powers(x, xe, rate, felt, par, contact, reaction)

    def output(
        self,
        x: Any,
        memory: Any,
        par: Any,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: Any,
    ) -> Any:
        """Return what is recorded."""
        return self.inner.output(x, self.memory_inside(memory), par, contact, reaction, flow)

    def rest(self, par: Any) -> tuple[Any, Any]:
        """Return where it rests."""
        return self.inner.rest(par)

    def watch(self, recording: Any, par: Any) -> list[str]:
        """Return what the user should know of a recording."""
        return self.inner.watch(recording, par)

    def remarks(self, recording: Any, par: Any) -> list[str]:
        """Return what stands above the key figures of a run."""
        return self.inner.remarks(recording, par)

    def watched(self, par: Any) -> tuple[str, ...] | None:
        """Return the signals that ``watch`` looks at."""
        return self.inner.watched(par)

    def silent(self, rows: Any, pars: Any) -> frozenset[str]:
        """Return what ``watch`` need not look at."""
        return self.inner.silent(rows, pars)

    def may_warn(self, rows: Any, pars: Any) -> Sequence[int]:
        """Return the cases of which ``watch`` may say something."""
        return self.inner.may_warn(rows, pars)
