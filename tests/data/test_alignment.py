"""One time axis: exact where it can be, and every flaw of a channel found and said."""

import numpy as np
import pytest
import xarray as xr

from bywire.core.errors import ParameterError, UnknownNameError
from bywire.data import alignment
from bywire.data.alignment import METHODS, resample
from bywire.data.channel_quality import quality
from bywire.identification.replay_fit import estimate_lag


def measurement(**channels):
    """Return a dataset of channels, each given by instants, values and attributes."""
    variables, coords = {}, {}
    for name, (time, values, *attrs) in channels.items():
        dim = f"time_{name}"
        variables[name] = (dim, np.asarray(values, dtype=float), *attrs)
        coords[dim] = (dim, np.asarray(time, dtype=float))
    return xr.Dataset(variables, coords=coords)


def test_straight_lines_are_kept_between_different_rates():
    fast, slow = np.arange(0, 1, 1e-3) + 0.0004, np.arange(0, 1.2, 0.07)
    data = measurement(a=(fast, 3 * fast + 1), b=(slow, -slow, {"delay": 0.002}))
    found = resample(data, "5 ms")
    time = found.dataset["time"].values
    np.testing.assert_allclose(time, np.arange(1, 200) * 5e-3)
    for method in ("linear", "average"):
        one = resample(data, "5 ms", method=method).dataset
        np.testing.assert_allclose(one["a"], 3 * one["time"] + 1, atol=1e-12)
    np.testing.assert_allclose(found.dataset["b"], -time, atol=1e-12)
    a, b = found.report.channels
    assert (a.quality.rate, b.quality.rate) == pytest.approx((1000.0, 1 / 0.07))
    assert (a.delay, b.delay, a.excluded) == (0.0, 0.002, 0)


def test_samples_on_the_axis_are_kept_exactly():
    time, values = np.arange(200) * 1e-3, np.random.default_rng(0).standard_normal(200)
    for method in ("linear", "previous", "nearest"):
        found = resample(measurement(a=(time, values)), 1e-3, method=method)
        np.testing.assert_array_equal(found.dataset["a"], values)


def test_previous_holds_and_nearest_chooses():
    data = measurement(a=([0, 1, 2, 3], [0, 10, 20, 30]))
    held = resample(data, 0.25, method="previous").dataset["a"].values[:6]
    near = resample(data, 0.25, method="nearest").dataset["a"].values[:6]
    assert held.tolist() == [0, 0, 0, 0, 10, 10]
    assert near.tolist() == [0, 0, 0, 10, 10, 10]


def test_average_takes_out_what_is_too_fast_for_the_axis():
    time = np.arange(0, 2, 1e-4)
    hum = np.cos(2 * np.pi * 1000 * time)
    data = measurement(a=(time, 5 + hum))
    folded = resample(data, "7 ms").dataset["a"].values - 5
    mean = resample(data, "7 ms", method="average").dataset["a"].values - 5
    assert resample(data, "7 ms").report.folded == ("a",)
    assert resample(data, "7 ms", method="average").report.folded == ()
    assert resample(data, "0.1 ms").report.folded == ()
    assert np.abs(folded).max() > 0.5
    assert np.abs(mean).max() < 1e-3  # seven whole periods


def test_gap_is_left_out_or_bridged_as_asked():
    time = np.concatenate([np.arange(0, 1, 0.01), np.arange(1.5, 2, 0.01)])
    data = measurement(a=(time, time))
    found = resample(data, "10 ms")
    (channel,) = found.report.channels
    (gap,) = channel.quality.gaps
    assert (gap.start, gap.length) == pytest.approx((0.99, 0.51))
    inside = (found.dataset["time"] > 0.9901) & (found.dataset["time"] < 1.4999)
    np.testing.assert_array_equal(np.isnan(found.dataset["a"]), inside)
    assert channel.excluded == int(inside.sum()) == 50
    bridged = resample(data, "10 ms", exclude=())
    np.testing.assert_allclose(bridged.dataset["a"], bridged.dataset["time"], atol=1e-12)
    assert bridged.report.channels[0].quality.gaps == channel.quality.gaps  # said all the same
    assert not resample(data, "10 ms", max_gap="0.6 s").report.channels[0].quality.gaps


def test_missing_values_are_left_out_or_bridged_as_asked():
    time, values = np.arange(100) * 0.01, np.arange(100.0)
    values[40:45] = np.nan
    data = measurement(a=(time, values))
    found = resample(data, "10 ms")
    (channel,) = found.report.channels
    (hole,) = channel.quality.missing
    assert (hole.start, hole.length, hole.samples) == pytest.approx((0.39, 0.06, 5))
    assert np.flatnonzero(np.isnan(found.dataset["a"])).tolist() == [40, 41, 42, 43, 44]
    used = resample(data, "10 ms", exclude=["gaps"]).dataset["a"]
    np.testing.assert_allclose(used, np.arange(100.0))


def test_clipped_stretches_are_found_and_left_out_where_asked():
    time = np.arange(1000) * 1e-3
    whole = 100 * np.sin(2 * np.pi * time)
    cut = np.clip(whole, -200, 60)
    open_ended = measurement(a=(time, cut))
    known = measurement(a=(time, cut, {"valid_min": -100.0, "valid_max": 60.0}))
    first, last = np.flatnonzero(whole >= 60)[[0, -1]]
    for data in (open_ended, known):
        kept = resample(data, 1e-3)
        (stretch,) = [s for s in kept.report.channels[0].quality.clipped if s.samples > 1]
        assert stretch.samples == last - first + 1
        assert not np.isnan(kept.dataset["a"]).any()
        left_out = resample(data, 1e-3, exclude=["clipped"]).dataset["a"].values
        assert np.isnan(left_out[first : last + 1]).all()
        assert not np.isnan(left_out[last + 1 : last + 100]).any()


@pytest.mark.parametrize("method", METHODS)
def test_the_axis_is_filled_piece_by_piece(method, monkeypatch):
    time = np.arange(300) * 0.01
    data = measurement(a=(time, np.sin(3 * time)))
    whole = resample(data, "4 ms", method=method).dataset["a"].values
    monkeypatch.setattr(alignment, "_BLOCK", 64)
    pieces = resample(data, "4 ms", method=method).dataset["a"].values
    np.testing.assert_allclose(pieces, whole, rtol=0, atol=1e-13)


def test_jitter_is_the_largest_distance_from_the_median_step():
    time = np.arange(100) * 0.01
    time[50] += 0.003
    found = quality(time, time)
    assert found.jitter == pytest.approx(0.003)
    assert found.gaps == ()


@pytest.mark.parametrize(
    ("options", "kind", "text"),
    [
        ({"interval": "0 s"}, ParameterError, "interval = '0 s' is not valid"),
        ({"interval": 1e-12}, ParameterError, "12 samples of each signal"),
        ({"interval": 2e-9}, ParameterError, r"14\.9 GiB"),
        (
            {"interval": 0.1, "signals": ["high"], "exclude": ["clipped"]},
            ParameterError,
            "high has no values left after excluding clipped",
        ),
        ({"interval": 1, "max_gap": -1}, ParameterError, "max_gap = -1"),
        ({"interval": 1, "method": "linaer"}, UnknownNameError, "did you mean 'linear'"),
        ({"interval": 1, "exclude": ["gap"]}, UnknownNameError, "did you mean 'gaps'"),
        ({"interval": 1, "signals": ["q"]}, UnknownNameError, "unknown signal 'q'"),
        ({"interval": 5}, ParameterError, "no interval of 5 s fits"),
        ({"interval": 1, "signals": ["a", "late"]}, ParameterError, "start of late at 5 s"),
        ({"interval": 1, "signals": ["none"]}, ParameterError, "none has 1 measured values"),
    ],
)
def test_refused_alignments(options, kind, text):
    t = [0, 1, 2]
    data = measurement(
        a=(t, t),
        late=([5, 6], [1, 2]),
        none=(t, [np.nan, 1, np.nan]),
        high=(t, [7, 8, 9], {"valid_min": 0.0, "valid_max": 5.0}),
    )
    with pytest.raises(kind, match=text):
        resample(data, **{"signals": ["a"], **options})


@pytest.mark.parametrize("lag", [0.0, 0.00037, -0.0123, 0.041])
@pytest.mark.parametrize("sign", [1, -1])
def test_lag_is_found_to_a_fraction_of_a_sample(lag, sign):
    def shape(t):
        return np.exp(-(((t - 0.5) / 0.06) ** 2)) + 0.5 * np.exp(-(((t - 0.7) / 0.03) ** 2))

    fast, slow = np.arange(0, 1, 1e-3), np.arange(0, 1, 2e-3)
    data = measurement(a=(fast, shape(fast)), b=(slow, 3 + 7 * sign * shape(slow - lag)))
    found = estimate_lag(data, "a", "b")
    assert found.value == pytest.approx(lag, abs=2e-5)  # a hundredth of the slower step
    assert found.correlation == pytest.approx(sign, abs=1e-4)
    assert not found.at_limit


def test_lag_outside_of_the_range_is_told():
    t = np.arange(0, 1, 1e-3)
    data = measurement(a=(t, np.tanh(50 * (t - 0.4))), b=(t, np.tanh(50 * (t - 0.6))))
    assert estimate_lag(data, "a", "b", largest="50 ms").at_limit
    with pytest.raises(ParameterError, match="does not change"):
        estimate_lag(measurement(a=(t, t), b=(t, 0 * t)), "a", "b")
    with pytest.raises(UnknownNameError, match="unknown signal 'c'"):
        estimate_lag(data, "a", "c")
