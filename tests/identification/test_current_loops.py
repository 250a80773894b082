"""Winding and current controllers of both brakes: values put in come back from steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

from bywire.brakes.motorcycle.methods import current_loop, motor_winding
from bywire.brakes.wedge.methods import drive_current_loop
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError
from bywire.identification.electrics import levels, noise_of_levels
from bywire.identification.measured import joined
from bywire.identification.method import Effort, Identified, Method

Array = NDArray[np.float64]

MOTORCYCLE, WEDGE = parameters("dardanelli2010"), parameters("roberts2003")
WINDING, LOOP, DRIVE = motor_winding.METHOD, current_loop.METHOD, drive_current_loop.METHOD
CASES = {
    "stuck rotor": (WINDING, MOTORCYCLE, {}, ("motor.R_m", "motor.L_m")),
    "turning rotor": (
        WINDING,
        MOTORCYCLE,
        {"rotor": "turning"},
        ("motor.R_m", "motor.L_m", "motor.K_e"),
    ),
    "motorcycle": (LOOP, MOTORCYCLE, {}, ("ecu.current.k_p", "ecu.current.k_i")),
    "wedge": (DRIVE, WEDGE, {}, ("drive.k_p", "drive.k_i")),
}


def off(par: object, names: tuple[str, ...], by: float = 1.3) -> object:
    return par.replace({name: by * par.leaves()[name] for name in names})  # type: ignore[attr-defined]


@pytest.mark.parametrize("count", [4, pytest.param(20, marks=pytest.mark.trust)])
@pytest.mark.parametrize("case", CASES)
def test_what_is_put_in_comes_back(case: str, count: int) -> None:
    method, par, changes, names = CASES[case]
    options, wanted = method.defaults.replace(changes), par.leaves()
    z, known = [], off(par, names)
    for seed in range(1, count + 1):
        found = method.identify(method.synthetic(par, options, seed), known, options, Effort())
        (estimate,) = found.estimates.values()
        assert set(estimate.names) == set(names)
        truth = np.array([wanted[name] for name in estimate.names])
        z.append((estimate.values - truth) / estimate.deviations)
        assert all(check.holds for check in found.checks)
        assert found.parameters.keys() == set(names)
    error = np.array(z)
    assert np.abs(error).max() < 4.0
    assert 0.4 < np.mean(error**2) < 2.0
    assert np.all(np.abs(error.mean(axis=0)) < 3.0 / math.sqrt(count))


@pytest.fixture(scope="module")
def winding() -> xr.Dataset:
    return WINDING.synthetic(MOTORCYCLE, WINDING.defaults, 1)


def test_a_shaft_that_stands_tells_nothing_of_k_e(winding: xr.Dataset) -> None:
    found = WINDING.identify(winding, MOTORCYCLE, WINDING.defaults, Effort())
    assert any("K_e" in note for note in found.notes)


def test_two_records_tell_more_than_one(winding: xr.Dataset) -> None:
    other = WINDING.synthetic(MOTORCYCLE, WINDING.defaults, 2)
    one, both = (
        WINDING.identify(data, MOTORCYCLE, WINDING.defaults, Effort()).estimates["winding"]
        for data in (winding, joined({"first": winding, "second": other}))
    )
    ratio = both.deviations / one.deviations
    np.testing.assert_allclose(ratio, math.sqrt(0.5), rtol=0.05)


@pytest.mark.parametrize(
    ("case", "wrong"),
    [
        ("stuck rotor", {"anti_alias.f_aa": 120.0}),
        ("motorcycle", {"anti_alias.f_aa": 120.0}),
        ("wedge", {"drive.f_sense": 2e3}),
    ],
)
def test_a_wrong_model_is_found_out(case: str, wrong: dict[str, float]) -> None:
    method, par, changes, _ = CASES[case]
    options = method.defaults.replace(changes)
    data = method.synthetic(par, options, 1)
    found = method.identify(data, par.replace(wrong), options, Effort())
    assert not all(check.holds for check in found.checks)


@pytest.mark.parametrize(
    ("case", "current", "mean"),
    [("stuck rotor", "i", 1.0), ("motorcycle", "i", 0.0), ("wedge", "i_1", 0.0)],
)
def test_a_current_that_is_not_of_this_demand_fails(case: str, current: str, mean: float) -> None:
    method, par, changes, _ = CASES[case]
    options = method.defaults.replace(changes)
    data = method.synthetic(par, options, 1)
    noise = np.random.default_rng(5).normal(mean, 1.0, data.sizes["time"])
    found = method.identify(data.assign({current: ("time", noise)}), par, options, Effort())
    failed = {check.name: check.value for check in found.checks if not check.holds}
    assert failed["variance_explained"] < 0.1
    (estimate,) = found.estimates.values()
    vague = estimate.vague()
    assert failed.get("parameters_without_meaning", 0.0) == len(vague)
    assert vague.keys() | {k.unknown.label for k in estimate.kept}
    assert not found.parameters.keys() & vague.keys()


@pytest.mark.parametrize("case", ["motorcycle", "wedge"])
def test_gains_and_winding_together_are_told_but_for_their_scale(case: str) -> None:
    method, par, _, gains = CASES[case]
    options = method.defaults.replace({"unknowns": "all"})
    data = method.synthetic(par, options, 1)
    (found,) = method.identify(data, par, options, Effort()).estimates.values()
    assert found.kept
    everything = dict(zip(found.names, found.values, strict=True))
    everything |= {k.unknown.name: k.unknown.start for k in found.kept}
    R = next(v for k, v in everything.items() if k.startswith("motor") and ".R" in k)
    wanted = par.leaves()
    R_true = next(v for k, v in wanted.items() if k in ("motor.R_m", "motor_1.R_ref"))
    assert everything[gains[1]] / R == pytest.approx(wanted[gains[1]] / R_true, rel=5e-3)


@pytest.mark.parametrize(
    ("method", "signal"), [(WINDING, "v"), (LOOP, "i_set"), (DRIVE, "i_1_set")]
)
def test_a_demand_at_rest_is_refused(method: Method, signal: str) -> None:
    par = WEDGE if method is DRIVE else MOTORCYCLE
    data = method.synthetic(par, method.defaults, 1)
    still = data.assign({signal: ("time", np.full(data.sizes["time"], 1.0))})
    with pytest.raises(ParameterError, match=f"{signal} of record 1 does not change"):
        method.identify(still, par, method.defaults, Effort())


def test_a_current_of_the_wrong_sign_is_refused(winding: xr.Dataset) -> None:
    data = winding.assign(i=-winding["i"])
    with pytest.raises(ParameterError, match=r"i of record 1 moves against v .* sign = -1"):
        WINDING.identify(data, MOTORCYCLE, WINDING.defaults, Effort())


def test_curves_lie_on_the_measurement(winding: xr.Dataset) -> None:
    found: Identified = WINDING.identify(winding, MOTORCYCLE, WINDING.defaults, Effort())
    curve = found.curves[0].data
    error = (curve["modeled"] - curve["measured"]).values[100:]
    assert float(np.sqrt(np.mean(error**2))) == pytest.approx(1e-2, rel=0.05)


def test_noise_is_measured_while_the_demand_rests() -> None:
    step = levels(-5.0, 5.0, 2.0, 0.02, 1e-3, seed=1)
    t = np.arange(2000) * 1e-3
    noise = np.random.default_rng(1).normal(0.0, 0.01, t.size)
    assert noise_of_levels(step(t) + noise, step(t)) == pytest.approx(0.01, rel=0.1)
    assert np.unique(step(t)).size == 100
