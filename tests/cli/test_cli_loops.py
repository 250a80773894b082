"""Commands for loops: linearize, frequency-response, margins."""

from __future__ import annotations

import math
from pathlib import Path

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


@pytest.mark.usefixtures("drawn")
def test_margins_leave_figures_and_a_report(bywire, tmp_path):
    asked = ("margins", "moment", "--over", "control.moment.f_c=8 Hz, 40 Hz, 100 Hz", "--json")
    outcome = bywire(*asked, "--out", tmp_path)
    assert outcome.status == 0
    names = {Path(path).name for path in outcome.object["files"]}
    figures = {"loop-gain", "nyquist", "nichols", "sensitivity"}
    assert names == {"report.html", *(f"moment-{name}.png" for name in figures)}
    assert {path.name for path in tmp_path.iterdir()} == names
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "1 of 3 loops unstable" in page
    assert "disk margin" in page


def test_a_locus_names_the_border(bywire, tmp_path):
    asked = ("linearize", "moment", "--locus", "control.moment.f_c=50 Hz:90 Hz:5", "--json")
    outcome = bywire(*asked, "--out", tmp_path)
    assert outcome.status == 0
    (border,) = outcome.object["locus"]["borders"]
    assert 50.0 < border["value"] < 90.0
    assert outcome.object["locus"]["stable"] == [
        value < border["value"] for value in outcome.object["locus"]["values"]
    ]
    assert {path.suffix for path in tmp_path.iterdir()} == {".json", ".png", ".html"}
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert f"unstable above control.moment.f_c = {border['value']:.4g} Hz" in page


@pytest.mark.usefixtures("drawn")
def test_the_locus_of_a_plant_shows_the_neutral_point(bywire, tmp_path):
    outcome = bywire(
        "linearize", "wedge-rigid", "--locus", "wedge.mu_B=0.3:0.4:3", "--out", tmp_path, "--json"
    )
    (border,) = outcome.object["locus"]["borders"]
    assert border["value"] == pytest.approx(math.tan(math.radians(20.0)), rel=1e-4)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"wedge-rigid-locus.json", "wedge-rigid-locus.png", "report.html"}
    assert "unstable above wedge.mu_B" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("drawn")
def test_agreement_by_cause_with_its_report(bywire, tmp_path, monkeypatch):
    asked = ("agreement", "screw-position", "--frequencies", "5 Hz", "--out", tmp_path, "--json")
    outcome = bywire(*asked)
    assert outcome.status == 0
    found = outcome.object
    assert found["holds"]
    assert abs(found["differences"]["nothing"]["gain_dB"][0]) < found["tolerance"]["gain_dB"]
    assert found["largest"] == ["bearing friction"]
    assert "agree" in (tmp_path / "report.html").read_text(encoding="utf-8")
    monkeypatch.setattr("bywire.analysis.agreement.GAIN", -1.0)
    assert bywire(*asked).status == 1
    assert "DO NOT agree" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("drawn")
def test_frequency_response_beside_the_linear_one(bywire, tmp_path):
    outcome = bywire(
        "frequency-response",
        "screw-position",
        "--frequencies",
        "5 Hz, 10 Hz",
        "--amplitudes",
        "0.5 rad",
        "--out",
        tmp_path / "out",
        "--json",
    )
    assert outcome.status == 0
    found = outcome.object
    assert found["frequency"] == pytest.approx([5.0, 10.0], rel=0.01)
    for measured, linear in zip(found["gain"][0], found["linear"]["gain"], strict=True):
        assert 0.0 > 20.0 * math.log10(measured / linear) > -0.5
    assert len(found["files"]) == 3
    assert {path.suffix for path in (tmp_path / "out").iterdir()} == {".nc", ".png", ".html"}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert ">0.5 rad<" in page
    assert "power at the sine" in page


@pytest.mark.parametrize("excitation", ["multisine", "chirp"])
def test_all_frequencies_at_once(bywire, excitation):
    found = bywire(
        "frequency-response",
        "screw-position",
        "--frequencies",
        "5 Hz, 10 Hz",
        "--amplitudes",
        "0.5 rad",
        "--excitation",
        excitation,
        "--json",
    ).object
    assert found["excitation"] == excitation
    assert found["frequency"] == pytest.approx([5.0, 10.0], rel=0.05)
    for measured, linear in zip(found["gain"][0], found["linear"]["gain"], strict=True):
        assert abs(20.0 * math.log10(measured / linear)) < 1.0
    assert all(0.9 < share <= 1.0 for share in found["coherence"][0])


@pytest.mark.usefixtures("drawn")
def test_bandwidths_over_a_range_name_the_worst_case(bywire, tmp_path):
    asked = (
        "frequency-response",
        "screw-position",
        "--frequencies",
        "20 Hz:70 Hz:4",
        "--amplitudes",
        "0.25 rad, 1 rad",
        "--over",
        "control.position.f_n=15 Hz:60 Hz:2",
    )
    outcome = bywire(*asked, "--out", tmp_path, "--json")
    found = outcome.object
    assert [case["control.position.f_n"] for case in found["cases"]] == [15.0, 60.0]
    low, high = (case["figures"][0] for case in found["cases"])
    assert low["bandwidth"] is None
    assert low["bandwidth_below"] == pytest.approx(20.0, rel=0.01)
    assert 30.0 < high["bandwidth"] < 70.0
    assert high["largest_share_sat_current"] > 0.0
    assert found["worst"][0]["control.position.f_n"] == 15.0
    assert "Bandwidth by amplitude" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert (tmp_path / "screw-position-bandwidth.png").exists()
    text = bywire(*asked).out
    assert "worst: < 20 Hz for 0.25 rad at control.position.f_n = 15 Hz" in text


def test_a_disc_that_would_stop_is_driven_and_that_is_said(bywire):
    asked = ("frequency-response", "moment", "--frequencies", "4 Hz", "--amplitudes", "20 Nm")
    outcome = bywire(*asked, "--json")
    assert outcome.object["gain"][0][0] == pytest.approx(1.0, abs=0.1)
    assert any("flywheel.law = driven" in line for line in outcome.lines)
    own = ("--set", "flywheel.law=driven", "--set", "flywheel.runout=0mm")
    assert not any("driven" in line for line in bywire(*asked, *own).lines)


def test_a_sine_beyond_the_end_stop_is_told(bywire):
    asked = ("frequency-response", "pressure", "--frequencies", "20 Hz", "--amplitudes")
    outcome = bywire(*asked, "3 bar, 32 bar", "--json")
    told = [line for line in outcome.lines if "leave the brake's range" in line]
    assert len(told) == 1
    assert "amplitude 32 bar" in told[0]


def test_what_sticks_is_said_and_has_no_gain(bywire):
    outcome = bywire(
        "frequency-response",
        "screw-position",
        "--frequencies",
        "5 Hz",
        "--amplitudes",
        "0.001 rad",
        "--json",
    )
    assert outcome.object["gain"] == [[None]]
    assert any("sticks" in line for line in outcome.lines)


@pytest.mark.parametrize(
    ("arguments", "texts"),
    [
        (("linearize", "momment"), ("did you mean 'moment'",)),
        (("margins", "moment", "--at", "20 bar"), ("moment", "N*m")),
        (("margins", "moment", "--at", "5000 Nm"), ("wedge travel",)),
        (("linearize", "pressure", "--at", "0 bar"), ("touches its stop", "> 0 bar")),
        (("margins", "moment", "--parameters", "dardanelli2010"), ("motorcycle-brake",)),
        (("margins", "moment", "--over", "wedge.mu_B"), ("LOW:HIGH:COUNT",)),
        (("margins", "moment", "--over", "wedge.mu_B=0.6:0.2:3"), ("below",)),
        (("margins", "moment", "--set", "wedge.mu_b=0.4"), ("wedge.mu_B",)),
        (("frequency-response", "moment", "--frequencies", "600 Hz"), ("Nyquist",)),
        (("agreement", "moment", "--amplitudes", "1 Nm"), ("two amplitudes, the small one first",)),
        (("linearize", "moment", "--locus", "wedge.mu_B"), ("--locus", "LOW:HIGH:COUNT")),
        (("linearize", "moment", "--locus", "wedge.mu_B=0.3"), ("at least two values",)),
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


SENSOR_ON_ITS_CORNER = ("--set", "pressure_sensor.p_high=2101325 Pa")  # 20 bar above ambient
WITHOUT_GAIN = tuple(
    word for name in ("k_p", "k_i", "k_d") for word in ("--set", f"ecu.pressure.{name}=0")
)


@pytest.mark.parametrize(
    ("command", "rest"),
    [
        ("margins", ()),
        ("linearize", ()),
        ("agreement", ()),
        ("frequency-response", ()),
        ("design", ("--require", "bandwidth >= 1 Hz", "--linear-only")),
        ("margins", ("--over", "at=20 bar, 10 bar")),
        ("linearize", ("--locus", "motor.R_m=0.2 ohm:0.4 ohm:2")),
    ],
)
def test_every_linear_model_names_the_operation_on_its_corner(bywire, command, rest):
    outcome = bywire(command, "pressure", *SENSOR_ON_ITS_CORNER, *rest)
    refused(outcome, "plant/pressure_sensor.py:", "return ops.clip(", "--side above")


def test_a_stated_side_of_a_corner_is_taken(bywire):
    """Below its upper limit the sensor works as usual. Above the limit, there is no feedback."""
    usual = bywire("margins", "pressure", "--json").object["margins"]
    asked = ("margins", "pressure", *SENSOR_ON_ITS_CORNER, "--json", "--side")
    below, above = (bywire(*asked, side) for side in ("below", "above"))
    found = below.object["margins"]
    for name in ("gain", "phase", "crossover", "bandwidth"):
        assert found[name] == pytest.approx(usual[name], rel=1e-6)
    assert "plant/pressure_sensor.py:" in found["corners"][0]
    assert "below the kink of" in below.err
    assert not above.object["margins"]["has_loop"]
    refused(bywire(*asked, "left"), "side = 'left' is not valid")


@pytest.mark.usefixtures("drawn")
def test_a_loop_without_gain_is_reported_as_none(bywire, tmp_path):
    outcome = bywire("margins", "pressure", *WITHOUT_GAIN, "--out", tmp_path / "a")
    assert outcome.status == 0
    assert "no loop: the loop gain is 0 at all frequencies" in outcome.out
    page = (tmp_path / "a" / "report.html").read_text(encoding="utf-8")
    assert "no loop" in page
    found = bywire("margins", "pressure", *WITHOUT_GAIN, "--json").object["margins"]
    assert (found["gain"], found["disk"], found["has_loop"]) == (None, None, False)
    over = ("--over", "ecu.pressure.k_p=0 A/Pa:1e-5 A/Pa:2")
    ranged = bywire("margins", "pressure", *WITHOUT_GAIN, *over, "--out", tmp_path / "b")
    assert "no loop at 1 of 2 values of ecu.pressure.k_p (0 A/Pa)" in ranged.out
    design = (
        "design",
        "pressure",
        *WITHOUT_GAIN,
        "--require",
        "phase margin >= 30 deg",
        "--linear-only",
        "--out",
        tmp_path / "c",
    )
    outcome = bywire(*design)
    assert outcome.status == 1
    assert "no loop: the loop gain is 0 at all frequencies, at nominal" in outcome.out
    sines = ("--frequencies", "1 Hz, 2 Hz", "--no-error-estimate")
    response = bywire("frequency-response", "pressure", *WITHOUT_GAIN, *sines)
    assert "no loop: the loop gain is 0" in response.err
    assert bywire("linearize", "pressure", *WITHOUT_GAIN, "--json").object["has_loop"] is False
    refused(bywire("agreement", "pressure", *WITHOUT_GAIN), "no loop", "--set")
