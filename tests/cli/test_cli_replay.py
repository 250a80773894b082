"""``bywire replay``: tables, tolerances, tracking, refusals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import Outcome, no_half_files, refused

import bywire as package
from bywire.data.writing import write_measurement

Bywire = Callable[..., Outcome]


@pytest.fixture(scope="module")
def stop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file of a braking with less friction than in the parameter set."""
    bench = package.Bench(
        "moment-pulses",
        "roberts2003",
        overrides={"wedge.mu_B": 0.32},
        options={"t_hold": 0.3, "pulses": 3},
    )
    run = package.run(bench).recording[["M_set", "y_M", "F_N", "x", "Omega"]]
    noise = np.random.default_rng(1).standard_normal(run.sizes["time"])
    run["y_M"] = ("time", run["y_M"].values + 2.0 * noise, run["y_M"].attrs)
    return write_measurement(run, tmp_path_factory.mktemp("replay") / "stop.csv")


@pytest.mark.usefixtures("drawn")
def test_right_parameters_pass_and_the_report_is_complete(
    bywire: Bywire, stop: Path, tmp_path: Path
) -> None:
    outcome = bywire(
        "replay",
        stop,
        "--bench",
        "moment-pulses",
        "--set",
        "wedge.mu_B=0.32",
        "--output",
        "y_M",
        "--output",
        "x",
        "--tolerance",
        "nrmse <= 2 %",
        "--tolerance",
        "x.max_error <= 0.01 mm",
        "--segments",
        "auto",
        "--track",
        "mu_B",
        "--out",
        tmp_path,
        "--json",
    )
    assert outcome.status == 0, outcome.err
    found = outcome.object
    assert found["holds"]
    assert found["changes"] == {
        "wedge.mu_B": {"value": "0.32", "instead_of": "0.35", "of": "roberts2003"}
    }
    assert {s["name"] for s in found["segments"]} >= {"hold-1", "move-1"}
    assert {Path(f).name for f in found["files"]} == {
        "y_M.png",
        "x.png",
        "track-wedge.mu_B.png",
        "report.html",
        "replay.nc",
        "replay.json",
    }
    assert all(Path(f).stat().st_size > 500 for f in found["files"])
    no_half_files(tmp_path)
    tracked = found["tracked"]["wedge.mu_B"]
    assert tracked["low"][-1] < 0.32 < tracked["high"][-1]
    assert "The model reproduces the record within" in (tmp_path / "report.html").read_text()


def test_wrong_parameters_miss_the_tolerance(bywire: Bywire, stop: Path) -> None:
    outcome = bywire(
        "replay",
        stop,
        "--bench",
        "moment-pulses",
        "--output",
        "x",
        "--tolerance",
        "nrmse <= 2 %",
    )
    assert outcome.status == 1
    assert "missed: nrmse <= 2 %" in " ".join(outcome.out.split())


def test_a_refusal_lists_what_resembles_the_input_first_and_not_all(
    bywire: Bywire, tmp_path: Path
) -> None:
    names = [f"x_{k}" for k in range(30)] + ["pressure_set", "i_setpoint"]
    rows = [",".join([f"{1e-3 * k:.3f}", *["1.0"] * len(names)]) for k in range(20)]
    path = tmp_path / "many.csv"
    head = ",".join(["time [s]", *(f"{name} [1]" for name in names)])
    path.write_text("\n".join([head, *rows]) + "\n")
    (line,) = bywire("replay", path, "--bench", "hard-braking").lines
    listed = line.partition("The measured signals are ")[2].partition(". All inputs")[0]
    assert set(listed.split(", ")[:2]) == {"pressure_set [1]", "i_setpoint [1]"}
    assert listed.endswith(" and 20 more")


def pedal_record(folder: Path) -> Path:
    """Return a record as a German rig writes it: decimal commas, cp1252, pedal and pressure."""
    rows = [
        f"{1e-3 * k:.3f};{6 + 0.01 * k:.2f};{20 + 0.04 * k:.2f};{2 + 0.01 * k:.2f}"
        for k in range(400)
    ]
    titles = "Zeit [s];Pedalweg [mm];Fußkraft [N];Druck [bar]"
    path = folder / "ride.csv"
    path.write_bytes("\r\n".join([titles, *rows, ""]).replace(".", ",").encode("cp1252"))
    return path


def test_a_pedal_record_is_replayed_by_what_each_message_says_to_type(
    bywire: Bywire, tmp_path: Path
) -> None:
    command = ["replay", pedal_record(tmp_path), "--bench", "pedal-tracking", "--no-error-estimate"]
    typed = "--input pedal_force=Fußkraft"
    refused(bywire(*command), "drives pedal_force [N]", typed, "Pedalweg [mm]", "Druck [bar]")
    command += typed.split()
    typed = "--output p_mc=Druck"
    refused(bywire(*command), typed, "Druck may also be p_pd, p_ref, p_meas", "'bywire list motor")
    outcome = bywire(*command, *typed.split(), "--json")
    assert outcome.status == 0, outcome.err
    assert [note for note in outcome.object["notes"] if "cp1252" in note]


def test_of_two_columns_that_may_drive_the_first_is_suggested(
    bywire: Bywire, tmp_path: Path
) -> None:
    rows = [f"{1e-3 * k:.3f},{6 + 0.1 * k:.2f},{6 + 0.09 * k:.2f}" for k in range(40)]
    path = tmp_path / "rig.csv"
    path.write_text("\n".join(["t [s],Soll [bar],Haupt [bar]", *rows, ""]))
    outcome = bywire("replay", path, "--bench", "hard-braking")
    refused(outcome, "For example, type --input p_set=Soll. Haupt would also fit. ")


def test_an_unknown_output_names_those_of_its_unit_first_and_the_whole_list(
    bywire: Bywire, tmp_path: Path
) -> None:
    command = ("replay", pedal_record(tmp_path), "--bench", "pedal-tracking", "--output", "z=Druck")
    (line,) = bywire(*command, "--input", "pedal_force=Fußkraft").lines
    assert "valid names are p_mc, p_meas, p_pd, p_ref, " in line
    assert line.endswith("('bywire list motorcycle-brake' shows all)")


def test_a_replay_notes_the_inputs_that_the_experiment_still_drives(
    bywire: Bywire, tmp_path: Path
) -> None:
    columns = ("--input", "p_set=Druck", "--output", "p_mc=Druck", "--no-error-estimate")
    outcome = bywire("replay", pedal_record(tmp_path), "--bench", "pedal-tracking", *columns)
    assert "no measured signal replaces the experiment's pedal_force" in outcome.err


def test_a_record_without_the_driven_quantity_hints_at_a_mapping(
    bywire: Bywire, tmp_path: Path
) -> None:
    path = tmp_path / "travel.csv"
    path.write_text("time [s],travel [mm]\n0,6\n0.001,7\n0.002,8\n")
    text = "drives pedal_force [N], but no measured signal has its unit"
    refused(bywire("replay", path, "--bench", "pedal-tracking"), text, "--map")


def test_refusals(bywire: Bywire, stop: Path) -> None:
    base = ("replay", stop, "--bench")
    refused(bywire(*base, "moment-pulse"), "moment-pulses")
    moment = (*base, "moment-pulses")
    refused(bywire(*moment, "--input", "M_st=M_set"), "M_set")
    refused(bywire(*moment, "--output", "theta_9"), "theta_1")
    refused(bywire(*moment, "--tolerance", "nrmse"), "nrmse <= 5 %")
    refused(bywire(*moment, "--tolerance", "nmrse <= 5 %"), "nrmse")
    refused(bywire(*moment, "--track", "alpha"), "wedge.mu_B")
    refused(bywire(*base, "motor-open-loop"), "no measured signal drives the model")
    refused(
        bywire(*base, "hard-braking"),
        "drives p_set [bar], but",
        "All inputs of the model are p_set, ",
    )
    refused(bywire("replay", "none.csv", "--bench", "moment-pulses"), "none.csv")


@pytest.mark.parametrize(
    ("given", "right"),
    [
        (("--input", "Demand=M_set", "--output", "y_M"), "--input M_set=Demand"),
        (("--output", "Moment=y_M [kN*m]"), '--output "y_M=Moment [kN*m]"'),
    ],
)
def test_a_column_before_its_signal_is_swapped_in_the_error(
    bywire: Bywire, stop: Path, given: tuple[str, ...], right: str
) -> None:
    refused(bywire("replay", stop, "--bench", "moment-pulses", *given), f"Write {right}")
