"""Methods for the wedge brake's drive train recover given parameters and find errors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError
from bywire.identification.measured import joined, split
from bywire.identification.method import Effort, Identified, Method
from bywire.identification.question import find_method
from bywire.identification.trust import trust
from raising import raises

Change = Callable[[xr.Dataset], xr.Dataset]
NAMES = ("cogging", "force-calibration", "run-down", "screw-efficiency", "stiffness")
EFFORT = Effort(starts=1)


@pytest.fixture(scope="module")
def par() -> WedgeParameters:
    found = parameters("roberts2003")
    assert isinstance(found, WedgeParameters)
    return found


@pytest.fixture(scope="module")
def measured(par: WedgeParameters) -> Callable[[str], xr.Dataset]:
    known: dict[str, xr.Dataset] = {}

    def of(name: str) -> xr.Dataset:
        if name not in known:
            method = find_method(name)
            known[name] = method.synthetic(par, method.defaults, 5)
        return known[name]

    return of


def identified(name: str, data: xr.Dataset, par: WedgeParameters) -> Identified:
    method: Method = find_method(name)
    return method.identify(data, par, method.defaults, EFFORT)


def failed(found: Identified) -> list[str]:
    return [check.name for check in found.checks if not check.holds]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("count", [2, pytest.param(10, marks=pytest.mark.trust)])
def test_what_is_put_in_comes_back(name: str, count: int, par: WedgeParameters) -> None:
    """From starts off the truth."""
    method = find_method(name)
    study = trust(method, par, method.defaults, range(1, count + 1), EFFORT)
    assert not study.failed
    assert {r.label for r in study.recovered} >= set(method.unknowns)
    for one in study.recovered:
        error = one.claimed / np.sqrt(one.count)
        assert abs(one.bias) < 4.0 * error, one
        assert one.coverage_range[1] >= 0.9, one


@pytest.mark.parametrize("name", NAMES)
def test_curves_lie_on_what_was_measured(
    name: str, par: WedgeParameters, measured: Callable[[str], xr.Dataset]
) -> None:
    found = identified(name, measured(name), par)
    assert not failed(found)
    for curve in found.curves:
        gap = (curve.data["measured"] - curve.data["modeled"]).values
        size = np.nanmax(np.abs(curve.data["measured"].values))
        assert np.isfinite(gap).any()
        assert np.nanstd(gap) < 0.05 * size


@pytest.mark.parametrize(
    ("name", "change", "check"),
    [
        ("screw-efficiency", {"screw.law": "drive"}, "torque_left_over"),
        ("run-down", {"bearing.k_nu": 2.0}, "torque_left_over"),
    ],
)
def test_another_law_is_found_out(
    name: str, change: dict[str, object], check: str, par: WedgeParameters
) -> None:
    method = find_method(name)
    data = method.synthetic(par.replace(change), method.defaults, 5)
    assert check in failed(identified(name, data, par))


def test_a_wrong_torque_constant_is_found_out(
    par: WedgeParameters, measured: Callable[[str], xr.Dataset]
) -> None:
    """The current's torque sets another scale than the added inertia then, 10 % apart."""
    found = identified("run-down", measured("run-down"), par.replace({"motor_1.K_ref": 0.11}))
    assert "inertias_agree" in failed(found)
    by_added, by_current = (
        found.figures[f"inertia_by_{k}"][0] for k in ("added_inertia", "current")
    )
    J = par.rig.J_dummy
    assert (by_current + J) / (by_added + J) == pytest.approx(1.1, abs=0.02)


def test_a_force_sensor_that_bends_is_found_out(
    par: WedgeParameters, measured: Callable[[str], xr.Dataset]
) -> None:
    data = measured("force-calibration")
    bent = data.assign(y_F=data["y_F"] * (1.0 + 1e-5 * data["y_F"]))
    assert failed(identified("force-calibration", bent, par)) == ["current_left_over"]


def test_a_progressive_contact_is_found_out(
    par: WedgeParameters, measured: Callable[[str], xr.Dataset]
) -> None:
    records = split(measured("stiffness"))
    heart = records["heart"]
    closer = np.maximum(heart["q_1"] - heart["q_2"], 0.0)
    more = 3.0 * closer**2
    stiffer = heart.assign(i_1=heart["i_1"] + more, i_2=heart["i_2"] - more)
    found = identified("stiffness", joined({**records, "heart": stiffer}), par)
    assert failed(found) == ["left_over"]


def test_friction_that_depends_on_the_angle_is_no_cogging(
    par: WedgeParameters, measured: Callable[[str], xr.Dataset]
) -> None:
    data = measured("cogging")
    way = np.sign(np.gradient(data["q_1"].values))
    rough = data.assign(i_1=data["i_1"] + 0.02 * way * np.cos(180.0 * data["q_1"]))
    assert failed(identified("cogging", rough, par)) == ["slope_beyond_law"]


def test_a_second_order_is_found_with_its_phase(
    par: WedgeParameters, measured: Callable[[str], xr.Dataset]
) -> None:
    data = measured("cogging")
    both = data.assign(i_1=data["i_1"] + 0.05 * np.sin(24.0 * data["q_1"] + 0.3))
    found = identified("cogging", both, par)
    assert found.figures["order"] == (180.0, "1")
    assert found.figures["order_2"] == (24.0, "1")
    estimate = found.estimates["cogging and friction"]
    assert estimate["amplitude.24"] == pytest.approx(5e-3, rel=0.05)
    assert estimate["phase.24"] == pytest.approx(0.3, abs=0.05)
    assert found.parameters["motor_1.T_cog"] == pytest.approx(0.01, rel=0.03)


def test_a_run_down_alone_tells_ratios_only(
    par: WedgeParameters, measured: Callable[[str], xr.Dataset]
) -> None:
    """Twice the given inertia doubles the torques, keeps the ratios and gives no parameters."""
    free = split(measured("run-down"))["free"]
    once = identified("run-down", free, par)
    J = par.motor_1.J_M + par.rig.J_dummy
    twice = identified(
        "run-down",
        free,
        par.replace(
            {
                "motor_1.J_M": 2.0 * J - par.rig.J_dummy,
                "motor_1.K_ref": 0.2,
                "motor_1.D_M": 2.0 * par.motor_1.D_M,
            }
        ),
    )
    for found in (once, twice):
        assert not found.parameters
        assert "J_added" in found.notes[0]
    assert once.figures.keys() == twice.figures.keys()
    for name, (value, _) in once.figures.items():
        assert twice.figures[name][0] == pytest.approx(value, rel=1e-4), name
    friction = 2.0 * once.estimates["friction at the given inertia"]["bearing.C_0"]
    assert twice.estimates["friction at the given inertia"]["bearing.C_0"] == pytest.approx(
        friction, rel=1e-4
    )


@pytest.mark.parametrize("other", ["added", "braked"])
def test_one_known_thing_beside_it_sets_the_scale(
    other: str, par: WedgeParameters, measured: Callable[[str], xr.Dataset]
) -> None:
    records = split(measured("run-down"))
    found = identified("run-down", joined({k: records[k] for k in ("free", other)}), par)
    assert found.parameters["motor_1.J_M"] == pytest.approx(par.motor_1.J_M, rel=0.02)


def cut(end: int, begin: int = 0) -> Change:
    return lambda data: data.isel(time=slice(begin, end))


def only(record: str) -> Change:
    return lambda data: split(data)[record]


@pytest.mark.parametrize(
    ("name", "change", "wrong"),
    [
        ("screw-efficiency", cut(750), "screw.eta_f"),
        ("screw-efficiency", cut(100), "q_1"),
        ("run-down", lambda d: cut(2400, 1500)(split(d)["free"]), "record run"),
        ("cogging", cut(12000), "q_1"),
        ("force-calibration", cut(700), "the record"),
        ("stiffness", only("sensor"), "record sensor"),
    ],
)
def test_too_little_is_refused(
    name: str,
    change: Change,
    wrong: str,
    par: WedgeParameters,
    measured: Callable[[str], xr.Dataset],
) -> None:
    with raises(ParameterError, name=wrong):
        identified(name, change(measured(name)), par)


def test_a_heart_that_is_only_squeezed_has_no_free_play(
    par: WedgeParameters, measured: Callable[[str], xr.Dataset]
) -> None:
    records = split(measured("stiffness"))
    squeezed = {**records, "heart": records["heart"].isel(time=slice(0, 1700))}
    with raises(ParameterError, name="record heart"):
        identified("stiffness", joined(squeezed), par)


def test_a_motor_without_cogging_is_said_to_have_none(par: WedgeParameters) -> None:
    method = find_method("cogging")
    data = method.synthetic(par.replace({"motor_1.T_cog": 0.0}), method.defaults, 5)
    with raises(ParameterError, name="options.highest", value="400"):
        identified("cogging", data, par)


def test_orders_beyond_the_low_pass_are_refused(
    par: WedgeParameters, measured: Callable[[str], xr.Dataset]
) -> None:
    method = find_method("cogging")
    options = method.defaults.replace({"cutoff": 10.0})
    with raises(ParameterError, name="options.highest", value="400", valid="<= 125"):
        method.identify(measured("cogging"), par, options, EFFORT)
