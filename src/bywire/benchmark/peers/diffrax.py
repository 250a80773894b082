"""diffrax on JAX: a stiff Runge-Kutta method, the whole run in one compiled program."""

from __future__ import annotations

import importlib.util
import time
from typing import Any

import numpy as np

from bywire.assemblies import motorcycle_ecu
from bywire.assemblies.motorcycle_ecu import Memory, Readings, Stimulus
from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.assemblies.motorcycle_plant import State
from bywire.benchmark.peers.problem import DURATION, SCALE, Demand, Solution, rates, rest
from bywire.core.signals import zeros

WIDTH = 3e-4
TOLERANCE = 1e-6


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
    """Solve the problem with Kvaerno5 in double precision, plant and ECU in one scan over ticks.

    Parameters
    ----------
    par, stimulus, duration
        See ``problem``.
    width
        Speed over which the friction changes its sign [rad/s].
    tolerance
        Relative tolerance, and absolute tolerance of the scaled states.
    repeats
        Runs after the one that compiles; the fastest counts.
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
            begin = time.perf_counter()
            run(start, demand).block_until_ready()
            spans.append(time.perf_counter() - begin)
    return Solution(times, p_mc, min(spans))


def _program(par: MotorcycleParameters, width: float, tolerance: float) -> Any:
    import diffrax
    import jax
    import jax.numpy as jnp

    from bywire.benchmark.peers.traced import Traced

    def slope(t: Any, z: Any, duty: Any) -> Any:
        found = rates([Traced(z[k]) for k in range(len(State._fields))], Traced(duty), par, width)
        return jnp.stack([r.value for r in found])

    term, solver = diffrax.ODETerm(slope), diffrax.Kvaerno5()
    control = diffrax.PIDController(rtol=tolerance, atol=tolerance)
    duty_at = Memory._fields.index("duty")

    def tick(carry: Any, u: Any) -> Any:
        z, memory, dt = carry
        x = State(*(Traced(float(s) * z[k]) for k, s in enumerate(SCALE)))
        before = Memory(*(Traced(memory[k]) for k in range(memory.size)))
        asked = Stimulus(*(Traced(u[k]) for k in range(u.size)))
        after = motorcycle_ecu.tick(Readings(x.y_p, x.y_i), before, asked, par)
        memory = jnp.stack([v.value for v in after])
        solved = diffrax.diffeqsolve(
            term, solver, 0.0, par.ecu.T_s, dt, z, memory[duty_at],
            stepsize_controller=control, max_steps=None,
            saveat=diffrax.SaveAt(t1=True), adjoint=diffrax.ForwardMode(),
        )  # fmt: skip
        return (solved.ys[0], memory, dt), x.p_mc.value

    def program(start: Any, demand: Any) -> Any:
        _, p_mc = jax.lax.scan(tick, (*start, jnp.asarray(1e-6)), demand)
        return p_mc

    return program
