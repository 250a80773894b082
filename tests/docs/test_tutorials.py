"""What the tutorials claim about their brake."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import bywire
from systems.loading import loaded

ROOT = Path(__file__).parents[2]
HYDRAULIC = ROOT / "examples" / "hydraulic_brake.py"


def test_the_hydraulic_brake_holds_its_pressure_and_is_as_slow_as_is_said() -> None:
    with loaded(HYDRAULIC):
        _holds_its_pressure()


def _holds_its_pressure() -> None:
    options = {"options.input": "p_set", "options.output": "p_mc", "options.end": "30 bar"}
    result = bywire.run("step", {"parameters": "hydraulic-1", **options})
    kpis = {kpi.name: kpi.value for kpi in result.kpis}
    assert kpis["rise_time"] == pytest.approx(95.1e-3, abs=0.1e-3)
    from hydraulic_brake import HydraulicBrake, Stimulus, held

    # Without dry friction the closed form has to rest: pressure, travel and current at once.
    par = bywire.parameters("hydraulic-1").replace(
        {"seal.F_pr": 0.0, "seal.f_p": 0.0, "seal.f_n": 0.0, "gear.eta": 1.0, "rack.eta": 1.0}
    )
    run = bywire.Run(
        HydraulicBrake(),
        par,
        *held(par, 30e5),
        duration=0.1,
        stimulus=lambda t: np.full((t.size, len(Stimulus._fields)), 30e5),
    )
    assert np.ptp(bywire.simulate(run)["p_mc"]) < 1e-4  # Pa
