"""The bench as a Python object: immutable, complete, and equivalent to a bench file."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

import bywire
from bywire.bench.bench_file import flattened, from_mapping, load
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import (
    FileError,
    InputError,
    ParameterError,
    StepError,
    UnitError,
    UnknownNameError,
)
from raising import raises

SET = "dardanelli2010"
TEXT = """
experiment = "hard-braking"
parameters = "dardanelli2010"
assembly = "motorcycle-brake"
name = "both"

[set]
motor.R_m = "0.4 ohm"
"pipeline.d_pl" = "8 mm"

[set.ecu.dither]
waveform = "square"

[options]
p_to = "30 bar"
duration = "0.5 s"

[simulation]
step = "40 us"
record = "2 ms"
seed = 3

[requirements]
overshoot = "<= 15 %"
"""


def same() -> bywire.Bench:
    """Return the bench of ``TEXT`` as a Python object."""
    return bywire.Bench(
        experiment="hard-braking",
        parameters=SET,
        name="both",
        overrides={
            "motor.R_m": "0.4 ohm",
            "pipeline.d_pl": "8 mm",
            "ecu.dither.waveform": "square",
        },
        options={"p_to": "30 bar", "duration": "0.5 s"},
        step=40e-6,
        record=2e-3,
        seed=3,
        requirements={"overshoot": "<= 15 %"},
    )


def test_file_and_object_are_equal(tmp_path):
    path = tmp_path / "both.toml"
    path.write_text(TEXT)
    loaded = load(path)
    assert loaded == same()
    assert loaded.par == same().par
    assert loaded.chosen_options == same().chosen_options
    assert loaded != dataclasses.replace(same(), seed=4)


def test_texts_and_numbers_are_the_same_values():
    name, resistance = "hard-braking", "motor.R_m"
    texts = bywire.Bench(name, SET, {resistance: "400 mohm"}, step="40 us", record="2 ms")
    numbers = bywire.Bench(name, SET, {resistance: 0.4}, step=40e-6, record=2e-3)
    assert texts.par == numbers.par
    assert (texts.step, texts.record) == (numbers.step, numbers.record)


@pytest.mark.parametrize("field", [field.name for field in dataclasses.fields(bywire.Bench)])
def test_nothing_can_be_assigned(field):
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(same(), field, None)


def test_parameters_are_frozen_too():
    bench = same()
    with pytest.raises(ValueError, match="frozen"):
        bench.par.motor.R_m = 1.0
    with pytest.raises(ValueError, match="frozen"):
        bench.chosen_options.p_to = 1.0


def test_what_was_given_may_change_afterwards():
    overrides = {"motor.R_m": 0.4}
    bench = bywire.Bench("hard-braking", SET, overrides)
    overrides["motor.R_m"] = -1.0
    assert bench.overrides == {"motor.R_m": 0.4}
    assert bench.par.motor.R_m == 0.4


def test_name_of_a_file_is_the_default(tmp_path):
    path = tmp_path / "my braking.toml"
    path.write_text('experiment = "hard-braking"\nparameters = "dardanelli2010"\n')
    assert load(path).name == "my braking"


@pytest.mark.parametrize(
    ("changes", "error", "text"),
    [
        ({"experiment": "hard-breaking"}, UnknownNameError, "did you mean 'hard-braking'"),
        ({"experiment": 3}, ParameterError, "experiment = 3 .* a string"),
        ({"parameters": "x"}, UnknownNameError, "unknown parameter set 'x'"),
        ({"parameters": None}, ParameterError, "parameters = None .* a string"),
        ({"name": 3}, ParameterError, "name = 3 .* a string"),
        ({"overrides": {"motor.R_m": -1}}, ParameterError, "must be > 0 ohm"),
        ({"overrides": {"motor.R_m": math.nan}}, ParameterError, "any finite number in ohm"),
        ({"overrides": {"motor.R_m": "1 bar"}}, UnitError, "bar cannot be converted to ohm"),
        ({"overrides": {"motor.R_m": True}}, UnitError, "must be one number"),
        ({"overrides": {"motor.R_m": None}}, UnitError, "must be one number"),
        ({"overrides": {"motor.R_m": 10**5000}}, ParameterError, "300 digits or more"),
        ({"overrides": {"motor": {}}}, UnknownNameError, "unknown parameter 'motor'"),
        ({"overrides": {"options.p_to": 1}}, UnknownNameError, "unknown parameter"),
        ({"options": {"p_to": -1}}, ParameterError, "must be > 0 Pa"),
        ({"step": 0}, StepError, "simulation.step = 0 ms"),
        ({"step": -1e-6}, StepError, "must be >= 1e-06 ms"),
        ({"step": math.inf}, ParameterError, "any finite number in s"),
        ({"step": "1 bar"}, UnitError, "bar cannot be converted to s"),
        ({"record": 0}, StepError, "simulation.record = 0 ms"),
        ({"record": math.nan}, ParameterError, "any finite number in s"),
        ({"seed": -1}, ParameterError, "simulation.seed = -1"),
        ({"seed": 2**63}, ParameterError, "<= 9223372036854775807"),
        ({"seed": 1.0}, ParameterError, "whole number"),
        ({"seed": True}, ParameterError, "whole number"),
        ({"stimulus": {"kind": "step"}}, ParameterError, "has its own stimulus"),
        ({"requirements": {"overshot": "<= 1 %"}}, UnknownNameError, "'overshoot'"),
        ({"requirements": {"overshoot": 0.1}}, ParameterError, "a limit such as"),
    ],
)
def test_what_does_not_fit_is_refused_at_construction(changes, error, text):
    with pytest.raises(error, match=text):
        bywire.Bench(**{"experiment": "hard-braking", "parameters": SET, **changes})


@pytest.mark.parametrize(
    ("name", "value", "options"),
    [
        ("drive.mode", "pedal", {}),
        ("ecu.dither.waveform", "square", {"how": "current-off"}),
    ],
)
def test_override_without_effect_is_refused(name, value, options):
    with raises(ParameterError, name=name, value=value):
        bywire.Bench("pressure-release", SET, {name: value}, options).cases()


def test_set_of_another_assembly_is_refused(monkeypatch):
    other = dataclasses.replace(PARAMETER_SETS.find(SET), name="wedge", assembly="wedge-brake")
    find = type(PARAMETER_SETS).find
    monkeypatch.setattr(
        type(PARAMETER_SETS),
        "find",
        lambda kind, name: other if kind is PARAMETER_SETS else find(kind, name),
    )
    with pytest.raises(ParameterError, match=r"tests a motorcycle-brake.* is for a wedge-brake"):
        bywire.Bench("hard-braking", "wedge")


def test_override_that_one_of_two_runs_takes_is_kept():
    bench = bywire.Bench("friction-ramp", SET, {"ecu.dither.waveform": "square"})
    waveforms = [case.par.ecu.dither.waveform for case in bench.cases()]
    assert waveforms == ["off", "square"]


@pytest.mark.parametrize(
    ("experiment", "changes", "error", "text"),
    [
        ("motor-open-loop", {}, ParameterError, r"needs a \[stimulus\] section"),
        ("hard-braking", {"step": "30 us"}, StepError, "does not divide the ecu interval"),
        ("pressure-step", {"step": "30 us"}, StepError, "does not divide the ecu interval"),
        ("hard-braking", {"record": "30 us"}, StepError, "does not divide the recording"),
        ("pedal-tracking", {"options": {"trace": "none.csv"}}, FileError, "none.csv"),
    ],
)
def test_what_costs_no_run_is_checked_at_construction(experiment, changes, error, text):
    with pytest.raises(error, match=text):
        bywire.Bench(experiment, SET, **changes)


@pytest.mark.parametrize("path", ["no/a.toml", Path("no/a.toml")])
def test_run_takes_the_path_of_a_bench_file_too(path):
    with pytest.raises(FileError, match=r"cannot read bench file no/a\.toml"):
        bywire.run(path)
    assert bywire.run("seal-stribeck").bench.parameters == SET


def test_a_bare_name_of_nothing_is_answered_with_the_nearest_experiment():
    with pytest.raises(UnknownNameError, match="'seal-stribek': did you mean seal-stribeck"):
        bywire.run("seal-stribek")


def test_numbers_are_si_in_python_and_need_a_unit_in_files(tmp_path):
    content = {"experiment": "hard-braking", "parameters": SET, "options": {"p_to": 30e5}}
    assert bywire.Bench("hard-braking", SET, options=content["options"]).chosen_options.p_to == 30e5
    with pytest.raises(UnitError, match="a pure number cannot be converted to Pa"):
        from_mapping(content, tmp_path, "x")
    zero = {**content, "options": {"settle": 0, "smoothing": "0"}}
    assert from_mapping(zero, tmp_path, "x").chosen_options.smoothing == 0.0


def test_smoothing_follows_the_dither_unless_given():
    dithered = {"ecu.dither.f_dit": "40 Hz"}
    for name in ("hard-braking", "friction-ramp", "pedal-tracking", "pressure-step"):
        assert bywire.Bench(name, SET).chosen_options.smoothing == pytest.approx(0.02)
        assert bywire.Bench(name, SET, dithered).chosen_options.smoothing == pytest.approx(0.025)
        given = bywire.Bench(name, SET, dithered, {"smoothing": "10 ms"})
        assert given.chosen_options.smoothing == 0.01


def test_nested_sections_become_dotted_names():
    assert flattened({"a": {"b": 1, "c": {"d": [2]}}, "e": 3}) == {"a.b": 1, "a.c.d": [2], "e": 3}


def test_content_without_a_file(tmp_path):
    content = {"experiment": "hard-braking", "parameters": SET}
    assert from_mapping(content, tmp_path, "x") == bywire.Bench("hard-braking", SET, name="x")
    with pytest.raises(InputError, match="unknown key of a bench file 'x'"):
        from_mapping({**content, "x": 1}, tmp_path, "x")
