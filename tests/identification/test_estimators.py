"""Inverse dynamics and output error on the servo axis of the examples."""

from __future__ import annotations

import importlib.util
import runpy
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import xarray as xr

from bywire.core.errors import ParameterError, UnknownNameError
from bywire.data.writing import write_measurement
from bywire.identification import (
    Equation,
    differentiated,
    estimate,
    initial_states,
    inverse_dynamics,
    output_error,
    parameters_of,
    trial,
)
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
        inverse_dynamics(
            equation(axis), axis.TRUTH, parameters_of(axis.TRUTH, names), moving(data)
        )


def test_a_body_that_hardly_moves_tells_nothing(axis: ModuleType, data: xr.Dataset) -> None:
    still = data.assign(theta=data["theta"] * 1e-6)
    with pytest.raises(ParameterError, match="too few for 5 unknowns"):
        inverse_dynamics(
            equation(axis), axis.TRUTH, parameters_of(axis.TRUTH, axis.NAMES), moving(still)
        )


def test_a_missing_signal_is_named(axis: ModuleType, data: xr.Dataset) -> None:
    lost = moving(data).rename({"v": "voltage"})
    with pytest.raises(UnknownNameError, match="'v'"):
        inverse_dynamics(
            equation(axis), axis.TRUTH, parameters_of(axis.TRUTH, axis.NAMES), lost
        )


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
    axis: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """On a record of its own; parameters other than the example's are no failure."""
    data, file = axis.measured(seed=3, noise=3e-3), tmp_path / "axis.csv"
    table = data.assign(v=1.5 * data["v"]).to_dataframe()[["theta", "v"]]
    table.to_csv(file, header=["theta [rad]", "v [V]"], index_label="time [s]")
    monkeypatch.setattr("sys.argv", [str(FILE), str(file)])
    runpy.run_path(str(FILE), run_name="__main__")
    said = capsys.readouterr().out
    assert "J: noise biases inverse dynamics" in said
    assert "does not explain" not in said
    assert "angle left over: 0.003 rad" in said


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


def test_output_error_recovers_parameters_and_the_start(
    axis: ModuleType, data: xr.Dataset
) -> None:
    known = axis.TRUTH.replace({"J": 0.03, "d_p": 0.03, "d_n": 0.1, "T_p": 0.4, "T_n": 0.6})
    bench = trial(axis.ServoAxis(), known, data, {"v": "v"}, {"theta": 1e-4})
    unknowns = parameters_of(known, axis.NAMES) + initial_states(bench, ["theta"])
    found = estimate(output_error([bench], unknowns))
    truth = np.array([getattr(axis.TRUTH, n) for n in axis.NAMES] + [0.0])
    assert np.all(np.abs(found.values - truth) < 4.0 * found.deviations)
    assert found.rms == pytest.approx(1.0, abs=0.05)


def test_trials_share_parameters_and_keep_their_own_offsets(
    axis: ModuleType, data: xr.Dataset
) -> None:
    """Two records whose angle sensors were zeroed differently."""
    shift = {"first": 0.3, "second": -0.2}
    parts = {"first": data.isel(time=slice(0, 3000)), "second": data.isel(time=slice(0, 4000))}
    trials = [
        trial(axis.ServoAxis(), axis.TRUTH, part.assign(theta=part["theta"] + shift[k]),
              {"v": "v"}, {"theta": 1e-4}, label=k, state=axis.State(0.0, 0.0))
        for k, part in parts.items()
    ]  # fmt: skip
    unknowns = parameters_of(axis.TRUTH, ["J", "T_p"], starts={"J": 0.025})
    unknowns += tuple(Unknown("offset.theta", 0.0, scale=0.1, trial=k) for k in parts)
    found = estimate(output_error(trials, unknowns))
    assert found["J"] == pytest.approx(0.02, rel=1e-4)
    # An offset of the sensor: what the model shows and the record does not.
    assert found["first:offset.theta"] == pytest.approx(0.3, abs=1e-4)
    assert found["second:offset.theta"] == pytest.approx(-0.2, abs=1e-4)


def test_a_wrong_model_is_found_out(axis: ModuleType, data: xr.Dataset) -> None:
    """Friction taken as the same both ways: the residuals say that something is missing."""
    bench = trial(axis.ServoAxis(), axis.TRUTH.replace({"T_n": 0.6}), data, {"v": "v"},
                  {"theta": 1e-4})  # fmt: skip
    found = estimate(output_error([bench], parameters_of(axis.TRUTH, ["J", "d_p", "d_n"])))
    assert found.colored
    assert found.rms > 5.0


def test_uneven_time_is_refused(axis: ModuleType, data: xr.Dataset) -> None:
    holes = data.isel(time=np.r_[0:100, 120:400])
    with pytest.raises(ParameterError, match="not evenly spaced"):
        trial(axis.ServoAxis(), axis.TRUTH, holes, {"v": "v"}, {"theta": 1e-4})


@pytest.mark.parametrize(("change", "said"), [
    (lambda d: d.rename(theta="phi"), "unknown measured signal 'theta': known are"),
    (lambda d: d.isel(time=slice(None, None, 10)), "cutoff = 60 Hz is not admissible"),
    (lambda d: d.assign(theta=-d["theta"]), r"theta goes against v \(J = -0.02 .*negate one"),
    (None, "none.nc cannot be read"),
])  # fmt: skip
def test_the_example_says_what_is_wrong_with_a_record(
    axis: ModuleType, data: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    change: Callable[[xr.Dataset], xr.Dataset] | None, said: str,
) -> None:  # fmt: skip
    file = tmp_path / "none.nc"
    if change is not None:
        own = data.copy()
        own["theta"].attrs["units"], own["v"].attrs["units"] = "rad", "V"
        file = write_measurement(change(own), tmp_path / "axis.nc")
    monkeypatch.setattr("sys.argv", [str(FILE), str(file)])
    with pytest.raises(SystemExit, match=said):
        runpy.run_path(str(FILE), run_name="__main__")
