"""`bywire.identify`, `bywire.trust`, `bywire.replay`, `bywire.convert` as a notebook calls them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bywire
from bywire.core.errors import ParameterError
from bywire.identification.method import METHODS
from bywire.report.answer import AnswerWarning
from raising import raises

SHORT = {"duration": "0.1 s"}


@pytest.mark.usefixtures("drawn")
def test_a_simulated_winding_shows_itself_and_is_written_whole(tmp_path: Path) -> None:
    found = bywire.identify("motor-winding", synthetic=1, options=SHORT, starts=2)
    assert found.holds
    table = found.tables()["Winding"].set_index("parameter")
    estimate = found.estimates["winding"]
    assert table.loc["motor.R_m", "estimate"] == pytest.approx(estimate["motor.R_m"])
    assert found.parameters["motor.R_m"] == estimate["motor.R_m"]
    assert set(found.data.dims) == {"time"}
    assert "Do not use it" not in found._repr_html_()
    names = {path.name for path in found.write(tmp_path)}
    assert {"measurement.nc", "parameters.toml", "estimate.json", "report.html"} <= names
    kept = json.loads((tmp_path / "estimate.json").read_text())
    assert kept["parameters"] == found.as_object()["parameters"]
    assert {Path(file).name for file in kept["files"]} == names
    bench = bywire.load(tmp_path / "parameters.toml")
    assert bench.par.leaves()["motor.R_m"] == pytest.approx(found.parameters["motor.R_m"])
    found.write(tmp_path)  # overwrites the file's own result
    other = bywire.identify("friction-model", synthetic=1, options={"duration": "4 s"})
    with pytest.raises(bywire.BywireError, match="contains a result of motor-winding"):
        other.write(tmp_path)
    assert (tmp_path / "parameters.toml").exists()


def test_a_failed_check_is_warned_of() -> None:
    with pytest.warns(AnswerWarning, match="check failed: misfit_over_friction"):
        found = bywire.identify(
            "friction-model", synthetic=1, options={"law": "viscous", "duration": 4.0}
        )
    assert not found.holds
    assert "Do not use this result" in found._repr_html_()


def test_signals_in_memory_are_a_measurement() -> None:
    made = bywire.identify("seal-friction", synthetic=2)
    again = bywire.identify("seal-friction", made.data)
    assert again.source == "signals in memory"
    assert again.estimates["seal friction"]["A"] == made.estimates["seal friction"]["A"]
    assert again.put_in == {}
    with raises(ParameterError, name="synthetic", valid="only one of these: measurement files"):
        bywire.identify("seal-friction", made.data, synthetic=2)
    with raises(ParameterError, name="unknowns"):
        bywire.identify("seal-friction", made.data, question=bywire.Question(unknowns="A"))


def test_trust_goes_on_from_its_folder(tmp_path: Path) -> None:
    first = bywire.trust("seal-friction", 4, seed=30, folder=tmp_path, processes=1)
    lines = (tmp_path / "experiments.jsonl").read_text()
    again = bywire.trust("seal-friction", 4, seed=30, folder=tmp_path, processes=1)
    assert (tmp_path / "experiments.jsonl").read_text() == lines
    assert again.trust == first.trust
    assert [path.name for path in first.write(tmp_path)] == ["study.json"]
    assert set(first.tables()["seal-friction"]["parameter"]) == {"A", "F_0", "f"}


def test_an_interrupt_says_where_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    bywire.trust("seal-friction", 2, folder=tmp_path, processes=1)
    with monkeypatch.context() as stop:
        stop.setattr("bywire.identification.trust.experiments", stopped)
        with pytest.raises(KeyboardInterrupt, match="experiments are saved in"):
            bywire.trust("seal-friction", 4, folder=tmp_path)
    (tmp_path / "starts.jsonl").write_text("")
    method = replace(METHODS.find("seal-friction"), identify=stopped)
    monkeypatch.setattr("bywire.api.identification.find_method", lambda _: method)
    with pytest.raises(KeyboardInterrupt, match="finished starts are saved in"):
        bywire.identify("seal-friction", synthetic=1, folder=tmp_path)


@pytest.mark.usefixtures("drawn")
def test_a_recording_is_replayed_from_memory(tmp_path: Path) -> None:
    bench = bywire.Bench("moment-pulses", "roberts2003", options={"t_hold": 0.1, "pulses": 1})
    recording = bywire.run(bench).recording[["M_set", "y_M", "x"]]
    found = bywire.replay(recording, bench, outputs=["x"], tolerances=["nrmse <= 2 %"])
    assert found.holds
    assert set(found.recording) == {"x_measured", "x_modeled", "M_set"}
    difference = found.recording["x_modeled"] - found.recording["x_measured"]
    assert float(np.abs(difference).max()) < 1e-6
    assert found.tables()["Fit"]["nrmse"].to_list()[0] < 2.0
    assert {path.name for path in found.write(tmp_path)} == {
        "replay.nc",
        "x.png",
        "report.html",
        "replay.json",
    }
    with pytest.raises(bywire.BywireError, match=r"nrmse <= 5 %"):
        bywire.replay(recording, bench, tolerances=["nrmse"])


def test_a_file_is_converted(tmp_path: Path) -> None:
    source, target = tmp_path / "run.csv", tmp_path / "run.nc"
    source.write_text("t [s],p [bar]\n" + "".join(f"{0.01 * k:.2f},{k}\n" for k in range(50)))
    found = bywire.convert(source, target, rate="50 Hz")
    assert found.alignment is not None
    assert found.alignment.samples == found.recording.sizes["time"] == 25
    assert found.as_object()["files"] == [str(target)]
    assert found.tables()["Signals"]["signal"].to_list() == ["p"]
    with pytest.raises(bywire.BywireError, match="Add a sample rate, for example rate '1 kHz'"):
        bywire.convert(source, tmp_path / "other.nc", method="average")
