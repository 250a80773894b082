"""Second order where rows are nonlinear in the state, and in the linear rows beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp

from bywire.simulation.run import Run, simulate
from convergence.observed_order import assert_order
from systems.nonlinear_drive import PARAMETERS, Memory, NonlinearDrive, State

STEPS = (50e-6, 40e-6, 25e-6, 20e-6, 12.5e-6, 10e-6)
VOLTAGE, DURATION = 6.0, 0.2
SIGNALS = ("i", "theta", "omega")


def drive(step: float) -> Run:
    return Run(
        NonlinearDrive(),
        PARAMETERS,
        State(0.0, 0.0, 0.0),
        Memory(VOLTAGE),
        lambda t: np.full((t.size, 1), VOLTAGE),
        DURATION,
        step,
    )


def exact(times: np.ndarray) -> np.ndarray:
    p, model = PARAMETERS, NonlinearDrive()

    def slope(t: float, z: np.ndarray) -> np.ndarray:
        x = State(*z)
        balance = model.balance(x, x, Memory(VOLTAGE), p, ())
        return np.array(balance) / np.array(model.mass(x, p))

    solution = solve_ivp(
        slope, (0.0, DURATION), np.zeros(3), "DOP853", times, rtol=1e-12, atol=1e-13
    )
    return solution.y.T


def test_states_converge_to_an_independent_solution() -> None:
    errors, residuals = [], []
    for step in STEPS:
        result = simulate(drive(step))
        computed = np.stack([result[name] for name in SIGNALS], axis=1)
        errors.append(np.abs(computed - exact(result.time)).max(axis=0))
        residuals.append(np.abs(result["residual"]).max())
    for name, column in zip(SIGNALS, np.transpose(errors), strict=True):
        assert_order(STEPS, column, 2.0, name)
    assert_order(STEPS, residuals, 2.0, "energy")


def test_the_compiled_run_is_that_of_the_virtual_machine() -> None:
    run = replace(drive(20e-6), duration=0.05)
    compiled, machine = simulate(run), simulate(run, engine="virtual-machine")
    np.testing.assert_allclose(compiled.values, machine.values, rtol=1e-9, atol=1e-12)
