"""Every loop: linear and nonlinear response agree, margins agree with a library's, worst cases."""

from __future__ import annotations

import math
from dataclasses import astuple, replace

import control
import numpy as np
import pytest

from bywire.analysis.agreement import agreement
from bywire.analysis.loop import LOOPS
from bywire.analysis.margins import margins, worst
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import ParameterError, StepError, UnknownNameError
from raising import raises

NAMES = sorted(LOOPS.all())


def over(loop, par, value, name, values):
    return [margins(loop, *case) for case in loop.varied(par, value, name, values)]


def of(name: str):
    loop = LOOPS.find(name)
    return loop, parameters(main_set(loop.assembly))


@pytest.mark.parametrize("name", NAMES)
def test_nonlinear_response_is_the_linear_one_without_its_causes(name: str) -> None:
    loop, par = of(name)
    low, high = loop.band
    frequencies = (max(low, 2.0), math.sqrt(max(low, 2.0) * high), high)
    found = agreement(
        replace(loop, causes={}),
        loop.smooth(par),
        loop.at.default,
        frequencies,
        (loop.amplitudes[0], loop.amplitudes[0]),
    )
    assert found.holds
    assert np.abs(found.gain[""]).max() < 0.01
    assert np.abs(found.phase[""]).max() < 0.1


def test_without_causes_a_run_is_the_linear_model_of_its_own_scheme() -> None:
    """What is left against the exact model is the error of the step, of second order."""
    loop, par = of("position")
    own, f = replace(loop, causes={}), (20.0, 150.0)
    found = agreement(own, loop.smooth(par), 0.0, f, (1e-3, 1e-3))
    np.testing.assert_allclose(found.gain[""], found.step_gain, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.phase[""], found.step_phase, rtol=0.0, atol=1e-9)
    assert abs(found.step_gain[1]) > 1e-6
    exact = loop.closed(par, 0.0).response(np.array(f))
    coarse, fine = (
        np.abs(loop.closed(par, 0.0, h).response(np.array(f)) / exact - 1.0) for h in (20e-6, 10e-6)
    )
    np.testing.assert_allclose(coarse / fine, 4.0, rtol=0.02)
    with pytest.raises(StepError, match="does not divide the sample time"):
        loop.closed(par, 0.0, 30e-6)


def test_agreement_shows_what_breaks_it() -> None:
    loop, par = of("screw-position")
    one = replace(loop, causes={k: loop.causes[k] for k in ("encoder", "bearing friction")})
    rest = {k: v for c, off in loop.causes.items() if c not in one.causes for k, v in off.items()}
    found = agreement(one, par.replace(rest), 0.0, (5.0,), (1e-3, 0.25))
    assert found.holds
    assert abs(found.phase["bearing friction"][0]) > 1.0
    assert abs(found.phase["encoder"][0]) < 0.5
    assert found.largest == ["bearing friction"]
    rubbing = {"": found.gain["bearing friction"]}, {"": found.phase["bearing friction"]}
    assert not replace(found, gain=rubbing[0], phase=rubbing[1]).holds


def test_agreement_tells_limits_from_causes() -> None:
    """At 100 Hz and 1 rad the drives' current limit acts; friction hides behind it."""
    loop, par = of("position")
    one = replace(loop, causes={"bearing friction": loop.causes["bearing friction"]})
    found = agreement(one, loop.smooth(par, "bearing friction"), 0.0, (100.0,), (1e-3, 1.0))
    assert found.holds
    assert found.largest == ["limits"]
    assert found.gain["limits"][0] < -6.0
    assert found.gain["bearing friction"][0] < -6.0
    added, turned = found.beyond_limits("bearing friction")
    assert abs(added[0]) < 0.5
    assert 0.1 < abs(turned[0]) < 20.0
    lost = replace(found, gain=found.gain | {"bearing friction": np.array([math.nan])})
    assert lost.largest == ["bearing friction"]


@pytest.mark.filterwarnings("ignore:stability_margins. Falling back")
@pytest.mark.parametrize("name", NAMES)
def test_margins_are_those_of_the_library(name: str) -> None:
    loop, par = of(name)
    found = margins(loop, par, loop.at.default)
    gain = loop.gain(par, loop.at.default)
    highest = 0.998 * min(gain.nyquist, loop.closed(par, loop.at.default).nyquist)
    omega = 2.0 * math.pi * np.geomspace(0.01, highest, 2000)
    response = control.frd(gain.response(omega / 2.0 / math.pi)[:, 0, 0], omega)
    _, phase, _, _, crossover, _ = control.stability_margins(response, returnall=True)
    k = int(np.argmin(np.abs(crossover - 2.0 * math.pi * found.crossover)))
    assert found.phase == pytest.approx(float(phase[k]), abs=0.2)
    # The library's own search for crossovers of a state space depends on the machine: it may
    # return a frequency where the gain is 0.67. It evaluates the state space on our frequencies.
    system = gain.state_space()
    factor, margin, *_ = control.stability_margins(control.frd(system, omega))
    if math.isfinite(found.gain):
        assert factor == pytest.approx(found.gain, rel=1e-3)
    assert margin == pytest.approx(found.phase, abs=0.2)
    disk, _, _ = control.disk_margins(system, omega)
    assert found.disk == pytest.approx(float(disk), rel=1e-3)
    assert found.stable


def test_a_closed_state_space_has_the_steady_gain_and_no_integrators() -> None:
    loop, par = of("moment")
    model = loop.closed(par, loop.at.default)
    system = model.state_space()
    assert float(system.dcgain()) == pytest.approx(1.0, abs=1e-9)
    assert np.abs(system.poles()).max() < 0.999 < np.abs(model.poles()).max()


@pytest.mark.parametrize("name", ["moment", "pressure"])
def test_the_gain_margin_is_where_the_loop_becomes_unstable(name: str) -> None:
    loop, par = of(name)
    factor = margins(loop, par, loop.at.default).gain
    gain = loop.gain(par, loop.at.default)
    for scale, stable in ((0.98, True), (1.02, False)):
        closed = replace(gain, A=gain.A - scale * factor * gain.B @ gain.C)
        assert closed.is_stable == stable


def test_worst_case_over_the_friction_coefficient() -> None:
    loop, par = of("moment")
    values = [0.2, 0.35, 0.6]
    found = worst(over(loop, par, 200.0, "wedge.mu_B", values), values)
    assert found["phase"][1] == 0.6
    assert found["bandwidth"][1] == 0.2
    with pytest.raises(UnknownNameError, match=r"wedge\.mu_B"):
        over(loop, par, 200.0, "wedge.mu_b", values)


def test_operating_points_that_do_not_exist() -> None:
    loop, par = of("moment")
    with raises(ParameterError, name="moment", value="5000 N*m", valid="wedge.x_stop"):
        loop.closed(par, 5e3)
    weak = par.replace({"drive.i_max": 0.2, "wedge.mu_B": 0.2})
    with raises(ParameterError, name="moment", value="900 N*m", valid="drive.i_max"):
        loop.closed(weak, 900.0)
    for value in (0.0, -100.0):
        with pytest.raises(ParameterError, match="must be > 0"):
            loop.closed(par, value)
    with raises(ParameterError, name="flywheel.Omega_0"):
        loop.closed(par.replace({"flywheel.Omega_0": 0.0}), 200.0)
    position, par = of("position")
    with raises(ParameterError, name="wedge travel", value="2 mm"):
        position.closed(par, 2e-3)
    pressure, par = of("pressure")
    with pytest.raises(ParameterError):
        pressure.closed(par, 900e5)


def test_both_directions_of_rotation_have_the_same_margins() -> None:
    loop, par = of("moment")
    forward, backward = (
        margins(loop, par.replace({"flywheel.Omega_0": speed}), 200.0) for speed in (60.0, -60.0)
    )
    for one, other in zip(astuple(forward), astuple(backward), strict=True):
        # NaN: no smaller gain makes it unstable, so that there is no frequency at which one does.
        assert one == pytest.approx(other, rel=1e-6, nan_ok=True)


def test_an_unstable_loop_has_no_margins_and_is_the_worst_case() -> None:
    loop, par = of("position")
    values = [60.0, 400.0]
    found = over(loop, par, 0.0, "control.position.f_n", values)
    assert [one.stable for one in found] == [True, False]
    assert all(math.isnan(v) for v in astuple(found[1]) if isinstance(v, float))
    assert all(at == 400.0 for _, at in worst(found, values).values())


@pytest.mark.parametrize("name", ["pressure", "moment", "screw-position"])
def test_gain_and_closed_loop_of_one_plant_are_those_of_two(name):
    loop = LOOPS.find(name)
    par = parameters(main_set(loop.assembly))
    pair = loop.gain_and_closed(par, loop.at.default)
    apart = loop.gain(par, loop.at.default), loop.closed(par, loop.at.default)
    for one, two in zip(pair, apart, strict=True):
        assert one.name == two.name
        assert all(np.array_equal(getattr(one, m), getattr(two, m)) for m in "ABCD")
