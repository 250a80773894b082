"""Measured responses know their error from the step."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.analysis.response.frequency_response import FIGURES, largest, with_step_errors
from bywire.api import frequency_response as use_case
from bywire.core.errors import RunError

ASKED = {"frequencies": "50 Hz, 100 Hz, 200 Hz, 400 Hz", "amplitudes": "1 A"}


def test_true_errors_lie_within_three_times_the_estimate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against a tenth of the step."""
    coarse = bywire.frequency_response("current", **ASKED)
    measured = use_case._measured
    monkeypatch.setattr(
        use_case,
        "_measured",
        lambda *args: measured(*args[:4], 0.1),  # of the same sweep
    )
    fine = bywire.frequency_response("current", **ASKED, estimate_error=False)
    assert "gain_step_error" not in fine.data
    for name in ("gain", "phase", "bandwidth", "crossover", "phase_margin"):
        error = coarse.data[f"{name}_step_error"].values
        off = np.abs(coarse.data[name].values - fine.data[name].values)
        assert np.all(off <= 3.0 * error + 1e-9 * np.abs(coarse.data[name].values)), name
    assert np.all(coarse.data["gain_step_error"].values > 0.0)
    figures = coarse.as_object()["figures"][0]
    assert figures["bandwidth_step_error"] == float(coarse.data["bandwidth_step_error"][0, 0])
    assert "the step: up to" in str(coarse)


def test_half_steps_that_do_not_run_are_said_to(monkeypatch: pytest.MonkeyPatch) -> None:
    measured = use_case._measured

    def fragile(*args, **kwargs):
        if len(args) > 4:
            raise RunError("left the numbers")
        return measured(*args, **kwargs)

    monkeypatch.setattr(use_case, "_measured", fragile)
    found = bywire.frequency_response("current", **ASKED)
    assert any("unknown" in text and "left the numbers" in text for text in found.warnings)
    assert "gain_step_error" not in found.data


def response(gain: list[float], phase: list[float], bandwidth: float) -> xr.Dataset:
    three, two = ("variant", "amplitude", "frequency"), ("variant", "amplitude")
    figures = {name: (two, [[bandwidth]]) for name in FIGURES[2:]}
    return xr.Dataset({"gain": (three, [[gain]]), "phase": (three, [[phase]]), **figures})


def test_what_sticks_or_lies_beyond_the_band_has_no_error_and_phases_have_no_turns() -> None:
    one = response([1.0, np.nan, np.nan], [-179.0, np.nan, np.nan], np.inf)
    other = response([1.1, np.nan, 0.5], [178.0, np.nan, -10.0], np.inf)
    found = with_step_errors(one, other, 2.0)
    np.testing.assert_allclose(found["gain_step_error"].values[0, 0], [0.2, np.nan, np.inf])
    np.testing.assert_allclose(found["phase_step_error"].values[0, 0], [6.0, np.nan, np.inf])
    assert float(found["bandwidth_step_error"][0, 0]) == 0.0
    assert "up to 2 dB and 6°" in largest(found)
    beyond = with_step_errors(one, response([1.0] * 3, [0.0] * 3, 3.0), 2.0)
    assert np.isinf(beyond["bandwidth_step_error"].values).all()
