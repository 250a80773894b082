"""Stimuli compared with closed forms, and errors of their construction."""

import math

import numpy as np
import pytest

from bywire.bench import stimulus
from bywire.core.errors import InputError, ParameterError, UnitError, UnknownNameError

CHIRP = {
    "mean": "1 A",
    "amplitude": "0.5 A",
    "f_start": "1 Hz",
    "f_end": "15 Hz",
    "t_sweep": "10 s",
    "t_start": "0.5 s",
}
RAMP = {
    "start": "0 A",
    "end": "5 A",
    "slope": "0.2 A/s",
    "t_start": 0,
    "t_hold": 0,
    "after": "return",
}


def sampled(kind, values, t, unit="A"):
    return stimulus.create(kind, values, unit).sample(np.asarray(t, dtype=float))


def test_every_kind_is_found_and_described():
    found = stimulus.STIMULI.all()
    assert set(found) == {"chirp", "multisine", "ramp", "sine", "step", "table"}
    assert all(entry.summary for entry in found.values())


def test_step_is_on_time_in_spite_of_rounded_ticks():
    values = {"start": "20 bar", "end": "23 bar", "t_step": "0.3 s"}
    ticks = np.cumsum(np.full(400, 1e-3))  # the 300th is a rounding error below 0.3 s
    y = sampled("step", values, ticks, "Pa")
    assert y[298] == 20e5
    assert y[299] == 23e5


def test_ramp_is_equation_17():
    t = np.linspace(0.0, 60.0, 601)
    expected = np.where(t <= 25, 0.2 * t, np.maximum(10 - 0.2 * t, 0.0))
    np.testing.assert_allclose(sampled("ramp", RAMP, t), expected, atol=1e-14)


def test_ramp_downward_with_delay_and_hold():
    down = RAMP | {"start": "3 A", "end": "1 A", "slope": "2 A/s", "t_start": 1, "t_hold": "2 s"}
    t = [0.0, 1.0, 1.5, 2.0, 4.0, 4.5, 5.0, 9.0]
    np.testing.assert_allclose(sampled("ramp", down, t), [3, 3, 2, 1, 1, 2, 3, 3])
    stays = down | {"after": "stay"}
    np.testing.assert_allclose(sampled("ramp", stays, t), [3, 3, 2, 1, 1, 1, 1, 1])


def test_sine_starts_with_its_phase():
    values = {"mean": 2, "amplitude": 3, "f": "10 Hz", "phase": "90 deg", "t_start": "0.1 s"}
    np.testing.assert_allclose(sampled("sine", values, [0.0, 0.1, 0.125, 0.15]), [2, 5, 2, -1])


@pytest.mark.parametrize(
    ("sweep", "frequency"),
    [
        ("linear", lambda s: 1 + 14 * s),
        ("logarithmic", lambda s: 15**s),
    ],
)
def test_chirp_integrates_its_frequency(sweep, frequency):
    t = np.linspace(0.0, 12.0, 120_001)
    y = sampled("chirp", CHIRP | {"sweep": sweep}, t)
    f = frequency(np.clip((t - 0.5) / 10, 0, 1)) * (t >= 0.5)
    turns = np.concatenate(([0.0], np.cumsum(0.5 * (f[1:] + f[:-1]) * np.diff(t))))
    np.testing.assert_allclose(y, 1 + 0.5 * np.sin(2 * np.pi * turns), atol=5e-4)


def test_chirp_without_sweep_is_a_sine():
    t = np.linspace(0.0, 2.0, 101)
    y = sampled("chirp", CHIRP | {"f_end": "1 Hz", "t_start": 0, "sweep": "logarithmic"}, t)
    np.testing.assert_allclose(y, 1 + 0.5 * np.sin(2 * np.pi * t), atol=1e-12)


def test_multisine_has_a_flat_spectrum_and_a_low_peak():
    n, f_base, size = 31, 0.5, 1000
    t = np.arange(size) / size / f_base
    values = {"mean": 4, "amplitude": 0.2, "f_base": f_base, "n": n, "t_start": 0}
    y = sampled("multisine", values, t)
    spectrum = np.abs(np.fft.rfft(y)) * 2 / size
    np.testing.assert_allclose(spectrum[1 : n + 1], 0.2, rtol=1e-10)
    np.testing.assert_allclose(spectrum[n + 1 :], 0.0, atol=1e-12)
    rms = 0.2 * math.sqrt(n / 2)
    assert np.max(np.abs(y - 4)) / rms < 1.8  # all in phase: sqrt(2 n) = 7.9


def test_table_between_and_outside_its_nodes():
    values = {"times": "0 s, 100 ms, 0.3 s", "values": ["0 mm", "4 mm", 0.002]}
    t = [-1.0, 0.05, 0.1, 0.2, 0.3, 9.0]
    linear = sampled("table", values | {"between": "linear"}, t, "m")
    np.testing.assert_allclose(linear, [0, 0.002, 0.004, 0.003, 0.002, 0.002], atol=1e-15)
    hold = sampled("table", values | {"between": "hold"}, t, "m")
    np.testing.assert_allclose(hold, [0, 0, 0.004, 0.004, 0.002, 0.002])


@pytest.mark.parametrize(
    ("kind", "changes", "error", "text"),
    [
        ("rampp", {}, UnknownNameError, "did you mean 'ramp'"),
        ("ramp", {"slop": "1 A/s"}, UnknownNameError, "did you mean 'slope'"),
        ("ramp", {"end": "5 bar"}, UnitError, "ramp.end = '5 bar' has the wrong unit"),
        ("ramp", {"slope": "0 A/s"}, ParameterError, "slope = 0 A/s .* must be > 0 A/s"),
        ("ramp", {"start": math.nan}, ParameterError, "any finite number in A"),
        ("ramp", {"after": "reverse"}, ParameterError, "after must be 'stay' or 'return'"),
        ("ramp", {"start": [1, 2]}, ParameterError, "must be one value"),
    ],
)
def test_wrong_values_are_refused(kind, changes, error, text):
    with pytest.raises(error, match=text):
        stimulus.create(kind, RAMP | changes, "A")


@pytest.mark.parametrize(
    ("kind", "values", "text"),
    [
        ("step", {"start": 0, "end": 1}, "stimulus 'step': t_step is missing"),
        ("table", {"times": [0, 1, 1], "values": [0, 1, 2], "between": "hold"}, "1 s after 1 s"),
        ("table", {"times": [0, 1], "values": [0], "between": "hold"}, "the same length"),
        ("table", {"times": [], "values": [], "between": "hold"}, "the same length >= 1"),
        (
            "multisine",
            {"mean": 0, "amplitude": 1, "f_base": 1, "n": 2.5, "t_start": 0},
            "n = 2.5 .* whole number",
        ),
    ],
)
def test_contradictions_are_refused(kind, values, text):
    with pytest.raises(InputError, match=text):
        stimulus.create(kind, values, "1")
