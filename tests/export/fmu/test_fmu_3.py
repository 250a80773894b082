"""FMUs of version 3.0: with the ECU's tasks as clocks, and without event mode."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

import bywire
from bywire.usecases.export import export_fmu

OPTIONS = {"t_hold": "60 ms", "pulses": 1, "t_low": "20 ms", "t_high": "20 ms", "settle": "20 ms"}
BENCHES = {
    "motorcycle": bywire.Bench(
        "hard-braking", "dardanelli2010", options={"settle": 0.04, "duration": 0.1}
    ),
    "wedge": bywire.Bench("moment-pulses", "roberts2003", options=OPTIONS),
}


class Client:
    """One instance of an FMU of version 3.0."""

    def __init__(
        self,
        path: Path,
        *,
        has_events: bool = False,
        may_return_early: bool = False,
        start: float = 0.0,
    ):
        folder = path.with_suffix("")
        if not folder.exists():
            extract(str(path), unzipdir=str(folder))
        self.description = read_model_description(str(folder))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        clocks = ElementTree.parse(folder / "modelDescription.xml").iter("Clock")
        self.clocks = {
            int(c.get("valueReference")): float(c.get("intervalDecimal")) for c in clocks
        }
        self.fmu = FMU3Slave(
            guid=self.description.guid,
            unzipDirectory=str(folder),
            instanceName="test",
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )
        self.fmu.instantiate(
            loggingOn=True, eventModeUsed=has_events, earlyReturnAllowed=may_return_early
        )
        self.fmu.enterInitializationMode(startTime=start)
        path = folder / "documentation" / "reference.csv"
        self.reference = np.genfromtxt(path, delimiter=",", names=True)

    def of(self, causality: str) -> list[str]:
        known = self.description.modelVariables
        return [v.name for v in known if v.causality == causality and v.type == "Float64"]

    def drive(self, row: int) -> None:
        names = self.of("input")
        self.fmu.setFloat64(
            [self.references[n] for n in names], [self.reference[n][row] for n in names]
        )

    def values(self, names: list[str]) -> list[float]:
        return list(self.fmu.getFloat64([self.references[n] for n in names]))

    def tick(self, time: float) -> None:
        due = [vr for vr, T in self.clocks.items() if abs(time / T - round(time / T)) < 1e-9]
        self.fmu.setClock(due, [True] * len(due))
        self.fmu.updateDiscreteStates()


@pytest.fixture(scope="module", params=sorted(BENCHES))
def path(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_fmu(BENCHES[request.param], tmp_path_factory.mktemp("fmu"), fmi=3).path


def test_a_validator_finds_nothing(path: Path) -> None:
    assert validate_fmu(str(path)) == []


def test_with_clocks_results_are_those_of_the_bench(path: Path) -> None:
    client = Client(path, has_events=True)
    client.fmu.exitInitializationMode()
    time, names = client.reference["time"], client.of("output")
    expected = np.array([client.reference[n] for n in names]).T
    frame = float(client.description.coSimulation.fixedInternalStepSize)
    at, per_row = 0, round((time[1] - time[0]) / frame)
    for row in range(len(time) - 1):
        for k in range(per_row):
            client.drive(row)
            client.tick(at * frame)
            if k == 0:
                assert client.values(names) == list(expected[row]), row
            client.fmu.enterStepMode()
            client.fmu.doStep(at * frame, frame)
            client.fmu.enterEventMode()
            at += 1


def test_with_clocks_it_starts_at_any_time(path: Path) -> None:
    frame = float(Client(path).description.coSimulation.fixedInternalStepSize)

    def rows(start: float) -> list[list[float]]:
        client = Client(path, has_events=True, start=start)
        client.fmu.exitInitializationMode()
        made = []
        for k in range(20):
            client.drive(0)
            client.tick(k * frame)
            made.append(client.values(client.of("output")))
            client.fmu.enterStepMode()
            client.fmu.doStep(start + k * frame, frame)
            client.fmu.enterEventMode()
        time = client.fmu.getFloat64([client.references["time"]])[0]
        assert time == pytest.approx(start + 20 * frame, abs=1e-9)
        return made

    assert rows(1234.5) == rows(0.0)


@pytest.mark.parametrize("rows", [1, 5])
def test_without_event_mode_it_ticks_by_itself(path: Path, rows: int) -> None:
    client = Client(path)
    client.fmu.exitInitializationMode()
    time, names = client.reference["time"], client.of("local")
    for row in range(0, len(time) - 1, rows):
        client.drive(row)
        client.fmu.doStep(time[row], rows * (time[1] - time[0]))
        expected = [client.reference[n.removeprefix("sampled.")][row] for n in names]
        assert client.values(names) == expected


def test_a_tick_is_never_left_out(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    client = Client(path, has_events=True)
    client.fmu.exitInitializationMode()
    shortest = min(client.clocks.values())
    client.fmu.enterStepMode()
    with pytest.raises(FMICallException):
        client.fmu.doStep(0.0, shortest)
    assert "ticks at 0 s. Activate it in event mode first" in capfd.readouterr().out
    client.fmu.enterEventMode()
    client.tick(0.0)
    client.fmu.enterStepMode()
    with pytest.raises(FMICallException):
        client.fmu.doStep(0.0, 2 * shortest)
    assert "a clock ticks within this step" in capfd.readouterr().out
    early = Client(path, has_events=True, may_return_early=True)
    early.fmu.exitInitializationMode()
    early.tick(0.0)
    early.fmu.enterStepMode()
    needs_event, _, returned_early, last = early.fmu.doStep(0.0, 2 * shortest)
    assert (needs_event, returned_early) == (True, True)
    assert last == pytest.approx(shortest)


def test_tables_are_arrays(tmp_path: Path) -> None:
    curve = {"caliper.p_table": (0.0, 1e5, 5e5, 60e5), "caliper.V_table": (0.0, 1e-8, 3e-8, 2e-7)}
    bench = bywire.Bench(
        "hard-braking",
        "dardanelli2010",
        {"caliper.law": "table", **curve},
        {"settle": 0.04, "duration": 0.1},
    )
    path = export_fmu(bench, tmp_path, fmi=3).path
    assert validate_fmu(str(path)) == []
    client = Client(path)
    reference = client.references["caliper.p_table"]
    assert tuple(client.fmu.getFloat64([reference], nValues=4)) == curve["caliper.p_table"]
    client.fmu.setFloat64([reference], [0.0, 2e5, 5e5, 60e5])
    assert client.fmu.getFloat64([reference], nValues=4)[1] == 2e5
    with pytest.raises(FMICallException):
        client.fmu.getFloat64([reference + 1], nValues=1)
    with pytest.raises(FMICallException):
        client.fmu.setFloat64([reference], [0.0, 2e5])


def test_a_state_can_be_taken_to_another_instance(path: Path) -> None:
    client, other = Client(path), Client(path)
    client.fmu.exitInitializationMode()
    time = client.reference["time"]

    def follow(each: Client, begin: int, end: int) -> list[list[float]]:
        rows = []
        for row in range(begin, end):
            each.drive(row)
            each.fmu.doStep(time[row], time[1] - time[0])
            rows.append(each.values(each.of("output")))
        return rows

    follow(client, 0, 20)
    content = client.fmu.serializeFMUState(client.fmu.getFMUState())
    other.fmu.setFMUState(other.fmu.deserializeFMUState(content))
    assert follow(other, 20, 40) == follow(client, 20, 40)
