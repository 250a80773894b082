"""Inverse dynamics and output error on the servo axis of the examples."""

from __future__ import annotations

import importlib.util
import runpy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.data.writing import write_measurement
from bywire.identification import (
    Equation,
    Estimate,
    differentiated,
    estimate,
    initial_states,
    inverse_dynamics,
    multistart,
    output_error,
    parameters_of,
    predict,
    trial,
)
from bywire.identification.estimate import as_object
from bywire.identification.least_squares import Loss
from bywire.identification.output_error import even_interval
from bywire.identification.unknown import Unknown

FILE = Path(__file__).parents[2] / "examples" / "identify_servo_axis.py"


@pytest.fixture(scope="module")
def axis() -> ModuleType:
    spec = importlib.util.spec_from_file_location("identify_servo_axis", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def data(axis: ModuleType) -> xr.Dataset:
    return axis.measured()


def equation(axis: ModuleType) -> Equation:
    return Equation(axis.ServoAxis(), "omega", "alpha", slowest=0.5)


def moving(data: xr.Dataset) -> xr.Dataset:
    return differentiated(data, "theta", ("omega", "alpha"), cutoff=100.0, held=["v"])


def test_inverse_dynamics_equal_a_plain_regression(axis: ModuleType, data: xr.Dataset) -> None:
    """Without decimation: numpy's least squares on the equation written out by hand."""
    known = axis.TRUTH.replace({"J": 0.01, "d_p": 0.0})
    motion = moving(data)
    found = inverse_dynamics(equation(axis), known, parameters_of(known, axis.NAMES), motion)
    w, a, v = (motion[k].values for k in ("omega", "alpha", "v"))
    rows = np.abs(w) > 0.5
    up, down = w > 0, w < 0
    W = np.column_stack((a, w * up, w * down, 1.0 * up, -1.0 * down))[rows]
    wanted = np.linalg.lstsq(W, (v - known.offset)[rows], rcond=None)[0]
    inside = [axis.NAMES.index(n) for n in ("J", "d_p", "d_n", "T_p", "T_n")]
    # One neighboring sample next to each reversal is left out by the product.
    np.testing.assert_allclose(found.values[inside], wanted, rtol=3e-3)
    mask = _kept(w)
    W = np.column_stack((a, w * up, w * down, 1.0 * up, -1.0 * down))[mask]
    wanted = np.linalg.lstsq(W, (v - known.offset)[mask], rcond=None)[0]
    np.testing.assert_allclose(found.values[inside], wanted, rtol=1e-6)


def _kept(w: np.ndarray) -> np.ndarray:
    return np.abs(w) > 0.5


def test_offset_and_both_dry_frictions_are_only_told_together(
    axis: ModuleType, data: xr.Dataset
) -> None:
    names = (*axis.NAMES, "offset")
    with pytest.raises(ParameterError, match=r"only a combination of T_p, T_n, offset"):
        inverse_dynamics(equation(axis), axis.TRUTH, parameters_of(axis.TRUTH, names), moving(data))


def test_a_body_that_hardly_moves_tells_nothing(axis: ModuleType, data: xr.Dataset) -> None:
    still = data.assign(theta=data["theta"] * 1e-6)
    with pytest.raises(ParameterError, match="too few for 5 unknowns"):
        inverse_dynamics(
            equation(axis), axis.TRUTH, parameters_of(axis.TRUTH, axis.NAMES), moving(still)
        )


def test_a_missing_signal_is_named(axis: ModuleType, data: xr.Dataset) -> None:
    lost = moving(data).rename({"v": "voltage"})
    with pytest.raises(UnknownNameError, match="'v'"):
        inverse_dynamics(equation(axis), axis.TRUTH, parameters_of(axis.TRUTH, axis.NAMES), lost)


def test_instruments_take_away_the_bias_of_noise(axis: ModuleType) -> None:
    """Coarse angle: noise in the acceleration biases the inertia; simulated instruments do not."""
    names, truth = ("J", "d_p", "d_n", "T_p", "T_n"), axis.TRUTH
    clean = axis.measured(seed=0, noise=0.0)
    plain, helped = [], []
    for seed in range(8):
        noisy = axis.measured(seed=seed, noise=3e-3)
        seen, ideal = (
            differentiated(d, "theta", ("omega", "alpha"), 120.0, ["v"]) for d in (noisy, clean)
        )
        unknowns = parameters_of(truth, names)
        arguments = (equation(axis), truth, unknowns, seen)
        plain.append(inverse_dynamics(*arguments, bandwidth=60.0)["J"])
        helped.append(inverse_dynamics(*arguments, bandwidth=60.0, instruments=ideal)["J"])
    bias = [abs(np.mean(v) / truth.J - 1.0) for v in (plain, helped)]
    assert bias[0] > 0.02
    assert bias[1] < 0.2 * bias[0]


def test_the_example_says_what_noise_does_to_its_first_step(
    axis: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """On a record of its own; parameters other than the example's are no failure."""
    data, file = axis.measured(seed=3, noise=3e-3), tmp_path / "axis.csv"
    table = data.assign(v=1.5 * data["v"]).to_dataframe()[["theta", "v"]]
    table.to_csv(file, header=["theta [rad]", "v [V]"], index_label="time [s]")
    monkeypatch.setattr("sys.argv", [str(FILE), str(file)])
    runpy.run_path(str(FILE), run_name="__main__")
    said = capsys.readouterr().out
    assert "J: noise biases inverse dynamics" in said
    assert "does not explain" not in said
    assert "residual angle: 0.003 rad" in said


def test_with_instruments_both_criteria_agree(axis: ModuleType) -> None:
    first, second, third = axis.identified(axis.measured(seed=1, noise=3e-3))
    assert axis.apart(first, second) == ["J"]
    assert axis.apart(third, second) == []
    assert abs(third["J"] - axis.TRUTH.J) < 3.5 * third.deviations[third.names.index("J")]


def test_weights_count_samples_by_their_noise(axis: ModuleType) -> None:
    """A stretch that is measured badly hardly counts; left alone it spoils the estimate."""
    data = axis.measured()
    spoiled = data["v"].values.copy()
    bad = slice(4000, 6000)
    spoiled[bad] += np.random.default_rng(1).normal(0.0, 3.0, 2000) + 1.0
    motion = moving(data.assign(v=("time", spoiled)))
    weights = np.ones(data.sizes["time"])
    weights[bad] = 1e-4
    unknowns = parameters_of(axis.TRUTH, axis.NAMES)
    plain, weighted = (
        inverse_dynamics(equation(axis), axis.TRUTH, unknowns, motion, weights=w)
        for w in (None, weights)
    )
    error = [abs(found["T_p"] - axis.TRUTH.T_p) for found in (plain, weighted)]
    assert error[0] > 0.1
    assert error[1] < 0.02


def test_output_error_recovers_parameters_and_the_start(axis: ModuleType, data: xr.Dataset) -> None:
    known = axis.TRUTH.replace({"J": 0.03, "d_p": 0.03, "d_n": 0.1, "T_p": 0.4, "T_n": 0.6})
    bench = trial(axis.ServoAxis(), known, data, {"v": "v"}, {"theta": 1e-4})
    unknowns = parameters_of(known, axis.NAMES) + initial_states(bench, ["theta"])
    found = estimate(output_error([bench], unknowns))
    truth = np.array([getattr(axis.TRUTH, n) for n in axis.NAMES] + [0.0])
    assert np.all(np.abs(found.values - truth) < 4.0 * found.deviations)
    assert found.rms == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("loss", ["linear", "soft_l1"])
def test_the_share_of_the_step_is_what_smaller_steps_change(
    axis: ModuleType, data: xr.Dataset, loss: Loss
) -> None:
    """To first order: 1 ms, against 20 us."""

    def fit(step: float) -> Estimate:
        record = data.isel(time=slice(0, 3000))
        bench = trial(axis.ServoAxis(), axis.TRUTH, record, {"v": "v"}, {"theta": 1e-4}, step=step)
        return estimate(output_error([bench], parameters_of(axis.TRUTH, axis.NAMES)), loss)

    coarse, fine = fit(1e-3), fit(20e-6)
    assert coarse.step_errors is not None
    assert fine.step_errors is not None
    changed = np.abs(coarse.values - fine.values)
    clear = changed > 0.2 * coarse.deviations
    assert clear.sum() >= 2
    ratios = coarse.step_errors[clear] / changed[clear]
    assert np.all((ratios > 0.6) & (ratios < 1.6)), ratios
    assert np.all(fine.step_errors < 0.2 * fine.deviations)
    rows = as_object(coarse)["parameters"]
    assert rows["J"]["step_error"] == coarse.step_errors[coarse.names.index("J")]


def test_where_nothing_is_simulated_no_share_of_a_step_is_given(
    axis: ModuleType, data: xr.Dataset
) -> None:
    unknowns = parameters_of(axis.TRUTH, ["J", "T_p"])
    found = inverse_dynamics(equation(axis), axis.TRUTH, unknowns, moving(data))
    assert found.step_errors is None
    assert "step_error" not in as_object(found)["parameters"]["J"]


def test_trials_share_parameters_and_keep_their_own_offsets(
    axis: ModuleType, data: xr.Dataset
) -> None:
    """Two records whose angle sensors were zeroed differently."""
    shift = {"first": 0.3, "second": -0.2}
    parts = {"first": data.isel(time=slice(0, 3000)), "second": data.isel(time=slice(0, 4000))}
    trials = [
        trial(
            axis.ServoAxis(),
            axis.TRUTH,
            part.assign(theta=part["theta"] + shift[k]),
            {"v": "v"},
            {"theta": 1e-4},
            label=k,
            state=axis.State(0.0, 0.0),
        )
        for k, part in parts.items()
    ]
    unknowns = parameters_of(axis.TRUTH, ["J", "T_p"], starts={"J": 0.025})
    unknowns += tuple(Unknown("offset.theta", 0.0, scale=0.1, trial=k) for k in parts)
    found = estimate(output_error(trials, unknowns))
    assert found["J"] == pytest.approx(0.02, rel=1e-4)
    # An offset of the sensor: what the model shows and the record does not.
    assert found["first:offset.theta"] == pytest.approx(0.3, abs=1e-4)
    assert found["second:offset.theta"] == pytest.approx(-0.2, abs=1e-4)


def test_a_wrong_model_is_found_out(axis: ModuleType, data: xr.Dataset) -> None:
    """Friction taken as the same both ways: the residuals say that something is missing."""
    bench = trial(
        axis.ServoAxis(), axis.TRUTH.replace({"T_n": 0.6}), data, {"v": "v"}, {"theta": 1e-4}
    )
    found = estimate(output_error([bench], parameters_of(axis.TRUTH, ["J", "d_p", "d_n"])))
    assert found.colored
    assert found.rms > 5.0


def test_uneven_time_is_refused(axis: ModuleType, data: xr.Dataset) -> None:
    holes = data.isel(time=np.r_[0:100, 120:400])
    with pytest.raises(ParameterError, match="not evenly spaced"):
        trial(axis.ServoAxis(), axis.TRUTH, holes, {"v": "v"}, {"theta": 1e-4})


def test_a_clock_that_jitters_by_a_few_nanoseconds_is_even(
    axis: ModuleType, data: xr.Dataset
) -> None:
    """24 ns at 1 kHz: the step is 1 ms, which the model's steps divide."""
    jitter = np.random.default_rng(0).uniform(-24e-9, 24e-9, data.sizes["time"])
    moved = data.assign_coords(time=data["time"].values + jitter)
    bench = trial(axis.ServoAxis(), axis.TRUTH, moved, {"v": "v"}, {"theta": 1e-4})
    assert bench.run.record == 1e-3
    found = estimate(output_error([bench], parameters_of(axis.TRUTH, ["J"])))
    assert found["J"] == pytest.approx(axis.TRUTH.J, rel=1e-4)
    assert even_interval(np.arange(500) / 3000.0) == pytest.approx(1.0 / 3000.0, rel=1e-8)
    with pytest.raises(ParameterError, match=r"by more than 0\.001 of the step"):
        even_interval(data["time"].values + 1e3 * jitter)


def test_a_voltage_that_was_read_and_not_set_acts_when_it_did(axis: ModuleType) -> None:
    """A smooth voltage, read every 5 ms: held, it acts 2.5 ms late, which biases the inertia."""
    fine = axis.TRUTH.replace({"T_s": 1e-4, "T_p": 0.0, "T_n": 0.0, "d_n": 0.05})
    v = lambda t: 4.0 * np.sin(2 * np.pi * 4.0 * t) + 3.0 * np.sin(2 * np.pi * 1.3 * t)  # noqa: E731
    rest = axis.State(0.0, 0.0)
    run = bywire.Run(
        axis.ServoAxis(), fine, rest, axis.Voltage(0.0), lambda t: v(t)[:, None], 4.0, record=5e-3
    )
    theta = bywire.simulate(run)["theta"]
    t = 5e-3 * np.arange(theta.size)
    data = xr.Dataset({"theta": ("time", theta), "v": ("time", v(t))}, {"time": t})
    coarse = fine.replace({"T_s": 5e-3})
    bias = {}
    for between in ("held", "linear"):
        bench = trial(
            axis.ServoAxis(), coarse, data, {"v": "v"}, {"theta": 1e-4}, state=rest, between=between
        )
        fit = estimate(output_error([bench], parameters_of(coarse, ["J", "d_p", "d_n"])))
        bias[between] = abs(fit["J"] / fine.J - 1.0)
    assert bias["linear"] < 2e-3
    assert bias["held"] > 5.0 * bias["linear"]


def test_what_an_equation_leaves_has_its_unit(axis: ModuleType) -> None:
    """Noise of the voltage alone: the equation leaves it, in volts."""
    problem = Equation(axis.ServoAxis(), "omega", "alpha", slowest=0.5, unit="V")
    motion = moving(axis.measured(noise=0.0))
    motion["v"] = motion["v"] + np.random.default_rng(2).normal(0.0, 0.05, motion["v"].size)
    found = inverse_dynamics(problem, axis.TRUTH, parameters_of(axis.TRUTH, axis.NAMES), motion)
    (left,) = found.leftovers()
    assert (left.label, left.unit) == ("equation of omega", "V")
    assert found.rms == pytest.approx(0.05, rel=0.2)
    assert 90.0 < left.fit < 100.0


def test_a_second_record_is_predicted(axis: ModuleType, data: xr.Dataset) -> None:
    rest = axis.State(0.0, 0.0)
    first = trial(
        axis.ServoAxis(),
        axis.TRUTH,
        data.isel(time=slice(0, 4000)),
        {"v": "v"},
        {"theta": 1e-4},
        label="first",
        state=rest,
    )
    fit = estimate(output_error([first], parameters_of(axis.TRUTH, ["J", "T_p"])))
    second = trial(
        axis.ServoAxis(),
        axis.TRUTH,
        axis.measured(seed=9),
        {"v": "v"},
        {"theta": 1e-4},
        label="second",
        state=rest,
    )
    right = predict(second, fit).figures("theta")
    assert right["rmse"] == pytest.approx(1e-4, rel=0.2)
    off = replace(fit, values=fit.values * [1.05, 1.0])
    assert predict(second, off).figures("theta")["rmse"] > 10.0 * right["rmse"]


def test_several_starts_of_a_model_of_ones_own(axis: ModuleType, data: xr.Dataset) -> None:
    part = data.isel(time=slice(0, 2000))
    bench = trial(axis.ServoAxis(), axis.TRUTH, part, {"v": "v"}, {"theta": 1e-4})
    problem = output_error([bench], parameters_of(axis.TRUTH, ["J", "T_p"], starts={"J": 0.03}))
    found = multistart(problem, 4, seed=3)
    assert found["J"] == pytest.approx(axis.TRUTH.J, rel=1e-3)
    assert "4 of 4 starts reached the lowest minimum" in found.notes


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.rename(theta="phi"), "unknown measured signal 'theta': valid names are"),
        (lambda d: d.isel(time=slice(None, None, 10)), "cutoff = 60 Hz is not valid"),
        (lambda d: d.assign(theta=-d["theta"]), r"\(J = -0.02 V s"),
        (None, "none.nc cannot be read"),
    ],
)
def test_the_example_says_what_is_wrong_with_a_record(
    axis: ModuleType,
    data: xr.Dataset,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    change: Callable[[xr.Dataset], xr.Dataset] | None,
    said: str,
) -> None:
    file = tmp_path / "none.nc"
    if change is not None:
        own = data.copy()
        own["theta"].attrs["units"], own["v"].attrs["units"] = "rad", "V"
        file = write_measurement(change(own), tmp_path / "axis.nc")
    monkeypatch.setattr("sys.argv", [str(FILE), str(file)])
    with pytest.raises(SystemExit, match=said):
        runpy.run_path(str(FILE), run_name="__main__")
