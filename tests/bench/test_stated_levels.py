"""Levels that sources state: of known experiments and signals, while options are as stated."""

from __future__ import annotations

import pytest

from bywire.bench.bench import Bench
from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.stated import STATED, stated_for
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


def test_a_level_holds_only_where_the_options_are_those_it_is_stated_for() -> None:
    """The values are the paper's: 200 N m held, pulses to 80 % of it."""
    usual = Bench("moment-pulses", "roberts2003")
    assert [each.value for each in stated_for(usual)] == pytest.approx([200.0, 160.0])
    deeper = Bench("moment-pulses", "roberts2003", options={"low": 0.5})
    assert [each.value for each in stated_for(deeper)] == [200.0]
    assert stated_for(Bench("moment-pulses", "roberts2003", options={"M_high": 300.0})) == []
    assert stated_for(Bench("hard-braking", "dardanelli2010")) == []
