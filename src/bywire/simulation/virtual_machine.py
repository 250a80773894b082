"""Fallback without a compiler: CasADi's virtual machine evaluates the same functions.

It cuts a substep at the zero crossing of a velocity, like the C code in ``emit_rare``.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.interrupts import raise_if_stopped
from bywire.core.typing import Array
from bywire.simulation.native import BufferedCall, Request
from bywire.simulation.schedule import (
    ATTEMPTS,
    CAP,
    CLOSE,
    COUNTERS,
    DOUBT,
    EDGE,
    FLAG,
    JUMP,
    NEAR,
    STILL,
    Layout,
    most_cuts,
)

if TYPE_CHECKING:
    from bywire.simulation.program import Program

Settle = Callable[[Array, Array, Array, Array, float], tuple[list[Array], bool]]


class CutSubstep:
    """One substep with as many parts as necessary.

    Parameters
    ----------
    settle
        Function that computes a step of any length. It returns x, d, r, q, jump, ..., and whether
        the step failed to settle.
    velocities
        Indices of the states with dry friction.
    m, p
        Memory and parameters.
    h
        Length of the substep [s].

    Attributes
    ----------
    tries
        Number of attempted parts.
    """

    def __init__(
        self, settle: Settle, velocities: Sequence[int], m: Array, p: Array, h: float
    ) -> None:
        self._settle, self._velocities = settle, velocities
        self._m, self._p, self._h = m, p, h
        self.tries = 0

    def results(self, x: Array, d: Array) -> tuple[list[Array], bool]:
        """Return x, d, r, q at the end of the substep, and whether it failed to settle."""
        h, left, most = self._h, self._h, most_cuts(len(self._velocities))
        flow: Array | float = 0.0
        unsettled = False
        for count in range(most + 1):
            o, failed = self._part(x, d, left)
            turns, _ = self._first_turn(x, o)
            if turns < 0:
                break
            if count == most:
                o[0][[k for k, jump in self._jumps(o) if x[k] * o[0][k] * jump < 0.0]] = 0.0
                failed = True
                break
            o, t, turns, failed = self._locate(x, d, o, left)
            unsettled |= failed
            before, x, d = x, o[0], o[1] * (h / t)
            for k, jump in self._jumps(o):
                if k == turns or abs(x[k]) < STILL * abs(
                    before[k]
                ):  # identical bodies stop at the same time
                    x[k], d[k] = 0.0, _turned_back(float(d[k]), jump * (h / t))
            flow = flow + o[3] * (t / h)
            left -= t
        if left < h:
            o[1], o[3] = o[1] * (h / left), flow + o[3] * (left / h)
        return o, failed or unsettled

    def _part(self, x: Array, d: Array, t: float) -> tuple[list[Array], bool]:
        self.tries += 1
        return self._settle(x, d * (t / self._h), self._m, self._p, t)

    def _jumps(self, o: list[Array]) -> Iterator[tuple[int, float]]:
        """Return the states with dry friction, and the changes of their increments by its jump."""
        return zip(self._velocities, o[JUMP], strict=True)

    def _first_turn(self, x: Array, o: list[Array]) -> tuple[int, float]:
        """Return the first velocity to change sign, or -1, and the time as a fraction."""
        first, share = -1, 1.0
        for k, jump in self._jumps(o):
            v, w = float(x[k]), float(o[0][k])
            if v * w * jump < 0.0 and v / (v - w) <= share:
                first, share = k, v / (v - w)
        return first, share

    def _locate(
        self, x: Array, d: Array, o: list[Array], length: float
    ) -> tuple[list[Array], float, int, bool]:
        """Return the part that ends at the first zero of a velocity.

        The result contains the part's length, the index of the velocity, and whether the part
        failed to settle.
        """
        first, final = EDGE * length, (1.0 - EDGE) * length
        turns, _ = self._first_turn(x, o)
        low, high = 0.0, length
        points = [(0.0, float(x[turns])), (length, float(o[0][turns]))]
        change = abs(points[0][1] - points[1][1])
        before: tuple[float, list[Array]] | None = None
        t = _zero_of(*points[0][1:], *points[1], 2.0 * float(d[turns]) / self._h, self._h)
        for n in range(1, ATTEMPTS + 1):
            t = float(np.clip(t, first, final))
            o, failed = self._part(x, d, t)
            other, share = self._first_turn(x, o)
            if other >= 0 and other != turns and n < ATTEMPTS:
                turns, low, high = other, 0.0, t
                points = [(0.0, float(x[turns])), (t, float(o[0][turns]))]
                change, before = abs(points[0][1] - points[1][1]), None
                t = t * share
                continue
            w = float(o[0][turns])
            (P, at_P), (Q, at_Q) = points
            if abs(w) <= CLOSE * change or not first < t < final or t in (P, Q) or n == ATTEMPTS:
                break  # with the result for this length
            low, high = (t, high) if w * x[turns] > 0.0 else (low, t)
            slope = (w - at_P) / (t - P) + (w - at_Q) / (t - Q) - (at_Q - at_P) / (Q - P)
            following = t - w / slope
            is_near = abs(w) <= NEAR * change and first < following < final
            if is_near and before is not None:
                # The rest of the search uses the line through two attempts.
                share = (following - t) / (t - before[0])
                moved = [now + share * (now - was) for now, was in zip(o, before[1], strict=True)]
                return [*moved[:JUMP], *o[JUMP:]], following, turns, failed
            before = (t, o)
            points[0 if abs(P - following) > abs(Q - following) else 1] = (t, w)
            t = following if low < following < high else 0.5 * (low + high)
        return o, t, turns, failed


def _turned_back(before: float, jump: float) -> float:
    """Return half the increment after a zero of the velocity, reduced by the jump of friction."""
    return math.copysign(max(abs(before) - jump, 0.0), before)


def _zero_of(v: float, t: float, w: float, before: float, h: float) -> float:
    """Return the time of the zero of a velocity that changes from v to w within t.

    This is the zero of a parabola, whose mean slope over the preceding length h is ``before``.
    """
    mean = (w - v) / t
    linear = -v / mean
    bend = 2.0 * (mean - before) / (t + h) if before else 0.0
    slope = mean + bend * (linear - 0.5 * t)
    zero = linear - 0.5 * bend * linear * (linear - t) / slope if slope else linear
    return zero if 0.0 < zero < t else linear


# --- The virtual machine


class VirtualMachine:
    """Kernel whose loops are in Python and whose functions run in CasADi's virtual machine."""

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
        self._lock = threading.Lock()  # the functions' buffers support only one run at a time

    def advance(self, request: Request, state: Array, begin: int, end: int, rows: Array) -> None:
        """Run the frames from begin to end; update ``state`` and fill ``rows`` in place."""
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
            # The velocities of a settled step are final, so a compiled kernel does not repeat it.
            part["counters"] += failed, 1.0, cut.tries - is_known
        for kind, value in zip(("x", "d", "r"), result, strict=False):
            part[kind][:] = value
        part["q"] += result[3]

    def _settled(
        self, x: Array, d: Array, m: Array, p: Array, h: float
    ) -> tuple[list[Array], bool]:
        """Return the result of a step of any length, and whether it failed to settle."""
        guess, step = d, np.array([h])
        result = self._fast(x, guess, m, p, step)
        if result[DOUBT][0] != 0.0:
            for _ in range(CAP):
                result = self._exact(x, guess, m, p, step)
                if result[DOUBT][0] == 0.0:
                    break
                guess = result[1].copy()
        return [part.copy() for part in result], bool(result[DOUBT][0] != 0.0)
