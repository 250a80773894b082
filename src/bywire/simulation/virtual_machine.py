"""Fallback without a compiler: CasADi's virtual machine evaluates the same functions."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.interrupts import raise_if_stopped
from bywire.core.typing import Array
from bywire.simulation.buffered_call import BufferedCall
from bywire.simulation.cut_substep import CutSubstep
from bywire.simulation.layout import CAP, COUNTERS, DOUBT, FLAG, Layout
from bywire.simulation.native import Request

if TYPE_CHECKING:
    from bywire.simulation.program import Program


class VirtualMachine:
    """The kernel's loops in Python, its functions in CasADi's virtual machine."""

    label = "virtual machine (no C compiler)"

    def __init__(self, program: Program) -> None:
        n = program.sizes
        lengths = {
            "x": n.x,
            "d": n.x,
            "r": n.reaction,
            "q": n.flow,
            "m": n.memory,
        }
        starts = np.concatenate(([0], np.cumsum(list(lengths.values()))))
        start = dict(zip([*lengths, "counters"], map(int, starts), strict=True))
        self.layout = Layout(start, lengths)
        self._program, self._velocities = program, program.velocities
        self._fast = BufferedCall(program.fast)
        self._exact = BufferedCall(program.exact)
        self._ticks = [BufferedCall(tick) for tick in program.ticks]
        self._output = BufferedCall(program.output)
        self._lock = threading.Lock()  # the functions' buffers serve one run at a time

    def advance(self, request: Request, state: Array, begin: int, end: int, rows: Array) -> None:
        """Run frames begin..end: renews ``state`` and fills ``rows`` in place."""
        with self._lock:
            self._advance(request, state, begin, end, rows)

    def _advance(self, request: Request, state: Array, begin: int, end: int, rows: Array) -> None:
        schedule = request.schedule
        p, h = request.parameters, np.array([schedule.step])
        part = {
            kind: state[at : at + self.layout.length.get(kind, COUNTERS)]
            for kind, at in self.layout.start.items()
        }
        row = 0
        for frame in range(begin, end + int(end == schedule.frames)):
            raise_if_stopped()
            u = request.stimulus[frame // schedule.stimulus_frames]
            for task, every in zip(self._ticks, schedule.task_frames, strict=True):
                if frame % every == 0:
                    part["m"][:] = task(part["x"], part["m"], u, p)[0]
            if frame % schedule.record_frames == 0:
                o = self._output(part["x"], part["m"], p, part["r"], part["q"], h)[0]
                rows[row] = o[request.selection]
                row += 1
            if frame < end:
                for _ in range(schedule.substeps):
                    self._substep(part, p, h)

    def _substep(self, part: dict[str, Array], p: Array, h: Array) -> None:
        result = self._fast(part["x"], part["d"], part["m"], p, h)
        if result[FLAG][0] != 0.0:
            cut = CutSubstep(self._settled, self._velocities, part["m"], p, float(h[0]))
            is_known = int(result[DOUBT][0] == 0.0)
            result, failed = cut.results(part["x"].copy(), part["d"].copy())
            # Of a step that has settled a kernel knows the velocities, and does not try it again.
            part["counters"] += failed, 1.0, cut.tries - is_known
        for kind, value in zip(("x", "d", "r"), result, strict=False):
            part[kind][:] = value
        part["q"] += result[3]

    def _settled(
        self, x: Array, d: Array, m: Array, p: Array, h: float
    ) -> tuple[list[Array], bool]:
        """Return what a step of any length gives, and whether it did not settle."""
        guess, step = d, np.array([h])
        result = self._fast(x, guess, m, p, step)
        if result[DOUBT][0] != 0.0:
            for _ in range(CAP):
                result = self._exact(x, guess, m, p, step)
                if result[DOUBT][0] == 0.0:
                    break
                guess = result[1].copy()
        return [part.copy() for part in result], bool(result[DOUBT][0] != 0.0)
