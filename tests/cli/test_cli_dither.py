"""Dither on the command line: the loop linearized about its motion, and its design."""

from __future__ import annotations

import pytest
from command_line import no_half_files, refused

SMALL = (
    "--set",
    "pressures=20 bar",
    "--set",
    "gains=3",
    "--set",
    "gain_min=0.9",
    "--set",
    "gain_max=1.3",
    "--set",
    "frequencies=3",
    "--set",
    "f_min=45 Hz",
    "--set",
    "f_max=65 Hz",
    "--set",
    "settle=2 s",
    "--set",
    "compare=none",
)


@pytest.mark.usefixtures("drawn")
def test_the_dithered_loop_stands_beside_the_one_without_friction(bywire, tmp_path):
    out = tmp_path / "out"
    outcome = bywire("linearize", "pressure", "--dither", "--out", out, "--json")
    assert outcome.status == 0
    free, found = outcome.object, outcome.object["dithered"]
    assert free["period"] == 1e-3
    assert found["period"] == pytest.approx(0.02)
    assert found["stable"]
    assert found["mean"] == pytest.approx(20e5, rel=1e-4)
    assert found["steady_gain"] == pytest.approx(1.0, abs=1e-3)
    assert 0.0 < found["stuck"] < 0.2
    assert 0.0 < found["gain_step_error"] < 0.1
    assert "pressure-dithered-model.json" in {path.name for path in out.iterdir()}
    no_half_files(out)


@pytest.mark.parametrize(
    ("arguments", "texts"),
    [
        (("linearize", "moment", "--dither"), ("moment", "has no dither", "pressure")),
        (("study", "dither", "--set", "approach=9 bar"), ("approach = 9 bar", "lowest")),
        (("study", "dither", "--set", "pressures=20"), ("pressures", "For example, write")),
        (
            ("study", "dither", "--set", "pressures=20 bar, 5 bar"),
            ("pressures = 20 bar, 5 bar", "increasing"),
        ),
        (("study", "dither", "--set", "f_min=51 Hz", "--set", "f_max=55 Hz"), ("even number",)),
    ],
)
def test_bad_input(bywire, arguments, texts):
    refused(bywire(*arguments), *texts)


def test_a_dither_is_designed(bywire):
    outcome = bywire("study", "dither", *SMALL)
    assert outcome.status == 0
    assert "lowest gain for all pressures together" in outcome.out
    assert "stuck at 20 bar" in outcome.out
