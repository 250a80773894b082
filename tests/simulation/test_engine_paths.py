"""Compiled C, virtual machine, lanes, tangents and plain floats compute the same runs.

Plain floats are an independent implementation of the scheme (``reference.plain_stepping``): what
agrees with them is right in the algebra of elimination, hoisting and emission.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.core.signals import signals_of
from bywire.simulation import engine as engine_module
from bywire.simulation.compiler import find_compiler
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import Run, Trajectory, simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities
from reference import plain_stepping
from systems.three_contacts import heart, wiggled
from systems.two_mass import rig

Array = NDArray[np.float64]
AGREEMENT = 1e-9  # of the largest value of a signal in the run


@dataclass(frozen=True)
class Path:
    """A run, the signals whose signs are its modes, and parameters to vary and differentiate."""

    run: Run
    modes: tuple[str, ...]
    varied: str


def _braking() -> Run:
    bench = Bench(
        "hard-braking",
        "dardanelli2010",
        overrides={"adc.law": "ideal"},
        options={"settle": 0.02, "duration": 0.018},
        record=2e-4,
    )
    return as_run(bench.cases()[0], 1e-4, bench.record)


def _heart() -> Run:
    """Return a run that is wiggled faster, so that modes change often in few substeps."""
    return replace(heart(0.025, 40e-6, 40e-6), stimulus=lambda t: wiggled(3.0 * t))


PATHS = {
    "two-mass": Path(rig(0.024, record=20e-6), ("v_1", "v_2", "F_wall"), "F_c1"),
    "three-contacts": Path(_heart(), ("V_1", "V_2", "v", "f_1", "f_2", "f_12"), "F_S0"),
    "braking": Path(_braking(), ("omega", "sat_current"), "seal.T_pr"),
}


@pytest.fixture(params=PATHS, scope="module")
def path(request: pytest.FixtureRequest) -> Path:
    return PATHS[request.param]


@pytest.fixture(scope="module")
def compiled(path: Path) -> Trajectory:
    result = simulate(path.run, engine="compiled")
    assert result.status == "done"
    return result


def assert_same(path: Path, compiled: Trajectory, values: Array) -> None:
    """Every signal agrees, and every mode changes in the same substep."""
    nominal = np.array([s.nominal for s in signals_of(path.run.model.Output).values()])
    scale = np.maximum(np.abs(compiled.values).max(axis=0), 1e-6 * nominal)
    assert values is not compiled.values
    worst = (np.abs(values - compiled.values) / scale).max(axis=0)
    assert worst.max() < AGREEMENT, f"{compiled.names[worst.argmax()]}: {worst.max():g}"
    columns = [compiled.names.index(name) for name in path.modes]
    np.testing.assert_array_equal(np.sign(values[:, columns]), np.sign(compiled.values[:, columns]))


def test_modes_change_often(path: Path, compiled: Trajectory) -> None:
    """Otherwise the agreements below would say little."""
    modes = np.sign(np.array([compiled[name] for name in path.modes]))
    changes = np.count_nonzero(np.any(np.diff(modes, axis=1) != 0, axis=0))
    assert changes >= 4
    assert len({tuple(column) for column in modes.T}) >= min(2 ** len(path.modes), 12)


def test_virtual_machine(path: Path, compiled: Trajectory) -> None:
    other = simulate(path.run, engine="virtual-machine")
    assert other.engine != compiled.engine
    assert (other.repeated, other.unsettled) == (compiled.repeated, compiled.unsettled)
    assert_same(path, compiled, other.values)


def test_plain_floats(path: Path, compiled: Trajectory) -> None:
    run = path.run
    values, end = plain_stepping.simulate(
        run.model,
        run.par,
        (run.state, run.memory),
        run.stimulus,
        run.duration,
        run.step,
        run.record,
    )
    assert (end.repeated, end.unsettled) == (compiled.repeated, compiled.unsettled)
    assert_same(path, compiled, values)


@pytest.mark.parametrize("count", [1, 32])
def test_lanes(path: Path, compiled: Trajectory, count: int) -> None:
    """Cases that differ in a parameter, side by side: each equals its own single run."""
    run, base = path.run, path.run.par.leaves()[path.varied]
    values = base * (1.0 + 0.02 * np.arange(count))
    ensemble = simulate_ensemble(run, {path.varied: values}, compiled.names)
    assert_same(path, compiled, ensemble.values[0])
    for k in {count // 2, count - 1} - {0}:
        single = simulate(replace(run, par=run.par.replace({path.varied: float(values[k])})))
        assert_same(path, single, ensemble.values[k])
        assert np.abs(single.values - compiled.values).max() > 0.0
        assert (ensemble.unsettled[k], ensemble.repeated[k]) == (single.unsettled, single.repeated)


def test_quick_compiles_give_the_same_digits(monkeypatch: pytest.MonkeyPatch) -> None:
    """What tests run is what users run: not even fused products and sums may differ."""
    run, varied = PATHS["braking"].run, {"seal.T_pr": np.array([11.0, 12.0])}
    results = []
    try:
        for quick in "01":
            monkeypatch.setenv("BYWIRE_CC_QUICK", quick)
            monkeypatch.setattr(engine_module, "_PREPARED", {})
            find_compiler.cache_clear()
            single, lanes = simulate(run), simulate_ensemble(run, varied, ["p_mc", "omega"])
            assert single.engine.endswith(", quick") == (quick == "1")
            results.append((single.values, lanes.values))
    finally:
        monkeypatch.undo()
        find_compiler.cache_clear()
    for usual, quick in zip(*results, strict=True):
        np.testing.assert_array_equal(usual, quick)


def test_tangent_kernel_computes_the_same_run(path: Path, compiled: Trajectory) -> None:
    result = simulate_with_sensitivities(path.run, [path.varied], compiled.names)
    assert_same(path, compiled, result.trajectory.values)
    assert np.all(np.isfinite(result.derivatives))
    assert np.abs(result.derivatives).max() > 0.0


def test_rarely_touched_is_about_speed_only() -> None:
    """A contact that is declared rare takes the exact pass and gives the same numbers."""
    often, rare = rig(0.06, record=20e-6), rig(0.06, record=20e-6, rare=True)
    first, second = simulate(often), simulate(rare)
    assert second.repeated > first.repeated
    assert first["F_wall"].max() > 100.0
    np.testing.assert_allclose(second.values, first.values, rtol=1e-9, atol=1e-12)


def test_tasks_share_one_memory() -> None:
    """Tasks due together run in their order, each renews its own part, none loses a tick."""
    result = simulate(heart(0.02, record=2e-4))
    instant = np.arange(result.time.size)
    np.testing.assert_array_equal(result["fast_ticks"], instant + 1)
    np.testing.assert_array_equal(result["slow_ticks"], instant // 5 + 1)
    np.testing.assert_array_equal(result["slow_seen"], result["slow_ticks"])
