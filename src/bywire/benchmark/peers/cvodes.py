"""CVODES through CasADi: variable-order BDF with exact Jacobians, the friction as a tanh."""

from __future__ import annotations

import casadi as ca

from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.benchmark.peers.problem import (
    DURATION,
    Array,
    Buffered,
    Demand,
    Solution,
    march,
    symbols,
)

WIDTH = 3e-4
TOLERANCE = 1e-7


def available() -> bool:
    """Return whether it can run: CasADi is among the requirements."""
    return True


def solve(
    par: MotorcycleParameters,
    stimulus: Demand,
    duration: float = DURATION,
    width: float = WIDTH,
    tolerance: float = TOLERANCE,
) -> Solution:
    """Solve the problem, one integrator call per tick of the ECU.

    Parameters
    ----------
    par, stimulus, duration
        See ``problem``.
    width
        Speed over which the friction changes its sign [rad/s].
    tolerance
        Relative tolerance, and absolute tolerance of the scaled states.
    """
    s = symbols(par, width)
    options = {"reltol": tolerance, "abstol": tolerance, "max_num_steps": 1000000}
    plant = {"x": s.z, "p": s.duty, "ode": s.rate}
    whole = ca.integrator("whole", "cvodes", plant, 0.0, par.ecu.T_s, options)
    z, duty = ca.MX.sym("z", s.z.shape[0]), ca.MX.sym("duty")
    tick = Buffered(ca.Function("tick", [z, duty], [whole(x0=z, p=duty)["xf"]]))

    def advance(z: Array, duty: float) -> Array:
        return tick(z, duty)[:, 0]

    return march(advance, par, stimulus, duration)
