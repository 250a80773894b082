"""FMUs of version 2.0 in FMPy: bit-identical to the bench's own run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

import bywire
from bywire.api.exports import ExportedFmu
from bywire.bench.running import run_of
from bywire.core.errors import CompilerError, FileError, ParameterError, UnknownNameError
from bywire.export.fmu import archive
from bywire.usecases.export import export_fmu
from export.fmu.clients import Client
from raising import raises

MOTORCYCLE = bywire.Bench(
    "hard-braking",
    "dardanelli2010",
    options={"settle": 0.04, "duration": 0.1},
    name="short stop",
)
WEDGE = bywire.Bench(
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

SLIP = bywire.Bench(
    "straight-stop",
    "sport600",
    {"ecu.front_slip.eager": 10.0},
    options={"v_0": "6 m/s", "duration": "1 s"},
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmu")


@pytest.fixture(scope="module")
def motorcycle(folder: Path) -> ExportedFmu:
    return export_fmu(MOTORCYCLE, folder)


@pytest.fixture(scope="module")
def wedge(folder: Path) -> ExportedFmu:
    return export_fmu(WEDGE, folder)


@pytest.fixture(scope="module")
def slip(folder: Path) -> ExportedFmu:
    return export_fmu(SLIP, folder)


@pytest.fixture(scope="module")
def parts(folder: Path) -> list[ExportedFmu]:
    """Plant and ECU of the motorcycle brake."""
    return [export_fmu(MOTORCYCLE, folder, part=part) for part in ("plant", "ecu")]


@pytest.fixture
def client(motorcycle: ExportedFmu) -> Client:
    return Client(motorcycle.path, motorcycle.path.with_suffix(""))


@pytest.mark.parametrize(
    "name", ["motorcycle", "wedge", pytest.param("slip", marks=pytest.mark.trust)]
)
@pytest.mark.parametrize("step", [1e-3, 5e-3, 20e-3])
def test_every_row_is_the_benchs_own(
    name: str, step: float, request: pytest.FixtureRequest
) -> None:
    made = request.getfixturevalue(name)
    each = Client(made.path, made.path.with_suffix("")).begin()
    got = np.array(each.follow(step))
    reference = each.reference()
    every = round(step / (reference["time"][1] - reference["time"][0]))
    for k, signal in enumerate(each.of("local")):
        expected = reference[signal.removeprefix("sampled.")][:-1:every]
        assert np.array_equal(got[:, k], expected), signal


def test_it_is_driven_as_the_bench_is_at_its_start_until_told_otherwise(client: Client) -> None:
    client.begin()
    assert client["p_set"] == client.reference()["p_set"][0] == 6e5
    assert client["noise_p"] == 0.0


def test_a_validator_finds_nothing(motorcycle: ExportedFmu, wedge: ExportedFmu) -> None:
    assert validate_fmu(str(motorcycle.path)) == []
    assert validate_fmu(str(wedge.path)) == []


def test_between_steps_a_client_sees_left_limits(client: Client) -> None:
    client.begin()
    reference = client.reference()
    for row in range(60):
        client.set(client.of("input"), [reference[name][row] for name in client.of("input")])
        client.step(1e-3)
        assert client["p_mc"] == reference["p_mc"][row + 1]  # of the plant: no jump at the tick
        assert client["duty"] == reference["duty"][row]  # held since the tick before
    assert np.any(reference["duty"][1:61] != reference["duty"][:60])


def test_it_can_be_taken_back_and_moved_to_another_instance(client: Client) -> None:
    client.begin().follow(1e-3, 0, 30)
    state = client.fmu.getFMUState()
    content = client.fmu.serializeFMUState(state)
    first = client.follow(1e-3, 30, 60)
    client.fmu.setFMUState(state)
    client.time = 30e-3
    assert client.follow(1e-3, 30, 60) == first
    other = Client(client.folder.with_suffix(".fmu"), client.folder)
    other.begin().fmu.setFMUState(other.fmu.deserializeFMUState(content))
    other.time = 30e-3
    assert other.follow(1e-3, 30, 60) == first


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("motor.R_m", -1.0, "motor.R_m = -1 ohm is not valid: it must be > 0 ohm"),
        ("motor.R_m", 0.0, "motor.R_m = 0 ohm is not valid"),
        ("motor.R_m", float("nan"), "motor.R_m = nan ohm is not valid"),
        ("p_set", float("inf"), "p_set = inf Pa is not valid: it must be any finite number"),
        ("p_mc", 1e5, "p_mc is computed and cannot be set"),
    ],
)
def test_a_value_that_is_refused_leaves_it_usable(
    client: Client, capfd: pytest.CaptureFixture[str], name: str, value: float, said: str
) -> None:
    before = client["motor.R_m"]
    with pytest.raises(FMICallException):
        client.set(["motor.K_e", name], [0.05, value])
    assert said in capfd.readouterr().out
    assert client["motor.R_m"] == before
    assert client["motor.K_e"] == MOTORCYCLE.par.motor.K_e  # all or none
    client.begin().follow(1e-3, 0, 3)


def test_an_input_outside_its_declared_range_is_refused(
    wedge: ExportedFmu, capfd: pytest.CaptureFixture[str]
) -> None:
    client = Client(wedge.path, wedge.path.with_suffix("")).begin()
    for value in (2.0, -0.5, float("nan")):
        with pytest.raises(FMICallException):
            client["power_off"] = value
    assert "power_off = 2 is not valid: it must be >= 0 and <= 1" in capfd.readouterr().out
    client["power_off"] = 1.0
    client.follow(1e-3, 0, 2)
    (described,) = (v for v in client.description.modelVariables if v.name == "power_off")
    assert (float(described.min), float(described.max)) == (0.0, 1.0)


def test_fixed_parameters_stay_and_those_of_the_ecu_alone_are_tuned(
    client: Client, capfd: pytest.CaptureFixture[str]
) -> None:
    client.begin()
    with pytest.raises(FMICallException):
        client["motor.R_m"] = 0.5
    assert "motor.R_m is fixed" in capfd.readouterr().out
    client["ecu.pressure.k_p"] = 2.0 * client["ecu.pressure.k_p"]


@pytest.mark.parametrize("step", [1.5e-3, 0.0, -1e-3, float("nan")])
def test_other_communication_steps_are_refused(
    client: Client, capfd: pytest.CaptureFixture[str], step: float
) -> None:
    client.begin()
    with pytest.raises(FMICallException):
        client.step(step)
    assert "whole multiple of 0.001 s" in capfd.readouterr().out
    client.time = 0.0
    client.step(1e-3)


def test_changed_parameters_begin_at_rest(client: Client) -> None:
    changed = MOTORCYCLE.with_overrides({"master_cylinder.A_mc": "+5%", "caliper.K_pd": "-10%"})
    values = {name: changed.par.value(name) for name in ("master_cylinder.A_mc", "caliper.K_pd")}
    client.begin(**{name.replace(".", "__"): value for name, value in values.items()})
    recorded = bywire.simulate(run_of(changed, changed.cases()[0], 0))
    reference = client.reference()
    for row in range(40):
        client.set(client.of("input"), [reference[name][row] for name in client.of("input")])
        client.step(1e-3)
        assert client["p_mc"] == pytest.approx(recorded["p_mc"][row + 1], rel=1e-7)


def test_plant_and_ecu_together_are_the_whole(
    parts: list[ExportedFmu], motorcycle: ExportedFmu
) -> None:
    plant, ecu = parts
    brake = Client(plant.path, plant.path.with_suffix("")).begin()
    control = Client(ecu.path, ecu.path.with_suffix("")).begin()
    whole = Client(motorcycle.path, motorcycle.path.with_suffix("")).begin()
    reference = whole.reference()
    stimuli = whole.of("input")
    readings = [name for name in control.of("input") if name not in stimuli]
    held = brake.of("input")
    assert set(readings) == {"y_p", "y_i"}
    for row in range(120):
        given = [reference[name][row] for name in stimuli]
        control.set(stimuli, given)
        control.set(readings, brake.values(readings))
        control.step(1e-3)
        brake.set(held, control.values(held))
        brake.step(1e-3)
        assert brake["p_mc"] == reference["p_mc"][row + 1]
        assert brake["E_stored"] == reference["E_stored"][row + 1]


@pytest.mark.parametrize("start", [1.0, -0.3, 1e5 + 1.0 / 3.0])
def test_a_coupled_run_from_any_start_time_is_the_run_from_zero(
    parts: list[ExportedFmu], start: float
) -> None:
    def coupled(begin: float) -> list[list[float]]:
        plant, ecu = (Client(each.path, each.path.with_suffix(""), begin).begin() for each in parts)
        demand, rows = ecu.reference()["p_set"], list[list[float]]()
        readings = [name for name in ecu.of("input") if name in plant.of("output")]
        held = plant.of("input")
        for row in range(120):
            ecu["p_set"] = demand[row]
            ecu.set(readings, plant.values(readings))
            now, then = begin + row * 1e-3, begin + (row + 1) * 1e-3
            ecu.fmu.doStep(now, then - now)
            plant.set(held, ecu.values(held))
            plant.fmu.doStep(now, then - now)
            rows.append(plant.values(plant.of("output")))
        assert plant.fmu.getRealStatus(2) == pytest.approx(begin + 0.12, abs=1e-9)
        return rows

    assert coupled(start) == coupled(0.0)


def test_steps_that_add_up_are_taken_and_those_of_another_time_refused(
    motorcycle: ExportedFmu, capfd: pytest.CaptureFixture[str]
) -> None:
    client = Client(motorcycle.path, motorcycle.path.with_suffix(""), 86400.0).begin()
    client.follow(1e-3, 0, 100)  # the client adds 1 ms up, and rounds each time
    with pytest.raises(FMICallException):
        client.fmu.doStep(0.1, 1e-3)
    assert "the step begins at 0.1 s, but the run is at 86400.1 s" in capfd.readouterr().out


def test_a_step_beyond_the_stop_time_is_refused(
    motorcycle: ExportedFmu, capfd: pytest.CaptureFixture[str]
) -> None:
    client = Client(motorcycle.path, motorcycle.path.with_suffix(""), 1.0, 1.003).begin()
    client.follow(1e-3, 0, 3)
    with pytest.raises(FMICallException):
        client.step(1e-3)
    assert "the step ends at 1.004 s, but the stop time is 1.003 s" in capfd.readouterr().out
    for start, stop in ((float("nan"), None), (float("inf"), None), (2.0, 1.0)):
        with pytest.raises(FMICallException):
            Client(motorcycle.path, motorcycle.path.with_suffix(""), start, stop)


def test_a_state_keeps_the_time_of_its_run(motorcycle: ExportedFmu) -> None:
    folder = motorcycle.path.with_suffix("")
    client = Client(motorcycle.path, folder, 1.0).begin()
    client.follow(1e-3, 0, 5)
    content = client.fmu.serializeFMUState(client.fmu.getFMUState())
    other = Client(motorcycle.path, folder, 7.0).begin()
    other.fmu.setFMUState(other.fmu.deserializeFMUState(content))
    other.time = client.time
    assert other.follow(1e-3, 5, 10) == client.follow(1e-3, 5, 10)
    client.fmu.reset()
    client.fmu.setupExperiment(startTime=2.0)
    client.fmu.enterInitializationMode()
    client.fmu.exitInitializationMode()
    client.time = 2.0
    client.follow(1e-3, 0, 2)


def test_the_same_bench_gives_the_same_bytes(motorcycle: ExportedFmu, tmp_path: Path) -> None:
    again = export_fmu(MOTORCYCLE, tmp_path)
    assert again.path.read_bytes() == motorcycle.path.read_bytes()


def test_what_cannot_be_exported_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with raises(ParameterError, name="case", value="9"):
        export_fmu("friction-sweep", tmp_path)
    with pytest.raises(ParameterError, match="without any run"):
        export_fmu("seal-stribeck", tmp_path)
    with pytest.raises(UnknownNameError, match="part 'plants': did you mean 'plant'"):
        export_fmu(MOTORCYCLE, tmp_path, part="plants")
    failing = [{"fault": "motor.demagnetized", "onset": "50 ms"}]
    with raises(ParameterError, name="[[faults]]"):
        export_fmu(bywire.Bench("hard-braking", "dardanelli2010", faults=failing), tmp_path)
    monkeypatch.setattr(archive, "find_compiler", lambda: None)
    with pytest.raises(CompilerError):
        export_fmu(MOTORCYCLE, tmp_path / "a" / "folder")
    with pytest.raises(FileError, match="null character"):
        export_fmu(MOTORCYCLE, f"{tmp_path}/a\0b")
    assert list(tmp_path.iterdir()) == []
