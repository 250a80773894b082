"""The current PI detects a limit of the duty cycle, both in the ECU and in the bridge."""

from __future__ import annotations

import pytest

import bywire
from bywire.control import current_pi
from run_once import run_once

OPTIONS = {"duration": "0.6 s", "settle": "0.2 s"}


def braking(**overrides: float) -> bywire.BenchResult:
    names = {name.replace("__", "."): value for name, value in overrides.items()}
    return run_once(bywire.Bench("hard-braking", "dardanelli2010", names, OPTIONS))


def test_limit_of_the_bridge_acts_like_that_of_the_ecu() -> None:
    ecu, bridge = braking(ecu__current__D_max=0.3), braking(bridge__D_max=0.3)
    assert ecu.kpi("share_sat_duty").value > 0.1
    for kpi in ecu.kpis:
        assert bridge.kpi(kpi.name).value == pytest.approx(kpi.value, nan_ok=True), kpi.name
    free = braking()
    assert free.kpi("share_sat_duty").value != ecu.kpi("share_sat_duty").value


@pytest.mark.parametrize(("D_max", "D_lim"), [(0.3, 1.0), (1.0, 0.3), (0.3, 0.3)])
def test_integral_part_settles_at_the_smaller_limit(D_max: float, D_lim: float) -> None:
    par = current_pi.Parameters(k_p=5e-3, k_i=10.0, T_t=2e-3, D_max=D_max)
    x = current_pi.State(integral=0.0)
    for _ in range(200):
        x, out = current_pi.output(x, current_pi.Input(5.0, 0.0, D_lim), 1e-3, par)
    assert out.duty == 0.3
    # k_i e + (D_sat - k_p e - I) / T_t = 0
    assert x.integral == pytest.approx(0.3 - 5e-3 * 5.0 + 2e-3 * 10.0 * 5.0, rel=1e-9)
