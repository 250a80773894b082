"""Springs that slip: exact areas at any step, books closed to rounding, equal on all engines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bywire.core.errors import DeviceError, ModelError
from bywire.core.signals import zeros
from bywire.simulation.advance import Change
from bywire.simulation.cuda_device import find_device
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.program import build_program
from bywire.simulation.run import Run, Trajectory, simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities
from emulated_driver import EmulatedDriver, emulated
from systems.maxwell_slip import AMPLITUDE, PARAMETERS, MaxwellSlip, State, driven, given_motion

STEPS = (1e-3, 5e-4, 1e-4, 2e-5)
QUARTER = 20
"""rows of a quarter of a cycle"""


def unexplained(result: Trajectory) -> float:
    """Return the largest residual of the energy balance, relative to the energy of the drive."""
    parts = [result[name] for name in ("E_slip", "E_friction", "E_stored")]
    residual = result["E_source"] - sum(parts)
    return float(np.abs(residual - residual[0]).max() / np.ptp(result["E_source"]))


def loss_per_cycle(amplitude: float) -> float:
    """Return the closed form, 4 sum W (a - W/k) where a > W/k."""
    pairs = zip(PARAMETERS.slip_forces, PARAMETERS.stiffnesses, strict=True)
    return 4.0 * sum(W * max(amplitude - W / k, 0.0) for W, k in pairs)


@pytest.mark.parametrize("step", STEPS)
def test_force_and_loss_of_a_given_motion_are_exact_at_any_step(step: float) -> None:
    result = simulate(given_motion(cycles=2, step=step))
    assert loss_per_cycle(AMPLITUDE) == pytest.approx(0.0475, rel=1e-12)
    assert result["F_springs"][QUARTER] == pytest.approx(500.0, rel=1e-12)
    loss = result["E_slip"]
    for first in (QUARTER, 5 * QUARTER):
        cycle = loss[first + 4 * QUARTER] - loss[first]
        assert cycle == pytest.approx(loss_per_cycle(AMPLITUDE), rel=1e-12)
    assert unexplained(result) < 1e-12
    assert np.all(np.diff(loss) >= 0.0)
    assert result.repeated <= 10


@pytest.mark.parametrize("rubs", [False, True])
@pytest.mark.parametrize("m", [2.0, 0.02])
def test_books_close_to_rounding(m: float, rubs: bool) -> None:
    """Light masses on these springs swing in two substeps; the tangents are repeated there."""
    par = PARAMETERS.replace({"m": m})
    result = simulate(driven(step=1e-4, par=par, rubs=rubs))
    assert result.status == "done"
    assert 0 < result.repeated < 0.8 * 500
    assert unexplained(result) < 1e-12
    assert np.all(np.diff(result["E_slip"]) >= -1e-15)


def test_slip_forces_that_follow_the_load_close_with_the_square_of_the_step() -> None:
    left = [unexplained(simulate(driven(step=step, loaded=True))) for step in (1e-4, 2.5e-5)]
    assert left[0] < 1e-3
    assert left[1] < left[0] / 8.0


def test_a_spring_never_exceeds_its_width() -> None:
    result = simulate(driven())
    pairs = zip(PARAMETERS.slip_forces, PARAMETERS.stiffnesses, strict=True)
    for j, (W, k) in enumerate(pairs, 1):
        assert np.abs(result[f"z_{j}"]).max() <= W / k * (1.0 + 1e-12)
    assert np.abs(result["z_1"]).max() == pytest.approx(50.0 / 4e6, rel=1e-12)


def test_a_mass_at_rest_stays() -> None:
    """Springs and friction hold a small force: nothing creeps."""
    run = driven(rubs=True, duration=0.2)
    stuck = replace(run, stimulus=lambda t: np.column_stack([0.9 * 40.0 + 0.0 * t, 0.0 * t]))
    result = simulate(stuck)
    for name in ("x", "v", "z_1", "z_4", "E_slip"):
        assert np.all(result[name] == 0.0)


def test_a_width_that_falls_becomes_effective_within_a_substep() -> None:
    """A changed parameter: the spring slips at once, without moving, and its energy is lost."""
    run = given_motion(cycles=0)
    half = run.par.replace({"W_4": 50.0})
    hold = replace(
        run,
        duration=0.03,
        stimulus=lambda t: np.column_stack([0.0 * t, np.where(t < 0.0195, 5e-3, 0.0)]),
        changes=(Change(0.025, half),),
    )
    result = simulate(hold)
    assert result["z_4"][24] == pytest.approx(1e-4)
    assert result["z_4"][-1] == pytest.approx(50.0 / 1e6, rel=1e-12)
    given_up = result["E_stored"][24] - result["E_stored"][-1]
    assert given_up == pytest.approx(0.5 * 1e6 * (1e-4**2 - 5e-5**2), rel=1e-9)


def test_virtual_machine_computes_the_same() -> None:
    run = driven(rubs=True, duration=0.02)
    compiled, virtual = (simulate(run, engine=engine) for engine in ("compiled", "virtual-machine"))
    for name in compiled.names:
        np.testing.assert_allclose(
            virtual[name], compiled[name], rtol=0, atol=1e-9 * np.abs(compiled[name]).max()
        )


CASES = {"W_1": np.linspace(40.0, 60.0, 11), "k_3": np.linspace(1.9e6, 2.1e6, 11)}
OPTIONS = [{}, {"rubs": True}, {"loaded": True}, {"rubs": True, "loaded": True}]
SIGNALS = ("x", "v", "z_1", "z_4", "F_springs", "slip_1", "E_slip", "E_stored")


@pytest.mark.parametrize("options", OPTIONS)
def test_lanes_have_the_digits_of_single_runs(options: dict[str, bool]) -> None:
    run = driven(**options)
    lanes = simulate_ensemble(run, CASES, SIGNALS)
    for k in range(11):
        par = run.par.replace({name: float(values[k]) for name, values in CASES.items()})
        alone = simulate(replace(run, par=par), SIGNALS)
        np.testing.assert_array_equal(lanes.values[k], alone.values)
        assert lanes.repeated[k] == alone.repeated > 0


@pytest.mark.parametrize("options", OPTIONS)
def test_graphics_processors_have_the_digits_of_lanes(options: dict[str, bool]) -> None:
    run = driven(**options)
    lanes = simulate_ensemble(run, CASES, SIGNALS)
    with emulated(EmulatedDriver()):
        there = simulate_ensemble(run, CASES, SIGNALS, engine="cuda")
    np.testing.assert_array_equal(there.values, lanes.values)
    np.testing.assert_array_equal(there.repeated, lanes.repeated)


@pytest.mark.parametrize("options", OPTIONS)
def test_a_processor_that_is_there_agrees(options: dict[str, bool]) -> None:
    try:
        find_device()
    except DeviceError as error:
        pytest.skip(str(error))
    run = driven(**options)
    lanes = simulate_ensemble(run, CASES, SIGNALS)
    there = simulate_ensemble(run, CASES, SIGNALS, engine="cuda")
    largest = np.abs(lanes.values).max(axis=(0, 1))
    assert np.all(np.abs(there.values - lanes.values).max(axis=(0, 1)) <= 1e-9 * largest)


@pytest.mark.parametrize("name", ["k_1", "W_1", "W_3", "k", "m"])
def test_exact_derivatives_are_those_of_differences(name: str) -> None:
    """While a spring slips, its force follows its slip force; while it holds, its stiffness."""
    run = driven(step=1e-5, duration=0.012)
    exact = simulate_with_sensitivities(run, [name], ["x", "F_springs"])
    value = run.par.leaves()[name]
    width = 1e-6 * value
    ends = [simulate(replace(run, par=run.par.replace({name: value + s * width}))) for s in (1, -1)]
    for signal in ("x", "F_springs"):
        difference = (ends[0][signal] - ends[1][signal]) / (2.0 * width)
        off = np.abs(exact.of(signal, name) - difference).max()
        assert off < 2e-3 * np.abs(difference).max()


class _Wrong(MaxwellSlip):
    """With a rate that reads a stop operator."""

    def balance(self, x, xe, m, par, contact):
        """Return rates."""
        return super().balance(x, xe, m, par, contact)._replace(z_2=x.v + 0.1 * x.z_1)


class _OneWidth(MaxwellSlip):
    """With a single width."""

    def widths(self, x, xe, m, par, contact):
        """Return one."""
        return (1e-6,)


class _Rubbing(MaxwellSlip):
    """With friction on a stop operator."""

    frictions = ("z_2",)


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (_Wrong(), "the rate of z_2 depends on a stop operator"),
        (
            _OneWidth(),
            r"widths returns 1 value, but must return 4 \(one width per stop operator\)",
        ),
        (_Rubbing(), "stops lists 'z_2', which is also one of frictions"),
    ],
)
def test_wrong_declarations_are_refused(model: MaxwellSlip, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        build_program(model, PARAMETERS)


def test_runs_start_with_a_preload() -> None:
    """A deflection at the start acts at once."""
    run = driven()
    start: Run = replace(run, state=zeros(State)._replace(z_4=2e-4))
    result = simulate(start)
    assert result["F_springs"][0] == pytest.approx(200.0)
    assert unexplained(result) < 1e-12
