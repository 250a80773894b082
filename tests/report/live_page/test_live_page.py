"""The page of a bench: it computes what the bench computes, and rejects all other input."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
import tomllib
from typing import Any

import numpy as np
import pytest
from page_benches import BENCHES, VARIED, needs_node, tried

import bywire
from bywire.bench.bench_file import read
from bywire.bench.experiment import EXPERIMENTS
from bywire.core.errors import InputError, ParameterError, UnknownNameError
from bywire.core.parameters import leaf_fields
from bywire.core.quantities import display_unit
from bywire.core.units import convert, parse
from bywire.report.live_page.content import dependence
from bywire.report.live_page.sliders import SLIDERS, first_sliders
from run_once import run_once


@pytest.fixture(scope="module", params=sorted(BENCHES))
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bywire.BenchPage]:
    folder = tmp_path_factory.mktemp("pages")
    return {name: bywire.page(bench, folder / f"{name}.html") for name, bench in BENCHES.items()}


def block(page: bywire.BenchPage, key: str) -> Any:
    match = re.search(rf'id="{key}">(.*?)</script>', page.file.read_text(), re.DOTALL)
    assert match
    return json.loads(match[1])


def used(page: bywire.BenchPage) -> dict[str, dict[str, Any]]:
    listed = block(page, "bench")["description"]["parameters"]
    return {each["name"]: each for each in listed if each["used"]}


@needs_node
def test_any_values_give_what_the_bench_gives(pages, name, tmp_path):
    bench, page, rng = BENCHES[name], pages[name], np.random.default_rng(7)
    leaves, sliders = bench.par.leaves(), VARIED[name]
    assert {*sliders} <= used(page).keys()
    cases: list[dict[str, float]] = [{}]
    cases += [{n: leaves[n] * rng.uniform(0.8, 1.25) for n in sliders} for _ in range(3)]
    answers = tried(page, tmp_path, *({"kind": "run", "changes": case} for case in cases))
    for case, each in zip(cases, answers, strict=True):
        made, result = each["answer"], run_once(bench.with_overrides(case))
        np.testing.assert_allclose(made["time"], result.recording["time"], atol=1e-12)
        for signal, values in made["signals"].items():
            own = result.recording[signal].values
            scale = max(np.abs(own).max(), 1e-300)
            assert np.abs(np.array(values) - own).max() <= 1e-9 * scale, signal
        for kpi in result.kpis if made["figures"] else ():
            given = made["figures"][kpi.name]
            assert bool(given["reason"]) == math.isnan(kpi.value), kpi.name
            if not given["reason"]:
                assert given["value"] == pytest.approx(kpi.value, rel=1e-12, abs=1e-15), kpi.name
    assert (answers[0]["answer"]["figures"] is not None) == (name == "motorcycle")


@needs_node
def test_figures_of_a_brake_that_does_not_move_are_open_in_a_page_too(pages, tmp_path):
    stuck = {"seal.T_pr": 5.0}
    (answer,) = tried(pages["motorcycle"], tmp_path, {"kind": "run", "changes": stuck})
    given = answer["answer"]["figures"]
    result = run_once(BENCHES["motorcycle"].with_overrides(stuck))
    for kpi in result.kpis:
        assert given[kpi.name]["open"] == kpi.is_open, kpi.name
    assert given["overshoot"]["open"]
    assert "hardly changes" in given["overshoot"]["reason"]
    (verdict,) = result.verdicts
    assert verdict.outcome == "undecided"


@needs_node
def test_links_and_files_hold_what_was_moved(pages, tmp_path):
    page, changes = pages["motorcycle"], {"motor.R_m": 0.1 + 0.2, "seal.T_pr": 1.0 / 3e3}
    link, file = tried(
        page, tmp_path, {"kind": "link", "changes": changes}, {"kind": "file", "changes": changes}
    )
    assert link["answer"] == changes  # to the last bit
    path = tmp_path / "moved.toml"
    path.write_text(file["answer"])
    moved = read(path, {})
    wanted = BENCHES["motorcycle"].with_overrides(changes).par.leaves()
    assert moved.par.leaves() == pytest.approx(wanted, rel=1e-12)  # texts are read to 12 digits
    assert moved.chosen_options == BENCHES["motorcycle"].chosen_options
    assert tomllib.loads(file["answer"])["requirements"] == {"overshoot": "<= 15 %"}


@needs_node
def test_a_line_through_its_bends_is_within_a_quarter_of_a_pixel_of_every_point(pages, tmp_path):
    rng, x = np.random.default_rng(5), np.linspace(0.0, 800.0, 1700)
    lines = {
        "straight": 3.0 * x,
        "jump": np.where(x < 300.0, 0.0, 90.0),
        "wave": 60.0 * np.sin(0.02 * x),
        "noise": rng.normal(0.0, 20.0, x.size),
    }
    tasks = [{"kind": "bends", "x": [*x], "y": [*y], "off": 0.25} for y in lines.values()]
    answers = tried(pages["motorcycle"], tmp_path, *tasks)
    count = {}
    for (name, y), each in zip(lines.items(), answers, strict=True):
        bends = each["answer"]
        assert (bends[0], bends[-1]) == (0, x.size - 1)
        assert np.abs(np.interp(x, x[bends], y[bends]) - y).max() <= 0.25 + 1e-9, name
        count[name] = len(bends)
    assert (count["straight"], count["jump"]) == (2, 4)
    assert count["wave"] < 200 < count["noise"]


@needs_node
@pytest.mark.parametrize(
    ("link", "text"),
    [
        ("bench=0123&motor.R_m=0.5", "another bench or version"),
        ("bench=DIGEST&motor.R_m=-1", "motor.R_m must be > 0 ohm, not -1 ohm"),
        ("bench=DIGEST&motor.R_m=1e999", 'must be > 0 ohm, not "1e999"'),
        ("bench=DIGEST&motor.R_m=", "must be > 0 ohm, not empty"),
        ("bench=DIGEST&motor.R_m=alert(1)", 'must be > 0 ohm, not "alert(1)"'),
        ("bench=DIGEST&__proto__=1", "not a parameter of this page"),
        ("bench=DIGEST&ecu.T_s=1e-4", "not a parameter of this page"),  # the run's plan follows it
        ("bench=DIGEST&%3Cscript%3E=1", "not a parameter of this page"),
    ],
)
def test_hostile_links_are_refused_in_words(pages, tmp_path, link, text):
    (said,) = tried(pages["motorcycle"], tmp_path, {"kind": "hostile", "link": link})
    assert text in said["error"]


TYPED = [
    "V",
    "mV",
    "kV",
    "A",
    "mA",
    "uA",
    "µA",
    "ohm",
    "Ω",
    "mohm",
    "kΩ",
    "W",
    "kW",
    "J",
    "N",
    "kN",
    "mN",
    "Nm",
    "kNm",
    "N*m",
    "N·m",
    "Pa",
    "kPa",
    "MPa",
    "bar",
    "mbar",
    "m",
    "mm",
    "um",
    "cm",
    "s",
    "ms",
    "us",
    "min",
    "h",
    "Hz",
    "kHz",
    "rad",
    "mrad",
    "deg",
    "°",
    "rev",
    "rpm",
    "rad/s",
    "1/s",
    "l",
    "ml",
    "kg",
    "g",
    "mH",
    "H",
    "K",
    "degC",
    "°C",
    "%",
    "V*s/rad",
    "V*s",
    "N*m/A",
    "mN*m/A",
    "bar/A",
    "A/bar",
    "A/Pa",
    "A/(bar*s)",
    "A*s/bar",
    "mm/rad",
    "m/rad",
    "mm**2",
    "mm^2",
    "mm²",
    "cm**3",
    "Pa*s",
    "Pa*s/m**3",
    "kg*m**2",
    "kg*mm^2",
    "g*cm^2",
    "J/K",
    "W/K",
    "1/K",
    "1/A",
    "1/(A*s)",
    "N*s/m",
    "N*m*s/rad",
    "m**3/Pa",
    "ml/bar",
    "N/mm",
    "m**2",
    "m**3",
    "Pa/s",
    "apples",
    "bar)",
    "(bar",
    "/s",
    "bar/",
    "A//s",
    "mm**22",
    "m/s/s",
]


@needs_node
def test_fields_read_quantities_as_commands_do(pages, name, tmp_path):
    others = ["-3e-2bar", "1e", "", "0x10", "1 2", "NaN", "+.5 mm"]
    texts = [*(f"2.5 {unit}" for unit in TYPED), *others]
    (each,) = tried(pages[name], tmp_path, {"kind": "quantities", "texts": texts})
    read = 0
    for (dotted, parameter), values in zip(used(pages[name]).items(), each["answer"], strict=True):
        for text, value in zip(texts, values, strict=True):
            try:
                wanted = parse(text, parameter["unit"], dotted)
            except InputError:
                assert value == "NaN", (dotted, parameter["unit"], text)
                continue
            assert value == pytest.approx(wanted, rel=2e-15, abs=0.0), (dotted, text)
            read += 1
    assert read > 2 * len(each["answer"])


@needs_node
def test_a_number_alone_is_in_the_unit_shown(pages, name, tmp_path):
    known = used(pages[name])
    (each,) = tried(pages[name], tmp_path, {"kind": "quantities", "texts": ["2.5"]})
    for parameter, (value,) in zip(known.values(), each["answer"], strict=True):
        shown = convert(value, parameter["unit"], display_unit(parameter["unit"]))
        assert shown == pytest.approx(2.5, rel=1e-14)


@needs_node
def test_a_slider_stays_within_what_is_admissible(pages, tmp_path):
    (way,) = tried(
        pages["motorcycle"], tmp_path, {"kind": "slider", "name": "motor.R_m", "share": 1.0}
    )
    start = BENCHES["motorcycle"].par.leaves()["motor.R_m"]
    assert (way["answer"]["from"], way["answer"]["to"]) == (start / 4, start * 4)
    assert way["answer"]["value"] == pytest.approx(4 * start)
    assert way["answer"]["share"] == pytest.approx(0.5)


def test_the_policy_admits_the_pages_own_scripts_and_nothing_else(pages, name):
    text = pages[name].file.read_text()
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)
    assert policy
    assert "default-src 'none'" in policy[1]
    assert not {"'unsafe-inline'", "'unsafe-eval'", "http:", "https:", "*"} & set(policy[1].split())
    scripts = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    styles = re.findall(r"<style>(.*?)</style>", text, re.DOTALL)
    assert (len(scripts), len(styles)) == (2, 1)
    for each in (*scripts, *styles):
        digest = base64.b64encode(hashlib.sha256(each.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in policy[1]
    assert not re.findall(r"<(?:link|img|iframe|script src)\b", text)
    assert pages[name].compressed < 100e3


def test_texts_of_a_bench_cannot_leave_their_place(tmp_path):
    bench = bywire.Bench(
        "hard-braking",
        "dardanelli2010",
        options={"settle": 0.02, "duration": 0.02},
        name='</script><script>alert("x")</script>',
    )
    text = bywire.page(bench, tmp_path / "page.html").file.read_text()
    assert "<script>alert" not in text
    assert len(re.findall(r"<script>", text)) == 2


def test_what_a_source_states_stands_in_the_first_panel_of_its_signal(pages):
    moment, *others = block(pages["wedge"], "bench")["panels"]
    spans = [(each["low"], *each["levels"], each["high"]) for each in moment["stated"]]
    assert spans == [(190.0, 200.0, 210.0), (152.0, 160.0, 168.0)]
    assert all("Fig. 7" in each["label"] for each in moment["stated"])
    assert not any(panel["stated"] for panel in others)


def test_what_a_source_states_of_key_figures_stands_beside_them(pages):
    figures = block(pages["motorcycle"], "bench")["judged"]["figures"]
    stated = {each["name"]: each["stated"] for each in figures}
    assert stated["overshoot"] == {"text": "<= 15 %", "where": "section 6, requirement"}
    assert stated["steady_state_error"]["text"] == "0 bar ± 0.05 bar"
    assert stated["rise_time"] is None


def test_what_a_brake_declares_stands_first_where_nobody_chose(pages):
    shown = block(pages["wedge"], "bench")["chosen"]
    assert shown[0] == "wedge.mu_B"
    assert shown == list(SLIDERS.find("wedge").parameters)
    assert block(pages["motorcycle"], "bench")["chosen"] == ["adc.noise"]  # changed by its bench


def test_every_declared_slider_is_a_parameter_of_its_assembly():
    for choice in SLIDERS.all().values():
        tested = [e.name for e in EXPERIMENTS.all().values() if e.assembly in choice.assemblies]
        assert {EXPERIMENTS.find(name).assembly for name in tested} == {*choice.assemblies}
        known = leaf_fields(type(read(tested[0], {}).par))
        assert set(choice.parameters) <= known.keys(), choice.name


def test_without_a_declaration_each_part_gives_its_first_parameter():
    names = ["a.x", "a.y", "a.z", "b.x", "b.y", "ecu.force.k_p", "ecu.force.k_i"]
    undeclared = read("corner-stop", {})
    assert first_sliders(undeclared, names)[:4] == ["a.x", "b.x", "ecu.force.k_p", "a.y"]


def test_parameters_that_drive_the_run_are_held(pages):
    bench = BENCHES["motorcycle"]
    follow = dependence(bench, 0, ("motor.R_m", "ecu.T_s", "ecu.dither.f_dit"))
    assert follow.driving == {"ecu.T_s"}
    assert follow.judging == {"ecu.dither.f_dit"}
    stop = bywire.Bench("straight-stop", "sport600", options={"surface": "wet-asphalt"})
    road = dependence(stop, 0, ("vehicle.road.first.c1", "vehicle.body.m"))  # by the surface
    assert road.driving == {"vehicle.road.first.c1"}
    assert "ecu.T_s" not in used(pages["motorcycle"])
    assert block(pages["motorcycle"], "bench")["judged"]["followed"] == ["ecu.dither.f_dit"]


@pytest.mark.parametrize(
    ("given", "error", "text"),
    [
        ({"out": "page.txt"}, ParameterError, "ends in .html"),
        ({"vary": ["motor.R"]}, UnknownNameError, "motor.R_m"),
        ({"vary": ["motor_heat.R_wh"]}, bywire.BywireError, "motor_heat"),
        ({"bench": "force-cycle"}, ParameterError, "Choose a run"),
        ({"bench": "seal-stribeck"}, ParameterError, "without any run"),
    ],
)
def test_what_makes_no_page_is_said(tmp_path, given, error, text):
    arguments = {"bench": "hard-braking", "out": "page.html"} | given
    with pytest.raises(error, match=text):
        bywire.page(arguments["bench"], tmp_path / arguments["out"], vary=given.get("vary", ()))
    assert not list(tmp_path.iterdir())
