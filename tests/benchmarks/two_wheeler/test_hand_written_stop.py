"""The hand-written C of a stop against bywire's own runs: two independent codes of one scheme."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from benchmarks.two_wheeler.hand_stop import SUBJECT, HandWrittenStop
from bywire.bench.experiment import as_run
from bywire.brakes.two_wheeler.case import on_surface, rolling_case
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.catalog import parameters
from bywire.simulation.compiler import find_compiler
from bywire.simulation.run import Run, simulate

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

CASES: dict[str, tuple[dict[str, Any], float, float]] = {
    "to standstill on wet road uphill": (
        {**on_surface("wet-asphalt"), "vehicle.road.gradient": 0.08},
        2.5,
        0.9,
    ),
    "a wheel locks on snow": ({**on_surface("snow"), "ecu.front_slip.slip_set": 0.9}, 6.0, 0.6),
    "the rear wheel lifts": (
        {"ecu.front_lift.a_lim": 20.0, "vehicle.body.h": 0.8, "ecu.front_slip.slip_set": 0.3},
        15.0,
        0.9,
    ),
    "dry road turns wet, and dry again downhill": (
        {
            **on_surface("dry-asphalt", "wet-asphalt"),
            "vehicle.road.x_change": 3.0,
            "vehicle.road.x_back": 8.0,
            "vehicle.road.gradient_further": -0.05,
            "ecu.mix.alpha": 0.8,
        },
        15.0,
        0.9,
    ),
}


def stop(case: str) -> Run:
    changes, v_0, duration = CASES[case]
    par = parameters("sport600")
    assert isinstance(par, TwoWheelerParameters)
    demands = {"p_f_set": 40e5, "p_r_set": 40e5}
    return as_run(rolling_case(par, v_0, demands, duration, changes), 20e-6)


@pytest.mark.parametrize("case", CASES)
def test_every_output_agrees(case: str) -> None:
    run = stop(case)
    ours = simulate(run)
    call = HandWrittenStop(run.par).single(run)  # type: ignore[arg-type]
    assert call() > 0.0
    assert ours.names == SUBJECT.outputs
    assert call.unsettled == ours.unsettled == 0
    assert call.extra == ours.repeated
    for name in ours.names:
        size = np.abs(ours[name]).max()
        np.testing.assert_allclose(
            call[name][0], ours[name], rtol=0.0, atol=1e-9 * size + 1e-12, err_msg=name
        )


def test_cases_meet_what_is_rare() -> None:
    """The comparison is worth something where wheels stand, tires slide, and one lifts."""
    standing, locked, lifted, _ = (simulate(stop(case)) for case in CASES)
    assert abs(standing["v"][-1]) < 0.1
    assert standing.repeated > 3
    assert standing["t_locked_r"][-1] > 0.01
    assert locked["sliding_f"].max() == 1.0
    assert locked["t_locked_f"][-1] > 0.1
    assert lifted["phi"][-1] > 0.01


def test_refuses_other_choices() -> None:
    par = parameters("sport600").replace({"ecu.abs": "rules"})
    with pytest.raises(ValueError, match=r"ecu\.abs = 'rules'"):
        HandWrittenStop(par)  # type: ignore[arg-type]
