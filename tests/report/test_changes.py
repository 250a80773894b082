"""Changes by the user, as listed in the terminal, the JSON object and the page."""

from __future__ import annotations

import json
import re

import pytest
import xarray as xr

import bywire
from bywire.api.study import StudyResult
from bywire.core.catalog import PARAMETER_SETS, main_set
from bywire.report.page import fragment_html
from bywire.report.subject import bench_changes
from bywire.synthesis.study import STUDIES, Findings
from undrawn import undrawn

QUICK = {"options.duration": "40 ms", "options.settle": "10 ms"}


def changed(*arguments, **more):
    found = {each.name: each for each in bench_changes(bywire.Bench(*arguments, **more))}
    return {name: (each.now, each.before) for name, each in found.items()}


def test_signals_that_options_name_are_changes_where_they_are_no_default():
    names = {"input": "i_set", "output": "p_mc", "drive": "i"}
    assert changed("ramp", "dardanelli2010", options=names) == {
        "options.input": ("i_set", "not set"),
        "options.output": ("p_mc", "i"),
        "options.drive": ("i", "i_set"),
    }
    # By default, the output is the first one with the input's unit, and the drive is the input.
    assert changed(
        "ramp", "dardanelli2010", options={"input": "i_set", "output": "i", "drive": "i_set"}
    ) == {"options.input": ("i_set", "not set")}


def test_settings_of_the_run_stimulus_and_assembly_are_changes():
    found = changed(
        "tracking",
        "dardanelli2010",
        {"motor.R_m": 0.4},
        {"input": "p_set", "duration": 0.1},
        {"kind": "step", "start": 0.0, "end": 1e6, "t_step": 0.0},
        step=10e-6,
        record=2e-3,
        seed=7,
    )
    assert found["motor.R_m"] == ("0.4 Ω", "0.35 Ω")
    assert found["options.duration"] == ("100 ms", "1 s")
    assert found["stimulus.kind"] == ("step", "the experiment's own")
    assert found["simulation.step"] == ("0.01 ms", "0.02 ms")
    assert found["simulation.record"] == ("2 ms", "the experiment's own")
    assert found["simulation.seed"] == ("7", "0")
    assert changed("hard-braking", "dardanelli2010") == {}


@pytest.fixture(autouse=True)
def few_pixels():
    with undrawn():
        yield


def answers(tmp_path):
    """Yield an answer of every quick use case that accepts changes, with one change each."""
    resistance = {"motor.R_m": "0.41 ohm"}
    yield bywire.run("hard-braking", {**QUICK, **resistance}, estimate_error=False)
    over = "motor.L_m=0.1 mH, 0.2 mH"
    yield bywire.run("hard-braking", {**QUICK, **resistance}, over=over, estimate_error=False)
    benches = [
        bywire.Bench(
            "hard-braking",
            "dardanelli2010",
            {"motor.R_m": 0.41, "motor.L_m": inductance},
            {"duration": 0.04, "settle": 0.01},
        )
        for inductance in (1e-4, 2e-4)
    ]
    yield bywire.compare(*benches, estimate_error=False)
    yield bywire.page(benches[0], tmp_path / "page.html")
    for function in (bywire.margins, bywire.linearize):
        yield function("pressure", overrides=resistance)
    yield bywire.linearize("motorcycle-plant", overrides=resistance)


def test_every_road_lists_what_was_changed(tmp_path):
    sentence = re.compile(r"changed from dardanelli2010: [^;]*motor\.R_m = 0\.41 Ω \(was 0\.35 Ω\)")
    for answer in answers(tmp_path):
        name = type(answer).__name__
        assert sentence.search(" ".join(str(answer).split())), name
        assert "0.41 Ω" in json.dumps(answer.as_object(), ensure_ascii=False), name
        page = fragment_html(answer.document(), []).replace("<wbr>", "")
        assert name == "BenchPage" or ("0.41 Ω" in page and "motor.R_m" in page), name
    assert "motor.R_m = 0.41 Ω (was 0.35 Ω)" in (tmp_path / "page.html").read_text("utf-8")


def test_a_comparison_reads_changes_back_from_a_folder(tmp_path):
    bywire.run("seal-stribeck", {"seal.T_pr": "4 mN*m"}, estimate_error=False).write(tmp_path)
    found = bywire.compare(tmp_path, tmp_path)
    assert "seal.T_pr = 0.004 N·m (was 0.002 N·m)" in str(found)
    assert found.as_object()["runs"][0]["changes"]["seal.T_pr"]["instead_of"] == "0.002 N·m"


def test_a_study_names_what_varies_beside_what_is_changed(tmp_path):
    (tmp_path / "bench.toml").write_text(
        'experiment = "hard-braking"\nparameters = "dardanelli2010"\n[simulation]\nseed = 0\n'
    )
    file = tmp_path / "study.toml"
    vary = "".join(f'"{name}" = "+-5 %"\n' for name in ("motor.R_m", "motor.L_m"))
    file.write_text(f'bench = "bench.toml"\n[vary]\n{vary}[design]\nkind = "corners"\n')
    found = bywire.run_study(file, tmp_path / "out", workers=1)
    shown = " ".join(str(found).split())
    assert "varied: motor.R_m, motor.L_m" in shown
    page = fragment_html(found.document(), [])
    assert "Only motor.R_m, motor.L_m varied" in page
    assert "Nothing was changed" not in page


@pytest.mark.parametrize("name", sorted(STUDIES.all()))
def test_options_of_a_study_of_designs_are_changes(name):
    study = STUDIES.find(name)
    option, value = next(
        (key, value) for key, value in study.defaults.flat().items() if isinstance(value, float)
    )
    cited = main_set(study.assembly)
    options = study.defaults.replace({option: 1.001 * value})
    par = PARAMETER_SETS.find(cited).parameters()
    found = StudyResult(study, cited, par, options, Findings(xr.Dataset(), (), (), {}))
    (change,) = found.document().changes
    assert (change.name, change.of) == (option, f"the defaults of {name}")
