"""The hand-written C against bywire's own runs: two independent codes of one scheme."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.motorcycle.hand_c import OUTPUTS, HandWritten, indices
from benchmarks.motorcycle.problem import braking_run, hard_braking
from bywire.brakes.motorcycle.ecu import Stimulus
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.catalog import PARAMETER_SETS
from bywire.simulation.compiler import find_compiler
from bywire.simulation.run import simulate

Array = NDArray[np.float64]

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def parameters(changes: Mapping[str, float] | None = None) -> MotorcycleParameters:
    par = PARAMETER_SETS.find("dardanelli2010").parameters().replace(changes or {})
    assert isinstance(par, MotorcycleParameters)
    return par


def levels(*steps: tuple[float, float]) -> object:
    """Return a stimulus of pressure demands [bar] from instants [s] on."""

    def stimulus(t: Array) -> Array:
        rows = np.zeros((t.size, len(Stimulus._fields)))
        for instant, bar in steps:
            rows[t >= instant - 1e-9, Stimulus._fields.index("p_set")] = bar * 1e5
        return rows

    return stimulus


CASES = {
    "hard braking": ({}, hard_braking),
    "bridge that limits the duty cycle": ({"bridge.D_max": 0.3}, hard_braking),
    "sensors at the ends of their ranges": (
        {"pressure_sensor.p_high": 30e5, "current_sensor.i_high": 8.0},
        hard_braking,
    ),
    "finer converter": ({"adc.codes": 1e9}, hard_braking),
    "release": ({}, levels((0.0, 20.0), (0.2, 0.0))),
    "release, nearly without friction": (
        {"master_cylinder.k_damp": 200.0, "seal.T_pr": 1e-5},
        levels((0.0, 20.0), (0.2, 0.0)),
    ),
    "far stop": ({}, levels((0.0, 20.0), (0.1, 80.0), (0.3, 0.0))),
}


@pytest.mark.parametrize("case", CASES)
def test_every_output_agrees(case: str) -> None:
    changes, stimulus = CASES[case]
    run = braking_run(parameters(changes), stimulus, 0.5)  # type: ignore[arg-type]
    ours = simulate(run)
    call = HandWritten(run.par).single(run)  # type: ignore[arg-type]
    assert call() > 0.0
    assert ours.names == OUTPUTS
    assert call.unsettled == 0
    for name in ours.names:
        size = np.abs(ours[name]).max()
        # A reaction of the limit that is zero but for rounding: joules and m^3/s below 1e-12.
        np.testing.assert_allclose(
            call[name][0], ours[name], rtol=0.0, atol=1e-9 * size + 1e-12, err_msg=name
        )


def test_cases_meet_stops_and_limit() -> None:
    """The comparison above is worth something at the stops and at the limit too."""
    seen: dict[str, tuple[float, float, float]] = {}
    for case in ("release, nearly without friction", "far stop"):
        changes, stimulus = CASES[case]
        done = simulate(braking_run(parameters(changes), stimulus, 0.5))  # type: ignore[arg-type]
        seen[case] = (done["F_stop"].min(), done["F_stop"].max(), done["q_makeup"].max())
    assert seen["release, nearly without friction"][0] < -1.0
    assert seen["release, nearly without friction"][2] > 1e-8
    assert seen["far stop"][1] > 100.0


def test_repeats_from_the_start() -> None:
    run = braking_run(parameters(), hard_braking, 0.02)
    call = HandWritten(parameters()).single(run)
    call()
    first = call.values.copy()
    call()
    np.testing.assert_array_equal(call.values, first)


def test_ensemble_equals_single_runs() -> None:
    cases = [parameters({"motor.R_m": R}) for R in (0.3, 0.35, 0.4)]
    run = braking_run(cases[0], hard_braking, 0.02)
    library = HandWritten(cases[0])
    together = library.ensemble(run, cases, ("duty", "p_mc"))
    together()
    for k, par in enumerate(cases):
        alone = HandWritten(par).single(braking_run(par, hard_braking, 0.02))
        alone()
        np.testing.assert_allclose(together["p_mc"][k], alone["p_mc"][0], rtol=1e-12)
        np.testing.assert_allclose(together["duty"][k], alone["duty"][0], rtol=1e-12)


def test_refuses_other_choices() -> None:
    par = parameters().replace({"gear.law": "directional"})
    with pytest.raises(ValueError, match=r"gear\.law = 'directional'"):
        HandWritten(par)


def test_indices_follow_the_model() -> None:
    text = indices(parameters())
    assert text.startswith("enum { P_supply_V_bat, P_supply_R_bat,")
    assert "O_E_piston, O_COUNT };" in text
