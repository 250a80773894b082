"""Command study."""

from __future__ import annotations

import pytest
from command_line import no_half_files, page_text, refused

SMALL = ("--set", "slopes=3", "--set", "leads=3", "--set", "mu_B=0.25, 0.45")


@pytest.mark.usefixtures("drawn")
def test_the_actuator_is_sized_with_figures_and_numbers(bywire, tmp_path):
    out = tmp_path / "out"
    outcome = bywire(
        "study",
        "actuator-sizing",
        "--set",
        "ratios=5",
        "--set",
        "frequencies=4",
        "--out",
        out,
        "--json",
    )
    assert outcome.status == 0
    found = outcome.object
    assert found["kpis"]["optimum_k_g"]["unit"] == "m/rad"
    assert found["options"]["ratios"] == 5
    power = found["designs"]["electrical"]
    assert power["dims"] == ["k_g", "frequency"]
    assert [len(power["values"]), len(power["values"][0])] == [5, 4]
    assert found["assumptions"]
    assert {path.suffix for path in out.iterdir()} == {".nc", ".png", ".html"}
    page = page_text(out / "report.html")
    assert all(text in page for text in ("optimum_k_g", "neglects dither"))
    no_half_files(out)


def test_the_drive_train_is_sized_and_what_is_infeasible_is_null(bywire, monkeypatch):
    monkeypatch.setattr("bywire.brakes.wedge.studies.drive_train._ROUNDS", 0)
    found = bywire("study", "drive-train", *SMALL, "--json").object
    assert found["designs"]["worst_filtered"]["values"][-1][-1] is None
    assert found["kpis"]["given_t_90"]["value"] == pytest.approx(0.1, rel=0.01)
    assert found["warnings"] == []


def test_a_response_that_is_too_fast_is_said(bywire):
    fewer = (*SMALL[:4], "--set", "mu_B=0.35")
    outcome = bywire("study", "drive-train", *fewer, "--set", "t_90=20 ms")
    assert outcome.status == 0
    assert "no design is feasible" in outcome.err
    assert "assumptions" in outcome.out


@pytest.mark.parametrize(
    ("arguments", "texts"),
    [
        (("drive-trian",), ("did you mean 'drive-train'",)),
        (("drive-train", "--parameters", "dardanelli2010"), ("wedge-brake", "motorcycle-brake")),
        (("drive-train", "--set", "lead=3mm"), ("lead_min",)),
        (("drive-train", "--set", "lead_min=9mm"), ("lead_min", "lead_max", "below")),
        (("drive-train", "--set", "t_90=0.1"), ("t_90", "For example, write")),
        (("drive-train", "--set", "slopes=2"), ("slopes", ">= 3")),
        (("drive-train", "--set", "power=peak"), ("'filtered' or 'instantaneous'",)),
        (("drive-train", "--set", "wedge.mu_b=0.4"), ("wedge.mu_B",)),
        (("actuator-sizing", "--set", "p_peak=60 bar"), ("end stop", "51.28 bar")),
        (("actuator-sizing", "--set", "amplitude=20 bar"), ("half of p_peak",)),
    ],
)
def test_bad_input(bywire, arguments, texts):
    refused(bywire("study", *arguments), *texts)
