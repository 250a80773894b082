"""Thinned lines look like the original."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.report.channel import COLUMNS, decimate, lasting_phases, phases


def test_single_sample_peaks_survive() -> None:
    time = np.linspace(0.0, 60.0, 60_001)
    values = np.sin(time)
    values[12_345], values[54_321] = 17.0, -23.0
    thin_time, thin = decimate(time, values)
    assert len(thin) < len(values) / 10
    assert (thin.max(), thin.min()) == (17.0, -23.0)
    assert thin_time[thin.argmax()] == time[12_345]
    assert thin_time[thin.argmin()] == time[54_321]


def test_every_pixel_column_keeps_its_extremes_and_ends() -> None:
    rng = np.random.default_rng(5)
    time = np.sort(rng.uniform(0.0, 1.0, 20_000))
    values = rng.normal(size=time.size)
    thin_time, thin = decimate(time, values, columns=50)

    def summary(t: np.ndarray, v: np.ndarray) -> list[tuple[float, float, float, float]]:
        column = np.minimum((t - time[0]) / (time[-1] - time[0]) * 50, 49).astype(int)
        parts = [v[column == k] for k in range(50)]
        return [(part[0], part.min(), part.max(), part[-1]) for part in parts]

    assert len(thin) <= 4 * 50
    assert summary(thin_time, thin) == summary(time, values)


def test_thinned_samples_are_samples_in_their_order() -> None:
    time = np.linspace(0.0, 1.0, 10_000)
    values = np.random.default_rng(1).normal(size=time.size)
    thin_time, thin = decimate(time, values)
    assert np.all(np.diff(thin_time) > 0)
    assert np.array_equal(thin, values[np.searchsorted(time, thin_time)])


def test_gaps_stay_gaps_and_do_not_hide_peaks() -> None:
    time = np.linspace(0.0, 1.0, 10_000)
    values = np.zeros_like(time)
    values[5_000:5_003] = np.nan
    values[5_004] = 9.0
    _, thin = decimate(time, values)
    assert np.isnan(thin).any()
    assert np.nanmax(thin) == 9.0


@pytest.mark.parametrize("count", [0, 1, 2, 4 * COLUMNS])
def test_short_lines_come_back_whole(count: int) -> None:
    time = np.arange(float(count))
    assert decimate(time, time)[0] is not None
    assert np.array_equal(decimate(time, time)[1], time)


def test_phases_start_and_end_where_the_mode_does() -> None:
    time = np.arange(10.0)
    active = np.array([1, 1, 0, 0, 1, 0, 0, 0, 1, 1], dtype=bool)
    assert phases(time, active) == [(0.0, 2.0), (4.0, 5.0), (8.0, 9.0)]


def test_phases_too_short_to_see_become_columns_of_the_right_share() -> None:
    time = np.linspace(0.0, 60.0, 60_001)
    mostly = (np.arange(time.size) % 10 < 8) & (time < 30.0)
    spans = phases(time, mostly)
    assert len(spans) < 20
    assert sum(end - start for start, end in spans) == pytest.approx(30.0, abs=0.3)


def test_phases_that_follow_closely_are_one_with_its_share() -> None:
    """As under dither: 60 short phases per second, then a long one."""
    time = np.linspace(0.0, 10.0, 100_001)
    dithered = (time < 4.0) & (np.mod(60.0 * time, 1.0) < 0.25)
    again, lasting = lasting_phases(time, dithered | (time >= 6.0) & (time < 8.0))
    assert (again.start, again.end) == pytest.approx((0.0, 4.0), abs=0.02)
    assert again.share == pytest.approx(0.25, abs=0.01)
    assert (lasting.start, lasting.end, lasting.share) == pytest.approx((6.0, 8.0, 1.0))
    apart = lasting_phases(time, (time < 1.0) | (time >= 2.0))
    assert [each.share for each in apart] == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize("count", [0, 1])
def test_nothing_lasts_in_less_than_two_samples(count: int) -> None:
    for spans in (phases, lasting_phases):
        assert spans(np.zeros(count), np.ones(count, dtype=bool)) == []
