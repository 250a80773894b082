"""Bad values get one clear error: in Python, in sets, with --set, and in bench files."""

import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

import bywire
from bywire.authoring import chosen
from bywire.cli.main import main
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.units import parse
from systems.loading import loaded

FOLDER = Path(__file__).parents[2] / "examples"
EXPERIMENTS = {
    "truck-front": "ebs-stop",
    "one-box-corner": "abs-stop",
    "emb42v-pmsm": "clamp-step",
}
VALUES = [
    ("truck-front", "feed.b", "1", "1", "= 1 is not valid: it must be > 0 and < 1"),
    ("truck-front", "exhaust.b", "1.2", "1", "= 1.2 is not valid: it must be > 0 and < 1"),
    ("truck-front", "feed.r_lam", "0.2", "1", "= 0.2 must be > the critical ratio b = 0.3"),
    ("truck-front", "p_s", "-2 bar", "Pa", "= -2 bar is not valid: it must be > 0 bar"),
    ("truck-front", "gas.p_atm", "-1 bar", "Pa", "= -1 bar is not valid: it must be > 0 bar"),
    ("truck-front", "lever.mu", "1", "1", "= 1 is not valid: it must be >= 0 and < 1"),
    ("one-box-corner", "check.seat.d", "0 mm", "m", "= 0 mm is not valid: it must be > 0 mm"),
    ("one-box-corner", "fluid.p_atm", "-1 bar", "Pa", "= -1 bar is not valid: it must be > 0 bar"),
]


@pytest.fixture(scope="module", autouse=True)
def brakes():
    with ExitStack() as stack:
        for name in ("truck_ebs", "one_box", "emb_caliper"):
            stack.enter_context(loaded(FOLDER / name))
        yield


def in_python(folder, name, parameter, value, unit):
    bywire.parameters(name).replace({parameter: parse(value, unit, parameter)})


def in_a_set(folder, name, parameter, value, unit):
    known = PARAMETER_SETS.all()[name]
    changed = chosen(parse(value, unit, parameter), "")
    replace(known, values={**known.values, parameter: changed}).parameters()


def with_set(folder, name, parameter, value, unit):
    bywire.run(EXPERIMENTS[name], {"parameters": name, parameter: value})


def in_a_bench_file(folder, name, parameter, value, unit):
    lines = [f'experiment = "{EXPERIMENTS[name]}"', f'parameters = "{name}"', "[set]"]
    quoted = value if unit == "1" else f'"{value}"'
    (folder / "bad.toml").write_text("\n".join([*lines, f"{parameter} = {quoted}", ""]))
    bywire.run(folder / "bad.toml")


@pytest.mark.parametrize("road", [in_python, in_a_set, with_set, in_a_bench_file])
@pytest.mark.parametrize(("name", "parameter", "value", "unit", "text"), VALUES)
def test_one_line_says_what_is_valid(tmp_path, road, name, parameter, value, unit, text):
    with pytest.raises(bywire.BywireError) as caught:
        road(tmp_path, name, parameter, value, unit)
    assert f"{parameter} {text}" in str(caught.value)
    assert str(caught.value).count("\n") == 0
    assert caught.value.name == parameter
    assert caught.value.valid in text


def test_the_command_prints_one_line(monkeypatch, capsys):
    change = ["--set", "parameters=emb42v-pmsm", "--set", "ecu.T_current=33 us"]
    monkeypatch.setattr(sys, "argv", ["bywire", "run", "clamp-step", *change])
    with pytest.raises(SystemExit) as ended:
        main()
    out, err = capsys.readouterr()
    assert (ended.value.code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1
    assert "T_current = 0.033 ms must divide T_force = 1 ms" in err


MAP = {
    "motor.law": "saturated",
    "motor.map.i_d": "-10 A, 10 A",
    "motor.map.i_q": "-10 A, 10 A",
    "motor.map.psi_d": "-2 mWb, -2 mWb, 2 mWb, 2 mWb",
}


@pytest.mark.parametrize(
    ("psi_q", "fits"),
    [("-3 mWb, 3 mWb, -3 mWb, 3 mWb", True), ("-3 mWb, 3 mWb, -2 mWb, 3 mWb", False)],
)
def test_a_flux_map_needs_equal_cross_slopes(psi_q, fits):
    bench = {"parameters": "emb42v-pmsm", **MAP, "motor.map.psi_q": psi_q}
    if fits:
        bywire.run("clamp-step", bench, estimate_error=False)
        return
    with pytest.raises(bywire.BywireError) as caught:
        bywire.run("clamp-step", bench)
    text = str(caught.value)
    assert "motor.map.psi_q = a table whose slope over i_d is 0.025 mH (i_d = -10 to 10 A" in text
    assert "the slope of psi_d over i_q, 0 mH: otherwise the magnetic energy depends" in text


@pytest.mark.parametrize(
    ("name", "given"),
    [("truck-front", "p_set"), ("one-box-front", "p_set"), ("one-box-front", "F_foot")],
)
def test_demands_below_zero_are_rejected(name, given):
    unit = "N" if given == "F_foot" else "bar"
    bench = {"parameters": name, "options.input": given, "options.end": f"-3 {unit}"}
    with pytest.raises(bywire.BywireError, match=f"{given} is -3 {unit} at t = 0 s.* >= 0 {unit}"):
        bywire.run("step", bench)


def test_fluid_below_vacuum_is_reported():
    """Each chamber with a pressure of its own is named; a recording is changed for this."""
    result = bywire.run("pedal-apply", {"parameters": "one-box-front"}, estimate_error=False)
    assert result.warnings == []
    (recording,) = result.recordings.values()
    model, par = result.bench.cases()[0].model, result.bench.par
    for signal, place in (("p_mc", "master cylinder"), ("p", "caliper"), ("p_o", "caliper")):
        values = recording[signal].values.copy()
        values[recording["time"].values > 0.5] = -1.2e5
        (text,) = model.watch(recording.assign({signal: ("time", values)}), par)
        below = f"the absolute pressure in the {place} is below zero at t = 0.501 s"
        assert text.startswith(below)


def test_small_pressures_below_zero_are_not():
    result = bywire.run("pedal-apply", {"parameters": "one-box-front"}, estimate_error=False)
    (recording,) = result.recordings.values()
    model, par = result.bench.cases()[0].model, result.bench.par
    values = recording["p_mc"].values.copy()
    values[recording["time"].values > 0.5] = -0.5e5
    assert model.watch(recording.assign({"p_mc": ("time", values)}), par) == []


@pytest.mark.parametrize(
    ("value", "valid"),
    [("inf", "finite and >= 0 W"), ("-1e3", ">= 0 kW"), ("nan", ">= 0 W")],
)
def test_blending_needs_a_battery_with_a_limit(value, valid):
    electric = bywire.parameters("roberts2003-corner-electric")
    limit = "regeneration.battery.P_max"
    with pytest.raises(bywire.BywireError, match=f"{limit} = .* it must be {valid}$"):
        electric.replace({limit: float(value)})


def test_blending_without_a_battery_limit_is_rejected():
    known = PARAMETER_SETS.all()["roberts2003-corner-electric"]
    limit = "regeneration.battery.P_max"
    values = {name: each for name, each in known.values.items() if name != limit}
    with pytest.raises(bywire.BywireError, match=f"{limit} is missing. Add a value"):
        replace(known, values=values).parameters()
