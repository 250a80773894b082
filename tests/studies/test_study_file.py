"""Study files: what they say is what is computed, and every mistake has one clear error."""

from __future__ import annotations

import re
import subprocess
import sys

import numpy as np
import pytest

from bywire.core.errors import InputError
from bywire.studies.study_file import read_study
from raising import raises

RELEASE = 'experiment = "pressure-release"\nparameters = "dardanelli2010"\n'
PULSES = 'experiment = "moment-pulses"\nparameters = "roberts2003"\n'
STOPS = 'experiment = "repeated-stops"\nparameters = "sport600"\n'
OPEN_LOOP = """
experiment = "motor-open-loop"
parameters = "dardanelli2010"
[stimulus]
kind = "step"
start = "0 A"
end = "2 A"
t_step = "0 s"
"""


def test_a_study_says_what_varies_and_how(study):
    plan = read_study(
        study("""
[vary]
motor.R_m = "+-5 %"
"motor.K_e" = { kind = "normal", sd = "2 %", together = ["ecu.est_par.K_e"] }
"options.p_to" = { kind = "discrete", values = ["20 bar", "37 bar"] }
[[correlation]]
of = ["motor.R_m", "motor.K_e"]
value = 0.5
[design]
kind = "latin-hypercube"
cases = 100
seed = 3
confidence = "99 %"
[set]
"seal.T_pr" = "+10%"
[requirements]
overshoot = "<= 15 % with 99.9 %"
""")
    )
    assert [v.name for v in plan.varied] == ["motor.R_m", "motor.K_e", "options.p_to"]
    assert (plan.design, plan.seed, plan.confidence) == ("latin-hypercube", 3, 0.99)
    assert (plan.cases, plan.chunks, plan.total) == (100, 2, 128)  # whole hypercubes
    assert plan.bench.requirements == {"peak_current": "<= 25 A", "overshoot": "<= 15 %"}
    assert str(plan.demands[1]) == "overshoot <= 15 % with 99.9 %"
    values = plan.values(0)
    ratio = values["ecu.est_par.K_e"] / plan.bench.par.ecu.est_par.K_e
    np.testing.assert_allclose(ratio, values["motor.K_e"] / plan.bench.par.motor.K_e)
    assert set(values["options.p_to"]) == {20e5, 37e5}


def test_an_experiment_needs_no_bench_file(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text('bench = "hard-braking"\n[vary]\n"motor.R_m" = "+-5 %"\n')
    assert read_study(path).bench.experiment == "hard-braking"


@pytest.mark.parametrize(
    ("text", "texts"),
    [
        ("", ["[vary] is empty", "motor.R_m"]),
        ('[vary]\n"motor.R_x" = "+-5 %"', ["'motor.R_x'", "'motor.R_m'"]),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n"motor.K_e" = { kind = "normal", sd = "1 %", '
            'together = ["motor.R_m"] }',
            ["motor.R_m varies twice", "[vary] motor.K_e.together"],
        ),
        (
            '[vary]\nmotor.R_m = "+-1 %"\n"motor.R_m" = "+-5 %"',
            ["motor.R_m varies twice", '"motor.R_m" in quotation marks'],
        ),
        (
            '[vary.motor]\nR_m = "+-1 %"\n[vary.motor.K_e]\nsd = "1 %"',
            ["[vary] motor.K_e = { sd = '1 %' } has no kind"],
        ),
        (
            '[vary]\n"motor.K_e" = "+-1 %"\n[set]\nmotor.R_m = "1 ohm"\n"motor.R_m" = "2 ohm"',
            ["motor.R_m has two values"],
        ),
        (
            '[vary]\n"motor.R_m" = { sd = "5 %" }',
            ["has no kind", "'normal' or 'log-normal'", "triangular"],
        ),
        ('[vary]\nmotor.R_m.sd = "5 %"', ["[vary] motor.R_m = { sd = '5 %' } has no kind"]),
        ('[vary]\nmotor.R_x = { sd = "5 %" }', ["unknown", "'motor.R_x'", "'motor.R_m'"]),
        ('[vary]\nmoter.R_m = "+-5 %"', ["'moter.R_m'", "'motor.R_m'"]),
        ("[vary]\nmotor = { R_m = 5 }", ["[vary] motor.R_m = 5 is not valid. Write a tolerance"]),
        (
            '[vary]\n"motor.K_e" = { kind = "normal", sd = "1 %", together = [["a"]] }',
            ["varies together", "\"['a']\""],
        ),
        (
            '[vary]\n"motor.K_e" = { kind = "normal", sd = "1 %", '
            'together = ["ecu.pedal_map.V_nodes"] }',
            ["ecu.pedal_map.V_nodes is a table"],
        ),
        (
            '[vary]\n"seal.T_pr" = { kind = "tolerance", tolerance = "100 %", '
            'together = ["motor.R_m"] }',
            ["[vary] seal.T_pr.together motor.R_m", "bound at 0", "must be > 0"],
        ),
        (
            '[vary]\n"motor.R_m" = "+-100 %"',
            ["bound at 0 ohm is not valid", "> 0 ohm", "narrower tolerance"],
        ),
        (
            '[vary]\n"motor.K_e" = { kind = "normal", sd = "1 %", together = ["ecu.K"] }',
            ["varies together", "'ecu.K'"],
        ),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[design]\ncases = 0', ["cases = 0", "from 1"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[design]\nkind = "sobl"', ["'sobl'", "'sobol'"]),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[design]\nconfidence = "100 %"',
            ["[design] confidence = '100 %' must be >= 50 % and < 100 %"],
        ),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[desing]\ncases = 1', ["'desing'", "'design'"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[requirements]\novershot = "<= 15 %"', ["'overshoot'"]),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[requirements]\novershoot = "<= 15 % with 120 %"',
            ["120 %", "between 0"],
        ),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[requirements]\novershoot = "<= 15 bar with 90 %"',
            ["overshoot", "percent"],
        ),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[design]\nkind = "corners"\n[requirements]\n'
            'overshoot = "<= 15 % with 90 %"',
            ["does not draw random cases", "'monte-carlo'"],
        ),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[requirements]\novershoot = "<= 10 % with 0.9"',
            ["overshoot = '<= 10 % with 0.9'", "not '0.9'", "'with 90 %'"],
        ),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[requirements]\novershoot = "<= 10 % with lots"',
            ["not 'lots'", "in percent", "'with 99 %'"],
        ),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[requirements]\novershoot = "<= 10 % with"',
            ["not ''"],
        ),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[requirements]\novershoot = "<= 10 % with 9x %"',
            ["not '9x %'"],
        ),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[requirements]\novershoot = "15 % with 90 %"',
            ["overshoot = '15 %' is not valid"],
        ),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[[correlation]]\nvalue = 0.5', ["of is missing"]),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[[correlation]]\nof = [["a"], "b"]\nvalue = 0.5',
            ["of = [['a'], 'b']: for example, write of = "],
        ),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[simulation]\nstep = "10 us"',
            ["[simulation] belongs in the bench file", "[set]", "requirements"],
        ),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[simulatoin]\nstep = "10 us"',
            ["'simulatoin': valid names are name, bench, vary"],
        ),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[[correlation]]\nof = ["motor.R_m", "motor.K_e"]\n'
            "value = 0.5",
            ["'motor.K_e'", "correlation"],
        ),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n"adc.law" = { values = ["ideal", "quantized"] }\n'
            '[[correlation]]\nof = ["motor.R_m", "adc.law"]\nvalue = 0.5',
            ["[[correlation]] of motor.R_m and adc.law", "adc.law is a choice"],
        ),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[design]\ntime = 5',
            ["[design] time = 5 has the wrong unit", "'1.5 s'"],
        ),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[design]\ntime = 0', ["time = 0 must be > 0 ms"]),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n"motor.K_e" = "+-5 %"\n[[correlation]]\n'
            'of = ["motor.R_m", "motor.K_e"]\nvalue = 1.0',
            ["[[correlation]] value = 1.0 must be > -1 and < 1"],
        ),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[set]\n"motor.K_e" = 0.3', ["a string with its unit"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[design]\nlevels = 3', ["levels", "'monte-carlo'"]),
        (
            '[vary]\n"motor.R_m" = "+-5 %"\n[design]\nkind = "grid"\ncases = 9',
            ["no effect for 'grid'"],
        ),
        ('[vary]\n"friction.law" = { values = ["dry"] }', ["friction.law"]),
        ('[vary]\n"adc.law" = { values = ["ideal"] }', ["only one value, ideal", "[set]"]),
        ('[vary]\n"adc.law" = { values = ["ideal", "ideal"] }', ["lists the value ideal twice"]),
        (
            '[vary]\n"adc.law" = { values = ["ideal", "quantized"], weigths = [1, 2] }',
            ["'weigths'", "'weights'"],
        ),
        (
            '[vary]\n"adc.law" = { kind = "normal", values = ["ideal", "quantized"] }',
            ["adc.law is a choice", "'discrete'", "'normal'"],
        ),
    ],
)
def test_what_is_wrong_is_said_with_the_files_name(study, text, texts):
    path = study(text)
    with pytest.raises(InputError) as refused:
        read_study(path)
    for each in (str(path), *texts):
        assert each in str(refused.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('"options.how" = { values = ["controlled", "curent-off"] }', "'current-off'"),
        ('"options.hwo" = { values = ["controlled", "current-off"] }', "'options.how'"),
        ('"options.how" = "+-5 %"', "is not valid for a choice"),
        ('"options.how" = { values = ["current-off"] }', "only one value"),
        (
            '"options.how" = { values = ["controlled", "current-off"], together = ["motor.R_m"] }',
            "so 'together' cannot apply to it",
        ),
    ],
)
def test_what_is_wrong_with_a_choice_among_the_options_is_said(study, text, said):
    with pytest.raises(InputError, match=re.escape(said)):
        read_study(study(f"[vary]\n{text}\n", RELEASE))


@pytest.mark.parametrize(
    ("bench", "text", "texts"),
    [
        (
            PULSES,
            '"options.pulses" = { kind = "uniform", low = 1, high = 3 }',
            [
                "[vary] options.pulses is a whole number, >= 1 and <= 100",
                "'uniform'",
                "kind = 'discrete', values = [2, 3, 4]",
            ],
        ),
        (PULSES, '"options.pulses" = { sd = "5 %" }', ["has no kind. Add kind = 'discrete' ("]),
        (PULSES, '"options.pulses" = "+-30 %"', ["is a whole number", "'tolerance'"]),
        (
            PULSES,
            '"options.pulses" = { kind = "discrete", values = [1, 2.5] }',
            ["[vary] options.pulses.values = 2.5 is not", "a whole number, >= 1 and <= 100"],
        ),
        (PULSES, '"options.pulses" = { kind = "discrete", values = [0, 2] }', ["Remove 0"]),
        (
            STOPS,
            '"options.stops" = { kind = "triangular", low = 8, high = 12 }',
            ["options.stops is a whole number, >= 1 and <= 200", "values = [9, 10, 11]"],
        ),
        (
            STOPS,
            '"options.stops" = { kind = "discrete", values = [10, "+11 %"] }',
            ["11.1 is not valid"],
        ),
    ],
)
def test_whole_numbers_have_single_values(study, bench, text, texts):
    with pytest.raises(InputError) as refused:
        read_study(study(f"[vary]\n{text}\n", bench))
    for each in texts:
        assert each in str(refused.value)


@pytest.mark.parametrize(
    ("kind", "visited"),
    [
        ("grid", {1, 3, 11}),
        ("corners", {1, 3, 11}),
        ("one-at-a-time", {1, 3, 11}),
        ("monte-carlo", {1, 11}),
        ("latin-hypercube", {1, 11}),
        ("sobol", {1, 11}),
    ],
)
def test_designs_visit_whole_numbers(study, kind, visited):
    text = '[vary]\n"options.pulses" = { kind = "discrete", values = [1, "11"] }\n'
    plan = read_study(study(f'{text}[design]\nkind = "{kind}"\n', PULSES))
    assert {*plan.values(0)["options.pulses"].tolist()} == visited


def test_a_share_of_a_whole_number_may_be_whole(study):
    text = '[vary]\n"options.stops" = { kind = "discrete", values = ["-10 %", "+10 %"] }\n'
    assert read_study(study(text, STOPS)).varied[0].distribution.singles == (9.0, 11.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('"options.source" = { values = ["current", "voltage"] }', "A cannot be converted to V"),
        ('"options.source" = { values = ["current", "current-loop"] }', "(share_sat_current, "),
        ('"options.add_holding" = { values = [true, 1] }', "valid names are false, true"),
    ],
)
def test_an_option_that_makes_it_another_experiment_does_not_vary(study, text, said):
    with pytest.raises(InputError, match=re.escape(said)):
        read_study(study(f"[vary]\n{text}\n", OPEN_LOOP))


def test_an_option_that_names_a_file_or_a_signal_does_not_vary(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text('bench = "pedal-tracking"\n[vary]\n"options.trace" = { values = ["a", "b"] }')
    with raises(InputError, name="[vary] options.trace"):
        read_study(path)


@pytest.mark.parametrize(
    ("kind", "library"),
    [
        ("corners", ""),
        ("one-at-a-time", ""),
        ("grid", ""),
        ("sobol", ""),
        ("morris", "SALib"),
        ("sobol-indices", "SALib"),
    ],
)
def test_designs_visit_the_choices_of_an_option(study, kind, library):
    if library:
        pytest.importorskip(library)
    plan = read_study(
        study(
            '[vary]\n"options.how" = { values = ["controlled", "current-off"] }\n'
            '"motor.R_m" = "+-5 %"\n'
            f'[design]\nkind = "{kind}"\n',
            RELEASE,
        )
    )
    assert {*plan.values(0)["options.how"].tolist()} == {"controlled", "current-off"}
    assert (plan.varied[0].nominal, plan.varied[0].unit) == ("controlled", "")


def test_rare_values_are_levels_too(study):
    plan = read_study(
        study(
            '[vary]\n"adc.law" = { values = ["ideal", "quantized"], weights = [1, 100000] }\n'
            '[design]\nkind = "grid"\n'
        )
    )
    assert plan.values(0)["adc.law"].tolist() == ["quantized", "ideal", "quantized"]


@pytest.mark.parametrize("kind", ["monte-carlo", "latin-hypercube", "sobol"])
def test_correlated_single_values_rise_however_they_are_listed(study, kind):
    """An index among them would be correlated else, and its sign be that of the listing."""

    def drawn(values: str, correlation: str) -> np.ndarray:
        plan = read_study(
            study(
                '[vary]\n"motor.R_m" = "+-5 %"\n"supply.V_bat" = { kind = "discrete", '
                f'{values} }}\n{correlation}[design]\nkind = "{kind}"\n'
            )
        )
        chunks = [plan.values(k) for k in range(8)]
        return np.array([np.concatenate([c[n] for c in chunks]) for n in plan.values(0)])

    rising = 'values = ["11 V", "12 V", "14 V"], weights = [1, 1, 2]'
    others = (
        'values = ["14 V", "11 V", "12 V"], weights = [2, 1, 1]',
        'values = ["12 V", "11 V", "14 V"], weights = [1, 1, 2]',
    )
    said = '[[correlation]]\nof = ["motor.R_m", "supply.V_bat"]\nvalue = 0.8\n'
    wanted = drawn(rising, said)
    assert 0.6 < np.corrcoef(wanted)[0, 1] < 0.8
    for values in others:
        np.testing.assert_array_equal(drawn(values, said), wanted)
    assert not np.array_equal(drawn(others[0], ""), drawn(rising, ""))  # in their order, as ever


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("bench = 3", "bench = 3:"),
        ("bench = true", "bench = true:"),
        ("bench = 2010-05-27", "bench = 2010-05-27:"),
        ("", "bench is missing"),
        ('bench = "none.toml"', "none.toml"),
        ('bench = "hard-brakin"', "did you mean hard-braking"),
        ('bench = "studi.toml"', "studi.toml: No such file or directory: check the path"),
        ('bench = "study.toml"', "study.toml: this is a study, not a bench"),
    ],
)
def test_a_study_needs_a_bench(tmp_path, line, said):
    path = tmp_path / "study.toml"
    path.write_text(f'{line}\n[vary]\n"motor.R_m" = "+-5 %"\n')
    with pytest.raises(InputError, match=said):
        read_study(path)


def test_a_bench_in_the_folder_beside_is_named(tmp_path):
    for folder in ("benches", "studies"):
        (tmp_path / folder).mkdir()
    (tmp_path / "benches" / "braking.toml").write_text(RELEASE)
    path = tmp_path / "studies" / "braking_study.toml"
    path.write_text('bench = "braking.toml"\n[vary]\n"motor.R_m" = "+-5 %"\n')
    meant = "did you mean .*studies/../benches/braking.toml"
    with pytest.raises(InputError, match=meant):
        read_study(path)


def test_what_figures_depend_on_tells_studies_apart(study):
    base = '[vary]\n"motor.R_m" = "+-5 %"\n'
    digest = read_study(study(base)).digest
    same = base + '[design]\ncases = 900\n[requirements]\novershoot = "<= 9 %"'
    assert read_study(study(same)).digest == digest
    others = [
        base.replace("5", "6"),
        base + "[design]\nseed = 2",
        base + '[design]\nkind = "sobol"',
        base + '[set]\n"motor.K_e" = "+1%"',
        base.replace("R_m", "L_m"),
    ]
    digests = {read_study(study(other)).digest for other in others}
    assert len(digests | {digest}) == len(others) + 1


def test_a_study_loads_neither_libraries_nor_brakes_that_it_has_no_use_for(tmp_path):
    """Statistics, searches, or other brakes take as long to load as all else it begins with."""
    code = """
import sys
from bywire.studies.study_file import read_study
read_study(sys.argv[1]).digest
unused = {"scipy.stats", "scipy.optimize", "bywire.brakes.wedge.model"}
print(unused & {*sys.modules}, "bywire.brakes.motorcycle.model" in sys.modules)
"""
    path = tmp_path / "study.toml"
    path.write_text('bench = "hard-braking"\n[vary]\n"motor.R_m" = "+-5 %"\n')
    done = subprocess.run(
        [sys.executable, "-c", code, path], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "set() True"
