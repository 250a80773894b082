"""The model protocol: everything the engine needs from a brake, a rig or another system.

A model is written as pure functions of named tuples. The engine evaluates them once on symbols
and needs nothing else. A model has:

* smooth dynamics in mass form, ``mass_k(xe) dx_k/dt = balance_k(x, xe, ...)``;
* dry *frictions*: a velocity state whose equation carries a set-valued force between two bounds
  while it is exactly zero;
* one-sided *limits*: a state that cannot fall below zero (a check valve, a stop);
* *contact groups*: unilateral contacts whose compliances couple them;
* *tasks*: the sampled controllers, each with its own period, working on a shared memory;
* *powers*, integrated along with the states, for the energy balance.

``x`` enters the implicit solve; ``xe`` is the same state but value-only: it is not
differentiated for the Newton matrix. Use it for slowly varying geometry and periodic terms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from bywire.core.errors import ModelError, place_of, unknown_name
from bywire.core.registry import Kind
from bywire.core.signals import zeros

Bounds = tuple[float, float]
Matrix = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Task:
    """One sampled controller.

    Parameters
    ----------
    name
        Name in recordings and messages.
    period
        Sample time [s]; a whole number of substeps.
    tick
        ``tick(x, memory, stimulus, par) -> memory``: reads the plant at the sampling instant
        and returns the memory with this task's fields updated.
    """

    name: str
    period: float
    tick: Callable[[Any, Any, Any, Any], Any]


class Model(Protocol):
    """A system that the engine integrates. All methods are pure and accept symbols.

    A model may inherit from this class; frictions, limits and contacts then default to none.
    """

    @property
    def name(self) -> str:
        """Identify the model in messages and recordings."""
        ...

    @property
    def State(self) -> type[NamedTuple]:
        """Continuous states."""
        ...

    @property
    def Memory(self) -> type[NamedTuple]:
        """Memory of the tasks between ticks: controller states and outputs."""
        ...

    @property
    def Stimulus(self) -> type[NamedTuple]:
        """External inputs, sampled at the rate of the fastest task."""
        ...

    @property
    def Flow(self) -> type[NamedTuple]:
        """Energies and other integrals of ``powers``."""
        ...

    @property
    def Output(self) -> type[NamedTuple]:
        """Signals of a recording."""
        ...

    @property
    def frictions(self) -> tuple[str, ...]:
        """Velocity states with dry friction."""
        return ()

    @property
    def limits(self) -> tuple[str, ...]:
        """States that cannot fall below zero; rarely at zero for long (see ``scheme``)."""
        return ()

    @property
    def usually_open(self) -> tuple[bool, ...]:
        """Per contact group, whether it rarely touches, as end stops do; none by default.

        This affects speed only: an open group costs one check, a touching one the exact solution.
        """
        return ()

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return the controllers, in the order in which they run when due together."""
        ...

    def mass(self, xe: Any, par: Any) -> Any:
        """Return the factor of each state's derivative, a State."""
        ...

    def balance(self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]) -> Any:
        """Return the smooth right-hand side, a State; without frictions and limits."""
        ...

    def bounds(
        self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return (low, high) per friction, low <= 0 <= high, in the unit of its equation.

        The force is ``low`` where the velocity is positive, ``high`` where it is negative.
        """
        return ()

    def compliance(self, par: Any) -> tuple[Matrix, ...]:
        """Return one positive definite compliance matrix per contact group.

        It is empty if a choice omits the group, which then has no overlaps and no forces.
        """
        return ()

    def gap(self, x: Any, xe: Any, par: Any) -> tuple[tuple[float, ...], ...]:
        """Return per group the overlaps d, affine in x (and its rates through the states).

        The contact forces F >= 0 of a group solve ``C F - d >= 0, F (C F - d) = 0``.
        """
        return ()

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
        """Return the rates of the Flow at the midpoint of a substep.

        ``xe`` is the predicted midpoint, as in ``balance``: periodic terms of it are computed only
        once. ``rate`` is dx/dt; ``reaction`` holds the friction forces, then those of the limits.
        """
        ...

    def output(
        self,
        x: Any,
        memory: Any,
        par: Any,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: Any,
    ) -> Any:
        """Return the recorded signals at an instant; ``reaction`` is that of the last substep."""
        ...

    def rest(self, par: Any) -> tuple[Any, Any]:
        """Return a State and a Memory in which the system rests without stimulus.

        Generic experiments and checks start here. The default, all zeros, is right if nothing is
        preloaded, filled or held.
        """
        return zeros(self.State), zeros(self.Memory)

    def watch(self, recording: Any, par: Any) -> list[str]:
        """Return warnings about a recording, such as exceeded validity or touched stops; none here.

        Parameters
        ----------
        recording
            An xarray.Dataset of at least one row; it may contain only some of the signals.
        par
            The run's parameters.
        """
        return []

    def remarks(self, recording: Any, par: Any) -> list[str]:
        """Return notes above the key figures of a run, such as on its controllers; none here.

        Unlike the texts of ``watch``, they are not warnings, and studies do not need them.

        Parameters
        ----------
        recording
            An xarray.Dataset of at least one row, with all signals.
        par
            The run's parameters.
        """
        return []

    def watched(self, par: Any) -> tuple[str, ...] | None:
        """Return the recorded signals that ``watch`` reads; None if they are unknown.

        Studies record only these and the signals of key figures and of the energy balance.
        """
        return None

    def silent(self, rows: Any, pars: Any) -> frozenset[str]:
        """Return parts that ``watch`` can skip in several cases; see `Assembly.silent`."""
        return frozenset()

    def may_warn(self, rows: Any, pars: Any) -> Sequence[int]:
        """Return the cases for which ``watch`` may return warnings; all by default.

        ``rows``: signals of shape (cases, rows), ``rows.silent`` the parts `silent` in all of them;
        ``pars``: parameters of each case.
        """
        return range(len(pars))


def require_states(model: Any) -> None:
    """Reject frictions and limits of a model that are not among its states.

    Parameters
    ----------
    model
        A model, or its class.

    Raises
    ------
    ModelError
        With the declaration, the name, and the nearest state.
    """
    fields: tuple[str, ...] = getattr(model.State, "_fields", ())
    for kind in ("frictions", "limits") if fields else ():
        names = getattr(model, kind)
        if isinstance(names, property):
            continue
        cls = model if isinstance(model, type) else type(model)
        where = f"{place_of(cls)}: {model.name}: {kind}"
        if not isinstance(names, tuple):
            raise ModelError(f"{where} = {names!r} must be a tuple of states, as ({fields[0]!r},)")
        for name in names:
            if name not in fields:
                error = unknown_name("state", str(name), fields)
                raise ModelError(f"{where} names {name!r}, which is not a field of State: {error}")


def _declared(module: ModuleType) -> Iterator[type[Any]]:
    """Yield the complete models that a module defines."""
    for value in vars(module).values():
        defined = isinstance(value, type) and value.__module__ == module.__name__
        if defined and hasattr(value, "Memory") and hasattr(value, "balance"):
            require_states(value)
            yield value


ASSEMBLIES: Kind[Any] = Kind("assembly", ("model", "models", "rigs"), _declared)
"""the complete models of every brake, rigs included: classes, by their ``name``"""


# --- A model around another one

_PROTOCOL = frozenset(name for name in vars(Model) if not name.startswith("_"))
if TYPE_CHECKING:
    _Protocol = Model
else:
    _Protocol = object  # the defaults of the protocol must not hide the model inside


class Wrapping(_Protocol):
    """A model around another one; a subclass may declare another memory.

    Parameters
    ----------
    inner
        The model inside, which provides every protocol member that is not defined here.
    """

    def __init__(self, inner: Model) -> None:
        self.inner = inner

    def __getattr__(self, name: str) -> Any:
        if name not in _PROTOCOL:
            raise AttributeError(name)
        return getattr(self.inner, name)

    @property
    def name(self) -> str:
        """Name of the model inside."""
        return self.inner.name

    @property
    def State(self) -> type[NamedTuple]:
        """States of the model inside."""
        return self.inner.State

    @property
    def Memory(self) -> type[NamedTuple]:
        """Memory of the model inside."""
        return self.inner.Memory

    @property
    def Flow(self) -> type[NamedTuple]:
        """Integrals of the model inside."""
        return self.inner.Flow

    @property
    def Output(self) -> type[NamedTuple]:
        """Recorded signals of the model inside."""
        return self.inner.Output

    def mass(self, xe: Any, par: Any) -> Any:
        """Return the masses of the model inside."""
        return self.inner.mass(xe, par)

    def memory_inside(self, memory: Any) -> Any:
        """Return the memory that acts on the plant inside."""
        return memory

    def balance(self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]) -> Any:
        """Return the smooth right-hand side."""
        return self.inner.balance(x, xe, self.memory_inside(memory), par, contact)

    def bounds(
        self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the bounds of the frictions."""
        return self.inner.bounds(x, xe, self.memory_inside(memory), par, contact)

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
        """Return the recorded signals."""
        return self.inner.output(x, self.memory_inside(memory), par, contact, reaction, flow)
