"""Model exchange of plants: other solvers with their own events agree with the kernel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy import extract, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

import bywire
from bywire.api.exports import ExportedFmu
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.usecases.export import export_fmu
from export.fmu.clients import Client
from export.fmu.solver_client import SolverClient
from raising import raises

TICK = 1e-3
MODES = ["mode.omega", "mode.p_mc", "mode.contact_1", "mode.changes"]
# Pressure builds up, the piston sticks, is thrown back to its end stop, and touches it again.
THROWN = bywire.Bench(
    "motor-open-loop",
    "dardanelli2010",
    options={"settle": 0.02, "duration": 0.12, "source": "voltage"},
    stimulus={
        "kind": "table",
        "times": [0.0, 0.025, 0.04, 0.08],
        "values": [6.0, 0.6, -7.2, -2.4],
        "between": "hold",
    },
)
SHORT_STOP = bywire.Bench(
    "hard-braking", "dardanelli2010", options={"settle": 0.04, "duration": 0.2}, name="short stop"
)
PULSE = bywire.Bench(
    "moment-pulses",
    "roberts2003",
    options={
        "t_hold": "60 ms",
        "pulses": 1,
        "t_low": "20 ms",
        "t_high": "20 ms",
        "settle": "20 ms",
    },
)


def reference(made: ExportedFmu) -> np.ndarray:
    folder = made.path.with_suffix("")
    extract(str(made.path), unzipdir=str(folder))
    return np.genfromtxt(folder / "documentation" / "reference.csv", delimiter=",", names=True)


def solved(
    path: Path, inputs: dict[str, np.ndarray], names: list[str], tolerance: float = 1e-7
) -> np.ndarray:
    """Result of CVODE in FMPy for inputs with one value per tick, shape (ticks, names)."""
    count = len(next(iter(inputs.values()))) - 1
    table = np.zeros(count + 1, dtype=[(name, float) for name in ("time", *inputs)])
    table["time"] = np.arange(count + 1) * TICK
    for name, values in inputs.items():
        table[name] = values
    rows = simulate_fmu(
        str(path),
        stop_time=count * TICK,
        input=table,
        output=names,
        output_interval=TICK,
        relative_tolerance=tolerance,
        record_events=False,
    )
    return np.column_stack([rows[name] for name in names])


@pytest.fixture(scope="module")
def thrown(tmp_path_factory: pytest.TempPathFactory) -> ExportedFmu:
    return export_fmu(THROWN, tmp_path_factory.mktemp("exchange"), kind="model-exchange")


def test_a_solver_may_start_at_any_time(thrown: ExportedFmu) -> None:
    def pressure(start: float) -> np.ndarray:
        rows = simulate_fmu(
            str(thrown.path),
            start_time=start,
            stop_time=start + 0.03,
            output=["time", "p_mc"],
            output_interval=TICK,
            relative_tolerance=1e-7,
            record_events=False,
            start_values={"v_source": 6.0},
        )
        np.testing.assert_allclose(rows["time"], start + TICK * np.arange(31), rtol=1e-12)
        return rows["p_mc"]

    at_zero = pressure(0.0)
    assert np.ptp(at_zero) > 1e5
    np.testing.assert_allclose(pressure(4.0), at_zero, atol=5.0)


def test_frictions_limits_and_contacts_are_met_as_the_kernel_meets_them(
    thrown: ExportedFmu,
) -> None:
    assert validate_fmu(str(thrown.path)) == []
    expected, names = reference(thrown), ["p_mc", "omega", "F_stop"]
    got = solved(thrown.path, {"v_source": expected["v_set"]}, names + MODES)
    for k, (name, bound) in enumerate(zip(names, (5.0, 4e-3, 0.05), strict=True)):
        assert np.abs(got[:, k] - expected[name]).max() < bound, name
    motion, refilled, at_stop, changes = got[:, 3:].T
    assert set(motion) == {-1.0, 0.0, 1.0}
    assert np.array_equal(motion == 0.0, expected["omega"] == 0.0)
    assert np.array_equal(refilled == 0.0, expected["p_mc"] == 0.0)  # the reservoir port is open
    assert np.array_equal(at_stop == 1.0, expected["F_stop"] < 0.0)
    edges = [np.count_nonzero(np.diff(each)) for each in (motion, refilled, at_stop)]
    assert min(edges) >= 2
    assert changes[-1] == sum(edges)


def test_a_solver_is_told_to_begin_anew_where_rates_jump(thrown: ExportedFmu) -> None:
    client = SolverClient(thrown.path).begin()

    def is_new(inputs: dict[str, float]) -> bool:
        assert np.isfinite(client["der(omega)"])  # as a solver asks for it
        client.fmu.enterEventMode()
        if inputs:
            client.set(inputs)
        again, _, _, changed, *_ = client.fmu.newDiscreteStates()
        client.fmu.enterContinuousTimeMode()
        assert not again
        return bool(changed)

    assert is_new({"v_source": 6.0})  # no state changes its value
    assert not is_new({})


def test_version_3_says_the_same_and_how_many_indicators_it_has(
    thrown: ExportedFmu, tmp_path: Path
) -> None:
    made = export_fmu(THROWN, tmp_path, kind="model-exchange", fmi=3)
    assert validate_fmu(str(made.path)) == []
    inputs = {"v_source": reference(made)["v_set"][:60]}
    names = ["p_mc", "der(omega)", *MODES]
    assert np.array_equal(solved(made.path, inputs, names), solved(thrown.path, inputs, names))


def test_its_state_is_put_aside_and_taken_back(thrown: ExportedFmu) -> None:
    client = SolverClient(thrown.path).begin()
    client.event({"v_source": 6.0})
    client.follow(3e-3, 1e-5)
    state = client.fmu.serializeFMUState(client.fmu.getFMUState())
    client.follow(3e-3, 1e-5)
    other = SolverClient(thrown.path).begin()
    other.fmu.setFMUState(other.fmu.deserializeFMUState(state))
    other.time = 3e-3
    other.follow(3e-3, 1e-5)
    assert (other["omega"], other["p_mc"]) == (client["omega"], client["p_mc"])


def test_what_it_refuses_leaves_it_usable(
    thrown: ExportedFmu, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    client = SolverClient(thrown.path)
    for name, value, said in (
        ("motor.R_m", -1.0, "motor.R_m = -1 ohm is not valid"),
        ("v_source", float("nan"), "v_source = nan V is not valid"),
        ("p_mc", 1e5, "p_mc is computed"),
    ):
        with pytest.raises(FMICallException):
            client.set({name: value})
        assert said in capfd.readouterr().out
    client.begin(motor__R_m=0.5)
    assert client["motor.R_m"] == 0.5
    with raises(ParameterError, name="part", value="ecu", valid="plant"):
        export_fmu(THROWN, tmp_path, part="ecu", kind="model-exchange")
    with pytest.raises(UnknownNameError, match="did you mean 'model-exchange'"):
        export_fmu(THROWN, tmp_path, kind="model-exchang")


@pytest.mark.trust
@pytest.mark.parametrize(
    ("bench", "signal", "bounds"),
    [(SHORT_STOP, "p_mc", (200.0, 15.0, 0.7)), (PULSE, "M_B", (2e-3, 1.2e-4, 1e-5))],
    ids=["motorcycle", "wedge"],
)
def test_the_kernel_converges_to_what_other_solvers_find(
    bench: bywire.Bench, signal: str, bounds: tuple[float, ...], tmp_path: Path
) -> None:
    made = export_fmu(bench, tmp_path, kind="model-exchange")
    driven = reference(made)
    client = SolverClient(made.path).begin()
    inputs = {n: driven[n] for n in client.of("input") if n in driven.dtype.names}
    exact = []
    for row in range(len(driven) - 1):
        client.event({name: float(values[row]) for name, values in inputs.items()})
        client.follow(TICK, 1e-8)
        exact.append(client[signal])
    by_cvode = solved(made.path, inputs, [signal, "mode.changes"], 1e-10)
    assert np.abs(by_cvode[1:, 0] - exact).max() < 0.02 * bounds[0]
    assert by_cvode[-1, 1] == client["mode.changes"] > 3
    for step, bound in zip((20e-6, 5e-6, 1e-6), bounds, strict=True):
        plant = export_fmu(replace(bench, step=step), tmp_path / f"{step:g}", part="plant")
        kernel = Client(plant.path, plant.path.with_suffix("")).begin()
        there = []
        for row in range(len(driven) - 1):
            kernel.set(list(inputs), [values[row] for values in inputs.values()])
            kernel.step(TICK)
            there.append(kernel[signal])
        assert np.abs(np.subtract(there, exact)).max() < bound
