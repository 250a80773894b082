"""Values stated by sources: for known experiments and signals, with the stated options."""

from __future__ import annotations

import pytest

from bywire.bench.bench import Bench
from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.stated import STATED, STATED_FIGURES, stated_figures, stated_for
from bywire.core.model import ASSEMBLIES
from bywire.core.signals import signals_of


def test_every_level_is_of_an_experiment_and_a_signal_that_there_are() -> None:
    levels = STATED.all().values()
    assert {each.name.partition(".")[0] for each in levels} == {"motorcycle", "wedge"}
    for each in levels:
        experiment = EXPERIMENTS.find(each.experiment)
        known = {"P_meas": "W"}  # added to the recording by the experiment
        signals = signals_of(ASSEMBLIES.find(experiment.assembly).Output)
        assert each.signal in signals or each.signal in known
        assert set(each.options) <= set(experiment.defaults.flat())
        assert each.where
        assert each.low <= min(each.levels) <= max(each.levels) <= each.high


def test_every_figure_is_one_of_its_experiment() -> None:
    figures = STATED_FIGURES.all().values()
    assert {each.name.partition(".")[0] for each in figures} == {"motorcycle", "wedge"}
    for each in figures:
        experiment = EXPERIMENTS.find(each.experiment)
        assert each.figure in experiment.kpis
        assert set(each.options) <= set(experiment.defaults.flat())
        assert each.where
        assert each.bound in ("", "<=", ">=")
        assert not (each.bound and each.tolerance)


def test_a_level_holds_only_where_the_options_are_those_it_is_stated_for() -> None:
    """The values are from the paper: 200 N m held, pulses to 80 % of it."""
    usual = Bench("moment-pulses", "roberts2003")
    assert [each.levels[0] for each in stated_for(usual)] == pytest.approx([200.0, 160.0])
    assert set(stated_figures(usual)) == {"hold_moment"}
    deeper = Bench("moment-pulses", "roberts2003", options={"low": 0.5})
    assert [each.levels for each in stated_for(deeper)] == [(200.0,)]
    higher = Bench("moment-pulses", "roberts2003", options={"M_high": 300.0})
    assert stated_for(higher) == []
    assert stated_figures(higher) == {}
    assert stated_for(Bench("hard-braking", "dardanelli2010")) == []


def test_a_range_is_that_of_the_axis_that_the_paper_draws() -> None:
    (pressures,) = stated_for(Bench("pressure-step", "dardanelli2010"))
    assert (pressures.low, pressures.high) == pressures.levels == (25e5, 29e5)
