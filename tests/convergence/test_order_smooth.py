"""Second order where nothing switches: a closed form, and sliding without a change of sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.simulation.run import Run, simulate
from convergence.observed_order import assert_order
from systems import oscillator

STEPS = (50e-6, 40e-6, 25e-6, 20e-6, 12.5e-6, 10e-6, 5e-6)


def test_oscillator_against_its_closed_form() -> None:
    """No friction, no contact, an integral of a power beside the states."""
    run = Run(
        oscillator.Oscillator(),
        oscillator.PARAMETERS,
        oscillator.START,
        oscillator.Memory(0.0),
        lambda t: np.zeros((t.size, 1)),
        duration=0.05,
    )
    names, errors = ("x", "v", "action"), []
    for step in STEPS:
        result = simulate(replace(run, step=step))
        exact = np.array([oscillator.closed_form(t) for t in result.time])
        computed = np.stack([result[name] for name in names], axis=1)
        errors.append(np.abs(computed - exact).max(axis=0))
    for name, column in zip(names, np.transpose(errors), strict=True):
        assert_order(STEPS, column, 2.0, name)
    assert max(errors[3]) < 1e-3


def _sliding(law: str) -> Run:
    """Return a run that starts in the midst of sliding, from the end of another one."""
    bench = Bench(
        "motor-open-loop",
        "dardanelli2010",
        overrides={"gear.law": law, "drive.T_source": 1e-3},
        options={"source": "voltage", "p_start": 10e5, "add_holding": True, "duration": 0.1},
        stimulus={
            "kind": "ramp",
            "start": 0.5,
            "end": 9.0,
            "slope": 20.0,
            "t_start": 0.0,
            "t_hold": 0.0,
            "after": "stay",
        },
    )
    run = as_run(bench.cases()[0], 1e-6)
    names = run.model.State._fields
    before = simulate(run)
    start = run.model.State(*before.vector[: len(names)])
    assert start.omega > 20.0
    moment = run.duration
    return replace(run, state=start, stimulus=lambda t: run.stimulus(t + moment), duration=0.05)


SIGNALS = (
    "i",
    "theta",
    "omega",
    "p_mc",
    "p_pd",
    "E_source",
    "E_copper",
    "E_gear",
    "E_seal",
    "E_damping",
    "E_pipeline",
    "E_stored",
)


@pytest.mark.parametrize("law", ["paper", "directional"])
def test_sliding(law: str) -> None:
    """States and energies of the brake under a voltage ramp, against a tenth of the finest step."""
    run = _sliding(law)
    exact = simulate(replace(run, step=5e-7))
    assert exact["omega"].min() > 20.0
    errors = []
    for step in STEPS:
        result = simulate(replace(run, step=step))
        errors.append([np.abs(result[name] - exact[name]).max() for name in SIGNALS])
    for name, column in zip(SIGNALS, np.transpose(errors), strict=True):
        assert_order(STEPS, column, 2.0, name)
