"""Software in the loop: ticks of the ECU's compiled C code between steps of the plant's kernel.

The kernel runs one frame at a time, with a frame number at which none of its own tasks is due.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import CompilerError
from bywire.core.model import Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array
from bywire.export.controller import render
from bywire.export.controller.program import Program, Step, program
from bywire.simulation.compiler import Compiler, compile_library, find_compiler, load
from bywire.simulation.native import Request, SingleKernel, pointer
from bywire.simulation.schedule import Layout
from bywire.simulation.tapped import Tapped

NEVER = 2**40
"""frame number that no run reaches"""
# A kernel assumes finite numbers. An ECU does not, so it is compiled with the flags of its export.
_FLAGS = ("-O2", "-fsigned-zeros", "-ftrapping-math", "-fno-finite-math-only")
_INCLUDED = re.compile(r'^#include "(.*)"$', re.MULTILINE)


class SoftwareInTheLoop:
    """Engine for single runs whose tasks are the ECU's compiled C code.

    Corrupted signals and missed ticks apply outside the ECU.

    Parameters
    ----------
    model, par
        The exported model and its parameters. Every request contains the parameter values.
    precision
        ``double`` or ``single`` precision of the ECU.
    plant
        Kernel that steps the plant.

    Raises
    ------
    ModelError
        If the ECU contains code that cannot be translated, with file, line and operation.
    CompilerError
        If there is no compiler, or the compiler fails.
    """

    def __init__(
        self, model: Model, par: ParameterSet, precision: str, plant: SingleKernel
    ) -> None:
        self._plant, self._model = plant, model
        self.layout: Layout = plant.layout
        inner: Any = model.inner if isinstance(model, Tapped) else model
        self._made = made = program(inner, par, precision)
        self.label = f"{plant.label}, ECU as C in {precision} precision"
        compiler = find_compiler()
        if compiler is None:  # pragma: no cover - the plant is compiled already
            raise CompilerError("there is no C compiler for the ECU")
        loaded = compiled(made, compiler)
        self._real = np.float32 if precision == "single" else np.float64
        self._functions = [getattr(loaded, step.name) for step in made.steps]
        for function in self._functions:
            function.restype = None
        classes = {"memory": inner.Memory, "x": inner.State, "u": inner.Stimulus}
        self._places = {short: _places(made, cls) for short, cls in classes.items()}
        self._leaves = _leaves_read(made, list(par.leaves()))
        self._derive = getattr(loaded, f"{made.name}_ecu_derive") if made.derived else None

    def advance(self, request: Request, state: Array, begin: int, end: int, rows: Array) -> None:
        """Run the frames from begin to end; update ``state`` and fill ``rows`` in place."""
        schedule, model, start = request.schedule, self._model, self.layout.start
        x, m = (slice(start[k], start[k] + self.layout.length[k]) for k in ("x", "m"))
        tasks = self._tasks(request.parameters)
        aside = replace(
            schedule,
            frames=NEVER,
            record_frames=NEVER,
            task_frames=tuple(NEVER for _ in schedule.task_frames),
        )
        row = 0
        for frame in range(begin, end + int(end == schedule.frames)):
            stimulus = request.stimulus[frame // schedule.stimulus_frames]
            for every, task in zip(schedule.task_frames, tasks, strict=True):
                if frame % every == 0:
                    values = model.State(*state[x].tolist()), model.Memory(*state[m].tolist())
                    state[m] = task.tick(*values, model.Stimulus(*stimulus.tolist()), None)
            is_recorded, is_last = frame % schedule.record_frames == 0, frame == schedule.frames
            # The plan covers only this frame: recorded if due, and without substeps at the end.
            plan = replace(
                aside, record_frames=1 if is_recorded else NEVER, frames=1 if is_last else NEVER
            )
            here = replace(request, schedule=plan, stimulus=np.ascontiguousarray(stimulus))
            self._plant.advance(here, state, 1, 1 if is_last else 2, rows[row:])
            row += int(is_recorded)

    def _tasks(self, parameters: Array) -> tuple[Task, ...]:
        """Return the compiled tasks for these parameters, after the model's taps if it has any."""
        is_leaf = self._leaves >= 0
        par = np.zeros(len(is_leaf), self._real)
        par[is_leaf] = parameters[self._leaves[is_leaf]]
        if self._derive is not None:
            self._derive(pointer(par))
        tasks = tuple(
            Task(step.task.name, step.task.period, self._tick(step, function, par))
            for step, function in zip(self._made.steps, self._functions, strict=True)
        )
        return self._model.behind_taps(tasks) if isinstance(self._model, Tapped) else tasks

    def _tick(self, step: Step, function: Any, par: NDArray[Any]) -> Callable[..., Any]:
        """Return the tick of a compiled task: State, Memory and Stimulus in, Memory out."""
        # After its numbers, the memory contains a status for each step.
        room = 1 + len(self._made.steps)
        held = {short: np.zeros(len(at) + room, self._real) for short, at in self._places.items()}
        arguments = [pointer({**held, "par": par}[short]) for _, short in step.arguments]
        kept = self._places["memory"]

        def tick(x: Any, m: Any, u: Any, _: Any) -> Any:
            for short, given in (("x", x), ("memory", m), ("u", u)):
                for k, place in enumerate(self._places[short]):
                    held[short][k] = given[place]
            function(*arguments)
            after = list(m)
            for place, value in zip(kept, held["memory"].tolist(), strict=False):
                after[place] = value
            return type(m)(*after)

        return tick


def compiled(made: Program, compiler: Compiler) -> ctypes.CDLL:
    """Return the compiled ECU: all files in one source, with each header at its first inclusion."""
    name = made.name
    headers = {f"{name}_ecu.h": render.header(made), f"{name}_ops.h": render.operations(made)}
    sources = [render.source(made)]
    if render.has_io(made):
        headers[f"{name}_io.h"] = render.io_header(made)
        sources.append(render.io_source(made))

    def unfolded(text: str) -> str:
        return _INCLUDED.sub(lambda found: unfolded(headers.pop(found[1], "")), text)

    # Zeros, because initial memory and parameters come from the bench.
    zeros = f"const {name}_Memory {name}_initial_memory = {{0}};"
    source = "\n".join([*map(unfolded, sources), zeros, ""])
    entry = made.steps[0].name
    return load(compile_library(source, _FLAGS, compiler, entry), entry)


def _places(made: Program, cls: Any) -> list[int]:
    """Return the indices of a NamedTuple's fields that exist in C, in the structure's order."""
    fields = list(cls._fields)
    return [fields.index(each.name) for each in made.members(cls)]


def _leaves_read(made: Program, leaves: Sequence[str]) -> NDArray[np.int64]:
    """Return the indices of the parameter values that exist in C, in order; -1 if derived."""
    places = []
    for dotted, member in made.held():
        if member.is_derived:
            places.append(-1)
            continue
        found = [k for k, name in enumerate(leaves) if _belongs(name, dotted, member.length)]
        places += found
    return np.array(places, dtype=np.int64)


def _belongs(leaf: str, dotted: str, length: int) -> bool:
    return leaf.rpartition(".")[0] == dotted if length else leaf == dotted
