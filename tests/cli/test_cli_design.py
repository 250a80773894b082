"""The command design: gains, what binds, what cannot be met, files that run."""

from __future__ import annotations

import math

import pytest
from command_line import refused

LINEAR = ("--linear-only", "--json")


def test_design_over_a_range_names_what_binds(bywire):
    outcome = bywire(
        "design", "moment", "--require", "crossover >= 5 Hz", "--require", "phase margin >= 60 deg",
        "--over", "wedge.mu_B=0.25:0.45:2", *LINEAR,
    )  # fmt: skip
    assert outcome.status == 0
    found = outcome.object
    assert found["status"] == "met"
    assert found["bench"] is None
    assert found["linear"]["worst"]["phase_margin"]["at"] == "wedge.mu_B = 0.45"
    assert {one["requirement"] for one in found["linear"]["binding"]} == {
        "crossover >= 5 Hz", "phase_margin >= 60 deg",
    }  # fmt: skip
    gains = found["gains"]
    # The command margins says the same of these gains.
    settings = [text for name, value in gains.items() for text in ("--set", f"{name}={value} Hz")]
    margins = bywire("margins", "moment", *settings, "--json").object["margins"]
    assert margins["phase"] == pytest.approx(found["linear"]["nominal"]["phase_margin"], rel=1e-3)


def test_requirements_from_a_file_and_a_bench_file_that_runs(bywire, tmp_path):
    file = tmp_path / "requirements.toml"
    file.write_text(
        '[requirements]\nbandwidth = ">= 80 Hz"\nphase_margin = [">= 60 deg", "<= 150 deg"]\n'
    )
    outcome = bywire(
        "design", "current", "--requirements", file, "--set", "motor.R_m=0.4 ohm", "--out",
        tmp_path / "out",
    )  # fmt: skip
    assert outcome.status in (0, 1)
    assert "nonlinear bench" in outcome.out
    assert "bandwidth, sine of 1 A" in outcome.out
    bench = tmp_path / "out" / "current-design.toml"
    text = bench.read_text()
    assert 'motor.R_m = "0.4 ohm"' in text
    run = bywire("run", bench, "--json")
    assert run.status == 0
    overshoot = run.object["kpis"]["overshoot"]
    assert math.isfinite(overshoot["value"] if isinstance(overshoot, dict) else overshoot)


def test_what_excludes_what(bywire):
    outcome = bywire(
        "design", "moment", "--require", "bandwidth >= 20 Hz", "--require",
        "phase margin >= 80 deg", *LINEAR,
    )  # fmt: skip
    assert outcome.status == 1
    found = outcome.object
    assert found["status"] == "infeasible"
    best = {one["requirement"]: one["best"] for one in found["linear"]["conflicts"]}
    assert best["phase_margin >= 80 deg"] == pytest.approx(66.9, abs=0.5)
    assert best["bandwidth >= 20 Hz"] < 10.0


def test_what_is_set_stays(bywire):
    outcome = bywire(
        "design", "current", "--set", "ecu.current.k_i=10 1/(A*s)", "--require",
        "phase margin >= 60 deg", *LINEAR,
    )  # fmt: skip
    assert outcome.status == 0
    assert set(outcome.object["gains"]) == {"ecu.current.k_p"}


@pytest.mark.parametrize(
    ("arguments", "texts"),
    [
        (("momment", "--require", "bandwidth >= 5 Hz"), ("did you mean 'moment'",)),
        (("moment",), ("no requirement", "bandwidth >= 10 Hz")),
        (("moment", "--require", "bandwith >= 5 Hz"), ("bandwidth",)),
        (
            ("moment", "--require", "bandwidth >= 10 Hz", "--require", "bandwidth <= 5 Hz"),
            ("contradict",),
        ),
        (("moment", "--require", "bandwidth >= 900 Hz"), ("less than 500 Hz",)),
        (
            ("moment", "--require", "bandwidth >= 5 Hz", "--over", "control.moment.f_c=5:6:2"),
            ("Hz",),
        ),
        (
            ("moment", "--require", "bandwidth >= 5 Hz", "--set", "control.moment.f_c=5 Hz"),
            ("--set fixes all",),
        ),
        (("moment", "--requirements", "nowhere.toml"), ("nowhere.toml", "No such file")),
    ],
)
def test_bad_input(bywire, arguments, texts):
    refused(bywire("design", *arguments), *texts)
