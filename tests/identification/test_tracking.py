"""Friction and clearance of the wedge brake, tracked through brakings with a known drift."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.identification.tracking import track
from raising import raises
from run_once import run_once

NOISE = {"y_M": 2.0, "F_N": 10.0, "F_M": 5.0, "x": 2e-6, "Omega": 0.1}
FADING = np.linspace(0.38, 0.31, 8)


@pytest.fixture(scope="module")
def brakings() -> tuple[xr.Dataset, np.ndarray]:
    """Return a record of brakings one after the other, each with less friction, and the truth."""
    random = np.random.default_rng(4)
    parts, truth = [], []
    for mu in FADING:
        bench = bywire.Bench(
            "moment-pulses",
            "roberts2003",
            overrides={"wedge.mu_B": float(mu)},
            options={"t_hold": 0.4, "pulses": 1},
        )
        run = run_once(bench).recording[[*NOISE, "f_1", "f_2"]].drop_vars("time")
        parts.append(run)
        truth.append(np.full(run.sizes["time"], mu))
    whole = xr.concat(parts, "time")
    whole = whole.assign_coords(time=1e-3 * np.arange(whole.sizes["time"]))
    for name, size in NOISE.items():
        whole[name] = whole[name] + size * random.standard_normal(whole.sizes["time"])
    return whole, np.concatenate(truth)


def settled(found: xr.Dataset, known: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return the blocks that lie within one braking and count."""
    at = [known[np.abs(time - t) < 0.06] for t in found["time"].values]
    return np.array([np.ptp(k) == 0.0 for k in at]) & (found["used"].values > 0)


def test_fading_friction_is_followed(brakings: tuple[xr.Dataset, np.ndarray]) -> None:
    data, truth = brakings
    found = track("mu_B", data, parameters("roberts2003"))
    one = found.data.sel(parameter="wedge.mu_B")
    at = np.interp(one["time"].values, data["time"].values, truth)
    rows = settled(one, truth, data["time"].values)
    error = (one["value"].values - at)[rows]
    assert rows.sum() > 40
    assert np.sqrt(np.mean(error**2)) < 0.001  # steps of the drift: 0.01
    inside = (one["low"].values <= at) & (at <= one["high"].values)
    assert inside[rows].mean() > 0.85


def test_the_actuation_force_tells_it_within_the_wedge_friction(
    brakings: tuple[xr.Dataset, np.ndarray],
) -> None:
    """Without the normal force it is off by no more than the friction on the wedge allows."""
    data, truth = brakings
    par = parameters("roberts2003")
    found = track("wedge.mu_B", data.drop_vars("F_N"), par)
    one = found.data.sel(parameter="wedge.mu_B")
    assert "internal friction" in found.relation.assumption
    t = data["time"].values
    at = np.interp(one["time"].values, t, truth)
    rows = settled(one, truth, t)
    known = par.leaves()
    most = known["wedge_friction.mu_R"] * data["F_N"] + known["wedge_friction.mu_int"] * np.tan(
        known["wedge.alpha"]
    ) * (data["f_1"] + data["f_2"])
    bound = np.array(
        [
            float((most[np.abs(t - now) < 0.05] / data["F_N"][np.abs(t - now) < 0.05]).median())
            for now in one["time"].values
        ]
    )
    error = np.abs(one["value"].values - at)
    band = one["high"].values - one["value"].values
    assert np.all(error[rows] < (bound + band)[rows])
    assert np.median(error[rows]) < 0.01


def test_clearance_is_told_by_travel_and_force(
    brakings: tuple[xr.Dataset, np.ndarray],
) -> None:
    data, _ = brakings
    par = parameters("roberts2003")
    worn = data.assign(x=data["x"] + 5e-5)  # pads worn: the wedge travels further
    gained = 5e-5 * np.tan(par.leaves()["wedge.alpha"])
    for record, wanted in (
        (data, par.leaves()["caliper.clearance"]),
        (worn, par.leaves()["caliper.clearance"] + gained),
    ):
        last = track("clearance", record, par).data.sel(parameter="caliper.clearance").isel(time=-1)
        assert float(last["low"]) <= wanted <= float(last["high"])
        assert float(last["high"] - last["low"]) < 3e-6


def test_what_cannot_be_tracked_is_refused(brakings: tuple[xr.Dataset, np.ndarray]) -> None:
    data, _ = brakings
    par = parameters("roberts2003")
    with pytest.raises(UnknownNameError, match=r"wedge\.mu_B"):
        track("mu_C", data, par)
    with pytest.raises(ParameterError, match="y_M, F_N or y_M, F_M"):
        track("mu_B", data.drop_vars("y_M"), par)
    with raises(ParameterError, name="mu_B"):
        track("mu_B", data, parameters("dardanelli2010"))
