"""The wedge brake at rest, against closed forms."""

from __future__ import annotations

import pytest
from wedge_runs import FRICTIONLESS, TAN_ALPHA, brake, drive

MU = (0.2, 0.35, TAN_ALPHA, 0.5, 0.6)


@pytest.mark.parametrize("mu_B", MU)
def test_actuation_force_without_friction(mu_B):
    """Motors push below tan(alpha), pull above and rest at the neutral point, always stably."""
    run = drive(brake(FRICTIONLESS, mu_B), 0.8, M_set=lambda t: 950.0 + 0.0 * t)
    F_N = run["F_N"][-1]
    assert 2.0 * mu_B * F_N * 0.125 == pytest.approx(950.0, abs=0.01)
    assert run["F_M"][-1] == pytest.approx((TAN_ALPHA - mu_B) * F_N, abs=0.1)


def test_950_Nm():
    run = drive(brake(FRICTIONLESS), 0.8, M_set=lambda t: 950.0 + 0.0 * t)
    assert run["F_N"][-1] == pytest.approx(10.86e3, abs=5.0)
    assert run["U_caliper"][-1] == pytest.approx(1.96, abs=0.005)
    angle = 0.5 * (run["theta_1"][-1] + run["theta_2"][-1])
    assert angle == pytest.approx(4.85, abs=0.02)
