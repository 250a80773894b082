"""``bywire linearize`` of plants, and reduced models."""

from __future__ import annotations

import numpy as np
import pytest
from command_line import refused


def test_a_plant_as_json_with_its_error_and_a_reduced_model(bywire):
    found = bywire(
        "linearize", "wedge-mechanical", "--at", "300 Nm", "--reduce", "4", "--json"
    ).object
    assert found["operating_point"] == {"moment": 300.0, "unit": "N*m"}
    assert np.array(found["A"]).shape == (6, 6)
    assert found["error"]["band_Hz"][1] == pytest.approx(150.0)
    reduced = found["reduced"]
    assert reduced["order"] == len(reduced["A"]) == 4
    assert 0.0 < reduced["error"]["relative"] < 0.01
    assert len(found["transfer_functions"]) == len(found["inputs"]) * len(found["outputs"])


@pytest.mark.usefixtures("drawn")
def test_texts_and_figures(bywire, tmp_path):
    outcome = bywire(
        "linearize",
        "motorcycle-plant",
        "--at",
        "2 A",
        "--reduce",
        "50 Hz",
        "--out",
        tmp_path / "out",
    )
    assert outcome.status == 0
    assert "motorcycle-plant" in outcome.out
    assert "reduced to" in outcome.out
    names = {path.name for path in (tmp_path / "out").iterdir()}
    figure = "motorcycle-plant-p_mc.png"
    assert names >= {"motorcycle-plant-linear-model.json", figure, "report.html"}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for text in ("maximum error up to", "other poles: 1 at 0", "Settings"):
        assert text in page
    assert "other poles: 1 at 0" in outcome.out


def test_friction_of_a_plant(bywire):
    stuck = bywire("linearize", "wedge-plant", "--friction", "stuck")
    assert "friction holds the plant at rest" in stuck.out
    slides = bywire(
        "linearize", "motorcycle-plant", "--friction", "sliding", "--speed", "5 rad/s", "--json"
    ).object
    assert (slides["friction"], slides["speed"]) == ("sliding", 5.0)


def test_a_reduced_loop(bywire):
    found = bywire("linearize", "moment", "--reduce", "50 Hz", "--json").object
    assert found["reduced"]["error"]["relative"] <= 0.01
    assert found["reduced"]["order"] < len(found["A"])
    (path,) = found["transfer_functions"]
    assert (path["input"], path["output"]) == ("M_set", "y_M")


@pytest.mark.parametrize(
    ("arguments", "texts"),
    [
        (("wedge-plnt",), ("did you mean 'wedge-plant'",)),
        (("wedge-plant", "--at", "5 bar"), ("moment in N*m", "current in A")),
        (("wedge-plant", "--parameters", "dardanelli2010"), ("motorcycle-brake",)),
        (("wedge-plant", "--reduce", "99"), ("order = 99", "<= 15")),
        (("wedge-plant", "--reduce", "5 mm"), ("--reduce", "Hz")),
        (("wedge-plant", "--reduce", "-1"), ("whole number",)),
        (("wedge-plant", "--reduce", "2.5"), ("whole number",)),
        (("wedge-plant", "--reduce", "1e9 Hz"), ("fastest corner",)),
        (("wedge-plant", "--at", "30 A"), ("current = 30 A", "drive.i_max = 20 A")),
        (("motorcycle-plant", "--at", "1000 A"), ("current = 1000 A", "end stop")),
        (("wedge-plant", "--friction", "stuck", "--reduce", "2"), ("cannot be reduced",)),
        (("moment", "--reduce", "600 Hz"), ("500 Hz",)),
        (("moment", "--friction", "stuck"), ("--friction", "wedge-plant")),
        (("wedge-plant", "--friction", "slidng"), ("did you mean 'sliding'",)),
        (("wedge-plant", "--friction", "sliding"), ("--speed",)),
        (("wedge-plant", "--speed", "5 rad/s"), ("--friction sliding",)),
        (
            ("wedge-plant", "--locus", "wedge.mu_B=0.2:0.6:9", "--reduce", "4"),
            ("--reduce", "--locus"),
        ),
    ],
)
def test_bad_input(bywire, arguments, texts):
    refused(bywire("linearize", *arguments), *texts)
