"""Multisines and chirps: against the sine sweep, closed forms, and what is not linear."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bywire.analysis.loop import LOOPS
from bywire.analysis.response.frequency_response import (
    Broadband,
    broadband_response,
    frequency_response,
)
from bywire.analysis.response.sweep import Sweep
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import ParameterError
from systems.describing import SATURATION, Saturation, at_rest, saturation


@pytest.mark.parametrize("kind", ["multisine", "chirp"])
@pytest.mark.parametrize("name", ["screw-position", "drive-current"])
def test_a_smooth_loop_answers_as_to_sines(kind, name) -> None:
    loop = LOOPS.find(name)
    par = loop.smooth(parameters(main_set(loop.assembly)))
    run = loop.point(par, loop.at.default).run()
    low, high = max(loop.band[0], 4.0), loop.band[1]
    sweep = Sweep(
        loop.inputs,
        loop.output,
        tuple(np.geomspace(low, high, 6)),
        loop.amplitudes[:1],
        flags=(),
        tolerance=1e-5,
    )
    found = broadband_response(run, sweep, Broadband(kind, realizations=2))
    assert found["settled"].values.all()
    same = {
        "frequencies": tuple(found["frequency"].values),
        "shortest": found.attrs["window"] * (1.0 - 1e-9),
    }
    again = frequency_response(run, replace(sweep, **same))
    np.testing.assert_allclose(again["frequency"], found["frequency"], rtol=1e-12)
    gain = 20.0 * np.log10(found["gain"] / again["gain"])
    assert np.abs(gain).max() < 0.01
    assert np.abs(found["phase"] - again["phase"]).max() < 0.1
    np.testing.assert_allclose(found["coherence"], 1.0, rtol=1e-9)
    if kind == "multisine":
        assert found["distortion"].max() < 1e-6


def test_a_multisine_through_a_clip_sees_its_best_linear_gain() -> None:
    """For normally distributed inputs it is erf(limit / (sqrt(2) rms)) (Bussgang)."""
    frequencies = tuple(np.arange(2.0, 82.0, 2.0))
    sizes = SATURATION.limit * np.array([0.9, 3.0, 8.0])
    sweep = Sweep(("u",), "y", frequencies, tuple(sizes), flags=("flag",))
    run = at_rest(Saturation(), SATURATION)
    found = broadband_response(run, sweep, Broadband(realizations=8, seed=1)).isel(variant=0)
    value = found["gain"].values * np.exp(1j * np.radians(found["phase"].values))
    lag = [saturation(0.5 * SATURATION.limit, SATURATION, f) for f in found["frequency"].values]
    N = (value / lag).mean(axis=1)
    rms = found.attrs["rms"] * sizes
    exact = [1.0, *(math.erf(SATURATION.limit / math.sqrt(2.0) / one) for one in rms[1:])]
    np.testing.assert_allclose(N, exact, rtol=0.02)
    coherence, distortion = (found[name].mean("frequency") for name in ("coherence", "distortion"))
    assert coherence[0] == pytest.approx(1.0, abs=1e-9)
    assert coherence[0] > coherence[1] > coherence[2]
    assert distortion[0] < 1e-6
    assert distortion[2] > distortion[1] > 1e-3


def test_phases_are_drawn_from_the_seed() -> None:
    sweep = Sweep(("u",), "y", (5.0, 11.0, 23.0), (3.0 * SATURATION.limit,), flags=())
    run = at_rest(Saturation(), SATURATION)
    one, same, other = (broadband_response(run, sweep, Broadband(seed=seed)) for seed in (1, 1, 2))
    assert one.identical(same)
    assert not np.allclose(one["gain"], other["gain"], rtol=1e-6)


@pytest.mark.parametrize(
    ("frequencies", "count", "text"), [((5.0, 3.0), 1, "ascending"), ((3.0,), 0, "at least 1")]
)
def test_bad_requests(frequencies, count, text) -> None:
    sweep = Sweep(("u",), "y", frequencies, (1.0,), flags=())
    with pytest.raises(ParameterError, match=text):
        broadband_response(at_rest(Saturation(), SATURATION), sweep, Broadband(realizations=count))
