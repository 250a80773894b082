"""Study files: what they say is what is computed, and every mistake has one clear error."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from bywire.core.errors import InputError
from bywire.studies.study_file import read_study


def test_a_study_says_what_varies_and_how(study):
    plan = read_study(study("""
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
"""))  # fmt: skip
    assert [v.name for v in plan.varied] == ["motor.R_m", "motor.K_e", "options.p_to"]
    assert (plan.design, plan.seed, plan.confidence) == ("latin-hypercube", 3, 0.99)
    assert (plan.cases, plan.chunks, plan.total) == (100, 2, 128)  # whole hypercubes
    assert plan.bench.requirements == {"peak_current": "<= 25 A", "overshoot": "<= 15 %"}
    assert [d.text for d in plan.demands][1] == "overshoot <= 15 % with 99.9 %"
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
        ('[vary]\n"motor.R_m" = "+-5 %"\n"motor.K_e" = { kind = "normal", sd = "1 %", '
         'together = ["motor.R_m"] }', ["motor.R_m varies twice"]),
        ('[vary]\n"motor.K_e" = { kind = "normal", sd = "1 %", together = ["ecu.K"] }',
         ["varies together", "'ecu.K'"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[design]\ncases = 0', ["cases = 0", "from 1"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[design]\nkind = "sobl"', ["'sobl'", "'sobol'"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[design]\nconfidence = "100 %"', ["below 100 %"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[desing]\ncases = 1', ["'desing'", "'design'"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[requirements]\novershot = "<= 15 %"', ["'overshoot'"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[requirements]\novershoot = "<= 15 % with 120 %"',
         ["120 %", "between 0"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[requirements]\novershoot = "<= 15 bar with 90 %"',
         ["overshoot", "percent"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[design]\nkind = "corners"\n[requirements]\n'
         'overshoot = "<= 15 % with 90 %"', ["draws nothing", "'monte-carlo'"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[[correlation]]\nof = ["motor.R_m", "motor.K_e"]\n'
         "value = 0.5", ["'motor.K_e'", "correlation"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n"motor.K_e" = "+-5 %"\n[[correlation]]\n'
         'of = ["motor.R_m", "motor.K_e"]\nvalue = 1.0', ["between -1 and 1"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[set]\n"motor.K_e" = 0.3', ["write the value as a text"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[design]\nlevels = 3', ["levels", "'monte-carlo'"]),
        ('[vary]\n"motor.R_m" = "+-5 %"\n[design]\nkind = "grid"\ncases = 9', ["'grid' lists"]),
        ('[vary]\n"friction.law" = { values = ["dry"] }', ["friction.law"]),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_the_files_name(study, text, texts):
    path = study(text)
    with pytest.raises(InputError) as refused:
        read_study(path)
    for each in (str(path), *texts):
        assert each in str(refused.value)


@pytest.mark.parametrize("line", ["bench = 3", "", 'bench = "none.toml"'])
def test_a_study_needs_a_bench(tmp_path, line):
    path = tmp_path / "study.toml"
    path.write_text(f'{line}\n[vary]\n"motor.R_m" = "+-5 %"\n')
    with pytest.raises(InputError, match="bench"):
        read_study(path)


def test_what_figures_depend_on_tells_studies_apart(study):
    base = '[vary]\n"motor.R_m" = "+-5 %"\n'
    digest = read_study(study(base)).digest
    same = base + '[design]\ncases = 900\n[requirements]\novershoot = "<= 9 %"'
    assert read_study(study(same)).digest == digest
    others = [
        base.replace("5", "6"), base + "[design]\nseed = 2", base + '[design]\nkind = "sobol"',
        base + '[set]\n"motor.K_e" = "+1%"', base.replace("R_m", "L_m"),
    ]  # fmt: skip
    digests = {read_study(study(other)).digest for other in others}
    assert len(digests | {digest}) == len(others) + 1


def test_a_study_loads_neither_libraries_nor_brakes_that_it_has_no_use_for(tmp_path):
    """Statistics, searches, or other brakes take as long to load as all else it begins with."""
    code = """
import sys
from bywire.api.run_study import read_study
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
