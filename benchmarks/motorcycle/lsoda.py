"""LSODA through SciPy: alternating BDF and Adams methods with an exact Jacobian.

``odeint`` is used instead of ``solve_ivp``, because it is the same LSODA without a Python loop
around its steps, and twice as fast here. The right-hand side and its Jacobian are CasADi functions
that are called through their buffers, about twenty times faster than the equations on floats.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import odeint

from benchmarks.motorcycle.problem import (
    DURATION,
    Demand,
    Solution,
    march,
)
from benchmarks.motorcycle.symbolic import slope_and_jacobian
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.typing import Array

WIDTH = 3e-4
TOLERANCE = 1e-7
SETTINGS = ((WIDTH, TOLERANCE), (WIDTH, 3e-8))
"""widths and tolerances that the benchmark compares"""
MAX_STEPS = 100_000


def available() -> bool:
    """Return True, because SciPy is a requirement of bywire."""
    return True


def solve(
    par: MotorcycleParameters,
    stimulus: Demand,
    duration: float = DURATION,
    width: float = WIDTH,
    tolerance: float = TOLERANCE,
) -> Solution:
    """Solve the problem, one call per tick of the ECU.

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
    the time on one machine:

    =====  =========  ===========  =======
    width  tolerance  error [bar]  seconds
    =====  =========  ===========  =======
    1e-3   1e-6       0.018        0.35
    3e-4   1e-7       0.011        0.48
    3e-4   3e-8       0.008        0.63
    1e-4   1e-8       0.003        0.74
    =====  =========  ===========  =======
    """
    slope, jacobian = slope_and_jacobian(par, width)
    span = (0.0, par.ecu.T_s)

    def advance(z: Array, duty: float) -> Array:
        path = odeint(
            lambda z, _: slope(z, duty),
            z,
            span,
            Dfun=lambda z, _: jacobian(z, duty),
            rtol=tolerance,
            atol=tolerance,
            mxstep=MAX_STEPS,
        )
        return np.asarray(path[-1])

    return march(advance, par, stimulus, duration)
