"""Model with taps that can corrupt signals, and with tasks that can miss ticks.

Sensor readings, demands and controller outputs pass through a *tap*. A tap returns ``(1 + gain) y +
offset``, its last value if it is stuck, or its input a number of ticks ago. Gains, offsets and
other effects are additional signals of the stimulus. If they are zero, the model equals the inner
model. So runs with and without a fault have the same structure.
"""

from __future__ import annotations

import math
import typing
from collections.abc import Callable, Iterable
from functools import cache, partial
from typing import Annotated, Any, Literal, NamedTuple

from bywire.core import ops
from bywire.core.model import Model, Task, Wrapping
from bywire.core.signals import Signal, ranges_of, signals_of

DEAD = 2.0
"""value of a task's failure stimulus that means that the task has lost its memory"""


class Tap(NamedTuple):
    """Tap of a signal, which can corrupt the signal.

    Parameters
    ----------
    name
        Prefix of the tap's stimuli; see `controls`.
    side
        ``"reading"``: a state that the tasks read. ``"demand"``: a field of the stimulus.
        ``"drive"``: a field of the memory that the plant receives.
    field
        Name of the state or field.
    task
        Task that computes a drive that may be late.
    late
        Delay of a drive in ticks of the task, while its stimulus ``late`` is 1.
    """

    name: str
    side: Literal["reading", "demand", "drive"]
    field: str
    task: str = ""
    late: int = 0

    def controls(self) -> dict[str, str]:
        """Return the names of the stimuli that corrupt the signal, by their effect."""
        kinds = ("gain", "offset", "held", "late") if self.late else ("gain", "offset", "held")
        return {kind: f"tap_{self.name}_{kind}" for kind in kinds}


def rests(task: str) -> str:
    """Return the name of the stimulus that makes a task fail.

    If it is 1, the task misses its tick, and its outputs hold their values. If it is `DEAD`, all
    values that the task computes are its values at rest. The task loses its memory, and restarts
    later.
    """
    return f"rest_{task.replace('-', '_')}"


class Tapped(Wrapping):
    """Model with taps, which records each drive that the plant receives.

    Parameters
    ----------
    inner
        The model without taps.
    taps
        Taps of the signals that can be corrupted.
    resting
        Names of the tasks that can miss ticks.
    """

    def __init__(self, inner: Model, taps: tuple[Tap, ...], resting: tuple[str, ...] = ()) -> None:
        super().__init__(inner)
        self.taps, self.resting = taps, resting

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the inner model that is not in the protocol, such as its parts."""
        if name.startswith("__") or name == "inner":
            raise AttributeError(name)
        return getattr(self.inner, name)

    @property
    def Memory(self) -> type[NamedTuple]:
        """Memory of the inner model, then the last value and the delayed values of each tap."""
        return _memory(self.inner.Memory, self.inner.State, self.inner.Stimulus, self.taps)

    @property
    def Stimulus(self) -> type[NamedTuple]:
        """Stimulus of the inner model, then the signals that control the taps."""
        controls = [
            (name, Signal("1", name.replace("_", " ")))
            for tap in self.taps
            for name in tap.controls().values()
        ]
        tasks = [
            (rests(task), Signal("1", f"task {task} fails: 1 misses its tick, 2 is dead"))
            for task in self.resting
        ]
        return _extended(self.inner.Stimulus, (*controls, *tasks))

    def started(self, state: Any, memory: Any) -> Any:
        """Return the initial memory, from the inner model's memory and the state."""
        last: dict[str, Any] = {}
        for tap in self.taps:
            source = state if tap.side == "reading" else memory
            value = 0.0 if tap.side == "demand" else getattr(source, tap.field)
            last |= dict.fromkeys(_fields(tap), value)
        return self.Memory(*memory, **last)

    def rest(self, par: Any) -> tuple[Any, Any]:
        """Return the inner model's state of rest."""
        state, memory = self.inner.rest(par)
        return state, self.started(state, memory)

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return the controllers with their taps."""
        return self.behind_taps(self.inner.tasks(par))

    def behind_taps(self, tasks: Iterable[Task]) -> tuple[Task, ...]:
        """Return tasks of the inner model with taps; the tasks may come from any source."""
        return tuple(
            Task(task.name, task.period, partial(self._tick, task.name, task.tick))
            for task in tasks
        )

    def _tick(
        self, name: str, tick: Callable[..., Any], x: Any, memory: Any, stimulus: Any, par: Any
    ) -> Any:
        u = self.inner.Stimulus._make(stimulus[: len(self.inner.Stimulus._fields)])
        before = self._inside(memory)
        last: dict[str, Any] = {}
        for tap in self.taps:
            if tap.side == "reading":
                x = x._replace(**{tap.field: _tapped(tap, x, memory, stimulus, last)})
            elif tap.side == "demand":
                u = u._replace(
                    **{
                        tap.field: self._inside_range(
                            tap.field, _tapped(tap, u, memory, stimulus, last)
                        )
                    }
                )
        after = tick(x, before, u, par)
        if name in self.resting:
            fails = getattr(stimulus, rests(name))
            empty = self.inner.rest(par)[1]
            # Other tasks compute the values that a task returns unchanged.
            after = type(after)(
                *(
                    new if new is old else _failing(fails, old, new, none)
                    for old, new, none in zip(before, after, empty, strict=True)
                )
            )
        for tap in self.taps:
            if tap.side == "drive" and (name == tap.task or not tap.late):
                _tapped(tap, after, memory, stimulus, last)
        kept = {each: getattr(memory, each) for each in self.Memory._fields[len(after) :]}
        return self.Memory(*after, **{**kept, **last})

    def _inside_range(self, field: str, demand: Any) -> Any:
        """Return a corrupted demand within its range: a switch has only two positions."""
        low, high = ranges_of(self.inner.Stimulus).get(field, (-math.inf, math.inf))
        above = demand if low == -math.inf else ops.fmax(demand, low)
        return above if high == math.inf else ops.fmin(above, high)

    def _inside(self, memory: Any) -> Any:
        return self.inner.Memory._make(memory[: len(self.inner.Memory._fields)])

    def memory_inside(self, memory: Any) -> Any:
        """Return the memory that the plant receives, with the drives after their taps."""
        drives = {
            t.field: getattr(memory, f"last_{t.name}") for t in self.taps if t.side == "drive"
        }
        return self._inside(memory)._replace(**drives)


def _tapped(tap: Tap, source: Any, memory: Any, stimulus: Any, last: dict[str, Any]) -> Any:
    """Return the output of a tap, and store the values that the tap remembers."""
    control = {kind: getattr(stimulus, name) for kind, name in tap.controls().items()}
    value = getattr(source, tap.field)
    held, *line = _fields(tap)
    for k, name in enumerate(line):  # oldest value last
        last[name] = value if k == 0 else getattr(memory, line[k - 1])
    if line:
        value = _either(control["late"], getattr(memory, line[-1]), value)
    changed = value + control["gain"] * value + control["offset"]
    last[held] = _either(control["held"], getattr(memory, held), changed)
    return last[held]


def _either(flag: float, old: float, new: float) -> float:
    return ops.where(flag > 0.5, old, new)


def _failing(fails: float, old: float, new: float, none: float) -> float:
    """Return a memory value of a task that runs, misses its tick, or is dead."""
    return ops.where(fails > 0.5 * (1.0 + DEAD), none, _either(fails, old, new))


def _fields(tap: Tap) -> tuple[str, ...]:
    """Return the memory fields of a tap: its last value, then delayed values."""
    return (f"last_{tap.name}", *(f"late_{tap.name}_{k + 1}" for k in range(tap.late)))


@cache
def _memory(
    memory: type[NamedTuple],
    state: type[NamedTuple],
    stimulus: type[NamedTuple],
    taps: tuple[Tap, ...],
) -> type[NamedTuple]:
    sides = {"reading": state, "demand": stimulus, "drive": memory}
    kept = []
    for tap in taps:
        signal = signals_of(sides[tap.side])[tap.field]
        kept += [
            (name, Signal(signal.unit, f"{signal.label} after its tap", signal.nominal))
            for name in _fields(tap)
        ]
    return _extended(memory, tuple(kept))


@cache
def _extended(kind: type[NamedTuple], further: tuple[tuple[str, Signal], ...]) -> type[NamedTuple]:
    hints = typing.get_type_hints(kind, include_extras=True)
    fields = [(name, hints[name]) for name in kind._fields]
    fields += [(name, Annotated[float, signal]) for name, signal in further]
    extended: Any = NamedTuple(kind.__name__, fields)  # type: ignore[misc]
    return typing.cast("type[NamedTuple]", extended)
