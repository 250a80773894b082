"""Comparison of benches: differences, verdicts, curves, and sources that bywire cannot compare."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace

import numpy as np
import pytest

import bywire
from bywire.bench.result_folder import read_result
from bywire.core.errors import FileError, ParameterError
from bywire.core.scratch import UNFINISHED
from bywire.report.answer import AnswerWarning
from bywire.report.style import SEQUENCE
from undrawn import undrawn

QUICK = {"options.duration": "40 ms", "options.settle": "10 ms"}


@pytest.fixture(scope="module")
def results():
    """Return a brake application, a variant with another winding, and one with requirements."""
    base = bywire.run("hard-braking", {**QUICK, "requirements.overshoot": "<= 15 %"})
    warm = bywire.run(
        "hard-braking",
        {
            **QUICK,
            "motor.R_m": "0.5 ohm",
            "requirements.overshoot": "<= 15 %",
            "requirements.peak_current": "<= 10 A",
        },
    )
    return base, warm


@pytest.fixture(scope="module")
def folders(results, tmp_path_factory):
    """Return the result folders of the benches."""
    top = tmp_path_factory.mktemp("results")
    with undrawn():
        for result, name in zip(results, ("base", "warm"), strict=True):
            result.write(top / name)
    return top / "base", top / "warm"


def test_only_what_differs_is_shown(folders):
    comparison = bywire.compare(*folders)
    differing = [each for each in comparison.settings if each.differs]
    assert [(each.name, each.unit, each.values) for each in differing] == [
        ("motor.R_m", "ohm", (0.35, 0.5))
    ]
    shown = str(comparison)
    assert "0.35 Ω" in shown
    assert "0.5 Ω" in shown
    assert "gear.k_g" not in shown
    full = bywire.compare(*folders, is_full=True)
    assert "gear.k_g" in str(full)
    names = {each["name"] for each in full.as_object()["settings"]}
    assert {"motor.R_m", "options.duration", "simulation.step", "ecu.dither.waveform"} <= names


def test_key_figures_are_those_of_the_runs_with_their_change(results, folders):
    comparison = bywire.compare(*folders)
    base, warm = (result.kpi("peak_current").value for result in results)
    (peak,) = [each for each in comparison.figures if each.name == "peak_current"]
    assert peak.values == (base, warm)
    assert base != warm
    frame = comparison.tables()["Key figures that differ"]
    row = frame[frame["name"] == "peak_current"].iloc[0]
    assert row["change"] == pytest.approx(warm - base)
    # A figure that no run defines counts as equal.
    undefined = [e for e in comparison.figures if all(math.isnan(v) for v in e.values)]
    assert undefined
    assert not any(each.differs for each in undefined)


def test_a_change_smaller_than_the_steps_error_is_not_distinct(results, folders, tmp_path):
    """The verdict is the same from memory and from a folder. It needs an error estimate."""
    changed = {**QUICK, "requirements.overshoot": "<= 15 %", "motor.R_m": "0.3500002 ohm"}
    near = bywire.run("hard-braking", changed)
    with undrawn():
        near.write(tmp_path / "near")
    energies = [each.kpi("energy") for each in (results[0], near)]
    assert 0.0 < abs(energies[1].value - energies[0].value) < sum(e.bound for e in energies)
    pairs = (results[0], near), (folders[0], tmp_path / "near")
    for comparison in (bywire.compare(*pair) for pair in pairs):
        assert "not distinct" in next(
            line for line in str(comparison).splitlines() if line.startswith("energy")
        )
        record = {each["name"]: each for each in comparison.as_object()["kpis"]}
        assert record["energy"]["distinct"] is False
        assert record["energy"]["errors"] == [each.bound for each in energies]
    far = {each.name: each.is_distinct for each in bywire.compare(*folders).figures}
    assert far["energy"]
    without = bywire.run("hard-braking", changed, estimate_error=False)
    plain = bywire.run("hard-braking", QUICK, estimate_error=False)
    assert "not distinct" not in str(bywire.compare(plain, without))


def test_an_error_that_no_step_shows_is_kept_in_a_folder(results, tmp_path):
    """An infinite error is null in JSON, like a missing estimate. The record distinguishes them."""
    unknown = replace(results[0], kpis=tuple(replace(k, error=math.inf) for k in results[0].kpis))
    with undrawn():
        unknown.write(tmp_path / "unknown")
    read = read_result(tmp_path / "unknown")
    assert all(math.isinf(each.error) for each in read.kpis)
    comparison = bywire.compare(tmp_path / "unknown", results[1])
    assert not any(each.is_distinct for each in comparison.figures)


def test_verdicts_stand_beside_each_other(folders):
    frame = bywire.compare(*folders).tables()["Requirements"].set_index("requirement")
    assert frame.loc["overshoot", "limit"] == "<= 15 %"
    assert frame.loc["peak_current", "base"] == "-"
    assert frame.loc["peak_current", "warm"] == "missed"


def test_a_run_without_requirements_is_not_part_of_a_good_verdict():
    judged = bywire.run("hard-braking", {**QUICK, "requirements.peak_current": "<= 50 A"})
    banner = bywire.compare(judged, judged).document().banner
    assert banner.verdict == "good"
    banner = bywire.compare(judged, bywire.run("hard-braking", QUICK)).document().banner
    assert banner.verdict == "none"
    assert "has no requirements" in banner.text


def test_a_verdict_that_the_step_leaves_open_stays_open(folders, tmp_path):
    """A folder records undecided requirements, and the comparison reports them."""
    near = tmp_path / "near"
    near.mkdir()
    record = json.loads((folders[1] / "result.json").read_text(encoding="utf-8"))
    for each in record["requirements"]:
        each |= {"outcome": "undecided", "met": False, "error": 0.5}
    (near / "result.json").write_text(json.dumps(record), encoding="utf-8")
    (near / "run.nc").write_bytes((folders[1] / "run.nc").read_bytes())
    frame = bywire.compare(folders[0], near).tables()["Requirements"].set_index("requirement")
    assert frame.loc["peak_current", "near"] == "undecided"
    assert frame.loc["overshoot", "base"] in ("met", "undecided")


def test_folder_results_and_benches_give_the_same(results, folders):
    from_folder = bywire.compare(*folders).as_object()
    in_memory = bywire.compare(*results).as_object()
    bench = bywire.Bench(
        "hard-braking", "dardanelli2010", options={"duration": "40 ms", "settle": "10 ms"}
    )
    run_now = bywire.compare(bench, bench.with_overrides({"motor.R_m": "0.5 ohm"})).as_object()
    assert from_folder["settings"] == in_memory["settings"] == run_now["settings"]
    assert from_folder["kpis"] == in_memory["kpis"] == run_now["kpis"]


def test_what_a_run_warned_of_is_said_of_its_folder_too(folders, tmp_path):
    with pytest.warns(UserWarning, match="energy balance"):
        coarse = bywire.run("hard-braking", {**QUICK, "pipeline.k_lf": "1e-15"})
    coarse.write(tmp_path / "coarse")
    with pytest.warns(UserWarning, match="coarse: the energy balance"):
        found = bywire.compare(folders[0], tmp_path / "coarse")
    assert found.warnings == [f"coarse: {text}" for text in coarse.warnings]


def test_curves_lie_in_the_brakes_panels_with_what_differs_in_the_legend(folders):
    comparison = bywire.compare(*folders)
    (block,) = [b for b in comparison.document().flat() if getattr(b, "name", "") == "overlay"]
    axes = block.figure.axes
    assert [a.get_ylabel().split("\n")[0] for a in axes[:2]] == ["pressure", "current"]
    legend = [text.get_text() for text in axes[0].get_legend().get_texts()]
    assert legend[:2] == ["base: motor.R_m = 0.35 Ω", "warm: motor.R_m = 0.5 Ω"]
    assert {"±2 % band", "overshoot limit 15 %"} <= {*legend}
    colors = {line.get_color() for line in axes[0].lines}
    assert {SEQUENCE[0], SEQUENCE[1]} <= colors


@pytest.mark.usefixtures("drawn")
def test_one_page_and_one_record(folders, tmp_path):
    bywire.compare(*folders).write(tmp_path / "out")
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "report.html",
        "overlay.png",
        "difference.png",
        "compare.json",
    }
    record = json.loads((tmp_path / "out" / "compare.json").read_text(encoding="utf-8"))
    assert [each["label"] for each in record["runs"]] == ["base", "warm"]


def test_identical_runs_differ_in_nothing(folders):
    comparison = bywire.compare(folders[0], folders[0])
    assert not any(each.differs for each in (*comparison.settings, *comparison.figures))
    assert "are equal" in str(comparison)
    assert len({each.label for each in comparison.runs}) == 2


def test_different_brakes_share_what_they_share(results):
    with pytest.warns(AnswerWarning, match="the runs use different brakes"):
        comparison = bywire.compare(results[0], "moment-ramp")
    names = {each.name for each in comparison.settings}
    assert "motor.R_m" not in names
    assert {"experiment", "assembly"} <= names
    assert comparison.tables()


def test_different_spans_are_said(results):
    with pytest.warns(AnswerWarning, match="different times .*hard-braking"):
        bywire.compare(results[0], bywire.run("hard-braking", {"options.duration": "60 ms"}))


def test_a_static_characteristic_is_compared_by_its_figures():
    with pytest.warns(AnswerWarning, match="not drawn"):
        comparison = bywire.compare(
            "seal-stribeck", "hard-braking", overrides={"seal.T_pr": "0.003 N*m"}
        )
    (row,) = [each for each in comparison.settings if each.name == "experiment"]
    assert row.values == ("seal-stribeck", "hard-braking")


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_are_refused(folders, count):
    with pytest.raises(ParameterError, match="at least two"):
        bywire.compare(*folders[:count])


def test_changes_of_what_was_run_before_are_refused(folders):
    with pytest.raises(ParameterError, match=r"motor.R_m would have no effect"):
        bywire.compare(*folders, overrides={"motor.R_m": "1 ohm"})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "not a complete result of bywire run"),
        ("{", "cannot be read"),
        ("[]", "does not contain a JSON object"),
        ('{"status": "passed"}', "is damaged"),
        (
            '{"status": "passed", "bench": "x", "kpis": {}, "requirements": [], "files": []}',
            "does not list any recording",
        ),
        (
            '{"status": "passed", "bench": "x", "kpis": {}, "requirements": [], '
            '"files": ["gone/run.nc"]}',
            "run.nc is missing",
        ),
        (
            '{"status": "interrupted", "bench": "x", "kpis": {}, "requirements": [], "files": []}',
            "is incomplete",
        ),
    ],
)
def test_folders_that_are_unfinished_or_damaged(folders, tmp_path, content, message):
    broken = tmp_path / "broken"
    broken.mkdir()
    if content is not None:
        (broken / "result.json").write_text(content, encoding="utf-8")
    with pytest.raises(FileError, match=message):
        bywire.compare(folders[0], broken)


def test_a_damaged_recording(folders, tmp_path):
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "result.json").write_text(
        (folders[0] / "result.json").read_text(encoding="utf-8"), encoding="utf-8"
    )
    (broken / "run.nc").write_bytes(b"no NetCDF")
    with pytest.raises(FileError, match=r"run\.nc"):
        bywire.compare(folders[0], broken)


def test_a_folder_whose_settings_another_bench_lacks(results, folders):
    """If only one of two benches has an option, the other column is empty."""
    ramp = bywire.run("seal-stribeck")
    (row,) = [e for e in bywire.compare(results[0], ramp).settings if e.name == "options.p_to"]
    assert row.values == (37e5, None)


def test_a_set_that_is_not_known_here_leaves_values_without_units(folders, tmp_path):
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    for name in ("result.json", "run.nc"):
        (foreign / name).write_bytes((folders[1] / name).read_bytes())
    recording = bywire.read_recording(foreign / "run.nc")
    bywire.write_recording(recording.assign_attrs(parameter_set="gone"), foreign / "run.nc")
    with pytest.warns(AnswerWarning, match="parameter set is not loaded"):
        comparison = bywire.compare(foreign, folders[0])
    (row,) = [each for each in comparison.settings if each.name == "motor.R_m"]
    assert row.values == pytest.approx((0.5, 0.35))
    assert np.isfinite(row.values).all()


def test_a_folder_whose_result_was_not_written_to_its_end(folders, tmp_path):
    shutil.copytree(folders[0], tmp_path / "half")
    (tmp_path / "half" / UNFINISHED).write_text("")
    with pytest.raises(FileError, match="half contains an incomplete result"):
        bywire.compare(tmp_path / "half", folders[1])
