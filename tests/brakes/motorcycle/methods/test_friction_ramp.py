"""Friction from the slow ramp: slips are found, parameters recovered, gaps reported."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from bywire.brakes.motorcycle.methods.friction_ramp import METHOD, Options, shots_of
from bywire.brakes.motorcycle.methods.stick_slip import Shooting, Slip, cut_out, find_slips
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.identification.measured import noise_of
from bywire.identification.method import Effort, Identified
from bywire.identification.trust import trust
from bywire.identification.unknown import parameters_of
from raising import raises

PAR = parameters("dardanelli2010")
OPTIONS = METHOD.defaults
COARSE = OPTIONS.replace({"step": 1e-4, "longest": 2.0})
"""for effects far beyond their limit"""
OFF = {"T_pr": 1.3, "f_cfr_p": 0.75, "f_cfr_n": 1.2, "k_brk_p": 0.9, "k_brk_n": 1.1, "c": 1.3}


@pytest.fixture(scope="module")
def data() -> xr.Dataset:
    return METHOD.synthetic(PAR, OPTIONS, 1)


@pytest.fixture(scope="module")
def rising(data: xr.Dataset) -> xr.Dataset:
    """Two upward slips of the ramp."""
    return data.isel(time=slice(5000, 12000))


@pytest.fixture(scope="module")
def alone(rising: xr.Dataset) -> Identified:
    """The estimates from wrong start values."""
    return METHOD.identify(rising, off(), COARSE, Effort(starts=2, spread=0.3))


def off() -> ParameterSet:
    return PAR.replace({f"seal.{n}": getattr(PAR.seal, n) * f for n, f in OFF.items()})  # type: ignore[attr-defined]


def test_slips_are_found_where_they_are(data: xr.Dataset) -> None:
    assert isinstance(OPTIONS, Options)
    p = data["p_mc"].values
    assert noise_of(p) == pytest.approx(2e3, rel=0.03)
    slips = find_slips(p, 1e-3, OPTIONS.least)
    assert [s.direction for s in slips] == [1, 1, 1, 1, 1, 1, -1]
    assert np.diff([s.rest for s in slips[:-1]]).min() > 0.5e5
    assert find_slips(np.random.default_rng(0).normal(0.0, 2e3, 5000), 1e-3, 0.2e5) == []


def test_the_rest_s_own_noise_is_no_slip() -> None:
    """Noise after a low-pass filter is smooth from sample to sample."""
    noise = np.random.default_rng(0).normal(0.0, 1e5, 5020)
    slow = np.convolve(noise, np.ones(20) / 20.0, mode="valid")
    assert find_slips(slow, 1e-3, 0.2e5) == []
    slow[3000:] += 3e5
    assert [s.direction for s in find_slips(slow, 1e-3, 0.2e5)] == [1]


def test_slips_that_follow_at_once_are_left_out(data: xr.Dataset) -> None:
    t, p, i = (data[name].values for name in ("time", "p_mc", "i"))
    crowded = [Slip(begin, begin + 3, 1, 1e5) for begin in (2, 40, 400)]
    found = cut_out(t[:600], p[:600], i[:600], crowded, OPTIONS.longest)
    assert [shot.slip.begin for shot in found] == [400]
    for slip in (Slip(1, 4, 1, 1e5), Slip(400, 403, -1, 1e5)):
        with raises(ParameterError, name="least"):
            cut_out(t[:600], p[:600], i[:600], [slip], OPTIONS.longest)


def test_a_wrong_unit_is_refused_in_a_sentence(data: xr.Dataset) -> None:
    """Pressures in bar with the heading MPa."""
    with raises(ParameterError, name="p_mc", value="bar", valid="<= "):
        METHOD.identify(data.assign(p_mc=10.0 * data["p_mc"]), PAR, OPTIONS, Effort(starts=1))


def test_records_that_cannot_be_such_a_ramp_are_refused(data: xr.Dataset) -> None:
    t = data["time"].values
    dithered = data.assign(i=data["i"] + 0.5 * np.sin(2.0 * np.pi * 50.0 * t))
    for record, fields in (
        (dithered, {"name": "i", "value": "0.35", "valid": "<= "}),
        (data.isel(time=slice(None, None, 10)), {"name": "sample time", "valid": "<= 4 ms"}),
    ):
        with raises(ParameterError, **fields):
            METHOD.identify(record, PAR, OPTIONS, Effort(starts=1))
    with pytest.raises(ParameterError, match=r"p_mc moves against i.*sign = -1"):
        METHOD.identify(data.assign(i=-data["i"]), PAR, OPTIONS, Effort(starts=1))


def test_a_pressure_whose_zero_is_off_is_found_out(data: xr.Dataset) -> None:
    off = data.assign(p_mc=data["p_mc"] + 0.3e5)
    found = METHOD.identify(off, PAR, COARSE.replace({"longest": 1.0}), Effort(starts=1))
    assert not next(c for c in found.checks if c.name == "zero_over_usual").holds


def test_derivatives_of_a_slip(data: xr.Dataset) -> None:
    """Residuals with their best shift, and breakaway, compared with central differences.

    Driven by its ramp alone, and by the measured current: that its dip is met earlier or later is
    not differentiated, small beside what the ramp alone would do.
    """
    assert isinstance(OPTIONS, Options)
    shot = shots_of(data, OPTIONS)[-1]
    calm = np.full(shot.slope.shape, shot.rate)
    shot = replace(shot, slope=calm, before=shot.before[0] + shot.rate * shot.clock)
    unknowns = parameters_of(PAR, ["seal.T_pr", "seal.f_cfr_n", "seal.k_brk_n", "seal.c"])
    shooting = Shooting(PAR, unknowns)  # type: ignore[arg-type]
    at = np.array([u.start for u in unknowns])
    size = np.zeros(at.size)
    for zero, share in ((None, 0.01), (0.0, 0.08)):
        found = shooting.fit(shot, at, zero)
        for k in range(at.size):
            by = np.zeros(at.size)
            by[k] = 1e-3 * at[k]
            up, down = (shooting.fit(shot, at + way * by, zero) for way in (1.0, -1.0))
            wanted = (up.residuals - down.residuals) / (2.0 * by[k])
            size[k] = max(size[k], np.sqrt(np.mean(wanted**2)))
            error = found.slopes[:, k] - wanted
            assert np.sqrt(np.mean(error**2)) < share * size[k], (zero, unknowns[k].name)
            wanted = (up.breakaway - down.breakaway) / (2.0 * by[k])
            assert found.breakaway_slopes[k] == pytest.approx(wanted, rel=0.06)


def test_two_slips_up_tell_the_way_up(alone: Identified) -> None:
    share = next(c.value for c in alone.checks if c.name == "starts_at_minimum")
    assert share == 1.0
    for name in ("T_pr", "f_cfr_p", "k_brk_p"):
        truth = getattr(PAR.seal, name)  # type: ignore[attr-defined]
        assert alone.parameters[f"seal.{name}"] == pytest.approx(truth, rel=0.05), name


@pytest.mark.trust
def test_from_starts_30_per_cent_off(data: xr.Dataset) -> None:
    """At least four of five starts reach the minimum, within 2 % of the true values."""
    options = OPTIONS.replace({"step": 5e-5})
    found = METHOD.identify(data, off(), options, Effort(starts=5, spread=0.3))
    share = next(c.value for c in found.checks if c.name == "starts_at_minimum")
    assert share >= 0.8
    for name in OFF:
        truth = getattr(PAR.seal, name)  # type: ignore[attr-defined]
        assert found.parameters[f"seal.{name}"] == pytest.approx(truth, rel=0.02), name
    kept = found.estimates["seal friction"].kept
    assert [k.unknown.name for k in kept] == ["seal.mu_T"]
    assert all(check.holds for check in found.checks)
    ramp, stribeck = found.curves
    assert float(np.abs(ramp.data["modeled"] - ramp.data["measured"]).mean()) < 1e5
    width = stribeck.data["high"] - stribeck.data["low"]
    assert float(width.max()) > 0.0


@pytest.mark.trust
def test_what_is_put_in_comes_back() -> None:
    """Through the converter of the ECU, each experiment from one start with wrong values."""
    study = trust(METHOD, PAR, OPTIONS, range(1, 11), Effort(starts=1, spread=0.3))
    assert not study.failed
    assert {r.label for r in study.recovered} == set(METHOD.unknowns) - {"seal.mu_T"}
    for one in study.recovered:
        assert abs(one.bias) < 4.0 * one.claimed / np.sqrt(one.count), one
        assert one.coverage_range[1] >= 0.9, one
        assert one.claimed < 0.01 * one.truth, one


def test_a_damping_that_is_not_as_told_is_found_out(rising: xr.Dataset, alone: Identified) -> None:
    wrong = PAR.replace({"master_cylinder.k_damp": 1.6e4})
    found = METHOD.identify(rising, wrong, COARSE, Effort(starts=1))
    residual, usual = (
        next(c for c in one.checks if c.name == "residual_over_noise") for one in (found, alone)
    )
    assert usual.holds
    assert not residual.holds
    assert residual.value > 2.0


def test_a_ramp_up_alone_does_not_tell_the_release(alone: Identified) -> None:
    untold = {k.unknown.name for k in alone.estimates["seal friction"].kept}
    assert {"seal.f_cfr_n", "seal.k_brk_n"} <= untold
    assert "seal.f_cfr_n" not in alone.parameters


def test_a_record_without_slips_is_refused(data: xr.Dataset) -> None:
    smooth = data.assign(p_mc=data["p_mc"] * 0.0 + 1e5)
    with raises(ParameterError, name="p_mc"):
        METHOD.identify(smooth, PAR, OPTIONS, Effort(starts=1))
