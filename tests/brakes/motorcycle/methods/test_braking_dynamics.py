"""Transfer function (22) from steps and sines: known parameters are found, gaps are reported."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import control
import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

from bywire.brakes.motorcycle.dither import dithered_plant
from bywire.brakes.motorcycle.linear import with_slow_pair
from bywire.brakes.motorcycle.methods.braking_dynamics import METHOD, pair_shows, truth
from bywire.brakes.motorcycle.methods.region_fit import (
    NAMES,
    REGIONS,
    block_of,
    fit,
    five_of,
    lines,
    log_response,
    measured_points,
    regions_of,
    response,
    step_at,
)
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError
from bywire.identification.estimate import Estimate
from bywire.identification.measured import joined, split
from bywire.identification.method import Effort, Identified
from raising import raises

Array = NDArray[np.float64]

PAR = parameters("dardanelli2010")
EQ22 = METHOD.defaults.replace({"plant": "eq-22"})
VALUES = np.array([1.02e6, 1.66, 0.127, 0.0223, 1.53])
SEEDS = range(1, 3)


@pytest.fixture(scope="module")
def data() -> dict[int, xr.Dataset]:
    return {seed: METHOD.synthetic(PAR, EQ22, seed) for seed in SEEDS}


@pytest.fixture(scope="module")
def every(data: dict[int, xr.Dataset]) -> dict[int, Identified]:
    """The result of each record."""
    return {seed: identified(record) for seed, record in data.items()}


def identified(record: xr.Dataset, **changes: object) -> Identified:
    return METHOD.identify(record, PAR, EQ22.replace(changes), Effort())


def test_response_equals_python_control_and_its_derivatives_differences() -> None:
    t = np.arange(3000) * 1e-3
    u = np.where(t < 1.0, 0.0, 0.35) + 0.1 * np.sin(2.0 * math.pi * 3.0 * t)
    y, J = response(VALUES, u, 1e-3, 20)
    system = with_slow_pair(*VALUES).transfer_function()
    wanted = control.forced_response(system, t, u).outputs
    np.testing.assert_allclose(y, wanted[::20], atol=1e-7 * np.ptp(wanted))
    f = np.array([0.3, 2.0, 15.0])
    G, slopes = log_response(VALUES, f)
    np.testing.assert_allclose(np.exp(G), with_slow_pair(*VALUES).response(f), rtol=1e-12)
    for k in range(5):
        difference = slope(lambda values: response(values, u, 1e-3, 20)[0], k)
        assert np.abs(J[:, k] - difference).max() < 1e-8 * np.abs(difference).max()
        difference = slope(lambda values: log_response(values, f)[0], k)
        np.testing.assert_allclose(slopes[:, k], difference, rtol=1e-8)


def slope(function: Callable[[Any], Any], k: int) -> Any:
    """Return a derivative by differences of fourth order, with a step far above rounding errors."""
    by = np.zeros(5)
    by[k] = 1e-3 * VALUES[k]
    near, far = (function(VALUES + n * by) - function(VALUES - n * by) for n in (1, 2))
    return (8.0 * near - far) / (12.0 * by[k])


def test_lines_beside_a_dither_30_times_their_size() -> None:
    t = np.arange(4000) * 1e-3
    w = 2.0 * math.pi * np.array([1.234, 7.89])
    dither = 3.0 * np.sin(2.0 * math.pi * 50.0 * t)
    u = 0.1 * np.sin(w[0] * t) + 0.07 * np.cos(w[1] * t) + dither
    y = 0.2 * np.sin(w[0] * t - 1.0) + 0.007 * np.cos(w[1] * t - 2.0) + 0.1 * dither + 5.0
    found = lines(u, 1e-3, 1.0, 15.0, (50.0,))
    np.testing.assert_allclose(found, [1.234, 7.89], rtol=1e-6)
    points = measured_points(u, y, 1e-3, found, (50.0,))
    np.testing.assert_allclose(
        np.exp(points.log_gain), [2.0 * np.exp(-1j), 0.1 * np.exp(-2j)], rtol=1e-5
    )


def test_steps_are_told_from_sines() -> None:
    t = np.linspace(0.0, 1.0, 200)
    assert step_at(np.where(t < 0.3, 1.0, 2.0)) == 60
    # The sine that two levels explain best is half a period long.
    assert step_at(np.cos(math.pi * t)) is None
    assert step_at(np.ones(50)) is None
    assert block_of(1e-3, 50.0) == 20
    assert block_of(1e-3, 40.0) == 25
    assert block_of(1e-3, 30.0) == 100
    with raises(ParameterError, name="sample time", value="0.001 s"):
        block_of(1e-3, 49.7)


def deviations(estimates: Iterable[Iterable[Estimate]]) -> Array:
    """Return errors divided by estimated standard deviations, shape (seeds, 15)."""
    wanted, rows = truth(PAR, EQ22), []
    for regions in estimates:
        found: dict[str, float] = {}
        for estimate in regions:
            error = dict(zip(estimate.names, estimate.values, strict=True))
            size = dict(zip(estimate.names, estimate.deviations, strict=True))
            found |= {k: (error[k] - wanted[k]) / size[k] for k in error if k in wanted}
        rows.append([found[k] for k in wanted])
    return np.array(rows)


def test_what_is_put_in_comes_back(every: dict[int, Identified]) -> None:
    require_honest(deviations(found.estimates.values() for found in every.values()))


@pytest.mark.trust
def test_it_comes_back_of_other_seeds_too() -> None:
    more = (identified(METHOD.synthetic(PAR, EQ22, seed)) for seed in range(1, 31))
    require_honest(deviations(found.estimates.values() for found in more))


def require_honest(z: Array) -> None:
    assert np.abs(z).max() < 4.0
    assert 0.5 < np.mean(z**2) < 1.8
    assert np.all(np.abs(z.mean(axis=0)) < 3.0 / math.sqrt(len(z)))


def test_intervals_that_forget_the_current_s_noise_would_lie(data: dict[int, xr.Dataset]) -> None:
    """The test above can fail: residuals correlated over seconds are treated as independent."""

    def forgetful(record: xr.Dataset) -> list[Estimate]:
        found = []
        for region in regions_of(split(record), (10e5, 35e5), 50.0):
            steps = tuple(replace(step, sigma_i=0.0) for step in region.steps)
            found.append(fit(replace(region, steps=steps), PAR, joint=True, turns=1))
        return found

    assert np.mean(deviations(forgetful(data[seed]) for seed in (1, 2)) ** 2) > 2.0


def test_two_steps_in_turn_agree_with_all_at_once(
    data: dict[int, xr.Dataset], every: dict[int, Identified]
) -> None:
    turns, joint = identified(data[1], fit="two-step").estimates, every[1].estimates
    for region in REGIONS:
        a, b = turns[region], joint[region]
        for name in b.names:
            width = b.deviations[b.names.index(name)]
            assert abs(a[name] - b[name]) < 4.0 * width, name
    once = identified(data[1], fit="two-step", turns=1).estimates["low"]
    assert any("converge" in note for note in once.notes)


def test_a_slow_pair_of_either_order() -> None:
    """A creeping response: the zero is above the pole, as for air that fills slowly."""
    options = EQ22.replace({"f_zero": 0.13, "f_pole": 0.1})
    found = METHOD.identify(METHOD.synthetic(PAR, options, 3), PAR, options, Effort())
    for region in REGIONS:
        five = five_of(found.estimates[region])
        assert five["tau_L"] < five["T_L"]
        assert 1.0 / (2.0 * math.pi * five["T_L"]) == pytest.approx(0.1, rel=0.2)


def test_a_pair_that_is_not_there_is_said(every: dict[int, Identified]) -> None:
    options = EQ22.replace({"f_zero": 0.1, "f_pole": 0.1})
    record = METHOD.synthetic(PAR, options, 1)
    found = METHOD.identify(record, PAR, options, Effort())
    assert not any(pair_shows(e) for e in found.estimates.values())
    assert any("model = 'eq-21'" in note for note in found.notes)
    assert all(pair_shows(e) for e in every[1].estimates.values())
    plain = METHOD.identify(record, PAR, options.replace({"model": "eq-21"}), Effort())
    wanted = truth(PAR, options)
    for region, estimate in plain.estimates.items():
        assert estimate.kept == ()
        for name in ("K", "T1", "T2"):
            k = estimate.names.index(f"{region}:{name}")
            error = abs(estimate.values[k] - wanted[f"{region}:{name}"])
            assert error < 4.0 * estimate.deviations[k], name


def test_a_brake_that_answers_late_is_found_out(
    data: dict[int, xr.Dataset], every: dict[int, Identified]
) -> None:
    records = split(data[1])
    late = {k: r.assign(p_mc=("time", np.roll(r["p_mc"].values, 20))) for k, r in records.items()}
    late = {k: r.isel(time=slice(20, None)) for k, r in late.items()}
    found = identified(joined(late))
    assert not any(c.holds for c in found.checks if c.name.endswith("misfit_sines"))
    assert all(c.holds for c in every[1].checks)


def test_what_lacks_is_named(data: dict[int, xr.Dataset], every: dict[int, Identified]) -> None:
    records = split(data[1])
    steps = {k: r for k, r in records.items() if "step" in k}
    sines = {k: r for k, r in records.items() if "step" not in k}
    with raises(ParameterError, name="low pressure"):
        identified(joined(sines))
    with raises(ParameterError, name="low pressure", value="no sine"):
        identified(joined(steps), fit="two-step")
    alone = identified(joined(steps)).estimates["low"]
    whole = every[1].estimates["low"]
    T2 = [e.deviations[e.names.index("low:T2")] for e in (alone, whole)]
    assert T2[0] > 3.0 * T2[1]
    first = records["low_step"]
    with raises(ParameterError, name="rest", valid=">= 0.2 s"):
        identified(first.isel(time=slice(900, None)))
    still = first.assign(i=("time", np.full(first.sizes["time"], 1.0)))
    with raises(ParameterError, name="i"):
        identified(still)
    stuck = first.assign(
        p_mc=("time", 5e5 + np.random.default_rng(0).normal(0.0, 2e3, first.sizes["time"]))
    )
    with raises(ParameterError, name="low pressure", value="bar"):
        identified(stuck)
    with raises(ParameterError, name="plant", valid="'eq-22'"):
        truth(PAR, METHOD.defaults)


def test_the_whole_brake_s_gain_is_that_of_its_dithered_motion() -> None:
    """With converters and filters, compared with the linear model of the periodic motion."""
    options = METHOD.defaults.replace({"model": "eq-21"})
    found = METHOD.identify(METHOD.synthetic(PAR, options, 1), PAR, options, Effort())
    gain = found.figures["medium.K"][0]
    assert gain == pytest.approx(dithered_plant(PAR, 25e5).gain, rel=0.03)  # type: ignore[arg-type]
    assert set(five_of(found.estimates["high"])) == set(NAMES)
    assert {c.name for c in found.curves} == {
        f"{region}-{part}" for region in REGIONS for part in ("gain", "phase", "step")
    }
    # Friction makes the gain depend on the amplitude: no linear model fits step and sines.
    assert all(c.holds for c in found.checks if c.name.endswith("misfit_step"))
    assert not all(c.holds for c in found.checks)
