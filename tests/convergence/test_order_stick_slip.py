"""Second order through stick and slip, and where friction reverses without holding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.simulation import engine, scheme
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import Run, simulate
from bywire.simulation.symbols import SX
from convergence.observed_order import assert_order
from cross.motorcycle_reference import run_reference
from systems import oscillator

STEPS = (50e-6, 40e-6, 25e-6, 20e-6, 12.5e-6, 10e-6, 8e-6, 5e-6)


@pytest.mark.parametrize("law", [pytest.param("paper", marks=pytest.mark.trust), "directional"])
def test_first_jumps_of_the_ramp(law: str) -> None:
    """Five jumps without dither: the mean error in time, and the angle at which each jump ends.

    The current changes at ticks only, so that every jump begins on the grid; where it ends is up
    to the dynamics. Angles at rest are what the error of a whole jump adds up to.
    """
    bench = Bench(
        "motor-open-loop",
        "dardanelli2010",
        overrides={"gear.law": law, "drive.T_source": 5e-3},
        options={"source": "current", "duration": 12.0, "record": 5e-3},
        stimulus={
            "kind": "ramp",
            "start": 0.0,
            "end": 5.0,
            "slope": 0.2,
            "t_start": 0.0,
            "t_hold": 0.0,
            "after": "stay",
        },
    )
    run = as_run(bench.cases()[0], 20e-6)
    reference = run_reference(run, 4e-4)
    assert reference["mode_changes"] == 10
    rests = np.flatnonzero(np.diff(reference["stuck"].astype(int)) == 1) + 1
    errors, after = [], []
    for step in STEPS:
        result = simulate(replace(run, step=step))
        error = np.abs(result["theta"] - reference["theta"])
        errors.append((error.mean(), np.abs(result["p_mc"] - reference["p_mc"]).mean()))
        after.append(error[rests])
    for name, column in zip(("theta", "p_mc"), np.transpose(errors), strict=True):
        assert_order(STEPS, column, 2.0, f"mean error of {name}")
    for jump, column in enumerate(np.transpose(after)):
        assert_order(STEPS, column, 2.0, f"angle after jump {jump + 1}")


def _released(x_0: float, duration: float, record: float) -> Run:
    return Run(
        oscillator.Oscillator(rubs=True),
        oscillator.PARAMETERS,
        oscillator.State(x_0, 0.0),
        oscillator.Memory(0.0),
        lambda t: np.zeros((t.size, 1)),
        duration,
        20e-6,
        record,
    )


def _errors(x_0: float) -> list[float]:
    """Return the mean error of the position at every step; a swing of 10 mm ends at rest.

    Averaged over stiffnesses, because the place of a turn in its substep moves with them.
    """
    run, stiffness = _released(x_0, 0.06, 5e-3), np.linspace(1.9e4, 2.1e4, 32)
    cases = [run.par.replace({"k": float(k)}) for k in stiffness]
    errors = []
    for step in STEPS:
        result = simulate_ensemble(replace(run, step=step), {"k": stiffness}, ["x", "v"])
        exact = [[oscillator.rubbing(t, x_0, case)[0] for t in result.time] for case in cases]
        errors.append(float(np.abs(result["x"] - np.array(exact)).max(axis=1).mean()))
        if x_0 == 0.010:
            assert np.all(result["v"][:, -1] == 0.0)
    return errors


@pytest.mark.parametrize("x_0", [0.010, 0.040])
def test_rubbing_oscillator(x_0: float) -> None:
    """A swing that friction stops within its first half cycle, and one that turns back."""
    errors = _errors(x_0)
    assert_order(STEPS, errors, 2.0, f"release from {x_0} m")
    assert errors[3] < 1e-5 * x_0


def test_friction_of_a_substep_s_end_is_of_first_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rule of old: nothing is cut, and the sign at the end of a substep holds for all of it."""
    monkeypatch.setattr(scheme, "_acting", lambda v, low, high: (low, high))
    monkeypatch.setattr(scheme, "_turn", lambda model, start, end: SX(0))
    monkeypatch.setattr(engine, "_PREPARED", {})
    errors = _errors(0.040)
    assert_order(STEPS, errors, 1.0, "release from 40 mm")
    with pytest.raises(AssertionError, match="observed order"):
        assert_order(STEPS, errors, 2.0, "release from 40 mm")
