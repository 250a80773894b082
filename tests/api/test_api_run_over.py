"""Runs over a range: table, verdicts at each value, curves, and invalid ranges."""

from __future__ import annotations

import json

import numpy as np
import pytest

import bywire
from bywire.core.errors import BywireError
from bywire.report.style import VERMILLION

QUICK = {"options.duration": "60 ms", "options.settle": "10 ms"}
OVER = "motor.R_m=0.25 ohm:0.5 ohm:6"


@pytest.fixture(scope="module")
def found():
    return bywire.run("hard-braking", {**QUICK, "requirements.peak_current": "<= 18 A"}, over=OVER)


def test_every_value_is_run_and_judged(found):
    assert found.values == pytest.approx((0.25, 0.3, 0.35, 0.4, 0.45, 0.5))
    assert isinstance(found, bywire.BenchRange)
    missed = found.kpi("peak_current") > 18.0
    assert [r.status == "failed" for r in found.results] == missed.tolist()
    assert 0 < missed.sum() < 6
    assert not found.holds
    frame = found.tables()["Key figures"]
    np.testing.assert_allclose(frame["motor.R_m"], found.values)
    np.testing.assert_allclose(frame["peak_current <= 18 A"], found.kpi("peak_current"))
    assert f"peak_current <= 18 A: missed at motor.R_m = {missed.sum()} values" in str(found)


@pytest.mark.usefixtures("drawn")
def test_one_page_with_both_figures_and_all_recordings(found, tmp_path):
    files = {path.name for path in found.write(tmp_path)}
    assert files == {"run.nc", "key-figures.png", "overlay.png", "report.html", "range.json"}
    recording = bywire.read_recording(tmp_path / "run.nc")
    assert recording["p_mc"].dims == ("case", "time")
    np.testing.assert_array_equal(recording["motor.R_m"], found.values)
    record = json.loads((tmp_path / "range.json").read_text(encoding="utf-8"))
    assert [case["value"] for case in record["cases"]] == list(found.values)
    assert record["over"] == "motor.R_m"


def test_the_figure_of_key_figures_marks_what_misses_its_limit(found):
    blocks = {b.name: b for b in found.document().flat() if getattr(b, "name", "")}
    labeled = {a.get_ylabel().split("\n")[0]: a for a in blocks["key-figures"].figure.axes}
    lines = labeled["peak current"].lines
    assert any(np.allclose(line.get_ydata(), 18.0) for line in lines)
    (crosses,) = [line for line in lines if line.get_marker() == "x"]
    assert len(crosses.get_xdata()) == int((found.kpi("peak_current") > 18.0).sum())
    assert crosses.get_color() == VERMILLION
    overlay = blocks["overlay"].figure.axes
    colors = {tuple(line.get_color()) for line in overlay[1].lines if len(line.get_color()) == 4}
    assert len(colors) >= 6


def test_what_changes_by_less_than_its_error_is_said_to_be_not_distinct(found):
    near = bywire.run("hard-braking", QUICK, over="motor.R_m=0.35 ohm, 0.3500002 ohm")
    assert near.as_object()["distinct"]["energy"] is False
    assert "no change over motor.R_m beyond the numerical error: dead_time" in str(near)
    assert found.as_object()["distinct"]["energy"] is True
    said = [line for line in str(found).splitlines() if "no change over" in line]
    assert not any("energy" in line for line in said)


def test_a_static_characteristic_over_a_range(tmp_path):
    found = bywire.run("seal-stribeck", over="seal.T_pr=0.002 N*m, 0.004 N*m")
    assert np.ptp(found.kpi("breakaway_apply")) > 0
    found.write(tmp_path)


@pytest.mark.parametrize(
    ("over", "message"),
    [
        ("motor.R_m", "NAME=LOW:HIGH:COUNT"),
        ("motor.R_n=1 ohm:2 ohm:3", "did you mean 'motor.R_m'"),
        ("motor.R_m=1 V:2 V:3", "ohm"),
        ("motor.R_m=1 ohm", "two different values"),
        ("motor.R_m=0.3 ohm, -1 ohm", "motor.R_m = -1"),
        ("options.p_too=1 bar:2 bar:3", "did you mean 'options.p_to'"),
    ],
)
def test_what_is_no_range_is_refused(over, message):
    with pytest.raises(BywireError, match=message):
        bywire.run("hard-braking", over=over)
