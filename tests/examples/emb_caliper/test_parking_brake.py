"""The caliper as a parking brake: it holds exactly, follows the disc, and releases."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bywire as toolkit
from bywire.core.errors import ParameterError
from bywire.plant import floating_caliper, lead_screw
from bywire.simulation.run import Run, simulate
from raising import raises

NAMES = ("parking-screw", "parking-pawl")


@pytest.fixture(scope="module")
def runs(caliper: Path) -> dict[str, Any]:
    """Return a run of each brake on a hot disc."""
    return {
        name: toolkit.run(toolkit.Bench("park-hot", name, {}, {"hold": 400.0})) for name in NAMES
    }


def figures(result: Any) -> dict[str, float]:
    return {each.name: each.value for each in result.kpis}


def held(par: Any, F: float, duration: float, step: float) -> Any:
    """Return a run that holds a clamp force [N] without current on a cold disc."""
    from emb_caliper.models import parking

    n = np.linspace(0.0, par.caliper.n_max, 100_001)
    overlap = float(np.interp(F, floating_caliper.elastic(n, par.caliper), n))
    slope = lead_screw.slope(par.screw) / parking.planetary_gear.ratio(par.gear)
    theta = (par.caliper.clearance + overlap) / slope
    state, memory = parking.released(par, par.disc.T_a)
    state = state._replace(theta=theta)
    memory = memory._replace(mode=parking.parking.HOLDS)
    return simulate(
        Run(
            parking.ParkingBrake(),
            par,
            state,
            memory,
            lambda t: np.ones((t.size, 1)),
            duration,
            step,
            record=1.0,
        )
    )


def test_a_self_locking_screw_holds_for_an_hour_exactly(caliper: Path) -> None:
    from emb_caliper.sets.parking import SCREW

    par = SCREW.parameters().replace({"parking.again": 0.0})
    run = held(par, 20e3, 3600.0, 2.5e-4)
    assert run["F_cl"][0] == pytest.approx(20e3, rel=1e-6)
    assert run["mode"][-1] == 2.0
    assert np.ptp(run["travel"]) == 0.0
    assert np.ptp(run["theta"]) == 0.0
    assert np.ptp(run["F_cl"]) == 0.0
    assert np.all(run["stuck"] == 1.0)


def test_a_ball_screw_does_not_hold(caliper: Path) -> None:
    from emb_caliper.sets.parking import PAWL

    free = PAWL.parameters().replace({"pawl.k": 1e-6, "parking.again": 0.0})
    assert held(free, 20e3, 2.0, 2.5e-5)["F_cl"][-1] < 5e3


@pytest.mark.parametrize(("name", "again"), [("parking-screw", 1), ("parking-pawl", 0)])
def test_it_clamps_again_while_the_disc_cools_and_releases(
    runs: Any, name: str, again: int
) -> None:
    found = figures(runs[name])
    assert found["first_force"] > 20e3
    assert found["least_force"] > 17.5e3
    assert found["clamped_again"] == again  # the pawl's brake turns further after the motor ends
    assert found["creep"] < 1e-12
    assert found["residual_force"] == 0.0
    assert runs[name].warnings == []


def test_a_cooling_disc_relaxes_the_force(caliper: Path, runs: Any) -> None:
    """The force falls by k alpha l dT while the piston is at rest."""
    run = runs["parking-screw"].recordings["run"]
    first = int(np.argmax(run["mode"].values == 2.0)) + 50
    last = first + 7500
    F, T, x = (run[name].values[[first, last]] for name in ("F_cl", "T_disc", "travel"))
    from emb_caliper.sets.parking import SCREW

    par = SCREW.parameters()
    assert x[0] == x[1]
    grown = par.disc.alpha * par.disc.length * (T[0] - T[1])
    n = x[0] + par.disc.alpha * par.disc.length * (T.mean() - par.disc.T_a) - par.caliper.clearance
    assert F[0] - F[1] == pytest.approx(
        float(floating_caliper.stiffness(n, par.caliper)) * grown, rel=1e-3
    )


def test_a_pawl_holds_within_a_tooth(runs: Any) -> None:
    run = runs["parking-pawl"].recordings["run"]
    first = int(np.argmax(run["mode"].values == 2.0))
    theta = run["theta"].values[first : first + 1000]
    assert 0.0 <= theta.max() - theta[-1] < 2 * np.pi / 24
    assert np.ptp(theta[250:]) == 0.0
    assert run["T_pawl"].values[first + 250] > 0.1


@pytest.mark.parametrize(
    ("name", "changes", "field", "valid"),
    [
        ("parking-screw", {"screw.mu": 0.5}, "screw.mu", "smaller"),
        ("parking-screw", {"screw.mu": 0.01}, "pawl.law", "mono-stable"),
        ("parking-pawl", {"parking.lock": "screw"}, "parking.lock", "mono-stable"),
    ],
)
def test_a_brake_that_cannot_release_or_hold_is_rejected(
    caliper: Path, name: str, changes: dict[str, Any], field: str, valid: str
) -> None:
    with raises(ParameterError, name=field, valid=valid):
        toolkit.run(toolkit.Bench("park-hot", name, changes))


def test_torques_of_the_specified_screw(caliper: Path) -> None:
    from emb_caliper.sets.parking import SCREW

    par = SCREW.parameters().screw
    assert lead_screw.apply_torque(20e3, par) == pytest.approx(18.94, rel=1e-3)
    assert lead_screw.release_torque(20e3, par) == pytest.approx(6.01, rel=1e-3)


def test_a_weak_solenoid_leaves_the_brake_locked(caliper: Path) -> None:
    changes = {"pawl.F_sol": 2.9}  # less than the spring
    result = toolkit.run(toolkit.Bench("park-hot", "parking-pawl", changes, {"hold": 2.0}))
    run = result.recordings["run"]
    assert figures(result)["residual_force"] > 20e3
    assert run["mode"].values[-1] == 3.0
    assert result.warnings == []
    assert run["i"].values[-1] == pytest.approx(0.0, abs=1e-6)  # the motor stops trying
