"""Command life."""

from __future__ import annotations

import pytest
from command_line import no_half_files, page_text, refused

LIFE = """
life = "two-wheeler-pads"
[set]
wear.h_new = "0.6 mm"
options.v_0 = "50 km/h"
options.duration = "3 s"
"""


@pytest.mark.usefixtures("drawn")
def test_a_life_is_written_and_told(bywire, tmp_path):
    file, out = tmp_path / "short.toml", tmp_path / "out"
    file.write_text(LIFE)
    outcome = bywire("life", file, "--check", "3", "--out", out, "--json")
    assert outcome.status == 0
    made = outcome.object
    assert (made["life"], made["name"], made["ended_by"]) == ("two-wheeler-pads", "short", "lining")
    assert made["stops"] == pytest.approx(1060, rel=0.05)
    assert made["changes"]["wear.h_new"]["value"] == "0.6 mm"
    assert made["changes"]["options.v_0"]["value"] == "13.8889 m/s"
    assert made["states"]["h_pad"]["end"] == pytest.approx(0.5e-3, rel=0.001)
    assert abs(made["states"]["h_pad"]["deviation"]) < 1e-6
    assert {path.name for path in out.iterdir()} == {
        "life.nc",
        "life.png",
        "life.json",
        "report.html",
    }
    page = page_text(out / "report.html")
    assert all(text in page for text in ("fluid in the reservoir", "remaining lining", "kappa_0"))
    no_half_files(out)


def test_a_life_without_end_says_so(bywire, tmp_path):
    file = tmp_path / "short.toml"
    file.write_text(LIFE + "[projection]\nlongest = 100\n")
    outcome = bywire("life", file, "--json")
    assert (outcome.object["stops"], outcome.object["ended_by"]) == (100, "")
    assert outcome.object["interval"] is None


def test_what_is_no_life_is_refused(bywire, tmp_path):
    refused(bywire("life", "wedge-pad"), "did you mean 'wedge-pads'")
    refused(bywire("life", tmp_path / "none.toml"), "cannot read life file")
    worn = bywire("life", "two-wheeler-pads", "--set", "wear.h_new=0.1mm")
    refused(worn, "ends before its first stop")
    refused(bywire("life", "two-wheeler-pads", "--check", "7"), ">= 20, the number of stops")
