"""Design of the dither: torque at the shaft, friction, cost and active limits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bywire.brakes.motorcycle.dither import (
    Trial,
    admissible_frequencies,
    area_ratios,
    attenuation,
    best_of,
    breakaway_torques,
    candidates,
    crossing,
    dead_band,
    least,
    needed_gain,
    reach,
    tried,
    waveform,
)
from bywire.brakes.motorcycle.studies import dither
from bywire.control.dither import breakaway_current
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import ParameterError
from bywire.report.range_figures import contour
from raising import raises

PAR = PARAMETER_SETS.find("dardanelli2010").parameters()
SHORT = Trial(settle=2.0, window=0.5)
LIMITS = {
    "stuck": 0.1,
    "band": 0.05,
    "ripple_caliper": 2.0,
    "current_share": 1.0,
    "duty_share": 1.0,
}


def figures(stuck, ripple, copper):
    """Return artificial figures over gains and frequencies."""
    shape = np.shape(stuck)
    zero = np.zeros(shape)
    return {
        "stuck": np.array(stuck),
        "band": zero,
        "ripple_caliper": np.array(ripple),
        "copper": np.array(copper),
        "current_share": zero,
        "duty_share": zero,
    }


def test_the_least_gain_is_enough_from_there_on_upward() -> None:
    gains = np.array([1.0, 2.0, 3.0, 4.0])
    assert crossing(gains, np.array([0.05, 0.6, 0.2, 0.0]), 0.1) == pytest.approx(3.5)
    assert crossing(gains, np.array([0.05, 0.0, 0.0, 0.0]), 0.1) == 1.0
    assert math.isnan(crossing(gains, np.array([0.0, 0.0, 0.0, 0.2]), 0.1))
    assert math.isnan(crossing(gains, np.array([0.0, 0.0, 0.0, math.nan]), 0.1))
    one = figures([1.0, 0.3, 0.0, 0.0], [0.0, 1.0, 2.0, 4.0], [1.0, 2.0, 4.0, 8.0])
    one["band"] = np.array([1.0, 1.0, 0.0, 0.0])
    found = least(gains, one, LIMITS)
    assert (found.binding, found.exceeded) == ("band", ())
    assert found.gain == pytest.approx(2.95)
    assert found.figures["copper"] == pytest.approx(3.9)


def test_the_cheapest_frequency_within_all_limits_is_chosen() -> None:
    """Four candidates: cheap with too much vibration, expensive, cheap, and insufficient."""
    gains = np.array([1.0, 2.0])
    stuck = [[0.5, 0.5, 0.5, 1.0], [0.0, 0.0, 0.0, 1.0]]
    ripple = [[3.0, 0.1, 0.1, 0.0], [3.0, 0.2, 0.2, 0.0]]
    copper = [[0.1, 5.0, 2.0, 0.1], [0.2, 6.0, 3.0, 0.1]]
    low = figures(stuck, ripple, copper)
    high = figures(np.array(stuck) * 0.5, ripple, copper)
    found = candidates(gains, [high, low], LIMITS)
    assert best_of(found) == 2
    assert found[2].gain == pytest.approx(1.8)
    assert found[2].decisive == 1
    assert found[0].verdict == "ripple at the caliper"
    assert "too low" in found[3].verdict
    assert best_of(found[3:]) is None


def test_periods_hold_even_numbers_of_samples() -> None:
    found = admissible_frequencies(PAR, 20.0, 100.0, 8)
    counts = [1.0 / (f * PAR.ecu.T_s) for f in found]
    assert counts == pytest.approx([2 * round(n / 2) for n in counts])
    assert 50.0 in [pytest.approx(f) for f in found]
    with raises(ParameterError, name="f_min"):
        admissible_frequencies(PAR, 51.0, 55.0, 3)


@pytest.mark.parametrize("place", ["after-dither", "before-dither"])
def test_what_reaches_the_shaft(place) -> None:
    own = PAR.replace({"ecu.filter.place": place})
    gain = abs(attenuation(own, np.array([50.0]), 20e5)[0])
    assert reach(own, 50.0, 20e5) == pytest.approx(gain, rel=1e-5)
    square = own.replace({"ecu.dither.waveform": "square"})
    assert reach(square, 100.0, 20e5) > reach(own, 100.0, 20e5)
    triangle = waveform(own.replace({"ecu.dither.waveform": "triangle"}), 50.0)
    assert triangle[:6] == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])


def test_the_law_is_that_of_the_paper_but_for_efficiency_and_attenuation() -> None:
    """Equal friction in both directions: (18) and (19) divided by efficiency and transmission."""
    even = {"seal.f_cfr_n": PAR.seal.f_cfr_p, "seal.k_brk_n": PAR.seal.k_brk_p}
    own = PAR.replace(even)
    assert breakaway_torques(own, 20e5)[0] == pytest.approx(2.6 * (2e-3 + 1.6e-8 * 20e5))
    expected = 1.0 / (PAR.gear.eta_g * reach(PAR, 50.0, 20e5))
    assert needed_gain(own, 50.0, 20e5) == pytest.approx(expected)
    current = breakaway_current(20e5, PAR.ecu.est_par)
    assert dead_band(own, 20e5) == pytest.approx(2.0 * current / PAR.gear.eta_g)


@pytest.mark.parametrize("f", [125.0 / 3.0, 62.5])
def test_friction_gives_way_where_linear_models_say(f) -> None:
    needed = needed_gain(PAR, f, 20e5)
    found = tried(PAR, 20e5, (0.6 * needed, 1.5 * needed), (f,), SHORT)
    assert found["stuck"][0, 0] > 0.9
    assert found["stuck"][1, 0] < 0.1
    assert found["band"][1, 0] < 0.01
    amplitude = 0.6 * needed * breakaway_current(20e5, PAR.ecu.est_par) * reach(PAR, f, 20e5)
    copper = 0.5 * PAR.motor.R_m * amplitude**2
    assert found["copper"][0, 0] == pytest.approx(copper, rel=0.06)
    # Without inertia of the fluid, nearly all vibration at the sensor reaches the caliper.
    assert found["ripple_caliper"][1, 0] == pytest.approx(found["ripple_sensor"][1, 0], rel=0.15)


def test_dither_shrinks_the_loop_of_the_ramp() -> None:
    paper, weak = area_ratios(PAR, [(1.0, 50.0), (0.3, 50.0)])
    assert paper == pytest.approx(0.143, abs=0.01)  # as in the reproduction of Fig. 5
    assert weak > 0.9


SMALL = dither.STUDY.defaults.replace(
    {
        "pressures": (20e5,),
        "gains": 4,
        "gain_min": 0.75,
        "gain_max": 1.5,
        "frequencies": 3,
        "f_min": 40.0,
        "f_max": 65.0,
        "settle": 2.0,
        "compare": "none",
    }
)


def test_a_small_study_finds_a_dither_that_holds_on_the_bench() -> None:
    found = dither.compute(PAR, SMALL, lambda label, share: None)
    kpis = {one.name: one.value for one in found.kpis}
    assert kpis["optimum_stuck"] == pytest.approx(SMALL.stuck_max, abs=0.02)
    assert kpis["optimum_copper"] < 1.05 * kpis["given_copper"]
    assert kpis["given_gain"] == 1.0
    assert 0.7 < kpis["given_plant_gain"] / 10.1e5 < 0.8
    assert any("stuck at 20 bar" in text for text in found.limits)
    row = found.cuts[1].data.isel(pressure=0)
    assert float(row["torque"]) == pytest.approx(float(row["breakaway"]), rel=0.1)  # eq. (18)
    assert set(found.data.dims) == {"pressure", "gain", "frequency"}
    for shown in found.maps.values():
        assert contour(found.data, shown).axes


def test_what_no_dither_can_do_is_said() -> None:
    small = SMALL.replace({"ripple_max": 1e2})
    found = dither.compute(PAR, small, lambda label, share: None)
    assert "ripple at the caliper" in found.warnings[0]
    assert "optimum_gain" not in {one.name for one in found.kpis}
    with raises(ParameterError, name="pressures", valid="< "):
        dither.compute(PAR, SMALL.replace({"pressures": (50e5,)}), lambda label, share: None)
    with pytest.raises(ParameterError, match="approach = 2 bar"):
        SMALL.replace({"pressures": (1e5,)})
