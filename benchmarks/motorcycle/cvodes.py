"""CVODES through CasADi: variable-order BDF with exact Jacobians and tanh friction."""

from __future__ import annotations

import casadi as ca

from benchmarks.motorcycle.problem import (
    DURATION,
    Demand,
    Solution,
    march,
)
from benchmarks.motorcycle.symbolic import Buffered, plant
from bywire.brakes.motorcycle.parameters import MotorcycleParameters

WIDTH = 3e-4
TOLERANCE = 1e-7
SETTINGS = ((5e-4, 1e-6), (WIDTH, TOLERANCE))
"""widths and tolerances that the benchmark compares"""
MAX_STEPS = 1_000_000


def available() -> bool:
    """Return True, because CasADi is a requirement of bywire."""
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
        Speed over which the friction changes sign [rad/s].
    tolerance
        Relative tolerance, and absolute tolerance of the scaled states.

    Notes
    -----
    The table shows the maximum error in 1.2 s of hard braking (0.004 bar with bywire at 20 us), and
    the time on one machine. The error does not decrease evenly, because one code of the ECU's
    converter is 0.012 bar.

    =====  =========  ===========  =======
    width  tolerance  error [bar]  seconds
    =====  =========  ===========  =======
    1e-2   1e-6       0.123        0.25
    1e-3   1e-6       0.020        0.26
    3e-4   1e-7       0.008        0.30
    1e-4   1e-8       0.004        0.34
    =====  =========  ===========  =======
    """
    p = plant(par, width)
    problem = {"x": p.z, "p": p.duty, "ode": p.rate}
    options = {"reltol": tolerance, "abstol": tolerance, "max_num_steps": MAX_STEPS}
    whole = ca.integrator("whole", "cvodes", problem, 0.0, par.ecu.T_s, options)
    z, duty = ca.MX.sym("z", p.z.numel()), ca.MX.sym("duty")
    tick = Buffered(ca.Function("tick", [z, duty], [whole(x0=z, p=duty)["xf"]]))
    return march(tick, par, stimulus, duration)
