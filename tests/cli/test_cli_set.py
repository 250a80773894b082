"""Changes to a bench from the command line."""

from __future__ import annotations

import pytest
from command_line import BRAKING, OPEN_LOOP, QUICK, refused

import bywire as package


@pytest.mark.parametrize(
    ("change", "texts"),
    [
        ("options.p_to", ["--set options.p_to", "KEY=VALUE"]),
        ("=3", ["--set =3", "KEY=VALUE"]),
        ("options.p_to=", ["--set options.p_to=", "KEY=VALUE"]),
        ("", ["KEY=VALUE"]),
        ("p_to=30bar", ["'p_to': it is an option of hard-braking. Type --set options.p_to=30bar"]),
        ("p_to=+50%", ["Type --set options.p_to=VALUE"]),
        ("overshoot=3", ["it is a key figure", '--set "requirements.overshoot=<= 15 %"']),
        ("overshoot=<= 3 %", ['--set "requirements.overshoot=<= 3 %"']),
        ("seed=4", ["it is a setting of the simulation. Type --set simulation.seed=4"]),
        ("sport600=1", ["it is a parameter set. Type --set parameters=sport600"]),
        ("friction-ramp=1", ["it is an experiment. Type --set experiment=friction-ramp"]),
        ("p_set=4 bar", ["it is a signal of motorcycle-brake. 'bywire list hard-braking'"]),
        ("p_mc=4 bar", ["it is a signal of motorcycle-brake"]),
        ("options.motor.R_m=1 ohm", ['it is a parameter. Type --set "motor.R_m=1 ohm"']),
        ("options.overshoot=3 %", ["unknown option 'overshoot': it is a key figure"]),
        ("requirements.p_to=<= 3 bar", ["it is an option of hard-braking. Type --set"]),
        ("xyz=4", ["valid names are", "and 123 more ('bywire list dardanelli2010' shows all)"]),
        ("options.p_too=30bar", ["unknown option of hard-braking 'p_too'", "'p_to'"]),
        ("option.p_to=30bar", ["unknown section 'option'", "'options'"]),
        ("options=3", ["options is a section", "options.NAME=VALUE"]),
        ("options.p_to.x=3", ["unknown option of hard-braking 'p_to.x'", "'p_to'"]),
        ("motor.R_n=0.4ohm", ["unknown parameter 'motor.R_n'", "'motor.R_m'"]),
        ("motor.R_m=0.4", ["a pure number cannot be converted to ohm", "'0.5 ohm'"]),
        ("motor.R_m=9bar", ["bar cannot be converted to ohm"]),
        ("motor.R_m=-1ohm", ["motor.R_m = -1 ohm", "> 0 ohm"]),
        ("motor.R_m=nan", ["is not a quantity"]),
        ("simulation.stepp=1us", ["unknown key of [simulation] 'stepp'", "'step'"]),
        ("simulation.step=1e-30s", [">= 1e-09 s"]),
        ("simulation.seed=x", ["simulation.seed = 'x'", "whole number"]),
        ("simulation.seed=" + "9" * 5000, ["simulation.seed = ", "whole number"]),
        ("requirements.overshot=<= 1 %", ["unknown KPI", "'overshoot'"]),
        ("requirements.overshoot=1 %", ["a limit such as '<= 15 %'"]),
        ("requirements.overshoot<=1 %", ["unknown KPI", "'overshoot'"]),
        ("experiment=hard-breaking", ["unknown experiment", "'hard-braking'"]),
        ("parameters=dardaneli", ["unknown parameter set", "'dardanelli2010'"]),
        ("assembly=wedge", ["assembly = 'wedge'", "motorcycle-brake"]),
        ("stimulus.kind=step", ["has its own stimulus"]),
        ("gear.law=papr", ["gear.law", "did you mean 'paper'?"]),
    ],
)
def test_bad_change_gets_one_clear_line(bywire, bench, change, texts):
    refused(bywire("run", bench(), "--set", change), *texts)


def test_the_same_key_twice(bywire, bench):
    arguments = ("--set", "motor.R_m=1ohm", "--set", "motor.R_m=2ohm")
    refused(bywire("run", bench(), *arguments), "motor.R_m is set twice")


@pytest.mark.parametrize("value", ["0.4", "1e-3"])
def test_number_without_a_unit_gets_the_same_answer_in_file_and_change(bywire, bench, value):
    number, said = (
        repr(float(value)),
        "has the wrong unit: a pure number cannot be converted to ohm",
    )
    changed = bywire("run", bench(), "--set", f"motor.R_m={number}")
    written = bywire("run", bench(f"{BRAKING}[set]\nmotor.R_m = {value}\n"))
    refused(changed, f"motor.R_m = '{number}' {said}", "'0.5 ohm'")
    assert changed.err.replace(f"'{number}'", number) == written.err  # quoted as in the file


def test_zero_and_pure_numbers_need_no_unit(bywire, bench):
    path = bench(f"{BRAKING}{QUICK}\n[set]\nseal.T_pr = 0\necu.dither.gain = 0.9\n")
    arguments = ("--set", "options.smoothing=0", "--set", "gear.eta_g=0.9")
    assert bywire("run", path, *arguments).status == 0


@pytest.mark.parametrize("section", ["options", "set", "simulation", "requirements", "stimulus"])
def test_change_of_a_section_that_is_none(bywire, bench, section):
    path = bench(f"{BRAKING}{section} = 3\n")
    refused(bywire("run", path, "--set", f"{section}.x=1"), f"[{section}] must be a section")


def test_changes_are_those_of_the_file(bywire, bench, tmp_path):
    changes = {
        "motor.R_m": "0.4 ohm",
        "ecu.dither.waveform": "square",
        "options.p_to": "30 bar",
        "simulation.step": "40 us",
        "simulation.record": "2 ms",
        "simulation.seed": "7",
        "requirements.peak_current": "<= 25 A",
        "name": "changed",
        "parameters": "dardanelli2010-table1",
    }
    arguments = [part for key, value in changes.items() for part in ("--set", f"{key}={value}")]
    outcome = bywire("run", bench(), "--out", tmp_path / "out", "--json", *arguments)
    assert outcome.status == 0
    assert outcome.object["bench"] == "changed"
    assert outcome.object["requirements"][0]["limit"] == "<= 25 A"
    recording = package.read_recording(tmp_path / "out" / "run.nc")
    assert recording.attrs["step"] == 40e-6
    assert recording.attrs["seed"] == 7
    assert recording.attrs["parameter_set"] == "dardanelli2010-table1"
    assert '"R_m":0.4' in recording.attrs["parameters"]
    assert '"waveform":"square"' in recording.attrs["parameters"]
    assert float(recording["time"][1] - recording["time"][0]) == pytest.approx(2e-3)
    assert float(recording["p_ref"][-1]) == pytest.approx(30e5)


def test_change_wins_over_every_spelling_in_the_file(bywire, bench):
    for text in ('"motor.R_m" = 0', "motor.R_m = 0", "[set.motor]\nR_m = 0"):
        section = "" if text.startswith("[") else "[set]\n"
        path = bench(f"{BRAKING}{QUICK}\n{section}{text}\n")
        for name in ("motor.R_m", "set.motor.R_m"):
            assert bywire("run", path, "--set", f"{name}=0.4ohm").status == 0


def test_stimulus_from_the_command_line(bywire, bench):
    path = bench(OPEN_LOOP + '[options]\nduration = "20 ms"\n')
    kind = ("kind=table", "times=0 s, 10 ms", "values=0 A, 1 A", "between=linear")
    arguments = [part for text in kind for part in ("--set", f"stimulus.{text}")]
    assert bywire("run", path, *arguments).status == 0


def test_shares_and_patterns_change_what_is_there(bench):
    cited = package.parameters("dardanelli2010").leaves()
    path = str(bench(f'{BRAKING}{QUICK}\n[set]\nseal.c = "2 s/rad"\n"motor.*" = "+10%"\n'))
    changed = package.run(path, {"seal.T_pr": "+50%", "seal.c": " - 5 %"}).bench.par.leaves()
    assert changed["seal.T_pr"] == pytest.approx(1.5 * cited["seal.T_pr"], rel=1e-12)
    assert changed["seal.c"] == pytest.approx(0.95 * 2.0, rel=1e-12)  # relative to the file's value
    for name in ("motor.R_m", "motor.K_e"):
        assert changed[name] == pytest.approx(1.1 * cited[name], rel=1e-12)
    assert changed["gear.eta_g"] == cited["gear.eta_g"]
    plain = package.Bench("hard-braking", "dardanelli2010", {"seal.*": "+50%", "seal.c": "2 s/rad"})
    assert plain.par.seal.c == 2.0  # a full name takes precedence over a pattern
    twice = plain.with_overrides({"seal.c": "+50%"})
    assert twice.par.seal.c == pytest.approx(3.0)
    margins = package.margins("pressure", overrides={"seal.*": "-10%"})
    assert margins.case.par.seal.c == pytest.approx(0.9 * cited["seal.c"])


@pytest.mark.parametrize(
    ("change", "texts"),
    [
        ("seels.*=+50%", ["parameter pattern", "'seels.*'", "'seal.*'"]),
        ("gear.law=+50%", ["gear.law = '+50%'", "is a choice (now paper), which cannot change"]),
        ("*.law=+50%", ["every quantity that matches the pattern is 0"]),
        ("motor.R_m=-150%", ["motor.R_m = -0.175 ohm", "> 0 ohm", "got '-150%'"]),
        ("motor.R_n=+5%", ["unknown parameter 'motor.R_n'", "'motor.R_m'"]),
        ("motor.*=5", ["motor.R_m = '5' has the wrong unit"]),
    ],
)
def test_bad_shares_and_patterns(bywire, bench, change, texts):
    refused(bywire("run", bench(), "--set", change), *texts)


def test_a_share_of_zero_is_refused(bywire, bench):
    path = bench(f"{BRAKING}[set]\nseal.T_pr = 0\n")
    refused(
        bywire("run", path, "--set", "seal.T_pr=+50%"), "changes nothing because seal.T_pr is 0"
    )
    refused(bywire("run", path, "--set", "motor_heat.T_a=+5%"), "is ambiguous", "in K")
