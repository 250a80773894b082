"""Command design: gains, binding requirements, infeasible requirements, bench files that run."""

from __future__ import annotations

import math

import pytest
from command_line import page_text, refused

from few_starts import few_starts

LINEAR = ("--linear-only", "--json")


@pytest.fixture(autouse=True)
def few():
    with few_starts():
        yield


def test_design_over_a_range_names_what_binds(bywire):
    outcome = bywire(
        "design",
        "moment",
        "--require",
        "crossover >= 5 Hz",
        "--require",
        "phase margin >= 60 deg",
        "--over",
        "wedge.mu_B=0.25:0.45:2",
        *LINEAR,
    )
    assert outcome.status == 0
    found = outcome.object
    assert found["status"] == "met"
    assert found["bench"] is None
    assert found["linear"]["worst"]["phase_margin"]["at"] == "wedge.mu_B = 0.45"
    assert {one["requirement"] for one in found["linear"]["binding"]} == {
        "crossover >= 5 Hz",
        "phase_margin >= 60 deg",
    }
    gains = found["gains"]
    # The command margins agrees for these gains.
    settings = [text for name, value in gains.items() for text in ("--set", f"{name}={value} Hz")]
    shown = bywire("margins", "moment", *settings, "--json").object
    margins = shown["margins"]
    assert gains.keys() <= shown["changes"].keys()
    assert margins["phase"] == pytest.approx(found["linear"]["nominal"]["phase_margin"], rel=1e-3)


@pytest.mark.usefixtures("drawn")
def test_requirements_from_a_file_and_a_bench_file_that_runs(bywire, tmp_path):
    file = tmp_path / "requirements.toml"
    file.write_text(
        '[requirements]\nbandwidth = ">= 80 Hz"\nphase_margin = [">= 60 deg", "<= 150 deg"]\n'
    )
    outcome = bywire(
        "design",
        "current",
        "--requirements",
        file,
        "--set",
        "motor.R_m=0.4 ohm",
        "--out",
        tmp_path / "out",
        "--verbose",
    )
    assert outcome.status in (0, 1)
    assert "nonlinear bench" in outcome.out
    assert "bandwidth, sine of 1 A" in outcome.out
    page = page_text(tmp_path / "out" / "report.html")
    assert "ecu.current.k_p" in page
    assert "disk_margin &gt;= 0.5" in page
    names = {path.name for path in (tmp_path / "out").glob("*.png")}
    assert names == {f"current-design-{one}.png" for one in ("loop-gain", "sensitivity", "step")}
    bench = tmp_path / "out" / "current-design.toml"
    text = bench.read_text()
    assert 'motor.R_m = "0.4 ohm"' in text
    run = bywire("run", bench, "--json")
    assert run.status == 0
    overshoot = run.object["kpis"]["overshoot"]
    assert math.isfinite(overshoot["value"] if isinstance(overshoot, dict) else overshoot)


def test_what_excludes_what(bywire):
    outcome = bywire(
        "design",
        "moment",
        "--require",
        "bandwidth >= 20 Hz",
        "--require",
        "phase margin >= 80 deg",
        *LINEAR,
    )
    assert outcome.status == 1
    found = outcome.object
    assert found["status"] == "infeasible"
    best = {one["requirement"]: one["best"] for one in found["linear"]["conflicts"]}
    assert best["phase_margin >= 80 deg"] == pytest.approx(66.9, abs=0.5)
    assert best["bandwidth >= 20 Hz"] < 10.0


def test_what_is_set_stays(bywire):
    outcome = bywire(
        "design",
        "current",
        "--set",
        "ecu.current.k_i=10 1/(A*s)",
        "--require",
        "phase margin >= 60 deg",
        *LINEAR,
    )
    assert outcome.status == 0
    assert set(outcome.object["gains"]) == {"ecu.current.k_p"}


def test_the_operating_point_may_be_a_range(bywire):
    kept = ("k_d=1.5e-7 A*s/Pa", "tau_d=2 ms", "b=1", "c=0", "k_i=5e-5 A/(Pa*s)")
    outcome = bywire(
        "design",
        "pressure",
        "--require",
        "phase margin >= 60 deg",
        "--over",
        "at=5 bar:35 bar:2",
        *LINEAR,
        *(part for one in kept for part in ("--set", f"ecu.pressure.{one}")),
    )
    assert outcome.status == 0
    places = {one["at"] for one in outcome.object["linear"]["worst"].values()}
    assert {"pressure = 5 bar", "pressure = 35 bar"} & places
    margins = bywire("margins", "pressure", "--over", "at=5 bar:35 bar:2", "--json").object
    assert margins["over"] == "pressure"
    assert [one["pressure"] for one in margins["cases"]] == [5e5, 35e5]


def test_the_bench_looks_at_the_worst_corner_too(bywire):
    arguments = (
        "design",
        "current",
        "--require",
        "bandwidth >= 60 Hz",
        "--set",
        "ecu.current.k_i=10.39 1/(A*s)",
        "--over",
        "motor.R_m=0.3 ohm, 0.4 ohm",
        "--amplitudes",
        "1 A",
    )
    outcome = bywire(*arguments, "--verbose")
    assert outcome.status in (0, 1)
    assert "bandwidth, sine of 1 A at motor.R_m = 0." in outcome.out
    assert "(worst of 2 corners)" in " ".join(outcome.out.split())  # lines may be wrapped
    assert "ecu.current.k_p" in outcome.out


def test_a_gain_schedule_as_a_bench_file_that_runs(bywire, tmp_path):
    kept = [
        f"ecu.{region}.{name}={value}"
        for region in ("pressure", "schedule.low", "schedule.high")
        for name, value in (("k_p", "2e-5 A/Pa"), ("k_i", "4e-4 A/(Pa*s)"), ("k_d", "4e-7 A*s/Pa"))
        if (region, name) != ("schedule.low", "k_p")
    ]
    kept += ["ecu.pressure.tau_d=56 us", "ecu.pressure.b=1", "ecu.pressure.c=1"]
    outcome = bywire(
        "design",
        "pressure",
        "--schedule",
        "--at",
        "6 bar, 20 bar, 37 bar",
        "--require",
        "phase margin >= 60 deg",
        "--linear-only",
        "--json",
        "--out",
        tmp_path / "out",
        *(part for one in kept for part in ("--set", one)),
    )
    assert outcome.status == 0
    found = outcome.object
    assert found["operating_points"] == {
        "unit": "Pa",
        "low": [6e5],
        "medium": [2e6],
        "high": [3.7e6],
    }
    assert found["gains"].keys() == {"ecu.schedule.low.k_p"}
    # Less gain has more phase margin, until the limit on the steady-state error binds.
    bound = {one["requirement"] for one in found["regions"]["low"]["binding"]}
    assert bound & {"phase_margin >= 60 deg", "steady_state_error <= 5 %"}
    assert found["across"]["worst"]["slack"] == min(
        one["slack"] for one in found["across"]["cases"]
    )
    file = tmp_path / "out" / "pressure-design.toml"
    assert 'ecu.schedule.law = "regions"' in file.read_text()
    run = bywire("run", file, "--json")
    assert run.status == 0


@pytest.mark.parametrize(
    ("arguments", "texts"),
    [
        (("momment", "--require", "bandwidth >= 5 Hz"), ("did you mean 'moment'",)),
        (("moment",), ("needs at least one requirement", "bandwidth >= 10 Hz")),
        (("moment", "--require", "bandwith >= 5 Hz"), ("bandwidth",)),
        (
            ("moment", "--require", "bandwidth >= 10 Hz", "--require", "bandwidth <= 5 Hz"),
            ("contradict",),
        ),
        (("moment", "--require", "bandwidth >= 900 Hz"), ("< 500 Hz",)),
        (
            ("moment", "--require", "bandwidth >= 5 Hz", "--over", "control.moment.f_c=5:6:2"),
            ("Hz",),
        ),
        (
            ("moment", "--require", "bandwidth >= 5 Hz", "--set", "control.moment.f_c=5 Hz"),
            ("--set fixes all",),
        ),
        (
            ("moment", "--schedule", "--require", "bandwidth >= 5 Hz"),
            ("'moment' has no gain schedule", "--schedule"),
        ),
        (
            ("pressure", "--schedule", "--at", "5 bar, 20 bar", "--require", "bandwidth >= 5 Hz"),
            ("region 'high'", "35 bar", "--at"),
        ),
        (
            (
                "pressure",
                "--schedule",
                "--require",
                "bandwidth >= 5 Hz",
                "--over",
                "at=5 bar:30 bar:3",
            ),
            ("schedule", "pressure", "--at"),
        ),
        (
            ("pressure", "--require", "bandwidth >= 5 Hz", "--over", "motor.R=0.3:0.4:2"),
            ("unknown parameter 'motor.R'", "motor.R_m"),
        ),
        (("moment", "--requirements", "nowhere.toml"), ("nowhere.toml", "No such file")),
    ],
)
def test_bad_input(bywire, arguments, texts):
    refused(bywire("design", *arguments), *texts)
