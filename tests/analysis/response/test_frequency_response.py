"""Sine sweeps through the nonlinear sampled loop: against linear models and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

from bywire.analysis.linear.sampled_loops import closed_loop
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.sweep import Sweep, response_data
from bywire.brakes.wedge.model import WedgeBrake, memory_at, state_at
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.simulation.run import Run

Array = NDArray[np.float64]

FRICTIONLESS = {
    "bearing.C_0": 0.0,
    "bearing.C_2": 0.0,
    "bearing.T_nu": 0.0,
    "screw.eta_f": 1.0,
    "screw.eta_b": 1.0,
    "wedge_friction.mu_int": 0.0,
    "wedge_friction.mu_R": 0.0,
    "flywheel.runout": 0.0,
    "motor_1.T_cog": 0.0,
    "motor_2.T_cog": 0.0,
}
# With and without friction: one structure, and so one kernel.
STRUCTURE = {"command.mode": "position", "flywheel.law": "driven", "encoder.law": "ideal"}
SWEEP = Sweep(("theta_2_set",), "theta_2", (1.0, 10.0, 60.0, 150.0), (1e-3,), tolerance=1e-4)


def positioned(**changes: float | str) -> Run:
    """Return the assembled brake, parked, in position control."""
    found = parameters("roberts2003").replace({**STRUCTURE, **changes})
    assert isinstance(found, WedgeParameters)
    memory = memory_at(0.0, found)
    mean = WedgeBrake.Stimulus._field_defaults | {
        "theta_1_set": memory.theta_1_ref,
        "theta_2_set": memory.theta_2_ref,
    }

    def stimulus(t: Array) -> Array:
        row = [mean.get(name, 0.0) for name in WedgeBrake.Stimulus._fields]
        return np.repeat([row], t.size, axis=0)

    return Run(WedgeBrake(), found, state_at(0.0, found), memory, stimulus, 1.0, 20e-6, 1e-3)


def deviation(run: Run, sweep: Sweep = SWEEP) -> tuple[Array, Array]:
    """Return how far the measured response is from the linear model, in dB and degree."""
    found = frequency_response(run, sweep)
    assert found["settled"].values.all()
    assert not found["unsettled_substeps"].values.any()
    stimulus = WedgeBrake.Stimulus(*run.stimulus(np.zeros(1))[0])
    loop = closed_loop(
        run.model,
        run.par,
        run.state,
        run.memory,
        inputs=sweep.inputs,
        outputs=(sweep.output,),  # type: ignore[arg-type]
        stimulus=stimulus,
    )
    exact = loop.response(found["frequency"].values)[:, 0, 0]
    measured = response_data(found).frdata[0, 0]
    ratio = measured / exact
    return np.abs(20.0 * np.log10(np.abs(ratio))), np.abs(np.degrees(np.angle(ratio)))


def test_nonlinear_response_without_friction_is_the_linear_one() -> None:
    gain, phase = deviation(positioned(**FRICTIONLESS))
    assert gain.max() < 2e-4
    assert phase.max() < 2e-3


def test_deviation_falls_with_the_square_of_the_step() -> None:
    run = positioned(**FRICTIONLESS)
    sweep = replace(SWEEP, frequencies=(150.0,), tolerance=1e-8)
    coarse, fine = (deviation(replace(run, step=h), sweep)[1][0] for h in (40e-6, 20e-6))
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


def test_friction_shows_at_small_amplitudes() -> None:
    sweep = replace(SWEEP, frequencies=(20.0,), amplitudes=(0.5, 0.05))
    found = frequency_response(positioned(), sweep)
    large, small = found["gain"].values[0, :, 0]
    assert small < 0.9 * large
    shares = found["share_stuck"].values[0, :, 0]
    assert shares[1] >= shares[0]


def test_what_sticks_has_no_gain() -> None:
    found = frequency_response(
        positioned(**{"bearing.C_0": 5.0}), replace(SWEEP, frequencies=(5.0,))
    )
    assert np.isnan(found["gain"].values).all()
    assert found["share_stuck"].values == pytest.approx(1.0)


def test_variants_and_amplitudes_are_those_of_single_sweeps() -> None:
    run = positioned()
    both = frequency_response(
        run,
        replace(
            SWEEP,
            frequencies=(10.0,),
            amplitudes=(0.2, 0.5),
            variations={"control.position.f_n": [12.0, 60.0]},
        ),
    )
    assert both["control.position.f_n"].values.tolist() == [12.0, 60.0]
    for k, f_n in enumerate((12.0, 60.0)):
        own = replace(run, par=run.par.replace({"control.position.f_n": f_n}))
        for j, size in enumerate((0.2, 0.5)):
            alone = frequency_response(own, replace(SWEEP, frequencies=(10.0,), amplitudes=(size,)))
            # Lanes wait for the slowest of their group, and are settled the better for it.
            for name, share in (("gain", 1e-3), ("phase", 1e-3), ("distortion", 0.02)):
                one: xr.DataArray = alone[name]
                assert both[name].values[k, j, 0] == pytest.approx(one.values[0, 0, 0], rel=share)


def test_one_after_another_gives_what_lanes_give() -> None:
    sweep = replace(SWEEP, frequencies=(10.0, 40.0), amplitudes=(0.2,))
    together, apart = (frequency_response(positioned(), sweep, lanes=one) for one in (True, False))
    for name, share in (("gain", 1e-5), ("phase", 1e-5), ("coherence", 1e-5)):
        np.testing.assert_allclose(together[name], apart[name], rtol=share)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"frequencies": (3e3,)}, "Nyquist"),
        ({"frequencies": (0.0,)}, "positive"),
        ({"amplitudes": ()}, "positive"),
    ],
)
def test_bad_sweeps(changes: dict[str, tuple[float, ...]], text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        frequency_response(positioned(), replace(SWEEP, **changes))  # type: ignore[arg-type]


def test_unknown_signal() -> None:
    with pytest.raises(UnknownNameError, match="theta_2_set"):
        frequency_response(positioned(), replace(SWEEP, inputs=("theta2_set",)))
