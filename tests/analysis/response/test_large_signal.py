"""Bandwidth and crossover by amplitude: against the linear figures, and over a range."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bywire.analysis.loop import LOOPS, Saturation
from bywire.analysis.margins import margins
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.large_signal import (
    Variant,
    narrowest,
    variants_over,
    widths,
    with_widths,
)
from bywire.analysis.response.sweep import Sweep, complex_values
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.synthesis.bench_figures import loop_gain


def response(variants, frequencies, amplitudes, **more):
    loop = variants[0].loop
    points = [one.point for one in variants]
    sweep = Sweep(
        loop.inputs,
        loop.output,
        frequencies,
        amplitudes,
        whole=loop.whole(points[0].par),
        saturations=loop.saturations,
        **more,
    )
    return frequency_response(points[0].run(), sweep, points=[one.run() for one in points])


@pytest.mark.parametrize("name", ["current", "screw-position"])
def test_without_friction_the_figures_are_the_linear_ones(name):
    loop = LOOPS.find(name)
    par = loop.smooth(parameters(main_set(loop.assembly)))
    expected = margins(loop, par, loop.at.default)
    one = Variant(loop, par, loop.at.default)
    low, high = sorted((expected.crossover, expected.bandwidth))
    f = [float(g) for g in np.geomspace(0.6 * low, 1.3 * high, 12)]
    (row,) = widths([one], response([one], f, loop.amplitudes[:1]))
    assert row[0].bandwidth == pytest.approx(expected.bandwidth, rel=0.01)
    assert row[0].crossover == pytest.approx(expected.crossover, rel=0.01)
    assert row[0].phase_margin == pytest.approx(expected.phase, abs=0.5)


def test_loop_gain_from_the_linear_models_is_that_of_the_laws():
    """Of the pressure loop, friction and dither on: two ways to what the controller is."""
    loop, par = LOOPS.find("pressure"), parameters("dardanelli2010")
    one = Variant(loop, par, 20e5)
    found = response([one], (1.0, 2.5, 5.0), (3e5,), most=6).isel(variant=0, amplitude=0)
    closed, f = complex_values(found), found["frequency"].values
    np.testing.assert_allclose(
        one.gain(closed, f), loop_gain(loop, par, 20e5, closed, f), rtol=1e-3
    )


def test_large_signals_meet_the_current_limit_and_lose_bandwidth():
    loop, par = LOOPS.find("position"), parameters("roberts2003")
    par = par.replace({"flywheel.law": "driven", "encoder.law": "ideal"})  # as in other tests
    (one,) = variants_over(Variant(loop, par, 0.0), "control.position.f_n", [60.0])
    f = [20.0, 30.0, 40.0, 60.0, 80.0]
    found = response([one], f, (0.25, 1.0), most=4)
    ((small, large),) = widths([one], found)
    assert large.bandwidth < 0.7 * small.bandwidth
    assert math.isnan(small.crossover), "two motors share the load"
    at_limit = found["share_sat_current"].values[0]
    assert at_limit[0, 0] == 0.0
    assert (at_limit[1] > 0.1).all()
    assert at_limit[1, -1] > 0.9


def test_a_range_has_operating_points_of_its_own_and_names_the_worst():
    loop, par = LOOPS.find("moment"), parameters("roberts2003")
    base = Variant(loop, loop.smooth(par), 200.0)
    variants = variants_over(base, "wedge.mu_B", [0.45, 0.25])
    f = [3.0, 5.0, 8.0, 12.0, 20.0]
    found = response(variants, f, (0.5,))
    found = with_widths(found, widths(variants, found))
    assert narrowest(found, 0) == 1
    for k, one in enumerate(variants):
        exact = one.linear(found["frequency"].values)
        measured = complex_values(found.isel(variant=k, amplitude=0))
        np.testing.assert_allclose(measured, exact, rtol=5e-3)
    both = variants_over(base, "moment", [100.0, 300.0])
    assert [one.value for one in both] == [100.0, 300.0]


def test_refusals():
    loop, par = LOOPS.find("moment"), parameters("roberts2003")
    base = Variant(loop, par, 200.0)
    with pytest.raises(UnknownNameError, match=r"wedge\.mu_B"):
        variants_over(base, "wedge.mu_b", [0.3])
    with pytest.raises(ParameterError, match="at least one"):
        variants_over(base, "wedge.mu_B", [])
    other = [base.point.run(), Variant(LOOPS.find("position"), par, 0.0).point.run()]
    sweep = Sweep(loop.inputs, loop.output, (5.0,), (1.0,))
    with pytest.raises(ParameterError, match="variant 1"):
        frequency_response(other[0], sweep, points=other)


def test_share_at_a_limit_counts_any_signal_at_the_smallest_limit():
    limit = Saturation("sat", ("a", "b"), ("x.most", "y.most"))
    values = np.array([[[2.0, 0.0], [0.0, -2.0], [1.9, 1.9], [0.0, 0.0]]])
    matrix = np.array([[9.0], [5.0], [2.0]])
    share = limit.share(values, matrix, ["other", "x.most", "y.most"])
    assert share == pytest.approx([0.5])
