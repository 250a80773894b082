"""PathSim: the plant as one ODE block, with a variable-step GEAR method in Python."""

from __future__ import annotations

import importlib.util

import numpy as np

from benchmarks.motorcycle.problem import (
    SCALE,
    Demand,
    Solution,
    march,
    rest,
)
from benchmarks.motorcycle.symbolic import slope_and_jacobian
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.typing import Array

DURATION = 0.3
WIDTH = 3e-4
TOLERANCE = 1e-3
SETTINGS = ((1e-3, TOLERANCE), (5e-4, 3e-3), (WIDTH, TOLERANCE))
"""widths and tolerances that the benchmark compares"""
FIRST_STEP = 1e-5
IMPLICIT = 1e-3  # tolerance of the implicit equations relative to the step's tolerance


def available() -> bool:
    """Return whether PathSim is installed."""
    return importlib.util.find_spec("pathsim") is not None


def solve(
    par: MotorcycleParameters,
    stimulus: Demand,
    duration: float = DURATION,
    width: float = WIDTH,
    tolerance: float = TOLERANCE,
) -> Solution:
    """Solve the problem with one block in one simulation that runs from tick to tick.

    PathSim is slow, so the default is 0.3 s, with the first 0.1 s of the braking. The maximum error
    of bywire is also in this interval. Compare with bywire over the same time.

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
    One block of CasADi functions, instead of a diagram of many blocks, favors PathSim. The table
    shows the maximum error in 0.3 s with a width of 3e-4 (0.004 bar with bywire at 20 us), and the
    time on one machine:

    ========  =========  ===========  =======
    method    tolerance  error [bar]  seconds
    ========  =========  ===========  =======
    GEAR32    1e-3       0.0045       2.1
    GEAR32    1e-4       0.0028       3.6
    ESDIRK43  1e-3       0.0051       5.2
    ESDIRK32  1e-3       0.0038       5.8
    ========  =========  ===========  =======
    """
    from pathsim import Simulation
    from pathsim.blocks import ODE
    from pathsim.solvers import GEAR32

    slope, jacobian = slope_and_jacobian(par, width)
    held = [0.0]
    block = ODE(
        lambda z, u, t: slope(z, held[0]),
        np.array(rest(par)) / SCALE,
        lambda z, u, t: jacobian(z, held[0]),
    )
    simulation = Simulation(
        [block],
        dt=FIRST_STEP,
        Solver=GEAR32,
        log=False,
        tolerance_fpi=IMPLICIT * tolerance,
        tolerance_lte_rel=tolerance,
        tolerance_lte_abs=tolerance,
    )

    def advance(z: Array, duty: float) -> Array:
        held[0], simulation.dt = duty, FIRST_STEP
        simulation.run(par.ecu.T_s)
        return np.array(block.engine.state)

    return march(advance, par, stimulus, duration)
