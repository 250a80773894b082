"""diffrax on JAX: a stiff Runge-Kutta method with ECU and plant in one compiled program."""

from __future__ import annotations

import importlib.util
import time
from typing import Any

import numpy as np

from benchmarks.motorcycle.problem import (
    DURATION,
    SCALE,
    Demand,
    Solution,
    rates,
    rest,
)
from bywire.brakes.motorcycle import ecu as motorcycle_ecu
from bywire.brakes.motorcycle.ecu import Memory, Readings, Stimulus
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters

WIDTH = 3e-4
TOLERANCE = 1e-3
SETTINGS = ((WIDTH, 2e-3), (WIDTH, TOLERANCE))
"""widths and tolerances that the benchmark compares"""
FIRST_STEP = 1e-5


def available() -> bool:
    """Return whether JAX and diffrax are installed."""
    return all(importlib.util.find_spec(name) for name in ("jax", "diffrax"))


def solve(
    par: MotorcycleParameters,
    stimulus: Demand,
    duration: float = DURATION,
    width: float = WIDTH,
    tolerance: float = TOLERANCE,
    repeats: int = 1,
) -> Solution:
    """Solve the problem in double precision, with plant and ECU in one scan over the ticks.

    Parameters
    ----------
    par, stimulus, duration
        See ``problem``.
    width
        Speed over which the friction changes sign [rad/s].
    tolerance
        Relative tolerance, and absolute tolerance of the scaled states.
    repeats
        Number of runs after the first run, which compiles. The fastest run counts.

    Notes
    -----
    Kvaerno3 was the fastest of Kvaerno3, 4 and 5 at this error. The table shows the maximum error
    in 1.2 s of hard braking with a width of 3e-4 (0.004 bar with bywire at 20 us), and the time on
    one machine:

    ========  =========  ===========  =======
    method    tolerance  error [bar]  seconds
    ========  =========  ===========  =======
    Kvaerno3  1e-2       0.33         0.16
    Kvaerno3  1e-3       0.006        0.21
    Kvaerno3  1e-4       0.009        0.32
    Kvaerno5  1e-4       0.009        0.65
    ========  =========  ===========  =======
    """
    import jax

    times = np.arange(round(duration / par.ecu.T_s) + 1, dtype=np.float64) * par.ecu.T_s
    with jax.enable_x64(True):
        run = jax.jit(_program(par, width, tolerance))
        demand = jax.numpy.asarray(stimulus(times))
        start = (
            jax.numpy.asarray(np.array(rest(par)) / SCALE),
            jax.numpy.zeros(len(Memory._fields)),
        )
        p_mc = np.asarray(run(start, demand))
        spans = []
        for _ in range(repeats):
            begin = time.process_time()
            run(start, demand).block_until_ready()
            spans.append(time.process_time() - begin)
    return Solution(times, p_mc, min(spans))


def _program(par: MotorcycleParameters, width: float, tolerance: float) -> Any:
    import diffrax
    import jax

    from benchmarks.peers.traced import Traced, stacked, traced_signals

    def slope(t: Any, z: Any, duty: Any) -> Any:
        return stacked(rates([Traced(entry) for entry in z], Traced(duty), par, width))

    term, solver = diffrax.ODETerm(slope), diffrax.Kvaerno3()
    control = diffrax.PIDController(rtol=tolerance, atol=tolerance)
    duty_at = Memory._fields.index("duty")

    def tick(carry: Any, u: Any) -> Any:
        z, memory = carry
        x = traced_signals(MotorcycleBrake.State, z * SCALE)
        readings = Readings(x.y_p, x.y_i)
        after: Any = motorcycle_ecu.tick(
            readings, traced_signals(Memory, memory), traced_signals(Stimulus, u), par
        )
        memory = stacked(after)
        solved = diffrax.diffeqsolve(
            term,
            solver,
            0.0,
            par.ecu.T_s,
            FIRST_STEP,
            z,
            memory[duty_at],
            stepsize_controller=control,
            max_steps=None,
            saveat=diffrax.SaveAt(t1=True),
            adjoint=diffrax.ForwardMode(),
        )
        return (solved.ys[0], memory), x.p_mc.value

    def program(start: Any, demand: Any) -> Any:
        _, p_mc = jax.lax.scan(tick, start, demand)
        return p_mc

    return program
