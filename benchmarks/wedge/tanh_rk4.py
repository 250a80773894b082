"""Tanh friction and explicit steps for the wedge brake, ``tanh_rk4_wedge.c``."""

from __future__ import annotations

import ctypes
import time
from dataclasses import replace
from typing import NamedTuple

from benchmarks.peers.hand_code import arrays, load, plan_arguments
from benchmarks.wedge.hand_wedge import SUBJECT
from bywire.core.typing import Array
from bywire.simulation.compiler import SINGLE
from bywire.simulation.native import pointer
from bywire.simulation.run import Run

SIGNALS = ("x", "y_M")


class Solution(NamedTuple):
    """Wedge travel [m] and measured moment [N m] at the recorded times, and the run time [s]."""

    x: Array
    y_M: Array
    seconds: float


def solve(run: Run, width: float, width_v: float, step: float) -> Solution:
    """Solve a run of the wedge brake.

    Parameters
    ----------
    run
        The problem, whose own step does not count.
    width, width_v
        Speeds over which shaft friction [rad/s] and wedge friction [m/s] change sign, as
        tanh(omega / width).
    step
        Step [s]. At zero speed it is stable up to 2.8 times width times inertia divided by
        friction. Slightly longer steps chatter within the width and cost little accuracy.
    """
    own = replace(run, step=step)
    _, library = load(SUBJECT.text(own.par, "tanh_rk4_wedge.c"), SINGLE, "tanh_run")
    library.tanh_run.restype = None
    shared, state, values = arrays(own, [own.par], SIGNALS)
    arguments = (
        *plan_arguments(own, shared),
        pointer(state),
        ctypes.c_double(width),
        ctypes.c_double(width_v),
        pointer(values),
    )
    begin = time.perf_counter()
    library.tanh_run(*arguments)
    seconds = time.perf_counter() - begin
    return Solution(values[0, :, 0], values[0, :, 1], seconds)
