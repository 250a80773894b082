"""The model protocol: everything the engine needs from a brake, a rig or another system.

A model consists of pure functions of named tuples. The engine evaluates them once on symbols
and needs no other code of the model. A model has:

* smooth dynamics in mass form, ``mass_k(xe) dx_k/dt = balance_k(x, xe, ...)``;
* dry *frictions*: velocity states whose equations contain a set-valued force between two bounds
  while the velocity is exactly zero;
* one-sided *limits*: states that cannot fall below zero (a check valve, a stop);
* *stop operators*: massless states that follow a motion and slip at a width (Maxwell slip);
* *contact groups*: unilateral contacts that are coupled by their compliances;
* *tasks*: the sampled controllers, each with its own period, which share one memory;
* *powers*, which are integrated along with the states for the energy balance.

``x`` enters the implicit solve. ``xe`` is the same state, but only its value counts: the Newton
matrix omits its derivatives. Use it for slowly varying geometry and periodic terms.
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
    """Sampled controller.

    Parameters
    ----------
    name
        Name in recordings and messages.
    period
        Sample time [s], a whole number of substeps.
    tick
        ``tick(x, memory, stimulus, par) -> memory``: reads the plant at the sampling instant, and
        returns the memory with the task's fields updated.
    """

    name: str
    period: float
    tick: Callable[[Any, Any, Any, Any], Any]


class Model(Protocol):
    """System that the engine integrates. All methods are pure and accept symbols.

    A model may inherit from this class. By default, it then has no frictions, limits, stop
    operators and contacts.
    """

    @property
    def name(self) -> str:
        """Name of the model in messages and recordings."""
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
        """States that cannot fall below zero and are rarely at zero for long (see ``scheme``)."""
        return ()

    @property
    def stops(self) -> tuple[str, ...]:
        """States that are stop operators: a state follows its rate, but stays within its width.

        Their rates, and the overlaps of contacts, do not depend on such states.
        """
        return ()

    @property
    def usually_open(self) -> tuple[bool, ...]:
        """Whether each contact group rarely touches, like end stops. Default: no group.

        This affects only speed. An open group costs one check, and a touching group is solved
        exactly.
        """
        return ()

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return the controllers, in the order in which they run if several are due."""
        ...

    def mass(self, xe: Any, par: Any) -> Any:
        """Return the factor of each state's derivative, a State."""
        ...

    def balance(self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]) -> Any:
        """Return the smooth right-hand side, a State, without frictions and limits."""
        ...

    def bounds(
        self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return (low, high) per friction, low <= 0 <= high, in the unit of its equation.

        The force is ``low`` if the velocity is positive, and ``high`` if it is negative.
        """
        return ()

    def widths(
        self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]
    ) -> tuple[float, ...]:
        """Return the width of each stop operator, >= 0: its state is at most this from zero.

        A width may depend on a load. The engine evaluates it at the start and at the predicted end
        of a substep.
        """
        return ()

    def compliance(self, par: Any) -> tuple[Matrix, ...]:
        """Return one positive definite compliance matrix per contact group.

        A matrix is empty if a choice omits the group, which then has no overlaps and no forces.
        """
        return ()

    def gap(self, x: Any, xe: Any, par: Any) -> tuple[tuple[float, ...], ...]:
        """Return the overlaps d of each group, affine in x (and in its rates through the states).

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

        ``xe`` is the predicted midpoint, as in ``balance``, so periodic terms are computed only
        once. ``rate`` is dx/dt. ``reaction`` contains the friction forces, then the limit forces,
        then minus the slip speeds of the stop operators. In ``x``, a stop operator has its mean
        over the motion.
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
        """Return the recorded signals at an instant; ``reaction`` is from the last substep."""
        ...

    def rest(self, par: Any) -> tuple[Any, Any]:
        """Return a State and a Memory in which the system is at rest without stimulus.

        Generic experiments and checks start here. The default, all zeros, is correct for a system
        in which nothing is preloaded, filled or held.
        """
        return zeros(self.State), zeros(self.Memory)

    def watch(self, recording: Any, par: Any) -> list[str]:
        """Return warnings about a recording, such as an exceeded range of validity. Default: none.

        Parameters
        ----------
        recording
            An xarray.Dataset of at least one row; it may contain only some of the signals.
        par
            The run's parameters.
        """
        return []

    def remarks(self, recording: Any, par: Any) -> list[str]:
        """Return notes to print above a run's key figures. Default: none.

        Unlike the texts from ``watch``, these are not warnings, and studies do not need them.

        Parameters
        ----------
        recording
            An xarray.Dataset of at least one row, with all signals.
        par
            The run's parameters.
        """
        return []

    def watched(self, par: Any) -> tuple[str, ...] | None:
        """Return the recorded signals that ``watch`` reads, or None if they are unknown.

        Studies record only these signals and those of key figures and the energy balance.
        """
        return None

    def silent(self, rows: Any, pars: Any) -> frozenset[str]:
        """Return the parts that ``watch`` can skip for several cases; see `Assembly.silent`."""
        return frozenset()

    def may_warn(self, rows: Any, pars: Any) -> Sequence[int]:
        """Return the cases for which ``watch`` may return warnings. Default: all.

        ``rows``: signals of shape (cases, rows); ``rows.silent``: the parts that are `silent` in
        all cases. ``pars``: parameters of each case.
        """
        return range(len(pars))


def require_states(model: Any) -> None:
    """Reject a model's frictions, limits and stop operators that are not among its states.

    Parameters
    ----------
    model
        A model, or its class.

    Raises
    ------
    ModelError
        When a friction, limit or stop operator is not a state, with its declaration, name, and the
        nearest state.
    """
    fields: tuple[str, ...] = getattr(model.State, "_fields", ())
    found: dict[str, str] = {}
    for kind in ("frictions", "limits", "stops") if fields else ():
        names = getattr(model, kind)
        if isinstance(names, property):
            continue
        cls = model if isinstance(model, type) else type(model)
        where = f"{place_of(cls)}: {model.name}: {kind}"
        if not isinstance(names, tuple):
            valid = f"a tuple of states, such as ({fields[0]!r},)"
            raise ModelError(
                f"{where} = {names!r} must be {valid}", name=kind, value=repr(names), valid=valid
            )
        for name in names:
            if name not in fields:
                error = unknown_name("state", str(name), fields)
                raise error.at(f"{where} lists {name!r}, which is not a field of State", ModelError)
            if kind == "stops" and name in found:
                raise ModelError(
                    f"{where} lists {name!r}, which is also one of {found[name]}. A stop operator "
                    "cannot have another force",
                    name=kind,
                    value=str(name),
                )
            found[name] = kind


def _declared(module: ModuleType) -> Iterator[type[Any]]:
    """Yield the complete models that a module defines."""
    for value in vars(module).values():
        defined = isinstance(value, type) and value.__module__ == module.__name__
        if defined and hasattr(value, "Memory") and hasattr(value, "balance"):
            require_states(value)
            yield value


ASSEMBLIES: Kind[Any] = Kind("assembly", ("model", "models", "rigs"), _declared)
"""the complete models of all brakes, including rigs, as classes by their ``name``"""


# --- Model wrapped around another model

_PROTOCOL = frozenset(name for name in vars(Model) if not name.startswith("_"))
if TYPE_CHECKING:
    _Protocol = Model
else:
    _Protocol = object  # the protocol's defaults must not hide the wrapped model


class Wrapping(_Protocol):
    """Model that is wrapped around another model; a subclass may declare another memory.

    Parameters
    ----------
    inner
        The wrapped model, which provides all protocol members that this class does not define.
    """

    def __init__(self, inner: Model) -> None:
        self.inner = inner

    def __getattr__(self, name: str) -> Any:
        if name not in _PROTOCOL:
            raise AttributeError(name)
        return getattr(self.inner, name)

    @property
    def name(self) -> str:
        """Name of the wrapped model."""
        return self.inner.name

    @property
    def State(self) -> type[NamedTuple]:
        """States of the wrapped model."""
        return self.inner.State

    @property
    def Memory(self) -> type[NamedTuple]:
        """Memory of the wrapped model."""
        return self.inner.Memory

    @property
    def Flow(self) -> type[NamedTuple]:
        """Integrals of the wrapped model."""
        return self.inner.Flow

    @property
    def Output(self) -> type[NamedTuple]:
        """Recorded signals of the wrapped model."""
        return self.inner.Output

    def mass(self, xe: Any, par: Any) -> Any:
        """Return the masses of the wrapped model."""
        return self.inner.mass(xe, par)

    def memory_inside(self, memory: Any) -> Any:
        """Return the memory that acts on the wrapped model's plant."""
        return memory

    def balance(self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]) -> Any:
        """Return the smooth right-hand side."""
        return self.inner.balance(x, xe, self.memory_inside(memory), par, contact)

    def bounds(
        self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the bounds of the frictions."""
        return self.inner.bounds(x, xe, self.memory_inside(memory), par, contact)

    def widths(
        self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]
    ) -> tuple[float, ...]:
        """Return the widths of the stop operators."""
        return self.inner.widths(x, xe, self.memory_inside(memory), par, contact)

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
