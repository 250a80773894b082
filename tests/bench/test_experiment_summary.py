"""Summaries of an experiment show the options of the bench, never their defaults."""

from __future__ import annotations

import pickle
import re
from dataclasses import replace

import pytest

import bywire
from bywire.bench.bench import Bench
from bywire.bench.experiment import EXPERIMENTS
from bywire.core.errors import ModelError, UnitError
from bywire.core.parameters import leaf_fields
from bywire.core.units import parse

QUANTITY = re.compile(r"(\d+(?:\.\d+)?) ?((?:N m|[A-Za-z%]+(?:/[a-z]+)?)?)")


def test_a_bench_says_its_own_options():
    asked = {"options.v_0": "60 km/h", "options.p_front": "30 bar", "options.surface": "snow"}
    options = {name.removeprefix("options."): value for name, value in asked.items()}
    bench = Bench("straight-stop", "sport600", options=options)
    assert bench.summary() == (
        "panic stop from 60 km/h with 30 bar at the front and 40 bar at the rear, on snow"
    )
    assert bench.definition.summary == (
        "panic stop from 100 km/h with 40 bar at the front and 40 bar at the rear, on dry asphalt"
    )
    several = bench.summary(["options.v_0", "vehicle.m"])
    assert several.startswith("panic stop from 60 km/h (varied) with 30 bar")
    friction = Bench("friction-sweep", "roberts2003", options={"mu_B": [0.3, 0.4]})
    assert friction.summary().startswith(
        "200 N·m steps at pad friction coefficients of 0.3 to 0.4:"
    )


def test_reports_of_runs_and_studies_say_it_below_their_titles(tmp_path):
    quick = {"options.duration": "40 ms", "options.settle": "10 ms", "options.p_to": "30 bar"}
    run = bywire.run("hard-braking", quick, estimate_error=False)
    assert run.document().summary.startswith(
        "simulation of motorcycle-brake: pressure step from 6 bar to 30 bar"
    )
    lines = "\n".join(f'{name} = "{value}"' for name, value in quick.items())
    text = f'bench = "hard-braking"\n[set]\n{lines}\n[vary]\n"options.p_from" = "+-5 %"\n'
    (tmp_path / "study.toml").write_text(text)
    study = bywire.run_study(tmp_path / "study.toml", tmp_path / "out", cases=64, workers=1)
    assert "of pressure step from 6 bar (varied) to 30 bar" in study.document().summary


@pytest.mark.parametrize("name", sorted(EXPERIMENTS.all()))
def test_no_summary_has_the_default_of_an_option_written_out(name):
    """Such a number would contradict a bench with a different value."""
    experiment = EXPERIMENTS.find(name)
    said = re.sub(r"\{.*?\}|\(.*?\)", "", experiment.summary.template)
    leaves = leaf_fields(experiment.options)
    for option, value in experiment.defaults.flat().items():
        for number, unit in QUANTITY.findall(said) if isinstance(value, float) else ():
            symbol = leaves[option].unit.symbol
            try:
                read = parse(f"{number} {unit.replace('N m', 'N*m')}", symbol, option)
            except UnitError:
                continue
            assert value == 0.0 or read != pytest.approx(value, rel=1e-3), (option, number, unit)


def test_a_summary_survives_copies_and_refuses_what_is_no_option():
    experiment = EXPERIMENTS.find("hard-braking")
    for copied in (
        pickle.loads(pickle.dumps(experiment.summary)),
        replace(experiment, name="another").summary,
    ):
        assert (copied, copied.template) == (experiment.summary, experiment.summary.template)
    for wrong in ("step to {p_end}", "step to {p_to", "step to {}"):
        with pytest.raises(ModelError, match="braces must contain names of options"):
            replace(experiment, summary=wrong)
