"""Warnings and gains of many cases at once are those of each for itself, whatever varies."""

from __future__ import annotations

import numpy as np
import pytest

import bywire
from bywire.bench.ensemble import changed
from bywire.bench.key_figures import key_figures_of
from bywire.bench.rows import Rows
from bywire.brakes.motorcycle.experiments import pressure_step
from bywire.core import watching
from run_once import run_once

SET = "dardanelli2010"


@pytest.mark.parametrize("name", ["fluid.nu", "pipeline.Re_max"])
def test_a_case_that_warns_by_what_varies_is_heard(name):
    bench = bywire.Bench("hard-braking", SET)
    usual = bench.par.value(name)
    benches = [changed(bench, {name: share * usual}) for share in (1.0, 1e-5, 1.1)]
    said = key_figures_of(benches).warnings
    assert [any("not laminar" in text for text in texts) for texts in said].count(True) == 1
    assert said[1] == tuple(run_once(benches[1]).warnings)


def test_elements_that_look_at_what_varies_are_silent_together(monkeypatch):
    bench = bywire.Bench("hard-braking", SET)
    given = []
    silent_parts = watching.silent_parts
    monkeypatch.setattr(
        "bywire.core.watching.silent_parts",
        lambda *of: given.append(silent_parts(*of)) or given[-1],
    )
    key_figures_of([changed(bench, {"motor.R_m": R, "fluid.nu": 1e-5 * R}) for R in (1.0, 1.1)])
    assert given[-1] == {"line", "heat", "pressure_sensor", "current_sensor"}


def test_static_gains_of_many_cases_are_those_of_each():
    random = np.random.default_rng(3)
    t = np.linspace(-0.5, 4.0, 451)
    p = 25e5 + 3e5 * (t >= 0.0) * random.uniform(0.5, 2.0, (20, 1))
    p += 1e5 * random.standard_normal(p.shape)
    rows = Rows(t, {"p_mc": p}, {"p_mc": {"units": "Pa"}})
    usual = pressure_step.EXPERIMENT.defaults
    options = [usual.replace({"i_step": 0.2 + 0.01 * k}) for k in range(20)]
    (gain,) = pressure_step.gains(rows, options)
    for k, each in enumerate(options):
        assert (gain.case(k),) == pressure_step.gain(rows.case(k), each)
    apart = [usual, usual.replace({"smoothing": 0.04})]
    assert pressure_step.gains(rows, apart) is None
    p[3, 5] = np.nan
    assert pressure_step.gains(Rows(t, {"p_mc": p}, {"p_mc": {"units": "Pa"}}), options) is None
