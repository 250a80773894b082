"""Stability map of the wedge brake: neutral point, rates, and the closed moment loop."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.analysis.loop import LOOPS
from bywire.analysis.margins import margins
from bywire.brakes.wedge.studies.stability import (
    DEFAULTS,
    brake,
    compute,
    controlled,
    motion,
    neutral,
)
from bywire.core.catalog import parameters

ROUGH = DEFAULTS.replace({"coefficients": 4, "slopes": 3, "mu_B_min": 0.15, "mu_B_max": 0.75})


@pytest.fixture(scope="module")
def found():
    return compute(parameters("roberts2003"), ROUGH, lambda label, share: None)


def test_the_neutral_point_is_where_the_paper_says(found) -> None:
    data = found.data
    np.testing.assert_allclose(data["border_open"], data["tan_alpha"], atol=1e-6)
    unstable = data["mu_B"].values > data["tan_alpha"].values[:, None]
    np.testing.assert_array_equal(data["growth_open"].values > 0.0, unstable)
    np.testing.assert_array_equal(data["frequency_open"].values > 0.0, ~unstable)
    np.testing.assert_array_equal(data["beyond_open"].values > 0.0, unstable)


def test_rates_come_near_the_rigid_closed_form_and_locked_motors_hold(found) -> None:
    fast = found.data["growth_rigid"].values > 5.0
    ratio = found.data["growth_open"].values[fast] / found.data["growth_rigid"].values[fast]
    assert np.abs(ratio - 1.0).max() < 0.1
    assert found.data["growth_locked"].values.max() < -100.0


def test_a_screw_that_loses_the_wedge_hides_no_growth() -> None:
    """The free motor adds an integrator. The other one alone carries less inertia."""
    par = brake(parameters("roberts2003"), 1.2, 0.364)
    assert motion(par, 3e3).growth > 1.1 * motion(par, 300.0).growth > 50.0
    below = motion(brake(parameters("roberts2003"), 0.1, 0.6), 4e3)
    assert below.growth < -0.1
    assert below.frequency > 1.0


def test_damping_of_the_shafts_does_not_move_the_neutral_point() -> None:
    """Damping slows the growth. The pole at zero stays where the stiffness vanishes."""
    par = brake(parameters("roberts2003"), 0.5, 0.4)
    damped = par.replace({"motor_1.D_M": 1e-2, "motor_2.D_M": 1e-2})
    assert motion(damped, 1e3).growth < 0.8 * motion(par, 1e3).growth
    assert neutral(damped, 1e3) == pytest.approx(0.4, abs=1e-6)


def test_the_moment_loop_of_the_map_is_that_of_the_margins(found) -> None:
    par, loop = parameters("roberts2003"), LOOPS.find("moment")
    own = brake(par, 0.55, 0.4)
    disk = found.data["disk_moment"].sel(mu_B=0.55, tan_alpha=0.4, method="nearest")
    assert float(disk) == pytest.approx(margins(loop, own, 200.0).disk, rel=2e-3)
    assert controlled(own.replace({"control.moment.f_c": 200.0}), 200.0).unstable == 1.0
    assert np.isnan(controlled(own, 1e5).unstable)


def test_a_controller_that_knows_the_friction_keeps_its_margin() -> None:
    par = parameters("roberts2003")
    given = controlled(brake(par, 0.35, 0.364), 200.0).disk
    unknown, known = (controlled(brake(par, 0.7, 0.364, k), 200.0).disk for k in (False, True))
    assert unknown < 0.8 * given
    assert known == pytest.approx(given, rel=0.1)


def test_the_border_of_the_moment_loop_is_named(found) -> None:
    (border,) = [one for one in found.kpis if one.name == "moment_mu_B"]
    loop, par = LOOPS.find("moment"), parameters("roberts2003")
    sides = [
        loop.closed(par.replace({"wedge.mu_B": share * border.value}), 200.0).is_stable
        for share in (0.999, 1.001)
    ]
    assert sides == [True, False]
