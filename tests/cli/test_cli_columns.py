"""Column names specified without a mapping file: replay, identify, convert, forms."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from command_line import Outcome, refused
from scipy.io import savemat

import bywire
from bywire import read_measurement
from bywire.api.replay import Replay
from bywire.core import brake as registry
from bywire.core.errors import FileError, ParameterError, UnitError
from bywire.server.place import Place
from bywire.server.task import tasks
from raising import raises
from systems.loading import SPRING_AXIS, forgotten

Bywire = Callable[..., Outcome]
INCH, POUND_FORCE = 0.0254, 0.45359237 * 9.80665  # m, N: by definition
BENCH = """
experiment = "open-loop"
[options]
input = "F_set"
output = "x"
record = "1 ms"
duration = "0.3 s"
[stimulus]
kind = "multisine"
mean = 0
amplitude = "60 N"
f_base = "4 Hz"
n = 12
t_start = 0
[set]
F_c = 0
k_c = "0.001 N/m"
"""
NAMED = ("--input", "F_set=Kraft [lbf]", "--output", "x=Weg [inch]", "--time", "Zeit [s]")


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return a table in inches and pounds whose columns have no unit, next to its bench."""
    with forgotten():
        registry._loaded.clear()  # brakes of other tests also provide parameter sets
        bywire.load_system(SPRING_AXIS)
        monkeypatch.chdir(tmp_path)
        (tmp_path / "axis.toml").write_text(BENCH)
        bench = bywire.Bench(
            "open-loop",
            overrides={"F_c": 0.0, "k_c": 1e-3, "k": 9e3},
            options={"input": "F_set", "output": "x", "record": 1e-3, "duration": 0.3},
            stimulus={
                "kind": "multisine",
                "mean": 0.0,
                "amplitude": 60.0,
                "f_base": 4.0,
                "n": 12,
                "t_start": 0.0,
            },
        )
        recording = bywire.run(bench, estimate_error=False).recording
        demand = bench.cases()[0].stimulus(recording["time"].values)["F_set"]
        columns = (
            recording["time"].values,
            demand / POUND_FORCE,
            recording["x"].values / INCH,
            np.arange(demand.size),
        )
        rows = [",".join(f"{value:.17g}" for value in row) for row in zip(*columns, strict=True)]
        table = tmp_path / "rig.csv"
        table.write_text("\n".join(["Zeit,Kraft,Weg,Zaehler", *rows]) + "\n")
        yield table


def nrmse(replay: Replay) -> float:
    """Return the only output's error relative to its range [%]."""
    (fit,) = replay.fits
    return next(figure.value for figure in fit.kpis if figure.name == "nrmse")


def test_replay_takes_columns_by_their_names_and_units(bywire: Bywire, rig: Path) -> None:
    done = bywire("replay", rig, "--bench", "axis.toml", *NAMED, "--set", "k=9 N/mm", "--json")
    assert done.status == 0, done.err
    assert done.object["segments"][0]["figures"]["nrmse"]["value"] < 1e-9  # %


def test_identify_takes_columns_and_noise(bywire: Bywire, rig: Path) -> None:
    named = [text.replace("[inch]", "[inch] +- 1 um") for text in NAMED]
    done = bywire(
        "identify",
        "output-error",
        rig,
        "--bench",
        "axis.toml",
        *named,
        "--unknown",
        "k",
        "--starts",
        1,
        "--holdout",
        "other.csv",
        "--json",
    )
    refused(done, "other.csv")  # bywire reads the held-out file in the same way as the other file
    (rig.parent / "other.csv").write_text(rig.read_text() + "0.3010,0,0,0\n")
    done = bywire(
        "identify",
        "output-error",
        rig,
        "--bench",
        "axis.toml",
        *named,
        "--unknown",
        "k",
        "--starts",
        1,
        "--holdout",
        "other.csv",
        "--json",
    )
    assert done.object["parameters"]["k"] == pytest.approx(9e3, rel=1e-9)
    assert "warning" not in done.err  # the model itself produced the record
    assert done.object["figures"]["x.noise"]["value"] == pytest.approx(1e-6)


def test_a_check_that_fails_says_what_to_try_next(bywire: Bywire, rig: Path) -> None:
    """The spring is 10 % too stiff, and the fit estimates only the damping."""
    done = bywire(
        "identify",
        "output-error",
        rig,
        "--bench",
        "axis.toml",
        *NAMED,
        "--unknown",
        "d",
        "--starts",
        1,
    )
    assert done.status == 1
    assert "check failed: residual_over_noise" in done.err
    assert "x, which has the largest residual" in done.err
    assert "such as spikes, use --loss huber" in done.err


def test_convert_names_columns(bywire: Bywire, rig: Path) -> None:
    done = bywire(
        "convert", rig, "out.nc", "--signals", "x=Weg [inch], Kraft [lbf]", "--time", "Zeit [s]"
    )
    assert done.status == 0, done.err
    table = np.loadtxt(rig, delimiter=",", skiprows=1)
    found = read_measurement("out.nc")
    np.testing.assert_allclose(found["x"], INCH * table[:, 2], rtol=1e-12)
    np.testing.assert_allclose(found["Kraft"], POUND_FORCE * table[:, 1], rtol=1e-12)
    fast = ("--signals", "x=Weg [mm]", "--time", "2 kHz")
    assert bywire("convert", rig, "rate.nc", *fast).status == 0
    assert float(read_measurement("rate.nc")["time"][-1]) == pytest.approx(0.15)


@pytest.mark.parametrize(
    ("words", "typed"),
    [
        (
            (
                "replay",
                "titled.csv",
                "--bench",
                "axis.toml",
                "--input",
                "F_set=Kraft",
                "--output",
                "x=Weg",
            ),
            '--input F_set="Kraft [N]" --output x="Weg [mm]" --time "time [s]"',
        ),
        (
            (
                "identify",
                "output-error",
                "titled.csv",
                "--bench",
                "axis.toml",
                "--input",
                "F_set=Kraft",
                "--output",
                "x=Weg",
                "--unknown",
                "k",
            ),
            '--input F_set="Kraft [N]" --output x="Weg [mm]" --time "time [s]"',
        ),
        (
            ("convert", "titled.csv", "out.csv", "--signals", "x=Weg, Kraft"),
            '--signals "x=Weg [UNIT], Kraft [UNIT]" --time "time [s]"',
        ),
        (
            ("identify", "seal-friction", "titled.csv", "--output", "F=Kraft", "--output", "x=Weg"),
            '--output F="Kraft [N]" --output x="Weg [mm]" --time "time [s]"',
        ),
        (
            (
                "replay",
                "timeless.csv",
                "--bench",
                "axis.toml",
                "--input",
                "F_set=Kraft",
                "--output",
                "x=Weg",
            ),
            '--input F_set="Kraft [N]" --output x="Weg [mm]" --time "COLUMN [s]"',
        ),
    ],
    ids=["replay", "identify", "convert", "method", "no-time"],
)
def test_one_message_shows_what_to_type_for_all_columns_without_units(
    bywire: Bywire, rig: Path, words: tuple[str, ...], typed: str
) -> None:
    (rig.parent / "titled.csv").write_text(rig.read_text().replace("Zeit", "time"))
    (rig.parent / "timeless.csv").write_text(rig.read_text().replace("Zeit", "Lauf"))
    refused(bywire(*words), f"{typed}, each with its column's unit")


def test_columns_with_brackets_and_commas_in_their_names(bywire: Bywire, tmp_path: Path) -> None:
    """For rows of Simulink's To File, the message's advice works after filling in the units."""
    savemat(tmp_path / "rows.mat", {"ans": np.vstack([np.arange(99.0), np.ones((2, 99))])})
    words = ("convert", tmp_path / "rows.mat", tmp_path / "out.nc")
    outcome = bywire(*words)
    refused(outcome, "ans(2,:) [UNIT], ans(3,:) [UNIT]")
    typed = outcome.err.split('--signals "')[1].split('"')[0].replace("UNIT", "bar")
    assert bywire(*words, "--signals", typed).status == 0
    assert float(read_measurement(tmp_path / "out.nc")["ans(3,:)"][0]) == 1e5


def test_python_takes_the_same_words(rig: Path) -> None:
    named = {"inputs": {"F_set": "Kraft [lbf]"}, "time": "Zeit [s]"}
    found = bywire.replay(rig, "axis.toml", {"k": "9 N/mm"}, outputs={"x": "Weg [inch]"}, **named)
    assert nrmse(found) < 1e-9
    data = bywire.read_measurement(
        rig,
        {
            "time": {"column": "Zeit", "unit": "s"},
            "signals": {"F": {"column": "Kraft [lbf]"}, "s": {"column": "Weg [inch]"}},
        },
    )
    again = bywire.replay(
        data, "axis.toml", {"k": "9 N/mm"}, inputs={"F_set": "F"}, outputs={"x": "s"}
    )
    assert nrmse(again) < 1e-9
    with pytest.raises(UnitError, match=r"outputs=\{'x': 'Weg \[mm\]'\}"):
        bywire.replay(rig, "axis.toml", outputs={"x": "Weg"}, **named)
    (rig.parent / "units.csv").write_text(rig.read_text().replace("Kraft", "Kraft [N]"))
    with pytest.raises(UnitError, match="'N' in the file but 'kN'"):
        bywire.replay(
            "units.csv",
            "axis.toml",
            outputs={"x": "Weg [mm]"},
            inputs={"F_set": "Kraft [kN]"},
            time="Zeit [s]",
        )
    with raises(ParameterError, name="x", value="Weg [mm]"):
        bywire.replay(rig, "axis.toml", inputs={"F_set": "x"}, outputs={"x": "Weg [mm]"})
    with pytest.raises(FileError, match="has no column 'Wege"):
        bywire.replay(rig, "axis.toml", outputs={"x": "Wege [mm]"}, **named)


def test_forms_take_the_same_words(rig: Path) -> None:
    place = Place(rig.parent.resolve())
    typed = {
        "bench": "axis.toml",
        "measurement": "rig.csv",
        "input": "F_set=Kraft [lbf]",
        "output": "x=Weg [inch]",
        "time": "Zeit [s]",
        "set": "k=9 N/mm",
    }
    asked = tasks()["replay"].read(typed, place)
    found = tasks()["replay"].compute(asked, rig.parent / "out", lambda *_: None)
    assert nrmse(found) < 1e-9
    fitted = {
        **typed,
        "method": "output-error",
        "measurements": "rig.csv",
        "set": "",
        "unknown": "k",
        "starts": "1",
    }
    del fitted["measurement"]
    (rig.parent / "out").mkdir()
    asked = tasks()["identify"].read(fitted, place)
    found = tasks()["identify"].compute(asked, rig.parent / "out", lambda *_: None)
    assert found.parameters["k"] == pytest.approx(9e3, rel=1e-9)
