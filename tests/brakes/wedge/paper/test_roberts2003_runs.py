"""What the reproduction of Roberts et al. (2003) computes itself, on made-up recordings."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.brakes.wedge.figures import FARTHEST, WedgeForces, brake_factor
from bywire.brakes.wedge.paper.moment_tests import order_spectrum
from bywire.brakes.wedge.paper.statements import settled, stacked
from bywire.core.errors import ParameterError


def coasting(waves: dict[float, float], duration: float = 3.2) -> xr.Dataset:
    """Return a moment with waves over the angle of a disc that slows down."""
    t = np.arange(0.0, duration, 1e-3)
    Omega = 60.0 - 6.0 * t
    phi = 60.0 * t - 3.0 * t**2
    M = 200.0 + sum(a * np.sin(order * phi) for order, a in waves.items())
    return xr.Dataset(
        {
            "M_B": ("time", M, {"units": "N*m", "long_name": "braking moment"}),
            "Omega": ("time", Omega, {"units": "rad/s", "long_name": "disc speed"}),
            "phi": ("time", phi, {"units": "rad", "long_name": "disc angle"}),
        },
        coords={"time": t},
    )


def test_spectrum_over_the_angle_finds_waves_of_a_disc_that_slows_down() -> None:
    found = order_spectrum(coasting({1.0: 12.0, 3.0: 2.0}), "M_B", turns=20, begin=0.5)
    order, amplitude = found["order"], found["amplitude"]
    assert order[np.argmax(amplitude)] == 1.0
    at = {k: float(amplitude[np.argmin(np.abs(order - k))]) for k in (1.0, 2.0, 3.0)}
    assert at[1.0] == pytest.approx(12.0, rel=1e-3)
    assert at[2.0] < 0.05
    assert at[3.0] == pytest.approx(2.0, rel=1e-2)


def test_spectrum_of_a_disc_that_turns_too_little_is_not_defined() -> None:
    found = order_spectrum(coasting({1.0: 12.0}, duration=1.0), "M_B", turns=20, begin=0.5)
    assert np.isnan(found["amplitude"]).all()


def test_mean_over_a_turn_leaves_the_wave_out() -> None:
    run = coasting({1.0: 12.0})
    for end in (1.0, 1.03, 1.07):
        assert settled(run, "M_B", end) == pytest.approx(200.0, abs=0.4)
        assert abs(float(run["M_B"].sel(time=slice(end - 0.05, end)).mean()) - 200.0) > 0.5


def test_a_measured_recording_is_drawn_as_its_own_line() -> None:
    t = np.linspace(0.0, 1.0, 101)
    run = xr.Dataset(
        {
            "y_M": ("time", 200.0 * t, {"units": "N*m", "long_name": "moment"}),
            "M_set": ("time", 0.0 * t + 200.0, {"units": "N*m", "long_name": "moment demand"}),
            "omega_1": ("time", t, {"units": "rad/s", "long_name": "motor speed 1"}),
        },
        coords={"time": t},
    )
    rig = run[["y_M"]].isel(time=slice(None, None, 7)) * 0.9
    rig["y_M"].attrs = run["y_M"].attrs
    upper, lower = stacked(run, rig).axes
    lines = {str(line.get_label()): np.asarray(line.get_ydata()) for line in upper.lines}
    assert set(lines) == {"moment, measured", "moment, simulated", "moment demand"}
    assert lines["moment, measured"].size == rig.sizes["time"]
    assert lines["moment, measured"][-1] == pytest.approx(0.9 * lines["moment, simulated"][98])
    assert [line.get_label() for line in lower.lines] == ["motor speed 1, simulated"]


def test_brake_factor_is_drawn_only_where_it_has_room() -> None:
    mu = (0.2, 0.35, 0.36)
    free = tuple(0.364 - m for m in mu)
    figure = brake_factor(WedgeForces(mu, free, free, free), 0.364)
    shown = {str(line.get_label()): line for line in figure.axes[1].lines}
    values = np.asarray(shown["simulated, without friction"].get_ydata(), dtype=float)
    np.testing.assert_allclose(values[:2], [0.4 / 0.164, 0.7 / 0.014])
    assert np.isnan(values[2])  # 180, beyond the end of the axis
    assert FARTHEST < 180.0
    with pytest.raises(ParameterError, match="3, 3, 2, 3"):
        WedgeForces(mu, free, free[:2], free)
