"""Root loci: where a loop turns unstable, against its gain margin and against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bywire.analysis.linear.linear_model import LinearModel, rates
from bywire.analysis.locus import locus, locus_of
from bywire.analysis.loop import LOOPS
from bywire.analysis.margins import figures_at, loop_curve
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import ParameterError


def test_a_loop_turns_unstable_at_its_gain_margin_and_swings_at_the_phase_crossover() -> None:
    """The crossover frequency of the moment controller is a factor of its loop gain."""
    loop = LOOPS.find("moment")
    par = parameters(main_set(loop.assembly))
    f_c = par.leaves()["control.moment.f_c"]
    curve = loop_curve(loop, figures_at(loop, par, 200.0))
    values = np.linspace(0.5, 10.0, 20) * f_c
    found = locus(loop, par, 200.0, "control.moment.f_c", "Hz", values.tolist())
    (border,) = found.borders
    assert border.value / f_c == pytest.approx(curve.margins.gain, rel=1e-3)
    assert border.rate.imag / (2.0 * math.pi) == pytest.approx(curve.margins.gain_at, rel=1e-3)
    assert abs(border.rate.real) < 1e-3
    assert not border.above
    np.testing.assert_array_equal(found.stable, values < border.value)


def test_poles_are_followed_from_value_to_value() -> None:
    loop = LOOPS.find("screw-position")
    par = parameters(main_set(loop.assembly))
    values = np.linspace(10.0, 100.0, 40).tolist()
    found = locus(loop, par, loop.at.default, "control.position.f_n", "Hz", values)
    own = loop.closed(par.replace({"control.position.f_n": values[7]}), loop.at.default)
    np.testing.assert_allclose(np.sort_complex(found.poles[7]), np.sort_complex(own.poles()))
    jumps = np.abs(np.diff(found.poles, axis=0)).sum(axis=1)
    # Sorted by size, as poles() gives them, poles that pass each other would swap.
    sizes = np.take_along_axis(found.poles, np.argsort(np.abs(found.poles), axis=1), axis=1)
    assert jumps.sum() < np.abs(np.diff(sizes, axis=0)).sum()
    assert jumps.max() < 0.5


def oscillator(damping: float, period: float = 0.0) -> LinearModel:
    """Return a mass on a spring of 10 rad/s."""
    A = np.array([[0.0, 1.0], [-100.0, -2.0 * 10.0 * damping]])
    own = LinearModel(
        "oscillator",
        A,
        np.eye(2)[:, 1:],
        np.eye(2)[:1],
        np.zeros((1, 1)),
        ("x", "v"),
        ("F",),
        ("x",),
        ("m", "m/s"),
        ("N",),
        ("m",),
        np.zeros(2),
    )
    return own.sampled(period) if period else own


@pytest.mark.parametrize("period", [0.0, 0.01])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_border_of_an_oscillator_is_at_no_damping(period: float, direction: float) -> None:
    found = locus_of(
        lambda at: oscillator(direction * at, period), "damping", "1", [-0.3, -0.1, 0.25, 0.5]
    )
    (border,) = found.borders
    assert border.value == pytest.approx(0.0, abs=1e-8)
    assert border.rate == pytest.approx(10j, abs=1e-6)
    assert border.above == (direction > 0)
    expected = -direction * 10.0 * found.values
    np.testing.assert_allclose(found.rates.real.mean(axis=1), expected, atol=1e-9)


def test_integrators_that_a_loop_does_not_move_are_no_instability() -> None:
    def resting(at: float) -> LinearModel:
        own = oscillator(at)
        A = np.zeros((3, 3))
        A[:2, :2] = own.A
        return replace(
            own,
            A=A,
            B=np.zeros((3, 1)),
            C=np.ones((1, 3)),
            states=("x", "v", "phi"),
            state_units=("m", "m/s", "rad"),
            rate=np.zeros(3),
        ).sampled(0.01)

    assert locus_of(resting, "damping", "1", [0.1, 0.2]).stable.all()


def test_rates_of_a_sampled_model_are_those_of_the_continuous_one() -> None:
    np.testing.assert_allclose(
        np.sort_complex(rates(oscillator(0.2, 0.01))), np.sort_complex(rates(oscillator(0.2)))
    )


def test_one_value_is_no_locus() -> None:
    with pytest.raises(ParameterError, match="two values"):
        locus_of(oscillator, "damping", "1", [0.1])
