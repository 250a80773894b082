"""Sizing studies: designs beside the bench, closed forms, limits, and the optimum."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.api.study import StudyResult
from bywire.brakes.motorcycle.studies import actuator_sizing
from bywire.brakes.wedge.studies import drive_train
from bywire.brakes.wedge.studies.drive_train import Demand, answer, closing_speed, redesigned
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import ParameterError
from bywire.core.model import ASSEMBLIES
from bywire.plant import roller_screw, seal_friction
from bywire.report.range_figures import contour, levels_between
from bywire.synthesis.study import STUDIES, Map, Mark
from run_once import run_once

WEDGE = PARAMETER_SETS.find("roberts2003").parameters().replace({"control.moment.omega_gap": 60.0})
MOTORCYCLE = PARAMETER_SETS.find("dardanelli2010").parameters()
MU = (0.25, 0.35, 0.45)


def silent(label: str, share: float) -> None:
    """Show no progress."""


def test_every_study_sizes_an_assembly_that_there_is() -> None:
    ours = ("motorcycle", "two_wheeler", "wedge")  # other tests may have loaded more brakes
    sized = [one.assembly for name in ours for one in STUDIES.of(f"bywire.brakes.{name}").values()]
    assert set(sized) == {"wedge-brake", "motorcycle-brake"}
    assert set(sized) <= set(ASSEMBLIES.all())


def test_a_design_answers_as_it_does_on_the_bench() -> None:
    demand = Demand(
        950.0, 0.1, 0.2, 0.3, (0.35,), known=True, enforced=False, whole=True, phases=(0.0,)
    )
    found = answer(WEDGE, demand)
    bench = bywire.Bench("moment-pulse-950", "roberts2003", record=2e-4)
    kpis = {one.name: one.value for one in run_once(bench).kpis}
    assert found.t_90[0] == pytest.approx(kpis["time_to_90"], rel=1e-3)
    assert found.filtered[0] == pytest.approx(kpis["peak_power_filtered"], rel=0.01)
    assert found.speed[0] == pytest.approx(kpis["peak_speed"], rel=0.02)
    assert found.closing_speed == pytest.approx(closing_speed(WEDGE))
    anywhere = answer(WEDGE, replace(demand, phases=(0.0, 2.0)))
    assert (anywhere.filtered >= found.filtered).all()
    assert (anywhere.held <= found.held).all()


def test_a_redesign_keeps_the_pads_speed_and_tells_the_controller() -> None:
    own = redesigned(WEDGE, 0.3, 3e-3)
    k = 3e-3 / (2.0 * math.pi)
    assert closing_speed(own) == pytest.approx(closing_speed(WEDGE))
    believed = 2.0 * own.wedge.mu_B * own.caliper.r_B * own.caliper.K_cal * 0.3 * k
    assert own.control.moment.slope_hat == pytest.approx(believed)
    assert own.control.offset.k_hat == pytest.approx(k)
    assert math.tan(own.wedge.alpha) * own.wedge.x_stop == pytest.approx(
        math.tan(WEDGE.wedge.alpha) * WEDGE.wedge.x_stop
    )
    same = redesigned(WEDGE, math.tan(WEDGE.wedge.alpha), WEDGE.screw.lead)
    before = WEDGE.leaves()
    assert same.leaves() == pytest.approx(before)


@pytest.mark.parametrize("lead", [1.5e-3, 4e-3, 8e-3])
def test_the_screws_friction_angle_stays_over_the_lead(lead) -> None:
    """The torque of its friction by the axial force does not know the lead, either way."""
    screw = redesigned(WEDGE, 0.3, lead).screw
    for force in (-1000.0, 1000.0):
        load = roller_screw.Input(force=force, torque=0.0)
        assert tuple(roller_screw.friction(load, screw)) == pytest.approx(
            tuple(roller_screw.friction(load, WEDGE.screw))
        )
    # The law of sliding friction in a thread of 16 mm, without the approximation of small angles.
    lead_angle = lambda length: math.atan(length / (math.pi * 16e-3))  # noqa: E731
    given = lead_angle(WEDGE.screw.lead)
    friction_angle = math.atan(math.tan(given) / WEDGE.screw.eta_f) - given
    here = lead_angle(lead)
    assert screw.eta_f == pytest.approx(math.tan(here) / math.tan(here + friction_angle), rel=0.03)


def test_a_screw_of_little_lead_locks_itself_and_the_efficiency_may_stay() -> None:
    assert redesigned(WEDGE, 0.3, 1e-3).screw.eta_b == 0.0
    kept = redesigned(WEDGE, 0.3, 1e-3, "as-given").screw
    assert (kept.eta_f, kept.eta_b) == (WEDGE.screw.eta_f, WEDGE.screw.eta_b)


@pytest.mark.parametrize(("tan_alpha", "lead"), [(0.364, 2e-3), (0.3, 4e-3)])
def test_the_slowest_case_meets_the_time_and_not_more(tan_alpha, lead) -> None:
    found = answer(redesigned(WEDGE, tan_alpha, lead), Demand(950.0, 0.1, 0.2, 0.2, MU, True, True))
    assert found.t_90.max() == pytest.approx(0.1, rel=0.01)
    assert found.t_90.argmax() == 0  # little friction takes the largest normal force
    assert (np.diff(found.t_90) < 0).all()
    # The pads travel 0.66 mm until then: clearance and the caliper at 0.9 of 15.2 kN.
    assert found.closing_speed > (0.2e-3 + 0.9 * 15.2e3 / 30e6) / 0.1


def test_a_small_drive_train_study_marks_what_is_infeasible(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(drive_train, "_ROUNDS", 1)
    options = drive_train.STUDY.defaults.replace(
        {"slopes": 3, "leads": 3, "tan_alpha_max": 0.45, "mu_B": MU[::2]}
    )
    found = drive_train.compute(WEDGE, options, silent)
    kpis = {one.name: one.value for one in found.kpis}
    data, worst = found.data, found.data["worst_filtered"]
    assert (np.isnan(worst) == (data["infeasible"] == 1)).all()
    # 3040 N on one screw of 8 mm lead and 88 % efficiency would take 44 A.
    weak = data.sel(tan_alpha=0.45, lead=8e-3)
    assert float(weak["infeasible"]) == 1
    assert float(weak["held"].min()) < 0.9 * options.moment
    assert float(weak["current"].max()) == pytest.approx(WEDGE.control.position.i_max)
    assert kpis["optimum_power"] <= float(worst.min()) < kpis["given_power"]
    assert kpis["optimum_t_90"] <= 1.02 * options.t_90
    labels = [
        text.get_text()
        for text in contour(data, found.maps["filtered"]).axes[0].get_legend().get_texts()
    ]
    assert labels == ["infeasible", "optimum", "given drive train"]


def test_a_response_that_no_design_reaches_gives_no_optimum() -> None:
    options = drive_train.STUDY.defaults.replace(
        {"slopes": 3, "leads": 3, "mu_B": (0.35,), "t_90": 0.02}
    )
    found = drive_train.compute(WEDGE, options, silent)
    assert not found.maps
    assert any("no design is feasible" in text for text in found.warnings)
    shown = StudyResult(drive_train.STUDY, "roberts2003", WEDGE, options, found)
    assert "No design is feasible" in shown.document().banner.text


@pytest.mark.parametrize("kind", ["sine", "step"])
def test_the_wanted_pressure_and_its_derivatives_belong_together(kind) -> None:
    wanted = (
        actuator_sizing.sine(MOTORCYCLE, 37e5, 3e5, 10.0)
        if kind == "sine"
        else actuator_sizing.step(MOTORCYCLE, 6e5, 37e5, 10.0)
    )
    inner = slice(2, -2)
    for value, rate in ((wanted.p, wanted.rate), (wanted.rate, wanted.bend)):
        slope = np.gradient(value, wanted.t)
        np.testing.assert_allclose(slope[inner], rate[inner], atol=2e-3 * np.abs(rate).max())
    lag = actuator_sizing._lag(MOTORCYCLE, wanted.middle)
    filled = lag * np.gradient(wanted.p_pd, wanted.t)
    error = filled - (wanted.p - wanted.p_pd)
    assert np.abs(error[inner]).max() < 2e-3 * np.abs(filled).max()
    assert wanted.p.max() == pytest.approx(37e5, rel=1e-3)


def test_a_double_pole_has_the_bandwidth_that_is_asked_for() -> None:
    wanted = actuator_sizing.step(MOTORCYCLE, 0.0, 1e5, 10.0)
    fine = np.linspace(0.0, wanted.t[-1], 20001)
    rate = np.interp(fine, wanted.t, wanted.rate) / 1e5  # the impulse response
    gain = abs(np.trapezoid(rate * np.exp(-2j * np.pi * 10.0 * fine), fine))
    assert 20.0 * math.log10(gain) == pytest.approx(-3.01, abs=0.02)


def test_seals_keep_their_force_at_the_piston_when_the_gear_changes() -> None:
    other = actuator_sizing.geared(MOTORCYCLE, 2.0 * MOTORCYCLE.gear.k_g)
    for v in (0.0, 1e-5, 1e-2):
        forces = [
            np.array(seal_friction.output(seal_friction.Input(v / k, 3e6), par.seal)) / k
            for par, k in ((MOTORCYCLE, MOTORCYCLE.gear.k_g), (other, other.gear.k_g))
        ]
        np.testing.assert_allclose(*forces)


def test_the_calculation_agrees_with_the_bench_where_nothing_rubs() -> None:
    smooth = MOTORCYCLE.replace(
        {"seal.T_pr": 0.0, "seal.f_cfr_p": 0.0, "seal.f_cfr_n": 0.0, "adc.law": "ideal"}
    )
    for k_g in (2e-4, 4e-4):
        found = actuator_sizing.sine_figures(
            "x", actuator_sizing.geared(smooth, k_g), 30e5, 3e5, 10.0
        )
        kpis = {one.name: one.value for one in found}
        assert kpis["x_bench_amplitude"] == pytest.approx(3e5, rel=0.01)
        for name in ("current", "speed", "power"):
            assert kpis[f"x_bench_{name}"] == pytest.approx(1.0, abs=0.02)


def test_the_best_gear_ratio_is_a_minimum_and_limits_bind_where_they_say() -> None:
    options = actuator_sizing.STUDY.defaults
    found = actuator_sizing.compute(MOTORCYCLE, options, silent)
    kpis = {one.name: one.value for one in found.kpis}

    def power(k_g: float) -> float:
        own = actuator_sizing.geared(MOTORCYCLE, k_g)
        wanted = actuator_sizing.course(own, options, 10.0)
        return float(actuator_sizing.motion(own, wanted).electrical.max())

    best = kpis["optimum_k_g"]
    assert power(best) == pytest.approx(kpis["optimum_electrical"])
    assert power(best) < min(power(0.97 * best), power(1.03 * best))
    assert np.abs(best / found.data["k_g"].values - 1.0).min() < 0.06
    for kind in ("sine", "step"):
        own = actuator_sizing._at(MOTORCYCLE, options, kpis[f"given_fastest_{kind}"], kind)
        assert max(own["current_share"], own["voltage_share"]) == pytest.approx(1.0, rel=1e-6)
    # On the bench with friction: sticking distorts the sine, more so at large ratios.
    for label in ("optimum", "given"):
        for name in ("current", "speed", "power"):
            assert kpis[f"{label}_bench_{name}"] == pytest.approx(1.0, abs=0.1)


def test_more_inertia_wants_a_larger_ratio_and_more_pressure_a_smaller_one() -> None:
    options = actuator_sizing.STUDY.defaults

    def best(par, **changes):
        return actuator_sizing._best_ratio(par, options.replace(changes))

    usual = best(MOTORCYCLE)
    assert best(MOTORCYCLE.replace({"gear.J_mot": 2.0 * MOTORCYCLE.gear.J_mot})) > 1.1 * usual
    assert best(MOTORCYCLE, p_peak=50e5) < 0.95 * usual
    assert best(MOTORCYCLE, amplitude=1e5) < 0.8 * usual


def test_a_map_without_numbers_is_refused_and_marks_outside_are_left_out() -> None:
    options = actuator_sizing.STUDY.defaults.replace({"ratios": 3, "frequencies": 3})
    data = actuator_sizing.compute(MOTORCYCLE, options, silent).data
    shown = Map("electrical", "k_g", "frequency", "", (Mark("far away", 1.0, 10.0),))
    assert contour(data, shown).axes[0].get_legend() is None
    with pytest.raises(ParameterError, match="no finite value"):
        contour(data.assign(electrical=data["electrical"] * np.nan), shown)


def test_the_colors_of_a_share_end_at_0_and_1() -> None:
    def laid(values, dims, label):
        return xr.DataArray(values, dims=dims, attrs={"units": "1", "long_name": label})

    x = np.linspace(0.0, 1.0, 5)
    share = np.clip(np.add.outer(x, x) - 0.5, 0.0, 1.0 + 4e-16)
    axes = {name: laid(x, (name,), name) for name in ("x", "y")}
    data = xr.Dataset({"stuck": laid(share, ("y", "x"), "stuck")}, axes)
    bar = contour(data, Map("stuck", "x", "y", "")).axes[1]
    assert bar.get_ylim() == (0.0, 1.0)
    assert len(bar.patches) == 0  # no arrow of what lies beyond


@pytest.mark.parametrize(("low", "high"), [(57.0, 380.0), (5.0, 9.0), (-3.0, 3.0), (1.0, 1.0)])
def test_levels_are_few_and_rise(low, high) -> None:
    levels = levels_between(low, high)
    assert 3 <= len(levels) <= 14
    assert (np.diff(levels) > 0).all()
