"""The problem that all peers solve: hard braking of the motorcycle brake from rest.

Plant and sensors are in continuous time, and the ECU's duty cycle is held between its ticks. The
peers integrate only smooth differential equations. Therefore their dry friction is regularized, and
the stops become one-sided springs. All other equations come from the model. The problem omits the
lower limit of the chamber pressure, because hard braking never reaches it. The states are divided
by their nominal magnitudes, so one absolute tolerance applies to all of them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from bywire.brakes.motorcycle import ecu as motorcycle_ecu
from bywire.brakes.motorcycle.ecu import Memory, Readings, Stimulus
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core import ops
from bywire.core.signals import signals_of, zeros
from bywire.core.typing import Array
from bywire.plant import current_sensor, motor_heat, pressure_sensor
from bywire.simulation.run import Run, simulate

Demand = Callable[[Array], Array]
Advance = Callable[[Array, float], Array]

DURATION = 1.2
SCALE = np.array([signal.nominal for signal in signals_of(MotorcycleBrake.State).values()])


class Solution(NamedTuple):
    """Solution of a peer.

    Parameters
    ----------
    time, p_mc
        Ticks of the ECU [s] and master-cylinder pressure at the ticks [Pa], shape (rows,).
    seconds
        CPU time of the integrator alone, without compilation, and without the ECU if it runs in
        Python, which favors the peer.
    """

    time: Array
    p_mc: Array
    seconds: float


def hard_braking(t: Array) -> Array:
    """Return the stimulus, a step from 6 to 37 bar at 0.2 s, as rows at the times ``t``."""
    rows = np.zeros((t.size, len(Stimulus._fields)))
    rows[:, Stimulus._fields.index("p_set")] = np.where(t >= 0.2 - 1e-9, 37e5, 6e5)
    return rows


def rest(par: MotorcycleParameters) -> Any:
    """Return the retracted piston at rest without pressure."""
    return zeros(MotorcycleBrake.State)._replace(
        theta=par.master_cylinder.x_rest / par.gear.k_g,
        **motor_heat.cold(par.motor_heat)._asdict(),
        y_p=pressure_sensor.reading(par.fluid.p_atm, par.pressure_sensor),
        y_i=current_sensor.reading(0.0, par.current_sensor),
    )


def braking_run(
    par: MotorcycleParameters, stimulus: Demand, duration: float = DURATION, step: float = 20e-6
) -> Run:
    """Return the problem as a run of bywire."""
    model = MotorcycleBrake()
    return Run(model, par, rest(par), zeros(Memory), stimulus, duration, step, par.ecu.T_s)


def reference(par: MotorcycleParameters, stimulus: Demand, duration: float = DURATION) -> Solution:
    """Return bywire's solution with steps of 2.5 us, the reference for errors."""
    done = simulate(braking_run(par, stimulus, duration, 2.5e-6), ("p_mc",))
    return Solution(done.time, done["p_mc"], 0.0)


def error(solution: Solution, exact: Solution) -> float:
    """Return the maximum pressure difference at the solution's ticks [bar]."""
    return float(np.abs(solution.p_mc - exact.p_mc[: solution.p_mc.size]).max()) / 1e5


def rates(z: Any, duty: Any, par: Any, width: float) -> tuple[Any, ...]:
    """Return dz/dt of the regularized plant, for floats, symbols or traced arrays.

    Parameters
    ----------
    z
        Scaled state, x = SCALE * z.
    duty
        Duty cycle.
    par
        Parameters.
    width
        Speed over which the friction changes sign, as tanh(omega / width) [rad/s].
    """
    model = MotorcycleBrake()
    x = MotorcycleBrake.State(*(float(s) * z[k] for k, s in enumerate(SCALE)))
    memory = zeros(Memory)._replace(duty=duty)
    contact = tuple(
        ops.fmax(gap / compliance, 0.0)
        for gaps, matrix in zip(model.gap(x, x, par), model.compliance(par), strict=True)
        for gap, (compliance,) in zip(gaps, matrix, strict=True)
    )
    smooth = model.balance(x, x, memory, par, contact)
    ((low, high),) = model.bounds(x, x, memory, par, contact)
    grip = ops.where(x.omega > 0, low, -high) * tanh(x.omega / width)
    driven = smooth._replace(omega=smooth.omega + grip)
    mass = model.mass(x, par)
    return tuple(f / (m * float(s)) for f, m, s in zip(driven, mass, SCALE, strict=True))


def tanh(z: Any) -> Any:
    """Return the hyperbolic tangent, in a form that cannot overflow."""
    decay = ops.exp(-2.0 * ops.fabs(z))
    return ops.where(z > 0, 1.0, -1.0) * (1.0 - decay) / (1.0 + decay)


def march(
    advance: Advance, par: MotorcycleParameters, stimulus: Demand, duration: float
) -> Solution:
    """Run the ECU tick by tick in Python around a peer's integrator, and time the integrator.

    Parameters
    ----------
    advance
        ``advance(z, duty) -> z``: integrates the scaled state over one sample time.
    """
    ticks = round(duration / par.ecu.T_s)
    times = np.arange(ticks + 1, dtype=np.float64) * par.ecu.T_s
    demand = stimulus(times)
    z, m = np.array(rest(par)) / SCALE, zeros(Memory)
    p_mc, seconds = np.empty(ticks + 1), 0.0
    for k, row in enumerate(demand.tolist()):
        state = MotorcycleBrake.State(*(SCALE * z).tolist())
        p_mc[k] = state.p_mc
        m = motorcycle_ecu.tick(Readings(state.y_p, state.y_i), m, Stimulus(*row), par)
        if k < ticks:
            begin = time.process_time()
            z = advance(z, m.duty)
            seconds += time.process_time() - begin
    return Solution(times, p_mc, seconds)
