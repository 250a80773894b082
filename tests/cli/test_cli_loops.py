"""The commands on loops: linearize, frequency-response, margins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from command_line import refused


def test_linearize_prints_the_model_as_json(bywire):
    found = bywire("linearize", "moment", "--json").object
    A = np.array(found["A"])
    assert A.shape == (len(found["states"]),) * 2
    assert found["stable"]
    assert found["period"] == pytest.approx(1e-3)
    poles = np.array(found["poles"]) @ [1.0, 1j]
    np.testing.assert_allclose(np.sort_complex(np.linalg.eigvals(A)), np.sort_complex(poles))


def test_margins_over_a_range_name_the_worst(bywire):
    found = bywire("margins", "moment", "--over", "wedge.mu_B=0.2:0.6:3", "--json").object
    assert [case["wedge.mu_B"] for case in found["cases"]] == pytest.approx([0.2, 0.4, 0.6])
    assert found["worst"]["phase"]["wedge.mu_B"] == pytest.approx(0.6)
    table = bywire("margins", "pressure", "--at", "30 bar")
    assert table.status == 0
    assert "3000" not in table.out
    assert "bar" in table.out


def test_frequency_response_beside_the_linear_one(bywire, tmp_path):
    outcome = bywire(
        "frequency-response", "position", "--frequencies", "5 Hz, 10 Hz", "--amplitudes", "0.5 rad",
        "--out", tmp_path / "out", "--json",
    )  # fmt: skip
    assert outcome.status == 0
    found = outcome.object
    assert found["frequency"] == pytest.approx([5.0, 10.0], rel=0.01)
    for measured, linear in zip(found["gain"][0], found["linear"]["gain"], strict=True):
        assert 0.0 > 20.0 * math.log10(measured / linear) > -0.5
    assert len(found["files"]) == 2
    assert {path.suffix for path in (tmp_path / "out").iterdir()} == {".nc", ".png"}


@pytest.mark.parametrize("excitation", ["multisine", "chirp"])
def test_all_frequencies_at_once(bywire, excitation):
    found = bywire(
        "frequency-response", "screw-position", "--frequencies", "5 Hz, 10 Hz", "--amplitudes",
        "0.5 rad", "--excitation", excitation, "--json",
    ).object  # fmt: skip
    assert found["excitation"] == excitation
    assert found["frequency"] == pytest.approx([5.0, 10.0], rel=0.05)
    for measured, linear in zip(found["gain"][0], found["linear"]["gain"], strict=True):
        assert abs(20.0 * math.log10(measured / linear)) < 1.0
    assert all(0.9 < share <= 1.0 for share in found["coherence"][0])


def test_what_sticks_is_said_and_has_no_gain(bywire):
    outcome = bywire(
        "frequency-response", "position", "--frequencies", "5 Hz", "--amplitudes", "0.001 rad",
        "--json",
    )  # fmt: skip
    assert outcome.object["gain"] == [[None]]
    assert any("sticks" in line for line in outcome.lines)


@pytest.mark.parametrize(
    ("arguments", "texts"),
    [
        (("linearize", "momment"), ("did you mean 'moment'",)),
        (("margins", "moment", "--at", "20 bar"), ("moment", "N*m")),
        (("margins", "moment", "--at", "5000 Nm"), ("wedge travel",)),
        (("margins", "moment", "--parameters", "dardanelli2010"), ("motorcycle-brake",)),
        (("margins", "moment", "--over", "wedge.mu_B"), ("LOW:HIGH:COUNT",)),
        (("margins", "moment", "--over", "wedge.mu_B=0.6:0.2:3"), ("below",)),
        (("margins", "moment", "--set", "wedge.mu_b=0.4"), ("wedge.mu_B",)),
        (("frequency-response", "moment", "--frequencies", "600 Hz"), ("Nyquist",)),
        (("frequency-response", "moment", "--frequencies", "5"), ("Hz",)),
        (("frequency-response", "moment", "--excitation", "sin"), ("did you mean 'sine'",)),
        (
            ("frequency-response", "moment", "--set", "control.moment.f_c=200 Hz"),
            ("unstable", "1/s"),
        ),
    ],
)
def test_bad_input(bywire, arguments, texts):
    refused(bywire(*arguments), *texts)
