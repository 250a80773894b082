"""Command faults, and runs with a fault."""

from __future__ import annotations

import pytest
from command_line import no_half_files, refused

CAMPAIGN = """
bench = "hard-braking"
[set]
"options.settle" = "0.1 s"
"options.duration" = "0.4 s"
[vary]
"motor.R_m" = "+-10 %"
[campaign]
only = ["pressure.stuck", "motor.hot"]
onset = "0.2 s"
healthy = 4
[[criteria]]
name = "loss"
signal = "p_pd"
below_share = "80 %"
lasting = "20 ms"
[[criteria]]
name = "too much"
signal = "p_pd"
above_healthy = "5 bar"
lasting = "20 ms"
"""


@pytest.mark.usefixtures("drawn")
def test_a_campaign_is_written_and_shown(bywire, tmp_path):
    file, out = tmp_path / "small.toml", tmp_path / "out"
    file.write_text(CAMPAIGN)
    outcome = bywire("faults", file, "--out", out, "--json")
    assert outcome.status == 0
    made = outcome.object
    assert (made["campaign"], made["runs"]) == ("small", 2)
    assert made["changes"]["options.settle"]["instead_of"] == "1 s"
    kinds = {each["fault"]: each["class"] for each in made["faults"]}
    assert kinds["pressure.stuck"] in ("covered", "too late", "undetected")
    names = {path.name for path in out.iterdir()}
    assert names == {
        "campaign.json",
        "faults",
        "report.json",
        "report.html",
        "fault-times.png",
        "alarm-curves.png",
    }
    page = (out / "report.html").read_text(encoding="utf-8")
    assert all(text in page for text in ("Diagnostic coverage", "still-pressure", "unweighted"))
    no_half_files(out)


def test_a_run_with_a_fault_says_so(bywire):
    outcome = bywire("run", "hard-braking", "--fault", "motor.hot=1.5@0.2 s", "--json")
    assert outcome.status == 0
    assert outcome.object["remarks"][0].startswith("fault motor.hot = 1.5, from 200 ms on")


def test_what_is_not_known_is_refused(bywire, tmp_path):
    refused(bywire("faults", "motorcycel"), "did you mean 'motorcycle'")
    refused(bywire("faults", tmp_path / "none.toml"), "none.toml")
    refused(bywire("run", "hard-braking", "--fault", "motor.hott"), "did you mean 'motor.hot'")
    late = bywire("run", "hard-braking", "--fault", "motor.hot=0.2 s")
    refused(late, "write '1.5'", "write --fault 'motor.hot@0.2 s'")
