"""Second order through slip of springs, against a reference of piecewise smooth equations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bywire.core.ops import fabs
from bywire.simulation.run import simulate
from convergence.observed_order import assert_order
from reference.maxwell_slip import maxwell_slip
from systems.maxwell_slip import MaxwellSlip, driven

STEPS = (5e-5, 4e-5, 2.5e-5, 2e-5, 1.25e-5, 1e-5, 5e-6)
STATES = ("x", "v", "z_1", "z_2", "z_3", "z_4")


def test_driven_mass_against_reference() -> None:
    """Some 30 beginnings of slip in every run, anywhere in their substeps."""
    run = driven()
    record = np.arange(51) * 1e-3

    def force(t: float) -> float:
        return float(run.stimulus(np.array([t]))[0, 0])

    exact = maxwell_slip(run.par, force, run.duration, record)
    assert exact[-1, 6] > 0.5  # of slip, in joules
    errors = []
    for step in STEPS:
        result = simulate(replace(run, step=step))
        found = np.column_stack([result[name] for name in (*STATES, "E_slip")])
        errors.append(np.abs(found - exact).mean(axis=0) / np.ptp(exact, axis=0))
    for name, column in zip((*STATES, "E_slip"), np.transpose(errors), strict=True):
        assert_order(STEPS, column, 2.0, f"mean error of {name}")
        assert column[STEPS.index(2e-5)] < 4e-4


@pytest.mark.parametrize("rubs", [False, True])
def test_slip_forces_that_follow_the_load(rubs: bool) -> None:
    """Widths that change with the motion: against the finest step."""
    run = driven(rubs=rubs, loaded=True)
    exact = simulate(replace(run, step=5e-7))
    errors = []
    for step in STEPS:
        result = simulate(replace(run, step=step))
        errors.append([np.abs(result[n] - exact[n]).mean() for n in (*STATES, "E_slip")])
    for name, column in zip((*STATES, "E_slip"), np.transpose(errors), strict=True):
        assert_order(STEPS, column, 2.0, f"mean error of {name}")


class _Nonlinear(MaxwellSlip):
    """Springs that grow stiffer, and friction that follows a spring's force."""

    def springs(self, x: Any, par: Any) -> Any:
        """Return the force of all springs."""
        return super().springs(x, par) + par.k_4 * x.z_4 * (x.z_4 / 2e-4) ** 2 + 0.2 * par.k * x.z_3

    def bounds(self, x: Any, xe: Any, m: Any, par: Any, contact: Any) -> Any:
        """Return bounds that depend on a spring."""
        force = par.F_c + 0.3 * par.k_2 * fabs(xe.z_2)
        return ((-force, force),) if self.rubs else ()


@pytest.mark.parametrize("rubs", [False, True])
def test_nonlinear_equations_of_springs(rubs: bool) -> None:
    run = replace(driven(), model=_Nonlinear(rubs=rubs))
    exact = simulate(replace(run, step=5e-7))
    assert np.abs(exact["z_4"]).max() > 1e-4
    errors = []
    for step in STEPS:
        result = simulate(replace(run, step=step))
        assert result.status == "done"
        errors.append([np.abs(result[n] - exact[n]).mean() for n in (*STATES, "E_slip")])
    for name, column in zip((*STATES, "E_slip"), np.transpose(errors), strict=True):
        assert_order(STEPS, column, 2.0, f"mean error of {name}")
